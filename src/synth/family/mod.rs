//! What a part is and how many triangles it shall have in, its mesh out: one file a family.
//!
//! Every family spends its triangles as a CAD system would (segments around, bends, holes, rivets) as far as they go, and
//! leaves the rest to [`Shape::finished`], so that the number is exact. Each has a least number; below it a plainer family
//! stands in, the last of which is a block of [`LEAST_TRIANGLES`].

mod block;
mod bracket;
mod fastener;
mod frame;
mod grating;
mod harness;
mod panel;
mod pipe;
mod profile;
mod seat;
mod valve;

use glam::DAffine3;

use super::random::Random;
use super::shape::Shape;
use super::surface::Surface;
use crate::import::SourceMesh;

/// The least triangles of a part.
pub const LEAST_TRIANGLES: u32 = 20;

/// A family of parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    /// A piece of skin with rows of rivets.
    Skin,
    /// A plate with stiffeners: bulkheads, ribs, floors.
    StiffPlate,
    /// A profile bent along a surface: frames, stringers, beams.
    Frame,
    /// A straight profile that stands upright.
    Column,
    /// An angle with holes and a fillet.
    Bracket,
    /// A thin bent sheet, open.
    Clip,
    /// A bolt with a hexagonal head and a thread.
    Fastener,
    /// A pipe with bends, hollow or solid.
    Pipe,
    /// A bundle of cables.
    Harness,
    /// A box with connectors.
    Equipment,
    /// A seat.
    Seat,
    /// A grid of bars.
    Grating,
    /// Two rails with rungs.
    Ladder,
    /// A turned body with bolts and a hand wheel.
    Valve,
}

/// All families.
pub const FAMILIES: [Family; 14] = [
    Family::Skin,
    Family::StiffPlate,
    Family::Frame,
    Family::Column,
    Family::Bracket,
    Family::Clip,
    Family::Fastener,
    Family::Pipe,
    Family::Harness,
    Family::Equipment,
    Family::Seat,
    Family::Grating,
    Family::Ladder,
    Family::Valve,
];

/// Where a part that follows a surface is.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    /// The surface.
    pub surface: Surface,
    /// The range of `u` that is its own.
    pub u: [f64; 2],
    /// The range of `v`.
    pub v: [f64; 2],
    /// How far inside, in metres.
    pub depth: f64,
    /// Part space to world space; z is the way out.
    pub world_from_part: DAffine3,
}

/// What is to be made.
#[derive(Debug, Clone)]
pub struct Task {
    /// Which family.
    pub family: Family,
    /// Its triangles; odd only for what [`Family::is_open`].
    pub target: u32,
    /// Its size in metres: of skins the thickness, of profiles and pipes the height of the section.
    pub size: f64,
    /// Where it is.
    pub site: Site,
    /// Its own random values.
    pub random: Random,
}

impl Family {
    /// Whether a part of it may be an open shell, of any number of triangles.
    pub fn may_be_open(self) -> bool {
        matches!(self, Self::Skin | Self::Clip)
    }

    /// Whether a part of so many triangles is an open shell: all clips, and skins of an odd number or of every other
    /// even one.
    pub fn is_open(self, target: u32) -> bool {
        match self {
            Self::Clip => true,
            Self::Skin => !target.is_multiple_of(4),
            _ => false,
        }
    }
}

/// Makes the mesh: exactly `task.target` triangles.
pub fn mesh(mut task: Task) -> SourceMesh {
    let shape = match task.family {
        Family::Skin => panel::skin(&task),
        Family::StiffPlate => panel::stiff_plate(&task),
        Family::Frame => frame::bent(&mut task),
        Family::Column => frame::column(&mut task),
        Family::Bracket => bracket::bracket(&mut task),
        Family::Clip => bracket::clip(&mut task),
        Family::Fastener => fastener::fastener(&mut task),
        Family::Pipe => pipe::pipe(&mut task),
        Family::Harness => harness::harness(&mut task),
        Family::Equipment => block::equipment(&mut task),
        Family::Seat => seat::seat(&mut task),
        Family::Grating => grating::grating(&mut task),
        Family::Ladder => grating::ladder(&mut task),
        Family::Valve => valve::valve(&mut task),
    };
    shape.finished(task.target)
}

/// An empty shape with room for a task.
fn empty(task: &Task) -> Shape {
    Shape::with_room(task.target)
}
