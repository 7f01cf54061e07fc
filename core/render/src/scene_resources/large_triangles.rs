//! Splits triangles that are far larger than the view of nearby objects, such as the two triangles of a ground of 100 km.
//!
//! A device clips a triangle and interpolates its positions, depths and texture coordinates in f32. On 100 km that is exact to a
//! centimetre: the ground jitters under the feet of a character, and shadows on it move. Parts that are short near cameras and
//! actors, and long far from them, are exact everywhere, on every device, and cost some hundred triangles.
//!
//! Whether an edge is split depends on the edge alone, so that adjacent triangles stay without gaps. The result depends on the
//! stage, not on the frame.

use crate::affine::to_f64;
use crate::scene_resources::{PrimitiveResource, SceneResources};
use choreo_asset::{Primitive, Topology};
use choreo_motion::Time;
use choreo_stage::{Snapshot, Stage};
use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec4};
use std::collections::{HashMap, HashSet};

/// Largest length of an edge, as a multiple of its distance from the nearest camera or actor. A point on it is exact to 256 ·
/// 2⁻²³ of that distance, a twentieth of a pixel of an image 1,080 pixels high.
const MAX_EDGE_RATIO: f64 = 256.0;
/// Radius around a camera that counts as near it, as a multiple of its near plane.
const CAMERA_RADIUS_IN_NEAR_PLANES: f64 = 16.0;
/// Number of times at which actors and cameras are evaluated. Between these they are taken to move in straight lines.
const EVALUATION_TIMES: i64 = 17;
/// Largest number of triangles of a split mesh. One that needs more is split less.
const MAX_TRIANGLES: usize = 1 << 16;

/// Splits the large triangles of rigid meshes.
pub(super) fn split(resources: &mut SceneResources, stage: &Stage) {
    let placed = large_meshes(resources, stage);
    if placed.is_empty() {
        return;
    }
    let length = i128::from(stage.settings.length.0.max(0));
    let time = |i: i64| Time((length * i128::from(i) / i128::from(EVALUATION_TIMES - 1)) as i64);
    let Ok(snapshots) = stage.evaluate_placements(&(0..EVALUATION_TIMES).map(time).collect::<Vec<Time>>())
    else {
        return;
    };
    let mut uses: HashMap<u32, Vec<MeshUse>> = HashMap::new();
    for mesh in &placed {
        uses.entry(mesh.primitive).or_default().extend(MeshUse::new(mesh, stage, &snapshots));
    }
    for (primitive, uses) in uses {
        let resource = &mut resources.primitives[primitive as usize];
        let factors = (0..32).map(|halvings| MAX_EDGE_RATIO * f64::from(1u32 << halvings));
        let parts = factors.map(|max_edge_ratio| Splitter::run(resource.primitive(), &uses, max_edge_ratio));
        let parts = parts.flatten().next();
        if let Some(parts) = parts.filter(|parts| parts.indices.len() > resource.primitive().indices.len()) {
            *resource = PrimitiveResource::alone(resource.mesh.name.clone(), parts);
        }
    }
}

/// A rigid mesh with large triangles, as an actor uses it.
struct LargeMesh {
    primitive: u32,
    actor: usize,
    model_from_joint: Affine3A,
}

/// Rigid meshes with an edge that may be too long for the smallest object in the scene.
fn large_meshes(resources: &SceneResources, stage: &Stage) -> Vec<LargeMesh> {
    let scale = |index: usize| stage.actors[index].transform.scale.abs().max_element();
    let sizes = (0..stage.actors.len()).map(|i| f64::from(model_diagonal(stage, i)) * scale(i));
    let near = stage.cameras.iter().map(|camera| CAMERA_RADIUS_IN_NEAR_PLANES * f64::from(camera.near()));
    let smallest_size = sizes.chain(near).filter(|size| *size > 0.0).fold(f64::INFINITY, f64::min);
    let mut all = Vec::new();
    for (index, actor) in stage.actors.iter().enumerate().filter(|(_, a)| a.asset.placements.is_empty()) {
        let entry = resources.entry(index);
        let instances = actor.asset.instances.iter().zip(&entry.primitives);
        for (instance, primitives) in instances.filter(|(i, _)| i.copies.is_empty()) {
            let joints = actor.asset.rest_model_from_joint();
            let model_from_joint = joints.get(instance.joint as usize).copied().unwrap_or_default();
            let columns = to_f64(model_from_joint).matrix3.to_cols_array_2d().map(DVec3::from_array);
            let stretch = columns.map(DVec3::length).into_iter().fold(0.0, f64::max) * scale(index);
            let is_large = |primitive: &u32| {
                let resource = &resources.primitives[*primitive as usize];
                let bounds = resource.info.bounds;
                let large = |length: f32| f64::from(length) * stretch > MAX_EDGE_RATIO * smallest_size;
                is_rigid(resource)
                    && large((bounds.max - bounds.min).length())
                    && edge_lengths(resource).any(large)
            };
            let large = primitives.iter().map(|entry| entry.primitive).filter(is_large);
            all.extend(large.map(|primitive| LargeMesh { primitive, actor: index, model_from_joint }));
        }
    }
    all
}

fn is_rigid(resource: &PrimitiveResource) -> bool {
    let shape = resource.primitive();
    let rigid = shape.influences == 0 && shape.morphs.is_empty() && shape.topology == Topology::Triangles;
    rigid && resource.info.valid && shape.positions.iter().all(|p| p.is_finite())
}

fn edge_lengths(resource: &PrimitiveResource) -> impl Iterator<Item = f32> {
    let shape = resource.primitive();
    let at = move |i: u32| shape.positions[i as usize];
    let of = move |t: &[u32]| [(0, 1), (1, 2), (2, 0)].map(|(a, b)| at(t[a]).distance(at(t[b])));
    shape.indices.chunks_exact(3).flat_map(of)
}

/// Diagonal of an actor's model at rest, 0 without a mesh.
fn model_diagonal(stage: &Stage, actor: usize) -> f32 {
    let bounds = stage.actors[actor].asset.rest_bounds();
    if bounds.is_empty() { 0.0 } else { (bounds.max - bounds.min).length() }
}

/// A region in which triangles must be short: a ball that moves straight from one place to another.
#[derive(Clone, Copy, Debug)]
struct FineRegion {
    path: [DVec3; 2],
    radius: f64,
}

/// A use of a mesh by an actor with the balls near it, in world space with the actor at its first placement.
#[derive(Debug)]
struct MeshUse {
    place: DAffine3,
    fine_regions: Vec<FineRegion>,
    smallest_radius: f64,
}

impl MeshUse {
    /// The use of a mesh; `None` if a scale of zero flattens it.
    fn new(mesh: &LargeMesh, stage: &Stage, snapshots: &[Snapshot]) -> Option<MeshUse> {
        let joint = to_f64(mesh.model_from_joint);
        let world_from_mesh = |s: &Snapshot| s.actors[mesh.actor].world_from_model * joint;
        let place = world_from_mesh(snapshots.first()?);
        // The mesh stays at its first placement; everything else moves relative to it.
        let to_first_placement = |s: &Snapshot| place * world_from_mesh(s).inverse();
        let actors: Vec<usize> =
            (0..stage.actors.len()).filter(|i| *i != mesh.actor && model_diagonal(stage, *i) > 0.0).collect();
        let mut known = HashSet::new();
        let mut fine_regions = Vec::new();
        for pair in snapshots.windows(2) {
            let [from, to] = [&pair[0], &pair[1]]
                .map(|s| balls_around_camera_and_actors(stage, s, &actors, &to_first_placement(s)));
            // The camera jumps at a cut, so it does not move in between.
            let cut = pair[0].camera.camera != pair[1].camera.camera;
            for (i, (from, to)) in from.into_iter().zip(to).enumerate() {
                let paths = if i == 0 && cut { vec![[from.0; 2], [to.0; 2]] } else { vec![[from.0, to.0]] };
                let balls = paths.into_iter().map(|path| FineRegion { path, radius: from.1.max(to.1) });
                fine_regions.extend(balls.filter(|ball| ball.is_finite() && known.insert(ball.cell_key())));
            }
        }
        let smallest_radius = fine_regions.iter().map(|ball| ball.radius).fold(f64::INFINITY, f64::min);
        (place.is_finite() && place.matrix3.determinant() != 0.0).then_some(MeshUse {
            place,
            fine_regions,
            smallest_radius,
        })
    }

    fn is_long(&self, [a, b]: [Vec3; 2], max_edge_ratio: f64) -> bool {
        let [a, b] = [a, b].map(|p| self.place.transform_point3(p.as_dvec3()));
        let length = a.distance(b);
        // Splitting gains nothing below the rounding error of the mesh's own positions.
        let least = a.length().max(b.length()) * f64::from(f32::EPSILON);
        let long = |ball: &FineRegion| {
            length > max_edge_ratio * (ball.radius.max(least) + segment_distance([a, b], ball.path))
        };
        length > max_edge_ratio * self.smallest_radius && self.fine_regions.iter().any(long)
    }
}

/// Balls around the camera and the actors: centers and radii.
fn balls_around_camera_and_actors(
    stage: &Stage,
    s: &Snapshot,
    actors: &[usize],
    to_first_placement: &DAffine3,
) -> Vec<(DVec3, f64)> {
    let near = s.camera.camera.and_then(|camera| stage.cameras.get(camera)).map_or(0.0, |c| c.near());
    let camera = (s.camera.world_from_view.translation, CAMERA_RADIUS_IN_NEAR_PLANES * f64::from(near));
    let of_actor = |index: &usize| {
        let world_from_model = s.actors[*index].world_from_model;
        let center = stage.actors[*index].asset.rest_bounds().center().as_dvec3();
        let scale = libm::cbrt(world_from_model.matrix3.determinant().abs());
        (world_from_model.transform_point3(center), scale * f64::from(model_diagonal(stage, *index)))
    };
    let balls = std::iter::once(camera).chain(actors.iter().map(of_actor));
    balls.map(|(center, radius)| (to_first_placement.transform_point3(center), radius)).collect()
}

impl FineRegion {
    fn is_finite(&self) -> bool {
        self.path.iter().all(|p| p.is_finite()) && self.radius.is_finite()
    }

    /// Key of nearly equal balls, of which only one is kept.
    fn cell_key(&self) -> [i64; 7] {
        let exponent = if self.radius > 0.0 { libm::ilogb(self.radius) } else { -20 };
        let side = libm::ldexp(1.0, exponent);
        let cell = |i: usize| (self.path[i / 3][i % 3] / side).floor() as i64;
        std::array::from_fn(|i| if i < 6 { cell(i) } else { exponent.into() })
    }
}

/// Distance between two segments (Ericson, "Real-Time Collision Detection", 2005, §5.1.9).
fn segment_distance([p1, q1]: [DVec3; 2], [p2, q2]: [DVec3; 2]) -> f64 {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, b) = (d1.dot(d1), d2.dot(d2), d1.dot(d2));
    let (c, f) = (d1.dot(r), d2.dot(r));
    let share = |over: f64, under: f64| if under > 0.0 { (over / under).clamp(0.0, 1.0) } else { 0.0 };
    let mut s = share(b * f - c * e, a * e - b * b);
    let t = share(b * s + f, e);
    // Nearest point of the first segment to the clamped point of the second.
    s = share(b * t - c, a);
    (p1 + d1 * s).distance(p2 + d2 * t)
}

/// Splits the triangles of a mesh, and their parts, at the middles of their long edges.
struct Splitter<'a> {
    shape: Primitive,
    uses: &'a [MeshUse],
    max_edge_ratio: f64,
    /// The vertex in the middle of each visited edge; `None` if the edge is short enough.
    middles: HashMap<[u32; 2], Option<u32>>,
}

impl Splitter<'_> {
    /// The split mesh; `None` if it would need too many triangles.
    fn run(shape: &Primitive, uses: &[MeshUse], max_edge_ratio: f64) -> Option<Primitive> {
        let mut splitter = Splitter {
            shape: Primitive { indices: Vec::new(), ..shape.clone() },
            uses,
            max_edge_ratio,
            middles: HashMap::new(),
        };
        let most = shape.indices.len() + 3 * MAX_TRIANGLES;
        for triangle in shape.indices.chunks_exact(3) {
            let mut waiting = vec![[triangle[0], triangle[1], triangle[2]]];
            while let Some(triangle) = waiting.pop() {
                splitter.split(triangle, &mut waiting);
                if splitter.shape.indices.len() + 3 * waiting.len() > most {
                    return None;
                }
            }
        }
        Some(splitter.shape)
    }

    /// Keeps a triangle whose edges are short, or pushes its parts.
    fn split(&mut self, [a, b, c]: [u32; 3], parts: &mut Vec<[u32; 3]>) {
        let middles = [[a, b], [b, c], [c, a]].map(|edge| self.split_point(edge));
        match middles {
            [None, None, None] => self.shape.indices.extend([a, b, c]),
            [Some(ab), None, None] => parts.extend([[a, ab, c], [ab, b, c]]),
            [None, Some(bc), None] => parts.extend([[b, bc, a], [bc, c, a]]),
            [None, None, Some(ca)] => parts.extend([[c, ca, b], [ca, a, b]]),
            [Some(ab), Some(bc), None] => parts.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
            [None, Some(bc), Some(ca)] => parts.extend([[bc, c, ca], [b, bc, ca], [b, ca, a]]),
            [Some(ab), None, Some(ca)] => parts.extend([[ca, a, ab], [c, ca, ab], [c, ab, b]]),
            [Some(ab), Some(bc), Some(ca)] => {
                parts.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
        }
    }

    fn split_point(&mut self, [a, b]: [u32; 2]) -> Option<u32> {
        let key = [a.min(b), a.max(b)];
        if let Some(known) = self.middles.get(&key) {
            return *known;
        }
        let mut ends = [a, b].map(|i| self.shape.positions[i as usize]);
        // The order of the ends is canonical, so that two meshes decide alike about a shared edge.
        ends.sort_by(|a, b| a.to_array().map(f32::to_bits).cmp(&b.to_array().map(f32::to_bits)));
        let long = self.uses.iter().any(|of| of.is_long(ends, self.max_edge_ratio));
        let middle = long.then(|| self.add_middle(a as usize, b as usize));
        self.middles.insert(key, middle);
        middle
    }

    fn add_middle(&mut self, a: usize, b: usize) -> u32 {
        let shape = &mut self.shape;
        shape.positions.push(shape.positions[a].midpoint(shape.positions[b]));
        // Normals are not normalized, so that interpolation gives the same values as before.
        if !shape.normals.is_empty() {
            shape.normals.push(shape.normals[a].midpoint(shape.normals[b]));
        }
        if !shape.tangents.is_empty() {
            let (ta, tb): (Vec4, Vec4) = (shape.tangents[a], shape.tangents[b]);
            shape.tangents.push(((ta + tb) * 0.5).truncate().extend(ta.w));
        }
        for uvs in shape.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
            uvs.push((uvs[a] + uvs[b]) * 0.5);
        }
        if !shape.colors.is_empty() {
            shape.colors.push((shape.colors[a] + shape.colors[b]) * 0.5);
        }
        shape.positions.len() as u32 - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    /// A level square, sides and texture coordinates in metres.
    fn square_ground(side: f32) -> Primitive {
        let corners = [Vec2::new(-1.0, 1.0), Vec2::ONE, Vec2::new(1.0, -1.0), Vec2::splat(-1.0)];
        let at = corners.map(|c| c * 0.5 * side);
        Primitive {
            indices: vec![0, 1, 2, 0, 2, 3],
            positions: at.iter().map(|p| Vec3::new(p.x, 0.0, p.y)).collect(),
            normals: vec![Vec3::Y; 4],
            uvs: [at.to_vec(), Vec::new()],
            ..Primitive::default()
        }
    }

    /// A character of two metres that walks from one place to another.
    fn use_with_walking_character(path: [DVec3; 2]) -> MeshUse {
        MeshUse {
            place: DAffine3::IDENTITY,
            fine_regions: vec![FineRegion { path, radius: 2.0 }],
            smallest_radius: 2.0,
        }
    }

    #[test]
    fn split_edges_are_short_near_actors_without_gaps() {
        let paths = [[DVec3::ZERO; 2], [DVec3::new(-3e4, 0.0, 11.0), DVec3::new(2e4, 0.0, 700.0)]];
        for (path, most) in paths.into_iter().zip([400, 4000]) {
            let parts =
                Splitter::run(&square_ground(1e5), &[use_with_walking_character(path)], MAX_EDGE_RATIO)
                    .unwrap();
            let triangles: Vec<[usize; 3]> =
                parts.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| t[i] as usize)).collect();
            println!("{} triangles", triangles.len());
            assert!(triangles.len() < most, "{}", triangles.len());
            let at = |i: usize| parts.positions[i].as_dvec3();
            let (mut area, mut sides) = (0.0, HashMap::new());
            for t in &triangles {
                let normal = (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
                assert!(normal.y > 0.0, "turned over: {t:?}");
                area += 0.5 * normal.length();
                for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                    *sides.entry((a.min(b), a.max(b))).or_insert(0) += 1;
                    let (length, away) = (at(a).distance(at(b)), segment_distance([at(a), at(b)], path));
                    assert!(length <= MAX_EDGE_RATIO * (2.0 + away), "{length} m at {away} m");
                }
            }
            assert!((area / 1e10 - 1.0).abs() < 1e-9, "{area}");
            // An edge that only one triangle uses must lie on the border; elsewhere a gap could open.
            let on_border = |i: usize| at(i).x.abs() == 5e4 || at(i).z.abs() == 5e4;
            assert!(sides.iter().all(|((a, b), n)| *n == 2 || *n == 1 && on_border(*a) && on_border(*b)));
            for (p, uv) in parts.positions.iter().zip(&parts.uvs[0]) {
                assert_eq!(Vec2::new(p.x, p.z), *uv, "interpolated like the place");
            }
        }
    }

    #[test]
    fn ordinary_grounds_are_not_split() {
        for side in [10.0, 360.0] {
            let parts = Splitter::run(
                &square_ground(side),
                &[use_with_walking_character([DVec3::ZERO; 2])],
                MAX_EDGE_RATIO,
            )
            .unwrap();
            assert_eq!(parts, square_ground(side));
        }
    }

    #[test]
    fn segment_distance_is_that_of_the_nearest_points() {
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let x = [at(-1.0, 0.0, 0.0), at(1.0, 0.0, 0.0)];
        for (other, expected) in [
            ([at(0.0, 2.0, -5.0), at(0.0, 2.0, 5.0)], 2.0),
            ([at(3.0, 0.0, 1.0), at(9.0, 0.0, 4.0)], 5f64.sqrt()),
            ([at(-0.5, 3.0, 0.0), at(0.5, 3.0, 0.0)], 3.0),
            ([at(4.0, 4.0, 0.0); 2], 5.0),
            ([at(0.0, -1.0, 0.0), at(0.0, 1.0, 0.0)], 0.0),
        ] {
            assert!((segment_distance(x, other) - expected).abs() < 1e-12, "{other:?}");
            assert!((segment_distance(other, x) - expected).abs() < 1e-12, "{other:?}");
        }
        assert_eq!(segment_distance([DVec3::ONE; 2], [DVec3::ZERO; 2]), 3f64.sqrt());
    }
}
