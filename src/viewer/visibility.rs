//! What the user hides, ghosts, selects and points at in, how every instance looks out.
//!
//! All of it is kept as sets of *leaves* of the [`Assembly`], in the order of the tree: the cells of one part are
//! always treated alike, a branch is one range of bits, and how much of it is hidden is the difference of two sums.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::assembly::Assembly;
use super::bits::{Bits, Ranks};
use super::changes::Change;
use crate::passes::draw::Look;

/// What can be undone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deed {
    /// Parts were hidden.
    Hide,
    /// Hidden parts were shown.
    Show,
    /// All but some parts were hidden.
    Isolate,
    /// Parts were made ghosts.
    Ghost,
    /// All but some parts were made ghosts.
    GhostOthers,
    /// Ghosts were made solid.
    Unghost,
    /// Everything was shown, and made solid.
    ShowAll,
}

impl Deed {
    /// What people call it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Hide => "hide",
            Self::Show => "show",
            Self::Isolate => "isolate",
            Self::Ghost => "ghost",
            Self::GhostOthers => "ghost others",
            Self::Unghost => "unghost",
            Self::ShowAll => "show all",
        }
    }
}

/// How much of something there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Share {
    /// Nothing of it, or there is nothing.
    None,
    /// Some of it.
    Some,
    /// All of it.
    All,
}

impl Share {
    fn of(count: u32, total: u32) -> Self {
        match count {
            0 => Self::None,
            count if count < total => Self::Some,
            _ => Self::All,
        }
    }
}

/// A set of leaves that can be counted by ranges.
#[derive(Debug, Clone)]
struct Counted {
    bits: Bits,
    ranks: Ranks,
}

impl Counted {
    fn new(limit: u32) -> Self {
        let bits = Bits::new(limit);
        Self { ranks: Ranks::of(&bits), bits }
    }

    fn set(&mut self, bits: Bits) {
        self.ranks = Ranks::of(&bits);
        self.bits = bits;
    }

    fn share(&self, leaves: Range<u32>) -> Share {
        Share::of(self.ranks.count(&self.bits, leaves.clone()), leaves.len() as u32)
    }
}

/// What is hidden, ghosted, selected and pointed at.
#[derive(Debug, Clone)]
pub struct Visibility {
    assembly: Arc<Assembly>,
    hidden: Counted,
    ghosts: Counted,
    selected: Counted,
    /// The leaves under the pointer; empty for none.
    hovered: Range<u32>,
    undo: VecDeque<(Deed, Change)>,
    redo: Vec<(Deed, Change)>,
    revision: u64,
}

/// The oldest changes are forgotten when all take more memory than this.
const UNDO_BYTES: usize = 16 << 20;

impl Visibility {
    /// Everything shown, nothing selected.
    pub fn new(assembly: Arc<Assembly>) -> Self {
        let empty = Counted::new(assembly.leaves());
        Self {
            assembly,
            hidden: empty.clone(),
            ghosts: empty.clone(),
            selected: empty,
            hovered: 0..0,
            undo: VecDeque::new(),
            redo: Vec::new(),
            revision: 0,
        }
    }

    /// Becomes another number whenever anything looks different.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The leaves that are hidden.
    pub fn hidden(&self) -> &Bits {
        &self.hidden.bits
    }

    /// The leaves that are ghosts, were they not hidden.
    pub fn ghosts(&self) -> &Bits {
        &self.ghosts.bits
    }

    /// The leaves that are selected; they may be hidden.
    pub fn selected(&self) -> &Bits {
        &self.selected.bits
    }

    /// The leaf under the pointer, if it is one and not a group of them.
    pub fn hovered_leaf(&self) -> Option<u32> {
        (self.hovered.len() == 1).then_some(self.hovered.start)
    }

    /// The leaves of an item and of all below it, as a set.
    pub fn set_of_item(&self, item: u32) -> Bits {
        Bits::of(self.assembly.leaves(), [self.assembly.leaves_of(item)])
    }

    /// The leaf of an instance, as a set; empty for none.
    pub fn set_of_instance(&self, instance: Option<u32>) -> Bits {
        let leaf = instance.and_then(|instance| self.assembly.leaf_of_instance(instance));
        Bits::of(self.assembly.leaves(), leaf.map(|leaf| leaf..leaf + 1))
    }

    /// The instances of a set of leaves, in the order of the tree.
    pub fn instances_of<'a>(&'a self, leaves: &'a Bits) -> impl Iterator<Item = u32> + 'a {
        leaves.iter().flat_map(|leaf| self.assembly.instances_of_leaf(leaf))
    }

    /// How much of an item is shown: nothing of one without leaves.
    pub fn shown_share(&self, item: u32) -> Share {
        let leaves = self.assembly.leaves_of(item);
        let total = leaves.len() as u32;
        Share::of(total - self.hidden.ranks.count(&self.hidden.bits, leaves), total)
    }

    /// How much of an item is made of ghosts.
    pub fn ghost_share(&self, item: u32) -> Share {
        self.ghosts.share(self.assembly.leaves_of(item))
    }

    /// How much of an item is selected.
    pub fn selected_share(&self, item: u32) -> Share {
        self.selected.share(self.assembly.leaves_of(item))
    }

    /// Whether an instance is hidden.
    pub fn is_hidden(&self, instance: u32) -> bool {
        self.assembly.leaf_of_instance(instance).is_some_and(|leaf| self.hidden.bits.has(leaf))
    }

    /// Hides leaves.
    pub fn hide(&mut self, leaves: &Bits) {
        self.change(Deed::Hide, |hidden, _| hidden.union(leaves));
    }

    /// Shows leaves again; what was a ghost is one again.
    pub fn show(&mut self, leaves: &Bits) {
        self.change(Deed::Show, |hidden, _| hidden.subtract(leaves));
    }

    /// Shows leaves as solids, and nothing else.
    pub fn isolate(&mut self, leaves: &Bits) {
        self.change(Deed::Isolate, |hidden, ghosts| {
            *hidden = leaves.inverted();
            ghosts.subtract(leaves);
        });
    }

    /// Makes ghosts of leaves, also of hidden ones.
    pub fn ghost(&mut self, leaves: &Bits) {
        self.change(Deed::Ghost, |hidden, ghosts| {
            ghosts.union(leaves);
            hidden.subtract(leaves);
        });
    }

    /// Shows leaves as solids, and makes ghosts of all others that are not hidden.
    pub fn ghost_others(&mut self, leaves: &Bits) {
        self.change(Deed::GhostOthers, |hidden, ghosts| {
            *ghosts = leaves.inverted();
            hidden.subtract(leaves);
        });
    }

    /// Makes ghosts solid.
    pub fn unghost(&mut self, leaves: &Bits) {
        self.change(Deed::Unghost, |_, ghosts| ghosts.subtract(leaves));
    }

    /// Shows everything as solids.
    pub fn show_all(&mut self) {
        self.change(Deed::ShowAll, |hidden, ghosts| {
            hidden.clear();
            ghosts.clear();
        });
    }

    /// Selects leaves and nothing else.
    pub fn select(&mut self, leaves: Bits) {
        if leaves != self.selected.bits {
            self.selected.set(leaves);
            self.revision += 1;
        }
    }

    /// Selects what is shown and not selected, and nothing else.
    pub fn invert_selection(&mut self) {
        let mut leaves = self.selected.bits.inverted();
        leaves.subtract(&self.hidden.bits);
        self.select(leaves);
    }

    /// Points at the leaf of an instance, or at none.
    pub fn hover(&mut self, instance: Option<u32>) {
        let leaf = instance.and_then(|instance| self.assembly.leaf_of_instance(instance));
        self.hover_leaves(leaf.map_or(0..0, |leaf| leaf..leaf + 1));
    }

    /// Points at all leaves of an item, or at none.
    pub fn hover_item(&mut self, item: Option<u32>) {
        let leaves = item.map_or(0..0, |item| self.assembly.leaves_of(item));
        self.hover_leaves(if leaves.is_empty() { 0..0 } else { leaves });
    }

    fn hover_leaves(&mut self, leaves: Range<u32>) {
        if leaves != self.hovered {
            self.hovered = leaves;
            self.revision += 1;
        }
    }

    /// What would be undone.
    pub fn next_undo(&self) -> Option<Deed> {
        self.undo.back().map(|(deed, _)| *deed)
    }

    /// What would be done again.
    pub fn next_redo(&self) -> Option<Deed> {
        self.redo.last().map(|(deed, _)| *deed)
    }

    /// Takes the last change of what is hidden or a ghost back, and tells what it was. The selection stays.
    pub fn undo(&mut self) -> Option<Deed> {
        let (deed, change) = self.undo.pop_back()?;
        self.apply(&change);
        self.redo.push((deed, change));
        Some(deed)
    }

    /// Makes the last change again that was taken back, and tells what it was.
    pub fn redo(&mut self) -> Option<Deed> {
        let (deed, change) = self.redo.pop()?;
        self.apply(&change);
        self.undo.push_back((deed, change));
        Some(deed)
    }

    fn change(&mut self, deed: Deed, edit: impl FnOnce(&mut Bits, &mut Bits)) {
        let (mut hidden, mut ghosts) = (self.hidden.bits.clone(), self.ghosts.bits.clone());
        edit(&mut hidden, &mut ghosts);
        let change = Change::between([&self.hidden.bits, &self.ghosts.bits], [&hidden, &ghosts]);
        if change.is_empty() {
            return;
        }
        self.apply(&change);
        self.redo.clear();
        self.undo.push_back((deed, change));
        let mut bytes: usize = self.undo.iter().map(|(_, change)| change.bytes_held()).sum();
        while bytes > UNDO_BYTES && self.undo.len() > 1 {
            bytes -= self.undo.pop_front().map_or(0, |(_, change)| change.bytes_held());
        }
    }

    fn apply(&mut self, change: &Change) {
        change.apply([&mut self.hidden.bits, &mut self.ghosts.bits]);
        self.hidden.ranks = Ranks::of(&self.hidden.bits);
        self.ghosts.ranks = Ranks::of(&self.ghosts.bits);
        self.revision += 1;
    }

    /// Fills the table that the renderer reads: the look of every instance, with the colour that `colour_by` gave it;
    /// `colours` is empty where all have that of their material.
    pub fn looks(&self, colours: &[Look], looks: &mut Vec<Look>) {
        let leaves = self.assembly.leaf_of_instances();
        looks.resize(leaves.len(), Look::default());
        const AT_ONCE: usize = 1 << 14;
        let blocks = looks.par_chunks_mut(AT_ONCE).zip(leaves.par_chunks(AT_ONCE)).enumerate();
        blocks.for_each(|(block, (looks, leaves))| {
            let colours = colours.get(block * AT_ONCE..).unwrap_or_default();
            for (index, (look, &leaf)) in looks.iter_mut().zip(leaves).enumerate() {
                *look = self.look_of_leaf(leaf).with(colours.get(index).copied().unwrap_or_default());
            }
        });
    }

    /// How a leaf differs from what its material says.
    pub fn look_of_leaf(&self, leaf: u32) -> Look {
        let when = |is: bool, look: Look| if is { look } else { Look::default() };
        when(self.hidden.bits.has(leaf), Look::HIDDEN)
            .with(when(self.ghosts.bits.has(leaf), Look::GHOST))
            .with(when(self.selected.bits.has(leaf), Look::SELECTED))
            .with(when(self.hovered.contains(&leaf), Look::HOVERED))
    }
}

#[cfg(test)]
mod tests;
