//! Effects: post-processing of the whole frame, effects on surfaces, and overlays.

use super::keys;
use crate::build::room;
use crate::call::{ApiError, Call, Options, Reply, api, describe, unknown};
use crate::hook;
use crate::suggest::list;
use crate::value::{ActorRef, CameraRef, EffectRef};
use choreo_asset::Asset;
use choreo_plugin::{Effect, Hook, OptionKind, OptionSpec};
use choreo_stage::{Channel, EffectEdit, EffectTarget, EffectUse, Property};
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Adds an effect plugin to the whole frame or to all surfaces. Options are its parameters; `choreo plugins`
    /// lists all effects and their parameters.
    /// - Built in, on the frame: "tonemap" (tone mapping, exposure), "bloom", "motion_blur" (accumulation of
    ///   sub-frames while the shutter is open), "fxaa" (antialiasing), "vignette", "film_grain".
    /// - Built in, on the frame by its depth: "ambient_occlusion", "depth_of_field", "god_rays", "edge_lines", "heat_haze".
    /// - Built in, on surfaces and as overlays: "toon", "fog", "outline", "wireframe", "xray", "views" (normals,
    ///   uvs and more), "skeleton", "grid", "shadow_catcher".
    effect("name, options?") -> Effect = effect;
    /// Sets a parameter of the effect.
    Effect.set("parameter, value") = set, in_frames;
    /// Animates a parameter, a number or a color, with keyframes [[time, value], …]. `how` and easing as in
    /// Actor.key. Flags and texts change at the keyframe.
    Effect.key("parameter, keys, how?") = key;
    /// Sets the start time (default 0).
    Effect.from("time") = from;
    /// Sets the end time.
    Effect.until("time") = until;
    /// Limits the effect to an actor, or to each actor of an array, for effects on surfaces or around actors, such
    /// as "outline"; with #{ material: name or names } only to these materials. Or, for all effects, to the frames
    /// of a camera. Further calls add actors and cameras.
    Effect.on("what, options?") = on;
}

fn effect(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let registry = c.shared.loader.registry();
    let plugin = match registry.use_effect(&name) {
        Ok(Some(plugin)) => plugin,
        Ok(None) => {
            let names: Vec<&str> = registry.effect_names().collect();
            let error = unknown("effect", &name, "", names);
            let hint = format!("{}{}", error.hint.as_deref().unwrap_or_default(), registry.faulty_hint());
            return Err(error.hint(hint));
        }
        Err(fault) => {
            c.shared.loader.note_looked_for(&fault.files);
            return Err(ApiError::new(&fault.text));
        }
    };
    if let Some(file) = plugin.file() {
        c.shared.loader.note_used(&file.path, &file.bytes);
        for beside in &file.beside {
            if let Ok(bytes) = &beside.bytes {
                c.shared.loader.note_used(&beside.path, bytes);
            }
        }
    }
    let mut used = EffectUse { plugin: name.clone(), ..EffectUse::default() };
    let mut names: Vec<&str> = plugin.manifest().options.iter().map(|o| o.name.as_str()).collect();
    let colors: Vec<&str> = names.iter().filter_map(|n| n.strip_suffix(PARTS[0])).collect();
    names.extend(colors);
    let o = c.options(1, &names)?;
    for (key, value) in &o.map {
        for (name, number) in numbers(plugin.as_ref(), key, value)? {
            put(&mut used.parameters, name, number);
        }
    }
    let mut build = c.build();
    room(build.effects.len(), "effects", &c.shared.limits)?;
    build.effects.push(used);
    build.effect_places.push(c.place.clone());
    Ok(Dynamic::from(EffectRef { id: build.effects.len() - 1, plugin: name.into() }))
}

/// Suffixes of the three numbers of a color ([`choreo_plugin::Manifest::color`]).
const PARTS: [&str; 3] = ["_r", "_g", "_b"];

/// A parameter as scripts name it: a color, or one option of the manifest.
enum Parameter<'a> {
    Color([String; 3]),
    One(&'a OptionSpec),
}

fn parameter<'a>(plugin: &'a dyn Effect, name: &str) -> Result<Parameter<'a>, ApiError> {
    let options = &plugin.manifest().options;
    let parts = PARTS.map(|part| format!("{name}{part}"));
    if parts.iter().all(|part| options.iter().any(|o| o.name == *part)) {
        return Ok(Parameter::Color(parts));
    }
    options.iter().find(|o| o.name == name).map(Parameter::One).ok_or_else(|| {
        let place = format!(" of effect \"{}\"", plugin.manifest().name);
        unknown("parameter", name, &place, options.iter().map(|o| o.name.as_str()))
    })
}

/// The numbers of the manifest that a value sets: one, or the three of a color.
fn numbers(plugin: &dyn Effect, name: &str, value: &Dynamic) -> Result<Vec<(String, f64)>, ApiError> {
    let effect = &plugin.manifest().name;
    match parameter(plugin, name)? {
        Parameter::Color(parts) => {
            let color = crate::call::color(value, &format!("{effect}: {name}"))?;
            Ok(parts.into_iter().zip(color.to_array().map(f64::from)).collect())
        }
        Parameter::One(spec) => {
            let number =
                as_number(spec, value).ok_or_else(|| wrong(spec, &format!("{effect}: {name}"), value));
            number.map(|n| vec![(name.to_string(), n)])
        }
    }
}

fn wrong(spec: &OptionSpec, label: &str, value: &Dynamic) -> ApiError {
    ApiError::new(format!("{label} must be {}, got {}", allowed(spec), describe(value))).hint(&spec.about)
}

/// Sets a parameter in a sorted list: the order of calls does not change the image, so it must not change the stage either.
fn put<T>(parameters: &mut Vec<(String, T)>, name: String, value: T) {
    parameters.retain(|(n, _)| *n != name);
    parameters.push((name, value));
    parameters.sort_by(|a, b| a.0.cmp(&b.0));
}

/// The number that an effect receives for a value. A text becomes its index in the list of allowed texts.
fn as_number(spec: &OptionSpec, value: &Dynamic) -> Option<f64> {
    match &spec.kind {
        OptionKind::Number { min, max, .. } => {
            let n = value.as_float().or_else(|_| value.as_int().map(|n| n as f64)).ok()?;
            (*min..=*max).contains(&n).then_some(n)
        }
        OptionKind::Bool { .. } => value.as_bool().ok().map(|b| f64::from(u8::from(b))),
        OptionKind::Text { one_of, .. } => {
            let text = value.clone().into_string().ok()?;
            one_of.iter().position(|o| *o == text).map(|i| i as f64)
        }
    }
}

fn allowed(spec: &OptionSpec) -> String {
    match &spec.kind {
        OptionKind::Number { min, max, .. } => format!("from {min} to {max}"),
        OptionKind::Bool { .. } => "true or false".to_string(),
        OptionKind::Text { one_of, .. } => format!("one of {}", list(one_of.iter().map(String::as_str), 30)),
    }
}

fn plugin(c: &Call, this: &EffectRef) -> Result<Arc<dyn Effect>, ApiError> {
    let found = c.shared.loader.registry().effect(&this.plugin).cloned();
    found.ok_or_else(|| ApiError::new(format!("effect \"{}\" is gone", this.plugin)))
}

fn set(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let new = numbers(plugin(c, &this)?.as_ref(), &c.text(0)?, &c.value(1))?;
    if c.in_frame {
        hook::edit(|edits| {
            let edit = |(parameter, value)| EffectEdit { effect: this.id, parameter, value };
            edits.effects.extend(new.into_iter().map(edit));
        });
        return c.itself();
    }
    let mut build = c.build();
    let used = build.effect(this.id)?;
    new.into_iter().for_each(|(name, number)| put(&mut used.parameters, name, number));
    drop(build);
    c.itself()
}

fn key(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let (plugin, name) = (plugin(c, &this)?, c.text(0)?);
    let named: Vec<(String, Channel)> = match parameter(plugin.as_ref(), &name)? {
        Parameter::Color(parts) => {
            let read = |v: &Dynamic, label: &str| {
                Ok(crate::call::color(v, label)?.to_array()[..3].iter().map(|n| f64::from(*n)).collect())
            };
            let channels = keys::parts(c, Property::Parameter, false, &read)?;
            parts.into_iter().zip(channels).collect()
        }
        Parameter::One(spec) => {
            let step = !matches!(spec.kind, OptionKind::Number { .. });
            let read = |v: &Dynamic, label: &str| {
                as_number(spec, v).map(|n| vec![n]).ok_or_else(|| wrong(spec, label, v))
            };
            let channels = keys::parts(c, Property::Parameter, step, &read)?;
            channels.into_iter().map(|keys| (name.clone(), keys)).collect()
        }
    };
    let mut build = c.build();
    let used = build.effect(this.id)?;
    named.into_iter().for_each(|(name, keys)| put(&mut used.keys, name, keys));
    drop(build);
    c.itself()
}

fn from(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    c.build().effect(this.id)?.start = t;
    c.itself()
}

fn until(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    let start = c.build().effect(this.id)?.start;
    if t < start {
        return Err(super::actor::before_start("until", t, start));
    }
    c.build().effect(this.id)?.end = Some(t);
    c.itself()
}

fn on(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let what = c.value(0);
    let all: Vec<Dynamic> = match what.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(Dynamic::flatten_clone).collect(),
        None => vec![what.flatten_clone()],
    };
    let o = c.options(1, &["material"])?;
    let (mut targets, mut cameras) = (Vec::new(), Vec::new());
    for one in &all {
        if let Some(camera) = one.read_lock::<CameraRef>() {
            cameras.push(camera.0);
        } else if let Some(actor) = one.read_lock::<ActorRef>() {
            targets.extend(targets_of(&actor, &o)?);
        } else {
            return Err(c.wrong(0, "an Actor or an array of them, or a Camera"));
        }
    }
    if all.is_empty() {
        return Err(c.wrong(0, "an Actor or an array of them, or a Camera"));
    }
    if !targets.is_empty() && !plugin(c, &this)?.applies_to_actors() {
        let text = "on: post effects cover the whole image, not single actors";
        return Err(ApiError::new(text).hint("leave .on(…) out, or give it a camera"));
    }
    if targets.iter().any(|t| t.material.is_some()) && plugin(c, &this)?.hook() == Hook::Overlay {
        let text = "on: this effect draws beside actors, not on single materials of them";
        return Err(ApiError::new(text).hint("leave material out"));
    }
    if targets.is_empty() && o.get("material").is_some() {
        return Err(ApiError::new("on: a camera has no material"));
    }
    let mut build = c.build();
    let (actors, seen_by) = (build.actors.len(), build.cameras.len());
    if let Some(gone) = targets.iter().find(|t| t.actor >= actors) {
        return Err(ApiError::new(format!("actor {} is not on this stage", gone.actor)));
    }
    if let Some(gone) = cameras.iter().find(|camera| **camera >= seen_by) {
        return Err(ApiError::new(format!("camera {gone} is not on this stage")));
    }
    let used = build.effect(this.id)?;
    used.on.extend(targets);
    used.cameras.extend(cameras);
    // In whatever order they are named.
    used.on.sort_unstable();
    used.on.dedup();
    used.cameras.sort_unstable();
    used.cameras.dedup();
    drop(build);
    c.itself()
}

/// The targets for an actor: all of it, or the materials that the options name.
fn targets_of(actor: &ActorRef, o: &Options) -> Result<Vec<EffectTarget>, ApiError> {
    let target = |material| EffectTarget { actor: actor.id, material };
    Ok(match named_materials(o, "on", &actor.asset)? {
        None => vec![target(None)],
        Some(materials) => materials.into_iter().map(|m| target(Some(m))).collect(),
    })
}

/// Indices of the materials that the option `material` names, one or several; `None` without the option.
pub(crate) fn named_materials(
    o: &Options,
    function: &str,
    asset: &Asset,
) -> Result<Option<Vec<u32>>, ApiError> {
    let Some(given) = o.get("material") else { return Ok(None) };
    let names: Vec<Dynamic> = match given.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(Dynamic::flatten_clone).collect(),
        None => vec![given.flatten_clone()],
    };
    if names.is_empty() {
        return Err(ApiError::new(format!(
            "{function}: material must be a name or an array of at least one"
        )));
    }
    let mut out = Vec::new();
    for name in names {
        let name = crate::call::text(&name, &format!("{function}: material"))?;
        let before = out.len();
        out.extend((0..).zip(&asset.materials).filter(|(_, m)| m.name == name).map(|(i, _)| i));
        if out.len() == before {
            let place = format!(" of \"{}\"", asset.name);
            return Err(unknown("material", &name, &place, asset.materials.iter().map(|m| m.name.as_str())));
        }
    }
    Ok(Some(out))
}
