//! Candidates and a view in, their wishes out, by the GPU: in the same frame, or in a later one.

use crate::gpu::layout::{SelectParams, SelectRow};
use crate::gpu::read_ring::ReadRing;
use crate::gpu::{Gpu, GpuError};
use crate::passes::select::SelectBuffers;
use crate::passes::{PrefixSum, Scratch, Select};

/// Instances, ascending, and their wishes; all others wish 0.
pub type Found = (Vec<u32>, Vec<u32>);

/// The pass with its tables, and what is on its way back.
pub struct GpuSelect {
    pass: Select,
    prefix_sum: PrefixSum,
    rows: wgpu::Buffer,
    wishes: wgpu::Buffer,
    found: Scratch,
    /// The candidates of this time, and those of the last.
    candidates: [Scratch; 2],
    previous_count: u32,
    back: ReadRing<Vec<u32>>,
    has_answered: bool,
}

impl GpuSelect {
    /// Whether the adapter can bind a buffer of so many rows.
    pub fn fits(gpu: &Gpu, instances: usize) -> bool {
        (instances * size_of::<SelectRow>()) as u64 <= gpu.storage_limit_bytes()
    }

    /// Uploads the rows.
    ///
    /// # Errors
    /// The adapter has no room for them.
    pub fn new(gpu: &Gpu, rows: &[SelectRow]) -> Result<Self, GpuError> {
        let buffer = gpu.storage("select_rows", std::mem::size_of_val(rows).max(64) as u64)?;
        gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(rows));
        Ok(Self {
            pass: Select::new(gpu),
            prefix_sum: PrefixSum::new(gpu),
            rows: buffer,
            wishes: gpu.storage("select_wishes", 4 * rows.len().max(1) as u64)?,
            found: Scratch::new("select_found"),
            candidates: ["select_candidates", "select_candidates"].map(Scratch::new),
            previous_count: 0,
            back: ReadRing::default(),
            has_answered: false,
        })
    }

    /// Selects among the candidates (ascending; all that are not culled, at least), unless so much is under way that the
    /// answer would come too late to be of use. Gives what [`GpuSelect::receive`] gives.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        params: &SelectParams,
        candidates: &[u32],
        wait: bool,
    ) -> Result<Option<Found>, GpuError> {
        if wait || self.back.has_room() {
            self.submit(gpu, params, candidates)?;
        }
        // There is nothing to go on with before the first answer.
        self.receive(gpu, wait || !self.has_answered)
    }

    /// The newest answer that is there; with `wait` that of the last [`GpuSelect::update`]. `None` if there is no new one.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn receive(&mut self, gpu: &Gpu, wait: bool) -> Result<Option<Found>, GpuError> {
        let newest = self.back.newest(gpu, wait)?;
        self.has_answered |= newest.is_some();
        Ok(newest.map(|(instances, mut bytes)| {
            bytes.truncate(4 * instances.len());
            (instances, bytemuck::pod_collect_to_vec(&bytes))
        }))
    }

    /// Whether an answer is on its way.
    pub fn is_busy(&self) -> bool {
        !self.back.is_empty()
    }

    fn submit(&mut self, gpu: &Gpu, params: &SelectParams, candidates: &[u32]) -> Result<(), GpuError> {
        let count = candidates.len() as u32;
        let params = SelectParams { candidate_count: count, previous_count: self.previous_count, ..*params };
        // One more than none, so that an answer comes back that there is none.
        let bytes = 4 * u64::from(count.max(1));
        self.candidates.swap(0, 1);
        let [now, previous] = &mut self.candidates;
        let (now, previous) = (now.at_least(gpu, bytes)?, previous.at_least(gpu, 4)?);
        let found = self.found.at_least(gpu, bytes)?;
        gpu.queue.write_buffer(&now, 0, bytemuck::cast_slice(candidates));
        let mut encoder = gpu.encoder("select");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("select"),
                timestamp_writes: None,
            });
            let buffers = SelectBuffers {
                rows: &self.rows,
                candidates: &now,
                previous: &previous,
                wishes: &self.wishes,
                found: &found,
            };
            self.pass.record(gpu, &mut pass, &mut self.prefix_sum, &params, &buffers)?;
        }
        self.back.copy(gpu, &mut encoder, &found, bytes)?;
        gpu.submit(encoder)?;
        self.back.submitted(candidates.to_vec());
        self.previous_count = count;
        Ok(())
    }

    /// Bytes of GPU memory.
    pub fn size_bytes(&self) -> u64 {
        let own = self.rows.size() + self.wishes.size() + self.found.size_bytes() + self.back.size_bytes();
        own + self.candidates.iter().map(Scratch::size_bytes).sum::<u64>()
            + self.pass.size_bytes()
            + self.prefix_sum.size_bytes()
    }
}
