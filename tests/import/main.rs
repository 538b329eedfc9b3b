//! The importers on every hostile and every real model at hand, and on small files made here and in the modules.
//!
//! Models lie in the folder named by `COLLAPSAR_DATASETS`, else in `../shared/datasets`; a test that does not
//! find its model says so and passes.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod compressed;
mod formats;
mod made;
mod packed;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use collapsar::import::{self, Material, Model, SourceMesh};

/// A model's path in the data sets; `None`, with a word, if it is not there.
fn dataset(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/datasets");
    let folder = std::env::var_os("COLLAPSAR_DATASETS").map_or_else(beside, PathBuf::from);
    let path = folder.join(name);
    if !path.exists() {
        eprintln!("skipped: no {name}");
        return None;
    }
    Some(path)
}

/// Reads one file, checks every promise of the model, and that it took only seconds.
fn read(path: &Path) -> Result<Model, String> {
    let start = Instant::now();
    let result = import::read(&[path.to_owned()]).map_err(|error| error.to_string());
    assert!(start.elapsed() < Duration::from_secs(20), "{path:?} took {:?}", start.elapsed());
    match &result {
        Ok(model) => check(model),
        Err(message) => assert!(message.ends_with(&path.display().to_string()), "{message}: path last"),
    }
    result
}

/// Every promise that the types of a model make.
fn check(model: &Model) {
    assert_eq!(model.materials[0], Material::default());
    model.meshes.iter().for_each(check_mesh);
    (0..model.meshes.len()).for_each(|number| check_body(model, number));
    for (index, node) in model.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| (parent as usize) < index));
    }
    for instance in &model.instances {
        assert!((instance.mesh as usize) < model.meshes.len());
        assert!((instance.node as usize) < model.nodes.len());
        assert!((instance.material as usize) < model.materials.len());
        assert!(instance.world_from_part.is_finite());
        let colour = model.materials[instance.material as usize].base_colour;
        let is_coloured = !model.meshes[instance.mesh as usize].colours.is_empty();
        assert!(
            !is_coloured || colour[..3] == [255; 3],
            "the colours of vertices are all there is to a colour"
        );
    }
    assert!(model.notes.iter().all(|note| note.len() < 400), "{:?}", model.notes);
}

/// Bodies are numbered by their first meshes.
fn check_body(model: &Model, number: usize) {
    let body = model.meshes[number].body as usize;
    assert!(body <= number && model.meshes[body].body as usize == body, "mesh {number} is of body {body}");
}

fn check_mesh(mesh: &SourceMesh) {
    assert!(!mesh.triangles.is_empty());
    assert!(mesh.positions.iter().flatten().all(|c| c.abs() <= 1e30));
    let unit = |n: &[f32; 3]| (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-4;
    assert!(mesh.normals.iter().all(unit));
    assert!(mesh.normals.is_empty() || mesh.normals.len() == mesh.positions.len());
    assert!(mesh.colours.is_empty() || mesh.colours.len() == mesh.positions.len());
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    assert!(used.iter().all(|&used| used), "a vertex is not in use");
}

/// Triangles of distinct meshes, and summed over placements.
fn triangles(model: &Model) -> (usize, usize) {
    let of = |mesh: u32| model.meshes[mesh as usize].triangles.len();
    let distinct = model.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    (distinct, model.instances.iter().map(|instance| of(instance.mesh)).sum())
}

/// Nodes that place anything.
fn placing_nodes(model: &Model) -> usize {
    let mut nodes: Vec<u32> = model.instances.iter().map(|instance| instance.node).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes.len()
}

/// A hostile file that must load, with its distinct and placed triangles.
#[track_caller]
fn hostile(name: &str, expected: (usize, usize)) -> Option<Model> {
    let model = read(&dataset(&format!("hostile/{name}"))?).unwrap();
    assert_eq!(triangles(&model), expected, "{name}: {:?}", model.notes);
    Some(model)
}

/// A hostile file that must not load, with words of its message.
#[track_caller]
fn refused(name: &str, words: &[&str]) {
    if let Some(path) = dataset(&format!("hostile/{name}")) {
        let message = read(&path).unwrap_err();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

/// Writes a file into a folder of its own and reads it.
fn read_text(name: &str, text: impl AsRef<[u8]>) -> Result<Model, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    read(&path)
}

mod hostile_files {
    use super::*;

    #[test]
    fn empty_files() {
        refused("empty.obj", &["the file is empty"]);
        refused("empty.glb", &["the file is empty"]);
        refused("empty.ply", &["the file is empty"]);
        refused("empty.stl", &["the file is empty"]);
    }

    #[test]
    fn nan_inf_positions() {
        // 17 of 256 touch a bad position, counted by a script that shares no code.
        let Some(model) = hostile("nan_inf_positions.glb", (239, 239)) else { return };
        assert!(model.meshes.iter().any(|mesh| mesh.triangles.len() == 128), "the good mesh is whole");
        assert!(model.notes[0].contains("not finite"), "{:?}", model.notes);
    }

    #[test]
    fn nonmanifold_zoo() {
        let Some(model) = hostile("nonmanifold_zoo.obj", (77, 77)) else { return };
        let names: Vec<_> = model.nodes.iter().map(|node| node.name.as_str()).collect();
        assert_eq!(names, ["fan", "bowtie", "moebius", "mixed_winding", "tjunction", "internal_wall"]);
    }

    #[test]
    fn obj_empty_groups() {
        let Some(model) = hostile("obj_empty_groups.obj", (1, 1)) else { return };
        assert_eq!(model.meshes[0].name, "full");
    }

    #[test]
    fn obj_missing_mtl() {
        let Some(model) = hostile("obj_missing_mtl.obj", (2, 2)) else { return };
        assert_eq!(model.materials.len(), 1);
        assert!(model.notes.iter().any(|note| note.contains("does_not_exist.mtl")), "{:?}", model.notes);
        assert!(model.notes.iter().any(|note| note.contains("nowhere")), "{:?}", model.notes);
    }

    #[test]
    fn obj_negative_indices() {
        hostile("obj_negative_indices.obj", (2, 2));
    }

    #[test]
    fn obj_concave_ngon() {
        let Some(model) = hostile("obj_concave_ngon.obj", (3, 3)) else { return };
        let mesh = &model.meshes[0];
        assert!(mesh.normals.is_empty(), "one of them is zero");
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
        };
        assert!(mesh.triangles.iter().all(|t| area(t) > 0.0), "none folds over");
    }

    #[test]
    fn obj_short_faces() {
        hostile("obj_short_faces.obj", (1, 1));
    }

    #[test]
    fn obj_line_continuation() {
        hostile("obj_line_continuation.obj", (3, 3));
    }

    #[test]
    fn obj_trailing_text() {
        refused("obj_trailing_text.obj", &["line 3", "1,5"]);
    }

    #[test]
    fn index_out_of_range_obj() {
        let Some(model) = hostile("index_out_of_range.obj", (2, 2)) else { return };
        assert!(model.notes[0].contains("(first: line 6)"), "{:?}", model.notes);
    }

    #[test]
    fn huge_coordinates() {
        let Some(model) = hostile("huge_coordinates.glb", (256, 512)) else { return };
        let scales: Vec<f64> = model.instances.iter().map(|i| i.world_from_part.matrix3.x_axis.x).collect();
        assert_eq!(scales[..2], [1.0, 1.0]);
        assert!((scales[2] / 1e12 - 1.0).abs() < 1e-6 && (scales[3] / 1e-12 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn index_out_of_range_glb() {
        let Some(model) = hostile("index_out_of_range.glb", (382, 382)) else { return };
        assert!(model.notes[0].contains("vertex that is not there"), "{:?}", model.notes);
        assert_eq!(model.meshes[2].triangles.len(), 128, "the good mesh is whole");
    }

    #[test]
    fn containers_and_accessors_that_lie() {
        refused("truncated.glb", &["truncated"]);
        refused("lying_accessor.glb", &["buffer view 0", "1099511627776"]);
    }

    #[test]
    fn cyclic_nodes() {
        refused("cyclic_nodes.glb", &["no tree"]);
    }

    #[test]
    fn deep_hierarchy() {
        let Some(model) = hostile("deep_hierarchy_20000.glb", (128, 128)) else { return };
        assert_eq!(model.nodes.len(), 20_001);
        assert_eq!(model.nodes.last().unwrap().parent, Some(19_999));
    }

    #[test]
    fn odd_transforms() {
        let Some(model) = hostile("odd_transforms.glb", (128, 128 * 2006)) else { return };
        assert_eq!(model.meshes.len(), 1);
        assert!(model.instances.iter().any(|i| i.world_from_part.matrix3.determinant() < 0.0), "mirrored");
        assert!(model.instances.iter().any(|i| i.world_from_part.matrix3.determinant() == 0.0), "flattened");
    }

    #[test]
    fn mixed_primitives() {
        // A list of 128, a strip and a fan over 30 corners, 81 corners without indices.
        let Some(model) = hostile("mixed_primitives.glb", (211, 211)) else { return };
        let counts: Vec<_> = model.meshes.iter().map(|mesh| mesh.triangles.len()).collect();
        assert_eq!(counts, [128, 28, 28, 27]);
        assert_eq!(model.notes.len(), 3, "{:?}", model.notes);
    }

    #[test]
    fn odd_names() {
        let Some(model) = hostile("odd_names.glb", (128, 128 * 9)) else { return };
        assert!(model.nodes.iter().any(|node| node.name.len() >= 100_000));
        assert!(model.nodes.iter().any(|node| node.name.is_empty()));
        assert!(model.nodes.iter().any(|node| node.name.contains('\0')));
    }

    #[test]
    fn tiny_meshes() {
        let start = Instant::now();
        let Some(model) = hostile("tiny_meshes_20000.glb", (20_000, 20_000)) else { return };
        assert!(start.elapsed() < Duration::from_secs(3), "{:?}", start.elapsed());
        assert_eq!((model.meshes.len(), model.nodes.len()), (20_000, 20_000));
    }

    #[test]
    fn unusual_encodings() {
        let Some(model) = hostile("unusual_encodings.glb", (256, 256)) else { return };
        let top =
            |mesh: &SourceMesh, axis: usize| mesh.positions.iter().map(|p| p[axis]).fold(f32::MIN, f32::max);
        assert_eq!(top(&model.meshes[0], 0), 1.0, "normalised");
        assert_eq!(top(&model.meshes[1], 2), 2.0, "replaced by the sparse part");
    }

    #[test]
    fn ascii_odd() {
        let Some(model) = hostile("ascii_odd.stl", (1, 1)) else { return };
        assert_eq!(model.meshes[0].name, "name with spaces");
        assert!(model.notes[0].starts_with("2 facets skipped"), "{:?}", model.notes);
        assert!(model.notes[0].contains("line 11: \"1,0\" is not a number"), "{:?}", model.notes);
    }

    #[test]
    fn degenerate_duplicate() {
        hostile("degenerate_duplicate.stl", (240, 240));
    }

    #[test]
    fn solid_but_binary() {
        hostile("solid_but_binary.stl", (100, 100));
    }

    #[test]
    fn counts_that_lie() {
        refused(
            "truncated_binary.stl",
            &["cut short: 1000000 triangles take 50000084 bytes, but there are 5084"],
        );
        refused("truncated.ply", &["the file ends after byte", "before all that its header promises"]);
    }

    /// None is forgotten: each is read by one of the tests here, and each gives a model or a message.
    #[test]
    fn every_one_gives_a_clear_result() {
        let Some(folder) = dataset("hostile") else { return };
        let source = include_str!("main.rs");
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            assert!(source.contains(&format!("\"{name}\"")), "{name} has no test");
            if let Err(message) = read(&path) {
                assert!(message.len() < 300 && !message.contains('\n'), "{message}");
            }
        }
    }
}

mod real_models {
    use super::*;

    /// Meshes (distinct geometries of primitives), triangles, triangles placed, nodes that place something,
    /// all nodes. The latter four are those of the data sets' own table; meshes are primitives here, and
    /// whole meshes there.
    #[track_caller]
    fn assert_counts(name: &str, meshes: usize, expected: (usize, usize), placements: usize, nodes: usize) {
        let Some(path) = dataset(name) else { return };
        let start = Instant::now();
        let model = read(&path).unwrap();
        eprintln!("{name}: {:?}, notes {:?}", start.elapsed(), model.notes);
        assert_eq!(triangles(&model), expected);
        assert_eq!(model.meshes.len(), meshes, "meshes");
        assert_eq!(placing_nodes(&model), placements, "placements");
        assert_eq!(model.nodes.len(), nodes, "nodes");
    }

    #[test]
    fn as1() {
        assert_counts("gltf/as1-oc-214.glb", 5, (4_284, 10_732), 18, 28);
    }

    #[test]
    fn two_cylinder_engine() {
        assert_counts("gltf/2CylinderEngine.glb", 34, (75_730, 121_496), 67, 82);
    }

    #[test]
    fn huldra() {
        assert_counts("gltf/huldra_wd1_psup.glb", 2_185, (88_962, 88_962), 2_185, 4_087);
    }

    #[test]
    fn schependomlaan() {
        assert_counts("gltf/schependomlaan.gltf", 2_421, (159_670, 168_210), 2_203, 5_031);
    }

    #[test]
    fn kicad_video() {
        assert_counts("gltf/kicad_video.glb", 62, (268_115, 458_381), 167, 334);
    }

    #[test]
    fn ldraw_10179() {
        assert_counts("gltf/ldraw_10179.glb", 271, (319_658, 5_174_555), 5_260, 5_653);
    }

    #[test]
    fn duck_bdx() {
        assert_counts("gltf/duck_bdx.glb", 48, (171_350, 596_658), 133, 154);
    }

    #[test]
    fn peterbilt() {
        // Six faces name a vertex twice in a row, and lose one corner each: 6 less than in the data sets'
        // table, which calls them degenerate. Parts are by object and material.
        assert_counts("obj/peterbilt.obj", 51, (116_495, 116_495), 38, 38);
        let Some(path) = dataset("obj/peterbilt.obj") else { return };
        let model = read(&path).unwrap();
        let used: std::collections::BTreeSet<_> = model.instances.iter().map(|i| i.material).collect();
        assert_eq!(used.len(), 12);
        let black = model.materials.iter().find(|m| m.name == "black").unwrap();
        assert_eq!(black.base_colour, [5, 5, 5, 255]);
    }

    #[test]
    fn koala() {
        assert_counts("obj/koala.obj", 1, (99_994, 99_994), 1, 1);
        let Some(path) = dataset("obj/koala.obj") else { return };
        let model = read(&path).unwrap();
        assert_eq!(model.meshes[0].positions.len(), 49_999);
        assert_eq!(model.nodes[0].name, "koala");
    }

    #[test]
    fn kicad_catalogue() {
        assert_counts("gltf/kicad_catalogue.glb.zst", 739, (1_027_215, 1_027_215), 297, 386);
    }

    #[test]
    fn ldraw_omr() {
        assert_counts("gltf/ldraw_omr.glb.zst", 3_208, (2_870_535, 48_168_590), 67_144, 71_922);
    }

    #[test]
    fn nist_ftc_06() {
        assert_counts("gltf/nist_ftc_06_fine.glb.zst", 1, (1_196_766, 1_196_766), 1, 3);
    }

    #[test]
    fn furniture() {
        // The table counts corners minus two for every face. Here repeated corners go first (6,338 triangles
        // less, and the one part that has no other faces), and 131 polygons that cross or touch themselves
        // need 229 less.
        assert_counts("obj/furniture_cc0.obj.zst", 741, (2_356_926, 2_356_926), 277, 299);
        let Some(path) = dataset("obj/furniture_cc0.obj.zst") else { return };
        let named = read(&path).unwrap().materials.len();
        assert!(named > 600, "{named} materials: the library beside the packed file was not found");
    }

    #[test]
    fn gearbox() {
        assert_counts("restricted/GearboxAssy.glb", 42, (409_264, 646_064), 95, 118);
    }

    #[test]
    fn dragon() {
        assert_counts("restricted/dragon_vrip.ply.zst", 1, (871_414, 871_414), 1, 1);
        let Some(path) = dataset("restricted/dragon_vrip.ply.zst") else { return };
        assert_eq!(read(&path).unwrap().meshes[0].positions.len(), 437_645);
    }

    #[test]
    fn cycloidal() {
        assert_counts("ply/cycloidal.ply", 1, (43_368, 43_368), 1, 1);
        let Some(path) = dataset("ply/cycloidal.ply") else { return };
        assert_eq!(read(&path).unwrap().meshes[0].positions.len(), 21_384);
    }

    #[test]
    fn stl() {
        assert_counts("stl/head.stl", 1, (21_634, 21_634), 1, 1);
        assert_counts("stl/wj-wk00-0122topcabinetcase_95.stl", 1, (41_378, 41_378), 1, 1);
        assert_counts("stl/test_sphere_ascii.stl", 1, (224, 224), 1, 1);
    }

    #[test]
    fn every_real_mesh_gets_normals() {
        for name in ["gltf/schependomlaan.gltf", "obj/peterbilt.obj"] {
            let Some(path) = dataset(name) else { continue };
            let mut model = read(&path).unwrap();
            for mesh in &mut model.meshes {
                let before = mesh.triangles.len();
                collapsar::geometry::normals::by_crease_angle(
                    mesh,
                    collapsar::geometry::normals::CREASE_DEGREES,
                );
                assert_eq!((mesh.normals.len(), mesh.triangles.len()), (mesh.positions.len(), before));
                check_mesh(mesh);
            }
        }
    }
}

mod made_here {
    use super::*;

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    /// A triangle in glTF with its buffer as base64, and more JSON.
    pub fn gltf_triangle(buffer_uri: &str, more: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{buffer_uri}"}}]{more}}}"#
        )
    }

    pub fn triangle_bytes() -> Vec<u8> {
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect()
    }

    #[test]
    fn missing_file_folder_and_no_file() {
        assert!(import::read(&[]).unwrap_err().to_string().starts_with("no input file"));
        let folder = tempfile::tempdir().unwrap();
        let missing = read(&folder.path().join("none.obj")).unwrap_err();
        assert!(missing.starts_with("cannot read the file (No such file"), "{missing}");
        fs::create_dir(folder.path().join("x.glb")).unwrap();
        assert!(read(&folder.path().join("x.glb")).unwrap_err().starts_with("this is not a file"));
        assert!(
            read(Path::new("README"))
                .unwrap_err()
                .starts_with("unknown extension \"\"; known are obj, glb, gltf, ply, stl")
        );
    }

    #[test]
    fn no_triangles_says_what_was_skipped() {
        let message = read_text("a.obj", format!("{SQUARE}f 1 2\nf 1 2 9\n")).unwrap_err();
        assert!(message.starts_with("no triangles (1 faces skipped"), "{message}");
        let message = read_text("a.gltf", r#"{"asset":{"version":"2.0"}}"#).unwrap_err();
        assert!(message.starts_with("no triangles: "), "{message}");
        let nan = "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert!(read_text("a.obj", nan).unwrap_err().contains("1 triangles skipped that touch a position"));
    }

    #[test]
    fn several_files_are_one_model() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["one.obj", "two.gltf", "three.OBJ"].map(|name| folder.path().join(name));
        fs::write(&paths[0], format!("{SQUARE}mtllib m.mtl\no a\nusemtl red\nf 1 2 3 4\n")).unwrap();
        fs::write(&paths[1], gltf_triangle("t.bin", "")).unwrap();
        fs::write(&paths[2], format!("{SQUARE}o b\ng c\nf 1 2 3\n")).unwrap();
        fs::write(folder.path().join("m.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
        fs::write(folder.path().join("t.bin"), triangle_bytes()).unwrap();
        let model = import::read(&paths).unwrap();
        check(&model);
        let nodes: Vec<_> = model.nodes.iter().map(|n| (n.name.as_str(), n.parent)).collect();
        let expected = [
            ("one", None),
            ("a", Some(0)),
            ("two", None),
            ("", Some(2)),
            ("three", None),
            ("b", Some(4)),
            ("c", Some(5)),
        ];
        assert_eq!(nodes, expected);
        assert_eq!(triangles(&model), (4, 4));
        assert_eq!(model.materials[model.instances[0].material as usize].base_colour, [255, 0, 0, 255]);
    }

    #[test]
    fn vertex_colours_multiply_base_colours() {
        let text = "mtllib m.mtl\nv 0 0 0 1 0.5 0\nv 1 0 0 1 1 1\nv 0 1 0 1 1 1\nv 0 0 1\n\
            usemtl red\nf 1 2 3\nusemtl none\nf 1 2 4\n";
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("m.mtl"), "newmtl red\nKd 1 0.5 0.5\nd 0.5\n").unwrap();
        let path = folder.path().join("m.obj");
        fs::write(&path, text).unwrap();
        let model = read(&path).unwrap();
        // 128 is 0.216 in linear light; its square is 0.0466, which is 61.
        assert_eq!(model.meshes[0].colours, [[255, 61, 0, 255], [255, 128, 128, 255], [255, 128, 128, 255]]);
        assert_eq!(model.meshes[1].colours, [[255, 128, 0, 255], [255; 4], [255; 4]], "no material is white");
        let placed: Vec<_> = model.instances.iter().map(|i| &model.materials[i.material as usize]).collect();
        assert_eq!((placed[0].name.as_str(), placed[0].base_colour), ("red", [255, 255, 255, 128]));
        assert_eq!((placed[1].name.as_str(), placed[1].base_colour), ("", [255; 4]));
    }

    #[test]
    fn meshes_of_one_object_are_of_one_body() {
        let text = format!(
            "{SQUARE}o a\nusemtl x\nf 1 2 3\nusemtl y\nf 1 3 4\no b\nf 1 2 4\no a\nusemtl z\nf 2 3 4\n"
        );
        let model = read_text("m.obj", text).unwrap();
        let seen: Vec<_> = model.meshes.iter().map(|mesh| (mesh.name.as_str(), mesh.body)).collect();
        assert_eq!(seen, [("a", 0), ("a", 0), ("b", 2), ("a", 0)]);

        // Four meshes: of two primitives; of the same; of one of these and a new one; of none of these.
        let accessor = r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}"#;
        let primitive = |accessor: u32| format!(r#"{{"attributes":{{"POSITION":{accessor}}}}}"#);
        let mesh = |accessors: &[u32]| {
            let primitives: Vec<String> = accessors.iter().map(|&a| primitive(a)).collect();
            format!(r#"{{"primitives":[{}]}}"#, primitives.join(","))
        };
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}},{{"mesh":1}},{{"mesh":2}},{{"mesh":3}}],
            "meshes":[{},{},{},{}],"accessors":[{}],"bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:x;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#,
            mesh(&[0, 1]),
            mesh(&[1, 0]),
            mesh(&[1, 2]),
            mesh(&[3, 4]),
            [accessor; 5].join(",")
        );
        let model = read_text("m.gltf", text).unwrap();
        let bodies: Vec<_> = model.meshes.iter().map(|mesh| mesh.body).collect();
        assert_eq!(bodies, [0, 0, 0, 3, 3]);
    }

    #[test]
    fn parts_of_one_group_and_material_are_merged() {
        let text = format!("{SQUARE}g a\nf 1 2 3\ng b\nf 1 2 4\ng a\nf 1 3 4\n");
        let model = read_text("m.obj", text).unwrap();
        let counts: BTreeMap<_, _> =
            model.meshes.iter().map(|m| (m.name.as_str(), m.triangles.len())).collect();
        assert_eq!(counts, BTreeMap::from([("a", 2), ("b", 1)]));
    }

    #[test]
    fn obj_normals_and_colours_make_vertices() {
        let square = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let text = format!("{square}vn 0 0 2\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//1 3//1 4//2\n");
        let model = read_text("m.obj", text).unwrap();
        let mesh = &model.meshes[0];
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.normals[3], [0.0, 1.0, 0.0]);
        assert_eq!(mesh.normals[0], [0.0, 0.0, 1.0]);
        assert_eq!(mesh.colours, [[255, 0, 0, 255], [255, 0, 0, 255], [255; 4], [255; 4]]);
        let partly = format!("{square}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n");
        assert!(read_text("m.obj", partly).unwrap().meshes[0].normals.is_empty());
    }

    #[test]
    fn gltf_buffers_as_data_and_as_files() {
        let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        assert_eq!(triangles(&read_text("a.gltf", gltf_triangle(data, "")).unwrap()), (1, 1));
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a b.bin"), triangle_bytes()).unwrap();
        let path = folder.path().join("m.gltf");
        for uri in ["a%20b.bin", "a b.bin", "./a b.bin"] {
            fs::write(&path, gltf_triangle(uri, "")).unwrap();
            assert_eq!(triangles(&read(&path).unwrap()), (1, 1), "{uri}");
        }
        for (uri, part) in [
            ("../a.bin", "not inside the model's own folder"),
            ("%2e%2e/a.bin", "not inside the model's own folder"),
            ("/etc/hostname", "not inside the model's own folder"),
            ("http://x/a.bin", "not inside the model's own folder"),
            ("none.bin", "does not exist"),
            ("data:x;base64,AAAA", "cut short"),
            ("data:x;base64,%%", "not base64"),
        ] {
            fs::write(&path, gltf_triangle(uri, "")).unwrap();
            let message = read(&path).unwrap_err();
            assert!(message.contains(part), "{uri}: {message}");
        }
    }

    #[test]
    fn required_extension_is_named() {
        let more = r#","extensionsRequired":["KHR_draco_mesh_compression"]"#;
        let message = read_text("a.gltf", gltf_triangle("x", more)).unwrap_err();
        assert!(
            message.starts_with("requires KHR_draco_mesh_compression, which is not supported: "),
            "{message}"
        );
    }

    /// Every byte of the JSON of a small file replaced, one at a time: an error or a model, nothing else.
    #[test]
    fn damaged_json_never_panics() {
        let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        let whole = gltf_triangle(data, "").into_bytes();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        for place in 0..whole.len() {
            for byte in *b"9-\"" {
                let mut damaged = whole.clone();
                damaged[place] = byte;
                fs::write(&path, damaged).unwrap();
                let _ = read(&path);
            }
        }
    }

    /// The same with small numbers in place of all others: indices, counts and offsets point anywhere.
    #[test]
    fn damaged_tables_never_panic() {
        let Some(source) = dataset("hostile/unusual_encodings.glb") else { return };
        let whole = fs::read(source).unwrap();
        let json = 20..20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        for place in json.filter(|&place| whole[place].is_ascii_digit()) {
            for byte in *b"0179" {
                let mut damaged = whole.clone();
                damaged[place] = byte;
                fs::write(&path, damaged).unwrap();
                let _ = read(&path);
            }
        }
    }
}
