//! The cells of one part in, all of them ordered out, with parent cells above them.
//!
//! Cells keep the positions that they share, so that they meet without cracks at any mix of levels; alone, these
//! borders would set a floor to how coarse a large part can become. So neighbouring cells are joined in their coarsest
//! states into a *parent cell*, in which the borders between them are ordinary edges, and which is ordered like any
//! other; only what it shares with cells outside stays locked. Parents have parents, up to one root where that is
//! possible. Of a path from a root to a leaf cell exactly one cell is drawn, and any such choice meets without cracks:
//! a shared position is free only where all cells that have it lie below one parent.

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::cells::Cell;
use super::collapse::{Boundary, collapse_order};
use super::order::{OrderedMesh, arrange};
use super::part::{coarsest_share_is_high, error_samples};
use super::record::{
    CellPlace, Grid, MAX_PART_TRIANGLES, MAX_PART_VERTICES, OrderedPart, Stall, VertexRecord,
};
use super::tiers;
use super::weld::{WeldedMesh, morton};

/// What somebody who waits for a part to be ordered sees and says.
pub trait Watch: Sync {
    /// Whether to stop at the next cell.
    fn stopped(&self) -> bool;
    /// That so many more triangles of the source mesh are done.
    fn done(&self, triangles: usize);
}

/// Nobody waits.
impl Watch for () {
    fn stopped(&self) -> bool {
        false
    }

    fn done(&self, _triangles: usize) {}
}

/// An ordered cell, while its parent is looked for.
struct Node {
    part: OrderedPart,
    /// The error of its coarsest state, in grid steps.
    error: f32,
    cause: Stall,
    parent: Option<usize>,
}

/// Orders all cells of a part in parallel and puts parent cells above them.
///
/// Roots come first, and every parent before its children; [`OrderedPart::place`] says which is which. A watch that
/// stops it makes the result incomplete.
/// Positions in `shared` belong to borders with other parts and stay locked in all of them.
pub fn order_cells(
    cells: Vec<Cell>,
    shared: &FxHashSet<[u32; 3]>,
    grid: Grid,
    boundary: Boundary,
    watch: &dyn Watch,
) -> Vec<OrderedPart> {
    order_cells_to(cells, shared, grid, boundary, watch, MAX_PART_VERTICES)
}

/// As [`order_cells`], with parents of at most so many vertices.
pub fn order_cells_to(
    cells: Vec<Cell>,
    shared: &FxHashSet<[u32; 3]>,
    grid: Grid,
    boundary: Boundary,
    watch: &dyn Watch,
    max_vertices: usize,
) -> Vec<OrderedPart> {
    let leaf = |cell: Cell| {
        let cell = with_locked(cell, shared);
        let node = order_cell(&cell, grid, boundary, 0.0);
        watch.done(cell.mesh.triangles.len());
        node
    };
    let mut nodes: Vec<Node> =
        cells.into_par_iter().with_max_len(1).filter(|_| !watch.stopped()).map(leaf).collect();
    let mut roots: Vec<usize> = (0..nodes.len()).collect();
    while roots.len() > 1 && !watch.stopped() {
        let groups = neighbours_that_fit(&nodes, &roots, max_vertices);
        if groups.len() == roots.len() {
            break;
        }
        roots = join_groups(&mut nodes, &groups, shared, grid, boundary);
    }
    parents_first(nodes)
}

fn with_locked(mut cell: Cell, shared: &FxHashSet<[u32; 3]>) -> Cell {
    if !shared.is_empty() {
        for (position, locked) in cell.mesh.positions.iter().zip(&mut cell.locked) {
            *locked |= shared.contains(position);
        }
    }
    cell
}

/// Orders one cell whose finest state is off by `error` grid steps already.
fn order_cell(cell: &Cell, grid: Grid, boundary: Boundary, error: f32) -> Node {
    let order = collapse_order(&cell.mesh, &cell.locked, boundary);
    let mesh = arrange(&cell.mesh, &order);
    Node {
        error: error + mesh.error_at(mesh.locked),
        part: stored(cell, mesh, grid, error),
        cause: order.stall,
        parent: None,
    }
}

fn stored(cell: &Cell, mesh: OrderedMesh, grid: Grid, error: f32) -> OrderedPart {
    OrderedPart {
        grid,
        coloured: cell.mesh.coloured,
        // The cut has seen to it that indices fit 16 bits.
        ecol: mesh.ecol.iter().map(|&target| target as u16).collect(),
        tiers: tiers::cut(&mesh),
        locked: mesh.locked,
        errors: error_samples(&mesh, &cell.mesh, error),
        stall: Stall::None,
        triangles_at: mesh.triangles_at,
        vertices: mesh.vertices,
        place: CellPlace::default(),
    }
}

/// Cuts the list of roots, in which neighbours in space are mostly neighbours, where the coarsest states of more would
/// not fit into one cell.
fn neighbours_that_fit(nodes: &[Node], roots: &[usize], max_vertices: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let (mut vertices, mut triangles) = (usize::MAX, usize::MAX);
    for &root in roots {
        let part = &nodes[root].part;
        vertices = vertices.saturating_add(part.locked as usize);
        triangles = triangles.saturating_add(part.coarsest_triangles() as usize);
        match groups.last_mut() {
            Some(group) if vertices <= max_vertices && triangles <= MAX_PART_TRIANGLES => group.push(root),
            _ => {
                (vertices, triangles) = (part.locked as usize, part.coarsest_triangles() as usize);
                groups.push(vec![root]);
            }
        }
    }
    groups
}

/// Makes a parent of every group of more than one; returns the roots that there are then, in the same order.
fn join_groups(
    nodes: &mut Vec<Node>,
    groups: &[Vec<usize>],
    shared: &FxHashSet<[u32; 3]>,
    grid: Grid,
    boundary: Boundary,
) -> Vec<usize> {
    let owners = owners(nodes, groups.iter().flatten());
    let parent = |group: &Vec<usize>| {
        let children: Vec<&Node> = group.iter().map(|&node| &nodes[node]).collect();
        let error = children.iter().map(|node| node.error).fold(0.0, f32::max);
        let mut parent = order_cell(&with_locked(joined(&children, &owners), shared), grid, boundary, error);
        parent.part.place.leaf_cells = children.iter().map(|node| node.part.place.leaf_cells.max(1)).sum();
        parent
    };
    let parents: Vec<Option<Node>> =
        groups.par_iter().with_max_len(1).map(|group| (group.len() > 1).then(|| parent(group))).collect();
    let mut roots = Vec::with_capacity(groups.len());
    for (group, parent) in groups.iter().zip(parents) {
        let Some(parent) = parent else {
            roots.push(group[0]);
            continue;
        };
        for &child in group {
            nodes[child].parent = Some(nodes.len());
        }
        roots.push(nodes.len());
        nodes.push(parent);
    }
    roots
}

/// How many of some nodes have each position in their coarsest state.
fn owners<'a>(nodes: &[Node], of: impl Iterator<Item = &'a usize>) -> FxHashMap<u64, u32> {
    let mut owners = FxHashMap::default();
    for &node in of {
        for position in coarsest_positions(&nodes[node].part) {
            *owners.entry(position).or_insert(0) += 1;
        }
    }
    owners
}

fn coarsest_positions(part: &OrderedPart) -> Vec<u64> {
    let coarsest = &part.vertices[..part.locked as usize];
    let mut positions: Vec<u64> = coarsest.iter().map(|vertex| vertex.packed_position()).collect();
    positions.sort_unstable();
    positions.dedup();
    positions
}

/// The coarsest states of some cells as one mesh, locked where cells outside share a position.
fn joined(children: &[&Node], owners: &FxHashMap<u64, u32>) -> Cell {
    let parts = || children.iter().map(|node| &node.part);
    let key = |record: &VertexRecord| (morton(record.grid()), record.attributes());
    let mut records: Vec<VertexRecord> =
        parts().flat_map(|part| &part.vertices[..part.locked as usize]).copied().collect();
    records.sort_unstable_by_key(key);
    records.dedup();
    let mut mesh = WeldedMesh { coloured: parts().any(|part| part.coloured), ..WeldedMesh::default() };
    let mut inside = FxHashMap::default();
    for part in parts() {
        let wedge = |vertex: u16| {
            let own = key(&part.vertices[usize::from(vertex)]);
            records.partition_point(|other| key(other) < own) as u32
        };
        mesh.triangles.extend(part.reformed(part.locked).into_iter().map(|t| t.map(wedge)));
        for position in coarsest_positions(part) {
            *inside.entry(position).or_insert(0) += 1;
        }
    }
    let mut locked = Vec::new();
    let mut last = None;
    for &record in &records {
        let position = record.packed_position();
        if last != Some(position) {
            last = Some(position);
            mesh.positions.push(record.grid());
            locked.push(owners.get(&position) != inside.get(&position));
        }
        mesh.wedges.push(record);
        mesh.wedge_position.push(mesh.positions.len() as u32 - 1);
    }
    Cell { mesh, locked }
}

/// Turns the list round, so that parents come before their children, and says of every cell where it stands.
fn parents_first(mut nodes: Vec<Node>) -> Vec<OrderedPart> {
    for (i, node) in nodes.iter_mut().enumerate() {
        node.part.place.parent_distance = node.parent.map_or(0, |parent| (parent - i) as u32);
    }
    nodes.reverse();
    let places: Vec<CellPlace> = nodes.iter().map(|node| node.part.place).collect();
    let triangles = sums_below(&places, |i| nodes[i].part.triangle_count().into());
    for (node, triangles) in nodes.iter_mut().zip(triangles).filter(|(node, _)| node.parent.is_none()) {
        if coarsest_share_is_high(node.part.coarsest_triangles(), triangles) {
            // A part that keeps more than a tenth of its triangles always has a cause.
            node.part.stall = if node.cause == Stall::None { Stall::Least } else { node.cause };
        }
    }
    nodes.into_iter().map(|node| node.part).collect()
}

/// For every cell, given parents first, the sum of a value over the leaf cells below it; its own value for a leaf.
pub fn sums_below(places: &[CellPlace], value: impl Fn(usize) -> u64) -> Vec<u64> {
    let mut sums = vec![0; places.len()];
    for (i, place) in places.iter().enumerate().rev() {
        if place.leaf_cells == 0 {
            sums[i] = value(i);
        }
        if place.parent_distance > 0 {
            sums[i - place.parent_distance as usize] += sums[i];
        }
    }
    sums
}

/// Which cells, given parents first, are drawn where a parent is drawn if it is fine enough and its children are
/// otherwise: exactly one on every path from a root to a leaf.
pub fn drawn_cells(places: &[CellPlace], is_enough: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut refined = vec![false; places.len()];
    let mut drawn = vec![false; places.len()];
    for (i, place) in places.iter().enumerate() {
        let distance = place.parent_distance as usize;
        if distance > 0 && !refined[i - distance] {
            continue;
        }
        refined[i] = place.leaf_cells > 0 && !is_enough(i);
        drawn[i] = !refined[i];
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A root of two parents, of which the first has two leaves and the second three.
    fn places() -> Vec<CellPlace> {
        let place = |parent_distance, leaf_cells| CellPlace { parent_distance, leaf_cells };
        vec![
            place(0, 5),
            place(1, 2),
            place(2, 3),
            place(2, 0),
            place(3, 0),
            place(3, 0),
            place(4, 0),
            place(5, 0),
        ]
    }

    #[test]
    fn sums_are_of_leaves_only() {
        assert_eq!(sums_below(&places(), |i| i as u64), [25, 7, 18, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn one_cell_is_drawn_on_every_path() {
        let drawn = |enough: &[usize]| {
            let drawn = drawn_cells(&places(), |i| enough.contains(&i));
            (0..8).filter(|&i| drawn[i]).collect::<Vec<_>>()
        };
        assert_eq!(drawn(&[0, 1]), [0]);
        assert_eq!(drawn(&[1]), [1, 5, 6, 7]);
        assert_eq!(drawn(&[2]), [2, 3, 4]);
        assert_eq!(drawn(&[]), [3, 4, 5, 6, 7]);
    }
}
