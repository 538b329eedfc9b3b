//! The `.clps` file: ordered parts, instances, the assembly tree and materials in; checked views of them out.
//!
//! [`write()`] puts [`Contents`] into a file; [`Container::open`] checks every table of one (never its payload) and gives
//! typed slices that lie in the file's own bytes; [`Container::chunks`] checks and gives the data of a tier and all coarser ones; [`verify()`]
//! checks everything that a file can show. The file is hostile until checked: no count or offset is used before it
//! was compared with what holds it. `docs/format.md` is the specification, [`format`](mod@format) the same as records.

use std::io;
use std::path::PathBuf;

mod assemble;
mod check;
mod check_groups;
mod chunk;
mod compress;
mod encode;
mod finding;
pub mod format;
mod groups;
mod reader;
pub(crate) mod spill;
mod splits;
mod stored;
mod verify;
mod writer;

pub(crate) use assemble::{Rows, assemble};
pub use chunk::{ChunkSpec, ChunkView};
pub(crate) use encode::EncodedPart;
pub use format::{ChunkRow, Form, GroupRow, InstanceRow, MAGIC, MaterialRow, NodeRow, PartRow, SectionKind};
pub use groups::Groups;
pub use reader::Container;
pub use stored::Chunk;
pub use verify::{MAX_FINDINGS, VerifyReport, inspect, verify};
pub use writer::{Contents, StoredInstance, StoredPart, Written, check_destination, write};
pub(crate) use writer::{Watch, named};

/// What may be wrong with a container, or with writing one.
///
/// The reader's errors carry no path, because it reads bytes; who opened the file adds it.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    /// The magic bytes are others.
    #[error("this is not a .clps container: it does not start with a container's magic bytes")]
    NotAContainer,
    /// The first magic bytes are right and the line ends among them are not.
    #[error("this container was damaged by a transfer in text mode: copy it again in binary mode")]
    TextMode,
    /// There are fewer bytes than the file says.
    #[error(
        "this container ends after {have} bytes and should have {need}: it was cut short; copy or bake it again"
    )]
    Truncated {
        /// The bytes that there are.
        have: u64,
        /// The least number of bytes that there should be.
        need: u64,
    },
    /// The system refuses to read.
    #[error("cannot read a part of the model: {cause}")]
    Read {
        /// The system's words.
        cause: io::Error,
    },
    /// The file ends earlier than when it was opened.
    #[error("this container was cut short while it was open: copy or bake it again")]
    CutShort,
    /// Another version of the format.
    #[error(
        "this file is format version {found}; this program reads version {}: bake the model again, or use a newer \
         program",
        format::VERSION
    )]
    Version {
        /// The version in the file.
        found: u32,
    },
    /// Bytes that are not those that were written.
    #[error("the checksum of {what} does not match: the container is damaged; copy or bake it again")]
    Checksum {
        /// Which bytes.
        what: String,
    },
    /// The checksums are right, but the content contradicts itself or the specification.
    #[error("{place}: {problem}: this container was not written as its format says; bake it again")]
    Malformed {
        /// The header, section, row or chunk.
        place: String,
        /// What is wrong there, with the numbers.
        problem: String,
    },
    /// The slice of bytes does not start at a multiple of 8.
    #[error(
        "the container's bytes must start at an address that is a multiple of 8: map the file into memory"
    )]
    Misaligned,
    /// A part or tier was asked for that does not exist.
    #[error("there is no part {part} with a tier {tier} in this container")]
    NoSuchChunk {
        /// The part's index.
        part: usize,
        /// The tier, 0 for the finest.
        tier: usize,
    },
    /// [`verify()`] found something.
    #[error("{} in this container, first: {}", counted(findings), findings.first().map_or("", String::as_str))]
    Invalid {
        /// What was found, one readable line each; at least one.
        findings: Vec<String>,
    },
    /// The contents given to the writer contradict themselves.
    #[error("cannot write a container: {place}: {problem}")]
    Contents {
        /// Which part or row.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// The output folder does not exist, or is a file.
    #[error("cannot write a container: its folder does not exist; create it first: {}", path.display())]
    NoFolder {
        /// The folder.
        path: PathBuf,
    },
    /// The output path names a folder.
    #[error("cannot write a container: the output is a folder; name a file in it: {}", path.display())]
    OutputIsFolder {
        /// The output path.
        path: PathBuf,
    },
    /// The system refused; nothing is left under the output's name that was not there before.
    #[error("cannot {doing}: {cause}: {}", path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// The system's words.
        cause: io::Error,
        /// The output path.
        path: PathBuf,
    },
    /// The writer was asked to stop; no file is left.
    #[error("interrupted: no container was written")]
    Interrupted,
}

impl ContainerError {
    /// What went wrong with a temporary file, told of the file that it was to become.
    pub(crate) fn of(self, path: &std::path::Path) -> Self {
        match self {
            Self::Io { doing, cause, .. } => Self::Io { doing, cause, path: path.to_owned() },
            other => other,
        }
    }
}

/// "1 finding", "7 findings", "100 findings or more".
fn counted(findings: &[String]) -> String {
    match findings.len() {
        1 => "1 finding".to_owned(),
        count if count >= MAX_FINDINGS => format!("{MAX_FINDINGS} findings or more"),
        count => format!("{count} findings"),
    }
}
