//! A box in, a camera that shows all of it from a standard side out.

use glam::{DQuat, DVec3};

use super::Bounds;
use super::camera::{Camera, DEFAULT_VERTICAL_FOV_RADIANS, Parallel, orientation};

/// The axis that points upwards in the model.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Hash, serde::Serialize, serde::Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +y, as in glTF.
    #[default]
    Y,
    /// +z, as in most CAD programs.
    Z,
}

impl UpAxis {
    /// The unit vector.
    pub fn vector(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// The unit vector out of the front of the model.
    pub fn front(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Z,
            Self::Z => DVec3::NEG_Y,
        }
    }
}

/// A side that models are looked at from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, clap::ValueEnum)]
pub enum StandardView {
    /// From the front, the right and above, with all three axes equally long.
    #[default]
    Iso,
    /// From the front.
    Front,
    /// From behind.
    Back,
    /// From the left.
    Left,
    /// From the right.
    Right,
    /// From above, with the front below.
    Top,
    /// From below, with the front above.
    Bottom,
}

impl StandardView {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Iso, Self::Front, Self::Back, Self::Left, Self::Right, Self::Top, Self::Bottom];

    /// What people call it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Iso => "iso",
            Self::Front => "front",
            Self::Back => "back",
            Self::Left => "left",
            Self::Right => "right",
            Self::Top => "top",
            Self::Bottom => "bottom",
        }
    }

    /// How a camera is turned that looks from there; a unit quaternion.
    pub fn orientation(self, up: UpAxis) -> DQuat {
        let (front, above) = (up.front(), up.vector());
        let right = above.cross(front);
        let outward = match self {
            Self::Iso => front + right + above,
            Self::Front => front,
            Self::Back => -front,
            Self::Left => -right,
            Self::Right => right,
            Self::Top => above,
            Self::Bottom => -above,
        };
        let upright = match self {
            Self::Top => -front,
            Self::Bottom => front,
            _ => above,
        };
        orientation(-outward, upright)
    }
}

/// How the picture is projected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// With the angle between the upper and the lower edge, in radians.
    Perspective(f64),
    /// Without perspective.
    Parallel,
}

impl Default for Projection {
    fn default() -> Self {
        Self::Perspective(DEFAULT_VERTICAL_FOV_RADIANS)
    }
}

/// Room around what is shown, as a share of it.
const MARGIN: f64 = 1.06;
/// The near plane as a share of the diagonal of the scene: reversed depth stays evenly precise however small it is.
const NEAR_FRACTION: f64 = 1e-5;
/// How many diagonals of the scene a camera without perspective sees to either side of its eye.
const REACH: f64 = 4.0;

/// The near plane for a scene.
pub fn near_of(scene: &Bounds) -> f64 {
    (scene.scale() * NEAR_FRACTION).max(1e-37)
}

/// How far a camera without perspective sees, for an eye anywhere near a scene.
pub fn reach_of(scene: &Bounds) -> f64 {
    scene.scale() * REACH
}

/// A camera with that orientation that shows all of `shown`, a part of `scene`, and no more than needed. `aspect` is width
/// over height.
pub fn fit(
    shown: &Bounds,
    scene: &Bounds,
    world_from_view: DQuat,
    projection: Projection,
    aspect: f64,
) -> Camera {
    let half = shown.extent() * 0.5;
    let corners = (0..8).map(|i| {
        let sign = |bit: u32| if i & bit != 0 { 1.0 } else { -1.0 };
        world_from_view.conjugate() * (half * DVec3::new(sign(1), sign(2), sign(4)))
    });
    let floor = 0.5 * shown.scale() * 1e-3;
    let camera = |eye, vertical_fov_radians, parallel| Camera {
        eye,
        world_from_view,
        vertical_fov_radians,
        near: near_of(scene),
        parallel,
    };
    match projection {
        Projection::Perspective(angle) => {
            let slope = (0.5 * angle).tan();
            let away = |c: DVec3| c.z + MARGIN * (c.x.abs() / (slope * aspect)).max(c.y.abs() / slope);
            let distance = corners.map(away).fold(floor, f64::max);
            camera(shown.centre() + world_from_view * DVec3::Z * distance, angle, None)
        }
        Projection::Parallel => {
            let high = |c: DVec3| 2.0 * MARGIN * (c.x.abs() / aspect).max(c.y.abs());
            let height = corners.map(high).fold(floor, f64::max);
            let parallel = Parallel { height, reach: reach_of(scene) };
            camera(shown.centre(), DEFAULT_VERTICAL_FOV_RADIANS, Some(parallel))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(camera: &Camera, aspect: f32, point: DVec3) -> (f32, f32) {
        let clip = camera.clip_from_relative(aspect) * (point - camera.eye).as_vec3().extend(1.0);
        (clip.x / clip.w, clip.y / clip.w)
    }

    #[test]
    fn all_is_seen_and_fills_the_picture_from_every_side() {
        let bounds = Bounds::new(DVec3::new(5.0, -2.0, 1.0), DVec3::new(9.0, 3.0, 2.0));
        for up in [UpAxis::Y, UpAxis::Z] {
            for view in StandardView::ALL {
                for (projection, aspect) in [
                    (Projection::default(), 1.6f32),
                    (Projection::Parallel, 0.5),
                    (Projection::Parallel, 3.0),
                ] {
                    let camera = fit(&bounds, &bounds, view.orientation(up), projection, f64::from(aspect));
                    let corner = |i: u32| {
                        let pick = |bit, low: f64, high: f64| if i & bit != 0 { high } else { low };
                        let (l, h) = (bounds.low, bounds.high);
                        DVec3::new(pick(1, l.x, h.x), pick(2, l.y, h.y), pick(4, l.z, h.z))
                    };
                    let reach = (0..8).map(|i| seen(&camera, aspect, corner(i)));
                    let most = reach.map(|(x, y)| x.abs().max(y.abs())).fold(0.0, f32::max);
                    assert!(most > 0.85 && most < 1.0, "{view:?} {projection:?}: {most}");
                }
            }
        }
    }

    #[test]
    fn sides_have_their_names_and_up_is_up() {
        let back = |view: StandardView, up| view.orientation(up) * DVec3::Z;
        assert!((back(StandardView::Front, UpAxis::Z) - DVec3::NEG_Y).length() < 1e-12);
        assert!((back(StandardView::Right, UpAxis::Z) - DVec3::X).length() < 1e-12);
        assert!((back(StandardView::Right, UpAxis::Y) - DVec3::X).length() < 1e-12);
        assert!((back(StandardView::Top, UpAxis::Y) - DVec3::Y).length() < 1e-12);
        let up = |view: StandardView, up| view.orientation(up) * DVec3::Y;
        assert!((up(StandardView::Front, UpAxis::Z) - DVec3::Z).length() < 1e-12);
        assert!((up(StandardView::Top, UpAxis::Z) - DVec3::Y).length() < 1e-12);
        assert!(up(StandardView::Iso, UpAxis::Y).y > 0.8);
    }

    #[test]
    fn a_point_and_nothing_can_be_fitted() {
        for bounds in [Bounds::EMPTY, Bounds::new(DVec3::splat(3.0), DVec3::splat(3.0))] {
            for projection in [Projection::default(), Projection::Parallel] {
                let camera = fit(&bounds, &bounds, DQuat::IDENTITY, projection, 1.0);
                assert!(camera.eye.is_finite() && camera.near > 0.0);
                assert!(camera.parallel.is_none_or(|parallel| parallel.height > 0.0));
            }
        }
    }
}
