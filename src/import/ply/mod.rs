//! A PLY file in (ASCII, or binary of either end first), a [`Model`] of one mesh out.
//!
//! [`header`] tells the layout, [`numbers`] reads numbers, and this module makes vertices, faces and strips of them.
//! Rows are read one by one and nothing is allocated for what the header only promises. The payload readers of the
//! `ply-rs-bw` crate are not used: its ASCII grammar refuses numbers such as `nan`, `1.` and `.5`, and it tells
//! properties by name, number for number.

mod header;
mod numbers;

use super::attributes::{WHITE, channel, is_usable, unit};
use super::input::{Input, stem_of};
use super::notes::Notes;
use super::polygon::Triangulator;
use super::{Colour, Model, Problem, Shelf, SourceMesh, model_of_one};
use header::{Element, Layout, Property, Scalar};
use numbers::Numbers;

/// Reads one PLY file.
///
/// # Errors
///
/// [`Problem`] for a header that makes no sense, or data that end before all that it promises. Faces with missing
/// vertices and broken positions are skipped and noted.
pub(super) fn read(input: &Input<'_>, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
    let mut bytes = input.open()?;
    let layout = header::read(&mut *bytes)?;
    check_elements(&layout)?;
    let mut numbers = Numbers::new(&mut *bytes, &layout);
    let mut builder = Builder::default();
    let last = layout.elements.iter().rposition(|element| is_surface(&element.name)).unwrap_or(0);
    for element in &layout.elements[..=last] {
        builder.read_element(element, &mut numbers)?;
    }
    let (mesh, notes) = builder.finish();
    model_of_one(mesh, stem_of(input.path), notes, shelf)
}

fn is_surface(name: &str) -> bool {
    matches!(name, "face" | "tristrips")
}

/// That there are vertices, and faces behind them.
fn check_elements(layout: &Layout) -> Result<(), Problem> {
    let malformed = |what: &str| Err(Problem::Malformed(what.to_owned()));
    let place =
        |wanted: &dyn Fn(&str) -> bool| layout.elements.iter().position(|element| wanted(&element.name));
    match (place(&|name| name == "vertex"), place(&is_surface)) {
        (None, _) => malformed("the header has no element \"vertex\""),
        (_, None) => malformed("the header has no element \"face\", and points alone cannot be drawn"),
        (Some(vertex), Some(surface)) if surface < vertex => malformed(
            "the faces come before the vertices, which cannot be read; put the element \"vertex\" first",
        ),
        _ => Ok(()),
    }
}

/// What a number of a vertex is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Position(usize),
    Normal(usize),
    Colour(usize),
    Other,
}

impl Role {
    fn of(property: &Property) -> Self {
        if property.list.is_some() {
            return Self::Other;
        }
        match property.name.as_str() {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "nx" => Self::Normal(0),
            "ny" => Self::Normal(1),
            "nz" => Self::Normal(2),
            "red" | "diffuse_red" | "r" => Self::Colour(0),
            "green" | "diffuse_green" | "g" => Self::Colour(1),
            "blue" | "diffuse_blue" | "b" => Self::Colour(2),
            "alpha" | "diffuse_alpha" | "a" => Self::Colour(3),
            _ => Self::Other,
        }
    }
}

/// A colour's number as 8 bits: fractions of 1 in floating point, of the greatest number in unsigned integers.
fn channel_of(number: f64, scalar: Scalar) -> u8 {
    match scalar {
        Scalar::F32 | Scalar::F64 => channel(number as f32),
        Scalar::U16 => (number / 257.0).round() as u8,
        // The cast saturates.
        _ => number as u8,
    }
}

/// The mesh while it grows.
#[derive(Default)]
struct Builder {
    mesh: SourceMesh,
    notes: Notes,
    triangulator: Triangulator,
    /// The corners of the face being read, and their positions.
    corners: Vec<u32>,
    polygon: Vec<[f32; 3]>,
}

/// Stands for a corner that no vertex can be.
const NO_VERTEX: u32 = u32::MAX;

impl Builder {
    fn read_element(&mut self, element: &Element, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
        // Rows of nothing take no data, however many there are.
        if element.properties.is_empty() {
            return Ok(());
        }
        match element.name.as_str() {
            "vertex" => self.read_vertices(element, numbers),
            "face" => self.read_lists(element, numbers, Self::add_face),
            "tristrips" => self.read_lists(element, numbers, Self::add_strips),
            _ => skip(element, numbers),
        }
    }

    fn read_vertices(&mut self, element: &Element, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
        let roles: Vec<Role> = element.properties.iter().map(Role::of).collect();
        let has = |wanted: &[Role]| wanted.iter().all(|role| roles.contains(role));
        if !has(&[0, 1, 2].map(Role::Position)) {
            return Err(Problem::Malformed("the vertices lack x, y or z".to_owned()));
        }
        let (with_normals, with_colours) =
            (has(&[0, 1, 2].map(Role::Normal)), has(&[0, 1, 2].map(Role::Colour)));
        for _ in 0..element.count {
            let mut vertex = Vertex::default();
            numbers.begin_row()?;
            for (property, &role) in element.properties.iter().zip(&roles) {
                vertex.read(property, role, numbers)?;
            }
            self.mesh.positions.push(vertex.position);
            if with_normals {
                self.mesh.normals.push(vertex.normal);
            }
            if with_colours {
                self.mesh.colours.push(vertex.colour);
            }
        }
        if u32::try_from(self.mesh.positions.len()).is_ok() {
            Ok(())
        } else {
            Err(Problem::TooMany { what: "vertices" })
        }
    }

    /// Reads rows whose list of vertices goes to `add`.
    fn read_lists(
        &mut self,
        element: &Element,
        numbers: &mut Numbers<'_>,
        add: fn(&mut Self, &dyn Fn() -> String),
    ) -> Result<(), Problem> {
        let named = |property: &Property| matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
        let Some(indices) = element.properties.iter().position(|p| named(p) && p.list.is_some()) else {
            let name = &element.name;
            return Err(Problem::Malformed(format!("the element {name:?} has no list vertex_indices")));
        };
        if !element.properties[indices].scalar.is_whole() {
            return Err(Problem::Malformed("the vertex_indices are not whole numbers".to_owned()));
        }
        for _ in 0..element.count {
            numbers.begin_row()?;
            for (place, property) in element.properties.iter().enumerate() {
                if place == indices {
                    self.read_corners(property, numbers)?;
                } else {
                    skip_property(property, numbers)?;
                }
            }
            add(self, &|| numbers.place());
        }
        Ok(())
    }

    /// Fills `corners`; what can be no vertex becomes [`NO_VERTEX`].
    fn read_corners(&mut self, property: &Property, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
        self.corners.clear();
        let count = property.list.map_or(Ok(0), |count| numbers.count(count))?;
        for _ in 0..count {
            let number = numbers.number(property.scalar)?;
            let is_vertex =
                number >= 0.0 && number < self.mesh.positions.len() as f64 && number.fract() == 0.0;
            self.corners.push(if is_vertex { number as u32 } else { NO_VERTEX });
        }
        Ok(())
    }

    /// Adds the polygon of `corners`.
    fn add_face(&mut self, place: &dyn Fn() -> String) {
        if self.corners.contains(&NO_VERTEX) {
            return self.notes.count("faces skipped that name a vertex that is not there", 1, place);
        }
        // A polygon that stays at a vertex confuses the cut; a triangle may, and is found degenerate later.
        if self.corners.len() > 3 {
            self.corners.dedup();
            while self.corners.len() > 1 && self.corners.first() == self.corners.last() {
                self.corners.pop();
            }
        }
        if self.corners.len() < 3 {
            return self.notes.count("faces skipped that have fewer than three different vertices", 1, place);
        }
        self.polygon.clear();
        self.polygon.extend(self.corners.iter().map(|&corner| self.mesh.positions[corner as usize]));
        if !self.polygon.iter().all(|&position| is_usable(position)) {
            let count = self.corners.len() as u64 - 2;
            return self.notes.count(
                "triangles skipped that touch a position that is not finite",
                count,
                place,
            );
        }
        self.triangulator.triangulate(&self.polygon);
        let corners = &self.corners;
        let triangles = self.triangulator.triangles.iter().map(|t| t.map(|corner| corners[corner as usize]));
        self.mesh.triangles.extend(triangles);
    }

    /// Adds the strips of `corners`, between which there is a -1.
    fn add_strips(&mut self, place: &dyn Fn() -> String) {
        let corners = std::mem::take(&mut self.corners);
        for strip in corners.split(|&corner| corner == NO_VERTEX) {
            for (nth, &[a, b, c]) in strip.array_windows().enumerate() {
                // Strips turn by empty triangles.
                if a != b && b != c && c != a {
                    self.corners.clear();
                    self.corners.extend(if nth % 2 == 0 { [a, b, c] } else { [b, a, c] });
                    self.add_face(place);
                }
            }
        }
        self.corners = corners;
    }

    fn finish(mut self) -> (SourceMesh, Notes) {
        drop_unused(&mut self.mesh);
        let mesh = &mut self.mesh;
        let is_unit =
            mesh.normals.iter_mut().all(|normal| unit(*normal).map(|unit| *normal = unit).is_some());
        if !is_unit {
            mesh.normals = Vec::new();
            let what = "meshes get new normals because some of theirs have no direction";
            self.notes.count(what, 1, || "the only one".to_owned());
        }
        if mesh.colours.iter().all(|&colour| colour == WHITE) {
            mesh.colours = Vec::new();
        }
        (self.mesh, self.notes)
    }
}

/// The numbers of one vertex.
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    colour: Colour,
}

impl Default for Vertex {
    fn default() -> Self {
        Self { position: [0.0; 3], normal: [0.0; 3], colour: WHITE }
    }
}

impl Vertex {
    fn read(&mut self, property: &Property, role: Role, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
        let scalar = property.scalar;
        match role {
            Role::Position(axis) => self.position[axis] = numbers.number(scalar)? as f32,
            Role::Normal(axis) => self.normal[axis] = numbers.number(scalar)? as f32,
            Role::Colour(part) => self.colour[part] = channel_of(numbers.number(scalar)?, scalar),
            Role::Other => skip_property(property, numbers)?,
        }
        Ok(())
    }
}

fn skip(element: &Element, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
    for _ in 0..element.count {
        numbers.begin_row()?;
        for property in &element.properties {
            skip_property(property, numbers)?;
        }
    }
    Ok(())
}

fn skip_property(property: &Property, numbers: &mut Numbers<'_>) -> Result<(), Problem> {
    let count = property.list.map_or(Ok(1), |count| numbers.count(count))?;
    for _ in 0..count {
        numbers.number(property.scalar)?;
    }
    Ok(())
}

/// Removes the vertices that no triangle has; the others keep their order.
fn drop_unused(mesh: &mut SourceMesh) {
    let mut numbers = vec![NO_VERTEX; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| numbers[vertex as usize] = 0);
    if !numbers.contains(&NO_VERTEX) {
        return;
    }
    let used = numbers.iter_mut().filter(|number| **number != NO_VERTEX);
    (0..).zip(used).for_each(|(next, number)| *number = next);
    keep(&mut mesh.positions, &numbers);
    keep(&mut mesh.normals, &numbers);
    keep(&mut mesh.colours, &numbers);
    mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = numbers[*vertex as usize]);
}

/// Keeps the entries that have a number; leaves an empty list empty.
fn keep<T>(list: &mut Vec<T>, numbers: &[u32]) {
    let mut numbers = numbers.iter();
    list.retain(|_| numbers.next().is_some_and(|&number| number != NO_VERTEX));
}
