//! Skinning and morphing on the CPU.

use glam::{Affine3A, Mat3A, Mat4, Vec3, Vec3A};

/// Skin matrices: `out[i] = model_from_joint[joints[i]] * inverse_bind[i]`, model from the mesh at bind time.
pub struct SkinMatrices<'a> {
    pub model_from_joint: &'a [Affine3A],
    /// Skeleton joint of each skin joint.
    pub joints: &'a [u32],
    /// joint-from-mesh at bind time; the last row is taken as 0 0 0 1 (glTF 2.0 §3.7.3.1). Empty = identities.
    pub inverse_bind: &'a [Mat4],
    pub out: &'a mut [Affine3A],
}

impl SkinMatrices<'_> {
    pub fn check(&self) -> Result<(), String> {
        let joints = self.joints.len();
        if !self.inverse_bind.is_empty() && self.inverse_bind.len() != joints {
            return Err(format!(
                "`SkinMatrices.inverse_bind` holds {}, the skin has {joints} joints",
                self.inverse_bind.len()
            ));
        }
        if self.out.len() != joints {
            return Err(format!("`SkinMatrices.out` holds {}, the skin has {joints} joints", self.out.len()));
        }
        match self.joints.iter().position(|j| *j as usize >= self.model_from_joint.len()) {
            Some(at) => Err(format!(
                "`SkinMatrices.joints[{at}]` is {}, the skeleton has {} joints",
                self.joints[at],
                self.model_from_joint.len()
            )),
            None => Ok(()),
        }
    }

    pub fn run(&mut self) {
        for (i, (joint, out)) in self.joints.iter().zip(self.out.iter_mut()).enumerate() {
            let joint = self.model_from_joint[*joint as usize];
            *out = match self.inverse_bind.get(i) {
                Some(m) => joint * Affine3A::from_mat4(*m),
                None => joint,
            };
        }
    }
}

/// Linear blend skinning of positions and normals.
///
/// Normals go through the blended matrix's cofactors (the inverse transpose but for a positive factor, finite for
/// singular matrices too, and right for mirrored ones), then to unit length; a normal that collapses is left as it was.
pub struct Skin<'a> {
    /// Model from mesh, one per skin joint (see [`SkinMatrices`]).
    pub matrices: &'a [Affine3A],
    /// Influences a vertex, any number; 4 and 8 are fast.
    pub influences: usize,
    /// `influences` a vertex.
    pub joint_indices: &'a [u16],
    /// `influences` a vertex, sum 1.
    pub joint_weights: &'a [f32],
    pub positions: &'a [Vec3],
    /// As many as positions, or none.
    pub normals: &'a [Vec3],
    pub out_positions: &'a mut [Vec3],
    pub out_normals: &'a mut [Vec3],
}

impl Skin<'_> {
    pub fn check(&self) -> Result<(), String> {
        let vertices = self.positions.len();
        if !self.normals.is_empty() && self.normals.len() != vertices {
            return Err(format!(
                "`Skin.normals` holds {}, there are {vertices} positions",
                self.normals.len()
            ));
        }
        let lengths = [
            ("joint_indices", self.joint_indices.len(), vertices * self.influences),
            ("joint_weights", self.joint_weights.len(), vertices * self.influences),
            ("out_positions", self.out_positions.len(), vertices),
            ("out_normals", self.out_normals.len(), self.normals.len()),
        ];
        for (field, holds, needs) in lengths {
            if holds != needs {
                return Err(format!("`Skin.{field}` holds {holds}, must hold {needs}"));
            }
        }
        if let Some(at) = self.joint_indices.iter().position(|j| usize::from(*j) >= self.matrices.len()) {
            return Err(format!(
                "`Skin.joint_indices[{at}]` is {}, the skin has {} joints",
                self.joint_indices[at],
                self.matrices.len()
            ));
        }
        if let Some(at) = self.joint_weights.iter().position(|w| !w.is_finite()) {
            return Err(format!("`Skin.joint_weights[{at}]` is {}, must be finite", self.joint_weights[at]));
        }
        Ok(())
    }

    pub fn run(&mut self) {
        for vertex in 0..self.positions.len() {
            let at = vertex * self.influences;
            let mut m = Affine3A { matrix3: Mat3A::ZERO, translation: Vec3A::ZERO };
            for i in at..at + self.influences {
                let w = self.joint_weights[i];
                let joint = &self.matrices[usize::from(self.joint_indices[i])];
                m.matrix3 += joint.matrix3 * w;
                m.translation += joint.translation * w;
            }
            self.out_positions[vertex] = m.transform_point3(self.positions[vertex]);
            if let Some(normal) = self.normals.get(vertex) {
                self.out_normals[vertex] = transform_normal(&m.matrix3, *normal);
            }
        }
    }
}

/// The normal through the cofactor matrix, unit; unchanged where it collapses.
fn transform_normal(m: &Mat3A, normal: Vec3) -> Vec3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let n = y.cross(z) * normal.x + z.cross(x) * normal.y + x.cross(y) * normal.z;
    // The inverse transpose is cofactors / determinant: a mirroring matrix turns the cofactors round.
    let sign = if x.dot(y.cross(z)) < 0.0 { -1.0 } else { 1.0 };
    let length = n.length();
    if length > 0.0 && length.is_finite() { Vec3::from(n * (sign / length)) } else { normal }
}

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
