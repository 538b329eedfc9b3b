//! What a model is made of, as tables: sections, and in each the kits that cover its surfaces with parts.

mod airplane;
mod plant;
mod ship;

use super::family::Family;
use super::surface::Surface;
use crate::import::{Colour, Material};

/// What the model looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    /// An airliner of 64 m.
    #[default]
    Airplane,
    /// A freighter of 180 m.
    Ship,
    /// A chemical plant of 150 m by 60 m.
    Plant,
}

/// How placements of a kit lie on its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stand {
    /// Each has a rectangle of the surface.
    Piece,
    /// Each has a piece of the area across the form, at one of so many stations.
    Across {
        /// How many stations.
        stations: u32,
    },
    /// Along `v` at one `u`.
    Around,
    /// Along `u` at one `v`.
    Along,
    /// Bodies along `u`, anywhere in the cell.
    Run,
    /// Anywhere in the cell, standing away from the inside.
    Inside,
    /// Anywhere in the cell, standing on the outside.
    Upon,
    /// In the middle of the cell, standing on the outside, all alike.
    Ordered,
}

impl Stand {
    /// Whether parts have the form of the surface.
    pub fn follows_surface(self) -> bool {
        matches!(self, Self::Piece | Self::Across { .. } | Self::Around | Self::Along)
    }
}

/// Parts of one family on one surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Kit {
    /// The system that they belong to.
    pub system: &'static str,
    /// How their names start.
    pub code: &'static str,
    /// What they are.
    pub family: Family,
    /// Where.
    pub surface: Surface,
    /// How.
    pub stand: Stand,
    /// Length over width of a cell.
    pub elongation: f64,
    /// How far inside the surface, in metres.
    pub depth: [f64; 2],
    /// The longest that a run may be, in metres: it is straight, and its surface may not be.
    pub longest: f64,
    /// Their turn about the way out, where all are alike, in radians.
    pub turn: f64,
    /// Their size, in metres.
    pub size: [f64; 2],
    /// Their share of all parts; shares are relative to each other.
    pub share: f64,
    /// At least so many, if there are parts enough.
    pub least: u32,
    /// At most so many.
    pub most: u32,
    /// The median of their triangles, relative to that of other kits.
    pub median: f64,
    /// Their share of repeated placements relative to their parts.
    pub repeats: f64,
    /// Index into [`materials`].
    pub material: u32,
}

/// A section of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// What it is made of.
    pub kits: Vec<Kit>,
}

impl Layout {
    /// The name, as the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Airplane => "airplane",
            Self::Ship => "ship",
            Self::Plant => "plant",
        }
    }

    /// The sections; the first kit of the first one is of a family that may be open.
    pub fn sections(self) -> Vec<Section> {
        match self {
            Self::Airplane => airplane::sections(),
            Self::Ship => ship::sections(),
            Self::Plant => plant::sections(),
        }
    }
}

impl Kit {
    fn new(system: &'static str, code: &'static str, family: Family, surface: Surface) -> Self {
        Self {
            system,
            code,
            family,
            surface,
            stand: Stand::Inside,
            elongation: 1.0,
            depth: [0.0; 2],
            longest: f64::INFINITY,
            turn: 0.0,
            size: [0.1; 2],
            share: 1.0,
            least: 0,
            most: u32::MAX,
            median: 200.0,
            repeats: 0.0,
            material: GREY,
        }
    }

    fn stand(self, stand: Stand, elongation: f64) -> Self {
        Self { stand, elongation, ..self }
    }

    fn depth(self, low: f64, high: f64) -> Self {
        Self { depth: [low, high], ..self }
    }

    fn size(self, low: f64, high: f64) -> Self {
        Self { size: [low, high], ..self }
    }

    fn longest(self, longest: f64) -> Self {
        Self { longest, ..self }
    }

    fn turn(self, turn: f64) -> Self {
        Self { turn, ..self }
    }

    fn share(self, share: f64) -> Self {
        Self { share, ..self }
    }

    fn least(self, least: u32) -> Self {
        Self { least, ..self }
    }

    fn most(self, most: u32) -> Self {
        Self { most, ..self }
    }

    fn median(self, median: f64) -> Self {
        Self { median, ..self }
    }

    fn repeats(self, repeats: f64) -> Self {
        Self { repeats, ..self }
    }

    fn material(self, material: u32) -> Self {
        Self { material, ..self }
    }
}

const GREY: u32 = 0;
const WHITE: u32 = 1;
const PRIMER: u32 = 2;
const STEEL: u32 = 3;
const DARK: u32 = 4;
const COPPER: u32 = 5;
const BLUE: u32 = 6;
const RED: u32 = 7;
const YELLOW: u32 = 8;
const CABLE: u32 = 9;
const FABRIC: u32 = 10;
const RUST: u32 = 11;
const PALE: u32 = 12;

/// The materials that kits name by number.
pub fn materials() -> Vec<Material> {
    let table: [(&str, Colour); 13] = [
        ("", Material::default().base_colour),
        ("paint white", [232, 234, 236, 255]),
        ("zinc primer", [151, 163, 92, 255]),
        ("steel", [150, 156, 164, 255]),
        ("dark glass", [38, 44, 54, 255]),
        ("copper", [196, 122, 74, 255]),
        ("paint blue", [46, 88, 150, 255]),
        ("paint red", [170, 52, 44, 255]),
        ("paint yellow", [226, 182, 52, 255]),
        ("cable jacket", [206, 112, 40, 255]),
        ("fabric", [58, 76, 118, 255]),
        ("hull red", [122, 48, 42, 255]),
        ("insulation", [206, 204, 190, 255]),
    ];
    table.map(|(name, base_colour)| Material { name: name.to_owned(), base_colour }).into()
}

/// What every skin has on its inside: frames, stringers, pipes, cables, brackets, clips, fasteners, equipment.
/// `weight` is the share of the parts of all of it, `scale` the size of its profiles in metres.
fn inside(surface: Surface, weight: f64, scale: f64, prefix: [&'static str; 8]) -> Vec<Kit> {
    let kit = |system, number: usize, family| Kit::new(system, prefix[number], family, surface);
    vec![
        kit("Frames", 0, Family::Frame)
            .stand(Stand::Around, 0.2)
            .depth(0.3 * scale, 0.3 * scale)
            .size(scale, scale)
            .share(0.045 * weight)
            .least(12)
            .median(420.0)
            .material(PRIMER),
        kit("Stringers", 1, Family::Frame)
            .stand(Stand::Along, 12.0)
            .depth(0.25 * scale, 0.25 * scale)
            .size(0.3 * scale, 0.35 * scale)
            .share(0.06 * weight)
            .least(8)
            .median(150.0)
            .material(PRIMER),
        kit("Piping", 2, Family::Pipe)
            .stand(Stand::Run, 10.0)
            .longest(30.0 * scale)
            .depth(1.5 * scale, 4.5 * scale)
            .size(0.08 * scale, 0.5 * scale)
            .share(0.12 * weight)
            .least(6)
            .median(400.0)
            .material(STEEL),
        kit("Electrical", 3, Family::Harness)
            .stand(Stand::Run, 10.0)
            .longest(30.0 * scale)
            .depth(1.3 * scale, 4.0 * scale)
            .size(0.15 * scale, 0.4 * scale)
            .share(0.07 * weight)
            .least(4)
            .median(800.0)
            .material(CABLE),
        kit("Brackets", 4, Family::Bracket)
            .depth(0.01, 1.2 * scale)
            .size(0.2 * scale, 0.8 * scale)
            .share(0.22 * weight)
            .median(150.0)
            .repeats(1.0)
            .material(YELLOW),
        kit("Clips", 5, Family::Clip)
            .depth(0.02, 1.0 * scale)
            .size(0.15 * scale, 0.4 * scale)
            .share(0.10 * weight)
            .median(70.0)
            .repeats(1.5)
            .material(PRIMER),
        kit("Fasteners", 6, Family::Fastener)
            .stand(Stand::Upon, 1.0)
            .depth(0.08 * scale, 0.6 * scale)
            .size(0.06 * scale, 0.2 * scale)
            .share(0.28 * weight)
            .median(95.0)
            .repeats(3.0)
            .material(STEEL),
        kit("Equipment", 7, Family::Equipment)
            .depth(0.6 * scale, 3.0 * scale)
            .size(0.8 * scale, 2.5 * scale)
            .share(0.04 * weight)
            .median(600.0)
            .repeats(0.3)
            .material(DARK),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_usable() {
        for layout in [Layout::Airplane, Layout::Ship, Layout::Plant] {
            let sections = layout.sections();
            assert!(sections[0].kits[0].family.may_be_open() && sections[0].kits[0].least > 0);
            for kit in sections.iter().flat_map(|section| &section.kits) {
                assert!(kit.share > 0.0 && kit.median > 0.0 && kit.elongation > 0.0, "{kit:?}");
                assert!((kit.material as usize) < materials().len(), "{kit:?}");
                assert!(kit.surface.extent().iter().all(|&length| length > 0.05), "{kit:?}");
                assert!(kit.least <= kit.most && kit.size[0] <= kit.size[1] && kit.size[0] > 0.0, "{kit:?}");
            }
        }
    }
}
