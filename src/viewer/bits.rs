//! Sets of small numbers, a bit each, and how many of a set lie in a range.

use std::ops::Range;

/// A set of numbers below a limit that is fixed when it is made.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Bits {
    /// Bits beyond the limit are never set.
    words: Vec<u64>,
    limit: u32,
}

impl Bits {
    /// The empty set of numbers below `limit`.
    pub fn new(limit: u32) -> Self {
        Self { words: vec![0; limit.div_ceil(64) as usize], limit }
    }

    /// The set of all numbers below `limit` in the ranges.
    pub fn of(limit: u32, ranges: impl IntoIterator<Item = Range<u32>>) -> Self {
        let mut bits = Self::new(limit);
        ranges.into_iter().for_each(|range| bits.insert_range(range));
        bits
    }

    /// All numbers below it may be in the set.
    pub fn limit(&self) -> u32 {
        self.limit
    }

    /// The bits, 64 a word, the lowest number in the lowest bit.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Whether a number is in the set; none beyond the limit is.
    pub fn has(&self, number: u32) -> bool {
        self.words.get(number as usize / 64).is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    /// Adds a number below the limit, and says whether it was not there.
    pub fn insert(&mut self, number: u32) -> bool {
        debug_assert!(number < self.limit, "{number} is not below {}", self.limit);
        let (word, bit) = (&mut self.words[number as usize / 64], 1 << (number % 64));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }

    /// Takes a number out.
    pub fn remove(&mut self, number: u32) {
        if let Some(word) = self.words.get_mut(number as usize / 64) {
            *word &= !(1 << (number % 64));
        }
    }

    /// Adds all numbers of a range that are below the limit.
    pub fn insert_range(&mut self, range: Range<u32>) {
        self.edit_range(range, |word, mask| *word |= mask);
    }

    /// Takes all numbers of a range out.
    pub fn remove_range(&mut self, range: Range<u32>) {
        self.edit_range(range, |word, mask| *word &= !mask);
    }

    fn edit_range(&mut self, range: Range<u32>, mut edit: impl FnMut(&mut u64, u64)) {
        let (start, end) = (range.start, range.end.min(self.limit));
        if start >= end {
            return;
        }
        let (first, last) = (start as usize / 64, (end - 1) as usize / 64);
        for (index, word) in self.words[first..=last].iter_mut().enumerate() {
            let low = if index == 0 { u64::MAX << (start % 64) } else { u64::MAX };
            let high = if first + index == last { u64::MAX >> (63 - (end - 1) % 64) } else { u64::MAX };
            edit(word, low & high);
        }
    }

    /// Takes all numbers out.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Adds the numbers of another set with the same limit.
    pub fn union(&mut self, other: &Self) {
        self.edit_with(other, |word, other| word | other);
    }

    /// Takes the numbers of another set with the same limit out.
    pub fn subtract(&mut self, other: &Self) {
        self.edit_with(other, |word, other| word & !other);
    }

    /// Adds what is in another set with the same limit and not here, and takes out what is in both.
    pub fn toggle(&mut self, other: &Self) {
        self.edit_with(other, |word, other| word ^ other);
    }

    fn edit_with(&mut self, other: &Self, edit: impl Fn(u64, u64) -> u64) {
        debug_assert_eq!(self.limit, other.limit);
        self.words.iter_mut().zip(&other.words).for_each(|(word, &other)| *word = edit(*word, other));
    }

    /// Changes some bits of a word to their opposite; those beyond the limit must not be among them.
    pub(super) fn flip_word(&mut self, index: usize, flips: u64) {
        self.words[index] ^= flips;
    }

    /// All numbers below the limit that are not in the set.
    pub fn inverted(&self) -> Self {
        let mut all = Self::of(self.limit, std::iter::once(0..self.limit));
        all.subtract(self);
        all
    }

    /// How many numbers are in the set.
    pub fn count(&self) -> u32 {
        self.words.iter().map(|word| word.count_ones()).sum()
    }

    /// Whether no number is in the set.
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// The least number of the set that is not below another.
    pub fn next(&self, from: u32) -> Option<u32> {
        self.scan(from, 0)
    }

    /// The least number from `from` on that is not in the set, or the limit.
    fn next_absent(&self, from: u32) -> u32 {
        self.scan(from, u64::MAX).map_or(self.limit, |absent| absent.min(self.limit))
    }

    /// The first set bit of the words, each of which is changed by `flips` before.
    fn scan(&self, from: u32, flips: u64) -> Option<u32> {
        let first = from as usize / 64;
        let start = (self.words.get(first)? ^ flips) & u64::MAX << (from % 64);
        let rest = self.words[first + 1..].iter().map(|word| word ^ flips);
        let words = std::iter::once(start).chain(rest);
        let (index, word) = words.enumerate().find(|(_, word)| *word != 0)?;
        Some((first + index) as u32 * 64 + word.trailing_zeros())
    }

    /// The numbers of the set, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.words).filter(|(_, word)| **word != 0).flat_map(|(index, &word)| {
            let rest = std::iter::successors(Some(word), |word| Some(word & word.wrapping_sub(1)));
            rest.take_while(|&word| word != 0).map(move |word| index * 64 + word.trailing_zeros())
        })
    }

    /// The numbers of the set as the fewest ranges, ascending.
    pub fn ranges(&self) -> impl Iterator<Item = Range<u32>> + '_ {
        let range_from = |from: u32| self.next(from).map(|start| start..self.next_absent(start));
        std::iter::successors(range_from(0), move |range| range_from(range.end))
    }
}

/// How many numbers of a set lie before each word of it, so that a range can be counted at once.
#[derive(Debug, Clone, Default)]
pub struct Ranks {
    before: Vec<u32>,
}

impl Ranks {
    /// Counts a set.
    pub fn of(bits: &Bits) -> Self {
        let mut sum = 0;
        let sums = bits.words.iter().map(|word| {
            sum += word.count_ones();
            sum
        });
        Self { before: std::iter::once(0).chain(sums).collect() }
    }

    /// How many numbers of the set that was counted, which must not have changed since, lie in a range.
    pub fn count(&self, bits: &Bits, range: Range<u32>) -> u32 {
        self.below(bits, range.end).saturating_sub(self.below(bits, range.start))
    }

    fn below(&self, bits: &Bits, number: u32) -> u32 {
        let index = (number as usize / 64).min(self.before.len().saturating_sub(1));
        let part = bits.words.get(index).map_or(0, |word| (word & !(u64::MAX << (number % 64))).count_ones());
        self.before.get(index).map_or(0, |before| before + part)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, Clone)]
    enum Edit {
        Insert(Range<u32>),
        Remove(Range<u32>),
        Toggle(Range<u32>),
        Invert,
    }

    fn edits(limit: u32) -> impl Strategy<Value = Vec<Edit>> {
        let range = (0..=limit, 0..=limit).prop_map(|(a, b)| a.min(b)..a.max(b));
        let edit = prop_oneof![
            range.clone().prop_map(Edit::Insert),
            range.clone().prop_map(Edit::Remove),
            range.prop_map(Edit::Toggle),
            Just(Edit::Invert),
        ];
        prop::collection::vec(edit, 0..12)
    }

    fn apply(edit: &Edit, bits: &mut Bits, naive: &mut BTreeSet<u32>) {
        let limit = bits.limit();
        match edit.clone() {
            Edit::Insert(range) => {
                bits.insert_range(range.clone());
                naive.extend(range);
            }
            Edit::Remove(range) => {
                bits.remove_range(range.clone());
                naive.retain(|number| !range.contains(number));
            }
            Edit::Toggle(range) => {
                let other = Bits::of(limit, [range.clone()]);
                bits.toggle(&other);
                *naive = naive.symmetric_difference(&range.collect()).copied().collect();
            }
            Edit::Invert => {
                *bits = bits.inverted();
                *naive = (0..limit).filter(|number| !naive.contains(number)).collect();
            }
        }
    }

    proptest! {
        #[test]
        fn bits_are_a_set_of_numbers((limit, edits) in (0u32..300).prop_flat_map(|limit| (Just(limit), edits(limit)))) {
            let (mut bits, mut naive) = (Bits::new(limit), BTreeSet::new());
            for edit in &edits {
                apply(edit, &mut bits, &mut naive);
                prop_assert_eq!(bits.iter().collect::<BTreeSet<_>>(), naive.clone());
                prop_assert_eq!(bits.count() as usize, naive.len());
                prop_assert_eq!(bits.is_empty(), naive.is_empty());
                let ranges: Vec<_> = bits.ranges().collect();
                prop_assert!(ranges.windows(2).all(|pair| pair[0].end < pair[1].start));
                prop_assert_eq!(ranges.into_iter().flatten().collect::<BTreeSet<_>>(), naive.clone());
            }
            let ranks = Ranks::of(&bits);
            for start in (0..=limit).step_by(7) {
                prop_assert_eq!(bits.next(start), naive.range(start..).next().copied());
                for end in (start..=limit).step_by(5) {
                    prop_assert_eq!(ranks.count(&bits, start..end) as usize, naive.range(start..end).count());
                }
            }
        }
    }

    #[test]
    #[expect(clippy::single_range_in_vec_init, reason = "a list of one range is meant")]
    fn numbers_beyond_the_limit_are_nowhere() {
        let mut bits = Bits::new(70);
        bits.insert_range(60..500);
        assert_eq!(bits.ranges().collect::<Vec<_>>(), [60..70]);
        bits.remove(1000);
        assert!(!bits.has(70) && !bits.has(1000) && bits.next(70).is_none() && bits.next(5000).is_none());
        assert!(bits.insert(3) && !bits.insert(3));
    }
}
