//! Angles with holes and a fillet, and bent sheets: what holds pipes and panels.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Vec3};

use super::{Task, block, empty};
use crate::synth::shape::{Finish, Shape, greatest, on_ring};

/// An angle of two plates in rows of cells, some with a hole.
struct Angle {
    /// Cells along the bend.
    cells: u32,
    /// How many of them have a hole, in both plates.
    holes: u32,
    /// Points around a hole, a multiple of 4.
    around: u32,
    /// Steps of the fillet.
    steps: u32,
}

impl Angle {
    /// Plainer or finer.
    fn level(level: u32) -> Self {
        let cells = (1 + level / 6).min(40);
        Self {
            cells,
            holes: cells.min(level.saturating_sub(1)),
            around: 8 + 4 * (level / 5),
            steps: 1 + level / 2,
        }
    }

    fn count(&self) -> u32 {
        let Self { cells, holes, around, steps } = *self;
        let plate = holes * (4 * around + 8) + (cells - holes) * 4 + 2 * cells + 4;
        2 * plate + 4 * cells * steps + 4 * steps
    }
}

/// An angle with its bend along y and its first plate flat on z 0; `size` is the width of a plate.
pub fn bracket(task: &mut Task) -> Shape {
    let angle = Angle::level(greatest(4000, task.target, |level| Angle::level(level).count()));
    if angle.count() > task.target {
        return block::plain(task);
    }
    let mut shape = empty(task);
    let width = task.size as f32;
    let thickness = width * task.random.between(0.04, 0.12) as f32;
    let cell = width * task.random.between(0.7, 1.1) as f32;
    let bend = Bend { angle: &angle, width, thickness, cell };
    bend.add(&mut shape);
    shape
}

struct Bend<'a> {
    angle: &'a Angle,
    width: f32,
    thickness: f32,
    cell: f32,
}

impl Bend<'_> {
    /// The bend's axis lies above the first plate and before the second, so far from their inner faces.
    fn inner_radius(&self) -> f32 {
        1.5 * self.thickness
    }

    fn add(&self, shape: &mut Shape) {
        let r = self.inner_radius() + self.thickness;
        // The first plate goes along x, its inside up; the second is its mirror image with x and z exchanged.
        let flat = Affine3A::from_translation(Vec3::new(r, 0.0, 0.0));
        let exchanged = glam::Mat3::from_cols(Vec3::Z, Vec3::Y, Vec3::X);
        let upright = Affine3A::from_mat3_translation(exchanged, Vec3::new(0.0, 0.0, r));
        self.plate(shape, &flat);
        self.plate(shape, &upright);
        self.fillets(shape);
    }

    /// A plate from x 0 (the bend, open) to the width, cells along y, from z 0 to the thickness.
    fn plate(&self, shape: &mut Shape, place: &Affine3A) {
        let Angle { cells, holes, around, .. } = *self.angle;
        let (width, cell, thick) = (self.width, self.cell, self.thickness);
        for number in 0..cells {
            let (low, high) = (cell * number as f32, cell * (number + 1) as f32);
            if number < holes {
                let middle = Vec3::new(0.55 * width, low + 0.5 * cell, 0.0);
                let radius = 0.22 * width.min(cell);
                holed(shape, place, [width, low, high, thick], middle, radius, around);
            } else {
                for (z, normal) in [(0.0, Vec3::NEG_Z), (thick, Vec3::Z)] {
                    let corner =
                        |i: u32, j: u32| Vec3::new([0.0, width][i as usize], [low, high][j as usize], z);
                    let normal = place.transform_vector3(normal);
                    shape.grid([1, 1], |i, j| (place.transform_point3(corner(i, j)), normal));
                }
            }
        }
        let end = place.transform_vector3(Vec3::X);
        shape.grid([cells, 1], |i, j| {
            let corner = Vec3::new(width, cell * i as f32, [0.0, thick][j as usize]);
            (place.transform_point3(corner), end)
        });
        for (y, normal) in [(0.0, Vec3::NEG_Y), (cell * cells as f32, Vec3::Y)] {
            let normal = place.transform_vector3(normal);
            shape.grid([1, 1], |i, j| {
                let corner = Vec3::new([0.0, width][i as usize], y, [0.0, thick][j as usize]);
                (place.transform_point3(corner), normal)
            });
        }
    }

    /// The quarter of a pipe between the plates: outside, inside and both ends. At its first and last step the
    /// positions are those of the plates.
    fn fillets(&self, shape: &mut Shape) {
        let (steps, cells) = (self.angle.steps, self.angle.cells);
        let r = self.inner_radius() + self.thickness;
        let at = |step: u32, radius: f32, y: f32| match step {
            0 => Vec3::new(r, y, if radius == r { 0.0 } else { self.thickness }),
            last if last == steps => Vec3::new(if radius == r { 0.0 } else { self.thickness }, y, r),
            _ => {
                let (sin, cos) = (FRAC_PI_2 * step as f32 / steps as f32).sin_cos();
                Vec3::new(r - radius * sin, y, r - radius * cos)
            }
        };
        let radial = |step: u32| {
            let (sin, cos) = (FRAC_PI_2 * step as f32 / steps as f32).sin_cos();
            Vec3::new(-sin, 0.0, -cos)
        };
        for (radius, sign) in [(r, 1.0), (self.inner_radius(), -1.0)] {
            shape.grid([cells, steps], |i, j| (at(j, radius, self.cell * i as f32), sign * radial(j)));
        }
        for (y, normal) in [(0.0, Vec3::NEG_Y), (self.cell * cells as f32, Vec3::Y)] {
            shape.grid([steps, 1], |i, j| (at(i, [r, self.inner_radius()][j as usize], y), normal));
        }
    }
}

/// A cell of a plate with a round hole: both faces and the wall, `4 n + 8` triangles. The first of the four numbers is the
/// length along x from 0, then y from and to, and the thickness.
fn holed(
    shape: &mut Shape,
    place: &Affine3A,
    [length, low, high, thick]: [f32; 4],
    middle: Vec3,
    radius: f32,
    n: u32,
) {
    let hole_place = *place * Affine3A::from_translation(middle);
    for (z, normal) in [(0.0, Vec3::NEG_Z), (thick, Vec3::Z)] {
        let corners = [[length, high], [0.0, high], [0.0, low], [length, low]];
        let corners = corners.map(|[x, y]| place.transform_point3(Vec3::new(x, y, z)));
        let hole: Vec<Vec3> = (0..n).map(|i| on_ring(&hole_place, [radius, z], i, n)).collect();
        shape.collar(&corners, &hole, place.transform_vector3(normal));
    }
    // Downwards, so that the normals point to the axis.
    shape.turned_side(&hole_place, n, &[[radius, thick], [radius, 0.0]], Finish::Smooth);
}

/// A thin sheet bent twice, open: `2 m (3 + 2 k)` triangles with `m` strips and `k` steps a bend; `size` is its width.
pub fn clip(task: &mut Task) -> Shape {
    let mut shape = empty(task);
    let level = |level: u32| [1 + level / 8, 1 + level / 2];
    let count = |[strips, steps]: [u32; 2]| 2 * strips * (3 + 2 * steps);
    let [strips, steps] = level(greatest(4000, task.target, |l| count(level(l))));
    let width = task.size as f32;
    let flange = width * task.random.between(0.4, 1.0) as f32;
    let profile = bent_profile(width, flange, if task.random.chance(0.5) { 1.0 } else { -1.0 }, steps);
    shape.grid([strips, profile.len() as u32 - 1], |i, j| {
        let ([x, z], [nx, nz]) = profile[j as usize];
        let y = width * (i as f32 / strips as f32 - 0.5);
        (Vec3::new(x, y, z), Vec3::new(nx, 0.0, nz))
    });
    shape.free_first_edge(0);
    shape
}

/// Points and normals of a sheet in section: flange, bend up, web, bend (back or on), flange.
fn bent_profile(width: f32, flange: f32, second: f32, steps: u32) -> Vec<([f32; 2], [f32; 2])> {
    let radius = 0.12 * width;
    let mut profile = vec![([-flange, 0.0], [0.0, 1.0])];
    let mut arc = |centre: [f32; 2], from: f32, turn: f32| {
        for step in 0..=steps {
            let angle = from + turn * TAU / 4.0 * step as f32 / steps as f32;
            let (sin, cos) = angle.sin_cos();
            profile.push(([centre[0] + radius * cos, centre[1] + radius * sin], [-turn * cos, -turn * sin]));
        }
    };
    // Up on the right of the flange, then to the right again or back over it.
    arc([0.0, radius], -FRAC_PI_2, 1.0);
    let height = width;
    if second > 0.0 {
        arc([0.0, height], 0.0, 1.0);
        profile.push(([-flange, height + radius], [0.0, -1.0]));
    } else {
        arc([2.0 * radius, height], 2.0 * FRAC_PI_2, -1.0);
        profile.push(([flange + 2.0 * radius, height + radius], [0.0, 1.0]));
    }
    profile
}
