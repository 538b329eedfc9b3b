//! `collapsar report`: folders that `fly --out` has written in, one self-contained HTML page out.

use std::path::PathBuf;

use clap::Args;
use collapsar::report;
use collapsar::stats::report::human;

use super::{Failure, output};

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar report flight -o flight.html\n  \
    collapsar report walk orbit -o both.html --title 'Two ways round the engine'\n\n\
    The page loads nothing: plots and pictures are in it. A folder of `fly --compare` counts as its three flights; a \
    page has room for eight.")]
pub struct ReportArguments {
    /// Folders that `fly --out` has written, with --compare or without.
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// The page.
    #[arg(short, long, value_name = "OUT.html")]
    output: PathBuf,
    /// The heading of the page.
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
}

/// Runs `report`.
pub fn run(arguments: &ReportArguments) -> Result<(), Failure> {
    let path = &arguments.output;
    // So that no slip replaces a model or the numbers of a flight.
    if !matches!(output::extension(path).as_str(), "html" | "htm") {
        return Err(Failure::Argument(format!("the page must end in .html: {}", path.display())));
    }
    output::check_file(path)?;
    let flights = report::read(&arguments.folders)?;
    let page = report::page(&flights, arguments.title.as_deref())?;
    output::write_whole(path, |out| out.write_all(page.as_bytes()))?;
    let frames: u64 = flights.iter().map(|flight| flight.summary.frames).sum();
    output::print_text(&format!(
        "{} {}, {} frames, {}: {}",
        flights.len(),
        if flights.len() == 1 { "flight" } else { "flights" },
        human::count(frames),
        human::bytes(page.len() as u64),
        path.display()
    ))
}
