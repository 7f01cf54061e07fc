//! Closed surfaces: of a body that is seen from outside, its back faces never are, though its material has two sides.
//!
//! Exporters mark most materials as two-sided. Along a ray from outside, a surface without border is entered before it is left
//! (each edge has as many triangles on one side as on the other, so the surface is a boundary, and the number of times that it
//! winds around a point is 0 outside), so that its back faces need neither be drawn nor shaded, in pictures and in shadow maps.
//! Skins and morph targets leave the surface without border, so that a ray that meets a body meets a front face of it: however it is bent,
//! no hole opens and its outline stays. Where a part of it is turned inside out, the face behind that part is seen in its place: at most
//! 0.05 % of a sample's pixels in its clips and with a joint turned by 2.5 radians (`cargo test -p choreo --test closed_bodies -- --nocapture`).

use crate::plan::build::Planner;
use crate::plan::{Features, PipelineKey, TopologyKey};
use crate::scene_resources::CatalogPrimitive;
use crate::scene_resources::bounds::Aabb;
use choreo_asset::{Primitive, Topology};
use glam::{Mat4, Vec3};

/// A primitive's triangles, those of closed surfaces first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Closed {
    /// Empty where none is closed.
    pub indices: Vec<u32>,
    /// So many of them, from the first.
    pub count: u32,
}

/// A body is at least so thick: 36π volume² over area³, which is 1 of a ball. Two sheets back to back hide nothing of each other.
const LEAST_ROUNDNESS: f64 = 1e-6;

impl Closed {
    /// Indices must be in range.
    pub fn of(p: &Primitive) -> Closed {
        if p.topology != Topology::Triangles || !p.indices.len().is_multiple_of(3) {
            return Closed::default();
        }
        let (place, torn) = places(p);
        let triangles: Vec<[u32; 3]> =
            p.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| place[i as usize])).collect();
        let mut edges: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(p.indices.len());
        for (at, &[a, b, c]) in (0u32..).zip(&triangles) {
            // Of a triangle without area, what goes one way comes back.
            for (a, b) in [(a, b), (b, c), (c, a)] {
                edges.push((a.min(b), a.max(b), a < b, at));
            }
        }
        edges.sort_unstable();
        let mut bodies = Bodies((0..triangles.len() as u32).collect());
        let mut open: Vec<bool> =
            triangles.iter().map(|t| t.iter().any(|place| torn[*place as usize])).collect();
        for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let one_way = edge.iter().filter(|e| e.2).count();
            let balanced = edge[0].0 == edge[0].1 || 2 * one_way == edge.len();
            for e in edge {
                bodies.join(edge[0].3, e.3);
                open[e.3 as usize] |= !balanced;
            }
        }
        // Six times the volume and twice the area of each body.
        let mut sums = vec![(0.0, 0.0, true); triangles.len()];
        for (at, corners) in p.indices.chunks_exact(3).enumerate() {
            let body = bodies.of(at as u32) as usize;
            let from = p.positions[p.indices[3 * body] as usize].as_dvec3();
            let [a, b, c] =
                [corners[0], corners[1], corners[2]].map(|i| p.positions[i as usize].as_dvec3() - from);
            let sum = &mut sums[body];
            sum.0 += a.dot(b.cross(c));
            sum.1 += (b - a).cross(c - a).length();
            sum.2 &= !open[at];
        }
        let is_closed = |at: u32| {
            let (volume, area, whole) = sums[bodies.of(at) as usize];
            let (volume, area) = (volume / 6.0, area / 2.0);
            let round = 36.0 * std::f64::consts::PI * volume * volume > LEAST_ROUNDNESS * area * area * area;
            // Turned inside out, or a cavity: what is seen are its back faces.
            whole && volume > 0.0 && round
        };
        let (closed, rest): (Vec<u32>, Vec<u32>) =
            (0..triangles.len() as u32).partition(|triangle| is_closed(*triangle));
        if closed.is_empty() {
            return Closed::default();
        }
        let corners = |t: &u32| p.indices[3 * *t as usize..][..3].iter().copied();
        Closed {
            indices: closed.iter().chain(&rest).flat_map(corners).collect(),
            count: 3 * closed.len() as u32,
        }
    }
}

/// Of each vertex a number for its place, the same for all vertices there; of each place whether its vertices may part, since
/// other joints or morph targets move them.
fn places(p: &Primitive) -> (Vec<u32>, Vec<bool>) {
    // -0 and 0 are one place.
    let key = |v: &u32| (p.positions[*v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..p.positions.len() as u32).collect();
    order.sort_unstable_by_key(|v| (key(v), *v));
    let (mut place, mut torn) = (vec![0; order.len()], Vec::new());
    let together = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        let influences = |v: usize| v * p.influences..(v + 1) * p.influences;
        p.joint_indices[influences(a)] == p.joint_indices[influences(b)]
            && p.joint_weights[influences(a)] == p.joint_weights[influences(b)]
            && p.morphs.iter().all(|m| m.positions.get(a) == m.positions.get(b))
    };
    for here in order.chunk_by(|a, b| key(a) == key(b)) {
        here.iter().for_each(|v| place[*v as usize] = torn.len() as u32);
        torn.push(!here.iter().all(|v| together(here[0], *v)) || !p.positions[here[0] as usize].is_finite());
    }
    (place, torn)
}

/// Which triangles hang together: of each another one, towards the first.
struct Bodies(Vec<u32>);

impl Bodies {
    fn root(&mut self, mut at: u32) -> u32 {
        while self.0[at as usize] != at {
            let above = self.0[at as usize];
            self.0[at as usize] = self.0[above as usize];
            at = above;
        }
        at
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn of(&self, mut at: u32) -> u32 {
        while self.0[at as usize] != at {
            at = self.0[at as usize];
        }
        at
    }
}

/// Whether a box lies before the near plane of a view, which therefore stands outside it.
pub fn is_before(b: Aabb, clip_from_relative: &Mat4) -> bool {
    let corners = b.corners().map(|c| *clip_from_relative * c.extend(1.0));
    // Not so of what is not a number; rounding counts against it.
    corners.iter().all(|c| c.w > 0.0 && c.z < c.w * (1.0 - 1e-4))
}

impl Planner<'_> {
    /// How many indices of a copy ([`Closed::indices`]) belong to bodies of which no back face is seen from outside.
    /// `one_handed`: no joint mirrors or flattens what others do not.
    pub fn closed(&self, primitive: &CatalogPrimitive, key: &PipelineKey, one_handed: bool) -> u32 {
        let solid = key.topology == TopologyKey::Triangles
            && key.double_sided
            && !key.is_see_through()
            && !key.features.has(Features::ALPHA_MASK)
            && key.displaced == 0;
        match solid && one_handed && !self.options.force_all {
            true => primitive.closed().count,
            false => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube, its faces counter-clockwise from outside, each with corners of its own; `turned`: inside out.
    fn cube(at: f32, turned: bool) -> Primitive {
        let mut p = Primitive::default();
        for axis in 0..3 {
            for side in [-1.0f32, 1.0] {
                let first = p.positions.len() as u32;
                for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let mut corner = [0.0; 3];
                    corner[axis] = side;
                    corner[(axis + 1) % 3] = u;
                    corner[(axis + 2) % 3] = v;
                    p.positions.push(Vec3::from(corner) + at);
                }
                let flip = (side < 0.0) != turned;
                let faces: [u32; 6] = if flip { [0, 2, 1, 0, 3, 2] } else { [0, 1, 2, 0, 2, 3] };
                p.indices.extend(faces.map(|i| first + i));
            }
        }
        p
    }

    fn both(mut a: Primitive, b: Primitive) -> Primitive {
        let first = a.positions.len() as u32;
        a.indices.extend(b.indices.iter().map(|i| i + first));
        a.positions.extend(b.positions);
        a
    }

    #[test]
    fn a_body_is_closed_and_what_lacks_a_triangle_is_not() {
        let whole = cube(0.0, false);
        assert_eq!(Closed::of(&whole), Closed { indices: whole.indices.clone(), count: 36 });
        let mut hole = whole.clone();
        hole.indices.truncate(33);
        assert_eq!(Closed::of(&hole), Closed::default());
        // Its triangles do not all face outwards.
        let mut turned = whole.clone();
        turned.indices.swap(0, 1);
        assert_eq!(Closed::of(&turned).count, 0);
        assert_eq!(Closed::of(&cube(0.0, true)).count, 0, "a room is seen from inside");
        // The closed one first, the rest as it was.
        let pair = both(hole.clone(), cube(9.0, false));
        let closed = Closed::of(&pair);
        assert_eq!(closed.count, 36);
        assert_eq!([&closed.indices[36..], &closed.indices[..36]].concat(), pair.indices);
    }

    #[test]
    fn what_may_part_is_not_closed() {
        let mut p = cube(0.0, false);
        p.influences = 4;
        p.joint_indices = vec![0; 4 * 24];
        p.joint_weights = [1.0, 0.0, 0.0, 0.0].repeat(24);
        assert_eq!(Closed::of(&p).count, 36);
        let mut skinned = p.clone();
        // One of the three vertices at a corner hangs on another joint.
        skinned.joint_indices[4 * 7] = 1;
        assert_eq!(Closed::of(&skinned).count, 0);
        let mut target = choreo_asset::MorphTarget { positions: vec![Vec3::ZERO; 24], ..Default::default() };
        target.positions[3] = Vec3::Y;
        p.morphs.push(target);
        assert_eq!(Closed::of(&p).count, 0);
        let mut broken = cube(0.0, false);
        broken.positions[5].x = f32::NAN;
        assert_eq!(Closed::of(&broken).count, 0);
    }

    #[test]
    fn sheets_and_lines_close_nothing() {
        let mut sheet = cube(0.0, false);
        sheet.positions.iter_mut().for_each(|p| p.y *= 1e-7);
        assert_eq!(Closed::of(&sheet).count, 0);
        let lines = Primitive { topology: Topology::Lines, ..cube(0.0, false) };
        assert_eq!(Closed::of(&lines), Closed::default());
        assert_eq!(Closed::of(&Primitive::default()), Closed::default());
    }

    #[test]
    fn a_view_in_a_box_or_near_it_is_not_outside() {
        use choreo_asset::Projection;
        use choreo_stage::CameraState;
        let projection = Projection::Perspective { yfov: 1.0, near: 0.5, far: None };
        let world_from_view = glam::DAffine3::IDENTITY;
        let view = crate::plan::View::new(&CameraState { camera: None, world_from_view, projection }, [9, 9]);
        let at = |z: f32| {
            is_before(
                Aabb { min: Vec3::new(-1.0, -1.0, z - 1.0), max: Vec3::new(1.0, 1.0, z) },
                &view.clip_from_relative,
            )
        };
        assert!(at(-0.6) && at(-90.0));
        assert!(!at(-0.4) && !at(0.5) && !at(3.0) && !at(f32::NAN));
    }
}
