//! `collapsar view`: a window on a model.

use std::path::PathBuf;

use clap::Args;
use collapsar::viewer::{self, Mishaps, WindowOptions, WindowSummary};

use super::{Failure, output, values};

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    collapsar view plant.clps\n  \
    collapsar plant.clps                 the same\n  \
    collapsar view engine.glb            bakes engine.glb.clps beside it first\n  \
    collapsar view                       with nothing in it: drop a file\n\n\
    Settings are kept in the user's folder for settings, or in the folder that COLLAPSAR_CONFIG names. F1 lists the \
    keys, Ctrl+P all that can be done.")]
pub struct ViewArguments {
    /// The container, or a model to be baked.
    file: Option<PathBuf>,
    /// The window's size in pixels.
    #[arg(long, value_parser = values::size, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// Lose the window's surface once in so many layouts, to see that the viewer goes on.
    #[arg(long, default_value_t = 0, value_name = "LAYOUTS", hide_short_help = true)]
    lose_surface: u32,
    /// Lose the graphics device once in so many layouts.
    #[arg(long, default_value_t = 0, value_name = "LAYOUTS", hide_short_help = true)]
    lose_device: u32,
    /// Once the window is closed, print how long its loop took, as JSON.
    #[arg(long, hide_short_help = true)]
    json: bool,
}

impl ViewArguments {
    /// Those of `collapsar FILE`.
    pub fn of_file(file: PathBuf) -> Self {
        Self { file: Some(file), size: None, lose_surface: 0, lose_device: 0, json: false }
    }
}

/// Runs `view`.
pub fn run(arguments: &ViewArguments) -> Result<(), Failure> {
    let options = WindowOptions {
        file: arguments.file.clone(),
        size: arguments.size,
        mishaps: Mishaps { surface: arguments.lose_surface, device: arguments.lose_device },
    };
    let summary: WindowSummary =
        viewer::run(options).map_err(|error| Failure::Argument(error.to_string()))?;
    if arguments.json { output::print_json(&summary) } else { Ok(()) }
}
