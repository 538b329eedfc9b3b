//! One chunk: its row and neighbours say what it must hold; its bytes in memory become typed slices that were checked.
//!
//! Everything that one chunk can show alone is checked here, so that what a worker has read and parsed can go to the
//! GPU: indices are in range, every walk along `ecol` ends, and the triangle counts add up to the list.

use std::ops::Range;

use super::ContainerError;
use super::finding::Findings;
use super::format::{ChunkRow, PartRow};
use crate::geometry::record::Attributes;
use crate::geometry::triangles_at::{CONTINUES, OVERFLOWS};
use crate::geometry::{TriangleRecord, VertexRecord};

/// What one chunk must hold: all that is needed to check its bytes, without the container.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChunkSpec {
    /// Index of the part.
    pub part: u32,
    /// The tier, 0 for the finest.
    pub tier: u32,
    /// Its row.
    pub row: ChunkRow,
    /// How many vertices the next coarser tier has (`m_{k+1}`); 0 for the coarsest.
    pub vertices_below: u32,
    /// How many triangles the next coarser tier has (`t_{k+1}`); 0 for the coarsest.
    pub triangles_below: u32,
    /// How many vertices the part's coarsest state has (`q`).
    pub locked: u32,
    /// How many triangles the part's coarsest state has.
    pub coarsest_triangles: u32,
    /// What its vertices carry beside their position.
    pub attributes: Attributes,
}

impl ChunkSpec {
    /// From the rows of a part's chunks, finest first. `tier` is the index of one of them.
    pub(crate) fn new(part: u32, part_row: &PartRow, rows: &[ChunkRow], tier: usize) -> Self {
        let below = rows.get(tier + 1);
        Self {
            part,
            tier: tier as u32,
            row: rows[tier],
            vertices_below: below.map_or(0, |row| row.vertices),
            triangles_below: below.map_or(0, |row| row.triangles),
            locked: part_row.locked,
            coarsest_triangles: part_row.coarsest_triangles,
            attributes: part_row.attributes(),
        }
    }

    /// Where its bytes lie in the file.
    pub fn range(&self) -> Range<u64> {
        self.row.offset..self.row.offset.saturating_add(u64::from(self.row.bytes))
    }

    /// How many vertices the chunk adds to the next coarser tier.
    pub fn added_vertices(&self) -> u32 {
        self.row.vertices.saturating_sub(self.vertices_below)
    }

    /// Bytes of the chunk in memory, however it is stored.
    pub fn plain_bytes(&self) -> u64 {
        self.row.plain_bytes(self.added_vertices())
    }

    fn is_coarsest(&self) -> bool {
        self.vertices_below == 0
    }

    pub(super) fn place(&self) -> String {
        format!("part {}, tier {}", self.part, self.tier)
    }
}

/// The data of one chunk, in its bytes as they are in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChunkView<'a> {
    /// All triangles of the tier, reformed at its vertex count (`t_k`).
    pub triangles: &'a [TriangleRecord],
    /// The vertices that the tier adds (`m_{k+1}..m_k`).
    pub vertices: &'a [VertexRecord],
    /// The overflow list of these vertices: number in the part, triangles that it adds.
    pub overflow: &'a [[u32; 2]],
    /// What these vertices collapse onto.
    pub ecol: &'a [u16],
    /// How many triangles each of these vertices adds, as [`crate::geometry::TrianglesAt`] stores it.
    pub added: &'a [u8],
}

impl<'a> ChunkView<'a> {
    /// Checks that the content of a chunk is sound by itself: every index is below the tier's vertex count, every walk
    /// along `ecol` goes down and ends at a locked vertex, and the added triangles sum up to the list's length.
    ///
    /// # Errors
    /// Content that contradicts the above.
    pub(super) fn check_all(&self, spec: &ChunkSpec) -> Result<(), ContainerError> {
        let mut findings = Findings::new(spec.place(), 1);
        self.check(spec, &mut findings);
        match findings.into_first() {
            None => Ok(()),
            Some((place, problem)) => Err(ContainerError::Malformed { place, problem }),
        }
    }

    /// Gives the slices of the bytes of a chunk in memory, without checking their content.
    ///
    /// # Errors
    /// Bytes that are not as long as the row says, or not aligned to 4.
    pub fn cut(spec: &ChunkSpec, bytes: &'a [u8]) -> Result<Self, ContainerError> {
        let added = spec.row.vertices.checked_sub(spec.vertices_below);
        let Some(added) = added.filter(|&added| spec.row.plain_bytes(added) == bytes.len() as u64) else {
            let problem = format!("its counts do not fit its {} bytes", bytes.len());
            return Err(ContainerError::Malformed { place: spec.place(), problem });
        };
        let mut rest = bytes;
        let triangles = take(&mut rest, spec.row.triangles)?;
        let vertices = take(&mut rest, added)?;
        let overflow = take(&mut rest, spec.row.overflow.into())?;
        let ecol = take(&mut rest, added)?;
        Ok(Self { triangles, vertices, overflow, ecol, added: rest })
    }

    /// Everything that the chunk can show alone.
    pub(super) fn check(&self, spec: &ChunkSpec, findings: &mut Findings) {
        self.check_triangles(spec, findings);
        self.check_ecol(spec, findings);
        self.check_overflow(spec, findings);
        self.check_counts(spec, findings);
    }

    fn check_triangles(&self, spec: &ChunkSpec, findings: &mut Findings) {
        let m = spec.row.vertices;
        for (index, triangle) in self.triangles.iter().enumerate() {
            for vertex in triangle.vertices.into_iter().filter(|&vertex| u32::from(vertex) >= m) {
                findings.add(|| format!("triangle {index} names vertex {vertex}, but the tier has {m}"));
            }
        }
    }

    fn check_ecol(&self, spec: &ChunkSpec, findings: &mut Findings) {
        for (vertex, &onto) in (spec.vertices_below..).zip(self.ecol) {
            let onto = u32::from(onto);
            if vertex < spec.locked {
                findings.expect(onto == vertex, || format!("locked vertex {vertex} collapses onto {onto}"));
            } else {
                findings
                    .expect(onto < vertex, || format!("vertex {vertex} collapses onto {onto}, not below it"));
            }
        }
    }

    /// One entry for each byte that calls for one, in the same order.
    fn check_overflow(&self, spec: &ChunkSpec, findings: &mut Findings) {
        let called_for = (spec.vertices_below..).zip(self.added).filter(|(_, byte)| **byte == OVERFLOWS);
        let listed = self.overflow.iter().map(|entry| entry[0]);
        findings.expect(called_for.map(|(vertex, _)| vertex).eq(listed), || {
            "the overflow list does not name the vertices whose byte calls for an entry, in order".to_owned()
        });
        for &[vertex, count] in self.overflow.iter().filter(|entry| entry[1] < u32::from(OVERFLOWS)) {
            findings.add(|| format!("vertex {vertex} has an overflow entry for only {count} triangles"));
        }
    }

    fn check_counts(&self, spec: &ChunkSpec, findings: &mut Findings) {
        let added = self.added_triangles(self.added.len());
        let expected = u64::from(spec.row.triangles.saturating_sub(spec.triangles_below));
        findings.expect(added == expected, || {
            format!("its vertices add {added} triangles, and its list has {expected} more than the next coarser one")
        });
        findings.expect(self.ends_a_group(self.added.len()), || {
            "its last vertex does not end a group".to_owned()
        });
        if spec.is_coarsest() {
            self.check_coarsest_state(spec, findings);
        }
    }

    fn check_coarsest_state(&self, spec: &ChunkSpec, findings: &mut Findings) {
        let (q, expected) = (spec.locked as usize, u64::from(spec.coarsest_triangles));
        findings
            .expect(self.ends_a_group(q), || format!("{q} vertices, the coarsest state, end inside a group"));
        let count = self.added_triangles(q);
        findings.expect(count == expected, || {
            format!("the coarsest state has {count} triangles, and the part's row says {expected}")
        });
    }

    /// Whether the first `count` vertices of the chunk end with a group's last.
    fn ends_a_group(&self, count: usize) -> bool {
        count.checked_sub(1).and_then(|last| self.added.get(last)).is_some_and(|&byte| byte != CONTINUES)
    }

    /// How many triangles the first `count` vertices of the chunk add.
    fn added_triangles(&self, count: usize) -> u64 {
        let mut overflow = self.overflow.iter();
        let added = self.added.iter().take(count).map(|&byte| match byte {
            CONTINUES => 0,
            OVERFLOWS => overflow.next().map_or(0, |entry| u64::from(entry[1])),
            added => u64::from(added),
        });
        added.sum()
    }
}

/// Cuts `count` records off the front.
fn take<'a, T: bytemuck::Pod>(rest: &mut &'a [u8], count: u32) -> Result<&'a [T], ContainerError> {
    let bytes = count as usize * size_of::<T>();
    let (front, back) = rest
        .split_at_checked(bytes)
        .ok_or(ContainerError::Truncated { have: rest.len() as u64, need: bytes as u64 })?;
    *rest = back;
    bytemuck::try_cast_slice(front).map_err(|_| ContainerError::Misaligned)
}
