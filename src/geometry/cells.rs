//! A welded mesh in, cells of at most 65,536 vertices out: the paper's own future work (section 7).
//!
//! A kd-tree on triangles: the list is cut across one axis of their box, near its middle and where the fewest triangles
//! reach over the cut, until every piece fits. Positions that several cells share are locked, so that cells meet
//! without cracks at any mix of levels; all cells keep the grid of the whole, so that they meet exactly. What the
//! locked positions cost in the coarse states, parent cells win back (`cell_tree.rs`).

use super::record::{MAX_PART_TRIANGLES, MAX_PART_VERTICES};
use super::weld::WeldedMesh;

/// A piece of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// The piece as a mesh of its own.
    pub mesh: WeldedMesh,
    /// Per position: whether another cell has it too.
    pub locked: Vec<bool>,
}

/// Cuts a mesh that is too large; a small one is returned whole, as one cell with nothing locked.
pub fn cut(mesh: WeldedMesh) -> Vec<Cell> {
    cut_to(mesh, MAX_PART_VERTICES, MAX_PART_TRIANGLES)
}

/// Cuts a mesh into cells of at most so many vertices and triangles; three vertices are always allowed. None of a mesh
/// without triangles.
pub fn cut_to(mesh: WeldedMesh, max_vertices: usize, max_triangles: usize) -> Vec<Cell> {
    let fits = mesh.wedges.len() <= max_vertices && mesh.triangles.len() <= max_triangles;
    if fits && !mesh.triangles.is_empty() {
        let locked = vec![false; mesh.positions.len()];
        return vec![Cell { mesh, locked }];
    }
    if mesh.triangles.is_empty() {
        return Vec::new();
    }
    let mut pieces = Vec::new();
    let mut last_count = vec![0; mesh.wedges.len()];
    let mut counts = 0;
    let centroids = centroids(&mesh);
    let mut sides = Vec::new();
    let mut stack = vec![(0..mesh.triangles.len() as u32).collect::<Vec<u32>>()];
    while let Some(mut piece) = stack.pop() {
        counts += 1;
        let fits =
            piece.len() <= max_triangles && has_at_most(max_vertices, &mesh, &piece, &mut last_count, counts);
        if fits || piece.len() == 1 {
            pieces.push(piece);
            continue;
        }
        let upper = halve(&mesh, &centroids, &mut piece, &mut sides);
        stack.push(upper);
        stack.push(piece);
    }
    let owners = owner_counts(&mesh, &pieces);
    let mut local = last_count;
    pieces.into_iter().map(|piece| cell(&mesh, piece, &owners, &mut local)).collect()
}

/// Whether a piece has at most so many wedges; `last_count` is the number of the last count that each wedge was in,
/// `this` of this one.
fn has_at_most(most: usize, mesh: &WeldedMesh, piece: &[u32], last_count: &mut [u32], this: u32) -> bool {
    let wedges = piece.iter().flat_map(|&t| mesh.triangles[t as usize]);
    let mut first = wedges.filter(|&w| std::mem::replace(&mut last_count[w as usize], this) != this);
    first.nth(most).is_none()
}

/// The sum of the corners of every triangle, in grid steps.
fn centroids(mesh: &WeldedMesh) -> Vec<[u32; 3]> {
    let count = mesh.triangles.len() as u32;
    let sum = |triangle| spans(corners(mesh, triangle)).map(|[_, _, sum]| sum);
    (0..count).map(sum).collect()
}

/// Where more than this share of the triangles reaches over a cut, they are no measure of how long its border is: a fan's meet
/// in one vertex.
const MOST_REACHING: f64 = 0.125;

/// Keeps the lower half of a piece and returns the upper. `sides` is scratch, of zeros.
fn halve(mesh: &WeldedMesh, centroids: &[[u32; 3]], piece: &mut Vec<u32>, sides: &mut Vec<u8>) -> Vec<u32> {
    let slabs = Slabs::along_axes(mesh, centroids, piece);
    let cuts = || slabs.iter().flatten().filter_map(Slabs::best_cut);
    let mut cut = cuts().min_by_key(|cut| cut.reaching);
    if cut.as_ref().is_some_and(|cut| f64::from(cut.reaching) > MOST_REACHING * piece.len() as f64) {
        cut = cuts().min_by_key(|cut| shared(mesh, centroids, piece, cut, sides));
    }
    let Some(cut) = cut else {
        // All in one slab along every axis: any half is as good as the other.
        return piece.split_off(piece.len() / 2);
    };
    // Both keep the order of the mesh, which runs along the surface.
    let (lower, upper) = piece.iter().partition(|&&triangle| cut.is_below(centroids[triangle as usize]));
    *piece = lower;
    upper
}

/// How many positions both sides of a cut have: those of its border. `sides` is scratch, of zeros.
fn shared(mesh: &WeldedMesh, centroids: &[[u32; 3]], piece: &[u32], cut: &Cut, sides: &mut Vec<u8>) -> usize {
    sides.resize(mesh.positions.len(), 0);
    let mut shared = 0;
    for &triangle in piece {
        let side = if cut.is_below(centroids[triangle as usize]) { 1 } else { 2 };
        for position in mesh.corner_positions(mesh.triangles[triangle as usize]) {
            let sides = &mut sides[position as usize];
            shared += usize::from(*sides == 3 - side);
            *sides |= side;
        }
    }
    for &triangle in piece {
        for position in mesh.corner_positions(mesh.triangles[triangle as usize]) {
            sides[position as usize] = 0;
        }
    }
    shared
}

/// The corners of a triangle, in grid steps.
fn corners(mesh: &WeldedMesh, triangle: u32) -> [[u32; 3]; 3] {
    mesh.corner_positions(mesh.triangles[triangle as usize]).map(|position| mesh.positions[position as usize])
}

/// Along each axis the least and greatest coordinate of some points, and their sum.
fn spans([a, b, c]: [[u32; 3]; 3]) -> [[u32; 3]; 3] {
    [0, 1, 2].map(|axis| {
        let [a, b, c] = [a[axis], b[axis], c[axis]];
        [a.min(b).min(c), a.max(b).max(c), a + b + c]
    })
}

/// Slabs of equal width along an axis that centroids are counted in.
const SLABS: usize = 128;
/// So many that a product with a reciprocal is exact, rounded down: a distance takes 23 bits and a width 17.
const RECIPROCAL_BITS: u32 = 40;
/// The smaller side of a cut gets at least this share of the triangles.
const LEAST_SHARE: f64 = 0.35;

/// How a piece lies along one axis. Lengths are three grid steps, as the centroids are.
struct Slabs {
    axis: usize,
    low: u32,
    width: u32,
    /// 2 to the power of [`RECIPROCAL_BITS`] over the width, rounded up.
    reciprocal: u64,
    /// Centroids in each slab.
    centroids: [u32; SLABS],
    /// Triangles that reach over the lower side of each slab, as differences along the axis.
    reaching: [i32; SLABS + 1],
}

/// Where a piece may be cut: centroids below `at` are on the lower side.
struct Cut {
    axis: usize,
    at: u32,
    /// How many triangles reach over it: what the new border is about as long as.
    reaching: i32,
}

impl Cut {
    /// Whether a triangle with that centroid is on the lower side.
    fn is_below(&self, centroid: [u32; 3]) -> bool {
        centroid[self.axis] < self.at
    }
}

impl Slabs {
    /// Along every axis; `None` where all centroids have the same coordinate.
    fn along_axes(mesh: &WeldedMesh, centroids: &[[u32; 3]], piece: &[u32]) -> [Option<Self>; 3] {
        let mut range = [[u32::MAX, 0]; 3];
        for &triangle in piece {
            for ([low, high], sum) in range.iter_mut().zip(centroids[triangle as usize]) {
                (*low, *high) = ((*low).min(sum), (*high).max(sum));
            }
        }
        let mut slabs = [0, 1, 2].map(|axis| Self::empty(axis, range[axis]));
        for &triangle in piece {
            let spans = spans(corners(mesh, triangle));
            for (slabs, span) in
                slabs.iter_mut().zip(spans).filter_map(|(slabs, span)| Some((slabs.as_mut()?, span)))
            {
                slabs.count(span);
            }
        }
        slabs
    }

    fn empty(axis: usize, [low, high]: [u32; 2]) -> Option<Self> {
        let width = high.checked_sub(low).filter(|&extent| extent > 0)? / SLABS as u32 + 1;
        let reciprocal = (1 << RECIPROCAL_BITS) / u64::from(width) + 1;
        Some(Self { axis, low, width, reciprocal, centroids: [0; SLABS], reaching: [0; SLABS + 1] })
    }

    fn count(&mut self, [least, greatest, sum]: [u32; 3]) {
        let [least, greatest, middle] = [3 * least, 3 * greatest, sum].map(|at| self.slab(at));
        self.centroids[middle] += 1;
        self.reaching[least + 1] += 1;
        self.reaching[greatest + 1] -= 1;
    }

    fn slab(&self, at: u32) -> usize {
        let along = u64::from(at.saturating_sub(self.low));
        (((along * self.reciprocal) >> RECIPROCAL_BITS) as usize).min(SLABS - 1)
    }

    /// The cut that the fewest triangles reach over, of those that leave enough on both sides; the median's slab if a
    /// slab in the middle holds too many.
    fn best_cut(&self) -> Option<Cut> {
        let total: u32 = self.centroids.iter().sum();
        let share = |below: u32| f64::from(below.min(total - below)) / f64::from(total);
        let (mut below, mut reaching) = (0, 0);
        let mut cuts = Vec::with_capacity(SLABS);
        for slab in 1..SLABS {
            below += self.centroids[slab - 1];
            reaching += self.reaching[slab];
            cuts.push((
                share(below),
                Cut { axis: self.axis, at: self.low + slab as u32 * self.width, reaching },
            ));
        }
        let best_share = cuts.iter().map(|&(share, _)| share).fold(0.0, f64::max);
        let least = LEAST_SHARE.min(best_share);
        let fair = cuts.into_iter().filter(|&(share, _)| share > 0.0 && share >= least);
        fair.map(|(_, cut)| cut).min_by_key(|cut| cut.reaching)
    }
}

/// For every position, how many pieces use it.
fn owner_counts(mesh: &WeldedMesh, pieces: &[Vec<u32>]) -> Vec<u32> {
    let mut owners = vec![0; mesh.positions.len()];
    let mut last_piece = vec![u32::MAX; mesh.positions.len()];
    for (number, piece) in pieces.iter().enumerate() {
        for position in piece.iter().flat_map(|&t| mesh.corner_positions(mesh.triangles[t as usize])) {
            if last_piece[position as usize] != number as u32 {
                last_piece[position as usize] = number as u32;
                owners[position as usize] += 1;
            }
        }
    }
    owners
}

/// The cell of a piece; `local` has an entry for each wedge, whatever it is.
fn cell(mesh: &WeldedMesh, piece: Vec<u32>, owners: &[u32], local: &mut [u32]) -> Cell {
    let all = || piece.iter().flat_map(|&t| mesh.triangles[t as usize]);
    all().for_each(|wedge| local[wedge as usize] = u32::MAX);
    let first = |&wedge: &u32| std::mem::replace(&mut local[wedge as usize], 0) == u32::MAX;
    let mut wedges: Vec<u32> = all().filter(first).collect();
    wedges.sort_unstable();
    wedges.iter().zip(0..).for_each(|(&wedge, number)| local[wedge as usize] = number);
    let mut cell = WeldedMesh { attributes: mesh.attributes, ..WeldedMesh::default() };
    let mut locked = Vec::new();
    let mut last = None;
    for &wedge in &wedges {
        let position = mesh.wedge_position[wedge as usize];
        if last != Some(position) {
            last = Some(position);
            cell.positions.push(mesh.positions[position as usize]);
            locked.push(owners[position as usize] > 1);
        }
        cell.wedges.push(mesh.wedges[wedge as usize]);
        cell.wedge_position.push(cell.positions.len() as u32 - 1);
    }
    cell.triangles =
        piece.iter().map(|&t| mesh.triangles[t as usize].map(|wedge| local[wedge as usize])).collect();
    Cell { mesh: cell, locked }
}
