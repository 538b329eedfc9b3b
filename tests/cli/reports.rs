//! What the verbs say when all went well: the promised keys with the right types, on standard output alone.

use std::collections::BTreeSet;

use collapsar::stats::FrameRecord;
use serde_json::Value;

use crate::common::{bundled, height_field, patched_box};
use crate::models::{glb, obj};
use crate::workplace::{Workplace, has_gpu, names};

/// A workplace with a container of two objects, `model.clps`.
fn baked() -> Workplace {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(10), height_field(12)]));
    place.bake("model.obj", "model.clps");
    place
}

#[track_caller]
fn assert_counts(object: &Value, keys: &[&str]) {
    for key in keys {
        assert!(object[key].is_u64(), "{key} is no count in {object:#}");
    }
}

#[track_caller]
fn assert_numbers(object: &Value, keys: &[&str]) {
    for key in keys {
        assert!(object[key].as_f64().is_some_and(|number| number >= 0.0), "{key} is no number in {object:#}");
    }
}

const COUNTS: [&str; 7] =
    ["parts", "instances", "vertices", "triangles", "locked_vertices", "coarsest_triangles", "file_bytes"];

#[test]
fn bake_json_has_the_promised_keys() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(10), height_field(12)]));
    let outcome = place.run(&["bake", "model.obj", "-o", "model.clps", "--json"]).succeeded();
    assert_eq!(outcome.err, "", "nothing but the report");
    let report = outcome.json();
    assert_counts(&report, &COUNTS);
    assert_numbers(&report, &["seconds", "triangles_per_second", "bytes_per_triangle"]);
    if cfg!(target_os = "linux") {
        assert_counts(&report, &["peak_rss_bytes", "rss_before_bytes"]);
        assert!(report["rss_before_bytes"].as_u64() <= report["peak_rss_bytes"].as_u64());
    }
    assert_eq!((&report["parts"], &report["instances"]), (&2.into(), &2.into()));
    assert_eq!(report["triangles"], 6 * 100 * 2 + 144 * 2);
    assert_eq!(report["file_bytes"], place.read("model.clps").len());
    assert!(report["stalled_parts"].is_array() && report["notes"].is_array());
}

/// The whole report is the summary with a list, whose numbers add up to those of the summary.
#[test]
fn a_report_lists_every_part() {
    let place = Workplace::new();
    let patches = patched_box(10);
    place.write("box.glb", glb(&patches.positions, patches.triangles.as_flattened(), 4));
    place.write("field.obj", obj(&[height_field(12)]));
    let bake = ["bake", "box.glb", "field.obj", "-o", "model.clps", "--json", "--report", "model.json"];
    let mut summary = place.run(&bake).succeeded().json();
    let mut report: Value = serde_json::from_slice(&place.read("model.json")).unwrap();
    let list = report.as_object_mut().unwrap().remove("part_list").unwrap();
    assert_eq!(report, summary);
    let list = list.as_array().unwrap();
    assert_eq!((list.len(), &list[1]["name"]), (2, &"field0".into()));
    for key in [
        "cells",
        "instances",
        "triangles",
        "vertices",
        "source_triangles",
        "source_vertices",
        "source_open_vertices",
        "welded_positions",
        "moved_positions",
        "degenerate_triangles",
        "duplicate_triangles",
        "open_positions",
        "shared_positions",
        "non_manifold_edges",
        "locked_vertices",
        "coarsest_triangles",
    ] {
        let sum: u64 = list.iter().map(|part| part[key].as_u64().unwrap()).sum();
        assert_eq!(summary[key].take(), sum, "{key}");
    }
    // A box of six patches of 11 x 11 vertices is all boundary round each patch, and closed when welded.
    let [patches, field] = [0, 1].map(|part| &list[part]);
    assert_eq!((&patches["source_open_vertices"], &patches["open_positions"]), (&240.into(), &0.into()));
    assert_eq!((&field["source_open_vertices"], &field["open_positions"]), (&48.into(), &48.into()));
    assert!(field["coarsest_error"].as_f64().unwrap() > 0.0 && field["stall"].is_null(), "{field:#}");
    // What `info` reads from the file.
    let info = place.run(&["info", "model.clps", "--json", "--parts"]).succeeded().json();
    let payload: u64 = list.iter().map(|part| part["payload_bytes"].as_u64().unwrap()).sum();
    let tiers = info["tiers"].as_array().unwrap().iter().map(|tier| tier["bytes"].as_u64().unwrap());
    assert_eq!(payload, tiers.sum::<u64>());
    assert_eq!(info["part_list"][0]["tiers"], patches["tiers"]);
}

/// A report replaces an older one and nothing else, and nothing is baked where it cannot be written.
#[test]
fn a_report_replaces_nothing_but_a_report() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[height_field(4)]));
    place.write("model.bin", "somebody's buffer");
    place.write("model.gltf", "{\n  \"asset\": {} }");
    let report = |path| ["bake", "model.obj", "-o", "model.clps", "--report", path];
    place.fails(&report("./model.obj"), &["the report would replace this input", "model.obj"]);
    place.fails(&report("./model.clps"), &["the report would replace the container", "model.clps"]);
    for other in ["model.bin", "model.gltf"] {
        place.fails(&report(other), &["the report would replace a file that is not a report", other]);
    }
    place.fails(&report("none/model.json"), &["its folder does not exist; create it first: none"]);
    assert!(!place.path("model.clps").exists());
    for _ in 0..2 {
        place.run(&report("model.json")).succeeded();
    }
    let named = ["model.bin", "model.clps", "model.gltf", "model.json", "model.obj"];
    assert_eq!(names(&place.path("")), named);
}

#[test]
fn info_json_has_the_promised_keys_and_the_numbers_of_the_bake() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(10), height_field(12)]));
    let report = place.bake("model.obj", "model.clps");
    let info = place.run(&["info", "model.clps", "--json"]).succeeded().json();
    assert_counts(&info, &COUNTS);
    for key in COUNTS {
        assert_eq!(info[key], report[key], "{key}");
    }
    assert!(info["section_bytes"].as_object().unwrap().values().all(Value::is_u64));
    assert!(!info["tiers"].as_array().unwrap().is_empty());
    assert!(info.get("part_list").is_none());
}

#[test]
fn info_lists_parts_when_asked() {
    let place = baked();
    let info = place.run(&["info", "model.clps", "--json", "--parts"]).succeeded().json();
    let list = info["part_list"].as_array().unwrap();
    assert_eq!(list.iter().map(|part| &part["name"]).collect::<Vec<_>>(), ["box0", "field1"]);
    for part in list {
        assert_counts(part, &["vertices", "triangles", "tiers", "locked_vertices", "coarsest_triangles"]);
        assert!(part["stall"].is_string());
    }
    let text = place.run(&["info", "model.clps", "--parts"]).succeeded().out;
    assert!(text.contains("box0") && text.contains("field1"), "{text}");
}

#[test]
fn text_reports_have_the_numbers() {
    let place = baked();
    let text = place.run(&["bake", "model.obj", "-o", "model.clps"]).succeeded().out;
    assert!(
        text.contains("1,488") && text.contains("model.clps") && text.contains("bytes/triangle"),
        "{text}"
    );
    let text = place.run(&["info", "model.clps"]).succeeded().out;
    assert!(text.contains("1,488") && text.contains("tier 0"), "{text}");
    let text = place.run(&["export", "model.clps", "--ratio", "0.5", "-o", "half.obj"]).succeeded().out;
    assert!(text.contains("2 meshes, placed 2 times: half.obj"), "{text}");
}

/// A part that cannot become coarser is named, whatever the reason.
#[test]
fn parts_that_keep_more_than_a_tenth_are_counted() {
    let place = Workplace::new();
    place.write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let text = place.run(&["bake", "one.obj", "-o", "one.clps"]).succeeded().out;
    assert!(
        text.contains("1 parts keep more than a tenth (1 by having few triangles); most: \"one\", 1 of 1"),
        "{text}"
    );
    let text = place.run(&["info", "one.clps"]).succeeded().out;
    assert!(text.contains("1 parts stalled above a tenth"), "{text}");
}

/// The keys of the issue, and what each holds.
fn assert_summary(summary: &Value) {
    assert_counts(
        summary,
        &[
            "frames",
            "budget_vertices",
            "bytes_sent_total",
            "bytes_whole_total",
            "gpu_bytes_peak",
            "resident_bytes_peak",
        ],
    );
    assert_numbers(
        summary,
        &["active_triangles_mean", "active_vertices_mean", "frame_ms_p50", "frame_ms_p99"],
    );
    assert!(summary["transfer_saving"].as_f64().is_some_and(|saving| saving > 1.0), "{summary:#}");
    assert!(!summary["adapter"].as_str().unwrap().is_empty());
    let hash = summary["index_hash"].as_str().unwrap();
    assert!(hash.len() == 16 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()), "{hash}");
    let stages: BTreeSet<&str> =
        summary["stage_ms"].as_object().unwrap().keys().map(String::as_str).collect();
    let named = ["select", "residency", "delta", "gather", "upload", "defragment", "reform", "draw"];
    assert_eq!(stages, named.into());
    assert!(summary["stage_ms"].as_object().unwrap().values().all(Value::is_f64));
    for pass in ["grant", "prefix_sum", "defragment", "reform", "draw"] {
        assert!(summary["pass_ms"][pass].as_f64().is_some_and(|ms| ms > 0.0), "{pass}: {summary:#}");
        assert!(
            summary["floor_bytes"][pass].as_f64().is_some_and(|bytes| bytes > 0.0),
            "{pass}: {summary:#}"
        );
    }
}

#[test]
fn fly_writes_the_promised_files() {
    if !has_gpu("cli::reports::fly_writes_the_promised_files") {
        return;
    }
    let place = baked();
    let flight = [
        "fly",
        "model.clps",
        "--frames",
        "5",
        "--size",
        "64x48",
        "--budget",
        "500",
        "--png",
        "2",
        "--out",
        "flight",
        "--json",
    ];
    let outcome = place.run(&flight).succeeded();
    assert_eq!(outcome.err, "");
    let summary = outcome.json();
    assert_summary(&summary);
    assert_eq!((&summary["frames"], &summary["budget_vertices"]), (&5.into(), &500.into()));
    assert_eq!(summary["strategy"], "coherent");
    let files = ["frame_00000.png", "frame_00002.png", "frame_00004.png", "frames.csv", "summary.json"];
    assert_eq!(names(&place.path("flight")), files);
    assert_eq!(serde_json::from_slice::<Value>(&place.read("flight/summary.json")).unwrap(), summary);
    let picture = image::load_from_memory(&place.read("flight/frame_00004.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (64, 48));
    assert_table(&String::from_utf8(place.read("flight/frames.csv")).unwrap(), 5);
}

/// A header of the documented columns, and one line of numbers a frame.
fn assert_table(csv: &str, frames: usize) {
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], FrameRecord::COLUMNS.join(","));
    assert_eq!(lines.len(), 1 + frames);
    for column in
        ["frame", "active_vertices", "streamed_triangles", "bytes_sent", "bytes_whole", "misses", "draw_ms"]
    {
        assert!(lines[0].split(',').any(|name| name == column), "{column}");
    }
    for (frame, line) in lines[1..].iter().enumerate() {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        assert_eq!((values.len(), values[0]), (FrameRecord::COLUMNS.len(), frame as f64));
    }
}

/// What a comparison writes.
const COMPARISON: [&str; 5] = ["coherent", "per-part", "summary.json", "table.txt", "whole"];

#[test]
fn a_comparison_has_a_summary_a_strategy_and_a_table() {
    if !has_gpu("cli::reports::a_comparison_has_a_summary_a_strategy_and_a_table") {
        return;
    }
    let place = baked();
    let flight = [
        "fly",
        "model.clps",
        "--frames",
        "4",
        "--size",
        "64x64",
        "--budget",
        "500",
        "--compare",
        "--out",
        "flight",
    ];
    let table = place.run(&flight).succeeded().out;
    assert!(table.contains("transfer saving") && table.contains("drew the same frames"), "{table}");
    assert_eq!(names(&place.path("flight")), COMPARISON);
    assert_eq!(String::from_utf8(place.read("flight/table.txt")).unwrap(), table);
    let summary: Value = serde_json::from_slice(&place.read("flight/summary.json")).unwrap();
    let strategies = summary["strategies"].as_array().unwrap();
    let words: Vec<_> = strategies.iter().map(|flight| flight["strategy"].as_str().unwrap()).collect();
    assert_eq!(words, ["coherent", "whole", "per-part"]);
    assert!(strategies.iter().all(|flight| flight["index_hash"] == strategies[0]["index_hash"]));
    for word in words {
        assert_eq!(names(&place.path("flight").join(word)), ["frames.csv", "summary.json"]);
    }
}

#[test]
fn demo_bakes_flies_and_says_where_the_pictures_are() {
    if !has_gpu("cli::reports::demo_bakes_flies_and_says_where_the_pictures_are") {
        return;
    }
    let (place, models) = (Workplace::new(), bundled(""));
    let demo = ["demo", "--datasets", models.to_str().unwrap(), "--frames", "2", "--size", "64x64"];
    let text = place.run(&demo).succeeded().out;
    for model in ["engine", "truck"] {
        assert_eq!(names(&place.path("out").join(model)), COMPARISON);
        assert!(text.contains(&format!("pictures: out/{model}/coherent")), "{text}");
    }
    assert!(text.contains("transfer saving"), "{text}");
    let again = place.run(&demo).succeeded().out;
    assert_eq!(again.matches("already baked: out/").count(), 2, "{again}");
}

#[test]
fn a_flight_along_keyframes_works() {
    if !has_gpu("cli::reports::a_flight_along_keyframes_works") {
        return;
    }
    let place = baked();
    place.write(
        "path.json",
        r#"[{"frame": 0, "eye": [3, 2, 3], "target": [0, 0, 0]}, {"frame": 2, "eye": [3, 2, -3], "target": [0, 0, 0]}]"#,
    );
    let flight = ["fly", "model.clps", "--path", "path.json", "--frames", "3", "--size", "64x64", "--json"];
    let summary = place.run(&flight).succeeded().json();
    assert_eq!((&summary["path"], &summary["frames"]), (&"keyframes".into(), &3.into()));
    assert!(summary["active_triangles_mean"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_bake_is_the_same_for_any_number_of_threads() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(12), height_field(30), patched_box(3), height_field(17)]));
    let engine = bundled("2CylinderEngine.glb");
    for (input, more) in
        [("model.obj", None), (engine.to_str().unwrap(), None), ("model.obj", Some("--compress"))]
    {
        for threads in ["1", "2", "16"] {
            let output = format!("{threads}.clps");
            let bake = ["bake", input, "-o", &output, "--threads", threads];
            place.run(&bake.into_iter().chain(more).collect::<Vec<_>>()).succeeded();
        }
        assert!(place.read("1.clps") == place.read("2.clps"), "{input}: two threads");
        assert!(place.read("1.clps") == place.read("16.clps"), "{input}: sixteen threads");
    }
}

#[test]
fn bandwidth_tells_the_adapter_and_its_rates() {
    if !has_gpu("cli::reports::bandwidth_tells_the_adapter_and_its_rates") {
        return;
    }
    let place = Workplace::new();
    let text = place.run(&["bandwidth"]).succeeded().out;
    for line in ["adapter ", "limits ", "copy ", "upload ", "write ", "measured "] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{line}: {text}");
    }
    let report: Value = serde_json::from_str(&place.run(&["bandwidth", "--json"]).succeeded().out).unwrap();
    let rates = &report["bytes_per_second"];
    for kind in ["copy", "upload", "write"] {
        let rate = |which: &str| rates[format!("{kind}_{which}")].as_f64().unwrap();
        assert!(rate("best") >= rate("median") && rate("median") > 1e6, "{kind}: {report:#}");
    }
    assert!(!report["adapter"].as_str().unwrap().is_empty());
}
