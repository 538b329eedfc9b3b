//! Cameras recorded one by one in, a path out: replayed smoothly here, and saved as the JSON that `fly --path` replays.
//!
//! A path goes through its keys along splines whose slope at a key is that from the key before to the key after, so that
//! neither place nor direction has a kink there. `fly` goes straight between keys; a path that is to look the same
//! there is saved with a key for every frame.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::{BookmarkError, keyframe_of, write_json};
use crate::scene::Camera;
use crate::scene::camera::{Parallel, orientation};
use crate::scene::camera_path::{Keyframe, Keyframes};
use crate::scene::turntable::turned;

/// How many frames lie between two keys that are recorded one after another: two seconds of 30 frames.
pub const DEFAULT_SPACING: u64 = 60;
/// The most frames of a path: as many keys as `fly` reads from one file.
pub const MAX_FRAMES: u64 = 200_000;

/// The keys of a path, with increasing frames that start at 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recorder {
    keys: Vec<Keyframe>,
}

/// What is written of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Save {
    /// The keys as they were recorded; `fly` goes straight between them.
    Keys,
    /// A key for every frame of the smooth path.
    Smooth,
}

impl Recorder {
    /// A path of keys that were checked.
    pub fn of(keyframes: &Keyframes) -> Self {
        let first = keyframes.keys().first().map_or(0, |key| key.frame);
        let shifted = keyframes.keys().iter().map(|key| Keyframe { frame: key.frame - first, ..*key });
        Self { keys: shifted.collect() }
    }

    /// Reads a path that was saved, or made for `fly`.
    ///
    /// # Errors
    /// The file cannot be read, or is not a path.
    pub fn read(path: &Path) -> Result<Self, BookmarkError> {
        Ok(Self::of(&Keyframes::read(path)?))
    }

    /// The keys.
    pub fn keys(&self) -> &[Keyframe] {
        &self.keys
    }

    /// The number of the last frame; 0 for a path of one key or none.
    pub fn last_frame(&self) -> u64 {
        self.keys.last().map_or(0, |key| key.frame)
    }

    /// Records a camera that looks at something so far away, so many frames after the last key. Gives whether there was
    /// room for it.
    pub fn record(&mut self, camera: &Camera, distance: f64, spacing: u64) -> bool {
        let frame = if self.keys.is_empty() { 0 } else { self.last_frame() + spacing.max(1) };
        let fits = frame < MAX_FRAMES;
        if fits {
            self.keys.push(keyframe_of(camera, frame, distance));
        }
        fits
    }

    /// Takes a key out; those after it come earlier by the time that it took.
    pub fn remove(&mut self, index: usize) {
        let Some(key) = self.keys.get(index) else { return };
        let next = self.keys.get(index + 1).map_or(key.frame, |next| next.frame);
        let earlier = next - key.frame;
        self.keys.remove(index);
        self.keys[index..].iter_mut().for_each(|key| key.frame -= earlier);
    }

    /// Forgets all keys.
    pub fn clear(&mut self) {
        self.keys.clear();
    }

    /// Puts the keys at equal distances in time.
    pub fn space(&mut self, frames: u64) {
        let frames = frames.clamp(1, (MAX_FRAMES - 1) / (self.keys.len() as u64).max(1));
        for (number, key) in (0u64..).zip(&mut self.keys) {
            key.frame = number * frames;
        }
    }

    /// The camera at a frame, or between two: `None` where there are no keys.
    pub fn camera_at(&self, frame: f64, near: f64, reach: f64) -> Option<Camera> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        let frame = if frame.is_finite() { frame } else { 0.0 };
        let frame = frame.clamp(first.frame as f64, last.frame as f64);
        let next = self.keys.partition_point(|key| (key.frame as f64) <= frame).max(1);
        let Some(b) = self.keys.get(next) else { return Some(Knot::of(last).camera(near, reach)) };
        let a = &self.keys[next - 1];
        let span = Span {
            before: next.checked_sub(2).map(|index| &self.keys[index]),
            a,
            b,
            after: self.keys.get(next + 1),
        };
        Some(span.camera((frame - a.frame as f64) / (b.frame - a.frame) as f64, near, reach))
    }

    /// What `fly` reads.
    ///
    /// # Errors
    /// There is no key, the path is too long, or a key cannot be replayed.
    pub fn saved(&self, save: Save) -> Result<Keyframes, String> {
        let keys = match save {
            Save::Keys => self.keys.clone(),
            Save::Smooth if self.last_frame() >= MAX_FRAMES => {
                return Err(format!("it has more than {MAX_FRAMES} frames"));
            }
            Save::Smooth => (0..=self.last_frame()).filter_map(|frame| self.sampled(frame)).collect(),
        };
        Keyframes::new(keys)
    }

    fn sampled(&self, frame: u64) -> Option<Keyframe> {
        // The keys themselves stay to the last bit.
        if let Ok(index) = self.keys.binary_search_by_key(&frame, |key| key.frame) {
            return Some(self.keys[index]);
        }
        let camera = self.camera_at(frame as f64, 1.0, 1.0)?;
        let before = &self.keys[self.keys.partition_point(|key| key.frame < frame).max(1) - 1];
        let distance = (DVec3::from_array(before.target) - DVec3::from_array(before.eye)).length();
        Some(keyframe_of(&camera, frame, distance))
    }

    /// Writes the path, so that it is there whole or not at all.
    ///
    /// # Errors
    /// Those of [`Recorder::saved`]; the file cannot be written.
    pub fn save(&self, path: &Path, save: Save) -> Result<(), BookmarkError> {
        let keys = self.saved(save).map_err(|why| BookmarkError::Unusable { why, path: path.to_owned() })?;
        write_json(path, &keys.keys())
    }
}

/// Once round a pivot in so many frames, about the model's upright axis, from where the camera is: a key for each frame.
pub fn turntable(camera: &Camera, pivot: DVec3, up: DVec3, frames: u64) -> Recorder {
    let frames = frames.clamp(1, MAX_FRAMES);
    let distance = super::target_distance(camera, pivot);
    let key =
        |frame: u64| keyframe_of(&turned(camera, pivot, up, frame as f64 / frames as f64), frame, distance);
    Recorder { keys: (0..frames).map(key).collect() }
}

/// Two keys, and those before and after them.
struct Span<'a> {
    before: Option<&'a Keyframe>,
    a: &'a Keyframe,
    b: &'a Keyframe,
    after: Option<&'a Keyframe>,
}

/// A key in numbers that can be added up.
#[derive(Clone, Copy)]
struct Knot {
    eye: DVec3,
    /// A unit quaternion, of the sign that is nearest to the one before it.
    turned: DQuat,
    fov_degrees: f64,
    /// The logarithm of the height, without perspective.
    height: Option<f64>,
}

impl Knot {
    fn of(key: &Keyframe) -> Self {
        let [eye, target, up] = [key.eye, key.target, key.up].map(DVec3::from_array);
        Self {
            eye,
            turned: orientation(target - eye, up),
            fov_degrees: key.fov_degrees,
            height: key.parallel_height.map(f64::ln),
        }
    }

    fn near_to(self, other: &Self) -> Self {
        if self.turned.dot(other.turned) < 0.0 { Self { turned: -self.turned, ..self } } else { self }
    }

    fn camera(&self, near: f64, reach: f64) -> Camera {
        Camera {
            eye: self.eye,
            world_from_view: self.turned,
            vertical_fov_radians: self.fov_degrees.to_radians(),
            near,
            parallel: self.height.map(|height| Parallel { height: height.exp(), reach }),
        }
    }
}

impl Span<'_> {
    fn camera(&self, share: f64, near: f64, reach: f64) -> Camera {
        let a = Knot::of(self.a);
        let b = Knot::of(self.b).near_to(&a);
        let before = self.before.map(|key| Knot::of(key).near_to(&a));
        let after = self.after.map(|key| Knot::of(key).near_to(&b));
        let weights = self.weights(share);
        // At the ends of the path there is no neighbour, and its weight is zero.
        let (p, n) = (before.unwrap_or(a), after.unwrap_or(b));
        let mix = |of: fn(&Knot) -> f64| {
            of(&a)
                + weights[0] * (of(&p) - of(&a))
                + weights[2] * (of(&b) - of(&a))
                + weights[3] * (of(&n) - of(&a))
        };
        // Differences to the first key, so that nothing is lost far from the origin.
        let eye = a.eye
            + (p.eye - a.eye) * weights[0]
            + (b.eye - a.eye) * weights[2]
            + (n.eye - a.eye) * weights[3];
        let turned =
            p.turned * weights[0] + a.turned * weights[1] + b.turned * weights[2] + n.turned * weights[3];
        let usable = turned.is_finite() && turned.length_squared() > 1e-6;
        let knot = Knot {
            eye,
            turned: if usable { turned.normalize() } else { a.turned.slerp(b.turned, share).normalize() },
            fov_degrees: mix(|knot| knot.fov_degrees).clamp(1.0, 170.0),
            height: a.height.map(|_| mix_heights(&a, &b, &p, &n, weights)),
        };
        knot.camera(near, reach)
    }

    /// Of the keys before, a, b and after: a cubic Hermite curve with the slopes of the neighbours, in their own time.
    fn weights(&self, t: f64) -> [f64; 4] {
        let time = |key: &Keyframe| key.frame as f64;
        let span = time(self.b) - time(self.a);
        let (t2, t3) = (t * t, t * t * t);
        let (from, to) = (2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3);
        let (slope_from, slope_to) = (t3 - 2.0 * t2 + t, t3 - t2);
        // Slopes in spans: (b - before) / (time between), or (b - a) at an end of the path.
        let at_a = self.before.map_or(1.0, |before| span / (time(self.b) - time(before)));
        let at_b = self.after.map_or(1.0, |after| span / (time(after) - time(self.a)));
        let mut weights = [0.0, from, to, 0.0];
        weights[2] += slope_from * at_a;
        weights[if self.before.is_some() { 0 } else { 1 }] -= slope_from * at_a;
        weights[if self.after.is_some() { 3 } else { 2 }] += slope_to * at_b;
        weights[1] -= slope_to * at_b;
        weights
    }
}

/// Where a neighbour has perspective, the nearest key without it stands in.
fn mix_heights(a: &Knot, b: &Knot, p: &Knot, n: &Knot, weights: [f64; 4]) -> f64 {
    let own = a.height.unwrap_or(0.0);
    let at_b = b.height.unwrap_or(own);
    let at = [p.height.unwrap_or(own), own, at_b, n.height.unwrap_or(at_b)];
    at.iter().zip(weights).map(|(height, weight)| height * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::views;
    use crate::scene::{Bounds, CameraPath};

    const FAR: DVec3 = DVec3::new(1e7, 2e7, -1e7);

    fn camera(eye: DVec3) -> Camera {
        Camera::look_at(FAR + eye, FAR, DVec3::Y, 0.8, 0.1)
    }

    /// Four views round the origin, not at equal times.
    fn recorder() -> Recorder {
        let mut recorder = Recorder::default();
        for (eye, spacing) in [
            (DVec3::new(9.0, 2.0, 0.0), 60),
            (DVec3::new(6.0, 3.0, 6.0), 30),
            (DVec3::new(0.0, 2.0, 9.0), 60),
            (DVec3::new(-6.0, 1.0, 6.0), 90),
        ] {
            assert!(recorder.record(&camera(eye), 9.0, spacing));
        }
        recorder
    }

    fn at(recorder: &Recorder, frame: f64) -> Camera {
        recorder.camera_at(frame, 0.1, 1.0).unwrap()
    }

    #[test]
    fn keys_are_met_and_between_them_nothing_has_a_kink() {
        let recorder = recorder();
        let frames: Vec<u64> = recorder.keys().iter().map(|key| key.frame).collect();
        assert_eq!(frames, [0, 30, 90, 180]);
        for key in recorder.keys() {
            let eye = at(&recorder, key.frame as f64).eye;
            assert!((eye - DVec3::from_array(key.eye)).length() < 1e-8);
        }
        let step = 1e-2;
        for key in [30.0, 90.0] {
            let [before, there, after] = [key - step, key, key + step].map(|frame| at(&recorder, frame));
            let bend = (after.eye - there.eye) - (there.eye - before.eye);
            assert!(bend.length() < 0.01 * (after.eye - there.eye).length(), "{key}: {bend}");
            let turn = (after.forward() - there.forward()) - (there.forward() - before.forward());
            assert!(turn.length() < 0.02 * (after.forward() - there.forward()).length(), "{key}: {turn}");
        }
        assert_eq!(at(&recorder, -5.0), at(&recorder, 0.0));
        assert_eq!(at(&recorder, 1e9), at(&recorder, 180.0));
        assert_eq!(at(&recorder, f64::NAN), at(&recorder, 0.0));
        assert_eq!(Recorder::default().camera_at(0.0, 0.1, 1.0), None);
    }

    #[test]
    fn fly_replays_what_was_saved() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        let bounds = Bounds::new(FAR - DVec3::ONE, FAR + DVec3::ONE);
        let recorder = recorder();
        for save in [Save::Keys, Save::Smooth] {
            recorder.save(&file, save).unwrap();
            let path = CameraPath::parse(file.to_str().unwrap()).unwrap();
            for frame in [0, 1, 30, 55, 90, 179, 180] {
                let flown = path.camera(frame, 181, &bounds);
                let shown = at(&recorder, frame as f64);
                let is_key = recorder.keys().iter().any(|key| key.frame == frame);
                if save == Save::Smooth || is_key {
                    assert!((flown.eye - shown.eye).length() < 1e-7, "{save:?} {frame}");
                    assert!((flown.forward() - shown.forward()).length() < 1e-7, "{save:?} {frame}");
                }
            }
        }
        assert_eq!(Recorder::read(&file).unwrap().keys().len(), 181);
    }

    #[test]
    fn without_perspective_the_height_is_kept() {
        let mut recorder = Recorder::default();
        for height in [1.0, 100.0] {
            let parallel = Some(Parallel { height, reach: 5.0 });
            recorder.record(&Camera { parallel, ..camera(DVec3::X) }, 1.0, 10);
        }
        let height = at(&recorder, 5.0).parallel.unwrap().height;
        assert!((height - 10.0).abs() < 1e-9, "{height}");
        let keys = recorder.saved(Save::Smooth).unwrap();
        assert!(keys.keys().iter().all(|key| key.parallel_height.is_some()));
    }

    #[test]
    fn a_removed_key_leaves_no_gap() {
        let mut recorder = recorder();
        recorder.remove(1);
        let frames = |recorder: &Recorder| recorder.keys().iter().map(|key| key.frame).collect::<Vec<_>>();
        assert_eq!(frames(&recorder), [0, 30, 120]);
        recorder.remove(0);
        assert_eq!(frames(&recorder), [0, 90]);
        recorder.remove(7);
        recorder.space(25);
        assert_eq!(frames(&recorder), [0, 25]);
        recorder.clear();
        assert!(recorder.saved(Save::Keys).unwrap_err().contains("no keyframe"));
        let error = recorder.save(Path::new("nowhere.json"), Save::Smooth).unwrap_err();
        assert!(error.to_string().ends_with("nowhere.json"), "{error}");
    }

    #[test]
    fn a_path_has_no_more_frames_than_fly_reads() {
        let mut recorder = Recorder::default();
        assert!(recorder.record(&camera(DVec3::X), 1.0, 1));
        assert!(!recorder.record(&camera(DVec3::X), 1.0, MAX_FRAMES));
        assert_eq!(turntable(&camera(DVec3::X), FAR, DVec3::Y, u64::MAX).keys().len() as u64, MAX_FRAMES);
    }

    #[test]
    fn a_turntable_goes_once_round_at_one_distance() {
        let bounds = Bounds::new(FAR - DVec3::ONE, FAR + DVec3::ONE);
        let from = camera(DVec3::new(4.0, 2.0, 1.0));
        let path = turntable(&from, FAR, DVec3::Y, 8);
        let keys = path.saved(Save::Keys).unwrap();
        let cameras: Vec<Camera> = (0..8)
            .map(|frame| keys.camera(frame, views::near_of(&bounds), views::reach_of(&bounds)))
            .collect();
        let mut sum = DVec3::ZERO;
        for camera in &cameras {
            assert!(((camera.eye - FAR).length() - 21f64.sqrt()).abs() < 1e-7);
            assert!((camera.forward() + (camera.eye - FAR).normalize()).length() < 1e-7);
            assert!(camera.right().y.abs() < 1e-7);
            sum += camera.eye - FAR;
        }
        assert!((sum * DVec3::new(1.0, 0.0, 1.0)).length() < 1e-6, "not evenly spread: {sum}");
        assert!((cameras[0].eye - from.eye).length() < 1e-8);
    }
}
