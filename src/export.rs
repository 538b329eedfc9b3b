//! A container and a level in, an ordinary mesh out, as OBJ or GLB.
//!
//! GLB keeps the parts as meshes and the instances as nodes; OBJ has no instances, so every placement is written out.

use std::io::{self, Write};

use glam::{DAffine3, DVec3};
use rustc_hash::FxHashMap;
use serde_json::json;

use crate::container::{Container, ContainerError, InstanceRow, PartRow};
use crate::geometry::OrderedPart;
use crate::geometry::cell_tree::{drawn_cells, sums_below};
use crate::geometry::part::sampled_count;
use crate::geometry::quantize::{decode_coloured, decode_slotted};
use crate::geometry::record::{Attributes, CellPlace, decode_error};

/// Why nothing could be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The container is damaged.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// No part has the name.
    #[error("there is no part called \"{name}\"; `collapsar info --parts` lists them")]
    NoSuchPart {
        /// The name.
        name: String,
    },
}

/// How fine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Level {
    /// The finest state with at most so many vertices a part.
    Vertices(u32),
    /// The coarsest sampled state with at most this error, in part units.
    Error(f64),
    /// The coarsest state with at least this share of a part's triangles.
    Ratio(f64),
}

/// Meshes and where they are placed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// One piece a part.
    pub pieces: Vec<Piece>,
    /// Placements: index of a piece, transform, sRGB colour.
    pub placements: Vec<(usize, DAffine3, [u8; 4])>,
}

/// One part at one level.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Piece {
    /// The part's name.
    pub name: String,
    /// Positions in part space.
    pub positions: Vec<[f64; 3]>,
    /// Unit normals.
    pub normals: Vec<[f32; 3]>,
    /// sRGB vertex colours, or empty.
    pub colours: Vec<[u8; 4]>,
    /// Vertex indices.
    pub triangles: Vec<[u16; 3]>,
    /// Material slots, one a vertex, until colours stand for them; empty for a part that has none.
    slots: Vec<u8>,
}

/// Takes every part (or those of one name) at a level; only a selection by name leaves the placements out.
///
/// # Errors
/// A damaged container, or a name that no part has.
pub fn level_of_detail(bytes: &[u8], level: Level, name: Option<&str>) -> Result<Mesh, ExportError> {
    let container = Container::open(bytes)?;
    let mut mesh = Mesh::default();
    let mut piece_of = vec![None; container.parts().len()];
    let drawn = Drawn::of(container.parts(), level);
    for (number, row) in container.parts().iter().enumerate() {
        if !drawn.cells[number] || name.is_some_and(|name| name != container.part_name(number)) {
            continue;
        }
        let part = container.read_part(number)?;
        let vn = vertex_count(&part, row, drawn.level_of(number, row));
        piece_of[number] = Some(mesh.pieces.len());
        mesh.pieces.push(piece(&part, container.part_name(number), vn));
    }
    if let (Some(name), true) = (name, mesh.pieces.is_empty()) {
        return Err(ExportError::NoSuchPart { name: name.to_owned() });
    }
    mesh.colour_slots(&container, &piece_of, name.is_some());
    Ok(mesh)
}

const GREY: [u8; 4] = [186, 190, 196, 255];

impl Mesh {
    /// Places the pieces; those with slots become one piece for each combination of materials. `once`: each only
    /// where it is first placed, and there without its transform and colour.
    fn colour_slots(&mut self, container: &Container<'_>, piece_of: &[Option<usize>], once: bool) {
        let mut coloured: FxHashMap<(usize, Vec<[u8; 4]>), usize> = FxHashMap::default();
        let mut placed = vec![false; self.pieces.len()];
        for instance in container.instances() {
            let Some(piece) = piece_of[instance.part as usize] else { continue };
            if once && std::mem::replace(&mut placed[piece], true) {
                continue;
            }
            let colours = self.pieces[piece].slot_colours(container, instance);
            let piece = match colours.is_empty() {
                true => piece,
                false => *coloured.entry((piece, colours)).or_insert_with_key(|(piece, colours)| {
                    self.pieces.push(self.pieces[*piece].with_slot_colours(colours));
                    self.pieces.len() - 1
                }),
            };
            let colour = container.materials()[instance.material as usize].base_colour;
            let (transform, colour) =
                if once { (DAffine3::IDENTITY, GREY) } else { (instance.transform(), colour) };
            self.placements.push((piece, transform, colour));
        }
        self.drop_unplaced();
    }

    /// Drops pieces with slots, for which coloured ones stand.
    fn drop_unplaced(&mut self) {
        let mut new_number = Vec::with_capacity(self.pieces.len());
        let mut next = 0;
        for piece in &self.pieces {
            new_number.push(next);
            next += usize::from(piece.slots.is_empty());
        }
        self.pieces.retain(|piece| piece.slots.is_empty());
        for (piece, _, _) in &mut self.placements {
            *piece = new_number[*piece];
        }
    }
}

impl Piece {
    /// The colours of the slots of a piece for an instance; empty for a piece without slots.
    fn slot_colours(&self, container: &Container<'_>, instance: &InstanceRow) -> Vec<[u8; 4]> {
        let slots = if self.slots.is_empty() { 0 } else { container.parts()[instance.part as usize].slots };
        let materials = container.materials()[instance.material as usize..].iter();
        materials.take(slots as usize).map(|material| material.base_colour).collect()
    }

    fn with_slot_colours(&self, colours: &[[u8; 4]]) -> Self {
        let colour = |&slot: &u8| colours.get(usize::from(slot)).copied().unwrap_or(GREY);
        let colours = self.slots.iter().map(colour).collect();
        Self { colours, slots: Vec::new(), ..self.clone() }
    }
}

/// Which cells of parts with parent cells stand for them at a level.
struct Drawn {
    level: Level,
    cells: Vec<bool>,
    /// For every part, vertices of its leaf cells and of the leaf cells of its whole part; triangles of its leaf cells.
    vertices: Vec<u64>,
    vertices_of_source: Vec<u64>,
    triangles: Vec<u64>,
}

impl Drawn {
    fn of(rows: &[PartRow], level: Level) -> Self {
        let places: Vec<CellPlace> = rows.iter().map(PartRow::place).collect();
        let vertices = sums_below(&places, |i| rows[i].vertices.into());
        let triangles = sums_below(&places, |i| rows[i].triangles.into());
        let mut vertices_of_source: Vec<u64> = vertices.clone();
        for (i, place) in places.iter().enumerate().filter(|(_, place)| place.parent_distance > 0) {
            vertices_of_source[i] = vertices_of_source[i - place.parent_distance as usize];
        }
        let mut drawn = Self { level, cells: Vec::new(), vertices, vertices_of_source, triangles };
        let is_enough = |i: usize| match drawn.level_of(i, &rows[i]) {
            Level::Vertices(vertices) => vertices <= rows[i].vertices,
            Level::Error(error) => decode_error(rows[i].errors[0], diagonal(&rows[i])) <= error,
            Level::Ratio(ratio) => ratio <= 1.0,
        };
        drawn.cells = drawn_cells(&places, is_enough);
        drawn
    }

    /// The level of the whole part in terms of one of its cells: its share of the vertices, or for a parent cell the
    /// share of its own triangles that is the wanted share of all those that it stands for.
    fn level_of(&self, part: usize, row: &PartRow) -> Level {
        match self.level {
            Level::Vertices(vertices) => {
                let share = self.vertices[part] as f64 / self.vertices_of_source[part].max(1) as f64;
                Level::Vertices((f64::from(vertices) * share).round() as u32)
            }
            Level::Error(error) => Level::Error(error),
            Level::Ratio(ratio) => {
                Level::Ratio(ratio * self.triangles[part] as f64 / f64::from(row.triangles.max(1)))
            }
        }
    }
}

fn diagonal(row: &PartRow) -> f64 {
    let [low, high] = row.bounds().map(DVec3::from);
    (high - low).length()
}

/// The state of a part that a level asks for.
fn vertex_count(part: &OrderedPart, row: &PartRow, level: Level) -> u32 {
    let m = part.vertices.len() as u32;
    let at = &part.triangles_at;
    let wanted = match level {
        Level::Vertices(vertices) => at.state_at_most(vertices as usize) as u32,
        Level::Error(error) => {
            let diagonal = diagonal(row);
            let sampled = part.errors.iter().enumerate().rev();
            let allowed = sampled.filter(|&(_, &code)| decode_error(code, diagonal) <= error);
            // A sample's error is that of the state at or below its count.
            allowed.map(|(j, _)| at.state_at_most(sampled_count(m, j) as usize) as u32).next().unwrap_or(m)
        }
        Level::Ratio(ratio) => part.state_with_triangles(f64::from(part.triangle_count()) * ratio),
    };
    wanted.clamp(part.locked, m)
}

fn piece(part: &OrderedPart, name: &str, vn: u32) -> Piece {
    let vertices = &part.vertices[..vn as usize];
    Piece {
        name: name.to_owned(),
        positions: vertices.iter().map(|vertex| part.grid.position(vertex.grid())).collect(),
        normals: vertices.iter().map(|vertex| vertex.normal(part.attributes)).collect(),
        colours: match part.attributes {
            Attributes::Colour => {
                vertices.iter().map(|vertex| decode_coloured(vertex.attributes()).1).collect()
            }
            _ => Vec::new(),
        },
        slots: match part.attributes {
            Attributes::Slot => vertices.iter().map(|vertex| decode_slotted(vertex.attributes()).1).collect(),
            _ => Vec::new(),
        },
        triangles: part.reformed(vn),
    }
}

impl Mesh {
    /// Vertices of all pieces.
    pub fn vertex_count(&self) -> usize {
        self.pieces.iter().map(|piece| piece.positions.len()).sum()
    }

    /// Triangles of all pieces.
    pub fn triangle_count(&self) -> usize {
        self.pieces.iter().map(|piece| piece.triangles.len()).sum()
    }

    /// Writes an OBJ file, every placement as an object of its own in world space.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_obj(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "# written by collapsar")?;
        let mut base = 1;
        for (number, (piece, world_from_part, _)) in self.placements.iter().enumerate() {
            let piece = &self.pieces[*piece];
            writeln!(out, "o {}_{number}", obj_name(&piece.name))?;
            piece.write_obj(out, *world_from_part, base)?;
            base += piece.positions.len();
        }
        Ok(())
    }

    /// Writes a binary glTF file.
    ///
    /// # Errors
    /// Those of the writer, and a mesh of 4 GiB or more.
    pub fn write_glb(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut glb = Glb::default();
        for piece in &self.pieces {
            glb.add_piece(piece);
        }
        let root = glb.root(self);
        let mut json = serde_json::to_vec(&root)?;
        json.resize(json.len().next_multiple_of(4), b' ');
        glb.bytes.resize(glb.bytes.len().next_multiple_of(4), 0);
        let total = 12 + 8 + json.len() + 8 + glb.bytes.len();
        let size = |len: usize| {
            let too_large =
                |_| io::Error::new(io::ErrorKind::FileTooLarge, "a GLB file holds less than 4 GiB");
            u32::try_from(len).map(u32::to_le_bytes).map_err(too_large)
        };
        out.write_all(b"glTF")?;
        out.write_all(&2u32.to_le_bytes())?;
        out.write_all(&size(total)?)?;
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &glb.bytes)] {
            out.write_all(&size(chunk.len())?)?;
            out.write_all(kind)?;
            out.write_all(chunk)?;
        }
        Ok(())
    }
}

/// A name that is one word of an OBJ file.
fn obj_name(name: &str) -> String {
    let word: String =
        name.chars().take(200).map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
    if word.is_empty() { "part".to_owned() } else { word }
}

impl Piece {
    fn write_obj(&self, out: &mut dyn Write, world_from_part: DAffine3, base: usize) -> io::Result<()> {
        let linear = world_from_part.matrix3;
        // The cofactor matrix carries normals right whatever the transform, even where there is no inverse.
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let cofactors = [y.cross(z), z.cross(x), x.cross(y)];
        let mirrored = linear.determinant() < 0.0;
        for position in &self.positions {
            let p = world_from_part.transform_point3(DVec3::from_array(*position));
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for normal in &self.normals {
            let n = normal.map(f64::from);
            let turned = cofactors[0] * n[0] + cofactors[1] * n[1] + cofactors[2] * n[2];
            let n = (if mirrored { -turned } else { turned }).normalize_or(DVec3::Z).as_vec3();
            writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
        }
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|vertex| base + usize::from(vertex));
            let [b, c] = if mirrored { [c, b] } else { [b, c] };
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        Ok(())
    }
}

/// A GLB file in the making: its binary chunk and the JSON that describes it.
#[derive(Default)]
struct Glb {
    bytes: Vec<u8>,
    views: Vec<serde_json::Value>,
    accessors: Vec<serde_json::Value>,
    /// Per piece: its primitive without a material, or `None` for one without triangles.
    primitives: Vec<Option<serde_json::Value>>,
}

const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
const FLOAT: u32 = 5_126;
const UNSIGNED_SHORT: u32 = 5_123;
const UNSIGNED_BYTE: u32 = 5_121;

impl Glb {
    fn add_view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view =
            json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target});
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn add_accessor(&mut self, mut accessor: serde_json::Value, bytes: &[u8], target: u32) -> usize {
        accessor["bufferView"] = self.add_view(bytes, target).into();
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn add_piece(&mut self, piece: &Piece) {
        if piece.triangles.is_empty() {
            self.primitives.push(None);
            return;
        }
        let positions: Vec<[f32; 3]> = piece.positions.iter().map(|p| p.map(|c| c as f32)).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            positions.iter().copied().reduce(|a, b| std::array::from_fn(|i| pick(a[i], b[i])))
        };
        let count = positions.len();
        let vec3 = |kind: &str| json!({"componentType": FLOAT, "count": count, "type": kind});
        let mut described = vec3("VEC3");
        described["min"] = json!(bound(f32::min));
        described["max"] = json!(bound(f32::max));
        let position = self.add_accessor(described, bytemuck::cast_slice(&positions), ARRAY_BUFFER);
        let normal = self.add_accessor(vec3("VEC3"), bytemuck::cast_slice(&piece.normals), ARRAY_BUFFER);
        let mut attributes = json!({"POSITION": position, "NORMAL": normal});
        if !piece.colours.is_empty() {
            let linear: Vec<[u8; 4]> = piece.colours.iter().map(|&c| linear_bytes(c)).collect();
            let accessor =
                json!({"componentType": UNSIGNED_BYTE, "normalized": true, "count": count, "type": "VEC4"});
            attributes["COLOR_0"] =
                self.add_accessor(accessor, bytemuck::cast_slice(&linear), ARRAY_BUFFER).into();
        }
        let indices = json!({
            "componentType": UNSIGNED_SHORT, "count": 3 * piece.triangles.len(), "type": "SCALAR"
        });
        let indices =
            self.add_accessor(indices, bytemuck::cast_slice(&piece.triangles), ELEMENT_ARRAY_BUFFER);
        self.primitives.push(Some(json!({"attributes": attributes, "indices": indices})));
    }

    /// The JSON: one mesh for every (piece, colour) that is placed, one node for every placement.
    fn root(&self, mesh: &Mesh) -> serde_json::Value {
        let mut meshes: Vec<(usize, [u8; 4])> = mesh.placements.iter().map(|&(p, _, c)| (p, c)).collect();
        meshes.retain(|&(piece, _)| self.primitives[piece].is_some());
        meshes.sort_unstable();
        meshes.dedup();
        let mut colours: Vec<[u8; 4]> = meshes.iter().map(|&(_, colour)| colour).collect();
        colours.sort_unstable();
        colours.dedup();
        let described = meshes.iter().map(|&(piece, colour)| {
            let mut primitive = self.primitives[piece].clone().unwrap_or_default();
            primitive["material"] = colours.partition_point(|&c| c < colour).into();
            json!({"name": mesh.pieces[piece].name, "primitives": [primitive]})
        });
        let nodes: Vec<serde_json::Value> = mesh
            .placements
            .iter()
            .filter(|&&(piece, _, _)| self.primitives[piece].is_some())
            .map(|&(piece, transform, colour)| {
                let index = meshes.partition_point(|&entry| entry < (piece, colour));
                json!({"mesh": index, "matrix": matrix(transform)})
            })
            .collect();
        json!({
            "asset": {"version": "2.0", "generator": "collapsar"},
            "scene": 0,
            "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
            "meshes": described.collect::<Vec<_>>(),
            "nodes": nodes,
            "materials": colours.iter().map(|&colour| material(colour)).collect::<Vec<_>>(),
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len().next_multiple_of(4)}],
        })
    }
}

fn matrix(transform: DAffine3) -> [f64; 16] {
    glam::DMat4::from(transform).to_cols_array()
}

fn material(colour: [u8; 4]) -> serde_json::Value {
    let [r, g, b, a] = colour;
    let linear = [linear(r), linear(g), linear(b), f64::from(a) / 255.0];
    json!({
        "pbrMetallicRoughness": {"baseColorFactor": linear, "metallicFactor": 0.0, "roughnessFactor": 0.6},
        "doubleSided": true,
    })
}

/// sRGB to linear light (IEC 61966-2-1).
fn linear(byte: u8) -> f64 {
    let c = f64::from(byte) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn linear_bytes([r, g, b, a]: [u8; 4]) -> [u8; 4] {
    let byte = |c: u8| (linear(c) * 255.0).round() as u8;
    [byte(r), byte(g), byte(b), a]
}
