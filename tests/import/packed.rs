//! Packed files: the same model as from the plain ones, or an error that says why.

use std::io::Write;

use super::made::{Ends, LIBRARY, binary_stl, made, obj, plain_glb, ply, text_stl};
use super::*;

fn zstd(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 3).unwrap()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn assert_same(a: &Model, b: &Model, what: &str) {
    assert_eq!((&a.meshes, &a.instances, &a.nodes), (&b.meshes, &b.instances, &b.nodes), "{what}");
    assert_eq!((&a.materials, &a.notes), (&b.materials, &b.notes), "{what}");
}

#[test]
fn every_format_in_every_packing_is_the_same_model() {
    let made = made();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lib.mtl"), LIBRARY).unwrap();
    let gltf =
        String::from_utf8(plain_glb(&made)).map_or_else(|error| error.into_bytes(), String::into_bytes);
    for (name, content) in [
        ("m.obj", obj(&made, "lib.mtl").into_bytes()),
        ("m.glb", gltf),
        ("text.ply", ply(&made, Ends::Text, "float", "uchar", "int")),
        ("big.ply", ply(&made, Ends::Big, "double", "uchar", "int")),
        ("text.stl", text_stl(&made, " x").into_bytes()),
        ("binary.stl", binary_stl(&made, "solid")),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, &content).unwrap();
        let plain = read(&path).unwrap();
        let (half, rest) = content.split_at(content.len() / 2);
        for (extension, packed) in [
            ("zst", zstd(&content)),
            ("gz", gzip(&content)),
            ("ZST", [zstd(half), zstd(rest)].concat()),
            ("Gz", [gzip(half), gzip(rest)].concat()),
        ] {
            let path = folder.path().join(format!("{name}.{extension}"));
            fs::write(&path, packed).unwrap();
            assert_same(&plain, &read(&path).unwrap(), &format!("{name}.{extension}"));
        }
    }
}

#[test]
fn what_a_packed_file_refers_to_is_found_beside_it() {
    let made = made();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lib.mtl"), LIBRARY).unwrap();
    let path = folder.path().join("m.obj.gz");
    fs::write(&path, gzip(obj(&made, "lib.mtl").as_bytes())).unwrap();
    let model = read(&path).unwrap();
    assert!(model.notes.is_empty(), "{:?}", model.notes);
    assert!(model.materials.iter().any(|material| material.name == "red"));
    assert_eq!(model.meshes.len(), 2);

    fs::write(folder.path().join("t.bin"), made_here::triangle_bytes()).unwrap();
    let path = folder.path().join("m.gltf.zst");
    fs::write(&path, zstd(made_here::gltf_triangle("t.bin", "").as_bytes())).unwrap();
    assert_eq!(triangles(&read(&path).unwrap()), (1, 1));
}

#[test]
fn several_packed_files_are_named_by_their_stems() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["one.stl.zst", "two.stl"].map(|name| folder.path().join(name));
    fs::write(&paths[0], zstd(text_stl(&made(), "").as_bytes())).unwrap();
    fs::write(&paths[1], text_stl(&made(), "")).unwrap();
    let model = import::read(&paths).unwrap();
    check(&model);
    let names: Vec<_> = model.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["one", "one", "two", "two"]);
    assert_eq!(model.meshes.iter().map(|mesh| mesh.body).collect::<Vec<_>>(), [0, 1]);
}

#[test]
fn packed_files_that_are_cut_short_or_none_are_errors() {
    let content = text_stl(&made(), " x");
    for (name, packed) in [("a.stl.zst", zstd(content.as_bytes())), ("a.stl.gz", gzip(content.as_bytes()))] {
        for length in 1..packed.len() {
            let message = read_text(name, &packed[..length]).unwrap_err();
            assert!(message.starts_with("cannot unpack the file: the "), "{name} {length}: {message}");
        }
        let message = read_text(name, content.as_bytes()).unwrap_err();
        assert!(message.contains("damaged, cut short or none"), "{name}: {message}");
    }
}

#[test]
fn damaged_packed_files_never_panic() {
    let content = obj(&made(), "none.mtl");
    for (name, packed) in [("a.obj.zst", zstd(content.as_bytes())), ("a.obj.gz", gzip(content.as_bytes()))] {
        for place in 0..packed.len() {
            let mut damaged = packed.clone();
            damaged[place] ^= 0x41;
            let _ = read_text(name, damaged);
        }
    }
}

#[test]
fn bombs_are_refused() {
    const MIB: usize = 1 << 20;
    let folder = tempfile::tempdir().unwrap();
    let zeros = vec![0; MIB];
    let mut encoder = zstd::Encoder::new(Vec::new(), 1).unwrap();
    (0..300).for_each(|_| encoder.write_all(&zeros).unwrap());
    let packed = encoder.finish().unwrap();
    assert!(packed.len() < 64 << 10, "{} bytes stand for 300 MiB", packed.len());
    let path = folder.path().join("a.glb.zst");
    fs::write(&path, &packed).unwrap();
    let message = read(&path).unwrap_err();
    assert!(message.contains("it unpacks to more than 256 MiB, more than any model so small"), "{message}");
}

#[test]
fn windows_beyond_the_limit_are_refused() {
    let pack = |log: u32| {
        let mut encoder = zstd::Encoder::new(Vec::new(), 1).unwrap();
        encoder.window_log(log).unwrap();
        encoder.write_all(text_stl(&made(), "").as_bytes()).unwrap();
        encoder.finish().unwrap()
    };
    assert!(read_text("a.stl.zst", pack(27)).is_ok());
    let message = read_text("a.stl.zst", pack(28)).unwrap_err();
    assert!(message.contains("requires too much memory"), "{message}");
}
