//! Each built-in effect has a README, a sample with its image, a lesson that uses it, and a test section with an image of it.
//! `cpu_reference.rs` compares the renderers. `CHOREO_ACCEPT=1` updates the images of the samples.

use choreo_image_diff::compare;
use choreo_plugin::Frame;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All scripts in a folder and its subfolders.
fn collect_scripts(folder: &Path, out: &mut Vec<String>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            collect_scripts(&path, out);
        } else if path.extension().is_some_and(|e| e == "rhai") {
            out.push(std::fs::read_to_string(&path).unwrap());
        }
    }
}

/// The documents and tests that are missing for an effect.
fn missing_documents(name: &str, lessons: &[String], suite: &[String]) -> Vec<&'static str> {
    let call = format!("effect(\"{name}\"");
    let readme = root().join("plugins/effects").join(name).join("README.md");
    let mut out = Vec::new();
    if !std::fs::read_to_string(readme).is_ok_and(|text| text.contains(&call)) {
        out.push("a README that says how it is called");
    }
    if !lessons.iter().any(|text| text.contains(&call)) {
        out.push("a lesson");
    }
    let sections = suite.iter().flat_map(|text| text.split("\ntest(").skip(1));
    if !sections.clone().any(|s| s.contains(&call) && s.contains("expect_image(")) {
        out.push("a section with an image");
    }
    out
}

#[test]
fn every_effect_has_a_readme_a_lesson_and_a_test_image() {
    let (mut lessons, mut suite) = (Vec::new(), Vec::new());
    collect_scripts(&root().join("scripts"), &mut lessons);
    collect_scripts(&root().join("tests/suite"), &mut suite);
    let registry = choreo::registry();
    // Effects in the folder of the script are not built in; the example exists to be copied.
    let names: Vec<String> =
        registry.effects().iter().map(|e| e.manifest().name.clone()).filter(|n| *n != "example").collect();
    assert!(names.len() >= 14, "{names:?}");
    for name in &names {
        assert_eq!(missing_documents(name, &lessons, &suite), Vec::<&str>::new(), "{name}");
    }
    assert_eq!(missing_documents("sparkle", &lessons, &suite).len(), 3, "what is not there is found");
}

/// The image of a script at 0.5 s, drawn by the CPU renderer.
fn draw_sample(script: &Path, out: &Path) -> Frame {
    let mut command = Command::new(env!("CARGO_BIN_EXE_choreo"));
    command.args(["render", "--device", "cpu", "--at", "0.5", "-o"]).arg(out).arg(script);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    read_image(out).unwrap()
}

fn read_image(file: &Path) -> Option<Frame> {
    let picture = image::open(file).ok()?.to_rgba8();
    Some(Frame { width: picture.width(), height: picture.height(), rgba: picture.into_raw() })
}

#[test]
fn every_sample_shows_its_effect() {
    let folder = tempfile::tempdir().unwrap();
    let accept = std::env::var_os("CHOREO_ACCEPT").is_some();
    let registry = choreo::registry();
    for effect in registry.effects().iter().filter(|e| e.manifest().name != "example") {
        let name = &effect.manifest().name;
        let own = root().join("plugins/effects").join(name);
        let (script, picture) = (own.join("sample.rhai"), own.join("sample.png"));
        let readme = std::fs::read_to_string(own.join("README.md")).unwrap();
        assert!(readme.contains("](sample.png)") && readme.contains("(sample.rhai)"), "README of {name}");
        let got = draw_sample(&script, &folder.path().join("got.png"));
        if accept {
            std::fs::copy(folder.path().join("got.png"), &picture).unwrap();
        }
        let expected = read_image(&picture).unwrap_or_else(|| panic!("no {}", picture.display()));
        let off = compare(&got, &expected, 2).unwrap();
        assert!(off.share_beyond < 0.001, "{name}: {off:?}");
        // Without the effect the image must be different.
        let text = std::fs::read_to_string(&script).unwrap();
        let call = format!("effect(\"{name}\"");
        let rest: Vec<&str> = text.lines().filter(|line| !line.starts_with(&call)).collect();
        assert!(rest.len() < text.lines().count(), "{name}");
        let without = folder.path().join("without.rhai");
        std::fs::write(&without, rest.join("\n")).unwrap();
        let plain = draw_sample(&without, &folder.path().join("without.png"));
        let seen = compare(&got, &plain, 2).unwrap();
        assert!(seen.share_beyond > 0.004, "{name} is hardly seen in its sample: {seen:?}");
    }
}
