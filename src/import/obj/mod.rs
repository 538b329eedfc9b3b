//! A Wavefront OBJ file in, a [`Model`] out.
//!
//! The [`Text`] is read once: vertices go to tables, and faces, with absolute indices, to a list of runs by object, group
//! and material, of which little stays in memory. Then the polygons of one such chunk after another are cut into
//! triangles, and each chunk becomes one part with one instance. Nodes: an object at the root, its groups below it.

mod faces;
mod materials;
mod mesh;
mod statements;
mod text;
mod vertices;

use glam::DAffine3;
use rustc_hash::FxHashMap;

use super::input::{Input, stem_of};
use super::notes::{Notes, quoted};
use super::{Instance, Model, Node, Problem, Shelf, SourceMesh, index_of, part_name};
use faces::Chunk;
use materials::Materials;
use text::{Names, Text};

/// Reads one OBJ file and the material libraries beside it.
///
/// # Errors
///
/// [`Problem::Line`] for a vertex that is no three numbers, [`Problem::Read`] if the file cannot be read,
/// [`Problem::TooLittleMemory`] if its vertices do not fit the memory. Bad faces are skipped and noted.
pub(super) fn read(input: &Input<'_>, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
    let Text { vertices, mut faces, names, libraries, mut notes, .. } =
        Text::read(input.open()?, shelf.room())?;
    let materials = materials::read(input.path, &libraries, &mut notes);
    let mut assembly = Assembly::new(materials, &names, stem_of(input.path), shelf);
    for (gathered, runs) in faces.by_chunk() {
        let mesh = mesh::build(&vertices, gathered, runs, &mut notes)?;
        if !mesh.triangles.is_empty() {
            assembly.place(gathered.chunk, mesh, &mut notes)?;
        }
    }
    let mut model = assembly.model;
    model.notes = notes.into_lines();
    Ok(model)
}

/// The model while it grows.
struct Assembly<'a> {
    model: Model<Shelf>,
    materials: FxHashMap<String, u32>,
    names: &'a Names,
    stem: String,
    /// Nodes by object and group name.
    nodes: FxHashMap<(u32, u32), Placed>,
}

/// A node, and how many parts it places so far.
#[derive(Clone, Copy)]
struct Placed {
    node: u32,
    parts: usize,
    /// The first of these parts.
    body: u32,
}

impl<'a> Assembly<'a> {
    fn new(materials: Materials, names: &'a Names, stem: String, meshes: Shelf) -> Self {
        let model = Model { meshes, materials: materials.list, ..Model::default() };
        Self { model, materials: materials.by_name, names, stem, nodes: FxHashMap::default() }
    }

    /// Makes a part of the mesh, and an instance at the node of its group.
    fn place(&mut self, chunk: Chunk, mut mesh: SourceMesh, notes: &mut Notes) -> Result<(), Problem> {
        let placed = self.node_of(chunk.object, chunk.group)?;
        let node = &self.model.nodes[placed.node as usize];
        mesh.name = part_name(&node.name, placed.parts);
        let material = self.material_of(chunk, notes);
        let number = index_of(self.model.meshes.len())?;
        mesh.body = if placed.parts == 0 { number } else { placed.body };
        let body = mesh.body;
        let instance =
            Instance { mesh: number, node: placed.node, material, world_from_part: DAffine3::IDENTITY };
        self.model.meshes.push(mesh)?;
        self.model.instances.push(instance);
        self.nodes.insert((chunk.object, chunk.group), Placed { parts: placed.parts + 1, body, ..placed });
        Ok(())
    }

    /// The node of an object's group, made when first asked for.
    fn node_of(&mut self, object: u32, group: u32) -> Result<Placed, Problem> {
        if let Some(&placed) = self.nodes.get(&(object, group)) {
            return Ok(placed);
        }
        let parent = match (object, group) {
            (0, _) | (_, 0) => None,
            _ => Some(self.node_of(object, 0)?.node),
        };
        let name = match if group == 0 { object } else { group } {
            0 => self.stem.clone(),
            named => self.names.get(named).to_owned(),
        };
        let placed = Placed { node: index_of(self.model.nodes.len())?, parts: 0, body: 0 };
        self.model.nodes.push(Node { name, parent });
        self.nodes.insert((object, group), placed);
        Ok(placed)
    }

    /// The chunk's material; the default where none of that name is defined.
    fn material_of(&self, chunk: Chunk, notes: &mut Notes) -> u32 {
        let name = self.names.get(chunk.material);
        if name.is_empty() {
            return 0;
        }
        // A name may hold a number sign, or be followed by a comment.
        let bare = name.split(" #").next().unwrap_or(name).trim_end();
        self.materials.get(name).or_else(|| self.materials.get(bare)).copied().unwrap_or_else(|| {
            let what = "parts use a material that is not defined, and get the default";
            notes.count(what, 1, || quoted(name));
            0
        })
    }
}
