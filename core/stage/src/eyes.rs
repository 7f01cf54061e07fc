//! How eyes follow a target: VRM 1.0, "lookAt.md", and `firstPerson` of VRM 0.x.

use glam::Vec3;

/// A character's own word on how far its eyes turn. The direction to the target is measured as yaw and pitch from the head's
/// forward direction at `offset_from_head`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// Where the eyes are, in the head joint's space, metres.
    pub offset_from_head: Vec3,
    pub moved_by: EyesMovedBy,
    /// Towards the nose, away from it, down and up.
    pub inner: RangeMap,
    pub outer: RangeMap,
    pub down: RangeMap,
    pub up: RangeMap,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EyesMovedBy {
    /// The bones `leftEye` and `rightEye`; a [`RangeMap`]'s output is an angle.
    Bones,
    /// The expressions lookLeft, lookRight, lookUp, lookDown; a [`RangeMap`]'s output is a weight.
    Expressions,
}

/// output = clamp(angle, 0, `input_max`) / `input_max` · `output_scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeMap {
    /// Radians.
    pub input_max: f32,
    /// Radians or a weight.
    pub output_scale: f32,
}
