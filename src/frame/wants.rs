//! Wishes that changed in, what is wanted of each part out: the finest tier that any of its placements needs.
//!
//! For every tier it is counted how many instances need it, so that a wish that comes, goes or changes costs the same
//! however many others there are. The parent cells of what is wished for are wanted in their coarsest tiers: they stand in
//! until that has arrived. How much a part weighs is summed up over its instances when it is asked for.

use std::ops::Range;

use rayon::prelude::*;

use crate::scene::Scene;
use crate::select::WishChange;
use crate::select::states::coarsest_tier_with;
use crate::stream::residency::Change;

/// What is wanted of all parts.
pub(super) struct Wants {
    /// By chunk, how many instances need its tier and no finer one.
    needed_by: Vec<u32>,
    /// By instance, how many with a wish there are below it; empty in a scene without parent cells.
    wished_below: Vec<u32>,
    /// The instances of all parts, part by part, ascending in each.
    instances: Vec<u32>,
    /// By part, where its instances start in the list; and where the last one's end.
    starts: Vec<u32>,
}

/// Bytes of memory for each instance, part and chunk.
pub(super) const BYTES_PER_INSTANCE: u64 = 8;
pub(super) const BYTES_PER_PART: u64 = 4;
pub(super) const BYTES_PER_CHUNK: u64 = 4;

impl Wants {
    /// Nothing is wished for yet.
    pub fn new(scene: &Scene) -> Self {
        let (count, parts) = (scene.instances().len(), scene.parts().len());
        let mut starts = vec![0u32; parts + 1];
        scene.instances().iter().for_each(|instance| starts[instance.part as usize + 1] += 1);
        for part in 0..parts {
            starts[part + 1] += starts[part];
        }
        let mut next = starts.clone();
        let mut instances = vec![0; count];
        for (number, instance) in (0..).zip(scene.instances()) {
            let at = &mut next[instance.part as usize];
            instances[*at as usize] = number;
            *at += 1;
        }
        let wished_below = if scene.has_parents() { vec![0; count] } else { Vec::new() };
        Self { needed_by: vec![0; scene.chunk_count()], wished_below, instances, starts }
    }

    /// Takes in what has changed; tells of every part of which it may now be another tier that is wanted, once.
    pub fn follow(&mut self, scene: &Scene, changes: &[WishChange]) -> Vec<Change> {
        let chunk_for = |part: u32, wish: u32| {
            let sizes = scene.tiers(part).iter().map(|tier| tier.vertices);
            (wish > 0).then(|| scene.chunk_number(part, coarsest_tier_with(sizes, wish)))
        };
        let moves = |change: &WishChange| {
            let part = scene.instances()[change.instance as usize].part;
            (part, chunk_for(part, change.old), chunk_for(part, change.new))
        };
        let moves: Vec<_> = changes.par_iter().map(moves).filter(|(_, old, new)| old != new).collect();
        let mut parts: Vec<u32> = moves.iter().map(|&(part, ..)| part).collect();
        for (_, old, new) in moves {
            self.count(old, new);
        }
        if !self.wished_below.is_empty() {
            self.follow_parents(scene, changes, &mut parts);
        }
        parts.par_sort_unstable();
        parts.dedup();
        parts.par_iter().map(|&part| Change { part, tier: self.finest(scene, part) }).collect()
    }

    fn count(&mut self, old: Option<usize>, new: Option<usize>) {
        if let Some(old) = old {
            self.needed_by[old] -= 1;
        }
        if let Some(new) = new {
            self.needed_by[new] += 1;
        }
    }

    /// Counts what came and went below parent cells.
    fn follow_parents(&mut self, scene: &Scene, changes: &[WishChange], parts: &mut Vec<u32>) {
        for change in changes.iter().filter(|change| (change.old == 0) != (change.new == 0)) {
            let mut above = scene.parent_instance(change.instance);
            while let Some(parent) = above {
                let part = scene.instances()[parent as usize].part;
                let coarsest = scene.chunk_number(part, scene.tiers(part).len().saturating_sub(1) as u32);
                let below = &mut self.wished_below[parent as usize];
                if change.new > 0 {
                    *below += 1;
                    self.needed_by[coarsest] += 1;
                } else {
                    *below -= 1;
                    self.needed_by[coarsest] -= 1;
                }
                parts.push(part);
                above = scene.parent_instance(parent);
            }
        }
    }

    fn finest(&self, scene: &Scene, part: u32) -> Option<u32> {
        let first = scene.chunk_number(part, 0);
        let needed = &self.needed_by[first..first + scene.tiers(part).len()];
        needed.iter().position(|&count| count > 0).map(|tier| tier as u32)
    }

    fn placed(&self, part: u32) -> Range<usize> {
        self.starts[part as usize] as usize..self.starts[part as usize + 1] as usize
    }

    /// The sum of the cubes of the sizes of a part's instances, of each as often as it or what is below it is wished for.
    pub fn weight(&self, part: u32, wishes: &[u32], px: impl Fn(u32) -> f64) -> f32 {
        let instances = self.instances[self.placed(part)].iter();
        let weighed = instances.map(|&instance| {
            let below = self.wished_below.get(instance as usize).copied().unwrap_or(0);
            let times = u32::from(wishes[instance as usize] > 0) + below;
            if times == 0 { 0.0 } else { times as f32 * (px(instance) as f32).powi(3) }
        });
        weighed.sum()
    }
}
