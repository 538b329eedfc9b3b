//! `compare`: what it measures, what it refuses, and what it leaves when it is stopped.

use crate::common::{height_field, patched_box, sphere};
use crate::models::{TRIANGLE, obj};
use crate::workplace::Workplace;
use collapsar::import::SourceMesh;

/// A sphere, a box and a field, baked.
fn baked() -> Workplace {
    let place = Workplace::new();
    place.write("model.obj", obj(&[sphere(24, 48), patched_box(5), height_field(30)]));
    place.bake("model.obj", "model.clps");
    place
}

fn compare<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["compare", "model.obj", "model.clps", "--samples", "20k"], more].concat()
}

#[test]
fn errors_grow_as_triangles_go_and_full_detail_has_none() {
    let json = baked().run(&compare(&["--json", "--ratios", "1,0.5,0.1"])).succeeded().json();
    let rows = json["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &json["parts"]), (3, &3.into()));
    for simplifier in ["ours", "meshoptimizer"] {
        let figure = |row: usize, name: &str| rows[row][simplifier][name].as_f64().unwrap();
        assert_eq!(rows[0][simplifier]["triangles"], json["triangles"]);
        // The diagonal of the sphere's box is 3.5, and its grid has steps of 1e-6.
        assert!(figure(0, "rms") < 1e-12 && figure(0, "max") < 1e-12, "{json}");
        assert!(figure(1, "rms") > 0.0 && figure(2, "rms") > 2.0 * figure(1, "rms"), "{json}");
        assert!(figure(2, "max") > figure(2, "rms") && figure(2, "rms") > figure(2, "mean"), "{json}");
        assert!(figure(2, "normal_degrees") > figure(1, "normal_degrees"), "{json}");
        // A sphere of radius 1 cannot be 0.1 away from itself at a tenth of 2,208 triangles.
        assert!(figure(2, "max") < 0.1, "{json}");
    }
    let quotient = rows[2]["rms_ratio"].as_f64().unwrap();
    let expected =
        rows[2]["ours"]["rms"].as_f64().unwrap() / rows[2]["meshoptimizer"]["rms"].as_f64().unwrap();
    assert!((quotient - expected).abs() < 1e-12);
    let counts =
        ["ours", "meshoptimizer"].map(|simplifier| rows[2][simplifier]["triangles"].as_f64().unwrap());
    assert!((counts[0] / counts[1] - 1.0).abs() < 0.05, "{counts:?}");
    assert!(rows[1]["stated_max"].as_f64().unwrap() > 0.0);
}

/// A ring of long thin triangles: a tube of three sides.
fn thin_ring(segments: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "ring".into(), ..SourceMesh::default() };
    let turn = std::f32::consts::TAU;
    for i in 0..segments {
        let (sin, cos) = (turn * i as f32 / segments as f32).sin_cos();
        for k in 0..3 {
            let (high, wide) = (turn * k as f32 / 3.0).sin_cos();
            let radius = 1.0 + 0.1 * wide;
            mesh.positions.push([radius * cos, radius * sin, 0.1 * high]);
        }
    }
    let at = |i: u32, k: u32| 3 * (i % segments) + k % 3;
    for (i, k) in (0..segments).flat_map(|i| (0..3).map(move |k| (i, k))) {
        let [a, b, c, d] = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// Octahedra in a row, each touching the next in a corner.
fn chain(count: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "chain".into(), ..SourceMesh::default() };
    for i in 0..count {
        let x = 2.0 * i as f32;
        // The left corner is the right one of the octahedron before.
        let left = if i == 0 { 0 } else { 5 * i };
        if i == 0 {
            mesh.positions.push([-1.0, 0.0, 0.0]);
        }
        let ring = mesh.positions.len() as u32;
        let around = [[x, 1.0, 0.0], [x, 0.0, 1.0], [x, -1.0, 0.0], [x, 0.0, -1.0], [x + 1.0, 0.0, 0.0]];
        mesh.positions.extend(around);
        for k in 0..4 {
            let [a, b] = [ring + k, ring + (k + 1) % 4];
            mesh.triangles.extend([[left, b, a], [a, b, ring + 4]]);
        }
    }
    mesh
}

#[test]
fn the_stated_error_is_near_the_measured_one_in_parents_of_cells_slivers_and_chains() {
    // The chain loses its depth first and then, from just below a half on, its ends, where the error leaps: between two
    // samples of it, the coarser one is stated.
    for (mesh, ratios) in
        [(height_field(280), "0.25,0.1"), (thin_ring(7000), "0.9,0.5"), (chain(40), "0.6,0.25")]
    {
        let place = Workplace::new();
        place.write("model.obj", obj(&[mesh]));
        place.bake("model.obj", "model.clps");
        let json =
            place.run(&compare(&["--json", "--no-meshoptimizer", "--ratios", ratios])).succeeded().json();
        for row in json["rows"].as_array().unwrap().iter().filter(|row| !row["stated_max"].is_null()) {
            let [stated, measured] = [&row["stated_max"], &row["ours"]["max"]].map(|v| v.as_f64().unwrap());
            // Less than a grid step of 1e-6 is rounding.
            assert!(stated < 4.0 * (measured + 1e-6), "{row}");
            assert!(measured < 1.5 * (stated + 1e-6), "{row}");
        }
    }
}

#[test]
fn the_table_names_both_and_without_meshoptimizer_one() {
    let place = baked();
    let both = place.run(&compare(&[])).succeeded().out;
    for word in ["3 parts", "50 %", "25 %", "10 %", "2 %", "collapsar", "meshoptimizer", "quotient"] {
        assert!(both.contains(word), "no {word} in {both}");
    }
    let alone = place.run(&compare(&["--no-meshoptimizer"])).succeeded().out;
    assert!(alone.contains("collapsar") && !alone.contains("meshoptimizer") && !alone.contains("quotient"));
    let json = place.run(&compare(&["--no-meshoptimizer", "--json"])).succeeded().json();
    assert!(json["rows"][0]["meshoptimizer"].is_null() && json["rows"][0]["rms_ratio"].is_null());
}

/// Of a flat grid everything goes for nothing, so the sphere beside it keeps what equal shares would take from it.
#[test]
fn a_model_is_dealt_by_what_is_missed_least() {
    let place = Workplace::new();
    let mut flat = height_field(30);
    flat.positions.iter_mut().for_each(|p| p[2] = 0.0);
    place.write("model.obj", obj(&[sphere(24, 48), flat]));
    place.bake("model.obj", "model.clps");
    let json = place.run(&compare(&["--json", "--ratios", "0.5,0.3"])).succeeded().json();
    for row in json["rows"].as_array().unwrap() {
        let of = |simplifier: &str, by: &str| {
            let mut rows = row["dealt"].as_array().unwrap().iter();
            rows.find(|dealt| dealt["simplifier"] == simplifier && dealt["dealt_by"] == by).unwrap()
        };
        let rms = |simplifier: &str, by: &str| of(simplifier, by)["rms"].as_f64().unwrap();
        assert!(rms("collapsar", "cost") < 0.6 * rms("collapsar", "share"), "{row}");
        assert!(rms("meshoptimizer", "error") < 0.6 * rms("meshoptimizer", "share"), "{row}");
        let wanted = row["ratio"].as_f64().unwrap() * json["triangles"].as_f64().unwrap();
        for (simplifier, by) in [("collapsar", "cost"), ("meshoptimizer", "error"), ("meshoptimizer", "cost")]
        {
            let triangles = of(simplifier, by)["triangles"].as_f64().unwrap();
            assert!((triangles / wanted - 1.0).abs() < 0.02, "{simplifier} by {by}: {row}");
        }
        let least = rms("meshoptimizer", "error").min(rms("meshoptimizer", "share"));
        let ratio = row["dealt_rms_ratio"].as_f64().unwrap();
        assert!((ratio - rms("collapsar", "cost") / least).abs() < 1e-12, "{row}");
    }
    let table = place.run(&compare(&[])).succeeded().out;
    for word in ["dealt over the parts", "its error", "our cost", "over the same counts"] {
        assert!(table.contains(word), "no {word} in {table}");
    }
    place.write("model.obj", obj(&[sphere(24, 48)]));
    place.bake("model.obj", "model.clps");
    let alone = place.run(&compare(&[])).succeeded().out;
    assert!(!alone.contains("dealt"), "of one part nothing is dealt: {alone}");
}

#[test]
fn csv_has_a_line_for_every_part_and_ratio() {
    let text = baked().run(&compare(&["--csv", "--ratios", "0.5,0.2"])).succeeded().out;
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 1 + 2 * 3);
    let columns = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == columns), "{text}");
    assert!(lines[1].starts_with("0,\"sphere0\",1,"), "{text}");
}

#[test]
fn cells_of_one_part_are_measured_together() {
    let place = Workplace::new();
    place.write("model.obj", obj(&[height_field(260)]));
    place.bake("model.obj", "model.clps");
    let arguments = compare(&["--csv", "--ratios", "0.1", "--no-meshoptimizer"]);
    let text = place.run(&arguments).succeeded().out;
    let fields: Vec<&str> = text.lines().nth(1).unwrap().split(',').collect();
    // Two leaf cells and their parent.
    assert_eq!(fields[2..4], ["3", "135200"], "{text}");
    let triangles: f64 = fields[6].parse().unwrap();
    assert!((triangles / 13_520.0 - 1.0).abs() < 0.1, "{text}");
    let max: f64 = fields[9].parse().unwrap();
    assert!(max > 0.0 && max < 0.02, "the bumps are 0.2 high: {text}");
}

#[test]
fn a_plot_is_written_in_both_formats() {
    let place = baked();
    let plain = place.run(&compare(&["--ratios", "0.3"])).succeeded().out;
    for (name, start) in [("plot.svg", b"<svg" as &[u8]), ("plot.PNG", b"\x89PNG")] {
        let outcome = place.run(&compare(&["--ratios", "0.3", "--plot", name])).succeeded();
        assert_eq!(outcome.out, plain, "the counts of the plot are not in the table");
        assert!(place.read(name).starts_with(start));
    }
}

#[test]
fn a_plot_that_cannot_be_written_is_refused_at_once() {
    let place = baked();
    place.fails(&compare(&["--plot", "plot.jpg"]), &["must end in .svg or .png", "plot.jpg"]);
    place.fails(&compare(&["--plot", "nowhere/plot.svg"]), &["its folder does not exist", "nowhere"]);
    // What loses a triangle is gone, and what does not has no error, which has no logarithm.
    place.write("model.obj", TRIANGLE);
    place.bake("model.obj", "model.clps");
    place.fails(&compare(&["--plot", "plot.svg", "--ratios", "1"]), &["nothing to plot", "plot.svg"]);
}

#[test]
fn another_model_is_refused_with_the_difference() {
    let place = baked();
    let refused = |model: String, words: &[&str]| {
        place.write("model.obj", model);
        place.fails(
            &compare(&[]),
            &[&["is not the one that the container was baked of", "model.obj"], words].concat(),
        );
    };
    refused(obj(&[sphere(24, 48)]), &["1 parts, the container 3"]);
    refused(obj(&[sphere(24, 48), sphere(24, 48), height_field(30)]), &["\"sphere1\" is called \"box1\""]);
    refused(obj(&[sphere(24, 40), patched_box(5), height_field(30)]), &["\"sphere0\""]);
    let mut longer = patched_box(5);
    longer.positions.iter_mut().for_each(|p| p[0] *= 1.5);
    refused(obj(&[sphere(24, 48), longer, height_field(30)]), &["\"box1\"", "box"]);
}

#[test]
fn files_that_are_none_are_refused() {
    let place = baked();
    place.fails(&["compare", "none.obj", "model.clps"], &["none.obj"]);
    place.fails(&["compare", "model.obj", "none.clps"], &["none.clps"]);
    place.fails(&["compare", "model.obj", "model.obj"], &["not a", "model.obj"]);
    place.write("bad.obj", TRIANGLE.replace("f 1 2 3", "f 1 2 99"));
    place.fails(&["compare", "bad.obj", "model.clps"], &["bad.obj"]);
    let mut bytes = place.read("model.clps");
    // In the middle is the payload, and not between two chunks: most of it belongs to one.
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    place.write("bad.clps", bytes);
    place.fails(&["compare", "model.obj", "bad.clps"], &["checksum", "bad.clps"]);
}

#[test]
fn arguments_are_checked() {
    let place = baked();
    place.refuses(&compare(&["--ratios", "0.5,2"]), &["above 0 and at most 1"]);
    place.refuses(&compare(&["--ratios", ""]), &["above 0 and at most 1"]);
    place.refuses(&compare(&["--json", "--csv"]), &["cannot be used with"]);
    place.fails(&compare(&["--least-triangles", "1M"]), &["no part has 1000000 triangles", "model.clps"]);
    let text =
        place.run(&compare(&["--csv", "--ratios", "0.5", "--least-triangles", "1000"])).succeeded().out;
    let parts: Vec<&str> = text.lines().skip(1).map(|line| &line[..1]).collect();
    assert_eq!(parts, ["0", "2"], "the box has 300 triangles: {text}");
    let many = ["compare", "model.obj", "model.clps", "--samples", "4G"];
    place.refuses(&many, &["at most 10000000"]);
}
