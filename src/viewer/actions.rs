//! Everything that can be done from a menu, by a key or from the palette: one list, so that none of the three lacks any.

use egui::{Key, KeyboardShortcut, Modifiers};

use crate::frame::colour_by::ColourBy;
use crate::passes::draw::Edges;
use crate::scene::views::StandardView;

/// Something to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Choose a file to open.
    Open,
    /// Close the model.
    Close,
    /// Save the picture without the interface.
    SavePicture,
    /// Save all of the window.
    SaveWindow,
    /// Save a path once round the model, for `fly`.
    SaveTurntable,
    /// Save pictures from once round the model.
    SaveTurntablePictures,
    /// End.
    Quit,
    /// Show all of the model.
    FitAll,
    /// Show all that is selected.
    FitSelection,
    /// Look from a side.
    View(StandardView),
    /// With perspective or without.
    TogglePerspective,
    /// Walk with the keys.
    ToggleFly,
    /// Keep what is drawn as it was selected for here.
    ToggleFreeze,
    /// Hide what is selected.
    Hide,
    /// Hide all but what is selected.
    Isolate,
    /// See through what is selected.
    Ghost,
    /// Show everything.
    ShowAll,
    /// Select everything that is shown.
    SelectAll,
    /// Select nothing.
    SelectNone,
    /// Select what is not selected.
    InvertSelection,
    /// Take back what was hidden, shown or ghosted last.
    Undo,
    /// Do it again.
    Redo,
    /// What colours tell.
    ColourBy(ColourBy),
    /// What is drawn as lines.
    Edges(Edges),
    /// Shade by depth or not.
    ToggleDepthCue,
    /// Cut through the middle of the model, or do not cut.
    ToggleSection,
    /// Measure from point to point.
    Measure,
    /// Record the camera as the next key of a path.
    RecordKey,
    /// Add a bookmark.
    AddBookmark,
    /// Search in the assembly.
    Search,
    /// Choose something to do by its name.
    Palette,
    /// List the keys.
    Keys,
    /// Panels as they were at first.
    ResetPanels,
    /// Without panels, or with them.
    TogglePanels,
    /// From light to dark and back.
    ToggleTheme,
    /// All of the screen.
    ToggleFullscreen,
    /// What this program is.
    About,
}

/// A menu.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Menu {
    /// Files.
    File,
    /// What is shown and hidden.
    Edit,
    /// From where.
    View,
    /// How.
    Look,
    /// What else.
    Help,
}

impl Menu {
    /// From left to right.
    pub const ALL: [Self; 5] = [Self::File, Self::Edit, Self::View, Self::Look, Self::Help];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::File => "File",
            Self::Edit => "Edit",
            Self::View => "View",
            Self::Look => "Look",
            Self::Help => "Help",
        }
    }
}

/// An action as people see it.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// What is done.
    pub action: Action,
    /// Where it is listed.
    pub menu: Menu,
    /// What it is called.
    pub name: &'static str,
    /// By which key.
    pub key: Option<KeyboardShortcut>,
    /// Whether it needs a model.
    pub needs_model: bool,
}

const fn key(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::NONE, key))
}

const fn ctrl(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND, key))
}

const fn ctrl_shift(key: Key) -> Option<KeyboardShortcut> {
    Some(KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), key))
}

const fn entry(menu: Menu, action: Action, name: &'static str, key: Option<KeyboardShortcut>) -> Entry {
    Entry { action, menu, name, key, needs_model: true }
}

const fn always(menu: Menu, action: Action, name: &'static str, key: Option<KeyboardShortcut>) -> Entry {
    Entry { action, menu, name, key, needs_model: false }
}

/// All of them, in the order of the menus.
pub const ENTRIES: &[Entry] = &[
    always(Menu::File, Action::Open, "Open…", ctrl(Key::O)),
    entry(Menu::File, Action::Close, "Close model", ctrl(Key::W)),
    entry(Menu::File, Action::SavePicture, "Save picture…", ctrl(Key::S)),
    always(Menu::File, Action::SaveWindow, "Save picture of the window…", ctrl_shift(Key::S)),
    entry(Menu::File, Action::SaveTurntable, "Save turntable path…", None),
    entry(Menu::File, Action::SaveTurntablePictures, "Save turntable pictures…", None),
    always(Menu::File, Action::Quit, "Quit", ctrl(Key::Q)),
    entry(Menu::Edit, Action::Undo, "Undo hiding and ghosting", ctrl(Key::Z)),
    entry(Menu::Edit, Action::Redo, "Redo hiding and ghosting", ctrl_shift(Key::Z)),
    entry(Menu::Edit, Action::Hide, "Hide selected", key(Key::H)),
    entry(Menu::Edit, Action::Isolate, "Isolate selected", key(Key::I)),
    entry(Menu::Edit, Action::Ghost, "Ghost selected", key(Key::G)),
    entry(Menu::Edit, Action::ShowAll, "Show all", Some(KeyboardShortcut::new(Modifiers::SHIFT, Key::H))),
    entry(Menu::Edit, Action::SelectAll, "Select all that is shown", ctrl(Key::A)),
    entry(Menu::Edit, Action::SelectNone, "Select nothing", key(Key::Escape)),
    entry(Menu::Edit, Action::InvertSelection, "Invert selection", ctrl(Key::I)),
    entry(Menu::Edit, Action::Search, "Search in the assembly", ctrl(Key::F)),
    entry(Menu::View, Action::FitAll, "Fit all", key(Key::F)),
    entry(
        Menu::View,
        Action::FitSelection,
        "Fit selected",
        Some(KeyboardShortcut::new(Modifiers::SHIFT, Key::F)),
    ),
    entry(Menu::View, Action::View(StandardView::Iso), "From the corner (isometric)", key(Key::Num0)),
    entry(Menu::View, Action::View(StandardView::Front), "From the front", key(Key::Num1)),
    entry(Menu::View, Action::View(StandardView::Back), "From behind", key(Key::Num2)),
    entry(Menu::View, Action::View(StandardView::Left), "From the left", key(Key::Num3)),
    entry(Menu::View, Action::View(StandardView::Right), "From the right", key(Key::Num4)),
    entry(Menu::View, Action::View(StandardView::Top), "From above", key(Key::Num5)),
    entry(Menu::View, Action::View(StandardView::Bottom), "From below", key(Key::Num6)),
    entry(Menu::View, Action::TogglePerspective, "Perspective or parallel", key(Key::P)),
    entry(Menu::View, Action::ToggleFly, "Fly with W A S D Q E", key(Key::Backtick)),
    entry(Menu::View, Action::ToggleFreeze, "Freeze the selection of detail", key(Key::Space)),
    entry(Menu::View, Action::AddBookmark, "Add a bookmark", ctrl(Key::B)),
    entry(Menu::View, Action::RecordKey, "Record a key of a path", key(Key::K)),
    always(Menu::View, Action::TogglePanels, "Panels", key(Key::Tab)),
    always(Menu::View, Action::ResetPanels, "Reset layout: panels as they were at first", None),
    always(Menu::View, Action::ToggleFullscreen, "Full screen", key(Key::F11)),
    entry(Menu::Look, Action::ToggleSection, "Section", key(Key::X)),
    entry(Menu::Look, Action::Measure, "Measure", key(Key::M)),
    entry(Menu::Look, Action::Edges(Edges::None), "No edges", key(Key::Num7)),
    entry(Menu::Look, Action::Edges(Edges::Features), "Feature edges", key(Key::Num8)),
    entry(Menu::Look, Action::Edges(Edges::All), "Wireframe", key(Key::Num9)),
    entry(Menu::Look, Action::ToggleDepthCue, "Shade by depth", key(Key::O)),
    entry(Menu::Look, Action::ColourBy(ColourBy::Material), "Colour by material", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Part), "Colour by part", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Instance), "Colour by instance", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Tier), "Colour by tier", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Budget), "Colour by budget", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Residency), "Colour by residency", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Age), "Colour by age", None),
    entry(Menu::Look, Action::ColourBy(ColourBy::Closure), "Colour by closure", None),
    always(Menu::Look, Action::ToggleTheme, "Light or dark", None),
    always(Menu::Help, Action::Palette, "What can be done…", ctrl(Key::P)),
    always(Menu::Help, Action::Keys, "Keys and mouse", key(Key::F1)),
    always(Menu::Help, Action::About, "About collapsar", None),
];

impl Entry {
    /// The key as people read it; nothing if there is none.
    pub fn key_text(&self, context: &egui::Context) -> String {
        self.key.map_or(String::new(), |key| context.format_shortcut(&key))
    }

    /// The button of a menu for it.
    pub fn button(&self, context: &egui::Context) -> egui::Button<'static> {
        egui::Button::new(self.name).shortcut_text(self.key_text(context))
    }
}

/// What keys that nobody types text with ask for, in the order in which they were pressed. What comes after one that opens
/// a field to type in is typed text, however late it is looked at.
pub fn pressed(context: &egui::Context) -> Vec<Action> {
    if context.egui_wants_keyboard_input() {
        return Vec::new();
    }
    let actions = context.input_mut(|input| {
        let mut actions: Vec<Action> = Vec::new();
        input.events.retain(|event| {
            let types = actions.last().is_some_and(|action| action.wants_text());
            let found = if types { None } else { action_of(event) };
            actions.extend(found);
            found.is_none()
        });
        actions
    });
    // Tab asks for something here: to the interface it is the wish to move on to the next button, which would have the keys.
    if !actions.is_empty() {
        context.memory_mut(|memory| memory.move_focus(egui::FocusDirection::None));
    }
    actions
}

/// What the press of a key asks for.
fn action_of(event: &egui::Event) -> Option<Action> {
    let egui::Event::Key { key, pressed: true, modifiers, .. } = event else { return None };
    let is_it = |shortcut: KeyboardShortcut| {
        shortcut.logical_key == *key && modifiers.matches_exact(shortcut.modifiers)
    };
    ENTRIES.iter().find(|entry| entry.key.is_some_and(is_it)).map(|entry| entry.action)
}

impl Action {
    /// Whether a field to type in comes of it.
    fn wants_text(self) -> bool {
        use Action::{Open, Palette, SavePicture, SaveTurntable, SaveTurntablePictures, SaveWindow, Search};
        matches!(
            self,
            Search | Palette | Open | SavePicture | SaveWindow | SaveTurntable | SaveTurntablePictures
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_action_name_or_key_is_listed_twice() {
        let unique = |count: usize| assert_eq!(count, ENTRIES.len());
        unique(ENTRIES.iter().map(|entry| entry.action).collect::<HashSet<_>>().len());
        unique(ENTRIES.iter().map(|entry| entry.name).collect::<HashSet<_>>().len());
        let keys: Vec<_> = ENTRIES.iter().filter_map(|entry| entry.key).collect();
        let distinct: HashSet<String> = keys.iter().map(|key| format!("{key:?}")).collect();
        assert_eq!(distinct.len(), keys.len());
    }

    #[test]
    fn every_side_and_every_colouring_is_listed() {
        let has = |action| assert!(ENTRIES.iter().any(|entry| entry.action == action), "{action:?}");
        StandardView::ALL.into_iter().map(Action::View).for_each(has);
        ColourBy::ALL.into_iter().map(Action::ColourBy).for_each(has);
    }
}
