//! Timings that other work on the machine disturbs little: CPU time, methods measured in turn, medians.

use std::time::Instant;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// CPU time of this thread.
    Thread,
    /// CPU time of all threads of the process: for work on several threads.
    Process,
    /// Wall-clock time: for work on a device of its own.
    Wall,
}

impl Clock {
    pub fn words(self) -> &'static str {
        match self {
            Clock::Thread => "CPU time of one thread",
            Clock::Process => "CPU time of all threads",
            Clock::Wall => "wall-clock time",
        }
    }

    /// Nanoseconds since an arbitrary start.
    pub fn now(self) -> f64 {
        #[cfg(unix)]
        {
            use rustix::time::{ClockId, clock_gettime};
            let of = |id| {
                let t = clock_gettime(id);
                t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
            };
            match self {
                Clock::Thread => return of(ClockId::ThreadCPUTime),
                Clock::Process => return of(ClockId::ProcessCPUTime),
                Clock::Wall => {}
            }
        }
        use std::sync::OnceLock;
        static START: OnceLock<Instant> = OnceLock::new();
        START.get_or_init(Instant::now).elapsed().as_nanos() as f64
    }
}

/// Nanoseconds per item over all rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nanos {
    pub median: f64,
    /// First and third quartile of the rounds.
    pub quartiles: [f64; 2],
}

impl Nanos {
    /// Median and quartiles of the rounds.
    pub fn of(mut rounds: Vec<f64>) -> Nanos {
        rounds.sort_by(f64::total_cmp);
        let at = |share: usize| rounds.get(rounds.len() * share / 4).copied().unwrap_or(f64::NAN);
        Nanos { median: at(2), quartiles: [at(1), at(3)] }
    }

    /// Whether this time is shorter than another, and not by chance: by more than 5 %, and with the third quartile below the first quartile
    /// of the other.
    pub(crate) fn is_less(&self, other: &Nanos) -> bool {
        self.median * 1.05 < other.median && self.quartiles[1] < other.quartiles[0]
    }
}

impl Nanos {
    /// Whether one of two takes less time, and not by chance.
    pub fn differs(&self, other: &Nanos) -> bool {
        self.is_less(other) || other.is_less(self)
    }
}

/// A known time, without spread.
impl From<f64> for Nanos {
    fn from(nanos: f64) -> Nanos {
        Nanos { median: nanos, quartiles: [nanos; 2] }
    }
}

/// A method to be timed: the number of items of one run, and the run.
pub struct Case<'a> {
    pub items: usize,
    pub run: Box<dyn FnMut() + 'a>,
}

impl<'a> Case<'a> {
    pub fn new(items: usize, run: impl FnMut() + 'a) -> Case<'a> {
        Case { items: items.max(1), run: Box::new(run) }
    }
}

/// Nanoseconds per item of each case. Each round runs all cases one after the other, so that other work of the machine affects all of them
/// alike. `budget_secs` is for all rounds together. At least three rounds, at most 400.
pub fn interleaved(clock: Clock, budget_secs: f64, cases: &mut [Case]) -> Vec<Nanos> {
    /// Shorter runs are repeated until they take this many nanoseconds, so that the clock's resolution does not matter.
    const MIN_RUN_NANOS: f64 = 100_000.0;
    let begun = Instant::now();
    let mut repeats = Vec::with_capacity(cases.len());
    for case in cases.iter_mut() {
        (case.run)();
        let start = clock.now();
        (case.run)();
        let once = (clock.now() - start).max(20.0);
        repeats.push((MIN_RUN_NANOS / once).ceil().clamp(1.0, 1e5) as usize);
    }
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); cases.len()];
    for round in 0..400 {
        if round >= 3 && begun.elapsed().as_secs_f64() > budget_secs {
            break;
        }
        for ((case, repeat), times) in cases.iter_mut().zip(&repeats).zip(&mut times) {
            let start = clock.now();
            (0..*repeat).for_each(|_| (case.run)());
            times.push((clock.now() - start) / (*repeat * case.items) as f64);
        }
    }
    times.into_iter().map(Nanos::of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_within_the_quartiles_count_as_chance() {
        assert_eq!(Nanos::of(vec![3.0, 1.0, 100.0, 2.0]), Nanos { median: 3.0, quartiles: [2.0, 100.0] });
        assert!(Nanos::of(Vec::new()).median.is_nan());
        let [fast, slow] = [[9.0, 10.0, 11.0], [12.0, 13.0, 14.0]].map(|of| Nanos::of(of.to_vec()));
        assert!(fast.is_less(&slow) && !slow.is_less(&fast));
        let noisy = Nanos::of(vec![8.0, 9.0, 13.0, 14.0]);
        assert!(!fast.is_less(&noisy));
    }

    #[test]
    fn every_case_is_timed() {
        let (mut a, mut b) = (0, 0);
        let mut cases = [Case::new(1, || a += 1), Case::new(10, || b += 1)];
        let times = interleaved(Clock::Thread, 0.01, &mut cases);
        assert!(times.iter().all(|t| t.median >= 0.0) && times.len() == 2);
        drop(cases);
        assert!(a >= 5 && b >= 5);
    }
}
