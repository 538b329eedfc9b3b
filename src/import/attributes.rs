//! Checks and conversions of vertex attributes that all formats share.

use super::Colour;

/// Coordinates beyond this count as broken: their squares and products would leave the range of `f64` sums
/// and of every grid.
const MAX_COORDINATE: f32 = 1e30;

/// White and opaque: a vertex colour that says nothing.
pub(super) const WHITE: Colour = [255; 4];

/// Whether a position can be drawn at all.
pub(super) fn is_usable(position: [f32; 3]) -> bool {
    // NaN fails every comparison.
    position.iter().all(|c| c.abs() <= MAX_COORDINATE)
}

/// The vector at length 1; `None` if it has no direction.
pub(super) fn unit(vector: [f32; 3]) -> Option<[f32; 3]> {
    let wide = vector.map(f64::from);
    let length = wide.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length.is_finite() && length > 1e-12).then(|| wide.map(|c| (c / length) as f32))
}

/// A channel of 0..1 as 8 bits.
pub(super) fn channel(value: f32) -> u8 {
    // The cast saturates, and makes 0 of NaN.
    (value * 255.0).round() as u8
}

/// A linear colour as sRGB; alpha stays linear.
pub(super) fn srgb_from_linear([r, g, b, a]: [f32; 4]) -> Colour {
    [channel(encode(r)), channel(encode(g)), channel(encode(b)), channel(a)]
}

/// The sRGB transfer function (IEC 61966-2-1).
fn encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// An sRGB colour in linear light; alpha is linear already.
pub(super) fn linear_from_srgb([r, g, b, a]: Colour) -> [f32; 4] {
    [decode(r), decode(g), decode(b), f32::from(a) / 255.0]
}

/// The inverse of [`encode`] for 8 bits.
fn decode(channel: u8) -> f32 {
    let encoded = f32::from(channel) / 255.0;
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_positions_are_not_usable() {
        assert!(is_usable([0.0, -1e29, 6.4e6]));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -3e38] {
            assert!(!is_usable([0.0, bad, 0.0]));
        }
    }

    #[test]
    fn unit_refuses_what_has_no_direction() {
        assert_eq!(unit([0.0, 0.0, -3.0]), Some([0.0, 0.0, -1.0]));
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([f32::NAN, 1.0, 0.0]), None);
        assert_eq!(unit([f32::INFINITY, 1.0, 0.0]), None);
    }

    #[test]
    fn linear_colours_become_srgb() {
        assert_eq!(srgb_from_linear([0.0, 0.215_861, 1.0, 0.5]), [0, 128, 255, 128]);
        assert_eq!(srgb_from_linear([f32::NAN, 7.0, -1.0, 1.0]), [0, 255, 0, 255]);
        for byte in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb([byte; 4])), [byte; 4]);
        }
    }
}
