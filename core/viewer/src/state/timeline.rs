//! The stage as rows of a sequencer: cues over time, active cameras.

use crate::state::events::{self, Event, Gathered, KeyOf};
use crate::state::selection::Selected;
use choreo_asset::LightKind;
use choreo_motion::{FrameRate, Repeat, Time};
use choreo_script::Place;
use choreo_session::Scene;
use choreo_stage::{Camera, Cue, Layer, Stage};

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
    /// Number of its color: equal for equal clips, and the same whatever else is there.
    pub kind: usize,
    /// How a clip is played, if it is one.
    pub strip: Option<Strip>,
}

impl Bar {
    /// The time at which its clip is over or the next begins: the end that a change of its speed moves.
    pub fn played_until(&self) -> Time {
        self.holds_from.map_or(self.until, |holds| holds.min(self.until))
    }
}

/// How the clip of a bar is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// The part that is played, seconds of the clip.
    pub trim: [f64; 2],
    /// Seconds of the whole clip.
    pub clip: f64,
    /// Clip seconds a second; negative plays backwards.
    pub speed: f64,
    pub repeat: Repeat,
    pub weight: f64,
    /// Keys or freezes say which time of the clip is shown when.
    pub is_keyed: bool,
}

impl Strip {
    fn of(cue: &Cue) -> Strip {
        Strip {
            trim: [cue.trim.0.as_secs(), cue.trim.1.as_secs()],
            clip: cue.clip.duration.as_secs(),
            speed: cue.speed,
            repeat: cue.repeat,
            weight: f64::from(cue.weight),
            is_keyed: !cue.is_even(),
        }
    }

    /// Seconds of the clip before what is played first, in the direction in which it is played.
    pub fn before(&self) -> f64 {
        if self.speed < 0.0 { self.clip - self.trim[1] } else { self.trim[0] }
    }

    /// Seconds that the clip takes once.
    pub fn length(&self) -> f64 {
        (self.trim[1] - self.trim[0]) / self.speed.abs().max(1e-9)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub label: String,
    pub what: Option<Selected>,
    /// Number of the layer of clips, from 0.
    pub layer: Option<usize>,
    pub bars: Vec<Bar>,
    /// Events sorted by time.
    pub events: Vec<Event>,
    pub place: Place,
    /// A row for each keyed property, where this one has keys of several.
    pub parts: Vec<Row>,
}

impl Row {
    /// The name under which the window keeps whether its parts are shown: an actor's with the layer, else the row's own.
    pub(crate) fn key(&self) -> (String, Option<usize>) {
        match &self.what {
            Some(Selected::Actor(name)) => (name.clone(), Some(self.layer.unwrap_or(0))),
            _ => (self.label.clone(), None),
        }
    }

    /// The row with a part for each of its keyed properties.
    fn with_parts(self) -> Row {
        let part = |(key, events): (&KeyOf, Vec<Event>)| Row {
            label: key.label.clone(),
            what: Some(key.what.clone()),
            layer: self.layer,
            bars: Vec::new(),
            events,
            place: self.place.clone(),
            parts: Vec::new(),
        };
        let parts = events::by_property(&self.events).into_iter().map(part).collect();
        Row { parts, ..self }
    }
}

/// The number of a row, or of a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RowNumber {
    pub row: usize,
    pub part: Option<usize>,
}

impl RowNumber {
    /// The number of a whole row.
    pub fn whole(row: usize) -> RowNumber {
        RowNumber { row, part: None }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    pub rows: Vec<Row>,
    /// Names of the lights.
    pub lights: Vec<String>,
    pub markers: Vec<(String, Time)>,
    pub length: Time,
}

impl Timeline {
    pub fn new(scene: &Scene) -> Timeline {
        let (stage, places) = (&scene.stage, &scene.places);
        let length = stage.settings.length;
        let plain = |label: &str, bars: Vec<Bar>, events: Vec<Event>| Row {
            label: label.into(),
            what: None,
            layer: None,
            bars,
            events,
            place: Place::default(),
            parts: Vec::new(),
        };
        let mut rows = vec![plain("camera", cameras(scene), events::of_cameras(scene))];
        for index in 0..stage.actors.len() {
            rows.extend(actor_rows(scene, index));
        }
        if !stage.effects.is_empty() {
            let bars = (0..stage.effects.len()).map(|index| effect(scene, index));
            rows.extend(lanes("effects", bars.collect(), |numbers| events::of_effects(scene, numbers)));
        }
        let mut lights = Vec::new();
        for index in 0..stage.lights.len() {
            let (what, place) =
                (Selected::Light(index), places.lights.get(index).cloned().unwrap_or_default());
            let label = light_name(scene, index, &place);
            lights.push(label.clone());
            let events = events::of_light(scene, index, &place);
            let (bars, parts) = (Vec::new(), Vec::new());
            rows.push(Row { label, what: Some(what), layer: None, bars, events, place, parts });
        }
        let place = places.sky.clone().unwrap_or_default();
        let sky = events::of_sky(scene, &place);
        let what = Some(Selected::Sky);
        let (label, bars, parts) = ("sky".to_string(), Vec::new(), Vec::new());
        if !sky.is_empty() {
            rows.push(Row { label, what, layer: None, bars, events: sky, place, parts });
        }
        if !stage.layers_2d.is_empty() {
            let bars = (0..stage.layers_2d.len()).map(|index| title(scene, index)).collect();
            rows.extend(lanes("titles", bars, |numbers| events::of_titles(scene, numbers)));
        }
        let rows = rows.into_iter().map(Row::with_parts).collect();
        Timeline { rows, lights, markers: stage.markers.clone(), length }
    }

    /// A row or a part of one.
    pub fn row(&self, number: RowNumber) -> Option<&Row> {
        let row = self.rows.get(number.row)?;
        number.part.map_or(Some(row), |part| row.parts.get(part))
    }

    /// The name of a row; that of a part follows its row's.
    pub fn row_name(&self, number: RowNumber) -> String {
        let label = |number| self.row(number).map_or("", |row| &row.label);
        let whole = label(RowNumber::whole(number.row));
        if number.part.is_none() { whole.to_string() } else { format!("{whole}: {}", label(number)) }
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

/// A row for each layer of an actor; one without layers has a row of events alone.
fn actor_rows(scene: &Scene, index: usize) -> Vec<Row> {
    let (stage, places) = (&scene.stage, &scene.places);
    let (actor, length) = (&stage.actors[index], stage.settings.length);
    let what = Some(Selected::Actor(actor.name.clone()));
    let place = places.actors.get(index).cloned().unwrap_or_default();
    let mut gathered = Gathered::default();
    gathered.actor(actor, scene);
    if actor.layers.is_empty() {
        let events = gathered.events(length, what.as_ref(), &place);
        let (label, bars, parts) = (actor.name.clone(), Vec::new(), Vec::new());
        return vec![Row { label, what, layer: None, bars, events, place, parts }];
    }
    let mut rows = Vec::new();
    for (number, layer) in actor.layers.iter().enumerate() {
        let of_layer = places.cues.get(index).and_then(|a| a.get(number));
        let label = if number == 0 { actor.name.clone() } else { format!("{} +{number}", actor.name) };
        let cues = layer.cues.iter().enumerate().map(|(at, cue)| {
            let place = of_layer.and_then(|l| l.get(at)).cloned().unwrap_or_default();
            let kind = kind(&cue.clip.name);
            let what = Selected::Cue { actor: actor.name.clone(), layer: number, cue: at };
            bar(stage, layer, at, cue, what, place, kind)
        });
        let bars: Vec<Bar> = cues.collect();
        if let Some(keys) = &layer.weight_keys {
            gathered.layer_weight(keys, &bars, scene);
        }
        for (cue, bar) in layer.cues.iter().zip(&bars) {
            gathered.cue((cue, &bar.what), scene, bar.end, &places.clip_markers);
        }
        let events = std::mem::take(&mut gathered).events(length, what.as_ref(), &place);
        let (what, place, parts) = (what.clone(), place.clone(), Vec::new());
        rows.push(Row { label, what, layer: Some(number), bars, events, place, parts });
    }
    rows
}

fn effect(scene: &Scene, index: usize) -> Bar {
    let effect = &scene.stage.effects[index];
    let end = effect.end.unwrap_or(scene.stage.settings.length);
    Bar {
        label: effect.plugin.clone(),
        what: Selected::Effect(index),
        start: effect.start,
        end,
        until: end,
        fade_in: Time::ZERO,
        fade_out: Time::ZERO,
        holds_from: None,
        place: scene.places.effects.get(index).cloned().unwrap_or_default(),
        cut: None,
        kind: kind(&effect.plugin),
        strip: None,
    }
}

/// Rows for bars that may overlap: each lies in the first row with room for it, with the events of what it is for. `events`: of bars by their numbers.
fn lanes(label: &str, bars: Vec<Bar>, events: impl Fn(&[usize]) -> Vec<Event>) -> Vec<Row> {
    let mut bars: Vec<(usize, Bar)> = bars.into_iter().enumerate().collect();
    bars.sort_by_key(|(_, bar)| bar.start);
    let mut rows: Vec<(Vec<usize>, Vec<Bar>)> = Vec::new();
    for (index, bar) in bars {
        match rows.iter_mut().find(|(_, row)| row.last().is_none_or(|last| last.end <= bar.start)) {
            Some((numbers, row)) => {
                numbers.push(index);
                row.push(bar);
            }
            None => rows.push((vec![index], vec![bar])),
        }
    }
    let row = |(number, (numbers, bars)): (usize, (Vec<usize>, Vec<Bar>))| Row {
        label: if number == 0 { label.to_string() } else { format!("{label} {}", number + 1) },
        what: None,
        layer: None,
        bars,
        events: events(&numbers),
        place: Place::default(),
        parts: Vec::new(),
    };
    rows.into_iter().enumerate().map(row).collect()
}

/// The name of a light: the one that the script states, else its variable, else its kind and number.
fn light_name(scene: &Scene, index: usize, place: &Place) -> String {
    let light = &scene.stage.lights[index];
    let made_by = match light.light.kind {
        LightKind::Directional => "sun",
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
    };
    if light.name != format!("{made_by} {}", index + 1) {
        return light.name.clone();
    }
    scene.variable(place).unwrap_or_else(|| format!("{} {}", light.light.kind.title(), index + 1))
}

/// The bar of a 2D layer.
fn title(scene: &Scene, index: usize) -> Bar {
    let (length, layer) = (scene.stage.settings.length, &scene.stage.layers_2d[index]);
    let end = layer.end.unwrap_or(length);
    Bar {
        label: events::title(layer),
        what: Selected::Title(index),
        start: layer.start,
        end,
        until: end,
        fade_in: layer.fade,
        fade_out: layer.fade,
        holds_from: None,
        place: scene.places.layers_2d.get(index).cloned().unwrap_or_default(),
        cut: None,
        kind: 5,
        strip: None,
    }
}

/// A number for the color of what has this name, whatever else is on stage (FNV-1a).
pub(crate) fn kind(name: &str) -> usize {
    let hash =
        name.bytes().fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    (hash >> 16) as usize
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
        strip: Some(Strip::of(cue)),
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
    let name = |camera| stage.cameras.get(camera).map_or_else(String::new, |c: &Camera| c.name.clone());
    let bar = |(&(start, camera, place, cut), end): (&Start<'_>, Time)| Bar {
        label: name(camera),
        what: Selected::Camera(name(camera)),
        start,
        end,
        until: end,
        fade_in: Time::ZERO,
        fade_out: Time::ZERO,
        holds_from: None,
        place: place.cloned().unwrap_or_default(),
        cut,
        // Shots beside each other differ.
        kind: camera,
        strip: None,
    };
    starts.iter().zip(ends).map(bar).filter(|bar| bar.end > bar.start).collect()
}
