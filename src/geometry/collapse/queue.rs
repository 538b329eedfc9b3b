//! A priority queue of positions by cost: buckets of about 3 % width, first in first out within a bucket.
//!
//! Every operation is O(1) but finding the next bucket, which looks at one bit a bucket: 128 words at most. A position
//! is in at most one bucket; a new cost moves it. First in first out spreads equal costs over the surface.

const MANTISSA_BITS: u32 = 5;
const SHIFT: u32 = 23 - MANTISSA_BITS;
const BUCKETS: usize = 1 << (8 + MANTISSA_BITS);
const NONE: u32 = u32::MAX;

/// The queue; costs are non-negative floats.
pub(super) struct BucketQueue {
    head: Vec<u32>,
    tail: Vec<u32>,
    occupied: Vec<u64>,
    next: Vec<u32>,
    previous: Vec<u32>,
    bucket_of: Vec<u16>,
}

const ABSENT: u16 = u16::MAX;

impl BucketQueue {
    /// An empty queue for positions `0..count`.
    pub fn new(count: usize) -> Self {
        Self {
            head: vec![NONE; BUCKETS],
            tail: vec![NONE; BUCKETS],
            occupied: vec![0; BUCKETS / 64],
            next: vec![NONE; count],
            previous: vec![NONE; count],
            bucket_of: vec![ABSENT; count],
        }
    }

    /// Inserts a position, or moves it to its new cost.
    pub fn set(&mut self, position: u32, cost: f32) {
        self.remove(position);
        let bucket = bucket_of(cost);
        let tail = self.tail[bucket];
        self.previous[position as usize] = tail;
        self.next[position as usize] = NONE;
        if tail == NONE {
            self.head[bucket] = position;
            self.occupied[bucket / 64] |= 1 << (bucket % 64);
        } else {
            self.next[tail as usize] = position;
        }
        self.tail[bucket] = position;
        self.bucket_of[position as usize] = bucket as u16;
    }

    /// Takes a position out, if it is in.
    pub fn remove(&mut self, position: u32) {
        let bucket = self.bucket_of[position as usize];
        if bucket == ABSENT {
            return;
        }
        self.bucket_of[position as usize] = ABSENT;
        let bucket = bucket as usize;
        let (previous, next) = (self.previous[position as usize], self.next[position as usize]);
        if previous == NONE {
            self.head[bucket] = next;
        } else {
            self.next[previous as usize] = next;
        }
        if next == NONE {
            self.tail[bucket] = previous;
        } else {
            self.previous[next as usize] = previous;
        }
        if self.head[bucket] == NONE {
            self.occupied[bucket / 64] &= !(1 << (bucket % 64));
        }
    }

    /// Whether a position is in.
    pub fn contains(&self, position: u32) -> bool {
        self.bucket_of[position as usize] != ABSENT
    }

    /// Takes out the position that has waited longest in the cheapest bucket.
    pub fn pop(&mut self) -> Option<u32> {
        let word = self.occupied.iter().position(|&bits| bits != 0)?;
        let bucket = word * 64 + self.occupied[word].trailing_zeros() as usize;
        let position = self.head[bucket];
        self.remove(position);
        Some(position)
    }

    /// Whether a position of the given cost would be popped after one that is in now.
    pub fn has_cheaper_than(&self, cost: f32) -> bool {
        let bucket = bucket_of(cost);
        let (word, bit) = (bucket / 64, bucket % 64);
        self.occupied[word] & ((1 << bit) - 1) != 0 || self.occupied[..word].iter().any(|&bits| bits != 0)
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
            let mut queue = BucketQueue::new(costs.len());
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
        let mut queue = BucketQueue::new(4);
        for position in [2, 0, 3, 1] {
            queue.set(position, 1.0);
        }
        queue.remove(0);
        assert!(!queue.contains(0) && queue.has_cheaper_than(2.0) && !queue.has_cheaper_than(1.0));
        assert_eq!(std::iter::from_fn(|| queue.pop()).collect::<Vec<_>>(), [2, 3, 1]);
    }
}
