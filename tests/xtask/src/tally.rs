//! Parses the output of `cargo test` and `choreo test` line by line: totals, skipped cases, and the name of each failure.

use std::collections::BTreeSet;

/// Totals and names of one run. A test prints `SKIP n: reason` for cases that it could not run; they are counted and shown.
#[derive(Default)]
pub(crate) struct Tally {
    pub passed: u64,
    pub failed: u64,
    pub skips: Vec<(u64, String)>,
    /// Failures: the test binary or command, and the name of the test or section.
    pub failures: Vec<String>,
    binary: Binary,
}

/// The test binary that is running.
#[derive(Default)]
struct Binary {
    /// Name in cargo's header line: `tests/leaks.rs`, `unittests src/lib.rs`.
    header: String,
    path: String,
    /// Names of tests that have passed, failed or been ignored.
    finished: BTreeSet<String>,
    passed: u64,
    failed: Vec<String>,
    /// Name of the test whose thread overflowed its stack, which ends the process without a result.
    overflowed: Option<String>,
    /// Arguments of `cargo test …` for a failed binary, which cargo prints after the binary has ended.
    rerun: Option<String>,
}

impl Tally {
    /// Parses a line of `cargo test`; true if it should be shown. `tests_of` lists the tests of a test binary.
    pub(crate) fn read(&mut self, line: &str, tests_of: impl Fn(&str) -> Vec<String>) -> bool {
        let line = line.trim_end();
        if let Some(header) = header(line) {
            self.end_binary();
            self.binary = header;
            return true;
        }
        if let Some(rest) = line.strip_prefix("test result: ") {
            return self.read_result(rest);
        }
        if let Some((name, outcome)) = line.strip_prefix("test ").and_then(|rest| rest.split_once(" ... ")) {
            return self.read_test(name, outcome);
        }
        if let Some(rest) = line.trim_start().strip_prefix("SKIP ") {
            let (count, reason) = rest.split_once(": ").unwrap_or(("1", rest));
            self.skips.push((count.trim().parse().unwrap_or(1), reason.to_string()));
            return false;
        }
        if let Some(thread) = line.strip_suffix(" has overflowed its stack") {
            self.binary.overflowed = thread.split('\'').nth(1).map(str::to_string);
        } else if let Some((_, rerun)) = line.split_once("test failed, to rerun pass `") {
            self.binary.rerun = Some(rerun.trim_end_matches('`').to_string());
        } else if let Some(signal) = signal(line) {
            self.end_by_signal(signal, tests_of);
        }
        let is_list = line.strip_prefix("    ").is_some_and(|name| self.binary.finished.contains(name));
        let is_frame = line.is_empty() || line == "successes:" || line.starts_with("running ");
        !is_list && !is_frame
    }

    /// Ends the current binary. If no failed test is known by name, the name of the binary is recorded.
    pub(crate) fn end_binary(&mut self) {
        let binary = std::mem::take(&mut self.binary);
        if let (Some(rerun), true) = (&binary.rerun, binary.failed.is_empty()) {
            self.failed += 1;
            self.failures.push(format!("cargo test {rerun}: no test named; its output is above"));
        }
        self.failures.extend(binary.failures());
    }

    fn read_result(&mut self, rest: &str) -> bool {
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
    }

    /// Records the result of a test; only failures are shown.
    fn read_test(&mut self, name: &str, outcome: &str) -> bool {
        // The suffix `- should panic` is not part of the name.
        let name = name.trim_end_matches(" - should panic");
        self.binary.finished.insert(name.to_string());
        let failed = outcome.starts_with("FAILED");
        if failed {
            self.binary.failed.push(name.to_string());
        }
        self.binary.passed += u64::from(outcome == "ok");
        failed
    }

    /// Handles a binary that was ended by a signal and has printed no result: its passed and failed tests are counted here, and the test
    /// that ended it is one of those that had begun and not ended.
    fn end_by_signal(&mut self, signal: &str, tests_of: impl Fn(&str) -> Vec<String>) {
        let binary = std::mem::take(&mut self.binary);
        self.failed += binary.failed.len() as u64 + 1;
        self.passed += binary.passed;
        let running = binary.overflowed.clone().unwrap_or_else(|| {
            // libtest starts tests in the order of their list, one per thread.
            let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
            let left = tests_of(&binary.path).into_iter().filter(|test| !binary.finished.contains(test));
            left.take(threads).collect::<Vec<_>>().join(" or ")
        });
        let of = if running.is_empty() { String::new() } else { format!(", in {running}") };
        self.failures.push(format!("cargo test {}: ended by signal {signal}{of}", binary.name()));
        self.failures.extend(binary.failures());
    }

    /// Parses a line of `choreo test`: reasons for skipped sections, totals, and failed sections.
    pub(crate) fn read_sections(&mut self, line: &str) {
        if let Some((count, reason)) = line.strip_prefix("skipped ").and_then(|rest| rest.split_once(": ")) {
            self.skips.extend(count.parse().ok().map(|n| (n, reason.to_string())));
        } else if let Some(name) = line.strip_prefix("FAILED ").or_else(|| line.strip_prefix("ERROR ")) {
            self.failures.push(format!("choreo test: {name}"));
        } else if line.contains(" passed") && (line.contains(" checks in ") || line.contains(" check in ")) {
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
}

impl Binary {
    fn name(&self) -> &str {
        self.rerun.as_deref().unwrap_or(&self.header)
    }

    /// Commands that run each failed test alone.
    fn failures(&self) -> impl Iterator<Item = String> {
        self.failed.iter().map(|test| match test.contains(' ') {
            true => format!("cargo test {} -- --exact '{test}'", self.name()),
            false => format!("cargo test {} -- --exact {test}", self.name()),
        })
    }
}

/// Parses cargo's header line: `     Running tests/leaks.rs (target/debug/deps/leaks-0123)`, `   Doc-tests choreo_session`.
fn header(line: &str) -> Option<Binary> {
    let text = line.trim_start();
    if let Some(name) = text.strip_prefix("Doc-tests ") {
        return (line != text).then(|| Binary { header: format!("--doc {name}"), ..Binary::default() });
    }
    let (name, path) = text.strip_prefix("Running ")?.strip_suffix(')')?.rsplit_once(" (")?;
    let (header, path) = (name.to_string(), path.to_string());
    (line != text).then(|| Binary { header, path, ..Binary::default() })
}

/// The signal in cargo's message about a process that a signal ended.
fn signal(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix("process didn't exit successfully: ")?;
    let (_, signal) = rest.rsplit_once(" (signal: ")?;
    Some(signal.trim_end_matches(')'))
}

#[cfg(test)]
mod tests {
    use super::Tally;

    /// Output of `cargo test --no-fail-fast -- --show-output` with Rust 1.95, of a package made for it; backtraces left out.
    const RECORDED: &str = include_str!("tally_recorded.txt");

    fn read(text: &str) -> (Tally, Vec<&str>) {
        let mut tally = Tally::default();
        let tests = |path: &str| match path.contains("deps/abort-") {
            true => ["a_fine", "b_aborts", "c_waits", "d_never"].map(str::to_string).to_vec(),
            false => Vec::new(),
        };
        let shown = text.lines().filter(|line| tally.read(line, tests)).collect();
        tally.end_binary();
        (tally, shown)
    }

    #[test]
    fn recorded_failures_are_all_named() {
        let (tally, shown) = read(RECORDED);
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
        let aborted = ["b_aborts", "c_waits", "d_never"][..threads.min(3)].join(" or ");
        assert_eq!(
            tally.failures,
            [
                "cargo test -p probe --lib -- --exact tests::bad".to_string(),
                "cargo test -p probe --lib -- --exact tests::other".into(),
                format!(
                    "cargo test -p probe --test abort: ended by signal 6, SIGABRT: process abort signal, in {aborted}"
                ),
                "cargo test -p probe --test overflow: ended by signal 6, SIGABRT: process abort signal, in deep".into(),
                "cargo test -p probe --test own: no test named; its output is above".into(),
                "cargo test -p probe --doc -- --exact 'p/src/lib.rs - f (line 1)'".into(),
            ]
        );
        assert_eq!((tally.passed, tally.failed), (4, 6));
        assert_eq!(tally.skips, [(2, "no files".to_string()), (1, "tests marked #[ignore]".to_string())]);
        for seen in
            ["assertion `left == right` failed: boo", "test tests::bad ... FAILED", "own: it is wrong"]
        {
            assert!(shown.contains(&seen), "{seen}");
        }
        for unseen in ["test a_fine ... ok", "    tests::good", "successes:", "running 4 tests"] {
            assert!(!shown.contains(&unseen), "{unseen}");
        }
    }

    #[test]
    fn sections_are_counted_and_named() {
        let mut tally = Tally::default();
        for line in [
            "ok     tests/suite/walk.rhai  12 sections, 2 skipped",
            "FAILED tests/suite/box.rhai > numbers are numbers",
            "  tests/suite/box.rhai:3:5: the number",
            "ERROR tests/suite/box.rhai > a name",
            "skipped 2: no Vulkan: install mesa-vulkan-drivers",
            "12 passed (reused 3), 2 failed, 2 skipped, 4 warnings; 40 checks in 1.2 s",
        ] {
            tally.read_sections(line);
        }
        assert_eq!((tally.passed, tally.failed), (12, 2));
        assert_eq!(tally.skips, [(2, "no Vulkan: install mesa-vulkan-drivers".to_string())]);
        assert_eq!(
            tally.failures,
            [
                "choreo test: tests/suite/box.rhai > numbers are numbers",
                "choreo test: tests/suite/box.rhai > a name"
            ]
        );
    }
}
