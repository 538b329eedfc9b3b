//! `collapsar compare`: a model and its container in, the error of the levels of detail out.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::Args;
use collapsar::compare::plot::{self, PlotError};
use collapsar::compare::{
    CompareError, CompareOptions, CompareProgress, Comparison, Dealing, DealtRow, Figures, PartRow, RatioRow,
    compare,
};
use collapsar::import;
use collapsar::scene::SceneError;
use collapsar::scene::mapped::MappedFile;
use collapsar::stats::report::human;
use indicatif::ProgressBar;

use super::bake::printable;
use super::progress::{self, watched};
use super::{Failure, output, values};

/// Arguments of `compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar compare engine.glb engine.clps\n  \
    collapsar compare engine.glb engine.clps --plot engine.svg\n  \
    collapsar compare engine.glb engine.clps --ratios 0.3,0.03 --csv\n\n\
    Each part is measured against its welded original, both ways, in its own space; parts are pooled by area. \
    Lengths are in the unit of the parts' own spaces, and in millionths of the diagonal of the largest part's box. \
    With --csv, standard output has one line per ratio and part; with --json, one object with the pooled figures.")]
pub struct CompareArguments {
    /// The model that was baked: .obj, .gltf, .glb, .ply, .stl, or one of these packed as .zst or .gz.
    original: PathBuf,
    /// The container that was baked of it.
    file: PathBuf,
    /// Shares of every part's triangles to compare at.
    #[arg(long, value_name = "SHARE,...", value_delimiter = ',', default_value = "0.5,0.25,0.1,0.02", value_parser = values::ratio)]
    ratios: Vec<f64>,
    /// Points on the surfaces of all parts together, dealt by area; a part gets at least 500.
    #[arg(long, value_name = "N", default_value = "200k", value_parser = sample_count)]
    samples: u32,
    /// Leave out parts of fewer triangles, of which no share means much.
    #[arg(long, value_name = "N", default_value = "1", value_parser = values::count)]
    least_triangles: u32,
    /// Plot the error over the triangles, at a dozen counts more.
    #[arg(long, value_name = "OUT.svg|OUT.png")]
    plot: Option<PathBuf>,
    /// Measure the container's levels of detail alone.
    #[arg(long)]
    no_meshoptimizer: bool,
    /// Print one line per ratio and part.
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Print the pooled figures as JSON.
    #[arg(long)]
    json: bool,
}

/// As many points as fit a gigabyte with what is found at each.
const MOST_SAMPLES: u32 = 10_000_000;

fn sample_count(text: &str) -> Result<u32, String> {
    values::count(text).and_then(|count| {
        if count <= MOST_SAMPLES { Ok(count) } else { Err(format!("must be at most {MOST_SAMPLES}")) }
    })
}

/// Runs `compare`.
pub fn run(arguments: &CompareArguments) -> Result<(), Failure> {
    let plot = arguments.plot.as_deref().map(|path| drawer(path).map(|draw| (path, draw))).transpose()?;
    let mut ratios = arguments.ratios.clone();
    if plot.is_some() {
        ratios.extend(plot::ratios());
    }
    let options = CompareOptions {
        ratios,
        samples: arguments.samples as usize,
        least_triangles: arguments.least_triangles.into(),
        meshoptimizer: !arguments.no_meshoptimizer,
    };
    let mut comparison = compare_with_progress(arguments, &options)?;
    if let Some((path, draw)) = plot {
        write_plot(arguments, path, draw, &comparison)?;
        comparison.keep_first(arguments.ratios.len());
    }
    if arguments.json {
        output::print_json(&comparison)
    } else if arguments.csv {
        output::print_text(&csv(&comparison))
    } else {
        output::print_text(&describe(&comparison))
    }
}

/// What makes the bytes of a picture.
type Drawer = fn(&Comparison, &str) -> Result<Vec<u8>, PlotError>;

/// Picks the format by extension, and says early what would stop the writing late.
fn drawer(path: &Path) -> Result<Drawer, Failure> {
    let drawer: Drawer = match output::extension(path).as_str() {
        "svg" => plot::svg,
        "png" => plot::png,
        _ => return Err(Failure::Argument(format!("the plot must end in .svg or .png: {}", path.display()))),
    };
    output::check_file(path)?;
    Ok(drawer)
}

fn write_plot(
    arguments: &CompareArguments,
    path: &Path,
    draw: Drawer,
    comparison: &Comparison,
) -> Result<(), Failure> {
    let name = arguments.original.file_name().unwrap_or_default().to_string_lossy();
    let title = format!("{}: error of its levels of detail", printable(&name));
    let bytes = draw(comparison, &title)
        .map_err(|error| Failure::Argument(format!("{error}: {}", path.display())))?;
    output::write_whole(path, |out| out.write_all(&bytes))
}

/// Compares with a progress bar on standard error and a way to stop.
fn compare_with_progress(
    arguments: &CompareArguments,
    options: &CompareOptions,
) -> Result<Comparison, Failure> {
    let file = MappedFile::open(&arguments.file).map_err(SceneError::from)?;
    let progress = CompareProgress::default();
    let work = || {
        let model = import::read(std::slice::from_ref(&arguments.original))?;
        compare(&model, file.bytes(), options, &progress).map_err(|error| in_file(error, arguments))
    };
    watched(&progress_bar(), &progress.cancelled, |bar| show(bar, &progress), work)
}

/// Adds the path of the file that is at fault.
fn in_file(error: CompareError, arguments: &CompareArguments) -> Failure {
    match error {
        CompareError::Container(cause) => {
            SceneError::Container { cause, path: arguments.file.clone() }.into()
        }
        CompareError::Mismatch { .. } => {
            Failure::Mismatch(format!("{error}: {}", arguments.original.display()))
        }
        CompareError::NothingToCompare { .. } => {
            Failure::Argument(format!("{error}: {}", arguments.file.display()))
        }
        CompareError::Interrupted => error.into(),
    }
}

fn progress_bar() -> ProgressBar {
    let style = progress::style("{msg:9} [{bar:32}] {percent} %, {eta} left");
    ProgressBar::new(0).with_style(style).with_message("reading")
}

fn show(bar: &ProgressBar, progress: &CompareProgress) {
    let total = progress.triangles_total.load(Ordering::Relaxed);
    if total > 0 {
        bar.set_message("measuring");
        bar.set_length(total);
        bar.set_position(progress.triangles_done.load(Ordering::Relaxed));
    }
}

fn csv(comparison: &Comparison) -> String {
    let lines = comparison.part_rows.iter().map(PartRow::csv);
    std::iter::once(PartRow::COLUMNS.join(",")).chain(lines).collect::<Vec<_>>().join("\n")
}

/// The table: for each ratio a line for ours, one for meshoptimizer, and one with the quotients.
fn describe(comparison: &Comparison) -> String {
    let mut lines = vec![
        format!(
            "{} parts, {} triangles, largest diagonal {}",
            human::count(comparison.parts),
            human::count(comparison.triangles),
            length(comparison.diagonal)
        ),
        format!(
            "{:>6} {:<14} {:>12} {:>10} {:>9} {:>10} {:>9} {:>8} {:>10} {:>10}",
            "share", "simplifier", "triangles", "RMS", "ppm", "max", "ppm", "normals", "stated max", "parts"
        ),
    ];
    for row in &comparison.rows {
        lines.extend(row_lines(row, comparison.diagonal));
    }
    if comparison.rows.iter().any(|row| !row.dealt.is_empty()) {
        lines.push(dealt_heading());
        lines.extend(comparison.rows.iter().flat_map(dealt_lines));
    }
    lines.join("\n")
}

fn dealt_heading() -> String {
    format!(
        "\nthe model as it is placed, its triangles dealt over the parts:\n\
        {:>6} {:<14} {:<9} {:>12} {:>10} {:>10} {:>8}",
        "share", "simplifier", "dealt by", "triangles", "RMS", "max", "normals"
    )
}

fn dealt_lines(row: &RatioRow) -> Vec<String> {
    let line = |(nth, dealt): (usize, &DealtRow)| {
        let by = match dealt.dealt_by {
            Dealing::Share => "share",
            Dealing::Cost if nth == 0 => "cost",
            Dealing::Cost => "our cost",
            Dealing::Error => "its error",
        };
        let share = if nth == 0 { percent(row.ratio) } else { String::new() };
        let Figures { triangles, rms, max, normal_degrees, .. } = dealt.figures;
        let (triangles, rms, max) = (human::count(triangles), length(rms), length(max));
        let name = dealt.simplifier;
        format!("{share:>6} {name:<14} {by:<9} {triangles:>12} {rms:>10} {max:>10} {normal_degrees:>7.2}°")
    };
    let mut lines: Vec<String> = row.dealt.iter().enumerate().map(line).collect();
    let mut quotients = |name: &str, rms: Option<f64>, normal: Option<f64>| {
        let (rms, normal) = (quotient(rms), quotient(normal));
        lines.push(format!("{:>6} {name:<24} {:>12} {rms:>10} {:>10} {normal:>8}", "", "", ""));
    };
    if row.meshoptimizer.is_some() {
        quotients("over its better one", row.dealt_rms_ratio, row.dealt_normal_ratio);
        quotients("over the same counts", row.same_counts_rms_ratio, row.same_counts_normal_ratio);
    }
    lines
}

fn row_lines(row: &RatioRow, diagonal: f64) -> Vec<String> {
    let share = percent(row.ratio);
    let stated = row.stated_max.map_or_else(|| "-".to_owned(), length);
    let parts = human::count(row.parts_compared);
    let mut lines =
        vec![format!("{share:>6} {} {stated:>10} {parts:>10}", figures("collapsar", &row.ours, diagonal))];
    if let Some(other) = &row.meshoptimizer {
        lines.push(format!("{:>6} {}", "", figures("meshoptimizer", other, diagonal)));
        let (rms, normal) = (quotient(row.rms_ratio), quotient(row.normal_ratio));
        lines.push(format!("{:>6} {:<14} {:>12} {rms:>10} {:>30} {normal:>9}", "", "quotient", "", ""));
    }
    if row.parts_vanished > 0 {
        let vanished = human::count(row.parts_vanished);
        lines.push(format!("{:>6} {vanished} parts, of which nothing is left, are not counted", ""));
    }
    lines
}

fn figures(name: &str, figures: &Figures, diagonal: f64) -> String {
    let ppm =
        |distance: f64| if diagonal > 0.0 { format!("{:.1}", 1e6 * distance / diagonal) } else { "-".into() };
    format!(
        "{name:<14} {:>12} {:>10} {:>9} {:>10} {:>9} {:>7.2}°",
        human::count(figures.triangles),
        length(figures.rms),
        ppm(figures.rms),
        length(figures.max),
        ppm(figures.max),
        figures.normal_degrees,
    )
}

/// A length with four significant digits, in powers of ten where it is very small or large.
fn length(length: f64) -> String {
    let magnitude = length.abs().log10().floor();
    if length == 0.0 {
        "0".to_owned()
    } else if (-4.0..6.0).contains(&magnitude) {
        format!("{length:.*}", (3.0 - magnitude).max(0.0) as usize)
    } else {
        format!("{length:.3e}")
    }
}

fn percent(ratio: f64) -> String {
    let text = format!("{:.2}", 100.0 * ratio);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

fn quotient(quotient: Option<f64>) -> String {
    quotient.map_or_else(|| "-".to_owned(), |quotient| format!("{quotient:.3}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_four_digits() {
        let texts = ["0", "1.000", "0.0001234", "1.235e-5", "123457", "1.235e6"];
        assert_eq!([0.0, 1.0, 1.234e-4, 1.23456e-5, 123_456.7, 1_234_567.0].map(length), texts);
        assert_eq!([0.5, 0.025, 1.0, 0.001].map(percent), ["50 %", "2.5 %", "100 %", "0.1 %"]);
    }
}
