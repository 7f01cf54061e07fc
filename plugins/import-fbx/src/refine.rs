//! Adds keys where linear interpolation misses the file's curve: halves each interval until the line is close enough.

use crate::file::Accuracy;
use choreo_motion::Time;

/// Halvings of one interval, at most.
const MAX_DEPTH: u32 = 7;
/// Shortest interval after a halving, ticks: closer keys are a step, or close enough for any purpose.
const MIN_TICKS: i64 = Time::TICKS_PER_SECOND / 4000;
/// Positions in an interval at which the line is compared. They are off the middle, where an S-shaped curve crosses its line, and
/// two, because some curves cross it at one.
const PROBES: [f64; 2] = [0.375, 0.7];

/// The kind of a part of a row, which determines how its error is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Translation,
    Rotation,
    Scale,
    Weight,
}

impl Quantity {
    pub(crate) fn width(self) -> usize {
        match self {
            Quantity::Translation | Quantity::Scale => 3,
            Quantity::Rotation => 4,
            Quantity::Weight => 1,
        }
    }

    /// Whether the line from `a` to `b` is further from `truth` at `probe` than allowed.
    fn misses(self, (a, b): (&[f64], &[f64]), truth: &[f64], probe: f64, accuracy: Accuracy) -> bool {
        let limit = match self {
            Quantity::Translation => accuracy.metres,
            Quantity::Scale => accuracy.scale,
            Quantity::Weight => accuracy.weight,
            // The chord between two quaternions is half the angle of rotation.
            Quantity::Rotation => accuracy.radians / 2.0,
        };
        let line = |i: usize, b: f64| a[i] + (b - a[i]) * probe;
        if self != Quantity::Rotation {
            let square: f64 = (0..a.len()).map(|i| line(i, b[i]) - truth[i]).map(|d| d * d).sum();
            return square > limit * limit;
        }
        let dot = |p: &[f64], q: &[f64]| -> f64 { p.iter().zip(q).map(|(p, q)| p * q).sum() };
        let cosine = dot(a, b);
        let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
        let angle = libm::acos(cosine.abs().min(1.0));
        // Weights of slerp; for small angles, linear ones.
        let (wa, wb) = match angle > 1e-3 {
            true => (libm::sin((1.0 - probe) * angle), libm::sin(probe * angle)),
            false => (1.0 - probe, probe),
        };
        let mixed: [f64; 4] = std::array::from_fn(|i| wa * a[i] + wb * sign * b[i]);
        let scale = dot(&mixed, &mixed).sqrt() * dot(truth, truth).sqrt();
        let cosine = if scale > 0.0 { dot(&mixed, truth).abs() / scale } else { 1.0 };
        2.0 - 2.0 * cosine.min(1.0) > limit * limit
    }
}

/// Rows of numbers at shared times; `parts` describes the layout of a row.
pub(crate) struct Rows<'a> {
    pub parts: &'a [Quantity],
    pub times: Vec<Time>,
    pub values: Vec<f64>,
}

/// Adds rows until lines between them are close enough. `evaluate` appends the row of a time. `has_room` is called before each
/// addition; `false` stops adding.
pub(crate) fn refine(
    rows: Rows<'_>,
    accuracy: Accuracy,
    mut evaluate: impl FnMut(Time, &mut Vec<f64>),
    mut has_room: impl FnMut() -> bool,
) -> Rows<'_> {
    let width: usize = rows.parts.iter().map(|p| p.width()).sum();
    let mut out = Rows { parts: rows.parts, times: Vec::new(), values: Vec::new() };
    let mut truth = Vec::with_capacity(width);
    for (i, pair) in rows.times.windows(2).enumerate() {
        let row = |i: usize| rows.values[i * width..(i + 1) * width].to_vec();
        out.times.push(pair[0]);
        out.values.extend_from_slice(&rows.values[i * width..(i + 1) * width]);
        // Keys to the right of the current one, the nearest last.
        let mut ahead = vec![(pair[1], row(i + 1), 0u32)];
        let (mut from, mut a) = (pair[0], row(i));
        while let Some((to, b, depth)) = ahead.pop() {
            let ticks = to.0 - from.0;
            let may_halve = depth < MAX_DEPTH && ticks >= 2 * MIN_TICKS;
            let misses_curve = may_halve
                && PROBES.iter().any(|probe| {
                    truth.clear();
                    evaluate(Time(from.0 + (ticks as f64 * probe) as i64), &mut truth);
                    misses(rows.parts, (&a, &b), &truth, *probe, accuracy)
                });
            if misses_curve && has_room() {
                let middle = Time(from.0 + ticks / 2);
                let mut between = Vec::with_capacity(width);
                evaluate(middle, &mut between);
                ahead.push((to, b, depth + 1));
                ahead.push((middle, between, depth + 1));
                continue;
            }
            if !ahead.is_empty() {
                out.times.push(to);
                out.values.extend_from_slice(&b);
            }
            (from, a) = (to, b);
        }
    }
    if let Some(last) = rows.times.last() {
        out.times.push(*last);
        out.values.extend_from_slice(&rows.values[rows.values.len() - width..]);
    }
    out
}

fn misses(
    parts: &[Quantity],
    (a, b): (&[f64], &[f64]),
    truth: &[f64],
    probe: f64,
    accuracy: Accuracy,
) -> bool {
    let mut at = 0;
    parts.iter().any(|part| {
        let range = at..at + part.width();
        at = range.end;
        part.misses((&a[range.clone()], &b[range.clone()]), &truth[range], probe, accuracy)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accuracy() -> Accuracy {
        Accuracy::of_degrees(0.05, None)
    }

    /// A parabola x² from 0 to 1 s: halving stops where the line is within 0.1 mm.
    #[test]
    fn a_parabola_gets_as_many_keys_as_it_needs() {
        let parts = [Quantity::Translation];
        let curve = |t: Time, out: &mut Vec<f64>| out.extend([t.as_secs() * t.as_secs(), 0.0, 0.0]);
        let mut values = Vec::new();
        let times = vec![Time::ZERO, Time::from_secs(1.0)];
        times.iter().for_each(|t| curve(*t, &mut values));
        let rows = refine(Rows { parts: &parts, times, values }, accuracy(), curve, || true);
        // A line over an interval h misses the parabola by at most h²/4: 1/64 s is close enough, 1/32 s is not.
        assert_eq!(rows.times.len(), 65);
        assert!(rows.times.windows(2).all(|p| p[0] < p[1]));
        assert_eq!(rows.values.len(), 65 * 3);
        for (t, v) in rows.times.iter().zip(rows.values.chunks(3)) {
            assert_eq!(v[0], t.as_secs() * t.as_secs());
        }
    }

    #[test]
    fn lines_and_steps_get_no_extra_keys() {
        let parts = [Quantity::Weight];
        let times = vec![Time::ZERO, Time(1), Time::from_secs(1.0)];
        let line = |t: Time, out: &mut Vec<f64>| out.push(5.0 + t.as_secs());
        let rows = Rows { parts: &parts, times: times.clone(), values: vec![0.0, 5.0, 6.0] };
        assert_eq!(refine(rows, accuracy(), line, || true).times, times);
    }

    /// A rotation by 90° at constant speed: an arc needs no keys between, a chord would.
    #[test]
    fn large_rotations_are_subdivided_into_arcs() {
        let parts = [Quantity::Rotation];
        let curve = |t: Time, out: &mut Vec<f64>| {
            let half = t.as_secs() * std::f64::consts::FRAC_PI_4;
            out.extend([libm::sin(half), 0.0, 0.0, libm::cos(half)]);
        };
        let times = vec![Time::ZERO, Time::from_secs(1.0)];
        let mut values = Vec::new();
        times.iter().for_each(|t| curve(*t, &mut values));
        let rows = Rows { parts: &parts, times, values };
        assert_eq!(refine(rows, accuracy(), curve, || true).times.len(), 2);
    }
}
