//! Footstep planner for fades between walking and standing: plans which foot steps, when, and where to.
//!
//! A plain fade averages the feet of both clips, which drags them over the ground. Here each foot stays in place until it is lifted, and
//! lands where the standing clip will have it. A foot that is in the air moves first, then the foot that is farthest from its target. A
//! long fade, in which the body keeps moving, takes several steps. A fade from standing to walking is planned backwards in time. Nothing is
//! stored from frame to frame: a step is a function of the time.

use choreo_motion::Time;
use glam::DVec3;

/// Duration of a step by a leg of length [`REFERENCE_LEG`], seconds.
const STEP_SECS: f64 = 0.35;
/// Length of a reference leg, metres.
pub(super) const REFERENCE_LEG: f64 = 0.85;
/// Shortest duration of a hurried step, as a share of a normal step.
const HURRIED_SHARE: f64 = 0.65;
/// Height of a step as a share of its length, and its upper and lower limits in leg lengths.
const LIFT_SHARE: f64 = 0.25;
const MAX_LIFT_LEGS: f64 = 0.1;
const MIN_LIFT_LEGS: f64 = 0.04;
/// Shares of a step's duration before which the foot only rises, and after which it only descends.
const VERTICAL_SHARES: [f64; 2] = [0.1, 0.85];
/// Lead of a step ahead of the hips: the time from the landing until the hips are over the foot, in step durations. The value is the
/// middle of the contact that follows.
const LEAD_STEPS: f64 = 0.7;
/// Number of fractions of [`LEAD_STEPS`] that are tried until the leg reaches.
const LEAD_TRIALS: u32 = 7;
/// Feet closer than this to their targets, in leg lengths, wait while the body still moves.
const MOVING_TOLERANCE_LEGS: f64 = 0.2;
/// A foot that would land within this distance of its final target, in leg lengths, lands on the target.
const SNAP_LEGS: f64 = 0.15;
/// Feet closer than this to their targets, in leg lengths, do not step.
const SETTLED_LEGS: f64 = 0.004;
const MAX_STEPS: usize = 64;
/// Time step of the planner, seconds.
const TIME_STEP_SECS: f64 = 1.0 / 60.0;
/// Largest initial speed of a step times its duration, in step lengths. With a larger value v the minimum-jerk quintic overshoots its end
/// at 1 and comes back: at a time u before the end it is at 1 − (10 − 4 v) u³.
const MAX_START_SPEED: f64 = 2.5;

/// State of a foot at the start of the plan, world space.
#[derive(Clone, Copy, Debug)]
pub(super) struct FootState {
    pub position: DVec3,
    /// Metres per second.
    pub velocity: DVec3,
    /// Seconds until the foot lands in its clip; 0 if it stands.
    pub lands_secs: f64,
}

/// Inputs of the planner; times in seconds since the plan begins.
pub(super) struct FootstepPlan<'a> {
    pub feet: &'a [FootState],
    /// World position that the standing clip gives a foot under the hips (leg, seconds).
    pub stance: &'a dyn Fn(usize, f64) -> DVec3,
    /// Whether a leg reaches a world position at a time (leg, position, seconds).
    pub reaches: &'a dyn Fn(usize, DVec3, f64) -> bool,
    /// Duration of the fade; the body stands from then on.
    pub fade_secs: f64,
    /// Length of a leg, metres.
    pub leg_length: f64,
}

/// One step; times in seconds since the plan begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlannedStep {
    pub from: f64,
    pub to: f64,
    pub start: DVec3,
    /// Velocity at the start, metres per second.
    pub velocity: DVec3,
    pub end: DVec3,
    /// Height of the foot above the line from start to end, metres.
    pub lift: f64,
}

impl FootstepPlan<'_> {
    /// Plans the steps of each foot, in order of time. `None` if no number of steps brings the feet to their targets.
    pub(super) fn run(&self) -> Option<Vec<Vec<PlannedStep>>> {
        let step_secs = step_secs(self.leg_length);
        let mut steps: Vec<Vec<PlannedStep>> = vec![Vec::new(); self.feet.len()];
        let mut places: Vec<DVec3> = self.feet.iter().map(|f| f.position).collect();
        let mut now: f64 = 0.0;
        for (leg, foot) in self.feet.iter().enumerate().filter(|(_, f)| f.lands_secs > 0.0) {
            let step = self.landing_step(leg, foot, step_secs);
            let (secs, end) = (step.to, step.end);
            steps[leg].push(step);
            places[leg] = end;
            now = now.max(secs);
        }
        let at_once = (self.feet.len() / 2).max(1);
        for _ in 0..MAX_STEPS {
            let off = |leg: usize, time: f64| {
                (self.landing_position(leg, time, step_secs) - places[leg]).with_y(0.0).length()
            };
            let mut worst: Vec<usize> = (0..places.len()).collect();
            worst.sort_by(|a, b| off(*b, now).total_cmp(&off(*a, now)));
            let wait = if now < self.fade_secs { MOVING_TOLERANCE_LEGS } else { SETTLED_LEGS };
            worst.retain(|leg| off(*leg, now) > wait * self.leg_length);
            worst.truncate(at_once);
            if worst.is_empty() {
                if now >= self.fade_secs {
                    return Some(steps);
                }
                now += TIME_STEP_SECS;
                continue;
            }
            // The other legs carry the body meanwhile, so the step is no longer than they reach their feet.
            let stays = |secs: f64| {
                let mut others = (0..places.len()).filter(|leg| !worst.contains(leg));
                others.all(|leg| (self.reaches)(leg, places[leg], now + secs))
            };
            let mut secs = HURRIED_SHARE * step_secs;
            while secs + TIME_STEP_SECS <= step_secs && stays(secs + TIME_STEP_SECS) {
                secs += TIME_STEP_SECS;
            }
            for leg in worst {
                let (start, end) = (places[leg], self.landing_position(leg, now + secs, step_secs));
                let (velocity, lift) = (DVec3::ZERO, step_lift(start, end, self.leg_length));
                steps[leg].push(PlannedStep { from: now, to: now + secs, start, velocity, end, lift });
                places[leg] = end;
            }
            now += secs;
        }
        None
    }

    /// The step of a foot that is in the air as the plan begins.
    fn landing_step(&self, leg: usize, foot: &FootState, step_secs: f64) -> PlannedStep {
        let hurried = HURRIED_SHARE * step_secs;
        let mut secs = foot.lands_secs.clamp(hurried, step_secs);
        let mut velocity = foot.velocity;
        let mut end = self.landing_position(leg, secs, step_secs);
        // A foot that is too fast for its remaining path would overshoot its target and come back. It lands earlier instead, at the
        // earliest as in its clip, and brakes if it is still too fast.
        let way = (end - foot.position).with_y(0.0);
        let ahead = way.normalize_or_zero();
        let speed = velocity.dot(ahead);
        let most = |secs: f64, end: DVec3| {
            MAX_START_SPEED * (end - foot.position).with_y(0.0).dot(ahead).max(0.0)
                / (VERTICAL_SHARES[1] * secs)
        };
        if speed > most(secs, end) {
            secs = (secs * most(secs, end) / speed).max(foot.lands_secs.min(secs)).max(TIME_STEP_SECS);
            end = self.landing_position(leg, secs, step_secs);
            velocity -= ahead * (speed - most(secs, end)).max(0.0);
        }
        // The present height above the ground counts towards the lift, and a short step is low.
        let high = (foot.position.y - end.y).max(0.0);
        let lift = (step_lift(foot.position, end, self.leg_length) - high)
            .max(MIN_LIFT_LEGS * self.leg_length)
            * (secs / hurried).min(1.0);
        PlannedStep { from: 0.0, to: secs, start: foot.position, velocity, end, lift }
    }

    /// World position at which a foot lands at a time: as far ahead of the hips as the leg reaches by then.
    fn landing_position(&self, leg: usize, secs: f64, step_secs: f64) -> DVec3 {
        let last = (self.stance)(leg, self.fade_secs);
        let ahead = |share: u32| {
            let there =
                (self.stance)(leg, secs + LEAD_STEPS * step_secs * f64::from(share) / f64::from(LEAD_TRIALS));
            if (there - last).length() < SNAP_LEGS * self.leg_length { last } else { there }
        };
        let reached = (0..=LEAD_TRIALS).rev().map(ahead).find(|there| (self.reaches)(leg, *there, secs));
        reached.unwrap_or_else(|| (self.stance)(leg, secs))
    }
}

/// Duration of a step in seconds. `leg_length`: metres.
pub(super) fn step_secs(leg_length: f64) -> f64 {
    STEP_SECS * (leg_length / REFERENCE_LEG).sqrt()
}

/// Duration of a hurried step in seconds. `leg_length`: metres.
pub(super) fn hurried_secs(leg_length: f64) -> f64 {
    HURRIED_SHARE * step_secs(leg_length)
}

/// Height of a step above the line from its start to its end, metres.
pub(super) fn step_lift(start: DVec3, end: DVec3, leg_length: f64) -> f64 {
    let way = (end - start).with_y(0.0).length();
    (LIFT_SHARE * way).clamp(MIN_LIFT_LEGS * leg_length, MAX_LIFT_LEGS * leg_length)
}

/// A step on stage: a [`PlannedStep`], forwards or backwards in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Footstep {
    pub from: Time,
    pub to: Time,
    step: PlannedStep,
    backwards: bool,
}

impl Footstep {
    /// Converts a planned step to stage time. `begin`: start of the plan; `backwards`: the plan runs back in time from there.
    pub(super) fn new(step: PlannedStep, begin: Time, backwards: bool) -> Footstep {
        let sign = if backwards { -1.0 } else { 1.0 };
        let [a, b] = [step.from, step.to].map(|secs| begin + Time::from_secs(sign * secs));
        Footstep { from: a.min(b), to: a.max(b), step, backwards }
    }

    /// Whether the step leads from standing to walking.
    pub(crate) fn leads_to_walk(&self) -> bool {
        self.backwards
    }

    /// Positions of the foot before and after the step, in the order of time.
    pub(super) fn start_and_end(&self) -> [DVec3; 2] {
        let PlannedStep { start, end, .. } = self.step;
        if self.backwards { [end, start] } else { [start, end] }
    }

    /// World position of the foot at a time of the step. The horizontal path has minimum jerk (T. Flash, N. Hogan, "The Coordination of Arm
    /// Movements", 1985): the quintic from the start's position and velocity to rest. The height follows 16 s² (1 − s)² over the whole
    /// step, so that the foot also rises before it moves and descends after.
    pub(super) fn at(&self, time: Time) -> DVec3 {
        let whole = (self.to - self.from).as_secs();
        let s = ((time - self.from).as_secs() / whole).clamp(0.0, 1.0);
        let s = if self.backwards { 1.0 - s } else { s };
        let PlannedStep { start, velocity, end, lift, .. } = self.step;
        // A foot that is in the air already moves on at once.
        let lifts = if velocity == DVec3::ZERO { VERTICAL_SHARES[0] } else { 0.0 };
        let over = VERTICAL_SHARES[1] - lifts;
        let t = ((s - lifts) / over).clamp(0.0, 1.0);
        let way = t * t * t * (10.0 - t * (15.0 - 6.0 * t));
        let onward = t - t * t * t * (6.0 - t * (8.0 - 3.0 * t));
        let mut at = start.lerp(end, way) + velocity * (onward * over * whole);
        at.y = at.y.max(start.y.min(end.y)) + lift * 16.0 * s * s * (1.0 - s) * (1.0 - s);
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of a character that comes from −z and stops at 0 after `fade` seconds, with feet 0.1 m to either side.
    fn plan(feet: [FootState; 2], speed: f64, fade: f64) -> Vec<Vec<PlannedStep>> {
        let body = move |t: f64| -speed * (fade - t.min(fade)).powi(2) / (2.0 * fade);
        let stance = move |leg: usize, t: f64| DVec3::new(0.1 - 0.2 * leg as f64, 0.0, body(t));
        let reaches = move |_: usize, place: DVec3, t: f64| (place.z - body(t)).abs() < 0.45;
        FootstepPlan { feet: &feet, stance: &stance, reaches: &reaches, fade_secs: fade, leg_length: 0.85 }
            .run()
            .unwrap()
    }

    fn standing(x: f64, z: f64) -> FootState {
        FootState { position: DVec3::new(x, 0.0, z), velocity: DVec3::ZERO, lands_secs: 0.0 }
    }

    #[test]
    fn feet_step_alternately_until_both_reach_their_targets() {
        for fade in [0.2, 0.5, 1.5] {
            let begin = -1.2 * fade / 2.0;
            let air = FootState { velocity: DVec3::Z * 2.0, lands_secs: 0.2, ..standing(-0.1, begin - 0.1) };
            for (feet, first) in [
                ([standing(0.1, begin + 0.3), standing(-0.1, begin - 0.35)], 1),
                ([standing(0.1, begin), air], 1),
            ] {
                let steps = plan(feet, 1.2, fade);
                let mut all: Vec<(usize, PlannedStep)> = Vec::new();
                for (leg, steps) in steps.iter().enumerate() {
                    all.extend(steps.iter().map(|step| (leg, *step)));
                    assert!(steps.last().is_none_or(|s| s.end.z.abs() < 0.004), "{fade}: {steps:?}");
                }
                all.sort_by(|a, b| a.1.from.total_cmp(&b.1.from));
                assert_eq!(all[0].0, first, "{fade}: {all:?}");
                // At any time one foot is on the ground, and the feet step alternately.
                for pair in all.windows(2) {
                    assert!(
                        pair[1].1.from >= pair[0].1.to - 1e-9 && pair[0].0 != pair[1].0,
                        "{fade}: {all:?}"
                    );
                }
                // A foot that stands in its place needs no step; in a long fade one of them steps twice.
                let out_of_place = feet.iter().filter(|foot| foot.position.z.abs() > 0.05).count();
                assert!(all.len() >= if fade > 1.0 { 3 } else { out_of_place }, "{fade}: {all:?}");
            }
        }
    }

    #[test]
    fn fast_foot_does_not_overshoot_its_target() {
        for (z, lands_secs) in [(-0.4, 0.02), (-0.3, 0.1), (-0.1, 0.2), (-0.02, 0.25), (-0.38, 0.3)] {
            let air = FootState { velocity: DVec3::Z * 5.8, lands_secs, ..standing(-0.1, z) };
            let steps = plan([standing(0.1, 0.0), air], 0.0, 0.5);
            let step = Footstep::new(steps[1][0], Time::ZERO, false);
            assert!(step.to.as_secs() <= 0.35 && step.start_and_end()[1].z.abs() < 1e-9, "{step:?}");
            let farthest = |step: &Footstep| {
                let at = |i: i32| step.at(step.to.scaled(f64::from(i) / 200.0)).z;
                (0..=200).map(at).fold(f64::NEG_INFINITY, f64::max)
            };
            assert!(farthest(&step) < 1e-6, "{z}, {lands_secs}: {}", farthest(&step));
            // A foot that keeps all of its speed overshoots.
            let whole = PlannedStep { velocity: air.velocity, to: 0.35, ..steps[1][0] };
            assert!(farthest(&Footstep::new(whole, Time::ZERO, false)) > 0.01);
        }
    }

    #[test]
    fn step_starts_at_the_foot_velocity_and_rises_before_it_moves() {
        let (start, end) = (DVec3::ZERO, DVec3::new(0.0, 0.02, 0.5));
        let step = |velocity| PlannedStep { from: 0.0, to: 0.35, start, velocity, end, lift: 0.08 };
        let begin = Time::from_secs(2.0);
        let secs = |t: f64| begin + Time::from_secs(t);
        let fast = Footstep::new(step(DVec3::new(0.3, 0.1, 2.0)), begin, false);
        let h = 1e-5;
        let velocity = (fast.at(secs(h)) - fast.at(secs(0.0))) / h;
        assert!((velocity - DVec3::new(0.3, 0.1, 2.0)).length() < 1e-2, "{velocity}");
        assert!((fast.at(fast.to) - end).length() < 1e-12);
        // A step planned backwards in time leads from its end to its start.
        let back = Footstep::new(step(DVec3::ZERO), begin, true);
        assert!(back.to == begin && back.start_and_end() == [end, start]);
        assert!((back.at(back.from) - end).length() < 1e-12 && back.at(back.to).length() < 1e-12);
        let slow = Footstep::new(step(DVec3::ZERO), begin, false);
        let low = (0..=350).map(|i| slow.at(secs(f64::from(i) * 1e-3)));
        let slid =
            low.filter(|p| p.y - 0.02 * p.z / 0.5 < 0.01).map(|p| p.z.min(0.5 - p.z)).fold(0.0, f64::max);
        assert!(slid < 0.005, "{slid}");
    }
}
