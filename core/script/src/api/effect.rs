//! Effects: post-processing of the whole frame, effects on surfaces, and overlays.

use super::keys;
use crate::build::check_limit;
use crate::call::{ApiError, Call, Options, Reply, api, describe, int_or_float, unknown};
use crate::frame_callback;
use crate::procedural::files;
use crate::value::{ActorRef, CameraRef, EffectRef, ImageRef, JointRef};
use choreo_asset::Asset;
use choreo_plugin::parameters::{curve_table, is_curve};
use choreo_plugin::{Effect, EffectTexture, Hook, OptionKind, OptionSpec};
use choreo_stage::{
    Channel, EffectDistance, EffectEdit, EffectImageUse, EffectTarget, EffectUse, Property, Target,
};
use rhai::Dynamic;

api! {
    /// Adds an effect plugin to the whole frame or to all surfaces. Options are its parameters; `choreo plugins` lists
    /// all effects and their parameters. Vectors are arrays, curves arrays of keys [x, y] with x from 0 to 1, textures
    /// names of image files or image(…). A number may be an actor or a joint: it then is the distance in front of the
    /// camera in metres, such as the focus.
    /// - Built in, on the frame: "tonemap" (tone mapping, exposure), "bloom", "motion_blur" (accumulation of
    ///   sub-frames while the shutter is open), "fxaa" (antialiasing), "vignette", "film_grain".
    /// - Built in, on the frame by its depth: "ambient_occlusion", "depth_of_field", "god_rays", "edge_lines", "heat_haze".
    /// - Built in, on surfaces and as overlays: "toon", "fog", "outline", "wireframe", "xray", "views" (normals,
    ///   uvs and more), "skeleton", "grid", "shadow_catcher".
    effect("name, options?") -> Effect = effect;
    /// Sets a parameter of the effect.
    Effect.set("parameter, value") = set, in_frames;
    /// Animates a parameter with keyframes [[time, value], …]: a number, a color, a vector, or a curve, whose samples
    /// are interpolated. `how`, easing and tangents as in Actor.key. Whole numbers, flags and texts change at the keyframe.
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
    let registry = c.context.loader.registry();
    let plugin = match registry.use_effect(&name) {
        Ok(Some(plugin)) => plugin,
        Ok(None) => {
            let names: Vec<&str> = registry.effect_names().collect();
            let error = unknown("effect", &name, "", names);
            let known = error.hint.clone().unwrap_or_default();
            let faulty = registry.faulty_hint(".wgsl");
            return Err(error.hint(format!("{known}; packages of plugins: choreo plugins list{faulty}")));
        }
        Err(fault) => {
            c.context.loader.note_missing_or_linked(&fault.files);
            return Err(ApiError::new(&fault.text));
        }
    };
    if let Some(file) = plugin.file() {
        c.context.loader.record_file_read(&file.path, &file.bytes);
        for beside in &file.beside {
            if let Ok(bytes) = &beside.bytes {
                c.context.loader.record_file_read(&beside.path, bytes);
            }
        }
    }
    let off_screen = plugin.off_screen_actors();
    let mut used = EffectUse { plugin: name.clone(), off_screen, ..EffectUse::default() };
    let options = &plugin.manifest().options;
    // Each component of a color or vector has a name of its own; samples of curves have none.
    let has_names = |o: &&OptionSpec| matches!(o.kind, OptionKind::Color { .. } | OptionKind::Vector { .. });
    let numbers_of: Vec<String> =
        options.iter().filter(has_names).flat_map(OptionSpec::number_names).collect();
    let mut names: Vec<&str> = options.iter().map(|o| o.name.as_str()).collect();
    names.extend(numbers_of.iter().map(String::as_str));
    names.extend(options.iter().filter_map(|o| o.name.strip_suffix("_r")));
    let o = c.options(1, &names)?;
    for (key, value) in &o.map {
        match image_of_texture_parameter(c, plugin, key, value)? {
            Some(image) => set_image(&mut used, image),
            None => set_parameter(&mut used, plugin, key, value)?,
        }
    }
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.effects.len(), "effects", &c.context.limits)?;
    stage_draft.effects.push(used);
    stage_draft.effect_places.push(c.place.clone());
    Ok(Dynamic::from(EffectRef { id: stage_draft.effects.len() - 1, plugin: name.into() }))
}

/// A parameter of an effect, or one component, such as "tint_r", of a parameter with several numbers.
enum Parameter<'a> {
    Whole(&'a OptionSpec),
    /// A color whose components "tint_r", "tint_g" and "tint_b" are declared as separate parameters.
    Color([String; 3]),
    /// The component with this name.
    Component(&'a OptionSpec, String),
}

fn parameter<'a>(plugin: &'a Effect, name: &str) -> Result<Parameter<'a>, ApiError> {
    let options = &plugin.manifest().options;
    if let Some(option) = options.iter().find(|o| o.name == name) {
        return Ok(Parameter::Whole(option));
    }
    let parts = ["_r", "_g", "_b"].map(|part| format!("{name}{part}"));
    if parts.iter().all(|part| options.iter().any(|o| o.name == *part)) {
        return Ok(Parameter::Color(parts));
    }
    let of_number = options.iter().find(|o| o.number_of(name).is_some());
    of_number.map(|option| Parameter::Component(option, name.into())).ok_or_else(|| {
        let place = format!(" of effect \"{}\"", plugin.manifest().name);
        unknown("parameter", name, &place, options.iter().map(|o| o.name.as_str()))
    })
}

impl Parameter<'_> {
    /// Names of the numbers that the parameter sets.
    fn number_names(&self) -> Vec<String> {
        match self {
            Parameter::Whole(spec) => spec.number_names().collect(),
            Parameter::Color(parts) => parts.to_vec(),
            Parameter::Component(_, name) => vec![name.clone()],
        }
    }

    /// The numbers that the effect receives for a value.
    fn read(&self, value: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
        let spec = match self {
            Parameter::Component(spec, _) => {
                let [min, max] = spec.bounds().unwrap_or([f64::MIN, f64::MAX]);
                let number = int_or_float(value).filter(|n| (min..=max).contains(n));
                let wrong = || value_error(&format!("from {min} to {max}"), spec, label, value);
                return number.map(|n| vec![n]).ok_or_else(wrong);
            }
            Parameter::Color(_) => return color_numbers(value, label),
            Parameter::Whole(spec) => spec,
        };
        if matches!(spec.kind, OptionKind::Color { .. }) {
            return color_numbers(value, label);
        }
        effect_numbers(spec, value).ok_or_else(|| value_error(&allowed_values(spec), spec, label, value))
    }
}

/// Linear red, green and blue of a color value.
fn color_numbers(value: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    Ok(crate::call::color(value, label)?.to_array()[..3].iter().map(|n| f64::from(*n)).collect())
}

/// Sets a parameter to a value, or to the distance of an actor or joint from the camera.
fn set_parameter(used: &mut EffectUse, plugin: &Effect, name: &str, value: &Dynamic) -> Result<(), ApiError> {
    let target = match value.read_lock::<ActorRef>() {
        Some(actor) => Some(Target::Actor(actor.id)),
        None => value.read_lock::<JointRef>().map(|j| Target::Joint { actor: j.actor, joint: j.joint }),
    };
    if let Some(target) = target
        && let Parameter::Whole(OptionSpec { kind: OptionKind::Number { min, max, .. }, .. }) =
            parameter(plugin, name)?
    {
        let (least, most) = (*min, *max);
        used.distances.retain(|distance| distance.parameter != name);
        used.distances.push(EffectDistance { parameter: name.into(), target, least, most });
        used.distances.sort_by(|a, b| a.parameter.cmp(&b.parameter));
        return Ok(());
    }
    for (name, number) in named_numbers(plugin, name, value)? {
        used.distances.retain(|distance| distance.parameter != name);
        set_sorted(&mut used.parameters, name, number);
    }
    Ok(())
}

/// The image of a value if the parameter is a texture, else `None`.
fn image_of_texture_parameter(
    c: &Call,
    plugin: &Effect,
    name: &str,
    value: &Dynamic,
) -> Result<Option<EffectImageUse>, ApiError> {
    let Parameter::Whole(spec) = parameter(plugin, name)? else { return Ok(None) };
    if !matches!(spec.kind, OptionKind::Texture { .. }) {
        return Ok(None);
    }
    let label = format!("{}: {name}", plugin.manifest().name);
    let image = if let Some(image) = value.read_lock::<ImageRef>() {
        image.decoded()?
    } else {
        let file = value
            .clone()
            .into_string()
            .map_err(|_| value_error(&allowed_values(spec), spec, &label, value))?;
        files::decoded_image(c, &label, &file)?
    };
    let (w, h, most) = (image.width, image.height, EffectTexture::MOST);
    if !(1..=most).contains(&w) || !(1..=most).contains(&h) {
        let text = format!("{label}: an image of {w} × {h}, at most {most} × {most} for an effect");
        return Err(ApiError::new(text).focus(name));
    }
    Ok(Some(EffectImageUse { parameter: name.into(), hash: image.content_hash(), image }))
}

fn set_image(used: &mut EffectUse, image: EffectImageUse) {
    used.images.retain(|other| other.parameter != image.parameter);
    used.images.push(image);
    used.images.sort_by(|a, b| a.parameter.cmp(&b.parameter));
}

/// Returns an error for a texture parameter, which cannot change over time.
fn check_can_change(plugin: &Effect, name: &str, function: &str) -> Result<(), ApiError> {
    match parameter(plugin, name)? {
        Parameter::Whole(OptionSpec { kind: OptionKind::Texture { .. }, .. }) => {
            let text = format!("{function}: the texture \"{name}\" cannot change over time");
            Err(ApiError::new(text)
                .hint("use the effect twice, with .from and .until, and fade another parameter"))
        }
        _ => Ok(()),
    }
}

/// Names and values of the numbers that a value sets.
fn named_numbers(plugin: &Effect, name: &str, value: &Dynamic) -> Result<Vec<(String, f64)>, ApiError> {
    let parameter = parameter(plugin, name)?;
    let read = parameter.read(value, &format!("{}: {name}", plugin.manifest().name))?;
    Ok(parameter.number_names().into_iter().zip(read).collect())
}

fn value_error(allowed: &str, spec: &OptionSpec, label: &str, value: &Dynamic) -> ApiError {
    ApiError::new(format!("{label} must be {allowed}, got {}", describe(value))).hint(&spec.about)
}

/// Sets a parameter in a list sorted by name, because the order of calls must not change the stage.
fn set_sorted<T>(parameters: &mut Vec<(String, T)>, name: String, value: T) {
    parameters.retain(|(n, _)| *n != name);
    parameters.push((name, value));
    parameters.sort_by(|a, b| a.0.cmp(&b.0));
}

/// The numbers that an effect receives for a value. A text becomes its index in the list of allowed texts, a curve its samples.
fn effect_numbers(spec: &OptionSpec, value: &Dynamic) -> Option<Vec<f64>> {
    match &spec.kind {
        OptionKind::Number { min, max, .. } => {
            int_or_float(value).filter(|n| (*min..=*max).contains(n)).map(|n| vec![n])
        }
        OptionKind::Integer { min, max, .. } => {
            let n = int_or_float(value).filter(|n| n.fract() == 0.0)?;
            (*min as f64..=*max as f64).contains(&n).then(|| vec![n])
        }
        OptionKind::Bool { .. } => value.as_bool().ok().map(|b| vec![f64::from(u8::from(b))]),
        OptionKind::Text { one_of, .. } => {
            let text = value.clone().into_string().ok()?;
            one_of.iter().position(|o| *o == text).map(|i| vec![i as f64])
        }
        OptionKind::Vector { default, min, max } => crate::call::numbers(value)
            .filter(|v| v.len() == default.len() && v.iter().all(|n| (*min..=*max).contains(n))),
        OptionKind::Curve { min, max, .. } => {
            let keys = value.read_lock::<rhai::Array>()?;
            let keys: Vec<[f64; 2]> =
                keys.iter().map(|key| crate::call::numbers(key)?.try_into().ok()).collect::<Option<_>>()?;
            let within = keys.iter().all(|[_, y]| (*min..=*max).contains(y));
            (is_curve(&keys) && within).then(|| curve_table(&keys).to_vec())
        }
        // Colors are read by `Parameter::read`, textures by `image_of_texture_parameter`.
        _ => None,
    }
}

/// The allowed values of a parameter, for messages.
fn allowed_values(spec: &OptionSpec) -> String {
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" {}", spec.unit) };
    match &spec.kind {
        OptionKind::Number { min, max, .. } => format!("from {min} to {max}{unit}"),
        _ => spec.allowed(),
    }
}

fn effect_plugin(c: &Call, this: &EffectRef) -> Result<Effect, ApiError> {
    let found = c.context.loader.registry().effect(&this.plugin).cloned();
    found.ok_or_else(|| ApiError::new(format!("effect \"{}\" no longer exists", this.plugin)))
}

fn set(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let (plugin, name) = (effect_plugin(c, &this)?, c.text(0)?);
    if c.in_frame {
        check_can_change(&plugin, &name, "set")?;
        let new = named_numbers(&plugin, &name, &c.value(1))?;
        frame_callback::edit_frame(|edits| {
            let edit = |(parameter, value)| EffectEdit { effect: this.id, parameter, value };
            edits.effects.extend(new.into_iter().map(edit));
        });
        return c.receiver();
    }
    let image = image_of_texture_parameter(c, &plugin, &name, &c.value(1))?;
    let mut stage_draft = c.stage_draft();
    let used = stage_draft.effect(this.id)?;
    match image {
        Some(image) => set_image(used, image),
        None => set_parameter(used, &plugin, &name, &c.value(1))?,
    }
    c.receiver()
}

fn key(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let (plugin, name) = (effect_plugin(c, &this)?, c.text(0)?);
    check_can_change(&plugin, &name, "key")?;
    let parameter = parameter(&plugin, &name)?;
    let step = match &parameter {
        Parameter::Whole(spec) => {
            matches!(
                spec.kind,
                OptionKind::Bool { .. } | OptionKind::Text { .. } | OptionKind::Integer { .. }
            )
        }
        Parameter::Color(_) | Parameter::Component(..) => false,
    };
    let read = |v: &Dynamic, label: &str| parameter.read(v, label);
    let channels = keys::component_channels(c, Property::Parameter, step, &read)?;
    let named: Vec<(String, Channel)> = parameter.number_names().into_iter().zip(channels).collect();
    let mut stage_draft = c.stage_draft();
    let used = stage_draft.effect(this.id)?;
    used.distances.retain(|distance| distance.parameter != name);
    named.into_iter().for_each(|(name, keys)| set_sorted(&mut used.keys, name, keys));
    c.receiver()
}

fn from(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    c.stage_draft().effect(this.id)?.start = t;
    c.receiver()
}

fn until(c: &mut Call) -> Reply {
    let this: EffectRef = c.this()?;
    let t = c.time(0)?;
    let start = c.stage_draft().effect(this.id)?.start;
    if t < start {
        return Err(super::actor::before_start_error("until", t, start));
    }
    c.stage_draft().effect(this.id)?.end = Some(t);
    c.receiver()
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
    for item in &all {
        if let Some(camera) = item.read_lock::<CameraRef>() {
            cameras.push(camera.0);
        } else if let Some(actor) = item.read_lock::<ActorRef>() {
            targets.extend(effect_targets(&actor, &o)?);
        } else {
            return Err(c.wrong(0, "an Actor or an array of them, or a Camera"));
        }
    }
    if all.is_empty() {
        return Err(c.wrong(0, "an Actor or an array of them, or a Camera"));
    }
    if !targets.is_empty() && !effect_plugin(c, &this)?.applies_to_actors() {
        let text = "on: post effects cover the whole image, not single actors";
        return Err(ApiError::new(text).hint("leave .on(…) out, or give it a camera"));
    }
    if targets.iter().any(|t| t.material.is_some()) && effect_plugin(c, &this)?.hook() == Hook::Overlay {
        let text = "on: this effect draws beside whole actors, not on single materials";
        return Err(ApiError::new(text).hint("leave material out"));
    }
    if targets.is_empty() && o.get("material").is_some() {
        return Err(ApiError::new("on: a camera has no material"));
    }
    let mut stage_draft = c.stage_draft();
    let (actors, stage_cameras) = (stage_draft.actors.len(), stage_draft.cameras.len());
    if targets.iter().any(|target| target.actor >= actors) {
        return Err(ApiError::new("on: an actor of another stage is named"));
    }
    if cameras.iter().any(|camera| *camera >= stage_cameras) {
        return Err(ApiError::new("on: a camera of another stage is named"));
    }
    let used = stage_draft.effect(this.id)?;
    used.on.extend(targets);
    used.cameras.extend(cameras);
    // The order of targets in the script does not matter.
    used.on.sort_unstable();
    used.on.dedup();
    used.cameras.sort_unstable();
    used.cameras.dedup();
    c.receiver()
}

/// The targets of an effect on an actor: the whole actor, or the materials that the options name.
fn effect_targets(actor: &ActorRef, o: &Options) -> Result<Vec<EffectTarget>, ApiError> {
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
            "{function}: material must be a name or an array of at least one name"
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
