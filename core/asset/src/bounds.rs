//! Bounding boxes of an asset at rest, and of a mesh instance in any pose without touching its vertices.
//!
//! A linearly skinned vertex is a convex combination of its positions under each of its joints (weights ≥ 0, sum 1), so it lies
//! in the convex hull of the joints' boxes. Boxes around the vertices that each joint influences, in the joint's space, therefore
//! bound every pose.

use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec3A};

/// Axis-aligned bounding box; empty if `min > max` on any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box; its union with another box is that box.
    pub const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Whether the box contains no points.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around the points that are finite.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        points.into_iter().for_each(|p| bounds.add(p));
        bounds
    }

    /// Extends the box to a point. Points that are not finite are ignored.
    pub fn add(&mut self, point: Vec3) {
        if point.is_finite() {
            self.min = self.min.min(point);
            self.max = self.max.max(point);
        }
    }

    /// The smallest box around both boxes.
    #[inline]
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Center of the box; the origin if it is empty.
    #[inline]
    pub fn center(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.min * 0.5 + self.max * 0.5 }
    }

    /// Box around this one under an affine map, widened by the rounding error of f32.
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

    /// The eight vertices of the box.
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
    /// Smallest coordinates, metres.
    pub min: DVec3,
    /// Largest coordinates, metres.
    pub max: DVec3,
}

impl DAabb {
    /// The empty box.
    pub const EMPTY: DAabb = DAabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Extends the box to a point. Points that are not finite are ignored.
    pub fn add(&mut self, p: DVec3) {
        if p.is_finite() {
            self.min = self.min.min(p);
            self.max = self.max.max(p);
        }
    }

    /// Whether the box contains no points.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Extends the box to a box in model space. Boxes that are empty or not finite are ignored.
    pub fn add_box(&mut self, world_from_model: &DAffine3, model: &Aabb) {
        if model.is_empty() {
            return;
        }
        for corner in model.corners() {
            self.add(world_from_model.transform_point3(corner.as_dvec3()));
        }
    }
}

/// Bounds of one mesh instance relative to the joints that move it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceBounds {
    /// The boxes, one for each joint that moves vertices.
    pub parts: Vec<BoundsPart>,
    /// Vertices, as (primitive, vertex), that are farthest from each joint in 14 directions, sorted. Once posed, they frame a
    /// still image of the instance almost exactly, more closely than boxes. Empty for meshes with morphs, instances with copies,
    /// and instanced characters.
    pub outline: Vec<(u32, u32)>,
}

/// Bounds of the vertices that one joint moves.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundsPart {
    /// Joint of the asset's skeleton.
    pub joint: u32,
    /// Box around the vertices that the joint moves, in the joint's space.
    pub reach: Aabb,
    /// Box around those vertices' offsets at weight 1, zero included, for each morph target; empty list: no morphs.
    pub morphs: Vec<Aabb>,
}

impl InstanceBounds {
    /// Box in model space around one placement of the instance in this pose with these morph weights (`Asset::spread` extends it
    /// to all placements). Conservative: never smaller than the mesh, at a few ns per joint. Empty if the mesh has no vertices or
    /// nothing is finite.
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
    /// Extends the boxes to all copies of the mesh.
    pub(crate) fn extend_to_copies(&mut self, joint_from_copies: &[Affine3A]) {
        let union_over_copies = |one: &Aabb, place: fn(&Affine3A) -> Affine3A| {
            let boxes = joint_from_copies.iter().map(|copy| one.transformed(&place(copy)));
            boxes.fold(Aabb::EMPTY, Aabb::union)
        };
        self.reach = union_over_copies(&self.reach, |copy| *copy);
        let turned: fn(&Affine3A) -> Affine3A = |copy| Affine3A::from_mat3(copy.matrix3.into());
        for morph in &mut self.morphs {
            *morph = union_over_copies(morph, turned);
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

/// Smallest and largest value of each matrix element over several affine maps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AffineRange {
    low: Affine3A,
    high: Affine3A,
}

impl AffineRange {
    pub(crate) fn of(maps: &[Affine3A]) -> Option<AffineRange> {
        let (first, rest) = maps.split_first()?;
        let mut range = AffineRange { low: *first, high: *first };
        for map in rest {
            for (((low, high), now), _) in columns_mut(&mut range.low)
                .into_iter()
                .zip(columns_mut(&mut range.high))
                .zip(columns_of(map))
                .zip(0..4)
            {
                (*low, *high) = (low.min(now), high.max(now));
            }
        }
        Some(range)
    }

    /// Box around the images of a box under each of the maps, by interval arithmetic: exact for translations, somewhat large for
    /// rotations.
    pub(crate) fn transformed_bounds(&self, of: &Aabb) -> Aabb {
        let (mut min, mut max) = (self.low.translation, self.high.translation);
        let (low, high) = (self.low.matrix3, self.high.matrix3);
        for axis in 0..3 {
            let ends = [low.col(axis), high.col(axis)];
            let products = ends.map(|end| [end * of.min[axis], end * of.max[axis]]);
            let [[a, b], [c, d]] = products;
            min += a.min(b).min(c.min(d));
            max += a.max(b).max(c.max(d));
        }
        let slack = min.abs().max(max.abs()) * 1e-6;
        Aabb { min: (min - slack).into(), max: (max + slack).into() }
    }
}

fn columns_mut(a: &mut Affine3A) -> [&mut Vec3A; 4] {
    let m = &mut a.matrix3;
    [&mut m.x_axis, &mut m.y_axis, &mut m.z_axis, &mut a.translation]
}

fn columns_of(a: &Affine3A) -> [Vec3A; 4] {
    [a.matrix3.x_axis, a.matrix3.y_axis, a.matrix3.z_axis, a.translation]
}
