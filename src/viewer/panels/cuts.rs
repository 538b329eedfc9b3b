//! The panel of sections: planes with a slider each, and a box.

use egui::{DragValue, Slider, Ui};
use glam::DVec3;

use crate::passes::draw::MOST_PLANES;
use crate::scene::Bounds;
use crate::viewer::cuts::{Boxed, Cuts, Facing, Plane, share_of};
use crate::viewer::measure::units::Units;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Shows the cuts of a model with that box, told in those units, and has new ones face somebody who looks `forward`; says
/// whether they changed.
pub fn show(ui: &mut Ui, cuts: &mut Cuts, (bounds, units): (&Bounds, &Units), forward: DVec3) -> bool {
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
            if plane_row(ui, plane, number, (bounds, units)) {
                removed = Some(number);
            }
        });
    }
    if let Some(number) = removed {
        cuts.planes.remove(number);
    }
    ui.separator();
    box_rows(ui, cuts, (bounds, units));
    if cuts.planes.is_empty() && cuts.boxed.is_none() {
        ui.weak("Nothing is cut. A click on a face with Alt held cuts along it.");
    }
    *cuts != before
}

/// One plane; says whether it is to go.
fn plane_row(ui: &mut Ui, plane: &mut Plane, number: usize, (bounds, units): (&Bounds, &Units)) -> bool {
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
            if place_value(ui, &mut place, (bounds, units)) {
                plane.set_place(place, bounds);
            }
            false
        })
        .inner
}

/// A place along an axis, to be dragged or typed in the shown unit; says whether it was.
fn place_value(ui: &mut Ui, place: &mut f64, (bounds, units): (&Bounds, &Units)) -> bool {
    let one = units.convert(1.0);
    let mut shown = *place * one;
    let value = DragValue::new(&mut shown).speed(bounds.scale() * one * 1e-3).max_decimals(4);
    let is_changed = ui.add(value.suffix(format!(" {}", units.shown.word()))).changed();
    if is_changed {
        *place = shown / one;
    }
    is_changed
}

fn box_rows(ui: &mut Ui, cuts: &mut Cuts, (bounds, units): (&Bounds, &Units)) {
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
        });
        boxed.high[axis] = boxed.high[axis].max(boxed.low[axis]);
        ui.horizontal(|ui| {
            ui.label("from");
            box_side(ui, &mut boxed.low[axis], axis, (bounds, units));
            ui.label("to");
            box_side(ui, &mut boxed.high[axis], axis, (bounds, units));
        });
        boxed.high[axis] = boxed.high[axis].max(boxed.low[axis]);
    }
}

/// Where a side of the box lies along an axis, as a share of the model's own box.
fn box_side(ui: &mut Ui, share: &mut f64, axis: usize, (bounds, units): (&Bounds, &Units)) {
    let (low, high) = (bounds.low[axis], bounds.high[axis]);
    let mut place = low + (high - low) * *share;
    if place_value(ui, &mut place, (bounds, units)) {
        *share = share_of(place, (low, high)).unwrap_or(*share);
    }
}
