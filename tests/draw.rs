//! The draw pass on a real adapter: pixels of hand-made cubes, near the origin and ten thousand kilometres away.

#![expect(clippy::unwrap_used, reason = "a test may end where its set-up fails")]

use collapsar::geometry::record::Attributes;
use collapsar::geometry::{Grid, VertexRecord, quantize};
use collapsar::gpu::target::{Target, TargetError};
use collapsar::gpu::testing::{self, TestDevice};
use collapsar::passes::draw::{
    Asked, DrawBatch, DrawList, DrawPass, FrameUniform, InstanceRow, LookRow, Mode, Style,
};
use collapsar::scene::Camera;
use glam::{DAffine3, DMat3, DVec3};
use wgpu::util::DeviceExt;

const SIZE: u32 = 256;
const RED: [u8; 4] = [200, 60, 50, 255];
const BLUE: [u8; 4] = [50, 90, 200, 255];

/// The grid on which the cube from -1 to 1 has corners at 0 and 1024.
const GRID: Grid = Grid { origin: [-1.0; 3], step_exponent: -9 };

/// One face: four corners and the outward normal.
fn face(axis: usize, positive: bool) -> ([[u32; 3]; 4], [f32; 3]) {
    let corner = |u: u32, v: u32| {
        let mut grid = [0; 3];
        grid[axis] = if positive { 1024 } else { 0 };
        grid[(axis + 1) % 3] = u * 1024;
        grid[(axis + 2) % 3] = v * 1024;
        grid
    };
    let mut normal = [0.0; 3];
    normal[axis] = if positive { 1.0 } else { -1.0 };
    ([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)], normal)
}

/// The vertices of a cube for one instance, plain or coloured.
fn cube_vertices(instance: u32, colour: Option<[u8; 4]>) -> Vec<[u32; 4]> {
    let attributes = |normal| match colour {
        Some(colour) => quantize::encode_coloured(normal, colour),
        None => quantize::encode_normal(normal),
    };
    let faces = (0..6).map(|side| face(side / 2, side % 2 == 0));
    faces
        .flat_map(|(corners, normal)| corners.map(|grid| VertexRecord::new(grid, attributes(normal)).words))
        .map(|[a, b, c]| [a, b, c, instance])
        .collect()
}

/// The triangles of `cubes` cubes. Winding is left as it comes: it must not matter.
fn cube_indices(cubes: u32) -> Vec<u32> {
    (0..cubes * 6).flat_map(|side| [0, 1, 2, 0, 2, 3].map(|corner| side * 4 + corner)).collect()
}

fn mirrored_at(at: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), at)
}

struct Scene {
    vertices: Vec<[u32; 4]>,
    rows: Vec<InstanceRow>,
    camera: Camera,
}

/// A red cube on the left and a mirrored blue one on the right, all shifted by `shift`, seen from the front.
fn two_cubes(shift: DVec3) -> Scene {
    let red = DAffine3::from_translation(shift + DVec3::new(-1.5, 0.0, 0.0));
    let blue = mirrored_at(shift + DVec3::new(1.5, 0.0, 0.0));
    // Multiples of 1/8 are exact at 1e7, so that the shifted camera sees the same numbers.
    let eye = shift + DVec3::new(1.25, 2.5, 6.5);
    Scene {
        vertices: [cube_vertices(0, None), cube_vertices(1, None)].concat(),
        rows: vec![
            InstanceRow::new(red, GRID, RED, Attributes::Normal),
            InstanceRow::new(blue, GRID, BLUE, Attributes::Normal),
        ],
        camera: Camera::look_at(eye, shift, DVec3::Y, 0.8, 0.01),
    }
}

fn buffer(gpu: &TestDevice, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some("test"), contents, usage })
}

/// Draws the scene and returns the target.
fn draw(gpu: &TestDevice, scene: &Scene, samples: u32, mode: Mode) -> Target {
    let target = Target::new(&gpu.device, SIZE, SIZE, samples).unwrap();
    let pass = DrawPass::new(&gpu.device, samples);
    pass.write_frame(
        &gpu.queue,
        &FrameUniform::new(&scene.camera, target.aspect(), &Style { mode, ..Style::default() }),
    );
    let indices = cube_indices(scene.vertices.len() as u32 / 24);
    let arguments = wgpu::util::DrawIndexedIndirectArgs {
        index_count: indices.len() as u32,
        instance_count: 1,
        ..Default::default()
    };
    let usages = wgpu::BufferUsages::STORAGE;
    let rows = buffer(gpu, bytemuck::cast_slice(&scene.rows), usages);
    let looks = buffer(gpu, bytemuck::cast_slice(&vec![LookRow::default(); scene.rows.len()]), usages);
    let batch = DrawBatch {
        triangles: &rows,
        instances: &pass.bind_instances(&gpu.device, &rows, &looks),
        vertices: &buffer(gpu, bytemuck::cast_slice(&scene.vertices), usages | wgpu::BufferUsages::VERTEX),
        indices: &buffer(gpu, bytemuck::cast_slice(&indices), usages | wgpu::BufferUsages::INDEX),
        indirect: &buffer(gpu, arguments.as_bytes(), usages | wgpu::BufferUsages::INDIRECT),
        indirect_offset: 0,
        ranges: None,
        cut_faces: None,
    };
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let list = DrawList { asked: Asked::default(), batches: &[batch], boxes: None };
    pass.record(&gpu.device, &mut encoder, &target, &list, None);
    gpu.queue.submit([encoder.finish()]);
    target
}

fn pixels(gpu: &TestDevice, scene: &Scene, samples: u32) -> Vec<u8> {
    draw(gpu, scene, samples, Mode::Material).read_rgba(&gpu.device, &gpu.queue).unwrap()
}

fn pixel(rgba: &[u8], x: u32, y: u32) -> [u8; 4] {
    rgba.as_chunks().0[(y * SIZE + x) as usize]
}

/// Where a point relative to the scene's centre is in the picture.
fn project(scene: &Scene, point: DVec3) -> (u32, u32) {
    let clip = scene.camera.clip_from_relative(1.0) * (point - scene.camera.eye).as_vec3().extend(1.0);
    let at = |ndc: f32| ((0.5 + 0.5 * ndc) * SIZE as f32) as u32;
    (at(clip.x / clip.w), at(-clip.y / clip.w))
}

#[test]
fn two_cubes_have_their_colours_and_places() {
    let Some(gpu) = testing::device("draw: two cubes") else { return };
    for samples in [1, 4] {
        let scene = two_cubes(DVec3::ZERO);
        let target = draw(&gpu, &scene, samples, Mode::Material);
        if let Some(folder) = std::env::var_os("COLLAPSAR_TEST_PICTURES") {
            let path = std::path::Path::new(&folder).join(format!("two_cubes_{samples}.png"));
            target.save_png(&gpu.device, &gpu.queue, &path).unwrap();
        }
        let rgba = target.read_rgba(&gpu.device, &gpu.queue).unwrap();
        for (centre, strongest) in [(-1.5, 0), (1.5, 2)] {
            let (x, y) = project(&scene, DVec3::new(centre, 0.0, 1.0));
            let [front, top] = [DVec3::new(centre, 0.0, 1.0), DVec3::new(centre, 1.0, 0.0)]
                .map(|at| project(&scene, at))
                .map(|(x, y)| pixel(&rgba, x, y));
            let others = (0..3).filter(|&c| c != strongest).map(|c| front[c]).max().unwrap();
            assert!(front[strongest] > 100 && front[strongest] > others + 60, "{front:?} at {x} {y}");
            assert_ne!(front, top, "faces are lit differently");
        }
        let [upper, lower] = [0, SIZE - 1].map(|y| pixel(&rgba, 0, y));
        assert!(upper.iter().chain(&lower).all(|&c| c > 150) && upper[2] > upper[0], "{upper:?} {lower:?}");
    }
}

#[test]
fn a_picture_ten_thousand_kilometres_away_is_the_same() {
    let Some(gpu) = testing::device("draw: far from the origin") else { return };
    let far = two_cubes(DVec3::new(1e7, -1e7, 1e7));
    assert_eq!(pixels(&gpu, &two_cubes(DVec3::ZERO), 1), pixels(&gpu, &far, 1));
}

#[test]
fn a_mirrored_cube_is_lit_as_the_plain_one() {
    let Some(gpu) = testing::device("draw: mirrored") else { return };
    let scene = |placed| Scene {
        vertices: cube_vertices(0, None),
        rows: vec![InstanceRow::new(placed, GRID, RED, Attributes::Normal)],
        ..two_cubes(DVec3::ZERO)
    };
    let plain = pixels(&gpu, &scene(DAffine3::IDENTITY), 1);
    let mirrored = pixels(&gpu, &scene(mirrored_at(DVec3::ZERO)), 1);
    let different = plain.iter().zip(&mirrored).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    // The quads of the mirrored cube are cut along the other diagonal; at most a few pixels on edges may differ.
    assert!(different < 40, "{different} values differ");
}

#[test]
fn coloured_vertices_show_their_own_colour() {
    let Some(gpu) = testing::device("draw: coloured vertices") else { return };
    let scene = Scene {
        vertices: cube_vertices(0, Some([0, 200, 0, 255])),
        rows: vec![InstanceRow::new(DAffine3::IDENTITY, GRID, RED, Attributes::Colour)],
        ..two_cubes(DVec3::ZERO)
    };
    let rgba = pixels(&gpu, &scene, 1);
    let (x, y) = project(&scene, DVec3::new(0.0, 0.0, 1.0));
    let [red, green, blue, _] = pixel(&rgba, x, y);
    assert!(green > 100 && red < 80 && blue < 80, "{red} {green} {blue}");
}

#[test]
fn slots_show_the_colours_of_the_rows_that_their_row_names() {
    let Some(gpu) = testing::device("draw: slots") else { return };
    let row = InstanceRow::new(DAffine3::IDENTITY, GRID, RED, Attributes::Slot);
    let slotted = InstanceRow { colour: InstanceRow::SLOTTED | 1, ..row };
    let vertices = cube_vertices(0, None).into_iter().map(|[a, b, c, instance]| {
        let normal = quantize::decode_normal(c);
        [a, b, quantize::encode_slotted(normal, 1), instance]
    });
    let scene = Scene {
        vertices: vertices.collect(),
        rows: vec![slotted, row.with_colour(BLUE), row.with_colour([0, 200, 0, 255])],
        ..two_cubes(DVec3::ZERO)
    };
    let slots = pixels(&gpu, &scene, 1);
    let plain = Scene {
        vertices: cube_vertices(0, None),
        rows: vec![InstanceRow::new(DAffine3::IDENTITY, GRID, [0, 200, 0, 255], Attributes::Normal)],
        ..two_cubes(DVec3::ZERO)
    };
    assert_eq!(slots, pixels(&gpu, &plain, 1));
}

#[test]
fn flat_and_empty_instances_harm_nothing() {
    let Some(gpu) = testing::device("draw: degenerate instances") else { return };
    let scaled = |scale| DAffine3::from_scale(scale);
    let base = two_cubes(DVec3::ZERO);
    for placed in [
        scaled(DVec3::ZERO),
        scaled(DVec3::new(1.0, 1.0, 0.0)),
        scaled(DVec3::new(1.0, 0.0, 0.0)),
        scaled(DVec3::splat(1e-30)),
        scaled(DVec3::splat(1e30)),
        scaled(DVec3::NAN),
    ] {
        let scene = Scene {
            rows: vec![base.rows[0], InstanceRow::new(placed, GRID, BLUE, Attributes::Normal)],
            ..two_cubes(DVec3::ZERO)
        };
        let rgba = pixels(&gpu, &scene, 1);
        if placed.matrix3.x_axis.x <= 1.0 {
            let (x, y) = project(&scene, DVec3::new(-1.5, 0.0, 1.0));
            assert!(pixel(&rgba, x, y)[0] > 100, "the other cube is still there");
        }
    }
}

#[test]
fn instance_colours_tell_instances_apart() {
    let Some(gpu) = testing::device("draw: instance mode") else { return };
    let scene = two_cubes(DVec3::ZERO);
    let rgba = draw(&gpu, &scene, 1, Mode::Instance).read_rgba(&gpu.device, &gpu.queue).unwrap();
    let [a, b] =
        [-1.5, 1.5].map(|x| project(&scene, DVec3::new(x, 0.0, 1.0))).map(|(x, y)| pixel(&rgba, x, y));
    assert!((0..3).any(|c| a[c].abs_diff(b[c]) > 20), "{a:?} {b:?}");
}

#[test]
fn impossible_targets_are_refused() {
    let Some(gpu) = testing::device("draw: impossible targets") else { return };
    let refused = |width, height, samples| Target::new(&gpu.device, width, height, samples).unwrap_err();
    assert!(matches!(refused(0, 10, 1), TargetError::Size { .. }));
    assert!(matches!(refused(10, u32::MAX, 1), TargetError::Size { .. }));
    assert!(matches!(refused(10, 10, 3), TargetError::Samples(3)));
}
