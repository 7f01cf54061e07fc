//! Checks of an asset after its import, whichever importer made it: sizes, indices, finite numbers, weights. The order of joints and the keys
//! of clips are checked where skeletons and clips are made.

use crate::ImportScope;
use choreo_asset::{Asset, Mesh, Primitive, Skin, Topology, Warning};
use std::sync::Arc;

/// A mistake of an importer: the part of the asset, and the problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AssetFault {
    pub place: String,
    pub what: String,
}

choreo_motion::error_texts! { AssetFault:
    Self { place, what } => "{place}: {what}";
}

/// Largest deviation of the sum of a vertex's weights from 1; beyond it, the weights are normalized.
const WEIGHT_SUM_TOLERANCE: f32 = 1e-3;

/// Checks an asset. Returns it with normalized weights, and with a warning for each mesh that is not drawn.
pub(crate) fn checked(mut asset: Asset, scope: ImportScope) -> Result<Asset, AssetFault> {
    check_references(&asset, scope)?;
    if !scope.geometry {
        return Ok(asset);
    }
    for (index, skin) in asset.skins.iter().enumerate() {
        check_skin(&asset, skin, &|| format!("skins[{index}]"))?;
    }
    let mut warnings = Vec::new();
    for index in 0..asset.meshes.len() {
        let placed: Vec<Option<usize>> = asset
            .instances
            .iter()
            .filter(|instance| instance.mesh as usize == index)
            .map(|instance| instance.skin.map(|skin| asset.skins[skin as usize].joints.len()))
            .collect();
        let fewest_joints = placed.iter().flatten().min().copied();
        let mesh = &asset.meshes[index];
        let place = format!("meshes[{index}] \"{}\"", mesh.name);
        let mut warn = |text: String| warnings.push(Warning { place: place.clone(), text });
        let mut unequal = 0;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = || format!("{place}, primitive {number}");
            check_primitive(mesh, primitive, asset.materials.len(), &place)?;
            unequal += check_weights(primitive, fewest_joints, &place)?;
        }
        if unequal > 0 {
            warn(format!("vertices whose weights do not sum to 1: {unequal}; their weights are normalized"));
            normalize_weights(Arc::make_mut(&mut asset.meshes[index]));
        }
        if asset.meshes[index].primitives.iter().all(|primitive| primitive.indices.is_empty()) {
            warn("has neither triangles nor lines nor points, so it is not drawn".into());
        } else if placed.is_empty() {
            warn("no node uses it, so it is not drawn".into());
        }
    }
    asset.warnings.extend(warnings);
    Ok(asset)
}

fn fault(place: String, what: impl Into<String>) -> AssetFault {
    AssetFault { place, what: what.into() }
}

/// Checks the indices that refer to other parts of the asset, and that numbers are finite.
fn check_references(asset: &Asset, scope: ImportScope) -> Result<(), AssetFault> {
    let joints = asset.skeleton.len();
    let rest = asset.skeleton.rest().iter().position(|rest| !rest.is_finite());
    if let Some(joint) = rest {
        let name = &asset.skeleton.names()[joint];
        return Err(fault(format!("joint \"{name}\""), "its rest transform is not finite"));
    }
    if scope.geometry {
        check_instances(asset)?;
        check_expressions(asset)?;
    }
    if asset.placements.iter().any(|placement| !placement.is_finite()) {
        return Err(fault("placements".into(), "has a number that is not finite"));
    }
    for (i, camera) in asset.cameras.iter().enumerate() {
        in_range(&|| format!("cameras[{i}]"), "joint", camera.joint, joints)?;
    }
    if !asset.ambient.is_finite() || asset.ambient.min_element() < 0.0 {
        return Err(fault("ambient".into(), "must be finite and not negative"));
    }
    for (i, light) in asset.lights.iter().enumerate() {
        in_range(&|| format!("lights[{i}]"), "joint", light.joint, joints)?;
        if !light.light.color.is_finite() || !light.light.intensity.is_finite() {
            return Err(fault(format!("lights[{i}]"), "color and intensity must be finite"));
        }
        light.light.kind.problem().map_or(Ok(()), |what| Err(fault(format!("lights[{i}]"), what)))?;
    }
    check_materials(asset, scope)?;
    let other = asset.clips.iter().find(|clip| clip.joint_count() != joints);
    other.map_or(Ok(()), |clip| {
        let of = clip.joint_count();
        Err(fault(
            format!("clip \"{}\"", clip.name),
            format!("is made for {of} joints, but the number of joints is {joints}"),
        ))
    })
}

fn in_range(place: &dyn Fn() -> String, what: &str, index: u32, count: usize) -> Result<(), AssetFault> {
    if (index as usize) < count {
        return Ok(());
    }
    Err(fault(place(), format!("{what} {index} does not exist (count: {count})")))
}

fn check_instances(asset: &Asset) -> Result<(), AssetFault> {
    for (i, instance) in asset.instances.iter().enumerate() {
        let place = || format!("instances[{i}]");
        in_range(&place, "joint", instance.joint, asset.skeleton.len())?;
        in_range(&place, "mesh", instance.mesh, asset.meshes.len())?;
        if let Some(skin) = instance.skin {
            in_range(&place, "skin", skin, asset.skins.len())?;
        }
        let targets = asset.meshes[instance.mesh as usize].morph_targets;
        if !matches!(instance.weights.len(), n if n == 0 || n == targets) {
            let given = instance.weights.len();
            return Err(fault(
                place(),
                format!("has {given} morph weights, but the mesh has {targets} targets"),
            ));
        }
        if instance.weights.iter().any(|weight| !weight.is_finite())
            || instance.copies.iter().any(|copy| !copy.is_finite())
        {
            return Err(fault(place(), "has a number that is not finite"));
        }
    }
    Ok(())
}

fn check_expressions(asset: &Asset) -> Result<(), AssetFault> {
    for expression in &asset.expressions {
        let place = || format!("expression \"{}\"", expression.name);
        for morph in &expression.morphs {
            in_range(&place, "instance", morph.instance, asset.instances.len())?;
            let mesh = asset.instances[morph.instance as usize].mesh as usize;
            in_range(&place, "morph target", morph.target, asset.meshes[mesh].morph_targets)?;
        }
        let materials = expression.colors.iter().map(|bind| bind.material);
        for material in materials.chain(expression.uvs.iter().map(|bind| bind.material)) {
            in_range(&place, "material", material, asset.materials.len())?;
        }
    }
    Ok(())
}

/// Checks the materials' textures and colors, and that images have as many bytes as their sizes need.
fn check_materials(asset: &Asset, scope: ImportScope) -> Result<(), AssetFault> {
    for (i, material) in asset.materials.iter().enumerate() {
        let textures =
            [&material.base_color_texture, &material.metallic_roughness_texture, &material.normal_texture];
        let others = [&material.occlusion_texture, &material.emissive_texture, &material.specular_texture];
        for texture in textures.into_iter().chain(others).flatten().filter(|_| scope.textures) {
            in_range(&|| format!("materials[{i}]"), "image", texture.image, asset.images.len())?;
        }
        if !material.base_color.is_finite() || !material.emissive.is_finite() {
            return Err(fault(format!("materials[{i}]"), "its colors must be finite"));
        }
    }
    for (i, image) in asset.images.iter().enumerate() {
        let bytes = image.width as usize * image.height as usize * 4;
        // An image whose pixels were not decoded has only a size.
        if !image.rgba.is_empty() && image.rgba.len() != bytes {
            let given = image.rgba.len();
            return Err(fault(format!("images[{i}]"), format!("has {given} bytes, its size needs {bytes}")));
        }
    }
    Ok(())
}

fn check_skin(asset: &Asset, skin: &Skin, place: &dyn Fn() -> String) -> Result<(), AssetFault> {
    let joints = asset.skeleton.len();
    if let Some(joint) = skin.joints.iter().find(|joint| **joint as usize >= joints) {
        return Err(fault(place(), format!("joint {joint} does not exist (count: {joints})")));
    }
    if skin.joints.len() != skin.inverse_bind.len() {
        return Err(fault(
            place(),
            format!(
                "needs a bind matrix for each joint; joints: {}, bind matrices: {}",
                skin.joints.len(),
                skin.inverse_bind.len()
            ),
        ));
    }
    let bad = skin.inverse_bind.iter().position(|matrix| !matrix.is_finite());
    bad.map_or(Ok(()), |at| Err(fault(place(), format!("bind matrix {at} is not finite"))))
}

fn check_primitive(
    mesh: &Mesh,
    primitive: &Primitive,
    materials: usize,
    place: &dyn Fn() -> String,
) -> Result<(), AssetFault> {
    let vertices = primitive.positions.len();
    let lengths = [
        ("normals", primitive.normals.len()),
        ("tangents", primitive.tangents.len()),
        ("uvs[0]", primitive.uvs[0].len()),
        ("uvs[1]", primitive.uvs[1].len()),
        ("colors", primitive.colors.len()),
    ];
    let morphs = primitive.morphs.iter().flat_map(|morph| {
        [
            ("positions of a morph target", morph.positions.len()),
            ("normals of a morph target", morph.normals.len()),
            ("tangents of a morph target", morph.tangents.len()),
        ]
    });
    if let Some((what, count)) =
        lengths.into_iter().chain(morphs).find(|(_, n)| !matches!(*n, n if n == 0 || n == vertices))
    {
        return Err(fault(place(), format!("has {count} {what} for {vertices} vertices")));
    }
    if !primitive.morphs.is_empty() && primitive.morphs.len() != mesh.morph_targets {
        let (has, targets) = (primitive.morphs.len(), mesh.morph_targets);
        return Err(fault(place(), format!("has {has} morph targets, but its mesh has {targets}")));
    }
    let each = match primitive.topology {
        Topology::Triangles => 3,
        Topology::Lines => 2,
        Topology::Points => 1,
    };
    if !primitive.indices.len().is_multiple_of(each) {
        return Err(fault(
            place(),
            format!("has {} indices, must be a multiple of {each}", primitive.indices.len()),
        ));
    }
    if let Some(index) = primitive.indices.iter().max().filter(|index| **index as usize >= vertices) {
        return Err(fault(place(), format!("has the index {index}, but {vertices} vertices")));
    }
    if let Some(material) = primitive.material.filter(|material| *material as usize >= materials) {
        return Err(fault(place(), format!("material {material} does not exist (count: {materials})")));
    }
    let not_finite = [
        ("position", primitive.positions.iter().position(|v| !v.is_finite())),
        ("normal", primitive.normals.iter().position(|v| !v.is_finite())),
        ("tangent", primitive.tangents.iter().position(|v| !v.is_finite())),
        ("uv", primitive.uvs[0].iter().position(|v| !v.is_finite())),
        ("second uv", primitive.uvs[1].iter().position(|v| !v.is_finite())),
        ("color", primitive.colors.iter().position(|v| !v.is_finite())),
    ];
    let of_morphs = primitive.morphs.iter().flat_map(|morph| {
        [&morph.positions, &morph.normals, &morph.tangents]
            .map(|vectors| ("morph target's offset", vectors.iter().position(|v| !v.is_finite())))
    });
    match not_finite.into_iter().chain(of_morphs).find_map(|(what, at)| Some((what, at?))) {
        Some((what, vertex)) => Err(fault(place(), format!("the {what} of vertex {vertex} is not finite"))),
        None => Ok(()),
    }
}

/// Checks the joint indices and skin weights of a primitive. Returns the number of vertices whose weights do not sum to 1.
fn check_weights(
    primitive: &Primitive,
    joints: Option<usize>,
    place: &dyn Fn() -> String,
) -> Result<usize, AssetFault> {
    let (each, vertices) = (primitive.influences, primitive.positions.len());
    if !matches!(each, 0 | 4 | 8) {
        return Err(fault(place(), format!("has {each} influences per vertex, must be 0, 4 or 8")));
    }
    let (indices, weights) = (&primitive.joint_indices, &primitive.joint_weights);
    if indices.len() != each * vertices || weights.len() != each * vertices {
        let (indices, weights) = (indices.len(), weights.len());
        return Err(fault(
            place(),
            format!(
                "has {indices} joint indices and {weights} weights for {vertices} vertices of {each} influences"
            ),
        ));
    }
    if each == 0 {
        return Ok(0);
    }
    let largest = indices.iter().max().copied().map_or(0, usize::from);
    if let Some(joints) = joints.filter(|joints| largest >= *joints && !indices.is_empty()) {
        return Err(fault(
            place(),
            format!("has the joint index {largest}, but its skin has {joints} joints"),
        ));
    }
    if let Some(at) = weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
        return Err(fault(
            place(),
            format!("a weight of vertex {} is {}, must be 0 or more", at / each, weights[at]),
        ));
    }
    let sums = weights.chunks_exact(each).map(|weights| weights.iter().sum::<f32>());
    Ok(sums.filter(|sum| (sum - 1.0).abs() > WEIGHT_SUM_TOLERANCE).count())
}

/// Scales the weights of each vertex to the sum 1. A vertex whose weights are all zero follows its first joint.
fn normalize_weights(mesh: &mut Mesh) {
    for primitive in mesh.primitives.iter_mut().filter(|primitive| primitive.influences > 0) {
        for weights in primitive.joint_weights.chunks_exact_mut(primitive.influences) {
            let sum: f32 = weights.iter().sum();
            if sum > 0.0 {
                weights.iter_mut().for_each(|weight| *weight /= sum);
            } else {
                weights[0] = 1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::{AssetLight, Light, LightKind, MeshInstance, MorphTarget};
    use choreo_motion::{Skeleton, Transform};
    use glam::{Affine3A, Mat4, Vec2, Vec3, Vec4};

    /// A valid asset: one skinned triangle.
    fn valid_asset() -> Asset {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let primitive = Primitive {
            indices: vec![0, 1, 2],
            normals: vec![Vec3::Z; 3],
            uvs: [vec![Vec2::ZERO; 3], Vec::new()],
            influences: 4,
            joint_indices: vec![0; 12],
            joint_weights: [1.0, 0.0, 0.0, 0.0].repeat(3),
            morphs: vec![MorphTarget { positions: vec![Vec3::X; 3], ..MorphTarget::default() }],
            positions,
            ..Primitive::default()
        };
        let mesh =
            Mesh { name: "flag".into(), primitives: vec![primitive], morph_targets: 1, ..Mesh::default() };
        let skeleton = Skeleton::new(vec!["root".into()], vec![None], vec![Transform::IDENTITY]);
        Asset {
            skeleton: Arc::new(skeleton.unwrap()),
            meshes: vec![Arc::new(mesh)],
            skins: vec![Skin { joints: vec![0], inverse_bind: vec![Mat4::IDENTITY] }],
            instances: vec![MeshInstance { skin: Some(0), weights: vec![0.0], ..MeshInstance::default() }],
            ..Asset::default()
        }
    }

    fn first_primitive(asset: &mut Asset) -> &mut Primitive {
        &mut Arc::make_mut(&mut asset.meshes[0]).primitives[0]
    }

    #[test]
    fn each_fault_is_reported_with_its_place() {
        assert_eq!(checked(valid_asset(), ImportScope::ALL).unwrap().warnings, []);
        type Change = fn(&mut Asset);
        let cases: [(Change, &str); 24] = [
            (|a| a.instances[0].joint = 1, "instances[0]: joint 1 does not exist (count: 1)"),
            (|a| a.instances[0].mesh = 7, "instances[0]: mesh 7 does not exist (count: 1)"),
            (|a| a.instances[0].skin = Some(1), "instances[0]: skin 1 does not exist (count: 1)"),
            (
                |a| a.instances[0].weights = vec![0.0; 3],
                "instances[0]: has 3 morph weights, but the mesh has 1 targets",
            ),
            (|a| a.instances[0].weights = vec![f32::NAN], "instances[0]: has a number that is not finite"),
            (|a| a.placements = vec![Affine3A::NAN].into(), "placements: has a number that is not finite"),
            (|a| a.skins[0].joints = vec![3], "skins[0]: joint 3 does not exist (count: 1)"),
            (
                |a| a.skins[0].inverse_bind.clear(),
                "skins[0]: needs a bind matrix for each joint; joints: 1, bind matrices: 0",
            ),
            (|a| a.skins[0].inverse_bind[0] = Mat4::NAN, "skins[0]: bind matrix 0 is not finite"),
            (|a| first_primitive(a).indices[1] = 3, "has the index 3, but 3 vertices"),
            (|a| first_primitive(a).indices.truncate(2), "has 2 indices, must be a multiple of 3"),
            (|a| first_primitive(a).normals.truncate(2), "has 2 normals for 3 vertices"),
            (|a| first_primitive(a).positions[2].y = f32::INFINITY, "the position of vertex 2 is not finite"),
            (|a| first_primitive(a).uvs[0][1].y = f32::NAN, "the uv of vertex 1 is not finite"),
            (
                |a| first_primitive(a).morphs[0].positions[1] = Vec3::NAN,
                "the morph target's offset of vertex 1 is not finite",
            ),
            (
                |a| first_primitive(a).morphs[0].positions.truncate(1),
                "has 1 positions of a morph target for 3 vertices",
            ),
            (
                |a| first_primitive(a).morphs.push(MorphTarget::default()),
                "has 2 morph targets, but its mesh has 1",
            ),
            (|a| first_primitive(a).influences = 3, "has 3 influences per vertex, must be 0, 4 or 8"),
            (
                |a| first_primitive(a).joint_weights.truncate(8),
                "has 12 joint indices and 8 weights for 3 vertices of 4 influences",
            ),
            (|a| first_primitive(a).joint_indices[4] = 1, "has the joint index 1, but its skin has 1 joints"),
            (|a| first_primitive(a).joint_weights[5] = -1.0, "a weight of vertex 1 is -1, must be 0 or more"),
            (|a| first_primitive(a).material = Some(0), "material 0 does not exist (count: 0)"),
            (
                |a| {
                    let light =
                        Light { kind: LightKind::Point, color: Vec3::NAN, intensity: 1.0, range: None };
                    a.lights.push(AssetLight { name: String::new(), joint: 0, light });
                },
                "lights[0]: color and intensity must be finite",
            ),
            (
                |a| a.clips.push(Arc::new(choreo_motion::Clip::new("wave".into(), 5, Vec::new()).unwrap())),
                "clip \"wave\": is made for 5 joints, but the number of joints is 1",
            ),
        ];
        for (change, expected) in cases {
            let mut asset = valid_asset();
            change(&mut asset);
            let found = checked(asset, ImportScope::ALL).unwrap_err().to_string();
            let of_part = format!("meshes[0] \"flag\", primitive 0: {expected}");
            assert!(found == expected || found == of_part, "{found}, not {expected}");
        }
    }

    #[test]
    fn weights_are_normalized_and_undrawn_meshes_are_reported() {
        let mut asset = valid_asset();
        first_primitive(&mut asset).joint_weights =
            [[2.0, 2.0, 0.0, 0.0], [0.0; 4], [0.5, 0.5, 0.0, 0.0]].concat();
        asset.meshes.push(Arc::new(Mesh { name: "ghost".into(), ..Mesh::default() }));
        let lost = Mesh { name: "lost".into(), ..(*valid_asset().meshes[0]).clone() };
        asset.meshes.push(Arc::new(lost));
        let mut asset = checked(asset, ImportScope::ALL).unwrap();
        let weights = [[0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat();
        assert_eq!(first_primitive(&mut asset).joint_weights, weights);
        let warnings: Vec<String> =
            asset.warnings.iter().map(|w| format!("{} {}", w.place, w.text)).collect();
        let expected = [
            "meshes[0] \"flag\" vertices whose weights do not sum to 1: 2; their weights are normalized",
            "meshes[1] \"ghost\" has neither triangles nor lines nor points, so it is not drawn",
            "meshes[2] \"lost\" no node uses it, so it is not drawn",
        ];
        assert_eq!(warnings, expected);
    }

    /// A million vertices with all attributes take some milliseconds; the bound allows for busy machines.
    #[test]
    fn a_large_mesh_is_checked_quickly() {
        let mut asset = valid_asset();
        let (vertices, part) = (1_000_000, first_primitive(&mut asset));
        part.positions = vec![Vec3::ONE; vertices];
        part.normals = vec![Vec3::Z; vertices];
        part.tangents = vec![Vec4::X; vertices];
        part.uvs = [vec![Vec2::ONE; vertices], Vec::new()];
        part.joint_indices = vec![0; 4 * vertices];
        part.joint_weights = [1.0, 0.0, 0.0, 0.0].repeat(vertices);
        part.morphs[0].positions = vec![Vec3::X; vertices];
        part.indices = (0..vertices as u32 - 1).collect();
        let started = std::time::Instant::now();
        let asset = checked(asset, ImportScope::ALL).unwrap();
        let seconds = started.elapsed().as_secs_f64();
        drop(asset);
        println!("1,000,000 vertices are checked in {:.1} ms", 1e3 * seconds);
        assert!(seconds < 2.0, "{seconds} s");
    }
}
