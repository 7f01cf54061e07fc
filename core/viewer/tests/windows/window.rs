//! A real window on a virtual display, operated like a user: opened, played, scrubbed; the script edited, broken and
//! repaired; resized and closed.

use crate::screen::{Running, Screen, Screenshot, assert_no_errors, until};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 3.0, background: #{ top: "#204060", bottom: "#204060" } });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Dance_Groove"));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"##;

const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];

#[test]
fn one_window_session_covers_playback_reload_and_screenshot() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let mut viewer = screen.view(&[script.to_str().unwrap()], folder.path());
    let window = screen.window();
    // Opening: the image appears.
    let first = until("the first image", || {
        let shot = screen.shot(&window);
        (shot.count(BACKGROUND) > 20_000).then_some(shot)
    });
    // Its pixels equal those of `render`.
    assert_same_as_render(&first, &script, folder.path());
    screen.save(&window, "open.png");

    // Shortcuts: another frame gives another image, and Home the first again.
    screen.xdotool(&["mousemove", "--window", &window, "600", "300"]);
    screen.key(&window, "End");
    until("the last frame", || (screen.shot(&window) != first).then_some(()));
    screen.key(&window, "Home");
    until("the first frame", || {
        (screen.shot(&window).count(BACKGROUND) == first.count(BACKGROUND)).then_some(())
    });

    // The image is saved next to the script, identical to that of `render`.
    screen.key(&window, "p");
    let saved = folder.path().join("a_0.png");
    until("the saved image", || saved.is_file().then_some(()));
    let saved = screen.run("convert", &[saved.to_str().unwrap(), "-depth", "8", "ppm:-"]);
    let saved = Screenshot::read(&saved.stdout).unwrap();
    assert_eq!([saved.width, saved.height], [320, 180]);
    assert!(saved.count(BACKGROUND) == first.count(BACKGROUND), "the same image");

    // Playback starts and pauses.
    screen.key(&window, "space");
    let a = screen.shot(&window);
    until("movement", || (screen.shot(&window) != a).then_some(()));
    screen.save(&window, "playing.png");
    screen.key(&window, "space");
    until("rest", || {
        let a = screen.shot(&window);
        std::thread::sleep(Duration::from_millis(300));
        (screen.shot(&window) == a).then_some(())
    });

    // An edit, saved as most editors do: the new background appears.
    let green = SCRIPT.replace("#204060", "#206040");
    fs::write(folder.path().join("a.rhai.new"), &green).unwrap();
    fs::rename(folder.path().join("a.rhai.new"), &script).unwrap();
    until("the edit", || (screen.shot(&window).count([0x20, 0x60, 0x40]) > 20_000).then_some(()));
    // An error in the script: the image stays.
    fs::write(&script, green.replace("Dance_Groove", "Dance_Grove")).unwrap();
    std::thread::sleep(Duration::from_millis(1000));
    until("the last good image", || (screen.shot(&window).count([0x20, 0x60, 0x40]) > 20_000).then_some(()));
    screen.save(&window, "broken.png");
    // The script is repaired.
    fs::write(&script, green.replace("#206040", "#602040")).unwrap();
    until("the mended version", || (screen.shot(&window).count([0x60, 0x20, 0x40]) > 20_000).then_some(()));

    // The window is resized, large and small.
    for (width, height) in [(500, 400), (1390, 990), (330, 210), (1200, 800)] {
        screen.xdotool(&["windowsize", &window, &width.to_string(), &height.to_string()]);
        until("the window in its new size", || {
            let shot = screen.shot(&window);
            (shot.width == width && shot.height == height).then_some(())
        });
    }
    until("the image", || (screen.shot(&window).count([0x60, 0x20, 0x40]) > 20_000).then_some(()));
    screen.save(&window, "resized.png");

    // The window is closed, with exit code 0.
    assert!(viewer.0.try_wait().unwrap().is_none(), "it is still there");
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
}

/// Compares the window's image, found by its background color, with that of `render` at the same size.
fn assert_same_as_render(shot: &Screenshot, script: &Path, folder: &Path) {
    let [left, top, right, bottom] = shot.bounds(BACKGROUND);
    assert_eq!([right - left, bottom - top], [320, 180], "the image has its own size");
    let picture = folder.join("a.png");
    let viewer = PathBuf::from(env!("CARGO_BIN_EXE_choreo-view"));
    let args = ["render", "--at", "0", "--device", "vulkan", "--quiet", "-o"].map(String::from);
    let mut args: Vec<std::ffi::OsString> = args.into_iter().map(Into::into).collect();
    args.insert(0, viewer.into());
    args.push(picture.clone().into());
    args.push(script.into());
    let code = choreo::run(args, &choreo::app());
    assert_eq!(format!("{code:?}"), format!("{:?}", std::process::ExitCode::SUCCESS));
    let output = Command::new("convert").arg(&picture).args(["-depth", "8", "ppm:-"]).output().unwrap();
    let rendered = Screenshot::read(&output.stdout).unwrap();
    let mut worst = 0;
    for y in 0..180 {
        for x in 0..320 {
            let (a, b) = (shot.pixel(left + x, top + y), rendered.pixel(x, y));
            worst = worst.max(a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0));
        }
    }
    // The device decodes from sRGB and encodes again, which can differ by one step.
    assert!(worst <= 1, "worst difference {worst}");
}

#[test]
fn a_missing_display_is_reported() {
    let output = Command::new(env!("CARGO_BIN_EXE_choreo-view"))
        .arg("a.rhai")
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4));
    assert!(text.starts_with("cannot open a window: there is no display: "), "{text}");
    assert!(text.contains("choreo render"), "{text}");
}

#[test]
fn a_display_that_does_not_answer_is_a_message() {
    let output = Command::new(env!("CARGO_BIN_EXE_choreo-view"))
        .arg("a.rhai")
        .env("DISPLAY", ":98765")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.starts_with("cannot open a window: "), "{text}");
}

#[test]
fn an_unreachable_wayland_display_is_reported_and_x11_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_choreo-view"))
        .arg("a.rhai")
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .env("WAYLAND_DISPLAY", "wayland-9")
        .env("XDG_RUNTIME_DIR", folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.starts_with("cannot open a window: ") && !text.contains("apt install"), "{text}");
    let Some(screen) = Screen::new() else { return };
    let script = folder.path().join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let mut command = screen.command(&[script.to_str().unwrap()], folder.path());
    command.env_remove("WAYLAND_SOCKET").env("WAYLAND_DISPLAY", "wayland-9");
    command.env("XDG_RUNTIME_DIR", folder.path());
    let viewer = Running(command.spawn().unwrap());
    screen.window();
    drop(viewer);
}

/// Libraries that are loaded when a window is opened, and their packages. (libX11 is also searched for by its absolute path.)
const LIBRARIES: [(&[&str], &str); 5] = [
    (&["libX11-xcb.so.1", "libX11-xcb.so"], "libx11-xcb1"),
    (&["libXcursor.so.1", "libXcursor.so"], "libxcursor1"),
    (&["libXi.so.6", "libXi.so"], "libxi6"),
    (&["libxkbcommon.so.0", "libxkbcommon.so"], "libxkbcommon0"),
    (&["libxkbcommon-x11.so.0", "libxkbcommon-x11.so"], "libxkbcommon-x11-0"),
];

/// Each library is disabled by an empty file with its name that is found first.
#[test]
fn a_missing_library_is_reported_with_its_package_and_render_still_works() {
    let Some(screen) = Screen::new() else { return };
    for (files, package) in LIBRARIES {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("a.rhai");
        fs::write(&script, SCRIPT).unwrap();
        let hidden = folder.path().join("hidden");
        fs::create_dir(&hidden).unwrap();
        files.iter().for_each(|file| fs::write(hidden.join(file), "").unwrap());
        let mut command = screen.command(&[script.to_str().unwrap()], folder.path());
        let said = fs::File::create(folder.path().join("said.txt")).unwrap();
        command.env("LD_LIBRARY_PATH", &hidden).stderr(said);
        let mut viewer = crate::screen::Running(command.spawn().unwrap());
        let status = until("the end", || viewer.0.try_wait().unwrap());
        let said = fs::read_to_string(folder.path().join("said.txt")).unwrap();
        assert_eq!(status.code(), Some(4), "{package}: {said}");
        assert!(said.contains("cannot open a window: "), "{package}: {said}");
        let hint =
            said.lines().find(|l| l.contains("hint: apt install ")).unwrap_or_else(|| panic!("{said}"));
        assert!(hint.split_whitespace().any(|word| word == package), "{package}: {said}");
        assert!(said.contains("choreo render draws the same frames without one"), "{package}: {said}");
        assert!(!said.contains("panicked") && !said.contains(".rs:"), "{package}: {said}");
        // `render` writes the same image without a window, with the same library disabled.
        let picture = folder.path().join("a.png");
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "window::draws_for_another_test", "--ignored"])
            .env("LD_LIBRARY_PATH", &hidden)
            .env("CHOREO_DRAWN", &picture)
            .env("CHOREO_SCRIPT", &script)
            .output()
            .unwrap();
        assert!(output.status.success(), "{package}: {}", String::from_utf8_lossy(&output.stdout));
        assert!(picture.is_file(), "{package}");
    }
}

#[test]
#[ignore = "is run by another test, where a library is missing"]
fn draws_for_another_test() {
    let (Some(picture), Some(script)) = (std::env::var_os("CHOREO_DRAWN"), std::env::var_os("CHOREO_SCRIPT"))
    else {
        return;
    };
    let mut args: Vec<std::ffi::OsString> =
        ["choreo", "render", "--at", "0", "--quiet", "-o"].map(Into::into).into();
    args.extend([picture, script]);
    let code = choreo::run(args, &choreo::app());
    assert_eq!(format!("{code:?}"), format!("{:?}", std::process::ExitCode::SUCCESS));
}
