//! Two numbers from 0 to 1 in, a point of an aircraft, a ship or a plant in world space out.
//!
//! World space has y upwards, x along the length, and metres. `u` goes along the length (of a wing: from the root to the
//! tip) and `v` around or across. Skins, frames and stringers are made on these surfaces, and everything else is placed
//! beside them.

use glam::{DAffine3, DMat3, DVec3};

use std::f64::consts::{PI, TAU};

/// A surface or a rectangle of it in its own coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// The form.
    pub form: Form,
    /// What of the form it is.
    pub cut: Cut,
    /// The range of `u`.
    pub u: [f64; 2],
    /// The range of `v`.
    pub v: [f64; 2],
}

/// A form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// A body of revolution along x, thinner to both ends: `v` 0 is its top.
    Fuselage {
        /// Where it starts.
        origin: DVec3,
        /// Along x.
        length: f64,
        /// In the middle.
        radius: f64,
        /// How much of the length narrows at the front and at the back.
        taper: [f64; 2],
        /// How far the axis rises at the back.
        rise: f64,
    },
    /// A wing: `v` 0 is its trailing edge, 0.5 its leading edge.
    Wing {
        /// The leading edge at the root.
        origin: DVec3,
        /// From there to the leading edge at the tip.
        span: DVec3,
        /// At root and tip.
        chords: [f64; 2],
        /// The thickness in terms of the chord.
        thickness: f64,
    },
    /// A hull along x with a flat bottom amidships, open above: `v` 0 is one deck edge, 0.5 the keel.
    Hull {
        /// Along x, the stern at 0.
        length: f64,
        /// Across.
        beam: f64,
        /// From the keel, at y 0, to the deck.
        depth: f64,
    },
    /// A standing vessel with round heads: `u` goes upwards.
    Vessel {
        /// The middle of its foot.
        origin: DVec3,
        /// Upwards.
        height: f64,
        /// In the middle.
        radius: f64,
    },
    /// A parallelogram.
    Plane {
        /// The corner at 0, 0.
        origin: DVec3,
        /// From `u` 0 to 1.
        along: DVec3,
        /// From `v` 0 to 1.
        across: DVec3,
    },
}

/// What of a form a surface is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// Its outside.
    Skin,
    /// The level area inside at this height; `v` goes across.
    Deck(f64),
    /// The area inside at this `u`; the surface's `u` goes from the top (of a wing: the trailing edge) to the bottom, and
    /// `v` across.
    Across(f64),
}

impl Surface {
    /// All of a form's outside.
    pub fn of(form: Form) -> Self {
        Self { form, cut: Cut::Skin, u: [0.0, 1.0], v: [0.0, 1.0] }
    }

    /// An upright parallelogram or a level one.
    pub fn plane(origin: DVec3, along: DVec3, across: DVec3) -> Self {
        Self::of(Form::Plane { origin, along, across })
    }

    /// A part of it.
    pub fn within(self, u: [f64; 2], v: [f64; 2]) -> Self {
        Self { u, v, ..self }
    }

    /// The level area inside at a height.
    pub fn deck(self, height: f64) -> Self {
        Self { cut: Cut::Deck(height), ..self }
    }

    /// The area inside at `u` of the form.
    pub fn across(self, u: f64) -> Self {
        Self { cut: Cut::Across(u), u: [0.02, 0.94], v: [0.01, 0.99], ..self }
    }

    /// A point in world space.
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        let u = self.u[0] + (self.u[1] - self.u[0]) * u;
        let v = self.v[0] + (self.v[1] - self.v[0]) * v;
        match self.cut {
            Cut::Skin => self.form.point(u, v),
            Cut::Deck(height) => self.form.deck(u, v, height),
            Cut::Across(at) => self.form.point(at, u / 2.0).lerp(self.form.point(at, 1.0 - u / 2.0), v),
        }
    }

    /// Directions of growing `u` and `v` at a point.
    fn tangents(&self, u: f64, v: f64) -> [DVec3; 2] {
        const STEP: f64 = 1e-5;
        let difference =
            |from: [f64; 2], to: [f64; 2]| self.point(to[0], to[1]) - self.point(from[0], from[1]);
        [difference([u - STEP, v], [u + STEP, v]), difference([u, v - STEP], [u, v + STEP])]
    }

    /// Where and how a thing stands at a point: z is the way out (of a deck: up), x goes along `u`.
    ///
    /// `outwards` is what [`Self::sense`] says of the surface near there.
    pub fn frame(&self, u: f64, v: f64, outwards: f64) -> DAffine3 {
        let [along, across] = self.tangents(u, v);
        let normal = (along.cross(across) * outwards).normalize_or(DVec3::Y);
        let x = (along - normal * along.dot(normal)).normalize_or(normal.any_orthonormal_vector());
        let axes = DMat3::from_cols(x, normal.cross(x), normal);
        DAffine3 { matrix3: axes, translation: self.point(u, v) }
    }

    /// Whether the way out is along the cross product of the directions of `u` and `v` (1) or against it (-1).
    pub fn sense(&self, u: f64, v: f64) -> f64 {
        let [along, across] = self.tangents(u, v);
        let out = match (self.cut, self.form) {
            (Cut::Deck(_), _) => DVec3::Y,
            (Cut::Across(_), Form::Wing { span, .. }) => span,
            (Cut::Across(_), _) => DVec3::X,
            (Cut::Skin, Form::Plane { .. }) => return 1.0,
            (Cut::Skin, _) => self.point(u, v) - self.form.middle(self.u[0] + (self.u[1] - self.u[0]) * u),
        };
        if along.cross(across).dot(out) < 0.0 { -1.0 } else { 1.0 }
    }

    /// How deep things may lie inside at a point: the way to the other side.
    pub fn room(&self, u: f64, v: f64) -> f64 {
        let [u, v] = [self.u[0] + (self.u[1] - self.u[0]) * u, self.v[0] + (self.v[1] - self.v[0]) * v];
        match (self.cut, self.form) {
            (Cut::Skin, Form::Wing { .. }) => self.form.point(u, v).distance(self.form.point(u, 1.0 - v)),
            (Cut::Skin, Form::Fuselage { .. } | Form::Vessel { .. }) => 2.0 * self.form.radius(u),
            (Cut::Skin, Form::Hull { .. }) => {
                self.form.point(u, v).distance(self.form.point(u, 1.0 - v)).max(1.0)
            }
            _ => f64::INFINITY,
        }
    }

    /// Its lengths along `u` and `v` in the middle, in metres.
    pub fn extent(&self) -> [f64; 2] {
        const STEPS: u32 = 24;
        let length = |at: &dyn Fn(f64) -> DVec3| -> f64 {
            let step = |k: u32| at(f64::from(k) / f64::from(STEPS));
            (0..STEPS).map(|k| step(k).distance(step(k + 1))).sum()
        };
        [length(&|t| self.point(t, 0.5)), length(&|t| self.point(0.5, t))].map(|length| length.max(0.01))
    }
}

impl Form {
    fn point(&self, u: f64, v: f64) -> DVec3 {
        match *self {
            Self::Fuselage { .. } => {
                self.middle(u) + self.radius(u) * DVec3::new(0.0, (TAU * v).cos(), (TAU * v).sin())
            }
            Self::Wing { origin, span, chords, thickness } => {
                let chord = chords[0] + (chords[1] - chords[0]) * u;
                let [back, up] = airfoil(v);
                origin
                    + span * u
                    + DVec3::X * chord * back
                    + DVec3::X.cross(span).normalize() * chord * thickness * up
            }
            Self::Hull { length, beam, depth } => {
                let (angle, square) = (PI * v, hull_squareness(u));
                let power = |value: f64| value.abs().powf(square).copysign(value);
                let half = beam / 2.0 * hull_breadth(u);
                let x = length * u + hull_rake(u, length, 1.0 - power(angle.sin()));
                DVec3::new(x, depth * (1.0 - power(angle.sin())), -half * power(angle.cos()))
            }
            Self::Vessel { .. } => {
                self.middle(u) + self.radius(u) * DVec3::new((TAU * v).sin(), 0.0, (TAU * v).cos())
            }
            Self::Plane { origin, along, across } => origin + along * u + across * v,
        }
    }

    /// A point inside at `u`.
    fn middle(&self, u: f64) -> DVec3 {
        match *self {
            Self::Fuselage { origin, length, taper, rise, .. } => {
                let x = fuselage_station(u);
                let back = ((x - 1.0 + taper[1]) / taper[1]).max(0.0);
                origin + DVec3::new(length * x, rise * back * back, 0.0)
            }
            Self::Wing { origin, span, chords, .. } => {
                origin + span * u + DVec3::X * (chords[0] + (chords[1] - chords[0]) * u) * 0.4
            }
            Self::Hull { length, depth, .. } => DVec3::new(length * u, depth, 0.0),
            Self::Vessel { origin, height, .. } => origin + DVec3::Y * height * head_station(u),
            Self::Plane { origin, .. } => origin,
        }
    }

    /// The radius of a body of revolution, nowhere 0.
    fn radius(&self, u: f64) -> f64 {
        let round = |t: f64| (1.0 - (1.0 - t.clamp(0.0, 1.0)).powi(2)).max(0.0).sqrt();
        match *self {
            Self::Fuselage { radius, taper, .. } => {
                let x = fuselage_station(u);
                let back = ((1.0 - x) / taper[1]).clamp(0.0, 1.0);
                radius * (0.04 + 0.96 * round(x / taper[0])) * (0.12 + 0.88 * back.powf(0.8))
            }
            Self::Vessel { radius, height, .. } => {
                let (y, head) = (height * head_station(u), radius * 0.5);
                radius * (0.08 + 0.92 * round(y.min(height - y) / head))
            }
            _ => 0.0,
        }
    }

    fn deck(&self, u: f64, v: f64, height: f64) -> DVec3 {
        let (middle, half) = match *self {
            Self::Hull { length, beam, depth } => {
                let sine = (1.0 - height / depth).clamp(0.0, 1.0).powf(1.0 / hull_squareness(u));
                let cosine = (1.0 - sine * sine).sqrt().powf(hull_squareness(u));
                let rake = DVec3::X * hull_rake(u, length, height / depth);
                (self.middle(u) + rake, beam / 2.0 * hull_breadth(u) * cosine)
            }
            _ => {
                let middle = self.middle(u);
                let (above, radius) = (height - middle.y, self.radius(u));
                (middle, (radius * radius - above * above).max(0.01).sqrt())
            }
        };
        DVec3::new(middle.x, height, middle.z + half * 0.97 * (1.0 - 2.0 * v))
    }
}

/// Stations lie closer at the nose, where the form changes most.
fn fuselage_station(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u - 0.1 * (1.0 - u).powi(2) * (PI * u).sin()
}

/// Stations lie closer at the heads.
fn head_station(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u - (TAU * u).sin() * 0.1
}

/// A symmetrical airfoil of four digits, (back, up), thickness 1: from the trailing edge over the top to the front and
/// back below. The trailing edge stays open by a little, so that top and bottom are two points there.
fn airfoil(v: f64) -> [f64; 2] {
    // Beyond the trailing edge it would turn back on itself, so that there would be no direction at it.
    let v = v.clamp(0.0, 1.0);
    let side = if v < 0.5 { 1.0 } else { -1.0 };
    let x = (0.5 + 0.5 * (TAU * v).cos()).clamp(0.0, 1.0);
    let half =
        5.0 * (0.2969 * x.sqrt() - 0.126 * x - 0.3516 * x * x + 0.2843 * x.powi(3) - 0.1015 * x.powi(4));
    [x, side * half]
}

fn hull_breadth(u: f64) -> f64 {
    let (bow, stern) = (((1.0 - u) / 0.22).clamp(0.0, 1.0), ((u + 0.06) / 0.2).clamp(0.0, 1.0));
    0.015 + 0.985 * (1.0 - (1.0 - bow).powi(2)) * (1.0 - 0.8 * (1.0 - stern).powi(2))
}

fn hull_squareness(u: f64) -> f64 {
    let ends = (2.0 * u - 1.1).abs().powi(3).min(1.0);
    0.4 + 0.5 * ends
}

/// How far stem and stern lean out at a height from 0 (keel) to 1 (deck).
fn hull_rake(u: f64, length: f64, height: f64) -> f64 {
    let (bow, stern) = (((u - 0.85) / 0.15).max(0.0), ((0.12 - u) / 0.12).max(0.0));
    length * 0.05 * height * (bow * bow - 0.6 * stern * stern)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_face_outwards_and_are_rotations() {
        let body =
            Form::Fuselage { origin: DVec3::ZERO, length: 60.0, radius: 3.0, taper: [0.1, 0.3], rise: 1.0 };
        let wing = Form::Wing {
            origin: DVec3::ZERO,
            span: DVec3::new(9.0, 2.0, -30.0),
            chords: [9.0, 3.0],
            thickness: 0.1,
        };
        let hull = Form::Hull { length: 180.0, beam: 28.0, depth: 16.0 };
        let vessel = Form::Vessel { origin: DVec3::X, height: 9.0, radius: 1.5 };
        for form in [body, wing, hull, vessel] {
            let surface = Surface::of(form);
            for (u, v) in [(0.3, 0.2), (0.7, 0.8), (0.5, 0.4), (0.1, 0.6)] {
                let frame = surface.frame(u, v, surface.sense(u, v));
                assert!((frame.matrix3.determinant() - 1.0).abs() < 1e-9, "{form:?}: no rotation");
                let out = frame.translation - form.middle(u);
                assert!(frame.matrix3.z_axis.dot(out) > 0.0, "{form:?} at {u} {v} faces inwards");
            }
            let deck = surface.deck(1.0);
            assert!(deck.frame(0.5, 0.5, deck.sense(0.5, 0.5)).matrix3.z_axis.y > 0.999);
        }
    }
}
