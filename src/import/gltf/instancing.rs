//! The tables of `EXT_mesh_gpu_instancing` in, the transforms of a node's copies out.
//!
//! A node with this extension does not place its mesh once, but once for every element of its accessors, each relative
//! to the node: a translation, a rotation and a scale, of which any may be missing.

use std::collections::BTreeMap;

use ::gltf::json::Root;
use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;

use super::accessor::{Accessors, Reader};
use super::buffers::Buffers;
use super::document::Document;
use super::nodes::from_parts;
use crate::import::notes::quoted;
use crate::import::{Problem, check_instance_count};

/// The name of the extension.
pub const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Bytes of memory that a copy takes until the model is baked, at most, but for a long name.
pub const COPY_BYTES: u64 = 400;

/// Copies that a file may have for nothing; beyond these it needs a byte for each.
const FREE_COPIES: usize = 1 << 16;

/// What the extension says, of every node.
#[derive(Default, Deserialize)]
struct Tables {
    #[serde(default)]
    nodes: Vec<Node>,
}

#[derive(Default, Deserialize)]
struct Node {
    #[serde(default)]
    extensions: Option<Extensions>,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(default, rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Attributes>,
}

/// Accessors by the names of attributes; other names than those of [`Copies`] have no meaning here, but a count.
#[derive(Default, Deserialize)]
struct Attributes {
    #[serde(default)]
    attributes: BTreeMap<String, usize>,
}

/// Reads the copies of nodes.
pub struct Instancing<'a> {
    root: &'a Root,
    nodes: Vec<Node>,
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
        let mut names = root.extensions_used.iter().chain(&root.extensions_required);
        let tables: Tables = if names.any(|name| name == EXTENSION) {
            serde_json::from_slice(document.text).map_err(|error| {
                Problem::Malformed(format!("the JSON of {EXTENSION} is malformed ({error})"))
            })?
        } else {
            Tables::default()
        };
        let instancing = Self { root, nodes: tables.nodes, accessors: Accessors::new(root, buffers) };
        let count = instancing.count();
        check_instance_count(count)?;
        if count > buffers.total_bytes().saturating_add(FREE_COPIES) {
            let what = format!("{EXTENSION} promises {count} copies, far more than there are data");
            return Err(Problem::Malformed(what));
        }
        Ok(instancing)
    }

    /// How many copies all nodes have at most.
    pub fn count(&self) -> usize {
        let count = |&accessor: &usize| self.root.accessors.get(accessor).map_or(0, |found| found.count.0);
        let most = |node| self.attributes(node)?.values().map(count).max();
        let all = (0..self.nodes.len()).filter_map(most).fold(0, u64::saturating_add);
        usize::try_from(all).unwrap_or(usize::MAX)
    }

    fn attributes(&self, node: usize) -> Option<&BTreeMap<String, usize>> {
        let attributes = &self.nodes.get(node)?.extensions.as_ref()?.instancing.as_ref()?.attributes;
        (!attributes.is_empty()).then_some(attributes)
    }

    /// Where the copies of a node's mesh are, relative to the node; `None` if the node places its mesh itself.
    ///
    /// # Errors
    ///
    /// [`Problem::Malformed`] for accessors that do not hold what they promise, or do not fit together.
    pub fn copies(&mut self, node: usize) -> Result<Option<Vec<DAffine3>>, Problem> {
        let Some(attributes) = self.attributes(node) else { return Ok(None) };
        let attributes = attributes.clone();
        let mut readers = Vec::with_capacity(attributes.len());
        for (name, accessor) in attributes {
            readers.push((name, self.accessors.get(accessor)?));
        }
        let count = readers.first().map_or(0, |(_, reader)| reader.count);
        let own =
            || quoted(self.root.nodes.get(node).and_then(|node| node.name.as_deref()).unwrap_or_default());
        let malformed = |what: String| Problem::Malformed(format!("node {node} {} {what}", own()));
        if let Some((name, reader)) = readers.iter().find(|(_, reader)| reader.count != count) {
            let what = format!("has {count} copies, but {} {}", reader.count, quoted(name));
            return Err(malformed(what));
        }
        let named = |wanted: &str, components: usize| {
            let reader = readers.iter().find(|(name, _)| name == wanted).map(|(_, reader)| &**reader);
            let fits = reader.is_none_or(|reader| reader.components == components);
            let what = || format!("has a {wanted} of its copies that is not made of {components} numbers");
            if fits { Ok(reader) } else { Err(malformed(what())) }
        };
        let parts = Copies {
            translation: named("TRANSLATION", 3)?,
            rotation: named("ROTATION", 4)?,
            scale: named("SCALE", 3)?,
        };
        Ok(Some((0..count).map(|copy| parts.at(copy)).collect()))
    }
}

/// What makes the transforms of a node's copies.
struct Copies<'r> {
    translation: Option<&'r Reader<'r>>,
    rotation: Option<&'r Reader<'r>>,
    scale: Option<&'r Reader<'r>>,
}

impl Copies<'_> {
    /// The transform of a copy, relative to its node.
    fn at(&self, copy: usize) -> DAffine3 {
        let vector = |reader: Option<&Reader<'_>>, default: [f64; 4]| {
            reader.map_or(default, |reader| reader.vector(copy).map(f64::from))
        };
        let triple = |reader, default| {
            let [x, y, z, _] = vector(reader, [default; 4]);
            DVec3::new(x, y, z)
        };
        let rotation = DQuat::from_array(vector(self.rotation, [0.0, 0.0, 0.0, 1.0]));
        from_parts(triple(self.scale, 1.0), rotation, triple(self.translation, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::nodes::{Placed, walk};
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
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let accessor = |offset: usize, shape: &str| {
            format!(
                r#"{{"bufferView":0,"byteOffset":{offset},"componentType":5126,"count":2,"type":"{shape}"}}"#
            )
        };
        format!(
            r#""buffers":[{{"byteLength":80,"uri":"data:application/octet-stream;base64,{}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":80}}],
            "accessors":[{},{},{},{}]"#,
            base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bytes),
            accessor(0, "VEC3"),
            accessor(24, "VEC4"),
            accessor(56, "VEC3"),
            r#"{"componentType":5126,"count":3,"type":"VEC3"}"#,
        )
    }

    fn walked(nodes: &str) -> Result<Vec<Placed>, String> {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{EXTENSION}"],{},"nodes":[{nodes}]}}"#,
            two_copies()
        );
        let document = document::parse(text.as_bytes()).map_err(|problem| problem.to_string())?;
        let buffers = buffers::load(&document, Path::new("x.gltf")).map_err(|problem| problem.to_string())?;
        let mut instancing = Instancing::of(&document, &buffers).map_err(|problem| problem.to_string())?;
        walk(&document.root, &mut instancing).map_err(|problem| problem.to_string())
    }

    fn node(attributes: &str) -> String {
        format!(
            r#"{{"name":"bolt","mesh":7,"translation":[10,0,0],"extensions":{{"{EXTENSION}":{{"attributes":{{{attributes}}}}}}}}}"#
        )
    }

    #[test]
    fn copies_are_nodes_below_the_one_that_has_them() {
        let all = node(r#""TRANSLATION":0,"ROTATION":1,"SCALE":2,"_ID":0"#);
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
        let placed = walked(&node(r#""_ID":2"#)).unwrap();
        assert_eq!(placed.len(), 3);
        assert!(placed[1].world.transform_point3(DVec3::ZERO).distance(DVec3::new(10.0, 0.0, 0.0)) < 1e-9);
        let placed = walked(&node("")).unwrap();
        assert_eq!((placed.len(), placed[0].mesh), (1, Some(7)));
    }

    #[test]
    fn copies_that_make_no_sense_are_refused() {
        for (attributes, part) in [
            (r#""TRANSLATION":0,"SCALE":3"#, "node 0 \"bolt\" has 3 copies, but 2 \"TRANSLATION\""),
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
        assert!(many(70_000, 1).unwrap().contains("far more than there are data"));
        assert!(many(40_000, 2).unwrap().contains("far more than there are data"));
        assert!(many(u64::MAX, 2).unwrap().contains("placements"));
    }
}
