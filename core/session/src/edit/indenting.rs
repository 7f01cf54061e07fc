//! Indentation of lines that an edit moves to another bracket depth.

use super::Edit;
use super::scan::Source;
use choreo_script::format;

/// Indents the lines of an edit after the first relative to it, like the formatter. Lines within strings and comments do not change; neither does
/// an edit of a text that the formatter cannot parse or that is indented with tabs.
pub(super) fn indented(text: &str, edit: Edit) -> Edit {
    let after = edit.apply(text);
    let Ok(changes) = format::edits(&after) else { return edit };
    let source = Source::new(&after);
    let code = |line: usize| line + after[line..].len() - after[line..].trim_start_matches([' ', '\t']).len();
    // Number of blanks at the beginning of a line as the formatter would write it.
    let usual = |line: usize| {
        let at = code(line);
        let change = changes.iter().find(|change| change.range.end == at && change.text.contains('\n'));
        let blanks = change.and_then(|change| change.text.rsplit('\n').next()).map(str::len);
        blanks.or_else(|| (source.next_token_start(at) == at && at < after.len()).then_some(at - line))
    };
    let written = edit.range.start..edit.range.start + edit.text.len();
    let begins = written.end - edit.text.trim_start().len();
    let first = after[..begins].rfind('\n').map_or(0, |at| at + 1);
    let blanks = &after[first..code(first)];
    let Some(usual_first) = usual(first).filter(|_| !blanks.contains('\t')) else { return edit };
    let mut new = edit.text.clone();
    let breaks: Vec<usize> = after[begins..written.end].match_indices('\n').map(|(at, _)| at).collect();
    for line in breaks.into_iter().rev().map(|at| begins + at + 1) {
        let at = code(line);
        let Some(usual) = usual(line).filter(|_| at < written.end) else { continue };
        let depth = (usual + blanks.len()).saturating_sub(usual_first);
        new.replace_range(line - written.start..at - written.start, &" ".repeat(depth));
    }
    Edit { text: new, ..edit }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn insert_indented(before: &str, new: &str, after: &str) -> String {
        let text = format!("{before}{after}");
        let edit = Edit { range: before.len()..before.len(), text: new.to_string() };
        indented(&text, edit).apply(&text)
    }

    #[test]
    fn added_lines_are_indented_relative_to_the_first() {
        let call =
            "\nb.play(c, #{\n            // why\n            fade: 0.2,\n        })\n        .until(2.0);";
        let wanted = "\nb.play(c, #{\n    // why\n    fade: 0.2,\n})\n    .until(2.0);";
        assert_eq!(insert_indented("let b = 1;", call, "\n"), format!("let b = 1;{wanted}\n"));
        // The author has indented the line above in another way.
        let then = "\n  .then(c, #{\n    fade: 0.2,\n})";
        assert_eq!(
            insert_indented("b.play(c)", then, ";\n"),
            "b.play(c)\n  .then(c, #{\n      fade: 0.2,\n  });\n"
        );
        // Strings and text that cannot be parsed stay as they are.
        let say = "\nsay(`a\n  b`);";
        assert_eq!(insert_indented("x();", say, "\n"), format!("x();{say}\n"));
        assert_eq!(insert_indented("x(", "\n        y", "]"), "x(\n        y]");
    }
}
