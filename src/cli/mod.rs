//! The verbs of the command line, one file each, and what they share.

mod bake;
mod baked;
mod bandwidth;
mod compare;
mod cuts;
mod demo;
mod export;
mod failure;
mod fly;
mod info;
mod interrupt;
mod output;
mod progress;
mod report;
mod shot;
mod synth;
mod values;
mod verify;
#[cfg(feature = "viewer")]
mod view;

use std::path::{Path, PathBuf};

use clap::{CommandFactory, Parser, Subcommand};

pub use failure::Failure;

/// Bake a CAD assembly that fits neither the graphics card nor memory, and fly through it.
#[derive(Debug, Parser)]
#[command(
    name = "collapsar",
    version,
    about,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  \
        collapsar engine.glb                              look at a model in a window (baked beside itself first)\n  \
        collapsar demo                                    bake and fly the bundled models, print the transfer saving\n  \
        collapsar bake engine.glb -o engine.clps          order a model by its edge collapses\n  \
        collapsar fly engine.clps --path orbit --out out  fly round it and write pictures and numbers\n\n\
        Environment:\n  \
        COLLAPSAR_ADAPTER  part of the name of the graphics adapter to use\n  \
        COLLAPSAR_LOG      what to log to standard error, for example `info` or `collapsar=debug`"
)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Option<Verb>,
    /// A model to look at: short for `view FILE`.
    #[cfg_attr(not(feature = "viewer"), arg(hide = true))]
    file: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Look at a model in a window.
    #[cfg(feature = "viewer")]
    View(view::ViewArguments),
    /// Order models by their edge collapses and write one container.
    Bake(bake::BakeArguments),
    /// Say what a container holds.
    Info(info::InfoArguments),
    /// Check every checksum and every invariant of a container.
    Verify(verify::VerifyArguments),
    /// Write any level of detail as an ordinary mesh.
    Export(export::ExportArguments),
    /// Measure the levels of detail against the model that they were baked of, and against meshoptimizer's.
    Compare(compare::CompareArguments),
    /// Fly along a camera path without a window; write pictures and what each frame sent.
    Fly(fly::FlyArguments),
    /// Take one picture of a model, from any side, cut, coloured or isolated.
    Shot(shot::ShotArguments),
    /// Make one page, with plots and pictures, of what flights have written.
    Report(report::ReportArguments),
    /// Make a CAD-like assembly of any size: an airliner, a ship or a plant.
    Synth(synth::SynthArguments),
    /// Measure how fast the graphics adapter's memory moves bytes.
    Bandwidth(bandwidth::BandwidthArguments),
    /// Bake the bundled models and fly them with all strategies.
    Demo(demo::DemoArguments),
}

/// Nothing was asked for: says what could be, as for a wrong argument.
fn usage() -> Result<(), Failure> {
    let mut command = Arguments::command();
    let text = command.render_help();
    eprint!("{text}");
    std::process::exit(2)
}

/// A word alone that is no file was meant as a verb.
#[cfg(feature = "viewer")]
fn is_meant_as_file(path: &Path) -> bool {
    path.exists() || path.extension().is_some() || path.components().count() > 1
}

fn unknown(word: &Path) -> ! {
    let message = format!("unrecognized subcommand '{}', and there is no file of that name", word.display());
    Arguments::command().error(clap::error::ErrorKind::InvalidSubcommand, message).exit()
}

/// Runs the verb that was asked for.
pub fn run(arguments: Arguments) -> Result<(), Failure> {
    let verb = match (arguments.verb, arguments.file) {
        (Some(verb), _) => verb,
        #[cfg(feature = "viewer")]
        (None, Some(file)) if is_meant_as_file(&file) => Verb::View(view::ViewArguments::of_file(file)),
        (None, Some(word)) => unknown(&word),
        (None, None) => return usage(),
    };
    match verb {
        #[cfg(feature = "viewer")]
        Verb::View(arguments) => view::run(&arguments),
        Verb::Bake(arguments) => bake::run(&arguments),
        Verb::Info(arguments) => info::run(&arguments),
        Verb::Verify(arguments) => verify::run(&arguments),
        Verb::Export(arguments) => export::run(&arguments),
        Verb::Compare(arguments) => compare::run(&arguments),
        Verb::Fly(arguments) => fly::run(&arguments),
        Verb::Shot(arguments) => shot::run(&arguments),
        Verb::Report(arguments) => report::run(&arguments),
        Verb::Synth(arguments) => synth::run(&arguments),
        Verb::Bandwidth(arguments) => bandwidth::run(&arguments),
        Verb::Demo(arguments) => demo::run(&arguments),
    }
}
