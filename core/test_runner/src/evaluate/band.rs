//! Judges values over time against an allowed range.

use super::Judgment;
use super::text_format::{self, number_with_unit, tolerance_ratio};
use crate::outcome::Trace;
use choreo_motion::Time;
use choreo_script::testing::Expectation;

/// Values over time; times ascend.
pub(super) struct Series {
    pub times: Vec<Time>,
    pub values: Vec<f64>,
}

/// Allowed range at each time, and distance of each value from it. A distance of at most 0 is inside the range; NaN and infinity never are.
pub(crate) struct Band {
    pub allowed: Vec<[f64; 2]>,
    pub distances: Vec<f64>,
    /// The expected curve, if a whole curve is expected.
    pub expected_curve: Vec<f64>,
    pub tolerance: f64,
    /// Description of the range for messages, such as `at most 1.5 m/s`.
    pub description: String,
}

/// Judges a series. All values must be allowed, or, if negated, none. With `sometime`, one value must be allowed, or, if negated, one must
/// not.
pub(crate) fn judge_band(series: &Series, band: &Band, e: &Expectation, label: &str, unit: &str) -> Judgment {
    let (n, negated) = (series.values.len(), e.negated);
    if n == 0 {
        return Judgment::impossible(band.description.clone(), "no samples: the span is empty");
    }
    // Unknown values fail the expectation, whether negated or not.
    let unknown = |i: usize| series.values[i].is_nan();
    // Distance by which a value violates the claim; the claim holds if it is at most 0.
    let claim_error = |i: usize| match band.distances[i] {
        _ if unknown(i) => f64::INFINITY,
        off if off.is_nan() => f64::INFINITY,
        // The bounds are allowed values, so they fail a negated expectation.
        off if negated && off <= 0.0 => (-off).max(f64::MIN_POSITIVE),
        off if negated => -off,
        off => off,
    };
    let failing: Vec<usize> = (0..n).filter(|i| claim_error(*i) > 0.0).collect();
    let (mut worst, mut best) = (0, 0);
    for i in 1..n {
        if claim_error(i) > claim_error(worst) {
            worst = i;
        }
        if claim_error(i) < claim_error(best) {
            best = i;
        }
    }
    let (passed, shown) = if e.sometime { (failing.len() < n, best) } else { (failing.is_empty(), worst) };
    let mut got = format!(
        "{} at {}",
        number_with_unit(series.values[shown], unit),
        text_format::time(series.times[shown])
    );
    if n > 1 && !passed {
        let (first, last) = (series.times[failing[0]], series.times[failing[failing.len() - 1]]);
        got.push_str(&match (e.sometime, failing.len()) {
            (true, _) => format!(", the nearest of {n} samples"),
            (false, 1) => format!(", the worst of {n} samples; only there"),
            (false, count) => format!(
                ", the worst of {n} samples; {count} wrong, from {} to {}",
                text_format::time(first),
                text_format::time(last)
            ),
        });
    }
    let not = if negated { "not " } else { "" };
    let sometime = if e.sometime { ", sometime" } else { "" };
    let mut judged = Judgment::new(passed, format!("{not}{}{sometime}", band.description), got);
    let by = claim_error(shown);
    if !passed && by.is_finite() {
        let distance = by + band.tolerance;
        judged.by = match band.tolerance > 0.0 {
            // Distance to leave the allowed range; empty for a value exactly on its bound.
            _ if negated && by <= f64::MIN_POSITIVE => String::new(),
            _ if negated => number_with_unit(by, unit),
            true => {
                format!("{}{}", number_with_unit(distance, unit), tolerance_ratio(distance, band.tolerance))
            }
            false => number_with_unit(by, unit),
        };
    }
    judged.traces = vec![Trace {
        label: label.to_string(),
        unit: unit.to_string(),
        times: series.times.iter().map(|t| t.as_secs()).collect(),
        got: series.values.clone(),
        expected: band.expected_curve.clone(),
        band: band.allowed.clone(),
        mark: Some(series.times[shown].as_secs()),
    }];
    judged
}
