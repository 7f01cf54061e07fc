//! Converts the diagnostics of a run to messages of the protocol, grouped by file.

use crate::checker::CheckResult;
use crate::document::uri_of;
use crate::position::Lines;
use crate::source::{Source, is_word};
use crate::values::{Budget, Modules, Types};
use choreo_script::{Diagnostic, Severity, token_ranges};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Messages of a run by URI. The script itself always has an entry, even without messages.
pub(crate) fn diagnostics_by_uri(
    checked: &CheckResult,
    source: &Source,
    folder: Option<&Path>,
    modules: &dyn Modules,
) -> BTreeMap<String, Vec<Value>> {
    let mut found: BTreeMap<String, Vec<Value>> = BTreeMap::from([(checked.uri.clone(), Vec::new())]);
    let script = CheckedScript { uri: &checked.uri, source, modules };
    for diagnostic in &checked.diagnostics {
        let is_main = diagnostic.file.is_empty() || diagnostic.file == checked.script_name;
        let (uri, value) = if is_main {
            if is_expected_empty_module(diagnostic, source) {
                continue;
            }
            (checked.uri.clone(), script.encode_own(diagnostic))
        } else {
            let path = module_path(checked, folder, &diagnostic.file);
            let uri = path.map_or_else(|| checked.uri.clone(), |path| uri_of(&path));
            (uri, script.encode_of_module(diagnostic))
        };
        found.entry(uri).or_default().push(value);
    }
    for (file, text) in &checked.asset_warnings {
        let range = load_path_token(source, file).map_or(0..0, |token| source.tokens[token].clone());
        let diagnostic = Diagnostic::warning(format!("{file}: {text}"));
        let value = encode_diagnostic(&diagnostic, source.range(&range));
        found.entry(checked.uri.clone()).or_default().push(value);
    }
    found
}

/// Whether a diagnostic reports that nothing is on stage in a script that is only a module of functions, where that is intended.
fn is_expected_empty_module(diagnostic: &Diagnostic, source: &Source) -> bool {
    let has = |word: &str| (0..source.tokens.len()).any(|i| source.get(i) == word);
    diagnostic.line == 0
        && diagnostic.message.starts_with("nothing is on stage")
        && (has("fn") || source.tokens.is_empty())
}

/// Path of a module, by its name in messages.
fn module_path(checked: &CheckResult, folder: Option<&Path>, name: &str) -> Option<PathBuf> {
    let beside = folder.map(|folder| folder.join(name));
    // The name of another script may contain `..`.
    let beside = beside.map(|path| path.canonicalize().unwrap_or(path));
    beside
        .filter(|path| checked.read_files.contains(path))
        .or_else(|| checked.read_files.iter().find(|path| path.ends_with(name)).cloned())
}

/// Token of the string in `load("…")` for a file.
fn load_path_token(source: &Source, file: &str) -> Option<usize> {
    let is_load =
        |i: &usize| source.token_before(*i, 2) == "load" && source.string_value(*i).as_deref() == Some(file);
    (0..source.tokens.len()).find(is_load)
}

fn encode_diagnostic(diagnostic: &Diagnostic, range: Value) -> Value {
    let severity = match diagnostic.severity {
        Severity::Error => 1,
        Severity::Warning => 2,
        Severity::Note => 3,
    };
    let hint = diagnostic.hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default();
    let message = format!("{}{hint}", diagnostic.message);
    let mut value = json!({ "range": range, "severity": severity, "source": "choreo", "message": message });
    if !diagnostic.rule.is_empty() {
        value["code"] = diagnostic.rule.into();
    }
    if diagnostic.rule.starts_with("unused") {
        // Tag 1 (unnecessary): shown faded.
        value["tags"] = json!([1]);
    }
    value
}

/// Range of a diagnostic: the token at its column, else its line without the indentation.
fn diagnostic_range(diagnostic: &Diagnostic) -> Value {
    let text = &diagnostic.source_line;
    let line = diagnostic.line.saturating_sub(1);
    let lines = Lines::new(text);
    let bytes = if diagnostic.column == 0 {
        text.len() - text.trim_start().len()..text.trim_end().len()
    } else {
        let start = lines.byte_of_diagnostic(text, 1, diagnostic.column);
        let token = token_ranges(text).into_iter().find(|token| token.contains(&start));
        token.map_or(start..(start + 1).min(text.len()), |token| token.start..token.end)
    };
    let at = |byte: usize| json!({ "line": line, "character": lines.position(text, char_boundary_up_to(text, byte))["character"] });
    json!({ "start": at(bytes.start), "end": at(bytes.end) })
}

/// The last character boundary at or before a byte.
fn char_boundary_up_to(text: &str, byte: usize) -> usize {
    (0..=byte.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// The script that was run, to which diagnostics of its modules refer.
struct CheckedScript<'a> {
    uri: &'a str,
    source: &'a Source,
    modules: &'a dyn Modules,
}

impl CheckedScript<'_> {
    fn encode_own(&self, diagnostic: &Diagnostic) -> Value {
        let mut value = encode_diagnostic(diagnostic, diagnostic_range(diagnostic));
        let related = self.related_places(diagnostic);
        if !related.is_empty() {
            value["relatedInformation"] = related.into();
        }
        value
    }

    fn encode_of_module(&self, diagnostic: &Diagnostic) -> Value {
        let mut value = encode_diagnostic(diagnostic, diagnostic_range(diagnostic));
        let stem = diagnostic.file.trim_end_matches(".rhai");
        let imports = (0..self.source.tokens.len()).find(|i| {
            self.source.token_before(*i, 1) == "import"
                && self.source.string_value(*i).is_some_and(|s| s.trim_end_matches(".rhai") == stem)
        });
        if let Some(token) = imports {
            value["relatedInformation"] = json!([
                self.related_information(self.source.range(&self.source.tokens[token]), "imported here")
            ]);
        }
        value
    }

    fn related_information(&self, range: Value, message: &str) -> Value {
        json!({ "location": { "uri": self.uri, "range": range }, "message": message })
    }

    /// Places that a message mentions: a line, as in "from line 3", and the declaration of a suggested name.
    fn related_places(&self, diagnostic: &Diagnostic) -> Vec<Value> {
        let mut related = Vec::new();
        for mark in ["in line ", "from line "] {
            let number = diagnostic.message.split(mark).nth(1);
            let number =
                number.and_then(|rest| rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok());
            if let Some(line) = number.filter(|line: &usize| *line > 0 && *line <= self.source.lines.count())
            {
                let bytes = self.source.lines.bytes_of_line(&self.source.text, line - 1);
                related.push(
                    self.related_information(self.source.range(&bytes), "the line that the message names"),
                );
            }
        }
        if let Some(name) = suggestion(&diagnostic.message).filter(|name| is_word(name)) {
            let budget = Budget::default();
            let types = Types::new(self.source, self.modules, &budget);
            let declared = (0..self.source.tokens.len())
                .find(|i| self.source.get(*i) == name && types.declaration_at(*i).is_some());
            if let Some(token) = declared {
                let range = self.source.range(&self.source.tokens[token]);
                related.push(self.related_information(range, &format!("\"{name}\" is declared here")));
            }
        }
        related
    }
}

/// The suggested name in a message that contains `did you mean "NAME"?`.
pub(crate) fn suggestion(message: &str) -> Option<&str> {
    message.split("did you mean \"").nth(1)?.split("\"?").next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagnostic(line: &str, column: usize) -> Diagnostic {
        Diagnostic { line: 3, column, source_line: line.into(), ..Diagnostic::error("x") }
    }

    #[test]
    fn ranges_cover_the_token_in_utf16() {
        let value = diagnostic_range(&diagnostic("  \"𝄞ä\"; hero.plya(1)", 14));
        assert_eq!(value["start"], json!({ "line": 2, "character": 14 }));
        assert_eq!(value["end"], json!({ "line": 2, "character": 18 }));
        let value = diagnostic_range(&diagnostic("    let x = 1;", 0));
        assert_eq!(
            (value["start"]["character"].as_u64(), value["end"]["character"].as_u64()),
            (Some(4), Some(14))
        );
        assert_eq!(diagnostic_range(&diagnostic("", 7))["end"]["line"], 2);
    }

    #[test]
    fn the_suggestion_is_taken_from_the_message() {
        assert_eq!(suggestion("unknown clip \"Wlk\"; did you mean \"Walk\"?"), Some("Walk"));
        assert_eq!(suggestion("unknown clip \"Wlk\""), None);
    }
}
