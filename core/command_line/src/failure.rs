//! Reasons why a command ends without a result, and the exit code of each.

use choreo_files::WriteError;
pub(crate) use choreo_files::describe_error;
use choreo_script::{Diagnostic, Severity, printable, steers_terminal};
use serde_json::json;

#[derive(Debug)]
pub(crate) enum Failure {
    /// An error in the script, the model or another input.
    Input(Vec<Problem>),
    /// An error in the command line.
    Usage(String),
    /// The result cannot be written.
    Output(String),
    Device(String),
    /// Sections failed, or none was tested. The text holds the numbers; the failures themselves have been reported.
    Tests(String),
    /// Rows of a batch failed. The text holds their numbers; the failures themselves have been reported.
    Rows(String),
    /// The machine, or a limit set on the program, gives too few threads or too little memory.
    Machine(String),
    /// A bug in the program.
    Internal(String),
    Interrupted,
    /// Another program of choreo ended with this exit code, and has printed the reason.
    AlreadyReported(u8),
    /// The reader of standard output has gone.
    ClosedPipe,
}

/// An error of an input.
#[derive(Debug, PartialEq)]
pub enum Problem {
    /// A text that names the file or option itself.
    Text(String),
    Script(Diagnostic),
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Problem::Text(text) => f.write_str(text),
            Problem::Script(diagnostic) => diagnostic.fmt(f),
        }
    }
}

impl From<Problem> for Diagnostic {
    fn from(problem: Problem) -> Diagnostic {
        match problem {
            Problem::Text(text) => Diagnostic::error(text),
            Problem::Script(diagnostic) => diagnostic,
        }
    }
}

impl Problem {
    pub fn json(&self) -> serde_json::Value {
        match self {
            Problem::Text(text) => json!({ "message": text }),
            Problem::Script(d) => json!({
                "severity": match d.severity {
                    Severity::Error => "error",
                    Severity::Warning => "warning",
                    Severity::Note => "note",
                },
                "rule": d.rule,
                "file": d.file, "line": d.line, "column": d.column, "message": d.message, "hint": d.hint,
            }),
        }
    }
}

impl Failure {
    pub(crate) fn input(text: impl Into<String>) -> Failure {
        Failure::Input(vec![Problem::Text(text.into())])
    }

    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Failure::Input(_) | Failure::Tests(_) | Failure::Rows(_) => 1,
            Failure::Usage(_) => 2,
            Failure::Output(_) => 3,
            Failure::Device(_) => 4,
            Failure::Machine(_) => 5,
            Failure::Internal(_) => 6,
            Failure::Interrupted => 130,
            Failure::AlreadyReported(code) => *code,
            // The exit code that a shell reports for a process ended by SIGPIPE.
            Failure::ClosedPipe => 141,
        }
    }

    /// Lines to print on standard error.
    pub(crate) fn message_lines(&self) -> Vec<String> {
        match self {
            Failure::Input(problems) => problems.iter().map(ToString::to_string).collect(),
            Failure::Usage(text) => vec![format!("{text}\n    see choreo --help")],
            Failure::Output(text) | Failure::Device(text) | Failure::Tests(text) | Failure::Rows(text) => {
                vec![text.clone()]
            }
            Failure::Machine(text) => vec![text.clone()],
            Failure::Internal(text) => vec![format!(
                "internal error: {text}\n    hint: this is a bug in choreo, whatever the input; please report it with the command and its files"
            )],
            Failure::Interrupted => vec!["interrupted".to_string()],
            Failure::ClosedPipe | Failure::AlreadyReported(_) => Vec::new(),
        }
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        let kind = match self {
            Failure::Input(_) => "input",
            Failure::Usage(_) => "usage",
            Failure::Output(_) => "output",
            Failure::Device(_) => "device",
            Failure::Tests(_) => "tests",
            Failure::Rows(_) => "rows",
            Failure::Machine(_) => "machine",
            Failure::Internal(_) => "internal",
            Failure::Interrupted => "interrupted",
            Failure::ClosedPipe => "closed pipe",
            Failure::AlreadyReported(_) => "viewer",
        };
        let errors: Vec<serde_json::Value> = match self {
            Failure::Input(problems) => problems.iter().map(Problem::json).collect(),
            other => other.message_lines().into_iter().map(|l| Problem::Text(l).json()).collect(),
        };
        json!({ "ok": false, "kind": kind, "exit_code": self.exit_code(), "errors": errors })
    }
}

/// Writes to standard output, without characters that would control a terminal. If the reader of a pipe has gone, the program ends quietly.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    let shown = printable(text);
    out.write_all(shown.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|e| output_failure("standard output", &e))
}

/// Writes one message to standard error, without characters that would control a terminal. Its further lines are indented, so that no name
/// in it can pass for a message of its own.
pub(crate) fn print_message(message: impl std::fmt::Display) {
    let shown = printable(&message.to_string()).replace('\n', "\n    ").replace("\n        ", "\n    ");
    write_error(&shown);
}

pub(crate) fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    print(&format!("{}\n", escape_terminal_controls(&crate::terminal::json::pretty(value))))
}

/// JSON on one line on standard error, for programs that write their result to standard output.
pub(crate) fn print_json_message(value: &serde_json::Value) {
    write_error(&escape_terminal_controls(&value.to_string()));
}

/// Writes a line to standard error. If standard error is closed or full, the exit code is the only report left.
fn write_error(line: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Writes characters that would control a terminal as \uXXXX: serde_json escapes only the control characters of ASCII. They occur only
/// inside strings, where the escape means the same.
fn escape_terminal_controls(json: &str) -> String {
    let escape = |c: char| match steers_terminal(c) && c != '\n' {
        true => format!("\\u{:04x}", c as u32),
        false => c.to_string(),
    };
    json.chars().map(escape).collect()
}

pub(crate) fn output_failure(place: &str, error: &std::io::Error) -> Failure {
    match error.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::ClosedPipe,
        _ => Failure::Output(format!("{place}: cannot write: {}", describe_error(error))),
    }
}

/// Failure for an output that was not written. `shown`: the output's name in messages.
pub(crate) fn write_failure(shown: &str, error: WriteError) -> Failure {
    match error {
        WriteError::Io(e) => output_failure(shown, &e),
        WriteError::Busy => Failure::Output(format!(
            "{shown}: cannot write: another choreo is rendering to it; wait until it is done, or give -o another name"
        )),
        error => Failure::Output(format!("{shown}: cannot write: {error}")),
    }
}

/// Fails if a count is above its limit. `name`: plural of what is counted, which is also the name of the limit.
pub(crate) fn check_limit(count: u64, name: &str, limit: u64) -> Result<(), Failure> {
    if count <= limit {
        return Ok(());
    }
    let hint = choreo_script::raise_hint(name, limit);
    Err(Failure::input(format!("too many {name}: {count}\n    hint: {hint}")))
}
