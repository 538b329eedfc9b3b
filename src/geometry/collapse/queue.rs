//! A priority queue of positions by cost: buckets of about 3 % width, first in first out within a bucket.
//!
//! Every operation is O(1) but finding the next bucket, which looks at one bit a bucket: 128 words at most. A position
//! counts in one bucket only; where a new cost has moved it, its old entry is dropped when it comes up, so that moving
//! touches no memory but the ends of two buckets. First in first out spreads equal costs over the surface.

use std::collections::VecDeque;

use super::mesh::Number;

const MANTISSA_BITS: u32 = 5;
const SHIFT: u32 = 23 - MANTISSA_BITS;
/// As many as there are exponents.
const ROWS: usize = 1 << 8;
const ROW_BUCKETS: usize = 1 << MANTISSA_BITS;
const BUCKETS: usize = ROWS * ROW_BUCKETS;
const _: () = assert!(BUCKETS / 64 <= u128::BITS as usize);
const ABSENT: u16 = u16::MAX;

/// The queue; costs are non-negative floats.
pub(super) struct BucketQueue<N> {
    /// The buckets of each exponent; none until the first is used, so that a queue for a few positions costs little.
    rows: Vec<Vec<VecDeque<N>>>,
    occupied: Vec<u64>,
    /// Which words of `occupied` have a bit set.
    words: u128,
    bucket_of: Vec<u16>,
}

impl<N: Number> BucketQueue<N> {
    /// An empty queue for positions `0..count`.
    pub fn new(count: usize) -> Self {
        Self {
            rows: vec![Vec::new(); ROWS],
            occupied: vec![0; BUCKETS / 64],
            words: 0,
            bucket_of: vec![ABSENT; count],
        }
    }

    /// Inserts a position, or moves it to its new cost.
    pub fn set(&mut self, position: u32, cost: f32) {
        let bucket = bucket_of(cost);
        if std::mem::replace(&mut self.bucket_of[position as usize], bucket as u16) == bucket as u16 {
            return;
        }
        let row = &mut self.rows[bucket / ROW_BUCKETS];
        if row.is_empty() {
            row.resize_with(ROW_BUCKETS, VecDeque::new);
        }
        row[bucket % ROW_BUCKETS].push_back(N::of(position));
        self.occupied[bucket / 64] |= 1 << (bucket % 64);
        self.words |= 1 << (bucket / 64);
    }

    /// Takes a position out, if it is in.
    pub fn remove(&mut self, position: u32) {
        self.bucket_of[position as usize] = ABSENT;
    }

    /// Whether a position is in.
    pub fn contains(&self, position: u32) -> bool {
        self.bucket_of[position as usize] != ABSENT
    }

    /// Takes out the position that has waited longest in the cheapest bucket.
    pub fn pop(&mut self) -> Option<u32> {
        while self.words != 0 {
            let word = self.words.trailing_zeros() as usize;
            let bucket = word * 64 + self.occupied[word].trailing_zeros() as usize;
            while let Some(position) = self.rows[bucket / ROW_BUCKETS][bucket % ROW_BUCKETS].pop_front() {
                let position = position.get();
                if self.bucket_of[position as usize] as usize == bucket {
                    self.remove(position);
                    return Some(position);
                }
            }
            self.occupied[word] &= !(1 << (bucket % 64));
            if self.occupied[word] == 0 {
                self.words &= !(1 << word);
            }
        }
        None
    }

    /// Whether a position of the given cost may be popped after one that is in now.
    pub fn has_cheaper_than(&self, cost: f32) -> bool {
        let bucket = bucket_of(cost);
        let (word, bit) = (bucket / 64, bucket % 64);
        self.words & ((1 << word) - 1) != 0 || self.occupied[word] & ((1 << bit) - 1) != 0
    }
}

fn bucket_of(cost: f32) -> usize {
    // `max` also makes a cost that is not a number the cheapest, so that it cannot stay in the way for ever.
    ((cost.max(0.0).to_bits() >> SHIFT) as usize).min(BUCKETS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pops_in_order_of_buckets(costs in prop::collection::vec(0f32..1e6, 1..200)) {
            let mut queue = BucketQueue::<u16>::new(costs.len());
            for (position, &cost) in costs.iter().enumerate() {
                queue.set(position as u32, f32::MAX);
                queue.set(position as u32, cost);
            }
            let mut popped = Vec::new();
            while let Some(position) = queue.pop() {
                popped.push(position);
            }
            prop_assert_eq!(popped.len(), costs.len());
            for pair in popped.windows(2) {
                prop_assert!(bucket_of(costs[pair[0] as usize]) <= bucket_of(costs[pair[1] as usize]));
            }
        }
    }

    #[test]
    fn equal_costs_leave_in_the_order_in_which_they_came() {
        let mut queue = BucketQueue::<u16>::new(4);
        for position in [2, 0, 3, 1] {
            queue.set(position, 1.0);
        }
        queue.remove(0);
        assert!(!queue.contains(0) && queue.has_cheaper_than(2.0) && !queue.has_cheaper_than(1.0));
        assert_eq!(std::iter::from_fn(|| queue.pop()).collect::<Vec<_>>(), [2, 3, 1]);
    }
}
