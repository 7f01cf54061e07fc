//! Samples numbers that change over time as keys with linear interpolation: at the keys of the curves that drive them and, between those,
//! where linear interpolation is not accurate enough.

use choreo_motion::Time;

/// Accuracy and limits of the sampling.
#[derive(Clone, Copy, Debug)]
pub struct SamplingLimits {
    /// Largest error of a number, as a share of its largest value.
    pub tolerance: f32,
    /// Largest number of times that an interval between two keys is halved.
    pub depth: u32,
    /// Largest number of rows.
    pub rows: usize,
}

/// A time, and the numbers at that time.
pub type Row = (Time, Vec<f32>);

/// Samples `at` at these ascending times and, where needed, between them. `None` if this takes more rows than allowed.
pub fn sample_rows(
    times: &[Time],
    limits: SamplingLimits,
    mut at: impl FnMut(Time) -> Vec<f32>,
) -> Option<Vec<Row>> {
    let at_keys: Vec<Row> = times.iter().map(|time| (*time, at(*time))).collect();
    let mut allowed: Vec<f32> = Vec::new();
    for (_, row) in &at_keys {
        allowed.resize(row.len(), 1e-6 * limits.tolerance);
        let own = row.iter().map(|v| v.abs() * limits.tolerance);
        allowed.iter_mut().zip(own).for_each(|(most, v)| *most = most.max(v));
    }
    let mut out: Vec<Row> = Vec::with_capacity(at_keys.len());
    for row in at_keys {
        if let Some(before) = out.last().cloned() {
            refine((&before, &row), (limits, &allowed), &mut at, &mut out);
        }
        out.push(row);
        if out.len() > limits.rows {
            return None;
        }
    }
    Some(out)
}

/// Adds rows between two rows until linear interpolation is accurate enough.
fn refine(
    (a, b): (&Row, &Row),
    (limits, allowed): (SamplingLimits, &[f32]),
    at: &mut impl FnMut(Time) -> Vec<f32>,
    out: &mut Vec<Row>,
) {
    let span = b.0.0 - a.0.0;
    if limits.depth == 0 || span < Time::TICKS_PER_SECOND / 2000 || out.len() > limits.rows {
        return;
    }
    let mut row = |quarter: i64| -> Row {
        let time = Time(a.0.0 + span / 4 * quarter);
        (time, at(time))
    };
    let off = |(time, truth): &Row| {
        let part = (time.0 - a.0.0) as f32 / span as f32;
        let way = a.1.iter().zip(&b.1).map(|(a, b)| a + (b - a) * part);
        way.zip(truth).zip(allowed).any(|((way, truth), allowed)| (way - truth).abs() > *allowed)
    };
    // An S-shaped curve may leave the line although its middle is near the line.
    let middle = row(2);
    if off(&middle) || off(&row(1)) || off(&row(3)) {
        let half = (SamplingLimits { depth: limits.depth - 1, ..limits }, allowed);
        refine((a, &middle), half, at, out);
        out.push(middle.clone());
        refine((&middle, b), half, at, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolated_rows_are_within_the_tolerance() {
        let limits = SamplingLimits { tolerance: 1e-4, depth: 9, rows: 1000 };
        let curve = |time: Time| vec![libm::sin(3.0 * time.as_secs()) as f32, 2.0];
        let times = [0.0, 0.5, 2.0].map(Time::from_secs);
        let rows = sample_rows(&times, limits, curve).unwrap_or_default();
        assert!((20..400).contains(&rows.len()), "{}", rows.len());
        assert!(times.iter().all(|time| rows.iter().any(|row| row.0 == *time)));
        for pair in rows.windows(2) {
            for part in [0.2f32, 0.5, 0.7] {
                let time = Time(pair[0].0.0 + ((pair[1].0 - pair[0].0).0 as f32 * part) as i64);
                let way = pair[0].1[0] + (pair[1].1[0] - pair[0].1[0]) * part;
                assert!((way - curve(time)[0]).abs() < 2.5e-4, "{} s", time.as_secs());
            }
        }
    }

    #[test]
    fn linear_curves_need_no_added_rows_and_too_many_rows_are_refused() {
        let times = [0.0, 1.0].map(Time::from_secs);
        let limits = SamplingLimits { tolerance: 1e-4, depth: 9, rows: 8 };
        let straight = sample_rows(&times, limits, |time| vec![time.as_secs() as f32]);
        assert_eq!(straight.map(|rows| rows.len()), Some(2));
        assert_eq!(sample_rows(&times, limits, |time| vec![libm::sin(40.0 * time.as_secs()) as f32]), None);
    }
}
