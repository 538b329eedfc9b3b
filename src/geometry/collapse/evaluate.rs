//! The best collapse of one position: the cost of every target, and the guards that forbid some or make them dearer.
//!
//! The cost is the quadric of the *current* ring (memoryless, Lindstrom & Turk 1998), area-weighted, with planes that
//! hold open boundaries and creases: how far the target is from the planes of the ring. To it is added the other way,
//! how far the position is from the triangles that would be left ([`GAP_WEIGHT`]).

use glam::Vec3;

use super::Phase;
use super::mesh::{CornerMesh, Face};
use super::ring::{Place, Ring};
use crate::geometry::record::Attributes;
use crate::geometry::record::{Stall, VertexRecord};

/// The least cosine between a triangle's normal before and after a strict collapse.
pub(crate) const FLIP_LIMIT: f32 = 0.2;
/// The least cosine at which a wedge may take on the attributes of one that it shares no triangle with.
const SMEAR_LIMIT: f32 = 0.9;
/// A slight preference for short edges, which decides on flat ground.
const SHORTNESS: f32 = 1e-6;
/// What a change of topology costs: the ring's area times this share of the squared edge length.
const RELAXED_PRICE: f32 = 0.1;
/// What a smeared crease costs, in the same measure.
const SMEAR_PRICE: f32 = 0.03;
/// What it costs to smear a colour or a material, in the same measure.
const TAG_PRICE: f32 = 0.5;
/// The likeness of wedges that differ in colour or material: below every cosine.
const OTHER_TAG: f32 = -2.0;
/// What the distance from the position to the surface that would be left costs, squared, for each unit of the ring's
/// area.
const GAP_WEIGHT: f32 = 1.0;
/// Pieces of at most so many positions vanish whole when nothing of them can collapse.
pub(super) const LARGEST_PIECE: usize = 32;
/// At most so many targets are put to the guards, cheapest first: keeps a hub's evaluation linear in its valence.
const TARGETS_TRIED: usize = 24;
/// A position with more triangles than this is a hub: nothing that is done beside it may look at all of it.
pub(super) const HUB: u32 = 64;

/// At most so many triangles are asked whether they touch a hub.
const MOST_ASKED: u32 = 1024;

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

/// The unchanging part of the problem.
pub(super) struct Setting<'a> {
    pub wedges: &'a [VertexRecord],
    pub attributes: Attributes,
    pub locked: &'a [bool],
}

impl Setting<'_> {
    /// The cosine between the normals of two wedges; [`OTHER_TAG`] if they differ in colour or material.
    fn likeness(&self, a: u32, b: u32) -> f32 {
        if a == b {
            return 1.0;
        }
        let [a, b] = [a, b].map(|wedge| self.wedges[wedge as usize]);
        if self.attributes.tag(a.attributes()) != self.attributes.tag(b.attributes()) {
            return OTHER_TAG;
        }
        Vec3::from(a.normal(self.attributes)).dot(b.normal(self.attributes).into())
    }
}

/// Working memory, reused from position to position.
pub(super) struct Evaluator {
    pub ring: Ring,
    by_cost: Vec<(f32, u32)>,
    /// Per position, the last answer of [`Evaluator::best`] that was a collapse, and the stamp of its ring then.
    known: Vec<Option<((u32, u32), Candidate)>>,
    /// Positions of the piece that [`Action::Vanish`] is about.
    pub piece: Vec<u32>,
    /// From wedges of the position to wedges of the target, filled by [`Evaluator::map_wedges`].
    pub mapping: Vec<(u32, u32)>,
}

impl Evaluator {
    pub fn new(places: Vec<Place>, tags: Vec<u32>) -> Self {
        Self {
            known: vec![None; places.len()],
            ring: Ring::new(places, tags),
            by_cost: Vec::new(),
            piece: Vec::new(),
            mapping: Vec::new(),
        }
    }

    /// A lower bound of the cost of the best step for a position, without a look at the guards; `None` if there is no
    /// step at all.
    pub fn bound(&mut self, mesh: &mut CornerMesh, setting: &Setting<'_>, position: u32) -> Option<f32> {
        if setting.locked[position as usize] {
            return None;
        }
        self.ring.collect(mesh, position);
        self.rank_targets();
        self.by_cost.iter().map(|entry| entry.0).min_by(f32::total_cmp)
    }

    /// The cheapest step for a position, or why there is none.
    ///
    /// Guards that are relaxed have a price: what is stuck must not stay while everything around it goes. Only turning
    /// a triangle waits until there is no other step.
    pub fn best(
        &mut self,
        mesh: &mut CornerMesh,
        setting: &Setting<'_>,
        position: u32,
    ) -> Result<Candidate, Stall> {
        if setting.locked[position as usize] {
            return Err(Stall::Boundary);
        }
        self.ring.collect(mesh, position);
        if self.ring.faces.is_empty() {
            return Err(Stall::None);
        }
        if let Some(known) = self.known_best(mesh, position) {
            return Ok(known);
        }
        self.rank_targets();
        let (mut best, mut turning): (Option<Candidate>, Option<Candidate>) = (None, None);
        for i in 0..self.by_cost.len().min(TARGETS_TRIED) {
            let (cost, slot) = self.take_cheapest(i);
            if best.is_some_and(|best| best.cost <= cost) {
                break;
            }
            let rival = best.map(|best| best.cost);
            let Some((phase, price)) = self.guard(mesh, setting, position, (cost, slot), rival) else {
                continue;
            };
            let target = self.ring.neighbours[slot as usize].position;
            let candidate = Candidate { action: Action::Collapse(target), cost: cost + price, phase };
            let rival = if phase == Phase::Free { &mut turning } else { &mut best };
            if rival.is_none_or(|rival| candidate.cost < rival.cost) {
                *rival = Some(candidate);
            }
        }
        let best = best.or(turning);
        self.known[position as usize] = best.map(|best| (self.ring.stamp, best));
        best.or_else(|| self.vanishing(mesh, setting, position)).ok_or(Stall::NonManifold)
    }

    /// The answer of last time, if nothing has changed that it depends on.
    fn known_best(&self, mesh: &CornerMesh, position: u32) -> Option<Candidate> {
        let (_, best) = self.known[position as usize].filter(|known| known.0 == self.ring.stamp)?;
        let Action::Collapse(target) = best.action else { return None };
        let slot = self.ring.slot(target)?;
        ((self.ring.neighbours[slot].faces as usize) < mesh.live_triangles).then_some(best)
    }

    /// Moves the cheapest of the targets from the `i`-th on to place `i`.
    fn take_cheapest(&mut self, i: usize) -> (f32, u32) {
        let before = |a: (f32, u32), b: (f32, u32)| a.0 < b.0 || a.0 == b.0 && a.1 < b.1;
        let mut least = i;
        for j in i + 1..self.by_cost.len() {
            if before(self.by_cost[j], self.by_cost[least]) {
                least = j;
            }
        }
        self.by_cost.swap(i, least);
        self.by_cost[i]
    }

    /// A small piece that nothing can collapse vanishes whole, at the price of its size.
    fn vanishing(&mut self, mesh: &CornerMesh, setting: &Setting<'_>, position: u32) -> Option<Candidate> {
        self.piece.clear();
        self.piece.push(position);
        let mut at = 0;
        while at < self.piece.len() {
            for face in mesh.faces(self.piece[at]) {
                for other in face.positions {
                    if !self.piece.contains(&other) {
                        self.piece.push(other);
                    }
                }
                if self.piece.len() > LARGEST_PIECE {
                    return None;
                }
            }
            at += 1;
        }
        let corners: u32 = self.piece.iter().map(|&p| mesh.valence(p)).sum();
        let all = corners as usize / 3 >= mesh.live_triangles;
        if all || self.piece.iter().any(|&p| setting.locked[p as usize]) {
            return None;
        }
        let size = self.piece_size(&self.piece);
        Some(Candidate { action: Action::Vanish, cost: size.powi(4), phase: Phase::Vanish })
    }

    fn rank_targets(&mut self) {
        let ring = &self.ring;
        let quadric = ring.quadric;
        let on_chain = ring.chain == Some(true);
        self.by_cost.clear();
        for (slot, neighbour) in ring.neighbours.iter().enumerate() {
            // A position on a boundary or a seam slides along it.
            if on_chain && neighbour.faces == 2 {
                continue;
            }
            let offset = neighbour.offset;
            let cost = quadric.at(offset) + SHORTNESS * ring.area * offset.length_squared();
            self.by_cost.push((cost, slot as u32));
        }
    }

    /// The phase in which the collapse onto a neighbour is allowed, and its price; `None` if it never is, or if it is no
    /// better than a rival of the cost given.
    fn guard(
        &mut self,
        mesh: &CornerMesh,
        setting: &Setting<'_>,
        position: u32,
        (cost, slot): (f32, u32),
        rival: Option<f32>,
    ) -> Option<(Phase, f32)> {
        let neighbour = self.ring.neighbours[slot as usize];
        // Something of the part always stays: an empty picture is worth no saving.
        if neighbour.faces as usize >= mesh.live_triangles {
            return None;
        }
        if setting.locked[neighbour.position as usize] && self.bares(setting, neighbour.position) {
            return None;
        }
        let unit = self.ring.area * neighbour.offset.length_squared();
        if self.turns(neighbour.position, neighbour.offset) {
            if rival.is_some() {
                return None;
            }
            return self
                .map_wedges(mesh, setting, neighbour.position)
                .map(|_| (Phase::Free, RELAXED_PRICE * unit));
        }
        let hopeless = |price: f32| rival.is_some_and(|rival| cost + price >= rival);
        let gap = GAP_WEIGHT * self.ring.area * self.ring.gap(neighbour.position, neighbour.offset);
        if hopeless(gap) {
            return None;
        }
        let likeness = self.map_wedges(mesh, setting, neighbour.position)?;
        let smear = match likeness {
            OTHER_TAG => TAG_PRICE * unit,
            likeness if likeness < SMEAR_LIMIT => SMEAR_PRICE * unit,
            _ => 0.0,
        };
        if hopeless(smear + gap) {
            return None;
        }
        if self.ring.chain.is_none() || !self.link_holds(mesh, position, neighbour.position) {
            return Some((Phase::Topology, RELAXED_PRICE * unit + smear + gap));
        }
        Some((if smear > 0.0 { Phase::Smear } else { Phase::Strict }, smear + gap))
    }

    /// Whether an edge between two locked positions, the target one of them, would lose its last triangle: this is
    /// brings no other triangle to it, and another cell may still have the edge.
    fn bares(&self, setting: &Setting<'_>, target: u32) -> bool {
        let dying = || self.ring.faces.iter().filter(|f| f.face.touches(target));
        let mut thirds = dying().flat_map(|f| f.face.positions).filter(|&third| third != target);
        thirds.any(|third| {
            let all_die = |slot: usize| {
                let die = dying().filter(|f| f.face.touches(third)).count();
                self.ring.neighbours[slot].faces as usize == die
            };
            setting.locked[third as usize] && self.ring.slot(third).is_some_and(all_die)
        })
    }

    /// Whether a surviving triangle would turn by more than the limit, or lose its area.
    fn turns(&self, target: u32, offset: Vec3) -> bool {
        self.ring
            .faces
            .iter()
            .any(|f| !f.face.touches(target) && f.flips(offset, self.ring.around, FLIP_LIMIT))
    }

    /// The link condition (Dey et al. 1999): the two ends have no common neighbour but across the edge's own
    /// triangles, and no triangle of the one would fall onto one of the other.
    fn link_holds(&mut self, mesh: &CornerMesh, position: u32, target: u32) -> bool {
        for i in 0..self.ring.faces.len() {
            let face = self.ring.faces[i].face;
            if face.touches(target) {
                for p in face.positions {
                    if let Some(slot) = self.ring.slot(p) {
                        self.ring.neighbours[slot].across = target;
                    }
                }
            }
        }
        if mesh.valence(target) <= HUB {
            return !mesh.faces(target).any(|face| !face.touches(position) && self.breaks(face, target));
        }
        let others = || self.ring.neighbours.iter().filter(|n| n.position != target);
        // Between two hubs nobody can tell in bounded time.
        if others().map(|n| mesh.valence(n.position)).sum::<u32>() > MOST_ASKED {
            return false;
        }
        let on_target = |face: &Face| face.touches(target) && !face.touches(position);
        !others().any(|n| {
            mesh.faces(n.position).filter(on_target).any(|face| {
                let [a, b] = face.positions;
                self.breaks(Face { positions: [n.position, if a == target { b } else { a }], ..face }, target)
            })
        })
    }

    /// Whether a triangle of the target would meet the ring where it must not.
    fn breaks(&self, face: Face, target: u32) -> bool {
        let [a, b] = face.positions.map(|p| self.ring.slot(p));
        let stray =
            |slot: Option<usize>| slot.is_some_and(|slot| self.ring.neighbours[slot].across != target);
        stray(a) || stray(b) || a.is_some() && b.is_some() && self.ring.has_face(face.positions)
    }

    /// Finds for every wedge of the position the wedge of the target that it becomes, and the least cosine between
    /// the normals of those that share no triangle; `None` if the target has no wedge to offer.
    pub fn map_wedges(&mut self, mesh: &CornerMesh, setting: &Setting<'_>, target: u32) -> Option<f32> {
        self.mapping.clear();
        let mut least = 1f32;
        let mut last = super::mesh::NONE;
        for i in 0..self.ring.faces.len() {
            let wedge = self.ring.faces[i].face.wedge;
            if std::mem::replace(&mut last, wedge) == wedge || self.mapping.iter().any(|m| m.0 == wedge) {
                continue;
            }
            let likest =
                |a: &u32, b: &u32| setting.likeness(wedge, *a).total_cmp(&setting.likeness(wedge, *b));
            let to = match self.shared_wedges(wedge, target).max_by(likest) {
                Some(to) => to,
                None => {
                    let to = mesh.live_wedges(target).max_by(likest)?;
                    least = least.min(setting.likeness(wedge, to));
                    to
                }
            };
            self.mapping.push((wedge, to));
        }
        Some(least)
    }

    /// The wedges of the target that share a triangle with a wedge of the position, some of them more than once.
    fn shared_wedges(&self, wedge: u32, target: u32) -> impl Iterator<Item = u32> + '_ {
        let mut last = super::mesh::NONE;
        self.ring.faces.iter().filter(move |f| f.face.wedge == wedge).filter_map(move |f| {
            let i = f.face.positions.iter().position(|&p| p == target)?;
            let shared = f.face.wedges[i];
            (std::mem::replace(&mut last, shared) != shared).then_some(shared)
        })
    }

    /// The diagonal of the box of some positions.
    pub fn piece_size(&self, positions: &[u32]) -> f32 {
        let points = || positions.iter().map(|&p| self.ring.point(p));
        (points().fold(Vec3::NEG_INFINITY, Vec3::max) - points().fold(Vec3::INFINITY, Vec3::min)).length()
    }
}
