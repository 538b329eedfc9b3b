//! Keyframes from a JSON file: read within bounds, checked, interpolated.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::CameraPathError;
use crate::scene::camera::{Camera, DEFAULT_VERTICAL_FOV_RADIANS, Parallel, orientation};

/// The largest file that is read.
pub(super) const MAX_FILE_BYTES: u64 = 64 << 20;

/// Coordinates beyond this do not survive the way through f32.
const MAX_COORDINATE: f64 = 1e30;

/// One key as the file states it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// The frame at which the camera is there.
    pub frame: u64,
    /// The eye in world space.
    pub eye: [f64; 3],
    /// What the camera looks at, in world space.
    pub target: [f64; 3],
    /// The direction that is upwards in the picture; +y where it is left out.
    #[serde(default = "default_up")]
    pub up: [f64; 3],
    /// The vertical field of view.
    #[serde(default = "default_fov_degrees")]
    pub fov_degrees: f64,
    /// Without perspective: world units between the lower and the upper edge of a picture around the eye.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parallel_height: Option<f64>,
}

fn default_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn default_fov_degrees() -> f64 {
    DEFAULT_VERTICAL_FOV_RADIANS.to_degrees()
}

/// Checked keyframes: at least one, with increasing frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Keyframes(Vec<Keyframe>);

impl Keyframes {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// When the file does not exist, cannot be read, is too large or malformed, or its keys are unusable.
    pub fn read(path: &Path) -> Result<Self, CameraPathError> {
        let text = read_bounded(path)?;
        let keys: Vec<Keyframe> =
            serde_json::from_slice(&text).map_err(|error| CameraPathError::Malformed(path.into(), error))?;
        Self::new(keys).map_err(|why| CameraPathError::Unusable(path.into(), why))
    }

    /// Checks keyframes.
    ///
    /// # Errors
    /// Says which key is unusable, and why.
    pub fn new(keys: Vec<Keyframe>) -> Result<Self, String> {
        if keys.is_empty() {
            return Err("it has no keyframe; give at least one".into());
        }
        for (index, key) in keys.iter().enumerate() {
            check(key).map_err(|why| format!("keyframe {index}: {why}"))?;
        }
        match keys.windows(2).position(|pair| pair[0].frame >= pair[1].frame) {
            Some(index) => Err(format!("keyframe {}: frames must increase", index + 1)),
            None => Ok(Self(keys)),
        }
    }

    /// The keyframes.
    pub fn keys(&self) -> &[Keyframe] {
        &self.0
    }

    /// Reads and checks one keyframe, or a list of them.
    ///
    /// # Errors
    /// When the text is malformed, or its keys are unusable.
    pub fn parse(text: &str) -> Result<Self, CameraPathError> {
        let here = || PathBuf::from("given as text");
        let keys = match text.trim_start().starts_with('{') {
            true => serde_json::from_str(text).map(|key| vec![key]),
            false => serde_json::from_str(text),
        };
        let keys = keys.map_err(|error| CameraPathError::Malformed(here(), error))?;
        Self::new(keys).map_err(|why| CameraPathError::Unusable(here(), why))
    }

    /// The camera of a frame: before the first key and after the last it stays there, between two keys eye and field
    /// of view go straight and the orientation takes the shortest way.
    /// Without perspective, `reach` in front of the eye and behind it is seen.
    pub fn camera(&self, frame: u64, near: f64, reach: f64) -> Camera {
        let next = self.0.partition_point(|key| key.frame <= frame);
        let a = &self.0[next.saturating_sub(1)];
        let b = &self.0[next.min(self.0.len() - 1)];
        let span = b.frame.saturating_sub(a.frame).max(1);
        let t = frame.saturating_sub(a.frame).min(span) as f64 / span as f64;
        Camera {
            eye: DVec3::from_array(a.eye).lerp(DVec3::from_array(b.eye), t),
            world_from_view: orientation_of(a).slerp(orientation_of(b), t).normalize(),
            vertical_fov_radians: (a.fov_degrees + (b.fov_degrees - a.fov_degrees) * t).to_radians(),
            near,
            parallel: a.parallel_height.map(|height| {
                let next = b.parallel_height.unwrap_or(height);
                Parallel { height: height + (next - height) * t, reach }
            }),
        }
    }
}

fn read_bounded(path: &Path) -> Result<Vec<u8>, CameraPathError> {
    let unreadable = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => CameraPathError::Unknown(path.display().to_string()),
        _ => CameraPathError::Unreadable(path.into(), error),
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    // Opening a pipe would wait for its other end.
    if !metadata.is_file() {
        return Err(unreadable(std::io::Error::other("it is not a file")));
    }
    let mut text = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_end(&mut text))
        .map_err(unreadable)?;
    if text.len() as u64 > MAX_FILE_BYTES {
        Err(CameraPathError::TooLarge { path: path.into() })
    } else {
        Ok(text)
    }
}

fn orientation_of(key: &Keyframe) -> DQuat {
    let [eye, target, up] = [key.eye, key.target, key.up].map(DVec3::from_array);
    orientation(target - eye, up)
}

fn check(key: &Keyframe) -> Result<(), String> {
    let usable = |v: &[f64; 3]| v.iter().all(|c| c.abs() <= MAX_COORDINATE);
    let fov = key.fov_degrees;
    if !usable(&key.eye) || !usable(&key.target) || !usable(&key.up) {
        Err(format!("coordinates must be finite and at most {MAX_COORDINATE:e}"))
    } else if key.eye == key.target {
        Err("eye and target must differ".into())
    } else if key.up == [0.0; 3] {
        Err("up must not be zero".into())
    } else if !(1.0..=170.0).contains(&fov) {
        Err(format!("fov_degrees must be from 1 to 170, not {fov}"))
    } else if let Some(height) = key.parallel_height
        && !(height > 0.0 && height <= MAX_COORDINATE)
    {
        Err(format!("parallel_height must be above 0 and at most {MAX_COORDINATE:e}, not {height}"))
    } else {
        Ok(())
    }
}
