use super::*;
use crate::container::Form;
use crate::geometry::OrderedPart;
use crate::geometry::body::{OrderOptions, order_body};
use crate::synth::{Layout, Plan, SynthOptions};
use proptest::prelude::*;
use std::sync::LazyLock;

/// A part of some tiers, with creases.
static PART: LazyLock<OrderedPart> = LazyLock::new(|| {
    let options = SynthOptions {
        triangles: 40_000,
        parts: Some(20),
        instances: None,
        seed: 3,
        layout: Layout::Airplane,
    };
    let plan = Plan::new(&options).unwrap();
    let mesh = (0..20).find(|&mesh| (1000..4000).contains(&plan.triangles(mesh))).unwrap();
    let progress = crate::bake::BakeProgress::default();
    let outcome = order_body(vec![plan.mesh(mesh)], OrderOptions::default(), &progress);
    let [part] = outcome.cells.try_into().unwrap();
    part
});

struct Case<'a> {
    spec: ChunkSpec,
    view: ChunkView<'a>,
    coarser: &'a [TriangleRecord],
}

fn case(tier: usize) -> Case<'static> {
    let part: &'static OrderedPart = &PART;
    let below = part.tiers.get(tier + 1).map_or(0, |coarser| coarser.vertices);
    let added = below as usize..part.tiers[tier].vertices as usize;
    let coarser = part.tiers.get(tier + 1).map_or(&[][..], |coarser| &coarser.triangles);
    assert!(part.triangles_at.overflow().is_empty());
    let view = ChunkView {
        triangles: &part.tiers[tier].triangles,
        vertices: &part.vertices[added.clone()],
        overflow: &[],
        ecol: &part.ecol[added.clone()],
        added: &part.triangles_at.bytes()[added],
    };
    let mut out = Vec::new();
    let row = super::super::encode::encode_chunk(part, tier, Form::Compressed, &mut out);
    assert_eq!(row.form(), Some(Form::Compressed));
    let spec = ChunkSpec {
        part: 0,
        tier: tier as u32,
        row,
        vertices_below: below,
        triangles_below: coarser.len() as u32,
        locked: part.locked,
        coarsest_triangles: part.coarsest_triangles(),
        attributes: part.attributes,
    };
    Case { spec, view, coarser }
}

impl Case<'_> {
    fn streams(&self) -> Vec<u8> {
        streams_of(&self.spec, &self.view, self.coarser, &PART.vertices).unwrap()
    }

    fn decoded(&self, streams: &[u8]) -> Result<Lists, Contradiction> {
        let below = PART.vertices[..self.spec.vertices_below as usize].to_vec();
        decompress(&self.spec, &pack(streams).unwrap(), self.coarser, below)
    }
}

#[test]
fn every_tier_comes_back() {
    assert!(PART.tiers.len() > 2, "{}", PART.tiers.len());
    for case in (0..PART.tiers.len()).map(case) {
        let lists = case.decoded(&case.streams()).unwrap();
        assert_eq!(lists.triangles, case.view.triangles);
        assert_eq!(lists.vertices, PART.vertices[..case.spec.row.vertices as usize]);
        assert_eq!((&lists.ecol[..], &lists.added[..]), (case.view.ecol, case.view.added));
    }
}

/// New triangles follow from the splits: otherwise this costs more than the plain lists.
#[test]
fn few_triangles_are_explicit() {
    let case = case(0);
    let (a, t) = (case.spec.added_vertices() as usize, case.spec.triangles_below as usize);
    let born = &case.streams()[3 * a..3 * a + case.view.triangles.len() - t];
    let explicit = born.iter().filter(|&&code| code == EXPLICIT).count();
    let first = born.iter().filter(|&&code| code == 0).count();
    assert!(
        explicit * 50 < born.len() && first * 10 > born.len() * 9,
        "{explicit} {first} of {}",
        born.len()
    );
}

/// A frame that unpacks to more than the counts allow takes no more memory than they do.
#[test]
fn a_frame_that_is_too_long_is_refused() {
    let case = case(0);
    let bomb = vec![0; most_stream_bytes(&case.spec) + 1];
    assert_eq!(
        case.decoded(&bomb).err(),
        Some(Contradiction("it is no zstd frame of the length that its counts allow"))
    );
    assert!(case.decoded(&bomb[1..]).is_err());
}

#[test]
fn every_prefix_of_the_streams_and_of_the_frame_is_refused() {
    let case = case(1);
    let streams = case.streams();
    for end in 0..streams.len() {
        assert!(case.decoded(&streams[..end]).is_err(), "{end} of {}", streams.len());
    }
    let frame = pack(&streams).unwrap();
    for end in 0..frame.len() {
        let below = PART.vertices[..case.spec.vertices_below as usize].to_vec();
        assert!(decompress(&case.spec, &frame[..end], case.coarser, below).is_err());
    }
}

#[test]
fn coarser_tiers_that_do_not_fit_are_refused() {
    let case = case(0);
    let frame = pack(&case.streams()).unwrap();
    let below = PART.vertices[..case.spec.vertices_below as usize].to_vec();
    let refused = |coarser: &[TriangleRecord], below: &[VertexRecord]| {
        decompress(&case.spec, &frame, coarser, below.to_vec()).is_err()
    };
    let mut reaching = case.coarser.to_vec();
    reaching[3].vertices[1] = case.spec.vertices_below as u16;
    assert!(!refused(case.coarser, &below));
    assert!(refused(&case.coarser[1..], &below) && refused(case.coarser, &below[1..]) && refused(&[], &[]));
    assert!(refused(&reaching, &below));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Whatever the streams say, what comes back has the lengths that the row states, or an error does.
    #[test]
    fn damaged_streams_never_panic(
        tier in 0usize..3,
        changes in prop::collection::vec((0.0..1.0, any::<u8>()), 1..8),
    ) {
        let case = case(tier);
        let mut streams = case.streams();
        for (at, value) in changes {
            let place = (at * streams.len() as f64) as usize;
            streams[place] = value;
        }
        if let Ok(lists) = case.decoded(&streams) {
            prop_assert_eq!(lists.triangles.len(), case.view.triangles.len());
            prop_assert_eq!(lists.vertices.len(), case.spec.row.vertices as usize);
            prop_assert_eq!(lists.ecol.len(), case.view.ecol.len());
            let reaches = |t: &TriangleRecord| t.vertices.iter().all(|&v| u32::from(v) < case.spec.row.vertices);
            prop_assert!(lists.triangles.iter().all(reaches));
        }
    }
}
