//! A path in, the bytes of the model out, unpacked on the way if they are packed.
//!
//! What a name says counts: `x.obj` is plain, `x.obj.zst` and `x.obj.gz` are packed. Packed bytes are unpacked as
//! they are read, with a bounded window, and up to a limit, so that a small file cannot stand for more than the
//! memory holds.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Problem;
use crate::scene::mapped::{MapError, MappedFile};

/// The extensions of packed files, in lower case; the model's own comes before.
pub const PACKED_EXTENSIONS: [&str; 2] = ["zst", "gz"];

/// The largest window of zstd data: 2 to this many bytes, 128 MiB.
const WINDOW_LOG: u32 = 27;

/// What any packed file may unpack to, however little memory there seems to be.
const ALWAYS: u64 = 64 << 20;

/// What a packed file may unpack to, however small it is.
const ALWAYS_BY_RATIO: u64 = 256 << 20;

/// How many times its size a larger file may unpack to.
const RATIO: u64 = 1000;

/// The share of the memory at hand that a file may unpack to: what is made of it takes more than it.
const MEMORY_SHARE: u64 = 4;

/// The memory that is assumed where the system does not tell.
const USUAL_MEMORY: u64 = 16 << 30;

const BUFFER_BYTES: usize = 1 << 16;

/// A file that is to be read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Input<'a> {
    /// Where it is.
    pub path: &'a Path,
    packing: Option<Packing>,
    /// Ends reading once it is set.
    stop: &'a Arc<AtomicBool>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packing {
    Zstd,
    Gzip,
}

impl Packing {
    fn word(self) -> &'static str {
        match self {
            Self::Zstd => "zstd",
            Self::Gzip => "gzip",
        }
    }
}

/// The model's extension in lower case, empty if there is none, and how the file is packed.
fn parts_of(path: &Path) -> (String, Option<Packing>) {
    let lower =
        |path: &Path| path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let packing = match lower(path).as_str() {
        "zst" => Packing::Zstd,
        "gz" => Packing::Gzip,
        own => return (own.to_owned(), None),
    };
    (path.file_stem().map(|stem| lower(Path::new(stem))).unwrap_or_default(), Some(packing))
}

/// The model's extension in lower case, without that of a packing; empty if there is none.
pub(super) fn extension_of(path: &Path) -> String {
    parts_of(path).0
}

/// The file's name without folder and extensions.
pub(super) fn stem_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let stem =
        if parts_of(path).1.is_some() { Path::new(stem).file_stem().unwrap_or_default() } else { stem };
    stem.to_string_lossy().into_owned()
}

impl<'a> Input<'a> {
    /// The file at a path, after the checks that all formats share.
    ///
    /// # Errors
    ///
    /// [`Problem::Read`], [`Problem::NotAFile`] or [`Problem::Empty`].
    pub fn new(path: &'a Path, stop: &'a Arc<AtomicBool>) -> Result<Self, Problem> {
        let metadata = fs::metadata(path).map_err(Problem::Read)?;
        if !metadata.is_file() {
            return Err(Problem::NotAFile);
        }
        let packing = parts_of(path).1;
        if metadata.len() == 0 { Err(Problem::Empty) } else { Ok(Self { path, packing, stop }) }
    }

    /// The unpacked bytes from the beginning. Their errors become the right [`Problem`] by its `From`.
    ///
    /// # Errors
    ///
    /// [`Problem::Read`] if the file cannot be opened.
    pub fn open(&self) -> Result<Box<dyn BufRead>, Problem> {
        let file = File::open(self.path)?;
        let packed_bytes = file.metadata()?.len();
        let file = BufReader::with_capacity(BUFFER_BYTES, Stoppable { file, stop: Arc::clone(self.stop) });
        let Some(packing) = self.packing else { return Ok(Box::new(file)) };
        let decoder: Box<dyn Read> = match packing {
            Packing::Zstd => {
                let mut decoder = zstd::stream::read::Decoder::with_buffer(file)?;
                decoder.window_log_max(WINDOW_LOG)?;
                Box::new(decoder)
            }
            Packing::Gzip => Box::new(flate2::bufread::MultiGzDecoder::new(file)),
        };
        let limit = Limit::of(packed_bytes, memory_at_hand());
        let unpacked = Unpacked { decoder, packing, left: limit.bytes, limit };
        Ok(Box::new(BufReader::with_capacity(BUFFER_BYTES, unpacked)))
    }

    /// All bytes at once: of a plain file its pages as they are used, of a packed one in memory.
    ///
    /// # Errors
    ///
    /// [`Problem::Read`] and [`Problem::Packed`].
    pub fn bytes(&self) -> Result<Bytes, Problem> {
        if self.packing.is_none() {
            return Bytes::mapped(self.path);
        }
        let mut bytes = Vec::new();
        self.open()?.read_to_end(&mut bytes)?;
        Ok(Bytes::Held(bytes))
    }

    /// How many bytes there are, unpacked; reads a packed file to its end.
    ///
    /// # Errors
    ///
    /// [`Problem::Read`] and [`Problem::Packed`].
    pub fn length(&self) -> Result<u64, Problem> {
        match self.packing {
            None => Ok(fs::metadata(self.path)?.len()),
            Some(_) => Ok(io::copy(&mut self.open()?, &mut io::sink())?),
        }
    }
}

/// The bytes of a file.
#[derive(Debug)]
pub(super) enum Bytes {
    /// In memory.
    Held(Vec<u8>),
    /// In the address space; the system may take their memory back at any time.
    Mapped(MappedFile),
}

impl Bytes {
    /// Those of a plain file.
    ///
    /// # Errors
    ///
    /// [`Problem::Read`] or [`Problem::NotAFile`].
    pub fn mapped(path: &Path) -> Result<Self, Problem> {
        match MappedFile::open(path) {
            Ok(file) => Ok(Self::Mapped(file)),
            // There is nothing to map.
            Err(MapError::Empty { .. }) => Ok(Self::Held(Vec::new())),
            Err(MapError::Missing { .. }) => Err(Problem::Read(io::ErrorKind::NotFound.into())),
            Err(MapError::NotAFile { .. }) => Err(Problem::NotAFile),
            Err(MapError::Io { cause, .. }) => Err(Problem::Read(cause)),
        }
    }

    /// Gives back the memory of what was read so far and can be read again.
    pub fn release(&self) {
        if let Self::Mapped(file) = self {
            file.release();
        }
    }

    /// Bytes of memory that it takes.
    pub fn held(&self) -> u64 {
        match self {
            Self::Held(bytes) => bytes.len() as u64,
            Self::Mapped(_) => 0,
        }
    }
}

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Held(bytes) => bytes,
            Self::Mapped(file) => file.bytes(),
        }
    }
}

/// How much a packed file may hold, and why not more.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    /// So many unpacked bytes.
    pub bytes: u64,
    why: &'static str,
}

impl Limit {
    /// The limit of that many packed bytes, where there is that much memory.
    pub fn of(packed_bytes: u64, memory_bytes: u64) -> Self {
        let by_memory =
            Self { bytes: (memory_bytes / MEMORY_SHARE).max(ALWAYS), why: "a quarter of the memory at hand" };
        let by_ratio = Self {
            bytes: packed_bytes.saturating_mul(RATIO).max(ALWAYS_BY_RATIO),
            why: "more than any model so small",
        };
        if by_memory.bytes <= by_ratio.bytes { by_memory } else { by_ratio }
    }
}

/// A file that ends in [`Problem::Interrupted`] once the flag is set.
struct Stoppable {
    file: File,
    stop: Arc<AtomicBool>,
}

impl Read for Stoppable {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(io::Error::other(Problem::Interrupted));
        }
        self.file.read(buffer)
    }
}

/// Bytes as they are unpacked, up to the limit.
struct Unpacked<R> {
    decoder: R,
    packing: Packing,
    left: u64,
    limit: Limit,
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.decoder.read(buffer).map_err(|error| {
            let is_our_own = error.get_ref().is_some_and(|inner| inner.is::<Problem>());
            if is_our_own || error.kind() == io::ErrorKind::Interrupted {
                return error;
            }
            let what = format!("the {} data are damaged, cut short or none ({error})", self.packing.word());
            io::Error::other(Problem::Packed(what))
        })?;
        self.left = self.left.checked_sub(read as u64).ok_or_else(|| {
            let Limit { bytes, why } = self.limit;
            let what = format!(
                "it unpacks to more than {} MiB, {why}; unpack it to read it all the same",
                bytes >> 20
            );
            io::Error::other(Problem::Packed(what))
        })?;
        Ok(read)
    }
}

/// The bytes of memory that can be had without harm.
pub(crate) fn memory_at_hand() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let available = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kilobytes = available.and_then(|rest| rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kilobytes.map_or(USUAL_MEMORY, |kilobytes| kilobytes.saturating_mul(1024))
}

/// The longest line of a text: no statement of any format needs more, and what has no lines is no text.
pub(super) const MAX_LINE_BYTES: usize = 64 << 20;

/// Appends the next line to `line`, with its end; `false` at the end of the text.
///
/// # Errors
///
/// Those of `input`, and that the line, with what was in `line` before, is longer than [`MAX_LINE_BYTES`].
pub(super) fn read_line<R: BufRead + ?Sized>(input: &mut R, line: &mut Vec<u8>) -> io::Result<bool> {
    let room = MAX_LINE_BYTES.saturating_sub(line.len());
    let read = Read::take(&mut *input, room as u64).read_until(b'\n', line)?;
    if read == room && line.last() != Some(&b'\n') {
        let what = format!("a line is longer than {} MiB, so this is no text", MAX_LINE_BYTES >> 20);
        return Err(io::Error::other(Problem::Malformed(what)));
    }
    Ok(read > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_format_and_packing() {
        for (name, extension, stem) in [
            ("a/B.GLB", "glb", "B"),
            ("a/b.obj.zst", "obj", "b"),
            ("b.x.Ply.GZ", "ply", "b.x"),
            ("b.zst", "", "b"),
            ("b", "", "b"),
            (".zst", "", ".zst"),
        ] {
            assert_eq!(
                (extension_of(Path::new(name)).as_str(), stem_of(Path::new(name)).as_str()),
                (extension, stem)
            );
        }
    }

    #[test]
    fn the_limit_is_the_lesser_of_memory_and_ratio() {
        const GIB: u64 = 1 << 30;
        assert_eq!(Limit::of(1, 64 * GIB).bytes, ALWAYS_BY_RATIO);
        assert_eq!(Limit::of(10 << 20, 64 * GIB).bytes, 10_000 << 20);
        assert_eq!(Limit::of(1 << 40, 64 * GIB).bytes, 16 * GIB);
        assert_eq!(Limit::of(1 << 40, 0).bytes, ALWAYS);
    }

    #[test]
    fn what_unpacks_beyond_the_limit_is_an_error() {
        let limit = Limit { bytes: 10, why: "ten" };
        let read = |length: usize| {
            let mut unpacked = Unpacked {
                decoder: io::repeat(0).take(length as u64),
                packing: Packing::Gzip,
                left: 10,
                limit,
            };
            unpacked.read_to_end(&mut Vec::new()).map_err(|error| Problem::from(error).to_string())
        };
        assert_eq!(read(10).unwrap(), 10);
        assert!(read(11).unwrap_err().contains("unpacks to more than 0 MiB, ten"));
    }

    #[test]
    fn a_text_without_lines_is_refused_before_it_fills_the_memory() {
        let mut line = b"before".to_vec();
        let error = read_line(&mut BufReader::new(io::repeat(b'x')), &mut line).unwrap_err();
        assert!(Problem::from(error).to_string().contains("a line is longer than 64 MiB"));
        assert_eq!(line.len(), MAX_LINE_BYTES);
        line.clear();
        assert!(read_line(&mut &b"a\nb"[..], &mut line).unwrap());
        assert_eq!(line, b"a\n");
    }

    #[test]
    fn the_memory_at_hand_is_plausible() {
        assert!((1 << 20..1 << 50).contains(&memory_at_hand()));
    }
}
