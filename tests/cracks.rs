//! No cracks in real parts: cells meet at any mix of levels, and what is closed stays closed until it vanishes.
//!
//! Of every model the parts are sampled, as each test says; all of it takes about a minute on a core.

#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene should fail loudly")]

mod common;

use collapsar::geometry::body::{OrderOptions, order_body, welded};
use collapsar::geometry::cell_tree::{Joining, drawn_cells, order_cells};
use collapsar::geometry::cells::cut_to;
use collapsar::geometry::record::CellPlace;
use collapsar::geometry::weld::{WeldedMesh, grid_around};
use collapsar::geometry::{Boundary, OrderedPart};
use collapsar::import::SourceMesh;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

/// Positions of a body, each packed into one word, which is the same in all of its cells.
type Edge = [u64; 2];
type Edges = FxHashMap<Edge, u32>;

/// A number below `end` that looks random.
fn below(seed: u64, end: u64) -> u64 {
    let mut x = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ x >> 31) % end
}

/// Counts the triangles on the edges of which both ends are wanted.
fn count(edges: &mut Edges, triangles: impl Iterator<Item = [u64; 3]>, is_wanted: impl Fn(u64) -> bool) {
    for [a, b, c] in triangles.filter(|[a, b, c]| a != b && b != c && c != a) {
        let wanted = [a, b, c].map(&is_wanted);
        for (i, j) in [(0, 1), (1, 2), (2, 0)].into_iter().filter(|&(i, j)| wanted[i] && wanted[j]) {
            let [from, to] = [[a, b, c][i], [a, b, c][j]];
            *edges.entry([from.min(to), from.max(to)]).or_insert(0) += 1;
        }
    }
}

fn edges_of(mesh: &WeldedMesh) -> Edges {
    let mut edges = Edges::default();
    let packed = |wedge: u32| mesh.wedges[wedge as usize].packed_position();
    count(&mut edges, mesh.triangles.iter().map(|t| t.map(packed)), |_| true);
    edges
}

fn triangles_of(part: &OrderedPart, vn: u32) -> impl Iterator<Item = [u64; 3]> {
    let triangles = part.reformed(vn).into_iter();
    triangles.map(|t| t.map(|vertex| part.vertices[usize::from(vertex)].packed_position()))
}

/// The positions that several leaf cells have.
fn border(cells: &[OrderedPart]) -> FxHashSet<u64> {
    let mut owners: FxHashMap<u64, u32> = FxHashMap::default();
    for cell in cells.iter().filter(|cell| cell.place.leaf_cells == 0) {
        let positions: FxHashSet<u64> = cell.vertices.iter().map(|vertex| vertex.packed_position()).collect();
        positions.into_iter().for_each(|position| *owners.entry(position).or_default() += 1);
    }
    owners.into_iter().filter(|&(_, owners)| owners > 1).map(|(position, _)| position).collect()
}

/// A random choice of cells that hides nothing, by number, and a random state of each.
fn mix(cells: &[OrderedPart], number: u64) -> Vec<(usize, u32)> {
    let places: Vec<CellPlace> = cells.iter().map(|cell| cell.place).collect();
    let drawn = drawn_cells(&places, |i| below(number << 40 | i as u64, 100) < 5 * number);
    let state = |(i, cell): (usize, &OrderedPart)| {
        let (least, all) = (u64::from(cell.locked), cell.vertices.len() as u64);
        let vn = least + below(number << 40 | 1 << 32 | i as u64, all - least + 1);
        cell.triangles_at.state_at_most(vn as usize).max(least as usize) as u32
    };
    cells.iter().enumerate().filter(|&(i, _)| drawn[i]).map(|(i, cell)| (i, state((i, cell)))).collect()
}

/// The leaf cells that have each edge, of those that several have.
fn shared_edges(cells: &[OrderedPart]) -> FxHashMap<Edge, Vec<usize>> {
    let mut owners: FxHashMap<Edge, Vec<usize>> = FxHashMap::default();
    for (i, cell) in cells.iter().enumerate().filter(|(_, cell)| cell.place.leaf_cells == 0) {
        let mut own = Edges::default();
        count(&mut own, triangles_of(cell, cell.vertices.len() as u32), |_| true);
        for edge in own.into_keys() {
            owners.entry(edge).or_default().push(i);
        }
    }
    owners.retain(|_, owners| owners.len() > 1);
    owners
}

/// The cell that is drawn in the place of a leaf cell, or that leaf itself.
fn drawn_for(cells: &[OrderedPart], drawn: &[bool], leaf: usize) -> usize {
    let mut cell = leaf;
    while !drawn[cell] {
        cell -= cells[cell].place.parent_distance as usize;
    }
    cell
}

/// In twenty random mixes, the edges between border positions that are open and were not in the input.
fn cracks(cells: &[OrderedPart], input: &[WeldedMesh]) -> usize {
    let mut whole = Edges::default();
    for (edge, faces) in input.iter().flat_map(edges_of) {
        *whole.entry(edge).or_default() += faces;
    }
    let open: FxHashSet<u64> =
        whole.iter().filter(|&(_, &faces)| faces == 1).flat_map(|(&edge, _)| edge).collect();
    let border = border(cells);
    let shared = shared_edges(cells);
    let cracks = (0..20u64).map(|number| {
        let mut edges = Edges::default();
        let mut drawn = vec![false; cells.len()];
        for (i, vn) in mix(cells, number) {
            drawn[i] = true;
            let cell = &cells[i];
            count(&mut edges, triangles_of(cell, vn), |position| border.contains(&position));
        }
        // Others are outlines that have slid, or sheets that have closed, within one of the cells that are drawn.
        let is_border = |edge: &Edge| {
            let of = |leaf: usize| drawn_for(cells, &drawn, leaf);
            shared.get(edge).is_some_and(|leaves| leaves.iter().any(|&leaf| of(leaf) != of(leaves[0])))
        };
        let on_outline = |edge: &Edge| edge.iter().all(|end| open.contains(end));
        let is_crack = |edge: &Edge| {
            is_border(edge) && !on_outline(edge) && whole.get(edge).is_some_and(|&faces| faces % 2 == 0)
        };
        edges.iter().filter(|&(edge, &faces)| faces == 1 && is_crack(edge)).count()
    });
    cracks.sum()
}

/// A body in about a dozen cells, under parents of three times their size, or as it is where that is several meshes
/// already.
fn in_cells(meshes: Vec<SourceMesh>) -> (Vec<OrderedPart>, Vec<WeldedMesh>) {
    let options = OrderOptions::default();
    let grid = grid_around(&meshes).unwrap();
    let input: Vec<WeldedMesh> = meshes.iter().map(|mesh| welded(mesh, grid, options).mesh).collect();
    if meshes.len() > 1 {
        return (order_body(meshes, options, &()).cells, input);
    }
    let most = (input[0].wedges.len() / 10).clamp(100, 1 << 16);
    let joining = Joining {
        grid,
        boundary: Boundary::Slide,
        locked: &Default::default(),
        max_vertices: (3 * most).min(1 << 16),
    };
    (order_cells(cut_to(input[0].clone(), most, 1 << 20), joining, &()), input)
}

fn triangles(meshes: &[SourceMesh]) -> usize {
    meshes.iter().map(|mesh| mesh.triangles.len()).sum()
}

/// The bodies of a file that are sampled: the largest three, and twelve of the others.
fn sampled(file: &std::path::Path) -> Vec<Vec<SourceMesh>> {
    let mut bodies = common::bodies_of(file);
    bodies.retain(|meshes| triangles(meshes) > 0);
    bodies.sort_by_key(|meshes| std::cmp::Reverse(triangles(meshes)));
    let stride = bodies.len().div_ceil(12);
    bodies.into_iter().enumerate().filter(|&(i, _)| i < 3 || i % stride == 0).map(|(_, body)| body).collect()
}

/// Of every model the largest three bodies and twelve of the others, cut into cells however small they are.
#[test]
fn cells_of_real_parts_meet_at_any_mix() {
    let mut wrong = Vec::new();
    for file in common::models() {
        let bodies = sampled(&file);
        let count = bodies.len();
        let found: Vec<[usize; 2]> = bodies
            .into_par_iter()
            .map(|meshes| {
                let (cells, input) = in_cells(meshes);
                [cells.len(), cracks(&cells, &input)]
            })
            .collect();
        let [cells, cracks] = [0, 1].map(|i| found.iter().map(|found| found[i]).sum::<usize>());
        println!("{}: {count} bodies in {cells} cells, {cracks} cracks", file.display());
        if cracks > 0 {
            wrong.push(format!("{}: {cracks}", file.display()));
        }
    }
    assert!(wrong.is_empty(), "open edges on borders:\n{}", wrong.join("\n"));
}

/// Whether every edge has two triangles, or another even number.
fn is_closed(edges: &Edges) -> bool {
    edges.values().all(|faces| faces % 2 == 0)
}

/// Some states of a part: every tenth, or forty where these are more.
fn some_states(part: &OrderedPart) -> Vec<u32> {
    let states: Vec<usize> =
        (part.locked as usize..=part.vertices.len()).filter(|&vn| part.triangles_at.is_state(vn)).collect();
    let stride = if part.triangle_count() < 2000 { 10 } else { states.len().div_ceil(40).max(10) };
    states.into_iter().step_by(stride).map(|vn| vn as u32).collect()
}

/// Whether the part was closed, and the first state in which it no longer is.
fn first_open_state(meshes: Vec<SourceMesh>) -> Option<Option<u32>> {
    let grid = grid_around(&meshes)?;
    let input = welded(&meshes[0], grid, OrderOptions::default()).mesh;
    if meshes.len() > 1 || !is_closed(&edges_of(&input)) {
        return None;
    }
    let cells = order_body(meshes, OrderOptions::default(), &()).cells;
    let [part] = cells.as_slice() else { return None };
    let is_open = |&vn: &u32| {
        let mut edges = Edges::default();
        let triangles = triangles_of(part, vn);
        // One triangle is what stays of a sheet when one of its sides has vanished; it is drawn from both.
        let is_sheet = part.triangles_at.count_at(vn as usize) == 1;
        count(&mut edges, triangles, |_| true);
        !is_sheet && !is_closed(&edges)
    };
    Some(some_states(part).into_iter().rev().find(is_open))
}

/// Of every model the same bodies, those among them that are one closed part; every tenth state, or forty of the larger.
#[test]
fn closed_real_parts_stay_closed_until_they_vanish() {
    let mut closed = 0;
    for file in common::models() {
        let found: Vec<Option<u32>> = sampled(&file).into_par_iter().filter_map(first_open_state).collect();
        println!("{}: {} closed parts", file.display(), found.len());
        closed += found.len();
        let first = found.iter().flatten().next();
        assert!(first.is_none(), "{}: a part is open at {first:?} vertices", file.display());
    }
    assert!(closed >= 3, "only {closed} closed parts");
}
