//! The model and its container in, the source parts of both, matched, out.

use std::ops::Range;

use glam::DVec3;

use super::CompareError;
use crate::container::Container;
use crate::geometry::Grid;
use crate::geometry::weld::{WeldedMesh, grid_of, weld};
use crate::import::{Model, SourceMesh};

/// A mesh of the model and the cells that the container has of it.
pub(super) struct Source<'a> {
    /// Its number in the container.
    pub number: u32,
    pub name: &'a str,
    mesh: &'a SourceMesh,
    /// The grid of the mesh and of all its cells.
    pub grid: Grid,
    /// Its rows in the container's table of parts.
    pub cells: Range<usize>,
    /// Of all its cells.
    pub triangles: u64,
    /// The area of the mesh in part units, squared.
    pub area: f64,
    /// The box of all its cells on the grid.
    grid_low: [u32; 3],
    grid_high: [u32; 3],
}

/// Finds the cells of every mesh: the bake numbers the meshes that are placed and have a triangle left, in order.
pub(super) fn matched<'a>(
    model: &'a Model,
    container: &Container<'a>,
) -> Result<Vec<Source<'a>>, CompareError> {
    let mut placed = vec![false; model.meshes.len()];
    for instance in &model.instances {
        placed[instance.mesh as usize] = true;
    }
    let meshes = model.meshes.iter().zip(placed).filter(|&(_, placed)| placed).map(|(mesh, _)| mesh);
    let meshes: Vec<(&SourceMesh, Grid)> =
        meshes.filter_map(|mesh| Some((mesh, grid_if_any_is_left(mesh)?))).collect();
    let ranges = ranges_by_source(container);
    if meshes.len() != ranges.len() {
        return Err(mismatch(format!("it has {} parts, the container {}", meshes.len(), ranges.len())));
    }
    let pairs = meshes.into_iter().zip(ranges);
    pairs.map(|((mesh, grid), cells)| Source::new(mesh, grid, cells, container)).collect()
}

/// The rows of each source part.
fn ranges_by_source(container: &Container<'_>) -> Vec<Range<usize>> {
    let mut start = 0;
    let runs = container.parts().chunk_by(|a, b| a.source == b.source).map(|run| {
        start += run.len();
        start - run.len()..start
    });
    runs.collect()
}

/// The grid of a mesh, if it has a triangle that the weld keeps.
fn grid_if_any_is_left(mesh: &SourceMesh) -> Option<Grid> {
    let grid = grid_of(mesh)?;
    let on_grid = |vertex: u32| grid.quantize(mesh.positions[vertex as usize].map(f64::from));
    let is_left = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(on_grid);
        a != b && b != c && c != a
    };
    mesh.triangles.iter().any(is_left).then_some(grid)
}

impl<'a> Source<'a> {
    fn new(
        mesh: &'a SourceMesh,
        grid: Grid,
        cells: Range<usize>,
        container: &Container<'a>,
    ) -> Result<Self, CompareError> {
        let rows = &container.parts()[cells.clone()];
        let name = container.part_name(cells.start);
        if name != mesh.name {
            return Err(mismatch(format!("its part \"{}\" is called \"{name}\" there", mesh.name)));
        }
        if rows.iter().any(|row| row.grid() != grid) {
            return Err(mismatch(format!("part \"{name}\" has another place or size")));
        }
        let reach = |pick: fn(u32, u32) -> u32, corner: fn(&crate::container::PartRow) -> [u32; 3]| {
            let corners = rows.iter().map(corner);
            corners.reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis]))).unwrap_or_default()
        };
        Ok(Self {
            number: rows.first().map_or(0, |row| row.source),
            name,
            mesh,
            grid,
            cells,
            area: area_of(mesh),
            triangles: rows.iter().map(|row| u64::from(row.triangles)).sum(),
            grid_low: reach(u32::min, |row| row.grid_low),
            grid_high: reach(u32::max, |row| row.grid_high),
        })
    }

    /// The mesh as the bake welded it, which must be what the container has.
    pub fn weld(&self) -> Result<WeldedMesh, CompareError> {
        let welded = weld(self.mesh, self.grid);
        let (found, kept) = (welded.triangles.len() as u64, self.triangles);
        if found != kept {
            return Err(mismatch(format!("part \"{}\" has {found} triangles, there {kept}", self.name)));
        }
        let reach = |pick: fn(u32, u32) -> u32| {
            let corners = welded.positions.iter().copied();
            corners.reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis]))).unwrap_or_default()
        };
        if (reach(u32::min), reach(u32::max)) != (self.grid_low, self.grid_high) {
            return Err(mismatch(format!("the box of part \"{}\" is another there", self.name)));
        }
        Ok(welded)
    }

    /// The diagonal of the box in part units.
    pub fn diagonal(&self) -> f64 {
        let extent = [0, 1, 2].map(|axis| f64::from(self.grid_high[axis] - self.grid_low[axis]));
        DVec3::from(extent).length() * self.grid.step()
    }
}

fn area_of(mesh: &SourceMesh) -> f64 {
    let corner = |vertex: u32| DVec3::from(mesh.positions[vertex as usize].map(f64::from));
    let doubled = mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(corner);
        (b - a).cross(c - a).length()
    });
    0.5 * doubled.sum::<f64>()
}

fn mismatch(difference: String) -> CompareError {
    CompareError::Mismatch { difference }
}
