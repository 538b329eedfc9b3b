//! Which instances shall have a row in a table in, the rows that have to be written for that out: an instance that stays
//! keeps its place, so what is sent is what is new.

use std::ops::Range;

/// The places of instances in a table without gaps.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// By place.
    instances: Vec<u32>,
    /// Instance and place, by instance.
    sorted: Vec<(u32, u32)>,
}

impl Places {
    /// The instances, by place.
    pub fn instances(&self) -> &[u32] {
        &self.instances
    }

    /// Gives places to these instances (ascending, each once) and to no others; returns the places whose instances are new
    /// there, ascending.
    pub fn set(&mut self, instances: &[u32]) -> Vec<u32> {
        let mut homeless = Vec::new();
        let mut is_taken = vec![false; instances.len()];
        let mut sorted: Vec<(u32, u32)> = Vec::with_capacity(instances.len());
        let mut old = self.sorted.iter().peekable();
        for &instance in instances {
            while old.next_if(|&&(known, _)| known < instance).is_some() {}
            match old.next_if(|&&(known, _)| known == instance) {
                Some(&(_, place)) if (place as usize) < instances.len() => {
                    is_taken[place as usize] = true;
                    sorted.push((instance, place));
                }
                _ => {
                    homeless.push(sorted.len());
                    sorted.push((instance, u32::MAX));
                }
            }
        }
        let free = (0..instances.len() as u32).filter(|&place| !is_taken[place as usize]);
        let written: Vec<u32> = free.collect();
        self.instances.resize(instances.len(), 0);
        for (&at, &place) in homeless.iter().zip(&written) {
            sorted[at].1 = place;
            self.instances[place as usize] = sorted[at].0;
        }
        self.sorted = sorted;
        written
    }
}

/// Ascending places as ranges that are written at once; up to `gap` rows between two are written along.
pub(super) fn runs(places: &[u32], gap: u32) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &place in places {
        let place = place as usize;
        match runs.last_mut() {
            Some(run) if place <= run.end + gap as usize => run.end = place + 1,
            _ => runs.push(place..place + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn rows_that_are_written_make_the_table_whole(
            sets in prop::collection::vec(prop::collection::btree_set(0u32..60, 0..40), 1..8)
        ) {
            let mut places = Places::default();
            let mut table: Vec<u32> = Vec::new();
            let mut before = BTreeSet::new();
            for set in sets {
                let list: Vec<u32> = set.iter().copied().collect();
                let written = places.set(&list);
                prop_assert!(written.is_sorted());
                table.resize(list.len(), u32::MAX);
                for run in runs(&written, 2) {
                    table[run.clone()].copy_from_slice(&places.instances()[run]);
                }
                prop_assert_eq!(&table, &places.instances());
                prop_assert_eq!(&table.iter().copied().collect::<BTreeSet<_>>(), &set);
                let (new, gone) = (set.difference(&before).count(), before.difference(&set).count());
                prop_assert!(written.len() <= new + gone, "{} for {new} new and {gone} gone", written.len());
                before = set;
            }
        }
    }

    #[test]
    fn near_places_are_written_at_once() {
        assert_eq!(runs(&[1, 2, 5, 9], 2), [1..6, 9..10]);
        assert!(runs(&[], 2).is_empty());
    }
}
