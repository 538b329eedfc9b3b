//! A collapse-ordered mesh in, its tiers out: self-contained prefixes, each about 4 times coarser than the one before.
//!
//! Tier `k` keeps `m_k` vertices, about `m / 4^k`, and its own list of triangles whose indices are already reformed at
//! `m_k`, so that what is held and sent follows what is drawn.

use super::adjacency::edge_features;
use super::order::OrderedMesh;
use super::record::{OrderedTier, TriangleRecord};

/// Each tier has about this many times the vertices of the next.
const RATIO: u32 = 4;
/// No tier aims at fewer vertices.
const LEAST_VERTICES: u32 = 64;

/// The vertex counts of the tiers, finest first; all are states.
pub fn tier_sizes(mesh: &OrderedMesh) -> Vec<u32> {
    let mut sizes = vec![mesh.vertices.len() as u32];
    while let Some(&finer) = sizes.last() {
        let target = (finer / RATIO).max(LEAST_VERTICES).max(mesh.locked);
        let size = mesh.triangles_at.state_at_most(target as usize) as u32;
        // A tier that saves less than a third over the finer one is not worth its triangle list.
        if size == 0 || size > finer / 3 * 2 {
            break;
        }
        sizes.push(size);
    }
    sizes
}

/// Cuts the tiers.
pub fn cut(mesh: &OrderedMesh) -> Vec<OrderedTier> {
    tier_sizes(mesh).into_iter().map(|vertices| tier(mesh, vertices)).collect()
}

fn tier(mesh: &OrderedMesh, vertices: u32) -> OrderedTier {
    let triangles = mesh.reformed(vertices);
    let features = edge_features(&mesh.position_of, &triangles);
    let records = triangles.iter().zip(features.chunks_exact(3));
    OrderedTier { vertices, triangles: records.map(|(triangle, edges)| record(*triangle, edges)).collect() }
}

fn record(triangle: [u32; 3], edges: &[(bool, bool)]) -> TriangleRecord {
    let mut flags = 0;
    for (k, &(open, crease)) in edges.iter().enumerate() {
        flags |= if crease { TriangleRecord::CREASE << k } else { 0 };
        flags |= if open { TriangleRecord::BOUNDARY << k } else { 0 };
    }
    // Vertices of a part are at most 65,536 (the cut into cells sees to it), so that indices fit.
    TriangleRecord { vertices: triangle.map(|vertex| vertex as u16), flags }
}
