//! Tiers that are lacking in, the order in which they are read out: the most projected error removed for each byte first.

use std::cmp::Reverse;
use std::sync::LazyLock;

use rayon::prelude::*;

use crate::geometry::part::sampled_count;
use crate::geometry::record::decode_error;
use crate::scene::Scene;

/// The first thing to arrive of a part takes the place of a box: it is so many times as urgent as its error tells.
const FIRST: f32 = 4096.0;
/// The most urgent requests are read in the order of the file among so many, ...
const LEAST_WINDOW: usize = 1 << 10;
/// ... later ones among twice as many each time, up to so many.
const MOST_WINDOW: usize = 1 << 16;

/// The error of each code as a share of the part's diagonal.
static SHARES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| decode_error(code as u8, 1.0) as f32));

/// A chunk that is lacking; of two, the more urgent one is the lesser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Lack {
    /// Urgencies are not negative, so that their bits are in their order.
    urgency: Reverse<u32>,
    /// Coarse tiers before fine ones.
    tier: Reverse<u32>,
    part: u32,
}

impl Lack {
    pub fn new(scene: &Scene, part: u32, tier: u32, urgency: f32) -> Self {
        let is_first = tier as usize + 1 == scene.tiers(part).len();
        let urgency = urgency.max(0.0) * if is_first { FIRST } else { 1.0 };
        Self { urgency: Reverse(urgency.to_bits()), tier: Reverse(tier), part }
    }

    /// The part and the tier.
    pub fn chunk(&self) -> (u32, u32) {
        (self.part, self.tier.0)
    }
}

/// The tiers of a part, from the coarsest to `finest`, and how urgent each is: the projected error that it removes for each byte
/// once it is decoded, never more than that of a coarser one. `weight` is how much the part's whole error would be seen.
pub(super) fn urgencies(
    scene: &Scene,
    part: u32,
    finest: u32,
    weight: f32,
) -> impl Iterator<Item = (u32, f32)> {
    let row = &scene.parts()[part as usize];
    let tiers = scene.tiers(part);
    let error_at = |vertices: u32| {
        let holds = (least_sample(row.vertices, vertices)..row.errors.len())
            .find(|&j| sampled_count(row.vertices, j) <= vertices);
        holds.map_or(1.0, |j| SHARES[row.errors[j] as usize])
    };
    // With nothing there, it is off by its own size.
    let mut before = 1.0;
    let mut least = f32::INFINITY;
    (finest as usize..tiers.len()).rev().map(move |tier| {
        let after = error_at(tiers[tier].vertices);
        let removed = (before - after).max(0.0);
        before = after;
        let below = tiers.get(tier + 1).map_or(0, |row| row.vertices);
        let bytes = tiers[tier].plain_bytes(tiers[tier].vertices.saturating_sub(below));
        least = least.min(weight * removed / bytes.max(1) as f32);
        (tier as u32, least)
    })
}

/// A sample of the error of a part with `all` vertices that comes no later than the first with at most `vertices`: all
/// before it have at least the power of two above that.
fn least_sample(all: u32, vertices: u32) -> usize {
    let halvings = all.max(1).ilog2() as usize + 1;
    (2 * halvings).saturating_sub(2 * vertices.max(1).ilog2() as usize + 3)
}

/// Gives `read` all that is lacking, window by window: the most urgent ones before the rest is looked at any further,
/// each window in the order of the file, so that what lies together is read together.
pub(super) fn by_urgency(
    scene: &Scene,
    mut lacks: Vec<Lack>,
    mut read: impl FnMut(&mut dyn Iterator<Item = Lack>),
) {
    let mut left = &mut lacks[..];
    let mut window = LEAST_WINDOW;
    while !left.is_empty() {
        let most = window.min(left.len());
        if most < left.len() {
            // What comes after this window need not be in order yet.
            left.select_nth_unstable(most);
        }
        let (now, later) = left.split_at_mut(most);
        let placed = |&lack: &Lack| {
            let (part, tier) = lack.chunk();
            (scene.tiers(part)[tier as usize].offset, lack)
        };
        let mut placed: Vec<(u64, Lack)> = now.par_iter().map(placed).collect();
        placed.par_sort_unstable();
        read(&mut placed.iter().map(|(_, lack)| *lack));
        left = later;
        window = (2 * window).min(MOST_WINDOW);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_sample_that_holds_is_skipped() {
        let counts = (0..100).chain([127, 128, 129, 1000, 4095, 4096, 65_535, 65_536]);
        for all in counts.clone() {
            for vertices in counts.clone().take_while(|&vertices| vertices <= all) {
                let first = (0..40).find(|&j| sampled_count(all, j) <= vertices).unwrap();
                assert!(least_sample(all, vertices) <= first, "{vertices} of {all}: {first}");
            }
        }
    }
}
