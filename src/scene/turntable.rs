//! A camera and how many pictures in, the cameras once round a model and the names of their pictures out.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::camera::{Camera, Parallel};

/// No more pictures are made in one go.
pub const MOST_PICTURES: u32 = 10_000;

/// The camera after a share of one turn to the left about an axis through a pivot; `up` is a unit vector.
pub fn turned(camera: &Camera, pivot: DVec3, up: DVec3, share: f64) -> Camera {
    let rotation = DQuat::from_axis_angle(up, TAU * share);
    Camera {
        eye: pivot + rotation * (camera.eye - pivot),
        world_from_view: (rotation * camera.world_from_view).normalize(),
        ..*camera
    }
}

/// The cameras once round, evenly; the first is that which is given.
pub fn once_round(camera: &Camera, pivot: DVec3, up: DVec3, pictures: u32) -> Vec<Camera> {
    (0..pictures).map(|i| turned(camera, pivot, up, f64::from(i) / f64::from(pictures))).collect()
}

/// The first of the cameras that each see enough, stood back as far as the one that needs it most; each looks at the pivot.
/// None if there are none.
pub fn farthest(cameras: &[Camera], pivot: DVec3) -> Option<Camera> {
    let first = cameras.first()?;
    let distances = cameras.iter().map(|camera| (camera.eye - pivot).length());
    let heights = cameras.iter().filter_map(|camera| camera.parallel).map(|parallel| parallel.height);
    let eye = pivot - first.forward() * distances.fold(0.0, f64::max);
    let height = heights.fold(0.0, f64::max);
    let parallel = first.parallel.map(|parallel| Parallel { height, ..parallel });
    Some(Camera { eye, parallel, ..*first })
}

/// Where a picture goes: `NAME-007.png` for `NAME.png`.
pub fn picture_path(path: &Path, number: u32) -> PathBuf {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or("png".into(), |extension| extension.to_string_lossy());
    path.with_file_name(format!("{name}-{number:03}.{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Bounds;
    use crate::scene::views::{Projection, StandardView, UpAxis, fit};

    #[test]
    fn it_goes_once_round_at_one_height_and_shows_all_from_everywhere() {
        let bounds = Bounds::new(DVec3::new(1e6, 0.0, 0.0), DVec3::new(1e6 + 10.0, 1.0, 2.0));
        let up = UpAxis::Y;
        for projection in [Projection::default(), Projection::Parallel] {
            let orientation = StandardView::Front.orientation(up);
            let at = |turn: DQuat| fit(&bounds, &bounds, turn * orientation, projection, 1.5);
            let turns = (0..12).map(|i| DQuat::from_axis_angle(DVec3::Y, TAU * f64::from(i) / 12.0));
            let fitted: Vec<Camera> = turns.map(at).collect();
            let first = farthest(&fitted, bounds.centre()).unwrap();
            let all = once_round(&first, bounds.centre(), DVec3::Y, 12);
            assert_eq!(all.len(), 12);
            assert!(all[0].world_from_view.angle_between(first.world_from_view) < 1e-9);
            for (camera, fitted) in all.iter().zip(&fitted) {
                let towards = (bounds.centre() - camera.eye).normalize_or(camera.forward());
                assert!(camera.forward().dot(towards) > 1.0 - 1e-9, "it looks at the middle");
                assert!(camera.world_from_view.angle_between(fitted.world_from_view) < 1e-6);
                let far = |camera: &Camera| (camera.eye - bounds.centre()).length();
                let high = |camera: &Camera| camera.parallel.map_or(0.0, |parallel| parallel.height);
                assert!(far(camera) > far(fitted) - 1e-6 && high(camera) > high(fitted) - 1e-9);
            }
        }
        assert!(farthest(&[], DVec3::ZERO).is_none());
    }

    #[test]
    fn pictures_are_numbered_before_the_extension() {
        for (path, number, wanted) in [
            ("a.png", 0, "a-000.png"),
            ("some/engine.v2.png", 71, "some/engine.v2-071.png"),
            ("a", 1234, "a-1234.png"),
        ] {
            assert_eq!(picture_path(Path::new(path), number), Path::new(wanted));
        }
    }
}
