//! Flights in; rows of the paper's Tables 1 and 2 out, the paper's numbers among ours.

use super::paper::{self, FRAMES, Frame, STREAMING, Streaming};
use super::plots::{digits, share};
use super::read::Flown;
use crate::stats::report::human;

/// A row: what it is of, and its numbers.
#[derive(Debug)]
pub struct Row {
    /// The strategy, or the model.
    pub head: String,
    /// The camera setting of the paper, or the flight.
    pub run: String,
    /// Whether we measured it.
    pub is_ours: bool,
    /// The numbers.
    pub cells: Vec<String>,
}

/// The columns of Table 1 with their units.
pub const STREAMING_COLUMNS: [(&str, &str); 11] = [
    ("FPS", "1/s"),
    ("Collection", "CPU ms"),
    ("Transfer", "ms"),
    ("Defragment", "GPU ms"),
    ("Streaming", "sum, ms"),
    ("over SC", "same run"),
    ("Active", "triangles"),
    ("Active", "vertices"),
    ("Streamed", "triangles"),
    ("Streamed", "vertices"),
    ("Streamed", "of active"),
];

/// The columns of Table 2 with their units.
pub const FRAME_COLUMNS: [(&str, &str); 7] = [
    ("FPS", "1/s"),
    ("Selection", "ms"),
    ("Streaming", "ms"),
    ("Reforming", "ms"),
    ("Rendering", "ms"),
    ("Active", "triangles"),
    ("Active", "vertices"),
];

/// What Table 1 says of one run.
struct Numbers {
    fps: f64,
    stages_ms: [Option<f64>; 3],
    over_coherent: Option<f64>,
    active: [f64; 2],
    streamed: [f64; 2],
}

/// Table 1: strategy by strategy, the paper's two cameras first.
pub fn streaming(flights: &[Flown]) -> Vec<Row> {
    let strategies = ["SC", "SnC", "NS"];
    let of =
        |name: &'static str| {
            let papers = STREAMING.iter().filter(move |row| row.strategy == name);
            let papers = papers
                .map(|row| numbers_row(name, format!("paper, {}", row.camera), false, papers_numbers(row)));
            let ours =
                flights.iter().filter(move |flight| paper::name_of(&flight.summary.flight.strategy) == name);
            papers.chain(ours.map(move |flight| {
                numbers_row(name, flight.name.clone(), true, our_numbers(flight, flights))
            }))
        };
    strategies.into_iter().flat_map(of).collect()
}

fn numbers_row(head: &str, run: String, is_ours: bool, numbers: Numbers) -> Row {
    let write = if is_ours { human::milliseconds } else { printed };
    let ms = |ms: Option<f64>| ms.map_or("–".to_owned(), write);
    let total: f64 = numbers.stages_ms.iter().flatten().sum();
    let mut cells = vec![if is_ours { digits(numbers.fps) } else { printed(numbers.fps) }];
    cells.extend(numbers.stages_ms.map(ms));
    cells.push(ms(Some(total)));
    cells.push(numbers.over_coherent.map_or("–".to_owned(), |quotient| format!("{} ×", digits(quotient))));
    cells.extend(numbers.active.into_iter().chain(numbers.streamed).map(human::rounded));
    cells.push(share(numbers.streamed[0], numbers.active[0]));
    Row { head: head.to_owned(), run, is_ours, cells }
}

/// With as many decimals as the paper has.
fn printed(number: f64) -> String {
    let text = format!("{number:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn papers_numbers(row: &Streaming) -> Numbers {
    let stages = |row: &Streaming| [row.collection_ms, Some(row.transfer_ms), row.defragment_ms];
    let total = |row: &Streaming| stages(row).iter().flatten().sum::<f64>();
    let coherent = STREAMING.iter().find(|other| other.strategy == "SC" && other.camera == row.camera);
    Numbers {
        fps: row.fps,
        stages_ms: stages(row),
        over_coherent: coherent.map(|coherent| total(row) / total(coherent)),
        active: [row.active.0 as f64, row.active.1 as f64],
        streamed: [row.streamed.0 as f64, row.streamed.1 as f64],
    }
}

fn our_numbers(flight: &Flown, flights: &[Flown]) -> Numbers {
    let stages = |flight: &Flown| {
        let of = |stage| flight.summary.stage(stage);
        [of("delta") + of("gather"), of("upload"), of("defragment")]
    };
    let total = |flight: &Flown| stages(flight).iter().sum::<f64>();
    let is_coherent =
        |other: &&Flown| other.group == flight.group && other.summary.flight.strategy == "coherent";
    let coherent = flights.iter().find(is_coherent).map(total).filter(|&ms| ms > 0.0);
    let summary = &flight.summary;
    Numbers {
        fps: per_second(summary.frame_ms_mean),
        stages_ms: stages(flight).map(Some),
        over_coherent: coherent.map(|coherent| total(flight) / coherent),
        active: [summary.active_triangles_mean, summary.active_vertices_mean],
        streamed: [summary.streamed_triangles_mean, summary.streamed_vertices_mean],
    }
}

fn per_second(frame_ms: f64) -> f64 {
    if frame_ms > 0.0 { 1000.0 / frame_ms } else { 0.0 }
}

/// Table 2: the paper's four views, then every flight.
pub fn frames(flights: &[Flown]) -> Vec<Row> {
    FRAMES.iter().map(papers_frame).chain(flights.iter().map(our_frame)).collect()
}

/// Milliseconds with their share.
fn with_share(ms: &str, share: &str) -> String {
    format!("{ms} ({share})")
}

fn frame_cells(fps: String, stages: [String; 4], active: [f64; 2]) -> Vec<String> {
    std::iter::once(fps).chain(stages).chain(active.map(human::rounded)).collect()
}

fn papers_frame(row: &Frame) -> Row {
    let stages = std::array::from_fn(|stage| match (row.ms[stage], row.shares[stage]) {
        (Some(ms), Some(share)) => with_share(&printed(ms), &format!("{share:.2} %")),
        _ => "–".to_owned(),
    });
    let cells = frame_cells(printed(row.fps), stages, [row.active.0 as f64, row.active.1 as f64]);
    Row { head: "paper".to_owned(), run: row.run.to_owned(), is_ours: false, cells }
}

fn our_frame(flight: &Flown) -> Row {
    const STAGES: [&[&str]; 4] =
        [&["select", "residency"], &["delta", "gather", "upload", "defragment"], &["reform"], &["draw"]];
    let summary = &flight.summary;
    let ms = STAGES.map(|stages| stages.iter().map(|stage| summary.stage(stage)).sum::<f64>());
    let total: f64 = ms.iter().sum();
    let stages = ms.map(|ms| with_share(&human::milliseconds(ms), &share(ms, total)));
    let active = [summary.active_triangles_mean, summary.active_vertices_mean];
    Row {
        head: paper::name_of(&summary.flight.strategy).to_owned(),
        run: flight.name.clone(),
        is_ours: true,
        cells: frame_cells(digits(per_second(summary.frame_ms_mean)), stages, active),
    }
}
