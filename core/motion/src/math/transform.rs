//! Translation, rotation, scale: applied scale first (glTF 2.0, §3.5.3).

use glam::{Affine3A, Mat4, Quat, Vec3};

/// `parent_from_local = T · R · S`. The rotation is a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Position in the parent's space, metres.
    pub translation: Vec3,
    /// Unit quaternion x y z w.
    pub rotation: Quat,
    /// Scale factors along the local axes.
    pub scale: Vec3,
}

impl Transform {
    /// The identity transform.
    pub const IDENTITY: Transform =
        Transform { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// Converts the transform to an affine matrix.
    pub fn to_affine(self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }

    /// Decomposes a matrix; a mirrored one gets a negative x scale, shear is lost.
    pub fn from_matrix(m: Mat4) -> Transform {
        let (scale, rotation, translation) = m.to_scale_rotation_translation();
        Transform { translation, rotation: rotation.normalize(), scale }
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.translation.is_finite() && self.rotation.is_finite() && self.scale.is_finite()
    }
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}
