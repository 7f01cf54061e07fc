//! Events of a stage, as texts with times.

use super::Judgment;
use super::snapshot_cache::SnapshotCache;
use super::text_format::{self, matches_pattern};
use choreo_motion::Time;
use choreo_script::testing::{EventPattern, EventsTest, Expectation, Subject};
use choreo_stage::Stage;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Event {
    pub at: Time,
    pub text: String,
}

/// Events of the whole stage or of one actor, sorted by time. At the same time, ends come before starts.
pub(super) fn list_events(stage: &Stage, subject: Option<Subject>) -> Vec<Event> {
    let mut events: Vec<(Time, bool, String)> = Vec::new();
    for (index, actor) in stage.actors.iter().enumerate() {
        if subject.is_some() && subject != Some(Subject::Actor(index)) {
            continue;
        }
        let who = &actor.name;
        for cue in actor.layers.iter().flat_map(|layer| &layer.cues) {
            let clip = &cue.clip.name;
            events.push((cue.start, true, format!("{who}: {clip} starts")));
            events.extend(cue.end.map(|end| (end, false, format!("{who}: {clip} ends"))));
        }
        for look in &actor.look_at {
            events.push((look.start, true, format!("{who}: look starts")));
            events.extend(look.end.map(|end| (end, false, format!("{who}: look ends"))));
        }
    }
    if subject.is_none() {
        for cut in &stage.cuts {
            let camera = stage.cameras.get(cut.camera).map_or("", |c| c.name.as_str());
            events.push((cut.at, true, format!("cut to {camera}")));
        }
        for effect in &stage.effects {
            events.push((effect.start, true, format!("{} starts", effect.plugin)));
            events.extend(effect.end.map(|end| (end, false, format!("{} ends", effect.plugin))));
        }
    }
    // The sort is stable: events at the same time keep the order of the script.
    events.sort_by_key(|(at, starts, _)| (*at, *starts));
    events.into_iter().map(|(at, _, text)| Event { at, text }).collect()
}

pub(super) fn judge(
    snapshots: &SnapshotCache,
    e: &Expectation,
    subject: Option<Subject>,
    test: &EventsTest,
) -> Judgment {
    let events = list_events(&snapshots.stage, subject);
    let (mut judged, wanted) = match test {
        EventsTest::Exactly(wanted, tolerance) => (judge_exactly(&events, wanted, *tolerance), wanted),
        EventsTest::InOrder(wanted, tolerance) => (judge_in_order(&events, wanted, *tolerance), wanted),
    };
    if e.negated {
        judged.passed = !judged.passed;
        let all: Vec<String> = wanted.iter().map(pattern_text).collect();
        judged.expected = format!("not {}", all.join(", "));
        judged.by = String::new();
    }
    if !judged.passed {
        judged.hint = format!("the events are:\n{}", events_text(&events));
    }
    judged
}

fn events_text(events: &[Event]) -> String {
    const MAX_LISTED: usize = 40;
    let mut lines: Vec<String> = events.iter().take(MAX_LISTED).map(event_text).collect();
    if events.len() > MAX_LISTED {
        lines.push(format!("and {} more", events.len() - MAX_LISTED));
    }
    if lines.is_empty() { "none".into() } else { lines.join("\n") }
}

fn event_text(e: &Event) -> String {
    format!("{} at {}", e.text, text_format::time(e.at))
}

fn pattern_text(p: &EventPattern) -> String {
    match p.at {
        Some(at) => format!("{} at {}", p.text, text_format::time(at)),
        None => p.text.clone(),
    }
}

fn time_error(e: &Event, p: &EventPattern) -> Time {
    p.at.map_or(Time::ZERO, |at| e.at - at)
}

fn is_match(e: &Event, p: &EventPattern, tolerance: Time) -> bool {
    let off = time_error(e, p);
    matches_pattern(&e.text, &p.text) && off <= tolerance && -off <= tolerance
}

/// Time error of an event, such as `0.2 s late`; empty if its name does not match the pattern.
fn delay_text(e: &Event, p: &EventPattern) -> String {
    let off = time_error(e, p);
    match matches_pattern(&e.text, &p.text) && off != Time::ZERO {
        true if off > Time::ZERO => format!("{} late", text_format::time(off)),
        true => format!("{} early", text_format::time(-off)),
        false => String::new(),
    }
}

fn judge_exactly(events: &[Event], wanted: &[EventPattern], tolerance: Time) -> Judgment {
    for i in 0..events.len().max(wanted.len()) {
        match (events.get(i), wanted.get(i)) {
            (Some(e), Some(p)) if is_match(e, p, tolerance) => {}
            (Some(e), Some(p)) => {
                return Judgment::new(false, pattern_text(p), event_text(e)).with_error(delay_text(e, p));
            }
            (Some(e), None) => return Judgment::new(false, "no more events", event_text(e)),
            (None, Some(p)) => return Judgment::new(false, pattern_text(p), "no more events"),
            (None, None) => {}
        }
    }
    let count = match events.len() {
        1 => "1 event".to_string(),
        n => format!("{n} events"),
    };
    Judgment::new(true, count.clone(), count)
}

fn judge_in_order(events: &[Event], wanted: &[EventPattern], tolerance: Time) -> Judgment {
    let mut from = 0;
    for p in wanted {
        match events[from..].iter().position(|e| is_match(e, p, tolerance)) {
            Some(found) => from += found + 1,
            None => {
                // The nearest event of the same name is the most informative one.
                let with_name = events.iter().filter(|e| matches_pattern(&e.text, &p.text));
                let nearest = with_name.min_by_key(|e| time_error(e, p).0.abs());
                let after = match from {
                    0 => String::new(),
                    n => format!(", after {}", event_text(&events[n - 1])),
                };
                let expected = format!("{}{after}", pattern_text(p));
                return match nearest {
                    Some(e) if !is_match(e, p, tolerance) => {
                        Judgment::new(false, expected, event_text(e)).with_error(delay_text(e, p))
                    }
                    Some(e) => {
                        Judgment::new(false, expected, format!("{}, too early in the order", event_text(e)))
                    }
                    None => Judgment::new(false, expected, "no such event"),
                };
            }
        }
    }
    let count = match wanted.len() {
        1 => "1 event".to_string(),
        n => format!("{n} events in order"),
    };
    Judgment::new(true, count.clone(), count)
}
