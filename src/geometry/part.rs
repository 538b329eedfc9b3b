//! A source mesh in, one collapse-ordered part out, or several cells of one.

use super::adjacency::{EdgeCounts, edge_counts};
use super::cells::{self, Cell};
use super::collapse::{Boundary, collapse_order};
use super::order::{OrderedMesh, arrange};
use super::record::{ERROR_SAMPLES, Grid, OrderedPart, Stall, error_code};
use super::weld::{WeldedMesh, grid_of, weld};
use super::{TrianglesAt, tiers};
use crate::import::SourceMesh;

/// A mesh in collapse order, and what its report says.
#[derive(Debug, Clone, PartialEq)]
pub struct PartOutcome {
    /// The part, or its cells where it had to be cut; none if no triangle had an area.
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
    order_part_unless(mesh, boundary, &|| false)
}

/// As [`order_part`], but asks before every cell whether to stop; the outcome then lacks the cells that are left.
pub fn order_part_unless(mesh: &SourceMesh, boundary: Boundary, stopped: &dyn Fn() -> bool) -> PartOutcome {
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
    let cells = if welded.triangles.is_empty() { Vec::new() } else { cells::cut(welded) };
    let ordered = cells.iter().take_while(|_| !stopped()).map(|cell| order_cell(cell, grid, boundary));
    PartOutcome { cells: ordered.collect(), weld: counts }
}

/// Orders one cell.
pub fn order_cell(cell: &Cell, grid: Grid, boundary: Boundary) -> OrderedPart {
    let order = collapse_order(&cell.mesh, &cell.locked, boundary);
    let mesh = arrange(&cell.mesh, &order);
    let coarsest = mesh.triangles_at.count_at(mesh.locked as usize) as usize;
    let stalled = coarsest * 10 > mesh.triangles.len();
    OrderedPart {
        grid,
        coloured: cell.mesh.coloured,
        ecol: mesh.ecol.iter().map(|&target| target as u16).collect(),
        tiers: tiers::cut(&mesh),
        locked: mesh.locked,
        errors: error_samples(&mesh, &cell.mesh),
        stall: stall_of(stalled, order.stall),
        triangles_at: mesh.triangles_at,
        vertices: mesh.vertices,
    }
}

/// A part that keeps more than a tenth of its triangles always has a cause.
fn stall_of(stalled: bool, cause: Stall) -> Stall {
    match (stalled, cause) {
        (false, _) => Stall::None,
        (true, Stall::None) => Stall::Least,
        (true, cause) => cause,
    }
}

/// The codes of the error at `m * 2^(-j/2)` vertices, relative to the diagonal of the box in grid steps.
fn error_samples(mesh: &OrderedMesh, welded: &WeldedMesh) -> [u8; ERROR_SAMPLES] {
    let diagonal = diagonal(welded);
    std::array::from_fn(|j| {
        let vn = sampled_count(mesh.vertices.len() as u32, j);
        error_code(f64::from(mesh.error_at(vn)), diagonal)
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
