//! Counts in, starts out: exclusive sums with the total as one more entry.

use super::{INDEX, SATURATE, Scratch};
use crate::gpu::layout::PrefixSumParams;
use crate::gpu::shader::{self, Kernel, KernelLayout, Shader, read, uniform, write};
use crate::gpu::{Gpu, GpuError};

/// Elements that one workgroup sums.
pub(crate) const BLOCK: u32 = 256;

/// The declaration.
pub const SHADER: Shader = Shader {
    name: "prefix_sum",
    pieces: &[INDEX, SATURATE, include_str!("../../shaders/prefix_sum.wgsl")],
    kernels: &[
        KernelLayout { name: "prefix_sum_blocks", bindings: &[uniform(0), read(1), write(2), write(3)] },
        KernelLayout { name: "prefix_sum_add", bindings: &[uniform(0), read(1), write(2)] },
    ],
};

/// The pass, with the sums of blocks that it needs in between.
#[derive(Debug)]
pub struct PrefixSum {
    blocks: Kernel,
    add: Kernel,
    levels: Vec<Level>,
}

/// The blocks of one level: their totals, and the exclusive sums of these.
#[derive(Debug)]
struct Level {
    totals: Scratch,
    sums: Scratch,
}

impl PrefixSum {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        let [blocks, add] = shader::kernels(gpu, &SHADER);
        Self { blocks, add, levels: Vec::new() }
    }

    /// Records the sums of the first `count` values of `input` (u32) into the first `count + 1` of `output`.
    ///
    /// A sum above 2^32 - 1 is given as 2^32 - 1. `input` and `output` are different buffers.
    ///
    /// # Errors
    /// That the adapter allows no buffer for the sums of blocks.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        input: &wgpu::Buffer,
        count: u32,
        output: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        let counts = level_counts(count.saturating_add(1));
        let mut inputs = vec![(input.clone(), count)];
        let mut outputs = vec![output.clone()];
        for (depth, &output_count) in counts.iter().enumerate() {
            let block_count = output_count.div_ceil(BLOCK);
            let [totals, sums] = self.level(gpu, depth, block_count)?;
            let (input, input_count) = &inputs[depth];
            let params = PrefixSumParams { input_count: *input_count, output_count };
            let params = gpu.uniform("prefix_sum", &params);
            self.blocks.dispatch(gpu, pass, &[&params, input, &outputs[depth], &totals], block_count);
            inputs.push((totals, block_count));
            outputs.push(sums);
        }
        self.record_add(gpu, pass, &counts, &outputs);
        Ok(())
    }

    /// Adds to each level but the last, deepest first, what the next one found to come before its blocks.
    fn record_add(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        counts: &[u32],
        outputs: &[wgpu::Buffer],
    ) {
        for depth in (0..counts.len() - 1).rev() {
            let params = PrefixSumParams { input_count: 0, output_count: counts[depth] };
            let params = gpu.uniform("prefix_sum", &params);
            let buffers = [&params, &outputs[depth + 1], &outputs[depth]];
            self.add.dispatch(gpu, pass, &buffers, counts[depth].div_ceil(BLOCK));
        }
    }

    fn level(&mut self, gpu: &Gpu, depth: usize, block_count: u32) -> Result<[wgpu::Buffer; 2], GpuError> {
        if depth == self.levels.len() {
            let [totals, sums] = ["prefix_sum_totals", "prefix_sum_sums"].map(Scratch::new);
            self.levels.push(Level { totals, sums });
        }
        let Level { totals, sums } = &mut self.levels[depth];
        let bytes = 4 * u64::from(block_count);
        Ok([totals.at_least(gpu, bytes)?, sums.at_least(gpu, bytes)?])
    }

    /// Bytes of its own buffers.
    pub fn size_bytes(&self) -> u64 {
        self.levels.iter().map(|level| level.totals.size_bytes() + level.sums.size_bytes()).sum()
    }
}

/// How many sums each level has: the last one fits one block.
pub(crate) fn level_counts(count: u32) -> Vec<u32> {
    let mut counts = vec![count];
    let mut last = count;
    while last > BLOCK {
        last = last.div_ceil(BLOCK);
        counts.push(last);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_with_one_block() {
        assert_eq!(level_counts(1), [1]);
        assert_eq!(level_counts(256), [256]);
        assert_eq!(level_counts(257), [257, 2]);
        assert_eq!(level_counts(u32::MAX), [u32::MAX, 1 << 24, 1 << 16, 1 << 8]);
    }
}
