//! Edges between positions: which triangles meet there, and whether attributes jump across.

use super::weld::WeldedMesh;

/// An edge between two positions with everything that meets at it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PositionEdge {
    /// The two positions, the smaller first.
    pub ends: [u32; 2],
    /// How many triangles use it.
    pub faces: u32,
    /// Whether two of its triangles name different wedges at an end.
    pub crease: bool,
}

impl PositionEdge {
    /// Whether it belongs to one triangle only.
    pub fn is_open(&self) -> bool {
        self.faces == 1
    }

    /// Whether more than two triangles meet at it.
    pub fn is_non_manifold(&self) -> bool {
        self.faces > 2
    }
}

/// One triangle's side of an edge: position ends (smaller first), wedges at those ends, triangle and edge number.
type Side = ([u32; 2], [u32; 2], u32);

fn sides(wedge_position: &[u32], triangles: &[[u32; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let wedges = [triangle[k], triangle[(k + 1) % 3]];
            let ends = wedges.map(|wedge| wedge_position[wedge as usize]);
            let side = if ends[0] <= ends[1] {
                (ends, wedges)
            } else {
                ([ends[1], ends[0]], [wedges[1], wedges[0]])
            };
            sides.push((side.0, side.1, (3 * t + k) as u32));
        }
    }
    sides.sort_unstable();
    sides
}

/// Every edge of a mesh once, in the order of its ends.
pub fn position_edges(mesh: &WeldedMesh) -> Vec<PositionEdge> {
    sides(&mesh.wedge_position, &mesh.triangles)
        .chunk_by(|a, b| a.0 == b.0)
        .map(|group| PositionEdge {
            ends: group[0].0,
            faces: group.len() as u32,
            crease: group.iter().any(|side| side.1 != group[0].1),
        })
        .collect()
}

/// For every edge `3 t + k` of a triangle list, from corner `k` to the next: whether it is open, whether it is a crease.
pub(super) fn edge_features(wedge_position: &[u32], triangles: &[[u32; 3]]) -> Vec<(bool, bool)> {
    let mut features = vec![(false, false); 3 * triangles.len()];
    for group in sides(wedge_position, triangles).chunk_by(|a, b| a.0 == b.0) {
        let crease = group.iter().any(|side| side.1 != group[0].1);
        for side in group {
            features[side.2 as usize] = (group.len() == 1, crease);
        }
    }
    features
}

/// What a report says about a mesh's edges.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EdgeCounts {
    /// Positions on an edge of one triangle.
    pub open_positions: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
}

/// Counts open positions and non-manifold edges.
pub fn counts_of(mesh: &WeldedMesh, edges: &[PositionEdge]) -> EdgeCounts {
    let mut open = vec![false; mesh.positions.len()];
    for end in edges.iter().filter(|edge| edge.is_open()).flat_map(|edge| edge.ends) {
        open[end as usize] = true;
    }
    EdgeCounts {
        open_positions: open.iter().filter(|&&open| open).count(),
        non_manifold_edges: edges.iter().filter(|edge| edge.is_non_manifold()).count(),
    }
}
