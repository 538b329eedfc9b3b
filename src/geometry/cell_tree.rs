//! The cells of a mesh in, all of them ordered out, with parent cells above them.
//!
//! Cells keep the positions that they share, so that they meet without cracks at any mix of levels; alone, these
//! borders would set a floor to how coarse a large part can become, and spoil what is near it. So neighbouring cells
//! are joined, each at a state of about the same cost, into a *parent cell*, in which the borders between them are
//! ordinary edges, and which is ordered like any other; only what it shares with cells outside stays locked. The children
//! end at the states that were joined. Parents have parents, up to one root where that is possible. Of a path from a root
//! to a leaf cell exactly one cell is drawn, and any such choice meets without cracks: a shared position is free only
//! where all cells that have it lie below one parent.

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::cells::Cell;
use super::collapse::{Boundary, collapse_order};
use super::order::{OrderedMesh, arrange};
use super::part::{coarsest_share_is_high, diagonal, error_samples};
use super::record::{Attributes, CellPlace, Grid, MAX_PART_TRIANGLES, OrderedPart, Stall, VertexRecord};
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

/// How the cells of a mesh are ordered and joined.
#[derive(Debug, Clone, Copy)]
pub struct Joining<'a> {
    /// The grid of all of them.
    pub grid: Grid,
    /// What may happen to open boundaries.
    pub boundary: Boundary,
    /// Positions that stay locked, whatever is joined: other meshes have them too.
    pub locked: &'a FxHashSet<[u32; 3]>,
    /// The most vertices of a parent.
    pub max_vertices: usize,
}

/// A parent starts with about this share of the vertices of its children that are not locked.
const LARGEST_SHARE: f64 = 0.25;
/// No more children than that a parent can start with this share of their vertices.
const LEAST_SHARE: f64 = 1.0 / 16.0;

/// No guard stops a part that has come down to so many triangles: fewer would be nothing, or one side of a sheet.
const LEAST_TRIANGLES: u32 = 2;

/// One in so many of a mesh's triangles counts as done only when the parents are, which takes about as long.
const PARENTS_SHARE: usize = 4;

/// An ordered cell, while its parent is looked for.
struct Node {
    ordered: OrderedMesh,
    attributes: Attributes,
    /// The diagonal of its box, in grid steps.
    diagonal: f64,
    /// What its finest state is off by already, in grid steps.
    error: f32,
    cause: Stall,
    parent: Option<usize>,
    leaf_cells: u32,
    /// The positions that a leaf cell below it shares with others, sorted and packed as in vertex records; also those
    /// that its own states have lost.
    shared: Vec<u64>,
}

/// Orders the cells of a mesh in parallel and puts parent cells above them.
///
/// Roots come first, and every parent before its children; [`OrderedPart::place`] says which is which. A watch that
/// stops it makes the result incomplete.
pub fn order_cells(cells: Vec<Cell>, joining: Joining<'_>, watch: &dyn Watch) -> Vec<OrderedPart> {
    let triangles = |cell: &Cell| cell.mesh.triangles.len();
    let is_cut = cells.len() > 1;
    let for_parents = |cell: &Cell| if is_cut { triangles(cell) / PARENTS_SHARE } else { 0 };
    let left_for_parents: usize = cells.iter().map(for_parents).sum();
    let leaf = |cell: Cell| {
        let cell = with_locked(cell, joining.locked);
        let node = order_cell(&cell, joining, 0.0);
        watch.done(triangles(&cell) - for_parents(&cell));
        node
    };
    let mut nodes: Vec<Node> =
        cells.into_par_iter().with_max_len(1).filter(|_| !watch.stopped()).map(leaf).collect();
    let mut roots: Vec<usize> = (0..nodes.len()).collect();
    while roots.len() > 1 && !watch.stopped() {
        let groups = neighbours_that_fit(&nodes, &roots, joining.max_vertices);
        if groups.len() == roots.len() {
            break;
        }
        roots = join_groups(&mut nodes, &groups, joining);
    }
    watch.done(left_for_parents);
    parents_first(nodes, joining.grid)
}

fn with_locked(mut cell: Cell, positions: &FxHashSet<[u32; 3]>) -> Cell {
    if !positions.is_empty() {
        for (position, locked) in cell.mesh.positions.iter().zip(&mut cell.locked) {
            *locked |= positions.contains(position);
        }
    }
    cell
}

/// Orders one cell whose finest state is off by `error` grid steps already.
fn order_cell(cell: &Cell, joining: Joining<'_>, error: f32) -> Node {
    let order = collapse_order(&cell.mesh, &cell.locked, joining.boundary);
    Node {
        ordered: arrange(&cell.mesh, &order),
        attributes: cell.mesh.attributes,
        diagonal: diagonal(&cell.mesh),
        error,
        cause: order.stall,
        parent: None,
        leaf_cells: 0,
        shared: shared_positions(cell),
    }
}

/// The locked positions of a cell.
fn shared_positions(cell: &Cell) -> Vec<u64> {
    let locked = cell.mesh.positions.iter().zip(&cell.locked).filter(|&(_, &locked)| locked);
    sorted(locked.map(|(&position, _)| VertexRecord::new(position, 0).packed_position()).collect())
}

fn sorted(mut positions: Vec<u64>) -> Vec<u64> {
    positions.sort_unstable();
    positions.dedup();
    positions
}

/// Cuts the list of roots, in which neighbours in space are mostly neighbours, where more would not fit into one
/// parent or would start it too coarse.
fn neighbours_that_fit(nodes: &[Node], roots: &[usize], max_vertices: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut sums = [0.0; 3];
    let limits = [max_vertices as f64, MAX_PART_TRIANGLES as f64, max_vertices as f64 / LEAST_SHARE];
    for &root in roots {
        let mesh = &nodes[root].ordered;
        let coarsest = mesh.triangles_at.count_at(mesh.locked as usize);
        let own = [f64::from(mesh.locked), f64::from(coarsest), mesh.vertices.len() as f64];
        let with_own: [f64; 3] = std::array::from_fn(|i| sums[i] + own[i]);
        match groups.last_mut() {
            Some(group) if with_own.iter().zip(limits).all(|(&sum, limit)| sum <= limit) => {
                group.push(root);
                sums = with_own;
            }
            _ => {
                groups.push(vec![root]);
                sums = own;
            }
        }
    }
    groups
}

/// Makes a parent of every group of more than one; returns the roots that there are then, in the same order.
fn join_groups(nodes: &mut Vec<Node>, groups: &[Vec<usize>], joining: Joining<'_>) -> Vec<usize> {
    for group in groups.iter().filter(|group| group.len() > 1) {
        end_where_joined(nodes, group, joining.max_vertices);
    }
    let owners = owners(nodes, groups.iter().flatten());
    let parent = |group: &Vec<usize>| {
        let children: Vec<&Node> = group.iter().map(|&node| &nodes[node]).collect();
        let error = children.iter().map(|node| node.coarsest_error()).fold(0.0, f32::max);
        let cell = with_locked(joined(&children, &owners), joining.locked);
        let leaf_cells = children.iter().map(|node| node.leaf_cells.max(1)).sum();
        let shared = sorted(children.iter().flat_map(|node| &node.shared).copied().collect());
        Node { leaf_cells, shared, ..order_cell(&cell, joining, error) }
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

/// Ends some nodes at states of the same cost, as fine as their parent has room for. Not of the same error: that is a
/// maximum, which one bad place decides.
fn end_where_joined(nodes: &mut [Node], group: &[usize], max_vertices: usize) {
    let sum = |count: fn(&OrderedMesh) -> usize| {
        group.iter().map(|&node| count(&nodes[node].ordered)).sum::<usize>()
    };
    let locked = sum(|mesh| mesh.locked as usize);
    let free = sum(|mesh| mesh.vertices.len()) - locked;
    let room = (locked as f64 + free as f64 * LARGEST_SHARE).min(max_vertices as f64) as u64;
    let fits = |cost: f32| {
        let states = || group.iter().map(|&node| (&nodes[node], nodes[node].state_of_cost(cost)));
        let vertices: u64 = states().map(|(_, vn)| u64::from(vn)).sum();
        let triangles: u64 =
            states().map(|(node, vn)| u64::from(node.ordered.triangles_at.count_at(vn as usize))).sum();
        vertices <= room && triangles <= MAX_PART_TRIANGLES as u64
    };
    // Positive floats are ordered as their bits are. If nothing fits, the coarsest states must do.
    let (mut low, mut high) = (0, f32::MAX.to_bits());
    while low < high {
        let middle = low + (high - low) / 2;
        if fits(f32::from_bits(middle)) { high = middle } else { low = middle + 1 }
    }
    for &node in group {
        let vn = nodes[node].state_of_cost(f32::from_bits(low));
        nodes[node].ordered.end_at(vn);
    }
}

impl Node {
    /// The coarsest state that no step of a higher cost led to.
    fn state_of_cost(&self, cost: f32) -> u32 {
        let states = &self.ordered.state_costs;
        let after = states.partition_point(|&(_, own)| own <= cost);
        states[after.saturating_sub(1)].0
    }

    fn coarsest_error(&self) -> f32 {
        self.error + self.ordered.error_at(self.ordered.locked)
    }

    fn coarsest_vertices(&self) -> &[VertexRecord] {
        &self.ordered.vertices[..self.ordered.locked as usize]
    }

    fn into_part(self, grid: Grid) -> OrderedPart {
        OrderedPart {
            grid,
            attributes: self.attributes,
            // The cut has seen to it that indices fit 16 bits.
            ecol: self.ordered.ecol.iter().map(|&target| target as u16).collect(),
            tiers: tiers::cut(&self.ordered),
            locked: self.ordered.locked,
            errors: error_samples(&self.ordered, self.diagonal, self.error),
            stall: Stall::None,
            triangles_at: self.ordered.triangles_at,
            vertices: self.ordered.vertices,
            place: CellPlace { parent_distance: 0, leaf_cells: self.leaf_cells },
            closure: Default::default(),
        }
    }
}

/// How many of some nodes share each position with others, in any state of any cell below them.
fn owners<'a>(nodes: &[Node], of: impl Iterator<Item = &'a usize>) -> FxHashMap<u64, u32> {
    let mut owners = FxHashMap::default();
    for &node in of {
        for &position in &nodes[node].shared {
            *owners.entry(position).or_insert(0) += 1;
        }
    }
    owners
}

/// The coarsest states of some cells as one mesh, locked where cells outside share a position.
fn joined(children: &[&Node], owners: &FxHashMap<u64, u32>) -> Cell {
    let key = |record: &VertexRecord| (morton(record.grid()), record.attributes());
    let mut records: Vec<VertexRecord> =
        children.iter().flat_map(|node| node.coarsest_vertices()).copied().collect();
    records.sort_unstable_by_key(key);
    records.dedup();
    let mut mesh = WeldedMesh { attributes: children[0].attributes, ..WeldedMesh::default() };
    let mut inside = FxHashMap::default();
    for node in children {
        let vertices = node.coarsest_vertices();
        let wedge = |vertex: u32| {
            let own = key(&vertices[vertex as usize]);
            records.partition_point(|other| key(other) < own) as u32
        };
        let triangles = node.ordered.reformed(node.ordered.locked);
        mesh.triangles.extend(triangles.into_iter().map(|triangle| triangle.map(wedge)));
        for &position in &node.shared {
            *inside.entry(position).or_insert(0) += 1;
        }
    }
    // What follows one another lies together, as in a mesh that was welded: searches for what is near count on it.
    mesh.triangles.sort_by_key(|triangle| triangle.iter().copied().min());
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
fn parents_first(nodes: Vec<Node>, grid: Grid) -> Vec<OrderedPart> {
    let causes: Vec<Option<Stall>> =
        nodes.iter().rev().map(|node| node.parent.is_none().then_some(node.cause)).collect();
    let finish = |(number, node): (usize, Node)| {
        let distance = node.parent.map_or(0, |parent| (parent - number) as u32);
        let mut part = node.into_part(grid);
        part.place.parent_distance = distance;
        part
    };
    let mut parts: Vec<OrderedPart> = nodes.into_par_iter().with_max_len(1).enumerate().map(finish).collect();
    parts.reverse();
    name_stalls(&mut parts, &causes);
    parts
}

/// Roots that keep more than a tenth of the triangles that they stand for always have a cause.
fn name_stalls(parts: &mut [OrderedPart], causes: &[Option<Stall>]) {
    let places: Vec<CellPlace> = parts.iter().map(|part| part.place).collect();
    let triangles = sums_below(&places, |i| parts[i].triangle_count().into());
    for (i, part) in parts.iter_mut().enumerate() {
        let Some(cause) = causes[i] else { continue };
        if coarsest_share_is_high(part.coarsest_triangles(), triangles[i]) {
            let is_least = cause == Stall::None || part.coarsest_triangles() <= LEAST_TRIANGLES;
            part.stall = if is_least { Stall::Least } else { cause };
        }
    }
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
