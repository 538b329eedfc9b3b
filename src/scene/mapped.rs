//! A file's path in, its bytes as one slice out: the room with the project's only `unsafe`.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use memmap2::Mmap;

/// Why a file could not be mapped.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// No such file.
    #[error("there is no such file: {}", path.display())]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// A folder, pipe or device.
    #[error("this is not a file: {}", path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// A file of no bytes.
    #[error("this file is empty: {}", path.display())]
    Empty {
        /// The path.
        path: PathBuf,
    },
    /// The system refused.
    #[error("cannot read this file: {cause}: {}", path.display())]
    Io {
        /// The system's words.
        cause: io::Error,
        /// The path.
        path: PathBuf,
    },
}

impl MapError {
    fn of(cause: io::Error, path: &Path) -> Self {
        match cause.kind() {
            io::ErrorKind::NotFound => Self::Missing { path: path.to_owned() },
            _ => Self::Io { cause, path: path.to_owned() },
        }
    }
}

/// A file in the address space, read-only; its pages are read from disk when they are first touched.
#[derive(Debug)]
pub struct MappedFile {
    map: Mmap,
}

impl MappedFile {
    /// Maps a whole file.
    ///
    /// The file must not be changed or cut short while it is mapped. Our own writer never does: it replaces a file by
    /// renaming a new one over it, and the mapping keeps the old one.
    ///
    /// # Errors
    /// A path that is missing, not a file, or an empty file; anything that the system refuses.
    pub fn open(path: &Path) -> Result<Self, MapError> {
        let (file, _) = open_regular(path)?;
        map(&file).map(|map| Self { map }).map_err(|cause| MapError::of(cause, path))
    }

    /// The bytes of the file; they start at a multiple of the page size.
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// Gives back the memory of all pages that were touched; they are read again when they are touched again. Does
    /// nothing where the system cannot.
    pub fn release(&self) {
        #[cfg(unix)]
        // SAFETY: What this advice may destroy is data that is nowhere else: changes to private pages. The map is
        // read-only and of a file, so every page comes back from the file as it was; bytes that somebody holds a slice
        // of stay where they are, with the same content, under the conditions of `map` below.
        let advised = unsafe { self.map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
        // It is advice: if the system will not take it, the pages stay until it needs their memory.
        #[cfg(unix)]
        drop(advised);
    }
}

/// Opens a file that is not empty, and says how many bytes it has.
pub(super) fn open_regular(path: &Path) -> Result<(File, u64), MapError> {
    let refused = |cause| MapError::of(cause, path);
    // Looked at by name first, because opening a pipe waits for its other end.
    if !std::fs::metadata(path).map_err(refused)?.is_file() {
        return Err(MapError::NotAFile { path: path.to_owned() });
    }
    let file = File::open(path).map_err(refused)?;
    match file.metadata().map_err(refused)?.len() {
        0 => Err(MapError::Empty { path: path.to_owned() }),
        bytes => Ok((file, bytes)),
    }
}

/// Maps an open, regular file, privately and read-only.
fn map(file: &File) -> io::Result<Mmap> {
    // SAFETY: The slice that the map derefs to is sound under these conditions.
    // - It is read-only and lives no longer than the map, which owns it; the map stays valid when the file is closed.
    // - Nobody changes the mapped bytes: this process opens containers only for reading, and writes one by renaming a
    //   complete file over the name, which leaves the mapped file as it is.
    // - Nobody cuts the file short: as above for this process. Another process that does so in spite of the contract
    //   of `MappedFile::open` ends this one with a bus error at the next access; no library can prevent that, and
    //   reading the file into memory instead is what a model larger than memory forbids.
    // - The bytes are plain data: every bit pattern is a valid `u8`, and what they say is checked by the container.
    unsafe { Mmap::map(file) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_back_as_its_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.clps");
        std::fs::write(&path, b"hello").unwrap();
        let file = MappedFile::open(&path).unwrap();
        let bytes = file.bytes();
        assert_eq!(bytes, b"hello");
        file.release();
        assert_eq!(bytes, b"hello");
    }

    #[test]
    fn what_is_no_file_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let [missing, empty] = ["missing", "empty"].map(|name| folder.path().join(name));
        std::fs::write(&empty, b"").unwrap();
        let message = |path: &Path| MappedFile::open(path).unwrap_err().to_string();
        assert_eq!(message(&missing), format!("there is no such file: {}", missing.display()));
        assert_eq!(message(&empty), format!("this file is empty: {}", empty.display()));
        assert_eq!(message(folder.path()), format!("this is not a file: {}", folder.path().display()));
    }
}
