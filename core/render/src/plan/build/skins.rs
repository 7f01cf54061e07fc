//! Skin matrices as shaders read them.

use crate::affine::{Affine3x4, to_f64};
use crate::plan::build::Planner;
use crate::scene_resources::PrimitiveResource;
use crate::scene_resources::bounds::PrimitiveInfo;
use choreo_asset::{Aabb, Asset, Skin};
use choreo_motion::{Skinning, StretchedDualQuaternion};
use choreo_stage::ActorState;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec4};

/// Skin matrices of one actor's skin, shared by all its primitives. They are added to the plan once one of these is in view.
pub(super) struct SkinMatrices {
    pub skin: u32,
    /// One for each joint: relative-from-mesh; model-from-mesh if `placed`.
    pub matrices: Vec<Affine3x4>,
    /// One for each joint, model-from-mesh, with dual-quaternion skinning; else empty.
    pub dual_quaternions: Vec<StretchedDualQuaternion>,
    /// Whether the file places the model several times. Matrices then lead to model space, and each copy has a transform from
    /// there.
    pub placed: bool,
    /// Index of the first matrix in the plan's `joint_matrices`, once they are added.
    first_joint: Option<u32>,
}

impl SkinMatrices {
    /// Computes relative-from-model · model-from-joint · inverse bind (glTF 2.0 §3.7.3.3) in f64.
    pub(super) fn new(
        relative_from_model: DAffine3,
        asset: &Asset,
        skin: u32,
        state: &ActorState,
    ) -> SkinMatrices {
        let placed = !asset.placements.is_empty();
        // Placements of the model are applied after the skin.
        let relative_from_model = if placed { DAffine3::IDENTITY } else { relative_from_model };
        let mut all = SkinMatrices {
            skin,
            matrices: Vec::new(),
            dual_quaternions: Vec::new(),
            placed,
            first_joint: None,
        };
        let skin = &asset.skins[skin as usize];
        for (i, joint) in skin.joints.iter().enumerate() {
            let pose = state.model_from_joint.get(*joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            let bind = bind_of(skin, i);
            all.matrices.push(Affine3x4::from_affine(relative_from_model * to_f64(pose) * bind));
            if state.skinning == Skinning::DualQuaternion {
                all.dual_quaternions.push(StretchedDualQuaternion::of(to_f64(pose) * bind));
            }
        }
        all
    }

    /// Bounds in model space, if the file places the model several times.
    pub(crate) fn bounds_in_model(&self, primitive: &PrimitiveResource, morph_offset: Aabb) -> Option<Aabb> {
        let info = &primitive.info;
        let same = || Affine3x4::from_affine(DAffine3::IDENTITY);
        self.placed.then(|| match self.dual_quaternions.is_empty() {
            true => info.skinned_bounds(&self.matrices, morph_offset),
            false => info.dual_quaternion_bounds(
                primitive.primitive(),
                &self.dual_quaternions,
                &same(),
                morph_offset,
            ),
        })
    }
}

impl Planner<'_> {
    /// The determinant whose sign distinguishes a copy's front faces from its back faces, and whether the determinants of all its
    /// joints have that sign.
    pub(crate) fn handedness(
        &self,
        info: &PrimitiveInfo,
        skin: Option<usize>,
        relative_from_mesh: &Affine3x4,
    ) -> (f32, bool) {
        let Some(skin) = skin else {
            return (relative_from_mesh.determinant(), relative_from_mesh.determinant() != 0.0);
        };
        let skin = &self.skins[skin];
        // If joints lead to model space, the transform of the placement counts, too.
        let place = if skin.placed { relative_from_mesh.determinant() } else { 1.0 };
        let used = || info.joint_bounds.iter().map(|(j, _)| skin.matrices[*j as usize].determinant() * place);
        // The first joint in use that is not singular.
        let first = used().find(|d| *d != 0.0).unwrap_or(1.0);
        (first, used().all(|d| d * first > 0.0))
    }

    /// Index of the skin's first matrix in the plan. Adds the matrices on the first call.
    pub(super) fn first_joint(&mut self, skin: usize) -> u32 {
        let (matrices, skin) = (&mut self.joint_matrices, &mut self.skins[skin]);
        *skin.first_joint.get_or_insert_with(|| {
            let first = matrices.len() as u32;
            match skin.dual_quaternions.is_empty() {
                true => matrices.extend_from_slice(&skin.matrices),
                false => matrices.extend(skin.dual_quaternions.iter().flat_map(dual_quaternion_rows)),
            }
            first
        })
    }
}

/// Inverse bind matrix of a joint of a skin.
pub(crate) fn bind_of(skin: &Skin, joint: usize) -> DAffine3 {
    let bind = skin.inverse_bind.get(joint).copied().unwrap_or(glam::Mat4::IDENTITY);
    DAffine3 {
        matrix3: DMat3::from_cols(
            bind.x_axis.truncate().as_dvec3(),
            bind.y_axis.truncate().as_dvec3(),
            bind.z_axis.truncate().as_dvec3(),
        ),
        translation: bind.w_axis.truncate().as_dvec3(),
    }
}

/// A joint of a dual-quaternion skin as the shader reads it; see [`crate::plan::Plan::joint_matrices`].
pub(super) fn dual_quaternion_rows(carrier: &StretchedDualQuaternion) -> [Affine3x4; 2] {
    let part = |q: glam::DQuat| glam::DVec4::from(q).as_vec4();
    let stretch = DAffine3 { matrix3: carrier.stretch, translation: DVec3::ZERO };
    [Affine3x4([part(carrier.real), part(carrier.dual), Vec4::ZERO]), Affine3x4::from_affine(stretch)]
}
