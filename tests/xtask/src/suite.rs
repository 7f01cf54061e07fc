//! `cargo xtask test`: everything, sorted by cost, with one closing count.

use crate::{assets, cargo, root, run, setup};
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

pub fn lint() -> Result<(), String> {
    run(cargo(&["fmt", "--all", "--check"]), "cargo fmt --check")?;
    run(cargo(&["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"]), "cargo clippy")
}

/// A test prints `SKIP n: reason` for cases that it could not run; they are counted and shown.
#[derive(Default)]
struct Tally {
    passed: u64,
    failed: u64,
    skips: Vec<(u64, String)>,
}

pub fn test(args: &[&str]) -> Result<(), String> {
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
        && let Err(text) = lint()
    {
        problems.push(text);
    }

    // One build for all; `--show-output` so that the skips of passing tests are seen.
    let mut line = vec!["test", "--workspace", "--no-fail-fast", "--quiet", "--"];
    line.push("--show-output");
    line.extend(&filters);
    let mut child = cargo(&line)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|e| format!("cargo test did not start: {e}"))?;
    let output = child.stdout.take().ok_or("cargo test has no output")?;
    for text in BufReader::new(output).lines() {
        let text = text.map_err(|e| format!("reading the output of cargo test: {e}"))?;
        if tally.read(&text) {
            println!("{text}");
        }
    }
    let status = child.wait().map_err(|e| format!("cargo test: {e}"))?;
    if !status.success() {
        problems.push("cargo test failed; the failures are printed above".to_string());
    }
    if filters.is_empty()
        && let Err(text) = sections(&mut tally)
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
    let skipped: u64 = tally.skips.iter().map(|(n, _)| n).sum();
    println!("tests took {:.0} s", started.elapsed().as_secs_f64());
    // A failure outside the tests themselves (formatting, a build) must not close with "0 failed".
    let failed = if problems.is_empty() { 0 } else { tally.failed.max(1) };
    println!("{} passed, {failed} failed, {skipped} skipped", tally.passed);
    if problems.is_empty() { Ok(()) } else { Err(problems.join("; ")) }
}

/// The scenes' own tests, `tests/suite` and `scripts`, by the program that the tests before have built.
fn sections(tally: &mut Tally) -> Result<(), String> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let choreo = target.join("debug").join(format!("choreo{}", std::env::consts::EXE_SUFFIX));
    let mut command = Command::new(&choreo);
    command.args(["test", "--html"]).arg(target.join("choreo-test.html")).current_dir(root());
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

impl Tally {
    /// Reads a line of choreo test's output: its reasons to skip, and its counts.
    fn read_sections(&mut self, line: &str) {
        if let Some((count, reason)) = line.strip_prefix("skipped ").and_then(|rest| rest.split_once(": ")) {
            self.skips.extend(count.parse().ok().map(|n| (n, reason.to_string())));
        } else if line.contains(" passed") && line.contains(" checks in ") {
            for part in line.split([',', ';', '(']) {
                let Some((count, word)) = part.trim().split_once(' ') else { continue };
                let count: u64 = count.parse().unwrap_or(0);
                match word.trim() {
                    "passed" => self.passed += count,
                    "failed" => self.failed += count,
                    _ => {}
                }
            }
        }
    }

    /// Reads a line of libtest's output; true where a person wants to see it.
    fn read(&mut self, line: &str) -> bool {
        if let Some(rest) = line.strip_prefix("test result: ") {
            let number = |word: &str| -> u64 {
                let mut before = 0;
                for part in rest.split([' ', ';', '.']) {
                    if part == word {
                        return before;
                    }
                    before = part.parse().unwrap_or(before);
                }
                0
            };
            self.passed += number("passed");
            self.failed += number("failed");
            let ignored = number("ignored");
            if ignored > 0 {
                self.skips.push((ignored, "tests marked #[ignore]".to_string()));
            }
            number("passed") + number("failed") > 0
        } else if let Some(rest) = line.trim_start().strip_prefix("SKIP ") {
            let (count, reason) = rest.split_once(": ").unwrap_or(("1", rest));
            self.skips.push((count.trim().parse().unwrap_or(1), reason.to_string()));
            false
        } else {
            !line.trim().is_empty() && line != "successes:"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;

    #[test]
    fn counts_results_and_skips() {
        let mut tally = Tally::default();
        tally.read("test result: FAILED. 3 passed; 2 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s");
        tally.read("SKIP 12: the shared assets are not here");
        assert_eq!((tally.passed, tally.failed), (3, 2));
        assert_eq!(tally.skips[1], (12, "the shared assets are not here".to_string()));
        tally.read_sections("ok     tests/suite/walk.rhai  12 sections, 2 skipped");
        tally.read_sections("skipped 2: no Vulkan: install mesa-vulkan-drivers");
        tally.read_sections("12 passed (reused 3), 1 failed, 2 skipped, 4 warnings; 40 checks in 1.2 s");
        assert_eq!((tally.passed, tally.failed), (15, 3));
        assert_eq!(tally.skips[2], (2, "no Vulkan: install mesa-vulkan-drivers".to_string()));
    }
}
