//! The ring of one position: its triangles and neighbours, and the quadric that they make.
//!
//! [`Ring::collect`] walks the corners of a position once and measures everything that the cost and the guards need.

use glam::Vec3;

use super::mesh::{CornerMesh, Face};
use crate::geometry::quadric::Quadric;

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

/// A position in a local frame of unit size, and where it is in the ring that was collected last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub point: Vec3,
    mark: u32,
    /// How often its triangles have changed.
    version: u32,
}

impl Place {
    pub fn new(point: Vec3) -> Self {
        Self { point, mark: 0, version: 0 }
    }
}

/// A triangle of the ring; `a` and `b` are its other corners relative to the position.
#[derive(Debug, Clone, Copy)]
pub(super) struct RingFace {
    pub face: Face,
    pub a: Vec3,
    pub b: Vec3,
    pub cross: Vec3,
    /// The length of `cross`, twice the area.
    pub twice: f32,
}

/// One neighbour of the position.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    pub position: u32,
    /// Relative to the position.
    pub offset: Vec3,
    /// Triangles on the edge.
    pub faces: u32,
    /// Whether they name different wedges at the position.
    pub crease: bool,
    /// The target for which this was last found to lie across a triangle on the edge to it.
    pub across: u32,
    /// Whether these differ in colour or material.
    tint: bool,
    /// The wedge that the first of them names.
    wedge: u32,
    /// The first and last triangle on the edge: twice its number in the ring, and one more where the neighbour is its
    /// corner `b`.
    sides: [u32; 2],
}

/// The ring, reused from position to position.
pub(super) struct Ring {
    pub places: Vec<Place>,
    /// What each wedge has of colour or material; empty where no wedge has any.
    tags: Vec<u32>,
    pub faces: Vec<RingFace>,
    pub neighbours: Vec<Neighbour>,
    /// Marks from here on belong to the current ring.
    first_mark: u32,
    pub origin: Vec3,
    pub area: f32,
    /// The sum of the triangles' areas as vectors, twice.
    pub around: Vec3,
    pub quadric: Quadric,
    /// Changes with every change of the triangles at the position or at a neighbour: the version of the position, and
    /// the sum of the neighbours'.
    pub stamp: (u32, u32),
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
            neighbours: Vec::new(),
            first_mark: 1,
            origin: Vec3::ZERO,
            area: 0.0,
            around: Vec3::ZERO,
            quadric: Quadric::default(),
            stamp: (0, 0),
            chain: Some(false),
        }
    }

    pub fn point(&self, position: u32) -> Vec3 {
        self.places[position as usize].point
    }

    /// The index of a position among the neighbours, if it is one.
    #[inline]
    pub fn slot(&self, position: u32) -> Option<usize> {
        let mark = self.places[position as usize].mark;
        (mark >= self.first_mark).then(|| (mark - self.first_mark) as usize)
    }

    /// Walks around a position.
    pub fn collect(&mut self, mesh: &mut CornerMesh, position: u32) {
        self.begin(position);
        mesh.collect_faces(position, |face| self.add_face(face));
        self.add_bounds();
    }

    #[inline(always)]
    fn add_face(&mut self, face: Face) {
        let side = 2 * self.faces.len() as u32;
        let a = self.note(face.positions[0], face.wedge, side);
        let b = self.note(face.positions[1], face.wedge, side + 1);
        let cross = a.cross(b);
        let twice = cross.length();
        if twice > 0.0 {
            self.quadric.add_plane(cross, 0.5 / twice);
            self.area += 0.5 * twice;
            self.around += cross;
        }
        self.faces.push(RingFace { face, a, b, cross, twice });
    }

    /// Notes a corner of a triangle among the neighbours; returns where it is, relative to the position.
    #[inline(always)]
    fn note(&mut self, other: u32, wedge: u32, side: u32) -> Vec3 {
        let place = &mut self.places[other as usize];
        if place.mark >= self.first_mark {
            let neighbour = &mut self.neighbours[(place.mark - self.first_mark) as usize];
            neighbour.faces += 1;
            if neighbour.wedge != wedge {
                neighbour.crease = true;
                let tag = |wedge: u32| self.tags.get(wedge as usize);
                neighbour.tint |= tag(neighbour.wedge) != tag(wedge);
            }
            neighbour.sides[1] = side;
            return neighbour.offset;
        }
        place.mark = self.first_mark + self.neighbours.len() as u32;
        let offset = place.point - self.origin;
        self.stamp.1 = self.stamp.1.wrapping_add(place.version);
        self.neighbours.push(Neighbour {
            position: other,
            offset,
            faces: 1,
            crease: false,
            tint: false,
            across: super::mesh::NONE,
            wedge,
            sides: [side; 2],
        });
        offset
    }

    fn begin(&mut self, position: u32) {
        self.first_mark += self.neighbours.len() as u32;
        if self.first_mark > u32::MAX / 2 {
            self.places.iter_mut().for_each(|place| place.mark = 0);
            self.first_mark = 1;
        }
        self.faces.clear();
        self.neighbours.clear();
        self.area = 0.0;
        self.around = Vec3::ZERO;
        self.quadric = Quadric::default();
        self.chain = Some(false);
        self.origin = self.point(position);
        self.stamp = (self.places[position as usize].version, 0);
    }

    /// Notes that the triangles at all neighbours are about to change.
    pub fn touch_neighbours(&mut self) {
        for neighbour in &self.neighbours {
            let version = &mut self.places[neighbour.position as usize].version;
            *version = version.wrapping_add(1);
        }
    }

    /// The first and the last triangle on the edge to a neighbour.
    pub fn faces_at(&self, neighbour: &Neighbour) -> [&RingFace; 2] {
        neighbour.sides.map(|side| &self.faces[side as usize / 2])
    }

    /// Adds the planes along the edges that bound the surface.
    fn add_bounds(&mut self) {
        let mut features = (0, 0);
        for slot in 0..self.neighbours.len() {
            let neighbour = self.neighbours[slot];
            if neighbour.faces != 2 {
                self.chain = match features {
                    (0, _) => None,
                    (1, faces) if faces == neighbour.faces => Some(true),
                    _ => None,
                };
                features = (features.0 + 1, neighbour.faces);
            }
            if let Some((normal, weight)) = self.bounding_plane(&neighbour) {
                self.quadric.add_plane(normal, weight * neighbour.offset.length_squared());
            }
        }
    }

    /// Whether the two triangles on the edge to a neighbour turn back onto each other.
    fn folds(&self, neighbour: &Neighbour) -> bool {
        let [first, second] = neighbour.sides;
        let (f, g) = (&self.faces[first as usize / 2], &self.faces[second as usize / 2]);
        let cos = f.cross.dot(g.cross);
        // Triangles that are wound alike see the edge from different ends.
        let cos = if (first ^ second) & 1 == 0 { -cos } else { cos };
        cos < FOLD_COS * f.twice * g.twice
    }

    /// The plane that holds the edge where it bounds the surface, and its weight. The planes of the triangles
    /// themselves hold the surface only across, never along.
    fn bounding_plane(&self, neighbour: &Neighbour) -> Option<(Vec3, f32)> {
        if neighbour.faces == 2 && !neighbour.crease && !self.folds(neighbour) {
            return None;
        }
        if neighbour.tint && neighbour.faces == 2 {
            // Seen as clearly as an open edge, however smoothly the surface goes on.
            let side = neighbour.sides[0];
            return Some((self.faces[side as usize / 2].outwards(side & 1 == 0), BOUNDARY_WEIGHT));
        }
        let conormal = self.conormal(neighbour);
        let length = conormal.length();
        let limit = if neighbour.faces == 2 { FOLD } else { OPEN };
        if length > limit {
            Some((conormal / length, BOUNDARY_WEIGHT))
        } else if neighbour.crease && length > 0.0 {
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
            return sides.iter().map(|&side| self.faces[side as usize / 2].outwards(side & 1 == 0)).sum();
        }
        let mut sum = Vec3::ZERO;
        for face in &self.faces {
            for i in [0, 1] {
                if face.face.positions[i] == neighbour.position {
                    sum += face.outwards(i == 0);
                }
            }
        }
        sum
    }

    /// How far a step by `offset` leaves the lines along which the surface is bounded or creased.
    pub fn slide(&self, offset: Vec3) -> f32 {
        let planes = self.neighbours.iter().filter_map(|neighbour| self.bounding_plane(neighbour));
        planes.map(|(normal, _)| normal.dot(offset).abs()).fold(0.0, f32::max)
    }

    /// The squared distance from the position to the triangles that are left of the ring when it goes.
    pub fn gap(&self, target: u32, offset: Vec3) -> f32 {
        let left = self.faces.iter().filter(|f| !f.face.touches(target));
        let gaps = left.map(|f| super::drift::squared_distance(Vec3::ZERO, [offset, f.a, f.b]));
        gaps.min_by(f32::total_cmp).unwrap_or(offset.length_squared())
    }

    /// Whether the ring has a triangle with these two other corners.
    pub fn has_face(&self, [a, b]: [u32; 2]) -> bool {
        self.faces.iter().any(|f| f.face.touches(a) && f.face.touches(b))
    }
}

impl RingFace {
    /// The unit vector that leads out of the triangle across its edge from the position to `a` or to `b`.
    fn outwards(&self, over_a: bool) -> Vec3 {
        let across = if over_a { self.a.cross(self.cross) } else { self.cross.cross(self.b) };
        across.normalize_or_zero()
    }

    /// Whether the triangle would turn by more than the limit, or lose its area, if the position moved by `offset`.
    /// A triangle without area takes the side of the ring, whose area as a vector is `around`.
    pub fn flips(&self, offset: Vec3, around: Vec3, limit: f32) -> bool {
        let after = self.cross - (self.a - self.b).cross(offset);
        if self.twice <= 0.0 {
            return after.dot(around) < 0.0;
        }
        let dot = self.cross.dot(after);
        dot <= 0.0 || dot * dot <= limit * limit * self.twice * self.twice * after.length_squared()
    }
}
