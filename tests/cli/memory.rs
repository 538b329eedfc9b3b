//! `bake --memory` on models that are larger than the memory they may take.

use serde_json::json;

use crate::models::glb_of;
use crate::workplace::Workplace;

/// Pages of a mapped file, which the system may take back at any time and which are given back every 16 MiB, count beside
/// the cap.
const MAPPED_BYTES: u64 = 20 << 20;

/// Bakes a model that is larger than the cap, with and without one.
#[track_caller]
fn bakes_the_same_within_a_cap(place: &Workplace, name: &str, cap_bytes: u64, mapped: bool) {
    let file_bytes = place.path(name).metadata().unwrap().len();
    assert!(file_bytes > cap_bytes, "{name} is no larger than the cap");
    let bake = |output: &str, more: &[&str]| {
        let arguments = ["bake", name, "-o", output, "--json", "--threads", "2"];
        let report = place.run(&[&arguments, more].concat()).succeeded().json();
        (place.read(output), report["peak_rss_bytes"].as_u64())
    };
    let (capped, peak) = bake("capped.clps", &["--memory", &cap_bytes.to_string()]);
    let (free, _) = bake("free.clps", &[]);
    assert!(capped == free, "{name}: other bytes under a cap");
    if cfg!(target_os = "linux") {
        let peak = peak.unwrap();
        let most = cap_bytes + if mapped { MAPPED_BYTES } else { 0 };
        assert!(peak <= most, "{name}: {peak} of {most} bytes");
    }
}

#[test]
fn an_obj_larger_than_the_memory_bakes_to_the_same_bytes() {
    let place = Workplace::new();
    place.run(&["synth", "-o", "model.obj", "--triangles", "500k", "--parts", "4k"]).succeeded();
    bakes_the_same_within_a_cap(&place, "model.obj", 48 << 20, false);
}

/// Cells of a part's grid along one side.
const SIDE: usize = 32;
/// Bytes from one vertex to the next: its position, and attributes that nobody reads.
const STRIDE: usize = 192;
const PARTS: usize = 64;

/// The corners of all triangles of a part.
fn corners(part: usize) -> Vec<[f32; 3]> {
    let corner = |x: usize, y: usize| [x as f32, y as f32, ((x * y + part) % 7) as f32];
    let cell = |x, y| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [a, b, c, a, c, d]
    };
    (0..SIDE * SIDE).flat_map(|i| cell(i % SIDE, i / SIDE)).collect()
}

/// A GLB file that is large for its triangles, so that the test takes seconds.
fn sparse_glb() -> Vec<u8> {
    let count = corners(0).len();
    let vertices = (0..PARTS).flat_map(corners);
    let binary: Vec<u8> = vertices
        .flat_map(|position| {
            let mut vertex = [0; STRIDE];
            vertex[..12].copy_from_slice(bytemuck::bytes_of(&position));
            vertex
        })
        .collect();
    let each = |row: &dyn Fn(usize) -> serde_json::Value| (0..PARTS).map(row).collect::<Vec<_>>();
    let bytes = count * STRIDE;
    let side = SIDE as f32;
    let root = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": (0..PARTS).collect::<Vec<_>>()}],
        "nodes": each(&|part| json!({"mesh": part, "translation": [0, 0, 10 * part]})),
        "meshes": each(&|part| json!({"primitives": [{"attributes": {"POSITION": part}}]})),
        "accessors": each(&|part| json!({
            "bufferView": part, "componentType": 5126, "count": count, "type": "VEC3",
            "min": [0.0, 0.0, 0.0], "max": [side, side, 6.0]
        })),
        "bufferViews": each(&|part| json!({
            "buffer": 0, "byteOffset": part * bytes, "byteLength": bytes, "byteStride": STRIDE
        })),
        "buffers": [{"byteLength": binary.len()}],
    });
    glb_of(&root, &binary)
}

#[test]
fn a_glb_larger_than_the_memory_bakes_to_the_same_bytes() {
    let place = Workplace::new();
    place.write("model.glb", sparse_glb());
    bakes_the_same_within_a_cap(&place, "model.glb", 48 << 20, true);
}
