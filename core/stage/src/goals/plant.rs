//! Feet that stay where they stand.
//!
//! Where a foot touches the ground follows from how it moves without this goal, over the whole length of the stage: looked at
//! once, at 60 Hz, and kept ([`Plants`]), so that any frame can be had first. In a fade in which clips keep step, they themselves say when
//! ([`Said`]): the mean of two strides slides, so that its motion tells less than theirs. During a contact the ball of the foot stands still
//! at one point; between two contacts the foot is moved by what lies between both corrections, so that nothing jumps.

use super::body::Body;
use super::ground::Ground;
use super::said::Said;
use super::solve::{bend_leg, world_place};
use super::{Leg, Plant};
use crate::evaluate::{Evaluation, Scratch, evaluate_actors};
use crate::{Snapshot, Stage, StageError};
use choreo_motion::Time;
use choreo_motion::contacts::{Rule, stays};
use choreo_motion::ik::arc;
use glam::{DAffine3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

const STEP: Time = Time(Time::TICKS_PER_SECOND / 60);
/// Feet are looked at for an hour at most; beyond it and outside the stage's length they are not planted.
const MOST_SAMPLES: i64 = 60 * 3600;
/// Across a longer gap between two contacts a foot is as its clips have it.
const LONGEST_GAP: Time = Time(Time::TICKS_PER_SECOND);
const FADE: f64 = 0.25;
/// Metres of a leg that has none.
const PERSON: f64 = 0.85;
/// Ground up to so much above where a foot stands in its clip is what it stands on: a high step, not the floor above.
const HIGHEST_STEP: f64 = 1.2;
/// The ball of a foot that is held is at most so high, in legs: one that is held while the toes leave the ground would push them into it.
const FLAT: f64 = 0.04;
/// Looks to either side among which a foot is at its lowest: feet of two clips differ by centimetres, and each is to stand.
const AROUND: usize = 36;
/// Who is higher than this above the lowest place at all, in legs, jumps.
const JUMP: f64 = 0.12;

/// The contacts of the legs of one goal.
#[derive(Debug, Default)]
pub(crate) struct PlantTrack {
    legs: Vec<Vec<Stand>>,
    /// What has been looked at.
    span: (Time, Time),
}

/// A contact: where the foot stands, and how far that is from where its clips have it at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stand {
    from: Time,
    to: Time,
    /// World; `None` = as its clips have it.
    at: Option<DVec3>,
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
    let leg = leg_length(stage, actor, plant);
    let mut scratch = Scratch::only(vec![actor]);
    let mut legs = vec![Vec::new(); plant.legs.len()];
    let windows = windows(stage, plant);
    let said = (!plant.only.is_empty()).then(|| Said::new(&stage.actors[actor], &plant.legs));
    for (from, to) in &windows {
        let looks = look(stage, actor, plant, &mut scratch, *from, *to)?;
        for (index, (places, legs)) in looks.feet.iter().zip(&mut legs).enumerate() {
            let unrest: Vec<f64> = match &said {
                Some(said) => (0..places.len()).map(|i| said.unrest(index, looks.time(i))).collect(),
                None => unrest(&looks, places, leg),
            };
            let found = stays(&unrest, STEP.as_secs(), false);
            legs.extend(found.iter().map(|stay| stand(&looks, *stay, places, plant, ground.as_ref())));
        }
    }
    let span = windows.first().zip(windows.last()).map_or_else(Default::default, |(a, b)| (a.0, b.1));
    Ok(PlantTrack { legs, span })
}

/// The times in which feet are looked at, one after the other: all of the stage, or around those that count.
fn windows(stage: &Stage, plant: &Plant) -> Vec<(Time, Time)> {
    let length = stage.settings.length.max(Time::ZERO).min(Time(MOST_SAMPLES * STEP.0));
    if plant.only.is_empty() {
        return vec![(Time::ZERO, length)];
    }
    let around = |(from, to): &(Time, Time)| (*from - LONGEST_GAP, *to + LONGEST_GAP);
    let mut all: Vec<(Time, Time)> = plant.only.iter().map(around).collect();
    all.iter_mut().for_each(|(from, to)| (*from, *to) = ((*from).max(Time::ZERO), (*to).min(length)));
    all.retain(|(from, to)| from < to);
    all.sort_unstable();
    all.dedup_by(|next, before| {
        let joined = next.0 <= before.1;
        if joined {
            before.1 = before.1.max(next.1);
        }
        joined
    });
    all
}

/// How an actor's feet move without the goal.
struct Looks {
    from: Time,
    /// World, by foot.
    feet: Vec<Vec<DVec3>>,
    /// Height of the floor.
    floors: Vec<f64>,
    /// World, of the first leg's hip: where the body is.
    body: Vec<DVec3>,
}

fn look(
    stage: &Stage,
    actor: usize,
    plant: &Plant,
    scratch: &mut Scratch,
    from: Time,
    to: Time,
) -> Result<Looks, StageError> {
    let mut snapshot = Snapshot::default();
    let mut looks = Looks { from, feet: vec![Vec::new(); plant.legs.len()], floors: vec![], body: vec![] };
    for sample in 0..=(to - from).0 / STEP.0 {
        evaluate_actors(stage, scratch, from + Time(sample * STEP.0), Evaluation::Clips, &mut snapshot)?;
        let state = &snapshot.actors[actor];
        let place = |joint: u32| {
            let place = state.model_from_joint.get(joint as usize);
            let place = place.map(|m| world_place(&state.world_from_model, m));
            place.filter(|p| p.is_finite()).unwrap_or(DVec3::ZERO)
        };
        looks.floors.push(state.world_from_model.translation.y);
        looks.body.push(plant.legs.first().map_or(DVec3::ZERO, |leg| place(leg.hip)));
        for (leg, places) in plant.legs.iter().zip(&mut looks.feet) {
            places.push(place(leg.toe.unwrap_or(leg.foot)));
        }
    }
    Ok(looks)
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

impl Looks {
    fn time(&self, look: usize) -> Time {
        self.from + Time(look as i64 * STEP.0)
    }
}

/// How far a foot is from standing at each look.
fn unrest(looks: &Looks, places: &[DVec3], leg: f64) -> Vec<f64> {
    let above: Vec<f64> = places.iter().zip(&looks.floors).map(|(p, floor)| p.y - floor).collect();
    let lowest = above.iter().copied().fold(f64::INFINITY, f64::min);
    let at = |i: usize| {
        let near = &above[i.saturating_sub(AROUND)..(i + AROUND + 1).min(above.len())];
        let low = near.iter().copied().fold(f64::INFINITY, f64::min);
        if low > lowest + JUMP * leg {
            return f64::INFINITY;
        }
        let gait = velocity(&looks.body, i).with_y(0.0).length();
        Rule { height: FLAT * leg, ..Rule::new(leg, gait) }.unrest(above[i] - low, velocity(places, i))
    };
    (0..places.len()).map(at).collect()
}

/// Over the neighbours, so that a touch-down is fast before it and slow after it alike.
fn velocity(places: &[DVec3], i: usize) -> DVec3 {
    let (before, after) = (i.saturating_sub(1), (i + 1).min(places.len() - 1));
    (places[after] - places[before]) / (STEP.as_secs() * (after - before).max(1) as f64)
}

fn stand(
    looks: &Looks,
    (first, last): (usize, usize),
    places: &[DVec3],
    plant: &Plant,
    ground: Option<&Ground>,
) -> Stand {
    let (from, to) = (looks.time(first), looks.time(last));
    if !plant.only.is_empty() && !plant.only.iter().any(|(begin, end)| from <= *end && to >= *begin) {
        return Stand { from, to, at: None, first: DVec3::ZERO, last: DVec3::ZERO };
    }
    let stay = &places[first..=last];
    let mut at = stay.iter().copied().sum::<DVec3>() / stay.len() as f64;
    if let Some(ground) = ground {
        // As high above the ground as the clips have it above their floor.
        let floor = looks.floors[(first + last) / 2];
        at.y += ground.height(at, at.y + HIGHEST_STEP).unwrap_or(floor) - floor;
    }
    Stand { from, to, at: Some(at), first: at - stay[0], last: at - stay[stay.len() - 1] }
}

impl PlantTrack {
    /// How far a foot that its clips have at `place` is to be moved.
    fn correction(&self, leg: usize, time: Time, place: DVec3) -> DVec3 {
        let Some(stands) = self.legs.get(leg) else { return DVec3::ZERO };
        let next = stands.partition_point(|s| s.to < time);
        let upright = |d: DVec3| DVec3::new(0.0, d.y, 0.0);
        let smooth = |w: f64| {
            let w = w.clamp(0.0, 1.0);
            w * w * (3.0 - 2.0 * w)
        };
        // A foot in the air for long: level as it was or will be, and nothing sideways.
        let leaving = |s: &Stand| {
            let gone = smooth((time - s.to).as_secs() / FADE);
            upright(s.last) + (s.last - upright(s.last)) * (1.0 - gone)
        };
        let coming = |s: &Stand| {
            let left = smooth((s.from - time).as_secs() / FADE);
            upright(s.first) + (s.first - upright(s.first)) * (1.0 - left)
        };
        match (next.checked_sub(1).map(|i| &stands[i]), stands.get(next)) {
            (_, Some(now)) if now.from <= time => now.at.map_or(DVec3::ZERO, |at| at - place),
            (Some(before), Some(after)) => {
                let way = smooth((time - before.to).as_secs() / (after.from - before.to).as_secs());
                if after.from - before.to <= LONGEST_GAP {
                    before.last.lerp(after.first, way)
                } else {
                    leaving(before).lerp(coming(after), way)
                }
            }
            // Who comes down soon after the beginning is on the way there already, and who has just left at the end is on it still.
            (None, Some(after)) if after.from - self.span.0 <= LONGEST_GAP => after.first,
            (Some(before), None) if self.span.1 - before.to <= LONGEST_GAP => before.last,
            (Some(before), None) => leaving(before),
            (None, Some(after)) => coming(after),
            (None, None) => DVec3::ZERO,
        }
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
        .enumerate()
        .map(|(i, leg)| track.correction(i, time, places(body, leg)) * share)
        .collect();
    let feet: Vec<DVec3> = plant.legs.iter().map(|leg| body.place(leg.foot)).collect();
    if let (Some(hips), true) = (plant.hips, plant.ground.is_some()) {
        // As low as the lower foot needs.
        let drop = corrections.iter().map(|c| c.y).fold(f64::INFINITY, f64::min);
        if drop.is_finite() {
            body.shift(hips, model_from_world.matrix3 * (DVec3::Y * drop));
        }
    }
    let targets: Vec<DVec3> =
        feet.iter().zip(&corrections).map(|(foot, c)| *foot + model_from_world.matrix3 * *c).collect();
    for (leg, target) in plant.legs.iter().zip(targets) {
        let (ankle, roll) = on_the_ball(leg, target, body);
        // Knees bend forward, where characters face.
        bend_leg(leg, ankle, DVec3::Z, body);
        body.turn(leg.foot, roll);
    }
}

/// Where the ankle goes, in model space, and how the foot turns: to `target` and not at all where the leg reaches that far, else the heel
/// rises while the ball stays, as of one who is about to leave the ground. (Lowering the hips instead jerks the head; tried.)
fn on_the_ball(leg: &Leg, target: DVec3, body: &Body) -> (DVec3, DQuat) {
    let [hip, knee, foot] = [leg.hip, leg.knee, leg.foot].map(|j| body.place(j));
    let reach = ((knee - hip).length() + (foot - knee).length()) * 0.9999;
    let Some(toe) = leg.toe.filter(|_| (target - hip).length() > reach) else {
        return (target, DQuat::IDENTITY);
    };
    let sole = body.place(toe) - foot;
    let ball = target + sole;
    let way = ball - hip;
    let (far, long) = (way.length(), sole.length());
    // Both spheres meet in a circle: of it the point nearest to where the ankle was to be.
    let along = (reach * reach - long * long + far * far) / (2.0 * far);
    let square = reach * reach - along * along;
    let Some(line) = way.try_normalize().filter(|_| square >= 0.0) else { return (target, DQuat::IDENTITY) };
    let across = (target - hip) - line * (target - hip).dot(line);
    let Some(across) = across.try_normalize() else { return (target, DQuat::IDENTITY) };
    let ankle = hip + line * along + across * square.sqrt();
    (ankle, arc(sole, ball - ankle))
}
