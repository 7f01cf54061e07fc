//! Preprocessor for `@if(A && !B || C)`, `@else`, `@end`: lines are blanked, never removed, so that line and column of an error
//! are those of the file. `@if(A) text` on one line keeps or drops that line alone.

use super::switches::switch_names;
use crate::plan::shader_features::holds;
use thiserror::Error;

#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {what}")]
pub struct PreprocessError {
    /// Line number from 1.
    pub line: usize,
    pub what: String,
}

pub fn preprocess(text: &str, on: &[&str]) -> Result<String, PreprocessError> {
    let mut out = String::with_capacity(text.len());
    // One entry for each open `@if`: (line number, whether this branch is kept, whether everything around it is kept).
    let mut open: Vec<(usize, bool, bool)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line_number = i + 1;
        let error = |what: String| PreprocessError { line: line_number, what };
        let kept = open.last().is_none_or(|(_, branch, around)| *branch && *around);
        let code = line.trim_start();
        if let Some(rest) = code.strip_prefix("@if") {
            let rest = rest.trim_start();
            let inner =
                rest.strip_prefix('(').ok_or_else(|| error("`@if` needs a condition in (…)".into()))?;
            let (condition, after) = inner
                .split_once(')')
                .ok_or_else(|| error("`@if(` has no closing parenthesis on its line".into()))?;
            check_names(condition, line_number)?;
            let holds = holds(condition, |name| on.contains(&name));
            if after.trim().is_empty() {
                open.push((line_number, holds, kept));
            } else if kept && holds {
                // Blanks replace the condition, so that columns stay.
                let directive = line.len() - after.len();
                out.extend(std::iter::repeat_n(' ', directive));
                out.push_str(after);
            }
        } else if code.trim_end() == "@else" {
            let last = open.last_mut().ok_or_else(|| error("`@else` without `@if`".into()))?;
            last.1 = !last.1;
        } else if code.trim_end() == "@end" {
            open.pop().ok_or_else(|| error("`@end` without `@if`".into()))?;
        } else if kept {
            out.push_str(line);
        }
        out.push('\n');
    }
    match open.last() {
        Some((line, _, _)) => Err(PreprocessError { line: *line, what: "`@if` without `@end`".into() }),
        None => Ok(out),
    }
}

/// Refuses unknown names: they are typing mistakes, not switches that are off.
fn check_names(condition: &str, line: usize) -> Result<(), PreprocessError> {
    let names = condition.split("||").flat_map(|group| group.split("&&"));
    for name in names.map(|term| term.trim().trim_start_matches('!').trim()) {
        if !switch_names().any(|known| known == name) {
            let known: Vec<&str> = switch_names().collect();
            let what = format!("unknown switch `{name}`; known: {}", known.join(", "));
            return Err(PreprocessError { line, what });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preprocessing_keeps_lines_and_columns() {
        let text = "a\n@if(SKIN)\nb\n@else\nc\n@end\n  @if(!LIT) d\ne";
        assert_eq!(preprocess(text, &["SKIN"]).unwrap(), "a\n\nb\n\n\n\n            d\ne\n");
        assert_eq!(preprocess(text, &["LIT"]).unwrap(), "a\n\n\n\nc\n\n\ne\n");
    }

    #[test]
    fn nested_and_combined_conditions_are_evaluated() {
        let text = "@if(SKIN || MORPH)\n@if(SKIN && !MORPH)\nx\n@end\ny\n@end";
        assert_eq!(preprocess(text, &["MORPH"]).unwrap(), "\n\n\n\ny\n\n");
        assert_eq!(preprocess(text, &["SKIN"]).unwrap(), "\n\nx\n\ny\n\n");
        assert_eq!(preprocess(text, &[]).unwrap(), "\n\n\n\n\n\n");
    }

    #[test]
    fn errors_name_their_line() {
        let error = |text: &str| preprocess(text, &[]).unwrap_err().to_string();
        assert!(error("x\n@if(SKNI)\n@end").starts_with("line 2: unknown switch `SKNI`; known: SKIN,"));
        assert_eq!(error("@if(SKIN)\nx"), "line 1: `@if` without `@end`");
        assert_eq!(error("x\n@end"), "line 2: `@end` without `@if`");
        assert_eq!(error("@else"), "line 1: `@else` without `@if`");
        assert_eq!(error("@if SKIN"), "line 1: `@if` needs a condition in (…)");
    }
}
