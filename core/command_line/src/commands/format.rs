//! `choreo format`: formats scripts in one style.

use crate::args::FormatArgs;
use crate::failure::{Failure, Problem, describe_error, print, write_failure};
use choreo_files::write_whole;
use choreo_script::Diagnostic;
use choreo_script::format::{FormatError, formatted};
use choreo_test_runner::collect::{display_path, shell_quote};
use std::io::{Read, Write, stdin, stdout};
use std::path::{Path, PathBuf};

/// Largest script in bytes.
const MAX_SCRIPT_BYTES: u64 = 4 << 20;
/// Largest number of scripts; more are a mistake, such as `choreo format` in a home folder.
const MAX_SCRIPTS: usize = 20_000;

pub(crate) fn run(args: &FormatArgs) -> Result<(), Failure> {
    if args.paths == [Path::new("-")] {
        return format_stdin(args.check);
    }
    let (mut problems, mut changed) = (Vec::new(), Vec::new());
    for path in find_scripts(&args.paths)? {
        match format_script(&path) {
            Ok(None) => {}
            Ok(Some(_)) if args.check => changed.push(path),
            Ok(Some(text)) => {
                let name = display_path(&path);
                write_whole(&path, text.as_bytes()).map_err(|e| write_failure(&name, e))?;
                print(&format!("formatted {name}\n"))?;
            }
            Err(problem) => problems.push(problem),
        }
    }
    if !changed.is_empty() {
        let names: Vec<String> = changed.iter().map(|path| shell_quote(&display_path(path))).collect();
        problems.extend(names.iter().map(|name| Problem::Text(format!("{name}: is not formatted"))));
        let hint = match names.len() {
            1..=8 => format!("hint: choreo format {}", names.join(" ")),
            _ => "hint: the same command without --check formats them".to_string(),
        };
        problems.push(Problem::Text(hint));
    }
    if problems.is_empty() { Ok(()) } else { Err(Failure::Input(problems)) }
}

/// Formats standard input to standard output, for editors.
fn format_stdin(check: bool) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    let read = stdin().lock().take(MAX_SCRIPT_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|e| Failure::input(format!("standard input: {}", describe_error(&e))))?;
    let text = script_text("standard input", bytes).map_err(|problem| Failure::Input(vec![problem]))?;
    let new = formatted(&text).map_err(|error| {
        Failure::Input(vec![Problem::Script(format_diagnostic("standard input", &text, &error))])
    })?;
    if check {
        return if new == text { Ok(()) } else { Err(Failure::input("standard input: is not formatted")) };
    }
    // The text goes to an editor unchanged. If the reader has gone, the exit code is the only report left.
    let mut out = stdout().lock();
    out.write_all(new.as_bytes()).and_then(|()| out.flush()).map_err(|_| Failure::ClosedPipe)
}

/// Formatted text of a script; `None` if it is formatted already.
fn format_script(path: &Path) -> Result<Option<String>, Problem> {
    let name = display_path(path);
    let bytes = choreo_files::read(path, MAX_SCRIPT_BYTES)
        .map_err(|e| Problem::Text(format!("{name}: cannot read: {e}")))?;
    let text = script_text(&name, bytes)?;
    match formatted(&text) {
        Ok(new) => Ok((new != text).then_some(new)),
        Err(error) => Err(Problem::Script(format_diagnostic(&name, &text, &error))),
    }
}

fn script_text(name: &str, bytes: Vec<u8>) -> Result<String, Problem> {
    if bytes.len() as u64 > MAX_SCRIPT_BYTES {
        return Err(Problem::Text(format!("{name}: a script may have at most {MAX_SCRIPT_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|_| Problem::Text(format!("{name}: is not a text file in UTF-8")))
}

fn format_diagnostic(name: &str, text: &str, error: &FormatError) -> Diagnostic {
    let source_line = text.lines().nth(error.line.saturating_sub(1)).unwrap_or_default().to_string();
    let message = format!("not formatted: {}", error.message);
    let hint = Some(format!("choreo check {} says what is wrong", shell_quote(name)));
    let (line, column) = (error.line, error.column);
    Diagnostic { line, column, source_line, hint, ..Diagnostic::error(message).in_file(name) }
}

/// Scripts that were named, and all scripts in folders that were named, including modules and plugins in Rhai.
fn find_scripts(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let here = [PathBuf::from(".")];
    let paths = if paths.is_empty() { &here } else { paths };
    let mut found = Vec::new();
    for path in paths {
        if path.is_dir() {
            collect_scripts(path, &mut found)?;
        } else if path.is_file() {
            found.push(path.clone());
        } else {
            return Err(Failure::input(format!("{}: no such file or folder", display_path(path))));
        }
    }
    Ok(found)
}

fn collect_scripts(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let failed =
        |e: std::io::Error| Failure::input(format!("{}: {}", display_path(folder), describe_error(&e)));
    for (name, kind) in choreo_files::entries(folder).map_err(failed)? {
        let (path, name) = (folder.join(&name), name.to_string_lossy());
        let is_skipped = name.starts_with('.') || matches!(&*name, "target" | "node_modules");
        // Links are not followed: the scripts that they lead to are found at their own paths.
        if kind.is_dir() && !is_skipped {
            collect_scripts(&path, found)?;
        } else if kind.is_file() && !is_skipped && name.to_lowercase().ends_with(".rhai") {
            if found.len() >= MAX_SCRIPTS {
                return Err(Failure::Usage(format!(
                    "more than {MAX_SCRIPTS} scripts below {}; name a folder",
                    display_path(folder)
                )));
            }
            found.push(path.strip_prefix(".").map_or(path.clone(), Path::to_path_buf));
        }
    }
    Ok(())
}
