//! Foot contacts: whether a joint touches the floor, and how far it slides.

use super::band::Series;
use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::text_format;
use choreo_motion::Time;
use choreo_script::testing::{Contact, Expectation, When};
use choreo_stage::Attachment;
use glam::DVec3;

/// Position of the joint of a contact in world space.
pub(crate) fn joint_position(
    snapshots: &mut SnapshotCache,
    contact: &Contact,
    time: Time,
) -> Result<DVec3, JudgeError> {
    let at = Attachment { actor: contact.actor, joint: Some(contact.joint) };
    Ok(snapshots.world_from_attachment(&at, time)?.translation)
}

/// Height in metres by which a planted joint may rise and still count as sliding.
const MAX_PLANTED_RISE_M: f64 = 0.005;

/// Whether a joint that moves from `before` to `now` in `secs` seconds touches the floor. `lowest_while_planted`: its lowest height since it
/// came down, if it touched the floor before.
pub(super) fn touches_floor(
    contact: &Contact,
    lowest_while_planted: Option<f64>,
    [before, now]: [DVec3; 2],
    secs: f64,
) -> bool {
    let displacement = now - before;
    now.y - contact.ground <= contact.height
        && displacement.y.abs() <= contact.speed * secs
        // A foot that swings low over the floor does not touch it, even if it was planted; a foot that stays down may slide at any speed.
        && (lowest_while_planted.is_some_and(|lowest| now.y <= lowest + MAX_PLANTED_RISE_M)
            || displacement.with_y(0.0).length() <= contact.swing * secs)
}

/// Distance that the joint has slid on the floor since it came down, in metres, at each time.
pub(super) fn slide_distances(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    contact: &Contact,
) -> Result<Series, JudgeError> {
    let step = snapshots.step(e);
    // The sliding distance at one time is known only if evaluation begins before the foot comes down.
    let times = match e.when {
        When::At(time) => {
            let from = When::During(Time::ZERO.min(time - step), time);
            snapshots.times_and_ends(&Expectation { when: from, ..e.clone() })?
        }
        _ => snapshots.times(e)?,
    };
    let mut values = Vec::with_capacity(times.len());
    let Some(first) = times.first() else { return Ok(Series { times, values }) };
    let mut previous = (joint_position(snapshots, contact, *first - step)?, *first - step);
    // Sliding distance and lowest height since the joint came down; `None` while it is in the air.
    let mut slide: Option<(f64, f64)> = None;
    let (mut touched, mut lowest) = (false, f64::INFINITY);
    for time in &times {
        let now = joint_position(snapshots, contact, *time)?;
        lowest = lowest.min(now.y - contact.ground);
        let on_floor =
            touches_floor(contact, slide.map(|s| s.1), [previous.0, now], (*time - previous.1).as_secs());
        touched |= on_floor;
        slide = on_floor.then(|| match slide {
            Some((distance, lowest)) => {
                (distance + (now - previous.0).with_y(0.0).length(), lowest.min(now.y))
            }
            None => (0.0, now.y),
        });
        values.push(if now.is_nan() { f64::NAN } else { slide.map_or(0.0, |s| s.0) });
        previous = (now, *time);
    }
    // A joint that is never visible has no values.
    if let (Some(last), false, true) = (times.last(), touched, lowest.is_finite()) {
        let [from, to] = [first, last].map(|t| text_format::time(*t));
        return Err(JudgeError::NeverOnFloor { from, to, lowest: text_format::number(lowest) });
    }
    match e.when {
        When::At(time) => {
            Ok(Series { times: vec![time], values: values.last().copied().into_iter().collect() })
        }
        _ => Ok(Series { times, values }),
    }
}
