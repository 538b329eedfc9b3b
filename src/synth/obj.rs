//! A plan in, an OBJ file out, mesh by mesh. OBJ has no instances and no tree: every placement is an object of its own in
//! world space, named after its part.

use std::io::{self, Write};
use std::ops::ControlFlow;

use glam::{DAffine3, DVec3};

use super::{Outline, Plan, stream};
use crate::import::SourceMesh;

/// Writes every placement; `done` hears of the triangles written.
///
/// # Errors
/// Those of the writer.
pub fn write(plan: &Plan, out: &mut dyn Write, mut done: impl FnMut(u64)) -> io::Result<()> {
    let outline = plan.outline();
    let placed = Placed::new(plan, &outline);
    writeln!(out, "# collapsar synth, {}, in metres, y upwards", plan.layout().name())?;
    let mut base = 1;
    let stopped = stream::meshes(plan, |number, mesh| {
        for (copy, place) in placed.of(number, &outline).enumerate() {
            if let Err(error) = write_object(out, &mesh, copy, place, base) {
                return ControlFlow::Break(error);
            }
            base += mesh.positions.len() as u64;
            done(mesh.triangles.len() as u64);
        }
        ControlFlow::Continue(())
    });
    stopped.map_or(Ok(()), Err)
}

fn write_object(
    out: &mut dyn Write,
    mesh: &SourceMesh,
    copy: usize,
    place: &DAffine3,
    base: u64,
) -> io::Result<()> {
    writeln!(out, "o {}_{copy}", mesh.name)?;
    for &position in &mesh.positions {
        let [x, y, z] = place.transform_point3(DVec3::from_array(position.map(f64::from))).to_array();
        writeln!(out, "v {x:.7} {y:.7} {z:.7}")?;
    }
    for &normal in &mesh.normals {
        let [x, y, z] = place.transform_vector3(DVec3::from_array(normal.map(f64::from))).to_array();
        writeln!(out, "vn {x:.5} {y:.5} {z:.5}")?;
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| base + u64::from(corner));
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}

/// The placements of every mesh.
struct Placed {
    /// Those of mesh `m` are `starts[m]..starts[m + 1]` of the list.
    starts: Vec<u32>,
    instances: Vec<u32>,
}

impl Placed {
    fn new(plan: &Plan, outline: &Outline) -> Self {
        let mut starts = vec![0; plan.mesh_count() as usize + 1];
        for instance in &outline.instances {
            starts[instance.mesh as usize + 1] += 1;
        }
        for mesh in 1..starts.len() {
            starts[mesh] += starts[mesh - 1];
        }
        let mut next = starts.clone();
        let mut instances = vec![0; outline.instances.len()];
        for (number, instance) in (0..).zip(&outline.instances) {
            let slot = &mut next[instance.mesh as usize];
            instances[*slot as usize] = number;
            *slot += 1;
        }
        Self { starts, instances }
    }

    fn of<'a>(&'a self, mesh: u32, outline: &'a Outline) -> impl Iterator<Item = &'a DAffine3> {
        let range = self.starts[mesh as usize] as usize..self.starts[mesh as usize + 1] as usize;
        self.instances[range].iter().map(|&number| &outline.instances[number as usize].world_from_part)
    }
}
