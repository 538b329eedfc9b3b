//! Candidates in, their wishes out: `reference::select` for those instances alone, on all cores, with the same result.
//!
//! The search for the common factor is the reference's, bit by bit. On the way, instances whose budget is the same at both
//! ends of what is left of the interval are added up and looked at no more: budgets are whole numbers, so that the last half
//! of the bits moves few of them.

use rayon::prelude::*;

use crate::gpu::layout::{SelectParams, SelectRow, Weighed};
use crate::reference::select::{MAX_LAMBDA, is_drawn, respond, weigh_seen};

/// Instances that one task looks at, at least.
const TASK: usize = 4096;
/// After so many bits what has settled is left out.
const BITS_A_ROUND: u32 = 4;
/// Above this bit of the factor, little can have settled.
const FIRST_ROUND: u32 = 24;

/// The wishes of `candidates`, which are all instances that are not culled, ascending; `old` has the last wishes, one a
/// row. Gives one a candidate; all others wish 0. The same as [`crate::reference::select::select`].
///
/// # Panics
/// If a candidate is not a row, or `old` is shorter than `rows`.
pub fn spend(rows: &[SelectRow], candidates: &[u32], params: &SelectParams, old: &[u32]) -> Vec<u32> {
    let weigh = |&number: &u32| weigh_seen(rows, number as usize, params, old);
    let weighed: Vec<Weighed> = candidates.par_iter().with_min_len(TASK / 8).map(weigh).collect();
    let lambda = greatest_factor(&weighed, params);
    let next = (lambda + 1).min(MAX_LAMBDA);
    let response = |item: &Weighed| {
        let at = |bits: u32| respond(item, f32::from_bits(bits), params.dead_band);
        let stays = is_drawn(item, f32::from_bits(lambda)) == is_drawn(item, f32::from_bits(next));
        let count = at(lambda);
        (count, if stays { at(next) - count } else { 0 })
    };
    let responses: Vec<(u32, u32)> = weighed.par_iter().with_min_len(TASK).map(response).collect();
    let spent: u64 = responses.iter().map(|&(count, _)| u64::from(count)).sum();
    let mut left = u64::from(params.budget).saturating_sub(spent);
    let deal = |&(count, jump): &(u32, u32)| {
        let dealt = left.min(u64::from(jump));
        left -= dealt;
        count + dealt as u32
    };
    responses.iter().map(deal).collect()
}

/// The bits of the factor that [`crate::reference::select::select`] finds.
fn greatest_factor(weighed: &[Weighed], params: &SelectParams) -> u32 {
    let mut search = Search { moving: Vec::new(), settled: 0, dead_band: params.dead_band };
    let mut low = 0u32;
    for bit in (0..u32::BITS).rev() {
        let candidate = low | 1 << bit;
        let cost = if bit >= FIRST_ROUND {
            search.cost(weighed.par_chunks(TASK), candidate)
        } else {
            search.cost(search.moving.par_iter().map(Vec::as_slice), candidate)
        };
        if candidate <= MAX_LAMBDA && cost <= u64::from(params.budget) {
            low = candidate;
        }
        if bit == FIRST_ROUND {
            search.moving = weighed.par_chunks(TASK).map(<[Weighed]>::to_vec).collect();
        }
        if bit <= FIRST_ROUND && bit.is_multiple_of(BITS_A_ROUND) {
            search.settle(low, (low | ((1 << bit) - 1)).min(MAX_LAMBDA));
        }
    }
    low
}

/// The search for the common factor.
struct Search {
    /// Instances whose budget may differ at the factors that are left, by task.
    moving: Vec<Vec<Weighed>>,
    /// What all others have.
    settled: u64,
    dead_band: f32,
}

impl Search {
    /// What all instances have at a factor.
    fn cost<'a>(&self, moving: impl ParallelIterator<Item = &'a [Weighed]>, bits: u32) -> u64 {
        let at = |item: &Weighed| u64::from(respond(item, f32::from_bits(bits), self.dead_band));
        self.settled + moving.map(|items| items.iter().map(at).sum::<u64>()).sum::<u64>()
    }

    /// Adds up what is the same at all factors from `low` to `high`: a budget never falls while an instance is drawn.
    fn settle(&mut self, low: u32, high: u32) {
        let dead_band = self.dead_band;
        let [low, high] = [low, high].map(f32::from_bits);
        let settle_task = |items: &mut Vec<Weighed>| {
            let mut settled = 0;
            items.retain(|item| {
                let at_low = respond(item, low, dead_band);
                let never = high < item.open || item.close <= low || item.close <= item.open;
                let always = is_drawn(item, low) && is_drawn(item, high);
                let is_settled = never || always && at_low == respond(item, high, dead_band);
                settled += if is_settled { u64::from(at_low) } else { 0 };
                !is_settled
            });
            settled
        };
        self.settled += self.moving.par_iter_mut().map(settle_task).sum::<u64>();
        self.moving.retain(|items| !items.is_empty());
    }
}
