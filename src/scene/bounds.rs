//! An axis-aligned box in world space, and the size that a camera may rely on.

use glam::DVec3;

use super::InstanceBox;

/// An axis-aligned box in the model's unit of length; empty while `low` exceeds `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The least corner.
    pub low: DVec3,
    /// The greatest corner.
    pub high: DVec3,
}

impl Bounds {
    /// The box of nothing, the start of a union.
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// The box between two corners.
    pub fn new(low: DVec3, high: DVec3) -> Self {
        Self { low, high }
    }

    /// Grows by a point; one that is not finite is left out.
    pub fn with_point(self, point: DVec3) -> Self {
        if point.is_finite() { Self { low: self.low.min(point), high: self.high.max(point) } } else { self }
    }

    /// Grows by an instance.
    pub fn with_box(self, instance: &InstanceBox) -> Self {
        let InstanceBox { centre, half_extent, .. } = *instance;
        self.with_point(centre - half_extent).with_point(centre + half_extent)
    }

    /// The box around both.
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Whether there is nothing, or nothing finite, in it.
    pub fn is_empty(&self) -> bool {
        !(self.low.is_finite() && self.high.is_finite() && self.low.cmple(self.high).all())
    }

    /// The centre; the origin where the box is empty.
    pub fn centre(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.low * 0.5 + self.high * 0.5 }
    }

    /// The side lengths; zero where the box is empty.
    pub fn extent(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.high - self.low }
    }

    /// The length of the diagonal; zero where the box is empty.
    pub fn diagonal(&self) -> f64 {
        self.extent().length()
    }

    /// The diagonal, or for a box of (almost) no extent a positive length near the precision of its coordinates:
    /// what cameras measure distances, steps and near planes in. Always finite and above zero.
    pub fn scale(&self) -> f64 {
        let centre = self.centre().abs().max_element();
        let floor = if centre > 0.0 { centre * 1e-7 } else { 0.0 };
        let scale = self.diagonal().max(floor);
        if scale > 1e-30 { scale.min(1e30) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_boxes_have_a_usable_scale() {
        let point = Bounds::new(DVec3::splat(1e7), DVec3::splat(1e7));
        for bounds in
            [Bounds::EMPTY, Bounds::new(DVec3::NAN, DVec3::NAN), point, Bounds::new(DVec3::MIN, DVec3::MAX)]
        {
            assert!(bounds.scale() > 0.0 && bounds.scale().is_finite(), "{bounds:?}");
            assert!(bounds.centre().is_finite());
        }
        assert_eq!(Bounds::new(DVec3::ZERO, DVec3::new(2.0, 3.0, 6.0)).scale(), 7.0);
    }

    #[test]
    fn unions_and_points_grow_a_box() {
        let one = Bounds::EMPTY.with_point(DVec3::ONE).with_point(DVec3::NAN);
        assert_eq!(one.union(Bounds::EMPTY), Bounds::new(DVec3::ONE, DVec3::ONE));
        assert_eq!(one.with_point(DVec3::ZERO).extent(), DVec3::ONE);
        assert!(Bounds::EMPTY.is_empty() && !one.is_empty());
    }
}
