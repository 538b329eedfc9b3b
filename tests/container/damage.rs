//! Files with right checksums and wrong content: each contradiction has its message, and nothing panics.

use collapsar::container::{Container, inspect};
use proptest::prelude::*;

use crate::bytes::{Aligned, written};
use crate::golden::golden;
use crate::parts::{contents_of, ordered, sheet, stored};

/// Where the row `index` of a section starts.
fn row(file: &Aligned, section: usize, index: usize) -> usize {
    file.section(section).unwrap().start + index * [128, 32, 112, 16, 16, 1, 64, 4][section]
}

/// The message of `open` after a change of one field of 32 bits, with checksums made right.
fn refused(section: usize, index: usize, field: usize, value: u32) -> String {
    let mut file = golden();
    let offset = row(&file, section, index) + field;
    file.set_u32(offset, value);
    file.repair();
    Container::open(file.get()).unwrap_err().to_string()
}

#[test]
fn every_contradiction_in_the_tables_is_named() {
    let cases = [
        (0, 0, 20, 0x7ff0_0000, "part 0: its box is not finite"),
        (0, 0, 24, 1001, "part 0: its grid's step"),
        (0, 0, 28, 32, "part 0: its flags"),
        (0, 0, 28, 16, "part 0: its flags"),
        (0, 0, 28, 4, "part 0: it has 0 material slots and the flags 0x4"),
        (0, 1, 116, 2, "part 1: its parent cell is 2 parts before it"),
        (0, 1, 116, 1, "part 1: its parent cell, part 0, is none"),
        (0, 0, 120, 2, "part 0: it stands for 2 leaf cells and has 0"),
        (0, 0, 124, 1, "part 0: it has 1 material slots and the flags 0x0"),
        (0, 1, 32, u32::MAX, "part 1: its box is empty"),
        (0, 1, 44, 1 << 21, "outside 21 bits"),
        (0, 1, 56, 65_537, "part 1: it has 65537 vertices"),
        (0, 1, 56, 0, "part 1: it has 0 vertices"),
        (0, 1, 56, 10, "not those of tier 0"),
        (0, 1, 60, 1 << 21, "part 1: it has 2097152 triangles"),
        (0, 1, 64, 0, "no vertex"),
        (0, 1, 64, 9, "larger than its coarsest tier"),
        (0, 1, 68, 500, "larger than its coarsest tier"),
        (0, 1, 72, 1000, "part 1: its name"),
        (0, 1, 80, u32::MAX, "part 1: its name"),
        (0, 2, 80, 1, "part 2: its name"),
        (0, 1, 88, 0, "part 1: its first chunk row is 0"),
        (0, 2, 92, 2, "part 2: its 2 tiers are not among"),
        (0, 2, 92, u32::MAX, "tiers are not among"),
        (0, 2, 92, 0, "tiers are not among"),
        (0, 2, 112, 6, "part 2: its cause of stall is 6"),
        (0, 2, 124, 1, "part 2: it has 1 material slots and the flags 0x3"),
        (1, 0, 0, 16, "its chunk is"),
        (1, 0, 8, 16, "its counts call for"),
        (1, 1, 12, 1000, "fewer and fewer"),
        (1, 1, 12, 0, "its tiers do not have fewer and fewer vertices"),
        (1, 1, 16, 1000, "more triangles than the next finer one"),
        (1, 0, 20, 1000, "overflow entries"),
        (1, 0, 20, 3 << 16, "the form 3, which is unknown"),
        (1, 0, 20, 1 << 16, "its counts call for"),
        (1, 0, 20, 0xffff_0000, "the form 65535, which is unknown"),
        (2, 0, 0, 3, "instance 0: it names part 3, but there are 3"),
        (2, 0, 4, 3, "instance 0: it names node 3, but there are 3"),
        (2, 0, 8, 2, "instance 0: it names material 2, but there are 2"),
        (2, 0, 12, 1, "instance 0: its flags"),
        (2, 0, 20, 0x7ff8_0000, "instance 0: its transform is not finite"),
        (3, 1, 12, 1, "node 1: its parent is node 1"),
        (3, 1, 0, 99, "node 1: its name"),
        (4, 1, 8, 99, "material 1: its name"),
        (5, 0, 0, 0xffff_ffff, "not UTF-8"),
        (6, 0, 4, 0x7ff8_0000, "group 0: its box is empty or not finite"),
        (6, 0, 28, 0xffe0_0000, "group 0: its box is empty or not finite"),
        (6, 0, 48, 0x7fc0_0000, "group 0: its largest circle is NaN"),
        (6, 0, 48, 0x8080_0000, "group 0: its largest circle is -"),
        (6, 0, 52, 1, "group 0: its members are 4 from 1, where 4 from 0 are left"),
        (6, 0, 56, 0, "group 0: it has no members"),
        (6, 0, 56, 2, "group 0: it ends at group 1 and has 2 members, not all"),
        (6, 0, 56, 5, "group 0: its members are 5 from 0, where 4 from 0 are left"),
        (6, 0, 60, 0, "group 0: it ends at group 0, outside"),
        (6, 0, 60, 2, "group 0: it ends at group 2, outside"),
        (7, 0, 0, 1, "member 1: it is instance 1, again or of 4"),
        (7, 0, 0, 4, "member 0: it is instance 4, again or of 4"),
    ];
    for (section, index, field, value, message) in cases {
        let said = refused(section, index, field, value);
        assert!(said.contains(message), "section {section}, row {index}, byte {field} = {value}: {said}");
    }
}

#[test]
fn every_contradiction_in_the_section_table_and_header_is_named() {
    let cases = [
        (12, 5, "section count"),
        (16, 1, "should have"),
        (20, 1, "cut short"),
        (24, 4, "payload does not lie"),
        (36, u32::MAX, "payload does not lie"),
        (40, 1, "section count or reserved"),
        (64, 2, "section of parts: its kind"),
        (68, 127, "section of parts: its kind"),
        (72, 336, "section of parts: its kind"),
        (80, 1 << 30, "reach into the payload"),
        (84, u32::MAX, "reach into the payload"),
        (80, 2, "section of chunks: its kind"),
    ];
    for (offset, value, message) in cases {
        let mut file = golden();
        file.set_u32(offset, value);
        file.repair();
        let said = Container::open(file.get()).unwrap_err().to_string();
        assert!(said.contains(message), "byte {offset} = {value}: {said}");
    }
}

#[test]
fn bytes_between_sections_must_be_zero() {
    let mut file = golden();
    let last = file.section(6).unwrap().start - 1;
    assert!(file.section(5).unwrap().end <= last, "the names end at a multiple of 16");
    file.get_mut()[last] = 1;
    assert!(Container::open(file.get()).unwrap_err().to_string().contains("after it are not zero"));
}

/// Where the parts of a chunk start: triangles, vertices, overflow, ecol, added, end.
fn layout(file: &Aligned, part: usize, tier: usize) -> [usize; 6] {
    let container = Container::open(file.get()).unwrap();
    let spec = container.chunk_spec(part, tier).unwrap();
    let added = spec.added_vertices() as usize;
    let sizes =
        [8 * spec.row.triangles as usize, 12 * added, 8 * spec.row.overflow as usize, 2 * added, added];
    let mut starts = [spec.range().start as usize; 6];
    (0..5).for_each(|i| starts[i + 1] = starts[i] + sizes[i]);
    starts
}

/// What verify finds after a change in the chunk of (part, tier), with checksums made right.
fn found(part: usize, tier: usize, change: impl FnOnce(&mut [u8], [usize; 6])) -> Vec<String> {
    let mut file = golden();
    let starts = layout(&file, part, tier);
    change(file.get_mut(), starts);
    file.repair();
    inspect(&Container::open(file.get()).unwrap()).findings
}

fn assert_found(found: &[String], line: &str) {
    assert!(found.iter().any(|other| other.contains(line)), "no \"{line}\" in {found:#?}");
}

#[test]
fn a_triangle_out_of_range_is_found() {
    let lines =
        found(1, 0, |bytes, [triangles, ..]| bytes[triangles + 8 * 34..][..2].copy_from_slice(&[70, 0]));
    assert_eq!(lines, ["part 1 \"book\", tier 0: triangle 34 names vertex 70, but the tier has 9"]);
}

#[test]
fn a_collapse_upwards_is_found() {
    let lines = found(0, 0, |bytes, [_, _, _, ecol, ..]| bytes[ecol + 1] = 0xff);
    assert_found(&lines, "part 0 \"sheet\", tier 0: vertex 17 collapses onto");
    let lines = found(0, 2, |bytes, [_, _, _, ecol, ..]| bytes[ecol] = 1);
    assert_found(&lines, "locked vertex 0 collapses onto 1");
}

#[test]
fn wrong_counts_are_found() {
    let lines = found(0, 0, |bytes, [.., end]| bytes[end - 1] += 1);
    assert_found(&lines, "triangles, and its list has");
    let lines = found(0, 0, |bytes, [.., end]| bytes[end - 1] = 255);
    assert_found(&lines, "does not end a group");
    let lines = found(2, 0, |bytes, [.., end]| (bytes[end - 1], bytes[end - 2]) = (0, 1));
    assert_eq!(lines, Vec::<String>::new(), "below the coarsest state only the sum counts");
}

#[test]
fn a_wrong_overflow_list_is_found() {
    let lines = found(1, 0, |bytes, [_, _, overflow, ..]| bytes[overflow] = 7);
    assert_found(&lines, "overflow list does not name the vertices");
    let lines = found(1, 0, |bytes, [_, _, overflow, ..]| bytes[overflow + 5] = 0);
    assert_found(&lines, "overflow entry for only 4 triangles");
    let lines = found(1, 0, |bytes, [.., added, _]| bytes[added] = 254);
    assert_found(&lines, "overflow list does not name the vertices");
}

#[test]
fn a_wrong_coarsest_state_is_found() {
    let mut file = golden();
    let part = row(&file, 0, 0);
    file.set_u32(part + 68, 0);
    file.repair();
    let container = Container::open(file.get()).unwrap();
    assert_found(&inspect(&container).findings, "the coarsest state has");
    assert!(
        container.read_part(0).unwrap_err().to_string().contains("part 0, tier 2: the coarsest state has")
    );
}

#[test]
fn a_tier_that_is_no_prefix_is_found() {
    let lines = found(0, 1, |bytes, [triangles, ..]| bytes[triangles..triangles + 8].rotate_left(2));
    assert!(!lines.is_empty());
    let lines = found(0, 1, |bytes, [triangles, ..]| bytes.swap(triangles, triangles + 2));
    assert_found(&lines, "part 0 \"sheet\", tier 0: triangle 0 becomes");
}

#[test]
fn degenerate_triangles_are_found() {
    let lines =
        found(0, 0, |bytes, [triangles, ..]| bytes.copy_within(triangles..triangles + 2, triangles + 2));
    assert_found(&lines, "tier 0: triangle 0 is degenerate at");
}

#[test]
fn triangles_in_the_wrong_order_are_found() {
    let lines = found(0, 0, |bytes, [triangles, vertices, ..]| bytes[triangles..vertices].rotate_left(8));
    assert_found(&lines, "is not degenerate at");
}

#[test]
fn vertices_outside_the_box_are_found() {
    let lines = found(0, 0, |bytes, [_, vertices, ..]| bytes[vertices + 2] |= 0x1f);
    assert_found(&lines, "outside the part's box");
    let lines = found(0, 0, |bytes, [_, vertices, ..]| bytes[vertices + 7] |= 0x80);
    assert_found(&lines, "highest bit of the position");
}

#[test]
fn falling_errors_are_found() {
    let mut file = golden();
    let part = row(&file, 0, 1);
    file.get_mut()[part + 96 + 3] = 200;
    file.repair();
    let lines = inspect(&Container::open(file.get()).unwrap()).findings;
    assert_eq!(lines, ["part 1 \"book\": error sample 4 is 63, below sample 3, 200"]);
}

#[test]
fn no_more_than_a_hundred_findings_are_collected() {
    let mut parts = vec![stored(&sheet(3, 3, 1, 2), "sheet"); 300];
    for stored in &mut parts {
        stored.part.ecol.fill(u16::MAX);
    }
    let file = written(&contents_of(parts));
    let container = Container::open(file.get()).unwrap();
    let report = inspect(&container);
    assert_eq!(report.findings.len(), 100);
    assert_eq!(report, inspect(&container), "the same from any run");
    let message = collapsar::container::verify(&container).unwrap_err().to_string();
    assert!(
        message.starts_with("100 findings or more in this container, first: part 0 \"sheet\""),
        "{message}"
    );
}

/// Uses everything of a container that opens.
pub fn exercise(file: &Aligned) {
    let Ok(container) = Container::open(file.get()) else { return };
    let report = inspect(&container);
    for part in 0..container.parts().len() {
        container.part_name(part);
        if let Ok(whole) = container.read_part(part) {
            // What was read is sound: it can be reformed at its coarsest state, and its counts are those of its lists.
            for tier in &whole.tiers {
                let count = whole.triangles_at.count_at(tier.vertices as usize) as usize;
                assert_eq!(count, tier.triangles.len());
            }
            let finest = &whole.tiers[0].triangles;
            crate::parts::reformed(finest, &whole.ecol, &whole.triangles_at, whole.locked as usize);
        } else {
            assert!(!report.findings.is_empty());
        }
    }
}

/// A change of one number, at a place given as a fraction of a region of the file.
#[derive(Debug, Clone)]
struct Mutation {
    /// The header, the section table, the eight sections; every greater number is the payload.
    region: usize,
    at: f64,
    width: usize,
    value: u64,
}

fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let value = prop_oneof![
        any::<u64>(),
        0u64..40,
        prop::sample::select(vec![
            255,
            254,
            65_535,
            65_536,
            1 << 20,
            1 << 21,
            1 << 31,
            1 << 32,
            1 << 63,
            u64::MAX
        ]),
    ];
    let mutation = (0usize..20, 0.0..1.0, prop::sample::select(vec![1usize, 2, 4, 8]), value)
        .prop_map(|(region, at, width, value)| Mutation { region, at, width, value });
    prop::collection::vec(mutation, 1..6)
}

fn apply(file: &mut Aligned, mutation: &Mutation) {
    let payload = golden().u64(24) as usize;
    let whole = file.get().len();
    let range = match mutation.region {
        0 => 0..64,
        1 => 64..320,
        section @ 2..10 => golden().section(section - 2).unwrap(),
        _ => payload..whole,
    };
    let offset = range.start + (mutation.at * range.len() as f64) as usize / mutation.width * mutation.width;
    let end = (offset + mutation.width).min(whole);
    file.get_mut()[offset..end].copy_from_slice(&mutation.value.to_le_bytes()[..end - offset]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn damage_with_right_checksums_never_panics(mutations in mutations()) {
        let mut file = golden();
        for mutation in &mutations {
            apply(&mut file, mutation);
        }
        file.repair();
        exercise(&file);
    }

    #[test]
    fn any_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 256..600)) {
        let mut file = golden();
        let len = bytes.len().min(file.get().len());
        file.get_mut()[64..64 + len - 64].copy_from_slice(&bytes[64..len]);
        file.repair();
        exercise(&file);
    }
}

/// The naive parts of these tests are parts as the bake must make them.
#[test]
fn naive_parts_are_valid() {
    let part = ordered(&sheet(6, 6, 2, 11));
    assert!(part.tiers.len() > 2);
    assert!(part.triangles_at.bytes().contains(&255), "groups of wedges");
}
