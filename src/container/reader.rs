//! Bytes of a file in, a [`Container`] out whose every row may be used without another check.

use std::collections::VecDeque;
use std::ops::Range;

use bytemuck::Pod;

use super::ContainerError;
use super::check::{Tables, part_chunks};
use super::chunk::{ChunkSpec, ChunkView};
use super::format::*;
use super::stored::Chunk;
use crate::geometry::{OrderedPart, OrderedTier, TrianglesAt};

/// A container whose header and tables were checked; it borrows the file's bytes.
#[derive(Debug, Clone, Copy)]
pub struct Container<'a> {
    bytes: &'a [u8],
    header: Header,
    sections: [SectionRow; SECTIONS],
    parts: &'a [PartRow],
    chunks: &'a [ChunkRow],
    instances: &'a [InstanceRow],
    nodes: &'a [NodeRow],
    materials: &'a [MaterialRow],
    names: &'a str,
    groups: &'a [GroupRow],
    members: &'a [u32],
}

impl<'a> Container<'a> {
    /// Checks the header and all tables of a whole file. Never reads the payload.
    ///
    /// `bytes` start at an address that is a multiple of 8, as every mapped file does.
    ///
    /// # Errors
    /// Anything that is not as `docs/format.md` says.
    pub fn open(bytes: &'a [u8]) -> Result<Self, ContainerError> {
        Self::open_tables(bytes, bytes.len() as u64)
    }

    /// As [`open`](Self::open), from the first bytes of a file of `file_bytes` bytes: at least all that precedes the
    /// payload. [`chunks`](Self::chunks) then gives an error for every chunk that lies beyond them.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_tables(bytes: &'a [u8], file_bytes: u64) -> Result<Self, ContainerError> {
        let header = read_header(bytes, file_bytes)?;
        if (bytes.len() as u64) < header.payload_offset {
            return Err(ContainerError::Truncated { have: bytes.len() as u64, need: header.payload_offset });
        }
        let sections = read_section_table(bytes, &header)?;
        let mut next = SECTIONS_START;
        let mut section = |row: &SectionRow, kind| section_bytes(bytes, &header, row, kind, &mut next);
        let [parts, chunks, instances, nodes, materials, names, groups, members] = &sections;
        let tables = Tables {
            parts: cast(section(parts, SectionKind::Parts)?)?,
            chunks: cast(section(chunks, SectionKind::Chunks)?)?,
            instances: cast(section(instances, SectionKind::Instances)?)?,
            nodes: cast(section(nodes, SectionKind::Nodes)?)?,
            materials: cast(section(materials, SectionKind::Materials)?)?,
            names: text(section(names, SectionKind::Names)?)?,
            groups: cast(section(groups, SectionKind::Groups)?)?,
            members: cast(section(members, SectionKind::Members)?)?,
        };
        if next != header.payload_offset {
            return Err(malformed(
                "the payload",
                format!("it does not start at byte {next}, after the sections"),
            ));
        }
        tables.check(&header)?;
        let Tables { parts, chunks, instances, nodes, materials, names, groups, members } = tables;
        Ok(Self {
            bytes,
            header,
            sections,
            parts,
            chunks,
            instances,
            nodes,
            materials,
            names,
            groups,
            members,
        })
    }

    /// How many bytes precede the payload, by the first bytes of a file: those before the first section, if it has so
    /// many.
    ///
    /// # Errors
    /// A header or a section table that is not as `docs/format.md` says.
    pub fn table_bytes(start: &[u8], file_bytes: u64) -> Result<usize, ContainerError> {
        let header = read_header(start, file_bytes)?;
        read_section_table(start, &header)?;
        let too_large = || malformed("the header", "its tables are larger than memory can be".to_owned());
        usize::try_from(header.payload_offset).map_err(|_| too_large())
    }

    /// Where the rows of a section lie in the file.
    pub fn section_range(&self, kind: SectionKind) -> Range<usize> {
        let row = &self.sections[kind as usize - 1];
        // In range: the section has been cut out of the bytes.
        let start = row.offset as usize;
        start..start + (row.rows * u64::from(row.row_bytes)) as usize
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The sections with their sizes in bytes, without padding.
    pub fn section_bytes(&self) -> [(SectionKind, u64); SECTIONS] {
        std::array::from_fn(|i| {
            (SectionKind::ALL[i], self.sections[i].rows * u64::from(self.sections[i].row_bytes))
        })
    }

    /// The parts.
    pub fn parts(&self) -> &'a [PartRow] {
        self.parts
    }

    /// The instances.
    pub fn instances(&self) -> &'a [InstanceRow] {
        self.instances
    }

    /// The assembly tree, parents before children.
    pub fn nodes(&self) -> &'a [NodeRow] {
        self.nodes
    }

    /// The groups of instances, each before those below it; the first holds all.
    pub fn groups(&self) -> &'a [GroupRow] {
        self.groups
    }

    /// All instances, in the order in which groups hold them.
    pub fn members(&self) -> &'a [u32] {
        self.members
    }

    /// The materials.
    pub fn materials(&self) -> &'a [MaterialRow] {
        self.materials
    }

    /// The chunk rows of a part, finest tier first; empty if there is no such part.
    pub fn chunk_rows(&self, part: usize) -> &'a [ChunkRow] {
        self.parts.get(part).map_or(&[], |row| part_chunks(self.chunks, row))
    }

    /// The name of a part, as the model's file had it; empty if there is no such part.
    pub fn part_name(&self, part: usize) -> &'a str {
        self.parts.get(part).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    /// The name of a node of the assembly tree; empty if there is no such node.
    pub fn node_name(&self, node: usize) -> &'a str {
        self.nodes.get(node).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    /// The name of a material; empty if there is no such material.
    pub fn material_name(&self, material: usize) -> &'a str {
        self.materials.get(material).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    fn name(&self, offset: u64, bytes: u32) -> &'a str {
        let start = offset as usize;
        self.names.get(start..start + bytes as usize).unwrap_or("")
    }

    /// What the chunk of a part's tier must hold: enough for a worker to read it ([`Chunk::read`]).
    ///
    /// # Errors
    /// [`ContainerError::NoSuchChunk`].
    pub fn chunk_spec(&self, part: usize, tier: usize) -> Result<ChunkSpec, ContainerError> {
        let rows = self.chunk_rows(part);
        if tier >= rows.len() {
            return Err(ContainerError::NoSuchChunk { part, tier });
        }
        Ok(ChunkSpec::new(part as u32, &self.parts[part], rows, tier))
    }

    /// Where the chunk of a part's tier lies in the file.
    ///
    /// # Errors
    /// [`ContainerError::NoSuchChunk`].
    pub fn chunk_range(&self, part: usize, tier: usize) -> Result<Range<u64>, ContainerError> {
        self.chunk_spec(part, tier).map(|spec| spec.range())
    }

    /// Reads and checks the chunks of a part from a tier on, the finest first.
    ///
    /// # Errors
    /// As [`Chunk::read`], and [`ContainerError::NoSuchChunk`].
    pub fn chunks(&self, part: usize, tier: usize) -> Result<Vec<Chunk>, ContainerError> {
        self.chunk_spec(part, tier)?;
        let mut chunks: VecDeque<Chunk> = VecDeque::new();
        for tier in (tier..self.chunk_rows(part).len()).rev() {
            let spec = self.chunk_spec(part, tier)?;
            let stored = self.file_range(spec.range())?;
            let read = |bytes: &mut [u8]| {
                bytes.copy_from_slice(stored);
                Ok(())
            };
            chunks.push_front(Chunk::read(spec, &chunks.iter().collect::<Vec<_>>(), read)?);
        }
        Ok(chunks.into())
    }

    /// The bytes of a range of the file.
    pub(super) fn file_range(&self, range: Range<u64>) -> Result<&'a [u8], ContainerError> {
        let cut = || ContainerError::Truncated { have: self.bytes.len() as u64, need: range.end };
        let place = usize::try_from(range.start).ok().zip(usize::try_from(range.end).ok());
        place.and_then(|(start, end)| self.bytes.get(start..end)).ok_or_else(cut)
    }

    /// Puts a whole part together again.
    ///
    /// # Errors
    /// As [`chunks`](Self::chunks).
    pub fn read_part(&self, part: usize) -> Result<OrderedPart, ContainerError> {
        let row = self.parts.get(part).ok_or(ContainerError::NoSuchChunk { part, tier: 0 })?;
        let chunks = self.chunks(part, 0)?;
        Ok(join(row, &chunks.iter().map(Chunk::view).collect::<Vec<_>>()))
    }
}

/// Joins a part's chunks, finest first.
pub(super) fn join(row: &PartRow, views: &[ChunkView]) -> OrderedPart {
    let mut part = OrderedPart {
        grid: row.grid(),
        attributes: row.attributes(),
        vertices: Vec::new(),
        ecol: Vec::new(),
        triangles_at: TrianglesAt::from_parts(Vec::new(), Vec::new()),
        tiers: views.iter().map(|view| tier_of(view)).collect(),
        locked: row.locked,
        errors: row.errors,
        stall: row.stall(),
        place: row.place(),
        closure: row.closure(),
    };
    for (view, tier) in views.iter().zip(&mut part.tiers).rev() {
        part.vertices.extend_from_slice(view.vertices);
        part.ecol.extend_from_slice(view.ecol);
        let overflow: Vec<(u32, u32)> =
            view.overflow.iter().map(|&[vertex, count]| (vertex, count)).collect();
        part.triangles_at.extend(view.added, &overflow);
        tier.vertices = part.vertices.len() as u32;
    }
    part
}

/// The tier of a chunk, its vertex count not yet known.
fn tier_of(view: &ChunkView) -> OrderedTier {
    OrderedTier { vertices: 0, triangles: view.triangles.to_vec() }
}

fn malformed(place: &str, problem: String) -> ContainerError {
    ContainerError::Malformed { place: place.to_owned(), problem }
}

/// The header, if it is one of this version and of a file of this length.
fn read_header(bytes: &[u8], file_bytes: u64) -> Result<Header, ContainerError> {
    check_magic(bytes)?;
    let truncated = |need| ContainerError::Truncated { have: bytes.len() as u64, need };
    let version = bytes.get(8..12).ok_or(truncated(size_of::<Header>() as u64))?;
    let found: u32 = bytemuck::pod_read_unaligned(version);
    if found != VERSION {
        return Err(ContainerError::Version { found });
    }
    let start = bytes.get(..size_of::<Header>()).ok_or(truncated(size_of::<Header>() as u64))?;
    let header: Header = bytemuck::pod_read_unaligned(start);
    if header.header_checksum != header.own_checksum() {
        return Err(ContainerError::Checksum { what: "the header".to_owned() });
    }
    if file_bytes < header.file_bytes {
        return Err(ContainerError::Truncated { have: file_bytes, need: header.file_bytes });
    }
    check_header(&header, file_bytes).map_err(|problem| malformed("the header", problem))?;
    Ok(header)
}

fn check_magic(bytes: &[u8]) -> Result<(), ContainerError> {
    let start = &bytes[..bytes.len().min(MAGIC.len())];
    if start == MAGIC {
        Ok(())
    } else if MAGIC.starts_with(start) {
        Err(ContainerError::Truncated { have: start.len() as u64, need: size_of::<Header>() as u64 })
    } else if start.len() > 4 && start[1..5] == MAGIC[1..5] {
        Err(ContainerError::TextMode)
    } else {
        Err(ContainerError::NotAContainer)
    }
}

fn check_header(header: &Header, file_bytes: u64) -> Result<(), String> {
    if file_bytes > header.file_bytes {
        return Err(format!("the file has {file_bytes} bytes, and should have {}", header.file_bytes));
    }
    if header.section_count as usize != SECTIONS || header.reserved != 0 {
        return Err("its section count or reserved bytes are not those of version 1".to_owned());
    }
    let end = header.payload_offset.checked_add(header.payload_bytes);
    if header.payload_offset < SECTIONS_START || end != Some(header.file_bytes) {
        return Err("the payload does not lie between the sections and the end of the file".to_owned());
    }
    Ok(())
}

fn read_section_table(bytes: &[u8], header: &Header) -> Result<[SectionRow; SECTIONS], ContainerError> {
    let (have, need) = (bytes.len() as u64, SECTIONS_START);
    let table =
        bytes.get(size_of::<Header>()..need as usize).ok_or(ContainerError::Truncated { have, need })?;
    if checksum(table) != header.table_checksum {
        return Err(ContainerError::Checksum { what: "the section table".to_owned() });
    }
    Ok(bytemuck::pod_read_unaligned(table))
}

/// The bytes of a section, whose row is where and what it must be; `next` moves from its start to that of the next.
fn section_bytes<'a>(
    bytes: &'a [u8],
    header: &Header,
    row: &SectionRow,
    kind: SectionKind,
    next: &mut u64,
) -> Result<&'a [u8], ContainerError> {
    let wrong = |problem: &str| malformed(&format!("the section of {}", kind.name()), problem.to_owned());
    if row.kind != kind as u32 || row.row_bytes as usize != kind.row_bytes() || row.offset != *next {
        return Err(wrong("its kind, row size or offset is not the one of version 1"));
    }
    let end = row.rows.checked_mul(u64::from(row.row_bytes)).and_then(|size| row.offset.checked_add(size));
    let padded = end.and_then(aligned).filter(|&end| end <= header.payload_offset);
    let (Some(end), Some(padded)) = (end, padded) else {
        return Err(wrong("its rows reach into the payload"));
    };
    // In range: the payload's offset, which fits a usize, is not below either.
    let (section, padding) = (&bytes[*next as usize..end as usize], &bytes[end as usize..padded as usize]);
    if checksum(section) != row.checksum {
        return Err(ContainerError::Checksum { what: format!("the section of {}", kind.name()) });
    }
    if padding.iter().any(|&byte| byte != 0) {
        return Err(wrong("the bytes after it are not zero"));
    }
    *next = padded;
    Ok(section)
}

fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], ContainerError> {
    bytemuck::try_cast_slice(bytes).map_err(|_| ContainerError::Misaligned)
}

fn text(bytes: &[u8]) -> Result<&str, ContainerError> {
    std::str::from_utf8(bytes).map_err(|_| malformed("the section of names", "it is not UTF-8".to_owned()))
}
