//! Wishes and what has arrived in, wishes that can be drawn without holes out.
//!
//! Where cells are wished for of which nothing has arrived, their parent cell, if it has arrived, stands in for all
//! cells below it. Without parent cells, or once everything is there, wishes stay as they are.

use std::borrow::Cow;

use crate::scene::Scene;
use crate::stream::Residency;

/// Replaces cells that cannot be drawn by a parent that can, and counts the wishes that this takes back.
pub fn stand_in<'a>(scene: &Scene, residency: &Residency, wishes: &'a [u32]) -> (Cow<'a, [u32]>, u32) {
    if !scene.has_parents() {
        return (Cow::Borrowed(wishes), 0);
    }
    let parts: Vec<u32> = scene.instances().iter().map(|instance| instance.part).collect();
    let arrived = |instance: usize| residency.part(parts[instance]).vertices_arrived() > 0;
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
        return (Cow::Borrowed(wishes), 0);
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
            drawn[i] = scene.parts()[parts[i] as usize].vertices;
        }
    }
    (Cow::Owned(drawn), replaced)
}
