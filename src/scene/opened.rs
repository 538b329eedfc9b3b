//! A container's path in, a [`Scene`] out: its tables in memory, its payload in the file.
//!
//! The tables are held as the file has them, in one block; what is drawn from them is a view into it.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::bounds::Bounds;
use super::file::PayloadFile;
use super::mapped::MapError;
use super::part::ResidentPart;
use crate::container::{
    Chunk, ChunkRow, ChunkSpec, Container, ContainerError, Groups, InstanceRow, PartRow, SectionKind,
};
use crate::import::Colour;

/// Why a container cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The file is not a sound container.
    #[error("{cause}: {path}")]
    Container {
        /// What is wrong with it.
        cause: ContainerError,
        /// The file.
        path: PathBuf,
    },
}

/// An opened container.
#[derive(Debug)]
pub struct Scene {
    file: PayloadFile,
    /// Everything before the payload, in words so that rows are aligned.
    tables: Vec<u64>,
    /// Where the rows of parts, chunks and instances lie in it, in bytes.
    parts: Range<usize>,
    chunks: Range<usize>,
    instances: Range<usize>,
    pub(super) nodes: Range<usize>,
    pub(super) materials: Range<usize>,
    pub(super) names: Range<usize>,
    colours: Vec<Colour>,
    boxes: Vec<InstanceBox>,
    groups: Groups,
    bounds: Bounds,
    has_parents: bool,
}

/// How large a model is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SceneCounts {
    /// Distinct parts; one that was cut into cells counts once.
    pub parts: u64,
    /// Placements of parts, before the cut into cells.
    pub instances: u64,
    /// Triangles at full detail, summed over the placements.
    pub triangles_placed: u64,
    /// Bytes of the container.
    pub file_bytes: u64,
}

/// The world-space box of an instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InstanceBox {
    /// Its centre.
    pub centre: DVec3,
    /// Half its extent along each axis.
    pub half_extent: DVec3,
    /// The part's diagonal, scaled to the world by the transform's largest stretch.
    pub diagonal: f64,
}

impl Scene {
    /// Opens a container, reads its tables and checks them; no payload is read.
    ///
    /// # Errors
    /// The file cannot be read, or is not a sound container.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        let file = PayloadFile::open(path)?;
        let wrap = |cause| SceneError::Container { cause, path: path.to_owned() };
        let tables = read_tables(&file)?;
        let container = Container::open_tables(bytemuck::cast_slice(&tables), file.bytes()).map_err(wrap)?;
        let (all, rows) = (container.parts(), container.instances());
        let colours = container.materials().iter().map(|material| material.base_colour).collect();
        let boxes: Vec<InstanceBox> =
            rows.par_iter().map(|instance| instance_box(&all[instance.part as usize], instance)).collect();
        let bounds = boxes.iter().fold(Bounds::EMPTY, Bounds::with_box);
        let has_parents = all.iter().any(PartRow::is_parent);
        use SectionKind as Kind;
        let sections =
            [Kind::Parts, Kind::Chunks, Kind::Instances, Kind::Nodes, Kind::Materials, Kind::Names];
        let [parts, chunks, instances, nodes, materials, names] =
            sections.map(|kind| container.section_range(kind));
        let groups = Groups::of(&container);
        Ok(Self {
            has_parents,
            groups,
            parts,
            chunks,
            instances,
            nodes,
            materials,
            names,
            colours,
            boxes,
            bounds,
            tables,
            file,
        })
    }

    /// The container's name, without its folder.
    pub fn file_name(&self) -> String {
        self.file.path().file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// How large the model is; takes a look at every part and instance.
    pub fn counts(&self) -> SceneCounts {
        let parts = self.parts();
        let is_first_cell = |part: usize| part == 0 || parts[part].source != parts[part - 1].source;
        let placed = || self.instances().iter().map(|instance| instance.part as usize);
        let leaves = placed().filter(|&part| !parts[part].is_parent());
        SceneCounts {
            parts: (0..parts.len()).filter(|&part| is_first_cell(part)).count() as u64,
            instances: placed().filter(|&part| is_first_cell(part)).count() as u64,
            triangles_placed: leaves.map(|part| u64::from(parts[part].triangles)).sum(),
            file_bytes: self.file.bytes(),
        }
    }

    /// The rows of a section, which is a range of bytes of the tables.
    pub(super) fn rows<T: bytemuck::Pod>(&self, range: &Range<usize>) -> &[T] {
        // The container has checked that the rows of each section are aligned and whole.
        bytemuck::cast_slice(&bytemuck::cast_slice::<u64, u8>(&self.tables)[range.clone()])
    }

    /// The parts.
    pub fn parts(&self) -> &[PartRow] {
        self.rows(&self.parts)
    }

    /// Bytes of memory that it holds.
    pub fn bytes_held(&self) -> u64 {
        let groups = size_of_val(self.groups.rows.as_slice()) + size_of_val(self.groups.members.as_slice());
        (size_of_val(self.tables.as_slice()) + size_of_val(self.boxes.as_slice()) + groups) as u64
    }

    /// The placements of parts.
    pub fn instances(&self) -> &[InstanceRow] {
        self.rows(&self.instances)
    }

    /// The instance that is drawn in the place of this one and others where they are finer than need be.
    pub fn parent_instance(&self, instance: u32) -> Option<u32> {
        let part = &self.parts()[self.instances()[instance as usize].part as usize];
        // The container has checked that the cells of a part are placed together.
        (!part.is_root()).then(|| instance - part.parent_distance)
    }

    /// The instances that are placed together with one, as the cells of one part; itself for a part without parent
    /// cells.
    pub fn placement(&self, instance: u32) -> Range<u32> {
        let (parts, instances) = (self.parts(), self.instances());
        let cell = |number: u32| {
            let index = instances.get(number as usize)?.part;
            let part = &parts[index as usize];
            (part.is_parent() || !part.is_root()).then_some((part.source, index))
        };
        let follows = |number: u32| match (cell(number), cell(number + 1)) {
            (Some(one), Some(next)) => one.0 == next.0 && one.1 < next.1,
            _ => false,
        };
        let (mut start, mut end) = (instance, instance + 1);
        while start > 0 && follows(start - 1) {
            start -= 1;
        }
        while follows(end - 1) {
            end += 1;
        }
        start..end
    }

    /// Whether any part has parent cells.
    pub fn has_parents(&self) -> bool {
        self.has_parents
    }

    /// The world-space box of every instance.
    pub fn boxes(&self) -> &[InstanceBox] {
        &self.boxes
    }

    /// The groups of all instances.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// The box of everything.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The material colour of an instance.
    pub fn colour(&self, instance: &InstanceRow) -> Colour {
        self.colours[instance.material as usize]
    }

    /// The colours of the material slots of an instance; none if its part has no slots.
    pub fn slot_colours(&self, instance: &InstanceRow) -> &[Colour] {
        let (first, slots) =
            (instance.material as usize, self.parts()[instance.part as usize].slots as usize);
        // The container has checked that there are so many.
        &self.colours[first..first + slots]
    }

    /// The chunks of a part, finest tier first.
    pub fn tiers(&self, part: u32) -> &[ChunkRow] {
        let part = &self.parts()[part as usize];
        let first = part.first_chunk as usize;
        &self.rows(&self.chunks)[first..first + part.tier_count as usize]
    }

    /// Reads, decodes and checks a chunk; may wait for the disk. `coarser` are the chunks of all coarser tiers, the next
    /// coarser one first, which only a compressed chunk needs.
    ///
    /// # Errors
    /// The chunk is damaged, or the file has become shorter.
    pub fn read_chunk(&self, part: u32, tier: u32, coarser: &[&Chunk]) -> Result<Chunk, ContainerError> {
        let spec = self.chunk_spec(part, tier);
        Chunk::read(spec, coarser, |bytes| self.read_bytes(bytes, spec.row.offset))
    }

    /// Reads, decodes and checks all chunks of a part; may wait for the disk.
    ///
    /// # Errors
    /// As [`read_chunk`](Self::read_chunk).
    pub fn read_part(&self, part: u32) -> Result<ResidentPart, ContainerError> {
        let tiers = self.tiers(part).len() as u32;
        let mut read = ResidentPart::new(tiers);
        let mut chunks: Vec<Arc<Chunk>> = Vec::new();
        for tier in (0..tiers).rev() {
            let coarser: Vec<&Chunk> = chunks.iter().rev().map(Arc::as_ref).collect();
            let chunk = Arc::new(self.read_chunk(part, tier, &coarser)?);
            read.arrive(tier, Arc::clone(&chunk));
            chunks.push(chunk);
        }
        Ok(read)
    }

    /// Decodes and checks a chunk whose stored bytes were read before, together with others; there may be more bytes
    /// behind it. `coarser` as in [`read_chunk`](Self::read_chunk).
    ///
    /// # Errors
    /// The chunk is damaged.
    pub(crate) fn chunk_of(
        &self,
        part: u32,
        tier: u32,
        coarser: &[&Chunk],
        read: &[u8],
    ) -> Result<Chunk, ContainerError> {
        Chunk::read(self.chunk_spec(part, tier), coarser, |bytes| {
            bytes.copy_from_slice(read.get(..bytes.len()).ok_or(ContainerError::CutShort)?);
            Ok(())
        })
    }

    /// Reads bytes of the file; may wait for the disk.
    ///
    /// # Errors
    /// The file has become shorter; what the system refuses.
    pub(crate) fn read_bytes(&self, bytes: &mut [u8], offset: u64) -> Result<(), ContainerError> {
        self.file.read_at(bytes, offset).map_err(|cause| match cause.kind() {
            io::ErrorKind::UnexpectedEof => ContainerError::CutShort,
            _ => ContainerError::Read { cause },
        })
    }

    fn chunk_spec(&self, part: u32, tier: u32) -> ChunkSpec {
        ChunkSpec::new(part, &self.parts()[part as usize], self.tiers(part), tier as usize)
    }

    /// Where a chunk lies in the file, as it is stored.
    pub(crate) fn chunk_range(&self, part: u32, tier: u32) -> Range<u64> {
        self.chunk_spec(part, tier).range()
    }

    /// How many chunks there are.
    pub(crate) fn chunk_count(&self) -> usize {
        self.rows::<ChunkRow>(&self.chunks).len()
    }

    /// The number of a chunk among all.
    pub(crate) fn chunk_number(&self, part: u32, tier: u32) -> usize {
        self.parts()[part as usize].first_chunk as usize + tier as usize
    }
}

/// Tables are read in pieces of so many bytes, on all cores.
const READ_BYTES: usize = 1 << 22;

/// Everything before the payload of a file, as far as its first bytes tell where that starts.
fn read_tables(file: &PayloadFile) -> Result<Vec<u64>, SceneError> {
    let path = file.path();
    let wrap = |cause| SceneError::Container { cause, path: path.to_owned() };
    let io = |cause: io::Error| match cause.kind() {
        io::ErrorKind::UnexpectedEof => wrap(ContainerError::CutShort),
        _ => SceneError::Map(MapError::Io { cause, path: path.to_owned() }),
    };
    let start = file.bytes().min(crate::container::format::SECTIONS_START) as usize;
    let mut words = vec![0u64; start.div_ceil(8)];
    file.read_at(&mut bytemuck::cast_slice_mut(&mut words)[..start], 0).map_err(io)?;
    let bytes = Container::table_bytes(&bytemuck::cast_slice(&words)[..start], file.bytes()).map_err(wrap)?;
    let mut words: Vec<u64> = Vec::new();
    // At most the file itself, which is more than memory only if somebody made it so.
    words.try_reserve_exact(bytes.div_ceil(8)).map_err(|cause| io(io::Error::other(cause)))?;
    drop(words);
    // Zeroed by the system, page by page as it is read into.
    let mut words = vec![0u64; bytes.div_ceil(8)];
    let table = &mut bytemuck::cast_slice_mut(&mut words)[..bytes];
    let pieces = table.par_chunks_mut(READ_BYTES).enumerate();
    pieces.try_for_each(|(piece, bytes)| file.read_at(bytes, (piece * READ_BYTES) as u64)).map_err(io)?;
    Ok(words)
}

/// The world-space box of a placement of a part.
pub fn instance_box(part: &PartRow, instance: &InstanceRow) -> InstanceBox {
    let [low, high] = part.bounds().map(DVec3::from);
    let transform = instance.transform();
    let half = (high - low) * 0.5;
    let linear = transform.matrix3;
    let absolute = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let stretch = linear.x_axis.length().max(linear.y_axis.length()).max(linear.z_axis.length());
    InstanceBox {
        centre: transform.transform_point3((low + high) * 0.5),
        half_extent: absolute * half,
        diagonal: 2.0 * half.length() * stretch,
    }
}
