//! Normals for surfaces without normals: smooth across edges that are flatter than an angle.

use crate::normals::split_vertices;
use choreo_asset::Primitive;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::ops::Range;

/// Largest number of triangles around one vertex that are compared with each other, in all pairs. Beyond it (more than any modeled surface
/// has) the face vertices keep their triangles' normals, so that time stays proportional to the file.
const MAX_AROUND: usize = 256;

/// Replaces the normals of a triangle list. Each face vertex gets the mean, weighted by angle, of the normals of the triangles
/// around its position whose normals are at most `limit_rad` from its own; with `group`, only triangles of the same number
/// are taken and the angle does not count (number 0 stays flat: OBJ's smoothing groups). Vertices are split where needed.
pub fn normals(p: &mut Primitive, limit_rad: f64, group: Option<&[u32]>) {
    let faces = p.indices.len() / 3;
    let face_vertex_position = |c: usize| p.positions[p.indices[c] as usize].as_dvec3();
    let face_normals: Vec<DVec3> = (0..faces)
        .map(|f| {
            let [a, b, c] = [0, 1, 2].map(|i| face_vertex_position(f * 3 + i));
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let around = FaceVerticesByPosition::new(p);
    // Each angle weights all normals around it, so it is computed only once.
    let angles: Vec<f64> =
        around.face_vertices.iter().map(|face_vertex| angle(p, *face_vertex as usize)).collect();
    let cos_limit = libm::cos(limit_rad);
    let together = |a: usize, b: usize| match group {
        Some(group) => group[a] == group[b] && group[a] != 0,
        // The limit is slightly larger than the angle, so that faces which meet exactly at it are smooth.
        None => face_normals[a].dot(face_normals[b]) >= cos_limit - 1e-9,
    };
    // Normals are computed one by one as face vertices are split, because a list of all would be as large as the mesh.
    let normal = |p: &Primitive, face_vertex: usize| {
        let face = face_vertex / 3;
        let own = face_normals[face];
        let mut sum = DVec3::ZERO;
        let range = around.range(p.indices[face_vertex]);
        for (other, angle) in around.face_vertices[range.clone()].iter().zip(&angles[range]) {
            let other = *other as usize / 3;
            if other == face || together(face, other) {
                sum += face_normals[other] * *angle;
            }
        }
        // A triangle without area is invisible, so any unit vector is right.
        sum.try_normalize().unwrap_or(own.normalize_or(DVec3::Y)).as_vec3().normalize_or(Vec3::Y)
    };
    p.normals = vec![Vec3::Y; p.positions.len()];
    split_vertices(p, normal, |n| n.to_array().map(f32::to_bits), |p, vertex, n| p.normals[vertex] = n);
}

/// The angle of a triangle at a face vertex.
fn angle(p: &Primitive, face_vertex: usize) -> f64 {
    let (face, k) = (face_vertex / 3 * 3, face_vertex % 3);
    let at = |k: usize| p.positions[p.indices[face + k] as usize].as_dvec3();
    let (here, next, previous) = (at(k), at([1, 2, 0][k]), at([2, 0, 1][k]));
    let (a, b) = ((next - here).normalize_or_zero(), (previous - here).normalize_or_zero());
    libm::acos(a.dot(b).clamp(-1.0, 1.0))
}

/// Face vertices by position. Equal bits are the same position, even of different vertices.
struct FaceVerticesByPosition {
    place_of_vertex: Vec<u32>,
    /// Index of the first entry of each position in `face_vertices`; one entry more than positions.
    start: Vec<u32>,
    /// Face vertices, sorted by position; positions with more than [`MAX_AROUND`] have none here.
    face_vertices: Vec<u32>,
}

impl FaceVerticesByPosition {
    fn new(p: &Primitive) -> FaceVerticesByPosition {
        // The map is never iterated, so its random order has no effect.
        let mut places: HashMap<[u32; 3], u32> = HashMap::with_capacity(p.positions.len());
        let mut place_of_vertex = Vec::with_capacity(p.positions.len());
        for v in &p.positions {
            // Adding zero turns −0 into 0.
            let next = places.len() as u32;
            place_of_vertex.push(*places.entry(v.to_array().map(|c| (c + 0.0).to_bits())).or_insert(next));
        }
        let place = |vertex: &u32| place_of_vertex[*vertex as usize] as usize;
        let mut count = vec![0u32; places.len()];
        p.indices.iter().for_each(|i| count[place(i)] += 1);
        let few = |count: u32| if count as usize <= MAX_AROUND { count } else { 0 };
        let mut start = Vec::with_capacity(places.len() + 1);
        start.push(0);
        for c in &count {
            start.push(start.last().copied().unwrap_or(0) + few(*c));
        }
        let mut next = start.clone();
        let mut face_vertices = vec![0; start.last().copied().unwrap_or(0) as usize];
        for (face_vertex, index) in p.indices.iter().enumerate() {
            let place = place(index);
            if few(count[place]) > 0 {
                face_vertices[next[place] as usize] = face_vertex as u32;
                next[place] += 1;
            }
        }
        FaceVerticesByPosition { place_of_vertex, start, face_vertices }
    }

    /// Range in `face_vertices` of the face vertices at the position of a vertex; empty if there are too many to compare.
    fn range(&self, vertex: u32) -> Range<usize> {
        let place = self.place_of_vertex[vertex as usize] as usize;
        self.start[place] as usize..self.start[place + 1] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three triangles around the z axis: two at 90°, the third leaning 30° from the first.
    fn fan() -> Primitive {
        let lean = Vec3::new(-1.0, 0.0, 0.5773503);
        Primitive {
            indices: vec![0, 1, 2, 0, 3, 1, 0, 2, 4],
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NEG_Z, lean],
            ..Primitive::default()
        }
    }

    #[test]
    fn edges_flatter_than_the_limit_are_smooth() {
        let mut p = fan();
        normals(&mut p, 45f64.to_radians(), None);
        let face_vertex = |p: &Primitive, c: usize| p.normals[p.indices[c] as usize];
        assert_eq!(
            face_vertex(&p, 0),
            face_vertex(&p, 6),
            "the first and the leaning triangle share a normal along their edge"
        );
        assert_eq!(face_vertex(&p, 2), face_vertex(&p, 7));
        assert!(face_vertex(&p, 0).dot(Vec3::Z) < 0.999);
        assert!(
            (face_vertex(&p, 3) - Vec3::NEG_Y).length() < 1e-6
                || (face_vertex(&p, 3) - Vec3::Y).length() < 1e-6
        );
        let mut flat = fan();
        normals(&mut flat, 0.0, None);
        assert_eq!(face_vertex(&flat, 0), Vec3::Z);
    }

    #[test]
    fn smoothing_groups_override_the_angle() {
        let mut p = fan();
        normals(&mut p, 0.0, Some(&[7, 7, 0]));
        let face_vertex = |c: usize| p.normals[p.indices[c] as usize];
        assert_eq!(face_vertex(0), face_vertex(3));
        assert!((face_vertex(0).length() - 1.0).abs() < 1e-6);
        assert!(face_vertex(6) != face_vertex(0));
    }

    #[test]
    fn a_vertex_with_a_million_triangles_is_fast() {
        let n = 1_000_000u32;
        let mut p = Primitive {
            indices: (0..n).flat_map(|_| [0, 1, 2]).collect(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            ..Primitive::default()
        };
        normals(&mut p, 1.0, None);
        assert_eq!(p.normals, [Vec3::Z; 3]);
    }
}
