//! A generated model as a CAD program would write it: faces tessellated apart, instances, a mirrored one, a grey
//! default material, and vertex colours.

use std::f32::consts::{PI, TAU};

use collapsar::import::{Colour, Instance, Material, Model, Node, SourceMesh};
use glam::{DAffine3, DQuat, DVec3};

use crate::common::{height_field, patched_box, sphere};

const GREY: u32 = 0;
const STEEL: u32 = 1;
const ORANGE: u32 = 2;

/// The model.
pub fn model() -> Model {
    let mut model = Model {
        nodes: vec![Node { name: "workbench".into(), parent: None }],
        materials: vec![Material::default(), material([112, 122, 138, 255]), material([226, 122, 40, 255])],
        ..Model::default()
    };
    add_table(&mut model);
    add_things(&mut model);
    model
}

fn material(base_colour: Colour) -> Material {
    Material { name: String::new(), base_colour }
}

/// A top on four legs, and eight bolts in it.
fn add_table(model: &mut Model) {
    let block = add_mesh(model, patched_box(16));
    let bolt = add_mesh(model, cylinder(24, 6));
    place(model, block, GREY, stretched([6.0, 0.3, 3.0], [-3.0, -0.3, -1.5]));
    for (x, z) in [(-2.8, -1.3), (-2.8, 1.1), (2.6, -1.3), (2.6, 1.1)] {
        place(model, block, GREY, stretched([0.2, 1.6, 0.2], [x, -1.9, z]));
    }
    for i in 0..8 {
        let (x, z) = (-2.6 + 1.733 * f64::from(i % 4), if i < 4 { -1.2 } else { 1.2 });
        place(model, bolt, STEEL, stretched([0.12, 0.1, 0.12], [x, 0.0, z]));
    }
}

/// What lies on the table.
fn add_things(model: &mut Model) {
    let block = 0;
    let shaft = add_mesh(model, cylinder(64, 24));
    let ball = add_mesh(model, painted(sphere(40, 64), |[x, y, z]| [x, y, z].map(|c| 0.5 + 0.45 * c)));
    let ring = add_mesh(model, torus(96, 32, 0.3));
    let mut field = height_field(48);
    field.normals.clear();
    let sheet = add_mesh(model, painted(field, |[_, _, z]| [0.35 + 4.0 * z, 0.6, 0.45 - 3.0 * z]));
    place(model, shaft, STEEL, stretched([0.45, 1.1, 0.45], [1.7, 0.0, -0.2]));
    place(model, ball, GREY, stretched([0.6; 3], [-1.7, 0.6, -0.4]));
    let upright = DQuat::from_rotation_y(0.5);
    place(
        model,
        ring,
        ORANGE,
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.6), upright, DVec3::new(0.1, 0.78, 0.0)),
    );
    let turned = DQuat::from_rotation_y(0.6);
    let at = DVec3::new(0.9, 0.0, 0.9);
    place(model, block, ORANGE, DAffine3::from_scale_rotation_translation(DVec3::splat(0.4), turned, at));
    let mirrored = DVec3::new(-0.5, 0.5, 0.5);
    let at = DVec3::new(-0.3, 0.0, 0.75);
    place(model, block, STEEL, DAffine3::from_scale_rotation_translation(mirrored, turned, at));
    let flat = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let at = DVec3::new(-2.4, 0.12, 1.3);
    place(model, sheet, GREY, DAffine3::from_scale_rotation_translation(DVec3::new(1.4, 0.9, 0.8), flat, at));
}

fn add_mesh(model: &mut Model, mesh: SourceMesh) -> u32 {
    model.meshes.push(mesh);
    model.meshes.len() as u32 - 1
}

fn place(model: &mut Model, mesh: u32, material: u32, world_from_part: DAffine3) {
    model.instances.push(Instance { mesh, node: 0, material, world_from_part });
}

fn stretched(scale: [f64; 3], at: [f64; 3]) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(scale.into(), DQuat::IDENTITY, at.into())
}

/// Gives every vertex the colour, in sRGB from 0 to 1, of its position.
fn painted(mut mesh: SourceMesh, colour: impl Fn([f32; 3]) -> [f32; 3]) -> SourceMesh {
    let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
    mesh.colours =
        mesh.positions.iter().map(|&p| colour(p).map(byte)).map(|[r, g, b]| [r, g, b, 255]).collect();
    mesh
}

/// A cylinder of radius 1 from y = 0 to 1: a patch for its side, whose seam is doubled, and one for each end.
fn cylinder(segments: u32, rings: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "cylinder".into(), ..SourceMesh::default() };
    let around = |s: u32| {
        let angle = TAU * s as f32 / segments as f32;
        (angle.cos(), angle.sin())
    };
    grid(&mut mesh, [segments, rings], |s, r| {
        let (x, z) = around(s % segments);
        ([x, r as f32 / rings as f32, z], [x, 0.0, z])
    });
    for (y, up) in [(0.0, -1.0), (1.0, 1.0)] {
        grid(&mut mesh, [segments, 4], |s, r| {
            let (x, z) = around(s % segments);
            let radius = if up > 0.0 { 1.0 - r as f32 / 4.0 } else { r as f32 / 4.0 };
            ([x * radius, y, z * radius], [0.0, up, 0.0])
        });
    }
    mesh
}

/// A ring of radius 1 round the z axis.
fn torus(segments: u32, sides: u32, thickness: f32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "torus".into(), ..SourceMesh::default() };
    grid(&mut mesh, [sides, segments], |side, segment| {
        let (a, b) = (TAU * segment as f32 / segments as f32, TAU * side as f32 / sides as f32 + PI);
        let n = [b.cos() * a.cos(), b.cos() * a.sin(), b.sin()];
        ([a.cos() + thickness * n[0], a.sin() + thickness * n[1], thickness * n[2]], n)
    });
    mesh
}

/// Adds a patch of quads with its own vertices, each of a position and a normal.
fn grid(mesh: &mut SourceMesh, [columns, rows]: [u32; 2], at: impl Fn(u32, u32) -> ([f32; 3], [f32; 3])) {
    let base = mesh.positions.len() as u32;
    for row in 0..=rows {
        for column in 0..=columns {
            let (position, normal) = at(column, row);
            mesh.positions.push(position);
            mesh.normals.push(normal);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let corner = |c: u32, r: u32| base + (row + r) * (columns + 1) + column + c;
            mesh.triangles.push([corner(0, 0), corner(0, 1), corner(1, 1)]);
            mesh.triangles.push([corner(0, 0), corner(1, 1), corner(1, 0)]);
        }
    }
}
