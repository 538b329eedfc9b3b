//! What can be wrong with input files.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why no model could be read.
#[derive(Debug, Error)]
pub enum ImportError {
    /// The list of files is empty.
    #[error("no input file was given; name at least one .obj, .glb, .gltf, .ply or .stl file")]
    NoInput,
    /// A file is unusable.
    #[error("{problem}: {}", path.display())]
    File {
        /// What is wrong.
        problem: Problem,
        /// The file that was asked for, even where the problem is in one that it refers to.
        path: PathBuf,
    },
}

/// What is wrong with one file.
#[derive(Debug, Error)]
pub enum Problem {
    /// No importer is registered for the extension.
    #[error("unknown extension {extension:?}; known are {known}")]
    UnknownExtension {
        /// The extension in lower case, without a dot; empty if the file has none.
        extension: String,
        /// All that are known.
        known: String,
    },
    /// The file is missing or may not be read.
    #[error("cannot read the file ({0})")]
    Read(#[source] io::Error),
    /// The file is packed, and what is in it cannot be had.
    #[error("cannot unpack the file: {0}")]
    Packed(String),
    /// A folder or a device.
    #[error("this is not a file")]
    NotAFile,
    /// Zero bytes.
    #[error("the file is empty")]
    Empty,
    /// The file is text, and one line of it makes no sense.
    #[error("line {line}: {what}")]
    Line {
        /// The line, counted from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
    },
    /// The file breaks its format.
    #[error("{0}")]
    Malformed(String),
    /// The file cannot be understood without an extension that is not supported.
    #[error("requires {0}, which is not supported")]
    Extension(String),
    /// A file that this file refers to is missing or refused.
    #[error("refers to {reference}, {why}")]
    Reference {
        /// The reference as written, shortened and quoted.
        reference: String,
        /// Why it cannot be followed.
        why: String,
    },
    /// Whoever asked for the model no longer wants it.
    #[error("interrupted")]
    Interrupted,
    /// What does not fit the memory cannot be kept on disk.
    #[error(
        "cannot put a mesh away on the disk of the output, or read it back ({0}): make room there, or allow more memory"
    )]
    Shelve(#[source] io::Error),
    /// What a format cannot do without is more than the memory cap.
    #[error(
        "a cap of {cap_bytes} bytes of memory is too little: {what} about {need_bytes}; give --memory {}MiB or more",
        need_bytes.div_ceil(1 << 20)
    )]
    TooLittleMemory {
        /// The cap.
        cap_bytes: u64,
        /// The least that works.
        need_bytes: u64,
        /// What takes it, and how.
        what: &'static str,
    },
    /// More than the program's tables can hold.
    #[error("the model has too many {what}")]
    TooMany {
        /// Of what.
        what: &'static str,
    },
    /// Everything was read, but there is nothing to draw.
    #[error("no triangles{}", if notes.is_empty() { String::new() } else { format!(" ({notes})") })]
    NoTriangles {
        /// What was skipped.
        notes: String,
    },
}

impl From<io::Error> for Problem {
    /// The problem that the error carries, if a reader of this folder made it, else [`Problem::Read`].
    fn from(error: io::Error) -> Self {
        error.downcast().unwrap_or_else(Self::Read)
    }
}

impl Problem {
    /// The error of a file with this problem.
    pub(super) fn at(self, path: &Path) -> ImportError {
        ImportError::File { problem: self, path: path.to_owned() }
    }
}
