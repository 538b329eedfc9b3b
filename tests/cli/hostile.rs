//! Every hostile model at hand: it bakes or is refused in one line, soon; what it bakes to is sound and can be flown.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::common::datasets;
use crate::workplace::{Workplace, has_gpu};

/// For a bake, a check or a brief flight.
const TIME_LIMIT: Duration = Duration::from_secs(20);

/// The hostile models that `bake` reads; none, with a word, where there are no models.
fn models() -> Vec<PathBuf> {
    let Some(folder) = datasets() else { return Vec::new() };
    let Ok(entries) = std::fs::read_dir(folder.join("hostile")) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut models: Vec<PathBuf> = paths.filter(|path| known(path)).collect();
    models.sort();
    models
}

fn known(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| ["obj", "glb", "gltf", "ply", "stl"].iter().any(|&known| extension == known))
}

fn in_time<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = work();
    assert!(started.elapsed() < TIME_LIMIT, "{what}: {:?}", started.elapsed());
    result
}

/// Bakes a model to `out.clps`; whether there is one then. A refusal is one line that names the file.
fn bakes(place: &Workplace, model: &Path) -> bool {
    let name = model.to_str().unwrap();
    let before = place.snapshot();
    let outcome = in_time(name, || place.run(&["bake", name, "-o", "out.clps"]));
    if outcome.code == Some(0) {
        return true;
    }
    outcome.failed(&[name]);
    place.assert_unchanged(&before);
    false
}

#[test]
fn every_hostile_model_bakes_to_a_sound_container_or_is_refused() {
    let models = models();
    let mut sound = 0;
    for model in &models {
        let place = Workplace::new();
        if bakes(&place, model) {
            in_time("verify", || place.verify("out.clps"));
            place.run(&["info", "out.clps", "--json", "--parts"]).succeeded().json();
            sound += 1;
        }
    }
    // At least those that their own description calls valid or loadable.
    assert!(models.is_empty() || sound >= 15, "{sound} of {} models bake", models.len());
}

#[test]
fn every_hostile_model_that_bakes_can_be_flown() {
    if !has_gpu("cli::hostile::every_hostile_model_that_bakes_can_be_flown") {
        return;
    }
    for model in models() {
        let place = Workplace::new();
        if bakes(&place, &model) {
            let summary = in_time(model.to_str().unwrap(), || place.fly_briefly("out.clps"));
            assert!(summary["frame_ms_p99"].as_f64().is_some_and(f64::is_finite), "{}", model.display());
        }
    }
}

#[test]
fn every_hostile_model_that_bakes_can_be_exported_and_baked_again() {
    for model in models() {
        let place = Workplace::new();
        if !bakes(&place, &model) {
            continue;
        }
        for (output, ratio) in [("half.obj", "0.5"), ("half.glb", "0.5"), ("tenth.obj", "0.1")] {
            let export = ["export", "out.clps", "--ratio", ratio, "-o", output];
            in_time(output, || place.run(&export)).succeeded();
            assert!(bakes(&place, &place.path(output)), "{} of {}", output, model.display());
        }
    }
}
