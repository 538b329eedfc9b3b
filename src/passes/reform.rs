//! Active triangles and `ecol` in, the index buffer out.

use super::{FIND_OWNER, GROUP, INDEX};
use crate::gpu::Gpu;
use crate::gpu::layout::ReformParams;
use crate::gpu::shader::{self, Kernel, KernelLayout, Shader, read, uniform, write};

/// The declaration.
pub const SHADER: Shader = Shader {
    name: "reform",
    pieces: &[INDEX, FIND_OWNER, include_str!("../../shaders/reform.wgsl")],
    kernels: &[KernelLayout {
        name: "reform",
        bindings: &[uniform(0), read(1), read(2), read(3), read(4), read(5), write(6)],
    }],
};

/// The buffers of a batch that a reformation reads and writes.
#[derive(Debug, Clone, Copy)]
pub struct ReformBuffers<'a> {
    /// Where each instance's active triangles start.
    pub triangle_start: &'a wgpu::Buffer,
    /// Where each instance's active vertices start.
    pub vertex_start: &'a wgpu::Buffer,
    /// Where each instance's active `ecol` entries start.
    pub ecol_start: &'a wgpu::Buffer,
    /// Active `ecol`.
    pub ecol: &'a wgpu::Buffer,
    /// Active triangles.
    pub triangles: &'a wgpu::Buffer,
    /// Three u32 a triangle: numbers of active vertices.
    pub indices: &'a wgpu::Buffer,
}

/// The pass.
#[derive(Debug)]
pub struct Reform {
    reform: Kernel,
}

impl Reform {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        let [reform] = shader::kernels(gpu, &SHADER);
        Self { reform }
    }

    /// Records the reformation of all active triangles.
    pub fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        params: &ReformParams,
        buffers: &ReformBuffers<'_>,
    ) {
        let uniform = gpu.uniform("reform", params);
        let bound = [
            &uniform,
            buffers.triangle_start,
            buffers.vertex_start,
            buffers.ecol_start,
            buffers.ecol,
            buffers.triangles,
            buffers.indices,
        ];
        self.reform.dispatch(gpu, pass, &bound, params.triangle_total.div_ceil(GROUP));
    }
}
