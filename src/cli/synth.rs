//! `collapsar synth`: a size and a layout in, a synthetic assembly out.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use clap::Args;
use collapsar::bake::{BakeError, BakeOptions, bake_source};
use collapsar::stats::memory::peak_resident_bytes;
use collapsar::stats::report::human;
use collapsar::synth::glb::{Glb, GlbError};
use collapsar::synth::{Layout, Plan, SynthOptions, SynthReport, Synthetic, obj};
use indicatif::ProgressBar;

use super::bake::watched_bake;
use super::output::Kind;
use super::progress::style;
use super::{Failure, interrupt, output, values};

/// Arguments of `synth`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar synth -o small.clps  a million triangles in two thousand parts\n  \
    collapsar synth --triangles 332M --parts 718k -o boeing.clps  the size of the Boeing 777\n  \
    collapsar synth --triangles 20M --compress -o small.clps  a third of the file\n  \
    collapsar synth --layout ship --triangles 20M --seed 7 -o ship.glb\n  \
    collapsar synth --layout plant --parts 5k --instances 50k -o plant.obj\n\n\
    The same options give the same bytes. GLB keeps the assembly tree and shares repeated parts, and holds less than \
    4 GiB (about 120 million triangles); OBJ has no instances, so that every placement is written out.\n\n\
    With --json, standard output is one object with layout, seed, parts, instances, nodes, triangles, triangles_placed, \
    file_bytes, seconds, triangles_per_second and peak_rss_bytes.")]
pub struct SynthArguments {
    /// Triangles of all parts together, each counted once however often it is placed; k, M and G work.
    #[arg(long, default_value = "1M", value_name = "TRIANGLES", value_parser = values::large_count)]
    triangles: u64,
    /// Distinct parts; by default one for 462 triangles. A part has at least 20.
    #[arg(long, value_name = "PARTS", value_parser = values::large_count)]
    parts: Option<u64>,
    /// Placements of parts, at least one each; by default 1.3 times the parts. Fasteners, clips, brackets, seats and
    /// fittings repeat.
    #[arg(long, value_name = "INSTANCES", value_parser = values::large_count)]
    instances: Option<u64>,
    /// What varies between two models of one size.
    #[arg(long, default_value_t = 1, value_name = "NUMBER")]
    seed: u64,
    /// What it looks like.
    #[arg(long, value_enum, default_value = "airplane")]
    layout: LayoutArgument,
    /// The file to write; it appears when it is complete.
    #[arg(short, long, value_name = "OUT.clps|OUT.glb|OUT.obj")]
    output: PathBuf,
    /// What to write, where the extension does not say it.
    #[arg(long = "as", value_enum, value_name = "FORMAT")]
    format: Option<Format>,
    /// Worker threads; 0 for one a core. The bytes written are the same.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
    /// The most memory that the bake of a container uses; KiB, MiB and GiB work.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    memory: Option<u64>,
    /// Go on with a container that was interrupted, from OUT.clps.bake; the bytes written are the same.
    #[arg(long)]
    resume: bool,
    /// Compress what is drawn, as `bake --compress` does.
    #[arg(long)]
    compress: bool,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum LayoutArgument {
    /// An airliner of 64 m.
    Airplane,
    /// A freighter of 180 m.
    Ship,
    /// A chemical plant of 150 m by 60 m.
    Plant,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// A container, baked.
    Clps,
    /// Binary glTF.
    Glb,
    /// Wavefront OBJ.
    Obj,
}

/// Runs `synth`.
pub fn run(arguments: &SynthArguments) -> Result<(), Failure> {
    let started = Instant::now();
    // From before the plan is made, which takes a second for millions of parts.
    interrupt::flag();
    let path = arguments.output.as_path();
    let format = format(arguments)?;
    let plan = Plan::new(&options(arguments))
        .map_err(|error| Failure::Argument(format!("cannot make this model: {error}")))?;
    let kind = match format {
        Format::Clps => Kind::Container,
        Format::Glb => Kind::Glb,
        Format::Obj => Kind::Obj,
    };
    output::check_kind(kind, &[], path)?;
    output::check_file(path)?;
    set_threads(arguments.threads)?;
    match format {
        Format::Clps => write_container(&plan, arguments)?,
        Format::Glb => write_glb(&plan, path)?,
        Format::Obj => write_obj(&plan, path)?,
    }
    let file_bytes = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    let mut report = SynthReport::new(&plan, arguments.seed, started.elapsed().as_secs_f64());
    (report.file_bytes, report.peak_rss_bytes) = (file_bytes, peak_resident_bytes());
    if arguments.json { output::print_json(&report) } else { output::print_text(&describe(&report, path)) }
}

fn options(arguments: &SynthArguments) -> SynthOptions {
    SynthOptions {
        triangles: arguments.triangles,
        parts: arguments.parts,
        instances: arguments.instances,
        seed: arguments.seed,
        layout: match arguments.layout {
            LayoutArgument::Airplane => Layout::Airplane,
            LayoutArgument::Ship => Layout::Ship,
            LayoutArgument::Plant => Layout::Plant,
        },
    }
}

/// What was asked for with `--as`, else what the extension says.
fn format(arguments: &SynthArguments) -> Result<Format, Failure> {
    let extension = arguments.output.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let by_extension = match extension.as_deref() {
        Some("clps") => Some(Format::Clps),
        Some("glb") => Some(Format::Glb),
        Some("obj") => Some(Format::Obj),
        _ => None,
    };
    arguments.format.or(by_extension).ok_or_else(|| {
        Failure::Argument(format!(
            "the output must end in .clps, .glb or .obj, or --as must say what it is: {}",
            arguments.output.display()
        ))
    })
}

/// Sets how many threads work, whoever starts them.
fn set_threads(threads: u16) -> Result<(), Failure> {
    let threads = usize::from(threads);
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    built.map_err(|source| BakeError::Threads { threads, source }.into())
}

/// Bakes the model as it is made.
fn write_container(plan: &Plan, arguments: &SynthArguments) -> Result<(), Failure> {
    let options = BakeOptions {
        threads: arguments.threads.into(),
        memory_bytes: arguments.memory,
        resume: arguments.resume,
        list_parts: false,
        compress: arguments.compress,
        ..BakeOptions::default()
    };
    let source = Synthetic::new(plan);
    watched_bake(|progress| bake_source(&source, &arguments.output, &options, progress))?;
    Ok(())
}

fn write_glb(plan: &Plan, path: &Path) -> Result<(), Failure> {
    let bar = bar("measuring", plan.triangle_count());
    let go_on = |triangles| {
        bar.inc(triangles);
        !interrupt::flag().load(Ordering::Relaxed)
    };
    let measured = Glb::measure(plan, go_on);
    bar.finish_and_clear();
    let glb = measured.map_err(|error| match error {
        GlbError::Interrupted => Failure::Interrupted("this file was not written"),
        other => Failure::Argument(format!("{other}: {}", path.display())),
    })?;
    written(path, "writing", plan.triangle_count(), |out, bar| glb.write(out, |triangles| bar.inc(triangles)))
}

fn write_obj(plan: &Plan, path: &Path) -> Result<(), Failure> {
    written(path, "writing", plan.triangles_placed(), |out, bar| {
        obj::write(plan, out, |triangles| bar.inc(triangles))
    })
}

fn written(
    path: &Path,
    doing: &'static str,
    triangles: u64,
    write: impl FnOnce(&mut dyn io::Write, &ProgressBar) -> io::Result<()>,
) -> Result<(), Failure> {
    let bar = bar(doing, triangles);
    let result = output::write_whole(path, |out| write(out, &bar));
    bar.finish_and_clear();
    result
}

fn bar(doing: &'static str, triangles: u64) -> ProgressBar {
    let bar = ProgressBar::new(triangles).with_message(doing);
    bar.set_style(style("{msg:9} [{bar:32}] {percent} % of {human_len} triangles, {eta} left"));
    bar
}

fn describe(report: &SynthReport, path: &Path) -> String {
    let count = human::count;
    format!(
        "parts        {} of {} triangles each, placed {} times ({} nodes)\n\
         triangles    {} ({} placed)\n\
         time         {:.2} s, {} triangles/s\n\
         file         {}: {}",
        count(report.parts),
        count(report.triangles / report.parts.max(1)),
        count(report.instances),
        count(report.nodes),
        count(report.triangles),
        count(report.triangles_placed),
        report.seconds,
        human::rounded(report.triangles_per_second),
        human::bytes(report.file_bytes),
        path.display()
    )
}
