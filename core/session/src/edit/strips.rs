//! Cues as strips of a timeline: trim, slip, split, duplicate, disable.

use super::cues::{CueChange, comment_behind, set_times, statement_start};
use super::indenting::indented;
use super::key_list::split_at_commas;
use super::keys::shifted_keys;
use super::number_style::in_number_style;
use super::object::ScriptObject;
use super::scan::{Call, Source};
use super::times::{CueTime, EditTime, TimeLiteral};
use super::values::{
    becomes_method, format_number, is_calculation, option_value, options_of, overwrite_numbers, set_option,
};
use super::{Edit, EditRefused, chain};
use choreo_stage::{Cue, Described};
use std::ops::Range;

/// Calls and options about transitions and the part of the clip. The second half of a split cue does not inherit them.
const FIRST_HALF_CALLS: [&str; 8] =
    ["fade", "fade_out", "ease", "in_step", "inertial", "trim", "clip_time", "freeze"];
/// Calls and options that set the time range of a cue.
pub(super) const TIME_RANGE_CALLS: [&str; 2] = ["from", "until"];
/// Calls of a layer, which apply to all cues of a chain.
const LAYER_CALLS: [&str; 5] = ["on", "additive", "subtractive", "priority", "layer_weight"];
/// Calls whose keys are in stage time, in addition to the keyed fields that [`Cue`] describes.
const STAGE_TIME_KEYED_CALLS: [&str; 2] = ["clip_time", "layer_weight"];

/// Ends of a clip's part that differ by at most this many seconds count as equal.
const TRIM_TOLERANCE: f64 = 2e-5;

/// Whether a call of a cue is about its layer, and so applies to all cues of its chain.
pub fn is_layer_call(name: &str) -> bool {
    LAYER_CALLS.contains(&name)
}

/// Whether a call or option of a cue is kept if the cue is copied to another time.
fn is_independent_of_time(name: &str) -> bool {
    !TIME_RANGE_CALLS.contains(&name) && !is_layer_call(name)
}

/// Whether the keys of a call are in stage time.
fn has_stage_time_keys(name: &str) -> bool {
    STAGE_TIME_KEYED_CALLS.contains(&name) || Cue::field(name).is_some_and(|field| field.keyed.is_some())
}

/// The call that makes a cue, and the method calls after it.
pub(super) struct Strip<'a> {
    pub text: Source<'a>,
    line: usize,
    pub call: Call,
    pub chain: Vec<Call>,
}

/// Content of the second half of a split cue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SecondHalf {
    /// Plays this part of the clip, clip seconds.
    Trim([f64; 2]),
    /// Repeats the clip: two keys of stage time and clip time, seconds.
    ClipTime([[f64; 2]; 2]),
    /// Starts like the first half.
    LikeFirstHalf,
}

impl<'a> Strip<'a> {
    pub(super) fn at(text: &'a str, line: usize, column: usize) -> Result<Strip<'a>, EditRefused> {
        let within = Strip::from_source(Source::new(text), line, column);
        within.ok_or_else(|| EditRefused::at(line, "this line has no .play(…) or .then(…) to change"))
    }

    fn from_source(text: Source<'a>, line: usize, column: usize) -> Option<Strip<'a>> {
        let call = text.byte_at(line, column).and_then(|at| text.call_from(at))?;
        let chain = text.chain_after(call.end);
        Some(Strip { text, line, call, chain })
    }

    pub(super) fn name(&self, call: &Call) -> &str {
        &self.text[call.name.clone()]
    }

    pub(super) fn last_call(&self, name: &str) -> Option<&Call> {
        self.chain.iter().rev().find(|call| self.name(call) == name)
    }

    pub(super) fn end(&self) -> usize {
        self.chain.last().map_or(self.call.end, |call| call.end)
    }

    /// Bytes of a value that the cue states as a method, else as an option.
    pub(super) fn value(&self, name: &str) -> Option<Range<usize>> {
        let method = self.last_call(name).map(|call| call.inside.clone());
        method.or_else(|| option_value(&self.text, &self.call, name))
    }

    fn refuse_computed(&self, name: &str, value: &Range<usize>) -> EditRefused {
        let line = self.text[..value.start].matches('\n').count() + 1;
        let shown = self.text[value.clone()].trim();
        EditRefused::at(line, &format!("{name}: {shown} is computed; change it there"))
    }

    /// Writes numbers as the value of a method or an option: over the stated value, else as a new one.
    fn set(&self, name: &str, values: &[f64]) -> Result<Edit, EditRefused> {
        let Some(old) = self.value(name) else {
            let is_method = becomes_method(&self.text, &self.call, &self.chain, name);
            let numbers: Vec<String> = values.iter().map(|value| format_number(*value)).collect();
            return Ok(self.add(is_method, (name, &numbers)));
        };
        let changed = overwrite_numbers(&self.text, &self.text.trimmed(&old), values);
        changed.ok_or_else(|| self.refuse_computed(name, &old))
    }

    /// Adds a value that the cue does not state yet: as a method, else as an option. A method is also used if the options are computed.
    fn add(&self, is_method: bool, (name, values): (&str, &[String])) -> Edit {
        let numbers = values.join(", ");
        let value = if values.len() == 1 { numbers.clone() } else { format!("[{numbers}]") };
        let option = match is_method {
            true => None,
            false => set_option(&self.text, &self.call, self.line, name, &value).ok(),
        };
        option.unwrap_or_else(|| chain::add_method(&self.text, &self.call, &format!("{name}({numbers})")))
    }

    /// Comment at the end of the cue's last line, with the whitespace before it.
    pub(super) fn comment(&self) -> Option<Range<usize>> {
        comment_behind(&self.text, &self.call, self.end())
    }

    /// The whole text with `more` added to the chain of the cue. A comment at the end of the line stays there.
    fn followed_by(&self, more: &str) -> String {
        let (text, end) = (self.text.whole(), self.end());
        let comment = self.comment().unwrap_or(end..end);
        let (code, closing) = (&text[..end], &text[end..comment.start]);
        format!("{code}{}{more}{closing}{}", &text[comment.clone()], &text[comment.end..])
    }

    /// Whether the cue states its times in frames: its end, else its start, else the end of the previous clip, where it begins. `None` if the
    /// script states none of these.
    pub(super) fn in_frames(&self) -> Option<bool> {
        let style = |strip: &Strip, name| Some(TimeLiteral::of(&strip.text, &strip.value(name)?)?.in_frames);
        let before = || {
            let before = self.cues().into_iter().take_while(|cue| cue.call.name != self.call.name).last()?;
            style(&before, "until")
        };
        style(self, "until").or_else(|| style(self, "from")).or_else(before)
    }

    /// All cues of the chain in order, including this one.
    pub(super) fn cues(&self) -> Vec<Strip<'a>> {
        let mut all: Vec<Strip> = Vec::new();
        let mut next = Some(self.chain_start());
        while let Some(call) = next {
            let chain = self.text.chain_after(call.end);
            let cue = Strip { text: self.text.clone(), line: self.line, call, chain };
            next = self.text.call_from(cue.end()).filter(|next| matches!(self.name(next), "play" | "then"));
            // Calls before the first cue belong to the actor.
            all.extend(Some(cue).filter(|cue| matches!(self.name(&cue.call), "play" | "then")));
        }
        all
    }

    /// Name bytes of the cue that this one follows: the previous cue of its chain, or the last cue of the chain in a variable, `walk.then(…)`.
    /// `all`: the cues to search for that variable.
    fn preceding_cue<'s>(&'s self, all: &'s [Option<Strip<'a>>]) -> Option<Range<usize>> {
        if self.name(&self.call) != "then" {
            return None;
        }
        let cues = self.cues();
        let before = cues.iter().take_while(|cue| cue.call.name != self.call.name).last();
        if let Some(before) = before {
            return Some(before.call.name.clone());
        }
        let start = statement_start(&self.text, &self.call)?;
        let variable = self.text.word_at(start);
        let is_it = |cue: &&Strip| {
            let made = statement_start(&cue.text, &cue.chain_start()).filter(|made| *made < start);
            made.and_then(|made| cue.text.variable_before(made)) == Some(variable)
        };
        let made = all.iter().flatten().filter(is_it).max_by_key(|cue| cue.call.name.start)?;
        made.cues().last().map(|cue| cue.call.name.clone())
    }

    /// Separator before a new `.then`: a line break with indentation.
    fn then_separator(&self) -> String {
        let start = self.text[..self.chain_start().name.start].rfind('\n').map_or(0, |n| n + 1);
        let blanks: String = self.text[start..].chars().take_while(|c| *c == ' ' || *c == '\t').collect();
        format!("\n{blanks}    ")
    }

    /// The call that begins the chain, a `play`.
    fn chain_start(&self) -> Call {
        let mut first = self.call.clone();
        while let Some(before) = self.text.call_before(first.name.start) {
            if matches!(self.name(&before), "cast" | "camera") {
                break;
            }
            first = before;
        }
        first
    }

    /// Fails if a variable of the script holds the chain, since a new cue would change its meaning.
    fn refuse_variable(&self) -> Result<(), EditRefused> {
        let first = self.chain_start();
        let before = self.text[..first.name.start].trim_end();
        let owner = before.strip_suffix('.').map_or(before, str::trim_end);
        let start = owner.rfind(|c: char| !c.is_alphanumeric() && c != '_').map_or(0, |at| at + 1);
        match self.text.variable_before(start) {
            Some(name) if self.name(&first) == "play" => Err(EditRefused::at(
                self.line,
                &format!("the script uses this clip as variable \"{name}\"; change it there"),
            )),
            _ => Ok(()),
        }
    }

    /// A `.then(…)` with the clip, and with the options and calls that `keeps` accepts.
    fn then_call(&self, keeps: impl Fn(&str) -> bool) -> String {
        let inside = &self.call.inside;
        // If the script keeps the options in a variable, the copy uses it, too.
        let end = match self.text.options_map(inside) {
            Some(_) => self.text.value_end(inside.start, inside.end),
            None => inside.end,
        };
        let clip = self.text[inside.start..end].trim();
        let options: Vec<&str> = options_of(&self.text, &self.call)
            .into_iter()
            .filter(|option| keeps(option.split(':').next().unwrap_or_default().trim()))
            .collect();
        let options =
            if options.is_empty() { String::new() } else { format!(", #{{ {} }}", options.join(", ")) };
        let calls = self.chain.iter().filter(|call| keeps(self.name(call)));
        let calls: String = calls.map(|call| self.call_source(call)).collect();
        format!("{}.then({clip}{options}){calls}", self.then_separator())
    }

    /// Source text `.name(…)` of a call.
    pub(super) fn call_source(&self, call: &Call) -> String {
        format!(".{}", &self.text[call.name.start..call.end])
    }
}

/// Index of the cue that each cue follows in its chain. Cues are given by line and column of their `play` or `then`.
pub fn cues_before(text: &str, places: &[(usize, usize)]) -> Vec<Option<usize>> {
    let text = Source::new(text);
    let cue = |(line, column): &(usize, usize)| Strip::from_source(text.clone(), *line, *column);
    let all: Vec<Option<Strip>> = places.iter().map(cue).collect();
    let before = |cue: &Option<Strip>| {
        let before = cue.as_ref()?.preceding_cue(&all)?;
        all.iter().position(|other| other.as_ref().is_some_and(|other| other.call.name == before))
    };
    all.iter().map(before).collect()
}

/// Text of times in seconds, with as many digits as everywhere else, so that equal times have equal text.
fn texts_in_seconds(times: &[f64], fps: f64) -> Vec<String> {
    times.iter().map(|secs| EditTime { secs: *secs, fps }.text(false)).collect()
}

/// Sets the part of the clip that a cue plays, clip seconds. `fps`: frame rate of the stage.
///
/// # Errors
/// The call is not there, or the script computes the value. The text is for the user.
pub fn set_trim(
    text: &str,
    line: usize,
    column: usize,
    trim: [f64; 2],
    fps: f64,
) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    let Some(value) = strip.value("trim") else {
        let is_method = becomes_method(&strip.text, &strip.call, &strip.chain, "trim");
        return Ok(strip.add(is_method, ("trim", &texts_in_seconds(&trim, fps))));
    };
    let [from, to] = times_in(&strip.text, &value).ok_or_else(|| strip.refuse_computed("trim", &value))?;
    let moves = |(end, secs): &(TimeLiteral, f64)| (end.secs(fps) - secs).abs() > TRIM_TOLERANCE;
    let moved = [(from, trim[0]), (to, trim[1])].into_iter().filter(moves);
    Ok(Edit::combine(text, moved.map(|(end, secs)| end.set(text, EditTime { secs, fps })).collect()))
}

/// The two times of `0.5, f(12)` or `[0.5, f(12)]`. `None` if one is computed.
fn times_in(text: &Source, bytes: &Range<usize>) -> Option<[TimeLiteral; 2]> {
    let list = text.trimmed(bytes);
    let inside = text[list.clone()].strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let (start, end) = if inside.is_some() { (list.start + 1, list.end - 1) } else { (list.start, list.end) };
    let times: Option<Vec<TimeLiteral>> =
        split_at_commas(text, start, end).map(|time| TimeLiteral::of(text, &time)).collect();
    times?.try_into().ok()
}

/// Sets a number of a cue, such as its speed, weight or fade-out.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn set_number(
    text: &str,
    line: usize,
    column: usize,
    name: &str,
    value: f64,
) -> Result<Edit, EditRefused> {
    Strip::at(text, line, column)?.set(name, &[value])
}

/// Disables a cue by the weight 0, with the former weight in a comment, or restores that weight.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn set_disabled(text: &str, line: usize, column: usize, is_disabled: bool) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    let Some(value) = strip.value("weight") else {
        return match is_disabled {
            true => strip.set("weight", &[0.0]),
            false => Err(EditRefused::at(line, "its weight does not disable it")),
        };
    };
    let inside = &strip.text[value.clone()];
    let blanks = value.start + (inside.len() - inside.trim_start().len());
    let range = blanks..blanks + inside.trim().len();
    if is_disabled {
        let old = strip.text.trimmed(&value);
        if !is_calculation(&strip.text, &old) {
            return Err(strip.refuse_computed("weight", &value));
        }
        let old = &strip.text[old];
        return Ok(Edit { text: format!("{} /* {old} */", in_number_style(old, "0.0")), range });
    }
    if let Some(old) = inside.split_once("/*").and_then(|(_, rest)| rest.split_once("*/")) {
        return Ok(Edit { range, text: old.0.trim().to_string() });
    }
    // The cue had no stated weight before it was disabled, so the call is removed.
    Ok(ScriptObject::at(text, line, column)?.remove_values(&["weight"]))
}

/// Splits a cue at a time: it ends there, and a second cue with the rest of its clip follows. `fade_out`: fade-out of a cue on an upper layer,
/// which moves to the second cue.
///
/// # Errors
/// The errors are those of [`set_trim`], and one for a cue that the script holds in a variable.
pub fn split_cue(
    text: &str,
    line: usize,
    column: usize,
    at: EditTime,
    second_half: SecondHalf,
    fade_out: Option<f64>,
) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    strip.refuse_variable()?;
    let mut second =
        strip.then_call(|name| is_independent_of_time(name) && !FIRST_HALF_CALLS.contains(&name));
    let until = strip.value("until").map(|until| strip.text[until].trim().to_string());
    // The second cue is written in the style of the first: with methods or with options.
    let is_method = becomes_method(&strip.text, &strip.call, &strip.chain, "trim");
    match second_half {
        SecondHalf::Trim(trim) => {
            second = with_value(&second, is_method, ("trim", &texts_in_seconds(&trim, at.fps)))
        }
        SecondHalf::ClipTime(keys) => {
            let keys = keys.map(|[when, shown]| {
                let when = EditTime { secs: when, fps: at.fps }.new_text(&strip.text);
                format!("[{when}, {}]", format_number(shown))
            });
            second += &format!(".clip_time([{}])", keys.join(", "));
        }
        SecondHalf::LikeFirstHalf => {}
    }
    if let Some(until) = &until {
        second += &format!(".until({until})");
    }
    if let Some(fade_out) = fade_out {
        second = with_value(&second, is_method, ("fade_out", &texts_in_seconds(&[fade_out], at.fps)));
    }
    let mut after = strip.followed_by(&second);
    let first_end = CueChange { line, column, part: CueTime::End, time: at };
    after = set_times(&after, &[first_end])?.apply(&after);
    if fade_out.is_some() {
        after = set_number(&after, line, column, "fade_out", 0.0)?.apply(&after);
    }
    Ok(indented(text, Edit::between(text, &after)))
}

/// Adds a value to a `.then(…)` that does not state it yet, as a method or as an option.
fn with_value(then: &str, is_method: bool, value: (&str, &[String])) -> String {
    let dot = then.len() - then.trim_start().len();
    let text = Source::new(then);
    let Some(call) = text.call_from(dot) else { return then.to_string() };
    let strip = Strip { chain: text.chain_after(call.end), text, line: 1, call };
    strip.add(is_method, value).apply(then)
}

/// Adds a cue with the same clip and options right after a cue; its keys and freezes are `by` later. `until`: end of the new cue, if the first one
/// states an end.
///
/// # Errors
/// The errors are those of [`split_cue`].
pub fn duplicate_cue(
    text: &str,
    line: usize,
    column: usize,
    by: EditTime,
    until: Option<EditTime>,
) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    strip.refuse_variable()?;
    let second = strip.then_call(is_independent_of_time);
    let then = second.trim_start();
    let shifted =
        shift_keys(then, 1, 2, by).map_err(|refused| EditRefused { line: Some(line), ..refused })?;
    let blanks = &second[..second.len() - then.len()];
    let until = until.map(|until| format!(".until({})", until.text_in_style(strip.in_frames(), &strip.text)));
    let second = format!("{blanks}{}{}", shifted.apply(then), until.unwrap_or_default());
    Ok(indented(text, Edit::between(text, &strip.followed_by(&second))))
}

/// Shifts all stage times of a cue: its start and end, and the times of its keys and freezes.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn shift_cue(text: &str, line: usize, column: usize, by: EditTime) -> Result<Edit, EditRefused> {
    let mut after = shift_keys(text, line, column, by)?.apply(text);
    for name in ["from", "until"] {
        let strip = Strip::at(&after, line, column)?;
        let Some(value) = strip.value(name) else { continue };
        let old = TimeLiteral::of(&strip.text, &value).ok_or_else(|| strip.refuse_computed(name, &value))?;
        let secs = old.secs(by.fps) + by.secs;
        let edit = old.set(&after, EditTime { secs, fps: by.fps });
        after = edit.apply(&after);
    }
    Ok(Edit::between(text, &after))
}

/// Shifts the times of the keys and freezes of a cue, which are in stage time.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn shift_keys(text: &str, line: usize, column: usize, by: EditTime) -> Result<Edit, EditRefused> {
    let mut after = text.to_string();
    let count = Strip::at(text, line, column)?.chain.len();
    // Edits go from the end of the chain to its start, so that none moves a call that is still to be edited.
    for index in (0..count).rev() {
        let strip = Strip::at(&after, line, column)?;
        let call = &strip.chain[index];
        let first = call.inside.start..strip.text.value_end(call.inside.start, call.inside.end);
        let edit = match strip.name(call) {
            "freeze" => {
                let old = TimeLiteral::of(&strip.text, &first)
                    .ok_or_else(|| strip.refuse_computed("freeze", &first))?;
                let secs = old.secs(by.fps) + by.secs;
                old.set(&after, EditTime { secs, fps: by.fps })
            }
            name if has_stage_time_keys(name) && strip.text[first.clone()].trim_start().starts_with('[') => {
                shifted_keys(&strip.text, first.clone(), by)
                    .ok_or_else(|| strip.refuse_computed(name, &first))?
            }
            _ => continue,
        };
        after = edit.apply(&after);
    }
    for (name, _) in Cue::keyed_options() {
        let strip = Strip::at(&after, line, column)?;
        let option = option_value(&strip.text, &strip.call, name).map(|value| strip.text.trimmed(&value));
        let Some(keys) = option.filter(|value| strip.text[value.clone()].starts_with('[')) else { continue };
        let edit =
            shifted_keys(&strip.text, keys.clone(), by).ok_or_else(|| strip.refuse_computed(name, &keys))?;
        after = edit.apply(&after);
    }
    Ok(Edit::between(text, &after))
}
