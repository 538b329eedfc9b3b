//! Meshes in, collapse-ordered parts out (design of the core: Peng & Cao 2012, section 4).
//!
//! The way of a mesh: [`quantize`] puts its positions on a grid and its normals on an octahedron, `weld` finds which
//! vertices are one position, `cells` cuts it where it is too large, `collapse` finds the order in which edge
//! collapses remove its vertices and triangles, and `tiers` cuts that order into self-contained prefixes.

pub mod normals;
pub mod quantize;
pub mod record;
pub mod triangles_at;

pub use record::{Grid, OrderedPart, OrderedTier, TriangleRecord, VertexRecord};
pub use triangles_at::TrianglesAt;
