//! Transforms and rotations.

pub mod planar;
pub mod rotation;
pub mod transform;
