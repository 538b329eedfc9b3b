//! A container's path in, ranges of its bytes out, read where they are asked for.
//!
//! Nothing of the file is mapped: a page that is not in memory is waited for by the thread that reads, never by one that
//! draws, and a file that is cut short or replaced while it is open is an error and not a signal.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::mapped::{MapError, open_regular};

/// An open file that many threads may read at once.
#[derive(Debug)]
pub struct PayloadFile {
    file: File,
    bytes: u64,
    path: PathBuf,
}

impl PayloadFile {
    /// Opens a file.
    ///
    /// # Errors
    /// A path that is missing, not a file, or an empty file; anything that the system refuses.
    pub fn open(path: &Path) -> Result<Self, MapError> {
        let (file, bytes) = open_regular(path)?;
        Ok(Self { file, bytes, path: path.to_owned() })
    }

    /// Its length when it was opened.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Fills a buffer with the bytes from an offset on; may wait for the disk.
    ///
    /// # Errors
    /// [`io::ErrorKind::UnexpectedEof`] if the file has become shorter; what the system refuses.
    pub fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        read_exact_at(&self.file, buffer, offset)
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut buffer: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, buffer, offset)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            read => {
                buffer = &mut buffer[read..];
                offset += read as u64;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_becomes_shorter_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"hello world").unwrap();
        let file = PayloadFile::open(&path).unwrap();
        let mut five = [0; 5];
        file.read_at(&mut five, 6).unwrap();
        assert_eq!(&five, b"world");
        File::options().write(true).open(&path).unwrap().set_len(8).unwrap();
        assert_eq!(file.read_at(&mut five, 6).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
