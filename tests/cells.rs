//! Cells and parent cells: any choice of one cell on every path from root to leaf, at any levels, meets without cracks,
//! and is drawn the same in all ways.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its scene should fail loudly"
)]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::Mutex;

use collapsar::bake::merged;
use collapsar::geometry::body::{OrderOptions, order_body};
use collapsar::geometry::cell_tree::{Joining, Watch, drawn_cells, order_cells, sums_below};
use collapsar::geometry::cells::cut_to;
use collapsar::geometry::record::{Attributes, CellPlace};
use collapsar::geometry::weld::{WeldedMesh, grid_of, weld};
use collapsar::geometry::{Boundary, OrderedPart};
use collapsar::import::SourceMesh;
use collapsar::scene::Scene;
use collapsar::select::StateChooser;
use collapsar::stream::residency::{ResidencyOptions, Wanted};
use collapsar::stream::{Residency, State};

type Edge = [[u32; 3]; 2];

/// A number below `end` that looks random.
fn below(seed: u64, end: u64) -> u64 {
    let mut x = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ x >> 31) % end
}

fn edges_of(triangles: impl Iterator<Item = [[u32; 3]; 3]>) -> BTreeMap<Edge, usize> {
    let mut edges = BTreeMap::new();
    for [a, b, c] in triangles.filter(|[a, b, c]| a != b && b != c && c != a) {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *edges.entry([from.min(to), from.max(to)]).or_insert(0) += 1;
        }
    }
    edges
}

fn edges_of_state(cell: &OrderedPart, vn: u32) -> BTreeMap<Edge, usize> {
    let triangles = cell.reformed(vn).into_iter();
    edges_of(triangles.map(|t| t.map(|vertex| cell.vertices[usize::from(vertex)].grid())))
}

fn open_edges(edges: &BTreeMap<Edge, usize>) -> BTreeSet<Edge> {
    edges.iter().filter(|&(_, &faces)| faces == 1).map(|(&edge, _)| edge).collect()
}

/// The positions that several leaf cells have.
fn border(cells: &[OrderedPart]) -> BTreeSet<[u32; 3]> {
    let mut owners: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for cell in cells.iter().filter(|cell| cell.place.leaf_cells == 0) {
        for position in cell.vertices.iter().map(|vertex| vertex.grid()).collect::<BTreeSet<_>>() {
            *owners.entry(position).or_default() += 1;
        }
    }
    owners.into_iter().filter(|&(_, owners)| owners > 1).map(|(position, _)| position).collect()
}

/// Twenty random choices of cells and states: the open edges between border positions are those of the input.
fn mixes_meet(cells: &[OrderedPart], input: &WeldedMesh) {
    let places: Vec<CellPlace> = cells.iter().map(|cell| cell.place).collect();
    let border = border(cells);
    let whole = edges_of(
        input.triangles.iter().map(|&t| input.corner_positions(t).map(|p| input.positions[p as usize])),
    );
    let open_positions: BTreeSet<[u32; 3]> = open_edges(&whole).into_iter().flatten().collect();
    let mut refined = BTreeSet::new();
    for mix in 0..20u64 {
        let chance = |i: usize, salt: u64| below(mix << 40 | salt << 32 | i as u64, 100);
        let drawn = drawn_cells(&places, |i| chance(i, 0) < 5 * mix);
        let mut edges: BTreeMap<Edge, usize> = BTreeMap::new();
        for (i, cell) in cells.iter().enumerate().filter(|&(i, _)| drawn[i]) {
            let (q, m) = (u64::from(cell.locked), cell.vertices.len() as u64);
            let vn = q + below(mix << 40 | 1 << 32 | i as u64, m - q + 1);
            let vn = cell.triangles_at.state_at_most(vn as usize).max(q as usize) as u32;
            for (edge, faces) in edges_of_state(cell, vn) {
                *edges.entry(edge).or_default() += faces;
            }
        }
        refined.insert(drawn.clone());
        // An open boundary may become coarser, and its new edges may run between border positions that lie on it.
        let is_crack = |edge: &Edge| {
            edge.iter().all(|end| border.contains(end))
                && !edge.iter().all(|end| open_positions.contains(end))
        };
        let open = open_edges(&edges);
        let cracks: Vec<&Edge> = open.iter().filter(|edge| is_crack(edge)).collect();
        assert!(
            cracks.is_empty(),
            "mix {mix}: {} open edges on borders, first {:?}",
            cracks.len(),
            cracks[0]
        );
        assert!(!open_positions.is_empty() || open.is_empty(), "mix {mix}: {} open edges", open.len());
    }
    let parents = places.iter().filter(|place| place.leaf_cells > 0).count();
    assert!(refined.len() > parents.min(3), "only {} choices of cells", refined.len());
}

fn cut_into(mesh: &SourceMesh, max_vertices: usize, max_parent: usize) -> (Vec<OrderedPart>, WeldedMesh) {
    let grid = grid_of(mesh).unwrap();
    let welded = weld(mesh, grid);
    let cells = cut_to(welded.clone(), max_vertices, 1 << 20);
    let joining =
        Joining { grid, boundary: Boundary::Slide, locked: &Default::default(), max_vertices: max_parent };
    (order_cells(cells, joining, &()), welded)
}

fn depth(cells: &[OrderedPart]) -> usize {
    let mut depth = vec![0; cells.len()];
    for (i, cell) in cells.iter().enumerate().filter(|(_, cell)| cell.place.parent_distance > 0) {
        depth[i] = depth[i - cell.place.parent_distance as usize] + 1;
    }
    depth.into_iter().max().unwrap()
}

#[test]
fn a_closed_part_in_cells_is_closed_at_any_mix() {
    let (cells, input) = cut_into(&common::sphere(64, 64), 300, 700);
    assert!(depth(&cells) >= 2, "depth {}", depth(&cells));
    mixes_meet(&cells, &input);
}

#[test]
fn an_open_part_in_cells_has_no_cracks_at_any_mix() {
    for mesh in [common::height_field(70), common::patched_box(24)] {
        let (cells, input) = cut_into(&mesh, 300, 900);
        assert!(cells.len() > 8);
        mixes_meet(&cells, &input);
    }
}

#[test]
fn borders_between_cells_set_no_floor() {
    let (cells, _) = cut_into(&common::height_field(100), 500, 1 << 16);
    let leaves: Vec<&OrderedPart> = cells.iter().filter(|cell| cell.place.leaf_cells == 0).collect();
    let floor: u32 = leaves.iter().map(|cell| cell.coarsest_triangles()).sum();
    assert!(leaves.len() >= 20 && floor > 2000, "{floor} triangles in {} cells", leaves.len());
    assert_eq!(cells.iter().filter(|cell| cell.place.parent_distance == 0).count(), 1);
    assert!(cells[0].coarsest_triangles() <= 4, "{} triangles", cells[0].coarsest_triangles());
    // The finest state of a parent is what its children leave, and it is off by what they are.
    assert_eq!(u64::from(cells[0].triangle_count()), u64::from(floor));
    assert!(cells[0].errors[0] > 0);
    let places: Vec<CellPlace> = cells.iter().map(|cell| cell.place).collect();
    let triangles = sums_below(&places, |i| cells[i].triangle_count().into());
    assert_eq!(triangles[0], 2 * 100 * 100);
}

/// A closed surface in two materials: every third ring of triangles is of the second mesh.
fn two_materials() -> Vec<SourceMesh> {
    let whole = common::sphere(48, 48);
    let mut meshes = vec![SourceMesh { triangles: Vec::new(), ..whole.clone() }; 2];
    for (number, &triangle) in whole.triangles.iter().enumerate() {
        meshes[usize::from(number / 96 % 3 == 2)].triangles.push(triangle);
    }
    meshes
}

#[test]
fn meshes_of_one_body_stay_closed_between_each_other() {
    let whole = common::sphere(48, 48);
    let input = weld(&whole, grid_of(&whole).unwrap());
    let coarsest = |cells: &[OrderedPart]| cells.iter().map(OrderedPart::coarsest_triangles).sum::<u32>();
    // Apart, both keep what they share.
    let apart = order_body(two_materials(), OrderOptions::default(), &());
    assert_eq!(apart.mesh_of, [0, 1]);
    assert!(apart.welds.iter().all(|weld| weld.shared > 500));
    mixes_meet(&apart.cells, &input);
    assert!(coarsest(&apart.cells) > 1000, "{}", coarsest(&apart.cells));
    // As one mesh with slots, nothing is shared.
    let one = order_body(vec![merged(two_materials())], OrderOptions::default(), &());
    assert_eq!((one.cells.len(), one.welds[0].shared), (1, 0));
    mixes_meet(&one.cells, &input);
    assert!(coarsest(&one.cells) <= 8, "{}", coarsest(&one.cells));
}

#[test]
fn materials_keep_to_their_triangles_while_the_guards_hold() {
    let one = order_body(vec![merged(two_materials())], OrderOptions::default(), &());
    let part = &one.cells[0];
    assert_eq!(part.attributes, Attributes::Slot);
    let slot = |vertex: u16| Attributes::Slot.tag(part.vertices[usize::from(vertex)].attributes());
    let of_slots = |ratio: f64| {
        let vn = part.triangles_at.state_at_most((part.vertices.len() as f64 * ratio) as usize) as u32;
        let mut areas = [0.0; 2];
        for triangle in part.reformed(vn) {
            assert!(
                triangle.iter().all(|&vertex| slot(vertex) == slot(triangle[0])),
                "a triangle of two materials"
            );
            let [a, b, c] =
                triangle.map(|v| glam::DVec3::from(part.grid.position(part.vertices[usize::from(v)].grid())));
            areas[slot(triangle[0]) as usize] += (b - a).cross(c - a).length();
        }
        areas[1] / (areas[0] + areas[1])
    };
    let whole = of_slots(1.0);
    assert!((0.2..0.5).contains(&whole));
    for ratio in [0.5, 0.3] {
        assert!((of_slots(ratio) - whole).abs() < 0.02, "{} of {whole} at {ratio}", of_slots(ratio));
    }
}

/// A surface of more than 65,536 vertices, baked from a file: two leaf cells or more, and one root.
fn cut_scene() -> Arc<Scene> {
    common::baked_meshes(&[common::height_field(280)])
}

#[test]
fn a_parent_stands_in_for_cells_that_have_not_arrived() {
    let scene = cut_scene();
    let leaves = scene.parts().iter().filter(|part| !part.is_parent()).count();
    assert!(scene.has_parents() && leaves >= 2 && scene.parts()[0].is_root());
    let mut residency = Residency::new(&scene, ResidencyOptions::default());
    let coarsest = |part: u32| scene.tiers(part).len() as u32 - 1;
    let wishes: Vec<u32> =
        scene.parts().iter().map(|part| if part.is_parent() { 0 } else { part.vertices }).collect();
    let choose = |residency: &Residency| {
        let mut states = vec![State::default(); wishes.len()];
        let visible: Vec<u32> = (0..wishes.len() as u32).filter(|&i| wishes[i as usize] > 0).collect();
        let wishes = (&wishes[..], &visible[..]);
        let choice = StateChooser::default().choose(&scene, residency, wishes, false, &mut states);
        (states.iter().map(|state| state.vertices).collect::<Vec<_>>(), choice.misses)
    };
    let want = |part, tier| Wanted { part, tier, weight: 1.0 };
    residency.plan(&[want(0, 0), want(1, coarsest(1))]);
    residency.settle().unwrap();
    let mut parent_only = vec![0; wishes.len()];
    parent_only[0] = scene.parts()[0].vertices;
    // One leaf has arrived, the others have not: all are replaced, and all are still missed.
    assert_eq!(choose(&residency), (parent_only, leaves as u32));
    residency.plan(&(0..wishes.len() as u32).map(|part| want(part, 0)).collect::<Vec<_>>());
    residency.settle().unwrap();
    assert_eq!(choose(&residency), (wishes.clone(), 0));
}

/// Keeps what was said to be done.
#[derive(Default)]
struct Heard(Mutex<Vec<usize>>);

impl Watch for Heard {
    fn stopped(&self) -> bool {
        false
    }

    fn done(&self, triangles: usize) {
        self.0.lock().unwrap().push(triangles);
    }
}

/// Progress comes cell by cell, keeps something for the parents, and reaches exactly all triangles.
#[test]
fn all_triangles_are_said_to_be_done_and_the_last_of_them_after_the_parents() {
    let source = common::height_field(40);
    let grid = grid_of(&source).unwrap();
    let mesh = weld(&source, grid);
    let triangles = mesh.triangles.len();
    for max_vertices in [300, 1 << 16] {
        let cells = cut_to(mesh.clone(), max_vertices, 1 << 20);
        let leaves = cells.len();
        let heard = Heard::default();
        let joining = Joining { grid, boundary: Boundary::Slide, locked: &Default::default(), max_vertices };
        order_cells(cells, joining, &heard);
        let heard = heard.0.into_inner().unwrap();
        assert_eq!((heard.iter().sum::<usize>(), heard.len()), (triangles, leaves + 1));
        let last = if leaves > 1 { triangles / 5..triangles / 4 + 1 } else { 0..1 };
        assert!(last.contains(heard.last().unwrap()), "{heard:?}");
    }
}

/// Two fans of `sides` triangles about a rim.
fn two_fans(sides: u32) -> SourceMesh {
    let around = |i: u32| {
        let angle = std::f32::consts::TAU * i as f32 / sides as f32;
        [angle.cos(), angle.sin(), 0.0]
    };
    let positions = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]].into_iter().chain((0..sides).map(around)).collect();
    let side = |i: u32| (2 + i, 2 + (i + 1) % sides);
    let triangles = (0..sides).map(side).flat_map(|(a, b)| [[0, a, b], [1, b, a]]).collect();
    SourceMesh { positions, triangles, ..SourceMesh::default() }
}

#[test]
fn fans_are_cut_from_their_middle_to_the_rim_and_not_along_it() {
    let mesh = two_fans(6_000);
    let grid = grid_of(&mesh).unwrap();
    let cells = cut_to(weld(&mesh, grid), 1_000, 1 << 20);
    assert!(cells.len() >= 6, "{} cells", cells.len());
    for cell in &cells {
        let locked = cell.locked.iter().filter(|&&locked| locked).count();
        assert!(locked <= 8, "{locked} of {} positions are locked", cell.locked.len());
    }
}
