//! The chunks that a worker has read in, the same to any worker that decodes a finer one of the same part.
//!
//! Whoever draws owns the chunks; here only where they are is known, as long as they are held.

use std::sync::{Arc, Weak};

use parking_lot::Mutex;
use rustc_hash::FxHashMap;

use crate::container::{ChunkRow, Form};

/// Whether a chunk is stored as differences from coarser ones.
pub(super) fn is_compressed(row: &ChunkRow) -> bool {
    row.form() == Some(Form::Compressed)
}

/// Chunks by part and tier.
#[derive(Debug)]
pub(super) struct Known<T> {
    held: Mutex<Held<T>>,
}

#[derive(Debug)]
struct Held<T> {
    chunks: FxHashMap<(u32, u32), Weak<T>>,
    /// When there are so many, those that are held no more are forgotten.
    forget_at: usize,
}

impl<T> Default for Known<T> {
    fn default() -> Self {
        Self { held: Mutex::new(Held { chunks: FxHashMap::default(), forget_at: 64 }) }
    }
}

impl<T> Known<T> {
    /// A chunk, if it is still held.
    pub fn get(&self, place: (u32, u32)) -> Option<Arc<T>> {
        self.held.lock().chunks.get(&place).and_then(Weak::upgrade)
    }

    /// Notes where a chunk is.
    pub fn add(&self, place: (u32, u32), chunk: &Arc<T>) {
        let mut held = self.held.lock();
        held.chunks.insert(place, Arc::downgrade(chunk));
        if held.chunks.len() > held.forget_at {
            held.chunks.retain(|_, chunk| chunk.strong_count() > 0);
            held.forget_at = 2 * held.chunks.len() + 64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_known_as_long_as_somebody_holds_them() {
        let known = Known::default();
        let held = Arc::new(7);
        known.add((7, 1), &held);
        (100..1100).for_each(|part| known.add((part, 1), &Arc::new(part)));
        assert_eq!(known.get((7, 1)).as_deref(), Some(&7));
        assert_eq!(known.get((100, 1)), None);
        assert!(known.held.lock().chunks.len() < 200, "the others are forgotten");
        drop(held);
        assert_eq!(known.get((7, 1)), None);
    }
}
