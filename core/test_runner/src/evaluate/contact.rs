//! Foot contacts: whether a joint touches the floor, and how far it slides.

use super::band::Series;
use super::snapshot_cache::SnapshotCache;
use super::unjudged::Unjudged;
use super::words;
use choreo_motion::Time;
use choreo_script::testing::{Contact, Expectation, When};
use choreo_stage::Attachment;
use glam::DVec3;

pub(crate) fn foot_at(
    snapshots: &mut SnapshotCache,
    contact: &Contact,
    time: Time,
) -> Result<DVec3, Unjudged> {
    let at = Attachment { actor: contact.actor, joint: Some(contact.joint) };
    Ok(snapshots.attachment(&at, time)?.translation)
}

/// Height in metres by which a planted joint may rise and still count as sliding.
const MAX_PLANTED_RISE_M: f64 = 0.005;

/// Whether a joint that moves from `before` to `now` in `secs` seconds touches the floor. `lowest_while_planted`: its lowest height since it
/// came down, if it touched the floor before.
pub fn touches(
    contact: &Contact,
    lowest_while_planted: Option<f64>,
    [before, now]: [DVec3; 2],
    secs: f64,
) -> bool {
    let way = now - before;
    now.y - contact.ground <= contact.height
        && way.y.abs() <= contact.speed * secs
        // A foot that swings low over the floor does not touch it, even if it was planted; a foot that stays down may slide at any speed.
        && (lowest_while_planted.is_some_and(|lowest| now.y <= lowest + MAX_PLANTED_RISE_M)
            || way.with_y(0.0).length() <= contact.swing * secs)
}

pub fn slide(snapshots: &mut SnapshotCache, e: &Expectation, contact: &Contact) -> Result<Series, Unjudged> {
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
    let mut before = (foot_at(snapshots, contact, *first - step)?, *first - step);
    // Sliding distance, and lowest height since the joint came down.
    let mut slid: Option<(f64, f64)> = None;
    let (mut touched, mut lowest) = (false, f64::INFINITY);
    for time in &times {
        let now = foot_at(snapshots, contact, *time)?;
        lowest = lowest.min(now.y - contact.ground);
        let down = touches(contact, slid.map(|s| s.1), [before.0, now], (*time - before.1).as_secs());
        touched |= down;
        slid = down.then(|| match slid {
            Some((slid, lowest)) => (slid + (now - before.0).with_y(0.0).length(), lowest.min(now.y)),
            None => (0.0, now.y),
        });
        values.push(if now.is_nan() { f64::NAN } else { slid.map_or(0.0, |s| s.0) });
        before = (now, *time);
    }
    // A joint that is never visible has no values.
    if let (Some(last), false, true) = (times.last(), touched, lowest.is_finite()) {
        let [from, to] = [first, last].map(|t| words::time(*t));
        return Err(Unjudged::NeverOnFloor { from, to, lowest: words::number(lowest) });
    }
    match e.when {
        When::At(time) => {
            Ok(Series { times: vec![time], values: values.last().copied().into_iter().collect() })
        }
        _ => Ok(Series { times, values }),
    }
}
