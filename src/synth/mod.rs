//! A size, a layout and a seed in, a CAD-like assembly out: an airliner, a ship or a plant of any number of triangles.
//!
//! The way: [`Plan::new`] decides which parts there are, of what [`Family`], how many triangles each has and where each
//! is placed, in four bytes a part; [`Plan::outline`] is the assembly tree with its placements; [`Plan::mesh`] makes any
//! mesh, in any order and on any thread, always the same. Nobody ever holds more meshes than are being worked on, so that
//! models larger than memory can be made: [`stream`] hands them out in order, [`mod@glb`] and [`mod@obj`] write them.
//!
//! The sizes follow those of the Boeing 777 in Peng & Cao 2012: 332 M triangles in 718 k parts, with two vertices for
//! three triangles after welding.

mod family;
pub mod glb;
mod layout;
pub mod obj;
mod place;
mod plan;
mod random;
mod report;
mod shape;
mod source;
pub mod stream;
mod surface;
mod tree;

pub use family::{FAMILIES, Family, LEAST_TRIANGLES};
pub use layout::Layout;
pub use plan::{Plan, SynthOptions};
pub use report::SynthReport;
pub use source::Synthetic;
pub use tree::Outline;

use crate::import::MAX_INSTANCES;

/// The most triangles of a part.
pub const MOST_TRIANGLES: u32 = 2_000_000;

/// Why there is no model of the size that was asked for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SynthError {
    /// No triangles.
    #[error("a model needs triangles: ask for at least {LEAST_TRIANGLES}, not {triangles}")]
    TooFewTriangles {
        /// How many were asked for.
        triangles: u64,
    },
    /// More triangles than the most parts can have.
    #[error("{triangles} triangles are more than the largest model has: ask for at most {most}")]
    TooManyTriangles {
        /// How many were asked for.
        triangles: u64,
        /// The most that work.
        most: u64,
    },
    /// No parts.
    #[error("a model needs parts: ask for at least 1")]
    NoParts,
    /// Parts with too few triangles.
    #[error(
        "a part has at least {LEAST_TRIANGLES} triangles: of {triangles} triangles ask for at most {most} parts, not {parts}"
    )]
    TooManyParts {
        /// How many parts were asked for.
        parts: u64,
        /// For how many triangles.
        triangles: u64,
        /// The most parts that work.
        most: u64,
    },
    /// Parts with too many triangles.
    #[error(
        "a part has at most {MOST_TRIANGLES} triangles: of {triangles} triangles ask for at least {least} parts, not {parts}"
    )]
    TooFewParts {
        /// How many parts were asked for.
        parts: u64,
        /// For how many triangles.
        triangles: u64,
        /// The least parts that work.
        least: u64,
    },
    /// A part would be placed nowhere.
    #[error("every part is placed: for {parts} parts ask for at least as many instances, not {instances}")]
    TooFewInstances {
        /// How many placements were asked for.
        instances: u64,
        /// For how many parts.
        parts: u64,
    },
    /// More placements than a model may have.
    #[error("a model has at most {MAX_INSTANCES} instances, not {instances}")]
    TooManyInstances {
        /// How many placements were asked for.
        instances: u64,
    },
}
