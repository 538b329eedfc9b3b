//! What the hand does in pixels in, a camera out: orbit, pan, zoom, roll, fly, and smooth changes of view.
//!
//! Motions are about a *pivot*, the point of the model that the hand took hold of: it keeps its place in the picture
//! under orbit, zoom and roll, and follows the cursor under pan. [`motions`] has the pure functions, [`transition`] what
//! is between two views; [`Navigation`] holds the camera and the pivot. It knows neither windows nor buttons:
//! [`super::mouse`] says which button means what.

pub mod motions;
pub mod transition;

use glam::{DVec2, DVec3};

pub use motions::{OrbitStyle, Picture, Ray, ZoomLimits};
pub use transition::{TRANSITION_SECONDS, Transition};

use crate::scene::bounds::Bounds;
use crate::scene::camera::{Camera, orientation};
use crate::scene::views::{self, Projection, StandardView, UpAxis};

/// One step of the wheel multiplies the distance by this, or divides by it.
const WHEEL_STEP: f64 = 1.2;
/// Dragging over a picture's height multiplies the distance by this.
const DRAG_ZOOM: f64 = 10.0;
/// Diagonals of the scene that flying covers in a second.
const FLY_SPEED: f64 = 0.1;
/// What one step of the wheel does to that.
const FLY_WHEEL_STEP: f64 = 1.25;
/// What the fast key does to it.
const FLY_FAST: f64 = 5.0;
/// Flying goes no farther than this in one step, however long the frame took.
const MOST_FLY_SECONDS: f64 = 0.1;

/// What the hand did to the picture, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Input {
    /// Turn about the pivot.
    Orbit {
        /// How far the hand went.
        by: DVec2,
    },
    /// Move what was taken hold of with the cursor.
    Pan {
        /// How far the hand went.
        by: DVec2,
    },
    /// Steps of the wheel, above zero to come nearer.
    Zoom {
        /// Where the cursor is.
        at: DVec2,
        /// How many steps.
        steps: f64,
        /// The point of the model that is seen there, if any.
        picked: Option<DVec3>,
    },
    /// Zoom about the pivot by dragging: upwards comes nearer.
    ZoomDrag {
        /// How far the hand went.
        by: DVec2,
    },
    /// Turn the picture about the pivot.
    Roll {
        /// Where the cursor was.
        from: DVec2,
        /// Where it is.
        to: DVec2,
    },
    /// Turn the head; the eye stays.
    Look {
        /// How far the hand went.
        by: DVec2,
    },
}

impl Input {
    fn is_finite(&self) -> bool {
        match *self {
            Self::Orbit { by } | Self::Pan { by } | Self::ZoomDrag { by } | Self::Look { by } => {
                by.is_finite()
            }
            Self::Zoom { at, steps, picked } => {
                at.is_finite() && steps.is_finite() && picked.is_none_or(DVec3::is_finite)
            }
            Self::Roll { from, to } => from.is_finite() && to.is_finite(),
        }
    }
}

/// The keys of fly mode that are down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FlyKeys {
    /// W.
    pub forward: bool,
    /// S.
    pub back: bool,
    /// A.
    pub left: bool,
    /// D.
    pub right: bool,
    /// E.
    pub up: bool,
    /// Q.
    pub down: bool,
    /// Shift.
    pub fast: bool,
}

impl FlyKeys {
    /// In view space, of length 1 or 0.
    fn direction(self) -> DVec3 {
        let axis = |plus: bool, minus: bool| f64::from(i8::from(plus) - i8::from(minus));
        let sum =
            DVec3::new(axis(self.right, self.left), axis(self.up, self.down), axis(self.back, self.forward));
        sum.normalize_or_zero()
    }
}

/// How much of the scene a standard view shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Framing {
    /// All of a box.
    Fit(Bounds),
    /// What is seen of the pivot's surroundings now.
    Keep,
}

/// The camera, what it turns about, and the change of view that is on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Navigation {
    /// The axis that stays upright.
    pub up: UpAxis,
    /// How orbiting feels.
    pub style: OrbitStyle,
    camera: Camera,
    scene: Bounds,
    pivot: DVec3,
    /// The speed of flying, as a multiple of the usual one.
    fly_factor: f64,
    transition: Option<Transition>,
}

impl Navigation {
    /// All of the scene, seen from the front, the right and above. `aspect` is width over height.
    pub fn new(scene: Bounds, up: UpAxis, aspect: f64) -> Self {
        let camera =
            views::fit(&scene, &scene, StandardView::Iso.orientation(up), Projection::default(), aspect);
        let pivot = scene.centre();
        Self { up, style: OrbitStyle::default(), camera, scene, pivot, fly_factor: 1.0, transition: None }
    }

    /// The camera now.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The camera once the change of view that is on its way has ended.
    pub fn target(&self) -> &Camera {
        self.transition.as_ref().map_or(&self.camera, Transition::target)
    }

    /// What motions are about.
    pub fn pivot(&self) -> DVec3 {
        self.pivot
    }

    /// Whether a change of view is on its way.
    pub fn is_moving(&self) -> bool {
        self.transition.is_some()
    }

    /// Another scene, or a grown one: near plane, reach, limits and speeds follow it; the camera stays.
    pub fn set_scene(&mut self, scene: Bounds) {
        self.scene = scene;
        self.camera = self.suited(self.camera);
    }

    /// Puts the camera there at once.
    pub fn put(&mut self, camera: Camera) {
        self.transition = None;
        self.camera = self.suited(camera);
    }

    /// Goes to a camera, such as a bookmark, smoothly.
    pub fn go_to(&mut self, camera: Camera) {
        let to = self.suited(camera);
        self.start(to, self.pivot);
    }

    /// The hand takes hold of the picture; stops what is on its way. `picked` is the point of the model under it, if any.
    /// May be called again within the same gesture, when the pick has come.
    pub fn begin(&mut self, picked: Option<DVec3>) {
        self.transition = None;
        self.pivot = picked.filter(|point| point.is_finite()).unwrap_or_else(|| self.usual_pivot());
    }

    /// Moves the camera; stops what is on its way. Numbers that are not finite do nothing.
    pub fn apply(&mut self, input: Input, picture: Picture) {
        self.transition = None;
        if !input.is_finite() {
            return;
        }
        let (camera, pivot, up) = (&self.camera, self.pivot, self.up.vector());
        let moved = match input {
            Input::Orbit { by } => motions::orbit(camera, pivot, by, picture, self.style, up),
            Input::Pan { by } => motions::pan(camera, self.grabbed(), by, picture),
            Input::Zoom { at, steps, picked } => {
                let point = picked.unwrap_or_else(|| self.in_the_void(at, picture));
                motions::zoom(camera, point, WHEEL_STEP.powf(-steps), ZoomLimits::of(&self.scene))
            }
            Input::ZoomDrag { by } => {
                let factor = DRAG_ZOOM.powf(by.y / picture.height);
                motions::zoom(camera, self.grabbed(), factor, ZoomLimits::of(&self.scene))
            }
            Input::Roll { from, to } => {
                let around = motions::pixel_of(camera, picture, pivot).unwrap_or_else(|| picture.centre());
                motions::roll(camera, pivot, motions::clockwise_angle(around, from, to))
            }
            Input::Look { by } => motions::look(camera, by, picture, up),
        };
        self.accept(moved);
    }

    /// Flies for so many seconds with these keys down; gives whether that moved anything. With perspective only: fly
    /// mode is entered by [`Navigation::enter_fly`].
    pub fn fly(&mut self, keys: FlyKeys, seconds: f64) -> bool {
        let direction = keys.direction();
        if direction == DVec3::ZERO {
            return false;
        }
        self.transition = None;
        let speed = self.fly_speed() * if keys.fast { FLY_FAST } else { 1.0 };
        let step = speed * seconds.clamp(0.0, MOST_FLY_SECONDS);
        self.accept(Camera {
            eye: self.camera.eye + self.camera.world_from_view * direction * step,
            ..self.camera
        });
        true
    }

    /// The speed of flying, in world units a second.
    pub fn fly_speed(&self) -> f64 {
        self.scene.scale() * FLY_SPEED * self.fly_factor
    }

    /// Steps of the wheel in fly mode: faster above zero.
    pub fn change_fly_speed(&mut self, steps: f64) {
        if steps.is_finite() {
            self.fly_factor = (self.fly_factor * FLY_WHEEL_STEP.powf(steps)).clamp(1e-4, 1e3);
        }
    }

    /// Makes ready for flying: with perspective.
    pub fn enter_fly(&mut self) {
        self.set_parallel(false);
    }

    /// Shows all of a box: the scene's, or that of the selection. `aspect` is width over height.
    pub fn fit(&mut self, shown: &Bounds, aspect: f64) {
        let target = *self.target();
        let projection = projection_of(&target);
        let to = views::fit(shown, &self.scene, target.world_from_view, projection, aspect);
        self.go_round(with_fov_of(to, &target), shown.centre());
    }

    /// The box of the whole scene.
    pub fn scene(&self) -> &Bounds {
        &self.scene
    }

    /// Looks from a standard side. `aspect` is width over height.
    pub fn view(&mut self, view: StandardView, framing: Framing, aspect: f64) {
        let target = *self.target();
        let turned = view.orientation(self.up);
        match framing {
            Framing::Fit(shown) => {
                let to = views::fit(&shown, &self.scene, turned, projection_of(&target), aspect);
                self.go_round(with_fov_of(to, &target), shown.centre());
            }
            Framing::Keep => {
                let pivot = self.usual_pivot_of(&target);
                let rotation = turned * target.world_from_view.conjugate();
                let to = motions::turn_about(&target, pivot, rotation);
                self.go_round(Camera { world_from_view: turned, ..to }, pivot);
            }
        }
    }

    /// Looks straight at a face: the point comes into the middle, at the distance or in the size that it has now.
    /// `normal` points out of the face; one that is zero or not finite does nothing.
    pub fn look_at_face(&mut self, point: DVec3, normal: DVec3) {
        let Some(normal) = normal.try_normalize().filter(|_| point.is_finite()) else { return };
        let target = *self.target();
        let up = self.up.vector();
        // A face that lies flat is seen as upright as it is now.
        let upright = if normal.cross(up).length() < 1e-6 { target.up() } else { up };
        let turned = orientation(-normal, upright);
        let depth = motions::depth_of(&target, point);
        let away = if target.parallel.is_some() { 0.0 } else { depth.max(self.least_depth()) };
        let to = Camera { eye: point + normal * away, world_from_view: turned, ..target };
        self.go_round(to, point);
    }

    /// Without perspective or with it; the pivot keeps its place and size.
    pub fn set_parallel(&mut self, is_parallel: bool) {
        let target = *self.target();
        if target.parallel.is_some() == is_parallel {
            return;
        }
        let pivot = self.usual_pivot_of(&target);
        let to = motions::with_projection(&target, pivot, is_parallel, &self.scene);
        self.go_round(to, pivot);
    }

    /// Changes between perspective and none.
    pub fn toggle_projection(&mut self) {
        self.set_parallel(self.target().parallel.is_none());
    }

    /// Sets the camera upright again, about the pivot.
    pub fn level(&mut self) {
        let target = *self.target();
        let pivot = self.usual_pivot_of(&target);
        let turned = orientation(target.forward(), self.up.vector());
        let to = motions::turn_about(&target, pivot, turned * target.world_from_view.conjugate());
        self.go_round(Camera { world_from_view: turned, ..to }, pivot);
    }

    /// Goes on with the change of view for so many seconds; gives whether the camera moved, so that a next frame is due.
    pub fn tick(&mut self, seconds: f64) -> bool {
        let Some(transition) = &mut self.transition else { return false };
        let (camera, done) = transition.advance(seconds);
        self.camera = camera;
        if done {
            self.transition = None;
        }
        true
    }

    /// Ends the change of view at once, at its target.
    pub fn finish(&mut self) {
        self.tick(TRANSITION_SECONDS);
    }

    fn start(&mut self, to: Camera, pivot: DVec3) {
        if to.eye.is_finite() && to.world_from_view.is_finite() {
            self.transition = Some(Transition::new(self.camera, to, pivot));
        }
    }

    /// To a camera about a point that is the pivot from then on.
    fn go_round(&mut self, to: Camera, pivot: DVec3) {
        self.pivot = pivot;
        self.start(to, pivot);
    }

    fn accept(&mut self, camera: Camera) {
        let height = camera.parallel.map_or(1.0, |parallel| parallel.height);
        if camera.eye.is_finite() && camera.world_from_view.is_finite() && height.is_finite() {
            self.camera = camera;
        }
    }

    /// With the near plane and the reach that this scene needs.
    fn suited(&self, camera: Camera) -> Camera {
        let reach = views::reach_of(&self.scene);
        let parallel = camera.parallel.map(|parallel| crate::scene::camera::Parallel { reach, ..parallel });
        Camera { near: views::near_of(&self.scene), parallel, ..camera }
    }

    fn least_depth(&self) -> f64 {
        ZoomLimits::of(&self.scene).nearest
    }

    /// Where the hand finds nothing: the last pivot as long as it is in front of the eye.
    fn usual_pivot(&self) -> DVec3 {
        self.usual_pivot_of(&self.camera)
    }

    fn usual_pivot_of(&self, camera: &Camera) -> DVec3 {
        let is_ahead = |point: DVec3| motions::depth_of(camera, point) >= self.least_depth();
        if camera.parallel.is_some() || is_ahead(self.pivot) {
            self.pivot
        } else if is_ahead(self.scene.centre()) {
            self.scene.centre()
        } else {
            camera.eye + camera.forward() * (0.1 * self.scene.scale())
        }
    }

    /// The pivot, or something in front of the eye where it is behind.
    fn grabbed(&self) -> DVec3 {
        self.usual_pivot()
    }

    /// What to zoom towards where no model is under the cursor: as deep as the pivot, and never so near that one stops.
    fn in_the_void(&self, at: DVec2, picture: Picture) -> DVec3 {
        let depth = motions::depth_of(&self.camera, self.usual_pivot()).max(0.05 * self.scene.scale());
        motions::point_at_depth(&self.camera, picture, at, depth)
    }
}

fn projection_of(camera: &Camera) -> Projection {
    match camera.parallel {
        Some(_) => Projection::Parallel,
        None => Projection::Perspective(camera.vertical_fov_radians),
    }
}

/// Without perspective `views::fit` has the usual angle; the one that the user will come back to is kept.
fn with_fov_of(camera: Camera, before: &Camera) -> Camera {
    Camera { vertical_fov_radians: before.vertical_fov_radians, ..camera }
}

#[cfg(test)]
mod tests;
