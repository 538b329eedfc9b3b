//! The statements of an OBJ text in, tables of vertices and faces by chunk out.
//!
//! Relative indices become absolute; faces that name a missing vertex, and faces of fewer than three different vertices,
//! are skipped and counted; lines, points and texture coordinates go.

use std::io::BufRead;

use rustc_hash::FxHashMap;

use super::faces::{Chunk, Faces};
use super::statements::Statements;
use super::vertices::{Corner, Vertices};
use crate::import::Problem;
use crate::import::notes::Notes;
use crate::import::shelf::Room;

/// Distinct names, numbered from 1.
#[derive(Debug, Default)]
pub struct Names {
    names: Vec<String>,
    numbers: FxHashMap<String, u32>,
}

impl Names {
    /// The name of a number; 0 has an empty one.
    pub fn get(&self, number: u32) -> &str {
        (number as usize).checked_sub(1).and_then(|i| self.names.get(i)).map_or("", String::as_str)
    }

    fn number_of(&mut self, name: &str) -> u32 {
        if name.is_empty() {
            return 0;
        }
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        self.names.push(name.to_owned());
        let number = self.names.len() as u32;
        self.numbers.insert(name.to_owned(), number);
        number
    }
}

/// What a text says.
pub struct Text {
    /// All that faces may refer to.
    pub vertices: Vertices,
    /// The faces, by chunk.
    pub faces: Faces,
    /// The names of chunks.
    pub names: Names,
    /// The arguments of `mtllib` lines, each once.
    pub libraries: Vec<String>,
    /// What was skipped.
    pub notes: Notes,
    line: u64,
    current: Chunk,
    corners: Vec<Corner>,
}

impl Text {
    /// Reads a text to its end.
    ///
    /// # Errors
    /// [`Problem::Line`] for a vertex that is no three numbers, [`Problem::TooLittleMemory`] if the tables of vertices
    /// do not fit the room, [`Problem::Shelve`] if the disk refuses faces, and those of the input.
    pub fn read(input: impl BufRead, room: &Room) -> Result<Self, Problem> {
        let mut text = Self::new(room);
        let mut statements = Statements::new(input);
        while statements.advance()? {
            text.line = statements.line();
            text.add(&statements.text())?;
            if let Err(problem) = text.vertices.settle() {
                let rest_bytes = bytes_of_rest(&mut statements)?;
                return Err(text.check(rest_bytes).err().unwrap_or(problem));
            }
        }
        let largest = text.faces.chunks().iter().map(|gathered| gathered.triangles).max();
        let build_bytes = largest.unwrap_or_default() * super::mesh::BYTES_PER_TRIANGLE;
        text.check(build_bytes)?;
        Ok(text)
    }

    /// That so many bytes more than what there is now are within the cap.
    fn check(&self, more_bytes: u64) -> Result<(), Problem> {
        self.vertices.check(self.faces.bytes() + more_bytes)
    }

    fn new(room: &Room) -> Self {
        Self {
            vertices: Vertices::new(room),
            faces: Faces::new(room),
            names: Names::default(),
            libraries: Vec::new(),
            notes: Notes::default(),
            line: 0,
            current: Chunk::default(),
            corners: Vec::new(),
        }
    }

    fn add(&mut self, statement: &str) -> Result<(), Problem> {
        let (keyword, rest) = statement.split_once([' ', '\t']).unwrap_or((statement, ""));
        let line = self.line;
        let at_line = |what| Problem::Line { line, what };
        match keyword {
            "v" => self.vertices.add_position(rest).map_err(at_line)?,
            "vn" => self.vertices.add_normal(rest).map_err(at_line)?,
            "f" | "fo" => self.add_face(rest)?,
            "l" | "p" => self.note("lines and points skipped"),
            _ => self.add_name(keyword, rest.trim_ascii()),
        }
        Ok(())
    }

    /// Counts something skipped on this line.
    fn note(&mut self, what: &'static str) {
        let line = self.line;
        self.notes.count(what, 1, || format!("line {line}"));
    }

    /// Statements that carry a name.
    fn add_name(&mut self, keyword: &str, name: &str) {
        match keyword {
            "o" => {
                self.current.object = self.names.number_of(name);
                self.current.group = 0;
            }
            "g" => self.current.group = self.names.number_of(name),
            "usemtl" => self.current.material = self.names.number_of(name),
            "mtllib" => {
                let known = self.libraries.iter().any(|library| library == name);
                if !known && !name.is_empty() {
                    self.libraries.push(name.to_owned());
                }
            }
            _ => {}
        }
    }

    fn add_face(&mut self, rest: &str) -> Result<(), Problem> {
        if !self.read_corners(rest) {
            self.note("faces skipped that name a vertex that is not there");
            return Ok(());
        }
        self.leave_out_repeats();
        if self.corners.len() < 3 {
            self.note("faces skipped that have fewer than three different vertices");
            return Ok(());
        }
        let with_normals = self.corners.iter().all(|&corner| self.vertices.normal(corner).is_some());
        self.faces.add(self.current, &self.corners, with_normals).map_err(Problem::Shelve)
    }

    /// Leaves out corners that have the position of the one before, round the face.
    fn leave_out_repeats(&mut self) {
        let corners = &mut self.corners;
        corners.dedup_by_key(|corner| corner.position);
        while corners.len() > 1 && corners.first().map(|c| c.position) == corners.last().map(|c| c.position) {
            corners.pop();
        }
    }

    /// Fills `corners`; `false` if a vertex is not there.
    fn read_corners(&mut self, rest: &str) -> bool {
        self.corners.clear();
        for word in rest.split_ascii_whitespace() {
            if !word.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '+') {
                break;
            }
            let mut fields = word.split('/');
            let Some(position) = fields.next().and_then(|field| self.vertices.position_at(field)) else {
                return false;
            };
            let normal = match fields.nth(1) {
                None | Some("") => 0,
                Some(field) => self.vertices.normal_at(field).unwrap_or_else(|| {
                    self.note("corners name a normal that is not there");
                    0
                }),
            };
            self.corners.push(Corner { position, normal });
        }
        true
    }
}

/// What the tables take at most for the statements that are left, without reading numbers.
fn bytes_of_rest(statements: &mut Statements<impl BufRead>) -> Result<u64, Problem> {
    let mut bytes = 0;
    while statements.advance()? {
        bytes += match statements.text().as_bytes() {
            // It may have a colour.
            [b'v', b' ' | b'\t', ..] => 16,
            [b'v', b'n', ..] => 12,
            _ => 0,
        };
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    fn read(text: &str) -> Text {
        Text::read(text.as_bytes(), &Room::default()).unwrap()
    }

    /// The corners of all faces, chunk by chunk.
    fn faces(text: &mut Text) -> Vec<Vec<Vec<(u32, u32)>>> {
        let mut all = Vec::new();
        for (_, mut runs) in text.faces.by_chunk() {
            let mut of_chunk = Vec::new();
            let mut corners = Vec::new();
            while let Some(mut faces) = runs.advance().unwrap() {
                while faces.next_into(&mut corners) {
                    of_chunk.push(corners.iter().map(|corner| (corner.position, corner.normal)).collect());
                }
            }
            all.push(of_chunk);
        }
        all
    }

    /// The same without normals, where there is one chunk at most.
    fn positions(text: &mut Text) -> Vec<Vec<u32>> {
        let chunks = faces(text);
        assert!(chunks.len() < 2, "{chunks:?}");
        chunks
            .into_iter()
            .flatten()
            .map(|face| face.into_iter().map(|(position, _)| position).collect())
            .collect()
    }

    #[test]
    fn comments_and_trailing_text_go() {
        let mut text = read(&format!("{SQUARE}vt 0 0\nf 1/1 2/1 3/1 # face\ns off\nfo 1 2 \\\n 4 x 3\n"));
        assert_eq!(positions(&mut text), [[1, 2, 3], [1, 2, 4]]);
    }

    #[test]
    fn lines_points_and_short_faces_go() {
        let mut text = read(&format!("{SQUARE}f 1 2\nf 3\nf\nl 1 2 3\np 1\nf 1 1 2\nf 1 2 1\nf 1 2 2 3 1"));
        assert_eq!(positions(&mut text), [[1, 2, 3]]);
        assert_eq!(
            text.notes.into_lines(),
            [
                "5 faces skipped that have fewer than three different vertices (first: line 5)",
                "2 lines and points skipped (first: line 8)"
            ]
        );
    }

    #[test]
    fn indices_become_absolute_or_the_face_goes() {
        let bad =
            "f 1 2 5\nf 0 1 2\nf -5 1 2\nf 1 2 99999999999999999999\nf 1 2 3.5\nf -9223372036854775808 1 2\n";
        let mut text = read(&format!("{SQUARE}f -4 -3 -2\n{bad}v 2 2 2\nf +1 -1 2"));
        assert_eq!(positions(&mut text), [[1, 2, 3], [1, 5, 2]]);
        let lines = text.notes.into_lines();
        assert_eq!(lines, ["6 faces skipped that name a vertex that is not there (first: line 6)"]);
    }

    #[test]
    fn normals_count_until_a_corner_of_the_chunk_has_none() {
        let mut text = read(&format!(
            "{SQUARE}vn 0 0 1\nf 1//1 2//-1 3/7/1\nf 1//1 2//1 3\nf 1//1 2//1 4//1\n\
             g a\nf 1//2 2//1 3//1\ng b\nvn 0 0 0\nf 1//2 2//1 3//1\n"
        ));
        let with_normals: Vec<_> = text.faces.chunks().iter().map(|chunk| chunk.with_normals).collect();
        assert_eq!(with_normals, [false; 3]);
        assert_eq!(
            faces(&mut text),
            [
                vec![
                    vec![(1, 1), (2, 1), (3, 1)],
                    vec![(1, 0), (2, 0), (3, 0)],
                    vec![(1, 0), (2, 0), (4, 0)]
                ],
                vec![vec![(1, 0), (2, 0), (3, 0)]],
                vec![vec![(1, 0), (2, 0), (3, 0)]]
            ]
        );
        assert_eq!(text.notes.into_lines(), ["1 corners name a normal that is not there (first: line 10)"]);
    }

    #[test]
    fn colours_count_wherever_their_line_begins_and_ends() {
        for line in ["v 1 2 3 1 0 0", " \tv 1 2 3 1 0 0", "\u{feff}v 1 2 3 1 0 0", "v 1 2 3 \\\n1 0 0"] {
            let text = read(&format!("{line}\nv 0 0 0"));
            let colours = [1, 2].map(|position| text.vertices.colour(Corner { position, normal: 0 }));
            assert_eq!(colours, [[255, 0, 0, 255], [255; 4]], "{line:?}");
        }
    }

    #[test]
    fn chunks_follow_object_group_and_material() {
        let mut text = read(&format!(
            "{SQUARE}mtllib a b.mtl\no\ng none\no box\ng one two\nusemtl red\nf 1 2 3\nusemtl\nf 1 2 4\nusemtl red\nf 1 3 4\n"
        ));
        let names =
            |chunk: Chunk| [chunk.object, chunk.group, chunk.material].map(|number| text.names.get(number));
        let chunks: Vec<_> = text.faces.chunks().iter().map(|gathered| names(gathered.chunk)).collect();
        assert_eq!(chunks, [["box", "one two", "red"], ["box", "one two", ""]]);
        assert_eq!(text.libraries, ["a b.mtl"]);
        let triangle = |a, b, c| vec![(a, 0), (b, 0), (c, 0)];
        assert_eq!(faces(&mut text), [vec![triangle(1, 2, 3), triangle(1, 3, 4)], vec![triangle(1, 2, 4)]]);
    }

    #[test]
    fn a_vertex_that_is_no_number_is_an_error_with_its_line() {
        for (text, message) in [
            ("v 0 0 0\nv 0 1,5 0\n", "line 2: \"1,5\" is not a number"),
            ("\n\nv 0 1", "line 3: three numbers are needed, but there are 2"),
            ("vn \\\n 1 2\nv x", "line 1: three numbers are needed, but there are 2"),
        ] {
            let problem = Text::read(text.as_bytes(), &Room::default()).err().unwrap();
            assert_eq!(problem.to_string(), message);
        }
    }

    /// Text with so many vertices and a triangle, and bytes of the tables that it takes.
    fn long(vertices: usize) -> (String, u64) {
        ("v 0 0 1\nvn 0 1 0\n".repeat(vertices) + "f 1 2 3\n", 24 * vertices as u64)
    }

    #[test]
    fn a_cap_counts_what_the_tables_take_and_nothing_else() {
        let (text, bytes) = long(200_000);
        let read = |cap: u64| {
            let room = Room::new(cap / 4, Some(cap), &std::env::temp_dir());
            Text::read(text.as_bytes(), &room).map(|_| ())
        };
        let enough = (32 << 20) + bytes + (1 << 10);
        read(enough).unwrap();
        for too_little in [1, 32 << 20, enough - bytes / 2, enough - (2 << 10)] {
            let Problem::TooLittleMemory { need_bytes, .. } = read(too_little).unwrap_err() else {
                panic!("{too_little} is refused for another reason");
            };
            // Whether the vertices that were not read have colours is not known.
            assert!(need_bytes <= enough + 4 * 200_000, "{need_bytes} of {enough}");
            read(need_bytes).unwrap();
        }
    }
}
