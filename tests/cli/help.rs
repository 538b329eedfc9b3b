//! `--help` of every verb: each argument has its explanation, and there are examples that parse.

use crate::workplace::Workplace;

const VERBS: [&str; 9] = ["bake", "info", "verify", "export", "compare", "fly", "synth", "bandwidth", "demo"];

fn help(arguments: &[&str]) -> String {
    let outcome = Workplace::new().run(arguments).succeeded();
    assert_eq!(outcome.err, "");
    outcome.out
}

#[test]
fn help_lists_every_verb_with_an_explanation_and_examples() {
    for flag in ["--help", "-h", "help"] {
        let text = help(&[flag]);
        for verb in VERBS {
            let line = text.lines().find(|line| line.trim_start().starts_with(&format!("{verb} "))).unwrap();
            assert!(line.split_whitespace().count() > 4, "{line}");
        }
        for word in ["Examples:", "Environment:", "COLLAPSAR_ADAPTER", "COLLAPSAR_LOG"] {
            assert!(text.contains(word), "{flag}: no {word}");
        }
    }
}

#[test]
fn every_verb_explains_every_argument() {
    for verb in VERBS {
        // The long help has each argument on a line of its own and the explanation on the next.
        let text = help(&[verb, "--help"]);
        let lines: Vec<&str> = text.lines().collect();
        let arguments =
            lines.iter().enumerate().filter(|(_, line)| is_argument(line) && !line.contains("--help"));
        let mut count = 0;
        for (at, line) in arguments {
            let here = line.trim_start().split_once("  ").map_or(0, |(_, rest)| rest.trim().len());
            let below = lines.get(at + 1).map_or(0, |next| next.trim().len());
            assert!(here.max(below) > 8, "{verb}: {line:?} is not explained");
            count += 1;
        }
        assert!(count >= 1, "{verb}: {count} arguments");
    }
}

/// `  -o, --output <OUT.clps>`, `      --json`, `  <FILE>`; not the wrapped text below them.
fn is_argument(line: &str) -> bool {
    let indent = line.len() - line.trim_start().len();
    (2..=6).contains(&indent) && line.trim_start().starts_with(['-', '<', '['])
}

#[test]
fn every_verb_has_its_arguments() {
    for (verb, words) in [
        ("bake", &["INPUT", "--output", "--json", "--boundary", "--threads", "--crease"] as &[&str]),
        ("info", &["FILE", "--json", "--parts"]),
        ("verify", &["FILE"]),
        ("export", &["FILE", "--part", "--vertices", "--error", "--ratio", "--output"]),
        (
            "compare",
            &[
                "ORIGINAL",
                "FILE",
                "--ratios",
                "--samples",
                "--least-triangles",
                "--plot",
                "--no-meshoptimizer",
                "--csv",
                "--json",
            ],
        ),
        (
            "fly",
            &[
                "FILE",
                "--path",
                "orbit|walk|through|still|teleport|FILE.json",
                "--frames",
                "--budget",
                "--strategy",
                "coherent",
                "whole",
                "per-part",
                "--compare",
                "--size",
                "--select",
                "cpu",
                "gpu",
                "--defragment",
                "rebuild",
                "--reference",
                "--png",
                "--out",
                "--json",
                "--samples",
            ],
        ),
        (
            "synth",
            &[
                "--triangles",
                "--parts",
                "--instances",
                "--seed",
                "--layout",
                "airplane",
                "ship",
                "plant",
                "--output",
                "--as",
                "clps",
                "glb",
                "obj",
                "--threads",
                "--json",
            ],
        ),
        ("demo", &["--datasets", "--out", "--frames", "--size"]),
    ] {
        let text = help(&[verb, "--help"]);
        for word in words {
            assert!(text.contains(word), "{verb} --help: no {word}");
        }
    }
}

#[test]
fn every_example_names_verbs_and_flags_that_exist() {
    let pages =
        [&["--help"] as &[&str]].into_iter().map(help).chain(VERBS.map(|verb| help(&[verb, "--help"])));
    let mut examples = 0;
    for page in pages {
        let (_, after) = page.split_once("Example").expect("every page has examples");
        for line in after.lines().filter_map(|line| line.trim_start().strip_prefix("collapsar ")) {
            // Two blanks part the example from its explanation.
            let words: Vec<&str> = line.split("  ").next().unwrap().split_whitespace().collect();
            let verb_page = help(&[words[0], "--help"]);
            for flag in words.iter().filter(|word| word.starts_with('-')) {
                assert!(
                    verb_page.contains(&format!("{flag} "))
                        || verb_page.contains(&format!("{flag}\n"))
                        || verb_page.contains(&format!("{flag},")),
                    "{line}: no {flag}"
                );
            }
            examples += 1;
        }
    }
    assert!(examples >= 10, "{examples} examples");
}

#[test]
fn the_version_is_that_of_the_package() {
    assert_eq!(help(&["--version"]), format!("collapsar {}\n", env!("CARGO_PKG_VERSION")));
}
