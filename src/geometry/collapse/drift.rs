//! How far the surface has moved: points of it that are gone are carried along by the triangles that lie nearest to
//! them.
//!
//! Each live triangle has at most one witness: a removed position, or a point on an edge that went, the farthest from it
//! of all that were handed to it. A collapse hands the witnesses of the ring, the position itself and what strayed of
//! its edges to the triangles that replace the ring. Distances are to these only, so that each is at least the true
//! one; what the witnesses that were let go would have said is lost. The other way, from the new surface to the old,
//! the middles of its new edges are looked at.

use glam::Vec3;

use super::mesh::{CornerMesh, Number, QUARTER, Witness};
use super::ring::Ring;

/// At most so many distances are taken in a step, but for those of the position itself.
const MOST: usize = 512;

/// A witness is kept while its distance is more than this share of the error so far.
pub(super) const NOTABLE: f32 = 0.4;

/// Working memory, reused from step to step.
#[derive(Default)]
pub(super) struct Drift {
    /// Of each triangle of the ring, the witness that it gets if it is left.
    fan: Vec<Spoke>,
    /// Per neighbour, whether the middle of the new edge to it is known to be near.
    near: Vec<bool>,
    bowed: Vec<Bowed>,
}

/// The middle of a new edge, and its squared distances.
pub(super) struct Bowed {
    pub point: Vec3,
    /// From the ends of the edge, which are where they always were.
    pub to_end: f32,
    /// From the ring that the step replaces.
    pub to_ring: f32,
}

/// The farthest that a triangle of the new surface was handed.
#[derive(Clone, Copy)]
struct Spoke {
    farthest: f32,
    witness: Option<Witness>,
}

impl Drift {
    /// Carries the witnesses of a ring over its collapse onto the neighbour `slot`; returns the largest distance and the
    /// witness that it is of. `error` is the largest of all steps so far.
    pub fn carry(
        &mut self,
        mesh: &mut CornerMesh<impl Number>,
        ring: &Ring,
        position: u32,
        slot: u32,
        error: f32,
    ) -> (f32, Witness) {
        let least = (NOTABLE * error).powi(2);
        self.fan.clear();
        self.fan.resize(ring.faces().len(), Spoke { farthest: least, witness: None });
        let target = ring.neighbours()[slot as usize].position;
        let left = ring.faces().filter(|face| !face.touches(target)).count();
        let own = self.hand_over(ring, slot, [position; 2], Vec3::ZERO, least);
        let mut farthest = (own, [position; 2]);
        let most = MOST / left.max(1);
        let witnesses = ring.faces().take(most).filter_map(|face| mesh.witness(face.triangle()));
        for witness in witnesses {
            let point = ring.witness_point(witness);
            let distance = self.hand_over(ring, slot, witness, point - ring.origin, least);
            if distance > farthest.0 {
                farthest = (distance, witness);
            }
        }
        if left > 0 {
            let mut left = most;
            ring.strayed(slot, least, |neighbour| {
                let other = neighbour.position;
                let along = [[position, other], [position | QUARTER, other], [other | QUARTER, position]];
                // Where the middle is near, so are the quarters.
                for witness in along {
                    if left == 0 {
                        break;
                    }
                    left -= 1;
                    let point = ring.witness_point(witness);
                    let distance = self.hand_over(ring, slot, witness, point - ring.origin, least);
                    if distance > farthest.0 {
                        farthest = (distance, witness);
                    }
                    if distance <= least {
                        break;
                    }
                }
            });
        }
        for (spoke, face) in self.fan.iter().zip(ring.faces()).filter(|(_, face)| !face.touches(target)) {
            mesh.set_witness(face.triangle(), spoke.witness);
        }
        (farthest.0.sqrt(), farthest.1)
    }

    /// Finds the middles of edges that a collapse onto the neighbour `slot` makes, where they are farther than `least`
    /// from the ring that it replaces.
    pub fn bow(&mut self, ring: &Ring, slot: u32, least: f32) -> &[Bowed] {
        let least = least * least;
        self.bowed.clear();
        let most = MOST / ring.faces().len().max(1);
        ring.bends(slot, least, &mut self.near);
        self.near[slot as usize] = true;
        let offset = ring.neighbours()[slot as usize].offset();
        let others = ring.neighbours().iter().zip(&self.near);
        for (n, _) in others.filter(|&(_, near)| !near).take(most) {
            let middle = 0.5 * (n.offset() + offset);
            let nearest = ring.distance_to(middle, least);
            if nearest > least {
                let point = ring.origin + middle;
                self.bowed.push(Bowed { point, to_end: middle.distance_squared(offset), to_ring: nearest });
            }
        }
        &self.bowed
    }

    /// Takes a witness back from the triangle that it was handed to in the last step.
    pub fn take_back(&self, mesh: &mut CornerMesh<impl Number>, ring: &Ring, witness: Witness) {
        let given = self.fan.iter().zip(ring.faces()).filter(|(spoke, _)| spoke.witness == Some(witness));
        given.for_each(|(_, face)| mesh.set_witness(face.triangle(), None));
    }

    /// What [`Drift::bow`] found last.
    pub fn bowed(&self) -> &[Bowed] {
        &self.bowed
    }

    /// Hands a witness to the nearest triangle that is left; returns the squared distance, or one that is no more than
    /// `least` where that is known to be so: no triangle keeps such a witness.
    #[inline]
    fn hand_over(&mut self, ring: &Ring, slot: u32, witness: Witness, point: Vec3, least: f32) -> f32 {
        let (nearest, face) = ring.nearest_left(slot, point, least);
        if nearest == f32::INFINITY {
            return point.distance_squared(ring.neighbours()[slot as usize].offset());
        }
        let spoke = &mut self.fan[face];
        // A quarter makes no other witness forgotten: it is near one of its own ends.
        if nearest > spoke.farthest && (witness[0] & QUARTER == 0 || spoke.witness.is_none()) {
            *spoke = Spoke { farthest: nearest, witness: Some(witness) };
        }
        nearest
    }
}

/// The squared distance from a point to a triangle (Ericson, *Real-Time Collision Detection*, section 5.1.5).
#[inline]
pub(super) fn squared_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length_squared();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length_squared();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length_squared();
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let on_edge = |from: Vec3, along: Vec3, t: f32| (p - (from + along * t)).length_squared();
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on_edge(a, ab, d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on_edge(a, ac, d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on_edge(b, c - b, (d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let normal = ab.cross(ac);
    normal.dot(ap).powi(2) / normal.length_squared()
}
