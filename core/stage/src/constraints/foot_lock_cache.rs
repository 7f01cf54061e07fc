//! Cache of foot-lock tracks: each is planned once, for the time span around the first frame that needs it.

use crate::actors::ActorScratch;
use crate::constraints::foot_contacts::{ClipContacts, FootContacts};
use crate::constraints::foot_lock::{
    Contact, ContactSpan, FADE_SECS, FootLockTrack, RollInputs, contact_on_ground, extend_rolls, hip_drops,
    is_locked_contact, motion_ratios,
};
use crate::constraints::foot_samples::{FeetInMotion, FootSamples, leg_length};
use crate::constraints::footsteps::Footstep;
use crate::constraints::gait_fades::GaitFade;
use crate::constraints::ground::Ground;
use crate::constraints::long_contacts::LongContacts;
use crate::constraints::standing_fades::FadeSteps;
use crate::constraints::stands::{HeldFoot, StandingSpan, find_stands};
use crate::pose::motions::Motions;
use crate::stage::constraint::FootLock;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;
use choreo_motion::contacts::still_intervals;
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Sampling interval of feet.
pub(super) const SAMPLE_INTERVAL: Time = Time(Time::TICKS_PER_SECOND / 60);
/// Largest number of samples of feet: one hour. Beyond it, and outside the stage's length, feet are not locked.
const MAX_SAMPLES: i64 = 60 * 3600;
/// Longest gap between two contacts across which corrections are interpolated; in a longer gap the horizontal correction fades out.
pub(super) const LONGEST_GAP: Time = Time(Time::TICKS_PER_SECOND);

/// Planned foot locks of one stage, shared by clones.
#[derive(Clone, Debug, Default)]
pub(crate) struct FootLocks(Arc<FootLockCache>);

/// Windows of each constraint, by actor index and constraint index.
type WindowsByConstraint = BTreeMap<(usize, usize), Arc<ConstraintWindows>>;

/// Windows of a constraint (its sampled spans in order of time, then the standing spans between them), and its standing spans.
#[derive(Debug)]
struct ConstraintWindows {
    windows: Vec<PlanningWindow>,
    stands: Vec<StandingSpan>,
}

#[derive(Debug, Default)]
struct FootLockCache {
    windows: Mutex<WindowsByConstraint>,
    contacts: ClipContacts,
}

/// Time span whose contacts are planned independently of other windows.
#[derive(Debug)]
struct PlanningWindow {
    from: Time,
    to: Time,
    /// Whether the stage begins, and ends, in the window.
    open_ends: [bool; 2],
    /// Indices of the standing spans that continue before and after the window.
    stands: [Option<usize>; 2],
    /// Set if the window only covers a standing span: the index of that span, and the windows before and after.
    stand_only: Option<(usize, [Option<usize>; 2])>,
    track: OnceLock<Arc<FootLockTrack>>,
}

impl PlanningWindow {
    /// Fades the lowering of the hips to zero on sides where a standing span continues outside this window.
    fn taper_hip_drops(&self, drops: &mut [f64]) {
        let fading = (FADE_SECS / SAMPLE_INTERVAL.as_secs()) as usize;
        let count = drops.len();
        for (i, drop) in drops.iter_mut().enumerate() {
            for (side, left) in [i, count - 1 - i].into_iter().enumerate() {
                if self.stands[side].is_some() && left < fading {
                    *drop *= left as f64 / fading as f64;
                }
            }
        }
    }

    /// Whether another window continues on a side (0: before, 1: after).
    fn continues_on_side(&self, side: usize) -> bool {
        self.stands[side].is_some() || self.stand_only.is_some_and(|(_, beside)| beside[side].is_some())
    }

    fn covers(&self, time: Time) -> bool {
        let fade = [0, 1].map(|side| match self.continues_on_side(side) {
            true => Time::ZERO,
            false => Time::from_secs(FADE_SECS),
        });
        (self.open_ends[0] || self.from - fade[0] <= time) && (self.open_ends[1] || time <= self.to + fade[1])
    }
}

/// A foot lock constraint of a stage.
#[derive(Clone, Copy)]
pub(crate) struct FootLockContext<'a> {
    pub stage: &'a Stage,
    pub motions: &'a Arc<Motions>,
    pub actor: usize,
    pub constraint: usize,
    pub foot_lock: &'a FootLock,
}

impl FootLocks {
    /// The track that applies at a time, if any. The result does not depend on which thread asks first; two threads that ask at once may
    /// both plan it.
    pub(crate) fn track_at(
        &self,
        context: FootLockContext,
        time: Time,
    ) -> Result<Option<Arc<FootLockTrack>>, StageError> {
        let known = || self.0.windows.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (context.actor, context.constraint);
        let of_stage = || Arc::new(ConstraintWindows::of(context.stage, context.actor, context.foot_lock));
        let spans = known().entry(key).or_insert_with(of_stage).clone();
        let Some(mut window) = spans.windows.iter().find(|window| window.covers(time)) else {
            return Ok(None);
        };
        if window.track.get().is_none()
            && let Some((stand, beside)) = window.stand_only
        {
            if let Some(held) = track_of_stand(&context, &spans.stands[stand], window)? {
                window.track.get_or_init(|| Arc::new(held));
            } else {
                // The feet are not held in this standing span: the neighboring windows fade out as they would without it.
                let fade = Time::from_secs(FADE_SECS);
                let near = [time - window.from < fade, window.to - time < fade];
                let Some(other) = [0, 1].into_iter().find_map(|i| beside[i].filter(|_| near[i])) else {
                    return Ok(None);
                };
                window = &spans.windows[other];
            }
        }
        if let Some(track) = window.track.get() {
            return Ok(Some(track.clone()));
        }
        let track = Arc::new(plan_track(&context, &self.0.contacts, &spans.stands, window)?);
        Ok(Some(window.track.get_or_init(|| track).clone()))
    }
}

/// Runs a function with the sampled feet of an actor. The actor is evaluated in a stage of its own if that gives the same motion.
fn with_sampled_feet<T>(
    context: &FootLockContext,
    run: impl FnOnce(&mut FeetInMotion) -> Result<T, StageError>,
) -> Result<T, StageError> {
    // Each sample places all actors of a stage, so a stage with one actor is faster.
    let alone = single_actor_stage(context.stage, context.actor);
    let (stage, actor) = alone.as_ref().map_or((context.stage, context.actor), |alone| (alone, 0));
    let motions = if alone.is_some() {
        Arc::new(context.motions.for_actor(context.actor))
    } else {
        context.motions.clone()
    };
    let mut scratch = ActorScratch::for_actors(vec![actor]);
    scratch.motions = Some(motions);
    run(&mut FeetInMotion { stage, actor, foot_lock: context.foot_lock, scratch })
}

/// The track of a standing span; `None` if its feet are not held.
fn track_of_stand(
    context: &FootLockContext,
    stand: &StandingSpan,
    window: &PlanningWindow,
) -> Result<Option<FootLockTrack>, StageError> {
    let leg_length = leg_length(context.stage, context.actor, context.foot_lock);
    let places = with_sampled_feet(context, |feet| {
        Ok(stand.foot_positions(feet, leg_length)?.map(<[DVec3]>::to_vec))
    })?;
    let front = context.stage.actors[context.actor].asset.front();
    Ok(places.map(|places| FootLockTrack {
        steps: vec![Vec::new(); places.len()],
        contacts_by_leg: places.into_iter().map(|at| vec![stand.contact_at(at)]).collect(),
        span: (window.from, window.to),
        open_ends: [0, 1].map(|side| window.open_ends[side] || window.continues_on_side(side)),
        hip_drops: Vec::new(),
        leg_length,
        gait_fades: Vec::new(),
        front,
    }))
}

fn plan_track(
    context: &FootLockContext,
    clips: &ClipContacts,
    stands: &[StandingSpan],
    window: &PlanningWindow,
) -> Result<FootLockTrack, StageError> {
    with_sampled_feet(context, |feet| plan_track_with_feet(context, clips, stands, window, feet))
}

fn plan_track_with_feet(
    context: &FootLockContext,
    clips: &ClipContacts,
    stands: &[StandingSpan],
    window: &PlanningWindow,
    feet: &mut FeetInMotion,
) -> Result<FootLockTrack, StageError> {
    let FootLockContext { stage, actor, foot_lock, .. } = *context;
    let &PlanningWindow { from, to, open_ends, .. } = window;
    let ground: Vec<Ground> =
        foot_lock.ground.iter().map(|g| Ground::of(stage, *g)).collect::<Result<_, _>>()?;
    let leg_length = leg_length(stage, actor, foot_lock);
    let samples = feet.sample_feet(from, to)?;
    let by_clips = !foot_lock.locked_spans.is_empty() || !foot_lock.standing_fades.is_empty();
    let by_clips = by_clips.then(|| FootContacts::new(&stage.actors[actor], &foot_lock.legs, clips));
    let lowers_hips = ground.is_empty() && foot_lock.hips.is_some();
    let planner = ContactPlanner { foot_lock, stands, window, ground, leg_length, samples, lowers_hips };
    let count = foot_lock.legs.len();
    let mut plan = ContactPlan {
        contacts_by_leg: vec![Vec::new(); count],
        steps: vec![Vec::new(); count],
        raised: vec![0.0; count],
        gait_fades: Vec::new(),
        open_ends,
    };
    match by_clips.as_ref().filter(|_| !foot_lock.locked_spans.is_empty()) {
        // The contacts of clips are exact in time.
        Some(contacts) => {
            planner.add_clip_contacts(&contacts.contact_spans(count, from, to), feet, &mut plan)?
        }
        None => planner.add_sampled_contacts(&mut plan),
    }
    let mut places = planner.stand_positions(feet)?;
    if let Some(contacts) = &by_clips {
        planner.add_standing_fade_steps(contacts, feet, &mut places, &mut plan)?;
    }
    planner.hold_feet_in_stands(&places, &mut plan);
    let samples = &planner.samples;
    for (index, found) in plan.contacts_by_leg.iter_mut().enumerate() {
        let inputs = RollInputs { leg_length, steps: &plan.steps[index], gait_fades: &plan.gait_fades };
        extend_rolls(samples, index, &inputs, found);
    }
    let mut hip_drops = if lowers_hips { hip_drops(samples, &plan.contacts_by_leg) } else { Vec::new() };
    window.taper_hip_drops(&mut hip_drops);
    let front = stage.actors[actor].asset.front();
    let ContactPlan { contacts_by_leg, steps, gait_fades, open_ends, .. } = plan;
    Ok(FootLockTrack {
        contacts_by_leg,
        steps,
        span: (from, to),
        open_ends,
        hip_drops,
        leg_length,
        gait_fades,
        front,
    })
}

/// Output of the planner, by leg.
struct ContactPlan {
    contacts_by_leg: Vec<Vec<Contact>>,
    steps: Vec<Vec<Footstep>>,
    /// Height of the ground above the clips' floor at the last contact of each leg, metres.
    raised: Vec<f64>,
    gait_fades: Vec<GaitFade>,
    /// Whether corrections hold beyond the start and the end of the window: the stage begins or ends in it, or a standing span with held
    /// feet continues.
    open_ends: [bool; 2],
}

/// Finds the contacts of a constraint in a window.
struct ContactPlanner<'a> {
    foot_lock: &'a FootLock,
    stands: &'a [StandingSpan],
    window: &'a PlanningWindow,
    ground: Vec<Ground>,
    /// Length of a leg, metres.
    leg_length: f64,
    samples: FootSamples,
    /// Whether the hips are lowered for feet that are out of reach.
    lowers_hips: bool,
}

impl ContactPlanner<'_> {
    fn contact_on_ground(&self, leg: usize, span: &ContactSpan, raised: &mut [f64]) -> Contact {
        contact_on_ground(&self.samples, span, leg, self.foot_lock, &self.ground, &mut raised[leg])
    }

    /// Adds contacts where the sampled feet are still.
    fn add_sampled_contacts(&self, plan: &mut ContactPlan) {
        let samples = &self.samples;
        for (index, found) in plan.contacts_by_leg.iter_mut().enumerate() {
            let places = &samples.feet[index];
            for (first, last) in still_intervals(
                &motion_ratios(samples, places, self.leg_length),
                SAMPLE_INTERVAL.as_secs(),
                false,
            ) {
                let span = (samples.time_of_sample(first), samples.time_of_sample(last));
                let ends = [places[first], places[last]];
                let span = ContactSpan { span, ends, highest: f64::INFINITY };
                found.push(self.contact_on_ground(index, &span, &mut plan.raised));
            }
        }
    }

    /// Adds the contacts of the clips, by leg, with footsteps in contacts that are longer than the leg reaches.
    fn add_clip_contacts(
        &self,
        of_clips: &[Vec<(Time, Time)>],
        feet: &mut FeetInMotion,
        plan: &mut ContactPlan,
    ) -> Result<(), StageError> {
        if self.lowers_hips {
            plan.gait_fades = GaitFade::find_all(self.foot_lock, &self.samples, of_clips);
        }
        let lowest = if self.lowers_hips { FootLock::MAX_HIP_DROP_SHARE } else { 0.0 };
        for (index, contacts) in of_clips.iter().enumerate() {
            for span in contacts {
                let highest = GaitFade::max_contact_height(&plan.gait_fades, index, *span);
                let (samples, leg_length) = (&self.samples, self.leg_length);
                let long = LongContacts { samples, leg: index, leg_length, lowest, highest };
                let parts = if is_locked_contact(self.foot_lock, *span) {
                    long.split_contact(*span)
                } else {
                    vec![*span]
                };
                let first = plan.contacts_by_leg[index].len();
                for span in parts {
                    let ends = [feet.foot_position(index, span.0)?, feet.foot_position(index, span.1)?];
                    let span = ContactSpan { span, ends, highest };
                    plan.contacts_by_leg[index].push(self.contact_on_ground(index, &span, &mut plan.raised));
                }
                plan.steps[index].extend(long.steps_between(&plan.contacts_by_leg[index][first..]));
            }
            self.shorten_close_contacts(index, feet, plan)?;
        }
        Ok(())
    }

    /// Shortens contacts that leave a foot too little time to get from one to the next.
    fn shorten_close_contacts(
        &self,
        index: usize,
        feet: &mut FeetInMotion,
        plan: &mut ContactPlan,
    ) -> Result<(), StageError> {
        let ContactPlan { contacts_by_leg, steps, gait_fades, .. } = plan;
        for i in 1..contacts_by_leg[index].len() {
            let [before, after] = [contacts_by_leg[index][i - 1], contacts_by_leg[index][i]];
            if steps[index].iter().any(|step| step.from == before.to) {
                continue;
            }
            let lacking = GaitFade::min_gap(gait_fades, index, self.leg_length, [&before, &after])
                - (after.from - before.to);
            // Each contact keeps at least half of its time.
            let cut =
                |contact: &Contact| Time(lacking.0 / 2).min(contact.from.middle(contact.to) - contact.from);
            if let (true, Some(left), Some(reached)) = (lacking > Time::ZERO, before.position, after.position)
            {
                let (to, from) = (before.to - cut(&before), after.from + cut(&after));
                let (last_offset, first_offset) =
                    (left - feet.foot_position(index, to)?, reached - feet.foot_position(index, from)?);
                contacts_by_leg[index][i - 1] =
                    Contact { to, last_offset, roll_span: (before.roll_span.0, to), ..before };
                contacts_by_leg[index][i] =
                    Contact { from, first_offset, roll_span: (from, after.roll_span.1), ..after };
            }
        }
        Ok(())
    }

    /// World positions of the feet in each standing span; `None` if the span does not touch the window or its feet are not held.
    fn stand_positions(&self, feet: &mut FeetInMotion) -> Result<Vec<Option<Vec<DVec3>>>, StageError> {
        let of_stand = |held: &StandingSpan| {
            let counts = held.from <= self.window.to && held.to >= self.window.from;
            let found = if counts { held.foot_positions(feet, self.leg_length)? } else { None };
            Ok(found.map(<[DVec3]>::to_vec))
        };
        self.stands.iter().map(of_stand).collect()
    }

    /// Adds the footsteps of fades between walking and standing.
    fn add_standing_fade_steps(
        &self,
        contacts: &FootContacts,
        feet: &mut FeetInMotion,
        places: &mut [Option<Vec<DVec3>>],
        plan: &mut ContactPlan,
    ) -> Result<(), StageError> {
        let &PlanningWindow { from, to, open_ends, .. } = self.window;
        let fades = &self.foot_lock.standing_fades;
        let ContactPlan { contacts_by_leg, steps, raised, .. } = plan;
        for (i, fade) in fades.iter().enumerate().filter(|(_, f)| from <= f.from && f.to <= to) {
            let before = i.checked_sub(1).map(|i| fades[i].to);
            // A step may begin before the stage does, where it is not visible.
            let begin = if open_ends[0] && before.is_none() { -LONGEST_GAP } else { from };
            let after = fades.get(i + 1).map_or(to, |next| next.from);
            let free_span = (before.map_or(begin, |before| before.max(from)), after.min(to));
            let held = self.stands.iter().position(|stand| match fade.ends_standing {
                true => stand.from == fade.to,
                false => stand.to == fade.from,
            });
            let begins =
                |held: usize| !fade.ends_standing && before.is_none() && self.stands[held].from >= from;
            let is_free_stand = held.is_some_and(begins);
            let places = held.and_then(|held| places[held].as_deref_mut());
            let mut contact_on_ground =
                |leg: usize, span: &ContactSpan| self.contact_on_ground(leg, span, raised);
            FadeSteps {
                fade,
                free_span,
                leg_length: self.leg_length,
                samples: &self.samples,
                clips: contacts,
                is_free_stand,
            }
            .run(feet, &mut contact_on_ground, places, contacts_by_leg, steps)?;
        }
        Ok(())
    }

    /// Keeps the feet at their positions during standing spans.
    fn hold_feet_in_stands(&self, places: &[Option<Vec<DVec3>>], plan: &mut ContactPlan) {
        let (from, to) = (self.window.from, self.window.to);
        for (number, (stand, places)) in self.stands.iter().zip(places).enumerate() {
            let Some(places) = places.as_ref().filter(|_| stand.from < to && stand.to > from) else {
                continue;
            };
            for (leg, at) in places.iter().enumerate() {
                let (samples, steps) = (&self.samples, &plan.steps[leg]);
                let foot = HeldFoot { leg, position: *at, samples, span: (from, to), steps };
                foot.hold(stand, &mut plan.contacts_by_leg[leg]);
            }
            for side in [0, 1] {
                plan.open_ends[side] |= self.window.stands[side] == Some(number);
            }
        }
    }
}

/// A stage with this actor alone, if its motion does not depend on callbacks or other actors.
fn single_actor_stage(stage: &Stage, actor: usize) -> Option<Stage> {
    let own = &stage.actors[actor];
    let depends = !stage.frame_callbacks.is_empty() || !own.parents.is_empty() || own.face.is_some();
    (!depends).then(|| Stage {
        settings: stage.settings.clone(),
        actors: vec![own.clone()],
        ..Stage::default()
    })
}

/// Time spans in which feet are sampled, sorted and disjoint: the whole stage, or the spans in `locked_spans` with a margin.
fn sampled_spans(stage: &Stage, foot_lock: &FootLock) -> Vec<(Time, Time)> {
    // The stage may end during a step, whose end must be known: on a slope a foot lands lower than it stood.
    let last_steps = foot_lock.standing_fades.last().map_or(Time::ZERO, |fade| fade.to);
    let length = stage.settings.length.max(last_steps) + LONGEST_GAP;
    let length = length.min(Time(MAX_SAMPLES * SAMPLE_INTERVAL.0));
    let around = |(from, to): &(Time, Time)| (*from - LONGEST_GAP, *to + LONGEST_GAP);
    let mut all: Vec<(Time, Time)> = match foot_lock.locked_spans.is_empty() {
        true => vec![(Time::ZERO, length)],
        false => foot_lock.locked_spans.iter().map(around).collect(),
    };
    all.iter_mut().for_each(|(from, to)| (*from, *to) = ((*from).max(Time::ZERO), (*to).min(length)));
    all.retain(|(from, to)| from < to || foot_lock.locked_spans.is_empty());
    all.sort_unstable();
    all.dedup_by(|next, before| {
        // Windows stay separate only if the fade-out of one ends before the next one fades in.
        let joined = (next.0 - before.1).as_secs() < 2.0 * FADE_SECS;
        if joined {
            before.1 = before.1.max(next.1);
        }
        joined
    });
    all
}

impl ConstraintWindows {
    fn of(stage: &Stage, actor: usize, foot_lock: &FootLock) -> ConstraintWindows {
        let window = |(from, to): (Time, Time)| {
            let open_ends = [from <= Time::ZERO, to >= stage.settings.length];
            PlanningWindow {
                from,
                to,
                open_ends,
                stands: [None; 2],
                stand_only: None,
                track: OnceLock::new(),
            }
        };
        let mut windows: Vec<PlanningWindow> =
            sampled_spans(stage, foot_lock).into_iter().map(window).collect();
        let stands = find_stands(&stage.actors[actor], foot_lock);
        let planned = windows.len();
        for (number, stand) in stands.iter().enumerate() {
            let at = |time: Time| windows[..planned].iter().position(|w| w.from <= time && time <= w.to);
            let beside = [at(stand.from), at(stand.to)];
            if beside[0].is_some() && beside[0] == beside[1] {
                continue;
            }
            let from = beside[0].map_or(stand.from, |w| windows[w].to);
            let to = beside[1].map_or(stand.to, |w| windows[w].from);
            if from >= to.min(stage.settings.length) {
                continue;
            }
            for (side, window) in beside.into_iter().enumerate() {
                if let Some(window) = window {
                    windows[window].stands[1 - side] = Some(number);
                    windows[window].open_ends[1 - side] = false;
                }
            }
            let open_ends = [from <= Time::ZERO, to == Time::MAX];
            let stand_only = Some((number, beside));
            windows.push(PlanningWindow {
                from,
                to,
                open_ends,
                stands: [None; 2],
                stand_only,
                track: OnceLock::new(),
            });
        }
        ConstraintWindows { windows, stands }
    }
}
