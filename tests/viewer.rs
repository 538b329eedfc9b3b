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
use collapsar::passes::draw::{Edges, Look};
use collapsar::viewer::actions::Action;
use collapsar::viewer::app::{App, Ask};
use collapsar::viewer::document::Document;
use collapsar::viewer::layout::Pane;
use collapsar::viewer::painter::Errand;
use collapsar::viewer::panels::picture::Tool;
use collapsar::viewer::search::Names;
use collapsar::viewer::settings::{Settings, Store, first_budget};
use common::gpu;
use common::metric::{Difference, SAME};
use egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec3;

/// The viewer in a folder of its own.
struct Desk {
    harness: Harness<'static, App>,
    folder: tempfile::TempDir,
}

/// Nothing takes longer, even on a machine that has other things to do.
const PATIENCE: Duration = Duration::from_secs(120);

impl Desk {
    fn new(gpu: &Arc<Gpu>) -> Self {
        Self::in_folder(gpu, tempfile::tempdir().unwrap())
    }

    /// With the settings that are in a folder.
    fn in_folder(gpu: &Arc<Gpu>, folder: tempfile::TempDir) -> Self {
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
        desk.open_engine();
        desk
    }

    /// Closes it and opens it again.
    fn again(mut self, gpu: &Arc<Gpu>) -> Self {
        self.harness.state_mut().close();
        let Self { harness, folder } = self;
        drop(harness);
        Self::in_folder(gpu, folder)
    }

    fn open_engine(&mut self) {
        let engine = engine();
        self.open(&engine);
        self.until("the first picture", |app| {
            document(app).frame.as_ref().is_some_and(|frame| frame.is_settled)
        });
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

    /// Saves the picture once it is settled, and reads it.
    #[track_caller]
    fn picture(&mut self) -> image::RgbaImage {
        let file = self.folder.path().join("seen.png");
        self.until("the picture is settled", |app| {
            document(app).frame.as_ref().is_some_and(|frame| frame.is_settled)
        });
        self.document().save_picture(file.clone());
        self.until("it is saved", |_| file.is_file());
        let picture = image::open(&file).unwrap().into_rgba8();
        std::fs::remove_file(&file).unwrap();
        picture
    }

    /// Goes on until there is another frame than now.
    #[track_caller]
    fn until_drawn(&mut self) {
        let frames = document(self.app()).history.total().frames;
        self.until("another frame", |app| document(app).history.total().frames > frames);
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
fn a_row_under_the_pointer_is_highlighted_in_the_picture_until_the_pointer_leaves() {
    let Some(gpu) = gpu("a_row_under_the_pointer_is_highlighted_in_the_picture") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let plain = desk.picture();
    let highlighted = |desk: &Desk| {
        let visibility = &document(desk.app()).visibility;
        let leaves = document(desk.app()).loaded.assembly.leaves();
        (0..leaves).filter(|&leaf| visibility.look_of_leaf(leaf).has(Look::HOVERED)).count()
    };
    let name = |desk: &Desk, item: u32| {
        let loaded = &document(desk.app()).loaded;
        loaded.scene.item(&loaded.assembly, item)
    };
    desk.document().tree.expand_all();
    desk.harness.step();
    // Rows in sight with a name of their own, and how many parts each has.
    let rows = document(desk.app()).tree.rows().to_vec();
    let is_alone =
        |row: &u32| rows.iter().filter(|other| name(&desk, **other) == name(&desk, *row)).count() == 1;
    let parts_of = |row: u32| document(desk.app()).loaded.assembly.leaves_of(row).len();
    let named = rows.iter().take(20).filter(|row| is_alone(row)).map(|&row| (row, parts_of(row)));
    let group = named.clone().max_by_key(|(_, parts)| *parts).unwrap();
    let part = named.clone().find(|(_, parts)| *parts == 1).unwrap();
    assert!(group.1 > 1, "{group:?}");
    for (item, parts) in [group, part] {
        let label = name(&desk, item);
        let row = desk.harness.get_by_role_and_label(egui::accesskit::Role::TreeItem, &label).rect();
        desk.harness.event(Event::PointerMoved(row.center()));
        desk.until_drawn();
        assert_eq!(highlighted(&desk), parts, "{label}");
        let lit = desk.picture();
        let changed = lit.pixels().zip(plain.pixels()).filter(|(a, b)| a != b).count();
        assert!(changed > 100, "{label}: {changed} pixels changed");
    }
    desk.harness.event(Event::PointerGone);
    desk.until_drawn();
    assert_eq!(highlighted(&desk), 0);
    assert!(desk.picture() == plain, "the highlight stayed");
    let middle = desk.middle();
    for at in [middle - Vec2::splat(3.0), middle] {
        desk.harness.event(Event::PointerMoved(at));
        desk.harness.step();
    }
    desk.until("the part in the picture is pointed at", |app| {
        document(app).visibility.hovered_leaf().is_some()
    });
    desk.act(Action::TogglePanels);
    desk.harness.event(Event::PointerGone);
    desk.until("nothing is", |app| document(app).visibility.hovered_leaf().is_none());
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
    desk.open(&engine());
    assert_eq!(desk.app().messages.texts().count(), 0, "what failed has been done");
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
    assert_eq!(desk.app().settings.recent, [model.as_path()]);
    assert_eq!(desk.app().title(), "peterbilt.obj - collapsar");
    std::fs::remove_file(&model).unwrap();
    desk.open(&model);
    assert!(desk.says("moved or deleted") && desk.app().settings.recent.is_empty());
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
    desk.document().save_picture(good);
    desk.until("what failed has been done", |app| !app.messages.texts().any(|text| text.contains("cannot")));
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
fn the_layout_is_remembered_and_a_damaged_one_is_the_first_one() {
    let Some(gpu) = gpu("the_layout_is_remembered_and_a_damaged_one_is_the_first_one") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let area = |desk: &Desk| desk.harness.get_by_label("Picture of the model").rect();
    let first = area(&desk);
    desk.drag(egui::pos2(first.left() - 0.5, first.center().y), Vec2::new(90.0, 0.0));
    desk.harness.step();
    let moved = area(&desk);
    assert!(moved.left() > first.left() + 50.0, "{first:?} {moved:?}");
    desk.harness.state_mut().layout.bring(Pane::Streaming);
    desk.act(Action::ToggleTheme);
    let theme = desk.app().settings.theme;
    let mut desk = desk.again(&gpu);
    assert_eq!(desk.app().settings.theme, theme);
    desk.open_engine();
    desk.harness.step();
    assert!((area(&desk).left() - moved.left()).abs() < 2.0, "{moved:?} {:?}", area(&desk));
    let kept = desk.app().layout.arrangement();
    desk.act(Action::ResetPanels);
    desk.harness.step();
    assert!((area(&desk).left() - first.left()).abs() < 2.0);
    assert_ne!(desk.app().layout.arrangement(), kept);
    // Panels that are away are away the next time.
    desk.act(Action::TogglePanels);
    let mut desk = desk.again(&gpu);
    desk.open_engine();
    assert!(area(&desk).width() > first.width() + 100.0);
    // A layout that makes no sense costs nothing else; settings that make none are left as they are.
    desk.harness.state_mut().close();
    let file = desk.folder.path().join("settings").join("settings.json");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("\"layout\": {") && text.contains("\"streaming\""), "{text}");
    std::fs::write(&file, text.replace("\"streaming\"", "\"picture\"")).unwrap();
    let Desk { harness, folder } = desk;
    drop(harness);
    let mut desk = Desk::in_folder(&gpu, folder);
    assert_eq!((desk.app().settings.theme, desk.app().messages.texts().count()), (theme, 0));
    desk.open_engine();
    assert!((area(&desk).left() - first.left()).abs() < 2.0);
    drop(desk.harness.state_mut().document.take());
    std::fs::write(&file, "{\"theme\": 7}").unwrap();
    let Desk { harness, folder } = desk;
    drop(harness);
    let mut desk = Desk::in_folder(&gpu, folder);
    assert!(desk.says("settings.json"));
    desk.open_engine();
    desk.harness.state_mut().close();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "{\"theme\": 7}");
}

/// The pictures of a folder, in the order of their names.
fn pictures_in(folder: &Path) -> Vec<image::RgbImage> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for (number, file) in files.iter().enumerate() {
        assert_eq!(file.file_name().unwrap().to_str().unwrap(), format!("engine-{number:03}.png"));
    }
    files.iter().map(|file| image::open(file).unwrap().into_rgb8()).collect()
}

#[test]
fn a_turntable_is_saved_as_pictures_while_the_window_goes_on() {
    let Some(gpu) = gpu("a_turntable_is_saved_as_pictures_while_the_window_goes_on") else { return };
    let mut desk = Desk::with_engine(&gpu);
    desk.press(Modifiers::NONE, Key::X);
    desk.until_drawn();
    let still = image::DynamicImage::from(desk.picture()).into_rgb8();
    let folder = desk.folder.path().join("turn");
    let settings = Settings { turntable_pictures: 5, ..desk.app().settings.clone() };
    desk.document().save_turntable(&settings, &folder);
    desk.until("the first picture", |app| document(app).turntable().is_some_and(|it| it.done > 0));
    // The user goes on meanwhile, and sees it; a pick is one in the window's picture.
    let middle = desk.middle();
    desk.drag(middle, Vec2::new(80.0, 10.0));
    desk.until_drawn();
    desk.click(middle);
    desk.until("the pick has come", |app| document(app).watched.is_some());
    desk.until("all pictures", |app| app.messages.texts().any(|text| text.contains("Saved 5 pictures")));
    assert!(document(desk.app()).turntable().is_none());
    let pictures = pictures_in(&folder);
    assert_eq!(pictures.len(), 5);
    let size = document(desk.app()).size;
    assert!(pictures.iter().all(|picture| picture.dimensions() == (size[0], size[1])));
    let first = Difference::between(&still, &pictures[0]);
    assert!(first.is_within(&SAME), "{first:?}");
    for i in 0..5 {
        let difference = Difference::between(&pictures[i], &pictures[(i + 1) % 5]);
        assert!(!difference.is_within(&SAME), "{i} and the next are the same");
    }
    desk.until("the window's picture is that of its camera", |app| {
        let frame = document(app).frame.as_ref().unwrap();
        frame.is_settled && frame.camera == *document(app).navigation.camera()
    });
    // Nowhere to write to.
    for (folder, words) in [("no/where", "cannot be made"), ("turn/engine-000.png", "cannot")] {
        let folder = desk.folder.path().join(folder);
        desk.document().save_turntable(&settings, &folder);
        desk.until("it is said", |app| app.messages.texts().any(|text| text.contains(words)));
        desk.until("it has ended", |app| document(app).turntable().is_none());
    }
}

#[test]
fn a_turntable_that_is_stopped_keeps_whole_pictures() {
    let Some(gpu) = gpu("a_turntable_that_is_stopped_keeps_whole_pictures") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let folder = engine().with_extension("turntable");
    desk.act(Action::SaveTurntablePictures);
    desk.harness.step();
    assert!(desk.harness.query_by_label("Folder").is_some());
    desk.harness.get_by_label("360").click();
    desk.harness.step();
    desk.press(Modifiers::NONE, Key::Enter);
    let has_begun = |app: &App| document(app).turntable().is_some_and(|it| it.done >= 2 && it.of == 360);
    desk.until("two pictures", has_begun);
    desk.document().save_turntable(&Settings::default(), Path::new("."));
    desk.until("one is enough", |app| app.messages.texts().any(|text| text.contains("stop them first")));
    desk.harness.get_by_label("Stop").click();
    desk.until("it is stopped", |app| app.messages.texts().any(|text| text.contains("of 360 pictures")));
    assert_eq!(desk.app().settings.turntable_pictures, 360);
    let count = pictures_in(&folder).len();
    assert!((2..100).contains(&count) && desk.says(&format!("Stopped after {count} of 360")), "{count}");
    // A painter that ends takes its turntable with it, and it is said.
    let again = desk.folder.path().join("again");
    let settings = desk.app().settings.clone();
    desk.document().save_turntable(&settings, &again);
    desk.until("it has begun", has_begun);
    desk.harness.state_mut().set_gpu(gpu);
    desk.until("it is said", |app| app.messages.texts().any(|text| text.contains("turntable was stopped")));
    assert!(document(desk.app()).turntable().is_none() && pictures_in(&again).len() >= 2);
}

/// Whether the box of all of the model is in the picture.
fn shows_all(app: &App) -> bool {
    let document = document(app);
    let camera = document.navigation.camera();
    let clip = camera.clip_from_relative(document.aspect() as f32);
    let bounds = document.scene().bounds();
    (0..8).all(|i| {
        let pick = |bit: u32| if i & bit != 0 { 1.0 } else { -1.0 };
        let corner = bounds.centre() + 0.5 * bounds.extent() * DVec3::new(pick(1), pick(2), pick(4));
        let at = clip * (corner - camera.eye).as_vec3().extend(1.0);
        at.w > 0.0 && at.x.abs() <= at.w && at.y.abs() <= at.w
    })
}

#[test]
fn all_of_a_model_is_in_view_until_somebody_moves_the_camera() {
    let Some(gpu) = gpu("all_of_a_model_is_in_view_until_somebody_moves_the_camera") else { return };
    let mut desk = Desk::with_engine(&gpu);
    for size in [[1000.0, 640.0], [620.0, 800.0], [1400.0, 500.0], [700.0, 900.0]] {
        desk.harness.set_size(size.into());
        desk.harness.step();
        assert!(shows_all(desk.app()), "at {size:?}");
    }
    let middle = desk.middle();
    desk.drag(middle, Vec2::new(60.0, 10.0));
    let camera = *document(desk.app()).navigation.target();
    desk.harness.set_size(Vec2::new(1000.0, 640.0));
    desk.harness.step();
    assert_eq!(*document(desk.app()).navigation.target(), camera, "a camera that was moved stays");
}

#[test]
fn the_first_budget_follows_the_card_and_a_chosen_one_is_kept() {
    let Some(gpu) = gpu("the_first_budget_follows_the_card_and_a_chosen_one_is_kept") else { return };
    let mut desk = Desk::new(&gpu);
    assert_eq!(desk.app().settings.budget_vertices, first_budget(gpu.adapter_info.device_type));
    desk.harness.state_mut().settings.budget_vertices = 123_456;
    assert_eq!(desk.again(&gpu).app().settings.budget_vertices, 123_456);
}

#[test]
fn escape_closes_what_is_on_top_and_a_right_click_opens_a_menu() {
    let Some(gpu) = gpu("escape_closes_what_is_on_top_and_a_right_click_opens_a_menu") else { return };
    let mut desk = Desk::with_engine(&gpu);
    desk.act(Action::SelectAll);
    let all = desk.selected();
    assert!(all > 0);
    desk.press(Modifiers::NONE, Key::F1);
    desk.harness.step();
    assert!(desk.harness.query_all_by_label("Keys and mouse").count() > 0);
    desk.press(Modifiers::NONE, Key::Escape);
    desk.harness.step();
    assert!(desk.harness.query_all_by_label("Keys and mouse").count() == 0 && desk.selected() == all);
    desk.act(Action::Measure);
    desk.press(Modifiers::NONE, Key::Escape);
    assert_eq!((desk.app().tool, desk.selected()), (Tool::Hand, all));
    desk.harness.get_by_label("Picture of the model").click_secondary();
    desk.harness.run_steps(2);
    desk.harness.get_by_label_contains("Hide selected").click();
    desk.harness.run_steps(2);
    assert_eq!(desk.hidden(), all, "the menu hides what is selected");
    desk.press(Modifiers::NONE, Key::Escape);
    assert_eq!(desk.selected(), 0);
}

#[test]
fn the_key_sheet_fits_a_small_window() {
    let Some(gpu) = gpu("the_key_sheet_fits_a_small_window") else { return };
    let mut desk = Desk::with_engine(&gpu);
    for width in [640.0, 1280.0] {
        desk.harness.set_size(Vec2::new(width, 480.0));
        desk.press(Modifiers::NONE, Key::F1);
        desk.harness.run_steps(3);
        for label in ["Open…", "Hide selected", "Fit all"] {
            let rows: Vec<_> = desk.harness.query_all_by_label(label).map(|node| node.rect()).collect();
            assert!(!rows.is_empty(), "{label}");
            assert!(rows.iter().all(|row| row.min.x >= 0.0 && row.max.x <= width), "{label}: {rows:?}");
        }
        desk.press(Modifiers::NONE, Key::Escape);
        desk.harness.run_steps(2);
    }
}

#[test]
fn tab_hides_and_shows_the_panels_and_takes_no_key_away() {
    let Some(gpu) = gpu("tab_hides_and_shows_the_panels_and_takes_no_key_away") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let has_panels = |desk: &Desk| desk.harness.query_by_label("Search the tree").is_some();
    assert!(has_panels(&desk));
    for shown in [false, true, false, true] {
        desk.press(Modifiers::NONE, Key::Tab);
        desk.harness.step();
        assert_eq!(has_panels(&desk), shown);
        assert_eq!(desk.harness.ctx.memory(|memory| memory.focused()), None);
    }
    desk.press(Modifiers::COMMAND, Key::Q);
    assert_eq!(desk.harness.state_mut().asks(), [Ask::Quit]);
}

#[test]
fn panels_that_are_only_looked_at_change_no_setting() {
    let Some(gpu) = gpu("panels_that_are_only_looked_at_change_no_setting") else { return };
    let mut desk = Desk::with_engine(&gpu);
    let app = desk.harness.state_mut();
    app.settings = Settings {
        alpha: 2.347,
        depth_cue: 0.613,
        error_px: 0.123_456,
        budget_vertices: 1_234_567,
        memory_bytes: Some(1_234_567_891),
        ..app.settings.clone()
    };
    let before = app.settings.clone();
    for pane in Pane::ALL {
        desk.harness.state_mut().layout.bring(pane);
        (0..3).for_each(|_| desk.harness.step());
        assert_eq!(desk.app().settings, before, "{pane:?} changes it");
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
