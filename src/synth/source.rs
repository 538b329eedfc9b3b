//! A plan in, its meshes one at a time out, as a bake wants them.

use xxhash_rust::xxh3::Xxh3;

use super::Plan;
use crate::bake::source::hash_outline;
use crate::bake::{MeshOutline, MeshSource, Outline};
use crate::import::{ImportError, SourceMesh};

/// A planned model whose meshes are made when they are asked for, so that no two have to be in memory together.
pub struct Synthetic<'a> {
    plan: &'a Plan,
    outline: Outline,
}

impl<'a> Synthetic<'a> {
    /// Takes on a plan.
    pub fn new(plan: &'a Plan) -> Self {
        let super::Outline { instances, nodes, materials } = plan.outline();
        let mesh = |number| MeshOutline {
            name: plan.name(number),
            body: number,
            triangles: plan.triangles(number),
            coloured: false,
        };
        let meshes = (0..plan.mesh_count()).map(mesh).collect();
        Self { plan, outline: Outline { meshes, instances, nodes, materials, notes: Vec::new() } }
    }
}

impl MeshSource for Synthetic<'_> {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn load(&self, mesh: usize) -> Result<SourceMesh, ImportError> {
        Ok(self.plan.mesh(mesh as u32))
    }

    fn fingerprint(&self) -> u64 {
        let mut hash = Xxh3::new();
        for mesh in &self.outline.meshes {
            hash.update(mesh.name.as_bytes());
            hash.update(&mesh.triangles.to_le_bytes());
        }
        hash_outline(&self.outline, &mut hash);
        hash.digest()
    }
}
