//! Frame records in; CSV, the summary of a flight, and Table 1 of Peng & Cao 2012 out.

pub mod human;
mod table;

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde::{Deserialize, Serialize};

use super::FrameRecord;
pub use table::comparison_table;

/// Writes the header and one line per record.
///
/// # Errors
/// Those of the writer.
pub fn write_csv(mut to: impl Write, records: &[FrameRecord]) -> io::Result<()> {
    writeln!(to, "{}", FrameRecord::COLUMNS.join(","))?;
    for record in records {
        writeln!(to, "{}", record.values().join(","))?;
    }
    to.flush()
}

/// What a summary says besides the numbers of its frames.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Flight {
    /// The adapter's name and driver; the CPU reference says so here.
    pub adapter: String,
    /// `coherent`, `whole` or `per-part`.
    pub strategy: String,
    /// `cpu` or `gpu`.
    pub select: String,
    /// The camera path, a name or a file.
    pub path: String,
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
    /// The vertices that a frame may spend.
    pub budget_vertices: u64,
    /// A hash over the index content of every frame, in hexadecimal.
    pub index_hash: String,
    /// The same over the vertex content.
    pub vertex_hash: String,
    /// Whether GPU stages were measured by timestamps on the GPU; otherwise by the CPU around a wait.
    pub gpu_timestamps: bool,
    /// The version of this program.
    #[serde(default)]
    pub version: String,
    /// The command line as it was typed, quoted where a shell needs it.
    #[serde(default)]
    pub command: String,
    /// The processor's name, where the system tells.
    #[serde(default)]
    pub cpu: Option<String>,
    /// How many threads may run at once; `None` where the system does not tell.
    #[serde(default)]
    pub cores: Option<u64>,
    /// The machine's memory, where the system tells.
    #[serde(default)]
    pub memory_bytes: Option<u64>,
    /// The container's file name, without its folder.
    #[serde(default)]
    pub model: String,
    /// Distinct parts of the model; one that was cut into cells counts once.
    #[serde(default)]
    pub parts: u64,
    /// Placements of parts, before the cut into cells.
    #[serde(default)]
    pub instances: u64,
    /// Triangles of the model, summed over the placements of its parts.
    #[serde(default)]
    pub model_triangles: u64,
    /// Size of the container.
    #[serde(default)]
    pub file_bytes: u64,
    /// Whether frames drew what had arrived instead of waiting for the disk.
    #[serde(default)]
    pub live: bool,
    /// The cap on the model's memory.
    #[serde(default)]
    pub memory_limit_bytes: Option<u64>,
    /// The cap on GPU memory.
    #[serde(default)]
    pub gpu_limit_bytes: Option<u64>,
    /// Bytes a second that were read at most, if that was limited.
    #[serde(default)]
    pub read_rate: Option<u64>,
    /// Milliseconds for opening the container: its tables, read and checked.
    #[serde(default)]
    pub open_ms: f64,
}

/// The summary of one flight, as in `summary.json`. `_mean` is over frames, `stage_ms` means by stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// What was flown, and how.
    #[serde(flatten)]
    pub flight: Flight,
    /// How many frames.
    pub frames: u64,
    /// Triangles drawn.
    pub active_triangles_mean: f64,
    /// Vertices drawn.
    pub active_vertices_mean: f64,
    /// Triangles sent.
    pub streamed_triangles_mean: f64,
    /// Vertices sent.
    pub streamed_vertices_mean: f64,
    /// Bytes sent in all.
    pub bytes_sent_total: u64,
    /// What strategy `whole` would have sent in all.
    pub bytes_whole_total: u64,
    /// What strategy `per-part` would have sent in all.
    pub bytes_per_part_total: u64,
    /// Bytes sent after the first frame over those that `whole` would have sent then; `None` after one frame.
    pub steady_share: Option<f64>,
    /// `bytes_whole_total` over `bytes_sent_total`; `null` where nothing was sent.
    pub transfer_saving: Option<f64>,
    /// The median frame.
    pub frame_ms_p50: f64,
    /// The slowest frame in a hundred.
    pub frame_ms_p99: f64,
    /// The slowest frame in a thousand; the slowest of all in a flight of less.
    #[serde(default)]
    pub frame_ms_p999: f64,
    /// The mean frame.
    pub frame_ms_mean: f64,
    /// From the start of opening until nine tenths of the projected area had something drawn.
    #[serde(default)]
    pub first_picture_ms: Option<f64>,
    /// From the start of opening until half of the vertices that were wished for were drawn.
    #[serde(default)]
    pub half_detail_ms: Option<f64>,
    /// From the start of opening until nothing was missing any more.
    #[serde(default)]
    pub full_detail_ms: Option<f64>,
    /// Mean milliseconds by stage.
    pub stage_ms: BTreeMap<String, f64>,
    /// Mean milliseconds by pass of the GPU; `None` for one that never took any time.
    #[serde(default)]
    pub pass_ms: BTreeMap<String, Option<f64>>,
    /// Mean bytes that each pass must move in the GPU's memory ([`super::floor`]).
    #[serde(default)]
    pub floor_bytes: BTreeMap<String, f64>,
    /// Instances of which less had arrived than was wished for, in all frames.
    pub misses_total: u64,
    /// Bytes read from disk in all.
    pub disk_bytes_total: u64,
    /// Pages that the thread of the frames had to wait for.
    #[serde(default)]
    pub major_faults_total: u64,
    /// Compute passes in all.
    pub compute_passes_total: u64,
    /// The most GPU memory in use.
    pub gpu_bytes_peak: u64,
    /// The most payload held in memory.
    pub resident_bytes_peak: u64,
    /// The peak resident size of the process, where the system tells.
    pub peak_rss_bytes: Option<u64>,
}

impl Summary {
    /// Sums up a flight.
    pub fn new(flight: Flight, records: &[FrameRecord]) -> Self {
        let total = |field: fn(&FrameRecord) -> u64| {
            records.iter().fold(0u64, |sum, record| sum.saturating_add(field(record)))
        };
        let mean = |field: fn(&FrameRecord) -> u64| total(field) as f64 / records.len().max(1) as f64;
        let peak = |field: fn(&FrameRecord) -> u64| records.iter().map(field).max().unwrap_or(0);
        let frame_ms: Vec<f64> = records.iter().map(|record| record.frame_ms).collect();
        let (sent, whole) = (total(|r| r.bytes_sent), total(|r| r.bytes_whole));
        Self {
            flight,
            frames: records.len() as u64,
            active_triangles_mean: mean(|r| r.active_triangles),
            active_vertices_mean: mean(|r| r.active_vertices),
            streamed_triangles_mean: mean(|r| r.streamed_triangles),
            streamed_vertices_mean: mean(|r| r.streamed_vertices),
            bytes_sent_total: sent,
            bytes_whole_total: whole,
            bytes_per_part_total: total(|r| r.bytes_per_part),
            transfer_saving: (sent > 0).then(|| whole as f64 / sent as f64),
            steady_share: steady_share(records),
            frame_ms_p50: percentile(&frame_ms, 50.0),
            frame_ms_p99: percentile(&frame_ms, 99.0),
            frame_ms_p999: percentile(&frame_ms, 99.9),
            frame_ms_mean: frame_ms.iter().sum::<f64>() / records.len().max(1) as f64,
            first_picture_ms: reached(records, |r| r.drawn_area_permille >= FIRST_PICTURE_PERMILLE),
            half_detail_ms: reached(records, |r| 2 * r.active_vertices >= r.wished_vertices),
            full_detail_ms: reached(records, is_full),
            stage_ms: stage_means(records),
            pass_ms: pass_means(records, |ms, _| ms)
                .map(|(pass, ms)| (pass.to_owned(), (ms > 0.0).then_some(ms)))
                .collect(),
            floor_bytes: pass_means(records, |_, bytes| bytes as f64)
                .map(|(pass, bytes)| (pass.to_owned(), bytes))
                .collect(),
            misses_total: total(|r| r.misses),
            disk_bytes_total: total(|r| r.disk_bytes),
            major_faults_total: total(|r| r.major_faults),
            compute_passes_total: total(|r| r.compute_passes),
            gpu_bytes_peak: peak(|r| r.gpu_bytes),
            resident_bytes_peak: peak(|r| r.resident_bytes),
            peak_rss_bytes: super::memory::peak_resident_bytes(),
        }
    }

    /// Mean milliseconds of a stage; zero for one that is not known.
    pub fn stage(&self, name: &str) -> f64 {
        self.stage_ms.get(name).copied().unwrap_or(0.0)
    }
}

/// So much of the projected area makes a picture.
const FIRST_PICTURE_PERMILLE: u64 = 900;

/// When the first frame was done of which something is true.
fn reached(records: &[FrameRecord], is_there: impl Fn(&FrameRecord) -> bool) -> Option<f64> {
    records.iter().find(|record| is_there(record)).map(|record| record.elapsed_ms)
}

/// Whether a frame lacks nothing. Wishes are rounded to states, which may leave the last few vertices unspent.
fn is_full(record: &FrameRecord) -> bool {
    record.misses == 0 && 100 * record.active_vertices >= 99 * record.wished_vertices
}

/// The first frame must send everything whatever the strategy; what follows shows the coherence.
fn steady_share(records: &[FrameRecord]) -> Option<f64> {
    let later = records.get(1..)?;
    let (sent, whole) = later.iter().fold((0u64, 0u64), |(sent, whole), record| {
        (sent.saturating_add(record.bytes_sent), whole.saturating_add(record.bytes_whole))
    });
    (whole > 0).then(|| sent as f64 / whole as f64)
}

fn stage_means(records: &[FrameRecord]) -> BTreeMap<String, f64> {
    let frames = records.len().max(1) as f64;
    let mut means: BTreeMap<String, f64> =
        FrameRecord::default().stages_ms().map(|(stage, zero)| (stage.to_owned(), zero)).into();
    for (stage, ms) in records.iter().flat_map(FrameRecord::stages_ms) {
        *means.entry(stage.to_owned()).or_default() += ms / frames;
    }
    means
}

/// The mean of one figure of every pass, of its milliseconds and its bytes.
fn pass_means(
    records: &[FrameRecord],
    figure: fn(f64, u64) -> f64,
) -> impl Iterator<Item = (&'static str, f64)> {
    let frames = records.len().max(1) as f64;
    let mut means = FrameRecord::default().passes().map(|(pass, ..)| (pass, 0.0));
    for record in records {
        for (mean, (_, ms, bytes)) in means.iter_mut().zip(record.passes()) {
            mean.1 += figure(ms, bytes) / frames;
        }
    }
    means.into_iter()
}

/// The nearest-rank percentile (`percent` from 0 to 100): the least value that at least that share does not exceed.
/// Zero for no values.
pub fn percentile(values: &[f64], percent: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (percent / 100.0 * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1).min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records() -> Vec<FrameRecord> {
        (0..4)
            .map(|frame| FrameRecord {
                frame,
                active_triangles: 10 * frame,
                bytes_sent: 5,
                bytes_whole: 50,
                draw_ms: frame as f64,
                frame_ms: 10.0 - frame as f64,
                gpu_bytes: frame,
                ..Default::default()
            })
            .collect()
    }

    #[test]
    fn csv_has_a_header_and_a_line_per_frame() {
        let mut text = Vec::new();
        write_csv(&mut text, &records()).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[0].starts_with("frame,instances_visible,instances_culled,active_vertices,"));
        assert_eq!(lines.len(), 5);
        assert!(lines.iter().all(|line| line.split(',').count() == FrameRecord::COLUMNS.len()));
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!([0.0, 50.0, 99.0, 100.0].map(|p| percentile(&values, p)), [1.0, 50.0, 99.0, 100.0]);
        assert_eq!(percentile(&[], 50.0), 0.0);
        assert_eq!(percentile(&[7.0], 99.0), 7.0);
    }

    #[test]
    fn summaries_add_up_and_keep_the_promised_names() {
        let summary = Summary::new(Flight::default(), &records());
        assert_eq!(summary.transfer_saving, Some(10.0));
        assert_eq!((summary.active_triangles_mean, summary.gpu_bytes_peak), (15.0, 3));
        assert_eq!((summary.stage("draw"), summary.frame_ms_p50), (1.5, 8.0));
        let json = serde_json::to_value(&summary).unwrap();
        for key in [
            "adapter",
            "strategy",
            "frames",
            "budget_vertices",
            "active_triangles_mean",
            "active_vertices_mean",
            "bytes_sent_total",
            "bytes_whole_total",
            "transfer_saving",
            "frame_ms_p50",
            "frame_ms_p99",
            "frame_ms_p999",
            "stage_ms",
            "gpu_bytes_peak",
            "resident_bytes_peak",
            "index_hash",
            "vertex_hash",
            "width",
            "height",
            "path",
            "select",
        ] {
            assert!(json.get(key).is_some(), "{key}");
        }
        assert_eq!(serde_json::from_value::<Summary>(json).unwrap(), summary);
    }

    #[test]
    fn detail_is_reached_in_the_first_frame_that_has_it() {
        let frame = |frame: u64, area: u64, active: u64, misses: u64| FrameRecord {
            frame,
            elapsed_ms: 100.0 + frame as f64,
            drawn_area_permille: area,
            active_vertices: active,
            wished_vertices: 1000,
            misses,
            ..Default::default()
        };
        let records =
            [frame(0, 0, 0, 9), frame(1, 899, 499, 9), frame(2, 900, 500, 5), frame(3, 950, 999, 1)];
        let summary = Summary::new(Flight::default(), &records);
        assert_eq!((summary.first_picture_ms, summary.half_detail_ms), (Some(102.0), Some(102.0)));
        assert_eq!(summary.full_detail_ms, None, "one instance is missing");
        let full = Summary::new(Flight::default(), &[records[1], frame(4, 1000, 995, 0)]);
        assert_eq!((full.first_picture_ms, full.full_detail_ms), (Some(104.0), Some(104.0)));
        let held_back = Summary::new(Flight::default(), &[frame(0, 1000, 980, 0)]);
        assert_eq!(held_back.full_detail_ms, None, "an upload was held back");
    }

    #[test]
    fn summaries_of_older_versions_can_be_read() {
        let mut json = serde_json::to_value(Summary::new(Flight::default(), &records())).unwrap();
        let object = json.as_object_mut().unwrap();
        for key in [
            "version",
            "command",
            "cpu",
            "cores",
            "memory_bytes",
            "model",
            "parts",
            "frame_ms_p999",
            "pass_ms",
            "floor_bytes",
        ] {
            assert!(object.remove(key).is_some(), "{key}");
        }
        let summary: Summary = serde_json::from_value(json).unwrap();
        assert_eq!((summary.frames, summary.flight.cpu, summary.frame_ms_p999), (4, None, 0.0));
    }

    #[test]
    fn passes_have_means_and_those_without_time_none() {
        let frame = |ms: f64, bytes: u64| FrameRecord {
            grant_ms: ms,
            defragment_ms: 5.0 * ms,
            grant_floor_bytes: bytes,
            ..Default::default()
        };
        let summary = Summary::new(Flight::default(), &[frame(1.0, 10), frame(0.0, 0)]);
        assert_eq!((summary.pass_ms["grant"], summary.floor_bytes["grant"]), (Some(0.5), 5.0));
        assert_eq!((summary.pass_ms["defragment"], summary.pass_ms["draw"]), (Some(2.0), None));
        assert_eq!(summary.pass_ms.len(), summary.floor_bytes.len());
    }

    #[test]
    fn a_flight_of_no_frames_divides_by_nothing() {
        let summary = Summary::new(Flight::default(), &[]);
        assert_eq!((summary.frames, summary.transfer_saving, summary.frame_ms_p99), (0, None, 0.0));
        assert!(summary.active_triangles_mean == 0.0);
    }
}
