//! Container bytes in memory: aligned, and with checksums that can be made right again after damage.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use collapsar::container::{Contents, Form, write};
use xxhash_rust::xxh3::xxh3_64;

/// Bytes that start at a multiple of 8.
#[derive(Clone)]
pub struct Aligned {
    words: Vec<u64>,
    len: usize,
}

impl Aligned {
    pub fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0u64; bytes.len().div_ceil(8)];
        bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self { words, len: bytes.len() }
    }

    pub fn get(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.len]
    }

    pub fn get_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.len]
    }

    pub fn set_u32(&mut self, offset: usize, value: u32) {
        self.get_mut()[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
    }

    pub fn set_u64(&mut self, offset: usize, value: u64) {
        self.get_mut()[offset..offset + 8].copy_from_slice(&value.to_le_bytes());
    }

    pub fn u32(&self, offset: usize) -> u32 {
        u32::from_le_bytes(self.get()[offset..offset + 4].try_into().unwrap())
    }

    pub fn u64(&self, offset: usize) -> u64 {
        u64::from_le_bytes(self.get()[offset..offset + 8].try_into().unwrap())
    }

    /// Where a section lies, by its index in the section table; `None` if it is not in the file.
    pub fn section(&self, index: usize) -> Option<Range<usize>> {
        let row = 64 + 32 * index;
        let start = usize::try_from(self.u64(row + 8)).ok()?;
        let bytes = usize::try_from(self.u64(row + 16)).ok()?.checked_mul(self.u32(row + 4) as usize)?;
        let range = start..start.checked_add(bytes)?;
        (range.end <= self.len).then_some(range)
    }

    /// Makes all checksums right that can be found, innermost first.
    pub fn repair(&mut self) {
        let len = self.len;
        let chunks = self.section(1).unwrap_or(0..0);
        for row in chunks.step_by(32).take_while(|row| row + 32 <= len) {
            let (start, bytes) = (self.u64(row), u64::from(self.u32(row + 8)));
            let end = start.checked_add(bytes).filter(|&end| end <= self.len as u64);
            if let Some(end) = end {
                self.set_u64(row + 24, xxh3_64(&self.get()[start as usize..end as usize]));
            }
        }
        for (index, range) in
            (0..8).filter_map(|index| self.section(index).map(|range| (index, range))).collect::<Vec<_>>()
        {
            self.set_u64(64 + 32 * index + 24, xxh3_64(&self.get()[range]));
        }
        self.set_u64(48, xxh3_64(&self.get()[64..320]));
        self.set_u64(56, xxh3_64(&self.get()[..56]));
    }
}

/// What the writer makes of contents, with chunks as they are in memory.
pub fn written(contents: &Contents) -> Aligned {
    written_as(contents, Form::Plain)
}

/// What the writer makes of contents.
pub fn written_as(contents: &Contents, form: Form) -> Aligned {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.clps");
    write(&path, contents, form, &AtomicBool::new(false)).unwrap();
    Aligned::new(&std::fs::read(path).unwrap())
}
