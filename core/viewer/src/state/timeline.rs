//! The stage as rows of a sequencer: cues, active cameras and other objects over time.

use crate::state::events::{self, Event, EventCollector, EventKey};
use crate::state::selection::Selected;
use choreo_asset::LightKind;
use choreo_motion::{FrameRate, Repeat, Time};
use choreo_script::Place;
use choreo_session::Scene;
use choreo_stage::{Camera, Cue, Layer, Stage};

/// A bar of the timeline, which stands for an object created by the script.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    pub label: String,
    pub what: Selected,
    pub start: Time,
    pub end: Time,
    /// The end that the mouse drags: the start of the next bar, under whose fade-in this one continues; else `end`.
    pub draggable_end: Time,
    pub fade_in: Time,
    pub fade_out: Time,
    /// Time at which a clip played once ends; its last pose is held from then on.
    pub holds_from: Option<Time>,
    pub place: Place,
    /// Index of the stage's cut that begins the bar, if one does.
    pub cut: Option<usize>,
    /// Number that selects the color: equal for equal clips, and independent of other objects.
    pub color_index: usize,
    /// Playback of the clip, if the bar is one.
    pub strip: Option<Strip>,
}

impl Bar {
    /// Whether the next bar of the row begins where this one ends. Bars of cameras do not count, since their boundary is a cut.
    pub fn meets(&self, next: &Bar) -> bool {
        next.cut.is_none() && self.draggable_end == next.start
    }

    /// End of playback, where the last pose begins to be held or the next clip begins; a change of the speed moves it.
    pub fn played_until(&self) -> Time {
        self.holds_from.map_or(self.draggable_end, |holds| holds.min(self.draggable_end))
    }
}

/// Playback of a bar's clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// Trimmed part, clip seconds.
    pub trim: [f64; 2],
    /// Length of the whole clip, seconds.
    pub clip_secs: f64,
    /// Clip seconds per second; negative plays backwards.
    pub speed: f64,
    pub repeat: Repeat,
    pub weight: f64,
    /// Whether keys or freezes determine the displayed time of the clip.
    pub is_keyed: bool,
}

impl Strip {
    fn of(cue: &Cue) -> Strip {
        Strip {
            trim: [cue.trim.0.as_secs(), cue.trim.1.as_secs()],
            clip_secs: cue.clip.duration.as_secs(),
            speed: cue.speed,
            repeat: cue.repeat,
            weight: f64::from(cue.weight),
            is_keyed: !cue.plays_at_constant_speed(),
        }
    }

    /// Clip seconds before the trimmed part, in playing direction.
    pub fn secs_before_trim(&self) -> f64 {
        if self.speed < 0.0 { self.clip_secs - self.trim[1] } else { self.trim[0] }
    }

    /// Duration of one round, seconds.
    pub fn round_secs(&self) -> f64 {
        (self.trim[1] - self.trim[0]) / self.speed.abs().max(1e-9)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub label: String,
    pub what: Option<Selected>,
    /// Index of the actor's layer.
    pub layer: Option<usize>,
    pub bars: Vec<Bar>,
    /// Events, sorted by time.
    pub events: Vec<Event>,
    pub place: Place,
    /// A row for each keyed property, if there are several.
    pub parts: Vec<Row>,
}

impl Row {
    /// Key of the row in [`crate::app::Toggles::expanded`]: name of the actor and the layer, else the label of the row.
    pub(crate) fn key(&self) -> (String, Option<usize>) {
        match &self.what {
            Some(Selected::Actor(name)) => (name.clone(), Some(self.layer.unwrap_or(0))),
            _ => (self.label.clone(), None),
        }
    }

    /// Adds a part for each keyed property.
    fn with_parts(self) -> Row {
        let part = |(key, events): (&EventKey, Vec<Event>)| Row {
            label: key.label.clone(),
            what: Some(key.what.clone()),
            layer: self.layer,
            bars: Vec::new(),
            events,
            place: self.place.clone(),
            parts: Vec::new(),
        };
        let parts = events::events_by_property(&self.events).into_iter().map(part).collect();
        Row { parts, ..self }
    }
}

/// Index of a row, or of a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RowNumber {
    pub row: usize,
    pub part: Option<usize>,
}

impl RowNumber {
    /// A row as a whole.
    pub fn whole(row: usize) -> RowNumber {
        RowNumber { row, part: None }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    pub rows: Vec<Row>,
    /// Displayed names of the lights.
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
        let mut rows = vec![plain("camera", camera_bars(scene), events::camera_events(scene))];
        for index in 0..stage.actors.len() {
            rows.extend(actor_rows(scene, index));
        }
        if !stage.effects.is_empty() {
            let bars = (0..stage.effects.len()).map(|index| effect_bar(scene, index));
            rows.extend(layer_rows("effects", bars.collect(), |numbers| {
                events::effect_events(scene, numbers)
            }));
        }
        let mut lights = Vec::new();
        for index in 0..stage.lights.len() {
            let (what, place) =
                (Selected::Light(index), places.lights.get(index).cloned().unwrap_or_default());
            let label = light_name(scene, index, &place);
            lights.push(label.clone());
            let events = events::light_events(scene, index, &place);
            let (bars, parts) = (Vec::new(), Vec::new());
            rows.push(Row { label, what: Some(what), layer: None, bars, events, place, parts });
        }
        let place = places.sky.clone().unwrap_or_default();
        let sky = events::sky_events(scene, &place);
        let what = Some(Selected::Sky);
        let (label, bars, parts) = ("sky".to_string(), Vec::new(), Vec::new());
        if !sky.is_empty() {
            rows.push(Row { label, what, layer: None, bars, events: sky, place, parts });
        }
        if !stage.layers_2d.is_empty() {
            let bars = (0..stage.layers_2d.len()).map(|index| title_bar(scene, index)).collect();
            rows.extend(layer_rows("titles", bars, |numbers| events::title_events(scene, numbers)));
        }
        let rows = rows.into_iter().map(Row::with_parts).collect();
        Timeline { rows, lights, markers: stage.markers.clone(), length }
    }

    /// A row or a part of one.
    pub fn row(&self, number: RowNumber) -> Option<&Row> {
        let row = self.rows.get(number.row)?;
        number.part.map_or(Some(row), |part| row.parts.get(part))
    }

    /// Name of a row; that of a part follows the name of its row.
    pub fn row_name(&self, number: RowNumber) -> String {
        let label = |number| self.row(number).map_or("", |row| &row.label);
        let whole = label(RowNumber::whole(number.row));
        if number.part.is_none() { whole.to_string() } else { format!("{whole}: {}", label(number)) }
    }

    /// Time of the next start, end, event or marker after the frame at `now`, or of the previous one before it if `back`.
    pub fn next_time(&self, now: Time, fps: FrameRate, back: bool) -> Option<Time> {
        let bars = self.rows.iter().flat_map(|row| &row.bars).flat_map(|bar| [bar.start, bar.draggable_end]);
        let events = self.rows.iter().flat_map(|row| &row.events).map(|event| event.at);
        let all = bars.chain(events).chain(self.markers.iter().map(|m| m.1)).filter(|t| *t <= self.length);
        // Number of the frame that is displayed at that time.
        let of = |t: &Time| fps.frames_in(*t + Time(1)) - 1;
        let frame = of(&now);
        match back {
            false => all.filter(|t| of(t) > frame).min(),
            true => all.filter(|t| of(t) < frame).max(),
        }
    }

    /// Bars that are active at a time, whose lines in the script are highlighted.
    pub fn bars_at(&self, time: Time) -> impl Iterator<Item = &Bar> {
        self.rows.iter().flat_map(|row| &row.bars).filter(move |bar| bar.start <= time && time < bar.end)
    }
}

/// Rows of an actor, one for each layer; an actor without layers has one row of events.
fn actor_rows(scene: &Scene, index: usize) -> Vec<Row> {
    let (stage, places) = (&scene.stage, &scene.places);
    let (actor, length) = (&stage.actors[index], stage.settings.length);
    let what = Some(Selected::Actor(actor.name.clone()));
    let place = places.actors.get(index).cloned().unwrap_or_default();
    let mut gathered = EventCollector::default();
    gathered.add_actor(actor, scene);
    if actor.layers.is_empty() {
        let events = gathered.into_events(length, what.as_ref(), &place);
        let (label, bars, parts) = (actor.name.clone(), Vec::new(), Vec::new());
        return vec![Row { label, what, layer: None, bars, events, place, parts }];
    }
    let mut rows = Vec::new();
    for (number, layer) in actor.layers.iter().enumerate() {
        let of_layer = places.cues.get(index).and_then(|a| a.get(number));
        let label = if number == 0 { actor.name.clone() } else { format!("{} +{number}", actor.name) };
        let cues = layer.cues.iter().enumerate().map(|(at, cue)| {
            let place = of_layer.and_then(|l| l.get(at)).cloned().unwrap_or_default();
            let color_index = color_index(&cue.clip.name);
            let what = Selected::Cue { actor: actor.name.clone(), layer: number, cue: at };
            cue_bar(stage, layer, at, cue, what, place, color_index)
        });
        let bars: Vec<Bar> = cues.collect();
        if let Some(keys) = &layer.weight_keys {
            gathered.add_layer_weight(keys, &bars, scene);
        }
        for (cue, bar) in layer.cues.iter().zip(&bars) {
            gathered.add_cue((cue, &bar.what), scene, bar.end, &places.clip_markers);
        }
        let events = std::mem::take(&mut gathered).into_events(length, what.as_ref(), &place);
        let (what, place, parts) = (what.clone(), place.clone(), Vec::new());
        rows.push(Row { label, what, layer: Some(number), bars, events, place, parts });
    }
    rows
}

fn effect_bar(scene: &Scene, index: usize) -> Bar {
    let effect = &scene.stage.effects[index];
    let end = effect.end.unwrap_or(scene.stage.settings.length);
    Bar {
        label: effect.plugin.clone(),
        what: Selected::Effect(index),
        start: effect.start,
        end,
        draggable_end: end,
        fade_in: Time::ZERO,
        fade_out: Time::ZERO,
        holds_from: None,
        place: scene.places.effects.get(index).cloned().unwrap_or_default(),
        cut: None,
        color_index: color_index(&effect.plugin),
        strip: None,
    }
}

/// Rows for bars that may overlap: each bar is put into the first row with room for it. `events`: events of the bars with these indices.
fn layer_rows(label: &str, bars: Vec<Bar>, events: impl Fn(&[usize]) -> Vec<Event>) -> Vec<Row> {
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

/// Displayed name of a light: the one that the script states, else its variable, else its kind and number.
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
fn title_bar(scene: &Scene, index: usize) -> Bar {
    let (length, layer) = (scene.stage.settings.length, &scene.stage.layers_2d[index]);
    let end = layer.end.unwrap_or(length);
    Bar {
        label: events::title_label(layer),
        what: Selected::Title(index),
        start: layer.start,
        end,
        draggable_end: end,
        fade_in: layer.fade,
        fade_out: layer.fade,
        holds_from: None,
        place: scene.places.layers_2d.get(index).cloned().unwrap_or_default(),
        cut: None,
        color_index: 5,
        strip: None,
    }
}

/// Number that selects a color for a name, independent of other names (FNV-1a hash).
pub(crate) fn color_index(name: &str) -> usize {
    let hash =
        name.bytes().fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    (hash >> 16) as usize
}

/// The bar of a cue. `at`: index of the cue in its layer.
fn cue_bar(
    stage: &Stage,
    layer: &Layer,
    at: usize,
    cue: &Cue,
    what: Selected,
    place: Place,
    color_index: usize,
) -> Bar {
    let length = stage.settings.length;
    let is_base = matches!(what, Selected::Cue { layer: 0, .. });
    let end = match layer.cues.get(at + 1) {
        // The clip continues while the next one fades in.
        Some(next) if cue.end.is_none_or(|end| end >= next.start) => next.start + next.fade_in,
        _ => cue.end.unwrap_or(length),
    };
    let end = end.min(length).max(cue.start);
    let until = layer.cues.get(at + 1).map_or(end, |next| next.start).max(cue.start).min(end);
    let holds_from = match cue.repeat {
        Repeat::Once => cue.first_play_end().filter(|t| *t < end),
        _ => None,
    };
    Bar {
        label: cue.clip.name.clone(),
        what,
        start: cue.start,
        end,
        draggable_end: until,
        fade_in: if cue.inertialization > Time::ZERO { cue.inertialization } else { cue.fade_in },
        // The base layer does not fade out, but holds its last pose.
        fade_out: if is_base { Time::ZERO } else { cue.fade_out },
        holds_from,
        place,
        cut: None,
        color_index,
        strip: Some(Strip::of(cue)),
    }
}

fn camera_bars(scene: &Scene) -> Vec<Bar> {
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
        draggable_end: end,
        fade_in: Time::ZERO,
        fade_out: Time::ZERO,
        holds_from: None,
        place: place.cloned().unwrap_or_default(),
        cut,
        // Adjacent shots have different colors.
        color_index: camera,
        strip: None,
    };
    starts.iter().zip(ends).map(bar).filter(|bar| bar.end > bar.start).collect()
}
