//! How many triangles per second and core does the complete collapse order take, and how does that compare with what
//! meshoptimizer takes for one level of detail?
//!
//! Imports each model, then takes all its parts one after another on one thread, several times: welds each, orders it
//! completely, and lets meshoptimizer's `simplify` bring the same welded mesh to a tenth of its triangles. The two
//! alternate, so that a machine that slows down slows both. Nothing is written. Models: the bundled ones, and those
//! named as arguments: `cargo bench --bench bake -- model.glb other.obj`.
//!
//! Printed: triangles per second of weld and order together (least, median, most of the runs); then the median
//! seconds for the order alone, for `simplify` alone, and the median quotient of the two.
//!
//! The expected answer is checked: the median rate may not be below [`LEAST_RATE`], which a debug build would be.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot read its input should stop")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use collapsar::geometry::body::{self, OrderOptions};
use collapsar::geometry::cell_tree::{Joining, order_cells};
use collapsar::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use collapsar::geometry::record::MAX_PART_VERTICES;
use collapsar::geometry::weld::{WeldedMesh, grid_of};
use collapsar::geometry::{Boundary, Grid, cells};
use collapsar::import::{self, SourceMesh};

/// Triangles per second and core that any machine this is worth running on reaches.
const LEAST_RATE: f64 = 50_000.0;
const RUNS: usize = 5;
/// What meshoptimizer brings the triangles to.
const SHARE: f64 = 0.1;
/// What it calls infinite.
const NO_LIMIT: f32 = 1e9;

/// Seconds of one run over all parts.
#[derive(Clone, Copy, Default)]
struct Seconds {
    weld: f64,
    order: f64,
    simplify: f64,
}

fn main() {
    let named: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets");
    let bundled = ["2CylinderEngine.glb", "peterbilt.obj"].map(|name| folder.join(name));
    let models = if named.is_empty() { bundled.to_vec() } else { named };
    println!(
        "{:<28} {:>11} {:>7} {:>12} {:>12} {:>12} {:>9} {:>11} {:>9}",
        "model",
        "triangles",
        "parts",
        "min tri/s",
        "median tri/s",
        "max tri/s",
        "order s",
        "simplify s",
        "quotient"
    );
    // Cells are ordered on the pool's threads: here on one.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| models.iter().for_each(bench));
}

fn bench(path: &PathBuf) {
    let model = import::read(std::slice::from_ref(path)).unwrap();
    let meshes: Vec<SourceMesh> = model.meshes.into_iter().map(with_normals).collect();
    let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let runs: Vec<Seconds> = (0..RUNS).map(|run| timed(&meshes, run % 2 == 0)).collect();
    let sorted = |figure: &dyn Fn(&Seconds) -> f64| {
        let mut figures: Vec<f64> = runs.iter().map(figure).collect();
        figures.sort_by(f64::total_cmp);
        figures
    };
    let rates = sorted(&|run| triangles as f64 / (run.weld + run.order));
    println!(
        "{:<28} {triangles:>11} {:>7} {:>12.0} {:>12.0} {:>12.0} {:>9.3} {:>11.3} {:>9.2}",
        path.file_name().unwrap_or_default().to_string_lossy(),
        meshes.len(),
        rates[0],
        rates[RUNS / 2],
        rates[RUNS - 1],
        sorted(&|run| run.order)[RUNS / 2],
        sorted(&|run| run.simplify)[RUNS / 2],
        sorted(&|run| run.order / run.simplify)[RUNS / 2],
    );
    assert!(rates[RUNS / 2] > LEAST_RATE, "far slower than expected: is this a release build?");
}

fn with_normals(mut mesh: SourceMesh) -> SourceMesh {
    by_crease_angle(&mut mesh, CREASE_DEGREES);
    mesh
}

/// The clocks of one run; parts are small enough (or cut into cells) that one thread does one after another.
fn timed(meshes: &[SourceMesh], ours_first: bool) -> Seconds {
    let mut seconds = Seconds::default();
    for mesh in meshes {
        let (welded, taken) = clocked(|| welded(mesh));
        seconds.weld += taken;
        let Some((grid, welded)) = welded else { continue };
        for ours in [ours_first, !ours_first] {
            if ours {
                let copy = welded.clone();
                seconds.order += clocked(|| order(copy, grid)).1;
            } else {
                seconds.simplify += seconds_to_simplify(&welded);
            }
        }
    }
    assert!(seconds.order > 0.0, "nothing was ordered");
    seconds
}

fn clocked<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let started = Instant::now();
    let result = black_box(work());
    (result, started.elapsed().as_secs_f64())
}

/// All that the bake does before it cuts and orders a mesh; `None` if nothing is left.
fn welded(mesh: &SourceMesh) -> Option<(Grid, WeldedMesh)> {
    let grid = grid_of(mesh)?;
    let welded = body::welded(mesh, grid, OrderOptions::default()).mesh;
    (!welded.triangles.is_empty()).then_some((grid, welded))
}

fn order(welded: WeldedMesh, grid: Grid) -> usize {
    let joining = Joining {
        grid,
        boundary: Boundary::Slide,
        locked: &Default::default(),
        max_vertices: MAX_PART_VERTICES,
    };
    order_cells(cells::cut(welded), joining, &()).len()
}

fn seconds_to_simplify(welded: &WeldedMesh) -> f64 {
    let positions: Vec<[f32; 3]> = welded.positions.iter().map(|grid| grid.map(|c| c as f32)).collect();
    let corners: Vec<u32> = welded.triangles.iter().flat_map(|&t| welded.corner_positions(t)).collect();
    let wanted = 3 * (welded.triangles.len() as f64 * SHARE) as usize;
    let options = meshopt::SimplifyOptions::None;
    clocked(|| meshopt::simplify_decoder(&corners, &positions, wanted, NO_LIMIT, options, None)).1
}
