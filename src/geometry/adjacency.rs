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

    /// Whether it is open or non-manifold.
    pub fn is_odd(&self) -> bool {
        self.faces != 2
    }

    /// Whether more than two triangles meet at it.
    pub fn is_non_manifold(&self) -> bool {
        self.faces > 2
    }
}

/// Sides of edges, sorted by the ends of these.
struct Sides<'a> {
    wedge_position: &'a [u32],
    triangles: &'a [[u32; 3]],
    /// Where the sides of each smaller end start among `far`.
    starts: Vec<u32>,
    /// The larger end in the upper half, in the lower half the edge `3 t + k`, from corner `k` of triangle `t`.
    far: Vec<u64>,
}

impl<'a> Sides<'a> {
    fn of(wedge_position: &'a [u32], triangles: &'a [[u32; 3]]) -> Self {
        let mut sides = Self { wedge_position, triangles, starts: Vec::new(), far: Vec::new() };
        let positions = wedge_position.iter().max().map_or(0, |&last| last as usize + 1);
        // The ends of a triangle's three edges, the smaller first.
        let ends = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|wedge| wedge_position[wedge as usize]);
            [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
        };
        // Counting sort by the smaller end. Two entries ahead, so that placing leaves each start where it belongs.
        let mut starts = vec![0u32; positions + 2];
        for [near, _] in triangles.iter().flat_map(ends) {
            starts[near as usize + 2] += 1;
        }
        for i in 2..starts.len() {
            starts[i] += starts[i - 1];
        }
        sides.far = vec![0; 3 * triangles.len()];
        for ([near, far], edge) in triangles.iter().flat_map(ends).zip(0u32..) {
            let place = &mut starts[near as usize + 1];
            sides.far[*place as usize] = u64::from(far) << 32 | u64::from(edge);
            *place += 1;
        }
        for near in 0..positions {
            sides.far[starts[near] as usize..starts[near + 1] as usize].sort_unstable();
        }
        sides.starts = starts;
        sides
    }

    /// The position ends of an edge's side, the smaller first, and the wedges there.
    fn side(&self, edge: u32) -> ([u32; 2], [u32; 2]) {
        let (triangle, k) = (self.triangles[edge as usize / 3], edge as usize % 3);
        let wedges = [triangle[k], triangle[if k == 2 { 0 } else { k + 1 }]];
        let ends = wedges.map(|wedge| self.wedge_position[wedge as usize]);
        if ends[0] <= ends[1] { (ends, wedges) } else { ([ends[1], ends[0]], [wedges[1], wedges[0]]) }
    }

    /// Hands each edge once, in the order of its ends, with all its sides as edges of triangles.
    fn for_each(&self, mut take: impl FnMut(PositionEdge, &[u64])) {
        for (near, range) in self.starts.windows(2).enumerate() {
            let sides = self.far.get(range[0] as usize..range[1] as usize).unwrap_or(&[]);
            for group in sides.chunk_by(|a, b| a >> 32 == b >> 32) {
                let first = self.side(group[0] as u32).1;
                let edge = PositionEdge {
                    ends: [near as u32, (group[0] >> 32) as u32],
                    faces: group.len() as u32,
                    crease: group[1..].iter().any(|&side| self.side(side as u32).1 != first),
                };
                take(edge, group);
            }
        }
    }
}

/// The edges of a mesh that `keep` says yes to, each once, in the order of their ends. All of them take as much
/// memory as the mesh.
pub fn position_edges(mesh: &WeldedMesh, keep: impl Fn(&PositionEdge) -> bool) -> Vec<PositionEdge> {
    let mut edges = Vec::new();
    Sides::of(&mesh.wedge_position, &mesh.triangles).for_each(|edge, _| {
        if keep(&edge) {
            edges.push(edge);
        }
    });
    edges
}

/// For every edge `3 t + k` of a triangle list, from corner `k` to the next: whether it is open, whether it is a crease.
pub(super) fn edge_features(wedge_position: &[u32], triangles: &[[u32; 3]]) -> Vec<(bool, bool)> {
    let mut features = vec![(false, false); 3 * triangles.len()];
    Sides::of(wedge_position, triangles).for_each(|edge, sides| {
        for &side in sides {
            features[side as u32 as usize] = (edge.is_open(), edge.crease);
        }
    });
    features
}

/// Of every position, whether it is on an open edge; `edges` has at least the open ones.
pub(super) fn open_positions(mesh: &WeldedMesh, edges: &[PositionEdge]) -> Vec<bool> {
    let mut open = vec![false; mesh.positions.len()];
    for end in edges.iter().filter(|edge| edge.is_open()).flat_map(|edge| edge.ends) {
        open[end as usize] = true;
    }
    open
}

/// What a report says about a mesh's edges.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EdgeCounts {
    /// Positions on an edge of one triangle.
    pub open_positions: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
}

/// Counts open positions and non-manifold edges; `edges` has at least the odd ones.
pub fn counts_of(mesh: &WeldedMesh, edges: &[PositionEdge]) -> EdgeCounts {
    EdgeCounts {
        open_positions: open_positions(mesh, edges).iter().filter(|&&open| open).count(),
        non_manifold_edges: edges.iter().filter(|edge| edge.is_non_manifold()).count(),
    }
}
