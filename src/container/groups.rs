//! The instances of a model in, its groups out: a tree of boxes whose leaves have some hundred instances each.
//!
//! From the top down, every group is cut in two. First by size, large instances from small ones: so bolts do not
//! lie in boxes that a plate has made large, and are left out together where they are too small to be seen. Then in space,
//! where that costs least: at one of [`BINS`] places along an axis, by the edges of both boxes and how many instances are
//! in each (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies", with edges in place of surfaces, which
//! on a sheet of rivets do not tell squares from strips). While the tree is built it takes 36 bytes a placement; boxes are
//! then formed in f64 in another walk over the instances. One thread, so that the result is the same anywhere. `docs/performance.md` has what other cuts cost.

use super::Container;
use super::format::*;
use crate::scene::opened::instance_box;

/// A group of no more instances, or of one placement, is a leaf.
const LEAF_INSTANCES: u32 = 128;
/// Places along an axis where a group may be cut, and one more.
const BINS: usize = 16;
/// Groups below so many others are cut in halves, so that the depth is bounded whatever the instances: 32 more at most.
const BALANCED_FROM: usize = 24;

/// A tree of boxes over all instances.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Groups {
    /// The groups, each before those below it; the first holds all instances. None if there are no instances.
    pub rows: Vec<GroupRow>,
    /// The instances in the order in which groups hold them.
    pub members: Vec<u32>,
}

/// A box from the first instance's centre; one that no f32 can hold is cut off there.
#[derive(Clone, Copy)]
struct SmallBox {
    low: [f32; 3],
    high: [f32; 3],
}

impl SmallBox {
    const EMPTY: Self = Self { low: [f32::MAX; 3], high: [-f32::MAX; 3] };

    fn with(self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    fn with_point(self, point: [f32; 3]) -> Self {
        self.with(&Self { low: point, high: point })
    }

    fn centre(&self) -> [f32; 3] {
        std::array::from_fn(|axis| self.low[axis] * 0.5 + self.high[axis] * 0.5)
    }

    fn edges(&self) -> [f64; 3] {
        std::array::from_fn(|axis| (f64::from(self.high[axis]) - f64::from(self.low[axis])).max(0.0))
    }

    /// Sizes that differ by less than a factor of 4 have the same, or neighbouring ones.
    fn size_class(&self) -> usize {
        let longest = self.edges().into_iter().fold(0.0, f64::max) as f32;
        (longest.to_bits() >> 24) as usize
    }
}

/// Instances that stay together: a placement of a part, with all its cells.
#[derive(Clone, Copy)]
struct Placement {
    bounds: SmallBox,
    first: u32,
    count: u32,
}

/// The box of an instance as its corners in world space, finite.
pub(super) fn corners(parts: &[PartRow], row: &InstanceRow) -> [[f64; 3]; 2] {
    let Some(part) = parts.get(row.part as usize) else { return [[0.0; 3]; 2] };
    let bounds = instance_box(part, row);
    let (low, high) = (bounds.centre - bounds.half_extent, bounds.centre + bounds.half_extent);
    if low.is_finite() && high.is_finite() {
        [low.to_array(), high.to_array()]
    } else {
        [[-f64::MAX; 3], [f64::MAX; 3]]
    }
}

fn placements(parts: &[PartRow], instances: impl Iterator<Item = InstanceRow>) -> Vec<Placement> {
    let mut placements: Vec<Placement> = Vec::with_capacity(instances.size_hint().0);
    let (mut origin, mut last) = (None::<[f64; 3]>, None);
    for (number, row) in (0..).zip(instances) {
        let [low, high] = corners(parts, &row);
        let origin =
            *origin.get_or_insert_with(|| std::array::from_fn(|axis| low[axis] * 0.5 + high[axis] * 0.5));
        let from_origin = |corner: [f64; 3]| -> [f32; 3] {
            std::array::from_fn(|axis| (corner[axis] - origin[axis]).clamp(-1e37, 1e37) as f32)
        };
        let bounds = SmallBox { low: from_origin(low), high: from_origin(high) };
        match placements
            .last_mut()
            .filter(|_| last.is_some_and(|last| are_cells_of_one(parts, last, row.part)))
        {
            Some(placement) => {
                placement.bounds = placement.bounds.with(&bounds);
                placement.count += 1;
            }
            None => placements.push(Placement { bounds, first: number, count: 1 }),
        }
        last = Some(row.part);
    }
    placements
}

/// Whether an instance of `part`, right after one of `last`, belongs to the same placement.
fn are_cells_of_one(parts: &[PartRow], last: u32, part: u32) -> bool {
    let in_tree = |row: &PartRow| row.is_parent() || !row.is_root();
    match (parts.get(last as usize), parts.get(part as usize)) {
        (Some(a), Some(b)) => last < part && a.source == b.source && in_tree(a) && in_tree(b),
        _ => false,
    }
}

impl Groups {
    /// Those of a container, which have been checked.
    pub fn of(container: &Container<'_>) -> Self {
        Self { rows: container.groups().to_vec(), members: container.members().to_vec() }
    }

    /// Builds the groups of the instances that `instances` gives, the same each time. Rows that name parts that do not
    /// exist have no box; they are refused when the tables are checked.
    pub fn build<I: Iterator<Item = InstanceRow>>(parts: &[PartRow], instances: impl Fn() -> I) -> Self {
        let mut placements = placements(parts, instances());
        let mut groups = Self::default();
        if !placements.is_empty() {
            groups.add(&mut placements, 0);
        }
        drop(placements);
        groups.measure(parts, instances());
        groups
    }

    /// Adds a group of these placements and all groups below it.
    fn add(&mut self, placements: &mut [Placement], depth: usize) {
        let (own, first) = (self.rows.len(), self.members.len());
        self.rows.push(GroupRow { first: first as u32, ..GroupRow::default() });
        match cut(placements, depth) {
            Some(at) => {
                let (low, high) = placements.split_at_mut(at);
                self.add(low, depth + 1);
                self.add(high, depth + 1);
            }
            None => {
                placements.sort_unstable_by_key(|placement| placement.first);
                let members = placements.iter().flat_map(|p| p.first..p.first + p.count);
                self.members.extend(members);
            }
        }
        self.rows[own].count = (self.members.len() - first) as u32;
        self.rows[own].end = self.rows.len() as u32;
    }

    /// Gives every group its box and its largest circle.
    fn measure(&mut self, parts: &[PartRow], instances: impl Iterator<Item = InstanceRow>) {
        let mut leaf_of = vec![0u32; self.members.len()];
        for (index, row) in self.rows.iter_mut().enumerate() {
            (row.low, row.high) = ([f64::MAX; 3], [-f64::MAX; 3]);
            if row.is_leaf(index) {
                self.members[row.members()]
                    .iter()
                    .for_each(|&number| leaf_of[number as usize] = index as u32);
            }
        }
        for (leaf, row) in leaf_of.iter().zip(instances) {
            let [low, high] = corners(parts, &row);
            enclose(&mut self.rows[*leaf as usize], low, high, radius(low, high));
        }
        for index in (0..self.rows.len()).rev() {
            let end = self.rows[index].end as usize;
            let mut below = index + 1;
            while below < end {
                let GroupRow { low, high, radius, end: next, .. } = self.rows[below];
                enclose(&mut self.rows[index], low, high, radius);
                below = next as usize;
            }
        }
    }
}

/// Half the diagonal, rounded up.
pub(super) fn radius(low: [f64; 3], high: [f64; 3]) -> f32 {
    let squared: f64 = (0..3).map(|axis| (high[axis] * 0.5 - low[axis] * 0.5).powi(2)).sum();
    (squared.sqrt() as f32).next_up().min(f32::MAX)
}

fn enclose(row: &mut GroupRow, low: [f64; 3], high: [f64; 3], radius: f32) {
    for axis in 0..3 {
        row.low[axis] = row.low[axis].min(low[axis]);
        row.high[axis] = row.high[axis].max(high[axis]);
    }
    row.radius = row.radius.max(radius);
}

/// Orders placements so that those of the first half come first and gives their number; `None` for a leaf.
fn cut(placements: &mut [Placement], depth: usize) -> Option<usize> {
    let instances: u64 = placements.iter().map(|placement| u64::from(placement.count)).sum();
    if placements.len() == 1 || instances <= u64::from(LEAF_INSTANCES) {
        return None;
    }
    let class = (depth < BALANCED_FROM).then(|| least_class_of_the_large(placements)).flatten();
    if let Some(class) = class {
        return Some(partition(placements, |placement| placement.bounds.size_class() < class));
    }
    let centres = placements.iter().fold(SmallBox::EMPTY, |b, p| b.with_point(p.bounds.centre()));
    let cheapest = (depth < BALANCED_FROM).then(|| cheapest_cut(placements, &centres)).flatten();
    let Some((axis, bin)) = cheapest else {
        let middle = placements.len() / 2;
        let axis = longest_axis(&centres);
        placements.select_nth_unstable_by(middle, |a, b| {
            let key = |p: &Placement| p.bounds.centre()[axis];
            key(a).total_cmp(&key(b)).then(a.first.cmp(&b.first))
        });
        return Some(middle);
    };
    Some(partition(placements, |placement| bin_of(placement, &centres, axis) < bin))
}

/// The greatest class of size that, with all above it, fills a leaf, if what is below it does as well.
fn least_class_of_the_large(placements: &[Placement]) -> Option<usize> {
    let mut counts = [0u64; 128];
    placements
        .iter()
        .for_each(|placement| counts[placement.bounds.size_class()] += u64::from(placement.count));
    let (all, leaf) = (counts.iter().sum::<u64>(), u64::from(LEAF_INSTANCES));
    let mut large = 0;
    let class = (0..counts.len()).rev().find(|&class| {
        large += counts[class];
        large >= leaf
    });
    class.filter(|_| all - large >= leaf)
}

fn longest_axis(bounds: &SmallBox) -> usize {
    let edge = |axis: usize| bounds.high[axis] - bounds.low[axis];
    (1..3).fold(0, |longest, axis| if edge(axis) > edge(longest) { axis } else { longest })
}

/// In which of the equal pieces of the box of centres the centre of a placement is.
fn bin_of(placement: &Placement, centres: &SmallBox, axis: usize) -> usize {
    let edge = centres.high[axis] - centres.low[axis];
    let share = (placement.bounds.centre()[axis] - centres.low[axis]) / edge;
    ((share * BINS as f32) as usize).min(BINS - 1)
}

/// The axis and the first piece of the second half of the cut of least cost; `None` if no axis has an extent.
fn cheapest_cut(placements: &[Placement], centres: &SmallBox) -> Option<(usize, usize)> {
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| centres.high[axis] > centres.low[axis]) {
        let mut bins = [(SmallBox::EMPTY, 0u64); BINS];
        for placement in placements {
            let (bounds, count) = &mut bins[bin_of(placement, centres, axis)];
            *bounds = bounds.with(&placement.bounds);
            *count += u64::from(placement.count);
        }
        let (below, above) = (running(bins.iter()), running(bins.iter().rev()));
        for bin in 1..BINS {
            let (low, high) = (below[bin - 1], above[BINS - 1 - bin]);
            let cost = low.0 + high.0;
            if low.1 > 0 && high.1 > 0 && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, bin));
            }
        }
    }
    best.map(|(_, axis, bin)| (axis, bin))
}

/// Cost and number of instances of the first bin, the first two, ...
fn running<'a>(bins: impl Iterator<Item = &'a (SmallBox, u64)>) -> Vec<(f64, u64)> {
    let sum = bins.scan((SmallBox::EMPTY, 0), |(bounds, count), bin| {
        *bounds = bounds.with(&bin.0);
        *count += bin.1;
        Some((bounds.edges().iter().sum::<f64>() * *count as f64, *count))
    });
    sum.collect()
}

/// Brings those for which `is_first` holds before the others and gives their number.
fn partition(placements: &mut [Placement], is_first: impl Fn(&Placement) -> bool) -> usize {
    let mut firsts = 0;
    for at in 0..placements.len() {
        if is_first(&placements[at]) {
            placements.swap(firsts, at);
            firsts += 1;
        }
    }
    firsts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> PartRow {
        PartRow { grid_high: [1; 3], ..PartRow::default() }
    }

    fn cell(parent_distance: u32, leaf_cells: u32) -> PartRow {
        PartRow { parent_distance, leaf_cells, source: 1, flags: PartRow::CELL, ..cube() }
    }

    /// A cube of one unit; and the cells of one part, each a cube: a parent and two leaf cells.
    fn parts() -> Vec<PartRow> {
        vec![cube(), cell(0, 2), cell(1, 0), cell(2, 0)]
    }

    fn at(part: u32, [x, y, z]: [f64; 3]) -> InstanceRow {
        let world_from_part = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, x, y, z];
        InstanceRow { part, world_from_part, ..InstanceRow::default() }
    }

    fn built(instances: &[InstanceRow]) -> Groups {
        let groups = Groups::build(&parts(), || instances.iter().copied());
        assert_eq!(groups, Groups::build(&parts(), || instances.iter().copied()));
        groups
    }

    fn leaves(groups: &Groups) -> Vec<&[u32]> {
        let rows = groups.rows.iter().enumerate().filter(|(index, row)| row.is_leaf(*index));
        rows.map(|(_, row)| &groups.members[row.members()]).collect()
    }

    #[test]
    fn leaves_are_small_and_compact() {
        let number = |i: usize| (i * 7919) % 4096;
        let position = |i: usize| [number(i) % 64, number(i) / 64, 0].map(|c| 10.0 * c as f64);
        let groups = built(&(0..4096).map(|i| at(0, position(i))).collect::<Vec<_>>());
        let leaves = leaves(&groups);
        assert!(leaves.iter().all(|leaf| (32..=128).contains(&leaf.len())), "{leaves:?}");
        for row in
            groups.rows.iter().enumerate().filter(|(index, row)| row.is_leaf(*index)).map(|(_, row)| row)
        {
            let edges: f64 = (0..3).map(|axis| row.high[axis] - row.low[axis]).sum();
            assert!(edges < 2.6 * 10.0 * f64::from(row.count).sqrt(), "{row:?}");
            assert!((0.866..0.867).contains(&row.radius));
        }
        assert_eq!(groups.rows[0].high, [631.0, 631.0, 1.0]);
    }

    /// A hundred large cubes in a heap of small ones are no part of their groups, but of one leaf.
    #[test]
    fn large_and_small_instances_are_in_different_groups() {
        let scaled = |i: usize| {
            let mut row = at(0, [(i % 80) as f64, (i / 80) as f64, 0.0]);
            let scale = if i % 40 == 7 { 50.0 } else { 1.0 };
            [0, 4, 8].iter().for_each(|&at| row.world_from_part[at] = scale);
            row
        };
        let groups = built(&(0..6000).map(scaled).collect::<Vec<_>>());
        let large = leaves(&groups).iter().filter(|leaf| leaf.iter().any(|&i| i % 40 == 7)).count();
        assert!(large <= 3, "{large}");
        let uniform = |leaf: &[u32]| leaf.iter().all(|i| (i % 40 == 7) == (leaf[0] % 40 == 7));
        assert!(leaves(&groups).into_iter().all(uniform));
    }

    #[test]
    fn cells_of_a_placement_stay_together() {
        let place = |i: usize| (1..4).map(move |part| at(part, [(i * 37 % 200) as f64, 0.0, 0.0]));
        let groups = built(&(0..200).flat_map(place).collect::<Vec<_>>());
        let leaves = leaves(&groups);
        assert!(leaves.len() > 4);
        for leaf in leaves {
            assert!(leaf.len() <= 128 && leaf.len() % 3 == 0 && leaf.is_sorted(), "{leaf:?}");
            assert!(leaf.chunks(3).all(|cells| cells[0] % 3 == 0 && cells[2] == cells[0] + 2), "{leaf:?}");
        }
    }

    #[test]
    fn instances_at_one_place_and_boxes_without_end_have_groups() {
        let same = built(&vec![at(0, [5.0; 3]); 1000]);
        assert!(leaves(&same).iter().all(|leaf| leaf.len() <= 128));
        let wild = |i: usize| match i % 4 {
            0 => f64::MAX,
            1 => -1e300,
            2 => 1e-300,
            _ => i as f64,
        };
        let mut instances: Vec<_> = (0..1000).map(|i| at(0, [wild(i), wild(i / 4), i as f64])).collect();
        instances[7].world_from_part[0] = f64::MAX;
        instances[8].world_from_part[..9].fill(0.0);
        let groups = built(&instances);
        let finite = |row: &GroupRow| row.low.iter().chain(&row.high).all(|c| c.is_finite());
        assert!(groups.rows.iter().all(|row| finite(row) && row.radius.is_finite()));
        assert!(leaves(&groups).iter().all(|leaf| leaf.len() <= 128));
        assert_eq!(built(&[]), Groups::default());
    }

    /// Heaps at distances that grow by a factor: every cut leaves one of them on one side.
    #[test]
    fn the_depth_is_bounded() {
        let heap = |i: i32| {
            let mut point = at(0, [16f64.powi(i), 0.0, 0.0]);
            point.world_from_part[..9].fill(0.0);
            [point; 150]
        };
        let groups = built(&(-32..30).flat_map(heap).collect::<Vec<_>>());
        let mut ends: Vec<u32> = Vec::new();
        let mut deepest = 0;
        for (index, row) in groups.rows.iter().enumerate() {
            ends.retain(|&end| end as usize > index);
            ends.push(row.end);
            deepest = deepest.max(ends.len());
        }
        assert!((BALANCED_FROM + 2..MAX_GROUP_DEPTH).contains(&deepest), "{deepest}");
    }
}
