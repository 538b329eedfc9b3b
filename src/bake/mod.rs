//! Input files in, a container and a [`BakeReport`] out.
//!
//! The way: import -> an outline and a source of meshes -> every body on its own: load it, make normals where there are
//! none, [`order_body`], encode, and put it away on disk (`work.rs`) -> the container, assembled from what was put away.
//! So a bake holds the bodies at hand and a few hundred bytes for each that is done; what they may take together is
//! capped (`gate.rs`). The bytes written depend neither on the number of threads nor on interruptions.

pub mod beside;
mod bodies;
mod file_boundary;
mod gate;
mod journal;
mod ledger;
mod part_report;
mod placing;
mod report;
pub mod source;
mod welded;
mod work;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use parking_lot::Mutex;

use crate::container::{self, ContainerError, Form, Rows, Watch as WriteWatch, Written};
use crate::geometry::body::{BodyOutcome, OrderOptions, order_body};
use crate::geometry::cell_tree::Watch;
use crate::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use crate::import::{self, ImportError, Problem, Room, SourceMesh};
use crate::stats::memory;
use crate::whole_file::folder_of;

pub use bodies::{Body, MaterialRuns, Placement, bodies, merged};
pub use part_report::PartReport;
pub use report::{BakeReport, StalledPart, WholeReport};
pub use source::{Loaded, MeshOutline, MeshSource, Outline};
pub use welded::Welded;
pub use work::folder_for;

use file_boundary::open_vertices;
use gate::Gate;
use ledger::{BodyRows, Ledger};
use placing::Placing;
use work::Work;

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
    /// The user asked to stop, and nothing was done yet that is worth keeping.
    #[error("interrupted; nothing was written")]
    Interrupted,
    /// Stopped, by the user or by what went wrong; what is done is kept.
    #[error(
        "{}; no container was written; {done} of {total} bodies are kept: go on with the same command and --resume, or \
         delete the folder {}",
        cause.as_ref().map_or("interrupted".to_owned(), ToString::to_string),
        folder.display()
    )]
    Stopped {
        /// What went wrong; `None` if the user asked to stop.
        cause: Option<ContainerError>,
        /// How many bodies are done.
        done: usize,
        /// How many there are.
        total: usize,
        /// The work folder.
        folder: PathBuf,
    },
    /// There is something else where the work folder should be.
    #[error(
        "the work of a bake is kept in a folder of this name, and there is something else: rename or remove it, or \
         choose another output: {}",
        path.display()
    )]
    NotAWorkFolder {
        /// The folder.
        path: PathBuf,
    },
    /// Another bake is writing the same output.
    #[error("another bake of this output is at work: wait for it, or choose another output: {}", path.display())]
    Busy {
        /// The work folder.
        path: PathBuf,
    },
    /// `resume` finds the work of a bake of something else.
    #[error(
        "this is the work of a bake of another model, with other options or by another version, and cannot be resumed: \
         repeat the command as it was, or bake anew without --resume: {}",
        path.display()
    )]
    OtherWork {
        /// The work folder.
        path: PathBuf,
    },
    /// The memory cap is too small for the largest part.
    #[error(
        "a cap of {cap_bytes} bytes of memory is too little: this model needs {need_bytes}, most of it for {what}; give \
         --memory {}MiB or more",
        need_bytes.div_ceil(1 << 20)
    )]
    TooLittleMemory {
        /// The cap.
        cap_bytes: u64,
        /// The least that works.
        need_bytes: u64,
        /// What needs it.
        what: String,
    },
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
    /// The most memory that may be in use, in bytes; `None` for as much as all threads can use.
    pub memory_bytes: Option<u64>,
    /// Whether to go on with what an interrupted bake of the same has left.
    pub resume: bool,
    /// Whether the report lists every part.
    pub list_parts: bool,
    /// Whether chunks are compressed.
    pub compress: bool,
}

impl BakeOptions {
    /// The form of the chunks.
    fn form(&self) -> Form {
        if self.compress { Form::Compressed } else { Form::Narrow }
    }
}

impl Default for BakeOptions {
    fn default() -> Self {
        Self {
            order: OrderOptions::default(),
            crease_degrees: CREASE_DEGREES,
            threads: 0,
            memory_bytes: None,
            resume: false,
            list_parts: true,
            compress: false,
        }
    }
}

/// How far a bake has come, readable from another thread.
#[derive(Debug, Default)]
pub struct BakeProgress {
    /// Triangles that are to be ordered; 0 until the input has been read.
    pub triangles_total: AtomicU64,
    /// Triangles that have been ordered.
    pub triangles_done: AtomicU64,
    /// Whether everything is ordered and the container is being written.
    pub writing: AtomicBool,
    /// Bytes of the container's payload.
    pub bytes_total: AtomicU64,
    /// Bytes of it that have been written.
    pub bytes_written: AtomicU64,
    /// Set by the user's side to stop the bake at the next part or cell.
    pub cancelled: Arc<AtomicBool>,
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
/// that did not have it before. What is done may be kept beside it: [`BakeError::Stopped`].
pub fn bake(
    inputs: &[PathBuf],
    output: &Path,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<BakeReport, BakeError> {
    let (started, resident) = (Instant::now(), memory::begin_peak());
    container::check_destination(output)?;
    let room = room_for_input(output, options, &progress.cancelled);
    let model = import::read_into(inputs, &room).map_err(|error| match error {
        ImportError::File { problem: Problem::Interrupted, .. } => BakeError::Interrupted,
        other => other.into(),
    })?;
    let source = Loaded::shelved(model, inputs);
    let import_seconds = started.elapsed().as_secs_f64();
    progress.check()?;
    let mut report = bake_source(&source, output, options, progress).map_err(|error| match error {
        BakeError::NothingLeft { triangles, .. } => {
            BakeError::NothingLeft { triangles, path: inputs.first().cloned().unwrap_or_default() }
        }
        other => other,
    })?;
    report.add_import(import_seconds, resident);
    Ok(report)
}

/// Bakes a model whose meshes come one at a time.
///
/// # Errors
/// As [`bake`].
pub fn bake_source(
    source: &dyn MeshSource,
    output: &Path,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<BakeReport, BakeError> {
    let started = Instant::now();
    container::check_destination(output)?;
    let outline = source.outline();
    let bodies = bodies(outline);
    let gate = Gate::new(room_for_bodies(source, &bodies, options)?);
    let about = format!("{:?} {} {:?}", options.order, options.crease_degrees, options.form());
    let about = work::about(bodies.len(), source.fingerprint(), &about);
    let work = Work::open(output, about, options.resume)?;
    let baking = Baking { source, bodies: &bodies, options, progress, gate: &gate, work: &work };
    let result = baking.order_all().and_then(|()| {
        let order_seconds = started.elapsed().as_secs_f64();
        baking.write(output, order_seconds, started)
    });
    match result {
        Ok(report) => {
            work.remove();
            Ok(report)
        }
        Err(error) => Err(stopped(error, work, bodies.len())),
    }
}

/// Keeps what is done, if a stop is not for good.
fn stopped(error: BakeError, work: Work, total: usize) -> BakeError {
    let (done, folder) = (work.done(), work.folder().to_owned());
    let cause = match error {
        BakeError::Interrupted | BakeError::Container(ContainerError::Interrupted) => None,
        BakeError::Container(cause @ ContainerError::Io { .. }) => Some(cause),
        other => {
            work.remove();
            return other;
        }
    };
    // A journal that cannot be written to its end only means that some of it is done again.
    let _ = work.flush();
    if done > 0 {
        return BakeError::Stopped { cause, done, total, folder };
    }
    work.remove();
    cause.map_or(BakeError::Interrupted, BakeError::Container)
}

/// The share of the memory that meshes may take which were read and are not ordered yet.
const INPUT_SHARE: u64 = 4;

/// Where what was read is kept until it is ordered.
fn room_for_input(output: &Path, options: &BakeOptions, cancelled: &Arc<AtomicBool>) -> Room {
    let memory_bytes = options.memory_bytes.unwrap_or_else(import::memory_at_hand);
    let room = Room::new(memory_bytes / INPUT_SHARE, options.memory_bytes, folder_of(output));
    room.stopped_by(Arc::clone(cancelled))
}

/// What the bake of one triangle takes, in bytes: the mesh, what orders it, and the result, all at their largest.
const BYTES_PER_TRIANGLE: u64 = 360;
/// What any bake takes: the program, its threads and its buffers.
const BYTES_AT_LEAST: u64 = 32 << 20;
/// What the tables take for each part, mesh, instance or node.
const BYTES_PER_ROW: u64 = 640;

fn bytes_of_body(triangles: u64) -> u64 {
    triangles.saturating_mul(BYTES_PER_TRIANGLE) + (1 << 16)
}

/// Bytes that the bodies at hand may take together.
fn room_for_bodies(
    source: &dyn MeshSource,
    bodies: &[Body],
    options: &BakeOptions,
) -> Result<u64, BakeError> {
    let Some(cap_bytes) = options.memory_bytes else { return Ok(u64::MAX) };
    let outline = source.outline();
    let rows = bodies.len() + outline.instances.len() / 2 + outline.nodes.len() / 4;
    let fixed = BYTES_AT_LEAST + source.bytes_held() + rows as u64 * BYTES_PER_ROW;
    let largest = bodies.iter().max_by_key(|body| body.triangles(outline));
    let (triangles, name) =
        largest.map_or((0, ""), |body| (body.triangles(outline), &outline.meshes[body.meshes[0]].name[..]));
    let need_bytes = fixed.saturating_add(bytes_of_body(triangles));
    if need_bytes > cap_bytes {
        let what = match fixed > bytes_of_body(triangles) {
            true if source.bytes_held() > fixed / 2 => {
                "the input, which this format makes us hold".to_owned()
            }
            true => format!("the tables of {} parts", bodies.len()),
            false => format!("the part '{name}' of {triangles} triangles"),
        };
        return Err(BakeError::TooLittleMemory { cap_bytes, need_bytes, what });
    }
    Ok(cap_bytes - fixed)
}

/// A bake at work.
#[derive(Clone, Copy)]
struct Baking<'a> {
    source: &'a dyn MeshSource,
    bodies: &'a [Body],
    options: &'a BakeOptions,
    progress: &'a BakeProgress,
    gate: &'a Gate,
    work: &'a Work,
}

/// A body of more than this share of all triangles is begun before the others, so that no core waits for it at the end.
const LARGE_SHARE: u64 = 64;

impl Baking<'_> {
    /// Orders all bodies that are not done, on all cores.
    fn order_all(self) -> Result<(), BakeError> {
        let todo = self.todo();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.options.threads).build();
        let pool = pool.map_err(|source| BakeError::Threads { threads: self.options.threads, source })?;
        let next = AtomicUsize::new(0);
        let failed: Mutex<Option<BakeError>> = Mutex::default();
        // Each worker takes bodies until there are none: bodies come in order, so that what is put away lies in order
        // as well, and only their cells are shared between workers.
        pool.broadcast(|_| {
            while failed.lock().is_none()
                && let Some(&body) = todo.get(next.fetch_add(1, Ordering::Relaxed))
            {
                if let Err(error) = self.order(body) {
                    failed.lock().get_or_insert(error);
                }
            }
        });
        match failed.into_inner() {
            Some(error) => Err(error),
            None => self.work.flush(),
        }
    }

    /// The bodies that are not done: large ones first, the largest of them first, then the others in order.
    fn todo(self) -> Vec<usize> {
        let triangles = |body: usize| self.bodies[body].triangles(self.source.outline());
        let all: u64 = (0..self.bodies.len()).map(triangles).sum();
        let is_large = |body: &usize| triangles(*body) > all / LARGE_SHARE;
        let (done, todo): (Vec<usize>, Vec<usize>) =
            (0..self.bodies.len()).partition(|&body| self.work.is_done(body));
        self.progress.triangles_total.store(all, Ordering::Relaxed);
        self.progress.done(done.into_iter().map(triangles).sum::<u64>() as usize);
        let (mut large, small): (Vec<usize>, Vec<usize>) = todo.into_iter().partition(is_large);
        large.sort_by_key(|&body| (std::cmp::Reverse(triangles(body)), body));
        large.extend(small);
        large
    }

    /// Loads a body, orders it and puts it away.
    fn order(self, number: usize) -> Result<(), BakeError> {
        self.progress.check()?;
        let body = &self.bodies[number];
        let _admitted = self.gate.admit(bytes_of_body(body.triangles(self.source.outline())));
        let meshes = body.load(self.source)?;
        let (outcome, open_in_file) = order_meshes(meshes, body.is_merged, self.options, self.progress);
        // What was stopped lacks cells.
        self.progress.check()?;
        let (rows, bytes) = BodyRows::encode(&outcome, &open_in_file, self.options.form())?;
        self.work.keep(number, rows, &bytes)
    }

    /// Assembles the container from what was put away, and gives it its name.
    fn write(self, output: &Path, order_seconds: f64, started: Instant) -> Result<BakeReport, BakeError> {
        let (ledger, mut chunks) = self.work.finish();
        let outline = self.source.outline();
        let placing = Placing::new(outline, self.bodies, &ledger);
        let counts = placing.counts(ledger.part_count());
        let mut report = BakeReport::new(outline, self.bodies, &ledger, &counts, self.options.list_parts);
        if ledger.part_count() == 0 {
            let triangles = report.welded.source_triangles as usize;
            return Err(BakeError::NothingLeft { triangles, path: output.to_owned() });
        }
        self.progress.bytes_total.store(ledger.payload_bytes(), Ordering::Relaxed);
        self.progress.writing.store(true, Ordering::Relaxed);
        let rows = Rows::new(self.named_parts(&ledger), &outline.nodes, &placing.materials)?;
        let (starts, tiers) = (ledger.chunk_starts(), tier_counts(&rows));
        let chunk_of = |part: u32, tier: u32, out: &mut Vec<u8>| {
            let row = ledger.chunk(starts[part as usize] + tier);
            chunks.read((tiers[part as usize] - 1 - tier) as usize, row, out)?;
            Ok(*row)
        };
        let placed = counts.iter().map(|&count| count as usize).sum();
        let placed = (placed, || placing.instances().map(|instance| instance.row()));
        let watch = WriteWatch { cancelled: &self.progress.cancelled, bytes: &self.progress.bytes_written };
        let (file, path) = self.work.container()?;
        let written: Written = container::assemble(&file, &path, rows, placed, chunk_of, &watch)
            .map_err(|error| error.of(output))?;
        std::fs::rename(&path, output).map_err(|cause| container::named(output, cause))?;
        let seconds = started.elapsed().as_secs_f64();
        report.finish(&written, [order_seconds, seconds - order_seconds, seconds]);
        Ok(report)
    }

    /// The rows of all parts in order, each with its name and the number of its source.
    fn named_parts<'l>(self, ledger: &'l Ledger) -> impl Iterator<Item = (container::PartRow, &'l str, u32)>
    where
        Self: 'l,
    {
        named_parts(self.source.outline(), self.bodies, ledger)
            .zip(0..)
            .flat_map(|((name, cells), source)| cells.iter().map(move |&row| (row, name, source)))
    }
}

fn tier_counts(rows: &Rows) -> Vec<u32> {
    rows.parts.iter().map(|part| part.tier_count).collect()
}

/// Every mesh that left parts, in order: its name, and its parts.
fn named_parts<'a>(
    outline: &'a Outline,
    bodies: &'a [Body],
    ledger: &'a Ledger,
) -> impl Iterator<Item = (&'a str, &'a [container::PartRow])> {
    bodies.iter().enumerate().flat_map(move |(number, body)| {
        let mut parts = ledger.parts(number);
        let meshes = ledger.meshes(number).iter().zip(&body.meshes);
        meshes.filter(|(row, _)| row.cells > 0).map(move |(row, &mesh)| {
            let (own, others) = parts.split_at(row.cells as usize);
            parts = others;
            (&outline.meshes[mesh].name[..], own)
        })
    })
}

/// Orders the meshes of a body; gives also, for each, the vertices on open edges by the file's own indices.
fn order_meshes(
    mut meshes: Vec<SourceMesh>,
    merge: bool,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> (BodyOutcome, Vec<usize>) {
    let mut open_in_file: Vec<usize> =
        meshes.iter().map(|mesh| open_vertices(&mesh.triangles, mesh.positions.len())).collect();
    for mesh in meshes.iter_mut().filter(|mesh| mesh.normals.is_empty()) {
        by_crease_angle(mesh, options.crease_degrees);
    }
    if merge {
        meshes = vec![merged(meshes)];
        open_in_file = vec![open_in_file.iter().sum()];
    }
    (order_body(meshes, options.order, progress), open_in_file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::container::Container;
    use crate::import::{Instance, Material, Model, Node};
    use glam::DAffine3;

    /// Found by reading: what became of the meshes decided again whether they had been merged.
    #[test]
    fn meshes_of_a_body_that_stay_apart_keep_their_own_materials() {
        let mesh = |x: f32, colours: Vec<[u8; 4]>| SourceMesh {
            positions: vec![[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            colours,
            triangles: vec![[0, 1, 2]],
            ..SourceMesh::default()
        };
        let place =
            |mesh, material| Instance { mesh, node: 0, material, world_from_part: DAffine3::IDENTITY };
        let model = Model {
            meshes: vec![mesh(0.0, vec![[255, 0, 0, 255]; 3]), mesh(5.0, Vec::new())],
            instances: vec![place(0, 1), place(1, 2)],
            nodes: vec![Node { name: String::new(), parent: None }],
            materials: vec![Material::default(); 3],
            ..Model::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.clps");
        bake_source(&Loaded::new(model), &output, &BakeOptions::default(), &BakeProgress::default()).unwrap();
        let file = crate::scene::mapped::MappedFile::open(&output).unwrap();
        let container = Container::open(file.bytes()).unwrap();
        let placed: Vec<_> =
            container.instances().iter().map(|placed| (placed.part, placed.material)).collect();
        assert_eq!(placed, [(0, 1), (1, 2)]);
    }
}
