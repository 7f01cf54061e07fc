//! Axis-aligned bounding boxes of primitives and of their morphed, skinned instances. They are conservative (never too small), so
//! that culling removes nothing visible.

use crate::affine::Affine3x4;
use crate::scene_resources::watertight::WatertightOrder;
use choreo_asset::{Aabb, Primitive, Topology};
use choreo_motion::StretchedDualQuaternion;
use glam::{DAffine3, Mat4, Vec2, Vec3};
use std::ops::Range;
use std::sync::OnceLock;

/// Bounding box of a transformed box: the center is transformed, the half extents by the absolute matrix.
pub(crate) fn transformed(b: Aabb, rows: &Affine3x4) -> Aabb {
    if b.is_empty() {
        return Aabb::EMPTY;
    }
    let (c, h) = (b.center(), (b.max - b.min) * 0.5);
    let center = rows.transform_point(c);
    let half = Vec3::from_array(std::array::from_fn(|i| rows.0[i].truncate().abs().dot(h) * (1.0 + 1e-6)));
    Aabb { min: center - half, max: center + half }
}

/// Facts about a primitive that planning needs in addition to its arrays, computed once for the scene resources.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimitiveInfo {
    /// Whether array lengths fit together and every index is in range. Broken primitives are never drawn.
    pub valid: bool,
    /// Bounds of the unmorphed positions in mesh space.
    pub bounds: Aabb,
    /// (skin joint, bounds of the vertices that it moves), sorted by joint.
    pub joint_bounds: Vec<(u16, Aabb)>,
    /// Bounds of each morph target's offsets, zero included.
    pub morph_bounds: Vec<Aabb>,
    /// Influences per vertex with a weight other than zero, rounded up: 0, 4 or 8.
    pub influences: usize,
    /// Whether some vertex color is not white.
    pub colored: bool,
    /// Whether the triangles fill all faces of `bounds`: the primitive is a rectangle along the axes, or a box.
    pub covers_bounding_box: bool,
    /// Joints that share a vertex with each joint, itself included. Computed on first use.
    connected_joints: OnceLock<Vec<Vec<u16>>>,
    /// Computed on first use; see [`crate::scene_resources::PrimitiveResource::watertight`].
    pub(crate) watertight: OnceLock<WatertightOrder>,
    /// Computed on first use; see [`crate::scene_resources::PrimitiveResource::morphed_ranges`].
    pub(crate) morphed_ranges: OnceLock<Vec<Range<u32>>>,
}

impl PrimitiveInfo {
    pub fn new(p: &Primitive) -> PrimitiveInfo {
        let n = p.positions.len();
        let fits = |len: usize| len == 0 || len == n;
        let valid = n > 0
            && fits(p.normals.len())
            && fits(p.tangents.len())
            && p.uvs.iter().all(|u| fits(u.len()))
            && fits(p.colors.len())
            && matches!(p.influences, 0 | 4 | 8)
            && p.joint_indices.len() == n * p.influences
            && p.joint_weights.len() == n * p.influences
            && p.morphs
                .iter()
                .all(|m| fits(m.positions.len()) && fits(m.normals.len()) && fits(m.tangents.len()))
            && p.indices.iter().all(|&i| (i as usize) < n);
        let mut info = PrimitiveInfo {
            valid,
            bounds: Aabb::of(p.positions.iter().copied()),
            joint_bounds: Vec::new(),
            morph_bounds: Vec::new(),
            influences: 0,
            colored: p.colors.iter().any(|&c| c != glam::Vec4::ONE),
            covers_bounding_box: false,
            connected_joints: OnceLock::new(),
            watertight: OnceLock::new(),
            morphed_ranges: OnceLock::new(),
        };
        if !valid {
            return info;
        }
        info.covers_bounding_box = covers_bounding_box(p, &info.bounds);
        info.morph_bounds = p
            .morphs
            .iter()
            .map(|m| Aabb::of(m.positions.iter().copied().chain(std::iter::once(Vec3::ZERO))))
            .collect();
        if p.influences > 0 {
            info.influences = 4;
            let mut boxes: Vec<Aabb> = Vec::new();
            for (v, position) in p.positions.iter().enumerate() {
                for k in 0..p.influences {
                    let weight = p.joint_weights[v * p.influences + k];
                    if weight == 0.0 {
                        continue;
                    }
                    if k >= 4 {
                        info.influences = 8;
                    }
                    let joint = p.joint_indices[v * p.influences + k] as usize;
                    if boxes.len() <= joint {
                        boxes.resize(joint + 1, Aabb::EMPTY);
                    }
                    boxes[joint].add(*position);
                }
            }
            info.joint_bounds = (0u16..).zip(boxes).filter(|(_, b)| !b.is_empty()).collect();
        }
        info
    }

    /// Largest index of a skin joint in use, plus one.
    pub fn joint_count(&self) -> usize {
        self.joint_bounds.last().map_or(0, |(j, _)| *j as usize + 1)
    }

    /// Bounds of the offset by which the weighted morph targets can move a vertex: Σ wᵢ · bounds of target i.
    pub(crate) fn morph_offset(&self, weights: &[f32]) -> Aabb {
        let mut sum = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        for (b, &w) in self.morph_bounds.iter().zip(weights) {
            let (a, b) = (b.min * w, b.max * w);
            sum = Aabb { min: sum.min + a.min(b), max: sum.max + a.max(b) };
        }
        sum
    }

    /// Camera-relative bounds of an instance with one transform.
    pub fn rigid_bounds(&self, relative_from_mesh: &Affine3x4, morph_offset: Aabb) -> Aabb {
        transformed(expanded(self.bounds, morph_offset), relative_from_mesh)
    }

    /// Camera-relative bounds of a skinned instance. A skinned vertex is a convex combination of its positions under each joint,
    /// so the union of the boxes that the joints transform contains it.
    pub fn skinned_bounds(&self, joints: &[Affine3x4], morph_offset: Aabb) -> Aabb {
        let mut all = Aabb::EMPTY;
        for (joint, b) in &self.joint_bounds {
            if let Some(rows) = joints.get(*joint as usize) {
                all = all.union(transformed(expanded(*b, morph_offset), rows));
            }
        }
        all
    }

    /// Camera-relative bounds of an instance with dual-quaternion skinning.
    ///
    /// With q = Σ wᵢ qᵢ, a vertex moves to Σᵢⱼ wᵢ wⱼ pᵢ qᵢ q̄ⱼ / |q|², where pᵢ is its stretched position moved by joint i alone.
    /// Since the same sum of any fixed point c is c, the vertex is at most max |pᵢ − c| / |q| from c. If all pairs of qᵢ have a
    /// dot product of at least κ, |q| ≥ κ + (1 − κ) / n for n influences, since the heaviest weighs at least 1/n.
    pub fn dual_quaternion_bounds(
        &self,
        primitive: &Primitive,
        carriers: &[StretchedDualQuaternion],
        relative_from_model: &Affine3x4,
        morph_offset: Aabb,
    ) -> Aabb {
        let connected_joints =
            self.connected_joints.get_or_init(|| connected_joints(primitive, self.joint_count()));
        let mut all = Aabb::EMPTY;
        for (joint, b) in &self.joint_bounds {
            let of = |j: &u16| carriers.get(usize::from(*j));
            let together = || connected_joints[usize::from(*joint)].iter().filter_map(of);
            let reach = expanded(*b, morph_offset);
            let stretched = together().fold(Aabb::EMPTY, |sum, c| {
                let stretch = DAffine3 { matrix3: c.stretch, translation: glam::DVec3::ZERO };
                sum.union(transformed(reach, &Affine3x4::from_affine(stretch)))
            });
            let hull = together().fold(Aabb::EMPTY, |sum, c| {
                sum.union(transformed(stretched, &Affine3x4::from_affine(c.rigid())))
            });
            let alike = |a: &StretchedDualQuaternion| {
                together().map(|b| a.real.dot(b.real).abs()).fold(1.0, f64::min)
            };
            let kappa = together().map(alike).fold(1.0, f64::min);
            let most = self.influences.min(together().count()).max(1);
            let shortest = kappa + (1.0 - kappa) / most as f64;
            let mut bounds = hull;
            if together().nth(1).is_some() && !hull.is_empty() {
                let (center, radius) = (hull.center(), (hull.max - hull.min).length() * 0.5);
                let radius = Vec3::splat((f64::from(radius) / shortest * (1.0 + 1e-6)) as f32);
                bounds = Aabb { min: center - radius, max: center + radius };
            }
            all = all.union(transformed(bounds, relative_from_model));
        }
        all
    }
}

/// The joints that share a vertex with each joint.
fn connected_joints(p: &Primitive, joints: usize) -> Vec<Vec<u16>> {
    let mut all = vec![std::collections::BTreeSet::new(); joints];
    let vertices = p.joint_indices.chunks_exact(p.influences.max(1));
    for (joints, weights) in vertices.zip(p.joint_weights.chunks_exact(p.influences.max(1))) {
        let used = || joints.iter().zip(weights).filter(|(_, w)| **w != 0.0).map(|(j, _)| *j);
        for joint in used() {
            all[usize::from(joint)].extend(used());
        }
    }
    all.into_iter().map(|joints| joints.into_iter().collect()).collect()
}

fn expanded(b: Aabb, by: Aabb) -> Aabb {
    Aabb { min: b.min + by.min, max: b.max + by.max }
}

/// Whether the triangles lie in the faces of the bounding box and cover them: one face for a flat primitive, else all six.
fn covers_bounding_box(p: &Primitive, bounds: &Aabb) -> bool {
    let size = (bounds.max - bounds.min).as_dvec3();
    let faces = size.x * size.y + size.y * size.z + size.z * size.x;
    let wanted = if size.min_element() == 0.0 { faces } else { 2.0 * faces };
    let mut area = 0.0;
    for triangle in p.indices.chunks_exact(3) {
        let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|i| p.positions[i as usize]);
        let in_face =
            |k: usize| (a[k] == b[k] && b[k] == c[k]) && (a[k] == bounds.min[k] || a[k] == bounds.max[k]);
        if !(0..3).any(in_face) {
            return false;
        }
        area += 0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length();
    }
    p.topology == Topology::Triangles && wanted > 0.0 && area > 0.999_999 * wanted
}

/// Frustum culling: whether a whole box lies outside one plane of the view frustum `|x|,|y| ≤ w, 0 ≤ z ≤ w`.
/// A box with a number that is not finite counts as visible. `margin` widens the frustum, in clip space.
pub(crate) fn is_outside_frustum(b: Aabb, clip_from_relative: &Mat4, margin: Vec2) -> bool {
    let corners = b.corners().map(|c| *clip_from_relative * c.extend(1.0));
    if corners.iter().any(|c| !c.is_finite()) {
        return false;
    }
    // Lines and points extend half a pixel beyond their boxes, and results are rounded, so the test is a little wider than exact.
    let slack = |w: f32| w.abs() * 1e-3 + 1e-6;
    let side = |w: f32, margin: f32| w + w.abs() * margin + slack(w);
    corners.iter().all(|c| c.x > side(c.w, margin.x))
        || corners.iter().all(|c| -c.x > side(c.w, margin.x))
        || corners.iter().all(|c| c.y > side(c.w, margin.y))
        || corners.iter().all(|c| -c.y > side(c.w, margin.y))
        || corners.iter().all(|c| c.z > c.w + slack(c.w))
        || corners.iter().all(|c| c.z < -slack(c.w))
}

/// Whether a whole box lies beyond a view's near plane, so that the viewer is outside the box.
pub(crate) fn is_beyond_near_plane(b: Aabb, clip_from_relative: &Mat4) -> bool {
    let corners = b.corners().map(|c| *clip_from_relative * c.extend(1.0));
    // False for numbers that are not finite, and within the rounding error of the near plane.
    corners.iter().all(|c| c.w > 0.0 && c.z < c.w * (1.0 - 1e-4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec4;

    #[test]
    fn a_viewer_inside_a_box_or_near_it_is_not_outside() {
        // 57° high, the near plane at 0.5 m, reversed Z.
        let half = 1.0 / libm::tanf(0.5);
        let rows = [Vec4::X * half, Vec4::Y * -half, Vec4::W * 0.5, -Vec4::Z];
        let clip_from_relative = Mat4::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose();
        let at = |z: f32| {
            let b = Aabb { min: Vec3::new(-1.0, -1.0, z - 1.0), max: Vec3::new(1.0, 1.0, z) };
            is_beyond_near_plane(b, &clip_from_relative)
        };
        assert!(at(-0.6) && at(-90.0));
        assert!(!at(-0.4) && !at(0.5) && !at(3.0) && !at(f32::NAN));
    }
}
