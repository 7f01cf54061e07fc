//! Judges numbers over time.

use super::band::{Band, Series, judge_band};
use super::judge_error::JudgeError;
use super::snapshot_cache::{SnapshotCache, angle_deg};
use super::text_format::{self, number_with_unit};
use super::{Judgment, contact, frame, plan, rotation, vector};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_script::testing::{Expectation, NumberGoal, NumberTest, Quantity, Subject, VectorQuantity, When};
use choreo_stage::{ActiveClip, Actor, Attachment, Target};
use glam::DVec3;

/// First and last sample that a quantity needs for its finite difference, in steps relative to the time of the result.
fn stencil(quantity: &Quantity) -> (i64, i64) {
    match quantity {
        Quantity::Speed(_) | Quantity::TurnSpeed(_) => (-1, 0),
        Quantity::Acceleration(_) => (-1, 1),
        Quantity::Jerk(_) => (-2, 1),
        _ => (0, 0),
    }
}

pub(super) fn unit(quantity: &Quantity) -> &'static str {
    match quantity {
        Quantity::Component(v, _) | Quantity::Length(v) => vector::unit(v),
        Quantity::Distance(..) | Quantity::Slide(_) | Quantity::Lowest(_) | Quantity::Highest(_) => "m",
        Quantity::AngleTo(..) | Quantity::Angle(..) | Quantity::Tilt { .. } | Quantity::FieldOfView(_) => "°",
        Quantity::Speed(_) => "m/s",
        Quantity::Acceleration(_) => "m/s²",
        Quantity::Jerk(_) => "m/s³",
        Quantity::TurnSpeed(_) => "°/s",
        Quantity::ClipTime { .. } => "s",
        _ => "",
    }
}

pub(super) fn label(snapshots: &SnapshotCache, quantity: &Quantity) -> String {
    let actor = |a: usize| snapshots.stage.actors.get(a).map_or(String::new(), |a| a.name.clone());
    match quantity {
        Quantity::Component(v, axis) => {
            format!("{} {}", vector::label(snapshots, v), ["x", "y", "z"][axis % 3])
        }
        Quantity::Length(v) => format!("{} length", vector::label(snapshots, v)),
        Quantity::Distance(s, _) => format!("{} distance", vector::subject_name(snapshots, *s)),
        Quantity::AngleTo(s, _) => format!("{} angle to its target", vector::subject_name(snapshots, *s)),
        Quantity::Angle(a, _) => format!("{} angle", rotation::label(snapshots, a)),
        Quantity::Speed(v) => format!("{} speed", vector::label(snapshots, v)),
        Quantity::Acceleration(v) => format!("{} acceleration", vector::label(snapshots, v)),
        Quantity::Jerk(v) => format!("{} jerk", vector::label(snapshots, v)),
        Quantity::TurnSpeed(r) => format!("{} turn speed", rotation::label(snapshots, r)),
        Quantity::Slide(c) => {
            let foot = Subject::Joint { actor: c.actor, joint: c.joint };
            format!("{} slide", vector::subject_name(snapshots, foot))
        }
        Quantity::ClipWeight { actor: a, clip, .. } => format!("{} weight of {clip}", actor(*a)),
        Quantity::ClipTime { actor: a, clip } => format!("{} time in {clip}", actor(*a)),
        Quantity::Morph { actor: a, .. } => format!("{} morph weight", actor(*a)),
        Quantity::Lowest(a) => format!("{} lowest point", actor(*a)),
        Quantity::Highest(a) => format!("{} highest point", actor(*a)),
        Quantity::ImageHeight { actor: a, .. } => format!("{} height in the image", actor(*a)),
        Quantity::ShareInImage { actor: a, .. } => format!("{} share in the image", actor(*a)),
        Quantity::Tilt { subject, .. } => format!("{} tilt", vector::subject_name(snapshots, *subject)),
        Quantity::FieldOfView(c) => format!("{} fov", vector::subject_name(snapshots, Subject::Camera(*c))),
        Quantity::Intensity(l) => {
            format!("{} intensity", vector::subject_name(snapshots, Subject::Light(*l)))
        }
        Quantity::Count(_) => "count".into(),
        Quantity::PlanCount(..) => "count in the plan".into(),
    }
}

/// Values of a quantity at the times of an expectation.
pub(super) fn sample_series(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &Quantity,
) -> Result<Series, JudgeError> {
    if let Quantity::Count(what) = quantity {
        let count = plan::count_stage(snapshots, *what);
        return Ok(Series { times: vec![Time::ZERO], values: vec![count as f64] });
    }
    if let Quantity::Slide(contact) = quantity {
        return contact::slide_distances(snapshots, e, contact);
    }
    let (before, after) = stencil(quantity);
    if before == 0 && after == 0 {
        let times = snapshots.times_and_ends(e)?;
        let values = times
            .iter()
            .map(|t| value_in_window(snapshots, quantity, &[*t]))
            .collect::<Result<Vec<_>, JudgeError>>()?;
        return Ok(Series { times, values });
    }
    let step = snapshots.step(e);
    if let When::At(time) = e.when {
        let window: Vec<Time> = (before..=after).map(|k| Time(time.0 + k * step.0)).collect();
        let value = value_in_window(snapshots, quantity, &window)?;
        return Ok(Series { times: vec![time], values: vec![value] });
    }
    let times = snapshots.times(e)?;
    let window_len = (after - before + 1) as usize;
    if times.len() < window_len {
        return Err(JudgeError::TooFewSnapshots { found: times.len(), needed: window_len });
    }
    let mut out = Series { times: Vec::new(), values: Vec::new() };
    for window in times.windows(window_len) {
        out.times.push(window[before.unsigned_abs() as usize]);
        out.values.push(value_in_window(snapshots, quantity, window)?);
    }
    Ok(out)
}

/// Value of a quantity from the samples of its stencil. `window`: times of the samples, one step apart.
fn value_in_window(
    snapshots: &mut SnapshotCache,
    quantity: &Quantity,
    window: &[Time],
) -> Result<f64, JudgeError> {
    let at = window[0];
    let points = |snapshots: &mut SnapshotCache, v: &VectorQuantity| {
        window.iter().map(|t| vector::vector_at(snapshots, v, *t)).collect::<Result<Vec<DVec3>, JudgeError>>()
    };
    let step = || (window[window.len() - 1] - at).as_secs() / (window.len() - 1) as f64;
    Ok(match quantity {
        Quantity::Component(v, axis) => vector::vector_at(snapshots, v, at)?[*axis % 3],
        Quantity::Length(v) => vector::vector_at(snapshots, v, at)?.length(),
        Quantity::Distance(s, target) => {
            let place = snapshots.world_from_subject(*s, at)?.translation;
            target_position(snapshots, target, at)?.distance(place)
        }
        Quantity::AngleTo(s, target) => {
            let place = snapshots.world_from_subject(*s, at)?.translation;
            let to_target = target_position(snapshots, target, at)? - place;
            vector::vector_at(snapshots, &VectorQuantity::Direction(*s), at)?
                .angle_between(to_target)
                .to_degrees()
        }
        Quantity::Angle(a, b) => {
            angle_deg(rotation::rotation_at(snapshots, a, at)?, rotation::rotation_at(snapshots, b, at)?)
        }
        Quantity::Speed(v) => {
            let p = points(snapshots, v)?;
            (p[1] - p[0]).length() / step()
        }
        Quantity::Acceleration(v) => {
            let p = points(snapshots, v)?;
            (p[2] - 2.0 * p[1] + p[0]).length() / (step() * step())
        }
        Quantity::Jerk(v) => {
            let p = points(snapshots, v)?;
            (p[3] - 3.0 * p[2] + 3.0 * p[1] - p[0]).length() / (step() * step() * step())
        }
        Quantity::TurnSpeed(r) => {
            angle_deg(
                rotation::rotation_at(snapshots, r, at)?,
                rotation::rotation_at(snapshots, r, window[1])?,
            ) / step()
        }
        Quantity::ClipWeight { actor, joint, clip } => {
            let actor = snapshots.stage.actors.get(*actor).ok_or(JudgeError::Missing("actor"))?;
            clip_weight(actor, *joint, clip, at)
        }
        Quantity::ClipTime { actor, clip } => {
            let actor = snapshots.stage.actors.get(*actor).ok_or(JudgeError::Missing("actor"))?;
            clip_time(actor, clip, at)
        }
        Quantity::Morph { actor, targets } => {
            let snapshot = snapshots.at(at)?;
            let weights = snapshot.actors.get(*actor).map_or(&[][..], |state| &state.morph_weights);
            let of = |(i, t): &(u32, u32)| weights.get(*i as usize)?.get(*t as usize).copied();
            targets.iter().filter_map(of).map(f64::from).fold(f64::NAN, f64::max)
        }
        Quantity::Lowest(actor) => frame::posed_bounds(snapshots, *actor, at)?.0.y,
        Quantity::Highest(actor) => frame::posed_bounds(snapshots, *actor, at)?.1.y,
        Quantity::ImageHeight { actor, camera } => {
            frame::image_bounds(snapshots, *actor, *camera, at)?.height()
        }
        Quantity::ShareInImage { actor, camera } => {
            frame::image_bounds(snapshots, *actor, *camera, at)?.share
        }
        Quantity::Tilt { subject, camera } => frame::tilt_deg(snapshots, *subject, *camera, at)?,
        Quantity::FieldOfView(camera) => match snapshots.camera_state(Some(*camera), at)?.projection {
            Projection::Perspective { yfov, .. } => f64::from(yfov).to_degrees(),
            Projection::Orthographic { .. } => f64::NAN,
        },
        Quantity::Intensity(light) => {
            snapshots.light_state(*light, at)?.map_or(0.0, |state| f64::from(state.light.intensity))
        }
        Quantity::PlanCount(options, what) => plan::count_in_plan(snapshots, options, *what, at)? as f64,
        // `sample_series` computes these quantities, since they do not belong to a single time.
        Quantity::Count(_) | Quantity::Slide(_) => f64::NAN,
    })
}

pub(crate) fn target_position(
    snapshots: &mut SnapshotCache,
    target: &Target,
    time: Time,
) -> Result<DVec3, JudgeError> {
    match *target {
        Target::Point(point) => Ok(point),
        Target::Joint { actor, joint } => {
            Ok(snapshots.world_from_attachment(&Attachment { actor, joint: Some(joint) }, time)?.translation)
        }
        Target::Actor(actor) => {
            let center = snapshots.stage.actors.get(actor).map(|a| a.asset.rest_bounds().center().as_dvec3());
            let world_from_model =
                snapshots.world_from_attachment(&Attachment { actor, joint: None }, time)?;
            Ok(center.map_or(DVec3::NAN, |center| world_from_model.transform_point3(center)))
        }
    }
}

/// Final weight of each active cue, after all later cues have been blended over it.
fn blended_weights(
    actor: &Actor,
    time: Time,
    weight_of: impl Fn(&ActiveClip) -> f64,
) -> Vec<(ActiveClip, f64)> {
    let mut shares: Vec<(ActiveClip, f64)> = Vec::new();
    for active in actor.active_clips(time) {
        let weight = weight_of(&active);
        let is_overridden = |earlier: &ActiveClip| !active.additive || earlier.layer == active.layer;
        for (_, share) in shares.iter_mut().filter(|(earlier, _)| is_overridden(earlier)) {
            *share *= 1.0 - weight;
        }
        shares.push((active, weight));
    }
    shares
}

fn clip_name<'a>(actor: &'a Actor, active: &ActiveClip) -> &'a str {
    let cue = actor.layers.get(active.layer).and_then(|layer| layer.cues.get(active.cue));
    cue.map_or("", |cue| cue.clip.name.as_str())
}

fn clip_weight(actor: &Actor, joint: Option<u32>, clip: &str, time: Time) -> f64 {
    let sum = |shares: Vec<(ActiveClip, f64)>| -> f64 {
        shares.iter().filter(|(active, _)| clip_name(actor, active) == clip).map(|(_, share)| share).sum()
    };
    if let Some(joint) = joint {
        return sum(blended_weights(actor, time, |active| {
            let mask = actor.layers.get(active.layer).and_then(|layer| layer.mask.as_ref());
            let mask_weight = mask.map_or(1.0, |m| m.get(joint as usize).copied().unwrap_or(0.0));
            f64::from(active.weight) * f64::from(mask_weight)
        }));
    }
    let in_layer = |layer: usize| {
        let own = |active: &ActiveClip| if active.layer == layer { f64::from(active.weight) } else { 0.0 };
        sum(blended_weights(actor, time, own))
    };
    (0..actor.layers.len()).map(in_layer).fold(0.0, f64::max)
}

fn clip_time(actor: &Actor, clip: &str, time: Time) -> f64 {
    let of_clip = blended_weights(actor, time, |active| f64::from(active.weight));
    let mut best: Option<(f64, Time)> = None;
    for (active, share) in of_clip.iter().filter(|(active, _)| clip_name(actor, active) == clip) {
        if best.is_none_or(|(largest, _)| *share > largest) {
            best = Some((*share, active.clip_time));
        }
    }
    best.map_or(f64::NAN, |(_, at)| at.as_secs())
}

pub(super) fn judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &Quantity,
    test: &NumberTest,
) -> Judgment {
    let unit = unit(quantity);
    let label = label(snapshots, quantity);
    let judged = sample_series(snapshots, e, quantity).and_then(|series| {
        let band = allowed_band(snapshots, &series, test, unit)?;
        Ok((series, band))
    });
    match judged {
        Ok((series, band)) => {
            let mut judged = judge_band(&series, &band, e, &label, unit);
            if !judged.passed && !matches!(quantity, Quantity::Count(_)) {
                add_neighborhood_to_trace(snapshots, e, quantity, &mut judged);
            }
            let unknown = series.values.iter().position(|v| v.is_nan());
            if let (Some(i), Some(vector)) = (unknown, vector_of(quantity)) {
                let why = vector::reason_for_no_value(snapshots, vector, series.times[i]);
                judged.hint = why.unwrap_or_else(|why| why.to_string());
            }
            judged
        }
        Err(why) => Judgment::impossible(format!("{label} to be known"), why),
    }
}

/// The vector quantity that a number is derived from.
fn vector_of(quantity: &Quantity) -> Option<&VectorQuantity> {
    match quantity {
        Quantity::Component(v, _)
        | Quantity::Length(v)
        | Quantity::Speed(v)
        | Quantity::Acceleration(v)
        | Quantity::Jerk(v) => Some(v),
        _ => None,
    }
}

/// Adds the values within half a second around a failure at a single time to its trace.
fn add_neighborhood_to_trace(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &Quantity,
    judged: &mut Judgment,
) {
    let (When::At(time), [trace]) = (e.when, &mut judged.traces[..]) else { return };
    let half = Time::from_secs(0.5);
    let neighborhood = Expectation { when: When::During(time - half, time + half), ..e.clone() };
    let Ok(series) = sample_series(snapshots, &neighborhood, quantity) else { return };
    for (t, value) in series.times.iter().zip(series.values) {
        let at = trace.times.partition_point(|known| *known < t.as_secs());
        if trace.times.get(at) == Some(&t.as_secs()) {
            continue;
        }
        trace.times.insert(at, t.as_secs());
        trace.got.insert(at, value);
        trace.band.insert(at, [f64::NAN; 2]);
        if !trace.expected.is_empty() {
            trace.expected.insert(at, f64::NAN);
        }
    }
}

fn allowed_band(
    snapshots: &SnapshotCache,
    series: &Series,
    test: &NumberTest,
    unit: &str,
) -> Result<Band, JudgeError> {
    let n = series.times.len();
    let constant_band = |low: f64, high: f64, words: String| Band {
        allowed: vec![[low, high]; n],
        distances: series.values.iter().map(|v| (low - v).max(v - high)).collect(),
        expected_curve: Vec::new(),
        tolerance: 0.0,
        description: words,
    };
    Ok(match test {
        NumberTest::Below(limit) => {
            constant_band(f64::NEG_INFINITY, *limit, format!("at most {}", number_with_unit(*limit, unit)))
        }
        NumberTest::Above(limit) => {
            constant_band(*limit, f64::INFINITY, format!("at least {}", number_with_unit(*limit, unit)))
        }
        NumberTest::Between(low, high) if low == high => {
            constant_band(*low, *high, number_with_unit(*low, unit))
        }
        NumberTest::Between(low, high) => constant_band(
            *low,
            *high,
            format!("{} to {}", text_format::number(*low), number_with_unit(*high, unit)),
        ),
        NumberTest::Near { goal, tolerance } => {
            let goals: Vec<f64> = match goal {
                NumberGoal::Number(goal) => vec![*goal; n],
                NumberGoal::Formula(formula) => {
                    let goal_at = |t: &Time| {
                        snapshots.check_deadline()?;
                        let v = formula.at(*t).map_err(JudgeError::Formula)?;
                        Ok(v.first().copied().unwrap_or(f64::NAN))
                    };
                    series.times.iter().map(goal_at).collect::<Result<Vec<f64>, JudgeError>>()?
                }
            };
            let shown = match goal {
                NumberGoal::Number(goal) => text_format::number(*goal),
                NumberGoal::Formula(_) => "the function".into(),
            };
            Band {
                allowed: goals.iter().map(|g| [g - tolerance, g + tolerance]).collect(),
                distances: series.values.iter().zip(&goals).map(|(v, g)| (v - g).abs() - tolerance).collect(),
                expected_curve: goals,
                tolerance: *tolerance,
                description: format!("{shown} ± {}", number_with_unit(*tolerance, unit)),
            }
        }
    })
}
