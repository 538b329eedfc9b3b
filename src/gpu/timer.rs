//! Labels of stages in, their GPU milliseconds out, or `None` where the adapter has no timestamps.
//!
//! A frame: [`Timer::start`], then each pass is begun with the [`Timer::compute`] or [`Timer::render`] of its label,
//! then [`Timer::resolve`] into the same encoder, and after the submission [`Timer::read`]. One label may time many
//! passes; their times are added.

use super::{Gpu, GpuError, readback};

/// Timestamps of one frame's stages.
#[derive(Debug)]
pub struct Timer {
    queries: Option<Queries>,
    labels: Vec<&'static str>,
}

#[derive(Debug)]
struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    capacity: usize,
    ms_per_tick: f64,
}

/// The milliseconds of a stage; `None` if they could not be measured.
pub type StageMs = (&'static str, Option<f64>);

impl Timer {
    /// A timer for up to `capacity` passes a frame (at most 2,048); passes beyond it are not timed.
    ///
    /// # Errors
    /// That the device is lost.
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self, GpuError> {
        let capacity = capacity.clamp(1, wgpu::QUERY_SET_MAX_QUERIES as usize / 2);
        let queries = gpu.timestamps.then(|| Queries::new(gpu, capacity)).transpose()?;
        Ok(Self { queries, labels: Vec::new() })
    }

    /// Forgets the last frame.
    pub fn start(&mut self) {
        self.labels.clear();
    }

    /// What a compute pass is to be begun with so that it counts under `label`.
    pub fn compute(&mut self, label: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let (query_set, first) = self.next(label)?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// What a render pass is to be begun with so that it counts under `label`.
    pub fn render(&mut self, label: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let (query_set, first) = self.next(label)?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    fn next(&mut self, label: &'static str) -> Option<(&wgpu::QuerySet, u32)> {
        let used = self.labels.len();
        self.labels.push(label);
        let queries = self.queries.as_ref().filter(|queries| used < queries.capacity)?;
        Some((&queries.set, 2 * used as u32))
    }

    fn timed(&self) -> usize {
        self.queries.as_ref().map_or(0, |queries| self.labels.len().min(queries.capacity))
    }

    /// Records the copying of the timestamps, after the last timed pass.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let timed = self.timed();
        if let Some(queries) = self.queries.as_ref().filter(|_| timed > 0) {
            let bytes = 16 * timed as u64;
            encoder.resolve_query_set(&queries.set, 0..2 * timed as u32, &queries.resolved, 0);
            encoder.copy_buffer_to_buffer(&queries.resolved, 0, &queries.staging, 0, bytes);
        }
    }

    /// Waits for the submission, and gives each label's milliseconds, in the order of first use.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<StageMs>, GpuError> {
        let timed = self.timed();
        let passes = match &self.queries {
            Some(queries) if timed > 0 => queries.read_ms(gpu, timed)?,
            _ => Vec::new(),
        };
        let mut stages: Vec<StageMs> = Vec::new();
        for (index, &label) in self.labels.iter().enumerate() {
            add_stage(&mut stages, label, passes.get(index).copied());
        }
        Ok(stages)
    }
}

/// Adds a pass to its stage; a stage with a pass that was not measured is not measured.
fn add_stage(stages: &mut Vec<StageMs>, label: &'static str, ms: Option<f64>) {
    match stages.iter_mut().find(|stage| stage.0 == label) {
        Some(stage) => stage.1 = stage.1.zip(ms).map(|(sum, ms)| sum + ms),
        None => stages.push((label, ms)),
    }
}

impl Queries {
    fn new(gpu: &Gpu, capacity: usize) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let bytes = 16 * capacity as u64;
        Ok(Self {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timer"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * capacity as u32,
            }),
            resolved: gpu.buffer("timer", bytes, Usage::QUERY_RESOLVE | Usage::COPY_SRC)?,
            staging: gpu.buffer("timer_staging", bytes, Usage::MAP_READ | Usage::COPY_DST)?,
            capacity,
            ms_per_tick: f64::from(gpu.queue.get_timestamp_period()) * 1e-6,
        })
    }

    fn read_ms(&self, gpu: &Gpu, timed: usize) -> Result<Vec<f64>, GpuError> {
        let bytes = readback::read_mapped(gpu, &self.staging, 16 * timed as u64)?;
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&bytes);
        // Some drivers let a short pass end before it begins.
        Ok(ticks.chunks_exact(2).map(|t| t[1].saturating_sub(t[0]) as f64 * self.ms_per_tick).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_of_a_stage_are_added_and_a_gap_shows() {
        let mut stages = Vec::new();
        for (label, ms) in
            [("grant", Some(1.0)), ("reform", Some(2.0)), ("grant", Some(0.5)), ("reform", None)]
        {
            add_stage(&mut stages, label, ms);
        }
        assert_eq!(stages, [("grant", Some(1.5)), ("reform", None)]);
    }
}
