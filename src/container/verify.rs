//! Everything that a file can show about itself: all checksums, all padding, and the invariants of the collapse order.
//!
//! [`Container::open`] has checked the tables. Here each part's chunks are checked alone (as every reader does), then
//! together: tiers must be prefixes of each other, and the triangles that are left at a state must be exactly those
//! that are not degenerate. Parts are checked in parallel, and the findings do not depend on the number of threads.

use rayon::prelude::*;

use super::ContainerError;
use super::chunk::ChunkView;
use super::finding::Findings;
use super::format::{GroupRow, PartRow, aligned};
use super::groups::{corners, radius};
use super::reader::{Container, join};
use super::stored::Chunk;
use crate::geometry::record::Attributes;
use crate::geometry::{OrderedPart, OrderedTier, VertexRecord};

/// No more findings than this are collected.
pub const MAX_FINDINGS: usize = 100;

/// How many parts are checked before the findings are counted.
const BATCH: usize = 256;

/// At so many states of a tier its triangles are compared with the counts, at least ...
const STATES_PER_TIER: usize = 16;
/// ... and at as many as this number of vertices and triangles allows, so that small tiers are compared at each.
const WORK_PER_TIER: usize = 1 << 16;

/// What was checked, and what was found wrong.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VerifyReport {
    /// How many parts were checked.
    pub parts: usize,
    /// How many chunks they have.
    pub chunks: usize,
    /// How many bytes of payload they have, without padding.
    pub chunk_bytes: u64,
    /// One readable line for each thing that is wrong: which part and tier, and what. At most [`MAX_FINDINGS`]; where
    /// there are so many, later parts may not have been checked.
    pub findings: Vec<String>,
}

/// Checks the whole payload and gives an error if anything is wrong.
///
/// # Errors
/// [`ContainerError::Invalid`] with all findings.
pub fn verify(container: &Container) -> Result<VerifyReport, ContainerError> {
    let report = inspect(container);
    if report.findings.is_empty() {
        Ok(report)
    } else {
        Err(ContainerError::Invalid { findings: report.findings })
    }
}

/// Checks the whole payload and collects what is wrong, the same lines from any number of threads.
pub fn inspect(container: &Container) -> VerifyReport {
    let mut report = VerifyReport { findings: inspect_groups(container), ..VerifyReport::default() };
    let parts: Vec<usize> = (0..container.parts().len()).collect();
    for batch in parts.chunks(BATCH) {
        let found: Vec<_> = batch.par_iter().map(|&part| inspect_part(container, part)).collect();
        report.findings.extend(found.into_iter().flatten());
        let rows = || batch.iter().flat_map(|&part| container.chunk_rows(part));
        report.parts += batch.len();
        report.chunks += rows().count();
        report.chunk_bytes += rows().map(|row| u64::from(row.bytes)).sum::<u64>();
        if report.findings.len() >= MAX_FINDINGS {
            report.findings.truncate(MAX_FINDINGS);
            break;
        }
    }
    report
}

/// Members that lie outside the box of their leaf, or are larger than its largest.
fn inspect_groups(container: &Container) -> Vec<String> {
    let mut findings = Findings::new(String::new(), MAX_FINDINGS);
    let leaves = container.groups().iter().enumerate().filter(|(index, row)| row.is_leaf(*index));
    for (index, row) in leaves {
        findings.set_place(format!("group {index}"));
        for &number in &container.members()[row.members()] {
            let [low, high] = corners(container.parts(), &container.instances()[number as usize]);
            findings
                .expect(holds(row, low, high), || format!("it does not hold the box of instance {number}"));
        }
    }
    findings.into_lines().collect()
}

fn holds(row: &GroupRow, low: [f64; 3], high: [f64; 3]) -> bool {
    let reaches = |axis: usize| row.low[axis] <= low[axis] && high[axis] <= row.high[axis];
    (0..3).all(reaches) && radius(low, high) <= row.radius
}

/// What is wrong with one part: its chunks alone and, if nothing is, together.
fn inspect_part(container: &Container, part: usize) -> Vec<String> {
    let name: String = container.part_name(part).chars().take(60).collect();
    let place = format!("part {part} {name:?}");
    let mut findings = Findings::new(place.clone(), MAX_FINDINGS);
    let row = &container.parts()[part];
    let chunks = read_chunks(container, part);
    for (tier, chunk) in chunks.iter().enumerate() {
        findings.set_place(format!("{place}, tier {tier}"));
        check_padding(container, part, tier, &mut findings);
        match chunk {
            Ok(chunk) => chunk.view().check(chunk.spec(), &mut findings),
            Err(ContainerError::Checksum { .. }) => findings.add(|| "the checksum does not match".to_owned()),
            Err(ContainerError::Malformed { problem, .. }) => findings.add(|| problem.clone()),
            Err(error) => findings.add(|| error.to_string()),
        }
    }
    let views: Vec<ChunkView> = chunks.iter().flatten().map(Chunk::view).collect();
    findings.set_place(place.clone());
    check_errors(row, &mut findings);
    if row.attributes() == Attributes::Slot {
        check_slots(row, &views, &mut findings);
    }
    if findings.is_empty() {
        check_together(&place, row, &join(row, &views), &mut findings);
    }
    findings.into_lines().collect()
}

/// The chunks of a part, the finest first, of which only length, checksum and form were checked. What is compressed needs
/// all coarser ones.
fn read_chunks(container: &Container, part: usize) -> Vec<Result<Chunk, ContainerError>> {
    let mut chunks: Vec<Result<Chunk, ContainerError>> = Vec::new();
    for tier in (0..container.chunk_rows(part).len()).rev() {
        let coarser: Vec<&Chunk> = chunks.iter().rev().flatten().collect();
        chunks.push(read_chunk(container, part, tier, &coarser));
    }
    chunks.reverse();
    chunks
}

fn read_chunk(
    container: &Container,
    part: usize,
    tier: usize,
    coarser: &[&Chunk],
) -> Result<Chunk, ContainerError> {
    let spec = container.chunk_spec(part, tier)?;
    let stored = container.file_range(spec.range())?;
    Chunk::unchecked(spec, coarser, |bytes| {
        bytes.copy_from_slice(stored);
        Ok(())
    })
}

/// The bytes between a chunk and the next are zero.
fn check_padding(container: &Container, part: usize, tier: usize, findings: &mut Findings) {
    let Ok(range) = container.chunk_range(part, tier) else { return };
    let padding = container.file_range(range.end..aligned(range.end).unwrap_or(range.end));
    findings.expect(padding.is_ok_and(|bytes| bytes.iter().all(|&byte| byte == 0)), || {
        "the bytes after it are not zero".to_owned()
    });
}

/// Every slot is one of the part's.
fn check_slots(row: &PartRow, views: &[ChunkView], findings: &mut Findings) {
    for (index, vertex) in views.iter().rev().flat_map(|view| view.vertices).enumerate() {
        let slot = Attributes::Slot.tag(vertex.attributes());
        findings.expect(slot < row.slots, || format!("vertex {index} has slot {slot} of {}", row.slots));
    }
}

/// Errors do not fall while vertices are removed.
fn check_errors(row: &PartRow, findings: &mut Findings) {
    for (index, pair) in row.errors.windows(2).enumerate().filter(|(_, pair)| pair[0] > pair[1]) {
        findings
            .add(|| format!("error sample {} is {}, below sample {index}, {}", index + 1, pair[1], pair[0]));
    }
}

/// What several chunks show only together.
fn check_together(place: &str, row: &PartRow, part: &OrderedPart, findings: &mut Findings) {
    check_box(row, &part.vertices, findings);
    for (index, tier) in part.tiers.iter().enumerate() {
        findings.set_place(format!("{place}, tier {index}"));
        let coarser = part.tiers.get(index + 1);
        check_states(part, tier, coarser.map_or(part.locked, |coarser| coarser.vertices), findings);
        if let Some(coarser) = coarser {
            check_prefix(part, tier, coarser, findings);
        }
    }
}

/// All vertices lie in the part's box, and bit 63 of their positions is zero.
fn check_box(row: &PartRow, vertices: &[VertexRecord], findings: &mut Findings) {
    for (index, vertex) in vertices.iter().enumerate() {
        let grid = vertex.grid();
        let inside = (0..3).all(|axis| (row.grid_low[axis]..=row.grid_high[axis]).contains(&grid[axis]));
        findings
            .expect(inside, || format!("vertex {index} lies at grid point {grid:?}, outside the part's box"));
        let clear = vertex.packed_position() >> 63 == 0;
        findings.expect(clear, || format!("the highest bit of the position of vertex {index} is not zero"));
    }
}

/// Where every vertex below `from` ends when only `vn` are left. `ecol` has been checked to go down from `vn` on.
fn reformed_at(part: &OrderedPart, from: u32, vn: u32) -> Vec<u16> {
    let mut onto: Vec<u16> = Vec::with_capacity(from as usize);
    for (vertex, &next) in part.ecol[..from as usize].iter().enumerate() {
        // A kept vertex fits 16 bits as there are no more than 2^16.
        onto.push(if vertex < vn as usize { vertex as u16 } else { onto[usize::from(next)] });
    }
    onto
}

/// The coarser tier's list is the start of the finer one's, reformed.
fn check_prefix(part: &OrderedPart, finer: &OrderedTier, coarser: &OrderedTier, findings: &mut Findings) {
    let onto = reformed_at(part, finer.vertices, coarser.vertices);
    for (index, (fine, coarse)) in finer.triangles.iter().zip(&coarser.triangles).enumerate() {
        let reformed = fine.vertices.map(|vertex| onto[usize::from(vertex)]);
        findings.expect(reformed == coarse.vertices, || {
            format!(
                "triangle {index} becomes {reformed:?} in the next coarser tier, which has {:?}",
                coarse.vertices
            )
        });
    }
}

/// At states from the tier's own down to `least`, exactly the first `triangles_at[vn]` triangles are not degenerate.
fn check_states(part: &OrderedPart, tier: &OrderedTier, least: u32, findings: &mut Findings) {
    let states: Vec<u32> =
        (least..=tier.vertices).rev().filter(|&vn| part.triangles_at.is_state(vn as usize)).collect();
    let size = tier.vertices as usize + tier.triangles.len();
    let wanted = STATES_PER_TIER + WORK_PER_TIER / size;
    // The first is the tier's own: its whole list must not be degenerate.
    for &vn in states.iter().step_by(states.len().div_ceil(wanted).max(1)) {
        check_state(part, tier, vn, findings);
        if findings.is_full() {
            return;
        }
    }
}

fn check_state(part: &OrderedPart, tier: &OrderedTier, vn: u32, findings: &mut Findings) {
    let onto = reformed_at(part, tier.vertices, vn);
    let left = part.triangles_at.count_at(vn as usize) as usize;
    for (index, triangle) in tier.triangles.iter().enumerate() {
        let [a, b, c] =
            triangle.vertices.map(|v| part.vertices[usize::from(onto[usize::from(v)])].packed_position());
        let degenerate = a == b || b == c || c == a;
        findings.expect(degenerate == (index >= left), || {
            let is = if degenerate { "is" } else { "is not" };
            format!("triangle {index} {is} degenerate at {vn} vertices, where {left} triangles are left")
        });
    }
}
