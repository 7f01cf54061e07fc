//! Keyframes of properties: `.key("position", [[t, value], …], how)`.

use super::key_spline::{self, KeyShape, Spline, TangentForm};
use crate::call::fields::pair;
use crate::call::{ApiError, Call, color, describe, euler, number, number_in, numbers, one_of, wrong};
use crate::limits::raise_hint;
use choreo_motion::{Ease, Interpolation, Time};
use choreo_stage::{Channel, Described, Field, FieldType, Property, Tangents};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

/// A property that keyframes animate.
#[derive(Clone, Copy)]
pub(crate) struct KeyedProperty {
    /// The name that scripts use.
    pub name: &'static str,
    pub field_type: FieldType,
    pub property: Property,
}

/// The properties of a type of the stage that keyframes animate.
pub(crate) fn keyed_properties<T: Described>() -> Vec<KeyedProperty> {
    let keyed = |field: &Field<T>| {
        field.keyed.map(|(name, property)| KeyedProperty { name, field_type: field.field_type, property })
    };
    T::FIELDS.iter().filter_map(keyed).collect()
}

/// Names of the interpolations in scripts.
pub const INTERPOLATIONS: &[&str] = &["linear", "step", "smooth", "cubic", "catmull_rom"];

/// Reads the value of one key. The text argument is its label in messages.
type Reader<'a> = dyn Fn(&Dynamic, &str) -> Result<Vec<f64>, ApiError> + 'a;

/// The channels of a `.key(property, keys, how?)` call on a value of the stage.
pub(crate) fn channels_of<T: Described>(c: &Call, of: &T) -> Result<Vec<Channel>, ApiError> {
    let keyed = named_property(c, &keyed_properties::<T>())?;
    let is_it = |field: &&Field<T>| field.keyed.is_some_and(|(name, _)| name == keyed.name);
    if let Some(why) = T::FIELDS.iter().find(is_it).and_then(|field| (field.missing_reason)(of)) {
        let text = format!("key: {why}, so \"{}\" has no keys here", keyed.name);
        return Err(ApiError::new(text).focus(keyed.name));
    }
    Ok(vec![channel(c, keyed, 1)?])
}

/// The property that the first argument of a `.key(property, …)` call names.
pub(crate) fn named_property(c: &Call, all: &[KeyedProperty]) -> Result<KeyedProperty, ApiError> {
    let names: Vec<&'static str> = all.iter().map(|keyed| keyed.name).collect();
    let name = one_of(&c.value(0), "key: property", &names)?;
    let found = all.iter().find(|keyed| keyed.name == name).copied();
    found.ok_or_else(|| c.wrong(0, "a property"))
}

/// The channel of a property, from the keyframes in argument `at` and the interpolation after it.
pub(crate) fn channel(c: &Call, keyed: KeyedProperty, at: usize) -> Result<Channel, ApiError> {
    if at >= c.len() {
        return Err(ApiError::new(format!("key: write key(\"{}\", name, keys)", keyed.name)));
    }
    let given = read_interpolation(c, at + 1)?;
    let keys = read_keys(c, &c.value(at), "key")?;
    let values = |read: &Reader| {
        let label = |i| format!("key: value of key {i}");
        keys.iter().enumerate().map(|(i, key)| read(&key.value, &label(i))).collect::<Result<Vec<_>, _>>()
    };
    let times: Vec<Time> = keys.iter().map(|key| key.time).collect();
    let KeyedProperty { field_type, property, .. } = keyed;
    let is_quaternion = |key: &Key| numbers(&key.value).is_some_and(|n| n.len() == 4);
    let of_quaternions = field_type == FieldType::Rotation && keys.iter().any(is_quaternion);
    let shapes = key_shapes(c, &keys, "key", given, tangent_form(field_type, property, of_quaternions))?;
    let how = given.how;
    match field_type {
        FieldType::Rotation if of_quaternions => {
            let turns = values(&|v, l| Ok(quaternion(v, l)?.to_array().to_vec()))?;
            quaternion_channel(c, how, &times, turns, &shapes)
        }
        FieldType::Rotation => {
            let angles = values(&euler_degrees)?;
            if let Some(spline) = Spline::of(c, how, (&times, &angles), &shapes, false)? {
                return euler_channel(
                    c,
                    how,
                    &spline.times,
                    &spline.values,
                    Some(EulerSpline::with_own_tangents(&spline)),
                );
            }
            let (times, angles) = sample_easings(c, &times, angles, &shapes, lerp_components)?;
            let spline =
                tangents(how).map(|t| Spline::symmetric(&times, &angles, t.of(&times, &angles, false)));
            euler_channel(c, how, &times, &angles, spline.as_ref().map(EulerSpline::without_own_tangents))
        }
        FieldType::Direction => {
            let ways = values(&|v, l| Ok(Call::direction(v, l)?.normalize().to_array().to_vec()))?;
            quaternion_channel(c, how, &times, rotations_between(&ways), &shapes)
        }
        // Flags such as visibility change at the keyframe, whatever `how` says.
        FieldType::Flag => {
            let flag = |v: &Dynamic, l: &str| {
                v.as_bool().map(|on| vec![f64::from(u8::from(on))]).map_err(|_| wrong(v, l, "true or false"))
            };
            Ok(make_channel(property, "step", &times, &values(&flag)?))
        }
        _ => {
            let values = values(&|v, l| components(v, l, field_type, property.width()))?;
            shaped_channel(c, property, how, &times, values, &shapes)
        }
    }
}

/// The channel of keyframes that may have easings and tangents of their own.
fn shaped_channel(
    c: &Call,
    property: Property,
    how: &str,
    times: &[Time],
    values: Vec<Vec<f64>>,
    shapes: &[KeyShape],
) -> Result<Channel, ApiError> {
    if let Some(spline) = Spline::of(c, how, (times, &values), shapes, property == Property::Translation)? {
        return Ok(spline_channel(property, &spline, 0..property.width()));
    }
    let (times, values) = sample_easings(c, times, values, shapes, lerp_components)?;
    Ok(make_channel(property, how, &times, &values))
}

/// The components `parts` of a spline as a channel.
fn spline_channel(property: Property, spline: &Spline, parts: std::ops::Range<usize>) -> Channel {
    let Spline { times, values, incoming, outgoing } = spline;
    let key = |i: usize| {
        [&incoming[i], &values[i], &outgoing[i]].into_iter().flat_map(|of| of[parts.clone()].to_vec())
    };
    Channel {
        property,
        interpolation: Interpolation::CubicSpline,
        times: times.clone(),
        values: (0..times.len()).flat_map(key).collect(),
    }
}

/// Form in which a script gives the tangents of a property.
fn tangent_form(field_type: FieldType, property: Property, of_quaternions: bool) -> TangentForm {
    let width = property.width();
    let numbers = |least: usize, factor: f64| TangentForm::Numbers { min_count: least, width, factor };
    match field_type {
        FieldType::Rotation if of_quaternions => {
            TangentForm::None("quaternions have no tangents; key degrees")
        }
        FieldType::Rotation => TangentForm::Angles,
        FieldType::Direction => TangentForm::None("directions have no tangents"),
        FieldType::Flag => {
            TangentForm::None("true and false hold until the next key, so they have no tangents")
        }
        FieldType::Kelvin => TangentForm::None("a color temperature has no tangents; key the color"),
        FieldType::Degrees(..) => numbers(1, 1f64.to_radians()),
        FieldType::Pair => numbers(2, 1.0),
        FieldType::Color => numbers(3, 1.0),
        _ => numbers(width, 1.0),
    }
}

/// The numbers of a keyframe.
fn components(v: &Dynamic, label: &str, field_type: FieldType, width: usize) -> Result<Vec<f64>, ApiError> {
    match field_type {
        FieldType::Number(low, high, _) => Ok(vec![number_in(v, label, low, high)?; width]),
        FieldType::Degrees(low, high) => Ok(vec![number_in(v, label, low, high)?.to_radians()]),
        FieldType::Kelvin => {
            let warm = number_in(v, label, crate::color::KELVIN_RANGE.0, crate::color::KELVIN_RANGE.1)?;
            Ok(crate::color::black_body_color(warm).to_array().map(f64::from).to_vec())
        }
        FieldType::Color => Ok(color(v, label)?.to_array()[..width].iter().map(|v| f64::from(*v)).collect()),
        FieldType::Scale => scale_factors(v, label),
        FieldType::Pair => pair(v, label).map(|p| vec![p.x, p.y, 0.0]),
        _ => point_components(v, label),
    }
}

/// Rotations from −Z (as in glTF) to unit vectors. Each continues from the one before by the shortest arc.
fn rotations_between(ways: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (mut way, mut turn) = (DVec3::NEG_Z, DQuat::IDENTITY);
    let turned = ways.iter().map(|next| {
        let next = DVec3::from_slice(next);
        turn = (DQuat::from_rotation_arc(way, next) * turn).normalize();
        way = next;
        turn.to_array().to_vec()
    });
    turned.collect()
}

/// Channels of a property whose value has several numbers, one channel each. The keyframes are the second argument, `how` the third.
/// `step`: the value cannot be interpolated and holds until the next keyframe, whatever `how` says.
pub(crate) fn component_channels(
    c: &Call,
    property: Property,
    step: bool,
    read: &Reader,
) -> Result<Vec<Channel>, ApiError> {
    let given = read_interpolation(c, 2)?;
    let given = if step { KeyInterpolation { how: "step", ease: None } } else { given };
    let keys = read_keys(c, &c.value(1), "key")?;
    let times: Vec<Time> = keys.iter().map(|key| key.time).collect();
    let values = keys.iter().enumerate().map(|(i, key)| read(&key.value, &format!("key: value of key {i}")));
    let values = values.collect::<Result<Vec<_>, _>>()?;
    let count = values.first().map_or(0, Vec::len);
    let form = match step {
        true => TangentForm::None("its values hold until the next key, so they have no tangents"),
        false => TangentForm::numbers(count),
    };
    let shapes = key_shapes(c, &keys, "key", given, form)?;
    if let Some(spline) = Spline::of(c, given.how, (&times, &values), &shapes, false)? {
        return Ok((0..count).map(|n| spline_channel(property, &spline, n..n + 1)).collect());
    }
    let (times, values) = sample_easings(c, &times, values, &shapes, lerp_components)?;
    let part = |n: usize| values.iter().map(|v| vec![v[n]]).collect::<Vec<_>>();
    Ok((0..count).map(|n| make_channel(property, given.how, &times, &part(n))).collect())
}

/// Adds channels, which replace those of the same property.
pub(crate) fn replace_channels(channels: &mut Vec<Channel>, new: Vec<Channel>) {
    for channel in new {
        channels.retain(|c| c.property != channel.property);
        channels.push(channel);
    }
}

/// The interpolation or the easing of all keyframes of a property.
#[derive(Clone, Copy)]
pub(crate) struct KeyInterpolation {
    /// The interpolation between them.
    pub how: &'static str,
    /// The easing into keyframes without their own.
    pub ease: Option<Ease>,
}

impl KeyInterpolation {
    pub(crate) const LINEAR: KeyInterpolation = KeyInterpolation { how: "linear", ease: None };
}

/// The interpolation that argument `i` names, linear where it is left out, or an easing: a name with in_ or out_, or the points of a
/// Bézier curve.
pub(crate) fn read_interpolation(c: &Call, i: usize) -> Result<KeyInterpolation, ApiError> {
    if i >= c.len() {
        return Ok(KeyInterpolation::LINEAR);
    }
    let (value, label) = (c.value(i), format!("{}: how", c.def.name));
    let text = value.clone().into_string().unwrap_or_default();
    match value.is_array() || ["in_", "out_"].iter().any(|p| text.starts_with(p)) {
        true => Ok(KeyInterpolation {
            ease: Some(super::easing::ease_of(&value, &label)?),
            ..KeyInterpolation::LINEAR
        }),
        false => Ok(KeyInterpolation { how: one_of(&value, &label, INTERPOLATIONS)?, ease: None }),
    }
}

/// The channel of keyframes with one number each, [[time, number], …].
pub(crate) fn scalar_channel(
    c: &Call,
    value: &Dynamic,
    label: &str,
    given: KeyInterpolation,
    property: Property,
    read: &dyn Fn(&Dynamic, &str) -> Result<f64, ApiError>,
) -> Result<Channel, ApiError> {
    let keys = read_keys(c, value, label)?;
    let one = |(i, key): (usize, &Key)| Ok(vec![read(&key.value, &format!("{label}: key {i}"))?]);
    let values = keys.iter().enumerate().map(one).collect::<Result<Vec<_>, ApiError>>()?;
    let times: Vec<Time> = keys.iter().map(|key| key.time).collect();
    let shapes = key_shapes(c, &keys, label, given, TangentForm::numbers(1))?;
    shaped_channel(c, property, given.how, &times, values, &shapes)
}

/// A keyframe as a script states it.
struct Key {
    time: Time,
    value: Dynamic,
    /// The easing or the map of tangents after the value.
    shape: Option<Dynamic>,
}

/// The keyframes of an array; messages begin with `of`.
fn read_keys(c: &Call, value: &Dynamic, of: &str) -> Result<Vec<Key>, ApiError> {
    let Some(rows) = value.read_lock::<rhai::Array>() else {
        return Err(wrong(value, &format!("{of}: keys"), "an array of keys, [[time, value], …]"));
    };
    if rows.is_empty() {
        return Err(ApiError::new(format!("{of}: there must be at least one key, [[time, value], …]")));
    }
    count_keyframes(c, rows.len())?;
    let mut keys: Vec<Key> = Vec::with_capacity(rows.len());
    for (n, row) in rows.iter().enumerate() {
        // A third element must be an easing or a map, not a number: [x, y, z] is a value without a time.
        let is_pair = |p: &rhai::Array| p.len() == 2 || p.len() == 3 && number(&p[2], "").is_err();
        let pair = row.flatten_clone().try_cast::<rhai::Array>().filter(is_pair);
        let Some(pair) = pair else {
            let got = describe(row);
            return Err(ApiError::new(format!("{of}: key {n} must be [time, value], got {got}")));
        };
        let t = c.stage_time(&pair[0], &format!("{of}: time of key {n}"))?;
        if keys.last().is_some_and(|before| before.time > t) {
            return Err(ApiError::new(format!(
                "{of}: times must increase, but key {n} at {} s follows one at {} s",
                t.as_secs(),
                keys[n - 1].time.as_secs()
            )));
        }
        if keys.last().is_some_and(|before| before.time == t) {
            // Two keys at one time are a jump: the first is moved one tick earlier.
            keys[n - 1].time = t - Time(1);
            if n > 1 && keys[n - 2].time >= keys[n - 1].time {
                let text = format!("{of}: at most two keys can have the same time, but key {n} is the third");
                return Err(ApiError::new(format!("{text} at {} s", t.as_secs())));
            }
        }
        let shape = pair.get(2).map(Dynamic::flatten_clone);
        keys.push(Key { time: t, value: pair[1].flatten_clone(), shape });
    }
    Ok(keys)
}

/// Easing and tangents of each keyframe: its own, else the easing of all.
fn key_shapes(
    c: &Call,
    keys: &[Key],
    of: &str,
    given: KeyInterpolation,
    form: TangentForm,
) -> Result<Vec<KeyShape>, ApiError> {
    let KeyInterpolation { how, ease: all } = given;
    let shape = |(n, key): (usize, &Key)| {
        let shape = key_spline::read_key_shape(c, key.shape.as_ref(), of, n, form)?;
        if shape.ease.is_some() && how != "linear" {
            return Err(ApiError::new(format!(
                "{of}: ease of key {n}: a key with an ease is always linear, not \"{how}\""
            )));
        }
        Ok(shape)
    };
    let mut shapes = keys.iter().enumerate().map(shape).collect::<Result<Vec<_>, ApiError>>()?;
    for n in 1..shapes.len() {
        if !shapes[n - 1].outgoing.is_given() && !shapes[n].incoming.is_given() {
            shapes[n].ease = shapes[n].ease.or(all);
        }
    }
    Ok(shapes)
}

fn lerp_components(a: &[f64], b: &[f64], w: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + (b - a) * w).collect()
}

/// Samples the spans that have an easing: adds 60 keyframes per second, at least 16 per span.
fn sample_easings(
    c: &Call,
    times: &[Time],
    values: Vec<Vec<f64>>,
    shapes: &[KeyShape],
    mix: fn(&[f64], &[f64], f64) -> Vec<f64>,
) -> Result<(Vec<Time>, Vec<Vec<f64>>), ApiError> {
    let (mut out_times, mut out) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    for (i, value) in values.iter().enumerate() {
        if let (Some(KeyShape { ease: Some(ease), .. }), 1..) = (shapes.get(i), i) {
            let span = (times[i] - times[i - 1]).0;
            let steps = steps_of_ease(Time(span));
            count_keyframes(c, steps as usize)?;
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

/// Number of keyframes that sample an easing within a span.
pub(super) fn steps_of_ease(span: Time) -> i64 {
    (libm::ceil(span.as_secs() * 60.0) as i64).max(16).min(span.0)
}

pub(super) fn count_keyframes(c: &Call, more: usize) -> Result<(), ApiError> {
    let mut stage_draft = c.stage_draft();
    stage_draft.keyframe_count += more as u64;
    if stage_draft.keyframe_count > c.context.limits.keys {
        let error = ApiError::new("key: too many keys on this stage");
        return Err(ApiError { fatal: true, ..error.hint(raise_hint("keys", c.context.limits.keys)) });
    }
    Ok(())
}

fn point_components(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    crate::call::point(v, label).map(|p| p.to_array().to_vec())
}

fn scale_factors(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    /// Largest factor, as for `scale`. Unlike there, 0 is allowed.
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

fn euler_degrees(v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
    match numbers(v).filter(|n| n.len() == 3) {
        Some(three) => Ok(three),
        None => number(v, label)
            .map(|y| vec![0.0, y, 0.0])
            .map_err(|_| wrong(v, label, "degrees about y, or [x, y, z] in degrees")),
    }
}

/// The arguments of `rotate`: three angles about x, then y, then z, or a quaternion.
pub(crate) fn angles_or_quaternion(c: &mut Call) -> Result<DQuat, ApiError> {
    if c.len() > 1 {
        return Ok(euler(DVec3::new(c.number(0)?, c.number(1)?, c.number(2)?)));
    }
    quaternion(&c.value(0), "rotate").map_err(|e| match c.number(0) {
        Ok(angle) => e.hint(format!(
            "write .turn({angle}) to rotate about the vertical axis, or three angles: .rotate(0, {angle}, 0)"
        )),
        Err(_) => e,
    })
}

/// Reads a quaternion [x, y, z, w] and normalizes it. Error: its length is zero or not finite.
pub(crate) fn quaternion(v: &Dynamic, label: &str) -> Result<DQuat, ApiError> {
    let four = numbers(v).filter(|n| n.len() == 4).map(|n| DQuat::from_xyzw(n[0], n[1], n[2], n[3]));
    let unit = four.filter(|q| q.is_finite() && q.length() > 1e-6).map(DQuat::normalize);
    unit.ok_or_else(|| wrong(v, label, "a quaternion, [x, y, z, w], that is not zero"))
}

/// The channel of quaternion keyframes: slerp on the shortest arc, at constant speed or with easings.
fn quaternion_channel(
    c: &Call,
    how: &str,
    times: &[Time],
    values: Vec<Vec<f64>>,
    shapes: &[KeyShape],
) -> Result<Channel, ApiError> {
    let smooth = vec![KeyShape { ease: Some(Ease::Smooth), ..KeyShape::default() }; values.len()];
    let (how, shapes) = match how {
        "smooth" => ("linear", &smooth[..]),
        "linear" | "step" => (how, shapes),
        _ => {
            let text = format!(
                "key: quaternions and directions are keyed \"linear\", \"smooth\" or \"step\", not \"{how}\""
            );
            return Err(ApiError::new(text).hint("key degrees, or more keys, close to each other"));
        }
    };
    let slerp =
        |a: &[f64], b: &[f64], w| DQuat::from_slice(a).slerp(DQuat::from_slice(b), w).to_array().to_vec();
    let (times, values) = sample_easings(c, times, values, shapes, slerp)?;
    Ok(make_channel(Property::Rotation, how, &times, &values))
}

/// The tangents of a cubic `how`; `None` for other interpolations.
pub(super) fn tangents(how: &str) -> Option<Tangents> {
    match how {
        "smooth" => Some(Tangents::Flat),
        "cubic" => Some(Tangents::Limited),
        "catmull_rom" => Some(Tangents::CatmullRom),
        _ => None,
    }
}

fn make_channel(property: Property, how: &str, times: &[Time], values: &[Vec<f64>]) -> Channel {
    let (interpolation, flat) = match tangents(how) {
        Some(tangents) => {
            let tangents = tangents.of(times, values, property == Property::Translation);
            let key = |(tangent, value): (&Vec<f64>, &Vec<f64>)| [&tangent[..], value, tangent].concat();
            (Interpolation::CubicSpline, tangents.iter().zip(values).flat_map(key).collect())
        }
        None if how == "step" => (Interpolation::Step, values.concat()),
        None => (Interpolation::Linear, values.concat()),
    };
    Channel { property, interpolation, times: times.to_vec(), values: flat }
}

/// Converts keyframes of Euler angles to quaternion keyframes, dense enough that the shortest arcs between them follow
/// the path of the angles: 0 to 360 degrees is a whole turn. Linear rotation about one axis is exact; otherwise there
/// is a keyframe every 5 degrees.
fn euler_channel(
    c: &Call,
    how: &str,
    times: &[Time],
    degrees: &[Vec<f64>],
    euler_spline: Option<EulerSpline>,
) -> Result<Channel, ApiError> {
    const MAX_STEP_ONE_AXIS: f64 = 120.0;
    const MAX_STEP: f64 = 5.0;
    if degrees.iter().flatten().any(|d| d.abs() > 1e9) {
        return Err(ApiError::new("key: angles must be within ±1e9 degrees"));
    }
    let quat = |d: [f64; 3]| euler(DVec3::from_array(d)).to_array();
    let one_axis = (0..3).filter(|n| degrees.iter().any(|d| d[*n] != 0.0)).count() <= 1;
    let mut out_times = vec![times[0]];
    let mut out = vec![quat([degrees[0][0], degrees[0][1], degrees[0][2]])];
    for i in 1..times.len() {
        let span = times[i] - times[i - 1];
        let path_degrees = match &euler_spline {
            Some(euler_spline) if euler_spline.has_own_tangents => euler_spline.max_path_degrees(i, span),
            _ => (0..3).map(|n| (degrees[i][n] - degrees[i - 1][n]).abs()).fold(0.0, f64::max),
        };
        let is_straight = euler_spline
            .as_ref()
            .is_none_or(|euler_spline| euler_spline.has_own_tangents && euler_spline.is_straight(i, span));
        let step = if how == "linear" && one_axis && is_straight { MAX_STEP_ONE_AXIS } else { MAX_STEP };
        // A cubic can overshoot its ends, so it gets at least 16 keys.
        let least = if is_straight { 1.0 } else { 16.0 };
        let steps =
            if how == "step" { 1.0 } else { libm::ceil(path_degrees / step).max(least).min(span.0 as f64) };
        count_keyframes(c, steps.min(1e9) as usize)?;
        for s in 1..=steps as i64 {
            let w = s as f64 / steps;
            let value = std::array::from_fn(|n| {
                let (a, b) = (degrees[i - 1][n], degrees[i][n]);
                match &euler_spline {
                    _ if how == "step" => b,
                    Some(euler_spline) if !is_straight => {
                        hermite([a, b], euler_spline.tangents(i, n), span, w)
                    }
                    _ => a + (b - a) * w,
                }
            });
            let t = if s as f64 == steps { times[i] } else { times[i - 1] + span.scaled(w) };
            if t > out_times[out_times.len() - 1] {
                out_times.push(t);
                out.push(quat(value));
            }
        }
    }
    // Neighboring quaternions are put in the same hemisphere, so that interpolating components takes the shortest arc,
    // too.
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

/// Euler angles in degrees along a spline.
struct EulerSpline<'a> {
    spline: &'a Spline,
    /// Keyframes have their own tangents, so that the curve may overshoot.
    has_own_tangents: bool,
}

impl EulerSpline<'_> {
    fn with_own_tangents(spline: &Spline) -> EulerSpline<'_> {
        EulerSpline { spline, has_own_tangents: true }
    }

    fn without_own_tangents(spline: &Spline) -> EulerSpline<'_> {
        EulerSpline { spline, has_own_tangents: false }
    }

    /// The tangents of number `n` at both ends of the span before key `i`.
    fn tangents(&self, i: usize, n: usize) -> [f64; 2] {
        [self.spline.outgoing[i - 1][n], self.spline.incoming[i][n]]
    }

    /// Upper bound in degrees of the path of any angle in the span before key `i`: the length of its Bézier polygon.
    fn max_path_degrees(&self, i: usize, span: Time) -> f64 {
        let third = span.as_secs() / 3.0;
        let way = |n: usize| {
            let [start, end] = self.tangents(i, n).map(|tangent| tangent * third);
            let change = self.spline.values[i][n] - self.spline.values[i - 1][n];
            start.abs() + (change - start - end).abs() + end.abs()
        };
        (0..3).map(way).fold(0.0, f64::max)
    }

    fn is_straight(&self, i: usize, span: Time) -> bool {
        let is = |n: usize| {
            let change = self.spline.values[i][n] - self.spline.values[i - 1][n];
            self.tangents(i, n).iter().all(|tangent| *tangent == change / span.as_secs())
        };
        (0..3).all(is)
    }
}

/// Cubic Hermite interpolation between two values with tangents per second, at `w` from 0 to 1.
fn hermite([a, b]: [f64; 2], [ma, mb]: [f64; 2], span: Time, w: f64) -> f64 {
    let (span, w2, w3) = (span.as_secs(), w * w, w * w * w);
    (2.0 * w3 - 3.0 * w2 + 1.0) * a
        + (w3 - 2.0 * w2 + w) * span * ma
        + (3.0 * w2 - 2.0 * w3) * b
        + (w3 - w2) * span * mb
}
