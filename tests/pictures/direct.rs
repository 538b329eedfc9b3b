//! A model as it was imported in, its picture out: no weld, no grid, no order, no budget, no stream.
//!
//! Every corner of every instance is placed on the CPU in f64, relative to the eye, and all triangles are drawn as they
//! came. Only the light is shared with the renderer (`passes::draw::SURFACE`).

use bytemuck::{Pod, Zeroable};
use collapsar::gpu::Gpu;
use collapsar::gpu::target::{COLOUR_FORMAT, Target, depth_format};
use collapsar::import::{Instance, Model, SourceMesh};
use collapsar::passes::draw::{FrameUniform, SURFACE, Style};
use collapsar::scene::Camera;
use glam::{DMat3, DVec3};
use image::RgbImage;
use wgpu::util::DeviceExt;

use crate::subjects::Shot;

const SHADER: &str = concat!(include_str!("../../shaders/shared/surface.wgsl"), include_str!("direct.wgsl"));

/// A vertex of a placed mesh; `Placed` in the shader.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Placed {
    relative: [f32; 3],
    normal: [f32; 3],
    srgb: [f32; 3],
}

/// Draws the model, whose meshes have normals, with four samples a pixel.
pub fn picture(gpu: &Gpu, model: &Model, camera: &Camera, shot: Shot) -> RgbImage {
    let target = Target::new(&gpu.device, shot.width, shot.height, 4).unwrap();
    let frame = FrameUniform::new(camera, target.aspect(), &Style::default());
    let (vertices, indices) = placed(model, camera.eye);
    draw(gpu, &target, &frame, &vertices, &indices);
    shot.read(gpu, &target)
}

/// All instances, one after the other.
fn placed(model: &Model, eye: DVec3) -> (Vec<Placed>, Vec<u32>) {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for instance in &model.instances {
        let mesh = &model.meshes[instance.mesh as usize];
        let base = vertices.len() as u32;
        vertices.extend(placed_vertices(model, mesh, instance, eye));
        indices.extend(mesh.triangles.iter().flatten().map(|vertex| base + vertex));
    }
    (vertices, indices)
}

fn placed_vertices<'a>(
    model: &'a Model,
    mesh: &'a SourceMesh,
    instance: &'a Instance,
    eye: DVec3,
) -> impl Iterator<Item = Placed> + 'a {
    assert_eq!(mesh.normals.len(), mesh.positions.len(), "{}: normals", mesh.name);
    let material = model.materials[instance.material as usize].base_colour;
    let normal_matrix = cofactors(instance.world_from_part.matrix3);
    (0..mesh.positions.len()).map(move |vertex| {
        let position = DVec3::from_array(mesh.positions[vertex].map(f64::from));
        let normal = DVec3::from_array(mesh.normals[vertex].map(f64::from));
        let [r, g, b, _] = mesh.colours.get(vertex).copied().unwrap_or(material);
        Placed {
            relative: (instance.world_from_part.transform_point3(position) - eye).as_vec3().to_array(),
            normal: (normal_matrix * normal).normalize_or_zero().as_vec3().to_array(),
            srgb: [r, g, b].map(|c| f32::from(c) / 255.0),
        }
    })
}

/// What normals transform by, up to scale: the transposed inverse times the determinant.
fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn draw(gpu: &Gpu, target: &Target, frame: &FrameUniform, vertices: &[Placed], indices: &[u32]) {
    let device = &gpu.device;
    assert!(SHADER.starts_with(SURFACE));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("direct"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let scene = scene_pipeline(device, &module);
    let background = background_pipeline(device, &module);
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("direct"),
        layout: &scene.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry {
            binding: 0,
            resource: gpu.uniform("direct frame", frame).as_entire_binding(),
        }],
    });
    let vertex_buffer = filled(device, bytemuck::cast_slice(vertices), wgpu::BufferUsages::VERTEX);
    let index_buffer = filled(device, bytemuck::cast_slice(indices), wgpu::BufferUsages::INDEX);
    let mut encoder = gpu.encoder("direct");
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("direct"),
        color_attachments: &[Some(target.colour_attachment())],
        depth_stencil_attachment: Some(target.depth_attachment(false)),
        ..Default::default()
    });
    pass.set_pipeline(&scene);
    pass.set_bind_group(0, &group, &[]);
    pass.set_vertex_buffer(0, vertex_buffer.slice(..));
    pass.set_index_buffer(index_buffer.slice(..), wgpu::IndexFormat::Uint32);
    pass.draw_indexed(0..indices.len() as u32, 0, 0..1);
    pass.set_pipeline(&background);
    pass.draw(0..3, 0..1);
    drop(pass);
    gpu.submit(encoder).unwrap();
}

fn filled(device: &wgpu::Device, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some("direct"), contents, usage })
}

fn scene_pipeline(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    let layout = wgpu::VertexBufferLayout {
        array_stride: size_of::<Placed>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3],
    };
    let depth = depth_state(device, true, wgpu::CompareFunction::Greater);
    pipeline(device, module, ["direct_vertex", "draw_fragment"], &[Some(layout)], depth)
}

fn background_pipeline(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    let depth = depth_state(device, false, wgpu::CompareFunction::GreaterEqual);
    pipeline(device, module, ["background_vertex", "background_fragment"], &[], depth)
}

fn depth_state(
    device: &wgpu::Device,
    write: bool,
    compare: wgpu::CompareFunction,
) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: depth_format(device),
        depth_write_enabled: Some(write),
        depth_compare: Some(compare),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    [vertex, fragment]: [&str; 2],
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    depth: wgpu::DepthStencilState,
) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("direct"),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(depth),
        multisample: wgpu::MultisampleState { count: 4, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &[Some(COLOUR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
