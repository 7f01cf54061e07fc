//! A package with an importer in WebAssembly: built as its author would, installed with the command line, and used in both programs. Run by
//! `cargo xtask wasm`.

#![cfg(target_os = "linux")]

mod screen;

use choreo_importer_kit_testing::wasm::built;
use screen::{Running, Screen, assert_no_errors, until};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const SCRIPT: &str = r##"stage(#{ size: [320, 180], length: 0.1, background: "#204060" });
cast("a", load("a.my_format"));
camera("c").at(0.0, 1.0, 9.0).look_at([0.0, 1.0, 0.0]);
sun();
"##;

const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];

#[test]
fn an_installed_webassembly_package_works_in_the_viewer() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    // The command line lies beside the viewer.
    let viewer = Path::new(env!("CARGO_BIN_EXE_choreo-view"));
    let choreo = viewer.with_file_name("choreo");
    let set_up = |program: &Path, args: &[&str]| {
        let mut command = Command::new(program);
        command.args(args).current_dir(folder).env_remove("CHOREO_PLUGINS");
        command.env("XDG_DATA_HOME", folder.join("data")).env("XDG_CACHE_HOME", folder.join("cache"));
        command
    };
    let program = |args: &[&str]| set_up(&choreo, args);
    let printed = |output: &Output| {
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
    };
    let good = |args: &[&str]| {
        let output = program(args).output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", printed(&output));
        printed(&output)
    };
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    good(&["new", "importer", "my_format", "--wasm", "--sources", sources.to_str().unwrap()]);
    let package = folder.join("import-my-format");
    fs::copy(built(&package, "import-my-format"), package.join("my_format.importer.wasm")).unwrap();
    fs::copy(package.join("tests/sample.my_format"), folder.join("a.my_format")).unwrap();
    fs::write(folder.join("s.rhai"), SCRIPT).unwrap();
    let without = program(&["check", "s.rhai"]).output().unwrap();
    assert!(printed(&without).contains("no importer knows this kind of file"), "{}", printed(&without));
    good(&["plugins", "test", "import-my-format"]);
    good(&["plugins", "install", "import-my-format"]);
    good(&["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", "cpu"]);
    let version = env!("CARGO_PKG_VERSION");
    assert!(good(&["info", "s.png"]).contains(&format!("my_format {version}")));

    let Some(screen) = Screen::new() else { return };
    let said = fs::File::create(folder.join("said.txt")).unwrap();
    let mut command = set_up(viewer, &["s.rhai", "--full-size"]);
    command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY");
    command.env("XDG_STATE_HOME", folder.join("state"));
    let mut viewer = Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap());
    let window = screen.window();
    let shot = until("the image", || {
        let shot = screen.shot(&window);
        (shot.count(BACKGROUND) > 20_000).then_some(shot)
    });
    screen.save(&window, "wasm.png");
    let [left, top, right, bottom] = shot.bounds(BACKGROUND);
    assert_eq!([right - left, bottom - top], [320, 180]);
    assert_ne!(shot.pixel((left + right) / 2, (top + bottom) / 2), BACKGROUND, "the mesh of the plugin");
    screen.key(&window, "ctrl+q");
    assert_eq!(until("the end", || viewer.0.try_wait().unwrap()).code(), Some(0));
    assert_no_errors(folder);
}
