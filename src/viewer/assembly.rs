//! The nodes of a model and what is placed on them in, the assembly in the order of its tree out.
//!
//! *Items* are what rows show: the nodes, and below each node its *leaves*. A leaf is a placement: an instance, or the
//! cells of one part that are placed together. A node with one leaf and no children is that leaf itself. Items are
//! numbered in the order of a walk that goes down before it goes on, so what lies below an item follows it without a
//! gap; leaves are numbered in the same order. A whole branch is thus one range of items and one range of leaves, and
//! nothing here allocates per node or recurses, however deep the tree is.

use std::ops::Range;

use crate::container::format::{NO_PARENT, PartRow};
use crate::scene::Scene;

/// Stands for no item and no leaf.
const NONE: u32 = u32::MAX;

/// A leaf before it has its place in the tree.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Placed {
    /// The instances, which follow each other.
    pub instances: Range<u32>,
    /// The node that they hang on.
    pub node: u32,
    /// The part, or the first of its cells.
    pub part: u32,
    /// For how many instances it counts: 1, or 0 if it is a further piece of one that counts already.
    pub counts: u32,
    /// Its triangles at full detail.
    pub triangles: u64,
}

/// What lies below an item, itself included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Below {
    /// Placements of parts, before the cut into cells.
    pub instances: u64,
    /// Triangles at full detail.
    pub triangles: u64,
}

#[derive(Debug, Clone, Copy)]
struct Leaf {
    first_instance: u32,
    last_instance: u32,
    part: u32,
    item: u32,
}

/// The assembly in the order of its tree.
#[derive(Debug, Default)]
pub struct Assembly {
    /// For each item the node that it is or hangs on, its parent, the first item after all that is below it, and how many
    /// items are above it.
    node_of_item: Vec<u32>,
    parents: Vec<u32>,
    ends: Vec<u32>,
    depths: Vec<u32>,
    /// For each item, and one more, how many leaves come before it.
    leaves_before: Vec<u32>,
    leaves: Vec<Leaf>,
    /// For each leaf, and one more, what comes before it.
    before: Vec<Below>,
    item_of_node: Vec<u32>,
    leaf_of_instance: Vec<u32>,
}

impl Assembly {
    /// The assembly of an opened container.
    pub fn of(scene: &Scene) -> Self {
        let parents: Vec<u32> = scene.nodes().iter().map(|row| row.parent).collect();
        let mut placed = Vec::with_capacity(scene.instances().len());
        let (mut instance, count) = (0, scene.instances().len() as u32);
        while instance < count {
            let placement = scene.placement(instance);
            instance = placement.end;
            placed.push(placed_leaf(scene, placement));
        }
        Self::new(&parents, &placed)
    }

    /// The assembly of nodes, each with the index of its parent, which is smaller than its own, or [`NO_PARENT`], and of
    /// leaves, whose instances follow each other from 0 on. Children are in the order of their numbers, leaves after
    /// nodes.
    pub fn new(parents: &[u32], placed: &[Placed]) -> Self {
        let shape = Shape::new(parents, placed);
        let mut assembly = Self::with_nodes(parents, &shape);
        assembly.hang_leaves(placed, &shape);
        assembly
    }

    fn with_nodes(parents: &[u32], shape: &Shape) -> Self {
        let total = shape.items as usize;
        let mut this = Self {
            node_of_item: vec![0; total],
            parents: vec![NONE; total],
            ends: vec![0; total],
            depths: vec![0; total],
            item_of_node: vec![0; parents.len()],
            ..Self::default()
        };
        let mut next_root = 0;
        // Where the next child of each node goes.
        let mut next_child = vec![0u32; parents.len()];
        for node in 0..parents.len() {
            let parent = parent_of(parents, node);
            let place = parent.map_or(&mut next_root, |parent| &mut next_child[parent]);
            let item = *place;
            *place += shape.sizes[node];
            next_child[node] = item + 1;
            this.item_of_node[node] = item;
            let above = parent.map_or(NONE, |parent| this.item_of_node[parent]);
            this.set_item(item, node as u32, above, item + shape.sizes[node]);
        }
        this
    }

    fn set_item(&mut self, item: u32, node: u32, parent: u32, end: u32) {
        let index = item as usize;
        self.node_of_item[index] = node;
        self.parents[index] = parent;
        self.ends[index] = end;
        self.depths[index] = self.depths.get(parent as usize).map_or(0, |depth| depth + 1);
    }

    fn hang_leaves(&mut self, placed: &[Placed], shape: &Shape) {
        // Which of `placed` each item is; leaves take the last places of their node.
        let mut placed_at = vec![NONE; self.node_of_item.len()];
        let mut left = shape.own_leaves.clone();
        for (index, leaf) in (0u32..).zip(placed) {
            let (node, above) = (leaf.node as usize, self.item_of_node[leaf.node as usize]);
            let item = if shape.folds(node) { above } else { self.ends[above as usize] - left[node] };
            left[node] -= 1;
            placed_at[item as usize] = index;
            if item != above {
                self.set_item(item, leaf.node, above, item + 1);
            }
        }
        self.number_leaves(placed, &placed_at);
    }

    fn number_leaves(&mut self, placed: &[Placed], placed_at: &[u32]) {
        let instances = placed.last().map_or(0, |leaf| leaf.instances.end);
        self.leaf_of_instance = vec![0; instances as usize];
        self.leaves.reserve_exact(placed.len());
        self.before.reserve_exact(placed.len() + 1);
        self.leaves_before.reserve_exact(placed_at.len() + 1);
        let mut sum = Below::default();
        for (item, &index) in (0u32..).zip(placed_at) {
            self.leaves_before.push(self.leaves.len() as u32);
            let Some(leaf) = placed.get(index as usize) else { continue };
            let Range { start, end } = leaf.instances;
            self.leaf_of_instance[start as usize..end as usize].fill(self.leaves.len() as u32);
            self.leaves.push(Leaf { first_instance: start, last_instance: end, part: leaf.part, item });
            self.before.push(sum);
            sum.instances += u64::from(leaf.counts);
            sum.triangles += leaf.triangles;
        }
        self.leaves_before.push(self.leaves.len() as u32);
        self.before.push(sum);
    }

    /// How many items there are.
    pub fn items(&self) -> u32 {
        self.node_of_item.len() as u32
    }

    /// How many nodes there are.
    pub fn nodes(&self) -> u32 {
        self.item_of_node.len() as u32
    }

    /// How many leaves there are.
    pub fn leaves(&self) -> u32 {
        self.leaves.len() as u32
    }

    /// How many instances there are.
    pub fn instances(&self) -> u32 {
        self.leaf_of_instance.len() as u32
    }

    /// The node that an item is, or that it hangs on.
    pub fn node(&self, item: u32) -> u32 {
        self.node_of_item[item as usize]
    }

    /// Whether an item is a node; all others are leaves, and nodes that are leaves themselves are nodes.
    pub fn is_node(&self, item: u32) -> bool {
        self.item_of_node[self.node(item) as usize] == item
    }

    /// The item that shows a node.
    pub fn item_of_node(&self, node: u32) -> u32 {
        self.item_of_node[node as usize]
    }

    /// The item above an item.
    pub fn parent(&self, item: u32) -> Option<u32> {
        Some(self.parents[item as usize]).filter(|&parent| parent != NONE)
    }

    /// The items above an item, the nearest first.
    pub fn way(&self, item: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(self.parent(item), |&above| self.parent(above))
    }

    /// How many items are above an item.
    pub fn depth(&self, item: u32) -> u32 {
        self.depths[item as usize]
    }

    /// An item and all that is below it.
    pub fn branch(&self, item: u32) -> Range<u32> {
        item..self.end(item)
    }

    /// The first item after all that is below one.
    pub fn end(&self, item: u32) -> u32 {
        self.ends[item as usize]
    }

    /// Whether anything is below an item.
    pub fn has_children(&self, item: u32) -> bool {
        self.end(item) > item + 1
    }

    /// The leaves of an item and of all that is below it.
    pub fn leaves_of(&self, item: u32) -> Range<u32> {
        self.leaves_before[item as usize]..self.leaves_before[self.end(item) as usize]
    }

    /// The leaf that an item is.
    pub fn leaf_of_item(&self, item: u32) -> Option<u32> {
        let leaves = self.leaves_of(item);
        (!self.has_children(item) && !leaves.is_empty()).then_some(leaves.start)
    }

    /// The item that shows a leaf.
    pub fn item_of_leaf(&self, leaf: u32) -> u32 {
        self.leaves[leaf as usize].item
    }

    /// The part that a leaf places, or the first of its cells.
    pub fn part_of_leaf(&self, leaf: u32) -> u32 {
        self.leaves[leaf as usize].part
    }

    /// The instances of a leaf.
    pub fn instances_of_leaf(&self, leaf: u32) -> Range<u32> {
        let leaf = &self.leaves[leaf as usize];
        leaf.first_instance..leaf.last_instance
    }

    /// The leaf of an instance.
    pub fn leaf_of_instance(&self, instance: u32) -> Option<u32> {
        self.leaf_of_instance.get(instance as usize).copied()
    }

    /// The leaf of every instance.
    pub(super) fn leaf_of_instances(&self) -> &[u32] {
        &self.leaf_of_instance
    }

    /// What is below an item.
    pub fn below(&self, item: u32) -> Below {
        let leaves = self.leaves_of(item);
        let [from, to] = [leaves.start, leaves.end].map(|leaf| self.before[leaf as usize]);
        Below { instances: to.instances - from.instances, triangles: to.triangles - from.triangles }
    }

    /// All that the assembly has.
    pub fn total(&self) -> Below {
        self.before.last().copied().unwrap_or_default()
    }
}

/// How the items are shared out: known before any has its number.
struct Shape {
    own_leaves: Vec<u32>,
    has_children: Vec<bool>,
    /// Items of each node and below it.
    sizes: Vec<u32>,
    items: u32,
}

impl Shape {
    fn new(parents: &[u32], placed: &[Placed]) -> Self {
        let mut own_leaves = vec![0; parents.len()];
        placed.iter().for_each(|leaf| own_leaves[leaf.node as usize] += 1);
        let mut has_children = vec![false; parents.len()];
        (0..parents.len()).filter_map(|node| parent_of(parents, node)).for_each(|above| {
            has_children[above] = true;
        });
        let mut this = Self { own_leaves, has_children, sizes: vec![1; parents.len()], items: 0 };
        for node in (0..parents.len()).rev() {
            if !this.folds(node) {
                this.sizes[node] += this.own_leaves[node];
            }
            let size = this.sizes[node];
            *parent_of(parents, node).map_or(&mut this.items, |above| &mut this.sizes[above]) += size;
        }
        this
    }

    /// Whether a node is its only leaf.
    fn folds(&self, node: usize) -> bool {
        !self.has_children[node] && self.own_leaves[node] == 1
    }
}

/// The parent of a node; one that does not come before it is none.
fn parent_of(parents: &[u32], node: usize) -> Option<usize> {
    let parent = parents[node];
    (parent != NO_PARENT && (parent as usize) < node).then_some(parent as usize)
}

fn placed_leaf(scene: &Scene, instances: Range<u32>) -> Placed {
    let (parts, rows) = (scene.parts(), scene.instances());
    let part_of = |instance: u32| rows[instance as usize].part;
    let is_first_cell = |part: u32| part == 0 || source(parts, part) != source(parts, part - 1);
    let counts = instances.clone().filter(|&instance| is_first_cell(part_of(instance))).count();
    let leaves = instances.clone().map(|instance| &parts[part_of(instance) as usize]);
    let triangles = leaves.filter(|part| !part.is_parent()).map(|part| u64::from(part.triangles)).sum();
    let first = instances.start;
    let node = rows[first as usize].node;
    Placed { instances, node, part: part_of(first), counts: counts as u32, triangles }
}

fn source(parts: &[PartRow], part: u32) -> u32 {
    parts[part as usize].source
}

#[cfg(test)]
pub(super) mod tests;
