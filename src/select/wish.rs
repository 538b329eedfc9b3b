//! A camera and a budget in, the wished vertex count of every instance out.
//!
//! The maths is the closed form of the paper (section 5.1, equation 1) with clamping: see `reference::select`. The same
//! rows, candidates and uniform serve the GPU pass and the CPU. Only candidates are looked at and only wishes that were above
//! 0 are cleared, so that a frame costs what its view shows.

use rayon::prelude::*;

use super::cull::Cull;
use super::on_gpu::GpuSelect;
use super::spend::spend;
use crate::container::PartRow;
use crate::geometry::record::MAX_PART_VERTICES;
use crate::gpu::layout::{NO_PARENT_ROW, SelectRow};
use crate::gpu::{Gpu, GpuError};
use crate::reference::select::{SelectView, split};
use crate::scene::{InstanceBox, Scene};

/// Where budgets are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, clap::ValueEnum)]
pub enum SelectOn {
    /// On the CPU, on all cores.
    Cpu,
    /// On the GPU; read back in the same frame, or in a later one where frames do not wait.
    #[default]
    Gpu,
}

impl SelectOn {
    /// The word for it on the command line and in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

/// A wish that is another than it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WishChange {
    /// The instance.
    pub instance: u32,
    /// What it wished.
    pub old: u32,
    /// What it wishes.
    pub new: u32,
}

/// What selection knows of all instances, and the wishes of the last frame.
pub struct Wishes {
    /// The rows of all instances; none where the GPU has them.
    rows: Vec<SelectRow>,
    wishes: Vec<u32>,
    visible: Vec<u32>,
    changes: Vec<WishChange>,
    cull: Cull,
    /// Instances that nobody wants to see, in the order of bits; none if empty.
    left_out: Vec<u64>,
    gpu: Option<GpuSelect>,
}

impl Wishes {
    /// Makes the rows, and for [`SelectOn::Gpu`] uploads them, if there are not more than the adapter can bind: then the CPU
    /// finds the same wishes.
    ///
    /// # Errors
    /// The adapter has no room for the rows.
    pub fn new(gpu: &Gpu, scene: &Scene, on: SelectOn) -> Result<Self, GpuError> {
        let rows = select_rows(scene);
        let wishes = vec![0; rows.len()];
        let gpu = match on {
            SelectOn::Gpu if GpuSelect::fits(gpu, rows.len()) => Some(GpuSelect::new(gpu, &rows)?),
            SelectOn::Gpu => {
                tracing::warn!(
                    instances = rows.len(),
                    "more than the adapter can bind: selecting on the CPU"
                );
                None
            }
            SelectOn::Cpu => None,
        };
        let cull = Cull::new(scene.groups(), &rows);
        let rows = if gpu.is_some() { Vec::new() } else { rows };
        Ok(Self { rows, wishes, visible: Vec::new(), changes: Vec::new(), cull, left_out: Vec::new(), gpu })
    }

    /// The wishes of the last [`Wishes::update`], one an instance; 0 for a culled one.
    pub fn get(&self) -> &[u32] {
        &self.wishes
    }

    /// The instances with a wish above 0, ascending.
    pub fn visible(&self) -> &[u32] {
        &self.visible
    }

    /// From the next [`Wishes::update`] on these instances are as if they were culled: one bit for each, or none at all. Says
    /// whether one that is wanted again has no wish.
    pub fn leave_out(&mut self, instances: Vec<u64>) -> bool {
        let before = std::mem::replace(&mut self.left_out, instances);
        let lacks = |i: usize| has_bit(&before, i) && !has_bit(&self.left_out, i) && self.wishes[i] == 0;
        !before.is_empty() && (0..self.wishes.len()).any(lacks)
    }

    /// The instances that a view does not cull, ascending; wishes stay as they are.
    pub fn in_view(&mut self, scene: &Scene, view: &SelectView) -> Vec<u32> {
        let params = view.params(self.wishes.len() as u32);
        self.cull.find(scene.groups(), &params).to_vec()
    }

    /// Computes the wishes for a view of the scene that this was made for; the last ones are what its dead band holds on to.
    /// Returns whether the GPU did. Without `wait` the GPU's wishes may be those of a view some frames ago.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        view: &SelectView,
        wait: bool,
    ) -> Result<bool, GpuError> {
        let params = view.params(self.wishes.len() as u32);
        let culled = self.cull.find(scene.groups(), &params);
        let kept: Vec<u32>;
        let candidates = match self.left_out.as_slice() {
            [] => culled,
            left_out => {
                let is_wanted = |&i: &u32| !has_bit(left_out, i as usize);
                kept = culled.iter().copied().filter(is_wanted).collect();
                &kept
            }
        };
        let found = match &mut self.gpu {
            None => {
                let spent = spend(&self.rows, candidates, &params, &self.wishes);
                Some((candidates.to_vec(), spent))
            }
            Some(on_gpu) => on_gpu.update(gpu, &params, candidates, wait)?,
        };
        if let Some((instances, wishes)) = found {
            self.set(&instances, &wishes);
        }
        Ok(self.gpu.is_some())
    }

    /// Takes in what the GPU has found since the last [`Wishes::update`]. Returns whether wishes may have changed, or
    /// something is still under way.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn receive(&mut self, gpu: &Gpu) -> Result<bool, GpuError> {
        let Some(on_gpu) = &mut self.gpu else { return Ok(false) };
        let found = on_gpu.receive(gpu, false)?;
        let is_late = found.is_some() || on_gpu.is_busy();
        if let Some((instances, wishes)) = found {
            self.set(&instances, &wishes);
        }
        Ok(is_late)
    }

    /// What has changed since this was last called, in the order in which it did.
    pub fn take_changes(&mut self) -> Vec<WishChange> {
        std::mem::take(&mut self.changes)
    }

    /// Sets the wishes of these instances, ascending; all others are 0.
    fn set(&mut self, instances: &[u32], wishes: &[u32]) {
        let before = std::mem::take(&mut self.visible);
        let mut before = before.into_iter().peekable();
        for (&instance, &wish) in instances.iter().zip(wishes).filter(|&(_, &wish)| wish > 0) {
            while let Some(gone) = before.next_if(|&gone| gone < instance) {
                self.change(gone, 0);
            }
            before.next_if_eq(&instance);
            self.change(instance, wish);
            self.visible.push(instance);
        }
        before.for_each(|gone| self.change(gone, 0));
    }

    fn change(&mut self, instance: u32, new: u32) {
        let old = std::mem::replace(&mut self.wishes[instance as usize], new);
        if old != new {
            self.changes.push(WishChange { instance, old, new });
        }
    }

    /// Bytes of memory that the rows take.
    pub fn row_bytes(&self) -> u64 {
        size_of_val(self.rows.as_slice()) as u64
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.gpu.as_ref().map_or(0, GpuSelect::size_bytes)
    }
}

/// What selection knows of every instance of a scene, in order.
pub fn select_rows(scene: &Scene) -> Vec<SelectRow> {
    let instances = scene.instances().par_iter().zip(scene.boxes()).enumerate();
    instances
        .map(|(number, (instance, bounds))| {
            select_row(&scene.parts()[instance.part as usize], bounds, scene.parent_instance(number as u32))
        })
        .collect()
}

/// Whether a bit is set of words of 64, the lowest first; none beyond them is.
pub(crate) fn has_bit(words: &[u64], number: usize) -> bool {
    words.get(number / 64).is_some_and(|word| word >> (number % 64) & 1 != 0)
}

/// What selection knows of a placement of a part, with its box and the instance of its parent cell.
pub fn select_row(part: &PartRow, bounds: &InstanceBox, parent: Option<u32>) -> SelectRow {
    let (centre_high, centre_low) = split(bounds.centre.to_array());
    // The container has checked that both are at most 65,536.
    debug_assert!(part.vertices as usize <= MAX_PART_VERTICES);
    SelectRow {
        centre_high,
        floor: part.locked,
        centre_low,
        ceiling: part.vertices,
        half_extent: bounds.half_extent.as_vec3().to_array(),
        error_scale: bounds.diagonal as f32,
        errors: bytemuck::cast(part.errors),
        parent: parent.unwrap_or(NO_PARENT_ROW),
        log2_cells: (part.leaf_cells.max(1) as f32).log2(),
        padding: [0; 2],
    }
}
