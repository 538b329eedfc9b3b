//! Small files of every format, made from one mesh.

use std::fmt::Write as _;

use collapsar::import::SourceMesh;
use serde_json::{Value, json};

/// A box of quads with a hat of triangles: positions, polygons, a unit normal and a colour for every vertex.
pub struct Made {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colours: Vec<[u8; 3]>,
    pub polygons: Vec<Vec<u32>>,
}

/// The mesh that all files have: 9 vertices, 5 quads and 4 triangles.
pub fn made() -> Made {
    let corner = |n: u32| [(n & 1) as f32, (n >> 1 & 1) as f32, (n >> 2) as f32 * 0.5];
    let mut positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    positions.push([0.5, 0.25, -1.75]);
    let normals = (0..9).map(|n| [[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]][n % 3]).collect();
    let colours = (0..9u8).map(|n| [n * 30, 255 - n * 20, if n % 2 == 0 { 255 } else { 0 }]).collect();
    let quads = [[4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    let hat = [[1, 0, 8], [3, 1, 8], [2, 3, 8], [0, 2, 8]];
    let polygons = quads.iter().map(|q| q.to_vec()).chain(hat.iter().map(|t| t.to_vec())).collect();
    Made { positions, normals, colours, polygons }
}

impl Made {
    /// The polygons as triangles; the quads of this mesh are rectangles, cut from corner 0 to corner 2.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let fan = |polygon: &Vec<u32>| {
            (2..polygon.len()).map(|n| [polygon[0], polygon[n - 1], polygon[n]]).collect::<Vec<_>>()
        };
        self.polygons.iter().flat_map(fan).collect()
    }

    /// All triangles with the positions, normals and colours of their corners: what does not depend on numbering.
    pub fn corners(&self) -> Vec<Corner> {
        let corner = |&v: &u32| {
            let [r, g, b] = self.colours[v as usize];
            (self.positions[v as usize], self.normals[v as usize], [r, g, b, 255])
        };
        self.triangles().iter().flatten().map(corner).collect()
    }
}

/// Position, normal and colour.
pub type Corner = ([f32; 3], [f32; 3], [u8; 4]);

/// The corners of a mesh that was read; zeros for what it has not.
pub fn corners_of(mesh: &SourceMesh) -> Vec<Corner> {
    let of = |v: u32| {
        let v = v as usize;
        (
            mesh.positions[v],
            mesh.normals.get(v).copied().unwrap_or_default(),
            mesh.colours.get(v).copied().unwrap_or_default(),
        )
    };
    mesh.triangles.iter().flatten().map(|&v| of(v)).collect()
}

/// How a PLY file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    Text,
    Little,
    Big,
}

/// A PLY file in the making.
pub struct Ply {
    ends: Ends,
    bytes: Vec<u8>,
}

impl Ply {
    pub fn new(ends: Ends, header: &str) -> Self {
        let format = match ends {
            Ends::Text => "ascii",
            Ends::Little => "binary_little_endian",
            Ends::Big => "binary_big_endian",
        };
        Self { ends, bytes: format!("ply\nformat {format} 1.0\n{header}end_header\n").into_bytes() }
    }

    /// Adds a number of the type that the header has.
    pub fn put(&mut self, kind: &str, number: f64) {
        let mut bytes = match kind {
            "char" | "int8" => (number as i8).to_le_bytes().to_vec(),
            "uchar" | "uint8" => (number as u8).to_le_bytes().to_vec(),
            "short" => (number as i16).to_le_bytes().to_vec(),
            "ushort" => (number as u16).to_le_bytes().to_vec(),
            "int" | "int32" => (number as i32).to_le_bytes().to_vec(),
            "uint" => (number as u32).to_le_bytes().to_vec(),
            "float" | "float32" => (number as f32).to_le_bytes().to_vec(),
            "double" => number.to_le_bytes().to_vec(),
            other => panic!("{other}"),
        };
        match self.ends {
            Ends::Text => bytes = format!("{number} ").into_bytes(),
            Ends::Little => {}
            Ends::Big => bytes.reverse(),
        }
        self.bytes.extend(bytes);
    }

    /// Ends a row.
    pub fn row(&mut self) {
        if self.ends == Ends::Text {
            self.bytes.push(b'\n');
        }
    }

    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// The mesh as PLY, with tables, lists and numbers that are to be skipped everywhere.
pub fn ply(made: &Made, ends: Ends, position: &str, colour: &str, index: &str) -> Vec<u8> {
    let mut header = "comment made by a test\nelement camera 2\nproperty double f\n\
        property list uchar short marks\n"
        .to_owned();
    let count = made.positions.len();
    write!(header, "element vertex {count}\nproperty uchar flag\n").unwrap();
    for axis in ["x", "y", "z"] {
        writeln!(header, "property {position} {axis}").unwrap();
    }
    header += "property float nx\nproperty list ushort char tags\nproperty float ny\nproperty float nz\n";
    for part in ["red", "green", "blue"] {
        writeln!(header, "property {colour} {part}").unwrap();
    }
    write!(header, "element face {}\nproperty float quality\n", made.polygons.len()).unwrap();
    writeln!(header, "property list uchar {index} vertex_indices").unwrap();
    header += "property list uchar float texcoord\nelement edge 1000000000\nproperty int vertex1\n";

    let mut file = Ply::new(ends, &header);
    for camera in 0..2 {
        file.put("double", 0.25);
        file.put("uchar", f64::from(camera));
        (0..camera).for_each(|_| file.put("short", -3.0));
        file.row();
    }
    for v in 0..count {
        file.put("uchar", 7.0);
        made.positions[v].iter().for_each(|&c| file.put(position, c.into()));
        file.put("float", made.normals[v][0].into());
        file.put("ushort", 2.0);
        file.put("char", -1.0);
        file.put("char", 1.0);
        made.normals[v][1..].iter().for_each(|&c| file.put("float", c.into()));
        for &c in &made.colours[v] {
            let number = match colour {
                "uchar" => f64::from(c),
                "ushort" => f64::from(c) * 257.0,
                _ => f64::from(c) / 255.0,
            };
            file.put(colour, number);
        }
        file.row();
    }
    for polygon in &made.polygons {
        file.put("float", 0.5);
        file.put("uchar", polygon.len() as f64);
        polygon.iter().for_each(|&v| file.put(index, v.into()));
        file.put("uchar", 1.0);
        file.put("float", 0.5);
        file.row();
    }
    file.finish()
}

/// The mesh as text STL.
pub fn text_stl(made: &Made, name: &str) -> String {
    let mut text = format!("solid{name}\n");
    for triangle in made.triangles() {
        text += " facet normal 0 0 0\n  outer loop\n";
        for [x, y, z] in triangle.map(|v| made.positions[v as usize]) {
            writeln!(text, "   vertex {x:e} {y} {z:+}").unwrap();
        }
        text += "  endloop\n endfacet\n";
    }
    text + "endsolid\n"
}

/// The mesh as binary STL, with colours where some programs put them.
pub fn binary_stl(made: &Made, header: &str) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.resize(80, b' ');
    let triangles = made.triangles();
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([f32::NAN; 3].iter().flat_map(|c| c.to_le_bytes()));
        let corners = triangle.map(|v| made.positions[v as usize]);
        bytes.extend(corners.iter().flatten().flat_map(|c| c.to_le_bytes()));
        bytes.extend([0xff, 0x83]);
    }
    bytes
}

/// The mesh as OBJ with colours and normals, in two materials of a library.
pub fn obj(made: &Made, library: &str) -> String {
    let mut text = format!("mtllib {library}\no box\n");
    for (position, colour) in made.positions.iter().zip(&made.colours) {
        let [x, y, z] = position;
        let [r, g, b] = colour.map(|c| f32::from(c) / 255.0);
        writeln!(text, "v {x} {y} {z} {r} {g} {b}").unwrap();
    }
    for [x, y, z] in &made.normals {
        writeln!(text, "vn {x} {y} {z}").unwrap();
    }
    for (n, polygon) in made.polygons.iter().enumerate() {
        match n {
            0 => text += "usemtl white\n",
            5 => text += "usemtl red\n",
            _ => {}
        }
        text += "f";
        polygon.iter().for_each(|v| write!(text, " {0}//{0}", v + 1).unwrap());
        text += "\n";
    }
    text
}

/// The library of [`obj`].
pub const LIBRARY: &str = "newmtl white\nKd 1 1 1\nnewmtl red\nKd 1 0 0\n";

/// A GLB file of a JSON document and its binary chunk.
pub fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let word = |number: usize| (number as u32).to_le_bytes();
    let length = word(12 + 8 + json.len() + 8 + binary.len());
    [
        b"glTF" as &[u8],
        &word(2),
        &length,
        &word(json.len()),
        b"JSON",
        &json,
        &word(binary.len()),
        b"BIN\0",
        &binary,
    ]
    .concat()
}

/// A document of one mesh at one node, of the given attributes, accessors and views; accessor 0 has the indices.
pub fn document(attributes: &Value, accessors: &Value, views: &Value, buffers: &Value) -> Value {
    json!({
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 0}]}],
        "accessors": accessors, "bufferViews": views, "buffers": buffers,
    })
}

/// The mesh as GLB without colours.
pub fn plain_glb(made: &Made) -> Vec<u8> {
    let triangles = made.triangles();
    let mut binary: Vec<u8> = bytemuck::cast_slice(&triangles).to_vec();
    let split = binary.len();
    binary.extend_from_slice(bytemuck::cast_slice(&made.positions));
    binary.extend_from_slice(bytemuck::cast_slice(&made.normals));
    let count = made.positions.len();
    let document = document(
        &json!({"POSITION": 1, "NORMAL": 2}),
        &json!([
            {"bufferView": 0, "componentType": 5125, "count": triangles.len() * 3, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"},
            {"bufferView": 1, "byteOffset": count * 12, "componentType": 5126, "count": count, "type": "VEC3"},
        ]),
        &json!([
            {"buffer": 0, "byteLength": split},
            {"buffer": 0, "byteOffset": split, "byteLength": binary.len() - split},
        ]),
        &json!([{"byteLength": binary.len()}]),
    );
    glb(&document, &binary)
}
