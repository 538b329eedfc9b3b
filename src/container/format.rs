//! The rows of a `.clps` file, version 1, and where they lie: the specification of `docs/format.md` as types.
//!
//! All numbers are little-endian. The file is: header, section table, eight sections in the order of [`SectionKind`],
//! payload chunks in the order of [`payload_order`]; each section and chunk starts at the first multiple of
//! [`ALIGNMENT`] after what precedes it, and the bytes between are zero.

use bytemuck::{Pod, Zeroable};
use glam::DAffine3;
use xxhash_rust::xxh3::xxh3_64;

use crate::geometry::record::{Attributes, CellPlace, ERROR_SAMPLES, Stall};
use crate::geometry::{Closure, Grid};

#[cfg(target_endian = "big")]
compile_error!("container rows are read in place, and the file is little-endian");

/// The first bytes. The line ends and the end-of-file character show a transfer in text mode, the first byte one that
/// strips the eighth bit.
pub const MAGIC: [u8; 8] = *b"\x89CLPS\r\n\x1a";
/// The version that this program reads and writes.
pub const VERSION: u32 = 1;
/// Sections and chunks start at multiples of this.
pub const ALIGNMENT: u64 = 16;
/// How many sections there are.
pub const SECTIONS: usize = 8;
/// Where the first section starts.
pub const SECTIONS_START: u64 = (size_of::<Header>() + SECTIONS * size_of::<SectionRow>()) as u64;
/// The most cells on the way from a root cell to a leaf cell.
pub const MAX_CELL_DEPTH: usize = 16;
/// The most groups on the way from the first group to a leaf.
pub const MAX_GROUP_DEPTH: usize = 64;
/// The parent of a node that has none.
pub const NO_PARENT: u32 = u32::MAX;

/// The checksum of every table and chunk: xxh3 with 64 bits and seed 0.
pub fn checksum(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

/// The first multiple of [`ALIGNMENT`] that is not below `offset`; `None` if no `u64` is.
pub fn aligned(offset: u64) -> Option<u64> {
    offset.checked_next_multiple_of(ALIGNMENT)
}

/// The first 64 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// [`VERSION`]. Magic and version lie here in every version of the format.
    pub version: u32,
    /// [`SECTIONS`].
    pub section_count: u32,
    /// The length of the whole file.
    pub file_bytes: u64,
    /// Where the payload starts.
    pub payload_offset: u64,
    /// The length of the payload; it ends with the file.
    pub payload_bytes: u64,
    /// Zero.
    pub reserved: u64,
    /// Checksum of the section table.
    pub table_checksum: u64,
    /// Checksum of the 56 bytes before it.
    pub header_checksum: u64,
}

impl Header {
    /// The checksum that belongs in `header_checksum`.
    pub fn own_checksum(&self) -> u64 {
        checksum(&bytemuck::bytes_of(self)[..size_of::<Self>() - size_of::<u64>()])
    }
}

/// What a section holds; sections come in this order, and the numbers are those in the file.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SectionKind {
    /// [`PartRow`]s.
    Parts = 1,
    /// [`ChunkRow`]s, part by part, finest tier first.
    Chunks = 2,
    /// [`InstanceRow`]s.
    Instances = 3,
    /// [`NodeRow`]s, parents before children.
    Nodes = 4,
    /// [`MaterialRow`]s.
    Materials = 5,
    /// The names, one blob of UTF-8; a row is a byte.
    Names = 6,
    /// [`GroupRow`]s, each before those below it.
    Groups = 7,
    /// The instances in the order of the groups' leaves; a row is a u32.
    Members = 8,
}

impl SectionKind {
    /// All, in the order of the file.
    pub const ALL: [Self; SECTIONS] = [
        Self::Parts,
        Self::Chunks,
        Self::Instances,
        Self::Nodes,
        Self::Materials,
        Self::Names,
        Self::Groups,
        Self::Members,
    ];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parts => "parts",
            Self::Chunks => "chunks",
            Self::Instances => "instances",
            Self::Nodes => "nodes",
            Self::Materials => "materials",
            Self::Names => "names",
            Self::Groups => "groups",
            Self::Members => "members",
        }
    }

    /// The size of its rows.
    pub fn row_bytes(self) -> usize {
        match self {
            Self::Parts => size_of::<PartRow>(),
            Self::Chunks => size_of::<ChunkRow>(),
            Self::Instances => size_of::<InstanceRow>(),
            Self::Nodes => size_of::<NodeRow>(),
            Self::Materials => size_of::<MaterialRow>(),
            Self::Names => 1,
            Self::Groups => size_of::<GroupRow>(),
            Self::Members => size_of::<u32>(),
        }
    }
}

/// An entry of the section table.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct SectionRow {
    /// A [`SectionKind`].
    pub kind: u32,
    /// The size of a row.
    pub row_bytes: u32,
    /// Where the section starts in the file.
    pub offset: u64,
    /// How many rows there are.
    pub rows: u64,
    /// Checksum of `rows * row_bytes` bytes.
    pub checksum: u64,
}

/// A part, without its payload.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct PartRow {
    /// The part-space position of grid point (0, 0, 0).
    pub origin: [f64; 3],
    /// The grid's step is 2 to this power, in part units.
    pub step_exponent: i32,
    /// [`PartRow::COLOURED`], [`PartRow::CELL`].
    pub flags: u32,
    /// The least grid coordinates of its vertices.
    pub grid_low: [u32; 3],
    /// The greatest grid coordinates of its vertices.
    pub grid_high: [u32; 3],
    /// How many vertices it has (`m`).
    pub vertices: u32,
    /// How many triangles it has at `m`.
    pub triangles: u32,
    /// How many vertices its coarsest state has (`q`).
    pub locked: u32,
    /// How many triangles its coarsest state has.
    pub coarsest_triangles: u32,
    /// Where its name starts in the names.
    pub name_offset: u64,
    /// The length of its name.
    pub name_bytes: u32,
    /// The number of the source part; all cells of one cut part share it.
    pub source: u32,
    /// Its first chunk row, the one of tier 0.
    pub first_chunk: u32,
    /// How many tiers it has.
    pub tier_count: u32,
    /// Error codes at `m * 2^(-j/2)` vertices for entry `j`.
    pub errors: [u8; ERROR_SAMPLES],
    /// A [`Stall`].
    pub stall: u8,
    /// Zero.
    pub reserved: [u8; 3],
    /// How many rows before it the row of its parent cell is; 0 if it has none.
    pub parent_distance: u32,
    /// How many leaf cells a parent cell stands for; 0 for any other part.
    pub leaf_cells: u32,
    /// How many materials it has, if its vertices carry slots; otherwise 0.
    pub slots: u32,
}

impl PartRow {
    /// Flag: attributes are a normal of 2 x 8 bits and a colour of 5-6-5 bits.
    pub const COLOURED: u32 = 1;
    /// Flag: it is one of the cells of a part that was cut.
    pub const CELL: u32 = 2;

    /// Flag: attributes are a normal of 2 x 12 bits and a material slot of 8 bits.
    pub const SLOTTED: u32 = 4;
    /// Flag: its surface, or that of the part whose cell it is, closes off a volume.
    pub const CLOSED: u32 = 8;
    /// Flag, only with [`PartRow::CLOSED`]: its triangles are clockwise from outside.
    pub const INSIDE_OUT: u32 = 16;

    /// Whether its surface closes off a volume.
    pub fn closure(&self) -> Closure {
        match (self.flags & Self::CLOSED != 0, self.flags & Self::INSIDE_OUT != 0) {
            (true, false) => Closure::Closed,
            (true, true) => Closure::InsideOut,
            (false, _) => Closure::Open,
        }
    }

    /// The grid of its positions.
    pub fn grid(&self) -> Grid {
        Grid { origin: self.origin, step_exponent: self.step_exponent }
    }

    /// What vertices carry beside their position.
    pub fn attributes(&self) -> Attributes {
        match (self.flags & Self::SLOTTED != 0, self.flags & Self::COLOURED != 0) {
            (true, _) => Attributes::Slot,
            (false, true) => Attributes::Colour,
            (false, false) => Attributes::Normal,
        }
    }

    /// Whether it is a cell of a part that was cut.
    pub fn is_cell(&self) -> bool {
        self.flags & Self::CELL != 0
    }

    /// Whether it is a parent cell: other parts are drawn in its place where that is too coarse.
    pub fn is_parent(&self) -> bool {
        self.leaf_cells > 0
    }

    /// Whether it has no parent, so that its coarsest state is the coarsest of what it stands for.
    pub fn is_root(&self) -> bool {
        self.parent_distance == 0
    }

    /// Whether it is all of its part, and not one of several cells.
    pub fn is_whole(&self) -> bool {
        self.is_root() && !self.is_parent()
    }

    /// Where it stands among the cells of its part.
    pub fn place(&self) -> CellPlace {
        CellPlace { parent_distance: self.parent_distance, leaf_cells: self.leaf_cells }
    }

    /// Why its coarsest state is not coarser ([`Stall::None`] for an unknown byte, which no opened container has).
    pub fn stall(&self) -> Stall {
        Stall::from_byte(self.stall).unwrap_or_default()
    }

    /// The low and high corner of its bounding box, in part space.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        [self.grid_low, self.grid_high].map(|corner| self.grid().position(corner))
    }
}

/// Where the chunk of one (part, tier) lies and what it holds.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct ChunkRow {
    /// Where it starts in the file.
    pub offset: u64,
    /// Its length as it is stored, without padding.
    pub bytes: u32,
    /// How many vertices the tier has (`m_k`).
    pub vertices: u32,
    /// How many triangles the tier has (`t_k`).
    pub triangles: u32,
    /// How many overflow entries the chunk has.
    pub overflow: u16,
    /// A [`Form`].
    pub form: u16,
    /// Checksum of its bytes as they are stored, without padding.
    pub checksum: u64,
}

/// How the bytes of a chunk are stored.
#[repr(u16)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Form {
    /// As they are in memory.
    Plain = 0,
    /// The flags of a triangle take one byte, not two.
    #[default]
    Narrow = 1,
    /// As differences from the coarser tiers, through zstd.
    Compressed = 2,
}

impl Form {
    /// The stored number, read back; `None` for one that no version has written.
    pub fn from_number(number: u16) -> Option<Self> {
        [Self::Plain, Self::Narrow, Self::Compressed].into_iter().find(|&form| form as u16 == number)
    }
}

impl ChunkRow {
    /// How it is stored; `None` for an unknown number, which no opened container has.
    pub fn form(&self) -> Option<Form> {
        Form::from_number(self.form)
    }

    /// The length in memory of a chunk that adds `added` vertices to the next coarser tier.
    pub fn plain_bytes(&self, added: u32) -> u64 {
        8 * u64::from(self.triangles) + (12 + 2 + 1) * u64::from(added) + 8 * u64::from(self.overflow)
    }
}

/// A placement of a part; a part that was cut has one for each cell.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct InstanceRow {
    /// Index of a part.
    pub part: u32,
    /// Index of a node.
    pub node: u32,
    /// Index of a material.
    pub material: u32,
    /// Zero.
    pub flags: u32,
    /// Part space to world space: the three columns of the linear part, then the translation.
    pub world_from_part: [f64; 12],
}

impl InstanceRow {
    /// The transform; all its numbers are finite, but it may mirror, flatten or scale to zero.
    pub fn transform(&self) -> DAffine3 {
        DAffine3::from_cols_array(&self.world_from_part)
    }
}

/// A node of the assembly tree.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct NodeRow {
    /// Where its name starts in the names.
    pub name_offset: u64,
    /// The length of its name.
    pub name_bytes: u32,
    /// Index of its parent, smaller than its own, or [`NO_PARENT`].
    pub parent: u32,
}

/// A material.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct MaterialRow {
    /// Where its name starts in the names.
    pub name_offset: u64,
    /// The length of its name.
    pub name_bytes: u32,
    /// Base colour, sRGB with alpha.
    pub base_colour: [u8; 4],
}

/// A group of instances that lie near each other, or of smaller groups: selection leaves out all of it at once.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct GroupRow {
    /// The low corner of a box around the boxes of all its members, in world space.
    pub low: [f64; 3],
    /// The high corner.
    pub high: [f64; 3],
    /// No member's bounding circle (half the diagonal of its box) is larger.
    pub radius: f32,
    /// Its first member.
    pub first: u32,
    /// How many members it has.
    pub count: u32,
    /// The first group after it that does not lie below it; the next one for a leaf.
    pub end: u32,
}

impl GroupRow {
    /// Whether nothing lies below it but its members.
    pub fn is_leaf(&self, own: usize) -> bool {
        self.end as usize == own + 1
    }

    /// Its members, as a range of the section of members.
    pub fn members(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

/// The order of the chunks in the payload, as (part, tier): the coarsest tier of every part, then the second coarsest
/// of every part that has one, and so on; parts by index within each.
///
/// Takes the number of tiers of every part; time and memory follow their sum.
pub fn payload_order(tier_counts: &[u32]) -> impl Iterator<Item = (u32, u32)> {
    let mut round = 0;
    let mut left: Vec<u32> = (0..tier_counts.len() as u32).collect();
    std::iter::from_fn(move || {
        left.retain(|&part| tier_counts[part as usize] > round);
        round += 1;
        (!left.is_empty())
            .then(|| left.iter().map(|&part| (part, tier_counts[part as usize] - round)).collect())
    })
    .flat_map(|chunks: Vec<(u32, u32)>| chunks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn rows_have_the_sizes_and_offsets_of_the_specification() {
        assert_eq!(size_of::<Header>(), 64);
        assert_eq!(offset_of!(Header, header_checksum), 56);
        assert_eq!(size_of::<SectionRow>(), 32);
        assert_eq!(SECTIONS_START, 320);
        assert_eq!(SectionKind::ALL.map(SectionKind::row_bytes), [128, 32, 112, 16, 16, 1, 64, 4]);
        assert_eq!([offset_of!(ChunkRow, overflow), offset_of!(ChunkRow, form)], [20, 22]);
        assert_eq!(offset_of!(PartRow, vertices), 56);
        assert_eq!(offset_of!(PartRow, name_offset), 72);
        assert_eq!(offset_of!(PartRow, errors), 96);
        assert_eq!(offset_of!(PartRow, stall), 112);
        assert_eq!(offset_of!(InstanceRow, world_from_part), 16);
        assert_eq!(offset_of!(GroupRow, radius), 48);
    }

    #[test]
    fn the_payload_starts_with_the_coarsest_tier_of_every_part() {
        let order: Vec<_> = payload_order(&[2, 1, 3]).collect();
        assert_eq!(order, [(0, 1), (1, 0), (2, 2), (0, 0), (2, 1), (2, 0)]);
        assert_eq!(payload_order(&[]).count(), 0);
    }
}
