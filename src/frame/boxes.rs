//! Instances of which nothing has arrived in, the boxes that stand in for them out.

use super::places::{Places, runs};
use super::{FrameError, Renderer};
use crate::geometry::Grid;
use crate::geometry::record::Attributes;
use crate::gpu::{Gpu, GpuError};
use crate::passes::draw::{DrawPass, InstanceRow, Look, LookRow};
use crate::scene::Scene;
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use std::ops::Range;

/// A box that would be larger in the picture is not drawn: it would hide what is there already.
const LARGEST_PX: f64 = 96.0;
/// No more boxes than these are drawn: 16 MiB of rows.
const MOST: usize = 1 << 18;
/// Rows between two that are new are sent along if there are no more than these: each piece costs a copy of its own.
const GAP: u32 = 8;

/// The rows of all boxes, on the GPU.
pub(super) struct Boxes {
    rows: wgpu::Buffer,
    looks: wgpu::Buffer,
    group: wgpu::BindGroup,
    places: Places,
}

impl Boxes {
    pub fn new(gpu: &Gpu, draw: &DrawPass) -> Result<Self, GpuError> {
        let rows = gpu.storage("box rows", size_of::<InstanceRow>() as u64)?;
        let looks = gpu.storage("box looks", size_of::<LookRow>() as u64)?;
        let group = draw.bind_instances(&gpu.device, &rows, &looks);
        Ok(Self { group, rows, looks, places: Places::default() })
    }

    /// What the draw pass needs, if there are any.
    pub fn drawn(&self) -> Option<(&wgpu::BindGroup, u32)> {
        (self.count() > 0).then_some((&self.group, self.count() as u32))
    }

    pub fn count(&self) -> u64 {
        self.places.instances().len() as u64
    }

    pub fn size_bytes(&self) -> u64 {
        self.rows.size() + self.looks.size()
    }

    /// Takes other instances (ascending); returns the bytes to send, those of rows that are new. Without `gpu` nothing is
    /// sent.
    pub fn set(
        &mut self,
        gpu: Option<&Gpu>,
        draw: &DrawPass,
        (scene, looks): (&Scene, &[Look]),
        instances: &[u32],
    ) -> Result<u64, GpuError> {
        let mut written = self.places.set(instances);
        if let Some(gpu) = gpu.filter(|_| bytes_of(instances.len()) > self.rows.size()) {
            self.grow(gpu, draw, instances.len())?;
            written = (0..instances.len() as u32).collect();
        }
        let runs = runs(&written, GAP);
        if let Some(gpu) = gpu {
            runs.iter().for_each(|run| self.write(gpu, scene, looks, run.clone()));
        }
        let rows: usize = runs.iter().map(ExactSizeIterator::len).sum();
        Ok(bytes_of(rows) + (rows * size_of::<LookRow>()) as u64)
    }

    fn grow(&mut self, gpu: &Gpu, draw: &DrawPass, rows: usize) -> Result<(), GpuError> {
        let bytes = bytes_of(rows);
        self.rows = gpu.storage("box rows", bytes + bytes / 4)?;
        let share = (size_of::<InstanceRow>() / size_of::<LookRow>()) as u64;
        self.looks = gpu.storage("box looks", self.rows.size() / share)?;
        self.group = draw.bind_instances(&gpu.device, &self.rows, &self.looks);
        Ok(())
    }

    fn write(&self, gpu: &Gpu, scene: &Scene, looks: &[Look], run: Range<usize>) {
        let instances = &self.places.instances()[run.clone()];
        let rows: Vec<InstanceRow> = instances.par_iter().map(|&instance| box_row(scene, instance)).collect();
        gpu.queue.write_buffer(&self.rows, bytes_of(run.start), bytemuck::cast_slice(&rows));
        self.write_looks_of(gpu, looks, run);
    }

    fn write_looks_of(&self, gpu: &Gpu, looks: &[Look], run: Range<usize>) {
        let row = |&number: &u32| LookRow { number, look: looks[number as usize] };
        let rows: Vec<LookRow> = self.places.instances()[run.clone()].iter().map(row).collect();
        let at = run.start * size_of::<LookRow>();
        gpu.queue.write_buffer(&self.looks, at as u64, bytemuck::cast_slice(&rows));
    }

    /// Sends how the boxes look, given all looks of the scene; returns the bytes. Without `gpu` nothing is sent.
    pub fn write_looks(&self, gpu: Option<&Gpu>, looks: &[Look]) -> u64 {
        let count = self.places.instances().len();
        if let Some(gpu) = gpu {
            self.write_looks_of(gpu, looks, 0..count);
        }
        (count * size_of::<LookRow>()) as u64
    }
}

fn bytes_of(rows: usize) -> u64 {
    (rows * size_of::<InstanceRow>()) as u64
}

/// The unit cube, placed where the box of an instance's part is, in the instance's colour.
fn box_row(scene: &Scene, number: u32) -> InstanceRow {
    let instance = &scene.instances()[number as usize];
    let [low, high] = scene.parts()[instance.part as usize].bounds().map(DVec3::from);
    let part_from_cube = DAffine3 { matrix3: DMat3::from_diagonal(high - low), translation: low };
    let unit = Grid { origin: [0.0; 3], step_exponent: 0 };
    InstanceRow::new(instance.transform() * part_from_cube, unit, scene.colour(instance), Attributes::Normal)
}

impl Renderer {
    /// Boxes for what is wished for, small, and not there at all.
    pub(super) fn place_boxes(&mut self) -> Result<u64, FrameError> {
        let visible = self.wishes.visible().iter().zip(&self.seen_px);
        let small = visible.filter(|&(&instance, &px)| {
            let part = self.scene.instances()[instance as usize].part;
            f64::from(px) <= LARGEST_PX
                && self.residency.vertices_arrived(part) == 0
                && !self.parent_is_drawn(instance)
        });
        let instances: Vec<u32> = small.map(|(&instance, _)| instance).take(MOST).collect();
        let gpu = self.settings.passes.sends_to(&self.gpu);
        Ok(self.boxes.set(gpu, &self.draw, (&self.scene, self.looks.all()), &instances)?)
    }

    /// Whether a parent cell stands in for an instance.
    pub(super) fn parent_is_drawn(&self, instance: u32) -> bool {
        let above = |&instance: &u32| self.scene.parent_instance(instance);
        self.scene.has_parents()
            && std::iter::successors(self.scene.parent_instance(instance), above)
                .any(|parent| !self.wanted[parent as usize].is_empty())
    }
}
