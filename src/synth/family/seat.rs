//! Seats: cushion, back and headrest, arms and legs.

use glam::{Affine3A, Vec3};

use super::{Task, block, empty};
use crate::synth::shape::{Finish, Shape};

/// A seat on z 0 that looks along x; `size` is its width.
pub fn seat(task: &mut Task) -> Shape {
    // Arms 2 x 12, legs 4 x 20, and three cushions of at least 52.
    const FIXED: u32 = 104;
    if task.target < FIXED + 3 * 52 {
        return block::plain(task);
    }
    let mut shape = empty(task);
    let width = task.size as f32;
    let lean = task.random.between(0.1, 0.35) as f32;
    frame(&mut shape, width);
    cushions(&mut shape, (task.target - FIXED) / 3, width, lean);
    shape
}

fn frame(shape: &mut Shape, w: f32) {
    for side in [-1.0, 1.0] {
        let middle = Affine3A::from_translation(Vec3::new(0.0, side * 0.52 * w, 1.25 * w));
        shape.cuboid(&middle, Vec3::new(-0.45, -0.06, -0.06) * w, Vec3::new(0.4, 0.06, 0.03) * w);
        for x in [-0.35, 0.35] {
            let foot = Affine3A::from_translation(Vec3::new(x * w, side * 0.4 * w, 0.0));
            shape.turned(&foot, 6, &[[0.04 * w, 0.0], [0.03 * w, 0.75 * w]], Finish::Smooth);
        }
    }
}

/// Three soft blocks of at most `each` triangles: `2 n (bands + 1) - 4` with `n` points around.
fn cushions(shape: &mut Shape, each: u32, w: f32, lean: f32) {
    let n = (4 * ((f64::from(each) * 1.2).sqrt() / 4.0) as u32).max(8);
    let bands = (each + 4) / (2 * n) - 1;
    let back = Affine3A::from_rotation_y(-lean);
    let at = |x: f32, z: f32| Affine3A::from_translation(Vec3::new(x, 0.0, z) * w);
    let blocks = [
        (at(0.0, 0.9), Vec3::new(0.5, 0.48, 0.16)),
        (at(-0.5, 1.0) * back * at(0.0, 0.75), Vec3::new(0.14, 0.47, 0.7)),
        (at(-0.5, 1.0) * back * at(0.06, 1.6), Vec3::new(0.1, 0.32, 0.2)),
    ];
    for (place, half) in blocks {
        shape.pillow(&place, half * w, n, bands);
    }
}
