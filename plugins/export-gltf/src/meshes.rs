//! Meshes: vertex arrays as accessors, equal content stored once, and primitives that refer to them (glTF 2.0, §3.7).

use crate::buffer::{Buffer, F32, INDICES, U8, U16, U32, VERTICES};
use crate::document::{self, Accessor, Index};
use choreo_plugin::asset::{Mesh, Primitive, Skin, Topology};
use choreo_plugin::glam::{Mat4, Vec3, Vec4};
use serde_json::{Map, Value, json};

/// Largest error of a unit vector's squared length that is left alone; the validator allows 0.0005 of the length.
const UNIT_LENGTH_TOLERANCE: f32 = 5e-4;

/// Either the skinned or the unskinned primitives of a mesh; `None` where there are none. `material` maps a material of the asset
/// to the document's.
pub(crate) fn mesh<'a>(
    buffer: &mut Buffer<'a>,
    mesh: &'a Mesh,
    skin: Option<&Skin>,
    skinned: bool,
    mut material: impl FnMut(Option<u32>) -> Option<Index>,
) -> Option<document::Mesh> {
    let follows = |p: &&Primitive| (skin.is_some() && p.influences > 0) == skinned;
    let drawn = mesh.primitives.iter().filter(|p| !p.positions.is_empty() && !p.indices.is_empty());
    let mut primitives = Vec::new();
    for primitive in drawn.filter(follows) {
        let mut attributes = attributes(buffer, primitive);
        if let Some(skin) = skin.filter(|_| skinned) {
            add_influences(buffer, primitive, skin.joints.len(), &mut attributes);
        }
        primitives.push(document::Primitive {
            attributes,
            indices: indices(buffer, primitive),
            material: material(primitive.material),
            mode: match primitive.topology {
                Topology::Points => 0,
                Topology::Lines => 1,
                Topology::Triangles => 4,
            },
            targets: targets(buffer, primitive, mesh.morph_targets),
        });
    }
    let names = &mesh.morph_names;
    let extras = (mesh.morph_targets > 0).then(|| json!({ "targetNames": names }));
    (!primitives.is_empty()).then(|| document::Mesh { name: mesh.name.clone(), primitives, extras })
}

fn attributes<'a>(buffer: &mut Buffer<'a>, primitive: &'a Primitive) -> Map<String, Value> {
    let Primitive { positions, normals, tangents, uvs, colors, .. } = primitive;
    let mut out = Map::new();
    let count = positions.len();
    let bounded = Accessor::of(F32, "VEC3", count).bounded(positions.iter().map(Vec3::to_array));
    let accessor = buffer.array(move |i| positions[i].to_array(), Some(VERTICES), bounded);
    out.insert("POSITION".into(), accessor.into());
    let mut add = |name: String, shape, row: &dyn Fn(&mut Buffer<'a>, Accessor) -> Index| {
        out.insert(name, row(buffer, Accessor::of(F32, shape, count)).into());
    };
    if normals.len() == count {
        let row = move |i: usize| normalized_or(normals[i], Vec3::Y).to_array();
        add("NORMAL".into(), "VEC3", &|buffer, accessor| buffer.array(row, Some(VERTICES), accessor));
    }
    if tangents.len() == count && normals.len() == count {
        let row = move |i: usize| {
            let direction = normalized_or(tangents[i].truncate(), Vec3::X);
            direction.extend(if tangents[i].w < 0.0 { -1.0 } else { 1.0 }).to_array()
        };
        add("TANGENT".into(), "VEC4", &|buffer, accessor| buffer.array(row, Some(VERTICES), accessor));
    }
    for (set, uvs) in uvs.iter().enumerate().filter(|(_, uvs)| uvs.len() == count) {
        let row = move |i: usize| uvs[i].to_array();
        let name = format!("TEXCOORD_{set}");
        add(name, "VEC2", &|buffer, accessor| buffer.array(row, Some(VERTICES), accessor));
    }
    if colors.len() == count {
        let row = move |i: usize| colors[i].clamp(Vec4::ZERO, Vec4::ONE).to_array();
        add("COLOR_0".into(), "VEC4", &|buffer, accessor| buffer.array(row, Some(VERTICES), accessor));
    }
    out
}

/// A unit vector; one whose length is near enough to 1 stays bit for bit.
fn normalized_or(v: Vec3, otherwise: Vec3) -> Vec3 {
    if (v.length_squared() - 1.0).abs() <= UNIT_LENGTH_TOLERANCE { v } else { v.normalize_or(otherwise) }
}

fn indices<'a>(buffer: &mut Buffer<'a>, primitive: &'a Primitive) -> Index {
    let list = &primitive.indices;
    // The largest index of each type is reserved for primitive restart (§3.7.2.1).
    match primitive.positions.len() {
        ..=65_535 => {
            let accessor = Accessor::of(U16, "SCALAR", list.len());
            buffer.array(move |i| [list[i] as u16], Some(INDICES), accessor)
        }
        _ => buffer.array(move |i| [list[i]], Some(INDICES), Accessor::of(U32, "SCALAR", list.len())),
    }
}

/// Adds `JOINTS_0` and `WEIGHTS_0`, and the second sets where there are eight influences.
fn add_influences<'a>(
    buffer: &mut Buffer<'a>,
    primitive: &'a Primitive,
    joints: usize,
    out: &mut Map<String, Value>,
) {
    let (count, influences) = (primitive.positions.len(), primitive.influences);
    for set in 0..influences.div_ceil(4) {
        let row = move |vertex: usize| -> [(u16, f32); 4] {
            let range = vertex * influences..(vertex + 1) * influences;
            let (joints, weights) =
                (&primitive.joint_indices[range.clone()], &primitive.joint_weights[range]);
            let mut all = [(0, 0.0); 8];
            all.iter_mut().zip(joints.iter().zip(weights)).for_each(|(to, (j, w))| *to = (*j, *w));
            merge_and_normalize(&mut all[..influences.min(8)]);
            std::array::from_fn(|i| all[set * 4 + i])
        };
        let accessor = |component| Accessor::of(component, "VEC4", count);
        let index = match joints {
            ..=256 => buffer.array(move |i| row(i).map(|(j, _)| j as u8), Some(VERTICES), accessor(U8)),
            _ => buffer.array(move |i| row(i).map(|(j, _)| j), Some(VERTICES), accessor(U16)),
        };
        out.insert(format!("JOINTS_{set}"), index.into());
        let weights = buffer.array(move |i| row(i).map(|(_, w)| w), Some(VERTICES), accessor(F32));
        out.insert(format!("WEIGHTS_{set}"), weights.into());
    }
}

/// Normalizes influences: each joint occurs once, joints without weight become joint 0, and weights sum to 1 (§3.7.3.3).
fn merge_and_normalize(row: &mut [(u16, f32)]) {
    for i in 1..row.len() {
        if let Some(first) = (0..i).find(|k| row[*k].0 == row[i].0 && row[*k].1 > 0.0) {
            row[first].1 += row[i].1;
            row[i].1 = 0.0;
        }
    }
    let sum: f64 = row.iter().map(|(_, weight)| f64::from(*weight)).sum();
    for (joint, weight) in row.iter_mut() {
        if (sum - 1.0).abs() > 1e-7 && sum > 0.0 {
            *weight = (f64::from(*weight) / sum) as f32;
        }
        if *weight == 0.0 {
            *joint = 0;
        }
    }
}

/// All morph targets of the mesh. A target that moves nothing here has an accessor of zeros, which takes no bytes.
fn targets<'a>(buffer: &mut Buffer<'a>, primitive: &'a Primitive, number: usize) -> Vec<Map<String, Value>> {
    let count = primitive.positions.len();
    let target = |index: usize| {
        let mut out = Map::new();
        let morph = primitive.morphs.get(index);
        let list = |list: &'a [Vec3]| (list.len() == count).then_some(list);
        let bounded = |v: &[Vec3]| Accessor::of(F32, "VEC3", count).bounded(v.iter().map(Vec3::to_array));
        let position = match morph.and_then(|m| list(&m.positions)) {
            Some(offsets) => buffer.array(move |i| offsets[i].to_array(), Some(VERTICES), bounded(offsets)),
            None => {
                let zero =
                    Accessor { min: vec![0.0; 3], max: vec![0.0; 3], ..Accessor::of(F32, "VEC3", count) };
                buffer.accessor(zero)
            }
        };
        out.insert("POSITION".into(), position.into());
        let others = morph.map_or([None, None], |m| [list(&m.normals), list(&m.tangents)]);
        let has = [primitive.normals.len() == count, primitive.tangents.len() == count];
        for ((name, offsets), has) in ["NORMAL", "TANGENT"].iter().zip(others).zip(has) {
            if let Some(offsets) = offsets.filter(|_| has) {
                let accessor = Accessor::of(F32, "VEC3", count);
                let index = buffer.array(move |i| offsets[i].to_array(), Some(VERTICES), accessor);
                out.insert((*name).into(), index.into());
            }
        }
        out
    };
    (0..number).map(target).collect()
}

/// The accessor of a skin's inverse bind matrices.
pub(crate) fn inverse_bind<'a>(buffer: &mut Buffer<'a>, skin: &'a Skin) -> Index {
    let matrix = move |index: usize| {
        let mut m = skin.inverse_bind.get(index).copied().unwrap_or(Mat4::IDENTITY);
        // glTF requires the fourth row 0 0 0 1 (§3.7.3.1).
        (m.x_axis.w, m.y_axis.w, m.z_axis.w, m.w_axis.w) = (0.0, 0.0, 0.0, 1.0);
        m.to_cols_array()
    };
    buffer.array(matrix, None, Accessor::of(F32, "MAT4", skin.joints.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn influences_are_unique_and_normalized() {
        let mut row = [(3, 0.25), (3, 0.25), (7, 0.0), (9, 0.5)];
        merge_and_normalize(&mut row);
        assert_eq!(row, [(3, 0.5), (0, 0.0), (0, 0.0), (9, 0.5)]);
        let mut row = [(3, 1.0), (4, 3.0)];
        merge_and_normalize(&mut row);
        assert_eq!(row, [(3, 0.25), (4, 0.75)]);
    }
}
