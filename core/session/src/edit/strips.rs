//! Cues as strips of a timeline: trimmed, slipped, split, duplicated, copied as text and pasted, faded over, disabled.

use super::cues::{CueChange, set_times};
use super::keys::shifted_keys;
use super::object::{ScriptObject, loaded_as, quoted};
use super::scan::{Call, Source};
use super::times::{CueTime, EditTime, TimeLiteral};
use super::values::{format_number, literals, option_value, options_of, rewritten};
use super::{Edit, EditRefused};
use choreo_stage::{Cue, Described};
use std::ops::Range;

/// Calls and options about the transition into a cue or out of it, and the part of the clip: the second part of a split cue has its own.
const ENDS: [&str; 8] = ["fade", "fade_out", "ease", "in_step", "inertial", "trim", "clip_time", "freeze"];
/// Calls and options that say when a cue plays.
const TIMES: [&str; 2] = ["from", "until"];
/// Calls of a layer, which hold for all cues of a chain.
const LAYER: [&str; 5] = ["on", "additive", "subtractive", "priority", "layer_weight"];
/// Calls with times of the stage in their keys, beside those of the described fields of a cue.
const KEYED: [&str; 2] = ["clip_time", "layer_weight"];

/// Whether a call or option belongs to one cue, wherever it stands on the timeline.
fn is_own(name: &str) -> bool {
    !TIMES.contains(&name) && !LAYER.contains(&name)
}

/// Whether the keys of a call have times of the stage.
fn is_keyed(name: &str) -> bool {
    KEYED.contains(&name) || Cue::field(name).is_some_and(|field| field.keyed.is_some())
}

/// The call that makes a cue, and the calls behind it.
struct Strip<'a> {
    text: Source<'a>,
    line: usize,
    call: Call,
    chain: Vec<Call>,
}

/// The content of the second part of a cue that is split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rest {
    /// Plays this part of the clip, seconds.
    Trim([f64; 2]),
    /// Repeats: shows these times of the clip at these times, seconds.
    ClipTime([[f64; 2]; 2]),
    /// Begins as the first does.
    Same,
}

impl<'a> Strip<'a> {
    fn at(text: &'a str, line: usize, column: usize) -> Result<Strip<'a>, EditRefused> {
        let text = Source::new(text);
        let call = text.byte_at(line, column).and_then(|at| text.call_from(at));
        let call = call.ok_or_else(|| EditRefused::at(line, "there is no play or then to be changed"))?;
        let chain = text.chain_after(call.end);
        Ok(Strip { text, line, call, chain })
    }

    fn name(&self, call: &Call) -> &str {
        &self.text[call.name.clone()]
    }

    fn last(&self, name: &str) -> Option<&Call> {
        self.chain.iter().rev().find(|call| self.name(call) == name)
    }

    fn end(&self) -> usize {
        self.chain.last().map_or(self.call.end, |call| call.end)
    }

    /// The value of a method behind it, or of an option.
    fn value(&self, name: &str) -> Option<Range<usize>> {
        let method = self.last(name).map(|call| call.inside.clone());
        method.or_else(|| option_value(&self.text, &self.call, name))
    }

    fn computed(&self, name: &str, value: &Range<usize>) -> EditRefused {
        let line = self.text[..value.start].matches('\n').count() + 1;
        let shown = self.text[value.clone()].trim();
        EditRefused::at(line, &format!("{name}: {shown} is computed; change it there"))
    }

    /// Writes numbers as the value of a method or an option.
    fn set(&self, name: &str, values: &[f64]) -> Result<Edit, EditRefused> {
        let Some(old) = self.value(name) else {
            let values = values.iter().map(|v| format_number(*v)).collect::<Vec<_>>().join(", ");
            return Ok(Edit { range: self.call.end..self.call.end, text: format!(".{name}({values})") });
        };
        let literals = literals(&self.text, &self.text.trimmed(&old)).filter(|l| l.len() == values.len());
        let changed = literals.and_then(|literals| rewritten(&self.text, &literals, values));
        changed.ok_or_else(|| self.computed(name, &old))
    }

    /// Separator before a `.then` that is added: a line of its own, indented.
    fn new_line(&self) -> String {
        let start = self.text[..self.first().name.start].rfind('\n').map_or(0, |n| n + 1);
        let blanks: String = self.text[start..].chars().take_while(|c| *c == ' ' || *c == '\t').collect();
        format!("\n{blanks}    ")
    }

    /// The `play` with which its chain begins.
    fn first(&self) -> Call {
        let mut first = self.call.clone();
        while let Some(before) = self.text.call_before(first.name.start) {
            if matches!(self.name(&before), "cast" | "camera") {
                break;
            }
            first = before;
        }
        first
    }

    /// The script's variable that holds it, which a change of the chain would give another meaning.
    fn refuse_variable(&self) -> Result<(), EditRefused> {
        let first = self.first();
        let before = self.text[..first.name.start].trim_end();
        let owner = before.strip_suffix('.').map_or(before, str::trim_end);
        let start = owner.rfind(|c: char| !c.is_alphanumeric() && c != '_').map_or(0, |at| at + 1);
        match self.text.variable_before(start) {
            Some(name) if self.name(&first) == "play" => Err(EditRefused::at(
                self.line,
                &format!("the script uses this clip as \"{name}\"; change it there"),
            )),
            _ => Ok(()),
        }
    }

    /// `.then(…)` with the clip and those of its options and calls that are kept.
    fn then(&self, keeps: impl Fn(&str) -> bool) -> String {
        let inside = &self.call.inside;
        let clip = self.text[inside.start..self.text.value_end(inside.start, inside.end)].trim();
        let options: Vec<&str> = options_of(&self.text, &self.call)
            .into_iter()
            .filter(|option| keeps(option.split(':').next().unwrap_or_default().trim()))
            .collect();
        let options =
            if options.is_empty() { String::new() } else { format!(", #{{ {} }}", options.join(", ")) };
        let calls = self.chain.iter().filter(|call| keeps(self.name(call)));
        let calls: String = calls.map(|call| self.dotted(call)).collect();
        format!("{}.then({clip}{options}){calls}", self.new_line())
    }

    /// `.name(…)`
    fn dotted(&self, call: &Call) -> String {
        format!(".{}", &self.text[call.name.start..call.end])
    }
}

/// Plays another part of the clip, in seconds of the clip.
///
/// # Errors
/// Why not, for the user: the script computes it; here and below.
pub fn set_trim(text: &str, line: usize, column: usize, trim: [f64; 2]) -> Result<Edit, EditRefused> {
    Strip::at(text, line, column)?.set("trim", &trim)
}

/// Sets the speed, the weight or the fade-out of a cue.
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

/// Gives a cue the weight 0, with the weight that it had in a comment; or that weight again.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn set_disabled(text: &str, line: usize, column: usize, off: bool) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    let Some(value) = strip.value("weight") else {
        return match off {
            true => strip.set("weight", &[0.0]),
            false => Err(EditRefused::at(line, "it is not disabled by its weight")),
        };
    };
    let inside = &strip.text[value.clone()];
    let blanks = value.start + (inside.len() - inside.trim_start().len());
    let range = blanks..blanks + inside.trim().len();
    if off {
        let old = literals(&strip.text, &strip.text.trimmed(&value)).filter(|old| old.len() == 1);
        let old = old.ok_or_else(|| strip.computed("weight", &value))?;
        return Ok(Edit { text: format!("0.0 /* {} */", &strip.text[old[0].0.clone()]), range });
    }
    if let Some(old) = inside.split_once("/*").and_then(|(_, rest)| rest.split_once("*/")) {
        return Ok(Edit { range, text: old.0.trim().to_string() });
    }
    match strip.last("weight") {
        Some(call) => {
            let dot = strip.text[..call.name.start].rfind('.').unwrap_or(call.name.start);
            Ok(Edit { range: dot..call.end, text: String::new() })
        }
        None => Ok(Edit { range, text: "1.0".into() }),
    }
}

/// Splits a cue at a time: it ends there, and a second one with the rest of its clip follows. `fade_out`: of an upper layer, goes to the second.
///
/// # Errors
/// The errors are those of [`set_trim`], and the script uses the cue as a variable.
pub fn split_cue(
    text: &str,
    line: usize,
    column: usize,
    at: EditTime,
    rest: Rest,
    fade_out: Option<f64>,
) -> Result<Edit, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    strip.refuse_variable()?;
    let mut second = strip.then(|name| is_own(name) && !ENDS.contains(&name));
    match rest {
        Rest::Trim([from, to]) => {
            second += &format!(".trim({}, {})", format_number(from), format_number(to));
        }
        Rest::ClipTime(keys) => {
            let keys = keys.map(|[when, shown]| {
                let when = EditTime { secs: when, fps: at.fps }.anew(&strip.text);
                format!("[{when}, {}]", format_number(shown))
            });
            second += &format!(".clip_time([{}])", keys.join(", "));
        }
        Rest::Same => {}
    }
    let until = strip.value("until");
    if let Some(until) = &until {
        second += &format!(".until({})", strip.text[until.clone()].trim());
    }
    if let Some(fade_out) = fade_out {
        second += &format!(".fade_out({})", format_number(fade_out));
    }
    let end = strip.end();
    // The call stands behind a .fade(…), which would set it again.
    let off = if fade_out.is_some() && strip.last("fade_out").is_none() { ".fade_out(0.0)" } else { "" };
    let mut after = format!("{}{off}{second}{}", &text[..end], &text[end..]);
    let first_end = CueChange { line, column, part: CueTime::End, time: at };
    after = match until {
        Some(until) if strip.last("until").is_none() => {
            let old = TimeLiteral::of(&strip.text, &until).ok_or_else(|| strip.computed("until", &until))?;
            old.set(at).apply(&after)
        }
        _ => set_times(&after, &[first_end])?.apply(&after),
    };
    if fade_out.is_some() && strip.last("fade_out").is_some() {
        after = set_number(&after, line, column, "fade_out", 0.0)?.apply(&after);
    }
    Ok(Edit::between(text, &after))
}

/// Plays the clip of a cue once more right after it, with its options, and with its keys and freezes `by` later. `until`: the end of the
/// second, where the first states one.
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
    let second = strip.then(is_own);
    let then = second.trim_start();
    let shifted =
        shift_keys(then, 1, 2, by).map_err(|refused| EditRefused { line: Some(line), ..refused })?;
    let blanks = &second[..second.len() - then.len()];
    let until = until.map(|until| format!(".until({})", until.anew(&strip.text))).unwrap_or_default();
    let at = strip.end();
    Ok(Edit { range: at..at, text: format!("{blanks}{}{until}", shifted.apply(then)) })
}

/// A cue as text for the clipboard, `play(load("hero.glb").clip("Walk"), #{ fade: 0.3 }).from(1.0).until(2.0)`, to be pasted on another
/// row or into another script.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn copy_cue(
    text: &str,
    line: usize,
    column: usize,
    start: EditTime,
    until: Option<EditTime>,
) -> Result<String, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    let inside = &strip.text[strip.call.inside.clone()];
    let name: String = inside.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    // The variable of a file is another one in another script.
    let load = strip.text.calls_of("load").find(|load| {
        strip.text.variable_before(load.name.start) == Some(&*name) && load.name.start < strip.call.name.start
    });
    let load = load.map(|load| &strip.text[load.name.start..load.end]);
    let inside = match load {
        Some(load) => format!("{load}{}", &inside.trim_start()[name.len()..]),
        None => inside.trim().to_string(),
    };
    let mut copy = format!("play({inside}).from({})", start.anew(&strip.text));
    if let Some(until) = until {
        copy += &format!(".until({})", until.anew(&strip.text));
    }
    let mut first = Some(strip.first()).filter(|first| first.name != strip.call.name);
    let mut calls: Vec<Call> = Vec::new();
    while let Some(call) = first {
        let chain = strip.text.chain_after(call.end);
        let end = chain.last().map_or(call.end, |call| call.end);
        calls.extend(chain.into_iter().filter(|call| LAYER.contains(&strip.name(call))));
        let next = strip.text.call_from(end).filter(|next| next.name.start < strip.call.name.start);
        first = next.filter(|_| strip.text[end..].trim_start().starts_with('.'));
    }
    // Those in later lines about its variable, too.
    let own = ScriptObject::at(text, line, column)?.calls;
    calls.extend(own.into_iter().filter(|call| !TIMES.contains(&strip.name(call))));
    copy.extend(calls.iter().map(|call| strip.dotted(call)));
    Ok(copy)
}

/// Plays a copied cue on an actor (line and column of its `cast`) from a time on.
///
/// # Errors
/// The text is no copied cue, or names what this script does not have.
pub fn paste_cue(
    text: &str,
    line: usize,
    column: usize,
    copied: &str,
    from: EditTime,
) -> Result<Edit, EditRefused> {
    let copied = copied.trim().trim_end_matches(';');
    let refuse = || EditRefused::from("the clipboard holds no clip of a timeline".to_string());
    let strip = Strip::at(copied, 1, 1).map_err(|_| refuse())?;
    if strip.name(&strip.call) != "play" || strip.call.name.start != 0 || strip.end() != copied.len() {
        return Err(refuse());
    }
    let start = strip.last("from").and_then(|call| TimeLiteral::of(&strip.text, &call.inside));
    let start = start.map_or(0.0, |start| start.secs(from.fps));
    let shifted = shift_cue(copied, 1, 1, EditTime { secs: from.secs - start, fps: from.fps })?;
    let mut new = shifted.apply(copied);
    let object = ScriptObject::at(text, line, column)?;
    // The script's own name of the file, if it has one: that of the actor's own file first.
    let script = Source::new(text);
    let copy = Source::new(&new);
    let first = |source: &Source, call: &Call| {
        source[call.inside.start..source.value_end(call.inside.start, call.inside.end)].trim().to_string()
    };
    let own = copy.calls_of("load").next().and_then(|load| {
        let file = first(&copy, &load);
        let of_object = object.asset_object().ok();
        let of_object = of_object.filter(|own| own.made_by() == "load" && first(&script, &own.made) == file);
        let of_object = of_object.and_then(|own| script.variable_before(own.made.name.start));
        let name = of_object.or_else(|| loaded_as(&script, &file, text.len()))?;
        Some((load.name.start..load.end, name.to_string()))
    });
    let clip = copy[strip.call.inside.start..].trim_start();
    let name: String = clip.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let declared = |name: &str| {
        let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '_').peekable();
        std::iter::from_fn(|| words.next().map(|word| (word, words.peek().copied())))
            .any(|(word, next)| matches!(word, "let" | "const") && next == Some(name))
    };
    if !matches!(&*name, "load" | "") && !declared(&name) {
        return Err(format!("this script has no {}, of which the copied clip is made", quoted(&name)).into());
    }
    let uses = own.as_ref().map_or(&name, |(_, own)| own).clone();
    if let Some((range, own)) = own {
        new.replace_range(range, &own);
    }
    // Variables that it names are made before it.
    let declared_at = text.find(&format!("let {uses} ")).unwrap_or(0);
    object.add_call(&new, object.last_at().max(declared_at))
}

/// The cues in the text of a clipboard, each as [`copy_cue`] has it.
pub fn copied_cues(copied: &str) -> Vec<&str> {
    let source = Source::new(copied);
    let starts = source.calls_of("play").map(|call| call.name.start).filter(|at| source.depth_to(*at) == 0);
    let starts: Vec<usize> = starts.collect();
    let ends = starts.iter().skip(1).copied().chain([copied.len()]);
    let first = starts.first().filter(|first| copied[..**first].trim().is_empty());
    first.map_or_else(Vec::new, |_| {
        starts.iter().zip(ends).map(|(from, to)| copied[*from..to].trim()).collect()
    })
}

/// The start of a copied cue, seconds.
pub fn copied_start(copied: &str, fps: f64) -> Option<f64> {
    let strip = Strip::at(copied, 1, 1).ok()?;
    Some(TimeLiteral::of(&strip.text, &strip.last("from")?.inside)?.secs(fps))
}

/// Shifts all times of the stage in a cue: its start and end, and those of its keys and freezes.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn shift_cue(text: &str, line: usize, column: usize, by: EditTime) -> Result<Edit, EditRefused> {
    let mut after = shift_keys(text, line, column, by)?.apply(text);
    for name in ["from", "until"] {
        let strip = Strip::at(&after, line, column)?;
        let Some(value) = strip.value(name) else { continue };
        let old = TimeLiteral::of(&strip.text, &value).ok_or_else(|| strip.computed(name, &value))?;
        let secs = old.secs(by.fps) + by.secs;
        let edit = old.set(EditTime { secs, fps: by.fps });
        after = edit.apply(&after);
    }
    Ok(Edit::between(text, &after))
}

/// Shifts the times of the keys and freezes of a cue, which are times of the stage.
///
/// # Errors
/// The errors are those of [`set_trim`].
pub fn shift_keys(text: &str, line: usize, column: usize, by: EditTime) -> Result<Edit, EditRefused> {
    let mut after = text.to_string();
    let count = Strip::at(text, line, column)?.chain.len();
    // Edits go from the end of the chain to its start, so that none moves a call that is still to come.
    for index in (0..count).rev() {
        let strip = Strip::at(&after, line, column)?;
        let call = &strip.chain[index];
        let first = call.inside.start..strip.text.value_end(call.inside.start, call.inside.end);
        let edit = match strip.name(call) {
            "freeze" => {
                let old =
                    TimeLiteral::of(&strip.text, &first).ok_or_else(|| strip.computed("freeze", &first))?;
                let secs = old.secs(by.fps) + by.secs;
                old.set(EditTime { secs, fps: by.fps })
            }
            name if is_keyed(name) && strip.text[first.clone()].trim_start().starts_with('[') => {
                shifted_keys(&strip.text, first.clone(), by).ok_or_else(|| strip.computed(name, &first))?
            }
            _ => continue,
        };
        after = edit.apply(&after);
    }
    Ok(Edit::between(text, &after))
}
