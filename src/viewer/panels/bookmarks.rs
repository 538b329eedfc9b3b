//! The panel of bookmarks and paths: shows both lists and says what the user did to them.

use egui::{DragValue, Slider, TextEdit, Ui};

use crate::viewer::bookmarks::recorder::{DEFAULT_SPACING, Recorder, Save};
use crate::viewer::bookmarks::{Bookmark, Bookmarks};

/// What the user did.
#[derive(Debug, Clone, PartialEq)]
pub enum BookmarkEvent {
    /// Keep the camera under a name, which may be empty.
    Add(String),
    /// Go to a bookmark.
    Go(usize),
    /// Put the camera of now in the place of a bookmark's.
    Replace(usize),
    /// Call a bookmark something else.
    Rename(usize, String),
    /// Take a bookmark out of the list.
    Remove(usize),
    /// Record the camera as the next key of the path, so many frames after the last.
    Record(u64),
    /// Go to a key of the path.
    GoToKey(usize),
    /// Take a key out of the path.
    RemoveKey(usize),
    /// Forget the path.
    ClearPath,
    /// Start replaying, or stop.
    Play(bool),
    /// Show a frame of the path.
    Scrub(f64),
    /// Ask where to save the path, and save it.
    SavePath(Save),
    /// Ask for a file, and load a path from it.
    LoadPath,
    /// Make a path of so many frames once round the pivot.
    Turntable(u64),
}

/// What the panel remembers between frames.
#[derive(Debug, Clone, PartialEq)]
pub struct BookmarkPanel {
    name: String,
    /// The bookmark that is being called something else, and its name so far.
    renaming: Option<(usize, String)>,
    spacing: u64,
    turntable_frames: u64,
}

impl Default for BookmarkPanel {
    fn default() -> Self {
        Self { name: String::new(), renaming: None, spacing: DEFAULT_SPACING, turntable_frames: 120 }
    }
}

/// How the path is being replayed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Playback {
    /// The frame that is shown.
    pub frame: f64,
    /// Whether it goes on by itself.
    pub is_playing: bool,
}

impl Playback {
    /// The frame after so many seconds of `frames_per_second`; stops at the end of the path. Gives whether it moved.
    pub fn advance(&mut self, recorder: &Recorder, seconds: f64, frames_per_second: f64) -> bool {
        if !self.is_playing {
            return false;
        }
        let last = recorder.last_frame() as f64;
        self.frame = (self.frame + seconds.max(0.0) * frames_per_second).min(last);
        self.is_playing = self.frame < last;
        true
    }

    /// From here on, or from the start where the end was reached.
    pub fn play(&mut self, recorder: &Recorder) {
        if self.frame >= recorder.last_frame() as f64 {
            self.frame = 0.0;
        }
        self.is_playing = recorder.last_frame() > 0;
    }
}

impl BookmarkPanel {
    /// Draws the panel.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        bookmarks: &Bookmarks,
        path: &Recorder,
        playback: Playback,
    ) -> Vec<BookmarkEvent> {
        let mut events = Vec::new();
        ui.strong("Bookmarks");
        self.adding(ui, &mut events);
        if bookmarks.list().is_empty() {
            ui.weak("None yet for this model.");
        }
        for (index, bookmark) in bookmarks.list().iter().enumerate() {
            self.bookmark(ui, index, bookmark, &mut events);
        }
        ui.separator();
        ui.strong("Path");
        self.recording(ui, path, &mut events);
        keys(ui, path, &mut events);
        replaying(ui, path, playback, &mut events);
        self.files(ui, path, &mut events);
        events
    }

    fn adding(&mut self, ui: &mut Ui, events: &mut Vec<BookmarkEvent>) {
        ui.horizontal(|ui| {
            let field = ui.add(TextEdit::singleline(&mut self.name).hint_text("Name").desired_width(120.0));
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if ui.button("Add").on_hover_text("Keep this view under that name").clicked() || entered {
                events.push(BookmarkEvent::Add(std::mem::take(&mut self.name)));
            }
        });
    }

    fn bookmark(&mut self, ui: &mut Ui, index: usize, bookmark: &Bookmark, events: &mut Vec<BookmarkEvent>) {
        ui.horizontal(|ui| {
            if self.renaming.as_ref().is_some_and(|(renamed, _)| *renamed == index) {
                events.extend(self.rename_field(ui));
                return;
            }
            if ui.button(&bookmark.name).on_hover_text("Go there").clicked() {
                events.push(BookmarkEvent::Go(index));
            }
            let act = |ui: &mut Ui, sign: &str, what: &str| {
                let label = format!("{what} {}", bookmark.name);
                ui.small_button(sign).accessible_name(&label).on_hover_text(what).clicked()
            };
            if act(ui, "✏", "Rename") {
                self.renaming = Some((index, bookmark.name.clone()));
            }
            if act(ui, "⟳", "Replace by this view") {
                events.push(BookmarkEvent::Replace(index));
            }
            if act(ui, "✖", "Remove") {
                self.renaming = None;
                events.push(BookmarkEvent::Remove(index));
            }
        });
    }

    fn rename_field(&mut self, ui: &mut Ui) -> Option<BookmarkEvent> {
        let (index, name) = self.renaming.as_mut()?;
        let field = ui.add(TextEdit::singleline(name).hint_text("New name").desired_width(160.0));
        let (enter, escape) =
            ui.input(|input| (input.key_pressed(egui::Key::Enter), input.key_pressed(egui::Key::Escape)));
        let event = BookmarkEvent::Rename(*index, name.clone());
        if !field.has_focus() && !field.lost_focus() {
            field.request_focus();
        }
        let done = field.lost_focus() || enter || escape;
        if done {
            self.renaming = None;
        }
        (done && !escape).then_some(event)
    }

    fn recording(&mut self, ui: &mut Ui, path: &Recorder, events: &mut Vec<BookmarkEvent>) {
        ui.horizontal(|ui| {
            if ui.button("Record key").on_hover_text("This view is the next key of the path").clicked() {
                events.push(BookmarkEvent::Record(self.spacing));
            }
            let spacing = DragValue::new(&mut self.spacing).range(1..=10_000).suffix(" frames");
            ui.add(spacing)
                .accessible_name("Frames between keys")
                .on_hover_text("Frames from the last key to the next");
            if ui.add_enabled(!path.keys().is_empty(), egui::Button::new("Clear")).clicked() {
                events.push(BookmarkEvent::ClearPath);
            }
        });
    }

    fn files(&mut self, ui: &mut Ui, path: &Recorder, events: &mut Vec<BookmarkEvent>) {
        ui.horizontal(|ui| {
            let has_keys = !path.keys().is_empty();
            for (label, save, hint) in [
                (
                    "Save smooth…",
                    Save::Smooth,
                    "A key for every frame, so that fly replays what is seen here",
                ),
                ("Save keys…", Save::Keys, "The keys alone; fly goes straight between them"),
            ] {
                if ui.add_enabled(has_keys, egui::Button::new(label)).on_hover_text(hint).clicked() {
                    events.push(BookmarkEvent::SavePath(save));
                }
            }
            if ui.button("Load…").clicked() {
                events.push(BookmarkEvent::LoadPath);
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Turntable").on_hover_text("Once round the pivot").clicked() {
                events.push(BookmarkEvent::Turntable(self.turntable_frames));
            }
            let frames = DragValue::new(&mut self.turntable_frames).range(2..=100_000).suffix(" frames");
            ui.add(frames).accessible_name("Frames of the turntable");
        });
    }
}

/// More keys than this are not listed one by one.
const MOST_LISTED: usize = 200;

fn keys(ui: &mut Ui, path: &Recorder, events: &mut Vec<BookmarkEvent>) {
    for (index, key) in path.keys().iter().enumerate().take(MOST_LISTED) {
        ui.horizontal(|ui| {
            let label = format!("Key {} at frame {}", index + 1, key.frame);
            if ui.button(&label).on_hover_text("Go there").clicked() {
                events.push(BookmarkEvent::GoToKey(index));
            }
            let remove = format!("Remove key {}", index + 1);
            if ui.small_button("✖").accessible_name(&remove).on_hover_text("Remove").clicked() {
                events.push(BookmarkEvent::RemoveKey(index));
            }
        });
    }
    if path.keys().len() > MOST_LISTED {
        ui.weak(format!("and {} more", path.keys().len() - MOST_LISTED));
    }
}

fn replaying(ui: &mut Ui, path: &Recorder, playback: Playback, events: &mut Vec<BookmarkEvent>) {
    if path.last_frame() == 0 {
        ui.weak("Two keys make a path.");
        return;
    }
    ui.horizontal(|ui| {
        let label = if playback.is_playing { "Stop" } else { "Play" };
        if ui.button(label).clicked() {
            events.push(BookmarkEvent::Play(!playback.is_playing));
        }
        // A slider rounds what it is given to what it shows, and would stop what goes on between two frames.
        let mut frame = playback.frame.round();
        let slider = Slider::new(&mut frame, 0.0..=path.last_frame() as f64).fixed_decimals(0);
        if ui.add(slider).accessible_name("Frame of the path").changed() {
            events.push(BookmarkEvent::Scrub(frame));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Camera;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;
    use glam::DVec3;
    use std::path::Path;

    struct State {
        panel: BookmarkPanel,
        bookmarks: Bookmarks,
        path: Recorder,
        playback: Playback,
        events: Vec<BookmarkEvent>,
    }

    fn camera(x: f64) -> Camera {
        Camera::look_at(DVec3::new(x, 2.0, 3.0), DVec3::ZERO, DVec3::Y, 0.8, 0.1)
    }

    fn harness() -> Harness<'static, State> {
        let mut bookmarks = Bookmarks::none(Path::new("none.json"), "model");
        let mut path = Recorder::default();
        for (name, x) in [("bridge", 1.0), ("engine", 2.0)] {
            bookmarks.add(Bookmark::new(name, &camera(x), 1.0));
            path.record(&camera(x), 1.0, 30);
        }
        let panel = BookmarkPanel::default();
        let state = State { panel, bookmarks, path, playback: Playback::default(), events: Vec::new() };
        Harness::builder().with_size([420.0, 500.0]).build_ui_state(
            |ui, state: &mut State| {
                let new = state.panel.show(ui, &state.bookmarks, &state.path, state.playback);
                state.events.extend(new);
            },
            state,
        )
    }

    #[test]
    fn every_button_says_what_was_done() {
        for (label, event) in [
            ("bridge", BookmarkEvent::Go(0)),
            ("engine", BookmarkEvent::Go(1)),
            ("Replace by this view engine", BookmarkEvent::Replace(1)),
            ("Remove bridge", BookmarkEvent::Remove(0)),
            ("Add", BookmarkEvent::Add(String::new())),
            ("Record key", BookmarkEvent::Record(DEFAULT_SPACING)),
            ("Key 2 at frame 30", BookmarkEvent::GoToKey(1)),
            ("Remove key 1", BookmarkEvent::RemoveKey(0)),
            ("Clear", BookmarkEvent::ClearPath),
            ("Play", BookmarkEvent::Play(true)),
            ("Save smooth…", BookmarkEvent::SavePath(Save::Smooth)),
            ("Save keys…", BookmarkEvent::SavePath(Save::Keys)),
            ("Load…", BookmarkEvent::LoadPath),
            ("Turntable", BookmarkEvent::Turntable(120)),
        ] {
            let mut harness = harness();
            harness.run();
            harness.get_by_label(label).click();
            harness.run();
            assert_eq!(harness.state().events, [event], "{label}");
        }
    }

    #[test]
    fn a_bookmark_is_called_something_else_by_typing_and_enter() {
        let mut harness = harness();
        harness.run();
        harness.get_by_label("Rename bridge").click();
        harness.run();
        harness.event(egui::Event::Text(" deck".into()));
        harness.run();
        harness.key_press(egui::Key::Enter);
        harness.run();
        let [BookmarkEvent::Rename(0, name)] = harness.state().events.as_slice() else {
            panic!("{:?}", harness.state().events)
        };
        assert!(name.contains("bridge") && name.contains("deck"), "{name}");
    }

    #[test]
    fn a_frame_between_two_is_shown_and_replaying_goes_on() {
        let mut harness = harness();
        for frame in [3.4, 3.5, 17.999] {
            harness.state_mut().playback = Playback { frame, is_playing: true };
            harness.run();
            assert_eq!(harness.state().events, [], "at frame {frame}");
        }
    }

    #[test]
    fn replaying_stops_at_the_end_and_starts_again() {
        let mut path = Recorder::default();
        let mut playback = Playback::default();
        playback.play(&path);
        assert!(!playback.is_playing && !playback.advance(&path, 1.0, 30.0));
        path.record(&camera(1.0), 1.0, 30);
        path.record(&camera(2.0), 1.0, 30);
        playback.play(&path);
        assert!(playback.advance(&path, 0.5, 30.0) && playback.frame == 15.0);
        assert!(playback.advance(&path, 9.0, 30.0));
        assert_eq!(playback, Playback { frame: 30.0, is_playing: false });
        playback.play(&path);
        assert_eq!(playback, Playback { frame: 0.0, is_playing: true });
    }
}
