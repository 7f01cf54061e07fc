//! How eyes follow a target: VRM 1.0, "lookAt.md", and `firstPerson` of VRM 0.x.

use crate::expression::Expression;
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_PI_2;

/// Expressions without binds that every character with [`Eyes`] has: clips and scripts set the gaze direction by their weights,
/// as `lookAt` of a VRM animation does. Left and right are the head's own; weight 1 is a right angle.
pub const GAZE: [&str; 4] = ["gazeLeft", "gazeRight", "gazeUp", "gazeDown"];

/// How far a character's eyes turn, as specified by its file. The direction to the target is measured as yaw and pitch from the
/// head's forward direction at `offset_from_head`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// Position of the eyes in the head joint's space, metres.
    pub offset_from_head: Vec3,
    /// Whether bones or expressions move the eyes.
    pub moved_by: EyesMovedBy,
    /// Turn towards the nose.
    pub inner: RangeMap,
    /// Turn away from the nose.
    pub outer: RangeMap,
    /// Turn downwards.
    pub down: RangeMap,
    /// Turn upwards.
    pub up: RangeMap,
}

/// The parts of a character that move the eyes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EyesMovedBy {
    /// The bones `leftEye` and `rightEye`; a [`RangeMap`]'s output is an angle.
    Bones,
    /// The expressions lookLeft, lookRight, lookUp, lookDown; a [`RangeMap`]'s output is a weight.
    Expressions,
}

impl Eyes {
    /// Rotation of the left or right eye towards a target: yaw to the head's left and pitch up, radians. `way`: direction of the
    /// target in head space (+Z forward, +Y up, +X to the head's left). Only for eyes that are [`EyesMovedBy::Bones`].
    pub fn turn_of(&self, left: bool, way: DVec3) -> (f64, f64) {
        let (yaw, pitch) = angles_of(way);
        self.turn_by(left, yaw, pitch)
    }

    /// Rotation of an eye like [`Eyes::turn_of`], for a direction given as yaw and pitch in radians.
    pub fn turn_by(&self, left: bool, yaw: f64, pitch: f64) -> (f64, f64) {
        let outwards = (yaw > 0.0) == left;
        let sideways = if outwards { &self.outer } else { &self.inner };
        let upright = if pitch > 0.0 { &self.up } else { &self.down };
        (sideways.map(yaw.abs()).copysign(yaw), upright.map(pitch.abs()).copysign(pitch))
    }
}

/// Yaw to the left (+X) and pitch up, radians, of a direction in head space.
pub fn angles_of(way: DVec3) -> (f64, f64) {
    (libm::atan2(way.x, way.z), libm::atan2(way.y, libm::hypot(way.x, way.z)))
}

/// Yaw to the left and pitch up, radians, that the weights of [`GAZE`] request; `None` if both are 0.
pub fn requested(expressions: &[Expression], weights: &[f32]) -> Option<(f64, f64)> {
    let (mut yaw, mut pitch) = (0.0, 0.0);
    for (expression, weight) in expressions.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
        let angle = f64::from(weight.min(1.0)) * FRAC_PI_2;
        match GAZE.iter().position(|name| *name == expression.name) {
            Some(0) => yaw += angle,
            Some(1) => yaw -= angle,
            Some(2) => pitch += angle,
            Some(3) => pitch -= angle,
            _ => {}
        }
    }
    (yaw != 0.0 || pitch != 0.0).then_some((yaw, pitch))
}

impl RangeMap {
    /// Maps an angle ≥ 0, in radians, to an angle in radians or a weight.
    pub fn map(&self, angle: f64) -> f64 {
        let input_max = f64::from(self.input_max);
        if input_max > 0.0 { (angle / input_max).clamp(0.0, 1.0) * f64::from(self.output_scale) } else { 0.0 }
    }
}

/// output = clamp(angle, 0, `input_max`) / `input_max` · `output_scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeMap {
    /// Angle at which the output is largest, radians.
    pub input_max: f32,
    /// Largest output, in radians or as a weight.
    pub output_scale: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eye_rotations_follow_the_range_maps() {
        let map = |input_max: f32, output: f32| RangeMap {
            input_max: input_max.to_radians(),
            output_scale: output.to_radians(),
        };
        let eyes = Eyes {
            offset_from_head: Vec3::ZERO,
            moved_by: EyesMovedBy::Bones,
            inner: map(90.0, 8.0),
            outer: map(90.0, 12.0),
            down: map(45.0, 10.0),
            up: map(90.0, 20.0),
        };
        let at = |left: bool, yaw: f64, pitch: f64| {
            let (y, p) = (yaw.to_radians(), pitch.to_radians());
            let way = DVec3::new(libm::sin(y) * libm::cos(p), libm::sin(p), libm::cos(y) * libm::cos(p));
            let (yaw, pitch) = eyes.turn_of(left, way);
            [yaw.to_degrees(), pitch.to_degrees()]
        };
        let assert_near = |got: [f64; 2], expected: [f64; 2]| {
            assert!(
                (got[0] - expected[0]).abs() < 1e-6 && (got[1] - expected[1]).abs() < 1e-6,
                "{got:?} {expected:?}"
            );
        };
        // A target on the character's left: outwards for the left eye, inwards for the right one.
        assert_near(at(true, 45.0, 0.0), [6.0, 0.0]);
        assert_near(at(false, 45.0, 0.0), [4.0, 0.0]);
        assert_near(at(true, -45.0, 0.0), [-4.0, 0.0]);
        assert_near(at(false, -45.0, 0.0), [-6.0, 0.0]);
        assert_near(at(true, 0.0, 45.0), [0.0, 10.0]);
        assert_near(at(true, 0.0, -60.0), [0.0, -10.0]);
        assert_near(at(true, 170.0, 0.0), [12.0, 0.0]);
        assert_eq!(RangeMap { input_max: 0.0, output_scale: 1.0 }.map(1.0), 0.0);
    }
}
