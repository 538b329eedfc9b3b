//! A camera and what is asked of the picture in, the uniform of a frame out.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, DVec4, Mat4, Vec3, Vec4};

use crate::scene::Bounds;
use crate::scene::camera::Camera;

/// How many section planes a user may set, beside a section box.
pub const MOST_PLANES: usize = 6;
/// The most planes that cut: six, and the six of a box.
pub const MOST_SECTIONS: usize = MOST_PLANES + 6;

/// Bits of what edges are drawn, as in the shader.
const EDGES_FEATURES: u32 = 1;
const EDGES_ALL: u32 = 2;

/// What the colour of a surface shows.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Its material.
    #[default]
    Material = 0,
    /// Its instance, by number within the batch.
    Instance = 1,
}

/// Which edges are drawn as lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Edges {
    /// None.
    #[default]
    None,
    /// Creases and open boundaries.
    Features,
    /// Those of every triangle.
    All,
}

/// What counts as a rounding error of a box, as a share of its largest coordinate.
pub const ROUNDING: f64 = 1e-9;

/// A plane in world space that cuts off what is behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// A point on it.
    pub point: DVec3,
    /// Unit normal, towards what is kept.
    pub normal: DVec3,
}

impl Section {
    /// Where a point is kept this is at least zero: its distance from the plane, in world units.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.point)
    }

    /// Whether any of a box is cut off. What a rounding error of the box's size would take is not.
    pub fn cuts(&self, bounds: &Bounds) -> bool {
        let [nearest, _] = self.span(bounds.centre(), 0.5 * bounds.extent());
        nearest < -ROUNDING * bounds.scale()
    }

    /// The least and the greatest distance from the plane that points of a box have, given its centre and half its extent.
    pub fn span(&self, centre: DVec3, half_extent: DVec3) -> [f64; 2] {
        let (middle, reach) = (self.distance(centre), half_extent.dot(self.normal.abs()));
        [middle - reach, middle + reach]
    }

    /// The six planes that keep what is inside a box.
    pub fn inside(bounds: &Bounds) -> [Self; 6] {
        std::array::from_fn(|side| {
            let axis = DVec3::AXES[side / 2];
            if side.is_multiple_of(2) {
                Self { point: bounds.low, normal: axis }
            } else {
                Self { point: bounds.high, normal: -axis }
            }
        })
    }

    /// The plane relative to an eye.
    fn relative_to(&self, eye: DVec3) -> Vec4 {
        DVec4::from((self.normal, self.distance(eye))).as_vec4()
    }
}

/// What is asked of a picture beside what it shows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Style {
    /// What surfaces show.
    pub mode: Mode,
    /// What is drawn as lines.
    pub edges: Edges,
    /// Planes that cut; those beyond [`MOST_SECTIONS`] do not.
    pub sections: Vec<Section>,
    /// How much what lies behind an edge in depth is darkened; 0: not at all, 1: clearly.
    pub depth_cue: f32,
}

/// What is the same for everything drawn in a frame; `Frame` in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FrameUniform {
    /// From camera-relative world space.
    pub(super) clip_from_relative: Mat4,
    pub(super) eye_high: Vec3,
    pub(super) mode: u32,
    pub(super) eye_low: Vec3,
    pub(super) parallel: u32,
    pub(super) to_key: Vec3,
    pub(super) section_count: u32,
    pub(super) to_rim: Vec3,
    pub(super) line_px: f32,
    pub(super) to_viewer: Vec3,
    pub(super) edges: u32,
    pub(super) sections: [Vec4; MOST_SECTIONS],
    pub(super) entries: [Vec4; MOST_SECTIONS],
}

/// A section that keeps everything.
const KEEPS_ALL: Vec4 = Vec4::W;

/// Of a section that no line of sight comes in by.
const NO_ENTRY: Vec4 = Vec4::new(0.0, 0.0, 0.0, f32::MAX);

impl FrameUniform {
    /// The frame as `camera` sees it in a picture of that aspect (width over height).
    pub fn new(camera: &Camera, aspect: f32, style: &Style) -> Self {
        let (eye_high, eye_low) = camera.split_eye();
        let towards = |right: f64, up: f64, back: f64| {
            (camera.world_from_view * DVec3::new(right, up, back).normalize()).as_vec3()
        };
        let to_viewer = towards(0.0, 0.0, 1.0);
        let mut sections = [KEEPS_ALL; MOST_SECTIONS];
        let mut entries = [NO_ENTRY; MOST_SECTIONS];
        for ((plane, entry), section) in sections.iter_mut().zip(&mut entries).zip(&style.sections) {
            *plane = section.relative_to(camera.eye);
            *entry = entry_by(*plane, camera.parallel.map(|_| to_viewer));
        }
        Self {
            clip_from_relative: camera.clip_from_relative(aspect),
            eye_high,
            mode: style.mode as u32,
            eye_low,
            parallel: u32::from(camera.parallel.is_some()),
            to_key: towards(-0.6, 0.7, 0.6),
            section_count: style.sections.len().min(MOST_SECTIONS) as u32,
            to_rim: towards(0.85, 0.15, -0.35),
            line_px: if style.edges == Edges::All { 0.4 } else { 0.7 },
            to_viewer,
            edges: match style.edges {
                Edges::None => 0,
                Edges::Features => EDGES_FEATURES,
                Edges::All => EDGES_ALL,
            },
            sections,
            entries,
        }
    }

    /// The sections that lines of sight come in by, a bit each: without any there are no cut faces to be seen.
    pub(crate) fn entered(&self) -> u32 {
        (0..).zip(&self.entries).fold(0, |bits, (i, entry)| bits | u32::from(*entry != NO_ENTRY) << i)
    }

    /// What the GPU lacks of it: without sections their rows are not looked at, and stay what they were.
    pub(super) fn bytes_used(&self) -> &[u8] {
        let all = bytemuck::bytes_of(self);
        if self.section_count > 0 { all } else { &all[..offset_of!(Self, sections)] }
    }

    /// The same frame with one pixel as the whole picture.
    ///
    /// `x` and `y` count pixels from the upper left corner of a picture of `width` x `height`.
    pub fn of_pixel(self, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> Self {
        let (width, height) = (width as f32, height as f32);
        let [right, up] = [2.0 * (x as f32 + 0.5) / width - 1.0, 1.0 - 2.0 * (y as f32 + 0.5) / height];
        let larger = Mat4::from_scale(Vec3::new(width, height, 1.0));
        let moved = Mat4::from_translation(Vec3::new(-right, -up, 0.0));
        Self { clip_from_relative: larger * moved * self.clip_from_relative, ..self }
    }
}

/// What tells, of lines of sight to points relative to the eye, by which plane (relative to the eye) they came in last: the
/// least of `dot(xyz, p) + w`, which only has to order the planes.
///
/// Without perspective all lines run along `to_viewer`, and this is the distance back to the plane. From an eye, only
/// those come in by a plane that begin behind it, and the plane cuts off 1 over this of such a line.
fn entry_by(plane: Vec4, to_viewer: Option<Vec3>) -> Vec4 {
    let (row, leaves) = match to_viewer {
        Some(to_viewer) => (plane, -plane.truncate().dot(to_viewer)),
        None => (plane.truncate().extend(0.0), -plane.w),
    };
    let entry = row / leaves;
    if leaves > 0.0 && entry.is_finite() { entry } else { NO_ENTRY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// How far along the line to `point` it comes in by the plane, if it does: in units of the line, or from nowhere.
    fn comes_in(plane: Vec4, point: Vec3, to_viewer: Option<Vec3>) -> Option<f32> {
        let at_point = plane.truncate().dot(point) + plane.w;
        match to_viewer {
            Some(to_viewer) => {
                let along = plane.truncate().dot(to_viewer);
                (along < 0.0).then(|| at_point / along)
            }
            None => (plane.w < 0.0).then(|| -plane.w / (at_point - plane.w)),
        }
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn the_least_entry_is_the_plane_come_in_by_last(
            planes in proptest::collection::vec((vector(), -3.0f32..3.0), 1..6),
            point in vector(),
            to_viewer in proptest::option::of(vector()),
        ) {
            let unit = |v: Vec3| v.try_normalize().unwrap_or(Vec3::X);
            let to_viewer = to_viewer.map(unit);
            let point = 4.0 * point;
            // Those that cut the point away are turned: a point that is drawn is kept by all.
            let planes: Vec<Vec4> = planes
                .into_iter()
                .map(|(normal, w)| unit(normal).extend(w))
                .map(|plane| if plane.truncate().dot(point) + plane.w < 0.0 { -plane } else { plane })
                .collect();
            let before = |plane: &Vec4| {
                let entry = entry_by(*plane, to_viewer);
                entry.truncate().dot(point) + entry.w
            };
            let least = planes.iter().min_by(|a, b| before(a).total_cmp(&before(b))).copied();
            let found = least.filter(|plane| before(plane) < 3e38);
            let last = planes.iter().filter_map(|&plane| comes_in(plane, point, to_viewer)).max_by(f32::total_cmp);
            let by_found = found.and_then(|plane| comes_in(plane, point, to_viewer));
            match (by_found, last) {
                (Some(a), Some(b)) => prop_assert!((a - b).abs() <= 1e-4 * (1.0 + b.abs()), "{a} {b}"),
                (a, b) => prop_assert_eq!(a, b),
            }
        }
    }
}
