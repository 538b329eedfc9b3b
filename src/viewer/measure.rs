//! Points that were picked in, lengths in the user's unit out, each with the error of what it was measured on.
//!
//! A drawn state of a part is off from the part by at most the error that the container states for it ([`stated_error`]);
//! so every length is stated as `12.34 ± 0.05 mm`. Measured at full detail, what is left is the rounding of the file's
//! grid. [`surface`] finds the vertex, edge or face under the cursor; [`Measuring`] goes from the first point to the
//! second and keeps the list.

pub mod surface;
pub mod units;

use glam::{DAffine3, DMat3, DVec3};

pub use surface::{Chain, Snap, SnapKind, Surface};
pub use units::{Unit, Units, with_error};

use crate::container::PartRow;
use crate::geometry::part::sampled_count;
use crate::geometry::record::decode_error;
use crate::scene::bounds::Bounds;
use crate::scene::opened::Scene;

/// How far, in part units, the surface of a part is off at most where `vn` of its vertices are drawn: what the container
/// states for the nearest coarser state, and half a diagonal of the grid to which the file rounds. Below the coarsest
/// state with a stated error, the part's diagonal; where nothing is drawn of it, or only its box, that too.
pub fn stated_error(part: &PartRow, vn: u32) -> f64 {
    let [low, high] = part.bounds().map(DVec3::from);
    let diagonal = (high - low).length();
    let rounding = 0.5 * 3f64.sqrt() * part.grid().step();
    // An entry holds from its own state on, and every drawn state has at least the locked vertices.
    let holds = (0..part.errors.len()).find(|&j| vn > 0 && sampled_count(part.vertices, j) <= vn);
    rounding + holds.map_or(diagonal, |j| decode_error(part.errors[j], diagonal))
}

/// The most by which a transform stretches any length: its largest singular value, or little more.
pub fn stretch(world_from_part: &DAffine3) -> f64 {
    let linear = world_from_part.matrix3;
    let square: DMat3 = linear.transpose() * linear;
    // No eigenvalue is above the greatest sum of a row; exact for rotations, scales along the axes, and mirrors.
    let rows = [0, 1, 2].map(|row| square.row(row).abs().element_sum());
    rows.into_iter().fold(0.0, f64::max).sqrt()
}

/// How far, in the model's unit, an instance's surface is off at most where `vn` vertices of it are drawn.
pub fn instance_error(scene: &Scene, instance: u32, vn: u32) -> f64 {
    let Some(row) = scene.instances().get(instance as usize) else { return f64::INFINITY };
    stated_error(&scene.parts()[row.part as usize], vn) * stretch(&row.transform())
}

/// Whether so many vertices are all that the part of an instance has.
pub fn is_full_detail(scene: &Scene, instance: u32, vn: u32) -> bool {
    let row = scene.instances().get(instance as usize);
    row.is_some_and(|row| {
        let part = &scene.parts()[row.part as usize];
        !part.is_parent() && vn >= part.vertices
    })
}

/// A point that was picked, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// Where it is.
    pub point: DVec3,
    /// On what the cursor snapped.
    pub kind: SnapKind,
    /// The instance.
    pub instance: u32,
    /// How far the surface may be off there, in the model's unit: see [`instance_error`].
    pub error: f64,
    /// Whether it was measured at full detail.
    pub is_full: bool,
}

/// What was measured, in the model's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum What {
    /// From one point to another.
    Distance {
        /// The first point.
        from: DVec3,
        /// The second.
        to: DVec3,
    },
    /// Along an edge.
    Edge {
        /// How long it is.
        length: f64,
        /// Whether it comes back to where it starts.
        is_closed: bool,
        /// A point of it, to write the length at.
        at: DVec3,
    },
    /// The box of some instances, along the axes.
    Size {
        /// The box.
        bounds: Bounds,
        /// How many instances.
        instances: usize,
        /// Whether the box may be too large, because boxes of parts were turned.
        is_at_most: bool,
    },
}

/// One line of the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Its number, which no other one gets.
    pub number: u32,
    /// What was measured.
    pub what: What,
    /// By how much each length may be off, in the model's unit.
    pub error: f64,
    /// Whether it was measured at full detail.
    pub is_full: bool,
}

impl Measurement {
    /// What it is called in the list.
    pub fn title(&self) -> String {
        let kind = match self.what {
            What::Distance { .. } => "Distance".to_owned(),
            What::Edge { is_closed: true, .. } => "Length round a closed edge".to_owned(),
            What::Edge { .. } => "Length of an edge".to_owned(),
            What::Size { instances: 1, .. } => "Size of a part".to_owned(),
            What::Size { instances, .. } => format!("Size of {instances} parts"),
        };
        format!("{}. {kind}", self.number)
    }

    /// Its lengths with their names, the most important first.
    pub fn lines(&self, units: &Units) -> Vec<(&'static str, String)> {
        let say = |length: f64| units.format(length, self.error);
        match self.what {
            What::Distance { from, to } => {
                let d = to - from;
                vec![("distance", say(d.length())), ("dx", say(d.x)), ("dy", say(d.y)), ("dz", say(d.z))]
            }
            What::Edge { length, .. } => vec![("length", say(length))],
            What::Size { bounds, .. } => {
                let size = bounds.extent();
                vec![
                    ("x", say(size.x)),
                    ("y", say(size.y)),
                    ("z", say(size.z)),
                    ("diagonal", say(size.length())),
                ]
            }
        }
    }

    /// On what it was measured, in words.
    pub fn basis(&self) -> &'static str {
        match (self.what, self.is_full) {
            (What::Size { is_at_most: true, .. }, _) => {
                "at full detail; boxes of turned parts, so at most this"
            }
            (_, true) => "at full detail",
            (_, false) => "on what was drawn; the error is that of its level of detail",
        }
    }
}

/// What the next click measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Mode {
    /// From point to point.
    #[default]
    Distance,
    /// Along an edge.
    Edge,
}

/// What the tool waits for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Step {
    /// The first point, or an edge.
    #[default]
    First,
    /// The second point.
    Second(Picked),
}

/// The measuring tool.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measuring {
    mode: Mode,
    step: Step,
    list: Vec<Measurement>,
    last: u32,
}

impl Measuring {
    /// What the next click measures.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// What the tool waits for.
    pub fn step(&self) -> Step {
        self.step
    }

    /// What was measured, oldest first.
    pub fn list(&self) -> &[Measurement] {
        &self.list
    }

    /// Measures something else from now on; a first point is forgotten.
    pub fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
        self.step = Step::First;
    }

    /// Forgets the first point; gives whether there was one, so that another escape may leave the tool.
    pub fn cancel(&mut self) -> bool {
        matches!(std::mem::take(&mut self.step), Step::Second(_))
    }

    /// What to do next, for the status line.
    pub fn hint(&self) -> &'static str {
        match (self.mode, self.step) {
            (Mode::Edge, _) => "Click an edge",
            (Mode::Distance, Step::First) => "Click the first point",
            (Mode::Distance, Step::Second(_)) => "Click the second point",
        }
    }

    /// A point was clicked. Gives the distance once it is the second. In [`Mode::Edge`] nothing comes of it.
    pub fn pick(&mut self, picked: Picked) -> Option<&Measurement> {
        if self.mode == Mode::Edge || !picked.point.is_finite() {
            return None;
        }
        let Step::Second(first) = std::mem::take(&mut self.step) else {
            self.step = Step::Second(picked);
            return None;
        };
        let what = What::Distance { from: first.point, to: picked.point };
        // Both ends may be off, towards each other or away.
        Some(self.add(what, first.error + picked.error, first.is_full && picked.is_full))
    }

    /// An edge was clicked; `error` is that of its instance.
    pub fn pick_edge(&mut self, chain: &Chain, at: DVec3, error: f64, is_full: bool) -> &Measurement {
        let what = What::Edge { length: chain.length, is_closed: chain.is_closed, at };
        // Both ends of an edge may be off; a closed one is as long as what it goes round, whose radius is off.
        let error = if chain.is_closed { std::f64::consts::TAU * error } else { 2.0 * error };
        self.add(what, error, is_full)
    }

    /// The box of some instances.
    pub fn size(&mut self, scene: &Scene, instances: &[u32]) -> Option<&Measurement> {
        let extent = extent_of(scene, instances)?;
        let what =
            What::Size { bounds: extent.bounds, instances: instances.len(), is_at_most: extent.is_at_most };
        Some(self.add(what, extent.error, true))
    }

    /// Takes one out of the list.
    pub fn remove(&mut self, number: u32) {
        self.list.retain(|measurement| measurement.number != number);
    }

    /// Empties the list and forgets the first point.
    pub fn clear(&mut self) {
        self.list.clear();
        self.step = Step::First;
    }

    fn add(&mut self, what: What, error: f64, is_full: bool) -> &Measurement {
        self.last += 1;
        self.list.push(Measurement { number: self.last, what, error, is_full });
        &self.list[self.list.len() - 1]
    }
}

/// The box of some instances at full detail, as the tables have it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// The box in world space.
    pub bounds: Bounds,
    /// Whether a part's box was turned, so that the model may be smaller than this.
    pub is_at_most: bool,
    /// By how much each side may be off: the rounding of the file's grid.
    pub error: f64,
}

/// The box of some instances; `None` where there are none.
pub fn extent_of(scene: &Scene, instances: &[u32]) -> Option<Extent> {
    let mut extent = Extent { bounds: Bounds::EMPTY, is_at_most: false, error: 0.0 };
    for &instance in instances {
        let (row, placed) =
            (scene.instances().get(instance as usize)?, scene.boxes().get(instance as usize)?);
        let transform = row.transform();
        extent.bounds = extent.bounds.with_box(placed);
        extent.is_at_most |= !keeps_axes(&transform.matrix3);
        let step = scene.parts()[row.part as usize].grid().step();
        // Half a step at either end.
        extent.error = extent.error.max(3f64.sqrt() * step * stretch(&transform));
    }
    (!extent.bounds.is_empty()).then_some(extent)
}

/// Whether boxes along the axes stay such.
fn keeps_axes(linear: &DMat3) -> bool {
    let largest = linear.to_cols_array().into_iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    let entries = |column: DVec3| (0..3).filter(|&axis| column[axis].abs() > 1e-9 * largest).count();
    [linear.x_axis, linear.y_axis, linear.z_axis].into_iter().all(|column| entries(column) <= 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::record::{ERROR_SAMPLES, error_code};
    use glam::DQuat;

    /// A part of 1,000 vertices in a box of 3 x 4 x 12 on a grid of 1, off by 13 * 2^(j - 20) at entry j, and 0 at entry 0.
    fn part() -> PartRow {
        let errors: [u8; ERROR_SAMPLES] =
            std::array::from_fn(
                |j| if j == 0 { 0 } else { error_code(13.0 * (j as f64 - 20.0).exp2(), 13.0) },
            );
        PartRow { grid_high: [3, 4, 12], vertices: 1000, locked: 10, errors, ..PartRow::default() }
    }

    #[test]
    fn the_error_of_a_state_is_that_of_the_next_coarser_sample_and_the_grid() {
        let rounding = 0.5 * 3f64.sqrt();
        let part = part();
        assert_eq!(stated_error(&part, 1000), rounding, "full detail");
        // 1000 / sqrt 2 is 707: entry 1 holds from there to all that is finer but not full.
        for (vn, j) in [(999, 1), (707, 1), (706, 2), (500, 2), (499, 3), (6, 15), (5, 15)] {
            let wanted = rounding + 13.0 * (f64::from(j) - 20.0).exp2();
            let error = stated_error(&part, vn);
            assert!((error - wanted).abs() < 1e-9, "{vn}: {error} and not {wanted}");
        }
        assert_eq!(stated_error(&part, 4), rounding + 13.0, "coarser than all that is stated");
        assert_eq!(stated_error(&part, 0), rounding + 13.0, "its box");
    }

    #[test]
    fn no_length_is_stretched_more_than_said() {
        let scale = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, -3.0, 0.5),
            DQuat::from_rotation_x(0.7),
            DVec3::splat(9.0),
        );
        assert!((stretch(&scale) - 3.0).abs() < 1e-12);
        let shear =
            DAffine3::from_mat3(DMat3::from_cols_array(&[1.0, 0.0, 0.0, 4.0, 1.0, 0.0, 0.0, 0.5, 1.0]));
        for direction in [DVec3::Y, DVec3::new(0.25, 1.0, 0.0), DVec3::ONE] {
            let direction = direction.normalize();
            assert!((shear.matrix3 * direction).length() <= stretch(&shear), "{direction}");
        }
    }

    fn picked(x: f64, error: f64, is_full: bool) -> Picked {
        Picked { point: DVec3::new(x, 3.0, 0.0), kind: SnapKind::Face, instance: 0, error, is_full }
    }

    #[test]
    fn two_clicks_make_a_distance_with_both_errors() {
        let mut tool = Measuring::default();
        assert_eq!(tool.hint(), "Click the first point");
        assert_eq!(tool.pick(picked(0.0, 0.02, false)), None);
        assert_eq!(tool.hint(), "Click the second point");
        let done = *tool.pick(picked(12.34, 0.03, true)).unwrap();
        assert_eq!((done.error, done.is_full), (0.05, false));
        let lines = done.lines(&Units::default());
        assert_eq!(lines[0], ("distance", "12.34 ± 0.05 m".to_owned()));
        assert_eq!(lines[1].1, "12.34 ± 0.05 m");
        assert_eq!(lines[2].1, "0.00 ± 0.05 m");
        assert_eq!(tool.step(), Step::First);
        assert!(done.basis().contains("drawn"));
    }

    #[test]
    fn the_first_point_can_be_taken_back() {
        let mut tool = Measuring::default();
        assert!(!tool.cancel());
        tool.pick(picked(1.0, 0.0, true));
        assert!(tool.cancel());
        tool.pick(picked(1.0, 0.0, true));
        tool.set_mode(Mode::Edge);
        assert_eq!((tool.step(), tool.pick(picked(2.0, 0.0, true))), (Step::First, None));
        tool.set_mode(Mode::Distance);
        assert_eq!(tool.pick(Picked { point: DVec3::NAN, ..picked(1.0, 0.0, true) }), None);
        assert_eq!(tool.step(), Step::First);
    }

    #[test]
    fn numbers_stay_when_one_is_removed() {
        let mut tool = Measuring::default();
        for length in [1.0, 2.0, 3.0] {
            let chain = Chain { length, is_closed: false, points: vec![] };
            tool.pick_edge(&chain, DVec3::ZERO, 0.25, true);
        }
        tool.remove(2);
        let chain = Chain { length: 4.0, is_closed: true, points: vec![] };
        assert_eq!(tool.pick_edge(&chain, DVec3::ZERO, 0.0, true).title(), "4. Length round a closed edge");
        let numbers: Vec<u32> = tool.list().iter().map(|measurement| measurement.number).collect();
        assert_eq!(numbers, [1, 3, 4]);
        assert_eq!(tool.list()[0].error, 0.5);
        tool.clear();
        assert!(tool.list().is_empty());
    }

    #[test]
    fn a_box_that_was_turned_is_said_to_be_at_most() {
        let turned = |angle: f64| keeps_axes(&DMat3::from_rotation_z(angle));
        assert!(turned(0.0) && turned(std::f64::consts::FRAC_PI_2) && !turned(0.1));
        let bounds = Bounds::new(DVec3::ZERO, DVec3::new(2.0, 3.0, 6.0));
        let what = What::Size { bounds, instances: 2, is_at_most: true };
        let measurement = Measurement { number: 1, what, error: 0.001, is_full: true };
        assert_eq!(measurement.lines(&Units::default())[3].1, "7.0000 ± 0.0010 m");
        assert!(measurement.basis().contains("at most") && measurement.title().contains("2 parts"));
    }

    /// A baked part: a box of 2 x 3 x 6 with faces of 16 x 16 squares, at 100, 0, 0.
    fn scene() -> Scene {
        use crate::bake::{BakeOptions, BakeProgress, bake};
        use std::fmt::Write as _;
        let mut text = "o box\n".to_owned();
        let mut vertices = 0;
        for face in 0..6 {
            let (axis, side) = (face / 2, face % 2);
            for (i, j) in (0..17).flat_map(|i| (0..17).map(move |j| (i, j))) {
                let mut at = [0.0; 3];
                at[axis] = f64::from(side as u32);
                at[(axis + 1) % 3] = f64::from(i) / 16.0;
                at[(axis + 2) % 3] = f64::from(j) / 16.0;
                writeln!(text, "v {} {} {}", 100.0 + 2.0 * at[0], 3.0 * at[1], 6.0 * at[2]).unwrap();
            }
            for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
                let corner = |i: usize, j: usize| vertices + 17 * i + j + 1;
                let mut quad = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                if side == 0 {
                    quad.reverse();
                }
                let [a, b, c, d] = quad;
                writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
            }
            vertices += 17 * 17;
        }
        let folder = tempfile::tempdir().unwrap();
        let (source, container) = (folder.path().join("box.obj"), folder.path().join("box.clps"));
        std::fs::write(&source, text).unwrap();
        bake(&[source], &container, &BakeOptions::default(), &BakeProgress::default()).unwrap();
        Scene::open(&container).unwrap()
    }

    #[test]
    fn a_baked_box_is_measured_as_large_as_it_is() {
        let scene = scene();
        let part = &scene.parts()[0];
        let full = Surface::full_detail(&scene, 0).unwrap();
        assert_eq!(full.triangles().len() as u32, part.triangles);
        // Twelve edges of 16 pieces each, which are followed to the corners of the box.
        let mut lengths: Vec<f64> = full.edges().iter().map(|&edge| full.chain(edge).length).collect();
        lengths.sort_by(f64::total_cmp);
        let error = 2.0 * instance_error(&scene, 0, part.vertices);
        assert!(error < 1e-4, "{error}");
        assert_eq!(lengths.len(), 12 * 16);
        for (index, wanted) in [(0, 2.0), (64, 3.0), (128, 6.0), (191, 6.0)] {
            assert!((lengths[index] - wanted).abs() <= error, "{index}: {} and not {wanted}", lengths[index]);
        }
        let mut tool = Measuring::default();
        let size = tool.size(&scene, &[0]).unwrap();
        assert!(size.is_full && matches!(size.what, What::Size { is_at_most: false, instances: 1, .. }));
        assert!(
            size.lines(&Units::default())[3].1.starts_with("7.00"),
            "{:?}",
            size.lines(&Units::default())
        );
        assert_eq!(tool.size(&scene, &[]), None);
        assert_eq!(tool.size(&scene, &[99]), None);
    }

    #[test]
    fn a_coarse_state_is_measured_within_the_error_that_is_stated() {
        let scene = scene();
        let part = &scene.parts()[0];
        let nothing = crate::scene::part::ResidentPart::new(scene.tiers(0).len() as u32);
        assert_eq!(Surface::of_resident(&scene, 0, &nothing, part.vertices), None);
        let resident = scene.read_part(0).unwrap();
        let exact = Bounds::new(DVec3::new(100.0, 0.0, 0.0), DVec3::new(102.0, 3.0, 6.0));
        for vn in (part.locked..part.vertices).filter(|&vn| resident.triangles_at().is_state(vn as usize)) {
            let surface = Surface::of_resident(&scene, 0, &resident, vn).unwrap();
            assert_eq!(
                surface.triangles().len() as u32,
                resident.triangles_at().count_at(vn as usize),
                "{vn}"
            );
            assert!(!is_full_detail(&scene, 0, vn));
            let used = surface.triangles().iter().flatten().map(|&point| surface.points()[point as usize]);
            let bounds = used.fold(Bounds::EMPTY, Bounds::with_point);
            let off = (bounds.low - exact.low).abs().max((bounds.high - exact.high).abs()).max_element();
            let error = instance_error(&scene, 0, vn);
            assert!(off <= error, "{vn} vertices are off by {off}, not {error}");
        }
        assert!(is_full_detail(&scene, 0, part.vertices) && !is_full_detail(&scene, 7, 9));
        assert_eq!(instance_error(&scene, 7, 9), f64::INFINITY);
    }
}
