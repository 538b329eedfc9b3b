//! A welded mesh in, the order of all its edge collapses out.
//!
//! This work is based on: Garland & Heckbert 1997 (quadrics), Lindstrom & Turk 1998 (memoryless costs), Peng & Cao 2012
//! section 4.2 (the recorded sequence). Half-edge collapses: the target is an end of the edge, so every level uses a
//! subset of the vertices. A position and all its wedges go in one step, a [`Group`].
//!
//! 1. Every position waits in a queue with the cost of its best collapse (`evaluate.rs`, `queue.rs`).
//! 2. The cheapest is looked at again; if it is still the cheapest it collapses (`mesh.rs`), its target is looked at
//!    anew, and neighbours that had been stuck get another chance. The others wait: their stale cost is corrected when
//!    they come up.
//! 3. A position that the guards leave no collapse gets one by relaxing them ([`Phase`]), at a price in cost, so that
//!    what is stuck does not stay while everything around it goes.
//! 4. Small pieces that nothing can collapse any further vanish whole, at the price of their size; at the end all
//!    that are left do, the smallest first. The largest stays; of a sheet of two triangles back to back, one.

mod boxes;
mod drift;
mod evaluate;
mod four;
mod mesh;
mod queue;
mod ring;

use glam::Vec3;

use super::adjacency::{PositionEdge, open_positions, position_edges};
use super::record::{Attributes, MAX_PART_VERTICES, Stall, VertexRecord};
use super::weld::WeldedMesh;
use boxes::{Boxes, Found, GONE};
use drift::{Drift, NOTABLE, squared_distance};
use evaluate::{Action, Candidate, Evaluator, LARGEST_PIECE, Setting};
use mesh::{CornerMesh, Face, HUB, Number, Witness};
use queue::BucketQueue;
use ring::Place;

pub(crate) use evaluate::FLIP_LIMIT;

/// A distance to a part of what is left that is more than so many times the error so far is settled by a search.
const LEAP: f32 = 1.2;
/// What is so near, in grid steps, is rounding.
const ROUNDING: f32 = 0.5;
/// Searches for the triangle nearest to a point open so many boxes for each of the mesh.
const LOOKS: usize = 4;
/// The same for what is nearest to pieces that have gone.
const PIECE_LOOKS: usize = 8;
/// A step is taken unless another may cost less than this share of it: closer than that, looking twice is worth
/// nothing.
const SLACK: f32 = 0.8;
/// An error is stated so many times as large as it is found: what is looked at are points, and others may be farther.
const MARGIN: f32 = 1.1;

/// What may happen to open boundaries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Boundary {
    /// They slide along themselves, held in place by boundary quadrics.
    #[default]
    Slide,
    /// They are locked, as in the paper (section 4.1).
    Lock,
}

/// Which guards hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// No triangle turns beyond [`flip_limit`], no wedge takes on attributes across a crease, topology is kept.
    Strict,
    /// Creases may smear.
    Smear,
    /// Topology may change as well: holes close, handles break, sheets meet.
    Topology,
    /// Triangles may turn as well.
    Free,
    /// A piece vanishes whole.
    Vanish,
}

impl Phase {
    /// Whether no triangle turns beyond [`flip_limit`].
    pub fn keeps_sides(self) -> bool {
        self <= Self::Topology
    }

    /// Whether the surface stays manifold where it was.
    pub fn keeps_topology(self) -> bool {
        self <= Self::Smear
    }
}

/// The least cosine between a triangle's normals before and after a collapse that keeps the sides.
pub fn flip_limit() -> f32 {
    FLIP_LIMIT
}

/// Where a wedge goes when it is removed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Onto this wedge, which is removed later or never.
    Wedge(u32),
    /// Nowhere in particular: no triangle that is left, now or later, has a corner that resolves to it.
    Anywhere,
}

/// A wedge that is removed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Its number.
    pub wedge: u32,
    /// Where it goes; itself if nowhere in particular.
    to: u32,
}

impl Move {
    fn new(wedge: u32, target: Target) -> Self {
        match target {
            Target::Wedge(to) => Self { wedge, to },
            Target::Anywhere => Self { wedge, to: wedge },
        }
    }

    /// Where it goes.
    pub fn target(&self) -> Target {
        if self.to == self.wedge { Target::Anywhere } else { Target::Wedge(self.to) }
    }
}

/// One step of the order: the wedges that are removed together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group {
    /// Its wedges: `moves[previous.moves_end..moves_end]`.
    pub moves_end: u32,
    /// Its triangles: `removed[previous.removed_end..removed_end]`.
    pub removed_end: u32,
    /// Geometric error of the mesh after the step, in grid steps; never less than that of the step before.
    pub error: f32,
    /// The greatest cost of a step so far, an area times a squared distance, in grid steps: what meshes on one grid can
    /// be compared by.
    pub cost: f32,
    /// Which guards held.
    pub phase: Phase,
}

/// The recorded sequence of collapses of one mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CollapseOrder {
    /// The steps, first to be removed first.
    pub groups: Vec<Group>,
    /// Wedges in the order in which they are removed.
    pub moves: Vec<Move>,
    /// Triangles in the order in which they are removed.
    pub removed: Vec<u32>,
    /// What stops most of the positions that are left.
    pub stall: Stall,
}

impl CollapseOrder {
    /// No steps yet, and room for as many as the mesh may take.
    fn with_room_for(mesh: &WeldedMesh) -> Self {
        Self {
            groups: Vec::with_capacity(mesh.positions.len()),
            moves: Vec::with_capacity(mesh.wedges.len()),
            removed: Vec::with_capacity(mesh.triangles.len()),
            stall: Stall::default(),
        }
    }
}

/// Computes the complete collapse order of a welded mesh. `locked` has one entry per position.
pub fn collapse_order(mesh: &WeldedMesh, locked: &[bool], boundary: Boundary) -> CollapseOrder {
    let (places, grid_steps) = local_places(mesh);
    let locked = match boundary {
        Boundary::Slide => locked.to_vec(),
        Boundary::Lock => with_open_positions(mesh, locked),
    };
    let setting = Setting { wedges: &mesh.wedges, attributes: mesh.attributes, locked: &locked };
    if mesh.wedges.len().max(mesh.positions.len()) <= MAX_PART_VERTICES {
        Simplifier::<u16>::new(mesh, setting, places, grid_steps).ordered()
    } else {
        Simplifier::<u32>::new(mesh, setting, places, grid_steps).ordered()
    }
}

/// The locked positions and those on open edges.
fn with_open_positions(mesh: &WeldedMesh, locked: &[bool]) -> Vec<bool> {
    let open = open_positions(mesh, &position_edges(mesh, PositionEdge::is_open));
    locked.iter().zip(open).map(|(&locked, open)| locked || open).collect()
}

/// The colour or material of every wedge; empty if wedges have none.
fn tags_of(mesh: &WeldedMesh) -> Vec<u32> {
    let tag = |wedge: &VertexRecord| mesh.attributes.tag(wedge.attributes());
    if mesh.attributes == Attributes::Normal { Vec::new() } else { mesh.wedges.iter().map(tag).collect() }
}

/// Positions centred and scaled to unit size, and how many grid steps a unit is.
fn local_places(mesh: &WeldedMesh) -> (Vec<Place>, f32) {
    let mut low = [u32::MAX; 3];
    let mut high = [0; 3];
    for position in &mesh.positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    let extent = (0..3).map(|axis| high[axis].saturating_sub(low[axis])).max().unwrap_or(0).max(1) as f32;
    let centre = [0, 1, 2].map(|axis| (f64::from(low[axis]) + f64::from(high[axis])) / 2.0);
    let local = |p: &[u32; 3]| {
        let c = [0, 1, 2].map(|axis| ((f64::from(p[axis]) - centre[axis]) / f64::from(extent)) as f32);
        Place::new(Vec3::from(c))
    };
    (mesh.positions.iter().map(local).collect(), extent)
}

struct Simplifier<'a, N> {
    mesh: CornerMesh<N>,
    setting: Setting<'a>,
    evaluator: Evaluator,
    queue: BucketQueue<N>,
    drift: Drift,
    /// How many boxes may yet be opened in search of the triangle nearest to a point, where there is another way.
    looks: usize,
    /// How many may be opened in search of what is nearest to a piece that has gone, before any triangle will do.
    piece_looks: usize,
    /// Around the triangles as they were.
    whole: Option<Boxes>,
    /// Around those of `left`.
    rest: Option<Boxes>,
    /// All triangles that are left, and some that have gone since this was last looked at; empty until it is.
    left: Vec<u32>,
    error: f32,
    cost: f32,
    grid_steps: f32,
    order: CollapseOrder,
    wedge_gone: Vec<bool>,
    killed_wedges: Vec<u32>,
    neighbours: Vec<u32>,
    wedge_position: &'a [u32],
    welded: &'a WeldedMesh,
}

impl<'a, N: Number> Simplifier<'a, N> {
    fn new(welded: &'a WeldedMesh, setting: Setting<'a>, places: Vec<Place>, grid_steps: f32) -> Self {
        let mesh = CornerMesh::new(welded);
        let positions = mesh.position_count();
        let evaluator = Evaluator::new(places, tags_of(welded));
        Self {
            queue: BucketQueue::new(positions),
            drift: Drift::default(),
            looks: LOOKS * welded.triangles.len(),
            piece_looks: PIECE_LOOKS * welded.triangles.len(),
            whole: None,
            rest: None,
            left: Vec::new(),
            error: 0.0,
            cost: 0.0,
            grid_steps,
            order: CollapseOrder::with_room_for(welded),
            wedge_gone: vec![false; welded.wedges.len()],
            killed_wedges: Vec::new(),
            neighbours: Vec::new(),
            wedge_position: &welded.wedge_position,
            welded,
            mesh,
            setting,
            evaluator,
        }
    }

    fn ordered(mut self) -> CollapseOrder {
        self.run();
        self.order.stall = self.common_stall();
        self.vanish_pieces();
        self.order
    }

    /// Collapses until nothing may. What a step frees farther away than its neighbours is found by looking at all that
    /// is left once more; every round but the last takes a step, so this ends.
    fn run(&mut self) {
        loop {
            for position in 0..self.mesh.position_count() as u32 {
                self.enqueue(position);
            }
            let before = self.order.groups.len();
            self.drain();
            if self.order.groups.len() == before {
                return;
            }
        }
    }

    fn drain(&mut self) {
        while let Some(position) = self.queue.pop() {
            let Ok(best) = self.evaluate(position) else { continue };
            if self.queue.has_cheaper_than(SLACK * best.cost) {
                self.queue.set(position, best.cost);
                continue;
            }
            self.cost = self.cost.max(best.cost);
            match best.action {
                Action::Collapse(target) => self.collapse(position, target, best.phase),
                Action::Vanish => {
                    let piece = std::mem::take(&mut self.evaluator.piece);
                    self.vanish(&piece);
                    self.evaluator.piece = piece;
                }
            }
        }
    }

    fn evaluate(&mut self, position: u32) -> Result<Candidate, Stall> {
        self.evaluator.best(&mut self.mesh, &self.setting, position)
    }

    /// Queues a position at the least that its collapse can cost.
    fn enqueue(&mut self, position: u32) {
        let alive = self.mesh.valence(position) > 0;
        match alive.then(|| self.evaluator.bound(&mut self.mesh, &self.setting, position)).flatten() {
            Some(cost) => self.queue.set(position, cost),
            None => self.queue.remove(position),
        }
    }

    /// Collapses a position, whose ring the evaluator has just looked at, onto a neighbour.
    fn collapse(&mut self, position: u32, target: u32, phase: Phase) {
        // The evaluator has just found it among the neighbours.
        let slot = self.evaluator.ring.slot(target).unwrap_or(0) as u32;
        // The target may have other triangles.
        let stays = self.evaluator.ring.faces().len() < self.mesh.valence(target) as usize;
        let gone = self.ends_ring(target).then(|| match stays {
            true => self.points_of(&[position]),
            false => self.points_of(&[position, target]),
        });
        let (carried, witness) =
            self.drift.carry(&mut self.mesh, &self.evaluator.ring, position, slot, self.error);
        let bowed = self.bowed(slot);
        self.evaluator.map_wedges(&self.mesh, &self.setting, target);
        for i in 0..self.evaluator.mapping.len() {
            let (from, to) = self.evaluator.mapping[i];
            self.remove_wedge(from, Target::Wedge(to));
        }
        self.evaluator.forget_neighbours();
        self.move_faces(target);
        self.mesh.drop_list(position);
        let carried = match gone {
            Some(points) => self.distance_to_rest(&points, stays.then_some(target)),
            None if self.looks == 0 || carried <= LEAP * self.error => carried,
            None => self.settled(carried, witness),
        };
        self.error = bowed.max(carried);
        self.remove_unused_wedges();
        self.close_group(phase);
        self.look_again(target);
    }

    /// The error so far, or how far the middles of new edges are from the mesh as it was, if that is more.
    fn bowed(&mut self, slot: u32) -> f32 {
        let ring = &self.evaluator.ring;
        if self.drift.bow(ring, slot, self.error.max(ROUNDING / self.grid_steps)).is_empty() {
            return self.error;
        }
        let (ring, welded) = (&self.evaluator.ring, self.welded);
        let corners = |triangle: usize| {
            welded.corner_positions(welded.triangles[triangle]).map(|position| ring.point(position))
        };
        let whole = self.whole.get_or_insert_with(|| Boxes::new(welded.triangles.len(), corners));
        let mut farthest = self.error * self.error;
        for middle in self.drift.bowed() {
            let distance = if self.looks > 0 {
                let limits = [middle.to_end, farthest];
                let found = whole.nearest(corners, middle.point, limits, self.looks);
                self.looks = self.looks.saturating_sub(found.opened);
                // A search that has opened enough boxes ends with what it has; the ring is no farther than the error so far.
                found.squared.min((middle.to_ring.sqrt() + self.error).powi(2))
            } else {
                middle.to_ring
            };
            farthest = farthest.max(distance);
        }
        farthest.sqrt()
    }

    fn remove_wedge(&mut self, wedge: u32, target: Target) {
        self.wedge_gone[wedge as usize] = true;
        self.order.moves.push(Move::new(wedge, target));
    }

    /// Kills the ring's triangles at the target and hands the others over to it.
    fn move_faces(&mut self, target: u32) {
        self.killed_wedges.clear();
        let Evaluator { ring, mapping, .. } = &self.evaluator;
        for face in ring.faces().filter(|face| face.touches(target)) {
            self.killed_wedges.extend(self.mesh.kill(face.triangle()));
            self.order.removed.push(face.triangle());
        }
        for face in ring.faces().filter(|face| !face.touches(target)) {
            if let Some(&(_, to)) = mapping.iter().find(|entry| entry.0 == face.wedge) {
                self.mesh.repoint(face.corner, to, target);
            }
        }
    }

    /// Wedges that lost their last triangle leave in the same step.
    fn remove_unused_wedges(&mut self) {
        let mut killed = std::mem::take(&mut self.killed_wedges);
        killed.retain(|&wedge| !self.mesh.is_named(wedge) && !self.wedge_gone[wedge as usize]);
        killed.sort_unstable();
        killed.dedup();
        for &wedge in &killed {
            let position = self.wedge_position[wedge as usize];
            let sibling = self.mesh.live_wedges(position).next();
            self.remove_wedge(wedge, sibling.map_or(Target::Anywhere, Target::Wedge));
        }
        self.killed_wedges = killed;
    }

    fn close_group(&mut self, phase: Phase) {
        self.order.groups.push(Group {
            moves_end: self.order.moves.len() as u32,
            removed_end: self.order.removed.len() as u32,
            error: MARGIN * self.error * self.grid_steps,
            cost: self.cost * self.grid_steps.powi(4),
            phase,
        });
    }

    /// The target has a new ring, and neighbours that were stuck may be free now. A hub waits for its turn, so that a
    /// look at all of it is not part of every step beside it.
    fn look_again(&mut self, target: u32) {
        self.neighbours.clear();
        self.neighbours.extend(self.evaluator.ring.neighbours().iter().map(|n| n.position));
        for i in 0..self.neighbours.len() {
            let neighbour = self.neighbours[i];
            let changed = neighbour == target && self.mesh.valence(neighbour) <= HUB;
            if changed || !self.queue.contains(neighbour) {
                self.enqueue(neighbour);
            }
        }
    }

    /// The guard that stops most of the positions that are left.
    fn common_stall(&mut self) -> Stall {
        let mut counts = [0usize; 5];
        for position in 0..self.mesh.position_count() as u32 {
            if self.mesh.valence(position) > 0
                && let Err(stall) = self.evaluate(position)
            {
                counts[stall as usize] += 1;
            }
        }
        let most = (1..counts.len() as u8).rev().max_by_key(|&cause| counts[cause as usize]).unwrap_or(0);
        if counts[most as usize] == 0 { Stall::None } else { Stall::from_byte(most).unwrap_or_default() }
    }

    /// Removes connected pieces whole, the smallest first, until one is left. Pieces with locked positions stay.
    fn vanish_pieces(&mut self) {
        let mut pieces = self.pieces();
        pieces.sort_by(|a, b| a.size.total_cmp(&b.size).then(a.positions[0].cmp(&b.positions[0])));
        pieces.pop();
        for piece in pieces.iter().filter(|piece| !piece.locked) {
            self.vanish(&piece.positions);
        }
        self.vanish_back();
    }

    /// Of two triangles back to back, when nothing else is left, one goes: it is the same sheet, drawn from both sides. Each
    /// must have three wedges of its own.
    fn vanish_back(&mut self) {
        self.find_left();
        let &[front, back] = self.left.as_slice() else { return };
        let faces = self.mesh.positions_of(front);
        let apart = |&p: &u32| {
            faces.contains(&p) && !self.setting.locked[p as usize] && self.mesh.live_wedges(p).count() == 2
        };
        if !self.mesh.positions_of(back).iter().all(apart) {
            return;
        }
        let Some(&gone) = [back, front].iter().find(|&&gone| self.leaves_nothing_open(front ^ back ^ gone))
        else {
            return;
        };
        for wedge in self.mesh.kill(gone) {
            self.remove_wedge(wedge, Target::Anywhere);
        }
        self.order.removed.push(gone);
        self.close_group(Phase::Vanish);
    }

    /// Whether all triangles that have gone stay without an area when the wedges of this one are all that is left: one
    /// may have had corners in both of the last two triangles, at one position.
    fn leaves_nothing_open(&self, kept: u32) -> bool {
        let kept = self.mesh.wedges(kept);
        let first = kept.iter().copied().min().unwrap_or(0);
        let mut ends = vec![first; self.wedge_position.len()];
        kept.iter().for_each(|&wedge| ends[wedge as usize] = wedge);
        for gone in self.order.moves.iter().rev() {
            if let Target::Wedge(to) = gone.target() {
                ends[gone.wedge as usize] = ends[to as usize];
            }
        }
        self.order.removed.iter().all(|&triangle| {
            let [a, b, c] = self.mesh.wedges(triangle).map(|wedge| ends[wedge as usize]);
            a == b || b == c || c == a
        })
    }

    /// Removes all of a connected piece in one step.
    fn vanish(&mut self, piece: &[u32]) {
        let points = self.points_of(piece);
        for &position in piece {
            for wedge in self.mesh.wedges_of(position) {
                if !self.wedge_gone[wedge as usize] {
                    self.remove_wedge(wedge, Target::Anywhere);
                }
            }
            let triangles: Vec<u32> = self.mesh.faces(position).map(|face| face.triangle()).collect();
            for triangle in triangles {
                self.mesh.kill(triangle);
                self.order.removed.push(triangle);
            }
        }
        self.error = self.distance_to_rest(&points, None);
        self.close_group(Phase::Vanish);
    }

    /// Whether a collapse onto this neighbour leaves nothing of the ring, so that no triangle takes its place: a piece ends, or
    /// what is left of it is joined to others in single positions.
    fn ends_ring(&self, target: u32) -> bool {
        self.evaluator.ring.faces().all(|face| face.touches(target))
    }

    /// Positions, what is around them and the witnesses there; of a large piece only some.
    fn points_of(&self, piece: &[u32]) -> Vec<Witness> {
        let some = piece.iter().step_by(piece.len().div_ceil(LARGEST_PIECE));
        let points = some.flat_map(|&position| {
            let at_face = |face: Face| {
                let witness = self.mesh.witness(face.triangle());
                face.positions.into_iter().map(|other| [other; 2]).chain(witness)
            };
            let around = self.mesh.faces(position).take(LARGEST_PIECE).flat_map(at_face);
            std::iter::once([position; 2]).chain(around)
        });
        let mut points: Vec<Witness> = points.collect();
        points.sort_unstable();
        points.dedup();
        points
    }

    /// The error so far, or how far points that have just gone, with all that they were connected to, are from what is
    /// left, if that is more; or from a position that is left. The triangle nearest to the farthest of them remembers it.
    fn distance_to_rest(&mut self, gone: &[Witness], stays: Option<u32>) -> f32 {
        let mut farthest = (0.0, None);
        let mut error = self.error;
        for &witness in gone {
            let point = self.evaluator.ring.witness_point(witness);
            let most = stays.map_or(f32::INFINITY, |at| self.evaluator.ring.point(at).distance(point));
            let (squared, triangle) = if most > error {
                let found = self.nearest_left(point, [most, error], self.piece_looks);
                self.piece_looks = self.piece_looks.saturating_sub(found.opened);
                (found.squared, found.triangle.map(|triangle| self.left[triangle]))
            } else {
                (most * most, None)
            };
            error = error.max(squared.sqrt());
            if squared > farthest.0 {
                let beside = || Some(self.mesh.faces(stays?).next()?.triangle());
                farthest = (squared, triangle.or_else(beside).map(|triangle| (triangle, witness)));
            }
        }
        if let (squared, Some((triangle, witness))) = farthest
            && squared > (NOTABLE * error).powi(2)
        {
            self.hand_on(triangle, witness, squared);
        }
        error
    }

    /// How far a witness is from what is left, of which only a part has been looked at. The nearest triangle takes it.
    fn settled(&mut self, distance: f32, witness: Witness) -> f32 {
        let point = self.evaluator.ring.witness_point(witness);
        let found = self.nearest_left(point, [distance, self.error], self.looks);
        self.looks = self.looks.saturating_sub(found.opened);
        if let Some(triangle) = found.triangle {
            self.drift.take_back(&mut self.mesh, &self.evaluator.ring, witness);
            if found.squared > (NOTABLE * self.error).powi(2) {
                self.hand_on(self.left[triangle], witness, found.squared);
            }
        }
        found.squared.sqrt()
    }

    /// Gives a triangle that is left a witness, at this squared distance, unless it has one farther away.
    fn hand_on(&mut self, triangle: u32, witness: Witness, squared: f32) {
        let ring = &self.evaluator.ring;
        let corners = self.mesh.positions_of(triangle).map(|position| ring.point(position));
        let own = self.mesh.witness(triangle).map(|own| squared_distance(ring.witness_point(own), corners));
        if own.is_none_or(|own| own < squared) {
            self.mesh.set_witness(triangle, Some(witness));
        }
    }

    /// The triangle of what is left that is nearest to a point, if it is nearer than `most`; one of at most `enough` may
    /// be another.
    fn nearest_left(&mut self, point: Vec3, [most, enough]: [f32; 2], looks: usize) -> Found {
        if self.left.is_empty() || 2 * self.mesh.live_triangles <= self.left.len() {
            self.find_left();
            self.rest = None;
        }
        let rest = self.rest.take();
        let mut rest = rest.unwrap_or_else(|| Boxes::new(self.left.len(), |i| self.corners_left(i)));
        let limits = [most * most, enough * enough];
        let found = rest.nearest(|i| self.corners_left(i), point, limits, looks);
        self.rest = Some(rest);
        found
    }

    /// Lists what is left.
    fn find_left(&mut self) {
        if self.left.is_empty() {
            let all = 0..self.welded.triangles.len() as u32;
            self.left.reserve_exact(self.mesh.live_triangles);
            self.left.extend(all.filter(|&triangle| self.mesh.is_alive(triangle)));
        } else {
            self.left.retain(|&triangle| self.mesh.is_alive(triangle));
        }
    }

    fn corners_left(&self, i: usize) -> [Vec3; 3] {
        let triangle = self.left[i];
        let corners = || self.mesh.positions_of(triangle).map(|position| self.evaluator.ring.point(position));
        if self.mesh.is_alive(triangle) { corners() } else { GONE }
    }

    fn pieces(&self) -> Vec<Piece> {
        let mut seen = vec![false; self.mesh.position_count()];
        let mut pieces = Vec::new();
        for start in 0..self.mesh.position_count() as u32 {
            if self.mesh.valence(start) > 0 && !seen[start as usize] {
                pieces.push(self.piece_around(start, &mut seen));
            }
        }
        pieces
    }

    fn piece_around(&self, start: u32, seen: &mut [bool]) -> Piece {
        let mut positions = vec![start];
        seen[start as usize] = true;
        let mut at = 0;
        while at < positions.len() {
            for face in self.mesh.faces(positions[at]) {
                for other in face.positions {
                    if !std::mem::replace(&mut seen[other as usize], true) {
                        positions.push(other);
                    }
                }
            }
            at += 1;
        }
        let locked = positions.iter().any(|&p| self.setting.locked[p as usize]);
        Piece { size: self.evaluator.piece_size(&positions), locked, positions }
    }
}

/// A connected piece of what is left.
struct Piece {
    positions: Vec<u32>,
    /// Its diagonal.
    size: f32,
    locked: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::weld::{grid_of, weld};
    use crate::import::SourceMesh;

    /// Waves over a square, with an edge.
    fn waves(side: u32) -> WeldedMesh {
        let point = |i: u32| {
            let [x, y] = [i % side, i / side].map(|c| c as f32);
            [x, y, (0.4 * x).sin() * (0.3 * y).cos() + if x > 12.0 { 3.0 } else { 0.0 }]
        };
        let cell = |i: u32| [[i, i + 1, i + side], [i + 1, i + side + 1, i + side]];
        let cells = (0..(side - 1) * side).filter(|i| i % side + 1 < side);
        let mesh = SourceMesh {
            positions: (0..side * side).map(point).collect(),
            triangles: cells.flat_map(cell).collect(),
            ..SourceMesh::default()
        };
        weld(&mesh, grid_of(&mesh).unwrap())
    }

    #[test]
    fn the_order_does_not_depend_on_how_wide_numbers_are() {
        let mesh = waves(40);
        let locked = vec![false; mesh.positions.len()];
        let setting = || Setting { wedges: &mesh.wedges, attributes: mesh.attributes, locked: &locked };
        let (places, steps) = local_places(&mesh);
        let narrow = Simplifier::<u16>::new(&mesh, setting(), places.clone(), steps).ordered();
        let wide = Simplifier::<u32>::new(&mesh, setting(), places, steps).ordered();
        assert_eq!(narrow, wide);
        assert!(narrow.groups.len() > 1_000);
        assert_eq!(collapse_order(&mesh, &locked, Boundary::Slide), wide);
    }
}
