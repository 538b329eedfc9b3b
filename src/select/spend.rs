//! Candidates in, their wishes out: `reference::select` for those instances alone, on all cores, with the same result.
//!
//! The search for the common factor is the reference's, bit by bit. On the way, instances whose budget is the same at both
//! ends of what is left of the interval are added up and looked at no more: budgets are whole numbers, so that the last half
//! of the bits moves few of them.

use rayon::prelude::*;

use crate::gpu::layout::{SelectParams, SelectRow, Weighed};
use crate::reference::select::{MAX_LAMBDA, is_drawn, respond, weigh};

/// Instances that one task looks at, at least.
const TASK: usize = 4096;
/// After so many bits what has settled is left out.
const BITS_A_ROUND: u32 = 4;

/// The wishes of `candidates` (ascending), which are all instances that are not culled; `old` has the last wishes, one a row.
/// Gives one a candidate; all others wish 0. The same as [`crate::reference::select::select`].
///
/// # Panics
/// If a candidate is not a row, or `old` is shorter than `rows`.
pub fn spend(rows: &[SelectRow], candidates: &[u32], params: &SelectParams, old: &[u32]) -> Vec<u32> {
    let weighed: Vec<Weighed> = candidates
        .par_iter()
        .with_min_len(TASK / 8)
        .map(|&number| weigh(rows, number as usize, params, old))
        .collect();
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
    let (mut low, mut first) = (0u32, true);
    for bit in (0..u32::BITS).rev() {
        let candidate = low | 1 << bit;
        let moving = if first { weighed } else { &search.moving };
        if candidate <= MAX_LAMBDA && search.cost(moving, candidate) <= u64::from(params.budget) {
            low = candidate;
        }
        if bit % BITS_A_ROUND == 0 && bit > 0 && bit < 28 {
            let high = (low | ((1 << bit) - 1)).min(MAX_LAMBDA);
            let moving = if first { weighed.to_vec() } else { std::mem::take(&mut search.moving) };
            search.settle(moving, low, high);
            first = false;
        }
    }
    low
}

/// The search for the common factor.
struct Search {
    /// Instances whose budget may differ at the factors that are left.
    moving: Vec<Weighed>,
    /// What all others have.
    settled: u64,
    dead_band: f32,
}

impl Search {
    fn respond(&self, item: &Weighed, bits: u32) -> u32 {
        respond(item, f32::from_bits(bits), self.dead_band)
    }

    /// What all instances have at a factor.
    fn cost(&self, moving: &[Weighed], bits: u32) -> u64 {
        let sum =
            |items: &[Weighed]| items.iter().map(|item| u64::from(self.respond(item, bits))).sum::<u64>();
        self.settled + moving.par_chunks(TASK).map(sum).sum::<u64>()
    }

    /// Adds up what is the same at all factors from `low` to `high`: a budget never falls while an instance is drawn.
    fn settle(&mut self, moving: Vec<Weighed>, low: u32, high: u32) {
        let is_settled = |item: &Weighed| {
            let [from, to] = [low, high].map(f32::from_bits);
            let never = to < item.open || item.close <= from || item.close <= item.open;
            let always = is_drawn(item, from) && is_drawn(item, to);
            never || always && self.respond(item, low) == self.respond(item, high)
        };
        let (settled, moving): (Vec<Weighed>, Vec<Weighed>) =
            moving.into_par_iter().with_min_len(TASK).partition(is_settled);
        self.settled += settled.iter().map(|item| u64::from(self.respond(item, low))).sum::<u64>();
        self.moving = moving;
    }
}
