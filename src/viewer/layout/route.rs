//! Bookmarks and paths of cameras, as they belong to a model: the panel's events in, files and motions out.

use std::path::Path;

use egui::Ui;

use crate::scene::views;
use crate::viewer::bookmarks::recorder::{Recorder, Save, turntable};
use crate::viewer::bookmarks::{Bookmark, BookmarkError, Bookmarks, model_key, target_distance};
use crate::viewer::document::Document;
use crate::viewer::panels::bookmarks::{BookmarkEvent, BookmarkPanel, Playback};
use crate::viewer::panels::paths::Want;
use crate::viewer::settings::Store;

/// Frames of a path in a second while it is played.
const FRAMES_PER_SECOND: f64 = 60.0;
/// Frames between two keys that are recorded by a key of the keyboard.
const SPACING: u64 = 60;
/// Frames of a turntable that is saved from the menu.
const TURNTABLE_FRAMES: u64 = 240;

/// Bookmarks, and the path that is being recorded or played.
#[derive(Default)]
pub struct Route {
    panel: BookmarkPanel,
    bookmarks: Option<Bookmarks>,
    path: Recorder,
    playback: Playback,
    /// How the path is to be saved once a file was chosen.
    save: Option<Save>,
    failed: Option<String>,
}

impl Route {
    /// Another model was opened: its bookmarks are read, and there is no path.
    pub fn model_opened(&mut self, store: &Store, model: &Path) {
        *self = Self::default();
        let Some(folder) = store.folder() else { return };
        let (file, key) = (folder.join("bookmarks.json"), model_key(model));
        let read = Bookmarks::read(&file, &key);
        self.bookmarks = Some(read.unwrap_or_else(|error| {
            self.failed = Some(error.to_string());
            Bookmarks::none(&file, &key)
        }));
    }

    /// What went wrong since the last call.
    pub fn failure(&mut self) -> Option<String> {
        self.failed.take()
    }

    /// Adds a bookmark of the camera.
    pub fn add_bookmark(&mut self, document: &Document, name: &str) {
        let camera = document.navigation.target();
        let distance = target_distance(camera, document.navigation.pivot());
        if let Some(bookmarks) = &mut self.bookmarks {
            bookmarks.add(Bookmark::new(name, camera, distance));
            let saved = bookmarks.save();
            self.keep(saved);
        }
    }

    fn keep(&mut self, result: Result<(), BookmarkError>) {
        if let Err(error) = result {
            self.failed = Some(error.to_string());
        }
    }

    /// Records the camera as the next key.
    pub fn record(&mut self, document: &Document) {
        self.record_after(document, SPACING);
    }

    fn record_after(&mut self, document: &Document, spacing: u64) {
        let camera = document.navigation.camera();
        let distance = target_distance(camera, document.navigation.pivot());
        if !self.path.record(camera, distance, spacing) {
            self.failed = Some("The path is full: no more keys can be recorded.".to_owned());
        }
    }

    /// Lets the path play on; gives whether the camera moved.
    pub fn advance(&mut self, document: &mut Document, seconds: f64) -> bool {
        let moved = self.playback.advance(&self.path, seconds, FRAMES_PER_SECOND);
        if moved {
            self.put(document, self.playback.frame);
        }
        moved
    }

    fn put(&self, document: &mut Document, frame: f64) {
        let bounds = document.scene().bounds();
        if let Some(camera) = self.path.camera_at(frame, views::near_of(bounds), views::reach_of(bounds)) {
            document.navigation.put(camera);
        }
    }

    /// Writes the recorded path, or one once round the model.
    ///
    /// # Errors
    /// Why it could not be written.
    pub fn save(&self, document: &Document, want: Want, path: &Path) -> Result<(), String> {
        let written = if want == Want::SaveTurntable {
            self.turntable(document, TURNTABLE_FRAMES).save(path, Save::Keys)
        } else {
            self.path.save(path, self.save.unwrap_or(Save::Keys))
        };
        written.map_err(|error| error.to_string())
    }

    fn turntable(&self, document: &Document, frames: u64) -> Recorder {
        let navigation = &document.navigation;
        turntable(navigation.camera(), document.scene().bounds().centre(), navigation.up.vector(), frames)
    }

    /// Reads a path.
    ///
    /// # Errors
    /// Why it could not be read.
    pub fn load(&mut self, path: &Path) -> Result<(), String> {
        self.path = Recorder::read(path).map_err(|error| error.to_string())?;
        self.playback = Playback::default();
        Ok(())
    }

    /// Shows the panel; gives what file is wanted.
    pub fn show(&mut self, ui: &mut Ui, document: &mut Document) -> Option<Want> {
        let Some(bookmarks) = &self.bookmarks else {
            ui.weak("There is no folder for bookmarks.");
            return None;
        };
        let events = self.panel.show(ui, bookmarks, &self.path, self.playback);
        events.into_iter().filter_map(|event| self.take(document, event)).last()
    }

    fn take(&mut self, document: &mut Document, event: BookmarkEvent) -> Option<Want> {
        match event {
            BookmarkEvent::Add(name) => self.add_bookmark(document, &name),
            BookmarkEvent::Record(spacing) => self.record_after(document, spacing),
            BookmarkEvent::RemoveKey(index) => self.path.remove(index),
            BookmarkEvent::ClearPath => self.path.clear(),
            BookmarkEvent::Play(true) => self.playback.play(&self.path),
            BookmarkEvent::Play(false) => self.playback.is_playing = false,
            BookmarkEvent::Scrub(frame) => {
                self.playback = Playback { frame, is_playing: false };
                self.put(document, frame);
            }
            BookmarkEvent::GoToKey(index) => {
                if let Some(key) = self.path.keys().get(index) {
                    self.put(document, key.frame as f64);
                }
            }
            BookmarkEvent::Turntable(frames) => self.path = self.turntable(document, frames),
            BookmarkEvent::SavePath(save) => {
                self.save = Some(save);
                return Some(Want::SavePath);
            }
            BookmarkEvent::LoadPath => return Some(Want::LoadPath),
            other => self.take_of_bookmarks(document, other),
        }
        None
    }

    fn take_of_bookmarks(&mut self, document: &mut Document, event: BookmarkEvent) {
        let Some(bookmarks) = &mut self.bookmarks else { return };
        let bounds = *document.scene().bounds();
        match event {
            BookmarkEvent::Go(index) => {
                let Some(bookmark) = bookmarks.list().get(index) else { return };
                match bookmark.camera(views::near_of(&bounds), views::reach_of(&bounds)) {
                    Ok(camera) => document.navigation.go_to(camera),
                    Err(why) => self.failed = Some(why),
                }
                return;
            }
            BookmarkEvent::Replace(index) => {
                let camera = document.navigation.target();
                let distance = target_distance(camera, document.navigation.pivot());
                bookmarks.replace(index, crate::viewer::bookmarks::keyframe_of(camera, 0, distance));
            }
            BookmarkEvent::Rename(index, name) => bookmarks.rename(index, &name),
            BookmarkEvent::Remove(index) => drop(bookmarks.remove(index)),
            _ => return,
        }
        let saved = bookmarks.save();
        self.keep(saved);
    }
}
