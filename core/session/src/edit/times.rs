//! Times of cues, and of what else begins and ends.

use super::scan::{Source, find};
use super::values::{literal, set_option};
use super::{Edit, EditRefused, format_seconds};

/// The part of a cue that was dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CueTime {
    /// `.from(…)`
    Start,
    /// `.until(…)`
    End,
    /// `#{ fade: … }`
    FadeIn,
}

/// Sets a time of the cue that the call at a place makes (`play` or `then`; line and column in characters, from 1), in seconds.
///
/// # Errors
/// Why it cannot be set, for the user: the number is computed, or the call is not there.
pub fn set_time(
    text: &str,
    line: usize,
    column: usize,
    part: CueTime,
    secs: f64,
) -> Result<Edit, EditRefused> {
    let text = &Source::new(text);
    let refuse = |why: &str| Err(format!("line {line}: {why}").into());
    let Some(at) = text.byte_at(line, column) else { return refuse("the script has no such line") };
    let Some(call) = text.call_from(at) else { return refuse("there is no play or then to be changed") };
    let chain = text.chain_after(call.end);
    let (name, argument) = match part {
        CueTime::Start => ("from", find(&chain, text, "from")),
        CueTime::End => ("until", find(&chain, text, "until")),
        CueTime::FadeIn => return set_option(text, &call, line, "fade", &format_seconds(secs)),
    };
    if let Some(argument) = argument {
        return match literal(text, &argument) {
            Some((range, _)) => Ok(Edit { range, text: format_seconds(secs) }),
            None => refuse(&format!(
                "the time in .{name}({}) is computed; change it there",
                text[argument].trim()
            )),
        };
    }
    if part == CueTime::Start && text[call.name.clone()] == *"then" {
        return refuse("it begins where the clip before it ends; change that one's end");
    }
    Ok(Edit { range: call.end..call.end, text: format!(".{name}({})", format_seconds(secs)) })
}

/// Whether the call at a place is a `then` that begins where the clip before it ends.
pub fn follows(text: &str, line: usize, column: usize) -> bool {
    let text = &Source::new(text);
    let call = text.byte_at(line, column).and_then(|at| text.call_from(at));
    call.is_some_and(|call| {
        text[call.name.clone()] == *"then" && find(&text.chain_after(call.end), text, "from").is_none()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The place is where `|` stands.
    fn set(text: &str, part: CueTime, secs: f64) -> Result<String, String> {
        let at = text.find('|').unwrap();
        let before = &text[..at];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
        let text = text.replacen('|', "", 1);
        let set = set_time(&text, line, column, part, secs).map_err(|refused| refused.why);
        set.map(|edit| {
            let after = edit.apply(&text);
            // And back again.
            assert_eq!(edit.inverse(&text).apply(&after), text);
            after
        })
    }

    #[test]
    fn the_literal_is_rewritten_and_nothing_else() {
        let text = "// a walk\nada.|play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.5 ) // why\n    .until(2.0);\n";
        assert_eq!(
            set(text, CueTime::Start, 0.75).unwrap(),
            "// a walk\nada.play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.75 ) // why\n    .until(2.0);\n"
        );
        assert!(set(text, CueTime::End, 3.0).unwrap().ends_with(".until(3.0);\n"));
    }

    #[test]
    fn what_is_not_said_is_added_behind_the_call() {
        assert_eq!(set("a|.play(c);", CueTime::Start, 1.5).unwrap(), "a.play(c).from(1.5);");
        assert_eq!(
            set("a.|play(c).on(\"x\");", CueTime::End, 2.0).unwrap(),
            "a.play(c).until(2.0).on(\"x\");"
        );
        assert_eq!(set("a.|play(c);", CueTime::FadeIn, 0.25).unwrap(), "a.play(c, #{ fade: 0.25 });");
        let text = "a.|play(c, #{ speed: 1.2 });";
        assert_eq!(set(text, CueTime::FadeIn, 0.25).unwrap(), "a.play(c, #{ speed: 1.2, fade: 0.25 });");
        assert_eq!(set("a.|play(c, #{});", CueTime::FadeIn, 0.5).unwrap(), "a.play(c, #{ fade: 0.5 });");
    }

    #[test]
    fn each_cue_of_a_chain_is_its_own() {
        let text = "a.play(c).until(2.0)\n  .|then(d, #{ trim: [1.0, 2.0], fade: 0.4, speed: f(1) }).until(4.0).then(e).until(5.0);";
        assert!(set(text, CueTime::End, 4.5).unwrap().contains(".until(2.0)\n"));
        assert!(set(text, CueTime::End, 4.5).unwrap().contains("}).until(4.5).then(e).until(5.0)"));
        assert!(set(text, CueTime::FadeIn, 0.6).unwrap().contains("[1.0, 2.0], fade: 0.6, speed: f(1) }"));
        let why = set(text, CueTime::Start, 1.0).unwrap_err();
        assert_eq!(why, "line 2: it begins where the clip before it ends; change that one's end");
    }

    #[test]
    fn what_is_computed_is_refused_with_its_line() {
        let why = set("let x = 1;\na.|play(c).from(x + 1.0);", CueTime::Start, 2.0).unwrap_err();
        assert_eq!(why, "line 2: the time in .from(x + 1.0) is computed; change it there");
        assert!(set("a.|play(c).from(f(12));", CueTime::Start, 2.0).unwrap_err().contains("f(12)"));
        assert!(
            set("a.|play(c, #{ fade: fast });", CueTime::FadeIn, 2.0).unwrap_err().contains("fade: fast")
        );
        assert!(set("a.|play(c, options);", CueTime::FadeIn, 2.0).unwrap_err().contains("computed"));
        assert!(set("|let x = 1;", CueTime::Start, 2.0).unwrap_err().contains("no play"));
        assert!(set_time("a", 9, 1, CueTime::Start, 1.0).is_err());
    }

    #[test]
    fn a_change_finds_its_line_again() {
        let then = "let a = 1;\na.play(c).from(0.5);\n";
        let edit = set_time(then, 2, 3, CueTime::Start, 0.75).unwrap();
        let after = edit.apply(then);
        let back = edit.inverse(then);
        // The editor has saved something else above it.
        let now = after.replace("let a = 1;", "let a = 1;\nlet b = 2;");
        let carried = back.carried_over(&after, &now).unwrap();
        assert_eq!(carried.apply(&now), "let a = 1;\nlet b = 2;\na.play(c).from(0.5);\n");
        assert_eq!(back.carried_over(&after, "something else"), None);
        assert_eq!(back.carried_over(&after, &format!("{after}{after}")), None, "there are two of it");
    }

    #[test]
    fn no_text_makes_it_panic() {
        let text = "a.play(\"ü(\", #{ x: `}` }).from(1.0) /* /* */ é */ .until('\\'');";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for part in [CueTime::Start, CueTime::End, CueTime::FadeIn] {
                    let _ = set_time(&text[*from..*to], 1, 1, part, 1.0);
                }
            }
        }
    }
}
