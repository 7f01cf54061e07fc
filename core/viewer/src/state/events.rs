//! Events at a time: keys, actors that appear and go, what an actor begins to do, named times of clips.

use crate::state::selection::Selected;
use choreo_motion::{Repeat, Time};
use choreo_script::{ClipMarkers, Place};
use choreo_session::Scene;
use choreo_stage::{Actor, Channel, Cue, Layer2dContent, Property, Stage};
use std::sync::Arc;

/// Events in one row at most; further ones would not be told apart.
const MOST: usize = 2000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// A value of its own is given for this time.
    Key,
    /// An actor or a 2D layer appears or goes.
    Entrance,
    /// A reach, an aim, a look begins or ends.
    Body,
    /// A named time of a clip.
    Mark,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub at: Time,
    pub kind: EventKind,
    /// Everything that happens at that time, one line each.
    pub label: String,
    pub what: Option<Selected>,
    pub place: Place,
}

/// The events of one row, gathered: those of one time are one.
#[derive(Default)]
pub(crate) struct Gathered {
    all: Vec<(Time, EventKind, String)>,
}

impl Gathered {
    fn add(&mut self, at: Time, kind: EventKind, label: impl Into<String>) {
        if self.all.len() < MOST {
            self.all.push((at, kind, label.into()));
        }
    }

    /// Each key of a property; `of`: what of, before its name.
    pub fn keys(&mut self, channels: &[Channel], of: &str) {
        for channel in channels {
            if channel.property == Property::Visible {
                continue;
            }
            let name = name(channel.property);
            channel.times.iter().for_each(|at| self.add(*at, EventKind::Key, format!("{of}{name}")));
        }
    }

    pub(crate) fn named_keys(&mut self, of: &str, name: &str, channel: &Channel) {
        channel.times.iter().for_each(|at| self.add(*at, EventKind::Key, format!("{of} {name}")));
    }

    fn spans(&mut self, what: &str, start: Time, end: Option<Time>) {
        // A state from the start is no event.
        if start > Time::ZERO {
            self.add(start, EventKind::Body, format!("{what} begins"));
        }
        if let Some(end) = end {
            self.add(end, EventKind::Body, format!("{what} ends"));
        }
    }

    /// Events of an actor, without its cues.
    pub fn actor(&mut self, actor: &Actor) {
        self.keys(&actor.channels, "");
        let mut seen = actor.visible;
        for channel in actor.channels.iter().filter(|c| c.property == Property::Visible) {
            for (at, value) in channel.times.iter().zip(&channel.values) {
                let now = *value > 0.5;
                if now != seen {
                    self.add(*at, EventKind::Entrance, if now { "appears" } else { "goes" });
                }
                seen = now;
            }
        }
        actor.constraints.iter().for_each(|goal| self.spans(goal.kind.name(), goal.start, goal.end));
        actor.look_at.iter().for_each(|look| self.spans("look", look.start, look.end));
    }

    /// Named times of its clip, each time that it gets there until `end`.
    pub fn cue(&mut self, cue: &Cue, end: Time, markers: &[ClipMarkers]) {
        let weights = cue.weight_keys.as_deref();
        weights.into_iter().for_each(|keys| self.named_keys(&cue.clip.name, "weight", keys));
        let of = markers.iter().find(|of| Arc::ptr_eq(&of.clip, &cue.clip));
        let Some(ClipMarkers { markers, .. }) = of else { return };
        let (from, to) = cue.trim;
        let length = i128::from((to - from).0);
        for (name, at) in markers.iter().filter(|(_, at)| from <= *at && *at <= to) {
            let into = i128::from((if cue.speed < 0.0 { to - *at } else { *at - from }).0);
            for round in 0..MOST as i128 {
                let played = match cue.repeat {
                    Repeat::Once if round > 0 => break,
                    Repeat::PingPong if round % 2 == 1 => (round + 1) * length - into,
                    _ => round * length + into,
                };
                match cue.time_of_played(played) {
                    Some(when) if when < end && self.all.len() < MOST => {
                        self.add(when, EventKind::Mark, format!("{name} of {}", cue.clip.name));
                    }
                    _ => break,
                }
                if length <= 0 {
                    break;
                }
            }
        }
    }

    /// Words and images that come and go.
    pub fn flats(&mut self, stage: &Stage) {
        for flat in &stage.layers_2d {
            let what = match &flat.content {
                Layer2dContent::Text { words, .. } => {
                    let first = words.lines().next().unwrap_or("");
                    format!("\u{201c}{}\u{201d}", first.chars().take(40).collect::<String>())
                }
                Layer2dContent::Picture { .. } => "picture".to_string(),
                Layer2dContent::Panel { .. } => "panel".to_string(),
                Layer2dContent::Bars { .. } => "letterbox".to_string(),
            };
            if flat.start > Time::ZERO {
                self.add(flat.start, EventKind::Entrance, format!("{what} appears"));
            }
            if let Some(end) = flat.end {
                self.add(end, EventKind::Entrance, format!("{what} goes"));
            }
            self.keys(&flat.channels, &format!("{what} "));
        }
    }

    /// Within the scene, in the order of time.
    pub fn events(mut self, length: Time, what: Option<&Selected>, place: &Place) -> Vec<Event> {
        self.all.retain(|(at, ..)| Time::ZERO <= *at && *at <= length);
        self.all.sort();
        self.all.dedup();
        let mut events: Vec<Event> = Vec::new();
        for (at, kind, label) in self.all {
            match events.last_mut().filter(|last| last.at == at) {
                Some(last) => {
                    last.label += &format!("\n{label}");
                    last.kind = last.kind.max(kind);
                }
                None => events.push(Event { at, kind, label, what: what.cloned(), place: place.clone() }),
            }
        }
        events
    }
}

/// Events of cameras, lights and effects: rows of things that have keys.
pub(crate) fn of_cameras(scene: &Scene) -> Vec<Event> {
    let mut gathered = Gathered::default();
    for camera in &scene.stage.cameras {
        gathered.keys(&camera.channels, &format!("{} ", camera.name));
    }
    gathered.events(scene.stage.settings.length, None, &Place::default())
}

pub(crate) fn of_lights(scene: &Scene) -> Vec<Event> {
    let mut gathered = Gathered::default();
    for (index, light) in scene.stage.lights.iter().enumerate() {
        let name = if light.name.is_empty() { format!("light {}", index + 1) } else { light.name.clone() };
        gathered.keys(&light.channels, &format!("{name} "));
    }
    if let Some(sky) = &scene.stage.sky {
        gathered.keys(&sky.channels, "sky ");
    }
    gathered.events(scene.stage.settings.length, None, &Place::default())
}

pub fn of_effects(scene: &Scene) -> Vec<Event> {
    let mut gathered = Gathered::default();
    for used in &scene.stage.effects {
        used.keys.iter().for_each(|(name, channel)| gathered.named_keys(&used.plugin, name, channel));
    }
    gathered.events(scene.stage.settings.length, None, &Place::default())
}

fn name(property: Property) -> &'static str {
    match property {
        Property::Translation => "position",
        Property::Rotation => "rotation",
        Property::Scale => "scale",
        Property::Visible => "visible",
        Property::Tint => "tint",
        Property::Morph { .. } => "morph",
        Property::Expression { .. } => "expression",
        Property::FieldOfView => "field of view",
        Property::FocalLength => "focal length",
        Property::Intensity => "intensity",
        Property::Color => "color",
        Property::Weight => "weight",
        Property::Speed => "speed",
        Property::ClipTime => "clip time",
        Property::Parameter => "parameter",
        Property::Turn => "turn",
        Property::Opacity => "opacity",
        Property::Range => "range",
        Property::Cone => "cone",
        Property::LineWidth => "width",
        Property::Copies => "count",
    }
}
