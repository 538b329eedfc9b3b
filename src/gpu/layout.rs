//! Every struct that host and shader share, with the same names and members on both sides.
//!
//! `tests/shaders.rs` compares sizes and offsets here with those that naga computes, for each struct by name.

use bytemuck::{Pod, Zeroable};

use crate::geometry::VertexRecord;

/// Declares a shared struct, and what it looks like in memory.
macro_rules! shared {
    ($($(#[$about:meta])* pub struct $name:ident { $($(#[$field_about:meta])* pub $field:ident: $type:ty,)* })*) => {
        $(
            $(#[$about])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
            pub struct $name { $($(#[$field_about])* pub $field: $type,)* }
        )*

        /// The layouts of all shared structs.
        pub const STRUCTS: &[StructLayout] = &[$(StructLayout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: &[$((stringify!($field), std::mem::offset_of!($name, $field)),)*],
        }),*];
    };
}

/// What a shared struct looks like in memory.
#[derive(Debug, Clone, Copy)]
pub struct StructLayout {
    /// The name in both languages.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Names and byte offsets, in order.
    pub members: &'static [(&'static str, usize)],
}

/// Set in a member of a [`Grant`]: nothing of the existing block is kept, all of the new one is streamed.
pub const FRESH: u32 = 1 << 31;

/// In a [`SelectRow`]: it has no parent cell.
pub const NO_PARENT_ROW: u32 = u32::MAX;

/// A vertex in the active buffer (`vec4<u32>` in shaders).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub struct ActiveVertex {
    /// As stored and sent.
    pub record: VertexRecord,
    /// The number of its instance in the batch.
    pub instance: u32,
}

shared! {
    /// Counts of one level of a prefix sum.
    pub struct PrefixSumParams {
        /// Values that there are; beyond them, zeros are summed.
        pub input_count: u32,
        /// Sums that are wanted.
        pub output_count: u32,
    }

    /// The new budget of one instance.
    pub struct Grant {
        /// Its number in the batch.
        pub instance: u32,
        /// Active vertices (`vn`), with [`FRESH`] or without.
        pub vertices: u32,
        /// Vertices of the tier whose triangles it has (`m_k`), with [`FRESH`] or without.
        pub ecol: u32,
        /// Active triangles (`tn`), with [`FRESH`] or without.
        pub triangles: u32,
    }

    /// Counts of a grant pass.
    pub struct GrantParams {
        /// Grants.
        pub grant_count: u32,
        /// Instances of the batch.
        pub instance_count: u32,
    }

    /// Counts of a defragmentation, and where each part of the streamed words begins.
    pub struct DefragmentParams {
        /// Instances of the batch.
        pub instance_count: u32,
        /// Active vertices of all instances.
        pub vertex_total: u32,
        /// Active `ecol` entries of all instances.
        pub ecol_total: u32,
        /// Active triangles of all instances.
        pub triangle_total: u32,
        /// The first word of the streamed vertices, 3 words each.
        pub vertex_base: u32,
        /// The first word of the streamed `ecol` entries, two a word, the low half first.
        pub ecol_base: u32,
        /// The first word of the streamed triangles, 2 words each.
        pub triangle_base: u32,
        /// Zero.
        pub padding: u32,
    }

    /// Counts of a reformation.
    pub struct ReformParams {
        /// Instances of the batch.
        pub instance_count: u32,
        /// Active triangles of all instances.
        pub triangle_total: u32,
    }

    /// What selection knows of an instance. World space, world units.
    pub struct SelectRow {
        /// The centre of its box, rounded to f32.
        pub centre_high: [f32; 3],
        /// The least budget (`q`).
        pub floor: u32,
        /// What `centre_high` lacks.
        pub centre_low: [f32; 3],
        /// The greatest budget (`m`).
        pub ceiling: u32,
        /// Half the size of its box.
        pub half_extent: [f32; 3],
        /// The length that its error codes are relative to: the part's diagonal, scaled to the world.
        pub error_scale: f32,
        /// 16 error codes (`geometry::record::error_code`), the first in the lowest byte.
        pub errors: [u32; 4],
        /// The row of its parent cell, which comes before it; [`NO_PARENT_ROW`] if it has none.
        pub parent: u32,
        /// log2 of the leaf cells that a parent cell stands for; 0 for anything else.
        pub log2_cells: f32,
        /// Zero.
        pub padding: [u32; 2],
    }

    /// The view and the budget of a selection; made by `reference::select::SelectView::params`.
    pub struct SelectParams {
        /// The eye's world position, rounded to f32.
        pub eye_high: [f32; 3],
        /// Instances.
        pub instance_count: u32,
        /// What `eye_high` lacks.
        pub eye_low: [f32; 3],
        /// Vertices to spend (`N`), below 2^32 - 1.
        pub budget: u32,
        /// Frustum planes around the eye: a point p from the eye is inside where dot(xyz, p) + w >= 0.
        pub planes: [[f32; 4]; 6],
        /// log2 of the area in pixels of a circle of radius 1 at distance 1.
        pub log2_area_scale: f32,
        /// log2 of the area in pixels below which an instance is culled.
        pub log2_area_min: f32,
        /// log2 of the area in pixels above which growing does not count.
        pub log2_area_max: f32,
        /// 1 / alpha.
        pub inverse_alpha: f32,
        /// log2 of the error in world units that is allowed at distance 1.
        pub log2_error_limit: f32,
        /// 1 if errors limit the ceilings, else 0.
        pub error_limited: u32,
        /// By how much of itself a budget must be off to move.
        pub dead_band: f32,
        /// Zero: what the compiler must not know (`shaders/shared/power.wgsl`).
        pub zero: u32,
        /// Instances that are looked at.
        pub candidate_count: u32,
        /// Instances that were looked at the last time.
        pub previous_count: u32,
        /// 1 if everything is at distance 1 (a camera without perspective), else 0.
        pub parallel: u32,
        /// Zero.
        pub padding: u32,
    }

    /// An instance between the kernels of a selection; all zeros if it is culled.
    pub struct Weighed {
        /// Area to the power of 1 / alpha.
        pub weight: f32,
        /// The least budget.
        pub floor: u32,
        /// The greatest budget.
        pub ceiling: u32,
        /// The last budget.
        pub old: u32,
        /// The least factor at which it is drawn: below it, a parent is in its place.
        pub open: f32,
        /// The least factor at which it is drawn no more: from it on, its children are.
        pub close: f32,
    }

    /// How far the search for the common factor has come.
    pub struct SelectState {
        /// The bits of the greatest factor known to be affordable.
        pub low: u32,
        /// What the candidates of the next round are apart.
        pub step: u32,
        /// What the factor leaves of the budget.
        pub left: u32,
        /// Zero.
        pub padding: u32,
    }
}
