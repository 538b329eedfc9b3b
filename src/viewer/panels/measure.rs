//! The panel of measurements: what to measure, in which unit, and the list. Says what the user did.

use egui::{Color32, ComboBox, DragValue, Rect, Stroke, Ui};
use glam::DVec3;

use crate::viewer::document::Document;
use crate::viewer::measure::{Measurement, Measuring, Mode, Step, Unit, Units, What};
use crate::viewer::navigation::motions::pixel_of;

/// What the user did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MeasureEvent {
    /// Measure something else from now on.
    Mode(Mode),
    /// Measure the box of what is selected.
    SizeOfSelection,
    /// Tell lengths in other units.
    Units(Units),
    /// Fetch full detail of what is measured next, or take what is drawn.
    FullDetail(bool),
    /// Forget the first point.
    Cancel,
    /// Show where a measurement is.
    Show(u32),
    /// Put a measurement's text into the clipboard.
    Copy(u32),
    /// Take a measurement out of the list.
    Remove(u32),
    /// Empty the list.
    Clear,
}

/// What the panel shows beside the tool itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// The units.
    pub units: Units,
    /// Whether full detail is fetched for what is measured.
    pub is_full_detail: bool,
    /// How many instances are selected.
    pub selected: usize,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, tool: &Measuring, shown: &Shown) -> Vec<MeasureEvent> {
    let mut events = Vec::new();
    modes(ui, tool, shown, &mut events);
    units(ui, shown.units, &mut events);
    let mut is_full = shown.is_full_detail;
    let hint = "Reads the part from the file first; otherwise the error is that of what is drawn";
    if ui.checkbox(&mut is_full, "At full detail").on_hover_text(hint).changed() {
        events.push(MeasureEvent::FullDetail(is_full));
    }
    ui.horizontal(|ui| {
        ui.weak(tool.hint());
        if tool.step() != crate::viewer::measure::Step::First && ui.small_button("Cancel").clicked() {
            events.push(MeasureEvent::Cancel);
        }
    });
    ui.separator();
    for measurement in tool.list() {
        one(ui, measurement, &shown.units, &mut events);
    }
    if !tool.list().is_empty() && ui.button("Remove all").clicked() {
        events.push(MeasureEvent::Clear);
    }
    events
}

fn modes(ui: &mut Ui, tool: &Measuring, shown: &Shown, events: &mut Vec<MeasureEvent>) {
    ui.horizontal(|ui| {
        for (mode, label) in [(Mode::Distance, "Point to point"), (Mode::Edge, "Edge")] {
            if ui.selectable_label(tool.mode() == mode, label).clicked() {
                events.push(MeasureEvent::Mode(mode));
            }
        }
        let size = egui::Button::new("Size of selection");
        let size = ui.add_enabled(shown.selected > 0, size);
        if size.on_disabled_hover_text("Select parts first").clicked() {
            events.push(MeasureEvent::SizeOfSelection);
        }
    });
}

fn units(ui: &mut Ui, units: Units, events: &mut Vec<MeasureEvent>) {
    let mut changed = units;
    ui.horizontal_wrapped(|ui| {
        unit(ui, "Model in", &mut changed.model);
        unit(ui, "shown in", &mut changed.shown);
        let scale = DragValue::new(&mut changed.scale).range(1e-6..=1e6).speed(0.1).prefix("1 : ");
        ui.add(scale)
            .accessible_name("Scale of the model")
            .on_hover_text("How much larger the real thing is");
    });
    if changed != units {
        events.push(MeasureEvent::Units(changed));
    }
}

fn unit(ui: &mut Ui, label: &str, unit: &mut Unit) {
    ComboBox::from_label(label).width(48.0).selected_text(unit.word()).show_ui(ui, |ui| {
        for choice in Unit::ALL {
            ui.selectable_value(unit, choice, choice.word());
        }
    });
}

fn one(ui: &mut Ui, measurement: &Measurement, units: &Units, events: &mut Vec<MeasureEvent>) {
    let number = measurement.number;
    ui.horizontal(|ui| {
        if ui.selectable_label(false, measurement.title()).on_hover_text("Show where").clicked() {
            events.push(MeasureEvent::Show(number));
        }
        for (sign, what, event) in
            [("🗐", "Copy", MeasureEvent::Copy(number)), ("✖", "Remove", MeasureEvent::Remove(number))]
        {
            let label = format!("{what} measurement {number}");
            if ui.small_button(sign).accessible_name(label).on_hover_text(what).clicked() {
                events.push(event);
            }
        }
    });
    egui::Grid::new(("measurement", number)).num_columns(2).show(ui, |ui| {
        for (name, text) in measurement.lines(units) {
            ui.weak(name);
            ui.monospace(text);
            ui.end_row();
        }
    });
    ui.weak(measurement.basis());
    ui.separator();
}

/// A measurement as text, for the clipboard.
pub fn text(measurement: &Measurement, units: &Units) -> String {
    let lines = measurement.lines(units).into_iter().map(|(name, text)| format!("{name}: {text}"));
    let all = std::iter::once(measurement.title()).chain(lines).chain([measurement.basis().to_owned()]);
    all.collect::<Vec<_>>().join("\n")
}

/// Draws over a picture what was measured, and the point that waits for the second.
pub fn paint(ui: &Ui, picture: Rect, tool: &Measuring, document: &Document, units: &Units) {
    let [width, height] = document.size.map(|pixels| pixels as f32);
    let points = picture.size() / egui::vec2(width, height);
    let place = |point: DVec3| {
        let pixel = pixel_of(document.navigation.camera(), document.picture(), point)?.as_vec2();
        Some(picture.min + egui::vec2(pixel.x, pixel.y) * points)
    };
    let painter = ui.painter().with_clip_rect(picture);
    let colour = Color32::from_rgb(230, 90, 20);
    if let Step::Second(first) = tool.step()
        && let Some(at) = place(first.point)
    {
        painter.circle_filled(at, 4.0, colour);
    }
    for measurement in tool.list() {
        let (ends, label) = match measurement.what {
            What::Distance { from, to } => ([place(from), place(to)], 0.5 * (from + to)),
            What::Edge { at, .. } => ([place(at), None], at),
            What::Size { .. } => continue,
        };
        if let [Some(from), Some(to)] = ends {
            painter.line_segment([from, to], Stroke::new(1.5, colour));
        }
        for at in ends.into_iter().flatten() {
            painter.circle_filled(at, 3.0, colour);
        }
        if let (Some(at), Some((_, text))) = (place(label), measurement.lines(units).first()) {
            let font = egui::FontId::proportional(13.0);
            let text = painter.layout_no_wrap(text.clone(), font, Color32::WHITE);
            let back = Rect::from_min_size(at + egui::vec2(6.0, -9.0), text.size()).expand(3.0);
            painter.rect_filled(back, 3.0, colour.gamma_multiply(0.9));
            painter.galley(back.min + egui::vec2(3.0, 3.0), text, Color32::WHITE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::measure::{Picked, SnapKind};
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;
    use glam::DVec3;

    struct State {
        tool: Measuring,
        shown: Shown,
        events: Vec<MeasureEvent>,
    }

    fn picked(x: f64) -> Picked {
        let kind = SnapKind::Vertex;
        Picked { point: DVec3::new(x, 0.0, 0.0), kind, instance: 0, error: 0.000_02, is_full: true }
    }

    fn harness() -> Harness<'static, State> {
        let mut tool = Measuring::default();
        tool.pick(picked(0.0));
        tool.pick(picked(1.25));
        tool.pick(picked(3.0));
        let units = Units { shown: Unit::Mm, ..Units::default() };
        let shown = Shown { units, is_full_detail: false, selected: 2 };
        Harness::builder().with_size([460.0, 500.0]).build_ui_state(
            |ui, state: &mut State| {
                let new = show(ui, &state.tool, &state.shown);
                state.events.extend(new);
            },
            State { tool, shown, events: Vec::new() },
        )
    }

    #[test]
    fn lengths_are_shown_with_their_error_and_unit() {
        let mut harness = harness();
        harness.run();
        assert_eq!(harness.get_all_by_label("1250.00 ± 0.04 mm").count(), 2, "the distance and dx");
        harness.get_by_label("Click the second point");
        harness.get_by_label("at full detail");
        let copied = text(&harness.state().tool.list()[0], &harness.state().shown.units);
        assert!(copied.starts_with("1. Distance\ndistance: 1250.00 ± 0.04 mm\n"), "{copied}");
    }

    #[test]
    fn every_button_says_what_was_done() {
        for (label, event) in [
            ("Edge", MeasureEvent::Mode(Mode::Edge)),
            ("Size of selection", MeasureEvent::SizeOfSelection),
            ("At full detail", MeasureEvent::FullDetail(true)),
            ("Cancel", MeasureEvent::Cancel),
            ("1. Distance", MeasureEvent::Show(1)),
            ("Copy measurement 1", MeasureEvent::Copy(1)),
            ("Remove measurement 1", MeasureEvent::Remove(1)),
            ("Remove all", MeasureEvent::Clear),
        ] {
            let mut harness = harness();
            harness.run();
            harness.get_by_label(label).click();
            harness.run();
            assert_eq!(harness.state().events, [event], "{label}");
        }
    }

    #[test]
    fn another_unit_is_chosen_from_a_list() {
        let mut harness = harness();
        harness.run();
        harness.get_by_label("shown in").click();
        harness.run();
        harness.get_by_label("ft").click();
        harness.run();
        let units = Units { shown: Unit::Ft, ..Units::default() };
        assert_eq!(harness.state().events, [MeasureEvent::Units(units)]);
    }
}
