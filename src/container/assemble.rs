//! The rows of all tables, and a way to get at each chunk, in; a whole file out.
//!
//! The payload is written first, chunk by chunk; then the tables, which hold the chunks' checksums, into the space left
//! for them, one row after another; then the header. What was written is mapped and checked as a reader would, so that no
//! second copy of the tables is held.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use bytemuck::Pod;
use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3;

use super::encode::refused;
use super::format::*;
use super::groups::Groups;
use super::writer::{Watch, Written};
use super::{Container, ContainerError};
use crate::import::{Material, Node};
use crate::scene::mapped::MappedFile;

/// All tables but those of the chunks and the instances.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    /// The parts, with their first chunks.
    pub parts: Vec<PartRow>,
    pub nodes: Vec<NodeRow>,
    pub materials: Vec<MaterialRow>,
    /// The texts of all names.
    pub names: String,
}

impl Rows {
    /// The rows of parts, each with its name and the number of its source, of nodes and of materials.
    ///
    /// # Errors
    /// More chunks than a file can number.
    pub fn new<'a>(
        parts: impl Iterator<Item = (PartRow, &'a str, u32)>,
        nodes: &'a [Node],
        materials: &'a [Material],
    ) -> Result<Self, ContainerError> {
        let mut names = Names::default();
        let mut chunks = 0u32;
        let mut row_of = |(row, name, source): (PartRow, &'a str, u32)| {
            let (name_offset, name_bytes) = names.place(name);
            let first_chunk = chunks;
            chunks = chunks.checked_add(row.tier_count).ok_or_else(|| {
                refused("the parts".to_owned(), "they have more than 2^32 tiers in all".to_owned())
            })?;
            Ok(PartRow { name_offset, name_bytes, source, first_chunk, ..row })
        };
        let parts = parts.map(&mut row_of).collect::<Result<Vec<PartRow>, ContainerError>>()?;
        let nodes = nodes.iter().map(|node| node_row(node, &mut names)).collect();
        let materials = materials.iter().map(|material| material_row(material, &mut names)).collect();
        Ok(Self { parts, nodes, materials, names: names.blob })
    }

    fn chunk_count(&self) -> usize {
        self.parts.last().map_or(0, |last| (last.first_chunk + last.tier_count) as usize)
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

fn node_row<'a>(node: &'a Node, names: &mut Names<'a>) -> NodeRow {
    let (name_offset, name_bytes) = names.place(&node.name);
    NodeRow { name_offset, name_bytes, parent: node.parent.unwrap_or(NO_PARENT) }
}

fn material_row<'a>(material: &'a Material, names: &mut Names<'a>) -> MaterialRow {
    let (name_offset, name_bytes) = names.place(&material.name);
    MaterialRow { name_offset, name_bytes, base_colour: material.base_colour }
}

/// Writes a file from its first byte to its last and checks its tables; it still needs its name.
///
/// `chunk_of` replaces a buffer by the bytes of the chunk of a part and tier and gives its row; `placed` gives as many
/// instances as it says, the same each time.
///
/// # Errors
/// Those of `chunk_of`, what the system refuses, an interruption, and contents that no container can hold.
pub(crate) fn assemble<I: Iterator<Item = InstanceRow>>(
    file: &File,
    path: &Path,
    rows: Rows,
    placed: (usize, impl Fn() -> I),
    chunk_of: impl FnMut(u32, u32, &mut Vec<u8>) -> Result<ChunkRow, ContainerError>,
    watch: &Watch<'_>,
) -> Result<Written, ContainerError> {
    let io = |cause| ContainerError::Io { doing: "write the container", cause, path: path.to_owned() };
    let groups = Groups::build(&rows.parts, &placed.1);
    let mut sections = Sections::of(&rows, placed.0, &groups);
    let mut out = BufWriter::with_capacity(1 << 20, file);
    let payload = write_payload(&mut out, &rows, sections.payload_offset, chunk_of, watch, &io)?;
    sections.write(&mut out, &rows, &payload.rows, placed.1(), &groups).map_err(io)?;
    sections.write_header(&mut out, payload.end).map_err(io)?;
    out.flush().map_err(io)?;
    drop(out);
    let written =
        Written { file_bytes: payload.end, table_bytes: sections.payload_offset, chunks: payload.rows.len() };
    drop((rows, payload, groups));
    check(path, written.file_bytes)?;
    file.sync_all().map_err(io)?;
    watch.stop_if()?;
    Ok(written)
}

/// The rows of the chunks, part by part, and where the payload ends.
struct Payload {
    rows: Vec<ChunkRow>,
    end: u64,
}

fn write_payload(
    out: &mut BufWriter<&File>,
    rows: &Rows,
    start: u64,
    mut chunk_of: impl FnMut(u32, u32, &mut Vec<u8>) -> Result<ChunkRow, ContainerError>,
    watch: &Watch<'_>,
    io: &impl Fn(io::Error) -> ContainerError,
) -> Result<Payload, ContainerError> {
    let mut payload = Payload { rows: vec![ChunkRow::default(); rows.chunk_count()], end: start };
    let tier_counts: Vec<u32> = rows.parts.iter().map(|part| part.tier_count).collect();
    let mut chunk = Vec::new();
    out.seek(SeekFrom::Start(start)).map_err(io)?;
    for (part, tier) in payload_order(&tier_counts) {
        watch.stop_if()?;
        let row = chunk_of(part, tier, &mut chunk)?;
        chunk.resize(chunk.len().next_multiple_of(ALIGNMENT as usize), 0);
        out.write_all(&chunk).map_err(io)?;
        let number = (rows.parts[part as usize].first_chunk + tier) as usize;
        payload.rows[number] = ChunkRow { offset: payload.end, ..row };
        payload.end += chunk.len() as u64;
        watch.wrote(chunk.len());
    }
    Ok(payload)
}

/// Where the sections lie; their checksums are filled in as they are written.
struct Sections {
    table: [SectionRow; SECTIONS],
    payload_offset: u64,
}

impl Sections {
    fn of(rows: &Rows, instances: usize, groups: &Groups) -> Self {
        let counts = [
            rows.parts.len(),
            rows.chunk_count(),
            instances,
            rows.nodes.len(),
            rows.materials.len(),
            rows.names.len(),
            groups.rows.len(),
            groups.members.len(),
        ];
        let mut payload_offset = SECTIONS_START;
        let mut place = |kind: SectionKind, rows: usize| {
            let offset = payload_offset;
            payload_offset = (offset + (rows * kind.row_bytes()) as u64).next_multiple_of(ALIGNMENT);
            let row_bytes = kind.row_bytes() as u32;
            SectionRow { kind: kind as u32, row_bytes, offset, rows: rows as u64, checksum: 0 }
        };
        let table = std::array::from_fn(|i| place(SectionKind::ALL[i], counts[i]));
        Self { table, payload_offset }
    }

    fn write(
        &mut self,
        out: &mut BufWriter<&File>,
        rows: &Rows,
        chunks: &[ChunkRow],
        instances: impl Iterator<Item = InstanceRow>,
        groups: &Groups,
    ) -> io::Result<()> {
        let [parts, chunk_table, placed, nodes, materials, names, group_table, members] = &mut self.table;
        out.seek(SeekFrom::Start(parts.offset))?;
        write_section(out, parts, rows.parts.iter().copied())?;
        write_section(out, chunk_table, chunks.iter().copied())?;
        write_section(out, placed, instances)?;
        write_section(out, nodes, rows.nodes.iter().copied())?;
        write_section(out, materials, rows.materials.iter().copied())?;
        write_section(out, names, rows.names.bytes())?;
        write_section(out, group_table, groups.rows.iter().copied())?;
        write_section(out, members, groups.members.iter().copied())
    }

    fn write_header(&self, out: &mut BufWriter<&File>, file_bytes: u64) -> io::Result<()> {
        let table = bytemuck::bytes_of(&self.table);
        out.seek(SeekFrom::Start(0))?;
        out.write_all(bytemuck::bytes_of(&header(self.payload_offset, file_bytes, checksum(table))))?;
        out.write_all(table)
    }
}

/// Writes the rows of a section and the zeros up to the next, and notes their checksum.
fn write_section<T: Pod>(
    out: &mut impl Write,
    section: &mut SectionRow,
    rows: impl Iterator<Item = T>,
) -> io::Result<()> {
    let mut hash = Xxh3::new();
    let mut block: Vec<T> = Vec::with_capacity(4096);
    let mut rows = rows.peekable();
    while rows.peek().is_some() {
        block.clear();
        block.extend(rows.by_ref().take(4096));
        let bytes: &[u8] = bytemuck::cast_slice(&block);
        hash.update(bytes);
        out.write_all(bytes)?;
    }
    section.checksum = hash.digest();
    let bytes = section.rows * u64::from(section.row_bytes);
    out.write_all(&[0; ALIGNMENT as usize][..(bytes.next_multiple_of(ALIGNMENT) - bytes) as usize])
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

/// Checks the tables of the file as a reader would; what is wrong with them was wrong with the contents.
fn check(path: &Path, file_bytes: u64) -> Result<(), ContainerError> {
    let unreadable = |cause| ContainerError::Io {
        doing: "read back the container",
        cause: io::Error::other(cause),
        path: path.to_owned(),
    };
    let file = MappedFile::open(path).map_err(unreadable)?;
    match Container::open_tables(file.bytes(), file_bytes) {
        Ok(_) => Ok(()),
        Err(ContainerError::Malformed { place, problem }) => Err(refused(place, problem)),
        Err(other) => Err(other),
    }
}
