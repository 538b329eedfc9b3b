//! What a bake says of itself, as JSON and in ten lines.

use serde::Serialize;

use super::bodies::Body;
use super::ledger::Ledger;
use super::named_parts;
use super::part_report::PartReport;
use super::source::Outline;
use super::welded::Welded;
use crate::container::Written;

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
    /// What was read, and what the welds found.
    #[serde(flatten)]
    pub welded: Welded,
    /// Parts whose coarsest state keeps more than a tenth of their triangles.
    pub stalled_parts: Vec<StalledPart>,
    /// What was skipped or mended while reading.
    pub notes: Vec<String>,
    /// Seconds for reading the input.
    pub import_seconds: f64,
    /// Seconds for ordering all parts.
    pub order_seconds: f64,
    /// Seconds for writing the container.
    pub write_seconds: f64,
    /// Seconds in all.
    pub seconds: f64,
    /// Source triangles per second, everything included.
    pub triangles_per_second: f64,
    /// Container bytes per triangle.
    pub bytes_per_triangle: f64,
    /// Peak resident memory of the process; `null` where the system does not tell.
    pub peak_rss_bytes: Option<u64>,
    /// Resident memory of the process before the input was read; `null` where the system does not tell.
    pub rss_before_bytes: Option<u64>,
    /// Every part, in the container's order, if it was asked for; not part of the summary.
    #[serde(skip)]
    pub part_list: Vec<PartReport>,
}

/// The summary with one object for each part: what `bake --report` writes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WholeReport<'a> {
    /// The summary.
    #[serde(flatten)]
    pub summary: &'a BakeReport,
    /// Every part, in the container's order.
    pub part_list: &'a [PartReport],
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

impl BakeReport {
    /// What was read and welded, and the parts that came of it; `placed` says how often each row of parts is.
    pub(super) fn new(
        outline: &Outline,
        bodies: &[Body],
        ledger: &Ledger,
        placed: &[u32],
        list_parts: bool,
    ) -> Self {
        let mut report = Self { notes: outline.notes.clone(), ..Self::default() };
        let (starts, mut first) = (ledger.chunk_starts(), 0);
        let mut named = named_parts(outline, bodies, ledger);
        for row in (0..bodies.len()).flat_map(|body| ledger.meshes(body)) {
            // A weld may have left no part.
            report.welded += row.welded;
            let Some((name, cells)) = (row.cells > 0).then(|| named.next()).flatten() else { continue };
            let chunks =
                starts[first..].iter().zip(cells).flat_map(|(&start, cell)| ledger.chunks(start, cell));
            // The first cell of a part stands for all.
            let part = PartReport::new(name, placed[first].into(), cells, chunks, row.welded);
            first += cells.len();
            report.count_part(&part);
            if list_parts {
                report.part_list.push(part);
            }
        }
        report
    }

    fn count_part(&mut self, part: &PartReport) {
        self.parts += 1;
        self.cells += part.cells;
        self.instances += part.instances;
        self.vertices += part.vertices;
        self.triangles += part.triangles;
        self.triangles_placed += part.triangles * part.instances;
        self.locked_vertices += part.locked_vertices;
        self.coarsest_triangles += part.coarsest_triangles;
        self.stalled_parts.extend(StalledPart::of(part));
    }

    /// The summary and the list of parts.
    pub fn whole(&self) -> WholeReport<'_> {
        WholeReport { summary: self, part_list: &self.part_list }
    }

    /// Adds what is known when the container is written; `seconds` for ordering, writing, and both.
    pub(super) fn finish(&mut self, written: &Written, seconds: [f64; 3]) {
        self.file_bytes = written.file_bytes;
        [self.order_seconds, self.write_seconds, self.seconds] = seconds;
        self.triangles_per_second = self.welded.source_triangles as f64 / self.seconds.max(1e-9);
        self.bytes_per_triangle = self.file_bytes as f64 / self.triangles.max(1) as f64;
        self.peak_rss_bytes = crate::stats::memory::peak_resident_bytes();
    }

    /// Adds the time that reading the input took, and what was resident before.
    pub(super) fn add_import(&mut self, seconds: f64, rss_before_bytes: Option<u64>) {
        self.rss_before_bytes = rss_before_bytes;
        self.import_seconds = seconds;
        self.seconds += seconds;
        self.triangles_per_second = self.welded.source_triangles as f64 / self.seconds.max(1e-9);
    }
}

impl StalledPart {
    /// The part, if it stalls.
    fn of(part: &PartReport) -> Option<Self> {
        let &PartReport { triangles, coarsest_triangles, stall, .. } = part;
        Some(Self { name: part.name.clone(), triangles, coarsest_triangles, cause: stall? })
    }
}
