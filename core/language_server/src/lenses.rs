//! Code lenses, which render a frame, open the viewer or run a test; and the time on the timeline that belongs to a line.

use crate::checker::CheckResult;
use crate::commands::{RENDER, TEST, VIEW};
use crate::hints::{LineMap, placed_cues};
use crate::source::Source;
use crate::view::View;
use choreo_motion::Time;
use serde_json::{Value, json};

pub(crate) fn lenses(view: &View, uri: &str, last: Option<&CheckResult>) -> Value {
    let source = view.source;
    let mut found = Vec::new();
    let mut add = |line: usize, title: String, command: &str, mut argument: Value| {
        argument["uri"] = uri.into();
        let at = json!({ "line": line, "character": 0 });
        found.push(json!({
            "range": { "start": at, "end": at },
            "command": { "title": title, "command": command, "arguments": [argument] },
        }));
    };
    for token in 0..source.tokens.len() {
        let is_call = source.get(token + 1) == "(" && source.token_before(token, 1) != ".";
        let line = source.lines.line_of(source.tokens[token].start);
        match source.get(token) {
            "test" if is_call => match source.string_value(token + 2) {
                Some(name) => add(line, "Run test".into(), TEST, json!({ "section": name })),
                // The name of the section is known only at run time.
                None => add(line, "Run the tests of this file".into(), TEST, json!({})),
            },
            "stage" if is_call => {
                add(line, "Render frame".into(), RENDER, json!({ "time": 0.0 }));
                add(line, "Open viewer".into(), VIEW, json!({ "time": 0.0 }));
            }
            _ => {}
        }
    }
    for (line, time) in camera_cuts(source, last) {
        let (secs, title) = (time.as_secs(), format!("{:.2} s", time.as_secs()));
        add(line, format!("Render frame at {title}"), RENDER, json!({ "time": secs }));
        add(line, format!("Open viewer at {title}"), VIEW, json!({ "time": secs }));
    }
    found.into()
}

/// Lines and times of camera cuts, as resolved by the last run.
fn camera_cuts(source: &Source, last: Option<&CheckResult>) -> Vec<(usize, Time)> {
    let Some((stage, places)) = last.and_then(|last| last.stage.as_ref()) else { return Vec::new() };
    let line_map = LineMap::new(source, places);
    let cuts = stage.cuts.iter().zip(&places.cuts);
    let in_script = cuts.filter(|(cut, place)| places.is_main(&place.file) && cut.at < stage.settings.length);
    in_script.filter_map(|(cut, place)| Some((line_map.current_line(place.line)?, cut.at))).collect()
}

/// Time in seconds that belongs to a line. It is the middle of the cue, or the time of the cut, that the nearest line up to this one
/// creates; else 0.
pub(crate) fn time_of_line(source: &Source, last: Option<&CheckResult>, line: usize) -> f64 {
    let Some((stage, places)) = last.and_then(|last| last.stage.as_ref()) else { return 0.0 };
    let line_map = LineMap::new(source, places);
    let length = stage.settings.length;
    let cues = placed_cues(stage, places).into_iter().filter(|cue| places.is_main(&cue.place.file));
    let of_cues = cues.filter_map(|cue| {
        let middle = Time((cue.cue.start.0 + cue.end.min(length).0) / 2);
        Some((line_map.current_line(cue.place.line)?, middle))
    });
    let all = of_cues.chain(camera_cuts(source, last)).filter(|(known, _)| *known <= line);
    // If one line creates several, the first one counts.
    let found = all.fold(None, |best: Option<(usize, Time)>, next| match best {
        Some(best) if best.0 >= next.0 => Some(best),
        _ => Some(next),
    });
    let last_frame = (length.as_secs() - 1.0 / stage.settings.fps.as_fps()).max(0.0);
    found.map_or(0.0, |(_, time)| time.as_secs().clamp(0.0, last_frame))
}
