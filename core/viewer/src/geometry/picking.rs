//! Picking: finds the actor whose posed surface a ray hits first.

use choreo_asset::{Asset, Topology};
use choreo_stage::{ActorState, Snapshot, Stage, posed_meshes};
use glam::{DVec3, Vec3};

/// Radius within which points and lines are picked, as a fraction of their distance from the camera.
const PICK_RADIUS_RATIO: f64 = 0.01;

/// Index of the first actor that a ray hits. `pickable`: whether an actor may be picked.
pub fn pick_actor(
    stage: &Stage,
    snapshot: &Snapshot,
    (origin, direction): (DVec3, DVec3),
    pickable: impl Fn(usize) -> bool,
) -> Option<usize> {
    let mut best: Option<(f64, usize)> = None;
    for (index, (actor, state)) in stage.actors.iter().zip(&snapshot.actors).enumerate() {
        if !state.visible || !pickable(index) {
            continue;
        }
        let reach = best.map_or(f64::INFINITY, |(t, _)| t);
        if let Some((low, high)) = bounds(&actor.asset, state)
            && !ray_hits_box(origin, direction, low, high)
        {
            continue;
        }
        if let Some(t) = ray_mesh_distance(&actor.asset, state, origin, direction).filter(|t| *t < reach) {
            best = Some((t, index));
        }
    }
    best.map(|(_, index)| index)
}

/// World-space bounds of a posed actor: smallest and largest corner. `None` if the actor has no surface.
pub fn bounds(asset: &Asset, state: &ActorState) -> Option<(DVec3, DVec3)> {
    let mut all = choreo_asset::Aabb::EMPTY;
    if state.model_from_joint.len() >= asset.skeleton.len() {
        for (instance, weights) in asset.instance_bounds().iter().zip(&state.morph_weights) {
            all = all.union(instance.posed(&state.model_from_joint, weights));
        }
    }
    let all = asset.spread(&all);
    if all.is_empty() {
        return None;
    }
    let corners = all.corners().map(|c| state.world_from_model.transform_point3(c.as_dvec3()));
    let low = corners.iter().copied().reduce(DVec3::min)?;
    Some((low, corners.iter().copied().reduce(DVec3::max)?))
}

/// Ray-box intersection by slabs (Kay and Kajiya 1986).
fn ray_hits_box(origin: DVec3, direction: DVec3, low: DVec3, high: DVec3) -> bool {
    let margin = DVec3::splat(1e-6) + (high - low) * 1e-6;
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let (a, b) = (low[axis] - margin[axis] - origin[axis], high[axis] + margin[axis] - origin[axis]);
        if direction[axis] == 0.0 {
            if a > 0.0 || b < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (a / direction[axis], b / direction[axis]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    near <= far
}

/// Distance along the ray to the surface of a posed actor, metres.
fn ray_mesh_distance(asset: &Asset, state: &ActorState, origin: DVec3, direction: DVec3) -> Option<f64> {
    let mut nearest: Option<f64> = None;
    let mut meet = |t: Option<f64>| {
        if let Some(t) = t.filter(|t| *t > 0.0) {
            nearest = Some(nearest.map_or(t, |n| n.min(t)));
        }
    };
    for posed in posed_meshes(asset, state) {
        let mesh = asset.instances.get(posed.instance).and_then(|i| asset.meshes.get(i.mesh as usize));
        let primitives = mesh.map_or(&[][..], |m| &m.primitives);
        for (primitive, at) in primitives.iter().zip(&posed.primitives) {
            let place = |i: &u32| at.positions.get(*i as usize).copied();
            match primitive.topology {
                Topology::Triangles => {
                    for vertices in primitive.indices.chunks_exact(3) {
                        if let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|i| place(&vertices[i])) {
                            meet(ray_triangle_distance(origin, direction, a, b, c));
                        }
                    }
                }
                _ => primitive
                    .indices
                    .iter()
                    .filter_map(place)
                    .for_each(|p| meet(ray_point_distance(origin, direction, p))),
            }
        }
    }
    nearest
}

/// Distance along a ray to a triangle, both faces (Möller and Trumbore 1997).
fn ray_triangle_distance(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, c: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_a = origin - a;
    let u = from_a.dot(p) / determinant;
    let q = from_a.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / determinant)
}

fn ray_point_distance(origin: DVec3, direction: DVec3, point: DVec3) -> Option<f64> {
    let along = (point - origin).dot(direction);
    ((point - origin - direction * along).length() < PICK_RADIUS_RATIO * along).then_some(along)
}

/// Center of an actor's bounds in world space, else its position.
pub fn bounds_center(asset: &Asset, state: &ActorState) -> DVec3 {
    bounds(asset, state).map_or(state.world_from_model.translation, |(low, high)| (low + high) / 2.0)
}

/// Mean of the centers of all visible actors, world space. `None` if there are none.
pub(crate) fn bounds_center_of_all(stage: &Stage, snapshot: &Snapshot) -> Option<DVec3> {
    let actors = || stage.actors.iter().zip(&snapshot.actors).filter(|(_, state)| state.visible);
    let count = actors().count();
    (count > 0)
        .then(|| actors().map(|(a, state)| bounds_center(&a.asset, state)).sum::<DVec3>() / count as f64)
}

/// Largest side of the bounds in the rest pose, metres, for steps and gizmos; 1 m if there is no surface.
pub fn largest_extent(asset: &Asset) -> f64 {
    let bounds = asset.rest_bounds();
    let size = if bounds.is_empty() { Vec3::ONE } else { bounds.max - bounds.min };
    f64::from(size.max_element()).clamp(0.01, 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_triangles_from_both_sides_and_boxes_edge_on() {
        let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let hit = |from: DVec3, to: DVec3| ray_triangle_distance(from, to, a, b, c);
        assert_eq!(hit(DVec3::new(0.2, 0.2, 2.0), -DVec3::Z), Some(2.0));
        assert_eq!(hit(DVec3::new(0.2, 0.2, -2.0), DVec3::Z), Some(2.0));
        assert_eq!(hit(DVec3::new(0.8, 0.8, 2.0), -DVec3::Z), None);
        assert_eq!(hit(DVec3::new(0.2, 0.2, 2.0), DVec3::X), None, "along it");
        let flat = (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 0.0, 1.0));
        assert!(ray_hits_box(DVec3::new(0.0, 5.0, 0.0), -DVec3::Y, flat.0, flat.1));
        assert!(ray_hits_box(DVec3::new(-5.0, 0.0, 0.0), DVec3::X, flat.0, flat.1));
        assert!(!ray_hits_box(DVec3::new(-5.0, 1.0, 0.0), DVec3::X, flat.0, flat.1));
        assert!(!ray_hits_box(DVec3::new(-5.0, 0.0, 0.0), -DVec3::X, flat.0, flat.1), "behind");
    }
}
