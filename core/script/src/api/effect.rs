//! Effects: what happens to the whole picture after the scene is drawn.

use crate::build::room;
use crate::call::{ApiError, Call, Def, Gives, Reply, describe, unknown};
use crate::suggest::list;
use crate::value::*;
use choreo_motion::Time;
use choreo_plugin::{OptionKind, OptionSpec};
use choreo_stage::EffectUse;
use rhai::Dynamic;

const THIS: Gives = Gives::Itself;

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::None,
        "effect",
        "name, options?",
        Gives::A(Kind::Effect),
        "An effect plugin over the whole picture; options are its parameters.",
        effect,
    ),
    Def::new(Kind::Effect, "set", "parameter, value", THIS, "Sets a parameter of the effect.", set),
    Def::new(Kind::Effect, "from", "time", THIS, "When it begins.", from),
    Def::new(Kind::Effect, "until", "time", THIS, "When it is over.", until),
    Def::new(
        Kind::Effect,
        "on",
        "actor",
        THIS,
        "Only on an actor, or on each of an array of them; for effects on surfaces, such as outline. Those over the whole picture refuse it.",
        on,
    ),
];

fn effect(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let effects = c.shared.loader.registry().effects();
    let Some(plugin) = c.shared.loader.registry().effect(&name) else {
        return Err(unknown("effect", &name, "", effects.iter().map(|e| e.manifest().name.as_str())));
    };
    if let Some(file) = plugin.file() {
        c.shared.loader.note_used(&file.path, file.text.as_bytes());
    }
    let mut used =
        EffectUse { plugin: name, parameters: Vec::new(), start: Time::ZERO, end: None, actors: Vec::new() };
    let mut names: Vec<&str> = plugin.manifest().options.iter().map(|o| o.name.as_str()).collect();
    let colors: Vec<&str> = names.iter().filter_map(|n| n.strip_suffix(PARTS[0])).collect();
    names.extend(colors);
    let o = c.options(1, &names)?;
    for (key, value) in &o.map {
        set_parameter(c, &mut used, key, value)?;
    }
    let mut build = c.build();
    room(build.effects.len(), "effects", &c.shared.limits)?;
    build.effects.push(used);
    build.effect_places.push(c.place.clone());
    Ok(Dynamic::from(EffectRef(build.effects.len() - 1)))
}

/// What the three numbers of a color end with ([`choreo_plugin::Manifest::color`]).
const PARTS: [&str; 3] = ["_r", "_g", "_b"];

fn set_parameter(c: &Call, used: &mut EffectUse, name: &str, value: &Dynamic) -> Result<(), ApiError> {
    let Some(plugin) = c.shared.loader.registry().effect(&used.plugin) else { return Ok(()) };
    let options = &plugin.manifest().options;
    let parts = PARTS.map(|part| format!("{name}{part}"));
    if parts.iter().all(|part| options.iter().any(|o| o.name == *part)) {
        let color = crate::call::color(value, &format!("{}: {name}", used.plugin))?;
        used.parameters.retain(|(n, _)| !parts.contains(n));
        let linear = color.to_array().map(f64::from);
        used.parameters.extend(parts.into_iter().zip(linear));
        used.parameters.sort_by(|a, b| a.0.cmp(&b.0));
        return Ok(());
    }
    let Some(spec) = options.iter().find(|o| o.name == name) else {
        let place = format!(" of effect \"{}\"", used.plugin);
        return Err(unknown("parameter", name, &place, options.iter().map(|o| o.name.as_str())));
    };
    let number = as_number(spec, value).ok_or_else(|| {
        ApiError::new(format!("{}: {name} must be {}, got {}", used.plugin, allowed(spec), describe(value)))
            .hint(&spec.about)
    })?;
    used.parameters.retain(|(n, _)| n != name);
    used.parameters.push((name.to_string(), number));
    // The order of calls does not matter to the picture, so it must not matter to the stage either.
    used.parameters.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(())
}

/// Texts are handed over as their place in the list of allowed ones.
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

fn set(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let name = c.text(0)?;
    let mut used = c.build().effect(this.0)?.clone();
    set_parameter(c, &mut used, &name, &c.value(1))?;
    *c.build().effect(this.0)? = used;
    c.itself()
}

fn from(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    c.build().effect(this.0)?.start = t;
    c.itself()
}

fn until(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    let start = c.build().effect(this.0)?.start;
    if t < start {
        return Err(super::actor::before_start("until", t, start));
    }
    c.build().effect(this.0)?.end = Some(t);
    c.itself()
}

fn on(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let name = c.build().effect(this.0)?.plugin.clone();
    let of_actors = c.shared.loader.registry().effect(&name).is_some_and(|plugin| plugin.hook().of_actors());
    if !of_actors {
        let text = "on: post effects cover the whole picture, not single actors";
        return Err(ApiError::new(text).hint("leave .on(…) out"));
    }
    let who = c.value(0);
    let actors: Vec<Dynamic> = match who.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(Dynamic::flatten_clone).collect(),
        None => vec![who.flatten_clone()],
    };
    let ids: Option<Vec<usize>> =
        actors.iter().map(|a| a.read_lock::<ActorRef>().map(|actor| actor.id)).collect();
    let Some(ids) = ids.filter(|ids| !ids.is_empty()) else {
        return Err(c.wrong(0, "an Actor or an array of them"));
    };
    let mut build = c.build();
    if let Some(gone) = ids.iter().find(|id| **id >= build.actors.len()) {
        return Err(ApiError::new(format!("actor {gone} is not on this stage")));
    }
    let used = build.effect(this.0)?;
    used.actors.extend(ids);
    // In whatever order they are named.
    used.actors.sort_unstable();
    used.actors.dedup();
    drop(build);
    c.itself()
}
