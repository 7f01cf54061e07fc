//! Skins: any number of influences a point, reduced to the eight largest.

use crate::convert;
use crate::file::{File, place_of};
use crate::local::LocalTransform;
use crate::meshes::VisibleMesh;
use crate::nodes::{self, Tree};
use choreo_asset::Skin;
use choreo_importer_kit::{Problem, Result};
use glam::Mat4;
use ufbx::{Mesh, SkinDeformer, SkinningMethod};

const MAX_INFLUENCES: usize = 8;
/// Joints of a skin, at most: vertices refer to them by 16-bit indices.
const MAX_JOINTS: usize = 1 << 16;

/// Influences of each point of a mesh, `influences` a point, with weights that sum to 1.
pub(crate) struct Weights {
    pub influences: usize,
    pub joints: Vec<u16>,
    pub weights: Vec<f32>,
}

fn deformer(mesh: &Mesh) -> Option<&SkinDeformer> {
    let skin: Option<&SkinDeformer> = mesh.skin_deformers.as_ref().first().map(|s| s.as_ref());
    skin.filter(|s| !s.clusters.is_empty() && !s.vertices.is_empty())
}

/// The joints and inverse bind matrices of a mesh on one node. The node itself comes after the clusters, and carries the points
/// without influence.
pub(crate) fn skin(file: &File<'_>, tree: &Tree, visible_mesh: &VisibleMesh<'_>) -> Result<Option<Skin>> {
    let Some(deformer) = deformer(visible_mesh.mesh) else { return Ok(None) };
    let place = || place_of(&deformer.element);
    let mut skin = Skin::default();
    file.charge(deformer.clusters.len() + 1, size_of::<Mat4>() + 4, place)?;
    // The geometry helper is a joint where its mesh has several instances.
    let helper = visible_mesh.holder.is_geometry_transform_helper && !nodes::is_folded(visible_mesh.holder);
    let geometry =
        LocalTransform::new(visible_mesh.holder).filter(|_| helper).map(|local| local.matrix_at_rest());
    for cluster in &deformer.clusters {
        let bone = cluster.bone_node.as_ref().map(|b| b.element.typed_id as usize);
        let joint = bone.and_then(|b| tree.joint_of_node.get(b).copied().flatten());
        let joint =
            joint.ok_or_else(|| Problem::new(place_of(&cluster.element), "has no bone in the node tree"))?;
        skin.joints.push(joint);
        let bind = convert::affine(&cluster.mesh_node_to_bone);
        let bind = geometry.map_or(bind, |g| bind * g);
        skin.inverse_bind.push(convert::matrix(&bind, || place_of(&cluster.element))?);
    }
    skin.joints.push(visible_mesh.joint);
    skin.inverse_bind.push(Mat4::IDENTITY);
    Ok(Some(skin))
}

pub(crate) fn weights(file: &File<'_>, mesh: &Mesh, place: &dyn Fn() -> String) -> Result<Option<Weights>> {
    let Some(deformer) = deformer(mesh) else { return Ok(None) };
    let of_node = deformer.clusters.len();
    if of_node >= MAX_JOINTS {
        return Err(Problem::new(
            place(),
            format!("its skin has {of_node} joints, at most {} are allowed", MAX_JOINTS - 1),
        ));
    }
    if mesh.skin_deformers.len() > 1 {
        file.notes.warn(place(), format!("has {} skins; the first is used", mesh.skin_deformers.len()));
    }
    if matches!(deformer.skinning_method, SkinningMethod::DualQuaternion | SkinningMethod::BlendedDqLinear) {
        file.notes.warn(
            place(),
            "is skinned by dual quaternions in the file; here linear skinning is used, which makes \
             twisted limbs thinner",
        );
    }
    let influences = if deformer.max_weights_per_vertex > 4 { MAX_INFLUENCES } else { 4 };
    let points = mesh.num_vertices;
    file.charge(points, influences * 6, place)?;
    let mut out =
        Weights { influences, joints: vec![0; points * influences], weights: vec![0.0; points * influences] };
    let mut loss = InfluenceLoss::default();
    for point in 0..points {
        let at = point * influences;
        let vertex = deformer.vertices.as_ref().get(point);
        let of_vertex = vertex.map_or(&[][..], |v| {
            let from = v.weight_begin as usize;
            deformer.weights.as_ref().get(from..from + v.num_weights as usize).unwrap_or(&[])
        });
        // ufbx sorts influences by weight, the largest first.
        let kept = &of_vertex[..of_vertex.len().min(influences)];
        let sum = |list: &[ufbx::SkinWeight]| list.iter().map(|w| w.weight).sum::<f64>();
        let total = sum(kept);
        if !(total > 0.0 && total.is_finite()) {
            out.joints[at] = of_node as u16;
            out.weights[at] = 1.0;
            loss.points_without_influence += 1;
            continue;
        }
        if of_vertex.len() > kept.len() {
            let all = sum(of_vertex);
            loss.points_with_loss += 1;
            loss.max_influences = loss.max_influences.max(of_vertex.len());
            loss.max_lost_share = loss.max_lost_share.max((all - total) / all);
        }
        for (k, weight) in kept.iter().enumerate() {
            out.joints[at + k] = (weight.cluster_index as usize).min(of_node) as u16;
            out.weights[at + k] = (weight.weight / total) as f32;
        }
    }
    loss.warn_lost_influences(file, points, place);
    Ok(Some(out))
}

#[derive(Default)]
struct InfluenceLoss {
    points_with_loss: usize,
    max_influences: usize,
    max_lost_share: f64,
    points_without_influence: usize,
}

impl InfluenceLoss {
    fn warn_lost_influences(&self, file: &File<'_>, points: usize, place: &dyn Fn() -> String) {
        if self.points_with_loss > 0 {
            let what = format!(
                "{} of {points} points have more than {MAX_INFLUENCES} influences, up to {}; the {MAX_INFLUENCES} largest are kept and stretched to 1, at worst {:.2} % of the weight is lost",
                self.points_with_loss,
                self.max_influences,
                self.max_lost_share * 100.0
            );
            file.notes.warn(place(), what);
        }
        if self.points_without_influence > 0 {
            file.notes.warn(
                place(),
                format!(
                    "{} of {points} points have no influence; they follow the mesh's node",
                    self.points_without_influence
                ),
            );
        }
    }
}
