//! The accessors of a primitive in, a [`SourceMesh`] of the vertices in use out.

use ::gltf::json::Root;
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;

use super::accessor::{Accessors, Reader};
use super::buffers::Buffers;
use crate::import::attributes::{WHITE, is_usable, srgb_from_linear, unit};
use crate::import::notes::{Notes, quoted};
use crate::import::{Colour, Problem, SourceMesh};

/// What makes two primitives the same geometry: their accessors and how these are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct GeometryKey {
    shape: Shape,
    indices: Option<usize>,
    positions: usize,
    normals: Option<usize>,
    colours: Option<usize>,
}

/// How corners follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Shape {
    List,
    Strip,
    Fan,
}

impl GeometryKey {
    /// The key of a primitive; `None`, with a note, if it makes no triangles.
    pub fn of(primitive: &Primitive, name: &str, notes: &mut Notes) -> Option<Self> {
        let shape = match primitive.mode {
            Checked::Valid(Mode::Triangles) => Shape::List,
            Checked::Valid(Mode::TriangleStrip) => Shape::Strip,
            Checked::Valid(Mode::TriangleFan) => Shape::Fan,
            _ => {
                notes.count("primitives skipped that are points, lines or unknown", 1, || quoted(name));
                return None;
            }
        };
        let attribute =
            |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
        let Some(positions) = attribute(Semantic::Positions) else {
            notes.count("primitives skipped that have no positions", 1, || quoted(name));
            return None;
        };
        Some(Self {
            shape,
            indices: primitive.indices.map(|index| index.value()),
            positions,
            normals: attribute(Semantic::Normals),
            colours: attribute(Semantic::Colors(0)),
        })
    }
}

/// Marks a vertex that is not in use yet.
const UNUSED: u32 = u32::MAX;

/// Reads geometries, one after the other.
pub struct Geometry<'a> {
    accessors: Accessors<'a>,
    /// Numbers of the vertices in use, by their index in the file; `UNUSED` between readings.
    numbers: Vec<u32>,
    /// How many more corners all geometries together may have.
    corners_left: usize,
    notes: Notes,
}

impl<'a> Geometry<'a> {
    /// Nothing read yet.
    pub fn new(root: &'a Root, buffers: &'a Buffers<'a>) -> Self {
        // Every corner takes a byte at least, unless accessors overlap: they may, but not so that a small
        // file stands for gigabytes of geometry.
        let corners_left = buffers.total_bytes().saturating_mul(4).saturating_add(1 << 20);
        Self {
            accessors: Accessors::new(root, buffers),
            numbers: Vec::new(),
            corners_left,
            notes: Notes::default(),
        }
    }

    /// Bytes of the buffers that all readings reached over, each time anew.
    pub fn bytes_reached(&self) -> u64 {
        self.accessors.bytes_reached
    }

    /// Moves the notes of all readings behind others.
    pub fn take_notes(&mut self, notes: &mut Notes) {
        notes.append(std::mem::take(&mut self.notes));
    }

    /// Reads a geometry, without a name; `None`, with a note, if no triangle is left of it.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] for accessors that do not hold what they promise.
    pub fn read(&mut self, key: GeometryKey, name: &str) -> Result<Option<SourceMesh>, Problem> {
        let positions = self.accessors.get(key.positions)?;
        if positions.components != 3 {
            return Err(Problem::Malformed(format!(
                "accessor {} of positions is not made of triples",
                key.positions
            )));
        }
        let indices = key.indices.map(|index| self.accessors.get(index)).transpose()?;
        if indices.as_ref().is_some_and(|indices| !indices.is_of_indices()) {
            return Err(Problem::Malformed(
                "the indices of a primitive are not unsigned integers".to_owned(),
            ));
        }
        let corner_count = indices.as_ref().map_or(positions.count, |indices| indices.count);
        self.spend(corner_count)?;
        let corner = |place: usize| indices.as_ref().map_or(place as u32, |indices| indices.index(place));
        let faces = faces(key.shape, corner_count).map(|face| face.map(corner));
        let (triangles, vertices) = self.gather(faces, &positions, key.shape, name);
        if triangles.is_empty() {
            self.notes.count("primitives skipped that have no triangle", 1, || quoted(name));
            return Ok(None);
        }
        let positions = vertices.iter().map(|&vertex| positions.triple(vertex as usize)).collect();
        let normals = self.normals(key.normals, &vertices, name)?;
        let colours = self.colours(key.colours, &vertices, name)?;
        Ok(Some(SourceMesh { positions, normals, colours, triangles, ..SourceMesh::default() }))
    }

    fn spend(&mut self, corner_count: usize) -> Result<(), Problem> {
        let what = "the accessors promise far more geometry than there are data";
        let left = self.corners_left.checked_sub(corner_count);
        self.corners_left = left.ok_or_else(|| Problem::Malformed(what.to_owned()))?;
        Ok(())
    }

    /// Renumbers the corners of all good faces; returns them and the file's index of each vertex in use.
    fn gather(
        &mut self,
        faces: impl Iterator<Item = [u32; 3]>,
        positions: &Reader<'_>,
        shape: Shape,
        name: &str,
    ) -> (Vec<[u32; 3]>, Vec<u32>) {
        let mut triangles = Vec::with_capacity(faces.size_hint().0);
        let mut vertices = Vec::new();
        let (mut missing, mut broken) = (0, 0);
        self.numbers.resize(self.numbers.len().max(positions.count), UNUSED);
        for face in faces {
            let [a, b, c] = face;
            if face.iter().any(|&vertex| vertex as usize >= positions.count) {
                missing += 1;
            } else if !face.iter().all(|&vertex| is_usable(positions.triple(vertex as usize))) {
                broken += 1;
            } else if shape == Shape::List || (a != b && b != c && c != a) {
                triangles.push(face.map(|vertex| self.number_of(vertex, &mut vertices)));
            } // else one of the empty triangles that join the pieces of a strip
        }
        for &vertex in &vertices {
            self.numbers[vertex as usize] = UNUSED;
        }
        self.notes.count("triangles skipped that name a vertex that is not there", missing, || quoted(name));
        self.notes
            .count("triangles skipped that touch a position that is not finite", broken, || quoted(name));
        (triangles, vertices)
    }

    fn number_of(&mut self, vertex: u32, vertices: &mut Vec<u32>) -> u32 {
        let number = &mut self.numbers[vertex as usize];
        if *number == UNUSED {
            *number = vertices.len() as u32;
            vertices.push(vertex);
        }
        *number
    }

    /// The reader of an attribute, if it has a value of a fitting shape for every vertex.
    fn attribute(
        &mut self,
        accessor: Option<usize>,
        vertices: &[u32],
        components: &[usize],
    ) -> Result<Option<std::rc::Rc<Reader<'a>>>, Problem> {
        let Some(index) = accessor else { return Ok(None) };
        let reader = self.accessors.get(index)?;
        let fits = components.contains(&reader.components);
        let reaches = vertices.iter().all(|&vertex| (vertex as usize) < reader.count);
        Ok((fits && reaches).then_some(reader))
    }

    /// Unit normals, or none if any of them is missing or has no direction.
    fn normals(
        &mut self,
        accessor: Option<usize>,
        vertices: &[u32],
        name: &str,
    ) -> Result<Vec<[f32; 3]>, Problem> {
        let reader = self.attribute(accessor, vertices, &[3])?;
        let normals: Option<Vec<_>> = reader
            .and_then(|reader| vertices.iter().map(|&vertex| unit(reader.triple(vertex as usize))).collect());
        if normals.is_none() && accessor.is_some() {
            let what = "meshes get new normals because some of theirs have no direction";
            self.notes.count(what, 1, || quoted(name));
        }
        Ok(normals.unwrap_or_default())
    }

    /// sRGB colours, or none if all are white.
    fn colours(
        &mut self,
        accessor: Option<usize>,
        vertices: &[u32],
        name: &str,
    ) -> Result<Vec<Colour>, Problem> {
        let Some(reader) = self.attribute(accessor, vertices, &[3, 4])? else {
            let unfit = u64::from(accessor.is_some());
            self.notes
                .count("meshes lose their colours, which do not fit their vertices", unfit, || quoted(name));
            return Ok(Vec::new());
        };
        let linear = |vertex: u32| {
            let [r, g, b, a] = reader.vector(vertex as usize);
            // Colours must be normalised; where the flag is missing, bytes are what is meant.
            let [r, g, b, a] =
                if reader.is_of_plain_integers() { [r, g, b, a].map(|c| c / 255.0) } else { [r, g, b, a] };
            [r, g, b, if reader.components == 4 { a } else { 1.0 }]
        };
        let colours: Vec<Colour> = vertices.iter().map(|&vertex| srgb_from_linear(linear(vertex))).collect();
        Ok(if colours.iter().all(|&colour| colour == WHITE) { Vec::new() } else { colours })
    }
}

/// The places of the corners of all faces, by the equations of glTF 2.0, section 3.7.2.1.
fn faces(shape: Shape, corner_count: usize) -> impl Iterator<Item = [usize; 3]> {
    let count = match shape {
        Shape::List => corner_count / 3,
        Shape::Strip | Shape::Fan => corner_count.saturating_sub(2),
    };
    (0..count).map(move |face| match shape {
        Shape::List => [3 * face, 3 * face + 1, 3 * face + 2],
        Shape::Strip => [face, face + 1 + face % 2, face + 2 - face % 2],
        Shape::Fan => [face + 1, face + 2, 0],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_one_orientation() {
        let strip: Vec<_> = faces(Shape::Strip, 5).collect();
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan: Vec<_> = faces(Shape::Fan, 5).collect();
        assert_eq!(fan, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        assert_eq!(faces(Shape::List, 8).count(), 2);
        assert_eq!(faces(Shape::Strip, 1).count(), 0);
    }
}
