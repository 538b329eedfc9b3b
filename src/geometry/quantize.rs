//! Positions onto a power-of-two grid, normals onto an octahedron, colours to 5-6-5; and back.
//!
//! Octahedral normals: Meyer et al. 2010, *On Floating-Point Normal Vectors*; signed-normalised components as WGSL's
//! `unpack2x16snorm` and `unpack4x8snorm` read them, so that the six axes are exact.

use super::record::{Attributes, GRID_BITS, Grid, VertexRecord};

/// The finest step exponent: 2^-1022 is the least normal f64.
const LEAST_STEP_EXPONENT: i32 = -1022;

impl Grid {
    /// The finest power-of-two grid of 2^21 points a side on which a box fits, with its origin on a grid point.
    ///
    /// `low` and `high` are finite; a box of no extent gets a step near the precision of its coordinates.
    pub fn around(low: [f64; 3], high: [f64; 3]) -> Self {
        let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let magnitude = (0..3).map(|axis| low[axis].abs().max(high[axis].abs())).fold(0.0, f64::max);
        // The last point is left free because rounding to the origin's grid point may cost one step at either end.
        let points = f64::from((1u32 << GRID_BITS) - 2);
        let by_extent = (extent / points).log2().ceil();
        // An f32 coordinate carries 24 bits; nothing is gained by a grid much finer than the input's own.
        let by_precision = (magnitude * 2f64.powi(-27)).log2().ceil();
        let exponent = by_extent.max(by_precision);
        let step_exponent =
            if exponent.is_finite() { (exponent as i32).max(LEAST_STEP_EXPONENT) } else { -24 };
        let step = f64::from(step_exponent).exp2();
        Self { origin: low.map(|c| (c / step).floor() * step), step_exponent }
    }

    /// The grid point nearest to a position inside the box that the grid was made around.
    pub fn quantize(self, position: [f64; 3]) -> [u32; 3] {
        let step = self.step();
        let top = f64::from((1u32 << GRID_BITS) - 1);
        std::array::from_fn(|axis| {
            ((position[axis] - self.origin[axis]) / step).round_ties_even().clamp(0.0, top) as u32
        })
    }
}

/// A unit normal folded onto the octahedron: two components in -1..=1. A zero or non-finite normal becomes +z.
fn fold(normal: [f32; 3]) -> [f32; 2] {
    let sum = normal.iter().map(|c| c.abs()).sum::<f32>();
    if !(sum > 0.0 && sum.is_finite()) {
        return [0.0, 0.0];
    }
    let [x, y] = [normal[0] / sum, normal[1] / sum];
    if normal[2] >= 0.0 { [x, y] } else { [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)] }
}

/// The inverse of [`fold`], normalised.
fn unfold([x, y]: [f32; 2]) -> [f32; 3] {
    let z = 1.0 - x.abs() - y.abs();
    let inside = (-z).max(0.0);
    let n = [x - inside.copysign(x), y - inside.copysign(y), z];
    let length = n.iter().map(|c| c * c).sum::<f32>().sqrt();
    n.map(|c| c / length)
}

/// Encodes a normal in 2 x 16 bits.
pub fn encode_normal(normal: [f32; 3]) -> u32 {
    let [x, y] = fold(normal).map(|c| (c * 32767.0).round() as i16 as u16);
    u32::from(x) | u32::from(y) << 16
}

/// Decodes a normal of 2 x 16 bits; the result has length 1.
pub fn decode_normal(word: u32) -> [f32; 3] {
    unfold([word as u16, (word >> 16) as u16].map(|c| (f32::from(c as i16) / 32767.0).max(-1.0)))
}

/// Encodes a normal in 2 x 8 bits and an sRGB colour in 5-6-5.
pub fn encode_coloured(normal: [f32; 3], [r, g, b, _]: [u8; 4]) -> u32 {
    let [x, y] = fold(normal).map(|c| (c * 127.0).round() as i8 as u8);
    let scale = |c: u8, top: u32| (u32::from(c) * top + 127) / 255;
    let rgb = scale(r, 31) << 11 | scale(g, 63) << 5 | scale(b, 31);
    u32::from(x) | u32::from(y) << 8 | rgb << 16
}

/// Encodes a normal in 2 x 12 bits and a material slot.
pub fn encode_slotted(normal: [f32; 3], slot: u8) -> u32 {
    let [x, y] = fold(normal).map(|c| (c * 2047.0).round() as i32 as u32 & 0xfff);
    x | y << 12 | u32::from(slot) << 24
}

/// Decodes what [`encode_slotted`] made.
pub fn decode_slotted(word: u32) -> ([f32; 3], u8) {
    // Up to the sign bit and down again, so that it spreads.
    let signed = |bits: u32| ((bits << 20) as i32 >> 20) as f32;
    let normal = unfold([word & 0xfff, word >> 12 & 0xfff].map(|bits| (signed(bits) / 2047.0).max(-1.0)));
    (normal, (word >> 24) as u8)
}

/// Decodes what [`encode_coloured`] made: the normal and the colour with full alpha.
pub fn decode_coloured(word: u32) -> ([f32; 3], [u8; 4]) {
    let normal = unfold([word as u8, (word >> 8) as u8].map(|c| (f32::from(c as i8) / 127.0).max(-1.0)));
    let scale = |c: u32, top: u32| ((c * 255 + top / 2) / top) as u8;
    let colour = [scale(word >> 27, 31), scale(word >> 21 & 63, 63), scale(word >> 16 & 31, 31), 255];
    (normal, colour)
}

impl VertexRecord {
    /// The unit normal, whichever way it is stored.
    pub fn normal(self, attributes: Attributes) -> [f32; 3] {
        match attributes {
            Attributes::Normal => decode_normal(self.attributes()),
            Attributes::Colour => decode_coloured(self.attributes()).0,
            Attributes::Slot => decode_slotted(self.attributes()).0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
        (0..3).map(|i| a[i] * b[i]).sum()
    }

    #[test]
    fn axes_are_exact() {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut n = [0.0; 3];
                n[axis] = sign;
                assert_eq!(decode_normal(encode_normal(n)), n);
                assert_eq!(decode_coloured(encode_coloured(n, [255, 0, 255, 255])), (n, [255, 0, 255, 255]));
                assert_eq!(decode_slotted(encode_slotted(n, 201)), (n, 201));
            }
        }
    }

    #[test]
    fn grids_of_twenty_metres_have_steps_of_fifteen_micrometres() {
        let grid = Grid::around([0.0; 3], [20.0, 1.0, 1.0]);
        assert_eq!(grid.step(), 2f64.powi(-16));
    }

    proptest! {
        #[test]
        fn normals_come_back_within_a_small_angle(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            let length = dot([x, y, z], [x, y, z]).sqrt();
            prop_assume!(length > 1e-3);
            let n = [x, y, z].map(|c| c / length);
            prop_assert!(dot(n, decode_normal(encode_normal(n))) > 0.999_999);
            prop_assert!(dot(n, decode_coloured(encode_coloured(n, [0; 4])).0) > 0.999);
            prop_assert!(dot(n, decode_slotted(encode_slotted(n, 0)).0) > 0.999_998);
        }

        #[test]
        fn positions_come_back_within_half_a_step(
            low in prop::array::uniform3(-1e6f64..1e6),
            extent in prop::array::uniform3(0f64..1e4),
            at in prop::array::uniform3(0f64..=1.0),
        ) {
            let high = std::array::from_fn(|i| low[i] + extent[i]);
            let grid = Grid::around(low, high);
            let p: [f64; 3] = std::array::from_fn(|i| low[i] + extent[i] * at[i]);
            let back = grid.position(grid.quantize(p));
            for axis in 0..3 {
                prop_assert!((back[axis] - p[axis]).abs() <= grid.step() * 0.500_001);
            }
        }
    }
}
