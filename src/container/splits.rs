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

/// A corner of the vertex that is split: its number `4 t + c`, and the other two vertices of its triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct StarCorner {
    pub corner: u32,
    pub next: u16,
    pub previous: u16,
    /// Whether the new vertex takes it over.
    pub moves: bool,
}

/// Who knows what each vertex brings back.
pub(super) trait Teller {
    /// Sets which corners the new vertex takes over.
    fn moves(&mut self, vertex: u32, star: &mut [StarCorner]) -> Result<(), Contradiction>;
    /// The next new triangle; `likely` are the ones that would close a gap, the likelier first, `next` the one after the
    /// last that was taken.
    fn triangle(&mut self, likely: &[[u16; 3]], next: &mut usize) -> Result<[u16; 3], Contradiction>;
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
    triangles: Vec<[u16; 3]>,
    first: Vec<u32>,
    following: Vec<u32>,
}

impl Corners {
    /// The corners of so many triangles, the base first.
    fn new(base: impl Iterator<Item = [u16; 3]>, triangles: usize, vertices: usize) -> Self {
        let mut corners = Self {
            triangles: Vec::with_capacity(triangles),
            first: vec![END; vertices],
            following: Vec::with_capacity(4 * triangles),
        };
        base.for_each(|triangle| corners.push(triangle));
        corners
    }

    /// Adds a triangle; its vertices are below the number of vertices.
    fn push(&mut self, triangle: [u16; 3]) {
        let corners = (4 * self.triangles.len() as u32..).zip(triangle);
        let following =
            corners.map(|(corner, vertex)| std::mem::replace(&mut self.first[usize::from(vertex)], corner));
        self.following.extend(following.chain([END]));
        self.triangles.push(triangle);
    }

    /// Lists the corners at a vertex, the newest first.
    fn star(&self, vertex: u16, star: &mut Vec<StarCorner>) {
        star.clear();
        let mut corner = self.first[usize::from(vertex)];
        while corner != END {
            let triangle = &self.triangles[corner as usize / 4];
            let [next, previous] = match corner % 4 {
                0 => [triangle[1], triangle[2]],
                1 => [triangle[2], triangle[0]],
                _ => [triangle[0], triangle[1]],
            };
            star.push(StarCorner { corner, next, previous, moves: false });
            corner = self.following[corner as usize];
        }
    }

    /// Hands the corners that move to the new vertex; both lists keep their order.
    fn split(&mut self, vertex: u16, onto: u16, star: &[StarCorner]) {
        let mut ends = [END; 2];
        for corner in star.iter().rev() {
            let end = &mut ends[usize::from(corner.moves)];
            self.following[corner.corner as usize] = *end;
            *end = corner.corner;
            if corner.moves {
                self.triangles[corner.corner as usize / 4][corner.corner as usize % 4 % 3] = vertex;
            }
        }
        [self.first[usize::from(onto)], self.first[usize::from(vertex)]] = ends;
    }
}

/// The triangles that would close the gaps which the splits of a group leave.
#[derive(Default)]
struct Gaps {
    likely: Vec<[u16; 3]>,
    /// The corners at what was split, one vertex after another, ...
    stars: Vec<StarCorner>,
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
    fn add(&mut self, vertex: u16, onto: u16, star: &[StarCorner]) {
        if star.len() > MOST_MATCHED || self.likely.len() > MOST_LIKELY || self.stars.len() > MOST_LIKELY {
            return;
        }
        let (mut movers, mut stayers) = ([[0; 2]; MOST_MATCHED], [[0; 2]; MOST_MATCHED]);
        let mut moving = 0;
        for (place, corner) in star.iter().enumerate() {
            // Both are written and one is counted, which costs less than a branch that nobody can foretell.
            movers[moving] = [corner.next, corner.previous];
            stayers[place - moving] = [corner.next, corner.previous];
            moving += usize::from(corner.moves);
        }
        for [next, previous] in &movers[..moving] {
            for [other_next, other_previous] in &stayers[..star.len() - moving] {
                if next == other_previous {
                    self.likely.push([vertex, onto, *next]);
                }
                if previous == other_next {
                    self.likely.push([vertex, *previous, onto]);
                }
            }
        }
        self.stars.extend_from_slice(star);
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
            for corner in star {
                if star.iter().all(|other| other.previous != corner.next) {
                    self.likely.push(beyond(corner.moves, vertex, onto, corner.next));
                }
                if star.iter().all(|other| other.next != corner.previous) {
                    self.likely.push(beyond(!corner.moves, vertex, onto, corner.previous));
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
/// # Errors
/// What the teller says, and new triangles that name vertices which are not there yet or are more or fewer than stated.
pub(super) fn undo(
    base: impl Iterator<Item = [u16; 3]>,
    added: &Added<'_>,
    teller: &mut impl Teller,
) -> Result<Vec<[u16; 3]>, Contradiction> {
    let end = added.first as usize + added.ecol.len();
    let mut corners = Corners::new(base, added.triangles, end);
    let mut gaps = Gaps::default();
    let mut star = Vec::new();
    let entries = added.ecol.iter().zip(added.bytes).zip(added.counts);
    for (vertex, ((&onto, &byte), &count)) in (added.first..).zip(entries) {
        if vertex >= added.locked {
            corners.star(onto, &mut star);
            teller.moves(vertex, &mut star)?;
            gaps.add(vertex as u16, onto, &star);
            corners.split(vertex as u16, onto, &star);
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
