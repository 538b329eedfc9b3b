//! Measured parts in, pooled figures for people and programs out.

use serde::Serialize;

use super::{Level, PartOutcome};

/// The error of a container's levels of detail.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Source parts that were compared.
    pub parts: u64,
    /// Triangles of all of them.
    pub triangles: u64,
    /// The diagonal of the largest part's box, in part units.
    pub diagonal: f64,
    /// One row per ratio, in the order asked for.
    pub rows: Vec<RatioRow>,
    /// One row per ratio and part.
    #[serde(skip)]
    pub part_rows: Vec<PartRow>,
}

/// All parts at one ratio, pooled by area; lengths in part units.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RatioRow {
    /// The share of the triangles that was asked for.
    pub ratio: f64,
    /// Parts of which both simplifiers left something.
    pub parts_compared: u64,
    /// Parts of which one of them left nothing; not in any other figure.
    pub parts_vanished: u64,
    /// The container's levels of detail.
    pub ours: Figures,
    /// meshoptimizer's at the same counts; `None` if it was not run.
    pub meshoptimizer: Option<Figures>,
    /// RMS distance of ours over meshoptimizer's; `None` without one, or if that is 0.
    pub rms_ratio: Option<f64>,
    /// Normal deviation of ours over meshoptimizer's.
    pub normal_ratio: Option<f64>,
    /// The greatest error that the container states for a part; `None` if it states none for some part.
    pub stated_max: Option<f64>,
    /// Of all parts the greatest quotient of measured maximum and stated error, each at least a millionth of the part's
    /// diagonal; `None` if none can be formed.
    pub measured_over_stated: Option<f64>,
    /// Of all parts the greatest quotient of stated error and measured maximum; `None` if none can be formed.
    pub stated_over_measured: Option<f64>,
}

/// The pooled figures of one simplifier.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Triangles of the parts compared.
    pub triangles: u64,
    /// RMS distance: quadratic mean over the parts by area.
    pub rms: f64,
    /// Mean distance: mean over the parts by area.
    pub mean: f64,
    /// Greatest distance of any part.
    pub max: f64,
    /// Mean angle between normals in degrees: mean over the parts by area.
    pub normal_degrees: f64,
}

/// One part at one ratio; lengths in part units, empty where there is no figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartRow {
    /// Number of the source part, from 0.
    pub part: u32,
    /// Its name.
    pub name: String,
    /// How many cells it has.
    pub cells: u64,
    /// Triangles at full detail.
    pub triangles: u64,
    /// The diagonal of its box.
    pub diagonal: f64,
    /// The share of the triangles that was asked for.
    pub ratio: f64,
    /// The container's level of detail; `None` if nothing is left.
    pub ours: Option<Figures>,
    /// meshoptimizer's; `None` if nothing is left or it was not run.
    pub meshoptimizer: Option<Figures>,
    /// The error that the container states.
    pub stated: Option<f64>,
}

impl Comparison {
    pub(super) fn pooled(ratios: &[f64], outcomes: &[PartOutcome]) -> Self {
        let rows = ratios.iter().enumerate().map(|(nth, &ratio)| RatioRow::pooled(ratio, nth, outcomes));
        let part_rows = (0..ratios.len())
            .flat_map(|nth| outcomes.iter().map(move |outcome| PartRow::of(outcome, ratios[nth], nth)));
        Self {
            parts: outcomes.len() as u64,
            triangles: outcomes.iter().map(|outcome| outcome.triangles).sum(),
            diagonal: outcomes.iter().map(|outcome| outcome.diagonal).fold(0.0, f64::max),
            rows: rows.collect(),
            part_rows: part_rows.collect(),
        }
    }

    /// Forgets all ratios but the first so many.
    pub fn keep_first(&mut self, ratios: usize) {
        self.rows.truncate(ratios);
        self.part_rows.truncate(ratios * self.parts as usize);
    }
}

impl RatioRow {
    fn pooled(ratio: f64, nth: usize, outcomes: &[PartOutcome]) -> Self {
        let left = |level: &Level| level.error.is_some();
        let compared: Vec<&PartOutcome> = outcomes
            .iter()
            .filter(|part| left(&part.at[nth].ours) && part.at[nth].meshoptimizer.as_ref().is_none_or(left))
            .collect();
        let pool = |pick: fn(&super::Measured) -> Option<Level>| {
            let levels = compared.iter().map(|part| Some((part.area, pick(&part.at[nth])?)));
            Some(Figures::pooled(&levels.collect::<Option<Vec<_>>>()?))
        };
        let ran = outcomes.iter().any(|part| part.at[nth].meshoptimizer.is_some());
        let ours = pool(|measured| Some(measured.ours)).unwrap_or_default();
        let meshoptimizer = if ran { pool(|measured| measured.meshoptimizer) } else { None };
        let stated = || compared.iter().map(|part| part.at[nth].stated);
        let pairs = || {
            compared.iter().filter_map(|part| {
                let least = part.diagonal * PRECISION;
                Some((part.at[nth].ours.error?.max().max(least), part.at[nth].stated?.max(least)))
            })
        };
        let worst = |quotients: &mut dyn Iterator<Item = Option<f64>>| quotients.flatten().reduce(f64::max);
        Self {
            ratio,
            parts_compared: compared.len() as u64,
            parts_vanished: (outcomes.len() - compared.len()) as u64,
            ours,
            meshoptimizer,
            rms_ratio: meshoptimizer.and_then(|other| quotient(ours.rms, other.rms)),
            normal_ratio: meshoptimizer.and_then(|other| quotient(ours.normal_degrees, other.normal_degrees)),
            stated_max: stated().try_fold(0.0, |most: f64, error| Some(most.max(error?))),
            measured_over_stated: worst(&mut pairs().map(|(measured, stated)| quotient(measured, stated))),
            stated_over_measured: worst(&mut pairs().map(|(measured, stated)| quotient(stated, measured))),
        }
    }
}

/// Lengths below this share of a part's diagonal are below the step of its grid, and count as one.
const PRECISION: f64 = 1e-6;

/// `None` where it means nothing.
fn quotient(a: f64, b: f64) -> Option<f64> {
    let quotient = a / b;
    quotient.is_finite().then_some(quotient)
}

impl Figures {
    /// Pools levels with their areas; those without an error are nothing.
    fn pooled(levels: &[(f64, Level)]) -> Self {
        let with_error = || levels.iter().filter_map(|&(area, level)| Some((area, level.error?)));
        let area: f64 = with_error().map(|(area, _)| area).sum();
        // Parts may all be flat to nothing.
        let by_area = |sum: f64| if area > 0.0 { sum / area } else { 0.0 };
        Self {
            triangles: levels.iter().map(|(_, level)| level.triangles).sum(),
            rms: by_area(with_error().map(|(area, error)| area * error.rms().powi(2)).sum()).sqrt(),
            mean: by_area(with_error().map(|(area, error)| area * error.mean()).sum()),
            max: with_error().map(|(_, error)| error.max()).fold(0.0, f64::max),
            normal_degrees: by_area(with_error().map(|(area, error)| area * error.normal_degrees()).sum()),
        }
    }
}

impl PartRow {
    /// The columns of the CSV.
    pub const COLUMNS: [&'static str; 17] = [
        "part",
        "name",
        "cells",
        "triangles",
        "diagonal",
        "ratio",
        "ours_triangles",
        "ours_rms",
        "ours_mean",
        "ours_max",
        "ours_normal_degrees",
        "meshoptimizer_triangles",
        "meshoptimizer_rms",
        "meshoptimizer_mean",
        "meshoptimizer_max",
        "meshoptimizer_normal_degrees",
        "stated_max",
    ];

    fn of(outcome: &PartOutcome, ratio: f64, nth: usize) -> Self {
        let figures = |level: Level| level.error.map(|_| Figures::pooled(&[(1.0, level)]));
        let measured = &outcome.at[nth];
        Self {
            part: outcome.number,
            name: outcome.name.clone(),
            cells: outcome.cells,
            triangles: outcome.triangles,
            diagonal: outcome.diagonal,
            ratio,
            ours: figures(measured.ours),
            meshoptimizer: measured.meshoptimizer.and_then(figures),
            stated: measured.stated,
        }
    }

    /// A line of the CSV, without its end; the name is quoted (RFC 4180).
    pub fn csv(&self) -> String {
        let name: String = self
            .name
            .chars()
            .map(|c| if c.is_control() { '\u{fffd}' } else { c })
            .collect::<String>()
            .replace('"', "\"\"");
        let stated = self.stated.map_or_else(String::new, |error| error.to_string());
        let (ours, meshoptimizer) = (csv_figures(self.ours), csv_figures(self.meshoptimizer));
        let Self { part, cells, triangles, diagonal, ratio, .. } = self;
        format!("{part},\"{name}\",{cells},{triangles},{diagonal},{ratio},{ours},{meshoptimizer},{stated}")
    }
}

fn csv_figures(figures: Option<Figures>) -> String {
    figures.map_or_else(
        || ",,,,".to_owned(),
        |Figures { triangles, rms, mean, max, normal_degrees }| {
            format!("{triangles},{rms},{mean},{max},{normal_degrees}")
        },
    )
}

#[cfg(test)]
mod tests {
    use super::super::Measured;
    use super::*;
    use crate::measure::{OneWay, SurfaceError};

    fn level(triangles: u64, distance: f64) -> Level {
        let way = OneWay {
            rms: distance,
            mean: distance,
            p99: distance,
            max: 2.0 * distance,
            normal_degrees: distance,
        };
        Level { triangles, error: Some(SurfaceError { lost: way, invented: OneWay::default() }) }
    }

    fn part(area: f64, ours: Level, other: Option<Level>) -> PartOutcome {
        let at = vec![Measured { ours, meshoptimizer: other, stated: Some(3.0) }];
        PartOutcome {
            name: "a \"b\", c".into(),
            area,
            diagonal: area,
            at,
            triangles: 10,
            cells: 1,
            number: 0,
        }
    }

    #[test]
    fn parts_are_pooled_by_area() {
        let outcomes =
            [part(3.0, level(4, 2.0), Some(level(5, 4.0))), part(1.0, level(6, 6.0), Some(level(7, 4.0)))];
        let comparison = Comparison::pooled(&[0.5], &outcomes);
        let row = &comparison.rows[0];
        // (3 * 2^2 + 1 * 6^2) / 4 = 12; means: (3 * 2 + 6) / 4 = 3, and half of that for normals of both ways.
        let figures = Figures { triangles: 10, rms: 12f64.sqrt(), mean: 3.0, max: 12.0, normal_degrees: 1.5 };
        assert_eq!(row.ours, figures);
        assert_eq!(row.rms_ratio, Some(12f64.sqrt() / 4.0));
        assert_eq!(
            (row.stated_max, row.measured_over_stated, row.stated_over_measured),
            (Some(3.0), Some(4.0), Some(0.75))
        );
        assert_eq!((comparison.diagonal, comparison.triangles, comparison.parts), (3.0, 20, 2));
    }

    #[test]
    fn parts_that_vanished_are_left_out_of_both_and_counted() {
        let gone = Level { triangles: 0, error: None };
        let outcomes = [part(1.0, level(4, 2.0), Some(level(4, 1.0))), part(9.0, gone, Some(level(7, 4.0)))];
        let row = &Comparison::pooled(&[0.5], &outcomes).rows[0];
        assert_eq!((row.parts_compared, row.parts_vanished, row.rms_ratio), (1, 1, Some(2.0)));
        assert_eq!(row.meshoptimizer.map(|figures| figures.triangles), Some(4));
        let alone = &Comparison::pooled(&[0.5], &[part(1.0, level(4, 2.0), None)]).rows[0];
        assert_eq!((alone.meshoptimizer, alone.rms_ratio), (None, None));
    }

    #[test]
    fn lines_of_the_csv_have_a_field_for_every_column() {
        let outcomes = [part(1.0, level(4, 2.0), None)];
        let line = Comparison::pooled(&[0.5], &outcomes).part_rows[0].csv();
        assert_eq!(line, "0,\"a \"\"b\"\", c\",1,10,1,0.5,4,2,2,4,1,,,,,,3");
        // The name has one comma of its own.
        assert_eq!(line.matches(',').count(), PartRow::COLUMNS.len());
    }
}
