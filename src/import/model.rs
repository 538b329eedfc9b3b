//! The model as importers hand it to the bake.

use glam::DAffine3;

/// An sRGB colour with alpha, 8 bits a channel.
pub type Colour = [u8; 4];

/// Everything that was read from the input files; its meshes in a list, or on a [`Shelf`](super::Shelf).
#[derive(Debug, Clone, Default)]
pub struct Model<Meshes = Vec<SourceMesh>> {
    /// Distinct meshes; each becomes one part (or several cells of one part).
    pub meshes: Meshes,
    /// Placements of meshes, in file order.
    pub instances: Vec<Instance>,
    /// The assembly tree; a parent always comes before its children.
    pub nodes: Vec<Node>,
    /// Materials; index 0 always exists and is the default.
    pub materials: Vec<Material>,
    /// What was skipped or mended while reading, one readable line each, for the user.
    pub notes: Vec<String>,
}

/// One triangle mesh with per-vertex attributes, in the space of its part, in the file's unit of length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SourceMesh {
    /// The name in the file; may be empty, may repeat.
    pub name: String,
    /// Which mesh of the file it is of, as the number of the first mesh of the same body. Meshes of one body (a
    /// mesh of several materials is one) share a space and are placed together; the bake keeps the borders
    /// between them closed.
    pub body: u32,
    /// Positions, one per vertex; all finite.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one per vertex, or empty where the file has none: the bake then makes them by crease angle.
    pub normals: Vec<[f32; 3]>,
    /// sRGB vertex colours, one per vertex, or empty. The base colour of the material is multiplied in already; the
    /// materials of all placements of a coloured mesh are white.
    pub colours: Vec<Colour>,
    /// Material slots, one per vertex, or empty: importers leave them empty, and the bake fills them where it makes one
    /// mesh of a body of several materials.
    pub slots: Vec<u8>,
    /// Three vertex indices a triangle, counter-clockwise seen from outside; all below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
}

/// A placement of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    /// Index into [`Model::meshes`].
    pub mesh: u32,
    /// The node of the assembly tree that places it, an index into [`Model::nodes`].
    pub node: u32,
    /// Index into [`Model::materials`].
    pub material: u32,
    /// Part space to world space; finite, but may mirror, flatten or scale to zero.
    pub world_from_part: DAffine3,
}

/// A node of the assembly tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// The name in the file; may be empty, may repeat, is never used as a path.
    pub name: String,
    /// Index of the parent, which is smaller than the node's own; `None` for a root.
    pub parent: Option<u32>,
}

/// What a surface looks like.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// The name in the file; may be empty.
    pub name: String,
    /// Base colour.
    pub base_colour: Colour,
}

impl Default for Material {
    /// A light, neutral grey.
    fn default() -> Self {
        Self { name: String::new(), base_colour: [186, 190, 196, 255] }
    }
}
