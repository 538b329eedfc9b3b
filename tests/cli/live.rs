//! Flights that do not wait for the disk: what is drawn while data arrives, and a container that changes under them.

use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use collapsar::stats::report::percentile;
use collapsar::stats::{FrameRecord, Summary};

use crate::workplace::{Outcome, Workplace, has_gpu, moments};

/// A container of an assembly, made once for all tests.
fn container() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let place = Workplace::new();
        place.run(&["synth", "--triangles", "300k", "--parts", "700", "-o", "model.clps"]).succeeded();
        place.read("model.clps")
    })
}

/// A place with the container in it.
fn place() -> Workplace {
    let place = Workplace::new();
    place.write("model.clps", container());
    place
}

/// A flight over small pictures.
fn flight<'a>(frames: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let size = ["--size", "160x90", "--samples", "1", "--budget", "30k"];
    [&["fly", "model.clps", "--no-hash", "--frames", frames], &size as &[&str], more].concat()
}

/// Flies into a folder and gives what is there.
#[track_caller]
fn fly(place: &Workplace, folder: &str, frames: &str, more: &[&str]) -> (Summary, Vec<FrameRecord>) {
    let arguments = [&flight(frames, more) as &[&str], &["--out", folder]].concat();
    let outcome = place.run(&arguments).succeeded();
    assert!(outcome.err.is_empty(), "{outcome:?}");
    let summary = serde_json::from_slice(&place.read(&format!("{folder}/summary.json"))).unwrap();
    let records = csv::Reader::from_path(place.path(&format!("{folder}/frames.csv"))).unwrap();
    (summary, records.into_deserialize().collect::<Result<_, _>>().unwrap())
}

/// The slowest frame in a thousand, after the first three, which make buffers.
fn slowest(records: &[FrameRecord], ms: fn(&FrameRecord) -> f64) -> f64 {
    percentile(&records[3..].iter().map(ms).collect::<Vec<f64>>(), 99.9)
}

#[test]
fn a_flight_from_a_slow_disk_draws_what_has_arrived_and_waits_for_nothing() {
    if !has_gpu("cli::live::a_flight_from_a_slow_disk_draws_what_has_arrived_and_waits_for_nothing") {
        return;
    }
    let place = place();
    let slow = ["--path", "walk", "--read-rate", "500kB"];
    let (_, warm) = fly(&place, "warm", "200", &["--path", "walk"]);
    let (_, waiting) = fly(&place, "waiting", "4", &slow);
    // The disk is as slow on every machine: one that draws fast must not be at the end before it has read.
    let paced = ["--live", "--fps", "25"];
    let (summary, live) = fly(&place, "live", "200", &[&slow as &[&str], &paced].concat());
    // Boxes come first, then parts, then their detail.
    assert!(live[0].boxes > 0 && live[0].drawn_area_permille < 900, "{:?}", live[0]);
    let half = live.iter().position(|record| 2 * record.active_vertices >= record.wished_vertices).unwrap();
    let early = &live[1..half];
    assert!(early.iter().any(|record| record.active_triangles > 0 && record.misses > 0), "nothing early");
    let last = live.last().unwrap();
    assert!(last.active_vertices > live[half].active_vertices, "{half}: {last:?}");
    assert_eq!((last.misses, last.boxes, last.drawn_area_permille), (0, 0, 1000), "{last:?}");
    let reached =
        [summary.first_picture_ms, summary.half_detail_ms, summary.full_detail_ms].map(Option::unwrap);
    assert!(summary.flight.open_ms < reached[0] && reached.is_sorted(), "{summary:?}");
    // With the same disk, one that waits has its first frame only when all has been read.
    let stuck = waiting[0].residency_ms;
    let longest = slowest(&live, |record| record.residency_ms);
    eprintln!("residency: {longest:.1} ms at most, {stuck:.0} ms where it waits");
    assert!(longest < 0.25 * stuck, "a frame spent {longest} of {stuck} ms on residency");
    let (slow, fast) = (slowest(&live, |record| record.frame_ms), slowest(&warm, |record| record.frame_ms));
    eprintln!("p99.9 of the frame time: {slow:.1} ms live, {fast:.1} ms warm: {:.2}", slow / fast);
    // Frames in which something arrives also build their buffers anew; the machine may be busy with other things.
    assert!(slow < 10.0 * fast, "frames of {slow} ms while data arrives, {fast} ms otherwise");
    let faults: u64 = live[3..].iter().map(|record| record.major_faults).sum();
    assert_eq!(faults, 0, "the thread of the frames waited for pages");
}

#[test]
fn a_camera_at_rest_sees_detail_come_in_until_all_is_there() {
    if !has_gpu("cli::live::a_camera_at_rest_sees_detail_come_in_until_all_is_there") {
        return;
    }
    let slow = ["--path", "still", "--read-rate", "1MB", "--live", "--fps", "50"];
    let (summary, live) = fly(&place(), "still", "200", &slow);
    let steps = live.windows(2).filter(|pair| pair[1].active_vertices > pair[0].active_vertices).count();
    assert!(steps > 10, "detail came in {steps} steps");
    let full = summary.full_detail_ms.expect("it never got all of its detail");
    let done = live.iter().position(|record| record.elapsed_ms >= full).unwrap();
    assert!(live[done..].iter().all(|record| record.misses == 0), "it lost something");
    let moved = live[done + 5..].iter().map(|record| record.bytes_sent + record.disk_bytes).sum::<u64>();
    assert_eq!(moved, 0, "it moves bytes after frame {done}, when everything is there");
}

#[test]
fn boxes_are_sent_once_and_counted_without_being_sent() {
    if !has_gpu("cli::live::boxes_are_sent_once_and_counted_without_being_sent") {
        return;
    }
    let place = place();
    let slow = ["--path", "still", "--read-rate", "200kB", "--live"];
    for (folder, more) in [("sent", &[][..]), ("counted", &["--count-only"])] {
        let (_, live) = fly(&place, folder, "30", &[&slow as &[&str], more].concat());
        let first = live[0].boxes;
        let boxes = live.windows(2).map(|pair| pair[0].boxes.abs_diff(pair[1].boxes)).sum::<u64>() + first;
        assert!(first > 100, "{folder}: {first} boxes at first");
        // 72 bytes a box that is new or moves, and the tables of what has arrived.
        let tables: u64 = live.iter().map(|record| record.bytes_tables).sum();
        let all: u64 = live.iter().map(|record| 72 * record.boxes).sum();
        assert!(tables >= 72 * first && all > 4 * 72 * boxes, "{folder}: {tables} bytes, {boxes} boxes");
        assert!(
            tables < all / 2,
            "{folder}: {tables} bytes of tables for {boxes} boxes, {all} in all frames"
        );
    }
}

/// Keyframes of a camera in the middle of the assembly that turns by so many degrees a frame.
fn turning(frames: u32, degrees: f64) -> String {
    let keyframe = |frame: u32| {
        let (sin, cos) = (degrees * f64::from(frame)).to_radians().sin_cos();
        let target = [32.0 + 10.0 * cos, 4.0 + 10.0 * sin, 0.0];
        serde_json::json!({"frame": frame, "eye": [32.0, 4.0, 0.0], "target": target, "up": [0.0, 0.0, 1.0]})
    };
    serde_json::Value::from_iter((0..frames).map(keyframe)).to_string()
}

#[test]
fn what_a_turning_camera_sees_next_is_there_when_it_comes_into_view() {
    if !has_gpu("cli::live::what_a_turning_camera_sees_next_is_there_when_it_comes_into_view") {
        return;
    }
    let place = place();
    place.write("turn.json", turning(60, 4.0));
    let undrawn = |folder: &str, more: &[&str]| {
        let turn = ["--path", "turn.json", "--live", "--fps", "10"];
        let (_, records) = fly(&place, folder, "60", &[&turn, more].concat());
        // Not the beginning, when nothing has been read.
        records[15..].iter().map(|record| 1000 - record.drawn_area_permille).sum::<u64>()
    };
    let (with, without) = (undrawn("with", &[]), undrawn("without", &["--no-prefetch"]));
    eprintln!("a turn lacks {with} permille of frames with prefetch, {without} without");
    assert!(without > 100, "a turn shows nothing new: {without}");
    assert!(2 * with < without, "{with} permille lacking, {without} without prefetch");
}

/// What may happen to a container that is open.
#[derive(Debug, Clone, Copy)]
enum Change {
    /// It is cut to so many thousandths of its length.
    Cut(u64),
    /// Other bytes are written over all of it.
    Overwrite,
    /// It is emptied and another container written in its place.
    Rewrite,
    /// Another container is renamed to its name.
    Rename,
}

const CHANGES: [Change; 6] =
    [Change::Cut(500), Change::Rename, Change::Overwrite, Change::Cut(0), Change::Rewrite, Change::Cut(30)];

impl Change {
    fn apply(self, path: &Path, other: &[u8]) {
        let open = || File::options().write(true).open(path).unwrap();
        match self {
            Self::Cut(permille) => {
                let file = open();
                file.set_len(file.metadata().unwrap().len() * permille / 1000).unwrap();
            }
            Self::Overwrite => {
                let mut file = open();
                let bytes = vec![0xa5; file.metadata().unwrap().len() as usize];
                file.seek(SeekFrom::Start(0)).unwrap();
                file.write_all(&bytes).unwrap();
            }
            Self::Rewrite => fs::write(path, other).unwrap(),
            Self::Rename => {
                let beside = path.with_extension("other");
                fs::write(&beside, other).unwrap();
                fs::rename(&beside, path).unwrap();
            }
        }
    }
}

/// Starts a flight, changes its container after a while, and waits for the end.
fn changed_after(wait: Duration, change: Change, arguments: &[&str], other: &[u8]) -> Outcome {
    let place = place();
    let child = place.command(arguments).spawn().unwrap();
    std::thread::sleep(wait);
    change.apply(&place.path("model.clps"), other);
    Outcome::of(&child.wait_with_output().unwrap())
}

#[test]
fn a_container_that_is_cut_short_or_replaced_ends_a_flight_with_one_line_or_not_at_all() {
    let name =
        "cli::live::a_container_that_is_cut_short_or_replaced_ends_a_flight_with_one_line_or_not_at_all";
    if !has_gpu(name) {
        return;
    }
    let moments = moments();
    let other = Workplace::new();
    other.run(&["synth", "--triangles", "20k", "--parts", "60", "--seed", "7", "-o", "o.clps"]).succeeded();
    let other = other.read("o.clps");
    let whole = place();
    let least = least_memory(&whole);
    // So little memory that it reads all the time.
    let memory = (least + 400_000).to_string();
    let arguments = flight("60", &["--live", "--path", "orbit", "--read-rate", "1MB", "--memory", &memory]);
    let started = Instant::now();
    whole.run(&arguments).succeeded();
    let duration = started.elapsed();
    let mut told = Vec::new();
    for moment in 0..moments {
        // More of them near the beginning, where it opens.
        let wait = duration.mul_f64((f64::from(moment) / f64::from(moments)).powi(2));
        let change = CHANGES[moment as usize % CHANGES.len()];
        let outcome = changed_after(wait, change, &arguments, &other);
        if matches!(change, Change::Rename) || outcome.code == Some(0) {
            assert_eq!(outcome.code, Some(0), "{change:?} after {wait:?}: {outcome:?}");
            assert!(outcome.err.is_empty(), "{change:?} after {wait:?}: {outcome:?}");
        } else {
            outcome.failed(&["model.clps"]);
            assert!(outcome.err.trim_end().ends_with(": model.clps"), "{outcome:?}");
            told.push(outcome.err);
        }
    }
    eprintln!("{moments} moments in {duration:?}: {} flights ended early", told.len());
    told.sort();
    told.dedup();
    eprint!("{}", told.concat());
    assert!(told.len() > 1, "hardly a change was noticed: {told:?}");
}

/// The cap on memory that the message about a smaller one names.
#[track_caller]
fn least_memory(place: &Workplace) -> u64 {
    let outcome = place.run(&flight("3", &["--live", "--memory", "1"]));
    outcome.failed(&["a cap of 1 bytes of memory", "too little for this model", "at least"]);
    let words: Vec<&str> = outcome.err.split(' ').collect();
    let at = words.iter().position(|&word| word == "least").unwrap();
    words[at + 1].parse().unwrap_or_else(|_| panic!("no number: {outcome:?}"))
}

#[test]
fn a_cap_on_memory_that_is_too_small_names_the_least_one_which_works() {
    if !has_gpu("cli::live::a_cap_on_memory_that_is_too_small_names_the_least_one_which_works") {
        return;
    }
    let place = place();
    let least = least_memory(&place);
    let [below, enough] = [least - 1, least].map(|bytes| bytes.to_string());
    place.fails(&flight("3", &["--memory", &below]), &[&format!("at least {least} are needed")]);
    for live in [&[] as &[&str], &["--live"]] {
        let (summary, records) = fly(&place, "least", "40", &[&["--memory", &enough], live].concat());
        assert_eq!(summary.flight.memory_limit_bytes, Some(least));
        assert!(records.iter().all(|record| record.memory_bytes <= least), "{summary:?}");
        assert!(records.last().unwrap().active_triangles > 0, "nothing is drawn with {least} bytes");
    }
}
