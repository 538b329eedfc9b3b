//! `report`: the page of real and of made flights, and folders that are none.

use std::collections::BTreeMap;

use assert_cmd::cargo::cargo_bin_cmd;
use collapsar::stats::report::{Flight, human, write_csv};
use collapsar::stats::{FrameRecord, Summary};

use crate::common::{height_field, patched_box};
use crate::models::obj;
use crate::workplace::{Workplace, has_gpu, names};

/// Tags that have no end.
const VOID: [&str; 4] = ["meta", "img", "br", "!DOCTYPE"];

/// The plots of one flight that mostly does not draw, and the same of several.
const PLOTS: [&str; 6] = [
    "bytes sent a frame",
    "cumulative saving",
    "streamed triangles",
    "residency",
    "milliseconds by stage",
    "distribution of frame times",
];

/// That every tag is closed by its own end tag, in order; gives the tags with their attributes.
#[track_caller]
fn tags(page: &str) -> Vec<&str> {
    let mut open = Vec::new();
    let mut found = Vec::new();
    let mut rest = page;
    while let Some((_, after)) = rest.split_once('<') {
        // A quoted value may have `>` in it only as a reference.
        let (tag, after) =
            after.split_once('>').unwrap_or_else(|| panic!("a tag without an end: {after:.60}"));
        let name = tag.split([' ', '/']).next().unwrap();
        if let Some(end) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(end), "</{end}> closes another tag");
        } else {
            assert_eq!(tag.matches('"').count() % 2, 0, "<{tag}> has a quote too many");
            found.push(tag);
            if !tag.ends_with('/') && !VOID.contains(&name) {
                open.push(name);
            }
        }
        rest = after;
        if name == "style" {
            rest = &rest[rest.find("</style").unwrap()..];
        }
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    found
}

/// That a page is well-formed, runs and loads nothing, and has these plots this many times.
#[track_caller]
fn assert_page(page: &str, plots: &[(&str, usize)]) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    let tags = tags(page);
    for tag in &tags {
        let name = tag.split(' ').next().unwrap();
        assert!(!["script", "link", "iframe", "object", "embed", "base"].contains(&name), "<{tag:.80}>");
        for source in tag.split("src=\"").skip(1) {
            assert!(source.starts_with("data:image/png;base64,"), "<{tag:.80}>");
        }
        assert!(!tag.contains("href=") && !tag.contains(" on") && !tag.contains("url("), "<{tag:.80}>");
    }
    assert!(!page.contains("@import") && !page.contains("url("), "a style loads something");
    for (plot, count) in plots {
        let shown = tags.iter().filter(|tag| tag.starts_with("svg") && tag.contains(plot)).count();
        assert_eq!(shown, *count, "plots with {plot:?}");
    }
}

/// A place with one made flight of so many frames in `flight`.
fn made(frames: u64) -> Workplace {
    let place = Workplace::new();
    add_flight(&place, "flight", frames);
    place
}

fn record(frame: u64) -> FrameRecord {
    let sent = if frame == 0 { 900_000 } else { 700 * (frame % 3) };
    FrameRecord {
        frame,
        active_triangles: 50_000 + frame % 7,
        streamed_triangles: sent / 20,
        bytes_vertices: sent / 2,
        bytes_triangles: sent / 2,
        bytes_sent: sent,
        bytes_whole: 1_000_000,
        disk_bytes: if frame < 5 { 200_000 } else { 0 },
        resident_bytes: 200_000 * frame.min(5),
        misses: 4u64.saturating_sub(frame),
        upload_ms: 0.5,
        draw_ms: 3.0 + (frame % 11) as f64,
        frame_ms: if frame == 77 { 1234.0 } else { 4.0 + (frame % 11) as f64 },
        ..Default::default()
    }
}

fn add_flight(place: &Workplace, folder: &str, frames: u64) {
    place.make_folder(folder);
    let records: Vec<_> = (0..frames).map(record).collect();
    let mut csv = Vec::new();
    write_csv(&mut csv, &records).unwrap();
    place.write(&format!("{folder}/frames.csv"), csv);
    let flight = Flight {
        strategy: "coherent".to_owned(),
        adapter: "Some Card (driver 1, DiscreteGpu)".to_owned(),
        path: "walk".to_owned(),
        model: "a<b>&c.clps".to_owned(),
        command: "collapsar fly 'a<b>&c.clps'".to_owned(),
        ..Flight::default()
    };
    let json = serde_json::to_string_pretty(&Summary::new(flight, &records)).unwrap();
    place.write(&format!("{folder}/summary.json"), json);
}

fn edit(place: &Workplace, file: &str, from: &str, to: &str) {
    let text = String::from_utf8(place.read(file)).unwrap();
    assert!(text.contains(from), "{from:?} is not in {file}");
    place.write(file, text.replacen(from, to, 1));
}

#[track_caller]
fn page_of(place: &Workplace, arguments: &[&str]) -> String {
    let outcome = place.run(&[&["report", "-o", "page.html"], arguments].concat()).succeeded();
    assert!(outcome.err.is_empty() && outcome.out.ends_with(": page.html\n"), "{outcome:?}");
    String::from_utf8(place.read("page.html")).unwrap()
}

/// The whole way: a model, a flight with all strategies, its page.
#[test]
fn the_page_of_a_real_comparison_has_its_numbers_plots_and_pictures() {
    if !has_gpu("cli::report::the_page_of_a_real_comparison_has_its_numbers_plots_and_pictures") {
        return;
    }
    let place = Workplace::new();
    place.write("model.obj", obj(&[patched_box(10), height_field(12)]));
    place.bake("model.obj", "model.clps");
    let fly = [
        "fly",
        "model.clps",
        "--frames",
        "9",
        "--size",
        "96x64",
        "--png",
        "4",
        "--compare",
        "--out",
        "two ways",
    ];
    place.run(&fly).succeeded();
    let page = page_of(&place, &["two ways"]);
    let mut plots: Vec<_> = PLOTS.iter().map(|&plot| (plot, 4)).collect();
    plots[4].1 = page.matches("aria-label=\"milliseconds by stage").count();
    assert!((4..=8).contains(&plots[4].1), "{}", plots[4].1);
    assert_page(&page, &plots);
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 3, "frames 0, 4 and 8 of `coherent`");
    let command = "collapsar fly model.clps --frames 9 --size 96x64 --png 4 --compare --out 'two ways'";
    for word in
        [command, "model.clps: 1,488 triangles in 2 parts, placed 2 times", "5,814,786", "4.82 ×", "22.62 %"]
    {
        assert!(page.contains(word), "no {word:?}");
    }
    for strategy in ["coherent", "whole", "per-part"] {
        let json = place.read(&format!("two ways/{strategy}/summary.json"));
        let summary: Summary = serde_json::from_slice(&json).unwrap();
        for number in [
            human::bytes(summary.bytes_sent_total),
            human::bytes(summary.bytes_whole_total),
            human::rounded(summary.active_triangles_mean),
            human::milliseconds(summary.frame_ms_p50),
            human::milliseconds(summary.frame_ms_p99),
            human::milliseconds(summary.frame_ms_p999),
            summary.flight.adapter,
        ] {
            assert!(page.contains(&number), "{strategy}: no {number}");
        }
        assert_eq!(summary.flight.command, command);
    }
}

#[test]
fn what_is_in_the_files_is_text_on_the_page() {
    let place = made(40);
    let page = page_of(&place, &["flight", "--title", "<script>alert(\"1\")</script>"]);
    assert_page(&page, &PLOTS.map(|plot| (plot, if plot.starts_with("milli") { 2 } else { 1 })));
    assert!(page.contains("<h1>&lt;script&gt;alert(") && page.contains("a&lt;b&gt;&amp;c.clps"));
    assert!(!page.contains("Software graphics"));
    assert!(page.contains("by the CPU around a wait, as the adapter has no timestamps"));
    assert!(page.contains("In 4 of 40 frames something was drawn coarser"));
}

#[test]
fn software_adapters_are_said_to_be_such() {
    let place = made(4);
    edit(&place, "flight/summary.json", "DiscreteGpu)", "Cpu)");
    assert!(page_of(&place, &["flight"]).contains("Timings are for ratios within this run only"));
}

#[test]
fn several_flights_stand_side_by_side() {
    let place = made(30);
    add_flight(&place, "other", 60);
    let page = page_of(&place, &["flight", "other"]);
    assert_page(&page, &PLOTS.map(|plot| (plot, if plot.starts_with("milli") { 6 } else { 3 })));
    assert!(
        page.contains("Side by side") && page.contains("</i>flight</h2>") && page.contains("</i>other</h2>")
    );
    // A second run replaces the page.
    assert_page(&page_of(&place, &["other"]), &[]);
}

/// A flight to which data came late, under a cap: what had arrived, and what it held.
#[test]
fn a_flight_that_lacked_something_shows_what_had_arrived() {
    let place = made(50);
    let records: Vec<_> = (0..50)
        .map(|frame| FrameRecord {
            instances_visible: 400,
            boxes: 300u64.saturating_sub(10 * frame),
            wished_vertices: 60_000,
            active_vertices: 2000 * frame.min(30),
            drawn_area_permille: (20 * frame).min(1000),
            elapsed_ms: 100.0 + 10.0 * frame as f64,
            memory_bytes: 500_000 + 10_000 * frame,
            misses: 30u64.saturating_sub(frame),
            ..record(frame)
        })
        .collect();
    let mut csv = Vec::new();
    write_csv(&mut csv, &records).unwrap();
    place.write("flight/frames.csv", csv);
    let flight = Flight { memory_limit_bytes: Some(1_048_576), live: true, ..Flight::default() };
    place.write("flight/summary.json", serde_json::to_vec(&Summary::new(flight, &records)).unwrap());
    let page = page_of(&place, &["flight"]);
    assert_page(&page, &[("what has arrived", 1), ("residency", 1)]);
    for words in [
        "nine tenths of the picture after 550 ms, half of the detail after 250 ms, and all of it after 400 ms",
        "drawn as boxes, at most 300",
        "visible instances drawn as boxes",
        "its cap",
    ] {
        assert!(page.contains(words), "no {words:?}");
    }
    assert!(!page_of(&made(50), &["flight"]).contains("What has arrived"), "records of before have none");
}

/// What a version wrote that knew neither the command nor the machine.
#[test]
fn flights_of_older_versions_can_be_read() {
    let place = made(12);
    let mut summary: BTreeMap<String, serde_json::Value> =
        serde_json::from_slice(&place.read("flight/summary.json")).unwrap();
    for key in
        ["version", "command", "cpu", "cores", "memory_bytes", "model", "parts", "instances", "frame_ms_p999"]
    {
        assert!(summary.remove(key).is_some(), "{key}");
    }
    place.write("flight/summary.json", serde_json::to_vec(&summary).unwrap());
    let page = page_of(&place, &["flight"]);
    assert_page(&page, &[("residency", 1)]);
    assert!(page.contains("<h1>Flight flight</h1>") && page.contains("not known"));
}

#[test]
fn one_frame_makes_a_page_and_nothing_sent_too() {
    let place = made(1);
    assert_page(&page_of(&place, &["flight"]), &[("cumulative saving", 1)]);
    let empty = FrameRecord::default();
    let mut csv = Vec::new();
    write_csv(&mut csv, &[empty, FrameRecord { frame: 1, ..empty }]).unwrap();
    place.write("flight/frames.csv", csv);
    let summary = Summary::new(Flight::default(), &[empty, empty]);
    place.write("flight/summary.json", serde_json::to_vec(&summary).unwrap());
    let page = page_of(&place, &["flight"]);
    assert_page(&page, &[("cumulative saving", 1)]);
    assert!(!page.contains("NaN") && !page.contains("inf"), "a number is none");
}

/// The page of 100,000 frames is hardly larger than that of 240, and says what it did.
#[test]
fn the_page_of_a_long_flight_is_bounded_and_keeps_its_peaks() {
    let place = made(240);
    let short = page_of(&place, &["flight"]).len();
    add_flight(&place, "long", 100_000);
    let page = page_of(&place, &["long"]);
    assert_page(&page, &[("bytes sent a frame", 1)]);
    assert!(page.len() < 2 * short && page.len() < 400_000, "{} against {short}", page.len());
    assert!(page.contains("240 bands of 417 frames"), "not said");
    assert!(page.contains("the slowest 1234 ms"));
}

#[test]
fn folders_that_are_no_flights_are_refused() {
    let place = made(3);
    let report = |folder: &'static str| ["report", folder, "-o", "page.html"];
    place.make_folder("empty");
    place.fails(&report("none"), &["there is no such folder", ": none\n"]);
    place.fails(&report("flight/frames.csv"), &["this is a file; give the folder", ": flight/frames.csv\n"]);
    place.fails(&report("empty"), &["no summary.json here", "fly --out", ": empty\n"]);
    std::fs::rename(place.path("flight/frames.csv"), place.path("empty/frames.csv")).unwrap();
    place.fails(&report("flight"), &["no frames.csv here", ": flight\n"]);
    place.fails(&report("empty"), &["no summary.json here", ": empty\n"]);
    place.write("flight/summary.json", "{\"strategies\": []}");
    place.fails(&report("flight"), &["there is no such folder", ": flight/coherent\n"]);
}

#[test]
fn damaged_records_are_told_with_their_line() {
    let columns = FrameRecord::COLUMNS.len();
    let short = format!("{} values for {columns} columns", columns - 1);
    for (from, to, words) in [
        ("\n1,0", "\n1,zero", ["damaged in line 3", "`instances_visible`: invalid digit"]),
        ("\n2,0,", "\n2,", ["damaged in line 4", &short]),
        ("\n2,0,", "\n7,0,", ["damaged in line 4", "frame 7 where 2 follows"]),
        ("frame,", "number,", ["line 1 has no column `frame`", "another version"]),
        (",bytes_whole", ",bytes_all", ["line 1 has no column `bytes_whole`", "another version"]),
    ] {
        let place = made(3);
        edit(&place, "flight/frames.csv", from, to);
        let words = [&words[..], &[": flight/frames.csv\n"]].concat();
        place.fails(&["report", "flight", "-o", "page.html"], &words);
    }
}

#[test]
fn records_that_end_early_are_refused() {
    let place = made(3);
    let whole = String::from_utf8(place.read("flight/frames.csv")).unwrap();
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    let report = ["report", "flight", "-o", "page.html"];
    let columns = format!("values for {} columns", FrameRecord::COLUMNS.len());
    for (text, words) in [
        (lines[..3].concat(), ["2 frames, where summary.json beside it says 3", "cut short"]),
        (lines[..1].concat(), ["there is no frame in it", "fly again"]),
        (String::new(), ["line 1 has no column `frame`", "fly again"]),
        (whole[..whole.len() - 20].to_owned(), ["damaged in line 4", &columns]),
    ] {
        place.write("flight/frames.csv", text);
        place.fails(&report, &[&words[..], &[": flight/frames.csv\n"]].concat());
    }
    // Whatever it is cut to, there is a message or, at the end, a page.
    for length in (0..whole.len()).step_by(37) {
        place.write("flight/frames.csv", &whole[..length]);
        place.fails(&report, &["flight/frames.csv"]);
    }
}

#[test]
fn damaged_summaries_are_told_with_their_line() {
    for (from, to, words) in [
        ("\"frames\": 3", "\"frames\": \"3\"", "invalid type: string \"3\", expected u64"),
        ("\"frames\": 3", "\"framed\": 3", "missing field `frames`"),
        ("\"frames\": 3", "\"frames\" 3", "expected `:` at line"),
        ("{", "<", "expected value at line 1 column 1"),
    ] {
        let place = made(3);
        edit(&place, "flight/summary.json", from, to);
        let words = ["not the summary of a flight", words, ": flight/summary.json\n"];
        place.fails(&["report", "flight", "-o", "page.html"], &words);
    }
}

#[test]
fn a_picture_that_is_none_is_named() {
    let place = made(3);
    place.write("flight/frame_00000.png", "no picture");
    place.fails(&["report", "flight", "-o", "page.html"], &["not a picture", ": flight/frame_00000.png\n"]);
}

#[test]
fn flights_that_cannot_be_told_apart_are_refused() {
    let place = made(3);
    let words = ["another folder is called `flight` too", "rename one", ": flight/../flight\n"];
    place.fails(&["report", "flight", "flight/../flight", "-o", "page.html"], &words);
    let folders: Vec<String> = (0..9).map(|number| format!("flight{number}")).collect();
    folders.iter().for_each(|folder| add_flight(&place, folder, 2));
    let folders: Vec<&str> = folders.iter().map(String::as_str).collect();
    let report = [&["report", "-o", "page.html"], &folders[..]].concat();
    place.fails(&report, &["9 flights, where a page has room for 8"]);
    place.run(&report[..report.len() - 1]).succeeded();
}

#[test]
fn outputs_that_cannot_be_are_refused() {
    let place = made(3);
    place.make_folder("page.html");
    let report = |output: &'static str| ["report", "flight", "-o", output];
    place.fails(&report("page.html"), &["the output is a folder", ": page.html\n"]);
    place.fails(&report("none/page.html"), &["its folder does not exist; create it first: none\n"]);
    place.fails(&report("flight/frames.csv"), &["the page must end in .html: flight/frames.csv\n"]);
    place.refuses(&["report", "-o", "page.html"], &["DIR"]);
    place.refuses(&["report", "flight"], &["--output"]);
}

/// Where even the owner may not write: a folder without that right, or for a superuser one of the kernel's.
#[test]
#[cfg(target_os = "linux")]
fn a_folder_that_is_read_only_is_named() {
    let place = made(3);
    place.fails(
        &["report", "flight", "-o", "/proc/self/page.html"],
        &["cannot write", ": /proc/self/page.html\n"],
    );
}

/// A named pipe without a writer would be waited for for ever.
#[test]
#[cfg(unix)]
fn a_pipe_in_the_place_of_the_records_is_not_waited_for() {
    let place = made(3);
    std::fs::remove_file(place.path("flight/frames.csv")).unwrap();
    let pipe = place.path("flight/frames.csv");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut command = cargo_bin_cmd!("collapsar");
    command.args(["report", "flight", "-o", "page.html"]).current_dir(place.path(""));
    let output = command.timeout(std::time::Duration::from_secs(20)).output().unwrap();
    crate::workplace::Outcome::of(&output).failed(&["no frames.csv here", ": flight\n"]);
    assert_eq!(names(&place.path("")), ["flight"]);
}
