//! What the caller decides about a frame: what is spent, where stages run, how large the picture is.

use crate::gpu::Gpu;
use crate::select::SelectOn;
use crate::stream::Strategy;

/// Where the passes run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum PassesOn {
    /// The GPU.
    #[default]
    Gpu,
    /// The CPU references; their results are copied to the GPU to be drawn.
    Reference,
    /// Nowhere: what would be sent and drawn is counted, and nothing is sent or drawn.
    Nowhere,
}

impl PassesOn {
    /// The GPU, if anything is sent to it.
    pub(super) fn sends_to(self, gpu: &Gpu) -> Option<&Gpu> {
        (self != Self::Nowhere).then_some(gpu)
    }
}

/// How to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Vertices to spend a frame (`N`).
    pub budget_vertices: u32,
    /// The paper's alpha.
    pub alpha: f32,
    /// No instance gets more vertices than this error, in pixels, needs; 0: no such limit.
    pub error_px: f32,
    /// While the camera moves, a budget moves only if it is off by more than this part of itself.
    pub dead_band: f32,
    /// How data is sent.
    pub strategy: Strategy,
    /// Where budgets are computed.
    pub select: SelectOn,
    /// Where the other passes run.
    pub passes: PassesOn,
    /// Bytes of deltas a frame at most; what is over it waits. `None`: no cap.
    pub upload_limit_bytes: Option<u64>,
    /// Bytes of GPU memory that may be used; `None`: no cap.
    pub gpu_limit_bytes: Option<u64>,
    /// Bytes of the largest buffer; `None`: what the adapter can bind.
    pub batch_limit_bytes: Option<u64>,
    /// Bytes of memory that may be used for the model, its tables and what belongs to them; `None`: no cap.
    pub memory_limit_bytes: Option<u64>,
    /// Bytes a second that are read at most, as from a slow disk; `None`: as fast as it goes.
    pub read_rate: Option<u64>,
    /// Whether every frame waits until all it wants has been read, so that pictures are reproducible.
    pub settle: bool,
    /// Whether frames that do not wait also ask for what a camera that moves will see next.
    pub prefetch: bool,
    /// Whether to wait for each stage of the GPU's work, so that the transfer can be timed by itself.
    pub time_stages: bool,
    /// The picture's width in pixels.
    pub width: u32,
    /// The picture's height in pixels.
    pub height: u32,
    /// Samples a pixel: 1 or 4.
    pub samples: u32,
}

/// Those of the [`Settings`] that may change from frame to frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spending {
    /// See [`Settings::budget_vertices`].
    pub budget_vertices: u32,
    /// See [`Settings::alpha`].
    pub alpha: f32,
    /// See [`Settings::error_px`].
    pub error_px: f32,
    /// See [`Settings::strategy`].
    pub strategy: Strategy,
    /// See [`Settings::upload_limit_bytes`].
    pub upload_limit_bytes: Option<u64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            budget_vertices: 1_000_000,
            alpha: 3.0,
            error_px: 0.0,
            dead_band: 0.03,
            strategy: Strategy::Coherent,
            select: SelectOn::Gpu,
            passes: PassesOn::Gpu,
            upload_limit_bytes: None,
            gpu_limit_bytes: None,
            batch_limit_bytes: None,
            memory_limit_bytes: None,
            read_rate: None,
            settle: true,
            prefetch: true,
            time_stages: true,
            width: 1280,
            height: 720,
            samples: 4,
        }
    }
}
