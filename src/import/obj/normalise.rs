//! Any OBJ text in, the small dialect that `tobj` reads without fail out.
//!
//! Statements are taken line by line: continued lines are joined, comments and trailing text dropped, line
//! ends unified; relative indices become absolute; faces that name a missing vertex, and faces of fewer than
//! three different vertices, are skipped and counted; lines, points and texture coordinates go. What `tobj`
//! gets is `v`, `vn`, `f` and, before the faces of another object, group or material, a `g` line with the
//! number of that [`Chunk`].

use std::fmt::Write as _;
use std::io::{self, BufRead, Read};

use rustc_hash::FxHashMap;

use crate::import::Problem;
use crate::import::input::read_line;
use crate::import::notes::{Notes, quoted};

/// Which object, group and material faces belong to, as numbers of [`Names`]; 0 stands for none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Chunk {
    /// The `o` line in force.
    pub object: u32,
    /// The `g` line in force.
    pub group: u32,
    /// The `usemtl` line in force.
    pub material: u32,
}

/// Distinct names, numbered from 1.
#[derive(Debug)]
pub struct Names {
    names: Vec<String>,
}

impl Names {
    /// The name of a number; 0 has an empty one.
    pub fn get(&self, number: u32) -> &str {
        (number as usize).checked_sub(1).and_then(|i| self.names.get(i)).map_or("", String::as_str)
    }
}

/// What the normaliser found out, once the text is read.
#[derive(Debug)]
pub struct Parsed {
    /// The names of chunks.
    pub names: Names,
    /// All chunks that have faces, in the order of their first face.
    pub chunks: Vec<Chunk>,
    /// The arguments of `mtllib` lines, each once.
    pub libraries: Vec<String>,
    /// What was skipped.
    pub notes: Notes,
}

/// A reader of the normalised text.
pub struct Normaliser<R> {
    input: R,
    /// The statement being read, with continuations joined.
    statement: Vec<u8>,
    /// The line on which it begins, and the last line read; from 1.
    line: u64,
    last_line: u64,
    /// Normalised text, of which `taken` bytes are consumed.
    output: String,
    taken: usize,
    coloured: bool,
    positions: i64,
    normals: i64,
    /// Corners of the face being read: position and normal, from 1; normal 0 for none.
    corners: Vec<(i64, i64)>,
    current: Chunk,
    chosen: Option<Chunk>,
    chunk_numbers: FxHashMap<Chunk, usize>,
    name_numbers: FxHashMap<String, u32>,
    parsed: Parsed,
    problem: Option<Problem>,
}

impl<R: BufRead> Normaliser<R> {
    /// Normalises `input`; with `coloured`, every vertex gets a colour (white where it has none), since
    /// `tobj` mixes up colours unless all vertices have one.
    pub fn new(input: R, coloured: bool) -> Self {
        let parsed = Parsed {
            names: Names { names: Vec::new() },
            chunks: Vec::new(),
            libraries: Vec::new(),
            notes: Notes::default(),
        };
        Self {
            input,
            statement: Vec::new(),
            line: 0,
            last_line: 0,
            output: String::new(),
            taken: 0,
            coloured,
            positions: 0,
            normals: 0,
            corners: Vec::new(),
            current: Chunk::default(),
            chosen: None,
            chunk_numbers: FxHashMap::default(),
            name_numbers: FxHashMap::default(),
            parsed,
            problem: None,
        }
    }

    /// What was found; the problem, if there was one that ended the text early.
    pub fn finish(self) -> Result<Parsed, Problem> {
        self.problem.map_or(Ok(self.parsed), Err)
    }

    /// Reads one statement with its continuations; `false` at the end of the text.
    fn next_statement(&mut self) -> io::Result<bool> {
        self.statement.clear();
        self.line = self.last_line + 1;
        loop {
            if !read_line(&mut self.input, &mut self.statement)? {
                return Ok(!self.statement.is_empty());
            }
            self.last_line += 1;
            let end = self.statement.trim_ascii_end().len();
            self.statement.truncate(end);
            // A path in a comment may end in a backslash.
            if self.statement.last() != Some(&b'\\') || self.statement.trim_ascii_start().starts_with(b"#") {
                return Ok(true);
            }
            self.statement.pop();
            self.statement.push(b' ');
        }
    }

    /// Normalises one statement into `output`.
    fn normalise(&mut self, statement: &str) -> Result<(), String> {
        let statement = statement.trim_start_matches('\u{feff}').trim_ascii();
        let (keyword, rest) = statement.split_once([' ', '\t']).unwrap_or((statement, ""));
        match keyword {
            "v" => self.vertex(rest),
            "vn" => self.normal(rest),
            "f" | "fo" => {
                self.face(rest);
                Ok(())
            }
            "l" | "p" => {
                self.note("lines and points skipped", 1);
                Ok(())
            }
            _ => {
                self.named(keyword, rest.trim_ascii());
                Ok(())
            }
        }
    }

    /// Counts something skipped on this line.
    fn note(&mut self, what: &'static str, count: u64) {
        let line = self.line;
        self.parsed.notes.count(what, count, || format!("line {line}"));
    }

    /// Statements that carry a name.
    fn named(&mut self, keyword: &str, name: &str) {
        match keyword {
            "o" => {
                self.current.object = self.number_of(name);
                self.current.group = 0;
            }
            "g" => self.current.group = self.number_of(name),
            "usemtl" => self.current.material = self.number_of(name),
            "mtllib" => {
                let known = self.parsed.libraries.iter().any(|library| library == name);
                if !known && !name.is_empty() {
                    self.parsed.libraries.push(name.to_owned());
                }
            }
            _ => {}
        }
    }

    fn number_of(&mut self, name: &str) -> u32 {
        if name.is_empty() {
            return 0;
        }
        if let Some(&number) = self.name_numbers.get(name) {
            return number;
        }
        self.parsed.names.names.push(name.to_owned());
        let number = self.parsed.names.names.len() as u32;
        self.name_numbers.insert(name.to_owned(), number);
        number
    }

    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let (numbers, count) = leading_numbers(rest)?;
        let [mut x, mut y, mut z, ..] = numbers;
        // Three numbers may be followed by a weight, by a colour, or by both.
        let (weight, colour) = match count {
            4 | 5 => (numbers[3], None),
            6 => (1.0, Some([numbers[3], numbers[4], numbers[5]])),
            7 => (numbers[3], Some([numbers[4], numbers[5], numbers[6]])),
            _ => (1.0, None),
        };
        if weight != 1.0 && weight != 0.0 {
            [x, y, z] = [x / weight, y / weight, z / weight];
        }
        self.positions += 1;
        // Rust writes the shortest text that reads back as the same number.
        let _ = write!(self.output, "v {x} {y} {z}");
        if self.coloured {
            let [r, g, b] = in_unit_range(colour.unwrap_or([1.0; 3]));
            let _ = write!(self.output, " {r} {g} {b}");
        }
        self.output.push('\n');
        Ok(())
    }

    fn normal(&mut self, rest: &str) -> Result<(), String> {
        let ([x, y, z, ..], _) = leading_numbers(rest)?;
        if self.normals == 0 {
            // Normal 1 has no direction: corners without a normal refer to it, since `tobj` would invent one.
            self.output.push_str("vn 0 0 0\n");
        }
        self.normals += 1;
        let _ = writeln!(self.output, "vn {x} {y} {z}");
        Ok(())
    }

    fn face(&mut self, rest: &str) {
        if !self.read_corners(rest) {
            return self.note("faces skipped that name a vertex that is not there", 1);
        }
        self.corners.dedup_by_key(|corner| corner.0);
        while self.corners.len() > 1 && self.corners.first().map(|c| c.0) == self.corners.last().map(|c| c.0)
        {
            self.corners.pop();
        }
        if self.corners.len() < 3 {
            return self.note("faces skipped that have fewer than three different vertices", 1);
        }
        self.choose_chunk();
        self.output.push('f');
        for &(position, normal) in &self.corners {
            let _ = match self.normals {
                0 => write!(self.output, " {position}"),
                _ => write!(self.output, " {position}//{}", normal + 1),
            };
        }
        self.output.push('\n');
    }

    /// Fills `corners`; `false` if a vertex is not there.
    fn read_corners(&mut self, rest: &str) -> bool {
        self.corners.clear();
        for word in rest.split_ascii_whitespace() {
            if !word.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '+') {
                break;
            }
            let mut fields = word.split('/');
            let Some(position) = fields.next().and_then(|field| absolute(field, self.positions)) else {
                return false;
            };
            let normal = match fields.nth(1) {
                None | Some("") => 0,
                Some(field) => absolute(field, self.normals).unwrap_or_else(|| {
                    self.note("corners name a normal that is not there", 1);
                    0
                }),
            };
            self.corners.push((position, normal));
        }
        true
    }

    /// Tells `tobj` of another chunk, if this face belongs to one.
    fn choose_chunk(&mut self) {
        if self.chosen == Some(self.current) {
            return;
        }
        self.chosen = Some(self.current);
        let next = self.parsed.chunks.len();
        let number = *self.chunk_numbers.entry(self.current).or_insert(next);
        if number == next {
            self.parsed.chunks.push(self.current);
        }
        let _ = writeln!(self.output, "g {number}");
    }

    /// Refills `output`; leaves it empty at the end of the text.
    fn refill(&mut self) -> io::Result<()> {
        self.output.clear();
        self.taken = 0;
        while self.output.is_empty() && self.next_statement()? {
            let statement = std::mem::take(&mut self.statement);
            let result = self.normalise(&String::from_utf8_lossy(&statement));
            self.statement = statement;
            if let Err(what) = result {
                self.problem = Some(Problem::Line { line: self.line, what });
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        Ok(())
    }
}

impl<R: BufRead> BufRead for Normaliser<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.taken >= self.output.len()
            && let Err(error) = self.refill()
        {
            let kind = error.kind();
            self.problem.get_or_insert(Problem::from(error));
            return Err(kind.into());
        }
        Ok(&self.output.as_bytes()[self.taken..])
    }

    fn consume(&mut self, amount: usize) {
        self.taken = (self.taken + amount).min(self.output.len());
    }
}

impl<R: BufRead> Read for Normaliser<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

/// Up to seven leading numbers of a line, and how many there are: at least three.
fn leading_numbers(rest: &str) -> Result<([f32; 7], usize), String> {
    let mut numbers = [0.0; 7];
    let mut count = 0;
    for (slot, word) in numbers.iter_mut().zip(rest.split_ascii_whitespace()) {
        match word.parse() {
            Ok(number) => *slot = number,
            Err(_) if count < 3 && !word.starts_with('#') => {
                return Err(format!("{} is not a number", quoted(word)));
            }
            Err(_) => break,
        }
        count += 1;
    }
    if count < 3 {
        Err(format!("three numbers are needed, but there are {count}"))
    } else {
        Ok((numbers, count))
    }
}

/// Colours are meant to be in 0..1, but some programs write 0..255.
fn in_unit_range(colour: [f32; 3]) -> [f32; 3] {
    if colour.iter().any(|&c| c > 1.0) { colour.map(|c| c / 255.0) } else { colour }
}

/// An index counted from 1, or backwards from -1, as one counted from 1; `None` if there is no such element.
fn absolute(field: &str, count: i64) -> Option<i64> {
    let index: i64 = field.parse().ok()?;
    let absolute = if index < 0 { count.checked_add(index)?.checked_add(1)? } else { index };
    (1..=count).contains(&absolute).then_some(absolute)
}

/// Whether any vertex of the text has a colour: six numbers or more.
///
/// # Errors
///
/// Those of `input`.
pub fn has_vertex_colours(mut input: impl BufRead) -> io::Result<bool> {
    let mut line = Vec::new();
    loop {
        line.clear();
        if !read_line(&mut input, &mut line)? {
            return Ok(false);
        }
        // A vertex without colour is told by its few words, without reading numbers.
        let is_vertex = line.starts_with(b"v ") || line.starts_with(b"v\t");
        if is_vertex && line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count() > 6 {
            let text = String::from_utf8_lossy(&line[1..]);
            if leading_numbers(&text).is_ok_and(|(_, count)| count >= 6) {
                return Ok(true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normalised(text: &str) -> (String, Parsed) {
        let coloured = has_vertex_colours(text.as_bytes()).unwrap();
        let mut reader = Normaliser::new(text.as_bytes(), coloured);
        let mut output = String::new();
        reader.read_to_string(&mut output).unwrap();
        (output, reader.finish().unwrap())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn continued_lines_are_joined() {
        let (output, _) = normalised(&format!("# path\\\n{SQUARE}f 1 2 \\\r\n 3\\\n 4\nf 1 2 3"));
        assert_eq!(output, format!("{SQUARE}g 0\nf 1 2 3 4\nf 1 2 3\n"));
    }

    #[test]
    fn comments_and_trailing_text_go() {
        let text =
            "\u{feff}v 0 0 0\tcomment\r\nv 1 0 0 # x\nv 1 1 0 1.0\nvt 0 0\nf 1/1 2/1 3/1 # face\ns off\n";
        let (output, _) = normalised(text);
        assert_eq!(output, "v 0 0 0\nv 1 0 0\nv 1 1 0\ng 0\nf 1 2 3\n");
    }

    #[test]
    fn lines_points_and_short_faces_go() {
        let (output, parsed) =
            normalised(&format!("{SQUARE}f 1 2\nf 3\nf\nl 1 2 3\np 1\nf 1 1 2\nf 1 2 1\nf 1 2 3"));
        assert_eq!(output, format!("{SQUARE}g 0\nf 1 2 3\n"));
        assert_eq!(
            parsed.notes.into_lines(),
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
        let (output, parsed) = normalised(&format!("{SQUARE}f -4 -3 -2\n{bad}"));
        assert_eq!(output, format!("{SQUARE}g 0\nf 1 2 3\n"));
        let lines = parsed.notes.into_lines();
        assert_eq!(lines, ["6 faces skipped that name a vertex that is not there (first: line 6)"]);
    }

    #[test]
    fn missing_normals_refer_to_one_without_direction() {
        let (output, parsed) = normalised(&format!("{SQUARE}vn 0 0 1\nf 1//1 2//-1 3\nf 1//2 2/7/1 3//1\n"));
        assert_eq!(output, format!("{SQUARE}vn 0 0 0\nvn 0 0 1\ng 0\nf 1//2 2//2 3//1\nf 1//1 2//2 3//2\n"));
        assert_eq!(parsed.notes.into_lines(), ["1 corners name a normal that is not there (first: line 7)"]);
    }

    #[test]
    fn chunks_follow_object_group_and_material() {
        let text = format!(
            "{SQUARE}mtllib a b.mtl\no\ng none\no box\ng one two\nusemtl red\nf 1 2 3\nusemtl\nf 1 2 4\nusemtl red\nf 1 3 4\n"
        );
        let (output, parsed) = normalised(&text);
        assert_eq!(output, format!("{SQUARE}g 0\nf 1 2 3\ng 1\nf 1 2 4\ng 0\nf 1 3 4\n"));
        let names: Vec<_> = parsed
            .chunks
            .iter()
            .map(|c| [c.object, c.group, c.material].map(|n| parsed.names.get(n)))
            .collect();
        assert_eq!(names, [["box", "one two", "red"], ["box", "one two", ""]]);
        assert_eq!(parsed.libraries, ["a b.mtl"]);
    }

    #[test]
    fn one_colour_gives_every_vertex_one() {
        let (output, _) = normalised("v 0 0 0\nv 1 0 0 1 0.5 0.25 0\nv 0 1 0 255 0 51\nv 4 2 0 2\n");
        assert_eq!(output, "v 0 0 0 1 1 1\nv 1 0 0 0.5 0.25 0\nv 0 1 0 1 0 0.2\nv 2 1 0 1 1 1\n");
    }

    #[test]
    fn a_vertex_that_is_no_number_is_an_error_with_its_line() {
        for (text, message) in [
            ("v 0 0 0\nv 0 1,5 0\n", "line 2: \"1,5\" is not a number"),
            ("\n\nv 0 1", "line 3: three numbers are needed, but there are 2"),
            ("vn \\\n 1 2\nv x", "line 1: three numbers are needed, but there are 2"),
        ] {
            let mut reader = Normaliser::new(text.as_bytes(), false);
            assert!(reader.read_to_string(&mut String::new()).is_err());
            assert_eq!(reader.finish().unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn bytes_that_are_no_text_do_no_harm() {
        let mut reader = Normaliser::new(&b"o \xff\xfe\nv 0 0 0\n\x00\x80\nf 1 1 1\n"[..], false);
        let mut output = String::new();
        reader.read_to_string(&mut output).unwrap();
        assert_eq!(output, "v 0 0 0\n");
    }
}
