//! The frame as the list of its stages: a camera in, a picture and a [`FrameRecord`] out.
//!
//! 1. **select** (`select::wish`): the wished vertex count of every instance for this view.
//! 2. **residency** (`stream::residency`, `select::states`): what has arrived, and the state that is granted of it.
//! 3. **delta** (`frame::plan`): what each new state has that the old one lacks, under the cap of the frame.
//! 4. **upload** (`stream::gather`, `stream::staging`): the lack, or everything, by strategy.
//! 5. **defragment** (`frame::rebuild`): grants, prefix sums, and contiguous active buffers of existing and streamed.
//! 6. **reform** (`frame::rebuild`): every triangle's corners walked down `ecol`, into one index buffer.
//! 7. **draw** (`passes::draw`): one indirect draw a batch, or ranges of it where sections cut (`frame::sections`).
//!
//! A frame in which nothing changed does only stages 1 and 7, and stage 1 finds out by comparing two cameras.

mod ahead;
mod boxes;
mod caps;
pub mod colour_by;
mod content;
mod mirror;
mod places;
mod plan;
mod rebuild;
mod sections;
mod settings;
mod show;
mod squeeze;
mod wants;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;

use crate::gpu::batch::Batch;
use crate::gpu::target::{Target, TargetError};
use crate::gpu::timer::Timer;
use crate::gpu::{Gpu, GpuError};
use crate::passes::depth_cue::DepthCuePass;
use crate::passes::draw::{Asked, DrawPass, FrameUniform, InstanceRow, Style};
use crate::passes::pick::PickPass;
use crate::reference::select::SelectView;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::part::ResidentPart;
use crate::select::Wishes;
use crate::select::states::StateChooser;
use crate::stats::{FrameRecord, floor, memory};
use crate::stream::gather::BatchUpload;
use crate::stream::prefetch::Motion;
use crate::stream::staging::Staging;
use crate::stream::{Delta, Residency, ResidencyError, State, Strategy};
use boxes::Boxes;
use caps::residency_options;
pub use content::ContentDigest;
use mirror::Mirror;
use rebuild::Rebuild;
use sections::Taken;
pub use settings::{PassesOn, Settings, Spending};
use show::Looks;
pub use show::Pick;
use squeeze::Squeeze;
use wants::Wants;

/// Why a frame could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The GPU.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The picture.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// The file.
    #[error(transparent)]
    Residency(#[from] ResidencyError),
    /// A cap is too small for anything to be drawn.
    #[error(
        "a cap of {cap_bytes} bytes of {what} is too little for this model: at least {need_bytes} are needed"
    )]
    CapTooSmall {
        /// Of what.
        what: &'static str,
        /// The cap.
        cap_bytes: u64,
        /// The least that works.
        need_bytes: u64,
    },
    /// One part alone is more than a batch may hold.
    #[error(
        "the parts in view do not fit {limit_bytes} bytes a batch even with one instance in each; \
         choose a smaller budget or a larger batch limit"
    )]
    BatchTooSmall {
        /// The limit.
        limit_bytes: u64,
    },
}

/// Draws a scene frame by frame.
pub struct Renderer {
    gpu: Arc<Gpu>,
    scene: Arc<Scene>,
    settings: Settings,
    target: Arc<Target>,
    draw: DrawPass,
    /// Made when they are first needed.
    depth_cue: Option<DepthCuePass>,
    pick: Option<PickPass>,
    style: Style,
    looks: Looks,
    taken: Taken,
    /// What the GPU has been told of the frame.
    uniform: Option<FrameUniform>,
    rebuild: Rebuild,
    timer: Timer,
    wishes: Wishes,
    chooser: StateChooser,
    residency: Residency,
    staging: Staging,
    batches: Vec<Batch>,
    mirrors: Vec<Mirror>,
    /// What the GPU holds of every instance.
    states: Vec<State>,
    /// What it shall hold.
    wanted: Vec<State>,
    /// The instances of which the GPU holds something, ascending.
    held: Vec<u32>,
    /// Those of which it holds something or shall hold something.
    touched: Vec<u32>,
    wants: Wants,
    /// Per part, its place in the list of what will be wanted.
    slots: Vec<u32>,
    /// For each visible instance how long its box seems, in pixels.
    seen_px: Vec<f32>,
    boxes: Boxes,
    squeeze: Squeeze,
    /// The camera that was last selected for, and the one that was last drawn from.
    view: Option<Camera>,
    shown: Option<Camera>,
    motion: Motion,
    /// Where the camera will be soon, if it moves and frames do not wait.
    ahead: Option<Camera>,
    frames_at_rest: u32,
    /// Whether the last selection was the first, with no wishes that its dead band could hold on to: another of the same view
    /// comes to the same.
    is_exact: bool,
    /// Whether the last frame left something for the next.
    pending: bool,
    /// Whether something that was granted did not fit the last frame.
    is_held_back: bool,
    /// What had arrived when states were granted last, and whether they were kept where they could be.
    basis: Option<(u64, bool)>,
    /// Whether states were granted anew in this frame.
    chosen: bool,
    /// Whether the last frame changed what is drawn.
    changed: bool,
    /// Whether this frame has nothing to do but to draw.
    settled: bool,
    frame: u64,
    /// What the last frame asked of the draw pass.
    drawn_as: Asked,
    /// Set when nobody waits any more for what is to be read.
    stop: &'static AtomicBool,
    /// What `whole` sends a frame, the camera apart.
    bytes_of_whole: u64,
    /// What was sent of camera, boxes and looks in this frame, whatever the strategy.
    bytes_of_view: u64,
    drawn_area_permille: u64,
    visible: u64,
    /// Instances of which less had arrived than was wished for, and vertices that were wished for, by the last choice.
    misses: u64,
    wished: u64,
    /// Vertices that the last choice granted.
    granted: u64,
    /// Vertices of the coarsest states of what it granted.
    floors: u64,
    /// Of all of it, sent at once.
    largest_part_bytes: u64,
}

/// As many as a query set holds: four passes a batch, and the draw.
const MOST_TIMED_PASSES: usize = 2048;
/// Bytes of the arguments of one indirect draw.
pub(crate) const DRAW_BYTES: u64 = 20;
/// After so many frames with the same camera every dead band is closed and budgets are exact.
const FRAMES_TO_REST: u32 = 3;

impl Renderer {
    /// Prepares a scene for drawing; nothing of its payload is read yet.
    ///
    /// # Errors
    /// The adapter has no room for the tables or the picture.
    pub fn new(gpu: Arc<Gpu>, scene: Arc<Scene>, settings: Settings) -> Result<Self, FrameError> {
        let draw = DrawPass::new(&gpu.device, settings.samples);
        let target = Target::new(&gpu.device, settings.width, settings.height, settings.samples)?;
        let instances = scene.instances().len();
        let wishes = Wishes::new(&gpu, &scene, settings.select)?;
        let mut this = Self {
            target: Arc::new(target),
            depth_cue: None,
            pick: None,
            style: Style::default(),
            looks: Looks::new(instances),
            taken: Taken::default(),
            uniform: None,
            rebuild: Rebuild::new(&gpu),
            timer: Timer::new(&gpu, MOST_TIMED_PASSES)?,
            residency: Residency::new(&scene, residency_options(&scene, &wishes, &settings)?),
            wishes,
            chooser: StateChooser::default(),
            staging: Staging::default(),
            batches: Vec::new(),
            mirrors: Vec::new(),
            states: vec![State::default(); instances],
            wanted: vec![State::default(); instances],
            held: Vec::new(),
            touched: Vec::new(),
            wants: Wants::new(&scene),
            slots: vec![0; scene.parts().len()],
            seen_px: Vec::new(),
            boxes: Boxes::new(&gpu, &draw)?,
            squeeze: Squeeze::default(),
            view: None,
            shown: None,
            motion: Motion::default(),
            ahead: None,
            frames_at_rest: 0,
            is_exact: false,
            pending: false,
            is_held_back: false,
            basis: None,
            chosen: false,
            changed: false,
            settled: false,
            frame: 0,
            drawn_as: Asked::default(),
            stop: &NEVER,
            bytes_of_whole: 0,
            bytes_of_view: 0,
            drawn_area_permille: 0,
            visible: 0,
            misses: 0,
            wished: 0,
            granted: 0,
            floors: 0,
            largest_part_bytes: caps::largest_part_bytes(&scene),
            draw,
            gpu,
            scene,
            settings,
        };
        let batches = this.batches_expected();
        this.deal(batches)?;
        Ok(this)
    }

    /// Draws one frame.
    ///
    /// # Errors
    /// Damaged data, or whatever went wrong on the device.
    pub fn frame(&mut self, camera: &Camera) -> Result<FrameRecord, FrameError> {
        self.frame_selected_for(camera, camera)
    }

    /// Draws one frame of what `selected_for` would be shown, as `camera` sees it.
    ///
    /// # Errors
    /// As [`Renderer::frame`].
    pub fn frame_selected_for(
        &mut self,
        selected_for: &Camera,
        camera: &Camera,
    ) -> Result<FrameRecord, FrameError> {
        let started = Instant::now();
        let faults = memory::thread_major_faults();
        let mut record = FrameRecord { frame: self.frame, ..FrameRecord::default() };
        self.timer.start();

        self.select(selected_for, &mut record)?;
        self.residency(selected_for, &mut record)?;
        self.keep_caps(selected_for, &mut record)?;
        let deltas = self.delta(&mut record)?;
        let uploads = self.upload(&deltas, &mut record)?;
        self.defragment_and_reform(&uploads, &mut record)?;
        self.draw(camera, &mut record)?;

        record.frame_ms = milliseconds_since(started);
        record.major_faults =
            memory::thread_major_faults().zip(faults).map_or(0, |(now, before)| now - before);
        self.count(&mut record)?;
        self.frame += 1;
        Ok(record)
    }

    /// Stage 1. Skipped when neither the camera nor anything else has changed for a few frames, or since a first selection.
    fn select(&mut self, camera: &Camera, record: &mut FrameRecord) -> Result<(), FrameError> {
        let started = Instant::now();
        self.chosen = false;
        let moved = self.view.as_ref() != Some(camera);
        self.frames_at_rest = if moved { 0 } else { self.frames_at_rest.saturating_add(1) };
        self.view = Some(*camera);
        self.ahead = match self.settings.prefetch && !self.settings.settle {
            true => self.motion.ahead(started, camera),
            false => None,
        };
        let rests = self.frames_at_rest >= FRAMES_TO_REST;
        let is_known = !moved && (rests || self.is_exact);
        if !is_known {
            self.is_exact = self.frame == 0;
            self.squeeze.begin(self.share_of_caps(), moved);
            let view = self.select_view(camera);
            if self.wishes.update(&self.gpu, &self.scene, &view, self.settings.settle)? {
                record.compute_passes += 1;
            }
        }
        let is_late = is_known && self.wishes.receive(&self.gpu)?;
        self.settled = rests && !is_late && !self.pending && !self.changed;
        record.select_ms = milliseconds_since(started);
        Ok(())
    }

    fn select_view(&self, camera: &Camera) -> SelectView {
        let mut planes = [[0.0, 0.0, 0.0, 1.0]; 6];
        for (plane, found) in planes.iter_mut().zip(camera.frustum_planes(self.target.aspect())) {
            *plane = found.to_array();
        }
        SelectView {
            eye: camera.eye.to_array(),
            planes,
            focal_px: camera.focal_px(self.settings.height),
            parallel: camera.parallel.is_some(),
            min_area_px: self.squeeze.least_area_px(),
            max_area_px: self.settings.width as f32 * self.settings.height as f32,
            alpha: self.settings.alpha,
            error_px: self.settings.error_px,
            dead_band: self.dead_band(),
            budget: self.squeeze.budget(self.settings.budget_vertices),
        }
    }

    /// The dead band closes when the camera comes to rest.
    fn dead_band(&self) -> f32 {
        match self.frames_at_rest {
            0 => self.settings.dead_band,
            1 => self.settings.dead_band * 0.25,
            _ => 0.0,
        }
    }

    /// Stage 2. Skipped at rest once everything has arrived.
    fn residency(&mut self, camera: &Camera, record: &mut FrameRecord) -> Result<(), FrameError> {
        let started = Instant::now();
        self.residency.receive()?;
        if !self.settled {
            let has_moved = self.frames_at_rest == 0;
            let changes = self.wishes.take_changes();
            if has_moved || !changes.is_empty() {
                self.see(camera);
            }
            self.ask(camera, has_moved, &changes);
            self.prefetch();
            if self.settings.settle {
                self.residency.settle_unless(self.stop)?;
            }
            self.choose(!changes.is_empty());
            self.pending = self.residency.is_waiting() || self.is_held_back;
        }
        record.disk_bytes += self.residency.take_bytes_read();
        record.evicted_bytes += self.residency.take_bytes_evicted();
        record.resident_bytes = self.residency.bytes_held();
        record.memory_bytes = self.memory_bytes();
        record.residency_ms += milliseconds_since(started);
        Ok(())
    }

    /// Grants states, unless all is as it was when they were granted last.
    fn choose(&mut self, have_wishes_changed: bool) {
        let keep = self.dead_band() > 0.0;
        let basis = (self.residency.version(), keep);
        if !have_wishes_changed && !self.is_held_back && self.basis == Some(basis) {
            return;
        }
        self.chosen = true;
        self.basis = Some(basis);
        let wishes = (self.wishes.get(), self.wishes.visible());
        let choice = self.chooser.choose(&self.scene, &self.residency, wishes, keep, &mut self.wanted);
        // What was held back and is no longer wished for is not in the chooser's hands.
        for &instance in self.held.iter().filter(|&&instance| !self.chooser.draws(instance)) {
            self.wanted[instance as usize] = State::default();
        }
        self.touched = plan::merged(&self.held, self.chooser.drawn());
        self.visible = choice.visible.into();
        self.misses = choice.misses.into();
        self.wished = self.wished_vertices();
        (self.granted, self.floors) = (choice.granted, choice.floors);
    }

    /// Vertices that the view asks for, whatever stands in for what has not arrived.
    fn wished_vertices(&self) -> u64 {
        let wishes = self.wishes.get();
        self.wishes.visible().iter().map(|&instance| u64::from(wishes[instance as usize])).sum()
    }

    /// Stage 4: gathers what is sent and copies it to the GPU.
    fn upload(
        &mut self,
        deltas: &[Vec<Delta>],
        record: &mut FrameRecord,
    ) -> Result<Vec<BatchUpload>, FrameError> {
        let uploads = self.plan_uploads(deltas);
        for upload in &uploads {
            let layout = upload.layout;
            record.streamed_vertices += layout.vertices;
            record.streamed_ecol += layout.ecol;
            record.streamed_triangles += layout.triangles;
            record.bytes_tables += size_of_val(upload.grants.as_slice()) as u64;
        }
        if self.settings.passes == PassesOn::Nowhere {
            return Ok(uploads);
        }
        let sizing = self.sizing();
        for (batch, upload) in self.batches.iter_mut().zip(&uploads).filter(|(_, upload)| !upload.is_empty())
        {
            let grants = upload.grants.len() as u64;
            batch.ensure(&self.gpu, upload.totals, upload.layout.words(), grants, sizing)?;
        }
        match (self.settings.passes, self.settings.strategy) {
            (PassesOn::Gpu, Strategy::PerPart) => self.send_part_by_part(&uploads, record)?,
            (PassesOn::Gpu, _) => self.send_in_one_block(&uploads, record)?,
            _ => {}
        }
        Ok(uploads)
    }

    /// Stages 5 and 6, in every batch in which something changed.
    fn defragment_and_reform(
        &mut self,
        uploads: &[BatchUpload],
        record: &mut FrameRecord,
    ) -> Result<(), FrameError> {
        if uploads.iter().all(BatchUpload::is_empty) {
            return Ok(());
        }
        match self.settings.passes {
            PassesOn::Gpu => self.rebuild_on_gpu(uploads, record)?,
            PassesOn::Reference => self.rebuild_on_reference(uploads, record)?,
            PassesOn::Nowhere => self.count_as_rebuilt(uploads, record),
        }
        Ok(())
    }

    /// Fills in what is known when the frame is done.
    fn count(&mut self, record: &mut FrameRecord) -> Result<(), FrameError> {
        for (stage, ms) in self.timer.read(&self.gpu)? {
            let Some(ms) = ms else { continue };
            match stage {
                "grant" => (record.grant_ms, record.defragment_ms) = (ms, record.defragment_ms + ms),
                "prefix_sum" => {
                    (record.prefix_sum_ms, record.defragment_ms) = (ms, record.defragment_ms + ms)
                }
                "defragment" => record.defragment_ms += ms,
                "reform" => record.reform_ms += ms,
                "draw" => record.draw_ms = ms,
                _ => {}
            }
        }
        let sum =
            |stream: usize| self.batches.iter().map(|batch| u64::from(batch.totals[stream])).sum::<u64>();
        record.active_vertices = sum(0);
        record.active_ecol = sum(1);
        record.active_triangles = sum(2);
        record.draw_floor_bytes = floor::draw(&floor::Drawn {
            vertices: record.active_vertices,
            triangles: record.active_triangles,
            rows: self.held.len() as u64 + record.boxes,
            pixels: u64::from(self.settings.width) * u64::from(self.settings.height),
        });
        record.existing_vertices = record.active_vertices.saturating_sub(record.streamed_vertices);
        record.existing_ecol = record.active_ecol.saturating_sub(record.streamed_ecol);
        record.existing_triangles = record.active_triangles.saturating_sub(record.streamed_triangles);
        record.misses = self.misses;
        record.wished_vertices = self.wished;
        record.instances_visible = self.visible;
        record.instances_culled = self.scene.instances().len() as u64 - self.visible;
        record.bytes_vertices = record.streamed_vertices * crate::stream::delta::VERTEX_BYTES;
        record.bytes_ecol = record.streamed_ecol * crate::stream::delta::ECOL_BYTES;
        record.bytes_triangles = record.streamed_triangles * crate::stream::delta::TRIANGLE_BYTES;
        record.bytes_sent =
            record.bytes_vertices + record.bytes_ecol + record.bytes_triangles + record.bytes_tables;
        let all = self.bytes_of_whole + self.bytes_of_view;
        record.bytes_whole = all;
        record.bytes_per_part = all;
        record.gpu_bytes = self.gpu_bytes();
        if self.chosen || self.changed || self.frames_at_rest == 0 {
            self.drawn_area_permille = self.drawn_area_permille();
        }
        record.drawn_area_permille = self.drawn_area_permille;
        Ok(())
    }

    /// Bytes of GPU memory that this renderer has asked for.
    fn gpu_bytes(&self) -> u64 {
        self.batches.iter().map(Batch::size_bytes).sum::<u64>()
            + self.staging.size_bytes()
            + self.wishes.gpu_bytes()
            + self.rebuild.size_bytes()
            + self.target.gpu_bytes()
            + self.boxes.size_bytes()
    }

    /// The picture.
    pub fn target(&self) -> &Arc<Target> {
        &self.target
    }

    /// How it renders.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What is spent, and how it is sent, from the next frame on.
    pub fn set_spending(&mut self, spending: Spending) {
        let Spending { budget_vertices, alpha, error_px, strategy, upload_limit_bytes } = spending;
        let settings =
            Settings { budget_vertices, alpha, error_px, strategy, upload_limit_bytes, ..self.settings };
        if settings != self.settings {
            self.settings = settings;
            // As if the camera had moved.
            self.view = None;
        }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What the GPU holds of every instance.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// The vertices that each instance is wished to have.
    pub fn wishes(&self) -> &[u32] {
        self.wishes.get()
    }

    /// What is in memory of a part.
    pub fn resident(&self, part: u32) -> &ResidentPart {
        self.residency.part(part)
    }

    /// Frames that wait until all they want has been read end once this is set, with what there is.
    pub fn stop_waiting_when(&mut self, stop: &'static AtomicBool) {
        self.stop = stop;
    }

    /// The camera of the last frame.
    pub fn camera(&self) -> Option<Camera> {
        self.shown
    }

    /// How many batches the instances are dealt to.
    pub fn batch_count(&self) -> usize {
        self.batches.len()
    }

    /// The rows that the draw pass needs of some instances, and after them rows whose colours are those of slots.
    fn instance_rows(&self, instances: &[u32]) -> Vec<InstanceRow> {
        let scene = &self.scene;
        let row = |&number: &u32| instance_row(scene, number);
        let mut rows: Vec<InstanceRow> = instances.par_iter().map(row).collect();
        for (i, &number) in instances.iter().enumerate() {
            let instance = &self.scene.instances()[number as usize];
            let colours = self.scene.slot_colours(instance);
            // The number of a row has 24 bits; a batch of more rows than that shows the first material only.
            if !colours.is_empty() && rows.len() < 1 << 24 {
                let (row, first) = (rows[i], rows.len() as u32);
                rows.extend(colours.iter().map(|&colour| row.with_colour(colour)));
                let kept = row.colour & (InstanceRow::CLOSED | InstanceRow::INSIDE_OUT);
                rows[i].colour = InstanceRow::SLOTTED | kept | first;
            }
        }
        rows
    }
}

/// Of a renderer that nobody stops.
static NEVER: AtomicBool = AtomicBool::new(false);

fn instance_row(scene: &Scene, number: u32) -> InstanceRow {
    let instance = &scene.instances()[number as usize];
    let part = &scene.parts()[instance.part as usize];
    let placed = instance.transform();
    InstanceRow::new(placed, part.grid(), scene.colour(instance), part.attributes())
        .closed(part.closure(), placed)
}

pub(crate) fn milliseconds_since(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}
