//! Splits a mesh of several materials into one primitive per part, with the vertices that the part uses.

use super::{MeshPart, MorphData, Result, arrays::vectors, fail};
use choreo_asset::{MorphTarget, Primitive};
use glam::Vec3;

/// The morph targets of a mesh with N vertices.
pub(super) fn morphs(given: &[MorphData], vertices: usize) -> Result<Vec<MorphTarget>> {
    let offsets = |flat: &[f32], what: &str| -> Result<Vec<Vec3>> {
        if flat.is_empty() {
            return Ok(Vec::new());
        }
        Ok(vectors::<3>(flat, what, Some(vertices))?.iter().copied().map(Vec3::from_array).collect())
    };
    let morph = |(at, morph): (usize, &MorphData)| {
        let positions = offsets(&morph.positions, &format!("morphs[{at}].positions"))?;
        let normals = offsets(&morph.normals, &format!("morphs[{at}].normals"))?;
        Ok(MorphTarget { positions, normals, tangents: Vec::new() })
    };
    given.iter().enumerate().map(morph).collect()
}

/// Splits a primitive into one per part. The primitive's indices are the indices of all parts, one part after the other.
pub(super) fn split_into_parts(
    whole: Primitive,
    parts: &[MeshPart],
    materials: usize,
) -> Result<Vec<Primitive>> {
    if parts.is_empty() {
        return Ok(vec![whole]);
    }
    if let Some(at) = parts.iter().position(|part| part.indices.is_empty()) {
        return fail(format!("parts[{at}] has no indices"));
    }
    let missing = parts.iter().filter_map(|part| part.material).find(|m| *m as usize >= materials);
    if let Some(material) = missing {
        return fail(format!("material {material} does not exist (count: {materials})"));
    }
    Ok(parts
        .iter()
        .map(|part| Primitive { material: part.material, ..extract_used_vertices(&whole, &part.indices) })
        .collect())
}

/// A primitive with only the vertices that the indices use, in the order of their first use.
fn extract_used_vertices(whole: &Primitive, indices: &[u32]) -> Primitive {
    let mut number: Vec<Option<u32>> = vec![None; whole.positions.len()];
    let mut vertices: Vec<usize> = Vec::new();
    let mut renumbered = Vec::with_capacity(indices.len());
    for index in indices {
        let number = number[*index as usize].get_or_insert_with(|| {
            vertices.push(*index as usize);
            vertices.len() as u32 - 1
        });
        renumbered.push(*number);
    }
    fn select<T: Copy>(list: &[T], vertices: &[usize], width: usize) -> Vec<T> {
        if list.is_empty() {
            return Vec::new();
        }
        vertices.iter().flat_map(|v| &list[v * width..(v + 1) * width]).copied().collect()
    }
    let morph = |m: &MorphTarget| MorphTarget {
        positions: select(&m.positions, &vertices, 1),
        normals: select(&m.normals, &vertices, 1),
        tangents: select(&m.tangents, &vertices, 1),
    };
    Primitive {
        topology: whole.topology,
        indices: renumbered,
        positions: select(&whole.positions, &vertices, 1),
        normals: select(&whole.normals, &vertices, 1),
        tangents: select(&whole.tangents, &vertices, 1),
        uvs: [select(&whole.uvs[0], &vertices, 1), select(&whole.uvs[1], &vertices, 1)],
        colors: select(&whole.colors, &vertices, 1),
        influences: whole.influences,
        joint_indices: select(&whole.joint_indices, &vertices, whole.influences),
        joint_weights: select(&whole.joint_weights, &vertices, whole.influences),
        morphs: whole.morphs.iter().map(morph).collect(),
        material: None,
    }
}
