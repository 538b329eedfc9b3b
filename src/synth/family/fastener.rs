//! Bolts: a hexagonal head, a shank and a thread of rings. Rivets are bolts of few triangles.

use glam::{Affine3A, Vec3};

use super::{Task, empty};
use crate::synth::shape::{Finish, Shape, on_ring};

/// A bolt through the origin, its head above; `size` is the width of the head.
pub fn fastener(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let radius = 0.5 * task.size as f32;
    let length = radius * task.random.between(3.0, 8.0) as f32;
    bolt(&mut shape, &Affine3A::IDENTITY, task.target, radius, length);
    shape
}

/// Adds a bolt of at most `target` triangles, of at least 20: with `n` points around and `b` bands
/// `2 n (b + 1) + 20`, or a pin of 20.
pub fn bolt(shape: &mut Shape, place: &Affine3A, target: u32, radius: f32, length: f32) {
    if target < 44 {
        let pin = [[0.6 * radius, -length], [0.6 * radius, 0.3 * radius]];
        return shape.turned(place, 6, &pin, Finish::Creased);
    }
    let n = match target {
        0..70 => 6,
        70..500 => 12,
        500..4000 => 24,
        _ => 48,
    };
    let bands = (target - 20) / (2 * n) - 1;
    head(shape, place, n, radius);
    let profile = thread(bands, 0.55 * radius, length);
    shape.turned_side(place, n, &profile, Finish::Smooth);
    let tip: Vec<_> = (0..n).map(|i| on_ring(place, profile[0], i, n)).collect();
    shape.cap(&tip, -Vec3::from(place.matrix3.z_axis));
}

/// The sides of a hexagon, its top, and below it a collar around the shank: `12 + 4 + n + 6`.
fn head(shape: &mut Shape, place: &Affine3A, n: u32, radius: f32) {
    // The hole's first point lies half a side before the first corner.
    let turned = *place * Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_6);
    let (low, high) = ([radius, 0.0], [radius, 0.7 * radius]);
    shape.flat_side(&turned, 6, [low, high]);
    let hexagon = |at: [f32; 2]| (0..6).map(|i| on_ring(&turned, at, i, 6)).collect::<Vec<_>>();
    let up = Vec3::from(place.matrix3.z_axis);
    shape.cap(&hexagon(high), up);
    let hole: Vec<_> = (0..n).map(|i| on_ring(place, [0.55 * radius, 0.0], i, n)).collect();
    shape.collar(&hexagon(low), &hole, -up);
}

/// From the tip up to the head: rings of two radii, the last one at the head.
fn thread(bands: u32, radius: f32, length: f32) -> Vec<[f32; 2]> {
    let height = |k: u32| -length + length * k as f32 / bands as f32;
    let at = |k: u32| if k % 2 == 1 && k < bands { 0.86 * radius } else { radius };
    (0..=bands).map(|k| [at(k), if k == bands { 0.0 } else { height(k) }]).collect()
}
