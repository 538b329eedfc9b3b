//! What the user types in, the items whose names have it out, and the way to them.
//!
//! All names are lowered into one buffer, a line each, and all cores look through it for the longest word; where it is
//! found, the line is searched for the others. A word is found wherever it stands in a name. Case does not matter, as
//! far as single characters are lowered to others.

use std::ops::Range;

use memchr::memmem::Finder;
use rayon::prelude::*;

use super::assembly::Assembly;
use super::bits::Bits;
use crate::scene::Scene;

/// Where the names of an assembly come from.
pub trait Names {
    /// The name of a node; may be empty.
    fn node(&self, node: u32) -> &str;
    /// The name of a part; may be empty.
    fn part(&self, part: u32) -> &str;

    /// What to call an item: the name of its node or of its part, or what it is and its number where it has none.
    fn item(&self, assembly: &Assembly, item: u32) -> String {
        let node = assembly.node(item);
        let own = if assembly.is_node(item) { self.node(node) } else { "" };
        let part = assembly.leaf_of_item(item).map(|leaf| assembly.part_of_leaf(leaf));
        match (own, part) {
            ("", Some(part)) if self.part(part).is_empty() => format!("part {part}"),
            ("", Some(part)) => self.part(part).to_owned(),
            ("", None) => format!("node {node}"),
            (own, _) => own.to_owned(),
        }
    }
}

impl Names for Scene {
    fn node(&self, node: u32) -> &str {
        self.node_name(node)
    }

    fn part(&self, part: u32) -> &str {
        self.part_name(part)
    }
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Found {
    /// The items whose names have all the words.
    pub matches: Bits,
    /// The items above them, which may be matches themselves.
    pub ways: Bits,
    /// How many match.
    pub count: u32,
}

/// All names, ready to be searched.
#[derive(Debug, Default)]
pub struct Search {
    /// The names in lower case, each ended by [`END`].
    text: Vec<u8>,
    /// Where each name starts, and the end of the last.
    starts: Vec<u32>,
    /// Names from this one on are those of parts; before, those of nodes.
    first_part: u32,
}

/// Ends a name; in no name and in no word.
const END: u8 = b'\n';

/// So much text leaves room for the ends of as many names as there can be.
const MOST_BYTES: usize = 1 << 31;

/// So many names are searched by one core at a time.
const NAMES_AT_ONCE: usize = 1 << 14;

impl Search {
    /// Lowers all names. Those beyond 2 GiB of text are not found.
    pub fn new(assembly: &Assembly, names: &dyn Names) -> Self {
        let mut search = Self { starts: vec![0], ..Self::default() };
        search.first_part = assembly.nodes();
        (0..assembly.nodes()).for_each(|node| search.append(names.node(node)));
        let placed = || (0..assembly.leaves()).map(|leaf| assembly.part_of_leaf(leaf));
        let mut parts = Bits::new(placed().max().map_or(0, |last| last + 1));
        placed().for_each(|part| _ = parts.insert(part));
        for part in 0..parts.limit() {
            search.append(if parts.has(part) { names.part(part) } else { "" });
        }
        search
    }

    fn append(&mut self, name: &str) {
        if self.text.len() + 3 * name.len() < MOST_BYTES {
            lower_onto(name, &mut self.text);
        }
        self.text.push(END);
        self.starts.push(self.text.len() as u32);
    }

    /// Bytes of memory that it holds.
    pub fn bytes_held(&self) -> u64 {
        (self.text.len() + size_of_val(self.starts.as_slice())) as u64
    }

    /// The items whose names have all the words of a query, which are separated by blanks; none without words.
    pub fn find(&self, assembly: &Assembly, query: &str) -> Option<Found> {
        let mut words: Vec<Vec<u8>> = query.split_whitespace().map(lowered).collect();
        words.sort_by_key(|word| std::cmp::Reverse(word.len()));
        let finders: Vec<Finder<'_>> = words.iter().map(Finder::new).collect();
        let (longest, others) = finders.split_first()?;
        let names = self.starts.len() - 1;
        let blocks = (0..names.div_ceil(NAMES_AT_ONCE)).into_par_iter();
        let hits: Vec<Vec<u32>> = blocks
            .map(|block| {
                let start = block * NAMES_AT_ONCE;
                self.find_in(start..names.min(start + NAMES_AT_ONCE), longest, others)
            })
            .collect();
        Some(self.found(assembly, hits.into_iter().flatten()))
    }

    /// The names of a range that have all words.
    fn find_in(&self, names: Range<usize>, longest: &Finder<'_>, others: &[Finder<'_>]) -> Vec<u32> {
        let end = self.starts[names.end] as usize;
        let (mut name, mut from) = (names.start, self.starts[names.start] as usize);
        let mut hits = Vec::new();
        while let Some(place) = longest.find(&self.text[from..end]) {
            let place = (from + place) as u32;
            while self.starts[name + 1] <= place {
                name += 1;
            }
            from = self.starts[name + 1] as usize;
            let line = &self.text[self.starts[name] as usize..from];
            if others.iter().all(|word| word.find(line).is_some()) {
                hits.push(name as u32);
            }
        }
        hits
    }

    /// The items that have the names, which ascend.
    fn found(&self, assembly: &Assembly, names: impl Iterator<Item = u32>) -> Found {
        let mut matches = Bits::new(assembly.items());
        let mut parts = Bits::new((self.starts.len() - 1) as u32 - self.first_part);
        for name in names {
            match name.checked_sub(self.first_part) {
                None => matches.insert(assembly.item_of_node(name)),
                Some(part) => parts.insert(part),
            };
        }
        if !parts.is_empty() {
            let leaves = (0..assembly.leaves()).filter(|&leaf| parts.has(assembly.part_of_leaf(leaf)));
            leaves.for_each(|leaf| _ = matches.insert(assembly.item_of_leaf(leaf)));
        }
        let (count, ways) = (matches.count(), ways_to(assembly, &matches));
        Found { matches, ways, count }
    }
}

/// The items above others.
fn ways_to(assembly: &Assembly, items: &Bits) -> Bits {
    let mut ways = Bits::new(assembly.items());
    for item in items.iter() {
        // Where one way meets another, the rest is known.
        _ = assembly.way(item).find(|&above| !ways.insert(above));
    }
    ways
}

fn lowered(name: &str) -> Vec<u8> {
    let mut text = Vec::new();
    lower_onto(name, &mut text);
    text
}

fn lower_onto(name: &str, text: &mut Vec<u8>) {
    let start = text.len();
    if name.is_ascii() {
        text.extend_from_slice(name.as_bytes());
        text[start..].make_ascii_lowercase();
    } else {
        let mut buffer = [0; 4];
        let lower = name.chars().flat_map(char::to_lowercase);
        lower.for_each(|c| text.extend_from_slice(c.encode_utf8(&mut buffer).as_bytes()));
    }
    text[start..].iter_mut().filter(|byte| **byte == END).for_each(|byte| *byte = b' ');
}

#[cfg(test)]
mod tests;
