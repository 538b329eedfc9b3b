//! The rows against those of a walk from the roots, after any list of changes.

use proptest::prelude::*;

use super::*;
use crate::viewer::assembly::Placed;
use crate::viewer::assembly::tests::{Raw, raw};
use crate::viewer::search::Search;

#[derive(Debug, Clone)]
enum Step {
    Toggle(prop::sample::Index),
    ExpandBelow(prop::sample::Index),
    CollapseBelow(prop::sample::Index),
    ExpandAll,
    CollapseAll,
    Reveal(prop::sample::Index),
    Search(String),
    Clear,
}

fn step() -> impl Strategy<Value = Step> {
    let item = any::<prop::sample::Index>;
    prop_oneof![
        4 => item().prop_map(Step::Toggle),
        1 => item().prop_map(Step::ExpandBelow),
        1 => item().prop_map(Step::CollapseBelow),
        1 => Just(Step::ExpandAll),
        1 => Just(Step::CollapseAll),
        2 => item().prop_map(Step::Reveal),
        1 => "[abä]{1,2}".prop_map(Step::Search),
        1 => Just(Step::Clear),
    ]
}

/// The rows as the expanded items and the filter say.
fn naive_rows(tree: &Tree) -> Vec<u32> {
    let assembly = tree.assembly();
    let is_shown = |item: u32| tree.filter.as_ref().is_none_or(|filter| filter.shown.has(item));
    let is_visible = |&item: &u32| is_shown(item) && assembly.way(item).all(|above| tree.is_expanded(above));
    (0..assembly.items()).filter(is_visible).collect()
}

fn apply(tree: &mut Tree, raw: &Raw, step: &Step) {
    let items = tree.assembly().items() as usize;
    let item = |index: &prop::sample::Index| index.index(items) as u32;
    match step {
        Step::Toggle(index) => {
            let was = tree.is_expanded(item(index));
            tree.toggle(item(index));
            assert_ne!(tree.is_expanded(item(index)), was);
        }
        Step::ExpandBelow(index) => tree.expand_below(item(index)),
        Step::CollapseBelow(index) => tree.collapse_below(item(index)),
        Step::ExpandAll => tree.expand_all(),
        Step::CollapseAll => tree.collapse_all(),
        Step::Reveal(index) if tree.assembly().instances() > 0 => {
            let instance = index.index(tree.assembly().instances() as usize) as u32;
            let row = tree.reveal(instance);
            let leaf = tree.assembly().leaf_of_instance(instance).unwrap();
            let item = tree.assembly().item_of_leaf(leaf);
            assert_eq!(row.map(|row| tree.rows()[row]), row.map(|_| item));
            assert!(row.is_some() || tree.is_filtered());
        }
        Step::Reveal(_) => {}
        Step::Search(query) => {
            let found = Search::new(tree.assembly(), raw).find(tree.assembly(), query);
            tree.set_filter(found.as_ref());
            let found = found.unwrap();
            assert!(found.matches.iter().all(|item| tree.row_of(item).is_some()), "all matches are in sight");
        }
        Step::Clear => tree.set_filter(None),
    }
}

proptest! {
    #[test]
    fn rows_are_those_of_a_walk(raw in raw(), steps in prop::collection::vec(step(), 0..20)) {
        let mut tree = Tree::new(Arc::new(raw.assembly()));
        for step in &steps {
            apply(&mut tree, &raw, step);
            prop_assert_eq!(tree.rows(), naive_rows(&tree), "after {:?}", step);
            for (row, &item) in tree.rows().iter().enumerate() {
                prop_assert_eq!(tree.row_of(item), Some(row));
                let shown = |below: u32| tree.filter.as_ref().is_none_or(|filter| filter.shown.has(below));
                let has_more = tree.assembly().branch(item).skip(1).any(shown);
                prop_assert_eq!(tree.can_expand(item), has_more);
            }
        }
    }
}

#[test]
fn a_single_root_is_open_at_first_and_several_are_not() {
    let leaf = |node| Placed { instances: node..node + 1, node, ..Placed::default() };
    let open = Tree::new(Arc::new(Assembly::new(&[u32::MAX, 0, 0], &[])));
    assert_eq!(open.rows(), [0, 1, 2]);
    let closed = Tree::new(Arc::new(Assembly::new(&[u32::MAX, 0, u32::MAX], &[leaf(0), leaf(1)])));
    assert_eq!(closed.rows(), [0, 3]);
    assert!(Tree::new(Arc::default()).rows().is_empty());
}
