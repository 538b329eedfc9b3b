//! The container: what is written comes back, and nothing that was damaged does.

#![expect(clippy::unwrap_used, clippy::expect_used, reason = "a test's helpers panic to fail it")]

mod bytes;
mod damage;
mod forms;
mod golden;
mod output;
mod parts;
mod stranger;

use bytes::{Aligned, written, written_as};
use collapsar::container::{Chunk, Container, Contents, Form, StoredInstance, StoredPart, verify};
use collapsar::import::{Material, Node};
use parts::{book, contents_of, golden_contents, sheet, stored};
use proptest::prelude::*;

/// Reads everything that a container holds.
fn read_all(container: &Container) -> Contents {
    let parts = container.parts().iter().enumerate().map(|(index, row)| StoredPart {
        part: container.read_part(index).unwrap(),
        name: container.part_name(index).to_owned(),
        source: row.source,
        cell: row.is_cell(),
    });
    let instances = container.instances().iter().map(|row| StoredInstance {
        part: row.part,
        node: row.node,
        material: row.material,
        world_from_part: row.transform(),
    });
    let nodes = container.nodes().iter().enumerate().map(|(index, row)| Node {
        name: container.node_name(index).to_owned(),
        parent: (row.parent != u32::MAX).then_some(row.parent),
    });
    let materials = container.materials().iter().enumerate().map(|(index, row)| Material {
        name: container.material_name(index).to_owned(),
        base_colour: row.base_colour,
    });
    Contents {
        parts: parts.collect(),
        instances: instances.collect(),
        nodes: nodes.collect(),
        materials: materials.collect(),
    }
}

fn assert_round_trip(contents: &Contents) {
    assert_round_trip_as(contents, Form::Plain);
}

fn assert_round_trip_as(contents: &Contents, form: Form) {
    let file = written_as(contents, form);
    let container = Container::open(file.get()).unwrap();
    assert_eq!(&read_all(&container), contents);
    let report = verify(&container).unwrap();
    assert_eq!(report.parts, contents.parts.len());
}

#[test]
fn what_is_written_comes_back() {
    let contents = golden_contents();
    assert!(contents.parts[0].part.tiers.len() > 2, "the sheet has tiers");
    assert!(!contents.parts[1].part.triangles_at.overflow().is_empty(), "the book overflows");
    assert_round_trip(&contents);
    assert_round_trip(&contents_of(vec![]));
    assert_round_trip(&Contents::default());
}

#[test]
fn a_part_of_the_most_vertices_comes_back() {
    assert_round_trip(&contents_of(vec![stored(&wide(), "wide"), stored(&book(), "book")]));
}

/// 65,536 vertices, in one fan that collapses vertex by vertex onto the hub.
fn wide() -> parts::Mesh {
    let count = 65_536;
    let positions = (0..count as u32).map(|i| [i, i / 7, i % 7]).collect();
    // Pairs, so that the naive simplification needs no more than a few triangles.
    let triangles = (1..200).map(|i| [(0, 0), (i, 0), (count - i, 0)]).collect();
    parts::Mesh { positions, wedges: vec![1; count], triangles, locked: 1, tier_ratio: 4 }
}

#[test]
fn the_same_contents_give_the_same_bytes() {
    assert_eq!(written(&golden_contents()).get(), written(&golden_contents()).get());
}

#[test]
fn coarse_tiers_of_all_parts_come_first() {
    let file = written(&golden_contents());
    let container = Container::open(file.get()).unwrap();
    let coarsest = (0..3).map(|part| {
        let tiers = container.chunk_rows(part).len();
        container.chunk_range(part, tiers - 1).unwrap()
    });
    let mut next = container.header().payload_offset;
    for range in coarsest {
        assert_eq!(range.start, next);
        next = range.end.next_multiple_of(16);
    }
}

#[test]
fn tables_can_be_read_without_the_payload() {
    let file = written(&golden_contents());
    let payload = file.u64(24) as usize;
    let tables = Aligned::new(&file.get()[..payload]);
    let container = Container::open_tables(tables.get(), file.get().len() as u64).unwrap();
    assert_eq!(container.part_name(2), "ø triangle");
    assert!(container.chunks(0, 0).unwrap_err().to_string().contains("cut short"));
    let spec = container.chunk_spec(0, 0).unwrap();
    let range = spec.range();
    let read = |bytes: &mut [u8]| {
        bytes.copy_from_slice(&file.get()[range.start as usize..range.end as usize]);
        Ok(())
    };
    let chunk = Chunk::read(spec, &[], read).unwrap();
    assert_eq!(chunk.view().triangles, golden_contents().parts[0].part.tiers[0].triangles);
}

#[test]
fn chunks_and_parts_that_do_not_exist_are_errors() {
    let file = written(&golden_contents());
    let container = Container::open(file.get()).unwrap();
    for (part, tier) in [(3, 0), (2, 1), (usize::MAX, usize::MAX)] {
        assert!(container.chunks(part, tier).unwrap_err().to_string().starts_with("there is no part"));
    }
    assert!(container.read_part(3).is_err());
    assert_eq!([container.part_name(3), container.node_name(9), container.material_name(9)], [""; 3]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn sheets_of_any_size_come_back(
        nx in 2usize..9, ny in 2usize..9, locked in 1usize..5, seed in 1usize..200, ratio in 2usize..5,
        name in "\\PC{0,12}",
    ) {
        let mut mesh = sheet(nx, ny, locked.min(nx * ny), seed);
        mesh.tier_ratio = ratio;
        assert_round_trip(&contents_of(vec![stored(&mesh, &name), stored(&sheet(ny, nx, 1, seed), &name)]));
    }
}
