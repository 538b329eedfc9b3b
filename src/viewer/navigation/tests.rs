//! Motions of the hand: what stays where in the picture, near the origin and 10,000 km from it.

use super::motions::{depth_of, pixel_of, point_at_depth, ray_through, visible_height};
use super::*;
use glam::DQuat;
use proptest::prelude::*;

const PICTURE: Picture = Picture { width: 1600.0, height: 900.0 };
/// Far from the origin in every axis.
const FAR: DVec3 = DVec3::new(1e7, -1e7, 1e7);

fn scene(at: DVec3) -> Bounds {
    Bounds::new(at - DVec3::new(6.0, 4.0, 3.0), at + DVec3::new(6.0, 4.0, 3.0))
}

fn navigation(at: DVec3, up: UpAxis, is_parallel: bool) -> Navigation {
    let mut navigation = Navigation::new(scene(at), up, PICTURE.aspect());
    navigation.set_parallel(is_parallel);
    navigation.finish();
    navigation
}

/// Somewhere in the picture, that deep as a share of the distance to the middle of the scene.
fn picked(navigation: &Navigation, pixel: DVec2, share: f64) -> DVec3 {
    let depth = depth_of(navigation.camera(), navigation.scene().centre()) * share;
    point_at_depth(navigation.camera(), PICTURE, pixel, depth)
}

fn pixel(navigation: &Navigation, point: DVec3) -> DVec2 {
    pixel_of(navigation.camera(), PICTURE, point).unwrap()
}

fn assert_at(navigation: &Navigation, point: DVec3, wanted: DVec2) {
    let seen = pixel(navigation, point);
    assert!((seen - wanted).length() < 0.01, "{seen} and not {wanted}");
}

fn in_picture() -> impl Strategy<Value = DVec2> {
    (10.0..1590.0, 10.0..890.0).prop_map(|(x, y)| DVec2::new(x, y))
}

fn by() -> impl Strategy<Value = DVec2> {
    (-300.0..300.0, -300.0..300.0).prop_map(|(x, y)| DVec2::new(x, y))
}

fn up_axis() -> impl Strategy<Value = UpAxis> {
    prop_oneof![Just(UpAxis::Y), Just(UpAxis::Z)]
}

fn style() -> impl Strategy<Value = OrbitStyle> {
    prop_oneof![Just(OrbitStyle::Turntable), Just(OrbitStyle::Trackball)]
}

proptest! {
    #[test]
    fn the_pivot_keeps_its_pixel_under_orbit_zoom_and_roll_far_from_the_origin(
        at in in_picture(), share in 0.3..2.0, turns in prop::collection::vec(by(), 1..30), up in up_axis(),
        style in style(), flat in any::<bool>(), steps in -8.0..8.0,
    ) {
        let mut navigation = navigation(FAR, up, flat);
        navigation.style = style;
        let pivot = picked(&navigation, at, share);
        navigation.begin(Some(pivot));
        for by in turns {
            navigation.apply(Input::Orbit { by }, PICTURE);
            assert_at(&navigation, pivot, at);
        }
        navigation.apply(Input::Zoom { at, steps, picked: Some(pivot) }, PICTURE);
        assert_at(&navigation, pivot, at);
        navigation.apply(Input::Roll { from: at + DVec2::new(90.0, 0.0), to: at + DVec2::new(40.0, 70.0) }, PICTURE);
        assert_at(&navigation, pivot, at);
    }

    #[test]
    fn what_was_taken_hold_of_follows_the_cursor(
        at in in_picture(), share in 0.3..2.0, steps in prop::collection::vec(by(), 1..20), flat in any::<bool>(),
    ) {
        let mut navigation = navigation(FAR, UpAxis::Y, flat);
        let point = picked(&navigation, at, share);
        navigation.begin(Some(point));
        let mut cursor = at;
        for by in steps {
            cursor += by;
            navigation.apply(Input::Pan { by }, PICTURE);
            assert_at(&navigation, point, cursor);
        }
    }

    #[test]
    fn there_and_back_is_where_one_was(
        at in in_picture(), by in by(), up in up_axis(), style in style(), flat in any::<bool>(),
    ) {
        let mut navigation = navigation(FAR, up, flat);
        navigation.style = style;
        // Not so far that a turntable stops at straight up or down.
        let by = DVec2::new(by.x, by.y * 0.4);
        let before = *navigation.camera();
        navigation.begin(Some(picked(&navigation, at, 1.0)));
        navigation.apply(Input::Orbit { by }, PICTURE);
        prop_assume!((navigation.camera().eye - before.eye).length() > 1e-3);
        navigation.apply(Input::Orbit { by: -by }, PICTURE);
        let after = navigation.camera();
        prop_assert!((after.eye - before.eye).length() < 1e-7, "{} {}", after.eye, before.eye);
        prop_assert!(after.world_from_view.dot(before.world_from_view).abs() > 1.0 - 1e-14);
    }

    #[test]
    fn up_stays_up_on_a_turntable(
        turns in prop::collection::vec(by(), 1..60), up in up_axis(), from_above in any::<bool>(),
    ) {
        let mut navigation = navigation(FAR, up, false);
        if from_above {
            navigation.view(StandardView::Top, Framing::Keep, PICTURE.aspect());
            navigation.finish();
        }
        navigation.begin(None);
        for by in turns {
            navigation.apply(Input::Orbit { by }, PICTURE);
            let camera = navigation.camera();
            prop_assert!(camera.right().dot(up.vector()).abs() < 1e-9, "tilted");
            prop_assert!(camera.up().dot(up.vector()) > -1e-9, "upside down");
        }
    }

    #[test]
    fn with_perspective_and_without_the_pivot_looks_the_same(
        at in in_picture(), share in 0.3..2.0, beside in by(),
    ) {
        let mut navigation = navigation(FAR, UpAxis::Z, false);
        let pivot = picked(&navigation, at, share);
        // A neighbour at the same depth shows the size.
        let other = picked(&navigation, at + beside, share);
        let before = *navigation.camera();
        navigation.begin(Some(pivot));
        navigation.toggle_projection();
        navigation.finish();
        prop_assert!(navigation.camera().parallel.is_some());
        assert_at(&navigation, pivot, at);
        assert_at(&navigation, other, at + beside);
        navigation.toggle_projection();
        navigation.finish();
        prop_assert!((navigation.camera().eye - before.eye).length() < 1e-6);
        prop_assert_eq!(navigation.camera().parallel, None);
    }

    #[test]
    fn zooming_in_comes_near_and_never_through(
        at in in_picture(), steps in prop::collection::vec(-3.0..20.0, 1..60), flat in any::<bool>(),
    ) {
        let mut navigation = navigation(DVec3::ZERO, UpAxis::Y, flat);
        let point = picked(&navigation, at, 1.0);
        for steps in steps {
            navigation.apply(Input::Zoom { at, steps, picked: Some(point) }, PICTURE);
            prop_assert!(flat || depth_of(navigation.camera(), point) >= navigation.camera().near);
            prop_assert!(visible_height(navigation.camera(), depth_of(navigation.camera(), point)) > 0.0);
            assert_at(&navigation, point, at);
        }
    }

    #[test]
    fn on_the_way_the_pivot_stands_still_where_both_views_have_it_at_one_place(
        at in in_picture(), by in by(), share in 0.0..1.0f64, flat in any::<bool>(), toggled in any::<bool>(),
    ) {
        let mut navigation = navigation(FAR, UpAxis::Y, flat);
        let from = *navigation.camera();
        let pivot = picked(&navigation, at, 0.8);
        navigation.begin(Some(pivot));
        navigation.apply(Input::Orbit { by }, PICTURE);
        navigation.apply(Input::Zoom { at, steps: 4.0, picked: Some(pivot) }, PICTURE);
        if toggled {
            navigation.toggle_projection();
            navigation.finish();
        }
        let between = Transition::new(from, *navigation.camera(), pivot).at(share);
        let seen = pixel_of(&between, PICTURE, pivot).unwrap();
        prop_assert!((seen - at).length() < 0.01, "{seen} and not {at}");
    }

    #[test]
    fn a_line_of_sight_goes_through_what_is_seen_there(at in in_picture(), share in 0.1..3.0, flat in any::<bool>()) {
        let navigation = navigation(FAR, UpAxis::Y, flat);
        let point = picked(&navigation, at, share);
        let ray = ray_through(navigation.camera(), PICTURE, at);
        let off = (point - ray.start).reject_from_normalized(ray.direction).length();
        prop_assert!(off < 1e-6 && (point - ray.start).dot(ray.direction) > 0.0, "{off}");
    }
}

#[test]
fn a_thousand_motions_do_not_wear_the_picture_out() {
    let mut navigation = navigation(FAR, UpAxis::Y, false);
    let at = DVec2::new(300.0, 700.0);
    let pivot = picked(&navigation, at, 0.5);
    navigation.begin(Some(pivot));
    for step in 0..5000 {
        navigation
            .apply(Input::Orbit { by: DVec2::new(3.0, if step % 40 < 20 { 2.0 } else { -2.0 }) }, PICTURE);
    }
    assert_at(&navigation, pivot, at);
    assert!(navigation.camera().right().y.abs() < 1e-9);
}

#[test]
fn fit_shows_all_of_the_scene_and_of_the_selection() {
    for is_parallel in [false, true] {
        let mut navigation = navigation(FAR, UpAxis::Z, is_parallel);
        for shown in [scene(FAR), Bounds::new(FAR, FAR + DVec3::splat(0.5))] {
            navigation.begin(None);
            navigation.apply(Input::Orbit { by: DVec2::new(200.0, 90.0) }, PICTURE);
            navigation.fit(&shown, PICTURE.aspect());
            navigation.finish();
            let corner = |i: usize| {
                let of = |axis: usize| [shown.low, shown.high][i >> axis & 1][axis];
                DVec3::new(of(0), of(1), of(2))
            };
            for point in (0..8).map(corner) {
                let seen = pixel(&navigation, point);
                let size = DVec2::new(PICTURE.width, PICTURE.height);
                assert!(
                    seen.cmpge(DVec2::ZERO).all() && seen.cmple(size).all(),
                    "{seen} is not in the picture"
                );
            }
            assert!((navigation.pivot() - shown.centre()).length() < 1e-8);
        }
    }
}

#[test]
fn a_change_of_view_ends_exactly_after_a_quarter_of_a_second() {
    let mut navigation = navigation(FAR, UpAxis::Y, false);
    let wanted =
        Camera::look_at(FAR + DVec3::new(9.0, 30.0, 1.0), FAR, DVec3::Y, 0.9, navigation.camera().near);
    navigation.go_to(wanted);
    assert_ne!(*navigation.camera(), wanted);
    assert_eq!(*navigation.target(), wanted);
    let mut frames = 0;
    while navigation.tick(1.0 / 60.0) {
        frames += 1;
    }
    assert_eq!(frames, 15);
    assert_eq!(*navigation.camera(), wanted);
    assert!(!navigation.is_moving());
}

#[test]
fn the_hand_stops_what_is_on_its_way() {
    let mut navigation = navigation(DVec3::ZERO, UpAxis::Y, false);
    navigation.view(StandardView::Front, Framing::Keep, PICTURE.aspect());
    navigation.tick(0.1);
    let there = *navigation.camera();
    navigation.begin(None);
    assert!(!navigation.is_moving() && *navigation.camera() == there);
    assert!(!navigation.tick(1.0) && *navigation.camera() == there);
}

#[test]
fn standard_views_keep_the_pivot_or_fit() {
    for view in StandardView::ALL {
        let mut navigation = navigation(FAR, UpAxis::Z, false);
        let at = DVec2::new(1000.0, 300.0);
        let pivot = picked(&navigation, at, 0.9);
        navigation.begin(Some(pivot));
        navigation.view(view, Framing::Keep, PICTURE.aspect());
        navigation.finish();
        assert_at(&navigation, pivot, at);
        assert_eq!(navigation.camera().world_from_view, view.orientation(UpAxis::Z));
        let shown = scene(FAR);
        navigation.view(view, Framing::Fit(shown), PICTURE.aspect());
        navigation.finish();
        assert_at(&navigation, shown.centre(), PICTURE.centre());
    }
}

#[test]
fn a_face_is_looked_at_from_straight_in_front() {
    for normal in [DVec3::X, DVec3::Y, DVec3::new(1.0, 2.0, -3.0)] {
        for is_parallel in [false, true] {
            let mut navigation = navigation(FAR, UpAxis::Y, is_parallel);
            let point = FAR + DVec3::new(1.0, 2.0, 0.5);
            let depth = depth_of(navigation.camera(), point);
            let size = visible_height(navigation.camera(), depth);
            navigation.look_at_face(point, normal);
            navigation.finish();
            assert!((navigation.camera().forward() + normal.normalize()).length() < 1e-12);
            assert_at(&navigation, point, PICTURE.centre());
            let after = visible_height(navigation.camera(), depth_of(navigation.camera(), point));
            assert!((after - size).abs() < 1e-6);
        }
    }
    let mut navigation = navigation(FAR, UpAxis::Y, false);
    navigation.look_at_face(FAR, DVec3::ZERO);
    assert!(!navigation.is_moving());
}

#[test]
fn the_picture_turns_with_the_hand() {
    let mut navigation = navigation(DVec3::ZERO, UpAxis::Y, false);
    let at = DVec2::new(500.0, 500.0);
    let pivot = picked(&navigation, at, 1.0);
    let right_of_it = picked(&navigation, at + DVec2::new(100.0, 0.0), 1.0);
    navigation.begin(Some(pivot));
    // From the right of the pivot to below it is clockwise.
    navigation
        .apply(Input::Roll { from: at + DVec2::new(80.0, 0.0), to: at + DVec2::new(0.0, 50.0) }, PICTURE);
    assert_at(&navigation, right_of_it, at + DVec2::new(0.0, 100.0));
    navigation.level();
    navigation.finish();
    assert!(navigation.camera().right().y.abs() < 1e-12);
    assert_at(&navigation, pivot, at);
}

#[test]
fn the_model_turns_with_the_hand() {
    let mut navigation = navigation(DVec3::ZERO, UpAxis::Y, false);
    navigation.view(StandardView::Front, Framing::Keep, 1.0);
    navigation.finish();
    navigation.begin(Some(DVec3::ZERO));
    let front = DVec3::Z;
    let before = pixel(&navigation, front);
    navigation.apply(Input::Orbit { by: DVec2::new(50.0, 30.0) }, PICTURE);
    let after = pixel(&navigation, front);
    assert!(after.x > before.x && after.y > before.y, "{before} {after}");
}

#[test]
fn flying_goes_where_one_looks_at_the_speed_of_the_scene() {
    let mut navigation = navigation(FAR, UpAxis::Y, true);
    navigation.enter_fly();
    navigation.finish();
    let before = *navigation.camera();
    assert!(before.parallel.is_none());
    assert!(!navigation.fly(FlyKeys { forward: true, back: true, ..FlyKeys::default() }, 0.05));
    assert!(navigation.fly(FlyKeys { forward: true, ..FlyKeys::default() }, 0.05));
    let step = navigation.camera().eye - before.eye;
    let diagonal = scene(FAR).diagonal();
    assert!((step - before.forward() * (0.1 * diagonal * 0.05)).length() < 1e-7);
    navigation.change_fly_speed(2.0);
    navigation.fly(FlyKeys { right: true, fast: true, ..FlyKeys::default() }, 60.0);
    let aside = (navigation.camera().eye - before.eye - step).dot(before.right());
    assert!((aside - 0.1 * diagonal * 0.1 * 1.25 * 1.25 * 5.0).abs() < 1e-7, "a slow frame makes no leap");
    let eye = navigation.camera().eye;
    navigation.apply(Input::Look { by: DVec2::new(120.0, -40.0) }, PICTURE);
    assert_eq!(navigation.camera().eye, eye);
    assert!(navigation.camera().right().y.abs() < 1e-12);
}

#[test]
fn where_nothing_is_under_the_cursor_one_still_comes_forward() {
    let mut navigation = navigation(DVec3::ZERO, UpAxis::Y, false);
    let before = *navigation.camera();
    for _ in 0..200 {
        navigation.apply(Input::Zoom { at: PICTURE.centre(), steps: 1.0, picked: None }, PICTURE);
    }
    let way = (navigation.camera().eye - before.eye).dot(before.forward());
    assert!(way > 2.0 * before.eye.length(), "stopped after {way}");
}

#[test]
fn nonsense_moves_nothing_and_small_pictures_divide_by_nothing() {
    let mut navigation = navigation(FAR, UpAxis::Y, false);
    let before = *navigation.camera();
    navigation.begin(Some(DVec3::NAN));
    for by in [DVec2::NAN, DVec2::INFINITY] {
        for input in [Input::Orbit { by }, Input::Pan { by }, Input::ZoomDrag { by }, Input::Look { by }] {
            navigation.apply(input, PICTURE);
            assert_eq!(*navigation.camera(), before, "{input:?}");
        }
    }
    navigation.go_to(Camera { eye: DVec3::NAN, ..before });
    assert!(!navigation.is_moving());
    navigation.apply(Input::Pan { by: DVec2::ONE }, Picture::new(0.0, f64::NAN));
    assert!(navigation.camera().eye.is_finite());
    for bounds in [Bounds::EMPTY, Bounds::new(FAR, FAR)] {
        let mut navigation = Navigation::new(bounds, UpAxis::Y, 1.0);
        navigation.apply(Input::Zoom { at: DVec2::ZERO, steps: 3.0, picked: None }, PICTURE);
        navigation.toggle_projection();
        navigation.finish();
        navigation.apply(Input::Orbit { by: DVec2::ONE }, PICTURE);
        assert!(navigation.camera().eye.is_finite());
    }
}

#[test]
fn between_two_views_of_which_one_does_not_see_the_pivot_one_goes_straight() {
    let from = Camera::look_at(FAR, FAR + DVec3::X, DVec3::Y, 1.0, 0.1);
    let to = Camera::look_at(FAR + DVec3::Z * 4.0, FAR, DVec3::Y, 1.0, 0.1);
    let half = Transition::new(from, to, FAR - DVec3::X).at(0.5);
    assert!((half.eye - FAR - DVec3::Z * 2.0).length() < 1e-8);
    assert!((half.world_from_view.length() - 1.0).abs() < 1e-12);
    assert_ne!(half.world_from_view, DQuat::IDENTITY);
}
