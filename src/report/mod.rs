//! Folders written by `fly --out` in, one self-contained HTML page out.
//!
//! What flows through: `read` takes in summaries, records and the names of pictures; `plots` and `versus`
//! draw them, over frames that `bands` thin out, on `axis` and `chart`; `tables` puts the numbers of `paper`
//! beside ours; `pictures` makes small PNGs; `page` writes it all into one text that loads nothing.

mod arrival;
mod axis;
mod bands;
mod chart;
mod page;
mod paper;
mod pictures;
mod plots;
mod read;
mod tables;
mod versus;

use std::io;
use std::path::PathBuf;

pub use page::page;
pub use read::{Flown, read};

/// Flights on one page: as many as there are colours that can be told apart.
pub const MOST_FLIGHTS: usize = 8;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Nothing to show.
    #[error("no flights: give a folder that `collapsar fly --out` has written")]
    NoFlights,
    /// A folder is not there.
    #[error("there is no such folder; give one that `collapsar fly --out` has written: {}", .0.display())]
    NoFolder(PathBuf),
    /// A file was given.
    #[error("this is a file; give the folder that `collapsar fly --out` has written: {}", .0.display())]
    NotAFolder(PathBuf),
    /// A folder without the files of a flight, or one whose flight was interrupted.
    #[error("no {file} here; give a folder that `collapsar fly --out` has written to its end: {}", folder.display())]
    NotAFlight {
        /// What is missing.
        file: &'static str,
        /// Where.
        folder: PathBuf,
    },
    /// The system refuses.
    #[error("cannot read: {cause}: {}", path.display())]
    Read {
        /// The system's words.
        cause: io::Error,
        /// The file.
        path: PathBuf,
    },
    /// A summary is no JSON, or lacks something.
    #[error("not the summary of a flight: {cause}; fly again: {}", path.display())]
    Json {
        /// What is wrong, with line and column.
        cause: serde_json::Error,
        /// The file.
        path: PathBuf,
    },
    /// A line of the records is damaged.
    #[error("damaged in line {line}: {what}; fly again: {}", path.display())]
    Csv {
        /// The line, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
        /// The file.
        path: PathBuf,
    },
    /// The records have other columns.
    #[error(
        "line 1 has no column `{column}`: not the records of a flight, or of another version; fly again: {}", path.display()
    )]
    Column {
        /// The first column that is missing.
        column: &'static str,
        /// The file.
        path: PathBuf,
    },
    /// Records without frames.
    #[error("there is no frame in it; fly again: {}", .0.display())]
    NoFrames(PathBuf),
    /// More frames than a flight may have.
    #[error("more than {most} frames, which no flight has: {}", path.display())]
    TooManyFrames {
        /// How many there may be.
        most: usize,
        /// The file.
        path: PathBuf,
    },
    /// Summary and records are of different flights.
    #[error("{found} frames, where summary.json beside it says {said}: cut short or mixed up; fly again: {}", path.display())]
    FrameCount {
        /// Frames in the records.
        found: u64,
        /// Frames by the summary.
        said: u64,
        /// The records.
        path: PathBuf,
    },
    /// Two flights could not be told apart.
    #[error("another folder is called `{name}` too, so that their curves could not be told apart; rename one: {}", path.display())]
    SameName {
        /// The name.
        name: String,
        /// The second of them.
        path: PathBuf,
    },
    /// More flights than colours.
    #[error("{0} flights, where a page has room for {MOST_FLIGHTS}; give fewer folders")]
    TooManyFlights(usize),
    /// A picture cannot be read.
    #[error("not a picture: {cause}; remove it or fly again: {}", path.display())]
    Picture {
        /// What is wrong with it.
        cause: image::ImageError,
        /// The file.
        path: PathBuf,
    },
    /// A plot could not be drawn.
    #[error("cannot draw a plot: {0}")]
    Drawing(String),
}
