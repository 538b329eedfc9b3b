//! Wishes and what has arrived in, wishes that can be drawn without holes out.
//!
//! Where cells are wished for of which nothing has arrived, their parent cell, if it has arrived, stands in for all
//! cells below it. Without parent cells, or once everything is there, wishes stay as they are.

use crate::scene::Scene;
use crate::stream::Residency;

/// Wishes that can be drawn.
#[derive(Debug, Default)]
pub struct StandIn {
    /// The wishes and the instances that have one, if they are other ones than those given.
    pub wishes: Option<(Vec<u32>, Vec<u32>)>,
    /// How many wishes were taken back.
    pub replaced: u32,
}

/// Replaces cells that cannot be drawn by a parent that can.
pub fn stand_in(scene: &Scene, residency: &Residency, wishes: &[u32], visible: &[u32]) -> StandIn {
    let instances = scene.instances();
    let arrived = |instance: usize| residency.vertices_arrived(instances[instance].part) > 0;
    if !scene.has_parents() || visible.iter().all(|&instance| arrived(instance as usize)) {
        return StandIn::default();
    }
    let parent = |instance: usize| scene.parent_instance(instance as u32).map(|parent| parent as usize);
    // From the leaves up: who lacks something below, and can help.
    let mut lacking = vec![false; wishes.len()];
    let mut helps = vec![false; wishes.len()];
    for i in (0..wishes.len()).rev() {
        helps[i] = lacking[i] && arrived(i);
        let unmet = lacking[i] && !helps[i] || wishes[i] > 0 && !arrived(i);
        if let (true, Some(parent)) = (unmet, parent(i)) {
            lacking[parent] = true;
        }
    }
    if !helps.contains(&true) {
        return StandIn::default();
    }
    let mut drawn = wishes.to_vec();
    let mut covered = vec![false; wishes.len()];
    let mut replaced = 0;
    for i in 0..wishes.len() {
        covered[i] = parent(i).is_some_and(|parent| covered[parent] || helps[parent]);
        if covered[i] {
            replaced += u32::from(wishes[i] > 0);
            drawn[i] = 0;
        } else if helps[i] {
            drawn[i] = scene.parts()[instances[i].part as usize].vertices;
        }
    }
    let visible = (0..).zip(&drawn).filter(|&(_, &wish)| wish > 0).map(|(instance, _)| instance).collect();
    StandIn { wishes: Some((drawn, visible)), replaced }
}
