//! The triangles of a coarser tier in, those of the next finer one out: collapses undone vertex by vertex.
//!
//! After Hoppe 1996, *Progressive Meshes*: a vertex that comes back takes over some of the corners of the one that it had
//! collapsed onto, and brings new triangles in between. Which corners it takes is a bit each; the new triangles nearly
//! always follow from that, because every edge between a corner that moves and one that stays would be torn open.
//!
//! The encoder and the decoder run the same code: [`undo`] asks a [`Teller`], which knows the answers and writes them
//! down, or reads them.

use crate::geometry::triangles_at::CONTINUES;

/// The list of a vertex of more corners than this is not looked at for new triangles.
const MOST_MATCHED: usize = 32;
/// No more triangles than so many are kept that would close gaps of a group.
const MOST_LIKELY: usize = 256;
/// The end of a list of corners.
const END: u32 = u32::MAX;

/// That the answers contradict what was said before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Contradiction(pub &'static str);

/// Who knows what each vertex brings back.
pub(super) trait Teller {
    /// A vertex is about to be split: its corners are asked for next.
    fn begin(&mut self, vertex: u32);
    /// Whether the new vertex takes over a corner, the one with the number `4 t + c`.
    fn moves(&mut self, corner: u32) -> Result<bool, Contradiction>;
    /// The next new triangle; `likely` are the ones that would close a gap, the likelier first, `next` the one after the
    /// last that was taken.
    fn triangle(&mut self, likely: &[[u16; 3]], next: &mut usize) -> Result<[u16; 3], Contradiction>;
}

/// A corner of the vertex that is split: the other two vertices of its triangle, the next and the previous one.
type Sides = [u16; 2];

/// The corners of a vertex that is split: those that move to the new one, and those that stay. Of a vertex with more than
/// [`MOST_MATCHED`] none is kept.
struct Star {
    movers: [Sides; MOST_MATCHED + 1],
    stayers: [Sides; MOST_MATCHED + 1],
    counts: [usize; 2],
}

impl Star {
    const EMPTY: Self =
        Self { movers: [[0; 2]; MOST_MATCHED + 1], stayers: [[0; 2]; MOST_MATCHED + 1], counts: [0; 2] };

    fn add(&mut self, sides: Sides, moves: bool) {
        let [staying, moving] = self.counts;
        if staying + moving > MOST_MATCHED {
            return;
        }
        // Both are written and one is counted, which costs less than a branch that nobody can foretell.
        self.movers[moving] = sides;
        self.stayers[staying] = sides;
        self.counts[usize::from(moves)] += 1;
    }

    fn is_too_large(&self) -> bool {
        self.counts[0] + self.counts[1] > MOST_MATCHED
    }

    fn movers(&self) -> &[Sides] {
        &self.movers[..self.counts[1]]
    }

    fn stayers(&self) -> &[Sides] {
        &self.stayers[..self.counts[0]]
    }
}

/// What a tier adds, besides its triangles.
pub(super) struct Added<'a> {
    /// The first vertex that it adds (`m_{k+1}`).
    pub first: u32,
    /// The vertices of the coarsest state (`q`).
    pub locked: u32,
    /// What each collapses onto.
    pub ecol: &'a [u16],
    /// The bytes of `triangles_at`.
    pub bytes: &'a [u8],
    /// How many triangles each adds.
    pub counts: &'a [u32],
    /// How many triangles there are with all of them (`t_k`).
    pub triangles: usize,
}

/// Triangles, and the corners at each vertex.
struct Corners {
    /// Three vertices each, and a zero.
    triangles: Vec<[u16; 4]>,
    /// For each corner the next one of its vertex; then, from `heads` on, for each vertex its first.
    links: Vec<u32>,
    heads: usize,
}

/// The places in a triangle after each, and before it.
const NEXT: [usize; 4] = [1, 2, 0, 0];
const PREVIOUS: [usize; 4] = [2, 0, 1, 0];

impl Corners {
    /// The corners of so many triangles, the base first.
    fn new(base: impl Iterator<Item = [u16; 3]>, triangles: usize, vertices: usize) -> Self {
        let mut corners = Self {
            triangles: Vec::with_capacity(triangles),
            links: vec![END; 4 * triangles + vertices],
            heads: 4 * triangles,
        };
        base.take(triangles).for_each(|triangle| corners.push(triangle));
        corners
    }

    /// Adds a triangle; its vertices are below the number of vertices, and there is room for it.
    fn push(&mut self, triangle: [u16; 3]) {
        for (corner, vertex) in (4 * self.triangles.len()..).zip(triangle) {
            let head = self.heads + usize::from(vertex);
            self.links[corner] = std::mem::replace(&mut self.links[head], corner as u32);
        }
        let [a, b, c] = triangle;
        self.triangles.push([a, b, c, 0]);
    }

    /// Hands the corners that move to the new vertex, the newest first; both lists keep their order.
    fn split(
        &mut self,
        vertex: u16,
        onto: u16,
        star: &mut Star,
        teller: &mut impl Teller,
    ) -> Result<(), Contradiction> {
        star.counts = [0; 2];
        let mut ends = [onto, vertex].map(|vertex| self.heads + usize::from(vertex));
        let mut corner = self.links[ends[0]];
        while corner != END {
            let following = self.links[corner as usize];
            let moves = teller.moves(corner)?;
            let triangle = &mut self.triangles[corner as usize / 4];
            let place = corner as usize % 4;
            star.add([triangle[NEXT[place]], triangle[PREVIOUS[place]]], moves);
            triangle[place] = if moves { vertex } else { onto };
            self.links[ends[usize::from(moves)]] = corner;
            ends[usize::from(moves)] = corner as usize;
            corner = following;
        }
        ends.into_iter().for_each(|end| self.links[end] = END);
        Ok(())
    }
}

/// The triangles that would close the gaps which the splits of a group leave.
#[derive(Default)]
struct Gaps {
    likely: Vec<[u16; 3]>,
    /// The corners at what was split and whether they moved, one vertex after another, ...
    stars: Vec<(Sides, bool)>,
    /// ... and for each the vertex, what it was split off, and where its corners end.
    ends: Vec<(u16, u16, usize)>,
}

impl Gaps {
    fn clear(&mut self) {
        self.likely.clear();
        self.stars.clear();
        self.ends.clear();
    }

    /// Those between a corner that moves and a neighbour that stays.
    fn add(&mut self, vertex: u16, onto: u16, star: &Star) {
        if star.is_too_large() || self.likely.len() > MOST_LIKELY || self.stars.len() > MOST_LIKELY {
            return;
        }
        for &[next, previous] in star.movers() {
            for &[other_next, other_previous] in star.stayers() {
                if next == other_previous {
                    self.likely.push([vertex, onto, next]);
                }
                if previous == other_next {
                    self.likely.push([vertex, previous, onto]);
                }
            }
        }
        self.stars.extend(star.movers().iter().map(|&sides| (sides, true)));
        self.stars.extend(star.stayers().iter().map(|&sides| (sides, false)));
        self.ends.push((vertex, onto, self.stars.len()));
    }

    /// All for so many new triangles, in order; those at open edges come last, and only if they are needed.
    fn all(&mut self, count: usize) -> &[[u16; 3]] {
        self.likely.sort_unstable();
        let between = self.likely.len();
        if between < count {
            self.add_open();
            self.likely[between..].sort_unstable();
        }
        &self.likely
    }

    /// Those at edges of one triangle.
    fn add_open(&mut self) {
        let mut start = 0;
        for &(vertex, onto, end) in &self.ends {
            let star = &self.stars[start..end];
            start = end;
            for &([next, previous], moves) in star {
                if star.iter().all(|(other, _)| other[1] != next) {
                    self.likely.push(beyond(moves, vertex, onto, next));
                }
                if star.iter().all(|(other, _)| other[0] != previous) {
                    self.likely.push(beyond(!moves, vertex, onto, previous));
                }
            }
        }
    }
}

/// The triangle of a new vertex, the one that it splits off, and a third; `after` tells whether the third comes last.
fn beyond(after: bool, vertex: u16, onto: u16, third: u16) -> [u16; 3] {
    if after { [vertex, onto, third] } else { [vertex, third, onto] }
}

/// Undoes the collapses of a tier, from the triangles of the next coarser one (none for the coarsest).
///
/// The caller has checked that vertices are at most 65,536, that `ecol` goes down from `locked` on, and that triangles of
/// the base name vertices below `first` only.
///
/// Gives the triangles, each with a zero after its vertices.
///
/// # Errors
/// What the teller says, and new triangles that name vertices which are not there yet or are more or fewer than stated.
pub(super) fn undo(
    base: impl Iterator<Item = [u16; 3]>,
    added: &Added<'_>,
    teller: &mut impl Teller,
) -> Result<Vec<[u16; 4]>, Contradiction> {
    let end = added.first as usize + added.ecol.len();
    let mut corners = Corners::new(base, added.triangles, end);
    let mut gaps = Gaps::default();
    let mut star = Star::EMPTY;
    let entries = added.ecol.iter().zip(added.bytes).zip(added.counts);
    for (vertex, ((&onto, &byte), &count)) in (added.first..).zip(entries) {
        if vertex >= added.locked {
            teller.begin(vertex);
            corners.split(vertex as u16, onto, &mut star, teller)?;
            gaps.add(vertex as u16, onto, &star);
        }
        if byte != CONTINUES {
            let likely = gaps.all(count as usize);
            bear(&mut corners, vertex, count, likely, added.triangles, teller)?;
            gaps.clear();
        }
    }
    if corners.triangles.len() == added.triangles {
        Ok(corners.triangles)
    } else {
        Err(Contradiction("its vertices add fewer triangles than its list has"))
    }
}

/// Adds the triangles that come with a group, whose last vertex this is.
fn bear(
    corners: &mut Corners,
    vertex: u32,
    count: u32,
    likely: &[[u16; 3]],
    most: usize,
    teller: &mut impl Teller,
) -> Result<(), Contradiction> {
    let mut next = 0;
    for _ in 0..count {
        let triangle = teller.triangle(likely, &mut next)?;
        if corners.triangles.len() >= most {
            return Err(Contradiction("its vertices add more triangles than its list has"));
        }
        if triangle.iter().any(|&corner| u32::from(corner) > vertex) {
            return Err(Contradiction("a new triangle names a vertex that is not there yet"));
        }
        corners.push(triangle);
    }
    Ok(())
}
