//! The node table of a document in, its tree in an order that has parents first out.

use ::gltf::json::{Node as JsonNode, Root};
use glam::{DAffine3, DMat4, DQuat, DVec3};

use super::instancing::Instancing;
use crate::import::notes::quoted;
use crate::import::{Node, Problem, index_of, shared_name};

/// A node of the tree with its place in the world, or one of the copies of its mesh.
pub struct Placed {
    /// Its name, and its parent in the list of placed nodes.
    pub node: Node,
    /// The node that it is or is a copy of, an index into the document's table.
    pub index: usize,
    /// The mesh that it places, an index into the document's table, not checked.
    pub mesh: Option<usize>,
    /// Node space to world space; may be anything, also not finite.
    pub world: DAffine3,
}

/// Lists the nodes below the roots of the default scene: of the first one if none is said to be the default,
/// and below all nodes without a parent if there is no scene. A node whose mesh has copies does not place it, but has a
/// node for each copy below it.
///
/// Takes no stack for depth.
///
/// # Errors
///
/// [`Problem::Malformed`] for a node that is not there, or one that is reached twice, and for copies that make no sense.
pub fn walk(root: &Root, mut instancing: Instancing<'_>) -> Result<Vec<Placed>, Problem> {
    let mut placed: Vec<Placed> = Vec::new();
    let mut reached = vec![false; root.nodes.len()];
    // Nodes to visit with their parents; the last is the next.
    let mut waiting: Vec<(usize, Option<u32>)> =
        roots(root)?.into_iter().rev().map(|node| (node, None)).collect();
    while let Some((index, parent)) = waiting.pop() {
        let node = reach(root, index, &mut reached)?;
        let above = parent.map_or(DAffine3::IDENTITY, |parent| placed[parent as usize].world);
        let number = index_of(placed.len())?;
        let children = node.children.iter().flatten().rev();
        waiting.extend(children.map(|child| (child.value(), Some(number))));
        let mesh = node.mesh.map(|mesh| mesh.value());
        let copies = mesh.map(|_| instancing.copies(index)).transpose()?.flatten();
        let own = Placed {
            node: Node { name: node.name.clone().unwrap_or_default(), parent },
            index,
            mesh: mesh.filter(|_| copies.is_none()),
            world: above * local_transform(node),
        };
        placed.push(own);
        for (nth, from_copy) in copies.into_iter().flatten().enumerate() {
            let copy = placed[number as usize].copy(nth, number, mesh, from_copy);
            placed.push(copy);
        }
    }
    Ok(placed)
}

impl Placed {
    /// A copy of its mesh, at a place relative to it; `number` is its own.
    fn copy(&self, nth: usize, number: u32, mesh: Option<usize>, from_copy: DAffine3) -> Self {
        let own = &self.node.name;
        let name = if own.is_empty() { String::new() } else { format!("{} {}", shared_name(own), nth + 1) };
        let node = Node { name, parent: Some(number) };
        Self { node, index: self.index, mesh, world: self.world * from_copy }
    }
}

/// Looks a node up and marks it.
fn reach<'a>(root: &'a Root, index: usize, reached: &mut [bool]) -> Result<&'a JsonNode, Problem> {
    let node = root.nodes.get(index);
    let node = node
        .ok_or_else(|| Problem::Malformed(format!("node {index} is not there, but is a child or a root")))?;
    if std::mem::replace(&mut reached[index], true) {
        let name = quoted(node.name.as_deref().unwrap_or_default());
        let what =
            format!("the nodes are no tree: node {index} {name} is its own ancestor, or has two parents");
        return Err(Problem::Malformed(what));
    }
    Ok(node)
}

/// The nodes to begin with.
fn roots(root: &Root) -> Result<Vec<usize>, Problem> {
    let scene = root.scene.map_or(0, |scene| scene.value());
    if let Some(scene) = root.scenes.get(scene) {
        return Ok(scene.nodes.iter().map(|node| node.value()).collect());
    }
    if root.scene.is_some() {
        return Err(Problem::Malformed(format!("scene {scene} is the default, but is not there")));
    }
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(mark) = is_child.get_mut(child.value()) {
            *mark = true;
        }
    }
    let found: Vec<usize> = (0..root.nodes.len()).filter(|&node| !is_child[node]).collect();
    if found.is_empty() && !root.nodes.is_empty() {
        return Err(Problem::Malformed("the nodes are no tree: every one is a child of another".to_owned()));
    }
    Ok(found)
}

/// The transform of a node relative to its parent.
fn local_transform(node: &JsonNode) -> DAffine3 {
    if let Some(matrix) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)));
    }
    let triple = |value: Option<[f32; 3]>, default: DVec3| {
        value.map_or(default, |v| DVec3::from_array(v.map(f64::from)))
    };
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |r| DQuat::from_array(r.0.map(f64::from)));
    from_parts(triple(node.scale, DVec3::ONE), rotation, triple(node.translation, DVec3::ZERO))
}

/// Scales, then turns, then moves.
pub fn from_parts(scale: DVec3, rotation: DQuat, translation: DVec3) -> DAffine3 {
    // A rotation of length zero turns nothing; one that is not finite stays so, and its node is skipped.
    let rotation = if rotation.length_squared() == 0.0 { DQuat::IDENTITY } else { rotation.normalize() };
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

#[cfg(test)]
mod tests {
    use super::super::{buffers, document};
    use super::*;

    fn walked(tables: &str) -> Result<Vec<Placed>, String> {
        let text = format!(r#"{{"asset":{{"version":"2.0"}},{tables}}}"#);
        let document = document::parse(text.as_bytes()).unwrap();
        let buffers = buffers::load(&document, std::path::Path::new("x.gltf")).unwrap();
        let instancing = Instancing::of(&document, &buffers).unwrap();
        walk(&document.root, instancing).map_err(|problem| problem.to_string())
    }

    #[test]
    fn parents_come_first_and_transforms_multiply() {
        let nodes = r#""scenes":[{"nodes":[1,0]}],"nodes":[
            {"name":"leaf"},
            {"name":"top","translation":[1,2,3],"scale":[2,2,2],"rotation":[0,0,0,0],"children":[3,2]},
            {"name":"c","mesh":5},
            {"name":"b","matrix":[1,0,0,0, 0,1,0,0, 0,0,-1,0, 10,0,0,1]}]"#;
        let placed = walked(nodes).unwrap();
        let tree: Vec<_> = placed.iter().map(|p| (p.node.name.as_str(), p.node.parent)).collect();
        assert_eq!(tree, [("top", None), ("b", Some(0)), ("c", Some(0)), ("leaf", None)]);
        assert_eq!(placed[1].world.transform_point3(DVec3::Z), DVec3::new(21.0, 2.0, 1.0));
        assert_eq!(placed[2].mesh, Some(5));
    }

    #[test]
    fn without_a_scene_nodes_without_parent_are_roots() {
        let placed = walked(r#""nodes":[{"name":"a"},{"name":"b","children":[0]},{"name":"c"}]"#).unwrap();
        let names: Vec<_> = placed.iter().map(|p| p.node.name.as_str()).collect();
        assert_eq!(names, ["b", "a", "c"]);
    }

    #[test]
    fn what_is_no_tree_is_an_error() {
        for (nodes, part) in [
            (
                r#""scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"name":"b","children":[0]}]"#,
                "no tree: node 0 \"\"",
            ),
            (r#""nodes":[{"children":[1]},{"children":[0]}]"#, "every one is a child"),
            (r#""nodes":[{"children":[2]},{"children":[2]},{"name":"c"}]"#, "no tree: node 2 \"c\""),
            (r#""nodes":[{"children":[7]}]"#, "node 7 is not there"),
            (r#""scene":3,"nodes":[{}]"#, "scene 3 is the default"),
            (r#""scenes":[{"nodes":[0,0]}],"nodes":[{}]"#, "no tree"),
        ] {
            let message = walked(nodes).err().unwrap();
            assert!(message.contains(part), "{message}");
        }
    }
}
