//! Streaming made visible: what was sent against what sending everything would cost, times, memory; and the knobs.

use egui::{ComboBox, DragValue, Grid, Slider, Ui};
use egui_plot::{Legend, Line, Plot, PlotPoints};

use super::tenths;
use crate::stats::FrameRecord;
use crate::stats::report::human;
use crate::stream::Strategy;
use crate::viewer::history::History;
use crate::viewer::settings::Settings;

/// What the user did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Changed {
    /// Something that takes effect with the next frame.
    pub spending: bool,
    /// A cap that a new renderer is needed for.
    pub caps: bool,
}

/// Shows the knobs and the plots.
pub fn show(ui: &mut Ui, settings: &mut Settings, history: &History) -> Changed {
    let changed = knobs(ui, settings);
    ui.separator();
    if let Some(last) = history.last() {
        numbers(ui, last, history);
        bytes_plot(ui, history);
        times_plot(ui, history);
        memory_plot(ui, history);
    } else {
        ui.weak("No frame has been drawn yet.");
    }
    changed
}

fn knobs(ui: &mut Ui, settings: &mut Settings) -> Changed {
    let (spending, caps) = (settings.spending(), caps_of(settings));
    Grid::new("knobs").num_columns(2).striped(true).show(ui, |ui| {
        let mut row = |name: &str, hint: &str, add: &mut dyn FnMut(&mut Ui)| {
            ui.label(name).on_hover_text(hint);
            add(ui);
            ui.end_row();
        };
        row("Budget", "Vertices that are drawn at most (N)", &mut |ui| {
            let range = 1000..=100_000_000;
            let budget =
                Slider::new(&mut settings.budget_vertices, range).logarithmic(true).suffix(" vertices");
            ui.add(budget);
        });
        row(
            "Error",
            "No part gets more than keeps its error below so many pixels; 0: the whole budget is spent",
            &mut |ui| {
                ui.add(
                    Slider::new(&mut settings.error_px, 0.0..=50.0)
                        .logarithmic(true)
                        .smallest_positive(0.05)
                        .suffix(" px"),
                );
            },
        );
        row("α", "Budgets grow with the projected area to the power of 1/α", &mut |ui| {
            ui.add(Slider::new(&mut settings.alpha, 1.0..=10.0).custom_formatter(tenths));
        });
        row("Strategy", "How data is sent", &mut |ui| {
            ComboBox::from_id_salt("strategy").selected_text(settings.strategy.word()).show_ui(ui, |ui| {
                for strategy in Strategy::ALL {
                    ui.selectable_value(&mut settings.strategy, strategy, strategy.word());
                }
            });
        });
        row("Defragmentation", "How active buffers are made contiguous; the only way so far", &mut |ui| {
            ui.label("rebuild");
        });
        row("Upload", "Sent in a frame at most; the rest comes in later frames", &mut |ui| {
            cap(ui, &mut settings.upload_bytes, 1 << 10, 32 << 20);
        });
        row(
            "Memory",
            "For the model: tables, chunks and what belongs to them. A change opens it anew",
            &mut |ui| {
                cap(ui, &mut settings.memory_bytes, 1 << 20, 1 << 30);
            },
        );
        row("GPU memory", "Buffers and picture. A change opens the model anew", &mut |ui| {
            cap(ui, &mut settings.gpu_memory_bytes, 1 << 20, 1 << 30);
        });
        row(
            "Disk",
            "Reads no more a second, to see what a slow disk does. A change opens the model anew",
            &mut |ui| {
                cap(ui, &mut settings.read_rate, 100_000, 5_000_000);
            },
        );
    });
    Changed { spending: settings.spending() != spending, caps: caps_of(settings) != caps }
}

fn caps_of(settings: &Settings) -> [Option<u64>; 3] {
    [settings.memory_bytes, settings.gpu_memory_bytes, settings.read_rate]
}

/// A cap in MB that may be off.
fn cap(ui: &mut Ui, bytes: &mut Option<u64>, least: u64, first: u64) {
    ui.horizontal(|ui| {
        let mut is_on = bytes.is_some();
        if ui.checkbox(&mut is_on, "").changed() {
            *bytes = is_on.then_some(first);
        }
        if let Some(bytes) = bytes {
            let mut megabytes = *bytes as f64 / 1e6;
            let speed = 0.01 * megabytes.max(0.1);
            let value = DragValue::new(&mut megabytes).speed(speed).suffix(" MB");
            // Only when the user is done: every change may open the model anew.
            if ui.add(value.max_decimals(1).update_while_editing(false)).changed() {
                *bytes = ((megabytes * 1e6) as u64).max(least);
            }
        } else {
            ui.weak("no cap");
        }
    });
}

fn numbers(ui: &mut Ui, last: &FrameRecord, history: &History) {
    let total = history.total();
    let [middle, longest] = history.frame_ms();
    let rows: [(&str, String); 9] = [
        (
            "Triangles",
            format!(
                "{} drawn, {} sent",
                human::count(last.active_triangles),
                human::count(last.streamed_triangles)
            ),
        ),
        (
            "Vertices",
            format!(
                "{} drawn, {} sent",
                human::count(last.active_vertices),
                human::count(last.streamed_vertices)
            ),
        ),
        (
            "Instances",
            format!(
                "{} in view, {} wait for data, {} boxes",
                human::count(last.instances_visible),
                human::count(last.misses),
                human::count(last.boxes)
            ),
        ),
        (
            "Sent",
            format!(
                "{} this frame; whole: {}",
                human::bytes(last.bytes_sent),
                human::bytes(last.bytes_whole)
            ),
        ),
        (
            "Since opened",
            format!(
                "{} sent, {} read; {:.1} times less than whole",
                human::bytes(total.bytes_sent),
                human::bytes(total.disk_bytes),
                total.saving()
            ),
        ),
        (
            "Memory",
            format!(
                "{} of the model, {} in all",
                human::bytes(last.resident_bytes),
                human::bytes(last.memory_bytes)
            ),
        ),
        ("GPU memory", human::bytes(last.gpu_bytes)),
        ("Frame", format!("{:.1} ms; half below {middle:.1} ms, longest {longest:.1} ms", last.frame_ms)),
        (
            "Stages",
            format!(
                "select {:.1}, residency {:.1}, gather {:.1}, upload {:.1}, defragment {:.1}, reform {:.1}, draw {:.1} ms",
                last.select_ms,
                last.residency_ms,
                last.gather_ms,
                last.upload_ms,
                last.defragment_ms,
                last.reform_ms,
                last.draw_ms
            ),
        ),
    ];
    Grid::new("numbers").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.add(egui::Label::new(value).wrap());
            ui.end_row();
        }
    });
}

/// A plot of the last frames.
fn plot(ui: &mut Ui, name: &str, lines: Vec<(&str, Vec<[f64; 2]>)>) {
    ui.label(name);
    let plot = Plot::new(name)
        .height(120.0)
        .legend(Legend::default())
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show_axes([false, true]);
    plot.show(ui, |plot| {
        for (name, points) in lines {
            plot.line(Line::new(name, PlotPoints::from(points)));
        }
    });
}

/// log10 of bytes; 1 byte and none look alike.
fn log_bytes(bytes: u64) -> f64 {
    (bytes.max(1) as f64).log10()
}

fn bytes_plot(ui: &mut Ui, history: &History) {
    let sent = history.curve(|record| log_bytes(record.bytes_sent));
    let whole = history.curve(|record| log_bytes(record.bytes_whole));
    plot(ui, "Bytes a frame, powers of ten", vec![("sent", sent), ("whole", whole)]);
}

fn times_plot(ui: &mut Ui, history: &History) {
    let frame = history.curve(|record| record.frame_ms);
    let draw = history.curve(|record| record.draw_ms);
    let stream =
        history.curve(|record| record.gather_ms + record.upload_ms + record.defragment_ms + record.reform_ms);
    let choose = history.curve(|record| record.select_ms + record.residency_ms);
    let lines = vec![("frame", frame), ("draw", draw), ("send and rebuild", stream), ("choose", choose)];
    plot(ui, "Milliseconds a frame", lines);
}

fn memory_plot(ui: &mut Ui, history: &History) {
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    let model = history.curve(|record| megabytes(record.memory_bytes));
    let card = history.curve(|record| megabytes(record.gpu_bytes));
    plot(ui, "Megabytes held", vec![("memory", model), ("GPU memory", card)]);
}
