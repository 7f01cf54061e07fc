//! Conversion of flat arrays of numbers to the vertices of a primitive, with checks.

use super::parts::morphs;
use super::{MOST, MeshData, Result, fail};
use choreo_asset::{Primitive, Topology};
use glam::{Vec2, Vec3, Vec4};

/// The vertices and indices of `data`, without joints. The error names the array and the element.
///
/// # Errors
/// An array of the wrong length, a number that is not finite, an index beyond the vertices.
///
/// ```
/// use choreo_plugin::{MeshData, build::primitive};
/// let triangle = MeshData { positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..MeshData::default() };
/// assert_eq!(primitive(&triangle)?.indices, [0, 1, 2]);
/// # Ok::<(), choreo_plugin::BuildError>(())
/// ```
pub fn primitive(data: &MeshData) -> Result<Primitive> {
    take_primitive(&mut data.clone())
}

/// Does what [`primitive`] does, but takes the arrays out of `data`: positions, normals, uvs and indices are not copied.
pub(super) fn take_primitive(data: &mut MeshData) -> Result<Primitive> {
    let vertices = vectors::<3>(&data.positions, "positions", None)?.len();
    if vertices > MOST || data.indices.len() > MOST {
        return fail(format!(
            "it has {vertices} vertices and {} indices, at most {MOST} each",
            data.indices.len()
        ));
    }
    if !(data.parts.is_empty() || data.indices.is_empty() && data.material.is_none()) {
        return fail("parts have indices and materials of their own: leave indices and material out".into());
    }
    let what = if data.indices.is_empty() && data.parts.is_empty() { "vertices" } else { "indices" };
    let indices: Vec<u32> = match (data.parts.as_slice(), data.indices.is_empty()) {
        ([], true) => (0..vertices as u32).collect(),
        ([], false) => std::mem::take(&mut data.indices),
        (parts, _) => parts.iter().flat_map(|part| &part.indices).copied().collect(),
    };
    let (vertices_each, each) = match data.topology {
        Topology::Triangles => (3, "three for each triangle"),
        Topology::Lines => (2, "two for each line"),
        Topology::Points => (1, ""),
    };
    if !indices.len().is_multiple_of(vertices_each) {
        return fail(format!("{what} must be {each}, got {}", indices.len()));
    }
    if let Some(at) = indices.iter().position(|i| *i as usize >= vertices) {
        return fail(format!("indices[{at}] is {}, but the number of vertices is {vertices}", indices[at]));
    }
    let positions: Vec<Vec3> = rows(&mut data.positions).map(Vec3::from_array).collect();
    let normals = match data.normals.is_empty() {
        true if data.topology == Topology::Triangles => normals(&positions, &indices),
        true => Vec::new(),
        false => {
            vectors::<3>(&data.normals, "normals", Some(vertices))?;
            rows(&mut data.normals).map(|n| Vec3::from_array(n).normalize_or(Vec3::Y)).collect()
        }
    };
    let uvs = match data.uvs.is_empty() {
        true => Vec::new(),
        false => {
            vectors::<2>(&data.uvs, "uvs", Some(vertices))?;
            rows(&mut data.uvs).map(Vec2::from_array).collect()
        }
    };
    let colors = match data.colors.len() {
        0 => Vec::new(),
        n if n == 3 * vertices => {
            let given = vectors::<3>(&data.colors, "colors", Some(vertices))?;
            given.iter().map(|c| Vec3::from_array(*c).extend(1.0)).collect()
        }
        _ => vectors::<4>(&data.colors, "colors", Some(vertices))?
            .iter()
            .copied()
            .map(Vec4::from_array)
            .collect(),
    };
    Ok(Primitive {
        topology: data.topology,
        indices,
        positions,
        normals,
        uvs: [uvs, Vec::new()],
        colors,
        morphs: morphs(&data.morphs, vertices)?,
        material: data.material,
        ..Primitive::default()
    })
}

/// Takes a flat list as rows of `N` numbers and leaves it empty. The memory is reused if length and capacity are multiples of `N`; else the
/// rows are copied.
fn rows<const N: usize>(list: &mut Vec<f32>) -> std::vec::IntoIter<[f32; N]> {
    let rows = bytemuck::allocation::try_cast_vec(std::mem::take(list));
    rows.unwrap_or_else(|(_, list)| list.as_chunks().0.to_vec()).into_iter()
}

/// Finite vectors of `N` numbers, as many as there are vertices.
pub(super) fn vectors<'a, const N: usize>(
    flat: &'a [f32],
    what: &str,
    vertices: Option<usize>,
) -> Result<&'a [[f32; N]]> {
    let (vectors, rest) = flat.as_chunks::<N>();
    let count = flat.len();
    match vertices {
        Some(v) if count != N * v => {
            return fail(format!("{what} must have {N} numbers for each of the {v} vertices, has {count}"));
        }
        None if !rest.is_empty() || count == 0 => {
            return fail(format!("{what} must have {N} numbers for each vertex, has {count}"));
        }
        _ => {}
    }
    match flat.iter().position(|v| !v.is_finite()) {
        Some(at) => fail(format!("{what}[{at}] is {}, must be finite", flat[at])),
        None => Ok(vectors),
    }
}

/// Vertex normals: the mean of the normals of a vertex's triangles, weighted by area. Triangles that share no vertices are flat-shaded.
pub(super) fn normals(positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let normal = (b - a).cross(c - a);
        for i in triangle {
            sums[*i as usize] += normal;
        }
    }
    sums.iter().map(|n| n.normalize_or(Vec3::Y)).collect()
}
