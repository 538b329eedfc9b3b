//! Odd meshes, generated: each is ordered, in a time that follows its size, to a state that shows next to nothing.
//!
//! The time of a mesh is compared with that of a plain one of as many triangles, in the same run, so that a slow
//! machine is slow for both.

#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene should fail loudly")]

mod common;

use std::f32::consts::TAU;
use std::time::Instant;

use collapsar::geometry::body::{BodyOutcome, OrderOptions, order_body};
use collapsar::import::SourceMesh;

fn mesh_of(name: &str, positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> SourceMesh {
    SourceMesh {
        name: name.into(),
        normals: vec![[0.0, 0.0, 1.0]; positions.len()],
        positions,
        triangles,
        ..SourceMesh::default()
    }
}

/// A position whose triangles go around it, on a rim that is `height` wide in turn.
fn hub(name: &str, valence: u32, rim: impl Fn(u32) -> [f32; 3]) -> SourceMesh {
    let positions = std::iter::once([0.0; 3]).chain((0..valence).map(rim)).collect();
    mesh_of(name, positions, (0..valence).map(|i| [0, 1 + i, 1 + (i + 1) % valence]).collect())
}

fn wheel(valence: u32) -> SourceMesh {
    hub("wheel", valence, |i| {
        let angle = i as f32 / valence as f32 * TAU;
        [angle.cos(), angle.sin(), 0.2 * (i % 2) as f32]
    })
}

/// Triangles with an apex far away whose bases are 1e-12 long before the grid rounds them.
fn slivers(count: u32) -> SourceMesh {
    hub("slivers", count, |i| [1.0, i as f32 * 1e-12, (i % 7) as f32 * 1e-12])
}

fn copies(count: u32) -> SourceMesh {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let positions = (0..count).flat_map(|_| corners).collect();
    mesh_of("copies", positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// A band with half a twist, of `count` quads.
fn moebius(count: u32) -> SourceMesh {
    let point = |i: u32, side: f32| {
        let angle = i as f32 / count as f32 * TAU;
        let (twist, half) = (angle / 2.0, 0.3 * side);
        let radius = 1.0 + half * twist.cos();
        [radius * angle.cos(), radius * angle.sin(), half * twist.sin()]
    };
    let positions = (0..count).flat_map(|i| [point(i, -1.0), point(i, 1.0)]).collect();
    // The last quad meets the first the wrong way round.
    let next = |i: u32| if i + 1 < count { [2 * i + 2, 2 * i + 3] } else { [1, 0] };
    let quad = |i: u32| {
        let [c, d] = next(i);
        [[2 * i, c, 2 * i + 1], [2 * i + 1, c, d]]
    };
    mesh_of("moebius", positions, (0..count).flat_map(quad).collect())
}

fn crumbs(count: u32) -> SourceMesh {
    let side = count.isqrt() + 1;
    let positions = (0..count).flat_map(|i| {
        let (x, y) = ((i % side) as f32, (i / side) as f32);
        [[x, y, 0.0], [x + 0.5, y, 0.0], [x, y + 0.5, 0.2]]
    });
    mesh_of("crumbs", positions.collect(), (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// A surface whose coordinates are 1e-30, beside one whose are 1e30.
fn extremes(n: u32) -> SourceMesh {
    joined("extremes", [scaled(common::height_field(n), 1e-30), scaled(common::height_field(n), 1e30)])
}

fn scaled(mut mesh: SourceMesh, factor: f32) -> SourceMesh {
    mesh.positions.iter_mut().flatten().for_each(|c| *c *= factor);
    mesh
}

fn moved(mut mesh: SourceMesh, by: [f32; 3]) -> SourceMesh {
    mesh.positions.iter_mut().for_each(|p| (0..3).for_each(|axis| p[axis] += by[axis]));
    mesh
}

fn turned_over(mut mesh: SourceMesh) -> SourceMesh {
    mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    mesh
}

fn joined(name: &str, meshes: impl IntoIterator<Item = SourceMesh>) -> SourceMesh {
    let mut all = SourceMesh { name: name.into(), ..SourceMesh::default() };
    for mesh in meshes {
        let base = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.normals.extend(mesh.normals);
        all.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + base)));
    }
    all
}

/// Two sheets of which the second has twice the columns, so that every other of its vertices lies on an edge of the
/// first.
fn t_junctions(n: u32) -> SourceMesh {
    let mut fine = common::height_field(2 * n);
    fine.positions.iter_mut().for_each(|p| *p = [p[0] + 1.0, p[1], 0.0]);
    let mut coarse = common::height_field(n);
    coarse.positions.iter_mut().for_each(|p| p[2] = 0.0);
    joined("t-junctions", [coarse, fine])
}

/// Sheets that pass through each other, lie on each other, and face the other way.
fn crossing(n: u32) -> SourceMesh {
    let upright = |mut mesh: SourceMesh| {
        mesh.positions.iter_mut().for_each(|p| p.swap(1, 2));
        moved(mesh, [0.0, 0.5, -0.5])
    };
    let sheet = || common::height_field(n);
    joined("crossing", [sheet(), turned_over(sheet()), upright(sheet()), turned_over(upright(sheet()))])
}

/// Patches with a gap between them.
fn gaps(n: u32, gap: f32) -> SourceMesh {
    let patch = |i: u32| moved(common::height_field(n), [i as f32 * (1.0 + gap), 0.0, 0.0]);
    let mut mesh = joined("gaps", (0..4).map(patch));
    mesh.positions.iter_mut().for_each(|p| p[2] = 0.0);
    mesh
}

fn order(mesh: SourceMesh) -> BodyOutcome {
    order_body(vec![mesh], OrderOptions::default(), &())
}

fn coarsest(outcome: &BodyOutcome) -> u32 {
    let roots = outcome.cells.iter().filter(|cell| cell.place.parent_distance == 0);
    roots.map(|root| root.coarsest_triangles()).sum()
}

fn seconds(mesh: SourceMesh) -> (f64, BodyOutcome) {
    let started = Instant::now();
    let outcome = order(mesh);
    (started.elapsed().as_secs_f64(), outcome)
}

/// The odd meshes of about `count` triangles.
fn odd_meshes(count: u32) -> Vec<SourceMesh> {
    let side = (count / 2).isqrt();
    vec![
        wheel(count),
        slivers(count),
        copies(count),
        moebius(count / 2),
        crumbs(count),
        extremes((count / 4).isqrt()),
        t_junctions((count / 10).isqrt()),
        crossing((count / 8).isqrt()),
        gaps((count / 8).isqrt(), 1e-3),
        turned_over(common::height_field(side)),
    ]
}

/// Nothing takes more than three times what a plain surface of the same size does, give or take half a second.
#[test]
fn odd_meshes_take_no_longer_than_plain_ones() {
    const COUNT: u32 = 60_000;
    let plain = seconds(common::height_field((COUNT / 2).isqrt())).0;
    for mesh in odd_meshes(COUNT) {
        let (name, triangles) = (mesh.name.clone(), mesh.triangles.len());
        let (taken, outcome) = seconds(mesh);
        println!("{name}: {taken:.2} s, plain {plain:.2} s; {} of {triangles} stay", coarsest(&outcome));
        assert!(taken <= 3.0 * plain + 0.5, "{name}: {taken:.2} s, a plain surface {plain:.2} s");
    }
}

#[test]
fn odd_meshes_reach_a_handful_of_triangles() {
    for mesh in odd_meshes(6_000) {
        let (name, triangles) = (mesh.name.clone(), mesh.triangles.len());
        let outcome = order(mesh);
        let left = coarsest(&outcome);
        // All of the slivers' bases are one grid point, so that nothing has an area.
        assert_eq!(outcome.cells.is_empty(), name == "slivers", "{name}");
        assert!(left <= 8, "{name}: {left} of {triangles} triangles are left");
    }
}

#[test]
fn copies_of_a_triangle_are_one() {
    let outcome = order(copies(20_000));
    assert_eq!((outcome.welds[0].duplicate, outcome.cells[0].triangle_count()), (19_999, 1));
}

#[test]
fn gaps_close_within_the_tolerance_and_stay_beyond_it() {
    let open = |weld_tolerance| {
        let options = OrderOptions { weld_tolerance: Some(weld_tolerance), ..OrderOptions::default() };
        order_body(vec![gaps(20, 1e-3)], options, &()).welds[0].edges.open_positions
    };
    // Four squares of 80 open edges each; a strip of four has 2 * 20 + 8 * 20.
    assert_eq!([open(0.0), open(0.5e-3), open(2e-3)], [320, 320, 200]);
}

/// A Moebius strip has one boundary and one side, and keeps them as long as it is seen.
#[test]
fn a_moebius_strip_keeps_its_one_boundary() {
    let outcome = order(moebius(2_000));
    assert_eq!((outcome.welds[0].edges.open_positions, outcome.cells.len()), (4_000, 1));
    let part = &outcome.cells[0];
    let state = part.triangles_at.state_at_most(part.vertices.len() / 10) as u32;
    let mut edges = std::collections::BTreeMap::<[u16; 2], u32>::new();
    for [a, b, c] in part.reformed(state) {
        [[a, b], [b, c], [c, a]]
            .iter()
            .for_each(|&[a, b]| *edges.entry([a.min(b), a.max(b)]).or_default() += 1);
    }
    let mut after = std::collections::BTreeMap::<u16, Vec<u16>>::new();
    for [a, b] in edges.iter().filter(|&(_, &faces)| faces == 1).map(|(&edge, _)| edge) {
        after.entry(a).or_default().push(b);
        after.entry(b).or_default().push(a);
    }
    assert!(edges.values().all(|&faces| faces <= 2) && after.values().all(|ends| ends.len() == 2));
    let start = *after.keys().next().unwrap();
    let (mut from, mut at, mut length) = (start, after[&start][0], 1);
    while at != start {
        (from, at) = (at, if after[&at][0] == from { after[&at][1] } else { after[&at][0] });
        length += 1;
    }
    assert_eq!(length, after.len(), "the boundary is in several loops");
}
