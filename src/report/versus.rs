//! Several flights in; the same quantities of all of them in one plot each out, a colour a flight.

use super::ReportError;
use super::axis::{Axis, Unit};
use super::bands::bands;
use super::chart::{Chart, Colour, HEIGHT, Layer, Point};
use super::plots::{
    Field, Figure, PERCENTILES, STAGES, band_note, broken_line, digits, frame_axis, line, savings, share,
    stages_key, thinned, values,
};
use super::read::Flown;
use crate::stats::report::{human, percentile};

/// All plots in which flights are compared.
pub fn of_flights(flights: &[Flown]) -> Result<Vec<Figure>, ReportError> {
    let mut figures =
        vec![bytes(flights)?, saving(flights)?, triangles(flights)?, residency(flights)?, stages(flights)?];
    if flights.iter().any(|flight| flight.summary.stage("draw") > 0.5 * stage_sum(flight, STAGES.len())) {
        figures.push(stages_before_draw(flights)?);
    }
    figures.push(times(flights)?);
    Ok(figures)
}

/// The colour of a flight, by its place on the page.
pub fn colour(flight: usize) -> Colour {
    Colour::Series(flight)
}

fn key(flights: &[Flown]) -> Vec<(Colour, String)> {
    flights.iter().enumerate().map(|(number, flight)| (colour(number), flight.name.clone())).collect()
}

fn longest(flights: &[Flown]) -> usize {
    flights.iter().map(|flight| flight.records.len()).max().unwrap_or(0)
}

/// The flight with the least of something, and the one with the most.
fn extremes(flights: &[Flown], value: impl Fn(&Flown) -> f64) -> (&Flown, &Flown) {
    let order = |a: &&Flown, b: &&Flown| value(a).total_cmp(&value(b));
    // A page has a flight.
    (flights.iter().min_by(order).unwrap_or(&flights[0]), flights.iter().max_by(order).unwrap_or(&flights[0]))
}

/// A field of every flight over the frames, on a logarithmic axis.
fn lines(
    flights: &[Flown],
    name: &str,
    title: &str,
    unit: Unit,
    field: Field,
) -> Result<String, ReportError> {
    let all = flights.iter().flat_map(|flight| values(flight, field));
    let y = Axis::log(title, unit, all);
    // The first flight is drawn last, above those that it is compared with.
    let numbered = flights.iter().enumerate().rev();
    let layers = numbered
        .flat_map(|(number, flight)| broken_line(&bands(values(flight, field)), colour(number), 4))
        .collect();
    Chart { name: name.to_owned(), x: frame_axis(longest(flights)), y, layers, height: HEIGHT }.svg()
}

fn bytes(flights: &[Flown]) -> Result<Figure, ReportError> {
    let title = "bytes sent a frame (logarithmic)";
    let svg = lines(flights, "bytes sent a frame, all flights", title, Unit::Bytes, |r| r.bytes_sent as f64)?;
    let mean = |flight: &Flown| flight.summary.bytes_sent_total as f64 / flight.summary.frames.max(1) as f64;
    let (least, most) = extremes(flights, mean);
    let caption = format!(
        "A mean frame of `{}` sends {}, one of `{}` {}.{}",
        least.name,
        human::bytes(mean(least).round() as u64),
        most.name,
        human::bytes(mean(most).round() as u64),
        band_note(longest(flights))
    );
    Ok(Figure { title: "Bytes per frame".to_owned(), key: key(flights), svg, caption })
}

fn saving(flights: &[Flown]) -> Result<Figure, ReportError> {
    let curves: Vec<Vec<Point>> = flights.iter().map(|flight| thinned(&savings(flight))).collect();
    let all = curves.iter().flatten().map(|point| point.1).chain([1.0]);
    let y = Axis::log("times less than whole, so far (logarithmic)", Unit::Number, all);
    let layers = curves.into_iter().enumerate().rev();
    let layers =
        layers.map(|(number, points)| Layer::Line { points, colour: colour(number), width: 4 }).collect();
    let name = "cumulative saving, all flights".to_owned();
    let svg = Chart { name, x: frame_axis(longest(flights)), y, layers, height: HEIGHT }.svg()?;
    let saving = |flight: &Flown| flight.summary.transfer_saving.unwrap_or(0.0);
    let (_, best) = extremes(flights, saving);
    let caption = format!(
        "From the first frame to the last, `{}` sends {} times less than `whole` would; 1 is no saving.",
        best.name,
        digits(saving(best))
    );
    Ok(Figure { title: "Cumulative saving".to_owned(), key: key(flights), svg, caption })
}

fn triangles(flights: &[Flown]) -> Result<Figure, ReportError> {
    let title = "streamed triangles a frame (logarithmic)";
    let svg = lines(flights, "streamed triangles, all flights", title, Unit::Number, |r| {
        r.streamed_triangles as f64
    })?;
    let part = |flight: &Flown| {
        flight.summary.streamed_triangles_mean / flight.summary.active_triangles_mean.max(1.0)
    };
    let (least, most) = extremes(flights, part);
    let caption = format!(
        "`{}` sends {} of the triangles that it draws, `{}` {}.{}",
        least.name,
        share(part(least), 1.0),
        most.name,
        share(part(most), 1.0),
        band_note(longest(flights))
    );
    Ok(Figure { title: "Streamed triangles".to_owned(), key: key(flights), svg, caption })
}

/// One bar a flight, its stages beside each other.
fn stages(flights: &[Flown]) -> Result<Figure, ReportError> {
    let total = |flight: &Flown| stage_sum(flight, STAGES.len());
    let (fastest, slowest) = extremes(flights, total);
    let caption = format!(
        "The stages of a mean frame take {} ms in `{}` and {} ms in `{}`.",
        human::milliseconds(total(fastest)),
        fastest.name,
        human::milliseconds(total(slowest)),
        slowest.name
    );
    let svg = bars(flights, STAGES.len())?;
    Ok(Figure { title: "Where the time goes".to_owned(), key: stages_key(STAGES.len()), svg, caption })
}

/// The same without `draw`, which is the same work in every flight of one path.
fn stages_before_draw(flights: &[Flown]) -> Result<Figure, ReportError> {
    let stages = STAGES.len() - 1;
    let caption =
        "All stages before drawing: what it costs to choose, to send and to put together.".to_owned();
    let svg = bars(flights, stages)?;
    Ok(Figure { title: "All but drawing".to_owned(), key: stages_key(stages), svg, caption })
}

/// Mean milliseconds of the first so many stages.
fn stage_sum(flight: &Flown, stages: usize) -> f64 {
    STAGES[..stages].iter().map(|(stage, _)| flight.summary.stage(stage)).sum()
}

fn bars(flights: &[Flown], stages: usize) -> Result<String, ReportError> {
    let most = flights.iter().map(|flight| stage_sum(flight, stages)).fold(0.0, f64::max);
    let mut layers = Vec::new();
    for (number, flight) in flights.iter().enumerate() {
        let base = (flights.len() - 1 - number) as f64;
        let mut from = 0.0;
        for (stage, colour) in &STAGES[..stages] {
            let to = from + flight.summary.stage(stage);
            layers.push(Layer::Bar {
                from: (from, base + 0.08),
                to: (to, base + 0.56),
                colour: Colour::Series(*colour),
            });
            from = to;
        }
        let text = format!("{}: {} ms", flight.name, human::milliseconds(from));
        layers.push(Layer::Text { at: (0.0, base + 0.58), text });
    }
    let mut y = Axis::exact("", Unit::Number, flights.len() as f64);
    y.labels.clear();
    let x = Axis::linear("ms, mean of a frame", Unit::Number, most);
    let height = HEIGHT.max(52 * flights.len() as u32 + 70);
    Chart { name: "milliseconds by stage, all flights".to_owned(), x, y, layers, height }.svg()
}

/// Shares of frames at which a curve has a point.
const STEPS: usize = 100;

fn times(flights: &[Flown]) -> Result<Figure, ReportError> {
    let sorted: Vec<Vec<f64>> = flights
        .iter()
        .map(|flight| {
            let mut ms: Vec<f64> = values(flight, |r| r.frame_ms.max(0.001)).collect();
            ms.sort_by(f64::total_cmp);
            ms
        })
        .collect();
    let x = Axis::log("ms a frame (logarithmic)", Unit::Number, sorted.iter().flatten().copied());
    let y = Axis::exact("share of frames that take no longer", Unit::Percent, 100.0);
    let mut layers = Vec::new();
    for (number, ms) in sorted.iter().enumerate().rev() {
        layers.push(Layer::Line { points: distribution(ms), colour: colour(number), width: 4 });
        let points = PERCENTILES.iter().map(|(_, percent)| (percentile(ms, *percent), *percent)).collect();
        layers.push(Layer::Dots { points, colour: colour(number) });
    }
    let svg =
        Chart { name: "distribution of frame times, all flights".to_owned(), x, y, layers, height: HEIGHT }
            .svg()?;
    let median = |flight: &Flown| flight.summary.frame_ms_p50;
    let (fastest, slowest) = extremes(flights, median);
    let caption = format!(
        "Farther left is faster. Dots are p50, p99 and p99.9. The median frame of `{}` takes {} ms, that of `{}` {} ms.",
        fastest.name,
        human::milliseconds(median(fastest)),
        slowest.name,
        human::milliseconds(median(slowest))
    );
    Ok(Figure { title: "Frame times".to_owned(), key: key(flights), svg, caption })
}

/// The share of frames, in per cent, that take no longer than so many milliseconds.
fn distribution(sorted: &[f64]) -> Vec<Point> {
    let at = |step: usize| (step * (sorted.len() - 1)) / STEPS;
    let steps = (0..=STEPS).map(at);
    let mut points: Vec<Point> =
        steps.map(|rank| (sorted[rank], 100.0 * (rank + 1) as f64 / sorted.len() as f64)).collect();
    points.insert(0, (sorted[0], 0.0));
    points
}

fn residency(flights: &[Flown]) -> Result<Figure, ReportError> {
    let most = flights.iter().map(|flight| flight.summary.resident_bytes_peak).max().unwrap_or(0);
    let y = Axis::linear("bytes held in memory", Unit::Bytes, most as f64);
    let numbered = flights.iter().enumerate().rev();
    let layers = numbered
        .flat_map(|(number, flight)| {
            // Flights of one model hold the same; the first is narrow, so that those below it are seen.
            line(&bands(values(flight, |r| r.resident_bytes as f64)), colour(number), 3 + 3 * number as u32)
        })
        .collect();
    let name = "residency, all flights".to_owned();
    let svg = Chart { name, x: frame_axis(longest(flights)), y, layers, height: HEIGHT }.svg()?;
    let misses: u64 = flights.iter().map(|flight| flight.summary.misses_total).sum();
    let (_, largest) = extremes(flights, |flight| flight.summary.resident_bytes_peak as f64);
    let lacking = match misses {
        0 => "No flight ever lacked what it wished to draw.".to_owned(),
        some => format!(
            "In all flights together, {} instances were drawn coarser than wished, as they had not been read yet.",
            human::count(some)
        ),
    };
    let caption = format!(
        "What of the model is in memory: at most {}, in `{}`. {lacking}",
        human::bytes(largest.summary.resident_bytes_peak),
        largest.name
    );
    Ok(Figure { title: "Residency".to_owned(), key: key(flights), svg, caption })
}
