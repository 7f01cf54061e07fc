//! Lights: directional (sun), point, spot and ambient.

use super::actor::{attachment, rgb_arg};
use super::keys;
use crate::build::check_limit;
use crate::call::{ApiError, Call, Options, Reply, api, color, fields, number_in, numbers, rgb};
use crate::frame_callback;
use crate::value::LightRef;
use choreo_asset::{Light, LightKind};
use choreo_stage::{DEFAULT_SUN_LUX, LightEdit, Shadow, StageLight, Target};
use glam::{DVec3, Vec3};
use rhai::{Dynamic, Map};

api! {
    /// Makes a directional light, with its intensity in lux (illuminance of a surface that faces it).
    /// - A white surface that faces a sun of π lux is 1 before exposure and view transform. Lights of files have the same
    ///   units (KHR_lights_punctual).
    /// - Options: {}, name. The default direction is [-1, -2, -1.5], the default color white.
    sun("options?") -> Light = sun, options(sun_options);
    /// Makes a point light, with its intensity in candela: at d metres it illuminates with intensity / d² lux.
    /// - Options: {}, attenuation ([constant, linear, quadratic]: intensity falls with one over this polynomial of
    ///   the distance in metres, in place of its square; not with range), shadow as in `sun`, name. The default color
    ///   is white, the default range unlimited.
    point("options?") -> Light = point, options(|| describe_options(&default_point()));
    /// Makes a spotlight, with its intensity in candela as in `point`.
    /// - Options: {}, look_at (a point, in place of direction, default [0, 1, 0]), attenuation and shadow as in
    ///   `point`, name. The default of inner is 0.8 times outer; color, range and intensity as in `point`.
    spot("options?") -> Light = spot, options(|| describe_options(&default_spot()));
    /// Sets the ambient light: a color, a strength of white light, or #{ up, down } for light from above and from
    /// below; `strength` multiplies it. Without it, a file's own (a dome light of USD) takes the place of the default.
    ambient("color, strength? | options") -> () = ambient, in_frames;
    /// Sets the position in metres.
    Light.at("x, y, z | point") = at, in_frames;
    /// Sets the intensity: lux for a sun, candela for the others.
    Light.intensity("value") = intensity, in_frames;
    /// Sets the color.
    Light.color("color") = set_color, in_frames;
    /// Makes the light a child of an actor or of a joint. Its position and direction are then in the space of that
    /// parent.
    Light.attach("actor_or_joint") = attach;
    /// Animates a property with keyframes [[time, value], …]: "intensity", "color", "kelvin", "position",
    /// "direction", "range" or "cone" (outer half angle in degrees). `how`, easing and tangents
    /// as in Actor.key.
    Light.key("property, keys, how?") = key;
}

/// A white light with default options.
fn default_light(kind: LightKind, intensity: f32, position: DVec3, direction: Vec3) -> StageLight {
    let light = Light { kind, color: Vec3::ONE, intensity, range: None };
    StageLight { position, direction: direction.normalize(), ..StageLight::new("", light) }
}

fn default_sun() -> StageLight {
    let direction = DVec3::new(-1.0, -2.0, -1.5).normalize().as_vec3();
    default_light(LightKind::Directional, DEFAULT_SUN_LUX, DVec3::ZERO, direction)
}

fn default_point() -> StageLight {
    default_light(LightKind::Point, 30.0, DVec3::new(0.0, 3.0, 2.0), Vec3::NEG_Y)
}

fn default_spot() -> StageLight {
    let outer = 30.0_f64;
    let kind = LightKind::Spot { inner: (outer * 0.8).to_radians() as f32, outer: outer.to_radians() as f32 };
    default_light(kind, 60.0, DVec3::new(0.0, 4.0, 3.0), Vec3::NEG_Y)
}

/// Fields that are not options of a light.
fn inapplicable_fields(light: &StageLight) -> &'static [&'static str] {
    if light.light.kind == LightKind::Directional { &["position"] } else { &[] }
}

/// Documentation of the options of a sun and its shadow, for the reference.
fn sun_options() -> String {
    let shadow = fields::describe_options(&Shadow::default(), &[]);
    format!(
        "{}, shadow (true, or #{{ … }} with {shadow}; default: no shadow)",
        describe_options(&default_sun())
    )
}

fn describe_options(light: &StageLight) -> String {
    fields::describe_options(light, inapplicable_fields(light))
}

/// Reads and checks the option map of a light.
fn light_options(c: &Call, light: &StageLight) -> Result<Options, ApiError> {
    let more: &[&str] = match light.light.kind {
        LightKind::Directional => &["shadow", "name"],
        LightKind::Point => &["attenuation", "shadow", "name"],
        LightKind::Spot { .. } => &["look_at", "attenuation", "shadow", "name"],
    };
    c.options(0, &[&fields::names(light, inapplicable_fields(light))[..], more].concat())
}

/// Adds a light with its options to the stage.
fn add_light(c: &Call, o: &Options, mut light: StageLight) -> Reply {
    if o.get("color").is_some() && o.get("kelvin").is_some() {
        return Err(ApiError::new(format!("{}: give color or kelvin, not both", o.function)));
    }
    fields::fill(c, o, &mut light)?;
    light.shadow = shadow(c, o)?;
    light.attenuation = attenuation(o)?;
    if light.attenuation.is_some() && light.light.range.is_some() {
        let text = format!(
            "{}: range limits the inverse-square falloff, attenuation replaces it; give only one",
            o.function
        );
        return Err(ApiError::new(text).focus("attenuation"));
    }
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.lights.len(), "lights", &c.context.limits)?;
    let number = stage_draft.lights.len() + 1;
    light.name = o.text("name")?.unwrap_or_else(|| format!("{} {number}", o.function));
    stage_draft.lights.push(light);
    stage_draft.light_places.push(c.place.clone());
    Ok(Dynamic::from(LightRef(stage_draft.lights.len() - 1)))
}

/// Reads the attenuation polynomial, `[constant, linear, quadratic]`.
fn attenuation(o: &Options) -> Result<Option<[f32; 3]>, ApiError> {
    let Some(given) = o.get("attenuation") else { return Ok(None) };
    let three = numbers(&given).filter(|n| n.len() == 3 && n.iter().all(|v| (0.0..=1e6).contains(v)));
    let three = three.filter(|n| n.iter().any(|v| *v > 0.0));
    let allowed = "[constant, linear, quadratic], none below 0 and at least one above";
    let three = three.ok_or_else(|| crate::call::wrong(&given, &o.label("attenuation"), allowed))?;
    Ok(Some([three[0] as f32, three[1] as f32, three[2] as f32]))
}

/// Reads the shadow: `true`, or `#{ size, softness }`.
fn shadow(c: &Call, o: &Options) -> Result<Option<Shadow>, ApiError> {
    let Some(given) = o.get("shadow") else { return Ok(None) };
    let mut shadow = Shadow::default();
    let Some(map) = given.read_lock::<Map>().map(|m| m.clone()) else {
        return Ok(o.flag("shadow")?.filter(|on| *on).map(|_| shadow));
    };
    let o = Options { function: o.label("shadow"), map };
    o.check(c, &fields::names(&shadow, &[]))?;
    fields::fill(c, &o, &mut shadow)?;
    Ok(Some(shadow))
}

fn sun(c: &mut Call) -> Reply {
    let light = default_sun();
    let o = light_options(c, &light)?;
    add_light(c, &o, light)
}

fn point(c: &mut Call) -> Reply {
    let light = default_point();
    let o = light_options(c, &light)?;
    add_light(c, &o, light)
}

fn spot(c: &mut Call) -> Reply {
    let mut light = default_spot();
    let o = light_options(c, &light)?;
    let position = o.point("position")?.unwrap_or(light.position);
    let direction = match (o.get("direction"), o.target("look_at")?) {
        (Some(_), Some(_)) => return Err(ApiError::new("spot: give direction or look_at, not both")),
        (Some(v), None) => Call::direction(&v, "spot: direction")?,
        (None, Some(Target::Point(p))) if (p - position).length() > 1e-9 => (p - position).normalize(),
        (None, Some(Target::Point(_))) => {
            return Err(ApiError::new("spot: look_at must differ from the position of the light"));
        }
        (None, Some(_)) => {
            return Err(ApiError::new("spot: look_at must be a point, [x, y, z]")
                .hint("to follow an actor, attach the light: spot(#{ … }).attach(actor)"));
        }
        (None, None) => (DVec3::new(0.0, 1.0, 0.0) - position).normalize_or(DVec3::NEG_Y),
    };
    light.direction = direction.as_vec3().normalize();
    let outer = o.number_in("outer", 0.1, 90.0)?.unwrap_or(30.0);
    let inner = o.number_in("inner", 0.0, 90.0)?.unwrap_or(outer * 0.8);
    if inner >= outer {
        return Err(ApiError::new(format!("spot: inner must be less than outer, got {inner} and {outer}")));
    }
    light.light.kind = LightKind::Spot { inner: inner.to_radians() as f32, outer: outer.to_radians() as f32 };
    add_light(c, &o, light)
}

/// Reads ambient light from above and from below, linear: a color, a strength of white light, or
/// `#{ up, down, strength }`.
pub(crate) fn read_ambient(c: &Call, v: &Dynamic, label: &str) -> Result<(Vec3, Vec3), ApiError> {
    if let Some(map) = v.read_lock::<Map>() {
        let o = Options { function: label.to_string(), map: map.clone() };
        o.check(c, &["up", "down", "color", "strength"])?;
        let strength = o.number_in("strength", 0.0, 1000.0)?.unwrap_or(1.0) as f32;
        let all = o.color("color")?.map(rgb);
        let up = o.color("up")?.map(rgb).or(all);
        let down = o.color("down")?.map(rgb).or(all);
        return match (up.or(down), down.or(up)) {
            (Some(up), Some(down)) => Ok((up * strength, down * strength)),
            _ => Err(ApiError::new(format!("{label}: give color, or up and down"))),
        };
    }
    if v.is_string() || numbers(v).is_some() {
        let rgb = rgb(color(v, label)?);
        return Ok((rgb, rgb));
    }
    let strength = number_in(v, label, 0.0, 1000.0).map_err(|e| {
        if v.is_int() || v.is_float() {
            e
        } else {
            crate::call::wrong(v, label, "a color, a strength, or #{ up, down }")
        }
    })?;
    Ok((Vec3::splat(strength as f32), Vec3::splat(strength as f32)))
}

fn ambient(c: &mut Call) -> Reply {
    let (mut up, mut down) = read_ambient(c, &c.value(0), "ambient")?;
    if c.len() > 1 {
        let strength = c.number_in(1, 0.0, 1000.0)? as f32;
        up *= strength;
        down *= strength;
    }
    if c.in_frame {
        frame_callback::edit_frame(|e| e.ambient = Some((up, down)));
        return Ok(Dynamic::UNIT);
    }
    let mut stage_draft = c.stage_draft();
    (stage_draft.settings.ambient_up, stage_draft.settings.ambient_down) = (up, down);
    (stage_draft.sets_ambient, stage_draft.ambient_at) = (true, Some(c.place.clone()));
    Ok(Dynamic::UNIT)
}

fn change_or_edit(c: &Call, edit: LightEdit, change: impl FnOnce(&mut StageLight)) -> Reply {
    let this: LightRef = c.this()?;
    if c.in_frame {
        frame_callback::edit_frame(|e| e.lights.push((this.0, edit)));
    } else {
        change(c.stage_draft().light(this.0)?);
    }
    c.receiver()
}

fn at(c: &mut Call) -> Reply {
    let position = c.point(0)?;
    change_or_edit(c, LightEdit::MoveTo(position), |l| l.position = position)
}

fn intensity(c: &mut Call) -> Reply {
    let intensity = c.number_in(0, 0.0, 1e9)? as f32;
    change_or_edit(c, LightEdit::Intensity(intensity), |l| l.light.intensity = intensity)
}

fn set_color(c: &mut Call) -> Reply {
    let color = rgb_arg(c, 0)?;
    change_or_edit(c, LightEdit::Color(color), |l| l.light.color = color)
}

fn attach(c: &mut Call) -> Reply {
    let this: LightRef = c.this()?;
    let parent = attachment(c, 0)?;
    c.stage_draft().light(this.0)?.parent = Some(parent);
    c.receiver()
}

fn key(c: &mut Call) -> Reply {
    let this: LightRef = c.this()?;
    let light = c.stage_draft().light(this.0)?.clone();
    let channels = keys::channels_of(c, &light)?;
    keys::replace_channels(&mut c.stage_draft().light(this.0)?.channels, channels);
    c.receiver()
}
