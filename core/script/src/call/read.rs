//! Conversion of script values to a requested type. Errors read `LABEL must be ALLOWED, got …`.

use super::{ApiError, did_you_mean_text};
use crate::color;
use crate::suggest::list;
use crate::value::{ActorRef, HandleKind, JointRef, kind_of};
use choreo_motion::Time;
use choreo_stage::Target;
use glam::{DQuat, DVec3, Vec3, Vec4};
use rhai::Dynamic;

/// Reads a text that must be one of `allowed`.
pub(crate) fn one_of(v: &Dynamic, label: &str, allowed: &[&'static str]) -> Result<&'static str, ApiError> {
    let given = text(v, label)?;
    allowed.iter().find(|a| **a == given).copied().ok_or_else(|| {
        ApiError::new(format!(
            "{label} must be {}, got \"{given}\"{}",
            list(allowed.iter().copied(), 20),
            did_you_mean_text(&given, allowed.iter().copied())
        ))
        .focus(given)
    })
}

/// The error `LABEL must be ALLOWED, got …`.
pub(crate) fn wrong(v: &Dynamic, label: &str, allowed: &str) -> ApiError {
    let mut error = ApiError::new(format!("{label} must be {allowed}, got {}", describe(v)));
    error.focus = v.clone().into_string().ok();
    if let Ok(letter) = v.as_char() {
        error.hint = Some(format!("write texts in double quotes: \"{letter}\""));
    }
    error
}

/// A value as messages show it.
pub(crate) fn describe(v: &Dynamic) -> String {
    let v = v.flatten_clone();
    if v.is_unit() {
        return "nothing, ()".into();
    }
    if let Ok(b) = v.as_bool() {
        return b.to_string();
    }
    if let Ok(n) = v.as_int() {
        return n.to_string();
    }
    if let Ok(n) = v.as_float() {
        return format!("{n:?}");
    }
    if let Ok(letter) = v.as_char() {
        return format!("the single character '{letter}'");
    }
    if v.is_string() {
        let s = v.into_string().unwrap_or_default();
        let shown: String = s.chars().take(40).collect();
        return format!("the text \"{shown}{}\"", if s.chars().count() > 40 { "…" } else { "" });
    }
    if let Some(a) = v.read_lock::<rhai::Array>() {
        let short = (1..=4).contains(&a.len()) && a.iter().all(|n| n.is_int() || n.is_float());
        let numbers = || a.iter().map(describe).collect::<Vec<_>>().join(", ");
        return if short { format!("[{}]", numbers()) } else { format!("an array of {}", a.len()) };
    }
    if v.is_map() {
        return "an object map".into();
    }
    if v.is_fnptr() {
        return "a function".into();
    }
    match kind_of(&v) {
        HandleKind::None => format!("a value of type {}", v.type_name()),
        k @ (HandleKind::Asset
        | HandleKind::Image
        | HandleKind::Actor
        | HandleKind::Effect
        | HandleKind::Expect) => {
            format!("an {}", k.name())
        }
        k => format!("a {}", k.name()),
    }
}

/// The value of an int or float, which need not be finite; `None` for any other value.
pub(crate) fn int_or_float(v: &Dynamic) -> Option<f64> {
    v.as_int().map(|n| n as f64).or_else(|_| v.as_float()).ok()
}

/// Reads a finite int or float.
pub(crate) fn number(v: &Dynamic, label: &str) -> Result<f64, ApiError> {
    let n = int_or_float(v).ok_or_else(|| wrong(v, label, "a number"))?;
    if n.is_finite() {
        Ok(n)
    } else {
        Err(ApiError::new(format!("{label} must be a finite number, got {n}")))
    }
}

/// Reads a number from `min` to `max`, both included.
pub(crate) fn number_in(v: &Dynamic, label: &str, min: f64, max: f64) -> Result<f64, ApiError> {
    let n = number(v, label)?;
    if (min..=max).contains(&n) {
        return Ok(n);
    }
    Err(ApiError::new(format!("{label} must be from {min} to {max}, got {}", describe(v))))
}

/// Largest time, ±1 000 000 s (11 days): far below where integer time or f64 seconds lose precision.
const LONGEST_SECS: f64 = 1e6;

/// Reads a time in seconds, within ±1 000 000 s.
pub(crate) fn time(v: &Dynamic, label: &str) -> Result<Time, ApiError> {
    let secs = number(v, label).map_err(|e| match int_or_float(v).is_none() {
        true => wrong(v, label, "a time: seconds, or f(frame)"),
        false => e,
    })?;
    if secs.abs() > LONGEST_SECS {
        return Err(ApiError::new(format!(
            "{label} must be a time within ±{LONGEST_SECS} s, got {}",
            describe(v)
        )));
    }
    Ok(Time::from_secs(secs))
}

/// Reads a time in seconds that is not negative.
pub(crate) fn duration(v: &Dynamic, label: &str) -> Result<Time, ApiError> {
    let t = time(v, label)?;
    if t < Time::ZERO {
        return Err(ApiError::new(format!("{label} must not be negative, got {}", describe(v))));
    }
    Ok(t)
}

/// Reads a text.
pub(crate) fn text(v: &Dynamic, label: &str) -> Result<String, ApiError> {
    v.clone().into_string().map_err(|_| wrong(v, label, "text"))
}

/// Reads one text or an array of texts.
pub(crate) fn texts(v: &Dynamic, label: &str) -> Result<Vec<String>, ApiError> {
    match v.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(|v| text(v, label)).collect(),
        None => Ok(vec![text(v, label)?]),
    }
}

/// Reads an array of finite numbers; `None` for any other value.
pub(crate) fn numbers(v: &Dynamic) -> Option<Vec<f64>> {
    let array = v.read_lock::<rhai::Array>()?;
    array.iter().map(|n| number(n, "").ok()).collect()
}

/// Largest coordinate in metres. Larger ones are refused as mistakes.
const FARTHEST: f64 = 1e15;

/// Reads a point [x, y, z] in metres, each within ±1e15.
pub(crate) fn point(v: &Dynamic, label: &str) -> Result<DVec3, ApiError> {
    match numbers(v).as_deref() {
        Some([x, y, z]) => check_coordinates(DVec3::new(*x, *y, *z), label),
        _ => Err(wrong(v, label, "a point, [x, y, z]")),
    }
}

pub(super) fn check_coordinates(p: DVec3, label: &str) -> Result<DVec3, ApiError> {
    if p.abs().max_element() <= FARTHEST {
        return Ok(p);
    }
    Err(ApiError::new(format!("{label} must be within ±{FARTHEST:e} m")))
}

/// Reads an actor, a joint or a point [x, y, z] in metres.
pub(crate) fn target(v: &Dynamic, label: &str) -> Result<Target, ApiError> {
    if let Some(actor) = v.read_lock::<ActorRef>() {
        return Ok(Target::Actor(actor.id));
    }
    if let Some(joint) = v.read_lock::<JointRef>() {
        return Ok(Target::Joint { actor: joint.actor, joint: joint.joint });
    }
    if !v.is_array() {
        return Err(wrong(v, label, "an Actor, a Joint or a point, [x, y, z]"));
    }
    point(v, label).map(Target::Point)
}

/// Linear RGBA from a name, `#rgb`, `#rrggbb`, `#rrggbbaa`, `[r, g, b]` or `[r, g, b, a]` in sRGB.
pub(crate) fn color(v: &Dynamic, label: &str) -> Result<Vec4, ApiError> {
    if v.is_string() {
        let name = text(v, label)?;
        return color::parse_color(&name).map_err(|e| {
            ApiError::new(format!("{label}: {}", e.message))
                .focus(name)
                .hint("a color is a CSS name, \"#rrggbb\" or [r, g, b] with numbers from 0 to 1")
        });
    }
    match numbers(v).as_deref() {
        Some(c @ ([_, _, _] | [_, _, _, _])) if c.iter().all(|c| (0.0..=1.0).contains(c)) => Ok(Vec4::new(
            color::linear_from_srgb(c[0]),
            color::linear_from_srgb(c[1]),
            color::linear_from_srgb(c[2]),
            c.get(3).map_or(1.0, |a| *a as f32),
        )),
        Some([_, _, _] | [_, _, _, _]) => {
            Err(ApiError::new(format!("{label}: the numbers of a color must be from 0 to 1")))
        }
        _ => Err(wrong(v, label, "a color: a name, \"#rrggbb\" or [r, g, b]")),
    }
}

/// Converts degrees to radians. Whole turns are removed first, so that large angles lose no precision in the sine.
pub(crate) fn radians(degrees: f64) -> f64 {
    (degrees % 360.0).to_radians()
}

/// Rotation about x, then y, then z (fixed axes), in degrees.
pub(crate) fn euler(degrees: DVec3) -> DQuat {
    DQuat::from_rotation_z(radians(degrees.z))
        * DQuat::from_rotation_y(radians(degrees.y))
        * DQuat::from_rotation_x(radians(degrees.x))
}

/// Red, green and blue of a color, without alpha.
pub(crate) fn rgb(c: Vec4) -> Vec3 {
    c.truncate()
}
