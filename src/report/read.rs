//! Folders in; the flights in them out, checked, in the order in which they were given.

use std::collections::BTreeSet;
use std::fs;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::{MOST_FLIGHTS, ReportError};
use crate::stats::{FrameRecord, Summary};
use crate::stream::Strategy;

/// As many as `fly` flies.
const MOST_FRAMES: usize = 10_000_000;

/// A summary has two kilobytes.
const MOST_SUMMARY_BYTES: u64 = 1 << 20;

/// The columns without which there is nothing to plot; others may come and go between versions.
const NEEDED: [&str; 23] = [
    "frame",
    "active_triangles",
    "streamed_triangles",
    "bytes_vertices",
    "bytes_ecol",
    "bytes_triangles",
    "bytes_tables",
    "bytes_sent",
    "bytes_whole",
    "misses",
    "disk_bytes",
    "select_ms",
    "residency_ms",
    "delta_ms",
    "gather_ms",
    "upload_ms",
    "defragment_ms",
    "reform_ms",
    "draw_ms",
    "frame_ms",
    "gpu_bytes",
    "resident_bytes",
    "active_vertices",
];

/// One flight as it was written.
#[derive(Debug)]
pub struct Flown {
    /// What it is called on the page; no other flight is called so.
    pub name: String,
    /// The folder that it was given in, which flights of one `fly --compare` share.
    pub group: String,
    /// Its summary.
    pub summary: Summary,
    /// Its frames; at least one.
    pub records: Vec<FrameRecord>,
    /// The files of its pictures, by frame.
    pub pictures: Vec<PathBuf>,
}

/// Reads all flights in some folders; one of `fly --compare` has a flight for each strategy.
///
/// # Errors
/// [`ReportError`]: something is missing, damaged, or of no flight.
pub fn read(folders: &[PathBuf]) -> Result<Vec<Flown>, ReportError> {
    let mut names = BTreeSet::new();
    let mut flights = Vec::new();
    for folder in folders {
        check_folder(folder)?;
        let name = name_of(folder);
        if !names.insert(name.clone()) {
            return Err(ReportError::SameName { name, path: folder.clone() });
        }
        for (strategy, folder) in flights_in(folder)? {
            let flight = match strategy {
                Some(strategy) if folders.len() == 1 => strategy.to_owned(),
                Some(strategy) => format!("{name} / {strategy}"),
                None => name.clone(),
            };
            flights.push((flight, name.clone(), folder));
        }
    }
    if flights.len() > MOST_FLIGHTS {
        return Err(ReportError::TooManyFlights(flights.len()));
    }
    flights.into_iter().map(|(name, group, folder)| read_flight(name, group, &folder)).collect()
}

fn check_folder(folder: &Path) -> Result<(), ReportError> {
    match fs::metadata(folder) {
        Ok(metadata) if metadata.is_dir() => Ok(()),
        Ok(_) => Err(ReportError::NotAFolder(folder.to_owned())),
        Err(cause) if cause.kind() == ErrorKind::NotFound => Err(ReportError::NoFolder(folder.to_owned())),
        Err(cause) => Err(ReportError::Read { cause, path: folder.to_owned() }),
    }
}

/// The last component of its full path, so that `.` has a name too.
fn name_of(folder: &Path) -> String {
    let full = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    full.file_name().unwrap_or(full.as_os_str()).to_string_lossy().into_owned()
}

/// The flights of a folder: itself, or a folder for each strategy.
fn flights_in(folder: &Path) -> Result<Vec<(Option<&'static str>, PathBuf)>, ReportError> {
    #[derive(Deserialize)]
    struct Kind {
        strategies: Option<IgnoredAny>,
    }
    let kind: Kind = read_json(folder)?;
    if kind.strategies.is_none() {
        return Ok(vec![(None, folder.to_owned())]);
    }
    let words = Strategy::ALL.map(Strategy::word);
    Ok(words.into_iter().map(|word| (Some(word), folder.join(word))).collect())
}

fn read_flight(name: String, group: String, folder: &Path) -> Result<Flown, ReportError> {
    check_folder(folder)?;
    let summary: Summary = read_json(folder)?;
    let path = folder.join("frames.csv");
    let records = read_records(open(folder, "frames.csv")?, &path)?;
    if records.len() as u64 != summary.frames {
        return Err(ReportError::FrameCount { found: records.len() as u64, said: summary.frames, path });
    }
    Ok(Flown { name, group, summary, records, pictures: pictures_in(folder)? })
}

/// Opens a file of a flight, but nothing that would wait for somebody to write.
fn open(folder: &Path, file: &'static str) -> Result<fs::File, ReportError> {
    let path = folder.join(file);
    if !path.is_file() {
        return Err(ReportError::NotAFlight { file, folder: folder.to_owned() });
    }
    fs::File::open(&path).map_err(|cause| ReportError::Read { cause, path })
}

fn read_json<T: DeserializeOwned>(folder: &Path) -> Result<T, ReportError> {
    let file = open(folder, "summary.json")?;
    let path = folder.join("summary.json");
    let mut bytes = Vec::new();
    let length = file.take(MOST_SUMMARY_BYTES).read_to_end(&mut bytes);
    length.map_err(|cause| ReportError::Read { cause, path: path.clone() })?;
    serde_json::from_slice(&bytes).map_err(|cause| ReportError::Json { cause, path })
}

fn read_records(file: impl Read, path: &Path) -> Result<Vec<FrameRecord>, ReportError> {
    let mut reader = csv::Reader::from_reader(file);
    let headers = reader.headers().map_err(|error| csv_error(error, None, path))?.clone();
    if let Some(column) = NEEDED.into_iter().find(|&column| headers.iter().all(|header| header != column)) {
        return Err(ReportError::Column { column, path: path.to_owned() });
    }
    let mut records: Vec<FrameRecord> = Vec::new();
    for record in reader.deserialize() {
        let record = record.map_err(|error| csv_error(error, Some(&headers), path))?;
        // The header is line 1.
        check_record(&record, records.len() as u64 + 2, path)?;
        records.push(record);
        if records.len() > MOST_FRAMES {
            return Err(ReportError::TooManyFrames { most: MOST_FRAMES, path: path.to_owned() });
        }
    }
    if records.is_empty() { Err(ReportError::NoFrames(path.to_owned())) } else { Ok(records) }
}

fn check_record(record: &FrameRecord, line: u64, path: &Path) -> Result<(), ReportError> {
    let is_time = |ms: f64| ms.is_finite() && ms >= 0.0;
    let times = record.stages_ms().into_iter().chain([("frame", record.frame_ms)]);
    let what = match times.into_iter().find(|&(_, ms)| !is_time(ms)) {
        Some((stage, ms)) => format!("`{stage}_ms` is {ms}, which is no time"),
        None if record.frame != line - 2 => format!("frame {} where {} follows", record.frame, line - 2),
        None => return Ok(()),
    };
    Err(ReportError::Csv { line, what, path: path.to_owned() })
}

/// Our words for the reader's, with the line and the name of the column.
fn csv_error(error: csv::Error, headers: Option<&csv::StringRecord>, path: &Path) -> ReportError {
    let line = error.position().map_or(1, csv::Position::line);
    let path = path.to_owned();
    let what = match error.into_kind() {
        csv::ErrorKind::Io(cause) => return ReportError::Read { cause, path },
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} values for {expected_len} columns")
        }
        csv::ErrorKind::Utf8 { .. } => "not text".to_owned(),
        csv::ErrorKind::Deserialize { err, .. } => {
            let field = err.field().and_then(|field| headers?.get(usize::try_from(field).ok()?));
            format!("`{}`: {}", field.unwrap_or("?"), err.kind())
        }
        _ => "no line of records".to_owned(),
    };
    ReportError::Csv { line, what, path }
}

fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let failed = |cause| ReportError::Read { cause, path: folder.to_owned() };
    let mut pictures = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("frame_") && name.ends_with(".png") && path.is_file() {
            pictures.push(path);
        }
    }
    // Frames from 100,000 on have names of more digits.
    pictures.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(pictures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::report::write_csv;

    fn csv_of(frames: u64) -> String {
        let records: Vec<_> =
            (0..frames).map(|frame| FrameRecord { frame, frame_ms: 1.5, ..Default::default() }).collect();
        let mut text = Vec::new();
        write_csv(&mut text, &records).unwrap();
        String::from_utf8(text).unwrap()
    }

    fn message(text: &str) -> String {
        read_records(text.as_bytes(), Path::new("frames.csv")).unwrap_err().to_string()
    }

    #[test]
    fn what_was_written_is_read() {
        let records = read_records(csv_of(3).as_bytes(), Path::new("")).unwrap();
        assert_eq!((records.len(), records[2].frame, records[2].frame_ms), (3, 2, 1.5));
    }

    #[test]
    fn columns_may_be_added_and_moved_but_not_removed() {
        let text = csv_of(2)
            .replace("\n0,", "\n7,0,")
            .replace("\n1,", "\n8,1,")
            .replace("frame,inst", "new,frame,inst");
        assert_eq!(read_records(text.as_bytes(), Path::new("")).unwrap()[1].frame, 1);
        assert!(message(&csv_of(2).replace("bytes_whole", "bytes_hole")).contains("no column `bytes_whole`"));
        assert!(message("").contains("line 1 has no column `frame`"));
    }

    #[test]
    fn damage_is_told_with_its_line() {
        let text = csv_of(3);
        let cut = &text[..text.len() - 9];
        let columns = FrameRecord::COLUMNS.len();
        for (text, words) in [
            (text.replace("\n1,0", "\n1,x"), "line 3: `instances_visible`: invalid digit"),
            (text.replace("\n1,0", "\n1,-4"), "line 3: `instances_visible`"),
            (text.replace("\n1,0", "\n1"), &format!("line 3: {} values for {columns} columns", columns - 1)),
            (text.replace("\n1,0", "\n5,0"), "line 3: frame 5 where 1 follows"),
            (text.replacen("1.500", "NaN", 1), "line 2: `frame_ms` is NaN"),
            (text.replacen("1.500", "-1", 1), "line 2: `frame_ms` is -1"),
            (cut.to_owned(), "line 4: "),
            (csv_of(0), "there is no frame in it"),
        ] {
            let message = message(&text);
            assert!(message.contains(words) && message.ends_with(": frames.csv"), "{message}");
        }
    }
}
