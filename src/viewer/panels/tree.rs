//! The tree, what is visible and all names in, the panel with search field and rows out, and what the user did there.
//!
//! Only the rows in sight are laid out, whatever the number of others. The panel changes what is expanded and searched
//! for, which is nobody else's business; everything else it only reports.

mod keys;
mod menu;
mod row;

use egui::{Id, Key, Modifiers, Response, ScrollArea, Sense, TextEdit, Ui, Vec2, WidgetInfo};

use super::super::bits::Bits;
use super::super::search::{Names, Search};
use super::super::tree::Tree;
use super::super::visibility::{Share, Visibility};
use crate::stats::report::human;
use row::{ROW_HEIGHT, RowDeed};

/// What the panel shows.
pub struct TreeModel<'a> {
    /// The rows; expanded, collapsed and filtered by the panel.
    pub tree: &'a mut Tree,
    /// What is hidden and selected.
    pub visibility: &'a Visibility,
    /// What the search field looks through.
    pub search: &'a Search,
    /// What items are called.
    pub names: &'a dyn Names,
}

impl TreeModel<'_> {
    fn name(&self, item: u32) -> String {
        self.names.item(self.tree.assembly(), item)
    }

    /// The selection for an item that belongs to it, otherwise the leaves of the item.
    fn target(&self, item: u32) -> Bits {
        match self.visibility.selected_share(item) {
            Share::All => self.visibility.selected().clone(),
            _ => self.visibility.set_of_item(item),
        }
    }
}

/// What the user did to the tree. Sets are sets of leaves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TreeEvent {
    /// These are selected now, and nothing else.
    Select(Bits),
    /// These shall be hidden.
    Hide(Bits),
    /// These shall be shown.
    Show(Bits),
    /// Only these shall be shown.
    Isolate(Bits),
    /// These shall be ghosts.
    Ghost(Bits),
    /// All others shall be ghosts.
    GhostOthers(Bits),
    /// These shall be solid.
    Unghost(Bits),
    /// Everything shall be shown.
    ShowAll,
    /// The camera shall show these.
    Fit(Bits),
}

impl TreeEvent {
    /// Does what was asked for; [`TreeEvent::Fit`] is left to who has the camera.
    pub fn apply(self, visibility: &mut Visibility) {
        match self {
            Self::Select(leaves) => visibility.select(leaves),
            Self::Hide(leaves) => visibility.hide(&leaves),
            Self::Show(leaves) => visibility.show(&leaves),
            Self::Isolate(leaves) => visibility.isolate(&leaves),
            Self::Ghost(leaves) => visibility.ghost(&leaves),
            Self::GhostOthers(leaves) => visibility.ghost_others(&leaves),
            Self::Unghost(leaves) => visibility.unghost(&leaves),
            Self::ShowAll => visibility.show_all(),
            Self::Fit(_) => {}
        }
    }
}

/// What the panel remembers from frame to frame.
#[derive(Debug, Default)]
pub struct TreePanel {
    query: String,
    /// How many items the query found, if it asks for anything.
    found: Option<u32>,
    /// The item that the arrow keys start from, and the one from which a range is selected.
    cursor: Option<u32>,
    anchor: Option<u32>,
    /// The item that shall come into sight.
    scroll_to: Option<u32>,
    /// Whether the search field is to have the keyboard.
    wants_focus: bool,
    /// What was in sight in the last frame, in points from the first row's top.
    offset: f32,
    height: f32,
    /// The item whose row is under the pointer.
    pointed: Option<u32>,
}

impl TreePanel {
    /// What is searched for.
    pub fn query(&self) -> &str {
        &self.query
    }

    /// Gives the keyboard to the search field.
    pub fn focus_search(&mut self) {
        self.wants_focus = true;
    }

    /// Searches for something, as if it had been typed in.
    pub fn set_query(&mut self, query: &str, model: &mut TreeModel<'_>) {
        query.clone_into(&mut self.query);
        self.look_up(model);
    }

    /// Brings the row of an instance into sight, which may have been selected elsewhere; not if it is left out by the
    /// search.
    pub fn reveal(&mut self, tree: &mut Tree, instance: u32) {
        if let Some(row) = tree.reveal(instance) {
            let item = tree.rows()[row];
            (self.cursor, self.anchor, self.scroll_to) = (Some(item), Some(item), Some(item));
        }
    }

    /// The item whose row was under the pointer when the panel was drawn since the last call; asked for once a frame, it is
    /// none where the panel is not in sight.
    pub fn take_pointed(&mut self) -> Option<u32> {
        self.pointed.take()
    }

    /// Draws the panel into all of the room there is, and tells what the user did.
    pub fn show(&mut self, ui: &mut Ui, model: &mut TreeModel<'_>) -> Vec<TreeEvent> {
        let mut events = Vec::new();
        let list = ui.scope_id().with("assembly tree");
        self.search_field(ui, list, model, &mut events);
        self.list(ui, list, model, &mut events);
        events
    }

    fn search_field(
        &mut self,
        ui: &mut Ui,
        list: Id,
        model: &mut TreeModel<'_>,
        events: &mut Vec<TreeEvent>,
    ) {
        ui.horizontal(|ui| {
            let width = ui.available_width();
            let id = list.with("search");
            if std::mem::take(&mut self.wants_focus) {
                // Before the field is laid out, so that it takes what was typed since.
                ui.memory_mut(|memory| memory.request_focus(id));
            }
            let field = TextEdit::singleline(&mut self.query)
                .id(id)
                .hint_text("Search")
                .desired_width((width - if self.found.is_some() { 110.0 } else { 8.0 }).max(40.0));
            let field = ui.add(field).accessible_name("Search the tree");
            let [enter, escape] = [Key::Enter, Key::Escape]
                .map(|key| field.lost_focus() && ui.input(|input| input.key_pressed(key)));
            if enter {
                self.select_first_match(model, events);
                ui.memory_mut(|memory| memory.request_focus(list));
            }
            let mut is_changed = field.changed();
            if let Some(found) = self.found {
                let wants_clear = ui
                    .small_button("×")
                    .on_hover_text("Clear the search")
                    .accessible_name("Clear the search");
                if wants_clear.clicked() || escape {
                    self.query.clear();
                    is_changed = true;
                }
                ui.weak(format!("{} found", human::count(found.into())));
            }
            if is_changed {
                self.look_up(model);
            }
        });
    }

    fn look_up(&mut self, model: &mut TreeModel<'_>) {
        let found = model.search.find(model.tree.assembly(), &self.query);
        if found.is_none() && !model.tree.is_filtered() {
            return;
        }
        model.tree.set_filter(found.as_ref());
        self.found = found.as_ref().map(|found| found.count);
        match (&found, self.cursor) {
            (None, Some(item)) => {
                _ = model.tree.reveal_item(item);
                self.scroll_to = Some(item);
            }
            (Some(found), _) => self.scroll_to = found.matches.next(0),
            (None, None) => {}
        }
    }

    fn select_first_match(&mut self, model: &TreeModel<'_>, events: &mut Vec<TreeEvent>) {
        // Rows are the matches and the way to them, and a way ends in a match.
        let found = model.search.find(model.tree.assembly(), &self.query);
        if let Some(item) = found.and_then(|found| found.matches.next(0)) {
            self.choose(model, item, Modifiers::NONE, events);
        }
    }

    fn list(&mut self, ui: &mut Ui, list: Id, model: &mut TreeModel<'_>, events: &mut Vec<TreeEvent>) {
        let background =
            ui.interact(ui.available_rect_before_wrap(), list, Sense::focusable_noninteractive());
        background.widget_info(|| WidgetInfo::labeled(egui::Role::Tree, true, "Assembly tree"));
        if background.has_focus() {
            self.keys(ui, list, model, events);
        }
        self.pointed = None;
        let scroll = self.scroll_area(model.tree);
        let deeds = ui.scope(|ui| {
            ui.spacing_mut().item_spacing = Vec2::new(4.0, 0.0);
            let output = scroll.show_rows(ui, ROW_HEIGHT, model.tree.rows().len(), |ui, rows| {
                let rows = model.tree.rows().get(rows).unwrap_or_default();
                let deeds = rows.iter().filter_map(|&item| {
                    let is_cursor = background.has_focus() && self.cursor == Some(item);
                    let shown = row::show(ui, list, model, item, is_cursor);
                    self.pointed = self.pointed.or(shown.is_pointed_at.then_some(item));
                    shown.deed.map(|deed| (item, deed))
                });
                deeds.collect::<Vec<_>>()
            });
            self.offset = output.state.clamped_offset().y;
            self.height = output.inner_rect.height();
            output.inner
        });
        for (item, deed) in deeds.inner {
            self.follow(&background, model, item, deed, events);
        }
    }

    fn scroll_area(&mut self, tree: &Tree) -> ScrollArea {
        let area = ScrollArea::vertical().auto_shrink(false);
        let wish = self.scroll_to.take().and_then(|item| tree.row_of(item));
        match wish.and_then(|row| self.offset_for(row)) {
            Some(offset) => area.vertical_scroll_offset(offset),
            None => area,
        }
    }

    /// Where to scroll so that a row is in sight; nowhere if it is already.
    fn offset_for(&self, row: usize) -> Option<f32> {
        let top = row as f32 * ROW_HEIGHT;
        let last = (self.height - ROW_HEIGHT).max(0.0);
        let (from, to) = (self.offset, self.offset + last);
        if (from..=to).contains(&top) {
            return None;
        }
        let is_next = top > from - 2.0 * ROW_HEIGHT && top < to + 2.0 * ROW_HEIGHT;
        let offset = match (is_next, top < from) {
            (true, true) => top,
            (true, false) => top - last,
            (false, _) => top - (last / 2.0 / ROW_HEIGHT).floor() * ROW_HEIGHT,
        };
        Some(offset.max(0.0))
    }

    fn follow(
        &mut self,
        background: &Response,
        model: &mut TreeModel<'_>,
        item: u32,
        deed: RowDeed,
        events: &mut Vec<TreeEvent>,
    ) {
        match deed {
            RowDeed::Arrow => model.tree.toggle(item),
            RowDeed::Eye => events.push(self.eye(model, item)),
            RowDeed::Click(modifiers) => {
                background.request_focus();
                self.choose(model, item, modifiers, events);
            }
            RowDeed::DoubleClick => events.push(TreeEvent::Fit(model.target(item))),
            RowDeed::SecondaryClick => {
                background.request_focus();
                if model.visibility.selected_share(item) != Share::All {
                    self.choose(model, item, Modifiers::NONE, events);
                }
            }
            RowDeed::ExpandBelow => model.tree.expand_below(item),
            RowDeed::CollapseAll => {
                model.tree.collapse_all();
                self.offset = 0.0;
            }
            RowDeed::Event(event) => events.push(event),
        }
    }

    /// What the eye of an item does: all of it is hidden, or else all is shown.
    fn eye(&self, model: &TreeModel<'_>, item: u32) -> TreeEvent {
        let leaves = model.visibility.set_of_item(item);
        match model.visibility.shown_share(item) {
            Share::All => TreeEvent::Hide(leaves),
            _ => TreeEvent::Show(leaves),
        }
    }

    /// Selects an item: alone, with all from the anchor to it (shift), added or taken away (command), or both.
    fn choose(
        &mut self,
        model: &TreeModel<'_>,
        item: u32,
        modifiers: Modifiers,
        events: &mut Vec<TreeEvent>,
    ) {
        let anchor = self.anchor.filter(|_| modifiers.shift).unwrap_or(item);
        let chosen = rows_between(model.tree, anchor, item);
        let leaves = if modifiers.command {
            let mut leaves = model.visibility.selected().clone();
            let is_taken_away = !modifiers.shift && model.visibility.selected_share(item) == Share::All;
            if is_taken_away {
                leaves.subtract(&chosen)
            } else {
                leaves.union(&chosen)
            }
            leaves
        } else {
            chosen
        };
        (self.cursor, self.anchor, self.scroll_to) = (Some(item), Some(anchor), Some(item));
        events.push(TreeEvent::Select(leaves));
    }
}

/// The leaves of all rows from one item to another, in either direction.
fn rows_between(tree: &Tree, one: u32, other: u32) -> Bits {
    let rows = tree.rows();
    let [from, to] = [one.min(other), one.max(other)].map(|item| rows.partition_point(|&row| row < item));
    let items = rows.get(from..(to + 1).min(rows.len())).unwrap_or_default();
    let mut leaves = Bits::new(tree.assembly().leaves());
    let mut done = 0;
    for own in items.iter().map(|&item| tree.assembly().leaves_of(item)) {
        // What is below a row has been taken with it.
        if own.end > done {
            leaves.insert_range(own.start.max(done)..own.end);
            done = own.end;
        }
    }
    leaves
}

#[cfg(test)]
mod tests;
