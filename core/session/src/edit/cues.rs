//! Whole cues: their times are changed together, or they are deleted.

use super::indenting::indented;
use super::scan::{Call, Source};
use super::times::{CueTime, EditTime, TimeLiteral, set_time, stated_time};
use super::{Edit, EditRefused};
use std::ops::Range;

/// A change of one time of a cue; line and column of its `play` or `then` as for [`set_time`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CueChange {
    pub line: usize,
    pub column: usize,
    pub part: CueTime,
    pub time: EditTime,
}

/// Sets several times of cues in one edit, all or none.
///
/// # Errors
/// The errors are those of [`set_time`] for any of the changes.
pub fn set_times(text: &str, changes: &[CueChange]) -> Result<Edit, EditRefused> {
    let mut changes = changes.to_vec();
    // Edits go from the end of the text to its start, so that none moves a call that is still to be edited.
    changes.sort_by_key(|change| std::cmp::Reverse((change.line, change.column)));
    let mut after = text.to_string();
    for CueChange { line, column, part, time } in changes {
        after = set_time(&after, line, column, part, time)?.apply(&after);
    }
    Ok(Edit::between(text, &after))
}

/// Whether the cue whose `play` or `then` is at this position states its end, `.until(…)` or `until: …`.
pub fn has_end(text: &str, line: usize, column: usize) -> bool {
    let text = &Source::new(text);
    let call = text.byte_at(line, column).and_then(|at| text.call_from(at));
    call.is_some_and(|call| stated_time(text, &call, "until").is_some())
}

/// Deletes the cue whose `play` or `then` is at this position, with its times and options. `next`: start of the following clip, which is written if
/// the deleted cue was the first of its chain.
///
/// # Errors
/// The call is not there, or the script uses its value.
pub fn delete_cue(
    text: &str,
    line: usize,
    column: usize,
    next: Option<EditTime>,
) -> Result<Edit, EditRefused> {
    let source = &Source::new(text);
    let refuse = |why: &str| Err(EditRefused::at(line, why));
    let Some(call) = source.byte_at(line, column).and_then(|at| source.call_from(at)) else {
        return refuse("this line has no .play(…) or .then(…) to delete");
    };
    if let Some(name) = statement_start(source, &call).and_then(|start| source.variable_before(start)) {
        return refuse(&format!("the script uses this clip as variable \"{name}\"; delete it there"));
    }
    let end = source.chain_after(call.end).last().map_or(call.end, |last| last.end);
    let follower = source.call_from(end).filter(|next| source[next.name.clone()] == *"then");
    if let (true, Some(follower)) = (source[call.name.clone()] == *"play", follower) {
        let next = next.filter(|_| stated_time(source, &follower, "from").is_none());
        // The following clip keeps its start, written like the deleted end: in seconds or in frames.
        let end = stated_time(source, &call, "until").and_then(|end| TimeLiteral::of(source, &end));
        let in_frames = end.map(|end| end.in_frames);
        let from = next.map(|next| format!(".from({})", next.text_in_style(in_frames, source)));
        let kept = &text[follower.name.end..follower.end];
        let range = call.name.start..follower.end;
        let edit = Edit { range, text: format!("play{kept}{}", from.unwrap_or_default()) };
        return Ok(indented(text, edit));
    }
    match whole_statement(source, &call, end) {
        Some(range) => Ok(Edit { range, text: String::new() }),
        None => Ok(Edit::between(text, &without_call(source, &call, end))),
    }
}

/// The text without one call of a chain (its bytes up to `end`) and without the comment of that line. A comment between the call and the code
/// before it stays, after the code of both lines.
fn without_call(source: &Source, call: &Call, end: usize) -> String {
    let text = source.whole();
    let dot = text[..call.name.start].rfind('.').unwrap_or(call.name.start);
    let before = source.code_end(dot);
    let gap = text[before..dot].trim_end();
    let line_end = text[end..].find('\n').map_or(text.len(), |at| end + at);
    let own = comment_behind(source, call, end);
    let (closing, rest) = own.map_or((end..line_end, line_end), |own| (end..own.start, own.end));
    format!("{}{}{gap}{}", &text[..before], &text[closing], &text[rest..])
}

/// The comment at the end of a cue's last line, with the whitespace before it. `None` if another call stands on that line, since the comment is
/// then about both.
pub(super) fn comment_behind(text: &Source, call: &Call, end: usize) -> Option<Range<usize>> {
    let line_end = text[end..].find('\n').map_or(text.len(), |at| end + at);
    let semicolon = text[end..line_end].len() - text[end..line_end].trim_start().len() + end;
    let code = if text[semicolon..line_end].starts_with(';') { semicolon + 1 } else { end };
    let behind = text[code..line_end].trim();
    let is_block = behind.starts_with("/*") && behind.find("*/").is_some_and(|at| at + 2 == behind.len());
    let line = text[..end].rfind('\n').map_or(0, |at| at + 1);
    let before = text.get(line..call.name.start).unwrap_or_default().trim();
    let is_alone = before.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '.');
    (is_alone && (behind.starts_with("//") || is_block))
        .then(|| code..code + text[code..line_end].trim_end().len())
}

/// First byte of the expression before a method call, `actor` in `actor.play(…)`. `None` if that expression does not end with a name.
pub(super) fn statement_start(text: &Source, call: &Call) -> Option<usize> {
    let before = text[..call.name.start].trim_end().strip_suffix('.')?.trim_end();
    let name = before.rfind(|c: char| !c.is_alphanumeric() && c != '_').map_or(0, |at| at + 1);
    (name < before.len()).then_some(name)
}

/// Lines of a statement that consists of this call only, `actor.play(…);`, with the comment after it.
pub(super) fn whole_statement(text: &Source, call: &Call, end: usize) -> Option<Range<usize>> {
    let start = statement_start(text, call)?;
    let semicolon = text.next_token_start(end);
    if !text[semicolon..].starts_with(';') {
        return None;
    }
    text.whole_lines(&(start..semicolon + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text without the marks `|`, and line and column of each mark.
    fn marked(text: &str) -> (String, Vec<(usize, usize)>) {
        let (mut plain, mut places) = (String::new(), Vec::new());
        for part in text.split('|') {
            plain += part;
            let column = plain.rsplit('\n').next().unwrap().chars().count() + 1;
            places.push((plain.matches('\n').count() + 1, column));
        }
        places.pop();
        (plain, places)
    }

    fn at(secs: f64) -> EditTime {
        EditTime { secs, fps: 25.0 }
    }

    fn deleted(text: &str, next: Option<EditTime>) -> Result<String, String> {
        let (text, places) = marked(text);
        let edit = delete_cue(&text, places[0].0, places[0].1, next).map_err(|refused| refused.why)?;
        let after = edit.apply(&text);
        assert_eq!(edit.inverse(&text).apply(&after), text);
        Ok(after)
    }

    #[test]
    fn several_times_are_set_in_one_edit() {
        let (text, places) = marked("a.|play(c).from(0.5).until(2.0).|then(d, #{ fade: 0.4 }).until(4.0);");
        let change = |place: usize, part, secs| CueChange {
            line: places[place].0,
            column: places[place].1,
            part,
            time: at(secs),
        };
        let moved =
            set_times(&text, &[change(0, CueTime::End, 12.0), change(1, CueTime::End, 14.0)]).unwrap();
        assert_eq!(
            moved.apply(&text),
            "a.play(c).from(0.5).until(12.0).then(d, #{ fade: 0.4 }).until(14.0);"
        );
        assert_eq!(moved.inverse(&text).apply(&moved.apply(&text)), text);
        let first = [change(0, CueTime::Start, 1.0), change(0, CueTime::End, 2.5)];
        assert!(set_times(&text, &first).unwrap().apply(&text).starts_with("a.play(c).from(1.0).until(2.5)"));
        // If one change is refused, none is made.
        let refused = set_times(&text, &[change(0, CueTime::End, 3.0), change(1, CueTime::Start, 3.0)]);
        assert!(refused.unwrap_err().why.contains("begins where the clip before it ends"));
        assert!(has_end(&text, places[1].0, places[1].1) && !has_end("a.play(c);", 1, 3));
    }

    #[test]
    fn deleting_a_cue_keeps_its_neighbors() {
        let text = "a.play(c).until(2.0) // in\n    .|then(d, #{ fade: 0.4 }).until(4.0)\n    .then(e);";
        assert_eq!(deleted(text, None).unwrap(), "a.play(c).until(2.0) // in\n    .then(e);");
        let text = "a.|play(c).from(1.0).until(2.0)\n    .then(d, #{ fade: 0.4 }).on(\"x\");";
        assert_eq!(deleted(text, Some(at(2.0))).unwrap(), "a.play(d, #{ fade: 0.4 }).from(2.0).on(\"x\");");
        // The next cue begins where the deleted one ended, in the style of its time. Comments are deleted with their lines.
        let text = "a.|play(c).until(f(50)) // in\n    .then(d); // out";
        assert_eq!(deleted(text, Some(at(2.0))).unwrap(), "a.play(d).from(f(50)); // out");
        let text = "a.play(c).until(2.0) // in\n    .|then(d).until(4.0) // waves\n    .then(e);";
        assert_eq!(deleted(text, None).unwrap(), "a.play(c).until(2.0) // in\n    .then(e);");
        let text = "a.play(c).until(2.0) // in\n    .|then(d).until(4.0); // waves\nb.play(c);";
        assert_eq!(deleted(text, None).unwrap(), "a.play(c).until(2.0); // in\nb.play(c);");
        let text = "a.play(c).until(2.0) // in\n    .|then(d).then(e); // both";
        assert_eq!(deleted(text, None).unwrap(), "a.play(c).until(2.0).then(e); // both // in");
        let text = "a.|play(c).then(d).from(3.0);";
        assert_eq!(deleted(text, Some(at(3.0))).unwrap(), "a.play(d).from(3.0);");
    }

    #[test]
    fn deleting_a_whole_statement_deletes_its_line() {
        let text = "let x = 1;\n  a.|play(c)\n    .from(1.0); // waves\nb.play(d);\n";
        assert_eq!(deleted(text, None).unwrap(), "let x = 1;\nb.play(d);\n");
        assert_eq!(
            deleted("let a = cast(\"a\", m).at(1, 0, 0).|play(c).from(1.0);", None).unwrap(),
            "let a = cast(\"a\", m).at(1, 0, 0);"
        );
        assert_eq!(deleted("if x { a.|play(c); }", None).unwrap(), "if x { a; }");
        let why = deleted("let wave = a.|play(c);", None).unwrap_err();
        assert_eq!(why, "line 1: the script uses this clip as variable \"wave\"; delete it there");
        assert!(deleted("|let x = 1;", None).is_err());
    }

    #[test]
    fn deleting_in_truncated_text_does_not_panic() {
        let text = "ä.play(\"ü(\").from(1.0) /* é */ .then(x).until('\\'');";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for column in 1..12 {
                    let _ = delete_cue(&text[*from..*to], 1, column, Some(at(1.0)));
                }
            }
        }
    }
}
