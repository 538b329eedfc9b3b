//! What the user calls things: the assembly tree, and the names in a container's tables.

use super::opened::Scene;
use crate::container::format::{MaterialRow, NO_PARENT, NodeRow};

/// What stands between the names of a path in the assembly tree.
pub const PATH_SEPARATOR: &str = " / ";

impl Scene {
    /// The nodes of the assembly tree, parents before their children.
    pub fn nodes(&self) -> &[NodeRow] {
        self.rows(&self.nodes)
    }

    /// The materials.
    pub fn materials(&self) -> &[MaterialRow] {
        self.rows(&self.materials)
    }

    /// The name of a node; may be empty.
    pub fn node_name(&self, node: u32) -> &str {
        self.nodes().get(node as usize).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    /// The name of a part; may be empty.
    pub fn part_name(&self, part: u32) -> &str {
        self.parts().get(part as usize).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    /// The name of a material; may be empty.
    pub fn material_name(&self, material: u32) -> &str {
        self.materials().get(material as usize).map_or("", |row| self.name(row.name_offset, row.name_bytes))
    }

    /// The parent of a node, if it has one.
    pub fn parent_node(&self, node: u32) -> Option<u32> {
        self.nodes().get(node as usize).map(|row| row.parent).filter(|&parent| parent != NO_PARENT)
    }

    /// The names from the root down to a node.
    pub fn node_path(&self, node: u32) -> String {
        let up = std::iter::successors(Some(node), |&node| self.parent_node(node));
        let mut names: Vec<&str> =
            up.map(|node| self.node_name(node)).filter(|name| !name.is_empty()).collect();
        names.reverse();
        names.join(PATH_SEPARATOR)
    }

    fn name(&self, offset: u64, bytes: u32) -> &str {
        let names: &[u8] = self.rows(&self.names);
        let range = offset as usize..offset as usize + bytes as usize;
        // The container has checked that names are inside the section, and all of it UTF-8.
        names.get(range).and_then(|name| std::str::from_utf8(name).ok()).unwrap_or("")
    }
}
