//! A container or a model in, a container out: what has not been baked yet is, with progress.

use std::path::{Path, PathBuf};

use collapsar::bake::BakeOptions;
use collapsar::bake::beside::{Beside, beside};

use super::output::Kind;
use super::{Failure, bake, output};

/// The container of a file; a model is baked beside itself.
pub fn container_of(file: &Path) -> Result<PathBuf, Failure> {
    let found = beside(file).map_err(|cause| Failure::Output {
        doing: "open the model",
        cause,
        path: file.to_owned(),
    })?;
    let container = match found {
        Beside::Container(container) => return Ok(container),
        Beside::ToBake(container) => container,
    };
    let inputs = [file.to_owned()];
    output::check_kind(Kind::Container, &inputs, &container)?;
    bake::bake_with_progress(&inputs, &container, &BakeOptions::default())?;
    Ok(container)
}
