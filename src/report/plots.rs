//! A flight in; its six plots out, each with a sentence that says what it shows.

use super::ReportError;
use super::arrival::arrival;
use super::axis::{Axis, Unit};
use super::bands::{Band, bands, frames_per_band};
use super::chart::{Chart, Colour, HEIGHT, Layer, Point};
use super::read::Flown;
use crate::stats::FrameRecord;
use crate::stats::report::{human, percentile};

/// A plot as it stands on the page.
#[derive(Debug)]
pub struct Figure {
    /// Above it.
    pub title: String,
    /// Its colours.
    pub key: Vec<(Colour, String)>,
    /// The plot itself.
    pub svg: String,
    /// Below it: what it shows, in numbers.
    pub caption: String,
}

/// A quantity of a frame.
pub type Field = fn(&FrameRecord) -> f64;

/// All plots of one flight.
pub fn of_flight(flight: &Flown) -> Result<Vec<Figure>, ReportError> {
    let mut figures = vec![bytes(flight)?, saving(flight)?, triangles(flight)?, residency(flight)?];
    figures.extend(arrival(flight)?);
    figures.push(stages(flight)?);
    figures.extend(stages_before_draw(flight)?);
    figures.push(times(flight)?);
    Ok(figures)
}

/// The axis of frames for a flight of so many.
pub fn frame_axis(frames: usize) -> Axis {
    Axis::exact("frame", Unit::Number, frames.saturating_sub(1) as f64)
}

/// The values of a field, one a frame.
pub fn values(flight: &Flown, field: Field) -> impl ExactSizeIterator<Item = f64> + Clone {
    flight.records.iter().map(field)
}

/// A line of the means of bands, in the shade of their extremes where bands have several frames.
pub fn line(bands: &[Band], colour: Colour, width: u32) -> Vec<Layer> {
    let mut layers = shade(bands, colour);
    layers.push(Layer::Line { points: means(bands), colour, width });
    layers
}

/// The same for a logarithmic axis: on its way from something to nothing and back the line is left out, which would be
/// all that one sees of a flight that mostly sends nothing.
pub fn broken_line(bands: &[Band], colour: Colour, width: u32) -> Vec<Layer> {
    let mut layers = shade(bands, colour);
    let runs = bands.chunk_by(|a, b| (a.mean > 0.0) == (b.mean > 0.0));
    layers.extend(runs.map(|run| Layer::Line { points: means(run), colour, width }));
    layers
}

fn means(bands: &[Band]) -> Vec<Point> {
    bands.iter().map(|band| (band.frame, band.mean)).collect()
}

fn shade(bands: &[Band], colour: Colour) -> Vec<Layer> {
    if bands.iter().all(|band| band.low == band.high) {
        return Vec::new();
    }
    let upper = bands.iter().map(|band| (band.frame, band.high)).collect();
    let lower = bands.iter().map(|band| (band.frame, band.low)).collect();
    vec![Layer::Area { upper, lower, colour, opacity: 0.18 }]
}

/// What one sees of bands; nothing for flights of a band a frame.
pub fn band_note(frames: usize) -> String {
    match frames_per_band(frames) {
        1 => String::new(),
        many => format!(
            " Each point is the mean of {many} frames; the shade reaches from their least to their greatest."
        ),
    }
}

/// Lines over frames with one logarithmic axis for all.
fn lines(name: &str, flight: &Flown, y: Axis, series: Vec<(Vec<Band>, Colour, u32)>) -> Chart {
    let layers =
        series.iter().flat_map(|(bands, colour, width)| broken_line(bands, *colour, *width)).collect();
    chart(name, flight, y, layers)
}

fn chart(name: &str, flight: &Flown, y: Axis, layers: Vec<Layer>) -> Chart {
    let name = format!("{name}, {}", flight.name);
    Chart { name, x: frame_axis(flight.records.len()), y, layers, height: HEIGHT }
}

fn all_values(series: &[(Vec<Band>, Colour, u32)]) -> impl Iterator<Item = f64> + Clone {
    series.iter().flat_map(|(bands, _, _)| bands.iter().flat_map(|band| [band.low, band.high]))
}

const STREAMS: [(&str, Field, usize); 4] = [
    ("vertices", |r| r.bytes_vertices as f64, 0),
    ("ecol", |r| r.bytes_ecol as f64, 3),
    ("triangles", |r| r.bytes_triangles as f64, 1),
    ("tables", |r| r.bytes_tables as f64, 7),
];

fn bytes(flight: &Flown) -> Result<Figure, ReportError> {
    let mut series = vec![(bands(values(flight, |r| r.bytes_whole as f64)), Colour::Ink, 3)];
    series
        .extend(STREAMS.map(|(_, field, colour)| (bands(values(flight, field)), Colour::Series(colour), 3)));
    let mut key = vec![(Colour::Ink, "all that `whole` would send".to_owned())];
    key.extend(STREAMS.map(|(name, _, colour)| (Colour::Series(colour), name.to_owned())));
    let y = Axis::log("bytes sent a frame (logarithmic)", Unit::Bytes, all_values(&series));
    let svg = lines("bytes sent a frame by stream", flight, y, series).svg()?;
    Ok(Figure { title: "Bytes per frame, by stream".to_owned(), key, svg, caption: bytes_caption(flight) })
}

fn bytes_caption(flight: &Flown) -> String {
    let sent: Vec<f64> = values(flight, |r| r.bytes_sent as f64).collect();
    let first = in_bytes(sent[0]);
    let note = band_note(sent.len());
    let Some(later) = sent.get(1..).filter(|later| !later.is_empty()) else {
        return format!("The one frame sends {first}, as the GPU held nothing before it.");
    };
    let silent = later.iter().filter(|&&bytes| bytes == 0.0).count();
    let rest = match silent {
        0 => String::new(),
        all if all == later.len() => " Not one byte follows.".to_owned(),
        some => format!(" {} frames send nothing at all.", human::count(some as u64)),
    };
    let middle = in_bytes(percentile(later, 50.0));
    let most = in_bytes(later.iter().copied().fold(0.0, f64::max));
    format!(
        "The first frame sends {first}, as the GPU holds nothing before it; of those that follow, half send {middle} or less, and none more than {most}.{rest}{note}"
    )
}

fn in_bytes(bytes: f64) -> String {
    human::bytes(bytes.round() as u64)
}

/// What `whole` would have sent over what was sent, up to every frame from which on that is a number.
pub fn savings(flight: &Flown) -> Vec<Point> {
    let (mut sent, mut whole) = (0.0, 0.0);
    let points = flight.records.iter().map(|record| {
        sent += record.bytes_sent as f64;
        whole += record.bytes_whole as f64;
        (record.frame as f64, if sent > 0.0 { whole / sent } else { 0.0 })
    });
    points.filter(|&(_, saving)| saving > 0.0).collect()
}

/// Every so manieth point of a line without peaks, the last one always.
pub fn thinned(points: &[Point]) -> Vec<Point> {
    let step = frames_per_band(points.len());
    let mut thin: Vec<Point> = points.iter().copied().step_by(step).collect();
    if let Some(last) = points.last().filter(|last| thin.last() != Some(last)) {
        thin.push(*last);
    }
    thin
}

fn saving(flight: &Flown) -> Result<Figure, ReportError> {
    let colour = Colour::Series(2);
    let upper = thinned(&savings(flight));
    let most = upper.iter().map(|point| point.1).fold(1.0, f64::max);
    let y = Axis::linear("times less than whole, so far", Unit::Number, most);
    let lower = upper.iter().map(|&(frame, _)| (frame, 0.0)).collect();
    let layers = vec![
        Layer::Area { upper: upper.clone(), lower, colour, opacity: 0.18 },
        Layer::Line { points: upper, colour, width: 4 },
    ];
    let svg = chart("cumulative saving", flight, y, layers).svg()?;
    Ok(Figure {
        title: "Cumulative saving".to_owned(),
        key: Vec::new(),
        svg,
        caption: saving_caption(flight),
    })
}

fn saving_caption(flight: &Flown) -> String {
    let summary = &flight.summary;
    let (sent, whole) = (human::bytes(summary.bytes_sent_total), human::bytes(summary.bytes_whole_total));
    match summary.transfer_saving {
        None => format!("Nothing was sent, where `whole` would have sent {whole}."),
        Some(saving) if saving < 1.01 => {
            format!("`{}` sends {sent} in all, no less than `whole` would.", summary.flight.strategy)
        }
        Some(saving) => format!(
            "By the last frame {sent} have been sent, where `whole` would have sent {whole}: {} times as much.",
            digits(saving)
        ),
    }
}

/// Three significant digits.
pub fn digits(number: f64) -> String {
    if number >= 99.95 { human::rounded(number) } else { human::milliseconds(number) }
}

fn triangles(flight: &Flown) -> Result<Figure, ReportError> {
    let series = vec![
        (bands(values(flight, |r| r.active_triangles as f64)), Colour::Ink, 4),
        (bands(values(flight, |r| r.streamed_triangles as f64)), Colour::Series(1), 3),
    ];
    let key = vec![
        (Colour::Ink, "active: drawn".to_owned()),
        (Colour::Series(1), "streamed: sent for it".to_owned()),
    ];
    let y = Axis::log("triangles a frame (logarithmic)", Unit::Number, all_values(&series));
    let svg = lines("active and streamed triangles", flight, y, series).svg()?;
    let (active, streamed) = (flight.summary.active_triangles_mean, flight.summary.streamed_triangles_mean);
    let caption = format!(
        "Of {} triangles that a mean frame draws, {} were sent for it: {}. All others were on the GPU already.{}",
        human::rounded(active),
        human::rounded(streamed),
        share(streamed, active),
        band_note(flight.records.len())
    );
    Ok(Figure { title: "Active and streamed triangles".to_owned(), key, svg, caption })
}

/// A share in per cent with two significant digits or more.
pub fn share(part: f64, whole: f64) -> String {
    let percent = if whole > 0.0 { 100.0 * part / whole } else { 0.0 };
    match percent {
        0.0 => "0 %".to_owned(),
        p if p >= 9.95 => format!("{p:.0} %"),
        p if p >= 0.995 => format!("{p:.1} %"),
        p if p >= 0.0995 => format!("{p:.2} %"),
        p if p >= 0.001 => format!("{p:.3} %"),
        _ => "less than 0.001 %".to_owned(),
    }
}

/// The stages by name, with the colour that they have in every plot.
pub const STAGES: [(&str, usize); 8] = [
    ("select", 5),
    ("residency", 3),
    ("delta", 4),
    ("gather", 6),
    ("upload", 0),
    ("defragment", 1),
    ("reform", 2),
    ("draw", 7),
];

fn stages(flight: &Flown) -> Result<Figure, ReportError> {
    let (svg, top) = stacked(flight, STAGES.len())?;
    let caption = stages_caption(flight, top);
    Ok(Figure { title: "Where the time goes".to_owned(), key: stages_key(STAGES.len()), svg, caption })
}

/// The stages before `draw`, where that leaves nothing else to be seen.
fn stages_before_draw(flight: &Flown) -> Result<Option<Figure>, ReportError> {
    let draw = flight.summary.stage("draw");
    let total: f64 = flight.summary.stage_ms.values().sum();
    if draw < 0.5 * total || draw == total {
        return Ok(None);
    }
    let stages = STAGES.len() - 1;
    let (svg, _) = stacked(flight, stages)?;
    let caption = format!(
        "The same without drawing, which takes {} of the time: {} ms in a mean frame.",
        share(draw, total),
        human::milliseconds(total - draw)
    );
    Ok(Some(Figure { title: "All but drawing".to_owned(), key: stages_key(stages), svg, caption }))
}

/// The colours of the first so many stages.
pub fn stages_key(stages: usize) -> Vec<(Colour, String)> {
    STAGES[..stages].iter().map(|&(name, colour)| (Colour::Series(colour), name.to_owned())).collect()
}

/// The first so many stages on top of each other, and the end of the upright axis.
fn stacked(flight: &Flown, stages: usize) -> Result<(String, f64), ReportError> {
    let by_stage =
        (0..stages).map(|stage| bands(flight.records.iter().map(|record| record.stages_ms()[stage].1)));
    let mut lower: Vec<Point> = bands(values(flight, |_| 0.0)).iter().map(|band| (band.frame, 0.0)).collect();
    let mut layers = Vec::new();
    for (bands, (_, colour)) in by_stage.zip(STAGES) {
        let upper: Vec<Point> = lower.iter().zip(&bands).map(|(&(x, y), band)| (x, y + band.mean)).collect();
        let colour = Colour::Series(colour);
        layers.push(Layer::Area { upper: upper.clone(), lower, colour, opacity: 0.9 });
        lower = upper;
    }
    let y = Axis::linear("ms a frame, stages stacked", Unit::Number, frame_limit(flight, stages));
    let top = y.range.end;
    Ok((chart("milliseconds by stage", flight, y, layers).svg()?, top))
}

/// Milliseconds of the first so many stages.
fn stage_sum(record: &FrameRecord, stages: usize) -> f64 {
    record.stages_ms()[..stages].iter().map(|(_, ms)| ms).sum()
}

/// A few slow frames shall not press all others flat.
fn frame_limit(flight: &Flown, stages: usize) -> f64 {
    let sums: Vec<f64> = flight.records.iter().map(|record| stage_sum(record, stages)).collect();
    let most = sums.iter().copied().fold(0.0, f64::max);
    most.min(1.5 * percentile(&sums, 98.0)).max(0.001)
}

fn stages_caption(flight: &Flown, top: f64) -> String {
    let stages = &flight.summary.stage_ms;
    let total: f64 = stages.values().sum();
    let mut sorted: Vec<_> = stages.iter().collect();
    sorted.sort_by(|a, b| b.1.total_cmp(a.1));
    let largest: Vec<String> = sorted
        .iter()
        .take(3)
        .map(|(name, ms)| format!("{name} {} ms ({})", human::milliseconds(**ms), share(**ms, total)))
        .collect();
    let above: Vec<f64> =
        flight.records.iter().map(|record| stage_sum(record, STAGES.len())).filter(|&ms| ms > top).collect();
    let slow = match above.len() {
        0 => String::new(),
        1 => format!(" One frame reaches out of the plot, to {} ms.", human::milliseconds(above[0])),
        many => {
            let most = above.iter().copied().fold(0.0, f64::max);
            format!(
                " {} frames reach out of the plot, up to {} ms.",
                human::count(many as u64),
                human::milliseconds(most)
            )
        }
    };
    let note = match frames_per_band(flight.records.len()) {
        1 => String::new(),
        many => format!(" Each point is the mean of {many} frames."),
    };
    format!(
        "All stages of a mean frame take {} ms, most of it in {}.{slow}{note}",
        human::milliseconds(total),
        largest.join(", ")
    )
}

/// The percentiles that are marked.
pub const PERCENTILES: [(&str, f64); 3] = [("p50", 50.0), ("p99", 99.0), ("p99.9", 99.9)];

/// Bars of a histogram.
const BINS: usize = 48;

fn times(flight: &Flown) -> Result<Figure, ReportError> {
    let ms: Vec<f64> = values(flight, |r| r.frame_ms.max(0.001)).collect();
    let x = Axis::log("ms a frame (logarithmic)", Unit::Number, ms.iter().copied());
    let counts = histogram(&ms, &x);
    let most = counts.iter().copied().max().unwrap_or(0) as f64;
    let y = Axis::linear("frames", Unit::Number, most * 1.25);
    let edge = |bin: usize| {
        let at = x.range.start + (x.range.end - x.range.start) * bin as f64 / BINS as f64;
        at.exp2()
    };
    let bars = counts.iter().enumerate().filter(|&(_, &count)| count > 0);
    let colour = Colour::Series(0);
    let mut layers: Vec<Layer> = bars
        .map(|(bin, &count)| Layer::Bar { from: (edge(bin), 0.0), to: (edge(bin + 1), count as f64), colour })
        .collect();
    // From the right, so that no line crosses the words of another.
    layers.extend(PERCENTILES.iter().rev().enumerate().map(|(row, (name, percent))| {
        let at = percentile(&ms, *percent);
        Layer::Mark { at, text: format!("{name} {} ms", human::milliseconds(at)), row: row as u32 }
    }));
    let name = format!("distribution of frame times, {}", flight.name);
    let svg = Chart { name, x, y, layers, height: HEIGHT }.svg()?;
    Ok(Figure { title: "Frame times".to_owned(), key: Vec::new(), svg, caption: times_caption(&ms) })
}

fn histogram(ms: &[f64], x: &Axis) -> [usize; BINS] {
    let mut counts = [0; BINS];
    for &value in ms {
        let share = (x.position(value) - x.range.start) / (x.range.end - x.range.start);
        counts[((share * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    counts
}

fn times_caption(ms: &[f64]) -> String {
    let at = |percent| human::milliseconds(percentile(ms, percent));
    let most = ms.iter().copied().fold(0.0, f64::max);
    let few = if ms.len() < 1000 { " (with fewer than 1,000 frames, p99.9 is the slowest one)" } else { "" };
    format!(
        "How many frames took how long: half of them {} ms or less, 99 in a hundred {} ms or less, the slowest {} ms{few}.",
        at(50.0),
        at(99.0),
        human::milliseconds(most)
    )
}

fn residency(flight: &Flown) -> Result<Figure, ReportError> {
    let mut read = 0.0;
    let so_far: Vec<f64> = values(flight, |r| r.disk_bytes as f64)
        .map(|bytes| {
            read += bytes;
            read
        })
        .collect();
    let (read, held) = (bands(so_far.into_iter()), bands(values(flight, |r| r.resident_bytes as f64)));
    let mut key = vec![
        (Colour::Series(4), "read from disk so far".to_owned()),
        (Colour::Series(0), "resident: held in memory".to_owned()),
    ];
    let capped = under_cap(flight);
    let all = capped.iter().flat_map(|(counted, _)| counted).chain(&read).chain(&held);
    let cap = capped.as_ref().map_or(0.0, |(_, cap)| *cap);
    let most = all.map(|band| band.high).fold(cap, f64::max);
    let y = Axis::linear("bytes", Unit::Bytes, most);
    let mut layers = Vec::new();
    if flight.summary.misses_total > 0 {
        key.push((Colour::Series(1), "frames with misses".to_owned()));
        layers.extend(miss_stripes(flight, y.range.end));
    }
    layers.extend(line(&read, Colour::Series(4), 7));
    layers.extend(line(&held, Colour::Series(0), 3));
    if let Some((counted, cap)) = capped {
        key.push((Colour::Series(5), "all that `--memory` counts".to_owned()));
        key.push((Colour::Ink, "its cap".to_owned()));
        layers.extend(line(&counted, Colour::Series(5), 3));
        let points = vec![(0.0, cap), (flight.records.len().saturating_sub(1) as f64, cap)];
        layers.push(Layer::Line { points, colour: Colour::Ink, width: 2 });
    }
    let svg = chart("residency", flight, y, layers).svg()?;
    Ok(Figure { title: "Residency".to_owned(), key, svg, caption: residency_caption(flight) })
}

/// What the cap on memory counts, and the cap, if there is one and it is not far above everything.
fn under_cap(flight: &Flown) -> Option<(Vec<Band>, f64)> {
    let cap = flight.summary.flight.memory_limit_bytes? as f64;
    let counted = bands(values(flight, |r| r.memory_bytes as f64));
    let most = counted.iter().map(|band| band.high).fold(0.0, f64::max);
    (cap <= 4.0 * most).then_some((counted, cap))
}

/// A pale stripe wherever a band has frames that lack something; neighbours make one.
fn miss_stripes(flight: &Flown, top: f64) -> Vec<Layer> {
    let width = frames_per_band(flight.records.len()) as f64;
    let mut stripes: Vec<(f64, f64)> = Vec::new();
    for band in bands(values(flight, |r| r.misses as f64)).iter().filter(|band| band.high > 0.0) {
        let (from, to) = (band.frame - 0.5 * width, band.frame + 0.5 * width);
        match stripes.last_mut() {
            Some(last) if from <= last.1 => last.1 = to,
            _ => stripes.push((from, to)),
        }
    }
    let area = |(from, to): (f64, f64)| Layer::Area {
        upper: vec![(from, top), (to, top)],
        lower: vec![(from, 0.0), (to, 0.0)],
        colour: Colour::Series(1),
        opacity: 0.25,
    };
    stripes.into_iter().map(area).collect()
}

fn residency_caption(flight: &Flown) -> String {
    let summary = &flight.summary;
    let file = match summary.flight.file_bytes {
        0 => String::new(),
        bytes => format!(" of the file's {}", human::bytes(bytes)),
    };
    let lacking = flight.records.iter().filter(|record| record.misses > 0).count() as u64;
    let misses = if lacking == 0 {
        "No frame lacked anything that it wished for.".to_owned()
    } else {
        format!(
            "In {} of {} frames something was drawn coarser than wished, as it had not been read yet{} ({} misses).",
            human::count(lacking),
            human::count(summary.frames),
            if summary.flight.memory_limit_bytes.is_some() { " or the cap left no room" } else { "" },
            human::count(summary.misses_total)
        )
    };
    format!(
        "{} were read from disk{file}; at most {} were held in memory, and {} on the GPU, the picture included. {misses}",
        human::bytes(summary.disk_bytes_total),
        human::bytes(summary.resident_bytes_peak),
        human::bytes(summary.gpu_bytes_peak)
    )
}
