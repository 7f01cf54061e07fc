//! Runs test binaries. One call of cargo builds them, and several run at a time, because many of them wait for windows and other programs.

use crate::{cargo, root};
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// A test binary, and the names by which cargo refers to it.
pub(crate) struct Binary {
    path: PathBuf,
    /// Folder of the package, which is the working directory of the test.
    package: PathBuf,
    /// Source as in cargo's header line: `tests/leaks.rs`, `unittests src/lib.rs`.
    source: String,
    /// Arguments with which cargo runs the binary alone: `-p choreo --test leaks`.
    rerun: String,
}

/// Builds the test binaries of all packages.
pub(crate) fn built() -> Result<Vec<Binary>, String> {
    let arguments = ["test", "--workspace", "--no-run", "--message-format=json-render-diagnostics"];
    let output = cargo(&arguments).stdin(Stdio::null()).stderr(Stdio::inherit()).output();
    let output = output.map_err(|e| format!("cargo test did not start: {e}"))?;
    if !output.status.success() {
        return Err("the tests do not build; the errors are printed above".into());
    }
    Ok(String::from_utf8_lossy(&output.stdout).lines().filter_map(Binary::of_message).collect())
}

impl Binary {
    /// Parses a message of cargo about a built target (the Cargo Book, "External tools").
    fn of_message(line: &str) -> Option<Binary> {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        let path = PathBuf::from(message["executable"].as_str()?);
        let target = &message["target"];
        if message["profile"]["test"] != true {
            return None;
        }
        let package = PathBuf::from(message["manifest_path"].as_str()?).parent()?.to_path_buf();
        let source = PathBuf::from(target["src_path"].as_str()?);
        let source = source.strip_prefix(&package).unwrap_or(&source).display().to_string();
        let (kind, name) = (target["kind"][0].as_str()?, target["name"].as_str()?);
        let id = message["package_id"].as_str()?;
        // The id is `path+file:///folder#name@version`, or ends in `#version` if the folder has the package's name.
        let (folder, end) = id.rsplit_once('#')?;
        let package_name = match end.split_once('@') {
            Some((name, _)) => name,
            None => folder.rsplit('/').next()?,
        };
        let (source, which) = match kind {
            "test" => (source, format!("--test {name}")),
            "bin" => (format!("unittests {source}"), format!("--bin {name}")),
            _ => (format!("unittests {source}"), "--lib".into()),
        };
        Some(Binary { path, package, source, rerun: format!("-p {package_name} {which}") })
    }

    /// Runs the binary to its end. Returns the lines that cargo would print: a header, the output, and the reason of a failure.
    fn run(&self, arguments: &[&str]) -> Result<Vec<String>, String> {
        let mut command = Command::new(&self.path);
        command.args(arguments).current_dir(&self.package).env("CHOREO_PLUGINS", "");
        let shown = self.path.strip_prefix(root()).unwrap_or(&self.path).display();
        let mut lines = vec![format!("     Running {} ({shown})", self.source)];
        let status = lines_of(command, |line| lines.push(line.to_string()))?;
        if !status.success() {
            lines.push(format!("error: test failed, to rerun pass `{}`", self.rerun));
            #[cfg(unix)]
            if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
                lines.push(format!("  process didn't exit successfully: `{shown}` (signal: {signal})"));
            }
        }
        Ok(lines)
    }
}

/// Runs the tests of all packages; `line` gets their output, one binary after another. Returns false if a test has failed.
pub(crate) fn run(
    binaries: &[Binary],
    arguments: &[&str],
    mut line: impl FnMut(&str),
) -> Result<bool, String> {
    let queue = Mutex::new(binaries.iter());
    let at_once = std::thread::available_parallelism().map_or(1, |n| n.get()).max(2);
    let (to, ended) = channel();
    std::thread::scope(|scope| {
        for _ in 0..at_once {
            let (to, queue) = (to.clone(), &queue);
            scope.spawn(move || {
                let next = || queue.lock().ok().and_then(|mut left| left.next());
                while let Some(binary) = next() {
                    if to.send(binary.run(arguments)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(to);
        let mut passed = true;
        for lines in ended {
            let lines = lines?;
            passed &= !lines.iter().any(|text| text.starts_with("error: test failed"));
            lines.iter().for_each(|text| line(text));
        }
        Ok(passed)
    })
}

/// Runs a command and passes on the lines of its standard output and standard error.
pub(crate) fn lines_of(mut command: Command, mut line: impl FnMut(&str)) -> Result<ExitStatus, String> {
    let name = command.get_program().display().to_string();
    let failed = |e: std::io::Error| format!("{name}: {e}");
    // Both streams share one pipe, so that the lines keep their order.
    let (output, input) = std::io::pipe().map_err(failed)?;
    command.stdin(Stdio::null()).stderr(input.try_clone().map_err(failed)?).stdout(input);
    let mut child = command.spawn().map_err(failed)?;
    // The command holds write ends of the pipe, which would never be closed.
    drop(command);
    let lines = read(output);
    loop {
        match lines.recv_timeout(Duration::from_secs(5)) {
            Ok(bytes) => line(&String::from_utf8_lossy(&bytes)),
            // A program left behind by an aborted test may keep the pipe open.
            Err(RecvTimeoutError::Timeout) if child.try_wait().is_ok_and(|ended| ended.is_none()) => {}
            Err(_) => break,
        }
    }
    child.wait().map_err(failed)
}

fn read(output: std::io::PipeReader) -> Receiver<Vec<u8>> {
    let (to, lines) = channel();
    std::thread::spawn(move || {
        BufReader::new(output).split(b'\n').map_while(Result::ok).try_for_each(|line| to.send(line))
    });
    lines
}

#[cfg(test)]
mod tests {
    use super::Binary;

    /// Messages of cargo 1.95, shortened.
    #[test]
    fn binary_names_are_read_from_cargo_messages() {
        let message = |id: &str, kind: &str, name: &str, source: &str, test: bool| {
            let target = serde_json::json!({ "kind": [kind], "name": name, "src_path": source });
            serde_json::json!({
                "reason": "compiler-artifact", "package_id": id, "manifest_path": "/w/core/cli/Cargo.toml", "target": target,
                "profile": { "test": test }, "executable": "/w/target/debug/deps/x-1",
            })
            .to_string()
        };
        let named = "path+file:///w/core/cli#choreo@0.1.0";
        let of = |line: &str| Binary::of_message(line).map(|b| (b.source, b.rerun));
        let line = message(named, "test", "leaks", "/w/core/cli/tests/leaks.rs", true);
        assert_eq!(of(&line), Some(("tests/leaks.rs".into(), "-p choreo --test leaks".into())));
        let line =
            message("path+file:///w/tests/guide#0.1.0", "lib", "guide", "/w/core/cli/src/lib.rs", true);
        assert_eq!(of(&line), Some(("unittests src/lib.rs".into(), "-p guide --lib".into())));
        // Programs that tests start are no test binaries.
        assert_eq!(of(&message(named, "bin", "choreo", "/w/core/cli/src/main.rs", false)), None);
        assert_eq!(of("{\"reason\":\"build-finished\",\"success\":true}"), None);
    }
}
