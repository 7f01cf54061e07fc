//! Bitwise comparison of stages, snapshots and poses.

use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::{Judgment, text_format};
use choreo_motion::Time;
use choreo_script::hex;
use choreo_script::testing::{ComparedObject, ComparedWith, Expectation, When};
use choreo_stage::{ActorState, Snapshot, Stage};

pub(super) fn judge(
    snapshots: &mut [SnapshotCache],
    e: &Expectation,
    what: ComparedObject,
    other: ComparedWith,
) -> Judgment {
    let differs = match find_difference(snapshots, e, what, other) {
        Ok(differs) => differs,
        Err(why) => return Judgment::impossible("something to compare", why),
    };
    let expected = if e.negated { "not the same bits" } else { "the same bits" };
    match (differs, e.negated) {
        (None, false) => Judgment::new(true, expected, "the same bits"),
        (None, true) => Judgment::new(false, expected, "the same bits"),
        (Some(how), negated) => Judgment::new(negated, expected, how),
    }
}

/// Description of the first difference.
fn find_difference(
    snapshots: &mut [SnapshotCache],
    e: &Expectation,
    what: ComparedObject,
    other: ComparedWith,
) -> Result<Option<String>, JudgeError> {
    if let (ComparedObject::Stage, ComparedWith::Stage(other), When::Always) = (what, other, e.when) {
        let (a, b) =
            (&snapshots[e.stage].stage, &snapshots.get(other).ok_or(JudgeError::Missing("stage"))?.stage);
        return Ok((a.content_hash() != b.content_hash()).then(|| describe_stage_difference(a, b)));
    }
    for time in snapshots[e.stage].times_and_ends(e)? {
        let a = snapshots[e.stage].at(time)?;
        let (b, other_time) = match other {
            ComparedWith::Time(at) => (snapshots[e.stage].at(at)?, at),
            ComparedWith::Stage(stage) => {
                (snapshots.get_mut(stage).ok_or(JudgeError::Missing("stage"))?.at(time)?, time)
            }
            ComparedWith::Actor(_) => (a.clone(), time),
        };
        let stage = &snapshots[e.stage].stage;
        let differs = match (what, other) {
            (ComparedObject::Pose(actor), other) => {
                let other = if let ComparedWith::Actor(other) = other { other } else { actor };
                let (a, b) = (a.actors.get(actor), b.actors.get(other));
                let (a, b) = (a.ok_or(JudgeError::Missing("actor"))?, b.ok_or(JudgeError::Missing("actor"))?);
                let posed = |state: &ActorState| !state.model_from_joint.is_empty();
                if !posed(a) || !posed(b) {
                    return Err(JudgeError::HiddenActor(text_format::time(time)));
                }
                pose_difference(stage, actor, a, b)
            }
            (ComparedObject::Stage, _) => snapshot_difference(stage, &a, &b),
        };
        if let Some(how) = differs {
            let when = match other_time == time {
                true => format!("at {}", text_format::time(time)),
                false => format!("at {} and {}", text_format::time(time), text_format::time(other_time)),
            };
            return Ok(Some(format!("{how}, {when}")));
        }
    }
    Ok(None)
}

fn describe_stage_difference(a: &Stage, b: &Stage) -> String {
    let counts = [
        ("actors", a.actors.len(), b.actors.len()),
        ("cameras", a.cameras.len(), b.cameras.len()),
        ("cuts", a.cuts.len(), b.cuts.len()),
        ("lights", a.lights.len(), b.lights.len()),
        ("effects", a.effects.len(), b.effects.len()),
        ("callbacks", a.frame_callbacks.len(), b.frame_callbacks.len()),
    ];
    if let Some((what, a, b)) = counts.into_iter().find(|(_, a, b)| a != b) {
        return format!("{a} and {b} {what}");
    }
    if a.settings != b.settings {
        return "the stages have different settings".into();
    }
    let hash = |s: &Stage| hex(&s.content_hash()[..4]);
    format!("the stages differ in content: hashes {} and {}", hash(a), hash(b))
}

fn pose_difference(stage: &Stage, actor: usize, a: &ActorState, b: &ActorState) -> Option<String> {
    let stage_actor = &stage.actors[actor];
    let bits = |m: &glam::Affine3A| m.to_cols_array().map(f32::to_bits);
    let joints = a.model_from_joint.iter().zip(&b.model_from_joint);
    if let Some((joint, (x, y))) = joints.enumerate().find(|(_, (x, y))| bits(x) != bits(y)) {
        let name = stage_actor.asset.skeleton.names().get(joint).map_or("", String::as_str);
        let off = f64::from((x.translation - y.translation).length());
        return Some(format!("{} {name} differs, by {} m", stage_actor.name, text_format::number(off)));
    }
    let bits = |weights: &[Vec<f32>]| -> Vec<Vec<u32>> {
        weights.iter().map(|list| list.iter().map(|w| w.to_bits()).collect()).collect()
    };
    let differ = a.model_from_joint.len() != b.model_from_joint.len()
        || bits(&a.morph_weights) != bits(&b.morph_weights);
    differ.then(|| format!("{} differs in joints or morph weights", stage_actor.name))
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
                "{} has a different position or rotation, {} m away",
                actor.name,
                text_format::number(off)
            ));
        }
        if let Some(how) = pose_difference(stage, i, x, y) {
            return Some(how);
        }
    }
    Some(match () {
        () if a.camera != b.camera => "the camera differs".into(),
        () if a.lights != b.lights => "the lights differ".into(),
        () if a.effects != b.effects => "the effects differ".into(),
        () => "the visibility, tints or ambient light differ".into(),
    })
}
