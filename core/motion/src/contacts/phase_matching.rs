//! Phase-matched crossfades: while one gait fades into another, both take the same step at the same time.
//!
//! A clip's phase counts its steps: it is a whole number where a foot comes down or is in the middle of a contact, and goes
//! evenly between (a registration curve: L. Kovar, M. Gleicher, "Flexible Automatic Motion Blending with Registration
//! Curves", SCA 2003, §3.1, with the steps as its points). During the fade the common phase goes at the mean of the two
//! clips' own rates by their weights, φ' = (1 − w) a(φ) + w b(φ): it begins as the first clip alone would go on and ends as
//! the second alone. Between two steps a and b are constants, so φ has a closed form with the integral of the ease; the
//! times of the steps are found once, by bisection.
//!
//! Two feet always alternate. Four come down in other orders in a walk, a trot and a gallop; then whole strides are matched, at
//! the phase shift at which as many feet as possible are on the floor at the same time.

use crate::contacts::Contacts;
use crate::time::Time;
use crate::time::ease::Ease;

/// The steps of a looped part of a clip, in the order of time, at least two.
#[derive(Clone, Debug, PartialEq)]
pub struct Footsteps {
    /// (ticks since the part's start, event). The event is 2 · foot index at a touch-down, and 2 · foot index + 1 in the middle of a
    /// contact.
    events: Vec<(i64, u32)>,
    /// Duration of the part, ticks.
    length: i64,
    /// Contacts by foot: (touch-down, duration), ticks since the part's start.
    stands: Vec<Vec<(i64, i64)>>,
}

/// Number of phase shifts that are tried when strides are matched, and of samples that compare them.
const PHASE_SHIFTS: i64 = 96;

impl Footsteps {
    /// Footsteps of a clip's contacts; `None` if there are fewer than two.
    pub fn of(contacts: &Contacts, trim: (Time, Time)) -> Option<Footsteps> {
        let length = (trim.1 - trim.0).0;
        let mut events = Vec::new();
        let mut contacts_by_foot = Vec::new();
        for (foot, stands) in (0u32..).zip(&contacts.intervals) {
            contacts_by_foot.push(Vec::new());
            for stand in stands {
                let (from, to) = ((stand.from - trim.0).0, (stand.to - trim.0).0);
                // A foot that is on the floor all the time takes no steps.
                if to - from >= length {
                    continue;
                }
                contacts_by_foot.last_mut()?.push((from.rem_euclid(length.max(1)), to - from));
                events.push((from.rem_euclid(length.max(1)), 2 * foot));
                events.push((((from + to) / 2).rem_euclid(length.max(1)), 2 * foot + 1));
            }
        }
        let steps = Footsteps::new(events, length)?;
        Some(Footsteps { stands: contacts_by_foot, ..steps })
    }

    /// Footsteps at touch-down times that a script gives: one foot after the other.
    pub fn given(times: &[Time], trim: (Time, Time)) -> Option<Footsteps> {
        let length = (trim.1 - trim.0).0;
        let within = times.iter().filter(|t| **t >= trim.0 && **t < trim.1);
        Footsteps::new(
            within.zip((0u32..2).cycle()).map(|(t, foot)| ((*t - trim.0).0, 2 * foot)).collect(),
            length,
        )
    }

    fn new(mut events: Vec<(i64, u32)>, length: i64) -> Option<Footsteps> {
        events.sort_unstable();
        events.dedup_by_key(|(at, _)| *at);
        (events.len() >= 2 && length > 0).then_some(Footsteps { events, length, stands: Vec::new() })
    }

    /// The footsteps with touch-downs only.
    fn touch_downs_only(&self) -> Option<Footsteps> {
        let downs = self.events.iter().filter(|(_, what)| what % 2 == 0).copied().collect();
        Footsteps::new(downs, self.length)
    }

    fn event_count(&self) -> i64 {
        self.events.len() as i64
    }

    /// Number of strides: the median number of contacts per foot.
    fn stride_count(&self) -> i64 {
        let mut times: Vec<usize> = self.stands.iter().map(Vec::len).filter(|n| *n > 0).collect();
        times.sort_unstable();
        times.get(times.len() / 2).map_or(1, |n| *n as i64)
    }

    /// Footsteps with one event per stride, at equal intervals, the first at `from` ticks.
    fn even_strides(&self, from: i64) -> Footsteps {
        let n = self.stride_count();
        let mut events: Vec<(i64, u32)> =
            (0..n).map(|i| ((from + self.length / n * i).rem_euclid(self.length), 0)).collect();
        events.sort_unstable();
        Footsteps { events, length: self.length, stands: Vec::new() }
    }

    /// Whether a foot is on the floor at a time, ticks since the part's start.
    fn foot_is_down(&self, foot: usize, at: i64) -> bool {
        self.stands[foot].iter().any(|(from, long)| (at - from).rem_euclid(self.length) <= *long)
    }

    /// Footsteps of both clips with one event per stride, shifted so that their feet are on the floor together as much as
    /// possible. `None` for fewer than three feet, or different numbers of feet.
    fn aligned_by_strides(&self, other: &Footsteps) -> Option<[Footsteps; 2]> {
        let feet = self.stands.len();
        if feet < 3 || other.stands.len() != feet {
            return None;
        }
        let stride = |of: &Footsteps| of.length / of.stride_count();
        let at = |of: &Footsteps, i: i64| stride(of) * i.rem_euclid(PHASE_SHIFTS) / PHASE_SHIFTS;
        let feet_in_agreement = |shift: &i64| {
            let agreeing_feet = |i: i64| {
                (0..feet)
                    .filter(|f| {
                        self.foot_is_down(*f, at(self, i)) == other.foot_is_down(*f, at(other, i + shift))
                    })
                    .count()
            };
            (0..PHASE_SHIFTS).map(agreeing_feet).sum::<usize>()
        };
        // The first of equal ones wins: `max_by_key` returns the last, so the range is reversed.
        let best = (0..PHASE_SHIFTS).rev().max_by_key(feet_in_agreement)?;
        Some([self.even_strides(0), other.even_strides(at(other, best))])
    }

    /// Ticks that have been played at step number `i`, whole cycles counted.
    fn ticks_at_step(&self, i: i64) -> i128 {
        let n = self.event_count();
        i128::from(i.div_euclid(n)) * i128::from(self.length)
            + i128::from(self.events[i.rem_euclid(n) as usize].0)
    }

    /// Ticks from step `i` to the next.
    fn step_ticks(&self, i: i64) -> f64 {
        (self.ticks_at_step(i + 1) - self.ticks_at_step(i)) as f64
    }

    /// Phase: the number of steps taken after a number of played ticks.
    pub fn phase(&self, played: i128) -> f64 {
        let round = played.div_euclid(i128::from(self.length));
        let into = played.rem_euclid(i128::from(self.length)) as i64;
        let after = self.events.partition_point(|(at, _)| *at <= into) as i64;
        let round = round.clamp(-(1 << 50), 1 << 50) as i64;
        let step = round * self.event_count() + after - 1;
        step as f64 + (played - self.ticks_at_step(step)) as f64 / self.step_ticks(step)
    }

    /// Played ticks after which a number of steps has been taken.
    pub fn played(&self, phase: f64) -> i128 {
        let step = libm::floor(phase);
        let rest = phase - step;
        let step = step.clamp(-1e15, 1e15) as i64;
        self.ticks_at_step(step) + libm::round(rest * self.step_ticks(step)) as i128
    }

    /// Smallest number of steps by which `other` is shifted so that the same feet step at the same time.
    fn matching_shift(&self, other: &Footsteps) -> Option<i64> {
        let (n, m) = (self.events.len(), other.events.len());
        let event_of = |steps: &Footsteps, i: usize| steps.events[i % steps.events.len()].1;
        (0..m)
            .find(|shift| (0..n * m).all(|i| event_of(self, i) == event_of(other, i + shift)))
            .map(|s| s as i64)
    }
}

/// A crossfade in which two clips stay in phase.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseMatchedFade {
    start: Time,
    fade: Time,
    ease: Ease,
    from: Footsteps,
    to: Footsteps,
    /// Clip ticks per stage tick, above 0.
    speeds: [f64; 2],
    shift: i64,
    /// (stage time, common phase) at the start and at every step.
    pieces: Vec<(Time, f64)>,
}

/// Largest number of steps in a fade.
const MAX_STEPS: usize = 100_000;

impl PhaseMatchedFade {
    /// Matches the steps of two clips. `speeds`: clip ticks per stage tick. `played`: ticks of the first clip that have been
    /// played at the start of the fade. `None` if the clips do not take the same steps.
    pub fn new(
        steps: [&Footsteps; 2],
        speeds: [f64; 2],
        played: i128,
        start: Time,
        fade: Time,
        ease: Ease,
    ) -> Option<PhaseMatchedFade> {
        let matched_steps =
            |from: Footsteps, to: Footsteps| from.matching_shift(&to).map(|shift| (from, to, shift));
        let full = matched_steps(steps[0].clone(), steps[1].clone());
        let (from, to, shift) = match full {
            Some(full) => full,
            None => match matched_steps(steps[0].touch_downs_only()?, steps[1].touch_downs_only()?) {
                Some(downs) => downs,
                None => {
                    steps[0].aligned_by_strides(steps[1]).and_then(|[from, to]| matched_steps(from, to))?
                }
            },
        };
        if speeds.iter().any(|s| *s <= 0.0 || !s.is_finite()) || fade <= Time::ZERO {
            return None;
        }
        let phase = from.phase(played);
        let mut matched =
            PhaseMatchedFade { start, fade, ease, from, to, speeds, shift, pieces: vec![(start, phase)] };
        let end = start + fade;
        while matched.pieces.len() < MAX_STEPS {
            let (at, phase) = matched.pieces[matched.pieces.len() - 1];
            let next = libm::floor(phase) + 1.0;
            if matched.phase(end) < next {
                return Some(matched);
            }
            let (mut low, mut high) = (at, end);
            while (high - low).0 > 1 {
                let middle = low.middle(high);
                if matched.phase(middle) < next { low = middle } else { high = middle }
            }
            if high <= at {
                return None;
            }
            matched.pieces.push((high, next));
        }
        None
    }

    /// Stage time at which the fade begins.
    pub fn start(&self) -> Time {
        self.start
    }

    /// Stage time at which the fade ends.
    pub fn end(&self) -> Time {
        self.start + self.fade
    }

    /// Integral of the fade's weight up to a time, ticks.
    fn weight_integral(&self, time: Time) -> f64 {
        let fade = self.fade.0 as f64;
        self.ease.area((time - self.start).0 as f64 / fade) * fade
    }

    /// The common phase at a time from the start on, in steps of the first clip.
    pub fn phase(&self, time: Time) -> f64 {
        let time = time.max(self.start);
        let piece = self.pieces.partition_point(|(at, _)| *at <= time).max(1) - 1;
        let (at, phase) = self.pieces[piece];
        let step = libm::floor(phase) as i64;
        let rates = [
            self.speeds[0] / self.from.step_ticks(step),
            self.speeds[1] / self.to.step_ticks(step + self.shift),
        ];
        phase
            + rates[0] * (time - at).0 as f64
            + (rates[1] - rates[0]) * (self.weight_integral(time) - self.weight_integral(at))
    }

    /// Ticks of the first and of the second clip that have been played at a time from the start on.
    pub fn played(&self, time: Time) -> [i128; 2] {
        let phase = self.phase(time);
        [self.from.played(phase), self.to.played(phase + self.shift as f64)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(s: f64) -> i64 {
        Time::from_secs(s).0
    }

    /// A walk of 1 s whose feet come down at 0.1 and 0.6, a run of 0.6 s with 0.2 and 0.5.
    fn walk_and_run() -> [Footsteps; 2] {
        let steps = |length: f64, downs: [f64; 2]| {
            let events = downs.iter().zip([0, 2]).map(|(t, what)| (secs(*t), what)).collect();
            Footsteps::new(events, secs(length)).unwrap()
        };
        [steps(1.0, [0.1, 0.6]), steps(0.6, [0.2, 0.5])]
    }

    #[test]
    fn phase_and_played_ticks_are_inverse_functions() {
        let [walk, _] = walk_and_run();
        assert_eq!(walk.phase(i128::from(secs(0.1))), 0.0);
        assert_eq!(walk.phase(i128::from(secs(3.6))), 7.0);
        assert!((walk.phase(i128::from(secs(0.35))) - 0.5).abs() < 1e-12);
        assert!((walk.phase(0) + 0.2).abs() < 1e-12);
        for played in [0.0, 0.05, 0.3, 17.77, -4.2].map(secs) {
            assert_eq!(walk.played(walk.phase(i128::from(played))), i128::from(played));
        }
    }

    #[test]
    fn clips_stay_in_phase_and_keep_their_own_rates_at_both_ends_of_the_fade() {
        let [walk, run] = walk_and_run();
        let (start, fade) = (Time::from_secs(2.3), Time::from_secs(0.8));
        for ease in [Ease::Linear, Ease::Smooth] {
            let played = i128::from(start.0);
            let matched =
                PhaseMatchedFade::new([&walk, &run], [1.0, 1.0], played, start, fade, ease).unwrap();
            assert_eq!(matched.played(start)[0], played);
            let mut before = matched.phase(start);
            // Against Euler steps of a hundred-thousandth of the fade.
            let (mut euler, n) = (before, 100_000);
            for i in 0..n {
                let share = f64::from(i) / f64::from(n);
                let w = ease.at(share);
                let step = libm::floor(euler) as i64;
                let rates = [1.0 / walk.step_ticks(step), 1.0 / run.step_ticks(step)];
                euler += (rates[0] * (1.0 - w) + rates[1] * w) * fade.0 as f64 / f64::from(n);
                if i % 1000 == 999 {
                    let time = start + Time((fade.0 as f64 * (share + 1.0 / f64::from(n))) as i64);
                    let now = matched.phase(time);
                    assert!((now - euler).abs() < 1e-4 && now > before, "{i}: {now} {euler}");
                    let [a, b] = matched.played(time);
                    assert!((walk.phase(a) - now).abs() < 1e-6 && (run.phase(b) - now).abs() < 1e-6);
                    before = now;
                }
            }
            let h = Time::from_secs(1e-4);
            let [a, _] = matched.played(start + h);
            assert!(((a - played) as f64 / h.0 as f64 - 1.0).abs() < 2e-3);
            let [_, b] = matched.played(matched.end());
            let [_, c] = matched.played(matched.end() - h);
            assert!(((b - c) as f64 / h.0 as f64 - 1.0).abs() < 2e-3);
        }
    }

    #[test]
    fn walk_and_gallop_of_a_quadruped_are_matched_by_strides() {
        let gait = |length: f64, stands: [(f64, f64); 4]| {
            let stand = |(from, to): (f64, f64)| {
                vec![crate::contacts::ContactInterval {
                    from: Time::from_secs(from),
                    to: Time::from_secs(to),
                }]
            };
            let contacts =
                Contacts { intervals: stands.map(stand).to_vec(), floor_velocity: glam::DVec3::ZERO };
            Footsteps::of(&contacts, (Time::ZERO, Time::from_secs(length))).unwrap()
        };
        // Left hind, right hind, left fore, right fore.
        let walk = gait(1.0, [(0.0, 0.6), (0.5, 1.1), (0.25, 0.85), (0.75, 1.35)]);
        let gallop = gait(0.4, [(0.1, 0.18), (0.14, 0.22), (0.3, 0.38), (0.26, 0.34)]);
        let fade = Time::from_secs(0.6);
        let matched =
            PhaseMatchedFade::new([&walk, &gallop], [1.0; 2], 0, Time::ZERO, fade, Ease::Linear).unwrap();
        // The rate changes steadily: in strides per second, it is between those of the walk and the gallop.
        let rate = |t: f64| {
            let h = Time::from_secs(1e-3);
            (matched.phase(Time::from_secs(t) + h) - matched.phase(Time::from_secs(t))) / 1e-3
        };
        for t in [0.05, 0.2, 0.4, 0.55] {
            assert!((0.99..2.51).contains(&rate(t)), "{t}: {}", rate(t));
        }
        let other = gait(1.0, [(0.0, 0.6), (0.5, 1.1), (0.25, 0.85), (0.75, 1.35)]);
        assert_eq!(walk.aligned_by_strides(&other).unwrap().map(|s| s.events), [[(0, 0)], [(0, 0)]]);
    }

    #[test]
    fn clips_with_different_steps_are_not_matched() {
        let [walk, run] = walk_and_run();
        let hop = Footsteps::new(vec![(0, 0), (secs(0.4), 0)], secs(0.8)).unwrap();
        assert!(
            PhaseMatchedFade::new([&walk, &hop], [1.0; 2], 0, Time::ZERO, Time(1000), Ease::Linear).is_none()
        );
        assert!(
            PhaseMatchedFade::new([&walk, &run], [1.0, 0.0], 0, Time::ZERO, Time(1000), Ease::Linear)
                .is_none()
        );
        // A clip of two walk cycles matches a clip of one: its steps repeat.
        let twice = Footsteps::new(
            [0.1, 0.6, 1.1, 1.6].iter().zip([0, 2, 0, 2]).map(|(t, w)| (secs(*t), w)).collect(),
            secs(2.0),
        )
        .unwrap();
        assert!(
            PhaseMatchedFade::new([&run, &twice], [1.0; 2], 0, Time::ZERO, Time(secs(1.0)), Ease::Linear)
                .is_some()
        );
    }
}
