//! Boxes: of an asset at rest, and of a mesh instance in any pose without touching its vertices.
//!
//! A skinned vertex is a convex combination of where each of its joints carries it (weights ≥ 0, sum 1), so it lies in the
//! hull of the joints' boxes: one box a joint, around the vertices it influences and in its own space, bounds every pose.

use crate::{Asset, MeshInstance};
use choreo_motion::Skinning;
use glam::{Affine3A, DAffine3, DVec3, Mat4, Vec3, Vec3A};

/// Axis-aligned box; empty where `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    pub min: Vec3,
    pub max: Vec3,
}

impl Aabb {
    pub const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    #[inline]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Aabb {
        let mut all = Aabb::EMPTY;
        points.into_iter().for_each(|p| all.add(p));
        all
    }

    /// Points that are not finite are left out.
    pub fn add(&mut self, point: Vec3) {
        if point.is_finite() {
            self.min = self.min.min(point);
            self.max = self.max.max(point);
        }
    }

    #[inline]
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The origin where empty.
    #[inline]
    pub fn center(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }

    /// The box around this one moved by an affine map, widened by the rounding of f32.
    pub fn transformed(&self, a_from_b: &Affine3A) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        let center = Vec3A::from(self.center());
        let half = Vec3A::from(self.max) - center;
        let m = &a_from_b.matrix3;
        let moved = a_from_b.transform_point3a(center);
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        let size = m.x_axis.abs() * center.x.abs()
            + m.y_axis.abs() * center.y.abs()
            + m.z_axis.abs() * center.z.abs()
            + a_from_b.translation.abs()
            + reach;
        let reach = reach + size * 1e-6;
        Aabb { min: (moved - reach).into(), max: (moved + reach).into() }
    }

    #[inline]
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            Vec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

/// A box in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DAabb {
    pub min: DVec3,
    pub max: DVec3,
}

impl DAabb {
    pub const EMPTY: DAabb = DAabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Points that are not finite add nothing.
    pub fn add(&mut self, p: DVec3) {
        if p.is_finite() {
            self.min = self.min.min(p);
            self.max = self.max.max(p);
        }
    }

    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Boxes that are empty or not finite add nothing.
    pub fn add_box(&mut self, world_from_model: &DAffine3, model: &Aabb) {
        if model.is_empty() {
            return;
        }
        for corner in model.corners() {
            self.add(world_from_model.transform_point3(corner.as_dvec3()));
        }
    }
}

/// The reach of one mesh instance from the joints that move it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceBounds {
    pub parts: Vec<BoundsPart>,
    /// (primitive, vertex) of the vertices that reach farthest from each joint in 14 directions: with them posed, a still
    /// picture of the instance is framed more closely than by boxes, and all but exactly. Sorted. Empty where morphs move them,
    /// of instances with copies, and of bodies that stand at places.
    pub outline: Vec<(u32, u32)>,
}

/// To the faces and corners of a cube; opposite ones are left out, being looked at with both signs.
const OUTLINE_DIRECTIONS: [Vec3; 7] = [
    Vec3::X,
    Vec3::Y,
    Vec3::Z,
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(1.0, 1.0, -1.0),
    Vec3::new(1.0, -1.0, 1.0),
    Vec3::new(-1.0, 1.0, 1.0),
];

/// The farthest vertex each way from one joint.
#[derive(Clone, Copy)]
struct Farthest([(f32, Option<(u32, u32)>); 14]);

impl Farthest {
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

#[derive(Clone, Debug, PartialEq)]
pub struct BoundsPart {
    /// Joint of the asset's skeleton.
    pub joint: u32,
    /// Around the vertices that the joint moves, in the joint's space.
    pub reach: Aabb,
    /// By morph target, the offsets at weight 1 of those vertices, zero included; empty list: no morphs.
    pub morphs: Vec<Aabb>,
}

impl InstanceBounds {
    pub(crate) fn of_asset(asset: &Asset) -> Vec<InstanceBounds> {
        asset.instances.iter().map(|instance| InstanceBounds::of(asset, instance)).collect()
    }

    fn of(asset: &Asset, instance: &MeshInstance) -> InstanceBounds {
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
        let mut farthest = vec![Farthest([(f32::NEG_INFINITY, None); 14]); slots.len()];
        for (index, primitive) in mesh.primitives.iter().enumerate() {
            for (v, position) in primitive.positions.iter().enumerate() {
                let n = if skin.is_some() { primitive.influences } else { 0 };
                let mut cover = |slot: usize| {
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
                    cover(rigid);
                    continue;
                }
                for k in v * n..(v + 1) * n {
                    if let (Some(slot), Some(weight)) =
                        (primitive.joint_indices.get(k), primitive.joint_weights.get(k))
                        && *weight > 0.0
                    {
                        cover(usize::from(*slot));
                    }
                }
            }
        }
        if !instance.copies.is_empty() {
            parts[rigid].spread(&instance.copies);
        }
        parts.retain(|part| !part.reach.is_empty());
        let mut outline: Vec<(u32, u32)> = Vec::new();
        if mesh.morph_targets == 0 && instance.copies.is_empty() && asset.places.is_empty() {
            outline.extend(farthest.iter().flat_map(|f| f.0).filter_map(|(_, vertex)| vertex));
            outline.sort_unstable();
            outline.dedup();
        }
        InstanceBounds { parts, outline }
    }

    /// A box in model space that holds the instance in this pose with these morph weights, where the body stands once
    /// ([`Asset::spread`] goes on to its places): conservative, never smaller than the mesh, at a few ns a joint. Empty where the mesh has no vertices or nothing is finite.
    pub fn posed(&self, model_from_joint: &[Affine3A], morph_weights: &[f32]) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for part in &self.parts {
            let Some(model_from_joint) = model_from_joint.get(part.joint as usize) else { continue };
            let moved = part.morphed(morph_weights).transformed(model_from_joint);
            if moved.min.is_finite() && moved.max.is_finite() {
                bounds = bounds.union(moved);
            }
        }
        bounds
    }
}

impl BoundsPart {
    /// Around all copies of what it was around.
    fn spread(&mut self, joint_from_copies: &[Affine3A]) {
        let over = |one: &Aabb, place: fn(&Affine3A) -> Affine3A| {
            let boxes = joint_from_copies.iter().map(|copy| one.transformed(&place(copy)));
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        self.reach = over(&self.reach, |copy| *copy);
        let turned: fn(&Affine3A) -> Affine3A = |copy| Affine3A::from_mat3(copy.matrix3.into());
        for morph in &mut self.morphs {
            *morph = over(morph, turned);
        }
    }

    /// The reach with these morph weights, in the joint's space.
    pub fn morphed(&self, morph_weights: &[f32]) -> Aabb {
        let mut reach = self.reach;
        for (offset, weight) in self.morphs.iter().zip(morph_weights) {
            let (a, b) = (offset.min * *weight, offset.max * *weight);
            reach.min += a.min(b);
            reach.max += a.max(b);
        }
        reach
    }
}

/// Every vertex in rest pose, without morphs: tight, unlike [`InstanceBounds::posed`]. Of copies and places the box of the mesh or body counts.
pub(crate) fn rest_bounds(asset: &Asset) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for instance in &asset.instances {
        let Some(mesh) = asset.meshes.get(instance.mesh as usize) else { continue };
        let joints = asset.rest_model_from_joint();
        if !instance.copies.is_empty() {
            let points = mesh.primitives.iter().flat_map(|p| p.positions.iter().copied());
            let one = Aabb::of(points);
            let joint = joints.get(instance.joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            let boxes = instance.copies.iter().map(|copy| one.transformed(&(joint * *copy)));
            bounds = boxes.fold(bounds, Aabb::union);
            continue;
        }
        let carriers = crate::posed_mesh::Carriers::new(Skinning::Linear, asset, instance, joints);
        for primitive in &mesh.primitives {
            for (v, position) in primitive.positions.iter().enumerate() {
                let model_from_mesh = carriers.at_vertex(primitive, v);
                bounds.add(model_from_mesh.transform_point3(position.as_dvec3()).as_vec3());
            }
        }
    }
    asset.spread(&bounds)
}
