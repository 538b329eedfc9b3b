//! Names of material libraries in, materials out; what cannot be found or read is noted.

use std::fs;
use std::path::{Path, PathBuf};

use rustc_hash::{FxHashMap, FxHashSet};

use crate::import::attributes::channel;
use crate::import::notes::{Notes, quoted};
use crate::import::{Material, Problem, folder};

/// All materials of a file.
#[derive(Debug)]
pub struct Materials {
    /// The materials, of which the first is the default.
    pub list: Vec<Material>,
    /// Indices by name; the last definition counts.
    pub by_name: FxHashMap<String, u32>,
}

/// Reads the libraries that the OBJ file `from` names.
pub fn read(from: &Path, libraries: &[String], notes: &mut Notes) -> Materials {
    let mut materials = Materials { list: vec![Material::default()], by_name: FxHashMap::default() };
    let mut seen = FxHashSet::default();
    for library in libraries {
        for result in paths_of(from, library) {
            let loaded =
                result.and_then(|path| if seen.insert(path.clone()) { load(&path) } else { Ok(Vec::new()) });
            match loaded {
                Ok(list) => list.into_iter().for_each(|material| materials.push(material)),
                Err(problem) => {
                    let what = "material libraries skipped";
                    notes.count(what, 1, || format!("{problem}, named in {}", quoted(library)));
                }
            }
        }
    }
    materials
}

/// The files of an `mtllib` line: one whose name has spaces, or several.
fn paths_of(from: &Path, library: &str) -> Vec<Result<PathBuf, Problem>> {
    let whole = folder::resolve(from, library);
    if whole.is_ok() || !library.contains([' ', '\t']) {
        return vec![whole];
    }
    library.split_ascii_whitespace().map(|name| folder::resolve(from, name)).collect()
}

/// Reads one library: of every material the last colour and the last opacity that make sense, whatever else is wrong.
fn load(path: &Path) -> Result<Vec<Material>, Problem> {
    let text = fs::read(path).map_err(Problem::Read)?;
    let mut materials = Vec::new();
    String::from_utf8_lossy(&text).lines().for_each(|line| read_line(line.trim(), &mut materials));
    Ok(materials)
}

fn read_line(line: &str, materials: &mut Vec<Material>) {
    let Some((keyword, rest)) = line.split_once([' ', '\t']) else { return };
    let rest = rest.trim();
    if keyword == "newmtl" {
        return materials.push(Material { name: rest.to_owned(), ..Material::default() });
    }
    let Some(Material { base_colour: [r, g, b, alpha], .. }) = materials.last_mut() else { return };
    let numbers: Vec<f32> = rest.split_whitespace().map_while(|word| word.parse().ok()).collect();
    match (keyword, &numbers[..]) {
        ("Kd", &[red, green, blue, ..]) => [*r, *g, *b] = [red, green, blue].map(channel),
        ("Kd", &[grey]) => [*r, *g, *b] = [channel(grey); 3],
        ("d", &[opacity, ..]) => *alpha = channel(opacity),
        ("Tr", &[transparency, ..]) => *alpha = channel(1.0 - transparency),
        _ => {}
    }
}

impl Materials {
    fn push(&mut self, material: Material) {
        self.by_name.insert(material.name.clone(), self.list.len() as u32);
        self.list.push(material);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> (Materials, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("my lib.mtl"), text).unwrap();
        fs::write(folder.path().join("b.mtl"), "newmtl b\nKd 0 1 0").unwrap();
        let libraries = ["my lib.mtl", "b.mtl none.mtl", "../x.mtl"].map(str::to_owned);
        let mut notes = Notes::default();
        let materials = read(&folder.path().join("m.obj"), &libraries, &mut notes);
        (materials, notes.into_lines())
    }

    #[test]
    fn colours_and_alpha_are_read_whatever_else_is_wrong() {
        let text = "newmtl\nnewmtl a a\n\tKd\t1.0 0.5 0\nd 0.5\nKa 1\nillum x\nmap_Kd\nnewmtl grey\nKd 0.2\n\
            newmtl spectral\nKd spectral x.rfl\nTr 0.25\n";
        let (materials, notes) = read_text(text);
        let colour = |name: &str| materials.list[materials.by_name[name] as usize].base_colour;
        assert_eq!(colour("a a"), [255, 128, 0, 128]);
        assert_eq!(colour("grey"), [51, 51, 51, 255]);
        assert_eq!(colour("spectral"), [186, 190, 196, 191]);
        assert_eq!(colour("b"), [0, 255, 0, 255]);
        assert_eq!(notes.len(), 1);
        assert!(
            notes[0].starts_with("2 material libraries skipped (first: refers to \"none.mtl\""),
            "{}",
            notes[0]
        );
    }
}
