//! The committed file of version 1: the writer makes it again, bit for bit, and any damage to it is seen.

use std::path::PathBuf;

use collapsar::container::{Container, ContainerError, Form, inspect, verify};

use crate::bytes::{Aligned, written, written_as};
use crate::parts::golden_contents;
use crate::read_all;

pub fn golden() -> Aligned {
    Aligned::new(&std::fs::read(path()).unwrap())
}

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/v1.clps")
}

/// A change of these bytes is a new version of the format. `COLLAPSAR_BLESS=1` writes the file anew.
#[test]
fn the_writer_makes_the_golden_bytes() {
    let made = written(&golden_contents());
    if std::env::var_os("COLLAPSAR_BLESS").is_some() {
        std::fs::write(path(), made.get()).unwrap();
    }
    assert_eq!(made.get(), golden().get());
}

/// The same in the other forms. What zstd makes of a compressed chunk may change with its version, so that of these bytes
/// only what they say is compared.
#[test]
fn the_other_forms_of_the_golden_file_hold_the_same() {
    for (name, form) in [("v1-narrow.clps", Form::Narrow), ("v1-compressed.clps", Form::Compressed)] {
        let path = path().with_file_name(name);
        let made = written_as(&golden_contents(), form);
        if std::env::var_os("COLLAPSAR_BLESS").is_some() {
            std::fs::write(&path, made.get()).unwrap();
        }
        let file = Aligned::new(&std::fs::read(&path).unwrap());
        let container = Container::open(file.get()).unwrap();
        assert_eq!(read_all(&container), golden_contents(), "{name}");
        verify(&container).unwrap();
        assert!(form == Form::Compressed || made.get() == file.get(), "{name}");
    }
}

#[test]
fn the_golden_file_is_valid() {
    let file = golden();
    let report = verify(&Container::open(file.get()).unwrap()).unwrap();
    assert_eq!(report.findings, Vec::<String>::new());
}

#[test]
fn every_prefix_is_refused() {
    let file = golden();
    for len in 0..file.get().len() {
        let error = Container::open(&file.get()[..len]).unwrap_err();
        assert!(matches!(error, ContainerError::Truncated { .. }), "{len} bytes: {error}");
    }
}

#[test]
fn a_longer_file_is_refused() {
    let file = Aligned::new(&[golden().get(), &[0; 16]].concat());
    assert!(Container::open(file.get()).unwrap_err().to_string().contains("should have"));
}

#[test]
fn every_flipped_bit_before_the_payload_is_refused() {
    let mut file = golden();
    for bit in 0..file.u64(24) as usize * 8 {
        file.get_mut()[bit / 8] ^= 1 << (bit % 8);
        assert!(Container::open(file.get()).is_err(), "bit {} of byte {}", bit % 8, bit / 8);
        file.get_mut()[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn every_flipped_byte_of_the_payload_is_found() {
    let mut file = golden();
    for byte in file.u64(24) as usize..file.get().len() {
        file.get_mut()[byte] ^= 0xff;
        let found = inspect(&Container::open(file.get()).unwrap()).findings;
        assert_eq!(found.len(), 1, "byte {byte}: {found:?}");
        file.get_mut()[byte] ^= 0xff;
    }
}

#[test]
fn another_version_is_refused_by_its_own_message() {
    let mut file = golden();
    file.set_u32(8, 7);
    file.repair();
    assert_eq!(
        Container::open(file.get()).unwrap_err().to_string(),
        "this file is format version 7; this program reads version 1: bake the model again, or use a newer program"
    );
}

#[test]
fn other_files_are_refused_by_their_own_messages() {
    let message = |bytes: &[u8]| Container::open(bytes).unwrap_err().to_string();
    assert!(message(b"glTF\x02\0\0\0 and more").starts_with("this is not a .clps container"));
    assert!(message(b"\x89CLPS\n\x1a\x01 and more").contains("text mode"));
    assert!(message(b"").contains("cut short"));
}

#[test]
fn bytes_that_are_not_aligned_are_refused() {
    let file = golden();
    let shifted = Aligned::new(&[&[0], file.get()].concat());
    assert!(matches!(Container::open(&shifted.get()[1..]), Err(ContainerError::Misaligned)));
}
