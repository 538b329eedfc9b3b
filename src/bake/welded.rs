//! What the weld of meshes found, counted: one mesh in, and the same of a part or of a whole bake out.

use std::ops::AddAssign;

use bytemuck::{Pod, Zeroable};
use serde::Serialize;

use crate::geometry::body::WeldCounts;

/// What was read of a mesh, a part or all files, and what their welds found.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable, Serialize)]
pub struct Welded {
    /// Triangles in the files.
    pub source_triangles: u64,
    /// Vertices in the files.
    pub source_vertices: u64,
    /// Vertices on edges of one triangle, by the files' own indices.
    pub source_open_vertices: u64,
    /// Positions after the weld.
    pub welded_positions: u64,
    /// Positions on open edges that moved onto another one within the weld tolerance.
    pub moved_positions: u64,
    /// Triangles dropped because two corners share a position.
    pub degenerate_triangles: u64,
    /// Triangles dropped because they repeat another.
    pub duplicate_triangles: u64,
    /// Positions on open edges after the weld.
    pub open_positions: u64,
    /// Positions on borders between meshes of one body, which differ in material and are locked.
    pub shared_positions: u64,
    /// Edges of more than two triangles after the weld.
    pub non_manifold_edges: u64,
}

impl Welded {
    /// Of one mesh, or of the merged meshes of a body.
    pub(super) fn new(counts: &WeldCounts, source_open_vertices: usize) -> Self {
        Self {
            source_triangles: counts.source_triangles as u64,
            source_vertices: counts.source_vertices as u64,
            source_open_vertices: source_open_vertices as u64,
            welded_positions: counts.positions as u64,
            moved_positions: counts.moved as u64,
            degenerate_triangles: counts.degenerate as u64,
            duplicate_triangles: counts.duplicate as u64,
            open_positions: counts.edges.open_positions as u64,
            shared_positions: counts.shared as u64,
            non_manifold_edges: counts.edges.non_manifold_edges as u64,
        }
    }
}

impl AddAssign for Welded {
    fn add_assign(&mut self, other: Self) {
        self.source_triangles += other.source_triangles;
        self.source_vertices += other.source_vertices;
        self.source_open_vertices += other.source_open_vertices;
        self.welded_positions += other.welded_positions;
        self.moved_positions += other.moved_positions;
        self.degenerate_triangles += other.degenerate_triangles;
        self.duplicate_triangles += other.duplicate_triangles;
        self.open_positions += other.open_positions;
        self.shared_positions += other.shared_positions;
        self.non_manifold_edges += other.non_manifold_edges;
    }
}
