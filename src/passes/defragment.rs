//! Existing blocks and streamed words in, contiguous active blocks out, for each of the three streams of a batch.

use super::{FIND_OWNER, GROUP, INDEX, SATURATE};
use crate::gpu::Gpu;
use crate::gpu::layout::DefragmentParams;
use crate::gpu::shader::{self, Kernel, KernelLayout, Shader, read, uniform, write};

/// The declaration.
pub const SHADER: Shader = Shader {
    name: "defragment",
    pieces: &[INDEX, SATURATE, FIND_OWNER, include_str!("../../shaders/defragment.wgsl")],
    kernels: &[
        KernelLayout {
            name: "defragment_vertices",
            bindings: &[uniform(0), read(1), read(2), read(3), read(4), read(5), write(6)],
        },
        KernelLayout {
            name: "defragment_ecol",
            bindings: &[uniform(0), read(1), read(2), read(3), read(4), read(7), write(8)],
        },
        KernelLayout {
            name: "defragment_triangles",
            bindings: &[uniform(0), read(1), read(2), read(3), read(4), read(9), write(10)],
        },
    ],
};

/// What is streamed, held and drawn of an instance, each with its own budget.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stream {
    /// `vn` vertices: [`crate::gpu::layout::ActiveVertex`] when active.
    Vertices,
    /// `m_k` entries of `ecol`: one u32 each when active.
    Ecol,
    /// `tn` triangles: [`crate::geometry::TriangleRecord`] when active.
    Triangles,
}

impl Stream {
    /// All, in the order in which they lie in the streamed words and in every array of three.
    pub const ALL: [Self; 3] = [Self::Vertices, Self::Ecol, Self::Triangles];

    /// Bytes of an active element.
    pub fn active_bytes(self) -> u64 {
        match self {
            Self::Vertices => 16,
            Self::Ecol => 4,
            Self::Triangles => 8,
        }
    }

    /// Active elements of all instances.
    fn total(self, params: &DefragmentParams) -> u32 {
        match self {
            Self::Vertices => params.vertex_total,
            Self::Ecol => params.ecol_total,
            Self::Triangles => params.triangle_total,
        }
    }
}

/// The buffers of one stream of a batch. Starts have one u32 an instance and one more.
#[derive(Debug, Clone, Copy)]
pub struct DefragmentBuffers<'a> {
    /// Where each instance's active block starts.
    pub active_start: &'a wgpu::Buffer,
    /// Where it started in the last frame.
    pub existing_start: &'a wgpu::Buffer,
    /// Where its streamed elements start, counted in elements of this stream.
    pub streamed_start: &'a wgpu::Buffer,
    /// The streamed words of all streams.
    pub streamed: &'a wgpu::Buffer,
    /// The active elements of the last frame.
    pub existing: &'a wgpu::Buffer,
    /// The active elements of this frame.
    pub active: &'a wgpu::Buffer,
}

/// The pass.
#[derive(Debug)]
pub struct Defragment {
    kernels: [Kernel; 3],
}

impl Defragment {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        Self { kernels: shader::kernels(gpu, &SHADER) }
    }

    /// Records the defragmentation of one stream. The totals of `params` are the last entries of the active starts.
    pub fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        stream: Stream,
        params: &DefragmentParams,
        buffers: &DefragmentBuffers<'_>,
    ) {
        let uniform = gpu.uniform("defragment", params);
        let bound = [
            &uniform,
            buffers.active_start,
            buffers.existing_start,
            buffers.streamed_start,
            buffers.streamed,
            buffers.existing,
            buffers.active,
        ];
        let groups = stream.total(params).div_ceil(GROUP);
        self.kernels[stream as usize].dispatch(gpu, pass, &bound, groups);
    }
}
