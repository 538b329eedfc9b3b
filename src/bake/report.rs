//! What a bake says of itself, as JSON and in ten lines.

use serde::Serialize;

use crate::container::{Contents, StoredPart, Written};
use crate::geometry::OrderedPart;
use crate::geometry::body::WeldCounts;
use crate::geometry::record::{CellPlace, Stall};

/// What was read, what became of it, and what it cost.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BakeReport {
    /// Distinct parts (a part that was cut into cells counts once).
    pub parts: u64,
    /// Parts of the container: cells of cut parts count each.
    pub cells: u64,
    /// Placements of parts.
    pub instances: u64,
    /// Vertices of all parts.
    pub vertices: u64,
    /// Triangles of all parts.
    pub triangles: u64,
    /// Triangles summed over the placements.
    pub triangles_placed: u64,
    /// Vertices that no state drops (`q` of all parts).
    pub locked_vertices: u64,
    /// Triangles of all parts in their coarsest states.
    pub coarsest_triangles: u64,
    /// Size of the container.
    pub file_bytes: u64,
    /// Triangles in the input files.
    pub source_triangles: u64,
    /// Vertices in the input files.
    pub source_vertices: u64,
    /// Positions after the weld.
    pub welded_positions: u64,
    /// Positions on open edges that moved onto another one within the weld tolerance.
    pub moved_positions: u64,
    /// Triangles dropped because two corners share a position.
    pub degenerate_triangles: u64,
    /// Triangles dropped because they repeat another.
    pub duplicate_triangles: u64,
    /// Positions on open edges after the weld.
    pub open_positions: u64,
    /// Positions on borders between meshes of one body, which differ in material.
    pub shared_positions: u64,
    /// Edges of more than two triangles after the weld.
    pub non_manifold_edges: u64,
    /// Parts whose coarsest state keeps more than a tenth of their triangles.
    pub stalled_parts: Vec<StalledPart>,
    /// What was skipped or mended while reading.
    pub notes: Vec<String>,
    /// Seconds for reading the input.
    pub import_seconds: f64,
    /// Seconds for ordering all parts.
    pub order_seconds: f64,
    /// Seconds in all.
    pub seconds: f64,
    /// Source triangles per second, everything included.
    pub triangles_per_second: f64,
    /// Container bytes per triangle.
    pub bytes_per_triangle: f64,
    /// Peak resident memory of the process; `null` where the system does not tell.
    pub peak_rss_bytes: Option<u64>,
}

/// A part that could not be made coarse.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StalledPart {
    /// Its name in the file.
    pub name: String,
    /// Its triangles.
    pub triangles: u64,
    /// Those of its coarsest state.
    pub coarsest_triangles: u64,
    /// What stopped it.
    pub cause: &'static str,
}

/// The part with these cells, if one of its roots stalls.
fn stalled(cells: &[StoredPart]) -> Option<StalledPart> {
    let cause = cells.iter().map(|cell| cell.part.stall).find(|&stall| stall != Stall::None)?;
    let (triangles, coarsest_triangles) = triangles_of(cells);
    let name = cells[0].name.clone();
    Some(StalledPart { name, triangles, coarsest_triangles, cause: cause.describe() })
}

/// Triangles of a part: of its leaf cells, and of the coarsest states of its roots.
fn triangles_of(cells: &[StoredPart]) -> (u64, u64) {
    let sum = |of: fn(&OrderedPart) -> u32, which: fn(&CellPlace) -> bool| {
        let chosen = cells.iter().filter(|cell| which(&cell.part.place));
        chosen.map(|cell| u64::from(of(&cell.part))).sum::<u64>()
    };
    let whole = sum(OrderedPart::triangle_count, |place| place.leaf_cells == 0);
    (whole, sum(OrderedPart::coarsest_triangles, |place| place.parent_distance == 0))
}

impl BakeReport {
    /// What was read and welded.
    pub(super) fn new<'a>(notes: &[String], welds: impl Iterator<Item = &'a WeldCounts>) -> Self {
        let mut report = Self { notes: notes.to_vec(), ..Self::default() };
        for weld in welds {
            report.source_triangles += weld.source_triangles as u64;
            report.source_vertices += weld.source_vertices as u64;
            report.welded_positions += weld.positions as u64;
            report.moved_positions += weld.moved as u64;
            report.degenerate_triangles += weld.degenerate as u64;
            report.duplicate_triangles += weld.duplicate as u64;
            report.open_positions += weld.edges.open_positions as u64;
            report.shared_positions += weld.shared as u64;
            report.non_manifold_edges += weld.edges.non_manifold_edges as u64;
        }
        report
    }

    /// What the parts and their placements are.
    fn count(&mut self, contents: &Contents) {
        self.cells = contents.parts.len() as u64;
        let mut first = 0;
        let mut triangles_at = vec![0; contents.parts.len()];
        for cells in contents.parts.chunk_by(|a, b| a.source == b.source) {
            let (triangles, coarsest) = triangles_of(cells);
            self.parts += 1;
            self.triangles += triangles;
            self.coarsest_triangles += coarsest;
            triangles_at[first] = triangles;
            first += cells.len();
            for OrderedPart { vertices, locked, place, .. } in cells.iter().map(|cell| &cell.part) {
                self.vertices += if place.leaf_cells == 0 { vertices.len() as u64 } else { 0 };
                self.locked_vertices += if place.parent_distance == 0 { u64::from(*locked) } else { 0 };
            }
            self.stalled_parts.extend(stalled(cells));
        }
        // The first cell of a part stands for all.
        let placed = contents.instances.iter().map(|instance| triangles_at[instance.part as usize]);
        for triangles in placed.filter(|&triangles| triangles > 0) {
            self.instances += 1;
            self.triangles_placed += triangles;
        }
    }

    /// Adds what is known when the container is written; `seconds` for import, ordering, and all.
    pub(super) fn finish(&mut self, contents: &Contents, written: &Written, seconds: [f64; 3]) {
        self.count(contents);
        self.file_bytes = written.file_bytes;
        [self.import_seconds, self.order_seconds, self.seconds] = seconds;
        self.triangles_per_second = self.source_triangles as f64 / self.seconds.max(1e-9);
        self.bytes_per_triangle = self.file_bytes as f64 / self.triangles.max(1) as f64;
        self.peak_rss_bytes = crate::stats::memory::peak_resident_bytes();
    }
}
