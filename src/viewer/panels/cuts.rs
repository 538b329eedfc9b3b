//! The panel of sections: planes with a slider each, and a box.

use egui::{DragValue, Slider, Ui};
use glam::DVec3;

use crate::passes::draw::MOST_PLANES;
use crate::scene::Bounds;
use crate::viewer::cuts::{Boxed, Cuts, Facing, Plane};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Shows the cuts, and has new ones face somebody who looks `forward`; says whether they changed.
pub fn show(ui: &mut Ui, cuts: &mut Cuts, bounds: &Bounds, forward: DVec3) -> bool {
    let before = cuts.clone();
    ui.horizontal(|ui| {
        ui.label("Add a plane across");
        for (axis, name) in AXES.iter().enumerate() {
            let button = ui.add_enabled(cuts.planes.len() < MOST_PLANES, egui::Button::new(*name));
            if button.on_disabled_hover_text(format!("{MOST_PLANES} planes are the most")).clicked() {
                cuts.add(Plane::facing(axis, forward));
            }
        }
    });
    let mut removed = None;
    for (number, plane) in cuts.planes.iter_mut().enumerate() {
        ui.push_id(number, |ui| {
            if plane_row(ui, plane, number, bounds) {
                removed = Some(number);
            }
        });
    }
    if let Some(number) = removed {
        cuts.planes.remove(number);
    }
    ui.separator();
    box_rows(ui, cuts);
    if cuts.planes.is_empty() && cuts.boxed.is_none() {
        ui.weak("Nothing is cut. A click on a face with Alt held cuts along it.");
    }
    *cuts != before
}

/// One plane; says whether it is to go.
fn plane_row(ui: &mut Ui, plane: &mut Plane, number: usize, bounds: &Bounds) -> bool {
    ui.horizontal(|ui| {
        let name = match plane.facing {
            Facing::Axis(axis) => format!("Plane {} across {}", number + 1, AXES[axis]),
            Facing::Normal(_) => format!("Plane {} along a face", number + 1),
        };
        ui.checkbox(&mut plane.is_on, name);
        ui.toggle_value(&mut plane.is_turned, "↔").on_hover_text("Keep the other side");
        ui.button("✖").on_hover_text("Remove this plane").clicked()
    })
    .inner
        | ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = (ui.available_width() - 110.0).max(60.0);
            ui.add(Slider::new(&mut plane.share, 0.0..=1.0).show_value(false));
            let mut place = plane.place(bounds);
            let speed = bounds.scale() * 1e-3;
            if ui.add(DragValue::new(&mut place).speed(speed).max_decimals(4)).changed() {
                plane.set_place(place, bounds);
            }
            false
        })
        .inner
}

fn box_rows(ui: &mut Ui, cuts: &mut Cuts) {
    let mut is_on = cuts.boxed.is_some();
    if ui.checkbox(&mut is_on, "Box").changed() {
        cuts.boxed = is_on.then(Boxed::default);
    }
    let Some(boxed) = &mut cuts.boxed else { return };
    for (axis, name) in AXES.iter().enumerate() {
        ui.horizontal(|ui| {
            ui.label(*name);
            ui.spacing_mut().slider_width = (0.5 * ui.available_width() - 20.0).max(40.0);
            ui.add(Slider::new(&mut boxed.low[axis], 0.0..=1.0).show_value(false));
            ui.add(Slider::new(&mut boxed.high[axis], 0.0..=1.0).show_value(false));
            boxed.high[axis] = boxed.high[axis].max(boxed.low[axis]);
        });
    }
}
