use super::*;
use proptest::prelude::*;

const BUILT_IN: [&str; 5] = ["orbit", "walk", "through", "still", "teleport"];

fn built_in() -> [CameraPath; 5] {
    BUILT_IN.map(|name| CameraPath::parse(name).unwrap())
}

fn cube(centre: DVec3, half: f64) -> Bounds {
    Bounds::new(centre - half, centre + half)
}

fn assert_usable(camera: &Camera, what: &str) {
    assert!(camera.eye.is_finite() && camera.world_from_view.is_finite(), "{what}: {camera:?}");
    assert!((camera.world_from_view.length() - 1.0).abs() < 1e-9, "{what}: {camera:?}");
    assert!(camera.near > 0.0 && camera.near as f32 > 0.0 && (camera.near as f32).is_finite(), "{what}");
    let matrix = camera.clip_from_relative(1.6);
    assert!(matrix.is_finite(), "{what}: {matrix}");
}

#[test]
fn every_path_is_finite_on_degenerate_bounds() {
    let flat = Bounds::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 0.0));
    for bounds in [
        Bounds::EMPTY,
        Bounds::new(DVec3::NAN, DVec3::INFINITY),
        Bounds::new(DVec3::MIN, DVec3::MAX),
        cube(DVec3::ZERO, 0.0),
        cube(DVec3::splat(1e12), 0.0),
        cube(DVec3::ZERO, 1e12),
        cube(DVec3::ZERO, 1e-12),
        cube(DVec3::splat(1e7), 1e-12),
        cube(DVec3::ZERO, 1e-300),
        flat,
    ] {
        for path in built_in() {
            for (frame, frames) in [(0, 0), (0, 1), (7, 300), (299, 300), (u64::MAX, u64::MAX), (5, 2)] {
                let camera = path.camera(frame, frames, &bounds);
                assert_usable(&camera, &format!("{} {frame}/{frames} {bounds:?}", path.name()));
            }
        }
    }
}

#[test]
fn paths_are_deterministic_and_named() {
    let bounds = cube(DVec3::new(3.0, -2.0, 9.0), 12.0);
    for (path, name) in built_in().iter().zip(BUILT_IN) {
        assert_eq!(path.name(), name);
        assert_eq!(path.camera(123, 300, &bounds), path.clone().camera(123, 300, &bounds));
    }
}

#[test]
fn orbit_goes_once_round() {
    let bounds = cube(DVec3::ZERO, 1.0);
    let eyes: Vec<_> = (0..4).map(|frame| CameraPath::Orbit.camera(frame, 4, &bounds).eye).collect();
    assert!(
        (eyes[0] + eyes[2]).with_y(0.0).length() < 1e-9 && (eyes[1] + eyes[3]).with_y(0.0).length() < 1e-9
    );
    assert!(eyes.iter().all(|eye| eye.y > 0.0 && (eye.length() - bounds.diagonal()).abs() < 1e-9));
}

#[test]
fn through_starts_before_one_end_and_ends_beyond_the_other() {
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let extent = DVec3::ONE + axis * 20.0;
        let bounds = Bounds::new(DVec3::splat(5.0), DVec3::splat(5.0) + extent);
        let [from, to] = [0, 99].map(|frame| CameraPath::Through.camera(frame, 100, &bounds));
        assert!(from.eye.dot(axis) < bounds.low.dot(axis) && to.eye.dot(axis) > bounds.high.dot(axis));
        assert!((from.forward() - axis).length() < 1e-9);
    }
}

#[test]
fn still_never_moves() {
    let bounds = cube(DVec3::ONE, 3.0);
    assert_eq!(CameraPath::Still.camera(0, 300, &bounds), CameraPath::Still.camera(299, 300, &bounds));
}

#[test]
fn teleport_jumps_every_ten_frames_inside_and_around() {
    let bounds = cube(DVec3::ONE, 3.0);
    let at = |frame| CameraPath::Teleport.camera(frame, 300, &bounds);
    for view in 0..30 {
        assert_eq!(at(view * 10), at(view * 10 + 9));
        assert_ne!(at(view * 10), at(view * 10 + 10));
    }
    let inside = |eye: DVec3| eye.cmpge(bounds.low).all() && eye.cmple(bounds.high).all();
    let count = (0..100).filter(|view| inside(at(view * 10).eye)).count();
    assert!((30..=80).contains(&count), "{count} of 100 views are inside");
}

#[test]
fn walk_starts_at_an_overview_and_comes_nearer() {
    let bounds = cube(DVec3::ZERO, 1.0);
    let distance = |frame| CameraPath::Walk.camera(frame, 300, &bounds).eye.length() / bounds.diagonal();
    assert!((0.75..0.85).contains(&distance(0)), "{}", distance(0));
    assert!(distance(1500) < 0.45);
}

proptest! {
    #[test]
    fn walk_takes_small_steps(
        low in prop::array::uniform3(-1e6f64..1e6),
        size in prop::array::uniform3(prop_oneof![Just(0.0), 1e-6..1e-3, 0.1..10.0, 1e3..1e6]),
        frame in 0u64..100_000,
    ) {
        let low = DVec3::from_array(low);
        let bounds = Bounds::new(low, low + DVec3::from_array(size));
        let [a, b] = [frame, frame + 1].map(|f| CameraPath::Walk.camera(f, 300, &bounds));
        // Coordinates near 1e6 round at 1e-10, which may add to a step of a scene of no extent.
        prop_assert!((b.eye - a.eye).length() <= WALK_STEP * bounds.scale() + 1e-9);
        prop_assert!(turn_degrees(a.world_from_view, b.world_from_view) <= WALK_TURN_DEGREES);
        prop_assert!((a.world_from_view.dot(b.world_from_view).abs().min(1.0).acos() * 2.0).to_degrees() <= WALK_TURN_DEGREES);
    }

    #[test]
    fn paths_are_finite(
        low in prop::array::uniform3(-1e12f64..1e12),
        size in prop::array::uniform3(0f64..1e12),
        frame in 0u64..1000,
    ) {
        let low = DVec3::from_array(low);
        let bounds = Bounds::new(low, low + DVec3::from_array(size));
        for path in built_in() {
            assert_usable(&path.camera(frame, 1000, &bounds), path.name());
        }
    }
}

fn parse_text(text: &str) -> Result<CameraPath, CameraPathError> {
    let file = tempfile::NamedTempFile::with_suffix(".json").unwrap();
    std::fs::write(file.path(), text).unwrap();
    CameraPath::parse(file.path().to_str().unwrap())
}

#[test]
fn keyframes_are_interpolated() {
    let path = parse_text(
        r#"[{"frame":10,"eye":[0,0,0],"target":[1,0,0]},
            {"frame":20,"eye":[10,0,0],"target":[10,0,1],"up":[0,1,0],"fov_degrees":90}]"#,
    )
    .unwrap();
    let at = |frame| path.camera(frame, 100, &cube(DVec3::ZERO, 1.0));
    assert_eq!(at(0), at(10));
    assert_eq!(at(20), at(99));
    assert!((at(15).eye - DVec3::new(5.0, 0.0, 0.0)).length() < 1e-12);
    assert!((at(15).forward() - DVec3::new(0.5f64.sqrt(), 0.0, 0.5f64.sqrt())).length() < 1e-9);
    assert!((at(15).vertical_fov_radians.to_degrees() - 67.5).abs() < 1e-9);
}

#[test]
fn bad_keyframes_are_refused_with_the_path_last() {
    let cases = [
        ("[]", "no keyframe"),
        ("", "JSON"),
        ("{}", "JSON"),
        ("[1]", "JSON"),
        (r#"[{"frame":-1,"eye":[0,0,0],"target":[1,0,0]}]"#, "JSON"),
        (r#"[{"frame":0,"eye":[0,0],"target":[1,0,0]}]"#, "JSON"),
        (r#"[{"frame":0,"eye":[1e999,0,0],"target":[1,0,0]}]"#, "JSON"),
        (r#"[{"frame":0,"eye":[1e300,0,0],"target":[1,0,0]}]"#, "keyframe 0: coordinates"),
        (r#"[{"frame":0,"eye":[1,0,0],"target":[1,0,0]}]"#, "keyframe 0: eye and target"),
        (r#"[{"frame":0,"eye":[1,0,0],"target":[2,0,0],"up":[0,0,0]}]"#, "up must not be zero"),
        (r#"[{"frame":0,"eye":[1,0,0],"target":[2,0,0],"fov_degrees":0}]"#, "fov_degrees"),
        (
            r#"[{"frame":5,"eye":[1,0,0],"target":[2,0,0]},{"frame":5,"eye":[1,0,0],"target":[2,0,0]}]"#,
            "keyframe 1: frames must increase",
        ),
    ];
    for (text, expected) in cases {
        let message = parse_text(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
        assert!(message.ends_with(".json"), "{message}");
    }
}

#[test]
fn missing_files_and_folders_are_refused() {
    let missing = CameraPath::parse("no-such-path.json").unwrap_err().to_string();
    assert!(missing.contains("orbit, walk") && missing.ends_with("no-such-path.json"), "{missing}");
    let folder = tempfile::tempdir().unwrap();
    let message = CameraPath::parse(folder.path().to_str().unwrap()).unwrap_err().to_string();
    assert!(message.starts_with("cannot read the camera path"), "{message}");
}
