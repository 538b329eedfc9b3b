//! The pipelines of the draw pass: made when they are first asked for, kept then.

use crate::gpu::target::{COLOUR_FORMAT, depth_format};

use super::{ACTIVE_VERTEX_BYTES, Cut};

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
    pub cut: Cut,
}

/// What all pipelines share.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub module: wgpu::ShaderModule,
    /// Where the device clips by distances.
    pub clipped: Option<wgpu::ShaderModule>,
    pub samples: u32,
    pub frame: wgpu::BindGroupLayout,
    pub instances: wgpu::BindGroupLayout,
    pub edged: wgpu::BindGroupLayout,
}

/// The entry points that place corners of batches, of batches with edges, and of boxes.
const PLAIN: [&str; 3] = ["draw_vertex", "edged_vertex", "box_vertex"];
/// The same with distances to sections.
const CLIPPED: [&str; 3] = ["clipped_draw_vertex", "clipped_edged_vertex", "clipped_box_vertex"];

impl Pipelines {
    pub fn make(&self, device: &wgpu::Device, kind: Kind) -> wgpu::RenderPipeline {
        let (frame, instances, edged) = (Some(&self.frame), Some(&self.instances), Some(&self.edged));
        let (module, [scene, edges, boxes], [surface, lined]) = match (kind.cut, &self.clipped) {
            (Cut::No, _) => (&self.module, PLAIN, ["draw_fragment", "edged_fragment"]),
            (Cut::Clipped, Some(clipped)) => (clipped, CLIPPED, ["draw_fragment", "edged_fragment"]),
            (Cut::Clipped, None) | (Cut::Sampled, _) => {
                (&self.module, PLAIN, ["cut_fragment", "edged_cut_fragment"])
            }
        };
        let vertices = [Some(active_vertices())];
        let own = [frame, instances];
        match kind.drawn {
            Drawn::Scene => self.pipeline(device, module, "draw", [scene, surface], &own, &vertices),
            Drawn::Edged => {
                let groups = [frame, instances, edged];
                self.pipeline(device, module, "edges", [edges, lined], &groups, &[])
            }
            Drawn::Boxes => self.pipeline(device, module, "boxes", [boxes, surface], &own, &[]),
            Drawn::Background => {
                let background = ["background_vertex", "background_fragment"];
                self.pipeline(device, module, "background", background, &[], &[])
            }
        }
    }

    fn pipeline(
        &self,
        device: &wgpu::Device,
        module: &wgpu::ShaderModule,
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
        let has_samples = fragment.ends_with("cut_fragment");
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(depth_state(device, label != "background")),
            multisample: wgpu::MultisampleState { count: self.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some(fragment),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: if has_samples { &constants } else { &[] },
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
pub(in crate::passes) fn depth_state(device: &wgpu::Device, write: bool) -> wgpu::DepthStencilState {
    use wgpu::CompareFunction as Compare;
    wgpu::DepthStencilState {
        format: depth_format(device),
        depth_write_enabled: Some(write),
        depth_compare: Some(if write { Compare::Greater } else { Compare::GreaterEqual }),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}
