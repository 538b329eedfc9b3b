//! The mesh while it is being collapsed: which positions and wedges the corners of each triangle name, and which
//! corners lie at each position.
//!
//! A corner is named `4 t + k`, corner `k` of triangle `t`. The corners of a position lie together in one array, so
//! that a walk around it needs no chain of loads. A collapse appends the corners of one position to those of another
//! and kills the triangles between; dead corners stay in the lists until the next walk of the evaluator drops them. A
//! list that is full moves to the end of the array, with room to grow by half. When there is no room at the end any more,
//! all lists move together: what lists have left behind is never more than a share of the array.

use crate::geometry::weld::WeldedMesh;

pub(super) const NONE: u32 = u32::MAX;

/// A point of the surface as it was: the middle between two positions, which may be the same one, or with [`QUARTER`]
/// added to the first, a quarter of the way from it to the second.
pub(super) type Witness = [u32; 2];

/// See [`Witness`]; corners have numbers that fit, so positions are below it.
pub(super) const QUARTER: u32 = 1 << 30;

/// What a mesh keeps the numbers of its positions and wedges in: 16 bits where they fit, as in every cell, so that twice
/// as many triangles lie in a cache.
pub(super) trait Number: Copy + Eq {
    /// Of a number that fits.
    fn of(number: u32) -> Self;

    /// The number.
    fn get(self) -> u32;
}

impl Number for u16 {
    #[inline(always)]
    fn of(number: u32) -> Self {
        debug_assert!(number <= u32::from(u16::MAX), "{number} takes more than 16 bits");
        number as u16
    }

    #[inline(always)]
    fn get(self) -> u32 {
        u32::from(self)
    }
}

impl Number for u32 {
    #[inline(always)]
    fn of(number: u32) -> Self {
        number
    }

    #[inline(always)]
    fn get(self) -> u32 {
        self
    }
}

/// The array of corners begins with room for one more of so many, so that lists may move to its end.
const SPARE: usize = 4;
/// And for so many more, so that the lists of a small part never have to move together; in tests they shall.
const LEAST_SPARE: usize = if cfg!(test) { 64 } else { 1 << 14 };
/// A position with more triangles than this is a hub: nothing that is done beside it may look at all of it, and its list is
/// moved seldom.
pub(super) const HUB: u32 = 64;

/// The dynamic mesh.
pub(super) struct CornerMesh<N> {
    triangles: Vec<Triangle<N>>,
    /// Of each triangle, what its witness is.
    witnesses: Vec<WitnessKind>,
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

/// What a walk asks of a triangle takes one load: 16 bytes where numbers have 16 bits.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct Triangle<N> {
    /// The positions of the corners; in a dead triangle the first two are the same.
    positions: [N; 3],
    /// The wedges of the corners.
    wedges: [N; 3],
    /// What the witness lies between (`drift.rs`), if there is one.
    between: [N; 2],
}

/// Whether a triangle has a witness, and which point between its two positions it is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WitnessKind {
    None,
    Middle,
    Quarter,
}

impl<N: Number> Triangle<N> {
    #[inline(always)]
    fn is_alive(&self) -> bool {
        self.positions[0] != self.positions[1]
    }

    /// The triangle seen from a corner of it.
    #[inline(always)]
    fn seen_from(&self, corner: u32) -> Face {
        let i = (corner & 3) as usize;
        let (j, k) = (after(i), after(after(i)));
        let (positions, wedges) = (&self.positions, &self.wedges);
        Face {
            corner,
            wedge: wedges[i].get(),
            wedges: [wedges[j].get(), wedges[k].get()],
            positions: [positions[j].get(), positions[k].get()],
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

impl<N: Number> CornerMesh<N> {
    pub fn new(mesh: &WeldedMesh) -> Self {
        let triangle = |wedges: &[u32; 3]| Triangle {
            positions: mesh.corner_positions(*wedges).map(N::of),
            wedges: wedges.map(N::of),
            between: [N::of(0); 2],
        };
        let triangles: Vec<Triangle<N>> = mesh.triangles.iter().map(triangle).collect();
        let mut wedge_corners = vec![0; mesh.wedges.len()];
        for &wedge in mesh.triangles.iter().flatten() {
            wedge_corners[wedge as usize] += 1;
        }
        let mut lists = lists_for(&triangles, mesh.positions.len());
        let count = 3 * triangles.len();
        let mut corners = Vec::with_capacity(count + count / SPARE + LEAST_SPARE);
        corners.resize(count, NONE);
        for (t, triangle) in triangles.iter().enumerate() {
            for (k, &position) in triangle.positions.iter().enumerate() {
                let list = &mut lists[position.get() as usize];
                corners[(list.start + list.len) as usize] = 4 * t as u32 + k as u32;
                list.len += 1;
            }
        }
        Self {
            live_triangles: triangles.len(),
            witnesses: vec![WitnessKind::None; triangles.len()],
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

    /// Whether a triangle has not been killed.
    pub fn is_alive(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize].is_alive()
    }

    /// The positions of a live triangle's corners.
    pub fn positions_of(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize].positions.map(N::get)
    }

    /// The wedges of a triangle's corners, those that it had last if it is dead.
    pub fn wedges(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize].wedges.map(N::get)
    }

    /// The witness of a triangle, if it has one.
    pub fn witness(&self, triangle: u32) -> Option<Witness> {
        let [a, b] = self.triangles[triangle as usize].between.map(N::get);
        match self.witnesses[triangle as usize] {
            WitnessKind::None => None,
            WitnessKind::Middle => Some([a, b]),
            WitnessKind::Quarter => Some([a | QUARTER, b]),
        }
    }

    /// Gives a triangle a witness, or none.
    pub fn set_witness(&mut self, triangle: u32, witness: Option<Witness>) {
        let Some([a, b]) = witness else {
            self.witnesses[triangle as usize] = WitnessKind::None;
            return;
        };
        self.triangles[triangle as usize].between = [a & !QUARTER, b].map(N::of);
        self.witnesses[triangle as usize] =
            if a & QUARTER == 0 { WitnessKind::Middle } else { WitnessKind::Quarter };
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
        let wedges = self.wedges(triangle);
        for position in self.positions_of(triangle) {
            self.lists[position as usize].live -= 1;
        }
        for wedge in wedges {
            self.wedge_corners[wedge as usize] -= 1;
        }
        let positions = &mut self.triangles[triangle as usize].positions;
        positions[0] = positions[1];
        self.live_triangles -= 1;
        wedges
    }

    /// Points a live corner, whose position's list is about to be dropped, at a wedge of another position.
    pub fn repoint(&mut self, corner: u32, wedge: u32, position: u32) {
        let triangle = &mut self.triangles[(corner >> 2) as usize];
        let k = (corner & 3) as usize;
        self.wedge_corners[triangle.wedges[k].get() as usize] -= 1;
        self.wedge_corners[wedge as usize] += 1;
        triangle.wedges[k] = N::of(wedge);
        triangle.positions[k] = N::of(position);
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
        if self.corners.capacity() - self.corners.len() < room as usize {
            self.move_together(room as usize);
        }
        let list = self.lists[position as usize];
        let start = self.corners.len() as u32;
        self.corners.extend_from_within(list.range());
        self.corners.resize((start + room) as usize, NONE);
        self.lists[position as usize] = List { start, room, ..list };
    }

    /// Moves all lists to the front of their array and leaves `room` and a share of the array at its end. Only hubs
    /// keep their room to grow: their lists would move again and again. What dead corners took is given back.
    fn move_together(&mut self, room: usize) {
        let used = |&position: &u32| self.lists[position as usize].room > 0;
        let mut positions: Vec<u32> = (0..self.lists.len() as u32).filter(used).collect();
        positions.sort_unstable_by_key(|&position| self.lists[position as usize].start);
        let mut end = 0;
        for position in positions {
            self.collect_faces(position, |_, _| {});
            let list = self.lists[position as usize];
            self.corners.copy_within(list.range(), end);
            let room = if list.len > HUB { list.room.min(list.len + list.len / 2) } else { list.len };
            let moved = List { start: end as u32, room, ..list };
            // An empty list lies nowhere: the array may end before where it was.
            self.lists[position as usize] = if list.len > 0 { moved } else { List::default() };
            end += room as usize;
        }
        self.corners.truncate(end);
        // A quarter at least, and of what the array has already as much again: the more, the fewer such moves.
        self.corners.shrink_to(2 * end + room);
        self.corners.reserve_exact(room + end / SPARE);
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
fn lists_for<N: Number>(triangles: &[Triangle<N>], positions: usize) -> Vec<List> {
    let mut lists = vec![List::default(); positions];
    for position in triangles.iter().flat_map(|triangle| &triangle.positions) {
        lists[position.get() as usize].room += 1;
    }
    let mut start = 0;
    for list in &mut lists {
        // An empty list lies nowhere: the array may shrink.
        if list.room == 0 {
            continue;
        }
        list.start = start;
        list.live = list.room;
        start += list.room;
    }
    lists
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::record::VertexRecord;

    const POSITIONS: u32 = 40;

    fn mesh_of(triangles: Vec<[u32; 3]>) -> WeldedMesh {
        WeldedMesh {
            positions: (0..POSITIONS).map(|i| [i, i * i, 0]).collect(),
            wedge_position: (0..POSITIONS).collect(),
            wedges: vec![VertexRecord::default(); POSITIONS as usize],
            triangles,
            ..WeldedMesh::default()
        }
    }

    /// Moves all corners of a position to another one, and kills the triangles between.
    fn collapse<N: Number>(mesh: &mut CornerMesh<N>, position: u32, target: u32) {
        let faces: Vec<Face> = mesh.faces(position).collect();
        for face in faces {
            if face.touches(target) {
                mesh.kill(face.triangle());
            } else {
                mesh.repoint(face.corner, target, target);
            }
        }
        mesh.drop_list(position);
    }

    /// The same for plain triangles.
    fn collapse_plainly(triangles: &mut [Option<[u32; 3]>], position: u32, target: u32) {
        for triangle in triangles.iter_mut() {
            let moved = triangle.map(|corners| corners.map(|c| if c == position { target } else { c }));
            *triangle = moved.filter(|&[a, b, c]| a != b && b != c && c != a);
        }
    }

    fn lists_are_right<N: Number>(mesh: &CornerMesh<N>, triangles: &[Option<[u32; 3]>]) {
        for position in 0..POSITIONS {
            let at = |corners: &[u32; 3]| corners.contains(&position);
            let expected: Vec<u32> =
                (0u32..).zip(triangles).filter(|(_, t)| t.is_some_and(|t| at(&t))).map(|(i, _)| i).collect();
            let mut found: Vec<u32> = mesh.faces(position).map(Face::triangle).collect();
            found.sort_unstable();
            assert_eq!(found, expected);
            assert_eq!(mesh.valence(position) as usize, expected.len());
        }
        let left = triangles.iter().flatten().count();
        assert_eq!(mesh.live_triangles, left);
        assert!(mesh.corners.capacity() <= 15 * left + 15 * triangles.len() / 4 + 2 * LEAST_SPARE);
    }

    fn collapses_as_plain_triangles_do<N: Number>(triangles: &[[u32; 3]], steps: &[(u32, u32)]) {
        let mut mesh = CornerMesh::<N>::new(&mesh_of(triangles.to_vec()));
        let mut plain: Vec<Option<[u32; 3]>> = triangles.iter().copied().map(Some).collect();
        for &(position, target) in steps {
            if position != target {
                collapse(&mut mesh, position, target);
                collapse_plainly(&mut plain, position, target);
            }
            lists_are_right(&mesh, &plain);
        }
    }

    #[test]
    fn a_position_that_lost_its_triangles_has_none_after_the_array_has_shrunk() {
        let strip: Vec<[u32; 3]> = (2..POSITIONS).map(|i| [i - 2, i - 1, i]).collect();
        let mut mesh = CornerMesh::<u16>::new(&mesh_of(strip.clone()));
        for triangle in (0..strip.len() as u32).rev() {
            mesh.kill(triangle);
            mesh.move_together(0);
            assert!(
                (0..POSITIONS)
                    .all(|position| mesh.faces(position).count() == mesh.valence(position) as usize)
            );
        }
    }

    #[test]
    fn a_hub_keeps_room_to_grow_when_lists_move_together() {
        let fan: Vec<[u32; 3]> = (0..400).map(|i| [0, 1 + i % 38, 2 + i % 38]).collect();
        let mut mesh = CornerMesh::<u16>::new(&mesh_of(fan));
        mesh.make_room(0);
        mesh.move_together(0);
        let hub = mesh.lists[0];
        assert_eq!((hub.len, hub.room), (400, 600));
        assert!(mesh.lists[1..].iter().all(|list| list.room == list.len));
    }

    proptest! {
        #[test]
        fn lists_hold_what_plain_triangles_say(
            corners in prop::collection::vec((0..POSITIONS, 1..5u32, 1..5u32), 1..300),
            steps in prop::collection::vec((0..POSITIONS, 0..POSITIONS), 0..100),
        ) {
            let all = corners.into_iter().map(|(a, b, c)| [a, (a + b) % POSITIONS, (a + c) % POSITIONS]);
            let triangles: Vec<[u32; 3]> = all.filter(|t| t[1] != t[2]).collect();
            collapses_as_plain_triangles_do::<u16>(&triangles, &steps);
            collapses_as_plain_triangles_do::<u32>(&triangles, &steps);
        }

        #[test]
        fn a_witness_is_given_back_as_it_was(a in 0u32..0x10000, b in 0u32..0x10000, quarter in prop::bool::ANY) {
            let mut mesh = CornerMesh::<u16>::new(&mesh_of(vec![[0, 1, 2]]));
            prop_assert_eq!(mesh.witness(0), None);
            let witness = Some([if quarter { a | QUARTER } else { a }, b]);
            mesh.set_witness(0, witness);
            prop_assert_eq!(mesh.witness(0), witness);
            mesh.set_witness(0, None);
            prop_assert_eq!(mesh.witness(0), None);
        }
    }
}
