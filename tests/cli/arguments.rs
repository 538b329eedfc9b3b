//! Arguments that make no sense.

use crate::models::SQUARE;
use crate::workplace::{Workplace, has_gpu};

fn baked() -> Workplace {
    let place = Workplace::new();
    place.write("square.obj", SQUARE);
    place.bake("square.obj", "square.clps");
    place
}

#[test]
fn a_budget_of_nothing_is_refused() {
    let place = baked();
    place.refuses(&["fly", "square.clps", "--budget", "0"], &["--budget", "must be at least 1"]);
    place.refuses(&["fly", "square.clps", "--budget", "0.5"], &["--budget", "must be at least 1"]);
    place.refuses(&["fly", "square.clps", "--budget=-5"], &["--budget", "must be a positive number"]);
    place.refuses(&["fly", "square.clps", "--budget", "much"], &["--budget", "is not a number"]);
    place.refuses(&["fly", "square.clps", "--budget", "1e30"], &["--budget", "must be at most"]);
    place.refuses(&["fly", "square.clps", "--budget", "nan"], &["--budget", "must be a positive number"]);
}

#[test]
fn pictures_without_a_folder_are_refused() {
    let words = ["--png needs a folder for the pictures: add --out DIR"];
    baked().fails(&["fly", "square.clps", "--png", "1"], &words);
}

#[test]
fn a_size_that_is_none_is_refused() {
    let place = baked();
    for size in ["0x0", "0x100", "100", "100x", "x", "1.5x2", "-1x5", "wide", "99999999999x1"] {
        let argument = format!("--size={size}");
        place.refuses(&["fly", "square.clps", &argument], &["--size", "width x height in pixels"]);
    }
}

#[test]
fn a_picture_larger_than_the_adapter_can_draw_is_refused() {
    if !has_gpu("cli::arguments::a_picture_larger_than_the_adapter_can_draw_is_refused") {
        return;
    }
    let place = baked();
    let flight = ["fly", "square.clps", "--frames", "1", "--size", "1000000x1000000"];
    place.fails(&flight, &["1000000x1000000", "pixels"]);
}

#[test]
fn frames_samples_and_choices_are_checked() {
    let place = baked();
    place.refuses(&["fly", "square.clps", "--frames", "0"], &["--frames"]);
    place.refuses(&["fly", "square.clps", "--samples", "3"], &["--samples", "1, 4"]);
    place.refuses(&["fly", "square.clps", "--strategy", "best"], &["coherent, whole, per-part"]);
    place.refuses(&["fly", "square.clps", "--select", "tpu"], &["cpu, gpu"]);
    place.refuses(&["fly", "square.clps", "--alpha", "0"], &["--alpha", "above 0"]);
    place.refuses(&["fly", "square.clps", "--upload-per-frame", "0"], &["--upload-per-frame", "1 byte"]);
}

#[test]
fn a_verb_without_what_it_needs_is_refused() {
    let place = baked();
    place.refuses(&["paint"], &["unrecognized subcommand", "paint"]);
    place.refuses(&["bake", "-o", "out.clps"], &["INPUT"]);
    place.refuses(&["bake", "square.obj"], &["--output"]);
    place.refuses(&["info"], &["FILE"]);
    place.refuses(&["bake", "square.obj", "-o", "out.clps", "--threads", "many"], &["--threads"]);
    place.refuses(&["bake", "square.obj", "-o", "out.clps", "--crease=-1"], &["--crease", "above 0"]);
}

#[test]
fn without_a_verb_the_help_is_shown() {
    let outcome = Workplace::new().run(&[]);
    assert_eq!(outcome.code, Some(2), "{outcome:?}");
    outcome.says(&["bake", "info", "verify", "export", "fly", "demo", "Examples:"]);
}

#[test]
fn export_needs_one_level() {
    let place = baked();
    let export =
        |level: &[&'static str]| [&["export", "square.clps", "-o", "out.obj"] as &[&str], level].concat();
    place.refuses(&export(&[]), &["--vertices", "--error", "--ratio"]);
    place.refuses(&export(&["--vertices", "3", "--ratio", "1"]), &["cannot be used with"]);
    place.refuses(&export(&["--vertices", "0"]), &["must be at least 1"]);
    place.refuses(&export(&["--ratio", "1.5"]), &["above 0 and at most 1"]);
    place.refuses(&export(&["--ratio", "0"]), &["above 0 and at most 1"]);
    place.refuses(&export(&["--error", "nan"]), &["above 0"]);
}

#[test]
fn export_of_an_unknown_part_says_where_the_names_are() {
    let words = ["no part called \"wheel\"", "info", "--parts", "square.clps"];
    baked().fails(&["export", "square.clps", "--part", "wheel", "--ratio", "1", "-o", "out.obj"], &words);
}

#[test]
fn export_to_an_unknown_extension_names_the_known_ones() {
    let place = baked();
    for output in ["out.stl", "out", "out.OBJ.txt"] {
        let words = ["must end in .obj or .glb", output];
        place.fails(&["export", "square.clps", "--ratio", "1", "-o", output], &words);
    }
}

#[test]
fn an_unknown_camera_path_names_the_known_ones() {
    let words = ["no such camera path", "orbit, walk, through, still, teleport", ": spiral"];
    baked().fails(&["fly", "square.clps", "--path", "spiral"], &words);
}

#[test]
fn an_unreadable_camera_path_is_named() {
    let place = baked();
    place.make_folder("path.json");
    place
        .fails(&["fly", "square.clps", "--path", "path.json"], &["cannot read the camera path", "path.json"]);
}

#[test]
fn a_malformed_camera_path_is_named_with_the_line() {
    let place = baked();
    for text in [
        "",
        "{",
        "not json",
        "{}",
        "[1, 2]",
        r#"[{"frame": 0}]"#,
        r#"[{"frame": -1, "eye": [0, 0, 0], "target": [1, 0, 0]}]"#,
        r#"[{"frame": 0, "eye": [0, 0], "target": [1, 0, 0]}]"#,
        r#"[{"frame": 0, "eye": [0, 0, 0], "target": [1, 0, 0], "speed": 3}]"#,
        r#"[{"frame": 0, "eye": [NaN, 0, 0], "target": [1, 0, 0]}]"#,
        r#"[{"frame": 0, "eye": [1e999, 0, 0], "target": [1, 0, 0]}]"#,
        "\u{0}\u{0}\u{0}",
        &"[".repeat(100_000),
    ] {
        place.write("path.json", text);
        let words = ["not a JSON array of {\"frame\", \"eye\", \"target\"}", "line 1", ": path.json"];
        place.fails(&["fly", "square.clps", "--path", "path.json", "--out", "flight"], &words);
    }
}

#[test]
fn a_camera_path_that_contradicts_itself_is_named_with_the_key() {
    let place = baked();
    let key = |frame: u32, rest: &str| format!(r#"{{"frame": {frame}, "target": [1, 0, 0], {rest}}}"#);
    let good = r#""eye": [0, 0, 0]"#;
    for (text, word) in [
        ("[]".to_owned(), "no keyframe"),
        (format!("[{}]", key(0, r#""eye": [1, 0, 0]"#)), "keyframe 0: eye and target must differ"),
        (format!("[{}]", key(0, r#""eye": [1e39, 0, 0]"#)), "keyframe 0: coordinates must be finite"),
        (format!("[{}]", key(0, r#""eye": [0, 0, 0], "up": [0, 0, 0]"#)), "keyframe 0: up must not be zero"),
        (format!("[{}]", key(0, r#""eye": [0, 0, 0], "fov_degrees": 180"#)), "keyframe 0: fov_degrees"),
        (format!("[{}, {}]", key(5, good), key(5, good)), "keyframe 1: frames must increase"),
    ] {
        place.write("path.json", text);
        let words = ["the camera path is not usable", word, ": path.json"];
        place.fails(&["fly", "square.clps", "--path", "path.json", "--out", "flight"], &words);
    }
}

#[test]
fn arguments_that_would_be_overruled_are_refused() {
    let place = baked();
    for [one, other] in
        [["--strategy=whole", "--compare"], ["--live", "--compare"], ["--reference=cpu", "--select=gpu"]]
    {
        place.refuses(&["fly", "square.clps", one, other], &["cannot be used with"]);
    }
}
