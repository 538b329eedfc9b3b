//! Quadrics: the weighted sum of squared distances to a set of planes (Garland & Heckbert 1997), in f32.
//!
//! A quadric is kept relative to the position it belongs to, so that its terms stay near zero and f32 is enough;
//! it is moved when its vertex collapses onto another. The memoryless half (Lindstrom & Turk 1998) needs only planes
//! through that position, which is the symmetric matrix alone.

use glam::Vec3;

/// `x -> x A x + 2 b x + c` for `x` relative to the position that the quadric belongs to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quadric {
    diagonal: Vec3,
    /// `A_xy, A_xz, A_yz`.
    off_diagonal: Vec3,
    linear: Vec3,
    constant: f32,
}

impl Quadric {
    /// Adds a plane through the quadric's own position; `normal` is a unit vector, or a longer one with a weight that
    /// is less by the square of its length.
    pub fn add_plane(&mut self, normal: Vec3, weight: f32) {
        let weighted = normal * weight;
        self.diagonal += weighted * normal;
        self.off_diagonal += Vec3::new(weighted.x * normal.y, weighted.x * normal.z, weighted.y * normal.z);
    }

    /// Adds another quadric, scaled, that belongs to the same position.
    pub fn add(&mut self, other: Self, scale: f32) {
        self.diagonal += other.diagonal * scale;
        self.off_diagonal += other.off_diagonal * scale;
        self.linear += other.linear * scale;
        self.constant += other.constant * scale;
    }

    /// The sum of this quadric and another that belongs to the same position, each scaled.
    pub fn mixed(self, share: f32, other: Self, other_share: f32) -> Self {
        Self {
            diagonal: self.diagonal * share + other.diagonal * other_share,
            off_diagonal: self.off_diagonal * share + other.off_diagonal * other_share,
            linear: self.linear * share + other.linear * other_share,
            constant: self.constant * share + other.constant * other_share,
        }
    }

    /// The same function for a position that lies `offset` away from this one's.
    pub fn moved_by(self, offset: Vec3) -> Self {
        Self { linear: self.linear + self.times(offset), constant: self.at(offset), ..self }
    }

    fn times(self, x: Vec3) -> Vec3 {
        let (d, o) = (self.diagonal, self.off_diagonal);
        Vec3::new(
            d.x * x.x + o.x * x.y + o.y * x.z,
            o.x * x.x + d.y * x.y + o.z * x.z,
            o.y * x.x + o.z * x.y + d.z * x.z,
        )
    }

    /// The value at a point relative to the quadric's position, never negative.
    pub fn at(self, x: Vec3) -> f32 {
        (x.dot(self.times(x)) + 2.0 * self.linear.dot(x) + self.constant).max(0.0)
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
            offset in prop::array::uniform3(-1f32..1.0),
            at in prop::array::uniform3(-1f32..1.0),
        ) {
            let normals: Vec<Vec3> = normals.into_iter().map(|n| Vec3::from(n).normalize_or(Vec3::Z)).collect();
            let (offset, at) = (Vec3::from(offset), Vec3::from(at));
            let mut quadric = Quadric::default();
            for &normal in &normals {
                quadric.add_plane(normal, 2.0);
            }
            let moved = quadric.moved_by(offset);
            let direct: f32 = normals.iter().map(|n| 2.0 * n.dot(offset + at).powi(2)).sum();
            prop_assert!((moved.at(at) - direct).abs() < 1e-4, "{} is not {direct}", moved.at(at));
        }
    }
}
