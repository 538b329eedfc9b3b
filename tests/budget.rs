//! Random scenes, without a GPU: budgets are spent, states exist, tiers have room for them.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its scene should fail loudly"
)]

mod common;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use collapsar::container::{Contents, Form, StoredInstance, StoredPart, write};
use collapsar::geometry::Boundary;
use collapsar::geometry::body::order_part;
use collapsar::import::{Material, Node};
use collapsar::reference::select::{SelectView, select};
use collapsar::scene::{CameraPath, Scene};
use collapsar::select::{StateChooser, select_rows};
use collapsar::stream::residency::{ResidencyOptions, Wanted};
use collapsar::stream::{Residency, State};
use glam::{DAffine3, DQuat, DVec3};
use proptest::prelude::*;

/// A scene of spheres, boxes and fields, placed at random.
fn scene_of(sizes: &[u32], placements: &[([f64; 3], f64)]) -> Arc<Scene> {
    let parts: Vec<StoredPart> = sizes
        .iter()
        .enumerate()
        .map(|(i, &size)| {
            let mesh = match i % 3 {
                0 => common::sphere(size, size + 3),
                1 => common::patched_box(size),
                _ => common::height_field(size),
            };
            let part = order_part(&mesh, Boundary::Slide).cells.remove(0);
            StoredPart { part, name: mesh.name, source: i as u32, cell: false }
        })
        .collect();
    let place = |(i, (at, scale)): (usize, &([f64; 3], f64))| StoredInstance {
        part: (i % parts.len()) as u32,
        node: 0,
        material: 0,
        world_from_part: DAffine3::from_scale_rotation_translation(
            DVec3::splat(*scale),
            DQuat::from_rotation_y(i as f64),
            DVec3::from(*at),
        ),
    };
    let instances = placements.iter().enumerate().map(place).collect();
    let contents = Contents {
        parts,
        instances,
        nodes: vec![Node { name: "root".into(), parent: None }],
        materials: vec![Material::default()],
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.clps");
    write(&path, &contents, Form::Plain, &AtomicBool::new(false)).unwrap();
    Arc::new(Scene::open(&path).unwrap())
}

fn view_of(scene: &Scene, frame: u64, budget: u32, dead_band: f32) -> SelectView {
    let camera = CameraPath::parse("teleport").unwrap().camera(10 * frame, 1000, scene.bounds());
    let mut planes = [[0.0, 0.0, 0.0, 1.0]; 6];
    for (plane, found) in planes.iter_mut().zip(camera.frustum_planes(1.5)) {
        *plane = found.to_array();
    }
    SelectView {
        eye: camera.eye.to_array(),
        planes,
        focal_px: camera.focal_px(1000),
        parallel: false,
        min_area_px: 1.0,
        max_area_px: 1.5e6,
        alpha: 3.0,
        error_px: 0.0,
        dead_band,
        budget,
    }
}

/// Everything that exists, in memory.
fn everything(scene: &Arc<Scene>) -> Residency {
    let mut residency = Residency::new(scene, ResidencyOptions::default());
    let all = (0..scene.parts().len() as u32).map(|part| Wanted { part, tier: 0, weight: 1.0 });
    residency.plan(&all.collect::<Vec<_>>());
    residency.settle().unwrap();
    residency
}

/// The instances with a wish.
fn wished(wishes: &[u32]) -> Vec<u32> {
    (0..wishes.len() as u32).filter(|&instance| wishes[instance as usize] > 0).collect()
}

fn placements() -> impl Strategy<Value = Vec<([f64; 3], f64)>> {
    prop::collection::vec((prop::array::uniform3(-20.0f64..20.0), 0.2f64..5.0), 1..60)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_budget_is_spent(
        sizes in prop::collection::vec(2u32..14, 1..6),
        placements in placements(),
        shares in prop::collection::vec(0.0f64..1.0, 12),
        dead_band in prop_oneof![Just(0.0f32), 0.0f32..0.1],
    ) {
        let scene = scene_of(&sizes, &placements);
        let residency = everything(&scene);
        let rows = select_rows(&scene);
        let mut chooser = StateChooser::default();
        let mut states = vec![State::default(); rows.len()];
        let mut wishes = vec![0; rows.len()];
        let mut spendable = 0;
        for (frame, share) in shares.iter().enumerate() {
            // What is visible is known after a selection with any budget.
            let probe = select(&rows, &view_of(&scene, frame as u64 / 3, 1, 0.0).params(rows.len() as u32), &wishes);
            let visible: Vec<usize> = (0..rows.len()).filter(|&i| probe[i] > 0).collect();
            let least: u64 = visible.iter().map(|&i| u64::from(rows[i].floor)).sum();
            let most: u64 = visible.iter().map(|&i| u64::from(rows[i].ceiling)).sum();
            let budget = least + ((most - least) as f64 * share) as u64;
            let view = view_of(&scene, frame as u64 / 3, budget.max(1) as u32, dead_band);
            wishes = select(&rows, &view.params(rows.len() as u32), &wishes);
            chooser.choose(&scene, &residency, (&wishes, &wished(&wishes)), dead_band > 0.0, &mut states);
            let spent: u64 = states.iter().map(|state| u64::from(state.vertices)).sum();
            if !visible.is_empty() {
                spendable += 1;
                // A step from state to state may be several vertices (all wedges of a position), and then a small
                // budget cannot be met to the vertex.
                let step = largest_step(&scene, &residency);
                let slack = (budget as f64 * 0.001).max(f64::from(step - 1));
                prop_assert!((spent as f64 - budget as f64).abs() <= slack, "{spent} of {budget}, step {step}");
            }
            for (i, state) in states.iter().enumerate() {
                check_state(&scene, &residency, scene.instances()[i].part, *state)?;
            }
        }
        prop_assume!(spendable > 0);
    }

    #[test]
    fn large_budgets_are_spent_within_a_thousandth(share in 0.05f64..1.0, placements in placements()) {
        let scene = scene_of(&[40, 24, 32], &placements);
        let residency = everything(&scene);
        let rows = select_rows(&scene);
        let none = vec![0; rows.len()];
        let most: u64 = rows.iter().map(|row| u64::from(row.ceiling)).sum();
        let budget = (most as f64 * share) as u32;
        // From far away everything is visible.
        let mut view = view_of(&scene, 0, budget, 0.0);
        view.planes = [[0.0, 0.0, 0.0, 1.0]; 6];
        view.min_area_px = 0.0;
        let wishes = select(&rows, &view.params(rows.len() as u32), &none);
        let mut states = vec![State::default(); rows.len()];
        StateChooser::default().choose(&scene, &residency, (&wishes, &wished(&wishes)), false, &mut states);
        let spent: u64 = states.iter().map(|state| u64::from(state.vertices)).sum();
        let least: u64 = rows.iter().map(|row| u64::from(row.floor)).sum();
        prop_assert!(u64::from(budget) >= least);
        prop_assert!((spent as f64 - f64::from(budget)).abs() <= 0.001 * f64::from(budget), "{spent} of {budget}");
    }
}

fn largest_step(scene: &Scene, residency: &Residency) -> u32 {
    let steps = (0..scene.parts().len() as u32).map(|part| {
        let at = residency.part(part).triangles_at();
        let floor = scene.parts()[part as usize].locked as usize;
        let states: Vec<usize> = (floor..=at.len()).filter(|&vn| at.is_state(vn)).collect();
        states.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(1)
    });
    steps.max().unwrap_or(1) as u32
}

fn check_state(scene: &Scene, residency: &Residency, part: u32, state: State) -> Result<(), TestCaseError> {
    if state.is_empty() {
        return Ok(());
    }
    let at = residency.part(part).triangles_at();
    let tier = &scene.tiers(part)[state.tier as usize];
    prop_assert!(at.is_state(state.vertices as usize), "{} is inside a group", state.vertices);
    prop_assert_eq!(state.triangles, at.count_at(state.vertices as usize));
    prop_assert!(state.vertices <= tier.vertices && state.triangles <= tier.triangles);
    prop_assert_eq!(state.ecol, tier.vertices);
    Ok(())
}

/// With `--live` the first frames have little to draw; what has arrived since is drawn though no wish has changed.
#[test]
fn what_arrives_is_drawn_at_an_unchanged_wish() {
    let scene = scene_of(&[9, 6, 12], &[([0.0; 3], 1.0), ([5.0, 0.0, 0.0], 2.0), ([0.0, 9.0, 0.0], 1.0)]);
    let wishes: Vec<u32> = select_rows(&scene).iter().map(|row| row.ceiling).collect();
    let mut chooser = StateChooser::default();
    let mut states = vec![State::default(); wishes.len()];
    let nothing = Residency::new(&scene, ResidencyOptions::default());
    let visible = wished(&wishes);
    let early = chooser.choose(&scene, &nothing, (&wishes, &visible), true, &mut states);
    assert_eq!((early.visible, early.misses), (3, 3));
    assert!(states.iter().all(|state| state.is_empty()));
    let late = chooser.choose(&scene, &everything(&scene), (&wishes, &visible), true, &mut states);
    assert_eq!(late.misses, 0);
    let drawn: Vec<u32> = states.iter().map(|state| state.vertices).collect();
    assert_eq!(drawn, wishes);
}
