//! Axis-aligned boxes of primitives and their posed, morphed, skinned copies: never too small, so that culling never shows.

use crate::plan::Rows;
use crate::scene_resources::watertight::Closed;
pub use choreo_asset::Aabb;
use choreo_asset::Primitive;
use choreo_motion::StretchedDualQuaternion;
use glam::{Affine3A, DAffine3, Mat4, Vec2, Vec3};
use std::ops::Range;
use std::sync::OnceLock;

/// Box of the transformed box: centre moved, half extents by the absolute matrix.
pub fn moved(b: Aabb, rows: &Rows) -> Aabb {
    if b.is_empty() {
        return Aabb::EMPTY;
    }
    let (c, h) = (b.center(), (b.max - b.min) * 0.5);
    let center = rows.transform_point(c);
    let half = Vec3::from_array(std::array::from_fn(|i| rows.0[i].truncate().abs().dot(h) * (1.0 + 1e-6)));
    Aabb { min: center - half, max: center + half }
}

/// What the planner must know of a primitive beside its arrays; computed once for the catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimitiveInfo {
    /// Array lengths fit together and every index is in range. Broken primitives are never drawn.
    pub valid: bool,
    /// Unmorphed positions in mesh space.
    pub bounds: Aabb,
    /// (skin joint, box of the vertices that it moves), by joint.
    pub joint_bounds: Vec<(u16, Aabb)>,
    /// Per morph target: box of its offsets, zero included.
    pub morph_bounds: Vec<Aabb>,
    /// Influences a vertex that weigh anything: 0, 4 or 8.
    pub influences: usize,
    /// Some vertex colour is not white.
    pub colored: bool,
    /// By joint: those that move a vertex together with it, itself included. Found when first asked for.
    companions: OnceLock<Vec<Vec<u16>>>,
    /// Found when first asked for; see [`crate::scene_resources::CatalogPrimitive::closed`].
    pub(crate) closed: OnceLock<Closed>,
    /// The same; see [`crate::scene_resources::CatalogPrimitive::moved`].
    pub(crate) moved: OnceLock<Vec<Range<u32>>>,
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
            companions: OnceLock::new(),
            closed: OnceLock::new(),
            moved: OnceLock::new(),
        };
        if !valid {
            return info;
        }
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

    /// Largest skin joint in use, plus one.
    pub fn joint_count(&self) -> usize {
        self.joint_bounds.last().map_or(0, |(j, _)| *j as usize + 1)
    }

    /// How far active morphs can move a vertex: Σ wᵢ · box of target i.
    pub fn morph_offset(&self, weights: &[f32]) -> Aabb {
        let mut sum = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        for (b, &w) in self.morph_bounds.iter().zip(weights) {
            let (a, b) = (b.min * w, b.max * w);
            sum = Aabb { min: sum.min + a.min(b), max: sum.max + a.max(b) };
        }
        sum
    }

    /// Relative-space box of a copy with one transform.
    pub fn posed(&self, relative_from_mesh: &Rows, morph_offset: Aabb) -> Aabb {
        moved(grown(self.bounds, morph_offset), relative_from_mesh)
    }

    /// Relative-space box of a skinned copy. A skinned vertex is a convex combination of its joints'
    /// images of it, so the union of the joints' transformed boxes holds it.
    pub fn skinned(&self, joints: &[Rows], morph_offset: Aabb) -> Aabb {
        let mut all = Aabb::EMPTY;
        for (joint, b) in &self.joint_bounds {
            if let Some(rows) = joints.get(*joint as usize) {
                all = all.union(moved(grown(*b, morph_offset), rows));
            }
        }
        all
    }

    /// Relative-space box of a dual-quaternion skinned copy.
    ///
    /// With q = Σ wᵢ qᵢ, a vertex goes to Σᵢⱼ wᵢ wⱼ pᵢ qᵢ q̄ⱼ / |q|², where pᵢ is the place that motion i alone gives its
    /// stretched position. As the same sum of any fixed point c is c, it is at most max |pᵢ − c| / |q| from c; and where all
    /// qᵢ are at least κ alike, |q| ≥ κ + (1 − κ) / n for n influences, since the heaviest weighs at least 1/n.
    pub fn dual_skinned(
        &self,
        primitive: &Primitive,
        carriers: &[StretchedDualQuaternion],
        relative_from_model: &Rows,
        morph_offset: Aabb,
    ) -> Aabb {
        let companions = self.companions.get_or_init(|| companions(primitive, self.joint_count()));
        let mut all = Aabb::EMPTY;
        for (joint, b) in &self.joint_bounds {
            let of = |j: &u16| carriers.get(usize::from(*j));
            let together = || companions[usize::from(*joint)].iter().filter_map(of);
            let reach = grown(*b, morph_offset);
            let stretched = together().fold(Aabb::EMPTY, |sum, c| {
                let stretch = DAffine3 { matrix3: c.stretch, translation: glam::DVec3::ZERO };
                sum.union(moved(reach, &Rows::from_affine(stretch)))
            });
            let hull = together()
                .fold(Aabb::EMPTY, |sum, c| sum.union(moved(stretched, &Rows::from_affine(c.rigid()))));
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
            all = all.union(moved(bounds, relative_from_model));
        }
        all
    }
}

/// By joint: the joints that share a vertex with it.
fn companions(p: &Primitive, joints: usize) -> Vec<Vec<u16>> {
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

fn grown(b: Aabb, by: Aabb) -> Aabb {
    Aabb { min: b.min + by.min, max: b.max + by.max }
}

/// True where the whole box lies outside one plane of the clip volume `|x|,|y| ≤ w, 0 ≤ z ≤ w`.
/// A box with a number that is not finite counts as visible. `margin`: how far beyond the picture still counts, in clip space.
pub fn outside(b: Aabb, clip_from_relative: &Mat4, margin: Vec2) -> bool {
    let corners = b.corners().map(|c| *clip_from_relative * c.extend(1.0));
    if corners.iter().any(|c| !c.is_finite()) {
        return false;
    }
    // Half a pixel of lines and points sticks out of their boxes; and rounding: a little wider than exact.
    let slack = |w: f32| w.abs() * 1e-3 + 1e-6;
    let side = |w: f32, margin: f32| w + w.abs() * margin + slack(w);
    corners.iter().all(|c| c.x > side(c.w, margin.x))
        || corners.iter().all(|c| -c.x > side(c.w, margin.x))
        || corners.iter().all(|c| c.y > side(c.w, margin.y))
        || corners.iter().all(|c| -c.y > side(c.w, margin.y))
        || corners.iter().all(|c| c.z > c.w + slack(c.w))
        || corners.iter().all(|c| c.z < -slack(c.w))
}

impl Rows {
    pub fn from_affine(a: glam::DAffine3) -> Rows {
        let m = a.matrix3;
        let row =
            |i: usize| glam::DVec4::new(m.x_axis[i], m.y_axis[i], m.z_axis[i], a.translation[i]).as_vec4();
        Rows([row(0), row(1), row(2)])
    }

    pub fn from_affine3a(a: Affine3A) -> Rows {
        Rows::from_affine(crate::plan::build::skins::daffine(a))
    }

    pub fn transform_point(&self, p: Vec3) -> Vec3 {
        let p = p.extend(1.0);
        Vec3::new(self.0[0].dot(p), self.0[1].dot(p), self.0[2].dot(p))
    }

    pub fn transform_vector(&self, v: Vec3) -> Vec3 {
        let v = v.extend(0.0);
        Vec3::new(self.0[0].dot(v), self.0[1].dot(v), self.0[2].dot(v))
    }

    /// This map after a stretch that leaves the origin.
    pub fn times(&self, stretch: &Rows) -> Rows {
        let [a, b, c] = stretch.0;
        let row = |r: glam::Vec4| (a * r.x + b * r.y + c * r.z).truncate().extend(r.w);
        Rows(self.0.map(row))
    }

    /// Another map after this.
    pub fn after(&self, outer: &Rows) -> Rows {
        let [a, b, c] = self.0;
        Rows(outer.0.map(|r| a * r.x + b * r.y + c * r.z + glam::Vec4::new(0.0, 0.0, 0.0, r.w)))
    }

    /// Determinant of the 3×3 part: negative where it mirrors.
    pub fn determinant(&self) -> f32 {
        let [a, b, c] = self.0.map(|r| r.truncate());
        a.dot(b.cross(c))
    }

    /// Length of the longest of the images of the three axes.
    pub fn largest_stretch(&self) -> f32 {
        let square = |axis: usize| self.0.iter().map(|row| row[axis] * row[axis]).sum::<f32>();
        square(0).max(square(1)).max(square(2)).sqrt()
    }
}
