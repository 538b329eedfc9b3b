//! Axes and layers in, one plot as an SVG element out, in the house style of the page.
//!
//! Colours are those of the light page; [`style_rules`] gives every one of them a variable of CSS, which the page sets
//! anew where it is dark. Text is in the page's own letters.

use std::fmt::Write;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::ReportError;
use super::axis::Axis;

/// Colours on light and on dark paper, told apart by every eye (after Okabe & Ito 2008).
const PALETTE: [(RGBColor, RGBColor); 8] = [
    (RGBColor(0, 114, 178), RGBColor(86, 172, 232)),
    (RGBColor(213, 94, 0), RGBColor(255, 143, 66)),
    (RGBColor(0, 158, 115), RGBColor(54, 201, 158)),
    (RGBColor(190, 95, 150), RGBColor(231, 153, 199)),
    (RGBColor(214, 150, 0), RGBColor(245, 190, 66)),
    (RGBColor(110, 90, 170), RGBColor(172, 154, 228)),
    (RGBColor(90, 190, 230), RGBColor(150, 222, 250)),
    (RGBColor(140, 140, 140), RGBColor(160, 160, 160)),
];
const INK: (RGBColor, RGBColor) = (RGBColor(28, 30, 33), RGBColor(232, 233, 236));
const MUTED: (RGBColor, RGBColor) = (RGBColor(98, 102, 109), RGBColor(160, 165, 173));

/// A colour of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// One of eight.
    Series(usize),
    /// That of text.
    Ink,
    /// That of labels.
    Muted,
}

impl Colour {
    fn pair(self) -> (RGBColor, RGBColor) {
        match self {
            Self::Series(number) => PALETTE[number % PALETTE.len()],
            Self::Ink => INK,
            Self::Muted => MUTED,
        }
    }

    fn rgb(self) -> RGBColor {
        self.pair().0
    }

    /// As CSS: `var(--c3)`.
    pub fn variable(self) -> String {
        match self {
            Self::Series(number) => format!("var(--c{})", number % PALETTE.len()),
            Self::Ink => "var(--ink)".to_owned(),
            Self::Muted => "var(--muted)".to_owned(),
        }
    }

    fn all() -> impl Iterator<Item = Self> {
        (0..PALETTE.len()).map(Self::Series).chain([Self::Ink, Self::Muted])
    }
}

/// The colours as variables of CSS, dark ones for a dark page on a screen, and the rules that bring them into plots.
pub fn style_rules() -> String {
    let hex = |RGBColor(r, g, b): RGBColor| format!("#{r:02X}{g:02X}{b:02X}");
    let name = |colour: Colour| colour.variable().trim_start_matches("var(").trim_end_matches(')').to_owned();
    let set = |pick: fn((RGBColor, RGBColor)) -> RGBColor| {
        Colour::all().map(|c| format!("{}:{};", name(c), hex(pick(c.pair())))).collect::<String>()
    };
    let mut rules = format!(":root{{{}}}\n", set(|pair| pair.0));
    let _ =
        writeln!(rules, "@media screen and (prefers-color-scheme:dark){{:root{{{}}}}}", set(|pair| pair.1));
    for colour in Colour::all() {
        let (hex, variable) = (hex(colour.rgb()), colour.variable());
        let _ = writeln!(
            rules,
            ".plot [fill=\"{hex}\"]{{fill:{variable}}}.plot [stroke=\"{hex}\"]{{stroke:{variable}}}"
        );
    }
    rules
}

/// A point in values of both axes.
pub type Point = (f64, f64);

/// What is drawn, the first at the bottom.
#[derive(Debug)]
pub enum Layer {
    /// A line through points; a dot if there is only one.
    Line { points: Vec<Point>, colour: Colour, width: u32 },
    /// What lies between an upper and a lower line, both from left to right.
    Area { upper: Vec<Point>, lower: Vec<Point>, colour: Colour, opacity: f64 },
    /// A filled rectangle between two corners.
    Bar { from: Point, to: Point, colour: Colour },
    /// An upright line at a value, with words beside its top; `row` moves them down, so that neighbours do not collide.
    Mark { at: f64, text: String, row: u32 },
    /// Dots.
    Dots { points: Vec<Point>, colour: Colour },
    /// Words above the left end of a point.
    Text { at: Point, text: String },
}

/// One plot.
#[derive(Debug)]
pub struct Chart {
    /// What it shows, for those who cannot see it.
    pub name: String,
    /// Across.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// What is drawn.
    pub layers: Vec<Layer>,
    /// Height in units; the width is always the same.
    pub height: u32,
}

/// Units of width; at this width a letter has the size that is asked for.
const WIDTH: u32 = 560;
/// The usual height.
pub const HEIGHT: u32 = 320;
/// The backend has whole coordinates; so many of them are a unit.
const SCALE: u32 = 4;

const FONT: &str = "sans-serif";

fn drawing(error: impl std::fmt::Display) -> ReportError {
    ReportError::Drawing(error.to_string())
}

/// Labels are measured in the font that comes with the program, so that a machine without any draws the same plots.
fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let font = epaint_default_fonts::UBUNTU_LIGHT;
        if plotters::style::register_font(FONT, FontStyle::Normal, font).is_err() {
            tracing::warn!("the font of the plots cannot be read");
        }
    });
}

/// Units as coordinates.
fn units(units: u32) -> u32 {
    units * SCALE
}

fn letters(size: u32, colour: Colour) -> TextStyle<'static> {
    // The backend divides the size by 1.24.
    (FONT, f64::from(units(size)) * 1.24).into_font().color(&colour.rgb())
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

impl Chart {
    /// The plot as an element that may stand in a page.
    ///
    /// # Errors
    /// [`ReportError::Drawing`].
    pub fn svg(&self) -> Result<String, ReportError> {
        register_font();
        let size = (units(WIDTH), units(self.height));
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        self.draw(&area)?;
        area.present().map_err(drawing)?;
        drop(area);
        // The backend opens the element as a file needs it.
        let inside = text.split_once('>').map_or("", |(_, rest)| rest);
        let name = self.name.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
        Ok(format!(
            "<svg class=\"plot\" role=\"img\" aria-label=\"{name}\" viewBox=\"0 0 {} {}\">{inside}",
            size.0, size.1
        ))
    }

    fn draw(&self, area: &Area<'_>) -> Result<(), ReportError> {
        let mut chart = ChartBuilder::on(area)
            .margin_top(units(24))
            .margin_right(units(20))
            .margin_left(units(2))
            .x_label_area_size(units(42))
            .y_label_area_size(units(self.label_width()))
            .build_cartesian_2d(self.x.range.clone(), self.y.range.clone())
            .map_err(drawing)?;
        let title = letters(13, Colour::Muted).pos(Pos::new(HPos::Left, VPos::Top));
        area.draw(&Text::new(self.y.title.clone(), (units(4) as i32, units(1) as i32), title))
            .map_err(drawing)?;
        self.draw_axes(&mut chart)?;
        self.layers.iter().try_for_each(|layer| self.draw_layer(&mut chart, layer))
    }

    /// Room for the longest label of the upright axis.
    fn label_width(&self) -> u32 {
        let longest = self.y.labels.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0) as u32;
        (8 * longest + 12).max(24)
    }

    fn draw_axes(&self, chart: &mut Drawn<'_, '_>) -> Result<(), ReportError> {
        let (faint, line) = (INK.0.mix(0.12), INK.0.mix(0.45));
        let (left, right) = (self.x.range.start, self.x.range.end);
        let (bottom, top) = (self.y.range.start, self.y.range.end);
        let area = chart.plotting_area().clone();
        let text = |anchor| letters(13, Colour::Muted).pos(anchor);
        for (at, label) in &self.y.labels {
            let style = if *at == bottom { line } else { faint };
            let grid = PathElement::new([(left, *at), (right, *at)], style.stroke_width(SCALE));
            area.draw(&grid).map_err(drawing)?;
            let label =
                Text::new(label.clone(), (-(units(7) as i32), 0), text(Pos::new(HPos::Right, VPos::Center)));
            area.draw(&(EmptyElement::at((left, *at)) + label)).map_err(drawing)?;
        }
        for (at, label) in &self.x.labels {
            let tick = PathElement::new([(0, 0), (0, units(5) as i32)], line.stroke_width(SCALE));
            let label =
                Text::new(label.clone(), (0, units(8) as i32), text(Pos::new(HPos::Center, VPos::Top)));
            area.draw(&(EmptyElement::at((*at, bottom)) + tick + label)).map_err(drawing)?;
        }
        let title =
            Text::new(self.x.title.clone(), (0, units(25) as i32), text(Pos::new(HPos::Right, VPos::Top)));
        area.draw(&(EmptyElement::at((right, bottom)) + title)).map_err(drawing)?;
        debug_assert!(bottom < top);
        Ok(())
    }

    fn place(&self, (x, y): Point) -> Point {
        (self.x.position(x), self.y.position(y))
    }

    fn draw_layer(&self, chart: &mut Drawn<'_, '_>, layer: &Layer) -> Result<(), ReportError> {
        let area = chart.plotting_area();
        match layer {
            Layer::Line { points, colour, width } if points.len() > 1 => {
                let style = colour.rgb().stroke_width(width * SCALE / 2);
                let points: Vec<_> = points.iter().map(|&point| self.place(point)).collect();
                area.draw(&PathElement::new(points, style)).map_err(drawing)
            }
            Layer::Line { points, colour, width } => points.iter().try_for_each(|&point| {
                area.draw(&Circle::new(self.place(point), width * SCALE / 2, colour.rgb().filled()))
                    .map_err(drawing)
            }),
            Layer::Dots { points, colour } => points.iter().try_for_each(|&point| {
                area.draw(&Circle::new(self.place(point), units(4), colour.rgb().filled())).map_err(drawing)
            }),
            Layer::Area { upper, lower, colour, opacity } => {
                let round: Vec<_> =
                    upper.iter().chain(lower.iter().rev()).map(|&point| self.place(point)).collect();
                area.draw(&Polygon::new(round, colour.rgb().mix(*opacity))).map_err(drawing)
            }
            Layer::Bar { from, to, colour } => {
                let corners = [self.place(*from), self.place(*to)];
                area.draw(&Rectangle::new(corners, colour.rgb().filled())).map_err(drawing)
            }
            Layer::Mark { at, text, row } => self.draw_mark(chart, *at, text, *row),
            Layer::Text { at, text } => {
                let style = letters(13, Colour::Ink).pos(Pos::new(HPos::Left, VPos::Bottom));
                let words = Text::new(text.clone(), (0, -(units(3) as i32)), style);
                area.draw(&(EmptyElement::at(self.place(*at)) + words)).map_err(drawing)
            }
        }
    }

    /// The line ends at its words, which stand to its left if there is room.
    fn draw_mark(&self, chart: &mut Drawn<'_, '_>, at: f64, text: &str, row: u32) -> Result<(), ReportError> {
        let area = chart.plotting_area();
        let at = self.x.position(at);
        let (bottom, top) = (self.y.range.start, self.y.range.end);
        let (_, height) = area.dim_in_pixel();
        let below = units(2 + 17 * row);
        let end = top - (top - bottom) * f64::from(below) / f64::from(height.max(1));
        let line = PathElement::new([(at, bottom), (at, end)], INK.0.mix(0.8).stroke_width(SCALE));
        area.draw(&line).map_err(drawing)?;
        let is_left = at > self.x.range.start + 0.3 * (self.x.range.end - self.x.range.start);
        let (side, away) = if is_left { (HPos::Right, -5) } else { (HPos::Left, 5) };
        let shift = (away * SCALE as i32, below as i32);
        let words =
            Text::new(text.to_owned(), shift, letters(13, Colour::Ink).pos(Pos::new(side, VPos::Top)));
        area.draw(&(EmptyElement::at((at, top)) + words)).map_err(drawing)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axis::Unit;
    use super::*;

    fn chart(layers: Vec<Layer>) -> String {
        let x = Axis::exact("frame", Unit::Number, 100.0);
        let y = Axis::linear("ms", Unit::Number, 40.0);
        Chart { name: "a < \"b\"".to_owned(), x, y, layers, height: HEIGHT }.svg().unwrap()
    }

    #[test]
    fn a_plot_has_its_titles_its_labels_and_its_layers() {
        let points = vec![(0.0, 0.0), (50.0, 40.0), (100.0, 1000.0)];
        let colour = Colour::Series(1);
        let svg = chart(vec![
            Layer::Line { points: points.clone(), colour, width: 3 },
            Layer::Area { upper: points, lower: vec![(0.0, 0.0), (100.0, 0.0)], colour, opacity: 0.2 },
            Layer::Mark { at: 20.0, text: "p50".to_owned(), row: 0 },
        ]);
        assert!(
            svg.starts_with("<svg class=\"plot\" role=\"img\" aria-label=\"a &lt; &quot;b&quot;\" viewBox=")
        );
        assert!(svg.trim_end().ends_with("</svg>") && !svg.contains("http"));
        for word in ["frame", "ms", "p50", "\n100\n", "\n40\n"] {
            assert!(svg.contains(word), "no {word:?} in {svg}");
        }
        assert_eq!(svg.matches("#D55E00").count(), 2);
    }

    #[test]
    fn a_line_of_one_point_is_a_dot() {
        let svg = chart(vec![Layer::Line { points: vec![(1.0, 1.0)], colour: Colour::Ink, width: 2 }]);
        assert_eq!(svg.matches("<circle").count(), 1);
    }

    #[test]
    fn every_colour_of_a_plot_has_a_rule() {
        let rules = style_rules();
        for colour in Colour::all() {
            let RGBColor(r, g, b) = colour.rgb();
            assert!(
                rules.contains(&format!("[fill=\"#{r:02X}{g:02X}{b:02X}\"]{{fill:{}", colour.variable()))
            );
        }
        assert_eq!(rules.matches("--c7:").count(), 2);
    }
}
