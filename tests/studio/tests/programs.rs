//! The command line and the viewer of another program, with its importer and effect.
#![cfg(target_os = "linux")]

#[path = "../../../core/viewer/tests/screen/mod.rs"]
mod screen;

use choreo_plugin::Source;
use screen::{Running, Screen, Screenshot, assert_no_errors, until};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], length: 0.1, background: "#204060" });
cast("a", load("a.tri", #{ scale: 2.0 }));
camera("c").at(0.0, 1.0, 9.0).look_at([0.0, 1.0, 0.0]);
effect("negative");
"##;

/// The folder of the studio's programs.
fn programs() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_studio")).parent().unwrap()
}

#[test]
fn plugins_of_another_program_work_in_its_command_line_and_its_viewer() {
    let folder = tempfile::tempdir().unwrap();
    let programs = programs();
    fs::write(folder.path().join("a.tri"), "-1 0 0  1 0 0  0 1.5 0").unwrap();
    let script = folder.path().join("s.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let studio = |args: &[&str]| {
        let output =
            Command::new(programs.join("studio")).args(args).current_dir(folder.path()).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{args:?}: {text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    assert_eq!(studio(&["--version"]), "studio 2.0.0\n");
    let listed = studio(&["plugins"]);
    assert!(["triangles", "negative", "gltf"].iter().all(|name| listed.contains(name)), "{listed}");
    let info = studio(&["info", "a.tri", "--import", "scale=2"]);
    assert!(info.contains("4.000 × 3.000 × 0.000 m"), "{info}");
    // The default size is that of the program; the effect turns the background around.
    studio(&["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", "cpu"]);
    let Some(drawn) = pixels(&folder.path().join("s.png")) else { return };
    assert_eq!([drawn.width, drawn.height], [48, 36]);
    let (corner, middle) = (drawn.pixel(0, 0), drawn.pixel(24, 18));
    // 1 − x of linear light, by IEC 61966-2-1: #20 is 0.0144, #40 0.0513, #60 0.1170.
    assert_eq!(corner, [253, 249, 241]);
    assert_ne!(corner, middle);
    let made = studio(&["info", "s.png"]);
    assert!(made.contains(&format!("studio 2.0.0 (choreo {})", choreo::app().version)), "{made}");
    assert!(made.contains("negative 1, triangles 1"), "{made}");
    // choreo itself has neither.
    let plain = choreo::registry();
    let source = Source { name: "a.tri".into(), bytes: Arc::default() };
    assert!(plain.importer_for(&source, None).is_err() && plain.effect("negative").is_none());

    let Some(screen) = Screen::new() else { return };
    let said = fs::File::create(folder.path().join("said.txt")).unwrap();
    let mut command = Command::new(programs.join("studio"));
    command
        .args(["view", "s.rhai", "--full-size"])
        .current_dir(folder.path())
        .env("DISPLAY", &screen.display);
    command.env_remove("WAYLAND_DISPLAY").env("XDG_STATE_HOME", folder.path().join("state"));
    let mut viewer = Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap());
    let window = screen.window_named("studio");
    let shot = until("the negative background", || {
        let shot = screen.shot(&window);
        (shot.count(corner) > 20_000).then_some(shot)
    });
    screen.save(&window, "studio.png");
    // The triangle, of the studio's importer, is drawn over the background.
    let [left, top, right, bottom] = shot.bounds(corner);
    assert_eq!([right - left, bottom - top], [320, 180]);
    assert_ne!(shot.pixel((left + right) / 2, (top + bottom) / 2), corner);
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
    survives_a_panic(programs, folder.path(), &screen);
}

/// An effect of the program that panics is an error of its frames, in both of them; the viewer draws the next version of the script.
fn survives_a_panic(programs: &Path, folder: &Path, screen: &Screen) {
    let script = folder.join("f.rhai");
    let faulty = SCRIPT.replace("negative", "fragile");
    fs::write(&script, &faulty).unwrap();
    let studio = |args: &[&str]| {
        let mut command = Command::new(programs.join("studio"));
        command.args(args).current_dir(folder).env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY");
        command.env("XDG_STATE_HOME", folder.join("state"));
        command
    };
    let output =
        studio(&["render", "f.rhai", "-o", "f.png", "--at", "0", "--device", "cpu"]).output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        messages.contains("the plugin fragile 3 has failed: there is no film in the camera"),
        "{messages}"
    );
    let said = fs::File::create(folder.join("failed.txt")).unwrap();
    let mut viewer = Running(studio(&["view", "f.rhai"]).stdout(Stdio::null()).stderr(said).spawn().unwrap());
    let window = screen.window_named("studio");
    until("the panic", || {
        fs::read_to_string(folder.join("failed.txt")).unwrap().contains("no film").then_some(())
    });
    screen.save(&window, "studio_fragile.png");
    assert!(viewer.0.try_wait().unwrap().is_none(), "the viewer is still there");
    fs::write(&script, faulty.replace("effect(\"fragile\");", "")).unwrap();
    until("the image without the effect", || {
        (screen.shot(&window).count([0x20, 0x40, 0x60]) > 20_000).then_some(())
    });
    screen.key(&window, "ctrl+q");
    assert_eq!(until("the end", || viewer.0.try_wait().unwrap()).code(), Some(0));
}

/// Files of a package of plugins that are files.
const PACKAGE: [(&str, &str); 4] = [
    (
        "plugin.toml",
        "name = \"prints\"\nversion = \"1.2.0\"\nchoreo = \"0.1.0\"\nlicense = \"MIT\"\n\
         [[plugin]]\nfile = \"dots.importer.rhai\"\nkind = \"importer\"\n\
         [[plugin]]\nfile = \"cast.exporter.rhai\"\nkind = \"exporter\"\n\
         [[plugin]]\nfile = \"swap.wgsl\"\nkind = \"effect\"\nhook = \"pixel\"\n",
    ),
    (
        "dots.importer.rhai",
        "fn manifest() { #{ name: \"dots\", version: \"1.2.0\", extensions: \"dots\" } }\n\
         fn load(file) { mesh(#{ positions: file.bytes.numbers() }); }\n",
    ),
    (
        "cast.exporter.rhai",
        "fn manifest() { #{ name: \"cast\", version: \"1.2.0\", extensions: \"cast\" } }\n\
         fn save(scene) { for actor in scene.actors { writeln(actor.name); } }\n",
    ),
    (
        "swap.wgsl",
        "// effect: swap\n// version: 1.2.0\n\
         fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color.bgra; }\n",
    ),
];

#[test]
fn an_installed_package_works_in_its_command_line_and_its_viewer() {
    let folder = tempfile::tempdir().unwrap();
    let programs = programs();
    let place = |name: &str| folder.path().join(name);
    fs::create_dir(place("package")).unwrap();
    PACKAGE.iter().for_each(|(name, text)| fs::write(place("package").join(name), text).unwrap());
    fs::write(place("a.dots"), "-1 0 0  1 0 0  0 1.5 0").unwrap();
    let script =
        SCRIPT.replace("a.tri", "a.dots").replace(", #{ scale: 2.0 }", "").replace("negative", "swap");
    fs::write(place("s.rhai"), script).unwrap();
    let studio = |args: &[&str]| {
        let mut command = Command::new(programs.join("studio"));
        command.args(args).current_dir(folder.path());
        command.env_remove("CHOREO_PLUGINS").env("XDG_DATA_HOME", place("data"));
        command
    };
    let good = |args: &[&str]| {
        let output = studio(args).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{args:?}: {text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    assert!(good(&["plugins", "install", "package"]).contains("prints 1.2.0: installed in"));
    good(&["export", "s.rhai", "-o", "s.cast"]);
    assert_eq!(fs::read(place("s.cast")).unwrap(), b"a\n");
    good(&["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", "cpu"]);
    assert!(good(&["info", "s.png"]).contains("dots 1.2.0, swap 1.2.0"));
    let Some(drawn) = pixels(&place("s.png")) else { return };
    // Red and blue of the background #204060 have changed places.
    let corner = [0x60, 0x40, 0x20];
    assert_eq!(drawn.pixel(0, 0), corner);

    let Some(screen) = Screen::new() else { return };
    let said = fs::File::create(place("said.txt")).unwrap();
    let mut command = studio(&["view", "s.rhai"]);
    command
        .env("DISPLAY", &screen.display)
        .env_remove("WAYLAND_DISPLAY")
        .env("XDG_STATE_HOME", place("state"));
    let mut viewer = Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap());
    let window = screen.window_named("studio");
    let shot = until("the swapped background", || {
        let shot = screen.shot(&window);
        (shot.count(corner) > 20_000).then_some(shot)
    });
    screen.save(&window, "studio_package.png");
    let [left, top, right, bottom] = shot.bounds(corner);
    assert_ne!(shot.pixel((left + right) / 2, (top + bottom) / 2), corner, "the importer's triangle");
    screen.key(&window, "ctrl+q");
    assert_eq!(until("the end", || viewer.0.try_wait().unwrap()).code(), Some(0));
    assert_no_errors(folder.path());
}

/// The pixels of an image; `None` where ImageMagick is not installed.
fn pixels(image: &Path) -> Option<Screenshot> {
    let Ok(output) = Command::new("convert").arg(image).args(["-depth", "8", "ppm:-"]).output() else {
        println!("SKIP 1: convert is not installed");
        return None;
    };
    Some(Screenshot::read(&output.stdout).unwrap())
}
