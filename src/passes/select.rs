//! Rows of instances, the candidates among them and a view in, wished budgets out.

use super::{GROUP, INDEX, POWER, PrefixSum, SATURATE, Scratch};
use crate::gpu::layout::{SelectParams, SelectState, Weighed};
use crate::gpu::shader::{self, Kernel, KernelLayout, Shader, read, uniform, write};
use crate::gpu::{Gpu, GpuError};

/// Rounds of the search: hexadecimal digits of an f32.
const ROUNDS: usize = 8;
/// Candidates of a round.
const WAYS: u64 = 16;

/// The declaration.
pub const SHADER: Shader = Shader {
    name: "select",
    pieces: &[INDEX, SATURATE, POWER, include_str!("../../shaders/select.wgsl")],
    kernels: &[
        KernelLayout {
            name: "select_weigh",
            bindings: &[uniform(0), read(1), read(2), write(3), write(4), read(9)],
        },
        KernelLayout { name: "select_clear", bindings: &[uniform(0), write(8), read(10)] },
        KernelLayout { name: "select_spend", bindings: &[uniform(0), write(3), write(4), write(5)] },
        KernelLayout { name: "select_narrow", bindings: &[uniform(0), write(4), write(5)] },
        KernelLayout { name: "select_jump", bindings: &[uniform(0), write(3), write(4), write(6)] },
        KernelLayout {
            name: "select_deal",
            bindings: &[uniform(0), write(3), write(4), write(6), read(7), write(8), read(9), write(11)],
        },
    ],
};

/// The buffers of a selection.
#[derive(Debug, Clone, Copy)]
pub struct SelectBuffers<'a> {
    /// One [`crate::gpu::layout::SelectRow`] an instance.
    pub rows: &'a wgpu::Buffer,
    /// The instances to look at, ascending, one u32 each: all that are not culled, at least.
    pub candidates: &'a wgpu::Buffer,
    /// The candidates of the last time, one u32 each.
    pub previous: &'a wgpu::Buffer,
    /// The wished vertex counts, one u32 an instance: of the last time before, and of this time after. 0 for all but the
    /// candidates.
    pub wishes: &'a wgpu::Buffer,
    /// The wished vertex counts of the candidates alone, one u32 each.
    pub found: &'a wgpu::Buffer,
}

/// The pass, with what it needs in between.
#[derive(Debug)]
pub struct Select {
    kernels: [Kernel; 6],
    weighed: Scratch,
    state: Scratch,
    partials: Scratch,
    jumps: Scratch,
    jump_start: Scratch,
}

/// The buffers in between, of the right size.
struct Between {
    weighed: wgpu::Buffer,
    state: wgpu::Buffer,
    partials: wgpu::Buffer,
    jumps: wgpu::Buffer,
    jump_start: wgpu::Buffer,
}

impl Select {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            kernels: shader::kernels(gpu, &SHADER),
            weighed: Scratch::new("select_weighed"),
            state: Scratch::new("select_state"),
            partials: Scratch::new("select_partials"),
            jumps: Scratch::new("select_jumps"),
            jump_start: Scratch::new("select_jump_start"),
        }
    }

    /// Records a selection; the wishes are those of [`crate::reference::select::select`].
    ///
    /// # Errors
    /// That the adapter allows no buffer for that many candidates.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        prefix_sum: &mut PrefixSum,
        params: &SelectParams,
        buffers: &SelectBuffers<'_>,
    ) -> Result<(), GpuError> {
        let count = params.candidate_count;
        let groups = count.div_ceil(GROUP);
        let between = self.between(gpu, count)?;
        let Between { weighed, state, partials, jumps, jump_start } = &between;
        let uniform = &gpu.uniform("select", params);
        let [weigh, clear, spend, narrow, jump, deal] = &self.kernels;
        let SelectBuffers { rows, candidates, previous, wishes, found } = buffers;
        weigh.dispatch(gpu, pass, &[uniform, rows, wishes, weighed, state, candidates], groups);
        clear.dispatch(gpu, pass, &[uniform, wishes, previous], params.previous_count.div_ceil(GROUP));
        if count == 0 {
            return Ok(());
        }
        for _ in 0..ROUNDS {
            spend.dispatch(gpu, pass, &[uniform, weighed, state, partials], groups);
            narrow.dispatch(gpu, pass, &[uniform, state, partials], 1);
        }
        jump.dispatch(gpu, pass, &[uniform, weighed, state, jumps], groups);
        prefix_sum.record(gpu, pass, jumps, count, jump_start)?;
        let dealt = [uniform, weighed, state, jumps, jump_start, wishes, candidates, found];
        deal.dispatch(gpu, pass, &dealt, groups);
        Ok(())
    }

    fn between(&mut self, gpu: &Gpu, count: u32) -> Result<Between, GpuError> {
        let (instances, groups) = (u64::from(count), u64::from(count.div_ceil(GROUP)));
        Ok(Between {
            weighed: self.weighed.at_least(gpu, size_of::<Weighed>() as u64 * instances)?,
            state: self.state.at_least(gpu, size_of::<SelectState>() as u64)?,
            partials: self.partials.at_least(gpu, 4 * WAYS * groups)?,
            jumps: self.jumps.at_least(gpu, 4 * instances)?,
            jump_start: self.jump_start.at_least(gpu, 4 * (instances + 1))?,
        })
    }

    /// Bytes of its own buffers.
    pub fn size_bytes(&self) -> u64 {
        [&self.weighed, &self.state, &self.partials, &self.jumps, &self.jump_start]
            .map(Scratch::size_bytes)
            .iter()
            .sum()
    }
}
