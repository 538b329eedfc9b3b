//! `collapsar fly`: a container and a camera path in; pictures, a record per frame and a summary out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clap::Args;
use collapsar::frame::{PassesOn, Renderer, Settings};
use collapsar::gpu::{Gpu, GpuOptions};
use collapsar::scene::{CameraPath, Scene};
use collapsar::select::SelectOn;
use collapsar::stats::machine::{Machine, command_line};
use collapsar::stats::report::{Flight, comparison_table, human, write_csv};
use collapsar::stats::{FrameRecord, Summary};
use collapsar::stream::Strategy;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use xxhash_rust::xxh3::Xxh3;

use super::{Failure, interrupt, output, values};

/// Arguments of `fly`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar fly engine.clps --path orbit --png 10 --out flight\n  \
    collapsar fly engine.clps --path walk --budget 200k --compare --out flight\n  \
    collapsar fly engine.clps --path my_path.json --frames 600 --json\n\n\
    A path file is a list of keyframes: [{\"frame\": 0, \"eye\": [x,y,z], \"target\": [x,y,z]}, ...], with \
    \"up\" and \"fov_degrees\" where wanted.\n\n\
    The output folder gets frames.csv (one line a frame), summary.json and the pictures; with --compare one folder \
    a strategy and table.txt. Bytes, milliseconds and counts are what the names of the columns say.")]
pub struct FlyArguments {
    /// The container.
    file: PathBuf,
    /// Where the camera goes: orbit, walk (1/2000 of the diagonal and 0.1 degree a frame), through (the whole length
    /// of the model), still, teleport (a random view every 10 frames), or a file of keyframes.
    #[arg(long, default_value = "orbit", value_name = "orbit|walk|through|still|teleport|FILE.json")]
    path: String,
    /// How many frames.
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    frames: u64,
    /// Vertices to spend a frame (N); k and M work.
    #[arg(long, default_value = "1M", value_parser = values::count, value_name = "VERTICES")]
    budget: u32,
    /// How data gets to the GPU: only what it lacks, all of it in one block, or all of it part by part.
    #[arg(long, value_enum, default_value = "coherent", conflicts_with = "compare")]
    strategy: Strategy,
    /// Fly with all strategies and print the paper's Table 1.
    #[arg(long)]
    compare: bool,
    /// The picture's size in pixels.
    #[arg(long, default_value = "1280x720", value_parser = values::size, value_name = "WxH")]
    size: (u32, u32),
    /// Samples a pixel.
    #[arg(long, default_value = "4", value_parser = ["1", "4"])]
    samples: String,
    /// Where budgets are computed.
    #[arg(long, value_enum, default_value = "gpu")]
    select: SelectOn,
    /// How active buffers are made contiguous.
    #[arg(long, value_enum, default_value = "rebuild")]
    defragment: Defragmentation,
    /// Run the passes between upload and draw by their CPU references.
    #[arg(long, value_enum, conflicts_with = "select")]
    reference: Option<ReferenceOn>,
    /// The paper's alpha: budgets grow with the projected area to the power of 1/alpha.
    #[arg(long, default_value_t = 3.0, value_parser = values::positive)]
    alpha: f64,
    /// Spend no more on an instance than keeps its error below so many pixels; the budget stays the cap.
    #[arg(long, value_name = "PIXELS", value_parser = values::positive)]
    error: Option<f64>,
    /// Send about so many bytes of deltas a frame (whole instances, one at least); the rest comes in later frames.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    upload_per_frame: Option<u64>,
    /// The most memory for the model: its tables, the chunks that have been read, and what belongs to them. KiB, MiB and
    /// GiB work.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    memory: Option<u64>,
    /// The most GPU memory, buffers and picture together (kept by strategy coherent; the others send everything anew).
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    gpu_memory: Option<u64>,
    /// Read no more than so many bytes a second, as from a slow disk.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    read_rate: Option<u64>,
    /// Bytes of the largest GPU buffer; smaller than the adapter's own limit to try several batches.
    #[arg(long, value_name = "BYTES", value_parser = values::bytes)]
    batch_limit: Option<u64>,
    /// Do not wait for the disk: draw what has arrived. Frames then depend on its speed, and cannot be compared.
    #[arg(long, conflicts_with = "compare")]
    live: bool,
    /// Count only: select, read and find out what each frame lacks, but neither send nor draw it. For the transfer of long
    /// flights over large models on machines without a fast GPU; what is counted is the same.
    #[arg(long, conflicts_with_all = ["png", "reference", "gpu_memory"])]
    count_only: bool,
    /// With --live: begin no more than so many frames a second, so that the camera moves at a known speed.
    #[arg(long, requires = "live", value_name = "FRAMES",
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    fps: Option<u64>,
    /// With --live: read only what is in view now, not what the moving camera will see next.
    #[arg(long, requires = "live")]
    no_prefetch: bool,
    /// Do not read back and hash what is drawn (the hashes in the summary are then empty).
    #[arg(long)]
    no_hash: bool,
    /// Write every so many frames a picture; 0 for none.
    #[arg(long, default_value_t = 0, value_name = "EVERY")]
    png: u64,
    /// The folder for the output; made if its parent exists.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the summary (with --compare: a list of three) as JSON.
    #[arg(long)]
    json: bool,
}

/// How active buffers are made contiguous.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Defragmentation {
    /// Copy everything into the other buffer of a pair, as in the paper.
    Rebuild,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ReferenceOn {
    /// The CPU.
    Cpu,
}

/// Runs `fly`.
pub fn run(arguments: &FlyArguments) -> Result<(), Failure> {
    if arguments.png > 0 && arguments.out.is_none() {
        return Err(Failure::Argument("--png needs a folder for the pictures: add --out DIR".to_owned()));
    }
    let path = CameraPath::parse(&arguments.path)?;
    // From here on Ctrl-C is heard.
    interrupt::flag();
    let started = Instant::now();
    // The device is opened meanwhile; what is wrong with the container is told first.
    let opened = std::thread::scope(|scope| {
        let gpu = scope.spawn(|| Gpu::new(&GpuOptions::default()));
        let scene = Scene::open(&arguments.file);
        let open = started.elapsed();
        (scene, open, gpu.join())
    });
    let (scene, open, gpu) = opened;
    let scene = Arc::new(scene?);
    if let Some(folder) = &arguments.out {
        output::check_folder(folder)?;
    }
    let gpu = Arc::new(gpu.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
    if let Some(folder) = &arguments.out {
        output::make_folder(folder)?;
    }
    let flight = FlightPlan {
        path: &path,
        frames: arguments.frames,
        settings: settings(arguments),
        hash: !arguments.no_hash && !arguments.count_only,
        png_every: arguments.png,
        fps: arguments.fps,
        opening: Opening { open, all: started.elapsed() },
    };
    if arguments.compare {
        let summaries = compare(&gpu, &scene, &flight, arguments.out.as_deref())
            .map_err(|failure| failure.in_container(&arguments.file))?;
        return if arguments.json {
            output::print_json(&summaries)
        } else {
            output::print_text(&describe_comparison(&summaries))
        };
    }
    let summary = fly(&gpu, &scene, &flight, arguments.out.as_deref())
        .map_err(|failure| failure.in_container(&arguments.file))?;
    if arguments.json { output::print_json(&summary) } else { output::print_text(&describe(&summary)) }
}

fn settings(arguments: &FlyArguments) -> Settings {
    // The only kind so far; the match keeps the compiler honest when `incremental` comes.
    let Defragmentation::Rebuild = arguments.defragment;
    Settings {
        budget_vertices: arguments.budget,
        alpha: arguments.alpha as f32,
        error_px: arguments.error.unwrap_or(0.0) as f32,
        strategy: arguments.strategy,
        // The reference run must not depend on a single shader.
        select: if arguments.reference.is_some() { SelectOn::Cpu } else { arguments.select },
        passes: match (arguments.reference, arguments.count_only) {
            (Some(ReferenceOn::Cpu), _) => PassesOn::Reference,
            (None, true) => PassesOn::Nowhere,
            (None, false) => PassesOn::Gpu,
        },
        upload_limit_bytes: arguments.upload_per_frame,
        memory_limit_bytes: arguments.memory,
        gpu_limit_bytes: arguments.gpu_memory,
        read_rate: arguments.read_rate,
        batch_limit_bytes: arguments.batch_limit,
        settle: !arguments.live,
        prefetch: !arguments.no_prefetch,
        width: arguments.size.0,
        height: arguments.size.1,
        samples: if arguments.samples == "1" { 1 } else { 4 },
        ..Settings::default()
    }
}

/// What is to be flown.
pub struct FlightPlan<'a> {
    /// The way of the camera.
    pub path: &'a CameraPath,
    /// How many frames.
    pub frames: u64,
    /// How to render.
    pub settings: Settings,
    /// Whether to read back and hash what is drawn.
    pub hash: bool,
    /// A picture every so many frames; 0 for none.
    pub png_every: u64,
    /// How many frames begin in a second at most.
    pub fps: Option<u64>,
    /// What came before.
    pub opening: Opening,
}

/// How long it took until a flight could begin.
#[derive(Debug, Clone, Copy)]
pub struct Opening {
    /// Opening the container.
    pub open: Duration,
    /// That, and opening the graphics device.
    pub all: Duration,
}

/// Flies once; with a folder, writes the records, the summary and the pictures there.
pub fn fly(
    gpu: &Arc<Gpu>,
    scene: &Arc<Scene>,
    plan: &FlightPlan<'_>,
    folder: Option<&Path>,
) -> Result<Summary, Failure> {
    let started = Instant::now();
    let mut renderer = Renderer::new(Arc::clone(gpu), Arc::clone(scene), plan.settings)?;
    renderer.stop_waiting_when(interrupt::flag());
    let mut records: Vec<FrameRecord> = Vec::new();
    let mut hashes = Hashes::default();
    let bar = progress_bar(plan);
    let stop = interrupt::flag();
    let is_stopped = || match stop.load(Ordering::Relaxed) {
        true => Err(Failure::Interrupted("the flight's numbers were not written")),
        false => Ok(()),
    };
    for frame in 0..plan.frames {
        is_stopped()?;
        if let Some(fps) = plan.fps {
            let due = Duration::from_secs_f64(frame as f64 / fps as f64);
            std::thread::sleep(due.saturating_sub(started.elapsed()));
        }
        let camera = plan.path.camera(frame, plan.frames, scene.bounds());
        let mut record = renderer.frame(&camera)?;
        // It may have ended before it had all that it wants.
        is_stopped()?;
        record.elapsed_ms = 1e3 * (plan.opening.all + started.elapsed()).as_secs_f64();
        if plan.hash {
            hashes.add(&renderer, record.compute_passes > 0 || record.bytes_sent > 0)?;
        }
        if let Some(folder) = folder.filter(|_| plan.png_every > 0 && frame.is_multiple_of(plan.png_every)) {
            let file = folder.join(format!("frame_{frame:05}.png"));
            renderer.target().save_png(&gpu.device, &gpu.queue, &file)?;
        }
        records.push(record);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let summary = Summary::new(description(gpu, scene, plan, &hashes), &records);
    if let Some(folder) = folder {
        output::write_whole(&folder.join("frames.csv"), |out| write_csv(out, &records))?;
        output::write_json(&folder.join("summary.json"), &summary)?;
    }
    Ok(summary)
}

fn progress_bar(plan: &FlightPlan<'_>) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:9} [{bar:32}] {pos} of {len} frames, {eta} left");
    // The template is a constant that indicatif has parsed in every test of this verb.
    let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(plan.frames).with_style(style).with_message(plan.settings.strategy.word())
}

fn description(gpu: &Gpu, scene: &Scene, plan: &FlightPlan<'_>, hashes: &Hashes) -> Flight {
    let info = &gpu.adapter_info;
    let machine = Machine::this();
    let counts = scene.counts();
    let on_reference = plan.settings.passes == PassesOn::Reference;
    let adapter = format!("{} ({}, {:?})", info.name, info.driver_info, info.device_type);
    Flight {
        adapter: if on_reference { format!("CPU reference; drawn by {adapter}") } else { adapter },
        strategy: plan.settings.strategy.word().to_owned(),
        select: plan.settings.select.word().to_owned(),
        path: plan.path.name().to_owned(),
        width: plan.settings.width,
        height: plan.settings.height,
        budget_vertices: plan.settings.budget_vertices.into(),
        index_hash: hashes.text(&hashes.indices),
        vertex_hash: hashes.text(&hashes.vertices),
        gpu_timestamps: gpu.timestamps,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command: command_line(),
        cpu: machine.cpu,
        cores: machine.cores,
        memory_bytes: machine.memory_bytes,
        model: scene.file_name().to_owned(),
        parts: counts.parts,
        instances: counts.instances,
        model_triangles: counts.triangles_placed,
        file_bytes: counts.file_bytes,
        live: !plan.settings.settle,
        memory_limit_bytes: plan.settings.memory_limit_bytes,
        gpu_limit_bytes: plan.settings.gpu_limit_bytes,
        read_rate: plan.settings.read_rate,
        open_ms: 1e3 * plan.opening.open.as_secs_f64(),
    }
}

/// Hashes over the content of every frame.
#[derive(Default)]
struct Hashes {
    indices: Xxh3,
    vertices: Xxh3,
    last: collapsar::frame::ContentDigest,
    frames: u64,
}

impl Hashes {
    /// A frame in which nothing changed has the content of the last.
    fn add(&mut self, renderer: &Renderer, changed: bool) -> Result<(), Failure> {
        if changed || self.frames == 0 {
            self.last = renderer.content_digest()?;
        }
        self.indices.update(&self.last.indices.to_le_bytes());
        self.vertices.update(&self.last.vertices.to_le_bytes());
        self.frames += 1;
        Ok(())
    }

    fn text(&self, hash: &Xxh3) -> String {
        if self.frames == 0 { String::new() } else { format!("{:016x}", hash.digest()) }
    }
}

/// Flies with every strategy and makes sure that all drew the same.
pub fn compare(
    gpu: &Arc<Gpu>,
    scene: &Arc<Scene>,
    plan: &FlightPlan<'_>,
    folder: Option<&Path>,
) -> Result<Vec<Summary>, Failure> {
    let mut summaries = Vec::new();
    for strategy in Strategy::ALL {
        let subfolder = folder.map(|folder| folder.join(strategy.word()));
        if let Some(folder) = &subfolder {
            output::make_folder(folder)?;
        }
        let settings = Settings { strategy, ..plan.settings };
        // One set of pictures is enough: the hashes say that the others are the same.
        let png_every = if strategy == Strategy::Coherent { plan.png_every } else { 0 };
        let plan = FlightPlan { settings, png_every, ..*plan };
        summaries.push(fly(gpu, scene, &plan, subfolder.as_deref())?);
    }
    check_identity(&summaries)?;
    if let Some(folder) = folder {
        let text = describe_comparison(&summaries);
        output::write_whole(&folder.join("table.txt"), |out| writeln!(out, "{text}"))?;
        output::write_json(&folder.join("summary.json"), &Comparison { strategies: &summaries })?;
    }
    Ok(summaries)
}

fn check_identity(summaries: &[Summary]) -> Result<(), Failure> {
    let hashes = |summary: &Summary| {
        format!("indices {}, vertices {}", summary.flight.index_hash, summary.flight.vertex_hash)
    };
    let first = &summaries[0];
    match summaries.iter().find(|summary| hashes(summary) != hashes(first)) {
        Some(other) => Err(Failure::Mismatch(format!(
            "`{}` and `{}` drew different frames ({}; {}): this is a bug in collapsar, please report it",
            first.flight.strategy,
            other.flight.strategy,
            hashes(first),
            hashes(other)
        ))),
        None => Ok(()),
    }
}

#[derive(Serialize)]
struct Comparison<'a> {
    strategies: &'a [Summary],
}

/// The paper's Table 1 and the saving.
pub fn describe_comparison(summaries: &[Summary]) -> String {
    let coherent = &summaries[0];
    let mut text = comparison_table(summaries);
    text.push_str(&format!(
        "\n{} frames of `{}` with {} vertices a frame on {}\n{}\n{}",
        human::count(coherent.frames),
        coherent.flight.path,
        human::count(coherent.flight.budget_vertices),
        coherent.flight.adapter,
        saving_line(coherent),
        identity_line(coherent),
    ));
    text
}

fn identity_line(summary: &Summary) -> String {
    if summary.flight.index_hash.is_empty() {
        "what was drawn was not compared (--no-hash)".to_owned()
    } else {
        format!("all strategies drew the same frames: index hash {}", summary.flight.index_hash)
    }
}

fn saving_line(summary: &Summary) -> String {
    let sent = human::bytes(summary.bytes_sent_total);
    let whole = human::bytes(summary.bytes_whole_total);
    let steady = match summary.steady_share {
        Some(share) => format!("; after the first frame {:.3} % of what `whole` sends", 100.0 * share),
        None => String::new(),
    };
    match summary.transfer_saving {
        Some(saving) => {
            format!("transfer saving: {saving:.1} x ({sent} sent, `whole` sends {whole}){steady}")
        }
        None => format!("transfer saving: nothing was sent (`whole` sends {whole})"),
    }
}

fn describe(summary: &Summary) -> String {
    let stages: Vec<String> =
        summary.stage_ms.iter().map(|(stage, ms)| format!("{stage} {}", human::milliseconds(*ms))).collect();
    let flight = &summary.flight;
    let mut lines = vec![
        format!(
            "flight       {} frames of `{}`, {}x{} pixels",
            human::count(summary.frames),
            flight.path,
            flight.width,
            flight.height
        ),
        format!("adapter      {}", flight.adapter),
        format!(
            "drawn        {} triangles and {} vertices a frame (budget {})",
            human::rounded(summary.active_triangles_mean),
            human::rounded(summary.active_vertices_mean),
            human::count(flight.budget_vertices)
        ),
        format!(
            "sent         {}, {} of it a frame, by `{}`",
            human::bytes(summary.bytes_sent_total),
            human::bytes(summary.bytes_sent_total / summary.frames.max(1)),
            flight.strategy
        ),
        format!("             {}", saving_line(summary)),
        format!(
            "time         {} ms a frame (median), {} ms (99 %)",
            human::milliseconds(summary.frame_ms_p50),
            human::milliseconds(summary.frame_ms_p99)
        ),
        format!("stages (ms)  {}", stages.join(", ")),
        format!("passes (ms)  {}", passes(&summary.pass_ms, |ms| ms.map_or("-".into(), human::milliseconds))),
        format!("floor        {}", passes(&summary.floor_bytes, |bytes| human::bytes(*bytes as u64))),
        format!(
            "memory       {} on the GPU, {} of the model resident",
            human::bytes(summary.gpu_bytes_peak),
            human::bytes(summary.resident_bytes_peak)
        ),
    ];
    if flight.live {
        lines.extend(describe_live(summary));
    }
    lines.push(format!(
        "index hash   {}",
        if flight.index_hash.is_empty() { "-" } else { &flight.index_hash }
    ));
    lines.join("\n")
}

/// What a flight that does not wait for the disk also shows: how soon there was something to look at.
fn describe_live(summary: &Summary) -> [String; 3] {
    let after = |ms: Option<f64>| {
        ms.map_or("not reached".to_owned(), |ms| format!("after {} ms", human::milliseconds(ms)))
    };
    [
        format!(
            "opened       in {} ms; nine tenths of the picture {}",
            human::milliseconds(summary.flight.open_ms),
            after(summary.first_picture_ms)
        ),
        format!("detail       half {}, all {}", after(summary.half_detail_ms), after(summary.full_detail_ms)),
        format!(
            "disk         {} read; {} major page faults on the thread that draws",
            human::bytes(summary.disk_bytes_total),
            human::count(summary.major_faults_total)
        ),
    ]
}

/// The passes with a figure each, in the order of the frame.
fn passes<T>(figures: &BTreeMap<String, T>, text: impl Fn(&T) -> String) -> String {
    let passes = FrameRecord::default().passes().map(|(pass, ..)| pass);
    let told = passes.into_iter().filter_map(|pass| Some(format!("{pass} {}", text(figures.get(pass)?))));
    told.collect::<Vec<_>>().join(", ")
}
