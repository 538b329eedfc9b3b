//! What does selection cost when a scene has many instances and a view shows few of them?
//!
//! Makes a ship in memory: hull plates, decks, pipes along them, and on these the small parts of which there are most;
//! 718 k instances, and 2 M. Three cameras see about 1 %, 10 % and 100 % of them; the last also from so far away that most
//! are too small. Each is selected many times, with a budget of 40 vertices for each instance seen: by the reference, which
//! looks at all instances; by groups on one thread, and on all; and by the GPU pass among the candidates, read back in the
//! same frame. The ways alternate.
//!
//! Printed: median milliseconds (of the thread for the reference and one thread, else of the clock), the reference's over
//! those of one thread, and the instances that were tested by themselves.
//!
//! The expected answer is checked: all ways wish the same, and at 1 % seen one thread needs at most an eighth of the reference.
//!
//! `cargo bench --bench select -- [INSTANCES...]`; `--shuffle` for instances in no order.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should stop")]

use std::hint::black_box;
use std::time::Instant;

use collapsar::container::{Groups, InstanceRow, PartRow};
use collapsar::gpu::layout::SelectRow;
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::reference::{self, SelectView};
use collapsar::scene::Camera;
use collapsar::scene::opened::instance_box;
use collapsar::select::cull::Cull;
use collapsar::select::spend::spend;
use collapsar::select::{GpuSelect, select_row};
use glam::{DAffine3, DMat3, DQuat, DVec3};

const RUNS: usize = 9;
/// Length, width and height of the ship.
const SHIP: DVec3 = DVec3::new(200.0, 30.0, 20.0);

/// A pseudo-random fraction (splitmix64).
fn fraction(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The parts: a plate, a pipe, a bracket, a bolt; a millimetre a step.
fn parts() -> Vec<PartRow> {
    let part = |size: [u32; 3], vertices| PartRow {
        step_exponent: -10,
        grid_high: size,
        vertices,
        locked: 4,
        errors: std::array::from_fn(|i| 120 + 8 * i as u8),
        ..PartRow::default()
    };
    vec![
        part([6000, 3000, 20], 900),
        part([4000, 100, 100], 500),
        part([200, 150, 60], 300),
        part([40, 20, 20], 120),
    ]
}

/// In the order of a model: section by section along the ship, in each a part and what is fixed to it.
fn instances(count: usize) -> Vec<InstanceRow> {
    let place = |i: usize| {
        let (carrier, seed) = (i / 200, 5 * i as u64);
        let near = |axis: u64| fraction(carrier as u64 * 7 + axis + (1 << 40));
        let along = (carrier as f64 + near(0)) / (count / 200 + 1) as f64;
        let deck = (near(2) * 6.0).floor() / 6.0;
        let base = DVec3::new(along, near(1), deck) * SHIP;
        let part = match i % 200 {
            0 => 0,
            1..10 => 1,
            10..50 => 2,
            _ => 3,
        };
        let offset = DVec3::new(fraction(seed) * 6.0, fraction(seed + 1) * 3.0, fraction(seed + 2) * 0.3);
        let turn = DQuat::from_rotation_z((fraction(seed + 3) * 4.0).floor() * std::f64::consts::FRAC_PI_2);
        let transform = DAffine3 { matrix3: DMat3::from_quat(turn), translation: base + offset };
        InstanceRow { part, world_from_part: transform.to_cols_array(), ..InstanceRow::default() }
    };
    (0..count).map(place).collect()
}

struct Made {
    rows: Vec<SelectRow>,
    groups: Groups,
}

fn made(count: usize, shuffle: bool) -> Made {
    let (parts, mut instances) = (parts(), instances(count));
    if shuffle {
        (1..count).for_each(|i| instances.swap(i, (fraction(i as u64) * i as f64) as usize));
    }
    let started = Instant::now();
    let groups = Groups::build(&parts, || instances.iter().copied());
    println!(
        "{count} instances, {} groups, built in {:.2} s",
        groups.rows.len(),
        started.elapsed().as_secs_f64()
    );
    let row = |instance: &InstanceRow| {
        let part = &parts[instance.part as usize];
        select_row(part, &instance_box(part, instance), None)
    };
    Made { rows: instances.iter().map(row).collect(), groups }
}

fn view(eye: DVec3, target: DVec3, fov: f64, min_area_px: f32) -> SelectView {
    let camera = Camera::look_at(eye, target, DVec3::Z, fov, 0.05);
    let mut planes = [[0.0, 0.0, 0.0, 1.0]; 6];
    for (plane, found) in planes.iter_mut().zip(camera.frustum_planes(16.0 / 9.0)) {
        *plane = found.to_array();
    }
    SelectView {
        eye: eye.to_array(),
        planes,
        focal_px: camera.focal_px(1080),
        parallel: false,
        min_area_px,
        max_area_px: 1920.0 * 1080.0,
        alpha: 3.0,
        error_px: 0.0,
        dead_band: 0.03,
        budget: 0,
    }
}

/// The view along the ship from one end, inside, narrowed until it shows this share; all of it from outside for 1.
fn view_of_share(made: &Made, cull: &mut Cull, share: f64) -> SelectView {
    let outside = view(DVec3::new(-150.0, -300.0, 150.0), SHIP * 0.5, 1.0, 0.0);
    if share >= 1.0 {
        return outside;
    }
    let at = |fov: f64| view(DVec3::new(-20.0, 15.3, 9.1), SHIP * DVec3::new(1.0, 0.45, 0.4), fov, 0.0);
    let mut seen = |view: &SelectView| {
        let params = view.params(made.rows.len() as u32);
        cull.find(&made.groups, &params).len() as f64 / made.rows.len() as f64
    };
    let (mut low, mut high) = (1e-3, 2.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if seen(&at(middle)) < share { low = middle } else { high = middle }
    }
    at(high)
}

/// Milliseconds that this thread has had a core for, where the system says so (other work then does not count), or else
/// that have gone by.
fn busy_ms(started: Instant) -> f64 {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let ns = line.split(' ').next().and_then(|ns| ns.parse::<f64>().ok());
    ns.map_or(started.elapsed().as_secs_f64() * 1e3, |ns| ns * 1e-6)
}

/// On one thread, repeated until it is long enough for the system's clock of a thread.
fn busy<T>(mut work: impl FnMut() -> T) -> (T, f64) {
    let started = Instant::now();
    let before = busy_ms(started);
    for times in 1.. {
        let result = black_box(work());
        if started.elapsed().as_secs_f64() > 0.1 {
            return (result, (busy_ms(started) - before) / f64::from(times));
        }
    }
    unreachable!("a tenth of a second goes by")
}

fn clocked<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let started = Instant::now();
    let result = black_box(work());
    (result, started.elapsed().as_secs_f64() * 1e3)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let shuffle = arguments.iter().any(|argument| argument == "--shuffle");
    let named: Vec<usize> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    let counts = if named.is_empty() { vec![718_000, 2_000_000] } else { named };
    let gpu = Gpu::new(&GpuOptions::default()).ok();
    println!("GPU: {}", gpu.as_ref().map_or("none", |gpu| &gpu.adapter_info.name));
    for count in counts {
        let made = made(count, shuffle);
        println!(
            "{:<22} {:>9} {:>9} {:>10} {:>10} {:>10} {:>10} {:>10} {:>8}",
            "view", "seen", "tested", "all, ms", "groups", "1 thread", "n threads", "GPU", "quotient"
        );
        let mut cull = Cull::new(&made.groups, &made.rows);
        for share in [0.01, 0.1, 1.0] {
            let view = view_of_share(&made, &mut cull, share);
            bench(&made, gpu.as_ref(), &format!("{:.0} % seen", share * 100.0), &view);
        }
        let small = SelectView { min_area_px: 20.0, ..view_of_share(&made, &mut cull, 1.0) };
        bench(&made, gpu.as_ref(), "all, most too small", &small);
    }
}

fn bench(made: &Made, gpu: Option<&Gpu>, name: &str, view: &SelectView) {
    let Made { rows, groups } = made;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut cull = Cull::new(groups, rows);
    let seen = cull.find(groups, &view.params(rows.len() as u32)).len();
    let tested = cull.tested();
    let params = SelectView { budget: 40 * seen as u32, ..*view }.params(rows.len() as u32);
    let gpu = gpu.filter(|gpu| GpuSelect::fits(gpu, rows.len()));
    let mut on_gpu = gpu.map(|gpu| GpuSelect::new(gpu, rows).unwrap());
    let old = vec![0; rows.len()];
    let mut times: [Vec<f64>; 5] = Default::default();
    for _ in 0..RUNS {
        let (all, ms) = busy(|| reference::select(rows, &params, &old));
        times[0].push(ms);
        times[1].push(one.install(|| busy(|| cull.find(groups, &params).len()).1));
        let mut select = || {
            let candidates = cull.find(groups, &params);
            (candidates.to_vec(), spend(rows, candidates, &params, &old))
        };
        times[2].push(one.install(|| busy(&mut select).1));
        let ((instances, wishes), ms) = clocked(&mut select);
        times[3].push(ms);
        let wished = |found: &[u32]| instances.iter().zip(found).all(|(&i, &wish)| all[i as usize] == wish);
        assert!(instances.len() == seen && wished(&wishes), "the same wishes");
        if let Some((gpu, on_gpu)) = gpu.zip(on_gpu.as_mut()) {
            // What this holds on to is the last result: with nothing to hold on to the first time.
            let (found, ms) =
                clocked(|| on_gpu.update(gpu, &params, cull.find(groups, &params), true).unwrap());
            assert_eq!(found.unwrap().0.len(), seen);
            times[4].push(ms);
        }
    }
    let [all, groups, one, many, gpu] =
        times.map(|times| if times.is_empty() { f64::NAN } else { median(times) });
    println!(
        "{name:<22} {seen:>9} {tested:>9} {all:>10.2} {groups:>10.3} {one:>10.2} {many:>10.2} {gpu:>10.2} {:>8.1}",
        all / one
    );
    assert!(seen * 50 > rows.len() || all / one > 8.0, "1 % seen should cost less than an eighth of all");
}
