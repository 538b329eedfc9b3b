//! The `collapsar` command: parses the command line, runs one verb, and says in one line what went wrong.

mod cli;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

/// Without `COLLAPSAR_LOG`, our own warnings alone: what the graphics libraries say comes back as our errors.
const DEFAULT_LOG: &str = "collapsar=warn";

fn main() -> ExitCode {
    start_log();
    match cli::run(cli::Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn start_log() {
    let wanted = std::env::var("COLLAPSAR_LOG").unwrap_or_else(|_| DEFAULT_LOG.to_owned());
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(wanted))
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .log_internal_errors(false)
        .init();
}
