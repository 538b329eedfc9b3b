//! Meshes in, collapse-ordered parts out (design of the core: Peng & Cao 2012, section 4).
//!
//! The way of a mesh: [`quantize`] puts its positions on a grid and its normals on an octahedron, [`weld`] finds which
//! vertices are one position, [`cells`] cuts it where it is too large, [`mod@collapse`] finds the order in which edge
//! collapses remove its vertices and triangles, [`order`] numbers them by it, and [`tiers`] cuts that order into
//! self-contained prefixes; [`cell_tree`] does so for the cells of a part and joins them. [`body`] goes this way from end to end.

pub mod adjacency;
pub mod body;
pub mod cell_tree;
pub mod cells;
pub mod closure;
pub mod collapse;
pub mod normals;
pub mod order;
pub mod part;
pub mod quadric;
pub mod quantize;
pub mod record;
pub mod tiers;
pub mod triangles_at;
pub mod weld;
pub mod weld_near;

pub use closure::Closure;
pub use collapse::Boundary;
pub use record::{Grid, OrderedPart, OrderedTier, TriangleRecord, VertexRecord};
pub use triangles_at::TrianglesAt;
