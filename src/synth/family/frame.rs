//! Profiles along a surface: frames around it, stringers along it, beams below decks; and straight columns.

use glam::{Affine3A, DVec3, Vec3};

use super::profile::{PROFILES, Profile};
use super::{Site, Task, empty};
use crate::synth::shape::{Finish, Shape, greatest};

/// Rivets have six points around and one band, without their foot.
const RIVET: u32 = 20;

/// A section on its way: where it is and its axes across and outwards.
#[derive(Debug, Clone, Copy)]
struct Station {
    origin: Vec3,
    across: Vec3,
    out: Vec3,
}

impl Station {
    fn at(&self, [across, out]: [f32; 2]) -> Vec3 {
        self.origin + self.across * across + self.out * out
    }
}

/// A profile that follows the site from end to end of its longer range, inside the surface; `size` is its height.
pub fn bent(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let profile = chosen(task);
    let points = profile.points();
    // Half of what there is for the bend, the rest for rivets.
    let curved = if task.target < 120 { task.target } else { task.target / 2 };
    let steps = 1 + greatest(400, curved, |level| 2 * points * (level + 1) + 2 * (points - 2));
    let stations: Vec<Station> =
        (0..=steps).map(|k| station(&task.site, f64::from(k) / f64::from(steps))).collect();
    sweep(&mut shape, &profile, &stations, task.size as f32);
    rivets(&mut shape, task);
    shape
}

/// A straight profile from the origin up along z, its length six to nine times its height.
pub fn column(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let profile = chosen(task);
    let points = profile.points();
    let steps = 1 + greatest(6, task.target, |level| 2 * points * (level + 1) + 2 * (points - 2));
    let length = (task.size * task.random.between(9.0, 12.0)) as f32;
    let stations: Vec<Station> = (0..=steps)
        .map(|k| Station {
            origin: Vec3::Z * (length * k as f32 / steps as f32),
            across: Vec3::X,
            out: Vec3::Y,
        })
        .collect();
    sweep(&mut shape, &profile, &stations, task.size as f32);
    base_plate(&mut shape, task);
    shape
}

/// A section that the triangles suffice for.
fn chosen(task: &mut Task) -> Profile {
    let most = match task.target {
        // The more points a section has, the fewer steps are left for the bend.
        0..200 => 1,
        200..500 => 4,
        _ => 5,
    };
    PROFILES[task.random.below(most) as usize]
}

/// Where the profile is at a share of its way, in part space.
fn station(site: &Site, share: f64) -> Station {
    let mix = |[from, to]: [f64; 2]| from + (to - from) * share;
    let sense = site.surface.sense(mix(site.u), mix(site.v));
    let frame = site.surface.frame(mix(site.u), mix(site.v), sense);
    let part_from_world = site.world_from_part.inverse();
    let out = frame.matrix3.z_axis;
    // Along `u` the way across is y; along `v` it is x.
    let runs_along_u = site.u[0] < site.u[1];
    let across = if runs_along_u { frame.matrix3.y_axis } else { frame.matrix3.x_axis };
    let origin = frame.translation - out * site.depth;
    let direction = |d: DVec3| part_from_world.transform_vector3(d).as_vec3();
    Station {
        origin: part_from_world.transform_point3(origin).as_vec3(),
        across: direction(across),
        out: -direction(out),
    }
}

/// A profile with `p` points along `k + 1` stations, every side a patch, closed: `2 p k + 2 (p - 2)` triangles.
fn sweep(shape: &mut Shape, profile: &Profile, stations: &[Station], height: f32) {
    let steps = stations.len() as u32 - 1;
    let sides = profile.outline.len();
    let scaled = |point: usize| profile.outline[point % sides].map(|c| c * height);
    for side in 0..sides {
        let [across, out] = profile.normal(side);
        shape.grid([steps, 1], |i, j| {
            let station = &stations[i as usize];
            (station.at(scaled(side + j as usize)), station.across * across + station.out * out)
        });
    }
    let (first, last) = (&stations[0], &stations[steps as usize]);
    let away = (last.origin - first.origin).normalize_or(Vec3::X);
    for (station, normal) in [(first, -away), (last, away)] {
        let axis = station.across.cross(station.out);
        let ring: Vec<Vec3> = (0..sides).map(|point| station.at(scaled(point))).collect();
        shape.polygon(&ring, profile.triangles, axis * axis.dot(normal).signum());
    }
}

/// As many rivets as there are triangles left for, in a row through the foot.
fn rivets(shape: &mut Shape, task: &Task) {
    let count = (task.target - shape.count()) / RIVET;
    let size = task.size as f32;
    for number in 0..count {
        let station = station(&task.site, (f64::from(number) + 0.5) / f64::from(count));
        let axes = glam::Mat3::from_cols(station.across, station.out.cross(station.across), station.out);
        let place = Affine3A::from_mat3_translation(axes, station.at([0.02 * size, 0.0]));
        let radius = 0.05 * size;
        let profile = [[radius, -0.4 * radius], [radius, 0.6 * radius + 0.07 * size]];
        shape.turned(&place, 6, &profile, Finish::Soft);
    }
}

/// A foot with bolts on it.
fn base_plate(shape: &mut Shape, task: &Task) {
    let size = task.size as f32;
    if task.target - shape.count() >= 12 {
        let (low, high) = (Vec3::new(-0.7, -0.3, -0.08) * size, Vec3::new(0.7, 1.3, 0.0) * size);
        shape.cuboid(&Affine3A::IDENTITY, low, high);
    }
    let bolts = ((task.target - shape.count()) / 20).min(64);
    if bolts == 0 {
        return;
    }
    let each = (task.target - shape.count()) / bolts;
    for number in 0..bolts {
        let (sin, cos) = (std::f32::consts::TAU * number as f32 / bolts as f32).sin_cos();
        let spot = Vec3::new(0.6 * size * cos, (0.5 + 0.7 * sin) * size, 0.0);
        super::fastener::bolt(shape, &Affine3A::from_translation(spot), each, 0.05 * size, 0.3 * size);
    }
}
