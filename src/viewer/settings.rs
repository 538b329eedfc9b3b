//! What the viewer remembers from one session to the next: a small JSON file, read with forgiveness, written whole.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use super::layout::Arrangement;
use super::measure::Units;
use super::mouse::Preset;
use crate::frame::{Settings as RenderSettings, Spending};
use crate::scene::turntable::MOST_PICTURES;
use crate::scene::views::UpAxis;
use crate::stream::Strategy;
use crate::whole_file::{folder_of, write_whole};

/// The environment variable with the folder for the viewer's files.
pub const CONFIG_VARIABLE: &str = "COLLAPSAR_CONFIG";
/// So many files that were opened last are remembered.
const MOST_RECENT: usize = 12;
/// A file of settings is no larger.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Why settings cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// They are there and cannot be read.
    #[error("the settings cannot be read and were left as they are; defaults are used until they are mended or removed: {cause}: {}", path.display())]
    Read {
        /// Why.
        cause: String,
        /// The file.
        path: PathBuf,
    },
    /// They cannot be written.
    #[error("the settings could not be saved: {cause}: {}", path.display())]
    Write {
        /// Why.
        cause: std::io::Error,
        /// The file.
        path: PathBuf,
    },
}

/// The interface's colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Theme {
    /// As the system says.
    #[default]
    System,
    /// Dark on light.
    Light,
    /// Light on dark.
    Dark,
}

/// What the viewer remembers. Bytes are bytes, lengths of errors pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Colours.
    pub theme: Theme,
    /// The interface's size, 1 as the system says.
    pub zoom: f32,
    /// Which buttons do what.
    pub mouse: Preset,
    /// What lengths are told in.
    pub units: Units,
    /// The axis that points upwards.
    pub up: UpAxis,
    /// Without perspective.
    pub parallel: bool,
    /// Vertices to spend.
    pub budget_vertices: u32,
    /// No more is spent on an instance than keeps its error below so many pixels; 0: no such limit.
    pub error_px: f32,
    /// The paper's alpha.
    pub alpha: f32,
    /// How data is sent.
    pub strategy: Strategy,
    /// The most memory for the model.
    pub memory_bytes: Option<u64>,
    /// The most memory of the graphics card.
    pub gpu_memory_bytes: Option<u64>,
    /// The most that is sent in a frame.
    pub upload_bytes: Option<u64>,
    /// Reads no more a second, to see what a slow disk does.
    pub read_rate: Option<u64>,
    /// How much depth is shaded, 0 to 2.
    pub depth_cue: f32,
    /// Samples a pixel, 1 or 4.
    pub samples: u32,
    /// Pictures of a turntable.
    pub turntable_pictures: u32,
    /// Files that were opened last, the last first.
    pub recent: Vec<PathBuf>,
    /// The window; nothing until there was one.
    #[serde(deserialize_with = "if_understood")]
    pub window: Option<WindowShape>,
    /// Which panels are where; nothing for the first layout.
    #[serde(deserialize_with = "if_understood")]
    pub layout: Option<Arrangement>,
}

/// What is there, if it can be understood: nobody loses other settings for a layout of tomorrow.
fn if_understood<'de, T: DeserializeOwned, D: Deserializer<'de>>(from: D) -> Result<Option<T>, D::Error> {
    let value = serde_json::Value::deserialize(from)?;
    Ok(serde_json::from_value(value).ok())
}

/// How large the window is, in points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WindowShape {
    /// Where it does not fill the screen.
    pub width: f32,
    /// Likewise.
    pub height: f32,
    /// Whether it fills the screen.
    pub is_maximised: bool,
}

impl Default for WindowShape {
    fn default() -> Self {
        Self { width: 1280.0, height: 800.0, is_maximised: false }
    }
}

impl WindowShape {
    /// What is to be remembered of a window of so many points that had this shape before: where it fills the screen, the
    /// size that it will have when it does not any more.
    pub fn after(self, [width, height]: [f32; 2], is_maximised: bool) -> Self {
        let is_size = !is_maximised && width >= 1.0 && height >= 1.0;
        let (width, height) = if is_size { (width, height) } else { (self.width, self.height) };
        Self { width, height, is_maximised }.sane()
    }

    fn sane(self) -> Self {
        let within = |side: f32, otherwise: f32| {
            if side.is_finite() { side.clamp(320.0, 16_384.0) } else { otherwise }
        };
        Self { width: within(self.width, 1280.0), height: within(self.height, 800.0), ..self }
    }
}

/// The vertices that a kind of adapter is given to begin with: for each about 100 bytes of
/// its memory and two triangles. Not measured on cards: a start, and a knob beside it.
pub fn first_budget(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 4_000_000,
        wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::VirtualGpu => 2_000_000,
        wgpu::DeviceType::Cpu | wgpu::DeviceType::Other => 1_000_000,
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: Theme::default(),
            zoom: 1.0,
            mouse: Preset::default(),
            units: Units::default(),
            up: UpAxis::default(),
            parallel: false,
            budget_vertices: first_budget(wgpu::DeviceType::Other),
            error_px: 1.0,
            alpha: 3.0,
            strategy: Strategy::Coherent,
            memory_bytes: None,
            gpu_memory_bytes: None,
            upload_bytes: Some(32 << 20),
            read_rate: None,
            depth_cue: 0.6,
            samples: 4,
            turntable_pictures: 72,
            recent: Vec::new(),
            window: None,
            layout: None,
        }
    }
}

impl Settings {
    /// What may change from frame to frame.
    pub fn spending(&self) -> Spending {
        Spending {
            budget_vertices: self.budget_vertices,
            alpha: self.alpha,
            error_px: self.error_px,
            strategy: self.strategy,
            upload_limit_bytes: self.upload_bytes,
        }
    }

    /// What a renderer is made with. Frames do not wait for the disk.
    pub fn render(&self) -> RenderSettings {
        RenderSettings {
            budget_vertices: self.budget_vertices,
            alpha: self.alpha,
            error_px: self.error_px,
            strategy: self.strategy,
            upload_limit_bytes: self.upload_bytes,
            memory_limit_bytes: self.memory_bytes,
            gpu_limit_bytes: self.gpu_memory_bytes,
            read_rate: self.read_rate,
            settle: false,
            time_stages: false,
            width: 16,
            height: 16,
            samples: self.samples,
            ..RenderSettings::default()
        }
    }

    /// Remembers a file as the one that was opened last.
    pub fn opened(&mut self, file: &Path) {
        self.forget(file);
        self.recent.insert(0, absolute(file));
        self.recent.truncate(MOST_RECENT);
    }

    /// Takes a file off the list of those that were opened last; says whether it was on it.
    pub fn forget(&mut self, file: &Path) -> bool {
        let file = absolute(file);
        let known = self.recent.len();
        self.recent.retain(|known| *known != file);
        self.recent.len() < known
    }

    /// Numbers that make sense, whatever the file said.
    fn sane(self) -> Self {
        let within = |value: f32, low: f32, high: f32, otherwise: f32| {
            if value.is_finite() { value.clamp(low, high) } else { otherwise }
        };
        Self {
            zoom: within(self.zoom, 0.5, 3.0, 1.0),
            budget_vertices: self.budget_vertices.clamp(1000, u32::MAX - 1),
            error_px: within(self.error_px, 0.0, 1000.0, 1.0),
            alpha: within(self.alpha, 1.0, 10.0, 3.0),
            depth_cue: within(self.depth_cue, 0.0, 2.0, 0.6),
            samples: if self.samples == 1 { 1 } else { 4 },
            turntable_pictures: self.turntable_pictures.clamp(2, MOST_PICTURES),
            window: self.window.map(WindowShape::sane),
            ..self
        }
    }
}

/// Where the viewer's files are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Store {
    folder: Option<PathBuf>,
}

impl Store {
    /// In the folder that the environment names, else in the user's folder for settings.
    pub fn of_user() -> Self {
        let named = std::env::var_os(CONFIG_VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
        Self { folder: named.or_else(|| dirs::config_dir().map(|folder| folder.join("collapsar"))) }
    }

    /// In a folder.
    pub fn in_folder(folder: &Path) -> Self {
        Self { folder: Some(folder.to_owned()) }
    }

    /// The folder, if there is any; it may not exist yet.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Reads the settings; without a file, the defaults. What the file lacks has its default, and what it has too much is
    /// nobody's.
    ///
    /// # Errors
    /// The file is there and cannot be read or understood.
    pub fn load(&self) -> Result<Settings, SettingsError> {
        let Some(path) = self.file() else { return Ok(Settings::default()) };
        let failed = |cause: String| SettingsError::Read { cause, path: path.clone() };
        let metadata = match std::fs::metadata(&path) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Settings::default()),
            Err(error) => return Err(failed(error.to_string())),
        };
        if !metadata.is_file() || metadata.len() > MAX_FILE_BYTES {
            return Err(failed("it is not a small file".to_owned()));
        }
        let text = std::fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
        // Settings could be a list as well, and an empty one would stand for the first ones.
        if text.trim_start().starts_with('[') {
            return Err(failed("it is a list, and not settings by name".to_owned()));
        }
        let settings: Settings = serde_json::from_str(&text).map_err(|error| failed(error.to_string()))?;
        Ok(settings.sane())
    }

    /// Writes the settings, whole or not at all.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn save(&self, settings: &Settings) -> Result<(), SettingsError> {
        let Some(path) = self.file() else { return Ok(()) };
        let failed = |cause| SettingsError::Write { cause, path: path.clone() };
        std::fs::create_dir_all(folder_of(&path)).map_err(failed)?;
        write_whole(&path, |file| Ok(serde_json::to_writer_pretty(file, settings)?)).map_err(failed)
    }

    /// Whether settings were ever saved.
    pub fn has_settings(&self) -> bool {
        self.file().is_some_and(|file| file.exists())
    }

    fn file(&self) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join("settings.json"))
    }
}

fn absolute(file: &Path) -> PathBuf {
    std::path::absolute(file).unwrap_or_else(|_| file.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::layout::Layout;

    #[test]
    fn settings_come_back_as_they_were_saved() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::in_folder(&folder.path().join("not there yet"));
        assert_eq!(store.load().unwrap(), Settings::default());
        let mut settings = Settings {
            theme: Theme::Dark,
            budget_vertices: 12_345,
            memory_bytes: Some(1 << 30),
            window: Some(WindowShape { width: 900.5, height: 700.0, is_maximised: true }),
            layout: Layout::default().arrangement(),
            ..Settings::default()
        };
        for name in ["/a", "/b", "/a"] {
            settings.opened(Path::new(name));
        }
        assert_eq!(settings.recent, [PathBuf::from("/a"), PathBuf::from("/b")]);
        store.save(&settings).unwrap();
        assert_eq!(store.load().unwrap(), settings);
        assert_eq!(std::fs::read_dir(store.folder().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn a_graphics_card_gets_more_than_the_processor() {
        use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu};
        assert!([DiscreteGpu, IntegratedGpu, Cpu].map(first_budget).is_sorted_by(|a, b| a > b));
        assert_eq!(Settings::default().budget_vertices, first_budget(Cpu));
    }

    #[test]
    fn a_damaged_file_is_said_to_be_one_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (store, path) = (Store::in_folder(folder.path()), folder.path().join("settings.json"));
        for text in ["", "{", "[]", "7", "{\"alpha\": \"three\"}", "{\"theme\": \"pink\"}"] {
            std::fs::write(&path, text).unwrap();
            let message = store.load().unwrap_err().to_string();
            assert!(message.ends_with("settings.json"), "{message}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        std::fs::write(&path, "{\"alpha\": 1e30, \"zoom\": -3, \"samples\": 7, \"of tomorrow\": 1}").unwrap();
        let settings = store.load().unwrap();
        assert_eq!((settings.alpha, settings.zoom, settings.samples), (10.0, 0.5, 4));
    }

    #[test]
    fn a_layout_or_window_that_is_not_understood_costs_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let (store, path) = (Store::in_folder(folder.path()), folder.path().join("settings.json"));
        for odd in
            ["7", "null", "{}", "[1,2]", "{\"version\":9,\"shows_panels\":true,\"place\":{\"spiral\":3}}"]
        {
            let text = format!("{{\"alpha\": 4, \"layout\": {odd}, \"window\": {odd}}}");
            std::fs::write(&path, text).unwrap();
            let settings = store.load().unwrap();
            assert_eq!((settings.alpha, settings.layout, settings.window), (4.0, None, None), "{odd}");
        }
        let text = "{\"window\": {\"width\": 1e9, \"height\": -3, \"is_maximised\": false}}";
        std::fs::write(&path, text).unwrap();
        let window = store.load().unwrap().window.unwrap();
        assert_eq!((window.width, window.height), (16_384.0, 320.0));
    }

    #[test]
    fn a_window_that_fills_the_screen_or_is_minimised_keeps_the_size_it_had() {
        let shape = WindowShape::default().after([900.0, 600.0], false);
        assert_eq!((shape.width, shape.height, shape.is_maximised), (900.0, 600.0, false));
        let shape = shape.after([1920.0, 1080.0], true);
        assert_eq!((shape.width, shape.height, shape.is_maximised), (900.0, 600.0, true));
        let shape = shape.after([0.0, 0.0], false);
        assert_eq!((shape.width, shape.height, shape.is_maximised), (900.0, 600.0, false));
    }
}
