//! The layout is saved while the window is open, so that it survives a signal that ends the program.

use crate::screen::{Screen, assert_no_errors, until};
use serde_json::Value;
use std::fs;
use std::process::Command;

#[test]
fn the_panel_layout_is_restored_after_a_restart() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, "stage(#{ size: [64, 36], length: 1.0 });\ncast(\"box\", shape(\"box\"));\n").unwrap();
    // The tempo of the earlier script is kept.
    let tempos = serde_json::json!({ script.canonicalize().unwrap().to_str().unwrap(): { "bpm": 90.0, "first": 0.5 } });
    fs::create_dir_all(folder.path().join("state/choreo")).unwrap();
    let settings = folder.path().join("state/choreo/view.json");
    fs::write(&settings, serde_json::json!({ "tempos": tempos }).to_string()).unwrap();
    let mut viewer = screen.view(&[script.to_str().unwrap()], folder.path());
    let window = screen.window();
    screen.rest(viewer.0.id());
    // The file is complete at all times.
    let kept = || -> Value { serde_json::from_str(&fs::read_to_string(&settings).unwrap()).unwrap() };
    let scale = || kept()["scale"].as_f64().unwrap_or(1.0);
    screen.key(&window, "ctrl+equal");
    until("the layout", || ((scale() - 1.1).abs() < 1e-6).then_some(()));
    assert!(viewer.0.try_wait().unwrap().is_none(), "it is still there");
    screen.key(&window, "ctrl+equal");
    screen.rest(viewer.0.id());
    let asked = Command::new("kill").args(["-TERM", &viewer.0.id().to_string()]).status().unwrap();
    assert!(asked.success());
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0), "closed as by Quit");
    assert!((scale() - 1.2).abs() < 1e-6, "{}", scale());
    assert_eq!(kept()["tempos"], tempos);
    assert_no_errors(folder.path());
}
