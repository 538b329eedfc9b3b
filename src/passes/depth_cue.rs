//! depth_cue: the depth of a picture in, the picture darkened where something stands before it out.
//!
//! Eye-dome lighting (Boucheny 2009) in two rings: it needs nothing but depth, so that it costs the same for any model.

use bytemuck::{Pod, Zeroable};

use crate::gpu::target::{COLOUR_FORMAT, Target};
use crate::scene::Camera;

const DEPTH_CUE: &str = include_str!("../../shaders/depth_cue.wgsl");

/// Pixels of a picture of this height that are looked around a pixel, to the inner ring.
const RADIUS_PX: f32 = 2.0;
const REFERENCE_HEIGHT_PX: f32 = 720.0;
/// How much darker at strength 1.
const STRENGTH: f32 = 3.0;
/// A step in depth of so much of what is seen counts as one of the same share of the distance.
const PARALLEL_SCALE: f32 = 6.0;

/// `DepthCue` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
struct CueUniform {
    parallel: u32,
    radius_px: f32,
    strength: f32,
    depth_scale: f32,
}

/// The shader's source for targets of that many samples.
pub fn shader(samples: u32) -> String {
    let (texture, count) =
        if samples > 1 { ("texture_depth_multisampled_2d", samples) } else { ("texture_depth_2d", 1) };
    format!("alias DEPTH_TEXTURE = {texture};\nconst SAMPLE_COUNT = {count};\n{DEPTH_CUE}")
}

/// The pipeline and its uniform.
#[derive(Debug)]
pub struct DepthCuePass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    uniform: wgpu::Buffer,
}

impl DepthCuePass {
    /// Makes the pass for targets of that many samples a pixel.
    pub fn new(device: &wgpu::Device, samples: u32) -> Self {
        let layout = layout(device, samples > 1);
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("depth cue"),
            size: size_of::<CueUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { pipeline: pipeline(device, &layout, samples), layout, uniform }
    }

    /// Records the pass, after the draw pass of the same target, which has kept its depth. `strength` is above 0, 1 is clear.
    pub fn record(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        camera: &Camera,
        strength: f32,
    ) {
        let seen = camera.parallel.map_or(1.0, |parallel| 2.0 * parallel.reach / parallel.height);
        let uniform = CueUniform {
            parallel: u32::from(camera.parallel.is_some()),
            radius_px: RADIUS_PX * (target.height() as f32 / REFERENCE_HEIGHT_PX).max(0.5),
            strength: STRENGTH * strength,
            depth_scale: PARALLEL_SCALE * seen as f32 / 8.0,
        };
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let entries = [
            wgpu::BindGroupEntry { binding: 0, resource: self.uniform.as_entire_binding() },
            wgpu::BindGroupEntry {
                binding: 1,
                resource: wgpu::BindingResource::TextureView(target.depth_view()),
            },
        ];
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("depth cue"),
            layout: &self.layout,
            entries: &entries,
        });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("depth_cue"),
            color_attachments: &[Some(target.resolved_attachment())],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

fn layout(device: &wgpu::Device, multisampled: bool) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty,
        count: None,
    };
    let uniform = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: wgpu::BufferSize::new(size_of::<CueUniform>() as u64),
    };
    let depth = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("depth cue"),
        entries: &[entry(0, uniform), entry(1, depth)],
    })
}

/// Multiplies what is there.
const MULTIPLY: wgpu::BlendState = {
    let component = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::Dst,
        dst_factor: wgpu::BlendFactor::Zero,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: component, alpha: wgpu::BlendComponent::REPLACE }
};

fn pipeline(device: &wgpu::Device, group: &wgpu::BindGroupLayout, samples: u32) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("depth_cue"),
        source: wgpu::ShaderSource::Wgsl(shader(samples).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("depth_cue"),
        bind_group_layouts: &[Some(group)],
        immediate_size: 0,
    });
    let target = wgpu::ColorTargetState {
        format: COLOUR_FORMAT,
        blend: Some(MULTIPLY),
        write_mask: wgpu::ColorWrites::ALL,
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("depth_cue"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("depth_cue_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("depth_cue_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    })
}
