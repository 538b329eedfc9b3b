//! What the floor of a pass takes for granted, on a real model and without a GPU.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its scene should fail loudly"
)]

mod common;

use collapsar::geometry::Boundary;
use collapsar::geometry::body::order_part;
use collapsar::geometry::record::OrderedPart;

/// Entries of `ecol` in a sector of 32 bytes, the least that a graphics card's memory moves.
const SECTOR: usize = 8;

/// The entries of `ecol` that a reformation reads.
fn entries_read(part: &OrderedPart, tier: usize, vn: usize) -> Vec<bool> {
    let mut is_read = vec![false; part.tiers[tier].vertices as usize];
    let active = part.triangles_at.count_at(vn) as usize;
    for triangle in &part.tiers[tier].triangles[..active] {
        for mut vertex in triangle.vertices.map(usize::from) {
            while vertex >= vn {
                is_read[vertex] = true;
                vertex = usize::from(part.ecol[vertex]);
            }
        }
    }
    is_read
}

/// Sectors beyond what is active: those that are read, and all.
fn sectors(part: &OrderedPart, tier: usize, vn: usize) -> (usize, usize) {
    let is_read = entries_read(part, tier, vn);
    let beyond = &is_read[vn..];
    let read = beyond.chunks(SECTOR).filter(|sector| sector.contains(&true)).count();
    (read, beyond.len().div_ceil(SECTOR))
}

#[test]
fn a_reformation_reads_nearly_every_sector_of_the_ecol_beyond_what_is_active() {
    let bodies = common::bodies_of(&common::bundled("2CylinderEngine.glb"));
    let (mut read, mut all) = (0, 0);
    for part in bodies.iter().flatten().flat_map(|mesh| order_part(mesh, Boundary::Slide).cells) {
        for (number, tier) in part.tiers.iter().enumerate() {
            let next = part.tiers.get(number + 1).map_or(part.locked, |next| next.vertices);
            // Three states between this tier and the next.
            for quarter in 1..4 {
                let vn = next + (tier.vertices - next) * quarter / 4;
                let vn = part.triangles_at.state_at_most(vn as usize);
                let (some, of) = sectors(&part, number, vn);
                (read, all) = (read + some, all + of);
            }
        }
    }
    assert!(all > 1000, "{all}");
    let share = read as f64 / all as f64;
    assert!(share > 0.9, "{read} of {all} sectors are read: {share:.3}");
    println!("{read} of {all} sectors are read: {share:.3}");
}
