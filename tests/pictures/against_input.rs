//! The renderer at three budgets against the input drawn directly, and proof that the comparison sees defects.

use std::fmt::Write as _;
use std::sync::{Arc, OnceLock};

use collapsar::gpu::Gpu;
use collapsar::import::Model;
use collapsar::scene::Camera;
use image::RgbImage;

use crate::common::metric::{Difference, SAME, pixels_beyond};
use crate::subjects::{BUNDLED, REAL, Shot, Subject};
use crate::{direct, gpu, output, save};

const SHOT: Shot = Shot { width: 640, height: 360 };

/// All vertices, a third of them, a tenth.
const DIVISORS: [u32; 3] = [1, 3, 10];

/// What was measured of one view of one subject.
struct View {
    subject: &'static Subject,
    view: usize,
    /// By budget, as [`DIVISORS`]: vertices and triangles drawn, and the difference to the input.
    budgets: [(u64, u64, Difference); 3],
}

/// Measures once for all tests.
fn measured(gpu: &Arc<Gpu>) -> &'static [View] {
    static MEASURED: OnceLock<Vec<View>> = OnceLock::new();
    MEASURED.get_or_init(|| {
        // Real models are large: one view of each is enough.
        let bundled = BUNDLED.iter().flat_map(|s| s.cameras().into_iter().enumerate().map(move |v| (s, v)));
        let real = REAL.iter().map(|subject| (subject, (0, subject.still())));
        let views = bundled.chain(real).map(|(subject, (view, camera))| measure(gpu, subject, view, &camera));
        let views: Vec<View> = views.collect();
        let report = table(&views);
        eprintln!("{report}");
        std::fs::write(output().join("report.txt"), report).unwrap();
        views
    })
}

fn measure(gpu: &Arc<Gpu>, subject: &'static Subject, view: usize, camera: &Camera) -> View {
    let input = direct::picture(gpu, &subject.model, camera, SHOT);
    save(&input, &format!("{}_{view}_input.png", subject.name));
    let budgets = DIVISORS.map(|divisor| {
        let (drawn, record) = subject.picture(gpu, camera, subject.placed_vertices() / divisor, SHOT);
        save(&drawn, &format!("{}_{view}_{divisor}.png", subject.name));
        (record.active_vertices, record.active_triangles, Difference::between(&input, &drawn))
    });
    View { subject, view, budgets }
}

fn table(views: &[View]) -> String {
    let mut text = String::from(
        "The picture at a budget against that of the input drawn directly, 640x360.\n\
         score: perceptual similarity, 1 for the same; mean and worst tile: difference in steps of 1/255\n\n\
         model        view  budget  vertices  triangles   score    mean  worst tile\n",
    );
    for View { subject, view, budgets } in views {
        for (divisor, (vertices, triangles, Difference { score, mean, worst_tile })) in
            DIVISORS.iter().zip(budgets)
        {
            let name = subject.name;
            writeln!(
                text,
                "{name:<12} {view:>4}  {:>6}  {vertices:>8}  {triangles:>9}  {score:.4}  {mean:>6.3}  {worst_tile:>10.2}",
                format!("1/{divisor}")
            )
            .unwrap();
        }
    }
    text
}

#[test]
fn at_full_budget_the_picture_is_that_of_the_input() {
    let Some(gpu) = gpu("pictures: full budget") else { return };
    for View { subject, view, budgets } in measured(&gpu) {
        let (_, _, difference) = budgets[0];
        assert!(
            difference.is_within(&SAME),
            "{}, view {view}: {difference:?}, see {:?}",
            subject.name,
            output()
        );
    }
}

#[test]
fn at_a_third_and_a_tenth_of_the_vertices_the_picture_is_close() {
    let Some(gpu) = gpu("pictures: a third and a tenth") else { return };
    for View { subject, view, budgets } in measured(&gpu) {
        for ((vertices, _, difference), floor) in budgets[1..].iter().zip(subject.floors) {
            let name = subject.name;
            assert!(difference.score >= floor, "{name}, view {view}, {vertices} vertices: {difference:?}");
        }
    }
}

// ---- defects that the comparison must see ----

/// A defect is visible when it changes at least this many pixels, a thousandth of the picture, by over 24 steps.
const VISIBLE_PIXELS: usize = 230;

/// Whether the change of a model shows, and if so, that the metric sees it.
fn is_visible_and_seen(gpu: &Gpu, what: &str, sound: &RgbImage, damaged: &Model, camera: &Camera) -> bool {
    let picture = direct::picture(gpu, damaged, camera, SHOT);
    let visible = pixels_beyond(sound, &picture, 24) >= VISIBLE_PIXELS;
    let difference = Difference::between(sound, &picture);
    assert!(!visible || !difference.is_within(&SAME), "{what} is not seen: {difference:?}");
    visible
}

/// Damages up to twelve instances of every bundled model, one after the other, and counts the visible defects.
fn visible_defects(gpu: &Gpu, what: &str, damage: impl Fn(&mut Model, usize)) -> usize {
    let mut visible = 0;
    for subject in BUNDLED.iter() {
        let camera = subject.still();
        let sound = direct::picture(gpu, &subject.model, &camera, SHOT);
        for instance in (0..subject.model.instances.len()).step_by(subject.model.instances.len().div_ceil(12))
        {
            let mut damaged = subject.model.clone();
            damage(&mut damaged, instance);
            let what = format!("{}: {what}, instance {instance}", subject.name);
            visible += usize::from(is_visible_and_seen(gpu, &what, &sound, &damaged, &camera));
        }
    }
    visible
}

#[test]
fn a_missing_part_is_seen() {
    let Some(gpu) = gpu("pictures: a missing part") else { return };
    let visible = visible_defects(&gpu, "a missing part", |model, instance| {
        model.instances.remove(instance);
    });
    assert!(visible >= 6, "{visible}");
}

#[test]
fn a_wrong_colour_is_seen() {
    let Some(gpu) = gpu("pictures: a wrong colour") else { return };
    let visible = visible_defects(&gpu, "a wrong colour", |model, instance| {
        let mut wrong = model.materials[model.instances[instance].material as usize].clone();
        wrong.base_colour = [wrong.base_colour[1], wrong.base_colour[0] ^ 0x80, wrong.base_colour[2], 255];
        model.instances[instance].material = model.materials.len() as u32;
        model.materials.push(wrong);
    });
    assert!(visible >= 6, "{visible}");
}

#[test]
fn wrong_normals_are_seen() {
    let Some(gpu) = gpu("pictures: wrong normals") else { return };
    // The sign alone is no defect: every surface has two sides, and the seen one is lit.
    let visible = visible_defects(&gpu, "wrong normals", |model, instance| {
        let mesh = model.instances[instance].mesh as usize;
        model.meshes[mesh].normals.iter_mut().for_each(|[x, y, z]| (*x, *y, *z) = (*y, *z, -*x));
    });
    assert!(visible >= 6, "{visible}");
}

#[test]
fn a_part_out_of_place_is_seen() {
    let Some(gpu) = gpu("pictures: a part out of place") else { return };
    let visible = visible_defects(&gpu, "a part out of place", |model, instance| {
        let placed = &mut model.instances[instance].world_from_part;
        placed.translation *= 1.02;
        placed.matrix3 *= 1.02;
    });
    assert!(visible >= 3, "{visible}");
}
