//! Ordered parts, instances, nodes and materials in; a complete file under the final name, or none, out.
//!
//! The payload is written first, chunk by chunk, into a temporary file in the output's folder; then the tables, which
//! hold the chunks' checksums, into the space left for them; then the file is synchronised and renamed. The bytes
//! follow from the contents alone.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DAffine3;
use rustc_hash::FxHashMap;
use tempfile::NamedTempFile;

use super::format::*;
use super::{Container, ContainerError};
use crate::geometry::OrderedPart;
use crate::geometry::record::Attributes;
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

/// Writes a container: the same bytes for the same contents, and all of them or no file.
///
/// `cancelled` is looked at before every chunk and before the file gets its name.
///
/// # Errors
/// Contents that no container can hold, a missing folder, anything that the system refuses, and
/// [`ContainerError::Interrupted`]. After each of them nothing of the new file is left; an older file of that name is
/// kept.
pub fn write(path: &Path, contents: &Contents, cancelled: &AtomicBool) -> Result<Written, ContainerError> {
    let mut layout = Layout::of(contents)?;
    let file = temporary_beside(path)?;
    let io = |doing| move |cause| ContainerError::Io { doing, cause, path: path.to_owned() };
    let mut out = BufWriter::with_capacity(1 << 20, &file);
    out.seek(SeekFrom::Start(layout.payload_offset)).map_err(io("write the container"))?;
    let payload = write_payload(&mut out, contents, &layout, cancelled, io("write the container"))?;
    let tables = layout.tables(contents, &payload)?;
    out.seek(SeekFrom::Start(0)).map_err(io("write the container"))?;
    out.write_all(bytemuck::cast_slice(&tables)).map_err(io("write the container"))?;
    out.flush().map_err(io("write the container"))?;
    drop(out);
    file.as_file().sync_all().map_err(io("write the container"))?;
    stop_if(cancelled)?;
    file.persist(path).map_err(|refused| io("give the container its name")(refused.error))?;
    Ok(Written { file_bytes: payload.end, table_bytes: layout.payload_offset, chunks: payload.rows.len() })
}

fn stop_if(cancelled: &AtomicBool) -> Result<(), ContainerError> {
    if cancelled.load(Ordering::Relaxed) { Err(ContainerError::Interrupted) } else { Ok(()) }
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

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
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

/// The rows of the chunks, part by part, and where the payload ends.
struct Payload {
    rows: Vec<ChunkRow>,
    end: u64,
}

fn write_payload(
    out: &mut impl Write,
    contents: &Contents,
    layout: &Layout,
    cancelled: &AtomicBool,
    io: impl Fn(io::Error) -> ContainerError,
) -> Result<Payload, ContainerError> {
    let mut rows = vec![ChunkRow::default(); layout.chunks];
    let mut offset = layout.payload_offset;
    let mut chunk = Vec::new();
    for (part, tier) in payload_order(&layout.tier_counts) {
        stop_if(cancelled)?;
        let row = encode_chunk(&contents.parts[part as usize].part, tier as usize, offset, &mut chunk);
        chunk.resize(chunk.len().next_multiple_of(ALIGNMENT as usize), 0);
        out.write_all(&chunk).map_err(&io)?;
        offset += chunk.len() as u64;
        rows[(layout.first_chunks[part as usize] + tier) as usize] = row;
    }
    Ok(Payload { rows, end: offset })
}

/// Replaces `out` by the bytes of a part's tier, without padding; the part has passed [`check_part`].
fn encode_chunk(part: &OrderedPart, tier: usize, offset: u64, out: &mut Vec<u8>) -> ChunkRow {
    let OrderedPart { tiers, vertices, ecol, triangles_at, .. } = part;
    let below = tiers.get(tier + 1).map_or(0, |coarser| coarser.vertices);
    let added = below as usize..tiers[tier].vertices as usize;
    let overflow: Vec<[u32; 2]> = triangles_at
        .overflow()
        .iter()
        .filter(|entry| added.contains(&(entry.0 as usize)))
        .map(|&(vertex, count)| [vertex, count])
        .collect();
    out.clear();
    out.extend_from_slice(bytemuck::cast_slice(&tiers[tier].triangles));
    out.extend_from_slice(bytemuck::cast_slice(&vertices[added.clone()]));
    out.extend_from_slice(bytemuck::cast_slice(&overflow));
    out.extend_from_slice(bytemuck::cast_slice(&ecol[added.clone()]));
    out.extend_from_slice(&triangles_at.bytes()[added]);
    ChunkRow {
        offset,
        bytes: out.len() as u32,
        vertices: tiers[tier].vertices,
        triangles: tiers[tier].triangles.len() as u32,
        overflow: overflow.len() as u32,
        checksum: checksum(out),
    }
}

/// The texts of all names, each distinct one once.
#[derive(Default)]
struct Names<'a> {
    blob: String,
    known: FxHashMap<&'a str, u64>,
}

impl<'a> Names<'a> {
    /// Offset and length of a name. A length that does not fit is refused when the tables are checked.
    fn place(&mut self, name: &'a str) -> (u64, u32) {
        let blob = &mut self.blob;
        let offset = *self.known.entry(name).or_insert_with(|| {
            blob.push_str(name);
            (blob.len() - name.len()) as u64
        });
        (offset, u32::try_from(name.len()).unwrap_or(u32::MAX))
    }
}

/// Where everything will lie, and the rows that do not depend on the payload.
struct Layout {
    parts: Vec<PartRow>,
    nodes: Vec<NodeRow>,
    materials: Vec<MaterialRow>,
    names: String,
    /// Tiers of each part, and the number of its first chunk row.
    tier_counts: Vec<u32>,
    first_chunks: Vec<u32>,
    chunks: usize,
    sections: [SectionRow; SECTIONS],
    payload_offset: u64,
}

impl Layout {
    fn of(contents: &Contents) -> Result<Self, ContainerError> {
        for (index, stored) in contents.parts.iter().enumerate() {
            check_part(&stored.part).map_err(|problem| refused(format!("part {index}"), problem))?;
        }
        let tier_counts: Vec<u32> =
            contents.parts.iter().map(|stored| stored.part.tiers.len() as u32).collect();
        let (first_chunks, chunks) = exclusive_sums(&tier_counts)?;
        let mut names = Names::default();
        let parts = contents
            .parts
            .iter()
            .zip(&first_chunks)
            .map(|(part, &first)| part_row(part, first, &mut names))
            .collect();
        let nodes = contents.nodes.iter().map(|node| node_row(node, &mut names)).collect();
        let materials =
            contents.materials.iter().map(|material| material_row(material, &mut names)).collect();
        let mut layout = Self {
            parts,
            nodes,
            materials,
            names: names.blob,
            tier_counts,
            first_chunks,
            chunks,
            sections: Default::default(),
            payload_offset: SECTIONS_START,
        };
        layout.place_sections(contents.instances.len());
        Ok(layout)
    }

    fn place_sections(&mut self, instances: usize) {
        let counts = [
            self.parts.len(),
            self.chunks,
            instances,
            self.nodes.len(),
            self.materials.len(),
            self.names.len(),
        ];
        for ((row, kind), rows) in self.sections.iter_mut().zip(SectionKind::ALL).zip(counts) {
            *row = SectionRow {
                kind: kind as u32,
                row_bytes: kind.row_bytes() as u32,
                offset: self.payload_offset,
                rows: rows as u64,
                checksum: 0,
            };
            let end = self.payload_offset + (rows * kind.row_bytes()) as u64;
            self.payload_offset = end.next_multiple_of(ALIGNMENT);
        }
    }

    /// Everything before the payload, as words so that it is aligned; checked as a reader would.
    fn tables(&mut self, contents: &Contents, payload: &Payload) -> Result<Vec<u64>, ContainerError> {
        let instances: Vec<InstanceRow> = contents.instances.iter().map(instance_row).collect();
        let sections: [&[u8]; SECTIONS] = [
            bytemuck::cast_slice(&self.parts),
            bytemuck::cast_slice(&payload.rows),
            bytemuck::cast_slice(&instances),
            bytemuck::cast_slice(&self.nodes),
            bytemuck::cast_slice(&self.materials),
            self.names.as_bytes(),
        ];
        let mut words = vec![0u64; self.payload_offset as usize / size_of::<u64>()];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
        for (row, section) in self.sections.iter_mut().zip(sections) {
            row.checksum = checksum(section);
            bytes[row.offset as usize..][..section.len()].copy_from_slice(section);
        }
        let table = bytemuck::bytes_of(&self.sections);
        let header = header(self.payload_offset, payload.end, checksum(table));
        bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        bytes[size_of::<Header>()..SECTIONS_START as usize].copy_from_slice(table);
        Container::open_tables(bytes, payload.end).map_err(|error| match error {
            ContainerError::Malformed { place, problem } => refused(place, problem),
            other => other,
        })?;
        Ok(words)
    }
}

fn refused(place: String, problem: String) -> ContainerError {
    ContainerError::Contents { place, problem }
}

fn header(payload_offset: u64, file_bytes: u64, table_checksum: u64) -> Header {
    let mut header = Header {
        magic: MAGIC,
        version: VERSION,
        section_count: SECTIONS as u32,
        file_bytes,
        payload_offset,
        payload_bytes: file_bytes - payload_offset,
        reserved: 0,
        table_checksum,
        header_checksum: 0,
    };
    header.header_checksum = header.own_checksum();
    header
}

/// The number of the first chunk row of each part, and how many there are in all.
fn exclusive_sums(counts: &[u32]) -> Result<(Vec<u32>, usize), ContainerError> {
    let mut total = 0u32;
    let mut sums = Vec::with_capacity(counts.len());
    for &count in counts {
        sums.push(total);
        total = total
            .checked_add(count)
            .ok_or_else(|| refused("the parts".to_owned(), "more than 2^32 tiers in all".to_owned()))?;
    }
    Ok((sums, total as usize))
}

/// What [`encode_chunk`] and the rows rely on; everything else is checked with the tables.
fn check_part(part: &OrderedPart) -> Result<(), String> {
    let m = part.vertices.len();
    if m == 0 {
        return Err("it has no vertices".to_owned());
    }
    if [part.ecol.len(), part.triangles_at.len()] != [m, m] {
        return Err(format!("its lists differ in length, {m} vertices, {} ecol", part.ecol.len()));
    }
    if part.tiers.first().is_none_or(|finest| finest.vertices as usize != m) {
        return Err(format!("its finest tier does not have all {m} vertices"));
    }
    if !part.tiers.is_sorted_by(|finer, coarser| finer.vertices > coarser.vertices) {
        return Err("its tiers do not have fewer and fewer vertices".to_owned());
    }
    if part.locked as usize > m {
        return Err(format!("its coarsest state has {} of {m} vertices", part.locked));
    }
    let most = crate::geometry::record::MAX_PART_TRIANGLES;
    if part.tiers.iter().any(|tier| tier.triangles.len() > most) {
        return Err(format!("it has more than {most} triangles"));
    }
    Ok(())
}

fn part_row<'a>(stored: &'a StoredPart, first_chunk: u32, names: &mut Names<'a>) -> PartRow {
    let StoredPart { part, name, source, cell } = stored;
    let (name_offset, name_bytes) = names.place(name);
    let flag = |is, flag| if is { flag } else { 0 };
    let (grid_low, grid_high) = grid_box(part);
    PartRow {
        origin: part.grid.origin,
        step_exponent: part.grid.step_exponent,
        flags: flag(part.attributes == Attributes::Colour, PartRow::COLOURED)
            | flag(part.attributes == Attributes::Slot, PartRow::SLOTTED)
            | flag(*cell, PartRow::CELL),
        grid_low,
        grid_high,
        vertices: part.vertices.len() as u32,
        triangles: part.tiers.first().map_or(0, |finest| finest.triangles.len() as u32),
        locked: part.locked,
        coarsest_triangles: part.triangles_at.count_at(part.locked as usize),
        name_offset,
        name_bytes,
        source: *source,
        first_chunk,
        tier_count: part.tiers.len() as u32,
        errors: part.errors,
        stall: part.stall as u8,
        reserved: [0; 3],
        parent_distance: part.place.parent_distance,
        leaf_cells: part.place.leaf_cells,
        slots: slots(part),
    }
}

/// How many material slots the vertices of a part use.
pub(crate) fn slots(part: &OrderedPart) -> u32 {
    let used = part.vertices.iter().map(|vertex| Attributes::Slot.tag(vertex.attributes()) + 1);
    if part.attributes == Attributes::Slot { used.max().unwrap_or(0) } else { 0 }
}

/// The least and greatest grid coordinates of a part's vertices.
fn grid_box(part: &OrderedPart) -> ([u32; 3], [u32; 3]) {
    let mut grids = part.vertices.iter().map(|vertex| vertex.grid());
    let first = grids.next().unwrap_or_default();
    grids.fold((first, first), |(low, high), grid| {
        let least = std::array::from_fn(|axis| grid[axis].min(low[axis]));
        (least, std::array::from_fn(|axis| grid[axis].max(high[axis])))
    })
}

fn node_row<'a>(node: &'a Node, names: &mut Names<'a>) -> NodeRow {
    let (name_offset, name_bytes) = names.place(&node.name);
    NodeRow { name_offset, name_bytes, parent: node.parent.unwrap_or(NO_PARENT) }
}

fn material_row<'a>(material: &'a Material, names: &mut Names<'a>) -> MaterialRow {
    let (name_offset, name_bytes) = names.place(&material.name);
    MaterialRow { name_offset, name_bytes, base_colour: material.base_colour }
}

fn instance_row(instance: &StoredInstance) -> InstanceRow {
    let StoredInstance { part, node, material, world_from_part } = instance;
    InstanceRow {
        part: *part,
        node: *node,
        material: *material,
        flags: 0,
        world_from_part: world_from_part.to_cols_array(),
    }
}
