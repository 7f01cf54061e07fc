//! Each effect that the program has is a crate with a README, a lesson that uses it, and a section with a picture of it; its twin
//! is compared in `twins.rs`.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All scripts below a folder.
fn scripts(folder: &Path, out: &mut Vec<String>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            scripts(&path, out);
        } else if path.extension().is_some_and(|e| e == "rhai") {
            out.push(std::fs::read_to_string(&path).unwrap());
        }
    }
}

/// What an effect lacks.
fn lacks(name: &str, lessons: &[String], suite: &[String]) -> Vec<&'static str> {
    let call = format!("effect(\"{name}\"");
    let readme = root().join("plugins").join(format!("effect-{}", name.replace('_', "-"))).join("README.md");
    let mut out = Vec::new();
    if !std::fs::read_to_string(readme).is_ok_and(|text| text.contains(&call)) {
        out.push("a README that says how it is called");
    }
    if !lessons.iter().any(|text| text.contains(&call)) {
        out.push("a lesson");
    }
    let sections = suite.iter().flat_map(|text| text.split("\ntest(").skip(1));
    if !sections.clone().any(|s| s.contains(&call) && s.contains("expect_picture(")) {
        out.push("a section with a picture");
    }
    out
}

#[test]
fn every_effect_has_a_readme_a_lesson_and_a_picture() {
    let (mut lessons, mut suite) = (Vec::new(), Vec::new());
    scripts(&root().join("scripts"), &mut lessons);
    scripts(&root().join("tests/suite"), &mut suite);
    let registry = choreo::registry();
    // Those of the script's own folder are not the program's; the example is there to be copied.
    let names: Vec<String> =
        registry.effects().iter().map(|e| e.manifest().name.clone()).filter(|n| *n != "example").collect();
    assert!(names.len() >= 14, "{names:?}");
    for name in &names {
        assert_eq!(lacks(name, &lessons, &suite), Vec::<&str>::new(), "{name}");
    }
    assert_eq!(lacks("sparkle", &lessons, &suite).len(), 3, "what is not there is found");
}
