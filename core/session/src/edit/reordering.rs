//! Order of rows: the first statement of the script has the top row, and later layers of an actor override earlier ones.

use super::scan::Source;
use super::{Edit, EditRefused};
use std::ops::Range;

/// The side of another row that a row is moved to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowSide {
    Above,
    Below,
}

/// Moves the statement around the call at `moved` before or after the statement around the call at `target`. The statements about the new object
/// that directly follow it are moved, too, and so is its comment if both form a paragraph of their own. Positions are line and column, from 1.
///
/// # Errors
/// The statement stands in a block, or a statement in between decides what the moved one does. The text is for the user.
pub fn reorder(
    text: &str,
    moved: (usize, usize),
    target: (usize, usize),
    side: RowSide,
) -> Result<Edit, EditRefused> {
    let source = &Source::new(text);
    let line_of = |byte: usize| source.place_of(byte).0;
    let byte = |(line, column): (usize, usize)| {
        let call = source.byte_at(line, column).filter(|at| source.call_from(*at).is_some());
        call.ok_or_else(|| EditRefused::at(line, "there is no call whose statement could be moved"))
    };
    let (from, to) = (byte(moved)?, byte(target)?);
    if source.bracket_depth_at(source.statement_start(from)) > 0 {
        return Err(EditRefused::at(moved.0, "it is made in a function or a block; move it there"));
    }
    let other = source.statement_around(to, 0);
    if source.is_in_function(to) {
        let why = "a function makes it; change the order of the function's calls instead";
        return Err(EditRefused::at(target.0, why));
    }
    let whole = |range: &Range<usize>| {
        let why = "it shares its line with another statement; put it on a line of its own first";
        source.whole_lines(range).ok_or_else(|| EditRefused::at(line_of(range.start), why))
    };
    let lines = whole(&(source.statement_start(from)..source.statement_end(from)))?;
    let target_lines = whole(&other)?;
    if lines.contains(&target_lines.start) {
        return Err(EditRefused::at(moved.0, "this statement makes both objects; their order is fixed"));
    }
    let with_more = lines.start..end_of_statements_about(source, &lines);
    let with_more = if with_more.contains(&target_lines.start) { lines.clone() } else { with_more };
    let target_lines = target_lines.start..end_of_statements_about(source, &target_lines);
    let mut refused = None;
    for lines in [with_more, lines] {
        match check_order(source, &lines, &target_lines, side) {
            Ok(()) => return Ok(Edit::between(text, &with_lines_moved(text, lines, target_lines, side))),
            Err(why) => drop(refused.get_or_insert(why)),
        }
    }
    Err(refused.unwrap_or_else(|| EditRefused::at(moved.0, "it cannot be moved")))
}

/// End of the statements that directly follow these lines and begin with the variable that the lines declare.
fn end_of_statements_about(source: &Source, lines: &Range<usize>) -> usize {
    let mut end = lines.end;
    let Some(name) = source.variable_of(source.next_token_start(lines.start)) else { return end };
    loop {
        let next = source.next_token_start(end);
        let gap = &source[end..next];
        let is_apart = gap[..gap.rfind('\n').map_or(0, |n| n + 1)].lines().any(|line| line.trim().is_empty());
        let is_about = next < source.len()
            && source.word_at(next) == name
            && source[source.next_token_start(next + name.len())..].starts_with('.');
        let statement = next..source.statement_end(next);
        match source.whole_lines(&statement).filter(|_| is_about && !is_apart) {
            Some(own) => end = own.end,
            None => return end,
        }
    }
}

/// Fails if statements would behave differently after they pass the ones before or after them, because either set a variable that the other uses.
fn check_order(
    source: &Source,
    lines: &Range<usize>,
    target: &Range<usize>,
    side: RowSide,
) -> Result<(), EditRefused> {
    let at = if side == RowSide::Above { target.start } else { target.end };
    let (between, upwards) = if at < lines.end { (at..lines.start, true) } else { (lines.end..at, false) };
    let line_of = |byte: usize| source.place_of(byte).0;
    let refuse = |byte: usize, why: String| Err(EditRefused::at(line_of(byte), &why));
    let inside = |range: &Range<usize>, name: &str| source.uses_of(name).find(|at| range.contains(at));
    for set in source.assigned_names_in(lines) {
        let name = &source[set];
        if let Some(used) = inside(&between, name) {
            return refuse(used, format!("this line uses {name}, which the moved line sets"));
        }
    }
    for set in source.assigned_names_in(&between) {
        let name = &source[set.clone()];
        if inside(lines, name).is_some() {
            let way = if upwards { "before" } else { "after" };
            return refuse(
                set.start,
                format!("this line sets {name}, and the moved line, which would come {way} it, uses {name}"),
            );
        }
    }
    Ok(())
}

/// The text with whole lines moved before or after other lines.
fn with_lines_moved(text: &str, lines: Range<usize>, target: Range<usize>, side: RowSide) -> String {
    let (own, own_apart) = paragraph(text, lines);
    let (other, other_apart) = paragraph(text, target);
    let mut moved = text[own.clone()].to_string();
    if !moved.ends_with('\n') {
        moved.push('\n');
    }
    let (blank, mut gone) = (own_apart && other_apart, own);
    if own_apart {
        // One of the two blank lines around the paragraph is removed with it.
        let behind = text[gone.end..].split_inclusive('\n').next().filter(|line| line.trim().is_empty());
        let before =
            text[..gone.start].split_inclusive('\n').next_back().filter(|line| line.trim().is_empty());
        match (behind, before) {
            (Some(line), _) => gone.end += line.len(),
            (None, Some(line)) => gone.start -= line.len(),
            (None, None) => {}
        }
    }
    let at = if side == RowSide::Above { other.start } else { other.end };
    if (gone.start..=gone.end).contains(&at) {
        return text.to_string();
    }
    let mut put = match (side, blank) {
        (RowSide::Above, true) => format!("{moved}\n"),
        (RowSide::Below, true) => format!("\n{moved}"),
        (_, false) => moved,
    };
    if !text[..at].is_empty() && !text[..at].ends_with('\n') {
        put.insert(0, '\n');
    }
    let (mut after, ends) = (text.to_string(), text.ends_with('\n'));
    match at <= gone.start {
        true => {
            after.replace_range(gone, "");
            after.insert_str(at, &put);
        }
        false => {
            after.insert_str(at, &put);
            after.replace_range(gone, "");
        }
    }
    if !ends {
        after.truncate(after.trim_end_matches('\n').len());
    }
    after
}

/// Lines with the comments directly before them, and `true` if they form a paragraph between blank lines or the ends of the text; else the lines
/// alone, and `false`.
fn paragraph(text: &str, lines: Range<usize>) -> (Range<usize>, bool) {
    let mut start = lines.start;
    let mut is_apart = text[lines.end..].lines().next().is_none_or(|line| line.trim().is_empty());
    for line in text[..lines.start].split_inclusive('\n').rev() {
        match line.trim() {
            "" => break,
            comment if comment.starts_with("//") => start -= line.len(),
            _ => is_apart = false,
        }
        if !is_apart {
            break;
        }
    }
    if is_apart { (start..lines.end, true) } else { (lines, false) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves the call after `|` above or below the call after `^`.
    fn moved(text: &str, side: RowSide) -> Result<String, String> {
        let place = |mark: char| {
            let before: String =
                text.split(mark).next().unwrap().chars().filter(|c| !"|^".contains(*c)).collect();
            (before.matches('\n').count() + 1, before.rsplit('\n').next().unwrap().chars().count() + 1)
        };
        let plain = text.replace(['|', '^'], "");
        let edit = reorder(&plain, place('|'), place('^'), side).map_err(|refused| refused.why)?;
        let after = edit.apply(&plain);
        assert_eq!(edit.inverse(&plain).apply(&after), plain);
        Ok(after)
    }

    #[test]
    fn statements_are_moved_with_the_statements_about_their_object() {
        let text = "// All.\nlet a = ^cast(\"a\", m);\na.play(x);\nlet b = |cast(\"b\", m); // right\n// It bows.\nb.play(y);\nsun();\n";
        let wanted = "// All.\nlet b = cast(\"b\", m); // right\n// It bows.\nb.play(y);\nlet a = cast(\"a\", m);\na.play(x);\nsun();\n";
        assert_eq!(moved(text, RowSide::Above).unwrap(), wanted);
        let down = "let a = |cast(\"a\", m);\na.play(x);\nlet b = ^cast(\"b\", m);\nb.play(y);";
        let wanted = "let b = cast(\"b\", m);\nb.play(y);\nlet a = cast(\"a\", m);\na.play(x);";
        assert_eq!(moved(down, RowSide::Below).unwrap(), wanted);
        // A statement that is already on that side of its neighbor does not move.
        let plain = down.replace(['|', '^'], "");
        assert_eq!(moved(down, RowSide::Above).unwrap(), plain);
        // Statements may have no variable, and a loop may make the target.
        let text = "for i in 0..3 {\n    ^cast(\"p\" + i, m);\n}\n|spot(#{});\n";
        assert_eq!(
            moved(text, RowSide::Above).unwrap(),
            "spot(#{});\nfor i in 0..3 {\n    cast(\"p\" + i, m);\n}\n"
        );
        let text = "|spot(#{});\nfor i in 0..3 {\n    ^cast(\"p\" + i, m);\n}\nsun();\n";
        assert_eq!(
            moved(text, RowSide::Below).unwrap(),
            "for i in 0..3 {\n    cast(\"p\" + i, m);\n}\nspot(#{});\nsun();\n"
        );
    }

    #[test]
    fn paragraphs_are_moved_with_their_comments() {
        let text = "let m = 1;\n\n// Ada.\nlet a = ^cast(\"a\", m);\n\n// Bob\n// bows.\nlet b = |cast(\"b\", m);\nb.play(y);\n\nsun();\n";
        let wanted = "let m = 1;\n\n// Bob\n// bows.\nlet b = cast(\"b\", m);\nb.play(y);\n\n// Ada.\nlet a = cast(\"a\", m);\n\nsun();\n";
        assert_eq!(moved(text, RowSide::Above).unwrap(), wanted);
        // A comment about several statements stays, and statements apart from the moved one are not moved.
        let text = "// Both.\nlet a = ^cast(\"a\", m);\nlet b = |cast(\"b\", m);\n\n// Clips.\nb.play(y);\n";
        let wanted = "// Both.\nlet b = cast(\"b\", m);\nlet a = cast(\"a\", m);\n\n// Clips.\nb.play(y);\n";
        assert_eq!(moved(text, RowSide::Above).unwrap(), wanted);
    }

    #[test]
    fn moves_past_a_variable_in_use_are_refused() {
        for (text, side, why) in [
            (
                "let a = ^cast(\"a\", m);\nlet x = 2.0;\nlet b = |cast(\"b\", m).at(x, 0, 0);\n",
                RowSide::Above,
                "line 2: this line sets x, and the moved line, which would come before it, uses x",
            ),
            (
                "let a = |cast(\"a\", m);\na.play(x);\nlet b = ^cast(\"b\", m).face(a);\n",
                RowSide::Below,
                "line 3: this line uses a, which the moved line sets",
            ),
            (
                "let a = ^cast(\"a\", m);\nx += 2.0;\nlet b = |cast(\"b\", m).at(x, 0, 0);\n",
                RowSide::Above,
                "line 2: this line sets x, and the moved line, which would come before it, uses x",
            ),
            (
                "if x {\n    |cast(\"a\", m);\n}\n^sun();\n",
                RowSide::Below,
                "line 2: it is made in a function or a block",
            ),
            ("fn f() {\n    ^cast(\"a\", m);\n}\n|sun();\n", RowSide::Above, "line 2: a function makes it"),
            ("^sun(); |spot(#{});\n", RowSide::Above, "line 1: it shares its line with another statement"),
        ] {
            let refused = moved(text, side).unwrap_err();
            assert!(refused.starts_with(why), "{refused}");
        }
        // The following statements about the object stay if they cannot pass, and the declarations that they use stay before them.
        let text = "let a = ^cast(\"a\", m);\nlet x = 2.0;\nlet b = |cast(\"b\", m);\nb.at(x, 0, 0);\n";
        let wanted = "let b = cast(\"b\", m);\nlet a = cast(\"a\", m);\nlet x = 2.0;\nb.at(x, 0, 0);\n";
        assert_eq!(moved(text, RowSide::Above).unwrap(), wanted);
    }

    #[test]
    fn reordering_truncated_text_does_not_panic() {
        let text =
            "// ü\nlet ä = cast(\"ü(\") /* é */ .at([1]);\nä.play(x);\n\nfor i in 0..2 { f(i) } else {\n}";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                let part = &text[*from..*to];
                for place in [(1, 9), (2, 9), (3, 3), (5, 19)] {
                    for target in [(1, 9), (2, 9), (3, 3), (5, 19)] {
                        let _ = reorder(part, place, target, RowSide::Above);
                        let _ = reorder(part, place, target, RowSide::Below);
                    }
                }
            }
        }
    }
}
