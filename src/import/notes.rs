//! What was skipped while reading, counted, so that a million bad faces make one line.

/// How many characters of a name are shown in a message.
const SHOWN: usize = 60;

/// Counted notes, in the order in which each kind first came up.
#[derive(Debug, Default)]
pub(super) struct Notes {
    tallies: Vec<Tally>,
}

#[derive(Debug)]
struct Tally {
    what: &'static str,
    count: u64,
    first: String,
}

impl Notes {
    /// Counts `count` more of `what` (a plural that reads after a number); `first` tells where the first one
    /// is.
    pub fn count(&mut self, what: &'static str, count: u64, first: impl FnOnce() -> String) {
        if count == 0 {
            return;
        }
        match self.tallies.iter_mut().find(|tally| tally.what == what) {
            Some(tally) => tally.count += count,
            None => self.tallies.push(Tally { what, count, first: first() }),
        }
    }

    /// Moves another reader's notes behind these.
    pub fn append(&mut self, other: Self) {
        for tally in other.tallies {
            self.count(tally.what, tally.count, || tally.first);
        }
    }

    /// One line for each kind.
    pub fn into_lines(self) -> Vec<String> {
        let line = |tally: Tally| format!("{} {} (first: {})", tally.count, tally.what, tally.first);
        self.tallies.into_iter().map(line).collect()
    }
}

/// A name from a file, fit for one line of a message: quoted, escaped and shortened.
pub(super) fn quoted(name: &str) -> String {
    let mut shown: String = name.chars().take(SHOWN).collect();
    if shown.len() < name.len() {
        shown.push('…');
    }
    format!("{shown:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_one_kind_are_one_line() {
        let mut notes = Notes::default();
        notes.count("faces skipped", 2, || "line 3".to_owned());
        notes.count("nothing", 0, || unreachable!());
        notes.count("faces skipped", 5, || unreachable!());
        assert_eq!(notes.into_lines(), ["7 faces skipped (first: line 3)"]);
    }

    #[test]
    fn quoted_names_are_short_and_escaped() {
        assert_eq!(quoted("a\0b\u{202e}"), "\"a\\0b\\u{202e}\"");
        assert!(quoted(&"x".repeat(100_000)).len() < 70);
    }
}
