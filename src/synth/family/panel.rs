//! Pieces of a surface: skins with rows of rivets, as closed plates or open sheets, and plates with stiffeners.

use glam::{Affine3A, DVec3, Mat3, Vec3};

use super::{Site, Task, empty};
use crate::synth::shape::{Finish, Shape};

/// Points around a rivet, and bands of its dome.
const AROUND: u32 = 8;
const BANDS: u32 = 2;

/// A plate or sheet along the site with rivets on its outside; `size` is the thickness.
pub fn skin(task: &Task) -> Shape {
    let mut shape = empty(task);
    let open = task.family.is_open(task.target);
    let plate = Plate::of(task);
    let cells = plate.cells(share_of_faces(task.target), open);
    plate.add(&mut shape, cells, open);
    let each = 2 * AROUND * BANDS + if open { AROUND - 2 } else { 2 * (AROUND - 2) };
    let count = (task.target - shape.count()) / each;
    plate.rivets(&mut shape, count, open);
    shape
}

/// A plate with T-shaped stiffeners on its inside.
pub fn stiff_plate(task: &Task) -> Shape {
    let mut shape = empty(task);
    let plate = Plate::of(task);
    let cells = plate.cells(task.target / 3, false);
    plate.add(&mut shape, cells, false);
    // Each is two boxes, a web and a flange.
    let left = task.target - shape.count();
    let stiffeners = (left / 24).min(6);
    plate.stiffeners(&mut shape, stiffeners);
    let count = (task.target - shape.count()) / (2 * AROUND * BANDS + 2 * (AROUND - 2));
    plate.rivets(&mut shape, count, false);
    shape
}

/// A third for the faces, and more of few.
fn share_of_faces(target: u32) -> u32 {
    (target / 3).max(target.min(600))
}

/// A rectangle of a surface.
struct Plate<'a> {
    site: &'a Site,
    thickness: f64,
    sense: f64,
    /// Metres along `u` and `v`.
    lengths: [f64; 2],
}

impl<'a> Plate<'a> {
    fn of(task: &'a Task) -> Self {
        let site = &task.site;
        let middle = |[from, to]: [f64; 2]| (from + to) / 2.0;
        let sense = site.surface.sense(middle(site.u), middle(site.v));
        let piece = site.surface.within(
            site.u.map(|u| site.surface.u[0] + (site.surface.u[1] - site.surface.u[0]) * u),
            site.v.map(|v| site.surface.v[0] + (site.surface.v[1] - site.surface.v[0]) * v),
        );
        Self { site, thickness: task.size, sense, lengths: piece.extent() }
    }

    /// Quads along `u` and `v` for at most so many triangles: an open sheet has `2 a b`, a plate `4 a b + 4 (a + b)`.
    fn cells(&self, most: u32, open: bool) -> [u32; 2] {
        let count = |[a, b]: [u32; 2]| if open { 2 * a * b } else { 4 * a * b + 4 * (a + b) };
        let wanted = |side: f64| {
            // A flat surface needs few, but a mesh of long strips bends badly: at most 4 to 1.
            let ratio = (self.lengths[0] / self.lengths[1]).clamp(0.25, 4.0).sqrt();
            [side * ratio, side / ratio].map(|quads| (quads as u32).max(1))
        };
        let level = crate::synth::shape::greatest(4000, most, |level| count(wanted(f64::from(level) / 4.0)));
        wanted(f64::from(level) / 4.0)
    }

    /// Position and outward direction in part space at shares of the rectangle, so far above the surface.
    fn at(&self, [s, t]: [f64; 2], height: f64) -> (DVec3, DVec3) {
        let mix = |[from, to]: [f64; 2], share: f64| from + (to - from) * share;
        let frame = self.site.surface.frame(mix(self.site.u, s), mix(self.site.v, t), self.sense);
        let out = frame.matrix3.z_axis;
        let part_from_world = self.site.world_from_part.inverse();
        let point = frame.translation + out * (height - self.site.depth);
        (part_from_world.transform_point3(point), part_from_world.transform_vector3(out))
    }

    fn add(&self, shape: &mut Shape, [a, b]: [u32; 2], open: bool) {
        let layer = |height: f64| -> Vec<(Vec3, Vec3)> {
            let corner = |i: u32, j: u32| [f64::from(i) / f64::from(a), f64::from(j) / f64::from(b)];
            let points = (0..=b).flat_map(|j| (0..=a).map(move |i| (i, j)));
            let place = |(i, j)| self.at(corner(i, j), height);
            points.map(place).map(|(point, out)| (point.as_vec3(), out.as_vec3())).collect()
        };
        let number = |i: u32, j: u32| (j * (a + 1) + i) as usize;
        let outside = layer(0.0);
        let first = shape.count();
        shape.wound_grid([a, b], self.sense < 0.0, |i, j| outside[number(i, j)]);
        if open {
            return shape.free_first_edge(first);
        }
        let inside = layer(-self.thickness);
        shape.wound_grid([a, b], self.sense > 0.0, |i, j| (inside[number(i, j)].0, -inside[number(i, j)].1));
        let layers = [&outside, &inside];
        // At an edge the way off the surface is across the edge and the way out.
        let off = |corner: usize, before: usize, after: usize, sign: f32| {
            let along = outside[after].0 - outside[before].0;
            along.cross(outside[corner].1) * sign * self.sense as f32
        };
        // From the outside inwards, so that the two ways turn from it if the sign is that of the surface.
        let turned = |sign: f32| sign * self.sense as f32 > 0.0;
        for (j, sign) in [(0, 1.0), (b, -1.0)] {
            shape.wound_grid([a, 1], turned(sign), |i, k| {
                let neighbours = [i.saturating_sub(1), (i + 1).min(a)].map(|i| number(i, j));
                let corner = number(i, j);
                (layers[k as usize][corner].0, off(corner, neighbours[0], neighbours[1], sign))
            });
        }
        for (i, sign) in [(0, -1.0), (a, 1.0)] {
            shape.wound_grid([b, 1], turned(sign), |j, k| {
                let neighbours = [j.saturating_sub(1), (j + 1).min(b)].map(|j| number(i, j));
                let corner = number(i, j);
                (layers[k as usize][corner].0, off(corner, neighbours[0], neighbours[1], sign))
            });
        }
    }

    /// Rivets in rows along `u`, closer within a row than the rows are.
    fn rivets(&self, shape: &mut Shape, count: u32, open: bool) {
        if count == 0 {
            return;
        }
        let [along, across] = self.lengths;
        let rows =
            ((f64::from(count) * across / along / 5.0).sqrt().round() as u32).clamp(count.min(2), count);
        let longest = count.div_ceil(rows);
        let radius =
            (0.3 * along / f64::from(longest)).min(0.3 * across / f64::from(rows)).min(3.0 * self.thickness);
        let r = radius as f32;
        let dome = [[r, -0.15 * r], [0.75 * r, 0.4 * r], [0.35 * r, 0.55 * r]];
        for number in 0..count {
            let row = u64::from(number) * u64::from(rows) / u64::from(count);
            let [first, next] = [row, row + 1].map(|row| (row * u64::from(count)).div_ceil(u64::from(rows)));
            let s = (f64::from(number) - first as f64 + 0.5) / (next - first) as f64;
            let t = 0.03 + 0.94 * (row as f64 + 0.5) / f64::from(rows);
            let (point, out) = self.at([0.02 + 0.96 * s, t], 0.0);
            let place = upright(point.as_vec3(), out.as_vec3());
            if open {
                shape.dome(&place, AROUND, &dome)
            } else {
                shape.turned(&place, AROUND, &dome, Finish::Soft)
            }
        }
    }

    /// T-shaped stiffeners across the inside, along the shorter way.
    fn stiffeners(&self, shape: &mut Shape, count: u32) {
        let shorter = usize::from(self.lengths[0] > self.lengths[1]);
        let height =
            (0.12 * self.lengths[1 - shorter] / f64::from(count.max(1))).min(20.0 * self.thickness) as f32;
        let sheet = 0.08 * height;
        for number in 0..count {
            let share = (f64::from(number) + 0.5) / f64::from(count);
            let on_way =
                |t: f64| self.at(if shorter == 0 { [t, share] } else { [share, t] }, -self.thickness);
            let [(start, _), (middle, out), (end, _)] = [0.04, 0.5, 0.96].map(on_way);
            let z = -out.as_vec3().normalize();
            let way = (end - start).as_vec3();
            let x = (way - z * way.dot(z)).normalize_or(z.any_orthonormal_vector());
            // Its foot follows the plate where that is flat; elsewhere it stands on the middle.
            let foot = (start + end) / 2.0;
            let foot = foot + out * (middle - foot).dot(out);
            let place = Affine3A::from_mat3_translation(Mat3::from_cols(x, z.cross(x), z), foot.as_vec3());
            let half = way.length() / 2.0;
            let web = Vec3::new(half, sheet, height);
            shape.cuboid(&place, Vec3::new(-half, -sheet, -0.3 * sheet), web);
            let flange = Vec3::new(half, 4.0 * sheet, height + 2.0 * sheet);
            shape.cuboid(&place, Vec3::new(-half, -4.0 * sheet, height), flange);
        }
    }
}

/// A place at a point whose z goes a way.
fn upright(point: Vec3, z: Vec3) -> Affine3A {
    let z = z.normalize_or(Vec3::Z);
    let x = z.any_orthonormal_vector();
    Affine3A::from_mat3_translation(Mat3::from_cols(x, z.cross(x), z), point)
}
