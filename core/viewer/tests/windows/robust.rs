//! Stress tests of a window: resized a thousand times, made tiny, hidden, scaled, with a lost device and a killed display.
//! There must be no panic, no message of the validation layer, and no lost state.

use crate::screen::{Screen, assert_no_errors, until};
use std::fs;
use std::path::Path;
use std::time::Duration;

const SCRIPT: &str = r##"stage(#{ size: [160, 90], fps: 30, length: 3.0, background: #{ top: "#204060", bottom: "#204060" } });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Dance_Groove"));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
"##;
const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];

fn script(folder: &Path) -> String {
    let script = folder.join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    script.to_string_lossy().into_owned()
}

fn picture(screen: &Screen, window: &str) {
    until("the image", || (screen.shot(window).count(BACKGROUND) > 3_000).then_some(()));
}

fn assert_clean_exit(screen: &Screen, window: &str, viewer: &mut crate::screen::Running) {
    assert!(viewer.0.try_wait().unwrap().is_none(), "it is still there");
    screen.key(window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_thousand_resizes_including_tiny_sizes_do_not_crash() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut viewer = screen.view(&[&script(folder.path()), "--play"], folder.path());
    let window = screen.window();
    picture(&screen, &window);
    // A hundred sizes at a time, among them one pixel and more than the screen.
    for round in 0..10u32 {
        let mut all: Vec<String> = Vec::new();
        for n in 0..100u32 {
            let (width, height) = match n {
                50 => (1, 1),
                51 => (1400, 1),
                52 => (1, 1000),
                _ => (200 + (n * 37 + round * 131) % 1200, 150 + (n * 53 + round * 71) % 850),
            };
            all.extend(["windowsize".into(), window.clone(), width.to_string(), height.to_string()]);
        }
        let all: Vec<&str> = all.iter().map(String::as_str).collect();
        screen.xdotool(&all);
    }
    for _ in 0..5 {
        screen.xdotool(&["windowunmap", &window]);
        screen.xdotool(&["windowmap", &window]);
    }
    screen.xdotool(&["windowsize", &window, "1200", "800"]);
    until("the window in its new size", || (screen.shot(&window).width == 1200).then_some(()));
    // Doubled scale and back.
    for key in ["ctrl+equal", "ctrl+minus"] {
        for _ in 0..12 {
            screen.key(&window, key);
        }
    }
    picture(&screen, &window);
    assert_clean_exit(&screen, &window, &mut viewer);
    assert_no_errors(folder.path());
}

#[test]
fn a_lost_device_is_recreated_and_the_panels_stay() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let lose = ["--lose-device-at", "3", "--lose-device-at", "12", "--play"];
    let path = script(folder.path());
    let args: Vec<&str> = std::iter::once(path.as_str()).chain(lose).collect();
    let mut viewer = screen.view(&args, folder.path());
    let window = screen.window();
    picture(&screen, &window);
    // Playback continues.
    let before = screen.shot(&window);
    until("movement", || (screen.shot(&window) != before).then_some(()));
    assert_clean_exit(&screen, &window, &mut viewer);
    assert_no_errors(folder.path());
}

#[test]
fn repeated_device_loss_ends_with_an_error_message() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let lose = ["--lose-device-at", "2", "--lose-device-at", "3", "--lose-device-at", "4", "--play"];
    let path = script(folder.path());
    let args: Vec<&str> = std::iter::once(path.as_str()).chain(lose).collect();
    let mut viewer = screen.view(&args, folder.path());
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(4));
    let said = fs::read_to_string(folder.path().join("said.txt")).unwrap();
    assert!(said.contains("the window can no longer be drawn: the device was lost"), "{said}");
    assert_no_errors(folder.path());
}

#[test]
fn losing_the_display_ends_the_viewer_without_a_panic() {
    // The display is killed at several moments.
    for wait in [0, 3, 17, 40] {
        let Some(mut screen) = Screen::new() else { return };
        let folder = tempfile::tempdir().unwrap();
        let path = script(folder.path());
        let mut viewer = screen.view(&[&path, "--play"], folder.path());
        let window = screen.window();
        picture(&screen, &window);
        std::thread::sleep(Duration::from_millis(wait));
        screen.server.0.kill().unwrap();
        let status = until("the end", || viewer.0.try_wait().unwrap());
        assert_eq!(status.code(), Some(4));
        assert_no_errors(folder.path());
        let said = fs::read_to_string(folder.path().join("said.txt")).unwrap();
        assert!(said.contains("the connection to the window system was lost"), "{said}");
        // The script is unchanged.
        assert_eq!(fs::read_to_string(&path).unwrap(), SCRIPT);
    }
}

#[test]
fn a_window_shown_again_displays_the_changed_scene() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = script(folder.path());
    let mut viewer = screen.view(&[&path], folder.path());
    let window = screen.window();
    picture(&screen, &window);
    screen.xdotool(&["windowunmap", "--sync", &window]);
    fs::write(&path, SCRIPT.replace("#204060", "#602040")).unwrap();
    std::thread::sleep(Duration::from_millis(800));
    screen.xdotool(&["windowmap", "--sync", &window]);
    until("the new image", || (screen.shot(&window).count([0x60, 0x20, 0x40]) > 3_000).then_some(()));
    assert_clean_exit(&screen, &window, &mut viewer);
    assert_no_errors(folder.path());
}

/// A high-density screen shows everything twice as large, and image pixels map one to one to screen pixels.
#[test]
fn at_display_scale_two_the_image_is_drawn_pixel_for_pixel() {
    let Some(screen) = Screen::new() else { return };
    if !crate::screen::is_program_installed("xprop") {
        println!("SKIP 1: xprop is not installed");
        return;
    }
    let set = ["-root", "-f", "RESOURCE_MANAGER", "8s", "-set", "RESOURCE_MANAGER", "Xft.dpi:\t192\n"];
    assert!(screen.run("xprop", &set).status.success());
    let folder = tempfile::tempdir().unwrap();
    let path = script(folder.path());
    let mut viewer = screen.view(&[&path], folder.path());
    let window = screen.window();
    picture(&screen, &window);
    let size = screen.xdotool(&["getwindowgeometry", "--shell", &window]);
    assert!(size.contains("WIDTH=2560") && size.contains("HEIGHT=1720"), "{size}");
    // The window must fit on the screen, which is smaller, so that it is visible as a whole.
    screen.xdotool(&["windowsize", "--sync", &window, "1400", "1000"]);
    let shot = until("the window in its new size", || Some(screen.shot(&window)).filter(|s| s.width == 1400));
    until("the image of its own size", || {
        let [left, top, right, bottom] = screen.shot(&window).bounds(BACKGROUND);
        (left < right && [right - left, bottom - top] == [160, 90]).then_some(())
    });
    assert!(shot.height == 1000);
    screen.save(&window, "twice.png");
    assert_clean_exit(&screen, &window, &mut viewer);
    assert_no_errors(folder.path());
}
