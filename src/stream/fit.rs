//! What is wanted of all parts and the room that there is in, the finest tier of each that fits out: the most projected
//! error removed for each byte first (`benefit.rs`), so that where the room ends the error rises evenly over the view.
//!
//! Most of what is wanted is far from where the room ends, whichever side it is on, and need not be in order: bytes are
//! counted by urgency, coarsely, which tells the one class of urgencies that only some of fit. Only that one is sorted.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::benefit::urgencies;
use super::residency::Wanted;
use crate::scene::Scene;
use crate::scene::part::bytes_of;

/// Urgencies are classed by their sign, exponent and first seven bits, 0.8 % apart.
const CLASS_SHIFT: u32 = 16;
const CLASSES: usize = 1 << (32 - CLASS_SHIFT);

/// A tier of a wanted part, given by its number in the list.
#[derive(Debug, Clone, Copy)]
struct Offer {
    urgency: f32,
    tier: u32,
    number: u32,
}

/// Bytes of memory that a chunk takes.
pub(super) fn chunk_bytes(scene: &Scene, part: u32, tier: u32) -> u64 {
    let tiers = scene.tiers(part);
    let below = tiers.get(tier as usize + 1).map_or(0, |row| row.vertices);
    bytes_of(&tiers[tier as usize], below)
}

/// For each wanted part the finest tier that there is room for; the number of tiers for none.
pub(super) fn finest_that_fit(scene: &Scene, wanted: &[Wanted], room: u64) -> Vec<u32> {
    let (last, mut left) = last_class(&bytes_by_class(scene, wanted), room);
    let fits: Vec<(Vec<u32>, Vec<Offer>)> = shares(wanted)
        .map(|(first, wanted)| {
            let mut doubtful = Vec::new();
            let sure =
                (first..).zip(wanted).map(|(number, want)| surely(scene, number, want, last, &mut doubtful));
            (sure.collect(), doubtful)
        })
        .collect();
    let mut finest = Vec::with_capacity(wanted.len());
    let mut doubtful = Vec::new();
    for (mut sure, mut in_doubt) in fits {
        finest.append(&mut sure);
        doubtful.append(&mut in_doubt);
    }
    let by_urgency = |a: &Offer, b: &Offer| {
        b.urgency.total_cmp(&a.urgency).then(b.tier.cmp(&a.tier)).then(a.number.cmp(&b.number))
    };
    doubtful.par_sort_unstable_by(by_urgency);
    for offer in doubtful {
        let bytes = chunk_bytes(scene, wanted[offer.number as usize].part, offer.tier);
        let Some(rest) = left.checked_sub(bytes) else { break };
        left = rest;
        finest[offer.number as usize] = offer.tier;
    }
    finest
}

/// The finest tier of a class above `last`; adds those of that class to `doubtful`.
fn surely(scene: &Scene, number: usize, want: &Wanted, last: usize, doubtful: &mut Vec<Offer>) -> u32 {
    let mut finest = tier_count(scene, want.part);
    for offer in offers(scene, number, want) {
        match class_of(offer.urgency).cmp(&last) {
            Ordering::Greater => finest = offer.tier,
            Ordering::Equal => doubtful.push(offer),
            Ordering::Less => break,
        }
    }
    finest
}

/// The list in as many pieces as there are threads, each with the number of its first.
fn shares(wanted: &[Wanted]) -> impl IndexedParallelIterator<Item = (usize, &[Wanted])> {
    let each = wanted.len().div_ceil(rayon::current_num_threads()).max(1);
    wanted.par_chunks(each).enumerate().map(move |(share, wanted)| (share * each, wanted))
}

/// How many tiers a part has.
pub(super) fn tier_count(scene: &Scene, part: u32) -> u32 {
    scene.parts()[part as usize].tier_count
}

/// The tiers of a wanted part, coarsest first: none is more urgent than the one before.
fn offers(scene: &Scene, number: usize, want: &Wanted) -> impl Iterator<Item = Offer> {
    let urgencies = urgencies(scene, want.part, want.tier, want.weight);
    urgencies.map(move |(tier, urgency)| Offer { urgency, tier, number: number as u32 })
}

/// Urgencies are not negative, so that their bits are in their order.
fn class_of(urgency: f32) -> usize {
    (urgency.to_bits() >> CLASS_SHIFT) as usize
}

/// The bytes of all offers of each class.
fn bytes_by_class(scene: &Scene, wanted: &[Wanted]) -> Vec<u64> {
    let counts = shares(wanted).map(|(first, wanted)| {
        let mut counts = vec![0; CLASSES];
        for (number, want) in (first..).zip(wanted) {
            for offer in offers(scene, number, want) {
                counts[class_of(offer.urgency)] += chunk_bytes(scene, want.part, offer.tier);
            }
        }
        counts
    });
    let sum = |mut a: Vec<u64>, b: Vec<u64>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    };
    counts.reduce(|| vec![0; CLASSES], sum)
}

/// The most urgent class that does not fit whole, and the room that all classes above it leave.
fn last_class(bytes: &[u64], room: u64) -> (usize, u64) {
    let mut left = room;
    for (class, &bytes) in bytes.iter().enumerate().rev() {
        match left.checked_sub(bytes) {
            Some(rest) => left = rest,
            None => return (class, left),
        }
    }
    // Everything fits: what is in class 0, of no use at all, is looked at one by one.
    (0, left + bytes[0])
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;

    use proptest::prelude::*;

    use super::*;
    use crate::bake::{BakeOptions, BakeProgress, bake_source};
    use crate::synth::{Layout, Plan, SynthOptions, Synthetic};

    /// Parts of one tier and of several.
    fn scene() -> Scene {
        let layout = Layout::Airplane;
        let options = SynthOptions { triangles: 60_000, parts: Some(200), instances: None, seed: 1, layout };
        let plan = Plan::new(&options).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let container = folder.path().join("a.clps");
        let progress = BakeProgress::default();
        bake_source(&Synthetic::new(&plan), &container, &BakeOptions::default(), &progress).unwrap();
        Scene::open(&container).unwrap()
    }

    /// Everything in order, as far as it fits.
    fn by_sorting(scene: &Scene, wanted: &[Wanted], room: u64) -> Vec<u32> {
        let mut all: Vec<Offer> = (0..).zip(wanted).flat_map(|(n, want)| offers(scene, n, want)).collect();
        all.sort_by(|a, b| {
            b.urgency.total_cmp(&a.urgency).then(b.tier.cmp(&a.tier)).then(a.number.cmp(&b.number))
        });
        let mut finest: Vec<u32> = wanted.iter().map(|want| tier_count(scene, want.part)).collect();
        let mut left = room;
        for Offer { tier, number, .. } in all {
            let Some(rest) = left.checked_sub(chunk_bytes(scene, wanted[number as usize].part, tier)) else {
                break;
            };
            left = rest;
            finest[number as usize] = tier;
        }
        finest
    }

    proptest! {
        #[test]
        fn it_is_what_sorting_comes_to(
            weights in prop::collection::vec(prop_oneof![Just(0.0f32), Just(1.0), 0.0..1e9f32], 200),
            tiers in prop::collection::vec(0..4u32, 200),
            share in prop_oneof![Just(0.0), Just(1.0), 0.0..1.2f64],
        ) {
            static SCENE: OnceLock<Scene> = OnceLock::new();
            let scene = SCENE.get_or_init(scene);
            let parts = 0..scene.parts().len() as u32;
            let wanted: Vec<Wanted> = parts
                .zip(weights.iter().cycle().zip(tiers.iter().cycle()))
                .map(|(part, (&weight, &tier))| Wanted { part, tier: tier.min(tier_count(scene, part) - 1), weight })
                .collect();
            let all: u64 = (0..).zip(&wanted)
                .flat_map(|(n, want)| offers(scene, n, want))
                .map(|offer| chunk_bytes(scene, wanted[offer.number as usize].part, offer.tier))
                .sum();
            let room = (all as f64 * share) as u64;
            prop_assert_eq!(finest_that_fit(scene, &wanted, room), by_sorting(scene, &wanted, room));
        }
    }
}
