//! `collapsar verify`: a container in, everything that is wrong with it out.

use std::path::PathBuf;

use clap::Args;
use collapsar::container::{Container, inspect};
use collapsar::scene::SceneError;
use collapsar::scene::mapped::MappedFile;
use collapsar::stats::report::human;

use super::{Failure, output};

/// Arguments of `verify`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  collapsar verify engine.clps\n\nThe exit code is 0 if nothing is wrong.")]
pub struct VerifyArguments {
    /// The container.
    file: PathBuf,
}

/// Runs `verify`.
pub fn run(arguments: &VerifyArguments) -> Result<(), Failure> {
    let wrap = |cause| SceneError::Container { cause, path: arguments.file.clone() };
    let file = MappedFile::open(&arguments.file).map_err(SceneError::from)?;
    let container = Container::open(file.bytes()).map_err(wrap)?;
    let report = inspect(&container);
    for finding in &report.findings {
        output::complain(finding);
    }
    if !report.findings.is_empty() {
        let count = report.findings.len();
        let findings = match count {
            1 => "finding",
            _ if count >= collapsar::container::MAX_FINDINGS => "findings or more",
            _ => "findings",
        };
        return Err(Failure::Mismatch(format!(
            "{count} {findings}: the container is damaged; copy or bake it again: {}",
            arguments.file.display()
        )));
    }
    output::print_text(&format!(
        "sound: {} parts, {} chunks, {} of payload in {}: {}",
        human::count(report.parts as u64),
        human::count(report.chunks as u64),
        human::bytes(report.chunk_bytes),
        human::bytes(file.bytes().len() as u64),
        arguments.file.display()
    ))
}
