//! Tangents for normal maps, as MikkTSpace makes them (M. Mikkelsen, "Simulation of Wrinkled Surfaces
//! Revisited", 2008, and mikktspace.c), which glTF 2.0 §3.7.2.1 requires.
//!
//! The algorithm, without the angular threshold, as other programs use it: face vertices with equal position, normal
//! and uv are one vertex; around a vertex, triangles that share an edge and have the same uv orientation
//! form a group; a group's tangent is the angle-weighted mean of its triangles' ∂position/∂u, projected
//! into the plane of the normal. The C program groups by recursion and compares all pairs in a group;
//! here a union-find does it, so that a vertex with a million triangles is no problem. On edges of more
//! than two triangles, where the C program pairs them in the order of a sort, all are joined.

use super::normals;
use choreo_asset::Primitive;
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Adds tangents that follow a set of texture coordinates. Vertices that need several are split.
///
/// ```
/// use choreo_plugin::{MeshData, build, glam::Vec3};
/// let data = MeshData {
///     positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
///     normals: [0.0, 0.0, 1.0].repeat(3),
///     uvs: vec![0.0, 1.0, 1.0, 1.0, 0.0, 0.0],
///     ..MeshData::default()
/// };
/// let mut primitive = build::primitive(&data)?;
/// build::tangents::add(&mut primitive, 0);
/// assert!(primitive.tangents.iter().all(|tangent| tangent.truncate() == Vec3::X));
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn add(p: &mut Primitive, uv_set: usize) {
    let tangents = triangle_tangents(&p.indices, &p.positions, &p.normals, &p.uvs[uv_set]);
    normals::apply_tangents(p, &tangents);
}

/// One tangent per face vertex of the triangle list: xyz is a unit vector, w the sign of the bitangent.
///
/// ```
/// use choreo_plugin::glam::{Vec2, Vec3, Vec4};
/// use choreo_plugin::build::tangents::triangle_tangents;
/// let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// let uvs = [Vec2::Y, Vec2::ONE, Vec2::ZERO];
/// assert_eq!(triangle_tangents(&[0, 1, 2], &positions, &[Vec3::Z; 3], &uvs), [Vec4::new(1.0, 0.0, 0.0, 1.0); 3]);
/// ```
pub fn triangle_tangents(indices: &[u32], positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2]) -> Vec<Vec4> {
    let welded = weld(positions, normals, uvs);
    let vertex: Vec<u32> = indices.iter().map(|i| welded[*i as usize]).collect();
    let mut faces: Vec<Face> = vertex.chunks_exact(3).map(|t| Face::new(t, positions, uvs)).collect();

    let mut groups = Groups::new(vertex.len());
    for run in shared_edges(&vertex, &faces).chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
        join_edge_groups(run, &mut faces, &mut groups);
    }

    let mut sums = vec![Vec3::ZERO; vertex.len()];
    for face_vertex in 0..vertex.len() {
        let face = &faces[face_vertex / 3];
        if face.degenerate || face.no_uv_area {
            continue;
        }
        let at = |k: usize| vertex[face_vertex / 3 * 3 + (face_vertex + k) % 3] as usize;
        // (face vertex + k) % 3 walks the triangle, because a triangle starts at a multiple of three.
        let normal = normals[at(0)];
        let flatten = |v: Vec3| (v - normal * normal.dot(v)).normalize_or_zero();
        let next = flatten(positions[at(1)] - positions[at(0)]);
        let previous = flatten(positions[at(2)] - positions[at(0)]);
        let angle = libm::acosf(next.dot(previous).clamp(-1.0, 1.0));
        sums[groups.find(face_vertex)] += flatten(face.along_u) * angle;
    }

    let mut of_vertex: HashMap<u32, Vec4> = HashMap::new();
    let mut out = vec![Vec4::ZERO; vertex.len()];
    for face_vertex in (0..vertex.len()).filter(|c| !faces[c / 3].degenerate) {
        let normal = normals[vertex[face_vertex] as usize];
        let sum = sums[groups.find(face_vertex)];
        let tangent = sum.try_normalize().unwrap_or_else(|| perpendicular(normal));
        let sign = if faces[face_vertex / 3].keeps_orientation { 1.0 } else { -1.0 };
        out[face_vertex] = tangent.extend(sign);
        of_vertex.entry(vertex[face_vertex]).or_insert(out[face_vertex]);
    }
    // Triangles without area take the tangent that their vertex has in another triangle.
    for face_vertex in (0..vertex.len()).filter(|c| faces[c / 3].degenerate) {
        let normal = normals[vertex[face_vertex] as usize];
        out[face_vertex] =
            of_vertex.get(&vertex[face_vertex]).copied().unwrap_or_else(|| perpendicular(normal).extend(1.0));
    }
    out
}

fn perpendicular(normal: Vec3) -> Vec3 {
    if normal.is_normalized() { normal.any_orthonormal_vector() } else { Vec3::X }
}

/// The first vertex equal to each vertex.
fn weld(positions: &[Vec3], normals: &[Vec3], uvs: &[Vec2]) -> Vec<u32> {
    let mut first: HashMap<[u32; 8], u32> = HashMap::with_capacity(positions.len());
    // Adding zero turns −0 into 0, so that the bits of equal numbers are equal.
    let bits = |v: f32| (v + 0.0).to_bits();
    (0..positions.len())
        .map(|i| {
            let ([px, py, pz], [nx, ny, nz], [u, v]) =
                (positions[i].to_array(), normals[i].to_array(), uvs[i].to_array());
            *first.entry([px, py, pz, nx, ny, nz, u, v].map(bits)).or_insert(i as u32)
        })
        .collect()
}

struct Face {
    /// Direction in which u grows.
    along_u: Vec3,
    keeps_orientation: bool,
    no_uv_area: bool,
    degenerate: bool,
}

impl Face {
    fn new(t: &[u32], positions: &[Vec3], uvs: &[Vec2]) -> Face {
        let [p0, p1, p2] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
        // glTF's v points down and its bitangent up (§3.7.2.1): v is turned around here.
        let [w0, w1, w2] = [t[0], t[1], t[2]].map(|i| uvs[i as usize] * Vec2::new(1.0, -1.0));
        let (d1, d2) = (p1 - p0, p2 - p0);
        let (t21, t31) = (w1 - w0, w2 - w0);
        let area = t21.x * t31.y - t21.y * t31.x;
        let keeps_orientation = area > 0.0;
        let sign = if keeps_orientation { 1.0 } else { -1.0 };
        Face {
            along_u: (d1 * t31.y - d2 * t21.y).normalize_or_zero() * sign,
            keeps_orientation,
            no_uv_area: area.abs() <= f32::MIN_POSITIVE || !area.is_finite(),
            degenerate: p0 == p1 || p1 == p2 || p2 == p0,
        }
    }
}

/// An edge of a face, by welded vertices, with the face vertices at its two ends.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    low: u32,
    high: u32,
    face_vertex_low: u32,
    face_vertex_high: u32,
}

fn shared_edges(vertex: &[u32], faces: &[Face]) -> Vec<Edge> {
    let mut edges = Vec::with_capacity(vertex.len());
    for face_vertex in (0..vertex.len()).filter(|c| !faces[c / 3].degenerate) {
        let next = face_vertex / 3 * 3 + (face_vertex + 1) % 3;
        let (a, b) = ((vertex[face_vertex], face_vertex as u32), (vertex[next], next as u32));
        let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
        edges.push(Edge { low: low.0, high: high.0, face_vertex_low: low.1, face_vertex_high: high.1 });
    }
    edges.sort_unstable();
    edges
}

/// Joins the groups at both ends of one edge, for faces of equal orientation.
/// A face without uv area takes the orientation of its first neighbor.
fn join_edge_groups(run: &[Edge], faces: &mut [Face], groups: &mut Groups) {
    let oriented = run.iter().map(|e| e.face_vertex_low as usize / 3).find(|f| !faces[*f].no_uv_area);
    if let Some(model) = oriented {
        let orientation = faces[model].keeps_orientation;
        for edge in run {
            let face = &mut faces[edge.face_vertex_low as usize / 3];
            // `no_uv_area` stays set, because the face has no tangent direction to add.
            if face.no_uv_area {
                face.keeps_orientation = orientation;
            }
        }
    }
    for orientation in [true, false] {
        let mut first: Option<&Edge> = None;
        for edge in
            run.iter().filter(|e| faces[e.face_vertex_low as usize / 3].keeps_orientation == orientation)
        {
            match first {
                None => first = Some(edge),
                Some(f) => {
                    groups.join(f.face_vertex_low as usize, edge.face_vertex_low as usize);
                    groups.join(f.face_vertex_high as usize, edge.face_vertex_high as usize);
                }
            }
        }
    }
}

/// Union-find with path halving; the smallest face vertex of a group represents it.
struct Groups(Vec<u32>);

impl Groups {
    fn new(face_vertices: usize) -> Groups {
        Groups((0..face_vertices as u32).collect())
    }

    fn find(&mut self, face_vertex: usize) -> usize {
        let mut at = face_vertex;
        while self.0[at] as usize != at {
            self.0[at] = self.0[self.0[at] as usize];
            at = self.0[at] as usize;
        }
        at
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quad in the xy plane, uv as in glTF (v down): the tangent is +x, the bitangent +y, so w = 1.
    #[test]
    fn mirroring_the_uvs_of_a_quad_negates_the_bitangent() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let normals = [Vec3::Z; 4];
        let uvs = [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::ZERO];
        let indices = [0, 1, 2, 0, 2, 3];
        for t in triangle_tangents(&indices, &positions, &normals, &uvs) {
            assert!((t - Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 1e-6, "{t}");
        }
        let mirrored = uvs.map(|uv| Vec2::new(1.0 - uv.x, uv.y));
        for t in triangle_tangents(&indices, &positions, &normals, &mirrored) {
            assert!((t - Vec4::new(-1.0, 0.0, 0.0, -1.0)).length() < 1e-6, "{t}");
        }
    }

    #[test]
    fn degenerate_input_gives_unit_tangents() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO];
        let indices = [0, 1, 2, 0, 3, 1, 2, 2, 2];
        for uvs in [[Vec2::ZERO; 4], [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::splat(f32::MAX)]] {
            for t in triangle_tangents(&indices, &positions, &[Vec3::Z; 4], &uvs) {
                assert!(t.truncate().is_normalized() && t.w.abs() == 1.0, "{t}");
            }
        }
        assert!(triangle_tangents(&[], &[], &[], &[]).is_empty());
    }
}
