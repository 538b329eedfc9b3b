//! Stage 7: what is active, how instances look and the style in, the picture out; and what is in one of its pixels.
//!
//! Looks are words of a table beside the instances: to hide, ghost or colour any number of them sends those words, once,
//! and no geometry.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::{FrameError, PassesOn, Renderer, milliseconds_since};
use crate::gpu::GpuError;
use crate::gpu::batch::Batch;
use crate::gpu::target::Target;
use crate::passes::cut_face;
use crate::passes::depth_cue::DepthCuePass;
use crate::passes::draw::{
    Asked, Cut, CutFaceRanges, DrawBatch, DrawList, Edges, FrameUniform, Look, MOST_CLIPPED, MOST_SECTIONS,
    Ranges, Style,
};
use crate::passes::pick::PickPass;
use crate::scene::Camera;
use crate::stats::FrameRecord;

/// How every instance looks.
pub(super) struct Looks {
    all: Vec<Look>,
    /// Whether the GPU lacks something of it.
    changed: bool,
    any_ghost: bool,
}

impl Looks {
    pub fn new(instances: usize) -> Self {
        Self { all: vec![Look::default(); instances], changed: true, any_ghost: false }
    }

    /// By instance.
    pub fn all(&self) -> &[Look] {
        &self.all
    }

    /// The GPU has forgotten them.
    pub fn forget(&mut self) {
        self.changed = true;
    }
}

/// How many pixels away a face is looked at to see how it lies.
const FACE_PX: i32 = 3;

/// An instance and a point of its surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// The number of the instance in the scene.
    pub instance: u32,
    /// In world space.
    pub point: DVec3,
}

impl Renderer {
    /// Stage 7.
    pub(super) fn draw(&mut self, camera: &Camera, record: &mut FrameRecord) -> Result<(), FrameError> {
        let started = Instant::now();
        self.shown = Some(*camera);
        let has_new_boxes = self.chosen || self.frames_at_rest == 0;
        self.bytes_of_view = if has_new_boxes { self.place_boxes()? } else { 0 };
        self.bytes_of_view += self.send_looks();
        record.boxes = self.boxes.count();
        self.bytes_of_view += self.send_uniform(camera);
        record.bytes_tables += self.bytes_of_view;
        if self.settings.passes == PassesOn::Nowhere {
            // What was written waits for a submission, in memory.
            self.gpu.submit(self.gpu.encoder("count"))?;
            return Ok(());
        }
        let asked = self.asked();
        self.drawn_as = asked;
        self.draw.prepare(&self.gpu.device, asked);
        self.find_ranges(asked);
        // A ghost covers some of its samples, whether it is cut or not.
        let has_ranges = asked.cut != Cut::No && !self.looks.any_ghost;
        let ranges = has_ranges.then(|| self.taken.ranges());
        let batches = drawn(&self.batches, ranges, asked.cut_faces.then(|| self.taken.cut_faces()));
        let list = DrawList { asked, batches: &batches, boxes: self.boxes.drawn() };
        let mut encoder = self.gpu.encoder("draw");
        self.draw.record(&self.gpu.device, &mut encoder, &self.target, &list, self.timer.render("draw"));
        if asked.depth {
            let (device, samples) = (&self.gpu.device, self.settings.samples);
            let cue = self.depth_cue.get_or_insert_with(|| DepthCuePass::new(device, samples));
            let on = (device, &self.gpu.queue);
            cue.record(on, &mut encoder, &self.target, camera, self.style.depth_cue);
        }
        self.timer.resolve(&mut encoder);
        self.gpu.submit(encoder)?;
        self.gpu.wait()?;
        record.draw_ms = milliseconds_since(started);
        Ok(())
    }

    /// Brings up to date what sections take away.
    fn find_ranges(&mut self, asked: Asked) {
        if asked.cut != Cut::No {
            let entered = self.uniform.filter(|_| asked.cut_faces).map_or(0, |uniform| uniform.entered());
            self.taken.enter(entered, &self.scene);
            self.taken.find_ranges(&self.scene, self.batches.len(), &self.held, &self.states);
        }
    }

    fn asked(&self) -> Asked {
        let is_entered = self.uniform.is_some_and(|uniform| uniform.entered() != 0);
        Asked {
            edges: self.style.edges != Edges::None,
            cut: self.cut(),
            depth: self.style.depth_cue > 0.0,
            cut_faces: is_entered && cut_face::is_possible(&self.gpu.device),
        }
    }

    fn cut(&self) -> Cut {
        match self.style.sections.len() {
            0 if !self.looks.any_ghost => Cut::No,
            1..=MOST_CLIPPED if !self.looks.any_ghost => Cut::Clipped,
            _ => Cut::Sampled,
        }
    }

    fn send_looks(&mut self) -> u64 {
        if !std::mem::take(&mut self.looks.changed) {
            return 0;
        }
        let looks = &self.looks.all;
        let gpu = self.settings.passes.sends_to(&self.gpu);
        self.batches.iter().map(|batch| batch.write_looks(&self.gpu, looks)).sum::<u64>()
            + self.boxes.write_looks(gpu, looks)
    }

    fn send_uniform(&mut self, camera: &Camera) -> u64 {
        let uniform = FrameUniform::new(camera, self.target.aspect(), &self.style);
        if self.uniform == Some(uniform) {
            return 0;
        }
        self.uniform = Some(uniform);
        self.draw.write_frame(&self.gpu.queue, &uniform)
    }

    /// What is asked of pictures from now on. Sections that cut off nothing of the model cost nothing, and of instances that
    /// they cut off wholly the same holds as of hidden ones.
    pub fn set_style(&mut self, mut style: Style) {
        style.sections.retain(|section| section.cuts(self.scene.bounds()));
        style.sections.truncate(MOST_SECTIONS);
        if self.taken.set(&style.sections, &self.scene) {
            self.leave_out_what_is_not_seen();
        }
        self.style = style;
    }

    /// How every instance looks, by its number, for the next frame on. What is hidden keeps what it has on the GPU until the
    /// camera moves, so that it can be shown again for nothing; then it takes no part in the budget any more.
    ///
    /// # Panics
    /// There is not one for each instance.
    pub fn set_looks(&mut self, looks: &[Look]) {
        self.looks.all.copy_from_slice(looks);
        self.looks.any_ghost = looks.par_iter().any(|look| look.has(Look::GHOST));
        self.looks.changed = true;
        self.leave_out_what_is_not_seen();
    }

    fn leave_out_what_is_not_seen(&mut self) {
        let mut unseen = hidden_of(&self.looks.all);
        let gone = self.taken.gone();
        if unseen.is_empty() {
            unseen = gone.to_vec();
        } else {
            unseen.iter_mut().zip(gone).for_each(|(word, gone)| *word |= gone);
        }
        let lacks = self.wishes.leave_out(unseen);
        if lacks {
            // As if the camera had moved.
            self.view = None;
        }
    }

    /// What is in a pixel of the last frame, counted from the upper left corner. Waits for the GPU.
    ///
    /// # Errors
    /// The device is lost.
    pub fn pick(&mut self, [x, y]: [u32; 2]) -> Result<Option<Pick>, FrameError> {
        let (Some(camera), Some(uniform)) = (self.shown, self.uniform) else { return Ok(None) };
        let size = [self.target.width(), self.target.height()];
        if x >= size[0] || y >= size[1] {
            return Ok(None);
        }
        // Of the last frame, whatever the style has become since.
        let asked = self.drawn_as;
        let batches = drawn(&self.batches, None, asked.cut_faces.then(|| self.taken.cut_faces()));
        let list = DrawList { asked, batches: &batches, boxes: self.boxes.drawn() };
        let pass = match &mut self.pick {
            Some(pass) => pass,
            None => self.pick.insert(PickPass::new(&self.gpu)?),
        };
        let picked = pass.pick(&self.gpu, &uniform.of_pixel([x, y], size), &list)?;
        Ok(picked.map(|picked| Pick { instance: picked.instance, point: camera.eye + picked.relative }))
    }

    /// The unit normal, towards the eye, of the surface that was picked in a pixel: by the points of pixels beside it that
    /// are nearest to its own. `None` where the instance is too small in the picture. Waits for the GPU.
    ///
    /// # Errors
    /// The device is lost.
    pub fn normal_at(&mut self, [x, y]: [u32; 2], pick: &Pick) -> Result<Option<DVec3>, FrameError> {
        let mut beside = |dx: i32, dy: i32| -> Result<Option<DVec3>, FrameError> {
            let [Some(x), Some(y)] = [x.checked_add_signed(dx), y.checked_add_signed(dy)] else {
                return Ok(None);
            };
            let found = self.pick([x, y])?.filter(|found| found.instance == pick.instance);
            Ok(found.map(|found| found.point - pick.point))
        };
        let nearer = |ahead: Option<DVec3>, behind: Option<DVec3>| match (ahead, behind) {
            (Some(ahead), Some(behind)) if behind.length() < ahead.length() => Some(-behind),
            (ahead, behind) => ahead.or(behind.map(|behind| -behind)),
        };
        let across = nearer(beside(FACE_PX, 0)?, beside(-FACE_PX, 0)?);
        let along = nearer(beside(0, FACE_PX)?, beside(0, -FACE_PX)?);
        let normal = across.zip(along).and_then(|(across, along)| along.cross(across).try_normalize());
        let Some(camera) = self.shown else { return Ok(None) };
        Ok(normal.map(|normal| if normal.dot(camera.forward()) > 0.0 { -normal } else { normal }))
    }

    /// Draws into another target from now on; the last one comes back, with its picture.
    ///
    /// # Errors
    /// It has other samples than the settings say.
    pub fn replace_target(&mut self, target: Arc<Target>) -> Result<Arc<Target>, FrameError> {
        if target.samples() != self.settings.samples {
            return Err(GpuError::Invalid(format!("a target of {} samples", target.samples())).into());
        }
        let size = (target.width(), target.height());
        if size != (self.settings.width, self.settings.height) {
            (self.settings.width, self.settings.height) = size;
            self.view = None;
        }
        Ok(std::mem::replace(&mut self.target, target))
    }
}

/// A bit for each instance that is hidden; no bits if none is.
fn hidden_of(looks: &[Look]) -> Vec<u64> {
    if !looks.par_iter().any(|look| look.has(Look::HIDDEN)) {
        return Vec::new();
    }
    let word = |looks: &[Look]| {
        looks.iter().enumerate().fold(0, |word, (i, look)| word | u64::from(look.has(Look::HIDDEN)) << i)
    };
    looks.par_chunks(64).map(word).collect()
}

/// What the draw pass needs of batches that have something to draw; all of them, or ranges by batch.
fn drawn<'a>(
    batches: &'a [Batch],
    ranges: Option<&'a [Ranges]>,
    cut_faces: Option<&'a [CutFaceRanges]>,
) -> Vec<DrawBatch<'a>> {
    let has_triangles = batches.iter().enumerate().filter(|(_, batch)| batch.totals[2] > 0);
    has_triangles
        .map(|(i, batch)| DrawBatch {
            instances: &batch.rows_group,
            vertices: &batch.existing()[0],
            indices: &batch.indices,
            triangles: &batch.existing()[2],
            indirect: &batch.indirect,
            indirect_offset: 0,
            ranges: ranges.map(|ranges| &ranges[i]),
            cut_faces: cut_faces.map(|ranges| &ranges[i]),
        })
        .collect()
}
