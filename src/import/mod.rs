//! Files in, a [`Model`] out: parts, instances, the assembly tree and materials, whatever the format.
//!
//! Nothing here welds, cleans or simplifies: a mesh leaves this room as its file states it, with polygons cut into
//! triangles and every index checked.

mod model;

pub use model::{Colour, Instance, Material, Model, Node, SourceMesh};
