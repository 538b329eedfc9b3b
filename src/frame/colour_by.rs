//! A question about instances in, a colour for each of them out.

use crate::geometry::Closure;
use crate::import::Colour;
use crate::passes::draw::Look;
use crate::scene::Scene;
use crate::stream::State;

/// What colours tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, clap::ValueEnum)]
pub enum ColourBy {
    /// The material, as the model says.
    #[default]
    Material,
    /// The part: each has a colour of its own.
    Part,
    /// The instance: each has a colour of its own.
    Instance,
    /// The tier that is drawn: green the finest, over yellow to red; grey where nothing is.
    Tier,
    /// The budget, as a share of the part's vertices: blue little, yellow all.
    Budget,
    /// What has arrived: green as much as is wished for, red less, grey nothing.
    Residency,
    /// How long ago the budget changed: yellow now, blue a while ago.
    Age,
    /// Whether the part's surface closes off a volume: green closed, orange closed and inside out, grey open.
    Closure,
}

impl ColourBy {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Material,
        Self::Part,
        Self::Instance,
        Self::Tier,
        Self::Budget,
        Self::Residency,
        Self::Age,
        Self::Closure,
    ];

    /// What people call it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Material => "material",
            Self::Part => "part",
            Self::Instance => "instance",
            Self::Tier => "tier",
            Self::Budget => "budget",
            Self::Residency => "residency",
            Self::Age => "age",
            Self::Closure => "closure",
        }
    }

    /// Whether the colours change from frame to frame.
    pub fn changes(self) -> bool {
        matches!(self, Self::Tier | Self::Budget | Self::Residency | Self::Age)
    }
}

/// What colours depend on.
#[derive(Debug, Clone, Copy)]
pub struct Coloured<'a> {
    /// The model.
    pub scene: &'a Scene,
    /// What is drawn of each instance.
    pub states: &'a [State],
    /// The vertices that each instance is wished to have.
    pub wishes: &'a [u32],
    /// Frames since each instance's budget changed; may be empty.
    pub ages: &'a [u32],
}

/// After so many frames a change is old.
pub const OLD_FRAMES: u32 = 60;

const GREY: Colour = [140, 140, 140, 255];
const GREEN: Colour = [70, 170, 80, 255];
const RED: Colour = [205, 60, 50, 255];
const ORANGE: Colour = [230, 140, 30, 255];

/// How an instance looks under a question; nothing special for [`ColourBy::Material`].
pub fn look_of(by: ColourBy, of: &Coloured<'_>, instance: u32) -> Look {
    let row = &of.scene.instances()[instance as usize];
    let part = &of.scene.parts()[row.part as usize];
    let state = of.states[instance as usize];
    let colour = match by {
        ColourBy::Material => return Look::default(),
        ColourBy::Part => distinct(part.source),
        ColourBy::Instance => distinct(of.scene.placement(instance).start),
        ColourBy::Tier if state.is_empty() => GREY,
        ColourBy::Tier => tier_colour(state.tier),
        ColourBy::Budget => ramp(f64::from(state.vertices) / f64::from(part.vertices.max(1))),
        ColourBy::Residency => match (state.is_empty(), of.wishes[instance as usize] > state.vertices) {
            (true, _) => GREY,
            (false, true) => RED,
            (false, false) => GREEN,
        },
        ColourBy::Age => {
            let age = of.ages.get(instance as usize).copied().unwrap_or(OLD_FRAMES).min(OLD_FRAMES);
            ramp(1.0 - f64::from(age) / f64::from(OLD_FRAMES))
        }
        ColourBy::Closure => match part.closure() {
            Closure::Open => GREY,
            Closure::Closed => GREEN,
            Closure::InsideOut => ORANGE,
        },
    };
    Look::coloured(colour)
}

/// Green, yellow, orange, red, purple, and purple for all that are coarser still.
fn tier_colour(tier: u32) -> Colour {
    const TIERS: [Colour; 5] = [GREEN, [215, 200, 60, 255], ORANGE, RED, [130, 60, 140, 255]];
    TIERS[(tier as usize).min(TIERS.len() - 1)]
}

/// From blue over green to yellow, evenly brighter (after *viridis*, Smith & van der Walt 2015).
pub fn ramp(share: f64) -> Colour {
    const STOPS: [[f64; 3]; 5] = [
        [68.0, 1.0, 84.0],
        [59.0, 82.0, 139.0],
        [33.0, 145.0, 140.0],
        [94.0, 201.0, 98.0],
        [253.0, 231.0, 37.0],
    ];
    let place = if share.is_finite() { share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64 } else { 0.0 };
    let from = (place as usize).min(STOPS.len() - 2);
    let between = place - from as f64;
    let channel = |i: usize| (STOPS[from][i] + (STOPS[from + 1][i] - STOPS[from][i]) * between) as u8;
    [channel(0), channel(1), channel(2), 255]
}

/// A colour of its own for each number: hues a golden section apart, in three brightnesses.
fn distinct(number: u32) -> Colour {
    let hue = (f64::from(number) * 0.618_033_988_749_895).fract() * 6.0;
    let value = [0.85, 0.7, 0.95][number as usize % 3];
    let saturation = [0.55, 0.7, 0.4][number as usize / 3 % 3];
    let channel = |offset: f64| {
        let k = (offset + hue) % 6.0;
        let share = 1.0 - saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * value * share) as u8
    };
    [channel(5.0), channel(3.0), channel(1.0), 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_run_from_end_to_end() {
        assert_eq!(ramp(0.0), [68, 1, 84, 255]);
        assert_eq!(ramp(1.0), [253, 231, 37, 255]);
        assert_eq!(ramp(f64::NAN), ramp(0.0));
        assert_eq!(ramp(2.0), ramp(1.0));
        let brightness = |c: Colour| u32::from(c[0]) + 2 * u32::from(c[1]) + u32::from(c[2]);
        assert!(
            (0..20)
                .all(|i| brightness(ramp(f64::from(i) / 20.0)) < brightness(ramp(f64::from(i + 1) / 20.0)))
        );
    }

    #[test]
    fn numbers_that_follow_each_other_have_different_colours() {
        let far = |a: Colour, b: Colour| (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap();
        for number in 0..200 {
            for next in number + 1..number + 4 {
                assert!(far(distinct(number), distinct(next)) > 20, "{number} {next}");
            }
        }
    }
}
