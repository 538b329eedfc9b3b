//! The painter: wishes in, finished pictures out, on a thread of its own, so that the window never waits for a frame.
//!
//! Of wishes the newest counts; errands (a pick, a picture to be saved) are all run, in order. Each finished frame is
//! handed over as a target that the painter does not touch again while anybody holds it. What goes wrong is handed over
//! too: the painter then ends, but for memory of the graphics card running out, which halves the budget.

pub mod turntable;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

use glam::{DVec2, DVec3};
use parking_lot::{Condvar, Mutex};

use super::measure::{self, Chain, Picked, SnapKind, Surface};
use super::navigation::Picture;
use super::reading::{Reading, Watch};
use crate::container::ContainerError;
use crate::frame::colour_by::{ColourBy, Coloured, look_of};
use crate::frame::{FrameError, Pick, Renderer, Settings, Spending};
use crate::gpu::target::{Target, TargetError, write_png};
use crate::gpu::{Gpu, GpuError};
use crate::passes::draw::{Look, Style};
use crate::scene::{Camera, Scene};
use crate::stats::FrameRecord;
use rayon::prelude::*;
use turntable::{Made, Progress, Running, Turntable};

/// What the window wants to see.
#[derive(Debug, Clone)]
pub struct Wish {
    /// From where.
    pub camera: Camera,
    /// Whose selection is drawn instead of the camera's own: somebody froze it and walked away.
    pub frozen: Option<Camera>,
    /// Pixels, width and height, each at least 1.
    pub size: [u32; 2],
    /// Edges, sections, depth cue.
    pub style: Style,
    /// What is spent.
    pub spending: Spending,
    /// What colours tell.
    pub colour_by: ColourBy,
    /// How instances look beside that, by number.
    pub looks: Arc<Vec<Look>>,
    /// The instance that the user wants to know about.
    pub watched: Option<u32>,
}

impl PartialEq for Wish {
    /// Looks are many: another table of them is another wish, whatever it says.
    fn eq(&self, other: &Self) -> bool {
        fn values(of: &Wish) -> impl PartialEq + '_ {
            let Wish { camera, frozen, size, style, spending, colour_by, watched, looks: _ } = of;
            (camera, frozen, size, style, spending, colour_by, watched)
        }
        values(self) == values(other) && Arc::ptr_eq(&self.looks, &other.looks)
    }
}

/// What a pick is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// To see what is under the pointer.
    Hover,
    /// To select it.
    Select,
    /// The same, beside what is selected already.
    SelectMore,
    /// The hand took hold of it.
    Grab,
    /// To cut along its face.
    Cut,
    /// To show all of it.
    Fit,
}

/// What is done once.
#[derive(Debug, Clone, PartialEq)]
pub enum Errand {
    /// Say what is in a pixel of the newest frame.
    Pick {
        /// Pixels from the upper left corner.
        at: [u32; 2],
        /// What for.
        purpose: Purpose,
    },
    /// Say what there is to be measured in a pixel.
    Measure {
        /// Pixels from the upper left corner.
        at: [u32; 2],
        /// Whether the part is read from the file at full detail.
        is_full: bool,
    },
    /// Write the newest picture as a PNG file.
    Save(PathBuf),
    /// Write pictures from once round, between other frames.
    Turntable(Box<Turntable>),
    /// Make no more of them.
    StopTurntable,
    /// Behave as if the graphics card had no memory left, to see what happens.
    Exhaust,
}

/// What became of an errand.
#[derive(Debug, Clone, PartialEq)]
pub enum Done {
    /// What is in a pixel.
    Picked {
        /// As asked.
        purpose: Purpose,
        /// As asked.
        at: [u32; 2],
        /// The instance and the point, if there is one.
        found: Option<Pick>,
        /// The unit normal of the face that is to be cut along, towards the eye, if it shows.
        normal: Option<DVec3>,
    },
    /// What there is to be measured, if there is anything.
    Measured(Option<Measured>),
    /// A part could not be read.
    NotMeasured(String),
    /// The picture is there.
    Saved(PathBuf),
    /// The picture, or one of a turntable, could not be written.
    NotSaved(String),
    /// The pictures of a turntable are there, or those until it was stopped.
    Pictures(Made),
}

/// A point to measure from.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The point, and what it is on.
    pub picked: Picked,
    /// The edge that it is on, if it is on one.
    pub chain: Option<Chain>,
}

/// A finished frame.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The picture.
    pub target: Arc<Target>,
    /// From where.
    pub camera: Camera,
    /// What it cost.
    pub record: FrameRecord,
    /// What the user watches, as it is drawn.
    pub reading: Option<Reading>,
    /// Whether the next frame would be the same.
    pub is_settled: bool,
    /// The budget that was halved because memory ran out, if it was.
    pub halved_budget: Option<u32>,
}

/// What the window finds.
#[derive(Debug, Default)]
pub struct News {
    /// The newest frame since the last look.
    pub frame: Option<Frame>,
    /// All records since the last look.
    pub records: Vec<FrameRecord>,
    /// What became of errands.
    pub done: Vec<Done>,
    /// How far the pictures of a turntable are, while they are made.
    pub turntable: Option<Progress>,
    /// Why the painter ended.
    pub trouble: Option<Trouble>,
}

/// Why a painter ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// The device was lost: everything on it has to be made again.
    DeviceLost(String),
    /// Nothing can be drawn of this model.
    Failed(String),
}

#[derive(Debug, Default)]
struct Shared {
    wish: Option<Wish>,
    /// Whether there is a wish that was not looked at.
    is_new: bool,
    errands: Vec<Errand>,
    stop: bool,
    news: News,
}

/// A handle on the painter's thread, which ends with it.
pub struct Painter {
    shared: Arc<(Mutex<Shared>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

/// Called, from the painter's thread, whenever there is news.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

impl Painter {
    /// Starts to paint a scene. Its thread makes the renderer, which may take a while.
    pub fn new(gpu: Arc<Gpu>, scene: Arc<Scene>, settings: Settings, wake: Wake) -> Self {
        let shared = Arc::new((Mutex::new(Shared::default()), Condvar::new()));
        let theirs = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            let ended = Easel::new(&gpu, &scene, settings).and_then(|mut easel| easel.work(&theirs, &wake));
            if let Err(error) = ended {
                theirs.0.lock().news.trouble = Some(trouble(&error));
                wake();
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Takes a wish; an older one that was not looked at is forgotten.
    pub fn wish(&self, wish: Wish) {
        let mut shared = self.shared.0.lock();
        shared.wish = Some(wish);
        shared.is_new = true;
        self.shared.1.notify_one();
    }

    /// Takes an errand.
    pub fn errand(&self, errand: Errand) {
        self.shared.0.lock().errands.push(errand);
        self.shared.1.notify_one();
    }

    /// What happened since the last call.
    pub fn news(&self) -> News {
        let mut shared = self.shared.0.lock();
        let turntable = shared.news.turntable;
        std::mem::replace(&mut shared.news, News { turntable, ..News::default() })
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        self.shared.0.lock().stop = true;
        self.shared.1.notify_one();
        if let Some(thread) = self.thread.take() {
            // It has said why if it has failed.
            let _ = thread.join();
        }
    }
}

fn trouble(error: &FrameError) -> Trouble {
    match error {
        FrameError::Gpu(GpuError::Lost(why)) => Trouble::DeviceLost(why.clone()),
        other => Trouble::Failed(other.to_string()),
    }
}

/// What the thread works with.
struct Easel<'a> {
    gpu: &'a Arc<Gpu>,
    scene: &'a Arc<Scene>,
    renderer: Renderer,
    /// Targets that were handed over, or may be.
    targets: Vec<Arc<Target>>,
    /// The looks that the renderer was given, as the window made them.
    given: Option<(Arc<Vec<Look>>, ColourBy)>,
    watch: Watch,
    /// The most that may be spent since memory ran out.
    most_budget: u32,
    halved: Option<u32>,
    /// Frames in a row that changed nothing.
    quiet: u32,
    /// The pictures that are made between other frames.
    turntable: Option<Running>,
    /// Whether the last frame was one of those, and not of the window's wish.
    is_elsewhere: bool,
}

/// After so many frames that change nothing, nothing will, while the wish stays.
const QUIET_FRAMES: u32 = 4;
/// A budget is not halved below this.
const LEAST_BUDGET: u32 = 1000;
/// Features are taken that are so near.
const SNAP_PX: f64 = 12.0;
/// Targets: one is drawn to, one is shown, one is on its way.
const TARGETS: usize = 3;

impl<'a> Easel<'a> {
    fn new(gpu: &'a Arc<Gpu>, scene: &'a Arc<Scene>, settings: Settings) -> Result<Self, FrameError> {
        Ok(Self {
            renderer: Renderer::new(Arc::clone(gpu), Arc::clone(scene), settings)?,
            gpu,
            scene,
            targets: Vec::new(),
            given: None,
            watch: Watch::default(),
            most_budget: u32::MAX,
            halved: None,
            quiet: 0,
            turntable: None,
            is_elsewhere: false,
        })
    }

    fn work(&mut self, shared: &(Mutex<Shared>, Condvar), wake: &Wake) -> Result<(), FrameError> {
        while let Some((wish, errands)) = self.next(shared) {
            let (frames, others): (Vec<_>, Vec<_>) =
                errands.into_iter().partition(|errand| *errand == Errand::Exhaust);
            frames.iter().for_each(|_| self.gpu.exhaust());
            let frame = wish.map(|wish| self.frame_of_window(&wish)).transpose()?;
            let done = others.into_iter().map(|errand| self.run(errand)).collect::<Result<Vec<_>, _>>()?;
            let turned = self.turn()?;
            if self.tell(shared, frame, done.into_iter().chain([turned]).flatten()) {
                wake();
            }
        }
        Ok(())
    }

    /// Hands over what came of a round; says whether that was anything.
    fn tell(
        &self,
        shared: &(Mutex<Shared>, Condvar),
        frame: Option<Frame>,
        done: impl Iterator<Item = Done>,
    ) -> bool {
        let mut shared = shared.0.lock();
        let news = &mut shared.news;
        let before = (news.done.len(), news.turntable);
        news.done.extend(done);
        news.turntable = self.turntable.as_ref().map(Running::progress);
        let has_news = frame.is_some() || before != (news.done.len(), news.turntable);
        if let Some(frame) = frame {
            news.records.push(frame.record);
            news.frame = Some(frame);
        }
        has_news
    }

    fn frame_of_window(&mut self, wish: &Wish) -> Result<Frame, FrameError> {
        if std::mem::take(&mut self.is_elsewhere) {
            self.quiet = 0;
        }
        self.frame_or_less(wish)
    }

    /// Waits for something to do; `None` to stop.
    fn next(&mut self, (shared, changed): &(Mutex<Shared>, Condvar)) -> Option<(Option<Wish>, Vec<Errand>)> {
        let mut shared = shared.lock();
        loop {
            if shared.stop {
                return None;
            }
            let is_turning = self.turntable.is_some();
            // While a turntable is made, what the window wished for is drawn once, and refined afterwards.
            let is_restless =
                !is_turning && shared.wish.is_some() && (self.is_elsewhere || self.quiet < QUIET_FRAMES);
            if shared.is_new || is_restless || is_turning || !shared.errands.is_empty() {
                self.quiet = if shared.is_new { 0 } else { self.quiet };
                // A pick needs no frame of its own, unless the last was none of the window's.
                let needs_frame = shared.is_new
                    || is_restless
                    || self.is_elsewhere && !shared.errands.is_empty()
                    || shared.errands.contains(&Errand::Exhaust);
                shared.is_new = false;
                let wish = shared.wish.clone().filter(|_| needs_frame);
                return Some((wish, std::mem::take(&mut shared.errands)));
            }
            changed.wait(&mut shared);
        }
    }

    /// Draws a frame; where memory is out, with half the budget, until it fits.
    fn frame_or_less(&mut self, wish: &Wish) -> Result<Frame, FrameError> {
        loop {
            match self.frame(wish) {
                Err(error) if is_out_of_memory(&error) => {
                    let halved = wish.spending.budget_vertices.min(self.most_budget) / 2;
                    if halved < LEAST_BUDGET {
                        return Err(error);
                    }
                    (self.most_budget, self.halved) = (halved, Some(halved));
                    self.given = None;
                    self.targets.clear();
                    let settings = Settings { budget_vertices: halved, ..*self.renderer.settings() };
                    self.renderer = Renderer::new(Arc::clone(self.gpu), Arc::clone(self.scene), settings)?;
                }
                result => return result,
            }
        }
    }

    fn frame(&mut self, wish: &Wish) -> Result<Frame, FrameError> {
        self.aim(wish)?;
        let selected_for = wish.frozen.as_ref().unwrap_or(&wish.camera);
        let record = self.renderer.frame_selected_for(selected_for, &wish.camera)?;
        self.watch.after(&self.renderer, wish.colour_by == ColourBy::Age);
        let is_quiet = record.streamed_vertices + record.streamed_triangles + record.disk_bytes == 0
            && record.misses == 0
            && !(wish.colour_by == ColourBy::Age && self.watch.is_aging());
        self.quiet = if is_quiet { self.quiet + 1 } else { 0 };
        Ok(Frame {
            target: Arc::clone(self.renderer.target()),
            camera: wish.camera,
            reading: wish.watched.map(|instance| self.watch.reading(self.scene, &self.renderer, instance)),
            record,
            is_settled: self.quiet >= QUIET_FRAMES,
            halved_budget: self.halved,
        })
    }

    /// Tells the renderer what a wish says.
    fn aim(&mut self, wish: &Wish) -> Result<(), FrameError> {
        let target = self.free_target(wish.size)?;
        self.renderer.replace_target(target)?;
        let budget_vertices = wish.spending.budget_vertices.min(self.most_budget);
        self.renderer.set_spending(Spending { budget_vertices, ..wish.spending });
        self.renderer.set_style(wish.style.clone());
        let is_given = self
            .given
            .as_ref()
            .is_some_and(|(looks, by)| Arc::ptr_eq(looks, &wish.looks) && *by == wish.colour_by);
        if !is_given || wish.colour_by.changes() {
            self.give_looks(wish);
        }
        Ok(())
    }

    fn give_looks(&mut self, wish: &Wish) {
        self.given = Some((Arc::clone(&wish.looks), wish.colour_by));
        if wish.colour_by == ColourBy::Material {
            return self.renderer.set_looks(&wish.looks);
        }
        let of = Coloured {
            scene: self.scene,
            states: self.renderer.states(),
            wishes: self.renderer.wishes(),
            ages: self.watch.ages(),
        };
        let coloured =
            |(instance, look): (usize, &Look)| look.with(look_of(wish.colour_by, &of, instance as u32));
        let looks: Vec<Look> = wish.looks.par_iter().enumerate().map(coloured).collect();
        self.renderer.set_looks(&looks);
    }

    /// A target of that size that nobody looks at.
    fn free_target(&mut self, [width, height]: [u32; 2]) -> Result<Arc<Target>, FrameError> {
        let fits = |target: &Arc<Target>| (target.width(), target.height()) == (width, height);
        self.targets.retain(fits);
        let drawn_last = Arc::as_ptr(self.renderer.target());
        let free =
            |target: &&Arc<Target>| Arc::strong_count(target) == 1 && Arc::as_ptr(target) != drawn_last;
        if let Some(target) = self.targets.iter().find(free) {
            return Ok(Arc::clone(target));
        }
        let device = &self.gpu.device;
        let target = match self.targets.first() {
            Some(target) => target.sibling(device)?,
            None => {
                let limit = device.limits().max_texture_dimension_2d;
                let samples = self.renderer.settings().samples;
                Target::new(device, width.clamp(1, limit), height.clamp(1, limit), samples)?
            }
        };
        let target = Arc::new(target);
        // More are asked for only while somebody holds on to old ones.
        if self.targets.len() < TARGETS {
            self.targets.push(Arc::clone(&target));
        }
        Ok(target)
    }

    fn run(&mut self, errand: Errand) -> Result<Option<Done>, FrameError> {
        Ok(match errand {
            Errand::Pick { at, purpose } => {
                let found = self.renderer.pick(at)?;
                let normal = match &found {
                    Some(pick) if purpose == Purpose::Cut => self.renderer.normal_at(at, pick)?,
                    _ => None,
                };
                Some(Done::Picked { purpose, at, found, normal })
            }
            Errand::Measure { at, is_full } => Some(match self.measure(at, is_full)? {
                Ok(measured) => Done::Measured(measured),
                Err(error) => Done::NotMeasured(error.to_string()),
            }),
            Errand::Save(path) => Some(match self.save(&path) {
                Ok(()) => Done::Saved(path),
                Err(error) => Done::NotSaved(error.to_string()),
            }),
            Errand::Turntable(_) if self.turntable.is_some() => {
                Some(Done::NotSaved("pictures of a turntable are being saved; stop them first".to_owned()))
            }
            Errand::Turntable(asked) => {
                self.turntable = Some(Running::new(*asked));
                None
            }
            Errand::StopTurntable => self.turntable.take().map(|running| Done::Pictures(running.made())),
            Errand::Exhaust => None,
        })
    }

    /// Snaps to what is near a pixel; the inner error is a part that cannot be read.
    fn measure(
        &mut self,
        at: [u32; 2],
        is_full: bool,
    ) -> Result<Result<Option<Measured>, ContainerError>, FrameError> {
        let (Some(pick), Some(camera)) = (self.renderer.pick(at)?, self.renderer.camera()) else {
            return Ok(Ok(None));
        };
        let instance = pick.instance;
        let part = self.scene.instances()[instance as usize].part;
        let drawn = self.renderer.states()[instance as usize].vertices;
        let surface = match is_full {
            true => match Surface::full_detail(self.scene, instance) {
                Ok(surface) => surface,
                Err(error) => return Ok(Err(error)),
            },
            false => Surface::of_resident(self.scene, instance, self.renderer.resident(part), drawn)
                .unwrap_or_default(),
        };
        let shown = if is_full { self.scene.parts()[part as usize].vertices } else { drawn };
        let target = self.renderer.target();
        let picture = Picture::new(target.width().into(), target.height().into());
        let pixel = DVec2::new(f64::from(at[0]) + 0.5, f64::from(at[1]) + 0.5);
        let snap = surface.snap(&camera, picture, pixel, SNAP_PX);
        let kind = snap.map_or(SnapKind::Face, |snap| snap.kind);
        Ok(Ok(Some(Measured {
            picked: Picked {
                point: snap.map_or(pick.point, |snap| snap.point),
                kind,
                instance,
                error: measure::instance_error(self.scene, instance, shown),
                is_full: measure::is_full_detail(self.scene, instance, shown),
            },
            chain: if let SnapKind::Edge(edge) = kind { Some(surface.chain(edge)) } else { None },
        })))
    }

    fn save(&self, path: &std::path::Path) -> Result<(), TargetError> {
        let target = self.renderer.target();
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let rgba = self.gpu.while_nothing_is_submitted(|| target.read_rgba(device, queue))?;
        write_png(path, target.width(), target.height(), &rgba)
    }
}

fn is_out_of_memory(error: &FrameError) -> bool {
    matches!(
        error,
        FrameError::Gpu(GpuError::OutOfMemory | GpuError::TooLarge { .. })
            | FrameError::Target(TargetError::OutOfMemory { .. })
    )
}
