//! Stages 4 to 6 on the GPU: transfers, grants and prefix sums, defragmentation by rebuilding, reformation.

use std::time::Instant;

use super::{DRAW_BYTES, FrameError, Renderer, milliseconds_since};
use crate::gpu::batch::{Batch, STREAMS};
use crate::gpu::layout::{GrantParams, ReformParams};
use crate::gpu::timer::Timer;
use crate::gpu::{Gpu, GpuError};
use crate::passes::defragment::{DefragmentBuffers, Stream};
use crate::passes::grant::GrantBuffers;
use crate::passes::reform::ReformBuffers;
use crate::passes::{Defragment, GrantPass, PrefixSum, Reform};
use crate::stats::{FrameRecord, floor};
use crate::stream::gather::BatchUpload;

/// The passes between upload and draw.
pub(super) struct Rebuild {
    grant: GrantPass,
    prefix_sum: PrefixSum,
    defragment: Defragment,
    reform: Reform,
}

impl Rebuild {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            grant: GrantPass::new(gpu),
            prefix_sum: PrefixSum::new(gpu),
            defragment: Defragment::new(gpu),
            reform: Reform::new(gpu),
        }
    }

    pub fn size_bytes(&self) -> u64 {
        self.prefix_sum.size_bytes()
    }

    fn record_grants(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        batch: &Batch,
        upload: &BatchUpload,
    ) {
        let buffers = GrantBuffers {
            grants: &batch.grants,
            budgets: batch.budgets.each_ref(),
            streamed: batch.streamed_counts.each_ref(),
        };
        GrantPass::clear(encoder, &buffers, batch.instance_count());
        let params =
            GrantParams { grant_count: upload.grants.len() as u32, instance_count: batch.instance_count() };
        let mut pass = begin(encoder, timer, "grant");
        self.grant.record(gpu, &mut pass, &params, &buffers);
    }

    fn record_starts(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        batch: &Batch,
    ) -> Result<(), GpuError> {
        let count = batch.instance_count();
        let mut pass = begin(encoder, timer, "prefix_sum");
        for stream in 0..STREAMS {
            let sums = [
                (&batch.budgets[stream], &batch.active_starts()[stream]),
                (&batch.streamed_counts[stream], &batch.streamed_starts[stream]),
            ];
            for (counts, starts) in sums {
                self.prefix_sum.record(gpu, &mut pass, counts, count, starts)?;
            }
        }
        Ok(())
    }

    fn record_defragment(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        batch: &Batch,
        upload: &BatchUpload,
        totals: [u32; STREAMS],
    ) {
        let params = upload.layout.params(batch.instance_count(), totals);
        let mut pass = begin(encoder, timer, "defragment");
        for (i, stream) in [Stream::Vertices, Stream::Ecol, Stream::Triangles].into_iter().enumerate() {
            let buffers = DefragmentBuffers {
                active_start: &batch.active_starts()[i],
                existing_start: &batch.existing_starts()[i],
                streamed_start: &batch.streamed_starts[i],
                streamed: &batch.streamed,
                existing: &batch.existing()[i],
                active: &batch.active()[i],
            };
            self.defragment.record(gpu, &mut pass, stream, &params, &buffers);
        }
    }

    fn record_reform(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        batch: &Batch,
        totals: [u32; STREAMS],
    ) {
        let params = ReformParams { instance_count: batch.instance_count(), triangle_total: totals[2] };
        let [vertex_start, ecol_start, triangle_start] = batch.active_starts();
        let [_, ecol, triangles] = batch.active();
        let buffers = ReformBuffers {
            triangle_start,
            vertex_start,
            ecol_start,
            ecol,
            triangles,
            indices: &batch.indices,
        };
        let mut pass = begin(encoder, timer, "reform");
        self.reform.record(gpu, &mut pass, &params, &buffers);
    }
}

fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    timer: &mut Timer,
    label: &'static str,
) -> wgpu::ComputePass<'e> {
    let timestamp_writes = timer.compute(label);
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
}

impl Renderer {
    /// The `coherent` and `whole` way: one block from the staging ring.
    pub(super) fn send_in_one_block(
        &mut self,
        uploads: &[BatchUpload],
        record: &mut FrameRecord,
    ) -> Result<(), FrameError> {
        let bytes: u64 = uploads.iter().map(block_bytes).sum();
        if bytes == 0 {
            return Ok(());
        }
        let started = Instant::now();
        let residency = &self.residency;
        let block = self.staging.fill(&self.gpu, bytes, |mut out| {
            for upload in uploads {
                if let Some(mut grants) = out.split_off(..size_of_val(upload.grants.as_slice())) {
                    grants.copy_from_slice(bytemuck::cast_slice(&upload.grants));
                }
                if let Some(words) = out.split_off(..4 * upload.layout.words() as usize) {
                    upload.gather(residency, words);
                }
            }
        })?;
        record.gather_ms = milliseconds_since(started);

        let started = Instant::now();
        let mut encoder = self.gpu.encoder("upload");
        let mut from = 0;
        for (batch, upload) in self.batches.iter().zip(uploads) {
            for (buffer, bytes) in [
                (&batch.grants, size_of_val(upload.grants.as_slice()) as u64),
                (&batch.streamed, 4 * upload.layout.words()),
            ] {
                if bytes > 0 {
                    encoder.copy_buffer_to_buffer(&block, from, buffer, 0, bytes);
                }
                from += bytes;
            }
        }
        self.gpu.submit(encoder)?;
        self.staging.recycle();
        self.finish_upload(started, record)
    }

    /// The `per-part` way: every part's records are copied by themselves.
    pub(super) fn send_part_by_part(
        &mut self,
        uploads: &[BatchUpload],
        record: &mut FrameRecord,
    ) -> Result<(), FrameError> {
        let started = Instant::now();
        let gathered: Vec<Vec<u32>> = uploads.iter().map(|upload| upload.words(&self.residency)).collect();
        record.gather_ms = milliseconds_since(started);
        let started = Instant::now();
        let sent = self.batches.iter().zip(uploads).zip(&gathered);
        for ((batch, upload), words) in sent.filter(|((_, upload), _)| !upload.is_empty()) {
            self.gpu.queue.write_buffer(&batch.grants, 0, bytemuck::cast_slice(&upload.grants));
            for range in upload.word_ranges() {
                let bytes = bytemuck::cast_slice(&words[range.clone()]);
                self.gpu.queue.write_buffer(&batch.streamed, 4 * range.start as u64, bytes);
            }
        }
        let encoder = self.gpu.encoder("upload");
        self.gpu.submit(encoder)?;
        self.finish_upload(started, record)
    }

    fn finish_upload(&self, started: Instant, record: &mut FrameRecord) -> Result<(), FrameError> {
        if self.settings.time_stages {
            self.gpu.wait()?;
        }
        record.upload_ms = milliseconds_since(started);
        Ok(())
    }

    /// Stages 5 and 6 by the passes.
    pub(super) fn rebuild_on_gpu(
        &mut self,
        uploads: &[BatchUpload],
        record: &mut FrameRecord,
    ) -> Result<(), FrameError> {
        let changed: Vec<usize> = (0..uploads.len()).filter(|&batch| !uploads[batch].is_empty()).collect();
        // `ensure` has checked the totals against buffer sizes, which are far below 2^32 elements.
        let totals = |batch: usize| uploads[batch].totals.map(|total| total as u32);
        let mut clock = Instant::now();
        let mut encoder = self.gpu.encoder("defragment");
        for &number in &changed {
            let (batch, upload) = (&self.batches[number], &uploads[number]);
            self.rebuild.record_grants(&self.gpu, &mut encoder, &mut self.timer, batch, upload);
        }
        record.grant_ms = self.end_pass(&mut encoder, &mut clock)?;
        for &number in &changed {
            let batch = &self.batches[number];
            self.rebuild.record_starts(&self.gpu, &mut encoder, &mut self.timer, batch)?;
        }
        record.prefix_sum_ms = self.end_pass(&mut encoder, &mut clock)?;
        for &number in &changed {
            let (batch, upload) = (&self.batches[number], &uploads[number]);
            let (encoder, timer) = (&mut encoder, &mut self.timer);
            self.rebuild.record_defragment(&self.gpu, encoder, timer, batch, upload, totals(number));
        }
        self.gpu.submit(encoder)?;
        record.defragment_ms = record.grant_ms + record.prefix_sum_ms + self.wait_if_not_timed(clock)?;

        let started = Instant::now();
        let mut encoder = self.gpu.encoder("reform");
        for &number in &changed {
            let totals = totals(number);
            let batch = &mut self.batches[number];
            self.rebuild.record_reform(&self.gpu, &mut encoder, &mut self.timer, batch, totals);
            self.gpu.queue.write_buffer(&batch.indirect, 0, bytemuck::cast_slice(&draw_arguments(totals)));
            batch.swap(totals);
        }
        self.gpu.submit(encoder)?;
        record.reform_ms = self.wait_if_not_timed(started)?;
        self.count_floors(&changed, uploads, record);
        record.bytes_tables += DRAW_BYTES * changed.len() as u64;
        record.compute_passes += PASSES_A_BATCH * changed.len() as u64;
        Ok(())
    }

    /// What stages 5 and 6 would leave, without doing them.
    pub(super) fn count_as_rebuilt(&mut self, uploads: &[BatchUpload], record: &mut FrameRecord) {
        for (batch, upload) in self.batches.iter_mut().zip(uploads).filter(|(_, upload)| !upload.is_empty()) {
            batch.swap(upload.totals.map(|total| total as u32));
            record.bytes_tables += DRAW_BYTES;
        }
    }

    /// Where the adapter has no timestamps of its own, what was recorded so far is submitted, to be timed by itself.
    fn end_pass(&self, encoder: &mut wgpu::CommandEncoder, clock: &mut Instant) -> Result<f64, FrameError> {
        if self.gpu.timestamps || !self.settings.time_stages {
            return Ok(0.0);
        }
        self.gpu.submit(std::mem::replace(encoder, self.gpu.encoder("defragment")))?;
        let ms = self.wait_if_not_timed(*clock)?;
        *clock = Instant::now();
        Ok(ms)
    }

    /// What the passes of the rebuilt batches must move.
    fn count_floors(&self, changed: &[usize], uploads: &[BatchUpload], record: &mut FrameRecord) {
        let drawn = self.drawn_by_batch();
        for &number in changed {
            let BatchUpload { grants, layout, totals, .. } = &uploads[number];
            let rebuilt = floor::Rebuilt {
                instances: self.batches[number].instance_count().into(),
                drawn: drawn[number],
                grants: grants.len() as u64,
                active: *totals,
                streamed: [layout.vertices, layout.ecol, layout.triangles],
            };
            record.grant_floor_bytes += floor::grant(&rebuilt);
            record.prefix_sum_floor_bytes += floor::prefix_sum(&rebuilt);
            record.defragment_floor_bytes += floor::defragment(&rebuilt);
            record.reform_floor_bytes += floor::reform(&rebuilt);
        }
    }

    /// How many instances of each batch have anything on the GPU.
    fn drawn_by_batch(&self) -> Vec<u64> {
        if let [_] = self.batches.as_slice() {
            return vec![self.held.len() as u64];
        }
        let mut drawn = vec![0; self.batches.len()];
        for &instance in &self.held {
            // Dealt in turn.
            drawn[instance as usize % self.batches.len()] += 1;
        }
        drawn
    }

    /// Where the adapter has no timestamps of its own, a stage is timed by waiting for it.
    fn wait_if_not_timed(&self, started: Instant) -> Result<f64, FrameError> {
        if self.gpu.timestamps || !self.settings.time_stages {
            return Ok(0.0);
        }
        self.gpu.wait()?;
        Ok(milliseconds_since(started))
    }
}

/// Grant, prefix sums, defragment, reform.
const PASSES_A_BATCH: u64 = 4;

/// Index count, instance count, first index, base vertex, first instance.
pub(super) fn draw_arguments(totals: [u32; STREAMS]) -> [u32; 5] {
    [3 * totals[2], 1, 0, 0, 0]
}

fn block_bytes(upload: &BatchUpload) -> u64 {
    size_of_val(upload.grants.as_slice()) as u64 + 4 * upload.layout.words()
}
