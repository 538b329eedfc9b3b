//! Readers that hang up: a pipe whose other end is closed ends the program, without a panic.

use crate::models::SQUARE;
use crate::workplace::{Outcome, Workplace, has_gpu};

/// A pipe that nobody reads.
fn closed() -> std::io::PipeWriter {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer
}

fn baked() -> Workplace {
    let place = Workplace::new();
    place.write("square.obj", SQUARE);
    place.bake("square.obj", "square.clps");
    place
}

/// How a run ends whose standard output is a closed pipe.
fn without_reader(place: &Workplace, arguments: &[&str]) -> Outcome {
    let child = place.command(arguments).stdout(closed()).spawn().unwrap();
    Outcome::of(&child.wait_with_output().unwrap())
}

#[test]
fn a_closed_standard_output_is_no_failure() {
    let place = baked();
    for arguments in [
        &["info", "square.clps"] as &[&str],
        &["info", "square.clps", "--json", "--parts"],
        &["verify", "square.clps"],
        &["bake", "square.obj", "-o", "again.clps"],
        &["export", "square.clps", "--ratio", "1", "-o", "out.obj"],
        &["--help"],
        &["fly", "--help"],
    ] {
        let outcome = without_reader(&place, arguments);
        assert_eq!((outcome.code, outcome.err.as_str()), (Some(0), ""), "{arguments:?}: {outcome:?}");
    }
    place.verify("again.clps");
}

#[test]
fn a_flight_with_a_closed_standard_output_is_no_failure() {
    if !has_gpu("cli::pipes::a_flight_with_a_closed_standard_output_is_no_failure") {
        return;
    }
    let place = baked();
    let outcome =
        without_reader(&place, &["fly", "square.clps", "--frames", "1", "--size", "64x64", "--json"]);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(0), ""), "{outcome:?}");
}

#[test]
fn a_closed_standard_error_keeps_the_exit_code() {
    let place = baked();
    for arguments in [&["info", "none.clps"] as &[&str], &["bake", "none.obj", "-o", "out.clps"]] {
        let child = place.command(arguments).stderr(closed()).spawn().unwrap();
        let outcome = Outcome::of(&child.wait_with_output().unwrap());
        assert_eq!(outcome.code, Some(1), "{arguments:?}: {outcome:?}");
    }
}

#[test]
fn findings_into_a_closed_standard_error_keep_the_exit_code() {
    let place = baked();
    let mut bytes = place.read("square.clps");
    let last = bytes.len() - 20;
    bytes[last] ^= 0xff;
    place.write("bad.clps", bytes);
    let child = place.command(&["verify", "bad.clps"]).stderr(closed()).spawn().unwrap();
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(1));
}
