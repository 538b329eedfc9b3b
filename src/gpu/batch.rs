//! The buffers of one batch: everything that a set of instances has on the GPU, in one binding each.
//!
//! Active data is kept twice: what the last frame built is *existing* for the next. Start lists likewise. The copy that
//! is about to be written may be replaced by a larger one at any time, because nothing in it is needed any more.

use super::{Gpu, GpuError};
use crate::passes::draw::{DrawPass, InstanceRow, Look, LookRow};

/// Vertices, `ecol`, triangles: the streams, in the order of every array of three.
pub const STREAMS: usize = 3;
/// Bytes of one active element of each stream.
pub const ACTIVE_BYTES: [u64; STREAMS] = [16, 4, 8];
/// Bytes of a triangle in the index buffer.
pub const INDEX_BYTES: u64 = 12;
/// Buffers are made this much larger than asked for, so that they rarely grow.
const SLACK: f64 = 1.25;

const NAMES: [&str; STREAMS] = ["vertices", "ecol", "triangles"];

/// One batch.
#[derive(Debug)]
pub struct Batch {
    /// Its instances, as numbers in the scene, by their batch-local number.
    pub instances: Vec<u32>,
    /// How much of each stream every instance has.
    pub budgets: [wgpu::Buffer; STREAMS],
    /// How much of each stream every instance is sent this frame.
    pub streamed_counts: [wgpu::Buffer; STREAMS],
    /// Prefix sums of `streamed_counts`.
    pub streamed_starts: [wgpu::Buffer; STREAMS],
    /// Prefix sums of `budgets`, of this frame and of the last.
    starts: [[wgpu::Buffer; STREAMS]; 2],
    /// Active elements, of this frame and of the last.
    active: [[wgpu::Buffer; STREAMS]; 2],
    /// Grants of this frame.
    pub grants: wgpu::Buffer,
    /// Streamed words of this frame.
    pub streamed: wgpu::Buffer,
    /// The index buffer.
    pub indices: wgpu::Buffer,
    /// Arguments of its one indirect draw.
    pub indirect: wgpu::Buffer,
    /// The tables of its instances, bound for drawing.
    pub rows_group: wgpu::BindGroup,
    rows: wgpu::Buffer,
    looks: wgpu::Buffer,
    /// Which copy is existing.
    existing: usize,
    /// Active elements of each stream in the existing copy.
    pub totals: [u32; STREAMS],
}

impl Batch {
    /// A batch that holds nothing of its instances yet.
    ///
    /// # Errors
    /// The tables do not fit the adapter's limits.
    pub fn new(
        gpu: &Gpu,
        draw: &DrawPass,
        instances: Vec<u32>,
        rows: &[InstanceRow],
    ) -> Result<Self, GpuError> {
        let counts = 4 * (instances.len() as u64 + 1);
        let storage = |label: &'static str, bytes| gpu.storage(label, bytes);
        let three = |label: &'static str, bytes: u64| -> Result<[wgpu::Buffer; STREAMS], GpuError> {
            Ok([storage(label, bytes)?, storage(label, bytes)?, storage(label, bytes)?])
        };
        let rows_buffer = storage("instance rows", size_of_val(rows) as u64)?;
        gpu.queue.write_buffer(&rows_buffer, 0, bytemuck::cast_slice(rows));
        let looks = storage("looks", size_of::<LookRow>() as u64 * instances.len() as u64)?;
        Ok(Self {
            budgets: three("budgets", counts)?,
            streamed_counts: three("streamed counts", counts)?,
            streamed_starts: three("streamed starts", counts)?,
            starts: [three("starts", counts)?, three("starts", counts)?],
            active: [three("active", 16)?, three("active", 16)?],
            grants: storage("grants", 16)?,
            streamed: storage("streamed", 16)?,
            indices: index_buffer(gpu, 16)?,
            indirect: gpu.buffer(
                "indirect",
                20,
                wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::COPY_DST,
            )?,
            rows_group: draw.bind_instances(&gpu.device, &rows_buffer, &looks),
            rows: rows_buffer,
            looks,
            existing: 0,
            totals: [0; STREAMS],
            instances,
        })
    }

    /// Sends how its instances look, given all looks of the scene; returns the bytes.
    pub fn write_looks(&self, gpu: &Gpu, looks: &[Look]) -> u64 {
        let row = |&number: &u32| LookRow { number, look: looks[number as usize] };
        let rows: Vec<LookRow> = self.instances.iter().map(row).collect();
        gpu.queue.write_buffer(&self.looks, 0, bytemuck::cast_slice(&rows));
        size_of_val(rows.as_slice()) as u64
    }

    /// How many instances it has.
    pub fn instance_count(&self) -> u32 {
        self.instances.len() as u32
    }

    /// The start lists of the frame that is being built.
    pub fn active_starts(&self) -> &[wgpu::Buffer; STREAMS] {
        &self.starts[1 - self.existing]
    }

    /// The start lists of the last frame.
    pub fn existing_starts(&self) -> &[wgpu::Buffer; STREAMS] {
        &self.starts[self.existing]
    }

    /// The elements of the frame that is being built.
    pub fn active(&self) -> &[wgpu::Buffer; STREAMS] {
        &self.active[1 - self.existing]
    }

    /// The elements of the last frame.
    pub fn existing(&self) -> &[wgpu::Buffer; STREAMS] {
        &self.active[self.existing]
    }

    /// Makes what is being built what is there.
    pub fn swap(&mut self, totals: [u32; STREAMS]) {
        self.existing = 1 - self.existing;
        self.totals = totals;
    }

    /// Makes room for a frame: active elements of each stream, streamed words, grants.
    ///
    /// # Errors
    /// Something does not fit the adapter's limits.
    pub fn ensure(
        &mut self,
        gpu: &Gpu,
        totals: [u64; STREAMS],
        streamed_words: u64,
        grants: u64,
        sizing: Sizing,
    ) -> Result<(), GpuError> {
        for stream in 0..STREAMS {
            let bytes = totals[stream] * ACTIVE_BYTES[stream];
            sizing.fit(gpu, &mut self.active[1 - self.existing][stream], bytes, |gpu, size| {
                active_buffer(gpu, stream, size)
            })?;
        }
        sizing.fit(gpu, &mut self.indices, totals[2] * INDEX_BYTES, index_buffer)?;
        let storage = |label: &'static str| move |gpu: &Gpu, size: u64| gpu.storage(label, size);
        sizing.fit(gpu, &mut self.streamed, streamed_words * 4, storage("streamed"))?;
        sizing.fit(gpu, &mut self.grants, grants * 16, storage("grants"))
    }

    /// Bytes of the buffers whose size does not depend on what is drawn.
    pub fn fixed_bytes(&self) -> u64 {
        let threes =
            [&self.budgets, &self.streamed_counts, &self.streamed_starts].into_iter().chain(&self.starts);
        threes.flatten().chain([&self.indirect, &self.rows, &self.looks]).map(wgpu::Buffer::size).sum()
    }

    /// Bytes of all its buffers.
    pub fn size_bytes(&self) -> u64 {
        let threes = [&self.budgets, &self.streamed_counts, &self.streamed_starts]
            .into_iter()
            .chain(&self.starts)
            .chain(&self.active);
        let single = [&self.grants, &self.streamed, &self.indices, &self.indirect, &self.rows, &self.looks];
        threes.flatten().chain(single).map(wgpu::Buffer::size).sum()
    }
}

/// Whether active and streamed elements of these counts fit buffers of `limit_bytes`.
pub fn fits(limit_bytes: u64, totals: [u64; STREAMS], streamed_words: u64) -> bool {
    let active = (0..STREAMS).all(|stream| totals[stream] * ACTIVE_BYTES[stream] <= limit_bytes);
    active && totals[2] * INDEX_BYTES <= limit_bytes && streamed_words * 4 <= limit_bytes
}

fn index_buffer(gpu: &Gpu, size: u64) -> Result<wgpu::Buffer, GpuError> {
    use wgpu::BufferUsages as Usage;
    gpu.buffer("indices", size, Usage::STORAGE | Usage::INDEX | Usage::COPY_SRC | Usage::COPY_DST)
}

fn active_buffer(gpu: &Gpu, stream: usize, size: u64) -> Result<wgpu::Buffer, GpuError> {
    use wgpu::BufferUsages as Usage;
    let usage = Usage::STORAGE | Usage::VERTEX | Usage::COPY_SRC | Usage::COPY_DST;
    gpu.buffer(&format!("active {}", NAMES[stream]), size, usage)
}

/// How large buffers are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sizing {
    /// With room to grow, and never smaller again.
    Roomy,
    /// As large as needed, and smaller again when less is: under a cap.
    Tight,
}

/// A tight buffer is replaced when it is more than this share larger than needed, an eighth; made half as much larger.
const TIGHT_SHARE: u64 = 8;
/// What is smaller is never replaced by something smaller still.
const SMALL: u64 = 1 << 12;

impl Sizing {
    /// The most that a buffer for so many bytes takes.
    pub fn most(self, bytes: u64) -> u64 {
        match self {
            Self::Roomy => (bytes as f64 * SLACK) as u64,
            Self::Tight => bytes + bytes / TIGHT_SHARE + SMALL,
        }
    }

    /// Replaces a buffer that is too small or too large; what it held is lost.
    fn fit(
        self,
        gpu: &Gpu,
        buffer: &mut wgpu::Buffer,
        bytes: u64,
        make: impl Fn(&Gpu, u64) -> Result<wgpu::Buffer, GpuError>,
    ) -> Result<(), GpuError> {
        let is_large = self == Self::Tight && buffer.size() > self.most(bytes);
        if buffer.size() >= bytes && !is_large {
            return Ok(());
        }
        let roomy = match self {
            Self::Roomy => self.most(bytes),
            Self::Tight => bytes + bytes / (2 * TIGHT_SHARE),
        };
        if self == Self::Tight {
            // The old one goes first, so that both are never there.
            *buffer = make(gpu, 16)?;
        }
        *buffer = make(gpu, roomy.min(gpu.storage_limit_bytes()).max(bytes).max(16).next_multiple_of(4))?;
        Ok(())
    }
}

/// The most bytes of the buffers of a batch whose size depends on what is drawn, while a frame is made: two copies of what
/// is active, indices, and what is streamed.
pub fn drawn_bytes(sizing: Sizing, totals: [u64; STREAMS], streamed_words: u64, grants: u64) -> u64 {
    let active: u64 = (0..STREAMS).map(|stream| 2 * sizing.most(totals[stream] * ACTIVE_BYTES[stream])).sum();
    let [indices, streamed, grants] =
        [totals[2] * INDEX_BYTES, 4 * streamed_words, 16 * grants].map(|bytes| sizing.most(bytes));
    active + indices + streamed + grants
}
