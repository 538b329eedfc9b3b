//! Wishes in, states out: a count that is a state of its part, that has arrived, in the tier that is best to draw.
//!
//! A wish may fall into the middle of a group of vertices that go together. It is rounded down, and what that leaves
//! of the budget raises others to their next state, in the order of instances, so that the budget is spent.

use super::stand_in::stand_in;
use crate::scene::Scene;
use crate::stream::{Residency, State};

/// A finer tier is kept until less than this share of the next coarser one is wished for, so that a wish that moves
/// to and fro around the border does not send lists of triangles again and again.
const TIER_HYSTERESIS: f32 = 0.8;

/// What the last frame wished and was granted.
#[derive(Debug, Default)]
pub struct StateChooser {
    wishes: Vec<u32>,
    /// As much of the wishes as had arrived.
    within: Vec<u32>,
    granted: Vec<u32>,
}

/// The result of a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Choice {
    /// Instances with a wish.
    pub visible: u32,
    /// Instances of which less has arrived than was wished for.
    pub misses: u32,
}

impl StateChooser {
    /// Rounds every wish to a state and writes it to `states`. With `keep`, an instance whose wish did not change, and
    /// of which no more of it has arrived, keeps the count it was granted, so that rounding does not flicker; without,
    /// the result depends on the wishes alone.
    pub fn choose(
        &mut self,
        scene: &Scene,
        residency: &Residency,
        wishes: &[u32],
        keep: bool,
        states: &mut [State],
    ) -> Choice {
        let (wishes, replaced) = stand_in(scene, residency, wishes);
        let wishes = wishes.as_ref();
        let parts: Vec<u32> = scene.instances().iter().map(|instance| instance.part).collect();
        let keep = keep && self.wishes.len() == wishes.len();
        let mut counts = vec![0; wishes.len()];
        let mut arrived = vec![0; wishes.len()];
        let mut choice = Choice { misses: replaced, ..Choice::default() };
        let mut left = 0i64;
        for (i, &wish) in wishes.iter().enumerate().filter(|&(_, &wish)| wish > 0) {
            let part = residency.part(parts[i]);
            let within = wish.min(part.vertices_arrived());
            choice.visible += 1;
            choice.misses += u32::from(within < wish);
            arrived[i] = within;
            let is_as_before = keep && self.wishes[i] == wish && self.within[i] == within;
            counts[i] = if is_as_before && self.granted[i] <= part.vertices_arrived() {
                self.granted[i]
            } else {
                part.triangles_at().state_at_most(within as usize) as u32
            };
            left += i64::from(within) - i64::from(counts[i]);
        }
        lower_kept(residency, &parts, wishes, &mut counts, &mut left);
        raise_rounded(residency, &parts, wishes, &mut counts, &mut left);
        for (i, state) in states.iter_mut().enumerate() {
            *state = state_of(scene, residency, parts[i], counts[i], *state);
        }
        self.wishes.clear();
        self.wishes.extend_from_slice(wishes);
        self.within = arrived;
        self.granted = counts;
        choice
    }
}

/// Takes back what kept counts have above their wishes, while more is spent than there is.
fn lower_kept(residency: &Residency, parts: &[u32], wishes: &[u32], counts: &mut [u32], left: &mut i64) {
    for i in 0..counts.len() {
        if *left >= 0 {
            return;
        }
        if counts[i] > wishes[i] {
            let state = residency.part(parts[i]).triangles_at().state_at_most(wishes[i] as usize) as u32;
            *left += i64::from(counts[i] - state);
            counts[i] = state;
        }
    }
}

/// Raises counts to their next state as long as that can be paid: first those that were rounded down, then any, so
/// that the budget is spent to the last vertex where a step of one vertex exists.
fn raise_rounded(residency: &Residency, parts: &[u32], wishes: &[u32], counts: &mut [u32], left: &mut i64) {
    for any in [false, true] {
        for i in 0..counts.len() {
            if *left <= 0 {
                return;
            }
            if counts[i] == 0 || !(any || counts[i] < wishes[i]) {
                continue;
            }
            let at = residency.part(parts[i]).triangles_at();
            let next = at.state_at_least(counts[i] as usize + 1).map_or(0, |next| next as u32);
            if next > 0 && i64::from(next - counts[i]) <= *left {
                *left -= i64::from(next - counts[i]);
                counts[i] = next;
            }
        }
    }
}

/// The state with `vn` vertices, in the tier that is best to draw after `old`.
fn state_of(scene: &Scene, residency: &Residency, part: u32, vn: u32, old: State) -> State {
    if vn == 0 {
        return State::default();
    }
    let sizes = scene.tiers(part);
    let coarsest = coarsest_tier_with(sizes.iter().map(|tier| tier.row.vertices), vn);
    let stays = !old.is_empty()
        && old.tier + 1 == coarsest
        && vn as f32 > TIER_HYSTERESIS * sizes[coarsest as usize].row.vertices as f32;
    let tier = if stays { old.tier } else { coarsest };
    State {
        vertices: vn,
        ecol: sizes[tier as usize].row.vertices,
        triangles: residency.part(part).triangles_at().count_at(vn as usize),
        tier,
    }
}

/// The coarsest tier that has at least `vn` vertices, of tiers given finest first.
pub fn coarsest_tier_with(sizes: impl Iterator<Item = u32>, vn: u32) -> u32 {
    sizes.take_while(|&size| size >= vn).count().saturating_sub(1) as u32
}
