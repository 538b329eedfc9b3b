//! Caps on what is held, in memory and on the GPU: kept whatever they are, and settled soon.
//!
//! Every frame of these flights waits for what it asked for, so that they do not depend on the machine.

#![expect(clippy::unwrap_used, reason = "a test's helpers panic to fail it")]

mod common;

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use collapsar::bake::BakeOptions;
use collapsar::frame::{FrameError, Renderer, Settings};
use collapsar::gpu::{Gpu, GpuOptions, testing};
use collapsar::scene::{Camera, CameraPath, Scene};
use collapsar::select::SelectOn;
use collapsar::stats::FrameRecord;
use collapsar::stream::residency::{Change, Residency, ResidencyOptions, Wanted};
use proptest::prelude::*;

/// The device, or `None` where the environment says that there is none.
fn device(test: &str) -> Option<Arc<Gpu>> {
    if std::env::var(testing::NO_GPU_VARIABLE).is_ok_and(|value| value == "1") {
        testing::log_run(test, None);
        return None;
    }
    let gpu = Arc::new(Gpu::new(&GpuOptions::default()).unwrap());
    testing::log_run(test, Some(&gpu.adapter_info.name));
    Some(gpu)
}

/// Parts of many sizes, each in its own place.
fn scene() -> Arc<Scene> {
    scene_stored(false)
}

fn scene_stored(compress: bool) -> Arc<Scene> {
    let meshes: Vec<_> = (0..40u32)
        .map(|i| {
            let mut mesh = common::height_field(6 + i % 8 * 9);
            let at = [(i % 7) as f32 * 1.2, (i / 7) as f32 * 1.2, (i % 3) as f32 * 0.4];
            mesh.positions.iter_mut().for_each(|p| (0..3).for_each(|axis| p[axis] += at[axis]));
            mesh
        })
        .collect();
    common::baked_meshes_with(&meshes, &BakeOptions { compress, ..BakeOptions::default() })
}

const SETTINGS: fn() -> Settings = || Settings {
    budget_vertices: 60_000,
    select: SelectOn::Cpu,
    width: 200,
    height: 150,
    samples: 1,
    ..Settings::default()
};

/// Flies around the scene and then rests; the records of both.
fn fly(gpu: &Arc<Gpu>, scene: &Arc<Scene>, settings: Settings) -> Result<[Vec<FrameRecord>; 2], FrameError> {
    let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(scene), settings)?;
    let path = CameraPath::parse("orbit").unwrap();
    let cameras: Vec<Camera> = (0..24).map(|frame| path.camera(frame, 24, scene.bounds())).collect();
    let moving = cameras.iter().map(|camera| renderer.frame(camera)).collect::<Result<Vec<_>, _>>()?;
    let rest = (0..60).map(|_| renderer.frame(&cameras[23])).collect::<Result<Vec<_>, _>>()?;
    Ok([moving, rest])
}

/// Twenty steps from `least` to `most`, by the same factor.
fn steps(least: u64, most: u64) -> impl Iterator<Item = u64> {
    let ratio = most as f64 / least as f64;
    (0..20).map(move |i| (least as f64 * ratio.powf(f64::from(i) / 19.0)).ceil() as u64)
}

/// What the error of a cap that is too small says would be enough.
fn least_of(result: Result<[Vec<FrameRecord>; 2], FrameError>) -> u64 {
    match result {
        Err(FrameError::CapTooSmall { need_bytes, .. }) => need_bytes,
        other => panic!("no error of a cap: {:?}", other.map(|_| ())),
    }
}

#[track_caller]
fn assert_settled(rest: &[FrameRecord], cap: u64) {
    let moved = |record: &FrameRecord| record.bytes_sent + record.disk_bytes + record.evicted_bytes;
    let last = rest.iter().rposition(|record| moved(record) > 0).map_or(0, |frame| frame + 1);
    assert!(last < rest.len() / 2, "under {cap} bytes it still moves bytes in frame {last} at rest");
}

#[test]
fn memory_stays_below_any_cap_and_what_fits_is_drawn() {
    let Some(gpu) = device("residency::memory_stays_below_any_cap_and_what_fits_is_drawn") else {
        return;
    };
    let scene = scene();
    let with = |cap| Settings { memory_limit_bytes: Some(cap), ..SETTINGS() };
    let least = least_of(fly(&gpu, &scene, with(1)));
    assert_eq!(least_of(fly(&gpu, &scene, with(least - 1))), least);
    let [free, _] = fly(&gpu, &scene, SETTINGS()).unwrap();
    let chunks = free.iter().map(|record| record.resident_bytes).max().unwrap();
    let mut drawn = Vec::new();
    for cap in steps(least, least + 2 * chunks) {
        let [moving, rest] = fly(&gpu, &scene, with(cap)).unwrap();
        for record in moving.iter().chain(&rest) {
            assert!(
                record.memory_bytes <= cap,
                "{} of {cap} bytes in frame {}",
                record.memory_bytes,
                record.frame
            );
        }
        assert_settled(&rest, cap);
        drawn.push(rest[59].active_vertices);
    }
    assert!(drawn[0] > 0, "nothing is drawn under the least cap");
    let uncapped = fly(&gpu, &scene, SETTINGS()).unwrap()[1][59].active_vertices;
    assert_eq!(drawn[19], uncapped, "an ample cap changes the picture");
    assert!(drawn.is_sorted(), "more memory draws less: {drawn:?}");
}

#[test]
fn gpu_memory_stays_below_any_cap() {
    let Some(gpu) = device("residency::gpu_memory_stays_below_any_cap") else { return };
    let scene = scene();
    let with = |cap| Settings { gpu_limit_bytes: Some(cap), ..SETTINGS() };
    let least = least_of(fly(&gpu, &scene, with(1)));
    let [free, _] = fly(&gpu, &scene, SETTINGS()).unwrap();
    let ample = 2 * free.iter().map(|record| record.gpu_bytes).max().unwrap();
    let mut drawn = Vec::new();
    // The least cap counts what a small transfer takes; a little more is needed for a larger one.
    for cap in steps(least + least / 8, ample) {
        let [moving, rest] = fly(&gpu, &scene, with(cap)).unwrap();
        for record in moving.iter().chain(&rest) {
            assert!(record.gpu_bytes <= cap, "{} of {cap} bytes in frame {}", record.gpu_bytes, record.frame);
        }
        assert_settled(&rest, cap);
        drawn.push(rest[59].active_vertices);
    }
    assert!(drawn[0] > 0 && drawn[19] > 50_000, "{drawn:?}");
}

/// Without a cap the budget decides, also where the coarsest states of all are more than it.
#[test]
fn the_budget_is_a_cap_too() {
    let Some(gpu) = device("residency::the_budget_is_a_cap_too") else { return };
    let scene = scene();
    for budget_vertices in [100, 400, 2000, 20_000] {
        let [moving, rest] = fly(&gpu, &scene, Settings { budget_vertices, ..SETTINGS() }).unwrap();
        for record in moving.iter().chain(&rest) {
            let most = budget_vertices as f64 * 1.02;
            assert!(record.active_vertices as f64 <= most, "{} of {budget_vertices}", record.active_vertices);
        }
        assert!(rest[59].active_vertices > 0, "{budget_vertices}: {:?}", rest[59]);
    }
}

/// What is urgent comes first, whatever the order in which it is asked for; what a cap leaves out is what matters least.
#[test]
fn a_cap_keeps_the_most_error_removed_for_each_byte() {
    let scene = scene();
    let bytes = |residency: &Residency| residency.bytes_held();
    let want = |part: u32, weight: f32| Wanted { part, tier: 0, weight };
    let parts = scene.parts().len() as u32;
    let all: Vec<Wanted> = (0..parts).map(|part| want(part, if part % 2 == 0 { 1e6 } else { 1.0 })).collect();
    let others: Vec<Wanted> = (0..parts).filter(|part| part % 2 == 1).map(|part| want(part, 1.0)).collect();
    let mut free = Residency::new(&scene, ResidencyOptions::default());
    free.plan(&others);
    free.settle().unwrap();
    let cap = bytes(&free);
    let mut capped = Residency::new(&scene, ResidencyOptions { cap_bytes: Some(cap), read_rate: None });
    capped.plan(&all);
    capped.settle().unwrap();
    assert!(bytes(&capped) <= cap && capped.is_capped(), "{} of {cap}", bytes(&capped));
    let share = |part: u32| {
        f64::from(capped.part(part).vertices_arrived()) / f64::from(scene.parts()[part as usize].vertices)
    };
    let mean =
        |odd: u32| (0..parts).filter(|part| part % 2 == odd).map(share).sum::<f64>() / f64::from(parts / 2);
    assert!(mean(0) == 1.0 && mean(1) < 0.9, "{} and {}", mean(0), mean(1));
    // The others, now: the cap holds all the way, and in the end it is theirs.
    capped.plan(&others);
    capped.settle().unwrap();
    assert!(bytes(&capped) <= cap);
    for part in others.iter().map(|want| want.part) {
        assert_eq!(capped.part(part).vertices_arrived(), scene.parts()[part as usize].vertices);
    }
    // The same plan again moves nothing.
    capped.take_bytes_read();
    capped.take_bytes_evicted();
    capped.plan(&others);
    capped.settle().unwrap();
    assert_eq!((capped.take_bytes_read(), capped.take_bytes_evicted()), (0, 0));
}

/// What will be wanted is read after what is, and never in its place; what is neither makes room for it.
#[test]
fn what_comes_next_takes_only_what_is_free() {
    let scene = scene();
    let want = |part: u32| Wanted { part, tier: 0, weight: 1.0 };
    let (now, next, later) = ([want(3), want(5)], [want(11)], [want(15)]);
    let whole = |residency: &Residency, part: u32| {
        residency.part(part).vertices_arrived() == scene.parts()[part as usize].vertices
    };
    let with = |cap_bytes| Residency::new(&scene, ResidencyOptions { cap_bytes, read_rate: None });
    let bytes_of = |wanted: &[Wanted]| {
        let mut free = with(None);
        free.plan(wanted);
        free.settle().unwrap();
        free.bytes_held()
    };
    // No room: nothing of it is read.
    let mut tight = with(Some(bytes_of(&now)));
    tight.plan(&now);
    tight.prefetch(&next);
    tight.settle().unwrap();
    assert!(now.iter().all(|want| whole(&tight, want.part)));
    assert_eq!(tight.part(11).vertices_arrived(), 0);
    // Room for one: the one that was there before goes, not what is wanted.
    let cap = bytes_of(&now) + bytes_of(&next).max(bytes_of(&later));
    let mut roomy = with(Some(cap));
    for coming in [&next, &later] {
        roomy.plan(&now);
        roomy.prefetch(coming);
        roomy.settle().unwrap();
        assert!(now.iter().all(|want| whole(&roomy, want.part)) && whole(&roomy, coming[0].part));
        assert!(roomy.bytes_held() <= cap, "{} of {cap}", roomy.bytes_held());
    }
    // Once it is wanted, nothing is read.
    roomy.take_bytes_read();
    roomy.plan(&later);
    assert!(!roomy.is_waiting() && roomy.take_bytes_read() == 0);
    // All wishes at once fit only in part: there is nothing to spare for what comes next.
    let less = bytes_of(&now) / 2;
    let mut capped = with(Some(less));
    capped.plan(&now);
    capped.prefetch(&next);
    capped.settle().unwrap();
    assert!(capped.is_capped() && capped.part(11).vertices_arrived() == 0 && capped.bytes_held() <= less);
}

/// Compressed chunks are decoded from coarser ones that were read with them or are held: what arrives is the same as
/// without, it takes the same room, and what is read for it is less.
#[test]
fn compressed_chunks_arrive_as_plain_ones() {
    let scenes = [false, true].map(scene_stored);
    let parts = scenes[0].parts().len() as u32;
    let tiers = |part: u32| scenes[0].tiers(part).len() as u32;
    let finer = |from: u32| (0..parts).filter(move |part| part % 2 == from % 2);
    let all = |from: u32, tier: fn(u32) -> u32| -> Vec<Wanted> {
        finer(from).map(|part| Wanted { part, tier: tier(tiers(part)), weight: 1.0 }).collect()
    };
    let plans = [all(0, |tiers| tiers - 1), all(0, |tiers| tiers / 2), all(1, |_| 0), all(0, |_| 0)];
    assert!((0..parts).any(|part| tiers(part) > 3), "several coarser ones");
    for share in [2.0, 0.6, 0.2] {
        let whole: u64 = (0..parts).map(|part| scenes[0].read_part(part).unwrap().bytes()).sum();
        let cap_bytes = Some((whole as f64 * share) as u64);
        let with = |scene| Residency::new(scene, ResidencyOptions { cap_bytes, read_rate: None });
        let [mut plain, mut compressed] = [with(&scenes[0]), with(&scenes[1])];
        let mut read = [0, 0];
        for plan in &plans {
            for (bytes, residency) in read.iter_mut().zip([&mut plain, &mut compressed]) {
                residency.plan(plan);
                residency.settle().unwrap();
                *bytes += residency.take_bytes_read();
            }
            assert_eq!(plain.bytes_held(), compressed.bytes_held());
            for (a, b) in (0..parts).map(|part| (plain.part(part), compressed.part(part))) {
                let vertices = 0..a.vertices_arrived();
                assert_eq!(a.vertices_arrived(), b.vertices_arrived());
                assert!(a.vertices(vertices.clone()).eq(b.vertices(vertices.clone())));
                assert!(a.ecol(vertices.clone()).eq(b.ecol(vertices)));
                assert!((0..8).all(|tier| a.triangles(tier) == b.triangles(tier)));
            }
        }
        assert!(read[1] * 2 < read[0] && read[1] > 0, "{read:?}");
    }
}

/// What is wanted of every part of a scene, as a view may: changed here and there from plan to plan.
#[derive(Debug, Clone)]
struct Step {
    /// Part, tier (or none), as shares of how many there are.
    changes: Vec<(f64, Option<f64>)>,
    /// The share of the parts, from the first on, of which nothing is wanted any more.
    dropped: f64,
    /// By part, for as many as there are.
    weights: Vec<f32>,
}

fn steps_of(parts: usize) -> impl Strategy<Value = Vec<Step>> {
    let change = (0.0..1.0f64, proptest::option::weighted(0.7, 0.0..1.0f64));
    let weights = prop::collection::vec(prop::sample::select(vec![0.0f32, 1.0, 30.0, 1e6, 2e6]), parts);
    let dropped = prop_oneof![3 => Just(0.0), 1 => 0.0..1.0f64];
    let step = (prop::collection::vec(change, 0..16), dropped, weights);
    let step = step.prop_map(|(changes, dropped, weights)| Step { changes, dropped, weights });
    prop::collection::vec(step, 4..16)
}

/// What can be told of a residency that does not depend on who read faster.
fn told(residency: &mut Residency, parts: u32) -> (Vec<u32>, [u64; 3], bool) {
    let arrived = (0..parts).map(|part| residency.part(part).vertices_arrived()).collect();
    let [read, evicted] = [residency.take_bytes_read(), residency.take_bytes_evicted()];
    (arrived, [read, evicted, residency.bytes_held()], residency.is_capped())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Following what changes comes to the same as planning everything anew, under any cap: what is there, what was read and
    /// evicted for it in every step, compressed or not. What is told of parts without a look at them is so.
    #[test]
    fn following_changes_is_planning_over_everything(
        steps in steps_of(40),
        share in 0.05..1.5f64,
        compress in any::<bool>(),
    ) {
        static SCENES: [OnceLock<Arc<Scene>>; 2] = [OnceLock::new(), OnceLock::new()];
        let scene = SCENES[usize::from(compress)].get_or_init(|| scene_stored(compress));
        let parts = scene.parts().len();
        let whole: Vec<Wanted> =
            (0..parts as u32).map(|part| Wanted { part, tier: 0, weight: 1.0 }).collect();
        let mut free = Residency::new(scene, ResidencyOptions::default());
        free.plan(&whole);
        free.settle().unwrap();
        let cap = (share < 1.2).then(|| (free.bytes_held() as f64 * share) as u64);
        let with = || Residency::new(scene, ResidencyOptions { cap_bytes: cap, read_rate: None });
        let (mut following, mut anew) = (with(), with());
        let mut wanted: Vec<Option<u32>> = vec![None; parts];
        let mut weights = vec![0.0; parts];
        for step in steps {
            let mut changed = BTreeSet::new();
            let dropped = (step.dropped * parts as f64) as usize;
            for (part, want) in wanted.iter_mut().enumerate().take(dropped) {
                if want.take().is_some() {
                    changed.insert(part);
                }
            }
            for (part, tier) in step.changes {
                let part = (part * parts as f64) as usize;
                let tiers = scene.tiers(part as u32).len() as f64;
                wanted[part] = tier.map(|tier| (tier * tiers) as u32);
                changed.insert(part);
            }
            let change = |&part: &usize| Change { part: part as u32, tier: wanted[part] };
            let changes: Vec<Change> = changed.iter().map(change).collect();
            let is_reweighed = weights != step.weights;
            weights = step.weights;
            following.follow(&changes, is_reweighed, &|part| weights[part as usize]);
            let all: Vec<Wanted> = (0..parts as u32)
                .filter_map(|part| {
                    let weight = weights[part as usize];
                    wanted[part as usize].map(|tier| Wanted { part, tier, weight })
                })
                .collect();
            anew.plan(&all);
            following.settle().unwrap();
            anew.settle().unwrap();
            prop_assert_eq!(told(&mut following, parts as u32), told(&mut anew, parts as u32));
            prop_assert!(cap.is_none_or(|cap| following.bytes_held() <= cap));
            for part in 0..parts as u32 {
                let held = following.part(part);
                prop_assert_eq!(following.vertices_arrived(part), held.vertices_arrived());
                for tier in 0..scene.tiers(part).len() as u32 {
                    let is_there = held.finest().is_some_and(|finest| finest <= tier);
                    prop_assert_eq!(following.can_draw(part, tier), is_there);
                }
            }
        }
    }
}
