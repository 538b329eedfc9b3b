//! The passes on the CPU, in the simplest way that is correct: slices in, vectors out, no wgpu.
//!
//! One file for each pass of [`crate::passes`], under the same name. The GPU's results are compared with these bit
//! for bit (`tests/passes.rs`), and they draw the frame themselves where no GPU is wanted.

pub mod defragment;
pub mod grant;
pub mod power;
pub mod prefix_sum;
pub mod reform;
pub mod select;

pub use defragment::{Starts, defragment};
pub use grant::grant;
pub use prefix_sum::prefix_sum;
pub use reform::reform;
pub use select::{SelectView, select};
