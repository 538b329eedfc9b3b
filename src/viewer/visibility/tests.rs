//! Sets of leaves against flags for every instance, after any list of deeds, undone and done again.

use proptest::prelude::*;

use super::*;
use crate::viewer::assembly::tests::raw;

#[derive(Debug, Clone, Copy)]
enum Step {
    Do(Deed),
    Select,
    Invert,
    Hover,
    HoverItem,
    Undo,
    Redo,
}

fn step() -> impl Strategy<Value = Step> {
    use Deed::{Ghost, GhostOthers, Hide, Isolate, Show, ShowAll, Unghost};
    let deed = prop::sample::select(vec![Hide, Hide, Show, Isolate, Ghost, GhostOthers, Unghost, ShowAll]);
    prop_oneof![
        6 => deed.prop_map(Step::Do),
        2 => Just(Step::Select),
        1 => Just(Step::Invert),
        1 => Just(Step::Hover),
        1 => Just(Step::HoverItem),
        3 => Just(Step::Undo),
        2 => Just(Step::Redo),
    ]
}

/// The looks of all instances, and those before each deed that can be undone, or after each that can be redone.
#[derive(Default)]
struct Naive {
    looks: Vec<u32>,
    undo: Vec<Vec<u32>>,
    redo: Vec<Vec<u32>>,
}

const LASTING: u32 = Look::HIDDEN.0 | Look::GHOST.0;

impl Naive {
    fn apply(&mut self, step: Step, chosen: &dyn Fn(usize) -> bool) {
        let now: Vec<u32> = self.looks.iter().map(|look| look & LASTING).collect();
        match step {
            Step::Do(deed) => {
                for (instance, look) in self.looks.iter_mut().enumerate() {
                    *look = after(deed, *look, chosen(instance));
                }
                if self.looks.iter().zip(&now).any(|(look, old)| look & LASTING != *old) {
                    self.undo.push(now);
                    self.redo.clear();
                }
            }
            Step::Select => self.each(|instance, look| mark(look, Look::SELECTED, chosen(instance))),
            Step::Invert => self.each(|_, look| {
                let is_chosen = look & (Look::SELECTED.0 | Look::HIDDEN.0) == 0;
                mark(look, Look::SELECTED, is_chosen)
            }),
            Step::Hover | Step::HoverItem => {
                self.each(|instance, look| mark(look, Look::HOVERED, chosen(instance)))
            }
            Step::Undo => {
                let Some(before) = self.undo.pop() else { return };
                self.each(|instance, look| look & !LASTING | before[instance]);
                self.redo.push(now);
            }
            Step::Redo => {
                let Some(after) = self.redo.pop() else { return };
                self.each(|instance, look| look & !LASTING | after[instance]);
                self.undo.push(now);
            }
        }
    }

    fn each(&mut self, edit: impl Fn(usize, u32) -> u32) {
        self.looks.iter_mut().enumerate().for_each(|(instance, look)| *look = edit(instance, *look));
    }
}

fn mark(look: u32, bit: Look, is: bool) -> u32 {
    if is { look | bit.0 } else { look & !bit.0 }
}

fn after(deed: Deed, look: u32, is_chosen: bool) -> u32 {
    let (shown, solid) = (mark(look, Look::HIDDEN, false), mark(look, Look::GHOST, false));
    match (deed, is_chosen) {
        (Deed::Hide, true) | (Deed::Isolate, false) => look | Look::HIDDEN.0,
        (Deed::Show, true) => shown,
        (Deed::Isolate, true) | (Deed::GhostOthers, true) | (Deed::ShowAll, _) => shown & solid,
        (Deed::Ghost, true) => shown | Look::GHOST.0,
        (Deed::GhostOthers, false) => look | Look::GHOST.0,
        (Deed::Unghost, true) => solid,
        _ => look,
    }
}

fn apply(visibility: &mut Visibility, step: Step, leaves: &Bits, (hovered, item): (Option<u32>, u32)) {
    match step {
        Step::Do(Deed::Hide) => visibility.hide(leaves),
        Step::Do(Deed::Show) => visibility.show(leaves),
        Step::Do(Deed::Isolate) => visibility.isolate(leaves),
        Step::Do(Deed::Ghost) => visibility.ghost(leaves),
        Step::Do(Deed::GhostOthers) => visibility.ghost_others(leaves),
        Step::Do(Deed::Unghost) => visibility.unghost(leaves),
        Step::Do(Deed::ShowAll) => visibility.show_all(),
        Step::Select => visibility.select(leaves.clone()),
        Step::Invert => visibility.invert_selection(),
        Step::Hover => visibility.hover(hovered),
        Step::HoverItem => visibility.hover_item(Some(item)),
        Step::Undo => _ = visibility.undo(),
        Step::Redo => _ = visibility.redo(),
    }
}

fn share(looks: &[u32], instances: &[u32], bit: Look, wanted: bool) -> Share {
    let is = |&instance: &u32| (looks[instance as usize] & bit.0 != 0) == wanted;
    Share::of(instances.iter().copied().filter(is).count() as u32, instances.len() as u32)
}

proptest! {
    #[test]
    fn looks_are_what_deeds_make_them(
        raw in raw(),
        steps in prop::collection::vec((step(), any::<prop::sample::Index>()), 0..24),
    ) {
        let assembly = Arc::new(raw.assembly());
        let mut visibility = Visibility::new(assembly.clone());
        let mut naive = Naive { looks: vec![0; assembly.instances() as usize], ..Naive::default() };
        let colours: Vec<Look> = (0..assembly.instances()).map(|i| Look::coloured([i as u8, 7, 9, 255])).collect();
        let mut looks = Vec::new();
        for (step, index) in steps {
            let item = index.index(assembly.items() as usize) as u32;
            let leaves = visibility.set_of_item(item);
            let all: Vec<u32> = visibility.instances_of(&leaves).collect();
            // One instance is pointed at; the others of its placement go with it.
            let chosen: Vec<u32> = match step {
                Step::Hover => all.first().map_or(vec![], |&first| {
                    assembly.instances_of_leaf(assembly.leaf_of_instance(first).unwrap()).collect()
                }),
                _ => all.clone(),
            };
            let (before, revision) = (naive.looks.clone(), visibility.revision());
            naive.apply(step, &|instance| chosen.contains(&(instance as u32)));
            apply(&mut visibility, step, &leaves, (chosen.last().copied(), item));
            prop_assert_eq!(naive.looks == before, visibility.revision() == revision, "{:?}", step);

            visibility.looks(&[], &mut looks);
            prop_assert_eq!(looks.iter().map(|look| look.0).collect::<Vec<_>>(), naive.looks.clone(), "{:?}", step);
            visibility.looks(&colours, &mut looks);
            let coloured = |i: usize| naive.looks[i] | colours[i].0;
            prop_assert!((0..looks.len()).all(|i| looks[i].0 == coloured(i)));
            prop_assert_eq!(visibility.next_undo().is_some(), !naive.undo.is_empty());
            prop_assert_eq!(visibility.next_redo().is_some(), !naive.redo.is_empty());
            for item in 0..assembly.items() {
                let leaves = visibility.set_of_item(item);
                let below: Vec<u32> = visibility.instances_of(&leaves).collect();
                prop_assert_eq!(visibility.shown_share(item), share(&naive.looks, &below, Look::HIDDEN, false));
                prop_assert_eq!(visibility.ghost_share(item), share(&naive.looks, &below, Look::GHOST, true));
                prop_assert_eq!(visibility.selected_share(item), share(&naive.looks, &below, Look::SELECTED, true));
            }
        }
    }
}

#[test]
fn old_changes_are_forgotten_before_they_fill_the_memory() {
    use crate::viewer::assembly::Placed;
    let count = 1 << 17;
    let placed: Vec<Placed> =
        (0..count).map(|i| Placed { instances: i..i + 1, ..Placed::default() }).collect();
    let mut visibility = Visibility::new(Arc::new(Assembly::new(&[u32::MAX], &placed)));
    let scattered = |seed: u32| {
        let ranges = (0..count).filter(move |i| (i ^ seed).wrapping_mul(0x9E37_79B9) >> 31 == 0);
        Bits::of(count, ranges.map(|i| i..i + 1))
    };
    let sets = [scattered(1), scattered(977)];
    for step in 0..2_000 {
        visibility.isolate(&sets[step % 2]);
    }
    let held: usize = visibility.undo.iter().map(|(_, change)| change.bytes_held()).sum();
    assert!(held <= UNDO_BYTES && visibility.undo.len() > 100, "{held} B in {}", visibility.undo.len());
    let steps = std::iter::from_fn(|| visibility.undo()).count();
    assert!(steps < 2_000);
    assert!(!visibility.hidden().is_empty(), "what was forgotten cannot be taken back");
}
