//! draw: active vertices and the reformed index buffer of every batch in, a lit picture out.
//!
//! One indirect draw per batch. A vertex carries the number of its instance within the batch, so transforms and
//! colours come from a table of [`InstanceRow`]s. Depth is reversed; there is no culling by winding, because CAD data
//! does not keep it.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Mat4, Vec3};

use crate::geometry::Grid;
use crate::geometry::record::Attributes;
use crate::gpu::target::{COLOUR_FORMAT, DEPTH_FORMAT, Target};
use crate::import::Colour;
use crate::scene::camera::{Camera, split_f64};

/// What a surface and the background look like, whoever places the corners: the first piece of [`SHADER`].
pub const SURFACE: &str = include_str!("../../shaders/shared/surface.wgsl");

/// The shader's source.
pub const SHADER: &str =
    concat!(include_str!("../../shaders/shared/surface.wgsl"), include_str!("../../shaders/draw.wgsl"));

/// Corners of the triangles of a box.
const BOX_CORNERS: u32 = 36;

/// Bytes of an active vertex: the three words of a vertex record, then its instance's number within the batch.
pub const ACTIVE_VERTEX_BYTES: u64 = 16;

/// What the colour of a surface shows.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Its material.
    #[default]
    Material = 0,
    /// Its instance, by number within the batch.
    Instance = 1,
}

/// What is the same for everything drawn in a frame; `Frame` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FrameUniform {
    clip_from_relative: Mat4,
    eye_high: Vec3,
    mode: u32,
    eye_low: Vec3,
    unused_0: u32,
    to_key: Vec3,
    unused_1: u32,
    to_rim: Vec3,
    unused_2: u32,
}

impl FrameUniform {
    /// The frame as `camera` sees it in a picture of that aspect (width over height).
    pub fn new(camera: &Camera, aspect: f32, mode: Mode) -> Self {
        let (eye_high, eye_low) = camera.split_eye();
        let towards = |right: f64, up: f64, back: f64| {
            (camera.world_from_view * DVec3::new(right, up, back).normalize()).as_vec3()
        };
        Self {
            clip_from_relative: camera.clip_from_relative(aspect),
            eye_high,
            mode: mode as u32,
            eye_low,
            to_key: towards(-0.6, 0.7, 0.6),
            to_rim: towards(0.85, 0.15, -0.35),
            unused_0: 0,
            unused_1: 0,
            unused_2: 0,
        }
    }
}

/// One instance of a batch: 64 bytes; the same name in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct InstanceRow {
    /// Column i of the linear part times the grid step; `[3]` is component i of the translation's high part.
    pub columns: [[f32; 4]; 3],
    /// The translation's low part.
    pub translation_low: [f32; 3],
    /// sRGB in the low 24 bits, red lowest, and [`InstanceRow::COLOURED`]; or with [`InstanceRow::SLOTTED`] the number
    /// of the row whose colour slot 0 has.
    pub colour: u32,
}

impl InstanceRow {
    /// Bit of `colour`: the part's vertices carry colours, and the row's is not used.
    pub const COLOURED: u32 = 1 << 24;

    /// Bit of `colour`: the part's vertices carry slots, and the low 24 bits are the number of a row: the colour of slot
    /// `s` is that of the row `s` after it.
    pub const SLOTTED: u32 = 1 << 25;

    /// The row of a part on `grid`, placed by `world_from_part`; that of a slotted part still lacks the number of its
    /// first colour's row.
    pub fn new(world_from_part: DAffine3, grid: Grid, colour: Colour, attributes: Attributes) -> Self {
        let origin = world_from_part.transform_point3(DVec3::from_array(grid.origin));
        let (high, low) = split_f64(origin);
        let linear = world_from_part.matrix3 * grid.step();
        let column = |i: usize| linear.col(i).as_vec3().extend(high[i]).to_array();
        let flag = if attributes == Attributes::Colour { Self::COLOURED } else { 0 };
        let columns = [column(0), column(1), column(2)];
        let row = Self { columns, translation_low: low.to_array(), colour: 0 }.with_colour(colour);
        Self { colour: row.colour | flag, ..row }
    }

    /// The same row with another colour, and no flags.
    pub fn with_colour(self, [red, green, blue, _]: Colour) -> Self {
        Self { colour: u32::from_le_bytes([red, green, blue, 0]), ..self }
    }
}

/// What is drawn of one batch.
#[derive(Debug, Clone, Copy)]
pub struct DrawBatch<'a> {
    /// From [`DrawPass::bind_instances`].
    pub instances: &'a wgpu::BindGroup,
    /// Active vertices, [`ACTIVE_VERTEX_BYTES`] each.
    pub vertices: &'a wgpu::Buffer,
    /// Indices of 32 bits into `vertices`.
    pub indices: &'a wgpu::Buffer,
    /// Holds the arguments of one indexed indirect draw.
    pub indirect: &'a wgpu::Buffer,
    /// Where in `indirect`, in bytes.
    pub indirect_offset: u64,
}

/// Pipelines and the frame's uniform.
#[derive(Debug)]
pub struct DrawPass {
    scene: wgpu::RenderPipeline,
    boxes: wgpu::RenderPipeline,
    background: wgpu::RenderPipeline,
    instances_layout: wgpu::BindGroupLayout,
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
}

impl DrawPass {
    /// Makes the pass for targets of that many samples a pixel (1 or 4).
    pub fn new(device: &wgpu::Device, samples: u32) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("draw"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let frame_layout = layout(
            device,
            "draw frame",
            wgpu::ShaderStages::VERTEX_FRAGMENT,
            wgpu::BufferBindingType::Uniform,
            size_of::<FrameUniform>(),
        );
        let instances_layout = layout(
            device,
            "draw instances",
            wgpu::ShaderStages::VERTEX,
            wgpu::BufferBindingType::Storage { read_only: true },
            size_of::<InstanceRow>(),
        );
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("draw frame"),
            size: size_of::<FrameUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let pipelines = Pipelines { device, module: &module, samples };
        Self {
            scene: pipelines.scene(&[Some(&frame_layout), Some(&instances_layout)]),
            boxes: pipelines.boxes(&[Some(&frame_layout), Some(&instances_layout)]),
            background: pipelines.background(),
            frame_group: bind(device, "draw frame", &frame_layout, &frame),
            instances_layout,
            frame,
        }
    }

    /// Binds a batch's table of [`InstanceRow`]s (a storage buffer of at least one).
    pub fn bind_instances(&self, device: &wgpu::Device, instances: &wgpu::Buffer) -> wgpu::BindGroup {
        bind(device, "draw instances", &self.instances_layout, instances)
    }

    /// Sets what the next submission sees as the frame.
    pub fn write_frame(&self, queue: &wgpu::Queue, frame: &FrameUniform) {
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// Records the pass: all batches, boxes (one for each row of a table of [`InstanceRow`]s that place the unit cube), then
    /// the background where nothing was drawn.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        batches: &[DrawBatch<'_>],
        boxes: Option<(&wgpu::BindGroup, u32)>,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("draw"),
            color_attachments: &[Some(target.colour_attachment())],
            depth_stencil_attachment: Some(target.depth_attachment()),
            timestamp_writes,
            ..Default::default()
        });
        pass.set_pipeline(&self.scene);
        pass.set_bind_group(0, &self.frame_group, &[]);
        for batch in batches {
            pass.set_bind_group(1, batch.instances, &[]);
            pass.set_vertex_buffer(0, batch.vertices.slice(..));
            pass.set_index_buffer(batch.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed_indirect(batch.indirect, batch.indirect_offset);
        }
        if let Some((rows, count)) = boxes {
            pass.set_pipeline(&self.boxes);
            pass.set_bind_group(1, rows, &[]);
            pass.draw(0..BOX_CORNERS, 0..count);
        }
        pass.set_pipeline(&self.background);
        pass.draw(0..3, 0..1);
    }
}

fn layout(
    device: &wgpu::Device,
    label: &str,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BufferBindingType,
    least_bytes: usize,
) -> wgpu::BindGroupLayout {
    let min_binding_size = wgpu::BufferSize::new(least_bytes as u64);
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(label),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size },
            count: None,
        }],
    })
}

fn bind(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffer: &wgpu::Buffer,
) -> wgpu::BindGroup {
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(label),
        layout,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
    })
}

/// What both pipelines share.
struct Pipelines<'a> {
    device: &'a wgpu::Device,
    module: &'a wgpu::ShaderModule,
    samples: u32,
}

impl Pipelines<'_> {
    fn scene(&self, groups: &[Option<&wgpu::BindGroupLayout>]) -> wgpu::RenderPipeline {
        let vertices = wgpu::VertexBufferLayout {
            array_stride: ACTIVE_VERTEX_BYTES,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &[wgpu::VertexAttribute {
                format: wgpu::VertexFormat::Uint32x4,
                offset: 0,
                shader_location: 0,
            }],
        };
        let depth = depth_state(true, wgpu::CompareFunction::Greater);
        self.make("draw", ["draw_vertex", "draw_fragment"], groups, &[Some(vertices)], depth)
    }

    fn boxes(&self, groups: &[Option<&wgpu::BindGroupLayout>]) -> wgpu::RenderPipeline {
        let depth = depth_state(true, wgpu::CompareFunction::Greater);
        self.make("boxes", ["box_vertex", "draw_fragment"], groups, &[], depth)
    }

    fn background(&self) -> wgpu::RenderPipeline {
        let depth = depth_state(false, wgpu::CompareFunction::GreaterEqual);
        self.make("background", ["background_vertex", "background_fragment"], &[], &[], depth)
    }

    fn make(
        &self,
        label: &str,
        [vertex, fragment]: [&str; 2],
        groups: &[Option<&wgpu::BindGroupLayout>],
        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
        depth: wgpu::DepthStencilState,
    ) -> wgpu::RenderPipeline {
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: self.module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(depth),
            multisample: wgpu::MultisampleState { count: self.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module: self.module,
                entry_point: Some(fragment),
                compilation_options: Default::default(),
                targets: &[Some(COLOUR_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

fn depth_state(write: bool, compare: wgpu::CompareFunction) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH_FORMAT,
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    fn module() -> naga::Module {
        let module =
            naga::front::wgsl::parse_str(SHADER).unwrap_or_else(|e| panic!("{}", e.emit_to_string(SHADER)));
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(SHADER)));
        module
    }

    /// The offsets of a struct's members by name, and its size.
    fn shader_struct(module: &naga::Module, name: &str) -> (Vec<(String, u32)>, u32) {
        let (_, found) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
        let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
        (members.iter().map(|m| (m.name.clone().unwrap(), m.offset)).collect(), *span)
    }

    fn assert_layout(name: &str, host: &[(&str, usize)], host_size: usize) {
        let (members, span) = shader_struct(&module(), name);
        let host: Vec<_> = host.iter().map(|&(name, offset)| (name.to_owned(), offset as u32)).collect();
        assert_eq!(members, host);
        assert_eq!(span as usize, host_size);
    }

    #[test]
    fn frame_has_the_shaders_layout() {
        let host = [
            ("clip_from_relative", offset_of!(FrameUniform, clip_from_relative)),
            ("eye_high", offset_of!(FrameUniform, eye_high)),
            ("mode", offset_of!(FrameUniform, mode)),
            ("eye_low", offset_of!(FrameUniform, eye_low)),
            ("unused_0", offset_of!(FrameUniform, unused_0)),
            ("to_key", offset_of!(FrameUniform, to_key)),
            ("unused_1", offset_of!(FrameUniform, unused_1)),
            ("to_rim", offset_of!(FrameUniform, to_rim)),
            ("unused_2", offset_of!(FrameUniform, unused_2)),
        ];
        assert_layout("Frame", &host, size_of::<FrameUniform>());
    }

    #[test]
    fn instance_rows_have_the_shaders_layout() {
        let columns = offset_of!(InstanceRow, columns);
        let host = [
            ("column_0", columns),
            ("column_1", columns + 16),
            ("column_2", columns + 32),
            ("translation_low", offset_of!(InstanceRow, translation_low)),
            ("colour", offset_of!(InstanceRow, colour)),
        ];
        assert_layout("InstanceRow", &host, size_of::<InstanceRow>());
    }

    #[test]
    fn instance_rows_hold_transform_step_and_colour() {
        let grid = Grid { origin: [1.0, 0.0, 0.0], step_exponent: -2 };
        let placed = DAffine3::from_scale_rotation_translation(
            DVec3::splat(2.0),
            glam::DQuat::IDENTITY,
            DVec3::new(1e7, 0.1, -3.0),
        );
        let row = InstanceRow::new(placed, grid, [1, 2, 3, 255], Attributes::Colour);
        assert_eq!(row.columns[0], [0.5, 0.0, 0.0, 10_000_002.0]);
        assert_eq!(
            row.columns[1][3] as f64 + row.translation_low[1] as f64,
            0.1f32 as f64 + (0.1 - 0.1f32 as f64) as f32 as f64
        );
        assert_eq!(row.colour, 0x0103_0201);
    }
}
