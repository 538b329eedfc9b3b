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
    /// By instance; meaningful for those of `drawn` only.
    wishes: Vec<u32>,
    granted: Vec<u32>,
    /// As much of the wishes as had arrived.
    within: Vec<u32>,
    /// The greatest state that is at most that.
    rounded: Vec<u32>,
    /// The instances that were granted something, ascending.
    drawn: Vec<u32>,
}

/// The result of a choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Choice {
    /// Instances with a wish.
    pub visible: u32,
    /// Instances of which less has arrived than was wished for.
    pub misses: u32,
    /// Vertices that were wished for.
    pub wished: u64,
    /// Vertices that were granted.
    pub granted: u64,
    /// Vertices of the coarsest states of all that was granted something.
    pub floors: u64,
}

/// One instance with a wish, while its state is chosen.
struct Item {
    instance: u32,
    part: u32,
    wish: u32,
    count: u32,
}

impl StateChooser {
    /// Rounds every wish to a state and writes it to `states`; `visible` lists the instances with a wish, ascending.
    /// With `keep`, an instance whose wish did not change, and of which no more has arrived, keeps the count it was
    /// granted, so that rounding does not flicker; without, the result depends on the wishes alone. Time follows what is
    /// visible or was.
    pub fn choose(
        &mut self,
        scene: &Scene,
        residency: &Residency,
        (wishes, visible): (&[u32], &[u32]),
        keep: bool,
        states: &mut [State],
    ) -> Choice {
        let (parts, instances) = (scene.parts(), scene.instances());
        let stand_in = stand_in(scene, residency, wishes, visible);
        let (wishes, visible) = stand_in.wishes.as_ref().map_or((wishes, visible), |(w, v)| (w, v));
        self.granted.resize(wishes.len(), 0);
        self.wishes.resize(wishes.len(), 0);
        self.within.resize(wishes.len(), 0);
        self.rounded.resize(wishes.len(), 0);
        let mut choice = Choice { misses: stand_in.replaced, ..Choice::default() };
        let mut left = 0i64;
        let mut items: Vec<Item> = Vec::with_capacity(visible.len());
        for &instance in visible {
            let (i, wish) = (instance as usize, wishes[instance as usize]);
            let part = instances[i].part;
            let arrived = residency.vertices_arrived(part);
            let within = wish.min(arrived);
            choice.misses += u32::from(within < wish);
            let is_as_before = keep && (self.wishes[i], self.within[i]) == (wish, within);
            if self.within[i] != within {
                // All else is as it was: the vertices that have arrived are always the same ones.
                self.within[i] = within;
                self.rounded[i] = residency.part(part).triangles_at().state_at_most(within as usize) as u32;
            }
            let count = match is_as_before && self.granted[i] <= arrived {
                true => self.granted[i],
                false => self.rounded[i],
            };
            left += i64::from(within) - i64::from(count);
            choice.wished += u64::from(wish.min(parts[part as usize].vertices));
            items.push(Item { instance, part, wish, count });
        }
        lower_kept(residency, &mut items, &mut left);
        raise_rounded(residency, &mut items, &mut left);
        self.grant(scene, residency, &items, states);
        choice.visible = items.len() as u32;
        let drawn = items.iter().filter(|item| item.count > 0);
        choice.floors = drawn.map(|item| u64::from(parts[item.part as usize].locked)).sum();
        choice.granted = items.iter().map(|item| u64::from(item.count)).sum();
        choice
    }

    /// The instances that were granted something by the last choice, ascending.
    pub fn drawn(&self) -> &[u32] {
        &self.drawn
    }

    /// Whether an instance was granted something by the last choice.
    pub fn draws(&self, instance: u32) -> bool {
        self.granted[instance as usize] > 0
    }

    /// Writes the states of all items, and nothing for what was drawn before and is no longer.
    fn grant(&mut self, scene: &Scene, residency: &Residency, items: &[Item], states: &mut [State]) {
        for &instance in &self.drawn {
            self.granted[instance as usize] = 0;
            self.wishes[instance as usize] = 0;
        }
        let mut before = std::mem::take(&mut self.drawn).into_iter().peekable();
        for item in items {
            let i = item.instance as usize;
            while let Some(gone) = before.next_if(|&gone| gone < item.instance) {
                states[gone as usize] = State::default();
            }
            before.next_if_eq(&item.instance);
            states[i] = state_of(scene, residency, item.part, item.count, states[i]);
            self.wishes[i] = item.wish;
            self.granted[i] = item.count;
            self.drawn.push(item.instance);
        }
        before.for_each(|gone| states[gone as usize] = State::default());
    }
}

/// Takes back what kept counts have above their wishes, while more is spent than there is.
fn lower_kept(residency: &Residency, items: &mut [Item], left: &mut i64) {
    for item in items {
        if *left >= 0 {
            return;
        }
        if item.count > item.wish {
            let state = residency.part(item.part).triangles_at().state_at_most(item.wish as usize) as u32;
            *left += i64::from(item.count - state);
            item.count = state;
        }
    }
}

/// Raises counts to their next state as long as that can be paid: first those that were rounded down, then any, so
/// that the budget is spent to the last vertex where a step of one vertex exists.
fn raise_rounded(residency: &Residency, items: &mut [Item], left: &mut i64) {
    for any in [false, true] {
        for item in &mut *items {
            if *left <= 0 {
                return;
            }
            if item.count == 0 || !(any || item.count < item.wish) {
                continue;
            }
            let at = residency.part(item.part).triangles_at();
            let next = at.state_at_least(item.count as usize + 1).map_or(0, |next| next as u32);
            if next > 0 && i64::from(next - item.count) <= *left {
                *left -= i64::from(next - item.count);
                item.count = next;
            }
        }
    }
}

/// The state with `vn` vertices, in the tier that is best to draw after `old`.
fn state_of(scene: &Scene, residency: &Residency, part: u32, vn: u32, old: State) -> State {
    if vn == 0 {
        return State::default();
    }
    // Nothing but an eviction takes the same count to another tier.
    if vn == old.vertices && residency.can_draw(part, old.tier) {
        return old;
    }
    let sizes = scene.tiers(part);
    let coarsest = coarsest_tier_with(sizes.iter().map(|tier| tier.vertices), vn);
    let held = residency.part(part);
    let stays = !old.is_empty()
        && old.tier + 1 == coarsest
        // It may have been given back since.
        && held.finest().is_some_and(|finest| finest <= old.tier)
        && vn as f32 > TIER_HYSTERESIS * sizes[coarsest as usize].vertices as f32;
    let tier = if stays { old.tier } else { coarsest };
    State {
        vertices: vn,
        ecol: sizes[tier as usize].vertices,
        triangles: held.triangles_at().count_at(vn as usize),
        tier,
    }
}

/// The coarsest tier that has at least `vn` vertices, of tiers given finest first.
pub fn coarsest_tier_with(sizes: impl Iterator<Item = u32>, vn: u32) -> u32 {
    sizes.take_while(|&size| size >= vn).count().saturating_sub(1) as u32
}
