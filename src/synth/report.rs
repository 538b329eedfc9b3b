//! What `synth` says of what it made.

use serde::Serialize;

use super::Plan;

/// The size of a model, and what it cost.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SynthReport {
    /// What it looks like.
    pub layout: String,
    /// The seed.
    pub seed: u64,
    /// Distinct parts.
    pub parts: u64,
    /// Placements of parts.
    pub instances: u64,
    /// Nodes of the assembly tree.
    pub nodes: u64,
    /// Triangles of all parts.
    pub triangles: u64,
    /// Triangles summed over the placements.
    pub triangles_placed: u64,
    /// Size of the file.
    pub file_bytes: u64,
    /// Seconds in all.
    pub seconds: f64,
    /// Triangles of all parts per second, everything included.
    pub triangles_per_second: f64,
    /// Peak resident memory of the process; `null` where the system does not tell.
    pub peak_rss_bytes: Option<u64>,
}

impl SynthReport {
    /// The numbers of a plan; the file's own are left for later.
    pub fn new(plan: &Plan, seed: u64, seconds: f64) -> Self {
        Self {
            layout: plan.layout().name().to_owned(),
            seed,
            parts: plan.mesh_count().into(),
            instances: plan.instance_count().into(),
            nodes: plan.node_count().into(),
            triangles: plan.triangle_count(),
            triangles_placed: plan.triangles_placed(),
            seconds,
            triangles_per_second: plan.triangle_count() as f64 / seconds.max(1e-9),
            ..Self::default()
        }
    }
}
