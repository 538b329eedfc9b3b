//! Rows of instances and a view in, wished budgets out.
//!
//! Peng & Cao 2012, section 5.1, equation 1: the vertices of an instance are in proportion to A^(1/alpha), A being the
//! projected area of its bounding circle, and all together spend N. Here every instance also has a floor and a ceiling,
//! a dead band keeps what would move little where it is, and the common factor is found by bisection, so that the
//! sum is exactly N whenever floors and ceilings allow. Budgets are whole numbers and every float operation is the
//! same on the GPU ([`super::power`]), so that both agree bit for bit.

use super::power::{exp2, log2};
use crate::container::format::MAX_CELL_DEPTH;
use crate::geometry::record::ERROR_SAMPLES;
use crate::gpu::layout::{SelectParams, SelectRow, Weighed};
use crate::scene::camera::split_f64;

/// The bits of the greatest factor: 2^80, which takes the least weight (2^-40) above every ceiling, and the greatest
/// (2^40) not beyond f32.
pub(crate) const MAX_LAMBDA: u32 = 0x6780_0000;
/// Weights are 2 to the power of this at most, and of its negative at least.
const MAX_LOG2_WEIGHT: f32 = 40.0;
/// Responses are at most this: above any ceiling, and exact in f32.
const MAX_RESPONSE: f32 = 16_777_216.0;
/// Above any factor.
const NEVER: f32 = 3e38;

/// What selection needs to know of the camera and of the user's wishes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelectView {
    /// The eye's world position.
    pub eye: [f64; 3],
    /// Frustum planes around the eye, unit normals inwards: p is inside where dot(xyz, p - eye) + w >= 0. Unused
    /// ones are `[0, 0, 0, 1]`.
    pub planes: [[f32; 4]; 6],
    /// Pixels that a unit length covers at distance 1.
    pub focal_px: f32,
    /// Whether everything is at distance 1: the camera has no perspective.
    pub parallel: bool,
    /// Instances whose bounding circle covers fewer pixels are culled; 0 culls none.
    pub min_area_px: f32,
    /// Above this, a larger area does not earn more: the area of the picture, say.
    pub max_area_px: f32,
    /// The paper's alpha: 3.
    pub alpha: f32,
    /// No instance gets more vertices than its error at this many pixels needs; 0: no such limit.
    pub error_px: f32,
    /// A budget moves only if it is off by more than this part of itself.
    pub dead_band: f32,
    /// How many vertices to spend (`N`).
    pub budget: u32,
}

/// A world coordinate as the nearest f32 and what it lacks, so that differences near the eye keep their precision.
pub fn split(value: [f64; 3]) -> ([f32; 3], [f32; 3]) {
    let (high, low) = split_f64(value.into());
    (high.to_array(), low.to_array())
}

impl SelectView {
    /// The uniform of the pass, for this many instances, which are all candidates.
    pub fn params(&self, instance_count: u32) -> SelectParams {
        let (eye_high, eye_low) = split(self.eye);
        // With nothing to cull, below any logarithm that can come out.
        let log2_area_min = if self.min_area_px > 0.0 { log2(self.min_area_px) } else { -1e4 };
        SelectParams {
            eye_high,
            instance_count,
            eye_low,
            budget: self.budget.min(u32::MAX - 1),
            planes: self.planes,
            log2_area_scale: log2(std::f32::consts::PI) + 2.0 * log2(self.focal_px),
            log2_area_min,
            log2_area_max: log2(self.max_area_px),
            inverse_alpha: 1.0 / self.alpha.max(1e-3),
            log2_error_limit: log2(self.error_px) - log2(self.focal_px),
            error_limited: u32::from(self.error_px > 0.0),
            // At 1 a factor of zero would keep everything where it is.
            dead_band: self.dead_band.clamp(0.0, 0.99),
            zero: 0,
            candidate_count: instance_count,
            previous_count: 0,
            parallel: u32::from(self.parallel),
            padding: 0,
        }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The centre of the instance's box, seen from the eye.
fn centre_from_eye(row: &SelectRow, params: &SelectParams) -> [f32; 3] {
    std::array::from_fn(|axis| {
        (row.centre_high[axis] - params.eye_high[axis]) + (row.centre_low[axis] - params.eye_low[axis])
    })
}

/// Whether the box lies wholly on the outer side of a plane.
fn outside_frustum(centre: [f32; 3], half_extent: [f32; 3], planes: &[[f32; 4]; 6]) -> bool {
    planes.iter().any(|&[x, y, z, w]| {
        let reach = dot([x.abs(), y.abs(), z.abs()], half_extent);
        (dot([x, y, z], centre) + w) + reach < 0.0
    })
}

/// `ceiling * 2^(-j / 2)`, rounded up: the vertex count of error sample `j`.
fn sampled_count(ceiling: u32, j: usize) -> u32 {
    // 46341 / 65536 is the root of one half.
    let count = if j.is_multiple_of(2) { ceiling } else { (ceiling.min(65_536) * 46_341 + 65_535) >> 16 };
    count.wrapping_add((1 << (j / 2)) - 1) >> (j / 2)
}

/// How near an instance is, and how large in the picture.
struct Seen {
    log2_distance2: f32,
    log2_area: f32,
}

/// How far an instance is, squared, by what its centre is; nearer than a tenth of the radius counts as there, inside or
/// not.
pub(crate) fn distance2(centre2: f32, radius2: f32, params: &SelectParams) -> f32 {
    if params.parallel != 0 { 1.0 } else { (centre2 - radius2).max(radius2 * 0.01) }
}

fn see(row: &SelectRow, params: &SelectParams) -> Seen {
    let centre = centre_from_eye(row, params);
    let radius2 = dot(row.half_extent, row.half_extent);
    let log2_distance2 = log2(distance2(dot(centre, centre), radius2, params));
    let log2_area = (params.log2_area_scale + log2(radius2)) - log2_distance2;
    Seen { log2_distance2, log2_area }
}

/// A parent weighs as much as its cells would if each had its share of the area.
fn log2_weight(row: &SelectRow, params: &SelectParams, seen: &Seen) -> f32 {
    let of_area = seen.log2_area.min(params.log2_area_max) * params.inverse_alpha;
    let of_cells = (1.0 - params.inverse_alpha) * row.log2_cells;
    (of_area + of_cells).clamp(-MAX_LOG2_WEIGHT, MAX_LOG2_WEIGHT)
}

/// log2 of the error that is allowed at a distance, in units of the row's error scale.
fn log2_allowed_error(row: &SelectRow, params: &SelectParams, log2_distance: f32) -> f32 {
    (params.log2_error_limit + log2_distance) - log2(row.error_scale)
}

fn error_is_allowed(code: u8, log2_allowed: f32) -> bool {
    code == 0 || (f32::from(code) - 255.0) * 0.125 <= log2_allowed
}

/// The factor from which on the children of a parent are drawn; the dead band delays the way back.
fn gate(row: &SelectRow, params: &SelectParams, seen: &Seen, old: u32) -> f32 {
    let log2_allowed = log2_allowed_error(row, params, seen.log2_distance2 * 0.5);
    if params.error_limited != 0 && error_is_allowed(row.errors[0] as u8, log2_allowed) {
        return NEVER;
    }
    let factor = exp2(log2(row.ceiling as f32) - log2_weight(row, params, seen));
    if old == 0 { factor * (1.0 - params.dead_band) } else { factor }
}

/// The factor from which on no ancestor is in a row's place.
fn opening(rows: &[SelectRow], index: usize, params: &SelectParams, old: &[u32]) -> f32 {
    let parent = |index: usize| Some(rows[index].parent as usize).filter(|&parent| parent < rows.len());
    std::iter::successors(parent(index), |&index| parent(index))
        .take(MAX_CELL_DEPTH)
        .map(|index| gate(&rows[index], params, &see(&rows[index], params), old[index]))
        .fold(0.0, f32::max)
}

/// The least sampled vertex count whose error is allowed at this distance; the ceiling if none is.
fn error_ceiling(row: &SelectRow, params: &SelectParams, log2_distance: f32) -> u32 {
    let log2_allowed = log2_allowed_error(row, params, log2_distance);
    let codes: [u8; ERROR_SAMPLES] = bytemuck::cast(row.errors.map(u32::to_le));
    let allowed = |&j: &usize| error_is_allowed(codes[j], log2_allowed);
    (0..ERROR_SAMPLES).rev().find(allowed).map_or(row.ceiling, |j| sampled_count(row.ceiling, j))
}

/// Whether an instance lies outside the view or is too small in it.
pub fn is_culled(row: &SelectRow, params: &SelectParams) -> bool {
    outside_frustum(centre_from_eye(row, params), row.half_extent, &params.planes)
        || see(row, params).log2_area < params.log2_area_min
}

/// Culls and weighs the instance of a row; all zeros if it is culled. `old` has the last budgets, one a row.
pub fn weigh(rows: &[SelectRow], index: usize, params: &SelectParams, old: &[u32]) -> Weighed {
    if is_culled(&rows[index], params) { Weighed::default() } else { weigh_seen(rows, index, params, old) }
}

/// As [`weigh`], of an instance that is not culled.
pub(crate) fn weigh_seen(rows: &[SelectRow], index: usize, params: &SelectParams, old: &[u32]) -> Weighed {
    let row = &rows[index];
    let seen = see(row, params);
    let ceiling = match params.error_limited {
        0 => row.ceiling,
        _ => error_ceiling(row, params, seen.log2_distance2 * 0.5).max(row.floor.min(row.ceiling)),
    };
    let open = opening(rows, index, params, old);
    let is_parent = row.log2_cells > 0.0;
    Weighed {
        weight: exp2(log2_weight(row, params, &seen)),
        floor: row.floor.min(ceiling),
        ceiling,
        old: old[index].min(MAX_RESPONSE as u32),
        open,
        close: if is_parent { open.max(gate(row, params, &seen, old[index])) } else { NEVER },
    }
}

/// Whether an instance is drawn at a factor, rather than its parent cell or its children.
pub(crate) fn is_drawn(item: &Weighed, lambda: f32) -> bool {
    item.open <= lambda && lambda < item.close
}

/// The budget of an instance at a factor. While it is drawn it never falls as the factor grows: inside the dead band
/// it is the old one, which is above all responses below the band and below all responses above it.
pub fn respond(item: &Weighed, lambda: f32, dead_band: f32) -> u32 {
    if !is_drawn(item, lambda) {
        return 0;
    }
    let x = lambda * item.weight;
    let old = item.old as f32;
    let stays = item.old > 0 && (x - old).abs() <= dead_band * old;
    let count = if stays { item.old } else { x.min(MAX_RESPONSE) as u32 };
    count.clamp(item.floor, item.ceiling)
}

/// The greatest bits up to `end` for which `affordable` is true, found from the highest down, if it is so for all below
/// some; at least 0. Where a parent closes, costs may fall, and then affordable bits are found that need not be the
/// greatest.
fn greatest(end: u32, affordable: impl Fn(u32) -> bool) -> u32 {
    let with_bit = |low: u32, bit: u32| {
        let candidate = low | 1 << bit;
        if candidate <= end && affordable(candidate) { candidate } else { low }
    };
    (0..u32::BITS).rev().fold(0, with_bit)
}

/// The wished vertex count of each instance, 0 if it is culled, given those of the last frame.
///
/// They spend exactly `params.budget` if the visible instances' floors and ceilings allow; if the floors are above
/// it, each gets its floor. Of the cells of one part, parents are drawn below the factor that would give them all they
/// have, and their children from there on: what that step is too large for is left over. Time is in proportion to the
/// instances: each is looked at about 35 times.
///
/// # Panics
/// If `old` is shorter than `rows`.
pub fn select(rows: &[SelectRow], params: &SelectParams, old: &[u32]) -> Vec<u32> {
    let items: Vec<Weighed> = (0..rows.len()).map(|index| weigh(rows, index, params, old)).collect();
    let at = |item: &Weighed, bits: u32| respond(item, f32::from_bits(bits), params.dead_band);
    let cost = |bits: u32| items.iter().map(|item| u64::from(at(item, bits))).sum::<u64>();
    let budget = u64::from(params.budget);
    // Positive floats are ordered as their bits are.
    let lambda = greatest(MAX_LAMBDA, |bits| cost(bits) <= budget);
    let next = (lambda + 1).min(MAX_LAMBDA);
    let mut left = budget.saturating_sub(cost(lambda));
    items
        .iter()
        .map(|item| {
            let count = at(item, lambda);
            let stays = is_drawn(item, f32::from_bits(lambda)) == is_drawn(item, f32::from_bits(next));
            let jump = if stays { at(item, next) - count } else { 0 };
            let dealt = left.min(u64::from(jump));
            left -= dealt;
            count + dealt as u32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::NO_PARENT_ROW;
    use proptest::prelude::*;

    fn view(budget: u32) -> SelectView {
        SelectView {
            eye: [0.0; 3],
            planes: [[0.0, 0.0, 0.0, 1.0]; 6],
            focal_px: 1000.0,
            parallel: false,
            min_area_px: 0.0,
            max_area_px: 1e6,
            alpha: 3.0,
            error_px: 0.0,
            dead_band: 0.0,
            budget,
        }
    }

    fn row(distance: f64, floor: u32, ceiling: u32) -> SelectRow {
        let (centre_high, centre_low) = split([distance, 0.0, 0.0]);
        let half_extent = [0.1; 3];
        SelectRow {
            centre_high,
            floor,
            centre_low,
            ceiling,
            half_extent,
            parent: NO_PARENT_ROW,
            ..Default::default()
        }
    }

    #[test]
    fn budgets_follow_the_cube_root_of_the_area() {
        // Eight times as far away: a 64th of the area, a quarter of the budget.
        let rows = [row(10.0, 0, 60_000), row(80.0, 0, 60_000)];
        let wish = select(&rows, &view(50_000).params(2), &[0; 2]);
        assert_eq!(wish.iter().sum::<u32>(), 50_000);
        assert!(wish[0].abs_diff(40_000) < 20, "{wish:?}");
    }

    #[test]
    fn what_a_clamped_instance_leaves_goes_to_the_others() {
        let rows = [row(10.0, 0, 100), row(10.0, 0, 60_000), row(10.0, 500, 500)];
        assert_eq!(select(&rows, &view(9_000).params(3), &[0; 3]), [100, 8_400, 500]);
        assert_eq!(select(&rows, &view(10).params(3), &[0; 3]), [0, 0, 500]);
        assert_eq!(select(&rows, &view(u32::MAX).params(3), &[0; 3]), [100, 60_000, 500]);
    }

    #[test]
    fn what_lies_outside_or_is_too_small_is_culled() {
        let mut culling = view(1000);
        culling.planes[2] = [1.0, 0.0, 0.0, 0.0];
        culling.min_area_px = 1.0;
        let rows = [row(10.0, 5, 100), row(-0.05, 5, 100), row(-10.0, 5, 100), row(1e4, 5, 100)];
        assert_eq!(select(&rows, &culling.params(4), &[0; 4]), [100, 100, 0, 0]);
    }

    #[test]
    fn errors_limit_ceilings() {
        let mut limited = view(u32::MAX);
        limited.error_px = 1.0;
        let mut far = row(100.0, 10, 1024);
        far.error_scale = 1.0;
        // 1 px at 100 is a tenth of a unit; 2^(-31/8) = 0.068 is allowed, 2^(-23/8) = 0.136 is not.
        far.errors = [u32::from_le_bytes([0, 0, 224, 224]), u32::from_le_bytes([224, 232, 255, 255]), !0, !0];
        assert_eq!(select(&[far], &limited.params(1), &[0]), [1024 / 4]);
        let near = SelectRow { centre_high: [1.0, 0.0, 0.0], ..far };
        assert_eq!(select(&[near], &limited.params(1), &[0]), [725]);
        let at_least = SelectRow { floor: 600, ..far };
        assert_eq!(select(&[at_least], &limited.params(1), &[0]), [600]);
    }

    /// A root of two parents of two leaves each, all at one place.
    fn tree() -> Vec<SelectRow> {
        let cell = |parent, floor, ceiling, cells: f32| SelectRow {
            parent,
            log2_cells: cells.log2(),
            ..row(10.0, floor, ceiling)
        };
        let leaf = |parent| cell(parent, 100, 10_000, 1.0);
        let parents = [cell(NO_PARENT_ROW, 8, 300, 4.0), cell(0, 40, 180, 2.0), cell(0, 40, 180, 2.0)];
        parents.into_iter().chain([leaf(1), leaf(1), leaf(2), leaf(2)]).collect()
    }

    #[test]
    fn of_every_path_from_root_to_leaf_one_cell_is_drawn() {
        let rows = tree();
        let mut counts_drawn = Vec::new();
        for budget in (0..45_000).step_by(97) {
            let wish = select(&rows, &view(budget).params(7), &[0; 7]);
            let drawn = |i: usize| u32::from(wish[i] > 0);
            for (leaf, parent) in [(3, 1), (4, 1), (5, 2), (6, 2)] {
                assert_eq!(drawn(leaf) + drawn(parent) + drawn(0), 1, "{budget}: {wish:?}");
            }
            assert!(wish.iter().sum::<u32>() <= budget.max(8), "{budget}: {wish:?}");
            counts_drawn.push((0..7).map(drawn).sum::<u32>());
        }
        assert!(counts_drawn.is_sorted() && counts_drawn[0] == 1 && counts_drawn.last() == Some(&4));
    }

    #[test]
    fn a_parent_that_is_good_enough_is_not_refined() {
        let mut limited = view(u32::MAX);
        limited.error_px = 1.0;
        let mut rows = tree();
        for row in &mut rows {
            (row.error_scale, row.errors) = (1.0, [u32::from_le_bytes([200, 255, 255, 255]), !0, !0, !0]);
        }
        // 2^(-55/8) = 0.0085: more than 1 px at 1, less at 10.
        assert_eq!(select(&rows, &limited.params(7), &[0; 7]), [300, 0, 0, 0, 0, 0, 0]);
        for row in &mut rows {
            row.centre_high = [0.8, 0.0, 0.0];
        }
        assert_eq!(select(&rows, &limited.params(7), &[0; 7]), [0, 0, 0, 10_000, 10_000, 10_000, 10_000]);
    }

    #[test]
    fn a_camera_at_rest_changes_nothing() {
        let rows: Vec<_> = (1..100).map(|i| row(f64::from(i) * 3.7, 4, 5000)).collect();
        let mut resting = view(77_777);
        resting.dead_band = 0.05;
        let first = select(&rows, &resting.params(99), &[0; 99]);
        let second = select(&rows, &resting.params(99), &first);
        assert_eq!(first.iter().sum::<u32>(), 77_777);
        assert_eq!(first, second);
    }

    prop_compose! {
        fn any_item()(
            log2_weight in -40f32..40.0,
            floor in 0u32..5000,
            more in 0u32..65_536,
            old in prop_oneof![Just(0u32), 0u32..70_000],
        ) -> Weighed {
            Weighed { weight: exp2(log2_weight), floor, ceiling: floor + more, old, open: 0.0, close: NEVER }
        }
    }

    proptest! {
        #[test]
        fn responses_never_fall(
            item in any_item(),
            bits in 0..MAX_LAMBDA,
            more in prop_oneof![Just(1u32), 0u32..1 << 20],
            near in -0.2f32..0.2,
            dead_band in 0f32..0.99,
        ) {
            // At any factor, and around the edges of the dead band.
            let edge = (item.old as f32 * (1.0 + near) / item.weight).to_bits().min(MAX_LAMBDA);
            for low in [bits, edge] {
                let high = (low + more).min(MAX_LAMBDA);
                let at = |bits| respond(&item, f32::from_bits(bits), dead_band);
                prop_assert!(at(low) <= at(high));
            }
            prop_assert_eq!(respond(&item, 0.0, dead_band), item.floor);
            prop_assert_eq!(respond(&item, f32::from_bits(MAX_LAMBDA), 0.0), item.ceiling);
        }
    }
}
