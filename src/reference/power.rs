//! Positive numbers in, their logarithms and powers to base 2 out, the same bits on every machine and on the GPU.
//!
//! WGSL leaves the accuracy of its own `log2` and `exp2` to the driver, and budgets must not depend on a driver.
//! These use additions, multiplications and bit operations only; `shaders/shared/power.wgsl` has the same two
//! functions, and a test compares them bit for bit. Polynomials: interpolation at Chebyshev nodes.

/// log2(1 + t) / t for t in 2^-0.5 - 1 ..= 2^0.5 - 1, constant term first; error below 7e-8.
#[expect(
    clippy::approx_constant,
    reason = "a fitted coefficient, the same as in the shader, that only comes near it"
)]
const LOG2: [f32; 9] = [
    1.442695,
    -0.72134747,
    0.48091075,
    -0.36069327,
    0.28790326,
    -0.23916988,
    0.21607822,
    -0.20586188,
    0.12310968,
];

/// 2^f for f in -0.5..=0.5, constant term first; error below 2e-8.
#[expect(
    clippy::approx_constant,
    reason = "a fitted coefficient, the same as in the shader, that only comes near it"
)]
const EXP2: [f32; 7] = [1.0, 0.6931472, 0.2402265, 0.05550327, 0.009618057, 0.0013400428, 0.00015461445];

/// The bits of the mantissa of the square root of 2.
const SQRT_2_MANTISSA: u32 = 0x35_04F3;

/// The logarithm of `x` to base 2, within about 1e-6 (relative, or absolute near 1). What is not a positive normal
/// number counts as the least one: -126.
pub fn log2(x: f32) -> f32 {
    let bits = x.max(f32::MIN_POSITIVE).to_bits();
    let mantissa = bits & 0x7F_FFFF;
    let upper = u32::from(mantissa > SQRT_2_MANTISSA);
    let exponent = (bits >> 23) as i32 - 127 + upper as i32;
    let t = f32::from_bits(mantissa | (127 - upper) << 23) - 1.0;
    exponent as f32 + t * horner(&LOG2, t)
}

/// 2 to the power of `x`, within about 2e-7 of itself, for `x` clamped to -126..=126.
pub fn exp2(x: f32) -> f32 {
    let x = x.clamp(-126.0, 126.0);
    let exponent = (x + 128.5) as i32 - 128;
    let p = horner(&EXP2, x - exponent as f32);
    f32::from_bits(p.to_bits().wrapping_add((exponent << 23) as u32))
}

fn horner(coefficients: &[f32], t: f32) -> f32 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn powers_of_two_are_exact() {
        for exponent in -126..=126 {
            assert_eq!(log2(2f32.powi(exponent)), exponent as f32);
            assert_eq!(exp2(exponent as f32), 2f32.powi(exponent));
        }
        assert_eq!(log2(0.0), -126.0);
        assert_eq!(log2(-1.0), -126.0);
    }

    proptest! {
        #[test]
        fn log2_is_close(bits in 0x0080_0000u32..0x7F80_0000) {
            let x = f32::from_bits(bits);
            let exact = f64::from(x).log2();
            prop_assert!((f64::from(log2(x)) - exact).abs() <= 1e-6f64.max(exact.abs() * 2e-7));
        }

        #[test]
        fn exp2_is_close(x in -126f32..126.0) {
            let exact = f64::from(x).exp2();
            prop_assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 4e-7);
        }
    }
}
