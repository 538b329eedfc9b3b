//! pick: what the draw pass draws and one pixel in, the instance that is seen there and the point of its surface out.
//!
//! The pixel is made the whole picture, so that all else is clipped away before it costs anything: the cost is that of the
//! active vertices, which the budget bounds.

use glam::DVec3;

use super::cut_face::{CutFacePass, Paint};
use super::draw::{
    DrawList, FrameUniform, InstanceRow, LookRow, SHADER as DRAW_SHADER, active_vertices, bind, depth_state,
    draw_batch, draw_boxes, frame_buffer, layout, module,
};
use crate::gpu::target::{attached_depth, depth_format};
use crate::gpu::{Gpu, GpuError, readback};

/// What follows the shader of the draw pass.
const PICK: &str = include_str!("../../shaders/pick.wgsl");

/// The shader's source.
pub fn shader() -> String {
    [DRAW_SHADER, PICK].concat()
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
/// How cut faces are written.
const CUT_FACES: Paint = Paint {
    entry: "pick_cut_face_fragment",
    clipped_entry: None,
    empty_entry: Some("pick_empty_fragment"),
    format: FORMAT,
};
/// Words of a pixel.
const WORDS: usize = 4;

/// What is in a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// The number of the instance in the scene.
    pub instance: u32,
    /// The point of its surface, relative to the eye, in world axes.
    pub relative: DVec3,
}

/// The pipelines, and a picture of one pixel.
#[derive(Debug)]
pub struct PickPass {
    scene: wgpu::RenderPipeline,
    boxes: wgpu::RenderPipeline,
    /// Made when there is something to close.
    cut_face: Option<CutFacePass>,
    layouts: [wgpu::BindGroupLayout; 2],
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    pixel: wgpu::Texture,
    depth: wgpu::Texture,
    copied: wgpu::Buffer,
}

impl PickPass {
    /// Makes the pass.
    ///
    /// # Errors
    /// There is no memory for it.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        use wgpu::ShaderStages as Stages;
        let device = &gpu.device;
        let table = |bytes: usize| (wgpu::BufferBindingType::Storage { read_only: true }, bytes);
        let uniform = (wgpu::BufferBindingType::Uniform, size_of::<FrameUniform>());
        let of_frame = layout(device, "pick frame", Stages::VERTEX_FRAGMENT, &[uniform]);
        let tables = [table(size_of::<InstanceRow>()), table(size_of::<LookRow>())];
        let instances = layout(device, "draw instances", Stages::VERTEX, &tables);
        let module = module(device, "pick", &shader());
        let groups = [Some(&of_frame), Some(&instances)];
        let frame = frame_buffer(device, "pick frame");
        Ok(Self {
            cut_face: None,
            scene: pipeline(device, &module, &groups, "draw_vertex", &[Some(active_vertices())]),
            boxes: pipeline(device, &module, &groups, "box_vertex", &[]),
            frame_group: bind(device, "pick frame", &of_frame, &[&frame]),
            frame,
            pixel: one_pixel(device, "picked", FORMAT),
            depth: one_pixel(device, "pick depth", depth_format(device)),
            copied: gpu.buffer("picked", 16, Usage::COPY_SRC | Usage::COPY_DST)?,
            layouts: [of_frame, instances],
        })
    }

    /// What is in one pixel of the frame. Waits for the GPU.
    ///
    /// # Errors
    /// The device is lost.
    pub fn pick(
        &mut self,
        gpu: &Gpu,
        frame: &FrameUniform,
        list: &DrawList<'_>,
    ) -> Result<Option<Picked>, GpuError> {
        if list.has_cut_faces() {
            let [of_frame, instances] = &self.layouts;
            self.cut_face
                .get_or_insert_with(|| CutFacePass::new(&gpu.device, 1, CUT_FACES, of_frame))
                .prepare(&gpu.device, list.asked.cut, [of_frame, instances]);
        }
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
        let mut encoder = gpu.encoder("pick");
        self.record(&mut encoder, list);
        let to = wgpu::TexelCopyBufferInfo {
            buffer: &self.copied,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: None, rows_per_image: None },
        };
        encoder.copy_texture_to_buffer(self.pixel.as_image_copy(), to, self.pixel.size());
        gpu.submit(encoder)?;
        let words: Vec<u32> = readback::read_values(gpu, &self.copied, WORDS)?;
        Ok(found(&words))
    }

    fn record(&self, encoder: &mut wgpu::CommandEncoder, list: &DrawList<'_>) {
        let [pixel, depth] =
            [&self.pixel, &self.depth].map(|texture| texture.create_view(&Default::default()));
        let colour = wgpu::RenderPassColorAttachment {
            view: &pixel,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("pick"),
            color_attachments: &[Some(colour)],
            depth_stencil_attachment: Some(attached_depth(&depth, false)),
            ..Default::default()
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        if let Some(cut_face) = self.cut_face.as_ref().filter(|_| list.has_cut_faces()) {
            cut_face.record(&mut pass, list);
        }
        pass.set_pipeline(&self.scene);
        list.batches.iter().for_each(|batch| draw_batch(&mut pass, batch, None));
        pass.set_pipeline(&self.boxes);
        draw_boxes(&mut pass, list);
    }
}

/// What the words of a pixel say.
fn found(words: &[u32]) -> Option<Picked> {
    let &[number, x, y, z] = words else { return None };
    let relative = DVec3::from([x, y, z].map(|bits| f64::from(f32::from_bits(bits))));
    number.checked_sub(1).map(|instance| Picked { instance, relative })
}

fn one_pixel(device: &wgpu::Device, label: &str, format: wgpu::TextureFormat) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    groups: &[Option<&wgpu::BindGroupLayout>],
    vertex: &str,
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("pick"),
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("pick"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(depth_state(device, true)),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("pick_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
