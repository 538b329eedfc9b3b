//! An ordered mesh in, what a part says of itself out: its box, its counts, its states, its errors.

use std::f64::consts::FRAC_1_SQRT_2;

use super::TrianglesAt;
use super::order::OrderedMesh;
use super::record::{ERROR_SAMPLES, OrderedPart, error_code};
use super::weld::WeldedMesh;

/// Whether a part keeps more of its triangles in its coarsest state than is useful: over a tenth.
pub fn coarsest_share_is_high(coarsest: u32, triangles: u64) -> bool {
    u64::from(coarsest) * 10 > triangles
}

/// The codes of the error at `m * 2^(-j/2)` vertices, relative to the diagonal of the box in grid steps.
/// `error` is what the finest state is off by already.
pub(super) fn error_samples(mesh: &OrderedMesh, diagonal: f64, error: f32) -> [u8; ERROR_SAMPLES] {
    std::array::from_fn(|j| {
        let vn = sampled_count(mesh.vertices.len() as u32, j);
        error_code(f64::from(error + mesh.error_at(vn)), diagonal)
    })
}

/// The vertex count of error sample `j` of a part with `m` vertices: `m * 2^(-j/2)`, rounded down.
pub fn sampled_count(m: u32, j: usize) -> u32 {
    let share = if j.is_multiple_of(2) { 1.0 } else { FRAC_1_SQRT_2 };
    (f64::from(m) * share / f64::from(1u32 << (j / 2))) as u32
}

/// The diagonal of a mesh's box, in grid steps.
pub(super) fn diagonal(mesh: &WeldedMesh) -> f64 {
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

    /// The diagonal of its box, in part units.
    pub fn diagonal(&self) -> f64 {
        let (low, high) = self.grid_box();
        let extent: f64 = (0..3).map(|axis| f64::from(high[axis].saturating_sub(low[axis])).powi(2)).sum();
        extent.sqrt() * self.grid.step()
    }

    /// The coarsest state with at least so many triangles; the finest if none has.
    pub fn state_with_triangles(&self, triangles: f64) -> u32 {
        let (mut low, mut high) = (self.locked as usize, self.vertices.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if f64::from(self.triangles_at.count_at(middle)) < triangles {
                low = middle + 1
            } else {
                high = middle
            }
        }
        self.triangles_at.state_at_least(low).unwrap_or(self.vertices.len()) as u32
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
