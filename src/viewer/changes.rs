//! Two states of what is hidden and what is a ghost in, the difference out, which leads from either to the other.

use super::bits::Bits;

/// Words that follow each other and change alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Flip {
    first_word: u32,
    words: u32,
    flips: u64,
}

/// The bits in which some sets differ. A branch of any size is three flips at most.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change<const SETS: usize = 2>([Box<[Flip]>; SETS]);

impl<const SETS: usize> Change<SETS> {
    /// What differs between sets with the same limits.
    pub fn between(old: [&Bits; SETS], new: [&Bits; SETS]) -> Self {
        Self(std::array::from_fn(|set| flips(old[set], new[set])))
    }

    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|flips| flips.is_empty())
    }

    /// Leads from one side of the difference to the other.
    pub fn apply(&self, sets: [&mut Bits; SETS]) {
        for (flips, set) in self.0.iter().zip(sets) {
            for flip in flips {
                let words = flip.first_word..flip.first_word + flip.words;
                words.for_each(|word| set.flip_word(word as usize, flip.flips));
            }
        }
    }

    /// Bytes of memory that it holds.
    pub fn bytes_held(&self) -> usize {
        size_of::<Self>() + self.0.iter().map(|flips| size_of_val(&**flips)).sum::<usize>()
    }
}

fn flips(old: &Bits, new: &Bits) -> Box<[Flip]> {
    let mut found: Vec<Flip> = Vec::new();
    let differences = old.words().iter().zip(new.words()).map(|(old, new)| old ^ new);
    for (word, flips) in (0u32..).zip(differences).filter(|(_, flips)| *flips != 0) {
        match found.last_mut() {
            Some(last) if last.flips == flips && last.first_word + last.words == word => last.words += 1,
            _ => found.push(Flip { first_word: word, words: 1, flips }),
        }
    }
    found.into_boxed_slice()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::single_range_in_vec_init, reason = "a list of one range is meant")]
    fn a_branch_takes_three_flips_at_most_and_leads_both_ways() {
        let limit = 1_000_003;
        let old = [Bits::new(limit), Bits::of(limit, [5..900_000])];
        let new = [Bits::of(limit, [70..999_999]), Bits::of(limit, [5..7])];
        let change = Change::between(old.each_ref(), new.each_ref());
        assert_eq!(change.0.each_ref().map(|flips| flips.len()), [3, 3]);
        let mut sets = old.clone();
        change.apply(sets.each_mut());
        assert_eq!(sets, new);
        change.apply(sets.each_mut());
        assert_eq!(sets, old);
        assert!(Change::between(old.each_ref(), old.each_ref()).is_empty());
    }
}
