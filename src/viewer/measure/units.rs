//! Lengths in the model's unit in, text in the user's unit out, with no more digits than the error leaves.

use serde::{Deserialize, Serialize};

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres, the unit of glTF.
    M,
    /// Inches.
    In,
    /// Feet.
    Ft,
}

impl Unit {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Mm, Self::Cm, Self::M, Self::In, Self::Ft];

    /// Its symbol.
    pub fn word(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::M => "m",
            Self::In => "in",
            Self::Ft => "ft",
        }
    }

    /// How many metres it is; exact by definition.
    pub fn metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::M => 1.0,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}

/// In what the model is made, and in what its lengths are told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Units {
    /// The unit of the model's coordinates.
    pub model: Unit,
    /// The unit that is shown.
    pub shown: Unit,
    /// How large the real thing is for each unit of the model: 1, or 50 for a model at 1:50.
    pub scale: f64,
}

impl Default for Units {
    fn default() -> Self {
        Self { model: Unit::M, shown: Unit::M, scale: 1.0 }
    }
}

impl Units {
    /// A length of the model in the shown unit.
    pub fn convert(&self, length: f64) -> f64 {
        let scale = if self.scale.is_finite() && self.scale > 0.0 { self.scale } else { 1.0 };
        length * (scale * self.model.metres() / self.shown.metres())
    }

    /// A length of the model with about five digits, without its unit.
    fn short(&self, length: f64) -> String {
        let length = self.convert(length);
        let digits = (4.0 - length.abs().max(1e-12).log10().floor()).clamp(0.0, 9.0) as usize;
        if length == 0.0 { "0".to_owned() } else { format!("{length:.digits$}") }
    }

    /// The sides of a box of the model, as in `1.2000 × 3.0000 × 0.50000 m`.
    pub fn size(&self, [x, y, z]: [f64; 3]) -> String {
        format!("{} × {} × {} {}", self.short(x), self.short(y), self.short(z), self.shown.word())
    }

    /// A length of the model and its error, as in `12.34 ± 0.05 mm`.
    pub fn format(&self, length: f64, error: f64) -> String {
        format!("{} {}", with_error(self.convert(length), self.convert(error)), self.shown.word())
    }
}

/// The most decimals that are shown.
const MOST_DECIMALS: i32 = 12;

/// A number with its error: the error is rounded up to one digit, or two where the first is a 1, and the number to the
/// same decimals. Without an error, six digits.
pub fn with_error(value: f64, error: f64) -> String {
    if !value.is_finite() || !error.is_finite() {
        return "unknown".to_owned();
    }
    if error <= 0.0 {
        let before = value.abs().max(1.0).log10().floor() as i32;
        return plain(value, (5 - before).clamp(0, MOST_DECIMALS));
    }
    let mut decimals = decimals_for(error);
    let mut rounded = round_up(error, decimals);
    // 0.0996 becomes 0.10, which needs no third decimal.
    if decimals_for(rounded) < decimals {
        decimals = decimals_for(rounded);
        rounded = round_up(error, decimals);
    }
    format!("{} ± {}", plain(value, decimals), plain(rounded, decimals))
}

fn decimals_for(error: f64) -> i32 {
    let exponent = (error * (1.0 + 1e-12)).log10().floor();
    let leading = error / 10f64.powf(exponent);
    let digits_after = if leading < 2.0 - 1e-9 { 1 } else { 0 };
    (digits_after - exponent as i32).clamp(0, MOST_DECIMALS)
}

fn round_up(error: f64, decimals: i32) -> f64 {
    let steps = 10f64.powi(decimals);
    // What is a whole number of steps but for its last bits stays one.
    (error * steps - 1e-6).ceil().max(1.0) / steps
}

/// Without `-0.00`.
fn plain(value: f64, decimals: i32) -> String {
    let text = format!("{value:.*}", decimals as usize);
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_without_an_error_have_about_five_digits() {
        let short = |length| Units::default().short(length);
        assert_eq!(short(12.345678), "12.346");
        assert_eq!(short(123_456.7), "123457");
        assert_eq!(short(0.0), "0");
        assert_eq!(short(0.001_234_56), "0.0012346");
        let shown = Units { shown: Unit::Mm, ..Units::default() };
        assert_eq!(shown.size([1.0, 0.25, 0.0]), "1000.0 × 250.00 × 0 mm");
    }
    use proptest::prelude::*;

    #[test]
    fn the_error_says_how_many_digits_there_are() {
        for (value, error, text) in [
            (12.34, 0.05, "12.34 ± 0.05"),
            (12.3456, 0.051, "12.35 ± 0.06"),
            (12.3456, 0.0123, "12.346 ± 0.013"),
            (12.3456, 0.0996, "12.35 ± 0.10"),
            (12.3456, 3.0, "12 ± 3"),
            (1234.5, 170.2, "1234 ± 171"),
            (0.0, 0.2, "0.0 ± 0.2"),
            (-0.001, 0.05, "0.00 ± 0.05"),
            (-3.21, 0.05, "-3.21 ± 0.05"),
            (12.5, 0.0, "12.5000"),
            (0.012_345_678, 0.0, "0.01235"),
            (1e7, 0.0, "10000000"),
            (1.0, 1e-30, "1.000000000000 ± 0.000000000001"),
            (f64::NAN, 1.0, "unknown"),
            (1.0, f64::INFINITY, "unknown"),
        ] {
            assert_eq!(with_error(value, error), text, "{value} {error}");
        }
    }

    #[test]
    fn units_are_converted_and_models_scaled() {
        let units = Units { model: Unit::In, shown: Unit::Mm, scale: 1.0 };
        assert_eq!(units.format(1.0, 0.01), "25.4 ± 0.3 mm");
        let models = Units { model: Unit::Mm, shown: Unit::M, scale: 50.0 };
        assert_eq!(models.format(1000.0, 1.0), "50.00 ± 0.05 m");
        assert!((Units { shown: Unit::Ft, ..Units::default() }.convert(0.3048) - 1.0).abs() < 1e-15);
        assert_eq!(Units { scale: f64::NAN, ..Units::default() }.convert(2.0), 2.0);
        let text = serde_json::to_string(&units).unwrap();
        assert_eq!(serde_json::from_str::<Units>(&text).unwrap(), units);
        assert_eq!(serde_json::from_str::<Units>("{}").unwrap(), Units::default());
    }

    proptest! {
        #[test]
        fn what_is_said_holds_what_is(value in -1e6..1e6f64, digits in -6.0..4.0f64) {
            let error = 10f64.powf(digits);
            let text = with_error(value, error);
            let (said, around) = text.split_once(" ± ").unwrap();
            let (said, around): (f64, f64) = (said.parse().unwrap(), around.parse().unwrap());
            prop_assert!(around >= error * (1.0 - 1e-5) && around <= 2.0 * error + 1.0, "{text} for {error}");
            // Rounded to the last digit of the error.
            let last = 10f64.powi(-decimals_for(around));
            prop_assert!((said - value).abs() <= 0.5 * last + 1e-9, "{text} for {value}");
        }
    }
}
