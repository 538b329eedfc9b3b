//! Ctrl-C in the middle of long work: exit code 130, one line, nothing left.

#![cfg(unix)]

use std::process::{Child, Command};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use collapsar::geometry::body::{OrderOptions, order_body};
use collapsar::geometry::cell_tree::Watch;

use crate::common::{height_field, patched_box};
use crate::models::{obj, placed_glb};
use crate::workplace::{Outcome, Workplace, has_gpu, names};

/// From the signal to the end.
const PATIENCE: Duration = Duration::from_secs(15);

fn interrupt(child: &Child) {
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

/// Starts, waits, interrupts, and waits for the end.
fn interrupted_after(place: &Workplace, arguments: &[&str], wait: Duration) -> Outcome {
    let child = place.command(arguments).spawn().unwrap();
    std::thread::sleep(wait);
    interrupt(&child);
    let signalled = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(signalled.elapsed() < PATIENCE, "it took {:?} to stop", signalled.elapsed());
    Outcome::of(&output)
}

#[test]
fn a_bake_that_is_interrupted_while_it_reads_leaves_nothing() {
    let place = Workplace::new();
    // Read for seconds, however fast the machine.
    place.write("large.obj", obj(&vec![height_field(60); 150]));
    let before = place.snapshot();
    let bake = ["bake", "large.obj", "-o", "large.clps"];
    let outcome = interrupted_after(&place, &bake, Duration::from_millis(150));
    outcome.failed_with(130, &["interrupted; nothing was written"]);
    place.assert_unchanged(&before);
}

/// Says at the second question that it is time to stop.
#[derive(Default)]
struct StopAtSecond(AtomicUsize);

impl Watch for StopAtSecond {
    fn stopped(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) > 0
    }

    fn done(&self, _triangles: usize) {}
}

/// A single part may be the whole model: it is not ordered to its end first.
#[test]
fn a_part_of_several_cells_stops_between_two() {
    let large = height_field(260);
    assert!(large.positions.len() > 65_536, "one cell holds it");
    let stop_at_second = StopAtSecond::default();
    let outcome = order_body(vec![large], OrderOptions::default(), &stop_at_second);
    // Two cells and no parent are asked for; one goes ahead.
    assert_eq!((stop_at_second.0.into_inner(), outcome.cells.len()), (2, 1));
}

#[test]
fn a_flight_that_waits_for_a_slow_disk_is_interrupted_at_once() {
    if !has_gpu("a_flight_that_waits_for_a_slow_disk_is_interrupted_at_once") {
        return;
    }
    let place = Workplace::new();
    let bundled = format!("{}/datasets/peterbilt.obj", env!("CARGO_MANIFEST_DIR"));
    place.bake(&bundled, "truck.clps");
    let fly = ["fly", "truck.clps", "--read-rate", "100B", "--size", "64x64"];
    let outcome = interrupted_after(&place, &fly, Duration::from_secs(3));
    outcome.failed_with(130, &["interrupted; the flight's numbers were not written"]);
}

#[test]
fn an_interrupted_bake_keeps_the_older_container() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(2)]));
    place.bake("model.obj", "model.clps");
    place.write("model.obj", obj(&vec![height_field(60); 150]));
    let before = place.read("model.clps");
    let bake = ["bake", "model.obj", "-o", "model.clps"];
    // What is done by then, if anything, is kept beside it: see `resume.rs`.
    let outcome = interrupted_after(&place, &bake, Duration::from_millis(700));
    outcome.failed_with(130, &["interrupted; no"]);
    assert!(place.read("model.clps") == before);
    place.verify("model.clps");
}

#[test]
fn an_interrupted_comparison_draws_nothing() {
    let place = Workplace::new();
    place.write("field.obj", obj(&vec![height_field(40); 4]));
    place.bake("field.obj", "field.clps");
    let before = place.snapshot();
    // Ten million points on every level of detail: minutes of work.
    let compare = ["compare", "field.obj", "field.clps", "--samples", "10M", "--plot", "field.svg"];
    let outcome = interrupted_after(&place, &compare, Duration::from_millis(1500));
    outcome.failed_with(130, &["interrupted; nothing was compared"]);
    place.assert_unchanged(&before);
}

#[test]
fn an_interrupted_export_leaves_nothing() {
    let place = Workplace::new();
    let mesh = patched_box(10);
    // OBJ repeats every placement: gigabytes, which the disk never gets to see.
    let model = placed_glb(&mesh.positions, mesh.triangles.as_flattened(), 4, 50_000);
    place.write("many.glb", model);
    place.bake("many.glb", "many.clps");
    let before = place.snapshot();
    let export = ["export", "many.clps", "--ratio", "1", "-o", "many.obj"];
    let child = place.command(&export).spawn().unwrap();
    let started = Instant::now();
    while names(&place.path("")).len() == before.len() {
        assert!(started.elapsed() < PATIENCE, "it does not start to write");
        std::thread::sleep(Duration::from_millis(5));
    }
    interrupt(&child);
    let outcome = Outcome::of(&child.wait_with_output().unwrap());
    outcome.failed_with(130, &["interrupted; this file was not written"]);
    place.assert_unchanged(&before);
}

#[test]
fn an_interrupted_turntable_keeps_whole_pictures() {
    if !has_gpu("cli::interrupted::an_interrupted_turntable_keeps_whole_pictures") {
        return;
    }
    let place = Workplace::new();
    place.write("box.obj", obj(&[patched_box(4)]));
    place.bake("box.obj", "box.clps");
    let shot = ["shot", "box.clps", "--turntable", "10000", "--size", "64x48", "-o", "turn.png"];
    let child = place.command(&shot).spawn().unwrap();
    let started = Instant::now();
    while !place.path("turn-002.png").is_file() {
        assert!(started.elapsed() < PATIENCE, "no pictures come");
        std::thread::sleep(Duration::from_millis(5));
    }
    interrupt(&child);
    let outcome = Outcome::of(&child.wait_with_output().unwrap());
    outcome.failed_with(130, &["interrupted; pictures that are written stay"]);
    let pictures: Vec<String> =
        names(&place.path("")).into_iter().filter(|name| !name.starts_with("box.")).collect();
    assert!((3..10_000).contains(&pictures.len()), "{}", pictures.len());
    for (number, name) in pictures.iter().enumerate() {
        assert_eq!(*name, format!("turn-{number:03}.png"));
        assert_eq!(image::open(place.path(name)).unwrap().to_rgb8().dimensions(), (64, 48));
    }
}

#[test]
fn an_interrupted_flight_writes_no_numbers() {
    if !has_gpu("cli::interrupted::an_interrupted_flight_writes_no_numbers") {
        return;
    }
    let place = Workplace::new();
    place.write("box.obj", obj(&[patched_box(4)]));
    place.bake("box.obj", "box.clps");
    let flight = ["fly", "box.clps", "--frames", "1000000", "--size", "64x64", "--out", "flight"];
    let outcome = interrupted_after(&place, &flight, Duration::from_millis(1500));
    outcome.failed_with(130, &["interrupted; the flight's numbers were not written"]);
    assert_eq!(names(&place.path("flight")), [""; 0]);
}
