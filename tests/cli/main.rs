//! The command line as a user meets it: the real binary, its exit codes, its messages, and what it leaves on disk.
//!
//! Exit codes: 0 done, 1 it could not be done, 2 the arguments make no sense, 130 interrupted. A failure is one line
//! on standard error, `error: what: where`, and leaves the folder as it was.

#![expect(clippy::unwrap_used, reason = "a test's helpers panic to fail it")]

#[path = "../common/mod.rs"]
mod common;

mod arguments;
mod compare;
mod damaged;
mod destination;
mod full_disk;
mod help;
mod hostile;
mod input;
mod interrupted;
mod live;
mod memory;
mod models;
mod pipes;
mod report;
mod reports;
mod resume;
mod shot;
mod synth;
mod workplace;
