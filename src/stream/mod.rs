//! Granted states in, bytes for the GPU out: what is held, what is lacking, and how it is sent.
//!
//! 1. [`residency`] keeps the chunks that have been read from the file, in the order that `benefit` gives and as far as
//!    `fit` finds room; `readers` own the disk, `known` tells them where chunks are that others are stored as
//!    differences from, and [`prefetch`] tells what a camera that moves will see next.
//! 2. [`delta`] says for every instance what its new state has that the old one lacks.
//! 3. [`strategy`] decides what of it is sent: the lack (`coherent`), or everything (`whole`, `per-part`).
//! 4. [`gather`] lays the sent records out in the order of the streamed buffer and copies them there in parallel.
//! 5. [`staging`] is the ring of mapped buffers that they are copied into.

mod benefit;
pub mod delta;
mod fit;
pub mod gather;
mod known;
pub mod prefetch;
mod readers;
pub mod residency;
pub mod staging;
pub mod strategy;

pub use delta::{Delta, State};
pub use residency::{Residency, ResidencyError};
pub use strategy::Strategy;
