//! Chunks in any order in, on disk until their places in the payload are known, and the same chunks out.
//!
//! The payload has the coarsest tier of every part first, so a chunk's place depends on all parts. Chunks of one round of
//! the payload (counted from the coarsest tier) go to one file, in the order in which they come.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use parking_lot::Mutex;

use super::ContainerError;
use super::format::{ChunkRow, checksum};

/// The files of all rounds, open to be appended to from any thread.
pub(crate) struct Spill {
    folder: PathBuf,
    rounds: Mutex<Vec<std::sync::Arc<Mutex<Round>>>>,
}

struct Round {
    file: File,
    end: u64,
}

impl Spill {
    /// Takes on a folder with the files that it may have.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), rounds: Mutex::default() }
    }

    /// Appends the chunks of a part, finest first, whose bytes lie one after another; writes where each one lies in the
    /// file of its round into its row.
    ///
    /// # Errors
    /// What the system refuses; the disk may be full.
    pub fn append(&self, chunks: &mut [ChunkRow], bytes: &[u8]) -> Result<(), ContainerError> {
        let mut rest = bytes;
        let tiers = chunks.len();
        for (tier, row) in chunks.iter_mut().enumerate() {
            let (chunk, after) = rest.split_at(row.bytes as usize);
            rest = after;
            row.offset = self.append_one(tiers - 1 - tier, chunk)?;
        }
        Ok(())
    }

    fn append_one(&self, round: usize, chunk: &[u8]) -> Result<u64, ContainerError> {
        let file = self.round(round)?;
        let mut round_file = file.lock();
        let offset = round_file.end;
        round_file.file.write_all(chunk).map_err(|cause| self.refused("write", round, cause))?;
        round_file.end += chunk.len() as u64;
        Ok(offset)
    }

    fn round(&self, round: usize) -> Result<std::sync::Arc<Mutex<Round>>, ContainerError> {
        let mut rounds = self.rounds.lock();
        while rounds.len() <= round {
            let number = rounds.len();
            let open = File::options().create(true).append(true).open(path_of(&self.folder, number));
            let opened = open.and_then(|file| Ok(Round { end: file.metadata()?.len(), file }));
            let opened = opened.map_err(|cause| self.refused("write", number, cause))?;
            rounds.push(std::sync::Arc::new(Mutex::new(opened)));
        }
        Ok(std::sync::Arc::clone(&rounds[round]))
    }

    fn refused(&self, doing: &'static str, round: usize, cause: std::io::Error) -> ContainerError {
        refused(doing, &path_of(&self.folder, round), cause)
    }
}

fn path_of(folder: &Path, round: usize) -> PathBuf {
    folder.join(format!("round-{round}"))
}

fn refused(doing: &'static str, path: &Path, cause: std::io::Error) -> ContainerError {
    let doing = if doing == "write" { "keep a part of the model" } else { "read back a part of the model" };
    ContainerError::Io { doing, cause, path: path.to_owned() }
}

/// The same files, to be read.
pub(crate) struct SpillReader {
    folder: PathBuf,
    rounds: Vec<(BufReader<File>, u64)>,
}

impl SpillReader {
    /// Takes on a folder.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), rounds: Vec::new() }
    }

    /// Replaces `out` by the bytes of a chunk of a round.
    ///
    /// # Errors
    /// What the system refuses, and bytes that are not those that were written.
    pub fn read(&mut self, round: usize, row: &ChunkRow, out: &mut Vec<u8>) -> Result<(), ContainerError> {
        let path = path_of(&self.folder, round);
        let io = |cause| refused("read", &path, cause);
        while self.rounds.len() <= round {
            let file = File::open(path_of(&self.folder, self.rounds.len())).map_err(io)?;
            self.rounds.push((BufReader::with_capacity(1 << 18, file), 0));
        }
        let (file, at) = &mut self.rounds[round];
        // Seldom far, and then the buffer stays.
        match i64::try_from(row.offset).ok().zip(i64::try_from(*at).ok()) {
            Some((to, from)) => file.seek_relative(to - from).map_err(io)?,
            None => file.seek(SeekFrom::Start(row.offset)).map(drop).map_err(io)?,
        }
        *at = row.offset;
        out.resize(row.bytes as usize, 0);
        file.read_exact(out).map_err(io)?;
        *at += u64::from(row.bytes);
        if checksum(out) == row.checksum {
            return Ok(());
        }
        Err(ContainerError::Checksum { what: format!("a part of the model in {}", path.display()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(bytes: &[u8]) -> ChunkRow {
        ChunkRow { bytes: bytes.len() as u32, checksum: checksum(bytes), ..ChunkRow::default() }
    }

    #[test]
    fn chunks_come_back_in_any_order_and_after_another_start() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = [row(b"fine"), row(b"coarse")];
        Spill::new(folder.path()).append(&mut first, b"finecoarse").unwrap();
        let mut second = [row(b"only")];
        Spill::new(folder.path()).append(&mut second, b"only").unwrap();
        let mut reader = SpillReader::new(folder.path());
        let mut out = Vec::new();
        for (round, row, bytes) in
            [(0, second[0], &b"only"[..]), (1, first[0], b"fine"), (0, first[1], b"coarse")]
        {
            reader.read(round, &row, &mut out).unwrap();
            assert_eq!(out, bytes);
        }
        let other = ChunkRow { checksum: 0, ..first[0] };
        assert!(matches!(reader.read(1, &other, &mut out), Err(ContainerError::Checksum { .. })));
        assert!(matches!(reader.read(7, &other, &mut out), Err(ContainerError::Io { .. })));
    }
}
