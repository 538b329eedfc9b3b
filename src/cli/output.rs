//! Files that appear whole or not at all, and folders for them.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Failure;

/// Makes the output folder if its parent exists.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    if folder.is_dir() {
        return Ok(());
    }
    std::fs::create_dir(folder).map_err(|cause| Failure::Output {
        doing: "make the output folder (its parent must exist)",
        cause,
        path: folder.to_owned(),
    })
}

/// Writes a file through a temporary one beside it, so that it is never half there.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let failed = |cause| Failure::Output { doing: "write", cause, path: path.to_owned() };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".collapsar-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder).map_err(failed)?;
    let mut out = std::io::BufWriter::new(file.as_file());
    write(&mut out).and_then(|()| out.flush()).map_err(failed)?;
    drop(out);
    file.persist(path).map_err(|refused| failed(refused.error))?;
    Ok(())
}

/// Writes a value as indented JSON.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Failure> {
    write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

/// Prints a value as indented JSON.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    print_text(&serde_json::to_string_pretty(value).map_err(|error| Failure::Output {
        doing: "write JSON",
        cause: error.into(),
        path: PathBuf::from("standard output"),
    })?)
}

/// Prints text and a line feed; a closed pipe is an error like any other, and no panic.
pub fn print_text(text: &str) -> Result<(), Failure> {
    writeln!(std::io::stdout().lock(), "{text}").map_err(|cause| Failure::Output {
        doing: "write",
        cause,
        path: PathBuf::from("standard output"),
    })
}
