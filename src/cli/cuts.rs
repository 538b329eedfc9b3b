//! Sections as people type them, planes of a model out: `x=40%`, `-y=2.5`, and boxes of two corners.

use collapsar::passes::draw::Section;
use collapsar::scene::Bounds;
use glam::DVec3;

/// A place along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// In the model's unit of length.
    Units(f64),
    /// As a share of the model's extent.
    Share(f64),
}

impl Place {
    fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            let parsed = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
            parsed.ok_or_else(|| format!("`{text}` is not a number"))
        };
        match text.trim().strip_suffix('%') {
            Some(share) => Ok(Self::Share(number(share)? / 100.0)),
            None => Ok(Self::Units(number(text)?)),
        }
    }

    fn between(self, low: f64, high: f64) -> f64 {
        match self {
            Self::Units(units) => units,
            Self::Share(share) => low + (high - low) * share,
        }
    }
}

/// A plane across an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionText {
    axis: usize,
    /// Whether what is below is kept.
    keeps_below: bool,
    place: Place,
}

/// Reads `x=40%`, `-y=2.5`.
pub fn section(text: &str) -> Result<SectionText, String> {
    let wrong =
        || "must be x, y or z, with - before it to keep the other side, then = and a place".to_owned();
    let (name, place) = text.split_once('=').ok_or_else(wrong)?;
    let (keeps_below, name) = name.strip_prefix('-').map_or((false, name), |name| (true, name));
    let axis = ["x", "y", "z"].iter().position(|axis| name.eq_ignore_ascii_case(axis)).ok_or_else(wrong)?;
    Ok(SectionText { axis, keeps_below, place: Place::parse(place)? })
}

impl SectionText {
    /// The plane in a model.
    pub fn plane(&self, bounds: &Bounds) -> Section {
        let axis = DVec3::AXES[self.axis];
        let at = self.place.between(bounds.low[self.axis], bounds.high[self.axis]);
        let mut point = bounds.centre();
        point[self.axis] = at;
        Section { point, normal: if self.keeps_below { -axis } else { axis } }
    }
}

/// Two corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxText([Place; 6]);

/// Reads six places, separated by commas.
pub fn section_box(text: &str) -> Result<BoxText, String> {
    let places = text.split(',').map(Place::parse).collect::<Result<Vec<_>, _>>()?;
    let count = places.len();
    let places = places.try_into().map_err(|_| format!("must be six numbers, not {count}"))?;
    Ok(BoxText(places))
}

impl BoxText {
    /// Its six planes in a model.
    pub fn planes(&self, bounds: &Bounds) -> Vec<Section> {
        let corner = |first: usize| {
            DVec3::from_array(std::array::from_fn(|axis| {
                self.0[first + axis].between(bounds.low[axis], bounds.high[axis])
            }))
        };
        let (a, b) = (corner(0), corner(3));
        Section::inside(&Bounds::new(a.min(b), a.max(b))).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { low: DVec3::new(0.0, 10.0, -4.0), high: DVec3::new(2.0, 20.0, 4.0) };

    #[test]
    fn sections_are_read_and_placed() {
        let plane = section("x=25%").unwrap().plane(&BOUNDS);
        assert_eq!((plane.point.x, plane.normal), (0.5, DVec3::X));
        let plane = section("-Y=12.5").unwrap().plane(&BOUNDS);
        assert_eq!((plane.point.y, plane.normal), (12.5, DVec3::NEG_Y));
        let plane = section("z=-1").unwrap().plane(&BOUNDS);
        assert_eq!((plane.point.z, plane.normal), (-1.0, DVec3::Z));
        for wrong in ["", "x", "w=1", "x=", "x=a", "x=inf", "--x=1", "=3", "x=5%%"] {
            assert!(section(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn boxes_keep_what_is_inside_whichever_corner_comes_first() {
        for text in ["0,25%,0,1,75%,3", "1,75%,3,0,25%,0"] {
            let planes = section_box(text).unwrap().planes(&BOUNDS);
            let kept = |point| planes.iter().all(|plane| plane.distance(point) >= 0.0);
            assert!(kept(DVec3::new(0.5, 15.0, 1.0)));
            assert!(!kept(DVec3::new(0.5, 15.0, -1.0)) && !kept(DVec3::new(0.5, 19.0, 1.0)));
        }
        assert!(section_box("1,2,3").is_err() && section_box("1,2,3,4,5,b").is_err());
    }
}
