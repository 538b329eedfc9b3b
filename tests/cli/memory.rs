//! `bake --memory` on models that are larger than the memory they may take.

use crate::workplace::Workplace;

/// Bakes a made model, which is larger than the cap, with and without one.
#[track_caller]
fn bakes_the_same_within_a_cap(name: &str, triangles: &str, cap_bytes: u64) {
    let place = Workplace::new();
    place.run(&["synth", "-o", name, "--triangles", triangles, "--parts", "4k"]).succeeded();
    assert!(place.path(name).metadata().unwrap().len() > cap_bytes, "{name} is no larger than the cap");
    let bake = |output: &str, more: &[&str]| {
        let arguments = ["bake", name, "-o", output, "--json", "--threads", "2"];
        let report = place.run(&[&arguments, more].concat()).succeeded().json();
        (place.read(output), report["peak_rss_bytes"].as_u64())
    };
    let (capped, peak) = bake("capped.clps", &["--memory", &cap_bytes.to_string()]);
    let (free, _) = bake("free.clps", &[]);
    assert!(capped == free, "{name}: other bytes under a cap");
    if cfg!(target_os = "linux") {
        let peak = peak.unwrap();
        assert!(peak <= cap_bytes, "{name}: {peak} of {cap_bytes} bytes");
    }
}

#[test]
fn an_obj_larger_than_the_memory_bakes_to_the_same_bytes() {
    bakes_the_same_within_a_cap("model.obj", "600k", 60_000_000);
}

#[test]
fn a_glb_larger_than_the_memory_bakes_to_the_same_bytes() {
    bakes_the_same_within_a_cap("model.glb", "2.5M", 60_000_000);
}
