//! A chunk in, the bytes of its compressed form out; and back, given the coarser tiers of its part.
//!
//! The triangles are told as splits of vertices (`splits.rs`); positions and attributes are differences from those of the
//! vertex that each collapses onto. What is left goes through zstd as one frame of streams, in planes of bytes, in the
//! order of [`streams_of`]. `docs/format.md` has the form, `docs/performance.md` what else was tried.
//!
//! The decoder trusts nothing: a frame may be no longer than the row's counts allow, which is checked before memory is
//! taken; every stream is cut with its length checked; and the time follows the streams.

use std::cell::RefCell;

use zstd::bulk::{Compressor, Decompressor};
use zstd::zstd_safe::CParameter;

use super::chunk::{ChunkSpec, ChunkView};
use super::splits::{Added, Contradiction, Teller, undo};
use crate::geometry::record::{Attributes, GRID_BITS};
use crate::geometry::triangles_at::{CONTINUES, OVERFLOWS};
use crate::geometry::{TriangleRecord, VertexRecord};

/// Higher levels cost much time in the bake and save little: see `docs/performance.md`.
const LEVEL: i32 = 6;
/// The code of a new triangle that follows from nothing; its corners stand in the stream of corners.
const EXPLICIT: u8 = 255;
/// No likelier triangle than so many places further on is looked at.
const MOST_AHEAD: usize = 80;

/// How many bytes of masks a chunk of such counts may have.
fn most_mask_bytes(triangles: usize, added: usize) -> usize {
    3 * triangles + added
}

/// The most bytes that the streams of a chunk may have.
fn most_stream_bytes(spec: &ChunkSpec) -> usize {
    let (t, a) = (spec.row.triangles as usize, spec.added_vertices() as usize);
    let born = spec.row.triangles.saturating_sub(spec.triangles_below) as usize;
    let planes = POSITION_PLANES + attribute_planes(spec.attributes);
    (1 + 1 + 2 + planes) * a + 4 * usize::from(spec.row.overflow) + 7 * born + t + most_mask_bytes(t, a)
}

const POSITION_PLANES: usize = 9;

/// The widths in bits of the parts of an attribute word: the two of the normal, the rest.
fn widths(attributes: Attributes) -> [u32; 3] {
    match attributes {
        Attributes::Normal => [16, 16, 0],
        Attributes::Colour => [8, 8, 16],
        Attributes::Slot => [12, 12, 8],
    }
}

fn attribute_planes(attributes: Attributes) -> usize {
    widths(attributes).iter().map(|width| width.div_ceil(8) as usize).sum()
}

/// The difference of two numbers of `width` bits, small for small ones of either sign.
fn difference(number: u32, from: u32, width: u32) -> u32 {
    let up = 32 - width;
    let signed = (number.wrapping_sub(from) << up) as i32 >> up;
    ((signed << 1) ^ (signed >> 31)) as u32
}

/// What [`difference`] was taken of.
fn restored(difference: u32, from: u32, width: u32) -> u32 {
    let signed = (difference >> 1) ^ (difference & 1).wrapping_neg();
    from.wrapping_add(signed) & (u32::MAX >> (32 - width))
}

/// Whether a vertex comes together with the one before it, and so most likely lies where that does.
fn follows(spec: &ChunkSpec, index: usize, bytes: &[u8]) -> bool {
    spec.vertices_below + index as u32 > spec.locked && index > 0 && bytes[index - 1] == CONTINUES
}

/// The vertex that another's differences are from; `None` for the first of all.
fn reference(spec: &ChunkSpec, index: usize, ecol: &[u16]) -> Option<usize> {
    let vertex = spec.vertices_below + index as u32;
    if vertex >= spec.locked {
        Some(usize::from(ecol[index]))
    } else {
        vertex.checked_sub(1).map(|v| v as usize)
    }
}

/// How many triangles each vertex adds; an overflow entry that is missing counts as none.
fn counts(bytes: &[u8], mut overflow: impl Iterator<Item = u32>) -> Vec<u32> {
    let count = |&byte: &u8| match byte {
        CONTINUES => 0,
        OVERFLOWS => overflow.next().unwrap_or(0),
        count => u32::from(count),
    };
    bytes.iter().map(count).collect()
}

/// What the encoder knows: which corners each vertex takes over, and the triangles as they are when they come.
struct Answers {
    /// The corners, vertex after vertex from the last to the first.
    moved: Vec<u32>,
    /// For each vertex where its corners lie.
    places: Vec<[u32; 2]>,
    born: Vec<[u16; 3]>,
}

impl Answers {
    /// Collapses the finer triangles down to the coarser ones.
    fn find(mut now: Vec<[u16; 3]>, added: &Added<'_>) -> Self {
        let count = added.ecol.len();
        let below = now.len() - added.counts.iter().map(|&count| count as usize).sum::<usize>();
        let mut at = CornersAt::new(&now, added.first as usize + count);
        let mut answers =
            Self { moved: Vec::new(), places: vec![[0; 2]; count], born: vec![[0; 3]; now.len() - below] };
        let mut left = now.len();
        for index in (0..count).rev() {
            if added.bytes[index] != CONTINUES {
                let end = left;
                left -= added.counts[index] as usize;
                answers.born[left - below..end - below].copy_from_slice(&now[left..end]);
            }
            let vertex = added.first + index as u32;
            if vertex >= added.locked {
                let start = answers.moved.len();
                at.collapse(vertex as usize, added.ecol[index], &mut now, &mut answers.moved);
                // Those that come with it or later are not there before.
                let mut kept = start;
                for place in start..answers.moved.len() {
                    if (answers.moved[place] as usize) < 4 * left {
                        answers.moved.swap(kept, place);
                        kept += 1;
                    }
                }
                answers.moved.truncate(kept);
                answers.places[index] = [start as u32, kept as u32];
            }
        }
        answers
    }
}

/// Lists of the corners at each vertex.
struct CornersAt {
    first: Vec<u32>,
    following: Vec<u32>,
}

impl CornersAt {
    fn new(triangles: &[[u16; 3]], vertices: usize) -> Self {
        let mut at = Self { first: vec![u32::MAX; vertices], following: vec![u32::MAX; 4 * triangles.len()] };
        for (triangle, vertices) in (0..).zip(triangles) {
            (4 * triangle..).zip(vertices).for_each(|(corner, &vertex)| at.add(corner, vertex));
        }
        at
    }

    fn add(&mut self, corner: u32, vertex: u16) {
        let first = &mut self.first[usize::from(vertex)];
        self.following[corner as usize] = std::mem::replace(first, corner);
    }

    /// Moves all corners of a vertex onto another, and lists them.
    fn collapse(&mut self, vertex: usize, onto: u16, now: &mut [[u16; 3]], moved: &mut Vec<u32>) {
        let mut corner = std::mem::replace(&mut self.first[vertex], u32::MAX);
        while corner != u32::MAX {
            let following = self.following[corner as usize];
            now[corner as usize / 4][corner as usize % 4] = onto;
            self.add(corner, onto);
            moved.push(corner);
            corner = following;
        }
    }
}

/// The teller that knows, and writes down.
struct Knows<'a> {
    first: u32,
    answers: &'a Answers,
    is_moving: Vec<bool>,
    taken: usize,
    most_masks: usize,
    masks: Vec<u8>,
    /// How many bits of the last mask are used; none of a new vertex.
    bit: u32,
    born: Vec<u8>,
    corners: Vec<u8>,
}

impl Teller for Knows<'_> {
    fn begin(&mut self, vertex: u32) {
        let [start, end] = self.answers.places[(vertex - self.first) as usize];
        let moved = &self.answers.moved[start as usize..end as usize];
        moved.iter().for_each(|&corner| self.is_moving[corner as usize] = true);
        self.bit = 0;
    }

    fn moves(&mut self, corner: u32) -> Result<bool, Contradiction> {
        let moves = std::mem::take(&mut self.is_moving[corner as usize]);
        if self.bit == 0 {
            self.masks.push(0);
        }
        if let Some(mask) = self.masks.last_mut() {
            *mask |= u8::from(moves) << self.bit;
        }
        self.bit = (self.bit + 1) % 8;
        if self.masks.len() > self.most_masks {
            return Err(Contradiction("its vertices have too many corners"));
        }
        Ok(moves)
    }

    fn triangle(&mut self, likely: &[[u16; 3]], next: &mut usize) -> Result<[u16; 3], Contradiction> {
        let triangle = self.answers.born[self.taken];
        self.taken += 1;
        let found = (0..likely.len().min(MOST_AHEAD)).find_map(|ahead| {
            let place = place_ahead(*next, ahead, likely.len());
            (0..3).find(|&turn| turned(likely[place], turn) == triangle).map(|turn| (ahead, place, turn))
        });
        if let Some((ahead, place, turn)) = found {
            self.born.push((3 * ahead + turn) as u8);
            *next = place + 1;
        } else {
            self.born.push(EXPLICIT);
            triangle.iter().for_each(|corner| self.corners.extend(corner.to_le_bytes()));
        }
        Ok(triangle)
    }
}

/// The place so far after the next one, in a list that begins again at its end; both are at most its length.
fn place_ahead(next: usize, ahead: usize, count: usize) -> usize {
    let place = next + ahead;
    if place < count { place } else { place - count }
}

fn turned(triangle: [u16; 3], turn: usize) -> [u16; 3] {
    std::array::from_fn(|corner| triangle[(corner + turn) % 3])
}

/// Replaces `out` by the compressed form of a chunk; `false` if it has none, because it is not as sound chunks are, or not
/// as bakes make them. `coarser` are the triangles of the next coarser tier, `vertices` all of the part's as far as this
/// tier has them.
pub(super) fn compress(
    spec: &ChunkSpec,
    view: &ChunkView<'_>,
    coarser: &[TriangleRecord],
    vertices: &[VertexRecord],
    out: &mut Vec<u8>,
) -> bool {
    out.clear();
    let streams = is_usual(spec, view, coarser).then(|| streams_of(spec, view, coarser, vertices)).flatten();
    let packed = streams.filter(|streams| streams.len() <= most_stream_bytes(spec)).and_then(|s| pack(&s));
    packed.map(|packed| out.extend_from_slice(&packed)).is_some()
}

/// Whether everything is in range that the encoder relies on.
fn is_usual(spec: &ChunkSpec, view: &ChunkView<'_>, coarser: &[TriangleRecord]) -> bool {
    let mut findings = super::finding::Findings::new(String::new(), 1);
    view.check(spec, &mut findings);
    let reaches = |corner: &u16| u32::from(*corner) < spec.vertices_below;
    findings.is_empty()
        && coarser.len() == spec.triangles_below as usize
        && spec.triangles_below <= spec.row.triangles
        && coarser.iter().all(|triangle| triangle.vertices.iter().all(reaches))
        && view.triangles.iter().all(|triangle| triangle.flags < 256)
        && view.vertices.iter().all(|vertex| vertex.packed_position() >> 63 == 0)
}

fn streams_of(
    spec: &ChunkSpec,
    view: &ChunkView<'_>,
    coarser: &[TriangleRecord],
    vertices: &[VertexRecord],
) -> Option<Vec<u8>> {
    let counts = counts(view.added, view.overflow.iter().map(|entry| entry[1]));
    let added = added_of(spec, view.ecol, view.added, &counts);
    let fine: Vec<[u16; 3]> = view.triangles.iter().map(|triangle| triangle.vertices).collect();
    let answers = Answers::find(fine.clone(), &added);
    let mut knows = Knows {
        first: spec.vertices_below,
        answers: &answers,
        is_moving: vec![false; 4 * fine.len()],
        taken: 0,
        most_masks: most_mask_bytes(fine.len(), view.ecol.len()),
        masks: Vec::new(),
        bit: 0,
        born: Vec::new(),
        corners: Vec::new(),
    };
    let told = undo(coarser.iter().map(|triangle| triangle.vertices), &added, &mut knows);
    if !told.is_ok_and(|told| told.iter().map(|t| &t[..3]).eq(fine.iter().map(|t| &t[..]))) {
        return None;
    }
    let mut streams = view.added.to_vec();
    streams.extend(view.overflow.iter().flat_map(|entry| entry[1].to_le_bytes()));
    let unlocked = &view.ecol[locked_here(spec)..];
    streams.extend(unlocked.iter().map(|&onto| onto as u8));
    streams.extend(unlocked.iter().map(|&onto| (onto >> 8) as u8));
    streams.extend(knows.born);
    streams.extend(knows.corners);
    let before = coarser.iter().map(|triangle| triangle.flags).chain(std::iter::repeat(0));
    streams
        .extend(view.triangles.iter().zip(before).map(|(triangle, before)| (triangle.flags ^ before) as u8));
    push_vertices(spec, view, vertices, &mut streams);
    streams.extend(knows.masks);
    Some(streams)
}

fn added_of<'a>(spec: &ChunkSpec, ecol: &'a [u16], bytes: &'a [u8], counts: &'a [u32]) -> Added<'a> {
    let triangles = spec.row.triangles as usize;
    Added { first: spec.vertices_below, locked: spec.locked, ecol, bytes, counts, triangles }
}

/// How many of the vertices that the chunk adds are locked.
fn locked_here(spec: &ChunkSpec) -> usize {
    spec.locked.saturating_sub(spec.vertices_below).min(spec.added_vertices()) as usize
}

/// Which of the vertices that follow another lie elsewhere, and the differences of positions and attributes.
fn push_vertices(spec: &ChunkSpec, view: &ChunkView<'_>, vertices: &[VertexRecord], streams: &mut Vec<u8>) {
    let mut positions: [Vec<u32>; 3] = Default::default();
    let mut attributes: [Vec<u32>; 3] = Default::default();
    for (index, vertex) in view.vertices.iter().enumerate() {
        let from =
            reference(spec, index, view.ecol).map_or_else(VertexRecord::default, |from| vertices[from]);
        let mut is_elsewhere = true;
        if follows(spec, index, view.added) {
            is_elsewhere = vertex.packed_position() != view.vertices[index - 1].packed_position();
            streams.push(is_elsewhere.into());
        }
        if is_elsewhere {
            let each = vertex.grid().into_iter().zip(from.grid()).zip(&mut positions);
            each.for_each(|((mine, other), list)| list.push(difference(mine, other, GRID_BITS)));
        }
        let pair = [vertex, &from].map(|record| fields(record.attributes(), spec.attributes));
        attributes[0].push(difference(pair[0][0], pair[1][0], widths(spec.attributes)[0]));
        attributes[1].push(difference(pair[0][1], pair[1][1], widths(spec.attributes)[1]));
        attributes[2].push(pair[0][2] ^ pair[1][2]);
    }
    let lists = positions.iter().map(|list| (list, GRID_BITS));
    for (list, width) in lists.chain(attributes.iter().zip(widths(spec.attributes))) {
        for plane in 0..width.div_ceil(8) {
            streams.extend(list.iter().map(|number| (number >> (8 * plane)) as u8));
        }
    }
}

/// The parts of an attribute word.
fn fields(word: u32, attributes: Attributes) -> [u32; 3] {
    let [first, second, _] = widths(attributes);
    let mask = |width: u32| (1 << width) - 1;
    [word & mask(first), word >> first & mask(second), word.checked_shr(first + second).unwrap_or(0)]
}

/// The word of its parts.
fn joined(fields: [u32; 3], attributes: Attributes) -> u32 {
    let [first, second, _] = widths(attributes);
    fields[0] | fields[1] << first | fields[2].checked_shl(first + second).unwrap_or(0)
}

thread_local! {
    static COMPRESSOR: RefCell<Option<Compressor<'static>>> = const { RefCell::new(None) };
    static DECOMPRESSOR: RefCell<Option<Decompressor<'static>>> = const { RefCell::new(None) };
}

fn compressor() -> std::io::Result<Compressor<'static>> {
    let mut compressor = Compressor::new(LEVEL)?;
    compressor.set_parameter(CParameter::ContentSizeFlag(false))?;
    Ok(compressor)
}

fn pack(streams: &[u8]) -> Option<Vec<u8>> {
    COMPRESSOR.with_borrow_mut(|slot| {
        let compressor = match slot {
            Some(compressor) => compressor,
            None => slot.insert(compressor().ok()?),
        };
        compressor.compress(streams).ok()
    })
}

/// Unpacks a frame of at most so many bytes.
fn unpack(stored: &[u8], most: usize) -> Option<Vec<u8>> {
    DECOMPRESSOR.with_borrow_mut(|slot| {
        let decompressor = match slot {
            Some(decompressor) => decompressor,
            None => slot.insert(Decompressor::new().ok()?),
        };
        decompressor.decompress(stored, most).ok()
    })
}

/// Cuts streams off the front.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Contradiction> {
        let (front, back) =
            self.0.split_at_checked(count).ok_or(Contradiction("its streams end too early"))?;
        self.0 = back;
        Ok(front)
    }

    /// Planes of `count` numbers, as an iterator over the numbers.
    fn planes(
        &mut self,
        count: usize,
        width: u32,
    ) -> Result<impl Iterator<Item = u32> + use<'a>, Contradiction> {
        let mut planes = [&[][..]; 3];
        for plane in planes.iter_mut().take(width.div_ceil(8) as usize) {
            *plane = self.take(count)?;
        }
        let byte = |plane: &[u8], index: usize| plane.get(index).map_or(0, |&byte| u32::from(byte));
        Ok((0..count).map(move |index| (0..3).map(|p| byte(planes[p], index) << (8 * p)).sum()))
    }
}

/// The teller that reads.
struct Reads<'a> {
    masks: &'a [u8],
    /// What is left of the mask at hand, below a one.
    mask: u32,
    born: std::slice::Iter<'a, u8>,
    corners: Cursor<'a>,
}

impl Teller for Reads<'_> {
    fn begin(&mut self, _: u32) {
        self.mask = 1;
    }

    fn moves(&mut self, _: u32) -> Result<bool, Contradiction> {
        // A one above the bits that are left.
        if self.mask == 1 {
            let (&mask, after) =
                self.masks.split_first().ok_or(Contradiction("its streams end too early"))?;
            (self.mask, self.masks) = (0x100 | u32::from(mask), after);
        }
        let moves = self.mask & 1 != 0;
        self.mask >>= 1;
        Ok(moves)
    }

    fn triangle(&mut self, likely: &[[u16; 3]], next: &mut usize) -> Result<[u16; 3], Contradiction> {
        let &code = self.born.next().ok_or(Contradiction("it has fewer new triangles than stated"))?;
        if code == EXPLICIT {
            let corner = self.corners.take(6)?;
            return Ok([0, 2, 4].map(|at| u16::from_le_bytes([corner[at], corner[at + 1]])));
        }
        let (ahead, turn) = (usize::from(code / 3), usize::from(code % 3));
        if ahead >= likely.len() {
            return Err(Contradiction("a new triangle is none of those that may be expected"));
        }
        let place = place_ahead(*next, ahead, likely.len());
        *next = place + 1;
        Ok(turned(likely[place], turn))
    }
}

/// The lists of a chunk, as it is in memory.
pub(super) struct Lists {
    pub triangles: Vec<TriangleRecord>,
    /// All vertices of the part up to this tier's.
    pub vertices: Vec<VertexRecord>,
    pub overflow: Vec<[u32; 2]>,
    pub ecol: Vec<u16>,
    pub added: Vec<u8>,
}

/// Decodes the compressed form of a chunk. `coarser` are the triangles of the next coarser tier, `below` the vertices of
/// all coarser ones, coarsest first; both as its row calls for.
///
/// # Errors
/// What contradicts itself, or the counts of the row.
pub(super) fn decompress(
    spec: &ChunkSpec,
    stored: &[u8],
    coarser: &[TriangleRecord],
    below: Vec<VertexRecord>,
) -> Result<Lists, Contradiction> {
    let fits = below.len() == spec.vertices_below as usize && coarser.len() == spec.triangles_below as usize;
    let reaches = |corner: &u16| u32::from(*corner) < spec.vertices_below;
    if !fits || !coarser.iter().all(|triangle| triangle.vertices.iter().all(reaches)) {
        return Err(Contradiction("it does not fit the coarser tiers"));
    }
    let streams = unpack(stored, most_stream_bytes(spec));
    let streams = streams.ok_or(Contradiction("it is no zstd frame of the length that its counts allow"))?;
    let mut rest = Cursor(&streams);
    let count = spec.added_vertices() as usize;
    let added = rest.take(count)?.to_vec();
    let overflow = overflow(spec, &added, rest.take(4 * usize::from(spec.row.overflow))?)?;
    let ecol = ecol(spec, &mut rest)?;
    let born = rest.take(spec.row.triangles.saturating_sub(spec.triangles_below) as usize)?;
    let corners = rest.take(6 * born.iter().filter(|&&code| code == EXPLICIT).count())?;
    let flags = rest.take(spec.row.triangles as usize)?;
    let vertices = vertices(spec, &ecol, &added, below, &mut rest)?;
    let mut reads = Reads { masks: rest.0, mask: 1, born: born.iter(), corners: Cursor(corners) };
    let counts = counts(&added, overflow.iter().map(|entry| entry[1]));
    let base = coarser.iter().map(|triangle| triangle.vertices);
    let triangles = undo(base, &added_of(spec, &ecol, &added, &counts), &mut reads)?;
    if !reads.masks.is_empty() {
        return Err(Contradiction("its streams go on after their end"));
    }
    let before = coarser.iter().map(|triangle| triangle.flags).chain(std::iter::repeat(0));
    let flags = flags.iter().zip(before).map(|(&flags, before)| u16::from(flags) ^ before);
    let record = |([a, b, c, _], flags): ([u16; 4], u16)| TriangleRecord { vertices: [a, b, c], flags };
    let triangles = triangles.into_iter().zip(flags).map(record).collect();
    Ok(Lists { triangles, vertices, overflow, ecol, added })
}

/// The overflow list: the vertices are those whose byte calls for an entry.
fn overflow(spec: &ChunkSpec, added: &[u8], counts: &[u8]) -> Result<Vec<[u32; 2]>, Contradiction> {
    let vertices = (spec.vertices_below..).zip(added).filter(|(_, byte)| **byte == OVERFLOWS);
    let counts = counts.as_chunks::<4>().0.iter().map(|&bytes| u32::from_le_bytes(bytes));
    let entries: Vec<[u32; 2]> = vertices.zip(counts).map(|((vertex, _), count)| [vertex, count]).collect();
    let called_for = added.iter().filter(|&&byte| byte == OVERFLOWS).count();
    if [entries.len(), called_for] == [usize::from(spec.row.overflow); 2] {
        Ok(entries)
    } else {
        Err(Contradiction("its overflow entries are not as many as its bytes call for"))
    }
}

fn ecol(spec: &ChunkSpec, rest: &mut Cursor<'_>) -> Result<Vec<u16>, Contradiction> {
    let locked = locked_here(spec);
    let unlocked = rest.planes(spec.added_vertices() as usize - locked, 16)?;
    // A vertex is below 65,536.
    let itself = (0..locked as u32).map(|index| (spec.vertices_below + index) as u16);
    let ecol: Vec<u16> = itself.chain(unlocked.map(|onto| onto as u16)).collect();
    let goes_down = |(vertex, &onto): (u32, &u16)| vertex < spec.locked || u32::from(onto) < vertex;
    if (spec.vertices_below..).zip(&ecol).all(goes_down) {
        Ok(ecol)
    } else {
        Err(Contradiction("a vertex collapses onto one that is not below it"))
    }
}

fn vertices(
    spec: &ChunkSpec,
    ecol: &[u16],
    added: &[u8],
    mut vertices: Vec<VertexRecord>,
    rest: &mut Cursor<'_>,
) -> Result<Vec<VertexRecord>, Contradiction> {
    let following = (0..ecol.len()).filter(|&index| follows(spec, index, added)).count();
    let elsewhere = rest.take(following)?;
    let placed = ecol.len() - following + elsewhere.iter().filter(|&&flag| flag != 0).count();
    let mut elsewhere = elsewhere.iter();
    let [mut x, mut y, mut z] =
        [rest.planes(placed, GRID_BITS)?, rest.planes(placed, GRID_BITS)?, rest.planes(placed, GRID_BITS)?];
    let widths = widths(spec.attributes);
    let [mut u, mut v, mut tag] = [
        rest.planes(ecol.len(), widths[0])?,
        rest.planes(ecol.len(), widths[1])?,
        rest.planes(ecol.len(), widths[2])?,
    ];
    let next = |numbers: &mut dyn Iterator<Item = u32>| numbers.next().unwrap_or(0);
    vertices.reserve_exact(ecol.len());
    for index in 0..ecol.len() {
        let from = reference(spec, index, ecol).map_or_else(VertexRecord::default, |from| vertices[from]);
        let grid = if follows(spec, index, added) && elsewhere.next() == Some(&0) {
            vertices[vertices.len() - 1].grid()
        } else {
            let [a, b, c] = from.grid();
            [(&mut x, a), (&mut y, b), (&mut z, c)].map(|(list, c)| restored(next(list), c, GRID_BITS))
        };
        let [a, b, c] = fields(from.attributes(), spec.attributes);
        let attributes =
            [restored(next(&mut u), a, widths[0]), restored(next(&mut v), b, widths[1]), next(&mut tag) ^ c];
        vertices.push(VertexRecord::new(grid, joined(attributes, spec.attributes)));
    }
    Ok(vertices)
}

#[cfg(test)]
mod tests;
