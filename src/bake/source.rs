//! A model in, its meshes one at a time out, so that a bake needs not hold all of them.

use std::path::PathBuf;

use xxhash_rust::xxh3::Xxh3;

use crate::import::{ImportError, Instance, Material, Model, Node, Shelf, Shelved, SourceMesh};

/// All of a model but what its meshes consist of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// The meshes.
    pub meshes: Vec<MeshOutline>,
    /// Placements of meshes.
    pub instances: Vec<Instance>,
    /// The assembly tree; a parent always comes before its children.
    pub nodes: Vec<Node>,
    /// Materials; index 0 always exists and is the default.
    pub materials: Vec<Material>,
    /// What was skipped or mended while reading, one readable line each.
    pub notes: Vec<String>,
}

/// What is known of a mesh before it is loaded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MeshOutline {
    /// As [`SourceMesh::name`].
    pub name: String,
    /// As [`SourceMesh::body`].
    pub body: u32,
    /// How many triangles it has.
    pub triangles: u64,
    /// Whether its vertices have colours.
    pub coloured: bool,
}

/// Where the meshes of a model come from.
pub trait MeshSource: Sync {
    /// All but the meshes.
    fn outline(&self) -> &Outline;

    /// Reads or makes a mesh. A bake asks for each that is placed once at most, from any thread.
    ///
    /// # Errors
    /// What keeps it from being read.
    fn load(&self, mesh: usize) -> Result<SourceMesh, ImportError>;

    /// A number that differs for other models, so that an interrupted bake is not continued with another one.
    fn fingerprint(&self) -> u64;

    /// Bytes of meshes that it holds in memory itself.
    fn bytes_held(&self) -> u64 {
        0
    }
}

impl Outline {
    /// That of a model in memory, whose lists it copies.
    pub fn of(model: &Model) -> Self {
        let mesh = |mesh: &SourceMesh| MeshOutline {
            name: mesh.name.clone(),
            body: mesh.body,
            triangles: mesh.triangles.len() as u64,
            coloured: !mesh.colours.is_empty(),
        };
        Self {
            meshes: model.meshes.iter().map(mesh).collect(),
            instances: model.instances.clone(),
            nodes: model.nodes.clone(),
            materials: model.materials.clone(),
            notes: model.notes.clone(),
        }
    }
}

impl From<&Shelved> for MeshOutline {
    fn from(mesh: &Shelved) -> Self {
        Self {
            name: mesh.name.clone(),
            body: mesh.body,
            triangles: mesh.triangles,
            coloured: mesh.is_coloured,
        }
    }
}

/// A model that was read; each mesh is given away when it is asked for.
#[derive(Debug)]
pub struct Loaded {
    outline: Outline,
    meshes: Shelf,
    inputs: PathBuf,
}

impl Loaded {
    /// Takes a model in memory apart.
    pub fn new(model: Model) -> Self {
        let Model { meshes, instances, nodes, materials, notes } = model;
        Self::shelved(Model { meshes: Shelf::of(meshes), instances, nodes, materials, notes }, &[])
    }

    /// Takes a model apart that was read from files.
    pub fn shelved(model: Model<Shelf>, inputs: &[PathBuf]) -> Self {
        let Model { meshes, instances, nodes, materials, notes } = model;
        let outlines = meshes.meshes().iter().map(MeshOutline::from).collect();
        Self {
            outline: Outline { meshes: outlines, instances, nodes, materials, notes },
            meshes,
            inputs: inputs.first().cloned().unwrap_or_default(),
        }
    }
}

impl MeshSource for Loaded {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn load(&self, mesh: usize) -> Result<SourceMesh, ImportError> {
        self.meshes.give(mesh).map_err(|problem| ImportError::File { problem, path: self.inputs.clone() })
    }

    fn fingerprint(&self) -> u64 {
        let mut hash = Xxh3::new();
        self.meshes.meshes().iter().for_each(|mesh| mesh.update(&mut hash));
        hash_outline(&self.outline, &mut hash);
        hash.digest()
    }

    fn bytes_held(&self) -> u64 {
        self.meshes.bytes_held()
    }
}

/// Hashes everything but the meshes.
pub fn hash_outline(outline: &Outline, hash: &mut Xxh3) {
    for instance in &outline.instances {
        for number in [instance.mesh, instance.node, instance.material] {
            hash.update(&number.to_le_bytes());
        }
        hash.update(bytemuck::cast_slice(&instance.world_from_part.to_cols_array()));
    }
    for node in &outline.nodes {
        hash.update(&node.parent.unwrap_or(u32::MAX).to_le_bytes());
        hash.update(node.name.as_bytes());
    }
    for material in &outline.materials {
        hash.update(&material.base_colour);
        hash.update(material.name.as_bytes());
    }
}
