//! The three forms of a chunk: all hold the same, and damage to any is seen or does no harm.

use collapsar::container::{Contents, Form, inspect};
use proptest::prelude::*;

use crate::bytes::{Aligned, written_as};
use crate::damage::exercise;
use crate::parts::{book, contents_of, golden_contents, sheet, stored};
use crate::{assert_round_trip_as, wide};

const FORMS: [Form; 3] = [Form::Plain, Form::Narrow, Form::Compressed];

/// The forms of all chunks of a file.
fn forms(file: &Aligned) -> Vec<Form> {
    let rows = file.section(1).unwrap().step_by(32);
    rows.map(|row| Form::from_number((file.u32(row + 20) >> 16) as u16).unwrap()).collect()
}

/// Sheets with creases and several tiers, large enough to be worth compressing.
fn large() -> Contents {
    contents_of(vec![stored(&sheet(40, 30, 6, 7), "sheet"), stored(&sheet(25, 20, 1, 3), "other"), {
        let mut slotted = stored(&sheet(17, 20, 3, 5), "slotted");
        slotted.part.attributes = collapsar::geometry::record::Attributes::Slot;
        slotted.part.vertices.iter_mut().for_each(|vertex| vertex.words[2] &= 0x01ff_ffff);
        slotted
    }])
    .placed_once()
}

trait PlacedOnce {
    fn placed_once(self) -> Self;
}

impl PlacedOnce for Contents {
    /// A part of two slots needs two materials from its own on.
    fn placed_once(mut self) -> Self {
        self.instances.iter_mut().for_each(|instance| instance.material = 0);
        self
    }
}

#[test]
fn all_forms_hold_the_same() {
    for form in FORMS {
        assert_round_trip_as(&golden_contents(), form);
        assert_round_trip_as(&large(), form);
        assert_round_trip_as(&contents_of(vec![stored(&wide(), "wide"), stored(&book(), "book")]), form);
        assert_round_trip_as(&contents_of(vec![]), form);
    }
}

#[test]
fn each_form_is_smaller_than_the_plainer_one() {
    let files = FORMS.map(|form| written_as(&large(), form));
    for (file, form) in files.iter().zip(FORMS) {
        let have = forms(file).iter().filter(|&&stored| stored == form).count();
        // The smallest chunks are no smaller compressed.
        let least = if form == Form::Compressed { forms(file).len() / 2 } else { forms(file).len() };
        assert!(have >= least, "{form:?}: {have} of {}", forms(file).len());
    }
    let payload = files.map(|file| file.u64(32));
    let triangles: usize =
        large().parts.iter().flat_map(|part| &part.part.tiers).map(|tier| tier.triangles.len()).sum();
    assert!(payload[1] < payload[0] - triangles as u64 + 16 * 20);
    assert!(payload[2] < payload[1] / 3, "{payload:?}");
}

/// A chunk that cannot be compressed, or not as a sound one, is stored in a plainer form.
#[test]
fn what_has_no_such_form_is_stored_in_a_plainer_one() {
    let mut contents = large();
    contents.parts[0].part.ecol[20] = u16::MAX;
    let file = written_as(&contents, Form::Compressed);
    assert!(forms(&file).contains(&Form::Narrow) && forms(&file).contains(&Form::Compressed));
    contents.parts[1].part.tiers[0].triangles[5].flags = 0x300;
    let file = written_as(&contents, Form::Compressed);
    assert!(forms(&file).contains(&Form::Plain));
    assert!(forms(&written_as(&contents, Form::Narrow)).contains(&Form::Plain));
}

#[test]
fn every_flipped_byte_of_the_payload_is_found_in_every_form() {
    for form in [Form::Narrow, Form::Compressed] {
        let mut file = written_as(&golden_contents(), form);
        for byte in file.u64(24) as usize..file.get().len() {
            file.get_mut()[byte] ^= 0xff;
            let container = collapsar::container::Container::open(file.get()).unwrap();
            assert!(!inspect(&container).findings.is_empty(), "{form:?}, byte {byte}");
            file.get_mut()[byte] ^= 0xff;
        }
    }
}

/// Rows that claim more than their bytes can hold are refused before memory is taken.
#[test]
fn a_form_that_does_not_fit_its_bytes_is_refused() {
    let refused = |form: u32, from: Form, bytes: Option<u32>| {
        let mut file = written_as(&large(), from);
        // The last chunk of the payload: the finest tier of the last part.
        let row = file.section(1).unwrap().step_by(32).max_by_key(|&row| file.u64(row)).unwrap();
        file.set_u32(row + 20, form << 16);
        if let Some(bytes) = bytes {
            file.set_u32(row + 8, bytes);
        }
        file.repair();
        collapsar::container::Container::open(file.get()).unwrap_err().to_string()
    };
    assert!(refused(3, Form::Plain, None).contains("the form 3, which is unknown"));
    assert!(refused(0, Form::Compressed, None).contains("its counts call for"));
    assert!(refused(1, Form::Compressed, None).contains("its counts call for"));
    assert!(refused(1, Form::Plain, None).contains("its counts call for"));
    assert!(refused(2, Form::Compressed, Some(8)).contains("its counts call for"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damage_to_any_form_with_right_checksums_never_panics(
        form in prop::sample::select(vec![Form::Narrow, Form::Compressed]),
        changes in prop::collection::vec((0.0..1.0, any::<u8>()), 1..6),
    ) {
        let mut file = written_as(&golden_contents(), form);
        let payload = file.u64(24) as usize;
        let length = file.get().len() - payload;
        for (at, value) in changes {
            file.get_mut()[payload + (at * length as f64) as usize] = value;
        }
        file.repair();
        exercise(&file);
    }

    #[test]
    fn sheets_of_any_size_come_back_in_any_form(
        nx in 2usize..20, ny in 2usize..20, locked in 1usize..5, seed in 1usize..200, ratio in 2usize..5,
        form in prop::sample::select(FORMS.to_vec()),
    ) {
        let mut mesh = sheet(nx, ny, locked.min(nx * ny), seed);
        mesh.tier_ratio = ratio;
        assert_round_trip_as(&contents_of(vec![stored(&mesh, "sheet")]), form);
    }
}
