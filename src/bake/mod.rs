//! Input files in, a container and a [`BakeReport`] out.
//!
//! The way: import -> normals where there are none -> [`order_body`] for every body in parallel, the largest first, and
//! for the cells of large parts, so that no core waits for one at the end -> container. The bytes written do not depend on the number of threads.

mod report;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use crate::container::{self, ContainerError, Contents, StoredInstance, StoredPart};
use crate::geometry::body::{OrderOptions, PartOutcome, order_body};
use crate::geometry::cell_tree::Watch;
use crate::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use crate::import::{self, ImportError, Model, SourceMesh};

pub use report::{BakeReport, StalledPart};

/// Why a bake ended without a container.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The input could not be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// Every triangle of the input is degenerate.
    #[error("none of the {triangles} triangles has an area, so there is nothing to draw: {path}")]
    NothingLeft {
        /// How many triangles were read.
        triangles: usize,
        /// The first input.
        path: PathBuf,
    },
    /// The container could not be written.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// The worker threads could not be started.
    #[error("cannot start {threads} worker threads: {source}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the system said.
        source: rayon::ThreadPoolBuildError,
    },
    /// The user asked to stop.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

/// How to bake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BakeOptions {
    /// How meshes are welded and ordered.
    pub order: OrderOptions,
    /// Where normals are missing, faces that meet at less than this angle are smooth.
    pub crease_degrees: f32,
    /// Worker threads; 0 for one a core.
    pub threads: usize,
}

impl Default for BakeOptions {
    fn default() -> Self {
        Self { order: OrderOptions::default(), crease_degrees: CREASE_DEGREES, threads: 0 }
    }
}

/// How far a bake has come, readable from another thread.
#[derive(Debug, Default)]
pub struct BakeProgress {
    /// Triangles that are to be ordered; 0 until the input has been read.
    pub triangles_total: AtomicU64,
    /// Triangles that have been ordered.
    pub triangles_done: AtomicU64,
    /// Set by the user's side to stop the bake at the next part or cell.
    pub cancelled: AtomicBool,
}

impl Watch for BakeProgress {
    fn stopped(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn done(&self, triangles: usize) {
        self.triangles_done.fetch_add(triangles as u64, Ordering::Relaxed);
    }
}

impl BakeProgress {
    fn check(&self) -> Result<(), BakeError> {
        if self.cancelled.load(Ordering::Relaxed) { Err(BakeError::Interrupted) } else { Ok(()) }
    }
}

/// Bakes input files into one container.
///
/// # Errors
/// Whatever keeps the input from being read or the container from being written; then no file has the output's name
/// that did not have it before.
pub fn bake(
    inputs: &[PathBuf],
    output: &Path,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<BakeReport, BakeError> {
    let started = Instant::now();
    container::check_destination(output)?;
    let mut model = import::read(inputs)?;
    let import_seconds = started.elapsed().as_secs_f64();
    progress.check()?;
    let outcomes = order_all(&mut model, options, progress)?;
    let order_seconds = started.elapsed().as_secs_f64() - import_seconds;
    let mut report = report::counted(&model, &outcomes);
    let contents = assemble(model, outcomes);
    if contents.parts.is_empty() {
        let path = inputs.first().cloned().unwrap_or_default();
        return Err(BakeError::NothingLeft { triangles: report.source_triangles as usize, path });
    }
    let written = match container::write(output, &contents, &progress.cancelled) {
        Err(ContainerError::Interrupted) => return Err(BakeError::Interrupted),
        other => other?,
    };
    report.finish(&contents, &written, [import_seconds, order_seconds, started.elapsed().as_secs_f64()]);
    Ok(report)
}

/// The meshes of one body, taken out of the model, with their numbers there.
type Body = Vec<(usize, SourceMesh)>;

/// Orders every mesh that an instance places; `None` for the others. The model keeps the meshes' names only, so that
/// memory is given back as they are done.
fn order_all(
    model: &mut Model,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<Vec<Option<PartOutcome>>, BakeError> {
    let mut outcomes: Vec<Option<PartOutcome>> = model.meshes.iter().map(|_| None).collect();
    let largest_first = take_bodies(model);
    let total: usize = largest_first.iter().map(triangles_of).sum();
    progress.triangles_total.store(total as u64, Ordering::Relaxed);

    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build();
    let pool = pool.map_err(|source| BakeError::Threads { threads: options.threads, source })?;
    let ordered: Result<Vec<Vec<(usize, PartOutcome)>>, BakeError> = pool.install(|| {
        largest_first
            .into_par_iter()
            .with_max_len(1)
            .map(|body| {
                progress.check()?;
                order_one(body, options, progress)
            })
            .collect()
    });
    for (mesh, outcome) in ordered?.into_iter().flatten() {
        outcomes[mesh] = Some(outcome);
    }
    Ok(outcomes)
}

fn triangles_of(body: &Body) -> usize {
    body.iter().map(|(_, mesh)| mesh.triangles.len()).sum()
}

/// Takes out the meshes that are placed, grouped to bodies, the largest body first.
fn take_bodies(model: &mut Model) -> Vec<Body> {
    let mut placed = vec![false; model.meshes.len()];
    for instance in &model.instances {
        placed[instance.mesh as usize] = true;
    }
    let mut bodies: Vec<Body> = model.meshes.iter().map(|_| Vec::new()).collect();
    for (number, mesh) in model.meshes.iter_mut().enumerate().filter(|&(number, _)| placed[number]) {
        let name = mesh.name.clone();
        let taken = std::mem::replace(mesh, SourceMesh { name, ..SourceMesh::default() });
        bodies[taken.body as usize].push((number, taken));
    }
    bodies.retain(|body| !body.is_empty());
    bodies.sort_by_key(|body| (std::cmp::Reverse(triangles_of(body)), body[0].0));
    bodies
}

fn order_one(
    mut body: Body,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<Vec<(usize, PartOutcome)>, BakeError> {
    for (_, mesh) in body.iter_mut().filter(|(_, mesh)| mesh.normals.is_empty()) {
        by_crease_angle(mesh, options.crease_degrees);
    }
    let (numbers, meshes): (Vec<usize>, Vec<SourceMesh>) = body.into_iter().unzip();
    let outcomes = order_body(meshes, options.order, progress);
    // What was stopped lacks cells.
    progress.check()?;
    Ok(numbers.into_iter().zip(outcomes).collect())
}

/// Numbers the parts (every cell of a cut part is one) and places them.
fn assemble(model: Model, outcomes: Vec<Option<PartOutcome>>) -> Contents {
    let mut parts = Vec::new();
    let mut cells_of = Vec::with_capacity(outcomes.len());
    let mut source = 0;
    for (mesh, outcome) in model.meshes.into_iter().zip(outcomes) {
        let cells = outcome.map_or_else(Vec::new, |outcome| outcome.cells);
        let first = parts.len() as u32;
        let cut = cells.len() > 1;
        source += u32::from(!cells.is_empty());
        for part in cells {
            parts.push(StoredPart { part, name: mesh.name.clone(), source: source - 1, cell: cut });
        }
        cells_of.push(first..parts.len() as u32);
    }
    let place = |instance: &import::Instance| {
        let (node, material, world_from_part) = (instance.node, instance.material, instance.world_from_part);
        let cells = cells_of[instance.mesh as usize].clone();
        cells.map(move |part| StoredInstance { part, node, material, world_from_part })
    };
    let instances = model.instances.iter().flat_map(place).collect();
    Contents { parts, instances, nodes: model.nodes, materials: model.materials }
}
