//! A row in, the menu that a right click on it opens out, and what was chosen there.

use egui::{Button, Ui};

use super::super::super::bits::Bits;
use super::row::RowDeed;
use super::{TreeEvent, TreeModel};

type Entry = (&'static str, fn(Bits) -> TreeEvent);

const ENTRIES: [Entry; 7] = [
    ("Hide", TreeEvent::Hide),
    ("Show", TreeEvent::Show),
    ("Isolate", TreeEvent::Isolate),
    ("Ghost", TreeEvent::Ghost),
    ("Ghost others", TreeEvent::GhostOthers),
    ("Make solid", TreeEvent::Unghost),
    ("Fit", TreeEvent::Fit),
];

/// Draws the menu, and closes it when something was chosen.
pub(super) fn show(ui: &mut Ui, model: &TreeModel<'_>, item: u32) -> Option<RowDeed> {
    let target = model.target(item);
    let mut chosen = None;
    for (word, event) in ENTRIES {
        // Nothing can be done to what has no parts.
        if ui.add_enabled(!target.is_empty(), Button::new(word)).clicked() {
            chosen = Some(RowDeed::Event(event(target.clone())));
        }
    }
    if ui.button("Show all").clicked() {
        chosen = Some(RowDeed::Event(TreeEvent::ShowAll));
    }
    ui.separator();
    if ui.add_enabled(model.tree.can_expand(item), Button::new("Expand all below")).clicked() {
        chosen = Some(RowDeed::ExpandBelow);
    }
    if ui.button("Collapse all").clicked() {
        chosen = Some(RowDeed::CollapseAll);
    }
    if ui.button("Copy name").clicked() {
        ui.ctx().copy_text(model.name(item));
        ui.close();
    }
    if chosen.is_some() {
        ui.close();
    }
    chosen
}
