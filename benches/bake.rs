//! How many triangles per second and core does the complete collapse order take?
//!
//! Imports each model, then orders all its parts one after another on one thread, several times; prints the median
//! and the spread. Nothing is written. Models: the bundled ones, and those named as arguments:
//! `cargo bench --bench bake -- model.glb other.obj`.
//!
//! The expected answer is checked: the median may not be below [`LEAST_RATE`], which a debug build would be.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot read its input should stop")]

use std::path::PathBuf;
use std::time::Instant;

use collapsar::geometry::Boundary;
use collapsar::geometry::body::order_part;
use collapsar::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use collapsar::import::{self, SourceMesh};

/// Triangles per second and core that any machine this is worth running on reaches.
const LEAST_RATE: f64 = 50_000.0;
const RUNS: usize = 5;

fn main() {
    let named: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets");
    let bundled = ["2CylinderEngine.glb", "peterbilt.obj"].map(|name| folder.join(name));
    let models = if named.is_empty() { bundled.to_vec() } else { named };
    println!(
        "{:<28} {:>11} {:>9} {:>12} {:>12} {:>12}",
        "model", "triangles", "parts", "min tri/s", "median tri/s", "max tri/s"
    );
    for model in models {
        bench(&model);
    }
}

fn bench(path: &PathBuf) {
    let model = import::read(std::slice::from_ref(path)).unwrap();
    let meshes: Vec<SourceMesh> = model.meshes.into_iter().map(with_normals).collect();
    let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let mut rates: Vec<f64> = (0..RUNS).map(|_| triangles as f64 / seconds_to_order(&meshes)).collect();
    rates.sort_by(f64::total_cmp);
    println!(
        "{:<28} {triangles:>11} {:>9} {:>12.0} {:>12.0} {:>12.0}",
        path.file_name().unwrap_or_default().to_string_lossy(),
        meshes.len(),
        rates[0],
        rates[RUNS / 2],
        rates[RUNS - 1]
    );
    assert!(rates[RUNS / 2] > LEAST_RATE, "far slower than expected: is this a release build?");
}

fn with_normals(mut mesh: SourceMesh) -> SourceMesh {
    by_crease_angle(&mut mesh, CREASE_DEGREES);
    mesh
}

/// The clock of one run; parts are small enough (or cut into cells) that one thread does one after another.
fn seconds_to_order(meshes: &[SourceMesh]) -> f64 {
    let started = Instant::now();
    let kept: usize = meshes.iter().map(|mesh| order_part(mesh, Boundary::Slide).cells.len()).sum();
    let seconds = started.elapsed().as_secs_f64();
    assert!(kept > 0, "nothing was ordered");
    seconds
}
