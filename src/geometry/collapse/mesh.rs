//! The mesh while it is being collapsed: which positions and wedges the corners of each triangle name, and which
//! corners lie at each position.
//!
//! A corner is named `4 t + k`, corner `k` of triangle `t`. The corners of a position lie together in one array, so
//! that a walk around it needs no chain of loads. A collapse appends the corners of one position to those of another
//! and kills the triangles between; dead corners stay in the lists until the next walk of the evaluator drops them. A
//! list that is full moves to the end of the array, with room to grow by half.

use crate::geometry::weld::WeldedMesh;

pub(super) const NONE: u32 = u32::MAX;

/// A point of the surface as it was: the middle between two positions, which may be the same one, or with [`QUARTER`]
/// added to the first, a quarter of the way from it to the second.
pub(super) type Witness = [u32; 2];

/// See [`Witness`]; corners have numbers that fit, so positions are below it.
pub(super) const QUARTER: u32 = 1 << 30;

/// The dynamic mesh.
pub(super) struct CornerMesh {
    triangles: Vec<Triangle>,
    lists: Vec<List>,
    /// The corners of all positions, each list in one piece.
    corners: Vec<u32>,
    /// Where the wedges of each position start (never changes).
    wedge_start: Vec<u32>,
    /// How many live corners name each wedge; a wedge that none names has left the order or is about to.
    wedge_corners: Vec<u32>,
    /// How many triangles are alive.
    pub live_triangles: usize,
}

/// Half a cache line, so that what is known of a triangle takes one load.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct Triangle {
    /// The positions of the corners, the first of them [`NONE`] in a dead triangle, and one end of the witness
    /// (`drift.rs`).
    positions: [u32; 4],
    /// The wedges of the corners, and the other end of the witness.
    wedges: [u32; 4],
}

impl Triangle {
    fn is_alive(&self) -> bool {
        self.positions[0] != NONE
    }

    /// The triangle seen from a corner of it.
    #[inline(always)]
    fn seen_from(&self, corner: u32) -> Face {
        let i = (corner & 3) as usize;
        let (j, k) = (after(i), after(after(i)));
        let (positions, wedges) = (&self.positions, &self.wedges);
        Face {
            corner,
            wedge: wedges[i],
            wedges: [wedges[j], wedges[k]],
            positions: [positions[j], positions[k]],
        }
    }
}

/// The corner after `k`, for `k` below 3; without a branch, since no processor guesses `k`.
#[inline(always)]
fn after(k: usize) -> usize {
    0b00_10_01 >> (2 * k) & 3
}

/// The corners of one position: `corners[start..start + len]`, dead ones among them, and room for some more.
#[derive(Clone, Copy, Default)]
struct List {
    start: u32,
    len: u32,
    room: u32,
    /// How many of them are alive.
    live: u32,
}

impl List {
    fn range(self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.len) as usize
    }
}

/// A live triangle seen from one of its corners: the corner, and the wedges and positions of the other two in turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub corner: u32,
    pub wedge: u32,
    pub wedges: [u32; 2],
    pub positions: [u32; 2],
}

impl Face {
    pub fn triangle(self) -> u32 {
        self.corner >> 2
    }

    /// Whether one of the other two corners is at this position.
    pub fn touches(self, position: u32) -> bool {
        self.positions[0] == position || self.positions[1] == position
    }
}

impl CornerMesh {
    pub fn new(mesh: &WeldedMesh) -> Self {
        let triangles: Vec<Triangle> = mesh
            .triangles
            .iter()
            .map(|&[u, v, w]| {
                let [p, q, r] = mesh.corner_positions([u, v, w]);
                Triangle { positions: [p, q, r, NONE], wedges: [u, v, w, NONE] }
            })
            .collect();
        let mut wedge_corners = vec![0; mesh.wedges.len()];
        for &wedge in mesh.triangles.iter().flatten() {
            wedge_corners[wedge as usize] += 1;
        }
        let mut lists = lists_for(&triangles, mesh.positions.len());
        let mut corners = vec![0; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for (k, &position) in triangle.positions[..3].iter().enumerate() {
                let list = &mut lists[position as usize];
                corners[(list.start + list.len) as usize] = 4 * t as u32 + k as u32;
                list.len += 1;
            }
        }
        Self {
            live_triangles: triangles.len(),
            wedge_start: mesh.wedge_starts(),
            triangles,
            lists,
            corners,
            wedge_corners,
        }
    }

    pub fn position_count(&self) -> usize {
        self.lists.len()
    }

    /// How many live triangles meet at a position.
    pub fn valence(&self, position: u32) -> u32 {
        self.lists[position as usize].live
    }

    /// How many corners the list of a position has, dead ones among them.
    pub fn listed(&self, position: u32) -> usize {
        self.lists[position as usize].len as usize
    }

    fn face(&self, corner: u32) -> Option<Face> {
        let triangle = &self.triangles[(corner >> 2) as usize];
        triangle.is_alive().then(|| triangle.seen_from(corner))
    }

    /// Drops the dead from a list of triangles.
    pub fn drop_dead(&self, triangles: &mut Vec<u32>) {
        triangles.retain(|&triangle| self.triangles[triangle as usize].is_alive());
    }

    /// The positions of a live triangle's corners.
    pub fn positions_of(&self, triangle: u32) -> [u32; 3] {
        let [a, b, c, _] = self.triangles[triangle as usize].positions;
        [a, b, c]
    }

    /// The wedges of a triangle's corners, those that it had last if it is dead.
    pub fn wedges(&self, triangle: u32) -> [u32; 3] {
        let [a, b, c, _] = self.triangles[triangle as usize].wedges;
        [a, b, c]
    }

    /// The witness of a triangle, if it has one.
    pub fn witness(&self, triangle: u32) -> Option<Witness> {
        let Triangle { positions, wedges } = &self.triangles[triangle as usize];
        (positions[3] != NONE).then_some([positions[3], wedges[3]])
    }

    /// Gives a triangle a witness, or none.
    pub fn set_witness(&mut self, triangle: u32, witness: Option<Witness>) {
        let Triangle { positions, wedges } = &mut self.triangles[triangle as usize];
        [positions[3], wedges[3]] = witness.unwrap_or([NONE; 2]);
    }

    /// The live triangles around a position.
    pub fn faces(&self, position: u32) -> impl Iterator<Item = Face> + '_ {
        let list = self.lists[position as usize];
        self.corners[list.range()].iter().filter_map(|&corner| self.face(corner))
    }

    /// Hands the triangles around a position to `take`, each with its number among the live ones, and drops its dead
    /// corners; a dead triangle has the number of the next, or how many are alive. Nothing here depends on which are
    /// dead but these numbers: no processor guesses that, and triangles are far apart in memory.
    #[inline(always)]
    pub fn collect_faces(&mut self, position: u32, mut take: impl FnMut(usize, Face)) {
        let list = &mut self.lists[position as usize];
        let corners = &mut self.corners[list.range()];
        let triangles = self.triangles.as_slice();
        let mut kept = 0;
        for i in 0..corners.len() {
            let corner = corners[i];
            let triangle = &triangles[(corner >> 2) as usize];
            take(kept, triangle.seen_from(corner));
            corners[kept] = corner;
            kept += usize::from(triangle.is_alive());
        }
        list.len = kept as u32;
    }

    /// Kills a triangle; returns the wedges of its corners.
    pub fn kill(&mut self, triangle: u32) -> [u32; 3] {
        let Triangle { positions, wedges } = self.triangles[triangle as usize];
        self.triangles[triangle as usize].positions[0] = NONE;
        self.live_triangles -= 1;
        for k in 0..3 {
            self.lists[positions[k] as usize].live -= 1;
            self.wedge_corners[wedges[k] as usize] -= 1;
        }
        [wedges[0], wedges[1], wedges[2]]
    }

    /// Points a live corner, whose position's list is about to be dropped, at a wedge of another position.
    pub fn repoint(&mut self, corner: u32, wedge: u32, position: u32) {
        let triangle = &mut self.triangles[(corner >> 2) as usize];
        let k = (corner & 3) as usize;
        self.wedge_corners[triangle.wedges[k] as usize] -= 1;
        self.wedge_corners[wedge as usize] += 1;
        triangle.wedges[k] = wedge;
        triangle.positions[k] = position;
        self.push(position, corner);
    }

    fn push(&mut self, position: u32, corner: u32) {
        if self.lists[position as usize].len == self.lists[position as usize].room {
            self.make_room(position);
        }
        let list = &mut self.lists[position as usize];
        self.corners[(list.start + list.len) as usize] = corner;
        list.len += 1;
        list.live += 1;
    }

    /// Drops dead corners, and moves a list that is still more than two thirds full to where it has room.
    fn make_room(&mut self, position: u32) {
        self.collect_faces(position, |_, _| {});
        let list = self.lists[position as usize];
        if list.len * 3 <= list.room * 2 && list.room > 3 {
            return;
        }
        let room = list.len + list.len / 2 + 4;
        let start = self.corners.len() as u32;
        self.corners.extend_from_within(list.range());
        self.corners.resize((start + room) as usize, NONE);
        self.lists[position as usize] = List { start, room, ..list };
    }

    /// Drops the list of a position that has no live corner left.
    pub fn drop_list(&mut self, position: u32) {
        self.lists[position as usize] = List::default();
    }

    /// All wedges of a position, alive or not.
    pub fn wedges_of(&self, position: u32) -> std::ops::Range<u32> {
        self.wedge_start[position as usize]..self.wedge_start[position as usize + 1]
    }

    /// Whether a live corner names the wedge.
    pub fn is_named(&self, wedge: u32) -> bool {
        self.wedge_corners[wedge as usize] > 0
    }

    /// The wedges of a position that a live corner names.
    pub fn live_wedges(&self, position: u32) -> impl Iterator<Item = u32> + '_ {
        self.wedges_of(position).filter(|&wedge| self.is_named(wedge))
    }
}

/// Empty lists, one after another, each with room for all corners of its position.
fn lists_for(triangles: &[Triangle], positions: usize) -> Vec<List> {
    let mut lists = vec![List::default(); positions];
    for position in triangles.iter().flat_map(|triangle| &triangle.positions[..3]) {
        lists[*position as usize].room += 1;
    }
    let mut start = 0;
    for list in &mut lists {
        list.start = start;
        list.live = list.room;
        start += list.room;
    }
    lists
}
