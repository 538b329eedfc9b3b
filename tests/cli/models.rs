//! Small models as text and bytes, good ones and bad ones.

use std::fmt::Write;

use collapsar::import::SourceMesh;
use serde_json::json;

/// One good triangle.
pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A square of two triangles; what a test adds comes after vertex 4.
pub const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

/// Meshes as an OBJ file of one object each, without normals.
pub fn obj(meshes: &[SourceMesh]) -> String {
    let (mut text, mut base) = (String::new(), 1);
    for (number, mesh) in meshes.iter().enumerate() {
        writeln!(text, "o {}{number}", mesh.name).unwrap();
        for [x, y, z] in &mesh.positions {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|v| v + base)) {
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
        base += mesh.positions.len() as u32;
    }
    text
}

/// One mesh, placed once, as a GLB file; `mode` as in glTF: 0 points, 4 triangles.
pub fn glb(positions: &[[f32; 3]], indices: &[u32], mode: u32) -> Vec<u8> {
    placed_glb(positions, indices, mode, 1)
}

/// One mesh, placed several times at the same place.
pub fn placed_glb(positions: &[[f32; 3]], indices: &[u32], mode: u32, placements: usize) -> Vec<u8> {
    let mut binary: Vec<u8> = bytemuck::cast_slice(positions).to_vec();
    let split = binary.len();
    binary.extend_from_slice(bytemuck::cast_slice(indices));
    let root = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": (0..placements).collect::<Vec<_>>()}],
        "nodes": vec![json!({"mesh": 0}); placements],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": positions.len(), "type": "VEC3",
             "min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0]},
            {"bufferView": 1, "componentType": 5125, "count": indices.len(), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": binary.len() - split},
        ],
        "buffers": [{"byteLength": binary.len()}],
    });
    glb_of(&root, &binary)
}

/// A GLB file of a text and its buffer, whose length is a multiple of four.
pub fn glb_of(root: &serde_json::Value, binary: &[u8]) -> Vec<u8> {
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |bytes: usize| (bytes as u32).to_le_bytes();
    [
        b"glTF" as &[u8],
        &2u32.to_le_bytes(),
        &length(12 + 8 + json.len() + 8 + binary.len()),
        &length(json.len()),
        b"JSON",
        &json,
        &length(binary.len()),
        b"BIN\0",
        binary,
    ]
    .concat()
}

/// Positions and indices of a square of two triangles.
pub const SQUARE_POSITIONS: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
pub const SQUARE_INDICES: [u32; 6] = [0, 1, 2, 0, 2, 3];
