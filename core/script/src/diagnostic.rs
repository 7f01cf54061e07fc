//! Errors and warnings about a script, with place, source line and hint.

use choreo_plugin::excerpt;
use std::fmt;

pub use choreo_plugin::excerpt::steers_terminal;

/// Severity of a diagnostic, the most severe first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    Error,
    Warning,
    /// A finding that is often intended; `check` prints it on demand.
    Note,
}

/// An error, warning or note. It is printed as
/// ```text
/// walk.rhai:12:9: unknown joint "LeftHnd" in skeleton "hero"; did you mean "LeftHand"?
///     anna.look_at(boris.joint("LeftHnd"));
///                              ^
///     hint: joints: Hips, Spine, …
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    pub severity: Severity,
    /// Fixed name of the kind of finding, for `// allow: …` comments and tools; empty for errors without one.
    pub rule: &'static str,
    /// The path as the user wrote it; empty where no file is the cause (the command line).
    pub file: String,
    /// Line number from 1; 0 = the file as a whole.
    pub line: usize,
    /// Column in characters from 1; 0 = the line as a whole.
    pub column: usize,
    pub source_line: String,
    pub message: String,
    pub hint: Option<String>,
}

impl Diagnostic {
    /// An error without a place.
    pub fn error(message: impl Into<String>) -> Diagnostic {
        Diagnostic {
            severity: Severity::Error,
            rule: "",
            file: String::new(),
            line: 0,
            column: 0,
            source_line: String::new(),
            message: message.into(),
            hint: None,
        }
    }

    /// A warning without a place.
    pub fn warning(message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(message) }
    }

    /// Sets the file.
    pub fn in_file(mut self, file: impl Into<String>) -> Diagnostic {
        self.file = file.into();
        self
    }
}

/// Whether a line ends in a comment that allows a rule.
pub(crate) fn allows(line: &str, rule: &str) -> bool {
    let comment = line.split_once("//").map_or("", |(_, comment)| comment);
    let rules = comment.trim_start().strip_prefix("allow:").unwrap_or("");
    rules.split([',', ' ']).any(|allowed| allowed == rule)
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.file.is_empty() {
            write!(f, "{}:", self.file)?;
            if self.line > 0 {
                write!(f, "{}:", self.line)?;
                if self.column > 0 {
                    write!(f, "{}:", self.column)?;
                }
            }
            write!(f, " ")?;
        }
        match self.severity {
            Severity::Error => {}
            Severity::Warning => write!(f, "warning: ")?,
            Severity::Note => write!(f, "note: ")?,
        }
        write!(f, "{}", one_message(&self.message))?;
        if !self.rule.is_empty() {
            write!(f, " [{}]", self.rule)?;
        }
        if self.line > 0 && !self.source_line.trim().is_empty() {
            let (shown, before) = excerpt::excerpt(&self.source_line, self.column);
            write!(f, "\n    {shown}")?;
            if self.column > 0 {
                write!(f, "\n    {}^", " ".repeat(before))?;
            }
        }
        if let Some(hint) = &self.hint {
            write!(f, "\n    hint: {}", one_message(hint))?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostic {}

/// The text without characters that steer a terminal or reverse the reading direction: names in messages come from files and
/// scripts.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c != '\n' && steers_terminal(c) { '\u{fffd}' } else { c }).collect()
}

/// A text made [`printable`], on one line.
pub fn printable_line(text: &str) -> String {
    printable(text).replace('\n', "\u{fffd}")
}

/// A printable text of limited length. Further lines are indented, so that none looks like a separate message.
fn one_message(text: &str) -> String {
    const MOST: usize = 2_000;
    let mut shown: String = printable(text).chars().take(MOST).collect::<String>().replace('\n', "\n    ");
    let more = text.chars().count().saturating_sub(MOST);
    if more > 0 {
        shown.push_str(&format!("… ({more} characters more)"));
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_caret_stands_below_the_column() {
        let d = Diagnostic {
            severity: Severity::Error,
            rule: "",
            file: "walk.rhai".into(),
            line: 12,
            column: 9,
            source_line: "    let x = hoo;".into(),
            message: "unknown variable \"hoo\"".into(),
            hint: Some("did you mean \"hero\"?".into()),
        };
        assert_eq!(
            d.to_string(),
            "walk.rhai:12:9: unknown variable \"hoo\"\n    let x = hoo;\n        ^\n    hint: did you mean \"hero\"?"
        );
    }

    #[test]
    fn a_very_long_line_is_cut_around_the_column() {
        let line = "x".repeat(5000);
        let (shown, before) = excerpt::excerpt(&line, 3000);
        assert_eq!((shown.len(), before), (160, 120));
    }
}
