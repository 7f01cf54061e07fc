//! Properties that are true or false at a time: visible, on, touching the floor.

use super::band::{Band, Series, judge_band};
use super::contact::{joint_position, touches_floor};
use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::{Judgment, vector};
use choreo_motion::Time;
use choreo_script::testing::{Expectation, Flag, Subject};

/// Judges a property that is true or false at each time.
pub(super) fn judge(snapshots: &mut SnapshotCache, e: &Expectation, flag: &Flag) -> Judgment {
    let (who, what) = flag_words(snapshots, flag);
    let (label, words) = (format!("{who} {what}"), format!("{who} is {what}"));
    let step = snapshots.step(e);
    let is_true = |snapshots: &mut SnapshotCache, time: Time| -> Result<bool, JudgeError> {
        Ok(match flag {
            Flag::Visible(actor) => snapshots.at(time)?.actors.get(*actor).is_some_and(|state| state.visible),
            Flag::CameraActive(camera) => snapshots.at(time)?.camera.camera == Some(*camera),
            Flag::Effect(name) => {
                let on = snapshots.at(time)?.effects.clone();
                on.iter().any(|e| snapshots.stage.effects.get(e.effect).is_some_and(|e| e.plugin == *name))
            }
            Flag::OnFloor(contact) => {
                let (before, now) = (
                    joint_position(snapshots, contact, time - step)?,
                    joint_position(snapshots, contact, time)?,
                );
                touches_floor(contact, None, [before, now], step.as_secs())
            }
        })
    };
    let series = snapshots.times_and_ends(e).and_then(|times| {
        let values: Result<Vec<f64>, JudgeError> =
            times.iter().map(|t| Ok(f64::from(u8::from(is_true(snapshots, *t)?)))).collect();
        Ok(Series { times, values: values? })
    });
    match series {
        Err(why) => Judgment::impossible(words, why),
        Ok(series) => {
            let band = Band {
                allowed: vec![[1.0, 1.0]; series.values.len()],
                distances: series.values.iter().map(|v| 1.0 - v).collect(),
                expected_curve: Vec::new(),
                tolerance: 0.0,
                description: words,
            };
            let mut judged = judge_band(&series, &band, e, &label, "");
            let answer = if e.negated { "yes" } else { "no" };
            let (_, when) = judged.got.split_once(' ').unwrap_or(("", ""));
            judged.got = match judged.passed {
                true => if e.negated { "no" } else { "yes" }.to_string(),
                false => format!("{answer} {when}"),
            };
            judged.by = String::new();
            let not = if e.negated { "not " } else { "" };
            let sometime = if e.sometime { ", sometime" } else { "" };
            judged.expected = format!("{who} is {not}{what}{sometime}");
            judged
        }
    }
}

/// Name of the subject, and the adjective of the property.
fn flag_words(snapshots: &SnapshotCache, flag: &Flag) -> (String, &'static str) {
    match flag {
        Flag::Visible(actor) => (vector::subject_name(snapshots, Subject::Actor(*actor)), "visible"),
        Flag::CameraActive(camera) => (vector::subject_name(snapshots, Subject::Camera(*camera)), "on"),
        Flag::Effect(name) => (format!("effect \"{name}\""), "on"),
        Flag::OnFloor(c) => (
            vector::subject_name(snapshots, Subject::Joint { actor: c.actor, joint: c.joint }),
            "on the floor",
        ),
    }
}
