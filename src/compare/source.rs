//! The model and its container in, the source parts of both, matched, out.

use std::borrow::Cow;
use std::ops::Range;

use glam::DVec3;

use super::CompareError;
use super::placed::{Placed, placements};
use crate::bake::{Body, Outline, bodies, merged};
use crate::container::Container;
use crate::geometry::Grid;
use crate::geometry::body::{OrderOptions, welded};
use crate::geometry::weld::{WeldedMesh, grid_around};
use crate::import::{Model, SourceMesh};

/// A part of the model, a mesh or the merged meshes of a body, and the cells that the container has of it.
pub(super) struct Source<'a> {
    /// Its number in the container.
    pub number: u32,
    pub name: &'a str,
    /// Of several meshes a copy of them as one.
    mesh: Cow<'a, SourceMesh>,
    /// The grid of the mesh and of all its cells.
    pub grid: Grid,
    /// Its rows in the container's table of parts.
    pub cells: Range<usize>,
    /// Of all its leaf cells.
    pub triangles: u64,
    /// The area of the mesh in part units, squared.
    pub area: f64,
    pub placed: Placed,
    /// The box of all its leaf cells on the grid.
    grid_low: [u32; 3],
    grid_high: [u32; 3],
}

/// Finds the cells of every part: the bake numbers the bodies that it merges, and the meshes of the others, in order, if
/// they have a triangle left.
pub(super) fn matched<'a>(
    model: &'a Model,
    container: &Container<'a>,
) -> Result<Vec<Source<'a>>, CompareError> {
    let bodies = bodies(&Outline::of(model));
    let parts: Vec<(Cow<'a, SourceMesh>, Grid)> =
        bodies.iter().flat_map(|body| parts_of_body(model, body)).collect();
    let ranges = ranges_by_source(container);
    if parts.len() != ranges.len() {
        return Err(mismatch(format!("it has {} parts, the container {}", parts.len(), ranges.len())));
    }
    let placed = placements(container);
    let pairs = parts.into_iter().zip(ranges);
    let source = |((mesh, grid), cells): ((_, _), Range<usize>)| {
        // All cells of a part are placed together.
        Source::new(mesh, grid, placed[cells.start], cells, container)
    };
    pairs.map(source).collect()
}

/// The parts that the bake makes of a body, and the grid of them all.
fn parts_of_body<'a>(model: &'a Model, body: &Body) -> Vec<(Cow<'a, SourceMesh>, Grid)> {
    let meshes = || body.meshes.iter().map(|&number| &model.meshes[number]);
    let Some(grid) = grid_around(meshes()) else { return Vec::new() };
    let parts: Vec<Cow<'a, SourceMesh>> = match body.is_merged {
        true => vec![Cow::Owned(merged(meshes().cloned().collect()))],
        false => meshes().map(Cow::Borrowed).collect(),
    };
    parts.into_iter().filter(|mesh| any_is_left(mesh, grid)).map(|mesh| (mesh, grid)).collect()
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

/// Whether a mesh has a triangle that the weld keeps.
fn any_is_left(mesh: &SourceMesh, grid: Grid) -> bool {
    let on_grid = |vertex: u32| grid.quantize(mesh.positions[vertex as usize].map(f64::from));
    let is_left = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(on_grid);
        a != b && b != c && c != a
    };
    mesh.triangles.iter().any(is_left)
}

impl<'a> Source<'a> {
    fn new(
        mesh: Cow<'a, SourceMesh>,
        grid: Grid,
        placed: Placed,
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
        let leaves = || rows.iter().filter(|row| !row.is_parent());
        let reach = |pick: fn(u32, u32) -> u32, corner: fn(&crate::container::PartRow) -> [u32; 3]| {
            let corners = leaves().map(corner);
            corners.reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis]))).unwrap_or_default()
        };
        Ok(Self {
            number: rows.first().map_or(0, |row| row.source),
            name,
            grid,
            cells,
            area: area_of(&mesh),
            placed,
            mesh,
            triangles: leaves().map(|row| u64::from(row.triangles)).sum(),
            grid_low: reach(u32::min, |row| row.grid_low),
            grid_high: reach(u32::max, |row| row.grid_high),
        })
    }

    /// The mesh as the bake welded it, which must be what the container has.
    pub fn weld(&self) -> Result<WeldedMesh, CompareError> {
        let welded = welded(&self.mesh, self.grid, OrderOptions::default()).mesh;
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

    /// The middle of the box in steps of the grid.
    pub fn grid_middle(&self) -> DVec3 {
        let [low, high] = [self.grid_low, self.grid_high].map(|c| DVec3::from_array(c.map(f64::from)));
        (low + high) / 2.0
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
