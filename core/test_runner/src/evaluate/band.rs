//! Values over time against what is allowed of them.

use super::Judged;
use super::words::{self, times_tolerance, with_unit};
use crate::outcome::Trace;
use choreo_motion::Time;
use choreo_script::testing::Expectation;

/// Values at times, ascending.
pub struct Series {
    pub times: Vec<Time>,
    pub values: Vec<f64>,
}

/// The allowed range at each time, and how far each value is off: at most 0 is allowed, NaN and infinity never.
pub(crate) struct Band {
    pub allowed: Vec<[f64; 2]>,
    pub off: Vec<f64>,
    /// The expected curve, where a whole curve is expected.
    pub goal: Vec<f64>,
    pub tolerance: f64,
    /// `at most 1.5 m/s`
    pub words: String,
}

/// All values must be allowed; negated: none may be. Sometime: one must be, or, negated, must not.
pub(crate) fn judge_band(series: &Series, band: &Band, e: &Expectation, label: &str, unit: &str) -> Judged {
    let (n, negated) = (series.values.len(), e.negated);
    if n == 0 {
        return Judged::impossible(band.words.clone(), "nothing to look at: the span is empty");
    }
    // Unknown values are neither allowed nor forbidden: both claims fail.
    let unknown = |i: usize| series.values[i].is_nan();
    // How far from what is claimed: at most 0 holds.
    let off = |i: usize| match band.off[i] {
        _ if unknown(i) => f64::INFINITY,
        off if off.is_nan() => f64::INFINITY,
        // The edge itself is allowed, so that it is a failure of the negated expectation.
        off if negated && off <= 0.0 => (-off).max(f64::MIN_POSITIVE),
        off if negated => -off,
        off => off,
    };
    let failing: Vec<usize> = (0..n).filter(|i| off(*i) > 0.0).collect();
    let (mut worst, mut best) = (0, 0);
    for i in 1..n {
        if off(i) > off(worst) {
            worst = i;
        }
        if off(i) < off(best) {
            best = i;
        }
    }
    let (passed, shown) = if e.sometime { (failing.len() < n, best) } else { (failing.is_empty(), worst) };
    let mut got =
        format!("{} at {}", with_unit(series.values[shown], unit), words::time(series.times[shown]));
    if n > 1 && !passed {
        let (first, last) = (series.times[failing[0]], series.times[failing[failing.len() - 1]]);
        got.push_str(&match (e.sometime, failing.len()) {
            (true, _) => format!(", the nearest of {n} looks"),
            (false, 1) => format!(", the worst of {n} looks; only there"),
            (false, count) => format!(
                ", the worst of {n} looks; {count} wrong, from {} to {}",
                words::time(first),
                words::time(last)
            ),
        });
    }
    let not = if negated { "not " } else { "" };
    let sometime = if e.sometime { ", sometime" } else { "" };
    let mut judged = Judged::new(passed, format!("{not}{}{sometime}", band.words), got);
    let by = off(shown);
    if !passed && by.is_finite() {
        let distance = by + band.tolerance;
        judged.by = match band.tolerance > 0.0 {
            // How much further away it would have to be; nothing at the edge itself.
            _ if negated && by <= f64::MIN_POSITIVE => String::new(),
            _ if negated => with_unit(by, unit),
            true => format!("{}{}", with_unit(distance, unit), times_tolerance(distance, band.tolerance)),
            false => with_unit(by, unit),
        };
    }
    judged.traces = vec![Trace {
        label: label.to_string(),
        unit: unit.to_string(),
        times: series.times.iter().map(|t| t.as_secs()).collect(),
        got: series.values.clone(),
        expected: band.goal.clone(),
        band: band.allowed.clone(),
        mark: Some(series.times[shown].as_secs()),
    }];
    judged
}
