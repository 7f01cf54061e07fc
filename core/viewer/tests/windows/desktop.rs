//! The window on a desktop: minimized and restored, covered, moved to a screen of another scale, with files dragged onto it.

#[path = "../screen/desktop.rs"]
mod programs;

use crate::screen::viewer_process::ViewerProcess;
use crate::screen::{Screen, Screenshot, assert_no_errors, is_validation_installed, until};
use programs::{Drag, Manager, Settings};
use std::fs;
use std::path::Path;
use std::time::Duration;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 3.0, background: #{ top: "#204060", bottom: "#204060" } });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Dance_Groove"));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
"##;
const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];

fn open(screen: &Screen, folder: &Path, more: &[&str]) -> (ViewerProcess, String) {
    let script = folder.join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let args: Vec<&str> = std::iter::once(script.to_str().unwrap()).chain(more.iter().copied()).collect();
    let mut command = screen.command(&args, folder);
    if is_validation_installed() {
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    }
    command.stderr(fs::File::create(folder.join("said.txt")).unwrap());
    let viewer = ViewerProcess::start(command);
    let window = screen.window();
    until("the image", || (screen.shot(&window).count(BACKGROUND) > 20_000).then_some(()));
    (viewer, window)
}

fn assert_clean_exit(screen: &Screen, window: &str, mut viewer: ViewerProcess, folder: &Path) {
    screen.key(window, "ctrl+q");
    let status = until("the end", || viewer.process.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder);
}

#[test]
fn a_minimized_window_stays_idle_and_shows_changes_when_restored() {
    let Some(screen) = Screen::new() else { return };
    let manager = Manager::start(&screen.display);
    let folder = tempfile::tempdir().unwrap();
    let (viewer, window) = open(&screen, folder.path(), &["--play"]);
    // Check of the test itself: work is detected.
    viewer.plays();
    for round in 0..3 {
        screen.xdotool(&["windowminimize", &window]);
        let last = viewer.settled(Duration::from_millis(700), Duration::from_secs(300));
        assert!(last.is_some(), "it goes on drawing");
        // A frame in progress can be finished.
        until("rest", || {
            let before = viewer.processor_secs();
            std::thread::sleep(Duration::from_secs(2));
            (viewer.processor_secs() - before < 0.1).then_some(())
        });
        viewer.meanwhile();
        std::thread::sleep(Duration::from_secs(1));
        let more = viewer.meanwhile();
        assert!(more.iter().all(|v| v["event"] != "shown"), "a frame of a window that is not seen: {more:?}");
        // A version saved meanwhile is displayed after restoring.
        let color = format!("#6020{}0", round + 4);
        fs::write(folder.path().join("a.rhai"), SCRIPT.replace("#204060", &color)).unwrap();
        std::thread::sleep(Duration::from_millis(300));
        screen.xdotool(&["windowmap", "--sync", &window]);
        let wanted = [0x60, 0x20, (round + 4) * 16];
        until("the new image", || (screen.shot(&window).count(wanted) > 20_000).then_some(()));
        viewer.plays();
    }
    assert_clean_exit(&screen, &window, viewer, folder.path());
    drop(manager);
}

#[test]
fn a_covered_window_stays_idle() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (viewer, window) = open(&screen, folder.path(), &["--play"]);
    let other = tempfile::tempdir().unwrap();
    let (above, cover) = {
        let script = other.path().join("b.rhai");
        fs::write(&script, SCRIPT).unwrap();
        let viewer = ViewerProcess::start(screen.command(&[script.to_str().unwrap()], other.path()));
        viewer.shown(1);
        let found = until("the other window", || {
            let all = screen.xdotool(&["search", "--onlyvisible", "--name", "b.rhai"]);
            all.lines().next().map(str::to_string)
        });
        (viewer, found)
    };
    screen.xdotool(&["windowmove", "--sync", &cover, "0", "0"]);
    screen.xdotool(&["windowsize", "--sync", &cover, "1400", "1000"]);
    screen.xdotool(&["windowraise", &cover]);
    assert!(
        viewer.settled(Duration::from_millis(700), Duration::from_secs(300)).is_some(),
        "it goes on drawing"
    );
    screen.xdotool(&["windowunmap", "--sync", &cover]);
    viewer.plays();
    drop(above);
    assert_clean_exit(&screen, &window, viewer, folder.path());
}

/// The desktop's scale changes, or the window moves to a screen with another scale: sizes in points stay, pixels double.
#[test]
fn the_display_scale_changes_while_the_viewer_runs() {
    another_scale(false);
}

#[test]
fn the_display_scale_changes_under_a_window_manager() {
    another_scale(true);
}

fn another_scale(managed: bool) {
    let Some(screen) = Screen::new() else { return };
    let manager = managed.then(|| Manager::start(&screen.display));
    let settings = Settings::start(&screen.display, 96);
    let folder = tempfile::tempdir().unwrap();
    let (viewer, window) = open(&screen, folder.path(), &[]);
    let button = first_button(&screen.shot(&window), 1.0).unwrap();
    let geometry = || screen.xdotool(&["getwindowgeometry", "--shell", &window]);
    for (dpi, size) in [(192, [2560, 1720]), (96, [1280, 860]), (144, [1920, 1290]), (96, [1280, 860])] {
        settings.set_dpi(dpi);
        let [width, height] = size.map(|s: u32| s.to_string());
        until("the window of that scale", || {
            let now = geometry();
            (now.contains(&format!("WIDTH={width}\n")) && now.contains(&format!("HEIGHT={height}\n")))
                .then_some(())
        });
        if dpi != 96 {
            // The window must fit on the screen, which is smaller, so that it is visible as a whole.
            screen.xdotool(&["windowsize", "--sync", &window, "1400", "1000"]);
            // Buttons grow with the scale; images are still drawn pixel for pixel.
            let scale = dpi as usize as f64 / 96.0;
            until("larger buttons", || {
                let now = first_button(&screen.shot(&window), scale)?;
                screen.save(&window, &format!("scale_{dpi}.png"));
                ((now as f64 - button as f64 * scale).abs() <= 3.0).then_some(())
            });
            // For a moment after the resize the window shows a part of the old frame.
            until("an image of 16:9", || {
                let [left, top, right, bottom] = screen.shot(&window).bounds(BACKGROUND);
                let shape = right.checked_sub(left)? as f64 / bottom.checked_sub(top)? as f64;
                (left + 100 < right && (shape - 16.0 / 9.0).abs() < 0.02).then_some(())
            });
            screen.save(&window, &format!("scale_{dpi}.png"));
            screen.xdotool(&["windowsize", "--sync", &window, &width, &height]);
        }
    }
    until("all as at first", || {
        let shot = screen.shot(&window);
        // Panels that were too narrow took space from others, and keep it.
        let [left, top, right, bottom] = shot.bounds(BACKGROUND);
        let size = [right.saturating_sub(left), bottom.saturating_sub(top)];
        (size == [320, 180] && first_button(&shot, 1.0) == Some(button)).then_some(())
    });
    assert_clean_exit(&screen, &window, viewer, folder.path());
    drop(manager);
}

/// A square, in a file whose name contains a blank, as a file manager would pass it.
const SQUARE: &str = "v -1 0 0\nv 1 0 0\nv 1 2 0\nv -1 2 0\nf 1 2 3 4\n";

/// Moves the pointer over the stage tree: a file dropped on the image would be placed there at once.
fn beside_the_image(screen: &Screen, window: &str) {
    screen.xdotool(&["mousemove", "--window", window, "60", "420"]);
}

#[test]
fn a_file_that_is_dropped_is_shown_and_added() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (viewer, window) = open(&screen, folder.path(), &[]);
    beside_the_image(&screen, &window);
    let file = folder.path().join("my square.obj");
    fs::write(&file, SQUARE).unwrap();
    // Dragged over the window and away again: nothing happens.
    let before = until("rest", || Some(screen.shot(&window)).filter(|s| *s == screen.shot(&window)));
    let hovering = Drag::over(&screen.display, &window, &[&file]);
    let dark = until("a hint", || Some(screen.shot(&window)).filter(|s| s.count(BACKGROUND) == 0));
    screen.save(&window, "hovering.png");
    assert!(dark != before);
    hovering.leave();
    let all = before.count(BACKGROUND);
    until("all as before", || (screen.shot(&window).count(BACKGROUND) == all).then_some(()));

    // Dropped: the model is shown in place of the scene.
    Drag::over(&screen.display, &window, &[&file]).drop();
    until("the model", || {
        let shot = screen.shot(&window);
        (shot.count(BACKGROUND) == 0
            && runs(&shot, 4).len() >= 4
            && viewer.settled(Duration::from_millis(300), Duration::from_secs(60)).is_some())
        .then_some(())
    });
    screen.save(&window, "dropped.png");
    assert_eq!(fs::read_to_string(folder.path().join("a.rhai")).unwrap(), SCRIPT);

    let added = added_to_script(&screen, &window, &viewer, folder.path());
    assert_eq!(added, format!("{SCRIPT}let my_square = cast(\"my_square\", load(\"my square.obj\"));\n"));
    // The script is shown again, with the square added.
    until("the scene", || {
        let count = screen.shot(&window).count(BACKGROUND);
        (count > 5_000 && count + 500 < before.count(BACKGROUND)).then_some(())
    });
    screen.save(&window, "added.png");
    // The file manager exits: the pointer is free again.
    drop(Drag::over(&screen.display, &window, &[&file]));
    until("a hint", || (screen.shot(&window).count(BACKGROUND) == 0).then_some(()));
    screen.xdotool(&["mousemove", "--window", &window, "640", "820"]);
    until("all as before", || (screen.shot(&window).count(BACKGROUND) > 5_000).then_some(()));
    assert_clean_exit(&screen, &window, viewer, folder.path());
}

#[test]
fn files_that_are_dropped_together_are_all_shown_and_added() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (viewer, window) = open(&screen, folder.path(), &[]);
    beside_the_image(&screen, &window);
    let files = ["left.obj", "middle one.obj", "right.obj"].map(|name| folder.path().join(name));
    for (file, color) in files.iter().zip(["1 0 0", "0 1 0", "0 0 1"]) {
        fs::write(file, format!("mtllib {0}.mtl\nusemtl m\n{SQUARE}", color.replace(' ', ""))).unwrap();
        let material = format!("newmtl m\nKd 0 0 0\nKe {color}\n");
        fs::write(folder.path().join(format!("{}.mtl", color.replace(' ', ""))), material).unwrap();
    }
    let paths = files.each_ref().map(|file| file.as_path());
    Drag::over(&screen.display, &window, &paths).drop();
    // The models have different emissive colors, from left to right.
    let strong = [[true, false, false], [false, true, false], [false, false, true]];
    let bounds = until("all three", || {
        let shot = screen.shot(&window);
        screen.save(&window, "three.png");
        let found = strong.map(|channels| {
            let is =
                |p: &[u8]| p.iter().zip(channels).all(|(v, strong)| if strong { *v > 150 } else { *v < 60 });
            let all = shot.rgb.chunks_exact(3).enumerate().filter(|(_, p)| is(p));
            let all: Vec<usize> = all.map(|(i, _)| i % shot.width).collect();
            Some((*all.iter().min()?, *all.iter().max()?)).filter(|_| all.len() > 2000)
        });
        Some([found[0]?, found[1]?, found[2]?])
    });
    assert!(bounds[0].1 < bounds[1].0 && bounds[1].1 < bounds[2].0, "{bounds:?}");
    let added = added_to_script(&screen, &window, &viewer, folder.path());
    let lines = "let left = cast(\"left\", load(\"left.obj\"));\n\
                 let middle_one = cast(\"middle_one\", load(\"middle one.obj\")).at(2.2, 0.0, 0.0);\n\
                 let right = cast(\"right\", load(\"right.obj\")).at(4.4, 0.0, 0.0);\n";
    assert_eq!(added, format!("{SCRIPT}{lines}"));
    until("the script", || (screen.shot(&window).count(BACKGROUND) > 5_000).then_some(()));
    screen.key(&window, "ctrl+z");
    until("one change", || {
        (fs::read_to_string(folder.path().join("a.rhai")).unwrap() == SCRIPT).then_some(())
    });
    assert_clean_exit(&screen, &window, viewer, folder.path());
}

/// Clicks "Add to script", the fifth button of the top bar (Add is disabled then), and returns the changed script.
fn added_to_script(screen: &Screen, window: &str, viewer: &ViewerProcess, folder: &Path) -> String {
    screen.rest(viewer.process.0.id());
    let [x, y] = [buttons(&screen.shot(window))[4], 12].map(|n| n.to_string());
    screen.xdotool(&["mousemove", "--window", window, &x, &y]);
    screen.rest(viewer.process.0.id());
    screen.xdotool(&["click", "1"]);
    until("the lines", || Some(fs::read_to_string(folder.join("a.rhai")).unwrap()).filter(|t| t != SCRIPT))
}

/// Centers of the buttons in the top bar.
fn buttons(shot: &Screenshot) -> Vec<usize> {
    let runs = runs(shot, 4);
    assert!(runs.len() >= 5, "{runs:?}");
    runs.iter().map(|[a, b]| (a + b) / 2).collect()
}

/// Width of the first button.
fn first_button(shot: &Screenshot, scale: f64) -> Option<usize> {
    runs(shot, (4.0 * scale) as usize).first().map(|[a, b]| b - a)
}

/// Start and end of each button in a row of pixels, found by color.
fn runs(shot: &Screenshot, y: usize) -> Vec<[usize; 2]> {
    let color = [60; 3];
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for x in (4..shot.width).filter(|x| shot.is(*x, y, color)) {
        match runs.last_mut().filter(|run| run[1] + 1 == x) {
            Some(run) => run[1] = x,
            None => runs.push([x, x]),
        }
    }
    runs.retain(|[a, b]| b - a > 15);
    runs
}
