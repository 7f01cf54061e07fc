//! Hausdorff distance between a triangle mesh and a simplified version of it, by sampling.
//!
//! Distances are measured from each vertex of the fine mesh, because simplification drops vertices, and from a grid of points on
//! each triangle of the simplified mesh, because its interior leaves the fine surface. After P. Cignoni, C. Rocchini, R.
//! Scopigno, "Metro: Measuring Error on Simplified Surfaces", Computer Graphics Forum 1998.

use choreo_asset::Aabb;
use glam::Vec3;
use rayon::prelude::{ParallelIterator, ParallelSlice};

/// Steps of the grid along a triangle's edge. The 28 points include its vertices, centroid and edge midpoints.
const GRID_STEPS: u32 = 6;
/// Number of vertices or triangles in one parallel task.
const TASK_SIZE: usize = 256;
/// Largest number of triangles in a leaf.
const LEAF_SIZE: usize = 4;

/// A triangle mesh. Indices must be in range.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    pub positions: &'a [Vec3],
    pub indices: &'a [u32],
}

impl<'a> Surface<'a> {
    fn triangles(self) -> impl Iterator<Item = [Vec3; 3]> + 'a {
        self.indices.chunks_exact(3).map(move |t| [t[0], t[1], t[2]].map(|i| self.positions[i as usize]))
    }
}

/// Hausdorff distance in metres between a surface and a simplified version that uses a subset of its vertices; 0 if either has no
/// triangles.
pub(crate) fn hausdorff_distance(fine: Surface, coarse: Surface) -> f32 {
    let (of_fine, of_coarse) = (Tree::new(fine), Tree::new(coarse));
    let mut used = fine.indices.to_vec();
    used.sort_unstable();
    used.dedup();
    let of_vertex =
        |worst: f32, vertex: &u32| of_coarse.farthest_squared(fine.positions[*vertex as usize], worst);
    let of_triangle = |worst: f32, triangle: &[u32]| {
        let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|i| coarse.positions[i as usize]);
        let steps = (0..=GRID_STEPS).flat_map(|i| (0..=GRID_STEPS - i).map(move |j| [i, j]));
        steps.fold(worst, |worst, step| {
            let [u, v] = step.map(|n| n as f32 / GRID_STEPS as f32);
            of_fine.farthest_squared(a + (b - a) * u + (c - a) * v, worst)
        })
    };
    // A coarse sample first gives a lower bound: points within it need no exact distance.
    let few = used.iter().step_by(TASK_SIZE / 8).fold(0.0, of_vertex);
    let few = coarse.indices.chunks_exact(3).step_by(TASK_SIZE / 8).fold(few, of_triangle);
    let vertices = used.par_chunks(TASK_SIZE).map(|vertices| vertices.iter().fold(few, of_vertex));
    let triangles = coarse.indices.par_chunks(3 * TASK_SIZE);
    let triangles = triangles.map(|vertices| vertices.chunks_exact(3).fold(few, of_triangle));
    vertices.chain(triangles).reduce(|| 0.0, f32::max).sqrt()
}

/// Bounding volume hierarchy. A node's first child is the next node.
struct Tree {
    triangles: Vec<[Vec3; 3]>,
    nodes: Vec<Node>,
}

struct Node {
    bounds: Aabb,
    first_triangle: u32,
    count: u32,
    /// The second child; 0 for a leaf.
    second_child: u32,
}

impl Tree {
    fn new(surface: Surface) -> Tree {
        let mut tree = Tree { triangles: surface.triangles().collect(), nodes: Vec::new() };
        let count = tree.triangles.len();
        if count > 0 {
            tree.split(0, count);
        }
        tree
    }

    fn split(&mut self, first: usize, count: usize) -> u32 {
        let all = &mut self.triangles[first..first + count];
        let middle = |t: &[Vec3; 3]| t[0] + t[1] + t[2];
        let bounds = Aabb::of(all.iter().flatten().copied());
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { bounds, first_triangle: first as u32, count: count as u32, second_child: 0 });
        if count > LEAF_SIZE {
            let spread = Aabb::of(all.iter().map(middle));
            let size = spread.max - spread.min;
            let axis = size.max_position();
            let half = count / 2;
            all.select_nth_unstable_by(half, |a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
            self.split(first, half);
            let second = self.split(first + half, count - half);
            self.nodes[node as usize].second_child = second;
        }
        node
    }

    /// The larger of `minimum` and the squared distance from a point to the nearest triangle.
    fn farthest_squared(&self, from: Vec3, minimum: f32) -> f32 {
        let outside = |b: &Aabb| from.distance_squared(from.clamp(b.min, b.max));
        let mut nearest = f32::INFINITY;
        let mut open: Vec<u32> = Vec::with_capacity(32);
        open.extend((!self.nodes.is_empty()).then_some(0));
        while let Some(at) = open.pop() {
            let node = &self.nodes[at as usize];
            if outside(&node.bounds) >= nearest {
                continue;
            }
            if node.second_child == 0 {
                let all = &self.triangles
                    [node.first_triangle as usize..(node.first_triangle + node.count) as usize];
                nearest = all.iter().fold(nearest, |least, t| least.min(squared_distance(from, *t)));
                // The point is too near to increase the maximum.
                if nearest <= minimum {
                    return minimum;
                }
                continue;
            }
            // The nearer child is visited first.
            let halves = [at + 1, node.second_child];
            let [a, b] = halves.map(|half| outside(&self.nodes[half as usize].bounds));
            open.extend(if a < b { [halves[1], halves[0]] } else { halves });
        }
        if nearest.is_finite() { nearest.max(minimum) } else { minimum }
    }
}

/// Squared distance to the nearest point of a triangle (C. Ericson, "Real-Time Collision Detection", 5.1.5).
fn squared_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let (ab, ac) = (b - a, c - a);
    let to = |from: Vec3, edge: Vec3, length: f32, along: f32| {
        let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
        p.distance_squared(from + edge * share)
    };
    let edge = |from: Vec3, edge: Vec3| to(from, edge, edge.length_squared(), edge.dot(p - from));
    let n = ab.cross(ac);
    let square = n.length_squared();
    let inside = square > 0.0 && {
        let w = p - a;
        let (u, v) = (w.cross(ac).dot(n), ab.cross(w).dot(n));
        u >= 0.0 && v >= 0.0 && u + v <= square
    };
    if inside {
        let along = (p - a).dot(n);
        return along * along / square;
    }
    edge(a, ab).min(edge(a, ac)).min(edge(b, c - b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of squares with a height at each vertex.
    fn height_field(squares: u32, height: impl Fn(f32, f32) -> f32) -> (Vec<Vec3>, Vec<u32>) {
        let n = squares + 1;
        let at = |i: u32| i as f32 / squares as f32;
        let positions = (0..n * n).map(|i| {
            let (x, y) = (at(i % n), at(i / n));
            Vec3::new(x, y, height(x, y))
        });
        let squares = (0..squares * squares).map(|i| i / squares * n + i % squares);
        let indices = squares.flat_map(|i| [i, i + 1, i + n + 1, i, i + n + 1, i + n]);
        (positions.collect(), indices.collect())
    }

    fn between(a: &(Vec<Vec3>, Vec<u32>), b: &(Vec<Vec3>, Vec<u32>)) -> f32 {
        let of = |s: &'_ (Vec<Vec3>, Vec<u32>)| (s.0.clone(), s.1.clone());
        let ((ap, ai), (bp, bi)) = (of(a), of(b));
        hausdorff_distance(Surface { positions: &ap, indices: &ai }, Surface { positions: &bp, indices: &bi })
    }

    #[test]
    fn distance_is_the_height_of_the_removed_detail() {
        let flat = height_field(1, |_, _| 0.0);
        assert!(between(&height_field(16, |_, _| 0.0), &flat) < 1e-6);
        // One bump on a plane, off its diagonal.
        let bump = height_field(16, |x, y| if (x, y) == (0.75, 0.25) { 0.03 } else { 0.0 });
        assert!((between(&bump, &flat) - 0.03).abs() < 1e-6);
        assert!((between(&flat, &bump) - 0.03).abs() < 1e-3, "either way");
        // A sphere's cap of radius 2 under a square: its sagitta is where both diagonals meet.
        let cap = |x: f32, y: f32| (4.0 - (x - 0.5) * (x - 0.5) - (y - 0.5) * (y - 0.5)).sqrt();
        let sagitta = cap(0.5, 0.5) - cap(0.0, 0.0);
        let found = between(&height_field(32, cap), &height_field(1, cap));
        assert!((found - sagitta).abs() < 0.01 * sagitta, "{found} for {sagitta}");
    }

    #[test]
    fn the_tree_finds_the_nearest_triangle() {
        let wavy = height_field(9, |x, y| 0.1 * libm::sinf(9.0 * x) * libm::cosf(7.0 * y));
        let surface = Surface { positions: &wavy.0, indices: &wavy.1 };
        let tree = Tree::new(surface);
        for i in 0..200 {
            let f = |k: u32| (i * k % 97) as f32 / 60.0 - 0.3;
            let p = Vec3::new(f(31), f(57), f(11) * 0.5);
            let least = surface.triangles().map(|t| squared_distance(p, t)).fold(f32::INFINITY, f32::min);
            assert_eq!(tree.farthest_squared(p, 0.0), least);
            assert_eq!(tree.farthest_squared(p, 2.0 * least + 1e-9), 2.0 * least + 1e-9);
        }
    }

    #[test]
    fn squared_distances_to_vertices_edges_and_the_face() {
        let t = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for (p, square) in [
            (Vec3::new(0.2, 0.2, 3.0), 9.0),
            (Vec3::new(-3.0, -4.0, 0.0), 25.0),
            (Vec3::new(0.5, -2.0, 0.0), 4.0),
            (Vec3::new(1.0, 1.0, 0.0), 0.5),
            (Vec3::new(2.0, 0.0, 1.0), 2.0),
        ] {
            assert!((squared_distance(p, t) - square).abs() < 1e-6, "{p}");
        }
        // The distance to a triangle without area is that to its edges.
        assert_eq!(squared_distance(Vec3::new(0.5, 1.0, 0.0), [Vec3::ZERO, Vec3::X, Vec3::X]), 1.0);
        let nothing = Surface { positions: &[], indices: &[] };
        assert_eq!(hausdorff_distance(nothing, nothing), 0.0);
    }
}
