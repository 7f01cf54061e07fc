//! Morph targets (blend shapes, shape keys) applied on the CPU.

use glam::Vec3;

/// Adds weighted morph targets: `values[i] += Σ weight * target[i]`; an empty target changes nothing.
pub struct Morph<'a> {
    /// Offsets at weight 1: one list per target, as long as `values` or empty.
    pub targets: &'a [&'a [Vec3]],
    /// One per target; missing ones count as zero.
    pub weights: &'a [f32],
    /// In: positions (or normals, tangents) of the mesh. Out: morphed; normals are not renormalised.
    pub values: &'a mut [Vec3],
}

impl Morph<'_> {
    pub fn check(&self) -> Result<(), String> {
        for (i, target) in self.targets.iter().enumerate() {
            if !target.is_empty() && target.len() != self.values.len() {
                return Err(format!(
                    "`Morph.targets[{i}]` holds {}, there are {} values",
                    target.len(),
                    self.values.len()
                ));
            }
        }
        match self.weights.iter().position(|w| !w.is_finite()) {
            Some(i) => Err(format!("`Morph.weights[{i}]` is {}, must be finite", self.weights[i])),
            None => Ok(()),
        }
    }

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
