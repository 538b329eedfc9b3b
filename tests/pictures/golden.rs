//! Golden pictures: three models at three budgets, and the creases of a fourth, in `tests/golden/pictures`.
//!
//! They pin what every earlier test leaves open: that today's picture is yesterday's. A change of the bake or of the light
//! changes them; look at the new ones, then write them by `COLLAPSAR_BLESS=1 cargo test --test pictures golden`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use collapsar::gpu::Gpu;
use glam::DQuat;
use image::RgbImage;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};

use crate::common::metric::{Difference, Tolerance, enlarged};
use crate::subjects::{BRACKET, BUNDLED, Shot, Subject};
use crate::{gpu, save};

const SHOT: Shot = Shot { width: 320, height: 180 };

/// What the same mesh may differ by on another driver: where samples lie, how edges and derivatives are rounded. A
/// shift by 1/64 of a pixel, four steps of the grid that rasterisers snap to, is within it: measured 0.9959, 0.27, 3.9.
const DRIVERS: Tolerance = Tolerance { score: 0.993, mean: 0.4, worst_tile: 6.0 };

/// Budgets: all vertices, a third, a tenth.
const BUDGETS: [(&str, u32); 3] = [("full", 1), ("third", 3), ("tenth", 10)];

fn picture(gpu: &Arc<Gpu>, subject: &Subject, divisor: u32) -> RgbImage {
    subject.picture(gpu, &subject.still(), subject.placed_vertices() / divisor, SHOT).0
}

fn golden_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/pictures").join(format!("{name}.png"))
}

/// Writes a picture as small as PNG makes it.
fn bless(picture: &RgbImage, path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let file = std::fs::File::create(path).unwrap();
    let encoder = PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive);
    picture.write_with_encoder(encoder).unwrap();
}

/// Compares with the golden picture; what is wrong, with the places of the pictures.
fn check(name: &str, picture: &RgbImage) -> Result<(), String> {
    let path = golden_path(name);
    let golden = image::open(&path).map_err(|error| format!("{error}: {}", path.display()))?.into_rgb8();
    if golden.dimensions() != picture.dimensions() {
        return Err(format!("has another size: {}", path.display()));
    }
    let difference = Difference::between(&golden, picture);
    if difference.is_within(&DRIVERS) {
        return Ok(());
    }
    let actual = save(picture, &format!("{name}_actual.png"));
    let enlarged = save(&enlarged(&golden, picture), &format!("{name}_difference.png"));
    Err(format!(
        "{name}: {difference:.4?}\n  golden {}\n  actual {}\n  difference, eight times enlarged {}",
        path.display(),
        actual.display(),
        enlarged.display()
    ))
}

#[test]
fn golden_pictures_are_met() {
    let Some(gpu) = gpu("pictures: golden") else { return };
    let mut wrong = Vec::new();
    for subject in BUNDLED.iter() {
        for (word, divisor) in BUDGETS {
            let name = format!("{}_{word}", subject.name);
            let picture = picture(&gpu, subject, divisor);
            if std::env::var_os("COLLAPSAR_BLESS").is_some() {
                bless(&picture, &golden_path(&name));
            }
            wrong.extend(check(&name, &picture).err());
        }
    }
    let hint = "if that is intended, look at them and set COLLAPSAR_BLESS=1";
    assert!(wrong.is_empty(), "{} of 9 differ; {hint}:\n{}", wrong.len(), wrong.join("\n"));
}

/// The creases of a block at a quarter of its vertices.
#[test]
fn golden_creases_are_met() {
    let Some(gpu) = gpu("pictures: golden creases") else { return };
    let picture = picture(&gpu, &BRACKET, 4);
    if std::env::var_os("COLLAPSAR_BLESS").is_some() {
        bless(&picture, &golden_path("bracket_quarter"));
    }
    check("bracket_quarter", &picture).unwrap();
}

#[test]
fn a_shift_by_a_sixty_fourth_of_a_pixel_is_within_the_tolerance_for_drivers() {
    let Some(gpu) = gpu("pictures: shifted") else { return };
    for subject in BUNDLED.iter() {
        let mut camera = subject.still();
        let plain = subject.picture(&gpu, &camera, u32::MAX, SHOT).0;
        let turn = 1.0 / 64.0 / f64::from(camera.focal_px(SHOT.height));
        camera.world_from_view *= DQuat::from_rotation_y(turn) * DQuat::from_rotation_x(turn);
        let shifted = subject.picture(&gpu, &camera, u32::MAX, SHOT).0;
        let difference = Difference::between(&plain, &shifted);
        assert!(difference.mean > 0.0, "{}: nothing was shifted", subject.name);
        assert!(difference.is_within(&DRIVERS), "{}: {difference:.4?}", subject.name);
    }
}

#[test]
fn pictures_that_show_their_loss_are_beyond_the_tolerance_for_drivers() {
    let Some(gpu) = gpu("pictures: golden against other budgets") else { return };
    // The generated model loses least: at a tenth one has to look twice.
    for (subject, divisor) in BUNDLED.iter().zip([10, 10, 40]) {
        let [full, lossy] = [1, divisor].map(|divisor| picture(&gpu, subject, divisor));
        let difference = Difference::between(&full, &lossy);
        assert!(!difference.is_within(&DRIVERS), "{}: {difference:.4?}", subject.name);
    }
}
