//! A walkthrough of the viewer on a virtual display. If CHOREO_SHOTS names a folder, a
//! screenshot of each step is saved there, and all of them in one image, `walkthrough.png`:
//! `CHOREO_SHOTS=folder cargo test -p choreo -p choreo-viewer --test windows walkthrough`.

use crate::screen::{Screen, assert_no_errors, until};
use std::fs;
use std::path::Path;
use std::process::Command;

const SCRIPT: &str = r##"stage(#{ size: [640, 360], fps: 30, length: 4.0, background: #{ top: "#31435c", bottom: "#8a93a8" } });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" })).at(-0.8, 0.0, 0.0);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.4 });
let bob = cast("bob", load("choreo:mannequin", #{ color: "teal" })).at(0.8, 0.0, 0.0);
bob.play(moves.clip("Dance_Groove"));
camera("wide").at(0.0, 1.3, 5.0).look_at([0.0, 0.9, 0.0]);
camera("near").at(0.6, 1.5, 2.6).look_at([0.2, 1.1, 0.0]).cut(3.0);
sun(#{ direction: [-0.6, -1.0, -0.9] });
effect("vignette", #{ strength: 0.3 });
marker("hello", 2.0);
"##;

#[test]
fn a_scene_is_changed_with_the_mouse_and_in_the_editor() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let text = || fs::read_to_string(&script).unwrap();
    let mut viewer = screen.view(&["a.rhai"], folder.path());
    let window = screen.window();
    // The coral color of ada.
    let is_coral = |p: &[u8]| p[0] > 150 && p[1] < 110 && p[2] < 90 && p[0] > p[1] + 70;
    let middle = |coral: bool| -> Option<(usize, usize)> {
        let shot = screen.shot(&window);
        let wanted =
            |p: &[u8]| if coral { is_coral(p) } else { p[0] < 60 && p[1] > 90 && p[2] > 70 && p[1] < 190 };
        let all: Vec<usize> = (0..shot.width * shot.height)
            .filter(|i| (200..900).contains(&(i % shot.width)) && (100..560).contains(&(i / shot.width)))
            .filter(|i| wanted(&shot.rgb[i * 3..i * 3 + 3]))
            .collect();
        let count = all.len();
        (count > 200).then(|| {
            let (x, y) = all.iter().fold((0, 0), |(x, y), i| (x + i % shot.width, y + i / shot.width));
            (x / count, y / count)
        })
    };
    let at = until("ada", || middle(true));
    screen.save(&window, "1_open.png");

    // A click selects ada: the inspector shows her, and the gizmo appears.
    let point = |(x, y): (usize, usize)| {
        screen.xdotool(&["mousemove", "--window", &window, &x.to_string(), &y.to_string()])
    };
    screen.xdotool(&["windowfocus", &window]);
    point(at);
    screen.rest(viewer.0.id());
    let before = screen.shot(&window);
    screen.xdotool(&["click", "1"]);
    until("the selection", || (screen.shot(&window) != before).then_some(()));
    let arrow = until("the red arrow", || {
        let shot = screen.shot(&window);
        // The device's encoding can differ by one or two steps.
        let is_red = |i: &usize| {
            shot.rgb[i * 3..i * 3 + 3].iter().zip([0xe0u8, 0x55, 0x4d]).all(|(a, b)| a.abs_diff(b) <= 3)
        };
        let all: Vec<usize> = (0..shot.width * shot.height).filter(is_red).collect();
        // The tip of the arrow is its rightmost pixel.
        all.iter().max_by_key(|i| *i % shot.width).map(|i| (i % shot.width - 3, i / shot.width))
    });
    screen.save(&window, "2_selected.png");

    // The red arrow is dragged: only one number of the script changes.
    point(arrow);
    screen.rest(viewer.0.id());
    screen.xdotool(&["mousedown", "1"]);
    for step in 1..=8 {
        point((arrow.0 - step * 8, arrow.1));
        std::thread::sleep(std::time::Duration::from_millis(40));
        screen.rest(viewer.0.id());
    }
    screen.save(&window, "3_dragged.png");
    screen.xdotool(&["mouseup", "1"]);
    let moved = until("the change", || Some(text()).filter(|t| t != SCRIPT));
    let lines: Vec<(&str, &str)> = SCRIPT.lines().zip(moved.lines()).filter(|(a, b)| a != b).collect();
    assert_eq!(lines.len(), 1, "{moved}");
    assert!(lines[0].1.starts_with("let ada = cast(") && lines[0].1.contains(".at(-"), "{}", lines[0].1);
    screen.key(&window, "ctrl+z");
    until("the undo", || (text() == SCRIPT).then_some(()));

    // The editor saves an error: the last good image stays, and the line is shown.
    fs::write(&script, SCRIPT.replace("\"Wave\"", "\"Waev\"")).unwrap();
    screen.key(&window, "ctrl+5");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    screen.rest(viewer.0.id());
    until("the last good image", || middle(true));
    screen.save(&window, "4_broken.png");
    fs::write(&script, SCRIPT.replace("\"coral\"", "\"lime\"")).unwrap();
    // The actor is green now, except for its outline.
    let greens = || {
        let shot = screen.shot(&window);
        shot.rgb
            .chunks_exact(3)
            .filter(|p| p[1] > p[0].saturating_add(25) && p[1] > p[2].saturating_add(40))
            .count()
    };
    until("the mended version", || (greens() > 400).then_some(()));

    // Playback runs for a while, and the frame graph shows the time of each frame.
    screen.key(&window, "ctrl+8");
    screen.key(&window, "space");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    screen.key(&window, "space");
    screen.save(&window, "5_performance.png");
    screen.key(&window, "F1");
    std::thread::sleep(std::time::Duration::from_millis(500));
    screen.save(&window, "6_keys.png");
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
    // The next window restores the layout of the panels.
    assert!(folder.path().join("state/choreo/view.json").is_file());
    strip();
}

/// Joins the screenshots of all steps in one image, two per row.
fn strip() {
    let Some(folder) = std::env::var_os("CHOREO_SHOTS") else { return };
    let names = ["1_open", "2_selected", "3_dragged", "4_broken", "5_performance", "6_keys"];
    let files: Vec<_> = names.iter().map(|n| Path::new(&folder).join(format!("{n}.png"))).collect();
    let out = Path::new(&folder).join("walkthrough.png");
    let made = Command::new("montage")
        .args(&files)
        .args(["-resize", "62%", "-tile", "2x", "-geometry", "+4+4", "-background", "#222"])
        .arg(format!("PNG24:{}", out.display()))
        .status();
    assert!(made.is_ok_and(|m| m.success()), "montage is part of ImageMagick");
}
