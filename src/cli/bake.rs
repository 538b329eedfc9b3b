//! `collapsar bake`: models in, a container out.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use clap::Args;
use collapsar::bake::{BakeError, BakeOptions, BakeProgress, BakeReport, bake};
use collapsar::geometry::Boundary;
use collapsar::geometry::body::OrderOptions;
use collapsar::geometry::normals::CREASE_DEGREES;
use collapsar::geometry::record::Stall;
use collapsar::stats::report::human;
use indicatif::ProgressBar;

use super::output::Kind;
use super::progress::{style, watched};
use super::{Failure, output, values};

/// Arguments of `bake`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar bake truck.obj -o truck.clps\n  \
    collapsar bake hull.glb deck.glb engine.obj -o ship.clps --json\n  \
    collapsar bake dragon.ply.zst -o dragon.clps  unpacked as it is read\n  \
    collapsar bake truck.obj -o truck.clps --report truck.json  with a list of the parts\n  \
    collapsar bake ship.glb -o ship.clps --memory 2GiB\n  \
    collapsar bake ship.glb -o ship.clps --compress  for a slow disk, or to send it\n  \
    collapsar bake ship.glb -o ship.clps --resume  after it was interrupted\n\n\
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
    /// The most memory to use; KiB, MiB and GiB work. What cannot be done within it is refused, with the least that works.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    memory: Option<u64>,
    /// Go on with what an interrupted bake of the same model has left in OUT.clps.bake; the bytes written are the same.
    #[arg(long)]
    resume: bool,
    /// Compress what is drawn: about a third of the size; the bake takes longer, and reading takes some time of a
    /// processor instead of a disk. What is drawn is the same.
    #[arg(long)]
    compress: bool,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
    /// Also write the report with one object for each part, as JSON; it appears when it is complete, and costs no time:
    /// everything in it, the boundary by the file's own indices too (1 to 2 % of a bake), is found without it as well.
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
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
        memory_bytes: arguments.memory,
        resume: arguments.resume,
        list_parts: arguments.report.is_some(),
        compress: arguments.compress,
    };
    output::check_kind(Kind::Container, &arguments.inputs, &arguments.output)?;
    if let Some(path) = &arguments.report {
        check_report(path, arguments)?;
    }
    let report = bake_with_progress(&arguments.inputs, &arguments.output, &options)?;
    if let Some(path) = &arguments.report {
        output::write_json(path, &report.whole())?;
    }
    if arguments.json {
        return output::print_json(&report);
    }
    output::print_text(&describe(&report, &arguments.output))
}

/// That the report can be written, and replaces nothing but an older report.
fn check_report(path: &Path, arguments: &BakeArguments) -> Result<(), Failure> {
    output::check_file(path)?;
    if place_of(path) == place_of(&arguments.output) {
        let path = path.display();
        return Err(Failure::Argument(format!(
            "the report would replace the container; choose another file: {path}"
        )));
    }
    output::check_kind(Kind::BakeReport, &arguments.inputs, path)
}

/// Where a file is or would be: its folder without links and its name, or all of it without links if it exists.
fn place_of(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    path.canonicalize().ok().or_else(|| Some(folder.canonicalize().ok()?.join(path.file_name()?)))
}

/// Bakes with a progress bar on standard error and a way to stop.
pub fn bake_with_progress(
    inputs: &[PathBuf],
    output: &Path,
    options: &BakeOptions,
) -> Result<BakeReport, BakeError> {
    watched_bake(|progress| bake(inputs, output, options, progress))
}

/// Runs a bake with a progress bar on standard error and a way to stop.
pub fn watched_bake<T: Send>(
    bake: impl FnOnce(&BakeProgress) -> Result<T, BakeError> + Send,
) -> Result<T, BakeError> {
    let progress = BakeProgress::default();
    let work = || bake(&progress);
    watched(&ProgressBar::new(0), &progress.cancelled, |bar| show(bar, &progress), work)
}

/// Reading and writing have no measure of their own.
fn busy(bar: &ProgressBar, doing: &'static str) {
    if bar.message() != doing {
        bar.set_style(style("{msg:9} {spinner} {elapsed}"));
        bar.set_message(doing);
    }
    bar.tick();
}

fn show(bar: &ProgressBar, progress: &BakeProgress) {
    let total = progress.triangles_total.load(Ordering::Relaxed);
    if progress.writing.load(Ordering::Relaxed) {
        show_share(bar, "writing", "MB", [&progress.bytes_written, &progress.bytes_total]);
    } else if total == 0 {
        busy(bar, "reading");
    } else {
        show_share(bar, "ordering", "triangles", [&progress.triangles_done, &progress.triangles_total]);
    }
}

/// How much of something is done, with an estimate of this stage alone.
fn show_share(bar: &ProgressBar, doing: &'static str, unit: &'static str, [done, total]: [&AtomicU64; 2]) {
    // Bytes are shown in whole megabytes.
    let scale = if unit == "MB" { 1_000_000 } else { 1 };
    if bar.message() != doing {
        bar.set_length(total.load(Ordering::Relaxed) / scale);
        let template = format!("{{msg:9}} [{{bar:32}}] {{percent}} % of {{human_len}} {unit}, {{eta}} left");
        bar.set_style(style(&template));
        bar.set_message(doing);
        bar.set_position(done.load(Ordering::Relaxed) / scale);
        bar.reset_eta();
    }
    bar.set_position(done.load(Ordering::Relaxed) / scale);
}

/// A share in per cent.
fn percent(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

/// The report in about ten lines.
pub fn describe(report: &BakeReport, output: &Path) -> String {
    let mut lines = found_lines(report);
    lines.push(stalled_line(report));
    lines.extend(cost_lines(report));
    lines.push(format!(
        "container    {} ({:.1} bytes/triangle): {}",
        human::bytes(report.file_bytes),
        report.bytes_per_triangle,
        output.display()
    ));
    lines.extend(report.notes.iter().map(|note| format!("note         {note}")));
    lines.join("\n")
}

/// What was read and what became of it.
fn found_lines(report: &BakeReport) -> Vec<String> {
    let (count, welded) = (human::count, &report.welded);
    vec![
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
            count(welded.degenerate_triangles),
            count(welded.duplicate_triangles)
        ),
        format!(
            "vertices     {} from {} in the files, welded to {} positions ({} moved)",
            count(report.vertices),
            count(welded.source_vertices),
            count(welded.welded_positions),
            count(welded.moved_positions)
        ),
        format!(
            "boundary     {:.1} % of the vertices in the files, {:.1} % of the positions; {} edges are non-manifold",
            percent(welded.source_open_vertices, welded.source_vertices),
            percent(welded.open_positions, welded.welded_positions),
            count(welded.non_manifold_edges)
        ),
        format!(
            "coarsest     {} triangles, {:.2} % of all",
            count(report.coarsest_triangles),
            percent(report.coarsest_triangles, report.triangles)
        ),
    ]
}

fn cost_lines(report: &BakeReport) -> Vec<String> {
    let mut lines = vec![format!(
        "time         {:.2} s ({:.2} s reading, {:.2} s ordering, {:.2} s writing), {} triangles/s",
        report.seconds,
        report.import_seconds,
        report.order_seconds,
        report.write_seconds,
        human::rounded(report.triangles_per_second)
    )];
    lines.extend(report.peak_rss_bytes.zip(report.rss_before_bytes).map(|(peak, before)| {
        let own = peak.saturating_sub(before);
        let each = own as f64 / report.welded.source_triangles.max(1) as f64;
        let [peak, own] = [peak, own].map(human::bytes);
        format!("memory       {peak} at most, {own} of it for the bake ({each:.0} bytes/triangle read)")
    }));
    lines
}

/// How many parts stall by which cause, the most frequent first, and the worst of them.
fn stalled_line(report: &BakeReport) -> String {
    let stalled = &report.stalled_parts;
    let Some(worst) = stalled.iter().max_by_key(|part| part.coarsest_triangles) else {
        return "stalled      no part keeps more than a tenth of its triangles".to_owned();
    };
    let mut causes: Vec<&str> = stalled.iter().map(|part| part.cause).collect();
    causes.sort_unstable();
    let mut causes: Vec<(usize, &str)> =
        causes.chunk_by(|a, b| a == b).map(|same| (same.len(), same[0])).collect();
    causes.sort_by_key(|&(parts, _)| std::cmp::Reverse(parts));
    let causes: Vec<String> = causes
        .iter()
        .map(|&(parts, cause)| format!("{} by {}", human::count(parts as u64), short(cause)))
        .collect();
    format!(
        "stalled      {} parts keep more than a tenth ({}); most: \"{}\", {} of {}",
        human::count(stalled.len() as u64),
        causes.join(", "),
        printable(&worst.name),
        human::count(worst.coarsest_triangles),
        human::count(worst.triangles),
    )
}

/// A cause in a list of counts.
fn short(cause: &str) -> &str {
    if cause == Stall::Least.describe() { "having few triangles" } else { cause }
}

/// A name from a file on one line of a terminal: no control characters, not too long.
pub fn printable(name: &str) -> String {
    let clean: String = name.chars().take(48).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if name.chars().nth(48).is_some() { clean + "…" } else { clean }
}
