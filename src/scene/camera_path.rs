//! Deterministic, frame-indexed camera paths: a name or a file of keyframes in, one [`Camera`] per frame out.
//!
//! Built-in paths know nothing but the bounds of the scene, and have no state: the camera of a frame is a function of
//! its index, so that any frame of any flight can be repeated alone. +y is up. Every position is formed relative to
//! the centre and every direction is exact before the centre is added, so that a scene far from the origin flies as
//! smoothly as one at it.

mod keyframes;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::Bounds;
use super::camera::{Camera, DEFAULT_VERTICAL_FOV_RADIANS, orientation};
use super::views::{near_of, reach_of};
pub use keyframes::{Keyframe, Keyframes};

/// How many frames `teleport` stays at one view.
pub const TELEPORT_FRAMES: u64 = 10;

/// The most that `walk` moves in one frame, as a fraction of the scene's diagonal.
pub const WALK_STEP: f64 = 1.0 / 2000.0;

/// The most that `walk` turns in one frame.
pub const WALK_TURN_DEGREES: f64 = 0.1;

/// A camera path that cannot be had. The path or name comes last in every message.
#[derive(Debug, thiserror::Error)]
pub enum CameraPathError {
    /// Neither a built-in name nor a file.
    #[error(
        "no such camera path: use orbit, walk, through, still, teleport, or a JSON file of keyframes: {0}"
    )]
    Unknown(String),
    /// The file cannot be read.
    #[error("cannot read the camera path ({1}): {0}")]
    Unreadable(PathBuf, std::io::Error),
    /// The file is larger than any path.
    #[error("the camera path is larger than {limit_mib} MiB: {path}", limit_mib = keyframes::MAX_FILE_BYTES >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The file is no JSON array of keyframes.
    #[error("the camera path is not a JSON array of {{\"frame\", \"eye\", \"target\"}} ({1}): {0}")]
    Malformed(PathBuf, serde_json::Error),
    /// The keyframes contradict themselves.
    #[error("the camera path is not usable ({1}): {0}")]
    Unusable(PathBuf, String),
}

/// A deterministic flight.
#[derive(Debug, Clone, PartialEq)]
pub enum CameraPath {
    /// Once round the scene, slightly above it.
    Orbit,
    /// A slow walk in small steps: at most [`WALK_STEP`] and [`WALK_TURN_DEGREES`] a frame, into the model and out.
    Walk,
    /// Through the whole length of the scene along its longest axis.
    Through,
    /// One fixed overview.
    Still,
    /// A new pseudo-random view, inside or around the scene, every [`TELEPORT_FRAMES`] frames.
    Teleport,
    /// Keyframes from a file.
    Keyframes(Keyframes),
}

impl CameraPath {
    /// The built-in path of that name, or the keyframes in the JSON file of that path.
    ///
    /// # Errors
    /// When it is neither, or the file cannot be read, is malformed, or holds unusable keyframes.
    pub fn parse(name_or_json_path: &str) -> Result<Self, CameraPathError> {
        Ok(match name_or_json_path {
            "orbit" => Self::Orbit,
            "walk" => Self::Walk,
            "through" => Self::Through,
            "still" => Self::Still,
            "teleport" => Self::Teleport,
            path => Self::Keyframes(Keyframes::read(Path::new(path))?),
        })
    }

    /// The word for reports; a file of keyframes is `keyframes`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Orbit => "orbit",
            Self::Walk => "walk",
            Self::Through => "through",
            Self::Still => "still",
            Self::Teleport => "teleport",
            Self::Keyframes(_) => "keyframes",
        }
    }

    /// The camera of frame `frame` of a flight of `frames` frames round `bounds`.
    pub fn camera(&self, frame: u64, frames: u64, bounds: &Bounds) -> Camera {
        let stage = Stage::of(bounds);
        match self {
            Self::Orbit => stage.orbit(frame as f64 / frames.max(1) as f64),
            Self::Walk => stage.walk(frame as f64),
            Self::Through => stage.through(frame as f64 / frames.saturating_sub(1).max(1) as f64),
            Self::Still => stage.still(),
            Self::Teleport => stage.teleport(frame / TELEPORT_FRAMES),
            Self::Keyframes(keyframes) => keyframes.camera(frame, near_of(bounds), reach_of(bounds)),
        }
    }
}

/// The scene as the built-in paths see it.
struct Stage {
    centre: DVec3,
    extent: DVec3,
    /// See [`Bounds::scale`].
    diagonal: f64,
    near: f64,
    /// The longer of the two horizontal axes, and the other: long things are shown from the side.
    long: DVec3,
    side: DVec3,
}

impl Stage {
    fn of(bounds: &Bounds) -> Self {
        let extent = bounds.extent().min(DVec3::splat(bounds.scale()));
        let (long, side) = if extent.x >= extent.z { (DVec3::X, DVec3::Z) } else { (DVec3::Z, DVec3::X) };
        Self { centre: bounds.centre(), extent, diagonal: bounds.scale(), near: near_of(bounds), long, side }
    }

    /// A camera at `offset` from the centre that looks along `direction`.
    fn camera(&self, offset: DVec3, direction: DVec3) -> Camera {
        Camera {
            eye: self.centre + offset,
            world_from_view: orientation(direction, DVec3::Y),
            vertical_fov_radians: DEFAULT_VERTICAL_FOV_RADIANS,
            near: self.near,
            parallel: None,
        }
    }

    /// The unit direction at an azimuth, counted from the side of the scene, and an elevation, in radians.
    fn direction(&self, azimuth: f64, elevation: f64) -> DVec3 {
        let horizontal = self.side * azimuth.cos() + self.long * azimuth.sin();
        horizontal * elevation.cos() + DVec3::Y * elevation.sin()
    }

    fn orbit(&self, turns: f64) -> Camera {
        let outward = self.direction(TAU * turns, 0.35);
        self.camera(outward * self.diagonal, -outward)
    }

    fn still(&self) -> Camera {
        let outward = self.direction(0.6, 0.4);
        self.camera(outward * (0.9 * self.diagonal), -outward)
    }

    /// Swings between 0.83 and 0.33 diagonals from the centre while it drifts round, up and down.
    ///
    /// Per frame it moves in the three directions by at most 3.93e-4 (radius), 0.83 * 3e-4 (azimuth) and
    /// 0.83 * 1.78e-4 (elevation) diagonals: 4.9e-4 in all, below [`WALK_STEP`]. It turns by at most 3.5e-4 rad to
    /// keep the centre in the middle, and 5.5e-4 rad by glancing about: 0.052 degrees, below [`WALK_TURN_DEGREES`].
    fn walk(&self, frame: f64) -> Camera {
        let radius = 0.58 + 0.25 * (0.5 + TAU * frame / 4000.0).cos();
        let azimuth = 0.5 + 3e-4 * frame;
        let elevation = 0.32 + 0.15 * (TAU * frame / 5300.0).sin();
        let glance = 0.12 * (TAU * frame / 1400.0).sin();
        let offset = self.direction(azimuth, elevation) * (radius * self.diagonal);
        self.camera(offset, -self.direction(azimuth + glance, elevation))
    }

    fn through(&self, progress: f64) -> Camera {
        let axis = self.longest_axis();
        let half = 0.5 * self.extent.dot(axis);
        let from = -half - 0.15 * self.diagonal;
        let to = half + 0.05 * self.diagonal;
        self.camera(axis * (from + (to - from) * progress), axis)
    }

    fn longest_axis(&self) -> DVec3 {
        if self.extent.y > self.extent.dot(self.long) { DVec3::Y } else { self.long }
    }

    /// Every other view is inside the scene; the rest are up to a diagonal away from the centre.
    fn teleport(&self, view: u64) -> Camera {
        let inside = self.random_point(view, 0);
        let around = self.direction(TAU * random(view, 3), 1.4 * (random(view, 4) - 0.3))
            * (self.diagonal * (0.45 + 0.55 * random(view, 5)));
        let offset = if view.is_multiple_of(2) { around } else { inside };
        let direction = self.random_point(view, 6) * 0.6 - offset;
        let usable = direction.length() > 1e-6 * self.diagonal;
        self.camera(offset, if usable { direction } else { self.long })
    }

    /// A point of the box, relative to the centre.
    fn random_point(&self, view: u64, from: u64) -> DVec3 {
        let at = DVec3::new(random(view, from), random(view, from + 1), random(view, from + 2));
        (at - 0.5) * self.extent
    }
}

/// A number in 0..1 made of two integers by the finaliser of SplitMix64 (Steele et al. 2014).
fn random(view: u64, which: u64) -> f64 {
    let mut z =
        view.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ which.wrapping_add(1).wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The angle between two orientations' directions of view, in degrees, precise for small ones.
#[cfg(test)]
fn turn_degrees(a: glam::DQuat, b: glam::DQuat) -> f64 {
    let [a, b] = [a, b].map(|q| q * DVec3::NEG_Z);
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

#[cfg(test)]
mod tests;
