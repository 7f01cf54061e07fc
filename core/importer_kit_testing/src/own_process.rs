//! Runs tests that measure their process in a process of their own, so that other tests of the same binary do not disturb them.

use std::process::Command;

/// Environment variable that marks the process of a test that runs in a process of its own.
const ISOLATED_TEST_ENV_VAR: &str = "CHOREO_ALONE";

/// Runs the calling test in a process of its own: this test binary again, with that test only. Returns true in the calling process, where
/// nothing is left to do; false in the new process, or if the test is alone already. Panics with the test's output if it fails there.
pub fn ran_in_own_process() -> bool {
    let thread = std::thread::current();
    // libtest names a thread after its test. Without threads it runs one test at a time, which is alone already.
    let Some(name) = thread.name().filter(|name| *name != "main") else { return false };
    if std::env::var_os(ISOLATED_TEST_ENV_VAR).is_some() {
        return false;
    }
    let program = std::env::current_exe().unwrap_or_else(|e| panic!("the path of this program: {e}"));
    let mut command = Command::new(program);
    command.args([name, "--exact", "--include-ignored", "--nocapture"]).env(ISOLATED_TEST_ENV_VAR, "1");
    let output = command.output().unwrap_or_else(|e| panic!("{name} did not start again: {e}"));
    let text = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}, alone: {}\n{text}{stderr}", output.status);
    // The closing count of the tests must not count this one twice.
    assert!(text.contains("test result: ok. 1 passed"), "{name} was not found again:\n{text}");
    print!("{}", own_lines(&text, name));
    true
}

/// The lines that the test itself printed, without those of libtest.
fn own_lines(output: &str, name: &str) -> String {
    // libtest with one thread writes a test's name before it runs, and its output continues on that line.
    let begun = format!("test {name} ... ");
    let lines = output.lines().map(|line| line.strip_prefix(&begun).unwrap_or(line));
    let of_libtest = |line: &str| line.is_empty() || line == "ok" || line.starts_with("running 1 test");
    let own = lines.filter(|line| !of_libtest(line) && !line.starts_with("test result: "));
    own.map(|line| format!("{line}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ran_in_own_process_reruns_its_caller_in_a_new_process() {
        let here = std::process::id();
        if ran_in_own_process() {
            return;
        }
        println!("process {here}");
        assert!(
            std::env::var_os(ISOLATED_TEST_ENV_VAR).is_some()
                || std::thread::current().name() == Some("main")
        );
    }

    #[test]
    fn lines_of_libtest_are_removed() {
        let several =
            "\nrunning 1 test\nSKIP 3: no files\ntest a::b ... ok\n\ntest result: ok. 1 passed; 0 failed\n\n";
        let single =
            "\nrunning 1 test\ntest a::b ... SKIP 3: no files\nok\n\ntest result: ok. 1 passed; 0 failed\n\n";
        for output in [several, single] {
            assert_eq!(own_lines(output, "a::b"), "SKIP 3: no files\n");
        }
    }
}
