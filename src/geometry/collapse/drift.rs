//! How far the surface has moved: a removed position is carried along by the triangle that lies nearest to it.
//!
//! Each live triangle has at most one witness, the removed position that is farthest from it of all that were handed
//! to it. A collapse hands the witnesses of the ring, and the position itself, to the triangles that replace the ring,
//! and the largest distance is the error of the step. Distances are to the new triangles only, so that each is at least
//! the true one; what the witnesses that were let go would have said is lost. The other way, from the new surface to the
//! old, the middles of its new edges are looked at.

use glam::Vec3;

use super::mesh::{CornerMesh, NONE};
use super::ring::Ring;

/// At most so many distances are taken in a step, but for those of the position itself.
const MOST: usize = 512;

/// A witness is kept while its distance is more than this share of the error so far.
const NOTABLE: f32 = 0.25;

/// Working memory, reused from step to step.
#[derive(Default)]
pub(super) struct Drift {
    fan: Vec<Spoke>,
}

/// A triangle of the new surface, relative to the position that goes.
struct Spoke {
    triangle: u32,
    a: Vec3,
    b: Vec3,
    farthest: f32,
    witness: u32,
}

impl Drift {
    /// Carries the witnesses of a ring over its collapse onto the neighbour `target` at `offset`; returns the largest
    /// distance and the witness that it is of. `error` is the largest of all steps so far.
    pub fn carry(
        &mut self,
        mesh: &mut CornerMesh,
        ring: &Ring,
        position: u32,
        target: u32,
        offset: Vec3,
        error: f32,
    ) -> (f32, Vec3) {
        let least = (NOTABLE * error).powi(2);
        self.fan.clear();
        self.fan.extend(ring.faces().enumerate().filter(|(_, face)| !face.touches(target)).map(
            |(i, face)| {
                let [a, b] = ring.corners(i);
                Spoke { triangle: face.triangle(), a, b, farthest: least, witness: NONE }
            },
        ));
        let mut farthest = (self.hand_over(position, Vec3::ZERO, offset, least), ring.origin);
        let most = MOST / self.fan.len().max(1);
        for face in ring.faces().take(most) {
            let witness = std::mem::replace(mesh.witness(face.triangle()), NONE);
            if witness != NONE {
                let point = ring.point(witness);
                let distance = self.hand_over(witness, point - ring.origin, offset, least);
                if distance > farthest.0 {
                    farthest = (distance, point);
                }
            }
        }
        for spoke in &self.fan {
            *mesh.witness(spoke.triangle) = spoke.witness;
        }
        (farthest.0.sqrt(), farthest.1)
    }

    /// The largest distance from the middle of an edge that a collapse makes to the ring that it replaces, or `least` if
    /// none is larger.
    pub fn bow(ring: &Ring, target: u32, offset: Vec3, least: f32) -> f32 {
        let mut farthest = least * least;
        let most = MOST / ring.faces().len().max(1);
        for n in ring.neighbours().iter().filter(|n| n.position != target).take(most) {
            let middle = 0.5 * (n.offset() + offset);
            let mut nearest = f32::INFINITY;
            // Most often one of the triangles at the neighbour is near enough.
            for face in ring.faces_at(n).into_iter().chain(0..ring.faces().len()) {
                let [a, b] = ring.corners(face);
                nearest = nearest.min(squared_distance(middle, [Vec3::ZERO, a, b]));
                if nearest <= farthest {
                    break;
                }
            }
            farthest = farthest.max(nearest);
        }
        farthest.sqrt()
    }

    /// Hands a witness to the nearest triangle; returns the squared distance, or one that is no more than `least` where
    /// that is known to be so: no triangle keeps such a witness.
    fn hand_over(&mut self, witness: u32, point: Vec3, apex: Vec3, least: f32) -> f32 {
        let mut nearest = (f32::INFINITY, usize::MAX);
        for (i, spoke) in self.fan.iter().enumerate() {
            let distance = squared_distance(point, [apex, spoke.a, spoke.b]);
            if distance <= least {
                return distance;
            }
            if distance < nearest.0 {
                nearest = (distance, i);
            }
        }
        match self.fan.get_mut(nearest.1) {
            Some(spoke) if nearest.0 > spoke.farthest => {
                spoke.farthest = nearest.0;
                spoke.witness = witness;
                nearest.0
            }
            Some(_) => nearest.0,
            None => point.distance_squared(apex),
        }
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
