//! `collapsar shot`: a model, a camera and a style in, one picture out, or those of a turntable; the viewer without its window.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use collapsar::frame::colour_by::{ColourBy, Coloured, look_of};
use collapsar::frame::{Renderer, Settings};
use collapsar::gpu::target::write_png;
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::passes::draw::{Edges, Look, MOST_PLANES, Style};
use collapsar::scene::camera_path::Keyframes;
use collapsar::scene::turntable::{self, MOST_PICTURES};
use collapsar::scene::views::{self, Projection, StandardView, UpAxis};
use collapsar::scene::{Bounds, Camera, Scene};
use collapsar::stats::report::human;
use indicatif::ProgressBar;

use super::cuts::{self, BoxText, SectionText};
use super::{Failure, baked, interrupt, output, progress, values};

/// Arguments of `shot`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar shot engine.clps -o engine.png\n  \
    collapsar shot engine.glb --view front --parallel --edges features -o front.png\n  \
    collapsar shot plant.clps --section x=50% --section=-y=2.5 --colour-by part -o cut.png\n  \
    collapsar shot ship.clps --isolate pump --fit isolated --size 512x512 -o pump.png\n  \
    collapsar shot engine.clps --turntable 72 -o engine.png     writes engine-000.png to engine-071.png\n  \
    collapsar shot ship.clps --camera '{\"frame\":0,\"eye\":[9,5,9],\"target\":[0,0,0]}' -o here.png\n\n\
    A section keeps what lies on the positive side of its plane: x=50% cuts off the lower half along x, -x=50% the \
    upper one; without a percent sign the number is in the model's unit of length.\n\
    A file that is no container is baked beside itself first, as `collapsar bake` would.")]
pub struct ShotArguments {
    /// The container, or a model to be baked.
    file: PathBuf,
    /// The picture, a PNG file.
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
    /// So many pictures from once round, about the upright axis, into NAME-000.png and so on for -o NAME.png.
    #[arg(long, value_name = "PICTURES", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_PICTURES)))]
    turntable: Option<u32>,
    /// The picture's size in pixels.
    #[arg(long, default_value = "1280x720", value_parser = values::size, value_name = "WxH")]
    size: (u32, u32),
    /// The side that it is looked at from; all of it is shown.
    #[arg(long, value_enum, default_value = "iso")]
    view: StandardView,
    /// One keyframe, as in a path file of `fly`, or such a file (its first key counts); instead of --view.
    #[arg(long, value_name = "JSON", conflicts_with_all = ["view", "parallel", "fov", "fit"])]
    camera: Option<String>,
    /// The axis that points upwards in the model.
    #[arg(long, value_enum, default_value = "y")]
    up: UpAxis,
    /// Without perspective.
    #[arg(long, conflicts_with = "fov")]
    parallel: bool,
    /// The angle between the upper and the lower edge of the picture.
    #[arg(long, value_name = "DEGREES", default_value_t = 45.0, value_parser = values::degrees)]
    fov: f64,
    /// What fills the picture.
    #[arg(long, value_enum, default_value = "all")]
    fit: Fit,
    /// Cut with a plane; up to six.
    #[arg(long, value_name = "[-]x|y|z=PLACE", value_parser = cuts::section)]
    section: Vec<SectionText>,
    /// Keep only what lies inside a box: two corners, in the model's unit or as shares of its box (10%).
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = cuts::section_box)]
    section_box: Option<BoxText>,
    /// What colours tell.
    #[arg(long, value_enum, default_value = "material")]
    colour_by: ColourBy,
    /// What is drawn as lines.
    #[arg(long, value_enum, default_value = "none")]
    edges: EdgesText,
    /// How much what lies behind an edge in depth is darkened, from 0 to 2.
    #[arg(long, value_name = "STRENGTH", default_value_t = 0.6, value_parser = values::up_to_two)]
    depth_cue: f64,
    /// Do not draw parts whose name or path in the assembly contains this, in any case of letters; may be repeated.
    #[arg(long, value_name = "NAME")]
    hide: Vec<String>,
    /// Draw only such parts.
    #[arg(long, value_name = "NAME")]
    isolate: Vec<String>,
    /// Draw such parts so that what is behind shows through.
    #[arg(long, value_name = "NAME")]
    ghost: Vec<String>,
    /// Draw such parts as selected.
    #[arg(long, value_name = "NAME")]
    select: Vec<String>,
    /// Vertices to spend (N); k and M work.
    #[arg(long, default_value = "4M", value_parser = values::count, value_name = "VERTICES")]
    budget: u32,
    /// Spend no more on an instance than keeps its error below so many pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.5, value_parser = values::positive)]
    error: f64,
    /// Samples a pixel.
    #[arg(long, default_value = "4", value_parser = ["1", "4"])]
    samples: String,
    /// The most memory for the model.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    memory: Option<u64>,
    /// The most GPU memory.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    gpu_memory: Option<u64>,
    /// Print nothing.
    #[arg(long)]
    quiet: bool,
}

/// What fills the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Fit {
    /// The whole model.
    All,
    /// What is left of it by --isolate and --hide.
    Isolated,
}

/// What is drawn as lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum EdgesText {
    /// Nothing.
    None,
    /// Creases and open boundaries.
    Features,
    /// The edges of every triangle.
    All,
}

impl From<EdgesText> for Edges {
    fn from(text: EdgesText) -> Self {
        match text {
            EdgesText::None => Self::None,
            EdgesText::Features => Self::Features,
            EdgesText::All => Self::All,
        }
    }
}

/// No more frames than these until a picture is complete.
const MOST_FRAMES: u32 = 400;

/// Runs `shot`.
pub fn run(arguments: &ShotArguments) -> Result<(), Failure> {
    // So that no slip replaces a model.
    if output::extension(&arguments.output) != "png" {
        let path = arguments.output.display();
        return Err(Failure::Argument(format!("the picture must end in .png: {path}")));
    }
    output::check_file(&arguments.path_of(0))?;
    let container = baked::container_of(&arguments.file)?;
    let scene = Arc::new(Scene::open(&container)?);
    let gpu = Arc::new(Gpu::new(&GpuOptions::default())?);
    let line = take_all(arguments, &gpu, &scene).map_err(|failure| failure.in_container(&container))?;
    if arguments.quiet { Ok(()) } else { output::print_text(&line) }
}

impl ShotArguments {
    /// Where a picture goes.
    fn path_of(&self, number: u32) -> PathBuf {
        match self.turntable {
            Some(_) => turntable::picture_path(&self.output, number),
            None => self.output.clone(),
        }
    }
}

/// Draws and writes the picture, or those of a turntable; gives a line about the last.
fn take_all(arguments: &ShotArguments, gpu: &Arc<Gpu>, scene: &Arc<Scene>) -> Result<String, Failure> {
    let looks = looks(arguments, scene)?;
    let cameras = cameras(arguments, scene, &looks)?;
    let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(scene), settings(arguments))?;
    renderer.set_style(style(arguments, scene)?);
    let bar = match cameras.len() {
        1 => ProgressBar::hidden(),
        _ if arguments.quiet => ProgressBar::hidden(),
        count => ProgressBar::new(count as u64)
            .with_style(progress::style("{wide_bar} {pos} of {len} pictures, {eta} left")),
    };
    let mut line = String::new();
    for (number, camera) in (0u32..).zip(&cameras) {
        let path = arguments.path_of(number);
        line = take(arguments, (scene, &mut renderer), camera, &looks, &path)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(if arguments.turntable.is_some() {
        format!("{} pictures, the last: {line}", cameras.len())
    } else {
        line
    })
}

/// Draws and writes a picture; gives a line about it.
fn take(
    arguments: &ShotArguments,
    (scene, renderer): (&Scene, &mut Renderer),
    camera: &Camera,
    looks: &[Look],
    path: &Path,
) -> Result<String, Failure> {
    renderer.set_looks(looks);
    settle(renderer, camera, arguments.turntable.is_some())?;
    if arguments.colour_by != ColourBy::Material {
        renderer.set_looks(&coloured(arguments.colour_by, scene, renderer, looks));
    }
    let record = renderer.frame(camera)?;
    let (gpu, target) = (renderer.gpu(), renderer.target());
    let picture = target.read_rgba(&gpu.device, &gpu.queue)?;
    write_png(path, target.width(), target.height(), &picture)?;
    if is_background(&picture, target.width()) {
        tracing::warn!(
            "there is nothing in the picture: all is hidden, cut away, or smaller than a pixel: {}",
            path.display()
        );
    }
    Ok(format!(
        "{} of {} triangles in {} of {} instances: {}",
        human::count(record.active_triangles),
        human::count(scene.counts().triangles_placed),
        human::count(record.instances_visible),
        human::count(scene.instances().len() as u64),
        path.display()
    ))
}

/// Whether a picture, given as rows of RGBA, shows nothing but the background, which changes from row to row and nowhere else.
/// A picture of one column or one row does not tell.
fn is_background(picture: &[u8], width: u32) -> bool {
    let (pixels, _) = picture.as_chunks::<4>();
    let changes = pixels.first() != pixels.last();
    width > 1 && changes && pixels.chunks(width as usize).all(|row| row.iter().all(|pixel| *pixel == row[0]))
}

fn settings(arguments: &ShotArguments) -> Settings {
    Settings {
        budget_vertices: arguments.budget,
        error_px: arguments.error as f32,
        memory_limit_bytes: arguments.memory,
        gpu_limit_bytes: arguments.gpu_memory,
        width: arguments.size.0,
        height: arguments.size.1,
        samples: if arguments.samples == "1" { 1 } else { 4 },
        time_stages: false,
        ..Settings::default()
    }
}

/// Draws until nothing moves any more.
fn settle(renderer: &mut Renderer, camera: &Camera, is_one_of_many: bool) -> Result<(), Failure> {
    for frame in 0..MOST_FRAMES {
        if interrupt::flag().load(std::sync::atomic::Ordering::Relaxed) {
            return Err(Failure::Interrupted(match is_one_of_many {
                true => "pictures that are written stay, and are whole",
                false => "no picture was written",
            }));
        }
        let record = renderer.frame(camera)?;
        if frame > 3 && record.streamed_vertices + record.streamed_triangles == 0 {
            return Ok(());
        }
    }
    tracing::warn!("the picture is not complete: something still moved after {MOST_FRAMES} frames");
    Ok(())
}

fn style(arguments: &ShotArguments, scene: &Scene) -> Result<Style, Failure> {
    let planes = arguments.section.len();
    if planes > MOST_PLANES {
        return Err(Failure::Argument(format!("at most {MOST_PLANES} sections are possible, not {planes}")));
    }
    let planes = arguments.section.iter().map(|section| section.plane(scene.bounds()));
    let boxed = arguments.section_box.iter().flat_map(|section_box| section_box.planes(scene.bounds()));
    Ok(Style {
        edges: arguments.edges.into(),
        sections: planes.chain(boxed).collect(),
        depth_cue: arguments.depth_cue as f32,
        ..Style::default()
    })
}

/// What names say of each instance.
fn looks(arguments: &ShotArguments, scene: &Scene) -> Result<Vec<Look>, Failure> {
    let mut looks = vec![Look::default(); scene.instances().len()];
    for (names, look) in [
        (&arguments.hide, Look::HIDDEN),
        (&arguments.ghost, Look::GHOST),
        (&arguments.select, Look::SELECTED),
    ] {
        for name in names {
            named(scene, name)?.into_iter().for_each(|i| looks[i as usize] = looks[i as usize].with(look));
        }
    }
    if !arguments.isolate.is_empty() {
        let mut kept = vec![false; looks.len()];
        for name in &arguments.isolate {
            named(scene, name)?.into_iter().for_each(|i| kept[i as usize] = true);
        }
        for (look, _) in looks.iter_mut().zip(kept).filter(|(_, kept)| !kept) {
            *look = look.with(Look::HIDDEN);
        }
    }
    Ok(looks)
}

/// The instances whose part, or a node above it, is called so; an error if there are none.
fn named(scene: &Scene, name: &str) -> Result<Vec<u32>, Failure> {
    let wanted = name.to_lowercase();
    let says = |text: &str| text.to_lowercase().contains(&wanted);
    let mut nodes = vec![false; scene.nodes().len()];
    for node in 0..nodes.len() {
        // Parents come before their children.
        let above = scene.parent_node(node as u32).is_some_and(|parent| nodes[parent as usize]);
        nodes[node] = above || says(scene.node_name(node as u32));
    }
    let parts: Vec<bool> = (0..scene.parts().len() as u32).map(|part| says(scene.part_name(part))).collect();
    let found: Vec<u32> = (0u32..)
        .zip(scene.instances())
        .filter(|(_, row)| nodes[row.node as usize] || parts[row.part as usize])
        .map(|(number, _)| number)
        .collect();
    if found.is_empty() {
        return Err(Failure::Argument(format!(
            "nothing in {} is called `{name}`: neither a part nor anything in its assembly",
            scene.file_name()
        )));
    }
    Ok(found)
}

fn coloured(by: ColourBy, scene: &Scene, renderer: &Renderer, looks: &[Look]) -> Vec<Look> {
    let of = Coloured { scene, states: renderer.states(), wishes: renderer.wishes(), ages: &[] };
    (0u32..).zip(looks).map(|(instance, &look)| look.with(look_of(by, &of, instance))).collect()
}

/// The camera, or all cameras of a turntable.
fn cameras(arguments: &ShotArguments, scene: &Scene, looks: &[Look]) -> Result<Vec<Camera>, Failure> {
    let bounds = scene.bounds();
    if let Some(text) = &arguments.camera {
        let keys = if text.trim_start().starts_with(['{', '[']) {
            Keyframes::parse(text)
        } else {
            Keyframes::read(Path::new(text))
        };
        let first = keys.map_err(Failure::from)?;
        let first = first.camera(0, views::near_of(bounds), views::reach_of(bounds));
        return Ok(round(arguments, &first, bounds));
    }
    let shown = match arguments.fit {
        Fit::All => *bounds,
        Fit::Isolated => {
            let left = scene.boxes().iter().zip(looks).filter(|(_, look)| !look.has(Look::HIDDEN));
            left.map(|(instance, _)| instance).fold(Bounds::EMPTY, Bounds::with_box)
        }
    };
    let projection = match arguments.parallel {
        true => Projection::Parallel,
        false => Projection::Perspective(arguments.fov.to_radians()),
    };
    let aspect = f64::from(arguments.size.0) / f64::from(arguments.size.1);
    let orientation = arguments.view.orientation(arguments.up);
    let first = views::fit(&shown, bounds, orientation, projection, aspect);
    // From each side all is to be seen, and nothing moves nearer or away.
    let each = round(arguments, &first, &shown);
    let fitted =
        each.iter().map(|camera| views::fit(&shown, bounds, camera.world_from_view, projection, aspect));
    let fitted: Vec<Camera> = fitted.collect();
    let first = turntable::farthest(&fitted, shown.centre()).unwrap_or(first);
    Ok(round(arguments, &first, &shown))
}

/// The camera, and with --turntable those that it becomes on its way round what is shown.
fn round(arguments: &ShotArguments, first: &Camera, shown: &Bounds) -> Vec<Camera> {
    let pictures = arguments.turntable.unwrap_or(1);
    turntable::once_round(first, shown.centre(), arguments.up.vector(), pictures)
}
