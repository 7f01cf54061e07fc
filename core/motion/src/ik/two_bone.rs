//! Two-bone inverse kinematics, for an arm or a leg, in closed form.

use crate::math::rotation::rotation_between;
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Turns a limb of two bones so that its end reaches a target. All positions are in one space, metres.
///
/// The law of cosines gives the triangle of shoulder, elbow and hand. It is laid towards the target and turned about that line so
/// that the elbow keeps its side, or bends towards the pole.
///
/// A target within 6 % of the limb's length from the start (`CORE_RADIUS_LENGTHS`) is not reached exactly: the limb swings around at an even
/// pace instead of flipping at once. If a target passes straight through the shoulder at 0.1 m/s, the elbow of an arm moves at up
/// to 5.3 m/s. No limb follows every target without a jump: jumps remain at one point of that core, and at directions 13° to
/// either side of the one opposite to where the limb points.
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
    /// Pole target: a point that the elbow bends towards. A pole in line with start and target gives no direction.
    pub pole: Option<DVec3>,
    /// Direction in which a straight limb without a pole bends; zero: any direction, always the same.
    pub hint: DVec3,
    /// Soft IK: share of the reach, 0..=1, within which the limb slows down instead of snapping straight; its end smoothly falls
    /// behind a target that moves out of reach. A limb of unequal bones also slows down as it folds, since its end comes no
    /// nearer to the start than their difference.
    pub soft: f64,
}

/// Radius of the core around the start, in lengths of the limb: 33 mm for an arm, less than a shoulder is thick. A wider core
/// slows the elbow.
const CORE_RADIUS_LENGTHS: f64 = 0.06;
/// Weight of the bend direction in the direction to which the limb leans within the core; the limb's own direction has weight 1.
/// Few straight paths of a target through the start run along the resulting direction.
const BEND_LEAN_WEIGHT: f64 = 0.6;
/// Cosines of the angles 162° and 174° by which a limb turns. Between them, the bend plane changes from turning with the limb, on
/// the shortest arc, to staying: a half turn has no unique shortest arc.
const BEND_PLANE_FADE_COS: [f64; 2] = [-0.951, -0.9945];

/// Rotations of the two bones in the space of the positions, each about its own start, and the resulting positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoBoneSolution {
    /// Rotation of the first joint.
    pub start: DQuat,
    /// Rotation of the middle joint.
    pub middle: DQuat,
    /// Position of the middle joint (elbow or knee) after solving.
    pub new_middle: DVec3,
    /// Position of the end effector (hand or foot) after solving.
    pub new_end: DVec3,
}

impl TwoBone {
    /// Solves the limb. `None` if a bone has no length, or a number is not finite.
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
            // A straight limb of an f32 pose deviates by up to this; a smaller deviation is rounding, whose direction means
            // nothing.
            (v_across.length() > 1e-5 * v.length()).then(|| v_across.normalize())
        };
        let pole = |line| self.pole.and_then(|p| across(p - self.start, line));
        let bend = across(upper, line).or_else(|| pole(line)).or_else(|| across(self.hint, line));
        let bend = bend.unwrap_or_else(|| line.any_orthonormal_vector());
        let towards = direction_through_core(
            self.target - self.start,
            CORE_RADIUS_LENGTHS * (a + b),
            line + bend * BEND_LEAN_WEIGHT,
        );
        let normal = bend.cross(line);
        let kept = || across(towards.cross(rotated_bend_normal(normal, line, towards)), towards);
        let new_bend = pole(towards).or_else(kept)?;
        // The angle at the start joint, between the line to the end and the upper bone.
        // Equal bones leave a rounding error, which is large relative to a short distance.
        let difference_of_squares = if (a - b).abs() > 1e-9 * (a + b) { a * a - b * b } else { 0.0 };
        let cos = if distance > 0.0 {
            ((difference_of_squares + distance * distance) / (2.0 * a * distance)).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let new_middle = self.start + (towards * cos + new_bend * sin) * a;
        let new_end = self.start + towards * distance;
        let new_normal = new_bend.cross(towards);
        let start = rotation_between_frames(upper, normal, new_middle - self.start, new_normal)?;
        // The lower bone of a limb that is folded onto itself runs back along the upper.
        let new_lower = new_end - new_middle;
        let middle = rotation_between_frames(lower, normal, new_lower, new_normal)?;
        (start.is_finite() && middle.is_finite()).then_some(TwoBoneSolution {
            start,
            middle,
            new_middle,
            new_end,
        })
    }
}

/// Direction of a target, continuous except at one point: within the core it leans towards `lean_direction`, and is
/// `lean_direction` at the start itself. As a target passes through the start at right angles to `lean_direction`, the direction
/// turns evenly, by half a turn over the width of the core.
fn direction_through_core(target: DVec3, core: f64, lean_direction: DVec3) -> DVec3 {
    let from_start = target.length();
    // The tangent is meaningless at 0 and beyond the core.
    let lean = match FRAC_PI_2 * from_start / core {
        angle if angle >= FRAC_PI_2 => 0.0,
        angle if angle < 1e-9 => core / FRAC_PI_2,
        angle => from_start / libm::tan(angle),
    };
    (target + lean_direction.normalize() * lean).try_normalize().unwrap_or_else(|| lean_direction.normalize())
}

/// Normal of the bend for a new direction: turned like the direction, but if that is nearly half a turn, kept as close to the old
/// normal as possible, so that rounding does not choose the axis.
fn rotated_bend_normal(normal: DVec3, line: DVec3, towards: DVec3) -> DVec3 {
    let turned = rotation_between(line, towards) * normal;
    let share = ((BEND_PLANE_FADE_COS[0] - line.dot(towards))
        / (BEND_PLANE_FADE_COS[0] - BEND_PLANE_FADE_COS[1]))
        .clamp(0.0, 1.0);
    let share = share * share * (3.0 - 2.0 * share);
    let stays = normal - towards * normal.dot(towards);
    let mixed = turned.lerp(stays.try_normalize().unwrap_or(turned), share);
    mixed.try_normalize().unwrap_or(turned)
}

/// The rotation that brings a direction and a normal of it to another direction and its normal.
fn rotation_between_frames(from: DVec3, normal: DVec3, to: DVec3, new_normal: DVec3) -> Option<DQuat> {
    let frame = |x: DVec3, z: DVec3| {
        let x = x.try_normalize()?;
        let z = (z - x * x.dot(z)).try_normalize()?;
        Some(DMat3::from_cols(x, z.cross(x), z))
    };
    let (before, after) = (frame(from, normal)?, frame(to, new_normal)?);
    Some(DQuat::from_mat3(&(after * before.transpose())).normalize())
}

/// Distance of the end for a target at distance `wanted`: the same up to `reach · (1 − soft)`; beyond that, it approaches the
/// whole reach exponentially, at the same speed at first, and never reaches it. It approaches `nearest` in the same way.
fn soft_distance(wanted: f64, [nearest, reach]: [f64; 2], soft: f64) -> f64 {
    let softness = reach * soft.clamp(0.0, 1.0);
    let at_start = softness.min(0.5 * nearest);
    let (inner, hard) = (nearest + at_start, reach - softness);
    let softened = if softness > 0.0 && wanted > hard {
        reach - softness * libm::exp((hard - wanted) / softness)
    } else if at_start > 0.0 && wanted < inner {
        nearest + at_start * libm::exp((wanted - inner) / at_start)
    } else {
        wanted
    };
    softened.clamp(nearest, reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soft_distance_is_smooth_and_never_reaches_its_limit() {
        let at = |d: f64| soft_distance(d, [0.0, 1.0], 0.2);
        assert_eq!((at(0.5), at(0.8)), (0.5, 0.8));
        let slope = |d: f64| (at(d + 1e-7) - at(d - 1e-7)) / 2e-7;
        assert!((slope(0.8) - 1.0).abs() < 1e-5 && slope(1.0) < 0.5);
        assert!(at(1.0) < 1.0 && at(50.0) <= 1.0 && at(50.0) > 0.999);
        assert_eq!(soft_distance(3.0, [0.0, 1.0], 0.0), 1.0);
        // The distance is as smooth where the limb folds, over half of the smallest distance.
        let at = |d: f64| soft_distance(d, [0.2, 1.0], 0.2);
        let slope = |d: f64| (at(d + 1e-7) - at(d - 1e-7)) / 2e-7;
        assert!((slope(0.3) - 1.0).abs() < 1e-5 && slope(0.2) < 0.5 && at(0.0) > 0.2 && at(0.35) == 0.35);
        assert_eq!(soft_distance(0.1, [0.2, 1.0], 0.0), 0.2);
    }
}
