//! Comments `//~ error: text` and `//~ warning: text`: expected diagnostics, written on the line where they occur.

use super::ExpectedDiagnostic;
use crate::api_error::Place;
use crate::diagnostic::{Diagnostic, Severity};

const MARK: &str = "//~";

/// All expected diagnostics of a script, and errors about `//~` comments that contain neither `error` nor `warning`. A line that
/// has only comments belongs to the line of code above it.
pub(super) fn parse_expected(file: &str, text: &str) -> (Vec<ExpectedDiagnostic>, Vec<Diagnostic>) {
    let (mut expected, mut wrong) = (Vec::new(), Vec::new());
    let mut code_line = 1;
    for (index, row) in text.lines().enumerate() {
        let Some(start) = find_mark(row) else {
            if !row.trim().is_empty() {
                code_line = index + 1;
            }
            continue;
        };
        if !row[..start].trim().is_empty() {
            code_line = index + 1;
        }
        for comment in row[start..].split(MARK).skip(1) {
            let comment = comment.trim();
            let read = ["error", "warning"].iter().find_map(|word| {
                let rest = comment.strip_prefix(word)?;
                Some((*word, rest.strip_prefix(':')?.trim()))
            });
            match read {
                Some((word, text)) if !text.is_empty() => expected.push(ExpectedDiagnostic {
                    severity: if word == "error" { Severity::Error } else { Severity::Warning },
                    line: code_line,
                    text: text.to_string(),
                    has_occurred: false,
                }),
                _ => wrong.push(Diagnostic {
                    rule: "",
                    severity: Severity::Error,
                    file: file.to_string(),
                    line: index + 1,
                    column: row[..start].chars().count() + 1,
                    source_line: row.to_string(),
                    message: "this //~ comment states no expected message".to_string(),
                    hint: Some(
                        "write //~ error: TEXT or //~ warning: TEXT, a part of the message".to_string(),
                    ),
                }),
            }
        }
    }
    (expected, wrong)
}

/// Position of the first mark of a line that is outside a string.
fn find_mark(row: &str) -> Option<usize> {
    let mut quote = None;
    let mut escaped = false;
    for (at, c) in row.char_indices() {
        if escaped {
            escaped = false;
            continue;
        }
        match (quote, c) {
            (Some('"'), '\\') => escaped = true,
            (Some(open), c) if c == open => quote = None,
            (None, '"' | '`') => quote = Some(c),
            (None, '/') if row[at..].starts_with(MARK) => return Some(at),
            // The rest of the line is an ordinary comment.
            (None, '/') if row[at..].starts_with("//") => return None,
            _ => {}
        }
    }
    None
}

/// Removes expected diagnostics from `diagnostics` and records that they have occurred. One comment may match several diagnostics
/// of its line. Diagnostics of another script also belong to the line that runs it.
pub(super) fn match_expected(
    file: &str,
    scenes: &[(String, Place)],
    expected: &mut [ExpectedDiagnostic],
    diagnostics: &mut Vec<Diagnostic>,
) {
    diagnostics.retain(|d| {
        let mut is_unexpected = true;
        for e in expected.iter_mut() {
            let is_at_line = d.file == file && d.line == e.line;
            let is_of_scene =
                |(name, at): &(String, Place)| *name == d.file && at.file == file && at.line == e.line;
            let belongs_to_line = is_at_line || scenes.iter().any(is_of_scene);
            if belongs_to_line && d.severity == e.severity && d.message.contains(&e.text) {
                e.has_occurred = true;
                is_unexpected = false;
            }
        }
        is_unexpected
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_belong_to_the_code_on_their_line_or_above() {
        let text = "let a = \"//~ error: no\"; // //~ error: no\n\
                    foo(); //~ error: unknown foo //~ warning: slow\n\
                    \n\
                    //~ error: and more\n\
                    bar() //~ eror: slip";
        let (expected, wrong) = parse_expected("t.rhai", text);
        let found: Vec<_> = expected.iter().map(|e| (e.line, e.severity, e.text.as_str())).collect();
        assert_eq!(
            found,
            [
                (2, Severity::Error, "unknown foo"),
                (2, Severity::Warning, "slow"),
                (2, Severity::Error, "and more")
            ]
        );
        assert_eq!((wrong.len(), wrong[0].line, wrong[0].column), (1, 5, 7));
    }
}
