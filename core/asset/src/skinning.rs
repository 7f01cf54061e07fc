//! CPU skinning in f64: the transform of a vertex, from its joints and weights.

use crate::asset::{Asset, MeshInstance};
use crate::mesh::Primitive;
use choreo_motion::{Skinning, StretchedDualQuaternion};
use glam::{Affine3A, DAffine3, DMat3, DMat4, Mat3, Vec3};

/// Converts an affine transform to f64.
pub fn widen(a: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: Mat3::from(a.matrix3).as_dmat3(), translation: Vec3::from(a.translation).as_dvec3() }
}

/// Transforms that move the vertices of one mesh instance: those of its skin's joints, and that of its node for rigid primitives.
#[derive(Clone)]
pub struct VertexTransforms {
    skin: SkinTransforms,
    rigid: DAffine3,
}

/// One transform per joint of the skin.
#[derive(Clone)]
enum SkinTransforms {
    Linear(Vec<DMat4>),
    Dual(Vec<StretchedDualQuaternion>),
}

impl VertexTransforms {
    /// Transforms of an instance in a pose: matrices or dual quaternions of its skin.
    pub fn new(
        skinning: Skinning,
        asset: &Asset,
        instance: &MeshInstance,
        model_from_joint: &[Affine3A],
    ) -> VertexTransforms {
        let joint = |j: u32| model_from_joint.get(j as usize).map_or(DAffine3::IDENTITY, widen);
        let skin = instance.skin.and_then(|s| asset.skins.get(s as usize));
        let matrices = skin.map_or(Vec::new(), |skin| {
            let inverse_bind = |i: usize| skin.inverse_bind.get(i).map_or(DMat4::IDENTITY, |m| m.as_dmat4());
            skin.joints.iter().enumerate().map(|(i, j)| DMat4::from(joint(*j)) * inverse_bind(i)).collect()
        });
        let skin = match skinning {
            Skinning::Linear => SkinTransforms::Linear(matrices),
            Skinning::DualQuaternion => SkinTransforms::Dual(
                matrices.iter().map(|m| StretchedDualQuaternion::of(affine_from_matrix(m))).collect(),
            ),
        };
        VertexTransforms { skin, rigid: joint(instance.joint) }
    }

    /// Transforms of one copy of a rigid mesh. Skinned meshes have no copies.
    pub fn of_copy(&self, joint_from_copy: &Affine3A) -> VertexTransforms {
        VertexTransforms { skin: self.skin.clone(), rigid: self.rigid * widen(joint_from_copy) }
    }

    /// model-from-mesh of a vertex: Σ weight · joint · inverse bind (glTF 2.0 §3.7.3.3), or the blend of dual quaternions.
    pub fn at_vertex(&self, primitive: &Primitive, v: usize) -> DAffine3 {
        let n = primitive.influences;
        let slots = match &self.skin {
            SkinTransforms::Linear(slots) => slots.len(),
            SkinTransforms::Dual(slots) => slots.len(),
        };
        if n == 0 || slots == 0 {
            return self.rigid;
        }
        let influences = (v * n..(v + 1) * n).filter_map(|k| {
            let (slot, weight) = (primitive.joint_indices.get(k)?, primitive.joint_weights.get(k)?);
            Some((usize::from(*slot), f64::from(*weight)))
        });
        match &self.skin {
            SkinTransforms::Linear(slots) => {
                let mut blended = DMat4::ZERO;
                for (slot, weight) in influences {
                    blended += slots.get(slot).map_or(DMat4::ZERO, |m| *m * weight);
                }
                affine_from_matrix(&blended)
            }
            SkinTransforms::Dual(slots) => {
                StretchedDualQuaternion::blend(influences.filter_map(|(slot, w)| Some((slots.get(slot)?, w))))
            }
        }
    }
}

fn affine_from_matrix(m: &DMat4) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_mat4(*m), m.w_axis.truncate())
}
