//! What do section planes cost where nothing else changes?
//!
//! Makes a field of spheres in memory, of a million triangles in all, and draws it at rest, so that a frame is its draw pass
//! alone: without planes, with one, and with six. The planes lie beside the model; or they reach into its box and cut nothing,
//! so that equal pixels are drawn; or each takes the front half of every sphere, or all spheres of the left half, so that one
//! and six draw equal pixels. The ways alternate.
//!
//! Of a container that is named, the same of a plane through its middle, upright and towards the eye, and of the box of the
//! inner nine tenths of its edges: how much an assembly has to pay of which planes cut a few of many instances.
//!
//! Printed: median milliseconds of a draw, and the quotients within the run.
//!
//! The expected answer: six cost at most a tenth more than none.
//!
//! `cargo bench --bench sections -- [SAMPLES] [FILE.clps]`

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run should stop")]

use std::sync::Arc;

use collapsar::bake::{BakeOptions, BakeProgress, Loaded, bake_source};
use collapsar::frame::{Renderer, Settings};
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::import::{Instance, Material, Model, Node, SourceMesh};
use collapsar::passes::draw::{Section, Style};
use collapsar::scene::views::{self, Projection, StandardView, UpAxis};
use collapsar::scene::{Bounds, Camera, Scene};
use glam::{DAffine3, DVec3};

const ROUNDS: usize = 4;
/// That are measured in each round.
const FRAMES: usize = 4;
/// Spheres along each side of the field.
const SIDE: u32 = 20;

/// A closed sphere of radius 1.
fn sphere(rings: u32, segments: u32) -> SourceMesh {
    let mut mesh = SourceMesh { name: "sphere".into(), ..SourceMesh::default() };
    for (ring, segment) in (0..=rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment))) {
        let (theta, phi) = (
            std::f32::consts::PI * ring as f32 / rings as f32,
            std::f32::consts::TAU * segment as f32 / segments as f32,
        );
        mesh.positions.push([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]);
    }
    mesh.normals = mesh.positions.clone();
    for (ring, segment) in (0..rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment))) {
        let at = |ring: u32, segment: u32| ring * segments + segment % segments;
        mesh.triangles.push([at(ring, segment), at(ring + 1, segment), at(ring, segment + 1)]);
        mesh.triangles.push([at(ring, segment + 1), at(ring + 1, segment), at(ring + 1, segment + 1)]);
    }
    mesh
}

fn field() -> Arc<Scene> {
    let place = |i: u32| Instance {
        mesh: 0,
        node: 0,
        material: 0,
        world_from_part: DAffine3::from_translation(
            DVec3::new(f64::from(i % SIDE), f64::from(i / SIDE), 0.0) * 2.1,
        ),
    };
    let model = Model {
        meshes: vec![sphere(28, 45)],
        instances: (0..SIDE * SIDE).map(place).collect(),
        nodes: vec![Node { name: "field".into(), parent: None }],
        materials: vec![Material::default()],
        notes: Vec::new(),
    };
    let folder = tempfile::tempdir().unwrap();
    let container = folder.path().join("field.clps");
    bake_source(&Loaded::new(model), &container, &BakeOptions::default(), &BakeProgress::default()).unwrap();
    Arc::new(Scene::open(&container).unwrap())
}

/// What planes do to the field.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    /// They are beside it.
    Beside,
    /// They reach into its box, and into those of the spheres at its edges, past all spheres.
    Grazing,
    /// Each takes the front half of every sphere.
    Halves,
    /// Each takes the left half of the field, between two columns of spheres.
    Side,
}

fn planes(count: usize, cut: Cut) -> Vec<Section> {
    let far = f64::from(SIDE - 1) * 2.1;
    let corner = DVec3::Z;
    let edge = |i: usize| {
        let outward = [DVec3::NEG_X, DVec3::X, DVec3::NEG_Y, DVec3::Y][i % 4]
            + if i < 4 { DVec3::Z } else { DVec3::NEG_Z };
        let middle = DVec3::new(if i % 4 == 1 { far } else { 0.0 }, if i % 4 == 3 { far } else { 0.0 }, 0.0);
        Section { point: middle + outward.normalize() * 1.1, normal: -outward.normalize() }
    };
    let section = |i: usize| match cut {
        Cut::Beside => Section { point: corner * (3.0 + i as f64), normal: DVec3::NEG_Z },
        Cut::Grazing => edge(i),
        Cut::Halves => Section { point: DVec3::ZERO, normal: DVec3::NEG_Z },
        Cut::Side => Section { point: DVec3::X * 0.5 * far, normal: DVec3::X },
    };
    (0..count).map(section).collect()
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Median milliseconds of a draw at rest for each style, drawn in turns.
fn measure(renderer: &mut Renderer, camera: &Camera, styles: &[Style]) -> Vec<f64> {
    let mut times = vec![Vec::new(); styles.len()];
    for _ in 0..ROUNDS {
        for (style, times) in styles.iter().zip(&mut times) {
            renderer.set_style(style.clone());
            // The first frames make pipelines, and budget what has come back into the picture.
            rest(renderer, camera);
            for _ in 0..FRAMES {
                let record = renderer.frame(camera).unwrap();
                assert_eq!(record.compute_passes, 0, "at rest nothing but the draw pass runs");
                times.push(record.draw_ms);
            }
        }
    }
    times.into_iter().map(median).collect()
}

/// Draws until reading, budgets and the dead band have come to their ends.
fn rest(renderer: &mut Renderer, camera: &Camera) {
    let mut resting = 0;
    while resting < 3 {
        let record = renderer.frame(camera).unwrap();
        resting = if record.compute_passes == 0 { resting + 1 } else { 0 };
    }
}

/// A renderer at rest before a view.
fn at_rest(gpu: &Arc<Gpu>, scene: &Arc<Scene>, camera: &Camera, samples: u32) -> Renderer {
    let settings = Settings {
        budget_vertices: 2_000_000,
        width: 800,
        height: 800,
        samples,
        time_stages: false,
        ..Settings::default()
    };
    let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(scene), settings).unwrap();
    rest(&mut renderer, camera);
    println!("{samples} samples a pixel, {} triangles", renderer.frame(camera).unwrap().active_triangles);
    renderer
}

fn print_quotients(what: &str, times: &[f64]) {
    let &[none, one, six] = times else { panic!("three styles are measured") };
    println!(
        "  {what:<18} none {none:8.2} ms   one {one:8.2} ms   six {six:8.2} ms   one/none {:.3}   six/none {:.3}   six/one {:.3}",
        one / none,
        six / none,
        six / one
    );
}

fn measure_field(gpu: &Arc<Gpu>, samples: &[u32]) {
    let scene = field();
    let orientation = StandardView::Front.orientation(UpAxis::Y);
    let camera = views::fit(scene.bounds(), scene.bounds(), orientation, Projection::default(), 1.0);
    for &samples in samples {
        let mut renderer = at_rest(gpu, &scene, &camera, samples);
        for (cut, what) in [
            (Cut::Beside, "beside the model"),
            (Cut::Grazing, "nothing is cut"),
            (Cut::Halves, "all are halved"),
            (Cut::Side, "half are gone"),
        ] {
            let styles = [0, 1, 6].map(|count| Style { sections: planes(count, cut), ..Style::default() });
            print_quotients(what, &measure(&mut renderer, &camera, &styles));
        }
    }
}

fn measure_model(gpu: &Arc<Gpu>, samples: &[u32], container: &str) {
    let scene = Arc::new(Scene::open(container.as_ref()).unwrap());
    let bounds = scene.bounds();
    let orientation = StandardView::Iso.orientation(UpAxis::Y);
    let camera = views::fit(bounds, bounds, orientation, Projection::default(), 1.0);
    let inner = 0.45 * bounds.extent();
    let inner = Bounds { low: bounds.centre() - inner, high: bounds.centre() + inner };
    let middle = Section { point: bounds.centre(), normal: DVec3::NEG_X };
    for &samples in samples {
        let mut renderer = at_rest(gpu, &scene, &camera, samples);
        let styles = [Vec::new(), vec![middle], Section::inside(&inner).to_vec()]
            .map(|sections| Style { sections, ..Style::default() });
        print_quotients("the model", &measure(&mut renderer, &camera, &styles));
    }
}

fn main() {
    let arguments = || std::env::args().skip(1);
    let samples = arguments().find_map(|argument| argument.parse().ok());
    let samples = samples.map_or(vec![1, 4], |samples| vec![samples]);
    let gpu = Arc::new(Gpu::new(&GpuOptions::default()).unwrap());
    println!("GPU: {}", gpu.adapter_info.name);
    match arguments().find(|argument| argument.ends_with(".clps")) {
        Some(container) => measure_model(&gpu, &samples, &container),
        None => measure_field(&gpu, &samples),
    }
}
