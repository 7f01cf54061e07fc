//! Rest pose, bounds and hash of an asset, each computed when first requested.

use crate::asset::{Asset, MeshInstance};
use crate::asset_hash::asset_hash;
use crate::bounds::{Aabb, BoundsPart, InstanceBounds};
use crate::hash::ContentHash;
use crate::skinning::VertexTransforms;
use choreo_motion::{Facing, Front, Pose, Skinning};
use glam::{Affine3A, Mat4, Vec3};

impl Asset {
    /// Front of the character, detected from its skeleton and clips.
    pub fn facing(&self) -> &Facing {
        self.derived.facing.get_or_init(|| Facing::of(&self.skeleton, &self.clips))
    }

    /// Front of the character: the given one, otherwise the detected one.
    pub fn front(&self) -> Front {
        self.front.unwrap_or_else(|| self.facing().front)
    }

    /// The skeleton's rest pose.
    pub fn rest_pose(&self) -> &Pose {
        self.derived.rest_pose.get_or_init(|| Pose::rest(&self.skeleton))
    }

    /// model-from-joint of every joint in rest pose.
    pub fn rest_model_from_joint(&self) -> &[Affine3A] {
        self.derived.rest_model_from_joint.get_or_init(|| self.skeleton.rest_model_from_joint())
    }

    /// Bounds of each mesh instance relative to the joints that move it; see [`InstanceBounds::posed`].
    pub fn instance_bounds(&self) -> &[InstanceBounds] {
        self.derived
            .instance_bounds
            .get_or_init(|| self.instances.iter().map(|instance| instance_bounds(self, instance)).collect())
    }

    /// Tight box of all vertices in rest pose, in model space, without morphs; empty if there is no mesh.
    pub fn rest_bounds(&self) -> Aabb {
        *self.derived.rest_bounds.get_or_init(|| rest_bounds(self))
    }

    /// BLAKE3 of everything an actor takes from the asset: tree, meshes, skins, materials, images, cameras, lights, clips.
    pub fn content_hash(&self) -> ContentHash {
        *self.derived.content_hash.get_or_init(|| asset_hash(self))
    }
}

/// Directions to the faces and corners of a cube; opposite ones are left out, since each is used with both signs.
const OUTLINE_DIRECTIONS: [Vec3; 7] = [
    Vec3::X,
    Vec3::Y,
    Vec3::Z,
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(1.0, 1.0, -1.0),
    Vec3::new(1.0, -1.0, 1.0),
    Vec3::new(-1.0, 1.0, 1.0),
];

/// The farthest vertex, as (primitive, vertex), from one joint along each of `OUTLINE_DIRECTIONS` and its opposite.
#[derive(Clone, Copy)]
struct FarthestVertices([(f32, Option<(u32, u32)>); 14]);

impl FarthestVertices {
    fn add(&mut self, point: Vec3, vertex: (u32, u32)) {
        for (i, direction) in OUTLINE_DIRECTIONS.iter().enumerate() {
            let along = point.dot(*direction);
            for (slot, along) in [(2 * i, along), (2 * i + 1, -along)] {
                if along > self.0[slot].0 {
                    self.0[slot] = (along, Some(vertex));
                }
            }
        }
    }
}

fn instance_bounds(asset: &Asset, instance: &MeshInstance) -> InstanceBounds {
    let Some(mesh) = asset.meshes.get(instance.mesh as usize) else {
        return InstanceBounds::default();
    };
    let skin = instance.skin.and_then(|s| asset.skins.get(s as usize));
    let mut slots: Vec<(u32, Mat4)> = match skin {
        Some(skin) => {
            let inverse_bind = |i: usize| skin.inverse_bind.get(i).copied().unwrap_or(Mat4::IDENTITY);
            skin.joints.iter().enumerate().map(|(i, joint)| (*joint, inverse_bind(i))).collect()
        }
        None => Vec::new(),
    };
    // Primitives without influences are rigid, in a skinned instance too.
    let rigid = slots.len();
    slots.push((instance.joint, Mat4::IDENTITY));
    let mut parts: Vec<BoundsPart> = slots
        .iter()
        .map(|(joint, _)| BoundsPart {
            joint: *joint,
            reach: Aabb::EMPTY,
            morphs: vec![Aabb { min: Vec3::ZERO, max: Vec3::ZERO }; mesh.morph_targets],
        })
        .collect();
    let mut farthest = vec![FarthestVertices([(f32::NEG_INFINITY, None); 14]); slots.len()];
    for (index, primitive) in mesh.primitives.iter().enumerate() {
        for (v, position) in primitive.positions.iter().enumerate() {
            let n = if skin.is_some() { primitive.influences } else { 0 };
            let mut add_to_slot = |slot: usize| {
                if let (Some(part), Some((_, inverse_bind))) = (parts.get_mut(slot), slots.get(slot)) {
                    let point = inverse_bind.transform_point3(*position);
                    part.reach.add(point);
                    farthest[slot].add(point, (index as u32, v as u32));
                    for (target, morph) in primitive.morphs.iter().enumerate() {
                        if let (Some(offset), Some(reach)) =
                            (morph.positions.get(v), part.morphs.get_mut(target))
                        {
                            reach.add(inverse_bind.transform_vector3(*offset));
                        }
                    }
                }
            };
            if n == 0 {
                add_to_slot(rigid);
                continue;
            }
            for k in v * n..(v + 1) * n {
                if let (Some(slot), Some(weight)) =
                    (primitive.joint_indices.get(k), primitive.joint_weights.get(k))
                    && *weight > 0.0
                {
                    add_to_slot(usize::from(*slot));
                }
            }
        }
    }
    if !instance.copies.is_empty() {
        parts[rigid].extend_to_copies(&instance.copies);
    }
    parts.retain(|part| !part.reach.is_empty());
    let mut outline: Vec<(u32, u32)> = Vec::new();
    if mesh.morph_targets == 0 && instance.copies.is_empty() && asset.placements.is_empty() {
        outline.extend(farthest.iter().flat_map(|f| f.0).filter_map(|(_, vertex)| vertex));
        outline.sort_unstable();
        outline.dedup();
    }
    InstanceBounds { parts, outline }
}

/// Box of all vertices in rest pose, without morphs: tight, unlike [`InstanceBounds::posed`]. Copies and placements contribute
/// transformed boxes.
fn rest_bounds(asset: &Asset) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for instance in &asset.instances {
        let Some(mesh) = asset.meshes.get(instance.mesh as usize) else { continue };
        let joints = asset.rest_model_from_joint();
        if !instance.copies.is_empty() {
            let points = mesh.primitives.iter().flat_map(|p| p.positions.iter().copied());
            let mesh_bounds = Aabb::of(points);
            let joint = joints.get(instance.joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            let boxes = instance.copies.iter().map(|copy| mesh_bounds.transformed(&(joint * *copy)));
            bounds = boxes.fold(bounds, Aabb::union);
            continue;
        }
        let transforms = VertexTransforms::new(Skinning::Linear, asset, instance, joints);
        for primitive in &mesh.primitives {
            for (v, position) in primitive.positions.iter().enumerate() {
                let model_from_mesh = transforms.at_vertex(primitive, v);
                bounds.add(model_from_mesh.transform_point3(position.as_dvec3()).as_vec3());
            }
        }
    }
    asset.spread(&bounds)
}
