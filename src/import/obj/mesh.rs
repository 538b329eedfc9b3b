//! The faces of one chunk in, a [`SourceMesh`] of unique vertices out.

use rustc_hash::FxHashMap;

use super::faces::{Gathered, Runs};
use super::vertices::{Corner, Vertices};
use crate::import::attributes::{WHITE, is_usable};
use crate::import::notes::Notes;
use crate::import::polygon::Triangulator;
use crate::import::{Colour, Problem, SourceMesh};

/// What building takes at most for a triangle: its indices, and three vertices of its own with a place in the map.
pub const BYTES_PER_TRIANGLE: u64 = 320;

/// Builds the mesh of a chunk, without a name.
///
/// Vertices are the unique tuples of position, normal and colour, in the order of their first use. Normals
/// are left out if any corner lacks one or has one without direction. Faces with a broken position are
/// skipped and noted.
///
/// # Errors
/// [`Problem::Shelve`] if faces cannot be read back from the disk.
pub fn build(
    vertices: &Vertices,
    gathered: Gathered,
    mut runs: Runs<'_>,
    notes: &mut Notes,
) -> Result<SourceMesh, Problem> {
    let mut builder = Builder::new(vertices, gathered.with_normals);
    let mut corners = Vec::new();
    while let Some(mut faces) = runs.advance().map_err(Problem::Shelve)? {
        while faces.next_into(&mut corners) {
            builder.add(&corners);
        }
    }
    let what = "triangles skipped that touch a position that is not finite";
    notes.count(what, builder.broken, || "in a face of an OBJ file".to_owned());
    if builder.mesh.colours.iter().all(|&colour| colour == WHITE) {
        builder.mesh.colours.clear();
    }
    Ok(builder.mesh)
}

/// One corner's attributes.
#[derive(Clone, Copy)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    colour: Colour,
}

struct Builder<'a> {
    vertices: &'a Vertices,
    mesh: SourceMesh,
    with_normals: bool,
    numbers: FxHashMap<[u32; 7], u32>,
    positions: Vec<[f32; 3]>,
    triangulator: Triangulator,
    /// Triangles skipped for a broken position.
    broken: u64,
}

impl<'a> Builder<'a> {
    fn new(vertices: &'a Vertices, with_normals: bool) -> Self {
        Self {
            vertices,
            mesh: SourceMesh::default(),
            with_normals,
            numbers: FxHashMap::default(),
            positions: Vec::new(),
            triangulator: Triangulator::default(),
            broken: 0,
        }
    }

    /// Adds a face.
    fn add(&mut self, corners: &[Corner]) {
        self.positions.clear();
        self.positions.extend(corners.iter().map(|&corner| self.vertices.position(corner)));
        if !self.positions.iter().all(|&position| is_usable(position)) {
            self.broken += corners.len().saturating_sub(2) as u64;
            return;
        }
        self.triangulator.triangulate(&self.positions);
        let triangles = std::mem::take(&mut self.triangulator.triangles);
        for triangle in &triangles {
            let vertices = triangle.map(|corner| self.number_of(corners[corner as usize]));
            self.mesh.triangles.push(vertices);
        }
        self.triangulator.triangles = triangles;
    }

    fn vertex(&self, corner: Corner) -> Vertex {
        let normal = self.vertices.normal(corner).filter(|_| self.with_normals).unwrap_or_default();
        Vertex { position: self.vertices.position(corner), normal, colour: self.vertices.colour(corner) }
    }

    /// The number of a corner's vertex, a new one if there is none like it yet.
    fn number_of(&mut self, corner: Corner) -> u32 {
        let vertex = self.vertex(corner);
        let [px, py, pz] = vertex.position.map(f32::to_bits);
        let [nx, ny, nz] = vertex.normal.map(f32::to_bits);
        let key = [px, py, pz, nx, ny, nz, u32::from_le_bytes(vertex.colour)];
        let next = self.mesh.positions.len() as u32;
        let number = *self.numbers.entry(key).or_insert(next);
        if number == next {
            self.mesh.positions.push(vertex.position);
            self.mesh.colours.push(vertex.colour);
            if self.with_normals {
                self.mesh.normals.push(vertex.normal);
            }
        }
        number
    }
}
