//! `collapsar export`: a container and a level of detail in, an ordinary mesh out.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use collapsar::export::{ExportError, Level, Mesh, level_of_detail};
use collapsar::scene::SceneError;
use collapsar::scene::mapped::MappedFile;
use collapsar::stats::report::human;

use super::output::Kind;
use super::{Failure, output, values};

/// Arguments of `export`.
#[derive(Debug, Args)]
#[command(
    group = ArgGroup::new("level").required(true),
    after_help = "Examples:\n  \
        collapsar export engine.clps --ratio 0.1 -o engine_tenth.glb\n  \
        collapsar export engine.clps --part crankshaft --vertices 500 -o crankshaft.obj\n\n\
        --vertices is for each part; every part is written at the finest state with at most so many.")]
pub struct ExportArguments {
    /// The container.
    file: PathBuf,
    /// Only the parts of this name, in their own space; without it, the whole assembly in place.
    #[arg(long, value_name = "NAME")]
    part: Option<String>,
    /// At most so many vertices a part (but no fewer than its coarsest state has).
    #[arg(long, group = "level", value_name = "N", value_parser = values::count)]
    vertices: Option<u32>,
    /// The coarsest sampled state whose error is at most this, in the unit of the part's own space.
    #[arg(long, group = "level", value_name = "LENGTH", value_parser = values::positive)]
    error: Option<f64>,
    /// This share of every part's triangles.
    #[arg(long, group = "level", value_name = "SHARE", value_parser = values::ratio)]
    ratio: Option<f64>,
    /// The mesh to write: .obj or .glb.
    #[arg(short, long, value_name = "OUT.obj|OUT.glb")]
    output: PathBuf,
}

/// What makes the bytes of a mesh.
type Writer = fn(&Mesh, &mut dyn std::io::Write) -> std::io::Result<()>;

/// Runs `export`.
pub fn run(arguments: &ExportArguments) -> Result<(), Failure> {
    let (kind, write): (Kind, Writer) = match output::extension(&arguments.output).as_str() {
        "obj" => (Kind::Obj, |mesh, out| mesh.write_obj(out)),
        "glb" => (Kind::Glb, |mesh, out| mesh.write_glb(out)),
        _ => {
            return Err(Failure::Argument(format!(
                "the output must end in .obj or .glb: {}",
                arguments.output.display()
            )));
        }
    };
    output::check_file(&arguments.output)?;
    output::check_kind(kind, std::slice::from_ref(&arguments.file), &arguments.output)?;
    let level = match (arguments.vertices, arguments.error, arguments.ratio) {
        (Some(vertices), _, _) => Level::Vertices(vertices),
        (_, Some(error), _) => Level::Error(error),
        (_, _, ratio) => Level::Ratio(ratio.unwrap_or(1.0)),
    };
    let file = MappedFile::open(&arguments.file).map_err(SceneError::from)?;
    let mesh =
        level_of_detail(file.bytes(), level, arguments.part.as_deref()).map_err(|error| match error {
            ExportError::Container(cause) => {
                SceneError::Container { cause, path: arguments.file.clone() }.into()
            }
            other => Failure::Argument(format!("{other}: {}", arguments.file.display())),
        })?;
    output::write_whole(&arguments.output, |out| write(&mesh, out))?;
    output::print_text(&format!(
        "{} vertices, {} triangles in {} meshes, placed {} times: {}",
        human::count(mesh.vertex_count() as u64),
        human::count(mesh.triangle_count() as u64),
        human::count(mesh.pieces.len() as u64),
        human::count(mesh.placements.len() as u64),
        arguments.output.display()
    ))
}
