//! Skinning and morphing on the CPU: linear blend and dual-quaternion skinning, morph targets.

pub mod dual;
pub mod dual_quaternion;
pub mod linear;
pub mod morph;
