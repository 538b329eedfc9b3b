//! A folder of its own for every test, the binary run in it, and what came of that.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use assert_cmd::cargo::cargo_bin_cmd;
use serde_json::Value;

/// Nothing that a test asks for may take longer.
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// At how many moments something is killed, cut short or filled up; `COLLAPSAR_MOMENTS` asks for another number of them.
pub fn moments() -> u32 {
    std::env::var("COLLAPSAR_MOMENTS").map_or(20, |count| count.parse().unwrap())
}

/// A temporary folder in which the binary runs, so that tests name files without folders.
pub struct Workplace {
    folder: tempfile::TempDir,
}

/// How a run ended.
#[derive(Debug)]
pub struct Outcome {
    /// The exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Workplace {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    pub fn make_folder(&self, name: &str) {
        fs::create_dir(self.path(name)).unwrap();
    }

    /// Runs `collapsar` with these arguments.
    pub fn run(&self, arguments: &[&str]) -> Outcome {
        self.run_with(arguments, &[])
    }

    /// Runs `collapsar` with some environment variables.
    pub fn run_with(&self, arguments: &[&str], environment: &[(&str, &str)]) -> Outcome {
        let mut command = cargo_bin_cmd!("collapsar");
        command.args(arguments).current_dir(self.folder.path()).timeout(TIME_LIMIT);
        command.envs(quiet()).envs(environment.iter().copied());
        Outcome::of(&command.output().unwrap())
    }

    /// The same, for tests that need the process or its pipes.
    pub fn command(&self, arguments: &[&str]) -> std::process::Command {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_collapsar"));
        command.args(arguments).current_dir(self.folder.path()).envs(quiet());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Every file and folder below the workplace, with the files' bytes.
    pub fn snapshot(&self) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        collect(self.folder.path(), &mut found);
        found
    }

    /// Runs what must fail with code 1, one line, and these words in it, and leave the folder as it was.
    #[track_caller]
    pub fn fails(&self, arguments: &[&str], words: &[&str]) {
        let before = self.snapshot();
        self.run(arguments).failed(words);
        self.assert_unchanged(&before);
    }

    /// Runs what the parser of arguments must refuse with code 2 and these words.
    #[track_caller]
    pub fn refuses(&self, arguments: &[&str], words: &[&str]) {
        let before = self.snapshot();
        let outcome = self.run(arguments);
        assert_eq!(outcome.code, Some(2), "{arguments:?}: {outcome:?}");
        assert!(outcome.out.is_empty() && outcome.err.starts_with("error: "), "{outcome:?}");
        outcome.says(words);
        self.assert_unchanged(&before);
    }

    #[track_caller]
    pub fn assert_unchanged(&self, before: &BTreeMap<PathBuf, Option<Vec<u8>>>) {
        let after = self.snapshot();
        assert!(after.keys().eq(before.keys()), "left behind: {:?}, was: {:?}", after.keys(), before.keys());
        assert!(&after == before, "a file has other bytes");
    }

    /// Bakes a file of the workplace and gives the report.
    #[track_caller]
    pub fn bake(&self, input: &str, output: &str) -> Value {
        self.run(&["bake", input, "-o", output, "--json"]).succeeded().json()
    }

    /// Verifies a container.
    #[track_caller]
    pub fn verify(&self, container: &str) {
        let outcome = self.run(&["verify", container]).succeeded();
        assert!(outcome.out.starts_with("sound: "), "{outcome:?}");
    }

    /// Flies three frames of `orbit` over small pictures and gives the summary.
    #[track_caller]
    pub fn fly_briefly(&self, container: &str) -> Value {
        let outcome = self.run(&["fly", container, "--frames", "3", "--size", "64x64", "--json"]).succeeded();
        let summary = outcome.json();
        assert_eq!(summary["frames"], 3, "{summary}");
        summary
    }
}

impl Outcome {
    pub fn of(output: &std::process::Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self { code: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
    }

    #[track_caller]
    pub fn succeeded(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// That it failed with code 1 and one line that has these words.
    #[track_caller]
    pub fn failed(&self, words: &[&str]) {
        self.failed_with(1, words);
    }

    /// That it failed with a code and one line that has these words.
    #[track_caller]
    pub fn failed_with(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        assert!(self.out.is_empty(), "{self:?}");
        assert!(self.err.starts_with("error: ") && self.err.lines().count() == 1, "one line: {self:?}");
        self.says(words);
    }

    #[track_caller]
    pub fn says(&self, words: &[&str]) {
        for word in words {
            assert!(self.err.contains(word), "no {word:?} in {self:?}");
        }
    }

    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// The names in a folder, without their contents, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Whether this machine has an adapter for a test; says and counts it either way.
pub fn has_gpu(test: &str) -> bool {
    collapsar::gpu::testing::device(test).is_some()
}

/// Mesa complains about a missing runtime folder on standard error, where our one line is.
fn quiet() -> Vec<(&'static str, &'static str)> {
    match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(_) => Vec::new(),
        None => vec![("XDG_RUNTIME_DIR", "/tmp")],
    }
}

fn collect(folder: &Path, found: &mut BTreeMap<PathBuf, Option<Vec<u8>>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
            found.insert(path, None);
        } else {
            let bytes = fs::read(&path).unwrap();
            found.insert(path, Some(bytes));
        }
    }
}
