//! Plugins in WebAssembly: a new importer and a new exporter are built, tested, installed and used; manifests are remembered, and compared
//! with those of the plugins.

mod common;

use choreo_importer_kit_testing::wasm::built;
use common::*;
use std::path::Path;

/// The program, with folders of the user's own below the folder.
fn run(folder: &Path, args: &[&str]) -> Run {
    let mut command = command(folder, args);
    command.env_remove("CHOREO_PLUGINS");
    command.env("XDG_DATA_HOME", folder.join("data")).env("XDG_CACHE_HOME", folder.join("cache"));
    finished(command.output().unwrap())
}

fn good(folder: &Path, args: &[&str]) -> String {
    let run = run(folder, args);
    assert_eq!(run.code, 0, "{args:?}: {}{}", run.out, run.err);
    run.out + &run.err
}

/// A new package, built.
fn package(folder: &Path, kind: &str, crate_name: &str) {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    good(folder, &["new", kind, "my_format", "--wasm", "--sources", sources.to_str().unwrap()]);
    let made = folder.join(crate_name);
    let text = std::fs::read_to_string(made.join("README.md")).unwrap();
    let command = format!("cp target/wasm32-unknown-unknown/release/{}.wasm", crate_name.replace('-', "_"));
    assert!(text.contains(&command), "{text}");
    std::fs::copy(built(&made, crate_name), made.join(format!("my_format.{kind}.wasm"))).unwrap();
}

#[test]
fn new_packages_are_built_installed_and_used() {
    let dir = folder();
    let folder = dir.path();
    for (kind, crate_name) in [("importer", "import-my-format"), ("exporter", "export-my-format")] {
        package(folder, kind, crate_name);
        good(folder, &["plugins", "test", crate_name]);
    }
    // Both are called my_format, and packages have names of their own.
    let description = folder.join("export-my-format/plugin.toml");
    let text = std::fs::read_to_string(&description).unwrap();
    std::fs::write(&description, text.replacen("my_format", "my_exporter", 1)).unwrap();
    good(folder, &["plugins", "install", "import-my-format"]);
    good(folder, &["plugins", "install", "export-my-format"]);
    std::fs::copy(folder.join("import-my-format/tests/sample.my_format"), folder.join("a.my_format"))
        .unwrap();
    let info = good(folder, &["info", "a.my_format", "--import", "scale=2"]);
    assert!(
        info.contains("4.000 × 3.000 × 4.000 m") && info.contains("a.my_format: my_format (points"),
        "{info}"
    );
    // A callback, which only the program can run, moves the actor.
    let script = "stage(#{ fps: 4, length: 0.5 });\nlet a = cast(\"a\", load(\"a.my_format\")).at(1.0, 0.0, 2.5);\n\
        on_frame(|time| a.at(time, 0.0, 0.0));\n";
    std::fs::write(folder.join("s.rhai"), script).unwrap();
    good(folder, &["export", "s.rhai", "-o", "own.my_format", "--export", "digits=2"]);
    good(folder, &["export", "s.rhai", "-o", "ours.csv", "--export", "digits=2"]);
    let (own, ours) = (read(folder, "own.my_format"), read(folder, "ours.csv"));
    assert_eq!(String::from_utf8_lossy(&own), String::from_utf8_lossy(&ours));
    assert!(own.len() > 60, "{}", String::from_utf8_lossy(&own));
    good(folder, &["plugins", "remove", "my_exporter"]);
    assert_ne!(run(folder, &["export", "s.rhai", "-o", "again.my_format"]).code, 0);
}

#[test]
fn a_manifest_is_remembered_and_a_false_one_found() {
    let dir = folder();
    let folder = dir.path();
    package(folder, "importer", "import-my-format");
    std::fs::create_dir(folder.join("plugins")).unwrap();
    std::fs::rename(
        folder.join("import-my-format/my_format.importer.wasm"),
        folder.join("plugins/my_format.importer.wasm"),
    )
    .unwrap();
    std::fs::copy(folder.join("import-my-format/tests/sample.my_format"), folder.join("a.my_format"))
        .unwrap();
    good(folder, &["info", "a.my_format"]);
    let remembered = folder.join("cache/choreo/plugin-manifests");
    let [name] = names(&remembered).try_into().unwrap();
    let text = std::fs::read(remembered.join(&name)).unwrap();
    let place = text.windows(5).position(|part| part == b"0.1.0").unwrap();
    let mut other = text.clone();
    other[place] = b'9';
    std::fs::write(remembered.join(&name), &other).unwrap();
    let run = run(folder, &["info", "a.my_format"]);
    assert!(
        run.code != 0 && run.err.contains("its manifest is not the one that was remembered"),
        "{}",
        run.err
    );
    // What is no manifest is made anew.
    std::fs::write(remembered.join(&name), b"nothing of the kind").unwrap();
    good(folder, &["info", "a.my_format"]);
    assert_eq!(std::fs::read(remembered.join(&name)).unwrap(), text);
}
