//! What is found against every name looked at in turn.

use proptest::prelude::*;

use super::*;
use crate::viewer::assembly::tests::{Raw, raw};

fn naive(raw: &Raw, assembly: &Assembly, query: &str) -> Vec<u32> {
    let lower = |text: &str| text.chars().flat_map(char::to_lowercase).collect::<String>();
    let words: Vec<String> = query.split_whitespace().map(lower).collect();
    let has_all = |name: &str| words.iter().all(|word| lower(name).contains(word.as_str()));
    let matches = |&item: &u32| {
        let part = assembly.leaf_of_item(item).map(|leaf| assembly.part_of_leaf(leaf));
        let own = assembly.is_node(item) && has_all(raw.node(assembly.node(item)));
        own || part.is_some_and(|part| has_all(raw.part(part)))
    };
    (0..assembly.items()).filter(matches).collect()
}

proptest! {
    #[test]
    fn all_names_with_all_words_are_found(raw in raw(), query in "[abBAÄσ]{1,2}( {1,2}[abä]{1,2})?") {
        let assembly = raw.assembly();
        let found = Search::new(&assembly, &raw).find(&assembly, &query).unwrap();
        let matches: Vec<u32> = found.matches.iter().collect();
        prop_assert_eq!(&matches, &naive(&raw, &assembly, &query));
        prop_assert_eq!(found.count as usize, matches.len());
        let is_above = |&item: &u32| matches.iter().any(|&hit| assembly.way(hit).any(|above| above == item));
        let ways: Vec<u32> = (0..assembly.items()).filter(is_above).collect();
        prop_assert_eq!(found.ways.iter().collect::<Vec<_>>(), ways);
    }
}

fn named(names: &[&str]) -> (Raw, Assembly) {
    let parents: Vec<u32> = (0..names.len() as u32).map(|node| node.wrapping_sub(1)).collect();
    let node_names = names.iter().map(|&name| name.to_owned()).collect();
    let raw = Raw { parents, node_names, ..Raw::default() };
    let assembly = raw.assembly();
    (raw, assembly)
}

#[test]
fn blanks_ask_for_nothing() {
    let (raw, assembly) = named(&["a"]);
    assert_eq!(Search::new(&assembly, &raw).find(&assembly, " \t\n "), None);
}

#[test]
fn words_do_not_reach_from_one_name_into_the_next() {
    let (raw, assembly) = named(&["bolt", "nut\nwing", "BOLT nut"]);
    let search = Search::new(&assembly, &raw);
    let hits = |query: &str| search.find(&assembly, query).unwrap().matches.iter().collect::<Vec<_>>();
    assert_eq!(hits("tnut"), [0u32; 0]);
    assert_eq!(hits("nut bolt"), [2]);
    assert_eq!(hits("wing nut"), [1], "a name of two lines is one name");
    assert_eq!(hits("NUT"), [1, 2]);
}

#[test]
fn items_without_names_are_called_by_their_numbers() {
    let placed =
        [crate::viewer::assembly::Placed { instances: 0..1, part: 1, node: 1, ..Default::default() }];
    let raw = Raw {
        parents: vec![u32::MAX, 0],
        placed: placed.to_vec(),
        node_names: vec![String::new(); 2],
        part_names: vec![String::new(), "cog".into()],
    };
    let assembly = raw.assembly();
    assert_eq!(raw.item(&assembly, 0), "node 0");
    assert_eq!(raw.item(&assembly, 1), "cog");
    let raw = Raw { part_names: vec![String::new(); 2], ..raw };
    assert_eq!(raw.item(&assembly, 1), "part 1");
}
