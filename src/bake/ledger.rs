//! What became of each body, as it is done, in; the rows of all parts in the container's order out.
//!
//! A few hundred bytes a part, however large it is: its chunks are on disk by then.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::welded::Welded;
use crate::container::{ChunkRow, ContainerError, EncodedPart, Form, PartRow};
use crate::geometry::body::BodyOutcome;

/// What the weld of a mesh (or of the merged meshes of a body) found, and how many cells it became.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct MeshRow {
    pub welded: Welded,
    /// Its parts of the container; 0 if no triangle had an area.
    pub cells: u64,
}

/// The rows of one body.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct BodyRows {
    pub meshes: Vec<MeshRow>,
    /// The cells of all its meshes, one mesh after another.
    pub parts: Vec<PartRow>,
    /// The chunks of all its parts; their offsets are those in the files of the spill.
    pub chunks: Vec<ChunkRow>,
}

impl BodyRows {
    /// Encodes a body, its chunks in a form if they have it; gives its rows, whose chunks lie one after another in the bytes
    /// beside them, part by part.
    ///
    /// # Errors
    /// A part that no container can hold.
    pub fn encode(
        outcome: &BodyOutcome,
        open_in_file: &[usize],
        form: Form,
    ) -> Result<(Self, Vec<Vec<u8>>), ContainerError> {
        let cells_of = |mesh| outcome.mesh_of.iter().filter(|&&other| other == mesh).count();
        let welds = outcome.welds.iter().zip(open_in_file).enumerate();
        let meshes = welds.map(|(mesh, (counts, &open))| MeshRow {
            welded: Welded::new(counts, open),
            cells: cells_of(mesh) as u64,
        });
        let mut rows = Self { meshes: meshes.collect(), ..Self::default() };
        let mut bytes = Vec::with_capacity(outcome.cells.len());
        for (cell, &mesh) in outcome.cells.iter().zip(&outcome.mesh_of) {
            let encoded = EncodedPart::new(cell, rows.meshes[mesh].cells > 1, form)?;
            rows.parts.push(encoded.row);
            rows.chunks.extend(encoded.chunks);
            bytes.push(encoded.bytes);
        }
        Ok((rows, bytes))
    }

    /// Whether its lists fit each other.
    pub fn is_consistent(&self) -> bool {
        let cells: u64 = self.meshes.iter().fold(0, |sum, mesh| sum.saturating_add(mesh.cells));
        let tiers: u64 = self.parts.iter().map(|part| u64::from(part.tier_count)).sum();
        cells == self.parts.len() as u64 && tiers == self.chunks.len() as u64
    }
}

/// Where the rows of a body lie in the ledger.
#[derive(Debug, Clone, Copy, Default)]
struct Entry {
    meshes: [u32; 2],
    parts: [u32; 2],
    /// The first of its chunks.
    chunks: u32,
    is_done: bool,
}

/// The rows of all bodies that are done.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    bodies: Vec<Entry>,
    meshes: Vec<MeshRow>,
    parts: Vec<PartRow>,
    chunks: Vec<ChunkRow>,
}

fn range([start, end]: [u32; 2]) -> Range<usize> {
    start as usize..end as usize
}

impl Ledger {
    /// A ledger for so many bodies, none of them done.
    pub fn new(bodies: usize) -> Self {
        Self {
            bodies: vec![Entry::default(); bodies],
            meshes: Vec::with_capacity(bodies),
            parts: Vec::with_capacity(bodies),
            chunks: Vec::with_capacity(2 * bodies),
        }
    }

    /// How many bodies there are.
    pub fn body_count(&self) -> usize {
        self.bodies.len()
    }

    /// Whether a body is done.
    pub fn is_done(&self, body: usize) -> bool {
        self.bodies[body].is_done
    }

    /// How many bodies are done.
    pub fn done(&self) -> usize {
        self.bodies.iter().filter(|entry| entry.is_done).count()
    }

    /// Takes in a body that is done.
    pub fn push(&mut self, body: usize, rows: &BodyRows) {
        let (meshes, parts) = (self.meshes.len() as u32, self.parts.len() as u32);
        self.bodies[body] = Entry {
            meshes: [meshes, meshes + rows.meshes.len() as u32],
            parts: [parts, parts + rows.parts.len() as u32],
            chunks: self.chunks.len() as u32,
            is_done: true,
        };
        self.meshes.extend_from_slice(&rows.meshes);
        self.parts.extend_from_slice(&rows.parts);
        self.chunks.extend_from_slice(&rows.chunks);
    }

    /// What became of the meshes of a body.
    pub fn meshes(&self, body: usize) -> &[MeshRow] {
        &self.meshes[range(self.bodies[body].meshes)]
    }

    /// The parts of a body.
    pub fn parts(&self, body: usize) -> &[PartRow] {
        &self.parts[range(self.bodies[body].parts)]
    }

    /// How many parts there are.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }

    /// Bytes of all chunks.
    pub fn payload_bytes(&self) -> u64 {
        self.chunks.iter().map(|chunk| u64::from(chunk.bytes)).sum()
    }

    /// For each part in the container's order the number of its first chunk, its parts' chunks being in a row.
    pub fn chunk_starts(&self) -> Vec<u32> {
        let of_body = |entry: &Entry| {
            let starts = self.parts[range(entry.parts)].iter().scan(entry.chunks, |next, part| {
                *next += part.tier_count;
                Some(*next - part.tier_count)
            });
            starts.collect::<Vec<u32>>()
        };
        self.bodies.iter().flat_map(of_body).collect()
    }

    /// A chunk, by the number that [`Ledger::chunk_starts`] counts.
    pub fn chunk(&self, number: u32) -> &ChunkRow {
        &self.chunks[number as usize]
    }

    /// The chunks of a part, by the number of its first.
    pub fn chunks(&self, first: u32, part: &PartRow) -> &[ChunkRow] {
        &self.chunks[first as usize..(first + part.tier_count) as usize]
    }
}
