//! Cable harnesses: cables side by side that wind a little, and ties around them.

use glam::{Affine3A, Mat3, Vec3};

use super::pipe::{Ring, rings, run_length, tube};
use super::{Task, empty};
use crate::synth::random::Random;
use crate::synth::shape::{Finish, Shape};

/// A bundle along x around the origin; `size` is its diameter.
pub fn harness(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let cables = (task.target / 220).clamp(1, 19);
    let each = task.target / cables;
    let n = if each < 900 { 6 } else { 12 };
    // A cable has 2 n (bands + 1) - 4.
    let bands = (each + 4) / (2 * n) - 1;
    let length = run_length(task);
    let bundle = Bundle::new(&mut task.random, length, task.size as f32);
    let radius = 0.5 * bundle.radius / f64::from(cables).sqrt() as f32;
    for cable in 0..cables {
        let points: Vec<(Vec3, bool)> = (0..=bands)
            .map(|k| (bundle.cable(cable, cables, k as f32 / bands as f32), k == 0 || k == bands))
            .collect();
        tube(&mut shape, &rings(&points), n, radius, 0.0);
    }
    ties(&mut shape, task.target, &bundle);
    shape
}

/// The way of a bundle: a line along x with two waves on it.
struct Bundle {
    length: f32,
    radius: f32,
    waves: [[f32; 3]; 2],
}

impl Bundle {
    fn new(random: &mut Random, length: f32, size: f32) -> Self {
        let mut wave = || {
            let bows = random.between(0.5, 1.0 + f64::from(length));
            [random.between(0.5, 3.0) * f64::from(size), bows, random.between(0.0, 6.3)]
                .map(|value| value as f32)
        };
        Self { length, radius: 0.5 * size, waves: [wave(), wave()] }
    }

    fn middle(&self, share: f32) -> Vec3 {
        let [y, z] = self
            .waves
            .map(|[height, bows, phase]| height * (phase + std::f32::consts::PI * bows * share).sin());
        Vec3::new(self.length * (share - 0.5), y, z)
    }

    /// Cables lie on a spiral as seeds in a sunflower do, and swap places slowly.
    fn cable(&self, cable: u32, cables: u32, share: f32) -> Vec3 {
        let away = 0.8 * self.radius * (cable as f32 / cables as f32).sqrt();
        let (sin, cos) = (cable as f32 * 2.399_963 + 1.5 * share).sin_cos();
        self.middle(share) + Vec3::new(0.0, away * cos, away * sin)
    }
}

/// Ties of ten points around, where there are triangles for them: 56 each.
fn ties(shape: &mut Shape, target: u32, bundle: &Bundle) {
    let count = (target - shape.count()) / 56;
    let radius = 1.25 * bundle.radius;
    for number in 0..count {
        let share = (number as f32 + 0.5) / count as f32;
        let points = [share - 0.01, share, share + 0.01].map(|share| (bundle.middle(share), false));
        let Ring { middle, x, y, .. } = rings(&points)[1];
        let place = Affine3A::from_mat3_translation(Mat3::from_cols(x, y, x.cross(y)), middle);
        let profile = [[radius, -0.1 * radius], [1.05 * radius, 0.0], [radius, 0.1 * radius]];
        shape.turned(&place, 10, &profile, Finish::Smooth);
    }
}
