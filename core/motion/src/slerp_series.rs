//! Shortest-arc slerp without trigonometry, as exact as f32 allows.
//!
//! sin(tθ)/sin θ is a power series in d = 1 − cos θ with coefficients that depend on t alone
//! (D. Eberly, "A Fast and Accurate Algorithm for Computing SLERP", 2011, eq. 8):
//! f₀ = t, fᵢ = fᵢ₋₁ (i² − t²) / (i (2i + 1)), all positive for 0 ≤ t ≤ 1. Joints that share their key times share
//! t, so the coefficients are computed once for all of them, and each joint costs two short Horner chains. How many
//! terms are needed depends on the widest interval, known when the clip is packed: two for keys 10° apart, 26 for 180°.
//! Against f64 slerp the result is within 3e-5° for keys up to 179.9° apart (`tests/motion/sample.rs`).

use crate::simd::F8;

/// Terms of the longest series; d ≤ 1, the ratio of successive terms tends to d/2.
pub(crate) const MAX_TERMS: usize = 26;

/// 1 / (i (2i + 1)): part of the factor between successive coefficients of the series.
const FACTOR_DENOMINATOR_INVERSES: [f32; MAX_TERMS + 1] = {
    let mut table = [0.0; MAX_TERMS + 1];
    let mut i = 1;
    while i <= MAX_TERMS {
        table[i] = (1.0 / ((i * (2 * i + 1)) as f64)) as f32;
        i += 1;
    }
    table
};

/// Largest truncation error of the series, relative to unit length: half of f32's own rounding.
const MAX_TRUNCATION_ERROR: f64 = 3e-8;

/// Number of terms beyond the first that intervals need whose d = 1 − cos of the angle is at most this.
pub(crate) fn series_terms_for(d: f64) -> usize {
    let d = d.clamp(0.0, 1.0);
    // The rest of the series after N terms is below (term N+1) / (1 − d/2), for every t.
    let mut terms = 0;
    for step in 1..16 {
        let t = f64::from(step) / 16.0;
        let mut term = t;
        for i in 1..=MAX_TERMS {
            let n = i as f64;
            term *= (n * n - t * t) / (n * (2.0 * n + 1.0)) * d;
            if term / (1.0 - 0.5 * d) < MAX_TRUNCATION_ERROR {
                break;
            }
            terms = terms.max(i);
        }
    }
    terms
}

/// 1 − cos of the angle between two unit quaternions in the same hemisphere, accurate for small angles too.
pub(crate) fn one_minus_cos(a: [f32; 4], b: [f32; 4]) -> f64 {
    let unit = |q: [f32; 4]| {
        let q = q.map(f64::from);
        let length = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
        q.map(|c| c / length)
    };
    let (a, b) = (unit(a), unit(b));
    0.5 * (0..4).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>()
}

/// Coefficients of the slerp weights of both keys at one t.
pub(crate) struct SlerpSeries {
    /// (coefficient of the first key's weight, coefficient of the second key's)
    coefficients: [(f32, f32); MAX_TERMS + 1],
}

impl SlerpSeries {
    #[inline(always)]
    pub(crate) fn new(t: f32, terms: usize) -> SlerpSeries {
        let mut coefficients = [(0.0, 0.0); MAX_TERMS + 1];
        let u = 1.0 - t;
        let (uu, tt) = (u * u, t * t);
        let (mut a, mut b) = (u, t);
        coefficients[0] = (a, b);
        for i in 1..=terms.min(MAX_TERMS) {
            let square = (i * i) as f32;
            a *= (square - uu) * FACTOR_DENOMINATOR_INVERSES[i];
            b *= (square - tt) * FACTOR_DENOMINATOR_INVERSES[i];
            coefficients[i] = (a, b);
        }
        SlerpSeries { coefficients }
    }

    /// The weights of two keys, eight joints at a time.
    #[inline(always)]
    pub(crate) fn weights<F: F8>(&self, d: F, terms: usize) -> (F, F) {
        let terms = terms.min(MAX_TERMS);
        let (a, b) = self.coefficients[terms];
        let (mut wa, mut wb) = (F::splat(a), F::splat(b));
        for (a, b) in self.coefficients[..terms].iter().rev() {
            wa = wa.mul(d).add(F::splat(*a));
            wb = wb.mul(d).add(F::splat(*b));
        }
        (wa, wb)
    }
}

/// Slerp weights of eight pairs of keys, each at its own t.
#[inline(always)]
pub(crate) fn slerp_weights<F: F8>(t: F, d: F, terms: usize) -> (F, F) {
    let one = F::splat(1.0);
    let u = one.sub(t);
    let (uu, tt) = (u.mul(u), t.mul(t));
    let (mut a, mut b) = (u, t);
    let (mut wa, mut wb) = (a, b);
    let mut power = one;
    for (i, inverse) in FACTOR_DENOMINATOR_INVERSES.iter().enumerate().take(terms.min(MAX_TERMS) + 1).skip(1)
    {
        let (square, inverse) = (F::splat((i * i) as f32), F::splat(*inverse));
        power = power.mul(d);
        a = a.mul(square.sub(uu).mul(inverse));
        b = b.mul(square.sub(tt).mul(inverse));
        wa = wa.add(a.mul(power));
        wb = wb.add(b.mul(power));
    }
    (wa, wb)
}
