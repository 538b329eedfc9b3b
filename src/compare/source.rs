//! The model and its container in, the source parts of both, matched, out.

use std::ops::Range;

use glam::DVec3;

use super::CompareError;
use crate::bake::{Body, bodies};
use crate::container::Container;
use crate::geometry::body::{OrderOptions, welded};
use crate::geometry::weld::{WeldedMesh, grid_around};
use crate::geometry::{Grid, VertexRecord};
use crate::import::{Model, SourceMesh};

/// A part of the model, of one mesh or of the meshes of a body, and the cells that the container has of it.
pub(super) struct Source<'a> {
    /// Its number in the container.
    pub number: u32,
    pub name: &'a str,
    meshes: Vec<&'a SourceMesh>,
    /// The grid of all meshes and cells.
    pub grid: Grid,
    /// Its rows in the container's table of parts.
    pub cells: Range<usize>,
    /// Of all its leaf cells.
    pub triangles: u64,
    /// The area of the meshes in part units, squared.
    pub area: f64,
    /// The box of all its leaf cells on the grid.
    grid_low: [u32; 3],
    grid_high: [u32; 3],
}

/// Finds the cells of every part: the bake numbers bodies that are placed together, or their meshes where these are
/// not, in order, if they have a triangle left.
pub(super) fn matched<'a>(
    model: &'a Model,
    container: &Container<'a>,
) -> Result<Vec<Source<'a>>, CompareError> {
    let bodies = bodies(model);
    let parts: Vec<(Vec<&SourceMesh>, Grid)> =
        bodies.iter().flat_map(|body| parts_of_body(model, body)).collect();
    let ranges = ranges_by_source(container);
    if parts.len() != ranges.len() {
        return Err(mismatch(format!("it has {} parts, the container {}", parts.len(), ranges.len())));
    }
    let pairs = parts.into_iter().zip(ranges);
    pairs.map(|((meshes, grid), cells)| Source::new(meshes, grid, cells, container)).collect()
}

/// The meshes of each part that the bake makes of a body, and the grid of them all.
fn parts_of_body<'a>(model: &'a Model, body: &Body) -> Vec<(Vec<&'a SourceMesh>, Grid)> {
    let meshes = || body.meshes.iter().map(|&number| &model.meshes[number]);
    let Some(grid) = grid_around(meshes()) else { return Vec::new() };
    let kept: Vec<&SourceMesh> = meshes().filter(|mesh| any_is_left(mesh, grid)).collect();
    let joined = body.placements.is_some() && meshes().all(|mesh| mesh.colours.is_empty());
    match joined && !kept.is_empty() {
        true => vec![(kept, grid)],
        false => kept.into_iter().map(|mesh| (vec![mesh], grid)).collect(),
    }
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
        meshes: Vec<&'a SourceMesh>,
        grid: Grid,
        cells: Range<usize>,
        container: &Container<'a>,
    ) -> Result<Self, CompareError> {
        let rows = &container.parts()[cells.clone()];
        let name = container.part_name(cells.start);
        if meshes.iter().all(|mesh| name != mesh.name) {
            return Err(mismatch(format!("its part \"{}\" is called \"{name}\" there", meshes[0].name)));
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
            area: meshes.iter().map(|mesh| area_of(mesh)).sum(),
            meshes,
            triangles: leaves().map(|row| u64::from(row.triangles)).sum(),
            grid_low: reach(u32::min, |row| row.grid_low),
            grid_high: reach(u32::max, |row| row.grid_high),
        })
    }

    /// The meshes as the bake welded them, in one, which must be what the container has. Of the wedges only the
    /// positions are kept.
    pub fn weld(&self) -> Result<WeldedMesh, CompareError> {
        let welded = self.meshes.iter().map(|mesh| welded(mesh, self.grid, OrderOptions::default()).mesh);
        let welded = by_position(&welded.collect::<Vec<_>>());
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

/// Some meshes of one grid in one, with one wedge a position.
fn by_position(meshes: &[WeldedMesh]) -> WeldedMesh {
    let mut positions: Vec<[u32; 3]> =
        meshes.iter().flat_map(|mesh| mesh.positions.iter().copied()).collect();
    positions.sort_unstable();
    positions.dedup();
    let mut triangles = Vec::new();
    for mesh in meshes {
        let number = |position: u32| {
            let at = mesh.positions[position as usize];
            positions.partition_point(|&other| other < at) as u32
        };
        triangles.extend(mesh.triangles.iter().map(|&t| mesh.corner_positions(t).map(number)));
    }
    WeldedMesh {
        wedges: positions.iter().map(|&at| VertexRecord::new(at, 0)).collect(),
        wedge_position: (0..positions.len() as u32).collect(),
        positions,
        triangles,
        ..WeldedMesh::default()
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
