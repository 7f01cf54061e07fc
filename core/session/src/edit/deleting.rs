//! Deletion of whole objects: the statement that creates one, and the statements that are only about it.

use super::scan::Source;
use super::{Edit, EditRefused};
use std::ops::Range;

/// Deletes the statement around the creating call, `let bob = cast("bob", model).at(…);`, the later statements that begin with its variable,
/// `bob.play(…);`, and the statements `let model = load(…);` of files that no other statement uses.
///
/// # Errors
/// The object is created in a block, or other statements use its variable. The text is for the user.
pub fn delete_object(text: &str, line: usize, column: usize) -> Result<Edit, EditRefused> {
    let source = &Source::new(text);
    let refuse = |line: usize, why: &str| Err(EditRefused::at(line, why));
    let Some(at) = source.byte_at(line, column).filter(|at| source.call_from(*at).is_some()) else {
        return refuse(line, "there is no call to delete here");
    };
    let line_of = |byte: usize| text[..byte].matches('\n').count() + 1;
    let in_block = |at: usize| source.bracket_depth_at(source.statement_start(at)) > 0;
    if in_block(at) {
        return refuse(line, "it is made in a function or a block; delete it there");
    }
    let own = source.statement_start(at)..source.statement_end(at);
    let mut ranges = vec![own.clone()];
    if let Some(name) = source.variable_of(own.start) {
        for used in source.uses_of(name).filter(|used| !own.contains(used)) {
            let statement = source.statement_start(used)..source.statement_end(used);
            let is_about_it = statement.start == used
                && text[source.next_token_start(used + name.len())..].starts_with('.');
            if in_block(used) || !is_about_it {
                return refuse(line_of(used), &format!("this line uses {name}; change it first"));
            }
            ranges.push(statement);
        }
    }
    ranges.sort_by_key(|range| range.start);
    ranges.dedup();
    ranges.extend(unused_load_statements(source, &ranges));
    ranges.sort_by_key(|range| range.start);
    let mut after = text.to_string();
    for range in ranges.into_iter().rev() {
        after.replace_range(source.whole_lines(&range).unwrap_or(range), "");
    }
    Ok(Edit::between(text, &after))
}

/// Statements `let NAME = load(…);` outside blocks whose variable is used only within these ranges.
fn unused_load_statements(source: &Source, gone: &[Range<usize>]) -> Vec<Range<usize>> {
    let is_gone = |at: &usize| gone.iter().any(|range| range.contains(at));
    let of_load = |at: usize| {
        let own = source.statement_start(at)..source.statement_end(at);
        let name = source.variable_of(own.start).filter(|_| source.bracket_depth_at(at) == 0)?;
        // The load must be the whole value of the variable.
        let is_whole = source.variable_before(at) == Some(name)
            && source[source.next_token_start(source.call_from(at)?.end)..].starts_with(';');
        let uses: Vec<usize> = source.uses_of(name).filter(|used| !own.contains(used)).collect();
        (is_whole && !uses.is_empty() && uses.iter().all(is_gone)).then_some(own)
    };
    source.calls_of("load").filter_map(|load| of_load(load.name.start)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::marked::marked;

    fn deleted(text: &str) -> Result<String, String> {
        let (text, line, column) = marked(text);
        let edit = delete_object(&text, line, column).map_err(|refused| refused.why)?;
        let after = edit.apply(&text);
        assert_eq!(edit.inverse(&text).apply(&after), text);
        Ok(after)
    }

    #[test]
    fn an_object_is_deleted_with_the_statements_about_it() {
        let text = "let m = load(\"m\");\nlet bob = |cast(\"bob\", m)\n    .at(1, 0, 0); // left\nlet a = 1;\n  bob.play(m.clip(\"W\"))\n    .until(2.0);\nsun(#{});\n";
        assert_eq!(deleted(text).unwrap(), "let a = 1;\nsun(#{});\n");
        // A file goes with the last object that uses it.
        let other = text.replace("sun(#{});", "cast(\"eve\", m);");
        assert_eq!(deleted(&other).unwrap(), "let m = load(\"m\");\nlet a = 1;\ncast(\"eve\", m);\n");
        assert_eq!(deleted("a();\n|sun(#{ intensity: 2.0 });\nb();").unwrap(), "a();\nb();");
        assert_eq!(deleted("a(); |sun(); b();").unwrap(), "a();  b();");
        assert_eq!(deleted("fn f() { }\nlet c = |camera(\"c\").at(1, 2, 3);\n").unwrap(), "fn f() { }\n");
    }

    #[test]
    fn objects_used_elsewhere_or_made_in_blocks_are_not_deleted() {
        let why = deleted("let bob = |cast(\"bob\", m);\nada.face(bob);\n").unwrap_err();
        assert_eq!(why, "line 2: this line uses bob; change it first");
        let why = deleted("let bob = |cast(\"bob\", m);\nif x { bob.play(c); }\n").unwrap_err();
        assert!(why.starts_with("line 2: this line uses bob"), "{why}");
        let why = deleted("fn f(x) {\n    |cast(x, m);\n}\n").unwrap_err();
        assert_eq!(why, "line 2: it is made in a function or a block; delete it there");
        // A method of that name, or the name within a string, is not a use.
        assert_eq!(
            deleted("let at = |cast(\"at\", m);\nc.at(1);\nsay(\"at\");").unwrap(),
            "c.at(1);\nsay(\"at\");"
        );
    }

    #[test]
    fn deleting_in_truncated_text_does_not_panic() {
        let text = "let ä = cast(\"ü(\") /* é */ .at([1]);\nä.play(x);\n}";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for column in 1..12 {
                    let _ = delete_object(&text[*from..*to], 1, column);
                }
            }
        }
    }
}
