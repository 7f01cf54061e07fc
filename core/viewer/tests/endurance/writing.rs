//! A simulated user writes `scripts/02_layers.rhai` in a text editor next to the viewer: line by line from an empty file, with errors that are
//! fixed, saved in the three ways of text editors. In between the user looks around, drags a bar, a clip of the inspector and the actor, and
//! undoes and redoes it. One test runs as fast as possible; the other at the pace of a person, with breaks, for the requested time:
//! `CHOREO_MINUTES=60 cargo test -p choreo -p choreo-viewer --test endurance writing -- --ignored --nocapture`.

use crate::screen::random::Random;
use crate::screen::resource_record::ResourceRecord;
use crate::screen::viewer_process::ViewerProcess;
use crate::screen::{Screen, Screenshot, assert_no_errors, is_validation_installed, until};
use choreo_viewer::panels::color_of_clip;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Color of the playhead in the sequencer.
const PLAYHEAD: [u8; 3] = [0xff, 0x6a, 0x3d];
/// Colors of the gizmo's arrow along x and of its ring about y.
const ALONG_X: [u8; 3] = [0xe0, 0x55, 0x4d];
const ABOUT_Y: [u8; 3] = [0x6a, 0xb0, 0x3f];
/// Color of the buttons of the inspector.
const BUTTON: [u8; 3] = [60; 3];
/// Initial places of the panels in a window of 1280 × 860; of the inspector only the buttons of clips.
const SEQUENCER: [usize; 2] = [600, 860];
const CLIPS: [usize; 3] = [949, 325, 560];
const PICTURE: [usize; 4] = [200, 110, 900, 540];

struct SimulatedUser<'a> {
    screen: &'a Screen,
    window: &'a str,
    viewer: &'a ViewerProcess,
    file: PathBuf,
    random: Random,
    /// Mean pause between two actions, seconds.
    pace: f64,
    /// Newest version number that the viewer has reported.
    version: u64,
    saves: u64,
    actions: u64,
}

impl SimulatedUser<'_> {
    /// Pauses like a user between two actions.
    fn pause(&mut self) {
        let part = 0.5 + self.random.next(1000) as f64 / 1000.0;
        std::thread::sleep(Duration::from_secs_f64(self.pace * part));
    }

    /// Saves in one of three ways: in place; to a new file renamed over the old one; with the old file moved away first.
    fn save(&mut self, text: &str) {
        assert_ne!(text, self.text(), "the text differs from the saved one");
        let beside = self.file.with_extension("new");
        match self.saves % 3 {
            0 => fs::write(&self.file, text).unwrap(),
            1 => {
                fs::write(&beside, text).unwrap();
                fs::rename(&beside, &self.file).unwrap();
            }
            _ => {
                fs::rename(&self.file, &beside).unwrap();
                fs::write(&self.file, text).unwrap();
                fs::remove_file(&beside).unwrap();
            }
        }
        self.saves += 1;
        self.actions += 1;
    }

    fn text(&self) -> String {
        fs::read_to_string(&self.file).unwrap()
    }

    /// Waits for a version newer than the known ones. `good`: it must load, and its frame is awaited, too.
    fn wait_for_version(&mut self, good: bool) {
        loop {
            let (number, faulty) = self.viewer.version(self.version);
            self.version = number;
            if !faulty && good {
                self.viewer.shown(number);
            }
            if !faulty || !good {
                return;
            }
        }
    }

    fn keys(&mut self, keys: &[&str]) {
        for key in keys {
            self.screen.key(self.window, key);
            self.actions += 1;
        }
    }

    /// Presses keys, waiting for each to take effect.
    fn drag(&mut self, from: (usize, usize), to: (usize, usize)) {
        let move_to = |x: usize, y: usize| {
            let [x, y] = [x, y].map(|n| n.to_string());
            self.screen.xdotool(&["mousemove", "--window", self.window, &x, &y]);
            std::thread::sleep(Duration::from_secs_f64(0.03 + self.pace / 20.0));
            self.screen.rest(self.viewer.process.0.id());
        };
        move_to(from.0, from.1);
        self.screen.xdotool(&["mousedown", "1"]);
        for step in 1..=6 {
            let part = |a: usize, b: usize| (a * (6 - step) + b * step) / 6;
            move_to(part(from.0, to.0), part(from.1, to.1));
        }
        self.screen.xdotool(&["mouseup", "1"]);
        self.actions += 1;
    }

    /// Inserts a typing error: half a line, a wrong name or a missing parenthesis.
    fn insert_typo(&mut self, before: &str, line: &str) -> Option<String> {
        let half = line.char_indices().nth(line.chars().count() / 2)?.0;
        let mistyped = match self.random.next(3) {
            0 => line[..half].to_string(),
            1 => line.replacen("(\"", "(\"x", 1),
            _ => line.replacen(')', "", 1),
        };
        let text = format!("{before}{mistyped}\n");
        (mistyped != line && text != self.text()).then_some(text)
    }

    /// Performs a random view action between two lines.
    fn perform_view_action(&mut self) {
        match self.random.next(5) {
            0 => {
                let to = 300 + self.random.next(800) as usize;
                self.scrub(to);
            }
            1 => {
                self.keys(&["space"]);
                std::thread::sleep(Duration::from_secs_f64(0.3 + 2.0 * self.pace));
                self.keys(&["space"]);
            }
            2 => self.keys(&["Right", "Right", "Right", "Left", "End", "Home"]),
            3 => {
                self.drag((760, 200), (660, 240));
                // Returns to the camera of the script.
                self.keys(&["c"]);
            }
            _ => {
                let panel = self.random.one(&["ctrl+5", "ctrl+6", "ctrl+7", "ctrl+8"]);
                self.keys(&[panel, "Next", "Next", "Escape", "ctrl+2", "ctrl+4"]);
            }
        }
    }

    fn scrub(&mut self, to: usize) {
        self.keys(&["Home"]);
        let ruler = || {
            let shot = self.screen.shot(self.window);
            let (x, y) = (0..shot.width)
                .flat_map(|x| (SEQUENCER[0]..shot.height).map(move |y| (x, y)))
                .find(|(x, y)| shot.is(*x, *y, PLAYHEAD))?;
            Some((x + 2, y + 4))
        };
        let ruler = until("the playhead", ruler);
        self.drag(ruler, (to, ruler.1));
    }

    fn write(&mut self, lesson: &str) {
        let mut before = String::new();
        for line in lesson.lines() {
            let text = format!("{before}{line}\n");
            // Blank lines and comments are saved together with the next line.
            if !line.trim().is_empty() && !line.starts_with("//") {
                if self.random.next(3) == 0
                    && let Some(mistaken) = self.insert_typo(&before, line)
                {
                    self.save(&mistaken);
                    self.wait_for_version(false);
                    self.pause();
                }
                self.save(&text);
                self.wait_for_version(true);
                self.pause();
                if self.random.next(3) == 0 {
                    self.perform_view_action();
                    self.pause();
                }
            }
            before = text;
        }
        assert_eq!(self.text(), lesson);
    }

    /// Prepares the window for a drag.
    fn prepare_drag(&mut self) {
        self.keys(&["Escape", "ctrl+2", "ctrl+4", "g", "Home"]);
        self.wait_until_idle();
    }

    /// Waits until the viewer is idle: a drag of a version that is not shown yet is refused, and one save can cause two reloads.
    fn wait_until_idle(&mut self) {
        self.viewer
            .settled(Duration::from_millis(400), Duration::from_secs(600))
            .expect("the scene stops changing");
        self.screen.rest(self.viewer.process.0.id());
    }

    fn kims_bar(&self) -> (usize, usize, usize) {
        until("the bar", || self.screen.shot(self.window).bar(color_of_clip("Run"), SEQUENCER))
    }

    /// Lines of the script that a drag has changed or added, before and after.
    fn changed_lines(&mut self, lesson: &str) -> (String, Vec<String>) {
        let changed = until("the change", || {
            // A refusal is shown with its reason.
            self.screen.save(self.window, "dragged.png");
            Some(self.text()).filter(|t| t != lesson)
        });
        let come = changed.lines().filter(|line| !lesson.lines().any(|l| l == *line)).map(str::to_string);
        let come: Vec<_> = come.collect();
        (changed, come)
    }

    /// Undoes, redoes and undoes the change.
    fn undo_redo_undo(&mut self, lesson: &str, changed: &str) {
        self.wait_for_version(true);
        for (key, wanted) in [("ctrl+z", lesson), ("ctrl+y", changed), ("ctrl+z", lesson)] {
            self.pause();
            self.keys(&[key]);
            until(key, || (self.text() == wanted).then_some(()));
            self.wait_for_version(true);
        }
    }

    /// Drags the end of the second clip, which changes one number of the script; then undo, redo, undo.
    fn drag_a_bar(&mut self, lesson: &str) {
        self.prepare_drag();
        let (_, right, y) = self.kims_bar();
        let by = 20 + self.random.next(60) as usize;
        self.drag((right + 1, y), (right + by, y));
        let (changed, come) = self.changed_lines(lesson);
        let [line] = &come[..] else { panic!("{changed}") };
        assert!(
            line.contains("\"Run\"") && line.contains(".until(") && !line.contains("until(4.0)"),
            "{line}"
        );
        assert_eq!(changed.lines().count(), lesson.lines().count(), "{changed}");
        self.undo_redo_undo(lesson, &changed);
    }

    /// Selects the actor by a click on its row: the inspector lists its clips, the viewport shows its gizmo.
    fn select(&mut self) {
        self.prepare_drag();
        until("no gizmo", || self.pixels_in_image(ALONG_X).is_empty().then_some(()));
        let y = self.kims_bar().2.to_string();
        self.screen.xdotool(&["mousemove", "--window", self.window, "60", &y]);
        self.screen.rest(self.viewer.process.0.id());
        self.screen.xdotool(&["click", "1"]);
        self.actions += 1;
        until("the gizmo", || self.pixels_in_image(ALONG_X).last().copied());
        self.wait_until_idle();
    }

    /// Pixels of the viewport image with a color, from left to right.
    fn pixels_in_image(&self, color: [u8; 3]) -> Vec<(usize, usize)> {
        let shot = self.screen.shot(self.window);
        let [left, top, right, bottom] = PICTURE;
        let all = (left..right).flat_map(|x| (top..bottom).map(move |y| (x, y)));
        all.filter(|(x, y)| shot.is(*x, *y, color)).collect()
    }

    /// Drags one of the actor's clips onto its row, which adds a line.
    fn drag_a_clip(&mut self, lesson: &str) {
        self.select();
        self.screen.save(self.window, "clips.png");
        let shot = self.screen.shot(self.window);
        let [x, top, bottom] = CLIPS;
        // The edge of a letter can also have the color of a button, but is not as high.
        let is_button = |y: usize| (y..y + 8).all(|y| shot.is(x, y, BUTTON));
        let begins = |y: &usize| is_button(*y) && !shot.is(x, *y - 1, BUTTON);
        let clips: Vec<usize> = (top..bottom).filter(begins).collect();
        assert!(clips.len() > 4, "{clips:?}");
        let clip = clips[self.random.next(clips.len() as u64) as usize];
        let to = 300 + self.random.next(800) as usize;
        let row = self.kims_bar().2;
        // A screenshot shows why no change has arrived.
        println!("a clip from {}, {} to {to}, {row}", x + 35, clip + 6);
        self.drag((x + 35, clip + 6), (to, row));
        let (changed, come) = self.changed_lines(lesson);
        let [line] = &come[..] else { panic!("{changed}") };
        assert!(
            line.starts_with("kim.play(moves.clip(\"") && line.contains("#{ fade: 0.3 }).from("),
            "{line}"
        );
        assert_eq!(changed.replacen(&format!("{line}\n"), "", 1), lesson);
        self.undo_redo_undo(lesson, &changed);
    }

    /// Moves the actor along x, or turns it about y, which changes its first key or its angle.
    fn drag_the_actor(&mut self, lesson: &str, turn: bool) {
        self.select();
        let by = 15 + self.random.next(30) as usize;
        if turn {
            let (middle, _) = until("the arrow", || self.pixels_in_image(ALONG_X).first().copied());
            self.keys(&["r"]);
            // The radius of the ring equals the length of the arrow. The arrow along y has the same color.
            let is_ring = |at: &(usize, usize)| at.0 + 40 < middle;
            let left = until("the ring", || self.pixels_in_image(ABOUT_Y).first().copied().filter(is_ring));
            self.drag((left.0 + 1, left.1), (left.0 + 6, left.1 + by));
        } else {
            let tip = until("the arrow", || self.pixels_in_image(ALONG_X).last().copied());
            self.drag((tip.0 - 8, tip.1), (tip.0 - 8 + by, tip.1));
        }
        let (changed, come) = self.changed_lines(lesson);
        let [line] = &come[..] else { panic!("{changed}") };
        let keys = ", [-4.0, 0.0, 0.0]], [2.0, [-1.6, 0.0, 0.0]], [4.0, [3.8, 0.0, 0.0]]]);";
        let (turned, moved) = (!line.starts_with("kim.turn(90.0)."), !line.ends_with(keys));
        assert!(line.starts_with("kim.turn(") && (turned, moved) == (turn, !turn), "{line}");
        assert_eq!(changed.lines().count(), lesson.lines().count(), "{changed}");
        self.undo_redo_undo(lesson, &changed);
    }

    /// Restores the initial view and returns a screenshot.
    fn restore_view(&mut self) -> Screenshot {
        self.keys(&["Escape", "ctrl+0", "ctrl+1", "ctrl+2", "ctrl+4", "g", "Home"]);
        // No widget is under the pointer.
        self.screen.xdotool(&["mousemove", "--window", self.window, "1270", "850"]);
        // A frame on a busy machine can take a second.
        self.viewer
            .settled(Duration::from_secs(2), Duration::from_secs(600))
            .expect("the scene stops changing");
        self.screen.rest(self.viewer.process.0.id());
        let shot = self.screen.shot(self.window);
        let [left, top, right, bottom] = PICTURE;
        let rows =
            (top..bottom).flat_map(|y| &shot.rgb[(y * shot.width + left) * 3..(y * shot.width + right) * 3]);
        Screenshot { width: right - left, height: bottom - top, rgb: rows.copied().collect() }
    }
}

/// Opens a viewer of an empty script. Does nothing but print a line if there is no display.
fn run_writing_session(seed: u64, pace: f64, mut use_it: impl FnMut(&mut SimulatedUser<'_>, &str)) {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let lesson = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/02_layers.rhai");
    let lesson = fs::read_to_string(lesson).unwrap();
    let file = folder.path().join("lesson.rhai");
    fs::write(&file, "// Mine.\n").unwrap();
    let mut command = screen.command(&[file.to_str().unwrap()], folder.path());
    if is_validation_installed() {
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    }
    command.stderr(fs::File::create(folder.path().join("said.txt")).unwrap());
    let mut viewer = ViewerProcess::start(command);
    let (version, _) = viewer.version(0);
    let window = screen.window();
    let random = Random::new(seed);
    let mut person = SimulatedUser {
        screen: &screen,
        window: &window,
        viewer: &viewer,
        file,
        random,
        pace,
        version,
        saves: 0,
        actions: 0,
    };
    use_it(&mut person, &lesson);
    assert_no_errors(folder.path());
    screen.key(&window, "ctrl+q");
    let status = until("the end", || viewer.process.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder.path());
}

#[test]
fn a_lesson_is_written_from_an_empty_file() {
    run_writing_session(7, 0.0, |person, lesson| {
        person.write(lesson);
        person.drag_a_bar(lesson);
        person.drag_a_clip(lesson);
        person.drag_the_actor(lesson, false);
        person.drag_the_actor(lesson, true);
        let first = person.restore_view();
        // Check of the test itself: another frame must give another image.
        person.keys(&["End"]);
        until("another image", || (person.screen.shot(person.window).rgb != first.rgb).then_some(()));
        assert!(person.restore_view() == first, "the same image as before");
    });
}

#[test]
#[ignore = "takes ten minutes, or as many as asked for"]
fn editing_in_window_and_text_editor_leaks_nothing() {
    let number =
        |name: &str, usual: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual);
    let (minutes, seed) = (number("CHOREO_MINUTES", 10), number("CHOREO_SEED", 7));
    let pace = number("CHOREO_PACE_MS", 1000) as f64 / 1e3;
    run_writing_session(seed, pace, |person, lesson| {
        let start = Instant::now();
        let mut resource_record = ResourceRecord::default();
        let mut first: Option<Screenshot> = None;
        let mut idle: f64 = 0.0;
        while start.elapsed() < Duration::from_secs(minutes * 60) {
            person.save("// Once more, from nothing.\n");
            person.wait_for_version(true);
            person.write(lesson);
            for deed in 0..4 {
                match deed {
                    0 => person.drag_a_bar(lesson),
                    1 => person.drag_a_clip(lesson),
                    deed => person.drag_the_actor(lesson, deed == 2),
                }
                person.perform_view_action();
            }
            let seen = person.restore_view();
            assert!(*first.get_or_insert_with(|| seen.clone()) == seen, "the same script, the same image");
            // A break without any input.
            let (before, of_threads) = (person.viewer.processor_secs(), person.viewer.threads());
            std::thread::sleep(Duration::from_secs(20));
            let now = (person.viewer.processor_secs() - before) / 20.0;
            println!("a break: {:.2} % of a core", now * 100.0);
            if now >= 0.01 {
                println!("what was viewer: {:?}", person.viewer.meanwhile());
                println!("threads before: {of_threads:?}\nand after: {:?}", person.viewer.threads());
            }
            idle = idle.max(now);
            // One more save, so that a new frame is displayed.
            person.save(&format!("{lesson}// {}\n", person.saves));
            let (number, _) = person.viewer.version(person.version);
            person.version = number;
            let (_, shown) = person.viewer.shown(number);
            resource_record.note(start.elapsed().as_secs() / 60, person.actions, person.viewer, &shown);
        }
        println!("at most {:.2} % of a core in breaks", idle * 100.0);
        assert!(idle < 0.01, "{idle}");
        resource_record.assert_no_growth();
    });
}
