//! Grants in; budgets, and how much of each is streamed, out.

use super::{GROUP, INDEX, SATURATE};
use crate::gpu::Gpu;
use crate::gpu::layout::GrantParams;
use crate::gpu::shader::{self, Kernel, KernelLayout, Shader, read, uniform, write};

/// The declaration.
pub const SHADER: Shader = Shader {
    name: "grant",
    pieces: &[INDEX, SATURATE, include_str!("../../shaders/grant.wgsl")],
    kernels: &[KernelLayout {
        name: "grant",
        bindings: &[uniform(0), read(1), write(2), write(3), write(4), write(5), write(6), write(7)],
    }],
};

/// The pass. (Its name is taken by the record, [`crate::gpu::layout::Grant`].)
#[derive(Debug)]
pub struct GrantPass {
    grant: Kernel,
}

/// The buffers of a batch that a grant changes: vertices, `ecol`, triangles; one u32 an instance each.
#[derive(Debug, Clone, Copy)]
pub struct GrantBuffers<'a> {
    /// [`crate::gpu::layout::Grant`]s, at most one an instance.
    pub grants: &'a wgpu::Buffer,
    /// How much of each stream an instance has; kept from frame to frame.
    pub budgets: [&'a wgpu::Buffer; 3],
    /// How much of each stream is streamed this frame.
    pub streamed: [&'a wgpu::Buffer; 3],
}

impl GrantPass {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        let [grant] = shader::kernels(gpu, &SHADER);
        Self { grant }
    }

    /// Records that nothing is streamed yet; to be done before the compute pass of [`GrantPass::record`].
    pub fn clear(encoder: &mut wgpu::CommandEncoder, buffers: &GrantBuffers<'_>, instance_count: u32) {
        let bytes = 4 * u64::from(instance_count);
        for streamed in buffers.streamed.into_iter().filter(|_| bytes > 0) {
            encoder.clear_buffer(streamed, 0, Some(bytes));
        }
    }

    /// Records the grants: budgets and streamed counts of the granted instances change, all others stay.
    pub fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        params: &GrantParams,
        buffers: &GrantBuffers<'_>,
    ) {
        let uniform = gpu.uniform("grant", params);
        let [v, e, t] = buffers.budgets;
        let [streamed_v, streamed_e, streamed_t] = buffers.streamed;
        let bound = [&uniform, buffers.grants, v, e, t, streamed_v, streamed_e, streamed_t];
        self.grant.dispatch(gpu, pass, &bound, params.grant_count.div_ceil(GROUP));
    }
}
