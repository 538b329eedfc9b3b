//! The header of a PLY file in, the layout of its data out.
//!
//! The grammar is that of the `ply-rs-bw` crate. Its tables keep one entry for each name, so that a repeated name
//! would move all data behind it: names are checked before.

use std::io::BufRead;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Encoding, PropertyType, ScalarType};
use rustc_hash::FxHashSet;

use crate::import::Problem;
use crate::import::input::read_line;
use crate::import::notes::quoted;

/// The longest header: thousands of properties and comments.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// What follows the header.
#[derive(Debug)]
pub struct Layout {
    /// How numbers are written.
    pub encoding: Encoding,
    /// The tables, in the order of the data.
    pub elements: Vec<Element>,
    /// How many lines and bytes the header has.
    pub lines: u64,
    /// How many bytes the header has.
    pub bytes: u64,
}

/// One table of the data.
#[derive(Debug)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// How many rows it is said to have: nobody's promise.
    pub count: u64,
    /// What a row has, in order.
    pub properties: Vec<Property>,
}

/// One column of a table.
#[derive(Debug)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// The type of the number of items, in a list.
    pub list: Option<Scalar>,
    /// The type of the number, or of every item of the list.
    pub scalar: Scalar,
}

/// How one number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Whether only whole numbers can be stored.
    pub fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl From<&ScalarType> for Scalar {
    fn from(scalar: &ScalarType) -> Self {
        match scalar {
            ScalarType::Char => Self::I8,
            ScalarType::UChar => Self::U8,
            ScalarType::Short => Self::I16,
            ScalarType::UShort => Self::U16,
            ScalarType::Int => Self::I32,
            ScalarType::UInt => Self::U32,
            ScalarType::Float => Self::F32,
            ScalarType::Double => Self::F64,
        }
    }
}

/// Reads the header, and not a byte more.
///
/// # Errors
///
/// [`Problem::Line`] for a line that no header has, [`Problem::Malformed`] for a header without an end or with names
/// that repeat.
pub fn read(input: &mut dyn BufRead) -> Result<Layout, Problem> {
    let text = header_text(input)?;
    let lines: Vec<&[u8]> = text.split_inclusive(|&byte| byte == b'\n').collect();
    check_names(&lines)?;
    let lossy = String::from_utf8_lossy(&text);
    let parsed = Parser::<DefaultElement>::new().read_header(&mut Reader::new(lossy.as_bytes()));
    let header = parsed.map_err(|error| {
        let line = error.line().unwrap_or(lines.len()).clamp(1, lines.len());
        let what = format!(
            "this is no line of a PLY header: {}",
            quoted(String::from_utf8_lossy(lines[line - 1]).trim())
        );
        Problem::Line { line: line as u64, what }
    })?;
    let elements = header.elements.values().map(element_of).collect();
    Ok(Layout { encoding: header.encoding, elements, lines: lines.len() as u64, bytes: text.len() as u64 })
}

fn element_of(element: &ElementDef) -> Element {
    let properties = element.properties.values().map(|property| {
        let (list, scalar) = match &property.data_type {
            PropertyType::Scalar(scalar) => (None, scalar.into()),
            PropertyType::List(count, item) => (Some(count.into()), item.into()),
        };
        Property { name: property.name.clone(), list, scalar }
    });
    Element { name: element.name.clone(), count: element.count as u64, properties: properties.collect() }
}

/// The lines up to `end_header`, with their ends.
fn header_text(input: &mut dyn BufRead) -> Result<Vec<u8>, Problem> {
    let malformed = |what: &str| Problem::Malformed(format!("this is no PLY file: {what}"));
    let (mut text, mut line) = (Vec::new(), Vec::new());
    loop {
        line.clear();
        if !read_line(input, &mut line)? {
            return Err(malformed("its header has no end (a line `end_header`)"));
        }
        if text.is_empty() && line.trim_ascii_end() != b"ply" {
            return Err(malformed("its first line is not `ply`"));
        }
        text.extend_from_slice(&line);
        if line.trim_ascii_end() == b"end_header" {
            return Ok(text);
        }
        if text.len() > MAX_HEADER_BYTES {
            return Err(malformed("its header is longer than a mebibyte"));
        }
    }
}

/// That no element, and no property of one element, has the name of another.
fn check_names(lines: &[&[u8]]) -> Result<(), Problem> {
    let (mut elements, mut properties) = (FxHashSet::default(), FxHashSet::default());
    for (number, line) in lines.iter().enumerate() {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let is_new = match words.next() {
            Some(b"element") => {
                properties.clear();
                words.next().is_none_or(|name| elements.insert(name))
            }
            Some(b"property") => words.next_back().is_none_or(|name| properties.insert(name)),
            _ => true,
        };
        if !is_new {
            let what = format!("a name is there twice: {}", quoted(String::from_utf8_lossy(line).trim()));
            return Err(Problem::Line { line: number as u64 + 1, what });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn why(text: &str) -> String {
        read(&mut text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn layouts_are_read_up_to_the_data() {
        let text = "ply\r\nformat binary_big_endian 1.0\r\ncomment \u{fc} ply\nobj_info x\nelement vertex 7\n\
            property double x\nelement face 9\nproperty list uchar int vertex_indices\nend_header\nDATA";
        let mut input = text.as_bytes();
        let layout = read(&mut input).unwrap();
        assert_eq!(input, b"DATA");
        assert_eq!((layout.lines, layout.bytes), (9, text.len() as u64 - 4));
        assert_eq!(layout.encoding, Encoding::BinaryBigEndian);
        let shapes: Vec<_> = layout
            .elements
            .iter()
            .map(|e| (e.name.as_str(), e.count, e.properties[0].list, e.properties[0].scalar))
            .collect();
        assert_eq!(shapes, [("vertex", 7, None, Scalar::F64), ("face", 9, Some(Scalar::U8), Scalar::I32)]);
    }

    #[test]
    fn what_is_no_header_is_named() {
        assert!(why("plyx\n").contains("first line is not `ply`"));
        assert!(why("ply\nformat ascii 1.0\n").contains("no end"));
        assert!(why("ply\nend_header\n").contains("line 2: this is no line of a PLY header"));
        assert!(why("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n").starts_with("line 3: "));
        assert!(why("ply\nformat ascii 1.0\nproperty float x\nend_header\n").starts_with("line 3: "));
        assert!(why("ply\nformat text 1.0\nend_header\n").ends_with("\"format text 1.0\""));
        let twice = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty int x\nend_header\n";
        assert_eq!(why(twice), "line 5: a name is there twice: \"property int x\"");
        assert!(why(&format!("ply\n{}", "comment\n".repeat(1 << 18))).contains("longer than a mebibyte"));
    }
}
