//! The number of a placement in its kit in, where it is out; in closed form, so that nothing is stored for a placement.
//!
//! A kit covers its surface with a grid of cells in rows along `u`, one cell for each placement, so that numbers grow
//! along the surface, and neighbours in number are neighbours in space.

use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DQuat, DVec3};

use super::family::Site;
use super::layout::{Kit, Stand};
use super::random::Random;
use super::surface::{Cut, Form, Surface};

/// The cells of a kit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cells {
    rows: u32,
    count: u32,
}

impl Cells {
    /// `count` cells of about the kit's elongation (length along `u` over length along `v`).
    pub fn new(kit: &Kit, count: u32) -> Self {
        let [along, across] = kit.surface.extent();
        let rows = match kit.stand {
            // Each station is filled before the next.
            Stand::Across { stations } => f64::from(stations),
            _ => (f64::from(count) * along / across / kit.elongation).sqrt().round(),
        };
        // Whatever goes around a form takes at least four pieces for it.
        let most = if bends(kit) { count / 4 } else { count };
        Self { rows: (rows as u32).clamp(1, most.max(1)), count: count.max(1) }
    }

    /// The row of a cell, its column and how many columns the row has.
    fn cell(&self, number: u32) -> (u32, u32, u32) {
        let [number, rows, count] = [number, self.rows, self.count].map(u64::from);
        let row = number * rows / count;
        let [first, next] = [row, row + 1].map(|row| (row * count).div_ceil(rows));
        (row as u32, (number - first) as u32, (next - first) as u32)
    }
}

/// Where placement `number` of a kit is.
pub fn site(kit: &Kit, cells: Cells, number: u32, random: &mut Random) -> Site {
    let (row, column, columns) = cells.cell(number.min(cells.count - 1));
    let share = |k: u32, of: u32| [k, k + 1].map(|k| f64::from(k) / f64::from(of));
    let (u, v) = (share(row, cells.rows), share(column, columns));
    let drawn_depth = random.between(kit.depth[0], kit.depth[1]);
    let middle = |[from, to]: [f64; 2]| (from + to) / 2.0;
    let [jitter_u, jitter_v] = [0, 1].map(|_| random.between(-0.42, 0.42));
    let jittered = |range: [f64; 2], jitter: f64| middle(range) + (range[1] - range[0]) * jitter;
    let depth = drawn_depth.min(0.45 * kit.surface.room(middle(u), middle(v)));
    let site = |surface: Surface, u, v| Site { surface, u, v, depth, world_from_part: DAffine3::IDENTITY };
    let v = if bends(kit) { clipped(v) } else { v };
    let mut site = match kit.stand {
        Stand::Piece => site(kit.surface, u, v),
        Stand::Across { .. } => {
            let at = kit.surface.u[0] + (kit.surface.u[1] - kit.surface.u[0]) * middle(u);
            site(kit.surface.across(at), v, [0.0, 1.0])
        }
        Stand::Around => site(kit.surface, [middle(u); 2], v),
        Stand::Along => site(kit.surface, u, [middle(v); 2]),
        Stand::Run => {
            let v = jittered(v, jitter_v);
            let length = kit.surface.point(u[0], v).distance(kit.surface.point(u[1], v));
            let half = (u[1] - u[0]) / 2.0 * (kit.longest / length).min(1.0);
            let at = jittered(u, jitter_u * (1.0 - half * 2.0 / (u[1] - u[0])));
            site(kit.surface, [at - half, at + half], [v; 2])
        }
        Stand::Inside | Stand::Upon => {
            site(kit.surface, [jittered(u, jitter_u); 2], [jittered(v, jitter_v); 2])
        }
        Stand::Ordered => site(kit.surface, [middle(u); 2], [middle(v); 2]),
    };
    site.world_from_part = world_from_part(kit, &site, random);
    site
}

/// Whether parts of a kit bend around a form.
fn bends(kit: &Kit) -> bool {
    let is_round = kit.surface.cut == Cut::Skin && !matches!(kit.surface.form, Form::Plane { .. });
    is_round && matches!(kit.stand, Stand::Piece | Stand::Around)
}

/// A quarter of the way around at most: beyond that, a part of few triangles would fold onto itself.
fn clipped([from, to]: [f64; 2]) -> [f64; 2] {
    const MOST: f64 = 0.25;
    let half = ((to - from) / 2.0).min(MOST / 2.0);
    [(from + to) / 2.0 - half, (from + to) / 2.0 + half]
}

fn world_from_part(kit: &Kit, site: &Site, random: &mut Random) -> DAffine3 {
    let middle = |[from, to]: [f64; 2]| (from + to) / 2.0;
    let (u, v) = (middle(site.u), middle(site.v));
    let frame = site.surface.frame(u, v, site.surface.sense(u, v));
    let sunk = frame * DAffine3::from_translation(DVec3::new(0.0, 0.0, -site.depth));
    let quarter = FRAC_PI_2 * f64::from(random.below(4));
    match kit.stand {
        Stand::Piece | Stand::Across { .. } | Stand::Around | Stand::Along => frame,
        Stand::Ordered => sunk * DAffine3::from_rotation_z(kit.turn),
        // Runs are bodies along x; a turn about it puts their bends where there is room.
        Stand::Run => sunk * DAffine3::from_rotation_z(kit.turn) * DAffine3::from_rotation_x(quarter),
        Stand::Upon => sunk * DAffine3::from_rotation_z(quarter),
        Stand::Inside => {
            sunk * DAffine3::from_quat(DQuat::from_rotation_x(std::f64::consts::PI))
                * DAffine3::from_rotation_z(quarter)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_cell_of_its_own() {
        for (rows, count) in [(1, 1), (1, 7), (3, 7), (7, 7), (13, 1000), (999, 1000)] {
            let cells = Cells { rows, count };
            let mut seen = std::collections::BTreeSet::new();
            for number in 0..count {
                let (row, column, columns) = cells.cell(number);
                assert!(row < rows && column < columns, "{number} of {cells:?}");
                assert!(seen.insert((row, column)));
            }
        }
    }
}
