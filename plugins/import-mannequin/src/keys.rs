//! Keyframe curves for authoring poses in code.

/// Slope at the middle of three keys, by Fritsch & Carlson (1980) in Brodlie's harmonic form: no overshoot, and zero at local
/// extremes, so that held extremes ease in and out.
fn slope(before: (f32, f32), here: (f32, f32), after: (f32, f32)) -> f32 {
    let (h0, h1) = (here.0 - before.0, after.0 - here.0);
    let (d0, d1) = ((here.1 - before.1) / h0, (after.1 - here.1) / h1);
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    3.0 * (h0 + h1) / ((2.0 * h1 + h0) / d0 + (h1 + 2.0 * h0) / d1)
}

/// Cubic Hermite interpolation between keys a and b with the given slopes.
pub(crate) fn hermite(t: f32, a: (f32, f32), slope_a: f32, b: (f32, f32), slope_b: f32) -> f32 {
    let h = b.0 - a.0;
    let u = ((t - a.0) / h).clamp(0.0, 1.0);
    let (u2, u3) = (u * u, u * u * u);
    a.1 * (2.0 * u3 - 3.0 * u2 + 1.0)
        + b.1 * (3.0 * u2 - 2.0 * u3)
        + h * (slope_a * (u3 - 2.0 * u2 + u) + slope_b * (u3 - u2))
}

/// Interpolates `(time, value)` keys in order. The end values are held outside, with zero slope.
pub(crate) fn keys(t: f32, keys: &[(f32, f32)]) -> f32 {
    let Some(&first) = keys.first() else { return 0.0 };
    if t <= first.0 {
        return first.1;
    }
    let Some(i) = keys.windows(2).position(|w| t < w[1].0) else { return keys[keys.len() - 1].1 };
    let (a, b) = (keys[i], keys[i + 1]);
    let slope_a = if i == 0 { 0.0 } else { slope(keys[i - 1], a, b) };
    let slope_b = if i + 2 == keys.len() { 0.0 } else { slope(a, b, keys[i + 2]) };
    hermite(t, a, slope_a, b, slope_b)
}

/// Interpolates keys like [`keys`], repeated with a period. The keys lie within one period; the first is not repeated at the end.
pub(crate) fn cycle(t: f32, period: f32, keys: &[(f32, f32)]) -> f32 {
    let n = keys.len();
    if n < 2 {
        return keys.first().map_or(0.0, |k| k.1);
    }
    let t = t - period * libm::floorf((t - keys[0].0) / period);
    let at = |i: isize| {
        let wraps = i.div_euclid(n as isize);
        let (time, value) = keys[i.rem_euclid(n as isize) as usize];
        (time + wraps as f32 * period, value)
    };
    let i = keys.iter().rposition(|k| k.0 <= t).unwrap_or(0) as isize;
    let (a, b) = (at(i), at(i + 1));
    hermite(t, a, slope(at(i - 1), a, b), b, slope(a, b, at(i + 2)))
}

/// Smoothstep 3u² − 2u³, from 0 at `from` to 1 at `to`.
pub(crate) fn ease(t: f32, from: f32, to: f32) -> f32 {
    let u = ((t - from) / (to - from)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Cosine and sine of a phase in turns.
pub(crate) fn cos(turns: f32) -> f32 {
    libm::cosf(turns * core::f32::consts::TAU)
}
pub(crate) fn sin(turns: f32) -> f32 {
    libm::sinf(turns * core::f32::consts::TAU)
}
