//! collapsar: a massive-model streaming renderer with frame-to-frame coherence.
//!
//! What flows through, in the order of the folders: files become a [`import::Model`]; [`geometry`] orders every part
//! by the edge collapses that remove it; [`bake`] does so for all parts in parallel; [`container`] keeps the result
//! in a checked, memory-mapped file; [`scene`] opens it; [`select`] grants every instance a budget; [`stream`] finds
//! what the GPU lacks; [`gpu`] and [`passes`] defragment, reform and draw it; [`reference`](mod@reference) does the
//! same on the CPU, in the simplest way that is correct; [`stats`] counts it all, and [`report`] shows it. Beside this
//! way, [`measure`] tells how far two surfaces lie apart, [`mod@compare`] how far the levels of detail are from what they
//! were made of, and [`synth`] makes models of any size out of nothing; `viewer` is a window on all of it.
//!
//! The words are those of Peng & Cao 2012, *A GPU-based Approach for Massive Model Rendering with Frame-to-Frame
//! Coherence*; `docs/architecture.md` lists them.

pub mod bake;
pub mod compare;
pub mod container;
mod error;
pub mod export;
pub mod frame;
pub mod geometry;
pub mod gpu;
pub mod import;
pub mod measure;
pub mod passes;
pub mod reference;
pub mod report;
pub mod scene;
pub mod select;
pub mod stats;
pub mod stream;
pub mod synth;
#[cfg(feature = "viewer")]
pub mod viewer;
pub mod whole_file;

pub use error::Error;
