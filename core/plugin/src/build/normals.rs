//! Flat normals where a file has none, and splitting of vertices that need several values.

use choreo_asset::{Primitive, Topology};
use glam::{DVec3, Vec3, Vec4};
use std::collections::HashMap;

/// Gives each face vertex of the index list its own value of one attribute. The first value of a vertex is stored in place; each further
/// value goes to a copy at the end of the lists, so that the file's vertex order stays. `value_of` gets the primitive as split so far, in
/// which the positions of face vertices do not change. `store` writes a value to a vertex.
///
/// ```
/// use choreo_plugin::{MeshData, build, glam::Vec2};
/// // Two triangles that share two vertices, and do not share texture coordinates.
/// let positions = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
/// let data = MeshData { positions, indices: vec![0, 1, 2, 2, 1, 3], ..MeshData::default() };
/// let mut primitive = build::primitive(&data)?;
/// let uvs: Vec<Vec2> = (0..6).map(|i| Vec2::new(i as f32, 0.0)).collect();
/// primitive.uvs[0] = vec![Vec2::ZERO; 4];
/// build::normals::split_vertices(
///     &mut primitive,
///     |_, face_vertex| uvs[face_vertex],
///     |uv| uv.to_array().map(f32::to_bits),
///     |p, vertex, uv| p.uvs[0][vertex] = uv,
/// );
/// assert_eq!((primitive.positions.len(), primitive.indices.len()), (6, 6));
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn split_vertices<K: std::hash::Hash + Eq, V: Copy>(
    primitive: &mut Primitive,
    value_of: impl Fn(&Primitive, usize) -> V,
    key: impl Fn(V) -> K,
    store: impl Fn(&mut Primitive, usize, V),
) {
    // The map is never iterated, so its random order has no effect.
    let mut vertex_of: HashMap<(u32, K), u32> = HashMap::new();
    let mut taken = vec![false; primitive.positions.len()];
    for face_vertex in 0..primitive.indices.len() {
        let vertex = primitive.indices[face_vertex];
        let value = value_of(primitive, face_vertex);
        let first = !std::mem::replace(&mut taken[vertex as usize], true);
        let split = *vertex_of.entry((vertex, key(value))).or_insert_with(|| {
            let to = if first { vertex } else { copy_vertex(primitive, vertex as usize) };
            store(primitive, to as usize, value);
            to
        });
        primitive.indices[face_vertex] = split;
    }
}

/// Appends a copy of a vertex with all its attributes.
fn copy_vertex(p: &mut Primitive, vertex: usize) -> u32 {
    fn copy<T: Copy>(list: &mut Vec<T>, from: usize, width: usize) {
        if !list.is_empty() {
            list.extend_from_within(from * width..(from + 1) * width);
        }
    }
    let new = p.positions.len() as u32;
    copy(&mut p.positions, vertex, 1);
    copy(&mut p.normals, vertex, 1);
    copy(&mut p.tangents, vertex, 1);
    copy(&mut p.uvs[0], vertex, 1);
    copy(&mut p.uvs[1], vertex, 1);
    copy(&mut p.colors, vertex, 1);
    copy(&mut p.joint_indices, vertex, p.influences);
    copy(&mut p.joint_weights, vertex, p.influences);
    for morph in &mut p.morphs {
        copy(&mut morph.positions, vertex, 1);
        copy(&mut morph.normals, vertex, 1);
        copy(&mut morph.tangents, vertex, 1);
    }
    new
}

/// The normalized vector; `None` for a zero vector and for values that are not finite. If the squared length does not fit an f32, the
/// result is computed in f64.
///
/// ```
/// use choreo_plugin::{build::normals::unit, glam::Vec3};
/// assert_eq!((unit(Vec3::Y * 1e-30), unit(Vec3::ZERO)), (Some(Vec3::Y), None));
/// ```
pub fn unit(v: Vec3) -> Option<Vec3> {
    let near = v.try_normalize().filter(|n| (n.length_squared() - 1.0).abs() < 1e-5);
    near.or_else(|| v.as_dvec3().try_normalize().map(|n| n.as_vec3()))
}

/// The unit normal of a triangle of vertex indices. +Y if the triangle has no area, which makes it invisible.
fn of_triangle(positions: &[Vec3], triangle: &[u32]) -> Vec3 {
    let [a, b, c] = [0, 1, 2].map(|i| positions[triangle[i] as usize].as_dvec3());
    (b - a).cross(c - a).normalize_or(DVec3::Y).as_vec3().normalize_or(Vec3::Y)
}

/// Replaces zero-length vertex normals by the normal of a triangle that uses the vertex. Lines and points with such a normal lose all
/// normals.
///
/// ```
/// use choreo_plugin::{MeshData, build, glam::Vec3};
/// let positions = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
/// let mut primitive = build::primitive(&MeshData { positions, ..MeshData::default() })?;
/// primitive.normals = vec![Vec3::ZERO; 3];
/// build::normals::replace_zero(&mut primitive);
/// assert_eq!(primitive.normals, [Vec3::Z; 3]);
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn replace_zero(p: &mut Primitive) {
    if p.normals.iter().all(|n| *n != Vec3::ZERO) {
        return;
    }
    if p.topology != Topology::Triangles {
        p.normals.clear();
        return;
    }
    for triangle in p.indices.chunks_exact(3) {
        let face = of_triangle(&p.positions, triangle);
        for i in triangle {
            let normal = &mut p.normals[*i as usize];
            if *normal == Vec3::ZERO {
                *normal = face;
            }
        }
    }
    p.normals.iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
}

/// Computes flat normals, which glTF 2.0 §3.7.2.1 requires for meshes without normals.
///
/// ```
/// use choreo_plugin::{MeshData, build, glam::Vec3};
/// let triangle = MeshData { positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..MeshData::default() };
/// let mut primitive = build::primitive(&triangle)?;
/// build::normals::flat(&mut primitive);
/// assert_eq!(primitive.normals, [Vec3::Z; 3]);
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn flat(p: &mut Primitive) {
    let face_normals: Vec<Vec3> = p.indices.chunks_exact(3).map(|t| of_triangle(&p.positions, t)).collect();
    p.normals = vec![Vec3::Y; p.positions.len()];
    split_vertices(
        p,
        |_, face_vertex| face_normals[face_vertex / 3],
        |n| n.to_array().map(f32::to_bits),
        |p, vertex, n| p.normals[vertex] = n,
    );
}

/// Stores one tangent per face vertex. Vertices that need several tangents are split.
///
/// ```
/// use choreo_plugin::{MeshData, build, glam::Vec4};
/// let positions = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
/// let mut primitive = build::primitive(&MeshData { positions, ..MeshData::default() })?;
/// build::normals::apply_tangents(&mut primitive, &[Vec4::new(1.0, 0.0, 0.0, -1.0); 3]);
/// assert_eq!(primitive.tangents, [Vec4::new(1.0, 0.0, 0.0, -1.0); 3]);
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn apply_tangents(p: &mut Primitive, tangents: &[Vec4]) {
    p.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); p.positions.len()];
    split_vertices(
        p,
        |_, face_vertex| tangents[face_vertex],
        |t| t.to_array().map(f32::to_bits),
        |p, vertex, t| p.tangents[vertex] = t,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_any_length_are_normalized() {
        for scale in [1.0, 1e-22, 1e-38, 1e-44, 1e18, 1e38] {
            let v = unit(Vec3::new(scale, -scale, 0.0)).unwrap();
            assert!((v - Vec3::new(0.70710677, -0.70710677, 0.0)).length() < 1e-6, "{scale}: {v}");
        }
        assert_eq!([Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY)].map(unit), [None; 3]);
    }
    use glam::Vec2;

    /// Two triangles that meet at a right angle share an edge: two vertices are copied.
    #[test]
    fn vertices_on_a_hard_edge_are_split() {
        let mut p = Primitive {
            indices: vec![0, 1, 2, 0, 3, 1],
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            influences: 4,
            joint_indices: (0..16).collect(),
            joint_weights: vec![0.25; 16],
            uvs: [vec![Vec2::X, Vec2::Y, Vec2::ONE, Vec2::ZERO], Vec::new()],
            ..Primitive::default()
        };
        flat(&mut p);
        assert_eq!(p.positions, [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO, Vec3::X]);
        assert_eq!(p.indices, [0, 1, 2, 4, 3, 5]);
        assert_eq!(p.normals, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y, Vec3::Y, Vec3::Y]);
        assert_eq!(p.uvs[0][4..], [Vec2::X, Vec2::Y]);
        assert!(p.uvs[1].is_empty());
        assert_eq!(p.joint_indices[16..], [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(p.joint_weights.len(), 24);
    }
}
