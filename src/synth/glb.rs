//! A plan in, a binary glTF file out, mesh by mesh: one buffer, meshes shared between the nodes that place them, and the
//! assembly tree as it is.
//!
//! The JSON comes before the buffer and must say where each mesh lies in it, so that every mesh is made twice: once to be
//! measured, once to be written. What is kept between is 32 bytes a mesh, beside the outline.

use std::io::{self, Write};
use std::ops::ControlFlow;

use glam::Vec3;

use super::{Outline, Plan, stream};
use crate::import::{Material, SourceMesh};

/// A GLB file states its sizes in 32 bits.
const LARGEST: u64 = u32::MAX as u64;

/// Why no GLB file was written.
#[derive(Debug, thiserror::Error)]
pub enum GlbError {
    /// The file would be too large.
    #[error(
        "a GLB file holds less than 4 GiB, and this model needs {}{bytes} bytes: ask for at most about {triangles} \
         triangles, or write OBJ or a container", if *.at_least { "at least " } else { "" }
    )]
    TooLarge {
        /// How large it would be.
        bytes: u64,
        /// Whether it may be larger still.
        at_least: bool,
        /// How many triangles would fit.
        triangles: u64,
    },
    /// The system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The user asked to stop while the meshes were measured.
    #[error("interrupted")]
    Interrupted,
}

/// What is known of a mesh before it is written.
#[derive(Debug, Clone, Copy)]
struct Measured {
    vertices: u32,
    low: [f32; 3],
    high: [f32; 3],
}

impl Measured {
    fn of(mesh: &SourceMesh) -> Self {
        let positions = mesh.positions.iter().map(|&position| Vec3::from(position));
        let around = |[low, high]: [Vec3; 2], point: Vec3| [low.min(point), high.max(point)];
        let [low, high] = positions.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], around);
        Self { vertices: mesh.positions.len() as u32, low: low.to_array(), high: high.to_array() }
    }

    /// Whether 16 bits hold its indices; the greatest is not an index in glTF.
    fn has_short_indices(&self) -> bool {
        self.vertices < 0xffff
    }

    fn index_bytes(&self, triangles: u64) -> u64 {
        (triangles * if self.has_short_indices() { 6 } else { 12 }).next_multiple_of(4)
    }

    /// Positions and normals of 12 bytes each, then indices.
    fn bytes(&self, triangles: u64) -> u64 {
        u64::from(self.vertices) * 24 + self.index_bytes(triangles)
    }
}

/// A plan whose meshes have been measured, and that fits a GLB file.
#[derive(Debug)]
pub struct Glb<'a> {
    plan: &'a Plan,
    outline: Outline,
    meshes: Vec<Measured>,
    json_bytes: u64,
    buffer_bytes: u64,
}

impl<'a> Glb<'a> {
    /// Makes every mesh once to measure it. `done` hears of triangles, and says whether to go on.
    ///
    /// # Errors
    /// A model that is too large, early if that is plain, or an interruption.
    pub fn measure(plan: &'a Plan, mut done: impl FnMut(u64) -> bool) -> Result<Self, GlbError> {
        // No mesh has fewer vertices than half its triangles; indices have two bytes at least.
        let least = plan.triangle_count().saturating_mul(18);
        if least > LARGEST {
            return Err(too_large(plan, least, true));
        }
        let mut meshes = Vec::with_capacity(plan.mesh_count() as usize);
        let stopped = stream::meshes(plan, |_, mesh| {
            meshes.push(Measured::of(&mesh));
            if done(mesh.triangles.len() as u64) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        if stopped.is_some() {
            return Err(GlbError::Interrupted);
        }
        let buffer_bytes =
            (0..).zip(&meshes).map(|(mesh, measured)| measured.bytes(plan.triangles(mesh))).sum();
        let mut glb = Self { plan, outline: plan.outline(), meshes, json_bytes: 0, buffer_bytes };
        let mut counter = Counter(0);
        glb.write_json(&mut counter)?;
        glb.json_bytes = counter.0.next_multiple_of(4);
        if glb.file_bytes() > LARGEST { Err(too_large(plan, glb.file_bytes(), false)) } else { Ok(glb) }
    }

    fn file_bytes(&self) -> u64 {
        12 + 8 + self.json_bytes + 8 + self.buffer_bytes
    }

    /// Writes the file; `done` hears of the triangles written.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write(&self, out: &mut dyn Write, mut done: impl FnMut(u64)) -> io::Result<()> {
        // `measure` has seen that these fit.
        let word = |value: u64| (value as u32).to_le_bytes();
        out.write_all(b"glTF")?;
        out.write_all(&2u32.to_le_bytes())?;
        out.write_all(&word(self.file_bytes()))?;
        out.write_all(&word(self.json_bytes))?;
        out.write_all(b"JSON")?;
        let mut counter = Counter(0);
        self.write_json(&mut Both(&mut counter, out))?;
        out.write_all(&b"   "[..(self.json_bytes - counter.0) as usize])?;
        out.write_all(&word(self.buffer_bytes))?;
        out.write_all(b"BIN\0")?;
        let stopped = stream::meshes(self.plan, |number, mesh| {
            done(mesh.triangles.len() as u64);
            match write_mesh(out, &mesh, &self.meshes[number as usize]) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => ControlFlow::Break(error),
            }
        });
        stopped.map_or(Ok(()), Err)
    }

    fn write_json(&self, out: &mut dyn Write) -> io::Result<()> {
        write!(
            out,
            r#"{{"asset":{{"version":"2.0","generator":"collapsar synth"}},"scene":0,"scenes":[{{"nodes":[0]}}]"#
        )?;
        write!(out, r#","buffers":[{{"byteLength":{}}}]"#, self.buffer_bytes)?;
        list(out, "materials", self.outline.materials.iter(), write_material)?;
        self.write_views(out)?;
        let numbers = 0..self.plan.mesh_count();
        list(out, "accessors", numbers.clone(), |out, mesh| self.write_accessors(out, mesh))?;
        list(out, "meshes", numbers, |out, mesh| {
            let [a, material] = [3 * mesh, self.plan.material(mesh)];
            write!(out, r#"{{"name":"{}","primitives":[{{"attributes":"#, self.plan.name(mesh))?;
            write!(
                out,
                r#"{{"POSITION":{a},"NORMAL":{}}},"indices":{},"material":{material}}}]}}"#,
                a + 1,
                a + 2
            )
        })?;
        self.write_nodes(out)?;
        out.write_all(b"}")
    }

    /// A mesh has one view of its positions, one of its normals and one of its indices, in this order.
    fn write_views(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut offset = 0;
        list(out, "bufferViews", (0..).zip(&self.meshes), |out, (mesh, measured)| {
            let vertices = u64::from(measured.vertices) * 12;
            let lengths = [vertices, vertices, measured.index_bytes(self.plan.triangles(mesh))];
            for (number, length) in lengths.into_iter().enumerate() {
                let comma = if number == 0 { "" } else { "," };
                write!(out, r#"{comma}{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)?;
                offset += length;
            }
            Ok(())
        })
    }

    fn write_accessors(&self, out: &mut dyn Write, mesh: u32) -> io::Result<()> {
        let Measured { vertices, low, high } = self.meshes[mesh as usize];
        let [positions, normals, indices] = [0, 1, 2].map(|k| 3 * mesh + k);
        let component = if self.meshes[mesh as usize].has_short_indices() { 5123 } else { 5125 };
        let corners = self.plan.triangles(mesh) * 3;
        let vectors = format!(r#""componentType":5126,"count":{vertices},"type":"VEC3""#);
        write!(out, r#"{{"bufferView":{positions},{vectors},"min":{low:?},"max":{high:?}}},"#)?;
        write!(out, r#"{{"bufferView":{normals},{vectors}}},"#)?;
        write!(
            out,
            r#"{{"bufferView":{indices},"componentType":{component},"count":{corners},"type":"SCALAR"}}"#
        )
    }

    fn write_nodes(&self, out: &mut dyn Write) -> io::Result<()> {
        let children = Children::of(&self.outline);
        let mut instance_of = vec![None; self.outline.nodes.len()];
        for instance in &self.outline.instances {
            instance_of[instance.node as usize] = Some(instance);
        }
        list(out, "nodes", self.outline.nodes.iter().enumerate(), |out, (number, node)| {
            write!(out, r#"{{"name":"{}""#, node.name)?;
            if let Some(instance) = instance_of[number] {
                let m = glam::DMat4::from(instance.world_from_part).as_mat4().to_cols_array();
                write!(out, r#","mesh":{},"matrix":{m:?}"#, instance.mesh)?;
            }
            let own = children.of_node(number);
            if !own.is_empty() {
                write!(out, r#","children":{own:?}"#)?;
            }
            out.write_all(b"}")
        })
    }
}

fn too_large(plan: &Plan, bytes: u64, at_least: bool) -> GlbError {
    let each = bytes as f64 / plan.triangle_count() as f64;
    let each = if at_least { each * 1.7 } else { each };
    GlbError::TooLarge { bytes, at_least, triangles: (LARGEST as f64 / each) as u64 / 1_000_000 * 1_000_000 }
}

/// Writes `,"name":[a,b,c]`.
fn list<T>(
    out: &mut dyn Write,
    name: &str,
    items: impl Iterator<Item = T>,
    mut write_one: impl FnMut(&mut dyn Write, T) -> io::Result<()>,
) -> io::Result<()> {
    write!(out, ",\"{name}\":[")?;
    for (number, item) in items.enumerate() {
        if number > 0 {
            out.write_all(b",")?;
        }
        write_one(out, item)?;
    }
    out.write_all(b"]")
}

fn write_material(out: &mut dyn Write, material: &Material) -> io::Result<()> {
    // glTF has linear colours.
    let linear = |channel: u8| {
        let share = f64::from(channel) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    };
    let [r, g, b, _] = material.base_colour;
    let colour = [linear(r), linear(g), linear(b), 1.0];
    write!(out, r#"{{"name":"{}","pbrMetallicRoughness":{{"baseColorFactor":{colour:?}}}}}"#, material.name)
}

fn write_mesh(out: &mut dyn Write, mesh: &SourceMesh, measured: &Measured) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(measured.bytes(mesh.triangles.len() as u64) as usize);
    for value in mesh.positions.iter().chain(&mesh.normals).flatten() {
        bytes.extend(value.to_le_bytes());
    }
    for corner in mesh.triangles.iter().flatten() {
        if measured.has_short_indices() {
            bytes.extend((*corner as u16).to_le_bytes());
        } else {
            bytes.extend(corner.to_le_bytes());
        }
    }
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    out.write_all(&bytes)
}

/// The children of every node, in order.
struct Children {
    starts: Vec<u32>,
    list: Vec<u32>,
}

impl Children {
    fn of(outline: &Outline) -> Self {
        let mut starts = vec![0; outline.nodes.len() + 1];
        for parent in outline.nodes.iter().filter_map(|node| node.parent) {
            starts[parent as usize + 1] += 1;
        }
        for node in 1..starts.len() {
            starts[node] += starts[node - 1];
        }
        let mut next = starts.clone();
        let mut list = vec![0; outline.nodes.len().saturating_sub(1)];
        for (number, node) in (0..).zip(&outline.nodes) {
            if let Some(parent) = node.parent {
                let slot = &mut next[parent as usize];
                list[*slot as usize] = number;
                *slot += 1;
            }
        }
        Self { starts, list }
    }

    fn of_node(&self, node: usize) -> &[u32] {
        &self.list[self.starts[node] as usize..self.starts[node + 1] as usize]
    }
}

/// A writer that only counts.
struct Counter(u64);

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A writer that counts and writes.
struct Both<'a>(&'a mut Counter, &'a mut dyn Write);

impl Write for Both<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.1.write(bytes)?;
        self.0.0 += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.1.flush()
    }
}
