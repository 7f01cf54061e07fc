//! Eight floats in memory, aligned for one register.

/// Joints in one block of a pose: one AVX register of f32.
pub(crate) const LANES: usize = 8;

/// One float of each of eight joints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Lane(pub [f32; LANES]);

impl Lane {
    pub(crate) const fn splat(v: f32) -> Lane {
        Lane([v; LANES])
    }
}
