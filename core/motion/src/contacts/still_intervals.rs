//! Intervals in which a signal stays below a threshold with hysteresis. Short intervals and gaps are left out; intervals of a
//! loop may cross its seam.

/// Hysteresis: an interval that has begun ends only above the threshold times this.
pub(crate) const HYSTERESIS_FACTOR: f64 = 1.5;
/// Intervals and gaps shorter than these are noise, seconds.
const MIN_INTERVAL_SECS: f64 = 0.05;
const MIN_GAP_SECS: f64 = 0.05;

/// First and last sample of every interval, in the order of time. `unrest`: samples `step` seconds apart; an interval begins at a
/// value of at most 1. The last sample of a `looped` signal is the first one again; an interval across the seam then ends at an
/// index beyond the last.
pub fn still_intervals(unrest: &[f64], step: f64, looped: bool) -> Vec<(usize, usize)> {
    let Some(count) = unrest.len().checked_sub(1) else { return Vec::new() };
    let mut is_still = false;
    let mut next_is_still = |value: &f64| {
        is_still = *value <= if is_still { HYSTERESIS_FACTOR } else { 1.0 };
        is_still
    };
    // A first pass over a loop gives the state in which it begins.
    if looped {
        unrest.iter().for_each(|u| _ = next_is_still(u));
    }
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (i, u) in unrest.iter().enumerate() {
        match runs.last_mut() {
            _ if !next_is_still(u) => {}
            Some((_, to)) if *to + 1 == i => *to = i,
            _ => runs.push((i, i)),
        }
    }
    let first = runs.first().copied();
    if looped
        && runs.len() > 1
        && let (Some((0, to)), Some(last)) = (first, runs.last_mut())
        && last.1 == count
    {
        last.1 = count + to;
        runs.remove(0);
    }
    // Durations in steps, with a margin for rounding.
    let steps = |secs: f64| secs / step - 1e-6;
    runs.dedup_by(|next, before| {
        let close = ((next.0 - before.1) as f64) < steps(MIN_GAP_SECS);
        if close {
            before.1 = next.1;
        }
        close
    });
    let cut_off = |from: usize, to: usize| !looped && (from == 0 || to == count);
    runs.retain(|(from, to)| (*to - *from) as f64 >= steps(MIN_INTERVAL_SECS) || cut_off(*from, *to));
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_begins_at_the_threshold_and_ends_above_one_and_a_half_times_it() {
        let row = [2.0, 1.2, 0.9, 1.4, 1.4, 1.2, 1.6, 1.2, 1.2, 1.2, 1.2, 1.2];
        assert_eq!(still_intervals(&row, 0.02, false), [(2, 5)]);
        assert!(
            still_intervals(&row, 0.05, false).len() == 1 && still_intervals(&row, 0.001, false).is_empty(),
            "too short"
        );
        assert!(still_intervals(&[], 0.02, false).is_empty());
        assert_eq!(still_intervals(&[0.0], 0.02, false), [(0, 0)]);
    }

    #[test]
    fn an_interval_continues_across_the_seam_of_a_loop() {
        let mut row = [3.0; 21];
        (0..4).chain(16..21).for_each(|i| row[i] = 0.5);
        assert_eq!(still_intervals(&row, 0.02, true), [(16, 23)]);
        assert_eq!(still_intervals(&row, 0.02, false), [(0, 3), (16, 20)]);
        // An interval that only continues at the beginning of the loop starts at its end.
        (0..4).for_each(|i| row[i] = 1.4);
        assert_eq!(still_intervals(&row, 0.02, true), [(16, 23)]);
        assert_eq!(still_intervals(&row, 0.02, false), [(16, 20)]);
    }

    #[test]
    fn short_gaps_do_not_split_an_interval() {
        let mut row = [0.5; 30];
        row[10] = 9.0;
        assert_eq!(still_intervals(&row, 0.02, false), [(0, 29)]);
        (10..16).for_each(|i| row[i] = 9.0);
        assert_eq!(still_intervals(&row, 0.02, false), [(0, 9), (16, 29)]);
    }
}
