//! Fits uniform cubic B-splines to the keys of a curve, by least squares.
//!
//! L. Piegl, W. Tiller, "The NURBS Book", §9.4.1. The normal equations are the same for all curves of a clip: seven diagonals, factored
//! once for each spacing of the knots.

use super::grid::{Grid, is_packable};
use crate::clip::{Clip, Curve, Path};
use crate::slerp_series::one_minus_cos;
use crate::time::Time;
use std::sync::Arc;

/// Numbers of keys per knot. At 1 the knots are the keys.
pub(crate) const STRIDES: [usize; 6] = [1, 2, 3, 4, 6, 8];

/// Uniform cubic B-spline basis: weights of four knots at a fraction `s` of the way from the second to the third.
pub(crate) fn bspline_weights(s: f64) -> [f64; 4] {
    let (r, s2, s3) = (1.0 - s, s * s, s * s * s);
    [
        r * r * r / 6.0,
        (3.0 * s3 - 6.0 * s2 + 4.0) / 6.0,
        (-3.0 * s3 + 3.0 * s2 + 3.0 * s + 1.0) / 6.0,
        s3 / 6.0,
    ]
}

/// Number of knots for a number of frames.
pub(crate) fn knot_count(frames: usize, stride: usize) -> usize {
    if stride == 1 { frames } else { (frames - 1) / stride + 4 }
}

/// Values of each curve on the grid, and their splines; `None` for curves that are not packed.
pub(super) struct CurveFits(Vec<Option<CurveFit>>);

pub(super) struct CurveFit {
    /// 1 − cos of the largest angle between neighboring quaternions; 0 for other curves.
    pub widest: f64,
    pub values: Vec<[f64; 4]>,
    /// Knots, and the largest error of the spline, for each of [`STRIDES`]; errors of rotations are in radians.
    pub splines: Vec<(Vec<[f64; 4]>, f64)>,
}

impl CurveFits {
    pub(super) fn new(clip: &Clip, grid: &Grid) -> CurveFits {
        let solvers: Vec<Solver> = STRIDES.iter().map(|s| Solver::new(grid.frames, *s)).collect();
        let fit = |curve: &Curve| {
            let values = grid.values(curve);
            let spline = |solver: &Solver| {
                let knots = solver.solve(&values);
                let worst = largest_spline_error(curve.path, solver.stride, &knots, &values);
                (knots, worst)
            };
            let splines = solvers.iter().map(spline).collect();
            let narrow = |q: &[f64; 4]| q.map(|c| c as f32);
            let intervals = values.windows(2).map(|w| one_minus_cos(narrow(&w[0]), narrow(&w[1])));
            let widest = if curve.path == Path::Rotation { intervals.fold(0.0, f64::max) } else { 0.0 };
            CurveFit { widest, values, splines }
        };
        CurveFits(clip.curves().iter().map(|curve| is_packable(curve).then(|| fit(curve))).collect())
    }

    pub(super) fn fit_of(&self, curve: usize) -> Option<&CurveFit> {
        self.0.get(curve)?.as_ref()
    }

    /// The curve with LINEAR keys at the grid's times, for curves that packing does not make smaller.
    pub(super) fn resampled_curve(&self, curve: &Curve, index: usize, times: &Arc<[Time]>) -> Curve {
        let width = curve.path.width();
        let Some(fit) = self.fit_of(index) else { return curve.clone() };
        let values = fit.values.iter().flat_map(|v| v[..width].iter().map(|c| *c as f32)).collect();
        let interpolation = crate::clip::Interpolation::Linear;
        Curve { times: times.clone(), values, interpolation, ..curve.clone() }
    }
}

impl CurveFit {
    /// The first value, if all values are within the tolerance of it.
    pub(super) fn constant(&self, allowed: f64) -> Option<&[f64]> {
        let first = self.values.first()?;
        let is_constant = self.values.iter().all(|v| doubled_distance(v, first) <= allowed);
        is_constant.then(|| &first[..])
    }
}

/// Twice the distance between two values: between unit quaternions, about the angle of the rotation.
fn doubled_distance(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    2.0 * a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Largest error of the spline at the frames: radians for rotations, else a distance.
fn largest_spline_error(path: Path, stride: usize, knots: &[[f64; 4]], values: &[[f64; 4]]) -> f64 {
    if stride == 1 {
        return 0.0;
    }
    let phases: Vec<[f64; 4]> = (0..stride).map(|p| bspline_weights(p as f64 / stride as f64)).collect();
    let mut worst = 0.0f64;
    for (frame, value) in values.iter().enumerate() {
        let (first, weights) = (frame / stride, &phases[frame % stride]);
        let mut at = [0.0; 4];
        for (knot, weight) in knots[first..].iter().zip(weights) {
            (0..4).for_each(|c| at[c] += knot[c] * weight);
        }
        worst = worst.max(doubled_distance(&at, value));
    }
    // The distance between unit quaternions is half the angle.
    if path == Path::Rotation { worst } else { worst * 0.5 }
}

/// The factored normal equations of one stride: diagonals 0 to 3 of the Cholesky factor.
struct Solver {
    stride: usize,
    phases: Vec<[f64; 4]>,
    factor: Vec<[f64; 4]>,
}

/// Weight of the regularization that pulls the few knots at the ends, which no key determines, to the line of their neighbors.
const STIFFNESS: f64 = 1e-9;

impl Solver {
    fn new(frames: usize, stride: usize) -> Solver {
        let phases: Vec<[f64; 4]> = (0..stride).map(|p| bspline_weights(p as f64 / stride as f64)).collect();
        let count = knot_count(frames, stride);
        let mut factor = vec![[0.0; 4]; if stride == 1 { 0 } else { count }];
        if stride > 1 {
            for frame in 0..frames {
                let (first, weights) = (frame / stride, phases[frame % stride]);
                for i in 0..4 {
                    for j in 0..=i {
                        factor[first + i][i - j] += weights[i] * weights[j];
                    }
                }
            }
            for first in 0..count.saturating_sub(2) {
                let line = [1.0, -2.0, 1.0];
                for i in 0..3 {
                    for j in 0..=i {
                        factor[first + i][i - j] += STIFFNESS * line[i] * line[j];
                    }
                }
            }
            // Banded Cholesky (Golub and Van Loan, "Matrix Computations", §4.3.5), rows of the lower factor.
            for row in 0..count {
                for below in (0..=row.min(3)).rev() {
                    let column = row - below;
                    let mut sum = factor[row][below];
                    for k in below + 1..=3 {
                        if k <= row {
                            sum -= factor[row][k] * factor[column][k - below];
                        }
                    }
                    factor[row][below] =
                        if below == 0 { sum.max(1e-300).sqrt() } else { sum / factor[column][0] };
                }
            }
        }
        Solver { stride, phases, factor }
    }

    fn solve(&self, values: &[[f64; 4]]) -> Vec<[f64; 4]> {
        if self.stride == 1 {
            return values.to_vec();
        }
        let l = &self.factor;
        let mut x = vec![[0.0f64; 4]; l.len()];
        for (frame, value) in values.iter().enumerate() {
            let (first, weights) = (frame / self.stride, self.phases[frame % self.stride]);
            for (i, weight) in weights.iter().enumerate() {
                (0..4).for_each(|c| x[first + i][c] += weight * value[c]);
            }
        }
        for row in 0..x.len() {
            for k in 1..=row.min(3) {
                let known = x[row - k];
                (0..4).for_each(|c| x[row][c] -= l[row][k] * known[c]);
            }
            (0..4).for_each(|c| x[row][c] /= l[row][0]);
        }
        for row in (0..x.len()).rev() {
            for k in 1..=(x.len() - 1 - row).min(3) {
                let known = x[row + k];
                (0..4).for_each(|c| x[row][c] -= l[row + k][k] * known[c]);
            }
            (0..4).for_each(|c| x[row][c] /= l[row][0]);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Splines of degree 3 hold polynomials of degree 3, whatever the stride and the number of frames.
    #[test]
    fn cubic_polynomials_are_fitted_exactly() {
        for frames in [2, 3, 9, 17, 100] {
            let poly = |i: usize| {
                let t = i as f64 / 20.0;
                [1.0 + t, t * t, 0.5 - t * t * t, t * t * t - 2.0 * t]
            };
            let values: Vec<[f64; 4]> = (0..frames).map(poly).collect();
            for stride in STRIDES {
                let knots = Solver::new(frames, stride).solve(&values);
                assert_eq!(knots.len(), knot_count(frames, stride));
                let worst = largest_spline_error(Path::Translation, stride, &knots, &values);
                assert!(worst < 1e-5, "{frames} frames, stride {stride}: {worst}");
            }
        }
    }

    #[test]
    fn values_that_alternate_have_a_large_spline_error() {
        let values: Vec<[f64; 4]> = (0..40).map(|i| [f64::from(i % 2), 0.0, 0.0, 0.0]).collect();
        let knots = Solver::new(40, 4).solve(&values);
        assert!(largest_spline_error(Path::Translation, 4, &knots, &values) > 0.4);
    }
}
