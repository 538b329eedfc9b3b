//! The records that go unchanged from the bake through the file to the GPU, and the part made of them.

use bytemuck::{Pod, Zeroable};

use super::{Closure, TrianglesAt};

/// The most vertices that a part may have: local indices fit 16 bits.
pub const MAX_PART_VERTICES: usize = 1 << 16;

/// The most triangles that a part may have: counts fit the 24 bits that every pass can add up safely.
pub const MAX_PART_TRIANGLES: usize = 1 << 20;

/// Bits of a position's coordinate on the grid.
pub const GRID_BITS: u32 = 21;

/// A vertex as stored and sent: 12 bytes.
///
/// Words 0 and 1 are the low and high half of a `u64` with the grid coordinates x, y, z in bits 0..21, 21..42, 42..63.
/// Word 2 is what [`Attributes`] says.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Pod, Zeroable, PartialOrd, Ord)]
pub struct VertexRecord {
    /// The three words.
    pub words: [u32; 3],
}

impl VertexRecord {
    /// Packs grid coordinates (each below 2^21) and the attribute word.
    pub fn new(grid: [u32; 3], attributes: u32) -> Self {
        let packed =
            u64::from(grid[0]) | u64::from(grid[1]) << GRID_BITS | u64::from(grid[2]) << (2 * GRID_BITS);
        Self { words: [packed as u32, (packed >> 32) as u32, attributes] }
    }

    /// The grid coordinates.
    pub fn grid(self) -> [u32; 3] {
        let packed = self.packed_position();
        let mask = (1 << GRID_BITS) - 1;
        [packed & mask, packed >> GRID_BITS & mask, packed >> (2 * GRID_BITS) & mask].map(|c| c as u32)
    }

    /// The position as one integer: two vertices share a position exactly if these are equal.
    pub fn packed_position(self) -> u64 {
        u64::from(self.words[0]) | u64::from(self.words[1]) << 32
    }

    /// The attribute word.
    pub fn attributes(self) -> u32 {
        self.words[2]
    }
}

/// What word 2 of a vertex record holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Attributes {
    /// An octahedral normal of 2 x 16 bits, x low.
    #[default]
    Normal,
    /// An octahedral normal of 2 x 8 bits in the low half, and RGB 5-6-5 in the high half, red highest.
    Colour,
    /// An octahedral normal of 2 x 12 bits, x low, and in the highest 8 bits a material slot: slot `s` of an instance
    /// is the material that comes `s` after the instance's own.
    Slot,
}

/// The most materials of a part: slots have 8 bits.
pub const MAX_SLOTS: usize = 1 << 8;

impl Attributes {
    /// What of the word is not the normal: two wedges whose tags differ may not stand for each other.
    pub fn tag(self, word: u32) -> u32 {
        match self {
            Self::Normal => 0,
            Self::Colour => word >> 16,
            Self::Slot => word >> 24,
        }
    }
}

/// A triangle as stored and sent: 8 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Pod, Zeroable)]
pub struct TriangleRecord {
    /// Local vertex indices, counter-clockwise from outside.
    pub vertices: [u16; 3],
    /// Which edges are features: see [`TriangleRecord::CREASE`] and [`TriangleRecord::BOUNDARY`].
    pub flags: u16,
}

impl TriangleRecord {
    /// Flag of edge 0 (from corner 0 to corner 1) being a crease; shift left by the edge number for the others.
    pub const CREASE: u16 = 1;
    /// Flag of edge 0 being an open boundary; shift left by the edge number for the others.
    pub const BOUNDARY: u16 = 1 << 3;
}

/// The power-of-two grid on which a part's positions lie: `position = origin + step() * grid`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// The part-space position of grid point (0, 0, 0).
    pub origin: [f64; 3],
    /// The step is 2 to this power.
    pub step_exponent: i32,
}

impl Grid {
    /// The distance between neighbouring grid points, in part units.
    pub fn step(self) -> f64 {
        f64::from(self.step_exponent).exp2()
    }

    /// The part-space position of a grid point.
    pub fn position(self, grid: [u32; 3]) -> [f64; 3] {
        let step = self.step();
        std::array::from_fn(|axis| self.origin[axis] + step * f64::from(grid[axis]))
    }
}

/// A part in collapse order: what the bake computes and the container holds.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderedPart {
    /// Where grid coordinates lie in part space.
    pub grid: Grid,
    /// What vertices carry beside their position.
    pub attributes: Attributes,
    /// All `m` vertices; the last is the first to be removed.
    pub vertices: Vec<VertexRecord>,
    /// For each vertex the one that it collapses onto: smaller than its own index, or equal for a locked vertex.
    pub ecol: Vec<u16>,
    /// How many triangles are left at each vertex count, and which counts are states.
    pub triangles_at: TrianglesAt,
    /// The tiers, finest first; tier 0 has all `m` vertices.
    pub tiers: Vec<OrderedTier>,
    /// How many vertices are left in the coarsest state (`q`).
    pub locked: u32,
    /// [`error_code`]s of the error at `m`, `m / sqrt 2`, `m / 2`, ... vertices (`m * 2^(-j/2)` for entry `j`).
    pub errors: [u8; ERROR_SAMPLES],
    /// Why the coarsest state is not coarser; [`Stall::None`] for a cell that has a parent.
    pub stall: Stall,
    /// Where it stands among the cells of its part.
    pub place: CellPlace,
    /// Whether its surface, or that of the part whose cell it is, closes off a volume.
    pub closure: Closure,
}

/// Where a cell stands among the cells of its part, which lie one after another, parents before their children. All
/// zeros for a part that was not cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct CellPlace {
    /// How many cells before it its parent is; 0 for a root, which has none.
    pub parent_distance: u32,
    /// How many leaf cells a parent cell stands for; 0 for a leaf cell.
    pub leaf_cells: u32,
}

/// How many error samples a part has.
pub const ERROR_SAMPLES: usize = 16;

/// A self-contained prefix of a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OrderedTier {
    /// How many vertices it has (`m_k`), a state of the part.
    pub vertices: u32,
    /// Triangles `0..triangles_at[m_k]`, reformed at `m_k`.
    pub triangles: Vec<TriangleRecord>,
}

/// Why no further collapse was allowed, the most frequent cause among the vertices of the coarsest state.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Stall {
    /// It went as far as it could be useful.
    #[default]
    None = 0,
    /// Vertices on open boundaries, or shared with other cells, were locked.
    Boundary = 1,
    /// A collapse would have made the surface non-manifold, or it already is.
    NonManifold = 2,
    /// A crease would have been smeared.
    Crease = 3,
    /// A triangle would have turned over.
    Flip = 4,
    /// Nothing did: what is left is the least that shows anything, and the part has few triangles.
    Least = 5,
}

impl Stall {
    /// The stored byte, read back; `None` for one that no version has written.
    pub fn from_byte(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::None,
            1 => Self::Boundary,
            2 => Self::NonManifold,
            3 => Self::Crease,
            4 => Self::Flip,
            5 => Self::Least,
            _ => return None,
        })
    }

    /// The words of the report.
    pub fn describe(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Boundary => "open boundary or cell border",
            Self::NonManifold => "non-manifold",
            Self::Crease => "crease",
            Self::Flip => "flip guard",
            Self::Least => "nothing: a part of few triangles, as coarse as it goes",
        }
    }
}

/// Encodes an error as a byte relative to the part's diagonal: code `c > 0` means `diagonal * 2^((c - 255) / 8)`,
/// code 0 means no error. Rounds up, so that a decoded error is never below the true one.
pub fn error_code(error: f64, diagonal: f64) -> u8 {
    if error <= 0.0 || diagonal <= 0.0 {
        return 0;
    }
    (255.0 + 8.0 * (error / diagonal).log2()).ceil().clamp(1.0, 255.0) as u8
}

/// The error that a code stands for, in the unit of `diagonal`.
pub fn decode_error(code: u8, diagonal: f64) -> f64 {
    if code == 0 { 0.0 } else { diagonal * ((f64::from(code) - 255.0) / 8.0).exp2() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertex_record_keeps_its_coordinates() {
        let top = (1 << GRID_BITS) - 1;
        for grid in [[0, 0, 0], [top, 0, 1], [1, top, 0], [12345, 2_000_000, top]] {
            assert_eq!(VertexRecord::new(grid, 7).grid(), grid);
        }
        assert_eq!(VertexRecord::new([0; 3], 0xdead_beef).attributes(), 0xdead_beef);
    }

    #[test]
    fn error_code_rounds_up_by_at_most_an_eighth_of_an_octave() {
        for error in [1e-7, 1e-3, 0.3, 0.999] {
            let decoded = decode_error(error_code(error, 1.0), 1.0);
            assert!(decoded >= error && decoded <= error * 1.0906, "{error} became {decoded}");
        }
        assert_eq!(error_code(0.0, 1.0), 0);
    }
}
