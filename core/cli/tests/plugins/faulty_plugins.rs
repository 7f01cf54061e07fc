//! `examples/faulty_plugins.rs`: a plugin that panics causes an error that names it, and does not crash the program.

use crate::common::*;
use std::path::Path;
use std::process::Command;

const MOVING: &str = "stage(#{ size: [32, 24], length: 1, fps: 10 });\n\
    cast(\"a\", shape(\"box\")).key(\"position\", [[0, [0, 0, 0]], [1, [1, 0, 0]]]);\n";

/// Runs the example on a file `.none`.
const EMPTY: &str = "fn manifest() { #{ name: \"empty\", about: \"a triangle\", extensions: [\"none\"] } }\n\
    fn load(file) { mesh(#{ positions: [0, 0, 0, 1, 0, 0, 0, 1, 0] }); }\n";

#[test]
fn panics_of_plugins_are_errors_with_name_and_version() {
    let exe = std::env::current_exe().unwrap();
    let example = format!("faulty_plugins{}", std::env::consts::EXE_SUFFIX);
    let example = exe.ancestors().nth(2).unwrap().join("examples").join(example);
    if !example.exists() {
        println!("SKIP 1: examples/faulty_plugins is not built; cargo test --workspace builds it");
        return;
    }
    let dir = folder_with_triangle();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("moving.rhai", MOVING);
    write("loads.rhai", "cast(\"a\", load(\"a.faulty\"));\n");
    write("a.faulty", "x");
    write("draws.rhai", &format!("{MOVING}effect(\"faulty\");\n"));
    let run = |args: &[&str]| {
        let out = Command::new(&example).args(args).current_dir(dir.path()).output().unwrap();
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    // Ten frames: those after the third could wait for the sink forever.
    let (code, error) = run(&["render", "moving.rhai", "-o", "x.faulty", "--device", "cpu"]);
    assert!(error.contains("the plugin faulty 1.2 has failed: three frames are too many"), "{error}");
    assert_eq!(code, Some(3), "{error}");
    assert!(!Path::new(&dir.path().join("x.faulty")).exists());
    // If the importer panics in its claim, another importer reads the first file, and none reads the second.
    write("empty.importer.rhai", EMPTY);
    write("a.none", "");
    write("a.unknown", "");
    let (code, error) = run(&["info", "--plugins", ".", "a.none"]);
    assert_eq!(code, Some(0), "{error}");
    let (_, error) = run(&["info", "a.unknown"]);
    let failed = "the plugin faulty 1.2 has failed: no first byte";
    assert!(error.contains(&format!("no importer knows this kind of file; {failed}")), "{error}");
    let out =
        Command::new(&example).args(["info", "--plugins", ".", "a.none"]).current_dir(dir.path()).output();
    let output = String::from_utf8_lossy(&out.unwrap().stdout).into_owned();
    assert!(output.contains(failed), "{output}");
    let (code, error) = run(&["check", "loads.rhai"]);
    assert!(error.contains("loads.rhai:1:"), "{error}");
    assert!(error.contains("the plugin faulty 1.2 has failed: a.faulty has no header"), "{error}");
    assert_eq!(code, Some(1), "{error}");
    let drawn = "effect(\"faulty\"); expect_image(\"x\", #{ at: 0, size: [32, 24] });";
    write("tests.rhai", &format!("test(\"a\", || {{ cast(\"a\", shape(\"box\")); {drawn} }});\n"));
    let out = Command::new(&example).args(["test", "tests.rhai"]).current_dir(dir.path()).output().unwrap();
    let output = String::from_utf8_lossy(&out.stdout) + String::from_utf8_lossy(&out.stderr);
    assert!(output.contains("the plugin faulty 1.2 has failed: nothing to draw"), "{output}");
    let (code, error) = run(&["render", "draws.rhai", "-o", "x.png", "--at", "0", "--device", "cpu"]);
    assert!(error.contains("the plugin faulty 1.2 has failed: nothing to draw"), "{error}");
    assert_eq!(code, Some(1), "{error}");
}
