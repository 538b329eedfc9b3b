//! The graphics card: everything that knows wgpu but no algorithm.
//!
//! In come WGSL sources, plain structs and labels; out go pipelines, buffers, timings, pictures and bytes. [`device`]
//! finds an adapter and keeps what goes wrong on it; [`shader`] makes kernels of WGSL; [`layout`] holds every struct
//! that host and compute shader share; [`batch`] holds the buffers of a set of instances; [`target`] is what is drawn
//! into; [`timer`] measures stages; [`bandwidth`] measures what the memory moves; [`readback`] brings buffers back,
//! [`read_ring`] without waiting; [`testing`] finds a device for tests.

pub mod bandwidth;
pub mod batch;
pub mod device;
pub mod layout;
pub mod read_ring;
pub mod readback;
pub mod shader;
pub mod target;
pub mod testing;
pub mod timer;

pub use device::{Gpu, GpuError, GpuOptions};
