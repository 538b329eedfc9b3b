//! The data of a PLY file in, one number after the other out, whatever the encoding.

use std::io::BufRead;

use ply_rs_bw::ply::Encoding;

use super::header::{Layout, Scalar};
use crate::import::Problem;
use crate::import::input::read_line;
use crate::import::notes::quoted;

/// The numbers of a file in their order.
pub enum Numbers<'a> {
    /// Written as text.
    Text(Text<'a>),
    /// Written as bytes.
    Bytes(Bytes<'a>),
}

/// Words of lines.
pub struct Text<'a> {
    input: &'a mut dyn BufRead,
    line: Vec<u8>,
    /// How much of the line has been read.
    taken: usize,
    /// The line's number, from 1.
    number: u64,
}

/// Bytes without separators.
pub struct Bytes<'a> {
    input: &'a mut dyn BufRead,
    is_big_endian: bool,
    /// How many bytes of the file have been read.
    offset: u64,
}

impl<'a> Numbers<'a> {
    /// The numbers behind the header.
    pub fn new(input: &'a mut dyn BufRead, layout: &Layout) -> Self {
        let bytes = |input, is_big_endian| Self::Bytes(Bytes { input, is_big_endian, offset: layout.bytes });
        match layout.encoding {
            Encoding::Ascii => Self::Text(Text { input, line: Vec::new(), taken: 0, number: layout.lines }),
            Encoding::BinaryLittleEndian => bytes(input, false),
            Encoding::BinaryBigEndian => bytes(input, true),
        }
    }

    /// Says that the next number is the first of a row.
    ///
    /// # Errors
    ///
    /// [`Problem::Line`] if the line of the last one has more: then rows are not what the header says, and everything
    /// from here on would mean something else. (A row may take several lines.)
    pub fn begin_row(&mut self) -> Result<(), Problem> {
        let Self::Text(text) = self else { return Ok(()) };
        match text.word() {
            None => Ok(()),
            Some(range) => {
                let word = quoted(&String::from_utf8_lossy(&text.line[range]));
                Err(text.problem(format!("{word} is more than the header says that this line has")))
            }
        }
    }

    /// The next number.
    ///
    /// # Errors
    ///
    /// [`Problem::Line`] or [`Problem::Malformed`] if it is none, or the file ends.
    pub fn number(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        match self {
            Self::Text(text) => text.number(scalar),
            Self::Bytes(bytes) => bytes.number(scalar),
        }
    }

    /// The next number, which says how many follow.
    ///
    /// # Errors
    ///
    /// Those of [`Numbers::number`], and for a number that is no count.
    pub fn count(&mut self, scalar: Scalar) -> Result<u64, Problem> {
        let number = self.number(scalar)?;
        if number >= 0.0 && number.fract() == 0.0 {
            return Ok(number as u64);
        }
        let what = format!("a list of {number} items");
        Err(match self {
            Self::Text(text) => text.problem(what),
            Self::Bytes(bytes) => Problem::Malformed(format!("byte {}: {what}", bytes.offset)),
        })
    }

    /// Where the last number is, for a note.
    pub fn place(&self) -> String {
        match self {
            Self::Text(text) => format!("line {}", text.number),
            Self::Bytes(bytes) => format!("byte {}", bytes.offset),
        }
    }
}

impl Text<'_> {
    fn problem(&self, what: String) -> Problem {
        Problem::Line { line: self.number, what }
    }

    /// The next word of this line.
    fn word(&mut self) -> Option<std::ops::Range<usize>> {
        let rest = &self.line[self.taken..];
        let start = self.taken + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let length = self.line[start..].iter().position(u8::is_ascii_whitespace);
        self.taken = length.map_or(self.line.len(), |length| start + length);
        Some(start..self.taken)
    }

    fn number(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        let range = loop {
            if let Some(range) = self.word() {
                break range;
            }
            self.line.clear();
            self.taken = 0;
            if !read_line(self.input, &mut self.line)? {
                return Err(
                    self.problem("the file ends here, before all that its header promises".to_owned())
                );
            }
            self.number += 1;
        };
        let word = str::from_utf8(&self.line[range.clone()]).unwrap_or_default();
        // Rounded once: to the type that is promised.
        let number = match scalar {
            Scalar::F32 => word.parse::<f32>().ok().map(f64::from),
            _ => word.parse::<f64>().ok(),
        };
        number.ok_or_else(|| {
            let word = quoted(&String::from_utf8_lossy(&self.line[range]));
            self.problem(format!("{word} is not a number"))
        })
    }
}

impl Bytes<'_> {
    fn number(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        Ok(match scalar {
            Scalar::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// The next bytes, the least significant first.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                let read = self.offset;
                Problem::Malformed(format!(
                    "the file ends after byte {read}, before all that its header promises"
                ))
            }
            _ => error.into(),
        })?;
        self.offset += N as u64;
        if self.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }
}
