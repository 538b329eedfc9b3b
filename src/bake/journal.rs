//! Bodies that are done in, a file that says so and survives the process out; and back.
//!
//! A record is written when the chunks of its body are on disk. Every record has a checksum; what follows the first that
//! does not match its own was being written when the process died, and is cut off.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};

use bytemuck::{Pod, Zeroable};
use xxhash_rust::xxh3::Xxh3;

use super::ledger::{BodyRows, Ledger, MeshRow};
use crate::container::{ChunkRow, PartRow, format};

/// The first bytes of a journal.
const MAGIC: [u8; 8] = *b"CLPSWORK";
/// No more rows of a kind are believed to be in one record.
const MOST_ROWS: u32 = 1 << 22;

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
struct Start {
    magic: [u8; 8],
    version: u64,
    /// Of the model, the options and the program.
    fingerprint: u64,
    bodies: u64,
    checksum: u64,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
struct RecordStart {
    body: u32,
    meshes: u32,
    parts: u32,
    chunks: u32,
    /// Of the four counts and the rows.
    checksum: u64,
}

/// What a journal is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct About {
    pub fingerprint: u64,
    pub bodies: u64,
}

impl Start {
    fn new(about: About) -> Self {
        let version = u64::from(format::VERSION);
        let mut start =
            Self { magic: MAGIC, version, fingerprint: about.fingerprint, bodies: about.bodies, checksum: 0 };
        start.checksum = format::checksum(bytemuck::bytes_of(&start));
        start
    }
}

/// What is at the start of a file that may be a journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing, or less than a whole start: the process died at once.
    Nothing,
    /// A journal of the bake at hand.
    Own,
    /// A journal of a bake of something else, or with other options, or by another version.
    Other,
    /// Something else.
    Foreign,
}

/// Looks at the start of a file.
///
/// # Errors
/// What the system refuses.
pub(super) fn find(mut file: &File, about: About) -> io::Result<Found> {
    let mut start = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(size_of::<Start>() as u64).read_to_end(&mut start)?;
    Ok(match start.get(..8) {
        None if MAGIC.starts_with(&start) => Found::Nothing,
        Some(magic) if magic == MAGIC && start.len() < size_of::<Start>() => Found::Nothing,
        Some(magic) if magic == MAGIC && start == bytemuck::bytes_of(&Start::new(about)) => Found::Own,
        Some(magic) if magic == MAGIC => Found::Other,
        _ => Found::Foreign,
    })
}

/// A journal that is being written.
pub(super) struct Journal {
    out: BufWriter<File>,
}

impl Journal {
    /// Starts a journal in an empty file.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn start(file: File, about: About) -> io::Result<Self> {
        file.set_len(0)?;
        let mut out = BufWriter::new(file);
        out.seek(SeekFrom::Start(0))?;
        out.write_all(bytemuck::bytes_of(&Start::new(about)))?;
        out.flush()?;
        Ok(Self { out })
    }

    /// Goes on with a journal of the bake at hand: what it says is done goes into the ledger, as far as `is_there`
    /// finds the chunks on disk.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn resume(
        mut file: File,
        ledger: &mut Ledger,
        is_there: impl Fn(&BodyRows) -> bool,
    ) -> io::Result<Self> {
        let mut end = size_of::<Start>() as u64;
        file.seek(SeekFrom::Start(end))?;
        let mut reader = BufReader::with_capacity(1 << 20, &file);
        while let Some((body, rows, bytes)) = read_record(&mut reader)? {
            if body >= ledger.body_count() || !is_there(&rows) {
                break;
            }
            if !ledger.is_done(body) {
                ledger.push(body, &rows);
            }
            end += bytes;
        }
        file.set_len(end)?;
        file.seek(SeekFrom::Start(end))?;
        Ok(Self { out: BufWriter::new(file) })
    }

    /// Notes a body that is done.
    ///
    /// # Errors
    /// What the system refuses; the disk may be full.
    pub fn note(&mut self, body: usize, rows: &BodyRows) -> io::Result<()> {
        let mut start = RecordStart {
            body: body as u32,
            meshes: rows.meshes.len() as u32,
            parts: rows.parts.len() as u32,
            chunks: rows.chunks.len() as u32,
            checksum: 0,
        };
        start.checksum = checksum(&start, rows);
        self.out.write_all(bytemuck::bytes_of(&start))?;
        rows_of(rows).into_iter().try_for_each(|bytes| self.out.write_all(bytes))
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn rows_of(rows: &BodyRows) -> [&[u8]; 3] {
    [
        bytemuck::cast_slice(&rows.meshes),
        bytemuck::cast_slice(&rows.parts),
        bytemuck::cast_slice(&rows.chunks),
    ]
}

fn checksum(start: &RecordStart, rows: &BodyRows) -> u64 {
    let mut hash = Xxh3::new();
    hash.update(&bytemuck::bytes_of(start)[..16]);
    rows_of(rows).into_iter().for_each(|bytes| hash.update(bytes));
    hash.digest()
}

/// The next record, its body and its length; `None` at the end and at what is damaged.
fn read_record(reader: &mut impl Read) -> io::Result<Option<(usize, BodyRows, u64)>> {
    let mut start: [RecordStart; 1] = Zeroable::zeroed();
    if !fill(reader, &mut start)? {
        return Ok(None);
    }
    let [start] = start;
    if [start.meshes, start.parts, start.chunks].into_iter().any(|count| count > MOST_ROWS) {
        return Ok(None);
    }
    let meshes = read_rows::<MeshRow>(reader, start.meshes)?;
    let parts = read_rows::<PartRow>(reader, start.parts)?;
    let chunks = read_rows::<ChunkRow>(reader, start.chunks)?;
    let (Some(meshes), Some(parts), Some(chunks)) = (meshes, parts, chunks) else { return Ok(None) };
    let rows = BodyRows { meshes, parts, chunks };
    let bytes = size_of::<RecordStart>() + rows_of(&rows).map(<[u8]>::len).iter().sum::<usize>();
    let is_sound = checksum(&start, &rows) == start.checksum && rows.is_consistent();
    Ok(is_sound.then_some((start.body as usize, rows, bytes as u64)))
}

/// Reads rows a block at a time, so that a count that lies costs no memory.
fn read_rows<T: Pod>(reader: &mut impl Read, count: u32) -> io::Result<Option<Vec<T>>> {
    let mut rows: Vec<T> = Vec::new();
    while rows.len() < count as usize {
        let from = rows.len();
        rows.resize(from + (count as usize - from).min(4096), T::zeroed());
        if !fill(reader, &mut rows[from..])? {
            return Ok(None);
        }
    }
    Ok(Some(rows))
}

/// Fills rows; `false` if the file ends before.
fn fill<T: Pod>(reader: &mut impl Read, rows: &mut [T]) -> io::Result<bool> {
    match reader.read_exact(bytemuck::cast_slice_mut(rows)) {
        Ok(()) => Ok(true),
        Err(end) if end.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(other) => Err(other),
    }
}

#[cfg(test)]
mod tests {
    use super::super::welded::Welded;
    use super::*;

    const ABOUT: About = About { fingerprint: 7, bodies: 10 };

    fn rows(seed: u64) -> BodyRows {
        let part = PartRow { tier_count: 2, vertices: seed as u32, ..PartRow::default() };
        BodyRows {
            meshes: vec![MeshRow {
                cells: 1,
                welded: Welded { source_triangles: seed, ..Welded::default() },
            }],
            parts: vec![part],
            chunks: vec![ChunkRow { bytes: 5, ..ChunkRow::default() }; 2],
        }
    }

    fn journal_of(bodies: &[usize]) -> File {
        let file = tempfile::tempfile().unwrap();
        let mut journal = Journal::start(file.try_clone().unwrap(), ABOUT).unwrap();
        for &body in bodies {
            journal.note(body, &rows(body as u64)).unwrap();
        }
        journal.flush().unwrap();
        file
    }

    fn resumed(file: &File) -> Ledger {
        let mut ledger = Ledger::new(10);
        Journal::resume(file.try_clone().unwrap(), &mut ledger, |_| true).unwrap();
        ledger
    }

    #[test]
    fn what_was_noted_is_done_after_another_start() {
        let file = journal_of(&[3, 1, 7]);
        assert_eq!(find(&file, ABOUT).unwrap(), Found::Own);
        assert_eq!(find(&file, About { fingerprint: 8, ..ABOUT }).unwrap(), Found::Other);
        let ledger = resumed(&file);
        assert_eq!((0..10).filter(|&body| ledger.is_done(body)).collect::<Vec<_>>(), [1, 3, 7]);
        assert_eq!(ledger.parts(7)[0].vertices, 7);
    }

    /// Every way in which a process can die while it writes.
    #[test]
    fn every_prefix_of_a_journal_is_sound_as_far_as_it_goes() {
        let whole = journal_of(&[3, 1]);
        let length = whole.metadata().unwrap().len();
        let record = (length - size_of::<Start>() as u64) / 2;
        for end in 0..length {
            let file = journal_of(&[3, 1]);
            file.set_len(end).unwrap();
            if end < size_of::<Start>() as u64 {
                assert_eq!(find(&file, ABOUT).unwrap(), Found::Nothing);
                continue;
            }
            let done = (end - size_of::<Start>() as u64) / record;
            assert_eq!(resumed(&file).done() as u64, done, "cut at {end}");
            // And it can be written on.
            assert_eq!(file.metadata().unwrap().len(), size_of::<Start>() as u64 + done * record);
        }
    }

    #[test]
    fn a_record_with_a_bit_turned_and_all_after_it_are_done_again() {
        for at in [41, 60, 200, 300] {
            let mut file = journal_of(&[3, 1]);
            let mut bytes = Vec::new();
            file.seek(SeekFrom::Start(0)).unwrap();
            file.read_to_end(&mut bytes).unwrap();
            bytes[at] ^= 4;
            file.seek(SeekFrom::Start(0)).unwrap();
            file.write_all(&bytes).unwrap();
            assert_eq!(resumed(&file).done(), 0, "byte {at}");
        }
    }

    #[test]
    fn other_files_are_no_journals() {
        let mut file = tempfile::tempfile().unwrap();
        assert_eq!(find(&file, ABOUT).unwrap(), Found::Nothing);
        file.write_all(b"dear diary").unwrap();
        assert_eq!(find(&file, ABOUT).unwrap(), Found::Foreign);
    }
}
