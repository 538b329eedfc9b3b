//! The model that was baked and its container in; the error of the levels of detail, ours and meshoptimizer's, out.
//!
//! Every source part goes its own way, in parallel: `source` welds its mesh as the bake did and finds its cells in
//! the container; [`states`] picks the state of every cell for a share of the triangles; meshoptimizer's `simplify`
//! brings the welded mesh to the same count; [`measure`](crate::measure) compares both with the welded mesh in part
//! space. [`Comparison`] pools the parts, and [`plot`] draws them.

pub mod plot;
mod report;
mod source;
pub mod states;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use crate::container::{Container, ContainerError};
use crate::geometry::OrderedPart;
use crate::geometry::weld::WeldedMesh;
use crate::import::Model;
use crate::measure::{Sampling, Surface, SurfaceError, surface_error};

pub use report::{Comparison, Figures, PartRow, RatioRow};
use source::Source;

/// Why there is nothing to show.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// The container is damaged.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// The container was made of another model, or by another version of the bake.
    #[error("the model is not the one that the container was baked of ({difference}); bake it again")]
    Mismatch {
        /// The first difference.
        difference: String,
    },
    /// Every part was to be left out.
    #[error("no part has {least_triangles} triangles; ask for fewer")]
    NothingToCompare {
        /// How many a part had to have.
        least_triangles: u64,
    },
    /// The user asked to stop.
    #[error("interrupted; nothing was compared")]
    Interrupted,
}

/// What to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareOptions {
    /// Shares of each part's triangles, above 0 and at most 1.
    pub ratios: Vec<f64>,
    /// Points on the surfaces of all parts together, for each measurement; small parts get [`LEAST_SAMPLES`].
    pub samples: usize,
    /// Parts of fewer triangles are left out.
    pub least_triangles: u64,
    /// Whether to run meshoptimizer.
    pub meshoptimizer: bool,
}

/// The fewest points on a part, however small.
pub const LEAST_SAMPLES: usize = 500;

/// The seed of all samples.
const SEED: u64 = 1;

/// What meshoptimizer calls infinite; its square is still a number.
const NO_LIMIT: f32 = 1e9;

/// How far a comparison has come, readable from another thread.
#[derive(Debug, Default)]
pub struct CompareProgress {
    /// Triangles to be simplified and measured, each once for every ratio; 0 until the parts are known.
    pub triangles_total: AtomicU64,
    /// Those that have been.
    pub triangles_done: AtomicU64,
    /// Set by the user's side to stop.
    pub cancelled: AtomicBool,
}

impl CompareProgress {
    fn stopped(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn check(&self) -> Result<(), CompareError> {
        if self.stopped() { Err(CompareError::Interrupted) } else { Ok(()) }
    }
}

/// One part at one ratio.
#[derive(Debug, Clone, Default, PartialEq)]
struct Measured {
    ours: Level,
    meshoptimizer: Option<Level>,
    /// What the container says of the states, in part units; `None` where it says nothing.
    stated: Option<f64>,
}

/// A simplified part: its triangles, and how far it is from the original in part units; `None` if nothing is left.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Level {
    triangles: u64,
    error: Option<SurfaceError>,
}

/// One part at all ratios.
#[derive(Debug, Clone, Default, PartialEq)]
struct PartOutcome {
    number: u32,
    name: String,
    cells: u64,
    triangles: u64,
    /// In part units, squared.
    area: f64,
    /// Of the box, in part units.
    diagonal: f64,
    at: Vec<Measured>,
}

/// Compares the levels of detail of a container with the model that it was baked of.
///
/// # Errors
/// A container that is damaged or was made of something else, and an interruption.
pub fn compare(
    model: &Model,
    bytes: &[u8],
    options: &CompareOptions,
    progress: &CompareProgress,
) -> Result<Comparison, CompareError> {
    let container = Container::open(bytes)?;
    let mut sources = source::matched(model, &container)?;
    sources.retain(|source| source.triangles >= options.least_triangles);
    if sources.is_empty() {
        return Err(CompareError::NothingToCompare { least_triangles: options.least_triangles });
    }
    let triangles: u64 = sources.iter().map(|source| source.triangles).sum();
    let ratios = options.ratios.len() as u64;
    progress.triangles_total.store(triangles * ratios, Ordering::Relaxed);
    let total_area: f64 = sources.iter().map(|source| source.area).sum();
    let outcomes = in_parallel(
        &sources,
        |source, parallel| {
            // Not a number only if no part has an area; the cast makes it 0.
            let samples = (options.samples as f64 * (source.area / total_area)).ceil() as usize;
            let sampling = Sampling { samples: samples.max(LEAST_SAMPLES), seed: SEED, parallel };
            compare_part(&container, source, sampling, options, progress)
        },
        progress,
    )?;
    Ok(Comparison::pooled(&options.ratios, &outcomes))
}

/// Does something for every source, largest first; those too large to leave to one thread come one by one, and are
/// told that they may use all of them.
fn in_parallel<T: Send>(
    sources: &[Source],
    work: impl Fn(&Source, bool) -> Result<T, CompareError> + Sync,
    progress: &CompareProgress,
) -> Result<Vec<T>, CompareError> {
    let mut largest_first: Vec<usize> = (0..sources.len()).collect();
    largest_first.sort_by_key(|&number| (std::cmp::Reverse(sources[number].triangles), number));
    let total: u64 = sources.iter().map(|source| source.triangles).sum();
    let share = total / rayon::current_num_threads() as u64;
    let giants = largest_first.iter().filter(|&&number| sources[number].triangles > share).count();
    let run = |&number: &usize, parallel: bool| {
        progress.check()?;
        Ok((number, work(&sources[number], parallel)?))
    };
    let (alone, together) = largest_first.split_at(giants);
    let mut done: Vec<(usize, T)> =
        alone.iter().map(|n| run(n, true)).collect::<Result<_, CompareError>>()?;
    let rest: Result<Vec<(usize, T)>, CompareError> =
        together.par_iter().with_max_len(1).map(|n| run(n, false)).collect();
    done.extend(rest?);
    done.sort_by_key(|&(number, _)| number);
    Ok(done.into_iter().map(|(_, outcome)| outcome).collect())
}

fn compare_part(
    container: &Container<'_>,
    source: &Source,
    sampling: Sampling,
    options: &CompareOptions,
    progress: &CompareProgress,
) -> Result<PartOutcome, CompareError> {
    let cells = source.cells.clone().map(|number| container.read_part(number));
    let cells = cells.collect::<Result<Vec<OrderedPart>, ContainerError>>()?;
    let welded = source.weld()?;
    let original = surface_of(&welded, &welded_corners(&welded));
    // Distances are measured in steps of the grid, where nothing overflows and nothing cancels.
    let step = source.grid.step();
    let stopped = || progress.stopped();
    let measure = |level: Surface, triangles: u64| Level {
        triangles,
        error: surface_error(&original, &level, sampling, &stopped).map(|error| error.scaled(step)),
    };
    let mut at = Vec::with_capacity(options.ratios.len());
    for &ratio in &options.ratios {
        let counts = states::nearest(&cells, ratio);
        let (positions, triangles) = reformed(&cells, &counts);
        let ours = measure(Surface::new(&positions, &triangles), triangles.len() as u64);
        progress.check()?;
        let meshoptimizer = options.meshoptimizer.then(|| {
            let simplified = simplified(&welded, triangles.len());
            measure(surface_of(&welded, &simplified), simplified.len() as u64)
        });
        progress.check()?;
        let stated = states::stated_error(&cells, &counts);
        at.push(Measured { ours, meshoptimizer, stated });
        progress.triangles_done.fetch_add(source.triangles, Ordering::Relaxed);
    }
    Ok(PartOutcome {
        number: source.number,
        name: source.name.to_owned(),
        cells: cells.len() as u64,
        triangles: source.triangles,
        area: original.area() * step * step,
        diagonal: source.diagonal(),
        at,
    })
}

/// A surface of a welded mesh's positions, in steps of the grid.
fn surface_of(welded: &WeldedMesh, triangles: &[[u32; 3]]) -> Surface {
    let positions: Vec<DVec3> = welded.positions.iter().map(|&grid| on_grid(grid)).collect();
    Surface::new(&positions, triangles)
}

fn on_grid(grid: [u32; 3]) -> DVec3 {
    DVec3::from_array(grid.map(f64::from))
}

/// Triangles by positions instead of wedges.
fn welded_corners(welded: &WeldedMesh) -> Vec<[u32; 3]> {
    welded.triangles.iter().map(|&triangle| welded.corner_positions(triangle)).collect()
}

/// All cells at the given states as one mesh, in steps of their common grid.
fn reformed(cells: &[OrderedPart], counts: &[u32]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (cell, &vn) in cells.iter().zip(counts) {
        let base = positions.len() as u32;
        positions.extend(cell.vertices[..vn as usize].iter().map(|vertex| on_grid(vertex.grid())));
        triangles.extend(cell.reformed(vn).iter().map(|t| t.map(|vertex| base + u32::from(vertex))));
    }
    (positions, triangles)
}

/// What meshoptimizer makes of a welded mesh: default options, no limit to the error, this many triangles.
///
/// Grid coordinates are below 2^21, so that an `f32` holds them exactly.
pub fn simplified(welded: &WeldedMesh, triangles: usize) -> Vec<[u32; 3]> {
    let positions: Vec<[f32; 3]> = welded.positions.iter().map(|grid| grid.map(|c| c as f32)).collect();
    let corners = welded_corners(welded);
    let options = meshopt::SimplifyOptions::None;
    let indices =
        meshopt::simplify_decoder(corners.as_flattened(), &positions, 3 * triangles, NO_LIMIT, options, None);
    indices.as_chunks().0.to_vec()
}
