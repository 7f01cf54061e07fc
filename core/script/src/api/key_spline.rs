//! Tangents of single keyframes, `[time, value, #{ in_tangent: …, out_tangent: … }]`. A span with such a tangent at an
//! end is a cubic Hermite spline; with a weight, too, it is a Bézier curve in time and value.

use super::keys::{count_keyframes, steps_of_ease, tangents};
use crate::call::{ApiError, Call, Options, number, number_in, numbers, wrong};
use choreo_motion::{Ease, Time};
use rhai::Dynamic;

/// Default length of a Bézier handle as a share of the span, for which time is linear in the curve parameter.
const DEFAULT_WEIGHT: f64 = 1.0 / 3.0;
/// Number of Hermite pieces for each number of a span with weights, evenly spaced in the curve parameter. For weights
/// of 0.8 the largest error is 1e-5 of the change.
const BEZIER_SAMPLES: usize = 32;
/// Largest tangent of a point, per second: the largest distance from the origin.
const MAX_TANGENT: f64 = 1e15;
const OPTIONS: [&str; 7] =
    ["ease", "tangent", "in_tangent", "out_tangent", "weight", "in_weight", "out_weight"];

/// Easing and tangents of a keyframe.
#[derive(Clone, Debug, Default)]
pub(super) struct KeyShape {
    /// Easing of the span before the keyframe.
    pub ease: Option<Ease>,
    pub incoming: KeySide,
    pub outgoing: KeySide,
}

/// One side of a keyframe.
#[derive(Clone, Debug, Default)]
pub(super) struct KeySide {
    /// Change per second of each number; `None`: the tangent of the interpolation.
    tangent: Option<Vec<f64>>,
    /// Length of the Bézier handle of each number, as a share of the span.
    weight: Option<Vec<f64>>,
}

impl KeySide {
    pub(super) fn is_given(&self) -> bool {
        self.tangent.is_some() || self.weight.is_some()
    }
}

/// Form in which a script gives the tangents of a property.
#[derive(Clone, Copy)]
pub(super) enum TangentForm {
    /// One number for all components, or one for each.
    Numbers {
        /// Count of numbers that a script gives; further ones are zero.
        min_count: usize,
        /// Count of numbers of the value.
        width: usize,
        /// Factor from the unit of scripts to that of the stage.
        factor: f64,
    },
    /// Degrees per second about y, or about x, y and z.
    Angles,
    /// The property has no tangents, for this reason.
    None(&'static str),
}

impl TangentForm {
    pub(super) fn numbers(width: usize) -> TangentForm {
        TangentForm::Numbers { min_count: width, width, factor: 1.0 }
    }

    fn read(self, v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
        let read = match (self, numbers(v)) {
            (TangentForm::None(why), _) => return Err(ApiError::new(format!("{label}: {why}"))),
            (TangentForm::Angles, Some(three)) if three.len() == 3 => three,
            (TangentForm::Angles, None) => number(v, label)
                .map(|y| vec![0.0, y, 0.0])
                .map_err(|_| wrong(v, label, "degrees per second about y, or [x, y, z]"))?,
            (TangentForm::Angles, Some(_)) => {
                return Err(wrong(v, label, "degrees per second about y, or [x, y, z]"));
            }
            (TangentForm::Numbers { min_count, width, factor }, Some(mut all))
                if (min_count..=width).contains(&all.len()) =>
            {
                all.resize(width, 0.0);
                all.iter().map(|n| n * factor).collect()
            }
            (TangentForm::Numbers { width, factor, .. }, None) if v.is_int() || v.is_float() => {
                vec![number(v, label)? * factor; width]
            }
            (TangentForm::Numbers { min_count: 1, .. }, _) => {
                return Err(wrong(v, label, "a number, the change per second"));
            }
            (TangentForm::Numbers { min_count, .. }, _) => {
                let allowed = format!("{min_count} numbers, the change per second of each, or one for all");
                return Err(wrong(v, label, &allowed));
            }
        };
        match read.iter().all(|n| n.abs() <= MAX_TANGENT) {
            true => Ok(read),
            false => Err(wrong(v, label, "within ±1e15 per second")),
        }
    }

    fn weights(self, v: &Dynamic, label: &str) -> Result<Vec<f64>, ApiError> {
        let (min_count, width) = match self {
            TangentForm::Numbers { min_count, width, .. } => (min_count, width),
            TangentForm::Angles => (3, 3),
            TangentForm::None(why) => return Err(ApiError::new(format!("{label}: {why}"))),
        };
        match v.read_lock::<rhai::Array>() {
            Some(all) if (min_count..=width).contains(&all.len()) => {
                let mut weights: Vec<f64> =
                    all.iter().map(|w| number_in(w, label, 0.0, 1.0)).collect::<Result<_, _>>()?;
                weights.resize(width, DEFAULT_WEIGHT);
                Ok(weights)
            }
            Some(_) => Err(wrong(v, label, &format!("a number from 0 to 1, or {min_count} of them"))),
            None => Ok(vec![number_in(v, label, 0.0, 1.0)?; width]),
        }
    }
}

/// Reads the easing or the map of tangents after the value of keyframe `n`. Messages begin with `of`.
pub(super) fn read_key_shape(
    c: &Call,
    given: Option<&Dynamic>,
    of: &str,
    n: usize,
    form: TangentForm,
) -> Result<KeyShape, ApiError> {
    let Some(given) = given else { return Ok(KeyShape::default()) };
    let ease = |v: &Dynamic| super::easing::ease_of(v, &format!("{of}: ease of key {n}"));
    let Some(map) = given.clone().try_cast::<rhai::Map>() else {
        return Ok(KeyShape { ease: Some(ease(given)?), ..KeyShape::default() });
    };
    let o = Options { function: format!("{of}: key {n}"), map };
    o.check(c, &OPTIONS)?;
    let ease = o.get("ease").map(|v| ease(&v)).transpose()?;
    let side = |direction: &str| -> Result<KeySide, ApiError> {
        let [tangent, weight] = ["tangent", "weight"].map(|what| format!("{direction}_{what}"));
        let tangent = o.read(&tangent, |v, label| form.read(v, label))?;
        let weight = o.read(&weight, |v, label| form.weights(v, label))?;
        Ok(KeySide { tangent, weight })
    };
    let tangent = o.read("tangent", |v, label| form.read(v, label))?;
    let weight = o.read("weight", |v, label| form.weights(v, label))?;
    let [mut incoming, mut outgoing]: [KeySide; 2] = [side("in")?, side("out")?];
    if ease.is_some() && incoming.is_given() {
        let text = format!("{of}: key {n} has both an ease and an incoming tangent: give only one of them");
        return Err(ApiError::new(text));
    }
    for side in [&mut incoming, &mut outgoing] {
        side.tangent = side.tangent.take().or(tangent.clone());
        side.weight = side.weight.take().or(weight.clone());
    }
    Ok(KeyShape { ease, incoming, outgoing })
}

/// Keyframes of a cubic Hermite spline: values, and tangents per second before (`incoming`) and after (`outgoing`)
/// each.
pub(super) struct Spline {
    pub times: Vec<Time>,
    pub values: Vec<Vec<f64>>,
    pub incoming: Vec<Vec<f64>>,
    pub outgoing: Vec<Vec<f64>>,
}

impl Spline {
    /// A spline with equal tangents on both sides of each key.
    pub(super) fn symmetric(times: &[Time], values: &[Vec<f64>], tangents: Vec<Vec<f64>>) -> Spline {
        let (times, values) = (times.to_vec(), values.to_vec());
        Spline { times, values, incoming: tangents.clone(), outgoing: tangents }
    }

    /// The spline through keyframes of which some have their own tangents; `None` if none has. `vector`: the numbers
    /// are the components of a position.
    pub(super) fn of(
        c: &Call,
        how: &str,
        (times, values): (&[Time], &[Vec<f64>]),
        shapes: &[KeyShape],
        vector: bool,
    ) -> Result<Option<Spline>, ApiError> {
        if !shapes.iter().any(|shape| shape.incoming.is_given() || shape.outgoing.is_given()) {
            return Ok(None);
        }
        if how == "step" {
            let text = "key: keys of \"step\" hold until the next one, so they have no tangents";
            return Err(ApiError::new(text));
        }
        let automatic = tangents(how).map(|tangents| tangents.of(times, values, vector));
        let zero = vec![0.0; values[0].len()];
        let mut spline = Spline {
            times: vec![times[0]],
            values: vec![values[0].clone()],
            incoming: vec![zero.clone()],
            outgoing: Vec::new(),
        };
        for next in 1..times.len() {
            let span = Span::new([next - 1, next], times, values, shapes, automatic.as_deref());
            match &shapes[next].ease {
                Some(ease) => {
                    let steps = steps_of_ease(span.ticks);
                    count_keyframes(c, steps as usize)?;
                    for step in 1..=steps {
                        let share = step as f64 / steps as f64;
                        let weight = if step == steps { 1.0 } else { ease.at(share) };
                        spline.push_straight(span.time_at(step, steps), span.interpolated(weight));
                    }
                }
                None if span.has_no_weights() => {
                    spline.outgoing.push(span.tangents[0].clone());
                    spline.push(times[next], values[next].clone(), span.tangents[1].clone());
                }
                None => {
                    count_keyframes(c, BEZIER_SAMPLES * values[0].len())?;
                    span.append_samples(&mut spline);
                }
            }
        }
        spline.outgoing.push(zero);
        Ok(Some(spline))
    }

    fn push(&mut self, time: Time, value: Vec<f64>, incoming: Vec<f64>) {
        self.times.push(time);
        self.values.push(value);
        self.incoming.push(incoming);
    }

    /// Appends a key with a straight line from the last one.
    fn push_straight(&mut self, time: Time, value: Vec<f64>) {
        let last = self.times.len() - 1;
        let chord = slopes(&self.values[last], &value, time - self.times[last]);
        self.outgoing.push(chord.clone());
        self.push(time, value, chord);
    }
}

fn slopes(from: &[f64], to: &[f64], span: Time) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| (b - a) / span.as_secs()).collect()
}

/// The span between two keyframes.
struct Span<'a> {
    from: Time,
    ticks: Time,
    end_values: [&'a [f64]; 2],
    tangents: [Vec<f64>; 2],
    weights: [Option<&'a [f64]>; 2],
}

impl<'a> Span<'a> {
    fn new(
        keys: [usize; 2],
        times: &[Time],
        values: &'a [Vec<f64>],
        shapes: &'a [KeyShape],
        automatic: Option<&[Vec<f64>]>,
    ) -> Span<'a> {
        let ends = keys.map(|key| values[key].as_slice());
        let ticks = times[keys[1]] - times[keys[0]];
        let sides = [&shapes[keys[0]].outgoing, &shapes[keys[1]].incoming];
        let tangents = [0, 1].map(|end| match (&sides[end].tangent, automatic) {
            (Some(own), _) => own.clone(),
            (None, Some(automatic)) => automatic[keys[end]].clone(),
            (None, None) => slopes(ends[0], ends[1], ticks),
        });
        Span {
            from: times[keys[0]],
            ticks,
            end_values: ends,
            tangents,
            weights: sides.map(|side| side.weight.as_deref()),
        }
    }

    fn has_no_weights(&self) -> bool {
        self.weights == [None, None]
    }

    fn time_at(&self, step: i64, steps: i64) -> Time {
        self.from + Time((i128::from(self.ticks.0) * i128::from(step) / i128::from(steps)) as i64)
    }

    fn interpolated(&self, weight: f64) -> Vec<f64> {
        self.end_values[0].iter().zip(self.end_values[1]).map(|(a, b)| a + (b - a) * weight).collect()
    }

    fn bezier(&self, part: usize) -> Bezier {
        let secs = self.ticks.as_secs();
        let weight = |end: usize| self.weights[end].map_or(DEFAULT_WEIGHT, |all| all[part]);
        let (a, b) = (self.end_values[0][part], self.end_values[1][part]);
        Bezier {
            secs,
            weights: [weight(0), weight(1)],
            values: [
                a,
                a + weight(0) * secs * self.tangents[0][part],
                b - weight(1) * secs * self.tangents[1][part],
                b,
            ],
        }
    }

    /// Appends short Hermite spans that approximate the Bézier curves of all numbers, up to the end of this span.
    fn append_samples(&self, spline: &mut Spline) {
        let curves: Vec<Bezier> = (0..self.end_values[0].len()).map(|part| self.bezier(part)).collect();
        // Evenly spaced in the parameter of each curve, so that keys are dense where a curve is steep.
        let inner = (1..BEZIER_SAMPLES).flat_map(|n| {
            let parameter = n as f64 / BEZIER_SAMPLES as f64;
            curves.iter().map(move |curve| curve.time(parameter))
        });
        let mut times: Vec<Time> = inner.map(|share| self.ticks.scaled(share)).collect();
        times.extend([Time::ZERO, self.ticks]);
        times.retain(|time| (Time::ZERO..=self.ticks).contains(time));
        times.sort_unstable();
        times.dedup();
        let shares: Vec<f64> = times.iter().map(|time| time.0 as f64 / self.ticks.0 as f64).collect();
        let found: Vec<Vec<[f64; 2]>> = curves.iter().map(|curve| curve.sampled(&shares)).collect();
        let of = |key: usize, what: usize| found.iter().map(|all| all[key][what]).collect::<Vec<f64>>();
        spline.outgoing.push(of(0, 1));
        for key in 1..times.len() {
            let is_last = key + 1 == times.len();
            let value = if is_last { self.end_values[1].to_vec() } else { of(key, 0) };
            spline.push(self.from + times[key], value, of(key, 1));
            if !is_last {
                spline.outgoing.push(of(key, 1));
            }
        }
    }
}

/// One number as a cubic Bézier curve over time. The times of its control points, as shares of the span, are 0, the
/// first weight, 1 − the second weight and 1.
struct Bezier {
    secs: f64,
    weights: [f64; 2],
    values: [f64; 4],
}

impl Bezier {
    /// Time, as a share of the span, at curve parameter `u`.
    fn time(&self, u: f64) -> f64 {
        let r = 1.0 - u;
        3.0 * r * r * u * self.weights[0] + 3.0 * r * u * u * (1.0 - self.weights[1]) + u * u * u
    }

    /// Value and change per second at shares of the span.
    fn sampled(&self, shares: &[f64]) -> Vec<[f64; 2]> {
        // The inverse of [`Bezier::time`]: an easing curve whose value is the parameter.
        let [start, end] = self.weights;
        let parameter = Ease::Bezier([start, DEFAULT_WEIGHT, 1.0 - end, 2.0 * DEFAULT_WEIGHT]);
        let at = |share: &f64| {
            let u = parameter.at(*share);
            let (r, [a, b, c, d]) = (1.0 - u, self.values);
            let value = r * r * r * a + 3.0 * r * r * u * b + 3.0 * r * u * u * c + u * u * u * d;
            let rise = r * r * (b - a) + 2.0 * r * u * (c - b) + u * u * (d - c);
            let run = r * r * start + 2.0 * r * u * (1.0 - end - start) + u * u * end;
            [value, rise / (run * self.secs)]
        };
        let mut all: Vec<[f64; 2]> = shares.iter().map(at).collect();
        // A vertical curve has an unbounded slope, so slopes are limited to 3 times that of the steeper chord beside
        // them.
        let chord = |i: usize| (all[i + 1][0] - all[i][0]) / ((shares[i + 1] - shares[i]) * self.secs);
        let chords: Vec<f64> = (0..all.len() - 1).map(chord).collect();
        for (i, [_, slope]) in all.iter_mut().enumerate() {
            let sides = [i.checked_sub(1).map(|i| chords[i]), chords.get(i).copied()];
            let most = 3.0 * sides.iter().flatten().fold(0.0, |most: f64, chord| most.max(chord.abs()));
            let chord = sides.iter().flatten().next().copied().unwrap_or(0.0);
            *slope = if slope.is_nan() { chord } else { slope.clamp(-most, most) };
        }
        all
    }
}
