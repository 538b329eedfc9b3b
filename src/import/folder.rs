//! A reference in a file in, a path inside that file's own folder out, or a refusal.

use std::fs;
use std::path::{Path, PathBuf};

use super::Problem;
use super::notes::quoted;

/// Resolves a reference found in the file `from`.
///
/// Only a plain relative path is followed, and only to a regular file that really lies (links resolved) in
/// the folder of `from` or below. Backslashes count as slashes, so that a file means the same on every
/// system.
///
/// # Errors
///
/// [`Problem::Reference`] for anything else.
pub(super) fn resolve(from: &Path, reference: &str) -> Result<PathBuf, Problem> {
    let refuse = |why: &str| Problem::Reference { reference: quoted(reference), why: why.to_owned() };
    let relative =
        plain_relative(reference).ok_or_else(|| refuse("which is not inside the model's own folder"))?;
    let folder = match from.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let folder = fs::canonicalize(folder).map_err(Problem::Read)?;
    let path = fs::canonicalize(folder.join(relative)).map_err(|_| refuse("which does not exist"))?;
    if !path.starts_with(&folder) {
        return Err(refuse("which is not inside the model's own folder"));
    }
    // Opening a pipe or a device could block for ever.
    if path.is_file() { Ok(path) } else { Err(refuse("which is not a file")) }
}

/// The reference with slashes, if it has neither a root, a drive, a scheme nor a way up.
fn plain_relative(reference: &str) -> Option<String> {
    let slashed = reference.replace('\\', "/");
    let forbidden = |c: char| c == ':' || c.is_control();
    let climbs = slashed.split('/').any(|step| step == "..");
    (!slashed.is_empty() && !slashed.starts_with('/') && !climbs && !slashed.contains(forbidden))
        .then_some(slashed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn why(from: &Path, reference: &str) -> String {
        resolve(from, reference).unwrap_err().to_string()
    }

    #[test]
    fn references_never_leave_the_folder() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("model");
        fs::create_dir_all(inner.join("sub")).unwrap();
        fs::write(outer.path().join("secret"), "s").unwrap();
        fs::write(inner.join("sub/a b.bin"), "a").unwrap();
        let from = inner.join("x.gltf");
        assert!(resolve(&from, "sub/a b.bin").is_ok());
        assert!(resolve(&from, ".\\sub\\a b.bin").is_ok());
        let secret = outer.path().join("secret");
        for bad in ["../secret", "sub/../../secret", "..\\secret", secret.to_str().unwrap(), "", "a\0b"] {
            assert!(why(&from, bad).contains("not inside the model's own folder"), "{bad}");
        }
        for bad in ["file:///etc/passwd", "C:/x", "http://host/x"] {
            assert!(why(&from, bad).contains("not inside the model's own folder"), "{bad}");
        }
        assert!(why(&from, "none.bin").contains("which does not exist"));
        assert!(why(&from, "sub").contains("which is not a file"));
    }

    #[cfg(unix)]
    #[test]
    fn links_out_of_the_folder_are_refused() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("model");
        fs::create_dir(&inner).unwrap();
        fs::write(outer.path().join("secret"), "s").unwrap();
        std::os::unix::fs::symlink(outer.path().join("secret"), inner.join("link")).unwrap();
        assert!(why(&inner.join("x.obj"), "link").contains("not inside the model's own folder"));
    }
}
