//! glTF with views compressed by meshoptimizer, and quantised attributes.

use collapsar::import::SourceMesh;
use meshopt::EncodeExpMode;
use serde_json::{Value, json};

use super::made::{corners_of, document, glb};
use super::*;

/// A sheet of 20 x 30 quads with normals and colours that the filters keep.
struct Sheet {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 4]>,
    colours: Vec<[f32; 4]>,
    indices: Vec<u32>,
}

fn sheet() -> Sheet {
    let (mut positions, mut normals, mut colours, mut indices) = (vec![], vec![], vec![], vec![]);
    for v in 0..21 * 31_u32 {
        let (i, j) = ((v % 21) as f32, (v / 21) as f32);
        positions.push([i * 16.0, j * 16.0, ((i * 0.5).sin() * 64.0).round() + 64.0]);
        let (sin, cos) = (i * 0.1).sin_cos();
        normals.push([sin, 0.0, cos, 0.0]);
        colours.push([i / 20.0, j / 30.0, 0.5, 1.0]);
        if v % 21 < 20 && v / 21 < 30 {
            indices.extend([v, v + 1, v + 22, v, v + 22, v + 21]);
        }
    }
    Sheet { positions, normals, colours, indices }
}

/// A compressed view in the making.
struct View {
    mode: &'static str,
    filter: &'static str,
    stride: usize,
    count: usize,
    bytes: Vec<u8>,
}

fn attributes<T: Copy>(filter: &'static str, vertices: &[T]) -> View {
    let bytes = meshopt::encode_vertex_buffer(vertices).unwrap();
    View { mode: "ATTRIBUTES", filter, stride: size_of::<T>(), count: vertices.len(), bytes }
}

fn indices(mode: &'static str, stride: usize, indices: &[u32]) -> View {
    let encode =
        if mode == "TRIANGLES" { meshopt::encode_index_buffer } else { meshopt::encode_index_sequence };
    View { mode, filter: "NONE", stride, count: indices.len(), bytes: encode(indices, 21 * 31).unwrap() }
}

/// The views as a GLB: indices, positions and more, each of which is the accessor of its number.
fn compressed(extension: &str, views: &[View], accessors: &[Value], names: &[&str]) -> Vec<u8> {
    let mut binary = Vec::new();
    let mut fallback = 0;
    let described: Vec<Value> = views
        .iter()
        .map(|view| {
            binary.resize(binary.len().next_multiple_of(4), 0u8);
            let start = binary.len();
            binary.extend_from_slice(&view.bytes);
            let length = view.stride * view.count;
            let mut described = json!({
                "buffer": 1, "byteOffset": fallback, "byteLength": length,
                "extensions": {extension: {
                    "buffer": 0, "byteOffset": start, "byteLength": view.bytes.len(), "byteStride": view.stride,
                    "count": view.count, "mode": view.mode, "filter": view.filter,
                }},
            });
            if view.mode == "ATTRIBUTES" {
                described["byteStride"] = view.stride.into();
            }
            fallback += length;
            described
        })
        .collect();
    let attributes: Value =
        names.iter().enumerate().map(|(n, &name)| (name.to_owned(), json!(n + 1))).collect();
    let buffers = json!([{"byteLength": binary.len()}, {"byteLength": fallback, "extensions": {extension: {"fallback": true}}}]);
    let mut document = document(&attributes, &json!(accessors), &json!(described), &buffers);
    document["extensionsUsed"] = json!([extension, "KHR_mesh_quantization"]);
    document["extensionsRequired"] = document["extensionsUsed"].clone();
    glb(&document, &binary)
}

fn accessor(view: usize, component: u32, normalized: bool, count: usize, shape: &str) -> Value {
    json!({"bufferView": view, "componentType": component, "normalized": normalized, "count": count, "type": shape})
}

const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02)
}

/// That a mesh is the sheet, its attributes but for rounding.
#[track_caller]
fn assert_is_sheet(mesh: &SourceMesh, sheet: &Sheet) {
    let corners = corners_of(mesh);
    assert_eq!(corners.len(), sheet.indices.len());
    let mut turns: Vec<_> = corners.as_chunks::<3>().0.to_vec();
    let mut expected: Vec<_> = sheet.indices.as_chunks::<3>().0.to_vec();
    // The codec turns triangles so that another corner is the first.
    for triangle in &mut turns {
        while triangle.iter().any(|corner| key(corner.0) < key(triangle[0].0)) {
            triangle.rotate_left(1);
        }
    }
    for triangle in &mut expected {
        while triangle
            .iter()
            .any(|&v| key(sheet.positions[v as usize]) < key(sheet.positions[triangle[0] as usize]))
        {
            triangle.rotate_left(1);
        }
    }
    for (corner, &v) in turns.iter().flatten().zip(expected.iter().flatten()) {
        let v = v as usize;
        let ([nx, ny, nz, _], [r, g, b, _]) = (sheet.normals[v], sheet.colours[v]);
        assert_eq!(corner.0, sheet.positions[v]);
        if !mesh.normals.is_empty() {
            assert!(close(corner.1, [nx, ny, nz]), "{:?} {nx} {ny} {nz}", corner.1);
        }
        if !mesh.colours.is_empty() {
            let linear = [r, g, b]
                .map(|c| if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 });
            let [r, g, b, a] = corner.2;
            assert!(
                close([r, g, b].map(|c| f32::from(c) / 255.0), linear) || r < 40 || g < 40,
                "{corner:?} {linear:?}"
            );
            assert_eq!(a, 255);
        }
    }
}

fn key(position: [f32; 3]) -> [u32; 3] {
    position.map(|c| c as u32)
}

/// One file for every mode, filter and type: its bytes, and whether it has normals and colours.
fn files(sheet: &Sheet) -> Vec<(Vec<u8>, bool, bool)> {
    let count = sheet.positions.len();
    let whole: Vec<[u16; 4]> =
        sheet.positions.iter().map(|p| [p[0] as u16, p[1] as u16, p[2] as u16, 0]).collect();
    let corners = sheet.indices.len();
    let oct_8 = meshopt::encode_filter_oct::<i8>(&sheet.normals, 8);
    let oct_16 = meshopt::encode_filter_oct::<i16>(&sheet.normals, 12);
    let exp = meshopt::encode_filter_exp(&sheet.positions, 24, EncodeExpMode::SharedVector);
    let colour_8 = meshopt::encode_filter_color::<u8>(&sheet.colours, 8);
    let colour_16 = meshopt::encode_filter_color::<u16>(&sheet.colours, 16);
    vec![
        (
            compressed(
                "EXT_meshopt_compression",
                &[
                    indices("TRIANGLES", 2, &sheet.indices),
                    attributes("NONE", &whole),
                    attributes("OCTAHEDRAL", &oct_8),
                ],
                &[
                    accessor(0, UNSIGNED_SHORT, false, corners, "SCALAR"),
                    accessor(1, UNSIGNED_SHORT, false, count, "VEC3"),
                    accessor(2, BYTE, true, count, "VEC3"),
                ],
                &["POSITION", "NORMAL"],
            ),
            true,
            false,
        ),
        (
            compressed(
                "KHR_meshopt_compression",
                &[
                    indices("INDICES", 4, &sheet.indices),
                    attributes("EXPONENTIAL", &exp),
                    attributes("OCTAHEDRAL", &oct_16),
                    attributes("COLOR", &colour_8),
                ],
                &[
                    accessor(0, UNSIGNED_INT, false, corners, "SCALAR"),
                    accessor(1, FLOAT, false, count, "VEC3"),
                    accessor(2, SHORT, true, count, "VEC3"),
                    accessor(3, UNSIGNED_BYTE, true, count, "VEC4"),
                ],
                &["POSITION", "NORMAL", "COLOR_0"],
            ),
            true,
            true,
        ),
        (
            compressed(
                "KHR_meshopt_compression",
                &[
                    indices("INDICES", 2, &sheet.indices),
                    attributes("NONE", &sheet.positions),
                    attributes("COLOR", &colour_16),
                ],
                &[
                    accessor(0, UNSIGNED_SHORT, false, corners, "SCALAR"),
                    accessor(1, FLOAT, false, count, "VEC3"),
                    accessor(2, UNSIGNED_SHORT, true, count, "VEC4"),
                ],
                &["POSITION", "COLOR_0"],
            ),
            false,
            true,
        ),
        (
            compressed(
                "EXT_meshopt_compression",
                &[indices("TRIANGLES", 4, &sheet.indices), attributes("NONE", &sheet.positions)],
                &[
                    accessor(0, UNSIGNED_INT, false, corners, "SCALAR"),
                    accessor(1, FLOAT, false, count, "VEC3"),
                ],
                &["POSITION"],
            ),
            false,
            false,
        ),
    ]
}

#[test]
fn every_mode_and_filter_decodes() {
    let sheet = sheet();
    for (number, (bytes, normals, colours)) in files(&sheet).into_iter().enumerate() {
        let model = read_text("a.glb", bytes).unwrap_or_else(|error| panic!("{number}: {error}"));
        let mesh = &model.meshes[0];
        assert_eq!((!mesh.normals.is_empty(), !mesh.colours.is_empty()), (normals, colours), "{number}");
        assert_is_sheet(mesh, &sheet);
        assert!(model.notes.is_empty(), "{:?}", model.notes);
    }
}

/// The JSON of a GLB changed, the rest the same.
fn with_json(whole: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&whole[20..20 + length]).unwrap();
    change(&mut json);
    glb(&json, &whole[28 + length..])
}

/// The message for a file whose extension of view `view` has another value.
fn why(view: usize, key: &str, value: Value) -> String {
    let whole = files(&sheet()).swap_remove(0).0;
    let changed = with_json(&whole, |json| {
        json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value;
    });
    read_text("a.glb", changed).unwrap_err()
}

#[test]
fn compressed_views_that_lie_are_named() {
    for (view, key, value, words) in [
        (
            0,
            "count",
            json!(3_000_000_000_u64),
            "buffer view 0 promises 3000000000 compressed elements, more than",
        ),
        (1, "count", json!(u64::MAX / 8), "buffer view 1 promises"),
        (0, "count", json!(100), "buffer view 0 has triangles of fewer than three corners"),
        (0, "count", json!(3), "buffer view 0 has compressed data that are damaged"),
        (1, "count", json!(100), "buffer view 1 has compressed data that are damaged"),
        (0, "byteLength", json!(1_u64 << 40), "buffer view 0 has compressed data that lie beyond the end"),
        (0, "byteOffset", json!(u64::MAX), "buffer view 0 has compressed data that lie beyond the end"),
        (0, "buffer", json!(7), "buffer view 0 has compressed data that lie beyond the end"),
        (1, "byteLength", json!(9), "buffer view 1 has compressed data that are damaged"),
        (1, "byteStride", json!(0), "buffer view 1 has vertices of 0 bytes"),
        (1, "byteStride", json!(260), "buffer view 1 has vertices of 260 bytes"),
        (1, "byteStride", json!(7), "buffer view 1 has vertices of 7 bytes"),
        (0, "byteStride", json!(3), "mode \"TRIANGLES\" with elements of 3 bytes"),
        (0, "mode", json!("MAGIC"), "mode \"MAGIC\" with elements of 2 bytes"),
        (1, "filter", json!("MAGIC"), "buffer view 1 is filtered by \"MAGIC\""),
        (
            2,
            "filter",
            json!("QUATERNION"),
            "buffer view 2 is filtered by \"QUATERNION\" with elements of 4 bytes",
        ),
        (0, "count", json!("many"), "the JSON of EXT_meshopt_compression is malformed"),
    ] {
        let message = why(view, key, value);
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn damaged_compressed_data_never_panic() {
    let sheet = sheet();
    for (whole, ..) in files(&sheet) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let mut refused = 0;
        for place in (20..whole.len()).step_by(7) {
            let mut damaged = whole.clone();
            damaged[place] ^= 0x55;
            fs::write(&path, damaged).unwrap();
            refused += usize::from(read(&path).is_err());
        }
        assert!(refused > 10, "{refused}");
    }
}
