//! The panel, driven by pointer and keys, and read by its accessible names.

use std::sync::Arc;
use std::time::Instant;

use egui::accesskit::Toggled;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};

use super::*;
use crate::passes::draw::Look;
use crate::viewer::assembly::tests::Raw;
use crate::viewer::assembly::{Assembly, Placed};

struct App {
    raw: Raw,
    tree: Tree,
    visibility: Visibility,
    search: Search,
    panel: TreePanel,
    events: Vec<TreeEvent>,
}

impl App {
    fn new(raw: Raw) -> Self {
        let assembly = Arc::new(raw.assembly());
        Self {
            search: Search::new(&assembly, &raw),
            tree: Tree::new(assembly.clone()),
            visibility: Visibility::new(assembly),
            panel: TreePanel::default(),
            events: Vec::new(),
            raw,
        }
    }

    fn show(&mut self, ui: &mut Ui) {
        let Self { raw, tree, visibility, search, panel, events } = self;
        let did = panel.show(ui, &mut TreeModel { tree, visibility, search, names: raw });
        for event in did {
            events.push(event.clone());
            event.apply(visibility);
        }
    }

    fn selected(&self) -> Vec<u32> {
        self.visibility.instances_of(self.visibility.selected()).collect()
    }

    fn hidden(&self) -> Vec<u32> {
        self.visibility.instances_of(self.visibility.hidden()).collect()
    }
}

/// A car of a body (a roof and a door) and wheels, of which there are two, each with cells; and a bell apart.
fn car() -> Raw {
    let names = ["car", "body", "roof", "door", "wheels", "bell"].map(str::to_owned);
    let placed = [(2, 0, 1), (3, 1, 1), (4, 2, 3), (4, 3, 2), (5, 4, 1)];
    let mut next = 0;
    let placed = placed.map(|(node, part, cells)| {
        next += cells;
        Placed { instances: next - cells..next, node, part, counts: 1, triangles: 1000 }
    });
    Raw {
        parents: vec![u32::MAX, 0, 1, 1, 0, 0],
        placed: placed.to_vec(),
        node_names: names.to_vec(),
        part_names: ["sheet", "panel", "rim left", "rim right", "bronze"].map(str::to_owned).to_vec(),
    }
}

fn harness() -> Harness<'static, App> {
    let mut harness = Harness::builder()
        .with_size([320.0, 400.0])
        .build_ui_state(|ui, app: &mut App| app.show(ui), App::new(car()));
    harness.run();
    harness
}

fn has(harness: &Harness<'_, App>, label: &str) -> bool {
    harness.query_by_label(label).is_some()
}

fn click(harness: &mut Harness<'_, App>, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

fn click_with(harness: &mut Harness<'_, App>, label: &str, modifiers: Modifiers) {
    harness.get_by_label(label).click_modifiers(modifiers);
    harness.run();
}

fn press(harness: &mut Harness<'_, App>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run();
}

/// Opens the menu of a row and clicks an entry.
fn choose(harness: &mut Harness<'_, App>, row: &str, entry: &str) {
    harness.get_by_label(row).click_secondary();
    harness.run();
    click(harness, entry);
}

#[test]
fn arrows_expand_and_collapse() {
    let mut harness = harness();
    assert!(has(&harness, "body") && has(&harness, "wheels") && has(&harness, "bell"));
    assert!(!has(&harness, "roof") && !has(&harness, "expand bell"));
    click(&mut harness, "expand body");
    assert!(has(&harness, "roof") && has(&harness, "door"));
    click(&mut harness, "collapse body");
    assert!(!has(&harness, "roof"));
    assert!(harness.state().events.is_empty(), "arrows are nobody else's business");
}

#[test]
fn search_leaves_what_matches_and_the_way_to_it() {
    let mut harness = harness();
    harness.get_by_label("Search the tree").focus();
    harness.run();
    harness.get_by_label("Search the tree").type_text("RIM lef");
    harness.run();
    assert!(has(&harness, "rim left") && has(&harness, "wheels") && has(&harness, "car"));
    assert!(!has(&harness, "body") && !has(&harness, "rim right"));
    assert!(has(&harness, "1 found"));
    press(&mut harness, Modifiers::NONE, Key::Enter);
    assert_eq!(harness.state().selected(), [2, 3, 4], "all cells of the placement");
    click(&mut harness, "Clear the search");
    assert!(has(&harness, "body") && !has(&harness, "1 found") && !has(&harness, "Clear the search"));
    assert!(has(&harness, "rim left"), "what was chosen stays in sight");
}

#[test]
fn eyes_hide_and_show_a_branch() {
    let mut harness = harness();
    let toggled =
        |harness: &Harness<'_, App>, label: &str| harness.get_by_label(label).accesskit_node().toggled();
    click(&mut harness, "expand wheels");
    assert_eq!(toggled(&harness, "show wheels"), Some(Toggled::True));
    click(&mut harness, "show rim right");
    assert_eq!(harness.state().hidden(), [5, 6]);
    assert_eq!(toggled(&harness, "show rim right"), Some(Toggled::False));
    assert_eq!(toggled(&harness, "show wheels"), Some(Toggled::Mixed));
    assert_eq!(toggled(&harness, "show bell"), Some(Toggled::True));
    click(&mut harness, "show wheels");
    assert_eq!(harness.state().hidden(), [0u32; 0], "what is hidden in part is shown");
    click(&mut harness, "show wheels");
    assert_eq!(harness.state().hidden(), [2, 3, 4, 5, 6]);
    assert_eq!(toggled(&harness, "show rim left"), Some(Toggled::False));
    assert!(harness.state().selected().is_empty(), "an eye selects nothing");
}

#[test]
fn clicks_select_add_take_away_and_span() {
    let mut harness = harness();
    click(&mut harness, "expand body");
    click(&mut harness, "roof");
    assert_eq!(harness.state().selected(), [0]);
    click_with(&mut harness, "bell", Modifiers::COMMAND);
    assert_eq!(harness.state().selected(), [0, 7]);
    click_with(&mut harness, "roof", Modifiers::COMMAND);
    assert_eq!(harness.state().selected(), [7]);
    click(&mut harness, "door");
    click_with(&mut harness, "bell", Modifiers::SHIFT);
    assert_eq!(harness.state().selected(), [1, 2, 3, 4, 5, 6, 7]);
    click_with(&mut harness, "roof", Modifiers::SHIFT);
    assert_eq!(harness.state().selected(), [0, 1], "the anchor stays");
    click(&mut harness, "wheels");
    assert_eq!(harness.state().selected(), [2, 3, 4, 5, 6]);
    assert_eq!(harness.get_by_label("wheels").accesskit_node().toggled(), Some(Toggled::True));
    assert_eq!(harness.get_by_label("bell").accesskit_node().toggled(), Some(Toggled::False));
}

/// Rows that are painted as if the pointer were over them.
fn marked_rows(harness: &Harness<'_, App>) -> Vec<egui::Rect> {
    let marked = harness.ctx.global_style().visuals.widgets.hovered.weak_bg_fill;
    let rows = harness.output().shapes.iter().filter_map(|clipped| match &clipped.shape {
        egui::Shape::Rect(rect) if rect.fill == marked && rect.rect.height() == ROW_HEIGHT => Some(rect.rect),
        _ => None,
    });
    rows.collect()
}

#[test]
fn the_row_under_the_pointer_is_told_and_that_of_what_is_under_it_elsewhere_is_marked() {
    let mut harness = harness();
    click(&mut harness, "expand body");
    let place = |harness: &Harness<'_, App>, label: &str| harness.get_by_label(label).rect();
    for label in ["roof", "wheels", "show roof", "expand wheels"] {
        let at = place(&harness, label).center();
        harness.event(egui::Event::PointerMoved(at));
        harness.run();
        let app = harness.state_mut();
        let name = app.panel.take_pointed().map(|item| app.raw.item(app.tree.assembly(), item));
        assert!(name.as_ref().is_some_and(|name| label.ends_with(name)), "{label}: {name:?}");
        assert_eq!(harness.state_mut().panel.take_pointed(), None, "it is told once a frame");
        assert_eq!(marked_rows(&harness).len(), 1, "{label}");
    }
    harness.event(egui::Event::PointerGone);
    harness.run();
    assert_eq!(harness.state_mut().panel.take_pointed(), None);
    assert!(marked_rows(&harness).is_empty());
    for (instance, rows) in [(Some(1), vec![place(&harness, "door")]), (Some(3), vec![]), (None, vec![])] {
        harness.state_mut().visibility.hover(instance);
        harness.run();
        assert_eq!(marked_rows(&harness), rows, "{instance:?}");
    }
}

#[test]
fn a_double_click_fits() {
    // Two clicks that follow each other faster than the frames of other tests.
    let mut harness = Harness::builder()
        .with_step_dt(0.05)
        .build_ui_state(|ui, app: &mut App| app.show(ui), App::new(car()));
    harness.run();
    harness.get_by_label("bell").click();
    harness.get_by_label("bell").click();
    harness.run();
    let bell = harness.state().visibility.set_of_instance(Some(7));
    assert_eq!(harness.state().selected(), [7]);
    assert!(harness.state().events.contains(&TreeEvent::Fit(bell)));
}

#[test]
fn the_menu_acts_on_the_row_or_on_the_selection_that_it_belongs_to() {
    let mut harness = harness();
    choose(&mut harness, "bell", "Hide");
    assert_eq!(harness.state().hidden(), [7]);
    assert_eq!(harness.state().selected(), [7], "a right click selects");
    choose(&mut harness, "body", "Isolate");
    assert_eq!(harness.state().hidden(), [2, 3, 4, 5, 6, 7]);
    choose(&mut harness, "car", "Show all");
    assert!(harness.state().hidden().is_empty());
    click(&mut harness, "bell");
    click_with(&mut harness, "body", Modifiers::COMMAND);
    choose(&mut harness, "body", "Ghost");
    assert_eq!(harness.state().visibility.ghosts(), harness.state().visibility.selected());
    assert_eq!(harness.state().selected(), [0, 1, 7]);
    choose(&mut harness, "car", "Expand all below");
    assert!(has(&harness, "roof") && has(&harness, "rim right"));
    choose(&mut harness, "car", "Collapse all");
    assert!(!has(&harness, "body"));
    choose(&mut harness, "car", "Copy name");
    assert!(!has(&harness, "Copy name"), "the menu closes");
}

#[test]
fn keys_move_expand_and_fit() {
    let mut harness = harness();
    let selected = |harness: &Harness<'_, App>| harness.state().selected();
    click(&mut harness, "body");
    press(&mut harness, Modifiers::NONE, Key::ArrowRight);
    assert!(has(&harness, "roof"));
    press(&mut harness, Modifiers::NONE, Key::ArrowRight);
    assert_eq!(selected(&harness), [0], "to the first child");
    press(&mut harness, Modifiers::NONE, Key::ArrowDown);
    assert_eq!(selected(&harness), [1]);
    press(&mut harness, Modifiers::SHIFT, Key::ArrowDown);
    assert_eq!(selected(&harness), [1, 2, 3, 4, 5, 6]);
    press(&mut harness, Modifiers::NONE, Key::ArrowUp);
    press(&mut harness, Modifiers::NONE, Key::ArrowLeft);
    assert_eq!(selected(&harness), [0, 1], "to the parent");
    press(&mut harness, Modifiers::NONE, Key::ArrowLeft);
    assert!(!has(&harness, "roof"));
    press(&mut harness, Modifiers::NONE, Key::End);
    assert_eq!(selected(&harness), [7]);
    press(&mut harness, Modifiers::NONE, Key::Space);
    assert_eq!(harness.state().hidden(), [7]);
    press(&mut harness, Modifiers::NONE, Key::Home);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let all = harness.state().visibility.set_of_item(0);
    assert_eq!(harness.state().events.last(), Some(&TreeEvent::Fit(all)));
}

/// One root with many branches of nine leaves each.
fn large(nodes: u32) -> Raw {
    let parents: Vec<u32> = (0..nodes)
        .map(|n| {
            if n == 0 {
                u32::MAX
            } else if n % 10 == 1 {
                0
            } else {
                (n - 1) / 10 * 10 + 1
            }
        })
        .collect();
    let leaf = |node: u32| node % 10 != 1 && node != 0;
    let mut next = 0;
    let placed = (0..nodes).filter(|&node| leaf(node)).map(|node| {
        next += 1;
        Placed { instances: next - 1..next, node, part: node % 1000, counts: 1, triangles: u64::from(node) }
    });
    Raw {
        placed: placed.collect(),
        parents,
        node_names: (0..nodes)
            .map(|node| format!("{} No {node}", ["Bolt M8", "Nut", "Bracket"][node as usize % 3]))
            .collect(),
        part_names: (0..1000).map(|part| format!("Part-{part:04}")).collect(),
    }
}

#[test]
fn an_instance_far_away_comes_into_sight() {
    let mut harness = Harness::builder()
        .with_size([320.0, 400.0])
        .with_max_steps(20)
        .build_ui_state(|ui, app: &mut App| app.show(ui), App::new(large(20_000)));
    harness.run();
    assert!(!has(&harness, "Bolt M8 No 15000"));
    let app = harness.state_mut();
    let item = app.tree.assembly().item_of_node(15_000);
    let leaf = app.tree.assembly().leaf_of_item(item).unwrap();
    let instance = app.tree.assembly().instances_of_leaf(leaf).start;
    app.panel.reveal(&mut app.tree, instance);
    harness.run();
    let row = harness.get_by_label("Bolt M8 No 15000").rect();
    assert!(row.min.y > 100.0 && row.max.y < 300.0, "near the middle: {row:?}");
    click(&mut harness, "Bolt M8 No 15000");
    assert_eq!(harness.state().selected(), [instance], "what is clicked is what is seen");
    press(&mut harness, Modifiers::NONE, Key::End);
    assert!(has(&harness, "Bracket No 19991"), "the last row, which is not expanded, comes into sight");
}

/// Milliseconds of the fastest of five.
fn time(mut run: impl FnMut()) -> f64 {
    let once = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..5).map(|_| once(&mut run)).fold(f64::INFINITY, f64::min)
}

/// Prints what a number of milliseconds was measured for, and checks it where the compiler has done its best.
fn check(what: &str, ms: f64, limit: f64) {
    println!("{what:40} {ms:9.3} ms (limit {limit} ms)");
    assert!(cfg!(debug_assertions) || ms < limit, "{what} took {ms} ms, and may take {limit} ms");
}

#[test]
fn a_million_nodes_are_no_burden() {
    let raw = large(1_000_000);
    check("build the assembly", time(|| drop(raw.assembly())), 1000.0);
    let mut app = App::new(raw);
    check("lower the names", time(|| drop(Search::new(app.tree.assembly(), &app.raw))), 1000.0);
    measure_rows(&mut app.tree);
    measure_search(&mut app);
    measure_visibility(app.tree.assembly().clone());
    measure_panel(app);
}

fn measure_rows(tree: &mut Tree) {
    let all = tree.assembly().instances();
    check("expand all", time(|| tree.expand_all()), 50.0);
    let branch = tree.assembly().item_of_node(1);
    check(
        "collapse one of a million rows",
        time(|| {
            tree.expand(branch);
            tree.collapse(branch)
        }) / 2.0,
        5.0,
    );
    check(
        "collapse and expand the root",
        time(|| {
            tree.collapse(0);
            tree.expand(0)
        }),
        50.0,
    );
    let mut next = 0;
    tree.collapse_all();
    check(
        "reveal from nothing expanded",
        time(|| {
            next = (next + 77_777) % all;
            tree.collapse_all();
            _ = tree.reveal(next)
        }),
        5.0,
    );
    check(
        "reveal the next",
        time(|| {
            next = (next + 77_777) % all;
            _ = tree.reveal(next)
        }),
        5.0,
    );
}

fn measure_search(app: &mut App) {
    for query in ["bolt no 99", "nut", "o", "part-0777", "bracket 5 7", "zzz"] {
        let mut found = None;
        let ms = time(|| found = app.search.find(app.tree.assembly(), query));
        let count = found.as_ref().map_or(0, |found| found.count);
        check(&format!("search for {query:?}, {count} found"), ms, 50.0);
        check("  and filter the tree", time(|| app.tree.set_filter(found.as_ref())), 50.0);
    }
    app.tree.set_filter(None);
}

fn measure_visibility(assembly: Arc<Assembly>) {
    let mut visibility = Visibility::new(assembly.clone());
    let scattered = Bits::of(assembly.leaves(), (0..assembly.leaves()).step_by(7).map(|leaf| leaf..leaf + 1));
    let everything = visibility.set_of_item(0);
    check(
        "hide a seventh and show it",
        time(|| {
            visibility.hide(&scattered);
            visibility.show(&scattered)
        }) / 2.0,
        10.0,
    );
    let mut looks = Vec::new();
    check(
        "point at everything and at nothing, and the looks for it",
        time(|| {
            for item in [Some(0), None] {
                visibility.hover_item(item);
                visibility.looks(&[], &mut looks);
            }
        }) / 2.0,
        10.0,
    );
    check(
        "isolate and undo",
        time(|| {
            visibility.isolate(&scattered);
            _ = visibility.undo()
        }) / 2.0,
        10.0,
    );
    check(
        "select everything and nothing",
        time(|| {
            visibility.select(everything.clone());
            visibility.select(Bits::new(assembly.leaves()));
        }) / 2.0,
        10.0,
    );
    visibility.hide(&scattered);
    let rows = 0..assembly.items().min(1000);
    let shares = || rows.clone().map(|item| visibility.shown_share(item) as usize).sum::<usize>();
    check("how much is shown of 1,000 rows", time(|| assert!(std::hint::black_box(shares()) > 0)), 1.0);
    let colours = vec![Look::coloured([1, 2, 3, 255]); assembly.instances() as usize];
    let mut looks = Vec::new();
    check(
        &format!("looks of {} instances", colours.len()),
        time(|| visibility.looks(&colours, &mut looks)),
        10.0,
    );
}

fn measure_panel(mut app: App) {
    app.tree.expand_all();
    let context = egui::Context::default();
    let size = egui::Rect::from_min_size(egui::Pos2::ZERO, Vec2::new(400.0, 1000.0));
    let mut frame = 0;
    let ms = time(|| {
        frame += 1;
        app.panel.scroll_to = Some(app.tree.rows()[frame * 7_919 % app.tree.rows().len()]);
        let input = egui::RawInput { screen_rect: Some(size), ..Default::default() };
        context.run_ui(input, |ui| app.show(ui)).textures_delta.clear();
    });
    check("a frame of the panel, scrolled anywhere", ms, 10.0);
}
