//! Outputs that cannot be where they were asked for.

use crate::models::{SQUARE, TRIANGLE};
use crate::workplace::{Workplace, has_gpu, names};

fn baked() -> Workplace {
    let place = Workplace::new();
    place.write("square.obj", SQUARE);
    place.bake("square.obj", "square.clps");
    place
}

#[test]
fn bake_into_a_missing_folder_fails() {
    let place = baked();
    let words = ["its folder does not exist; create it first: none"];
    place.fails(&["bake", "square.obj", "-o", "none/out.clps"], &words);
    place.fails(&["bake", "square.obj", "-o", "square.obj/out.clps"], &["folder", ": square.obj"]);
}

#[test]
fn export_into_a_missing_folder_fails() {
    let place = baked();
    for output in ["none/out.obj", "none/out.glb"] {
        let words = ["its folder does not exist; create it first: none\n"];
        place.fails(&["export", "square.clps", "--ratio", "1", "-o", output], &words);
    }
}

#[test]
fn a_flight_into_a_missing_folder_fails() {
    let place = baked();
    let words = ["folder", "create it first", "none\n"];
    place.fails(&["fly", "square.clps", "--frames", "1", "--out", "none/flight"], &words);
}

#[test]
fn an_output_that_is_a_folder_is_refused() {
    let place = baked();
    for folder in ["out.clps", "out.obj", "out.glb"] {
        place.make_folder(folder);
    }
    place.fails(&["bake", "square.obj", "-o", "out.clps"], &["is a folder; name a file", ": out.clps"]);
    for output in ["out.obj", "out.glb"] {
        let words = ["is a folder; name a file", output];
        place.fails(&["export", "square.clps", "--ratio", "1", "-o", output], &words);
    }
}

#[test]
fn a_model_is_not_replaced_by_what_is_made_of_it() {
    let place = baked();
    // A container by another name, and somebody's model.
    std::fs::copy(place.path("square.clps"), place.path("square.glb")).unwrap();
    std::fs::copy(crate::common::bundled("2CylinderEngine.glb"), place.path("engine.glb")).unwrap();
    place.write("other.obj", TRIANGLE);
    let kept = |name: &str| place.read(name);
    let names = ["square.clps", "square.glb", "engine.glb", "other.obj"];
    let before = names.map(kept);
    let png = ["the picture must end in .png"];
    place.fails(&["shot", "square.clps", "-o", "square.clps"], &png);
    place.fails(&["shot", "engine.glb", "-o", "engine.glb"], &png);
    place.fails(&["shot", "square.clps", "-o", "picture.jpg"], &png);
    let export = |file, output| ["export", file, "--ratio", "1", "-o", output];
    place.fails(&export("square.glb", "square.glb"), &["would replace this input", ": square.glb"]);
    let foreign = ["would replace a file that is not", "choose another output or remove it"];
    place.fails(&export("square.clps", "engine.glb"), &foreign);
    place.fails(&export("square.clps", "other.obj"), &foreign);
    assert!(names.map(kept) == before);
    assert!(!place.path("engine.glb.clps").exists(), "nothing is baked for a picture that cannot be");
    // What it wrote itself it writes again.
    for output in ["own.glb", "own.obj"] {
        place.run(&export("square.clps", output)).succeeded();
        place.run(&export("square.clps", output)).succeeded();
    }
}

#[test]
fn a_flight_into_a_file_is_refused() {
    let place = baked();
    place.fails(&["fly", "square.clps", "--out", "square.obj"], &["is a file", ": square.obj"]);
    place.fails(&["demo", "--datasets", &bundled(), "--out", "square.obj"], &["is a file", ": square.obj"]);
}

fn bundled() -> String {
    crate::common::bundled("").display().to_string()
}

#[test]
fn a_bake_over_its_own_input_is_refused() {
    let place = Workplace::new();
    place.write("model.obj", TRIANGLE);
    place.write("other.obj", SQUARE);
    let words = ["would replace this input; choose another output: model.obj"];
    place.fails(&["bake", "model.obj", "-o", "./model.obj"], &words);
    place.fails(&["bake", "other.obj", "model.obj", "-o", "model.obj"], &words);
}

#[test]
fn a_bake_over_a_file_that_is_no_container_is_refused() {
    let place = Workplace::new();
    place.write("model.obj", TRIANGLE);
    place.write("model.bin", "somebody's buffer");
    place.fails(
        &["bake", "model.obj", "-o", "model.bin"],
        &["not a container; choose another output", "model.bin"],
    );
    assert_eq!(std::fs::read(place.path("model.bin")).unwrap(), b"somebody's buffer");
}

#[test]
fn a_failed_bake_keeps_the_older_container() {
    let place = baked();
    place.write("square.obj", "v 0 0 0\n");
    place.fails(&["bake", "square.obj", "-o", "square.clps"], &["no triangles"]);
    place.verify("square.clps");
}

#[test]
fn a_bake_replaces_an_older_container_and_leaves_nothing_else() {
    let place = baked();
    place.write("square.obj", TRIANGLE);
    assert_eq!(place.bake("square.obj", "square.clps")["triangles"], 1);
    assert_eq!(names(&place.path("")), ["square.clps", "square.obj"]);
}

#[test]
fn demo_without_its_models_says_where_it_looked() {
    let place = Workplace::new();
    place.fails(&["demo"], &["a bundled model is missing", "--datasets", "2CylinderEngine.glb"]);
    place.fails(&["demo", "--datasets", "none"], &["a bundled model is missing", "none"]);
}

#[test]
fn demo_into_a_missing_folder_fails() {
    let place = Workplace::new();
    let words = ["folder", "create it first", "none\n"];
    place.fails(&["demo", "--datasets", &bundled(), "--out", "none/out"], &words);
}

/// Paths to drivers that do not exist hide every adapter on Linux.
#[cfg(target_os = "linux")]
const NO_ADAPTER: [(&str, &str); 2] =
    [("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];

#[test]
#[cfg(target_os = "linux")]
fn without_an_adapter_nothing_is_written_and_the_message_helps() {
    let place = baked();
    let before = place.snapshot();
    let words = ["no graphics adapter: install a Vulkan driver", "VK_DRIVER_FILES"];
    let flight = ["fly", "square.clps", "--frames", "1", "--png", "1", "--out", "flight"];
    place.run_with(&flight, &NO_ADAPTER).failed(&words);
    place.run_with(&[&flight as &[&str], &["--compare"]].concat(), &NO_ADAPTER).failed(&words);
    place.run_with(&["demo", "--datasets", &bundled(), "--out", "demo"], &NO_ADAPTER).failed(&words);
    place.assert_unchanged(&before);
}

#[test]
#[cfg(target_os = "linux")]
fn verbs_that_draw_nothing_need_no_adapter() {
    let place = Workplace::new();
    place.write("square.obj", SQUARE);
    for arguments in [
        &["bake", "square.obj", "-o", "square.clps"] as &[&str],
        &["info", "square.clps"],
        &["verify", "square.clps"],
        &["export", "square.clps", "--ratio", "1", "-o", "out.obj"],
    ] {
        place.run_with(arguments, &NO_ADAPTER).succeeded();
    }
}

#[test]
fn an_adapter_that_is_not_there_is_named_with_those_that_are() {
    if !has_gpu("cli::destination::an_adapter_that_is_not_there_is_named_with_those_that_are") {
        return;
    }
    let place = baked();
    let before = place.snapshot();
    let environment = [("COLLAPSAR_ADAPTER", "no such card")];
    let flight = ["fly", "square.clps", "--frames", "1", "--out", "flight"];
    place.run_with(&flight, &environment).failed(&["no such card", "COLLAPSAR_ADAPTER", "one of: "]);
    place.assert_unchanged(&before);
}
