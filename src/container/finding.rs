//! A list of what is wrong in a container: pairs of place and problem, up to a limit.

/// What is wrong at one place after another; the reader stops at the first, `verify` collects more.
pub(super) struct Findings {
    place: String,
    found: Vec<(String, String)>,
    limit: usize,
}

impl Findings {
    /// An empty list for a place, with room for `limit` findings.
    pub(super) fn new(place: String, limit: usize) -> Self {
        Self { place, found: Vec::new(), limit }
    }

    /// From here on, findings are about another place.
    pub(super) fn set_place(&mut self, place: String) {
        self.place = place;
    }

    /// Adds a finding if there is room.
    pub(super) fn add(&mut self, problem: impl FnOnce() -> String) {
        if !self.is_full() {
            self.found.push((self.place.clone(), problem()));
        }
    }

    /// Adds a finding unless `right`.
    pub(super) fn expect(&mut self, right: bool, problem: impl FnOnce() -> String) {
        if !right {
            self.add(problem);
        }
    }

    pub(super) fn is_full(&self) -> bool {
        self.found.len() >= self.limit
    }

    pub(super) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// The first finding, as (place, problem).
    pub(super) fn into_first(self) -> Option<(String, String)> {
        self.found.into_iter().next()
    }

    /// One line for each finding.
    pub(super) fn into_lines(self) -> impl Iterator<Item = String> {
        self.found.into_iter().map(|(place, problem)| format!("{place}: {problem}"))
    }
}
