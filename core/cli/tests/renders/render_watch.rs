//! `choreo render --watch`: after a change, exactly the affected frames are drawn again.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const SCRIPT: &str = r##"stage(#{ size: [48, 32], fps: 8, length: 1.0 });
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: "#c04020" }))
    .key("position", [[0.0, [0, 0, 0]], [0.5, [0, 0, 0]], [1.0, [1, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

struct Watching {
    child: Child,
    lines: Receiver<String>,
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Watching {
    fn new(folder: &Path, output: &str) -> Watching {
        let mut command = Command::new(env!("CARGO_BIN_EXE_choreo"));
        command.args(["render", "a.rhai", "-o", output, "--device", "cpu", "--watch"]).current_dir(folder);
        let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
        let (to, lines) = channel();
        let from = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || from.lines().map_while(Result::ok).try_for_each(|line| to.send(line)));
        Watching { child, lines }
    }

    /// Waits for the next line that contains this text.
    fn wait_for_line(&self, part: &str) -> String {
        let end = Instant::now() + Duration::from_secs(600);
        let mut seen = Vec::new();
        while let Ok(line) = self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
            if line.contains(part) {
                return line;
            }
            seen.push(line);
        }
        panic!("no \"{part}\" in {seen:?}");
    }
}

fn save(folder: &Path, text: &str) {
    fs::write(folder.join("a.rhai.new"), text).unwrap();
    fs::rename(folder.join("a.rhai.new"), folder.join("a.rhai")).unwrap();
}

#[test]
fn only_the_frames_that_a_save_touches_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    save(folder.path(), SCRIPT);
    let watching = Watching::new(folder.path(), "out/%02d.png");
    // Equal frames are drawn once: the box does not move until the fifth frame.
    assert!(watching.wait_for_line("8 frames").starts_with("8 frames, 4 of them drawn before, in "));
    let picture = |frame: usize| fs::read(folder.path().join(format!("out/{frame:02}.png"))).unwrap();
    let last = picture(7);
    save(folder.path(), &SCRIPT.replace("[1, 0, 0]", "[-1, 0, 0]"));
    assert!(watching.wait_for_line("8 frames").starts_with("8 frames, 5 of them drawn before, in "));
    assert!(picture(7) != last);
    // A comment changes no frame, and the frames of the original script are still known.
    save(folder.path(), &format!("// as it was\n{SCRIPT}"));
    assert!(watching.wait_for_line("8 frames").starts_with("8 frames, 8 of them drawn before, in "));
    // An error is reported with its position, and the files are kept.
    save(folder.path(), &SCRIPT.replace("camera(", "camra("));
    assert!(watching.wait_for_line("camra").contains("a.rhai:4:"));
    assert!(picture(7).starts_with(b"\x89PNG"));
    save(folder.path(), &SCRIPT.replace("#c04020", "#20c040"));
    assert!(watching.wait_for_line("8 frames").starts_with("8 frames, 4 of them drawn before, in "));
    // The images are the same as in a render without reused frames.
    let pixels = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgba8();
    let once = Command::new(env!("CARGO_BIN_EXE_choreo"))
        .args(["render", "a.rhai", "-o", "once/%02d.png", "--device", "cpu", "--quiet"])
        .current_dir(folder.path())
        .status();
    assert!(once.unwrap().success());
    for frame in 0..8 {
        assert!(pixels(&format!("out/{frame:02}.png")) == pixels(&format!("once/{frame:02}.png")), "{frame}");
    }
}

/// Clock ticks of processor time of a process with its threads (`man proc_pid_stat`, fields 14 and 15), and its number of threads.
#[cfg(target_os = "linux")]
fn cpu_ticks_and_threads(process: u32) -> (u64, u64) {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    // The name may contain spaces; it ends with the last parenthesis.
    let fields: Vec<u64> =
        stat.rsplit(')').next().unwrap().split_whitespace().map(|f| f.parse().unwrap_or(0)).collect();
    (fields[11] + fields[12], fields[17])
}

#[cfg(target_os = "linux")]
#[test]
fn watching_uses_no_processor_time_and_leaks_no_threads() {
    let folder = tempfile::tempdir().unwrap();
    save(folder.path(), SCRIPT);
    let watching = Watching::new(folder.path(), "out/%02d.png");
    watching.wait_for_line("8 frames");
    save(folder.path(), &format!("// 0\n{SCRIPT}"));
    watching.wait_for_line("8 frames");
    let threads = || cpu_ticks_and_threads(watching.child.id()).1;
    std::thread::sleep(Duration::from_millis(600));
    let before = threads();
    for round in 1..6 {
        save(folder.path(), &format!("// {round}\n{SCRIPT}"));
        watching.wait_for_line("8 frames");
    }
    // On a busy machine the threads of the last frames may end late; leaked threads never end.
    wait_until(
        || threads() <= before,
        || format!("{} threads after five more saves, {before} before", threads()),
    );
    // Even a thread that only polls every 10 ms takes more in three seconds: 1 % of a core is one tick per second, of 100.
    let rest = || {
        let start = cpu_ticks_and_threads(watching.child.id()).0;
        std::thread::sleep(Duration::from_secs(3));
        cpu_ticks_and_threads(watching.child.id()).0 - start
    };
    wait_until(|| rest() <= 3, || format!("{} ticks of the processor in 3 s of rest", rest()));
}

/// Waits for a condition, long enough for a busy machine.
#[cfg(target_os = "linux")]
fn wait_until(is: impl Fn() -> bool, otherwise: impl Fn() -> String) {
    let end = Instant::now() + Duration::from_secs(120);
    while !is() {
        assert!(Instant::now() < end, "{}", otherwise());
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn watch_refuses_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    save(folder.path(), SCRIPT);
    let output = Command::new(env!("CARGO_BIN_EXE_choreo"))
        .args(["render", "a.rhai", "-o", "-", "--watch"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && text.contains("it cannot write to standard output"), "{text}");
}
