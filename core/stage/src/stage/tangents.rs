//! Tangents of keys for interpolation by cubic Hermite splines.

use choreo_motion::Time;

/// Largest tangent of [`Tangents::Limited`], as a multiple of the slower change beside the key. Up to 3, a curve through rising values
/// rises everywhere (Fritsch and Carlson 1980, §2). With 2, a path that turns a corner within a short gap swings less far aside: 0.30 of
/// the step, instead of 0.44 with 3.
const MAX_TANGENT_RATIO: f64 = 2.0;

/// Method by which the tangents of keys are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangents {
    /// Zero: the value rests at each key.
    Flat,
    /// The tangents of [`Tangents::CatmullRom`], but nowhere against the change before or after the key, and at most twice as fast as the
    /// slower of both. A number never leaves the range between two keys (monotone cubics), and neither does a vector on a straight line.
    Limited,
    /// Non-uniform Catmull–Rom: the tangent of the parabola through the key and its neighbors. If two keys lie close together, the
    /// overshoot grows as 1 / gap.
    CatmullRom,
}

impl Tangents {
    /// The tangents per second at all keys, zero at the first and the last one and on both sides of a jump, which is two keys one tick
    /// apart. `values`: the components of each key. `vector`: whether they belong to one vector, such as a position, and are limited
    /// together.
    pub fn of(self, times: &[Time], values: &[Vec<f64>], vector: bool) -> Vec<Vec<f64>> {
        let flat = |i: usize| vec![0.0; values[i].len()];
        let tangent = |i: usize| {
            let ends = i == 0 || i + 1 == times.len();
            if self == Tangents::Flat || ends || is_jump_after(times, i - 1) || is_jump_after(times, i) {
                return flat(i);
            }
            let left = times[i].as_secs() - times[i - 1].as_secs();
            let right = times[i + 1].as_secs() - times[i].as_secs();
            let changes = |a: &[f64], b: &[f64], span: f64| -> Vec<f64> {
                a.iter().zip(b).map(|(a, b)| (b - a) / span).collect()
            };
            let before = changes(&values[i - 1], &values[i], left);
            let after = changes(&values[i], &values[i + 1], right);
            let parabola = before.iter().zip(&after).map(|(b, a)| (b * right + a * left) / (left + right));
            let mut tangent: Vec<f64> = parabola.collect();
            if self == Tangents::Limited {
                let group = if vector { tangent.len().max(1) } else { 1 };
                let sides = before.chunks(group).zip(after.chunks(group));
                tangent
                    .chunks_mut(group)
                    .zip(sides)
                    .for_each(|(tangent, (b, a))| limit_tangent(tangent, b, a));
            }
            tangent
        };
        (0..times.len()).map(tangent).collect()
    }
}

/// Whether the value jumps from a key to the next one.
fn is_jump_after(times: &[Time], key: usize) -> bool {
    (times[key + 1] - times[key]).0 <= 1
}

fn limit_tangent(tangent: &mut [f64], before: &[f64], after: &[f64]) {
    // A tangent between both changes can point against only one of them.
    for side in [before, after] {
        let along = dot(tangent, side);
        if along < 0.0 {
            let share = along / dot(side, side);
            tangent.iter_mut().zip(side).for_each(|(t, s)| *t -= share * s);
        }
    }
    let most = MAX_TANGENT_RATIO * dot(before, before).min(dot(after, after)).sqrt();
    let length = dot(tangent, tangent).sqrt();
    if length > most {
        tangent.iter_mut().for_each(|t| *t *= most / length);
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
