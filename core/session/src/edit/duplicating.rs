//! Copies of whole objects: the statement that creates one and the statements about it, under another name.

use super::casting::first_free;
use super::key_list::{arguments, leading_argument_count, split_at_commas};
use super::object::ScriptObject;
use super::scan::{Call, Source};
use super::values::{parse_literals, rewrite_literals};
use super::{Edit, EditRefused, NamedBy};
use choreo_script::quoted;
use glam::DVec3;
use std::ops::Range;

/// The edit that copies an object.
#[derive(Clone, Debug)]
pub struct Duplicate {
    pub edit: Edit,
    /// Name of the copy, if the script states one.
    pub name: Option<String>,
    /// Lines of statements about other objects that use this one and were not copied, from 1.
    pub uncopied_lines: Vec<usize>,
    /// Line (from 1) whose computed position the copy keeps, so that it is at the place of the original. `None` if the copy was moved.
    pub computed_position_line: Option<usize>,
}

/// Adds a copy of the object that the call at a position creates, after the last statement about it. The copy consists of the statement with the
/// call and the later statements that begin with its variable, in their order. The copy and its variable get the next free number, `bob 2` and
/// `bob_2`; a copied camera loses its cuts. `offset`: distance of the copy from the object, metres; applied if numbers state the position and the
/// targets of `.walk_to`, or the keys of the position.
///
/// # Errors
/// The name is computed, or a statement about the object stands in a block or defines another variable. The text is for the user.
pub fn duplicate_object(
    text: &str,
    (line, column): (usize, usize),
    by: NamedBy,
    offset: Option<DVec3>,
) -> Result<Duplicate, EditRefused> {
    let object = ScriptObject::at(text, line, column)?;
    let source = &object.text;
    let (ranges, uncopied_lines) = statements_about(source, object.creating_call.name.start, line)?;
    let stated = object.stated_name(by);
    let name = match stated.as_ref().map(|range| (object.name(by), &text[range.clone()])) {
        None => None,
        Some((Some(name), _)) => {
            Some(first_free(|n| format!("{name} {}", n + 1), |name| text.contains(&quoted(name))))
        }
        Some((None, written)) => {
            let why = format!("its name, {written}, is computed; duplicate it in the script");
            return Err(EditRefused::at(line, &why));
        }
    };
    let old = source.variable_of(ranges[0].start);
    let variable = old.map(|old| first_free(|n| format!("{old}_{}", n + 1), |name| text.contains(name)));
    let mut changes: Vec<(Range<usize>, &str)> =
        cut_ranges(&object).into_iter().map(|cut| (cut, "")).collect();
    if let (Some(old), Some(new)) = (old, &variable) {
        let declared = source.next_token_start(ranges[0].start + "let".len());
        let used = source.uses_of(old).filter(|at| *at != declared);
        changes.extend(std::iter::once(declared).chain(used).map(|at| (at..at + old.len(), new.as_str())));
    }
    let new_name = stated.zip(name.as_deref().map(quoted));
    changes.extend(new_name.iter().map(|(at, new)| (at.clone(), new.as_str())));
    changes.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
    let mut copy = String::new();
    for range in &ranges {
        let mut statement = text[range.clone()].to_string();
        for (at, new) in changes.iter().filter(|(at, _)| range.contains(&at.start)) {
            statement.replace_range(at.start - range.start..at.end - range.start, new);
        }
        // A statement that was only a cut is left out.
        if variable.as_deref() != Some(statement.trim_end_matches(';').trim()) {
            copy += &format!("\n{statement}");
        }
    }
    // A comment on the last line stays before the copy.
    let last = ranges.last().cloned().unwrap_or_default();
    let at = source.whole_lines(&last).map_or(last.end, |lines| lines.start + text[lines].trim_end().len());
    let after = Edit { range: at..at, text: copy }.apply(text);
    let longer = old.zip(variable.as_ref()).map_or(0, |(old, new)| new.len() - old.len());
    let made_at = at + 1 + object.creating_call.name.start - ranges[0].start + longer;
    let moved = offset.map(|by| move_object(&after, made_at, by)).transpose();
    let computed_position_line = moved.as_ref().err().and_then(|refused| refused.line);
    let after = moved.ok().flatten().map_or(after.clone(), |edit| edit.apply(&after));
    Ok(Duplicate { edit: Edit::between(text, &after), name, uncopied_lines, computed_position_line })
}

/// Bytes of the calls `.cut(…)` of a camera, with their dots. A second camera with the same cut would hide the first.
fn cut_ranges(object: &ScriptObject) -> Vec<Range<usize>> {
    let is_cut = |call: &&Call| object.text[call.name.clone()] == *"cut";
    let with_dot = |call: &Call| {
        let dot = object.text[..call.name.start].rfind('.').unwrap_or(call.name.start);
        dot..call.end
    };
    object.calls.iter().filter(is_cut).map(with_dot).collect()
}

/// The edit that moves the object created at a byte and the targets of its `.walk_to`, or else the keys of its position. Paths are relative to the
/// position and do not change.
///
/// # Errors
/// The position or a target is computed.
fn move_object(text: &str, byte: usize, by: DVec3) -> Result<Edit, EditRefused> {
    let (line, column) = Source::new(text).place_of(byte);
    let object = ScriptObject::at(text, line, column)?;
    if let Some(keys) = object.key_call(POSITION) {
        return move_position_keys(&object.text, &keys, by)
            .ok_or_else(|| object.refuse_computed_keys(POSITION, &keys));
    }
    let mut edits = vec![object.move_by(by, by)?];
    for walk in object.calls.iter().filter(|call| object.text[call.name.clone()] == *"walk_to") {
        let point = walk.inside.start..object.text.value_end(walk.inside.start, walk.inside.end);
        let old = parse_literals(&object.text, &point).filter(|old| old.len() == 3).unwrap_or_default();
        let new: Vec<f64> = old.iter().zip(by.to_array()).map(|((_, number), by)| number + by).collect();
        let computed = || EditRefused::at(object.line_of(walk.name.start), "the point is computed");
        edits.push(rewrite_literals(&object.text, &old, &new).ok_or_else(computed)?);
    }
    Ok(Edit::combine(text, edits))
}

/// The property whose keys place an object.
const POSITION: &str = "position";

/// The edit that moves all keys of a position. `None` if one is computed.
fn move_position_keys(text: &Source, call: &Call, by: DVec3) -> Option<Edit> {
    let in_list = |bytes: &Range<usize>| {
        let list = text.trimmed(bytes);
        let inside = text[list.clone()].strip_prefix('[')?.strip_suffix(']')?;
        Some(split_at_commas(text, list.start + 1, list.start + 1 + inside.len()))
    };
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for key in in_list(arguments(text, call).get(leading_argument_count(POSITION))?)? {
        let numbers = parse_literals(text, &in_list(&key)?.nth(1)?).filter(|numbers| numbers.len() == 3)?;
        new.extend(numbers.iter().zip(by.to_array()).map(|((_, number), by)| number + by));
        old.extend(numbers);
    }
    rewrite_literals(text, &old, &new)
}

/// Statements about an object: the one around the creating call and the later ones that begin with its variable, in their order. Also the lines of
/// other statements that use the object.
fn statements_about(
    source: &Source,
    call: usize,
    line: usize,
) -> Result<(Vec<Range<usize>>, Vec<usize>), EditRefused> {
    let line_of = |byte: usize| source[..byte].matches('\n').count() + 1;
    let in_block = |at: usize| source.bracket_depth_at(source.statement_start(at)) > 0;
    if in_block(call) {
        return Err(EditRefused::at(line, "it is made in a function or a block; duplicate it there"));
    }
    let own = source.statement_start(call)..source.statement_end(call);
    let (mut ranges, mut uncopied_lines) = (vec![own.clone()], Vec::new());
    let Some(name) = source.variable_of(own.start) else { return Ok((ranges, uncopied_lines)) };
    for used in source.uses_of(name).filter(|used| *used > own.end) {
        let start = source.statement_start(used);
        let continues = source[source.next_token_start(used + name.len())..].starts_with('.');
        if start == used && continues && !in_block(used) {
            ranges.push(start..source.statement_end(used));
        } else if continues && (source.begins_statement(used) || source.variable_before(used).is_some()) {
            let why = format!(
                "this line changes {name} in a way that cannot be copied; duplicate it in the script"
            );
            return Err(EditRefused::at(line_of(used), &why));
        } else if !ranges.iter().any(|range| range.contains(&used)) {
            uncopied_lines.push(line_of(used));
        }
    }
    ranges.dedup();
    uncopied_lines.dedup();
    Ok((ranges, uncopied_lines))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::marked::marked;

    fn copied(text: &str, by: Option<DVec3>) -> Result<(String, Option<String>), String> {
        let (text, line, column) = marked(text);
        let made = duplicate_object(&text, (line, column), NamedBy::Argument, by);
        let Duplicate { edit, name, .. } = made.map_err(|refused| refused.why)?;
        let after = edit.apply(&text);
        assert_eq!(edit.inverse(&text).apply(&after), text);
        Ok((after, name))
    }

    #[test]
    fn an_object_is_copied_with_the_statements_about_it() {
        let text = "let m = load(\"m\");\nlet bob = |cast(\"bob\", m)\n    .at(1, 0, 0); // left\nlet a = 1;\nbob.play(m.clip(\"W\"))\n    .until(2.0); // walks\nsun(#{});\n";
        let plain = text.replace('|', "");
        let more = "let bob_2 = cast(\"bob 2\", m)\n    .at(2, 0, 0);\nbob_2.play(m.clip(\"W\"))\n    .until(2.0);\n";
        let wanted = plain.replace("sun(", &format!("{more}sun("));
        let (after, name) = copied(text, Some(DVec3::X)).unwrap();
        assert_eq!((after.as_str(), name.as_deref()), (wanted.as_str(), Some("bob 2")));
        // The next copy gets the next number; without an offset it stands where the object does.
        let again = wanted.replacen("cast(", "|cast(", 1);
        let (after, name) = copied(&again, None).unwrap();
        assert!(after.contains("let bob_3 = cast(\"bob 3\", m)\n    .at(1, 0, 0);"), "{after}");
        assert_eq!(name.as_deref(), Some("bob 3"));
        let (after, _) = copied("|cast(\"a\", m).play(c);", Some(DVec3::Z)).unwrap();
        assert_eq!(after, "cast(\"a\", m).play(c);\ncast(\"a 2\", m).at(0.0, 0.0, 1.0).play(c);");
        // Statements of other objects that use this one are not copied.
        let (after, _) = copied("let a = |cast(\"a\", m);\neve.face(a);\na.face(a);", None).unwrap();
        assert_eq!(
            after,
            "let a = cast(\"a\", m);\neve.face(a);\na.face(a);\nlet a_2 = cast(\"a 2\", m);\na_2.face(a_2);"
        );
    }

    #[test]
    fn uncopied_statements_are_reported_and_cuts_are_not_copied() {
        let text =
            "let a = cast(\"a\", m);\nlet c = camera(\"c\").look_at(a.joint(\"Head\"));\ndance(a, 1);\n";
        let made = duplicate_object(text, (1, 9), NamedBy::Argument, None).unwrap();
        assert_eq!(made.uncopied_lines, [2, 3]);
        assert!(made.edit.apply(text).contains("\nlet a_2 = cast(\"a 2\", m);\nlet c"), "{made:?}");
        let (after, _) =
            copied("let c = |camera(\"c\").at(0, 1, 2).cut(2.0).fov(30);\nc.cut(4.0);", None).unwrap();
        assert!(after.ends_with("let c_2 = camera(\"c 2\").at(0, 1, 2).fov(30);"), "{after}");
    }

    #[test]
    fn position_keys_of_the_copy_are_offset() {
        let text = "let a = |cast(\"a\", m).at(9, 9, 9);\na.key(\"position\", [\n    [f(5), [0, 0, 0.5]], // here\n    [2.0, [ 1.0, 0, 0 ], \"in_quad\"],\n], \"smooth\");\n";
        let (after, _) = copied(text, Some(DVec3::new(0.5, 0.0, 0.0))).unwrap();
        let plain = text.replace('|', "");
        let copy =
            plain.trim_end().replace("a = ", "a_2 = ").replace("\"a\"", "\"a 2\"").replace("\na.", "\na_2.");
        let copy = copy.replace("[0, 0, 0.5]", "[0.5, 0, 0.5]").replace("[ 1.0, 0, 0 ]", "[ 1.5, 0, 0 ]");
        assert_eq!(after, format!("{plain}{copy}\n"));
        // If one key is computed, the copy is not moved, and the line of the keys is reported.
        let text = "let a = cast(\"a\", m);\na.key(\"position\", [[0.0, x], [1.0, [1, 2, 3]]]);\n";
        let made = duplicate_object(text, (1, 9), NamedBy::Argument, Some(DVec3::X)).unwrap();
        let after = made.edit.apply(text);
        assert_eq!(made.computed_position_line, Some(4));
        assert_eq!(after.lines().nth(3), Some("a_2.key(\"position\", [[0.0, x], [1.0, [1, 2, 3]]]);"));
        let text = "let a = cast(\"a\", m).at(x, 0, 0);\n";
        assert_eq!(
            duplicate_object(text, (1, 9), NamedBy::Argument, Some(DVec3::X)).unwrap().computed_position_line,
            Some(2)
        );
        assert_eq!(
            duplicate_object(text, (1, 9), NamedBy::Argument, None).unwrap().computed_position_line,
            None
        );
    }

    #[test]
    fn walk_targets_of_the_copy_are_offset() {
        let text = "let a = |cast(\"a\", m);\na.walk_to([1.0, 0, 2], #{ from: 1.0 });\na.walk_to([ -1, 0, 0 ]); // back\n";
        let (after, _) = copied(text, Some(DVec3::X)).unwrap();
        let copy = "let a_2 = cast(\"a 2\", m).at(1.0, 0.0, 0.0);\na_2.walk_to([2.0, 0, 2], #{ from: 1.0 });\na_2.walk_to([ 0, 0, 0 ]);\n";
        assert_eq!(after, text.replace('|', "") + copy);
        // If one target is computed, the copy walks to the same targets.
        let text = "let a = cast(\"a\", m).at(0, 0, 0);\na.walk_to([1.0, 0, 2]);\na.walk_to(home);\n";
        let made = duplicate_object(text, (1, 9), NamedBy::Argument, Some(DVec3::X)).unwrap();
        assert_eq!(made.computed_position_line, Some(6));
        assert!(made.edit.apply(text).contains("a_2 = cast(\"a 2\", m).at(0, 0, 0);"), "{made:?}");
    }

    #[test]
    fn statements_that_cannot_be_copied_are_refused_with_their_line() {
        for (text, why) in [
            ("let a = |cast(\"a\", m);\nif x { a.play(c); }\n", "line 2: this line changes a "),
            ("let a = |cast(\"a\", m);\nlet w = a.play(c);\n", "line 2: this line changes a "),
            ("fn f(x) {\n    |cast(x, m);\n}\n", "line 2: it is made in a function or a block"),
            ("|cast(\"a\" + 1, m);\n", "line 1: its name, \"a\" + 1, is computed"),
        ] {
            let refused = copied(text, None).unwrap_err();
            assert!(refused.starts_with(why), "{refused}");
        }
    }

    #[test]
    fn copying_in_truncated_text_does_not_panic() {
        let text = "let ä = cast(\"ü(\") /* é */ .at([1]);\nä.play(x);\n}";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for column in 1..12 {
                    let part = &text[*from..*to];
                    let _ = duplicate_object(part, (1, column), NamedBy::Argument, Some(DVec3::X));
                }
            }
        }
    }
}
