//! A chemical plant of 150 m by 60 m: columns and vessels in structures of steel, tanks, and a pipe rack along x.

use glam::DVec3;

use super::{BLUE, COPPER, GREY, Kit, PALE, PRIMER, RED, STEEL, Section, Stand, WHITE, YELLOW, inside};
use crate::synth::family::Family;
use crate::synth::surface::{Form, Surface};

/// All sections.
pub fn sections() -> Vec<Section> {
    vec![
        unit("Unit 100 distillation", DVec3::new(5.0, 0.0, 8.0), [32.0, 22.0], 5, [3, 24], 0.26),
        unit("Unit 200 reaction", DVec3::new(45.0, 0.0, 8.0), [34.0, 20.0], 4, [4, 13], 0.26),
        unit("Unit 300 recovery", DVec3::new(88.0, 0.0, 8.0), [28.0, 22.0], 4, [3, 17], 0.22),
        tanks(),
        rack(),
    ]
}

/// A structure of several levels around a row of vessels; `vessels` is how many and how high.
fn unit(
    name: &'static str,
    at: DVec3,
    size: [f64; 2],
    levels: u32,
    vessels: [u32; 2],
    weight: f64,
) -> Section {
    let mut kits = Vec::new();
    let [count, height] = vessels;
    let pitch = size[0] / f64::from(count);
    let codes = ["VSA", "VSB", "VSC", "VSD"];
    for number in 0..count {
        let foot = at + DVec3::new(pitch * (f64::from(number) + 0.5), 1.0, size[1] * 0.5);
        let tall = f64::from(height) * [1.0, 0.7, 0.85, 0.6][number as usize % 4];
        let form = Form::Vessel { origin: foot, height: tall, radius: (0.28 * pitch).min(2.4) };
        kits.extend(vessel(Surface::of(form), weight / f64::from(count), codes[number as usize % 4]));
    }
    for level in 0..levels {
        let corner = at + DVec3::Y * (4.5 * f64::from(level));
        kits.extend(platform(corner, size, weight / f64::from(levels), level));
    }
    Section { name, kits }
}

fn vessel(surface: Surface, weight: f64, code: &'static str) -> [Kit; 3] {
    [
        Kit::new("Vessels", code, Family::Skin, surface)
            .stand(Stand::Piece, 1.0)
            .size(0.012, 0.02)
            .share(0.03 * weight)
            .least(12)
            .median(1500.0)
            .material(PALE),
        Kit::new("Nozzles", "NOZ", Family::Valve, surface)
            .stand(Stand::Upon, 1.0)
            .size(0.2, 0.7)
            .share(0.06 * weight)
            .least(6)
            .median(500.0)
            .repeats(1.0)
            .material(STEEL),
        Kit::new("Risers", "RIS", Family::Pipe, surface.within([0.15, 0.9], [0.0, 1.0]))
            .stand(Stand::Run, 8.0)
            .depth(-1.1, -0.3)
            .size(0.06, 0.25)
            .share(0.14 * weight)
            .least(4)
            .median(700.0)
            .material(COPPER),
    ]
}

/// A level of a structure: columns up from it, gratings, machines, and pipes below the next one.
fn platform(corner: DVec3, [length, width]: [f64; 2], weight: f64, level: u32) -> Vec<Kit> {
    let plane = |height: f64| {
        Surface::plane(corner + DVec3::new(0.0, height, 0.0), DVec3::Z * width, DVec3::X * length)
    };
    let floor = plane(0.0);
    let code = |codes: [&'static str; 5]| codes[level as usize % 5];
    let mut kits = vec![
        Kit::new("Columns", code(["CLA", "CLB", "CLC", "CLD", "CLE"]), Family::Column, floor)
            .stand(Stand::Ordered, 1.0)
            .size(0.38, 0.42)
            .share(0.03 * weight)
            .least(12)
            .most(48)
            .median(240.0)
            .repeats(0.5)
            .material(PRIMER),
        Kit::new("Gratings", code(["GRA", "GRB", "GRC", "GRD", "GRE"]), Family::Grating, floor)
            .stand(Stand::Ordered, 1.0)
            .size(2.2, 2.5)
            .share(0.05 * weight)
            .least(8)
            .most(120)
            .median(220.0)
            .repeats(1.5)
            .material(GREY),
        Kit::new("Ladders", "LAD", Family::Ladder, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.5, 0.6)
            .share(0.015 * weight)
            .least(2)
            .median(350.0)
            .repeats(1.0)
            .material(YELLOW),
        Kit::new("Machines", "MCH", Family::Equipment, floor)
            .stand(Stand::Upon, 1.0)
            .size(0.6, 2.4)
            .share(0.05 * weight)
            .least(5)
            .median(900.0)
            .repeats(0.5)
            .material(BLUE),
        Kit::new("Valves", "VLV", Family::Valve, floor)
            .stand(Stand::Upon, 1.0)
            .depth(-2.6, -0.1)
            .size(0.15, 0.6)
            .share(0.1 * weight)
            .least(6)
            .median(500.0)
            .repeats(1.0)
            .material(RED),
    ];
    kits.extend(inside(
        plane(4.3),
        0.7 * weight,
        0.26,
        ["BEA", "GIR", "PIP", "TRY", "HGR", "CLP", "BLT", "JBX"],
    ));
    kits
}

fn tanks() -> Section {
    let mut kits = Vec::new();
    for (number, code) in ["TKA", "TKB", "TKC"].into_iter().enumerate() {
        let origin = DVec3::new(128.0, 0.2, 8.0 + 18.0 * number as f64);
        let shell = Surface::of(Form::Vessel { origin, height: 13.0, radius: 7.5 });
        kits.push(
            Kit::new("Shell", code, Family::Skin, shell)
                .stand(Stand::Piece, 0.8)
                .size(0.012, 0.02)
                .share(0.004)
                .least(20)
                .median(1200.0)
                .material(WHITE),
        );
        kits.extend(inside(
            shell.within([0.1, 0.75], [0.0, 1.0]),
            0.03,
            0.18,
            ["RNG", "STF", "COI", "WIR", "BRK", "CLP", "BLT", "INS"],
        ));
    }
    Section { name: "Tank farm", kits }
}

/// A rack of two tiers along x, with most of the long pipes.
fn rack() -> Section {
    let tier =
        |height: f64| Surface::plane(DVec3::new(2.0, height, -2.0), DVec3::X * 116.0, DVec3::NEG_Z * 7.0);
    let pipes = |height: f64, code| {
        Kit::new("Piping", code, Family::Pipe, tier(height))
            .stand(Stand::Run, 14.0)
            .depth(-0.3, -0.15)
            .size(0.08, 0.34)
            .share(0.06)
            .least(30)
            .median(800.0)
            .material(COPPER)
    };
    let mut kits = vec![
        pipes(5.0, "PPA"),
        pipes(7.5, "PPB"),
        Kit::new("Steel", "POS", Family::Column, tier(0.0))
            .stand(Stand::Ordered, 1.0)
            .size(0.6, 0.7)
            .share(0.002)
            .least(24)
            .most(40)
            .median(240.0)
            .repeats(0.5)
            .material(PRIMER),
    ];
    kits.extend(inside(tier(7.4), 0.06, 0.26, ["BEA", "GIR", "PIP", "TRY", "HGR", "CLP", "BLT", "JBX"]));
    kits.extend(inside(tier(4.9), 0.06, 0.26, ["BEB", "GIS", "PIQ", "TRZ", "HGS", "CLQ", "BLU", "JBY"]));
    Section { name: "Pipe rack", kits }
}
