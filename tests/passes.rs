//! Every pass against its reference: one suite of cases, compared bit for bit, with poisoned outputs.
//!
//! A machine without an adapter fails these tests, unless `COLLAPSAR_NO_GPU=1` says that it has none.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking, as tests do")]

use std::sync::OnceLock;

use bytemuck::Pod;
use collapsar::geometry::{TriangleRecord, VertexRecord};
use collapsar::gpu::layout::{
    ActiveVertex, DefragmentParams, FRESH, Grant, GrantParams, NO_PARENT_ROW, ReformParams, SelectParams,
    SelectRow,
};
use collapsar::gpu::shader::{KernelLayout, Shader, read, uniform, write};
use collapsar::gpu::timer::Timer;
use collapsar::gpu::{Gpu, GpuError, GpuOptions, readback};
use collapsar::passes::defragment::{DefragmentBuffers, Stream};
use collapsar::passes::grant::GrantBuffers;
use collapsar::passes::reform::ReformBuffers;
use collapsar::passes::select::SelectBuffers;
use collapsar::passes::{Defragment, GrantPass, POWER, PrefixSum, Reform, Select};
use collapsar::reference::{self, SelectView, Starts};
use collapsar::select::GpuSelect;
use proptest::prelude::*;
use wgpu::{Buffer, ComputePass};

// ---- the GPU ----

/// The one device of all tests, or `None` where the environment says that there is none.
fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Option<Gpu>> = OnceLock::new();
    let gpu = GPU.get_or_init(|| {
        let skipped = std::env::var("COLLAPSAR_NO_GPU").is_ok_and(|value| value == "1");
        (!skipped).then(|| Gpu::new(&GpuOptions::default()).unwrap_or_else(|error| panic!("{error}")))
    });
    let test = std::thread::current().name().unwrap_or("").to_owned();
    match gpu {
        Some(gpu) => eprintln!("{test}: on {}", gpu.adapter_info.name),
        None => eprintln!("skipped: {test}, as COLLAPSAR_NO_GPU=1 says that this machine has no GPU"),
    }
    gpu.as_ref()
}

const POISON: u32 = 0xCDCD_CDCD;
/// Words after each output that no pass may touch.
const GUARD: usize = 128;

fn upload<T: Pod>(gpu: &Gpu, values: &[T]) -> Buffer {
    let bytes = bytemuck::cast_slice(values);
    let buffer = gpu.storage("input", bytes.len() as u64).unwrap();
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// A buffer for `count` values of `T`, poisoned, with a guard behind.
fn poisoned<T: Pod>(gpu: &Gpu, count: usize) -> Buffer {
    upload(gpu, &vec![POISON; count * size_of::<T>() / 4 + GUARD])
}

/// The values of a buffer of [`poisoned`], after a look at its guard.
fn output<T: Pod>(gpu: &Gpu, buffer: &Buffer, count: usize) -> Vec<T> {
    let words = count * size_of::<T>() / 4;
    let all: Vec<u32> = readback::read_values(gpu, buffer, words + GUARD).unwrap();
    assert!(all[words..].iter().all(|&word| word == POISON), "written beyond the end");
    bytemuck::pod_collect_to_vec(&all[..words])
}

fn compute(gpu: &Gpu, record: impl FnOnce(&mut ComputePass<'_>)) {
    let mut encoder = gpu.encoder("test");
    record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
    gpu.submit(encoder).unwrap();
}

/// Compares without printing millions of values.
fn assert_same<T: PartialEq + std::fmt::Debug>(what: &str, gpu: &[T], reference: &[T]) {
    assert_eq!(gpu.len(), reference.len(), "{what}: length");
    if let Some(at) = (0..gpu.len()).find(|&at| gpu[at] != reference[at]) {
        panic!("{what}: element {at} is {:x?} on the GPU and {:x?} in the reference", gpu[at], reference[at]);
    }
}

// ---- the cases ----

/// Scrambles its argument (splitmix64).
fn scramble(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

fn below(seed: u64, end: u32) -> u32 {
    (scramble(seed) % u64::from(end.max(1))) as u32
}

/// What an instance holds: vertices, ecol, triangles, and which version of each block.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Held {
    counts: [u32; 3],
    versions: [u32; 3],
}

/// From one frame to the next.
#[derive(Debug, Clone, Copy)]
struct Change {
    old: Held,
    new: Held,
}

/// `counts` are put in order: there are as many ecol entries as vertices at least, and triangles need a vertex.
fn held([v, e, t]: [u32; 3], versions: [u32; 3]) -> Held {
    Held { counts: [v, e.max(v).min(1 << 16), if v == 0 { 0 } else { t }], versions }
}

fn change(old: [u32; 3], new: [u32; 3]) -> Change {
    Change { old: held(old, [0; 3]), new: held(new, [0; 3]) }
}

fn random_held(seed: u64, end: u32) -> Held {
    let count = |i| below(seed * 7 + i, end);
    let version = |i| below(seed * 7 + i, 5) / 4;
    held([count(0), count(1), count(2)], [version(3), version(4), version(5)])
}

fn random_changes(seed: u64, instances: u64, end: u32) -> Vec<Change> {
    let changes = (0..instances).map(|i| {
        let old = random_held(seed + 2 * i, end);
        // A third does not change.
        let new = if below(seed ^ i, 3) == 0 { old } else { random_held(seed + 2 * i + 1, end) };
        Change { old, new }
    });
    changes.collect()
}

/// The suite: a name and what changes.
fn cases() -> Vec<(&'static str, Vec<Change>)> {
    let repeat = |change, count| vec![change; count];
    let fresh = |mut change: Change| {
        change.new.versions = [1; 3];
        change
    };
    let only = |at: usize, count: usize, big: Change, small: Change| {
        (0..count).map(|i| if i == at { big } else { small }).collect::<Vec<_>>()
    };
    let alternating = |i: u64| match i % 2 {
        0 => change([100, 150, 200], [10, 150, 12]),
        _ => change([7, 9, 3], [120, 130, 260]),
    };
    vec![
        ("empty", vec![]),
        ("one empty instance", repeat(change([0; 3], [0; 3]), 1)),
        ("one element", repeat(change([0; 3], [1; 3]), 1)),
        ("one element leaves", repeat(change([1; 3], [0; 3]), 1)),
        ("a workgroup in one instance", repeat(change([1; 3], [64; 3]), 1)),
        ("one more in one instance", repeat(change([64; 3], [65; 3]), 1)),
        ("a workgroup of instances", repeat(change([0, 1, 0], [1; 3]), 64)),
        ("one more instance", repeat(change([1; 3], [1, 2, 1]), 65)),
        ("a block of instances", repeat(change([0; 3], [1; 3]), 256)),
        ("more than 65,535 workgroups", repeat(change([40_000; 3], [65_536, 65_536, 65_540]), 65)),
        ("all in one", only(77, 200, change([30_000; 3], [60_000, 65_000, 90_000]), change([0; 3], [0; 3]))),
        ("all in the first", only(0, 300, change([0; 3], [500; 3]), change([3; 3], [0; 3]))),
        ("all in the last", only(299, 300, change([0; 3], [500; 3]), change([0; 3], [0; 3]))),
        ("many empty", (0..5000).map(|i| change([0; 3], [u32::from(i % 50 == 7) * 90; 3])).collect()),
        ("alternating", (0..301).map(alternating).collect()),
        ("all fresh", (0..301).map(|i| fresh(alternating(i))).collect()),
        ("nothing changes", repeat(change([20, 30, 40], [20, 30, 40]), 100)),
        ("random, small", random_changes(1, 400, 12)),
        ("random", random_changes(2, 300, 900)),
        ("random, many", random_changes(3, 20_000, 40)),
    ]
}

fn vertex(instance: usize, at: u32, version: u32) -> ActiveVertex {
    let word = scramble((instance as u64) << 40 | u64::from(at) << 8 | u64::from(version) << 1);
    let words = [word as u32, (word >> 32) as u32, at];
    ActiveVertex { record: VertexRecord { words }, instance: instance as u32 }
}

fn ecol(instance: usize, at: u32, version: u32) -> u32 {
    match at {
        0 => 0,
        // Every seventh instance is one long chain.
        _ if instance % 7 == 3 && at < 300 => at - 1,
        _ => below((instance as u64) << 40 | u64::from(at) << 8 | u64::from(version) << 1 | 1, at),
    }
}

/// Corners are inside the `ecol` of the frame in which the triangle was sent; flags tell triangles apart.
fn triangle(instance: usize, at: u32, version: u32, ecol_count: u32) -> TriangleRecord {
    let seed = (instance as u64) << 40 | u64::from(at) << 8 | u64::from(version) << 4;
    let corner = |i| below(seed | i, ecol_count) as u16;
    TriangleRecord { vertices: [corner(2), corner(3), corner(4)], flags: at as u16 }
}

/// All that a frame is made of, on the host.
#[derive(Default)]
struct Frame {
    grants: Vec<Grant>,
    old: [Vec<u32>; 3],
    new: [Vec<u32>; 3],
    streamed: [Vec<u32>; 3],
    existing: Elements,
    streamed_elements: Elements,
    /// What the active buffers must hold.
    expected: Elements,
    streamed_words: Vec<u32>,
    bases: [u32; 3],
}

#[derive(Default, Debug, PartialEq)]
struct Elements {
    vertices: Vec<ActiveVertex>,
    ecol: Vec<u32>,
    triangles: Vec<TriangleRecord>,
}

impl Elements {
    /// Appends elements `kept[s]..counts[s]` of each stream; the corners of kept triangles stay as they were.
    fn push(&mut self, instance: usize, from: [u32; 3], state: &Held, ecol_counts: impl Fn(u32) -> u32) {
        let [v, e, t] = std::array::from_fn(|s| from[s]..state.counts[s]);
        self.vertices.extend(v.map(|at| vertex(instance, at, state.versions[0])));
        self.ecol.extend(e.map(|at| ecol(instance, at, state.versions[1])));
        self.triangles.extend(t.map(|at| triangle(instance, at, state.versions[2], ecol_counts(at))));
    }
}

fn granted(change: &Change, stream: usize) -> u32 {
    let fresh = change.old.versions[stream] != change.new.versions[stream];
    change.new.counts[stream] | if fresh { FRESH } else { 0 }
}

/// How much of each stream is kept.
fn kept(change: &Change) -> [u32; 3] {
    std::array::from_fn(|s| {
        let same = change.old.versions[s] == change.new.versions[s];
        if same { change.old.counts[s].min(change.new.counts[s]) } else { 0 }
    })
}

impl Frame {
    fn of(changes: &[Change]) -> Self {
        let mut frame = Self::default();
        for (instance, change) in changes.iter().enumerate() {
            frame.push(instance, change);
        }
        frame.pack();
        frame
    }

    fn push(&mut self, instance: usize, change: &Change) {
        let kept = kept(change);
        let [old_ecol, new_ecol] = [change.old.counts[1], change.new.counts[1]];
        for (s, kept) in kept.into_iter().enumerate() {
            self.old[s].push(change.old.counts[s]);
            self.new[s].push(change.new.counts[s]);
            self.streamed[s].push(change.new.counts[s] - kept);
        }
        if change.old != change.new {
            let [vertices, ecol, triangles] = std::array::from_fn(|s| granted(change, s));
            self.grants.push(Grant { instance: instance as u32, vertices, ecol, triangles });
        }
        let ecol_at = |at| if at < kept[2] { old_ecol } else { new_ecol };
        self.existing.push(instance, [0; 3], &change.old, |_| old_ecol);
        self.streamed_elements.push(instance, kept, &change.new, ecol_at);
        self.expected.push(instance, [0; 3], &change.new, ecol_at);
    }

    /// The streamed words, after a few of padding to see that bases count.
    fn pack(&mut self) {
        let words = &mut self.streamed_words;
        words.resize(5, POISON);
        self.bases[0] = words.len() as u32;
        words.extend(self.streamed_elements.vertices.iter().flat_map(|v| v.record.words));
        self.bases[1] = words.len() as u32;
        let halves = self.streamed_elements.ecol.chunks(2);
        words.extend(halves.map(|pair| pair[0] | pair.get(1).map_or(0xCDCD << 16, |high| high << 16)));
        self.bases[2] = words.len() as u32;
        words.extend(bytemuck::pod_collect_to_vec::<_, u32>(&self.streamed_elements.triangles));
    }

    fn instance_count(&self) -> u32 {
        self.old[0].len() as u32
    }

    fn total(&self, stream: usize) -> u32 {
        self.new[stream].iter().sum()
    }

    fn defragment_params(&self) -> DefragmentParams {
        DefragmentParams {
            instance_count: self.instance_count(),
            vertex_total: self.total(0),
            ecol_total: self.total(1),
            triangle_total: self.total(2),
            vertex_base: self.bases[0],
            ecol_base: self.bases[1],
            triangle_base: self.bases[2],
            padding: 0,
        }
    }

    fn reform_params(&self) -> ReformParams {
        ReformParams { instance_count: self.instance_count(), triangle_total: self.total(2) }
    }

    fn starts(&self, stream: usize) -> [Vec<u32>; 3] {
        [&self.new, &self.old, &self.streamed].map(|counts| reference::prefix_sum(&counts[stream]))
    }
}

/// Runs a check over the suite.
fn for_each_case(check: impl Fn(&'static Gpu, &str, &Frame)) {
    let Some(gpu) = gpu() else { return };
    for (name, changes) in cases() {
        check(gpu, name, &Frame::of(&changes));
    }
}

// ---- the passes ----

#[test]
fn grant_agrees_with_its_reference() {
    let built = OnceLock::new();
    for_each_case(|gpu, case, frame| {
        let pass = built.get_or_init(|| GrantPass::new(gpu));
        let count = frame.instance_count();
        let padded = |list: &[u32]| upload(gpu, &[list, &[POISON; GUARD]].concat());
        let budgets: Vec<_> = frame.old.iter().map(|list| padded(list)).collect();
        let streamed: Vec<_> = (0..3).map(|_| poisoned::<u32>(gpu, count as usize)).collect();
        let buffers = GrantBuffers {
            grants: &upload(gpu, &frame.grants),
            budgets: std::array::from_fn(|s| &budgets[s]),
            streamed: std::array::from_fn(|s| &streamed[s]),
        };
        let params = GrantParams { grant_count: frame.grants.len() as u32, instance_count: count };
        let mut encoder = gpu.encoder(case);
        GrantPass::clear(&mut encoder, &buffers, count);
        pass.record(gpu, &mut encoder.begin_compute_pass(&Default::default()), &params, &buffers);
        gpu.submit(encoder).unwrap();

        let mut expected = frame.old.clone();
        let [v, e, t] = &mut expected;
        let expected_streamed = reference::grant(&frame.grants, [v, e, t]);
        assert_eq!(expected, frame.new, "{case}: reference");
        assert_eq!(expected_streamed, frame.streamed, "{case}: reference");
        for s in 0..3 {
            assert_same(case, &output::<u32>(gpu, &budgets[s], count as usize), &expected[s]);
            assert_same(case, &output::<u32>(gpu, &streamed[s], count as usize), &expected_streamed[s]);
        }
    });
}

#[test]
fn grants_of_instances_that_do_not_exist_are_ignored() {
    let Some(gpu) = gpu() else { return };
    let lists: Vec<_> = (0..6).map(|_| poisoned::<u32>(gpu, 0)).collect();
    let buffers = GrantBuffers {
        grants: &upload(gpu, &[Grant { instance: 1, vertices: 1, ecol: 1, triangles: 1 }]),
        budgets: std::array::from_fn(|s| &lists[s]),
        streamed: std::array::from_fn(|s| &lists[3 + s]),
    };
    let params = GrantParams { grant_count: 1, instance_count: 1 };
    compute(gpu, |pass| GrantPass::new(gpu).record(gpu, pass, &params, &buffers));
    lists.iter().for_each(|list| drop(output::<u32>(gpu, list, 0)));
}

fn check_prefix_sum(gpu: &Gpu, pass: &mut PrefixSum, case: &str, counts: &[u32]) {
    let input = upload(gpu, counts);
    let sums = poisoned::<u32>(gpu, counts.len() + 1);
    compute(gpu, |recorded| pass.record(gpu, recorded, &input, counts.len() as u32, &sums).unwrap());
    assert_same(case, &output::<u32>(gpu, &sums, counts.len() + 1), &reference::prefix_sum(counts));
}

#[test]
fn prefix_sum_agrees_with_its_reference() {
    let Some(gpu) = gpu() else { return };
    // One pass for all: what larger inputs left in its buffers must not matter.
    let mut pass = PrefixSum::new(gpu);
    for (case, changes) in cases() {
        let frame = Frame::of(&changes);
        for counts in frame.new.iter().chain(&frame.streamed) {
            check_prefix_sum(gpu, &mut pass, case, counts);
        }
    }
    for count in [255, 256, 257, 65_535, 65_536, 65_537, 70_000] {
        let counts: Vec<u32> = (0..count).map(|i| below(i, 1000)).collect();
        check_prefix_sum(gpu, &mut pass, "at the edges of levels", &counts);
    }
    check_prefix_sum(gpu, &mut pass, "saturating", &vec![u32::MAX / 300; 1000]);
}

#[test]
fn prefix_sum_takes_more_than_65_535_workgroups() {
    let Some(gpu) = gpu() else { return };
    let counts: Vec<u32> =
        (0..65_535 * 256 + 1000).map(|i: u32| i.wrapping_mul(2_654_435_761) >> 24).collect();
    check_prefix_sum(gpu, &mut PrefixSum::new(gpu), "more than 65,535 workgroups", &counts);
}

/// Uploads a stream, defragments it alone, and reads it.
fn defragment_on<T: Pod>(
    gpu: &Gpu,
    pass: &Defragment,
    stream: Stream,
    frame: &Frame,
    existing: &[T],
) -> Vec<T> {
    let [active_start, existing_start, streamed_start] =
        frame.starts(stream as usize).map(|starts| upload(gpu, &starts));
    let total = frame.total(stream as usize) as usize;
    let active = poisoned::<T>(gpu, total);
    let buffers = DefragmentBuffers {
        active_start: &active_start,
        existing_start: &existing_start,
        streamed_start: &streamed_start,
        streamed: &upload(gpu, &frame.streamed_words),
        existing: &upload(gpu, existing),
        active: &active,
    };
    compute(gpu, |recorded| pass.record(gpu, recorded, stream, &frame.defragment_params(), &buffers));
    output(gpu, &active, total)
}

fn defragment_reference<T: Copy>(frame: &Frame, stream: Stream, existing: &[T], streamed: &[T]) -> Vec<T> {
    let [active, old, new] = frame.starts(stream as usize);
    reference::defragment(Starts { active: &active, existing: &old, streamed: &new }, existing, streamed)
}

#[test]
fn defragment_agrees_with_its_reference() {
    let built = OnceLock::new();
    for_each_case(|gpu, case, frame| {
        let pass = built.get_or_init(|| Defragment::new(gpu));
        let Frame { existing, streamed_elements: streamed, expected, .. } = frame;

        let vertices = defragment_reference(frame, Stream::Vertices, &existing.vertices, &streamed.vertices);
        assert_same(case, &vertices, &expected.vertices);
        assert_same(case, &defragment_on(gpu, pass, Stream::Vertices, frame, &existing.vertices), &vertices);

        let ecol = defragment_reference(frame, Stream::Ecol, &existing.ecol, &streamed.ecol);
        assert_same(case, &ecol, &expected.ecol);
        assert_same(case, &defragment_on(gpu, pass, Stream::Ecol, frame, &existing.ecol), &ecol);

        let triangles =
            defragment_reference(frame, Stream::Triangles, &existing.triangles, &streamed.triangles);
        assert_same(case, &triangles, &expected.triangles);
        assert_same(
            case,
            &defragment_on(gpu, pass, Stream::Triangles, frame, &existing.triangles),
            &triangles,
        );
    });
}

fn reform_reference(frame: &Frame) -> Vec<u32> {
    let [vertex, ecol, triangle] = [0, 1, 2].map(|s| reference::prefix_sum(&frame.new[s]));
    reference::reform(&triangle, &vertex, &ecol, &frame.expected.ecol, &frame.expected.triangles)
}

fn check_reform(gpu: &Gpu, pass: &Reform, case: &str, frame: &Frame) {
    let [vertex_start, ecol_start, triangle_start] =
        [0, 1, 2].map(|s| upload(gpu, &reference::prefix_sum(&frame.new[s])));
    let count = 3 * frame.total(2) as usize;
    let indices = poisoned::<u32>(gpu, count);
    let buffers = ReformBuffers {
        triangle_start: &triangle_start,
        vertex_start: &vertex_start,
        ecol_start: &ecol_start,
        ecol: &upload(gpu, &frame.expected.ecol),
        triangles: &upload(gpu, &frame.expected.triangles),
        indices: &indices,
    };
    compute(gpu, |recorded| pass.record(gpu, recorded, &frame.reform_params(), &buffers));
    assert_same(case, &output::<u32>(gpu, &indices, count), &reform_reference(frame));
}

#[test]
fn reform_agrees_with_its_reference() {
    let built = OnceLock::new();
    for_each_case(|gpu, case, frame| {
        let pass = built.get_or_init(|| Reform::new(gpu));
        check_reform(gpu, pass, case, frame);
    });
}

#[test]
fn reform_survives_bad_chains() {
    let Some(gpu) = gpu() else { return };
    let mut frame = Frame::of(&random_changes(9, 100, 200));
    for (at, onto) in frame.expected.ecol.iter_mut().enumerate() {
        // Loops, rising steps, and steps out of everything.
        *onto = [*onto, *onto + 1, u32::MAX, 0xFFFF][below(at as u64, 4) as usize];
    }
    for (at, triangle) in frame.expected.triangles.iter_mut().enumerate() {
        triangle.vertices[at % 3] = scramble(at as u64) as u16;
    }
    check_reform(gpu, &Reform::new(gpu), "bad chains", &frame);
}

#[test]
fn reformed_corners_lie_in_the_vertices_of_their_instance() {
    for (case, changes) in cases() {
        let frame = Frame::of(&changes);
        let [vertex, triangle] = [0, 2].map(|s| reference::prefix_sum(&frame.new[s]));
        let indices = reform_reference(&frame);
        for i in 0..changes.len() {
            let own = &indices[3 * triangle[i] as usize..3 * triangle[i + 1] as usize];
            assert!(
                own.iter().all(|index| (vertex[i]..vertex[i + 1]).contains(index)),
                "{case}, instance {i}"
            );
        }
    }
}

// ---- whole frames ----

/// The buffers of a batch: two sets, of which one is active and one exists.
struct Batch {
    budgets: [Buffer; 3],
    streamed: [Buffer; 3],
    streamed_starts: [Buffer; 3],
    sets: [[(Buffer, Buffer); 3]; 2],
    indices: Buffer,
}

struct Passes {
    grant: GrantPass,
    prefix_sum: PrefixSum,
    defragment: Defragment,
    reform: Reform,
}

impl Passes {
    fn new(gpu: &Gpu) -> Self {
        Self {
            grant: GrantPass::new(gpu),
            prefix_sum: PrefixSum::new(gpu),
            defragment: Defragment::new(gpu),
            reform: Reform::new(gpu),
        }
    }
}

impl Batch {
    /// Holds nothing yet: budgets and starts are zeros, as wgpu makes new buffers.
    fn new(gpu: &Gpu, instances: u64, elements: u64) -> Self {
        let list = |name| std::array::from_fn(|_| gpu.storage(name, 4 * (instances + 1)).unwrap());
        let set = || {
            Stream::ALL.map(|stream| {
                let starts = gpu.storage("starts", 4 * (instances + 1)).unwrap();
                (starts, gpu.storage("active", stream.active_bytes() * elements).unwrap())
            })
        };
        Self {
            budgets: list("budget"),
            streamed: list("streamed"),
            streamed_starts: list("streamed_start"),
            sets: [set(), set()],
            indices: gpu.storage("indices", 12 * elements).unwrap(),
        }
    }

    /// Records a frame; `active` is the set that it fills.
    fn record(&self, gpu: &Gpu, passes: &mut Passes, timer: &mut Timer, frame: &Frame, active: usize) {
        let mut encoder = gpu.encoder("frame");
        let begin = |encoder: &mut wgpu::CommandEncoder, timer: &mut Timer, label| {
            let timestamp_writes = timer.compute(label);
            let descriptor = wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes };
            encoder.begin_compute_pass(&descriptor).forget_lifetime()
        };
        let buffers = GrantBuffers {
            grants: &upload(gpu, &frame.grants),
            budgets: self.budgets.each_ref(),
            streamed: self.streamed.each_ref(),
        };
        let instance_count = frame.instance_count();
        let params = GrantParams { grant_count: frame.grants.len() as u32, instance_count };
        GrantPass::clear(&mut encoder, &buffers, instance_count);
        let mut pass = begin(&mut encoder, timer, "grant");
        passes.grant.record(gpu, &mut pass, &params, &buffers);
        drop(pass);

        let mut pass = begin(&mut encoder, timer, "prefix_sum");
        for s in 0..3 {
            let sums = &mut passes.prefix_sum;
            sums.record(gpu, &mut pass, &self.budgets[s], instance_count, &self.sets[active][s].0).unwrap();
            sums.record(gpu, &mut pass, &self.streamed[s], instance_count, &self.streamed_starts[s]).unwrap();
        }
        drop(pass);

        let mut pass = begin(&mut encoder, timer, "defragment");
        let streamed = upload(gpu, &frame.streamed_words);
        for (s, stream) in Stream::ALL.into_iter().enumerate() {
            let [(active_start, active), (existing_start, existing)] =
                [&self.sets[active][s], &self.sets[1 - active][s]];
            let streamed_start = &self.streamed_starts[s];
            let buffers = DefragmentBuffers {
                active_start,
                existing_start,
                streamed_start,
                streamed: &streamed,
                existing,
                active,
            };
            passes.defragment.record(gpu, &mut pass, stream, &frame.defragment_params(), &buffers);
        }
        drop(pass);

        let mut pass = begin(&mut encoder, timer, "reform");
        let [(vertex_start, _), (ecol_start, ecol), (triangle_start, triangles)] = &self.sets[active];
        let indices = &self.indices;
        let buffers = ReformBuffers { triangle_start, vertex_start, ecol_start, ecol, triangles, indices };
        passes.reform.record(gpu, &mut pass, &frame.reform_params(), &buffers);
        drop(pass);
        timer.resolve(&mut encoder);
        gpu.submit(encoder).unwrap();
    }
}

#[test]
fn frame_after_frame_the_gpu_holds_what_the_host_expects() {
    let Some(gpu) = gpu() else { return };
    const INSTANCES: u64 = 200;
    let mut passes = Passes::new(gpu);
    let mut timer = Timer::new(gpu, 8).unwrap();
    let batch = Batch::new(gpu, INSTANCES, INSTANCES * 100);
    let mut last = vec![Held::default(); INSTANCES as usize];
    for number in 0..12 {
        let next = |i: usize| match below(number * 1000 + i as u64, 4) {
            0 => last[i],
            // Triangles are sent with the indices of their tier: a new ecol count is a new version of them.
            _ => {
                let mut new = random_held(number * 5000 + i as u64, 100);
                new.versions[2] = new.counts[1];
                new
            }
        };
        let changes: Vec<_> = (0..last.len()).map(|i| Change { old: last[i], new: next(i) }).collect();
        let frame = Frame::of(&changes);
        let active = (number % 2) as usize;
        timer.start();
        batch.record(gpu, &mut passes, &mut timer, &frame, active);

        let [vertices, ecol, triangles] = batch.sets[active].each_ref().map(|set| &set.1);
        let expected = &frame.expected;
        let read = |total| frame.total(total) as usize;
        assert_same("vertices", &readback::read_values(gpu, vertices, read(0)).unwrap(), &expected.vertices);
        assert_same("ecol", &readback::read_values(gpu, ecol, read(1)).unwrap(), &expected.ecol);
        assert_same(
            "triangles",
            &readback::read_values(gpu, triangles, read(2)).unwrap(),
            &expected.triangles,
        );
        let indices: Vec<u32> = readback::read_values(gpu, &batch.indices, 3 * read(2)).unwrap();
        assert_same("indices", &indices, &reform_reference(&frame));
        check_times(gpu, &timer);
        last = changes.iter().map(|change| change.new).collect();
    }
}

fn check_times(gpu: &Gpu, timer: &Timer) {
    let stages = timer.read(gpu).unwrap();
    let labels: Vec<_> = stages.iter().map(|stage| stage.0).collect();
    assert_eq!(labels, ["grant", "prefix_sum", "defragment", "reform"]);
    for (label, ms) in stages {
        assert_eq!(ms.is_some(), gpu.timestamps, "{label}");
        assert!(ms.is_none_or(|ms| (0.0..10_000.0).contains(&ms)), "{label} took {ms:?} ms");
    }
}

// ---- select ----

const POWER_KERNEL: Shader = Shader {
    name: "power",
    pieces: &[
        POWER,
        "@group(0) @binding(0) var<uniform> zero: u32;
         @group(0) @binding(1) var<storage, read> input: array<f32>;
         @group(0) @binding(2) var<storage, read_write> output: array<vec2<f32>>;
         @compute @workgroup_size(64) fn power(@builtin(global_invocation_id) id: vec3<u32>) {
             exact_zero = zero;
             if id.x < arrayLength(&input) {
                 output[id.x] = vec2<f32>(log2_exact(input[id.x]), exp2_exact(input[id.x]));
             }
         }",
    ],
    kernels: &[KernelLayout { name: "power", bindings: &[uniform(0), read(1), write(2)] }],
};

#[test]
fn power_has_the_same_bits_on_host_and_gpu() {
    let Some(gpu) = gpu() else { return };
    let edges =
        [0.0, -0.0, f32::MIN_POSITIVE, f32::MAX, -f32::MAX, 1.0, -1.0, 126.0, 127.0, -126.5, 0.5, -0.5];
    let wide = (0..400_000).map(|i| f32::from_bits(below(i, 0x7F80_0000)));
    let near_one = (0..400_000).map(|i| 0.5 + below(i, 1 << 24) as f32 / 11_000_000.0);
    let exponents = (0..400_000).map(|i| below(i, 1 << 24) as f32 / 66_000.0 - 127.0);
    // A driver may take a number that is not normal for zero: they all count as the least normal one.
    let inputs: Vec<f32> = edges.into_iter().chain(wide.chain(near_one).chain(exponents)).collect();
    let expected: Vec<[u32; 2]> = inputs
        .iter()
        .map(|&x| [reference::power::log2(x), reference::power::exp2(x)].map(f32::to_bits))
        .collect();
    let values = poisoned::<[u32; 2]>(gpu, inputs.len());
    let groups = (inputs.len() as u32).div_ceil(64);
    let kernels = POWER_KERNEL.kernels(gpu);
    let buffers = [&gpu.uniform("zero", &0u32), &upload(gpu, &inputs), &values];
    compute(gpu, |pass| kernels[0].dispatch(gpu, pass, &buffers, groups));
    assert_same("log2 and exp2", &output::<[u32; 2]>(gpu, &values, inputs.len()), &expected);
}

fn view(budget: u32) -> SelectView {
    SelectView {
        eye: [1000.25, -20.5, 3.125],
        // A square pyramid along +x, and everything nearer than a million.
        planes: [
            [0.6, 0.8, 0.0, 0.0],
            [0.6, -0.8, 0.0, 0.0],
            [0.6, 0.0, 0.8, 0.0],
            [0.6, 0.0, -0.8, 0.0],
            [1.0, 0.0, 0.0, -0.1],
            [-1.0, 0.0, 0.0, 1e6],
        ],
        focal_px: 900.0,
        parallel: false,
        min_area_px: 1.0,
        max_area_px: 1920.0 * 1080.0,
        alpha: 3.0,
        error_px: 0.0,
        dead_band: 0.03,
        budget,
    }
}

/// Somewhere around the eye of [`view`], mostly in front of it.
fn random_row(seed: u64) -> SelectRow {
    let fraction = |i: u64| f64::from(below(seed * 31 + i, 1 << 24)) / f64::from(1 << 24);
    let distance = 10f64.powf(fraction(0) * 6.0 - 2.0);
    let around = |i| (fraction(i) - 0.5) * distance;
    let position = [1000.25 + distance * (fraction(1) * 1.1 - 0.1), around(2) - 20.5, around(3) + 3.125];
    let (centre_high, centre_low) = reference::select::split(position);
    let size = 10f64.powf(fraction(4) * 4.0 - 3.0);
    let half_extent = [5, 6, 7].map(|i| (size * fraction(i)) as f32);
    let floor = below(seed * 31 + 8, 200);
    let mut codes: [u8; 16] = std::array::from_fn(|i| scramble(seed * 31 + 10 + i as u64) as u8);
    codes.sort_unstable();
    SelectRow {
        centre_high,
        floor,
        centre_low,
        ceiling: floor + below(seed * 31 + 9, 65_000),
        half_extent,
        error_scale: size as f32,
        errors: bytemuck::cast(codes),
        parent: NO_PARENT_ROW,
        ..Default::default()
    }
}

/// Rows of which half are cells below one of the ten rows before them.
fn with_parents(mut rows: Vec<SelectRow>) -> Vec<SelectRow> {
    let mut leaves = vec![0u32; rows.len()];
    for i in (0..rows.len()).rev() {
        rows[i].log2_cells = (leaves[i].max(1) as f32).log2();
        if i > 0 && below(i as u64, 2) == 0 {
            let parent = i - 1 - below(i as u64 + 1, i.min(10) as u32) as usize;
            rows[i].parent = parent as u32;
            // Two more than it has, so that each counts as a parent.
            leaves[parent] += leaves[i].max(1) + 1;
        }
    }
    rows
}

#[test]
fn select_agrees_with_its_reference_on_parent_cells() {
    let Some(gpu) = gpu() else { return };
    for count in [2, 65, 1000, 4097] {
        let rows = with_parents((0..count).map(random_row).collect());
        let mut old: Vec<_> = (0..count).map(|i| below(i, 3) * below(i, 3000)).collect();
        for (budget, error_px) in [(0, 0.0), (1000, 0.0), (100_000, 2.0), (5_000_000, 0.0), (u32::MAX, 1.0)] {
            let params = SelectView { error_px, ..view(budget) }.params(count as u32);
            let wish = reference::select(&rows, &params, &old);
            assert_same("parent cells", &select_on(gpu, &rows, &params, &old), &wish);
            let parents = rows.iter().zip(&wish).filter(|(row, wish)| row.log2_cells > 0.0 && **wish > 0);
            assert!(budget < 100_000 || count < 100 || parents.count() > 0, "no parent is drawn");
            old = wish;
        }
    }
}

/// What the GPU selects among all rows.
fn select_on(gpu: &Gpu, rows: &[SelectRow], params: &SelectParams, old: &[u32]) -> Vec<u32> {
    let all: Vec<u32> = (0..rows.len() as u32).collect();
    select_among(gpu, rows, params, old, &all, &all)
}

/// What the GPU selects among candidates, after a look at how it leaves the wishes of all.
fn select_among(
    gpu: &Gpu,
    rows: &[SelectRow],
    params: &SelectParams,
    old: &[u32],
    candidates: &[u32],
    previous: &[u32],
) -> Vec<u32> {
    static PASSES: OnceLock<parking_lot::Mutex<(Select, PrefixSum)>> = OnceLock::new();
    let passes = PASSES.get_or_init(|| parking_lot::Mutex::new((Select::new(gpu), PrefixSum::new(gpu))));
    let (select, prefix_sum) = &mut *passes.lock();
    let params = SelectParams {
        candidate_count: candidates.len() as u32,
        previous_count: previous.len() as u32,
        ..*params
    };
    let wishes = upload(gpu, &[old, &[POISON; GUARD]].concat());
    let found = poisoned::<u32>(gpu, candidates.len());
    let buffers = SelectBuffers {
        rows: &upload(gpu, rows),
        candidates: &upload(gpu, candidates),
        previous: &upload(gpu, previous),
        wishes: &wishes,
        found: &found,
    };
    compute(gpu, |pass| select.record(gpu, pass, prefix_sum, &params, &buffers).unwrap());
    let wishes = output(gpu, &wishes, rows.len());
    let expected: Vec<u32> = candidates.iter().map(|&number| wishes[number as usize]).collect();
    assert_same("found", &output(gpu, &found, candidates.len()), &expected);
    wishes
}

/// Frame after frame among the candidates of that frame: others, that had wishes before, read as 0 from then on.
#[test]
fn select_among_candidates_agrees_with_its_reference() {
    let Some(gpu) = gpu() else { return };
    for count in [1usize, 64, 1000, 5000] {
        let rows = with_parents((0..count as u64).map(random_row).collect());
        let (mut old, mut previous) = (vec![0; count], Vec::new());
        for frame in 0..6u64 {
            let mut view = SelectView { error_px: 2.0, ..view(100_000) };
            // From all to none and back.
            view.min_area_px = [0.0, 100.0, 1e9, 3.0, 1e9, 0.5][frame as usize];
            view.eye[1] += 30.0 * frame as f64;
            let params = view.params(count as u32);
            let is_candidate = |&index: &u32| {
                let more = below(frame << 20 | u64::from(index), 10) == 0 && frame % 2 == 0;
                more || !reference::select::is_culled(&rows[index as usize], &params)
            };
            let candidates: Vec<u32> = (0..count as u32).filter(is_candidate).collect();
            let next = reference::select(&rows, &params, &old);
            let found = select_among(gpu, &rows, &params, &old, &candidates, &previous);
            assert_same(&format!("frame {frame} of {count}"), &found, &next);
            (old, previous) = (next, candidates);
        }
    }
}

/// Selects twice, the second time with the first wishes as the old ones, and says what was wished at last.
fn check_select(gpu: &Gpu, case: &str, rows: &[SelectRow], view: &SelectView, old: &[u32]) -> Vec<u32> {
    let params = view.params(rows.len() as u32);
    let mut wish = old.to_vec();
    for _ in 0..2 {
        let next = reference::select(rows, &params, &wish);
        assert_same(case, &select_on(gpu, rows, &params, &wish), &next);
        check_spent(case, rows, &params, &wish, &next);
        wish = next;
    }
    wish
}

/// The sum is the budget if floors and ceilings allow, and each wish lies between its own.
fn check_spent(case: &str, rows: &[SelectRow], params: &SelectParams, old: &[u32], wish: &[u32]) {
    let items: Vec<_> =
        (0..rows.len()).map(|index| reference::select::weigh(rows, index, params, old)).collect();
    let sum = |values: &mut dyn Iterator<Item = u32>| values.map(u64::from).sum::<u64>();
    let floors = sum(&mut items.iter().map(|item| item.floor));
    let ceilings = sum(&mut items.iter().map(|item| item.ceiling));
    let possible = u64::from(params.budget).clamp(floors, ceilings.max(floors));
    assert_eq!(sum(&mut wish.iter().copied()), possible, "{case}: of {floors}..={ceilings}");
    for (item, wish) in items.iter().zip(wish) {
        assert!((item.floor..=item.ceiling).contains(wish), "{case}: {wish} for {item:?}");
    }
}

#[test]
fn select_agrees_with_its_reference() {
    let Some(gpu) = gpu() else { return };
    for count in [0, 1, 2, 63, 64, 65, 255, 256, 257, 1000, 4097] {
        let rows: Vec<_> = (0..count).map(random_row).collect();
        let old: Vec<_> = (0..count).map(|i| below(i, 3) * below(i, 3000)).collect();
        for budget in [0, 1, 1000, 100_000, 5_000_000, u32::MAX] {
            check_select(gpu, &format!("{count} instances, {budget} vertices"), &rows, &view(budget), &old);
        }
        let errors = SelectView { error_px: 2.0, ..view(u32::MAX) };
        check_select(gpu, &format!("{count} instances by error"), &rows, &errors, &old);
    }
}

#[test]
fn select_agrees_where_instances_are_alike_or_odd() {
    let Some(gpu) = gpu() else { return };
    let (centre_high, centre_low) = reference::select::split([1010.25, -20.5, 3.125]);
    let like = SelectRow {
        centre_high,
        centre_low,
        ceiling: 5000,
        half_extent: [0.5; 3],
        parent: NO_PARENT_ROW,
        ..Default::default()
    };
    let alike = |row: SelectRow| check_select(gpu, "alike", &vec![row; 500], &view(99_999), &[0; 500]);
    // All jump at the same factor: what is left over goes to the first.
    assert_eq!(alike(like), [vec![200; 499], vec![199]].concat());
    alike(SelectRow { half_extent: [0.0; 3], ..like });
    alike(SelectRow { floor: 9000, ..like });
    alike(SelectRow { ceiling: 0, ..like });
    alike(SelectRow { ceiling: 1 << 24, ..like });
    alike(SelectRow { half_extent: [1e18; 3], ..like });
    let at_the_eye = SelectView { min_area_px: 0.0, planes: [[0.0, 0.0, 0.0, 1.0]; 6], ..view(70_000) };
    let (centre_high, centre_low) = reference::select::split(at_the_eye.eye);
    check_select(
        gpu,
        "at the eye",
        &[SelectRow { centre_high, centre_low, ..like }; 70],
        &at_the_eye,
        &[0; 70],
    );
}

#[test]
fn select_takes_a_hundred_thousand_instances() {
    let Some(gpu) = gpu() else { return };
    let rows: Vec<_> = (0..100_000).map(random_row).collect();
    check_select(gpu, "many", &rows, &view(20_000_000), &vec![0; rows.len()]);
}

/// Answers that are not waited for come later, and are those of the last view that was asked about.
#[test]
fn a_selection_that_is_not_waited_for_comes_later() {
    let Some(gpu) = gpu() else { return };
    let rows: Vec<_> = (0..3000).map(random_row).collect();
    let mut select = GpuSelect::new(gpu, &rows).unwrap();
    let mut old = vec![0; rows.len()];
    for round in 0..4u64 {
        let mut newest = None;
        // The ring has room for three.
        for step in 0..3u64 {
            let mut view = view(200_000);
            view.eye[0] += 10.0 * (3 * round + step) as f64;
            let params = view.params(rows.len() as u32);
            let seen = |&i: &u32| !reference::select::is_culled(&rows[i as usize], &params);
            let candidates: Vec<u32> = (0..rows.len() as u32).filter(seen).collect();
            newest = select.update(gpu, &params, &candidates, false).unwrap().or(newest);
            assert!(newest.is_some() || round > 0, "there is nothing to go on with before the first answer");
            old = reference::select(&rows, &params, &old);
        }
        let (instances, wishes) = select.receive(gpu, true).unwrap().or(newest).unwrap();
        let mut found = vec![0; rows.len()];
        instances.iter().zip(&wishes).for_each(|(&instance, &wish)| found[instance as usize] = wish);
        assert_same("the last answer", &found, &old);
        assert!(!select.is_busy() && select.receive(gpu, false).unwrap().is_none());
    }
    let limit = gpu.storage_limit_bytes() as usize;
    assert!(GpuSelect::fits(gpu, limit / 80) && !GpuSelect::fits(gpu, limit / 80 + 1));
    // No candidates at all: an answer as well.
    let params = view(0).params(rows.len() as u32);
    let (instances, wishes) = select.update(gpu, &params, &[], true).unwrap().unwrap();
    assert!(instances.is_empty() && wishes.is_empty());
}

prop_compose! {
    fn any_view()(
        budget in prop_oneof![0u32..2000, 0u32..2_000_000, Just(u32::MAX)],
        alpha in 1f32..6.0,
        error_px in prop_oneof![Just(0f32), 0.1f32..50.0],
        dead_band in prop_oneof![Just(0f32), 0f32..1.5],
        min_area_px in prop_oneof![Just(0f32), 0.01f32..100.0],
        parallel in any::<bool>(),
    ) -> SelectView {
        SelectView { alpha, error_px, dead_band, min_area_px, parallel, ..view(budget) }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn select_spends_the_budget_on_any_scene(
        seeds in prop::collection::vec((0u64..1 << 40, prop_oneof![Just(0u32), 0u32..70_000]), 0..200),
        view in any_view(),
    ) {
        static SHARED: OnceLock<Option<&'static Gpu>> = OnceLock::new();
        let Some(gpu) = *SHARED.get_or_init(gpu) else { return Ok(()) };
        let rows: Vec<_> = seeds.iter().map(|seed| random_row(seed.0)).collect();
        let old: Vec<_> = seeds.iter().map(|seed| seed.1).collect();
        check_select(gpu, "any scene", &rows, &view, &old);
    }
}

#[test]
fn a_larger_budget_takes_from_nobody_while_nothing_is_held() {
    let rows: Vec<_> = (0..300).map(random_row).collect();
    let wishes = |budget| reference::select(&rows, &view(budget).params(300), &[0; 300]);
    let mut last = wishes(0);
    for budget in (0..200).map(|i| i * 10_007) {
        let next = wishes(budget);
        // What is left over is dealt out one by one: it may move on to another instance.
        let taken: u32 =
            last.iter().zip(&next).map(|(last, next)| last.saturating_sub(*next)).max().unwrap_or(0);
        assert!(taken <= 1, "{taken} taken at {budget}");
        last = next;
    }
}

// ---- what goes wrong ----

#[test]
fn buffers_above_the_limit_are_errors() {
    let Some(gpu) = gpu() else { return };
    let error = gpu.storage("huge", gpu.storage_limit_bytes() + 1).unwrap_err();
    assert!(matches!(error, GpuError::TooLarge { .. }), "{error}");
    assert!(error.to_string().contains("`huge`"), "{error}");
}

#[test]
fn readbacks_beyond_the_end_are_errors() {
    let Some(gpu) = gpu() else { return };
    let buffer = upload(gpu, &[1u32; 8]);
    assert!(matches!(readback::read(gpu, &buffer, 0..36), Err(GpuError::Invalid(_))));
    assert!(matches!(readback::read(gpu, &buffer, 2..8), Err(GpuError::Invalid(_))));
    assert!(readback::read(gpu, &buffer, 4..4).unwrap().is_empty());
    assert_eq!(readback::read(gpu, &buffer, 4..12).unwrap(), [1, 0, 0, 0, 1, 0, 0, 0]);
}

#[test]
fn wrong_calls_become_errors_and_not_panics() {
    if gpu().is_none() {
        return;
    }
    // A device of its own: errors are handed to whoever checks first.
    let own = Gpu::new(&GpuOptions::default()).unwrap();
    let small = own.storage("small", 16).unwrap();
    let mut encoder = own.encoder("wrong");
    encoder.copy_buffer_to_buffer(&small, 0, &small, 8, 64);
    assert!(matches!(own.submit(encoder), Err(GpuError::Invalid(_))));
    assert_eq!(own.check(), Ok(()));
}

#[test]
fn a_device_that_is_gone_is_an_error_and_not_a_panic() {
    if gpu().is_none() {
        return;
    }
    let own = Gpu::new(&GpuOptions::default()).unwrap();
    let mut pass = PrefixSum::new(&own);
    let [input, sums] = [upload(&own, &[1u32; 8]), poisoned::<u32>(&own, 9)];
    own.device.destroy();
    let mut encoder = own.encoder("gone");
    pass.record(&own, &mut encoder.begin_compute_pass(&Default::default()), &input, 8, &sums).unwrap();
    let submitted = own.submit(encoder);
    let reread = readback::read(&own, &sums, 0..36);
    assert!(submitted.is_err() || reread.is_err(), "{submitted:?}, {reread:?}");
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    if gpu().is_none() {
        return;
    }
    let options = GpuOptions { adapter: Some("no such adapter".into()), ..GpuOptions::default() };
    let message = Gpu::new(&options).unwrap_err().to_string();
    assert!(message.contains("`no such adapter`") && message.contains("COLLAPSAR_ADAPTER"), "{message}");
}

/// Without a driver there is no adapter: run in a process of its own, as the loader reads the environment.
#[test]
fn without_a_driver_the_message_says_what_to_install() {
    const INSIDE: &str = "COLLAPSAR_TEST_WITHOUT_DRIVER";
    if !cfg!(target_os = "linux") {
        eprintln!("skipped: only the Vulkan loader takes its drivers from the environment");
        return;
    }
    if std::env::var_os(INSIDE).is_some() {
        let error = Gpu::new(&GpuOptions::default()).unwrap_err();
        assert!(matches!(error, GpuError::NoAdapter(_)), "{error}");
        assert!(error.to_string().contains("mesa-vulkan-drivers"), "{error}");
        return;
    }
    let status = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "without_a_driver_the_message_says_what_to_install"])
        .env(INSIDE, "1")
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .env_remove("COLLAPSAR_ADAPTER")
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn a_readback_waits_for_its_callback_when_another_thread_polls() {
    let Some(gpu) = gpu() else { return };
    let done = std::sync::atomic::AtomicBool::new(false);
    let poll = || {
        while !done.load(std::sync::atomic::Ordering::Relaxed) {
            gpu.device.poll(wgpu::PollType::Poll).unwrap();
        }
    };
    let read = || {
        let buffer = gpu.storage("shared", 64).unwrap();
        (0..2000).all(|_| readback::read_values::<u32>(gpu, &buffer, 16).is_ok_and(|read| read == [0; 16]))
    };
    std::thread::scope(|scope| {
        (0..4).for_each(|_| drop(scope.spawn(poll)));
        let read = read();
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(read);
    });
}
