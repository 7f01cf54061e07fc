//! Animated properties of objects on stage: their values over time as evaluated by the stage, in the units of scripts, and their keys as stated by
//! the script.

use crate::state::keyed_parts;
use crate::state::selection::{Selected, actor};
use choreo_asset::Asset;
use choreo_motion::{FrameRate, Interpolation, Time};
use choreo_plugin::{OptionKind, OptionSpec};
use choreo_script::Place;
use choreo_session::Scene;
use choreo_session::edit::{
    KeyValue, ScriptObject, ScriptText, WrittenKeys, euler_degrees_near, format_number,
};
use choreo_stage::{Channel, Described, EffectUse, Field, FieldType, FieldValue, Property};
use glam::{DQuat, DVec3};

/// A key, identified by its object, its property and its time on stage.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct KeyRef {
    pub what: Selected,
    /// Name of the property in scripts; `morph:NAME` for a morph target, `joint:NAME:PROPERTY` for a joint, `.weight` for keys stated by a method
    /// of a cue.
    pub property: String,
    pub at: Time,
}

/// Kind of a property's value, which decides how it is written and displayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValueKind {
    /// A fixed number of components.
    Numbers(usize),
    Degrees,
    /// Angle about y, or angles about x, y and z, degrees.
    Rotation,
    /// A unit vector.
    Direction,
    /// One factor, or one per axis.
    Scale,
    /// Linear RGB, optionally with alpha.
    Color,
    /// A color that the script states as a color temperature, kelvin.
    Kelvin,
    Flag,
}

/// A property that has keys or can have keys.
#[derive(Clone, Debug)]
pub struct KeyedProperty {
    pub what: Selected,
    /// Name of the property, as in [`KeyRef`].
    pub name: String,
    pub kind: ValueKind,
    pub unit: &'static str,
    /// Smallest and largest value of a component.
    pub range: [f64; 2],
    /// Keys as the stage has them, with easings sampled: one channel, or one per component for an effect. Empty without keys.
    pub(super) channels: Vec<Channel>,
    /// Value without keys.
    pub(super) value_without_keys: Vec<f64>,
    /// Times of the keys that the script states.
    pub keys: Vec<Time>,
    /// Angles about x, y and z at the times `keys`, degrees; each is chosen near the previous one.
    pub(super) angles: Vec<DVec3>,
    /// Keys as parsed from the script. `None` if they are computed, stated elsewhere or shared by several objects.
    pub written: Option<WrittenKeys>,
}

/// A value in the form in which it is written into the script.
#[derive(Clone, Debug, PartialEq)]
pub enum ValueText {
    Point(DVec3),
    /// Components before and after a change.
    Numbers {
        before: Vec<f64>,
        now: Vec<f64>,
    },
    Rotation(DQuat),
    Scale(DVec3),
    Text(String),
    /// The value that the neighboring keys give at that time.
    Interpolated,
}

impl ValueText {
    pub fn value(&self) -> KeyValue<'_> {
        match self {
            ValueText::Point(point) => KeyValue::Point(*point),
            ValueText::Numbers { before, now } => KeyValue::Numbers { before, now },
            ValueText::Rotation(turn) => KeyValue::Turn(*turn),
            ValueText::Scale(scale) => KeyValue::Scale(*scale),
            ValueText::Text(text) => KeyValue::Text(text),
            ValueText::Interpolated => KeyValue::Between,
        }
    }
}

impl KeyedProperty {
    pub fn has_keys(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Number of components of the value.
    pub fn width(&self) -> usize {
        match self.kind {
            ValueKind::Numbers(count) => count,
            ValueKind::Degrees | ValueKind::Flag => 1,
            ValueKind::Rotation if self.is_yaw_only() => 1,
            ValueKind::Scale if self.is_uniform_scale() => 1,
            _ => 3,
        }
    }

    /// Name of a component; empty if the value has only one.
    pub fn part(&self, index: usize) -> &'static str {
        let names = match self.kind {
            _ if self.width() == 1 => return "",
            ValueKind::Color | ValueKind::Kelvin => ["red", "green", "blue", "alpha"],
            _ => ["x", "y", "z", "w"],
        };
        names[index.min(3)]
    }

    /// Displayed name, the same in rows, curves and fields: `morph smile`.
    pub fn title(&self) -> String {
        match (self.name.as_str(), &self.what) {
            ("fov", Selected::Camera(_)) => "field of view".into(),
            (name, _) => name.trim_start_matches('.').replace([':', '_'], " "),
        }
    }

    /// Property of the stage that the keys animate.
    pub(crate) fn property(&self) -> Option<Property> {
        self.channels.first().map(|channel| channel.property)
    }

    /// Interpolation of the keys on stage.
    pub(crate) fn interpolation(&self) -> Option<Interpolation> {
        self.channels.first().map(|channel| channel.interpolation)
    }

    fn is_yaw_only(&self) -> bool {
        let flat = |all: &Option<Vec<f64>>| all.as_ref().is_some_and(|numbers| numbers.len() == 1);
        self.written.as_ref().is_some_and(|written| written.keys.iter().all(|key| flat(&key.numbers)))
    }

    fn is_uniform_scale(&self) -> bool {
        let all = self.channels.first().map_or(&self.value_without_keys, |channel| &channel.values);
        all.chunks_exact(3).all(|v| v[0] == v[1] && v[1] == v[2])
    }

    /// Components of the value at a time.
    pub fn at(&self, time: Time) -> Vec<f64> {
        let Some(channel) = self.channels.first() else { return self.value_without_keys.clone() };
        let raw = channel.at(time).unwrap_or_default();
        match self.kind {
            ValueKind::Numbers(1) | ValueKind::Flag => vec![raw[0]],
            ValueKind::Numbers(_) if self.channels.len() > 1 => {
                let one = |channel: &Channel| channel.at(time).map_or(0.0, |v| v[0]);
                self.channels.iter().map(one).collect()
            }
            ValueKind::Color | ValueKind::Kelvin if self.channels.len() > 1 => {
                let one = |channel: &Channel| channel.at(time).map_or(0.0, |v| v[0]);
                self.channels.iter().map(one).collect()
            }
            ValueKind::Numbers(count) => raw[..count.min(4)].to_vec(),
            ValueKind::Degrees => vec![raw[0].to_degrees()],
            ValueKind::Rotation => self.unwrapped_angles(time, DQuat::from_array(raw)),
            ValueKind::Direction => (DQuat::from_array(raw) * DVec3::NEG_Z).to_array().to_vec(),
            ValueKind::Scale if self.is_uniform_scale() => vec![raw[0]],
            ValueKind::Scale | ValueKind::Kelvin => raw[..3].to_vec(),
            ValueKind::Color => raw[..channel.property.width()].to_vec(),
        }
    }

    /// Angles of a rotation at a time, degrees, with as many full turns as the surrounding keys.
    fn unwrapped_angles(&self, time: Time, rotation: DQuat) -> Vec<f64> {
        let next = self.keys.partition_point(|key| *key <= time);
        let near = match (next.checked_sub(1), self.keys.get(next)) {
            (Some(before), Some(after)) => {
                let (from, to) = (self.keys[before], *after);
                let part = (time - from).as_secs() / (to - from).as_secs();
                self.angles[before].lerp(self.angles[next], part)
            }
            (Some(before), None) => self.angles[before],
            (None, _) => self.angles.first().copied().unwrap_or_default(),
        };
        let angles = euler_degrees_near(rotation, near).to_array();
        if self.is_yaw_only() { vec![angles[1]] } else { angles.to_vec() }
    }

    /// A value in the form in which the script states it. `numbers`: its components at `time`.
    pub fn text(&self, time: Time, numbers: &[f64]) -> ValueText {
        let three = || DVec3::from_slice(&[numbers[0], numbers[1], numbers[2]]);
        let each = || ValueText::Numbers { before: self.at(time), now: numbers.to_vec() };
        match self.kind {
            ValueKind::Kelvin => ValueText::Interpolated,
            ValueKind::Flag => ValueText::Text((numbers[0] > 0.5).to_string()),
            ValueKind::Color => ValueText::Text(color_text(numbers)),
            ValueKind::Scale if numbers.iter().all(|number| *number == numbers[0]) => {
                ValueText::Scale(DVec3::splat(numbers[0]))
            }
            ValueKind::Rotation if numbers.len() > 1 && !self.states_angles() => {
                ValueText::Rotation(choreo_session::edit::rotation_of(three()))
            }
            // A direction need not be a unit vector.
            ValueKind::Direction => ValueText::Point(three()),
            _ => each(),
        }
    }

    /// The value at a time, written without relation to a neighboring key: angles include all turns.
    pub(crate) fn absolute_text(&self, time: Time) -> ValueText {
        match (self.kind, self.at(time).as_slice()) {
            (ValueKind::Rotation, [x, y, z]) if *x == 0.0 && *z == 0.0 => ValueText::Text(format_number(*y)),
            (ValueKind::Rotation, [x, y, z]) => ValueText::Point(DVec3::new(*x, *y, *z)),
            (_, numbers) => self.text(time, numbers),
        }
    }

    /// Whether all keys are written as three angles.
    fn states_angles(&self) -> bool {
        let three = |all: &Option<Vec<f64>>| all.as_ref().is_some_and(|numbers| numbers.len() == 3);
        self.written.as_ref().is_some_and(|written| written.keys.iter().all(|key| three(&key.numbers)))
    }

    /// Whether single components can be edited.
    pub fn has_editable_components(&self) -> bool {
        self.kind != ValueKind::Kelvin
    }

    /// Index of the key within a quarter of a frame of a time.
    pub fn key_at(&self, time: Time, fps: FrameRate) -> Option<usize> {
        let near = Time(fps.time_of(1).0 / 4);
        let distance = |index: &usize| (self.keys[*index] - time).0.abs();
        let index = (0..self.keys.len()).min_by_key(distance)?;
        (distance(&index) <= near.0).then_some(index)
    }

    /// Uses the keys of the script if all of them exist on stage.
    fn with_script_keys(mut self, object: Option<&ScriptObject>, fps: FrameRate) -> KeyedProperty {
        let Some(channel) = self.channels.first() else { return self };
        self.keys = channel.times.clone();
        let written = object.and_then(|object| object.written_keys(&self.name, fps.as_fps()).ok());
        if let Some(written) = written {
            let times = written_times(&written, fps);
            let near = |time: &Time, index: usize| {
                channel.times.get(index).is_some_and(|at| (*at - *time).0.abs() <= 2)
            };
            let has = |time: &Time| {
                let next = channel.times.partition_point(|at| at < time);
                near(time, next) || next > 0 && near(time, next - 1)
            };
            if times.iter().all(has) {
                let uses = object.and_then(|object| object.key_place(&self.name)).map_or(1, |(_, uses)| uses);
                (self.keys, self.written) = (times, Some(written).filter(|_| uses == 1));
            }
        }
        if self.kind == ValueKind::Rotation {
            self.angles = angles_at_keys(channel, &self.keys, self.written.as_ref());
        }
        self
    }
}

/// Times of the script's keys as the stage has them. Of two keys at the same time, the first is a tick earlier.
fn written_times(written: &WrittenKeys, fps: FrameRate) -> Vec<Time> {
    let time = |key: &choreo_session::edit::WrittenKey| match key.frame {
        Some(frame) => fps.time_of(frame as i64),
        None => Time::from_secs(key.secs),
    };
    let mut times: Vec<Time> = written.keys.iter().map(time).collect();
    for index in 1..times.len() {
        if times[index] == times[index - 1] {
            times[index - 1] = times[index] - Time(1);
        }
    }
    times
}

/// Angles at the times `keys`: those that the script states, else followed along the stage's keys from the first one on.
fn angles_at_keys(channel: &Channel, keys: &[Time], written: Option<&WrittenKeys>) -> Vec<DVec3> {
    let rotation = |time| DQuat::from_array(channel.at(time).unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let stated = |index: usize| match written?.keys.get(index)?.numbers.as_deref()? {
        [y] => Some(DVec3::new(0.0, *y, 0.0)),
        [x, y, z] => Some(DVec3::new(*x, *y, *z)),
        _ => None,
    };
    let (mut near, mut from) = (DVec3::ZERO, 0);
    let of_key = |(index, key): (usize, &Time)| {
        // If a key does not state its angles, the turns between it and the previous key are followed.
        while from < channel.times.len() && channel.times[from] <= *key {
            near = euler_degrees_near(rotation(channel.times[from]), near);
            from += 1;
        }
        near = stated(index).unwrap_or_else(|| euler_degrees_near(rotation(*key), near));
        near
    };
    keys.iter().enumerate().map(of_key).collect()
}

/// `"#rrggbb"` of a linear color, with two more digits if it is not opaque.
fn color_text(linear: &[f64]) -> String {
    // sRGB transfer function (IEC 61966-2-1).
    let byte = |value: f64| {
        let value = value.clamp(0.0, 1.0);
        let curve =
            if value <= 0.0031308 { 12.92 * value } else { 1.055 * libm::pow(value, 1.0 / 2.4) - 0.055 };
        (curve * 255.0).round() as u8
    };
    let [r, g, b] = [0, 1, 2].map(|index| byte(linear[index]));
    let alpha = linear.get(3).filter(|alpha| **alpha < 1.0);
    let alpha =
        alpha.map_or(String::new(), |alpha| format!("{:02x}", (alpha.max(0.0) * 255.0).round() as u8));
    format!("\"#{r:02x}{g:02x}{b:02x}{alpha}\"")
}

/// Position in the script of the call that creates an object, and the number of objects that it creates.
pub fn place_of(scene: &Scene, what: &Selected) -> Option<(Place, usize)> {
    let (stage, places) = (&scene.stage, &scene.places);
    let (all, index) = match what {
        Selected::Sky => return places.sky.clone().map(|place| (place, 1)),
        Selected::Cue { actor: name, layer, cue } => {
            let place = places.cues.get(actor(stage, name)?)?.get(*layer)?.get(*cue)?.clone();
            let all = places.cues.iter().flatten().flatten();
            let siblings = all.filter(|other| **other == place).count();
            return Some((place, siblings));
        }
        Selected::Actor(name) => (&places.actors, actor(stage, name)?),
        Selected::Camera(name) => (&places.cameras, stage.cameras.iter().position(|c| c.name == *name)?),
        Selected::Light(index) => (&places.lights, *index),
        Selected::Effect(index) => (&places.effects, *index),
        Selected::Title(index) => (&places.layers_2d, *index),
    };
    let place = all.get(index)?.clone();
    let siblings = all.iter().filter(|other| **other == place).count();
    Some((place, siblings))
}

/// Properties of an object that have keys or can have keys, with the keys that the script states.
pub fn properties(scene: &Scene, what: &Selected) -> Vec<KeyedProperty> {
    properties_in(scene, scene.script_text(), what)
}

/// Properties of an object with these channels. The script is only parsed if the channels may be samples of its keys.
pub(super) fn properties_of<'c>(
    scene: &Scene,
    what: &Selected,
    channels: impl Iterator<Item = &'c Channel> + Clone,
) -> Vec<KeyedProperty> {
    match channels.clone().next() {
        None => Vec::new(),
        Some(_) if may_be_sampled(channels) => properties(scene, what),
        Some(_) => properties_in(scene, None, what),
    }
}

fn properties_in(scene: &Scene, text: Option<&ScriptText>, what: &Selected) -> Vec<KeyedProperty> {
    let stage = &scene.stage;
    let place = place_of(scene, what)
        .filter(|(place, count)| *count == 1 && place.line > 0 && place.file == scene.places.main);
    let object = place.zip(text).and_then(|((place, _), text)| text.object(place.line, place.column).ok());
    let object = object.map(ScriptObject::allow_shared_edits);
    let found = match what {
        Selected::Actor(name) => actor(stage, name).map(|index| {
            let actor = &stage.actors[index];
            let mut all = described_properties(what, actor, &actor.channels, object.as_ref());
            all.extend(morph_properties(what, &actor.asset, &actor.channels));
            all.extend(keyed_parts::joint_properties(what, actor, object.as_ref()));
            all
        }),
        Selected::Camera(name) => stage.cameras.iter().find(|camera| camera.name == *name).map(|camera| {
            let mut all = described_properties(what, camera, &camera.channels, object.as_ref());
            // Either the focal length or the field of view is keyed.
            let in_millimetres = all.iter().any(|p| p.name == "focal_length" && p.has_keys());
            all.retain(|p| p.name != if in_millimetres { "fov" } else { "focal_length" });
            all
        }),
        Selected::Light(index) => stage
            .lights
            .get(*index)
            .map(|light| described_properties(what, light, &light.channels, object.as_ref())),
        Selected::Title(index) => stage
            .layers_2d
            .get(*index)
            .map(|layer| described_properties(what, layer, &layer.channels, object.as_ref())),
        Selected::Effect(index) => {
            stage.effects.get(*index).map(|used| parameter_properties(scene, what, used))
        }
        Selected::Sky => {
            stage.sky.as_ref().map(|sky| described_properties(what, sky, &sky.channels, object.as_ref()))
        }
        Selected::Cue { actor: name, layer, cue } => actor(stage, name)
            .map(|index| keyed_parts::keyed_cue_properties(what, &stage.actors[index], [*layer, *cue])),
    };
    let read = |property: KeyedProperty| property.with_script_keys(object.as_ref(), stage.settings.fps);
    found.unwrap_or_default().into_iter().map(read).collect()
}

/// Properties of a cue that its methods can key, without the keys in the script.
pub fn cue_properties(scene: &Scene, what: &Selected) -> Vec<KeyedProperty> {
    let Selected::Cue { actor: name, layer, cue } = what else { return Vec::new() };
    let Some(index) = actor(&scene.stage, name) else { return Vec::new() };
    let all = keyed_parts::keyed_cue_properties(what, &scene.stage.actors[index], [*layer, *cue]);
    all.into_iter().map(|property| property.with_script_keys(None, scene.stage.settings.fps)).collect()
}

fn described_properties<T: Described>(
    what: &Selected,
    of: &T,
    channels: &[Channel],
    object: Option<&ScriptObject>,
) -> Vec<KeyedProperty> {
    let mut all = Vec::new();
    for field in T::FIELDS.iter().filter(|field| (field.missing_reason)(of).is_none()) {
        let Some((name, property)) = field.keyed else { continue };
        let keys: Vec<Channel> =
            channels.iter().rev().find(|c| c.property == property).cloned().into_iter().collect();
        // The color and the kelvin of a light share one property; only the one that states the keys is listed.
        let mut names = T::FIELDS.iter().filter_map(|other| other.keyed);
        let alias = names.find(|(other, same)| *same == property && *other != name).map(|(other, _)| other);
        let is_named = |name: &str| object.is_some_and(|object| object.has_keys(name));
        if let Some(alias) = alias
            && match keys.is_empty() {
                true => field.field_type == FieldType::Kelvin,
                false => is_named(alias) || (field.field_type == FieldType::Kelvin && !is_named(name)),
            }
        {
            continue;
        }
        all.extend(field_property(what, field, of, name, keys));
    }
    all
}

pub(super) fn field_property<T>(
    what: &Selected,
    field: &Field<T>,
    of: &T,
    name: &str,
    channels: Vec<Channel>,
) -> Option<KeyedProperty> {
    let (kind, unit, range) = match field.field_type {
        FieldType::Number(low, high, unit) => (ValueKind::Numbers(1), unit, [low, high]),
        FieldType::Degrees(low, high) => (ValueKind::Degrees, "°", [low, high]),
        FieldType::Flag => (ValueKind::Flag, "", [0.0, 1.0]),
        FieldType::Color => (ValueKind::Color, "", [0.0, 1.0]),
        FieldType::Kelvin => (ValueKind::Kelvin, "", [0.0, 1.0]),
        FieldType::Point => (ValueKind::Numbers(3), "m", [-1e9, 1e9]),
        FieldType::Direction => (ValueKind::Direction, "", [-1.0, 1.0]),
        FieldType::Rotation => (ValueKind::Rotation, "°", [-1e9, 1e9]),
        FieldType::Scale => (ValueKind::Scale, "", [-1e6, 1e6]),
        FieldType::Pair => (ValueKind::Numbers(2), "", [-1e9, 1e9]),
        FieldType::Time | FieldType::Duration => return None,
    };
    let value_without_keys = match (field.get)(of) {
        FieldValue::Number(n) if kind == ValueKind::Degrees => vec![n.to_degrees()],
        FieldValue::Number(n) => vec![n],
        FieldValue::Flag(on) => vec![f64::from(u8::from(on))],
        FieldValue::Color(c) if c.w == 1.0 => c.truncate().as_dvec3().to_array().to_vec(),
        FieldValue::Color(c) => c.as_dvec4().to_array().to_vec(),
        FieldValue::Vector(v) => v.to_array().to_vec(),
        FieldValue::Rotation(q) => euler_degrees_near(q, DVec3::ZERO).to_array().to_vec(),
        FieldValue::Pair(v) => v.to_array().to_vec(),
        // The value is unknown if there are no keys.
        FieldValue::Unset | FieldValue::Time(_) if channels.is_empty() => return None,
        FieldValue::Unset | FieldValue::Time(_) => Vec::new(),
    };
    Some(KeyedProperty { kind, unit, range, ..named_property(what, name, channels, value_without_keys) })
}

pub(super) fn named_property(
    what: &Selected,
    name: &str,
    channels: Vec<Channel>,
    value_without_keys: Vec<f64>,
) -> KeyedProperty {
    KeyedProperty {
        what: what.clone(),
        name: name.to_string(),
        kind: ValueKind::Numbers(1),
        unit: "",
        range: [-1e9, 1e9],
        channels,
        value_without_keys,
        keys: Vec::new(),
        angles: Vec::new(),
        written: None,
    }
}

/// Weights of morph targets and expressions that have keys, each name once.
fn morph_properties(what: &Selected, asset: &Asset, channels: &[Channel]) -> Vec<KeyedProperty> {
    let mut all: Vec<KeyedProperty> = Vec::new();
    for channel in channels {
        let (name, range) = match channel.property {
            Property::Morph { instance, target } => {
                let instance = asset.instances.get(instance as usize);
                let mesh = instance.and_then(|i| asset.meshes.get(i.mesh as usize));
                let name = mesh.and_then(|mesh| mesh.morph_names.get(target as usize));
                (name.map(|name| format!("morph:{name}")), [-1000.0, 1000.0])
            }
            Property::Expression { expression } => {
                let found = asset.expressions.get(expression as usize);
                (found.map(|found| format!("expression:{}", found.name)), [0.0, 1.0])
            }
            _ => continue,
        };
        let Some(name) = name.filter(|name| all.iter().all(|other| other.name != *name)) else { continue };
        all.push(KeyedProperty { range, ..named_property(what, &name, vec![channel.clone()], Vec::new()) });
    }
    all
}

/// Parameters of an effect.
fn parameter_properties(scene: &Scene, what: &Selected, used: &EffectUse) -> Vec<KeyedProperty> {
    let Some(plugin) = scene.registry.effect(&used.plugin) else { return Vec::new() };
    let given = choreo_render::effect_parameters(plugin, &used.parameters);
    let (mut all, mut first) = (Vec::new(), 0);
    for option in &plugin.manifest().options {
        let numbers = first..first + option.number_count();
        first = numbers.end;
        let value_without_keys =
            given.get(numbers).map(|all| all.iter().map(|n| f64::from(*n)).collect::<Vec<_>>());
        let Some((value_without_keys, kind)) = value_without_keys.zip(value_kind_of(option)) else {
            continue;
        };
        let of_number =
            |name: String| used.keys.iter().find(|(keyed, _)| *keyed == name).map(|(_, c)| c.clone());
        let channels: Vec<Channel> = option.number_names().filter_map(of_number).collect();
        let range = option.bounds().unwrap_or([0.0, 1.0]);
        let is_whole = channels.len() == option.number_count();
        if !is_whole {
            // Some components have keys of their own.
            for (name, channel) in used.keys.iter().filter(|(name, _)| option.number_of(name).is_some()) {
                all.push(KeyedProperty {
                    range,
                    ..named_property(what, name, vec![channel.clone()], Vec::new())
                });
            }
        }
        let channels = if is_whole { channels } else { Vec::new() };
        all.push(KeyedProperty {
            kind,
            range,
            ..named_property(what, &option.name, channels, value_without_keys)
        });
    }
    all
}

fn value_kind_of(option: &OptionSpec) -> Option<ValueKind> {
    Some(match &option.kind {
        OptionKind::Number { .. } | OptionKind::Integer { .. } => ValueKind::Numbers(1),
        OptionKind::Bool { .. } => ValueKind::Flag,
        OptionKind::Color { .. } => ValueKind::Color,
        OptionKind::Vector { .. } => ValueKind::Numbers(option.number_count()),
        _ => return None,
    })
}

/// Whether the stage may hold samples of a property in place of its interpolation, so that only the script has its keys.
fn may_be_sampled<'c>(mut channels: impl Iterator<Item = &'c Channel>) -> bool {
    let sampled = |c: &Channel| c.interpolation == Interpolation::Linear || c.property == Property::Rotation;
    // The color of a light may be stated in kelvin.
    channels.any(|c| c.property == Property::Color || c.times.len() > 2 && sampled(c))
}
