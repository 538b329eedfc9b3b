//! Keys pressed while the rows have the focus in, moves of the cursor and changes of the tree out.

use egui::{EventFilter, Id, Key, Modifiers, Ui};

use super::row::ROW_HEIGHT;
use super::{TreeEvent, TreeModel, TreePanel};

const KEYS: [Key; 10] = [
    Key::ArrowUp,
    Key::ArrowDown,
    Key::ArrowLeft,
    Key::ArrowRight,
    Key::Home,
    Key::End,
    Key::PageUp,
    Key::PageDown,
    Key::Enter,
    Key::Space,
];

impl TreePanel {
    pub(super) fn keys(&mut self, ui: &Ui, list: Id, model: &mut TreeModel<'_>, events: &mut Vec<TreeEvent>) {
        let arrows = EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(list, arrows));
        let shift = if ui.input(|input| input.modifiers.shift) { Modifiers::SHIFT } else { Modifiers::NONE };
        for key in KEYS {
            for _ in 0..ui.input_mut(|input| input.count_and_consume_key(shift, key)) {
                self.press(key, shift, model, events);
            }
        }
    }

    fn press(&mut self, key: Key, shift: Modifiers, model: &mut TreeModel<'_>, events: &mut Vec<TreeEvent>) {
        let cursor = self.cursor.filter(|&item| model.tree.row_of(item).is_some());
        match (key, cursor) {
            (Key::ArrowRight, Some(item)) if !model.tree.is_expanded(item) && model.tree.can_expand(item) => {
                model.tree.expand(item);
            }
            (Key::ArrowRight, Some(item)) if !model.tree.can_expand(item) => {}
            (Key::ArrowLeft, Some(item)) if model.tree.is_expanded(item) && model.tree.can_expand(item) => {
                model.tree.collapse(item);
            }
            (Key::ArrowLeft, Some(item)) => {
                if let Some(above) = model.tree.assembly().parent(item) {
                    self.choose(model, above, Modifiers::NONE, events);
                }
            }
            (Key::Enter, Some(item)) => events.push(TreeEvent::Fit(model.target(item))),
            (Key::Space, Some(item)) => events.push(self.eye(model, item)),
            (Key::Enter | Key::Space, None) => {}
            (key, cursor) => self.step(key, cursor, shift, model, events),
        }
    }

    fn step(
        &mut self,
        key: Key,
        cursor: Option<u32>,
        shift: Modifiers,
        model: &TreeModel<'_>,
        events: &mut Vec<TreeEvent>,
    ) {
        let rows = model.tree.rows();
        let Some(last) = rows.len().checked_sub(1) else { return };
        let page = ((self.height / ROW_HEIGHT) as usize).saturating_sub(1).max(1);
        let row = cursor.and_then(|item| model.tree.row_of(item));
        let to = match (key, row) {
            (Key::End, _) => last,
            (Key::Home, _) | (_, None) => 0,
            (Key::ArrowUp, Some(row)) => row.saturating_sub(1),
            (Key::PageUp, Some(row)) => row.saturating_sub(page),
            (Key::PageDown, Some(row)) => row + page,
            (_, Some(row)) => row + 1,
        };
        self.choose(model, rows[to.min(last)], shift, events);
    }
}
