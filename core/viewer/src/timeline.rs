//! The stage as rows of a sequencer: who plays what when, which camera is on.

use crate::selection::Selected;
use choreo_live::{Problem, Scene};
use choreo_motion::{Repeat, Time};
use choreo_script::Place;
use choreo_stage::{Cue, Layer, Stage};

/// What was made where in the script.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    pub label: String,
    pub what: Selected,
    pub start: Time,
    pub end: Time,
    /// Where what follows begins, under whose fade it goes on; else its end. What a mouse takes hold of.
    pub until: Time,
    pub fade_in: Time,
    pub fade_out: Time,
    /// Where a clip that is played once has come to its end; its last pose is held from there on.
    pub holds_from: Option<Time>,
    pub place: Place,
    /// Of the stage's cuts, where one begins it.
    pub cut: Option<usize>,
    /// For its color: equal for equal clips.
    pub kind: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub label: String,
    pub what: Option<Selected>,
    pub bars: Vec<Bar>,
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
        let mut rows = vec![Row { label: "camera".into(), what: None, bars: cameras(scene) }];
        for (index, actor) in stage.actors.iter().enumerate() {
            let what = Some(Selected::Actor(actor.name.clone()));
            if actor.layers.is_empty() {
                rows.push(Row { label: actor.name.clone(), what, bars: Vec::new() });
                continue;
            }
            for (number, layer) in actor.layers.iter().enumerate() {
                let of_layer = places.cues.get(index).and_then(|a| a.get(number));
                let label =
                    if number == 0 { actor.name.clone() } else { format!("{} +{number}", actor.name) };
                let bars = layer.cues.iter().enumerate().map(|(at, cue)| {
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
                });
                rows.push(Row { label, what: what.clone(), bars: bars.collect() });
            }
        }
        if !stage.effects.is_empty() {
            let length = stage.settings.length;
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
            rows.push(Row { label: "effects".into(), what: None, bars: bars.collect() });
        }
        Timeline { rows, markers: places.markers.clone(), length: stage.settings.length }
    }

    /// Rows and bars that problems are about, by the line of the script that made them.
    pub fn is_marked(bar: &Bar, problems: &[Problem]) -> bool {
        bar.place.line > 0 && problems.iter().any(|p| p.file == bar.place.file && p.line == bar.place.line)
    }

    /// Everything that is on at a time, for the line of the script that is marked.
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

fn bar(stage: &Stage, layer: &Layer, at: usize, cue: &Cue, what: Selected, place: Place, kind: usize) -> Bar {
    let length = stage.settings.length;
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
        fade_in: if cue.inertial > Time::ZERO { cue.inertial } else { cue.fade_in },
        fade_out: cue.fade_out,
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
