//! What the user cuts away: up to six planes and a box, as shares of the model's extent, and the sections that they are.

use glam::DVec3;

use crate::passes::draw::{MOST_PLANES, Section};
use crate::scene::Bounds;

/// Which way a plane faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Facing {
    /// Across the axis of that number.
    Axis(usize),
    /// Some other way: the unit normal, towards what is kept when the plane is not turned round.
    Normal(DVec3),
}

/// One plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Which way it faces.
    pub facing: Facing,
    /// How far along its normal through the model's box: 0 cuts nothing off, 1 everything; turned round the other way.
    pub share: f64,
    /// Whether the other side is kept.
    pub is_turned: bool,
    /// Whether it cuts.
    pub is_on: bool,
}

impl Plane {
    /// Across an axis, through the middle.
    pub fn across(axis: usize) -> Self {
        Self { facing: Facing::Axis(axis), share: 0.5, is_turned: false, is_on: true }
    }

    /// Across an axis, through the middle, so that one who looks that way sees the cut.
    pub fn facing(axis: usize, forward: DVec3) -> Self {
        Self { is_turned: forward[axis] < 0.0, ..Self::across(axis) }
    }

    /// Through a point, facing along a unit normal; keeps what lies behind it.
    pub fn through(point: DVec3, normal: DVec3, bounds: &Bounds) -> Self {
        let mut plane = Self { facing: Facing::Normal(-normal), share: 0.0, is_turned: false, is_on: true };
        plane.share = share_of(plane.normal().dot(point), plane.reach(bounds)).unwrap_or(0.5);
        plane
    }

    fn normal(&self) -> DVec3 {
        match self.facing {
            Facing::Axis(axis) => DVec3::AXES[axis],
            Facing::Normal(normal) => normal,
        }
    }

    /// Where the box of the model begins and ends along the normal.
    fn reach(&self, bounds: &Bounds) -> (f64, f64) {
        let (centre, normal) = (bounds.centre().dot(self.normal()), self.normal().abs());
        let half = 0.5 * bounds.extent().dot(normal);
        (centre - half, centre + half)
    }

    /// Where it is along its normal, in the model's unit.
    pub fn place(&self, bounds: &Bounds) -> f64 {
        let (low, high) = self.reach(bounds);
        low + (high - low) * self.share
    }

    /// Puts it somewhere along its normal, in the model's unit.
    pub fn set_place(&mut self, place: f64, bounds: &Bounds) {
        self.share = share_of(place, self.reach(bounds)).unwrap_or(0.5);
    }

    fn section(&self, bounds: &Bounds) -> Section {
        let normal = self.normal();
        let centre = bounds.centre();
        let point = centre + normal * (self.place(bounds) - centre.dot(normal));
        Section { point, normal: if self.is_turned { -normal } else { normal } }
    }
}

/// How far between two ends a place is; `None` where they are one.
pub fn share_of(place: f64, (low, high): (f64, f64)) -> Option<f64> {
    (high > low).then(|| ((place - low) / (high - low)).clamp(0.0, 1.0))
}

/// A box, as shares of the model's own: low and high along each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boxed {
    /// Low, 0 to 1.
    pub low: [f64; 3],
    /// High, 0 to 1.
    pub high: [f64; 3],
}

impl Default for Boxed {
    fn default() -> Self {
        Self { low: [0.0; 3], high: [1.0; 3] }
    }
}

/// All that cuts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cuts {
    /// At most [`MOST_PLANES`].
    pub planes: Vec<Plane>,
    /// The box, if there is one.
    pub boxed: Option<Boxed>,
}

impl Cuts {
    /// Whether anything cuts.
    pub fn any(&self) -> bool {
        self.boxed.is_some() || self.planes.iter().any(|plane| plane.is_on)
    }

    /// Adds a plane if there is room.
    pub fn add(&mut self, plane: Plane) -> bool {
        let has_room = self.planes.len() < MOST_PLANES;
        if has_room {
            self.planes.push(plane);
        }
        has_room
    }

    /// All cuts off, or the last ones on; if there is none, a first plane across the longest axis, so that one who looks
    /// `forward` sees the cut.
    pub fn toggle(&mut self, bounds: &Bounds, forward: DVec3) {
        if self.any() {
            self.planes.iter_mut().for_each(|plane| plane.is_on = false);
            self.boxed = None;
        } else if self.planes.is_empty() {
            let extent = bounds.extent();
            let longest = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
            self.planes.push(Plane::facing(longest, forward));
        } else {
            self.planes.iter_mut().for_each(|plane| plane.is_on = true);
        }
    }

    /// What the renderer cuts by.
    pub fn sections(&self, bounds: &Bounds) -> Vec<Section> {
        let planes = self.planes.iter().filter(|plane| plane.is_on).map(|plane| plane.section(bounds));
        let boxed = self.boxed.iter().flat_map(|boxed| {
            let corner = |shares: [f64; 3]| bounds.low + bounds.extent() * DVec3::from_array(shares);
            Section::inside(&Bounds::new(corner(boxed.low), corner(boxed.high)))
        });
        planes.chain(boxed).collect()
    }

    /// Whether a point is kept.
    pub fn keeps(&self, point: DVec3, bounds: &Bounds) -> bool {
        self.sections(bounds).iter().all(|section| section.distance(point) >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { low: DVec3::new(-1.0, 0.0, 10.0), high: DVec3::new(3.0, 1.0, 12.0) };

    #[test]
    fn planes_cut_where_they_say() {
        let mut cuts = Cuts::default();
        assert!(cuts.keeps(DVec3::splat(1e9), &BOUNDS));
        cuts.toggle(&BOUNDS, DVec3::X);
        assert_eq!(cuts.planes[0].facing, Facing::Axis(0));
        assert_eq!(cuts.planes[0].place(&BOUNDS), 1.0);
        assert!(cuts.keeps(DVec3::new(2.0, 0.0, 0.0), &BOUNDS) && !cuts.keeps(DVec3::ZERO, &BOUNDS));
        cuts.planes[0].is_turned = true;
        assert!(cuts.keeps(DVec3::ZERO, &BOUNDS) && !cuts.keeps(DVec3::new(2.0, 0.0, 0.0), &BOUNDS));
        cuts.planes[0].set_place(-0.5, &BOUNDS);
        assert!((cuts.planes[0].share - 0.125).abs() < 1e-12);
        cuts.toggle(&BOUNDS, DVec3::X);
        assert!(!cuts.any() && cuts.sections(&BOUNDS).is_empty());
        cuts.toggle(&BOUNDS, DVec3::X);
        assert!(cuts.any());
        let mut cuts = Cuts::default();
        cuts.toggle(&BOUNDS, DVec3::NEG_X);
        assert!(cuts.planes[0].is_turned, "from the right the right half goes");
    }

    #[test]
    fn a_plane_through_a_point_keeps_what_is_behind_it() {
        let (point, normal) = (DVec3::new(1.5, 0.5, 11.0), DVec3::new(1.0, 1.0, 0.0).normalize());
        let cuts = Cuts { planes: vec![Plane::through(point, normal, &BOUNDS)], boxed: None };
        assert!(cuts.sections(&BOUNDS)[0].distance(point).abs() < 1e-12);
        assert!(cuts.keeps(point - normal * 0.1, &BOUNDS) && !cuts.keeps(point + normal * 0.1, &BOUNDS));
    }

    #[test]
    fn there_are_at_most_six_planes_and_a_box() {
        let mut cuts = Cuts { boxed: Some(Boxed::default()), ..Cuts::default() };
        assert_eq!((0..9).filter(|i| cuts.add(Plane::across(i % 3))).count(), MOST_PLANES);
        assert_eq!(cuts.sections(&BOUNDS).len(), crate::passes::draw::MOST_SECTIONS);
    }
}
