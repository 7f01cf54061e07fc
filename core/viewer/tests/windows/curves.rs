//! The curve editor in a real window: K sets a key, the mouse drags its point, and undo reverts both.

use crate::screen::{Screen, assert_no_errors, until};
use std::fs;
use std::time::Duration;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 25, length: 4.0, background: "#204060" });
let ball = cast("ball", shape("box", #{ size: 1.0 })).key("position", [[0.0, [0, 0, 0]], [4.0, [0, 2, 0]]]); // up
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 1.0, 0.0]);
"##;

/// Color of a selected key after the device's encoding.
const SELECTED: [u8; 3] = [0xff, 0x8a, 0x28];

#[test]
fn a_key_is_set_and_dragged_in_a_window() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let text = || fs::read_to_string(&script).unwrap();
    let mut viewer = screen.view(&[script.to_str().unwrap()], folder.path());
    let window = screen.window();
    until("the first image", || (screen.shot(&window).count([0x20, 0x40, 0x60]) > 5000).then_some(()));
    screen.key(&window, "Page_Down");
    screen.key(&window, "ctrl+9");
    screen.xdotool(&["key", "--repeat", "40", "--delay", "30", "Right"]);
    screen.rest(viewer.0.id());
    screen.key(&window, "k");
    // Several presses between two frames of the window count as one, so that the time is read from the script.
    let keyed = until("the key", || Some(text()).filter(|text| *text != SCRIPT));
    let start = keyed.find("[0, 0, 0]], [").unwrap_or_else(|| panic!("{keyed}")) + 13;
    let time = keyed[start..].split(',').next().unwrap();
    let value = time.parse::<f64>().unwrap_or_else(|_| panic!("{keyed}")) / 2.0;
    let entry =
        |value: f64| format!("[{time}, [0.0, {}, 0.0]], [4.0", choreo_session::edit::format_number(value));
    assert_eq!(keyed, SCRIPT.replace("[4.0", &entry(value)));
    // Its points are selected; that of y is the upper one. The curve editor is the lower third of the window.
    let point = until("the selected points", || {
        let shot = screen.shot(&window);
        let rows = shot.height * 7 / 10..shot.height;
        let mut all = rows.flat_map(|y| (0..shot.width).map(move |x| (x, y)));
        all.find(|(x, y)| shot.is(*x, *y, SELECTED)).map(|(x, y)| (x, y + 4))
    });
    screen.save(&window, "curves.png");
    let go = |(x, y): (usize, usize)| {
        screen.xdotool(&["mousemove", "--window", &window, &x.to_string(), &y.to_string()]);
        screen.rest(viewer.0.id());
    };
    go(point);
    screen.xdotool(&["mousedown", "1"]);
    for step in 1..=6 {
        go((point.0, point.1 - 5 * step));
        std::thread::sleep(Duration::from_millis(40));
    }
    screen.save(&window, "curves_dragged.png");
    screen.xdotool(&["mouseup", "1"]);
    let dragged = until("the change", || Some(text()).filter(|text| *text != keyed));
    let start = dragged.find(&format!("[{time}, [0.0, ")).unwrap_or_else(|| panic!("{dragged}"));
    let number = dragged[start..].split(", ").nth(2).unwrap();
    let number: f64 = number.parse().unwrap_or_else(|_| panic!("{dragged}"));
    assert!(number > value + 0.05, "{dragged}");
    assert_eq!(dragged, keyed.replace(&entry(value), &entry(number)));
    screen.key(&window, "ctrl+z");
    until("the first undo", || (text() == keyed).then_some(()));
    screen.key(&window, "ctrl+z");
    until("the second undo", || (text() == SCRIPT).then_some(()));
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
}
