//! Morph targets (blend shapes, shape keys) applied on the CPU.

use crate::input_error::InputError;
use glam::Vec3;

/// Adds weighted morph targets: `values[i] += Σ weight * target[i]`; an empty target changes nothing.
pub struct Morph<'a> {
    /// Offsets at weight 1: one list per target, as long as `values` or empty.
    pub targets: &'a [&'a [Vec3]],
    /// One weight per target; missing ones count as zero.
    pub weights: &'a [f32],
    /// Input: positions (or normals, tangents) of the mesh. Output: morphed; normals are not renormalized.
    pub values: &'a mut [Vec3],
}

impl Morph<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let (values, targets) = (self.values.len(), self.targets.iter().filter(|target| !target.is_empty()));
        for target in targets {
            InputError::check_lengths(&[("Morph.targets", target.len(), values)])?;
        }
        InputError::check_each(self.weights, |w| w.is_finite(), "Morph.weights", "finite")
    }

    /// Adds the targets by their weights.
    pub fn run(&mut self) {
        for (target, weight) in self.targets.iter().zip(self.weights) {
            if *weight != 0.0 {
                for (value, offset) in self.values.iter_mut().zip(*target) {
                    *value += *offset * *weight;
                }
            }
        }
    }
}
