//! A visible skeleton for files without a mesh: an octahedron from each joint to each of its children.

use choreo_asset::{Asset, Material, Mesh, MeshInstance, Primitive, Skin};
use choreo_motion::Skeleton;
use glam::{DAffine3, DVec3, Mat4, Vec3};
use std::sync::Arc;

/// Largest number of joints that a skin can index.
const MAX_JOINTS: usize = 1 << 16;
/// Shape of a bone: the place at which it is thickest, and its half width there, as fractions of its length; and bounds of the half width
/// as fractions of the skeleton's size, so that a bone is neither a hair nor a barrel.
const WAIST: f64 = 0.15;
const WIDTH: f64 = 0.12;
const WIDTH_OF_SIZE: (f64, f64) = (0.004, 0.03);
/// Length in metres of the marker for a skeleton without extent.
const MARKER_LENGTH: f64 = 0.1;

/// Adds the bones of `asset.skeleton` as a mesh with a skin and a material. Does nothing for no joints, and for more than
/// 65,536.
pub fn add_bones(asset: &mut Asset) {
    let skeleton = asset.skeleton.clone();
    if skeleton.is_empty() || skeleton.len() > MAX_JOINTS {
        return;
    }
    let model_from_joint = model_from_joints(&skeleton);
    let mut primitive = Primitive { influences: 4, ..Primitive::default() };
    let at = |joint: usize| model_from_joint[joint].translation;
    // Lone nodes, such as a program's own cameras far away, are no part of the skeleton's size.
    let mut linked: Vec<bool> = skeleton.parents().iter().map(Option::is_some).collect();
    skeleton.parents().iter().flatten().for_each(|p| linked[*p as usize] = true);
    let alone = !linked.contains(&true);
    let (min, max) = (0..skeleton.len())
        .filter(|joint| alone || linked[*joint])
        .map(at)
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
    let size = (max - min).max_element();
    for (joint, parent) in skeleton.parents().iter().enumerate() {
        let Some(parent) = parent.map(|p| p as usize) else { continue };
        let (from, to) = (at(parent), at(joint));
        let length = from.distance(to);
        if length > size * 1e-5 && length.is_finite() {
            let width = (length * WIDTH).clamp(size * WIDTH_OF_SIZE.0, size * WIDTH_OF_SIZE.1);
            octahedron(&mut primitive, parent, from, to, width);
        }
    }
    if primitive.positions.is_empty() {
        octahedron(&mut primitive, 0, at(0), at(0) + DVec3::Y * MARKER_LENGTH, MARKER_LENGTH * 0.3);
    }
    primitive.material = Some(asset.materials.len() as u32);
    asset.materials.push(Material {
        name: "bones".into(),
        base_color: Vec3::new(0.55, 0.6, 0.68).extend(1.0),
        metallic: 0.0,
        roughness: 0.6,
        ..Material::default()
    });
    let inverse = |m: &DAffine3| {
        let inverse = m.inverse();
        // A joint of scale zero has no inverse; it shows nothing anyway.
        if inverse.is_finite() {
            Mat4::from_cols_array(&glam::DMat4::from(inverse).to_cols_array().map(|v| v as f32))
        } else {
            Mat4::IDENTITY
        }
    };
    asset.instances.push(MeshInstance {
        joint: 0,
        mesh: asset.meshes.len() as u32,
        skin: Some(asset.skins.len() as u32),
        ..MeshInstance::default()
    });
    asset.meshes.push(Arc::new(Mesh {
        name: "bones".into(),
        primitives: vec![primitive],
        ..Mesh::default()
    }));
    asset.skins.push(Skin {
        joints: (0..skeleton.len() as u32).collect(),
        inverse_bind: model_from_joint.iter().map(inverse).collect(),
    });
}

/// The model_from_joint transform of every joint at rest.
pub fn model_from_joints(skeleton: &Skeleton) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (local, parent) in skeleton.rest().iter().zip(skeleton.parents()) {
        let local = DAffine3::from_scale_rotation_translation(
            local.scale.as_dvec3(),
            local.rotation.as_dquat(),
            local.translation.as_dvec3(),
        );
        out.push(parent.map_or(local, |p| out[p as usize] * local));
    }
    out
}

fn octahedron(out: &mut Primitive, joint: usize, from: DVec3, to: DVec3, width: f64) {
    let along = (to - from).normalize_or(DVec3::Y);
    let (side, other) = along.any_orthonormal_pair();
    let waist = from + (to - from) * WAIST;
    let ring = [side, other, -side, -other].map(|d| waist + d * width);
    for i in 0..4 {
        let (a, b) = (ring[i], ring[(i + 1) % 4]);
        for vertices in [[from, b, a], [to, a, b]] {
            let normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]).normalize_or(along);
            for vertex in vertices {
                out.indices.push(out.positions.len() as u32);
                out.positions.push(vertex.as_vec3());
                out.normals.push(normal.as_vec3().normalize_or(Vec3::Y));
                out.joint_indices.extend([joint as u16, 0, 0, 0]);
                out.joint_weights.extend([1.0, 0.0, 0.0, 0.0]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_motion::Transform;

    fn asset(offsets: &[(Option<u32>, Vec3)]) -> Asset {
        let names = (0..offsets.len()).map(|i| format!("j{i}")).collect();
        let rest =
            offsets.iter().map(|(_, t)| Transform { translation: *t, ..Transform::IDENTITY }).collect();
        let skeleton = Skeleton::new(names, offsets.iter().map(|(p, _)| *p).collect(), rest).unwrap();
        let mut asset = Asset { skeleton: Arc::new(skeleton), ..Asset::default() };
        add_bones(&mut asset);
        asset
    }

    #[test]
    fn each_bone_is_one_octahedron_with_outward_normals() {
        let asset = asset(&[(None, Vec3::Y), (Some(0), Vec3::Y), (Some(1), Vec3::X), (Some(0), Vec3::ZERO)]);
        let p = &asset.meshes[0].primitives[0];
        assert_eq!((p.positions.len(), p.indices.len()), (48, 48));
        assert_eq!(p.joint_indices[..4], [0, 0, 0, 0]);
        assert_eq!(p.joint_indices[24 * 4], 1);
        for bone in [0..24, 24..48] {
            let middle = p.positions[bone.clone()].iter().sum::<Vec3>() / 24.0;
            for i in bone {
                assert!(
                    p.normals[i].dot(p.positions[i] - middle) > 0.0,
                    "the normal of vertex {i} points inwards"
                );
            }
        }
        let bounds = asset.rest_bounds();
        assert!((bounds.max - Vec3::new(1.0, 2.0, 0.0)).length() < 0.2, "{bounds:?}");
    }

    #[test]
    fn skeletons_without_extent_and_without_joints() {
        assert!(asset(&[]).meshes.is_empty());
        assert_eq!(asset(&[(None, Vec3::ZERO)]).meshes[0].primitives[0].positions.len(), 24);
    }
}
