//! Pipes: straight runs and bends, hollow where there are triangles for it.

use glam::{Affine3A, Vec3};

use super::{Task, empty};
use crate::synth::shape::{Finish, Shape};

/// A ring of a tube: its middle, two axes, and whether a patch ends here.
#[derive(Debug, Clone, Copy)]
pub struct Ring {
    /// The middle.
    pub middle: Vec3,
    /// Across the way.
    pub x: Vec3,
    /// Across the way and `x`.
    pub y: Vec3,
    /// Whether a new patch begins at this ring.
    pub seam: bool,
}

/// A pipe along x around the origin; `size` is its diameter, and the site says how long it is.
pub fn pipe(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let hollow = task.target >= 400;
    let walls = if hollow { 2 } else { 1 };
    let n = match task.target / walls {
        0..60 => 6,
        60..200 => 8,
        200..900 => 12,
        900..6000 => 20,
        _ => 32,
    };
    // Solid 2 n (bands + 1) - 4, hollow 4 n (bands + 1).
    let bands = (task.target / walls + 4) / (2 * n) - walls;
    let radius = 0.5 * task.size as f32;
    let rings = path(task, bands, radius);
    tube(&mut shape, &rings, n, radius, if hollow { 0.85 } else { 0.0 });
    flanges(&mut shape, task, &rings, radius);
    shape
}

/// Rings of straight runs and bends, `bands + 1` of them.
fn path(task: &mut Task, bands: u32, radius: f32) -> Vec<Ring> {
    // Two bends make a jog to the side and on.
    let room = (run_length(task) / (10.0 * radius)) as u32;
    let bends = if bands < 5 { 0 } else { 2 * (bands / 14 + 1).min(5).min(room.saturating_sub(1)) };
    let steps = (bands - bends).saturating_sub(1).checked_div(bends).map_or(0, |steps| steps.clamp(1, 24));
    let corners = corners(task, bends, radius);
    let mut points = vec![(corners[0], true)];
    for at in 1..corners.len() - 1 {
        bend(&mut points, [corners[at - 1], corners[at], corners[at + 1]], 2.5 * radius, steps);
    }
    points.push((corners[corners.len() - 1], true));
    // What bands are left divides the straight runs: one before each bend, and the last.
    let mut left = bands + 1 - points.len() as u32;
    let runs = points.len() - 1;
    let mut cut = Vec::with_capacity(bands as usize + 1);
    for (number, pair) in points.windows(2).enumerate() {
        cut.push(pair[0]);
        if (number as u32).is_multiple_of(steps + 1) {
            let bends_to_come = bends - number as u32 / (steps + 1);
            let extra = left / (bends_to_come + 1);
            left -= extra;
            let share = |k: u32| k as f32 / (extra + 1) as f32;
            cut.extend((1..=extra).map(|k| (pair[0].0.lerp(pair[1].0, share(k)), false)));
        }
    }
    cut.push(points[runs]);
    rings(&cut)
}

/// The corners of a way along x: two a jog, with the ends.
fn corners(task: &mut Task, bends: u32, radius: f32) -> Vec<Vec3> {
    let length = run_length(task);
    let jogs = bends / 2;
    let reach = (0.3 * length / (jogs + 1) as f32).min(0.25).max(3.0 * radius);
    let mut aside = Vec3::ZERO;
    let mut corners = vec![Vec3::X * (-0.5 * length)];
    for jog in 1..=jogs {
        let x = length * (jog as f32 / (jogs + 1) as f32 - 0.5);
        let angle = task.random.below(4) as f32 * std::f32::consts::FRAC_PI_2;
        let next =
            if aside == Vec3::ZERO { Vec3::new(0.0, angle.cos(), angle.sin()) * reach } else { Vec3::ZERO };
        let slope = 0.25 * reach;
        corners.extend([Vec3::X * (x - slope) + aside, Vec3::X * (x + slope) + next]);
        aside = next;
    }
    corners.push(Vec3::X * (0.5 * length) + aside);
    corners
}

/// The length of the site along the way, in metres.
pub fn run_length(task: &Task) -> f32 {
    let site = &task.site;
    let v = (site.v[0] + site.v[1]) / 2.0;
    let ends = site.u.map(|u| site.surface.point(u, v));
    (ends[0].distance(ends[1]) as f32).max(8.0 * task.size as f32)
}

/// The arc in a corner, in `steps` steps.
fn bend(points: &mut Vec<(Vec3, bool)>, [before, corner, after]: [Vec3; 3], radius: f32, steps: u32) {
    let (a, b) = ((before - corner).normalize(), (after - corner).normalize());
    let half = 0.5 * a.angle_between(b);
    let room = 0.45 * before.distance(corner).min(after.distance(corner));
    let tangent = (radius / half.tan()).min(room);
    let radius = tangent * half.tan();
    let centre = corner + (a + b).normalize() * (radius / half.sin());
    let (from, to) = (corner + a * tangent - centre, corner + b * tangent - centre);
    let angle = from.angle_between(to);
    for step in 0..=steps {
        let share = step as f32 / steps as f32;
        let offset = (from * ((1.0 - share) * angle).sin() + to * (share * angle).sin()) / angle.sin();
        points.push((centre + offset, step == 0 || step == steps));
    }
}

/// Rings with axes that turn as little as they can along the way.
pub fn rings(points: &[(Vec3, bool)]) -> Vec<Ring> {
    let last = points.len() - 1;
    let way = |k: usize| {
        let before = if k > 0 { (points[k].0 - points[k - 1].0).normalize_or_zero() } else { Vec3::ZERO };
        let after = if k < last { (points[k + 1].0 - points[k].0).normalize_or_zero() } else { Vec3::ZERO };
        (before + after).normalize_or(Vec3::X)
    };
    let mut x = Vec3::Y;
    (0..=last)
        .map(|k| {
            let t = way(k);
            x = (x - t * x.dot(t)).normalize_or(t.any_orthonormal_vector());
            Ring { middle: points[k].0, x, y: t.cross(x), seam: points[k].1 }
        })
        .collect()
}

/// A tube along rings with `n` points around, closed: solid `2 n (bands + 1) - 4`, or hollow `4 n (bands + 1)` where the
/// inner radius is a share of the outer one.
pub fn tube(shape: &mut Shape, rings: &[Ring], n: u32, radius: f32, inner: f32) {
    let at = |ring: &Ring, i: u32, radius: f32| {
        let (sin, cos) = (std::f32::consts::TAU * (i % n) as f32 / n as f32).sin_cos();
        (ring.middle + (ring.x * cos + ring.y * sin) * radius, ring.x * cos + ring.y * sin)
    };
    let mut side = |radius: f32, sign: f32| {
        let mut from = 0;
        for to in (1..rings.len()).filter(|&k| rings[k].seam || k + 1 == rings.len()) {
            shape.grid([n, (to - from) as u32], |i, j| {
                let (point, out) = at(&rings[from + j as usize], i, radius);
                (point, sign * out)
            });
            from = to;
        }
    };
    side(radius, 1.0);
    if inner > 0.0 {
        side(inner * radius, -1.0);
    }
    for (ring, sign) in [(&rings[0], -1.0), (&rings[rings.len() - 1], 1.0)] {
        let normal = ring.x.cross(ring.y) * sign;
        if inner > 0.0 {
            shape.grid([n, 1], |i, j| (at(ring, i, [radius, inner * radius][j as usize]).0, normal));
        } else {
            let end: Vec<Vec3> = (0..n).map(|i| at(ring, i, radius).0).collect();
            shape.cap(&end, normal);
        }
    }
}

/// Collars at the ends, where there are triangles for them: `2 n (b + 1) - 4` each.
fn flanges(shape: &mut Shape, task: &Task, rings: &[Ring], radius: f32) {
    const N: u32 = 16;
    for ring in [&rings[0], &rings[rings.len() - 1]] {
        if task.target - shape.count() < 6 * N - 4 {
            return;
        }
        let z = ring.x.cross(ring.y);
        let axes = glam::Mat3::from_cols(ring.x, ring.y, z);
        let place = Affine3A::from_mat3_translation(axes, ring.middle);
        let r = radius;
        let profile = [[1.5 * r, -0.3 * r], [1.6 * r, 0.0], [1.5 * r, 0.3 * r]];
        shape.turned(&place, N, &profile, Finish::Smooth);
    }
}
