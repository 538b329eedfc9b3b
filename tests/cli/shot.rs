//! `shot`: pictures from every side, cut and coloured, and what it cannot be asked for; `view` without a display.

use crate::workplace::{Workplace, has_gpu, names};

const CUBE: &str = "o cube\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n\
    f 1 3 2\nf 2 3 4\nf 5 6 7\nf 6 8 7\nf 1 2 5\nf 2 6 5\nf 3 7 4\nf 4 7 8\nf 1 5 3\nf 3 5 7\nf 2 4 6\nf 4 8 6\n\
    o pin\nv 3 0 0\nv 4 0 0\nv 3 1 0\nf 9 10 11\n";

fn size_of(workplace: &Workplace, name: &str) -> (u32, u32) {
    image::image_dimensions(workplace.path(name)).unwrap()
}

/// How many pixels differ clearly.
fn difference(workplace: &Workplace, a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|name| image::open(workplace.path(name)).unwrap().to_rgb8());
    a.pixels().zip(b.pixels()).filter(|(a, b)| (0..3).any(|c| a[c].abs_diff(b[c]) > 12)).count()
}

#[test]
fn a_model_is_baked_beside_itself_and_shown_from_every_side() {
    if !has_gpu("a_model_is_baked_beside_itself_and_shown_from_every_side") {
        return;
    }
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    workplace.run(&["shot", "cube.obj", "--size", "160x120", "-o", "iso.png"]).succeeded();
    assert_eq!(size_of(&workplace, "iso.png"), (160, 120));
    let baked = workplace.read("cube.obj.clps");
    for (arguments, picture) in [
        (&["--view", "front"][..], "front.png"),
        (&["--view", "top", "--parallel"], "top.png"),
        (&["--section", "x=10%", "--section=-y=0.5"], "cut.png"),
        (&["--section-box", "10%,10%,10%,50%,50%,50%"], "box.png"),
        (&["--colour-by", "part"], "parts.png"),
        (&["--edges", "features"], "edges.png"),
        (&["--edges", "all", "--depth-cue", "0"], "wire.png"),
        (&["--hide", "PIN"], "hidden.png"),
        (&["--isolate", "pin", "--fit", "isolated"], "isolated.png"),
        (&["--ghost", "cube"], "ghost.png"),
        (&["--select", "pin"], "selected.png"),
        (&["--up", "z", "--fov", "20"], "up.png"),
        (&["--camera", "{\"frame\":0,\"eye\":[9,5,9],\"target\":[1,0,0]}"], "camera.png"),
    ] {
        let all = [&["shot", "cube.obj", "--size", "160x120", "-o", picture], arguments].concat();
        workplace.run(&all).succeeded();
        assert!(difference(&workplace, "iso.png", picture) > 20, "{arguments:?} changed nothing");
    }
    assert_eq!(workplace.read("cube.obj.clps"), baked, "an unchanged model was baked again");
}

#[test]
fn a_picture_of_nothing_is_written_and_said_to_be_one() {
    if !has_gpu("a_picture_of_nothing_is_written_and_said_to_be_one") {
        return;
    }
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    let shot = ["shot", "cube.obj", "--size", "160x120", "-o", "picture.png"];
    let says_so = |arguments: &[&str]| {
        let ended = workplace.run(&[&shot[..], arguments].concat()).succeeded();
        assert_eq!(size_of(&workplace, "picture.png"), (160, 120));
        ended.err.contains("nothing in the picture")
    };
    assert!(!says_so(&[]));
    assert!(says_so(&["--section", "x=200%"]));
    assert!(says_so(&["--hide", "cube", "--hide", "pin"]));
}

#[test]
fn a_turntable_goes_once_round() {
    if !has_gpu("a_turntable_goes_once_round") {
        return;
    }
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    workplace.bake("cube.obj", "cube.clps");
    let shot = ["shot", "cube.clps", "--size", "96x64", "--colour-by", "part", "--parallel"];
    let turntable = [&shot[..], &["--turntable", "4", "--view", "front", "-o", "turn.png"]].concat();
    let outcome = workplace.run(&turntable).succeeded();
    assert!(
        outcome.out.starts_with("4 pictures, ") && outcome.out.ends_with("turn-003.png\n"),
        "{outcome:?}"
    );
    let pictures = ["turn-000.png", "turn-001.png", "turn-002.png", "turn-003.png"];
    assert_eq!(names(&workplace.path("")), [&["cube.clps", "cube.obj"][..], &pictures].concat());
    for picture in pictures {
        assert_eq!(size_of(&workplace, picture), (96, 64));
    }
    // The longest side fills the picture; from the side the model is as large, and so smaller in it.
    let front = [&shot[..], &["--view", "front", "-o", "front.png"]].concat();
    workplace.run(&front).succeeded();
    assert_eq!(difference(&workplace, "front.png", "turn-000.png"), 0);
    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)] {
        let [a, b] = [a, b].map(|i: usize| pictures[i]);
        assert!(difference(&workplace, a, b) > 20, "{a} and {b} are the same");
    }
    // Nowhere does the model leave the picture.
    for picture in pictures {
        let picture = image::open(workplace.path(picture)).unwrap().to_rgb8();
        let corner = *picture.get_pixel(0, 32);
        let is_background =
            |x: u32, y: u32| (0..3).all(|c| picture.get_pixel(x, y)[c].abs_diff(corner[c]) < 40);
        assert!((20..44).all(|y| is_background(0, y) && is_background(95, y)));
    }
    workplace.refuses(&["shot", "cube.clps", "--turntable", "0", "-o", "a.png"], &["turntable"]);
    workplace.fails(&["shot", "cube.clps", "--turntable", "3", "-o", "nowhere/a.png"], &["nowhere"]);
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_written() {
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    workplace.bake("cube.obj", "cube.clps");
    for (arguments, words) in [
        (&["--section", "w=3"][..], "must be x, y or z"),
        (&["--section", "x"], "must be x, y or z"),
        (&["--section-box", "1,2,3"], "six numbers"),
        (&["--size", "0x5"], "width x height"),
        (&["--fov", "180"], "from 1 to 170"),
        (&["--depth-cue", "3"], "from 0 to 2"),
        (&["--view", "above"], "invalid value"),
        (&["--camera", "{}", "--view", "top"], "cannot be used with"),
    ] {
        let all = [&["shot", "cube.clps", "-o", "out.png"], arguments].concat();
        workplace.refuses(&all, &[words]);
    }
}

#[test]
fn what_cannot_be_done_is_said_in_a_line() {
    if !has_gpu("what_cannot_be_done_is_said_in_a_line") {
        return;
    }
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    workplace.bake("cube.obj", "cube.clps");
    workplace.write("broken.clps", "no container at all");
    workplace.write("keys.json", "[]");
    for (arguments, words) in [
        (&["shot", "missing.clps", "-o", "a.png"][..], "missing.clps"),
        (&["shot", "broken.clps", "-o", "a.png"], "broken.clps"),
        (&["shot", ".", "-o", "a.png"], "directory"),
        (&["shot", "cube.clps", "-o", "no/folder.png"], "folder does not exist"),
        (&["shot", "cube.clps", "--hide", "wheel", "-o", "a.png"], "is called `wheel`"),
        (&["shot", "cube.clps", "--camera", "{\"frame\":0}", "-o", "a.png"], "missing field"),
        (&["shot", "cube.clps", "--camera", "keys.json", "-o", "a.png"], "keys.json"),
        (&["shot", "cube.clps", "--size", "99999x9", "-o", "a.png"], "not possible"),
        (
            &[
                "shot",
                "cube.clps",
                "-o",
                "a.png",
                "--section",
                "x=1",
                "--section",
                "x=1",
                "--section",
                "x=1",
                "--section",
                "x=1",
                "--section",
                "x=1",
                "--section",
                "x=1",
                "--section",
                "x=1",
            ],
            "at most 6",
        ),
    ] {
        workplace.fails(arguments, &[words]);
    }
}

#[cfg(feature = "viewer")]
#[test]
fn without_a_display_view_says_so() {
    let workplace = Workplace::new();
    workplace.write("cube.obj", CUBE);
    let nowhere = [("DISPLAY", ""), ("WAYLAND_DISPLAY", ""), ("WAYLAND_SOCKET", "")];
    for arguments in [&["view"][..], &["view", "cube.obj"], &["cube.obj"]] {
        workplace.run_with(arguments, &nowhere).failed(&["no window can be opened", "shot"]);
    }
}
