//! What is expanded and what is searched for in, the list of visible rows out.
//!
//! Rows are items of the [`Assembly`], whose numbers ascend from row to row: the row of an item is found by halving, and
//! expanding or collapsing one item inserts or removes one run of rows.

use std::ops::Range;
use std::sync::Arc;

use super::assembly::Assembly;
use super::bits::Bits;
use super::search::Found;

/// The rows of the assembly tree.
#[derive(Debug, Clone)]
pub struct Tree {
    assembly: Arc<Assembly>,
    /// The items that show what is below them; leaves may be among them.
    expanded: Bits,
    filter: Option<Filter>,
    /// The items that are visible, ascending.
    rows: Vec<u32>,
}

/// What is shown of the tree while something is searched for; it has expanded items of its own.
#[derive(Debug, Clone)]
struct Filter {
    shown: Bits,
    expanded: Bits,
}

impl Tree {
    /// The roots as rows, and what is below it if there is only one.
    pub fn new(assembly: Arc<Assembly>) -> Self {
        let expanded = Bits::new(assembly.items());
        let mut tree = Self { assembly, expanded, filter: None, rows: Vec::new() };
        if tree.assembly.items() > 0 && tree.assembly.end(0) == tree.assembly.items() {
            tree.expanded.insert(0);
        }
        tree.rebuild();
        tree
    }

    /// What it shows.
    pub fn assembly(&self) -> &Arc<Assembly> {
        &self.assembly
    }

    /// The items that are visible, from top to bottom; ascending.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// The row of an item, if it is visible.
    pub fn row_of(&self, item: u32) -> Option<usize> {
        self.rows.binary_search(&item).ok()
    }

    /// Whether an item shows what is below it.
    pub fn is_expanded(&self, item: u32) -> bool {
        self.filter.as_ref().map_or(&self.expanded, |filter| &filter.expanded).has(item)
    }

    /// Whether there is anything below an item that could be shown.
    pub fn can_expand(&self, item: u32) -> bool {
        self.next_shown(item + 1).is_some_and(|next| next < self.assembly.end(item))
    }

    /// Whether only what was found is shown.
    pub fn is_filtered(&self) -> bool {
        self.filter.is_some()
    }

    /// Shows what is below an item.
    pub fn expand(&mut self, item: u32) {
        self.expanded_mut().insert(item);
        self.refresh(item);
    }

    /// Hides what is below an item; what is expanded below it stays so.
    pub fn collapse(&mut self, item: u32) {
        self.expanded_mut().remove(item);
        self.refresh(item);
    }

    /// Expands an item that is not, or collapses it.
    pub fn toggle(&mut self, item: u32) {
        if self.is_expanded(item) { self.collapse(item) } else { self.expand(item) }
    }

    /// Expands an item and all that is below it.
    pub fn expand_below(&mut self, item: u32) {
        let branch = self.assembly.branch(item);
        self.expanded_mut().insert_range(branch);
        self.refresh(item);
    }

    /// Collapses an item and all that is below it.
    pub fn collapse_below(&mut self, item: u32) {
        let branch = self.assembly.branch(item);
        self.expanded_mut().remove_range(branch);
        self.refresh(item);
    }

    /// Expands everything.
    pub fn expand_all(&mut self) {
        let all = 0..self.assembly.items();
        self.expanded_mut().insert_range(all);
        self.rebuild();
    }

    /// Collapses everything: only roots are left.
    pub fn collapse_all(&mut self) {
        self.expanded_mut().clear();
        self.rebuild();
    }

    /// Shows only what was found and the way to it, expanded; or everything again.
    pub fn set_filter(&mut self, found: Option<&Found>) {
        self.filter = found.map(|found| {
            let mut shown = found.matches.clone();
            shown.union(&found.ways);
            Filter { shown, expanded: found.ways.clone() }
        });
        self.rebuild();
    }

    /// Expands the way to an instance and tells its row; none if it is not among what is found.
    pub fn reveal(&mut self, instance: u32) -> Option<usize> {
        let leaf = self.assembly.leaf_of_instance(instance)?;
        self.reveal_item(self.assembly.item_of_leaf(leaf))
    }

    /// Expands the way to an item and tells its row; none if it is not among what is found.
    pub fn reveal_item(&mut self, item: u32) -> Option<usize> {
        if self.filter.as_ref().is_some_and(|filter| !filter.shown.has(item)) {
            return None;
        }
        let assembly = self.assembly.clone();
        let mut topmost = None;
        for above in assembly.way(item) {
            if self.expanded_mut().insert(above) {
                topmost = Some(above);
            }
        }
        if let Some(above) = topmost {
            self.refresh(above);
        }
        self.row_of(item)
    }

    fn expanded_mut(&mut self) -> &mut Bits {
        self.filter.as_mut().map_or(&mut self.expanded, |filter| &mut filter.expanded)
    }

    /// Rebuilds the rows below an item, if it is visible.
    fn refresh(&mut self, item: u32) {
        let Some(row) = self.row_of(item) else { return };
        let end = self.assembly.end(item);
        let old = row + 1..row + 1 + self.rows[row + 1..].partition_point(|&next| next < end);
        if !self.is_expanded(item) {
            self.rows.drain(old);
            return;
        }
        let mut new = Vec::new();
        self.append_rows(item + 1..end, &mut new);
        self.rows.splice(old, new);
    }

    fn rebuild(&mut self) {
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        self.append_rows(0..self.assembly.items(), &mut rows);
        self.rows = rows;
    }

    fn append_rows(&self, items: Range<u32>, rows: &mut Vec<u32>) {
        let mut item = items.start;
        while let Some(next) = self.next_shown(item).filter(|&next| next < items.end) {
            rows.push(next);
            item = if self.is_expanded(next) { next + 1 } else { self.assembly.end(next) };
        }
    }

    /// The first item from one on that the filter lets through. Where an item is left out, all below it is.
    fn next_shown(&self, item: u32) -> Option<u32> {
        match &self.filter {
            Some(filter) => filter.shown.next(item),
            None => (item < self.assembly.items()).then_some(item),
        }
    }
}

#[cfg(test)]
mod tests;
