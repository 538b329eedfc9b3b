//! Counts of a frame in; the bytes that each pass must move in the GPU's memory out.
//!
//! Over the rate at which the GPU copies memory ([`crate::gpu::bandwidth`], which counts what is read and what is
//! written), these bytes are the time that no pass of this kind can be faster than: its *floor*. Every element of a
//! buffer that a kernel reads or writes is counted once for each kernel, as if caches were perfect within a kernel and
//! empty between two. So a floor is a little too high where a pass finds in a cache what the pass before it wrote,
//! which shows as less than 1 times the floor in small scenes.
//!
//! The sizes are those of [`crate::gpu::batch`] and [`crate::gpu::layout`]; the terms follow `shaders/`.

use crate::gpu::batch::{ACTIVE_BYTES, INDEX_BYTES, STREAMS};
use crate::gpu::layout::Grant;
use crate::passes::draw::InstanceRow;
use crate::passes::prefix_sum::{BLOCK, level_counts};
use crate::stream::delta::{ECOL_BYTES, TRIANGLE_BYTES, VERTEX_BYTES};

/// Bytes of an entry of a list: a budget, a streamed count, a start, an active `ecol` entry.
const ENTRY: u64 = 4;
/// Bytes of a record of each stream as it is streamed.
const STREAMED_BYTES: [u64; STREAMS] = [VERTEX_BYTES, ECOL_BYTES, TRIANGLE_BYTES];
/// Bytes of a pixel of the picture.
const PIXEL: u64 = 4;

/// What one batch is rebuilt of in one frame. Arrays are by stream: vertices, `ecol`, triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rebuilt {
    /// Instances of the batch.
    pub instances: u64,
    /// Of these, those of which anything is drawn.
    pub drawn: u64,
    /// Grants: instances whose budget changes.
    pub grants: u64,
    /// Active elements.
    pub active: [u64; STREAMS],
    /// Of these, those that were streamed.
    pub streamed: [u64; STREAMS],
}

/// `shaders/grant.wgsl`: each grant is read (16 bytes); of its instance, three old budgets are read, three new ones
/// and three streamed counts written. That the host clears the streamed counts before is not part of the pass.
pub fn grant(batch: &Rebuilt) -> u64 {
    batch.grants * (size_of::<Grant>() as u64 + 3 * STREAMS as u64 * ENTRY)
}

/// `shaders/prefix_sum.wgsl`: six lists (budgets and streamed counts of three streams), each with
/// - `prefix_sum_blocks` on every level: its input read, its output and one total a block of 256 written;
/// - `prefix_sum_add` on every level but the last: one sum a block read, its output read and written.
pub fn prefix_sum(batch: &Rebuilt) -> u64 {
    let outputs = level_counts(u32::try_from(batch.instances + 1).unwrap_or(u32::MAX));
    let last = outputs.len() - 1;
    let entries = outputs.iter().enumerate().map(|(level, &output)| {
        let (output, blocks) = (u64::from(output), u64::from(output.div_ceil(BLOCK)));
        let input = if level == 0 { batch.instances } else { output };
        let added = if level < last { blocks + 2 * output } else { 0 };
        input + output + blocks + added
    });
    2 * STREAMS as u64 * ENTRY * entries.sum::<u64>()
}

/// `shaders/defragment.wgsl`, by stream: what is kept is read as it is active, what is streamed as it was sent, all of
/// it is written as it is active (16, 4, 8 bytes); of each drawn instance the starts of its active, existing and
/// streamed blocks are read, and where the active and the streamed one end.
pub fn defragment(batch: &Rebuilt) -> u64 {
    let stream = |stream: usize| {
        let (active, streamed) = (batch.active[stream], batch.streamed[stream]);
        let read = active.saturating_sub(streamed) * ACTIVE_BYTES[stream] + streamed * STREAMED_BYTES[stream];
        read + active * ACTIVE_BYTES[stream] + starts(batch, 2) + ENTRY * batch.drawn
    };
    (0..STREAMS).map(stream).sum()
}

/// `shaders/reform.wgsl`: each active triangle is read (8 bytes) and three indices are written (12 bytes); `ecol` is
/// read from where the active vertices of an instance end to where its tier ends, 4 bytes each, once. Not every entry is asked for, but
/// memory moves whole sectors, and nearly every sector has one that is (tested). The starts of three lists are read,
/// and where these blocks end.
pub fn reform(batch: &Rebuilt) -> u64 {
    let [vertices, ecol, triangles] = batch.active;
    let walked = ENTRY * ecol.saturating_sub(vertices);
    triangles * (TRIANGLE_BYTES + INDEX_BYTES) + walked + starts(batch, 3)
}

/// So many start lists of a batch: an entry for each drawn instance, which is also where the one before it ends, and
/// one more.
fn starts(batch: &Rebuilt, lists: u64) -> u64 {
    if batch.drawn == 0 { 0 } else { lists * ENTRY * (batch.drawn + 1) }
}

/// What is drawn in one frame, all batches together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Drawn {
    /// Active vertices.
    pub vertices: u64,
    /// Active triangles.
    pub triangles: u64,
    /// Instances of which anything is drawn, and boxes.
    pub rows: u64,
    /// Pixels of the picture.
    pub pixels: u64,
}

/// `shaders/draw.wgsl`: three indices a triangle (12 bytes), each active vertex (16) and each row (64) are read once, and
/// the picture's colour is written once. Depth and samples are not counted: GPUs keep and compress them on the chip as
/// they like, so this floor is far below what rasterising costs.
pub fn draw(drawn: &Drawn) -> u64 {
    drawn.triangles * INDEX_BYTES
        + drawn.vertices * ACTIVE_BYTES[0]
        + drawn.rows * size_of::<InstanceRow>() as u64
        + drawn.pixels * PIXEL
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three instances, of which two are drawn; one of them got two vertices, one triangle, four entries of `ecol`.
    const SMALL: Rebuilt =
        Rebuilt { instances: 3, drawn: 2, grants: 1, active: [10, 12, 6], streamed: [2, 4, 1] };

    #[test]
    fn a_grant_reads_28_and_writes_24_bytes() {
        assert_eq!(grant(&SMALL), (16 + 12) + (12 + 12));
        assert_eq!(grant(&Rebuilt::default()), 0);
    }

    #[test]
    fn small_lists_are_summed_in_one_level() {
        // Three read, four written, one total: six times.
        assert_eq!(prefix_sum(&SMALL), 6 * 4 * (3 + 4 + 1));
    }

    #[test]
    fn large_lists_are_summed_in_levels() {
        // 300 counts: 301 sums in two blocks, then 2 sums in one block; then 2 are added to 301.
        let batch = Rebuilt { instances: 300, ..Rebuilt::default() };
        assert_eq!(prefix_sum(&batch), 6 * 4 * ((300 + 301 + 2) + (2 + 2 + 1) + (2 + 2 * 301)));
    }

    #[test]
    fn defragmentation_copies_what_is_kept_and_unpacks_what_is_streamed() {
        let vertices = 8 * 16 + 2 * 12 + 10 * 16;
        let ecol = 8 * 4 + 4 * 2 + 12 * 4;
        let triangles = 5 * 8 + 8 + 6 * 8;
        // Two active starts and an end, two streamed ones and an end, two existing ones: for each stream.
        let starts = 3 * 4 * (3 + 3 + 2);
        assert_eq!(defragment(&SMALL), vertices + ecol + triangles + starts);
    }

    #[test]
    fn reformation_reads_triangles_and_the_ecol_beyond_what_is_active() {
        assert_eq!(reform(&SMALL), 6 * (8 + 12) + (12 - 10) * 4 + 3 * 4 * 3);
    }

    #[test]
    fn drawing_reads_what_is_active_and_writes_the_picture() {
        let drawn = Drawn { vertices: 10, triangles: 6, rows: 2, pixels: 100 };
        assert_eq!(draw(&drawn), 10 * 16 + 6 * 12 + 2 * 64 + 100 * 4);
    }

    #[test]
    fn nothing_costs_next_to_nothing() {
        let nothing = Rebuilt::default();
        assert_eq!([defragment(&nothing), reform(&nothing), draw(&Drawn::default())], [0, 0, 0]);
        // The total of no counts, and the block's.
        assert_eq!(prefix_sum(&nothing), 6 * 4 * (1 + 1));
    }
}
