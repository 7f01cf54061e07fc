//! Meshes: vertex arrays as accessors, each content once, and primitives that name them (glTF 2.0, §3.7).

use crate::buffer::{Buffer, F32, INDICES, U8, U16, U32, VERTICES};
use crate::document::{self, Accessor, Index};
use choreo_plugin::asset::{Mesh, Primitive, Skin, Topology};
use choreo_plugin::glam::{Mat4, Vec3, Vec4};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// Squared length by which a unit vector may be off; the validator allows 0.0005 of the length.
const UNIT: f32 = 5e-4;

/// The mesh with those of its primitives that follow a skin, or those that do not; `None` where there are none.
/// `material`: the document's material of one of the asset.
pub fn mesh<'a>(
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
    let mut out = Map::new();
    let count = primitive.positions.len();
    let positions = Accessor::of(F32, "VEC3", count).bounded(primitive.positions.iter().map(Vec3::to_array));
    let bytes = bytemuck::cast_slice(&primitive.positions);
    out.insert("POSITION".into(), buffer.array(Cow::Borrowed(bytes), Some(VERTICES), positions).into());
    if primitive.normals.len() == count {
        let bytes = units(&primitive.normals, Vec3::length_squared, |n| n.normalize_or(Vec3::Y));
        out.insert("NORMAL".into(), vertices(buffer, bytes, "VEC3", count));
    }
    if primitive.tangents.len() == count && primitive.normals.len() == count {
        let square = |t: Vec4| if t.w.abs() == 1.0 { t.truncate().length_squared() } else { 0.0 };
        let bytes = units(&primitive.tangents, square, |t| {
            t.truncate().normalize_or(Vec3::X).extend(if t.w < 0.0 { -1.0 } else { 1.0 })
        });
        out.insert("TANGENT".into(), vertices(buffer, bytes, "VEC4", count));
    }
    for (set, uvs) in primitive.uvs.iter().enumerate().filter(|(_, uvs)| uvs.len() == count) {
        let bytes = Cow::Borrowed(bytemuck::cast_slice(uvs));
        out.insert(format!("TEXCOORD_{set}"), vertices(buffer, bytes, "VEC2", count));
    }
    if primitive.colors.len() == count {
        let clamped = |c: &Vec4| c.clamp(Vec4::ZERO, Vec4::ONE);
        let bytes = match primitive.colors.iter().all(|c| clamped(c) == *c) {
            true => Cow::Borrowed(bytemuck::cast_slice(&primitive.colors)),
            false => owned(&primitive.colors.iter().map(clamped).collect::<Vec<Vec4>>()),
        };
        out.insert("COLOR_0".into(), vertices(buffer, bytes, "VEC4", count));
    }
    out
}

fn vertices<'a>(buffer: &mut Buffer<'a>, bytes: Cow<'a, [u8]>, shape: &'static str, count: usize) -> Value {
    buffer.array(bytes, Some(VERTICES), Accessor::of(F32, shape, count)).into()
}

fn owned<T: bytemuck::NoUninit>(list: &[T]) -> Cow<'static, [u8]> {
    Cow::Owned(bytemuck::cast_slice(list).to_vec())
}

/// Vectors of length 1; where one is not, all of them are copied and made so.
fn units<V: bytemuck::NoUninit>(
    list: &[V],
    length_squared: impl Fn(V) -> f32,
    unit: impl Fn(V) -> V,
) -> Cow<'_, [u8]> {
    let is_unit = |v: &V| (length_squared(*v) - 1.0).abs() <= UNIT;
    match list.iter().all(is_unit) {
        true => Cow::Borrowed(bytemuck::cast_slice(list)),
        false => owned(&list.iter().map(|v| if is_unit(v) { *v } else { unit(*v) }).collect::<Vec<V>>()),
    }
}

fn indices<'a>(buffer: &mut Buffer<'a>, primitive: &'a Primitive) -> Index {
    let (list, count) = (&primitive.indices, primitive.indices.len());
    // The largest number of each type is reserved for primitive restart (§3.7.2.1).
    let (bytes, component) = match primitive.positions.len() {
        ..=65_535 => (owned(&list.iter().map(|i| *i as u16).collect::<Vec<u16>>()), U16),
        _ => (Cow::Borrowed(bytemuck::cast_slice(list)), U32),
    };
    buffer.array(bytes, Some(INDICES), Accessor::of(component, "SCALAR", count))
}

/// `JOINTS_0`, `WEIGHTS_0` and, of eight influences, the second sets.
fn add_influences(
    buffer: &mut Buffer<'_>,
    primitive: &Primitive,
    joints: usize,
    out: &mut Map<String, Value>,
) {
    let (count, influences) = (primitive.positions.len(), primitive.influences);
    let sets = influences.div_ceil(4);
    let mut all: Vec<(Vec<u16>, Vec<f32>)> = vec![Default::default(); sets];
    for vertex in 0..count {
        let range = vertex * influences..(vertex + 1) * influences;
        let mut row: Vec<(u16, f32)> = primitive.joint_indices[range.clone()]
            .iter()
            .copied()
            .zip(primitive.joint_weights[range].iter().copied())
            .collect();
        tidy(&mut row);
        row.resize(sets * 4, (0, 0.0));
        for ((joints, weights), part) in all.iter_mut().zip(row.chunks(4)) {
            joints.extend(part.iter().map(|(joint, _)| *joint));
            weights.extend(part.iter().map(|(_, weight)| *weight));
        }
    }
    for (set, (indices, weights)) in all.into_iter().enumerate() {
        let (bytes, component) = match joints {
            ..=256 => (owned(&indices.iter().map(|i| *i as u8).collect::<Vec<u8>>()), U8),
            _ => (owned(&indices), U16),
        };
        let accessor = Accessor::of(component, "VEC4", count);
        out.insert(format!("JOINTS_{set}"), buffer.array(bytes, Some(VERTICES), accessor).into());
        out.insert(format!("WEIGHTS_{set}"), vertices(buffer, owned(&weights), "VEC4", count));
    }
}

/// A joint counts once, one without weight is joint 0, and the weights sum to 1 (§3.7.3.3).
fn tidy(row: &mut [(u16, f32)]) {
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

/// Morph targets, as many as the mesh has; one that moves nothing has zeros, which need no bytes.
fn targets<'a>(buffer: &mut Buffer<'a>, primitive: &'a Primitive, number: usize) -> Vec<Map<String, Value>> {
    let count = primitive.positions.len();
    let target = |index: usize| {
        let mut out = Map::new();
        let morph = primitive.morphs.get(index);
        let list = |list: &'a [Vec3]| (list.len() == count).then_some(list);
        let bounded = |v: &[Vec3]| Accessor::of(F32, "VEC3", count).bounded(v.iter().map(Vec3::to_array));
        let position = match morph.and_then(|m| list(&m.positions)) {
            Some(offsets) => {
                let bytes = Cow::Borrowed(bytemuck::cast_slice(offsets));
                buffer.array(bytes, Some(VERTICES), bounded(offsets))
            }
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
                let bytes = Cow::Borrowed(bytemuck::cast_slice(offsets));
                out.insert((*name).into(), vertices(buffer, bytes, "VEC3", count));
            }
        }
        out
    };
    (0..number).map(target).collect()
}

/// The accessor of a skin's inverse bind matrices.
pub fn inverse_bind(buffer: &mut Buffer<'_>, skin: &Skin) -> Index {
    let matrix = |index: usize| {
        let mut m = skin.inverse_bind.get(index).copied().unwrap_or(Mat4::IDENTITY);
        // The fourth row is 0 0 0 1 (§3.7.3.1).
        (m.x_axis.w, m.y_axis.w, m.z_axis.w, m.w_axis.w) = (0.0, 0.0, 0.0, 1.0);
        m
    };
    let all: Vec<Mat4> = (0..skin.joints.len()).map(matrix).collect();
    buffer.array(owned(&all), None, Accessor::of(F32, "MAT4", all.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn influences_are_such_as_the_specification_asks_for() {
        let mut row = [(3, 0.25), (3, 0.25), (7, 0.0), (9, 0.5)];
        tidy(&mut row);
        assert_eq!(row, [(3, 0.5), (0, 0.0), (0, 0.0), (9, 0.5)]);
        let mut row = [(3, 1.0), (4, 3.0)];
        tidy(&mut row);
        assert_eq!(row, [(3, 0.25), (4, 0.75)]);
    }
}
