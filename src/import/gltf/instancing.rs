//! The tables of `EXT_mesh_gpu_instancing` in, the transforms of a node's copies out.
//!
//! A node with this extension does not place its mesh once, but once for every element of its accessors, each relative
//! to the node: a translation, a rotation and a scale, of which any may be missing.

use std::rc::Rc;

use ::gltf::json::Root;
use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;

use super::accessor::{Accessors, Reader};
use super::buffers::Buffers;
use super::document::Document;
use super::nodes::{Placed, from_parts};
use crate::import::notes::quoted;
use crate::import::{Instance, Node, Problem, check_instance_count, shared_name};

/// The name of the extension.
pub const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Copies that a file may have for nothing; beyond these it needs a byte for every few of them.
const FREE_COPIES: usize = 1 << 18;

/// So many copies may stand behind a byte: nodes that are copied together share their accessors.
const COPIES_A_BYTE: usize = 4;

/// What the extension says, of every node.
#[derive(Default, Deserialize)]
struct Tables {
    #[serde(default)]
    nodes: Vec<Extended>,
}

#[derive(Default, Deserialize)]
struct Extended {
    #[serde(default)]
    extensions: Option<Extensions>,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(default, rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Attributes>,
}

/// Accessors of what is said of each copy.
#[derive(Default, Deserialize)]
struct Attributes {
    #[serde(default)]
    attributes: Named,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Named {
    translation: Option<usize>,
    rotation: Option<usize>,
    scale: Option<usize>,
}

impl Named {
    fn accessors(self) -> impl Iterator<Item = usize> {
        [self.translation, self.rotation, self.scale].into_iter().flatten()
    }
}

/// Reads the copies of nodes.
pub struct Instancing<'a> {
    root: &'a Root,
    nodes: Vec<Extended>,
    accessors: Accessors<'a>,
}

impl<'a> Instancing<'a> {
    /// Reads the extension; nothing if the document does not use it.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] if it is used and makes no sense, or promises far more copies than there are data;
    /// [`Problem::TooMany`].
    pub fn of(document: &'a Document<'_>, buffers: &'a Buffers<'a>) -> Result<Self, Problem> {
        let root = &document.root;
        let tables: Tables = document.extension(&[EXTENSION])?;
        let instancing = Self { root, nodes: tables.nodes, accessors: Accessors::new(root, buffers) };
        let count = instancing.all().fold(0, |sum: u64, (_, count)| sum.saturating_add(count));
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        check_instance_count(count)?;
        if count > buffers.total_bytes().saturating_mul(COPIES_A_BYTE).saturating_add(FREE_COPIES) {
            return Err(Problem::Malformed(format!(
                "{EXTENSION} promises {count} copies of meshes, far more than there are data; if they are meant, write them \
                 as nodes"
            )));
        }
        Ok(instancing)
    }

    /// Every node whose mesh has copies, and how many at most.
    fn all(&self) -> impl Iterator<Item = (usize, u64)> {
        let count = |accessor: usize| self.root.accessors.get(accessor).map_or(0, |found| found.count.0);
        let most = move |node| Some((node, self.attributes(node)?.accessors().map(count).max()?));
        (0..self.nodes.len()).filter_map(most)
    }

    /// How much memory the copies take until the model is baked, at most, in bytes.
    pub fn need_bytes(&self) -> u64 {
        let mesh_of = |node: usize| self.root.meshes.get(self.root.nodes.get(node)?.mesh?.value());
        let each = self.all().map(|(node, count)| {
            let primitives = mesh_of(node).map_or(0, |mesh| mesh.primitives.len());
            // Vectors grow by doubling; a name and its number.
            let listed = 2 * (size_of::<Placed>() + size_of::<Node>() + primitives * size_of::<Instance>());
            let named = 32 + shared_name(self.name(node)).len();
            count.saturating_mul((listed + named) as u64)
        });
        each.fold(0, u64::saturating_add)
    }

    fn name(&self, node: usize) -> &str {
        self.root.nodes.get(node).and_then(|node| node.name.as_deref()).unwrap_or_default()
    }

    /// The extension's attributes of a node with a mesh.
    fn attributes(&self, node: usize) -> Option<Named> {
        self.root.nodes.get(node)?.mesh?;
        let named = self.nodes.get(node)?.extensions.as_ref()?.instancing.as_ref()?.attributes;
        named.accessors().next().map(|_| named)
    }

    /// Where the copies of a node's mesh are, relative to the node; `None` if the node places its mesh itself, as it does
    /// where nothing is said of its copies but what an application alone understands.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] for accessors that do not hold what they promise, or do not fit together.
    pub fn copies(&mut self, node: usize) -> Result<Option<Vec<DAffine3>>, Problem> {
        let Some(named) = self.attributes(node) else { return Ok(None) };
        let mut reader =
            |accessor: Option<usize>| accessor.map(|index| self.accessors.get(index)).transpose();
        let readers = [
            ("TRANSLATION", 3, reader(named.translation)?),
            ("ROTATION", 4, reader(named.rotation)?),
            ("SCALE", 3, reader(named.scale)?),
        ];
        let there =
            || readers.iter().filter_map(|(name, parts, reader)| Some((name, *parts, reader.as_ref()?)));
        let count = there().next().map_or(0, |(.., reader)| reader.count);
        for (name, parts, reader) in there() {
            let what = if reader.count != count {
                format!("has {count} copies, but {} of their {name}", reader.count)
            } else if reader.components != parts {
                format!("has a {name} of its copies that is not made of {parts} numbers")
            } else {
                continue;
            };
            return Err(Problem::Malformed(format!("node {node} {} {what}", quoted(self.name(node)))));
        }
        let [translation, rotation, scale] = readers.map(|(.., reader)| reader);
        let copies = Copies { translation, rotation, scale };
        Ok(Some((0..count).map(|copy| copies.at(copy)).collect()))
    }
}

/// What makes the transforms of a node's copies.
struct Copies<'a> {
    translation: Option<Rc<Reader<'a>>>,
    rotation: Option<Rc<Reader<'a>>>,
    scale: Option<Rc<Reader<'a>>>,
}

impl Copies<'_> {
    /// The transform of a copy, relative to its node.
    fn at(&self, copy: usize) -> DAffine3 {
        let vector = |reader: &Option<Rc<Reader<'_>>>, default: [f64; 4]| {
            reader.as_ref().map_or(default, |reader| reader.vector(copy).map(f64::from))
        };
        let triple = |reader, default| {
            let [x, y, z, _] = vector(reader, [default; 4]);
            DVec3::new(x, y, z)
        };
        let rotation = DQuat::from_array(vector(&self.rotation, [0.0, 0.0, 0.0, 1.0]));
        from_parts(triple(&self.scale, 1.0), rotation, triple(&self.translation, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::nodes::walk;
    use super::super::{buffers, document};
    use super::*;

    /// A buffer of two translations, two rotations and two scales: the first copy as it is, the second one turned by 180
    /// degrees about z, three times as large and moved by 1, 2, 3.
    fn two_copies() -> String {
        let numbers: [f32; 20] = [
            0., 0., 0., 1., 2., 3., // translations
            0., 0., 0., 2., 0., 0., 1., 0., // rotations, of which the first is not of unit length
            1., 1., 1., 3., 3., 3., // scales
        ];
        let rotations: [i16; 8] = [0, 0, 0, 32767, 0, 0, 32767, 0];
        let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
        let bytes: Vec<u8> =
            numbers.chain(rotations.iter().flat_map(|number| number.to_le_bytes())).collect();
        let accessor = |offset: usize, shape: &str| {
            format!(
                r#"{{"bufferView":0,"byteOffset":{offset},"componentType":5126,"count":2,"type":"{shape}"}}"#
            )
        };
        format!(
            r#""buffers":[{{"byteLength":96,"uri":"data:application/octet-stream;base64,{}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":96}}],
            "accessors":[{},{},{},{},{}]"#,
            base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bytes),
            accessor(0, "VEC3"),
            accessor(24, "VEC4"),
            accessor(56, "VEC3"),
            r#"{"componentType":5126,"count":3,"type":"VEC3"}"#,
            r#"{"bufferView":0,"byteOffset":80,"componentType":5122,"normalized":true,"count":2,"type":"VEC4"}"#,
        )
    }

    fn walked(nodes: &str) -> Result<Vec<Placed>, String> {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{EXTENSION}"],{},"nodes":[{nodes}]}}"#,
            two_copies()
        );
        let document = document::parse(text.as_bytes()).map_err(|problem| problem.to_string())?;
        let buffers = buffers::load(&document, Path::new("x.gltf")).map_err(|problem| problem.to_string())?;
        let instancing = Instancing::of(&document, &buffers).map_err(|problem| problem.to_string())?;
        walk(&document.root, instancing).map_err(|problem| problem.to_string())
    }

    fn node(attributes: &str) -> String {
        format!(
            r#"{{"name":"bolt","mesh":7,"translation":[10,0,0],"extensions":{{"{EXTENSION}":{{"attributes":{{{attributes}}}}}}}}}"#
        )
    }

    #[test]
    fn copies_are_nodes_below_the_one_that_has_them() {
        for rotation in [1, 4] {
            let all = node(&format!(r#""TRANSLATION":0,"ROTATION":{rotation},"SCALE":2,"_ID":99"#));
            copies_are_placed(&all);
        }
    }

    fn copies_are_placed(all: &str) {
        let placed = walked(&format!(r#"{{"name":"top","children":[1]}},{all}"#)).unwrap();
        let tree: Vec<_> = placed.iter().map(|p| (p.node.name.as_str(), p.node.parent, p.mesh)).collect();
        let expected = [
            ("top", None, None),
            ("bolt", Some(0), None),
            ("bolt 1", Some(1), Some(7)),
            ("bolt 2", Some(1), Some(7)),
        ];
        assert_eq!(tree, expected);
        let at = |copy: usize| placed[copy].world.transform_point3(DVec3::new(1.0, 0.0, 5.0));
        assert!(at(2).distance(DVec3::new(11.0, 0.0, 5.0)) < 1e-6, "{}", at(2));
        assert!(at(3).distance(DVec3::new(8.0, 2.0, 18.0)) < 1e-6, "{}", at(3));
    }

    #[test]
    fn what_is_missing_does_nothing() {
        let placed = walked(&node(r#""SCALE":2"#)).unwrap();
        assert_eq!(placed.len(), 3);
        assert!(placed[1].world.transform_point3(DVec3::ZERO).distance(DVec3::new(10.0, 0.0, 0.0)) < 1e-9);
        // What only an application understands may be anything.
        for attributes in ["", r#""_ID":99"#] {
            let placed = walked(&node(attributes)).unwrap();
            assert_eq!((placed.len(), placed[0].mesh), (1, Some(7)));
        }
        let without_mesh = node(r#""SCALE":99"#).replace(r#""mesh":7,"#, "");
        assert_eq!(walked(&without_mesh).unwrap().len(), 1);
    }

    #[test]
    fn children_of_a_node_with_copies_have_none() {
        let with_child = node(r#""SCALE":2"#).replacen('{', r#"{"children":[1],"#, 1);
        let placed = walked(&format!(r#"{with_child},{{"name":"child","mesh":3}}"#)).unwrap();
        let tree: Vec<_> = placed.iter().map(|p| (p.node.name.as_str(), p.node.parent, p.mesh)).collect();
        let copies = [("bolt 1", Some(0), Some(7)), ("bolt 2", Some(0), Some(7))];
        assert_eq!(tree, [&[("bolt", None, None)], &copies[..], &[("child", Some(0), Some(3))]].concat());
    }

    #[test]
    fn long_names_are_not_repeated_whole() {
        let placed = walked(&node(r#""SCALE":2"#).replace("bolt", &"ä".repeat(100_000))).unwrap();
        assert_eq!(placed[2].node.name.chars().count(), 256 + 2);
    }

    #[test]
    fn copies_that_make_no_sense_are_refused() {
        for (attributes, part) in [
            (r#""TRANSLATION":0,"SCALE":3"#, "node 0 \"bolt\" has 2 copies, but 3 of their SCALE"),
            (r#""ROTATION":0"#, "has a ROTATION of its copies that is not made of 4 numbers"),
            (r#""TRANSLATION":9"#, "accessor 9 is not there"),
            (r#""TRANSLATION":"x""#, "the JSON of EXT_mesh_gpu_instancing is malformed"),
        ] {
            let message = walked(&node(attributes)).err().unwrap();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn a_small_file_cannot_ask_for_any_number_of_copies() {
        let many = |count: u64, nodes: usize| {
            let text = format!(
                r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["{EXTENSION}"],"nodes":[{}],
                "accessors":[{{"componentType":5126,"count":{count},"type":"VEC3"}}]}}"#,
                vec![node(r#""TRANSLATION":0"#); nodes].join(",")
            );
            let document = document::parse(text.as_bytes()).unwrap();
            let buffers = buffers::load(&document, Path::new("x.gltf")).unwrap();
            Instancing::of(&document, &buffers).err().map(|problem| problem.to_string())
        };
        assert_eq!(many(0, 3), None);
        assert!(many(300_000, 1).unwrap().contains("far more than there are data"));
        assert!(many(140_000, 2).unwrap().contains("far more than there are data"));
        assert!(many(u64::MAX, 2).unwrap().contains("placements"));
    }
}
