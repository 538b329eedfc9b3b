//! Writing: all of a file or none, whatever goes wrong.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::AtomicBool;

use collapsar::container::{ContainerError, Contents, Form, write};

use crate::parts::{contents_of, golden_contents, sheet, stored};

static GO: AtomicBool = AtomicBool::new(false);

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn only_the_final_name_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.clps");
    let done = write(&path, &golden_contents(), Form::Plain, &GO).unwrap();
    assert_eq!(files(folder.path()), ["a.clps"]);
    assert_eq!(std::fs::metadata(&path).unwrap().len(), done.file_bytes);
    write(&path, &contents_of(vec![]), Form::Plain, &GO).unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < done.file_bytes, "an older file is replaced");
}

#[cfg(unix)]
#[test]
fn the_file_may_be_read_by_others_as_usual() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [ours, usual] = ["a.clps", "usual"].map(|name| folder.path().join(name));
    write(&ours, &golden_contents(), Form::Plain, &GO).unwrap();
    std::fs::write(&usual, b"").unwrap();
    let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&usual));
}

#[test]
fn an_interrupted_write_leaves_nothing_new() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.clps");
    let error = write(&path, &golden_contents(), Form::Plain, &AtomicBool::new(true)).unwrap_err();
    assert!(matches!(error, ContainerError::Interrupted));
    assert_eq!(files(folder.path()), Vec::<String>::new());
    std::fs::write(&path, b"older").unwrap();
    write(&path, &golden_contents(), Form::Plain, &AtomicBool::new(true)).unwrap_err();
    assert_eq!(std::fs::read(&path).unwrap(), b"older");
}

#[test]
fn a_missing_folder_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    let error = write(&missing.join("a.clps"), &golden_contents(), Form::Plain, &GO).unwrap_err().to_string();
    assert!(error.starts_with("cannot write a container: its folder does not exist"), "{error}");
    assert!(error.ends_with(&missing.display().to_string()), "{error}");
    assert!(!missing.exists());
}

#[test]
fn a_folder_as_output_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = write(folder.path(), &golden_contents(), Form::Plain, &GO).unwrap_err();
    assert!(matches!(error, ContainerError::OutputIsFolder { .. }), "{error}");
    assert_eq!(files(folder.path()), Vec::<String>::new());
}

/// Writes contents that contradict themselves; gives the message.
fn refused(change: impl FnOnce(&mut Contents)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut contents = golden_contents();
    change(&mut contents);
    let error = write(&folder.path().join("a.clps"), &contents, Form::Plain, &GO).unwrap_err();
    assert!(matches!(error, ContainerError::Contents { .. }), "{error}");
    assert_eq!(files(folder.path()), Vec::<String>::new());
    error.to_string()
}

#[test]
fn contents_that_contradict_themselves_are_refused() {
    assert!(refused(|c| c.instances[1].part = 3).contains("instance 1: it names part 3, but there are 3"));
    assert!(refused(|c| c.instances[0].world_from_part.translation.x = f64::NAN).contains("not finite"));
    assert!(refused(|c| c.nodes[1].parent = Some(1)).contains("node 1: its parent"));
    assert!(refused(|c| c.parts[1].part.vertices.clear()).contains("part 1: it has no vertices"));
    assert!(refused(|c| c.parts[1].part.ecol.clear()).contains("differ in length"));
    assert!(refused(|c| c.parts[0].part.tiers.clear()).contains("finest tier"));
    assert!(refused(|c| c.parts[0].part.tiers.reverse()).contains("finest tier"));
    assert!(refused(|c| c.parts[0].part.tiers[1].vertices = 0).contains("fewer"));
    assert!(refused(|c| c.parts[0].part.locked = 1000).contains("coarsest state"));
    assert!(refused(|c| c.parts[0].part.locked = 0).contains("no vertex"));
    assert!(refused(|c| c.parts[0].part.grid.step_exponent = 1001).contains("step"));
}

const TINY: &str = "COLLAPSAR_TEST_TINY_FOLDER";

/// Runs itself again where a tiny file system is mounted that nobody else sees.
#[test]
fn on_a_full_disk_nothing_is_left() {
    if let Some(folder) = std::env::var_os(TINY) {
        return write_to_a_full_disk(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    let script = "mount -t tmpfs -o size=64k tmpfs \"$0\" && exec \"$@\"";
    let child = Command::new("unshare")
        .args(["-rm", "sh", "-c", script])
        .arg(folder.path())
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "output::on_a_full_disk_nothing_is_left", "--nocapture"])
        .env(TINY, folder.path())
        .output();
    match child {
        Ok(ran) if ran.status.success() => {
            assert!(String::from_utf8_lossy(&ran.stdout).contains("1 passed"), "the child ran one test");
        }
        // What the test harness ends with when a test fails.
        Ok(ran) if ran.status.code() == Some(101) => panic!("{}", String::from_utf8_lossy(&ran.stderr)),
        _ => eprintln!("skipped: this machine lets nobody mount a tiny file system"),
    }
}

fn write_to_a_full_disk(folder: &Path) {
    let large = contents_of((0..40).map(|i| stored(&sheet(16, 16, 1, 40 + i), "sheet")).collect());
    let error = write(&folder.join("a.clps"), &large, Form::Plain, &GO).unwrap_err();
    assert!(error.to_string().contains("o space left"), "{error}");
    assert_eq!(files(folder), Vec::<String>::new());
    write(&folder.join("a.clps"), &golden_contents(), Form::Plain, &GO).unwrap();
    assert_eq!(files(folder), ["a.clps"]);
}
