//! What is in memory of one part: the chunks of its tiers as they arrive, coarsest first.

use std::ops::Range;
use std::sync::Arc;

use crate::container::{Chunk, ChunkRow, ChunkView};
use crate::geometry::{TriangleRecord, TrianglesAt, VertexRecord};

/// Bytes of memory that a chunk takes once it has arrived, of a tier whose next coarser one has `below` vertices: its own,
/// and those of the counts that are copied out of it.
pub fn bytes_of(row: &ChunkRow, below: u32) -> u64 {
    let added = row.vertices.saturating_sub(below);
    let counts = u64::from(added) + u64::from(added) / 16 + 4 + 8 * u64::from(row.overflow);
    row.plain_bytes(added).next_multiple_of(8) + counts + size_of::<Chunk>() as u64
}

fn bytes_of_chunk(chunk: &Chunk) -> u64 {
    bytes_of(&chunk.spec().row, chunk.spec().vertices_below)
}

/// The arrived chunks of one part.
#[derive(Debug, Default)]
pub struct ResidentPart {
    /// By tier, finest first.
    chunks: Vec<Option<Arc<Chunk>>>,
    /// The finest tier such that it and all coarser ones have arrived; the number of tiers if none has.
    arrived: u32,
    triangles_at: TrianglesAt,
}

impl ResidentPart {
    /// A part of which nothing has arrived.
    pub fn new(tier_count: u32) -> Self {
        let chunks = (0..tier_count).map(|_| None).collect();
        Self { chunks, arrived: tier_count, triangles_at: TrianglesAt::default() }
    }

    /// Takes in a chunk; it counts once all coarser ones are there.
    pub fn arrive(&mut self, tier: u32, chunk: Arc<Chunk>) {
        self.chunks[tier as usize] = Some(chunk);
        while self.arrived > 0
            && let Some(chunk) = &self.chunks[self.arrived as usize - 1]
        {
            let view = chunk.view();
            let overflow: Vec<(u32, u32)> = view.overflow.iter().map(|&[v, t]| (v, t)).collect();
            self.triangles_at.extend(view.added, &overflow);
            self.arrived -= 1;
        }
    }

    /// Takes in all chunks of the same part that arrived elsewhere.
    pub fn arrive_all(&mut self, other: Self) {
        for (tier, chunk) in (0..).zip(other.chunks) {
            if let Some(chunk) = chunk {
                self.arrive(tier, chunk);
            }
        }
    }

    /// Drops the chunks of all tiers finer than this one.
    pub fn keep_from(&mut self, finest: u32) {
        let finest = finest as usize;
        self.chunks.iter_mut().take(finest).for_each(|chunk| *chunk = None);
        if (self.arrived as usize) < finest {
            self.arrived = finest as u32;
            let below = self.chunks.get(finest).and_then(Option::as_ref).map_or(0, |c| c.spec().row.vertices);
            self.triangles_at.truncate(below as usize);
        }
    }

    /// Whether the chunk of a tier is there, though a coarser one may not be.
    pub fn has(&self, tier: u32) -> bool {
        self.chunks.get(tier as usize).is_some_and(Option::is_some)
    }

    /// Bytes of memory that its chunks take.
    pub fn bytes(&self) -> u64 {
        self.chunks.iter().flatten().map(|chunk| bytes_of_chunk(chunk)).sum()
    }

    /// How many vertices have arrived, as a prefix.
    pub fn vertices_arrived(&self) -> u32 {
        self.triangles_at.len() as u32
    }

    /// The finest tier that can be drawn, if any.
    pub fn finest(&self) -> Option<u32> {
        (self.arrived < self.chunks.len() as u32).then_some(self.arrived)
    }

    /// Whether a chunk is there that cannot be drawn, because a coarser one is not.
    pub fn has_gap(&self) -> bool {
        self.chunks[..self.arrived as usize].iter().any(Option::is_some)
    }

    /// Triangles at each vertex count, as far as it has arrived.
    pub fn triangles_at(&self) -> &TrianglesAt {
        &self.triangles_at
    }

    /// A range of the arrived vertices, in pieces in order.
    pub fn vertices(&self, range: Range<u32>) -> impl Iterator<Item = &[VertexRecord]> {
        self.pieces(range).map(|(view, piece)| &view.vertices[piece])
    }

    /// A range of the arrived `ecol` entries, in pieces in order.
    pub fn ecol(&self, range: Range<u32>) -> impl Iterator<Item = &[u16]> {
        self.pieces(range).map(|(view, piece)| &view.ecol[piece])
    }

    /// The chunks that a range of vertices runs through, coarsest first, with the range inside each.
    fn pieces(&self, range: Range<u32>) -> impl Iterator<Item = (ChunkView<'_>, Range<usize>)> {
        let held = self.chunks[self.arrived as usize..].iter().rev().flatten();
        held.filter_map(move |chunk| {
            let start = range.start.max(chunk.spec().vertices_below);
            let end = range.end.min(chunk.spec().row.vertices);
            let local = |vertex: u32| (vertex - chunk.spec().vertices_below) as usize;
            (start < end).then(|| (chunk.view(), local(start)..local(end)))
        })
    }

    /// The triangle list of an arrived tier; empty for one that has not arrived.
    pub fn triangles(&self, tier: u32) -> &[TriangleRecord] {
        match self.chunks.get(tier as usize) {
            Some(Some(chunk)) => chunk.view().triangles,
            _ => &[],
        }
    }
}
