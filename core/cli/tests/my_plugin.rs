//! `examples/my_plugin.rs`: the program with plugins that another one has registered.

mod common;

use common::*;
use std::process::Command;

#[test]
fn a_program_with_plugins_of_its_own() {
    // Cargo builds the examples beside the tests, but not for one test alone.
    let exe = std::env::current_exe().unwrap();
    let example = exe
        .ancestors()
        .nth(2)
        .unwrap()
        .join("examples")
        .join(format!("my_plugin{}", std::env::consts::EXE_SUFFIX));
    if !example.exists() {
        println!("SKIP 1: examples/my_plugin is not built; cargo test -p choreo builds it");
        return;
    }
    let dir = folder();
    std::fs::write(dir.path().join("a.tri"), "-1 0 0  1 0 0  0 1.5 0").unwrap();
    let script = "stage(#{ size: [32, 24], length: 0.1, background: \"white\" });\n\
        cast(\"a\", load(\"a.tri\", #{ scale: 2.0 }));\neffect(\"negative\", #{ amount: 1.0 });\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let run = |args: &[&str]| {
        let out = Command::new(&example).args(args).current_dir(dir.path()).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (out.status.code(), text(&out.stdout), text(&out.stderr))
    };
    let (code, out, err) = run(&["plugins"]);
    assert!(
        code == Some(0) && out.contains("triangles") && out.contains("negative") && out.contains("gltf"),
        "{out}{err}"
    );
    let (code, out, err) = run(&["info", "a.tri"]);
    assert!(code == Some(0) && out.contains("2.000 × 1.500 × 0.000 m"), "{out}{err}");
    let (code, _, err) = run(&["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", "cpu"]);
    assert_eq!(code, Some(0), "{err}");
    let picture = image::open(dir.path().join("s.png")).unwrap().into_rgba8();
    // White outside turns black.
    assert_eq!(picture.get_pixel(0, 0).0, [0, 0, 0, 255]);
    // The program as it is knows neither.
    let plain = choreo(dir.path(), &["info", "a.tri"]);
    assert!(plain.code == 1 && plain.err.contains("no importer knows this kind of file"), "{}", plain.err);
}
