//! Models that are missing, empty, broken or strange.

use serde_json::Value;

use crate::models::{SQUARE, SQUARE_INDICES, SQUARE_POSITIONS, TRIANGLE, glb, obj};
use crate::workplace::{Workplace, has_gpu, names};

/// That a bake of the given file fails with these words and leaves nothing.
#[track_caller]
fn bake_fails(name: &str, content: impl AsRef<[u8]>, words: &[&str]) {
    let place = Workplace::new();
    place.write(name, content);
    place.fails(&["bake", name, "-o", "out.clps"], &[words, &[name]].concat());
}

/// Bakes the given file, verifies the container, and gives the report.
#[track_caller]
fn baked(name: &str, content: impl AsRef<[u8]>) -> Value {
    let place = Workplace::new();
    place.write(name, content);
    let report = place.bake(name, "out.clps");
    place.verify("out.clps");
    report
}

fn notes(report: &Value) -> String {
    report["notes"].to_string()
}

#[test]
fn a_missing_file_is_named() {
    let place = Workplace::new();
    place.fails(&["bake", "none.obj", "-o", "out.clps"], &["No such file", ": none.obj\n"]);
    place.fails(&["bake", "none.glb", "-o", "out.clps"], &["No such file", ": none.glb\n"]);
    for verb in [&["info"] as &[&str], &["verify"], &["fly"], &["export", "--ratio", "1", "-o", "a.obj"]] {
        place.fails(&[verb, &["none.clps"]].concat(), &["there is no such file: none.clps"]);
    }
}

#[test]
fn one_missing_file_among_several_is_named() {
    let place = Workplace::new();
    place.write("good.obj", TRIANGLE);
    place.fails(&["bake", "good.obj", "none.obj", "-o", "out.clps"], &["No such file", ": none.obj\n"]);
}

#[test]
fn an_empty_file_is_refused() {
    bake_fails("empty.obj", "", &["the file is empty"]);
    bake_fails("empty.glb", "", &["the file is empty"]);
    bake_fails("empty.gltf", "", &["the file is empty"]);
    let place = Workplace::new();
    place.write("empty.clps", "");
    for verb in ["info", "verify", "fly"] {
        place.fails(&[verb, "empty.clps"], &["this file is empty: empty.clps"]);
    }
}

#[test]
fn a_folder_is_no_model() {
    let place = Workplace::new();
    place.make_folder("folder.obj");
    place.fails(&["bake", "folder.obj", "-o", "out.clps"], &["not a file: folder.obj"]);
    for verb in ["info", "verify", "fly"] {
        place.fails(&[verb, "folder.obj"], &["not a file: folder.obj"]);
    }
}

#[test]
fn a_model_without_triangles_is_refused() {
    bake_fails("points.obj", "v 0 0 0\nv 1 0 0\np 1\nl 1 2\n", &["no triangles"]);
    bake_fails("words.obj", "this is not a model\n", &["no triangles"]);
    bake_fails("points.glb", glb(&SQUARE_POSITIONS, &SQUARE_INDICES, 0), &["no triangles"]);
    bake_fails("words.glb", "this is not a model", &["words.glb"]);
}

#[test]
fn a_model_of_degenerate_triangles_alone_is_refused() {
    bake_fails("flat.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\nf 1 1 1\n", &["triangles"]);
    let same = [[1.0f32, 2.0, 3.0]; 3];
    bake_fails("point.glb", glb(&same, &[0, 1, 2], 4), &["none of the 1 triangles has an area"]);
}

#[test]
fn an_index_out_of_range_in_obj_is_skipped_and_noted() {
    let report = baked("some.obj", format!("{SQUARE}f 1 2 9\nf 0 1 2\n"));
    assert_eq!(report["triangles"], 2);
    assert!(notes(&report).contains("line 7"), "{report}");
    bake_fails("all.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", &["no triangles", "line 4"]);
}

#[test]
fn an_index_out_of_range_in_glb_is_skipped_and_noted() {
    let report = baked("some.glb", glb(&SQUARE_POSITIONS, &[0, 1, 2, 0, 2, 4], 4));
    assert_eq!(report["triangles"], 1);
    assert!(notes(&report).contains("vertex that is not there"), "{report}");
    bake_fails("all.glb", glb(&SQUARE_POSITIONS, &[7, 8, u32::MAX], 4), &["no triangles", "not there"]);
}

#[test]
fn positions_that_are_not_finite_lose_their_triangles_only() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut positions = SQUARE_POSITIONS;
        positions[3][1] = bad;
        let report = baked("some.glb", glb(&positions, &SQUARE_INDICES, 4));
        assert_eq!(report["triangles"], 1, "{bad}");
        assert!(notes(&report).contains("not finite"), "{report}");
        let all = glb(&[[bad; 3]; 4], &SQUARE_INDICES, 4);
        bake_fails("all.glb", all, &["no triangles", "not finite"]);
    }
}

#[test]
fn positions_that_are_not_finite_in_obj_lose_their_triangles_only() {
    for bad in ["nan", "inf", "-inf", "1e999"] {
        let report = baked("some.obj", format!("{SQUARE}v 0 0 {bad}\nf 1 2 5\n"));
        assert_eq!(report["triangles"], 2, "{bad}");
        assert!(notes(&report).contains("not finite"), "{report}");
        let all = format!("v {bad} 0 0\nv 0 {bad} 0\nv 0 0 {bad}\nf 1 2 3\n");
        bake_fails("all.obj", all, &["no triangles", "not finite"]);
    }
}

#[test]
fn degenerate_and_duplicate_triangles_are_dropped_and_counted() {
    // Vertex 5 lies where vertex 1 does: one face repeats a corner by position, two repeat the first face.
    let report = baked("odd.obj", format!("{SQUARE}v 0 0 0\nf 1 5 2\nf 2 3 1\nf 5 2 3\n"));
    assert_eq!(report["triangles"], 2, "{report}");
    assert_eq!(report["degenerate_triangles"], 1, "{report}");
    assert_eq!(report["duplicate_triangles"], 2, "{report}");
}

#[test]
fn a_non_manifold_fan_bakes_and_verifies() {
    let mut text = "v 0 0 0\nv 0 0 1\n".to_owned();
    for blade in 0..8u8 {
        let angle = f32::from(blade) * std::f32::consts::TAU / 8.0;
        text.push_str(&format!("v {} {} 0.5\nf 1 2 {}\n", angle.cos(), angle.sin(), blade + 3));
    }
    let report = baked("fan.obj", text);
    assert_eq!(report["triangles"], 8, "{report}");
    assert_eq!(report["non_manifold_edges"], 1, "{report}");
}

#[test]
fn a_bow_tie_and_an_inner_wall_bake_and_verify() {
    let bow_tie = "v 0 0 0\nv 1 1 0\nv 1 -1 0\nv -1 1 0\nv -1 -1 0\nf 1 3 2\nf 1 4 5\n";
    assert_eq!(baked("bow_tie.obj", bow_tie)["triangles"], 2);
    let walled = obj(&[crate::common::patched_box(3)]) + "v 0.5 0 0\nv 0.5 1 0\nv 0.5 1 1\nf -3 -2 -1\n";
    assert_eq!(baked("walled.obj", walled)["triangles"], 6 * 9 * 2 + 1);
}

#[test]
fn a_part_of_one_triangle_bakes_verifies_and_exports() {
    let place = Workplace::new();
    place.write("one.obj", TRIANGLE);
    let report = place.bake("one.obj", "one.clps");
    assert_eq!((&report["triangles"], &report["vertices"]), (&1.into(), &3.into()));
    place.verify("one.clps");
    for output in ["again.obj", "again.glb"] {
        for level in [["--ratio", "1"], ["--vertices", "1"], ["--error", "1000"]] {
            place.run(&[&["export", "one.clps", "-o", output] as &[&str], &level].concat()).succeeded();
            assert_eq!(place.bake(output, "again.clps")["triangles"], 1, "{output} {level:?}");
        }
    }
}

#[test]
fn a_part_of_one_triangle_flies() {
    if !has_gpu("cli::input::a_part_of_one_triangle_flies") {
        return;
    }
    let place = Workplace::new();
    place.write("one.obj", TRIANGLE);
    place.bake("one.obj", "one.clps");
    assert_eq!(place.fly_briefly("one.clps")["active_triangles_mean"], 1.0);
}

#[test]
fn malformed_gltf_is_refused() {
    for text in ["{", "{}", "[]", "null", "{\"asset\": 3}", "\u{0}", &"[".repeat(100_000)] {
        bake_fails("model.gltf", text, &[]);
    }
    for length in [4u32, 12, 20, u32::MAX] {
        let header = [b"glTF" as &[u8], &2u32.to_le_bytes(), &length.to_le_bytes()].concat();
        bake_fails("model.glb", header, &[]);
    }
}

#[test]
fn a_pipe_is_no_model_and_is_not_waited_for() {
    let place = Workplace::new();
    let made = std::process::Command::new("mkfifo").arg(place.path("pipe.obj")).status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: no pipe can be made here (mkfifo)");
        return;
    }
    place.run(&["bake", "pipe.obj", "-o", "out.clps"]).failed(&["not a file: pipe.obj"]);
    place.run(&["info", "pipe.obj"]).failed(&["not a file: pipe.obj"]);
    place.write("model.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.bake("model.obj", "model.clps");
    place.run(&["fly", "model.clps", "--path", "pipe.obj"]).failed(&["not a file", "pipe.obj"]);
    std::fs::remove_file(place.path("model.obj")).unwrap();
    std::fs::remove_file(place.path("model.clps")).unwrap();
    assert_eq!(names(&place.path("")), ["pipe.obj"]);
}

#[test]
fn an_unknown_extension_is_named_with_the_known_ones() {
    bake_fails("model.step", TRIANGLE, &["unknown extension \"step\"", "obj, glb, gltf, ply, stl"]);
    bake_fails("model", TRIANGLE, &["unknown extension \"\"", "obj, glb, gltf, ply, stl"]);
}

/// A square of two triangles as PLY.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
    property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 255\n0 1 0 9 9 9\n\
    4 0 1 2 3\n";

/// One triangle as STL.
const STL: &str = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";

#[test]
fn every_format_and_packing_bakes_from_end_to_end() {
    let zstd = |text: &str| zstd::encode_all(text.as_bytes(), 1).unwrap();
    let gzip = |text: &str| {
        let mut packed = Vec::new();
        let mut encoder = flate2::read::GzEncoder::new(text.as_bytes(), flate2::Compression::fast());
        std::io::Read::read_to_end(&mut encoder, &mut packed).unwrap();
        packed
    };
    for (name, content, triangles) in [
        ("x.ply", PLY.into(), 2),
        ("x.stl", STL.into(), 1),
        ("x.obj.zst", zstd(SQUARE), 2),
        ("x.ply.gz", gzip(PLY), 2),
        ("x.stl.zst", zstd(STL), 1),
        ("x.glb.gz", gzip(""), 0),
    ] {
        if triangles == 0 {
            bake_fails(name, content, &["malformed"]);
        } else {
            assert_eq!(baked(name, content)["triangles"], triangles, "{name}");
        }
    }
}

#[test]
fn packed_files_that_cannot_be_unpacked_are_refused() {
    bake_fails("x.obj.zst", TRIANGLE, &["cannot unpack the file", "zstd"]);
    bake_fails("x.obj.gz", TRIANGLE, &["cannot unpack the file", "gzip"]);
    bake_fails("x.zst", TRIANGLE, &["unknown extension \"\"", "each also packed as .zst or .gz"]);
}

#[test]
fn files_that_a_model_refers_to_are_named_when_they_are_missing() {
    let text = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "none.bin", "byteLength": 8}]}"#;
    bake_fails("model.gltf", text, &["none.bin", "does not exist"]);
    let report = baked("model.obj", format!("mtllib none.mtl\n{TRIANGLE}"));
    assert!(notes(&report).contains("none.mtl"), "{report}");
}

/// A GLB file with another text.
fn with_text(glb: &[u8], change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    change(&mut json);
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[20 + length..];
    let all = 20 + text.len() + rest.len();
    let mut made = b"glTF\x02\0\0\0".to_vec();
    made.extend((all as u32).to_le_bytes());
    made.extend((text.len() as u32).to_le_bytes());
    made.extend(b"JSON");
    made.extend(text);
    made.extend(rest);
    made
}

#[test]
fn what_would_bend_a_mesh_is_noted() {
    let place = Workplace::new();
    let plain = glb(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2], 4);
    let bent = with_text(&plain, |json| {
        json["nodes"][0]["skin"] = 0.into();
        json["meshes"][0]["weights"] = serde_json::json!([1.0]);
        json["meshes"][0]["primitives"][0]["targets"] = serde_json::json!([{ "POSITION": 0 }]);
    });
    place.write("plain.glb", plain);
    place.write("bent.glb", bent);
    assert_eq!(place.bake("plain.glb", "plain.clps")["notes"], serde_json::json!([]));
    let notes = place.bake("bent.glb", "bent.clps")["notes"].to_string();
    for word in ["skins are not read", "morph targets are not read"] {
        assert!(notes.contains(word), "no {word} in {notes}");
    }
}

/// A triangle called bolt with copies, of which `attributes` says where they are.
fn copied(attributes: impl FnOnce(&mut serde_json::Value) -> serde_json::Value) -> Vec<u8> {
    let plain = glb(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2], 4);
    with_text(&plain, |json| {
        let attributes = attributes(json);
        json["extensionsRequired"] = serde_json::json!(["EXT_mesh_gpu_instancing"]);
        json["nodes"][0]["name"] = "bolt".into();
        json["nodes"][0]["extensions"] =
            serde_json::json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    })
}

#[test]
fn copies_of_a_mesh_are_placed_and_listed() {
    let place = Workplace::new();
    // The corners of the triangle are where the copies are, too.
    let corners =
        |json: &mut serde_json::Value| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].clone();
    let copied = copied(|json| serde_json::json!({ "TRANSLATION": corners(json) }));
    place.write("copied.glb", copied);
    let report = place.bake("copied.glb", "copied.clps");
    assert_eq!((&report["triangles"], &report["instances"]), (&1.into(), &3.into()), "{report}");
    // What is exported again has them as plain nodes, in the same places.
    place.run(&["export", "copied.clps", "-o", "again.glb", "--ratio", "1"]).succeeded();
    assert_eq!(place.bake("again.glb", "again.clps")["instances"], 3);
    let bounds = |file: &str| place.run(&["info", file, "--json"]).json()["bounds"].clone();
    assert_eq!(bounds("copied.clps"), bounds("again.clps"));
    let part = place.run(&["info", "copied.clps", "--parts"]);
    assert!(part.out.contains("bolt") && !part.out.contains("bolt 1"), "{}", part.out);
}

#[test]
fn copies_that_take_more_than_the_memory_are_refused() {
    let place = Workplace::new();
    let copied = copied(|json| {
        let accessors = json["accessors"].as_array_mut().unwrap();
        accessors.push(serde_json::json!({ "componentType": 5126, "count": 200_000, "type": "VEC3" }));
        serde_json::json!({ "SCALE": accessors.len() - 1 })
    });
    place.write("copied.glb", copied);
    let bake = ["bake", "copied.glb", "-o", "out.clps", "--memory", "64MiB"];
    place.run(&bake).failed(&["the copies of its meshes take", "copied.glb"]);
    // Without a cap it is the accessor that is refused: nothing stands behind it.
    place.run(&bake[..4]).failed(&["promises 200000 elements", "copied.glb"]);
}
