//! `collapsar demo`: the main job on the bundled models, for someone who has just cloned the project.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use collapsar::bake::BakeOptions;
use collapsar::frame::Settings;
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::scene::{CameraPath, Scene};
use collapsar::stats::Summary;

use super::fly::{FlightPlan, Opening, compare, describe_comparison};
use super::{Failure, bake, output, values};

/// Arguments of `demo`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  collapsar demo --out demo")]
pub struct DemoArguments {
    /// The folder of the bundled models.
    #[arg(long, default_value = "datasets", value_name = "DIR")]
    datasets: PathBuf,
    /// The folder for containers, numbers and pictures; made if its parent exists.
    #[arg(long, default_value = "out", value_name = "DIR")]
    out: PathBuf,
    /// Frames of each flight.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    frames: u64,
    /// The pictures' size in pixels.
    #[arg(long, default_value = "960x540", value_parser = values::size, value_name = "WxH")]
    size: (u32, u32),
}

/// A bundled model and how it is flown.
struct Bundled {
    name: &'static str,
    file: &'static str,
    budget_vertices: u32,
    path: CameraPath,
}

/// Runs `demo`.
pub fn run(arguments: &DemoArguments) -> Result<(), Failure> {
    let models = [
        Bundled {
            name: "engine",
            file: "2CylinderEngine.glb",
            budget_vertices: 60_000,
            path: CameraPath::Orbit,
        },
        Bundled { name: "truck", file: "peterbilt.obj", budget_vertices: 20_000, path: CameraPath::Walk },
    ];
    if let Some(missing) = models.iter().map(|m| arguments.datasets.join(m.file)).find(|file| !file.is_file())
    {
        return Err(Failure::Argument(format!(
            "a bundled model is missing; run this in the project's folder or name its datasets with --datasets: {}",
            missing.display()
        )));
    }
    output::check_folder(&arguments.out)?;
    let gpu = Arc::new(Gpu::new(&GpuOptions::default())?);
    output::make_folder(&arguments.out)?;
    let mut savings = Vec::new();
    for model in &models {
        let summaries = fly_bundled(&gpu, model, arguments)?;
        output::print_text(&format!("{}\n", describe_comparison(&summaries)))?;
        savings.push((model.name, summaries));
    }
    output::print_text(&closing(&savings, &arguments.out))
}

fn fly_bundled(gpu: &Arc<Gpu>, model: &Bundled, arguments: &DemoArguments) -> Result<Vec<Summary>, Failure> {
    let container = arguments.out.join(format!("{}.clps", model.name));
    let source = arguments.datasets.join(model.file);
    output::print_text(&format!("== {}: {} ==", model.name, source.display()))?;
    bake_when_needed(&source, &container)?;
    let started = Instant::now();
    let scene = Arc::new(Scene::open(&container)?);
    let open = started.elapsed();
    let folder = arguments.out.join(model.name);
    output::make_folder(&folder)?;
    let plan = FlightPlan {
        path: &model.path,
        frames: arguments.frames,
        settings: Settings {
            budget_vertices: model.budget_vertices,
            // What simple parts do not need for a pixel goes to those with detail: the engine's fins, the tyres.
            error_px: 1.0,
            width: arguments.size.0,
            height: arguments.size.1,
            ..Settings::default()
        },
        hash: true,
        png_every: arguments.frames.div_ceil(6),
        fps: None,
        opening: Opening { open, all: open },
    };
    compare(gpu, &scene, &plan, Some(&folder)).map_err(|failure| failure.in_container(&container))
}

/// Bakes unless a container is there that is newer than the model and this program.
fn bake_when_needed(source: &Path, container: &Path) -> Result<(), Failure> {
    let modified = |path: &Path| path.metadata().and_then(|metadata| metadata.modified()).ok();
    let program = std::env::current_exe().ok().and_then(|program| modified(&program));
    let newest = modified(source).max(program);
    let fresh = modified(container) > newest && Scene::open(container).is_ok();
    if fresh {
        return output::print_text(&format!("already baked: {}", container.display()));
    }
    let report = bake::bake_with_progress(&[source.to_owned()], container, &BakeOptions::default())?;
    output::print_text(&bake::describe(&report, container))
}

fn closing(flights: &[(&str, Vec<Summary>)], out: &Path) -> String {
    let mut lines = Vec::new();
    for (name, summaries) in flights {
        let saving = summaries[0].transfer_saving.map_or("-".to_owned(), |saving| format!("{saving:.1} x"));
        let pictures = out.join(name).join("coherent");
        lines.push(format!("{name:<8} transfer saving {saving:>9}; pictures: {}", pictures.display()));
    }
    lines.push(
        "Timings on a software adapter compare the strategies with each other, nothing else.".to_owned(),
    );
    lines.join("\n")
}
