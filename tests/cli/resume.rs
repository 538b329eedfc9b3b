//! Bakes that were stopped at any moment, by a signal that cannot be caught or by a full disk, and are taken up again.

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::common::{height_field, patched_box};
use crate::full_disk::in_namespace;
use crate::models::obj;
use crate::workplace::{Outcome, Workplace, moments, names};

const BAKE: [&str; 4] = ["bake", "model.obj", "-o", "model.clps"];
const RESUME: [&str; 5] = ["bake", "model.obj", "-o", "model.clps", "--resume"];

/// Many parts of different sizes.
fn workplace() -> Workplace {
    let place = Workplace::new();
    let meshes: Vec<_> = (0..60).map(|i| height_field(4 + i % 7 * 5)).collect();
    place.write("model.obj", obj(&meshes));
    place
}

/// The container that comes of it undisturbed, and how long that takes.
fn undisturbed(place: &Workplace) -> (Vec<u8>, Duration) {
    undisturbed_with(place, None)
}

fn undisturbed_with(place: &Workplace, more: Option<&str>) -> (Vec<u8>, Duration) {
    let started = Instant::now();
    place.run(&with(&["bake", "model.obj", "-o", "whole.clps"], more)).succeeded();
    (place.read("whole.clps"), started.elapsed())
}

/// A command with one more argument.
fn with<'a>(command: &[&'a str], more: Option<&'a str>) -> Vec<&'a str> {
    command.iter().copied().chain(more).collect()
}

#[test]
fn a_bake_that_is_killed_at_any_moment_goes_on_to_the_same_bytes() {
    kill_and_resume(None);
}

#[test]
fn a_compressing_bake_that_is_killed_at_any_moment_goes_on_to_the_same_bytes() {
    kill_and_resume(Some("--compress"));
}

fn kill_and_resume(more: Option<&str>) {
    let place = workplace();
    let (whole, duration) = undisturbed_with(&place, more);
    let (mut resumed, moments) = (0, moments());
    for moment in 0..moments {
        let mut child = place.command(&with(&BAKE, more)).spawn().unwrap();
        std::thread::sleep(duration * moment / moments);
        child.kill().unwrap();
        let died = !child.wait().unwrap().success();
        // Killed after the container had its name, it may not have come to tidying up.
        assert!(!died || !place.path("model.clps").exists() || place.read("model.clps") == whole);
        resumed += u32::from(place.path("model.clps.bake").join("round-0").exists());
        place.run(&with(&RESUME, more)).succeeded();
        assert!(place.read("model.clps") == whole, "killed at moment {moment} of {moments}: other bytes");
        assert_eq!(names(&place.path("")), ["model.clps", "model.obj", "whole.clps"]);
        fs::remove_file(place.path("model.clps")).unwrap();
    }
    assert!(resumed > 0, "never killed in the middle");
}

/// Bakes onto a disk of a size, tells what came of it, makes the disk large enough, and goes on.
const SCRIPT: &str = r#"
    mount -t tmpfs -o "size=$1" tmpfs full || exit 77
    shift
    "$@"
    code=$?
    test -e full/model.clps && test "$code" != 0 && exit 78
    mount -o remount,size=64m full || exit 77
    "$@" --resume >second.txt 2>&1 || exit 79
    cp full/model.clps result.clps
    exit $code"#;

#[test]
fn a_bake_onto_a_disk_of_any_size_fails_clearly_and_goes_on_when_there_is_room() {
    let place = workplace();
    place.make_folder("full");
    let (whole, _) = undisturbed(&place);
    let (mut failed, moments) = (0, moments());
    for step in 1..=moments {
        // To more than twice the container: its chunks lie there twice before it has its name.
        let size = (u64::from(step) * whole.len() as u64 * 5 / 2 / u64::from(moments)).next_multiple_of(4096);
        let bake = ["bake", "model.obj", "-o", "full/model.clps"];
        let Some(outcome) = in_namespace(&place, SCRIPT, &size.to_string(), &bake) else { return };
        match outcome.code {
            Some(0) => {}
            _ => {
                outcome.failed(&["No space left on device", "full/model.clps"]);
                failed += 1;
            }
        }
        assert!(place.read("result.clps") == whole, "{size} bytes: other bytes after all");
    }
    assert!((1..moments).contains(&failed), "{failed} of {moments} disks were too small");
}

/// Interrupts a bake when something is done; gives its message.
fn interrupted(place: &Workplace) -> Outcome {
    place.write("model.obj", obj(&vec![height_field(60); 150]));
    let child = place.command(&BAKE).spawn().unwrap();
    let journal = place.path("model.clps.bake").join("journal");
    let started = Instant::now();
    while fs::metadata(&journal).map_or(0, |file| file.len()) < 100 {
        assert!(started.elapsed() < Duration::from_secs(40), "nothing gets done");
        std::thread::sleep(Duration::from_millis(5));
    }
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(status.success());
    Outcome::of(&child.wait_with_output().unwrap())
}

#[test]
fn an_interrupted_bake_says_how_to_go_on() {
    let place = Workplace::new();
    let outcome = interrupted(&place);
    outcome.failed_with(130, &["interrupted; no container was written", "of 150 bodies", "--resume"]);
    assert_eq!(names(&place.path("")), ["model.clps.bake", "model.obj"]);

    // Another model of that name, other options, and nothing of either.
    let other = ["bake", "model.obj", "-o", "model.clps", "--resume", "--boundary", "lock"];
    place.run(&other).failed(&["cannot be resumed", "without --resume", "model.clps.bake"]);
    place.run(&with(&RESUME, Some("--compress"))).failed(&["cannot be resumed", "model.clps.bake"]);
    place.write("model.obj", obj(&[patched_box(3)]));
    place.run(&RESUME).failed(&["cannot be resumed", "model.clps.bake"]);
    place.run(&BAKE).succeeded();
    assert_eq!(names(&place.path("")), ["model.clps", "model.obj"]);
    place.run(&RESUME).succeeded();
}

#[test]
fn a_folder_of_the_same_name_is_left_alone() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(2)]));
    place.make_folder("model.clps.bake");
    place.write("model.clps.bake/mine.txt", "dear diary");
    place.fails(&BAKE, &["there is something else", "model.clps.bake"]);
    place.write("model.clps.bake/journal", "dear diary");
    place.fails(&RESUME, &["there is something else", "model.clps.bake"]);
}

#[test]
fn two_bakes_of_one_output_do_not_meet() {
    let place = workplace();
    place.write("model.obj", obj(&vec![height_field(60); 150]));
    let mut first = place.command(&BAKE).spawn().unwrap();
    let folder = place.path("model.clps.bake");
    let started = Instant::now();
    while !folder.join("round-0").exists() {
        assert!(started.elapsed() < Duration::from_secs(40), "nothing gets done");
        std::thread::sleep(Duration::from_millis(5));
    }
    place.run(&RESUME).failed(&["another bake", "model.clps.bake"]);
    first.kill().unwrap();
    first.wait().unwrap();
}

#[test]
fn a_memory_cap_that_cannot_be_kept_is_refused_with_one_that_can() {
    let place = workplace();
    let small = ["bake", "model.obj", "-o", "model.clps", "--memory", "1MiB"];
    place.fails(&small, &["too little", "--memory"]);
    // Reading names what reading needs, and then the bake what it needs.
    let mut least = "1MiB".to_owned();
    for _ in 0..3 {
        let outcome = place.run(&["bake", "model.obj", "-o", "model.clps", "--memory", &least]);
        let Some(named) = outcome.err.split("--memory ").nth(1) else { break };
        least = named.split(' ').next().unwrap().to_owned();
    }
    assert_ne!(least, "1MiB");
    assert!(place.read("model.clps") == undisturbed(&place).0);
}
