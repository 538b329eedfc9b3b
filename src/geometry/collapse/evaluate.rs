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
/// Two triangles fold when the sum of their outward directions is longer than this: a dihedral angle below 80 degrees.
const FOLD: f32 = 1.53;
/// Any other number of triangles bounds a surface when theirs is longer than this.
const OPEN: f32 = 0.7;
/// The least cosine between a triangle's normal before and after a strict collapse.
pub(crate) const FLIP_LIMIT: f32 = 0.2;
/// The least cosine at which a wedge may take on the attributes of one that it shares no triangle with.
const SMEAR_LIMIT: f32 = 0.9;
/// A slight preference for short edges, which decides on flat ground.
const SHORTNESS: f32 = 1e-6;
/// What relaxing a guard costs: the ring's area times this share of the squared edge length.
const RELAXED_PRICE: f32 = 0.1;
/// Pieces of at most so many positions vanish whole when nothing of them can collapse.
const LARGEST_PIECE: usize = 32;
/// At most so many targets are put to the guards, cheapest first: keeps a hub's evaluation linear in its valence.
const TARGETS_TRIED: usize = 24;

/// What can be done with a position now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub action: Action,
    pub cost: f32,
    /// The guards that hold.
    pub phase: Phase,
}

/// A step of the order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Action {
    /// The position goes onto this neighbour.
    Collapse(u32),
    /// The connected piece that the position belongs to goes as a whole.
    Vanish,
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
    /// The sum of the outward directions of its triangles across the edge: nothing where a surface goes on smoothly,
    /// a unit vector at an open edge, two where a sheet folds back onto itself.
    conormal: Vec3,
}

impl Neighbour {
    /// The plane that holds the edge where it bounds the surface, and its weight. The planes of the triangles
    /// themselves hold the surface only across, never along.
    fn bounding_plane(&self) -> Option<(Vec3, f32)> {
        let length = self.conormal.length();
        let limit = if self.faces == 2 { FOLD } else { OPEN };
        if length > limit {
            Some((self.conormal / length, BOUNDARY_WEIGHT))
        } else if self.crease && length > 0.0 {
            Some((self.conormal / length, CREASE_WEIGHT))
        } else {
            None
        }
    }
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
    stamp: u32,
    /// For each position: the last count that it was in, of common neighbours or of the positions of a piece.
    counted: Vec<u32>,
    count: u32,
    by_cost: Vec<(f32, u32)>,
    /// Positions of the piece that [`Action::Vanish`] is about.
    pub piece: Vec<u32>,
    /// From wedges of the position to wedges of the target, filled by [`Evaluator::map_wedges`].
    pub mapping: Vec<(u32, u32)>,
}

impl Evaluator {
    pub fn new(positions: usize) -> Self {
        Self {
            faces: Vec::new(),
            neighbours: Vec::new(),
            mark: vec![(0, 0); positions],
            stamp: 0,
            counted: vec![0; positions],
            count: 0,
            by_cost: Vec::new(),
            piece: Vec::new(),
            mapping: Vec::new(),
        }
    }

    /// The cheapest allowed step for a position, or why there is none.
    ///
    /// The guards are relaxed only where nothing else is allowed, and at a price: what is stuck must not stay while
    /// everything around it goes. Of the relaxed steps the cheapest is taken, whichever guard it needs relaxed; only
    /// turning a triangle waits until there is no other.
    pub fn best(
        &mut self,
        mesh: &mut CornerMesh,
        setting: &Setting<'_>,
        accumulated: &[Quadric],
        position: u32,
    ) -> Result<Candidate, Stall> {
        if setting.locked[position as usize] {
            return Err(Stall::Boundary);
        }
        self.collect(mesh, position);
        if self.faces.is_empty() {
            return Err(Stall::None);
        }
        let ring = self.ring_quadric(setting, position);
        let chain = self.chain();
        self.rank_targets(setting, accumulated, position, ring, chain == Some(true));
        let mut stall = if chain.is_none() { Stall::NonManifold } else { Stall::None };
        let mut best: Option<Candidate> = None;
        for phase in [Phase::Strict, Phase::Smear, Phase::Topology, Phase::Free] {
            if chain.is_none() && phase.keeps_topology() || best.is_some() && phase == Phase::Free {
                continue;
            }
            match self.first_allowed(mesh, setting, position, phase) {
                Ok((target, cost)) => {
                    let cost = cost + self.price(setting, position, target, ring.1, phase);
                    let candidate = Candidate { action: Action::Collapse(target), cost, phase };
                    if phase == Phase::Strict {
                        return Ok(candidate);
                    }
                    if best.is_none_or(|best| cost < best.cost) {
                        best = Some(candidate);
                    }
                }
                Err(cause) => stall = if cause == Stall::None { stall } else { cause },
            }
        }
        if let Some(best) = best {
            return Ok(best);
        }
        self.vanishing(mesh, setting, position).ok_or(stall)
    }

    /// What relaxing the guards costs: as if the surface had moved by a share of the edge.
    fn price(&self, setting: &Setting<'_>, position: u32, target: u32, area: f32, phase: Phase) -> f32 {
        if phase == Phase::Strict {
            return 0.0;
        }
        RELAXED_PRICE
            * area
            * setting.points[position as usize].distance_squared(setting.points[target as usize])
    }

    fn first_allowed(
        &mut self,
        mesh: &CornerMesh,
        setting: &Setting<'_>,
        position: u32,
        phase: Phase,
    ) -> Result<(u32, f32), Stall> {
        let mut stall = Stall::None;
        for i in 0..self.by_cost.len().min(TARGETS_TRIED) {
            let (cost, slot) = self.by_cost[i];
            match self.guard(mesh, setting, position, slot, phase) {
                Ok(()) => return Ok((self.neighbours[slot as usize].position, cost)),
                Err(cause) => stall = if stall == Stall::None { cause } else { stall },
            }
        }
        Err(stall)
    }

    /// A small piece that nothing can collapse vanishes whole, at the price of its size.
    fn vanishing(&mut self, mesh: &CornerMesh, setting: &Setting<'_>, position: u32) -> Option<Candidate> {
        self.piece.clear();
        self.piece.push(position);
        let stamp = self.next_count();
        self.counted[position as usize] = stamp;
        let mut at = 0;
        while at < self.piece.len() {
            for face in mesh.faces(self.piece[at]) {
                for other in face.positions {
                    if std::mem::replace(&mut self.counted[other as usize], stamp) != stamp {
                        self.piece.push(other);
                    }
                }
            }
            at += 1;
            if self.piece.len() > LARGEST_PIECE {
                return None;
            }
        }
        let corners: u32 = self.piece.iter().map(|&p| mesh.valence[p as usize]).sum();
        let all = corners as usize / 3 >= mesh.live_triangles;
        if all || self.piece.iter().any(|&p| setting.locked[p as usize]) {
            return None;
        }
        let size = piece_size(setting, &self.piece);
        Some(Candidate { action: Action::Vanish, cost: size.powi(4), phase: Phase::Vanish })
    }

    fn next_stamp(&mut self) -> u32 {
        self.stamp += 1;
        self.stamp
    }

    fn next_count(&mut self) -> u32 {
        self.count += 1;
        self.count
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
                    let entry = Neighbour {
                        position: other,
                        faces: 1,
                        wedge: face.wedge,
                        crease: false,
                        conormal: Vec3::ZERO,
                    };
                    self.neighbours.push(entry);
                }
            }
        }
    }

    /// Whether edges with other than two triangles form a chain through the position: `Some(false)` if it has none,
    /// `Some(true)` along a boundary or a seam where sheets meet, `None` at a junction of such edges.
    fn chain(&self) -> Option<bool> {
        let mut features = self.neighbours.iter().filter(|n| n.faces != 2).map(|n| n.faces);
        match (features.next(), features.next(), features.next()) {
            (None, _, _) => Some(false),
            (Some(first), Some(second), None) if first == second => Some(true),
            _ => None,
        }
    }

    /// The quadric of the current ring: its planes, and planes along the edges that bound it.
    fn ring_quadric(&mut self, setting: &Setting<'_>, position: u32) -> (Quadric, f32) {
        let origin = setting.points[position as usize];
        let mut quadric = Quadric::default();
        let mut total = 0.0;
        for i in 0..self.faces.len() {
            let face = self.faces[i];
            let [a, b] = face.positions.map(|p| setting.points[p as usize] - origin);
            let cross = a.cross(b);
            let twice = cross.length();
            if twice <= 0.0 {
                continue;
            }
            let normal = cross / twice;
            total += 0.5 * twice;
            quadric.add_plane(normal, 0.5 * twice);
            // Outwards in the plane of the triangle, across its two edges at the position.
            for (other, outwards) in face.positions.into_iter().zip([a.cross(normal), normal.cross(b)]) {
                let slot = self.mark[other as usize].1 as usize;
                self.neighbours[slot].conormal += outwards.normalize_or_zero();
            }
        }
        for neighbour in &self.neighbours {
            if let Some((normal, weight)) = neighbour.bounding_plane() {
                let edge = setting.points[neighbour.position as usize] - origin;
                quadric.add_plane(normal, weight * edge.length_squared());
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
        on_chain: bool,
    ) {
        let origin = setting.points[position as usize];
        let memory = accumulated[position as usize];
        self.by_cost.clear();
        for (slot, neighbour) in self.neighbours.iter().enumerate() {
            // A position on a boundary or a seam slides along it.
            if on_chain && neighbour.faces == 2 {
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
        if phase.keeps_sides() && self.flips(setting, position, neighbour.position) {
            return Err(Stall::Flip);
        }
        if phase.keeps_topology() && !self.link_holds(mesh, position, neighbour.position) {
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
    fn link_holds(&mut self, mesh: &CornerMesh, position: u32, target: u32) -> bool {
        let across = self.next_count();
        for face in mesh.faces(target).filter(|face| face.touches(position)) {
            for p in face.positions {
                self.counted[p as usize] = across;
            }
        }
        let in_ring = |p: u32| self.mark[p as usize].0 == self.stamp;
        let breaks = |face: Face| {
            let common = face.positions.map(in_ring);
            let stray = |i: usize| common[i] && self.counted[face.positions[i] as usize] != across;
            stray(0) || stray(1) || common == [true, true] && self.has_face(face.positions)
        };
        !mesh.faces(target).filter(|face| !face.touches(position)).any(breaks)
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
        }
        for neighbour in &self.neighbours {
            if let Some((normal, BOUNDARY_WEIGHT)) = neighbour.bounding_plane() {
                deviation = deviation.max(normal.dot(offset).abs());
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

/// The diagonal of the box of some positions.
pub(super) fn piece_size(setting: &Setting<'_>, positions: &[u32]) -> f32 {
    let points = || positions.iter().map(|&p| setting.points[p as usize]);
    (points().fold(Vec3::NEG_INFINITY, Vec3::max) - points().fold(Vec3::INFINITY, Vec3::min)).length()
}
