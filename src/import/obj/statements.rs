//! The lines of an OBJ text in, its statements out: continued lines joined, line ends and trailing blanks gone.

use std::borrow::Cow;
use std::io::{self, BufRead};

use crate::import::input::read_line;

/// A reader of statements, one after another.
pub struct Statements<R> {
    input: R,
    bytes: Vec<u8>,
    first_line: u64,
    last_line: u64,
}

impl<R: BufRead> Statements<R> {
    /// Those of a text.
    pub fn new(input: R) -> Self {
        Self { input, bytes: Vec::new(), first_line: 0, last_line: 0 }
    }

    /// Goes on to the next statement; `false` at the end of the text.
    ///
    /// # Errors
    /// Those of the input, and that the statement is too long to be one.
    pub fn advance(&mut self) -> io::Result<bool> {
        self.bytes.clear();
        self.first_line = self.last_line + 1;
        loop {
            if !read_line(&mut self.input, &mut self.bytes)? {
                return Ok(!self.bytes.is_empty());
            }
            self.last_line += 1;
            let end = self.bytes.trim_ascii_end().len();
            self.bytes.truncate(end);
            // A path in a comment may end in a backslash.
            if self.bytes.last() != Some(&b'\\') || self.bytes.trim_ascii_start().starts_with(b"#") {
                return Ok(true);
            }
            self.bytes.pop();
            self.bytes.push(b' ');
        }
    }

    /// The line on which the statement begins, from 1.
    pub fn line(&self) -> u64 {
        self.first_line
    }

    /// The statement, without blanks around it.
    pub fn text(&self) -> Cow<'_, str> {
        match String::from_utf8_lossy(&self.bytes) {
            Cow::Borrowed(text) => Cow::Borrowed(bare(text)),
            Cow::Owned(text) => Cow::Owned(bare(&text).to_owned()),
        }
    }
}

fn bare(text: &str) -> &str {
    text.trim_start_matches('\u{feff}').trim_ascii()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &[u8]) -> Vec<(u64, String)> {
        let mut statements = Statements::new(text);
        let mut all = Vec::new();
        while statements.advance().unwrap() {
            all.push((statements.line(), statements.text().into_owned()));
        }
        all
    }

    #[test]
    fn continued_lines_are_joined() {
        let all = statements(b"# path\\\nf 1 2 \\\r\n 3\\\n 4\nf 1 2 3\\");
        let expected = [(1, "# path\\"), (2, "f 1 2   3  4"), (5, "f 1 2 3")];
        assert_eq!(all, expected.map(|(line, text)| (line, text.to_owned())));
    }

    #[test]
    fn marks_and_bytes_that_are_no_text_do_no_harm() {
        let all = statements(b"\xef\xbb\xbfv 0 0 0\t\r\n\no \xff\xfe \n");
        let expected = [(1, "v 0 0 0"), (2, ""), (3, "o \u{fffd}\u{fffd}")];
        assert_eq!(all, expected.map(|(line, text)| (line, text.to_owned())));
    }
}
