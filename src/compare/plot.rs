//! A comparison in, a picture of its errors over its triangles out, as SVG or PNG.
//!
//! Both axes are logarithmic. The font comes with the program, so that a machine without any draws the same picture.

use std::sync::Once;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use plotters::coord::Shift;
use plotters::prelude::*;

use super::{Comparison, Figures};
use crate::stats::report::human;

/// Width and height of the SVG in its units; the PNG has [`PNG_SCALE`] pixels for each.
const SIZE: (u32, u32) = (960, 600);
const PNG_SCALE: u32 = 2;

/// Two colours that differ for every eye (Okabe & Ito 2008).
const OURS: RGBColor = RGBColor(0, 114, 178);
const MESHOPTIMIZER: RGBColor = RGBColor(213, 94, 0);

const FONT: &str = "sans-serif";

/// How many ratios a plot wants.
const COUNTS: u32 = 12;

/// Errors below this are rounding; the positions of a part lie on a grid that is a thousand times coarser.
const LEAST_PERCENT: f64 = 1e-8;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// All figures are 0, which has no place on a logarithmic axis.
    #[error("there is nothing to plot: no level of detail has triangles and an error; try smaller ratios")]
    NothingToPlot,
    /// The picture could not be drawn.
    #[error("cannot draw the plot: {0}")]
    Drawing(String),
}

/// A dozen ratios from 0.8 down to 0.01, evenly on a logarithmic axis.
pub fn ratios() -> Vec<f64> {
    let steps = f64::from(COUNTS - 1);
    (0..COUNTS).map(|i| 0.8 * (0.01f64 / 0.8).powf(f64::from(i) / steps)).collect()
}

/// The picture as an SVG file.
///
/// # Errors
/// [`PlotError`].
pub fn svg(comparison: &Comparison, title: &str) -> Result<Vec<u8>, PlotError> {
    let mut text = String::new();
    let lines = lines(comparison)?;
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), 1, title, &lines)?;
    Ok(text.into_bytes())
}

/// The picture as a PNG file.
///
/// # Errors
/// [`PlotError`].
pub fn png(comparison: &Comparison, title: &str) -> Result<Vec<u8>, PlotError> {
    let (width, height) = (SIZE.0 * PNG_SCALE, SIZE.1 * PNG_SCALE);
    let mut pixels = vec![0; 3 * width as usize * height as usize];
    let lines = lines(comparison)?;
    let area = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
    draw(&area, PNG_SCALE, title, &lines)?;
    drop(area);
    let mut file = Vec::new();
    let encoder = PngEncoder::new(&mut file);
    encoder.write_image(&pixels, width, height, ExtendedColorType::Rgb8).map_err(drawing)?;
    Ok(file)
}

fn drawing(error: impl std::fmt::Display) -> PlotError {
    PlotError::Drawing(error.to_string())
}

/// One simplifier's points: triangles, and RMS error in per cent of the diagonal.
struct Line {
    name: &'static str,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
}

fn lines(comparison: &Comparison) -> Result<Vec<Line>, PlotError> {
    let point = |figures: &Figures| (figures.triangles as f64, 100.0 * figures.rms / comparison.diagonal);
    let line = |name, colour, points: Vec<(f64, f64)>| {
        let mut points: Vec<_> =
            points.into_iter().filter(|&(x, y)| x > 0.0 && y > LEAST_PERCENT && y.is_finite()).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Line { name, colour, points }
    };
    let ours = comparison.rows.iter().map(|row| point(&row.ours)).collect();
    let others = comparison.rows.iter().filter_map(|row| row.meshoptimizer.as_ref()).map(point).collect();
    let mut lines = vec![line("collapsar", OURS, ours), line("meshoptimizer", MESHOPTIMIZER, others)];
    lines.retain(|line| !line.points.is_empty());
    if lines.is_empty() { Err(PlotError::NothingToPlot) } else { Ok(lines) }
}

/// The least and the greatest of some coordinates, with room on both sides.
fn range(coordinates: impl Iterator<Item = f64> + Clone, room: f64) -> std::ops::Range<f64> {
    let low = coordinates.clone().fold(f64::INFINITY, f64::min);
    let high = coordinates.fold(0.0, f64::max);
    low / room..high * room
}

/// Where an axis has labels: once, twice and five times every power of ten, and only at those if they are many.
fn labels(range: &std::ops::Range<f64>) -> Vec<f64> {
    let powers = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let steps: &[u32] = if powers.clone().count() > 6 { &[1] } else { &[1, 2, 5] };
    // By way of text, so that a thousandth is the nearest number to 0.001.
    let all =
        powers.flat_map(|power| steps.iter().filter_map(move |step| format!("{step}e{power}").parse().ok()));
    all.filter(|label| range.contains(label)).collect()
}

fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let font = epaint_default_fonts::UBUNTU_LIGHT;
        if plotters::style::register_font(FONT, FontStyle::Normal, font).is_err() {
            tracing::warn!("the font of the plot cannot be read");
        }
    });
}

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    scale: u32,
    title: &str,
    lines: &[Line],
) -> Result<(), PlotError> {
    register_font();
    let all = || lines.iter().flat_map(|line| &line.points);
    let (across, up) = (range(all().map(|p| p.0), 1.2), range(all().map(|p| p.1), 1.6));
    let size = |units: u32| units * scale;
    area.fill(&WHITE).map_err(drawing)?;
    let mut chart = ChartBuilder::on(area)
        .caption(title, (FONT, size(20)))
        .margin(size(14))
        .x_label_area_size(size(46))
        .y_label_area_size(size(76))
        .build_cartesian_2d(
            across.clone().log_scale().with_key_points(labels(&across)),
            up.clone().log_scale().with_key_points(labels(&up)),
        )
        .map_err(drawing)?;
    chart
        .configure_mesh()
        .x_desc("triangles")
        .y_desc("RMS error, % of the largest part's diagonal")
        .x_label_formatter(&|count| human::rounded(*count))
        .y_label_formatter(&|share| format!("{share}"))
        .label_style((FONT, size(14)))
        .axis_desc_style((FONT, size(15)))
        .bold_line_style(BLACK.mix(0.18))
        .light_line_style(BLACK.mix(0.06))
        .draw()
        .map_err(drawing)?;
    for line in lines {
        let style = line.colour.stroke_width(size(2)).filled();
        let series = LineSeries::new(line.points.iter().copied(), style).point_size(size(4));
        let key = move |(x, y)| PathElement::new([(x, y), (x + size(22) as i32, y)], style);
        chart.draw_series(series).map_err(drawing)?.label(line.name).legend(key);
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .legend_area_size(size(30))
        .margin(size(12))
        .label_font((FONT, size(15)))
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()
        .map_err(drawing)?;
    area.present().map_err(drawing)
}

#[cfg(test)]
mod tests {
    use super::super::RatioRow;
    use super::*;

    fn comparison(rms: f64) -> Comparison {
        let figures = |scale: f64, ratio: f64| Figures {
            triangles: (1e5 * ratio) as u64,
            rms: scale * rms / ratio,
            ..Figures::default()
        };
        let rows = ratios().into_iter().map(|ratio| RatioRow {
            ratio,
            ours: figures(0.7, ratio),
            meshoptimizer: Some(figures(1.0, ratio)),
            ..RatioRow::default()
        });
        Comparison { diagonal: 10.0, rows: rows.collect(), ..Comparison::default() }
    }

    #[test]
    fn a_dozen_ratios_fall_evenly() {
        let ratios = ratios();
        assert_eq!((ratios.len(), ratios[0]), (12, 0.8));
        assert!((ratios[11] - 0.01).abs() < 1e-12 && ratios.is_sorted_by(|a, b| a > b));
        assert!((ratios[1] / ratios[0] - ratios[11] / ratios[10]).abs() < 1e-12);
    }

    #[test]
    fn an_svg_names_its_axes_and_its_lines() {
        let text = String::from_utf8(svg(&comparison(1e-3), "a < b & c").unwrap()).unwrap();
        for word in ["a &lt; b &amp; c", "triangles", "RMS error", "collapsar", "meshoptimizer", "</svg>"] {
            assert!(text.contains(word), "no {word}");
        }
        // A line and its key have the colour; the points are circles of it.
        for colour in ["#0072B2", "#D55E00"] {
            let lines =
                text.lines().filter(|line| line.starts_with("<polyline") && line.contains(colour)).count();
            let points =
                text.lines().filter(|line| line.starts_with("<circle") && line.contains(colour)).count();
            assert_eq!((lines, points), (2, 12), "{colour}");
        }
    }

    #[test]
    fn a_png_has_both_lines_and_text() {
        let picture = image::load_from_memory(&png(&comparison(1e-3), "title").unwrap()).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (SIZE.0 * PNG_SCALE, SIZE.1 * PNG_SCALE));
        let count =
            |colour: RGBColor| picture.pixels().filter(|p| p.0 == [colour.0, colour.1, colour.2]).count();
        assert!(count(OURS) > 2000 && count(MESHOPTIMIZER) > 2000);
        let dark_above = picture.enumerate_pixels().filter(|(_, y, p)| *y < 60 && p.0[0] < 100).count();
        assert!(dark_above > 50, "the title is missing");
    }

    #[test]
    fn labels_are_round_and_few() {
        assert_eq!(labels(&(800.0..12_000.0)), [1e3, 2e3, 5e3, 1e4]);
        assert_eq!(labels(&(0.0015..0.004)), [0.002]);
        assert_eq!(labels(&(1e-7..2.0)).len(), 8);
    }

    #[test]
    fn nothing_is_drawn_of_nothing() {
        assert!(matches!(svg(&comparison(0.0), ""), Err(PlotError::NothingToPlot)));
        assert!(matches!(png(&Comparison::default(), ""), Err(PlotError::NothingToPlot)));
    }
}
