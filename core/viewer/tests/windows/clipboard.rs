//! Clips copied in one window and pasted in another, through the clipboard of the display.

use crate::screen::{Screen, assert_no_errors, until};
use choreo_viewer::panels::color_of_clip;
use std::fs;
use std::path::Path;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 3.0, samples: 1 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
// A warning that arrives later would change the color of the bar.
// allow: frozen_at_end
ada.play(moves.clip("CLIP")).until(1.0);
"##;
const SEQUENCER: [usize; 2] = [600, 860];

#[test]
fn a_clip_that_is_copied_in_one_window_is_pasted_in_another() {
    let Some(screen) = Screen::new() else { return };
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let script = |folder: &Path, clip: &str| {
        let script = folder.join("a.rhai");
        fs::write(&script, SCRIPT.replace("CLIP", clip)).unwrap();
        script
    };
    let first = script(folders[0].path(), "Wave");
    let second = script(folders[1].path(), "Walk");
    let mut from = screen.view(&[first.to_str().unwrap()], folders[0].path());
    let window = screen.window();
    click_bar(&screen, &window, from.0.id(), "Wave");
    screen.key(&window, "ctrl+c");
    screen.rest(from.0.id());
    // The newer window covers the other one.
    let mut to = screen.view(&[second.to_str().unwrap()], folders[1].path());
    let other = until("another window", || {
        let found = screen.xdotool(&["search", "--onlyvisible", "--name", "choreo"]);
        found.lines().find(|line| *line != window).map(str::to_string)
    });
    click_bar(&screen, &other, to.0.id(), "Walk");
    screen.key(&other, "End");
    screen.key(&other, "ctrl+v");
    let text =
        until("the pasted clip", || fs::read_to_string(&second).ok().filter(|text| text.contains("Wave")));
    assert!(text.contains("Walk") && text.contains("clip(\"Wave\")"), "{text}");
    assert_eq!(fs::read_to_string(&first).unwrap(), SCRIPT.replace("CLIP", "Wave"));
    for (viewer, window, folder) in [(&mut to, &other, &folders[1]), (&mut from, &window, &folders[0])] {
        screen.key(window, "ctrl+q");
        let status = until("the end", || viewer.0.try_wait().unwrap());
        assert_eq!(status.code(), Some(0));
        assert_no_errors(folder.path());
    }
}

/// Waits for the clip's bar and clicks it.
fn click_bar(screen: &Screen, window: &str, viewer: u32, clip: &str) {
    let (left, right, y) = until("a bar", || screen.shot(window).bar(color_of_clip(clip), SEQUENCER));
    let [x, y] = [(left + right) / 2, y].map(|n| n.to_string());
    screen.xdotool(&["windowfocus", window]);
    screen.xdotool(&["mousemove", "--window", window, &x, &y]);
    screen.rest(viewer);
    screen.xdotool(&["click", "1"]);
    screen.rest(viewer);
}
