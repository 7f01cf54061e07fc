//! Random use of the viewer by a seed: edits, drags, errors and repairs, resizes, playback. Memory and objects of the viewer must not grow, it
//! must not crash, and the validation layer must report nothing:
//! `CHOREO_MINUTES=60 cargo test -p choreo -p choreo-viewer --test endurance hour -- --ignored --nocapture` (default: 10); `CHOREO_SEED`.

use crate::screen::random::Random;
use crate::screen::resource_record::ResourceRecord;
use crate::screen::viewer_process::ViewerProcess;
use crate::screen::{Screen, assert_no_errors, is_validation_installed};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 4.0, samples: 1 });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" })).at(-0.6, 0.0, 0.0);
ada.play(moves.clip("Walk")).from(0.0).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.5 });
let bob = cast("bob", moves).key("position", [[0.0, [0.6, 0, 0]], [4.0, [0.6, 0, 1]]]);
bob.play(moves.clip("Dance_Groove")).until(3.0);
camera("wide").at(0.0, 1.4, 5.0).look_at([0.0, 0.9, 0.0]);
camera("near").at(0.4, 1.4, 3.0).look_at([0.0, 0.9, 0.0]).cut(3.0);
sun(#{ direction: [-0.6, -1.0, -0.9] });
effect("glow", #{ amount: 0.2 });
marker("hello", 2.0);
"##;

const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (1.0 + BY * p[amount]);\n}\n";

struct SimulatedUser<'a> {
    screen: &'a Screen,
    window: &'a str,
    folder: &'a Path,
    random: Random,
    size: [u64; 2],
}

impl SimulatedUser<'_> {
    fn save(&self, text: &str) {
        // Text editors save in place, or write a new file and rename it.
        let file = self.folder.join("a.rhai");
        if text.len().is_multiple_of(2) {
            fs::write(self.folder.join("a.new"), text).unwrap();
            fs::rename(self.folder.join("a.new"), file).unwrap();
        } else {
            fs::write(file, text).unwrap();
        }
    }

    fn random_point(&mut self, part: [u64; 4]) -> [String; 2] {
        // `part` is in hundredths of the window: left, right, top, bottom.
        let [left, right, top, bottom] = part;
        let x = self.size[0] * (left + self.random.next(right - left)) / 100;
        let y = self.size[1] * (top + self.random.next(bottom - top)) / 100;
        [x.to_string(), y.to_string()]
    }

    fn drag(&mut self, part: [u64; 4], button: &str) {
        let (from, to) = (self.random_point(part), self.random_point(part));
        let window = self.window;
        self.screen.xdotool(&["mousemove", "--window", window, &from[0], &from[1], "mousedown", button]);
        self.screen.xdotool(&[
            "mousemove",
            "--window",
            window,
            &to[0],
            &to[1],
            "sleep",
            "0.05",
            "mouseup",
            button,
        ]);
        // A drag can open a dialog, which blocks all other input.
        if self.random.next(4) == 0 {
            self.screen.key(self.window, "Escape");
        }
    }

    /// Performs one random action of a user.
    fn perform_random_action(&mut self) {
        // Initial places of the panels.
        const PICTURE: [u64; 4] = [20, 70, 14, 60];
        const BARS: [u64; 4] = [12, 98, 72, 96];
        let number = self.random.next(1000) as f64 / 500.0;
        match self.random.next(16) {
            0 | 1 => self.save(&SCRIPT.replace("-0.6, 0.0", &format!("{:.3}, 0.0", number - 1.0))),
            2 => self.save(&SCRIPT.replace("until(2.0)", &format!("until({:.2})", 1.0 + number / 2.0))),
            3 => self.save(&SCRIPT.replace("\"Wave\"", "\"Waev\"")),
            4 => self.save(SCRIPT.split_at(SCRIPT.len() / 2).0),
            5 => {
                let text = GLOW.replace("BY", &format!("{number:.3}"));
                fs::write(self.folder.join("glow.wgsl"), text).unwrap();
            }
            6 => fs::write(self.folder.join("glow.wgsl"), GLOW.replace("BY", "nothing")).unwrap(),
            7 | 8 => self.drag(BARS, "1"),
            9 => self.drag(PICTURE, "1"),
            10 => self.drag(PICTURE, "3"),
            11 => {
                let at = self.random_point(PICTURE);
                let window = self.window;
                self.screen.xdotool(&["mousemove", "--window", window, &at[0], &at[1], "click", "1"]);
            }
            12 => {
                let at = self.random_point(PICTURE);
                let (window, wheel) = (self.window, self.random.one(&["4", "5"]));
                self.screen.xdotool(&["mousemove", "--window", window, &at[0], &at[1], "click", wheel]);
            }
            13 => {
                self.size = [400 + self.random.next(980), 300 + self.random.next(680)];
                let [width, height] = self.size.map(|s| s.to_string());
                self.screen.xdotool(&["windowsize", self.window, &width, &height]);
            }
            _ => {
                // F1 is left out: a click in the list of shortcuts takes the next key for an action.
                let keys = [
                    "space",
                    "space",
                    "Home",
                    "End",
                    "Left",
                    "Right",
                    "c",
                    "f",
                    "g",
                    "r",
                    "b",
                    "l",
                    "t",
                    "n",
                    "i",
                    "o",
                    "h",
                    "Prior",
                    "Next",
                    "Escape",
                    "ctrl+z",
                    "ctrl+z",
                    "ctrl+y",
                    "ctrl+1",
                    "ctrl+2",
                    "ctrl+3",
                    "ctrl+4",
                    "ctrl+5",
                    "ctrl+6",
                    "ctrl+7",
                    "ctrl+8",
                    "alt+Left",
                    "alt+Right",
                    "ctrl+equal",
                    "ctrl+minus",
                    "Tab",
                ];
                self.screen.key(self.window, self.random.one(&keys));
            }
        }
    }

    /// Restores the initial state and waits until the viewer is idle.
    fn restore_view(&mut self, viewer: &ViewerProcess) -> Value {
        fs::write(self.folder.join("glow.wgsl"), GLOW.replace("BY", "1.0")).unwrap();
        self.size = [1280, 860];
        self.screen.xdotool(&["windowsize", self.window, "1280", "860"]);
        for key in ["Escape", "ctrl+0", "ctrl+1", "Home"] {
            self.screen.key(self.window, key);
        }
        let quiet = Duration::from_millis(1500);
        let mut marked = 0;
        loop {
            // Earlier log lines are outdated.
            if viewer.settled(quiet, Duration::from_secs(6)).is_none() {
                // Playback is on.
                self.screen.key(self.window, "space");
                continue;
            }
            marked += 1;
            self.save(&format!("{SCRIPT}// {marked}\n"));
            if let Some(Some(shown)) = viewer.settled(quiet, Duration::from_secs(20)) {
                return shown;
            }
            assert!(marked < 20, "the viewer shows no new frame");
        }
    }
}

#[test]
#[ignore = "takes ten minutes, or as many as asked for"]
fn random_use_leaks_no_memory_or_file_handles() {
    let Some(screen) = Screen::new() else { return };
    let number =
        |name: &str, usual: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual);
    let (minutes, seed) = (number("CHOREO_MINUTES", 10), number("CHOREO_SEED", 7));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.rhai"), SCRIPT).unwrap();
    fs::write(folder.path().join("glow.wgsl"), GLOW.replace("BY", "1.0")).unwrap();
    let mut command = screen.command(&[folder.path().join("a.rhai").to_str().unwrap()], folder.path());
    if is_validation_installed() {
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    }
    command.stderr(fs::File::create(folder.path().join("said.txt")).unwrap());
    let mut viewer = ViewerProcess::start(command);
    viewer.shown(1);
    let window = screen.window();
    let random = Random::new(seed);
    let mut person =
        SimulatedUser { screen: &screen, window: &window, folder: folder.path(), random, size: [1280, 860] };
    let mut actions = 0u64;
    let mut resource_record = ResourceRecord::default();
    for minute in 0..=minutes {
        let end = Instant::now() + Duration::from_secs(if minute == 0 { 0 } else { 60 });
        while Instant::now() < end {
            person.perform_random_action();
            actions += 1;
            assert!(viewer.process.0.try_wait().unwrap().is_none(), "the viewer process has ended");
        }
        let shown = person.restore_view(&viewer);
        resource_record.note(minute, actions, &viewer, &shown);
        assert_no_errors(folder.path());
    }
    screen.key(&window, "ctrl+q");
    let status = crate::screen::until("the end", || viewer.process.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
    resource_record.assert_no_growth();
}
