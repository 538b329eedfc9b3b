//! Gratings and ladders: many bars.

use glam::{Affine3A, Mat3, Vec3};

use super::{Task, empty};
use crate::synth::shape::{Finish, Shape};

/// Bars both ways around the origin, their upper edges on z 0: 12 triangles each. `size` is the length of a side.
pub fn grating(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let bars = task.target / 12;
    // Bearing bars are many, cross bars few.
    let crossing = (bars / 4).max(u32::from(bars > 1));
    let bearing = bars - crossing;
    let half = 0.5 * task.size as f32;
    let sheet = (0.2 * half / bearing.max(1) as f32).min(0.004);
    for number in 0..bearing {
        let y = half * (2.0 * (number as f32 + 0.5) / bearing as f32 - 1.0);
        let (low, high) = (Vec3::new(-half, y - sheet, -0.04), Vec3::new(half, y + sheet, 0.0));
        shape.cuboid(&Affine3A::IDENTITY, low, high);
    }
    for number in 0..crossing {
        let x = half * (2.0 * (number as f32 + 0.5) / crossing as f32 - 1.0);
        let (low, high) = (Vec3::new(x - sheet, -half, -0.012), Vec3::new(x + sheet, half, -0.002));
        shape.cuboid(&Affine3A::IDENTITY, low, high);
    }
    shape
}

/// Two rails up along z and rungs of `2 n (b + 1) - 4` triangles between them; `size` is the width.
pub fn ladder(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let width = task.size as f32;
    // From floor to floor; with more triangles the rungs are rounder.
    const MOST_RUNGS: u32 = 14;
    let n = ((task.target / MOST_RUNGS + 4) / 4).max(6) & !1;
    let each = 4 * n - 4;
    let rungs =
        (task.target.saturating_sub(24) / each).clamp(u32::from(task.target >= 24 + each), MOST_RUNGS);
    let height = 0.3 * (rungs.max(4)) as f32;
    for side in [-0.5, 0.5] {
        let y = side * width;
        if task.target - shape.count() >= 12 {
            let (low, high) = (Vec3::new(-0.03, y - 0.008, 0.0), Vec3::new(0.03, y + 0.008, height + 0.2));
            shape.cuboid(&Affine3A::IDENTITY, low, high);
        }
    }
    // A rung goes along y.
    let axes = Mat3::from_cols(Vec3::Z, Vec3::X, Vec3::Y);
    for number in 0..rungs {
        let middle = Vec3::Z * (0.3 * (number as f32 + 0.5));
        let place = Affine3A::from_mat3_translation(axes, middle);
        shape.turned(&place, n, &[[0.012, -0.5 * width], [0.012, 0.5 * width]], Finish::Smooth);
    }
    shape
}
