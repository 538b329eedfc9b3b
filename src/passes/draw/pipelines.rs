//! The pipelines of the draw pass: made when they are first asked for, kept then.

use crate::gpu::target::{COLOUR_FORMAT, DEPTH_FORMAT};

use super::ACTIVE_VERTEX_BYTES;

/// What a pipeline draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Drawn {
    /// Triangles of batches.
    Scene,
    /// The same with their edges as lines.
    Edged,
    /// Boxes.
    Boxes,
    /// The background.
    Background,
}

/// Which pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Kind {
    pub drawn: Drawn,
    /// Whether there are sections, or ghosts: not all samples of a surface are covered.
    pub is_cut: bool,
}

/// What all pipelines share.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub module: wgpu::ShaderModule,
    pub samples: u32,
    pub frame: wgpu::BindGroupLayout,
    pub instances: wgpu::BindGroupLayout,
    pub edged: wgpu::BindGroupLayout,
}

impl Pipelines {
    pub fn make(&self, device: &wgpu::Device, kind: Kind) -> wgpu::RenderPipeline {
        let (frame, instances, edged) = (Some(&self.frame), Some(&self.instances), Some(&self.edged));
        let surface = if kind.is_cut { "cut_fragment" } else { "draw_fragment" };
        let edged_surface = if kind.is_cut { "edged_cut_fragment" } else { "edged_fragment" };
        let vertices = [Some(active_vertices())];
        match kind.drawn {
            Drawn::Scene => {
                self.pipeline(device, "draw", ["draw_vertex", surface], &[frame, instances], &vertices)
            }
            Drawn::Edged => self.pipeline(
                device,
                "edges",
                ["edged_vertex", edged_surface],
                &[frame, instances, edged],
                &[],
            ),
            Drawn::Boxes => self.pipeline(device, "boxes", ["box_vertex", surface], &[frame, instances], &[]),
            Drawn::Background => {
                self.pipeline(device, "background", ["background_vertex", "background_fragment"], &[], &[])
            }
        }
    }

    fn pipeline(
        &self,
        device: &wgpu::Device,
        label: &str,
        [vertex, fragment]: [&str; 2],
        groups: &[Option<&wgpu::BindGroupLayout>],
        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    ) -> wgpu::RenderPipeline {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        // Constants that an entry point does not use may not be given.
        let constants = [("SAMPLES", f64::from(self.samples))];
        let is_cut = fragment.ends_with("cut_fragment");
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(depth_state(label != "background")),
            multisample: wgpu::MultisampleState { count: self.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(fragment),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: if is_cut { &constants } else { &[] },
                    ..Default::default()
                },
                targets: &[Some(COLOUR_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// The vertex buffer of a batch.
pub(in crate::passes) fn active_vertices() -> wgpu::VertexBufferLayout<'static> {
    wgpu::VertexBufferLayout {
        array_stride: ACTIVE_VERTEX_BYTES,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &[wgpu::VertexAttribute {
            format: wgpu::VertexFormat::Uint32x4,
            offset: 0,
            shader_location: 0,
        }],
    }
}

/// Surfaces write their depth; the background is where nothing did.
pub(in crate::passes) fn depth_state(write: bool) -> wgpu::DepthStencilState {
    use wgpu::CompareFunction as Compare;
    wgpu::DepthStencilState {
        format: DEPTH_FORMAT,
        depth_write_enabled: Some(write),
        depth_compare: Some(if write { Compare::Greater } else { Compare::GreaterEqual }),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}
