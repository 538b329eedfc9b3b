//! Which panels are where, and what belongs to them: a document and the settings in, what the user did out.

mod route;
mod saved;

use egui::{TextureId, Ui, WidgetText};
use egui_tiles::{Behavior, SimplificationOptions, TileId, Tiles, Tree, UiResponse};

use super::actions::Action;
use super::document::Document;
use super::measure::{Measuring, Mode};
use super::painter::Measured;
use super::panels::measure::{self as measure_panel, MeasureEvent};
use super::panels::paths::Want;
use super::panels::picture::{PicturePanel, Tool};
use super::panels::tree::{TreeEvent, TreeModel, TreePanel};
use super::panels::{cuts, gizmo, look, properties, streaming};
use super::settings::Settings;
pub use route::Route;
pub use saved::Arrangement;

/// A panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Pane {
    /// The assembly.
    Tree,
    /// The picture.
    Picture,
    /// What is selected.
    Properties,
    /// Colours, edges, depth.
    Look,
    /// What cuts.
    Cuts,
    /// What was measured.
    Measure,
    /// Bookmarks and paths.
    Route,
    /// What is sent.
    Streaming,
}

impl Pane {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Tree,
        Self::Picture,
        Self::Properties,
        Self::Look,
        Self::Cuts,
        Self::Measure,
        Self::Route,
        Self::Streaming,
    ];

    /// What it is called.
    pub fn title(self) -> &'static str {
        match self {
            Self::Tree => "Assembly",
            Self::Picture => "Picture",
            Self::Properties => "Properties",
            Self::Look => "Look",
            Self::Cuts => "Sections",
            Self::Measure => "Measure",
            Self::Route => "Bookmarks",
            Self::Streaming => "Streaming",
        }
    }
}

/// What panels ask of the rest.
#[derive(Debug, Clone, Default)]
pub struct Asked {
    /// A cap that needs a new renderer was changed.
    pub caps_changed: bool,
    /// A file is wanted.
    pub want: Option<Want>,
    /// Something else is asked for.
    pub act: Option<Action>,
    /// To be said.
    pub said: Vec<String>,
    /// To be said until it was seen.
    pub failed: Vec<String>,
}

/// The panels and what they remember.
pub struct Layout {
    tiles: Tree<Pane>,
    shows_panels: bool,
    /// The picture.
    picture: PicturePanel,
    /// The assembly.
    pub tree: TreePanel,
    /// What was measured.
    pub measuring: Measuring,
    /// Bookmarks and the path that is recorded.
    pub route: Route,
    wants_search: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self {
            tiles: first_tiles(),
            shows_panels: true,
            picture: PicturePanel::default(),
            tree: TreePanel::default(),
            measuring: Measuring::default(),
            route: Route::default(),
            wants_search: false,
        }
    }
}

/// The tree, the picture, and all other panels as tabs to the right of it.
fn first_tiles() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let tree = tiles.insert_pane(Pane::Tree);
    let picture = tiles.insert_pane(Pane::Picture);
    let above = [Pane::Properties, Pane::Measure, Pane::Route].map(|pane| tiles.insert_pane(pane));
    let below = [Pane::Look, Pane::Cuts, Pane::Streaming].map(|pane| tiles.insert_pane(pane));
    let [above, below] = [above, below].map(|panes| tiles.insert_tab_tile(panes.to_vec()));
    let right = tiles.insert_vertical_tile(vec![above, below]);
    let root = tiles.insert_horizontal_tile(vec![tree, picture, right]);
    if let Some(egui_tiles::Tile::Container(egui_tiles::Container::Linear(linear))) = tiles.get_mut(root) {
        for (tile, share) in [(tree, 1.1), (picture, 3.6), (right, 1.5)] {
            linear.shares.set_share(tile, share);
        }
    }
    Tree::new(egui::Id::unique("panels"), root, tiles)
}

impl Layout {
    /// Panels as they were when that was kept; as at first where it makes no sense.
    pub fn restored(kept: Option<&Arrangement>) -> Self {
        match kept.and_then(|kept| Some((kept.tree()?, kept.shows_panels))) {
            Some((tiles, shows_panels)) => Self { tiles, shows_panels, ..Self::default() },
            None => Self::default(),
        }
    }

    /// What is to be kept of it.
    pub fn arrangement(&self) -> Option<Arrangement> {
        Arrangement::of(&self.tiles, self.shows_panels)
    }

    /// Panels as they were at first.
    pub fn reset(&mut self) {
        (self.tiles, self.shows_panels) = (first_tiles(), true);
    }

    /// With the picture alone, or with all panels.
    pub fn toggle_panels(&mut self) {
        self.shows_panels = !self.shows_panels;
    }

    /// Brings a panel to the front.
    pub fn bring(&mut self, pane: Pane) {
        self.shows_panels = true;
        if let Some(tile) = self.tiles.tiles.find_pane(&pane) {
            self.tiles.make_active(|id, _| id == tile);
        }
    }

    /// Something was selected in the picture: its row comes into sight.
    pub fn reveal(&mut self, document: &mut Document, instance: u32) {
        self.tree.reveal(&mut document.tree, instance);
    }

    /// A point was picked to be measured from.
    pub fn measured(&mut self, measured: &Measured) {
        self.bring(Pane::Measure);
        match (self.measuring.mode(), &measured.chain) {
            (Mode::Distance, _) => drop(self.measuring.pick(measured.picked)),
            (Mode::Edge, Some(chain)) => {
                let picked = measured.picked;
                self.measuring.pick_edge(chain, picked.point, picked.error, picked.is_full);
            }
            (Mode::Edge, None) => {}
        }
    }

    /// What the mouse does, for the sheet of keys.
    pub fn mouse_table(&self, settings: &Settings) -> Vec<(String, String)> {
        let drags = settings.mouse.sheet(false).into_iter().map(|(hand, what)| (hand, what.to_owned()));
        let clicks = [
            ("Click", "Select"),
            ("Ctrl or shift + click", "Select more, or no longer"),
            ("Double click", "Fit the part"),
            ("Alt + click", "Cut there"),
        ];
        drags.chain(clicks.map(|(hand, what)| (hand.to_owned(), what.to_owned()))).collect()
    }

    /// Does something that belongs to a panel.
    pub fn act(&mut self, document: &mut Document, action: Action) {
        let visibility = &mut document.visibility;
        match action {
            Action::Hide => document.to_selected(|visibility, selected| visibility.hide(selected)),
            Action::Isolate => document.to_selected(|visibility, selected| visibility.isolate(selected)),
            Action::Ghost => document.to_selected(|visibility, selected| visibility.ghost(selected)),
            Action::ShowAll => visibility.show_all(),
            // A first point that waits for the second goes first.
            Action::SelectNone if self.measuring.cancel() => {}
            Action::SelectNone => {
                visibility.select(visibility.set_of_instance(None));
                document.watched = None;
            }
            Action::SelectAll => {
                visibility.select(visibility.set_of_instance(None));
                visibility.invert_selection();
            }
            Action::InvertSelection => visibility.invert_selection(),
            Action::Undo => drop(visibility.undo()),
            Action::Redo => drop(visibility.redo()),
            Action::Search => {
                self.bring(Pane::Tree);
                self.wants_search = true;
            }
            Action::AddBookmark => {
                self.bring(Pane::Route);
                self.route.add_bookmark(document, "");
            }
            Action::RecordKey => self.route.record(document),
            _ => {}
        }
    }

    /// Shows all panels.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        document: &mut Document,
        settings: &mut Settings,
        texture: Option<TextureId>,
        tool: Tool,
    ) -> Asked {
        let mut panels = Panels {
            picture: &mut self.picture,
            tree: &mut self.tree,
            measuring: &mut self.measuring,
            route: &mut self.route,
            wants_search: std::mem::take(&mut self.wants_search),
            document,
            settings,
            texture,
            tool,
            asked: Asked::default(),
        };
        if self.shows_panels {
            self.tiles.ui(&mut panels, ui);
        } else {
            panels.picture(ui);
        }
        let asked = panels.asked;
        document.point_at_item(self.tree.take_pointed());
        asked
    }
}

/// What the panels work on while they are shown.
struct Panels<'a> {
    picture: &'a mut PicturePanel,
    tree: &'a mut TreePanel,
    measuring: &'a mut Measuring,
    route: &'a mut Route,
    wants_search: bool,
    document: &'a mut Document,
    settings: &'a mut Settings,
    texture: Option<TextureId>,
    tool: Tool,
    asked: Asked,
}

impl Panels<'_> {
    fn picture(&mut self, ui: &mut Ui) {
        let habits = (self.tool, self.settings.mouse);
        let (area, chosen) = self.picture.show(ui, self.document, self.texture, habits);
        self.asked.act = chosen;
        let turned = self.document.navigation.camera().world_from_view;
        match gizmo::show(ui, area, turned, self.settings.up) {
            Some(gizmo::GizmoEvent::View(view)) => self.document.view(view),
            Some(gizmo::GizmoEvent::Orbit(by)) => self.document.orbit(by),
            None => {}
        }
        measure_panel::paint(ui, area, self.measuring, self.document, &self.settings.units);
    }

    fn tree(&mut self, ui: &mut Ui) {
        if std::mem::take(&mut self.wants_search) {
            self.tree.focus_search();
        }
        let Document { tree, visibility, loaded, .. } = &mut *self.document;
        let mut model = TreeModel { tree, visibility, search: &loaded.search, names: loaded.scene.as_ref() };
        for event in self.tree.show(ui, &mut model) {
            self.take_tree_event(event);
        }
    }

    fn take_tree_event(&mut self, event: TreeEvent) {
        if let TreeEvent::Fit(leaves) = &event {
            let bounds = self.document.bounds_of(self.document.visibility.instances_of(leaves));
            let aspect = self.document.aspect();
            return self.document.navigation.fit(&bounds, aspect);
        }
        if let TreeEvent::Select(leaves) = &event {
            let first = leaves.iter().next();
            let assembly = &self.document.loaded.assembly;
            self.document.watched = first.map(|leaf| assembly.instances_of_leaf(leaf).start);
        }
        event.apply(&mut self.document.visibility);
    }

    fn properties(&mut self, ui: &mut Ui) {
        let reading = self.document.frame.as_ref().and_then(|frame| frame.reading);
        let of = properties::Selected {
            scene: self.document.scene(),
            count: self.document.visibility.selected().iter().count(),
            instance: self.document.watched,
            reading,
            bounds: self.document.bounds_of_watched(),
            counts: self.document.loaded.counts,
            units: self.settings.units,
        };
        properties::show(ui, &of);
    }

    fn measure(&mut self, ui: &mut Ui) {
        let shown = measure_panel::Shown {
            units: self.settings.units,
            is_full_detail: self.document.is_full_detail,
            selected: self.document.visibility.selected().iter().take(1).count(),
        };
        for event in measure_panel::show(ui, self.measuring, &shown) {
            self.take_measure_event(ui, event);
        }
    }

    fn take_measure_event(&mut self, ui: &Ui, event: MeasureEvent) {
        match event {
            MeasureEvent::Mode(mode) => self.measuring.set_mode(mode),
            MeasureEvent::SizeOfSelection => {
                let selected = self.document.selected();
                self.measuring.size(self.document.scene(), &selected);
            }
            MeasureEvent::Units(units) => self.settings.units = units,
            MeasureEvent::FullDetail(is_full) => self.document.is_full_detail = is_full,
            MeasureEvent::Cancel => drop(self.measuring.cancel()),
            MeasureEvent::Show(number) => self.document.show_measurement(self.measuring, number),
            MeasureEvent::Copy(number) => {
                let found = self.measuring.list().iter().find(|one| one.number == number);
                let lines = found.map(|one| one.lines(&self.settings.units)).unwrap_or_default();
                let text: Vec<String> = lines.iter().map(|(name, value)| format!("{name} {value}")).collect();
                ui.copy_text(text.join("\n"));
            }
            MeasureEvent::Remove(number) => self.measuring.remove(number),
            MeasureEvent::Clear => self.measuring.clear(),
        }
    }

    fn pane(&mut self, ui: &mut Ui, pane: Pane) {
        match pane {
            Pane::Picture | Pane::Tree => {}
            Pane::Properties => self.properties(ui),
            Pane::Look => look::show(ui, &mut self.document.look, self.settings),
            Pane::Cuts => {
                let bounds = *self.document.scene().bounds();
                let forward = self.document.navigation.camera().forward();
                cuts::show(ui, &mut self.document.cuts, (&bounds, &self.settings.units), forward);
            }
            Pane::Measure => self.measure(ui),
            Pane::Route => {
                let asked = self.route.show(ui, self.document);
                self.asked.want = self.asked.want.or(asked);
            }
            Pane::Streaming => {
                let changed = streaming::show(ui, self.settings, &self.document.history);
                self.asked.caps_changed |= changed.caps;
            }
        }
    }
}

/// A panel's own background, with room around what is in it.
fn filled(ui: &Ui, margin: f32) -> egui::Frame {
    ui.painter().rect_filled(ui.max_rect(), 0.0, ui.visuals().panel_fill);
    egui::Frame::NONE.inner_margin(margin)
}

impl Behavior<Pane> for Panels<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _: TileId, pane: &mut Pane) -> UiResponse {
        match *pane {
            Pane::Picture => self.picture(ui),
            Pane::Tree => drop(filled(ui, 4.0).show(ui, |ui| self.tree(ui))),
            pane => {
                filled(ui, 8.0).show(ui, |ui| {
                    egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| self.pane(ui, pane));
                });
            }
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> WidgetText {
        pane.title().into()
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: false, ..SimplificationOptions::default() }
    }
}
