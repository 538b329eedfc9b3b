//! A container's path in, a [`Scene`] out: its tables in memory, its payload in the mapped file.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::bounds::Bounds;
use super::mapped::{MapError, MappedFile};
use super::part::Chunk;
use crate::container::{ChunkSpec, Container, ContainerError, Groups, InstanceRow, PartRow};
use crate::import::Colour;

/// Why a container cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The file is not a sound container.
    #[error("{cause}: {path}")]
    Container {
        /// What is wrong with it.
        cause: ContainerError,
        /// The file.
        path: PathBuf,
    },
}

/// An opened container.
#[derive(Debug)]
pub struct Scene {
    file: MappedFile,
    parts: Vec<PartRow>,
    /// Specs of all chunks; part `p` has `chunk_start[p]..chunk_start[p + 1]`, finest first.
    chunks: Vec<ChunkSpec>,
    chunk_start: Vec<u32>,
    instances: Vec<InstanceRow>,
    colours: Vec<Colour>,
    boxes: Vec<InstanceBox>,
    groups: Groups,
    bounds: Bounds,
    has_parents: bool,
}

/// The world-space box of an instance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InstanceBox {
    /// Its centre.
    pub centre: DVec3,
    /// Half its extent along each axis.
    pub half_extent: DVec3,
    /// The part's diagonal, scaled to the world by the transform's largest stretch.
    pub diagonal: f64,
}

impl Scene {
    /// Maps a container and checks its tables; no payload is touched.
    ///
    /// # Errors
    /// The file cannot be read, or is not a sound container.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        let file = MappedFile::open(path)?;
        let wrap = |cause| SceneError::Container { cause, path: path.to_owned() };
        let container = Container::open(file.bytes()).map_err(wrap)?;
        let parts = container.parts().to_vec();
        let instances = container.instances().to_vec();
        let colours = container.materials().iter().map(|material| material.base_colour).collect();
        let (chunks, chunk_start) = chunk_specs(&container).map_err(wrap)?;
        let boxes: Vec<InstanceBox> =
            instances.iter().map(|instance| instance_box(&parts[instance.part as usize], instance)).collect();
        let bounds = boxes.iter().fold(Bounds::EMPTY, |bounds, b| {
            bounds.with_point(b.centre - b.half_extent).with_point(b.centre + b.half_extent)
        });
        let has_parents = parts.iter().any(PartRow::is_parent);
        let groups = Groups::of(&container);
        Ok(Self { has_parents, groups, parts, chunks, chunk_start, instances, colours, boxes, bounds, file })
    }

    /// The parts.
    pub fn parts(&self) -> &[PartRow] {
        &self.parts
    }

    /// The placements of parts.
    pub fn instances(&self) -> &[InstanceRow] {
        &self.instances
    }

    /// The instance that is drawn in the place of this one and others where they are finer than need be.
    pub fn parent_instance(&self, instance: u32) -> Option<u32> {
        let part = &self.parts[self.instances[instance as usize].part as usize];
        // The container has checked that the cells of a part are placed together.
        (!part.is_root()).then(|| instance - part.parent_distance)
    }

    /// Where the cells that are placed together with an instance, the first of them, end; the next instance for a part
    /// without parent cells.
    pub fn placement_end(&self, instance: u32) -> u32 {
        let source = |number: u32| {
            let part = &self.parts[self.instances.get(number as usize)?.part as usize];
            (part.is_parent() || !part.is_root())
                .then_some((part.source, self.instances[number as usize].part))
        };
        let mut end = instance + 1;
        while let (Some(last), Some(next)) = (source(end - 1), source(end))
            && last.0 == next.0
            && last.1 < next.1
        {
            end += 1;
        }
        end
    }

    /// Whether any part has parent cells.
    pub fn has_parents(&self) -> bool {
        self.has_parents
    }

    /// The world-space box of every instance.
    pub fn boxes(&self) -> &[InstanceBox] {
        &self.boxes
    }

    /// The groups of all instances.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// The box of everything.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The material colour of an instance.
    pub fn colour(&self, instance: &InstanceRow) -> Colour {
        self.colours[instance.material as usize]
    }

    /// The colours of the material slots of an instance; none if its part has no slots.
    pub fn slot_colours(&self, instance: &InstanceRow) -> &[Colour] {
        let (first, slots) = (instance.material as usize, self.parts[instance.part as usize].slots as usize);
        // The container has checked that there are so many.
        &self.colours[first..first + slots]
    }

    /// What the chunks of a part hold, finest tier first.
    pub fn tiers(&self, part: u32) -> &[ChunkSpec] {
        &self.chunks[self.chunk_start[part as usize] as usize..self.chunk_start[part as usize + 1] as usize]
    }

    /// Reads and checks a chunk; may wait for the disk.
    ///
    /// # Errors
    /// The chunk is damaged.
    pub fn read_chunk(&self, part: u32, tier: u32) -> Result<Chunk, ContainerError> {
        let spec = self.tiers(part)[tier as usize];
        let range = spec.range();
        // The tables were checked against the length of the mapping when it was opened.
        Chunk::read(spec, &self.file.bytes()[range.start as usize..range.end as usize])
    }
}

fn chunk_specs(container: &Container<'_>) -> Result<(Vec<ChunkSpec>, Vec<u32>), ContainerError> {
    let mut specs = Vec::new();
    let mut starts = vec![0];
    for part in 0..container.parts().len() {
        for tier in 0..container.chunk_rows(part).len() {
            specs.push(container.chunk_spec(part, tier)?);
        }
        starts.push(specs.len() as u32);
    }
    Ok((specs, starts))
}

/// The world-space box of a placement of a part.
pub fn instance_box(part: &PartRow, instance: &InstanceRow) -> InstanceBox {
    let [low, high] = part.bounds().map(DVec3::from);
    let transform = instance.transform();
    let half = (high - low) * 0.5;
    let linear = transform.matrix3;
    let absolute = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let stretch = linear.x_axis.length().max(linear.y_axis.length()).max(linear.z_axis.length());
    InstanceBox {
        centre: transform.transform_point3((low + high) * 0.5),
        half_extent: absolute * half,
        diagonal: 2.0 * half.length() * stretch,
    }
}
