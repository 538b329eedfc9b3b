//! `triangles_at[vn]`: how many triangles are left when `vn` vertices are left, in one byte a vertex.
//!
//! A vertex is *added* by going from `vn` to `vn + 1`. A position with several attribute sets collapses as one group of
//! vertices, and only counts between groups are *states* (they may be selected); the byte of every vertex of a group
//! but its last is [`CONTINUES`]. Prefix sums are sampled every 64 vertices, so that a look-up is short.

/// The byte of a vertex after which the group goes on: the count after it is not a state.
pub const CONTINUES: u8 = 255;
/// The byte of a vertex that adds 254 triangles or more; the number is in the overflow list.
pub const OVERFLOWS: u8 = 254;

const STRIDE: usize = 64;

/// Triangles per vertex count of a part, or of the prefix of it that has been read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TrianglesAt {
    added: Vec<u8>,
    overflow: Vec<(u32, u32)>,
    sampled: Vec<u32>,
}

impl TrianglesAt {
    /// From the number of triangles that each vertex adds, `None` where the group goes on.
    pub fn from_added(added: impl IntoIterator<Item = Option<u32>>) -> Self {
        let mut bytes = Vec::new();
        let mut overflow = Vec::new();
        for (vertex, count) in added.into_iter().enumerate() {
            bytes.push(match count {
                None => CONTINUES,
                Some(n) if n >= u32::from(OVERFLOWS) => {
                    overflow.push((vertex as u32, n));
                    OVERFLOWS
                }
                Some(n) => n as u8,
            });
        }
        Self::from_parts(bytes, overflow)
    }

    /// From the stored bytes and the overflow list, which is sorted by vertex and has one entry for each byte
    /// [`OVERFLOWS`]; entries that are missing count as no triangles.
    pub fn from_parts(added: Vec<u8>, overflow: Vec<(u32, u32)>) -> Self {
        let mut this = Self { added: Vec::new(), overflow: Vec::new(), sampled: vec![0] };
        this.extend(&added, &overflow);
        this
    }

    /// Appends the vertices that the next finer tier adds; overflow vertices are numbered in the whole part.
    pub fn extend(&mut self, added: &[u8], overflow: &[(u32, u32)]) {
        if self.sampled.is_empty() {
            self.sampled.push(0);
        }
        self.overflow.extend_from_slice(overflow);
        self.added.reserve_exact(added.len());
        let mut total = self.count_at(self.added.len());
        for &byte in added {
            let vertex = self.added.len();
            self.added.push(byte);
            total = total.saturating_add(self.added_by(vertex));
            if (vertex + 1).is_multiple_of(STRIDE) {
                self.sampled.push(total);
            }
        }
    }

    /// Forgets all vertices but the first `count`.
    pub fn truncate(&mut self, count: usize) {
        self.added.truncate(count);
        self.sampled.truncate(self.added.len() / STRIDE + 1);
        let known = self.overflow.partition_point(|entry| (entry.0 as usize) < count);
        self.overflow.truncate(known);
        self.added.shrink_to_fit();
    }

    /// How many vertices are known.
    pub fn len(&self) -> usize {
        self.added.len()
    }

    /// Whether no vertex is known.
    pub fn is_empty(&self) -> bool {
        self.added.is_empty()
    }

    /// The bytes, one a vertex.
    pub fn bytes(&self) -> &[u8] {
        &self.added
    }

    /// The overflow list: vertex, triangles that it adds.
    pub fn overflow(&self) -> &[(u32, u32)] {
        &self.overflow
    }

    fn added_by(&self, vertex: usize) -> u32 {
        match self.added[vertex] {
            CONTINUES => 0,
            OVERFLOWS => self
                .overflow
                .binary_search_by_key(&(vertex as u32), |entry| entry.0)
                .map_or(0, |found| self.overflow[found].1),
            count => u32::from(count),
        }
    }

    /// How many triangles are left at `vn` vertices (`vn <= len()`).
    pub fn count_at(&self, vn: usize) -> u32 {
        let from = vn / STRIDE;
        let start = self.sampled[from];
        (from * STRIDE..vn).fold(start, |sum, vertex| sum.saturating_add(self.added_by(vertex)))
    }

    /// Whether `vn` is a state, a count that may be selected. Zero is one.
    pub fn is_state(&self, vn: usize) -> bool {
        vn == 0 || self.added[vn - 1] != CONTINUES
    }

    /// The greatest state that is at most `vn`.
    pub fn state_at_most(&self, vn: usize) -> usize {
        (0..=vn.min(self.len())).rev().find(|&count| self.is_state(count)).unwrap_or(0)
    }

    /// The least state that is at least `vn`, or `None` if no known one is.
    pub fn state_at_least(&self, vn: usize) -> Option<usize> {
        (vn..=self.len()).find(|&count| self.is_state(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_states_follow_the_groups() {
        let at = TrianglesAt::from_added([Some(0), Some(0), Some(1), None, Some(4), Some(300)]);
        assert_eq!((0..=6).map(|vn| at.count_at(vn)).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 5, 305]);
        assert!(!at.is_state(4));
        assert_eq!(at.state_at_most(4), 3);
        assert_eq!(at.state_at_least(4), Some(5));
        assert_eq!(at.overflow(), [(5, 300)]);
    }

    #[test]
    fn extending_by_tiers_equals_reading_whole() {
        let bytes: Vec<u8> =
            (0..1000u32).map(|v| if v % 7 == 3 { CONTINUES } else { (v % 5) as u8 }).collect();
        let whole = TrianglesAt::from_parts(bytes.clone(), vec![]);
        let mut by_tiers = TrianglesAt::from_parts(bytes[..63].to_vec(), vec![]);
        by_tiers.extend(&bytes[63..640], &[]);
        by_tiers.extend(&bytes[640..], &[]);
        assert_eq!(whole, by_tiers);
        let naive: u32 = bytes[..777].iter().filter(|&&b| b != CONTINUES).map(|&b| u32::from(b)).sum();
        assert_eq!(whole.count_at(777), naive);
    }
}
