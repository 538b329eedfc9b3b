//! The best collapse of one position: the cost of every target, and the guards that forbid some or make them dearer.
//!
//! The cost is the quadric of the *current* ring (memoryless, Lindstrom & Turk 1998), area-weighted, with planes that
//! hold open boundaries and creases: how far the target is from the planes of the ring. To it is added the other way,
//! how far the position is from the triangles that would be left ([`GAP_WEIGHT`]).

use glam::{Vec3, Vec4};

use super::Phase;
use super::mesh::{CornerMesh, Face, HUB, NONE, Number};
use super::ring::{Neighbour, Place, Ring};
use crate::geometry::record::Attributes;
use crate::geometry::record::{Stall, VertexRecord};

/// The least cosine between a triangle's normal before and after a strict collapse.
pub(crate) const FLIP_LIMIT: f32 = 0.2;
/// The least cosine at which a wedge may take on the attributes of one that it shares no triangle with.
const SMEAR_LIMIT: f32 = 0.9;
/// A slight preference for short edges, which decides on flat ground.
const SHORTNESS: f32 = 1e-6;
/// What a change of topology costs: the ring's area times this share of the squared edge length.
const RELAXED_PRICE: f32 = 0.4;
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

/// The best collapse of a position, as far as its ring alone says.
#[derive(Debug, Clone, Copy)]
struct Known {
    /// [`NONE`] if there is none, or if the ring has changed.
    target: u32,
    /// Without the price of guards that do not hold.
    cost: f32,
    price: f32,
}

impl Known {
    const NOTHING: Self = Self { target: NONE, cost: 0.0, price: 0.0 };
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
    costs: Vec<Vec4>,
    /// Per position, the best collapse that was found last, until its ring changes.
    known: Vec<Known>,
    /// Per neighbour, whether it lies across a triangle on the edge to the target that is looked at.
    across: Vec<bool>,
    /// Positions of the piece that [`Action::Vanish`] is about.
    pub piece: Vec<u32>,
    /// From wedges of the position to wedges of the target, filled by [`Evaluator::map_wedges`].
    pub mapping: Vec<(u32, u32)>,
}

impl Evaluator {
    pub fn new(places: Vec<Place>, tags: Vec<u32>) -> Self {
        Self {
            known: vec![Known::NOTHING; places.len()],
            across: Vec::new(),
            ring: Ring::new(places, tags),
            by_cost: Vec::new(),
            costs: Vec::new(),
            piece: Vec::new(),
            mapping: Vec::new(),
        }
    }

    /// A lower bound of the cost of the best step for a position, which only its ring is asked for; `None` if there is no
    /// step at all.
    pub fn bound(
        &mut self,
        mesh: &mut CornerMesh<impl Number>,
        setting: &Setting<'_>,
        position: u32,
    ) -> Option<f32> {
        if setting.locked[position as usize] {
            return None;
        }
        self.ring.collect(mesh, position);
        self.rank_targets();
        let mut best = Known { cost: f32::INFINITY, ..Known::NOTHING };
        for i in 0..self.by_cost.len().min(TARGETS_TRIED) {
            let (cost, slot) = self.take_cheapest(i);
            if best.cost <= cost {
                break;
            }
            if !self.ring.turns(slot, FLIP_LIMIT) {
                let cost = cost + self.gap_cost(slot);
                if cost < best.cost {
                    best = Known { target: self.ring.neighbours()[slot as usize].position, cost, price: 0.0 };
                }
            }
        }
        self.known[position as usize] = best;
        if best.target != NONE { Some(best.cost) } else { self.by_cost.first().map(|entry| entry.0) }
    }

    /// Forgets what was known of all neighbours, whose triangles are about to change.
    pub fn forget_neighbours(&mut self) {
        for neighbour in self.ring.neighbours() {
            self.known[neighbour.position as usize].target = NONE;
        }
    }

    fn gap_cost(&self, slot: u32) -> f32 {
        GAP_WEIGHT * self.ring.area * self.ring.gap(slot)
    }

    /// The cheapest step for a position, or why there is none.
    ///
    /// Guards that are relaxed have a price: what is stuck must not stay while everything around it goes. Only turning
    /// a triangle waits until there is no other step.
    pub fn best(
        &mut self,
        mesh: &mut CornerMesh<impl Number>,
        setting: &Setting<'_>,
        position: u32,
    ) -> Result<Candidate, Stall> {
        if setting.locked[position as usize] {
            return Err(Stall::Boundary);
        }
        self.ring.collect(mesh, position);
        if self.ring.faces().len() == 0 {
            return Err(Stall::None);
        }
        if let Some(known) = self.known_best(mesh, setting, position) {
            return Ok(known);
        }
        self.rank_targets();
        let mut best: Option<Candidate> = None;
        let mut turning: Option<Candidate> = None;
        let mut known = Known::NOTHING;
        for i in 0..self.by_cost.len().min(TARGETS_TRIED) {
            let (cost, slot) = self.take_cheapest(i);
            if best.is_some_and(|best| best.cost <= cost) {
                break;
            }
            let rival = best.map_or(f32::INFINITY, |best| best.cost);
            let target = self.ring.neighbours()[slot as usize].position;
            if self.ring.turns(slot, FLIP_LIMIT) {
                if best.is_none()
                    && let Some(candidate) = self.turned(mesh, setting, (cost, slot))
                    && turning.is_none_or(|turning| candidate.cost < turning.cost)
                {
                    turning = Some(candidate);
                }
                continue;
            }
            let cost = cost + self.gap_cost(slot);
            let room = rival - cost;
            if room > 0.0
                && let Some((phase, price)) = self.guard(mesh, setting, position, slot, room)
            {
                best = Some(Candidate { action: Action::Collapse(target), cost: cost + price, phase });
                known = Known { target, cost, price };
            }
        }
        self.known[position as usize] = known;
        let best = best.or(turning);
        best.or_else(|| self.vanishing(mesh, setting, position)).ok_or(Stall::NonManifold)
    }

    /// The answer of last time, if the ring is the same and the guards ask no more for it than then.
    fn known_best(
        &mut self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        position: u32,
    ) -> Option<Candidate> {
        let known = self.known[position as usize];
        if known.target == NONE {
            return None;
        }
        let slot = self.ring.slot(known.target)? as u32;
        let (phase, price) = self.guard(mesh, setting, position, slot, f32::INFINITY)?;
        let action = Action::Collapse(known.target);
        (price <= known.price).then_some(Candidate { action, cost: known.cost + price, phase })
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
    fn vanishing(
        &mut self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        position: u32,
    ) -> Option<Candidate> {
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
        ring.costs(SHORTNESS * ring.area, &mut self.costs);
        let on_chain = ring.chain == Some(true);
        self.by_cost.clear();
        let costs = self.costs.iter().flat_map(|four| four.to_array());
        let ranked = (0..).zip(ring.neighbours()).zip(costs);
        // A position on a boundary or a seam slides along it.
        let slides = ranked.filter(|((_, neighbour), _)| !on_chain || neighbour.faces != 2);
        self.by_cost.extend(slides.map(|((slot, _), cost)| (cost, slot)));
    }

    /// Whether nothing forbids the collapse onto a neighbour in any phase.
    fn is_open_to(
        &self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        neighbour: &Neighbour,
    ) -> bool {
        // Something of the part always stays: an empty picture is worth no saving.
        (neighbour.faces as usize) < mesh.live_triangles
            && !(setting.locked[neighbour.position as usize] && self.bares(setting, neighbour.position))
    }

    /// The collapse onto a neighbour that turns a triangle.
    fn turned(
        &mut self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        (cost, slot): (f32, u32),
    ) -> Option<Candidate> {
        let neighbour = self.ring.neighbours()[slot as usize];
        if !self.is_open_to(mesh, setting, &neighbour) {
            return None;
        }
        self.map_wedges(mesh, setting, neighbour.position)?;
        let price = RELAXED_PRICE * self.ring.area * neighbour.offset().length_squared();
        let action = Action::Collapse(neighbour.position);
        Some(Candidate { action, cost: cost + price, phase: Phase::Free })
    }

    /// The phase in which the collapse onto a neighbour, which turns no triangle, is allowed, and its price; `None` if it
    /// never is, or if the price is no less than `room`.
    fn guard(
        &mut self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        position: u32,
        slot: u32,
        room: f32,
    ) -> Option<(Phase, f32)> {
        let neighbour = self.ring.neighbours()[slot as usize];
        if !self.is_open_to(mesh, setting, &neighbour) {
            return None;
        }
        let unit = self.ring.area * neighbour.offset().length_squared();
        let likeness = self.map_wedges(mesh, setting, neighbour.position)?;
        let smear = match likeness {
            OTHER_TAG => TAG_PRICE * unit,
            likeness if likeness < SMEAR_LIMIT => SMEAR_PRICE * unit,
            _ => 0.0,
        };
        if smear >= room {
            return None;
        }
        let (phase, price) =
            if self.ring.chain.is_none() || !self.link_holds(mesh, position, neighbour.position) {
                (Phase::Topology, RELAXED_PRICE * unit + smear)
            } else {
                (if smear > 0.0 { Phase::Smear } else { Phase::Strict }, smear)
            };
        (price < room).then_some((phase, price))
    }

    /// Whether an edge between two locked positions, the target one of them, would lose its last triangle: this is
    /// brings no other triangle to it, and another cell may still have the edge.
    fn bares(&self, setting: &Setting<'_>, target: u32) -> bool {
        let dying = || self.ring.faces().filter(|face| face.touches(target));
        let mut thirds = dying().flat_map(|face| face.positions).filter(|&third| third != target);
        thirds.any(|third| {
            let all_die = |slot: usize| {
                let die = dying().filter(|face| face.touches(third)).count();
                self.ring.neighbours()[slot].faces as usize == die
            };
            setting.locked[third as usize] && self.ring.slot(third).is_some_and(all_die)
        })
    }

    /// The link condition (Dey et al. 1999): the two ends have no common neighbour but across the edge's own
    /// triangles, and no triangle of the one would fall onto one of the other.
    fn link_holds(&mut self, mesh: &CornerMesh<impl Number>, position: u32, target: u32) -> bool {
        self.across.clear();
        self.across.resize(self.ring.neighbours().len(), false);
        for face in self.ring.faces().filter(|face| face.touches(target)) {
            for slot in face.positions.into_iter().filter_map(|p| self.ring.slot(p)) {
                self.across[slot] = true;
            }
        }
        if mesh.valence(target) <= HUB {
            return !mesh.faces(target).any(|face| !face.touches(position) && self.breaks(face));
        }
        let others = || self.ring.neighbours().iter().filter(|n| n.position != target);
        // Between two hubs nobody can tell in bounded time.
        if others().map(|n| mesh.valence(n.position)).sum::<u32>() > MOST_ASKED {
            return false;
        }
        let on_target = |face: &Face| face.touches(target) && !face.touches(position);
        !others().any(|n| {
            mesh.faces(n.position).filter(on_target).any(|face| {
                let [a, b] = face.positions;
                self.breaks(Face { positions: [n.position, if a == target { b } else { a }], ..face })
            })
        })
    }

    /// Whether a triangle of the target would meet the ring where it must not.
    fn breaks(&self, face: Face) -> bool {
        let [a, b] = face.positions.map(|p| self.ring.slot(p));
        let stray = |slot: Option<usize>| slot.is_some_and(|slot| !self.across[slot]);
        stray(a) || stray(b) || a.is_some() && b.is_some() && self.ring.has_face(face.positions)
    }

    /// Finds for every wedge of the position the wedge of the target that it becomes, and the least cosine between
    /// the normals of those that share no triangle; `None` if the target has no wedge to offer.
    pub fn map_wedges(
        &mut self,
        mesh: &CornerMesh<impl Number>,
        setting: &Setting<'_>,
        target: u32,
    ) -> Option<f32> {
        self.mapping.clear();
        let mut least = 1f32;
        let mut last = NONE;
        for i in 0..self.ring.faces().len() {
            let wedge = self.ring.face(i).wedge;
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
        let mut last = NONE;
        self.ring.faces().filter(move |face| face.wedge == wedge).filter_map(move |face| {
            let i = face.positions.iter().position(|&p| p == target)?;
            let shared = face.wedges[i];
            (std::mem::replace(&mut last, shared) != shared).then_some(shared)
        })
    }

    /// The diagonal of the box of some positions.
    pub fn piece_size(&self, positions: &[u32]) -> f32 {
        let points = || positions.iter().map(|&p| self.ring.point(p));
        (points().fold(Vec3::NEG_INFINITY, Vec3::max) - points().fold(Vec3::INFINITY, Vec3::min)).length()
    }
}
