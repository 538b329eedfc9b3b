//! What a bake says of one part: its cells and what its weld found in, one line of the report's list out.

use serde::Serialize;

use super::welded::Welded;
use crate::container::{ChunkRow, PartRow};
use crate::geometry::record::{ERROR_SAMPLES, Stall, decode_error};

/// One part, with all its cells.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PartReport {
    /// Its name in the file.
    pub name: String,
    /// How often it is placed.
    pub instances: u64,
    /// Rows of the container's part table: leaf cells and parent cells.
    pub cells: u64,
    /// Materials that its vertices have slots for; 1 without slots.
    pub materials: u32,
    /// Its triangles.
    pub triangles: u64,
    /// Its vertices.
    pub vertices: u64,
    /// What was read of it, and what its weld found.
    #[serde(flatten)]
    pub welded: Welded,
    /// Vertices of its coarsest state.
    pub locked_vertices: u64,
    /// Triangles of its coarsest state.
    pub coarsest_triangles: u64,
    /// The largest last error sample of its roots, in part units.
    pub coarsest_error: f64,
    /// What stopped it; `None` if no root keeps more than a tenth of what it stands for.
    pub stall: Option<&'static str>,
    /// Tiers of the cell that has most.
    pub tiers: u64,
    /// Its chunks in the container, without padding.
    pub payload_bytes: u64,
}

impl PartReport {
    /// From the rows of its cells and of all their chunks, and what the weld found.
    pub(super) fn new<'a>(
        name: &str,
        instances: u64,
        cells: &[PartRow],
        chunks: impl Iterator<Item = &'a ChunkRow>,
        welded: Welded,
    ) -> Self {
        let leaves = || cells.iter().filter(|cell| !cell.is_parent());
        let roots = || cells.iter().filter(|cell| cell.is_root());
        Self {
            name: name.to_owned(),
            instances,
            cells: cells.len() as u64,
            materials: cells.iter().map(|cell| cell.slots).max().unwrap_or(0).max(1),
            triangles: leaves().map(|cell| u64::from(cell.triangles)).sum(),
            vertices: leaves().map(|cell| u64::from(cell.vertices)).sum(),
            locked_vertices: roots().map(|cell| u64::from(cell.locked)).sum(),
            coarsest_triangles: roots().map(|cell| u64::from(cell.coarsest_triangles)).sum(),
            coarsest_error: roots().map(last_error).fold(0.0, f64::max),
            stall: roots().map(PartRow::stall).find(|&stall| stall != Stall::None).map(Stall::describe),
            tiers: cells.iter().map(|cell| u64::from(cell.tier_count)).max().unwrap_or(0),
            welded,
            payload_bytes: chunks.map(|chunk| u64::from(chunk.bytes)).sum(),
        }
    }
}

/// The last error that the container states for a cell, in part units.
fn last_error(cell: &PartRow) -> f64 {
    let extent =
        (0..3).map(|axis| f64::from(cell.grid_high[axis].saturating_sub(cell.grid_low[axis])).powi(2));
    decode_error(cell.errors[ERROR_SAMPLES - 1], extent.sum::<f64>().sqrt() * cell.grid().step())
}
