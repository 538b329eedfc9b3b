//! The viewer without its window: the real app on the real renderer, driven by keys, clicks and drags.

#![cfg(feature = "viewer")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot set up its scene should fail loudly"
)]

mod common;

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use collapsar::bake::{BakeOptions, BakeProgress, bake};
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::passes::draw::Edges;
use collapsar::viewer::actions::Action;
use collapsar::viewer::app::{App, Ask};
use collapsar::viewer::document::Document;
use collapsar::viewer::painter::Errand;
use collapsar::viewer::panels::picture::Tool;
use collapsar::viewer::settings::Store;
use common::gpu;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

/// The viewer in a folder of its own.
struct Desk {
    harness: Harness<'static, App>,
    folder: tempfile::TempDir,
}

/// Nothing takes longer, even on a machine that has other things to do.
const PATIENCE: Duration = Duration::from_secs(120);

impl Desk {
    fn new(gpu: &Arc<Gpu>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut app = App::new(Store::in_folder(&folder.path().join("settings")), Arc::new(|| ()));
        app.set_gpu(Arc::clone(gpu));
        let harness =
            Harness::builder().with_size(Vec2::new(1000.0, 640.0)).with_max_steps(2).build_ui_state(
                |ui, app: &mut App| {
                    app.poll();
                    app.show(ui, None);
                },
                app,
            );
        Self { harness, folder }
    }

    /// With the bundled engine opened and drawn.
    fn with_engine(gpu: &Arc<Gpu>) -> Self {
        let mut desk = Self::new(gpu);
        let engine = engine();
        desk.open(&engine);
        desk.until("the first picture", |app| {
            document(app).frame.as_ref().is_some_and(|frame| frame.is_settled)
        });
        desk
    }

    fn open(&mut self, file: &Path) {
        self.harness.state_mut().open(file);
        self.until("it is opened", |app| !app.is_loading());
    }

    fn app(&self) -> &App {
        self.harness.state()
    }

    fn document(&mut self) -> &mut Document {
        self.harness.state_mut().document.as_mut().unwrap()
    }

    /// Goes on until something holds.
    #[track_caller]
    fn until(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let started = Instant::now();
        loop {
            self.harness.step();
            if holds(self.app()) {
                return;
            }
            let said: Vec<&str> = self.app().messages.texts().collect();
            assert!(started.elapsed() < PATIENCE, "waited in vain until {what}; said: {said:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn act(&mut self, action: Action) {
        self.harness.state_mut().act(action);
        self.harness.step();
    }

    fn press(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.harness.step();
    }

    /// The middle of the picture.
    fn middle(&self) -> Pos2 {
        self.harness.get_by_label("Picture of the model").rect().center()
    }

    fn pointer(&self, at: Pos2, button: PointerButton, pressed: bool) {
        self.harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
    }

    fn click(&mut self, at: Pos2) {
        self.harness.event(Event::PointerMoved(at));
        self.harness.step();
        for pressed in [true, false] {
            self.pointer(at, PointerButton::Primary, pressed);
            self.harness.step();
        }
    }

    fn drag(&mut self, from: Pos2, by: Vec2) {
        self.harness.event(Event::PointerMoved(from));
        self.harness.step();
        self.pointer(from, PointerButton::Primary, true);
        self.harness.step();
        for step in 1..=5 {
            self.harness.event(Event::PointerMoved(from + by * (step as f32 / 5.0)));
            self.harness.step();
        }
        self.pointer(from + by, PointerButton::Primary, false);
        self.harness.step();
    }

    fn says(&self, words: &str) -> bool {
        self.app().messages.texts().any(|text| text.contains(words))
    }

    fn selected(&self) -> usize {
        document(self.app()).visibility.selected().iter().count()
    }

    fn hidden(&self) -> usize {
        document(self.app()).visibility.hidden().iter().count()
    }
}

fn document(app: &App) -> &Document {
    app.document.as_ref().expect("a document")
}

/// The engine, baked once.
fn engine() -> PathBuf {
    static BAKED: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, file) = BAKED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("engine.clps");
        let source = common::bundled("2CylinderEngine.glb");
        bake(&[source], &file, &BakeOptions::default(), &BakeProgress::default()).unwrap();
        (folder, file)
    });
    file.clone()
}

#[test]
fn a_click_selects_and_keys_hide_isolate_and_undo() {
    let Some(gpu) = gpu("a_click_selects_and_keys_hide_isolate_and_undo") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let middle = desk.middle();
    desk.click(middle);
    desk.until("the pick has come", |app| document(app).watched.is_some());
    assert_eq!(desk.selected(), 1);
    desk.until("it is in the properties", |app| {
        document(app).frame.as_ref().is_some_and(|frame| frame.reading.is_some())
    });
    desk.harness.step();
    assert!(desk.harness.query_by_label("Tier").is_some());
    let all = document(desk.app()).loaded.assembly.leaves() as usize;
    desk.press(Modifiers::NONE, Key::H);
    assert_eq!(desk.hidden(), 1);
    desk.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.hidden(), 0);
    desk.press(Modifiers::NONE, Key::I);
    assert_eq!(desk.hidden(), all - 1);
    desk.press(Modifiers::COMMAND, Key::Z);
    desk.press(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(desk.hidden(), all - 1);
    desk.press(Modifiers::SHIFT, Key::H);
    assert_eq!(desk.hidden(), 0);
    desk.press(Modifiers::NONE, Key::Escape);
    assert_eq!(desk.selected(), 0);
}

#[test]
fn what_is_hidden_is_not_picked_and_nothing_is_sent_for_it() {
    let Some(gpu) = gpu("what_is_hidden_is_not_picked_and_nothing_is_sent_for_it") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let middle = desk.middle();
    desk.click(middle);
    desk.until("the pick has come", |app| document(app).watched.is_some());
    let first = document(desk.app()).watched;
    let sent = |app: &App| {
        document(app).history.records().map(|r| r.streamed_vertices + r.streamed_triangles).sum::<u64>()
    };
    let before = sent(desk.app());
    let frames = document(desk.app()).history.total().frames;
    desk.press(Modifiers::NONE, Key::H);
    desk.until("a frame without it", |app| document(app).history.total().frames > frames);
    desk.click(middle);
    desk.until("another pick", |app| document(app).watched != first);
    assert_eq!(sent(desk.app()), before);
}

#[test]
fn dragging_orbits_and_a_section_cuts() {
    let Some(gpu) = gpu("dragging_orbits_and_a_section_cuts") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let middle = desk.middle();
    let camera = *document(desk.app()).navigation.camera();
    desk.drag(middle, Vec2::new(120.0, 30.0));
    let turned = *document(desk.app()).navigation.camera();
    assert!(turned.world_from_view.angle_between(camera.world_from_view) > 0.2);
    desk.press(Modifiers::NONE, Key::X);
    assert!(document(desk.app()).cuts.any());
    desk.press(Modifiers::NONE, Key::X);
    assert!(!document(desk.app()).cuts.any());
    desk.press(Modifiers::NONE, Key::P);
    desk.until("parallel", |app| document(app).navigation.camera().parallel.is_some());
    desk.press(Modifiers::NONE, Key::Num5);
    desk.until("it is seen from above", |app| {
        !document(app).navigation.is_moving() && document(app).navigation.camera().forward().y < -0.999
    });
    desk.press(Modifiers::NONE, Key::Num8);
    assert_eq!(document(desk.app()).look.edges, Edges::Features);
}

#[test]
fn search_finds_and_the_palette_does() {
    let Some(gpu) = gpu("search_finds_and_the_palette_does") else { return };
    let mut desk = Desk::with_engine(&gpu);
    desk.press(Modifiers::COMMAND, Key::F);
    desk.harness.step();
    desk.harness.event(Event::Text("rod".to_owned()));
    desk.harness.step();
    desk.harness.step();
    assert!(desk.harness.query_all_by_label_contains("rod_123").next().is_some());
    assert!(desk.harness.query_all_by_label_contains("body_1").next().is_none());
    desk.press(Modifiers::NONE, Key::Escape);
    desk.act(Action::Palette);
    desk.harness.step();
    desk.harness.event(Event::Text("wireframe".to_owned()));
    desk.harness.step();
    desk.press(Modifiers::NONE, Key::Enter);
    desk.harness.step();
    assert_eq!(document(desk.app()).look.edges, Edges::All);
}

#[test]
fn two_clicks_measure_a_distance_with_its_error() {
    let Some(gpu) = gpu("two_clicks_measure_a_distance_with_its_error") else { return };
    let mut desk = Desk::with_engine(&gpu);
    desk.press(Modifiers::NONE, Key::M);
    assert_eq!(desk.app().tool, Tool::Measure);
    let middle = desk.middle();
    let step = |app: &App| app.layout.measuring.step();
    let first = step(desk.app());
    desk.click(middle);
    desk.until("the first point", |app| step(app) != first);
    desk.click(middle + Vec2::new(25.0, 10.0));
    desk.until("the distance", |app| !app.layout.measuring.list().is_empty());
    let found = &desk.app().layout.measuring.list()[0];
    let lines = found.lines(&desk.app().settings.units);
    assert!(lines[0].1.contains('±') && found.error > 0.0, "{lines:?}");
}

#[test]
fn bad_files_are_said_and_the_model_stays() {
    let Some(gpu) = gpu("bad_files_are_said_and_the_model_stays") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let folder = desk.folder.path().to_owned();
    let at = |name: &str| folder.join(name);
    std::fs::write(at("notes.txt"), "no model").unwrap();
    std::fs::write(at("broken.clps"), "no container").unwrap();
    let mut damaged = std::fs::read(engine()).unwrap();
    damaged[100] ^= 0xff;
    std::fs::write(at("damaged.clps"), damaged).unwrap();
    for name in ["missing.clps", "notes.txt", "broken.clps", "damaged.clps", "."] {
        desk.open(&at(name));
        let shown = if name == "." { folder.file_name().unwrap().to_str().unwrap() } else { name };
        assert!(desk.says(shown), "{name}: {:?}", desk.app().messages.texts().collect::<Vec<_>>());
        assert!(desk.app().document.is_some());
    }
    let mut cut = std::fs::read(engine()).unwrap();
    cut.truncate(cut.len() - 100_000);
    std::fs::write(at("cut.clps"), cut).unwrap();
    desk.open(&at("cut.clps"));
    assert!(desk.says("cut.clps"));
}

#[test]
fn a_model_is_baked_beside_itself_and_a_folder_that_cannot_be_written_is_said() {
    let Some(gpu) = gpu("a_model_is_baked_beside_itself_and_a_folder_that_cannot_be_written_is_said") else {
        return;
    };
    let mut desk = Desk::new(&gpu);
    let folder = desk.folder.path().join("models");
    std::fs::create_dir(&folder).unwrap();
    let model = folder.join("peterbilt.obj");
    std::fs::copy(common::bundled("peterbilt.obj"), &model).unwrap();
    // A folder in the place of the container cannot be written as a file, whoever asks.
    std::fs::create_dir(folder.join("peterbilt.obj.clps")).unwrap();
    desk.open(&model);
    assert!(desk.says("peterbilt.obj.clps") && desk.app().document.is_none());
    std::fs::remove_dir(folder.join("peterbilt.obj.clps")).unwrap();
    desk.open(&model);
    assert!(folder.join("peterbilt.obj.clps").is_file());
    assert_eq!(desk.app().settings.recent, [model]);
}

#[test]
fn the_picture_is_saved_or_it_is_said_why_not() {
    let Some(gpu) = gpu("the_picture_is_saved_or_it_is_said_why_not") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let good = desk.folder.path().join("picture.png");
    desk.document().save_picture(good.clone());
    desk.until("it is saved", |_| good.is_file());
    let size = document(desk.app()).size;
    assert_eq!(image::image_dimensions(&good).unwrap(), (size[0], size[1]));
    let bad = desk.folder.path().join("no folder").join("picture.png");
    desk.document().save_picture(bad);
    desk.until("it is said", |app| {
        app.messages.texts().any(|text| text.contains("picture.png") && text.contains("cannot"))
    });
    desk.act(Action::Quit);
    assert_eq!(desk.harness.state_mut().asks(), [Ask::Quit]);
}

#[test]
fn memory_that_runs_out_halves_the_budget_and_a_lost_device_is_asked_for_anew() {
    let Some(_) = gpu("memory_that_runs_out_halves_the_budget_and_a_lost_device_is_asked_for_anew") else {
        return;
    };
    // A device of its own, for it is lost in the end.
    let own = Arc::new(Gpu::new(&GpuOptions::default()).unwrap());
    let mut desk = Desk::with_engine(&own);
    let middle = desk.middle();
    desk.click(middle);
    desk.until("the pick has come", |app| document(app).watched.is_some());
    desk.press(Modifiers::NONE, Key::H);
    let budget = desk.app().settings.budget_vertices;
    desk.document().errand(Errand::Exhaust);
    desk.until("it is said", |app| app.messages.texts().any(|text| text.contains("out of memory")));
    assert_eq!(document(desk.app()).frame.as_ref().unwrap().halved_budget, Some(budget / 2));
    desk.drag(middle, Vec2::new(60.0, 0.0));
    let camera = *document(desk.app()).navigation.camera();
    for round in 0..20 {
        let gpu = Arc::new(Gpu::new(&GpuOptions::default()).unwrap());
        if round == 0 {
            own.lose("for a test");
            desk.document().navigation.begin(None);
            desk.act(Action::ToggleDepthCue);
            desk.until("a device is asked for", |app| {
                app.messages.texts().any(|text| text.contains("was lost"))
            });
            assert_eq!(desk.harness.state_mut().asks(), [Ask::NewDevice]);
        }
        desk.harness.state_mut().set_gpu(gpu);
        desk.until("another picture", |app| document(app).frame.is_some());
        assert_eq!(*document(desk.app()).navigation.camera(), camera);
        assert_eq!(desk.hidden(), 1);
    }
}

#[test]
fn any_size_can_be_shown() {
    let Some(gpu) = gpu("any_size_can_be_shown") else { return };
    let mut desk = Desk::with_engine(&gpu);
    for round in 0..60u32 {
        let (width, height) = (1 + round * 7919 % 1200, 1 + round * 104_729 % 900);
        desk.harness.set_size(Vec2::new(width as f32, height as f32));
        desk.harness.step();
    }
    desk.harness.set_size(Vec2::new(900.0, 600.0));
    desk.harness.step();
    let size = document(desk.app()).size;
    desk.until("a picture of that size", |app| {
        document(app)
            .frame
            .as_ref()
            .is_some_and(|frame| [frame.target.width(), frame.target.height()] == size)
    });
}
