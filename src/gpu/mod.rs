//! Everything that talks to the graphics API outside the passes.

pub mod target;
pub mod testing;
//! The graphics card: everything that knows wgpu but no algorithm.
//!
//! In come WGSL sources, plain structs and labels; out go pipelines, buffers, timings and bytes. [`device`] finds an
//! adapter and keeps what goes wrong on it; [`shader`] makes kernels of WGSL; [`layout`] holds every struct that host
//! and shader share; [`timer`] measures stages; [`readback`] brings buffers back.

pub mod device;
pub mod layout;
pub mod readback;
pub mod shader;
pub mod timer;

pub use device::{Gpu, GpuError, GpuOptions};
