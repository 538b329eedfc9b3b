//! The folder beside the output in which a bake keeps what is done until the container is complete.
//!
//! `OUT.clps.bake` holds the journal, the chunks by round, and at the end the container before it gets its name. It is
//! locked while a bake is at work, deleted when the container is there, and left behind by one that was stopped, for
//! `--resume`.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use parking_lot::Mutex;

use super::BakeError;
use super::journal::{About, Found, Journal, find};
use super::ledger::{BodyRows, Ledger};
use crate::container::spill::{Spill, SpillReader};
use crate::container::{ContainerError, format};

const JOURNAL: &str = "journal";
const CONTAINER: &str = "container";
/// The journal is written to disk after so many bytes of chunks.
const FLUSH_AFTER: u64 = 1 << 22;

/// A work folder in use.
pub(super) struct Work {
    folder: PathBuf,
    spill: Spill,
    done: Mutex<Done>,
}

struct Done {
    ledger: Ledger,
    journal: Journal,
    unflushed: u64,
}

/// The folder in which a bake keeps what is done of an output; it is there while there is something to go on with.
pub fn folder_for(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".bake");
    output.with_file_name(name)
}

impl Work {
    /// Makes the folder, or takes over one that an earlier bake has left: with `resume` what it holds is kept, if it is
    /// of the same bake.
    ///
    /// # Errors
    /// A folder that is something else, or of another bake, or in use; what the system refuses.
    pub fn open(output: &Path, about: About, resume: bool) -> Result<Self, BakeError> {
        let folder = folder_for(output);
        let refused = |cause| refused("keep the work of a bake", &folder, cause);
        let journal = open_journal(&folder).map_err(refused)?;
        let Some(journal) = journal else { return Err(BakeError::NotAWorkFolder { path: folder }) };
        match journal.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(BakeError::Busy { path: folder }),
            Err(TryLockError::Error(cause)) => return Err(refused(cause)),
        }
        let mut ledger = Ledger::new(about.bodies as usize);
        let journal = match find(&journal, about).map_err(refused)? {
            Found::Foreign => return Err(BakeError::NotAWorkFolder { path: folder }),
            Found::Other if resume => return Err(BakeError::OtherWork { path: folder }),
            Found::Own if resume => {
                let rounds = round_lengths(&folder);
                Journal::resume(journal, &mut ledger, |rows| is_there(rows, &rounds)).map_err(refused)?
            }
            _ => {
                remove_results(&folder).map_err(refused)?;
                Journal::start(journal, about).map_err(refused)?
            }
        };
        let done = Mutex::new(Done { ledger, journal, unflushed: 0 });
        Ok(Self { spill: Spill::new(&folder), folder, done })
    }

    /// Whether a body is done.
    pub fn is_done(&self, body: usize) -> bool {
        self.done.lock().ledger.is_done(body)
    }

    /// How many bodies are done.
    pub fn done(&self) -> usize {
        self.done.lock().ledger.done()
    }

    /// Keeps a body that is done: the chunks of its parts, one part's bytes after another's, then its rows.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn keep(&self, body: usize, mut rows: BodyRows, bytes: &[Vec<u8>]) -> Result<(), BakeError> {
        let mut first = 0;
        for (part, bytes) in rows.parts.iter().zip(bytes) {
            let chunks = first..first + part.tier_count as usize;
            first = chunks.end;
            self.spill.append(&mut rows.chunks[chunks], bytes)?;
        }
        let mut done = self.done.lock();
        let note = done.journal.note(body, &rows);
        note.map_err(|cause| refused("keep the work of a bake", &self.folder, cause))?;
        done.ledger.push(body, &rows);
        done.unflushed += bytes.iter().map(|bytes| bytes.len() as u64).sum::<u64>();
        if done.unflushed > FLUSH_AFTER {
            flush(&mut done, &self.folder)?;
        }
        Ok(())
    }

    /// Writes what is still in memory of the journal.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn flush(&self) -> Result<(), BakeError> {
        flush(&mut self.done.lock(), &self.folder)
    }

    /// What is done, taken out for the end of the bake; and the chunks.
    pub fn finish(&self) -> (Ledger, SpillReader) {
        let ledger = std::mem::take(&mut self.done.lock().ledger);
        (ledger, SpillReader::new(&self.folder))
    }

    /// A new file for the container, in the folder, and its path.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn container(&self) -> Result<(File, PathBuf), BakeError> {
        let path = self.folder.join(CONTAINER);
        let file = File::options().create(true).write(true).read(true).truncate(true).open(&path);
        let file = file.map_err(|cause| refused("write the container", &path, cause))?;
        Ok((file, path))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Deletes everything that a bake has put there. What cannot be deleted stays: the container is not worse for it.
    pub fn remove(self) {
        let _ = remove_results(&self.folder);
        let _ = std::fs::remove_file(self.folder.join(JOURNAL));
        let _ = std::fs::remove_dir(&self.folder);
    }
}

fn flush(done: &mut Done, folder: &Path) -> Result<(), BakeError> {
    done.unflushed = 0;
    done.journal.flush().map_err(|cause| refused("keep the work of a bake", folder, cause))
}

fn refused(doing: &'static str, path: &Path, cause: io::Error) -> BakeError {
    ContainerError::Io { doing, cause, path: path.to_owned() }.into()
}

/// Opens or makes the journal, and the folder if there is none; `None` if the folder is there without one.
fn open_journal(folder: &Path) -> io::Result<Option<File>> {
    let is_new = match std::fs::create_dir(folder) {
        Ok(()) => true,
        Err(exists) if exists.kind() == io::ErrorKind::AlreadyExists => false,
        Err(other) => return Err(other),
    };
    let path = folder.join(JOURNAL);
    let is_empty = || std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if !is_new && !path.is_file() && !is_empty() {
        return Ok(None);
    }
    File::options().create(true).read(true).write(true).truncate(false).open(path).map(Some)
}

/// Deletes the rounds and the container.
fn remove_results(folder: &Path) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name == CONTAINER || name.starts_with("round-") {
            std::fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// The lengths of the files of all rounds.
fn round_lengths(folder: &Path) -> Vec<u64> {
    let length = |round| std::fs::metadata(folder.join(format!("round-{round}"))).ok().map(|file| file.len());
    (0..).map_while(length).collect()
}

/// Whether all chunks of a body lie within the files.
fn is_there(rows: &BodyRows, rounds: &[u64]) -> bool {
    let mut chunks = rows.chunks.iter();
    rows.parts.iter().all(|part| {
        (0..part.tier_count).rev().all(|round| {
            let end = chunks.next().and_then(|chunk| chunk.offset.checked_add(chunk.bytes.into()));
            end.zip(rounds.get(round as usize)).is_some_and(|(end, &length)| end <= length)
        })
    })
}

/// Counts the layouts that the rows of a journal have had: what a build keeps is of no use to one with another layout.
const ROWS: u32 = 2;

/// What every journal of a bake of this model with these options begins with.
pub(super) fn about(bodies: usize, fingerprint: u64, options: &str) -> About {
    let text = format!("{} {ROWS} {fingerprint:016x} {options}", env!("CARGO_PKG_VERSION"));
    About { fingerprint: format::checksum(text.as_bytes()), bodies: bodies as u64 }
}
