//! Files in, a [`Model`] out: parts, instances, the assembly tree and materials, whatever the format.
//!
//! Nothing here welds, cleans or simplifies: a mesh leaves this room as its file states it, with polygons cut
//! into triangles and every index checked. What had to be skipped is told in [`Model::notes`]; what cannot be
//! read at all is an [`ImportError`].

mod attributes;
mod error;
mod folder;
mod gltf;
mod input;
mod model;
mod notes;
mod obj;
mod ply;
mod polygon;
mod shelf;
mod stl;
mod tint;

use std::path::{Path, PathBuf};

use glam::DAffine3;

pub use error::{ImportError, Problem};
pub use model::{Colour, Instance, Material, Model, Node, SourceMesh};
pub use shelf::{Room, Shelf, Shelved};

pub use input::PACKED_EXTENSIONS;
pub(crate) use input::memory_at_hand;
use input::{Input, extension_of, stem_of};
use notes::{Notes, quoted};

/// The file extensions that [`read`] knows, in lower case; one of [`PACKED_EXTENSIONS`] may follow.
pub const EXTENSIONS: [&str; 5] = ["obj", "glb", "gltf", "ply", "stl"];

/// The most placements that a model may have; a file of a few megabytes can ask for billions.
pub const MAX_INSTANCES: usize = 1 << 24;

/// What reads one format.
type Importer = fn(&Input<'_>, Shelf) -> Result<Model<Shelf>, Problem>;

/// Reads files of any known format into one model, all of it in memory.
///
/// Of one file the model has that file's own root nodes; of several, each file is a root node named after its
/// stem.
///
/// # Errors
///
/// [`ImportError`] if there is no file, one cannot be read or understood, or no triangle is left in any of
/// them.
pub fn read(paths: &[PathBuf]) -> Result<Model, ImportError> {
    let Model { meshes, instances, nodes, materials, notes } = read_into(paths, &Room::default())?;
    let given = (0..meshes.len()).map(|number| meshes.give(number)).collect::<Result<_, _>>();
    let meshes = given.map_err(|problem| problem.at(&list_of(paths)))?;
    Ok(Model { meshes, instances, nodes, materials, notes })
}

/// The same, with its meshes on a shelf, which takes no more memory than there is room.
///
/// # Errors
///
/// As [`read`], and what keeps meshes from being put away.
pub fn read_into(paths: &[PathBuf], room: &Room) -> Result<Model<Shelf>, ImportError> {
    let importers = paths
        .iter()
        .map(|path| importer_of(path).map_err(|problem| problem.at(path)))
        .collect::<Result<Vec<Importer>, ImportError>>()?;
    let mut model = match (paths, &importers[..]) {
        ([], _) => return Err(ImportError::NoInput),
        ([path], [importer]) => read_one(path, *importer, room)?,
        _ => read_several(paths, &importers, room)?,
    };
    if model.meshes.meshes().iter().all(|mesh| mesh.triangles == 0) || model.instances.is_empty() {
        let problem = Problem::NoTriangles { notes: model.notes.join("; ") };
        return Err(ImportError::File { problem, path: list_of(paths) });
    }
    tint::apply(&mut model).map_err(|problem| problem.at(&list_of(paths)))?;
    Ok(model)
}

/// Picks the importer by extension.
fn importer_of(path: &Path) -> Result<Importer, Problem> {
    let extension = extension_of(path);
    match extension.as_str() {
        "obj" => Ok(obj::read),
        "glb" | "gltf" => Ok(gltf::read),
        "ply" => Ok(ply::read),
        "stl" => Ok(stl::read),
        _ => Err(Problem::UnknownExtension { extension, known: known_extensions() }),
    }
}

/// All extensions, in words.
fn known_extensions() -> String {
    format!("{}, each also packed as .{}", EXTENSIONS.join(", "), PACKED_EXTENSIONS.join(" or ."))
}

/// Reads one file, after the checks that all formats share.
fn read_one(path: &Path, importer: Importer, room: &Room) -> Result<Model<Shelf>, ImportError> {
    let read = |input| importer(&input, Shelf::new(room));
    Input::new(path, room.stop()).and_then(read).map_err(|problem| problem.at(path))
}

/// Reads every file under a root node of its own.
fn read_several(paths: &[PathBuf], importers: &[Importer], room: &Room) -> Result<Model<Shelf>, ImportError> {
    let mut all = Model { materials: vec![Material::default()], ..Model::default() };
    for (path, importer) in paths.iter().zip(importers) {
        let one = read_one(path, *importer, room)?;
        append(&mut all, one, stem_of(path)).map_err(|problem| problem.at(path))?;
    }
    Ok(all)
}

/// All paths in one, for a message about all of them.
fn list_of(paths: &[PathBuf]) -> PathBuf {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ").into()
}

/// Adds a model to another, under a new root node.
fn append(all: &mut Model<Shelf>, one: Model<Shelf>, root_name: String) -> Result<(), Problem> {
    let mesh_base = index_of(all.meshes.len() + one.meshes.len())? - one.meshes.len() as u32;
    let root = index_of(all.nodes.len() + one.nodes.len())? - one.nodes.len() as u32;
    let material_base = index_of(all.materials.len() + one.materials.len())? - one.materials.len() as u32;
    check_instance_count(all.instances.len() + one.instances.len())?;
    all.notes.extend(one.notes.iter().map(|note| format!("{}: {note}", quoted(&root_name))));
    all.nodes.push(Node { name: root_name, parent: None });
    all.nodes.extend(
        one.nodes
            .into_iter()
            .map(|node| Node { parent: Some(node.parent.map_or(root, |parent| root + 1 + parent)), ..node }),
    );
    // Every model's material 0 is the default, which `all` has already.
    all.materials.extend(one.materials.into_iter().skip(1));
    all.meshes.append(one.meshes);
    all.instances.extend(one.instances.into_iter().map(|instance| Instance {
        mesh: mesh_base + instance.mesh,
        node: root + 1 + instance.node,
        material: if instance.material == 0 { 0 } else { material_base + instance.material - 1 },
        ..instance
    }));
    Ok(())
}

/// A table's length as the index of its next entry.
fn index_of(length: usize) -> Result<u32, Problem> {
    u32::try_from(length).ok().filter(|&index| index < u32::MAX).ok_or(Problem::TooMany { what: "entries" })
}

/// That there is room for this many instances.
fn check_instance_count(count: usize) -> Result<(), Problem> {
    if count > MAX_INSTANCES { Err(Problem::TooMany { what: "placements" }) } else { Ok(()) }
}

/// A model of one mesh, placed once at a node of the same name.
fn model_of_one(
    mut mesh: SourceMesh,
    name: String,
    notes: Notes,
    mut shelf: Shelf,
) -> Result<Model<Shelf>, Problem> {
    mesh.name.clone_from(&name);
    let mesh = shelf.push(mesh)?;
    let instance = Instance { mesh, node: 0, material: 0, world_from_part: DAffine3::IDENTITY };
    Ok(Model {
        meshes: shelf,
        instances: vec![instance],
        nodes: vec![Node { name, parent: None }],
        materials: vec![Material::default()],
        notes: notes.into_lines(),
    })
}

/// The name of the `nth` mesh of an object: the object's own, but cut after the first, so that one long name
/// that many meshes share takes no room that the file does not take.
fn part_name(name: &str, nth: usize) -> String {
    if nth == 0 { name.to_owned() } else { shared_name(name).to_owned() }
}

/// The beginning of a name that many objects share.
fn shared_name(name: &str) -> &str {
    const SHARED: usize = 256;
    name.char_indices().nth(SHARED).map_or(name, |(end, _)| &name[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(name: &str) -> Model<Shelf> {
        let mesh = SourceMesh {
            name: name.to_owned(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..SourceMesh::default()
        };
        let material = Material { name: name.to_owned(), base_colour: [1, 2, 3, 4] };
        let node = |parent| Node { name: name.to_owned(), parent };
        let instance =
            |material| Instance { mesh: 0, node: 1, material, world_from_part: DAffine3::IDENTITY };
        Model {
            meshes: Shelf::of(vec![mesh]),
            instances: vec![instance(0), instance(1)],
            nodes: vec![node(None), node(Some(0))],
            materials: vec![Material::default(), material],
            notes: vec!["odd".to_owned()],
        }
    }

    #[test]
    fn appended_models_keep_their_references() {
        let mut all = Model { materials: vec![Material::default()], ..Model::default() };
        append(&mut all, triangle("a"), "first".to_owned()).unwrap();
        append(&mut all, triangle("b"), "second".to_owned()).unwrap();
        let parents: Vec<_> = all.nodes.iter().map(|node| node.parent).collect();
        assert_eq!(parents, [None, Some(0), Some(1), None, Some(3), Some(4)]);
        let of_instances: Vec<_> = all.instances.iter().map(|i| (i.mesh, i.node, i.material)).collect();
        assert_eq!(all.meshes.meshes()[1].body, 1);
        assert_eq!(of_instances, [(0, 2, 0), (0, 2, 1), (1, 5, 0), (1, 5, 2)]);
        assert_eq!(all.materials[2].name, "b");
        assert_eq!(all.notes, ["\"first\": odd", "\"second\": odd"]);
    }

    #[test]
    fn extension_is_matched_in_any_case() {
        assert!(importer_of(Path::new("a/B.GLB")).is_ok());
        assert!(importer_of(Path::new("a/B.Stl.ZST")).is_ok());
        let message = importer_of(Path::new("a/b.step")).unwrap_err().to_string();
        let known = "obj, glb, gltf, ply, stl, each also packed as .zst or .gz";
        assert_eq!(message, format!("unknown extension \"step\"; known are {known}"));
        assert!(importer_of(Path::new("a/b.zst")).is_err(), "packed, but what?");
    }
}
