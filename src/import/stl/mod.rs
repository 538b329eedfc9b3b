//! An STL file in, text or binary, a [`Model`] with one mesh a solid out.
//!
//! A file of exactly the bytes that its count of triangles needs is binary, whatever its first word: many binary
//! files begin with "solid". Corners of equal position become one vertex. The facets' own normals, often zero or
//! wrong, and their two bytes of attributes are not used; the bake makes normals by crease angle.
//!
//! The `stl_io` crate is the oracle of the tests and no more: it tells text by the first word, and refuses upper
//! case, names that are empty and normals that are no numbers.

mod text;

use std::io::{self, BufRead, Read};

use rustc_hash::FxHashMap;

use super::attributes::is_usable;
use super::input::{Input, stem_of};
use super::notes::Notes;
use super::{Model, Problem, Shelf, SourceMesh, model_of_one};

/// The bytes before the first triangle of a binary file: 80 of any content, and the count.
const HEADER_BYTES: u64 = 84;

/// The bytes of a triangle: a normal, three corners, and two of attributes.
const TRIANGLE_BYTES: u64 = 50;

/// Reads one STL file.
///
/// # Errors
///
/// [`Problem::Malformed`] for binary data that end before all that their header promises. Facets with bad corners are
/// skipped and noted.
pub(super) fn read(input: &Input<'_>, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
    let mut head = Vec::new();
    input.open()?.take(HEADER_BYTES).read_to_end(&mut head)?;
    let length = input.length()?;
    let promised = head
        .last_chunk()
        .filter(|_| head.len() as u64 == HEADER_BYTES)
        .map(|count| u32::from_le_bytes(*count));
    let is_exact = promised.is_some_and(|count| length == bytes_of(count));
    if !is_exact && text::is_text(&head) {
        return text::read(&mut *input.open()?, &stem_of(input.path), shelf);
    }
    let Some(count) = promised else {
        let what = "this is neither text that begins with \"solid\" nor long enough for a binary header";
        return Err(Problem::Malformed(what.to_owned()));
    };
    let mut notes = Notes::default();
    check_length(count, length, &mut notes)?;
    let mesh = read_binary(&mut *input.open()?, count, &mut notes)?;
    model_of_one(mesh, stem_of(input.path), notes, shelf)
}

fn bytes_of(count: u32) -> u64 {
    HEADER_BYTES + TRIANGLE_BYTES * u64::from(count)
}

/// That there are the bytes that a header promises; more are noted.
fn check_length(count: u32, length: u64, notes: &mut Notes) -> Result<(), Problem> {
    let needed = bytes_of(count);
    if length < needed {
        return Err(Problem::Malformed(format!(
            "the file is cut short: {count} triangles take {needed} bytes, but there are {length}"
        )));
    }
    notes.count("bytes behind the last triangle are not read", length - needed, || format!("byte {needed}"));
    Ok(())
}

/// Reads that many triangles of a binary file.
fn read_binary(input: &mut dyn BufRead, count: u32, notes: &mut Notes) -> Result<SourceMesh, Problem> {
    io::copy(&mut input.take(HEADER_BYTES), &mut io::sink())?;
    let mut merger = Merger::default();
    let mut triangle = [0; TRIANGLE_BYTES as usize];
    for _ in 0..count {
        input.read_exact(&mut triangle)?;
        merger.add(corners_of(&triangle));
    }
    Ok(merger.finish(notes))
}

/// The three corners behind the normal.
fn corners_of(triangle: &[u8; TRIANGLE_BYTES as usize]) -> [[f32; 3]; 3] {
    let number = |at: usize| f32::from_le_bytes(std::array::from_fn(|i| triangle[at + i]));
    [12, 24, 36].map(|at| [number(at), number(at + 4), number(at + 8)])
}

/// Makes one vertex of all corners at one position.
#[derive(Default)]
struct Merger {
    mesh: SourceMesh,
    vertices: FxHashMap<[u32; 3], u32>,
    /// Triangles skipped for a broken position.
    broken: u64,
}

impl Merger {
    fn add(&mut self, corners: [[f32; 3]; 3]) {
        if !corners.iter().all(|&corner| is_usable(corner)) {
            self.broken += 1;
            return;
        }
        let triangle = corners.map(|corner| self.number_of(corner));
        self.mesh.triangles.push(triangle);
    }

    fn number_of(&mut self, position: [f32; 3]) -> u32 {
        // The sum makes 0 of -0, which is the same position.
        let position = position.map(|coordinate| coordinate + 0.0);
        let next = self.mesh.positions.len() as u32;
        let number = *self.vertices.entry(position.map(f32::to_bits)).or_insert(next);
        if number == next {
            self.mesh.positions.push(position);
        }
        number
    }

    fn finish(self, notes: &mut Notes) -> SourceMesh {
        let what = "triangles skipped that touch a position that is not finite";
        notes.count(what, self.broken, || "in an STL file".to_owned());
        self.mesh
    }
}
