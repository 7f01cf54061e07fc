//! Meshes, curves and points of a model, one prim for each primitive of the asset.

use crate::layer::{
    BOOL, COLOR3F, FLOAT, FLOAT3, INT, MATRIX4D, NORMAL3F, POINT3F, Prim, TEXCOORD2F, VECTOR3F, Value,
};
use choreo_plugin::asset::{Mesh, MorphTarget, Primitive, Topology};
use choreo_plugin::glam::{DMat4, Vec3};

/// How a mesh follows a skeleton.
pub(crate) enum Binding<'a> {
    /// Skinned: each vertex follows its weighted joints. `joints`: the skeleton's joint for each joint of the skin.
    Skin { joints: &'a [u32], geometry: DMat4 },
    /// Rigid: the whole mesh follows one joint.
    Rigid { joint: u32, geometry: DMat4 },
}

/// A matrix in USD's convention: stored row by row, with row vectors multiplied from the left.
pub(crate) fn matrix<'a>(m: &DMat4) -> Value<'a> {
    Value::one(m.to_cols_array().to_vec())
}

pub(crate) fn matrices<'a>(list: Vec<DMat4>) -> Value<'a> {
    let numbers: Vec<f64> = list.iter().flat_map(DMat4::to_cols_array).collect();
    Value::array(list.len(), move |i| numbers[i])
}

fn vectors<'a>(list: &'a [Vec3]) -> Value<'a> {
    Value::array(list.len(), move |i| f64::from(list[i / 3][i % 3]))
}

/// The prim of a primitive; `None` where the primitive draws nothing.
pub(crate) fn prim<'a>(name: &str, primitive: &'a Primitive, double_sided: bool) -> Option<Prim<'a>> {
    if primitive.indices.is_empty() || primitive.positions.is_empty() {
        return None;
    }
    let mut out = match primitive.topology {
        Topology::Triangles => triangles(name, primitive),
        Topology::Lines => lines(name, primitive),
        Topology::Points => points(name, primitive),
    };
    let extent = extent(&primitive.positions);
    out.set(FLOAT3, "extent", Value::array(2, move |i| f64::from(extent[i / 3][i % 3])));
    if double_sided {
        out.set(BOOL, "doubleSided", Value::one([1.0])).uniform = true;
    }
    Some(out)
}

/// Minimum and maximum of positions, as an `extent`.
pub(crate) fn extent(positions: &[Vec3]) -> [Vec3; 2] {
    let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    [low, high]
}

fn triangles<'a>(name: &str, p: &'a Primitive) -> Prim<'a> {
    let mut out = Prim::new("Mesh", name);
    let (count, indices) = (p.positions.len(), &p.indices);
    out.set(INT, "faceVertexCounts", Value::array(indices.len() / 3, |_| 3.0));
    out.set(INT, "faceVertexIndices", Value::array(indices.len() / 3 * 3, move |i| f64::from(indices[i])));
    out.set(POINT3F, "points", vectors(&p.positions));
    out.set_uniform_token("subdivisionScheme", "none");
    if p.normals.len() == count {
        out.set(NORMAL3F, "normals", vectors(&p.normals)).set_interpolation("vertex");
    }
    for (uvs, name) in p.uvs.iter().zip(["primvars:st", "primvars:st1"]).filter(|(uvs, _)| uvs.len() == count)
    {
        // USD has the origin of images at the bottom, so v is flipped.
        let number = move |i: usize| {
            let uv = uvs[i / 2];
            f64::from(if i.is_multiple_of(2) { uv.x } else { 1.0 - uv.y })
        };
        out.set(TEXCOORD2F, name, Value::array(count, number)).set_interpolation("vertex");
    }
    colors(&mut out, p);
    out
}

fn colors<'a>(out: &mut Prim<'a>, p: &'a Primitive) {
    let colors = &p.colors;
    if colors.len() != p.positions.len() {
        return;
    }
    let color = move |i: usize| f64::from(colors[i / 3][i % 3].clamp(0.0, 1.0));
    out.set(COLOR3F, "primvars:displayColor", Value::array(colors.len(), color)).set_interpolation("vertex");
    if colors.iter().any(|color| color.w != 1.0) {
        let opacity = move |i: usize| f64::from(colors[i].w.clamp(0.0, 1.0));
        out.set(FLOAT, "primvars:displayOpacity", Value::array(colors.len(), opacity))
            .set_interpolation("vertex");
    }
}

/// Each line is a curve of two points.
fn lines<'a>(name: &str, p: &'a Primitive) -> Prim<'a> {
    let mut out = Prim::new("BasisCurves", name);
    let count = p.indices.len() / 2;
    let at = move |i: usize| f64::from(p.positions[p.indices[i / 3] as usize][i % 3]);
    out.set(INT, "curveVertexCounts", Value::array(count, |_| 2.0));
    out.set(POINT3F, "points", Value::array(2 * count, at));
    out.set_uniform_token("type", "linear");
    out.set(FLOAT, "widths", Value::array(1, |_| 0.005)).set_interpolation("constant");
    out
}

fn points<'a>(name: &str, p: &'a Primitive) -> Prim<'a> {
    let mut out = Prim::new("Points", name);
    let at = move |i: usize| f64::from(p.positions[p.indices[i / 3] as usize][i % 3]);
    out.set(POINT3F, "points", Value::array(p.indices.len(), at));
    out.set(FLOAT, "widths", Value::array(1, |_| 0.01)).set_interpolation("constant");
    out
}

/// Binds a mesh to the skeleton of its model.
pub(crate) fn bind_to_skeleton<'a>(
    out: &mut Prim<'a>,
    p: &'a Primitive,
    binding: Binding<'_>,
    skeleton: &str,
) {
    out.api.push("SkelBindingAPI");
    out.add_relationship("skel:skeleton", vec![skeleton.into()]);
    let geometry = match &binding {
        Binding::Skin { geometry, .. } | Binding::Rigid { geometry, .. } => *geometry,
    };
    out.set(MATRIX4D, "primvars:skel:geomBindTransform", matrix(&geometry));
    match binding {
        Binding::Rigid { joint, .. } => {
            let indices =
                out.set(INT, "primvars:skel:jointIndices", Value::array(1, move |_| f64::from(joint)));
            indices.set_interpolation("constant").element_size = Some(1);
            let weights = out.set(FLOAT, "primvars:skel:jointWeights", Value::array(1, |_| 1.0));
            weights.set_interpolation("constant").element_size = Some(1);
        }
        Binding::Skin { joints, .. } => {
            let (count, size, joints) = (p.joint_weights.len(), p.influences, joints.to_vec());
            // Influences without weight name the first joint of the skin, whatever joint the asset has there.
            let joint = move |i: usize| {
                let is_used = p.joint_weights[i] != 0.0;
                let joint = if is_used { p.joint_indices[i] } else { 0 };
                f64::from(joints.get(usize::from(joint)).copied().unwrap_or(0))
            };
            let indices = out.set(INT, "primvars:skel:jointIndices", Value::array(count, joint));
            indices.set_interpolation("vertex").element_size = Some(size);
            let weight = move |i: usize| f64::from(p.joint_weights[i]);
            let weights = out.set(FLOAT, "primvars:skel:jointWeights", Value::array(count, weight));
            weights.set_interpolation("vertex").element_size = Some(size);
        }
    }
}

/// A morph target as a blend shape: the indices of the vertices that it moves, and their offsets.
pub(crate) fn blend_shape<'a>(name: &str, p: &'a Primitive, target: Option<&'a MorphTarget>) -> Prim<'a> {
    let mut out = Prim::new("BlendShape", name);
    let count = p.positions.len();
    let list = |list: &'a Vec<Vec3>| (list.len() == count).then_some(list.as_slice());
    let offsets = target.and_then(|t| list(&t.positions));
    let normals = target.and_then(|t| list(&t.normals)).filter(|_| p.normals.len() == count);
    let moves =
        |vertex: &usize| [offsets, normals].into_iter().flatten().any(|list| list[*vertex] != Vec3::ZERO);
    let moved: std::rc::Rc<[usize]> = (0..count).filter(moves).collect();
    let some = |list: &'a [Vec3]| {
        let moved = moved.clone();
        Value::array(moved.len(), move |i| f64::from(list[moved[i / 3]][i % 3]))
    };
    let none = Value::array(moved.len(), |_| 0.0);
    out.set(VECTOR3F, "offsets", offsets.map_or(none, some)).uniform = true;
    if let Some(normals) = normals {
        out.set(VECTOR3F, "normalOffsets", some(normals)).uniform = true;
    }
    let indices = moved.clone();
    out.set(INT, "pointIndices", Value::array(moved.len(), move |i| indices[i] as f64)).uniform = true;
    out
}

/// Names of a mesh's morph targets.
pub(crate) fn target_names(mesh: &Mesh) -> Vec<String> {
    let name = |index: usize| match mesh.morph_names.get(index) {
        Some(name) if !name.is_empty() => name.clone(),
        _ => format!("{} {index}", mesh.name),
    };
    (0..mesh.morph_targets).map(name).collect()
}
