//! The best collapse of one position: its ring, the cost of every target, and the guards that forbid some.
//!
//! The cost is mostly the quadric of the *current* ring (memoryless, Lindstrom & Turk 1998) and a little of the
//! accumulated one (Garland & Heckbert 1997), area-weighted, with planes that hold open boundaries and creases.

use glam::Vec3;

use super::Phase;
use super::mesh::{CornerMesh, Face};
use crate::geometry::quadric::Quadric;
use crate::geometry::record::Stall;

/// The share of the memoryless quadric; 0.9 / 0.1 gives a fifth to a quarter less error than the classic 0 / 1.
const MEMORYLESS: f32 = 0.9;
/// The weight of boundary planes against the surface's own, per squared edge length.
const BOUNDARY_WEIGHT: f32 = 10.0;
/// The same for creases, which the planes of both sides hold already where they are sharp.
const CREASE_WEIGHT: f32 = 0.5;
/// The least cosine between a triangle's normal before and after a strict collapse.
pub(crate) const FLIP_LIMIT: f32 = 0.2;
/// The least cosine at which a wedge may take on the attributes of one that it shares no triangle with.
const SMEAR_LIMIT: f32 = 0.9;
/// A slight preference for short edges, which decides on flat ground.
const SHORTNESS: f32 = 1e-6;
/// At most so many targets are put to the guards, cheapest first: keeps a hub's evaluation linear in its valence.
const TARGETS_TRIED: usize = 24;

/// A collapse that is allowed now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub target: u32,
    pub cost: f32,
}

/// One neighbour of the position at hand.
#[derive(Debug, Clone, Copy)]
struct Neighbour {
    position: u32,
    /// Triangles on the edge.
    faces: u32,
    /// The wedge that the first of them names at the position at hand.
    wedge: u32,
    /// Whether another of them names a different one.
    crease: bool,
}

/// The unchanging part of the problem.
pub(super) struct Setting<'a> {
    /// Positions in a local frame of unit size.
    pub points: &'a [Vec3],
    pub wedge_normals: &'a [Vec3],
    pub locked: &'a [bool],
}

/// Working memory, reused from position to position.
pub(super) struct Evaluator {
    pub faces: Vec<Face>,
    neighbours: Vec<Neighbour>,
    /// For each position: the stamp of the last ring it was in, and its index there.
    mark: Vec<(u32, u32)>,
    /// For each position: the stamp of the last common neighbourhood it was counted in.
    counted: Vec<u32>,
    stamp: u32,
    by_cost: Vec<(f32, u32)>,
    /// From wedges of the position to wedges of the target, filled by [`Evaluator::map_wedges`].
    pub mapping: Vec<(u32, u32)>,
}

impl Evaluator {
    pub fn new(positions: usize) -> Self {
        Self {
            faces: Vec::new(),
            neighbours: Vec::new(),
            mark: vec![(0, 0); positions],
            counted: vec![0; positions],
            stamp: 0,
            by_cost: Vec::new(),
            mapping: Vec::new(),
        }
    }

    /// The cheapest allowed collapse of a position, or why there is none.
    pub fn best(
        &mut self,
        mesh: &mut CornerMesh,
        setting: &Setting<'_>,
        accumulated: &[Quadric],
        position: u32,
        phase: Phase,
    ) -> Result<Candidate, Stall> {
        if setting.locked[position as usize] {
            return Err(Stall::Boundary);
        }
        self.collect(mesh, position);
        let feature = self.feature_degree(phase)?;
        let ring = self.ring_quadric(setting, position);
        self.rank_targets(setting, accumulated, position, ring, feature);
        let mut cause = if self.by_cost.is_empty() { Stall::Boundary } else { Stall::None };
        for i in 0..self.by_cost.len().min(TARGETS_TRIED) {
            let (cost, slot) = self.by_cost[i];
            match self.guard(mesh, setting, position, slot, phase) {
                Ok(()) => return Ok(Candidate { target: self.neighbours[slot as usize].position, cost }),
                Err(stall) => cause = if cause == Stall::None { stall } else { cause },
            }
        }
        Err(cause)
    }

    fn next_stamp(&mut self) -> u32 {
        self.stamp += 1;
        self.stamp
    }

    /// Fills `faces` and `neighbours` and marks the ring.
    fn collect(&mut self, mesh: &mut CornerMesh, position: u32) {
        mesh.collect_faces(position, &mut self.faces);
        let stamp = self.next_stamp();
        self.neighbours.clear();
        for face in &self.faces {
            for other in face.positions {
                let mark = &mut self.mark[other as usize];
                if mark.0 == stamp {
                    let neighbour = &mut self.neighbours[mark.1 as usize];
                    neighbour.faces += 1;
                    neighbour.crease |= neighbour.wedge != face.wedge;
                } else {
                    *mark = (stamp, self.neighbours.len() as u32);
                    let entry = Neighbour { position: other, faces: 1, wedge: face.wedge, crease: false };
                    self.neighbours.push(entry);
                }
            }
        }
    }

    /// How many edges of the position have other than two triangles: 0 inside, 2 along a boundary or a seam where
    /// sheets meet. Anything else is a junction, which moves only in the last phase.
    fn feature_degree(&self, phase: Phase) -> Result<usize, Stall> {
        if self.faces.is_empty() {
            return Err(Stall::None);
        }
        let mut features = self.neighbours.iter().filter(|n| n.faces != 2);
        let first = features.next().map(|n| n.faces);
        let second = features.next().map(|n| n.faces);
        let degree = self.neighbours.iter().filter(|n| n.faces != 2).count();
        let chain = degree == 0 || degree == 2 && first == second;
        if !chain && phase != Phase::Junctions {
            return Err(Stall::NonManifold);
        }
        Ok(if chain { degree } else { 0 })
    }

    /// The quadric of the current ring: its planes, and planes along open edges and creases.
    fn ring_quadric(&self, setting: &Setting<'_>, position: u32) -> (Quadric, f32) {
        let origin = setting.points[position as usize];
        let mut quadric = Quadric::default();
        let mut total = 0.0;
        for face in &self.faces {
            let [a, b] = face.positions.map(|p| setting.points[p as usize] - origin);
            let cross = a.cross(b);
            let twice = cross.length();
            if twice <= 0.0 {
                continue;
            }
            let normal = cross / twice;
            total += 0.5 * twice;
            quadric.add_plane(normal, 0.5 * twice);
            for (edge, other) in [a, b].into_iter().zip(face.positions) {
                let neighbour = self.neighbours[self.mark[other as usize].1 as usize];
                let weight = match (neighbour.faces, neighbour.crease) {
                    (2, false) => continue,
                    (2, true) => CREASE_WEIGHT,
                    _ => BOUNDARY_WEIGHT,
                };
                let along = edge.cross(normal).normalize_or_zero();
                quadric.add_plane(along, weight * edge.length_squared());
            }
        }
        (quadric, total)
    }

    fn rank_targets(
        &mut self,
        setting: &Setting<'_>,
        accumulated: &[Quadric],
        position: u32,
        (ring, area): (Quadric, f32),
        feature: usize,
    ) {
        let origin = setting.points[position as usize];
        let memory = accumulated[position as usize];
        self.by_cost.clear();
        for (slot, neighbour) in self.neighbours.iter().enumerate() {
            // A position on a boundary or a seam slides along it.
            if feature == 2 && neighbour.faces == 2 {
                continue;
            }
            let offset = setting.points[neighbour.position as usize] - origin;
            let quadrics = MEMORYLESS * ring.at(offset) + (1.0 - MEMORYLESS) * memory.at(offset);
            let cost = quadrics + SHORTNESS * area * offset.length_squared();
            self.by_cost.push((cost, slot as u32));
        }
        self.by_cost.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// Whether the collapse onto a neighbour is allowed, or the guard that forbids it.
    fn guard(
        &mut self,
        mesh: &CornerMesh,
        setting: &Setting<'_>,
        position: u32,
        slot: u32,
        phase: Phase,
    ) -> Result<(), Stall> {
        let neighbour = self.neighbours[slot as usize];
        // Something of the part always stays: an empty picture is worth no saving.
        if neighbour.faces as usize >= mesh.live_triangles {
            return Err(Stall::None);
        }
        let smears = !self.map_wedges(mesh, setting, neighbour.position);
        if smears && phase == Phase::Strict {
            return Err(Stall::Crease);
        }
        if phase == Phase::Strict && self.flips(setting, position, neighbour.position) {
            return Err(Stall::Flip);
        }
        let complex = self.neighbours.iter().any(|n| n.faces > 2);
        if !(phase == Phase::Junctions && complex) && !self.link_holds(mesh, position, neighbour) {
            return Err(Stall::NonManifold);
        }
        Ok(())
    }

    /// Whether a surviving triangle would turn by more than the limit, or lose its area.
    fn flips(&self, setting: &Setting<'_>, position: u32, target: u32) -> bool {
        let (from, to) = (setting.points[position as usize], setting.points[target as usize]);
        self.faces.iter().filter(|face| !face.touches(target)).any(|face| {
            let [a, b] = face.positions.map(|p| setting.points[p as usize]);
            let before = (a - from).cross(b - from);
            let after = (a - to).cross(b - to);
            // A triangle without area has no side to be kept.
            before.length_squared() > 0.0
                && before.dot(after) <= FLIP_LIMIT * before.length() * after.length()
        })
    }

    /// The link condition (Dey et al. 1999): the two ends have no common neighbour but across the edge's own
    /// triangles, and no triangle of the one would fall onto one of the other.
    fn link_holds(&mut self, mesh: &CornerMesh, position: u32, neighbour: Neighbour) -> bool {
        let ring = self.stamp;
        let target = neighbour.position;
        let mut common = 0;
        for face in mesh.faces(target) {
            let other_side = face.positions[0] != position && face.positions[1] != position;
            let marked = face.positions.map(|p| p != position && self.mark[p as usize].0 == ring);
            if other_side && marked == [true, true] && self.has_face(face.positions) {
                return false;
            }
            for (p, _) in face.positions.into_iter().zip(marked).filter(|&(_, marked)| marked) {
                if self.counted[p as usize] != ring {
                    self.counted[p as usize] = ring;
                    common += 1;
                }
            }
        }
        // The next target of this ring counts anew.
        for face in mesh.faces(target) {
            for p in face.positions {
                self.counted[p as usize] = 0;
            }
        }
        common == neighbour.faces
    }

    fn has_face(&self, [a, b]: [u32; 2]) -> bool {
        self.faces.iter().any(|face| face.touches(a) && face.touches(b))
    }

    /// Finds for every wedge of the position the wedge of the target that it becomes; false if one would take on
    /// attributes across a crease.
    pub fn map_wedges(&mut self, mesh: &CornerMesh, setting: &Setting<'_>, target: u32) -> bool {
        self.mapping.clear();
        let normals = setting.wedge_normals;
        let likeness = |a: u32, b: u32| normals[a as usize].dot(normals[b as usize]);
        let mut clean = true;
        for i in 0..self.faces.len() {
            let wedge = self.faces[i].wedge;
            if self.mapping.iter().any(|&(from, _)| from == wedge) {
                continue;
            }
            let shared = self
                .faces
                .iter()
                .filter(|face| face.wedge == wedge)
                .flat_map(|face| face.positions.into_iter().zip(face.wedges))
                .filter(|&(p, _)| p == target)
                .map(|(_, w)| w)
                .max_by(|&a, &b| likeness(wedge, a).total_cmp(&likeness(wedge, b)));
            let to = match shared {
                Some(to) => to,
                None => {
                    let best = mesh
                        .live_wedges(target)
                        .max_by(|&a, &b| likeness(wedge, a).total_cmp(&likeness(wedge, b)));
                    let Some(best) = best else { return false };
                    clean &= likeness(wedge, best) >= SMEAR_LIMIT;
                    best
                }
            };
            self.mapping.push((wedge, to));
        }
        clean
    }

    /// The largest distance from the target to a plane of the position's ring: how far the surface moves.
    pub fn deviation(&self, setting: &Setting<'_>, position: u32, target: u32) -> f32 {
        let origin = setting.points[position as usize];
        let offset = setting.points[target as usize] - origin;
        let mut deviation = 0f32;
        for face in &self.faces {
            let [a, b] = face.positions.map(|p| setting.points[p as usize] - origin);
            let normal = a.cross(b).normalize_or_zero();
            deviation = deviation.max(normal.dot(offset).abs());
            for (edge, other) in [a, b].into_iter().zip(face.positions) {
                if self.neighbours[self.mark[other as usize].1 as usize].faces == 1 {
                    deviation = deviation.max(edge.cross(normal).normalize_or_zero().dot(offset).abs());
                }
            }
        }
        deviation
    }

    /// The neighbours that the last ring had.
    pub fn neighbour_positions(&self) -> impl Iterator<Item = u32> + '_ {
        self.neighbours.iter().map(|n| n.position)
    }

    /// The starting quadric of a position, from the last ring that was collected.
    pub fn initial_quadric(
        &mut self,
        mesh: &mut CornerMesh,
        setting: &Setting<'_>,
        position: u32,
    ) -> Quadric {
        self.collect(mesh, position);
        self.ring_quadric(setting, position).0
    }
}
