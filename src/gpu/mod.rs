//! Everything that talks to the graphics API outside the passes.

pub mod target;
pub mod testing;
