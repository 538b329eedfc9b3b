//! The documents against the program: every column and key is explained, every link leads somewhere, and the list of
//! source files is the list of source files.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking, as tests do")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use collapsar::bake::{BakeReport, PartReport, StalledPart};
use collapsar::compare::{Comparison, DealtRow, Figures, PartRow, RatioRow};
use collapsar::stats::adapter::AdapterReport;
use collapsar::stats::report::Flight;
use collapsar::stats::{FrameRecord, Summary};
use collapsar::synth::SynthReport;
use serde_json::Value;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap()
}

/// The lines below a heading of any level, up to the next heading of that level or a higher one.
fn section(markdown: &str, heading: &str) -> String {
    let level = |line: &str| line.chars().take_while(|&c| c == '#').count();
    let mut lines = markdown.lines().skip_while(|line| line.trim_start_matches('#').trim() != heading);
    let own = level(lines.next().unwrap_or_else(|| panic!("no heading `{heading}`")));
    lines.take_while(|line| !(1..=own).contains(&level(line))).collect::<Vec<_>>().join("\n")
}

/// What stands between back quotes in the first cell of every row of the tables of `docs/output.md` below a heading.
fn documented(heading: &str) -> BTreeSet<String> {
    let output = text("docs/output.md");
    let rows = section(&output, heading);
    let names = rows.lines().filter_map(|line| line.strip_prefix("| `")?.split_once('`'));
    names.map(|(name, _)| name.to_owned()).collect()
}

/// The keys of a value with those of the objects in it: `outer`, `outer.inner`, `list[].inner`.
fn keys(value: &Value, prefix: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, inner)| {
            let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            keys(inner, &path, found);
            found.insert(path);
        }),
        Value::Array(list) => list.iter().for_each(|inner| keys(inner, &format!("{prefix}[]"), found)),
        _ => {}
    }
}

/// Both ways: nothing is left unexplained, and nothing is explained that is not there.
fn assert_documented(heading: &str, value: &Value) {
    let mut found = BTreeSet::new();
    keys(value, "", &mut found);
    assert!(!found.is_empty());
    assert_eq!(documented(heading), found, "docs/output.md, `{heading}` (left) against the program (right)");
}

#[test]
fn every_column_of_the_csv_is_documented() {
    let columns: BTreeSet<String> = FrameRecord::COLUMNS.iter().map(|&column| column.to_owned()).collect();
    assert_eq!(documented("frames.csv"), columns, "docs/output.md (left) against the program (right)");
}

#[test]
fn every_key_of_a_summary_is_documented() {
    let summary = Summary::new(Flight::default(), &[FrameRecord::default()]);
    assert_documented("summary.json", &serde_json::to_value(summary).unwrap());
}

#[test]
fn every_key_of_a_bake_report_is_documented() {
    let stalled =
        StalledPart { name: String::new(), triangles: 0, coarsest_triangles: 0, cause: Default::default() };
    let report = BakeReport { stalled_parts: vec![stalled], ..BakeReport::default() };
    assert_documented("bake --json", &serde_json::to_value(report).unwrap());
    assert_documented("bake --report", &serde_json::json!({ "part_list": [PartReport::default()] }));
}

#[test]
fn every_column_and_key_of_a_comparison_is_documented() {
    let columns: BTreeSet<String> = PartRow::COLUMNS.iter().map(|&column| column.to_owned()).collect();
    assert_eq!(documented("compare --csv"), columns, "docs/output.md (left) against the program (right)");
    let dealt = vec![DealtRow::default()];
    let row = RatioRow { meshoptimizer: Some(Figures::default()), dealt, ..RatioRow::default() };
    let comparison = Comparison { rows: vec![row], ..Comparison::default() };
    assert_documented("compare --json", &serde_json::to_value(comparison).unwrap());
}

#[test]
fn every_key_of_a_synth_report_is_documented() {
    assert_documented("synth --json", &serde_json::to_value(SynthReport::default()).unwrap());
}

#[test]
fn every_key_of_an_adapter_report_is_documented() {
    assert_documented("bandwidth --json", &serde_json::to_value(AdapterReport::default()).unwrap());
}

#[test]
fn every_key_of_info_is_documented() {
    let golden = root().join("tests/golden/v1.clps");
    let output = Command::cargo_bin("collapsar")
        .unwrap()
        .args(["info", "--json", "--parts"])
        .arg(golden)
        .assert()
        .success()
        .get_output()
        .clone();
    assert_documented("info --json", &serde_json::from_slice(&output.stdout).unwrap());
}

/// The readme, the changelog, and every document.
fn documents() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let markdown = folder.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    [root().join("README.md"), root().join("CHANGELOG.md")].into_iter().chain(markdown).collect()
}

/// The targets of `[text](target)` outside of fenced blocks.
fn links(markdown: &str) -> Vec<String> {
    let prose: String = markdown.split("```").step_by(2).collect();
    let targets = prose.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    targets.map(|(target, _)| target.to_owned()).collect()
}

/// The anchor that a heading has: lower case, dashes for spaces, nothing else but letters, digits, `_` and `-`.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|&c| c.is_alphanumeric() || c == '-' || c == '_').collect()
}

fn assert_link(document: &Path, target: &str) {
    let (file, fragment) = target.split_once('#').unwrap_or((target, ""));
    let folder = document.parent().unwrap();
    let path = if file.is_empty() { document.to_owned() } else { folder.join(file) };
    assert!(path.exists(), "{} links to {target}, which does not exist", document.display());
    if !fragment.is_empty() {
        let linked = std::fs::read_to_string(&path).unwrap();
        let mut headings = linked.lines().filter(|line| line.starts_with('#'));
        let found = headings.any(|line| anchor(line.trim_start_matches('#')) == fragment);
        assert!(found, "{} links to {target}, which has no such heading", document.display());
    }
}

#[test]
fn every_relative_link_leads_somewhere() {
    let mut checked = 0;
    for document in documents() {
        let markdown = std::fs::read_to_string(&document).unwrap();
        for target in links(&markdown).iter().filter(|target| !target.contains("://")) {
            assert_link(&document, target);
            checked += 1;
        }
    }
    assert!(checked > 10, "only {checked} links were found");
}

/// The files of the tree that `docs/architecture.md` draws: two spaces a level, the name first, folders end in `/`.
fn drawn_files() -> BTreeSet<String> {
    let architecture = text("docs/architecture.md");
    let tree = section(&architecture, "The source tree");
    let block = tree.split("```").nth(1).unwrap();
    let mut folders: Vec<&str> = Vec::new();
    let mut files = BTreeSet::new();
    for line in block.lines().skip(1).filter(|line| !line.trim().is_empty()) {
        let depth = line.chars().take_while(|&c| c == ' ').count() / 2;
        let name = line.split_whitespace().next().unwrap();
        folders.truncate(depth);
        if name.ends_with('/') {
            folders.push(name);
        } else {
            files.insert(folders.concat() + name);
        }
    }
    files
}

fn files_below(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files_below(&path, found);
        } else {
            let name = path.strip_prefix(root()).unwrap().to_str().unwrap();
            found.insert(name.replace('\\', "/"));
        }
    }
}

#[test]
fn the_drawn_tree_is_the_source_tree() {
    let mut files = BTreeSet::new();
    for folder in ["src", "shaders"] {
        files_below(&root().join(folder), &mut files);
    }
    let drawn = drawn_files();
    let drawn: BTreeSet<String> =
        drawn.into_iter().filter(|file| file.starts_with("src/") || file.starts_with("shaders/")).collect();
    let missing: Vec<_> = files.difference(&drawn).collect();
    let gone: Vec<_> = drawn.difference(&files).collect();
    assert!(missing.is_empty(), "docs/architecture.md does not list {missing:?}");
    assert!(gone.is_empty(), "docs/architecture.md lists {gone:?}, which do not exist");
}

#[test]
fn the_helpers_see_what_they_look_for() {
    assert_eq!(anchor(" A frame's 7 stages (`select`)"), "a-frames-7-stages-select");
    assert_eq!(links("[a](b.md) ```[x](y)``` ![c](d.png#e)"), ["b.md", "d.png#e"]);
    assert_eq!(section("# a\nx\n## b\ny\n### c\nz\n## d\nw", "b"), "y\n### c\nz");
}
