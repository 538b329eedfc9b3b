//! The measure of `collapsar compare`: exact where the answer is known, and equal to an independent program elsewhere.
//!
//! The golden figures come from `mesh_error.py`, which looks up closest points in another tree (libigl's, in f64) and
//! draws other random points: 200,000 samples, seed 1. With as many, our figures may differ by sampling noise alone.
//! To make them again: `COLLAPSAR_MEASURE_OUT=DIR cargo test --test measure -- --ignored` writes the meshes as OBJ;
//! then `mesh_error.py A.obj B.obj --backend igl` for each pair; its distances are shares of the diagonal of A.

#![expect(clippy::unwrap_used, reason = "a test's helpers panic to fail it")]

mod common;

use std::fmt::Write;
use std::path::PathBuf;

use collapsar::import::{self, SourceMesh};
use collapsar::measure::{OneWay, Sampling, Surface, SurfaceError, surface_error};
use common::{bundled, height_field, patched_box, sphere};
use glam::DVec3;

const SAMPLES: usize = 200_000;

fn positions(mesh: &SourceMesh) -> Vec<DVec3> {
    mesh.positions.iter().map(|&p| DVec3::from(p.map(f64::from))).collect()
}

fn surface(mesh: &SourceMesh) -> Surface {
    Surface::new(&positions(mesh), &mesh.triangles)
}

fn sampling(parallel: bool) -> Sampling {
    Sampling { samples: SAMPLES, seed: 1, parallel }
}

fn error(reference: &SourceMesh, test: &SourceMesh) -> SurfaceError {
    surface_error(&surface(reference), &surface(test), sampling(true), &|| false).unwrap()
}

fn diagonal(mesh: &SourceMesh) -> f64 {
    let used = mesh.triangles.as_flattened().iter().map(|&vertex| mesh.positions[vertex as usize]);
    let corners: Vec<DVec3> = used.map(|p| DVec3::from(p.map(f64::from))).collect();
    let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    low.distance(high)
}

fn moved(mesh: &SourceMesh, by: [f32; 3]) -> SourceMesh {
    let positions = mesh.positions.iter().map(|p| [0, 1, 2].map(|axis| p[axis] + by[axis]));
    SourceMesh { positions: positions.collect(), ..mesh.clone() }
}

fn scaled(mesh: &SourceMesh, by: f32) -> SourceMesh {
    let positions = mesh.positions.iter().map(|p| p.map(|c| c * by));
    SourceMesh { positions: positions.collect(), ..mesh.clone() }
}

fn square(size: f32, height: f32) -> SourceMesh {
    SourceMesh {
        positions: vec![[0., 0., height], [size, 0., height], [size, 1., height], [0., 1., height]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..SourceMesh::default()
    }
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not within {tolerance} of {expected}");
}

#[test]
fn parallel_planes_are_as_far_apart_as_they_are() {
    let error = error(&square(1.0, 0.0), &square(1.0, 0.25));
    for figure in [error.rms(), error.mean(), error.p99(), error.max()] {
        near(figure, 0.25, 1e-12);
    }
    near(error.normal_degrees(), 0.0, 1e-6);
}

#[test]
fn a_lost_half_shows_one_way() {
    let error = error(&square(2.0, 0.0), &square(1.0, 0.0));
    // Distances on the lost half are uniform in 0..1: mean of the squares 1/6 over the whole, of the distances 1/4.
    // Of 200,000 samples the mean has a deviation of 0.0007, the root of the mean of the squares 0.0008.
    near(error.lost.rms, (1f64 / 6.0).sqrt(), 3e-3);
    near(error.lost.mean, 0.25, 3e-3);
    near(error.lost.p99, 0.98, 3e-3);
    near(error.lost.max, 1.0, 1e-12);
    near(error.invented.max, 0.0, 1e-12);
    assert_eq!((error.rms(), error.max()), (error.lost.rms, error.lost.max));
    let scaled = error.scaled(10.0);
    near(scaled.max(), 10.0, 1e-11);
    near(scaled.rms(), 10.0 * error.rms(), 1e-11);
}

#[test]
fn spheres_differ_by_their_radii() {
    let (inner, outer) = (sphere(96, 192), scaled(&sphere(96, 192), 1.25));
    let error = error(&inner, &outer);
    // The chords of 96 rings lie at most 1 - cos(pi / 192) = 0.00013 below the sphere.
    near(error.rms(), 0.25, 2e-4);
    near(error.mean(), 0.25, 2e-4);
    near(error.max(), 0.25, 4e-4);
    assert!(error.normal_degrees() < 0.2, "{}", error.normal_degrees());
}

#[test]
fn a_surface_that_faces_away_is_turned_by_half() {
    let mut turned = square(1.0, 0.0);
    turned.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    near(error(&square(1.0, 0.0), &turned).normal_degrees(), 180.0, 1e-6);
}

#[test]
fn the_same_figures_from_any_number_of_threads() {
    let (a, b) = (surface(&height_field(40)), surface(&height_field(13)));
    let one = surface_error(&a, &b, sampling(false), &|| false);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| surface_error(&a, &b, sampling(true), &|| false)), one);
    }
}

#[test]
fn nothing_is_measured_without_a_surface_or_after_a_stop() {
    let flat = SourceMesh { triangles: vec![[0, 0, 1], [1, 2, 1]], ..square(1.0, 0.0) };
    let (flat, square) = (surface(&flat), surface(&square(1.0, 0.0)));
    assert_eq!(flat.triangle_count(), 0);
    assert_eq!(surface_error(&square, &flat, sampling(true), &|| false), None);
    assert_eq!(surface_error(&flat, &square, sampling(true), &|| false), None);
    assert_eq!(surface_error(&square, &square, sampling(true), &|| true), None);
}

/// The pairs of the golden figures, by name.
fn pairs() -> Vec<(&'static str, SourceMesh, SourceMesh)> {
    let truck = import::read(&[bundled("peterbilt.obj")]).unwrap();
    let largest = truck.meshes.iter().max_by_key(|mesh| mesh.triangles.len()).unwrap().clone();
    let mut thinned = largest.clone();
    thinned.triangles =
        thinned.triangles.into_iter().enumerate().filter(|(i, _)| i % 7 != 0).map(|(_, t)| t).collect();
    vec![
        ("field", height_field(60), height_field(17)),
        ("sphere", sphere(48, 96), sphere(9, 14)),
        ("box", patched_box(6), moved(&scaled(&patched_box(2), 0.9), [0.2, 0.03, -0.01])),
        ("truck", largest, thinned),
    ]
}

/// What `mesh_error.py` found, in shares of the diagonal, and degrees.
struct Golden {
    name: &'static str,
    lost: ([f64; 4], Option<f64>),
    invented: ([f64; 4], Option<f64>),
}

/// RMS, mean, 99th percentile, maximum; and normal deviation, but for the box: there many closest points lie on an
/// edge of two faces at right angles, and which face a program names is its own affair.
const GOLDEN: [Golden; 4] = [
    Golden {
        name: "field",
        lost: ([0.00133767, 0.00106914, 0.00312809, 0.00371437], Some(5.54786)),
        invented: ([0.00133582, 0.00106773, 0.00313722, 0.00366607], Some(5.56376)),
    },
    Golden {
        name: "sphere",
        lost: ([0.0064157, 0.00592844, 0.0108837, 0.0115134], Some(7.83161)),
        invented: ([0.00641469, 0.00592819, 0.010887, 0.0114585], Some(7.89214)),
    },
    Golden {
        name: "box",
        lost: ([0.0653602, 0.0535583, 0.122831, 0.13784], None),
        invented: ([0.0535979, 0.0435084, 0.11547, 0.11547], None),
    },
    Golden {
        name: "truck",
        lost: ([0.000187481, 5.38994e-05, 0.000911034, 0.00230812], Some(1.9314)),
        invented: ([0.0, 0.0, 0.0, 0.0], Some(0.0)),
    },
];

/// Of 200,000 samples, means have a noise well below 1 %, the 99th percentile, which is the 2,000th from the top,
/// below 2 %. The maximum is one sample, where it is not attained at a vertex: inside a lost triangle of the truck.
const NOISE: [f64; 4] = [0.01, 0.01, 0.02, 0.1];
const NORMAL_NOISE: f64 = 0.01;
/// What rounding makes of 0: a share of the diagonal, and degrees, from a cosine that is 1.
const ROUNDING: f64 = 1e-14;
const NORMAL_ROUNDING: f64 = 1e-3;

fn compared(way: OneWay, (lengths, normal): ([f64; 4], Option<f64>)) {
    for (nth, found) in [way.rms, way.mean, way.p99, way.max].into_iter().enumerate() {
        near(found, lengths[nth], NOISE[nth] * lengths[nth] + ROUNDING);
    }
    if let Some(normal) = normal {
        near(way.normal_degrees, normal, NORMAL_NOISE * normal + NORMAL_ROUNDING);
    }
}

#[test]
fn figures_are_those_of_the_other_program() {
    let pairs = pairs();
    assert_eq!(pairs.len(), GOLDEN.len());
    for ((name, reference, test), golden) in pairs.iter().zip(&GOLDEN) {
        assert_eq!(*name, golden.name);
        let error = error(reference, test).scaled(1.0 / diagonal(reference));
        println!("{name}: {error:?}");
        compared(error.lost, golden.lost);
        compared(error.invented, golden.invented);
    }
}

#[test]
#[ignore = "writes the meshes of the golden figures for the other program"]
fn write_the_pairs() {
    let folder = PathBuf::from(std::env::var_os("COLLAPSAR_MEASURE_OUT").unwrap());
    for (name, reference, test) in pairs() {
        for (mesh, which) in [(reference, "a"), (test, "b")] {
            let mut text = String::new();
            mesh.positions.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
            let lines = mesh.triangles.iter().map(|t| t.map(|vertex| vertex + 1));
            lines.for_each(|[a, b, c]| writeln!(text, "f {a} {b} {c}").unwrap());
            std::fs::write(folder.join(format!("{name}_{which}.obj")), text).unwrap();
        }
    }
}
