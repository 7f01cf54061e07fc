//! What the joints of a skin do to its vertices, as shaders read it.

use crate::plan::Rows;
use crate::plan::build::Planner;
use crate::scene_resources::CatalogPrimitive;
use crate::scene_resources::bounds::{Aabb, PrimitiveInfo};
use choreo_asset::Asset;
use choreo_motion::{Skinning, StretchedDualQuaternion};
use choreo_stage::ActorState;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec4};

/// Skin matrices of one (actor, skin), shared by all its primitives; in the plan only once one is in view.
pub(crate) struct PosedSkin {
    pub skin: u32,
    /// relative-from-mesh, one a joint; model-from-mesh where placed.
    pub rows: Vec<Rows>,
    /// model-from-mesh in parts, where the skin is not linear.
    pub carriers: Vec<StretchedDualQuaternion>,
    /// The rows lead to model space, and each copy's own map on from there.
    pub placed: bool,
    pub first_joint: Option<u32>,
}

impl PosedSkin {
    /// World · model-from-joint · inverse bind (glTF 2.0 §3.7.3.3), in f64.
    pub fn new(relative_from_model: DAffine3, asset: &Asset, skin: u32, state: &ActorState) -> PosedSkin {
        let placed = !asset.places.is_empty();
        // Where it stands at places, they come after the pose.
        let relative_from_model = if placed { DAffine3::IDENTITY } else { relative_from_model };
        let mut posed = PosedSkin { skin, rows: Vec::new(), carriers: Vec::new(), placed, first_joint: None };
        let skin = &asset.skins[skin as usize];
        for (i, joint) in skin.joints.iter().enumerate() {
            let pose = state.model_from_joint.get(*joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            let bind = skin.inverse_bind.get(i).copied().unwrap_or(glam::Mat4::IDENTITY);
            let bind = DAffine3 {
                matrix3: DMat3::from_cols(
                    bind.x_axis.truncate().as_dvec3(),
                    bind.y_axis.truncate().as_dvec3(),
                    bind.z_axis.truncate().as_dvec3(),
                ),
                translation: bind.w_axis.truncate().as_dvec3(),
            };
            posed.rows.push(Rows::from_affine(relative_from_model * daffine(pose) * bind));
            if state.skinning == Skinning::DualQuaternion {
                posed.carriers.push(StretchedDualQuaternion::of(daffine(pose) * bind));
            }
        }
        posed
    }

    /// Of a body at places: the box of one, in model space.
    pub fn in_model(&self, primitive: &CatalogPrimitive, morph_offset: Aabb) -> Option<Aabb> {
        let info = &primitive.info;
        let same = || Rows::from_affine(DAffine3::IDENTITY);
        self.placed.then(|| match self.carriers.is_empty() {
            true => info.skinned(&self.rows, morph_offset),
            false => info.dual_skinned(primitive.primitive(), &self.carriers, &same(), morph_offset),
        })
    }
}

impl Planner<'_> {
    /// The determinant by which a copy's front faces are told from its back faces, and whether all of its joints have its sign.
    pub fn handedness(&self, info: &PrimitiveInfo, skin: Option<usize>, rigid: &Rows) -> (f32, bool) {
        let Some(skin) = skin else { return (rigid.determinant(), rigid.determinant() != 0.0) };
        let skin = &self.skins[skin];
        // Of joints that lead to model space, the place's own counts too.
        let place = if skin.placed { rigid.determinant() } else { 1.0 };
        let used = || info.joint_bounds.iter().map(|(j, _)| skin.rows[*j as usize].determinant() * place);
        // Of the first joint in use that is not flat.
        let first = used().find(|d| *d != 0.0).unwrap_or(1.0);
        (first, used().all(|d| d * first > 0.0))
    }
}

/// A joint of a dual-quaternion skin as the shader reads it; see [`Plan::joint_matrices`].
pub(crate) fn dual_rows(carrier: &StretchedDualQuaternion) -> [Rows; 2] {
    let part = |q: glam::DQuat| glam::DVec4::from(q).as_vec4();
    let stretch = DAffine3 { matrix3: carrier.stretch, translation: DVec3::ZERO };
    [Rows([part(carrier.real), part(carrier.dual), Vec4::ZERO]), Rows::from_affine(stretch)]
}

impl Planner<'_> {
    /// Where the skin's matrices begin among the plan's; they come in when first asked for.
    pub fn first_joint(&mut self, skin: usize) -> u32 {
        let (matrices, skin) = (&mut self.joint_matrices, &mut self.skins[skin]);
        *skin.first_joint.get_or_insert_with(|| {
            let first = matrices.len() as u32;
            match skin.carriers.is_empty() {
                true => matrices.extend_from_slice(&skin.rows),
                false => matrices.extend(skin.carriers.iter().flat_map(dual_rows)),
            }
            first
        })
    }
}

pub(crate) fn daffine(a: Affine3A) -> DAffine3 {
    let dvec = |v: glam::Vec3A| DVec3::new(v.x.into(), v.y.into(), v.z.into());
    DAffine3 {
        matrix3: DMat3::from_cols(dvec(a.matrix3.x_axis), dvec(a.matrix3.y_axis), dvec(a.matrix3.z_axis)),
        translation: dvec(a.translation),
    }
}
