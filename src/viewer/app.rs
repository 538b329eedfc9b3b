//! The viewer without its window: everything that is laid out, and what it makes of what the user does.
//!
//! The window gives it a graphics card, the time and the texture of the newest picture, and does what it asks for: to
//! end, to fill the screen, to save itself.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui::{Panel, TextureId, Ui};

use super::actions::{self, Action, ENTRIES, Menu};
use super::document::{Document, Happened};
use super::layout::Layout;
use super::loader::Loader;
use super::messages::{Attempt, Messages};
use super::painter::Wake;
use super::panels::palette::{self, Palette};
use super::panels::paths::{self, PathDialog, Want};
use super::panels::picture::Tool;
use super::panels::start;
use super::settings::{Settings, Store, Theme, first_budget};
use crate::bake;
use crate::bake::beside::{Beside, beside};
use crate::gpu::Gpu;
use crate::gpu::target::Target;
use crate::passes::draw::Edges;

/// What the window is asked to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ask {
    /// End.
    Quit,
    /// From a window to the whole screen, or back.
    ToggleFullscreen,
    /// Write a picture of itself.
    SaveWindow(PathBuf),
    /// Make another device: the old one was lost.
    NewDevice,
}

/// The viewer.
pub struct App {
    /// What is remembered.
    pub settings: Settings,
    /// The model, if one is open.
    pub document: Option<Document>,
    /// What is being said.
    pub messages: Messages,
    /// What the mouse is for.
    pub tool: Tool,
    /// Which panels are where.
    pub layout: Layout,
    store: Store,
    /// Whether nothing was ever saved, and no graphics card given yet: then the budget follows the card.
    is_first_start: bool,
    /// Whether the file of settings was understood; one that was not stays as it is.
    may_save: bool,
    saved: Settings,
    loader: Option<Loader>,
    gpu: Option<Arc<Gpu>>,
    wake: Wake,
    palette: Option<Palette>,
    dialog: Option<PathDialog>,
    shows_keys: bool,
    shows_about: bool,
    asks: Vec<Ask>,
}

impl App {
    /// Reads the settings of a store. `wake` is called from other threads whenever there is news.
    pub fn new(store: Store, wake: Wake) -> Self {
        let mut messages = Messages::default();
        let loaded = store.load();
        let may_save = loaded.is_ok();
        let is_first_start = !store.has_settings();
        let settings = loaded.unwrap_or_else(|error| {
            messages.fail(Attempt::Other, error.to_string());
            Settings::default()
        });
        Self {
            saved: settings.clone(),
            document: None,
            messages,
            tool: Tool::default(),
            layout: Layout::restored(settings.layout.as_ref()),
            settings,
            store,
            may_save,
            is_first_start,
            loader: None,
            gpu: None,
            wake,
            palette: None,
            dialog: None,
            shows_keys: false,
            shows_about: false,
            asks: Vec::new(),
        }
    }

    /// Gives it a graphics card: the first, or another one after the last was lost.
    pub fn set_gpu(&mut self, gpu: Arc<Gpu>) {
        if std::mem::take(&mut self.is_first_start) {
            self.settings.budget_vertices = first_budget(gpu.adapter_info.device_type);
        }
        if let Some(document) = &mut self.document {
            document.restart(&gpu, &self.settings);
        }
        self.gpu = Some(gpu);
    }

    /// Opens a file, in the place of what is open.
    pub fn open(&mut self, file: &Path) {
        let wake = Arc::clone(&self.wake);
        self.loader = Some(Loader::new(file, move || wake()));
    }

    /// Whether a file is being opened.
    pub fn is_loading(&self) -> bool {
        self.loader.is_some()
    }

    /// The newest picture, if there is one.
    pub fn picture(&self) -> Option<&Arc<Target>> {
        self.document.as_ref()?.frame.as_ref().map(|frame| &frame.target)
    }

    /// What the window is asked to do since the last call.
    pub fn asks(&mut self) -> Vec<Ask> {
        std::mem::take(&mut self.asks)
    }

    /// Takes what other threads have done. To be called before every layout.
    pub fn poll(&mut self) {
        self.poll_loader();
        let happened = self.document.as_mut().map(Document::poll).unwrap_or_default();
        for event in happened {
            self.take(event);
        }
    }

    fn poll_loader(&mut self) {
        let Some(finished) = self.loader.as_mut().and_then(Loader::finished) else { return };
        let file = self.loader.take().map(|loader| loader.file().to_owned()).unwrap_or_default();
        let loaded = match finished {
            Ok(Some(loaded)) => loaded,
            Ok(None) => return self.messages.say(stopped(&file)),
            Err(why) => return self.say_not_opened(&file, why),
        };
        self.messages.done(Attempt::Open);
        let Some(gpu) = &self.gpu else { return };
        self.settings.opened(&loaded.file);
        // The old one's memory goes before the new one takes some.
        self.document = None;
        self.document = Some(Document::new(loaded, gpu, &self.settings, Arc::clone(&self.wake)));
        let file = self.document.as_ref().map(|document| document.loaded.file.clone()).unwrap_or_default();
        self.layout.route.model_opened(&self.store, &file);
        self.save_settings();
    }

    fn say_not_opened(&mut self, file: &Path, why: String) {
        let is_gone = file.try_exists().is_ok_and(|exists| !exists);
        let text = if is_gone && self.settings.forget(file) {
            self.save_settings();
            let file = file.display();
            format!(
                "the file was moved or deleted, and is no longer among those opened last; open it where it is now: {file}"
            )
        } else {
            why
        };
        self.messages.fail(Attempt::Open, text);
    }

    /// What the window is called.
    pub fn title(&self) -> String {
        match &self.document {
            Some(document) => {
                let name = document.loaded.file.file_name().unwrap_or_default();
                format!("{} - collapsar", name.to_string_lossy())
            }
            None => "collapsar".to_owned(),
        }
    }

    fn take(&mut self, event: Happened) {
        match event {
            Happened::Said(text) => self.messages.say(text),
            Happened::Saved(saved) => self.say_saved(saved),
            Happened::Failed(why) => self.messages.fail(Attempt::Other, why),
            Happened::DeviceLost(why) => {
                self.messages.say(format!("The graphics device was lost ({why}); everything was made anew."));
                self.asks.push(Ask::NewDevice);
            }
            Happened::Selected(instance) => {
                if let Some(document) = &mut self.document {
                    self.layout.reveal(document, instance);
                }
            }
            Happened::Measured(measured) => self.layout.measured(&measured),
        }
    }

    fn save_settings(&mut self) {
        self.settings.layout = self.layout.arrangement();
        if self.settings != self.saved && self.may_save {
            self.saved = self.settings.clone();
            if let Err(error) = self.store.save(&self.settings) {
                self.messages.fail(Attempt::Other, error.to_string());
            }
        }
    }

    /// The window is about to close: what is to be remembered is written.
    pub fn close(&mut self) {
        self.save_settings();
    }

    /// Lays everything out, and wishes for the next frame. `texture` is the picture's.
    pub fn show(&mut self, ui: &mut Ui, texture: Option<TextureId>) {
        let context = ui.ctx().clone();
        self.apply_look(&context);
        self.keys_and_drops(&context);
        Panel::top("menu").show(ui, |ui| self.menu_bar(ui));
        Panel::bottom("status").show(ui, |ui| self.status_bar(ui));
        match (&mut self.document, &self.loader) {
            (Some(document), _) => {
                let asked = self.layout.show(ui, document, &mut self.settings, texture, self.tool);
                self.after_panels(asked);
            }
            (None, loader) => {
                if let Some(file) = start::show(ui, &self.settings.recent, loader.is_some()) {
                    match file {
                        start::Chosen::File(file) => self.open(&file),
                        start::Chosen::Another => self.act(Action::Open),
                    }
                }
            }
        }
        self.floating(&context);
        self.move_on(&context);
    }

    /// Lets time pass and wishes for a frame.
    fn move_on(&mut self, context: &egui::Context) {
        let seconds = f64::from(context.input(|input| input.stable_dt)).min(0.1);
        if let Some(document) = &mut self.document {
            let is_moving =
                document.advance(&self.settings, seconds) | self.layout.route.advance(document, seconds);
            document.wish(&self.settings);
            if is_moving {
                context.request_repaint();
            }
        }
        if self.loader.is_some() {
            context.request_repaint_after(std::time::Duration::from_millis(100));
        }
    }

    fn apply_look(&self, context: &egui::Context) {
        context.set_theme(match self.settings.theme {
            Theme::System => egui::ThemePreference::System,
            Theme::Light => egui::ThemePreference::Light,
            Theme::Dark => egui::ThemePreference::Dark,
        });
        context.set_zoom_factor(self.settings.zoom);
    }

    fn keys_and_drops(&mut self, context: &egui::Context) {
        let dropped =
            context.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(file) = dropped {
            self.open(&file);
        }
        if self.closes_by_escape(context) {
            return;
        }
        if self.palette.is_none() && self.dialog.is_none() && self.tool != Tool::Fly {
            actions::pressed(context).into_iter().for_each(|action| self.act(action));
        } else if self.tool == Tool::Fly {
            let is_over = context.input(|input| {
                input.key_pressed(egui::Key::Escape) || input.key_pressed(egui::Key::Backtick)
            });
            self.tool = if is_over { Tool::Hand } else { self.tool };
        }
    }

    /// Escape closes what is open on top, before it means anything else; says whether that is so.
    fn closes_by_escape(&mut self, context: &egui::Context) -> bool {
        if !context.input(|input| input.key_pressed(egui::Key::Escape)) || context.egui_wants_keyboard_input()
        {
            return false;
        }
        if egui::Popup::is_any_open(context) {
            // It closes itself.
            return true;
        }
        let is_window_open = self.shows_keys || self.shows_about;
        (self.shows_keys, self.shows_about) = (false, false);
        let was_measuring = !is_window_open && self.tool == Tool::Measure;
        if was_measuring {
            self.tool = Tool::Hand;
        }
        is_window_open || was_measuring
    }

    fn menu_bar(&mut self, ui: &mut Ui) {
        let mut chosen = None;
        egui::MenuBar::new().ui(ui, |ui| {
            for menu in Menu::ALL {
                ui.menu_button(menu.name(), |ui| {
                    for entry in ENTRIES.iter().filter(|entry| entry.menu == menu) {
                        let is_enabled = self.document.is_some() || !entry.needs_model;
                        let button = entry.button(ui.ctx());
                        if ui.add_enabled(is_enabled, button).clicked() {
                            chosen = Some(entry.action);
                        }
                    }
                });
            }
        });
        if let Some(action) = chosen {
            self.act(action);
        }
    }

    fn status_bar(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            if let Some(loader) = &self.loader {
                let progress = loader.progress();
                ui.spinner();
                ui.label(format!("{}: {}", progress.doing, loader.file().display()));
                if let Some(share) = progress.share {
                    ui.add(egui::ProgressBar::new(share).desired_width(160.0).show_percentage());
                }
                ui.weak(progress.counts);
                if ui.button("Stop").clicked() {
                    loader.cancel();
                }
            } else if let Some(document) = &self.document {
                start::turntable(ui, document);
                start::status(ui, document, self.tool);
            } else {
                ui.weak("Drop a file here, or press Ctrl+O.");
            }
        });
    }

    fn after_panels(&mut self, asked: super::layout::Asked) {
        if asked.caps_changed
            && let (Some(document), Some(gpu)) = (&mut self.document, &self.gpu)
        {
            document.restart(gpu, &self.settings);
        }
        if let Some(want) = asked.want {
            self.ask_for_file(want);
        }
        if let Some(action) = asked.act {
            self.act(action);
        }
        if let Some(why) = self.layout.route.failure() {
            self.messages.fail(Attempt::Other, why);
        }
        asked.said.into_iter().for_each(|text| self.messages.say(text));
        asked.failed.into_iter().for_each(|text| self.messages.fail(Attempt::Other, text));
    }

    /// Dialogs and messages over everything else.
    fn floating(&mut self, context: &egui::Context) {
        if let Some(palette) = &mut self.palette
            && let Some(ended) = palette.show(context, self.document.is_some())
        {
            self.palette = None;
            if let palette::Ended::Do(action) = ended {
                self.act(action);
            }
        }
        if let Some(dialog) = &mut self.dialog
            && let Some(ended) = dialog.show(context, &self.settings.recent)
        {
            self.settings.turntable_pictures = dialog.pictures;
            self.dialog = None;
            if let paths::Ended::Chosen(want, path) = ended {
                self.chosen(want, path);
            }
        }
        if self.shows_keys {
            self.shows_keys = palette::show_keys(context, &self.layout.mouse_table(&self.settings));
        }
        if self.shows_about {
            self.shows_about = start::show_about(context, self.gpu.as_deref());
        }
        self.messages.show(context);
    }

    fn ask_for_file(&mut self, want: Want) {
        let file = self.document.as_ref().map(|document| document.loaded.file.clone()).unwrap_or_default();
        let suggestion = match want {
            Want::Open => file.parent().map(Path::to_owned).unwrap_or_default(),
            Want::SavePicture => file.with_extension("png"),
            Want::SaveWindow => PathBuf::from("collapsar.png"),
            Want::SaveTurntable => file.with_extension("turntable.json"),
            Want::SaveTurntablePictures => file.with_extension("turntable"),
            Want::SavePath | Want::LoadPath => file.with_extension("path.json"),
        };
        let pictures = self.settings.turntable_pictures;
        let mut dialog = PathDialog::new(want, &suggestion);
        dialog.pictures = pictures;
        self.dialog = Some(dialog);
    }

    fn chosen(&mut self, want: Want, path: PathBuf) {
        match (want, &mut self.document) {
            (Want::Open, _) => self.open(&path),
            (Want::SaveWindow, _) => self.asks.push(Ask::SaveWindow(path)),
            (Want::SavePicture, Some(document)) => document.save_picture(path),
            (Want::SaveTurntablePictures, Some(document)) => document.save_turntable(&self.settings, &path),
            (Want::SaveTurntable | Want::SavePath, Some(document)) => {
                let saved = self.layout.route.save(document, want, &path);
                self.say_saved(saved.map(|()| path));
            }
            (Want::LoadPath, Some(_)) => match self.layout.route.load(&path) {
                Ok(()) => self.messages.done(Attempt::Open),
                Err(why) => self.messages.fail(Attempt::Open, why),
            },
            (_, None) => {}
        }
    }

    /// Says that something was written to a file, or why it was not.
    pub fn say_saved(&mut self, saved: Result<PathBuf, String>) {
        match saved {
            Ok(path) => {
                self.messages.done(Attempt::Save);
                self.messages.say(format!("Saved {}", path.display()));
            }
            Err(why) => self.messages.fail(Attempt::Save, why),
        }
    }

    /// Does something, wherever it was asked for.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::Open => self.ask_for_file(Want::Open),
            Action::SaveWindow => self.ask_for_file(Want::SaveWindow),
            Action::Quit => self.asks.push(Ask::Quit),
            Action::ToggleFullscreen => self.asks.push(Ask::ToggleFullscreen),
            Action::Palette => self.palette = Some(Palette::default()),
            Action::Keys => self.shows_keys = !self.shows_keys,
            Action::About => self.shows_about = !self.shows_about,
            Action::ResetPanels => self.layout.reset(),
            Action::TogglePanels => self.layout.toggle_panels(),
            Action::ToggleTheme => {
                self.settings.theme =
                    if self.settings.theme == Theme::Dark { Theme::Light } else { Theme::Dark }
            }
            Action::Close => {
                self.document = None;
                self.tool = Tool::Hand;
            }
            action => self.act_on_model(action),
        }
    }

    fn act_on_model(&mut self, action: Action) {
        let Some(document) = &mut self.document else { return };
        match action {
            Action::SavePicture => self.ask_for_file(Want::SavePicture),
            Action::SaveTurntable => self.ask_for_file(Want::SaveTurntable),
            Action::SaveTurntablePictures => self.ask_for_file(Want::SaveTurntablePictures),
            Action::FitAll => document.fit_all(),
            Action::FitSelection => document.fit_selected(),
            Action::View(view) => document.view(view),
            Action::TogglePerspective => self.settings.parallel = !self.settings.parallel,
            Action::ToggleFly => {
                self.settings.parallel = false;
                self.tool = if self.tool == Tool::Fly { Tool::Hand } else { Tool::Fly };
            }
            Action::Measure => {
                self.tool = if self.tool == Tool::Measure { Tool::Hand } else { Tool::Measure }
            }
            Action::ToggleFreeze => document.toggle_freeze(),
            Action::ColourBy(by) => document.look.colour_by = by,
            Action::Edges(edges) => {
                document.look.edges = if document.look.edges == edges { Edges::None } else { edges }
            }
            Action::ToggleDepthCue => {
                self.settings.depth_cue = if self.settings.depth_cue > 0.0 { 0.0 } else { 0.6 }
            }
            Action::ToggleSection => {
                let bounds = *document.scene().bounds();
                let forward = document.navigation.camera().forward();
                document.cuts.toggle(&bounds, forward);
            }
            action => self.layout.act(document, action),
        }
    }
}

/// What a stop leaves of a file that was being opened.
fn stopped(file: &Path) -> &'static str {
    let is_kept =
        matches!(beside(file), Ok(Beside::ToBake(container)) if bake::folder_for(&container).is_dir());
    if is_kept {
        "Stopped. What was done is kept and goes on next time."
    } else {
        "Stopped. Nothing was written."
    }
}
