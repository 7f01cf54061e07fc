//! Plugins that are single files beside a script: found, listed, used, hashed, and refused with their line.

mod common;

use common::*;
use std::path::Path;

const IMPORTER: &str = r#"
fn manifest() {
    #{ name: "dots", about: "corners of triangles", extensions: "dots", magic: "DOTS",
       options: #{ scale: #{ value: 1.0, min: 0.1, max: 10.0, about: "metres a unit" } } }
}

fn load(file) {
    let rest = file.bytes.part(4, file.bytes.len - 4);
    mesh(#{ name: "dots", positions: rest.numbers() * file.options.scale });
}
"#;

/// Exchanges red and blue.
const EFFECT: &str = "// effect: swap
// about: exchanges red and blue
// param amount = 1.0 in 0..1: how much
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    return mix(color, color.bgra, p[amount]);
}
";

const SCRIPT: &str = r##"
stage(#{ size: [32, 32], fps: 10, length: 0.1, background: "#ff0000", samples: 1 });
cast("a", load("a.dots", #{ scale: 2.0 }));
effect("swap");
camera("c").at(0.0, 0.0, 9.0).look_at([0.0, 0.0, 0.0]);
"##;

fn prepared() -> tempfile::TempDir {
    let dir = folder();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("plugins/dots.importer.rhai", IMPORTER);
    write("plugins/swap.wgsl", EFFECT);
    write("a.dots", "DOTS 0 0 0, 1 0 0, 0 1 0");
    write("s.rhai", SCRIPT);
    dir
}

fn good(dir: &Path, args: &[&str]) -> String {
    let run = choreo(dir, args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    run.out
}

#[test]
fn plugins_beside_a_script_are_listed_and_checked() {
    let dir = prepared();
    let out = good(dir.path(), &["plugins"]);
    assert!(out.contains("  dots         .dots          corners of triangles ("), "{out}");
    assert!(out.contains("      scale          metres a unit (0.1 to 10, default 1)"), "{out}");
    assert!(out.contains("swap.wgsl)"), "{out}");
    good(dir.path(), &["check", "s.rhai"]);
    // Of the files beside what is named, too; from the manifest alone.
    let out = good(dir.path(), &["info", "a.dots", "--help"]);
    assert!(out.contains("  dots\n      scale          metres a unit (0.1 to 10, default 1)"), "{out}");
    assert!(out.contains("      tolerance      degrees that a rotation may be off"), "{out}");
    let out = good(dir.path(), &["render", "--help"]);
    assert!(out.contains("Options of exporters") && out.contains("Limits, set with --limit"), "{out}");
    let out = good(dir.path(), &["plugins", "--for", "a.dots"]);
    assert!(out.starts_with("a.dots: read by dots\n  dots         by content, 90 of 100\n"), "{out}");
    let out = good(dir.path(), &["info", "a.dots", "--import", "scale=3"]);
    assert!(out.contains("size       3.000 × 3.000 × 0.000 m"), "{out}");
}

#[test]
fn an_effect_file_draws_the_same_on_the_cpu_and_on_vulkan() {
    let dir = prepared();
    good(dir.path(), &["render", "s.rhai", "-o", "cpu.png", "--at", "0", "--device", "cpu", "-q"]);
    let cpu = pixel(&read(dir.path(), "cpu.png"));
    assert_eq!(cpu, [0, 0, 255], "red has become blue");
    let run =
        choreo(dir.path(), &["render", "s.rhai", "-o", "gpu.png", "--at", "0", "--device", "vulkan", "-q"]);
    if run.code == 4 {
        println!("SKIP 1: no Vulkan driver");
        return;
    }
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(pixel(&read(dir.path(), "gpu.png")), cpu);
}

/// The first pixel of a PNG, red green blue.
fn pixel(png: &[u8]) -> [u8; 3] {
    let image = image::load_from_memory(png).unwrap().into_rgb8();
    image.get_pixel(0, 0).0
}

#[test]
fn a_broken_plugin_says_its_file_and_line() {
    let dir = prepared();
    std::fs::write(dir.path().join("plugins/bad.wgsl"), EFFECT.replace("color.bgra", "colr")).unwrap();
    std::fs::write(dir.path().join("plugins/bad.importer.rhai"), "fn manifest() {\n  let = 1;\n}").unwrap();
    for command in [&["check", "s.rhai"][..], &["plugins"]] {
        let run = choreo(dir.path(), command);
        assert_eq!(run.code, 1);
        assert!(run.err.contains("plugins/bad.wgsl:5:23: "), "{}", run.err);
        assert!(run.err.contains("plugins/bad.importer.rhai:2:7: "), "{}", run.err);
    }
    let out = choreo(dir.path(), &["plugins"]).out;
    assert!(out.contains("dots"), "what works is listed: {out}");
}

#[test]
fn an_error_in_an_importer_names_both_files() {
    let dir = prepared();
    std::fs::write(dir.path().join("a.dots"), "DOTS 0 0 zero").unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert_eq!(run.code, 1);
    let expected = "a.dots: plugins/dots.importer.rhai:9:43: numbers: \"zero\" is no number";
    assert!(run.err.contains(expected), "{}", run.err);
}

#[test]
fn only_named_folders_are_read() {
    let dir = prepared();
    std::fs::rename(dir.path().join("plugins"), dir.path().join("mine")).unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert!(run.code == 1 && run.err.contains("no importer knows this kind of file"), "{}", run.err);
    good(dir.path(), &["check", "s.rhai", "--plugins", "mine"]);
    let with_variable =
        command(dir.path(), &["check", "s.rhai"]).env("CHOREO_PLUGINS", "mine").output().unwrap();
    assert_eq!(finished(with_variable).code, 0);
    let run = choreo(dir.path(), &["check", "s.rhai", "--plugins", "nowhere"]);
    assert_eq!((run.code, run.err.lines().next()), (2, Some("--plugins nowhere: no such folder")));
}

/// Without a folder of their own, and named twice they are read once. WGSL of other kinds may lie beside them.
#[test]
fn single_files_beside_the_script() {
    let dir = prepared();
    for name in ["dots.importer.rhai", "swap.wgsl"] {
        std::fs::rename(dir.path().join("plugins").join(name), dir.path().join(name)).unwrap();
    }
    good(dir.path(), &["check", "s.rhai", "--plugins", "."]);
    std::fs::write(dir.path().join("part.wgsl"), "fn helper(x: f32) -> f32 { return x * 2.0; }\n").unwrap();
    good(dir.path(), &["check", "s.rhai"]);
    let out = good(dir.path(), &["plugins"]);
    assert_eq!(out.matches("dots.importer.rhai)").count(), 1, "{out}");
    assert!(out.contains("swap.wgsl)") && !out.contains("part.wgsl"), "{out}");
    good(dir.path(), &["info", "a.dots"]);
    // Meant as a plugin, it must be one.
    std::fs::write(dir.path().join("part.wgsl"), "// effect: part\nfn helper() {}\n").unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert!(run.code == 1 && run.err.contains("part.wgsl"), "{}", run.err);
}

#[test]
fn a_changed_plugin_changes_the_scripts_hash() {
    let dir = prepared();
    let hash = || {
        good(dir.path(), &["render", "s.rhai", "-o", "o.png", "--at", "0", "--device", "cpu", "-q"]);
        good(dir.path(), &["info", "o.png"])
    };
    let before = hash();
    assert_eq!(before, hash());
    std::fs::write(dir.path().join("plugins/unused.wgsl"), EFFECT.replace("swap", "other")).unwrap();
    assert_eq!(before, hash(), "a plugin that is not used does not matter");
    std::fs::write(dir.path().join("plugins/dots.importer.rhai"), format!("{IMPORTER}// changed\n")).unwrap();
    assert_ne!(before, hash());
}

#[test]
fn the_lesson_is_good() {
    let lesson = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/08_plugins");
    let out = good(&lesson, &["check", "lesson.rhai"]);
    assert!(out.contains("good, 180 frames, no warnings"), "{out}");
}
