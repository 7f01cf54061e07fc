//! Inlay hints: start and end of cues as resolved by the last run, and lengths of clips. Values that the text itself states are not
//! repeated.

use crate::checker::CheckResult;
use crate::files::Contents;
use crate::settings::Settings;
use crate::source::{Source, is_string};
use crate::view::View;
use choreo_motion::Time;
use choreo_script::{Place, Places};
use choreo_stage::{Cue, Repeat, Stage};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;

/// Largest number of different times in a hint, if one call makes several cues.
const MOST_TIMES: usize = 3;

pub(crate) fn hints(view: &View, settings: &Settings, last: Option<&CheckResult>, range: &Value) -> Value {
    let source = view.source;
    let bytes = source.lines.bytes_of_range(&source.text, range);
    let mut found = Vec::new();
    if let Some((stage, places)) = last.and_then(|last| last.stage.as_ref()).filter(|_| settings.cue_times) {
        add_cue_times(source, stage, places, &bytes, &mut found);
    }
    if settings.clip_lengths {
        add_clip_lengths(view, &bytes, &mut found);
    }
    found.into()
}

fn hint(source: &Source, byte: usize, label: &str, tooltip: String) -> Value {
    json!({
        "position": source.lines.position(&source.text, byte), "label": label, "tooltip": tooltip,
        "paddingLeft": true,
    })
}

/// A cue of the stage, with its place in the script and its end time.
pub(crate) struct PlacedCue<'s> {
    pub place: &'s Place,
    pub cue: &'s Cue,
    pub end: Time,
}

/// All cues with their places in the script. A cue without an end lasts until its clip is over, until the next cue takes over, or until the
/// stage ends.
pub(crate) fn placed_cues<'s>(stage: &'s Stage, places: &'s Places) -> Vec<PlacedCue<'s>> {
    let mut found = Vec::new();
    for (actor, places) in stage.actors.iter().zip(&places.cues) {
        for (layer, places) in actor.layers.iter().zip(places) {
            for (index, (cue, place)) in layer.cues.iter().zip(places).enumerate() {
                let once = (cue.repeat == Repeat::Once).then(|| cue.first_play_end()).flatten();
                let next = layer.cues.get(index + 1).map(|next| next.start);
                let end = cue.end.or(once).or(next).unwrap_or(stage.settings.length);
                found.push(PlacedCue { place, cue, end });
            }
        }
    }
    found
}

/// Maps lines of the text that was run to lines of the current text. A line that was edited since the run has no current line. Neither has
/// a line whose text now occurs more or less often than in the text that was run.
pub(crate) struct LineMap<'m> {
    run_lines: Vec<&'m str>,
    /// Line numbers, from 0, at which each line text occurs: in the text that was run, and in the current text.
    line_numbers: BTreeMap<&'m str, [Vec<usize>; 2]>,
}

impl<'m> LineMap<'m> {
    pub(crate) fn new(source: &'m Source, places: &'m Places) -> LineMap<'m> {
        let run_lines: Vec<&str> =
            places.sources.get(&places.main).map_or("", |text| &**text).lines().collect();
        let mut line_numbers: BTreeMap<&str, [Vec<usize>; 2]> = BTreeMap::new();
        for (number, line) in run_lines.iter().enumerate() {
            line_numbers.entry(line).or_default()[0].push(number);
        }
        for (number, line) in source.text.lines().enumerate() {
            line_numbers.entry(line).or_default()[1].push(number);
        }
        LineMap { run_lines, line_numbers }
    }

    /// Line of the current text, from 0, for a line of the text that was run, from 1.
    pub(crate) fn current_line(&self, old: usize) -> Option<usize> {
        let old = old.checked_sub(1)?;
        let [run, now] = self.line_numbers.get(self.run_lines.get(old)?)?;
        let copy = run.iter().position(|number| *number == old).filter(|_| run.len() == now.len())?;
        Some(now[copy])
    }
}

fn add_cue_times(
    source: &Source,
    stage: &Stage,
    places: &Places,
    bytes: &Range<usize>,
    found: &mut Vec<Value>,
) {
    let mut by_place: BTreeMap<(usize, usize), Vec<PlacedCue>> = BTreeMap::new();
    for cue in placed_cues(stage, places) {
        if places.is_main(&cue.place.file) {
            by_place.entry((cue.place.line, cue.place.column)).or_default().push(cue);
        }
    }
    let line_map = LineMap::new(source, places);
    for ((line, column), cues) in by_place {
        let Some(line) = line_map.current_line(line) else { continue };
        let byte = source.lines.byte_of_diagnostic(&source.text, line + 1, column);
        // Keyframes of joints form a cue whose times are stated by the keyframes.
        let Some(call) = call_at(source, byte).filter(|call| source.get(*call) != "key") else { continue };
        let (end, is_stated) = cue_call_chain(source, call);
        if is_stated || !(bytes.start..=bytes.end).contains(&end) {
            continue;
        }
        let mut times: Vec<String> = Vec::new();
        for cue in &cues {
            let span = format!("{:.2}–{:.2} s", cue.cue.start.as_secs(), cue.end.as_secs());
            if !times.contains(&span) {
                times.push(span);
            }
        }
        let more = times.len().saturating_sub(MOST_TIMES);
        let mut label = times[..times.len() - more].join(", ");
        if more > 0 {
            label.push_str(&format!(" and {more} more"));
        }
        let clip = &cues[0].cue.clip.name;
        found.push(hint(source, end, &label, format!("\"{clip}\": start and end on the stage")));
    }
}

/// Token of the function name of the call at a byte, or after the dot there.
fn call_at(source: &Source, byte: usize) -> Option<usize> {
    let token = source.tokens.partition_point(|token| token.end <= byte);
    (token..token + 2).find(|token| source.get(token + 1) == "(")
}

/// The byte after the chained calls that describe a cue, and whether these calls give both its start and its end as numbers.
fn cue_call_chain(source: &Source, call: usize) -> (usize, bool) {
    let (mut starts, mut ends) = (false, false);
    let mut name = call;
    loop {
        let open = name + 1;
        let Some(close) = source.matching_bracket(open) else { return (source.tokens[name].end, true) };
        let is_number = |token: usize| source.get(token).starts_with(|c: char| c.is_ascii_digit());
        match source.get(name) {
            "from" => starts |= is_number(open + 1) && close == open + 2,
            "until" => ends |= is_number(open + 1) && close == open + 2,
            _ => {
                for key in open..close {
                    let is_stated = source.get(key + 1) == ":" && is_number(key + 2);
                    starts |= is_stated && source.get(key) == "from";
                    ends |= is_stated && source.get(key) == "until";
                }
            }
        }
        let next = close + 2;
        let goes_on = source.get(close + 1) == "." && source.get(next + 1) == "(";
        if !goes_on || matches!(source.get(next), "play" | "then") {
            return (source.tokens[close].end, starts && ends);
        }
        name = next;
    }
}

fn add_clip_lengths(view: &View, bytes: &Range<usize>, found: &mut Vec<Value>) {
    let source = view.source;
    let first = source.tokens.partition_point(|token| token.end < bytes.start);
    for token in first..source.tokens.len() {
        let range = &source.tokens[token];
        if range.end > bytes.end {
            return;
        }
        let is_name = is_string(source.get(token))
            && source.token_before(token, 1) == "("
            && source.token_before(token, 2) == "clip";
        if !is_name || source.token_before(token, 3) != "." {
            continue;
        }
        let on = view.types().value_ending_at(token - 3);
        let Some((file, name)) = on.file.zip(source.string_value(token)) else { continue };
        let Some(Contents::Loaded(asset)) = view.contents(&file) else { continue };
        let Some(clip) = asset.clips.iter().find(|clip| clip.name == name) else { continue };
        let tooltip = crate::facts::describe_clip(&asset, clip, view.fps);
        let mut hint = hint(source, range.end, &format!("{:.2} s", clip.duration.as_secs()), String::new());
        hint["tooltip"] = json!({ "kind": "markdown", "value": tooltip });
        found.push(hint);
    }
}
