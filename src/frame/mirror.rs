//! Stages 5 and 6 by the CPU references: a batch's buffers as vectors.
//!
//! Used to tell which side is wrong when a picture is: `fly --reference cpu` runs everything between upload and draw
//! here, and copies only the results to the GPU.

use std::time::Instant;

use super::rebuild::draw_arguments;
use super::{FrameError, Renderer, milliseconds_since};
use crate::geometry::{TriangleRecord, VertexRecord};
use crate::gpu::batch::STREAMS;
use crate::gpu::layout::ActiveVertex;
use crate::reference::defragment::{Starts, defragment};
use crate::reference::{grant, prefix_sum, reform};
use crate::stats::FrameRecord;
use crate::stream::gather::BatchUpload;

/// What one batch holds.
#[derive(Debug, Default)]
pub(super) struct Mirror {
    budgets: [Vec<u32>; STREAMS],
    starts: [Vec<u32>; STREAMS],
    vertices: Vec<VertexRecord>,
    ecol: Vec<u32>,
    triangles: Vec<TriangleRecord>,
    indices: Vec<u32>,
}

impl Mirror {
    pub fn new(instances: usize) -> Self {
        let zeros = |count: usize| [vec![0; count], vec![0; count], vec![0; count]];
        Self { budgets: zeros(instances), starts: zeros(instances + 1), ..Self::default() }
    }

    /// Grants, prefix sums, defragmentation and reformation, one after the other.
    fn rebuild(&mut self, upload: &BatchUpload, words: &[u32]) {
        let [v, e, t] = &mut self.budgets;
        let streamed_counts = grant::grant(&upload.grants, [v, e, t]);
        let streamed_starts = streamed_counts.each_ref().map(|counts| prefix_sum::prefix_sum(counts));
        let active_starts = self.budgets.each_ref().map(|counts| prefix_sum::prefix_sum(counts));
        let starts = |stream: usize| Starts {
            active: &active_starts[stream],
            existing: &self.starts[stream],
            streamed: &streamed_starts[stream],
        };
        let (vertices, ecol, triangles) = streamed_records(upload, words);
        let vertices = defragment(starts(0), &self.vertices, &vertices);
        let ecol = defragment(starts(1), &self.ecol, &ecol);
        let triangles = defragment(starts(2), &self.triangles, &triangles);
        (self.vertices, self.ecol, self.triangles) = (vertices, ecol, triangles);
        self.starts = active_starts;
        let [vertex_start, ecol_start, triangle_start] = &self.starts;
        self.indices = reform::reform(triangle_start, vertex_start, ecol_start, &self.ecol, &self.triangles);
    }

    /// The vertices with the number of their instance, as the GPU keeps them.
    fn active_vertices(&self) -> Vec<ActiveVertex> {
        let blocks = self.starts[0].windows(2).enumerate();
        blocks
            .flat_map(|(instance, block)| {
                let records = &self.vertices[block[0] as usize..block[1] as usize];
                records.iter().map(move |&record| ActiveVertex { record, instance: instance as u32 })
            })
            .collect()
    }

    fn totals(&self) -> [u32; STREAMS] {
        self.starts.each_ref().map(|starts| starts.last().copied().unwrap_or(0))
    }
}

/// The three streams of a streamed buffer.
fn streamed_records(
    upload: &BatchUpload,
    words: &[u32],
) -> (Vec<VertexRecord>, Vec<u32>, Vec<TriangleRecord>) {
    let layout = upload.layout;
    let (ecol_base, triangle_base) = (layout.ecol_base() as usize, layout.triangle_base() as usize);
    let vertices = bytemuck::cast_slice(&words[..ecol_base]).to_vec();
    let halves: &[u16] = bytemuck::cast_slice(&words[ecol_base..triangle_base]);
    let ecol = halves[..layout.ecol as usize].iter().map(|&target| u32::from(target)).collect();
    let triangles = bytemuck::cast_slice(&words[triangle_base..]).to_vec();
    (vertices, ecol, triangles)
}

impl Renderer {
    /// Stages 5 and 6 by the references; the GPU gets the results.
    pub(super) fn rebuild_on_reference(
        &mut self,
        uploads: &[BatchUpload],
        record: &mut FrameRecord,
    ) -> Result<(), FrameError> {
        let started = Instant::now();
        let batches = self.batches.iter_mut().zip(&mut self.mirrors).zip(uploads);
        for ((batch, mirror), upload) in batches.filter(|(_, upload)| !upload.is_empty()) {
            mirror.rebuild(upload, &upload.words(&self.residency));
            let queue = &self.gpu.queue;
            queue.write_buffer(&batch.active()[0], 0, bytemuck::cast_slice(&mirror.active_vertices()));
            queue.write_buffer(&batch.indices, 0, bytemuck::cast_slice(&mirror.indices));
            queue.write_buffer(&batch.indirect, 0, bytemuck::cast_slice(&draw_arguments(mirror.totals())));
            batch.swap(mirror.totals());
        }
        record.defragment_ms = milliseconds_since(started);
        Ok(())
    }
}
