//! Ray casting against the triangles of a static stage in f64: the reference for approximations by maps.

use choreo_asset::Topology;
use choreo_stage::{Snapshot, Stage};
use glam::DVec3;

pub(crate) struct Hit {
    pub point: DVec3,
    /// Normal of the triangle, on the side from which the ray came.
    pub normal: DVec3,
}

/// Triangles of one actor, and their bounding box.
struct Shape {
    min: DVec3,
    max: DVec3,
    triangles: Vec<[DVec3; 3]>,
}

pub(crate) struct Shapes(Vec<Shape>);

impl Shapes {
    /// Collects all meshes that have no skin.
    pub(crate) fn of(stage: &Stage, snapshot: &Snapshot) -> Shapes {
        let mut shapes = Vec::new();
        for (actor, state) in stage.actors.iter().zip(&snapshot.actors) {
            let mut triangles = Vec::new();
            for instance in actor.asset.instances.iter().filter(|i| i.skin.is_none()) {
                let model_from_mesh = state.model_from_joint[instance.joint as usize];
                let place = |p: glam::Vec3| {
                    state.world_from_model.transform_point3(model_from_mesh.transform_point3(p).as_dvec3())
                };
                let mesh = &actor.asset.meshes[instance.mesh as usize];
                for p in mesh.primitives.iter().filter(|p| p.topology == Topology::Triangles) {
                    let at = |i: u32| place(p.positions[i as usize]);
                    triangles.extend(p.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
                }
            }
            let vertices = || triangles.iter().flatten().copied();
            let min = vertices().fold(DVec3::INFINITY, DVec3::min);
            let max = vertices().fold(DVec3::NEG_INFINITY, DVec3::max);
            shapes.push(Shape { min, max, triangles });
        }
        Shapes(shapes)
    }

    /// First hit of a ray. `direction`: unit vector.
    pub(crate) fn first_hit(&self, from: DVec3, direction: DVec3) -> Option<Hit> {
        let mut nearest = f64::INFINITY;
        let mut found = None;
        for shape in self.0.iter().filter(|s| s.crosses_bounds(from, direction)) {
            for triangle in &shape.triangles {
                if let Some(t) = ray_triangle_distance(triangle, from, direction)
                    && t < nearest
                {
                    (nearest, found) = (t, Some(triangle));
                }
            }
        }
        let [a, b, c] = *found?;
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Some(Hit { point: from + direction * nearest, normal })
    }

    /// Whether anything is hit along the ray.
    pub(crate) fn is_blocked(&self, from: DVec3, direction: DVec3) -> bool {
        let near = self.0.iter().filter(|s| s.crosses_bounds(from, direction));
        near.flat_map(|s| &s.triangles).any(|t| ray_triangle_distance(t, from, direction).is_some())
    }
}

impl Shape {
    /// Whether the ray intersects the box (Kay & Kajiya, slabs).
    fn crosses_bounds(&self, from: DVec3, direction: DVec3) -> bool {
        let inverse = direction.recip();
        let (a, b) = ((self.min - 1e-9 - from) * inverse, (self.max + 1e-9 - from) * inverse);
        let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
        leave >= enter.max(0.0)
    }
}

/// Distance along the ray (Möller & Trumbore, 1997); `None` if the triangle is behind, missed, or parallel to the ray.
fn ray_triangle_distance([a, b, c]: &[DVec3; 3], from: DVec3, direction: DVec3) -> Option<f64> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det.abs() < 1e-15 {
        return None;
    }
    let s = from - *a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = direction.dot(q) / det;
    let t = e2.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-9).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_triangle_inside_and_not_beside_or_behind() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let down = |x: f64, y: f64, z: f64| ray_triangle_distance(&t, DVec3::new(x, y, z), DVec3::NEG_Z);
        assert!((down(0.2, 0.3, 4.0).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(down(0.6, 0.6, 4.0), None, "beside");
        assert_eq!(down(0.2, 0.2, -1.0), None, "behind");
        assert_eq!(ray_triangle_distance(&t, DVec3::new(-1.0, 0.2, 0.0), DVec3::X), None, "along the plane");
    }
}
