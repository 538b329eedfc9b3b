//! Sections and the boxes of instances in; what they take away of each instance, and which active triangles are drawn how, out.
//!
//! Of a large model most instances lie on one side of a plane. What is taken away wholly is not drawn, and once the camera
//! moves it takes no part in the budget; what is kept wholly is drawn as if there were no sections. Only the instances that
//! are cut pay for being cut.

use std::ops::Range;

use rayon::prelude::*;

use crate::geometry::Closure;
use crate::passes::draw::{CutFaceRanges, ROUNDING, Ranges, Section, is_inside_out};
use crate::scene::{InstanceBox, Scene};
use crate::select::wish::has_bit;
use crate::stream::State;

/// At most so many stretches of instances of one fate are drawn apart in a batch (and one more), so that draws are few: where
/// there are more, what is smaller than twice this share of the batch counts as cut.
const MOST_STRETCHES: u32 = 256;

/// What sections do to an instance; the worst of them counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Kept,
    Cut,
    Gone,
}

/// What sections do to every instance.
#[derive(Debug, Clone, Default)]
struct Fates {
    /// A bit for each instance of which everything goes; no bits without sections.
    gone: Vec<u64>,
    /// A bit for each of which some stays and some may go.
    cut: Vec<u64>,
}

/// What sections take away.
#[derive(Debug, Default)]
pub(super) struct Taken {
    sections: Vec<Section>,
    fates: Fates,
    /// The sections that lines of sight come in by, a bit each.
    entered: u32,
    /// What those do, had they not the others beside them.
    of_entered: Fates,
    /// By batch.
    ranges: Vec<Ranges>,
    /// The same.
    cut_faces: Vec<CutFaceRanges>,
    is_current: bool,
    /// The placements of closed parts that are cut into cells, once they have been looked for.
    closed_in_cells: Option<Vec<Range<u32>>>,
}

impl Taken {
    /// Takes other sections; says whether they were others.
    pub fn set(&mut self, sections: &[Section], scene: &Scene) -> bool {
        if self.sections == sections {
            return false;
        }
        self.sections = sections.to_vec();
        self.fates = self.fates_by(sections, scene);
        (self.entered, self.of_entered) = (0, Fates::default());
        self.is_current = false;
        true
    }

    /// Says which sections lines of sight come in by, a bit each.
    pub fn enter(&mut self, entered: u32, scene: &Scene) {
        if self.entered == entered {
            return;
        }
        self.entered = entered;
        let is_entered = |&(i, _): &(u32, &Section)| entered >> i & 1 != 0;
        let sections: Vec<Section> =
            (0..).zip(&self.sections).filter(is_entered).map(|(_, &section)| section).collect();
        self.of_entered =
            if sections == self.sections { self.fates.clone() } else { self.fates_by(&sections, scene) };
        self.is_current = false;
    }

    fn fates_by(&mut self, sections: &[Section], scene: &Scene) -> Fates {
        let mut fates = Fates::by(sections, scene);
        if !sections.is_empty() && scene.has_parents() {
            fates.cut_cells_together(self.closed_in_cells.get_or_insert_with(|| closed_in_cells(scene)));
        }
        fates
    }

    /// A bit for each instance of which nothing is left; no bits without sections.
    pub fn gone(&self) -> &[u64] {
        &self.fates.gone
    }

    /// What the GPU holds is not what it was.
    pub fn forget(&mut self) {
        self.is_current = false;
    }

    /// Finds what is drawn of so many batches, given the instances that the GPU holds something of, ascending, and of all
    /// instances how much. Instances are dealt to the batches in turn.
    pub fn find_ranges(&mut self, scene: &Scene, batches: usize, held: &[u32], states: &[State]) {
        if std::mem::replace(&mut self.is_current, true) || self.sections.is_empty() {
            return;
        }
        let of_batch = |batch: usize| {
            let own = held.iter().filter(|&&instance| instance as usize % batches == batch);
            let own: Vec<(u32, u32)> =
                own.map(|&instance| (instance, states[instance as usize].triangles)).collect();
            let fates = own.iter().map(|&(instance, triangles)| (self.fates.of(instance), triangles));
            (ranges(fates), self.cut_faces_of(scene, &own))
        };
        (self.ranges, self.cut_faces) = (0..batches).map(of_batch).unzip();
    }

    /// What cut faces are made of, given the instances of a batch and their triangles.
    fn cut_faces_of(&self, scene: &Scene, own: &[(u32, u32)]) -> CutFaceRanges {
        if self.entered == 0 {
            return CutFaceRanges::default();
        }
        let [as_is, inside_out] = [false, true].map(|inside_out| {
            let part_in = |instance| self.part_in(scene, instance, inside_out);
            cut_face_ranges(own.iter().map(|&(instance, triangles)| (part_in(instance), triangles)))
        });
        CutFaceRanges { as_is, inside_out }
    }

    /// What an instance has to do with the cut faces of what is placed inside out, or as it is.
    fn part_in(&self, scene: &Scene, instance: u32, inside_out: bool) -> Part {
        // Most are not, and then nothing of the scene is looked at where no part has cells.
        let is_cut = self.of_entered.of(instance) == Fate::Cut && self.fates.of(instance) != Fate::Gone;
        // Of a surface that several cells have together, some alone would be an open one.
        let is_cell = || {
            scene.has_parents()
                && !scene.parts()[scene.instances()[instance as usize].part as usize].is_whole()
        };
        match is_cut {
            true if facing(scene, instance) == Some(inside_out) => Part::Needed,
            false if is_cell() => Part::Barred,
            _ => Part::Harmless,
        }
    }

    /// What is drawn, by batch.
    pub fn ranges(&self) -> &[Ranges] {
        &self.ranges
    }

    /// What cut faces are made of, by batch.
    pub fn cut_faces(&self) -> &[CutFaceRanges] {
        &self.cut_faces
    }
}

impl Fates {
    fn by(sections: &[Section], scene: &Scene) -> Self {
        if sections.is_empty() {
            return Self::default();
        }
        let (gone, cut) = scene.boxes().par_chunks(64).map(|boxes| bits(boxes, sections)).unzip();
        Self { gone, cut }
    }

    fn of(&self, instance: u32) -> Fate {
        let is_in = |bits: &[u64]| has_bit(bits, instance as usize);
        match (is_in(&self.gone), is_in(&self.cut)) {
            (true, _) => Fate::Gone,
            (false, true) => Fate::Cut,
            (false, false) => Fate::Kept,
        }
    }

    /// Where one cell of a closed part is cut, or one is kept and another gone, all cells of that placement count as cut: the
    /// face of the cut is within a surface that they have together.
    fn cut_cells_together(&mut self, closed: &[Range<u32>]) {
        for cells in closed {
            let first = self.of(cells.start);
            if first == Fate::Cut || cells.clone().any(|cell| self.of(cell) != first) {
                for cell in cells.clone() {
                    let (word, bit) = (cell as usize / 64, 1 << (cell % 64));
                    self.gone[word] &= !bit;
                    self.cut[word] |= bit;
                }
            }
        }
    }
}

/// What an instance has to do with cut faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// They may be made of it.
    Needed,
    /// It changes nothing: its fronts and backs are equally many, or it is left out by the pass.
    Harmless,
    /// It may not be among them.
    Barred,
}

/// Whether an instance of a closed part is inside out.
fn facing(scene: &Scene, instance: u32) -> Option<bool> {
    let instance = &scene.instances()[instance as usize];
    is_inside_out(scene.parts()[instance.part as usize].closure(), instance.transform())
}

/// The placements of closed parts that are cut into cells.
fn closed_in_cells(scene: &Scene) -> Vec<Range<u32>> {
    let (instances, parts) = (scene.instances(), scene.parts());
    let mut found = Vec::new();
    let mut next = 0;
    while next < instances.len() as u32 {
        let part = &parts[instances[next as usize].part as usize];
        let cells = if part.is_whole() { next..next + 1 } else { scene.placement(next) };
        next = cells.end;
        if cells.len() > 1 && part.closure() != Closure::Open {
            found.push(cells);
        }
    }
    found
}

/// Which of up to 64 boxes are gone, and which are cut.
fn bits(boxes: &[InstanceBox], sections: &[Section]) -> (u64, u64) {
    boxes.iter().enumerate().fold((0, 0), |(gone, cut), (i, of)| match fate(of, sections) {
        Fate::Gone => (gone | 1 << i, cut),
        Fate::Cut => (gone, cut | 1 << i),
        Fate::Kept => (gone, cut),
    })
}

fn fate(of: &InstanceBox, sections: &[Section]) -> Fate {
    // What a rounding error of the box's size would take is kept, and what it would leave is cut.
    let rounding = ROUNDING * (of.centre.abs() + of.half_extent).max_element();
    let mut worst = Fate::Kept;
    for section in sections {
        let [nearest, farthest] = section.span(of.centre, of.half_extent);
        if farthest < -rounding {
            return Fate::Gone;
        }
        if nearest < -rounding {
            worst = Fate::Cut;
        }
    }
    worst
}

/// The ranges of a batch, given the fates and triangles of its instances in their order.
fn ranges(instances: impl Iterator<Item = (Fate, u32)>) -> Ranges {
    let mut found = Ranges::default();
    // To be cut is right for any triangle.
    for (fate, range) in stretches(instances, |_| Fate::Cut) {
        match fate {
            Fate::Kept => found.kept.push(range),
            Fate::Cut => found.cut.push(range),
            Fate::Gone => {}
        }
    }
    found
}

/// The triangles of a batch that cut faces are made of, given what its instances have to do with them, and their triangles.
fn cut_face_ranges(instances: impl Iterator<Item = (Part, u32)>) -> Vec<Range<u32>> {
    let coarser = |part| if part == Part::Harmless { Part::Needed } else { part };
    let stretches = stretches(instances, coarser).into_iter();
    stretches.filter(|(part, _)| *part == Part::Needed).map(|(_, range)| range).collect()
}

/// The stretches of triangles of one fate, given the fates and triangles of instances in their order. What is too little to be
/// drawn apart has the fate that `coarser` makes of its own.
fn stretches<T: Copy + PartialEq>(
    instances: impl Iterator<Item = (T, u32)>,
    coarser: impl Fn(T) -> T,
) -> Vec<(T, Range<u32>)> {
    let all = joined(instances);
    let total: u32 = all.iter().map(|(_, triangles)| triangles).sum();
    let least = if all.len() <= MOST_STRETCHES as usize { 0 } else { 2 * total.div_ceil(MOST_STRETCHES) };
    let coarse = all.into_iter().map(|(fate, triangles)| match triangles < least {
        true => (coarser(fate), triangles),
        false => (fate, triangles),
    });
    let mut start = 0;
    let placed = |(fate, triangles)| {
        let range = start..start + triangles;
        start = range.end;
        (fate, range)
    };
    joined(coarse).into_iter().map(placed).collect()
}

/// Neighbours of the same fate as one.
fn joined<T: Copy + PartialEq>(instances: impl Iterator<Item = (T, u32)>) -> Vec<(T, u32)> {
    let mut joined: Vec<(T, u32)> = Vec::new();
    for (fate, triangles) in instances.filter(|&(_, triangles)| triangles > 0) {
        match joined.last_mut() {
            Some((last, sum)) if *last == fate => *sum += triangles,
            _ => joined.push((fate, triangles)),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    fn fates() -> impl Strategy<Value = Vec<(Fate, u32)>> {
        let fate = prop_oneof![Just(Fate::Kept), Just(Fate::Cut), Just(Fate::Gone)];
        proptest::collection::vec((fate, 0u32..400), 0..2000)
    }

    proptest! {
        #[test]
        fn every_triangle_is_drawn_as_its_instance_asks_or_as_cut(instances in fates()) {
            let found = ranges(instances.iter().copied());
            prop_assert!(found.kept.len() + found.cut.len() <= MOST_STRETCHES as usize + 1);
            let total: u32 = instances.iter().map(|&(_, triangles)| triangles).sum();
            let mut drawn = vec![Fate::Gone; total as usize];
            for (ranges, fate) in [(&found.kept, Fate::Kept), (&found.cut, Fate::Cut)] {
                for triangle in ranges.iter().cloned().flatten() {
                    prop_assert_eq!(drawn[triangle as usize], Fate::Gone, "triangle {} is drawn twice", triangle);
                    drawn[triangle as usize] = fate;
                }
            }
            let asked = instances.iter().flat_map(|&(fate, triangles)| vec![fate; triangles as usize]);
            for (triangle, (drawn, asked)) in drawn.into_iter().zip(asked).enumerate() {
                prop_assert!(drawn == asked || drawn == Fate::Cut, "triangle {}: {:?} {:?}", triangle, drawn, asked);
            }
        }
    }

    proptest! {
        #[test]
        fn cut_faces_are_made_of_all_that_is_needed_and_of_nothing_that_is_barred(
            parts in proptest::collection::vec(
                (prop_oneof![Just(Part::Needed), Just(Part::Harmless), Just(Part::Barred)], 0u32..400),
                0..2000,
            )
        ) {
            let mut ranges = cut_face_ranges(parts.iter().copied()).into_iter().peekable();
            let mut triangle = 0;
            for (part, triangles) in parts {
                while ranges.next_if(|range| range.end <= triangle).is_some() {}
                let own = triangle..triangle + triangles;
                let (is_in, touches) = ranges.peek().map_or((false, false), |range| {
                    (range.start <= own.start && own.end <= range.end, range.start < own.end)
                });
                prop_assert!(own.is_empty() || part != Part::Needed || is_in, "{:?} {:?}", part, own);
                prop_assert!(own.is_empty() || part != Part::Barred || !touches, "{:?} {:?}", part, own);
                triangle = own.end;
            }
        }
    }

    #[test]
    fn few_instances_in_long_stretches_keep_their_fates() {
        let instances =
            [(Fate::Kept, 1000), (Fate::Kept, 3), (Fate::Gone, 500), (Fate::Cut, 2), (Fate::Kept, 900)];
        let found = ranges(instances.into_iter());
        assert_eq!(found.kept, [0..1003, 1505..2405]);
        assert_eq!(found.cut, vec![1503..1505; 1]);
    }

    #[test]
    fn a_box_is_kept_cut_or_gone() {
        let at =
            |x: f64| InstanceBox { centre: DVec3::X * x, half_extent: DVec3::ONE, diagonal: 12f64.sqrt() };
        let plane = Section { point: DVec3::ZERO, normal: DVec3::X };
        let corner = Section { point: DVec3::ZERO, normal: DVec3::new(1.0, 1.0, 0.0).normalize() };
        for (x, expected) in
            [(3.0, Fate::Kept), (1.0, Fate::Kept), (0.5, Fate::Cut), (-0.5, Fate::Cut), (-3.0, Fate::Gone)]
        {
            assert_eq!(fate(&at(x), &[plane]), expected, "{x}");
        }
        assert_eq!(fate(&at(1.5), &[plane, corner]), Fate::Cut);
        assert_eq!(fate(&at(-3.0), &[corner, plane]), Fate::Gone);
        // A face on the plane is seen or not as rounding has it, as ever.
        assert_eq!(fate(&at(-1.0), &[plane]), Fate::Cut);
    }
}
