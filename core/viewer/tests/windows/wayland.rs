//! A window on Wayland: an actor is selected and dragged, the drag is undone, the output scale grows, and the window is closed. With Vulkan under
//! the validation layer, and on the CPU.

use crate::screen::wayland::{Compositor, KEY_Q, KEY_Z, SIZE};
use crate::screen::{
    self, Running, Screenshot, assert_no_errors, is_validation_installed, rest, start_in, until,
};
use std::fs;
use std::path::Path;

const SCRIPT: &str = r##"stage(#{ size: [640, 360], fps: 30, length: 4.0, background: #{ top: "#204060", bottom: "#204060" }, view: "none" });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" })).at(-0.8, 0.0, 0.0);
camera("wide").at(0.0, 1.3, 5.0).look_at([0.0, 0.9, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"##;

const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];
/// Color of the gizmo's arrow along x.
const ALONG_X: [u8; 3] = [0xe0, 0x55, 0x4d];
/// A rectangle that lies within the viewport: left, top, right, bottom.
const PICTURE: [usize; 4] = [200, 110, 900, 540];

fn viewer(compositor: &Compositor, folder: &Path, vulkan: bool) -> Running {
    fs::write(folder.join("a.rhai"), SCRIPT).unwrap();
    let mut command = screen::viewer(if vulkan { "vulkan" } else { "cpu" }, &["a.rhai"], folder);
    compositor.connect(&mut command);
    start_in(command, folder, vulkan && is_validation_installed())
}

/// Pixels of the viewport whose color satisfies `is`, from left to right.
fn pixels(shot: &Screenshot, is: impl Fn([u8; 3]) -> bool) -> Vec<(usize, usize)> {
    let [left, top, right, bottom] = PICTURE;
    let all = (left..right).flat_map(|x| (top..bottom).map(move |y| (x, y)));
    all.filter(|(x, y)| is(shot.pixel(*x, *y))).collect()
}

fn is_coral([red, green, blue]: [u8; 3]) -> bool {
    red > 150 && green < 130 && blue < 110 && red > green + 70
}

#[test]
fn an_actor_is_dragged_on_wayland_by_vulkan_and_by_the_cpu() {
    let Some(compositor) = Compositor::new() else { return };
    let mut hands = compositor.create_input_devices();
    for vulkan in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let mut viewer = viewer(&compositor, folder.path(), vulkan);
        let wait = || rest(&[viewer.0.id(), compositor.server.0.id()]);
        let text = || fs::read_to_string(folder.path().join("a.rhai")).unwrap();
        let ada = until("ada", || {
            let all = pixels(&compositor.shot(), is_coral);
            (all.len() > 200).then(|| all[all.len() / 2])
        });
        wait();
        // A click selects ada, and her red arrow is dragged: one number of the script changes.
        hands.to(ada.0, ada.1);
        wait();
        hands.button(true);
        hands.button(false);
        let arrow =
            || pixels(&compositor.shot(), |p| p.iter().zip(ALONG_X).all(|(a, b)| a.abs_diff(b) <= 3)).pop();
        let (x, y) = until("the red arrow", arrow);
        compositor.save(&format!("wayland_{vulkan}.png"));
        hands.to(x - 6, y);
        wait();
        hands.button(true);
        for step in 1..=8 {
            hands.to(x - 6 + step * 8, y);
            wait();
        }
        hands.button(false);
        let moved = until("the change", || Some(text()).filter(|t| t != SCRIPT));
        let lines: Vec<_> = SCRIPT.lines().zip(moved.lines()).filter(|(a, b)| a != b).collect();
        assert_eq!(lines.len(), 1, "{moved}");
        assert!(lines[0].1.starts_with("let ada = cast(") && lines[0].1.contains(".at(-0."), "{moved}");
        wait();
        hands.ctrl(KEY_Z);
        until("the undo", || (text() == SCRIPT).then_some(()));

        // At twice the output scale the window has half as many points: the panels still fit.
        compositor.run_sway_command("output * scale 2");
        wait();
        let corner = |shot: &Screenshot| shot.pixel(SIZE[0] as usize - 60, SIZE[1] as usize - 60);
        until("the finer output", || {
            let shot = compositor.shot();
            (shot.count(BACKGROUND) > 20_000 && corner(&shot) != BACKGROUND).then_some(())
        });
        compositor.save(&format!("wayland_{vulkan}_2.png"));
        compositor.run_sway_command("output * scale 1");
        wait();
        let shot = compositor.shot();
        assert_eq!([shot.width, shot.height], SIZE.map(|s| s as usize));

        hands.ctrl(KEY_Q);
        let status = until("the end", || viewer.0.try_wait().unwrap());
        assert_eq!(status.code(), Some(0));
        assert_no_errors(folder.path());
    }
}

/// Closing the window by the compositor ends the viewer like its own shortcut. The window is found by its application id.
#[test]
fn a_window_that_the_compositor_closes_ends_the_viewer() {
    let Some(compositor) = Compositor::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut viewer = viewer(&compositor, folder.path(), true);
    until("the window", || compositor.has_window().then_some(()));
    until("ada", || (pixels(&compositor.shot(), is_coral).len() > 200).then_some(()));
    compositor.run_sway_command("[app_id=choreo-view] kill");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
}
