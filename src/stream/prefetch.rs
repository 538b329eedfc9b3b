//! The way of the camera in, where it will be out, so that what it will see there can be read before it is wanted.
//!
//! Where the camera will be is taken from how it moved in the last moments, by the clock and not by frames. What is in
//! view there and is not wanted yet (`frame/ahead.rs`) is asked for after everything that is, and only into memory that
//! nothing else needs.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use glam::DQuat;

use crate::scene::Camera;

/// So far it looks ahead.
const AHEAD: Duration = Duration::from_millis(500);
/// Its motion is that since so long ago.
const MEMORY: Duration = Duration::from_millis(250);
/// A camera that turns faster than this in the time that it looks ahead looks no further ahead.
const MOST_TURN_RADIANS: f64 = 1.5;
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

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
}
