//! A model as its files have it in, one out whose vertex colours have the base colours of their materials in them.
//!
//! A vertex colour multiplies the base colour of the material, in linear light (glTF 2.0, section 3.9.2). What is drawn
//! and written of a coloured part is its vertex colours alone, so they are multiplied here, and the materials of its
//! placements become white. A mesh placed with several materials becomes one mesh for each.

use rustc_hash::{FxHashMap, FxHashSet};

use super::attributes::{WHITE, linear_from_srgb, srgb_from_linear};
use super::{Colour, Material, Model, Problem, Shelf, index_of};

/// Has vertex colours multiplied by base colours.
///
/// The default material counts as white: that nothing was said of a surface does not make its vertices grey.
///
/// # Errors
///
/// [`Problem::TooMany`].
pub(super) fn apply(model: &mut Model<Shelf>) -> Result<(), Problem> {
    let mut tints = Tints::default();
    for place in 0..model.instances.len() {
        let (mesh, material) = (model.instances[place].mesh, model.instances[place].material);
        if model.meshes.meshes()[mesh as usize].is_coloured {
            let instance = &mut model.instances[place];
            instance.mesh = tints.mesh_with(mesh, material, &mut model.meshes)?;
            instance.material = tints.white_like(material, &mut model.materials)?;
        }
    }
    for (&(_, material), &mesh) in &tints.meshes {
        if material != 0 {
            let tint = model.materials[material as usize].base_colour;
            model.meshes.meshes_mut()[mesh as usize].tint = Some(tint);
        }
    }
    Ok(())
}

#[derive(Default)]
struct Tints {
    /// The mesh that stands for a mesh with a material; the first material's is the mesh itself.
    meshes: FxHashMap<(u32, u32), u32>,
    /// Meshes that have a material already.
    taken: FxHashSet<u32>,
    /// The white material that stands for a material.
    white: FxHashMap<u32, u32>,
}

impl Tints {
    fn mesh_with(&mut self, mesh: u32, material: u32, meshes: &mut Shelf) -> Result<u32, Problem> {
        if let Some(&known) = self.meshes.get(&(mesh, material)) {
            return Ok(known);
        }
        let own = if self.taken.insert(mesh) { mesh } else { meshes.repeat(mesh)? };
        self.meshes.insert((mesh, material), own);
        Ok(own)
    }

    /// A material of the same name and alpha that is white otherwise.
    fn white_like(&mut self, material: u32, materials: &mut Vec<Material>) -> Result<u32, Problem> {
        if let Some(&known) = self.white.get(&material) {
            return Ok(known);
        }
        let Material { name, base_colour: [.., alpha] } = &materials[material as usize];
        let white = Material { name: name.clone(), base_colour: [255, 255, 255, *alpha] };
        let is_white = materials[material as usize] == white;
        let own = if is_white {
            material
        } else {
            materials.push(white);
            index_of(materials.len() - 1)?
        };
        self.white.insert(material, own);
        Ok(own)
    }
}

/// Multiplies colours in linear light; alpha stays with the material.
pub(super) fn multiply(colours: &mut [Colour], tint: Colour) {
    if tint[..3] == WHITE[..3] {
        return;
    }
    let tint = linear_from_srgb(tint);
    for colour in colours {
        let [r, g, b, a] = linear_from_srgb(*colour);
        *colour = srgb_from_linear([r * tint[0], g * tint[1], b * tint[2], a]);
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::import::{Instance, SourceMesh};

    #[test]
    fn coloured_meshes_take_the_colours_of_their_materials() {
        let coloured = SourceMesh { colours: vec![[255, 128, 0, 255], [255; 4]], ..SourceMesh::default() };
        let material = |base_colour| Material { name: "m".to_owned(), base_colour };
        let place =
            |mesh, material| Instance { mesh, node: 0, material, world_from_part: DAffine3::IDENTITY };
        let mut model = Model {
            meshes: Shelf::of(vec![coloured.clone(), SourceMesh::default()]),
            materials: vec![Material::default(), material([255, 0, 188, 100]), material([255; 4])],
            instances: vec![place(0, 1), place(1, 1), place(0, 0), place(0, 2), place(0, 1), place(0, 0)],
            ..Model::default()
        };
        apply(&mut model).unwrap();
        let meshes: Vec<SourceMesh> = (0..4).map(|mesh| model.meshes.give(mesh).unwrap()).collect();
        let seen: Vec<_> = model
            .instances
            .iter()
            .map(|i| {
                (
                    i.mesh,
                    meshes[i.mesh as usize].colours.clone(),
                    model.materials[i.material as usize].clone(),
                )
            })
            .collect();
        let tinted = vec![[255, 0, 0, 255], [255, 0, 188, 255]];
        let white = |alpha| material([255, 255, 255, alpha]);
        let nameless = Material { name: String::new(), ..white(255) };
        assert_eq!(seen[0], (0, tinted.clone(), white(100)));
        assert_eq!(
            seen[1],
            (1, vec![], material([255, 0, 188, 100])),
            "a mesh without colours keeps its material"
        );
        assert_eq!(seen[2], (2, coloured.colours.clone(), nameless.clone()), "the default counts as white");
        assert_eq!(seen[3], (3, coloured.colours.clone(), white(255)));
        assert_eq!(seen[4], (0, tinted, white(100)));
        assert_eq!(seen[5], (2, coloured.colours.clone(), nameless));
        assert_eq!((model.meshes.len(), model.materials.len()), (4, 5));
    }
}
