//! The assembly against its nodes walked one by one; and random assemblies for the tests of what stands on it.

use std::path::Path;

use proptest::prelude::*;

use super::*;
use crate::viewer::search::Names;

/// An assembly as it comes, with a name for each node and part.
#[derive(Debug, Clone, Default)]
pub(in crate::viewer) struct Raw {
    pub parents: Vec<u32>,
    pub placed: Vec<Placed>,
    pub node_names: Vec<String>,
    pub part_names: Vec<String>,
}

impl Names for Raw {
    fn node(&self, node: u32) -> &str {
        &self.node_names[node as usize]
    }

    fn part(&self, part: u32) -> &str {
        &self.part_names[part as usize]
    }
}

impl Raw {
    pub fn assembly(&self) -> Assembly {
        Assembly::new(&self.parents, &self.placed)
    }

    pub fn children(&self, node: u32) -> Vec<u32> {
        let is_child = |&child: &u32| self.parents[child as usize] == node;
        (0..self.parents.len() as u32).filter(is_child).collect()
    }

    /// The items in the order in which a simple walk meets them: the node, and which of `placed` it is.
    pub fn walk(&self) -> Vec<(u32, Option<usize>, u32)> {
        let mut items = Vec::new();
        self.children(NO_PARENT).into_iter().for_each(|root| self.walk_from(root, 0, &mut items));
        items
    }

    fn walk_from(&self, node: u32, depth: u32, items: &mut Vec<(u32, Option<usize>, u32)>) {
        let own: Vec<usize> = (0..self.placed.len()).filter(|&i| self.placed[i].node == node).collect();
        let children = self.children(node);
        if let ([only], []) = (&own[..], &children[..]) {
            items.push((node, Some(*only), depth));
            return;
        }
        items.push((node, None, depth));
        children.into_iter().for_each(|child| self.walk_from(child, depth + 1, items));
        items.extend(own.into_iter().map(|leaf| (node, Some(leaf), depth + 1)));
    }
}

/// Some nodes, some leaves on them, names out of few letters.
pub(in crate::viewer) fn raw() -> impl Strategy<Value = Raw> {
    let parents = prop::collection::vec(prop::option::weighted(0.9, any::<prop::sample::Index>()), 1..24);
    let leaf = (1u32..4, any::<prop::sample::Index>(), 0u32..5, 0u32..2, 0u64..100);
    let names = |count| prop::collection::vec("[abAB ÄäΣ]{0,4}", count);
    (parents, prop::collection::vec(leaf, 0..30), names(24), names(5)).prop_map(
        |(parents, leaves, node_names, part_names)| {
            let parents: Vec<u32> = (0..parents.len())
                .map(|node| match parents[node] {
                    Some(index) if node > 0 => index.index(node) as u32,
                    _ => NO_PARENT,
                })
                .collect();
            let mut next = 0;
            let placed = leaves.into_iter().map(|(cells, node, part, counts, triangles)| {
                next += cells;
                let node = node.index(parents.len()) as u32;
                Placed { instances: next - cells..next, node, part, counts, triangles }
            });
            Raw { placed: placed.collect(), parents, node_names, part_names }
        },
    )
}

proptest! {
    #[test]
    fn items_are_in_the_order_of_a_walk(raw in raw()) {
        let (assembly, walk) = (raw.assembly(), raw.walk());
        prop_assert_eq!(assembly.items() as usize, walk.len());
        let mut leaves = Vec::new();
        for (item, &(node, placed, depth)) in (0u32..).zip(&walk) {
            prop_assert_eq!((assembly.node(item), assembly.depth(item)), (node, depth));
            let end = walk[item as usize + 1..].iter().take_while(|other| other.2 > depth).count() as u32 + item + 1;
            prop_assert_eq!(assembly.branch(item), item..end);
            let below = || walk[item as usize..end as usize].iter().filter_map(|item| item.1);
            prop_assert_eq!(assembly.leaves_of(item).len(), below().count());
            prop_assert_eq!(assembly.leaf_of_item(item).is_some(), placed.is_some());
            let sum = Below {
                instances: below().map(|leaf| u64::from(raw.placed[leaf].counts)).sum(),
                triangles: below().map(|leaf| raw.placed[leaf].triangles).sum(),
            };
            prop_assert_eq!(assembly.below(item), sum);
            let above = (0..item).rev().find(|&above| walk[above as usize].2 < depth);
            prop_assert_eq!(assembly.parent(item), above);
            leaves.extend(placed.map(|leaf| (item, leaf)));
        }
        for (leaf, &(item, placed)) in (0u32..).zip(&leaves) {
            let placed = &raw.placed[placed];
            prop_assert_eq!(assembly.item_of_leaf(leaf), item);
            prop_assert_eq!(assembly.leaf_of_item(item), Some(leaf));
            prop_assert_eq!(assembly.part_of_leaf(leaf), placed.part);
            prop_assert_eq!(assembly.instances_of_leaf(leaf), placed.instances.clone());
            for instance in placed.instances.clone() {
                prop_assert_eq!(assembly.leaf_of_instance(instance), Some(leaf));
            }
        }
        for node in 0..assembly.nodes() {
            let item = assembly.item_of_node(node);
            prop_assert!(assembly.is_node(item) && assembly.node(item) == node);
        }
    }
}

#[test]
fn nothing_is_an_assembly_too() {
    let assembly = Assembly::new(&[], &[]);
    assert_eq!((assembly.items(), assembly.leaves(), assembly.instances()), (0, 0, 0));
    assert_eq!(assembly.total(), Below::default());
    assert_eq!(assembly.leaf_of_instance(0), None);
}

#[test]
fn a_container_counts_what_its_scene_counts() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/v1.clps");
    assert_counts(&golden);
}

#[test]
#[ignore = "needs COLLAPSAR_CONTAINERS, a folder of baked models"]
fn containers_count_what_their_scenes_count() {
    let folder = std::env::var("COLLAPSAR_CONTAINERS").unwrap();
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let containers: Vec<_> = entries.filter(|path| path.extension().is_some_and(|e| e == "clps")).collect();
    assert!(!containers.is_empty());
    containers.iter().for_each(|path| assert_counts(path));
}

fn assert_counts(path: &Path) {
    let scene = Scene::open(path).unwrap();
    let assembly = Assembly::of(&scene);
    let counts = scene.counts();
    let below = Below { instances: counts.instances, triangles: counts.triangles_placed };
    assert_eq!(assembly.total(), below, "{}", path.display());
    assert_eq!(assembly.instances() as usize, scene.instances().len());
    for (instance, row) in (0u32..).zip(scene.instances()) {
        let leaf = assembly.leaf_of_instance(instance).unwrap();
        assert_eq!(assembly.instances_of_leaf(leaf), scene.placement(instance));
        assert_eq!(assembly.node(assembly.item_of_leaf(leaf)), row.node, "cells of a part hang on one node");
    }
}
