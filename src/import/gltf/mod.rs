//! A glTF 2.0 or GLB file in, a [`Model`] out.
//!
//! [`document`] opens the container and the JSON, [`buffers`] fetches the bytes, [`compressed`] unpacks some of
//! them, [`accessor`] reads numbers
//! out of them, [`geometry`] makes a mesh of a primitive, [`nodes`] walks the tree, with the copies that
//! [`instancing`] finds, and this module places one at the other.
//!
//! The `gltf` crate supplies the JSON structures; its validation is not used, because it refuses whole files
//! for one useless primitive and indexes tables before it has checked the index. Every index, count and
//! offset is checked here, where it is used.

mod accessor;
mod base64;
mod buffers;
mod compressed;
mod document;
mod geometry;
mod instancing;
mod materials;
mod nodes;

use ::gltf::json::Root;
use ::gltf::json::mesh::{Mesh, Primitive};
use rustc_hash::FxHashMap;

use super::input::Input;
use super::notes::{Notes, quoted};
use super::{Instance, Material, Model, Problem, Shelf, check_instance_count, index_of, part_name};
use buffers::Buffers;
use geometry::{Geometry, GeometryKey};
use instancing::Instancing;
use nodes::Placed;

/// Bytes of memory that tables take for each byte of the text that they come from.
const TEXT_FACTOR: u64 = 6;

/// After so many bytes of buffers the memory of the pages that were read is given back.
const BYTES_TO_RELEASE: u64 = 16 << 20;

/// Reads one glTF or GLB file and the buffers beside it.
///
/// # Errors
///
/// [`Problem`] for a container, JSON, buffer or accessor that does not hold together, a node tree that is
/// none, or a required extension that is not supported. Primitives that are no triangles, triangles with bad
/// corners, and placements that are not finite are skipped and noted.
pub(super) fn read(input: &Input<'_>, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
    let bytes = input.bytes()?;
    let need_bytes = bytes.held() + document::text_bytes(&bytes) * TEXT_FACTOR;
    shelf.room().check(need_bytes, "the text of this glTF and its tables take")?;
    let document = document::parse(&bytes)?;
    let buffers = buffers::load(&document, input.path)?;
    let instancing = Instancing::of(&document, &buffers)?;
    let need_bytes = need_bytes.saturating_add(instancing.need_bytes());
    shelf.room().check(need_bytes, "the text of this glTF, its tables and the copies of its meshes take")?;
    let placed = nodes::walk(&document.root, instancing)?;
    let materials = materials::read(&document);
    let release = || {
        bytes.release();
        buffers.release();
    };
    Importer::new(&document.root, &buffers, materials, shelf).import(placed, &release)
}

struct Importer<'a> {
    root: &'a Root,
    geometry: Geometry<'a>,
    /// Meshes by what they are made of; `None` where nothing could be made of it.
    meshes: FxHashMap<GeometryKey, Option<u32>>,
    model: Model<Shelf>,
    notes: Notes,
}

impl<'a> Importer<'a> {
    fn new(root: &'a Root, buffers: &'a Buffers<'a>, materials: Vec<Material>, meshes: Shelf) -> Self {
        Self {
            root,
            geometry: Geometry::new(root, buffers),
            meshes: FxHashMap::default(),
            model: Model { meshes, materials, ..Model::default() },
            notes: Notes::default(),
        }
    }

    /// Places the primitives of every node's mesh; `release` is called now and then.
    fn import(mut self, placed: Vec<Placed>, release: &dyn Fn()) -> Result<Model<Shelf>, Problem> {
        let mut read = 0;
        for (number, node) in placed.into_iter().enumerate() {
            self.place_mesh(number as u32, &node)?;
            if self.geometry.bytes_reached() - read > BYTES_TO_RELEASE {
                read = self.geometry.bytes_reached();
                release();
            }
            self.model.nodes.push(node.node);
        }
        self.geometry.take_notes(&mut self.notes);
        self.model.notes = self.notes.into_lines();
        Ok(self.model)
    }

    fn place_mesh(&mut self, number: u32, placed: &Placed) -> Result<(), Problem> {
        let Some(index) = placed.mesh else { return Ok(()) };
        let name = &placed.node.name;
        let Some(mesh) = self.root.meshes.get(index) else {
            return Err(Problem::Malformed(format!(
                "node {} names mesh {index}, which is not there",
                quoted(name)
            )));
        };
        if !placed.world.is_finite() {
            let what = "nodes with a mesh skipped whose transform is not finite";
            self.notes.count(what, 1, || quoted(name));
            return Ok(());
        }
        // A part is named alike for all its copies, which have names of their own.
        let root: &'a Root = self.root;
        let of_node = root.nodes.get(placed.index).and_then(|node| node.name.as_ref());
        let own = mesh.name.as_ref().filter(|own| !own.is_empty());
        let part = own.or(of_node).map_or("", String::as_str);
        self.note_what_moves(placed, mesh);
        check_instance_count(self.model.instances.len() + mesh.primitives.len())?;
        let new = self.model.meshes.len();
        let mut body = index_of(new)?;
        for (nth, primitive) in mesh.primitives.iter().enumerate() {
            let Some(mesh) = self.mesh_of(primitive, part, nth)? else { continue };
            // A mesh that shares some of its geometry with an earlier one is of that one's body.
            body = self.model.meshes.meshes()[..new]
                .get(mesh as usize)
                .map_or(body, |known| body.min(known.body));
            let material = self.material_of(primitive, part);
            let instance = Instance { mesh, node: number, material, world_from_part: placed.world };
            self.model.instances.push(instance);
        }
        self.model.meshes.meshes_mut()[new..].iter_mut().for_each(|mesh| mesh.body = body);
        Ok(())
    }

    /// Notes what would bend a mesh: parts of an assembly are rigid.
    fn note_what_moves(&mut self, placed: &Placed, mesh: &Mesh) {
        let name = || quoted(&placed.node.name);
        let Some(node) = self.root.nodes.get(placed.index) else { return };
        if node.skin.is_some() {
            self.notes.count("meshes stay as their files have them, for skins are not read", 1, name);
        }
        let mut weights = node.weights.iter().chain(&mesh.weights).flatten();
        let has_targets = mesh.primitives.iter().any(|primitive| primitive.targets.is_some());
        if has_targets && weights.any(|&weight| weight != 0.0) {
            self.notes.count("meshes stay as their files have them, for morph targets are not read", 1, name);
        }
    }

    /// The mesh of a primitive: the same one for all primitives made of the same accessors.
    fn mesh_of(&mut self, primitive: &Primitive, name: &str, nth: usize) -> Result<Option<u32>, Problem> {
        let Some(key) = GeometryKey::of(primitive, name, &mut self.notes) else { return Ok(None) };
        if let Some(&known) = self.meshes.get(&key) {
            return Ok(known);
        }
        let mesh = self.geometry.read(key, name)?;
        let index = match mesh {
            Some(mut mesh) => {
                mesh.name = part_name(name, nth);
                Some(self.model.meshes.push(mesh)?)
            }
            None => None,
        };
        self.meshes.insert(key, index);
        Ok(index)
    }

    /// The primitive's material, the default if it has none.
    fn material_of(&mut self, primitive: &Primitive, name: &str) -> u32 {
        // Material 0 of the model is the default, so the file's begin at 1.
        let material = primitive.material.map_or(0, |index| index.value() + 1);
        if material < self.model.materials.len() {
            return material as u32;
        }
        let what = "placements name a material that is not there, and get the default";
        self.notes.count(what, 1, || quoted(name));
        0
    }
}
