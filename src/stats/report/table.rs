//! Table 1 of Peng & Cao 2012 as plain text: one row per strategy, means per frame.

use super::{Summary, human};

/// The columns: heading, unit, and the value of a flight.
type Column = (&'static str, &'static str, fn(&Summary) -> String);

const COLUMNS: [Column; 11] = [
    ("strategy", "", |s| s.flight.strategy.clone()),
    ("FPS", "1/s", |s| frames_per_second(s.frame_ms_mean)),
    ("collection", "CPU ms", |s| human::milliseconds(s.stage("delta") + s.stage("gather"))),
    ("transfer", "ms", |s| human::milliseconds(s.stage("upload"))),
    ("defragment", "GPU ms", |s| human::milliseconds(s.stage("defragment"))),
    ("reform", "GPU ms", |s| human::milliseconds(s.stage("reform"))),
    ("active", "triangles", |s| human::rounded(s.active_triangles_mean)),
    ("active", "vertices", |s| human::rounded(s.active_vertices_mean)),
    ("streamed", "triangles", |s| human::rounded(s.streamed_triangles_mean)),
    ("streamed", "vertices", |s| human::rounded(s.streamed_vertices_mean)),
    ("sent", "MB/frame", |s| megabytes(s.bytes_sent_total, s.frames)),
];

fn frames_per_second(frame_ms: f64) -> String {
    if frame_ms > 0.0 { format!("{:.1}", 1000.0 / frame_ms) } else { "-".into() }
}

fn megabytes(bytes: u64, frames: u64) -> String {
    format!("{:.3}", bytes as f64 / frames.max(1) as f64 / 1e6)
}

/// The table for flights of the same path with different strategies: means per frame, a heading and a unit per
/// column, numbers to the right. Ends with a line feed.
pub fn comparison_table(flights: &[Summary]) -> String {
    let headings = COLUMNS.map(|(heading, _, _)| heading.to_owned());
    let units = COLUMNS.map(|(_, unit, _)| unit.to_owned());
    let mut rows = vec![headings, units];
    rows.extend(flights.iter().map(|flight| COLUMNS.map(|(_, _, value)| value(flight))));
    let widths: [usize; COLUMNS.len()] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let rule = widths.map(|width| "-".repeat(width));
    rows.insert(2, rule);
    rows.iter().map(|row| line(row, &widths)).collect()
}

/// One line: the first column to the left, the others to the right.
fn line(row: &[String; COLUMNS.len()], widths: &[usize; COLUMNS.len()]) -> String {
    let cells = row.iter().zip(widths).enumerate().map(|(column, (cell, &width))| {
        if column == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
    });
    format!("{}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::FrameRecord;
    use crate::stats::report::Flight;

    #[test]
    fn columns_are_aligned() {
        let flight = |strategy: &str, sent| {
            let record = FrameRecord {
                frame_ms: 20.0,
                active_triangles: 1_234_567,
                streamed_triangles: 89,
                bytes_sent: sent,
                delta_ms: 0.25,
                gather_ms: 0.5,
                ..Default::default()
            };
            Summary::new(Flight { strategy: strategy.into(), ..Default::default() }, &[record])
        };
        let table = comparison_table(&[flight("coherent", 15_000), flight("whole", 31_500_000)]);
        let expected = "\
strategy   FPS  collection  transfer  defragment  reform     active    active   streamed  streamed      sent
           1/s      CPU ms        ms      GPU ms  GPU ms  triangles  vertices  triangles  vertices  MB/frame
--------  ----  ----------  --------  ----------  ------  ---------  --------  ---------  --------  --------
coherent  50.0        0.75     0.000       0.000   0.000  1,234,567         0         89         0     0.015
whole     50.0        0.75     0.000       0.000   0.000  1,234,567         0         89         0    31.500
";
        assert_eq!(table, expected, "\n{table}");
    }

    #[test]
    fn a_table_of_no_flights_has_its_headings() {
        assert_eq!(comparison_table(&[]).lines().count(), 3);
    }
}
