//! Runs `check` and `render` (two small images) on every script in tests/hostile. The first comments of a script, its head, state the
//! expected result. In addition, no run may panic, hang, fill the memory, write to other places or send control characters to the
//! terminal. `CHOREO_ACCEPT=1` writes the actual results into the heads; read them before you commit.
//!
//! Heads, one comment a line:
//! ```text
//! // An endless loop.                                  what it tries
//! // with: --limit seconds=1                           further arguments
//! // good                                              both commands succeed
//! // expects: 4:1: the script takes too many steps     a line of the messages, with its place; … at the end: its start
//! // check expects: …   render expects: …              of one of the commands only; 4:* is any column, *:* any place
//! // render exits: 3                                   where the exit code is neither 0 nor 1
//! ```
#![cfg(unix)]

mod common;
#[path = "common/hostile_assets.rs"]
mod hostile_assets;

use common::{Run, file_names, run_result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Limits of steps and bytes are lower than by default, so that they stop a script soon. Time limits are higher, because on a busy machine
/// they would end a script before the limit that it tests. A script that tests a time limit has that limit in its head.
const LIMITS: &[&str] = &[
    "operations=1000000",
    "frame_operations=100000",
    "seconds=120",
    "frame_seconds=120",
    "check_seconds=120",
    "memory=700000000",
    "printed=20000",
];
/// Seconds of processor time, after which the system ends the program.
const PROCESSOR_SECS: u32 = 60;
/// KiB of address space, stacks and reserved heaps included.
const MEMORY_KIB: u32 = 2 << 20;
/// Wall time after which a run counts as hanging: a process that only waits uses no processor time.
const MAX_WAIT: Duration = Duration::from_secs(900);
/// Largest number of bytes of messages: enough for a list of errors.
const MAX_MESSAGE_BYTES: usize = 64 << 10;

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/hostile")
}

struct Script {
    name: String,
    text: String,
    further_args: Vec<String>,
    good: bool,
    /// (command or "", text)
    expects: Vec<(String, String)>,
    /// (command, code)
    exits: Vec<(String, i32)>,
}

impl Script {
    fn read(place: &Path) -> Script {
        let text = std::fs::read_to_string(place).unwrap();
        let name = place.file_name().unwrap().to_string_lossy().into_owned();
        let mut script = Script {
            name,
            text: text.clone(),
            further_args: Vec::new(),
            good: false,
            expects: Vec::new(),
            exits: Vec::new(),
        };
        for line in text.trim_start_matches('\u{feff}').lines().map_while(|l| l.strip_prefix("// ")) {
            if line == "good" {
                script.good = true;
            } else if let Some(with) = line.strip_prefix("with: ") {
                script.further_args = split_words(with);
            } else if let Some((command, code)) = line.split_once(" exits: ") {
                script.exits.push((command.to_string(), code.parse().unwrap()));
            } else if let Some((before, expected)) = line.split_once("expects: ")
                && ["", "check ", "render "].contains(&before)
            {
                script.expects.push((before.trim().to_string(), expected.to_string()));
            }
        }
        script
    }

    fn expected(&self, command: &str) -> Vec<&str> {
        let mine = |c: &str| c.is_empty() || c == command;
        self.expects.iter().filter(|(c, _)| mine(c)).map(|(_, t)| t.as_str()).collect()
    }

    /// An expected line of messages, with the name of the file if the head omits it.
    fn full_line(&self, expected: &str) -> String {
        let at_place = expected.split(':').next().is_some_and(|l| l == "*" || l.parse::<u32>().is_ok());
        if at_place { format!("{}:{expected}", self.name) } else { expected.to_string() }
    }
}

/// Splits a text at blanks, except inside quotes.
fn split_words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (i, part) in text.split('"').enumerate() {
        match i % 2 {
            0 => words.extend(part.split_whitespace().map(str::to_string)),
            _ => words.push(part.to_string()),
        }
    }
    words
}

struct Sandbox {
    _dir: tempfile::TempDir,
    inside: PathBuf,
    outside: PathBuf,
    home: PathBuf,
    out: PathBuf,
}

impl Sandbox {
    fn new(scripts: &[Script]) -> Sandbox {
        let dir = tempfile::tempdir().unwrap();
        let folder = |name: &str| {
            let folder = dir.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            folder
        };
        let (inside, outside, home, out) =
            (folder("inside"), folder("outside"), folder("home"), folder("out"));
        hostile_assets::make(&inside, &outside);
        for script in scripts {
            std::fs::write(inside.join(&script.name), &script.text).unwrap();
        }
        Sandbox { _dir: dir, inside, outside, home, out }
    }

    fn run(&self, script: &Script, command: &str, further: &[&str]) -> Result<Run, String> {
        // The shell sets limits, so that the program cannot forget to set them.
        let shell = format!("ulimit -v {MEMORY_KIB}; ulimit -t {PROCESSOR_SECS}; ulimit -c 0; exec \"$@\"");
        let mut program = Command::new("sh");
        program.args(["-c", &shell, "sh", env!("CARGO_BIN_EXE_choreo"), command, &script.name]);
        program.args(LIMITS.iter().flat_map(|l| ["--limit", l])).args(&script.further_args).args(further);
        program.current_dir(&self.inside).stdin(Stdio::null());
        for name in ["HOME", "TMPDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"] {
            program.env(name, &self.home);
        }
        // The output goes to files, because a pipe would be full before it is read.
        let log = |kind: &str| self.out.join(format!("{}.{command}.{kind}", script.name));
        program.stdout(std::fs::File::create(log("out")).unwrap());
        program.stderr(std::fs::File::create(log("err")).unwrap());
        let mut child = program.spawn().unwrap();
        let started = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if started.elapsed() > MAX_WAIT {
                child.kill().unwrap();
                child.wait().unwrap();
                return Err("hangs".into());
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        let taken = |kind: &str| {
            let bytes = std::fs::read(log(kind)).unwrap();
            std::fs::remove_file(log(kind)).unwrap();
            bytes
        };
        let output = std::process::Output { status, stdout: taken("out"), stderr: taken("err") };
        if output.status.code().is_none() {
            return Err(format!("ended by a signal: {status}\n{}", String::from_utf8_lossy(&output.stderr)));
        }
        Ok(run_result(output))
    }

    /// All files with size and modification time, except the requested images.
    fn inventory(&self) -> BTreeMap<PathBuf, (u64, Option<std::time::SystemTime>)> {
        let mut found = BTreeMap::new();
        let mut open = vec![self.inside.clone(), self.outside.clone(), self.home.clone()];
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(&folder).unwrap().map(Result::unwrap) {
                let about = entry.metadata().unwrap();
                if about.is_dir() {
                    open.push(entry.path());
                }
                found.insert(entry.path(), (about.len(), about.modified().ok()));
            }
        }
        found
    }
}

/// Judges how one command handled one script.
fn judge(sandbox: &Sandbox, script: &Script, command: &str) -> Result<Run, String> {
    let folder = sandbox.out.join(script.name.trim_end_matches(".rhai"));
    let frames = format!("../out/{}/%04d.png", script.name.trim_end_matches(".rhai"));
    let further: &[&str] = match command {
        "check" => &[],
        _ => &["-o", &frames, "--size", "64x36", "--frames", "0..2", "--device", "cpu", "--jobs", "2"],
    };
    let started = Instant::now();
    let run = sandbox.run(script, command, further)?;
    println!("{:6.2} s {} {command}", started.elapsed().as_secs_f64(), script.name);
    let text = format!("{}{}", run.out, run.err);
    if ["panicked", "RUST_BACKTRACE", "internal error"].iter().any(|sign| text.contains(sign)) {
        return Err(format!("panics:\n{text}"));
    }
    if text.len() > MAX_MESSAGE_BYTES {
        return Err(format!("writes {} bytes of messages", text.len()));
    }
    let steers = |c: char| {
        (c.is_control() && c != '\n') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if let Some(bad) = text.chars().find(|c| steers(*c)) {
        return Err(format!("steers the terminal with {bad:?}:\n{}", text.escape_debug()));
    }
    let pictures = if folder.is_dir() { file_names(&folder) } else { Vec::new() };
    if run.code == 0 && command == "render" && pictures != ["0000.png", "0001.png"] {
        return Err(format!("good, but the images are {pictures:?}"));
    }
    if pictures.iter().any(|n| n.contains(".part")) {
        return Err(format!("leaves {pictures:?}"));
    }
    Ok(run)
}

fn compare(script: &Script, command: &str, run: &Run) -> Result<(), String> {
    let expected = script.expected(command);
    if expected.is_empty() != script.good && script.expects.iter().all(|(c, _)| c.is_empty()) {
        return Err("the head says neither good nor what it expects".into());
    }
    let explicit = script.exits.iter().find(|(c, _)| c == command).map(|(_, code)| *code);
    let code = explicit.unwrap_or(i32::from(!expected.is_empty()));
    let shown = || format!("code {}\n{}", run.code, run.err);
    if run.code != code {
        return Err(format!("expected exit code {code}, got {}", shown()));
    }
    for text in expected {
        let whole = script.full_line(text);
        let found = run.err.lines().map(str::trim_start).any(|line| matches_line(line, &whole));
        if !found {
            return Err(format!("expected: {whole}\ngot {}", shown()));
        }
    }
    Ok(())
}

/// Whether a line matches an expected text, in which `*` stands for a number and `…` at the end for any text.
fn matches_line(line: &str, expected: &str) -> bool {
    let (expected, open) = match expected.strip_suffix('…') {
        Some(start) => (start, true),
        None => (expected, false),
    };
    let mut rest = line;
    for (i, part) in expected.split(":*").enumerate() {
        if i > 0 {
            let Some(number) = rest.strip_prefix(':') else { return false };
            rest = number.trim_start_matches(|c: char| c.is_ascii_digit());
        }
        let Some(after) = rest.strip_prefix(part) else { return false };
        rest = after;
    }
    open || rest.is_empty()
}

/// The messages of a run as lines of a head.
fn head_lines(script: &Script, run: &Run) -> Vec<String> {
    if run.code == 0 {
        return Vec::new();
    }
    let here = format!("{}:", script.name);
    let mut lines = Vec::new();
    for line in run.err.lines() {
        let hint = line.strip_prefix("    hint: ").filter(|h| h.contains("--limit"));
        let text = match (hint, line.strip_prefix("    ")) {
            (Some(hint), _) => format!("hint: {hint}"),
            (None, Some(_)) => continue,
            (None, None) => {
                line.strip_prefix(&here).filter(|t| !t.starts_with(' ')).unwrap_or(line).to_string()
            }
        };
        // A time limit is not reached at the same place every time.
        let mut parts = text.splitn(3, ':');
        let text = match (parts.next(), parts.next(), parts.next()) {
            (Some(line), Some(_), Some(what))
                if what.contains("takes too long") || what.contains("too much memory") =>
            {
                format!("{}:*:{what}", if line.parse::<u32>().is_ok() { "*" } else { line })
            }
            _ => text,
        };
        let text = match text.split_once(" be checked in ") {
            Some((before, _)) => format!("{before} be checked…"),
            None => text,
        };
        let cut: String = text.chars().take(150).collect();
        lines.push(if cut.len() < text.len() { format!("{cut}…") } else { text });
    }
    lines.dedup();
    lines.truncate(16);
    lines
}

fn accept(script: &Script, check: &Run, render: &Run) {
    let (a, b) = (head_lines(script, check), head_lines(script, render));
    let mut head: Vec<String> = Vec::new();
    let body: Vec<&str> = script.text.lines().skip_while(|l| l.starts_with("// ")).collect();
    let is_result = |l: &&str| {
        *l == "// good"
            || [
                "// expects: ",
                "// check expects: ",
                "// render expects: ",
                "// check exits: ",
                "// render exits: ",
            ]
            .iter()
            .any(|p| l.starts_with(p))
    };
    head.extend(
        script
            .text
            .lines()
            .take_while(|l| l.starts_with("// "))
            .filter(|l| !is_result(l))
            .map(str::to_string),
    );
    if check.code == 0 && render.code == 0 {
        head.push("// good".into());
    } else if a == b {
        head.extend(a.iter().map(|l| format!("// expects: {l}")));
    } else {
        head.extend(a.iter().map(|l| format!("// check expects: {l}")));
        head.extend(b.iter().map(|l| format!("// render expects: {l}")));
    }
    for (command, run) in [("check", check), ("render", render)] {
        if run.code > 1 {
            head.push(format!("// {command} exits: {}", run.code));
        }
    }
    let text = format!("{}\n{}\n", head.join("\n"), body.join("\n"));
    std::fs::write(corpus().join(&script.name), text.trim_end().to_string() + "\n").unwrap();
}

#[test]
fn every_hostile_script_gives_the_result_in_its_head() {
    let accepting = std::env::var_os("CHOREO_ACCEPT").is_some();
    let only = std::env::var("CHOREO_ONLY").unwrap_or_default();
    let mut scripts: Vec<Script> = file_names(&corpus())
        .iter()
        .filter(|n| n.ends_with(".rhai"))
        .map(|n| Script::read(&corpus().join(n)))
        .collect();
    assert!(scripts.len() >= 100, "{} scripts", scripts.len());
    let sandbox = Sandbox::new(&scripts);
    scripts.retain(|s| s.name.contains(&only));
    let before = sandbox.inventory();
    let next = AtomicUsize::new(0);
    let wrong = Mutex::new(Vec::new());
    let work = || {
        while let Some(script) = scripts.get(next.fetch_add(1, Ordering::Relaxed)) {
            let runs = ["check", "render"].map(|command| {
                let run = judge(&sandbox, script, command);
                let compared = match &run {
                    Ok(run) if !accepting => compare(script, command, run),
                    Ok(_) => Ok(()),
                    Err(what) => Err(what.clone()),
                };
                if let Err(what) = compared {
                    let what: String = what.chars().take(3000).collect();
                    wrong.lock().unwrap().push(format!("{} ({command}): {what}", script.name));
                }
                run
            });
            if let (true, [Ok(check), Ok(render)]) = (accepting, &runs) {
                accept(script, check, render);
            }
        }
    };
    std::thread::scope(|scope| {
        let cores = std::thread::available_parallelism().map_or(2, |n| n.get());
        (0..cores).for_each(|_| drop(scope.spawn(work)));
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{} of {}:\n\n{}", wrong.len(), scripts.len(), wrong.join("\n\n"));
    let after = sandbox.inventory();
    assert_eq!(before, after, "nothing is written but the named outputs");
}
