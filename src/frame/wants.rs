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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::bake::{BakeOptions, BakeProgress, bake};

    /// Quads of many vertices each; the first is cut into cells below a parent cell, and the others are one part in several
    /// places.
    fn scene() -> Scene {
        let folder = tempfile::tempdir().unwrap();
        let [source, container] = ["a.gltf", "a.clps"].map(|name| folder.path().join(name));
        std::fs::write(&source, gltf(&[280, 24], &[0, 1, 1, 1, 0])).unwrap();
        bake(&[source], &container, &BakeOptions::default(), &BakeProgress::default()).unwrap();
        Scene::open(&container).unwrap()
    }

    /// A glTF file of square sheets of `sizes` vertices a side, of which `placed` are in the scene.
    fn gltf(sizes: &[u32], placed: &[usize]) -> String {
        use base64::Engine;
        let (mut views, mut accessors, mut meshes, mut bytes) = (vec![], vec![], vec![], Vec::<u8>::new());
        for (mesh, &n) in sizes.iter().enumerate() {
            let at = |i: u32| [(i % n) as f32, (i / n) as f32, (i % 89 % 7) as f32 * 0.1];
            let positions: Vec<f32> = (0..n * n).flat_map(at).collect();
            let corner = |i: u32| (i / (n - 1)) * n + i % (n - 1);
            let quad = |c: u32| [c, c + 1, c + n, c + 1, c + n + 1, c + n];
            let indices: Vec<u32> = (0..(n - 1) * (n - 1)).map(corner).flat_map(quad).collect();
            for piece in [bytemuck::cast_slice::<f32, u8>(&positions), bytemuck::cast_slice(&indices)] {
                views.push(
                    serde_json::json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": piece.len()}),
                );
                bytes.extend_from_slice(piece);
            }
            let most = (n - 1) as f32;
            accessors.push(serde_json::json!({"bufferView": 2 * mesh, "componentType": 5126, "type": "VEC3",
                "count": n * n, "min": [0.0, 0.0, 0.0], "max": [most, most, 0.6]}));
            accessors.push(serde_json::json!({"bufferView": 2 * mesh + 1, "componentType": 5125,
                "type": "SCALAR", "count": indices.len()}));
            meshes.push(serde_json::json!({"primitives": [{"attributes": {"POSITION": 2 * mesh}, "indices": 2 * mesh + 1}]}));
        }
        let node = |(i, mesh): (usize, &usize)| serde_json::json!({"mesh": mesh, "translation": [300.0 * i as f32, 0, 0]});
        let nodes: Vec<_> = placed.iter().enumerate().map(node).collect();
        let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
        let uri = format!("data:application/octet-stream;base64,{data}");
        serde_json::json!({"asset": {"version": "2.0"}, "scene": 0,
            "scenes": [{"nodes": (0..placed.len()).collect::<Vec<_>>()}], "nodes": nodes, "meshes": meshes,
            "accessors": accessors, "bufferViews": views,
            "buffers": [{"uri": uri, "byteLength": bytes.len()}]})
        .to_string()
    }

    /// What is wanted of every part, by a look at all wishes.
    fn of_all(scene: &Scene, wishes: &[u32], px: impl Fn(u32) -> f64) -> BTreeMap<u32, (u32, f32)> {
        let mut wanted: BTreeMap<u32, (u32, f32)> = BTreeMap::new();
        let mut want = |instance: u32, wish: Option<u32>| {
            let part = scene.instances()[instance as usize].part;
            let sizes = scene.tiers(part).iter().map(|tier| tier.vertices);
            let coarsest = sizes.len() as u32 - 1;
            let tier = wish.map_or(coarsest, |wish| coarsest_tier_with(sizes, wish));
            let known = wanted.entry(part).or_insert((tier, 0.0));
            *known = (known.0.min(tier), known.1 + (px(instance) as f32).powi(3));
        };
        for instance in (0..wishes.len() as u32).filter(|&instance| wishes[instance as usize] > 0) {
            want(instance, Some(wishes[instance as usize]));
            let mut above = scene.parent_instance(instance);
            while let Some(parent) = above {
                want(parent, None);
                above = scene.parent_instance(parent);
            }
        }
        wanted
    }

    proptest! {
        /// Following changes comes to what a look at all wishes finds, and tells of every part whose tier is another.
        #[test]
        fn following_is_a_look_at_everything(
            steps in prop::collection::vec(prop::collection::vec((0.0..1.0f64, 0.0..1.3f64), 0..20), 1..12),
        ) {
            static SCENE: std::sync::OnceLock<Scene> = std::sync::OnceLock::new();
            let scene = SCENE.get_or_init(scene);
            let count = scene.instances().len();
            prop_assert!(scene.has_parents() && scene.parts().len() < count);
            let (mut wants, mut wishes) = (Wants::new(scene), vec![0; count]);
            let mut known: BTreeMap<u32, u32> = BTreeMap::new();
            let px = |instance: u32| f64::from(instance + 1);
            for step in steps {
                let mut changes = Vec::new();
                for (instance, share) in step {
                    let instance = (instance * count as f64) as u32;
                    let part = &scene.parts()[scene.instances()[instance as usize].part as usize];
                    let new = ((share - 0.3).max(0.0) * f64::from(part.vertices)) as u32;
                    let old = std::mem::replace(&mut wishes[instance as usize], new);
                    if old != new {
                        changes.push(WishChange { instance, old, new });
                    }
                }
                for Change { part, tier } in wants.follow(scene, &changes) {
                    match tier {
                        Some(tier) => known.insert(part, tier),
                        None => known.remove(&part),
                    };
                }
                let all = of_all(scene, &wishes, px);
                let tiers: BTreeMap<u32, u32> = all.iter().map(|(&part, want)| (part, want.0)).collect();
                prop_assert_eq!(&known, &tiers);
                for (&part, &(_, weight)) in &all {
                    let found = wants.weight(part, &wishes, px);
                    prop_assert!((found - weight).abs() <= 1e-5 * weight, "{} instead of {}", found, weight);
                }
            }
        }
    }
}
