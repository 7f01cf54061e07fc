//! Events on the timeline: keys, appearing and disappearing actors, starts and ends of constraints, and markers of clips.

use crate::state::keyed::{self, KeyedProperty};
use crate::state::keyed_parts;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_motion::{Repeat, Time};
use choreo_script::{ClipMarkers, Place};
use choreo_session::Scene;
use choreo_stage::{Actor, Channel, Cue, Layer2d, Layer2dContent, Property};
use std::sync::Arc;

/// Largest number of events in a row; more could not be distinguished.
const MAX_EVENTS: usize = 2000;
/// Script name of the property that makes an actor appear and disappear.
const VISIBLE_PROPERTY: &str = "visible";

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// A key.
    Key,
    /// An actor or a 2D layer appears or disappears.
    Visibility,
    /// A constraint (reach, aim, look) begins or ends.
    Constraint,
    /// A marker of a clip.
    Marker,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub at: Time,
    pub kind: EventKind,
    /// Everything that happens at that time, one line each.
    pub label: String,
    pub what: Option<Selected>,
    pub place: Place,
    /// Keys at that time.
    pub keys: Vec<EventKey>,
}

/// A property that has a key.
#[derive(Clone, Debug, PartialEq)]
pub struct EventKey {
    pub what: Selected,
    pub property: String,
    /// Displayed name of the property, after the name of its object if the row has several objects.
    pub label: String,
}

/// Events of a row that are being collected; events at the same time are merged.
#[derive(Default)]
pub(crate) struct EventCollector {
    all: Vec<(Time, EventKind, String, Option<EventKey>)>,
}

impl EventCollector {
    fn add(&mut self, at: Time, kind: EventKind, label: impl Into<String>) {
        if self.all.len() < MAX_EVENTS {
            self.all.push((at, kind, label.into(), None));
        }
    }

    fn add_key(&mut self, at: Time, label: &str, key: Option<&EventKey>) {
        if self.all.len() < MAX_EVENTS {
            self.all.push((at, EventKind::Key, label.to_string(), key.cloned()));
        }
    }

    /// Adds the keys of properties. `prefix`: put before their names.
    pub(crate) fn add_keys(&mut self, all: &[KeyedProperty], prefix: &str) {
        for keyed in all {
            if keyed.property().is_none_or(|property| property == Property::Visible) {
                continue;
            }
            let label = format!("{prefix}{}", keyed.title());
            let key =
                EventKey { what: keyed.what.clone(), property: keyed.name.clone(), label: label.clone() };
            keyed.keys.iter().for_each(|at| self.add_key(*at, &label, Some(&key)));
        }
    }

    /// Adds the keys of a layer's weight, which one of its cues states.
    pub(crate) fn add_layer_weight(&mut self, keys: &Channel, cues: &[Bar], scene: &Scene) {
        let of =
            |bar: &Bar| keyed::properties(scene, &bar.what).into_iter().find(|k| k.name == ".layer_weight");
        let mut all: Vec<KeyedProperty> = cues.iter().filter_map(of).collect();
        all.sort_by_key(|keyed| keyed.written.is_none());
        match all.first().filter(|keyed| keyed.written.is_some()) {
            Some(keyed) => self.add_keys(std::slice::from_ref(keyed), ""),
            None => keys.times.iter().for_each(|at| self.add_key(*at, "layer weight", None)),
        }
    }

    fn add_span(&mut self, what: &str, start: Time, end: Option<Time>) {
        // A state that exists from the start is not an event.
        if start > Time::ZERO {
            self.add(start, EventKind::Constraint, format!("{what} begins"));
        }
        if let Some(end) = end {
            self.add(end, EventKind::Constraint, format!("{what} ends"));
        }
    }

    /// Adds the events of an actor, except for its cues.
    pub(crate) fn add_actor(&mut self, actor: &Actor, scene: &Scene) {
        let what = Selected::Actor(actor.name.clone());
        let joints = keyed_parts::joint_keys_cue(actor).is_some();
        match joints {
            true => self.add_keys(&keyed::properties(scene, &what), ""),
            false => self.add_keys(&keyed::properties_of(scene, &what, actor.channels.iter()), ""),
        }
        let mut seen = actor.visible;
        for channel in actor.channels.iter().filter(|c| c.property == Property::Visible) {
            for (at, value) in channel.times.iter().zip(&channel.values) {
                let now = *value > 0.5;
                if now != seen {
                    let key = EventKey {
                        what: what.clone(),
                        property: VISIBLE_PROPERTY.into(),
                        label: VISIBLE_PROPERTY.into(),
                    };
                    let label = if now { "appears" } else { "goes" };
                    self.all.push((*at, EventKind::Visibility, label.to_string(), Some(key)));
                }
                seen = now;
            }
        }
        actor.constraints.iter().for_each(|goal| self.add_span(goal.kind.name(), goal.start, goal.end));
        actor.look_at.iter().for_each(|look| self.add_span("look", look.start, look.end));
    }

    /// Adds the keys of a cue, and the markers of its clip whenever they are played before `end`.
    pub(crate) fn add_cue(
        &mut self,
        (cue, what): (&Cue, &Selected),
        scene: &Scene,
        end: Time,
        markers: &[ClipMarkers],
    ) {
        if Cue::keyed_options().any(|(_, property)| cue.keys(property).is_some()) {
            let mut keyed = keyed::properties(scene, what);
            keyed.retain(|keyed| keyed.name != ".layer_weight");
            self.add_keys(&keyed, &format!("{} ", cue.clip.name));
        }
        let of = markers.iter().find(|of| Arc::ptr_eq(&of.clip, &cue.clip));
        let Some(ClipMarkers { markers, .. }) = of else { return };
        let (from, to) = cue.trim;
        let length = i128::from((to - from).0);
        for (name, at) in markers.iter().filter(|(_, at)| from <= *at && *at <= to) {
            let into = i128::from((if cue.speed < 0.0 { to - *at } else { *at - from }).0);
            for round in 0..MAX_EVENTS as i128 {
                let played = match cue.repeat {
                    Repeat::Once if round > 0 => break,
                    Repeat::PingPong if round % 2 == 1 => (round + 1) * length - into,
                    _ => round * length + into,
                };
                match cue.time_of_played(played) {
                    Some(when) if when < end && self.all.len() < MAX_EVENTS => {
                        self.add(when, EventKind::Marker, format!("{name} of {}", cue.clip.name));
                    }
                    _ => break,
                }
                if length <= 0 {
                    break;
                }
            }
        }
    }

    /// Events within the scene, sorted by time.
    pub(crate) fn into_events(mut self, length: Time, what: Option<&Selected>, place: &Place) -> Vec<Event> {
        self.all.retain(|(at, ..)| Time::ZERO <= *at && *at <= length);
        self.all.sort_by(|a, b| (a.0, a.1, &a.2).cmp(&(b.0, b.1, &b.2)));
        self.all.dedup();
        let mut events: Vec<Event> = Vec::new();
        for (at, kind, label, key) in self.all {
            match events.last_mut().filter(|last| last.at == at) {
                Some(last) => {
                    last.label += &format!("\n{label}");
                    last.kind = last.kind.max(kind);
                    last.keys.extend(key);
                }
                None => {
                    let (what, place) = (what.cloned(), place.clone());
                    events.push(Event { at, kind, label, what, place, keys: key.into_iter().collect() });
                }
            }
        }
        events
    }
}

/// Events of each keyed property, if there are several.
pub(crate) fn events_by_property(events: &[Event]) -> Vec<(&EventKey, Vec<Event>)> {
    let is_same = |a: &EventKey, b: &EventKey| a.property == b.property && a.what == b.what;
    let keys = || events.iter().flat_map(|event| event.keys.iter().map(move |key| (event, key)));
    let first = keys().next();
    if first.is_none_or(|(_, first)| keys().all(|(_, key)| is_same(first, key))) {
        return Vec::new();
    }
    let mut all: Vec<(&EventKey, Vec<Event>)> = Vec::new();
    for (event, key) in keys() {
        let is_visible = key.property == VISIBLE_PROPERTY;
        let kind = if is_visible { EventKind::Visibility } else { EventKind::Key };
        let (at, what, place) = (event.at, event.what.clone(), event.place.clone());
        let one = Event { at, kind, label: key.label.clone(), what, place, keys: vec![key.clone()] };
        match all.iter_mut().find(|(of, _)| is_same(of, key)) {
            Some((_, events)) => events.push(one),
            None => all.push((key, vec![one])),
        }
    }
    // The order by label does not change while keys are dragged.
    all.sort_by(|(a, _), (b, _)| a.label.cmp(&b.label));
    all
}

/// Keys of all cameras.
pub(crate) fn camera_events(scene: &Scene) -> Vec<Event> {
    let mut gathered = EventCollector::default();
    for camera in &scene.stage.cameras {
        let what = Selected::Camera(camera.name.clone());
        gathered.add_keys(
            &keyed::properties_of(scene, &what, camera.channels.iter()),
            &format!("{} ", camera.name),
        );
    }
    gathered.into_events(scene.stage.settings.length, None, &Place::default())
}

/// Keys of a light.
pub(crate) fn light_events(scene: &Scene, index: usize, place: &Place) -> Vec<Event> {
    let (mut gathered, what) = (EventCollector::default(), Selected::Light(index));
    gathered.add_keys(&keyed::properties_of(scene, &what, scene.stage.lights[index].channels.iter()), "");
    gathered.into_events(scene.stage.settings.length, Some(&what), place)
}

pub(crate) fn sky_events(scene: &Scene, place: &Place) -> Vec<Event> {
    let mut gathered = EventCollector::default();
    let channels = scene.stage.sky.iter().flat_map(|sky| &sky.channels);
    gathered.add_keys(&keyed::properties_of(scene, &Selected::Sky, channels), "sky ");
    gathered.into_events(scene.stage.settings.length, Some(&Selected::Sky), place)
}

/// Keys of some titles, images and panels, given by their indices.
pub(crate) fn title_events(scene: &Scene, numbers: &[usize]) -> Vec<Event> {
    let mut gathered = EventCollector::default();
    for &index in numbers {
        let layer = &scene.stage.layers_2d[index];
        let keyed = keyed::properties_of(scene, &Selected::Title(index), layer.channels.iter());
        gathered.add_keys(&keyed, &format!("{} ", title_label(layer)));
    }
    gathered.into_events(scene.stage.settings.length, None, &Place::default())
}

/// First words of a text in quotes, or the kind of another 2D layer.
pub(crate) fn title_label(layer: &Layer2d) -> String {
    match &layer.content {
        Layer2dContent::Text { words, .. } => {
            let first = words.lines().next().unwrap_or("");
            format!("\u{201c}{}\u{201d}", first.chars().take(40).collect::<String>())
        }
        Layer2dContent::Picture { .. } => "picture".to_string(),
        Layer2dContent::Panel { .. } => "panel".to_string(),
        Layer2dContent::Bars { .. } => "letterbox".to_string(),
    }
}

/// Keys of some effects, given by their indices.
pub(crate) fn effect_events(scene: &Scene, numbers: &[usize]) -> Vec<Event> {
    let mut gathered = EventCollector::default();
    for &index in numbers {
        let used = &scene.stage.effects[index];
        let keyed = keyed::properties_of(
            scene,
            &Selected::Effect(index),
            used.keys.iter().map(|(_, channel)| channel),
        );
        gathered.add_keys(&keyed, &format!("{} ", used.plugin));
    }
    gathered.into_events(scene.stage.settings.length, None, &Place::default())
}
