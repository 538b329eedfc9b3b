//! What a bake says of itself, as JSON and in ten lines.

use serde::Serialize;

use crate::container::{Contents, Written};
use crate::geometry::OrderedPart;
use crate::geometry::body::PartOutcome;
use crate::geometry::record::{CellPlace, Stall};
use crate::import::Model;

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
    /// Triangles dropped because two corners share a position.
    pub degenerate_triangles: u64,
    /// Triangles dropped because they repeat another.
    pub duplicate_triangles: u64,
    /// Positions on open edges after the weld.
    pub open_positions: u64,
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

/// The counts that the model and the outcomes give.
pub(super) fn counted(model: &Model, outcomes: &[Option<PartOutcome>]) -> BakeReport {
    let mut report = BakeReport { notes: model.notes.clone(), ..BakeReport::default() };
    for (mesh, outcome) in model.meshes.iter().zip(outcomes) {
        let Some(outcome) = outcome else { continue };
        report.add(&mesh.name, outcome);
    }
    let per_mesh = |mesh: u32| {
        let cells = outcomes[mesh as usize].iter().flat_map(|outcome| &outcome.cells);
        cells
            .filter(|cell| cell.place.leaf_cells == 0)
            .map(|part| u64::from(part.triangle_count()))
            .sum::<u64>()
    };
    let placed = model.instances.iter().map(|instance| per_mesh(instance.mesh));
    (report.instances, report.triangles_placed) = placed
        .filter(|&triangles| triangles > 0)
        .fold((0, 0), |(count, sum), triangles| (count + 1, sum + triangles));
    report
}

/// The part, if one of its roots stalls.
fn stalled(name: &str, cells: &[OrderedPart]) -> Option<StalledPart> {
    let cause = cells.iter().map(|cell| cell.stall).find(|&stall| stall != Stall::None)?;
    let sum = |of: fn(&OrderedPart) -> u32, which: fn(&CellPlace) -> bool| {
        cells.iter().filter(|cell| which(&cell.place)).map(|cell| u64::from(of(cell))).sum()
    };
    Some(StalledPart {
        name: name.to_owned(),
        triangles: sum(OrderedPart::triangle_count, |place| place.leaf_cells == 0),
        coarsest_triangles: sum(OrderedPart::coarsest_triangles, |place| place.parent_distance == 0),
        cause: cause.describe(),
    })
}

impl BakeReport {
    fn add(&mut self, name: &str, outcome: &PartOutcome) {
        let weld = &outcome.weld;
        self.source_triangles += weld.source_triangles as u64;
        self.source_vertices += weld.source_vertices as u64;
        self.welded_positions += weld.positions as u64;
        self.degenerate_triangles += weld.degenerate as u64;
        self.duplicate_triangles += weld.duplicate as u64;
        self.open_positions += weld.edges.open_positions as u64;
        self.non_manifold_edges += weld.edges.non_manifold_edges as u64;
        self.parts += u64::from(!outcome.cells.is_empty());
        for part in outcome.cells.iter().filter(|part| part.place.leaf_cells == 0) {
            self.vertices += part.vertices.len() as u64;
            self.triangles += u64::from(part.triangle_count());
        }
        for part in outcome.cells.iter().filter(|part| part.place.parent_distance == 0) {
            self.locked_vertices += u64::from(part.locked);
            self.coarsest_triangles += u64::from(part.coarsest_triangles());
        }
        self.stalled_parts.extend(stalled(name, &outcome.cells));
    }

    /// Adds what is known when the container is written; `seconds` for import, ordering, and all.
    pub(super) fn finish(&mut self, contents: &Contents, written: &Written, seconds: [f64; 3]) {
        self.cells = contents.parts.len() as u64;
        self.file_bytes = written.file_bytes;
        [self.import_seconds, self.order_seconds, self.seconds] = seconds;
        self.triangles_per_second = self.source_triangles as f64 / self.seconds.max(1e-9);
        self.bytes_per_triangle = self.file_bytes as f64 / self.triangles.max(1) as f64;
        self.peak_rss_bytes = crate::stats::memory::peak_resident_bytes();
    }
}
