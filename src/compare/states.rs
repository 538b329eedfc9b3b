//! The cells of one source part in, the states that stand for a share of its triangles out.

use crate::geometry::OrderedPart;
use crate::geometry::cell_tree::{drawn_cells, sums_below};
use crate::geometry::part::sampled_count;
use crate::geometry::record::{CellPlace, decode_error};

/// The vertex count of every cell at which the part has this share of its triangles, or as near to it as states are; 0
/// for a cell in whose place its parent or its children are drawn.
///
/// Every cell that is drawn is brought to the same share of the leaf cells that it stands for, as `export --ratio` does.
pub fn nearest(cells: &[OrderedPart], ratio: f64) -> Vec<u32> {
    let places: Vec<CellPlace> = cells.iter().map(|cell| cell.place).collect();
    let triangles = sums_below(&places, |i| cells[i].triangle_count().into());
    let wanted = |i: usize| triangles[i] as f64 * ratio;
    let drawn = drawn_cells(&places, |i| wanted(i) <= f64::from(cells[i].triangle_count()));
    let count = |(i, cell)| if drawn[i] { nearest_state(cell, wanted(i)) } else { 0 };
    cells.iter().enumerate().map(count).collect()
}

/// The state whose triangle count is nearest to that wanted, the coarser one of two.
fn nearest_state(part: &OrderedPart, wanted: f64) -> u32 {
    let at = &part.triangles_at;
    let distance = |vn: usize| (f64::from(at.count_at(vn)) - wanted).abs();
    let above = part.state_with_triangles(wanted) as usize;
    let below = at.state_at_most(above.saturating_sub(1)).max(part.locked as usize);
    (if distance(below) <= distance(above) { below } else { above }) as u32
}

/// The greatest error that the container states for these states of the cells, in part units.
///
/// Errors are stored at some states only; one holds for all that are finer. `None` if a state is coarser than all
/// of those.
pub fn stated_error(cells: &[OrderedPart], counts: &[u32]) -> Option<f64> {
    cells
        .iter()
        .zip(counts)
        .filter(|&(_, &vn)| vn > 0)
        .map(|(cell, &vn)| stated(cell, vn))
        .try_fold(0.0, |most: f64, error| Some(most.max(error?)))
}

fn stated(part: &OrderedPart, vn: u32) -> Option<f64> {
    let m = part.vertices.len() as u32;
    let state_of = |j: usize| part.triangles_at.state_at_most(sampled_count(m, j) as usize) as u32;
    let holds = (0..part.errors.len()).find(|&j| state_of(j).max(part.locked) <= vn);
    holds.map(|j| decode_error(part.errors[j], part.diagonal()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TrianglesAt;
    use crate::geometry::record::{ERROR_SAMPLES, Grid, Stall, VertexRecord};

    /// Eight vertices on a line, of which each but the first two adds two triangles; the fifth is half of a group.
    fn part() -> OrderedPart {
        let added = [Some(0), Some(0), Some(2), Some(2), None, Some(4), Some(2), Some(2)];
        let mut errors = [0; ERROR_SAMPLES];
        for (j, error) in errors.iter_mut().enumerate().skip(1) {
            *error = 200 + j as u8;
        }
        OrderedPart {
            grid: Grid { origin: [0.0; 3], step_exponent: 0 },
            attributes: Default::default(),
            place: CellPlace::default(),
            vertices: (0..8).map(|x| VertexRecord::new([x, 0, 0], 0)).collect(),
            ecol: vec![0; 8],
            triangles_at: TrianglesAt::from_added(added),
            tiers: Vec::new(),
            locked: 3,
            errors,
            stall: Stall::None,
            closure: Default::default(),
        }
    }

    #[test]
    fn states_are_the_nearest_to_the_share() {
        // Triangles: 2 at 3, 4 at 4, 8 at 6, 10 at 7, 12 at 8.
        for (ratio, vn) in [(1.0, 8), (0.9, 7), (0.7, 6), (0.51, 6), (0.5, 4), (0.3, 4), (0.25, 3), (0.01, 3)]
        {
            assert_eq!(nearest(&[part(), part()], ratio), [vn, vn], "{ratio}");
        }
    }

    #[test]
    fn stated_errors_hold_for_all_finer_states() {
        // Samples at 8, 5.6 (state 4), 4, 2.8 (state 2, below the coarsest, so it holds for 3).
        let code = |vn: u32| stated_error(&[part()], &[vn]).unwrap();
        let error = |code: u8| decode_error(code, 7.0);
        assert_eq!([8, 7, 6, 4, 3].map(code), [0.0, error(201), error(201), error(201), error(203)]);
        assert_eq!(stated_error(&[part(), part()], &[8, 3]), Some(error(203)));
    }

    #[test]
    fn nothing_is_stated_below_the_last_sample() {
        let mut large = part();
        large.locked = 0;
        large.vertices = (0..4096).map(|x| VertexRecord::new([x, 0, 0], 0)).collect();
        large.triangles_at = TrianglesAt::from_added((0..4096).map(|_| Some(1)));
        let last = sampled_count(4096, ERROR_SAMPLES - 1);
        assert!(stated_error(&[large.clone()], &[last]).is_some());
        assert_eq!(stated_error(&[large], &[last - 1]), None);
    }
}
