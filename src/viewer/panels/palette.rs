//! The palette: a few letters in, the action that they mean out. And the sheet of keys.

use egui::{Align2, Id, Key, Modal, RichText, ScrollArea, TextEdit, Ui};

use crate::viewer::actions::{Action, ENTRIES, Entry, Menu};

/// What is typed, and which of the actions found is chosen.
#[derive(Debug, Clone, Default)]
pub struct Palette {
    text: String,
    chosen: usize,
}

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// With something to do.
    Do(Action),
    /// With nothing.
    Closed,
}

/// The entries that have all letters of a text in order, the best first: those that have it as one word or at its start.
pub fn found(text: &str, has_model: bool) -> Vec<&'static Entry> {
    let wanted = text.trim().to_lowercase();
    let rank = |entry: &Entry| {
        let name = entry.name.to_lowercase();
        if name.starts_with(&wanted) {
            Some(0)
        } else if name.contains(&wanted) {
            Some(1)
        } else {
            let mut letters = name.chars();
            wanted.chars().all(|letter| letters.any(|other| other == letter)).then_some(2)
        }
    };
    let mut ranked: Vec<(i32, &Entry)> = ENTRIES
        .iter()
        .filter(|entry| has_model || !entry.needs_model)
        .filter_map(|entry| Some((rank(entry)?, entry)))
        .collect();
    ranked.sort_by_key(|&(rank, _)| rank);
    ranked.into_iter().map(|(_, entry)| entry).collect()
}

impl Palette {
    /// Shows it; says how it ended once it has.
    pub fn show(&mut self, context: &egui::Context, has_model: bool) -> Option<Ended> {
        let modal = Modal::new(Id::unique("palette")).show(context, |ui| self.contents(ui, has_model));
        let closed = modal.should_close().then_some(Ended::Closed);
        modal.inner.or(closed)
    }

    fn contents(&mut self, ui: &mut Ui, has_model: bool) -> Option<Ended> {
        ui.set_width(420.0);
        let entries = found(&self.text, has_model);
        let [up, down, enter] =
            [Key::ArrowUp, Key::ArrowDown, Key::Enter].map(|key| ui.input(|i| i.key_pressed(key)));
        let id = egui::Id::unique("palette text");
        // Before the field is laid out, so that it takes what was typed since it was asked for.
        ui.memory_mut(|memory| memory.request_focus(id));
        let field = TextEdit::singleline(&mut self.text).id(id).hint_text("What shall be done?");
        let field = ui.add(field.desired_width(f32::INFINITY));
        if field.changed() {
            self.chosen = 0;
        }
        let last = entries.len().saturating_sub(1);
        self.chosen = match (up, down) {
            (true, _) => self.chosen.saturating_sub(1),
            (_, true) => (self.chosen + 1).min(last),
            _ => self.chosen.min(last),
        };
        let mut ended =
            enter.then(|| entries.get(self.chosen)).flatten().map(|entry| Ended::Do(entry.action));
        ScrollArea::vertical().max_height(320.0).show(ui, |ui| {
            for (number, entry) in entries.iter().enumerate() {
                let row = row(ui, entry, number == self.chosen);
                if row.clicked() {
                    ended = Some(Ended::Do(entry.action));
                }
                if number == self.chosen && (up || down) {
                    row.scroll_to_me(None);
                }
            }
            if entries.is_empty() {
                ui.weak("Nothing is called so.");
            }
        });
        ended
    }
}

fn row(ui: &mut Ui, entry: &Entry, is_chosen: bool) -> egui::Response {
    let button = entry.button(ui.ctx()).selected(is_chosen);
    ui.add_sized([ui.available_width(), 22.0], button)
}

/// The key sheet keeps so far from the sides of the window.
const KEYS_MARGIN: f32 = 24.0;
/// Two columns of keys take so much.
const TWO_COLUMNS: f32 = 820.0;

/// Shows all keys by menu, and what the mouse does; says whether it stays open.
pub fn show_keys(context: &egui::Context, mouse: &[(String, String)]) -> bool {
    let mut is_open = true;
    let room = context.content_rect().width() - 2.0 * KEYS_MARGIN;
    let count = if room < TWO_COLUMNS { 1 } else { 2 };
    let window = egui::Window::new("Keys and mouse").open(&mut is_open).collapsible(false).max_width(room);
    window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).vscroll(true).show(context, |ui| {
        ui.columns(count, |columns| {
            for (number, menu) in Menu::ALL.into_iter().enumerate() {
                key_table(&mut columns[usize::from(number >= 2).min(count - 1)], menu);
            }
            columns[0].heading("Mouse");
            pairs(&mut columns[0], "mouse", mouse);
        });
    });
    is_open
}

fn key_table(ui: &mut Ui, menu: Menu) {
    let keyed = ENTRIES.iter().filter(|entry| entry.menu == menu && entry.key.is_some());
    let rows: Vec<(String, String)> =
        keyed.map(|entry| (entry.key_text(ui.ctx()), entry.name.to_owned())).collect();
    ui.heading(menu.name());
    pairs(ui, menu.name(), &rows);
    ui.add_space(8.0);
}

fn pairs(ui: &mut Ui, id: &str, rows: &[(String, String)]) {
    egui::Grid::new(id).num_columns(2).striped(true).show(ui, |ui| {
        for (key, meaning) in rows {
            ui.label(RichText::new(key).monospace().strong());
            ui.label(meaning);
            ui.end_row();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_find_actions_the_nearest_first() {
        let names = |text: &str| found(text, true).iter().map(|entry| entry.name).collect::<Vec<_>>();
        assert_eq!(names("fit a")[0], "Fit all");
        assert_eq!(names("wire")[0], "Wireframe");
        assert!(names("isoslc").contains(&"Isolate selected"));
        assert_eq!(names("").len(), ENTRIES.len());
        assert!(names("no such thing at all").is_empty());
        assert!(found("fit all", false).is_empty() && !found("open", false).is_empty());
    }
}
