//! Cameras once round a model in, a picture of each on disk out: a frame at a time, between those that the window wishes for.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::{Done, Easel, Frame, Wish};
use crate::frame::FrameError;
use crate::scene::{Camera, turntable};
use crate::whole_file::folder_of;

/// A picture that has not come to rest after so long and so many frames is written as it is.
const MOST_WAIT: Duration = Duration::from_secs(30);
const MOST_FRAMES: u32 = 400;

/// The pictures to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Turntable {
    /// All but the camera.
    pub wish: Wish,
    /// From where.
    pub cameras: Vec<Camera>,
    /// `FOLDER/NAME.png` for `FOLDER/NAME-000.png` and so on. The folder is made if only that is missing.
    pub output: PathBuf,
}

/// How far it has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Pictures that are written.
    pub done: u32,
    /// Pictures in all.
    pub of: u32,
}

/// What became of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// How many pictures were written, and were to be.
    pub progress: Progress,
    /// How many of them lack something that had not been read in time.
    pub incomplete: u32,
    /// Where they are.
    pub folder: PathBuf,
}

/// A turntable that is being made.
pub(super) struct Running {
    asked: Turntable,
    done: u32,
    incomplete: u32,
    /// Of the picture that is being made.
    frames: u32,
    since: Instant,
}

impl Running {
    pub fn new(asked: Turntable) -> Self {
        Self { asked, done: 0, incomplete: 0, frames: 0, since: Instant::now() }
    }

    pub fn progress(&self) -> Progress {
        Progress { done: self.done, of: self.asked.cameras.len() as u32 }
    }

    pub fn made(&self) -> Made {
        let folder = folder_of(&self.asked.output).to_owned();
        Made { progress: self.progress(), incomplete: self.incomplete, folder }
    }

    /// The next camera's wish.
    fn wish(&self) -> Option<Wish> {
        let camera = *self.asked.cameras.get(self.done as usize)?;
        Some(Wish { camera, ..self.asked.wish.clone() })
    }

    /// Whether the picture may be written.
    fn is_ready(&self, frame: &Frame) -> bool {
        frame.is_settled || self.frames >= MOST_FRAMES && self.since.elapsed() >= MOST_WAIT
    }

    fn next_picture(&mut self, was_complete: bool) {
        self.done += 1;
        self.incomplete += u32::from(!was_complete);
        (self.frames, self.since) = (0, Instant::now());
    }
}

impl Easel<'_> {
    /// Draws one frame of the turntable that is being made, if one is, and writes its picture once it is settled. Gives
    /// what there is to be told.
    pub(super) fn turn(&mut self) -> Result<Option<Done>, FrameError> {
        let Some(mut running) = self.turntable.take() else { return Ok(None) };
        let Some(wish) = running.wish() else { return Ok(Some(Done::Pictures(running.made()))) };
        if !std::mem::replace(&mut self.is_elsewhere, true) {
            // Frames of the window's wish are no sign that this one is settled.
            self.quiet = 0;
        }
        let frame = self.frame_or_less(&wish)?;
        running.frames += 1;
        if running.is_ready(&frame) {
            let path = turntable::picture_path(&running.asked.output, running.done);
            if let Err(why) = make_folder(&running.asked.output).and_then(|()| self.save_or_say(&path)) {
                return Ok(Some(Done::NotSaved(why)));
            }
            running.next_picture(frame.is_settled);
            self.quiet = 0;
        }
        self.turntable = Some(running);
        Ok(None)
    }

    fn save_or_say(&self, path: &Path) -> Result<(), String> {
        self.save(path).map_err(|error| error.to_string())
    }
}

/// Makes the folder of a file if only that is missing.
fn make_folder(output: &Path) -> Result<(), String> {
    let folder = folder_of(output);
    if folder.is_dir() {
        return Ok(());
    }
    let failed = |error| format!("the folder for the pictures cannot be made: {error}: {}", folder.display());
    std::fs::create_dir(folder).map_err(failed)
}
