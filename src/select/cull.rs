//! Groups of instances and a view in, the candidates out: the instances that the view does not cull, ascending.
//!
//! A group is left out as a whole where every member would be culled by its own test (`reference::select::is_culled`), which
//! is made in f32. So the test of a group, in f64 on its box, leaves more room than the rounding of all members' tests together:
//! margins are five times what an analysis of it gives. What that lets through is tested by itself. The result is the same
//! whatever the groups, which only decide what it costs: in proportion to the groups and members that the frustum
//! touches, and a bit of memory for every instance.

use std::ops::Range;

use rayon::prelude::*;

use crate::container::{GroupRow, Groups};
use crate::gpu::layout::{SelectParams, SelectRow};
use crate::reference::power::log2;
use crate::reference::select::distance2;

/// Coordinates beyond this overflow in the squares of f32: nothing is concluded of them.
const MAX_COORDINATE: f64 = 1e15;
/// What the test of a member may be off by, as a share of the distance: 13 roundings of 2^-24, five times.
const ROUNDING: f64 = 1.0 / (1u64 << 18) as f64;
/// And as a share of the coordinates, of which f32 pairs have 48 bits: 4 of 2^-48, 16 times.
const SPLIT_ROUNDING: f64 = 1.0 / (1u64 << 42) as f64;
/// What the f32 logarithm of an area may be off by, ten times.
const AREA_ROUNDING: f64 = 1e-3;
/// The least normal f32, as whose logarithm all smaller ones count.
const LEAST: f64 = f32::MIN_POSITIVE as f64;
/// Leaves that one task tests at least.
const LEAVES_A_TASK: usize = 8;

/// What a group's box shows of all its members.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// Each is culled.
    Culled,
    /// Some may be.
    Cut,
    /// No plane cuts the box.
    Inside,
}

/// The view as groups see it.
struct GroupView<'a> {
    params: &'a SelectParams,
    eye: [f64; 3],
    eye_size: f64,
    planes: [[f64; 4]; 6],
}

impl<'a> GroupView<'a> {
    fn new(params: &'a SelectParams) -> Self {
        let eye: [f64; 3] =
            std::array::from_fn(|axis| f64::from(params.eye_high[axis]) + f64::from(params.eye_low[axis]));
        let eye_size = eye.iter().map(|c| c.abs()).sum();
        Self { params, eye, eye_size, planes: params.planes.map(|plane| plane.map(f64::from)) }
    }

    /// Never [`Verdict::Culled`] if a member is not. Where numbers are not finite, comparisons are false: [`Verdict::Cut`].
    fn judge(&self, group: &GroupRow, inside: bool) -> Verdict {
        let largest = |axis: usize| group.low[axis].abs().max(group.high[axis].abs());
        let size = largest(0) + largest(1) + largest(2) + self.eye_size;
        let is_exact = size < MAX_COORDINATE;
        if !is_exact {
            return Verdict::Cut;
        }
        let low: [f64; 3] = std::array::from_fn(|axis| group.low[axis] - self.eye[axis]);
        let high: [f64; 3] = std::array::from_fn(|axis| group.high[axis] - self.eye[axis]);
        if self.is_too_small(group.radius.into(), &low, &high, size) {
            return Verdict::Culled;
        }
        if inside { Verdict::Inside } else { self.judge_planes(&low, &high, size) }
    }

    fn judge_planes(&self, low: &[f64; 3], high: &[f64; 3], size: f64) -> Verdict {
        let far: f64 = (0..3).map(|axis| low[axis].abs().max(high[axis].abs())).sum();
        let margin = ROUNDING * far + SPLIT_ROUNDING * size + 16.0 * LEAST;
        let mut verdict = Verdict::Inside;
        for &[x, y, z, w] in &self.planes {
            let normal = [x, y, z];
            let [mut least, mut most, mut steepest] = [w, w, 0.0f64];
            for axis in 0..3 {
                let (a, b) = (normal[axis] * low[axis], normal[axis] * high[axis]);
                least += a.min(b);
                most += a.max(b);
                steepest = steepest.max(normal[axis].abs());
            }
            let margin = steepest * margin + ROUNDING * w.abs();
            if most + margin < 0.0 {
                return Verdict::Culled;
            }
            let is_inside = least - margin > 0.0;
            verdict = if is_inside { verdict } else { Verdict::Cut };
        }
        verdict
    }

    /// Whether a circle of this radius, at the nearest point of the box, covers less than the least area.
    fn is_too_small(&self, radius: f64, low: &[f64; 3], high: &[f64; 3], size: f64) -> bool {
        let log2_area_min = f64::from(self.params.log2_area_min) - AREA_ROUNDING;
        if self.params.parallel != 0 {
            let log2_area = f64::from(self.params.log2_area_scale) + (radius * radius).max(LEAST).log2();
            return log2_area < log2_area_min;
        }
        let squared = |axis: usize| low[axis].max(-high[axis]).max(0.0).powi(2);
        let near = (squared(0) + squared(1) + squared(2)).sqrt() - SPLIT_ROUNDING * size;
        let log2_area = f64::from(self.params.log2_area_scale) + (radius * radius).max(LEAST).log2()
            - (near * near - radius * radius).max(LEAST).log2();
        // Nearer than that, the difference of the squares loses its precision.
        near > 2.1 * radius && log2_area < log2_area_min
    }
}

/// A leaf that is not culled as a whole: its members, and whether no plane cuts its box.
struct Leaf {
    members: Range<usize>,
    is_inside: bool,
}

fn leaves(groups: &[GroupRow], params: &SelectParams) -> Vec<Leaf> {
    let view = GroupView::new(params);
    let mut leaves = Vec::new();
    let (mut at, mut inside_until) = (0, 0);
    while let Some(group) = groups.get(at) {
        let end = group.end as usize;
        let verdict = view.judge(group, at < inside_until);
        if verdict == Verdict::Inside && at >= inside_until {
            inside_until = end;
        }
        if verdict != Verdict::Culled && group.is_leaf(at) {
            leaves.push(Leaf { members: group.members(), is_inside: verdict == Verdict::Inside });
        }
        at = if verdict == Verdict::Culled { end } else { at + 1 };
    }
    leaves
}

/// Members that are tested together.
const BLOCK: usize = 64;

/// What the test of a member needs, a column each, in the order of the members: leaves are read from end to end, and
/// a compiler makes vectors of the loops.
#[derive(Debug, Default)]
struct Columns {
    centre_high: [Vec<f32>; 3],
    centre_low: [Vec<f32>; 3],
    half_extent: [Vec<f32>; 3],
}

impl Columns {
    fn new(members: &[u32], rows: &[SelectRow]) -> Self {
        // Rows lie anywhere: each is gone to once.
        let numbers = |&number: &u32| {
            let row = &rows[number as usize];
            [row.centre_high, row.centre_low, row.half_extent]
        };
        let gathered: Vec<[[f32; 3]; 3]> = members.par_iter().map(numbers).collect();
        let columns = |of: usize| {
            std::array::from_fn(|axis| gathered.par_iter().map(|numbers| numbers[of][axis]).collect())
        };
        Self { centre_high: columns(0), centre_low: columns(1), half_extent: columns(2) }
    }

    /// Whether each member of a range of at most [`BLOCK`] is culled; `reference::select::is_culled`, operation by
    /// operation.
    fn culled(&self, members: Range<usize>, is_inside: bool, params: &SelectParams) -> [bool; BLOCK] {
        let mut block = Block::default();
        for axis in 0..3 {
            let (eye_high, eye_low) = (params.eye_high[axis], params.eye_low[axis]);
            let high = self.centre_high[axis][members.clone()].iter();
            let low = self.centre_low[axis][members.clone()].iter();
            for ((centre, high), low) in block.centre[axis].iter_mut().zip(high).zip(low) {
                *centre = (high - eye_high) + (low - eye_low);
            }
            block.half[axis][..members.len()].copy_from_slice(&self.half_extent[axis][members.clone()]);
        }
        let mut culled = [false; BLOCK];
        if !is_inside {
            params.planes.iter().for_each(|plane| block.cull_outside(plane, &mut culled));
        }
        block.cull_small(params, &mut culled);
        culled
    }
}

/// Some members, a column for each number.
struct Block {
    centre: [[f32; BLOCK]; 3],
    half: [[f32; BLOCK]; 3],
}

impl Default for Block {
    fn default() -> Self {
        Self { centre: [[0.0; BLOCK]; 3], half: [[0.0; BLOCK]; 3] }
    }
}

impl Block {
    fn cull_outside(&self, &[x, y, z, w]: &[f32; 4], culled: &mut [bool; BLOCK]) {
        let ([cx, cy, cz], [hx, hy, hz]) = (&self.centre, &self.half);
        for at in 0..BLOCK {
            let reach = x.abs() * hx[at] + y.abs() * hy[at] + z.abs() * hz[at];
            culled[at] |= ((x * cx[at] + y * cy[at] + z * cz[at]) + w) + reach < 0.0;
        }
    }

    fn cull_small(&self, params: &SelectParams, culled: &mut [bool; BLOCK]) {
        let ([cx, cy, cz], [hx, hy, hz]) = (&self.centre, &self.half);
        for at in 0..BLOCK {
            let radius2 = hx[at] * hx[at] + hy[at] * hy[at] + hz[at] * hz[at];
            let centre2 = cx[at] * cx[at] + cy[at] * cy[at] + cz[at] * cz[at];
            let log2_distance2 = log2(distance2(centre2, radius2, params));
            culled[at] |= (params.log2_area_scale + log2(radius2)) - log2_distance2 < params.log2_area_min;
        }
    }
}

/// Finds candidates, frame after frame.
#[derive(Debug, Default)]
pub struct Cull {
    columns: Columns,
    /// A bit for every instance, all zero between calls.
    marked: Vec<u64>,
    candidates: Vec<u32>,
    tested: usize,
}

impl Cull {
    /// Takes 36 bytes an instance. `rows` has one row an instance, of which `groups` has each once.
    pub fn new(groups: &Groups, rows: &[SelectRow]) -> Self {
        Self {
            columns: Columns::new(&groups.members, rows),
            marked: vec![0; rows.len().div_ceil(64)],
            ..Self::default()
        }
    }

    /// The instances that are not culled, ascending, of the groups that this was made for.
    pub fn find(&mut self, groups: &Groups, params: &SelectParams) -> &[u32] {
        let leaves = leaves(&groups.rows, params);
        self.tested = leaves.iter().map(|leaf| leaf.members.len()).sum();
        let columns = &self.columns;
        let kept = |leaves: &[Leaf]| -> Vec<u32> {
            let mut kept = Vec::with_capacity(leaves.iter().map(|leaf| leaf.members.len()).sum());
            for leaf in leaves {
                for start in leaf.members.clone().step_by(BLOCK) {
                    let members = start..leaf.members.end.min(start + BLOCK);
                    let culled = columns.culled(members.clone(), leaf.is_inside, params);
                    let numbers = groups.members[members].iter().zip(culled);
                    kept.extend(numbers.filter(|&(_, culled)| !culled).map(|(&number, _)| number));
                }
            }
            kept
        };
        let found: Vec<Vec<u32>> = leaves.par_chunks(LEAVES_A_TASK).map(kept).collect();
        self.sort(&found);
        &self.candidates
    }

    /// How many instances were tested by themselves in the last [`Cull::find`].
    pub fn tested(&self) -> usize {
        self.tested
    }

    /// Makes one ascending list of several.
    fn sort(&mut self, lists: &[Vec<u32>]) {
        for number in lists.iter().flatten() {
            self.marked[*number as usize / 64] |= 1 << (number % 64);
        }
        self.candidates.clear();
        for (word, first) in self.marked.iter_mut().zip((0u32..).step_by(64)) {
            let mut left = std::mem::take(word);
            while left != 0 {
                self.candidates.push(first + left.trailing_zeros());
                left &= left - 1;
            }
        }
    }
}
