//! A freighter: 180 m long, 28 m across, 16 m from keel to deck, the superstructure aft; its stern at x 0.

use glam::DVec3;

use super::{BLUE, GREY, Kit, PALE, PRIMER, RED, RUST, STEEL, Section, Stand, WHITE, YELLOW, inside};
use crate::synth::family::Family;
use crate::synth::surface::{Form, Surface};

const HULL: Form = Form::Hull { length: 180.0, beam: 28.0, depth: 16.0 };

/// All sections.
pub fn sections() -> Vec<Section> {
    vec![
        hull(),
        deck("Double bottom", 2.0, [0.06, 0.9], 0.12, "DBM"),
        deck("Lower deck", 7.0, [0.04, 0.94], 0.14, "LDK"),
        deck("Tween deck", 11.5, [0.03, 0.96], 0.14, "TDK"),
        main_deck(),
        house(),
    ]
}

fn hull() -> Section {
    let plates = Surface::of(HULL);
    let mut kits = vec![
        Kit::new("Shell plating", "PLT", Family::Skin, plates)
            .stand(Stand::Piece, 2.2)
            .size(0.015, 0.03)
            .share(0.03)
            .least(80)
            .median(1600.0)
            .material(RUST),
        Kit::new("Bulkheads", "BHD", Family::StiffPlate, plates.within([0.03, 0.97], [0.0, 1.0]))
            .stand(Stand::Across { stations: 14 }, 1.0)
            .size(0.012, 0.02)
            .share(0.012)
            .least(14)
            .median(900.0)
            .material(PRIMER),
    ];
    let ribs = plates.within([0.05, 0.95], [0.04, 0.96]);
    kits.extend(inside(ribs, 0.3, 0.3, ["FRM", "LNG", "BAL", "WIR", "BRK", "CLP", "BLT", "PMP"]));
    Section { name: "Hull", kits }
}

/// A deck: plates, beams, ladders, pipe racks, machines.
fn deck(name: &'static str, height: f64, u: [f64; 2], weight: f64, code: &'static str) -> Section {
    let floor = Surface::of(HULL).within(u, [0.02, 0.98]).deck(height);
    let mut kits = vec![
        Kit::new("Plating", code, Family::StiffPlate, floor)
            .stand(Stand::Piece, 2.0)
            .size(0.01, 0.016)
            .share(0.06 * weight)
            .least(12)
            .median(700.0)
            .material(GREY),
        Kit::new("Ladders", "LAD", Family::Ladder, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.5, 0.7)
            .share(0.03 * weight)
            .least(4)
            .median(300.0)
            .repeats(1.0)
            .material(YELLOW),
        Kit::new("Pillars", "PIL", Family::Column, floor)
            .stand(Stand::Ordered, 1.0)
            .size(0.35, 0.4)
            .share(0.03 * weight)
            .least(12)
            .median(180.0)
            .repeats(1.0)
            .material(PRIMER),
        Kit::new("Machinery", "MCH", Family::Equipment, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.8, 3.0)
            .share(0.05 * weight)
            .least(8)
            .median(900.0)
            .repeats(0.5)
            .material(BLUE),
        Kit::new("Valves", "VLV", Family::Valve, floor)
            .stand(Stand::Upon, 1.0)
            .depth(-2.5, -0.2)
            .size(0.15, 0.6)
            .share(0.08 * weight)
            .median(500.0)
            .repeats(1.0)
            .material(RED),
    ];
    let above = floor.deck(height + 3.6);
    kits.extend(inside(above, 0.9 * weight, 0.22, ["BEA", "GIR", "PIP", "WIR", "BRK", "CLP", "BLT", "JBX"]));
    Section { name, kits }
}

/// The weather deck with hatches and containers.
fn main_deck() -> Section {
    let floor = Surface::of(HULL).within([0.005, 0.985], [0.0, 1.0]).deck(15.9);
    let cargo = Surface::of(HULL).within([0.24, 0.88], [0.06, 0.94]).deck(15.9);
    let stack = |tier: u32, code| {
        let level = 16.6 + 2.6 * f64::from(tier);
        Kit::new(
            "Cargo",
            code,
            Family::Equipment,
            cargo.within([0.24, 0.88 - 0.04 * f64::from(tier)], [0.06, 0.94]),
        )
        .stand(Stand::Ordered, 2.0)
        .depth(15.9 - level, 15.9 - level)
        .size(4.2, 4.6)
        .share(0.0012)
        .least(24)
        .most(220)
        .median(220.0)
        .repeats(1.0)
        .material([BLUE, RED, PALE][tier as usize % 3])
    };
    let kits = vec![
        Kit::new("Plating", "DCK", Family::StiffPlate, floor)
            .stand(Stand::Piece, 2.0)
            .size(0.012, 0.02)
            .share(0.008)
            .least(24)
            .median(700.0)
            .material(RED),
        stack(0, "CNA"),
        stack(1, "CNB"),
        stack(2, "CNC"),
        Kit::new("Deck piping", "PIP", Family::Pipe, floor)
            .stand(Stand::Run, 8.0)
            .depth(-0.7, -0.2)
            .size(0.08, 0.3)
            .share(0.02)
            .least(12)
            .median(500.0)
            .material(YELLOW),
        Kit::new("Deck fittings", "FIT", Family::Valve, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.3, 0.7)
            .share(0.02)
            .least(12)
            .median(400.0)
            .repeats(1.5)
            .material(STEEL),
    ];
    Section { name: "Main deck", kits }
}

/// The superstructure: walls and floors of six storeys.
fn house() -> Section {
    let (low, high) = (DVec3::new(12.0, 16.0, -11.0), DVec3::new(32.0, 34.0, 11.0));
    let size = high - low;
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let wall = |code, origin, along, across| {
        Kit::new("Walls", code, Family::Skin, Surface::plane(origin, along, across))
            .stand(Stand::Piece, 1.2)
            .size(0.008, 0.012)
            .share(0.002)
            .least(6)
            .median(900.0)
            .material(WHITE)
    };
    let windows = Surface::plane(DVec3::new(high.x, high.y - 2.4, low.z + 1.0), DVec3::Y * 1.2, z * 0.9);
    let mut kits = vec![
        wall("WLF", DVec3::new(high.x, low.y, low.z), y, z),
        wall("WLA", low, z, y),
        wall("WLP", low, y, x),
        wall("WLS", DVec3::new(low.x, low.y, high.z), x, y),
        wall("ROF", DVec3::new(low.x, high.y, low.z), z, x),
        Kit::new("Bridge", "WIN", Family::Equipment, windows)
            .stand(Stand::Ordered, 1.0)
            .size(1.0, 1.1)
            .share(0.0002)
            .least(10)
            .most(24)
            .median(120.0)
            .material(super::DARK),
    ];
    for storey in 0..6 {
        let level = low + DVec3::Y * (3.0 * f64::from(storey) + 0.05);
        let floor = Surface::plane(level, z, x);
        let names =
            [["FLR", "CAB"], ["FLS", "CAC"], ["FLT", "CAD"], ["FLU", "CAE"], ["FLV", "CAF"], ["FLW", "CAG"]];
        let [plate, cabin] = names[storey as usize];
        kits.extend(house_floor(floor, plate, cabin));
    }
    let ceiling = Surface::plane(low + DVec3::Y * 2.8, z, x);
    kits.extend(inside(ceiling, 0.06, 0.15, ["BEA", "GIR", "PIP", "WIR", "BRK", "CLP", "BLT", "JBX"]));
    Section { name: "Superstructure", kits }
}

fn house_floor(floor: Surface, plate: &'static str, cabin: &'static str) -> [Kit; 2] {
    [
        Kit::new("Floors", plate, Family::StiffPlate, floor)
            .stand(Stand::Piece, 1.5)
            .size(0.01, 0.02)
            .share(0.001)
            .least(2)
            .median(500.0)
            .material(GREY),
        Kit::new("Cabins", cabin, Family::Seat, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.5, 0.6)
            .share(0.002)
            .least(4)
            .most(200)
            .median(1800.0)
            .repeats(1.0)
            .material(super::FABRIC),
    ]
}
