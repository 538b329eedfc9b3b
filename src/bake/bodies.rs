//! A model's meshes and placements in, its bodies out: meshes that were one in the file, and where all of them are
//! placed together.

use glam::DAffine3;
use rustc_hash::FxHashMap;

use crate::import::{Instance, Model, SourceMesh};

/// The meshes of the model that were one mesh of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Their numbers in the model, ascending; only those that are placed.
    pub meshes: Vec<usize>,
    /// Where they are placed together, each with a material for each mesh; `None` if some are placed without others.
    pub placements: Option<Vec<Placement>>,
}

/// A placement of all meshes of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The number of the first of its instances in the model.
    pub first: usize,
    /// The node of the assembly tree.
    pub node: u32,
    /// Part space to world space.
    pub world_from_part: DAffine3,
    /// The material of each mesh.
    pub materials: Vec<u32>,
}

/// The bodies of a model, in the order of their first meshes.
pub fn bodies(model: &Model) -> Vec<Body> {
    let mut placed: Vec<Vec<usize>> = model.meshes.iter().map(|_| Vec::new()).collect();
    for (number, instance) in model.instances.iter().enumerate() {
        placed[instance.mesh as usize].push(number);
    }
    let mut meshes: Vec<Vec<usize>> = model.meshes.iter().map(|_| Vec::new()).collect();
    for (number, mesh) in model.meshes.iter().enumerate().filter(|&(number, _)| !placed[number].is_empty()) {
        meshes[mesh.body as usize].push(number);
    }
    let bodies = meshes.into_iter().filter(|meshes| !meshes.is_empty());
    bodies.map(|meshes| Body { placements: together(&model.instances, &meshes, &placed), meshes }).collect()
}

/// The placements of some meshes, if every node that places one places each of them once, in the same way.
fn together(instances: &[Instance], meshes: &[usize], placed: &[Vec<usize>]) -> Option<Vec<Placement>> {
    type Place = (u32, [u64; 12]);
    let mut places: FxHashMap<Place, Placement> = FxHashMap::default();
    for (k, &mesh) in meshes.iter().enumerate() {
        if placed[mesh].len() != placed[meshes[0]].len() {
            return None;
        }
        for &number in &placed[mesh] {
            let Instance { node, material, world_from_part, .. } = instances[number];
            let bits = world_from_part.to_cols_array().map(f64::to_bits);
            let place = places.entry((node, bits)).or_insert_with(|| Placement {
                first: number,
                node,
                world_from_part,
                materials: Vec::with_capacity(meshes.len()),
            });
            place.first = place.first.min(number);
            // In turn, so a mesh that is there twice or not at all shows.
            if place.materials.len() != k {
                return None;
            }
            place.materials.push(material);
        }
    }
    let mut places: Vec<Placement> = places.into_values().collect();
    places.sort_by_key(|place| place.first);
    places.iter().all(|place| place.materials.len() == meshes.len()).then_some(places)
}

impl Body {
    /// Takes its meshes out of a model, which keeps their names.
    pub fn take(&self, model: &mut Model) -> Vec<SourceMesh> {
        let take = |&number: &usize| {
            let mesh = &mut model.meshes[number];
            let name = mesh.name.clone();
            std::mem::replace(mesh, SourceMesh { name, ..SourceMesh::default() })
        };
        self.meshes.iter().map(take).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(bodies: &[u32], placed: &[(u32, u32, u32)]) -> Model {
        let mesh = |&body| SourceMesh { body, ..SourceMesh::default() };
        let instance =
            |&(mesh, node, material)| Instance { mesh, node, material, world_from_part: DAffine3::IDENTITY };
        Model {
            meshes: bodies.iter().map(mesh).collect(),
            instances: placed.iter().map(instance).collect(),
            ..Model::default()
        }
    }

    #[test]
    fn meshes_of_a_body_are_placed_together_with_their_materials() {
        let placed = [(0, 5, 1), (2, 5, 2), (1, 6, 3), (2, 7, 4), (0, 7, 5), (1, 6, 6)];
        let found = bodies(&model(&[0, 1, 0, 3], &placed));
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].meshes, [0, 2]);
        let places = found[0].placements.as_ref().unwrap();
        let seen: Vec<_> =
            places.iter().map(|place| (place.first, place.node, &place.materials[..])).collect();
        assert_eq!(seen, [(0, 5, &[1, 2][..]), (3, 7, &[5, 4])]);
        // The same mesh twice at one place is no body of two.
        assert_eq!((&found[1].meshes[..], &found[1].placements), (&[1][..], &None));
    }

    #[test]
    fn meshes_that_are_placed_without_each_other_are_not_together() {
        for placed in [
            &[(0, 5, 1), (1, 6, 1)][..],
            &[(0, 5, 1), (1, 5, 1), (0, 6, 1)],
            &[(0, 5, 1), (0, 5, 1), (1, 5, 1), (1, 5, 1)],
        ] {
            assert_eq!(bodies(&model(&[0, 0], placed))[0].placements, None);
        }
    }
}
