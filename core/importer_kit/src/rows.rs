//! Numbers that change over time as keys with straight lines between: at the keys of what drives them and, between those, where straight
//! lines are not near enough.

use choreo_motion::Time;

/// How near straight lines come.
#[derive(Clone, Copy, Debug)]
pub struct Nearness {
    /// Share of its largest value that a number may be off.
    pub tolerance: f32,
    /// Halvings of an interval between two keys.
    pub depth: u32,
    /// Rows at most.
    pub rows: usize,
}

/// A time, and the numbers then.
pub type Row = (Time, Vec<f32>);

/// Rows at these rising times and between them; `None` where they are more than allowed.
pub fn rows(times: &[Time], nearness: Nearness, mut at: impl FnMut(Time) -> Vec<f32>) -> Option<Vec<Row>> {
    let at_keys: Vec<Row> = times.iter().map(|time| (*time, at(*time))).collect();
    let mut allowed: Vec<f32> = Vec::new();
    for (_, row) in &at_keys {
        allowed.resize(row.len(), 1e-6 * nearness.tolerance);
        let own = row.iter().map(|v| v.abs() * nearness.tolerance);
        allowed.iter_mut().zip(own).for_each(|(most, v)| *most = most.max(v));
    }
    let mut out: Vec<Row> = Vec::with_capacity(at_keys.len());
    for row in at_keys {
        if let Some(before) = out.last().cloned() {
            refine((&before, &row), (nearness, &allowed), &mut at, &mut out);
        }
        out.push(row);
        if out.len() > nearness.rows {
            return None;
        }
    }
    Some(out)
}

/// Adds rows between two until straight lines are near enough.
fn refine(
    (a, b): (&Row, &Row),
    (nearness, allowed): (Nearness, &[f32]),
    at: &mut impl FnMut(Time) -> Vec<f32>,
    out: &mut Vec<Row>,
) {
    let span = b.0.0 - a.0.0;
    if nearness.depth == 0 || span < Time::TICKS_PER_SECOND / 2000 || out.len() > nearness.rows {
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
    // A curve like an S may leave the line beside a middle that is near enough.
    let middle = row(2);
    if off(&middle) || off(&row(1)) || off(&row(3)) {
        let half = (Nearness { depth: nearness.depth - 1, ..nearness }, allowed);
        refine((a, &middle), half, at, out);
        out.push(middle.clone());
        refine((&middle, b), half, at, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_between_rows_are_near_the_curve() {
        let nearness = Nearness { tolerance: 1e-4, depth: 9, rows: 1000 };
        let curve = |time: Time| vec![libm::sin(3.0 * time.as_secs()) as f32, 2.0];
        let times = [0.0, 0.5, 2.0].map(Time::from_secs);
        let rows = rows(&times, nearness, curve).unwrap_or_default();
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
    fn straight_lines_need_nothing_between_and_too_many_rows_are_refused() {
        let times = [0.0, 1.0].map(Time::from_secs);
        let nearness = Nearness { tolerance: 1e-4, depth: 9, rows: 8 };
        let straight = rows(&times, nearness, |time| vec![time.as_secs() as f32]);
        assert_eq!(straight.map(|rows| rows.len()), Some(2));
        assert_eq!(rows(&times, nearness, |time| vec![libm::sin(40.0 * time.as_secs()) as f32]), None);
    }
}
