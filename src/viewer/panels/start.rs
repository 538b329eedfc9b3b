//! What is there before a model is, the line below it, and what this program is.

use std::path::PathBuf;

use egui::{Align2, CentralPanel, Ui};

use super::paths::recent_rows;
use super::picture::Tool;
use crate::gpu::Gpu;
use crate::stats::report::human;
use crate::viewer::document::Document;
use crate::viewer::painter::turntable::Progress;

/// What the user wants to open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Chosen {
    /// This file.
    File(PathBuf),
    /// Another: ask for it.
    Another,
}

/// Shown while there is no model.
pub fn show(ui: &mut Ui, recent: &[PathBuf], is_loading: bool) -> Option<Chosen> {
    let mut chosen = None;
    CentralPanel::default().show(ui, |ui| {
        ui.vertical_centered(|ui| {
            ui.add_space(0.25 * ui.available_height());
            ui.heading("collapsar");
            ui.label("Looks at assemblies larger than memory.");
            ui.add_space(16.0);
            if is_loading {
                ui.spinner();
                return;
            }
            if ui.button("Open a model…").clicked() {
                chosen = Some(Chosen::Another);
            }
            ui.weak("or drop a .clps, .glb, .gltf, .obj, .ply or .stl file here");
            if !recent.is_empty() {
                ui.add_space(16.0);
                ui.label("Opened last");
                chosen = chosen.take().or_else(|| recent_rows(ui, recent).map(Chosen::File));
            }
        });
    });
    chosen
}

/// How far the pictures of a turntable are, with a way to stop, while they are made.
pub fn turntable(ui: &mut Ui, document: &Document) {
    let Some(Progress { done, of }) = document.turntable() else { return };
    ui.label(format!("Turntable: {done} of {of} pictures"));
    ui.add(egui::ProgressBar::new(done as f32 / of.max(1) as f32).desired_width(120.0));
    if ui.button("Stop").on_hover_text("What is written stays").clicked() {
        document.stop_turntable();
    }
    ui.separator();
}

/// One line about the newest frame.
pub fn status(ui: &mut Ui, document: &Document, tool: Tool) {
    match tool {
        Tool::Hand => {}
        Tool::Fly => {
            drop(ui.strong("Flying: W A S D Q E and the mouse, the wheel for speed, Escape to land."))
        }
        Tool::Measure => drop(ui.strong("Measuring: click on two points.")),
    }
    if document.frozen.is_some() {
        ui.strong("Frozen: detail is that of where it was frozen (Space to thaw).");
    }
    let Some(frame) = &document.frame else {
        ui.spinner();
        ui.label("Preparing the first picture");
        return;
    };
    let record = &frame.record;
    ui.label(format!(
        "{} triangles of {} instances",
        human::count(record.active_triangles),
        human::count(record.instances_visible)
    ));
    if !frame.is_settled {
        ui.weak(match record.misses {
            0 => "refining".to_owned(),
            misses => format!("refining: {} instances wait for data", human::count(misses)),
        });
    }
    if let Some(pick) = document.hovered {
        let row = &document.scene().instances()[pick.instance as usize];
        ui.separator();
        ui.label(document.scene().node_name(row.node));
    }
}

/// What this program is; says whether it stays open.
pub fn show_about(context: &egui::Context, gpu: Option<&Gpu>) -> bool {
    let mut is_open = true;
    let window = egui::Window::new("About collapsar").open(&mut is_open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).show(context, |ui| {
        ui.label(format!("collapsar {}", env!("CARGO_PKG_VERSION")));
        ui.label("A massive-model streaming renderer: collapse-ordered meshes, budgets per part, and frame-to-frame coherence on the GPU.");
        if let Some(gpu) = gpu {
            let info = &gpu.adapter_info;
            ui.label(format!("Drawn by {} ({}, {:?})", info.name, info.driver_info, info.backend));
        }
    });
    is_open
}
