//! An ordered part in, its row and the bytes of its chunks out.

use super::chunk::{ChunkSpec, ChunkView};
use super::format::*;
use super::{ContainerError, stored};
use crate::geometry::record::Attributes;
use crate::geometry::{Closure, OrderedPart};

/// A part as it will lie in a file; names and numbers that depend on other parts are not set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EncodedPart {
    /// Its row.
    pub row: PartRow,
    /// Its chunks, finest tier first, without offsets.
    pub chunks: Vec<ChunkRow>,
    /// Their bytes, one after another, without padding.
    pub bytes: Vec<u8>,
}

impl EncodedPart {
    /// Encodes a part; `cell` tells that it is one of several of its source. Chunks are stored in the form that is asked
    /// for, or, where they do not have it, in a plainer one.
    ///
    /// # Errors
    /// A part that no container can hold.
    pub fn new(part: &OrderedPart, cell: bool, form: Form) -> Result<Self, ContainerError> {
        check_part(part).map_err(|problem| refused("a part".to_owned(), problem))?;
        let (mut bytes, mut chunk) = (Vec::new(), Vec::new());
        let encode = |tier| {
            let row = encode_chunk(part, tier, form, &mut chunk);
            bytes.extend_from_slice(&chunk);
            row
        };
        let chunks = (0..part.tiers.len()).map(encode).collect();
        Ok(Self { row: part_row(part, cell), chunks, bytes })
    }
}

/// Contents that no container can hold.
pub(super) fn refused(place: String, problem: String) -> ContainerError {
    ContainerError::Contents { place, problem }
}

/// Replaces `out` by the stored bytes of a part's tier, without padding; the part has passed [`check_part`].
pub(super) fn encode_chunk(part: &OrderedPart, tier: usize, form: Form, out: &mut Vec<u8>) -> ChunkRow {
    let OrderedPart { tiers, vertices, ecol, triangles_at, .. } = part;
    let coarser = tiers.get(tier + 1);
    let below = coarser.map_or(0, |coarser| coarser.vertices);
    let added = below as usize..tiers[tier].vertices as usize;
    let overflow: Vec<[u32; 2]> = triangles_at
        .overflow()
        .iter()
        .filter(|entry| added.contains(&(entry.0 as usize)))
        .map(|&(vertex, count)| [vertex, count])
        .collect();
    let view = ChunkView {
        triangles: &tiers[tier].triangles,
        vertices: &vertices[added.clone()],
        overflow: &overflow,
        ecol: &ecol[added.clone()],
        added: &triangles_at.bytes()[added],
    };
    let row = ChunkRow {
        vertices: tiers[tier].vertices,
        triangles: tiers[tier].triangles.len() as u32,
        // The reader compares it with the bytes that call for entries.
        overflow: overflow.len() as u16,
        ..ChunkRow::default()
    };
    let coarser_triangles = coarser.map_or(&[][..], |coarser| &coarser.triangles);
    let spec = ChunkSpec {
        part: 0,
        tier: tier as u32,
        row,
        vertices_below: below,
        triangles_below: coarser_triangles.len() as u32,
        locked: part.locked,
        coarsest_triangles: part.coarsest_triangles(),
        attributes: part.attributes,
    };
    let form = stored::encode(&spec, &view, coarser_triangles, vertices, form, out);
    ChunkRow { bytes: out.len() as u32, form: form as u16, checksum: checksum(out), ..row }
}

/// What [`encode_chunk`] and the rows rely on; everything else is checked with the tables.
pub(super) fn check_part(part: &OrderedPart) -> Result<(), String> {
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
    if part.triangles_at.overflow().len() > usize::from(u16::MAX) {
        return Err(format!(
            "it has {} vertices that add 254 triangles or more",
            part.triangles_at.overflow().len()
        ));
    }
    Ok(())
}

/// The row of a part, without its name, its source and its first chunk.
pub(super) fn part_row(part: &OrderedPart, cell: bool) -> PartRow {
    let flag = |is, flag| if is { flag } else { 0 };
    let (grid_low, grid_high) = part.grid_box();
    PartRow {
        origin: part.grid.origin,
        step_exponent: part.grid.step_exponent,
        flags: flag(part.attributes == Attributes::Colour, PartRow::COLOURED)
            | flag(part.attributes == Attributes::Slot, PartRow::SLOTTED)
            | flag(cell, PartRow::CELL)
            | flag(part.closure != Closure::Open, PartRow::CLOSED)
            | flag(part.closure == Closure::InsideOut, PartRow::INSIDE_OUT),
        grid_low,
        grid_high,
        vertices: part.vertices.len() as u32,
        triangles: part.tiers.first().map_or(0, |finest| finest.triangles.len() as u32),
        locked: part.locked,
        coarsest_triangles: part.triangles_at.count_at(part.locked as usize),
        tier_count: part.tiers.len() as u32,
        errors: part.errors,
        stall: part.stall as u8,
        parent_distance: part.place.parent_distance,
        leaf_cells: part.place.leaf_cells,
        slots: slots(part),
        ..PartRow::default()
    }
}

/// How many material slots the vertices of a part use.
fn slots(part: &OrderedPart) -> u32 {
    let used = part.vertices.iter().map(|vertex| Attributes::Slot.tag(vertex.attributes()) + 1);
    if part.attributes == Attributes::Slot { used.max().unwrap_or(0) } else { 0 }
}
