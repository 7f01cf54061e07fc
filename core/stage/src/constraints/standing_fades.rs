//! Foot locking in fades between walking and standing: footsteps lead from the contacts before the fade to the contacts after it.

use crate::constraints::foot_contacts::FootContacts;
use crate::constraints::foot_lock::{Contact, ContactSpan, ground_clearance};
use crate::constraints::foot_lock_cache::{LONGEST_GAP, SAMPLE_INTERVAL};
use crate::constraints::foot_samples::{FeetInMotion, FootSamples};
use crate::constraints::footsteps::{FootState, Footstep, FootstepPlan};
use crate::stage::StageError;
use crate::stage::constraint::StandingFade;
use choreo_motion::Time;
use glam::DVec3;

/// Upper limit of the time until a foot in the air lands, seconds.
const LONGEST_SWING: f64 = 0.6;
/// A foot that lands within this time, in seconds, counts as standing.
const LANDED_SECS: f64 = 1.0 / 120.0;
/// Extra reach of a leg with its heel raised, as a share of the sole's length.
const HEEL_REACH: f64 = 0.2;
/// A standing foot within this distance of where the walk begins, in leg lengths, stands there from the beginning.
const START_SNAP_LEGS: f64 = 0.08;
/// Time interval over which a velocity is measured.
const VELOCITY_INTERVAL: Time = Time(Time::TICKS_PER_SECOND / 480);

/// Function that computes the contact of a leg's foot over a span.
pub(super) type GroundContactFn<'a> = dyn FnMut(usize, &ContactSpan) -> Contact + 'a;

/// A foot on the walking and on the standing side of a fade.
struct FootSides {
    /// Contact on the walking side; for a foot in the air, a contact of zero length at its position.
    walking: Contact,
    state: FootState,
    standing: Contact,
}

impl FootSides {
    /// The times at which the first contact begins and the last one ends.
    fn replaced_span(&self, backwards: bool) -> [Time; 2] {
        match backwards {
            true => [self.standing.from, self.walking.to],
            false => [self.walking.from, self.standing.to],
        }
    }
}

/// The steps of one fade.
pub(super) struct FadeSteps<'a> {
    pub fade: &'a StandingFade,
    /// Time span between the fades before and after.
    pub free_span: (Time, Time),
    /// Length of a leg, metres.
    pub leg_length: f64,
    pub samples: &'a FootSamples,
    pub clips: &'a FootContacts<'a>,
    /// Whether no other fade depends on the positions of the standing feet.
    pub is_free_stand: bool,
}

impl FadeSteps<'_> {
    /// Replaces the contacts of all legs in the fade and adds its footsteps. If the feet cannot reach their targets in time, the contacts
    /// stay. `places`: if the feet are held in the standing span, the positions of the feet while the standing clip plays alone; updated.
    pub(super) fn run(
        &self,
        feet: &mut FeetInMotion,
        contact_on_ground: &mut GroundContactFn,
        places: Option<&mut [DVec3]>,
        contacts: &mut [Vec<Contact>],
        steps: &mut [Vec<Footstep>],
    ) -> Result<(), StageError> {
        let backwards = self.is_backwards();
        let [walking_at, _] = self.walking_and_standing_times();
        let mut sides = Vec::new();
        for (leg, contacts) in contacts.iter().enumerate() {
            // Just outside the fade, on the walking side, only the walking clip is active.
            let just = if backwards { walking_at } else { walking_at - Time(1) };
            let lands_secs = self.clips.secs_until_landing(leg, just, backwards, LONGEST_SWING);
            let place = places.as_ref().and_then(|places| places.get(leg)).copied();
            sides.push(self.find_sides(feet, (leg, place), lands_secs, contacts, contact_on_ground)?);
        }
        let Some(planned) = self.plan_steps(&sides) else { return Ok(()) };
        for (leg, (side, planned)) in sides.iter().zip(planned).enumerate() {
            let [from, to] = side.replaced_span(backwards);
            // Removes earlier steps within the contacts that are replaced.
            steps[leg].retain(|step| step.to <= from || step.from >= to);
            self.replace_contacts(&mut contacts[leg], leg, side, &planned);
            steps[leg].extend(planned);
        }
        for (place, side) in places.into_iter().flatten().zip(&sides) {
            *place = side.standing.position.unwrap_or(*place);
        }
        Ok(())
    }

    fn is_backwards(&self) -> bool {
        !self.fade.ends_standing
    }

    /// Times of the walking and of the standing side.
    fn walking_and_standing_times(&self) -> [Time; 2] {
        let StandingFade { from, to, ends_standing } = *self.fade;
        if ends_standing { [from, to] } else { [to, from] }
    }

    /// Plans the steps of each leg, in order of time; `None` if they do not fit between the fades before and after.
    fn plan_steps(&self, sides: &[FootSides]) -> Option<Vec<Vec<Footstep>>> {
        let samples = self.samples;
        let [walking_at, standing_at] = self.walking_and_standing_times();
        let backwards = self.is_backwards();
        let time_at = |secs: f64| walking_at + Time::from_secs(if backwards { -secs } else { secs });
        let fade_secs = (self.fade.to - self.fade.from).as_secs();
        let (low, share) = samples.index_at(standing_at);
        let last = if share > 0.0 && !backwards { low + 1 } else { low };
        let model_from_stand = samples.transforms[last].inverse();
        let stance = |leg: usize, secs: f64| {
            let place = sides[leg].standing.position.unwrap_or_default();
            if secs >= fade_secs {
                return place;
            }
            let (low, share) = samples.index_at(time_at(secs));
            let in_model = model_from_stand.transform_point3(place);
            let under = |index: usize| samples.transforms[index].transform_point3(in_model);
            under(low).lerp(under((low + 1).min(samples.transforms.len() - 1)), share).with_y(place.y)
        };
        let reaches = |leg: usize, place: DVec3, secs: f64| {
            let (index, _) = samples.index_at(time_at(secs));
            let limb = samples.limbs[leg][index];
            let ankle = limb.ankle + (place - samples.feet[leg][index]);
            (ankle - limb.hip).length() < limb.reach + HEEL_REACH * limb.sole
        };
        let states: Vec<FootState> = sides.iter().map(|side| side.state).collect();
        let leg_length = self.leg_length;
        let plan = FootstepPlan { feet: &states, stance: &stance, reaches: &reaches, fade_secs, leg_length }
            .run()?;
        let mut planned = Vec::new();
        for steps in plan {
            let mut steps: Vec<Footstep> =
                steps.into_iter().map(|step| Footstep::new(step, walking_at, backwards)).collect();
            if backwards {
                steps.reverse();
            }
            if steps.iter().any(|step| step.from < self.free_span.0 || step.to > self.free_span.1) {
                return None;
            }
            planned.push(steps);
        }
        Some(planned)
    }

    /// Contacts and state of a foot at both ends of the fade.
    fn find_sides(
        &self,
        feet: &mut FeetInMotion,
        (leg, kept): (usize, Option<DVec3>),
        lands_secs: f64,
        contacts: &[Contact],
        contact_on_ground: &mut GroundContactFn,
    ) -> Result<FootSides, StageError> {
        let [walking_at, standing_at] = self.walking_and_standing_times();
        let mut place = |time: Time| feet.foot_position(leg, time);
        let edge = Time(3 * SAMPLE_INTERVAL.0);
        let over = |time: Time| contacts.iter().find(|c| c.from - edge <= time && time <= c.to + edge);
        // The part of a contact outside the fade.
        let mut contact_outside = |at: Time, before: bool| {
            let (from, to) = over(at).map_or((at, at), |c| (c.from, c.to));
            let span = if before { (from.min(at), at) } else { (at, to.max(at)) };
            let ends = [place(span.0)?, place(span.1)?];
            let contact = contact_on_ground(leg, &ContactSpan { span, ends, highest: f64::INFINITY });
            // A step of another fade may lead to this contact.
            let by_step = over(at).filter(|c| c.by_step).and_then(|c| c.position);
            let at = by_step.or(contact.position).unwrap_or(ends[0]);
            let (first_offset, last_offset) = (at - ends[0], at - ends[1]);
            Ok::<Contact, StageError>(Contact {
                position: Some(at),
                first_offset,
                last_offset,
                by_step: by_step.is_some(),
                ..contact
            })
        };
        let backwards = self.is_backwards();
        let mut standing = contact_outside(standing_at, backwards)?;
        if let Some(at) = kept {
            standing.move_to(at);
        }
        if lands_secs <= if backwards { 0.0 } else { LANDED_SECS } {
            let walking = contact_outside(walking_at, !backwards)?;
            let near = |a: DVec3, b: DVec3| (a - b).with_y(0.0).length() < START_SNAP_LEGS * self.leg_length;
            let begins = walking
                .position
                .filter(|at| self.is_free_stand && standing.position.is_some_and(|s| near(s, *at)));
            if let Some(at) = begins {
                standing.move_to(at);
            }
            let state = FootState {
                position: walking.position.unwrap_or_default(),
                velocity: DVec3::ZERO,
                lands_secs: 0.0,
            };
            return Ok(FootSides { walking, state, standing });
        }
        let near = if backwards {
            let after = contacts.iter().find(|c| c.from >= walking_at && c.from - walking_at <= LONGEST_GAP);
            after.map(|c| (c, c.first_offset))
        } else {
            let mut before = contacts.iter().rev();
            before
                .find(|c| c.to <= walking_at && walking_at - c.to <= LONGEST_GAP)
                .map(|c| (c, c.last_offset))
        };
        let here = place(walking_at)?;
        let mut carried = near.map_or(DVec3::ZERO, |(_, offset)| offset);
        let beside = if backwards { walking_at + VELOCITY_INTERVAL } else { walking_at - VELOCITY_INTERVAL };
        let mut velocity = (here - place(beside)?) / VELOCITY_INTERVAL.as_secs();
        // A foot that is almost on the ground steps from its contact.
        if let Some((contact, offset)) = near
            && let Some(at) = contact.position.filter(|_| self.holds_until(leg, contact, offset, walking_at))
        {
            carried = (at - here).with_y(offset.y);
            velocity = DVec3::ZERO;
        }
        // A step that leads to a foot in the air ends with ground clearance, however low the clip has the foot; otherwise the foot would
        // scuff.
        let above =
            standing.position.unwrap_or(here).y + ground_clearance(self.leg_length) - (here + carried).y;
        if backwards && above > 0.0 && velocity != DVec3::ZERO {
            carried.y += above;
        }
        let at = here + carried;
        let walking =
            Contact { by_step: true, ..Contact::new((walking_at, walking_at), Some(at), [carried; 2]) };
        Ok(FootSides { walking, state: FootState { position: at, velocity, lands_secs }, standing })
    }

    /// Whether a foot is almost on the ground in all samples from a contact to a time before or after it.
    fn holds_until(&self, leg: usize, contact: &Contact, offset: DVec3, time: Time) -> bool {
        let (from, to) = if time < contact.from { (time, contact.from) } else { (contact.to, time) };
        let [(first, _), (last, _)] = [from, to].map(|time| self.samples.index_at(time));
        let places = &self.samples.feet[leg][first..=(last + 1).min(self.samples.transforms.len() - 1)];
        places.iter().all(|place| contact.keeps_position(offset, *place, self.leg_length))
    }

    /// Replaces a leg's contacts in the fade: the foot stands before, between and after its steps.
    fn replace_contacts(
        &self,
        contacts: &mut Vec<Contact>,
        leg: usize,
        side: &FootSides,
        steps: &[Footstep],
    ) {
        let FootSides { walking, standing, .. } = *side;
        let (first, last) = if self.is_backwards() { (standing, walking) } else { (walking, standing) };
        let mut stands = Vec::new();
        let (mut from, mut at) = (first.from, first.position.unwrap_or_default());
        for step in steps {
            stands.push((from, step.from.max(from), at));
            (from, at) = (step.to, step.start_and_end()[1]);
        }
        stands.push((from, last.to.max(from), at));
        let in_clip = |time: Time| {
            let known = [
                (first.from, first.position, first.first_offset),
                (last.to, last.position, last.last_offset),
            ];
            let known = known.iter().find(|(of, ..)| *of == time);
            known.map_or_else(
                || self.samples.foot_position(leg, time),
                |(_, at, off)| at.unwrap_or_default() - *off,
            )
        };
        let stand = |(from, to, at): (Time, Time, DVec3)| {
            let offsets = [at - in_clip(from), at - in_clip(to)];
            Contact { by_step: true, ..Contact::new((from, to), Some(at), offsets) }
        };
        contacts.retain(|c| c.to < first.from || c.from > last.to);
        let place = contacts.partition_point(|c| c.from < first.from);
        contacts.splice(place..place, stands.into_iter().map(stand));
    }
}
