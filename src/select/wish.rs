//! A camera and a budget in, the wished vertex count of every instance out.
//!
//! The maths is the closed form of the paper (section 5.1, equation 1) with clamping: see `reference::select`. The same
//! rows and the same uniform serve the GPU pass and the CPU.

use crate::geometry::record::MAX_PART_VERTICES;
use crate::gpu::layout::{NO_PARENT_ROW, SelectRow};
use crate::gpu::{Gpu, GpuError, readback};
use crate::passes::select::SelectBuffers;
use crate::passes::{PrefixSum, Select};
use crate::reference::select::{SelectView, split};
use crate::scene::Scene;

/// Where budgets are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, clap::ValueEnum)]
pub enum SelectOn {
    /// On the CPU, by the reference.
    Cpu,
    /// On the GPU, read back in the same frame.
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

/// The rows of all instances, and the wishes of the last frame.
pub struct Wishes {
    rows: Vec<SelectRow>,
    wishes: Vec<u32>,
    visible: Vec<u32>,
    gpu: Option<OnGpu>,
}

struct OnGpu {
    pass: Select,
    prefix_sum: PrefixSum,
    rows: wgpu::Buffer,
    wishes: wgpu::Buffer,
}

impl Wishes {
    /// Makes the rows, and for [`SelectOn::Gpu`] uploads them.
    ///
    /// # Errors
    /// The adapter has no room for the rows.
    pub fn new(gpu: &Gpu, scene: &Scene, on: SelectOn) -> Result<Self, GpuError> {
        let rows = select_rows(scene);
        let wishes = vec![0; rows.len()];
        let gpu = match on {
            SelectOn::Cpu => None,
            SelectOn::Gpu => Some(OnGpu::new(gpu, &rows)?),
        };
        Ok(Self { rows, wishes, visible: Vec::new(), gpu })
    }

    /// The wishes of the last [`Wishes::update`], one an instance; 0 for a culled one.
    pub fn get(&self) -> &[u32] {
        &self.wishes
    }

    /// The instances with a wish above 0, ascending.
    pub fn visible(&self) -> &[u32] {
        &self.visible
    }

    /// Computes the wishes for a view; the last ones are what its dead band holds on to. Returns whether the GPU did.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub fn update(&mut self, gpu: &Gpu, view: &SelectView) -> Result<bool, GpuError> {
        let params = view.params(self.rows.len() as u32);
        match &mut self.gpu {
            None => self.wishes = crate::reference::select::select(&self.rows, &params, &self.wishes),
            Some(on_gpu) => self.wishes = on_gpu.update(gpu, &params, self.rows.len() as u32)?,
        }
        self.visible.clear();
        self.visible.extend((0..).zip(&self.wishes).filter(|&(_, &wish)| wish > 0).map(|(number, _)| number));
        Ok(self.gpu.is_some())
    }

    /// Bytes of GPU memory.
    pub fn gpu_bytes(&self) -> u64 {
        self.gpu.as_ref().map_or(0, |gpu| {
            gpu.rows.size() + gpu.wishes.size() + gpu.pass.size_bytes() + gpu.prefix_sum.size_bytes()
        })
    }
}

impl OnGpu {
    fn new(gpu: &Gpu, rows: &[SelectRow]) -> Result<Self, GpuError> {
        let buffer = gpu.storage("select_rows", std::mem::size_of_val(rows).max(64) as u64)?;
        gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(rows));
        let counts = 4 * rows.len().max(1) as u64;
        Ok(Self {
            pass: Select::new(gpu),
            prefix_sum: PrefixSum::new(gpu),
            rows: buffer,
            wishes: gpu.storage("select_wishes", counts)?,
        })
    }

    fn update(
        &mut self,
        gpu: &Gpu,
        params: &crate::gpu::layout::SelectParams,
        count: u32,
    ) -> Result<Vec<u32>, GpuError> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let mut encoder = gpu.encoder("select");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("select"),
                timestamp_writes: None,
            });
            let buffers = SelectBuffers { rows: &self.rows, old: &self.wishes, wish: &self.wishes };
            self.pass.record(gpu, &mut pass, &mut self.prefix_sum, params, &buffers)?;
        }
        gpu.submit(encoder)?;
        readback::read_values(gpu, &self.wishes, count as usize)
    }
}

/// What selection knows of every instance of a scene, in order.
pub fn select_rows(scene: &Scene) -> Vec<SelectRow> {
    let instances = scene.instances().iter().zip(scene.boxes()).enumerate();
    instances
        .map(|(number, (instance, bounds))| {
            let part = &scene.parts()[instance.part as usize];
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
                parent: scene.parent_instance(number as u32).unwrap_or(NO_PARENT_ROW),
                log2_cells: (part.leaf_cells.max(1) as f32).log2(),
                padding: [0; 2],
            }
        })
        .collect()
}
