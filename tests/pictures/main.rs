//! What is drawn of a container, against its input drawn directly, and against golden pictures.
//!
//! [`direct`] draws what was imported, [`subjects`] bakes and renders it, [`common::metric`] says how alike two pictures are.
//! Pictures and the report go to `target/pictures`; `COLLAPSAR_BLESS=1` writes the golden pictures anew.

#![expect(clippy::unwrap_used, reason = "a test may end where its set-up fails")]

mod against_input;
#[path = "../common/mod.rs"]
mod common;
mod direct;
mod golden;
mod subjects;
mod workbench;

use std::path::{Path, PathBuf};

use common::gpu;
use image::RgbImage;

/// Where pictures and reports go: `target/pictures`.
fn output() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/pictures");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn save(picture: &RgbImage, name: &str) -> PathBuf {
    let path = output().join(name);
    picture.save(&path).unwrap();
    path
}
