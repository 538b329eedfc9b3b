//! Four vectors at once, coordinate by coordinate: what is asked of every triangle of a ring is asked of four in one go,
//! without a branch that no processor could guess.

use std::ops::{Add, Mul, Sub};

use glam::{BVec4A, Mat4, Vec3, Vec4, Vec4Swizzles};

/// Four vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Four {
    pub x: Vec4,
    pub y: Vec4,
    pub z: Vec4,
}

impl Four {
    pub const ZERO: Self = Self { x: Vec4::ZERO, y: Vec4::ZERO, z: Vec4::ZERO };

    /// The same vector four times.
    #[inline(always)]
    pub fn splat(v: Vec3) -> Self {
        Self { x: Vec4::splat(v.x), y: Vec4::splat(v.y), z: Vec4::splat(v.z) }
    }

    /// Four vectors whose fourth coordinate is nothing.
    #[inline(always)]
    pub fn of([a, b, c, d]: [Vec4; 4]) -> Self {
        let rows = Mat4::from_cols(a, b, c, d).transpose();
        Self { x: rows.x_axis, y: rows.y_axis, z: rows.z_axis }
    }

    /// One of them.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Vec4 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    #[inline(always)]
    pub fn length_squared(self) -> Vec4 {
        self.dot(self)
    }

    /// The sum of the four.
    #[inline(always)]
    pub fn sum(self) -> Vec3 {
        Vec3::new(self.x.element_sum(), self.y.element_sum(), self.z.element_sum())
    }
}

impl Add for Four {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for Four {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Vec4> for Four {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: Vec4) -> Self {
        Self { x: self.x * by, y: self.y * by, z: self.z * by }
    }
}

/// A point as [`Four::of`] takes it.
#[inline(always)]
pub(super) fn widened(v: Vec3) -> Vec4 {
    Vec4::from((v, 0.0))
}

/// What [`widened`] was made of.
#[inline(always)]
pub(super) fn narrowed(v: Vec4) -> Vec3 {
    v.xyz()
}

/// The squared distances from points to triangles, one to one: the plane's above a triangle, else the nearest side's.
#[inline(always)]
pub(super) fn squared_distances(p: Four, [a, b, c]: [Four; 3]) -> Vec4 {
    let (ab, ac, bc, ap) = (b - a, c - a, c - b, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let (bb, cc, mixed) = (ab.length_squared(), ac.length_squared(), ab.dot(ac));
    let sides = to_segment(ap, ab, d1, bb).min(to_segment(ap, ac, d2, cc));
    let bp = ap - ab;
    let sides = sides.min(to_segment(bp, bc, bp.dot(bc), bc.length_squared()));
    let (v, w) = (cc * d1 - mixed * d2, bb * d2 - mixed * d1);
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    let above = normal.dot(ap);
    let inside = v.cmpge(Vec4::ZERO) & w.cmpge(Vec4::ZERO) & (v + w).cmple(area) & area.cmpgt(Vec4::ZERO);
    Vec4::select(inside, above * above / area, sides)
}

/// The squared distances from points to segments that start at the origin; `along` is the dot product of the two,
/// `square` that of the segment with itself.
#[inline(always)]
fn to_segment(p: Four, segment: Four, along: Vec4, square: Vec4) -> Vec4 {
    let t = (along / square.max(Vec4::splat(f32::MIN_POSITIVE))).max(Vec4::ZERO).min(Vec4::ONE);
    (p - segment * t).length_squared()
}

/// Where a list of four numbers has this one.
#[inline(always)]
pub(super) fn equal(list: Vec4, number: f32) -> BVec4A {
    list.cmpeq(Vec4::splat(number))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::drift::squared_distance;
    use super::*;

    proptest! {
        #[test]
        fn distances_are_those_of_one_triangle(
            c in prop::collection::vec(-1f32..1.0, 48),
            flat in prop::bool::ANY,
        ) {
            let point = |i: usize| Vec3::new(c[3 * i], c[3 * i + 1], if flat { 0.0 } else { c[3 * i + 2] });
            let four = |i: usize| Four::of([0, 1, 2, 3].map(|lane| widened(point(4 * i + lane))));
            let ours = squared_distances(four(0), [four(1), four(2), four(3)]);
            for lane in 0..4 {
                let corners = [4, 8, 12].map(|i| point(i + lane));
                let one = squared_distance(point(lane), corners);
                prop_assert!((ours[lane] - one).abs() < 1e-4, "{} is not {one}", ours[lane]);
            }
        }
    }

    #[test]
    fn a_triangle_without_area_is_as_far_as_its_sides() {
        let at = |x: f32| Four::splat(Vec3::new(x, 0.0, 0.0));
        let p = Four::splat(Vec3::new(0.5, 2.0, 0.0));
        assert_eq!(squared_distances(p, [at(0.0), at(0.0), at(1.0)]), Vec4::splat(4.0));
        assert_eq!(squared_distances(p, [at(0.5); 3]), Vec4::splat(4.0));
    }
}
