//! Feet that stay where they stand.
//!
//! Where a foot touches the ground follows from how it moves without this goal, over the whole length of the stage: looked at
//! once, at 60 Hz, and kept ([`Plants`]), so that any frame can be had first. During a contact the ball of the foot stands still
//! at one point; between two contacts the foot is moved by what lies between both corrections, so that nothing jumps.

use super::body::Body;
use super::ground::Ground;
use super::solve::{bend_leg, world_place};
use super::{Leg, Plant};
use crate::evaluate::{Evaluation, Scratch, evaluate_actors};
use crate::{Snapshot, Stage, StageError};
use choreo_motion::Time;
use choreo_motion::ik::contact::{Contact, ContactRule, contacts};
use glam::{DAffine3, DVec3};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

const STEP: Time = Time(Time::TICKS_PER_SECOND / 60);
/// Feet are looked at for an hour at most; beyond it and outside the stage's length they are not planted.
const MOST_SAMPLES: i64 = 60 * 3600;
/// Seconds; across a longer gap between two contacts a foot is as its clips have it.
const LONGEST_GAP: f64 = 1.0;
const FADE: f64 = 0.25;
/// Metres of leg that [`ContactRule`]'s numbers are for.
const PERSON: f64 = 0.85;
/// Ground up to so much above where a foot stands in its clip is what it stands on: a high step, not the floor above.
const HIGHEST_STEP: f64 = 1.2;

/// The contacts of the legs of one goal.
#[derive(Debug, Default)]
pub(crate) struct PlantTrack {
    legs: Vec<Vec<Stand>>,
}

/// A contact: where the foot stands, and how far that is from where its clips have it at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stand {
    from: Time,
    to: Time,
    /// World.
    at: DVec3,
    first: DVec3,
    last: DVec3,
}

/// What the plant goals of one stage have found out, by actor and goal.
#[derive(Debug, Default)]
pub(crate) struct Plants(Mutex<BTreeMap<(usize, usize), Arc<PlantTrack>>>);

impl Plants {
    /// The same whoever asks first; two who ask at once may both work it out.
    pub fn track(
        &self,
        stage: &Stage,
        actor: usize,
        goal: usize,
        plant: &Plant,
    ) -> Result<Arc<PlantTrack>, StageError> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(track) = known().get(&(actor, goal)) {
            return Ok(track.clone());
        }
        let track = Arc::new(find(stage, actor, plant)?);
        known().insert((actor, goal), track.clone());
        Ok(track)
    }
}

fn find(stage: &Stage, actor: usize, plant: &Plant) -> Result<PlantTrack, StageError> {
    let ground = plant.ground.map(|g| Ground::of(stage, g)).transpose()?;
    let samples = (stage.settings.length.0.max(0) / STEP.0 + 1).min(MOST_SAMPLES);
    let mut scratch = Scratch::only(vec![actor]);
    let mut snapshot = Snapshot::default();
    let mut places = vec![Vec::new(); plant.legs.len()];
    let mut floors = Vec::new();
    for sample in 0..samples {
        evaluate_actors(stage, &mut scratch, Time(sample * STEP.0), Evaluation::Clips, &mut snapshot)?;
        let state = &snapshot.actors[actor];
        floors.push(state.world_from_model.translation.y);
        for (leg, places) in plant.legs.iter().zip(&mut places) {
            let joint = leg.toe.unwrap_or(leg.foot) as usize;
            let place = state.model_from_joint.get(joint).map(|m| world_place(&state.world_from_model, m));
            places.push(place.filter(|p| p.is_finite()).unwrap_or(DVec3::ZERO));
        }
    }
    let size = leg_length(stage, actor, plant) / PERSON;
    let rule = ContactRule::default();
    let rule = ContactRule { height: rule.height * size, speed: rule.speed * size, ..rule };
    let legs = places.iter().map(|places| stands(places, &floors, &rule, ground.as_ref())).collect();
    Ok(PlantTrack { legs })
}

/// In metres of the world at time 0.
fn leg_length(stage: &Stage, actor: usize, plant: &Plant) -> f64 {
    let a = &stage.actors[actor];
    let rest = a.asset.rest_model_from_joint();
    let Some(leg) = plant.legs.first() else { return PERSON };
    let place =
        |joint: u32| rest.get(joint as usize).map_or(DVec3::ZERO, |m| world_place(&DAffine3::IDENTITY, m));
    let (hip, knee, foot) = (place(leg.hip), place(leg.knee), place(leg.foot));
    let length = ((knee - hip).length() + (foot - knee).length()) * a.transform.scale.y.abs();
    if length.is_finite() && length > 1e-9 { length } else { PERSON }
}

fn stands(places: &[DVec3], floors: &[f64], rule: &ContactRule, ground: Option<&Ground>) -> Vec<Stand> {
    let above: Vec<f64> = places.iter().zip(floors).map(|(p, floor)| p.y - floor).collect();
    // What a foot's lowest is: the mean of clips differs by centimetres, and one deep sample must not lift all others.
    let mut sorted = above.clone();
    sorted.sort_by(f64::total_cmp);
    let lowest = sorted.get(sorted.len() / 20).copied().unwrap_or(0.0);
    let heights: Vec<f64> = above.iter().map(|h| h - lowest).collect();
    let found = contacts(places, &heights, STEP.as_secs(), rule);
    found.iter().map(|contact| stand(contact, places, floors, lowest, ground)).collect()
}

fn stand(contact: &Contact, places: &[DVec3], floors: &[f64], lowest: f64, ground: Option<&Ground>) -> Stand {
    let stay = &places[contact.first..=contact.last];
    let mut at = stay.iter().copied().sum::<DVec3>() / stay.len() as f64;
    let floor = floors[(contact.first + contact.last) / 2];
    if let Some(ground) = ground {
        // As high above the ground as the clips have it above their floor.
        let height = ground.height(at, at.y + HIGHEST_STEP).unwrap_or(floor);
        at.y = height + (at.y - floor - lowest) + lowest;
    }
    Stand {
        from: Time(contact.first as i64 * STEP.0),
        to: Time(contact.last as i64 * STEP.0),
        at,
        first: at - stay[0],
        last: at - stay[stay.len() - 1],
    }
}

/// How far a foot that its clips have at `place` is to be moved.
fn correction(stands: &[Stand], time: Time, place: DVec3) -> DVec3 {
    let next = stands.partition_point(|s| s.to < time);
    let upright = |d: DVec3| DVec3::new(0.0, d.y, 0.0);
    let smooth = |w: f64| {
        let w = w.clamp(0.0, 1.0);
        w * w * (3.0 - 2.0 * w)
    };
    // A foot in the air: level as it was or will be, and nothing sideways.
    let leaving = |s: &Stand| {
        let gone = smooth((time - s.to).as_secs() / FADE);
        upright(s.last) + (s.last - upright(s.last)) * (1.0 - gone)
    };
    let coming = |s: &Stand| {
        let left = smooth((s.from - time).as_secs() / FADE);
        upright(s.first) + (s.first - upright(s.first)) * (1.0 - left)
    };
    match (next.checked_sub(1).map(|i| &stands[i]), stands.get(next)) {
        (_, Some(now)) if now.from <= time => now.at - place,
        (Some(before), Some(after)) => {
            let gap = (after.from - before.to).as_secs();
            let way = smooth((time - before.to).as_secs() / gap);
            if gap <= LONGEST_GAP {
                before.last.lerp(after.first, way)
            } else {
                leaving(before).lerp(coming(after), way)
            }
        }
        (Some(before), None) => leaving(before),
        (None, Some(after)) => coming(after),
        (None, None) => DVec3::ZERO,
    }
}

/// Moves the hips with the ground and bends the legs.
pub(super) fn apply(
    track: &PlantTrack,
    plant: &Plant,
    time: Time,
    share: f64,
    world_from_model: &DAffine3,
    model_from_world: &DAffine3,
    body: &mut Body,
) {
    let places = |body: &Body, leg: &Leg| {
        let joint = leg.toe.unwrap_or(leg.foot) as usize;
        world_place(world_from_model, &body.model_from_joint[joint])
    };
    let corrections: Vec<DVec3> = plant
        .legs
        .iter()
        .zip(&track.legs)
        .map(|(leg, stands)| correction(stands, time, places(body, leg)) * share)
        .collect();
    let feet: Vec<DVec3> = plant.legs.iter().map(|leg| body.place(leg.foot)).collect();
    if let (Some(hips), true) = (plant.hips, plant.ground.is_some()) {
        // As low as the lower foot needs.
        let drop = corrections.iter().map(|c| c.y).fold(f64::INFINITY, f64::min);
        if drop.is_finite() {
            body.shift(hips, model_from_world.matrix3 * (DVec3::Y * drop));
        }
    }
    for ((leg, foot), correction) in plant.legs.iter().zip(feet).zip(corrections) {
        let target = foot + model_from_world.matrix3 * correction;
        // Knees bend forward, where characters face.
        bend_leg(leg, target, DVec3::Z, body);
    }
}
