//! Watertight surfaces of a primitive. While the viewer is outside, their back faces need neither be drawn nor shaded, in frames
//! and in shadow maps, even with a double-sided material (which exporters set on most materials).
//!
//! Along a ray from outside, a surface without a border is entered before it is left. Each edge has as many triangles in one
//! direction as in the other, so the surface is a boundary, whose winding number is 0 outside. Skins and morph targets add no
//! border, so however a mesh is bent no hole opens and its silhouette stays. Where a part is turned inside out, the face behind
//! it is drawn in its place: at most 0.05 % of the pixels of a sample model in its clips and with a joint turned by 2.5 radians
//! (`cargo test -p choreo --test watertight -- --nocapture`).

use choreo_asset::{Primitive, Topology};
use glam::Vec3;

/// A primitive's triangles, those of watertight surfaces first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WatertightOrder {
    /// Empty if no surface is watertight.
    pub indices: Vec<u32>,
    /// Number of indices of watertight surfaces.
    pub count: u32,
}

/// Least sphericity of a watertight surface: 36π volume² over area³, which is 1 for a sphere. Two sheets back to back have nearly
/// none and do not hide each other's back faces.
const LEAST_SPHERICITY: f64 = 1e-6;

impl WatertightOrder {
    /// Sorts the triangles of a primitive. Indices must be in range.
    pub fn of(p: &Primitive) -> WatertightOrder {
        if p.topology != Topology::Triangles || !p.indices.len().is_multiple_of(3) {
            return WatertightOrder::default();
        }
        let (mut components, open) = connect_triangles(p);
        components.measure(p, &open);
        let (watertight, rest): (Vec<u32>, Vec<u32>) =
            (0..open.len() as u32).partition(|triangle| components.is_watertight(*triangle));
        if watertight.is_empty() {
            return WatertightOrder::default();
        }
        let vertices = |t: &u32| p.indices[3 * *t as usize..][..3].iter().copied();
        WatertightOrder {
            indices: watertight.iter().chain(&rest).flat_map(vertices).collect(),
            count: 3 * watertight.len() as u32,
        }
    }
}

/// Joins triangles that share an edge into components, and marks triangles at a border.
fn connect_triangles(p: &Primitive) -> (Components, Vec<bool>) {
    let (point, torn) = weld(p);
    let triangles: Vec<[u32; 3]> =
        p.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| point[i as usize])).collect();
    let mut edges: Vec<(u32, u32, bool, u32)> = Vec::with_capacity(p.indices.len());
    for (at, &[a, b, c]) in (0u32..).zip(&triangles) {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            edges.push((a.min(b), a.max(b), a < b, at));
        }
    }
    edges.sort_unstable();
    let mut components = Components::new(triangles.len());
    let mut open: Vec<bool> = triangles.iter().map(|t| t.iter().any(|point| torn[*point as usize])).collect();
    for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let one_way = edge.iter().filter(|e| e.2).count();
        // The edges of a triangle without area cancel out.
        let balanced = edge[0].0 == edge[0].1 || 2 * one_way == edge.len();
        for e in edge {
            components.merge(edge[0].3, e.3);
            open[e.3 as usize] |= !balanced;
        }
    }
    (components, open)
}

/// Welds vertices at the same position into points. Returns the point of each vertex, and for each point whether its vertices may
/// separate because different joints or morph targets move them.
fn weld(p: &Primitive) -> (Vec<u32>, Vec<bool>) {
    // -0 and 0 are the same position.
    let key = |v: &u32| (p.positions[*v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..p.positions.len() as u32).collect();
    order.sort_unstable_by_key(|v| (key(v), *v));
    let (mut point, mut torn) = (vec![0; order.len()], Vec::new());
    let move_alike = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        let influences = |v: usize| v * p.influences..(v + 1) * p.influences;
        p.joint_indices[influences(a)] == p.joint_indices[influences(b)]
            && p.joint_weights[influences(a)] == p.joint_weights[influences(b)]
            && p.morphs.iter().all(|m| m.positions.get(a) == m.positions.get(b))
    };
    for here in order.chunk_by(|a, b| key(a) == key(b)) {
        here.iter().for_each(|v| point[*v as usize] = torn.len() as u32);
        let finite = p.positions[here[0] as usize].is_finite();
        torn.push(!finite || !here.iter().all(|v| move_alike(here[0], *v)));
    }
    (point, torn)
}

/// Connected components of triangles (union-find), named by their first triangle.
struct Components {
    /// Another triangle of the same component for each triangle, one step towards the root.
    parent: Vec<u32>,
    /// Measures of each component, at its first triangle: six times its volume, twice its area, whether it has no border.
    measures: Vec<(f64, f64, bool)>,
}

impl Components {
    fn new(triangles: usize) -> Components {
        Components { parent: (0..triangles as u32).collect(), measures: vec![(0.0, 0.0, true); triangles] }
    }

    /// The first triangle of a component. Shortens the path to it.
    fn root(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            let above = self.parent[at as usize];
            self.parent[at as usize] = self.parent[above as usize];
            at = above;
        }
        at
    }

    fn merge(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    fn measure(&mut self, p: &Primitive, open: &[bool]) {
        for (at, triangle) in p.indices.chunks_exact(3).enumerate() {
            let root = self.root(at as u32) as usize;
            let from = p.positions[p.indices[3 * root] as usize].as_dvec3();
            let [a, b, c] =
                [triangle[0], triangle[1], triangle[2]].map(|i| p.positions[i as usize].as_dvec3() - from);
            let (volume, area, whole) = &mut self.measures[root];
            *volume += a.dot(b.cross(c));
            *area += (b - a).cross(c - a).length();
            *whole &= !open[at];
        }
    }

    fn is_watertight(&self, triangle: u32) -> bool {
        let mut root = triangle;
        while self.parent[root as usize] != root {
            root = self.parent[root as usize];
        }
        let (volume, area, whole) = self.measures[root as usize];
        let (volume, area) = (volume / 6.0, area / 2.0);
        let thick = 36.0 * std::f64::consts::PI * volume * volume > LEAST_SPHERICITY * area * area * area;
        // A negative volume is a surface turned inside out, or a cavity: its back faces are visible.
        whole && volume > 0.0 && thick
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube, its faces counter-clockwise from outside, each with vertices of its own; `turned`: inside out.
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

    fn combined(mut a: Primitive, b: Primitive) -> Primitive {
        let first = a.positions.len() as u32;
        a.indices.extend(b.indices.iter().map(|i| i + first));
        a.positions.extend(b.positions);
        a
    }

    #[test]
    fn a_cube_is_watertight_and_with_a_missing_triangle_is_not() {
        let whole = cube(0.0, false);
        assert_eq!(
            WatertightOrder::of(&whole),
            WatertightOrder { indices: whole.indices.clone(), count: 36 }
        );
        let mut hole = whole.clone();
        hole.indices.truncate(33);
        assert_eq!(WatertightOrder::of(&hole), WatertightOrder::default());
        // A mesh whose triangles do not all face outwards.
        let mut turned = whole.clone();
        turned.indices.swap(0, 1);
        assert_eq!(WatertightOrder::of(&turned).count, 0);
        assert_eq!(WatertightOrder::of(&cube(0.0, true)).count, 0, "a room is viewed from inside");
        // The watertight one comes first, the rest stays in order.
        let pair = combined(hole.clone(), cube(9.0, false));
        let order = WatertightOrder::of(&pair);
        assert_eq!(order.count, 36);
        assert_eq!([&order.indices[36..], &order.indices[..36]].concat(), pair.indices);
    }

    #[test]
    fn vertices_that_may_separate_are_a_border() {
        let mut p = cube(0.0, false);
        p.influences = 4;
        p.joint_indices = vec![0; 4 * 24];
        p.joint_weights = [1.0, 0.0, 0.0, 0.0].repeat(24);
        assert_eq!(WatertightOrder::of(&p).count, 36);
        let mut skinned = p.clone();
        // One of the three vertices at a position is bound to another joint.
        skinned.joint_indices[4 * 7] = 1;
        assert_eq!(WatertightOrder::of(&skinned).count, 0);
        let mut target = choreo_asset::MorphTarget { positions: vec![Vec3::ZERO; 24], ..Default::default() };
        target.positions[3] = Vec3::Y;
        p.morphs.push(target);
        assert_eq!(WatertightOrder::of(&p).count, 0);
        let mut broken = cube(0.0, false);
        broken.positions[5].x = f32::NAN;
        assert_eq!(WatertightOrder::of(&broken).count, 0);
    }

    #[test]
    fn sheets_and_lines_are_not_watertight() {
        let mut sheet = cube(0.0, false);
        sheet.positions.iter_mut().for_each(|p| p.y *= 1e-7);
        assert_eq!(WatertightOrder::of(&sheet).count, 0);
        let lines = Primitive { topology: Topology::Lines, ..cube(0.0, false) };
        assert_eq!(WatertightOrder::of(&lines), WatertightOrder::default());
        assert_eq!(WatertightOrder::of(&Primitive::default()), WatertightOrder::default());
    }
}
