//! What there is to know about what is selected: names, sizes, and how it is drawn just now.

use egui::{Grid, Ui};

use crate::scene::{Bounds, Scene, SceneCounts};
use crate::stats::report::human;
use crate::viewer::measure::units::Units;
use crate::viewer::reading::Reading;

/// What is selected.
#[derive(Debug, Clone, Copy)]
pub struct Selected<'a> {
    /// The model.
    pub scene: &'a Scene,
    /// How many instances.
    pub count: usize,
    /// One of them, the last that was chosen.
    pub instance: Option<u32>,
    /// How that one is drawn.
    pub reading: Option<Reading>,
    /// The box of that one.
    pub bounds: Bounds,
    /// How large the model is.
    pub counts: SceneCounts,
    /// What lengths are told in.
    pub units: Units,
}

/// Shows it.
pub fn show(ui: &mut Ui, selected: &Selected<'_>) {
    let Some(instance) = selected.instance else {
        model(ui, selected);
        return;
    };
    if selected.count > 1 {
        ui.label(format!(
            "{} instances are selected; the last of them:",
            human::count(selected.count as u64)
        ));
    }
    Grid::new("properties").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows(selected, instance) {
            ui.label(name);
            ui.add(egui::Label::new(value).wrap().selectable(true));
            ui.end_row();
        }
    });
}

fn model(ui: &mut Ui, Selected { scene, counts, units, .. }: &Selected<'_>) {
    let rows = [
        ("Model", scene.file_name()),
        ("Parts", human::count(counts.parts)),
        ("Instances", human::count(counts.instances)),
        ("Triangles", human::count(counts.triangles_placed)),
        ("File", human::bytes(counts.file_bytes)),
        ("Size", units.size(scene.bounds().extent().to_array())),
    ];
    Grid::new("model").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.label(value);
            ui.end_row();
        }
    });
    ui.add_space(6.0);
    ui.weak("Click on a part to see what it is.");
}

/// Names and values of one instance.
pub fn rows(selected: &Selected<'_>, instance: u32) -> Vec<(&'static str, String)> {
    let scene = selected.scene;
    let row = &scene.instances()[instance as usize];
    let part = &scene.parts()[row.part as usize];
    let named = |name: &str| if name.is_empty() { "(without a name)".to_owned() } else { name.to_owned() };
    let colour = scene.colour(row);
    let mut rows = vec![
        ("Name", named(scene.node_name(row.node))),
        ("Path", scene.node_path(row.node)),
        ("Part", named(scene.part_name(row.part))),
        (
            "Material",
            format!(
                "{}, #{:02x}{:02x}{:02x}",
                named(scene.material_name(row.material)),
                colour[0],
                colour[1],
                colour[2]
            ),
        ),
        ("Triangles", human::count(part.triangles.into())),
        ("Size", selected.units.size(selected.bounds.extent().to_array())),
        (
            "Surface",
            match part.closure() {
                crate::geometry::Closure::Open => "open",
                crate::geometry::Closure::Closed => "closed",
                crate::geometry::Closure::InsideOut => "closed, inside out",
            }
            .to_owned(),
        ),
    ];
    if let Some(reading) = selected.reading.filter(|reading| reading.instance == instance) {
        rows.extend(drawn(&reading));
    }
    rows
}

fn drawn(reading: &Reading) -> Vec<(&'static str, String)> {
    let [drawn, wished, all] = reading.vertices.map(|count| human::count(count.into()));
    let [triangles, of_triangles] = reading.triangles.map(|count| human::count(count.into()));
    let tier = match reading.tier {
        Some(tier) => format!("{tier} of {} (0 is the finest)", reading.tier_count),
        None => "none: nothing of it is drawn".to_owned(),
    };
    let arrived = format!("{} of {all} vertices", human::count(reading.arrived.into()));
    vec![
        ("Tier", tier),
        ("Budget", format!("{drawn} vertices drawn, {wished} wished, {all} in all")),
        ("Drawn", format!("{triangles} of {of_triangles} triangles")),
        ("In memory", arrived),
    ]
}
