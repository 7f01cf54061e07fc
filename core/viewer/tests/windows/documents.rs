//! A window without a file: the start page with thumbnails of lessons, a new script by keyboard, its folder in the asset browser, the
//! command palette; the next window lists the script as recent.

use crate::screen::{Running, Screen, assert_no_errors, is_validation_installed, until};
use serde_json::Value;
use std::fs::{self, File};
use std::path::Path;

/// A missing script is offered to be created; several lessons have a thumbnail.
const SOME: usize = 8;

fn start(screen: &Screen, args: &[&str], folder: &Path) -> Running {
    let mut command = screen.command(args, folder);
    command.current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    if is_validation_installed() {
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    }
    let said = File::create(folder.join("said.txt")).unwrap();
    Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap())
}

#[test]
fn a_new_user_begins_without_a_file() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/models");
    fs::copy(models.join("face.gltf"), folder.path().join("face.gltf")).unwrap();
    let mut viewer = start(&screen, &[], folder.path());
    let window = screen.window();
    let images = || fs::read_dir(folder.path().join("cache/choreo/thumbnails")).map_or(0, Iterator::count);
    until("images of lessons", || (images() >= SOME).then_some(()));
    screen.rest(viewer.0.id());
    screen.save(&window, "start.png");
    screen.key(&window, "ctrl+n");
    screen.rest(viewer.0.id());
    screen.save(&window, "new.png");
    screen.key(&window, "Return");
    let script = folder.path().join("scene.rhai");
    until("the new script", || script.is_file().then_some(()));
    let titled = |name: &str| screen.xdotool(&["search", "--onlyvisible", "--name", name]);
    until("its title", || (titled("scene.rhai") == window).then_some(()));
    screen.rest(viewer.0.id());
    let command = |text: &str| {
        screen.key(&window, "ctrl+p");
        screen.rest(viewer.0.id());
        screen.xdotool(&["type", "--delay", "30", text]);
        screen.rest(viewer.0.id());
    };
    command("panel assets");
    screen.key(&window, "Return");
    screen.rest(viewer.0.id());
    std::thread::sleep(std::time::Duration::from_secs(2));
    screen.save(&window, "assets.png");
    command("camera");
    screen.save(&window, "palette.png");
    screen.key(&window, "Escape");
    screen.key(&window, "F1");
    screen.rest(viewer.0.id());
    screen.save(&window, "keys_list.png");
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
    let settings = fs::read_to_string(folder.path().join("state/choreo/view.json")).unwrap();
    let settings: Value = serde_json::from_str(&settings).unwrap();
    let recent: Vec<&str> = settings["recent"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(recent, [script.canonicalize().unwrap().to_str().unwrap()]);
    let mut viewer = start(&screen, &["another.rhai"], folder.path());
    let window = screen.window();
    screen.rest(viewer.0.id());
    std::thread::sleep(std::time::Duration::from_secs(2));
    screen.save(&window, "missing.png");
    screen.key(&window, "ctrl+q");
    assert_eq!(until("the end", || viewer.0.try_wait().unwrap()).code(), Some(0));
}
