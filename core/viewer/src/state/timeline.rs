//! The stage as rows of a sequencer: cues over time, active cameras.

use crate::state::events::{self, Event, Gathered};
use crate::state::selection::Selected;
use choreo_motion::{FrameRate, Repeat, Time};
use choreo_script::Place;
use choreo_session::{Problem, Scene};
use choreo_stage::{Cue, Layer, Stage};

/// A bar of the timeline: something that the script made, and its place there.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    pub label: String,
    pub what: Selected,
    pub start: Time,
    pub end: Time,
    /// Start of what follows, under whose fade it goes on; else its end. The mouse drags it.
    pub until: Time,
    pub fade_in: Time,
    pub fade_out: Time,
    /// Time at which a clip that is played once ends; its last pose is held from there on.
    pub holds_from: Option<Time>,
    pub place: Place,
    /// The cut of the stage that begins it, if any.
    pub cut: Option<usize>,
    /// Index of its color: equal for equal clips.
    pub kind: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub label: String,
    pub what: Option<Selected>,
    pub bars: Vec<Bar>,
    /// Events sorted by time.
    pub events: Vec<Event>,
    pub place: Place,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    pub rows: Vec<Row>,
    pub markers: Vec<(String, Time)>,
    pub length: Time,
}

impl Timeline {
    pub fn new(scene: &Scene) -> Timeline {
        let (stage, places) = (&scene.stage, &scene.places);
        let mut kinds: Vec<String> = Vec::new();
        let length = stage.settings.length;
        let plain = |label: &str, bars: Vec<Bar>, events: Vec<Event>| Row {
            label: label.into(),
            what: None,
            bars,
            events,
            place: Place::default(),
        };
        let mut rows = vec![plain("camera", cameras(scene), events::of_cameras(scene))];
        for (index, actor) in stage.actors.iter().enumerate() {
            let what = Some(Selected::Actor(actor.name.clone()));
            let place = places.actors.get(index).cloned().unwrap_or_default();
            let mut gathered = Gathered::default();
            gathered.actor(actor);
            if actor.layers.is_empty() {
                let events = gathered.events(length, what.as_ref(), &place);
                rows.push(Row { label: actor.name.clone(), what, bars: Vec::new(), events, place });
                continue;
            }
            for (number, layer) in actor.layers.iter().enumerate() {
                let of_layer = places.cues.get(index).and_then(|a| a.get(number));
                let label =
                    if number == 0 { actor.name.clone() } else { format!("{} +{number}", actor.name) };
                let bars: Vec<Bar> = layer
                    .cues
                    .iter()
                    .enumerate()
                    .map(|(at, cue)| {
                        let place = of_layer.and_then(|l| l.get(at)).cloned().unwrap_or_default();
                        let kind = kind(&mut kinds, &cue.clip.name);
                        bar(
                            stage,
                            layer,
                            at,
                            cue,
                            Selected::Cue { actor: actor.name.clone(), layer: number, cue: at },
                            place,
                            kind,
                        )
                    })
                    .collect();
                if let Some(keys) = &layer.weight_keys {
                    gathered.named_keys("layer", "weight", keys);
                }
                for (cue, bar) in layer.cues.iter().zip(&bars) {
                    gathered.cue(cue, bar.end, &places.clip_markers);
                }
                let events = std::mem::take(&mut gathered).events(length, what.as_ref(), &place);
                rows.push(Row { label, what: what.clone(), bars, events, place: place.clone() });
            }
        }
        if !stage.effects.is_empty() {
            let bars = stage.effects.iter().enumerate().map(|(index, e)| Bar {
                label: e.plugin.clone(),
                what: Selected::Effect(index),
                start: e.start,
                end: e.end.unwrap_or(length),
                until: e.end.unwrap_or(length),
                fade_in: Time::ZERO,
                fade_out: Time::ZERO,
                holds_from: None,
                place: places.effects.get(index).cloned().unwrap_or_default(),
                cut: None,
                kind: kind(&mut kinds, &e.plugin),
            });
            rows.push(plain("effects", bars.collect(), events::of_effects(scene)));
        }
        let mut words = Gathered::default();
        words.flats(stage);
        let words = words.events(length, None, &Place::default());
        for (label, events) in [("lights", events::of_lights(scene)), ("words", words)] {
            if !events.is_empty() {
                rows.push(plain(label, Vec::new(), events));
            }
        }
        Timeline { rows, markers: stage.markers.clone(), length }
    }

    /// Whether a problem is about what was made here, by the line of the script.
    pub fn is_marked(place: &Place, problems: &[Problem]) -> bool {
        place.line > 0 && problems.iter().any(|p| p.file == place.file && p.line == place.line)
    }

    /// The time of the next thing that begins, ends or happens after the frame at `now`, or of the last one before it.
    pub fn next(&self, now: Time, fps: FrameRate, back: bool) -> Option<Time> {
        let bars = self.rows.iter().flat_map(|row| &row.bars).flat_map(|bar| [bar.start, bar.until]);
        let events = self.rows.iter().flat_map(|row| &row.events).map(|event| event.at);
        let all = bars.chain(events).chain(self.markers.iter().map(|m| m.1)).filter(|t| *t <= self.length);
        // The frame that is on then.
        let of = |t: &Time| fps.frames_in(*t + Time(1)) - 1;
        let frame = of(&now);
        match back {
            false => all.filter(|t| of(t) > frame).min(),
            true => all.filter(|t| of(t) < frame).max(),
        }
    }

    /// The bars at a time, for the line of the script that is marked.
    pub fn on_at(&self, time: Time) -> impl Iterator<Item = &Bar> {
        self.rows.iter().flat_map(|row| &row.bars).filter(move |bar| bar.start <= time && time < bar.end)
    }
}

fn kind(kinds: &mut Vec<String>, name: &str) -> usize {
    kinds.iter().position(|k| k == name).unwrap_or_else(|| {
        kinds.push(name.to_string());
        kinds.len() - 1
    })
}

/// `at`: index of the cue in its layer.
fn bar(stage: &Stage, layer: &Layer, at: usize, cue: &Cue, what: Selected, place: Place, kind: usize) -> Bar {
    let length = stage.settings.length;
    let is_base = matches!(what, Selected::Cue { layer: 0, .. });
    let end = match layer.cues.get(at + 1) {
        // It goes on playing while the next one fades in over it.
        Some(next) if cue.end.is_none_or(|end| end >= next.start) => next.start + next.fade_in,
        _ => cue.end.unwrap_or(length),
    };
    let end = end.min(length).max(cue.start);
    let until = layer.cues.get(at + 1).map_or(end, |next| next.start).max(cue.start).min(end);
    let holds_from = match cue.repeat {
        Repeat::Once => cue.played_through().filter(|t| *t < end),
        _ => None,
    };
    Bar {
        label: cue.clip.name.clone(),
        what,
        start: cue.start,
        end,
        until,
        fade_in: if cue.inertialization > Time::ZERO { cue.inertialization } else { cue.fade_in },
        // The base layer does not fade out: its last pose is held.
        fade_out: if is_base { Time::ZERO } else { cue.fade_out },
        holds_from,
        place,
        cut: None,
        kind,
    }
}

fn cameras(scene: &Scene) -> Vec<Bar> {
    let (stage, places) = (&scene.stage, &scene.places);
    if stage.cameras.is_empty() {
        return Vec::new();
    }
    let first = (Time::ZERO, 0, places.cameras.first(), None);
    let cuts = stage.cuts.iter().enumerate().map(|(i, c)| (c.at, c.camera, places.cuts.get(i), Some(i)));
    let starts: Vec<_> = std::iter::once(first).chain(cuts).collect();
    let ends = starts.iter().skip(1).map(|s| s.0).chain([stage.settings.length]);
    type Start<'a> = (Time, usize, Option<&'a Place>, Option<usize>);
    let bar = |(&(start, camera, place, cut), end): (&Start<'_>, Time)| Bar {
        label: stage.cameras.get(camera).map_or_else(String::new, |c| c.name.clone()),
        what: Selected::Camera(stage.cameras.get(camera).map_or_else(String::new, |c| c.name.clone())),
        start,
        end,
        until: end,
        fade_in: Time::ZERO,
        fade_out: Time::ZERO,
        holds_from: None,
        place: place.cloned().unwrap_or_default(),
        cut,
        kind: camera,
    };
    starts.iter().zip(ends).map(bar).filter(|bar| bar.end > bar.start).collect()
}
