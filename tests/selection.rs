//! Selection by groups and candidates against the reference, which looks at every instance.

use collapsar::container::{Groups, InstanceRow, PartRow};
use collapsar::gpu::layout::{SelectParams, SelectRow};
use collapsar::reference::{self, SelectView};
use collapsar::scene::Camera;
use collapsar::scene::opened::instance_box;
use collapsar::select::cull::Cull;
use collapsar::select::select_row;
use collapsar::select::spend::spend;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use proptest::prelude::*;

/// Parts of several sizes: whole ones, and one of a parent cell, another below it, and four leaf cells.
fn parts() -> Vec<PartRow> {
    let part = |size: u32, step_exponent: i32, vertices: u32| PartRow {
        step_exponent,
        grid_high: [size, size / 3, size / 7],
        vertices,
        locked: 4,
        errors: std::array::from_fn(|i| 100 + 8 * i as u8),
        ..PartRow::default()
    };
    let cell = |parent_distance, leaf_cells| PartRow {
        parent_distance,
        leaf_cells,
        source: 9,
        flags: PartRow::CELL,
        ..part(700, -4, if leaf_cells > 0 { 300 } else { 9000 })
    };
    let whole = [part(100, -6, 500), part(1 << 20, -14, 60_000), part(70, -12, 24), part(0, 0, 8)];
    let cells = [cell(0, 4), cell(1, 2), cell(1, 0), cell(2, 0), cell(4, 0), cell(5, 0)];
    whole.into_iter().chain(cells).collect()
}

/// A scene in memory.
struct Made {
    rows: Vec<SelectRow>,
    groups: Groups,
}

fn made(placements: &[(u32, DAffine3)]) -> Made {
    let parts = parts();
    let cells = |part: u32| if part < 4 { part..part + 1 } else { 4..10 };
    let instances: Vec<InstanceRow> = placements
        .iter()
        .flat_map(|&(part, transform)| {
            let world_from_part = transform.to_cols_array();
            cells(part).map(move |part| InstanceRow { part, world_from_part, ..InstanceRow::default() })
        })
        .collect();
    let rows = (0u32..).zip(&instances).map(|(number, instance)| {
        let part = &parts[instance.part as usize];
        let parent = (!part.is_root()).then(|| number - part.parent_distance);
        select_row(part, &instance_box(part, instance), parent)
    });
    Made { rows: rows.collect(), groups: Groups::build(&parts, || instances.iter().copied()) }
}

/// Both ways; gives the wishes.
fn check(made: &Made, cull: &mut Cull, params: &SelectParams, old: &[u32]) -> Vec<u32> {
    let candidates = cull.find(&made.groups, params).to_vec();
    let all = 0..made.rows.len() as u32;
    let seen = all.filter(|&i| !reference::select::is_culled(&made.rows[i as usize], params));
    assert!(seen.eq(candidates.iter().copied()), "candidates");
    let mut wishes = vec![0; made.rows.len()];
    for (&instance, wish) in candidates.iter().zip(spend(&made.rows, &candidates, params, old)) {
        wishes[instance as usize] = wish;
    }
    assert!(wishes == reference::select(&made.rows, params, old), "wishes");
    wishes
}

/// A view from among the placements, mostly.
fn view(eye: DVec3, towards: DVec3, fov: f64, min_area_px: f32, budget: u32) -> SelectView {
    let camera = Camera::look_at(eye, eye + towards, DVec3::Z, fov, 0.01);
    let mut planes = [[0.0, 0.0, 0.0, 1.0]; 6];
    for (plane, found) in planes.iter_mut().zip(camera.frustum_planes(1.6)) {
        *plane = found.to_array();
    }
    SelectView {
        eye: eye.to_array(),
        planes,
        focal_px: camera.focal_px(720),
        parallel: false,
        min_area_px,
        max_area_px: 1e6,
        alpha: 3.0,
        error_px: 0.0,
        dead_band: 0.03,
        budget,
    }
}

prop_compose! {
    fn any_vector(size: f64)(x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0) -> DVec3 { DVec3::new(x, y, z) * size }
}

prop_compose! {
    /// Rotated, mirrored, flattened or of no size at all, and sometimes beyond what f32 or f64 can hold.
    fn any_transform()(
        at in any_vector(100.0),
        axis in any_vector(1.0),
        scale in prop_oneof![
            8 => Just(DVec3::ONE), 2 => any_vector(3.0), 1 => Just(DVec3::ZERO), 1 => Just(DVec3::new(1.0, -1.0, 0.0)),
        ],
        far in prop_oneof![60 => Just(1.0), 1 => Just(1e9), 1 => Just(1e18), 1 => Just(1e39), 1 => Just(1e308)],
    ) -> DAffine3 {
        let rotation = DQuat::from_scaled_axis(axis * 3.0);
        DAffine3 {
            matrix3: DMat3::from_quat(rotation) * DMat3::from_diagonal(scale) * if far > 1e38 { far } else { 1.0 },
            translation: at * far,
        }
    }
}

prop_compose! {
    fn any_view()(
        eye in any_vector(120.0),
        towards in any_vector(1.0),
        fov in 0.02f64..2.5,
        min_area_px in prop_oneof![Just(0f32), 0.01f32..3000.0],
        budget in prop_oneof![Just(0u32), 0u32..3000, 0u32..3_000_000, Just(u32::MAX)],
        error_px in prop_oneof![Just(0f32), 0.01f32..50.0],
        dead_band in prop_oneof![Just(0f32), 0f32..0.5],
        parallel in any::<bool>(),
    ) -> SelectView {
        SelectView { error_px, dead_band, parallel, ..view(eye, towards, fov, min_area_px, budget) }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn by_groups_the_wishes_are_those_of_the_reference(
        placements in prop::collection::vec((0u32..5, any_transform()), 0..900),
        origin in prop_oneof![2 => Just(0.0), 1 => Just(1e4), 1 => Just(-3e7)],
        views in prop::collection::vec(any_view(), 1..5),
    ) {
        let moved: Vec<_> = placements
            .iter()
            .map(|&(part, transform)| (part, DAffine3::from_translation(DVec3::splat(origin)) * transform))
            .collect();
        let made = made(&moved);
        let mut cull = Cull::new(&made.groups, &made.rows);
        let mut old = vec![0; made.rows.len()];
        for mut view in views {
            view.eye = view.eye.map(|c| c + origin);
            old = check(&made, &mut cull, &view.params(made.rows.len() as u32), &old);
        }
    }
}

/// Bolts in a grid of a hundred each way, 40 apart.
fn grid() -> Made {
    let at = |i: u32| DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.0) * 40.0;
    made(&(0..10_000).map(|i| (0, DAffine3::from_translation(at(i)))).collect::<Vec<_>>())
}

#[test]
fn what_the_frustum_does_not_touch_is_not_tested() {
    let made = grid();
    let mut cull = Cull::new(&made.groups, &made.rows);
    let count = made.rows.len() as u32;
    let narrow = view(DVec3::new(2000.0, 2000.0, 500.0), DVec3::NEG_Z, 0.4, 0.0, 100_000).params(count);
    let seen = cull.find(&made.groups, &narrow).len();
    assert!((20..100).contains(&seen), "{seen}");
    assert!(cull.tested() < 1000, "{}", cull.tested());
    let away = view(DVec3::new(2000.0, 2000.0, 500.0), DVec3::Z, 0.4, 0.0, 100_000).params(count);
    assert_eq!((cull.find(&made.groups, &away).len(), cull.tested()), (0, 0));
}

#[test]
fn groups_of_what_is_too_small_are_not_tested() {
    let made = grid();
    let mut cull = Cull::new(&made.groups, &made.rows);
    let from = |z: f64| view(DVec3::new(2000.0, 2000.0, z), DVec3::NEG_Z, 1.5, 1.0, 100_000).params(10_000);
    assert_eq!(cull.find(&made.groups, &from(3000.0)).len(), 0);
    assert_eq!(cull.tested(), 0);
    assert!(!cull.find(&made.groups, &from(300.0)).is_empty());
    assert!(cull.tested() < 5000, "{}", cull.tested());
}

#[test]
fn an_eye_that_is_nowhere_culls_nothing_that_the_reference_keeps() {
    let made = grid();
    for eye in [DVec3::splat(f64::NAN), DVec3::splat(1e300), DVec3::splat(f64::INFINITY)] {
        let params =
            SelectView { eye: eye.to_array(), ..view(DVec3::ZERO, DVec3::X, 1.0, 1.0, 9999) }.params(10_000);
        check(&made, &mut Cull::new(&made.groups, &made.rows), &params, &vec![0; 10_000]);
    }
}

/// The result does not depend on how many threads there are.
#[test]
fn one_thread_finds_the_same() {
    let made = grid();
    let params =
        view(DVec3::new(0.0, 0.0, 300.0), DVec3::new(1.0, 1.0, -0.2), 1.0, 0.5, 200_000).params(10_000);
    let find = || check(&made, &mut Cull::new(&made.groups, &made.rows), &params, &vec![0; 10_000]);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(find);
    assert!(one.iter().any(|&wish| wish > 0));
    assert_eq!(one, find());
}
