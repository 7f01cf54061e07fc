//! Times of cues, markers, cuts and other script calls, written in the style of the script.

use super::key_list::{arguments, keys_in};
use super::scan::{Call, Source, last_arguments_of};
use super::values::{
    USUAL_DIGITS, becomes_method, format_as_meant, is_calculation, option_value, parse_literal, set_option,
    trimmed,
};
use super::{Edit, EditRefused, chain};
use std::ops::Range;

/// Two times within this many seconds are the same tick.
const TICK_TOLERANCE: f64 = 0.5 / choreo_motion::Time::TICKS_PER_SECOND as f64;

/// A time to be written into a script.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EditTime {
    pub secs: f64,
    /// Frames a second of the stage.
    pub fps: f64,
}

impl EditTime {
    /// The time as a person would write it into this script, if it has no such time yet.
    pub fn written(self, script: &str) -> String {
        self.new_text(&Source::new(script))
    }

    /// Text of a time that the script does not state yet: seconds. Frames, `f(12)`, if seconds would need more digits than a person writes and most
    /// times of the script count frames.
    pub(super) fn new_text(self, script: &Source) -> String {
        self.short_text(|| counts_frames(script, self.fps))
    }

    /// Like [`EditTime::new_text`], but in the style of the times with these names that the call states, if there are any.
    fn text_like_times_of(self, text: &Source, call: &Call, names: &[&str]) -> String {
        let stated = names.iter().filter_map(|name| TimeLiteral::of(text, &stated_time(text, call, name)?));
        let styles: Vec<bool> = stated.map(|time| time.in_frames).collect();
        let frames = styles.iter().filter(|in_frames| **in_frames).count();
        self.short_text(|| {
            if styles.is_empty() { counts_frames(text, self.fps) } else { 2 * frames > styles.len() }
        })
    }

    /// Text of the time in seconds. In frames if seconds need more digits than a person writes and `counts_frames` is true.
    fn short_text(self, counts_frames: impl FnOnce() -> bool) -> String {
        let text = self.text(false);
        let is_long = text.split('.').nth(1).is_some_and(|digits| digits.len() > USUAL_DIGITS);
        if is_long && counts_frames() { self.text(true) } else { text }
    }

    /// The time in a given style: in frames or in seconds, or like [`EditTime::new_text`] for `None`.
    pub(super) fn text_in_style(self, in_frames: Option<bool>, script: &Source) -> String {
        in_frames.map_or_else(|| self.new_text(script), |in_frames| self.text(in_frames))
    }

    /// Text of the time: `f(31)` if `in_frames` and it falls on a frame, else seconds with a decimal point. Seconds are rounded to the millisecond;
    /// the time of a frame gets enough digits to be read back as the same frame.
    pub(super) fn text(self, in_frames: bool) -> String {
        let secs = self.secs.max(0.0);
        let frame = libm::round(secs * self.fps);
        let is_frame = libm::fabs(secs * self.fps - frame) < 1e-4;
        if is_frame && in_frames {
            return format!("f({frame})");
        }
        let time = frame / self.fps;
        match is_frame {
            true => format_as_meant(time, |read| libm::fabs(read - time) < TICK_TOLERANCE),
            false => trimmed(&format!("{secs:.USUAL_DIGITS$}")),
        }
    }
}

/// Whether most times of a script (starts, ends, cuts and keys) count frames, `f(12)`, and not seconds. `fps`: frame rate of the stage.
fn counts_frames(text: &Source, fps: f64) -> bool {
    let tokens: Vec<&str> = text.tokens_within(&(0..text.len())).collect();
    let is_in_seconds = |tokens: &&[&str]| {
        matches!(tokens[0], "from" | "until" | "cut")
            && matches!(tokens[1], "(" | ":")
            && tokens[2].starts_with(|c: char| c.is_ascii_digit())
    };
    let times = tokens.windows(3).filter(is_in_seconds).count();
    let calls = text.calls_within(&(0..text.len()));
    let calls = calls.iter().filter(|call| text[call.name.clone()] == *"key");
    let keys = calls.flat_map(|call| arguments(text, call)).filter_map(|bytes| keys_in(text, bytes, fps));
    let keys = keys.flatten().filter(|key| !key.in_frames).count();
    tokens.windows(2).filter(|tokens| matches!(tokens, ["f", "("])).count() > times + keys
}

/// A time that the script states as a number of seconds, or as `f(12)`.
pub(super) struct TimeLiteral {
    /// Bytes of the literal without whitespace around it.
    pub range: Range<usize>,
    /// Seconds, or a frame number.
    pub number: f64,
    pub in_frames: bool,
}

impl TimeLiteral {
    /// Parses a time. `None` if it is computed.
    pub(super) fn of(text: &Source, bytes: &Range<usize>) -> Option<TimeLiteral> {
        if let Some((range, number)) = parse_literal(text, bytes) {
            return Some(TimeLiteral { range, number, in_frames: false });
        }
        let range = text.trimmed(bytes);
        let is_frame = |call: &Call| call.end == range.end && text[call.name.clone()] == *"f";
        let call = text.call_from(range.start).filter(is_frame)?;
        let (_, number) = parse_literal(text, &call.inside)?;
        Some(TimeLiteral { range, number, in_frames: true })
    }

    /// The time in seconds; `fps`: frames a second of the stage.
    pub(super) fn secs(&self, fps: f64) -> f64 {
        if self.in_frames { self.number / fps } else { self.number }
    }

    /// The edit that replaces the time, in the same style.
    pub(super) fn set(self, text: &str, time: EditTime) -> Edit {
        Edit::in_old_style(text, self.range, &time.text(self.in_frames))
    }
}

/// The edit that replaces a literal time or a calculation with literals alone, `1.0 / 3.0` or `f(3 * 8)`. Frames stay frames. `None` if the script
/// computes the time.
pub(super) fn restated(text: &Source, bytes: &Range<usize>, time: EditTime) -> Option<Edit> {
    let range = text.trimmed(bytes);
    let is_frame = |call: &Call| call.end == range.end && text[call.name.clone()] == *"f";
    let frames = text.call_from(range.start).filter(is_frame);
    let number = frames.as_ref().map_or(&range, |call| &call.inside);
    let in_frames = frames.is_some();
    is_calculation(text, number).then(|| Edit::in_old_style(text, range.clone(), &time.text(in_frames)))
}

/// The part of a cue to be changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CueTime {
    /// `.from(…)`
    Start,
    /// `.until(…)`
    End,
    /// `#{ fade: … }`
    FadeIn,
    /// `#{ fade_out: … }`
    FadeOut,
}

/// Sets a time of the cue whose `play` or `then` is at this position (line and column in characters, from 1).
///
/// # Errors
/// The time is computed, or the call is not there. The text is for the user.
pub fn set_time(
    text: &str,
    line: usize,
    column: usize,
    part: CueTime,
    time: EditTime,
) -> Result<Edit, EditRefused> {
    let text = &Source::new(text);
    let refuse = |why: &str| Err(EditRefused::at(line, why));
    let Some(at) = text.byte_at(line, column) else { return refuse("the script has no such line") };
    let Some(call) = text.call_from(at) else {
        return refuse("this line has no .play(…) or .then(…) to change");
    };
    let chain = text.chain_after(call.end);
    let name = match part {
        CueTime::Start => "from",
        CueTime::End => "until",
        CueTime::FadeIn => return set_fade(text, (&call, &chain), line, (&["fade", "inertial"], time)),
        CueTime::FadeOut => return set_fade(text, (&call, &chain), line, (&["fade_out"], time)),
    };
    if let Some(argument) = last_arguments_of(&chain, text, name) {
        return match restated(text, &argument, time) {
            Some(edit) => Ok(edit),
            None => refuse(&format!(
                "the time in .{name}({}) is computed; change it there",
                text[argument].trim()
            )),
        };
    }
    if let Some(value) = option_value(text, &call, name) {
        return match restated(text, &value, time) {
            Some(edit) => Ok(edit),
            None => refuse(&format!("{name}: {} is computed; change it there", text[value].trim())),
        };
    }
    if part == CueTime::Start && text[call.name.clone()] == *"then" {
        return refuse("it begins where the clip before it ends; change the end of that clip");
    }
    let written = time.text_like_times_of(text, &call, &["from", "until"]);
    Ok(chain::add_method(text, &call, &format!("{name}({written})")))
}

/// Sets the duration of the transition into or out of a cue: in place of the stated value with one of these names, else as a new value with the
/// first name.
fn set_fade(
    text: &Source,
    (call, chain): (&Call, &[Call]),
    line: usize,
    (names, time): (&[&str], EditTime),
) -> Result<Edit, EditRefused> {
    let name = names[0];
    if let Some(argument) = last_arguments_of(chain, text, name) {
        let shown = text[argument.clone()].trim();
        let why = format!("the time in .{name}({shown}) is computed; change it there");
        return restated(text, &argument, time).ok_or_else(|| EditRefused::at(line, &why));
    }
    let stated = |name: &&&str| option_value(text, call, name).is_some();
    let name = names.iter().find(stated).unwrap_or(&name);
    let old = option_value(text, call, name).and_then(|bytes| restated(text, &bytes, time));
    let written = time.text_like_times_of(text, call, &["fade", "fade_out"]);
    match (old, becomes_method(text, call, chain, name)) {
        (Some(edit), _) => Ok(edit),
        (None, false) => set_option(text, call, line, name, &written),
        (None, true) => Ok(chain::add_method(text, call, &format!("{name}({written})"))),
    }
}

/// Bytes of a time that a cue states, as a method or as an option.
pub(super) fn stated_time(text: &Source, call: &Call, name: &str) -> Option<Range<usize>> {
    last_arguments_of(&text.chain_after(call.end), text, name).or_else(|| option_value(text, call, name))
}

/// Whether the call at a position is a `then` without `from`, which begins where the previous clip ends.
pub fn follows_previous_cue(text: &str, line: usize, column: usize) -> bool {
    let text = &Source::new(text);
    let call = text.byte_at(line, column).and_then(|at| text.call_from(at));
    call.is_some_and(|call| text[call.name.clone()] == *"then" && stated_time(text, &call, "from").is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::marked::marked;

    /// Sets a time of the cue whose call `|` marks.
    fn set(text: &str, part: CueTime, secs: f64) -> Result<String, String> {
        let (text, line, column) = marked(text);
        let time = EditTime { secs, fps: 30.0 };
        let set = set_time(&text, line, column, part, time).map_err(|refused| refused.why);
        set.map(|edit| {
            let after = edit.apply(&text);
            // The inverse edit restores the text.
            assert_eq!(edit.inverse(&text).apply(&after), text);
            after
        })
    }

    #[test]
    fn a_new_end_is_written_after_the_start() {
        let ended = |text| set(text, CueTime::End, 2.0).unwrap();
        assert_eq!(ended("a.|play(c).from(1.0);"), "a.play(c).from(1.0).until(2.0);");
        assert_eq!(ended("a.|play(c).then(d).from(3.0);"), "a.play(c).until(2.0).then(d).from(3.0);");
        assert_eq!(
            set("a.|play(c).until(2.0);", CueTime::Start, 1.0).unwrap(),
            "a.play(c).from(1.0).until(2.0);"
        );
    }

    #[test]
    fn setting_a_time_rewrites_only_its_literal() {
        let text = "// a walk\nada.|play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.5 ) // why\n    .until(2.0);\n";
        assert_eq!(
            set(text, CueTime::Start, 0.75).unwrap(),
            "// a walk\nada.play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.75 ) // why\n    .until(2.0);\n"
        );
        assert!(set(text, CueTime::End, 3.0).unwrap().ends_with(".until(3.0);\n"));
    }

    #[test]
    fn a_missing_time_is_added_after_the_call() {
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

    /// Every frame at every usual rate is read back as itself, no matter what the edit replaced.
    #[test]
    fn times_on_frames_are_read_back_as_the_same_frame() {
        for fps in [12.0, 24.0, 25.0, 30.0, 50.0, 60.0, 120.0, 24000.0 / 1001.0, 30000.0 / 1001.0] {
            let rate = choreo_motion::FrameRate::from_fps(fps).unwrap();
            for frame in 0..500 {
                let time = EditTime { secs: rate.time_of(frame).as_secs(), fps: rate.as_fps() };
                for in_frames in [false, true] {
                    let text = time.text(in_frames);
                    let read = match text.strip_prefix("f(") {
                        Some(rest) => rate.time_of(rest.trim_end_matches(')').parse().unwrap()),
                        None => choreo_motion::Time::from_secs(text.parse().unwrap()),
                    };
                    assert_eq!(read, rate.time_of(frame), "{text} at {fps} fps");
                }
            }
        }
        let nudged = |secs| set("a.|play(c).from(1.0);", CueTime::Start, secs).unwrap();
        assert_eq!(nudged(31.0 / 30.0), "a.play(c).from(1.033333333);");
        assert_eq!(nudged(1.1), "a.play(c).from(1.1);");
        assert_eq!(nudged(1.2346), "a.play(c).from(1.235);");
        assert_eq!(
            set("a.|play(c).from( f(30) );", CueTime::Start, 1.1).unwrap(),
            "a.play(c).from( f(33) );"
        );
        let text = "a.|play(c, #{ fade: f(6) });";
        assert_eq!(set(text, CueTime::FadeIn, 0.3).unwrap(), "a.play(c, #{ fade: f(9) });");
    }

    /// Seconds stay seconds and frames stay frames; a new time has the style of the script.
    #[test]
    fn times_keep_the_style_of_the_script() {
        let seconds = set("a.|play(c).from(1.0).until(f(60));", CueTime::Start, 31.0 / 30.0).unwrap();
        assert_eq!(seconds, "a.play(c).from(1.033333333).until(f(60));");
        // The inverse edit restores the text.
        assert_eq!(
            set(&seconds.replace(".play", ".|play"), CueTime::Start, 1.5).unwrap(),
            "a.play(c).from(1.5).until(f(60));"
        );
        assert_eq!(set("a.|play(c).from(f(3));", CueTime::Start, 1.5).unwrap(), "a.play(c).from(f(45));");
        let ended = |text| set(text, CueTime::End, 61.0 / 30.0).unwrap();
        assert_eq!(ended("a.|play(c).from(f(3));"), "a.play(c).from(f(3)).until(f(61));");
        assert_eq!(ended("a.|play(c).from(0.5);"), "a.play(c).from(0.5).until(2.033333333);");
        assert_eq!(
            set("a.|play(c).from(f(3));", CueTime::End, 2.5).unwrap(),
            "a.play(c).from(f(3)).until(2.5);"
        );
    }

    /// A new time that needs all digits has the style of the neighboring times, else that of most times of the script.
    #[test]
    fn a_new_time_has_the_style_of_most_times() {
        let ended = |text: &str| set(text, CueTime::End, 61.0 / 30.0).unwrap();
        for (before, call, written) in [
            ("b.play(d).from(1.0).until(2.0);\ne.cut(f(75));\n", "a.|play(c);", "2.033333333"),
            ("b.play(d).from(f(30)).until(f(45));\ne.cut(1.0);\n", "a.|play(c);", "f(61)"),
            ("b.play(d).from(1.0).until(2.0);\n", "a.|play(c).from(f(3));", "f(61)"),
            ("b.play(d).from(f(30)).until(f(45));\n", "a.|play(c).from(0.5);", "2.033333333"),
        ] {
            let wanted = format!("{before}{}.until({written});", call.replace('|', "").trim_end_matches(';'));
            assert_eq!(ended(&format!("{before}{call}")), wanted);
        }
        let time = EditTime { secs: 14.0 / 30.0, fps: 30.0 };
        let keyed = "a.key(\"scale\", [[0.0, 1], [1.0, 2]]);\nb.cut(f(75));\n";
        assert_eq!(time.written(keyed), "0.466666667");
        assert_eq!(time.written(&keyed.replace("0.0, 1", "f(0), 1")), "f(14)");
    }

    #[test]
    fn the_cues_of_a_chain_are_edited_separately() {
        let text = "a.play(c).until(2.0)\n  .|then(d, #{ trim: [1.0, 2.0], fade: 0.4, speed: f(1) }).until(4.0).then(e).until(5.0);";
        assert!(set(text, CueTime::End, 4.5).unwrap().contains(".until(2.0)\n"));
        assert!(set(text, CueTime::End, 4.5).unwrap().contains("}).until(4.5).then(e).until(5.0)"));
        assert!(set(text, CueTime::FadeIn, 0.6).unwrap().contains("[1.0, 2.0], fade: 0.6, speed: f(1) }"));
        let why = set(text, CueTime::Start, 1.0).unwrap_err();
        assert_eq!(why, "line 2: it begins where the clip before it ends; change the end of that clip");
    }

    #[test]
    fn computed_times_are_refused_with_their_line() {
        let why = set("let x = 1;\na.|play(c).from(x + 1.0);", CueTime::Start, 2.0).unwrap_err();
        assert_eq!(why, "line 2: the time in .from(x + 1.0) is computed; change it there");
        assert!(set("a.|play(c).from(f(n));", CueTime::Start, 2.0).unwrap_err().contains("f(n)"));
        assert!(
            set("a.|play(c, #{ fade: fast });", CueTime::FadeIn, 2.0).unwrap_err().contains("fade: fast")
        );
        assert!(set("a.|play(c, options);", CueTime::FadeIn, 2.0).unwrap_err().contains("computed"));
        assert!(set("|let x = 1;", CueTime::Start, 2.0).unwrap_err().contains("no .play("));
        assert!(set_time("a", 9, 1, CueTime::Start, EditTime { secs: 1.0, fps: 30.0 }).is_err());
    }

    #[test]
    fn a_calculation_with_literals_becomes_a_number() {
        for (text, part, after) in [
            ("a.|play(c, #{ fade: 1.0/3.0 });", CueTime::FadeIn, "a.play(c, #{ fade: 0.5 });"),
            ("a.|play(c).fade( 1.0 / 3.0 );", CueTime::FadeIn, "a.play(c).fade( 0.5 );"),
            ("a.|play(c).fade(f(3 * 4));", CueTime::FadeIn, "a.play(c).fade(f(15));"),
            ("a.|play(c).from(2.0 / 3.0);", CueTime::Start, "a.play(c).from(0.5);"),
            ("a.|play(c, #{ until: -(1.0 - 3.0) });", CueTime::End, "a.play(c, #{ until: 0.5 });"),
        ] {
            assert_eq!(set(text, part, 0.5).as_deref(), Ok(after));
        }
        assert!(set("a.|play(c).fade(x / 3.0);", CueTime::FadeIn, 0.5).unwrap_err().contains("x / 3.0"));
    }

    #[test]
    fn an_inverse_edit_is_carried_over_to_a_changed_text() {
        let then = "let a = 1;\na.play(c).from(0.5);\n";
        let edit = set_time(then, 2, 3, CueTime::Start, EditTime { secs: 0.75, fps: 30.0 }).unwrap();
        let after = edit.apply(then);
        let back = edit.inverse(then);
        // An editor has saved a change above it.
        let now = after.replace("let a = 1;", "let a = 1;\nlet b = 2;");
        let carried = back.carried_over(&after, &now).unwrap();
        assert_eq!(carried.apply(&now), "let a = 1;\nlet b = 2;\na.play(c).from(0.5);\n");
        assert_eq!(back.carried_over(&after, "something else"), None);
        assert_eq!(back.carried_over(&after, &format!("{after}{after}")), None, "the line exists twice");
    }

    #[test]
    fn setting_times_in_truncated_text_does_not_panic() {
        let text = "a.play(\"ü(\", #{ x: `}` }).from(1.0) /* /* */ é */ .until('\\'');";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for part in [CueTime::Start, CueTime::End, CueTime::FadeIn] {
                    let _ = set_time(&text[*from..*to], 1, 1, part, EditTime { secs: 1.0, fps: 30.0 });
                }
            }
        }
    }
}
