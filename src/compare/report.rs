//! Measured parts in, pooled figures for people and programs out.

use serde::Serialize;

use super::{Level, PartOutcome};
use crate::measure::SurfaceError;

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

/// All parts at one ratio, pooled by area; lengths in part units, but for those of the placed model.
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
    /// The placed model at this share of its triangles, by who simplified it and how its triangles were dealt; empty if
    /// it has one part.
    pub dealt: Vec<DealtRow>,
    /// RMS distance of ours, dealt by cost, over the lesser of meshoptimizer's by share and by its own error.
    pub dealt_rms_ratio: Option<f64>,
    /// The same of the normal deviation.
    pub dealt_normal_ratio: Option<f64>,
    /// RMS distance of ours, dealt by cost, over meshoptimizer's at the same count of every part.
    pub same_counts_rms_ratio: Option<f64>,
    /// The same of the normal deviation.
    pub same_counts_normal_ratio: Option<f64>,
}

/// How the triangles of a model are dealt over its parts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dealing {
    /// Every part gets the same share of its own.
    #[default]
    Share,
    /// What costs least in our collapse order goes first.
    Cost,
    /// What has the least error by meshoptimizer's own account goes first.
    Error,
}

/// The placed model as one simplifier leaves it: parts count as often and as large as they are placed, and one of which
/// nothing is left as a dot in the middle of its box. Lengths in the unit of the model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct DealtRow {
    /// Whether ours or meshoptimizer's.
    pub simplifier: &'static str,
    /// How its triangles are dealt.
    pub dealt_by: Dealing,
    /// Distances and angles.
    #[serde(flatten)]
    pub figures: Figures,
}

/// The names of both.
const OURS: &str = "collapsar";
const MESHOPTIMIZER: &str = "meshoptimizer";

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
    /// Ours where the model's triangles are dealt by cost.
    pub dealt: Option<Figures>,
    /// meshoptimizer's where they are dealt by its own error.
    pub meshoptimizer_dealt: Option<Figures>,
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
        let dealt = dealt_rows(nth, outcomes);
        let [rms, normal]: [fn(&Figures) -> f64; 2] =
            [|figures| figures.rms, |figures| figures.normal_degrees];
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
            dealt_rms_ratio: dealt_quotient(&dealt, rms, |by| by != Dealing::Cost),
            dealt_normal_ratio: dealt_quotient(&dealt, normal, |by| by != Dealing::Cost),
            same_counts_rms_ratio: dealt_quotient(&dealt, rms, |by| by == Dealing::Cost),
            same_counts_normal_ratio: dealt_quotient(&dealt, normal, |by| by == Dealing::Cost),
            dealt,
        }
    }
}

/// A level of detail of a part.
type Pick = fn(&super::Measured) -> Option<&Level>;

/// The placed model at one ratio, by simplifier and dealing.
fn dealt_rows(nth: usize, outcomes: &[PartOutcome]) -> Vec<DealtRow> {
    let all: [(&'static str, Dealing, Pick); 5] = [
        (OURS, Dealing::Cost, |measured| measured.dealt.first()),
        (OURS, Dealing::Share, |measured| Some(&measured.ours)),
        (MESHOPTIMIZER, Dealing::Share, |measured| measured.meshoptimizer.as_ref()),
        (MESHOPTIMIZER, Dealing::Error, |measured| measured.dealt.get(1)),
        (MESHOPTIMIZER, Dealing::Cost, |measured| measured.dealt.get(2)),
    ];
    if outcomes.iter().any(|part| part.at[nth].dealt.is_empty()) {
        return Vec::new();
    }
    let row = |(simplifier, dealt_by, pick): (_, _, Pick)| {
        let levels = outcomes.iter().map(|part| Some((part, *pick(&part.at[nth])?)));
        let figures = Figures::placed(&levels.collect::<Option<Vec<_>>>()?);
        Some(DealtRow { simplifier, dealt_by, figures })
    };
    all.into_iter().filter_map(row).collect()
}

/// A figure of ours, dealt by cost, over the least of meshoptimizer's by some dealings.
fn dealt_quotient(
    rows: &[DealtRow],
    figure: fn(&Figures) -> f64,
    theirs: fn(Dealing) -> bool,
) -> Option<f64> {
    let of = |name| rows.iter().filter(move |row| row.simplifier == name);
    let others = of(MESHOPTIMIZER).filter(|row| theirs(row.dealt_by)).map(|row| figure(&row.figures));
    quotient(figure(&of(OURS).next()?.figures), others.reduce(f64::min)?)
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

impl Figures {
    /// Pools the levels of parts as they are placed.
    fn placed(levels: &[(&PartOutcome, Level)]) -> Self {
        let errors = || levels.iter().filter_map(|&(part, level)| Some((part, level.error.or(part.dot)?)));
        // A scale has one power from the distance for each of the two that it has from the area.
        let sum = |power: usize, of: fn(&SurfaceError) -> f64| -> f64 {
            errors().map(|(part, error)| part.area * part.placed.powers[power] * of(&error)).sum()
        };
        let area = sum(0, |_| 1.0);
        let by_area = |sum: f64| if area > 0.0 { sum / area } else { 0.0 };
        Self {
            triangles: levels.iter().map(|(part, level)| part.placed.copies * level.triangles).sum(),
            rms: by_area(sum(2, |error| error.rms().powi(2))).sqrt(),
            mean: by_area(sum(1, SurfaceError::mean)),
            max: errors().map(|(part, error)| part.placed.largest * error.max()).fold(0.0, f64::max),
            normal_degrees: by_area(sum(0, SurfaceError::normal_degrees)),
        }
    }
}

impl PartRow {
    /// The columns of the CSV.
    pub const COLUMNS: [&'static str; 27] = [
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
        "dealt_triangles",
        "dealt_rms",
        "dealt_mean",
        "dealt_max",
        "dealt_normal_degrees",
        "meshoptimizer_dealt_triangles",
        "meshoptimizer_dealt_rms",
        "meshoptimizer_dealt_mean",
        "meshoptimizer_dealt_max",
        "meshoptimizer_dealt_normal_degrees",
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
            dealt: measured.dealt.first().copied().and_then(figures),
            meshoptimizer_dealt: measured.dealt.get(1).copied().and_then(figures),
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
        let dealt = [self.dealt, self.meshoptimizer_dealt].map(csv_figures).join(",");
        let Self { part, cells, triangles, diagonal, ratio, .. } = self;
        format!(
            "{part},\"{name}\",{cells},{triangles},{diagonal},{ratio},{ours},{meshoptimizer},{stated},{dealt}"
        )
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
    use super::super::placed::Placed;
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
        let at = vec![Measured { ours, meshoptimizer: other, stated: Some(3.0), dealt: Vec::new() }];
        PartOutcome {
            name: "a \"b\", c".into(),
            area,
            diagonal: area,
            at,
            triangles: 10,
            cells: 1,
            ..PartOutcome::default()
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
    fn a_dealt_model_counts_parts_as_they_are_placed() {
        let placed = |copies, scale: f64| {
            let powers = [2, 3, 4].map(|power| copies as f64 * scale.powi(power));
            Placed { copies, largest: scale, powers }
        };
        let mut twice = part(1.0, level(9, 9.0), Some(level(9, 9.0)));
        twice.placed = placed(2, 1.0);
        twice.at[0].dealt = vec![level(4, 3.0), level(5, 6.0), level(6, 5.0)];
        // Of this meshoptimizer leaves nothing by its own error: it is a dot, 7 away at a scale of 2.
        let mut large = part(1.0, level(9, 9.0), Some(level(9, 9.0)));
        large.placed = placed(1, 2.0);
        large.at[0].dealt = vec![level(7, 1.0), Level::default(), level(8, 1.0)];
        large.dot = level(0, 7.0).error;
        let row = &Comparison::pooled(&[0.5], &[twice, large]).rows[0];
        let named: Vec<_> = row.dealt.iter().map(|row| (row.simplifier, row.dealt_by)).collect();
        let [cost, share, error] = [Dealing::Cost, Dealing::Share, Dealing::Error];
        let expected = [
            (OURS, cost),
            (OURS, share),
            (MESHOPTIMIZER, share),
            (MESHOPTIMIZER, error),
            (MESHOPTIMIZER, cost),
        ];
        assert_eq!(named, expected);
        let triangles: Vec<_> = row.dealt.iter().map(|row| row.figures.triangles).collect();
        assert_eq!(triangles, [15, 27, 27, 10, 20]);
        // Areas 2 and 4; squared distances 9 and 4, 36 and 196, 25 and 4.
        let rms = |nth: usize| row.dealt[nth].figures.rms.powi(2);
        for (nth, squared) in [(0, 34.0 / 6.0), (3, 856.0 / 6.0), (4, 66.0 / 6.0)] {
            assert!((rms(nth) - squared).abs() < 1e-9, "{nth}: {} is not {squared}", rms(nth));
        }
        // Means 3 and 2, normals half of 3 and 1, greatest distances 6 and 4.
        let Figures { mean, max, normal_degrees, .. } = row.dealt[0].figures;
        assert_eq!((mean, max, normal_degrees), (14.0 / 6.0, 6.0, 5.0 / 6.0));
        let is_root =
            |ratio: Option<f64>, of: f64| ratio.is_some_and(|ratio| (ratio.powi(2) - of).abs() < 1e-9);
        assert!(is_root(row.same_counts_rms_ratio, 34.0 / 66.0), "{row:?}");
        // By share 9 at a scale of 1 twice, and at one of 2: more than by error.
        assert!(is_root(row.dealt_rms_ratio, 34.0 / 856.0), "{row:?}");
    }

    #[test]
    fn lines_of_the_csv_have_a_field_for_every_column() {
        let outcomes = [part(1.0, level(4, 2.0), None)];
        let line = Comparison::pooled(&[0.5], &outcomes).part_rows[0].csv();
        assert_eq!(line, "0,\"a \"\"b\"\", c\",1,10,1,0.5,4,2,2,4,1,,,,,,3,,,,,,,,,,");
        // The name has one comma of its own.
        assert_eq!(line.matches(',').count(), PartRow::COLUMNS.len());
    }
}
