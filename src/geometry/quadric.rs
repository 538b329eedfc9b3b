//! Quadrics: the weighted sum of squared distances to a set of planes (Garland & Heckbert 1997), in f32.
//!
//! All planes go through the position that the quadric belongs to (memoryless: Lindstrom & Turk 1998), so that it is a
//! symmetric matrix alone, and f32 is enough.

use glam::{Vec3, Vec4};

/// `x -> x A x` for `x` relative to the position that the quadric belongs to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quadric {
    diagonal: Vec3,
    /// `A_xy, A_xz, A_yz`.
    off_diagonal: Vec3,
}

impl Quadric {
    /// Adds a plane through the quadric's own position; `normal` is a unit vector, or a longer one with a weight that
    /// is less by the square of its length.
    pub fn add_plane(&mut self, normal: Vec3, weight: f32) {
        let weighted = normal * weight;
        self.diagonal += weighted * normal;
        self.off_diagonal += Vec3::new(weighted.x * normal.y, weighted.x * normal.z, weighted.y * normal.z);
    }

    /// The values at four points, given by their coordinates, as [`Self::at`] has them.
    #[inline(always)]
    pub(super) fn at_four(self, [x, y, z]: [Vec4; 3]) -> Vec4 {
        let squares = x * x * self.diagonal.x + y * y * self.diagonal.y + z * z * self.diagonal.z;
        let o = self.off_diagonal;
        (squares + 2.0 * (x * y * o.x + x * z * o.y + y * z * o.z)).max(Vec4::ZERO)
    }

    /// The value at a point relative to the quadric's position, never negative.
    pub fn at(self, x: Vec3) -> f32 {
        let cross = Vec3::new(x.x * x.y, x.x * x.z, x.y * x.z);
        (self.diagonal.dot(x * x) + 2.0 * self.off_diagonal.dot(cross)).max(0.0)
    }
}

/// The sum of planes through one position, four of them at a time.
#[derive(Default)]
pub(super) struct Planes {
    diagonal: [Vec4; 3],
    off_diagonal: [Vec4; 3],
}

impl Planes {
    /// Adds four planes, as [`Quadric::add_plane`] adds one.
    #[inline(always)]
    pub fn add(&mut self, [x, y, z]: [Vec4; 3], weight: Vec4) {
        let weighted = [x * weight, y * weight, z * weight];
        for (sum, term) in self.diagonal.iter_mut().zip([weighted[0] * x, weighted[1] * y, weighted[2] * z]) {
            *sum += term;
        }
        for (sum, term) in
            self.off_diagonal.iter_mut().zip([weighted[0] * y, weighted[0] * z, weighted[1] * z])
        {
            *sum += term;
        }
    }

    /// The quadric of all of them.
    pub fn sum(&self) -> Quadric {
        let sum = |terms: &[Vec4; 3]| Vec3::from(terms.map(Vec4::element_sum));
        Quadric { diagonal: sum(&self.diagonal), off_diagonal: sum(&self.off_diagonal) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_quadric_is_the_sum_of_squared_distances(
            normals in prop::collection::vec(prop::array::uniform3(-1f32..1.0), 1..8),
            at in prop::array::uniform3(-1f32..1.0),
        ) {
            let normals: Vec<Vec3> = normals.into_iter().map(|n| Vec3::from(n).normalize_or(Vec3::Z)).collect();
            let at = Vec3::from(at);
            let mut quadric = Quadric::default();
            for &normal in &normals {
                quadric.add_plane(normal, 2.0);
            }
            let direct: f32 = normals.iter().map(|n| 2.0 * n.dot(at).powi(2)).sum();
            prop_assert!((quadric.at(at) - direct).abs() < 1e-4, "{} is not {direct}", quadric.at(at));
        }
    }
}
