//! Files that appear whole or not at all, and folders for them.

use std::fmt::Display;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use collapsar::container::MAGIC;
use collapsar::whole_file::{self, folder_of};
use serde::Serialize;

use super::{Failure, interrupt};

/// Says early what would stop [`make_folder`] late: a file of that name, or a parent that does not exist.
pub fn check_folder(folder: &Path) -> Result<(), Failure> {
    if folder.is_dir() {
        return Ok(());
    }
    let parent = folder_of(folder);
    if folder.exists() {
        Err(Failure::Argument(format!("the output folder is a file: {}", folder.display())))
    } else if parent.is_dir() {
        Ok(())
    } else {
        let parent = parent.display();
        Err(Failure::Argument(format!(
            "the output folder's own folder does not exist; create it first: {parent}"
        )))
    }
}

/// Makes the output folder if its parent exists.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    check_folder(folder)?;
    if folder.is_dir() {
        return Ok(());
    }
    std::fs::create_dir(folder).map_err(|cause| Failure::Output {
        doing: "make the output folder",
        cause,
        path: folder.to_owned(),
    })
}

/// Says early what would stop [`write_whole`] late: a folder of that name, or no folder to write to.
pub fn check_file(path: &Path) -> Result<(), Failure> {
    let folder = folder_of(path);
    if path.is_dir() {
        let path = path.display();
        Err(Failure::Argument(format!("cannot write: the output is a folder; name a file in it: {path}")))
    } else if folder.is_dir() {
        Ok(())
    } else {
        let folder = folder.display();
        Err(Failure::Argument(format!("cannot write: its folder does not exist; create it first: {folder}")))
    }
}

/// The extension of a path, in lower case; empty if it has none.
pub fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// What is written, as far as replacing an older file goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Container,
    BakeReport,
    Glb,
    Obj,
}

/// So much of the text of a GLB file is searched for who wrote it.
const MOST_SEARCHED: u64 = 16 << 20;

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Container => "container",
            Self::BakeReport => "report",
            Self::Glb => "GLB file of collapsar",
            Self::Obj => "OBJ file of collapsar",
        }
    }

    /// Whether the program may have written this file, or nobody wrote anything.
    fn is_own(self, file: &mut File) -> std::io::Result<bool> {
        let starts: &[&[u8]] = match self {
            Self::Container => &[MAGIC.as_slice()],
            Self::BakeReport => &[b"{\n  \"parts\": "],
            Self::Glb => &[b"glTF"],
            Self::Obj => &[b"# written by collapsar", b"# collapsar synth"],
        };
        let mut start = Vec::new();
        file.take(32).read_to_end(&mut start)?;
        Ok(start.is_empty()
            || starts.iter().any(|own| start.starts_with(own)) && (self != Self::Glb || is_own_glb(file)?))
    }
}

/// Whether the text of a GLB file, behind its start, names the program.
fn is_own_glb(file: &mut File) -> std::io::Result<bool> {
    let mut text = Vec::new();
    file.take(MOST_SEARCHED).read_to_end(&mut text)?;
    let own = br#""generator":"collapsar"#;
    Ok(text.windows(own.len()).any(|words| words == own))
}

/// That a slip of the keyboard does not replace a model, or a file that belongs to one, by something of ours.
pub fn check_kind(kind: Kind, inputs: &[PathBuf], output: &Path) -> Result<(), Failure> {
    let Ok(existing) = output.canonicalize() else { return Ok(()) };
    let what = kind.name();
    if let Some(input) = inputs.iter().find(|i| i.canonicalize().is_ok_and(|input| input == existing)) {
        let input = input.display();
        return Err(Failure::Argument(format!(
            "the {what} would replace this input; choose another output: {input}"
        )));
    }
    // What cannot be read is the writer's to refuse.
    let is_own = !existing.is_file()
        || File::open(&existing).and_then(|mut file| kind.is_own(&mut file)).unwrap_or(true);
    if !is_own {
        return Err(Failure::Argument(format!(
            "the {what} would replace a file that is not a {what}; choose another output or remove it: {}",
            output.display()
        )));
    }
    Ok(())
}

/// Writes a file through a temporary one beside it, so that it is never half there; Ctrl-C stops it.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Failure> {
    // From before the file exists, so that no signal finds it without a handler.
    let interrupted = interrupt::flag();
    let failed = |cause| match interrupted.load(Ordering::Relaxed) {
        true => Failure::Interrupted("this file was not written"),
        false => Failure::Output { doing: "write", cause, path: path.to_owned() },
    };
    check_file(path)?;
    whole_file::write_whole(path, |file| {
        let mut out = std::io::BufWriter::with_capacity(1 << 16, Stoppable(file));
        write(&mut out)?;
        out.flush()
    })
    .map_err(failed)
}

/// A writer that fails once the user has asked to stop.
struct Stoppable<W>(W);

impl<W: Write> Write for Stoppable<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // Not `ErrorKind::Interrupted`, after which `write_all` tries again.
        if interrupt::flag().load(Ordering::Relaxed) {
            Err(ErrorKind::Other.into())
        } else {
            self.0.write(bytes)
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// Writes a value as indented JSON.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Failure> {
    write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

/// Prints a value as indented JSON.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    print_text(&serde_json::to_string_pretty(value).map_err(|error| Failure::Output {
        doing: "write JSON",
        cause: error.into(),
        path: PathBuf::from("standard output"),
    })?)
}

/// Prints text and a line feed. A reader that has closed the pipe has seen enough, which is no failure.
pub fn print_text(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout().lock(), "{text}") {
        Err(cause) if cause.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Output { doing: "write", cause, path: PathBuf::from("standard output") })
        }
        _ => Ok(()),
    }
}

/// Says something on standard error. Where nobody listens there is nothing left to say, so that the exit code tells.
pub fn complain(text: &impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
