//! The meshes of one body in, its collapse-ordered cells out.
//!
//! A body is a mesh of the file of which each material became a mesh of its own. Usually the bake has made one mesh of it
//! again before, with material slots. Where it could not, its meshes lie on one grid, and where an open edge of one is
//! an edge of another too, both ends are locked in both, so that the border between them stays closed at any mix of
//! levels.

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::adjacency::{EdgeCounts, PositionEdge, counts_of, position_edges};
use super::cell_tree::{Joining, Watch, order_cells};
use super::cells;
use super::closure::closure_of;
use super::collapse::Boundary;
use super::record::{Grid, MAX_PART_VERTICES, OrderedPart};
use super::weld::{WeldedMesh, grid_around, weld, weld_whole};
use super::weld_near::close_gaps;
use crate::import::SourceMesh;

/// A body in collapse order, and what its report says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BodyOutcome {
    /// All its cells, parents before their children; one for each mesh that had not to be cut, and none for a mesh of
    /// which no triangle had an area.
    pub cells: Vec<OrderedPart>,
    /// For each cell the number of its mesh; the cells of a mesh come one after another.
    pub mesh_of: Vec<usize>,
    /// For each mesh what the weld found.
    pub welds: Vec<WeldCounts>,
}

/// What the weld of one part found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WeldCounts {
    /// Triangles of the source mesh.
    pub source_triangles: usize,
    /// Vertices of the source mesh.
    pub source_vertices: usize,
    /// Positions after the weld.
    pub positions: usize,
    /// Positions that moved onto another one within the tolerance.
    pub moved: usize,
    /// Triangles dropped because two corners share a position.
    pub degenerate: usize,
    /// Triangles dropped because they repeat an earlier one.
    pub duplicate: usize,
    /// Open and non-manifold edges after the weld.
    pub edges: EdgeCounts,
    /// Positions that are locked because another mesh of the body has them on its border.
    pub shared: usize,
}

/// How meshes are welded and ordered.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OrderOptions {
    /// What may happen to open boundaries.
    pub boundary: Boundary,
    /// Positions on open edges that are at most so far apart, in part units, are one position. `None`: a step of the
    /// part's grid, which is its own precision. 0: only equal ones are.
    pub weld_tolerance: Option<f64>,
}

/// Orders one mesh, which has normals, by its edge collapses.
pub fn order_part(mesh: &SourceMesh, boundary: Boundary) -> BodyOutcome {
    order_body(vec![mesh.clone()], OrderOptions { boundary, ..OrderOptions::default() }, &())
}

/// Orders the meshes of a body, which have normals, for somebody who waits, on the threads of rayon's current pool. If
/// stopped, the outcome lacks cells.
pub fn order_body(meshes: Vec<SourceMesh>, options: OrderOptions, watch: &dyn Watch) -> BodyOutcome {
    let Some(grid) = grid_around(&meshes) else {
        return BodyOutcome { welds: meshes.iter().map(counts).collect(), ..BodyOutcome::default() };
    };
    // Each source mesh is given back as soon as it is welded.
    let welded = |source: SourceMesh| {
        let counts = counts(&source);
        with_closed_gaps(weld_whole(source, grid), counts, grid, options)
    };
    let mut welded: Vec<Welded> = meshes.into_iter().map(welded).collect();
    let shared = shared_borders(&welded);
    for welded in &mut welded {
        welded.odd_edges = Vec::new();
        let is_shared = |position: &&[u32; 3]| shared.contains(*position);
        welded.counts.shared = welded.mesh.positions.iter().filter(is_shared).count();
        watch.done(welded.counts.source_triangles - welded.mesh.triangles.len());
    }
    let welds = welded.iter().map(|welded| welded.counts).collect();
    let joining =
        Joining { grid, boundary: options.boundary, locked: &shared, max_vertices: MAX_PART_VERTICES };
    let ordered: Vec<Vec<OrderedPart>> = welded
        .into_par_iter()
        .with_max_len(1)
        .map(|welded| {
            let closure = closure_of(&welded.mesh);
            let cells = order_cells(cells::cut(welded.mesh), joining, watch);
            cells.into_iter().map(|cell| OrderedPart { closure, ..cell }).collect()
        })
        .collect();
    let mesh_of =
        ordered.iter().enumerate().flat_map(|(mesh, cells)| cells.iter().map(move |_| mesh)).collect();
    BodyOutcome { cells: ordered.into_iter().flatten().collect(), mesh_of, welds }
}

/// A mesh of a body on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Welded {
    /// The mesh; gaps within the tolerance are closed.
    pub mesh: WeldedMesh,
    /// Its open and non-manifold edges.
    pub odd_edges: Vec<PositionEdge>,
    /// What the weld found.
    pub counts: WeldCounts,
}

fn counts(mesh: &SourceMesh) -> WeldCounts {
    WeldCounts {
        source_triangles: mesh.triangles.len(),
        source_vertices: mesh.positions.len(),
        ..WeldCounts::default()
    }
}

/// Welds a mesh on a grid and closes its gaps.
pub fn welded(source: &SourceMesh, grid: Grid, options: OrderOptions) -> Welded {
    with_closed_gaps(weld(source, grid), counts(source), grid, options)
}

/// Closes the gaps of a welded mesh, of whose source these are the counts.
fn with_closed_gaps(mut mesh: WeldedMesh, source: WeldCounts, grid: Grid, options: OrderOptions) -> Welded {
    let mut odd_edges = position_edges(&mesh, PositionEdge::is_odd);
    let steps = options.weld_tolerance.map_or(1.0, |tolerance| tolerance / grid.step());
    let moved = close_gaps(&mut mesh, &odd_edges, steps);
    if moved > 0 {
        odd_edges = position_edges(&mesh, PositionEdge::is_odd);
    }
    let counts = WeldCounts {
        positions: mesh.positions.len(),
        moved,
        degenerate: mesh.degenerate,
        duplicate: mesh.duplicate,
        edges: counts_of(&mesh, &odd_edges),
        ..source
    };
    Welded { mesh, odd_edges, counts }
}

/// The positions of edges that are open in one mesh of the body and are edges of another.
fn shared_borders(meshes: &[Welded]) -> FxHashSet<[u32; 3]> {
    let mut shared = FxHashSet::default();
    if meshes.len() < 2 {
        return shared;
    }
    let ends = |welded: &Welded, edge: &PositionEdge| {
        let [a, b] = edge.ends.map(|position| welded.mesh.positions[position as usize]);
        [a.min(b), a.max(b)]
    };
    // The mesh of each edge that is open somewhere.
    let mut open: FxHashMap<[[u32; 3]; 2], usize> = FxHashMap::default();
    for (number, welded) in meshes.iter().enumerate() {
        for edge in welded.odd_edges.iter().filter(|edge| edge.is_open()) {
            open.entry(ends(welded, edge)).or_insert(number);
        }
    }
    if open.is_empty() {
        return shared;
    }
    for (number, welded) in meshes.iter().enumerate() {
        let other = |edge: &PositionEdge| open.get(&ends(welded, edge)).is_some_and(|&owner| owner != number);
        shared.extend(position_edges(&welded.mesh, other).iter().flat_map(|edge| ends(welded, edge)));
    }
    shared
}
