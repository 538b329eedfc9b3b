//! Dialogs for files: a field to type in, what was opened last, and the system's own dialog.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use egui::{Id, Key, Modal, ScrollArea, TextEdit, Ui};

/// What a file is wanted for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// To be opened.
    Open,
    /// The picture, to be written.
    SavePicture,
    /// The window, to be written.
    SaveWindow,
    /// A turntable path, to be written.
    SaveTurntable,
    /// Pictures of a turntable, to be written into a folder.
    SaveTurntablePictures,
    /// A recorded path, to be written.
    SavePath,
    /// A path, to be read.
    LoadPath,
}

impl Want {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open a model",
            Self::SavePicture => "Save the picture",
            Self::SaveWindow => "Save a picture of the window",
            Self::SaveTurntable => "Save a turntable path for `collapsar fly --path`",
            Self::SaveTurntablePictures => "Save turntable pictures in a folder",
            Self::LoadPath => "Load a path",
            Self::SavePath => "Save the recorded path for `collapsar fly --path`",
        }
    }

    fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Open => &["clps", "glb", "gltf", "obj", "ply", "stl", "zst", "gz"],
            Self::SavePicture | Self::SaveWindow | Self::SaveTurntablePictures => &["png"],
            Self::SaveTurntable | Self::SavePath | Self::LoadPath => &["json"],
        }
    }

    fn is_open(self) -> bool {
        matches!(self, Self::Open | Self::LoadPath)
    }

    fn is_folder(self) -> bool {
        self == Self::SaveTurntablePictures
    }
}

/// A dialog that is open.
pub struct PathDialog {
    want: Want,
    text: String,
    /// How many pictures are wanted, where that is asked.
    pub pictures: u32,
    /// The system's dialog, while it is open beside this one.
    system: Option<Receiver<Answer>>,
    /// Whether there was none.
    lacks_system: bool,
    /// Why what was chosen last is not written to, or not yet.
    objection: Option<String>,
    /// A file that may be replaced, for that has been asked.
    replaces: Option<PathBuf>,
}

/// What the system's dialog came to, and how long it was open.
type Answer = (Option<PathBuf>, Duration);

/// Nobody closes a dialog faster: there was none.
const SHORTEST_LOOK: Duration = Duration::from_millis(300);

/// How it ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ended {
    /// With a file.
    Chosen(Want, PathBuf),
    /// With none.
    Closed,
}

impl PathDialog {
    /// Asks for a file; `first` is what stands in the field.
    pub fn new(want: Want, first: &Path) -> Self {
        Self {
            want,
            text: first.display().to_string(),
            pictures: 72,
            system: None,
            lacks_system: false,
            objection: None,
            replaces: None,
        }
    }

    /// Shows it; says how it ended once it has.
    pub fn show(&mut self, context: &egui::Context, recent: &[PathBuf]) -> Option<Ended> {
        let modal = Modal::new(Id::unique("path dialog")).show(context, |ui| self.contents(ui, recent));
        let should_close = modal.should_close();
        let chosen = modal.inner.or_else(|| self.system_choice());
        match chosen.and_then(|path| self.accepted(path)) {
            Some(path) => Some(Ended::Chosen(self.want, path)),
            None => should_close.then_some(Ended::Closed),
        }
    }

    /// The path, if it may be read or written: no slip of the keyboard replaces a model, and no file goes unasked.
    fn accepted(&mut self, path: PathBuf) -> Option<PathBuf> {
        if self.want.is_open() || self.want.is_folder() {
            return Some(path);
        }
        let [needed, ..] = self.want.extensions() else { return Some(path) };
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        if extension != **needed {
            self.objection = Some(format!("The name must end in .{needed}."));
            return None;
        }
        if path.is_file() && self.replaces.as_ref() != Some(&path) {
            self.objection = Some("This file is there already: save once more to replace it.".to_owned());
            (self.text, self.replaces) = (path.display().to_string(), Some(path));
            return None;
        }
        Some(path)
    }

    fn contents(&mut self, ui: &mut Ui, recent: &[PathBuf]) -> Option<PathBuf> {
        ui.set_width(520.0);
        ui.heading(self.want.title());
        let label = ui.label(if self.want.is_folder() { "Folder" } else { "File" });
        let field = TextEdit::singleline(&mut self.text).desired_width(f32::INFINITY).hint_text("a path");
        let field = ui.add(field).labelled_by(label.id);
        if field.changed() {
            (self.objection, self.replaces) = (None, None);
        }
        if !field.lost_focus() {
            field.request_focus();
        }
        let mut chosen = None;
        if self.want == Want::SaveTurntablePictures {
            self.picture_counts(ui);
        }
        ui.horizontal(|ui| {
            let name = match (self.want.is_open(), &self.replaces) {
                (true, _) => "Open",
                (false, None) => "Save",
                (false, Some(_)) => "Replace",
            };
            let is_typed = !self.text.trim().is_empty();
            let is_entered = ui.input(|input| input.key_pressed(Key::Enter));
            let clicked = ui.add_enabled(is_typed, egui::Button::new(name)).clicked();
            if is_typed && (clicked || is_entered) {
                chosen = Some(PathBuf::from(self.text.trim()));
            }
            let browse = egui::Button::new("Browse…");
            if ui.add_enabled(self.system.is_none(), browse).clicked() {
                self.browse(ui.ctx().clone());
            }
            if ui.button("Cancel").clicked() {
                ui.close();
            }
        });
        if let Some(objection) = &self.objection {
            ui.colored_label(ui.visuals().warn_fg_color, objection);
        }
        if self.lacks_system {
            ui.weak("This system has no dialog for files (xdg-desktop-portal or zenity): type the path.");
        }
        if self.want == Want::Open && !recent.is_empty() {
            ui.separator();
            ui.label("Opened last");
            ScrollArea::vertical().max_height(200.0).show(ui, |ui| {
                chosen = chosen.take().or_else(|| recent_rows(ui, recent));
            });
        }
        chosen
    }

    fn picture_counts(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.label("Pictures");
            for count in [36, 72, 120, 180, 360] {
                ui.selectable_value(&mut self.pictures, count, count.to_string());
            }
            ui.weak(format!("one every {:.3} degrees", 360.0 / f64::from(self.pictures.max(1))));
        });
    }

    /// Opens the system's dialog on a thread of its own, for it waits.
    fn browse(&mut self, context: egui::Context) {
        let (sender, receiver) = channel();
        let (want, start) = (self.want, PathBuf::from(self.text.trim()));
        std::thread::spawn(move || {
            let started = Instant::now();
            let mut dialog =
                rfd::FileDialog::new().add_filter("files", want.extensions()).set_title(want.title());
            let mut folders = start.ancestors().take(2);
            if let Some(folder) = folders.find(|folder| folder.is_dir()) {
                dialog = dialog.set_directory(folder);
            }
            let chosen = match (want.is_folder(), want.is_open()) {
                (true, _) => dialog.pick_folder(),
                (_, true) => dialog.pick_file(),
                (_, false) => {
                    dialog.set_file_name(start.file_name().unwrap_or_default().to_string_lossy()).save_file()
                }
            };
            // Nobody listens any more if this dialog was closed.
            let _ = sender.send((chosen, started.elapsed()));
            context.request_repaint();
        });
        self.system = Some(receiver);
    }

    fn system_choice(&mut self) -> Option<PathBuf> {
        match self.system.as_ref()?.try_recv() {
            Ok((chosen, open_for)) => {
                self.system = None;
                self.lacks_system = chosen.is_none() && open_for < SHORTEST_LOOK;
                chosen
            }
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                (self.system, self.lacks_system) = (None, true);
                None
            }
        }
    }
}

/// What was opened last, to be clicked on.
pub fn recent_rows(ui: &mut Ui, recent: &[PathBuf]) -> Option<PathBuf> {
    let mut chosen = None;
    for path in recent {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if ui.link(name.as_ref()).on_hover_text(path.display().to_string()).clicked() {
            chosen = Some(path.clone());
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    /// What is said after the system's dialog has come to this.
    fn says_there_is_none(answer: Answer) -> bool {
        let (sender, receiver) = channel();
        let mut dialog = PathDialog::new(Want::Open, Path::new("/models"));
        dialog.system = Some(receiver);
        sender.send(answer).unwrap();
        let mut harness = Harness::new_ui_state(
            |ui, dialog: &mut PathDialog| {
                dialog.show(ui.ctx(), &[]);
            },
            dialog,
        );
        (0..3).for_each(|_| harness.step());
        harness.query_by_label_contains("no dialog for files").is_some()
    }

    #[test]
    fn only_a_picture_is_replaced_by_a_picture_and_only_once_asked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["model.clps", "model.obj", "old.png"] {
            std::fs::write(at(name), name).unwrap();
        }
        for want in [Want::SavePicture, Want::SaveWindow] {
            let mut dialog = PathDialog::new(want, &at("new.png"));
            for name in ["model.clps", "model.obj", "new.jpg", "new"] {
                assert_eq!(dialog.accepted(at(name)), None, "{name}");
                assert!(dialog.objection.as_ref().unwrap().contains("must end in .png"));
            }
            assert_eq!(dialog.accepted(at("old.png")), None);
            assert!(dialog.objection.as_ref().unwrap().contains("replace"));
            assert_eq!(dialog.accepted(at("old.png")), Some(at("old.png")));
            assert_eq!(dialog.accepted(at("new.PNG")), Some(at("new.PNG")));
        }
        assert_eq!(PathDialog::new(Want::SavePath, &at("a.json")).accepted(at("a.gltf")), None);
        assert_eq!(PathDialog::new(Want::Open, &at("")).accepted(at("model.obj")), Some(at("model.obj")));
    }

    #[test]
    fn a_system_without_a_dialog_is_told_from_a_dialog_that_was_closed() {
        assert!(says_there_is_none((None, Duration::from_millis(2))));
        assert!(!says_there_is_none((None, Duration::from_secs(2))));
        assert!(!says_there_is_none((Some(PathBuf::from("a.glb")), Duration::from_millis(2))));
    }
}
