//! Valves, pumps and fittings: turned bodies with rings of bolts, and a hand wheel where there are triangles for it.

use std::f32::consts::TAU;

use glam::{Affine3A, Vec3};

use super::fastener::bolt;
use super::{Task, empty};
use crate::synth::shape::{Finish, Shape};

/// A body on z 0 with its axis along z; `size` is its diameter.
pub fn valve(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let radius = 0.5 * task.size as f32;
    let n = match task.target {
        0..100 => 6,
        100..500 => 12,
        500..3000 => 20,
        _ => 36,
    };
    // Two thirds for the body, 2 n (bands + 1) - 4.
    let body = if task.target < 200 { task.target } else { task.target * 2 / 3 };
    let bands = ((body + 4) / (2 * n) - 1).clamp(1, 60);
    let profile = profile(task, bands, radius);
    let finish = if task.random.chance(0.3) { Finish::Creased } else { Finish::Smooth };
    shape.turned(&Affine3A::IDENTITY, n, &profile, finish);
    let top = profile[bands as usize][1];
    wheel(&mut shape, task, radius, top);
    flange_bolts(&mut shape, task, radius);
    shape
}

/// Radii between flanges, belly and neck.
fn profile(task: &mut Task, bands: u32, radius: f32) -> Vec<[f32; 2]> {
    let height = radius * task.random.between(2.0, 4.0) as f32;
    let [belly, neck] = [[0.6, 1.0], [0.3, 0.6]].map(|[a, b]| task.random.between(a, b) as f32);
    let form = |t: f32| match t {
        t if t < 0.12 || (0.86..0.95).contains(&t) => 1.0,
        t if t < 0.2 => neck,
        t if t < 0.75 => neck + (belly - neck) * ((t - 0.2) / 0.55 * std::f32::consts::PI).sin(),
        t if t < 0.86 => neck,
        _ => 0.4 * neck,
    };
    let at = |k: u32| k as f32 / bands as f32;
    (0..=bands).map(|k| [radius * form(at(k)), height * at(k)]).collect()
}

/// A ring above the body: `2 n m` triangles, closed.
fn wheel(shape: &mut Shape, task: &Task, radius: f32, top: f32) {
    let left = (task.target - shape.count()) / 2;
    let (n, m) = if left < 700 { (12, 6) } else { (28, 10) };
    if left < 2 * n * m {
        return;
    }
    let thin = 0.06 * radius;
    shape.grid([n, m], |i, j| {
        let (sin, cos) = (TAU * (i % n) as f32 / n as f32).sin_cos();
        let (rise, out) = (TAU * (j % m) as f32 / m as f32).sin_cos();
        let way = Vec3::new(cos, sin, 0.0);
        let normal = way * out + Vec3::Z * rise;
        (way * (0.9 * radius) + Vec3::Z * (top + 0.3 * radius) + normal * thin, normal)
    });
}

/// Bolts around the foot.
fn flange_bolts(shape: &mut Shape, task: &Task, radius: f32) {
    let left = task.target - shape.count();
    let count = (left / 60).clamp(u32::from(left >= 20), 24);
    for number in 0..count {
        let (sin, cos) = (TAU * number as f32 / count as f32).sin_cos();
        let place =
            Affine3A::from_translation(Vec3::new(0.85 * radius * cos, 0.85 * radius * sin, 0.2 * radius));
        bolt(shape, &place, left / count, 0.1 * radius, 0.3 * radius);
    }
}
