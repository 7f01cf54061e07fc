//! Judges numbers over time.

use super::band::{Band, Series, judge_band};
use super::snapshot_cache::{SnapshotCache, angle_deg};
use super::unjudged::Unjudged;
use super::words::{self, with_unit};
use super::{Judged, contact, frame, plan, rotation, vector};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_script::testing::{Expectation, NumberGoal, NumberTest, Quantity, Subject, VectorQuantity, When};
use choreo_stage::{ActiveClip, Actor, Attachment, Target};
use glam::DVec3;

/// Numbers of steps before and after a time at which a quantity must be evaluated, for finite differences.
fn stencil(quantity: &Quantity) -> (i64, i64) {
    match quantity {
        Quantity::Speed(_) | Quantity::TurnSpeed(_) => (-1, 0),
        Quantity::Acceleration(_) => (-1, 1),
        Quantity::Jerk(_) => (-2, 1),
        _ => (0, 0),
    }
}

pub fn unit(quantity: &Quantity) -> &'static str {
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

pub fn label(snapshots: &SnapshotCache, quantity: &Quantity) -> String {
    let actor = |a: usize| snapshots.stage.actors.get(a).map_or(String::new(), |a| a.name.clone());
    match quantity {
        Quantity::Component(v, axis) => {
            format!("{} {}", vector::label(snapshots, v), ["x", "y", "z"][axis % 3])
        }
        Quantity::Length(v) => format!("{} length", vector::label(snapshots, v)),
        Quantity::Distance(s, _) => format!("{} distance", vector::name(snapshots, *s)),
        Quantity::AngleTo(s, _) => format!("{} angle to its target", vector::name(snapshots, *s)),
        Quantity::Angle(a, _) => format!("{} angle", rotation::label(snapshots, a)),
        Quantity::Speed(v) => format!("{} speed", vector::label(snapshots, v)),
        Quantity::Acceleration(v) => format!("{} acceleration", vector::label(snapshots, v)),
        Quantity::Jerk(v) => format!("{} jerk", vector::label(snapshots, v)),
        Quantity::TurnSpeed(r) => format!("{} turn speed", rotation::label(snapshots, r)),
        Quantity::Slide(c) => {
            let foot = Subject::Joint { actor: c.actor, joint: c.joint };
            format!("{} slide", vector::name(snapshots, foot))
        }
        Quantity::ClipWeight { actor: a, clip, .. } => format!("{} weight of {clip}", actor(*a)),
        Quantity::ClipTime { actor: a, clip } => format!("{} time in {clip}", actor(*a)),
        Quantity::Morph { actor: a, .. } => format!("{} morph weight", actor(*a)),
        Quantity::Lowest(a) => format!("{} lowest point", actor(*a)),
        Quantity::Highest(a) => format!("{} highest point", actor(*a)),
        Quantity::ImageHeight { actor: a, .. } => format!("{} height in the image", actor(*a)),
        Quantity::ShareInImage { actor: a, .. } => format!("{} share in the image", actor(*a)),
        Quantity::Tilt { subject, .. } => format!("{} tilt", vector::name(snapshots, *subject)),
        Quantity::FieldOfView(c) => format!("{} fov", vector::name(snapshots, Subject::Camera(*c))),
        Quantity::Intensity(l) => format!("{} intensity", vector::name(snapshots, Subject::Light(*l))),
        Quantity::Count(_) => "count".into(),
        Quantity::PlanCount(..) => "count in the plan".into(),
    }
}

pub fn series(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &Quantity,
) -> Result<Series, Unjudged> {
    if let Quantity::Count(what) = quantity {
        let count = plan::count_stage(snapshots, *what);
        return Ok(Series { times: vec![Time::ZERO], values: vec![count as f64] });
    }
    if let Quantity::Slide(contact) = quantity {
        return contact::slide(snapshots, e, contact);
    }
    let (before, after) = stencil(quantity);
    if before == 0 && after == 0 {
        let times = snapshots.times_and_ends(e)?;
        let values =
            times.iter().map(|t| value(snapshots, quantity, &[*t])).collect::<Result<Vec<_>, Unjudged>>()?;
        return Ok(Series { times, values });
    }
    let step = snapshots.step(e);
    if let When::At(time) = e.when {
        let window: Vec<Time> = (before..=after).map(|k| Time(time.0 + k * step.0)).collect();
        let value = value(snapshots, quantity, &window)?;
        return Ok(Series { times: vec![time], values: vec![value] });
    }
    let times = snapshots.times(e)?;
    let wide = (after - before + 1) as usize;
    if times.len() < wide {
        return Err(Unjudged::TooFewSnapshots { found: times.len(), needed: wide });
    }
    let mut out = Series { times: Vec::new(), values: Vec::new() };
    for window in times.windows(wide) {
        out.times.push(window[before.unsigned_abs() as usize]);
        out.values.push(value(snapshots, quantity, window)?);
    }
    Ok(out)
}

/// Value of a quantity from the times of its stencil, which are one step apart.
fn value(snapshots: &mut SnapshotCache, quantity: &Quantity, window: &[Time]) -> Result<f64, Unjudged> {
    let at = window[0];
    let points = |snapshots: &mut SnapshotCache, v: &VectorQuantity| {
        window.iter().map(|t| vector::at(snapshots, v, *t)).collect::<Result<Vec<DVec3>, Unjudged>>()
    };
    let step = || (window[window.len() - 1] - at).as_secs() / (window.len() - 1) as f64;
    Ok(match quantity {
        Quantity::Component(v, axis) => vector::at(snapshots, v, at)?[*axis % 3],
        Quantity::Length(v) => vector::at(snapshots, v, at)?.length(),
        Quantity::Distance(s, target) => {
            let place = snapshots.world_from(*s, at)?.translation;
            target_at(snapshots, target, at)?.distance(place)
        }
        Quantity::AngleTo(s, target) => {
            let place = snapshots.world_from(*s, at)?.translation;
            let way = target_at(snapshots, target, at)? - place;
            vector::at(snapshots, &VectorQuantity::Direction(*s), at)?.angle_between(way).to_degrees()
        }
        Quantity::Angle(a, b) => angle_deg(rotation::at(snapshots, a, at)?, rotation::at(snapshots, b, at)?),
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
            angle_deg(rotation::at(snapshots, r, at)?, rotation::at(snapshots, r, window[1])?) / step()
        }
        Quantity::ClipWeight { actor, joint, clip } => {
            let actor = snapshots.stage.actors.get(*actor).ok_or(Unjudged::Missing("actor"))?;
            clip_weight(actor, *joint, clip, at)
        }
        Quantity::ClipTime { actor, clip } => {
            let actor = snapshots.stage.actors.get(*actor).ok_or(Unjudged::Missing("actor"))?;
            clip_time(actor, clip, at)
        }
        Quantity::Morph { actor, targets } => {
            let snapshot = snapshots.at(at)?;
            let weights = snapshot.actors.get(*actor).map_or(&[][..], |state| &state.morph_weights);
            let of = |(i, t): &(u32, u32)| weights.get(*i as usize)?.get(*t as usize).copied();
            targets.iter().filter_map(of).map(f64::from).fold(f64::NAN, f64::max)
        }
        Quantity::Lowest(actor) => frame::bounds(snapshots, *actor, at)?.0.y,
        Quantity::Highest(actor) => frame::bounds(snapshots, *actor, at)?.1.y,
        Quantity::ImageHeight { actor, camera } => frame::outline(snapshots, *actor, *camera, at)?.height(),
        Quantity::ShareInImage { actor, camera } => frame::outline(snapshots, *actor, *camera, at)?.share,
        Quantity::Tilt { subject, camera } => frame::tilt(snapshots, *subject, *camera, at)?,
        Quantity::FieldOfView(camera) => match snapshots.camera(Some(*camera), at)?.projection {
            Projection::Perspective { yfov, .. } => f64::from(yfov).to_degrees(),
            Projection::Orthographic { .. } => f64::NAN,
        },
        Quantity::Intensity(light) => {
            snapshots.light(*light, at)?.map_or(0.0, |state| f64::from(state.light.intensity))
        }
        Quantity::PlanCount(options, what) => plan::count(snapshots, options, *what, at)? as f64,
        // These quantities depend on more than one moment: `series` computes them.
        Quantity::Count(_) | Quantity::Slide(_) => f64::NAN,
    })
}

pub(crate) fn target_at(
    snapshots: &mut SnapshotCache,
    target: &Target,
    time: Time,
) -> Result<DVec3, Unjudged> {
    match *target {
        Target::Point(point) => Ok(point),
        Target::Joint { actor, joint } => {
            Ok(snapshots.attachment(&Attachment { actor, joint: Some(joint) }, time)?.translation)
        }
        Target::Actor(actor) => {
            let middle = snapshots.stage.actors.get(actor).map(|a| a.asset.rest_bounds().center().as_dvec3());
            let world_from_model = snapshots.attachment(&Attachment { actor, joint: None }, time)?;
            Ok(middle.map_or(DVec3::NAN, |m| world_from_model.transform_point3(m)))
        }
    }
}

/// Final weight of each active cue, after all later cues have been blended over it.
fn shares(actor: &Actor, time: Time, part: impl Fn(&ActiveClip) -> f64) -> Vec<(ActiveClip, f64)> {
    let mut shares: Vec<(ActiveClip, f64)> = Vec::new();
    for active in actor.active_clips(time) {
        let weight = part(&active);
        let covers = |under: &ActiveClip| !active.additive || under.layer == active.layer;
        for (_, share) in shares.iter_mut().filter(|(under, _)| covers(under)) {
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
        return sum(shares(actor, time, |active| {
            let mask = actor.layers.get(active.layer).and_then(|layer| layer.mask.as_ref());
            let masked = mask.map_or(1.0, |m| m.get(joint as usize).copied().unwrap_or(0.0));
            f64::from(active.weight) * f64::from(masked)
        }));
    }
    let in_layer = |layer: usize| {
        let own = |active: &ActiveClip| if active.layer == layer { f64::from(active.weight) } else { 0.0 };
        sum(shares(actor, time, own))
    };
    (0..actor.layers.len()).map(in_layer).fold(0.0, f64::max)
}

fn clip_time(actor: &Actor, clip: &str, time: Time) -> f64 {
    let of_clip = shares(actor, time, |active| f64::from(active.weight));
    let mut best: Option<(f64, Time)> = None;
    for (active, share) in of_clip.iter().filter(|(active, _)| clip_name(actor, active) == clip) {
        if best.is_none_or(|(most, _)| *share > most) {
            best = Some((*share, active.clip_time));
        }
    }
    best.map_or(f64::NAN, |(_, at)| at.as_secs())
}

pub fn judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    quantity: &Quantity,
    test: &NumberTest,
) -> Judged {
    let unit = unit(quantity);
    let label = label(snapshots, quantity);
    let judged = series(snapshots, e, quantity).and_then(|series| {
        let band = band(snapshots, &series, test, unit)?;
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
                let why = vector::why_unknown(snapshots, vector, series.times[i]);
                judged.hint = why.unwrap_or_else(|why| why.to_string());
            }
            judged
        }
        Err(why) => Judged::impossible(format!("{label} to be known"), why),
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
    judged: &mut Judged,
) {
    let (When::At(time), [trace]) = (e.when, &mut judged.traces[..]) else { return };
    let half = Time::from_secs(0.5);
    let wide = Expectation { when: When::During(time - half, time + half), ..e.clone() };
    let Ok(series) = series(snapshots, &wide, quantity) else { return };
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

fn band(snapshots: &SnapshotCache, series: &Series, test: &NumberTest, unit: &str) -> Result<Band, Unjudged> {
    let n = series.times.len();
    let plain = |low: f64, high: f64, words: String| Band {
        allowed: vec![[low, high]; n],
        off: series.values.iter().map(|v| (low - v).max(v - high)).collect(),
        goal: Vec::new(),
        tolerance: 0.0,
        words,
    };
    Ok(match test {
        NumberTest::Below(limit) => {
            plain(f64::NEG_INFINITY, *limit, format!("at most {}", with_unit(*limit, unit)))
        }
        NumberTest::Above(limit) => {
            plain(*limit, f64::INFINITY, format!("at least {}", with_unit(*limit, unit)))
        }
        NumberTest::Between(low, high) if low == high => plain(*low, *high, with_unit(*low, unit)),
        NumberTest::Between(low, high) => {
            plain(*low, *high, format!("{} to {}", words::number(*low), with_unit(*high, unit)))
        }
        NumberTest::Near { goal, tolerance } => {
            let goals: Vec<f64> = match goal {
                NumberGoal::Number(goal) => vec![*goal; n],
                NumberGoal::Formula(formula) => {
                    let one = |t: &Time| {
                        snapshots.check_deadline()?;
                        let v = formula.at(*t).map_err(Unjudged::Formula)?;
                        Ok(v.first().copied().unwrap_or(f64::NAN))
                    };
                    series.times.iter().map(one).collect::<Result<Vec<f64>, Unjudged>>()?
                }
            };
            let shown = match goal {
                NumberGoal::Number(goal) => words::number(*goal),
                NumberGoal::Formula(_) => "the function".into(),
            };
            Band {
                allowed: goals.iter().map(|g| [g - tolerance, g + tolerance]).collect(),
                off: series.values.iter().zip(&goals).map(|(v, g)| (v - g).abs() - tolerance).collect(),
                goal: goals,
                tolerance: *tolerance,
                words: format!("{shown} ± {}", with_unit(*tolerance, unit)),
            }
        }
    })
}
