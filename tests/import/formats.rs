//! PLY and STL in every encoding, and OBJ against another reader.

use super::made::{Ends, Ply, binary_stl, corners_of, made, ply, text_stl};
use super::*;

const ENDS: [Ends; 3] = [Ends::Text, Ends::Little, Ends::Big];

#[test]
fn ply_of_every_encoding_and_type_is_the_same_mesh() {
    let made = made();
    for ends in ENDS {
        for (position, colour, index) in [
            ("float", "uchar", "int"),
            ("double", "float", "uint"),
            ("float32", "ushort", "uchar"),
            ("float", "double", "short"),
        ] {
            let model = read_text("a b.ply", ply(&made, ends, position, colour, index)).unwrap();
            let what = format!("{ends:?} {position} {colour} {index}");
            assert_eq!(corners_of(&model.meshes[0]), made.corners(), "{what}");
            assert_eq!(model.meshes[0].positions.len(), 9, "{what}");
            assert_eq!((model.meshes[0].name.as_str(), model.nodes[0].name.as_str()), ("a b", "a b"));
            assert!(model.notes.is_empty(), "{:?}", model.notes);
        }
    }
}

#[test]
fn every_prefix_of_a_ply_file_is_an_error() {
    let made = made();
    for ends in ENDS {
        let whole = ply(&made, ends, "float", "uchar", "int");
        // The last number of text may be cut and still be one.
        let needed = whole.len() - if ends == Ends::Text { 5 } else { 1 };
        for length in 1..=needed {
            let message = read_text("a.ply", &whole[..length]).unwrap_err();
            let words = ["before all that its header promises", "this is no", "is not a number"];
            assert!(words.iter().any(|words| message.contains(words)), "{ends:?} {length}: {message}");
        }
    }
}

#[test]
fn damaged_ply_files_never_panic() {
    for ends in ENDS {
        let whole = ply(&made(), ends, "float", "uchar", "int");
        for place in 0..whole.len() {
            for byte in [b'9', b'-', b' ', 0xff] {
                let mut damaged = whole.clone();
                damaged[place] = byte;
                let _ = read_text("a.ply", damaged);
            }
        }
    }
}

/// A PLY text with three vertices at (0 0 0), (1 0 0), (0 1 0) and the given faces.
fn faces(count: u64, rows: &str) -> String {
    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    format!(
        "ply\nformat ascii 1.0\n{header}element face {count}\nproperty list uchar int vertex_index\nend_header\n\
        0 0 0\n1 .0 0.\n0 1 0\n{rows}"
    )
}

#[test]
fn ply_faces_with_bad_corners_are_skipped_and_noted() {
    let model = read_text("a.ply", faces(5, "3 0 1 2\n3 0 1 3\n3 -1 0 1\n2 0 1\n4 0 1 1 0\n")).unwrap();
    assert_eq!(triangles(&model), (1, 1));
    assert_eq!(
        model.notes,
        [
            "2 faces skipped that name a vertex that is not there (first: line 14)",
            "2 faces skipped that have fewer than three different vertices (first: line 16)"
        ]
    );
    let nan = faces(1, "3 0 1 2\n").replace("1 .0 0.", "nan 0 0");
    assert!(read_text("a.ply", nan).unwrap_err().contains("1 triangles skipped that touch a position"));
}

#[test]
fn ply_rows_may_take_several_lines_but_no_more_than_theirs() {
    assert_eq!(triangles(&read_text("a.ply", faces(1, "\n3 0\n1\n\n2")).unwrap()), (1, 1));
    let message = read_text("a.ply", faces(2, "3 0 1 2 9\n3 0 1 2\n")).unwrap_err();
    assert!(message.starts_with("line 13: \"9\" is more than the header says"), "{message}");
    let message = read_text("a.ply", faces(1, "3 0 1 x\n")).unwrap_err();
    assert!(message.starts_with("line 13: \"x\" is not a number"), "{message}");
    for count in ["-3", "2.5"] {
        let message = read_text("a.ply", faces(1, &format!("{count} 0 1 2\n"))).unwrap_err();
        assert!(message.starts_with(&format!("line 13: a list of {count} items")), "{message}");
    }
}

#[test]
fn ply_counts_are_lies_until_the_data_are_there() {
    for ends in ENDS {
        let header = "element nothing 18000000000000000000\nelement vertex 4000000000\nproperty float x\n\
            property float y\nproperty float z\nelement face 4000000000\nproperty list uint int vertex_indices\n";
        let mut file = Ply::new(ends, header);
        (0..3).for_each(|_| file.put("float", 1.0));
        let message = read_text("a.ply", file.finish()).unwrap_err();
        assert!(message.contains("before all that its header promises"), "{message}");
    }
    let mut file = Ply::new(
        Ends::Big,
        "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uint int vertex_indices\n",
    );
    (0..3).for_each(|_| file.put("float", 1.0));
    file.put("uint", f64::from(u32::MAX));
    let message = read_text("a.ply", file.finish()).unwrap_err();
    assert!(message.contains("the file ends after byte"), "{message}");
}

#[test]
fn ply_without_faces_or_vertices_or_axes_says_so() {
    let swap =
        |from: &str, to: &str| read_text("a.ply", faces(1, "3 0 1 2\n").replace(from, to)).unwrap_err();
    assert!(swap("element face", "element edge").contains("no element \"face\""));
    assert!(swap("element vertex", "element point").contains("no element \"vertex\""));
    assert!(swap("property float z", "property float w").contains("lack x, y or z"));
    assert!(swap("uchar int vertex_index", "uchar int corners").contains("no list vertex_indices"));
    assert!(swap("uchar int vertex_index", "uchar float vertex_index").contains("not whole numbers"));
    let reversed = "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\n\
        element vertex 1\nproperty float x\nend_header\n";
    assert!(read_text("a.ply", reversed).unwrap_err().contains("faces come before the vertices"));
}

#[test]
fn ply_strips_keep_one_orientation() {
    let strips = faces(1, "9 0 1 2 -1 2 1 0 0 1\n").replace("element face", "element tristrips");
    let model = read_text("a.ply", strips).unwrap();
    assert_eq!(model.meshes[0].triangles, [[0, 1, 2], [2, 1, 0]]);
}

#[test]
fn ply_vertices_without_a_use_or_a_normal_or_a_colour_go() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n\
        property uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0 2 255 255 255\n9 9 9 0 0 0 1 2 3\n1 0 0 0 0 1 255 255 255\n0 1 0 0 0 1 255 255 255\n3 0 2 3\n";
    let mesh = &read_text("a.ply", text).unwrap().meshes[0];
    assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 3]);
    assert!(mesh.colours.is_empty(), "white says nothing");
    let model = read_text("a.ply", text.replace("3 0 2 3", "3 0 1 3")).unwrap();
    assert_eq!((model.meshes[0].normals.len(), model.meshes[0].colours.len()), (0, 3));
    assert!(model.notes[0].contains("have no direction"), "{:?}", model.notes);
}

#[test]
fn ply_agrees_with_another_reader() {
    let Some(path) = dataset("ply/cycloidal.ply") else { return };
    let model = read(&path).unwrap();
    let parser = ply_rs_bw::parser::Parser::<ply_rs_bw::ply::DefaultElement>::new();
    let other = parser.read_ply(&mut fs::File::open(path).unwrap()).unwrap();
    let number = |element: &ply_rs_bw::ply::DefaultElement, name: &str| element[name].to_f32_lossy().unwrap();
    let positions: Vec<_> =
        other.payload["vertex"].iter().map(|v| ["x", "y", "z"].map(|axis| number(v, axis))).collect();
    let faces: Vec<_> = other.payload["face"]
        .iter()
        .map(|face| face.values().find_map(|value| value.to_u32_list()).unwrap())
        .collect();
    assert_eq!(model.meshes[0].positions, positions);
    assert_eq!(model.meshes[0].triangles, faces.iter().map(|f| [f[0], f[1], f[2]]).collect::<Vec<_>>());
}

/// Positions of the corners of all triangles.
fn positions(mesh: &SourceMesh) -> Vec<[f32; 3]> {
    corners_of(mesh).into_iter().map(|(position, ..)| position).collect()
}

#[test]
fn stl_of_every_encoding_is_the_same_mesh() {
    let made = made();
    let expected: Vec<_> = made.corners().into_iter().map(|(position, ..)| position).collect();
    let windows = text_stl(&made, " x").replace('\n', "\r\n");
    for (file, name) in [
        (text_stl(&made, " some  name ").into_bytes(), "some  name"),
        (text_stl(&made, "").into_bytes(), "a"),
        (text_stl(&made, " X").to_uppercase().into_bytes(), "X"),
        (format!("\u{feff}\n  {windows}").into_bytes(), "x"),
        (binary_stl(&made, "binary"), "a"),
        (binary_stl(&made, "solid but binary\nfacet normal"), "a"),
    ] {
        let model = read_text("a.stl", &file).unwrap();
        assert_eq!(model.meshes.len(), 1);
        assert_eq!(positions(&model.meshes[0]), expected);
        assert_eq!(model.meshes[0].positions.len(), 9, "equal positions are one vertex");
        assert!(model.meshes[0].normals.is_empty() && model.meshes[0].colours.is_empty());
        assert_eq!(model.meshes[0].name, name);
        assert!(model.notes.is_empty(), "{:?}", model.notes);
    }
}

#[test]
fn stl_zeros_of_either_sign_are_one_position() {
    let text = "solid\nfacet\nvertex -0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\n\
        facet\nvertex 0 -0 0\nvertex 1 0 0\nvertex 0 0 1\nendfacet\n";
    assert_eq!(read_text("a.stl", text).unwrap().meshes[0].positions.len(), 4);
}

#[test]
fn stl_solids_are_meshes() {
    let made = made();
    let text =
        text_stl(&made, " one") + &text_stl(&made, " two") + "solid empty\nendsolid\n" + &text_stl(&made, "");
    let model = read_text("a.stl", text).unwrap();
    let seen: Vec<_> =
        model.meshes.iter().map(|mesh| (mesh.name.as_str(), mesh.triangles.len(), mesh.body)).collect();
    assert_eq!(seen, [("one", 14, 0), ("two", 14, 1), ("a", 14, 2)]);
    assert_eq!(placing_nodes(&model), 3);
}

#[test]
fn every_prefix_of_an_stl_file_is_an_error_or_the_facets_so_far() {
    let (text, binary) = (text_stl(&made(), " x").into_bytes(), binary_stl(&made(), "solid x"));
    for length in 1..binary.len() {
        let message = read_text("a.stl", &binary[..length]).unwrap_err();
        let expected =
            if length < 84 { ["no triangles", "neither text"] } else { ["cut short", "no triangles"] };
        assert!(expected.iter().any(|words| message.contains(words)), "{length}: {message}");
    }
    for length in 1..text.len() {
        match read_text("a.stl", &text[..length]) {
            Ok(model) => assert_eq!(triangles(&model).0, count_of(&text[..length], b"endfacet"), "{length}"),
            Err(message) => {
                assert!(message.contains("no triangles") || message.contains("neither text"), "{message}")
            }
        }
    }
}

fn count_of(text: &[u8], word: &[u8]) -> usize {
    text.windows(word.len()).filter(|window| *window == word).count()
}

#[test]
fn binary_stl_with_more_bytes_than_it_needs_says_so() {
    let model = read_text("a.stl", [binary_stl(&made(), "x"), vec![0; 7]].concat()).unwrap();
    assert_eq!(triangles(&model), (14, 14));
    assert_eq!(model.notes, ["7 bytes behind the last triangle are not read (first: byte 784)"]);
}

#[test]
fn stl_agrees_with_another_reader() {
    for name in ["stl/head.stl", "stl/wj-wk00-0122topcabinetcase_95.stl", "stl/test_sphere_ascii.stl"] {
        let Some(path) = dataset(name) else { continue };
        let model = read(&path).unwrap();
        let other = stl_io::read_stl(&mut fs::File::open(path).unwrap()).unwrap();
        let corners = other.faces.iter().flat_map(|face| face.vertices.map(|v| other.vertices[v].0));
        assert_eq!(positions(&model.meshes[0]), corners.collect::<Vec<_>>(), "{name}");
    }
}

/// The corners of all triangles, mesh by mesh, as another reader finds them.
fn corners_by_tobj(text: &[u8]) -> Vec<Vec<[f32; 3]>> {
    let mut lines = text;
    let loaded = tobj::load_obj_buf(&mut lines, &tobj::LoadOptions::default(), |_| unreachable!());
    let corners = |mesh: &tobj::Mesh| {
        let positions = mesh.positions.as_chunks::<3>().0;
        mesh.indices.iter().map(|&index| positions[index as usize]).collect()
    };
    loaded.unwrap().0.iter().map(|model| corners(&model.mesh)).collect()
}

/// Objects of some triangles each, which refer to vertices forwards and backwards, with normals and without.
fn made_obj() -> String {
    let object = |number: i32| {
        let vertices = (0..9).map(|i| format!("v {i} {}.25 -{number}e-1\n", i * i % 7)).collect::<String>();
        let faces = (0..7).map(|i| match number % 3 {
            0 => format!("f {} {} {}\n", 9 * number + i + 1, i - 8, i - 7),
            1 => format!("f {}//1 {}//-1 {}//1\n", i - 9, 9 * number + i + 3, i - 8),
            _ => format!("f {}/3 {}/4 1/1\n", i - 9, i - 8),
        });
        format!("o {number}\n{vertices}vn 0 0 1\n{}", faces.collect::<String>())
    };
    (0..20).map(object).collect()
}

#[test]
fn obj_agrees_with_another_reader() {
    let texts = dataset("obj/koala.obj").map(|path| fs::read(path).unwrap());
    for text in texts.into_iter().chain([made_obj().into_bytes()]) {
        // It wants texture coordinates to be there.
        let whole = [b"vt 0 0\nvt 0 0\nvt 0 0\nvt 0 0\n", &text[..]].concat();
        let model = read_text("a.obj", &text).unwrap();
        assert_eq!(model.meshes.iter().map(positions).collect::<Vec<_>>(), corners_by_tobj(&whole));
    }
}
