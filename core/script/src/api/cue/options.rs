//! The options of `play` and `then`, and the methods of the same names.

use crate::build::CueDraft;
use crate::call::{ApiError, Call};
use crate::suggest::{did_you_mean, list};
use choreo_motion::{Ease, Shape, Time};
use choreo_stage::{Property, Repeat, SpeedCurve, TimeRemapping};
use rhai::Dynamic;
use std::sync::Arc;

const OPTIONS: &[&str] = &[
    "from", "until", "fade", "fade_out", "speed", "ease", "trim", "repeat", "reverse", "weight", "in_step",
    "inertial",
];

pub fn read_options(c: &Call, i: usize, cue: &mut CueDraft) -> Result<(), ApiError> {
    let o = c.options(i, OPTIONS)?;
    let time = |name: &str| o.get(name).map(|v| c.stage_time(&v, &o.label(name))).transpose();
    cue.start = time("from")?.or(cue.start);
    cue.until = time("until")?.or(cue.until);
    cue.fade_in = o.duration("fade")?.unwrap_or(cue.fade_in);
    cue.fade_out = o.duration("fade_out")?.or(o.duration("fade")?).or(cue.fade_out);
    if let Some(speed) = o.get("speed") {
        set_speed(c, cue, &speed, "linear", &o.label("speed"))?;
    }
    cue.in_step = o.flag("in_step")?.unwrap_or(cue.in_step);
    cue.inertialization = o.duration("inertial")?.unwrap_or(cue.inertialization);
    if let Some(ease) = o.get("ease") {
        cue.ease = ease_of(&ease, &o.label("ease"))?;
    }
    if let Some(trim) = o.get("trim") {
        let ends = crate::call::numbers(&trim).filter(|n| n.len() == 2);
        let ends = ends.ok_or_else(|| crate::call::wrong(&trim, &o.label("trim"), "[start, end]"))?;
        set_trim(cue, Time::from_secs(ends[0]), Time::from_secs(ends[1]))?;
    }
    match o.one_of("repeat", &["once", "loop", "ping_pong"])? {
        Some("once") => cue.repeat = Some(Repeat::Once),
        Some("loop") => cue.repeat = Some(Repeat::Loop),
        Some(_) => cue.repeat = Some(Repeat::PingPong),
        None => {}
    }
    if o.flag("reverse")? == Some(true) {
        cue.reverse = !cue.reverse;
    }
    if let Some(weight) = o.get("weight") {
        set_weight(c, cue, &weight, "linear", &o.label("weight"))?;
    }
    Ok(())
}

/// Reads an easing: a name, `in_out_cubic`, or the control points of a Bézier curve, `[x1, y1, x2, y2]`.
pub fn ease_of(value: &Dynamic, label: &str) -> Result<Ease, ApiError> {
    if let Some(points) = crate::call::numbers(value) {
        let bezier = <[f64; 4]>::try_from(points).ok().filter(|p| p.iter().all(|v| (0.0..=1.0).contains(v)));
        return bezier
            .map(Ease::Bezier)
            .ok_or_else(|| crate::call::wrong(value, label, "[x1, y1, x2, y2] with numbers from 0 to 1"));
    }
    let name = crate::call::text(value, label)?;
    match name.as_str() {
        "linear" => return Ok(Ease::Linear),
        "smooth" => return Ok(Ease::Smooth),
        _ => {}
    }
    type Way = fn(Shape) -> Ease;
    let ways: [(&str, Way); 3] = [("in_out_", Ease::InOut), ("in_", Ease::In), ("out_", Ease::Out)];
    for (prefix, way) in ways {
        let shape = name.strip_prefix(prefix).and_then(|rest| Shape::ALL.iter().find(|(n, _)| *n == rest));
        if let Some((_, shape)) = shape {
            return Ok(way(*shape));
        }
    }
    let shaped = ways.iter().flat_map(|(way, _)| Shape::ALL.iter().map(move |(n, _)| format!("{way}{n}")));
    let names: Vec<String> = ["linear", "smooth"].into_iter().map(str::to_string).chain(shaped).collect();
    let names = names.iter().map(String::as_str);
    Err(ApiError::new(format!("{label}: unknown ease \"{name}\"{}", did_you_mean(&name, names.clone())))
        .focus(name.clone())
        .hint(format!("known: {}, or a Bézier curve, [x1, y1, x2, y2]", list(names, 30))))
}

/// Sets a weight from 0 to 1, or keyframes of it, [[time, weight], …].
pub fn set_weight(
    c: &Call,
    cue: &mut CueDraft,
    value: &Dynamic,
    how: &str,
    label: &str,
) -> Result<(), ApiError> {
    if !value.is_array() {
        cue.weight = crate::call::number_in(value, label, 0.0, 1.0)? as f32;
        cue.weight_keys = None;
        return Ok(());
    }
    let weight = |v: &Dynamic, label: &str| crate::call::number_in(v, label, 0.0, 1.0);
    let keys = super::super::keys::scalars(c, value, label, how, Property::Weight, &weight)?;
    cue.weight_keys = Some(Arc::new(keys));
    Ok(())
}

/// Sets the playback speed: a factor, or keyframes of it over stage time.
pub fn set_speed(
    c: &Call,
    cue: &mut CueDraft,
    value: &Dynamic,
    how: &str,
    label: &str,
) -> Result<(), ApiError> {
    if value.is_array() {
        let speed = |v: &Dynamic, label: &str| crate::call::number_in(v, label, -1000.0, 1000.0);
        let keys = super::super::keys::scalars(c, value, label, how, Property::Speed, &speed)?;
        cue.time_remapping = Some(Arc::new(TimeRemapping::Speed(SpeedCurve::new(keys))));
        return Ok(());
    }
    let speed = crate::call::number(value, label)?;
    if !(0.001..=1000.0).contains(&speed.abs()) {
        return Err(ApiError::new(format!(
            "{label} must be from 0.001 to 1000 (or negative, backwards), got {speed:?}"
        )));
    }
    cue.time_remapping = None;
    cue.speed = speed.abs();
    cue.reverse = speed < 0.0;
    Ok(())
}

pub fn set_trim(cue: &mut CueDraft, start: Time, end: Time) -> Result<(), ApiError> {
    let duration = cue.clip.duration;
    if start < Time::ZERO || end > duration || start >= end {
        return Err(ApiError::new(format!(
            "trim: from {} s to {} s is no part of clip \"{}\", which runs from 0 s to {} s",
            start.as_secs(),
            end.as_secs(),
            cue.clip.name,
            duration.as_secs()
        )));
    }
    cue.trim = Some((start, end));
    Ok(())
}
