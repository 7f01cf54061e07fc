//! Height by which the hips are raised over a clip, so that feet stay on the floor.
//!
//! At each time the lowest foot requires a height. While a sole stands, the hips must have it. While a heel rises over its toes,
//! and in the air, the required height follows the proportions of both feet instead, up and down by a tenth of a leg within a few
//! frames, and a character that followed it would jolt. The lift is the smoothest curve that keeps to the heights that standing
//! soles require: it minimizes Σ w (r − c)² + Σ (second difference of r)² + μ Σ (first difference of r)², with large weights w
//! where a sole stands and small ones elsewhere (Whittaker 1923; a spline under tension, which does not overshoot its ends). If a
//! foot would sink below the floor, the floor becomes a target of a large weight, too, until no foot does.

use super::Retarget;
use super::frame::RetargetBuffers;
use crate::clip::Clip;
use crate::time::Time;

/// Samples per second, and the largest number of samples of a clip.
const SAMPLES_PER_SECOND: f64 = 120.0;
const MAX_SAMPLES: f64 = 262_144.0;
/// Smoothing time of the curve where a sole stands, and elsewhere, seconds: the fourth root of 1 / w.
const STANDING_SECS: f64 = 0.015;
const AIR_SECS: f64 = 1.0;
/// Time over which the curve bends into the straight line from one contact to the next, seconds: the square root of 1 / μ.
const BEND_SECS: f64 = 0.1;
/// Heights of an ankle above its height at rest, in leg lengths: below the first, the foot stands; above the second, it is in the
/// air.
const STANDING_HEIGHT_LEGS: f64 = 0.01;
const AIR_HEIGHT_LEGS: f64 = 0.05;
/// Vertical speeds of an ankle, in leg lengths per second: below the first, the foot stands, also on a step or on its toes; above
/// the second, it moves.
const STILL_SPEED_LEGS: f64 = 0.05;
const MOVING_SPEED_LEGS: f64 = 0.3;
/// Time before and after a sample, seconds, in which the ankle must be as slow for the foot to count as standing.
const STILL_SECS: f64 = 0.04;
/// Depth below the floor to which a foot may sink, in leg lengths.
const SINK_TOLERANCE_LEGS: f64 = 1e-3;
/// Largest number of times that the curve is computed again with the floor as a target where a foot would sink.
const MAX_FLOOR_ROUNDS: usize = 8;
/// Seconds by which the curve is continued beyond both ends.
const BEYOND_SECS: f64 = 1.0;
/// Largest difference between the ends of a clip that loops, in leg lengths.
const MAX_LOOP_GAP_LEGS: f64 = 1e-3;

/// The lift that the feet require at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clearance {
    /// Lift of the hips, metres, with which the lowest foot has its required height.
    pub raised: f64,
    /// Smallest lift of the hips, metres, with which the lowest foot is not below the floor.
    pub least: f64,
    /// Height of the source's lower ankle above its height at rest, in leg lengths.
    pub ankle: f64,
}

/// The lift at equal steps of time.
pub(super) struct Lift {
    step_secs: f64,
    /// Lift at each step, metres.
    raised: Vec<f64>,
}

impl Lift {
    /// Computes the lift of a clip, whose poses come from `frame`.
    pub(super) fn new(retarget: &Retarget, clip: &Clip, frame: &mut RetargetBuffers) -> Lift {
        let secs = clip.duration.as_secs();
        let steps = (secs * SAMPLES_PER_SECOND).ceil().clamp(1.0, MAX_SAMPLES);
        let step_secs = secs / steps;
        let time = |i: u32| Time::from_secs(step_secs * f64::from(i)).min(clip.duration);
        let required: Vec<Clearance> =
            (0..=steps as u32).map(|i| frame.clearance_at(retarget, clip, time(i))).collect();
        let raised = match step_secs > 0.0 {
            true => smooth_lift(&required, step_secs, retarget.target.leg),
            false => vec![required[0].raised],
        };
        Lift { step_secs, raised }
    }

    /// Lift at a time of the clip, metres: a cubic between two samples, through four.
    pub(super) fn at(&self, time: Time) -> f64 {
        let last = self.raised.len() - 1;
        if last == 0 {
            return self.raised[0];
        }
        let sample_position = (time.as_secs() / self.step_secs).clamp(0.0, last as f64);
        let i = (sample_position as usize).min(last - 1);
        let w = sample_position - i as f64;
        let [b, c] = [self.raised[i], self.raised[i + 1]];
        // The curve continues straight beyond its ends.
        let a = if i == 0 { 2.0 * b - c } else { self.raised[i - 1] };
        let d = if i + 2 > last { 2.0 * c - b } else { self.raised[i + 2] };
        let (from, to) = ((c - a) / 2.0, (d - b) / 2.0);
        let (w2, w3) = (w * w, w * w * w);
        b * (2.0 * w3 - 3.0 * w2 + 1.0)
            + c * (3.0 * w2 - 2.0 * w3)
            + from * (w3 - 2.0 * w2 + w)
            + to * (w3 - w2)
    }
}

/// The smoothest curve that keeps to the heights that standing soles require.
fn smooth_lift(required: &[Clearance], step_secs: f64, leg: f64) -> Vec<f64> {
    let count = required.len();
    let (first, last) = (required[0], required[count - 1]);
    let loops = (first.raised - last.raised).abs() < MAX_LOOP_GAP_LEGS * leg
        && (first.ankle - last.ankle).abs() < MAX_LOOP_GAP_LEGS;
    // A clip that loops continues with its beginning; any other is mirrored, so that the curve has slope zero at its ends.
    let period = if loops { count - 1 } else { 2 * (count - 1) } as isize;
    let index = |i: isize| {
        let i = i.rem_euclid(period) as usize;
        if i < count { i } else { 2 * (count - 1) - i }
    };
    let weights = sample_weights(required, step_secs, &index);
    let beyond = (BEYOND_SECS / step_secs).ceil().min(1e6) as isize;
    let sample_indices: Vec<usize> = (-beyond..count as isize + beyond).map(index).collect();
    let mut targets: Vec<[f64; 2]> =
        sample_indices.iter().map(|i| [weights[*i], weights[*i] * required[*i].raised]).collect();
    let floor = fourth_power(step_secs / STANDING_SECS);
    let mut sunk = vec![false; sample_indices.len()];
    let tension = (step_secs / BEND_SECS) * (step_secs / BEND_SECS);
    let mut lift = tension_spline(&targets, tension);
    for _ in 0..MAX_FLOOR_ROUNDS {
        let mut more = false;
        for (i, sample) in sample_indices.iter().enumerate() {
            let least = required[*sample].least;
            if !sunk[i] && lift[i] < least - SINK_TOLERANCE_LEGS * leg {
                targets[i] = [targets[i][0] + floor, targets[i][1] + floor * least];
                (sunk[i], more) = (true, true);
            }
        }
        if !more {
            break;
        }
        lift = tension_spline(&targets, tension);
    }
    lift[beyond as usize..][..count].to_vec()
}

/// Weight of each sample: how closely the curve keeps to it.
fn sample_weights(required: &[Clearance], step_secs: f64, index: &dyn Fn(isize) -> usize) -> Vec<f64> {
    // Feet that never touch the floor count as standing where they are lowest.
    let floor = required.iter().map(|a| a.ankle).fold(f64::MAX, f64::min).max(0.0);
    let nearby = (STILL_SECS / step_secs).ceil().min(64.0) as isize;
    let speed = |i: isize| (required[index(i + 1)].ankle - required[index(i)].ankle).abs() / step_secs;
    let weight = |i: usize| {
        let high = smoothstep(STANDING_HEIGHT_LEGS, AIR_HEIGHT_LEGS, required[i].ankle - floor);
        let i = i as isize;
        let fastest = (i - nearby..i + nearby).map(speed).fold(0.0, f64::max);
        let air = high * smoothstep(STILL_SPEED_LEGS, MOVING_SPEED_LEGS, fastest);
        fourth_power(step_secs / (STANDING_SECS + (AIR_SECS - STANDING_SECS) * air))
    };
    (0..required.len()).map(weight).collect()
}

fn fourth_power(x: f64) -> f64 {
    (x * x) * (x * x)
}

fn smoothstep(from: f64, to: f64, at: f64) -> f64 {
    let w = ((at - from) / (to - from)).clamp(0.0, 1.0);
    w * w * (3.0 - 2.0 * w)
}

/// Solves (W + D₂ᵀD₂ + μ D₁ᵀD₁) r = W c by LDLᵀ of five diagonals. `targets`: weight and weighted target of each sample;
/// `tension`: μ.
fn tension_spline(targets: &[[f64; 2]], tension: f64) -> Vec<f64> {
    let n = targets.len();
    let (mut diagonal, mut first) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n {
        diagonal[i - 1] += tension;
        diagonal[i] += tension;
        first[i] -= tension;
    }
    for i in 2..n {
        diagonal[i - 2] += 1.0;
        diagonal[i - 1] += 4.0;
        diagonal[i] += 1.0;
        first[i - 1] -= 2.0;
        first[i] -= 2.0;
    }
    // Row i of L holds `second_below` two columns left of the diagonal and `first_below` one column left of it.
    let (mut pivots, mut first_below, mut second_below, mut out) =
        (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let [weight, target] = targets[i];
        let (mut pivot, mut value) = (weight + diagonal[i], target);
        if i >= 2 {
            second_below[i] = 1.0 / pivots[i - 2];
            pivot -= second_below[i] * second_below[i] * pivots[i - 2];
            value -= second_below[i] * out[i - 2];
        }
        if i >= 1 {
            let above = if i >= 2 { second_below[i] * first_below[i - 1] * pivots[i - 2] } else { 0.0 };
            first_below[i] = (first[i] - above) / pivots[i - 1];
            pivot -= first_below[i] * first_below[i] * pivots[i - 1];
            value -= first_below[i] * out[i - 1];
        }
        (pivots[i], out[i]) = (pivot, value);
    }
    for i in (0..n).rev() {
        out[i] /= pivots[i];
        if i + 1 < n {
            out[i] -= first_below[i + 1] * out[i + 1];
        }
        if i + 2 < n {
            out[i] -= second_below[i + 2] * out[i + 2];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The solution is a minimum: any change of one value increases the sum.
    #[test]
    fn the_spline_minimizes_its_sum_of_squares() {
        let targets: Vec<[f64; 2]> = (0..40)
            .map(|i| {
                let weight = [0.5, 1e-4, 0.02][i % 3];
                [weight, weight * f64::from(i as u32 * 7919 % 101) / 101.0]
            })
            .collect();
        let sum = |r: &[f64], tension: f64| {
            let fit: f64 = r.iter().zip(&targets).map(|(r, [w, wc])| w * r * r - 2.0 * wc * r).sum();
            let bend: f64 =
                r.windows(3).map(|r| (r[0] - 2.0 * r[1] + r[2]) * (r[0] - 2.0 * r[1] + r[2])).sum();
            let rise: f64 = r.windows(2).map(|r| (r[1] - r[0]) * (r[1] - r[0])).sum();
            fit + bend + tension * rise
        };
        for tension in [0.0, 0.007] {
            let found = tension_spline(&targets, tension);
            let least = sum(&found, tension);
            for i in 0..found.len() {
                for off in [-1e-3, 1e-3] {
                    let mut other = found.clone();
                    other[i] += off;
                    assert!(sum(&other, tension) > least, "{i} {off} at {tension}");
                }
            }
        }
    }

    /// The lift is constant while the feet stand, and smooth during the one stride in the air.
    #[test]
    fn the_lift_holds_while_feet_stand_and_is_smooth_in_the_air() {
        let step_secs = 1.0 / SAMPLES_PER_SECOND;
        let required: Vec<Clearance> = (0..240)
            .map(|i| {
                let secs = f64::from(i) * step_secs;
                let ankle = 8.0 * ((secs - 0.8) * (1.2 - secs)).max(0.0);
                // The lift that the feet require in the air goes down by 9 cm and back within an eighth of a second.
                let raised =
                    if ankle > AIR_HEIGHT_LEGS { -0.09 * (1.0 - (8.0 * secs).fract()) } else { 0.01 };
                Clearance { raised, least: raised - 0.2, ankle }
            })
            .collect();
        let found = smooth_lift(&required, step_secs, 1.0);
        for (i, (found, required)) in found.iter().zip(&required).enumerate() {
            let flat = required.ankle == 0.0 && !(80..160).contains(&i);
            assert!(!flat || (found - 0.01).abs() < 1e-4, "{i}: {found}");
            assert!((found - 0.01).abs() < 0.02, "{i}: {found}");
        }
        let jolt = found.windows(3).map(|r| (r[0] - 2.0 * r[1] + r[2]).abs()).fold(0.0, f64::max);
        assert!(jolt < 5e-4, "{jolt}");
        // Feet do not sink below the floor, which requires three centimetres more in the middle of the flight.
        let mut deep = required;
        deep[120..123].iter_mut().for_each(|required| required.least = 0.04);
        let raised = smooth_lift(&deep, step_secs, 1.0);
        assert!(raised[120..123].iter().all(|r| *r > 0.035), "{:?}", &raised[118..125]);
        assert!(found[120..123].iter().all(|r| *r < 0.02), "{:?}", &found[118..125]);
    }
}
