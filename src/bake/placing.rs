//! The outline of a model and which parts its meshes became in; the container's instances, one after another, out.

use std::ops::Range;

use rustc_hash::FxHashMap;

use super::bodies::{Body, MaterialRuns};
use super::ledger::Ledger;
use super::source::Outline;
use crate::container::StoredInstance;
use crate::import::{Instance, Material};

/// Which parts every placement of the model places.
pub(super) struct Placing<'a> {
    instances: &'a [Instance],
    /// The parts of every mesh that is placed alone; none of one that is part of a merged body.
    parts_of_mesh: Vec<Range<u32>>,
    /// By the number of its first instance: the parts of a merged body, and the first of its materials.
    merged: FxHashMap<usize, (Range<u32>, u32)>,
    /// The model's materials, and copies where those of a placement have to follow each other.
    pub materials: Vec<Material>,
}

impl<'a> Placing<'a> {
    /// Numbers the parts of all bodies, in order.
    pub fn new(outline: &'a Outline, bodies: &[Body], ledger: &Ledger) -> Self {
        let mut this = Self {
            instances: &outline.instances,
            parts_of_mesh: vec![0..0; outline.meshes.len()],
            merged: FxHashMap::default(),
            materials: outline.materials.clone(),
        };
        let mut runs = MaterialRuns::default();
        let mut next = 0;
        for (number, body) in bodies.iter().enumerate() {
            for (mesh, row) in ledger.meshes(number).iter().enumerate() {
                let parts = next..next + row.cells as u32;
                next = parts.end;
                match body.placements.as_ref().filter(|_| body.is_merged) {
                    None => this.parts_of_mesh[body.meshes[mesh]] = parts,
                    Some(places) => this.merged.extend(places.iter().map(|place| {
                        let material = runs.first_of(&place.materials, &mut this.materials);
                        (place.first, (parts.clone(), material))
                    })),
                }
            }
        }
        this
    }

    /// The parts that one of the model's instances places, and their material.
    fn placed(&self, number: usize) -> (Range<u32>, u32) {
        let instance = &self.instances[number];
        match self.merged.get(&number) {
            Some(merged) => merged.clone(),
            None => (self.parts_of_mesh[instance.mesh as usize].clone(), instance.material),
        }
    }

    /// The container's instances, in the order of the model's.
    pub fn instances(&self) -> impl Iterator<Item = StoredInstance> {
        self.instances.iter().enumerate().flat_map(|(number, instance)| {
            let (parts, material) = self.placed(number);
            let Instance { node, world_from_part, .. } = *instance;
            parts.map(move |part| StoredInstance { part, node, material, world_from_part })
        })
    }

    /// How often each part is placed.
    pub fn counts(&self, parts: usize) -> Vec<u32> {
        let mut counts = vec![0; parts];
        for number in 0..self.instances.len() {
            for part in self.placed(number).0 {
                counts[part as usize] += 1;
            }
        }
        counts
    }
}
