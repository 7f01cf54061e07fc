//! `cargo xtask test`: formatting and lints, the tests of all crates, and the sections of scripts, with one total at the end.

use crate::tally::Tally;
use crate::{assets, binaries, cargo, root, run, setup};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

pub(crate) fn lint() -> Result<(), String> {
    run(cargo(&["fmt", "--all", "--check"]), "cargo fmt --check")?;
    run(
        cargo(&["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"]),
        "cargo clippy",
    )?;
    // Checks links within the documentation; takes a minute of CPU time after clippy.
    let mut doc = cargo(&["doc", "--quiet", "--workspace", "--no-deps"]);
    doc.env("RUSTDOCFLAGS", "-D warnings");
    run(doc, "cargo doc")
}

pub(crate) fn test(args: &[&str]) -> Result<(), String> {
    let started = Instant::now();
    let (options, filters): (Vec<&str>, Vec<&str>) = args.iter().partition(|a| a.starts_with("--"));
    if let Some(unknown) = options.iter().find(|o| **o != "--no-install") {
        return Err(format!("unknown option {unknown}; there is --no-install"));
    }
    if options.is_empty() {
        setup::install();
    }
    let mut tally = Tally::default();
    let mut problems = Vec::new();
    if filters.is_empty()
        && let Err(text) = timed("formatting and clippy", lint)
    {
        problems.push(text);
    }

    if let Err(text) = run_tests(&mut tally, &filters) {
        problems.push(text);
    }
    if filters.is_empty()
        && let Err(text) = timed("sections of scripts", || run_sections(&mut tally))
    {
        problems.push(text);
    }
    if tally.passed + tally.failed == 0 {
        problems.push("no test ran".to_string());
    }

    println!();
    for (count, reason) in &tally.skips {
        println!("skipped {count}: {reason}");
    }
    if !tally.failures.is_empty() {
        println!("failed:");
    }
    for name in &tally.failures {
        println!("    {name}");
    }
    let skipped: u64 = tally.skips.iter().map(|(n, _)| n).sum();
    println!("all took {:.0} s", started.elapsed().as_secs_f64());
    // The total must not say "0 failed" after a failure outside the tests, such as formatting or a build.
    let failed = if problems.is_empty() { 0 } else { tally.failed.max(1) };
    println!("{} passed, {failed} failed, {skipped} skipped", tally.passed);
    if problems.is_empty() { Ok(()) } else { Err(problems.join("; ")) }
}

/// Runs a part of the command and prints its duration.
fn timed<T>(name: &str, part: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = part();
    println!("{name} took {:.0} s", started.elapsed().as_secs_f64());
    result
}

/// Runs the tests of all crates after a single build, and then the examples in their documentation.
fn run_tests(tally: &mut Tally, filters: &[&str]) -> Result<(), String> {
    // `--show-output` makes skipped cases of passing tests visible; the line of each test names it.
    let arguments = [&["--show-output"], filters].concat();
    let mut show = |text: &str| {
        if tally.read(text, tests_of) {
            println!("{text}");
        }
    };
    let built = timed("the build of the tests", binaries::built)?;
    let passed = timed("the tests", || binaries::run(&built, &arguments, &mut show))?;
    let mut examples = cargo(&["test", "--workspace", "--doc", "--no-fail-fast", "--"]);
    examples.args(&arguments);
    let status = timed("the examples of the documentation", || binaries::lines_of(examples, &mut show))?;
    tally.end_binary();
    match passed && status.success() {
        true => Ok(()),
        false => Err("tests failed; the failures are printed above".to_string()),
    }
}

/// The tests in a test binary, in the order in which they are run.
fn tests_of(binary: &str) -> Vec<String> {
    let output = Command::new(root().join(binary)).args(["--list", "--format", "terse"]).output();
    let text = output.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
    text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_string).collect()
}

/// Runs the scene tests in `tests/suite` and `scripts` with the program that the previous tests have built.
fn run_sections(tally: &mut Tally) -> Result<(), String> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let choreo = target.join("debug").join(format!("choreo{}", std::env::consts::EXE_SUFFIX));
    let mut command = Command::new(&choreo);
    command.args(["test", "--html"]).arg(target.join("choreo-test.html")).current_dir(root());
    command.env("CHOREO_PLUGINS", "");
    // Time limits are raised, since a script on a busy machine reaches them earlier.
    command.args(["--limit", "seconds=900", "--limit", "frame_seconds=900"]);
    if let Some(assets) = assets() {
        command.arg("--search").arg(assets);
    }
    println!("choreo test");
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| format!("{} did not start: {e}", choreo.display()))?;
    let counted = tally.passed + tally.failed;
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        tally.read_sections(line);
        println!("{line}");
    }
    match (output.status.success(), tally.passed + tally.failed > counted) {
        (true, true) => Ok(()),
        (true, false) => Err("choreo test ran no section".to_string()),
        (false, _) => Err("choreo test failed; target/choreo-test.html shows it".to_string()),
    }
}
