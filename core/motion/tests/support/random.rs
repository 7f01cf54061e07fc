//! Random numbers by a seed, the same everywhere.

use glam::{DQuat, DVec3};

/// splitmix64.
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
    /// -1..1
    pub(crate) fn signed(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
    /// -1..1
    pub(crate) fn signed64(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub(crate) fn rotation(&mut self) -> [f32; 4] {
        loop {
            let q = [self.signed(), self.signed(), self.signed(), self.signed()];
            let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
            if length > 0.1 {
                return q.map(|c| c / length);
            }
        }
    }
    pub(crate) fn vec3(&mut self) -> DVec3 {
        DVec3::new(self.signed64(), self.signed64(), self.signed64())
    }
    pub(crate) fn direction(&mut self) -> DVec3 {
        self.vec3().normalize_or(DVec3::X)
    }
    /// A rotation about any axis by at most this angle.
    pub(crate) fn turn(&mut self, most: f64) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.signed64() * most)
    }
    /// A power of ten whose exponent is between these.
    pub(crate) fn power(&mut self, low: f64, high: f64) -> f64 {
        libm::pow(10.0, low + (high - low) * (self.signed64() * 0.5 + 0.5))
    }
}
