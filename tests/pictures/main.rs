//! What is drawn of a container, against its input drawn directly, and against golden pictures.
//!
//! [`direct`] draws what was imported, [`subjects`] bakes and renders it, [`metric`] says how alike two pictures are.
//! Pictures and the report go to `target/pictures`; `COLLAPSAR_BLESS=1` writes the golden pictures anew.

#![expect(clippy::unwrap_used, reason = "a test may end where its set-up fails")]

mod against_input;
#[path = "../common/mod.rs"]
mod common;
mod direct;
mod golden;
mod metric;
mod subjects;
mod workbench;

use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use collapsar::gpu::{Gpu, GpuError, GpuOptions, testing};
use image::RgbImage;

/// The one device of all tests, or `None` where the environment says that this machine has none.
fn gpu(test: &str) -> Option<Arc<Gpu>> {
    static GPU: LazyLock<Result<Arc<Gpu>, GpuError>> =
        LazyLock::new(|| Gpu::new(&GpuOptions::default()).map(Arc::new));
    match &*GPU {
        Ok(gpu) => {
            let info = &gpu.adapter_info;
            let adapter = format!("{} ({} {})", info.name, info.backend, info.driver_info);
            testing::log_run(test, Some(&adapter));
            Some(Arc::clone(gpu))
        }
        Err(_) if std::env::var(testing::NO_GPU_VARIABLE).is_ok_and(|value| value == "1") => {
            eprintln!("skipped: {test}: {}=1", testing::NO_GPU_VARIABLE);
            testing::log_run(test, None);
            None
        }
        Err(error) => {
            panic!("{test} needs a GPU adapter; set {}=1 if there is none: {error}", testing::NO_GPU_VARIABLE)
        }
    }
}

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
