//! Posed vertices of an actor (morphed, skinned, in the file's own order) in f64, for `choreo pose --mesh` and as the reference
//! that renderers are compared with. Not optimized.

use crate::asset::Asset;
use crate::mesh::Primitive;
use crate::skinning::{VertexTransforms, widen};
use choreo_motion::Skinning;
use glam::{Affine3A, DAffine3, DMat3, DVec3};

/// One mesh instance of an asset, or one of its copies, posed at one of the character's placements.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedInstance {
    /// Index into `Asset::instances`.
    pub instance: usize,
    /// Posed vertices, one element per primitive of the mesh.
    pub primitives: Vec<PosedPrimitive>,
}

/// Vertices in the primitive's order; `indices` of the primitive apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedPrimitive {
    /// World space, metres.
    pub positions: Vec<DVec3>,
    /// Unit normals in world space (zero where the surface has collapsed); empty if the primitive has none.
    pub normals: Vec<DVec3>,
}

/// Selects the placements and copies that are posed.
#[derive(Clone, Copy)]
pub enum PlacementSelection {
    /// The first N placements, or the first N copies if there are no placements; `None`: all.
    First(Option<u32>),
    /// The character once, without its placements, but with all copies.
    Once,
}

/// All mesh instances at all placements, with linear skinning, transformed by `world_from_model`; the identity gives model space.
pub fn posed_meshes_in(
    asset: &Asset,
    model_from_joint: &[Affine3A],
    morph_weights: &[Vec<f32>],
    world_from_model: DAffine3,
) -> Vec<PosedInstance> {
    posed_meshes_by(
        (Skinning::Linear, PlacementSelection::First(None)),
        asset,
        model_from_joint,
        morph_weights,
        world_from_model,
    )
}

/// All mesh instances at the selected placements, transformed by `world_from_model`. Empty if `model_from_joint` has too few
/// joints.
pub fn posed_meshes_by(
    (skinning, placements): (Skinning, PlacementSelection),
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
        let at_joint = VertexTransforms::new(skinning, asset, instance, model_from_joint);
        let mut add = |world_from_model: DAffine3, copy: Affine3A| {
            let transforms = at_joint.of_copy(&copy);
            let pose = |p: &Primitive| pose_primitive(p, &transforms, weights, world_from_model);
            let primitives = mesh.primitives.iter().map(pose).collect();
            out.push(PosedInstance { instance: index, primitives });
        };
        match placements {
            PlacementSelection::Once => {
                instance.joint_from_copies().for_each(|copy| add(world_from_model, copy));
            }
            PlacementSelection::First(count) => {
                asset.drawn_copies(instance, count).for_each(|(place, copy)| {
                    add(world_from_model * widen(&place), copy);
                })
            }
        }
    }
    out
}

fn pose_primitive(
    primitive: &Primitive,
    transforms: &VertexTransforms,
    weights: &[f32],
    world_from_model: DAffine3,
) -> PosedPrimitive {
    let mut out = PosedPrimitive::default();
    for v in 0..primitive.positions.len() {
        let world_from_mesh = world_from_model * transforms.at_vertex(primitive, v);
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
            out.normals.push((cofactor_matrix(world_from_mesh.matrix3) * normal).normalize_or_zero());
        }
    }
    out
}

/// Normal matrix |det(m)| · m⁻ᵀ, computed from cofactors without a division: normals have the right direction but not unit
/// length, and singular maps are allowed. The sign keeps mirrored normals outward.
fn cofactor_matrix(m: DMat3) -> DMat3 {
    let c = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    if m.determinant() < 0.0 { -c } else { c }
}
