//! The tables of a batch that the draw pass reads: where its instances are placed, and how they look.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3};

use crate::geometry::record::Attributes;
use crate::geometry::{Closure, Grid};
use crate::import::Colour;
use crate::scene::camera::split_f64;

/// One instance of a batch: 64 bytes; the same name in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct InstanceRow {
    /// Column i of the linear part times the grid step; `[3]` is component i of the translation's high part.
    pub columns: [[f32; 4]; 3],
    /// The translation's low part.
    pub translation_low: [f32; 3],
    /// sRGB in the low 24 bits, red lowest, and [`InstanceRow::COLOURED`]; or with [`InstanceRow::SLOTTED`] the number
    /// of the row whose colour slot 0 has.
    pub colour: u32,
}

impl InstanceRow {
    /// Bit of `colour`: the part's vertices carry colours, and the row's is not used.
    pub const COLOURED: u32 = 1 << 24;

    /// Bits of `colour`: the part is a closed surface, and it is placed inside out.
    pub const CLOSED: u32 = 1 << 26;
    /// See [`InstanceRow::CLOSED`].
    pub const INSIDE_OUT: u32 = 1 << 27;

    /// Bit of `colour`: the part's vertices carry slots, and the low 24 bits are the number of a row: the colour of slot
    /// `s` is that of the row `s` after it.
    pub const SLOTTED: u32 = 1 << 25;

    /// The row of a part on `grid`, placed by `world_from_part`; that of a slotted part still lacks the number of its
    /// first colour's row.
    pub fn new(world_from_part: DAffine3, grid: Grid, colour: Colour, attributes: Attributes) -> Self {
        let origin = world_from_part.transform_point3(DVec3::from_array(grid.origin));
        let (high, low) = split_f64(origin);
        let linear = world_from_part.matrix3 * grid.step();
        let column = |i: usize| linear.col(i).as_vec3().extend(high[i]).to_array();
        let flag = if attributes == Attributes::Colour { Self::COLOURED } else { 0 };
        let columns = [column(0), column(1), column(2)];
        let row = Self { columns, translation_low: low.to_array(), colour: 0 }.with_colour(colour);
        Self { colour: row.colour | flag, ..row }
    }

    /// The same row, of a part whose surface is closed or not, placed so.
    pub fn closed(self, closure: Closure, world_from_part: DAffine3) -> Self {
        let flags = match is_inside_out(closure, world_from_part) {
            None => 0,
            Some(false) => Self::CLOSED,
            Some(true) => Self::CLOSED | Self::INSIDE_OUT,
        };
        Self { colour: self.colour | flags, ..self }
    }

    /// The same row with another colour, and no flags.
    pub fn with_colour(self, [red, green, blue, _]: Colour) -> Self {
        Self { colour: u32::from_le_bytes([red, green, blue, 0]), ..self }
    }
}

/// Whether a closed surface is inside out where it is placed so.
pub(crate) fn is_inside_out(closure: Closure, world_from_part: DAffine3) -> Option<bool> {
    let is_mirrored = world_from_part.matrix3.determinant() < 0.0;
    match closure {
        Closure::Open => None,
        Closure::Closed => Some(is_mirrored),
        Closure::InsideOut => Some(!is_mirrored),
    }
}

/// How one instance differs from what its material says: its number in the scene, and the bits of a look.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct LookRow {
    /// The number of the instance in the scene.
    pub number: u32,
    /// [`Look`].
    pub look: Look,
}

/// How an instance differs from what its material says; the default does not.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable, Hash)]
pub struct Look(pub u32);

impl Look {
    /// Not drawn.
    pub const HIDDEN: Self = Self(1 << 25);
    /// Drawn so that what is behind it shows through.
    pub const GHOST: Self = Self(1 << 26);
    /// Chosen by the user.
    pub const SELECTED: Self = Self(1 << 27);
    /// Under the pointer.
    pub const HOVERED: Self = Self(1 << 28);
    const COLOURED: u32 = 1 << 24;

    /// In another colour than its material's.
    pub fn coloured([red, green, blue, _]: Colour) -> Self {
        Self(u32::from_le_bytes([red, green, blue, 0]) | Self::COLOURED)
    }

    /// Both.
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether it has all the bits of another.
    pub fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}
