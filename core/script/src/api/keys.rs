//! Keyframes of properties: `.key("position", [[t, value], …], how)`.

use super::actor::{MOST_WIDE, euler, has_copies, has_pen, morph_targets};
use super::expression;
use crate::call::{ApiError, Call, color, describe, number, number_in, numbers, one_of, rgb, wrong};
use crate::limits::raise_hint;
use choreo_asset::Asset;
use choreo_motion::{Ease, Interpolation, Time};
use choreo_stage::{Channel, Property};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

/// The kind of object whose property is animated.
pub enum Owner<'a> {
    Actor(&'a Asset),
    Camera,
    Light,
    Sky,
    Flat,
    /// A joint of a clip; its name is the argument after the property.
    JointOfClip,
    Joint,
}

const HOW: &[&str] = &["linear", "step", "smooth", "cubic"];

/// Reads the value of one key; the text is its label in messages.
type Reader<'a> = dyn Fn(&Dynamic, &str) -> Result<Vec<f64>, ApiError> + 'a;

/// The channels of a `.key(property, [name,] keys, how?)` call.
pub fn read(c: &Call, owner: Owner) -> Result<Vec<Channel>, ApiError> {
    let allowed: &[&'static str] = match owner {
        Owner::Actor(_) => {
            &["position", "rotation", "scale", "visible", "tint", "width", "count", "morph", "expression"]
        }
        Owner::Camera => &["position", "rotation", "fov"],
        Owner::Light => &["position", "intensity", "color", "kelvin", "direction", "range", "cone"],
        Owner::Sky => &["turn", "strength"],
        Owner::Flat => &["position", "scale", "opacity"],
        Owner::JointOfClip | Owner::Joint => &["position", "rotation", "scale"],
    };
    let flat = matches!(owner, Owner::Flat);
    let name = one_of(&c.value(0), "key: property", allowed)?;
    match (name, &owner) {
        ("width", Owner::Actor(asset)) => has_pen(asset, "key")?,
        ("count", Owner::Actor(asset)) => has_copies(asset, "key")?,
        _ => {}
    }
    let mut next = if matches!(owner, Owner::JointOfClip) { 2 } else { 1 };
    let mut targets = Vec::new();
    if let ("morph" | "expression", Owner::Actor(asset)) = (name, owner) {
        let wanted = c.value(1);
        targets = match name {
            "morph" => {
                let found = morph_targets(asset, &wanted, "key: name")?.into_iter();
                found.map(|(instance, target)| Property::Morph { instance, target }).collect()
            }
            _ => vec![Property::Expression { expression: expression::find(asset, &wanted, "key: name")? }],
        };
        next = 2;
    }
    if next >= c.len() {
        return Err(ApiError::new(format!("key: write key(\"{name}\", name, keys)")));
    }
    let (how, ease) = if c.len() > next + 1 { how_or_ease(c, next + 1)? } else { ("linear", None) };
    let keys = read_keys(c, &c.value(next), "key")?;
    let values = |read: &Reader| {
        keys.iter()
            .enumerate()
            .map(|(i, (_, v))| read(v, &format!("key: value of key {i}")))
            .collect::<Result<Vec<_>, _>>()
    };
    let times: Vec<Time> = keys.iter().map(|(t, _)| *t).collect();
    let four = keys.iter().any(|(_, v)| numbers(v).is_some_and(|n| n.len() == 4));
    let eases = eases(&c.value(next), how, ease)?;
    let eased = |values: Vec<Vec<f64>>| eased(c, &times, values, &eases, straight);
    let turns = |values: Vec<Vec<f64>>| quaternions(c, how, &times, values, &eases);
    let one = |property, values: Vec<Vec<f64>>| {
        let (times, values) = eased(values)?;
        Ok::<_, ApiError>(vec![channel(property, how, &times, &values)])
    };
    Ok(match name {
        "position" if flat => one(Property::Translation, values(&two)?)?,
        "scale" if flat => one(Property::Scale, values(&|v, l| Ok(vec![number_in(v, l, 0.0, 1000.0)?; 3]))?)?,
        "opacity" => one(Property::Opacity, values(&|v, l| Ok(vec![number_in(v, l, 0.0, 1.0)?]))?)?,
        "position" => one(Property::Translation, values(&three)?)?,
        "scale" => one(Property::Scale, values(&factors)?)?,
        "count" => {
            let most = f64::from(u32::MAX);
            one(Property::Copies, values(&|v, l| Ok(vec![number_in(v, l, 0.0, most)?]))?)?
        }
        "width" => {
            let most = f64::from(MOST_WIDE);
            one(Property::PenWidth, values(&|v, l| Ok(vec![number_in(v, l, 0.0, most)?]))?)?
        }
        "tint" => one(Property::Tint, values(&|v, l| Ok(color(v, l)?.to_array().map(f64::from).to_vec()))?)?,
        "color" => {
            one(Property::Color, values(&|v, l| Ok(rgb(color(v, l)?).to_array().map(f64::from).to_vec()))?)?
        }
        "fov" => one(Property::FieldOfView, values(&|v, l| Ok(vec![fov(v, l)?]))?)?,
        "intensity" => one(
            Property::Intensity,
            values(&|v, l| {
                let n = number(v, l)?;
                if n < 0.0 {
                    Err(ApiError::new(format!("{l} must not be negative, got {n:?}")))
                } else {
                    number_in(v, l, 0.0, 1e9).map(|n| vec![n])
                }
            })?,
        )?,
        "kelvin" => one(
            Property::Color,
            values(&|v, l| {
                let warm = number_in(v, l, 1667.0, 25_000.0)?;
                Ok(crate::color::kelvin(warm).to_array().map(f64::from).to_vec())
            })?,
        )?,
        "range" => one(Property::Range, values(&|v, l| Ok(vec![number_in(v, l, 1e-3, 1e9)?]))?)?,
        "cone" => one(Property::Cone, values(&|v, l| Ok(vec![number_in(v, l, 0.1, 90.0)?.to_radians()]))?)?,
        "direction" => {
            let ways = values(&|v, l| Ok(Call::direction(v, l)?.normalize().to_array().to_vec()))?;
            // As in glTF, a rotation turns −Z; each goes on from the one before, so that between them lies the shortest way.
            let (mut way, mut turn) = (DVec3::NEG_Z, DQuat::IDENTITY);
            let turned = ways.iter().map(|next| {
                let next = DVec3::from_slice(next);
                turn = (DQuat::from_rotation_arc(way, next) * turn).normalize();
                way = next;
                turn.to_array().to_vec()
            });
            vec![turns(turned.collect())?]
        }
        "strength" => one(Property::Intensity, values(&|v, l| Ok(vec![number_in(v, l, 0.0, 1000.0)?]))?)?,
        "turn" => {
            let radians = |v: &Dynamic, l: &str| Ok(vec![number_in(v, l, -1e6, 1e6)?.to_radians()]);
            one(Property::Turn, values(&radians)?)?
        }
        // A visible thing appears at its key, whatever `how` says.
        "visible" => {
            let on = values(&|v, l| {
                v.as_bool().map(|b| vec![f64::from(u8::from(b))]).map_err(|_| wrong(v, l, "true or false"))
            })?;
            vec![channel(Property::Visible, "step", &times, &on)]
        }
        "rotation" if four => {
            vec![turns(values(&|v, l| Ok(quaternion(v, l)?.to_array().to_vec()))?)?]
        }
        "rotation" => {
            let (times, angles) = eased(values(&angles)?)?;
            vec![rotation(c, how, &times, &angles)?]
        }
        _ => {
            let (low, high) = if name == "morph" { (-1000.0, 1000.0) } else { (0.0, 1.0) };
            let (times, weights) = eased(values(&|v, l| Ok(vec![number_in(v, l, low, high)?]))?)?;
            let channel = |property| channel(property, how, &times, &weights);
            targets.into_iter().map(channel).collect()
        }
    })
}

/// Channels of a property whose value has several numbers, one channel each. The keyframes are the second argument, `how` the third.
/// `step`: the value cannot be interpolated and holds until the next keyframe, whatever `how` says.
pub fn parts(c: &Call, property: Property, step: bool, read: &Reader) -> Result<Vec<Channel>, ApiError> {
    let (how, ease) = if c.len() > 2 { how_or_ease(c, 2)? } else { ("linear", None) };
    let (how, ease) = if step { ("step", None) } else { (how, ease) };
    let keys = read_keys(c, &c.value(1), "key")?;
    let times: Vec<Time> = keys.iter().map(|(t, _)| *t).collect();
    let values = keys.iter().enumerate().map(|(i, (_, v))| read(v, &format!("key: value of key {i}")));
    let values = values.collect::<Result<Vec<_>, _>>()?;
    let (times, values) = eased(c, &times, values, &eases(&c.value(1), how, ease)?, straight)?;
    let part = |n: usize| values.iter().map(|v| vec![v[n]]).collect::<Vec<_>>();
    let count = values.first().map_or(0, Vec::len);
    Ok((0..count).map(|n| channel(property, how, &times, &part(n))).collect())
}

/// Adds channels; they replace those of the same property.
pub fn replace(channels: &mut Vec<Channel>, new: Vec<Channel>) {
    for channel in new {
        channels.retain(|c| c.property != channel.property);
        channels.push(channel);
    }
}

/// The interpolation between keyframes, read from argument `i`.
pub fn how(c: &Call, i: usize) -> Result<&'static str, ApiError> {
    one_of(&c.value(i), &format!("{}: how", c.def.name), HOW)
}

/// The interpolation as in [`how`], or an easing into every keyframe that has none of its own: a name with in_ or out_, or the points
/// of a Bézier curve.
fn how_or_ease(c: &Call, i: usize) -> Result<(&'static str, Option<Ease>), ApiError> {
    let value = c.value(i);
    let text = value.clone().into_string().unwrap_or_default();
    match value.is_array() || ["in_", "out_"].iter().any(|p| text.starts_with(p)) {
        true => Ok(("linear", Some(super::cue::ease_of(&value, &format!("{}: how", c.def.name))?))),
        false => Ok((how(c, i)?, None)),
    }
}

/// The channel of keyframes with one number each, [[time, number], …].
pub fn scalars(
    c: &Call,
    value: &Dynamic,
    label: &str,
    how: &str,
    property: Property,
    read: &dyn Fn(&Dynamic, &str) -> Result<f64, ApiError>,
) -> Result<Channel, ApiError> {
    let keys = read_keys(c, value, label)?;
    let one = |(i, (_, v)): (usize, &(Time, Dynamic))| Ok(vec![read(v, &format!("{label}: key {i}"))?]);
    let values = keys.iter().enumerate().map(one).collect::<Result<Vec<_>, ApiError>>()?;
    let times: Vec<Time> = keys.iter().map(|(t, _)| *t).collect();
    Ok(channel(property, how, &times, &values))
}

/// Time and value of each keyframe of an array; messages begin with `of`.
fn read_keys(c: &Call, value: &Dynamic, of: &str) -> Result<Vec<(Time, Dynamic)>, ApiError> {
    let Some(rows) = value.read_lock::<rhai::Array>() else {
        return Err(wrong(value, &format!("{of}: keys"), "an array of keys, [[time, value], …]"));
    };
    if rows.is_empty() {
        return Err(ApiError::new(format!("{of}: there must be at least one key, [[time, value], …]")));
    }
    count(c, rows.len())?;
    let mut keys: Vec<(Time, Dynamic)> = Vec::with_capacity(rows.len());
    for (n, row) in rows.iter().enumerate() {
        // A third one is an ease, which is no number: [x, y, z] is a value without its time.
        let is_pair = |p: &rhai::Array| p.len() == 2 || p.len() == 3 && number(&p[2], "").is_err();
        let pair = row.flatten_clone().try_cast::<rhai::Array>().filter(is_pair);
        let Some(pair) = pair else {
            let got = describe(row);
            return Err(ApiError::new(format!("{of}: key {n} must be [time, value], got {got}")));
        };
        let t = c.stage_time(&pair[0], &format!("{of}: time of key {n}"))?;
        if keys.last().is_some_and(|(before, _)| *before >= t) {
            return Err(ApiError::new(format!(
                "{of}: times must increase, but key {n} at {} s follows one at {} s",
                t.as_secs(),
                keys[n - 1].0.as_secs()
            )));
        }
        keys.push((t, pair[1].flatten_clone()));
    }
    Ok(keys)
}

/// The easing into each keyframe: its own, [time, value, ease], else the easing of all.
fn eases(keys: &Dynamic, how: &str, all: Option<Ease>) -> Result<Vec<Option<Ease>>, ApiError> {
    let Some(rows) = keys.read_lock::<rhai::Array>() else { return Ok(Vec::new()) };
    let ease = |(n, row): (usize, &Dynamic)| {
        let Some(given) = row.flatten_clone().try_cast::<rhai::Array>().and_then(|r| r.get(2).cloned())
        else {
            return Ok(all);
        };
        let label = format!("key: ease of key {n}");
        if how != "linear" {
            return Err(ApiError::new(format!(
                "{label}: keys with an ease of their own are linear, not \"{how}\""
            )));
        }
        super::cue::ease_of(&given.flatten_clone(), &label).map(Some)
    };
    rows.iter().enumerate().map(ease).collect()
}

fn straight(a: &[f64], b: &[f64], w: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + (b - a) * w).collect()
}

/// Samples the spans that have an easing: adds 60 keyframes per second, at least 16 per span.
fn eased(
    c: &Call,
    times: &[Time],
    values: Vec<Vec<f64>>,
    eases: &[Option<Ease>],
    mix: fn(&[f64], &[f64], f64) -> Vec<f64>,
) -> Result<(Vec<Time>, Vec<Vec<f64>>), ApiError> {
    let (mut out_times, mut out) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    for (i, value) in values.iter().enumerate() {
        if let (Some(Some(ease)), 1..) = (eases.get(i), i) {
            let span = (times[i] - times[i - 1]).0;
            let steps = (libm::ceil(Time(span).as_secs() * 60.0) as i64).max(16).min(span);
            count(c, steps as usize)?;
            for step in 1..steps {
                let w = ease.at(step as f64 / steps as f64);
                out.push(mix(&values[i - 1], value, w));
                out_times.push(
                    times[i - 1] + Time((i128::from(span) * i128::from(step) / i128::from(steps)) as i64),
                );
            }
        }
        out.push(value.clone());
        out_times.push(times[i]);
    }
    Ok((out_times, out))
}

fn count(c: &Call, more: usize) -> Result<(), ApiError> {
    let mut build = c.build();
    build.keys += more as u64;
    if build.keys > c.shared.limits.keys {
        let error = ApiError::new("key: too many keys on this stage");
        return Err(ApiError { fatal: true, ..error.hint(raise_hint("keys", c.shared.limits.keys)) });
    }
    Ok(())
}

fn three(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    crate::call::point(v, label).map(|p| p.to_array().to_vec())
}

/// Reads a position in the image.
fn two(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    let two = numbers(v).filter(|n| n.len() == 2 && n.iter().all(|n| n.abs() <= 1e6));
    two.map(|n| vec![n[0], n[1], 0.0]).ok_or_else(|| wrong(v, label, "[x, y]"))
}

fn factors(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    /// The same as for `scale`, but an actor may shrink to nothing between its keyframes.
    const LARGEST: f64 = 1e6;
    let three = match numbers(v).filter(|n| n.len() == 3) {
        Some(three) => three,
        None => number(v, label).map(|n| vec![n; 3]).map_err(|_| wrong(v, label, "a number or [x, y, z]"))?,
    };
    match three.iter().all(|n| n.abs() <= LARGEST) {
        true => Ok(three),
        false => Err(wrong(v, label, "within ±1000000")),
    }
}

fn angles(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    match numbers(v).filter(|n| n.len() == 3) {
        Some(three) => Ok(three),
        None => number(v, label)
            .map(|y| vec![0.0, y, 0.0])
            .map_err(|_| wrong(v, label, "degrees about y, or [x, y, z] in degrees")),
    }
}

/// Reads a quaternion [x, y, z, w] and normalizes it.
pub fn quaternion(v: &Dynamic, label: &str) -> Result<DQuat, ApiError> {
    let four = numbers(v).filter(|n| n.len() == 4).map(|n| DQuat::from_xyzw(n[0], n[1], n[2], n[3]));
    let unit = four.filter(|q| q.is_finite() && q.length() > 1e-6).map(DQuat::normalize);
    unit.ok_or_else(|| wrong(v, label, "a quaternion, [x, y, z, w], that is not zero"))
}

/// The channel of quaternion keyframes: slerp on the shortest arc, at constant speed or with easings.
fn quaternions(
    c: &Call,
    how: &str,
    times: &[Time],
    values: Vec<Vec<f64>>,
    eases: &[Option<Ease>],
) -> Result<Channel, ApiError> {
    let smooth = vec![Some(Ease::Smooth); values.len()];
    let (how, eases) = match how {
        "smooth" => ("linear", &smooth[..]),
        "linear" | "step" => (how, eases),
        _ => {
            let text = format!(
                "key: quaternions and directions are keyed \"linear\", \"smooth\" or \"step\", not \"{how}\""
            );
            return Err(ApiError::new(text).hint("key degrees, or more keys, close to each other"));
        }
    };
    let slerp =
        |a: &[f64], b: &[f64], w| DQuat::from_slice(a).slerp(DQuat::from_slice(b), w).to_array().to_vec();
    let (times, values) = eased(c, times, values, eases, slerp)?;
    Ok(channel(Property::Rotation, how, &times, &values))
}

pub fn fov(v: &Dynamic, label: &str) -> Result<f64, ApiError> {
    crate::call::number_in(v, label, 0.1, 179.0).map(f64::to_radians)
}

/// Tangent per second at a keyframe: zero for "smooth", that of the parabola through the neighbours for "cubic"
/// (finite differences weighted by the spans, as in non-uniform Catmull–Rom splines), zero at the ends.
fn tangent(how: &str, times: &[Time], values: &[Vec<f64>], i: usize, component: usize) -> f64 {
    if how == "smooth" || i == 0 || i + 1 == times.len() {
        return 0.0;
    }
    let at = |k: usize| (times[k].as_secs(), values[k][component]);
    let ((t0, v0), (t1, v1), (t2, v2)) = (at(i - 1), at(i), at(i + 1));
    let (left, right) = (t1 - t0, t2 - t1);
    ((v1 - v0) / left * right + (v2 - v1) / right * left) / (left + right)
}

fn channel(property: Property, how: &str, times: &[Time], values: &[Vec<f64>]) -> Channel {
    let interpolation = match how {
        "step" => Interpolation::Step,
        "linear" => Interpolation::Linear,
        _ => Interpolation::CubicSpline,
    };
    let mut flat = Vec::new();
    for (i, value) in values.iter().enumerate() {
        if interpolation == Interpolation::CubicSpline {
            let tangents: Vec<f64> = (0..value.len()).map(|n| tangent(how, times, values, i, n)).collect();
            flat.extend_from_slice(&tangents);
            flat.extend_from_slice(value);
            flat.extend_from_slice(&tangents);
        } else {
            flat.extend_from_slice(value);
        }
    }
    Channel { property, interpolation, times: times.to_vec(), values: flat }
}

/// Converts keyframes of Euler angles to quaternion keyframes, which are so close to each other that the shortest arc between two is
/// the path of the angles: 0 to 360 degrees is a whole turn. About one axis that is exact; else there is a keyframe every 5 degrees.
fn rotation(c: &Call, how: &str, times: &[Time], degrees: &[Vec<f64>]) -> Result<Channel, ApiError> {
    const LARGEST_STEP: f64 = 120.0;
    const SMALL_STEP: f64 = 5.0;
    if degrees.iter().flatten().any(|d| d.abs() > 1e9) {
        return Err(ApiError::new("key: angles must be within ±1e9 degrees"));
    }
    let quat = |d: [f64; 3]| euler(DVec3::from_array(d)).to_array();
    let one_axis = (0..3).filter(|n| degrees.iter().any(|d| d[*n] != 0.0)).count() <= 1;
    let mut out_times = vec![times[0]];
    let mut out = vec![quat([degrees[0][0], degrees[0][1], degrees[0][2]])];
    for i in 1..times.len() {
        let widest = (0..3).map(|n| (degrees[i][n] - degrees[i - 1][n]).abs()).fold(0.0, f64::max);
        let step = if how == "linear" && one_axis { LARGEST_STEP } else { SMALL_STEP };
        // Cubics may swing further than their ends are apart: at least a few keys.
        let least = if matches!(how, "smooth" | "cubic") { 16.0 } else { 1.0 };
        let steps = if how == "step" { 1.0 } else { libm::ceil(widest / step).max(least) };
        count(c, steps.min(1e9) as usize)?;
        let span = times[i] - times[i - 1];
        for s in 1..=steps as i64 {
            let w = s as f64 / steps;
            let value = std::array::from_fn(|n| between(how, times, degrees, i, n, w));
            let t = if s as f64 == steps { times[i] } else { times[i - 1] + span.scaled(w) };
            if t > out_times[out_times.len() - 1] {
                out_times.push(t);
                out.push(quat(value));
            }
        }
    }
    // Neighbours in the same half space, so that blending components takes the short way too.
    for i in 1..out.len() {
        let before = DQuat::from_array(out[i - 1]);
        if before.dot(DQuat::from_array(out[i])) < 0.0 {
            out[i] = out[i].map(|v| -v);
        }
    }
    let interpolation = if how == "step" { Interpolation::Step } else { Interpolation::Linear };
    let values = out.into_iter().flatten().collect();
    Ok(Channel { property: Property::Rotation, interpolation, times: out_times, values })
}

/// Component `n` of the angles between keys `i - 1` and `i`, at weight `w`: cubic Hermite, or a straight line.
fn between(how: &str, times: &[Time], values: &[Vec<f64>], i: usize, n: usize, w: f64) -> f64 {
    let (a, b) = (values[i - 1][n], values[i][n]);
    match how {
        "step" => b,
        "linear" => a + (b - a) * w,
        _ => {
            let span = (times[i] - times[i - 1]).as_secs();
            let (ma, mb) = (tangent(how, times, values, i - 1, n), tangent(how, times, values, i, n));
            let (w2, w3) = (w * w, w * w * w);
            (2.0 * w3 - 3.0 * w2 + 1.0) * a
                + (w3 - 2.0 * w2 + w) * span * ma
                + (3.0 * w2 - 2.0 * w3) * b
                + (w3 - w2) * span * mb
        }
    }
}
