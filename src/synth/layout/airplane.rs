//! An airliner: 64 m long, 6.2 m across, 61 m between its wing tips; its nose at x 0, its axis along x.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::{BLUE, DARK, FABRIC, GREY, Kit, PALE, PRIMER, STEEL, Section, Stand, WHITE, inside};
use crate::synth::family::Family;
use crate::synth::surface::{Form, Surface};

/// All sections.
pub fn sections() -> Vec<Section> {
    vec![
        fuselage(),
        wing("Left wing", DVec3::new(20.5, -1.7, -2.2), DVec3::new(17.5, 3.4, -28.3), [12.5, 2.6], 0.12),
        wing("Right wing", DVec3::new(20.5, -1.7, 2.2), DVec3::new(17.5, 3.4, 28.3), [12.5, 2.6], 0.12),
        wing("Left tailplane", DVec3::new(54.5, 1.3, -0.9), DVec3::new(5.8, 0.9, -9.8), [6.2, 2.2], 0.035),
        wing("Right tailplane", DVec3::new(54.5, 1.3, 0.9), DVec3::new(5.8, 0.9, 9.8), [6.2, 2.2], 0.035),
        wing("Fin", DVec3::new(51.0, 2.4, 0.0), DVec3::new(8.0, 10.2, 0.0), [8.2, 3.0], 0.05),
        engine("Left engine", -9.6),
        engine("Right engine", 9.6),
    ]
}

fn fuselage() -> Section {
    let body = Surface::of(Form::Fuselage {
        origin: DVec3::ZERO,
        length: 64.0,
        radius: 3.1,
        taper: [0.13, 0.32],
        rise: 1.9,
    });
    let cabin = body.within([0.08, 0.86], [0.0, 1.0]);
    let skin = Kit::new("Skin", "SKN", Family::Skin, body)
        .stand(Stand::Piece, 1.6)
        .size(0.003, 0.006)
        .share(0.02)
        .least(40)
        .median(2400.0)
        .material(WHITE);
    let mut kits = vec![skin];
    kits.extend(inside(cabin, 0.5, 0.11, ["FRM", "STR", "HYD", "WIR", "BRK", "CLP", "BLT", "LRU"]));
    kits.extend(cabin_kits(cabin));
    kits.extend(below_the_floor(cabin));
    Section { name: "Fuselage", kits }
}

/// Floor, seats, bins and windows.
fn cabin_kits(cabin: Surface) -> Vec<Kit> {
    const FLOOR: f64 = -0.75;
    let floor = cabin.within([0.1, 0.8], [0.03, 0.97]).deck(FLOOR);
    let seats = cabin.within([0.13, 0.76], [0.1, 0.9]).deck(FLOOR);
    let beams = floor.deck(FLOOR - 0.03);
    let windows = |v: [f64; 2], name| {
        Kit::new("Windows", name, Family::Equipment, cabin.within([0.1, 0.76], v))
            .stand(Stand::Ordered, 1.0)
            .depth(-0.02, -0.02)
            .size(0.34, 0.34)
            .share(0.0005)
            .least(24)
            .most(90)
            .median(120.0)
            .repeats(4.0)
            .material(DARK)
    };
    let bins = |v: [f64; 2], name| {
        Kit::new("Cabin", name, Family::Equipment, cabin.within([0.14, 0.76], v))
            .stand(Stand::Ordered, 1.0)
            .depth(0.75, 0.75)
            .size(0.7, 0.8)
            .share(0.0015)
            .least(10)
            .most(120)
            .median(500.0)
            .material(PALE)
    };
    vec![
        Kit::new("Cabin", "FLR", Family::StiffPlate, floor)
            .stand(Stand::Piece, 1.5)
            .size(0.012, 0.02)
            .share(0.008)
            .least(10)
            .median(500.0)
            .material(GREY),
        Kit::new("Floor beams", "BEA", Family::Frame, beams)
            .stand(Stand::Around, 0.2)
            .size(0.14, 0.2)
            .share(0.008)
            .least(10)
            .median(220.0)
            .material(PRIMER),
        Kit::new("Seats", "SEA", Family::Seat, seats)
            .stand(Stand::Ordered, 1.3)
            .size(0.5, 0.52)
            .turn(2.0 * FRAC_PI_2)
            .share(0.004)
            .least(60)
            .most(330)
            .median(2600.0)
            .repeats(1.0)
            .material(FABRIC),
        windows([0.205, 0.215], "WDP"),
        windows([0.785, 0.795], "WDS"),
        bins([0.15, 0.17], "BIP"),
        bins([0.83, 0.85], "BIS"),
    ]
}

/// Cargo floor, containers, and ribs of the pressure bulkheads.
fn below_the_floor(cabin: Surface) -> Vec<Kit> {
    let hold = cabin.within([0.14, 0.78], [0.12, 0.88]).deck(-2.3);
    vec![
        Kit::new("Cargo", "CFL", Family::StiffPlate, hold)
            .stand(Stand::Piece, 1.5)
            .size(0.01, 0.015)
            .share(0.004)
            .least(6)
            .median(400.0)
            .material(STEEL),
        Kit::new("Cargo", "ULD", Family::Equipment, hold)
            .stand(Stand::Ordered, 1.0)
            .size(1.3, 1.5)
            .share(0.001)
            .least(8)
            .most(40)
            .median(700.0)
            .repeats(0.5)
            .material(BLUE),
        Kit::new("Bulkheads", "BHD", Family::StiffPlate, cabin)
            .stand(Stand::Across { stations: 3 }, 1.0)
            .size(0.01, 0.02)
            .share(0.0006)
            .least(3)
            .most(60)
            .median(1500.0)
            .material(PRIMER),
    ]
}

/// A wing, a tailplane or the fin: skins, spars, ribs, and what is inside.
fn wing(name: &'static str, origin: DVec3, span: DVec3, chords: [f64; 2], weight: f64) -> Section {
    let surface = Surface::of(Form::Wing { origin, span, chords, thickness: 0.11 });
    // The trailing edge is too thin to hold anything.
    let box_top = surface.within([0.02, 0.95], [0.16, 0.46]);
    let skin = Kit::new("Skin", "SKN", Family::Skin, surface)
        .stand(Stand::Piece, 1.8)
        .size(0.004, 0.01)
        .share(0.035 * weight)
        .least((20.0 + 80.0 * weight) as u32)
        .median(2400.0)
        .material(if name == "Fin" { BLUE } else { WHITE });
    let ribs = Kit::new("Ribs", "RIB", Family::StiffPlate, surface)
        .stand(Stand::Across { stations: 24 }, 1.0)
        .size(0.008, 0.014)
        .share(0.02 * weight)
        .least(6)
        .median(700.0)
        .material(PRIMER);
    let mut kits = vec![skin, ribs];
    kits.extend(inside(
        box_top,
        0.9 * weight,
        0.07,
        ["SPR", "STR", "FUE", "WIR", "BRK", "CLP", "BLT", "ACT"],
    ));
    Section { name, kits }
}

fn engine(name: &'static str, z: f64) -> Section {
    let nacelle = |radius: f64, length: f64, x: f64| {
        Surface::of(Form::Fuselage {
            origin: DVec3::new(x, -2.9, z),
            length,
            radius,
            taper: [0.25, 0.6],
            rise: 0.0,
        })
    };
    let (cowl, core) = (nacelle(1.6, 6.2, 20.8).within([0.1, 0.9], [0.0, 1.0]), nacelle(0.95, 7.4, 20.6));
    let cowling = Kit::new("Cowling", "COW", Family::Skin, cowl)
        .stand(Stand::Piece, 1.2)
        .size(0.004, 0.008)
        .share(0.0008)
        .least(12)
        .median(2000.0)
        .material(WHITE);
    let turbine = Kit::new("Turbine", "TRB", Family::Valve, core.within([0.15, 0.75], [0.0, 1.0]))
        .stand(Stand::Upon, 1.0)
        .depth(0.0, 0.3)
        .size(0.1, 0.3)
        .share(0.006)
        .least(8)
        .median(700.0)
        .repeats(1.0)
        .material(STEEL);
    let case = Kit::new("Core", "CAS", Family::Skin, core)
        .stand(Stand::Piece, 1.2)
        .size(0.004, 0.008)
        .share(0.001)
        .least(8)
        .median(1500.0)
        .material(STEEL);
    let mut kits = vec![cowling, turbine, case];
    kits.extend(inside(
        cowl.within([0.2, 0.8], [0.0, 1.0]),
        0.035,
        0.06,
        ["RNG", "LON", "OIL", "WIR", "BRK", "CLP", "BLT", "GBX"],
    ));
    Section { name, kits }
}
