//! `collapsar bake`: models in, a container out.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use collapsar::bake::{BakeError, BakeOptions, BakeProgress, BakeReport, bake};
use collapsar::container::MAGIC;
use collapsar::geometry::Boundary;
use collapsar::geometry::body::OrderOptions;
use collapsar::geometry::normals::CREASE_DEGREES;
use collapsar::geometry::record::Stall;
use collapsar::stats::report::human;
use indicatif::{ProgressBar, ProgressStyle};

use super::{Failure, interrupt, output, values};

/// Arguments of `bake`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar bake truck.obj -o truck.clps\n  \
    collapsar bake hull.glb deck.glb engine.obj -o ship.clps --json\n  \
    collapsar bake dragon.ply.zst -o dragon.clps  unpacked as it is read\n\n\
    With --json, standard output is one object with parts, cells, instances, vertices, triangles, \
    locked_vertices, coarsest_triangles, file_bytes, seconds, peak_rss_bytes and more; lengths are bytes and seconds.")]
pub struct BakeArguments {
    /// Models to read: .obj, .gltf, .glb, .ply, .stl, each also packed as .zst or .gz. Several become one assembly.
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// The container to write; it appears when it is complete.
    #[arg(short, long, value_name = "OUT.clps")]
    output: PathBuf,
    /// What may happen to open boundaries: slide along themselves, or stay locked as in the paper.
    #[arg(long, value_enum, default_value = "slide")]
    boundary: BoundaryArgument,
    /// Where a file has no normals, faces that meet at less than this angle (in degrees) are smooth.
    #[arg(long, value_name = "DEGREES", default_value_t = f64::from(CREASE_DEGREES), value_parser = values::positive)]
    crease: f64,
    /// Close gaps: positions on open edges at most so far apart, in the model's unit of length, become one; 0 leaves all
    /// but equal ones apart. By default the step of the part's own grid, about a two-millionth of its size.
    #[arg(long, value_name = "TOLERANCE", value_parser = values::not_negative)]
    weld: Option<f64>,
    /// Worker threads; 0 for one a core. The bytes written are the same.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum BoundaryArgument {
    Slide,
    Lock,
}

/// Runs `bake`.
pub fn run(arguments: &BakeArguments) -> Result<(), Failure> {
    let options = BakeOptions {
        order: OrderOptions {
            boundary: match arguments.boundary {
                BoundaryArgument::Slide => Boundary::Slide,
                BoundaryArgument::Lock => Boundary::Lock,
            },
            weld_tolerance: arguments.weld,
        },
        crease_degrees: arguments.crease as f32,
        threads: arguments.threads.into(),
    };
    check_not_an_input(&arguments.inputs, &arguments.output)?;
    let report = bake_with_progress(&arguments.inputs, &arguments.output, &options)?;
    if arguments.json {
        return output::print_json(&report);
    }
    output::print_text(&describe(&report, &arguments.output))
}

/// That a slip of the keyboard does not replace a model, or a file that belongs to one, by its container.
fn check_not_an_input(inputs: &[PathBuf], output: &Path) -> Result<(), Failure> {
    let Ok(existing) = output.canonicalize() else { return Ok(()) };
    if let Some(input) = inputs.iter().find(|i| i.canonicalize().is_ok_and(|input| input == existing)) {
        return Err(Failure::Argument(format!(
            "the container would replace this input; choose another output: {}",
            input.display()
        )));
    }
    let mut start = Vec::new();
    let read =
        std::fs::File::open(&existing).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut start));
    // What cannot be read is the writer's to refuse; an empty file is nobody's model.
    if existing.is_file() && read.is_ok() && !start.is_empty() && start != MAGIC {
        return Err(Failure::Argument(format!(
            "the container would replace a file that is not a container; choose another output or remove it: {}",
            output.display()
        )));
    }
    Ok(())
}

/// Bakes with a progress bar on standard error and a way to stop.
pub fn bake_with_progress(
    inputs: &[PathBuf],
    output: &Path,
    options: &BakeOptions,
) -> Result<BakeReport, BakeError> {
    let progress = BakeProgress::default();
    let flag = interrupt::flag();
    std::thread::scope(|scope| {
        let work = scope.spawn(|| bake(inputs, output, options, &progress));
        let bar = progress_bar();
        while !work.is_finished() {
            progress.cancelled.store(flag.load(Ordering::Relaxed), Ordering::Relaxed);
            show(&bar, &progress);
            std::thread::sleep(Duration::from_millis(20));
        }
        bar.finish_and_clear();
        work.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn progress_bar() -> ProgressBar {
    let style = "{msg:9} [{bar:32}] {human_pos} of {human_len} triangles, {eta} left";
    // The template is a constant that indicatif has parsed in every test of this verb.
    let style = ProgressStyle::with_template(style).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(0).with_style(style).with_message("reading")
}

fn show(bar: &ProgressBar, progress: &BakeProgress) {
    let total = progress.triangles_total.load(Ordering::Relaxed);
    if total > 0 {
        bar.set_message("ordering");
        bar.set_length(total);
        bar.set_position(progress.triangles_done.load(Ordering::Relaxed));
    }
}

/// The report in about ten lines.
pub fn describe(report: &BakeReport, output: &Path) -> String {
    let count = human::count;
    let share = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
    let mut lines = vec![
        format!(
            "parts        {} ({} cells), placed {} times",
            count(report.parts),
            count(report.cells),
            count(report.instances)
        ),
        format!(
            "triangles    {} ({} placed); {} degenerate and {} repeated ones dropped",
            count(report.triangles),
            count(report.triangles_placed),
            count(report.degenerate_triangles),
            count(report.duplicate_triangles)
        ),
        format!(
            "vertices     {} from {} in the files, at {} positions",
            count(report.vertices),
            count(report.source_vertices),
            count(report.welded_positions)
        ),
        format!(
            "boundary     {:.1} % of the positions are open, {} edges are non-manifold",
            share(report.open_positions, report.welded_positions),
            count(report.non_manifold_edges)
        ),
        format!(
            "coarsest     {} triangles, {:.2} % of all",
            count(report.coarsest_triangles),
            share(report.coarsest_triangles, report.triangles)
        ),
    ];
    lines.push(stalled_line(report));
    lines.push(format!(
        "time         {:.2} s ({:.2} s reading, {:.2} s ordering), {} triangles/s",
        report.seconds,
        report.import_seconds,
        report.order_seconds,
        human::rounded(report.triangles_per_second)
    ));
    if let Some(peak) = report.peak_rss_bytes {
        lines.push(format!("memory       {} at most", human::bytes(peak)));
    }
    lines.push(format!(
        "container    {} ({:.1} bytes/triangle): {}",
        human::bytes(report.file_bytes),
        report.bytes_per_triangle,
        output.display()
    ));
    lines.extend(report.notes.iter().map(|note| format!("note         {note}")));
    lines.join("\n")
}

fn stalled_line(report: &BakeReport) -> String {
    let stalled = &report.stalled_parts;
    match stalled.iter().max_by_key(|part| part.coarsest_triangles) {
        None => "stalled      no part keeps more than a tenth of its triangles".to_owned(),
        Some(worst) => format!(
            "stalled      {} parts keep more than a tenth ({} of them with few triangles); most: \"{}\", {} of {} ({})",
            human::count(stalled.len() as u64),
            human::count(stalled.iter().filter(|part| part.cause == Stall::Least.describe()).count() as u64),
            printable(&worst.name),
            human::count(worst.coarsest_triangles),
            human::count(worst.triangles),
            worst.cause
        ),
    }
}

/// A name from a file on one line of a terminal: no control characters, not too long.
pub fn printable(name: &str) -> String {
    let clean: String = name.chars().take(48).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if name.chars().nth(48).is_some() { clean + "…" } else { clean }
}
