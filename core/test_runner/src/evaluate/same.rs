//! Bitwise comparison of stages, snapshots and poses.

use super::snapshot_cache::SnapshotCache;
use super::unjudged::Unjudged;
use super::{Judged, words};
use choreo_motion::Time;
use choreo_script::testing::{ComparedObject, ComparedWith, Expectation, When};
use choreo_stage::{ActorState, Snapshot, Stage};

pub fn judge(
    snapshots: &mut [SnapshotCache],
    e: &Expectation,
    what: ComparedObject,
    other: ComparedWith,
) -> Judged {
    let differs = match find(snapshots, e, what, other) {
        Ok(differs) => differs,
        Err(why) => return Judged::impossible("something to compare", why),
    };
    let expected = if e.negated { "not the same bits" } else { "the same bits" };
    match (differs, e.negated) {
        (None, false) => Judged::new(true, expected, "the same bits"),
        (None, true) => Judged::new(false, expected, "the same bits"),
        (Some(how), negated) => Judged::new(negated, expected, how),
    }
}

/// Description of the first difference.
fn find(
    snapshots: &mut [SnapshotCache],
    e: &Expectation,
    what: ComparedObject,
    other: ComparedWith,
) -> Result<Option<String>, Unjudged> {
    if let (ComparedObject::Stage, ComparedWith::Stage(other), When::Always) = (what, other, e.when) {
        let (a, b) =
            (&snapshots[e.stage].stage, &snapshots.get(other).ok_or(Unjudged::Missing("stage"))?.stage);
        return Ok((a.content_hash() != b.content_hash()).then(|| stages(a, b)));
    }
    for time in snapshots[e.stage].times_and_ends(e)? {
        let a = snapshots[e.stage].at(time)?;
        let (b, other_time) = match other {
            ComparedWith::Time(at) => (snapshots[e.stage].at(at)?, at),
            ComparedWith::Stage(stage) => {
                (snapshots.get_mut(stage).ok_or(Unjudged::Missing("stage"))?.at(time)?, time)
            }
            ComparedWith::Actor(_) => (a.clone(), time),
        };
        let stage = &snapshots[e.stage].stage;
        let differs = match (what, other) {
            (ComparedObject::Pose(actor), other) => {
                let other = if let ComparedWith::Actor(other) = other { other } else { actor };
                let (a, b) = (a.actors.get(actor), b.actors.get(other));
                let (a, b) = (a.ok_or(Unjudged::Missing("actor"))?, b.ok_or(Unjudged::Missing("actor"))?);
                let posed = |state: &ActorState| !state.model_from_joint.is_empty();
                if !posed(a) || !posed(b) {
                    return Err(Unjudged::HiddenActor(words::time(time)));
                }
                poses(stage, actor, a, b)
            }
            (ComparedObject::Stage, _) => snapshot_difference(stage, &a, &b),
        };
        if let Some(how) = differs {
            let when = match other_time == time {
                true => format!("at {}", words::time(time)),
                false => format!("at {} and {}", words::time(time), words::time(other_time)),
            };
            return Ok(Some(format!("{how}, {when}")));
        }
    }
    Ok(None)
}

fn stages(a: &Stage, b: &Stage) -> String {
    let counts = [
        ("actors", a.actors.len(), b.actors.len()),
        ("cameras", a.cameras.len(), b.cameras.len()),
        ("cuts", a.cuts.len(), b.cuts.len()),
        ("lights", a.lights.len(), b.lights.len()),
        ("effects", a.effects.len(), b.effects.len()),
        ("callbacks", a.hooks.len(), b.hooks.len()),
    ];
    if let Some((what, a, b)) = counts.into_iter().find(|(_, a, b)| a != b) {
        return format!("{a} and {b} {what}");
    }
    if a.settings != b.settings {
        return "other settings".into();
    }
    let hash = |s: &Stage| s.content_hash()[..4].iter().map(|b| format!("{b:02x}")).collect::<String>();
    format!("stages {} and {}", hash(a), hash(b))
}

fn poses(stage: &Stage, actor: usize, a: &ActorState, b: &ActorState) -> Option<String> {
    let of = &stage.actors[actor];
    let bits = |m: &glam::Affine3A| m.to_cols_array().map(f32::to_bits);
    let joints = a.model_from_joint.iter().zip(&b.model_from_joint);
    if let Some((joint, (x, y))) = joints.enumerate().find(|(_, (x, y))| bits(x) != bits(y)) {
        let name = of.asset.skeleton.names().get(joint).map_or("", String::as_str);
        let off = f64::from((x.translation - y.translation).length());
        return Some(format!("{} {name} differs, by {} m", of.name, words::number(off)));
    }
    let bits = |weights: &[Vec<f32>]| -> Vec<Vec<u32>> {
        weights.iter().map(|list| list.iter().map(|w| w.to_bits()).collect()).collect()
    };
    let differ = a.model_from_joint.len() != b.model_from_joint.len()
        || bits(&a.morph_weights) != bits(&b.morph_weights);
    differ.then(|| format!("{} differs in joints or morph weights", of.name))
}

fn snapshot_difference(stage: &Stage, a: &Snapshot, b: &Snapshot) -> Option<String> {
    // The times of the snapshots may differ.
    let timeless = |s: &Snapshot| Snapshot { time: Time::ZERO, ..s.clone() }.content_hash();
    if timeless(a) == timeless(b) {
        return None;
    }
    for (i, (x, y)) in a.actors.iter().zip(&b.actors).enumerate() {
        let Some(actor) = stage.actors.get(i) else { break };
        if x.world_from_model != y.world_from_model {
            let off = x.world_from_model.translation.distance(y.world_from_model.translation);
            return Some(format!(
                "{} has another position or rotation, by {} m",
                actor.name,
                words::number(off)
            ));
        }
        if let Some(how) = poses(stage, i, x, y) {
            return Some(how);
        }
    }
    Some(match () {
        () if a.camera != b.camera => "the camera differs".into(),
        () if a.lights != b.lights => "the lights differ".into(),
        () if a.effects != b.effects => "the effects differ".into(),
        () => "they differ in what is visible, in tints or in ambient light".into(),
    })
}
