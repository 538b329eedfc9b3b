//! A camera and what a hand did to it in, the moved camera out. Nothing here has a state.
//!
//! Positions enter as differences to the pivot or to the eye before anything is multiplied, so that a scene 10,000 km
//! from the origin moves as smoothly as one at it: what is left is the rounding of one f64 addition for each motion.
//! Pixels are counted from the upper left corner of the picture, x to the right and y downwards.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::scene::Camera;
use crate::scene::bounds::Bounds;
use crate::scene::camera::Parallel;
use crate::scene::views;

/// The size of a picture in pixels, at least 1 by 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// Its width.
    pub width: f64,
    /// Its height.
    pub height: f64,
}

impl Picture {
    /// A picture of that size; what is below a pixel, or not a number, counts as one.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width: width.max(1.0), height: height.max(1.0) }
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        self.width / self.height
    }

    /// The pixel in the middle.
    pub fn centre(&self) -> DVec2 {
        DVec2::new(self.width, self.height) * 0.5
    }

    /// Half a turn a picture's height.
    fn radians_per_pixel(&self) -> f64 {
        PI / self.height
    }
}

/// What orbiting keeps upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OrbitStyle {
    /// The model's up axis stays upright in the picture, as on a turntable.
    #[default]
    Turntable,
    /// Nothing: the model turns with the hand about any axis.
    Trackball,
}

/// A line of sight in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts: the eye, or without perspective a point before all that is seen.
    pub start: DVec3,
    /// The unit direction in which one looks along it.
    pub direction: DVec3,
}

/// A point in view space: +x right, +y up, -z ahead.
pub fn view_from_world(camera: &Camera, point: DVec3) -> DVec3 {
    camera.world_from_view.conjugate() * (point - camera.eye)
}

/// How far in front of the eye a point is, along the direction of view; negative behind it.
pub fn depth_of(camera: &Camera, point: DVec3) -> f64 {
    -view_from_world(camera, point).z
}

/// World units between the lower and the upper edge of the picture, at that depth.
pub fn visible_height(camera: &Camera, depth: f64) -> f64 {
    camera.parallel.map_or(2.0 * half_tangent(camera) * depth, |parallel| parallel.height)
}

pub(super) fn half_tangent(camera: &Camera) -> f64 {
    (0.5 * camera.vertical_fov_radians).tan()
}

/// The pixel at which a point is seen; `None` where it is not in front of the eye.
pub fn pixel_of(camera: &Camera, picture: Picture, point: DVec3) -> Option<DVec2> {
    let seen = view_from_world(camera, point);
    let is_ahead = camera.parallel.is_some() || -seen.z > 0.0;
    let scale = picture.height / visible_height(camera, -seen.z);
    is_ahead.then(|| picture.centre() + DVec2::new(seen.x, -seen.y) * scale)
}

/// The point that is seen at a pixel, that deep in front of the eye.
pub fn point_at_depth(camera: &Camera, picture: Picture, pixel: DVec2, depth: f64) -> DVec3 {
    let offset = (pixel - picture.centre()) * (visible_height(camera, depth) / picture.height);
    camera.eye + camera.world_from_view * DVec3::new(offset.x, -offset.y, -depth)
}

/// The line of sight through a pixel.
pub fn ray_through(camera: &Camera, picture: Picture, pixel: DVec2) -> Ray {
    if let Some(Parallel { reach, .. }) = camera.parallel {
        // The eye is in the middle of what is seen.
        return Ray { start: point_at_depth(camera, picture, pixel, -reach), direction: camera.forward() };
    }
    let slope = (pixel - picture.centre()) * (2.0 * half_tangent(camera) / picture.height);
    let direction = camera.world_from_view * DVec3::new(slope.x, -slope.y, -1.0).normalize();
    Ray { start: camera.eye, direction }
}

/// Turns a camera about a point, which keeps its place in the picture.
pub fn turn_about(camera: &Camera, pivot: DVec3, rotation: DQuat) -> Camera {
    Camera {
        eye: pivot + rotation * (camera.eye - pivot),
        world_from_view: (rotation * camera.world_from_view).normalize(),
        ..*camera
    }
}

/// Orbits by a motion of the hand in pixels. `up` is a unit vector, the model's.
pub fn orbit(
    camera: &Camera,
    pivot: DVec3,
    by: DVec2,
    picture: Picture,
    style: OrbitStyle,
    up: DVec3,
) -> Camera {
    let angles = by * -picture.radians_per_pixel();
    let rotation = match style {
        OrbitStyle::Turntable => turntable(camera, angles, up),
        OrbitStyle::Trackball => trackball(camera, angles),
    };
    turn_about(camera, pivot, rotation)
}

/// Turns the head: the eye stays where it is, and the direction of view goes where the hand goes.
pub fn look(camera: &Camera, by: DVec2, picture: Picture, up: DVec3) -> Camera {
    let rotation = turntable(camera, by * -picture.radians_per_pixel(), up);
    Camera { world_from_view: (rotation * camera.world_from_view).normalize(), ..*camera }
}

/// About `up` by the first angle, and about the level axis across the view by the second, as far as straight up or down.
fn turntable(camera: &Camera, angles: DVec2, up: DVec3) -> DQuat {
    let forward = camera.forward();
    let across = forward.cross(up);
    // Looking straight up or down, only the camera itself still tells what is level.
    let level = across
        .try_normalize()
        .filter(|_| across.length_squared() > 1e-18)
        .unwrap_or_else(|| camera.right().reject_from_normalized(up).normalize_or(camera.right()));
    let elevation = forward.dot(up).atan2(across.length());
    let pitch = (elevation + angles.y).clamp(-FRAC_PI_2, FRAC_PI_2) - elevation;
    // Upside down, the hand still pushes the picture the way it moves.
    let sense = if camera.up().dot(up) < -1e-9 { -1.0 } else { 1.0 };
    DQuat::from_axis_angle(up, sense * angles.x) * DQuat::from_axis_angle(level, pitch)
}

fn trackball(camera: &Camera, angles: DVec2) -> DQuat {
    let turn = camera.up() * angles.x + camera.right() * angles.y;
    DQuat::from_scaled_axis(turn)
}

/// Moves the picture by pixels: a point that was seen under the cursor stays under it.
pub fn pan(camera: &Camera, grabbed: DVec3, by: DVec2, picture: Picture) -> Camera {
    let depth = depth_of(camera, grabbed).max(camera.near);
    let shift = by * (visible_height(camera, depth) / picture.height);
    Camera { eye: camera.eye + camera.world_from_view * DVec3::new(-shift.x, shift.y, 0.0), ..*camera }
}

/// How near to a point and how far from it one may zoom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoomLimits {
    /// The least depth of the point with perspective.
    pub nearest: f64,
    /// The greatest depth.
    pub farthest: f64,
    /// The least height of the picture without perspective, in world units.
    pub lowest: f64,
    /// The greatest.
    pub highest: f64,
}

impl ZoomLimits {
    /// Those of a scene.
    pub fn of(scene: &Bounds) -> Self {
        let scale = scene.scale();
        Self {
            nearest: 2.0 * views::near_of(scene),
            farthest: 1e3 * scale,
            lowest: 1e-6 * scale,
            highest: 1e3 * scale,
        }
    }
}

/// Zooms: the distance of a point, or without perspective the height of the picture, is multiplied by `factor`, as far
/// as the limits allow; the point keeps its place in the picture and is never passed.
pub fn zoom(camera: &Camera, point: DVec3, factor: f64, limits: ZoomLimits) -> Camera {
    let within = |size: f64, low: f64, high: f64| {
        // What is beyond a limit already may only go back.
        let (least, most) = ((low / size).min(1.0), (high / size).max(1.0));
        factor.clamp(least, most)
    };
    let to_point = point - camera.eye;
    if let Some(parallel) = camera.parallel {
        let factor = within(parallel.height, limits.lowest, limits.highest);
        let aside = to_point.reject_from_normalized(camera.forward());
        let parallel = Some(Parallel { height: parallel.height * factor, ..parallel });
        return Camera { eye: camera.eye + aside * (1.0 - factor), parallel, ..*camera };
    }
    let depth = depth_of(camera, point);
    if depth <= 0.0 {
        return *camera;
    }
    let factor = within(depth, limits.nearest, limits.farthest);
    Camera { eye: camera.eye + to_point * (1.0 - factor), ..*camera }
}

/// Turns the picture clockwise by an angle, about a point that keeps its place.
pub fn roll(camera: &Camera, pivot: DVec3, clockwise_radians: f64) -> Camera {
    // About a parallel to the axis of view through the pivot, so that all at its depth turns as on a sheet of paper.
    turn_about(camera, pivot, DQuat::from_axis_angle(camera.forward(), -clockwise_radians))
}

/// The angle by which the hand went clockwise round a pixel.
pub fn clockwise_angle(around: DVec2, from: DVec2, to: DVec2) -> f64 {
    let (a, b) = (from - around, to - around);
    let angle = a.perp_dot(b).atan2(a.dot(b));
    // Right at the pixel the angle is anything.
    if a.length().min(b.length()) < 2.0 { 0.0 } else { angle }
}

/// The same view with or without perspective: a pivot keeps its place and its size in the picture.
///
/// Without perspective the eye goes to the depth of the pivot, so that the scene around that is within reach.
pub fn with_projection(camera: &Camera, pivot: DVec3, is_parallel: bool, scene: &Bounds) -> Camera {
    let depth = depth_of(camera, pivot);
    match (camera.parallel, is_parallel) {
        (None, true) => {
            let depth = depth.max(2.0 * camera.near);
            let parallel = Parallel { height: visible_height(camera, depth), reach: views::reach_of(scene) };
            Camera { eye: camera.eye + camera.forward() * depth, parallel: Some(parallel), ..*camera }
        }
        (Some(Parallel { height, .. }), false) => {
            let wanted = height / (2.0 * half_tangent(camera));
            Camera { eye: camera.eye - camera.forward() * (wanted - depth), parallel: None, ..*camera }
        }
        _ => *camera,
    }
}
