//! The model that was baked and its container in; the error of the levels of detail, ours and meshoptimizer's, out.
//!
//! Every source part goes its own way, in parallel: `source` welds its mesh as the bake did and finds its cells in
//! the container; [`states`] picks the state of every cell for a share of the triangles; meshoptimizer's `simplify`
//! brings the welded mesh to the same count; [`measure`](crate::measure) compares both with the welded mesh in part
//! space. Where there are several parts, [`mod@deal`] also deals a share of the placed model's triangles over them.
//! [`Comparison`] pools the parts, and [`plot`] draws them.

pub mod deal;
mod part;
mod placed;
pub mod plot;
mod report;
mod source;
pub mod states;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rayon::prelude::*;

use crate::container::{Container, ContainerError};
use crate::geometry::weld::WeldedMesh;
use crate::import::Model;
use crate::measure::{Sampling, SurfaceError};

use deal::{Curve, deal};
use part::compare_part;
use placed::Placed;
pub use report::{Comparison, Dealing, DealtRow, Figures, PartRow, RatioRow};
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
    /// Triangles to be simplified and measured, each once for every ratio, and once more where they are dealt; 0 until
    /// the parts are known.
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
    /// At the counts of a dealt model, in the order of [`Counts`]; none if nothing was dealt.
    dealt: Vec<Level>,
}

/// What one part gets of the triangles of the model at one ratio.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Counts {
    /// Ours, by cost.
    cost: u64,
    /// meshoptimizer's, by its own error.
    error: Option<u64>,
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
    placed: Placed,
    /// How far a dot in the middle of the box is from the part, which is what nothing counts as in a dealt model.
    dot: Option<SurfaceError>,
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
    let rounds = options.ratios.len() as u64 + u64::from(sources.len() > 1);
    progress.triangles_total.store(triangles * rounds, Ordering::Relaxed);
    let counts = if sources.len() > 1 { dealt(&sources, options, progress)? } else { Vec::new() };
    let total_area: f64 = sources.iter().map(|source| source.area).sum();
    let outcomes = in_parallel(
        &sources,
        |number, parallel| {
            let source = &sources[number];
            // Not a number only if no part has an area; the cast makes it 0.
            let samples = (options.samples as f64 * (source.area / total_area)).ceil() as usize;
            let sampling = Sampling { samples: samples.max(LEAST_SAMPLES), seed: SEED, parallel };
            let counts: Vec<Counts> = counts.iter().map(|parts| parts[number]).collect();
            compare_part(&container, source, sampling, &counts, options, progress)
        },
        progress,
    )?;
    Ok(Comparison::pooled(&options.ratios, &outcomes))
}

/// For every ratio what each part gets of that share of the placed model's triangles.
fn dealt(
    sources: &[Source],
    options: &CompareOptions,
    progress: &CompareProgress,
) -> Result<Vec<Vec<Counts>>, CompareError> {
    let curves_of = |number: usize, _| {
        let source: &Source = &sources[number];
        let (welded, step, placed) = (source.weld()?, source.grid.step(), source.placed);
        // Nothing of the part is farther from the middle of its box.
        let reach = source.diagonal() / 2.0;
        let costs = deal::costs(&welded).scaled(step.powi(4)).to_nothing(source.area * reach * reach);
        let errors = || deal::errors(&welded).scaled(step).to_nothing(reach).scaled(placed.error_scale());
        let (costs, errors) = (costs.scaled(placed.cost_scale()), options.meshoptimizer.then(errors));
        progress.triangles_done.fetch_add(source.triangles, Ordering::Relaxed);
        Ok((costs, errors))
    };
    let (costs, errors): (Vec<Curve>, Vec<Option<Curve>>) =
        in_parallel(sources, curves_of, progress)?.into_iter().unzip();
    let errors: Option<Vec<Curve>> = errors.into_iter().collect();
    let copies: Vec<u64> = sources.iter().map(|source| source.placed.copies).collect();
    let whole: u64 = sources.iter().map(|source| source.placed.copies * source.triangles).sum();
    let at = |&ratio: &f64| {
        let ours = deal(&costs, &copies, (whole as f64 * ratio) as u64);
        // What ours come to within a step.
        let total = ours.iter().zip(&copies).map(|(count, copies)| count * copies).sum();
        let theirs = errors.as_ref().map(|curves| deal(curves, &copies, total));
        let counts = |(part, &cost)| Counts { cost, error: theirs.as_ref().map(|theirs| theirs[part]) };
        ours.iter().enumerate().map(counts).collect()
    };
    Ok(options.ratios.iter().map(at).collect())
}

/// Does something for every source, largest first; those too large to leave to one thread come one by one, and are
/// told that they may use all of them.
fn in_parallel<T: Send>(
    sources: &[Source],
    work: impl Fn(usize, bool) -> Result<T, CompareError> + Sync,
    progress: &CompareProgress,
) -> Result<Vec<T>, CompareError> {
    let mut largest_first: Vec<usize> = (0..sources.len()).collect();
    largest_first.sort_by_key(|&number| (std::cmp::Reverse(sources[number].triangles), number));
    let total: u64 = sources.iter().map(|source| source.triangles).sum();
    let share = total / rayon::current_num_threads() as u64;
    let giants = largest_first.iter().filter(|&&number| sources[number].triangles > share).count();
    let run = |&number: &usize, parallel: bool| {
        progress.check()?;
        Ok((number, work(number, parallel)?))
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

/// Triangles by positions instead of wedges.
fn welded_corners(welded: &WeldedMesh) -> Vec<[u32; 3]> {
    welded.triangles.iter().map(|&triangle| welded.corner_positions(triangle)).collect()
}

/// What meshoptimizer makes of a welded mesh: default options, no limit to the error, this many triangles.
pub fn simplified(welded: &WeldedMesh, triangles: usize) -> Vec<[u32; 3]> {
    simplify(welded, triangles).0
}

/// The same with the error that it returns, in grid steps.
///
/// Grid coordinates are below 2^21, so that an `f32` holds them exactly.
fn simplify(welded: &WeldedMesh, triangles: usize) -> (Vec<[u32; 3]>, f32) {
    let positions: Vec<[f32; 3]> = welded.positions.iter().map(|grid| grid.map(|c| c as f32)).collect();
    let corners = welded_corners(welded);
    let (options, mut error) = (meshopt::SimplifyOptions::ErrorAbsolute, 0.0);
    let (corners, result) = (corners.as_flattened(), Some(&mut error));
    let indices = meshopt::simplify_decoder(corners, &positions, 3 * triangles, NO_LIMIT, options, result);
    (indices.as_chunks().0.to_vec(), error)
}
