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
//!    that are left do, the smallest first. The largest stays.

mod drift;
mod evaluate;
mod four;
mod mesh;
mod queue;
mod ring;

use glam::{Vec3, Vec4};

use super::adjacency::position_edges;
use super::record::{Attributes, Stall, VertexRecord};
use super::weld::WeldedMesh;
use drift::{Drift, squared_distance};
use evaluate::{Action, Candidate, Evaluator, HUB, LARGEST_PIECE, Setting};
use four::{Four, squared_distances, widened};
use mesh::CornerMesh;
use queue::BucketQueue;
use ring::Place;

pub(crate) use evaluate::FLIP_LIMIT;

/// Searches for what is left beside a piece that has gone look at so many positions for each of the mesh.
const SEARCHES: usize = 16;
/// A distance that is more than so many times the error so far is looked into.
const LEAP: f32 = 1.3;
/// Searches for the triangle nearest to a point look at so many for each of the mesh.
const LOOKS: usize = 40;
/// What is kept of them for later, for each triangle that is left.
const LATER_LOOKS: usize = 24;
/// A step is taken unless another may cost less than this share of it: closer than that, looking twice is worth
/// nothing.
const SLACK: f32 = 0.8;
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

/// One step of the order: the wedges that are removed together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group {
    /// Its wedges: `moves[previous.moves_end..moves_end]`.
    pub moves_end: usize,
    /// Its triangles: `removed[previous.removed_end..removed_end]`.
    pub removed_end: usize,
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
    /// Wedges in the order in which they are removed, and where each goes.
    pub moves: Vec<(u32, Target)>,
    /// Triangles in the order in which they are removed.
    pub removed: Vec<u32>,
    /// What stops most of the positions that are left.
    pub stall: Stall,
}

/// Computes the complete collapse order of a welded mesh. `locked` has one entry per position.
pub fn collapse_order(mesh: &WeldedMesh, locked: &[bool], boundary: Boundary) -> CollapseOrder {
    let (places, grid_steps) = local_places(mesh);
    let locked = match boundary {
        Boundary::Slide => locked.to_vec(),
        Boundary::Lock => with_open_positions(mesh, locked),
    };
    let setting = Setting { wedges: &mesh.wedges, attributes: mesh.attributes, locked: &locked };
    let mut simplifier = Simplifier::new(mesh, setting, places, grid_steps);
    simplifier.run();
    simplifier.order.stall = simplifier.common_stall();
    simplifier.vanish_pieces();
    simplifier.order
}

/// The locked positions and those on open edges.
fn with_open_positions(mesh: &WeldedMesh, locked: &[bool]) -> Vec<bool> {
    let mut locked = locked.to_vec();
    for edge in position_edges(mesh).iter().filter(|edge| edge.is_open()) {
        for position in edge.ends {
            locked[position as usize] = true;
        }
    }
    locked
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

struct Simplifier<'a> {
    mesh: CornerMesh,
    setting: Setting<'a>,
    evaluator: Evaluator,
    queue: BucketQueue,
    drift: Drift,
    /// Per position, how far the boundaries and creases near it have moved along the surface.
    slid: Vec<f32>,
    /// How many positions may yet be looked at in search of what is left beside a piece that has gone.
    searches: usize,
    /// How many triangles may yet be looked at in search of the one nearest to a point.
    looks: usize,
    /// The triangles that were alive at the last such search.
    left: Vec<u32>,
    error: f32,
    cost: f32,
    grid_steps: f32,
    order: CollapseOrder,
    wedge_gone: Vec<bool>,
    killed_wedges: Vec<u32>,
    neighbours: Vec<u32>,
    wedge_position: &'a [u32],
}

impl<'a> Simplifier<'a> {
    fn new(welded: &'a WeldedMesh, setting: Setting<'a>, places: Vec<Place>, grid_steps: f32) -> Self {
        let mesh = CornerMesh::new(welded);
        let positions = mesh.position_count();
        let evaluator = Evaluator::new(places, tags_of(welded));
        Self {
            queue: BucketQueue::new(positions),
            drift: Drift::default(),
            slid: vec![0.0; positions],
            searches: SEARCHES * positions,
            looks: LOOKS * welded.triangles.len(),
            left: (0..welded.triangles.len() as u32).collect(),
            error: 0.0,
            cost: 0.0,
            grid_steps,
            order: CollapseOrder::default(),
            wedge_gone: vec![false; welded.wedges.len()],
            killed_wedges: Vec::new(),
            neighbours: Vec::new(),
            wedge_position: &welded.wedge_position,
            mesh,
            setting,
            evaluator,
        }
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
        let offset = self.evaluator.ring.point(target) - self.evaluator.ring.origin;
        let (carried, witness) =
            self.drift.carry(&mut self.mesh, &self.evaluator.ring, position, target, offset, self.error);
        let slid = self.slid[position as usize] + self.evaluator.ring.slide(offset);
        self.slid[target as usize] = self.slid[target as usize].max(slid);
        let bowed = Drift::bow(&self.evaluator.ring, target, offset, self.error.max(slid));
        self.evaluator.map_wedges(&self.mesh, &self.setting, target);
        for i in 0..self.evaluator.mapping.len() {
            let (from, to) = self.evaluator.mapping[i];
            self.remove_wedge(from, Target::Wedge(to));
        }
        self.evaluator.forget_neighbours();
        self.move_faces(target);
        self.mesh.drop_list(position);
        let carried = if self.mesh.valence(target) == 0 {
            self.distance_to_rest(&[position, target])
        } else {
            self.settled(carried, witness)
        };
        self.error = bowed.max(carried);
        self.remove_unused_wedges();
        self.close_group(phase);
        self.look_again(target);
    }

    fn remove_wedge(&mut self, wedge: u32, target: Target) {
        self.wedge_gone[wedge as usize] = true;
        self.order.moves.push((wedge, target));
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
            moves_end: self.order.moves.len(),
            removed_end: self.order.removed.len(),
            error: self.error * self.grid_steps,
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
    }

    /// Removes all of a connected piece in one step.
    fn vanish(&mut self, piece: &[u32]) {
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
        self.error = self.error.max(self.distance_to_rest(&piece[..piece.len().min(LARGEST_PIECE)]));
        self.close_group(Phase::Vanish);
    }

    /// How far positions that have just gone, with all that they were connected to, are from what is left: from the
    /// triangles around the next positions in Morton order on both sides. At least half their own size where there is
    /// none within reach, which keeps all searches together linear.
    fn distance_to_rest(&mut self, gone: &[u32]) -> f32 {
        let near = [self.next_left(gone[0], -1), self.next_left(gone[0], 1)];
        let triangles = near.into_iter().flatten().flat_map(|position| {
            let apex = self.evaluator.ring.point(position);
            self.mesh.faces(position).take(LARGEST_PIECE).map(move |face| (apex, face.positions))
        });
        let triangles: Vec<[Vec3; 3]> = triangles
            .map(|(apex, [a, b])| [apex, self.evaluator.ring.point(a), self.evaluator.ring.point(b)])
            .collect();
        let from =
            |point: Vec3| triangles.iter().map(move |&t| squared_distance(point, t)).min_by(f32::total_cmp);
        let points = gone.iter().map(|&position| self.evaluator.ring.point(position));
        let farthest =
            points.filter_map(|point| Some((from(point)?, point))).max_by(|a, b| a.0.total_cmp(&b.0));
        match farthest {
            Some((distance, point)) => self.settled(distance.sqrt(), point),
            None => 0.5 * self.evaluator.piece_size(gone),
        }
    }

    /// The distance from a point to what is left, of which only a part has been looked at. Where that would make the
    /// error much larger, all of it is looked at, as far as [`LOOKS`] goes.
    fn settled(&mut self, distance: f32, point: Vec3) -> f32 {
        if distance <= LEAP * self.error || self.looks < LATER_LOOKS * self.mesh.live_triangles {
            return distance;
        }
        self.mesh.drop_dead(&mut self.left);
        self.looks -= self.left.len();
        let point_of = |position: u32| self.evaluator.ring.point(position);
        let triangle = |&triangle: &u32| self.mesh.positions_of(triangle).map(|p| widened(point_of(p)));
        let (fours, rest) = self.left.as_chunks::<4>();
        // The last few with one of them repeated.
        let last = rest.last().map(|&last| [0, 1, 2, 3].map(|i| rest.get(i).copied().unwrap_or(last)));
        let mut nearest = Vec4::splat(distance * distance);
        for four in fours.iter().chain(&last) {
            let [a, b, c, d] = four.each_ref().map(triangle);
            let corners = [0, 1, 2].map(|k: usize| Four::of([a[k], b[k], c[k], d[k]]));
            nearest = nearest.min(squared_distances(Four::splat(point), corners));
        }
        nearest.min_element().sqrt()
    }

    /// The next position in the order of the mesh, up or down, that has a triangle left.
    fn next_left(&mut self, from: u32, step: i32) -> Option<u32> {
        let mut position = from;
        while self.searches > 0 {
            self.searches -= 1;
            position =
                position.checked_add_signed(step).filter(|&p| (p as usize) < self.mesh.position_count())?;
            if self.mesh.valence(position) > 0 {
                return Some(position);
            }
        }
        None
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
