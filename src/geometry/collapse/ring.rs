//! The ring of one position: its triangles and neighbours, and the quadric that they make.
//!
//! [`Ring::collect`] walks the corners of a position once and measures everything that the cost and the guards need.

use glam::{BVec4A, Vec3, Vec4};

use super::drift::squared_distance;
use super::four::{self, Four, narrowed, squared_distances, widened};
use super::mesh::{CornerMesh, Face, Number, QUARTER, Witness};
use crate::geometry::quadric::{Planes, Quadric};

/// The weight of boundary planes against the surface's own, per squared edge length.
const BOUNDARY_WEIGHT: f32 = 1.0;
/// The same for creases, which the planes of both sides hold already where they are sharp.
const CREASE_WEIGHT: f32 = 0.2;
/// Two triangles fold when the sum of their outward directions is longer than this: a dihedral angle below 80 degrees.
const FOLD: f32 = 1.53;
/// The same as the cosine between their normals.
const FOLD_COS: f32 = 1.0 - 0.5 * FOLD * FOLD;
/// Any other number of triangles bounds a surface when theirs is longer than this.
const OPEN: f32 = 0.7;

/// No two triangles whose normals are so near to the mean, by the square of the cosine, fold: 49 degrees.
const FLAT_COS_SQUARED: f32 = 0.43;

/// A position in a local frame of unit size, and where it is in the ring that was collected last. It takes one load.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct Place {
    pub point: Vec3,
    mark: u32,
}

impl Place {
    pub fn new(point: Vec3) -> Self {
        Self { point, mark: 0 }
    }
}

/// A triangle of the ring, and which neighbours its other corners are.
#[derive(Debug, Clone, Copy)]
struct RingFace {
    face: Face,
    slots: [u32; 2],
}

impl RingFace {
    const NONE: Self =
        Self { face: Face { corner: 0, wedge: 0, wedges: [0; 2], positions: [0; 2] }, slots: [0; 2] };
}

/// What is measured of four triangles of the ring; `a` and `b` are their other corners relative to the position. The
/// last four repeat the last triangle if there are fewer.
#[derive(Debug, Clone, Copy)]
struct Measures {
    a: Four,
    b: Four,
    cross: Four,
    /// The length of `cross`, twice the area.
    twice: Vec4,
    /// The neighbours, by [`number_of`].
    slots: [Vec4; 2],
}

impl Measures {
    /// Which of the triangles go when the position goes onto this neighbour.
    #[inline(always)]
    fn dying(&self, slot: u32) -> BVec4A {
        four::equal(self.slots[0], number_of(slot)) | four::equal(self.slots[1], number_of(slot))
    }
}

/// A float for each number, so that numbers are compared four at a time; none is subnormal.
#[inline(always)]
fn number_of(slot: u32) -> f32 {
    f32::from_bits(slot + 0x0080_0000)
}

/// One neighbour of the position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// Relative to the position.
    wide_offset: Vec4,
    pub position: u32,
    /// Triangles on the edge.
    pub faces: u32,
    /// The first and last triangle on the edge: twice its number in the ring, and one more where the neighbour is its
    /// corner `b`.
    sides: [u32; 2],
}

/// What a walk around a position writes to.
struct Notes<'a> {
    places: &'a mut [Place],
    neighbours: &'a mut [Neighbour],
    count: u32,
    first_mark: u32,
    origin: Vec3,
}

impl Notes<'_> {
    /// Notes a corner of a triangle among the neighbours; returns its number there. Without a branch: every other corner
    /// is a new neighbour.
    #[inline(always)]
    fn note(&mut self, other: u32, side: u32) -> u32 {
        let place = &mut self.places[other as usize];
        // A mark of an earlier ring wraps round to a large number.
        let slot = place.mark.wrapping_sub(self.first_mark).min(self.count);
        place.mark = self.first_mark + slot;
        let is_new = u32::from(slot == self.count);
        self.count += is_new;
        let neighbour = &mut self.neighbours[slot as usize];
        // All ones if it has been noted before.
        let old = is_new.wrapping_sub(1);
        *neighbour = Neighbour {
            wide_offset: widened(place.point - self.origin),
            position: other,
            faces: (neighbour.faces & old) + 1,
            sides: [neighbour.sides[0] & old | side & !old, side],
        };
        slot
    }
}

impl Neighbour {
    const NONE: Self = Self { wide_offset: Vec4::ZERO, position: super::mesh::NONE, faces: 0, sides: [0; 2] };

    /// Relative to the position.
    #[inline(always)]
    pub fn offset(&self) -> Vec3 {
        narrowed(self.wide_offset)
    }
}

/// The ring, reused from position to position.
pub(super) struct Ring {
    pub places: Vec<Place>,
    /// What each wedge has of colour or material; empty where no wedge has any.
    tags: Vec<u32>,
    faces: Vec<RingFace>,
    measures: Vec<Measures>,
    /// The neighbours, and what earlier rings have left behind them.
    all_neighbours: Vec<Neighbour>,
    neighbour_count: usize,
    /// Marks from here on belong to the current ring.
    first_mark: u32,
    pub origin: Vec3,
    pub area: f32,
    /// The sum of the triangles' areas as vectors, twice.
    pub around: Vec3,
    pub quadric: Quadric,
    /// Whether edges with other than two triangles form a chain through the position: `Some(false)` if it has none,
    /// `Some(true)` along a boundary or a seam where sheets meet, `None` at a junction of such edges.
    pub chain: Option<bool>,
}

impl Ring {
    pub fn new(places: Vec<Place>, tags: Vec<u32>) -> Self {
        Self {
            places,
            tags,
            faces: Vec::new(),
            measures: Vec::new(),
            all_neighbours: Vec::new(),
            neighbour_count: 0,
            first_mark: 1,
            origin: Vec3::ZERO,
            area: 0.0,
            around: Vec3::ZERO,
            quadric: Quadric::default(),
            chain: Some(false),
        }
    }

    pub fn point(&self, position: u32) -> Vec3 {
        self.places[position as usize].point
    }

    /// Where a witness is.
    pub fn witness_point(&self, [a, b]: Witness) -> Vec3 {
        let share = if a & QUARTER == 0 { 0.5 } else { 0.25 };
        let a = self.point(a & !QUARTER);
        a + share * (self.point(b) - a)
    }

    /// The index of a position among the neighbours, if it is one.
    #[inline]
    pub fn slot(&self, position: u32) -> Option<usize> {
        let mark = self.places[position as usize].mark;
        (mark >= self.first_mark).then(|| (mark - self.first_mark) as usize)
    }

    /// The neighbours of the position.
    #[inline(always)]
    pub fn neighbours(&self) -> &[Neighbour] {
        &self.all_neighbours[..self.neighbour_count]
    }

    /// The triangles around the position.
    #[inline(always)]
    pub fn faces(&self) -> impl ExactSizeIterator<Item = &Face> + Clone {
        self.faces.iter().map(|f| &f.face)
    }

    /// One of them.
    pub fn face(&self, i: usize) -> Face {
        self.faces[i].face
    }

    /// The other corners of the `i`-th triangle, relative to the position.
    pub fn corners(&self, i: usize) -> [Vec3; 2] {
        self.faces[i].slots.map(|slot| self.all_neighbours[slot as usize].offset())
    }

    /// Walks around a position.
    pub fn collect(&mut self, mesh: &mut CornerMesh<impl Number>, position: u32) {
        self.begin(position);
        let most = 2 * mesh.listed(position);
        if self.all_neighbours.len() < most {
            self.all_neighbours.resize(most.next_power_of_two().max(4), Neighbour::NONE);
        }
        self.gather(mesh, position);
        self.measure();
        self.add_bounds();
    }

    #[inline(always)]
    fn gather(&mut self, mesh: &mut CornerMesh<impl Number>, position: u32) {
        // Triangles are far apart in memory: all are loaded before anything is done with one of them.
        self.faces.resize(mesh.listed(position), RingFace::NONE);
        let faces = self.faces.as_mut_slice();
        mesh.collect_faces(position, |kept, face| faces[kept].face = face);
        self.faces.truncate(mesh.listed(position));
        let mut notes = Notes {
            places: &mut self.places,
            neighbours: &mut self.all_neighbours,
            count: 0,
            first_mark: self.first_mark,
            origin: self.origin,
        };
        for (f, side) in self.faces.iter_mut().zip((0..).step_by(2)) {
            let [a, b] = f.face.positions;
            f.slots = [notes.note(a, side), notes.note(b, side + 1)];
        }
        self.neighbour_count = notes.count as usize;
    }

    fn begin(&mut self, position: u32) {
        self.first_mark += self.neighbour_count as u32;
        if self.first_mark > u32::MAX / 2 {
            self.places.iter_mut().for_each(|place| place.mark = 0);
            self.first_mark = 1;
        }
        self.measures.clear();
        self.neighbour_count = 0;
        self.chain = Some(false);
        self.origin = self.point(position);
    }

    /// Measures the triangles, four at a time.
    #[inline(always)]
    fn measure(&mut self) {
        let mut planes = Planes::default();
        let (mut area, mut around) = (Vec4::ZERO, Four::ZERO);
        let count = self.faces.len();
        if let Some(&last) = self.faces.last() {
            self.faces.resize(count.next_multiple_of(4), last);
        }
        let (groups, _) = self.faces.as_chunks::<4>();
        for (group, left) in groups.iter().zip((1..=count).rev().step_by(4)) {
            let slots = [0, 1, 2, 3].map(|i: usize| group[i].slots);
            let corner = |k: usize| Four::of(slots.map(|s| self.all_neighbours[s[k] as usize].wide_offset));
            let (a, b) = (corner(0), corner(1));
            let cross = a.cross(b);
            let twice_squared = cross.length_squared();
            let twice = twice_squared.sqrt();
            let numbers = |k: usize| Vec4::from_array(slots.map(|s| number_of(s[k])));
            self.measures.push(Measures { a, b, cross, twice, slots: [numbers(0), numbers(1)] });
            let real =
                Vec4::new(0.0, 1.0, 2.0, 3.0).cmplt(Vec4::splat(left as f32)) & twice.cmpgt(Vec4::ZERO);
            let weight = Vec4::select(real, 0.5 / twice, Vec4::ZERO);
            planes.add([cross.x, cross.y, cross.z], weight);
            area += Vec4::select(real, 0.5 * twice, Vec4::ZERO);
            around = around + cross * Vec4::select(real, Vec4::ONE, Vec4::ZERO);
        }
        self.faces.truncate(count);
        self.quadric = planes.sum();
        self.area = area.element_sum();
        self.around = around.sum();
    }

    /// Whether no two triangles fold, if those at each edge are wound alike: their normals are all near the mean.
    fn is_flat(&self) -> bool {
        let around = Four::splat(self.around);
        let limit = FLAT_COS_SQUARED * self.around.length_squared();
        self.measures.iter().all(|m| {
            let along = m.cross.dot(around);
            let near = (along * along).cmpge(limit * m.twice * m.twice);
            (near & along.cmpgt(Vec4::ZERO)).all()
        })
    }

    /// Whether two triangles meet at the edge, wound alike, which name one wedge at the position.
    #[inline(always)]
    fn is_plain(&self, neighbour: &Neighbour) -> bool {
        let [first, second] = neighbour.sides;
        let wedge = |side: u32| self.faces[side as usize / 2].face.wedge;
        neighbour.faces == 2 && (first ^ second) & 1 == 1 && wedge(first) == wedge(second)
    }

    /// The first and the last triangle on the edge to a neighbour.
    pub fn faces_at(&self, neighbour: &Neighbour) -> [usize; 2] {
        neighbour.sides.map(|side| side as usize / 2)
    }

    /// Adds the planes along the edges that bound the surface.
    fn add_bounds(&mut self) {
        if self.neighbours().iter().all(|neighbour| self.is_plain(neighbour)) && self.is_flat() {
            return;
        }
        let mut features = (0, 0);
        for slot in 0..self.neighbour_count {
            let neighbour = self.all_neighbours[slot];
            if neighbour.faces != 2 {
                self.chain = match features {
                    (0, _) => None,
                    (1, faces) if faces == neighbour.faces => Some(true),
                    _ => None,
                };
                features = (features.0 + 1, neighbour.faces);
            }
            if let Some((normal, weight)) = self.bounding_plane(&neighbour) {
                self.quadric.add_plane(normal, weight * neighbour.offset().length_squared());
            }
        }
    }

    fn cross(&self, face: usize) -> Vec3 {
        self.measures[face / 4].cross.lane(face % 4)
    }

    fn twice(&self, face: usize) -> f32 {
        self.measures[face / 4].twice[face % 4]
    }

    /// Whether the triangles on the edge to a neighbour name different wedges at the position, and whether these differ
    /// in colour or material.
    fn crease(&self, neighbour: &Neighbour) -> (bool, bool) {
        let wedge = |side: u32| self.faces[side as usize / 2].face.wedge;
        let [first, last] = neighbour.sides.map(wedge);
        if neighbour.faces > 2 {
            let mut others = self.faces().filter(|face| face.touches(neighbour.position));
            return (others.any(|face| face.wedge != first), false);
        }
        let tag = |wedge: u32| self.tags.get(wedge as usize);
        (first != last, first != last && tag(first) != tag(last))
    }

    /// Whether the two triangles on the edge to a neighbour turn back onto each other.
    fn folds(&self, neighbour: &Neighbour) -> bool {
        let [first, second] = neighbour.sides;
        let [f, g] = self.faces_at(neighbour);
        let cos = self.cross(f).dot(self.cross(g));
        // Triangles that are wound alike see the edge from different ends.
        let cos = if (first ^ second) & 1 == 0 { -cos } else { cos };
        cos < FOLD_COS * self.twice(f) * self.twice(g)
    }

    /// The plane that holds the edge where it bounds the surface, and its weight. The planes of the triangles
    /// themselves hold the surface only across, never along.
    fn bounding_plane(&self, neighbour: &Neighbour) -> Option<(Vec3, f32)> {
        let (crease, tint) = self.crease(neighbour);
        if neighbour.faces == 2 && !crease && !self.folds(neighbour) {
            return None;
        }
        if tint && neighbour.faces == 2 {
            // Seen as clearly as an open edge, however smoothly the surface goes on.
            return Some((self.outwards(neighbour.sides[0]), BOUNDARY_WEIGHT));
        }
        let conormal = self.conormal(neighbour);
        let length = conormal.length();
        let limit = if neighbour.faces == 2 { FOLD } else { OPEN };
        if length > limit {
            Some((conormal / length, BOUNDARY_WEIGHT))
        } else if crease && length > 0.0 {
            Some((conormal / length, CREASE_WEIGHT))
        } else {
            None
        }
    }

    /// The sum of the outward directions of an edge's triangles across it: nothing where a surface goes on smoothly,
    /// a unit vector at an open edge, two where a sheet folds back onto itself.
    fn conormal(&self, neighbour: &Neighbour) -> Vec3 {
        if neighbour.faces <= 2 {
            let sides = &neighbour.sides[..neighbour.faces as usize];
            return sides.iter().map(|&side| self.outwards(side)).sum();
        }
        let mut sum = Vec3::ZERO;
        for (side, position) in (0..).zip(self.faces().flat_map(|face| face.positions)) {
            if position == neighbour.position {
                sum += self.outwards(side);
            }
        }
        sum
    }

    /// The unit vector that leads out of a triangle across its edge from the position to `a` or to `b`.
    fn outwards(&self, side: u32) -> Vec3 {
        let face = side as usize / 2;
        let ([a, b], cross) = (self.corners(face), self.cross(face));
        let across = if side & 1 == 0 { a.cross(cross) } else { cross.cross(b) };
        across.normalize_or_zero()
    }

    /// The quadric at every neighbour, and `shortness` for the square of its distance; four at a time.
    pub fn costs(&self, shortness: f32, costs: &mut Vec<Vec4>) {
        costs.clear();
        // What earlier rings have left fills up the last four.
        let padded = &self.all_neighbours[..self.neighbour_count.next_multiple_of(4)];
        let (groups, _) = padded.as_chunks::<4>();
        costs.extend(groups.iter().map(|group| {
            let offsets = Four::of([0, 1, 2, 3].map(|i: usize| group[i].wide_offset));
            self.quadric.at_four([offsets.x, offsets.y, offsets.z]) + shortness * offsets.length_squared()
        }));
    }

    /// The squared distance from the position to the triangles that are left of the ring when it goes onto this
    /// neighbour.
    pub fn gap(&self, slot: u32) -> f32 {
        match self.nearest_left(slot, Vec3::ZERO, 0.0).0 {
            f32::INFINITY => self.all_neighbours[slot as usize].offset().length_squared(),
            nearest => nearest,
        }
    }

    /// Hands on the neighbours whose edge to the position has its middle farther (by the square) than `least` from the
    /// triangle beside it, or none beside it, when the position goes onto the neighbour `slot`.
    pub fn strayed(&self, slot: u32, least: f32, mut strays: impl FnMut(&Neighbour)) {
        let apex = Four::splat(self.all_neighbours[slot as usize].offset());
        let mut tell = |other: u32| {
            if other != slot {
                strays(&self.all_neighbours[other as usize]);
            }
        };
        for (m, group) in self.measures.iter().zip(self.faces.chunks(4)) {
            let distances = squared_distances(m.a * Vec4::splat(0.5), [apex, m.a, m.b]);
            let far = (m.dying(slot) | distances.cmpgt(Vec4::splat(least))).bitmask();
            if far != 0 {
                let far = group.iter().enumerate().filter(|(i, _)| far >> i & 1 == 1);
                let told =
                    far.filter(|(_, f)| !f.slots.contains(&slot) || !self.is_near(f.slots[0], slot, least));
                told.for_each(|(_, f)| tell(f.slots[0]));
            }
        }
        // Each other edge is the first side of one triangle.
        if self.chain != Some(false) {
            (0..).zip(self.neighbours()).filter(|(_, n)| n.faces != 2).for_each(|(other, _)| tell(other));
        }
    }

    /// Whether the middle of the edge to a neighbour is near the triangle whose second side that is, when the position
    /// goes onto the neighbour `slot`.
    fn is_near(&self, other: u32, slot: u32, least: f32) -> bool {
        let offset = |slot: u32| self.all_neighbours[slot as usize].offset();
        let beside = self.faces.iter().find(|f| f.slots[1] == other && f.slots[0] != slot);
        beside.is_some_and(|f| {
            let [a, b] = f.slots.map(offset);
            squared_distance(0.5 * b, [offset(slot), a, b]) <= least
        })
    }

    /// The triangle that is left nearest to a point, relative to the position, when the position goes onto the neighbour
    /// `slot`, and its squared distance; any that is no farther than `least`. None is left if that is infinite.
    #[inline(always)]
    pub fn nearest_left(&self, slot: u32, point: Vec3, least: f32) -> (f32, usize) {
        let apex = Four::splat(self.all_neighbours[slot as usize].offset());
        let corners = |m: &Measures| [apex, m.a, m.b];
        self.nearest(point, least, corners, |m| m.dying(slot))
    }

    /// The squared distance from a point, relative to the position, to the ring; any that is no more than `least`.
    pub fn distance_to(&self, point: Vec3, least: f32) -> f32 {
        self.nearest(point, least, |m| [Four::ZERO, m.a, m.b], |_| BVec4A::FALSE).0
    }

    #[inline(always)]
    fn nearest(
        &self,
        point: Vec3,
        least: f32,
        corners: impl Fn(&Measures) -> [Four; 3],
        skipped: impl Fn(&Measures) -> BVec4A,
    ) -> (f32, usize) {
        let point = Four::splat(point);
        let mut nearest = (f32::INFINITY, 0);
        for (m, first) in self.measures.iter().zip((0..).step_by(4)) {
            let distances = squared_distances(point, corners(m));
            let distances = Vec4::select(skipped(m), Vec4::INFINITY, distances);
            let own = distances.min_element();
            if own < nearest.0 {
                // What fills up the last four comes after what it repeats.
                let lane = four::equal(distances, own).bitmask().trailing_zeros() as usize;
                nearest = (own, first + lane);
                if own <= least {
                    break;
                }
            }
        }
        nearest
    }

    /// Notes the neighbours to which the new edge has its middle no farther (by the square) than `least` from the triangle
    /// beside the old one, when the position goes onto the neighbour `slot`; others may be as near.
    #[inline(always)]
    pub fn bends(&self, slot: u32, least: f32, near: &mut Vec<bool>) {
        near.clear();
        near.resize(self.neighbour_count, false);
        let apex = Four::splat(self.all_neighbours[slot as usize].offset());
        for (m, group) in self.measures.iter().zip(self.faces.chunks(4)) {
            let middle = (m.a + apex) * Vec4::splat(0.5);
            let distances = squared_distances(middle, [Four::ZERO, m.a, m.b]);
            let is_near = distances.cmple(Vec4::splat(least)).bitmask();
            for (lane, face) in group.iter().enumerate() {
                near[face.slots[0] as usize] |= is_near >> lane & 1 == 1;
            }
        }
    }

    /// Whether a triangle that is left would turn by more than the limit, or lose its area, if the position went onto
    /// this neighbour. A triangle without area takes the side of the ring, whose area as a vector is `around`.
    pub fn turns(&self, slot: u32, limit: f32) -> bool {
        let offset = Four::splat(self.all_neighbours[slot as usize].offset());
        let around = Four::splat(self.around);
        self.measures.iter().any(|m| {
            let after = m.cross - (m.a - m.b).cross(offset);
            let dot = m.cross.dot(after);
            let least = limit * limit * m.twice * m.twice * after.length_squared();
            let turns = dot.cmple(Vec4::ZERO) | (dot * dot).cmple(least);
            let opposes = after.dot(around).cmplt(Vec4::ZERO);
            let has_area = m.twice.cmpgt(Vec4::ZERO);
            (!m.dying(slot) & ((has_area & turns) | (!has_area & opposes))).any()
        })
    }

    /// Whether the ring has a triangle with these two other corners.
    pub fn has_face(&self, [a, b]: [u32; 2]) -> bool {
        self.faces().any(|face| face.touches(a) && face.touches(b))
    }
}
