//! How active data gets to the GPU: the three approaches that the paper compares (section 6.2.2).

use std::fmt;

/// A way of sending.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Hash, clap::ValueEnum, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Only what the GPU lacks (the paper's SC).
    #[default]
    Coherent,
    /// Everything, every frame, in one block (the paper's SnC).
    Whole,
    /// Everything, every frame, part by part (the paper's NS).
    PerPart,
}

impl Strategy {
    /// All of them, in the order of the paper's Table 1.
    pub const ALL: [Self; 3] = [Self::Coherent, Self::Whole, Self::PerPart];

    /// The word for it on the command line and in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Coherent => "coherent",
            Self::Whole => "whole",
            Self::PerPart => "per-part",
        }
    }
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}
