//! The passes of a frame: buffers in, buffers out, each recorded into a pass of the caller.
//!
//! In the order of a frame: [`select`] wishes budgets; [`grant`] takes those that were granted; [`prefix_sum`] makes
//! start lists of them; [`defragment`] builds the active buffers; [`reform`] the index buffer;
//! [`cut_face`] closes what sections cut, [`draw`] draws the rest, [`depth_cue`] shades what was drawn by depth, and [`pick`] says what is in one
//! pixel. Each compute pass has its counterpart of the same name in [`crate::reference`], its kernels in `shaders/`, and its
//! cases in `tests/passes.rs`.

use crate::gpu::shader::Shader;
use crate::gpu::{Gpu, GpuError};

pub mod cut_face;
pub mod defragment;
pub mod depth_cue;
pub mod draw;
pub mod grant;
pub mod pick;
pub mod prefix_sum;
pub mod reform;
pub mod select;

pub use defragment::Defragment;
pub use grant::GrantPass;
pub use prefix_sum::PrefixSum;
pub use reform::Reform;
pub use select::Select;

/// Every compute shader, for the tests that need no GPU.
pub const SHADERS: &[Shader] =
    &[prefix_sum::SHADER, grant::SHADER, defragment::SHADER, reform::SHADER, select::SHADER];

/// The workgroup size of kernels with a lane an element.
pub const GROUP: u32 = 64;

/// `shaders/shared/index.wgsl`.
const INDEX: &str = include_str!("../../shaders/shared/index.wgsl");
/// `shaders/shared/saturate.wgsl`.
const SATURATE: &str = include_str!("../../shaders/shared/saturate.wgsl");
/// `shaders/shared/find_owner.wgsl`.
const FIND_OWNER: &str = include_str!("../../shaders/shared/find_owner.wgsl");
/// `shaders/shared/power.wgsl`.
pub const POWER: &str = include_str!("../../shaders/shared/power.wgsl");

/// A buffer of a pass's own, which grows on demand and never shrinks.
#[derive(Debug)]
pub(crate) struct Scratch {
    label: &'static str,
    buffer: Option<wgpu::Buffer>,
}

impl Scratch {
    pub(crate) fn new(label: &'static str) -> Self {
        Self { label, buffer: None }
    }

    /// The buffer, of at least this size. What an older, smaller one held is lost.
    pub(crate) fn at_least(&mut self, gpu: &Gpu, size_bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        if let Some(buffer) = self.buffer.as_ref().filter(|buffer| buffer.size() >= size_bytes) {
            return Ok(buffer.clone());
        }
        let roomy = size_bytes.next_power_of_two().min(gpu.storage_limit_bytes()).max(size_bytes);
        let buffer = gpu.storage(self.label, roomy)?;
        self.buffer = Some(buffer.clone());
        Ok(buffer)
    }

    /// Bytes that it takes.
    pub(crate) fn size_bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, wgpu::Buffer::size)
    }
}
