//! An arm or a leg: two bones, in closed form.

use crate::math::rotation::rotation_between;
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Turns a limb of two bones so that its end comes to a target. All in one space; metres.
///
/// The triangle of shoulder, elbow and hand is given by its three sides (the law of cosines); it is laid towards the target, and
/// turned about that line so that the elbow keeps its side, or goes to the side of the pole.
///
/// Within 6 % of the limb's length from the start (`CORE`) the hand leaves the target, and the limb swings around at an even pace instead of turning over at once: where a
/// target goes straight through the shoulder at 0.1 m/s, the elbow of an arm goes at up to 5.3 m/s. No limb follows every target without a jump: those left are one point of
/// that core, and directions 13° to either side of the one opposite to where the limb points.
#[derive(Clone, Copy, Debug)]
pub struct TwoBone {
    /// Shoulder or hip.
    pub start: DVec3,
    /// Elbow or knee.
    pub middle: DVec3,
    /// Hand or foot.
    pub end: DVec3,
    /// Target of the end.
    pub target: DVec3,
    /// A point that the elbow bends towards. One in line with start and target gives no direction.
    pub pole: Option<DVec3>,
    /// Direction that a straight limb bends to, where there is no pole; zero: any, always the same.
    pub hint: DVec3,
    /// Share of the reach, 0..=1, within which the limb slows down instead of snapping straight: its end falls behind a target
    /// that moves out of reach, smoothly. So does a limb of unequal bones that folds: its end comes no nearer than their difference.
    pub soft: f64,
}

/// Radius of the core in lengths of the limb: 33 mm of an arm, less than a shoulder is thick. The elbow is slower the wider it is.
const CORE: f64 = 0.06;
/// Share of the bend direction in the way that the limb swings within the core, beside the direction in which it points: a straight way
/// through the start is hardly along it.
const BY_WAY: f64 = 0.6;
/// Cosines of the directions, against the one in which the limb points, from and to which the plane of its bend stays instead of being turned
/// on the shortest way, which has no axis for half a turn: 162° and 174°.
const STAYING: [f64; 2] = [-0.951, -0.9945];

/// How the two bones are turned in the space of the positions, each about its own start, and where the end comes to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoBoneSolution {
    /// Turn of the first joint.
    pub start: DQuat,
    /// Turn of the middle joint.
    pub middle: DQuat,
    /// Position of the middle joint then.
    pub new_middle: DVec3,
    /// Position of the end then.
    pub new_end: DVec3,
}

impl TwoBone {
    /// `None` where there is nothing to turn: a bone without length, or a number that is not finite.
    pub fn solve(&self) -> Option<TwoBoneSolution> {
        let (upper, lower) = (self.middle - self.start, self.end - self.middle);
        let (a, b) = (upper.length(), lower.length());
        let wanted = (self.target - self.start).length();
        if !(a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite() && wanted.is_finite()) {
            return None;
        }
        let distance = soft_distance(wanted, [(a - b).abs(), a + b], self.soft);
        let before = self.end - self.start;
        let line = before.try_normalize().unwrap_or_else(|| upper.any_orthonormal_vector().normalize());
        let across = |v: DVec3, line: DVec3| {
            let v_across = v - line * v.dot(line);
            // f32 poses are as straight as this; what is less is rounding, which has a direction too, but means nothing.
            (v_across.length() > 1e-5 * v.length()).then(|| v_across.normalize())
        };
        let pole = |line| self.pole.and_then(|p| across(p - self.start, line));
        let bend = across(upper, line).or_else(|| pole(line)).or_else(|| across(self.hint, line));
        let bend = bend.unwrap_or_else(|| line.any_orthonormal_vector());
        let towards = direction(self.target - self.start, CORE * (a + b), line + bend * BY_WAY);
        let normal = bend.cross(line);
        let kept = || across(towards.cross(carried(normal, line, towards)), towards);
        let new_bend = pole(towards).or_else(kept)?;
        // The angle at the start joint, between the line to the end and the upper bone.
        // With equal bones rounding remains, which is large beside a short distance.
        let unlike = if (a - b).abs() > 1e-9 * (a + b) { a * a - b * b } else { 0.0 };
        let cos = if distance > 0.0 {
            ((unlike + distance * distance) / (2.0 * a * distance)).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let new_middle = self.start + (towards * cos + new_bend * sin) * a;
        let new_end = self.start + towards * distance;
        let new_normal = new_bend.cross(towards);
        let start = turn(upper, normal, new_middle - self.start, new_normal)?;
        // Folded onto itself the lower bone runs back along the upper.
        let new_lower = new_end - new_middle;
        let middle = turn(lower, normal, new_lower, new_normal)?;
        (start.is_finite() && middle.is_finite()).then_some(TwoBoneSolution {
            start,
            middle,
            new_middle,
            new_end,
        })
    }
}

/// Direction of a target, continuous but for one point: within the core it leans to `by_way`, and is that at the start itself. A target that
/// passes through the start at right angles to that way turns it evenly, half a turn over the width of the core.
fn direction(target: DVec3, core: f64, by_way: DVec3) -> DVec3 {
    let from_start = target.length();
    // The tangent is meaningless at 0 and beyond the core.
    let lean = match FRAC_PI_2 * from_start / core {
        angle if angle >= FRAC_PI_2 => 0.0,
        angle if angle < 1e-9 => core / FRAC_PI_2,
        angle => from_start / libm::tan(angle),
    };
    (target + by_way.normalize() * lean).try_normalize().unwrap_or_else(|| by_way.normalize())
}

/// The normal of the bend for a new direction: turned as the direction is, but where that is nearly half a turn as near to what it was as
/// may be, so that rounding does not choose the axis.
fn carried(normal: DVec3, line: DVec3, towards: DVec3) -> DVec3 {
    let turned = rotation_between(line, towards) * normal;
    let share = ((STAYING[0] - line.dot(towards)) / (STAYING[0] - STAYING[1])).clamp(0.0, 1.0);
    let share = share * share * (3.0 - 2.0 * share);
    let stays = normal - towards * normal.dot(towards);
    let mixed = turned.lerp(stays.try_normalize().unwrap_or(turned), share);
    mixed.try_normalize().unwrap_or(turned)
}

/// The rotation that brings a direction and a normal of it to another direction and its normal.
fn turn(from: DVec3, normal: DVec3, to: DVec3, new_normal: DVec3) -> Option<DQuat> {
    let frame = |x: DVec3, z: DVec3| {
        let x = x.try_normalize()?;
        let z = (z - x * x.dot(z)).try_normalize()?;
        Some(DMat3::from_cols(x, z.cross(x), z))
    };
    let (before, after) = (frame(from, normal)?, frame(to, new_normal)?);
    Some(DQuat::from_mat3(&(after * before.transpose())).normalize())
}

/// How far the end goes for a target at a distance: there, up to `reach · (1 − soft)`; from there on it comes ever nearer to the
/// whole reach, at the same speed at first, and never gets there. The same towards the nearest that it can be.
fn soft_distance(wanted: f64, [nearest, reach]: [f64; 2], soft: f64) -> f64 {
    let softness = reach * soft.clamp(0.0, 1.0);
    let at_start = softness.min(0.5 * nearest);
    let (inner, hard) = (nearest + at_start, reach - softness);
    let gone = if softness > 0.0 && wanted > hard {
        reach - softness * libm::exp((hard - wanted) / softness)
    } else if at_start > 0.0 && wanted < inner {
        nearest + at_start * libm::exp((wanted - inner) / at_start)
    } else {
        wanted
    };
    gone.clamp(nearest, reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soft_reach_has_no_corner_and_no_end() {
        let at = |d: f64| soft_distance(d, [0.0, 1.0], 0.2);
        assert_eq!((at(0.5), at(0.8)), (0.5, 0.8));
        let slope = |d: f64| (at(d + 1e-7) - at(d - 1e-7)) / 2e-7;
        assert!((slope(0.8) - 1.0).abs() < 1e-5 && slope(1.0) < 0.5);
        assert!(at(1.0) < 1.0 && at(50.0) <= 1.0 && at(50.0) > 0.999);
        assert_eq!(soft_distance(3.0, [0.0, 1.0], 0.0), 1.0);
        // The same where it folds, over half as far as it can be folded at most.
        let at = |d: f64| soft_distance(d, [0.2, 1.0], 0.2);
        let slope = |d: f64| (at(d + 1e-7) - at(d - 1e-7)) / 2e-7;
        assert!((slope(0.3) - 1.0).abs() < 1e-5 && slope(0.2) < 0.5 && at(0.0) > 0.2 && at(0.35) == 0.35);
        assert_eq!(soft_distance(0.1, [0.2, 1.0], 0.0), 0.2);
    }
}
