//! A source mesh in, one collapse-ordered part out, or several cells of one.

use super::TrianglesAt;
use super::adjacency::{EdgeCounts, edge_counts};
use super::cell_tree::{Watch, order_cells};
use super::cells;
use super::collapse::Boundary;
use super::order::OrderedMesh;
use super::record::{ERROR_SAMPLES, OrderedPart, error_code};
use super::weld::{WeldedMesh, grid_of, weld};
use crate::import::SourceMesh;

/// A mesh in collapse order, and what its report says.
#[derive(Debug, Clone, PartialEq)]
pub struct PartOutcome {
    /// The part, or its cells where it had to be cut, parents before their children; none if no triangle had an area.
    pub cells: Vec<OrderedPart>,
    /// What the weld found.
    pub weld: WeldCounts,
}

/// What the weld of one part found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WeldCounts {
    /// Triangles of the source mesh.
    pub source_triangles: usize,
    /// Vertices of the source mesh.
    pub source_vertices: usize,
    /// Positions after the weld.
    pub positions: usize,
    /// Triangles dropped because two corners share a position.
    pub degenerate: usize,
    /// Triangles dropped because they repeat an earlier one.
    pub duplicate: usize,
    /// Open and non-manifold edges after the weld.
    pub edges: EdgeCounts,
}

/// Orders one mesh, which has normals, by its edge collapses.
pub fn order_part(mesh: &SourceMesh, boundary: Boundary) -> PartOutcome {
    order_part_watched(mesh, boundary, &())
}

/// As [`order_part`], for somebody who waits, on the threads of rayon's current pool; if stopped, the outcome lacks
/// cells.
pub fn order_part_watched(mesh: &SourceMesh, boundary: Boundary, watch: &dyn Watch) -> PartOutcome {
    let counts = WeldCounts {
        source_triangles: mesh.triangles.len(),
        source_vertices: mesh.positions.len(),
        ..WeldCounts::default()
    };
    let Some(grid) = grid_of(mesh) else { return PartOutcome { cells: Vec::new(), weld: counts } };
    let welded = weld(mesh, grid);
    let counts = WeldCounts {
        positions: welded.positions.len(),
        degenerate: welded.degenerate,
        duplicate: welded.duplicate,
        edges: edge_counts(&welded),
        ..counts
    };
    watch.done(mesh.triangles.len() - welded.triangles.len());
    let cells = if welded.triangles.is_empty() { Vec::new() } else { cells::cut(welded) };
    PartOutcome { cells: order_cells(&cells, grid, boundary, watch), weld: counts }
}

/// Whether a part keeps more of its triangles in its coarsest state than is useful: over a tenth.
pub fn coarsest_share_is_high(coarsest: u32, triangles: u64) -> bool {
    u64::from(coarsest) * 10 > triangles
}

/// The codes of the error at `m * 2^(-j/2)` vertices, relative to the diagonal of the box in grid steps.
/// `error` is what the finest state is off by already.
pub(super) fn error_samples(mesh: &OrderedMesh, welded: &WeldedMesh, error: f32) -> [u8; ERROR_SAMPLES] {
    let diagonal = diagonal(welded);
    std::array::from_fn(|j| {
        let vn = sampled_count(mesh.vertices.len() as u32, j);
        error_code(f64::from(error + mesh.error_at(vn)), diagonal)
    })
}

/// The vertex count of error sample `j` of a part with `m` vertices: `m * 2^(-j/2)`, rounded down.
pub fn sampled_count(m: u32, j: usize) -> u32 {
    (f64::from(m) * (-(j as f64) / 2.0).exp2()).floor() as u32
}

fn diagonal(mesh: &WeldedMesh) -> f64 {
    let extent = [0, 1, 2].map(|axis| {
        let along = || mesh.positions.iter().map(|p| p[axis]);
        f64::from(along().max().unwrap_or(0) - along().min().unwrap_or(0))
    });
    extent.iter().map(|e| e * e).sum::<f64>().sqrt()
}

impl OrderedPart {
    /// The box of the part in grid coordinates: low and high.
    pub fn grid_box(&self) -> ([u32; 3], [u32; 3]) {
        let mut low = [u32::MAX; 3];
        let mut high = [0; 3];
        for vertex in &self.vertices {
            for (axis, &c) in vertex.grid().iter().enumerate() {
                low[axis] = low[axis].min(c);
                high[axis] = high[axis].max(c);
            }
        }
        (low, high)
    }

    /// How many triangles the whole part has.
    pub fn triangle_count(&self) -> u32 {
        self.triangles_at.count_at(self.vertices.len())
    }

    /// How many triangles its coarsest state has.
    pub fn coarsest_triangles(&self) -> u32 {
        self.triangles_at.count_at(self.locked as usize)
    }

    /// The triangles of the state with `vn` vertices, from the coarsest tier that has it.
    pub fn reformed(&self, vn: u32) -> Vec<[u16; 3]> {
        let tier = self.tiers.iter().rev().find(|tier| tier.vertices >= vn);
        let Some(tier) = tier else { return Vec::new() };
        let count = TrianglesAt::count_at(&self.triangles_at, vn as usize) as usize;
        tier.triangles[..count].iter().map(|t| t.vertices.map(|vertex| self.resolve(vertex, vn))).collect()
    }

    fn resolve(&self, mut vertex: u16, vn: u32) -> u16 {
        while u32::from(vertex) >= vn {
            vertex = self.ecol[usize::from(vertex)];
        }
        vertex
    }
}
