//! The faces of one chunk as `tobj` returns them in, a [`SourceMesh`] of unique vertices out.

use rustc_hash::FxHashMap;

use crate::import::attributes::{WHITE, channel, is_usable, unit};
use crate::import::notes::Notes;
use crate::import::polygon::Triangulator;
use crate::import::{Colour, SourceMesh};

/// Builds the mesh of a chunk, without a name.
///
/// Vertices are the unique tuples of position, normal and colour, in the order of their first use. Normals
/// are left out if any corner lacks one or has one without direction. Faces with a broken position are
/// skipped and noted.
pub fn build(meshes: &[tobj::Mesh], notes: &mut Notes) -> SourceMesh {
    let mut builder = Builder { with_normals: meshes.iter().all(has_all_normals), ..Builder::default() };
    for mesh in meshes {
        builder.add(mesh);
    }
    let what = "triangles skipped that touch a position that is not finite";
    notes.count(what, builder.broken, || "in a face of an OBJ file".to_owned());
    if builder.mesh.colours.iter().all(|&colour| colour == WHITE) {
        builder.mesh.colours.clear();
    }
    builder.mesh
}

/// Whether every corner has a normal with a direction.
fn has_all_normals(mesh: &tobj::Mesh) -> bool {
    mesh.normal_indices.len() == mesh.indices.len()
        && triples(&mesh.normals).all(|normal| unit(normal).is_some())
}

fn triples(flat: &[f32]) -> impl Iterator<Item = [f32; 3]> {
    flat.as_chunks().0.iter().copied()
}

/// The `i`-th triple; zeros beyond the end.
fn triple(flat: &[f32], i: u32) -> [f32; 3] {
    flat.as_chunks().0.get(i as usize).copied().unwrap_or_default()
}

/// One corner's attributes.
#[derive(Clone, Copy)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    colour: Colour,
}

#[derive(Default)]
struct Builder {
    mesh: SourceMesh,
    with_normals: bool,
    vertices: FxHashMap<[u32; 7], u32>,
    triangulator: Triangulator,
    /// Triangles skipped for a broken position.
    broken: u64,
}

impl Builder {
    fn add(&mut self, mesh: &tobj::Mesh) {
        let mut polygon = Vec::new();
        let mut positions = Vec::new();
        let mut first = 0;
        for face in 0.. {
            // `tobj` leaves the arities out where all faces are triangles.
            let arity = mesh.face_arities.get(face).map_or(3, |&arity| arity as usize);
            if arity == 0 || first + arity > mesh.indices.len() {
                return;
            }
            polygon.clear();
            polygon.extend((first..first + arity).map(|corner| self.corner(mesh, corner)));
            positions.clear();
            positions.extend(polygon.iter().map(|vertex: &Vertex| vertex.position));
            self.add_polygon(&polygon, &positions);
            first += arity;
        }
    }

    fn corner(&self, mesh: &tobj::Mesh, corner: usize) -> Vertex {
        let index = mesh.indices[corner];
        let normal = match mesh.normal_indices.get(corner) {
            Some(&normal) if self.with_normals => unit(triple(&mesh.normals, normal)).unwrap_or_default(),
            _ => [0.0; 3],
        };
        let colour = if mesh.vertex_color.is_empty() {
            WHITE
        } else {
            let [r, g, b] = triple(&mesh.vertex_color, index).map(channel);
            [r, g, b, 255]
        };
        Vertex { position: triple(&mesh.positions, index), normal, colour }
    }

    fn add_polygon(&mut self, polygon: &[Vertex], positions: &[[f32; 3]]) {
        if !positions.iter().all(|&position| is_usable(position)) {
            self.broken += polygon.len().saturating_sub(2) as u64;
            return;
        }
        self.triangulator.triangulate(positions);
        let triangles = std::mem::take(&mut self.triangulator.triangles);
        for triangle in &triangles {
            let vertices = triangle.map(|corner| self.number_of(polygon[corner as usize]));
            self.mesh.triangles.push(vertices);
        }
        self.triangulator.triangles = triangles;
    }

    /// The vertex's number, a new one if there is none like it yet.
    fn number_of(&mut self, vertex: Vertex) -> u32 {
        let [px, py, pz] = vertex.position.map(f32::to_bits);
        let [nx, ny, nz] = vertex.normal.map(f32::to_bits);
        let key = [px, py, pz, nx, ny, nz, u32::from_le_bytes(vertex.colour)];
        let next = self.mesh.positions.len() as u32;
        let number = *self.vertices.entry(key).or_insert(next);
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
