//! Named cameras of each model, in a JSON file beside the settings: read, changed, written whole or not at all.
//!
//! ```json
//! { "version": 1, "models": { "ship.clps": [{ "name": "bridge", "camera": { "frame": 0, "eye": [9, 5, 9], … } }] } }
//! ```
//!
//! A camera is a keyframe as `fly --path` reads it. [`recorder`] records and replays paths of such keyframes.

pub mod recorder;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::scene::Camera;
use crate::scene::camera_path::{CameraPathError, Keyframe, Keyframes};
use crate::whole_file::{folder_of, write_whole};

/// The version that is written.
const VERSION: u32 = 1;
/// The largest file that is read.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Why bookmarks cannot be read or written. The path comes last in every message.
#[derive(Debug, thiserror::Error)]
pub enum BookmarkError {
    /// The file cannot be read.
    #[error("cannot read the bookmarks ({cause}): {path}")]
    Unreadable {
        /// Why.
        cause: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// The file is not what this program writes.
    #[error(
        "the bookmarks are damaged ({why}); nothing was changed: mend the file, or set it aside to start anew: {path}"
    )]
    Damaged {
        /// What is wrong.
        why: String,
        /// The file.
        path: PathBuf,
    },
    /// A newer program has written it.
    #[error(
        "the bookmarks have version {version}, and this program knows {VERSION}; use a newer one, or set the file aside: {path}"
    )]
    Newer {
        /// The version in the file.
        version: u32,
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error("cannot write ({cause}); what was there before is kept: {path}")]
    Unwritable {
        /// Why.
        cause: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// A path has no keyframe, or one that cannot be replayed.
    #[error("the path cannot be saved ({why}): {path}")]
    Unusable {
        /// What is wrong with it.
        why: String,
        /// The file.
        path: PathBuf,
    },
    /// A path cannot be read.
    #[error(transparent)]
    Path(#[from] CameraPathError),
}

/// A named camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bookmark {
    /// What the user calls it.
    pub name: String,
    /// The camera; its frame means nothing.
    pub camera: Keyframe,
}

impl Bookmark {
    /// Of a camera that looks at something so far away, which only says where its target is written.
    pub fn new(name: &str, camera: &Camera, distance: f64) -> Self {
        Self { name: name.to_owned(), camera: keyframe_of(camera, 0, distance) }
    }

    /// The camera, with the near plane and the reach of the scene.
    ///
    /// # Errors
    /// Says what is wrong with the keyframe.
    pub fn camera(&self, near: f64, reach: f64) -> Result<Camera, String> {
        Ok(Keyframes::new(vec![self.camera])?.camera(0, near, reach))
    }
}

/// A camera as a keyframe. The target lies so far ahead, but never so near the eye that its direction would lose more
/// than eight of its digits.
pub fn keyframe_of(camera: &Camera, frame: u64, distance: f64) -> Keyframe {
    let precise = camera.eye.abs().max_element() * 1e-6;
    let ahead = if distance.is_finite() { distance.max(precise) } else { precise };
    let ahead = if ahead > 0.0 { ahead } else { 1.0 };
    Keyframe {
        frame,
        eye: camera.eye.to_array(),
        target: (camera.eye + camera.forward() * ahead).to_array(),
        up: camera.up().to_array(),
        fov_degrees: camera.vertical_fov_radians.to_degrees().clamp(1.0, 170.0),
        parallel_height: camera.parallel.map(|parallel| parallel.height),
    }
}

/// The name of a model in the file: its full path, as far as it can be told.
pub fn model_key(model: &Path) -> String {
    model.canonicalize().unwrap_or_else(|_| model.to_owned()).to_string_lossy().into_owned()
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Document {
    version: u32,
    models: BTreeMap<String, Vec<Bookmark>>,
}

/// The bookmarks of one model. A list of another window that has the same model open is replaced by the last that writes;
/// those of other models are kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Bookmarks {
    path: PathBuf,
    model: String,
    list: Vec<Bookmark>,
}

impl Bookmarks {
    /// Reads those of a model; none where there is no file yet.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or is newer than the program. It stays as it is.
    pub fn read(path: &Path, model: &str) -> Result<Self, BookmarkError> {
        let list = read_document(path)?.models.remove(model).unwrap_or_default();
        Ok(Self { path: path.to_owned(), model: model.to_owned(), list })
    }

    /// None, to go on with where [`Bookmarks::read`] failed; saving fails as well until the file is mended or set aside.
    pub fn none(path: &Path, model: &str) -> Self {
        Self { path: path.to_owned(), model: model.to_owned(), list: Vec::new() }
    }

    /// The bookmarks, in the order in which they were made.
    pub fn list(&self) -> &[Bookmark] {
        &self.list
    }

    /// Adds one; a name that is taken or empty gets a number.
    pub fn add(&mut self, bookmark: Bookmark) -> &Bookmark {
        let name = self.free_name(&bookmark.name, None);
        self.list.push(Bookmark { name, ..bookmark });
        &self.list[self.list.len() - 1]
    }

    /// Calls one something else; a number that is not in the list does nothing.
    pub fn rename(&mut self, index: usize, name: &str) {
        let name = self.free_name(name, Some(index));
        if let Some(bookmark) = self.list.get_mut(index) {
            bookmark.name = name;
        }
    }

    /// Puts another camera under a name.
    pub fn replace(&mut self, index: usize, camera: Keyframe) {
        if let Some(bookmark) = self.list.get_mut(index) {
            bookmark.camera = camera;
        }
    }

    /// Takes one out of the list.
    pub fn remove(&mut self, index: usize) -> Option<Bookmark> {
        (index < self.list.len()).then(|| self.list.remove(index))
    }

    /// Writes the list into the file, beside those of other models.
    ///
    /// # Errors
    /// The file is damaged or newer, or cannot be written. It stays as it is.
    pub fn save(&self) -> Result<(), BookmarkError> {
        let mut document = read_document(&self.path)?;
        document.version = VERSION;
        if self.list.is_empty() {
            document.models.remove(&self.model);
        } else {
            document.models.insert(self.model.clone(), self.list.clone());
        }
        let failed = |cause| BookmarkError::Unwritable { cause, path: self.path.clone() };
        std::fs::create_dir_all(folder_of(&self.path)).map_err(failed)?;
        write_json(&self.path, &document)
    }

    fn free_name(&self, wanted: &str, besides: Option<usize>) -> String {
        let wanted = wanted.trim();
        let taken = |name: &str| {
            self.list.iter().enumerate().any(|(index, held)| Some(index) != besides && held.name == name)
        };
        let base = if wanted.is_empty() { "View" } else { wanted };
        let numbered = (2..).map(|number| format!("{base} {number}"));
        let first = if wanted.is_empty() { format!("{base} 1") } else { base.to_owned() };
        std::iter::once(first).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
    }
}

/// Moves a file that cannot be read out of the way, under a name that is free; gives that name.
///
/// # Errors
/// It cannot be renamed.
pub fn set_aside(path: &Path) -> Result<PathBuf, BookmarkError> {
    let named = |number: u32| {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".damaged-{number}"));
        PathBuf::from(name)
    };
    let free = (1..10_000).map(named).find(|name| !name.exists()).unwrap_or_else(|| named(0));
    std::fs::rename(path, &free)
        .map_err(|cause| BookmarkError::Unwritable { cause, path: path.to_owned() })?;
    Ok(free)
}

fn read_document(path: &Path) -> Result<Document, BookmarkError> {
    let Some(text) = read_bounded(path)? else { return Ok(Document::default()) };
    let damaged = |why: String| BookmarkError::Damaged { why, path: path.to_owned() };
    #[derive(Deserialize)]
    struct Version {
        version: u32,
    }
    let Version { version } = serde_json::from_slice(&text).map_err(|error| damaged(error.to_string()))?;
    if version > VERSION {
        return Err(BookmarkError::Newer { version, path: path.to_owned() });
    }
    let document: Document = serde_json::from_slice(&text).map_err(|error| damaged(error.to_string()))?;
    for bookmark in document.models.values().flatten() {
        Keyframes::new(vec![bookmark.camera]).map_err(|why| damaged(format!("{}: {why}", bookmark.name)))?;
    }
    Ok(document)
}

/// `None` where there is no such file.
fn read_bounded(path: &Path) -> Result<Option<Vec<u8>>, BookmarkError> {
    let unreadable = |cause| BookmarkError::Unreadable { cause, path: path.to_owned() };
    match std::fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(unreadable(error)),
        // Opening a pipe would wait for its other end.
        Ok(found) if !found.is_file() => return Err(unreadable(std::io::Error::other("it is not a file"))),
        Ok(_) => {}
    }
    let mut text = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut text).map_err(unreadable)?;
    if text.len() as u64 > MAX_FILE_BYTES {
        let why = format!("it is larger than {} MiB", MAX_FILE_BYTES >> 20);
        return Err(BookmarkError::Damaged { why, path: path.to_owned() });
    }
    Ok(Some(text))
}

/// Writes JSON through a temporary file beside it, so that it is never half there.
fn write_json(path: &Path, value: &impl Serialize) -> Result<(), BookmarkError> {
    let failed = |cause| BookmarkError::Unwritable { cause, path: path.to_owned() };
    let mut text = serde_json::to_vec_pretty(value).map_err(|error| failed(error.into()))?;
    text.push(b'\n');
    write_whole(path, |file| file.write_all(&text)).map_err(failed)
}

/// How far ahead the target of a camera's keyframe is best written: as far as the point that it turns about.
pub fn target_distance(camera: &Camera, pivot: DVec3) -> f64 {
    super::navigation::motions::depth_of(camera, pivot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::Parallel;
    use glam::DQuat;
    use proptest::prelude::*;

    fn camera(eye: DVec3, turned: DQuat) -> Camera {
        Camera { eye, world_from_view: turned, vertical_fov_radians: 0.7, near: 0.1, parallel: None }
    }

    fn file() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings/bookmarks.json");
        (folder, path)
    }

    #[test]
    fn bookmarks_come_back_and_those_of_other_models_stay() {
        let (_folder, path) = file();
        let camera = camera(DVec3::new(1.0, 2.0, 3.0), DQuat::from_rotation_y(0.3));
        let mut ship = Bookmarks::read(&path, "ship").unwrap();
        assert!(ship.list().is_empty());
        ship.add(Bookmark::new("bridge", &camera, 5.0));
        ship.save().unwrap();
        let mut plant = Bookmarks::read(&path, "plant").unwrap();
        plant.add(Bookmark::new("", &camera, 5.0));
        plant.save().unwrap();
        // JSON gives numbers back but for their last bit.
        let back = Bookmarks::read(&path, "ship").unwrap().list()[0].camera(0.1, 1.0).unwrap();
        assert!((back.eye - camera.eye).length() + (back.forward() - camera.forward()).length() < 1e-14);
        assert_eq!(Bookmarks::read(&path, "plant").unwrap().list()[0].name, "View 1");
        ship.remove(0);
        ship.save().unwrap();
        assert!(Bookmarks::read(&path, "ship").unwrap().list().is_empty());
        assert_eq!(Bookmarks::read(&path, "plant").unwrap().list().len(), 1);
        let left = std::fs::read_dir(path.parent().unwrap()).unwrap().count();
        assert_eq!(left, 1, "no temporary file is left");
    }

    #[test]
    fn names_are_never_the_same() {
        let mut bookmarks = Bookmarks::none(Path::new("none"), "model");
        let new = |name: &str| Bookmark::new(name, &camera(DVec3::ZERO, DQuat::IDENTITY), 1.0);
        for name in ["deck", " deck ", "", "", "deck"] {
            bookmarks.add(new(name));
        }
        bookmarks.rename(3, "deck");
        bookmarks.rename(0, "deck");
        bookmarks.rename(99, "nobody");
        let names: Vec<&str> = bookmarks.list().iter().map(|bookmark| bookmark.name.as_str()).collect();
        assert_eq!(names, ["deck", "deck 2", "View 1", "deck 4", "deck 3"]);
    }

    #[test]
    fn a_damaged_file_is_said_to_be_such_and_not_lost() {
        let damages = [
            "",
            "{",
            "[]",
            "{\"version\": 1, \"models\": 3}",
            "{\"version\":1,\"models\":{\"m\":[{\"name\":\"a\",\"camera\":{\"frame\":0,\"eye\":[0,0,0],\"target\":[0,0,0]}}]}}",
        ];
        for text in damages {
            let (_folder, path) = file();
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
            let error = Bookmarks::read(&path, "m").unwrap_err();
            assert!(matches!(error, BookmarkError::Damaged { .. }), "{text}: {error}");
            assert!(error.to_string().ends_with("bookmarks.json"), "{error}");
            let mut bookmarks = Bookmarks::none(&path, "m");
            bookmarks.add(Bookmark::new("a", &camera(DVec3::ZERO, DQuat::IDENTITY), 1.0));
            assert!(bookmarks.save().is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
            let aside = set_aside(&path).unwrap();
            assert_eq!(std::fs::read_to_string(aside).unwrap(), text);
            bookmarks.save().unwrap();
            assert_eq!(Bookmarks::read(&path, "m").unwrap().list()[0].name, "a");
        }
    }

    #[test]
    fn a_newer_file_and_a_folder_are_left_alone() {
        let (folder, path) = file();
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "{\"version\": 2, \"models\": \"other\"}").unwrap();
        assert!(matches!(Bookmarks::read(&path, "m"), Err(BookmarkError::Newer { version: 2, .. })));
        assert!(matches!(Bookmarks::read(folder.path(), "m"), Err(BookmarkError::Unreadable { .. })));
    }

    proptest! {
        #[test]
        fn a_camera_survives_being_a_keyframe(
            eye in prop::array::uniform3(-1e7..1e7), axis in prop::array::uniform3(-1.0..1.0), angle in 0.0..6.0,
            distance in 0.0..100.0, height in prop::option::of(0.001..1e4),
        ) {
            let axis = DVec3::from_array(axis);
            prop_assume!(axis.length() > 0.1);
            let turned = DQuat::from_axis_angle(axis.normalize(), angle);
            let parallel = height.map(|height| Parallel { height, reach: 9.0 });
            let camera = Camera { parallel, ..camera(DVec3::from_array(eye), turned) };
            let back = Bookmark::new("x", &camera, distance).camera(0.1, 9.0).unwrap();
            prop_assert_eq!(back.eye, camera.eye);
            prop_assert_eq!(back.parallel, camera.parallel);
            prop_assert!((back.vertical_fov_radians - 0.7).abs() < 1e-12);
            let off = (back.forward() - camera.forward()).length().max((back.up() - camera.up()).length());
            prop_assert!(off < 1e-8, "{off}");
        }
    }
}
