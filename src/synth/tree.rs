//! Kits in, the assembly tree out: model, section, zone, system, assembly, part.
//!
//! Zones cut a section across its length. What a kit has in a zone is a *bay*: its parts, meshes, placements and nodes are
//! consecutive, so that a table of some thousand bays says where everything is, and nothing is stored for a part.

use glam::DAffine3;

use super::plan::PlannedKit;
use crate::import::{Instance, Material, Node};

/// Parts for a zone, and the most zones of a section.
const PARTS_A_ZONE: u32 = 300;
const MOST_ZONES: u32 = 24;

/// Every block of so many parts has one that is placed again and again.
const BLOCK: u32 = 16;

/// What a kit has in a zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bay {
    /// Which kit.
    pub kit: u32,
    /// Its first mesh.
    pub first_mesh: u32,
    /// How many parts.
    pub parts: u32,
    /// Its first placement.
    pub first_instance: u32,
    /// How many placements.
    pub slots: u32,
    /// Its first placement among those of the kit.
    pub first_slot: u32,
    /// The node of its system; assemblies and parts follow.
    node: u32,
    /// The node of its zone.
    zone: u32,
}

impl Bay {
    /// The first placement of a block of parts: each has its parts, then its share of repeated ones.
    fn start(&self, block: u32) -> u32 {
        let blocks = u64::from(self.parts.div_ceil(BLOCK));
        let extra = u64::from(self.slots - self.parts);
        (block * BLOCK).min(self.parts) + (u64::from(block) * extra / blocks) as u32
    }

    /// The part that a placement places, both counted from the bay's first.
    pub fn part_of(&self, slot: u32) -> u32 {
        let (mut low, mut high) = (0, self.parts.div_ceil(BLOCK) - 1);
        while low < high {
            let middle = (low + high).div_ceil(2);
            if self.start(middle) <= slot { low = middle } else { high = middle - 1 }
        }
        let (first, within) = (low * BLOCK, slot - self.start(low));
        let own = BLOCK.min(self.parts - first);
        if within < own { first + within } else { first }
    }

    /// The first placement of a part.
    pub fn slot_of(&self, part: u32) -> u32 {
        self.start(part / BLOCK) + part % BLOCK
    }

    /// Placements in an assembly: some dozens, and more where there are many assemblies.
    fn assembly(&self) -> u32 {
        (self.slots / 100).clamp(32, 400)
    }

    fn assemblies(&self) -> u32 {
        self.slots.div_ceil(self.assembly())
    }

    /// The node of a placement.
    fn node_of(&self, slot: u32) -> u32 {
        let size = self.assembly();
        self.node + 1 + slot / size * (size + 1) + 1 + slot % size
    }
}

/// The tree and all placements of a model.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// Placements of meshes by number, in the order of the tree.
    pub instances: Vec<Instance>,
    /// The assembly tree; parents first.
    pub nodes: Vec<Node>,
    /// The materials.
    pub materials: Vec<Material>,
}

/// The table of bays.
#[derive(Debug, Clone)]
pub struct Tree {
    model: &'static str,
    sections: Vec<&'static str>,
    bays: Vec<Bay>,
    nodes: u32,
}

impl Tree {
    /// Cuts the kits into zones.
    pub fn new(model: &'static str, sections: Vec<&'static str>, kits: &[PlannedKit]) -> Self {
        let mut tree = Self { model, sections, bays: Vec::new(), nodes: 1 };
        for section in 0..tree.sections.len() as u32 {
            let own: Vec<(u32, &PlannedKit)> =
                (0..).zip(kits).filter(|(_, kit)| kit.section == section).collect();
            let parts: u32 = own.iter().map(|(_, kit)| kit.parts).sum();
            let zones = (parts / PARTS_A_ZONE).clamp(1, MOST_ZONES);
            tree.nodes += 1;
            for zone in 0..zones {
                let node = tree.nodes;
                tree.nodes += 1;
                let before = tree.bays.len();
                for &(number, kit) in &own {
                    tree.add_bay(number, kit, [zone, zones], node);
                }
                if tree.bays.len() == before {
                    tree.nodes -= 1;
                }
            }
        }
        tree
    }

    fn add_bay(&mut self, number: u32, planned: &PlannedKit, [zone, zones]: [u32; 2], node: u32) {
        let of = |zone: u32, count: u32| (u64::from(count) * u64::from(zone) / u64::from(zones)) as u32;
        let [first, last] = [zone, zone + 1].map(|zone| of(zone, planned.parts));
        if first == last {
            return;
        }
        // Repeated placements go with the parts.
        let slot = |part: u32| {
            part + (u64::from(part) * u64::from(planned.slots - planned.parts) / u64::from(planned.parts))
                as u32
        };
        let before = self.bays.last().copied();
        let bay = Bay {
            kit: number,
            first_mesh: before.map_or(0, |bay| bay.first_mesh + bay.parts),
            parts: last - first,
            first_instance: before.map_or(0, |bay| bay.first_instance + bay.slots),
            slots: slot(last) - slot(first),
            first_slot: slot(first),
            node: self.nodes,
            zone: node,
        };
        self.nodes += 1 + bay.assemblies() + bay.slots;
        self.bays.push(bay);
    }

    /// All bays, in the order of the meshes.
    pub fn bays(&self) -> &[Bay] {
        &self.bays
    }

    /// The bay of a mesh.
    pub fn bay_of_mesh(&self, mesh: u32) -> &Bay {
        &self.bays[self.bays.partition_point(|bay| bay.first_mesh <= mesh) - 1]
    }

    /// How many placements there are.
    pub fn instance_count(&self) -> u32 {
        self.bays.last().map_or(0, |bay| bay.first_instance + bay.slots)
    }

    /// How many nodes there are.
    pub fn node_count(&self) -> u32 {
        self.nodes
    }

    /// All placements in order; `world_from_part` says where one is.
    pub fn instances<'a>(
        &'a self,
        kits: &'a [PlannedKit],
        world_from_part: impl Fn(&Bay, u32) -> DAffine3 + Copy + 'a,
    ) -> impl Iterator<Item = Instance> + 'a {
        self.bays.iter().flat_map(move |bay| {
            (0..bay.slots).map(move |slot| Instance {
                mesh: bay.first_mesh + bay.part_of(slot),
                node: bay.node_of(slot),
                material: kits[bay.kit as usize].kit.material,
                world_from_part: world_from_part(bay, slot),
            })
        })
    }

    /// All nodes in order, parents first.
    pub fn nodes(&self, kits: &[PlannedKit]) -> Vec<Node> {
        let mut nodes = Vec::with_capacity(self.nodes as usize);
        let mut add = |name: String, parent: Option<u32>| {
            nodes.push(Node { name, parent });
            nodes.len() as u32 - 1
        };
        add(self.model.to_owned(), None);
        let mut bays = self.bays.iter().peekable();
        for (number, name) in self.sections.iter().enumerate() {
            let section = add((*name).to_owned(), Some(0));
            let in_section = |bay: &Bay| kits[bay.kit as usize].section as usize == number;
            let mut zones = 0;
            while let Some(first) = bays.next_if(|bay| in_section(bay)) {
                zones += 1;
                let zone = add(format!("zone {}{zones:02}", number + 1), Some(section));
                add_bay_nodes(&mut add, first, &kits[first.kit as usize], zone);
                while let Some(bay) = bays.next_if(|bay| bay.zone == first.zone) {
                    add_bay_nodes(&mut add, bay, &kits[bay.kit as usize], zone);
                }
            }
        }
        nodes
    }
}

fn add_bay_nodes(
    add: &mut impl FnMut(String, Option<u32>) -> u32,
    bay: &Bay,
    planned: &PlannedKit,
    zone: u32,
) {
    let code = planned.kit.code;
    let system = add(planned.kit.system.to_owned(), Some(zone));
    let mut assembly = system;
    for slot in 0..bay.slots {
        if slot % bay.assembly() == 0 {
            assembly = add(format!("{code} assembly {}", slot / bay.assembly() + 1), Some(system));
        }
        add(format!("{code}-{}", bay.first_mesh + bay.part_of(slot)), Some(assembly));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_a_bay_is_placed_and_first_at_its_own_slot() {
        for (parts, slots) in [(1, 1), (1, 9), (16, 16), (17, 40), (100, 101), (50, 5000)] {
            let bay = Bay {
                kit: 0,
                first_mesh: 0,
                parts,
                first_instance: 0,
                slots,
                first_slot: 0,
                node: 0,
                zone: 0,
            };
            let placed: Vec<u32> = (0..slots).map(|slot| bay.part_of(slot)).collect();
            for part in 0..parts {
                let first = placed.iter().position(|&other| other == part);
                assert_eq!(first, Some(bay.slot_of(part) as usize), "{part} of {parts}, {slots}");
            }
            assert!(placed.iter().all(|&part| part < parts));
        }
    }
}
