//! How things look: colours, edges, depth, projection.

use egui::{Color32, ComboBox, Grid, Slider, Ui};

use super::tenths;
use crate::frame::colour_by::{ColourBy, ramp};
use crate::passes::draw::Edges;
use crate::scene::views::UpAxis;
use crate::viewer::mouse::Preset;
use crate::viewer::settings::{Settings, Theme};

/// What of the look belongs to a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// What colours tell.
    pub colour_by: ColourBy,
    /// What is drawn as lines.
    pub edges: Edges,
}

impl Default for Look {
    fn default() -> Self {
        Self { colour_by: ColourBy::Material, edges: Edges::None }
    }
}

/// What edges are called.
pub fn edges_word(edges: Edges) -> &'static str {
    match edges {
        Edges::None => "none",
        Edges::Features => "features",
        Edges::All => "all (wireframe)",
    }
}

/// Shows it; changes take effect with the next frame.
pub fn show(ui: &mut Ui, look: &mut Look, settings: &mut Settings) {
    Grid::new("look").num_columns(2).striped(true).show(ui, |ui| {
        ui.label("Colour by");
        ComboBox::from_id_salt("colour by").selected_text(look.colour_by.word()).show_ui(ui, |ui| {
            for by in ColourBy::ALL {
                ui.selectable_value(&mut look.colour_by, by, by.word());
            }
        });
        ui.end_row();
        ui.label("Edges");
        ComboBox::from_id_salt("edges").selected_text(edges_word(look.edges)).show_ui(ui, |ui| {
            for edges in [Edges::None, Edges::Features, Edges::All] {
                ui.selectable_value(&mut look.edges, edges, edges_word(edges));
            }
        });
        ui.end_row();
        ui.label("Shade by depth");
        ui.add(Slider::new(&mut settings.depth_cue, 0.0..=2.0).custom_formatter(tenths));
        ui.end_row();
        ui.label("Projection");
        ui.horizontal(|ui| {
            ui.selectable_value(&mut settings.parallel, false, "perspective");
            ui.selectable_value(&mut settings.parallel, true, "parallel");
        });
        ui.end_row();
        ui.label("Up");
        ui.horizontal(|ui| {
            ui.selectable_value(&mut settings.up, UpAxis::Y, "y");
            ui.selectable_value(&mut settings.up, UpAxis::Z, "z");
        });
        ui.end_row();
        ui.label("Mouse like");
        ComboBox::from_id_salt("mouse").selected_text(settings.mouse.name()).show_ui(ui, |ui| {
            for preset in Preset::ALL {
                ui.selectable_value(&mut settings.mouse, preset, preset.name());
            }
        });
        ui.end_row();
        ui.label("Interface");
        ui.horizontal(|ui| {
            for (theme, name) in [(Theme::System, "system"), (Theme::Light, "light"), (Theme::Dark, "dark")] {
                ui.selectable_value(&mut settings.theme, theme, name);
            }
        });
        ui.end_row();
        ui.label("Size of the interface");
        ui.add(
            Slider::new(&mut settings.zoom, 0.5..=3.0).custom_formatter(tenths).update_while_editing(false),
        );
        ui.end_row();
    });
    legend(ui, look.colour_by);
}

/// What the colours mean.
fn legend(ui: &mut Ui, by: ColourBy) {
    let scale = |ui: &mut Ui, low: &str, high: &str| {
        ui.horizontal(|ui| {
            ui.weak(low);
            let (rect, _) = ui.allocate_exact_size(egui::vec2(120.0, 12.0), egui::Sense::hover());
            for step in 0..24 {
                let [red, green, blue, _] = ramp(f64::from(step) / 23.0);
                let left = rect.left() + rect.width() * step as f32 / 24.0;
                let area = egui::Rect::from_min_size(egui::pos2(left, rect.top()), egui::vec2(5.5, 12.0));
                ui.painter().rect_filled(area, 0.0, Color32::from_rgb(red, green, blue));
            }
            ui.weak(high);
        });
    };
    ui.add_space(6.0);
    match by {
        ColourBy::Budget => scale(ui, "few vertices", "all of them"),
        ColourBy::Age => scale(ui, "long ago", "changed just now"),
        ColourBy::Tier => drop(ui.weak("Green: the finest tier. Yellow, orange, red, purple: each about 4 times coarser. Grey: nothing is drawn.")),
        ColourBy::Residency => drop(ui.weak("Green: all that is wished for has arrived. Red: some of it. Grey: nothing.")),
        ColourBy::Closure => drop(ui.weak("Green: closed. Orange: closed and inside out. Grey: open; its sections have no caps.")),
        ColourBy::Part | ColourBy::Instance => drop(ui.weak("Each has a colour of its own.")),
        ColourBy::Material => {}
    }
}
