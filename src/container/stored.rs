//! A chunk's stored bytes in, in one of three forms; the chunk as it is in memory out; and back.

use std::ops::RangeInclusive;

use super::ContainerError;
use super::chunk::{ChunkSpec, ChunkView};
use super::compress::{Lists, compress, decompress};
use super::format::{ChunkRow, Form, checksum};
use super::splits::Contradiction;
use crate::geometry::{TriangleRecord, VertexRecord};

/// A compressed chunk is not believed to be more than so many times as long in memory: what claims to is refused before
/// memory is taken.
const MOST_RATIO: u64 = 256;

/// How many bytes a chunk that adds so many vertices may have in the file.
pub(super) fn stored_bytes(form: Form, row: &ChunkRow, added: u32) -> RangeInclusive<u64> {
    let plain = row.plain_bytes(added);
    let narrow = plain - u64::from(row.triangles);
    match form {
        Form::Plain => plain..=plain,
        Form::Narrow => narrow..=narrow,
        Form::Compressed => plain.div_ceil(MOST_RATIO)..=plain,
    }
}

/// Replaces `out` by the stored bytes of a chunk, in the form that is asked for or the next plainer one that it has; tells
/// which.
pub(super) fn encode(
    spec: &ChunkSpec,
    view: &ChunkView<'_>,
    coarser: &[TriangleRecord],
    vertices: &[VertexRecord],
    form: Form,
    out: &mut Vec<u8>,
) -> Form {
    let is_narrow = view.triangles.iter().all(|triangle| triangle.flags < 256);
    if form == Form::Compressed && compress(spec, view, coarser, vertices, out) {
        let allowed = stored_bytes(form, &spec.row, spec.added_vertices());
        let narrow = stored_bytes(Form::Narrow, &spec.row, spec.added_vertices());
        if allowed.contains(&(out.len() as u64)) && (out.len() as u64) < *narrow.start() {
            return form;
        }
    }
    out.clear();
    if form == Form::Plain || !is_narrow {
        out.extend_from_slice(bytemuck::cast_slice(view.triangles));
    } else {
        let corners = view.triangles.iter().flat_map(|triangle| triangle.vertices);
        out.extend(corners.flat_map(u16::to_le_bytes));
    }
    out.extend_from_slice(bytemuck::cast_slice(view.vertices));
    out.extend_from_slice(bytemuck::cast_slice(view.overflow));
    out.extend_from_slice(bytemuck::cast_slice(view.ecol));
    out.extend_from_slice(view.added);
    if form == Form::Plain || !is_narrow {
        return Form::Plain;
    }
    out.extend(view.triangles.iter().map(|triangle| triangle.flags as u8));
    Form::Narrow
}

/// A chunk read from the file and checked, as it is in memory whatever its form was.
#[derive(Debug)]
pub struct Chunk {
    spec: ChunkSpec,
    /// The bytes, in words of 8 so that records are aligned.
    words: Vec<u64>,
}

impl Chunk {
    /// Reads and checks a chunk; `fill` puts its stored bytes into a buffer, the only place where the disk may be waited
    /// for. `coarser` are the chunks of all coarser tiers, the next coarser one first; only a
    /// [`Form::Compressed`] chunk needs them.
    ///
    /// What comes back is sound by itself: every index is below the tier's vertex count, every walk along `ecol` goes
    /// down and ends at a locked vertex, and the added triangles sum up to the list's length.
    ///
    /// # Errors
    /// Those of `fill`; bytes that do not match their checksum or contradict the tables or the coarser tiers.
    pub fn read(
        spec: ChunkSpec,
        coarser: &[&Self],
        fill: impl FnOnce(&mut [u8]) -> Result<(), ContainerError>,
    ) -> Result<Self, ContainerError> {
        let chunk = Self::unchecked(spec, coarser, fill)?;
        chunk.view().check_all(&chunk.spec)?;
        Ok(chunk)
    }

    /// As [`read`](Self::read), without checking what is not needed to decode it.
    pub(super) fn unchecked(
        spec: ChunkSpec,
        coarser: &[&Self],
        fill: impl FnOnce(&mut [u8]) -> Result<(), ContainerError>,
    ) -> Result<Self, ContainerError> {
        let malformed = |problem: String| ContainerError::Malformed { place: spec.place(), problem };
        let bytes = spec.row.bytes as usize;
        let mut words = vec![0u64; bytes.div_ceil(8)];
        let stored = &mut bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..bytes];
        fill(stored)?;
        if checksum(stored) != spec.row.checksum {
            return Err(ContainerError::Checksum { what: spec.place() });
        }
        // The opened container has made sure of both.
        let form =
            spec.row.form().ok_or_else(|| malformed(format!("its form is {}, unknown", spec.row.form)))?;
        if !stored_bytes(form, &spec.row, spec.added_vertices()).contains(&(bytes as u64)) {
            return Err(malformed(format!("its counts do not fit its {bytes} bytes")));
        }
        let words = match form {
            Form::Plain => words,
            Form::Narrow => widened(&spec, stored),
            Form::Compressed => decoded(&spec, stored, coarser).map_err(|Contradiction(what)| {
                malformed(format!("its compressed form is damaged: {what}"))
            })?,
        };
        let chunk = Self { spec, words };
        ChunkView::cut(&chunk.spec, chunk.raw())?;
        Ok(chunk)
    }

    fn raw(&self) -> &[u8] {
        &bytemuck::cast_slice::<u64, u8>(&self.words)[..self.spec.plain_bytes() as usize]
    }

    /// Its data.
    pub fn view(&self) -> ChunkView<'_> {
        #[expect(clippy::expect_used, reason = "`unchecked` has cut the same bytes with the same spec")]
        ChunkView::cut(&self.spec, self.raw()).expect("a chunk that was cut before")
    }

    /// What it is.
    pub fn spec(&self) -> &ChunkSpec {
        &self.spec
    }
}

/// Puts lists one after another into words, each list as records.
fn laid(bytes: u64, lists: &[&[u8]]) -> Vec<u64> {
    let mut words = vec![0u64; bytes.div_ceil(8) as usize];
    let mut rest = bytemuck::cast_slice_mut::<u64, u8>(&mut words);
    for list in lists {
        let (place, after) = rest.split_at_mut(list.len());
        place.copy_from_slice(list);
        rest = after;
    }
    words
}

/// The plain form of a narrow chunk, whose length has been checked.
fn widened(spec: &ChunkSpec, stored: &[u8]) -> Vec<u64> {
    let count = spec.row.triangles as usize;
    let (corners, rest) = stored.split_at(6 * count);
    let (rest, flags) = rest.split_at(rest.len() - count);
    let record = |(corners, &flags): (&[u8; 6], &u8)| {
        let [a, b, c] = [0, 2, 4].map(|at| u16::from_le_bytes([corners[at], corners[at + 1]]));
        TriangleRecord { vertices: [a, b, c], flags: flags.into() }
    };
    let triangles: Vec<TriangleRecord> = corners.as_chunks::<6>().0.iter().zip(flags).map(record).collect();
    laid(spec.plain_bytes(), &[bytemuck::cast_slice(&triangles), rest])
}

/// The plain form of a compressed chunk.
fn decoded(spec: &ChunkSpec, stored: &[u8], coarser: &[&Chunk]) -> Result<Vec<u64>, Contradiction> {
    let mut below: Vec<VertexRecord> = Vec::with_capacity(spec.row.vertices as usize);
    coarser.iter().rev().for_each(|chunk| below.extend_from_slice(chunk.view().vertices));
    let triangles = coarser.first().map_or(&[][..], |chunk| chunk.view().triangles);
    let Lists { triangles, vertices, overflow, ecol, added } = decompress(spec, stored, triangles, below)?;
    let added_vertices = &vertices[spec.vertices_below as usize..];
    let lists: [&[u8]; 5] = [
        bytemuck::cast_slice(&triangles),
        bytemuck::cast_slice(added_vertices),
        bytemuck::cast_slice(&overflow),
        bytemuck::cast_slice(&ecol),
        &added,
    ];
    Ok(laid(spec.plain_bytes(), &lists))
}
