//! What a bake says of one part: its cells and what its weld found in, one line of the report's list out.

use serde::Serialize;

use crate::container::{Contents, StoredPart, slots};
use crate::geometry::OrderedPart;
use crate::geometry::body::WeldCounts;
use crate::geometry::record::{ERROR_SAMPLES, Stall, decode_error};

/// What the weld of a mesh found, and its boundary before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct PartWeld {
    pub counts: WeldCounts,
    /// Vertices on open edges, by the file's own indices.
    pub open_in_file: usize,
}

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
    /// Triangles in the file.
    pub source_triangles: u64,
    /// Vertices in the file.
    pub source_vertices: u64,
    /// Vertices on edges of one triangle, by the file's own indices.
    pub source_open_vertices: u64,
    /// Positions after the weld.
    pub welded_positions: u64,
    /// Positions that moved onto another one within the weld tolerance.
    pub moved_positions: u64,
    /// Triangles dropped because two corners share a position.
    pub degenerate_triangles: u64,
    /// Triangles dropped because they repeat another.
    pub duplicate_triangles: u64,
    /// Positions on open edges after the weld.
    pub open_positions: u64,
    /// Positions on borders to other meshes of the body, which are locked.
    pub shared_positions: u64,
    /// Edges of more than two triangles after the weld.
    pub non_manifold_edges: u64,
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

/// All parts of a container; `welds` has an entry for each, in their order.
pub(super) fn part_list(contents: &Contents, welds: &[PartWeld]) -> Vec<PartReport> {
    let mut instances = vec![0; contents.parts.len()];
    for instance in &contents.instances {
        instances[instance.part as usize] += 1;
    }
    let parts = contents.parts.chunk_by(|a, b| a.source == b.source);
    let mut first = 0;
    let report = |(cells, weld): (&[StoredPart], &PartWeld)| {
        // The first cell of a part stands for all.
        let report = PartReport { instances: instances[first], ..PartReport::new(cells, weld) };
        first += cells.len();
        report
    };
    parts.zip(welds).map(report).collect()
}

impl PartReport {
    fn new(cells: &[StoredPart], weld: &PartWeld) -> Self {
        let parts = || cells.iter().map(|cell| &cell.part);
        let leaves = || parts().filter(|part| part.place.leaf_cells == 0);
        let roots = || parts().filter(|part| part.place.parent_distance == 0);
        Self {
            name: cells[0].name.clone(),
            cells: cells.len() as u64,
            materials: parts().map(slots).max().unwrap_or(0).max(1),
            triangles: leaves().map(|part| u64::from(part.triangle_count())).sum(),
            vertices: leaves().map(|part| part.vertices.len() as u64).sum(),
            locked_vertices: roots().map(|part| u64::from(part.locked)).sum(),
            coarsest_triangles: roots().map(|part| u64::from(part.coarsest_triangles())).sum(),
            coarsest_error: roots().map(last_error).fold(0.0, f64::max),
            stall: roots().map(|part| part.stall).find(|&stall| stall != Stall::None).map(Stall::describe),
            tiers: parts().map(|part| part.tiers.len() as u64).max().unwrap_or(0),
            payload_bytes: parts().map(payload_bytes).sum(),
            ..Self::of_weld(weld)
        }
    }

    fn of_weld(PartWeld { counts, open_in_file }: &PartWeld) -> Self {
        Self {
            source_triangles: counts.source_triangles as u64,
            source_vertices: counts.source_vertices as u64,
            source_open_vertices: *open_in_file as u64,
            welded_positions: counts.positions as u64,
            moved_positions: counts.moved as u64,
            degenerate_triangles: counts.degenerate as u64,
            duplicate_triangles: counts.duplicate as u64,
            open_positions: counts.edges.open_positions as u64,
            shared_positions: counts.shared as u64,
            non_manifold_edges: counts.edges.non_manifold_edges as u64,
            ..Self::default()
        }
    }
}

/// The last error that the container states for a cell, in part units.
fn last_error(part: &OrderedPart) -> f64 {
    decode_error(part.errors[ERROR_SAMPLES - 1], part.diagonal())
}

/// The chunks of a cell: a triangle list a tier, and every vertex once.
fn payload_bytes(part: &OrderedPart) -> u64 {
    let triangles: usize = part.tiers.iter().map(|tier| tier.triangles.len()).sum();
    (8 * triangles + (12 + 2 + 1) * part.vertices.len() + 8 * part.triangles_at.overflow().len()) as u64
}
