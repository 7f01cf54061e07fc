//! The vertices of an actor as posed: morphed, skinned, in the file's own order, in f64 — for `choreo pose --mesh` and as the
//! truth that renderers are compared with. Slow and plain.

use crate::{ActorState, Asset, MeshInstance, Primitive};
use choreo_motion::{Skinning, StretchedDualQuaternion};
use glam::{Affine3A, DAffine3, DMat3, DMat4, DVec3};

/// One mesh instance of an asset, or one of its copies, posed at one of the body's places.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedInstance {
    /// Index into `Asset::instances`.
    pub instance: usize,
    /// One per primitive of its mesh.
    pub primitives: Vec<PosedPrimitive>,
}

/// Vertices in the primitive's order; `indices` of the primitive apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedPrimitive {
    pub positions: Vec<DVec3>,
    /// Unit (zero where the surface has collapsed); empty where the primitive has none.
    pub normals: Vec<DVec3>,
}

/// All mesh instances of an actor in world space. Empty where the actor was not posed (invisible).
pub fn posed_meshes(asset: &Asset, actor: &ActorState) -> Vec<PosedInstance> {
    let ActorState { model_from_joint, morph_weights, world_from_model, .. } = actor;
    let how = (actor.skinning, Standing::First(actor.copies));
    posed_meshes_by(how, asset, model_from_joint, morph_weights, *world_from_model)
}

/// In model space, as if the body stood once, where it is cast.
pub(crate) fn posed_body(asset: &Asset, actor: &ActorState) -> Vec<PosedInstance> {
    let ActorState { model_from_joint, morph_weights, .. } = actor;
    let how = (actor.skinning, Standing::Once);
    posed_meshes_by(how, asset, model_from_joint, morph_weights, DAffine3::IDENTITY)
}

/// Which of its places and copies.
#[derive(Clone, Copy)]
enum Standing {
    First(Option<u32>),
    Once,
}

/// As [`posed_meshes`] with linear skinning, moved by any map: identity gives model space.
pub fn posed_meshes_in(
    asset: &Asset,
    model_from_joint: &[Affine3A],
    morph_weights: &[Vec<f32>],
    world_from_model: DAffine3,
) -> Vec<PosedInstance> {
    posed_meshes_by(
        (Skinning::Linear, Standing::First(None)),
        asset,
        model_from_joint,
        morph_weights,
        world_from_model,
    )
}

fn posed_meshes_by(
    (skinning, standing): (Skinning, Standing),
    asset: &Asset,
    model_from_joint: &[Affine3A],
    morph_weights: &[Vec<f32>],
    world_from_model: DAffine3,
) -> Vec<PosedInstance> {
    if model_from_joint.len() < asset.skeleton.len() {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (index, instance) in asset.instances.iter().enumerate() {
        let Some(mesh) = asset.meshes.get(instance.mesh as usize) else { continue };
        let weights = morph_weights.get(index).map_or(&[][..], Vec::as_slice);
        let at_joint = Carriers::new(skinning, asset, instance, model_from_joint);
        let mut add = |world_from_model: DAffine3, copy: Affine3A| {
            let carriers = at_joint.of_copy(&copy);
            let pose = |p: &Primitive| pose_primitive(p, &carriers, weights, world_from_model);
            let primitives = mesh.primitives.iter().map(pose).collect();
            out.push(PosedInstance { instance: index, primitives });
        };
        match standing {
            Standing::Once => {
                instance.joint_from_copies().for_each(|copy| add(world_from_model, copy));
            }
            Standing::First(count) => asset.standing(instance, count).for_each(|(place, copy)| {
                add(world_from_model * crate::evaluate::widen(&place), copy);
            }),
        }
    }
    out
}

fn pose_primitive(
    primitive: &Primitive,
    carriers: &Carriers,
    weights: &[f32],
    world_from_model: DAffine3,
) -> PosedPrimitive {
    let mut out = PosedPrimitive::default();
    for v in 0..primitive.positions.len() {
        let world_from_mesh = world_from_model * carriers.at_vertex(primitive, v);
        let mut position = primitive.positions[v].as_dvec3();
        let mut normal = primitive.normals.get(v).map(|n| n.as_dvec3());
        for (morph, weight) in primitive.morphs.iter().zip(weights) {
            if let Some(offset) = morph.positions.get(v) {
                position += offset.as_dvec3() * f64::from(*weight);
            }
            if let (Some(normal), Some(offset)) = (&mut normal, morph.normals.get(v)) {
                *normal += offset.as_dvec3() * f64::from(*weight);
            }
        }
        out.positions.push(world_from_mesh.transform_point3(position));
        if let Some(normal) = normal {
            out.normals.push((cofactor(world_from_mesh.matrix3) * normal).normalize_or_zero());
        }
    }
    out
}

/// det(m) · m⁻ᵀ without the division: right up to length and for singular maps; the sign keeps mirrored normals outward.
fn cofactor(m: DMat3) -> DMat3 {
    let c = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -c } else { c }
}

/// What carries the vertices of one instance: its skin's joints, or its node.
#[derive(Clone)]
pub(crate) struct Carriers {
    skin: Slots,
    rigid: DAffine3,
}

/// One a joint of the skin.
#[derive(Clone)]
enum Slots {
    Linear(Vec<DMat4>),
    Dual(Vec<StretchedDualQuaternion>),
}

impl Carriers {
    pub(crate) fn new(
        skinning: Skinning,
        asset: &Asset,
        instance: &MeshInstance,
        model_from_joint: &[Affine3A],
    ) -> Carriers {
        let joint = |j: u32| match model_from_joint.get(j as usize) {
            Some(m) => DAffine3::from_mat3_translation(
                glam::Mat3::from(m.matrix3).as_dmat3(),
                glam::Vec3::from(m.translation).as_dvec3(),
            ),
            None => DAffine3::IDENTITY,
        };
        let skin = instance.skin.and_then(|s| asset.skins.get(s as usize));
        let matrices = skin.map_or(Vec::new(), |skin| {
            let inverse_bind = |i: usize| skin.inverse_bind.get(i).map_or(DMat4::IDENTITY, |m| m.as_dmat4());
            skin.joints.iter().enumerate().map(|(i, j)| DMat4::from(joint(*j)) * inverse_bind(i)).collect()
        });
        let skin = match skinning {
            Skinning::Linear => Slots::Linear(matrices),
            Skinning::DualQuaternion => {
                Slots::Dual(matrices.iter().map(|m| StretchedDualQuaternion::of(affine(m))).collect())
            }
        };
        Carriers { skin, rigid: joint(instance.joint) }
    }

    /// Those of one copy; skinned vertices have none.
    pub(crate) fn of_copy(&self, joint_from_copy: &Affine3A) -> Carriers {
        Carriers { skin: self.skin.clone(), rigid: self.rigid * crate::evaluate::widen(joint_from_copy) }
    }

    /// model-from-mesh at a vertex: Σ weight · joint · inverse bind (glTF 2.0 §3.7.3.3), or its dual quaternion.
    pub(crate) fn at_vertex(&self, primitive: &Primitive, v: usize) -> DAffine3 {
        let n = primitive.influences;
        let slots = match &self.skin {
            Slots::Linear(slots) => slots.len(),
            Slots::Dual(slots) => slots.len(),
        };
        if n == 0 || slots == 0 {
            return self.rigid;
        }
        let influences = (v * n..(v + 1) * n).filter_map(|k| {
            let (slot, weight) = (primitive.joint_indices.get(k)?, primitive.joint_weights.get(k)?);
            Some((usize::from(*slot), f64::from(*weight)))
        });
        match &self.skin {
            Slots::Linear(slots) => {
                let mut blended = DMat4::ZERO;
                for (slot, weight) in influences {
                    blended += slots.get(slot).map_or(DMat4::ZERO, |m| *m * weight);
                }
                affine(&blended)
            }
            Slots::Dual(slots) => {
                StretchedDualQuaternion::blend(influences.filter_map(|(slot, w)| Some((slots.get(slot)?, w))))
            }
        }
    }
}

fn affine(m: &DMat4) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_mat4(*m), m.w_axis.truncate())
}
