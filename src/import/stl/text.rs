//! The text of an STL file in, a [`Model`] with one mesh and one node a solid out.

use std::io::BufRead;

use glam::DAffine3;

use super::Merger;
use crate::import::input::read_line;
use crate::import::notes::{Notes, quoted};
use crate::import::{Instance, Material, Model, Node, Problem, Shelf, SourceMesh, index_of};

/// Whether a file that begins like this is text: it has words of STL, and no byte that is no text.
pub fn is_text(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).to_ascii_lowercase();
    let is_control = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    let has_words =
        head.trim_ascii_start().starts_with(b"solid") || head.windows(5).any(|word| word == b"facet");
    has_words && !head.iter().any(is_control)
}

/// Reads all solids; those without a name get `stem`.
///
/// # Errors
///
/// Those of `input`. Facets that are not three vertices of three numbers are skipped and noted.
pub fn read(input: &mut dyn BufRead, stem: &str, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
    let mut reader = Reader::default();
    let mut line = Vec::new();
    while read_line(input, &mut line)? {
        reader.line += 1;
        reader.statement(String::from_utf8_lossy(&line).trim_start_matches('\u{feff}').trim());
        line.clear();
    }
    reader.end_solid();
    reader.into_model(stem, shelf)
}

#[derive(Default)]
struct Reader {
    line: u64,
    /// The name of the solid being read.
    name: String,
    merger: Merger,
    facet: Facet,
    solids: Vec<(String, SourceMesh)>,
    notes: Notes,
}

/// The corners of the facet being read.
#[derive(Default)]
struct Facet {
    corners: Vec<[f32; 3]>,
    /// Where its first bad corner is, and why that is bad.
    fault: Option<(u64, String)>,
}

/// More corners than a facet may have are not kept.
const MAX_CORNERS: usize = 4;

impl Reader {
    fn statement(&mut self, statement: &str) {
        let (keyword, rest) = statement.split_once([' ', '\t']).unwrap_or((statement, ""));
        match keyword.to_ascii_lowercase().as_str() {
            "solid" => {
                self.end_solid();
                self.name = rest.trim().to_owned();
            }
            "facet" => self.facet = Facet::default(),
            "vertex" => self.corner(rest),
            "endfacet" => self.end_facet(),
            // The order of these says nothing that the corners do not.
            "" | "outer" | "endloop" | "endsolid" => {}
            _ => {
                let line = self.line;
                self.notes.count("lines skipped that are not of STL", 1, || {
                    format!("line {line}: {}", quoted(statement))
                });
            }
        }
    }

    fn corner(&mut self, text: &str) {
        let line = self.line;
        let mut words = text.split_ascii_whitespace();
        let mut number = || {
            let word = words.next().unwrap_or_default();
            word.parse::<f32>().map_err(|_| (line, format!("{} is not a number", quoted(word))))
        };
        match (number(), number(), number()) {
            (Ok(x), Ok(y), Ok(z)) if self.facet.corners.len() < MAX_CORNERS => {
                self.facet.corners.push([x, y, z])
            }
            (Ok(_), Ok(_), Ok(_)) => {}
            (Err(fault), _, _) | (_, Err(fault), _) | (_, _, Err(fault)) => {
                self.facet.fault.get_or_insert(fault);
            }
        }
    }

    fn end_facet(&mut self) {
        let facet = std::mem::take(&mut self.facet);
        let line = self.line;
        match (&facet.corners[..], facet.fault) {
            (&[a, b, c], None) => self.merger.add([a, b, c]),
            (_, fault) => {
                let what = "facets skipped that are not three vertices of three numbers";
                let (line, why) = fault.unwrap_or((line, "it ends here".to_owned()));
                self.notes.count(what, 1, || format!("line {line}: {why}"));
            }
        }
    }

    fn end_solid(&mut self) {
        let merger = std::mem::take(&mut self.merger);
        let mesh = merger.finish(&mut self.notes);
        let name = std::mem::take(&mut self.name);
        if !mesh.triangles.is_empty() {
            self.solids.push((name, mesh));
        }
    }

    fn into_model(self, stem: &str, shelf: Shelf) -> Result<Model<Shelf>, Problem> {
        let materials = vec![Material::default()];
        let mut model = Model { meshes: shelf, materials, ..Model::default() };
        for (name, mut mesh) in self.solids {
            let number = index_of(model.meshes.len())?;
            mesh.name = if name.is_empty() { stem.to_owned() } else { name };
            mesh.body = number;
            model.nodes.push(Node { name: mesh.name.clone(), parent: None });
            model.meshes.push(mesh)?;
            let world_from_part = DAffine3::IDENTITY;
            model.instances.push(Instance { mesh: number, node: number, material: 0, world_from_part });
        }
        model.notes = self.notes.into_lines();
        Ok(model)
    }
}
