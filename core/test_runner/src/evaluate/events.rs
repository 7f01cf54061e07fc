//! Events of a stage, as texts with times.

use super::Judged;
use super::snapshot_cache::SnapshotCache;
use super::words::{self, like};
use choreo_motion::Time;
use choreo_script::testing::{EventPattern, EventsTest, Expectation, Subject};
use choreo_stage::Stage;

#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub at: Time,
    pub text: String,
}

/// Events of the whole stage or of one actor, sorted by time. At the same time, ends come before starts.
pub fn list(stage: &Stage, of: Option<Subject>) -> Vec<Event> {
    let mut events: Vec<(Time, bool, String)> = Vec::new();
    for (index, actor) in stage.actors.iter().enumerate() {
        if of.is_some() && of != Some(Subject::Actor(index)) {
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
    if of.is_none() {
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

pub fn judge(snapshots: &SnapshotCache, e: &Expectation, of: Option<Subject>, test: &EventsTest) -> Judged {
    let events = list(&snapshots.stage, of);
    let (mut judged, wanted) = match test {
        EventsTest::Exactly(wanted, tolerance) => (exactly(&events, wanted, *tolerance), wanted),
        EventsTest::InOrder(wanted, tolerance) => (in_order(&events, wanted, *tolerance), wanted),
    };
    if e.negated {
        judged.passed = !judged.passed;
        let all: Vec<String> = wanted.iter().map(pattern).collect();
        judged.expected = format!("not {}", all.join(", "));
        judged.by = String::new();
    }
    if !judged.passed {
        judged.hint = format!("the events are:\n{}", listed(&events));
    }
    judged
}

fn listed(events: &[Event]) -> String {
    const MOST: usize = 40;
    let mut lines: Vec<String> = events.iter().take(MOST).map(event).collect();
    if events.len() > MOST {
        lines.push(format!("and {} more", events.len() - MOST));
    }
    if lines.is_empty() { "none".into() } else { lines.join("\n") }
}

fn event(e: &Event) -> String {
    format!("{} at {}", e.text, words::time(e.at))
}

fn pattern(p: &EventPattern) -> String {
    match p.at {
        Some(at) => format!("{} at {}", p.text, words::time(at)),
        None => p.text.clone(),
    }
}

fn time_error(e: &Event, p: &EventPattern) -> Time {
    p.at.map_or(Time::ZERO, |at| e.at - at)
}

fn is_match(e: &Event, p: &EventPattern, tolerance: Time) -> bool {
    let off = time_error(e, p);
    like(&e.text, &p.text) && off <= tolerance && -off <= tolerance
}

/// Describes the time error of an event with the right name, such as `0.2 s late`.
fn late(e: &Event, p: &EventPattern) -> String {
    let off = time_error(e, p);
    match like(&e.text, &p.text) && off != Time::ZERO {
        true if off > Time::ZERO => format!("{} late", words::time(off)),
        true => format!("{} early", words::time(-off)),
        false => String::new(),
    }
}

fn exactly(events: &[Event], wanted: &[EventPattern], tolerance: Time) -> Judged {
    for i in 0..events.len().max(wanted.len()) {
        match (events.get(i), wanted.get(i)) {
            (Some(e), Some(p)) if is_match(e, p, tolerance) => {}
            (Some(e), Some(p)) => return Judged::new(false, pattern(p), event(e)).by(late(e, p)),
            (Some(e), None) => return Judged::new(false, "no more events", event(e)),
            (None, Some(p)) => return Judged::new(false, pattern(p), "no more events"),
            (None, None) => {}
        }
    }
    let count = format!("{} events", events.len());
    Judged::new(true, count.clone(), count)
}

fn in_order(events: &[Event], wanted: &[EventPattern], tolerance: Time) -> Judged {
    let mut from = 0;
    for p in wanted {
        match events[from..].iter().position(|e| is_match(e, p, tolerance)) {
            Some(found) => from += found + 1,
            None => {
                // The nearest event of the same name is the most informative one.
                let same = events.iter().filter(|e| like(&e.text, &p.text));
                let nearest = same.min_by_key(|e| time_error(e, p).0.abs());
                let after = match from {
                    0 => String::new(),
                    n => format!(", after {}", event(&events[n - 1])),
                };
                let expected = format!("{}{after}", pattern(p));
                return match nearest {
                    Some(e) if !is_match(e, p, tolerance) => {
                        Judged::new(false, expected, event(e)).by(late(e, p))
                    }
                    Some(e) => Judged::new(false, expected, format!("{}, too early in the order", event(e))),
                    None => Judged::new(false, expected, "no such event"),
                };
            }
        }
    }
    let count = format!("{} events in order", wanted.len());
    Judged::new(true, count.clone(), count)
}
