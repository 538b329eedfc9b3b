//! A file that somebody wants to see in; the container to open, and whether it has yet to be baked, out.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::container::MAGIC;

/// What to open for a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Beside {
    /// The file is a container itself, or one that is not older lies beside it.
    Container(PathBuf),
    /// The container that is to be baked of it first.
    ToBake(PathBuf),
}

/// What to open for a file: itself if it begins as a container does, else the container of the same name with `.clps`
/// after it.
///
/// # Errors
/// The file cannot be read.
pub fn beside(file: &Path) -> io::Result<Beside> {
    let metadata = std::fs::metadata(file)?;
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    // To open a pipe would wait for its other end.
    if !metadata.is_file() {
        return Err(io::Error::other("it is not a file"));
    }
    let mut start = Vec::new();
    std::fs::File::open(file)?.take(MAGIC.len() as u64).read_to_end(&mut start)?;
    if start == MAGIC || file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("clps")) {
        return Ok(Beside::Container(file.to_owned()));
    }
    let container = container_beside(file);
    let age = |path: &Path| std::fs::metadata(path).and_then(|metadata| metadata.modified());
    let is_fresh = age(&container).is_ok_and(|made| metadata.modified().is_ok_and(|changed| changed <= made));
    Ok(if is_fresh { Beside::Container(container) } else { Beside::ToBake(container) })
}

/// The name of the container beside a model.
pub fn container_beside(model: &Path) -> PathBuf {
    let mut name = model.as_os_str().to_owned();
    name.push(".clps");
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containers_open_themselves_and_models_what_was_baked_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("any.name"), MAGIC).unwrap();
        assert_eq!(beside(&at("any.name")).unwrap(), Beside::Container(at("any.name")));
        std::fs::write(at("broken.clps"), "no container").unwrap();
        assert_eq!(beside(&at("broken.clps")).unwrap(), Beside::Container(at("broken.clps")));

        std::fs::write(at("a.obj"), "v 0 0 0").unwrap();
        assert_eq!(beside(&at("a.obj")).unwrap(), Beside::ToBake(at("a.obj.clps")));
        std::fs::write(at("a.obj.clps"), MAGIC).unwrap();
        assert_eq!(beside(&at("a.obj")).unwrap(), Beside::Container(at("a.obj.clps")));
        let later = std::time::SystemTime::now() + std::time::Duration::from_secs(5);
        std::fs::File::options().append(true).open(at("a.obj")).unwrap().set_modified(later).unwrap();
        assert_eq!(beside(&at("a.obj")).unwrap(), Beside::ToBake(at("a.obj.clps")));
        assert!(beside(&at("missing")).is_err() && beside(folder.path()).is_err());
    }
}
