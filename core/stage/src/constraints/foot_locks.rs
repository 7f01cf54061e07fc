//! The tracks of foot locks: each is planned once, for the span of time around a frame that needs it.

use crate::actors::Scratch;
use crate::constraints::foot_contacts::{ClipContacts, FootContacts};
use crate::constraints::foot_lock::{ContactSpan, FADE, FootLockTrack, come_down, roll, stand, unrest};
use crate::constraints::foot_samples::{FeetInMotion, leg_length};
use crate::constraints::ground::Ground;
use crate::constraints::standing_fades::FadeSteps;
use crate::pose::motions::Motions;
use crate::stage::constraint::FootLock;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;
use choreo_motion::contacts::still_intervals;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

pub(super) const STEP: Time = Time(Time::TICKS_PER_SECOND / 60);
/// Feet are looked at for an hour at most; beyond it and outside the stage's length they are not planted.
const MOST_SAMPLES: i64 = 60 * 3600;
/// Across a longer gap between two contacts a foot is as its clips have it.
pub(super) const LONGEST_GAP: Time = Time(Time::TICKS_PER_SECOND);

/// The foot lock constraints of one stage. Clones share what they have planned.
#[derive(Clone, Debug, Default)]
pub(crate) struct FootLocks(Arc<Planned>);

/// The spans of each constraint, by actor and constraint.
type Windows = BTreeMap<(usize, usize), Arc<Vec<Window>>>;

#[derive(Debug, Default)]
struct Planned {
    windows: Mutex<Windows>,
    contacts: ClipContacts,
}

/// A span of time whose contacts depend on no others.
#[derive(Debug)]
struct Window {
    from: Time,
    to: Time,
    /// Whether the stage begins and ends in it.
    open: [bool; 2],
    track: OnceLock<Arc<FootLockTrack>>,
}

impl Window {
    fn counts(&self, time: Time) -> bool {
        let fade = Time::from_secs(FADE);
        (self.open[0] || self.from - fade < time) && (self.open[1] || time < self.to + fade)
    }
}

/// A foot lock constraint of a stage.
#[derive(Clone, Copy)]
pub(crate) struct FootLockOf<'a> {
    pub stage: &'a Stage,
    pub motions: &'a Arc<Motions>,
    pub actor: usize,
    pub constraint: usize,
    pub foot_lock: &'a FootLock,
}

impl FootLocks {
    /// The track that counts at a time, if any. The same whichever thread asks first; two threads that ask at once may both plan it.
    pub fn track(&self, of: FootLockOf, time: Time) -> Result<Option<Arc<FootLockTrack>>, StageError> {
        let known = || self.0.windows.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (of.actor, of.constraint);
        let windows = known().entry(key).or_insert_with(|| Arc::new(windows(of.stage, of.foot_lock))).clone();
        let Some(window) = windows.iter().find(|window| window.counts(time)) else { return Ok(None) };
        if let Some(track) = window.track.get() {
            return Ok(Some(track.clone()));
        }
        let track = Arc::new(plan(&of, &self.0.contacts, window)?);
        Ok(Some(window.track.get_or_init(|| track).clone()))
    }
}

fn plan(of: &FootLockOf, clips: &ClipContacts, window: &Window) -> Result<FootLockTrack, StageError> {
    let FootLockOf { stage, actor, foot_lock, .. } = *of;
    let &Window { from, to, open, .. } = window;
    let ground: Vec<Ground> =
        foot_lock.ground.iter().map(|g| Ground::of(stage, *g)).collect::<Result<_, _>>()?;
    let leg = leg_length(stage, actor, foot_lock);
    // Each sample places all actors of a stage.
    let alone = alone(stage, actor);
    let (within, index) = alone.as_ref().map_or((stage, actor), |alone| (alone, 0));
    let motions = if alone.is_some() { Arc::new(of.motions.only(actor)) } else { of.motions.clone() };
    let mut scratch = Scratch::only(vec![index]);
    scratch.motions = Some(motions);
    let mut feet = FeetInMotion { stage: within, actor: index, foot_lock, scratch };
    let count = foot_lock.legs.len();
    // How much higher than in its clips each foot stood last.
    let mut raised = vec![0.0; count];
    let by_clips = !foot_lock.only.is_empty() || !foot_lock.standing_fades.is_empty();
    let by_clips = by_clips.then(|| FootContacts::new(&stage.actors[actor], &foot_lock.legs, clips));
    let samples = feet.sample(from, to)?;
    let (mut legs, mut steps) = (vec![Vec::new(); count], vec![Vec::new(); count]);
    // The contacts of clips are exact in time.
    let of_clips = by_clips.as_ref().filter(|_| !foot_lock.only.is_empty());
    let of_clips = of_clips.map(|contacts| contacts.stands(count, from, to));
    for (index, (found, raised)) in legs.iter_mut().zip(&mut raised).enumerate() {
        let mut stand = |span: &ContactSpan| stand(&samples, span, index, foot_lock, &ground, raised);
        let Some(of_clips) = &of_clips else {
            let places = &samples.feet[index];
            let still = still_intervals(&unrest(&samples, places, leg), STEP.as_secs(), false);
            let stay = |(first, last): &(usize, usize)| ContactSpan {
                span: (samples.time(*first), samples.time(*last)),
                ends: [places[*first], places[*last]],
            };
            found.extend(still.iter().map(|still| stand(&stay(still))));
            continue;
        };
        for span in &of_clips[index] {
            let ends = [feet.place(index, span.0)?, feet.place(index, span.1)?];
            found.push(stand(&ContactSpan { span: *span, ends }));
        }
    }
    if let Some(contacts) = &by_clips {
        let fades = &foot_lock.standing_fades;
        for (i, fade) in fades.iter().enumerate().filter(|(_, f)| from <= f.from && f.to <= to) {
            let mut stand = |leg: usize, span: &ContactSpan| {
                stand(&samples, span, leg, foot_lock, &ground, &mut raised[leg])
            };
            let before = i.checked_sub(1).map_or(from, |i| fades[i].to);
            let after = fades.get(i + 1).map_or(to, |next| next.from);
            let room = (before.max(from), after.min(to));
            FadeSteps { fade, room, leg_length: leg, samples: &samples, clips: contacts }
                .run(&mut feet, &mut stand, &mut legs, &mut steps)?;
        }
    }
    for (index, found) in legs.iter_mut().enumerate() {
        roll(&samples, index, leg, &steps[index], found);
    }
    let comes_down = ground.is_empty() && foot_lock.hips.is_some();
    let drops = if comes_down { come_down(&samples, &legs) } else { Vec::new() };
    let front = stage.actors[actor].asset.front();
    Ok(FootLockTrack { legs, steps, span: (from, to), open, drops, leg, front })
}

/// A stage of one actor, if its motion depends on nothing else.
fn alone(stage: &Stage, actor: usize) -> Option<Stage> {
    let one = &stage.actors[actor];
    let depends = !stage.hooks.is_empty() || !one.parents.is_empty() || one.face.is_some();
    (!depends).then(|| Stage {
        settings: stage.settings.clone(),
        actors: vec![one.clone()],
        ..Stage::default()
    })
}

/// The times in which feet are looked at, one after the other: all of the stage, or around those that count.
fn windows(stage: &Stage, foot_lock: &FootLock) -> Vec<Window> {
    // A stage may end while feet still step.
    let last_steps = foot_lock.standing_fades.last().map_or(Time::ZERO, |fade| fade.to + LONGEST_GAP);
    let length = stage.settings.length.max(last_steps).min(Time(MOST_SAMPLES * STEP.0));
    let around = |(from, to): &(Time, Time)| (*from - LONGEST_GAP, *to + LONGEST_GAP);
    let mut all: Vec<(Time, Time)> = match foot_lock.only.is_empty() {
        true => vec![(Time::ZERO, length)],
        false => foot_lock.only.iter().map(around).collect(),
    };
    all.iter_mut().for_each(|(from, to)| (*from, *to) = ((*from).max(Time::ZERO), (*to).min(length)));
    all.retain(|(from, to)| from < to || foot_lock.only.is_empty());
    all.sort_unstable();
    all.dedup_by(|next, before| {
        // Each ends before the next one begins to count.
        let joined = (next.0 - before.1).as_secs() < 2.0 * FADE;
        if joined {
            before.1 = before.1.max(next.1);
        }
        joined
    });
    let window = |(from, to): (Time, Time)| {
        let open = [from <= Time::ZERO, to >= stage.settings.length];
        Window { from, to, open, track: OnceLock::new() }
    };
    all.into_iter().map(window).collect()
}
