//! A model's meshes and placements in, its bodies out: meshes that were one in the file and are one again.
//!
//! An importer makes a mesh for each material. Ordered apart, such meshes would have to keep every vertex of the borders
//! between them. So the meshes of a body that are placed together always become one mesh, whose vertices carry a slot
//! for their material; the materials of a placement follow each other in the table.

use glam::DAffine3;
use rustc_hash::FxHashMap;

use super::source::{MeshSource, Outline};
use crate::geometry::record::MAX_SLOTS;
use crate::import::{ImportError, Instance, Material, SourceMesh};

/// The meshes of the model that were one mesh of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Their numbers in the model, ascending; only those that are placed.
    pub meshes: Vec<usize>,
    /// Where they are placed together, each with a material for each mesh; `None` for one mesh alone, and if some are
    /// placed without others.
    pub placements: Option<Vec<Placement>>,
    /// Whether its meshes become one: they are placed together, slots number them, and vertices have room for a slot.
    pub is_merged: bool,
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
pub fn bodies(outline: &Outline) -> Vec<Body> {
    let Outline { meshes, instances, .. } = outline;
    let mut is_placed = vec![false; meshes.len()];
    instances.iter().for_each(|instance| is_placed[instance.mesh as usize] = true);
    let mut meshes_of: Vec<Vec<usize>> = vec![Vec::new(); meshes.len()];
    for (number, mesh) in meshes.iter().enumerate().filter(|&(number, _)| is_placed[number]) {
        meshes_of[mesh.body as usize].push(number);
    }
    let several: Vec<usize> = meshes_of.iter().filter(|body| body.len() > 1).flatten().copied().collect();
    let placed = instances_of(instances, &several);
    let body = |own: Vec<usize>| {
        // One alone is placed as it is.
        let placements = if own.len() > 1 { together(instances, &own, &placed) } else { None };
        let plain = own.iter().all(|&mesh| !meshes[mesh].coloured);
        Body { is_merged: placements.is_some() && own.len() <= MAX_SLOTS && plain, meshes: own, placements }
    };
    meshes_of.into_iter().filter(|meshes| !meshes.is_empty()).map(body).collect()
}

/// For each of some meshes the numbers of the instances that place it.
fn instances_of(instances: &[Instance], meshes: &[usize]) -> FxHashMap<usize, Vec<usize>> {
    let mut placed: FxHashMap<usize, Vec<usize>> = meshes.iter().map(|&mesh| (mesh, Vec::new())).collect();
    for (number, instance) in instances.iter().enumerate() {
        if let Some(own) = placed.get_mut(&(instance.mesh as usize)) {
            own.push(number);
        }
    }
    placed
}

/// The placements of some meshes, if every node that places one places each of them once, in the same way.
fn together(
    instances: &[Instance],
    meshes: &[usize],
    placed: &FxHashMap<usize, Vec<usize>>,
) -> Option<Vec<Placement>> {
    type Place = (u32, [u64; 12]);
    let mut places: FxHashMap<Place, Placement> = FxHashMap::default();
    for (k, &mesh) in meshes.iter().enumerate() {
        if placed[&mesh].len() != placed[&meshes[0]].len() {
            return None;
        }
        for &number in &placed[&mesh] {
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
    /// Loads its meshes.
    ///
    /// # Errors
    /// Those of the source.
    pub fn load(&self, source: &dyn MeshSource) -> Result<Vec<SourceMesh>, ImportError> {
        self.meshes.iter().map(|&mesh| source.load(mesh)).collect()
    }

    /// The triangles of all its meshes.
    pub fn triangles(&self, outline: &Outline) -> u64 {
        self.meshes.iter().map(|&mesh| outline.meshes[mesh].triangles).sum()
    }
}

/// One mesh of several that have normals, under the name of the first; one alone stays as it is.
pub fn merged(meshes: Vec<SourceMesh>) -> SourceMesh {
    let several = meshes.len() > 1;
    let mut meshes = meshes.into_iter();
    let mut one = meshes.next().unwrap_or_default();
    if several {
        one.slots = vec![0; one.positions.len()];
    }
    for (mesh, slot) in meshes.zip(1..=u8::MAX) {
        let base = one.positions.len() as u32;
        one.positions.extend(mesh.positions);
        one.normals.extend(mesh.normals);
        one.slots.resize(one.positions.len(), slot);
        one.triangles.extend(mesh.triangles.into_iter().map(|t| t.map(|vertex| base + vertex)));
    }
    one
}

/// The table of materials, in which those of a placement follow each other.
#[derive(Debug, Default)]
pub struct MaterialRuns {
    known: FxHashMap<Vec<u32>, u32>,
}

impl MaterialRuns {
    /// The first of a run of these materials; copies of them are appended where the table has no such run.
    pub fn first_of(&mut self, run: &[u32], materials: &mut Vec<Material>) -> u32 {
        if run.windows(2).all(|pair| pair[1] == pair[0] + 1) {
            return run.first().copied().unwrap_or(0);
        }
        *self.known.entry(run.to_vec()).or_insert_with(|| {
            let first = materials.len() as u32;
            let copies: Vec<Material> = run.iter().map(|&m| materials[m as usize].clone()).collect();
            materials.extend(copies);
            first
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::source::MeshOutline;
    use super::*;

    fn model(bodies: &[u32], placed: &[(u32, u32, u32)]) -> Outline {
        let mesh = |&body| MeshOutline { body, ..MeshOutline::default() };
        let instance =
            |&(mesh, node, material)| Instance { mesh, node, material, world_from_part: DAffine3::IDENTITY };
        Outline {
            meshes: bodies.iter().map(mesh).collect(),
            instances: placed.iter().map(instance).collect(),
            ..Outline::default()
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
        assert_eq!((&found[1].meshes[..], &found[1].placements), (&[1][..], &None));
    }

    #[test]
    fn runs_of_materials_are_copied_only_where_there_are_none() {
        let named = |name: &str| Material { name: name.into(), ..Material::default() };
        let mut materials = vec![named("a"), named("b"), named("c")];
        let mut runs = MaterialRuns::default();
        let firsts = [&[1, 2][..], &[2], &[2, 0], &[0, 1, 2], &[2, 0], &[1, 1]]
            .map(|run| runs.first_of(run, &mut materials));
        assert_eq!(firsts, [1, 2, 3, 0, 3, 5]);
        let names: Vec<_> = materials.iter().map(|material| &material.name[..]).collect();
        assert_eq!(names, ["a", "b", "c", "c", "a", "b", "b"]);
    }

    #[test]
    fn merged_meshes_carry_slots() {
        let mesh = |x: f32| SourceMesh {
            positions: vec![[x; 3]; 2],
            triangles: vec![[0, 1, 1]],
            ..SourceMesh::default()
        };
        assert!(merged(vec![mesh(1.0)]).slots.is_empty());
        let one = merged(vec![mesh(1.0), mesh(2.0)]);
        assert_eq!((&one.slots[..], &one.triangles[..]), (&[0, 0, 1, 1][..], &[[0, 1, 1], [2, 3, 3]][..]));
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
