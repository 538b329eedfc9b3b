//! One opened model: what is seen of it, from where, and what the user has done to it. Owns its painter.
//!
//! Each turn of the window's loop it takes the painter's news ([`Document::poll`]), lets time pass
//! ([`Document::advance`]), is shown by the panels, and wishes for the next frame ([`Document::wish`]).

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::bits::Bits;
use super::cuts::{Cuts, Plane};
use super::history::History;
use super::loader::Loaded;
use super::measure::{Measuring, What};
use super::navigation::motions::pixel_of;
use super::navigation::{Framing, Input, Navigation, Picture};
use super::painter::turntable::{Made, Progress, Turntable};
use super::painter::{Done, Errand, Frame, Measured, Painter, Purpose, Trouble, Wake, Wish};
use super::panels::look::Look as LookSettings;
use super::settings::Settings;
use super::tree::Tree;
use super::visibility::Visibility;
use crate::frame::Pick;
use crate::gpu::Gpu;
use crate::passes::draw::{Look, MOST_PLANES, Style};
use crate::scene::views::StandardView;
use crate::scene::{Bounds, Camera, Scene, turntable};

/// What somebody else has to know of, or to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Happened {
    /// To be said to the user.
    Said(String),
    /// A picture was written to this path, or why it was not.
    Saved(Result<PathBuf, String>),
    /// Something went wrong, to be said until the user has seen it.
    Failed(String),
    /// The device was lost: make another one and call [`Document::restart`].
    DeviceLost(String),
    /// Something was selected in the picture: show it in the tree.
    Selected(u32),
    /// A point to measure from was picked.
    Measured(Measured),
}

/// An opened model.
pub struct Document {
    /// What was opened.
    pub loaded: Loaded,
    /// From where it is seen.
    pub navigation: Navigation,
    /// What is hidden, ghosted and selected.
    pub visibility: Visibility,
    /// The rows of the assembly.
    pub tree: Tree,
    /// Whether what is measured is read at full detail first.
    pub is_full_detail: bool,
    /// What is cut away.
    pub cuts: Cuts,
    /// Colours and edges.
    pub look: LookSettings,
    /// The camera that detail is selected for, if it was frozen.
    pub frozen: Option<Camera>,
    /// The last frames.
    pub history: History,
    /// The newest frame.
    pub frame: Option<Frame>,
    /// What is under the pointer.
    pub hovered: Option<Pick>,
    /// The item of the tree under the pointer.
    pointed_item: Option<u32>,
    /// The instance that was selected last.
    pub watched: Option<u32>,
    /// The picture's size in pixels.
    pub size: [u32; 2],
    /// The camera that shows all of the model; none once somebody has moved it.
    first_view: Option<Camera>,
    painter: Option<Painter>,
    wake: Wake,
    /// The looks that the painter was given, and what they were made of.
    looks: Arc<Vec<Look>>,
    looks_revision: Option<u64>,
    /// The last wish's camera and so on, to see whether there is anything new to wish for.
    wished: Option<Wish>,
    /// Whether a pick for the pointer is on its way.
    is_hover_due: bool,
    budget_was_halved: Option<u32>,
    turntable: Option<Progress>,
    /// Whether pictures of a turntable ended with the painter that made them, and nobody was told.
    has_lost_turntable: bool,
}

impl Document {
    /// Shows all of a model from the corner.
    pub fn new(loaded: Loaded, gpu: &Arc<Gpu>, settings: &Settings, wake: Wake) -> Self {
        let scene = Arc::clone(&loaded.scene);
        let mut navigation = Navigation::new(*scene.bounds(), settings.up, 1.0);
        navigation.set_parallel(settings.parallel);
        navigation.finish();
        let first_view = Some(*navigation.camera());
        let painter = Painter::new(Arc::clone(gpu), Arc::clone(&scene), settings.render(), Arc::clone(&wake));
        Self {
            visibility: Visibility::new(Arc::clone(&loaded.assembly)),
            tree: Tree::new(Arc::clone(&loaded.assembly)),
            is_full_detail: false,
            looks: Arc::new(vec![Look::default(); scene.instances().len()]),
            navigation,
            cuts: Cuts::default(),
            look: LookSettings::default(),
            frozen: None,
            history: History::default(),
            frame: None,
            hovered: None,
            pointed_item: None,
            watched: None,
            size: [0; 2],
            first_view,
            painter: Some(painter),
            wake,
            looks_revision: None,
            wished: None,
            is_hover_due: false,
            budget_was_halved: None,
            turntable: None,
            has_lost_turntable: false,
            loaded,
        }
    }

    /// The model.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.loaded.scene
    }

    /// Width over height of the picture.
    pub fn aspect(&self) -> f64 {
        f64::from(self.size[0].max(1)) / f64::from(self.size[1].max(1))
    }

    /// Takes on the picture's size in pixels. Until somebody moves the camera, all of the model stays in view.
    pub fn resize(&mut self, size: [u32; 2]) {
        if std::mem::replace(&mut self.size, size) == size {
            return;
        }
        self.first_view = self.first_view.filter(|view| view == self.navigation.target());
        if self.first_view.is_some() {
            let bounds = *self.scene().bounds();
            self.navigation.fit(&bounds, self.aspect());
            self.navigation.finish();
            self.first_view = Some(*self.navigation.camera());
        }
    }

    /// Ends the painter, and gives back the picture.
    pub fn stop(&mut self) {
        (self.painter, self.frame) = (None, None);
    }

    /// Makes everything on the device anew, after it was lost or with other caps; all else stays.
    pub fn restart(&mut self, gpu: &Arc<Gpu>, settings: &Settings) {
        // The old one ends first, so that the two never hold memory together.
        self.painter = None;
        self.frame = None;
        self.forget_turntable();
        self.wished = None;
        self.is_hover_due = false;
        let scene = Arc::clone(self.scene());
        self.painter = Some(Painter::new(Arc::clone(gpu), scene, settings.render(), Arc::clone(&self.wake)));
    }

    /// Asks for a pick in the picture.
    pub fn pick(&mut self, at: [u32; 2], purpose: Purpose) {
        if purpose == Purpose::Hover && std::mem::replace(&mut self.is_hover_due, true) {
            return;
        }
        self.errand(Errand::Pick { at, purpose });
    }

    /// Has something done once.
    pub fn errand(&self, errand: Errand) {
        if let Some(painter) = &self.painter {
            painter.errand(errand);
        }
    }

    /// Writes the picture.
    pub fn save_picture(&self, path: PathBuf) {
        self.errand(Errand::Save(path));
    }

    /// Writes so many pictures as the settings say from once round the model into a folder, as all looks now.
    pub fn save_turntable(&mut self, settings: &Settings, folder: &Path) {
        // What is under the pointer is no part of the picture.
        self.visibility.hover(None);
        self.visibility.looks(&[], Arc::make_mut(&mut self.looks));
        self.looks_revision = None;
        let wish = Wish { watched: None, ..self.wished_now(settings) };
        let (pivot, up) = (self.scene().bounds().centre(), self.navigation.up.vector());
        let cameras = turntable::once_round(&wish.camera, pivot, up, settings.turntable_pictures);
        let name = self.loaded.file.file_stem().unwrap_or_default();
        let output = folder.join(name).with_added_extension("png");
        self.errand(Errand::Turntable(Box::new(Turntable { wish, cameras, output })));
        self.highlight();
    }

    /// Makes no more pictures of a turntable.
    pub fn stop_turntable(&self) {
        self.errand(Errand::StopTurntable);
    }

    /// How far the pictures of a turntable are, while they are made.
    pub fn turntable(&self) -> Option<Progress> {
        self.turntable
    }

    fn forget_turntable(&mut self) {
        self.has_lost_turntable |= self.turntable.take().is_some();
    }

    /// Takes the painter's news.
    pub fn poll(&mut self) -> Vec<Happened> {
        let mut happened = Vec::new();
        if std::mem::take(&mut self.has_lost_turntable) {
            let why = "The turntable was stopped: what draws was made anew. Pictures that are written stay.";
            happened.push(Happened::Failed(why.to_owned()));
        }
        let Some(painter) = &self.painter else { return happened };
        let news = painter.news();
        news.records.into_iter().for_each(|record| self.history.add(record));
        self.turntable = news.turntable;
        if let Some(frame) = news.frame {
            happened.extend(self.said_of_budget(&frame));
            self.frame = Some(frame);
        }
        happened.extend(news.done.into_iter().filter_map(|done| self.done(done)));
        if let Some(trouble) = news.trouble {
            self.painter = None;
            self.forget_turntable();
            happened.push(match trouble {
                Trouble::DeviceLost(why) => Happened::DeviceLost(why),
                Trouble::Failed(why) => Happened::Failed(why),
            });
        }
        happened
    }

    fn said_of_budget(&mut self, frame: &Frame) -> Option<Happened> {
        let halved = frame.halved_budget.filter(|_| frame.halved_budget != self.budget_was_halved)?;
        self.budget_was_halved = Some(halved);
        let halved = crate::stats::report::human::count(halved.into());
        Some(Happened::Said(format!(
            "The graphics card ran out of memory: the budget was halved to {halved} vertices."
        )))
    }

    fn done(&mut self, done: Done) -> Option<Happened> {
        match done {
            Done::Saved(path) => Some(Happened::Saved(Ok(path))),
            Done::NotSaved(why) => Some(Happened::Saved(Err(why))),
            Done::NotMeasured(why) => Some(Happened::Failed(why)),
            Done::Pictures(made) => Some(Happened::Said(said_of_pictures(&made))),
            Done::Measured(measured) => measured.map(Happened::Measured),
            Done::Picked { purpose: Purpose::Cut, found: Some(pick), normal, .. } => {
                self.cut_at(pick, normal)
            }
            Done::Picked { purpose, found, .. } => self.picked(purpose, found),
        }
    }

    fn picked(&mut self, purpose: Purpose, found: Option<Pick>) -> Option<Happened> {
        match (purpose, found) {
            (Purpose::Hover, found) => {
                self.is_hover_due = false;
                self.hovered = found;
                self.highlight();
                None
            }
            (Purpose::Select, None) => {
                self.visibility.select(self.visibility.set_of_instance(None));
                self.watched = None;
                None
            }
            (Purpose::Select | Purpose::SelectMore, Some(pick)) => {
                self.select(pick.instance, purpose == Purpose::SelectMore);
                Some(Happened::Selected(pick.instance))
            }
            (Purpose::Grab, found) => {
                self.navigation.begin(found.map(|pick| pick.point));
                None
            }
            (Purpose::Fit, Some(pick)) => {
                let bounds = self.bounds_of(self.scene().placement(pick.instance));
                self.navigation.fit(&bounds, self.aspect());
                None
            }
            _ => None,
        }
    }

    /// Cuts along a face; across the axis that one looks along most, where it does not show how the face lies. What is on
    /// this side of it goes.
    fn cut_at(&mut self, pick: Pick, normal: Option<DVec3>) -> Option<Happened> {
        let bounds = *self.scene().bounds();
        let plane = match normal {
            Some(normal) => Plane::through(pick.point, normal, &bounds),
            None => {
                let forward = self.navigation.camera().forward();
                let axis = (0..3).max_by(|&a, &b| forward[a].abs().total_cmp(&forward[b].abs())).unwrap_or(0);
                let mut plane = Plane::facing(axis, forward);
                plane.set_place(pick.point[axis], &bounds);
                plane
            }
        };
        let had_room = self.cuts.add(plane);
        (!had_room).then(|| Happened::Said(format!("{MOST_PLANES} planes are the most.")))
    }

    /// Selects an instance, and with it all cells that are placed with it; with `more`, beside what is selected, or no
    /// longer.
    pub fn select(&mut self, instance: u32, more: bool) {
        let picked = self.visibility.set_of_instance(Some(instance));
        let mut all = if more { self.visibility.selected().clone() } else { Bits::new(picked.limit()) };
        if picked.iter().all(|leaf| all.has(leaf)) {
            all.subtract(&picked);
        } else {
            all.union(&picked);
        }
        self.visibility.select(all);
        self.watched = Some(instance);
    }

    /// Selects all that is shown whose middle is seen in a frame, in pixels.
    pub fn select_in_frame(&mut self, from: DVec2, to: DVec2) {
        let (low, high) = (from.min(to), from.max(to));
        let camera = *self.navigation.camera();
        let picture = self.picture();
        let is_inside = |instance: u32| {
            let middle = self.scene().boxes()[instance as usize].centre;
            pixel_of(&camera, picture, middle).is_some_and(|at| at.cmpge(low).all() && at.cmple(high).all())
        };
        let assembly = &self.loaded.assembly;
        let mut found = Bits::new(assembly.leaves());
        for leaf in (0..assembly.leaves()).filter(|&leaf| !self.visibility.hidden().has(leaf)) {
            if assembly.instances_of_leaf(leaf).any(is_inside) {
                found.insert(leaf);
            }
        }
        self.watched = found.iter().next().map(|leaf| assembly.instances_of_leaf(leaf).start);
        self.visibility.select(found);
    }

    /// Measures from a pixel on.
    pub fn measure_at(&mut self, at: [u32; 2]) {
        self.errand(Errand::Measure { at, is_full: self.is_full_detail });
    }

    /// The pointer has left the picture.
    pub fn point_at_nothing(&mut self) {
        if self.hovered.take().is_some() {
            self.highlight();
        }
    }

    /// The pointer is over the row of an item, or over none.
    pub fn point_at_item(&mut self, item: Option<u32>) {
        if item != self.pointed_item {
            self.pointed_item = item;
            self.highlight();
        }
    }

    /// Highlights what is under the pointer, in the tree or else in the picture.
    fn highlight(&mut self) {
        match self.pointed_item {
            Some(item) => self.visibility.hover_item(Some(item)),
            None => self.visibility.hover(self.hovered.map(|pick| pick.instance)),
        }
    }

    /// All that is selected.
    pub fn selected(&self) -> Vec<u32> {
        self.visibility.instances_of(self.visibility.selected()).collect()
    }

    /// Does something to what is selected, and asks whether there was anything.
    pub fn to_selected(&mut self, act: impl FnOnce(&mut Visibility, &Bits)) {
        let selected = self.visibility.selected().clone();
        if selected.iter().next().is_some() {
            act(&mut self.visibility, &selected);
        }
    }

    /// The box around instances.
    pub fn bounds_of(&self, instances: impl IntoIterator<Item = u32>) -> Bounds {
        let boxes = self.scene().boxes();
        instances.into_iter().map(|instance| &boxes[instance as usize]).fold(Bounds::EMPTY, Bounds::with_box)
    }

    /// The box around all that is selected; empty if nothing is.
    pub fn bounds_of_selected(&self) -> Bounds {
        self.bounds_of(self.visibility.instances_of(self.visibility.selected()))
    }

    /// The box around the instance that was selected last, with all cells placed with it.
    pub fn bounds_of_watched(&self) -> Bounds {
        self.watched.map_or(Bounds::EMPTY, |instance| self.bounds_of(self.scene().placement(instance)))
    }

    /// The picture that the camera sees, in pixels.
    pub fn picture(&self) -> Picture {
        Picture::new(self.size[0].into(), self.size[1].into())
    }

    /// Turns the model as if it had been dragged so far, in points of the interface.
    pub fn orbit(&mut self, by: egui::Vec2) {
        let by = DVec2::new(by.x.into(), by.y.into());
        self.navigation.apply(Input::Orbit { by }, self.picture());
    }

    /// Goes to where something was measured.
    pub fn show_measurement(&mut self, measuring: &Measuring, number: u32) {
        let Some(found) = measuring.list().iter().find(|one| one.number == number) else { return };
        let bounds = match found.what {
            What::Distance { from, to } => Bounds::EMPTY.with_point(from).with_point(to),
            What::Edge { at, length, .. } => Bounds::new(at - 0.5 * length, at + 0.5 * length),
            What::Size { bounds, .. } => bounds,
        };
        self.navigation.fit(&bounds, self.aspect());
    }

    /// Shows all that is shown.
    pub fn fit_all(&mut self) {
        let hidden = self.visibility.hidden();
        let assembly = &self.loaded.assembly;
        let bounds = match hidden.iter().next() {
            Some(_) => {
                let shown = (0..assembly.leaves()).filter(|&leaf| !hidden.has(leaf));
                self.bounds_of(shown.flat_map(|leaf| assembly.instances_of_leaf(leaf)))
            }
            None => *self.scene().bounds(),
        };
        let bounds = if bounds.is_empty() { *self.scene().bounds() } else { bounds };
        self.navigation.fit(&bounds, self.aspect());
    }

    /// Shows all that is selected, or all.
    pub fn fit_selected(&mut self) {
        let bounds = self.bounds_of_selected();
        if bounds.is_empty() { self.fit_all() } else { self.navigation.fit(&bounds, self.aspect()) }
    }

    /// Looks at all of it from a side.
    pub fn view(&mut self, view: StandardView) {
        let bounds = *self.scene().bounds();
        self.navigation.view(view, Framing::Fit(bounds), self.aspect());
    }

    /// Keeps what is drawn as it was selected for here, or follows the camera again.
    pub fn toggle_freeze(&mut self) {
        self.frozen = match self.frozen {
            Some(_) => None,
            None => Some(*self.navigation.camera()),
        };
    }

    /// Lets time pass; gives whether something moves.
    pub fn advance(&mut self, settings: &Settings, seconds: f64) -> bool {
        self.navigation.up = settings.up;
        self.navigation.set_parallel(settings.parallel);
        self.navigation.tick(seconds)
    }

    /// Wishes for a frame if anything is different from the last wish.
    pub fn wish(&mut self, settings: &Settings) {
        if self.size.contains(&0) {
            return;
        }
        let revision = Some(self.visibility.revision());
        if std::mem::replace(&mut self.looks_revision, revision) != revision {
            let mut looks = Vec::new();
            self.visibility.looks(&[], &mut looks);
            self.looks = Arc::new(looks);
        }
        let wished = self.wished_now(settings);
        if self.wished.as_ref() == Some(&wished) {
            return;
        }
        if let Some(painter) = &self.painter {
            painter.wish(wished.clone());
        }
        self.wished = Some(wished);
    }

    fn wished_now(&self, settings: &Settings) -> Wish {
        Wish {
            camera: *self.navigation.camera(),
            frozen: self.frozen,
            size: self.size,
            style: Style {
                edges: self.look.edges,
                sections: self.cuts.sections(self.scene().bounds()),
                depth_cue: settings.depth_cue,
                ..Style::default()
            },
            spending: settings.spending(),
            colour_by: self.look.colour_by,
            looks: Arc::clone(&self.looks),
            watched: self.watched,
        }
    }
}

fn said_of_pictures(made: &Made) -> String {
    let Made { progress: Progress { done, of }, incomplete, folder } = made;
    let folder = folder.display();
    let lack = match incomplete {
        0 => String::new(),
        count => format!("; {count} of them lack detail that was not read in time"),
    };
    if done == of {
        format!("Saved {of} pictures{lack}: {folder}")
    } else {
        format!("Stopped after {done} of {of} pictures{lack}: {folder}")
    }
}
