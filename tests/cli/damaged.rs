//! Containers that were cut short, damaged, or written by another version.

use collapsar::container::Container;

use crate::common::patched_box;
use crate::models::{TRIANGLE, obj};
use crate::workplace::{Workplace, has_gpu, names};

/// A small container of two parts, as the binary writes it.
fn small() -> (Workplace, Vec<u8>) {
    small_with(&[])
}

fn small_with(options: &[&str]) -> (Workplace, Vec<u8>) {
    let place = Workplace::new();
    place.write("small.obj", obj(&[patched_box(6), patched_box(2)]) + "o last\n" + &relative_triangle());
    place.run(&[&["bake", "small.obj", "-o", "good.clps"], options].concat()).succeeded();
    let bytes = place.read("good.clps");
    (place, bytes)
}

/// [`TRIANGLE`] with indices that count from the end.
fn relative_triangle() -> String {
    TRIANGLE.replace("f 1 2 3", "f -3 -2 -1")
}

/// The message with which the library refuses these bytes, which must start at a multiple of 8.
fn refusal(words: &[u64], bytes: usize) -> Option<String> {
    Container::open(&bytemuck::cast_slice(words)[..bytes]).err().map(|error| error.to_string())
}

fn words_of(bytes: &[u8]) -> Vec<u64> {
    let mut words = vec![0u64; bytes.len().div_ceil(8)];
    bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
    words
}

/// Where the payload starts.
fn payload_start(bytes: &[u8]) -> usize {
    Container::open(bytemuck::cast_slice::<u64, u8>(&words_of(bytes))).unwrap().header().payload_offset
        as usize
}

/// That every verb that opens a container refuses this one with these words and leaves nothing.
#[track_caller]
fn every_verb_refuses(place: &Workplace, name: &str, words: &[&str]) {
    let words = [words, &[name]].concat();
    place.fails(&["info", name], &words);
    place.fails(&["info", name, "--json", "--parts"], &words);
    place.fails(&["verify", name], &words);
    place.fails(&["export", name, "--ratio", "1", "-o", "out.obj"], &words);
    place.fails(&["fly", name, "--frames", "1", "--size", "64x64", "--out", "flight"], &words);
}

#[test]
fn every_prefix_is_refused() {
    let (_place, bytes) = small();
    let words = words_of(&bytes);
    for length in 0..bytes.len() {
        let message = refusal(&words, length).unwrap_or_else(|| panic!("{length} bytes open"));
        assert!(message.contains(&format!("ends after {length} bytes")), "{length} bytes: {message}");
    }
    assert_eq!(refusal(&words, bytes.len()), None);
}

#[test]
fn a_truncated_container_is_refused_by_every_verb() {
    let (place, bytes) = small();
    let payload = payload_start(&bytes);
    for length in [1, 63, 64, 300, payload - 1, payload, payload + 1, bytes.len() - 1] {
        place.write("cut.clps", &bytes[..length]);
        every_verb_refuses(&place, "cut.clps", &[&format!("ends after {length} bytes"), "cut short"]);
    }
}

#[test]
fn every_flipped_byte_of_the_tables_is_refused() {
    let (_place, bytes) = small();
    let mut words = words_of(&bytes);
    for at in 0..payload_start(&bytes) {
        for mask in [0xff, 0x01, 0x80] {
            bytemuck::cast_slice_mut::<u64, u8>(&mut words)[at] ^= mask;
            assert!(refusal(&words, bytes.len()).is_some(), "byte {at} flipped by {mask:#x} opens");
            bytemuck::cast_slice_mut::<u64, u8>(&mut words)[at] ^= mask;
        }
    }
    assert_eq!(refusal(&words, bytes.len()), None);
}

#[test]
fn a_flipped_byte_of_the_tables_is_refused_by_every_verb() {
    let (place, bytes) = small();
    let payload = payload_start(&bytes);
    let cases = [
        (0, "text mode"),
        (1, "not a .clps container"),
        (20, "checksum of the header"),
        (70, "checksum of the"),
        (300, "checksum of the"),
        (payload / 2, "checksum of the"),
    ];
    for (at, word) in cases {
        let mut bytes = bytes.clone();
        bytes[at] ^= 0xff;
        place.write("bad.clps", &bytes);
        every_verb_refuses(&place, "bad.clps", &[word]);
    }
}

#[test]
fn a_file_that_is_no_container_is_refused() {
    let place = Workplace::new();
    place.write("model.obj", TRIANGLE.repeat(20));
    every_verb_refuses(&place, "model.obj", &["this is not a .clps container"]);
}

#[test]
fn a_container_of_another_version_is_refused() {
    let (place, mut bytes) = small();
    // A later version may have another header, so that nothing behind the version can be trusted.
    for version in [0u32, 2, u32::MAX] {
        bytes[8..12].copy_from_slice(&version.to_le_bytes());
        place.write("other.clps", &bytes);
        let found = format!("format version {version}; this program reads version 1: bake the model again");
        every_verb_refuses(&place, "other.clps", &[&found]);
    }
}

/// The container with one byte of its last chunk flipped, which `info` does not look at.
fn with_damaged_payload() -> Workplace {
    let (place, mut bytes) = small();
    let last = bytes.len() - 40;
    bytes[last] ^= 0x10;
    place.write("bad.clps", &bytes);
    place.run(&["info", "bad.clps"]).succeeded();
    place
}

#[test]
fn verify_names_the_chunk_with_a_flipped_byte() {
    let place = with_damaged_payload();
    let before = place.snapshot();
    let outcome = place.run(&["verify", "bad.clps"]);
    assert_eq!(outcome.code, Some(1), "{outcome:?}");
    outcome.says(&[
        "part ",
        ", tier 0",
        "checksum",
        "error: 1 finding: the container is damaged",
        "bad.clps",
    ]);
    assert!(outcome.out.is_empty(), "{outcome:?}");
    place.assert_unchanged(&before);
}

#[test]
fn verify_finds_every_flipped_byte_of_the_payload() {
    every_flipped_byte_is_found(&[]);
}

#[test]
fn verify_finds_every_flipped_byte_of_a_compressed_payload() {
    every_flipped_byte_is_found(&["--compress"]);
}

fn every_flipped_byte_is_found(options: &[&str]) {
    let (_place, bytes) = small_with(options);
    let mut words = words_of(&bytes);
    for at in payload_start(&bytes)..bytes.len() {
        bytemuck::cast_slice_mut::<u64, u8>(&mut words)[at] ^= 0x20;
        let container = Container::open(bytemuck::cast_slice(&words)).unwrap();
        let found = collapsar::container::inspect(&container).findings;
        assert!(found.iter().any(|line| line.contains("tier")), "byte {at}: {found:?}");
        bytemuck::cast_slice_mut::<u64, u8>(&mut words)[at] ^= 0x20;
    }
}

#[test]
fn export_refuses_a_damaged_chunk_and_leaves_nothing() {
    let place = with_damaged_payload();
    let words = ["checksum", "part ", "tier 0", "bad.clps"];
    place.fails(&["export", "bad.clps", "--ratio", "1", "-o", "out.obj"], &words);
    place.fails(&["export", "bad.clps", "--ratio", "1", "-o", "out.glb"], &words);
}

#[test]
fn a_flight_over_a_damaged_chunk_fails_and_leaves_no_numbers() {
    if !has_gpu("cli::damaged::a_flight_over_a_damaged_chunk_fails_and_leaves_no_numbers") {
        return;
    }
    let place = with_damaged_payload();
    let flight = ["fly", "bad.clps", "--frames", "3", "--size", "64x64", "--png", "1", "--out", "flight"];
    place.run(&flight).failed(&["checksum", "part ", "tier 0", "damaged", "bad.clps"]);
    assert_eq!(names(&place.path("flight")), [""; 0]);
    let compared = [&flight as &[&str], &["--compare"]].concat();
    place.run(&compared).failed(&["checksum", "bad.clps"]);
    assert_eq!(names(&place.path("flight/coherent")), [""; 0]);
}
