//! Disks without room: a small file system in memory, in a mount namespace of its own, so that nothing outside sees it.

#![cfg(target_os = "linux")]

use std::process::Command;

use crate::common::patched_box;
use crate::models::obj;
use crate::workplace::{Outcome, Workplace, has_gpu};

/// Mounts the folder `full` with `$1` of room, runs the rest there, and lists what is left in `full.txt`.
const SCRIPT: &str = r#"
    mount -t tmpfs -o "size=$1" tmpfs full || exit 77
    shift
    "$@"
    code=$?
    (cd full && find . -type f) >full.txt
    exit $code"#;

/// How to get the right to mount: as any user, or as root where user namespaces are off.
const NAMESPACES: [&[&str]; 2] = [&["-rm"], &["-m"]];

/// Runs `collapsar` with a folder `full` that has `size` of room; `None`, with a word, where nothing may be mounted.
fn run_on_full_disk(place: &Workplace, size: &str, arguments: &[&str]) -> Option<Outcome> {
    in_namespace(place, SCRIPT, size, arguments)
}

/// Runs a script that mounts, with a size, the binary and its arguments; `None`, with a word, where nothing may be.
pub fn in_namespace(place: &Workplace, script: &str, size: &str, arguments: &[&str]) -> Option<Outcome> {
    for namespace in NAMESPACES {
        let binary = env!("CARGO_BIN_EXE_collapsar");
        let mut command = Command::new("unshare");
        command.args(namespace).args(["sh", "-c", script, "sh", size, binary]).args(arguments);
        command.current_dir(place.path("")).env("XDG_RUNTIME_DIR", "/tmp");
        // In the namespace this user is root, whose home Mesa may not write to, and says so.
        command.env("MESA_SHADER_CACHE_DISABLE", "true");
        match command.output().map(|output| Outcome::of(&output)) {
            // 1 with words of `unshare` itself, or our own 77: this way is closed.
            Ok(outcome) if outcome.code != Some(77) && !outcome.err.starts_with("unshare") => {
                return Some(outcome);
            }
            _ => {}
        }
    }
    eprintln!("skipped: no small file system can be mounted here (`unshare -rm` is not allowed)");
    None
}

/// A workplace with a baked box, and an empty folder to mount at.
fn workplace() -> Workplace {
    let place = Workplace::new();
    place.make_folder("full");
    place.write("box.obj", obj(&[patched_box(30)]));
    place.bake("box.obj", "box.clps");
    place
}

/// What is left on the full disk.
fn left(place: &Workplace) -> String {
    String::from_utf8(place.read("full.txt")).unwrap()
}

#[test]
fn a_bake_onto_a_full_disk_fails_and_leaves_nothing() {
    let place = workplace();
    let bake = ["bake", "box.obj", "-o", "full/out.clps"];
    let Some(outcome) = run_on_full_disk(&place, "64k", &bake) else { return };
    outcome.failed(&["cannot keep a part of the model", "No space left on device", "full/out.clps"]);
    assert_eq!(left(&place), "");
}

#[test]
fn an_export_onto_a_full_disk_fails_and_leaves_nothing() {
    let place = workplace();
    for output in ["full/out.obj", "full/out.glb"] {
        let export = ["export", "box.clps", "--ratio", "1", "-o", output];
        let Some(outcome) = run_on_full_disk(&place, "64k", &export) else { return };
        outcome.failed(&["cannot write", "No space left on device", output]);
        assert_eq!(left(&place), "");
    }
}

#[test]
fn a_flight_onto_a_full_disk_fails_and_leaves_only_whole_pictures() {
    if !has_gpu("cli::full_disk::a_flight_onto_a_full_disk_fails_and_leaves_only_whole_pictures") {
        return;
    }
    let place = workplace();
    let flight =
        ["fly", "box.clps", "--frames", "40", "--size", "128x128", "--png", "1", "--out", "full/flight"];
    let Some(outcome) = run_on_full_disk(&place, "32k", &flight) else { return };
    outcome.failed(&["cannot write", "No space left on device", "full/flight/frame_"]);
    let left = left(&place);
    assert!(left.lines().all(|file| file.starts_with("./flight/frame_") && file.ends_with(".png")), "{left}");
}

#[test]
fn the_numbers_of_a_flight_onto_a_full_disk_are_whole_or_missing() {
    if !has_gpu("cli::full_disk::the_numbers_of_a_flight_onto_a_full_disk_are_whole_or_missing") {
        return;
    }
    let place = workplace();
    let flight =
        ["fly", "box.clps", "--frames", "40", "--size", "64x64", "--no-hash", "--out", "full/flight"];
    let Some(outcome) = run_on_full_disk(&place, "4k", &flight) else { return };
    outcome.failed(&["cannot write", "No space left on device", "full/flight/frames.csv"]);
    assert_eq!(left(&place), "");
}

#[test]
fn a_report_onto_a_full_disk_fails() {
    let place = workplace();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let child = place.command(&["info", "box.clps", "--json"]).stdout(full).spawn().unwrap();
    let outcome = Outcome::of(&child.wait_with_output().unwrap());
    outcome.failed(&["cannot write", "No space left on device", "standard output"]);
}
