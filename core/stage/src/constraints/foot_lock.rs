//! Foot locking: feet stay in place during ground contacts.
//!
//! The contacts of a foot are found from its unconstrained motion over a span of the stage. They are computed once, at 60 Hz, and cached
//! ([`super::foot_lock_cache`]), so that frames can be evaluated in any order. During phase-matched fades the contacts come from the clips,
//! because the mean of two strides slides. During a contact the ball of the foot stays at one point. Between two contacts the corrections
//! of both are interpolated, so that the foot does not jump.

use crate::constraints::foot_lock_cache::{LONGEST_GAP, SAMPLE_INTERVAL};
use crate::constraints::foot_samples::{FootSamples, Limb};
use crate::constraints::footsteps::Footstep;
use crate::constraints::gait_fades::{FADE_MARGIN, GaitFade, is_gait_fade};
use crate::constraints::ground::Ground;
use crate::constraints::solve::{bend_leg, joint_world_position};
use crate::pose::joints::PosedSkeleton;
use crate::stage::constraint::{FootLock, Leg};
use choreo_motion::contacts::ContactThresholds;
use choreo_motion::math::rotation::rotation_between;
use choreo_motion::{Front, Time};
use glam::{DAffine3, DQuat, DVec3};

/// Seconds over which a foot returns from a contact to its animated position, and over which corrections fade out outside a span.
pub(super) const FADE_SECS: f64 = 0.25;
/// Largest height in metres of the ground above the animated foot, after the raise of the last contact: allows a high step, but not the
/// floor above.
const HIGHEST_STEP: f64 = 1.2;
/// Largest height of the ball of a standing foot above its lowest position nearby, in leg lengths. A foot that stayed locked while its toes
/// leave the ground would push them into it.
const CONTACT_HEIGHT_LEGS: f64 = 0.04;
/// Extra reach of a leg with its heel raised, as a share of the sole's length.
const DROP_HEEL_REACH: f64 = 0.6;
/// Number of samples to either side in which the lowest height of a foot is searched. The feet of two clips differ in height by
/// centimetres, and both must have contacts.
const LOWEST_SAMPLES: usize = 36;
/// Number of samples over which the hips are lowered smoothly before a contact that needs it, and raised after it.
const SMOOTHING_SAMPLES: usize = 14;
/// Number of positions that are tried ahead of and behind the mean position of a contact, up to half of the hip's path during the contact.
const REACH_POSITIONS: u32 = 32;
/// Height above its contact, in leg lengths, up to which a foot that lifts off or lands keeps its horizontal position: in clips such a foot
/// slides while it is almost on the ground.
const ROLL_HEIGHT_LEGS: f64 = 0.02;
/// Largest horizontal distance between the animated foot and that contact, in leg lengths.
const ROLL_DISTANCE_LEGS: f64 = 0.25;
/// Ground clearance of a foot in the air near the contacts before and after, in metres, and its upper limit in leg lengths. A lower foot
/// looks dragged, however small the character is.
const CLEARANCE_METRES: f64 = 0.015;
const CLEARANCE_LEGS: f64 = 0.05;
/// Largest raise of a foot, in multiples of the clearance: the feet of two clips differ in height.
const HIGHEST_RAISE: f64 = 3.0;
/// Horizontal distances from a contact at which a foot has full clearance, and at which it is back at its animated height, in multiples of
/// the clearance.
const CLEARANCE_DISTANCES: [f64; 2] = [1.0, 8.0];
/// A foot whose lowest height nearby exceeds its lowest height overall by more than this, in leg lengths, belongs to a jump.
const JUMP_HEIGHT_LEGS: f64 = 0.12;

/// The contacts of the legs of one constraint over a span of time.
#[derive(Debug)]
pub(crate) struct FootLockTrack {
    pub(super) contacts_by_leg: Vec<Vec<Contact>>,
    /// Footsteps of each leg, in fades between walking and standing and within long contacts.
    pub(super) steps: Vec<Vec<Footstep>>,
    /// The time span that the contacts cover.
    pub(super) span: (Time, Time),
    /// Whether corrections hold beyond the start and the end of the span, instead of fading out.
    pub(super) open_ends: [bool; 2],
    /// Lowering of the hips at each sample of the span, in metres, so that the legs reach the ground.
    pub(super) hip_drops: Vec<f64>,
    /// Length of a leg, metres.
    pub(super) leg_length: f64,
    pub(super) gait_fades: Vec<GaitFade>,
    /// The actor's front, towards which the knees bend.
    pub(super) front: Front,
}

/// A contact: the position of the standing foot. `first_offset` and `last_offset` lead to it from the animated position of the foot:
/// horizontally at the ends of `roll_span`, vertically at `from` and `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contact {
    pub from: Time,
    pub to: Time,
    /// World position of the ball of the foot; `None`: the foot follows its clips.
    pub position: Option<DVec3>,
    pub first_offset: DVec3,
    pub last_offset: DVec3,
    /// Start and end of the time in which the foot keeps its horizontal position, roll-off and landing included.
    pub roll_span: (Time, Time),
    /// Metres by which a fade between gaits lowers the contact below the mean animated height.
    pub lowered: f64,
    /// Whether a footstep leads to this contact or away from it.
    pub by_step: bool,
}

/// Motion of a foot at each sample, relative to the contact thresholds: at most 1 where it can stand, infinite in a jump.
pub(super) fn motion_ratios(samples: &FootSamples, places: &[DVec3], leg_length: f64) -> Vec<f64> {
    let above: Vec<f64> =
        places.iter().zip(&samples.transforms).map(|(p, transform)| p.y - transform.translation.y).collect();
    let lowest = above.iter().copied().fold(f64::INFINITY, f64::min);
    // The hip of the first leg gives the position of the character.
    let body: Vec<DVec3> =
        samples.limbs.first().map_or(&[][..], |limbs| limbs).iter().map(|l| l.hip).collect();
    let at = |i: usize| {
        let near = &above[i.saturating_sub(LOWEST_SAMPLES)..(i + LOWEST_SAMPLES + 1).min(above.len())];
        let low = near.iter().copied().fold(f64::INFINITY, f64::min);
        if low > lowest + JUMP_HEIGHT_LEGS * leg_length {
            return f64::INFINITY;
        }
        let gait = velocity_at_sample(&body, i).with_y(0.0).length();
        ContactThresholds {
            height: CONTACT_HEIGHT_LEGS * leg_length,
            ..ContactThresholds::new(leg_length, gait)
        }
        .motion_ratio(above[i] - low, velocity_at_sample(places, i))
    };
    (0..places.len()).map(at).collect()
}

/// Velocity by central differences, metres per second, so that touch-down counts as equally fast before and after it.
fn velocity_at_sample(places: &[DVec3], i: usize) -> DVec3 {
    let (before, after) = (i.saturating_sub(1), (i + 1).min(places.len() - 1));
    (places[after] - places[before]) / (SAMPLE_INTERVAL.as_secs() * (after - before).max(1) as f64)
}

/// A ground contact of a foot in its clips.
pub(super) struct ContactSpan {
    pub span: (Time, Time),
    /// Animated positions of the foot at both times, world space.
    pub ends: [DVec3; 2],
    /// Upper limit of the world height of the standing foot.
    pub highest: f64,
}

/// Whether feet are locked during a contact: it overlaps one of the spans in `locked_spans`, or there are none.
pub(super) fn is_locked_contact(foot_lock: &FootLock, (from, to): (Time, Time)) -> bool {
    let overlaps = |span: &(Time, Time)| {
        let beside = if is_gait_fade(foot_lock, *span) { FADE_MARGIN } else { Time::ZERO };
        from - beside <= span.1 && to + beside >= span.0
    };
    foot_lock.locked_spans.is_empty() || foot_lock.locked_spans.iter().any(overlaps)
}

/// Contact of a foot with the ground. `raised`: height of the ground above the clips' floor in metres, at the previous contact on entry and
/// at this one on return.
pub(super) fn contact_on_ground(
    samples: &FootSamples,
    contact: &ContactSpan,
    leg: usize,
    foot_lock: &FootLock,
    ground: &[Ground],
    raised: &mut f64,
) -> Contact {
    let ContactSpan { span, ends, highest } = *contact;
    if !is_locked_contact(foot_lock, span) {
        return Contact::new(span, None, [DVec3::ZERO; 2]);
    }
    let (first, last) = samples.samples_between(span);
    let mut at = reachable_position(samples, leg, (first, last), highest);
    let lowered = reachable_position(samples, leg, (first, last), f64::INFINITY).y - at.y;
    if !ground.is_empty() {
        // The foot has the same height above the ground as above the floor of its clips.
        let floor = samples.floor_height((first + last) / 2);
        let heights = ground.iter().filter_map(|g| g.height(at, at.y + *raised + HIGHEST_STEP));
        *raised = heights.reduce(f64::max).unwrap_or(floor) - floor;
        at.y += *raised;
    }
    Contact { lowered, ..Contact::new(span, Some(at), ends.map(|end| at - end)) }
}

/// Inputs of [`extend_rolls`] for one leg.
pub(super) struct RollInputs<'a> {
    /// Length of the leg, metres.
    pub leg_length: f64,
    pub steps: &'a [Footstep],
    pub gait_fades: &'a [GaitFade],
}

/// Extends `roll_span` of a leg's contacts, in whole samples, until the foot is higher than [`ROLL_HEIGHT_LEGS`], except where a footstep
/// begins or ends.
pub(super) fn extend_rolls(
    samples: &FootSamples,
    index: usize,
    inputs: &RollInputs,
    contacts: &mut [Contact],
) {
    let RollInputs { leg_length, steps, gait_fades } = *inputs;
    let places = &samples.feet[index];
    // The swing gets at least half of the time between two contacts. A contact of zero length marks a foot that is in the air when a
    // step begins or ends; if both contacts are at the same position, the whole gap may be used.
    let gap = |before: &Contact, after: &Contact| {
        let gap = after.from - before.to;
        let least = GaitFade::min_gap(gait_fades, index, leg_length, [before, after]);
        let quarter = Time(gap.0 / 4).min(Time((gap - least).0 / 2)).max(Time::ZERO);
        let way = after.position.unwrap_or_default() - before.position.unwrap_or_default();
        let in_air = before.from >= before.to || after.from >= after.to;
        match in_air && way.with_y(0.0).length() < 1e-9 {
            true => (after.from, before.to),
            false => (before.to + quarter, after.from - quarter),
        }
    };
    for i in 0..contacts.len() {
        let contact = contacts[i];
        let (Some(at), true) = (contact.position, contact.from < contact.to) else { continue };
        let before = i.checked_sub(1).map_or(samples.from, |i| gap(&contacts[i], &contact).1);
        let after = contacts.get(i + 1).map_or(Time::MAX, |next| gap(&contact, next).0);
        let rolls = |sample: usize, offset: DVec3| contact.keeps_position(offset, places[sample], leg_length);
        let on_grid =
            |time: Time| ((time - samples.from).0.max(0) as u64).div_ceil(SAMPLE_INTERVAL.0 as u64) as usize;
        if !steps.iter().any(|step| step.from == contact.to) {
            let leaving =
                (on_grid(contact.to)..places.len()).take_while(|s| samples.time_of_sample(*s) <= after);
            if let Some(last) = leaving.take_while(|s| rolls(*s, contact.last_offset)).last() {
                contacts[i].roll_span.1 = samples.time_of_sample(last);
                contacts[i].last_offset = (at - places[last]).with_y(contact.last_offset.y);
            }
        }
        if !steps.iter().any(|step| step.to == contact.from) {
            let coming = (0..on_grid(contact.from).min(places.len())).rev();
            let coming = coming.take_while(|s| samples.time_of_sample(*s) >= before);
            if let Some(first) = coming.take_while(|s| rolls(*s, contact.first_offset)).last() {
                contacts[i].roll_span.0 = samples.time_of_sample(first);
                contacts[i].first_offset = (at - places[first]).with_y(contact.first_offset.y);
            }
        }
    }
}

/// World position of a foot during a contact: the mean of its animated positions or, if that overstretches the leg, the nearest position
/// along the hip's path at which the leg stretches least. A foot that lands with a straight leg cannot stand farther ahead, and one that
/// lifts off late cannot stand farther back. `highest`: upper limit of the world height.
pub(super) fn reachable_position(
    samples: &FootSamples,
    leg: usize,
    (first, last): (usize, usize),
    highest: f64,
) -> DVec3 {
    let (stay, limbs) = (&samples.feet[leg][first..=last], &samples.limbs[leg][first..=last]);
    let mut middle = stay.iter().copied().sum::<DVec3>() / stay.len() as f64;
    middle.y = middle.y.min(highest);
    let beyond = |at: DVec3| {
        let one = |(ball, limb): (&DVec3, &Limb)| (limb.ankle + (at - ball) - limb.hip).length() - limb.reach;
        stay.iter().zip(limbs).map(one).fold(0.0, f64::max)
    };
    let Some((first, last)) = limbs.first().zip(limbs.last()) else { return middle };
    let way = (last.hip - first.hip).with_y(0.0) / f64::from(2 * REACH_POSITIONS);
    let mut best = (beyond(middle), middle);
    for i in 1..=REACH_POSITIONS {
        for at in [middle + way * f64::from(i), middle - way * f64::from(i)] {
            let far = beyond(at);
            // A gain of less than a millimetre does not move the foot: the heel rises instead.
            if far < best.0 - 1e-3 {
                best = (far, at);
            }
        }
    }
    best.1
}

/// Distance in metres by which the hips must be lowered so that a leg reaches a position with the heel raised. A position that is too far away
/// horizontally is out of reach even then.
pub(super) fn hip_drop_to_reach(limb: &Limb, at: DVec3) -> f64 {
    let far = (limb.reach + DROP_HEEL_REACH * limb.sole) * 0.998;
    let across = (limb.hip - at).with_y(0.0).length_squared();
    let high = (far * far - across).max(0.0).sqrt();
    limb.hip.y - at.y - high
}

/// Lowering of the hips at each sample in metres, as far as the standing legs need it to reach the ground with the heel raised, smoothed
/// over time. (Tried without smoothing: the head jerks.)
pub(super) fn hip_drops(samples: &FootSamples, legs: &[Vec<Contact>]) -> Vec<f64> {
    let need = |index: usize| {
        let time = samples.time_of_sample(index);
        let of_leg = |(stands, limbs): (&Vec<Contact>, &Vec<Limb>)| {
            let next = stands.partition_point(|s| s.to < time);
            let at = stands.get(next).filter(|s| s.from <= time).and_then(|s| s.position)?;
            let limb = limbs[index];
            Some(hip_drop_to_reach(&limb, at).clamp(0.0, FootLock::MAX_HIP_DROP_SHARE * limb.reach))
        };
        legs.iter().zip(&samples.limbs).filter_map(of_leg).fold(0.0, f64::max)
    };
    let count = samples.transforms.len();
    let need: Vec<f64> = (0..count).map(need).collect();
    let smooth = |index: usize| {
        let near = index.saturating_sub(SMOOTHING_SAMPLES)..(index + SMOOTHING_SAMPLES + 1).min(count);
        let bump = |other: usize| {
            let away = other.abs_diff(index) as f64 / (SMOOTHING_SAMPLES + 1) as f64;
            need[other] * (1.0 - away * away) * (1.0 - away * away)
        };
        near.map(bump).fold(0.0, f64::max)
    };
    (0..count).map(smooth).collect()
}

impl Contact {
    /// A contact that does not roll, is not lowered, and has no footsteps. `offsets`: `first_offset` and `last_offset`.
    pub(super) fn new(span: (Time, Time), position: Option<DVec3>, offsets: [DVec3; 2]) -> Contact {
        let ((from, to), [first_offset, last_offset]) = (span, offsets);
        Contact {
            from,
            to,
            position,
            first_offset,
            last_offset,
            roll_span: span,
            lowered: 0.0,
            by_step: false,
        }
    }

    /// Moves the contact to another world position.
    pub(super) fn move_to(&mut self, at: DVec3) {
        let way = at - self.position.unwrap_or(at);
        (self.position, self.first_offset, self.last_offset) =
            (Some(at), self.first_offset + way, self.last_offset + way);
    }

    /// Whether a foot with the animated position `place` is low and near enough to keep its contact. `offset`: `first_offset` or
    /// `last_offset` of the contact.
    pub(super) fn keeps_position(&self, offset: DVec3, place: DVec3, leg_length: f64) -> bool {
        self.position.is_some_and(|at| {
            let off = at - place;
            offset.y - off.y < ROLL_HEIGHT_LEGS * leg_length
                && off.with_y(0.0).length() < ROLL_DISTANCE_LEGS * leg_length
        })
    }

    /// Offset from the animated position `place` to the contact. While the foot rolls, its height follows the clips.
    fn correction(&self, time: Time, place: DVec3) -> DVec3 {
        let Some(at) = self.position else { return DVec3::ZERO };
        let there = at - place;
        if time < self.from {
            there.with_y(self.first_offset.y)
        } else if time > self.to {
            there.with_y(self.last_offset.y)
        } else {
            there
        }
    }
}

/// Ground clearance in metres of a foot in the air near its contacts. `leg_length`: metres.
pub(super) fn ground_clearance(leg_length: f64) -> f64 {
    CLEARANCE_METRES.min(CLEARANCE_LEGS * leg_length)
}

/// Smoothstep from 0 to 1; `w` is clamped.
pub(super) fn smoothstep(w: f64) -> f64 {
    let w = w.clamp(0.0, 1.0);
    w * w * (3.0 - 2.0 * w)
}

impl FootLockTrack {
    fn hip_drop_at(&self, time: Time) -> f64 {
        if time < self.span.0 {
            return 0.0;
        }
        let at = (time - self.span.0).0 as f64 / SAMPLE_INTERVAL.0 as f64;
        let (low, share) = (at as usize, at - libm::floor(at));
        let drop = |i: usize| self.hip_drops.get(i).copied().unwrap_or(0.0);
        drop(low) + (drop(low + 1) - drop(low)) * share
    }

    /// World-space correction, in metres, of a foot with the animated position `place`. Fades out outside the span, except at open ends.
    fn correction(&self, leg: usize, time: Time, place: DVec3) -> DVec3 {
        let outside = match time {
            time if time < self.span.0 && !self.open_ends[0] => self.span.0 - time,
            time if time > self.span.1 && !self.open_ends[1] => time - self.span.1,
            _ => return self.correction_in_span(leg, time, place),
        };
        self.correction_in_span(leg, time, place) * (1.0 - smoothstep(outside.as_secs() / FADE_SECS))
    }

    fn correction_in_span(&self, leg: usize, time: Time, place: DVec3) -> DVec3 {
        let Some(stands) = self.contacts_by_leg.get(leg) else { return DVec3::ZERO };
        if let Some(step) = self.steps[leg].iter().find(|step| step.from < time && time < step.to) {
            let foot = step.at(time);
            // A step may begin in the air, and the feet of two clips differ in height, so the lower end is taken as the ground.
            let [start, end] = step.start_and_end();
            let ground = start.y.min(end.y);
            return self.with_clearance(time, leg, foot, [start, end].map(|end| Some(end.with_y(ground))))
                - place;
        }
        let next = stands.partition_point(|s| s.roll_span.1 < time);
        let (before, after) = (next.checked_sub(1).map(|i| &stands[i]), stands.get(next));
        if let Some(now) = after.filter(|now| now.roll_span.0 <= time) {
            return now.correction(time, place);
        }
        let correction = self.correction_between(time, before, after);
        let stands = |contact: &&Contact| contact.from < contact.to;
        let ends = [before, after].map(|contact| contact.filter(stands).and_then(|contact| contact.position));
        self.with_clearance(time, leg, place + correction, ends) - place
    }

    /// Raises the position of a foot in the air, so that it has its clearance near the contacts before and after.
    fn with_clearance(&self, time: Time, leg: usize, foot: DVec3, ends: [Option<DVec3>; 2]) -> DVec3 {
        let clearance = ground_clearance(self.leg_length);
        let [near, far] = CLEARANCE_DISTANCES.map(|c| c * clearance);
        let away = |at: DVec3| (foot - at).with_y(0.0).length();
        let raise = |ground: f64, share: f64| {
            (ground + clearance * share - foot.y).clamp(0.0, HIGHEST_RAISE * clearance) * share
        };
        let over = |at: DVec3| {
            raise(at.y, smoothstep(away(at) / near) * (1.0 - smoothstep((away(at) - near) / (far - near))))
        };
        let ends = ends.into_iter().flatten();
        let from_ends = ends.clone().map(|at| smoothstep(away(at) / far)).fold(1.0, f64::min);
        let above = |(ground, share): (f64, f64)| {
            let share = from_ends * share;
            (ground + clearance * share - foot.y).max(0.0) * share
        };
        let everywhere = GaitFade::ground_height(&self.gait_fades, leg, time).map_or(0.0, above);
        foot + DVec3::Y * ends.map(over).fold(everywhere, f64::max)
    }

    /// Correction of a foot in the air, interpolated between the contacts before and after.
    fn correction_between(&self, time: Time, before: Option<&Contact>, after: Option<&Contact>) -> DVec3 {
        // A foot that is in the air for long keeps only the vertical part of the correction.
        let leaving = |s: &Contact| {
            let gone = smoothstep((time - s.roll_span.1).as_secs() / FADE_SECS);
            let level = DVec3::Y * (s.last_offset.y + s.lowered);
            level + (s.last_offset - level) * (1.0 - gone)
        };
        let coming = |s: &Contact| {
            let left = smoothstep((s.roll_span.0 - time).as_secs() / FADE_SECS);
            let level = DVec3::Y * (s.first_offset.y + s.lowered);
            level + (s.first_offset - level) * (1.0 - left)
        };
        match (before, after) {
            (Some(before), Some(after)) => {
                let gap = after.roll_span.0 - before.roll_span.1;
                let way = smoothstep((time - before.roll_span.1).as_secs() / gap.as_secs());
                if gap <= LONGEST_GAP {
                    before.last_offset.lerp(after.first_offset, way)
                } else {
                    leaving(before).lerp(coming(after), way)
                }
            }
            // A foot that lands soon after the start already has the correction of that contact, and a foot that lifts off shortly before
            // the end keeps its correction.
            (None, Some(after)) if self.open_ends[0] && after.from <= LONGEST_GAP => after.first_offset,
            (Some(before), None) if self.open_ends[1] && self.span.1 - before.to <= LONGEST_GAP => {
                before.last_offset
            }
            (Some(before), None) => leaving(before),
            (None, Some(after)) => coming(after),
            (None, None) => DVec3::ZERO,
        }
    }
}

/// Applies foot locking to a pose: moves the hips with the ground and bends the legs.
pub(super) fn apply_foot_lock(
    track: &FootLockTrack,
    foot_lock: &FootLock,
    time: Time,
    share: f64,
    world_from_model: &DAffine3,
    model_from_world: &DAffine3,
    body: &mut PosedSkeleton,
) {
    let places = |body: &PosedSkeleton, leg: &Leg| {
        let joint = leg.toe.unwrap_or(leg.foot) as usize;
        joint_world_position(world_from_model, &body.model_from_joint[joint])
    };
    let corrections: Vec<DVec3> = foot_lock
        .legs
        .iter()
        .enumerate()
        .map(|(i, leg)| track.correction(i, time, places(body, leg)) * share)
        .collect();
    let feet: Vec<DVec3> = foot_lock.legs.iter().map(|leg| body.position(leg.foot)).collect();
    if let (Some(hips), true) = (foot_lock.hips, !foot_lock.ground.is_empty()) {
        // The hips move as far as the lower foot needs.
        let drop = corrections.iter().map(|c| c.y).fold(f64::INFINITY, f64::min);
        if drop.is_finite() {
            shift_hips_and_feet(hips, &foot_lock.legs, model_from_world.matrix3 * (DVec3::Y * drop), body);
        }
    }
    if let (Some(hips), drop @ f64::MIN_POSITIVE..) = (foot_lock.hips, track.hip_drop_at(time) * share) {
        shift_hips_and_feet(hips, &foot_lock.legs, model_from_world.matrix3 * (DVec3::NEG_Y * drop), body);
    }
    let targets: Vec<DVec3> =
        feet.iter().zip(&corrections).map(|(foot, c)| *foot + model_from_world.matrix3 * *c).collect();
    for (leg, target) in foot_lock.legs.iter().zip(targets) {
        let (ankle, roll) = ankle_with_raised_heel(leg, target, body);
        bend_leg(leg, ankle, track.front.direction(), body);
        body.turn(leg.foot, roll);
    }
}

/// Moves the hips with the legs. Feet that are IK handles are not below the hips, so they are moved separately.
fn shift_hips_and_feet(hips: u32, legs: &[Leg], by: DVec3, body: &mut PosedSkeleton) {
    body.shift(hips, by);
    for leg in legs {
        if !body.is_below(leg.foot, hips) {
            body.shift(leg.foot, by);
        }
    }
}

/// Ankle position in model space, and rotation to apply to the foot. If the leg reaches `target`, the ankle is there and the foot is not
/// rotated; else the heel rises about the ball, as before lift-off. (Tried lowering the hips instead: the head jerks.)
fn ankle_with_raised_heel(leg: &Leg, target: DVec3, body: &PosedSkeleton) -> (DVec3, DQuat) {
    let [hip, knee, foot] = [leg.hip, leg.knee, leg.foot].map(|j| body.position(j));
    let reach = ((knee - hip).length() + (foot - knee).length()) * 0.9999;
    let Some(toe) = leg.toe.filter(|_| (target - hip).length() > reach) else {
        return (target, DQuat::IDENTITY);
    };
    let sole = body.position(toe) - foot;
    let ball = target + sole;
    let way = ball - hip;
    let (far, long) = (way.length(), sole.length());
    let Some(line) = way.try_normalize() else { return (target, DQuat::IDENTITY) };
    // The spheres around hip and ball intersect in a circle: takes its point nearest to the target. If they do not intersect, leg and foot
    // lie on one line.
    let along = ((reach * reach - long * long + far * far) / (2.0 * far)).min(reach);
    let across = (target - hip) - line * (target - hip).dot(line);
    let across =
        across.try_normalize().unwrap_or(DVec3::ZERO) * (reach * reach - along * along).max(0.0).sqrt();
    let ankle = hip + line * along + across;
    (ankle, rotation_between(sole, ball - ankle))
}
