//! Options in, a [`Plan`] out: everything about a model but its meshes, and any of its meshes when asked for.
//!
//! In four steps, each a function below: the parts are dealt to the kits of the layout by their shares; the repeated
//! placements are dealt to the kits that repeat; each part draws its weight from its kit's log-normal distribution; and
//! one factor on all weights makes the sum of the triangles what was asked for.

use crate::import::{Instance, MAX_INSTANCES, SourceMesh};

use super::family::{self, Family, LEAST_TRIANGLES, Site, Task};
use super::layout::{Kit, Layout, materials};
use super::place::{self, Cells};
use super::random::Random;
use super::tree::{Bay, Outline, Tree};
use super::{MOST_TRIANGLES, SynthError};

/// The mean of the Boeing 777, for a number of parts that was left open.
const TRIANGLES_A_PART: u64 = 462;

/// Placements for a part, in tenths, where their number was left open.
const TENTHS_OF_INSTANCES: u64 = 13;

/// How far sizes within a kit spread: the deviation of the logarithm.
const SPREAD: f64 = 0.85;

/// A part of a skewed distribution is at most so many times its mean, unless that is below [`USUAL_MOST`].
const SKEW: u64 = 20;
const USUAL_MOST: u64 = 100_000;

/// What keeps the random streams of one seed apart.
const SIZES: u64 = 1;
const PARTS: u64 = 2;
const PLACES: u64 = 3;

/// What model to make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SynthOptions {
    /// Triangles of all parts together, each counted once however often it is placed.
    pub triangles: u64,
    /// Distinct parts; by default one for 462 triangles.
    pub parts: Option<u64>,
    /// Placements of parts; by default 1.3 a part.
    pub instances: Option<u64>,
    /// What varies between two models of one size.
    pub seed: u64,
    /// What it looks like.
    pub layout: Layout,
}

impl SynthOptions {
    /// Checked numbers of parts and placements.
    fn sizes(&self) -> Result<[u64; 2], SynthError> {
        let (triangles, largest) = (self.triangles, MAX_INSTANCES as u64);
        let least = triangles.div_ceil(MOST_TRIANGLES.into());
        if triangles < LEAST_TRIANGLES.into() {
            return Err(SynthError::TooFewTriangles { triangles });
        } else if least > largest {
            let most = largest * u64::from(MOST_TRIANGLES);
            return Err(SynthError::TooManyTriangles { triangles, most });
        }
        let usual = (triangles / TRIANGLES_A_PART).clamp(least.max(1), largest);
        let parts = self.parts.unwrap_or(usual);
        let most = (triangles / u64::from(LEAST_TRIANGLES)).min(largest);
        if parts == 0 {
            return Err(SynthError::NoParts);
        } else if parts > most {
            return Err(SynthError::TooManyParts { parts, triangles, most });
        } else if parts < least {
            return Err(SynthError::TooFewParts { parts, triangles, least });
        }
        let instances = self.instances.unwrap_or((parts * TENTHS_OF_INSTANCES / 10).min(largest));
        if instances < parts {
            Err(SynthError::TooFewInstances { instances, parts })
        } else if instances > largest {
            Err(SynthError::TooManyInstances { instances })
        } else {
            Ok([parts, instances])
        }
    }
}

/// A kit with its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedKit {
    /// The kit.
    pub kit: Kit,
    /// Its section, by number.
    pub section: u32,
    /// Its parts.
    pub parts: u32,
    /// Its placements.
    pub slots: u32,
    /// What they cover.
    pub cells: Cells,
}

/// A model that can be made mesh by mesh.
#[derive(Debug, Clone)]
pub struct Plan {
    seed: u64,
    layout: Layout,
    kits: Vec<PlannedKit>,
    tree: Tree,
    /// The triangles of every part.
    targets: Vec<u32>,
}

impl Plan {
    /// Decides everything that costs little; takes about four bytes a part.
    ///
    /// # Errors
    /// Sizes that no model has; the message says which have one.
    pub fn new(options: &SynthOptions) -> Result<Self, SynthError> {
        let [parts, instances] = options.sizes()?;
        let sections = options.layout.sections();
        let kits: Vec<(u32, Kit)> = sections
            .iter()
            .zip(0..)
            .flat_map(|(section, number)| section.kits.iter().map(move |kit| (number, kit.clone())))
            .collect();
        let counts = dealt_parts(&kits, parts);
        let extras = dealt_extras(&kits, &counts, instances - parts);
        let kits: Vec<PlannedKit> = kits
            .into_iter()
            .zip(counts.iter().zip(&extras))
            .map(|((section, kit), (&parts, &extra))| {
                let slots = parts + extra;
                PlannedKit { cells: Cells::new(&kit, slots), kit, section, parts, slots }
            })
            .collect();
        let names = sections.iter().map(|section| section.name).collect();
        let tree = Tree::new(options.layout.name(), names, &kits);
        let targets = targets(options, &kits, &tree, parts);
        Ok(Self { seed: options.seed, layout: options.layout, kits, tree, targets })
    }

    /// What the model looks like.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// How many parts there are.
    pub fn mesh_count(&self) -> u32 {
        self.targets.len() as u32
    }

    /// How many placements there are.
    pub fn instance_count(&self) -> u32 {
        self.tree.instance_count()
    }

    /// How many nodes the assembly tree has.
    pub fn node_count(&self) -> u32 {
        self.tree.node_count()
    }

    /// The triangles of a mesh, exactly.
    pub fn triangles(&self, mesh: u32) -> u64 {
        self.targets[mesh as usize].into()
    }

    /// The triangles of all meshes.
    pub fn triangle_count(&self) -> u64 {
        self.targets.iter().map(|&target| u64::from(target)).sum()
    }

    /// The triangles summed over all placements.
    pub fn triangles_placed(&self) -> u64 {
        let of_bay = |bay: &Bay| {
            (0..bay.slots).map(|slot| self.triangles(bay.first_mesh + bay.part_of(slot))).sum::<u64>()
        };
        self.tree.bays().iter().map(of_bay).sum()
    }

    /// What the plan itself takes in memory, in bytes.
    pub fn memory_bytes(&self) -> u64 {
        let tables = [
            std::mem::size_of_val(&self.targets[..]),
            std::mem::size_of_val(&self.kits[..]),
            std::mem::size_of_val(self.tree.bays()),
        ];
        tables.iter().sum::<usize>() as u64
    }

    /// The family of a mesh.
    pub fn family(&self, mesh: u32) -> Family {
        self.kits[self.tree.bay_of_mesh(mesh).kit as usize].kit.family
    }

    /// Whether the surface of a mesh is closed once it is welded.
    pub fn is_closed(&self, mesh: u32) -> bool {
        !self.family(mesh).is_open(self.targets[mesh as usize])
    }

    /// The name of a mesh.
    pub fn name(&self, mesh: u32) -> String {
        let code = self.kits[self.tree.bay_of_mesh(mesh).kit as usize].kit.code;
        format!("{code}-{mesh}")
    }

    /// The material of a mesh, wherever it is placed, as an index into those of the outline.
    pub fn material(&self, mesh: u32) -> u32 {
        self.kits[self.tree.bay_of_mesh(mesh).kit as usize].kit.material
    }

    /// Makes a mesh, the same one every time: exactly [`Self::triangles`], with unit normals, patch by patch.
    pub fn mesh(&self, mesh: u32) -> SourceMesh {
        let bay = self.tree.bay_of_mesh(mesh);
        let slot = bay.slot_of(mesh - bay.first_mesh);
        let mut random = Random::new(self.seed, PARTS, mesh.into());
        let kit = &self.kits[bay.kit as usize].kit;
        let task = Task {
            family: kit.family,
            target: self.targets[mesh as usize],
            size: random.between(kit.size[0], kit.size[1]),
            site: self.site(bay, slot),
            random,
        };
        SourceMesh { name: self.name(mesh), body: mesh, ..family::mesh(task) }
    }

    /// All placements one by one, in the order of the tree: for those who cannot hold 112 bytes for each.
    pub fn instances(&self) -> impl Iterator<Item = Instance> + '_ {
        self.tree.instances(&self.kits, |bay, slot| self.site(bay, slot).world_from_part)
    }

    /// The assembly tree, all placements and the materials: about 180 bytes a placement.
    pub fn outline(&self) -> Outline {
        let mut instances = Vec::with_capacity(self.instance_count() as usize);
        instances.extend(self.instances());
        Outline { instances, nodes: self.tree.nodes(&self.kits), materials: materials() }
    }

    /// Where a placement is.
    fn site(&self, bay: &Bay, slot: u32) -> Site {
        let planned = &self.kits[bay.kit as usize];
        let number = bay.first_slot + slot;
        let mut random = Random::new(self.seed, PLACES, u64::from(bay.kit) << 32 | u64::from(number));
        place::site(&planned.kit, planned.cells, number, &mut random)
    }
}

/// Deals parts to kits by their shares, within what each has at least and at most.
fn dealt_parts(kits: &[(u32, Kit)], parts: u64) -> Vec<u32> {
    // With few parts, half of them see to it that there is something of everything.
    let all_least: u64 = kits.iter().map(|(_, kit)| u64::from(kit.least)).sum();
    let scale = (parts as f64 / 2.0 / all_least as f64).min(1.0);
    let least = |kit: &Kit| (f64::from(kit.least) * scale) as u64;
    let count = |kit: &Kit, factor: f64| {
        ((kit.share * factor) as u64).clamp(least(kit), u64::from(kit.most).max(least(kit)))
    };
    let sum = |factor: f64| kits.iter().map(|(_, kit)| count(kit, factor)).sum::<u64>();
    let factor = greatest_factor(|factor| sum(factor) <= parts);
    let mut counts: Vec<u64> = kits.iter().map(|(_, kit)| count(kit, factor)).collect();
    let mut left = parts - counts.iter().sum::<u64>();
    // Some kits have no limit, so that this ends.
    while left > 0 {
        for ((_, kit), count) in
            kits.iter().zip(&mut counts).filter(|((_, kit), count)| **count < kit.most.into())
        {
            let more = left.min(1).min(u64::from(kit.most) - *count);
            *count += more;
            left -= more;
        }
    }
    counts.into_iter().map(|count| count as u32).collect()
}

/// Deals placements beyond one a part to the kits that repeat, or if there are none to all.
fn dealt_extras(kits: &[(u32, Kit)], counts: &[u32], extra: u64) -> Vec<u32> {
    let repeats: Vec<f64> =
        kits.iter().zip(counts).map(|((_, kit), &count)| kit.repeats * f64::from(count)).collect();
    let weights =
        if repeats.iter().sum::<f64>() > 0.0 { repeats } else { counts.iter().map(|&c| c.into()).collect() };
    let all: f64 = weights.iter().sum();
    let (mut before, mut dealt) = (0.0, 0);
    let shares = weights.iter().map(|weight| {
        before += weight;
        let until = ((before / all * extra as f64).round() as u64).min(extra);
        let share = until - dealt;
        dealt = until;
        share as u32
    });
    shares.collect()
}

/// The triangles of every part in the order of the meshes; their sum is what was asked for.
fn targets(options: &SynthOptions, kits: &[PlannedKit], tree: &Tree, parts: u64) -> Vec<u32> {
    let mut weights = Vec::with_capacity(parts as usize);
    for bay in tree.bays() {
        let Kit { median, stand, .. } = kits[bay.kit as usize].kit;
        // What bends along a surface and is too plain for it would cut through others.
        let least = if stand.follows_surface() { -1.2 } else { f64::NEG_INFINITY };
        weights.extend((0..bay.parts).map(|part| {
            let mut random = Random::new(options.seed, SIZES, (bay.first_mesh + part).into());
            (median * (SPREAD * random.normal().max(least)).exp()) as f32
        }));
    }
    // Even numbers only, as closed shells have them.
    let most = (SKEW * options.triangles / parts).clamp(USUAL_MOST, MOST_TRIANGLES.into()) as f64;
    let target = |weight: f32, factor: f64| {
        ((f64::from(weight) * factor).clamp(LEAST_TRIANGLES.into(), most) as u32) & !1
    };
    let sum = |factor: f64| weights.iter().map(|&weight| u64::from(target(weight, factor))).sum::<u64>();
    let factor = greatest_factor(|factor| sum(factor) <= options.triangles);
    let mut targets: Vec<u32> = weights.iter().map(|&weight| target(weight, factor)).collect();
    let mut left = options.triangles - targets.iter().map(|&target| u64::from(target)).sum::<u64>();
    while left >= 2 {
        for target in targets.iter_mut().filter(|target| f64::from(**target) + 2.0 <= most) {
            let more = left.min(2) as u32 & !1;
            *target += more;
            left -= u64::from(more);
        }
    }
    // The first part is of a family that may be open.
    targets[0] += left as u32;
    targets
}

/// The greatest factor from 0 to 1e12 that fits; what fits with a factor must fit with all lesser ones.
fn greatest_factor(fits: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1e12);
    if fits(high) {
        return high;
    }
    // First by magnitude, then by halves.
    while high > 1e-9 && !fits(high / 4.0) {
        high /= 4.0;
    }
    if high > 1e-9 {
        low = high / 4.0;
    }
    for _ in 0..45 {
        let middle = (low + high) / 2.0;
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}
