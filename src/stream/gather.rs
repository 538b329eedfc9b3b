//! The deltas of one batch in, its grants and the words of its streamed buffer out.
//!
//! A streamed buffer holds all vertices (3 words each), then all `ecol` entries (two a word), then all triangles (2
//! words each), each in the order of the batch's instances: the order in which the prefix sums on the GPU find them.

use std::ops::Range;

use rayon::prelude::*;
use wgpu::WriteOnly;

use super::delta::{Delta, Lack};
use super::{Residency, State, Strategy};
use crate::geometry::TriangleRecord;
use crate::gpu::batch::STREAMS;
use crate::gpu::layout::{DefragmentParams, FRESH, Grant};
use crate::scene::part::ResidentPart;

/// Everything that one batch is sent in a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BatchUpload {
    /// One grant for each instance that changes, by batch-local number.
    pub grants: Vec<Grant>,
    /// What is sent of which part, in the order of `grants`.
    pub lacks: Vec<(u32, u32, Lack)>,
    /// How much of each stream is sent.
    pub layout: StreamedLayout,
    /// How many active elements of each stream the batch then has.
    pub totals: [u64; STREAMS],
}

/// How many elements of each stream a streamed buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamedLayout {
    /// Vertices, of 3 words.
    pub vertices: u64,
    /// `ecol` entries, of half a word.
    pub ecol: u64,
    /// Triangles, of 2 words.
    pub triangles: u64,
}

impl StreamedLayout {
    /// Of everything that is active, as for a batch that is sent as a whole.
    pub fn of_totals([vertices, ecol, triangles]: [u64; STREAMS]) -> Self {
        Self { vertices, ecol, triangles }
    }

    /// Where the `ecol` entries start, in words.
    pub fn ecol_base(self) -> u64 {
        3 * self.vertices
    }

    /// Where the triangles start, in words.
    pub fn triangle_base(self) -> u64 {
        self.ecol_base() + self.ecol.div_ceil(2)
    }

    /// The size of the buffer in words.
    pub fn words(self) -> u64 {
        self.triangle_base() + 2 * self.triangles
    }

    fn add(&mut self, lack: &Lack) {
        self.vertices += lack.vertices.len() as u64;
        self.ecol += lack.ecol.len() as u64;
        self.triangles += lack.triangles.len() as u64;
    }

    /// The uniform of the defragmentation, once the batch's totals are known. All numbers fit 32 bits because the
    /// buffers fit the adapter's limits.
    pub fn params(
        self,
        instance_count: u32,
        [vertex_total, ecol_total, triangle_total]: [u32; 3],
    ) -> DefragmentParams {
        DefragmentParams {
            instance_count,
            vertex_total,
            ecol_total,
            triangle_total,
            vertex_base: 0,
            ecol_base: self.ecol_base() as u32,
            triangle_base: self.triangle_base() as u32,
            padding: 0,
        }
    }
}

impl BatchUpload {
    /// Adds what an instance is sent; deltas come in the order of the batch-local numbers.
    pub fn push(&mut self, local: u32, part: u32, delta: &Delta, strategy: Strategy) {
        let State { vertices, ecol, triangles, tier } = delta.new;
        let all = strategy != Strategy::Coherent;
        let fresh = |yes: bool| if yes { FRESH } else { 0 };
        self.grants.push(Grant {
            instance: local,
            vertices: vertices | fresh(all),
            ecol: ecol | fresh(all),
            triangles: triangles | fresh(all || delta.fresh_triangles()),
        });
        let lack = delta.lack(strategy);
        self.layout.add(&lack);
        self.lacks.push((part, tier, lack));
    }

    /// The words of each part's run of each stream, for sending part by part. Two `ecol` runs may share a word.
    pub fn word_ranges(&self) -> Vec<std::ops::Range<usize>> {
        let mut ranges = Vec::with_capacity(3 * self.lacks.len());
        let mut run = |base: u64, halves: u64, lens: &mut dyn Iterator<Item = u64>| {
            let mut at = 2 * base;
            for len in lens.map(|len| len * halves).filter(|&len| len > 0) {
                ranges.push((at / 2) as usize..(at + len).div_ceil(2) as usize);
                at += len;
            }
        };
        let layout = self.layout;
        let lacks = || self.lacks.iter().map(|(_, _, lack)| lack);
        run(0, 6, &mut lacks().map(|lack| lack.vertices.len() as u64));
        run(layout.ecol_base(), 1, &mut lacks().map(|lack| lack.ecol.len() as u64));
        run(layout.triangle_base(), 4, &mut lacks().map(|lack| lack.triangles.len() as u64));
        ranges
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.grants.is_empty()
    }

    /// Copies the streamed words into `out`, which is exactly that long, in parallel over blocks of it.
    pub fn gather(&self, residency: &Residency, out: WriteOnly<'_, [u8]>) {
        let runs = self.runs(residency);
        let (blocks, rest) = out.into_chunks::<BLOCK>();
        let rest_start = blocks.len() * BLOCK;
        // Only a pointer to an array can go to another thread, not one to a slice.
        let blocks: Vec<WriteOnly<'_, [u8; BLOCK]>> = blocks.into_iter().collect();
        blocks
            .into_par_iter()
            .enumerate()
            .for_each(|(number, block)| fill(&runs, number * BLOCK, block.into()));
        fill(&runs, rest_start, rest);
    }

    /// The streamed words in memory of the host.
    pub fn words(&self, residency: &Residency) -> Vec<u32> {
        let mut words = vec![0u32; self.layout.words() as usize];
        self.gather(residency, bytemuck::cast_slice_mut::<u32, u8>(&mut words).into());
        words
    }

    /// The runs of all parts in the order of the buffer.
    fn runs<'a>(&'a self, residency: &'a Residency) -> Vec<Run<'a>> {
        let mut runs: Vec<Run<'a>> = Vec::with_capacity(3 * self.lacks.len() + 1);
        let mut start = 0;
        let mut push = |source: Source<'a>| {
            let bytes = source.bytes();
            if bytes > 0 {
                runs.push(Run { start, source });
                start += bytes;
            }
        };
        let parts = || self.lacks.iter().map(|(part, tier, lack)| (residency.part(*part), *tier, lack));
        parts().for_each(|(part, _, lack)| push(Source::Vertices(part, lack.vertices.clone())));
        parts().for_each(|(part, _, lack)| push(Source::Ecol(part, lack.ecol.clone())));
        if self.layout.ecol % 2 == 1 {
            push(Source::Padding);
        }
        parts().for_each(|(part, tier, lack)| {
            let range = lack.triangles.start as usize..lack.triangles.end as usize;
            push(Source::Triangles(&part.triangles(tier)[range]));
        });
        runs
    }
}

/// What a thread copies at a time.
const BLOCK: usize = 1 << 14;

/// Consecutive records of one part, at a byte offset of the buffer.
struct Run<'a> {
    start: usize,
    source: Source<'a>,
}

enum Source<'a> {
    Vertices(&'a ResidentPart, Range<u32>),
    Ecol(&'a ResidentPart, Range<u32>),
    Triangles(&'a [TriangleRecord]),
    /// Half a word between the last `ecol` entry and the first triangle.
    Padding,
}

impl Source<'_> {
    fn bytes(&self) -> usize {
        match self {
            Self::Vertices(_, range) => range.len() * 12,
            Self::Ecol(_, range) => range.len() * 2,
            Self::Triangles(records) => size_of_val(*records),
            Self::Padding => 2,
        }
    }

    /// Calls `put` with the bytes, piece by piece in order.
    fn for_each_piece(&self, mut put: impl FnMut(&[u8])) {
        match self {
            Self::Vertices(part, range) => {
                part.vertices(range.clone()).for_each(|piece| put(bytemuck::cast_slice(piece)));
            }
            Self::Ecol(part, range) => {
                part.ecol(range.clone()).for_each(|piece| put(bytemuck::cast_slice(piece)));
            }
            Self::Triangles(records) => put(bytemuck::cast_slice(records)),
            Self::Padding => put(&[0; 2]),
        }
    }
}

/// Fills the part of the buffer that starts at byte `start`.
fn fill(runs: &[Run<'_>], start: usize, mut out: WriteOnly<'_, [u8]>) {
    let end = start + out.len();
    let first = runs.partition_point(|run| run.start + run.source.bytes() <= start);
    for run in runs[first..].iter().take_while(|run| run.start < end) {
        let mut at = run.start;
        run.source.for_each_piece(|piece| {
            let (from, to) = (at.max(start), (at + piece.len()).min(end));
            if from < to {
                out.slice(from - start..to - start).copy_from_slice(&piece[from - at..to - at]);
            }
            at += piece.len();
        });
    }
}
