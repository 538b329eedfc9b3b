//! A file that the user wants to see in, an opened scene out, on a thread of its own: what is no container is baked
//! beside itself first, with progress and a way to stop.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

use super::assembly::Assembly;
use super::search::Search;
use crate::bake::beside::{Beside, beside};
use crate::bake::{BakeError, BakeOptions, BakeProgress, bake};
use crate::scene::{Scene, SceneCounts};

/// A scene and what the panels look up in it.
pub struct Loaded {
    /// The file that was asked for.
    pub file: PathBuf,
    /// The container.
    pub container: PathBuf,
    /// The model.
    pub scene: Arc<Scene>,
    /// Its tree.
    pub assembly: Arc<Assembly>,
    /// What is looked up by name in it.
    pub search: Search,
    /// How large it is.
    pub counts: SceneCounts,
}

/// How far it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub doing: &'static str,
    /// The share of it that is done, where that is known.
    pub share: Option<f32>,
    /// In words: counts with their units.
    pub counts: String,
}

/// Work on a file.
pub struct Loader {
    file: PathBuf,
    progress: Arc<BakeProgress>,
    thread: Option<JoinHandle<Result<Option<Loaded>, String>>>,
}

impl Loader {
    /// Starts; `wake` is called when it is done.
    pub fn new(file: &Path, wake: impl Fn() + Send + 'static) -> Self {
        let progress = Arc::new(BakeProgress::default());
        let (path, theirs) = (file.to_owned(), Arc::clone(&progress));
        let thread = std::thread::spawn(move || {
            let result = load(&path, &theirs);
            wake();
            result
        });
        Self { file: file.to_owned(), progress, thread: Some(thread) }
    }

    /// The file that was asked for.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Asks it to stop; what a bake has done so far stays beside the model, and the next goes on with it.
    pub fn cancel(&self) {
        self.progress.cancelled.store(true, Ordering::Relaxed);
    }

    /// The result, once: `Ok(None)` if it was stopped. `None` while it works.
    pub fn finished(&mut self) -> Option<Result<Option<Loaded>, String>> {
        if !self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            return None;
        }
        let died = |_| Err("the bake ended without a word, which is a bug of this program".to_owned());
        self.thread.take().map(|thread| thread.join().unwrap_or_else(died))
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        let get = |counter: &std::sync::atomic::AtomicU64| counter.load(Ordering::Relaxed);
        let share = |done: u64, total: u64| (total > 0).then(|| done as f32 / total as f32);
        let (done, total) = (get(&self.progress.triangles_done), get(&self.progress.triangles_total));
        if self.progress.writing.load(Ordering::Relaxed) {
            let (done, total) = (get(&self.progress.bytes_written), get(&self.progress.bytes_total));
            let counts = format!("{} of {} MB", done / 1_000_000, total / 1_000_000);
            return Progress { doing: "Writing the container", share: share(done, total), counts };
        }
        if total > 0 {
            let count = crate::stats::report::human::count;
            let counts = format!("{} of {} triangles", count(done), count(total));
            return Progress { doing: "Ordering the model for viewing", share: share(done, total), counts };
        }
        Progress { doing: "Reading", share: None, counts: String::new() }
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.cancel();
        if let Some(thread) = self.thread.take() {
            // Nobody wants the result any more.
            let _ = thread.join();
        }
    }
}

fn load(file: &Path, progress: &BakeProgress) -> Result<Option<Loaded>, String> {
    let wrong = |error: &dyn std::fmt::Display| error.to_string();
    let found = beside(file).map_err(|cause| format!("cannot open: {cause}: {}", file.display()))?;
    let container = match found {
        Beside::Container(container) => container,
        Beside::ToBake(container) => match bake_beside(file, &container, progress) {
            Ok(()) => container,
            Err(BakeError::Interrupted | BakeError::Stopped { cause: None, .. }) => return Ok(None),
            Err(error) => return Err(wrong(&error)),
        },
    };
    if progress.cancelled.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let scene = Arc::new(Scene::open(&container).map_err(|error| wrong(&error))?);
    let counts = scene.counts();
    let assembly = Arc::new(Assembly::of(&scene));
    let search = Search::new(&assembly, scene.as_ref());
    Ok(Some(Loaded { file: file.to_owned(), container, scene, assembly, search, counts }))
}

fn bake_beside(model: &Path, container: &Path, progress: &BakeProgress) -> Result<(), BakeError> {
    let inputs = [model.to_owned()];
    match bake(&inputs, container, &BakeOptions { resume: true, ..BakeOptions::default() }, progress) {
        // What was begun there does not belong to this model any more.
        Err(BakeError::OtherWork { .. } | BakeError::NotAWorkFolder { .. }) => {
            bake(&inputs, container, &BakeOptions::default(), progress).map(drop)
        }
        result => result.map(drop),
    }
}
