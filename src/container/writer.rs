//! Ordered parts, instances, nodes and materials in; a complete file under the final name, or none, out.
//!
//! The file is written under a temporary name in the output's folder, synchronised, and renamed. The bytes follow from the
//! contents alone.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::DAffine3;
use tempfile::NamedTempFile;

use crate::whole_file::folder_of;

use super::ContainerError;
use super::assemble::{Rows, assemble};
use super::encode::{check_part, encode_chunk, part_row, refused};
use super::format::{Form, InstanceRow};
use crate::geometry::OrderedPart;
use crate::import::{Material, Node};

/// A part to be stored.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredPart {
    /// The part.
    pub part: OrderedPart,
    /// Its name; may be empty, may repeat.
    pub name: String,
    /// The number of the source part; all cells of one cut part share it.
    pub source: u32,
    /// Whether it is one cell of a part that was cut.
    pub cell: bool,
}

/// A placement of a stored part; a part that was cut has one for each cell.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredInstance {
    /// Index into [`Contents::parts`].
    pub part: u32,
    /// Index into [`Contents::nodes`].
    pub node: u32,
    /// Index into [`Contents::materials`].
    pub material: u32,
    /// Part space to world space; finite.
    pub world_from_part: DAffine3,
}

/// Everything that a container holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contents {
    /// The parts.
    pub parts: Vec<StoredPart>,
    /// The placements.
    pub instances: Vec<StoredInstance>,
    /// The assembly tree, parents before children.
    pub nodes: Vec<Node>,
    /// The materials.
    pub materials: Vec<Material>,
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// The length of the file.
    pub file_bytes: u64,
    /// The length of header and tables.
    pub table_bytes: u64,
    /// How many chunks there are.
    pub chunks: usize,
}

/// Somebody who waits for a file to be written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Watch<'a> {
    /// Looked at before every chunk and before the file gets its name.
    pub cancelled: &'a AtomicBool,
    /// Bytes of the payload that have been written.
    pub bytes: &'a AtomicU64,
}

impl Watch<'_> {
    pub(super) fn stop_if(&self) -> Result<(), ContainerError> {
        if self.cancelled.load(Ordering::Relaxed) { Err(ContainerError::Interrupted) } else { Ok(()) }
    }

    pub(super) fn wrote(&self, bytes: usize) {
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}

/// Writes a container: the same bytes for the same contents, and all of them or no file.
///
/// Chunks are stored in `form`, or, where they do not have it, in a plainer one. `cancelled` is looked at before every
/// chunk and before the file gets its name.
///
/// # Errors
/// Contents that no container can hold, a missing folder, anything that the system refuses, and
/// [`ContainerError::Interrupted`]. After each of them nothing of the new file is left; an older file of that name is
/// kept.
pub fn write(
    path: &Path,
    contents: &Contents,
    form: Form,
    cancelled: &AtomicBool,
) -> Result<Written, ContainerError> {
    for (index, stored) in contents.parts.iter().enumerate() {
        check_part(&stored.part).map_err(|problem| refused(format!("part {index}"), problem))?;
    }
    let parts =
        contents.parts.iter().map(|part| (part_row(&part.part, part.cell), &part.name[..], part.source));
    let rows = Rows::new(parts, &contents.nodes, &contents.materials)?;
    let file = temporary_beside(path)?;
    let placed = (contents.instances.len(), || contents.instances.iter().map(StoredInstance::row));
    let chunk_of = |part: u32, tier: u32, out: &mut Vec<u8>| {
        Ok(encode_chunk(&contents.parts[part as usize].part, tier as usize, form, out))
    };
    let watch = Watch { cancelled, bytes: &AtomicU64::new(0) };
    let written = assemble(file.as_file(), file.path(), rows, placed, chunk_of, &watch)
        .map_err(|error| error.of(path))?;
    file.persist(path).map_err(|refused| named(path, refused.error))?;
    Ok(written)
}

/// That a complete file could not get its name.
pub(crate) fn named(path: &Path, cause: io::Error) -> ContainerError {
    ContainerError::Io { doing: "give the container its name", cause, path: path.to_owned() }
}

impl StoredInstance {
    /// Its row.
    pub(crate) fn row(&self) -> InstanceRow {
        let Self { part, node, material, world_from_part } = self;
        InstanceRow {
            part: *part,
            node: *node,
            material: *material,
            flags: 0,
            world_from_part: world_from_part.to_cols_array(),
        }
    }
}

/// Says early what would stop [`write()`] late: an output that is a folder, or whose folder does not exist.
///
/// # Errors
/// [`ContainerError::OutputIsFolder`], [`ContainerError::NoFolder`].
pub fn check_destination(path: &Path) -> Result<(), ContainerError> {
    if path.is_dir() {
        return Err(ContainerError::OutputIsFolder { path: path.to_owned() });
    }
    let folder = folder_of(path);
    if folder.is_dir() { Ok(()) } else { Err(ContainerError::NoFolder { path: folder.to_owned() }) }
}

/// An empty file in the folder of `path`, which is deleted unless it is given that name.
fn temporary_beside(path: &Path) -> Result<NamedTempFile, ContainerError> {
    check_destination(path)?;
    let folder = folder_of(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".collapsar-").suffix(".clps.part");
    // Temporary files are private by default, and this one becomes the user's own: let the umask decide, as usual.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|cause| ContainerError::Io {
        doing: "create a file in the output's folder",
        cause,
        path: PathBuf::from(folder),
    })
}
