//! What is to be plotted in; a range with round labels out, linear or logarithmic.
//!
//! A logarithmic axis that must show zeros has them on its floor, labelled `0`.

use crate::stats::report::human;

/// What is along an axis; decides which numbers are round and how they are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Frames, triangles, instances; also milliseconds and ratios.
    Number,
    /// Bytes, in powers of 1024.
    Bytes,
    /// Shares, in per cent.
    Percent,
}

/// An axis: positions are what the plot is drawn in, values what is plotted.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What is along it, with its unit.
    pub title: String,
    /// Positions with labels.
    pub labels: Vec<(f64, String)>,
    /// The positions of both ends.
    pub range: std::ops::Range<f64>,
    /// The value of the floor, for a logarithmic axis.
    floor: Option<f64>,
}

/// How many labels an axis has at most.
const MOST_LABELS: usize = 7;

impl Axis {
    /// From 0 to the round number at or above `high`.
    pub fn linear(title: &str, unit: Unit, high: f64) -> Self {
        let high = if high.is_finite() && high > 0.0 { high } else { 1.0 };
        let step = step(unit, high);
        let steps = (high / step).ceil().max(1.0);
        let end = step * steps;
        let labels = (0..=steps as usize).map(|i| i as f64 * step).map(|at| (at, text(unit, at))).collect();
        Self { title: title.to_owned(), labels, range: 0.0..end, floor: None }
    }

    /// From 0 to `high` and not further: for frames and shares.
    pub fn exact(title: &str, unit: Unit, high: f64) -> Self {
        let high = if high > 0.0 { high } else { 1.0 };
        let mut axis = Self::linear(title, unit, high);
        axis.labels.retain(|&(at, _)| at <= high * 1.000_001);
        axis.range.end = high;
        axis
    }

    /// Round powers around all positive values; below these a floor for zeros, if there are any.
    pub fn log(title: &str, unit: Unit, values: impl Iterator<Item = f64> + Clone) -> Self {
        let positive = values.clone().filter(|&value| value > 0.0 && value.is_finite());
        let (low, high) =
            positive.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
        // Nothing that is measured is outside, and a damaged file shall not make an endless axis.
        let within = |value: f64| value.clamp(1e-30, 1e30);
        let (low, high) = if low <= high { (within(low), within(high)) } else { (1.0, 1.0) };
        let mut ticks = powers(unit, low, high);
        let has_zero = values.into_iter().any(|value| value <= 0.0);
        let mut floor = ticks[0];
        let mut labels: Vec<_> = ticks.iter().map(|&tick| (tick.log2(), text(unit, tick))).collect();
        if has_zero {
            floor = ticks[0] * ticks[0] / ticks[1];
            labels.insert(0, (floor.log2(), "0".to_owned()));
            ticks.insert(0, floor);
        }
        let end = ticks.last().copied().unwrap_or(floor * 2.0).log2();
        Self { title: title.to_owned(), labels, range: floor.log2()..end, floor: Some(floor) }
    }

    /// Where a value lies; outside values are brought to the nearer end.
    pub fn position(&self, value: f64) -> f64 {
        let at = match self.floor {
            Some(floor) => value.max(floor).log2(),
            None => value,
        };
        at.clamp(self.range.start, self.range.end)
    }
}

/// A step that is round in its unit and gives four to seven labels up to `high`.
fn step(unit: Unit, high: f64) -> f64 {
    let base = match unit {
        Unit::Bytes => 1024f64.powf((high.max(1.0).log2() / 10.0).floor()),
        Unit::Number | Unit::Percent => 10f64.powf(high.log10().floor() - 1.0),
    };
    let steps = [0.25, 0.5, 1.0, 2.0, 2.5, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0];
    let fits = |step: &f64| high / (step * base) <= (MOST_LABELS - 1) as f64;
    base * steps.into_iter().find(fits).unwrap_or(1000.0)
}

/// Two or more powers, of which the first is at most `low` and the last at least `high`.
fn powers(unit: Unit, low: f64, high: f64) -> Vec<f64> {
    // What multiplies from label to label, the finest first that does not give too many.
    let factors: &[f64] = match unit {
        Unit::Bytes => &[2.0, 4.0, 32.0, 1024.0, 1_048_576.0],
        Unit::Number | Unit::Percent => &[10.0, 100.0, 1000.0, 1e6, 1e12],
    };
    if unit != Unit::Bytes && high / low < 50.0 {
        return one_two_five(low, high);
    }
    let all = |factor: f64| {
        let exponent = |value: f64| value.log2() / factor.log2();
        let first = (exponent(low) + 1e-9).floor() as i32;
        let last = ((exponent(high) - 1e-9).ceil() as i32).max(first + 1);
        (first..=last).map(|power| factor.powi(power)).collect::<Vec<_>>()
    };
    let fits = |factor: &&f64| all(**factor).len() <= MOST_LABELS;
    all(*factors.iter().find(fits).unwrap_or(&1e60))
}

/// Once, twice and five times powers of ten, from the last at or below `low` to the first at or above `high`.
fn one_two_five(low: f64, high: f64) -> Vec<f64> {
    let powers = low.log10().floor() as i32..=high.log10().floor() as i32 + 1;
    // By way of text, so that a thousandth is the nearest number to 0.001.
    let all: Vec<f64> = powers
        .flat_map(|power| [1, 2, 5].map(|step| format!("{step}e{power}")))
        .filter_map(|t| t.parse().ok())
        .collect();
    let first = all.iter().rposition(|&tick| tick <= low).unwrap_or(0);
    let last = all.iter().position(|&tick| tick >= high).unwrap_or(all.len() - 1).max(first + 1);
    all[first..=last].to_vec()
}

/// A round value as a label.
fn text(unit: Unit, value: f64) -> String {
    match unit {
        Unit::Bytes => trimmed(&human::bytes(value.round() as u64)),
        Unit::Percent => format!("{} %", short(value)),
        Unit::Number => short(value),
    }
}

/// `1.50 MiB` as `1.5 MiB`.
fn trimmed(text: &str) -> String {
    match text.split_once(' ') {
        Some((number, unit)) if number.contains('.') => {
            format!("{} {unit}", number.trim_end_matches('0').trim_end_matches('.'))
        }
        _ => text.to_owned(),
    }
}

/// `20 k`, `1.5 M`, `0.05`.
fn short(value: f64) -> String {
    let (scaled, suffix) = match value {
        v if v >= 1e9 => (v / 1e9, " G"),
        v if v >= 1e6 => (v / 1e6, " M"),
        v if v >= 1e4 => (v / 1e3, " k"),
        v => (v, ""),
    };
    // Twelve digits, so that no sum of steps shows its rounding.
    let text = format!("{scaled:.12}");
    format!("{}{suffix}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.labels.iter().map(|(_, text)| text.as_str()).collect()
    }

    #[test]
    fn linear_labels_are_round() {
        assert_eq!(labels(&Axis::linear("", Unit::Number, 57.0)), ["0", "10", "20", "30", "40", "50", "60"]);
        assert_eq!(
            labels(&Axis::linear("", Unit::Number, 0.3)),
            ["0", "0.05", "0.1", "0.15", "0.2", "0.25", "0.3"]
        );
        assert_eq!(
            labels(&Axis::linear("", Unit::Bytes, 1.3e6)),
            ["0 B", "256 KiB", "512 KiB", "768 KiB", "1 MiB", "1.25 MiB"]
        );
        assert_eq!(labels(&Axis::exact("", Unit::Number, 199.0)), ["0", "50", "100", "150"]);
        assert_eq!(labels(&Axis::exact("", Unit::Number, 99_999.0)), ["0", "20 k", "40 k", "60 k", "80 k"]);
    }

    #[test]
    fn logarithmic_labels_are_round_and_zero_is_the_floor() {
        let axis = Axis::log("", Unit::Bytes, [0.0, 144.0, 900_000.0].into_iter());
        assert_eq!(labels(&axis), ["0", "32 B", "1 KiB", "32 KiB", "1 MiB"]);
        assert_eq!((axis.position(0.0), axis.position(1024.0)), (0.0, 10.0));
        assert_eq!(labels(&Axis::log("", Unit::Number, [12.0, 31.0].into_iter())), ["10", "20", "50"]);
        assert_eq!(
            labels(&Axis::log("", Unit::Number, [0.003, 400.0].into_iter())),
            ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]
        );
    }

    #[test]
    fn every_axis_has_a_range_with_its_values() {
        let odd = [0.0, 1.0, 1e-9, 1e-3, 7.0, 1e9, 1.8e19, f64::MAX, f64::INFINITY, f64::NAN];
        for (unit, high) in
            [Unit::Number, Unit::Bytes, Unit::Percent].into_iter().flat_map(|u| odd.map(|v| (u, v)))
        {
            for axis in [
                Axis::linear("", unit, high),
                Axis::exact("", unit, high),
                Axis::log("", unit, [high].into_iter()),
            ] {
                assert!(axis.range.start < axis.range.end, "{unit:?} {high}: {axis:?}");
                assert!(axis.labels.len() <= MOST_LABELS + 2, "{unit:?} {high}: {axis:?}");
                assert!(
                    axis.range.contains(&axis.position(0.0))
                        && axis.position(high.min(1e300)) <= axis.range.end
                );
            }
        }
    }
}
