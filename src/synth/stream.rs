//! A plan in, its meshes out one by one and in order, made in parallel a little ahead of whoever takes them.

use std::ops::ControlFlow;
use std::ops::Range;

use rayon::prelude::*;

use super::Plan;
use crate::import::SourceMesh;

/// Triangles and meshes of a batch: enough for all threads, and some tens of megabytes.
const BATCH_TRIANGLES: u64 = 400_000;
const BATCH_MESHES: u32 = 8192;

/// How many finished batches wait at most.
const WAITING: usize = 1;

/// Hands over every mesh with its number, in order, until the taker has enough. Three batches exist at most, of 400,000
/// triangles each, or of one mesh.
pub fn meshes<T>(plan: &Plan, mut take: impl FnMut(u32, SourceMesh) -> ControlFlow<T>) -> Option<T> {
    std::thread::scope(|scope| {
        let (sender, receiver) = crossbeam_channel::bounded::<(u32, Vec<SourceMesh>)>(WAITING);
        scope.spawn(move || {
            for batch in batches(plan) {
                let made = batch.clone().into_par_iter().map(|mesh| plan.mesh(mesh)).collect();
                // Whoever takes has hung up.
                if sender.send((batch.start, made)).is_err() {
                    return;
                }
            }
        });
        for (first, batch) in receiver {
            for (number, mesh) in (first..).zip(batch) {
                if let ControlFlow::Break(why) = take(number, mesh) {
                    return Some(why);
                }
            }
        }
        None
    })
}

/// Runs of meshes.
fn batches(plan: &Plan) -> impl Iterator<Item = Range<u32>> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let mut until = from;
        let mut triangles = 0;
        while until < plan.mesh_count() && until - from < BATCH_MESHES && triangles < BATCH_TRIANGLES {
            triangles += plan.triangles(until);
            until += 1;
        }
        let batch = from..until;
        from = until;
        (!batch.is_empty()).then_some(batch)
    })
}
