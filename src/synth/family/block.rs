//! Boxes of equipment with rounded corners and connectors; the plainest of them stands in for what has too few triangles.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Vec3};

use super::{Task, empty};
use crate::synth::shape::{Finish, Shape};

/// Triangles of a connector: eight points around, two bands.
const CONNECTOR: u32 = 44;

/// A box on z 0; `size` is its width.
pub fn equipment(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let width = task.size as f32;
    let [length, height] = [0.9, 0.5].map(|share| width * share * task.random.between(0.6, 1.3) as f32);
    let steps = match task.target {
        0..60 => 0,
        60..400 => 2,
        _ => 4,
    };
    let outline = rounded([length, width], 0.12 * width.min(length), steps);
    shape.prism(&Affine3A::IDENTITY, &outline, 0.0, height);
    let wanted = (task.target - shape.count()) / CONNECTOR;
    connectors(&mut shape, wanted, [length, width, height]);
    shape
}

/// A box of 12 triangles on z 0.
pub fn plain(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let half = 0.5 * task.size as f32;
    let [x, z] = [0.7, 0.3].map(|share| half * share * task.random.between(0.5, 1.0) as f32);
    shape.cuboid(&Affine3A::IDENTITY, Vec3::new(-x, -half, 0.0), Vec3::new(x, half, 2.0 * z));
    shape
}

/// A rectangle around the origin with rounded corners; `steps` 0 leaves them sharp.
fn rounded([length, width]: [f32; 2], radius: f32, steps: u32) -> Vec<[f32; 2]> {
    let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0f32]];
    let mut outline = Vec::new();
    for (quarter, [sx, sy]) in corners.into_iter().enumerate() {
        let [x, y] = [sx * length / 2.0, sy * width / 2.0];
        if steps == 0 {
            outline.push([x, y]);
            continue;
        }
        for step in 0..=steps {
            let (sin, cos) = (FRAC_PI_2 * (quarter as f32 + step as f32 / steps as f32)).sin_cos();
            outline.push([x - sx * radius + radius * cos, y - sy * radius + radius * sin]);
        }
    }
    outline
}

/// Round connectors in rows on the front and back faces (along y), or on top where they are many.
fn connectors(shape: &mut Shape, count: u32, [length, width, height]: [f32; 3]) {
    let rows = (f64::from(count).sqrt() * 0.6).ceil().max(1.0) as u32;
    let columns = count.div_ceil(rows).max(1);
    let pitch = [0.8 * width / columns as f32, 0.8 * length / rows as f32];
    let radius = 0.35 * pitch[0].min(pitch[1]).min(0.2 * height);
    let profile = [[1.0, -0.4], [1.0, 1.6], [0.7, 2.0]].map(|point| point.map(|p| p * radius));
    for number in 0..count {
        let (row, column) = (number / columns, number % columns);
        let x = -0.4 * length + pitch[1] * (row as f32 + 0.5);
        let y = -0.4 * width + pitch[0] * (column as f32 + 0.5);
        shape.turned(&Affine3A::from_translation(Vec3::new(x, y, height)), 8, &profile, Finish::Soft);
    }
}
