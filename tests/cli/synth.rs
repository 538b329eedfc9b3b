//! `synth` on the real binary: what it writes, that it writes the same again, and what it refuses.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::workplace::{Outcome, Workplace, names};

const SMALL: [&str; 5] = ["synth", "--triangles", "30k", "--parts", "120"];

fn synth(place: &Workplace, arguments: &[&str]) -> Outcome {
    place.run(&[&SMALL, arguments].concat())
}

#[test]
fn a_container_is_sound_and_has_what_was_asked_for() {
    let place = Workplace::new();
    for layout in ["airplane", "ship", "plant"] {
        let outcome =
            synth(&place, &["--instances", "200", "--layout", layout, "-o", "model.clps", "--json"]);
        let report = outcome.succeeded().json();
        assert_eq!(report["layout"], layout);
        for (key, expected) in [("triangles", 30_000), ("parts", 120), ("instances", 200)] {
            assert_eq!(report[key], expected, "{report}");
        }
        assert_eq!(report["file_bytes"], place.read("model.clps").len());
        place.verify("model.clps");
        let info = place.run(&["info", "model.clps", "--json"]).succeeded().json();
        assert_eq!((&info["parts"], &info["instances"]), (&120.into(), &200.into()), "{info}");
        let triangles = info["triangles"].as_u64().unwrap();
        assert!((29_900..=30_000).contains(&triangles), "{triangles} of 30,000 are left by the weld");
    }
    assert_eq!(names(&place.path("")), ["model.clps"]);
}

#[test]
fn the_same_options_give_the_same_bytes_with_any_number_of_threads() {
    let place = Workplace::new();
    for format in ["clps", "glb", "obj"] {
        let run = |name: &str, seed: &str, threads: &str| {
            let arguments = ["--seed", seed, "--threads", threads, "--as", format, "-o", name];
            synth(&place, &arguments).succeeded();
            place.read(name)
        };
        let [one, same, other] =
            [("one", "3", "1"), ("same", "3", "4"), ("other", "4", "4")].map(|(n, s, t)| run(n, s, t));
        assert!(one == same, "{format}: other bytes with other threads");
        assert!(one != other, "{format}: the same bytes with another seed");
        for name in ["one", "same", "other"] {
            std::fs::remove_file(place.path(name)).unwrap();
        }
    }
}

#[test]
fn glb_and_obj_can_be_baked() {
    let place = Workplace::new();
    for name in ["model.glb", "model.obj"] {
        let made = synth(&place, &["-o", name, "--json"]).succeeded().json();
        let baked = place.bake(name, "baked.clps");
        let key = if name.ends_with("obj") { "triangles_placed" } else { "triangles" };
        assert_eq!(baked["source_triangles"], made[key], "{name}");
        assert_eq!(baked["instances"], made["instances"], "{name}");
    }
}

#[test]
fn the_report_for_people_has_the_numbers() {
    let place = Workplace::new();
    let outcome = place.run(&["synth", "-o", "model.glb", "--triangles", "12345"]).succeeded();
    for word in ["parts", "12,345", "placed", "triangles/s", ": model.glb"] {
        assert!(outcome.out.contains(word), "no {word}: {}", outcome.out);
    }
}

#[test]
fn sizes_that_no_model_has_are_refused() {
    let place = Workplace::new();
    let fails = |arguments: &[&str], words: &[&str]| {
        place.fails(&[&["synth", "-o", "model.clps"], arguments].concat(), words);
    };
    fails(&["--triangles", "0"], &["cannot make this model", "at least 20, not 0"]);
    fails(&["--triangles", "1000", "--parts", "51"], &["at most 50 parts, not 51"]);
    fails(&["--triangles", "1000", "--parts", "0"], &["at least 1"]);
    fails(&["--triangles", "100", "--parts", "100M"], &["at most 5 parts"]);
    fails(&["--triangles", "100M", "--parts", "10"], &["at least 50 parts, not 10"]);
    fails(&["--parts", "500", "--instances", "499"], &["500 parts", "at least as many instances, not 499"]);
    fails(&["--instances", "1G"], &["at most 16777216 instances, not 1000000000"]);
    fails(&["--triangles", "1000000G"], &["ask for at most 33554432000000"]);
    for size in ["1e99", "-1", "NaN", "inf", "many", "99999999999999999999999"] {
        let size = format!("--triangles={size}");
        place.refuses(&["synth", "-o", "model.clps", &size], &["--triangles"]);
    }
    place.refuses(&["synth", "-o", "model.clps", "--seed=-1"], &["--seed"]);
    place.refuses(&["synth", "-o", "model.clps", "--layout", "train"], &["airplane", "ship", "plant"]);
}

#[test]
fn a_glb_that_would_be_too_large_is_refused_at_once() {
    let place = Workplace::new();
    let started = Instant::now();
    let words = [
        "a GLB file holds less than 4 GiB",
        "ask for at most about",
        "or write OBJ or a container: large.glb",
    ];
    place.fails(&["synth", "--triangles", "1G", "--parts", "2M", "-o", "large.glb"], &words);
    assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
}

#[test]
fn outputs_that_cannot_be_are_refused() {
    let place = Workplace::new();
    place.write("mine.obj", "# a model of mine\n");
    place.write("mine.glb", "no GLB file");
    place.make_folder("folder.clps");
    let fails =
        |output: &str, words: &[&str]| place.fails(&[&SMALL as &[&str], &["-o", output]].concat(), words);
    fails("model.step", &["must end in .clps, .glb or .obj", "--as", ": model.step"]);
    fails("model", &["must end in .clps, .glb or .obj"]);
    fails("none/model.glb", &["its folder does not exist; create it first: none"]);
    fails("none/model.clps", &["folder", "create it first: none"]);
    fails("folder.clps", &["is a folder"]);
    fails("mine.obj", &["would replace a file that is not", ": mine.obj"]);
    fails("mine.glb", &["would replace a file that is not", ": mine.glb"]);
    place.refuses(&[&SMALL as &[&str], &["-o", "x.glb", "--as", "stl"]].concat(), &["clps", "glb", "obj"]);
    // What it has written itself it may replace.
    for name in ["a.obj", "a.glb", "a.clps"] {
        synth(&place, &["-o", name]).succeeded();
        synth(&place, &["-o", name, "--seed", "9"]).succeeded();
    }
}

#[test]
#[cfg(unix)]
fn interrupted_it_leaves_no_file() {
    let place = Workplace::new();
    for (name, waits) in [("model.clps", [300, 2500]), ("model.glb", [200, 1200]), ("model.obj", [200, 1200])]
    {
        for wait in waits {
            let arguments = ["synth", "--triangles", "90M", "--parts", "200k", "-o", name];
            let child = place.command(&arguments).spawn().unwrap();
            std::thread::sleep(Duration::from_millis(wait));
            let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
            assert!(interrupted.success());
            let signalled = Instant::now();
            let outcome = Outcome::of(&child.wait_with_output().unwrap());
            assert!(signalled.elapsed() < Duration::from_secs(15), "{name}: {:?}", signalled.elapsed());
            outcome.failed_with(130, &["interrupted"]);
            // What a bake has done by then is kept, to go on with: see `resume.rs`.
            let _ = std::fs::remove_dir_all(place.path("model.clps.bake"));
            assert_eq!(names(&place.path("")), [""; 0]);
        }
    }
}
