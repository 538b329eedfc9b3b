//! The way of the camera in, what it will see next out, so that it can be read before it is wanted.
//!
//! Where the camera will be is taken from how it moved in the last moments, by the clock and not by frames. What is in
//! view there and is not wanted yet is asked for after everything that is, and only into memory that nothing else needs.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3, Vec4};
use rayon::prelude::*;

use crate::scene::{Camera, InstanceBox};

/// So far it looks ahead.
const AHEAD: Duration = Duration::from_millis(500);
/// Its motion is that since so long ago.
const MEMORY: Duration = Duration::from_millis(250);
/// More instances than these are not looked through.
const MOST_INSTANCES: usize = 100_000;
/// A thread takes no fewer of them, as waiting for threads would take longer.
const LEAST_SHARE: usize = 8192;
/// A camera that turns faster than this in the time that it looks ahead looks no further ahead.
const MOST_TURN_RADIANS: f64 = 1.5;
/// What is shorter than this, in pixels, is not worth a look.
const LEAST_PX: f64 = 2.0;

/// How the camera moved in the last moments.
#[derive(Debug, Default)]
pub struct Motion {
    seen: VecDeque<(Instant, Camera)>,
}

impl Motion {
    /// Takes in where the camera is, and tells where it will be; `None` while it rests, and before it has moved.
    pub fn ahead(&mut self, now: Instant, camera: &Camera) -> Option<Camera> {
        if self.seen.back().is_some_and(|(_, last)| last == camera) {
            self.seen.clear();
        }
        while self.seen.get(1).is_some_and(|(then, _)| now.duration_since(*then) >= MEMORY) {
            self.seen.pop_front();
        }
        let ahead = self.seen.front().and_then(|(then, before)| {
            let passed = now.duration_since(*then).as_secs_f64();
            (passed > 0.0).then(|| extrapolated(before, camera, AHEAD.as_secs_f64() / passed))
        });
        self.seen.push_back((now, *camera));
        ahead.filter(|ahead| ahead != camera)
    }
}

/// Where a camera that went from `before` to `now` is after `factor` times as long again.
fn extrapolated(before: &Camera, now: &Camera, factor: f64) -> Camera {
    let turn = now.world_from_view * before.world_from_view.conjugate();
    // The shorter way round.
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let (axis, angle) = turn.to_axis_angle();
    let turned = DQuat::from_axis_angle(axis, (angle * factor).min(MOST_TURN_RADIANS));
    Camera {
        eye: now.eye + (now.eye - before.eye) * factor,
        world_from_view: (turned * now.world_from_view).normalize(),
        ..*now
    }
}

/// The instances that a camera sees, ascending, each with how long its box seems, in pixels. Looks at every box; none
/// are found where there are too many of them.
pub fn in_view(
    boxes: &[InstanceBox],
    camera: &Camera,
    aspect: f32,
    px: impl Fn(&InstanceBox) -> f64 + Sync,
) -> Vec<(u32, f64)> {
    if boxes.len() > MOST_INSTANCES {
        return Vec::new();
    }
    let planes = camera.frustum_planes(aspect).map(Vec4::as_dvec4);
    let is_inside = |bounds: &InstanceBox| {
        let centre: DVec3 = bounds.centre - camera.eye;
        planes.iter().all(|plane| {
            let normal = plane.truncate();
            normal.dot(centre) + plane.w + normal.abs().dot(bounds.half_extent) >= 0.0
        })
    };
    let seen = boxes.par_iter().enumerate().with_min_len(LEAST_SHARE).filter(|(_, bounds)| is_inside(bounds));
    seen.map(|(number, bounds)| (number as u32, px(bounds))).filter(|(_, px)| *px >= LEAST_PX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(eye: DVec3, yaw: f64) -> Camera {
        Camera {
            eye,
            world_from_view: DQuat::from_rotation_y(yaw),
            vertical_fov_radians: 1.0,
            near: 0.1,
            parallel: None,
        }
    }

    /// Where a camera is expected to be that has moved in so many frames a second, by its speed and turn a second.
    fn expected(frames_per_second: f64, speed: f64, turn: f64) -> Option<Camera> {
        let (mut motion, start) = (Motion::default(), Instant::now());
        let mut ahead = None;
        for frame in 0..=frames_per_second as u32 {
            let seconds = f64::from(frame) / frames_per_second;
            let camera = camera(DVec3::X * speed * seconds, turn * seconds);
            ahead = motion.ahead(start + Duration::from_secs_f64(seconds), &camera);
        }
        ahead
    }

    #[test]
    fn it_looks_half_a_second_ahead_at_any_frame_rate() {
        for frames_per_second in [5.0, 60.0, 240.0] {
            let found = expected(frames_per_second, 2.0, 0.3).unwrap();
            assert!((found.eye - DVec3::X * 3.0).length() < 1e-6, "{found:?}");
            assert!(found.world_from_view.angle_between(DQuat::from_rotation_y(0.45)) < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn a_camera_at_rest_and_one_that_has_just_come_look_nowhere() {
        assert_eq!(expected(60.0, 0.0, 0.0), None);
        let (mut motion, now) = (Motion::default(), Instant::now());
        assert_eq!(motion.ahead(now, &camera(DVec3::ZERO, 0.0)), None);
        let later = |ms| now + Duration::from_millis(ms);
        assert!(motion.ahead(later(10), &camera(DVec3::X, 0.0)).is_some());
        assert_eq!(motion.ahead(later(20), &camera(DVec3::X, 0.0)), None);
        // It was at rest, so that what was before is forgotten.
        let again = motion.ahead(later(30), &camera(2.0 * DVec3::X, 0.0)).unwrap();
        assert!((again.eye.x - 52.0).abs() < 1e-6, "{again:?}");
    }

    #[test]
    fn a_fast_turn_is_not_followed_all_the_way_round() {
        let found = expected(10.0, 0.0, 20.0).unwrap();
        let angle = found.world_from_view.angle_between(DQuat::from_rotation_y(20.0));
        assert!(angle <= MOST_TURN_RADIANS + 1e-6, "{angle}");
    }

    #[test]
    fn what_is_behind_or_too_small_is_not_in_view() {
        let at = |centre: DVec3| InstanceBox { centre, half_extent: DVec3::splat(0.5), diagonal: 1.7 };
        let boxes = [DVec3::Z * -5.0, DVec3::Z * 5.0, DVec3::Z * -6.0 + DVec3::X * 50.0, DVec3::Z * -900.0];
        let px = |bounds: &InstanceBox| 1000.0 / bounds.centre.length();
        let seen = in_view(&boxes.map(at), &camera(DVec3::ZERO, 0.0), 1.0, px);
        assert_eq!(seen, [(0, 200.0)]);
        let around = in_view(&boxes.map(at), &camera(DVec3::ZERO, std::f64::consts::PI), 1.0, px);
        assert_eq!(around, [(1, 200.0)]);
    }
}
