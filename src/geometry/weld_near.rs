//! A welded mesh and a tolerance in, the same mesh with the gaps between its patches closed out.
//!
//! Patches that were tessellated apart, or written with few digits, may miss each other by a little where they should
//! meet. Only positions on open edges take part, so nothing that is closed can be pinched, however small it is.

use rustc_hash::FxHashMap;

use super::adjacency::{PositionEdge, open_positions};
use super::weld::WeldedMesh;

/// Moves positions on open edges onto the first one within so many grid steps; returns how many moved. `edges` has at
/// least the open ones.
pub fn close_gaps(mesh: &mut WeldedMesh, edges: &[PositionEdge], steps: f64) -> usize {
    // Positions are a step apart at least, and farther than the grid is nothing.
    if !(1.0..).contains(&steps) || !edges.iter().any(PositionEdge::is_open) {
        return 0;
    }
    let open = open_positions(mesh, edges);
    // In Morton order, as all positions are.
    let open: Vec<u32> = (0..open.len() as u32).filter(|&position| open[position as usize]).collect();
    let onto = nearest_earlier(mesh, &open, steps.min(f64::from(1u32 << super::record::GRID_BITS)));
    let moved = onto.iter().enumerate().filter(|&(position, &onto)| position as u32 != onto).count();
    if moved > 0 {
        mesh.move_positions(&onto);
    }
    moved
}

/// Cubes of so many tolerances hash the positions that others may move onto: large enough that few positions lie
/// near a face and have to look into a neighbour, small enough that few share one.
const CUBE: f64 = 8.0;

/// For every position the one that it moves onto: itself, or the first of the open ones before it that moves nowhere
/// and is within the tolerance.
fn nearest_earlier(mesh: &WeldedMesh, open: &[u32], steps: f64) -> Vec<u32> {
    let mut onto: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut cubes: FxHashMap<[i64; 3], Vec<u32>> = FxHashMap::default();
    let cube = |at: f64| (at / (CUBE * steps)).floor() as i64;
    let near = |a: u32, b: u32| {
        let (a, b) = (mesh.positions[a as usize], mesh.positions[b as usize]);
        let squares = (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2));
        squares.sum::<f64>() <= steps * steps
    };
    for &position in open {
        let at = mesh.positions[position as usize].map(f64::from);
        let [x, y, z] = at.map(|c| cube(c - steps)..=cube(c + steps));
        let around = x.flat_map(|x| y.clone().map(move |y| (x, y)));
        let mut candidates = around.flat_map(|(x, y)| z.clone().map(move |z| [x, y, z]));
        let found =
            candidates.find_map(|key| cubes.get(&key)?.iter().copied().find(|&other| near(position, other)));
        match found {
            Some(other) => onto[position as usize] = other,
            None => cubes.entry(at.map(cube)).or_default().push(position),
        }
    }
    onto
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::adjacency::position_edges;
    use crate::geometry::record::VertexRecord;
    use crate::geometry::weld::{grid_of, weld};
    use crate::import::SourceMesh;

    const STEP: f64 = 1.0 / (1u32 << 19) as f64;

    /// Two squares side by side whose common edge is off by `gap`, on a grid of [`STEP`].
    fn squares(gap: f32) -> WeldedMesh {
        let mesh = SourceMesh {
            positions: vec![
                [0., 0., 0.],
                [1., 0., 0.],
                [1., 1., 0.],
                [0., 1., 0.],
                [1. + gap, 0., 0.],
                [2., 0., 0.],
                [2., 1., 0.],
                [1. + gap, 1., 0.],
            ],
            normals: vec![[0., 0., 1.]; 8],
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
            ..SourceMesh::default()
        };
        let grid = grid_of(&mesh).unwrap();
        assert_eq!(grid.step(), STEP);
        weld(&mesh, grid)
    }

    fn open_edges(mesh: &WeldedMesh) -> usize {
        position_edges(mesh, PositionEdge::is_open).len()
    }

    #[test]
    fn a_gap_below_the_tolerance_is_closed() {
        let mut mesh = squares(0.01);
        let steps = 0.011 / STEP;
        let edges = position_edges(&mesh, PositionEdge::is_odd);
        assert_eq!(open_edges(&mesh), 8);
        assert_eq!(close_gaps(&mut mesh.clone(), &edges, 0.9 * steps), 0);
        assert_eq!(close_gaps(&mut mesh, &edges, steps), 2);
        assert_eq!((mesh.positions.len(), mesh.wedges.len(), open_edges(&mesh)), (6, 6, 6));
        let positions: Vec<[u32; 3]> = mesh.wedges.iter().map(|wedge: &VertexRecord| wedge.grid()).collect();
        assert_eq!(
            positions,
            mesh.wedge_position.iter().map(|&p| mesh.positions[p as usize]).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_tolerance_above_a_triangle_drops_it() {
        let mut mesh = squares(0.01);
        let edges = position_edges(&mesh, PositionEdge::is_odd);
        close_gaps(&mut mesh, &edges, 2e6);
        assert_eq!((mesh.triangles.len(), mesh.degenerate), (0, 4));
    }

    #[test]
    fn what_is_closed_is_left_alone() {
        let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1e-6]];
        let mesh = SourceMesh {
            positions: corners.to_vec(),
            normals: vec![[0., 0., 1.]; 4],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
            ..SourceMesh::default()
        };
        let mut mesh = weld(&mesh, grid_of(&mesh).unwrap());
        let edges = position_edges(&mesh, PositionEdge::is_odd);
        assert_eq!(close_gaps(&mut mesh, &edges, 1e5), 0);
        assert_eq!(mesh.triangles.len(), 4);
    }
}
