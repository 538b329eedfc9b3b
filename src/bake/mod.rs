//! Input files in, a container and a [`BakeReport`] out.
//!
//! The way: import -> normals where there are none -> [`order_body`] for every body in parallel, the largest first, and
//! for the cells of large parts, so that no core waits for one at the end -> container. The bytes written do not depend on the number of threads.

mod bodies;
mod file_boundary;
mod part_report;
mod report;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use glam::DAffine3;
use rayon::prelude::*;

use crate::container::{self, ContainerError, Contents, StoredInstance, StoredPart};
use crate::geometry::body::{BodyOutcome, OrderOptions, order_body};
use crate::geometry::cell_tree::Watch;
use crate::geometry::normals::{CREASE_DEGREES, by_crease_angle};
use crate::import::{self, ImportError, Instance, Model, SourceMesh};

use bodies::instances_of_meshes;
pub use bodies::{Body, MaterialRuns, Placement, bodies, merged};
pub use part_report::PartReport;
pub use report::{BakeReport, StalledPart, WholeReport};

use file_boundary::open_vertices;
use part_report::{PartWeld, part_list};

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
    /// Whether everything is ordered and the container is being written.
    pub writing: AtomicBool,
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
    let model = import::read(inputs)?;
    let import_seconds = started.elapsed().as_secs_f64();
    progress.check()?;
    let (contents, mut report) = ordered(model, options, progress)?;
    let order_seconds = started.elapsed().as_secs_f64() - import_seconds;
    if contents.parts.is_empty() {
        let path = inputs.first().cloned().unwrap_or_default();
        return Err(BakeError::NothingLeft { triangles: report.source_triangles as usize, path });
    }
    progress.writing.store(true, Ordering::Relaxed);
    let written = match container::write(output, &contents, &progress.cancelled) {
        Err(ContainerError::Interrupted) => return Err(BakeError::Interrupted),
        other => other?,
    };
    let seconds = started.elapsed().as_secs_f64();
    let write_seconds = seconds - import_seconds - order_seconds;
    report.finish(&written, [import_seconds, order_seconds, write_seconds, seconds]);
    Ok(report)
}

/// Orders all of a model: what a container of it holds, and what the report says of reading and welding.
///
/// # Errors
/// Threads that could not be started, or an interruption.
pub fn ordered(
    mut model: Model,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<(Contents, BakeReport), BakeError> {
    let bodies = bodies(&model);
    let ordered = order_all(&mut model, &bodies, options, progress)?;
    let welds: Vec<Vec<PartWeld>> = ordered.iter().map(OrderedBody::part_welds).collect();
    let of_parts: Vec<PartWeld> = ordered
        .iter()
        .zip(&welds)
        .flat_map(|(body, welds)| body.meshes_with_cells().map(|mesh| welds[mesh]))
        .collect();
    let notes = std::mem::take(&mut model.notes);
    let contents = assemble(model, bodies, ordered);
    let part_list = part_list(&contents, &of_parts);
    Ok((contents, BakeReport::new(&notes, welds.iter().flatten(), part_list)))
}

/// A body in order, and its boundary before.
#[derive(Debug, Clone, Default)]
struct OrderedBody {
    outcome: BodyOutcome,
    /// For each mesh the vertices on open edges, by the file's own indices.
    open_in_file: Vec<usize>,
}

impl OrderedBody {
    fn part_welds(&self) -> Vec<PartWeld> {
        let welds = self.outcome.welds.iter().zip(&self.open_in_file);
        welds.map(|(&counts, &open_in_file)| PartWeld { counts, open_in_file }).collect()
    }

    /// The meshes that became parts, in the order of the parts.
    fn meshes_with_cells(&self) -> impl Iterator<Item = usize> {
        self.outcome.mesh_of.chunk_by(|a, b| a == b).map(|cells| cells[0])
    }
}

/// Orders all bodies, the largest first. The model keeps the meshes' names only, so that memory is given back as they
/// are done.
fn order_all(
    model: &mut Model,
    bodies: &[Body],
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<Vec<OrderedBody>, BakeError> {
    let mut largest_first: Vec<(usize, Vec<SourceMesh>)> =
        bodies.iter().map(|body| body.take(model)).enumerate().collect();
    let triangles = |meshes: &[SourceMesh]| meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
    largest_first.sort_by_key(|(number, meshes)| (std::cmp::Reverse(triangles(meshes)), *number));
    let total: usize = largest_first.iter().map(|(_, meshes)| triangles(meshes)).sum();
    progress.triangles_total.store(total as u64, Ordering::Relaxed);

    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build();
    let pool = pool.map_err(|source| BakeError::Threads { threads: options.threads, source })?;
    let order = |(number, meshes): (usize, Vec<SourceMesh>)| {
        Ok((number, order_one(meshes, bodies[number].is_merged, options, progress)?))
    };
    let ordered: Result<Vec<(usize, OrderedBody)>, BakeError> =
        pool.install(|| largest_first.into_par_iter().with_max_len(1).map(order).collect());
    let mut outcomes = vec![OrderedBody::default(); bodies.len()];
    for (number, outcome) in ordered? {
        outcomes[number] = outcome;
    }
    Ok(outcomes)
}

fn order_one(
    mut meshes: Vec<SourceMesh>,
    merge: bool,
    options: &BakeOptions,
    progress: &BakeProgress,
) -> Result<OrderedBody, BakeError> {
    progress.check()?;
    let mut open_in_file: Vec<usize> =
        meshes.iter().map(|mesh| open_vertices(&mesh.triangles, mesh.positions.len())).collect();
    for mesh in meshes.iter_mut().filter(|mesh| mesh.normals.is_empty()) {
        by_crease_angle(mesh, options.crease_degrees);
    }
    if merge {
        meshes = vec![merged(meshes)];
        open_in_file = vec![open_in_file.iter().sum()];
    }
    let outcome = order_body(meshes, options.order, progress);
    // What was stopped lacks cells.
    progress.check()?;
    Ok(OrderedBody { outcome, open_in_file })
}

/// Numbers the parts (every cell of a mesh is one) and places them, in the order of the model's instances.
fn assemble(mut model: Model, bodies: Vec<Body>, ordered: Vec<OrderedBody>) -> Contents {
    let mut parts = Vec::new();
    let mut placed: Vec<(usize, Vec<StoredInstance>)> = Vec::new();
    let mut sources = 0..;
    let mut runs = MaterialRuns::default();
    let alone = instances_of_meshes(&model);
    for (body, OrderedBody { outcome, .. }) in bodies.into_iter().zip(ordered) {
        let BodyOutcome { cells, mesh_of, .. } = outcome;
        let mut mesh_of = mesh_of.as_slice();
        let mut cells = cells.into_iter();
        while let Some(&mesh) = mesh_of.first() {
            let count = mesh_of.iter().take_while(|&&other| other == mesh).count();
            mesh_of = &mesh_of[count..];
            let first = parts.len() as u32;
            let rows = first..first + count as u32;
            match body.placements.as_ref().filter(|_| body.is_merged) {
                Some(places) => placed.extend(places.iter().map(|place| {
                    let material = runs.first_of(&place.materials, &mut model.materials);
                    (place.first, place_cells(rows.clone(), place.node, material, place.world_from_part))
                })),
                None => placed.extend(place_alone(&model.instances, &alone[body.meshes[mesh]], rows)),
            }
            let name = &model.meshes[body.meshes[mesh]].name;
            let source = sources.next().unwrap_or_default();
            let stored = |part| StoredPart { part, name: name.clone(), source, cell: count > 1 };
            parts.extend(cells.by_ref().take(count).map(stored));
        }
    }
    placed.sort_by_key(|&(number, _)| number);
    let instances = placed.into_iter().flat_map(|(_, cells)| cells).collect();
    Contents { parts, instances, nodes: model.nodes, materials: model.materials }
}

fn place_cells(
    parts: Range<u32>,
    node: u32,
    material: u32,
    world_from_part: DAffine3,
) -> Vec<StoredInstance> {
    parts.map(|part| StoredInstance { part, node, material, world_from_part }).collect()
}

/// The instances of all cells of one mesh wherever its `own` instances place it, each after its number in the model.
fn place_alone(
    instances: &[Instance],
    own: &[usize],
    cells: Range<u32>,
) -> impl Iterator<Item = (usize, Vec<StoredInstance>)> {
    own.iter().map(move |&number| {
        let Instance { node, material, world_from_part, .. } = instances[number];
        (number, place_cells(cells.clone(), node, material, world_from_part))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Material, Node};

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
        let (contents, _) = ordered(model, &BakeOptions::default(), &BakeProgress::default()).unwrap();
        let placed: Vec<_> = contents.instances.iter().map(|placed| (placed.part, placed.material)).collect();
        assert_eq!(placed, [(0, 1), (1, 2)]);
    }
}
