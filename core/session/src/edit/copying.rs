//! Cues copied as text and pasted onto another row or into another script, like lines that a person moves.

use super::indenting::indented;
use super::object::{ScriptObject, variable_of_file};
use super::scan::{Call, Source};
use super::strips::{Strip, TIME_RANGE_CALLS, is_layer_call, shift_cue};
use super::times::{EditTime, TimeLiteral};
use super::{Edit, EditRefused};
use choreo_script::quoted;

/// Largest difference between a stated start and that of the bar, seconds: a stated time may be rounded to the millisecond.
const TIME_TOLERANCE: f64 = 1e-3;

/// A cue as text for the clipboard, `play(load("hero.glb").clip("Walk"), #{ fade: 0.3 }).from(1.0).until(2.0); // walks in`, to be pasted onto
/// another row or into another script: its calls with the comments between them and the comment of its line. `start`, `until`: times of the cue,
/// written if the script computes them or does not state them.
///
/// # Errors
/// There is no cue at this place.
pub fn copy_cue(
    text: &str,
    line: usize,
    column: usize,
    start: EditTime,
    until: Option<EditTime>,
) -> Result<String, EditRefused> {
    let strip = Strip::at(text, line, column)?;
    let chain = &text[strip.call.end..strip.end()];
    let copy = format!("play({}){chain}", clip_by_file(&strip));
    let mut copy = with_times(&strip, copy, start, until)?;
    // The copy also gets layer calls of other cues of the chain, and calls in later lines about the cue's variable.
    let cues = strip.cues();
    let others = cues.iter().filter(|cue| cue.call.name != strip.call.name).flat_map(|cue| &cue.chain);
    let of_layer = others.filter(|call| is_layer_call(strip.name(call)));
    let own = ScriptObject::at(text, line, column)?.calls;
    let later = own.iter().filter(|call| call.name.start > strip.end());
    let later = later.filter(|call| !TIME_RANGE_CALLS.contains(&strip.name(call)));
    copy.extend(of_layer.chain(later).map(|call| strip.call_source(call)));
    if let Some(comment) = strip.comment() {
        copy += &format!("; {}", text[comment].trim());
    }
    Ok(copy)
}

/// Arguments of a cue's call with `load(…)` in place of the variable of the file, which another script may not have.
fn clip_by_file(strip: &Strip) -> String {
    let inside = &strip.text[strip.call.inside.clone()];
    let name: String = inside.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let load = strip.text.calls_of("load").find(|load| {
        strip.text.variable_before(load.name.start) == Some(&*name) && load.name.start < strip.call.name.start
    });
    match load.map(|load| &strip.text[load.name.start..load.end]) {
        Some(load) => format!("{load}{}", &inside.trim_start()[name.len()..]),
        None => inside.trim().to_string(),
    }
}

/// A copied cue with literal times, in the style of the cue.
fn with_times(
    strip: &Strip,
    mut copy: String,
    start: EditTime,
    until: Option<EditTime>,
) -> Result<String, EditRefused> {
    let mut begins = None;
    for (name, time) in [("from", Some(start)), ("until", until)] {
        let Some(time) = time else { continue };
        let copied = Strip::at(&copy, 1, 1)?;
        let value = copied.value(name);
        let literal = value.as_ref().and_then(|value| TimeLiteral::of(&copied.text, value));
        let written = time.text_in_style(strip.in_frames(), &strip.text);
        let edit = match (value, literal) {
            (_, Some(literal)) if name == "from" => {
                begins = Some(literal.secs(start.fps));
                continue;
            }
            (_, Some(_)) => continue,
            (Some(computed), None) => Edit { range: copied.text.trimmed(&computed), text: written },
            (None, None) => {
                let from = copied.last_call("from").filter(|_| name == "until");
                let at = from.map_or(copied.call.end, |from| from.end);
                Edit { range: at..at, text: format!(".{name}({written})") }
            }
        };
        copy = edit.apply(&copy);
    }
    // Times relative to the start of a sequence become stage times.
    let by = begins.map_or(0.0, |begins| start.secs - begins);
    match by.abs() > TIME_TOLERANCE {
        true => Ok(shift_cue(&copy, 1, 1, EditTime { secs: by, ..start })?.apply(&copy)),
        false => Ok(copy),
    }
}

/// A copied cue and the comment after it. `None` if the text is not a copied cue.
fn cue_and_comment(copied: &str) -> Option<(&str, &str)> {
    let copied = copied.trim();
    let strip = Strip::at(copied, 1, 1).ok()?;
    let comment = copied[strip.end()..].trim_start().trim_start_matches(';').trim();
    let is_block =
        || comment.starts_with("/*") && comment.find("*/").is_some_and(|at| at + 2 == comment.len());
    let is_comment = comment.is_empty() || comment.starts_with("//") && !comment.contains('\n') || is_block();
    let is_cue = strip.name(&strip.call) == "play" && strip.call.name.start == 0;
    (is_cue && is_comment).then(|| (&copied[..strip.end()], comment))
}

/// Adds a comment to an edit that adds a call.
fn with_comment(text: &str, edit: Edit, comment: &str) -> Edit {
    let behind = &text[edit.range.end..];
    let line = behind.split('\n').next().unwrap_or_default();
    match comment {
        "" => edit,
        // The edit adds a line of its own.
        _ if edit.text.ends_with(';') => Edit { text: format!("{} {comment}", edit.text), ..edit },
        _ if line.trim() == ";" => {
            let semicolon = edit.range.end + line.find(';').unwrap_or_default() + 1;
            Edit { range: edit.range.start..semicolon, text: format!("{}; {comment}", edit.text) }
        }
        _ => {
            let words = comment.trim_start_matches(['/', '*']).trim_end_matches(['*', '/']).trim();
            Edit { text: format!("{} /* {words} */", edit.text), ..edit }
        }
    }
}

/// Plays a copied cue on an actor from a time on. `line`, `column`: position of the actor's `cast`.
///
/// # Errors
/// The text is not a copied cue, or uses a variable that this script does not have.
pub fn paste_cue(
    text: &str,
    line: usize,
    column: usize,
    copied: &str,
    from: EditTime,
) -> Result<Edit, EditRefused> {
    let refuse = || EditRefused::from("the clipboard holds no clip of a timeline".to_string());
    let (copied, comment) = cue_and_comment(copied).ok_or_else(refuse)?;
    let strip = Strip::at(copied, 1, 1)?;
    let start = strip.value("from").and_then(|value| TimeLiteral::of(&strip.text, &value));
    let start = start.map_or(0.0, |start| start.secs(from.fps));
    let shifted = shift_cue(copied, 1, 1, EditTime { secs: from.secs - start, fps: from.fps })?;
    let mut new = shifted.apply(copied);
    if from.secs == 0.0 {
        // A clip starts at time 0 by default.
        new = ScriptObject::at(&new, 1, 1)?.remove_values(&["from"]).apply(&new);
    }
    let object = ScriptObject::at(text, line, column)?;
    // The copy uses a variable of the script that holds the file: that of the actor's own file, else any other.
    let script = Source::new(text);
    let copy = Source::new(&new);
    let first = |source: &Source, call: &Call| {
        source[call.inside.start..source.value_end(call.inside.start, call.inside.end)].trim().to_string()
    };
    let own = copy.calls_of("load").next().and_then(|load| {
        let file = first(&copy, &load);
        let of_object = object.asset_object().ok();
        let of_object = of_object
            .filter(|own| own.creating_function() == "load" && first(&script, &own.creating_call) == file);
        let of_object = of_object.and_then(|own| script.variable_before(own.creating_call.name.start));
        let name = of_object.or_else(|| variable_of_file(&script, &file, text.len()))?;
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
        return Err(
            format!("this script has no variable {}, which the copied clip uses", quoted(&name)).into()
        );
    }
    let uses = own.as_ref().map_or(&name, |(_, own)| own).clone();
    if let Some((range, own)) = own {
        new.replace_range(range, &own);
    }
    // The new line must come after the declaration of the variables that it uses.
    let declared_at = text.find(&format!("let {uses} "));
    let added = object.add_call(&new, declared_at.map(|at| (uses.as_str(), at)))?;
    Ok(indented(text, with_comment(text, added, comment)))
}

/// The cues in clipboard text, each as written by [`copy_cue`].
pub fn copied_cues(copied: &str) -> Vec<&str> {
    let source = Source::new(copied);
    let starts =
        source.calls_of("play").map(|call| call.name.start).filter(|at| source.bracket_depth_at(*at) == 0);
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
    Some(TimeLiteral::of(&strip.text, &strip.value("from")?)?.secs(fps))
}
