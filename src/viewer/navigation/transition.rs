//! Two cameras and a point that both see in, the cameras between them out.
//!
//! What is interpolated is what one sees: the orientation (slerp), the place of the pivot in the picture, how much of
//! the world is seen at its depth (by equal factors), and the angle of view. So the picture of the pivot goes straight,
//! and stands still where both cameras see it at one place. Without perspective is the angle zero, so that a change of
//! the projection is a dolly zoom.

use glam::{DQuat, DVec2, DVec3};

use super::motions::{half_tangent, view_from_world};
use crate::scene::Camera;
use crate::scene::camera::Parallel;

/// How long a change of view takes.
pub const TRANSITION_SECONDS: f64 = 0.25;

/// On the way from or to no perspective the tangent of half the angle stays above this share of the other's.
const LEAST_TANGENT_SHARE: f64 = 0.02;

/// A change of view on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    from: Camera,
    to: Camera,
    pivot: DVec3,
    seconds: f64,
    elapsed: f64,
}

impl Transition {
    /// From one camera to another in [`TRANSITION_SECONDS`].
    pub fn new(from: Camera, to: Camera, pivot: DVec3) -> Self {
        Self { from, to, pivot, seconds: TRANSITION_SECONDS, elapsed: 0.0 }
    }

    /// Where it ends.
    pub fn target(&self) -> &Camera {
        &self.to
    }

    /// The camera after so many more seconds, and whether that is the end.
    pub fn advance(&mut self, seconds: f64) -> (Camera, bool) {
        self.elapsed += seconds.max(0.0);
        // Fifteen sixtieths add up to a little less than a quarter.
        let done = self.elapsed >= self.seconds - 1e-9;
        (if done { self.to } else { self.at(ease(self.elapsed / self.seconds)) }, done)
    }

    /// The camera at a share of the way, both ends exact.
    pub fn at(&self, share: f64) -> Camera {
        if share <= 0.0 {
            return self.from;
        }
        if share >= 1.0 {
            return self.to;
        }
        match (Seen::of(&self.from, self.pivot), Seen::of(&self.to, self.pivot)) {
            (Some(a), Some(b)) => Seen::between(&a, &b, share).camera(self, share),
            _ => self.straight(share),
        }
    }

    /// Where one of the two does not see the pivot: the eye goes straight.
    fn straight(&self, share: f64) -> Camera {
        let (a, b) = (&self.from, &self.to);
        let height = |camera: &Camera| camera.parallel.map(|parallel| parallel.height);
        let parallel = b.parallel.map(|parallel| Parallel {
            height: geometric(height(a).unwrap_or(parallel.height), parallel.height, share),
            ..parallel
        });
        Camera {
            eye: a.eye + (b.eye - a.eye) * share,
            world_from_view: a.world_from_view.slerp(b.world_from_view, share).normalize(),
            vertical_fov_radians: lerp(a.vertical_fov_radians, b.vertical_fov_radians, share),
            near: b.near,
            parallel,
        }
    }
}

/// Slow at both ends: 3 t^2 - 2 t^3.
fn ease(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}

fn lerp(a: f64, b: f64, share: f64) -> f64 {
    a + (b - a) * share
}

fn geometric(a: f64, b: f64, share: f64) -> f64 {
    a * (b / a).powf(share)
}

/// What a camera sees of a pivot.
struct Seen {
    orientation: DQuat,
    /// Its place in the picture, from the middle, in heights of the picture; y upwards.
    place: DVec2,
    /// World units between the lower and the upper edge of the picture at its depth.
    height: f64,
    /// The tangent of half the angle of view; zero without perspective.
    tangent: f64,
    depth: f64,
}

impl Seen {
    /// `None` where the pivot is not in front of the eye.
    fn of(camera: &Camera, pivot: DVec3) -> Option<Self> {
        let seen = view_from_world(camera, pivot);
        let depth = -seen.z;
        let (height, tangent) = match camera.parallel {
            Some(parallel) => (parallel.height, 0.0),
            None => (2.0 * half_tangent(camera) * depth, half_tangent(camera)),
        };
        let place = seen.truncate() / height;
        (height > 0.0 && place.is_finite()).then_some(Self {
            orientation: camera.world_from_view,
            place,
            height,
            tangent,
            depth,
        })
    }

    fn between(a: &Self, b: &Self, share: f64) -> Self {
        let least = LEAST_TANGENT_SHARE * a.tangent.max(b.tangent);
        Self {
            orientation: a.orientation.slerp(b.orientation, share).normalize(),
            place: a.place.lerp(b.place, share),
            height: geometric(a.height, b.height, share),
            tangent: lerp(a.tangent, b.tangent, share).max(least),
            depth: lerp(a.depth, b.depth, share),
        }
    }

    fn camera(&self, of: &Transition, share: f64) -> Camera {
        let is_parallel = self.tangent == 0.0;
        let depth = if is_parallel { self.depth } else { 0.5 * self.height / self.tangent };
        let offset = (self.place * self.height).extend(-depth);
        let fov = |camera: &Camera| camera.vertical_fov_radians;
        let reach = of.to.parallel.or(of.from.parallel).map_or(0.0, |parallel| parallel.reach);
        Camera {
            eye: of.pivot - self.orientation * offset,
            world_from_view: self.orientation,
            vertical_fov_radians: match is_parallel {
                true => lerp(fov(&of.from), fov(&of.to), share),
                false => 2.0 * self.tangent.atan(),
            },
            near: of.to.near,
            parallel: is_parallel.then_some(Parallel { height: self.height, reach }),
        }
    }
}
