//! Several curves over their common key times, and a part of a node's transform computed from them: values, slopes, and the
//! largest error of a cubic that has these values and slopes.

use crate::curve::Piece;
use crate::local::{EulerRotation, HALF_RAD, LocalTransform};
use choreo_motion::{Path, Time};
use glam::DVec3;

/// Relative difference below which two values are no jump.
const JUMP_TOLERANCE: f64 = 1e-9;

/// Polynomials of several curves over shared intervals. A gap between two intervals is a jump of all curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct JoinedCurves {
    pub intervals: Vec<(Time, Time)>,
    /// Polynomials of each interval, one for each curve.
    pieces: Vec<[f64; 4]>,
    curve_count: usize,
}

impl JoinedCurves {
    /// Joins curves without gaps, as [`crate::curve::pieces`] makes them.
    pub(crate) fn new(curves: &[&[Piece]]) -> JoinedCurves {
        let width = curves.len();
        let mut out = JoinedCurves { curve_count: width, ..JoinedCurves::default() };
        let mut at = vec![0; width];
        let mut from = Time::ZERO;
        let mut jumps_after_key = false;
        while let Some(to) = curves.iter().zip(&at).map(|(c, i)| c.get(*i).map(|p| p.to)).min().flatten() {
            out.push(from, to, jumps_after_key, curves.iter().zip(&at).map(|(c, i)| c[*i].part(from, to).c));
            let (mut before, mut after) = (false, false);
            for (curve, i) in curves.iter().zip(&mut at) {
                let done = curve[*i];
                if done.to > to {
                    continue;
                }
                *i += 1;
                let Some(next) = curve.get(*i) else { continue };
                let (a, b) = (done.end(), next.start());
                if (a - b).abs() > JUMP_TOLERANCE * (1.0 + a.abs() + b.abs()) {
                    *(if next.jumps_after_key { &mut after } else { &mut before }) = true;
                }
            }
            // A jump takes one tick (1.4 ns): before the key, or after it where the old value still holds at the key.
            jumps_after_key = after && !before;
            if before && let Some(last) = out.intervals.last_mut() {
                last.1 = Time(last.1.0 - 1);
            }
            from = to;
        }
        out.remove_empty_intervals();
        out
    }

    fn push(&mut self, from: Time, to: Time, jumps_after_key: bool, pieces: impl Iterator<Item = [f64; 4]>) {
        self.intervals.push((if jumps_after_key { Time(from.0 + 1) } else { from }, to));
        self.pieces.extend(pieces);
    }

    /// Removes intervals that jumps have left without length.
    fn remove_empty_intervals(&mut self) {
        let kept = |i: &(Time, Time)| i.1.0 - i.0.0 > 1;
        if self.intervals.iter().all(kept) {
            return;
        }
        let pairs = self.intervals.iter().zip(self.pieces.chunks_exact(self.curve_count));
        self.pieces = pairs.filter(|(i, _)| kept(i)).flat_map(|(_, c)| c).copied().collect();
        self.intervals.retain(kept);
    }

    pub(crate) fn is_constant(&self) -> bool {
        let Some(first) = self.pieces.get(..self.curve_count) else { return true };
        let flat = |c: &[f64; 4], first: &[f64; 4]| c[0] == first[0] && c[1..] == [0.0; 3];
        self.pieces.chunks_exact(self.curve_count).all(|row| row.iter().zip(first).all(|(c, f)| flat(c, f)))
    }

    /// A function of three consecutive curves in an interval.
    fn vector(&self, interval: usize, first: usize, component: impl Fn(&[f64; 4]) -> f64) -> DVec3 {
        let at = interval * self.curve_count + first;
        let c = &self.pieces[at..at + 3];
        DVec3::new(component(&c[0]), component(&c[1]), component(&c[2]))
    }

    fn value(&self, interval: usize, first: usize, u: f64) -> DVec3 {
        self.vector(interval, first, |c| c[0] + u * (c[1] + u * (c[2] + u * c[3])))
    }

    fn slope(&self, interval: usize, first: usize, u: f64) -> DVec3 {
        self.vector(interval, first, |c| c[1] + u * (2.0 * c[2] + u * (3.0 * c[3])))
    }

    /// Three numbers or fewer, each mapped by a function that also returns its derivative: values, and changes over the interval.
    pub(crate) fn numbers(
        &self,
        interval: usize,
        u: f64,
        map: impl Fn(f64) -> (f64, f64),
    ) -> ([f64; 4], [f64; 4]) {
        let (mut values, mut changes) = ([0.0; 4], [0.0; 4]);
        for (k, c) in self.pieces[interval * self.curve_count..][..self.curve_count].iter().enumerate() {
            let (value, slope) = map(c[0] + u * (c[1] + u * (c[2] + u * c[3])));
            values[k] = value;
            changes[k] = slope * (c[1] + u * (2.0 * c[2] + u * (3.0 * c[3])));
        }
        (values, changes)
    }

    /// Bounds of three curves and their derivatives over an interval, axis by axis.
    fn bounds_by_axis(&self, interval: usize, first: usize) -> Bounds {
        [
            self.vector(interval, first, |c| c[0].abs() + c[1].abs() + c[2].abs() + c[3].abs()),
            self.vector(interval, first, |c| c[1].abs() + 2.0 * c[2].abs() + 3.0 * c[3].abs()),
            self.vector(interval, first, |c| 2.0 * c[2].abs() + 6.0 * c[3].abs()),
            self.vector(interval, first, |c| 6.0 * c[3].abs()),
            DVec3::ZERO,
        ]
    }

    /// Bounds of the first three derivatives over an interval, summed over the three curves.
    fn bounds(&self, interval: usize, first: usize, unit: f64) -> [f64; 3] {
        let sum = |v: DVec3| (v.x + v.y + v.z) * unit;
        [
            sum(self.vector(interval, first, |c| c[1].abs() + 2.0 * c[2].abs() + 3.0 * c[3].abs())),
            sum(self.vector(interval, first, |c| 2.0 * c[2].abs() + 6.0 * c[3].abs())),
            sum(self.vector(interval, first, |c| 6.0 * c[3].abs())),
        ]
    }
}

/// Bounds of the first four derivatives of eⁱᵃ from those of a (complete Bell polynomials; a cubic has no fourth derivative), and
/// so of products of rotations whose angles add up to a.
fn exponential_derivative_bounds([a, b, c]: [f64; 3]) -> [f64; 4] {
    [a, a * a + b, a * a * a + 3.0 * a * b + c, a * a * a * a + 6.0 * a * a * b + 3.0 * b * b + 4.0 * a * c]
}

/// One animated part of a node's transform: translation, rotation or scale.
pub(crate) struct TransformPart<'a> {
    pub joint: u32,
    pub path: Path,
    pub local: &'a LocalTransform,
    /// Three curves of the part itself, then those whose first indices the next three fields hold.
    pub curves: JoinedCurves,
    /// First rotation curve and first scale curve, for a translation that swings about a pivot.
    pub rotation_curve: Option<usize>,
    pub scale_curve: Option<usize>,
    /// First curves of the inherited scales that multiply the part.
    pub factors: Vec<usize>,
    /// Rotation (degrees) and scale where they have no curves.
    pub rest: [DVec3; 2],
}

/// Bounds of a value and its first four derivatives, axis by axis.
type Bounds = [DVec3; 5];

/// Bounds of a product, by Leibniz's rule.
fn product_bounds(a: &Bounds, b: &Bounds) -> Bounds {
    const BINOMIAL: [[f64; 5]; 5] = [
        [1.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0, 0.0, 0.0],
        [1.0, 2.0, 1.0, 0.0, 0.0],
        [1.0, 3.0, 3.0, 1.0, 0.0],
        [1.0, 4.0, 6.0, 4.0, 1.0],
    ];
    std::array::from_fn(|n| (0..=n).map(|k| a[k] * b[n - k] * BINOMIAL[n][k]).sum())
}

/// Cache of the latest Euler rotation: neighboring intervals share their end angles.
#[derive(Default)]
pub(crate) struct RotationCache(Option<(DVec3, EulerRotation)>);

impl RotationCache {
    fn euler_rotation(&mut self, local: &LocalTransform, degrees: DVec3) -> EulerRotation {
        match self.0 {
            Some((known, turn)) if known == degrees => turn,
            _ => {
                let turn = local.euler_rotation(degrees);
                self.0 = Some((degrees, turn));
                turn
            }
        }
    }
}

impl TransformPart<'_> {
    /// The exact value and its change over the interval, at a position `u` in the interval.
    pub(crate) fn at(&self, interval: usize, u: f64, latest: &mut RotationCache) -> ([f64; 4], [f64; 4]) {
        let (mut value, mut slope) = self.value_and_slope(interval, 0, u);
        for first in &self.factors {
            let (factor, change) = self.value_and_slope(interval, *first, u);
            (value, slope) = (value * factor, slope * factor + value * change);
        }
        let local = self.local;
        let to_four = |v: DVec3| [v.x, v.y, v.z, 0.0];
        match self.path {
            Path::Rotation => {
                let turn = latest.euler_rotation(local, value);
                (local.rotation_of(&turn).to_array(), local.rotation_rate(&turn, slope).to_array())
            }
            Path::Scale => (to_four(local.scale_at(value)), to_four(local.scale_at(slope))),
            _ => {
                let other = |first: Option<usize>, rest| match first {
                    Some(first) => self.value_and_slope(interval, first, u),
                    None => (rest, DVec3::ZERO),
                };
                let (turned, turning) = other(self.rotation_curve, self.rest[0]);
                let (scale, scaling) = other(self.scale_curve, self.rest[1]);
                let turn = latest.euler_rotation(local, turned);
                let at = local.translation_at(value, &turn, scale);
                (to_four(at), to_four(local.translation_rate((&turn, scale), (slope, turning, scaling))))
            }
        }
    }

    /// The value of a part whose curves never change.
    pub(crate) fn at_start(&self) -> ([f64; 4], [f64; 4]) {
        self.at(0, 0.0, &mut RotationCache::default())
    }

    fn value_and_slope(&self, interval: usize, first: usize, u: f64) -> (DVec3, DVec3) {
        (self.curves.value(interval, first, u), self.curves.slope(interval, first, u))
    }

    /// Largest error, in radians or metres, of a cubic Hermite curve with this part's values and slopes at both ends of an
    /// interval: f⁗/384. Division into n parts reduces it by n⁴.
    pub(crate) fn cubic_error(&self, interval: usize) -> f64 {
        match self.path {
            // The chord between two quaternions is half the angle of rotation.
            Path::Rotation => {
                2.0 * exponential_derivative_bounds(self.curves.bounds(interval, 0, HALF_RAD))[3] / 384.0
            }
            Path::Scale => {
                self.local.scale_at(self.scaled_derivative_bound(interval)).abs().max_element() / 384.0
            }
            _ => {
                (self.scaled_derivative_bound(interval).length() * self.local.metres()
                    + self.swing_bound(interval))
                    / 384.0
            }
        }
    }

    /// Bound of the fourth derivative of the part's own value, in the file's units; zero unless inherited scales multiply it.
    fn scaled_derivative_bound(&self, interval: usize) -> DVec3 {
        if self.factors.is_empty() {
            return DVec3::ZERO;
        }
        let own = self.curves.bounds_by_axis(interval, 0);
        let of =
            |all: Bounds, first: &usize| product_bounds(&all, &self.curves.bounds_by_axis(interval, *first));
        self.factors.iter().fold(own, of)[4]
    }

    /// Bound of the fourth derivative of the swing about a pivot, in metres.
    fn swing_bound(&self, interval: usize) -> f64 {
        let Some(turned) = self.rotation_curve else { return 0.0 };
        let r = exponential_derivative_bounds(self.curves.bounds(interval, turned, 2.0 * HALF_RAD));
        let arm = self.local.scaled_lever_arm_metres();
        let Some(scaled) = self.scale_curve else {
            return self.local.lever_arm_metres(self.rest[1]) * r[3];
        };
        let s = self.curves.bounds(interval, scaled, 1.0);
        let widest = self.curves.value(interval, scaled, 0.0).abs() + DVec3::splat(s[0]);
        let swing = self.local.lever_arm_metres(DVec3::ZERO) + arm * widest.length();
        // Leibniz's rule for a swing that changes with the scale, times a rotation.
        swing * r[3] + arm * (4.0 * s[0] * r[2] + 6.0 * s[1] * r[1] + 4.0 * s[2] * r[0])
    }
}
