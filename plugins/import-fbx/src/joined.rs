//! Several curves on the key times of all of them, and a node's transform over them: values, slopes, and how far a cubic
//! through both may be off.

use crate::curve::Piece;
use crate::local::{HALF_RAD, Local, Turn};
use choreo_motion::{Path, Time};
use glam::DVec3;

/// Degrees, units of the file: less is no jump.
const JUMP: f64 = 1e-9;

/// Polynomials of several curves at shared times. Where one interval does not begin where the last ended, all jump.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joined {
    pub intervals: Vec<(Time, Time)>,
    /// Of each interval, one for each curve.
    pieces: Vec<[f64; 4]>,
    width: usize,
}

impl Joined {
    /// Curves without gaps, as [`crate::curve::pieces`] gives them.
    pub fn new(curves: &[&[Piece]]) -> Joined {
        let width = curves.len();
        let mut out = Joined { width, ..Joined::default() };
        let mut at = vec![0; width];
        let mut from = Time::ZERO;
        let mut late = false;
        while let Some(to) = curves.iter().zip(&at).map(|(c, i)| c.get(*i).map(|p| p.to)).min().flatten() {
            out.push(from, to, late, curves.iter().zip(&at).map(|(c, i)| c[*i].part(from, to).c));
            let (mut before, mut after) = (false, false);
            for (curve, i) in curves.iter().zip(&mut at) {
                let done = curve[*i];
                if done.to > to {
                    continue;
                }
                *i += 1;
                let Some(next) = curve.get(*i) else { continue };
                let (a, b) = (done.end(), next.start());
                if (a - b).abs() > JUMP * (1.0 + a.abs() + b.abs()) {
                    *(if next.late { &mut after } else { &mut before }) = true;
                }
            }
            // A jump takes one tick, 1.4 ns: before the key, or after it where the old value holds at the key.
            late = after && !before;
            if before && let Some(last) = out.intervals.last_mut() {
                last.1 = Time(last.1.0 - 1);
            }
            from = to;
        }
        out.drop_empty();
        out
    }

    fn push(&mut self, from: Time, to: Time, late: bool, pieces: impl Iterator<Item = [f64; 4]>) {
        self.intervals.push((if late { Time(from.0 + 1) } else { from }, to));
        self.pieces.extend(pieces);
    }

    /// What jumps have left no room for.
    fn drop_empty(&mut self) {
        let kept = |i: &(Time, Time)| i.1.0 - i.0.0 > 1;
        if self.intervals.iter().all(kept) {
            return;
        }
        let pairs = self.intervals.iter().zip(self.pieces.chunks_exact(self.width));
        self.pieces = pairs.filter(|(i, _)| kept(i)).flat_map(|(_, c)| c).copied().collect();
        self.intervals.retain(kept);
    }

    pub fn is_constant(&self) -> bool {
        let Some(first) = self.pieces.get(..self.width) else { return true };
        let flat = |c: &[f64; 4], first: &[f64; 4]| c[0] == first[0] && c[1..] == [0.0; 3];
        self.pieces.chunks_exact(self.width).all(|row| row.iter().zip(first).all(|(c, f)| flat(c, f)))
    }

    /// Three curves at once.
    fn vector(&self, interval: usize, first: usize, of: impl Fn(&[f64; 4]) -> f64) -> DVec3 {
        let at = interval * self.width + first;
        let c = &self.pieces[at..at + 3];
        DVec3::new(of(&c[0]), of(&c[1]), of(&c[2]))
    }

    fn value(&self, interval: usize, first: usize, u: f64) -> DVec3 {
        self.vector(interval, first, |c| c[0] + u * (c[1] + u * (c[2] + u * c[3])))
    }

    fn slope(&self, interval: usize, first: usize, u: f64) -> DVec3 {
        self.vector(interval, first, |c| c[1] + u * (2.0 * c[2] + u * (3.0 * c[3])))
    }

    /// Bounds of the first three derivatives over an interval, the three curves added up.
    fn bounds(&self, interval: usize, first: usize, unit: f64) -> [f64; 3] {
        let sum = |v: DVec3| (v.x + v.y + v.z) * unit;
        [
            sum(self.vector(interval, first, |c| c[1].abs() + 2.0 * c[2].abs() + 3.0 * c[3].abs())),
            sum(self.vector(interval, first, |c| 2.0 * c[2].abs() + 6.0 * c[3].abs())),
            sum(self.vector(interval, first, |c| 6.0 * c[3].abs())),
        ]
    }
}

/// Fourth derivative of eⁱᵃ by those of a (the complete Bell polynomial of degree 4; a cubic has no fourth of its own), and so
/// a bound for products of rotations by angles that add up to a.
fn bell([a, b, c]: [f64; 3]) -> [f64; 4] {
    [a, a * a + b, a * a * a + 3.0 * a * b + c, a * a * a * a + 6.0 * a * a * b + 3.0 * b * b + 4.0 * a * c]
}

/// One moving part of a node's transform.
pub struct Member<'a> {
    pub joint: u32,
    pub path: Path,
    pub local: &'a Local,
    /// Three curves; of a translation that swings about a pivot also those of the rotation, and of the scale.
    pub curves: Joined,
    /// For members of fewer curves, the values of the others at rest.
    pub rest: [DVec3; 3],
}

/// The angles that were turned last, as neighbouring intervals share theirs.
#[derive(Default)]
pub struct Latest(Option<(DVec3, Turn)>);

impl Latest {
    fn turn(&mut self, local: &Local, degrees: DVec3) -> Turn {
        match self.0 {
            Some((known, turn)) if known == degrees => turn,
            _ => {
                let turn = local.turn(degrees);
                self.0 = Some((degrees, turn));
                turn
            }
        }
    }
}

impl Member<'_> {
    /// Value and change (an interval), the file's own, at a place in an interval.
    pub fn at(&self, interval: usize, u: f64, latest: &mut Latest) -> ([f64; 4], [f64; 4]) {
        let (value, slope) = (self.curves.value(interval, 0, u), self.curves.slope(interval, 0, u));
        let local = self.local;
        let wide = |v: DVec3| [v.x, v.y, v.z, 0.0];
        match self.path {
            Path::Rotation => {
                let turn = latest.turn(local, value);
                (local.rotation_of(&turn).to_array(), local.rotation_rate(&turn, slope).to_array())
            }
            Path::Scale => (wide(local.scale_at(value)), wide(local.scale_at(slope))),
            _ => {
                let (turned, turning) = self.other(3, interval, u, self.rest[1]);
                let (scale, scaling) = self.other(6, interval, u, self.rest[2]);
                let turn = latest.turn(local, turned);
                let at = local.translation_at(value, &turn, scale);
                (wide(at), wide(local.translation_rate((&turn, scale), (slope, turning, scaling))))
            }
        }
    }

    /// Of curves that never change.
    pub fn at_start(&self) -> ([f64; 4], [f64; 4]) {
        self.at(0, 0.0, &mut Latest::default())
    }

    fn other(&self, first: usize, interval: usize, u: f64, rest: DVec3) -> (DVec3, DVec3) {
        match self.curves.width > first {
            true => (self.curves.value(interval, first, u), self.curves.slope(interval, first, u)),
            false => (rest, DVec3::ZERO),
        }
    }

    /// Radians or metres by which a cubic Hermite curve with this member's values and slopes at both ends of an interval can
    /// be off between them: f⁗/384. Cut into n, it falls by n⁴.
    pub fn cubic_error(&self, interval: usize) -> f64 {
        match self.path {
            // A quaternion's chord is half the angle.
            Path::Rotation => 2.0 * bell(self.curves.bounds(interval, 0, HALF_RAD))[3] / 384.0,
            Path::Translation if self.curves.width > 3 => {
                let r = bell(self.curves.bounds(interval, 3, 2.0 * HALF_RAD));
                let scaled = self.local.scaled_swing_metres();
                let (widest, s) = match self.curves.width > 6 {
                    true => {
                        let s = self.curves.bounds(interval, 6, 1.0);
                        (self.curves.value(interval, 6, 0.0).abs() + DVec3::splat(s[0]), s)
                    }
                    false => (self.rest[2], [0.0; 3]),
                };
                let swing = self.local.swing_metres(DVec3::ZERO) + scaled * widest.length();
                let swing = if self.curves.width > 6 { swing } else { self.local.swing_metres(widest) };
                // The product of a swing that changes with the scale, and a rotation.
                let mixed = 4.0 * s[0] * r[2] + 6.0 * s[1] * r[1] + 4.0 * s[2] * r[0];
                (swing * r[3] + scaled * mixed) / 384.0
            }
            _ => 0.0,
        }
    }
}
