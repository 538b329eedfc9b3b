//! A flight in which not all was there out of a slow disk or under a cap in; the plot of what had arrived out.

use super::ReportError;
use super::axis::{Axis, Unit};
use super::bands::bands;
use super::chart::{Chart, Colour, HEIGHT, Layer};
use super::plots::{Figure, band_note, frame_axis, line};
use super::read::Flown;
use crate::stats::FrameRecord;
use crate::stats::report::human;

/// A share of a frame, its words, its colour and how wide its line is, the widest at the bottom.
type Share = (&'static str, fn(&FrameRecord) -> f64, Colour, u32);

const SHARES: [Share; 3] = [
    ("projected area that something is drawn of", |r| r.drawn_area_permille as f64 / 10.0, Colour::Ink, 5),
    ("vertices drawn of those wished for", detail_percent, Colour::Series(2), 3),
    ("visible instances drawn as boxes", boxes_percent, Colour::Series(1), 3),
];

fn detail_percent(record: &FrameRecord) -> f64 {
    percent(record.active_vertices, record.wished_vertices).unwrap_or(100.0)
}

fn boxes_percent(record: &FrameRecord) -> f64 {
    percent(record.boxes, record.instances_visible).unwrap_or(0.0)
}

/// At most 100, as a frame may still draw what it no longer wishes for; `None` of nothing.
fn percent(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| (100.0 * part as f64 / whole as f64).min(100.0))
}

/// The plot, where the records have what it shows and something was missing.
pub fn arrival(flight: &Flown) -> Result<Option<Figure>, ReportError> {
    let records = &flight.records;
    let is_known = records.iter().any(|record| record.wished_vertices > 0);
    let is_whole = records.iter().all(|record| record.misses + record.boxes == 0);
    if !is_known || is_whole {
        return Ok(None);
    }
    let layers: Vec<Layer> = SHARES
        .iter()
        .flat_map(|&(_, share, colour, width)| line(&bands(records.iter().map(share)), colour, width))
        .collect();
    let chart = Chart {
        name: format!("what has arrived, {}", flight.name),
        x: frame_axis(records.len()),
        y: Axis::exact("per cent", Unit::Percent, 100.0),
        layers,
        height: HEIGHT,
    };
    Ok(Some(Figure {
        title: "What has arrived".to_owned(),
        key: SHARES.iter().map(|&(words, _, colour, _)| (colour, words.to_owned())).collect(),
        svg: chart.svg()?,
        caption: caption(flight),
    }))
}

fn caption(flight: &Flown) -> String {
    let summary = &flight.summary;
    let after =
        |ms: Option<f64>| ms.map_or("never".to_owned(), |ms| format!("after {} ms", human::milliseconds(ms)));
    let most = flight.records.iter().map(|record| record.boxes).max().unwrap_or(0);
    let boxes = match most {
        0 => String::new(),
        most => format!(" What nothing had arrived of was drawn as boxes, at most {}.", human::count(most)),
    };
    format!(
        "Counted from the start of opening, there was something of nine tenths of the picture {}, half of the detail {}, and all of it {}.{boxes}{}",
        after(summary.first_picture_ms),
        after(summary.half_detail_ms),
        after(summary.full_detail_ms),
        band_note(flight.records.len())
    )
}
