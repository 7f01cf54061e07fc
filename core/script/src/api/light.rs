//! Lights: directional (sun), point, spot and ambient.

use super::actor::{attachment, rgb_arg};
use super::keys;
use crate::build::room;
use crate::call::{ApiError, Call, Options, Reply, api, color, number_in, numbers, rgb};
use crate::color::kelvin;
use crate::hook;
use crate::value::LightRef;
use choreo_asset::{Light, LightKind};
use choreo_stage::{LightEdit, Shadow, StageLight, Target};
use glam::{DVec3, Vec3};
use rhai::{Dynamic, Map};

api! {
    /// Makes a directional light. Options: direction (in which it shines, default [-1, -2, -1.5]), color or kelvin
    /// (1667 to 25000; default white), intensity (lux, default 3), shadow (true, or #{ size, softness }: size of
    /// the shadow map in texels, 64 to 4096, default 2048; width of the soft edge in metres, default 0.01; default:
    /// no shadow), name.
    sun("options?") -> Light = sun;
    /// Makes a point light. Options: position (default [0, 3, 2]), color or kelvin, intensity (candela, default
    /// 20), range (metres, default unlimited), attenuation ([constant, linear, quadratic]: intensity falls with one
    /// over this polynomial of the distance in metres, in place of its square; not with range), shadow as in `sun`,
    /// name.
    point("options?") -> Light = point;
    /// Makes a spotlight. Options: position (default [0, 4, 3]), direction or look_at (a point, default [0, 1, 0]),
    /// outer and inner (half angles of the cone in degrees, default 30 and 0.8 times outer), color or kelvin,
    /// intensity (candela, default 60), range, attenuation and shadow as in `point`, name.
    spot("options?") -> Light = spot;
    /// Sets the ambient light: a color, a strength of white light, or #{ up, down } for light from above and from
    /// below; `strength` multiplies it.
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
    /// "direction", "range" or "cone" (outer half angle in degrees). `how` and easing as in Actor.key.
    Light.key("property, keys, how?") = key;
}

/// Reads color or kelvin, and intensity, which all lights have.
fn common(o: &Options, intensity: f64) -> Result<(Vec3, f32), ApiError> {
    let color = o.color("color")?.map(rgb);
    let warm = o.number_in("kelvin", 1667.0, 25_000.0)?.map(kelvin);
    if color.is_some() && warm.is_some() {
        return Err(ApiError::new(format!("{}: give color or kelvin, not both", o.function)));
    }
    let intensity = o.number_in("intensity", 0.0, 1e9)?.unwrap_or(intensity) as f32;
    Ok((color.or(warm).unwrap_or(Vec3::ONE), intensity))
}

fn add(c: &Call, o: &Options, light: Light, position: DVec3, direction: Vec3) -> Reply {
    let shadow = shadow(o)?;
    let attenuation = attenuation(o)?;
    if attenuation.is_some() && light.range.is_some() {
        let text =
            format!("{}: range cuts off what falls off by the square; give range or attenuation", o.function);
        return Err(ApiError::new(text).focus("attenuation"));
    }
    let mut build = c.build();
    room(build.lights.len(), "lights", &c.shared.limits)?;
    let number = build.lights.len() + 1;
    let name = o.text("name")?.unwrap_or_else(|| format!("{} {number}", o.function));
    let light = StageLight { position, direction, shadow, attenuation, ..StageLight::new(&name, light) };
    build.lights.push(light);
    build.light_places.push(c.place.clone());
    Ok(Dynamic::from(LightRef(build.lights.len() - 1)))
}

/// Reads the attenuation polynomial, `[constant, linear, quadratic]`.
fn attenuation(o: &Options) -> Result<Option<[f32; 3]>, ApiError> {
    let Some(given) = o.get("attenuation") else { return Ok(None) };
    let three = numbers(&given).filter(|n| n.len() == 3 && n.iter().all(|v| (0.0..=1e6).contains(v)));
    let three = three.filter(|n| n.iter().any(|v| *v > 0.0));
    let allowed = "[constant, linear, square], none below 0 and one above";
    let three = three.ok_or_else(|| crate::call::wrong(&given, &o.label("attenuation"), allowed))?;
    Ok(Some([three[0] as f32, three[1] as f32, three[2] as f32]))
}

/// Reads the shadow: `true`, or `#{ size, softness }`.
fn shadow(o: &Options) -> Result<Option<Shadow>, ApiError> {
    let Some(given) = o.get("shadow") else { return Ok(None) };
    let Some(map) = given.read_lock::<Map>().map(|m| m.clone()) else {
        return Ok(o.flag("shadow")?.filter(|on| *on).map(|_| Shadow::default()));
    };
    let o = Options { function: o.label("shadow"), map };
    o.check(&["size", "softness"])?;
    let usual = Shadow::default();
    let (low, high) = (f64::from(*Shadow::SIZES.start()), f64::from(*Shadow::SIZES.end()));
    Ok(Some(Shadow {
        size: o.number_in("size", low, high)?.map_or(usual.size, |v| v as u32),
        softness: o.number_in("softness", 0.0, 100.0)?.map_or(usual.softness, |v| v as f32),
    }))
}

fn sun(c: &mut Call) -> Reply {
    let o = c.options(0, &["direction", "color", "kelvin", "intensity", "shadow", "name"])?;
    let direction = match o.get("direction") {
        Some(v) => Call::direction(&v, "sun: direction")?,
        None => DVec3::new(-1.0, -2.0, -1.5).normalize(),
    };
    let (color, intensity) = common(&o, 3.0)?;
    let light = Light { kind: LightKind::Directional, color, intensity, range: None };
    add(c, &o, light, DVec3::ZERO, direction.as_vec3().normalize())
}

fn range(o: &Options) -> Result<Option<f32>, ApiError> {
    Ok(o.number_in("range", 1e-3, 1e9)?.map(|r| r as f32))
}

fn point(c: &mut Call) -> Reply {
    let o = c.options(
        0,
        &["position", "color", "kelvin", "intensity", "range", "attenuation", "shadow", "name"],
    )?;
    let position = o.point("position")?.unwrap_or(DVec3::new(0.0, 3.0, 2.0));
    let (color, intensity) = common(&o, 20.0)?;
    let light = Light { kind: LightKind::Point, color, intensity, range: range(&o)? };
    add(c, &o, light, position, Vec3::NEG_Y)
}

fn spot(c: &mut Call) -> Reply {
    let o = c.options(
        0,
        &[
            "position",
            "direction",
            "look_at",
            "inner",
            "outer",
            "color",
            "kelvin",
            "intensity",
            "range",
            "attenuation",
            "shadow",
            "name",
        ],
    )?;
    let position = o.point("position")?.unwrap_or(DVec3::new(0.0, 4.0, 3.0));
    let direction = match (o.get("direction"), o.target("look_at")?) {
        (Some(_), Some(_)) => return Err(ApiError::new("spot: give direction or look_at, not both")),
        (Some(v), None) => Call::direction(&v, "spot: direction")?,
        (None, Some(Target::Point(p))) if (p - position).length() > 1e-9 => (p - position).normalize(),
        (None, Some(Target::Point(_))) => {
            return Err(ApiError::new("spot: look_at is where the light stands"));
        }
        (None, Some(_)) => {
            return Err(ApiError::new("spot: look_at must be a point, [x, y, z]")
                .hint("to follow an actor, attach the light: spot(#{ … }).attach(actor)"));
        }
        (None, None) => (DVec3::new(0.0, 1.0, 0.0) - position).normalize_or(DVec3::NEG_Y),
    };
    let outer = o.number_in("outer", 0.1, 90.0)?.unwrap_or(30.0);
    let inner = o.number_in("inner", 0.0, 90.0)?.unwrap_or(outer * 0.8);
    if inner >= outer {
        return Err(ApiError::new(format!("spot: inner must be less than outer, got {inner} and {outer}")));
    }
    let (color, intensity) = common(&o, 60.0)?;
    let kind = LightKind::Spot { inner: inner.to_radians() as f32, outer: outer.to_radians() as f32 };
    let light = Light { kind, color, intensity, range: range(&o)? };
    add(c, &o, light, position, direction.as_vec3().normalize())
}

/// Ambient light from above and from below: a color, a number (white), or `#{ up, down, strength }`.
pub fn read_ambient(v: &Dynamic, label: &str) -> Result<(Vec3, Vec3), ApiError> {
    if let Some(map) = v.read_lock::<Map>() {
        let o = Options { function: label.to_string(), map: map.clone() };
        o.check(&["up", "down", "color", "strength"])?;
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
    let (mut up, mut down) = read_ambient(&c.value(0), "ambient")?;
    if c.len() > 1 {
        let strength = c.number_in(1, 0.0, 1000.0)? as f32;
        up *= strength;
        down *= strength;
    }
    if c.in_frame {
        hook::edit(|e| e.ambient = Some((up, down)));
        return Ok(Dynamic::UNIT);
    }
    let mut build = c.build();
    (build.settings.ambient_up, build.settings.ambient_down) = (up, down);
    build.ambient_given = true;
    Ok(Dynamic::UNIT)
}

fn change(c: &Call, edit: impl FnOnce(usize) -> LightEdit, change: impl FnOnce(&mut StageLight)) -> Reply {
    let this: LightRef = c.this()?;
    if c.in_frame {
        hook::edit(|e| e.lights.push(edit(this.0)));
    } else {
        change(c.build().light(this.0)?);
    }
    c.itself()
}

fn at(c: &mut Call) -> Reply {
    let position = c.point(0)?;
    change(c, |light| LightEdit::MoveTo { light, position }, |l| l.position = position)
}

fn intensity(c: &mut Call) -> Reply {
    let intensity = c.number_in(0, 0.0, 1e9)? as f32;
    change(c, |light| LightEdit::Intensity { light, intensity }, |l| l.light.intensity = intensity)
}

fn set_color(c: &mut Call) -> Reply {
    let color = rgb_arg(c, 0)?;
    change(c, |light| LightEdit::Color { light, color }, |l| l.light.color = color)
}

fn attach(c: &mut Call) -> Reply {
    let this: LightRef = c.this()?;
    let parent = attachment(c, 0)?;
    c.build().light(this.0)?.parent = Some(parent);
    c.itself()
}

fn key(c: &mut Call) -> Reply {
    let this: LightRef = c.this()?;
    let kind = c.build().light(this.0)?.light.kind;
    // Keys of what such a light has not would change nothing.
    let lacks = match (c.text(0).unwrap_or_default().as_str(), kind) {
        ("cone", LightKind::Directional | LightKind::Point) => Some(("cone", "only a spot has a cone")),
        ("range", LightKind::Directional) => Some(("range", "a sun shines however far")),
        ("direction", LightKind::Point) => Some(("direction", "a point shines in all directions")),
        _ => None,
    };
    if let Some((word, why)) = lacks {
        return Err(ApiError::new(format!("key: {why}, so \"{word}\" has no keys here")).focus(word));
    }
    let channels = keys::read(c, keys::Owner::Light)?;
    keys::replace(&mut c.build().light(this.0)?.channels, channels);
    c.itself()
}
