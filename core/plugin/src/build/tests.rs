//! Tests of [`super::AssetBuilder`]: assets from valid parts, and errors of invalid ones.

use super::arrays::normals;
use super::*;
use choreo_asset::{LightKind, Sampler, TextureRef};
use glam::{Affine2, Vec3};

fn triangle() -> MeshData {
    MeshData { positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..MeshData::default() }
}

fn mesh_error(data: MeshData) -> String {
    let mut b = AssetBuilder::default();
    b.joint("root", None, Transform::IDENTITY).unwrap();
    b.mesh(MeshData { name: "m".into(), ..data }).unwrap_err().to_string()
}

#[test]
fn a_triangle_gets_indices_a_normal_and_a_joint() {
    let mut b = AssetBuilder::default();
    b.mesh(triangle()).unwrap();
    let asset = b.finish("t").unwrap();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!((p.indices.as_slice(), p.normals.as_slice()), ([0, 1, 2].as_slice(), [Vec3::Z; 3].as_slice()));
    assert_eq!(asset.skeleton.names(), ["mesh 0"]);
}

#[test]
fn normals_of_a_shared_edge_are_the_mean_by_area() {
    // Two triangles at a right angle, the second with twice the area.
    let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z * 2.0];
    let n = normals(&p, &[0, 1, 2, 0, 2, 3]);
    assert_eq!(n[1], Vec3::Z);
    assert_eq!(n[3], Vec3::X);
    assert!(n[0].abs_diff_eq(Vec3::new(2.0, 0.0, 1.0).normalize(), 1e-6));
}

#[test]
fn invalid_arrays_are_reported_with_their_name_and_element() {
    let t = triangle;
    let cases = [
        (MeshData { positions: vec![0.0; 4], ..t() }, "positions must have 3 numbers for each vertex, has 4"),
        (MeshData { positions: vec![], ..t() }, "positions must have 3 numbers for each vertex, has 0"),
        (MeshData { positions: vec![f32::NAN; 9], ..t() }, "positions[0] is NaN, must be finite"),
        (MeshData { indices: vec![0, 1], ..t() }, "indices must be three for each triangle, got 2"),
        (MeshData { indices: vec![0, 1, 3], ..t() }, "indices[2] is 3, but the number of vertices is 3"),
        (MeshData { positions: vec![0.0; 12], ..t() }, "vertices must be three for each triangle, got 4"),
        (
            MeshData { normals: vec![0.0; 6], ..t() },
            "normals must have 3 numbers for each of the 3 vertices, has 6",
        ),
        (MeshData { uvs: vec![0.0; 3], ..t() }, "uvs must have 2 numbers for each of the 3 vertices, has 3"),
        (
            MeshData { colors: vec![0.0; 5], ..t() },
            "colors must have 4 numbers for each of the 3 vertices, has 5",
        ),
        (MeshData { joint: Some(4), ..t() }, "joint 4 does not exist (count: 1)"),
        (MeshData { material: Some(0), ..t() }, "material 0 does not exist (count: 0)"),
        (
            MeshData { weights: vec![1.0; 3], ..t() },
            "joints and weights must have 1 to 8 numbers for each of the 3 vertices, have 0 and 3",
        ),
        (
            MeshData { weights: vec![1.0; 3], joints: vec![0, 0, 7], ..t() },
            "joints[2] is 7, but the number of joints is 2",
        ),
        (
            MeshData { weights: vec![1.0, -1.0, 1.0], joints: vec![0; 3], ..t() },
            "weights[1] is -1, must not be negative",
        ),
    ];
    for (data, expected) in cases {
        assert_eq!(mesh_error(data), format!("mesh \"m\": {expected}"));
    }
}

#[test]
fn a_skinned_mesh_keeps_its_positions_at_rest() {
    let mut b = AssetBuilder::default();
    let hip = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
    let root = b.joint("root", None, Transform::IDENTITY).unwrap();
    let hip = b.joint("hip", Some(root), hip).unwrap();
    let weights = vec![2.0, 2.0, 0.0, 0.0, 1.0, 0.0];
    let joints = vec![root, hip, hip, root, hip, root];
    b.mesh(MeshData { joints, weights, joint: Some(root), ..triangle() }).unwrap();
    let asset = b.finish("t").unwrap();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.influences, 4);
    assert_eq!(p.joint_weights, [0.5, 0.5, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
    assert_eq!(&p.joint_indices[..8], [0, 1, 0, 0, 1, 0, 1, 1]);
    assert_eq!(asset.warnings[0].text, "vertices without a weight: 1; they follow their first joint");
    // The inverse bind matrix is the inverse of the joint's rest transform.
    assert_eq!(asset.skins[0].inverse_bind[1].transform_point3(Vec3::Y), Vec3::ZERO);
}

#[test]
fn images_may_be_gray_rgb_or_rgba() {
    let mut b = AssetBuilder::default();
    b.image("a", 1, 2, &[7, 9]).unwrap();
    b.image("b", 1, 1, &[1, 2, 3]).unwrap();
    assert_eq!(
        b.image("c", 2, 2, &[0; 7]).unwrap_err().to_string(),
        "image \"c\": 2×2 pixels need 1, 3 or 4 bytes each, got 7 bytes"
    );
    assert!(b.image("d", 0, 2, &[]).is_err() && b.image("e", u32::MAX, u32::MAX, &[1]).is_err());
    let asset = b.finish("t").unwrap();
    assert_eq!(asset.images[0].rgba, [7, 7, 7, 255, 9, 9, 9, 255]);
    assert_eq!(asset.images[1].rgba, [1, 2, 3, 255]);
}

#[test]
fn lines_and_points_have_two_and_one_index_and_no_normals() {
    let mut b = AssetBuilder::default();
    b.mesh(MeshData { topology: Topology::Lines, indices: vec![0, 1, 1, 2], ..triangle() }).unwrap();
    b.mesh(MeshData { topology: Topology::Points, ..triangle() }).unwrap();
    let odd = MeshData { topology: Topology::Lines, ..triangle() };
    let error = b.mesh(MeshData { name: "m".into(), ..odd }).unwrap_err();
    assert_eq!(error.to_string(), "mesh \"m\": vertices must be two for each line, got 3");
    let asset = b.finish("t").unwrap();
    let [lines, points] = [0, 1].map(|i| &asset.meshes[i].primitives[0]);
    assert_eq!((lines.topology, lines.indices.as_slice()), (Topology::Lines, [0, 1, 1, 2].as_slice()));
    assert_eq!((points.topology, points.indices.as_slice()), (Topology::Points, [0, 1, 2].as_slice()));
    assert!(lines.normals.is_empty() && points.normals.is_empty());
}

/// A square of two triangles, with morph targets, and the tangents of a normal map.
fn square() -> MeshData {
    MeshData {
        positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0],
        uvs: vec![0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0],
        ..MeshData::default()
    }
}

#[test]
fn parts_have_a_material_and_the_vertices_that_they_use() {
    let mut b = AssetBuilder::default();
    for name in ["red", "blue"] {
        b.material(Material { name: name.into(), ..Material::default() }).unwrap();
    }
    let part = |indices: [u32; 3], material| MeshPart { indices: indices.into(), material: Some(material) };
    let morph =
        MorphData { name: "up".into(), positions: (0..12).map(|v| v as f32).collect(), normals: vec![] };
    let parts = vec![part([0, 1, 2], 1), part([2, 1, 3], 0)];
    b.mesh(MeshData { parts: parts.clone(), morphs: vec![morph], ..square() }).unwrap();
    let refused = |data: MeshData, b: &mut AssetBuilder| {
        b.mesh(MeshData { name: "m".into(), ..data }).unwrap_err().to_string()
    };
    let both = MeshData { parts: parts.clone(), material: Some(0), ..square() };
    assert!(refused(both, &mut b).contains("leave indices and material out"));
    let missing = MeshData { parts: vec![part([0, 1, 2], 7)], ..square() };
    assert_eq!(refused(missing, &mut b), "mesh \"m\": material 7 does not exist (count: 2)");
    let none = MeshData { parts: vec![parts[0].clone(), MeshPart::default()], ..square() };
    assert_eq!(refused(none, &mut b), "mesh \"m\": parts[1] has no indices");
    let short = MorphData { name: "short".into(), positions: vec![0.0; 3], normals: vec![] };
    assert_eq!(
        refused(MeshData { morphs: vec![short], indices: vec![0, 1, 2], ..square() }, &mut b),
        "mesh \"m\": morphs[0].positions must have 3 numbers for each of the 4 vertices, has 3"
    );
    let asset = b.finish("t").unwrap();
    let mesh = &asset.meshes[0];
    assert_eq!((mesh.morph_targets, mesh.morph_names.as_slice()), (1, ["up".to_string()].as_slice()));
    assert_eq!(asset.instances[0].weights, [0.0]);
    let [first, second] = &mesh.primitives[..] else { panic!("{mesh:?}") };
    assert_eq!((first.material, first.indices.as_slice()), (Some(1), [0, 1, 2].as_slice()));
    assert_eq!((second.material, second.indices.as_slice()), (Some(0), [0, 1, 2].as_slice()));
    assert_eq!(second.positions, [Vec3::Y, Vec3::X, Vec3::new(1.0, 1.0, 0.0)]);
    assert_eq!(second.morphs[0].positions[0], Vec3::new(6.0, 7.0, 8.0));
    assert_eq!(second.uvs[0][2], glam::Vec2::new(1.0, 0.0));
}

#[test]
fn a_normal_map_gives_tangents_or_a_warning() {
    let mut b = AssetBuilder::default();
    let image = b.image("bumps", 1, 1, &[128, 128, 255]).unwrap();
    let map = TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_transform: Affine2::IDENTITY };
    let bumpy = Material { name: "bumpy".into(), normal_texture: Some(map.clone()), ..Material::default() };
    let bumpy = b.material(bumpy).unwrap();
    let missing = Material { normal_texture: Some(TextureRef { image: 9, ..map }), ..Material::default() };
    assert!(b.material(missing).unwrap_err().0.contains("image 9 does not exist"));
    let indices = vec![0, 1, 2, 2, 1, 3];
    b.mesh(MeshData { indices: indices.clone(), material: Some(bumpy), ..square() }).unwrap();
    b.mesh(MeshData { indices, material: Some(bumpy), uvs: vec![], ..square() }).unwrap();
    let asset = b.finish("t").unwrap();
    // u grows along +x, v down: the tangent is +x, the bitangent +y (glTF 2.0 §3.7.2.1).
    assert_eq!(asset.meshes[0].primitives[0].tangents, [glam::Vec4::new(1.0, 0.0, 0.0, 1.0); 4]);
    assert!(asset.meshes[1].primitives[0].tangents.is_empty());
    assert_eq!(asset.warnings.len(), 1);
    assert_eq!(asset.warnings[0].place, "material \"bumpy\"");
}

#[test]
fn cameras_and_lights_are_attached_to_joints() {
    let mut b = AssetBuilder::default();
    let joint = b.joint("head", None, Transform::IDENTITY).unwrap();
    let lamp = |kind| Light { kind, color: Vec3::ONE, intensity: 10.0, range: None };
    b.camera("eye", Some(joint), Projection::default()).unwrap();
    b.light("lamp", None, lamp(LightKind::Point)).unwrap();
    let refused = |result: Result<u32>| result.unwrap_err().0;
    assert_eq!(
        refused(b.camera("far", Some(7), Projection::default())),
        "camera \"far\": joint 7 does not exist (count: 2)"
    );
    let cone = LightKind::Spot { inner: 1.0, outer: 0.5 };
    assert_eq!(
        refused(b.light("bad", None, lamp(cone))),
        "light \"bad\": cone is 1 to 0.5 rad, must be 0 ≤ inner < outer ≤ π/2"
    );
    let dark = Light { intensity: f32::NAN, ..lamp(LightKind::Point) };
    assert!(refused(b.light("bad", None, dark)).contains("must be finite"));
    let asset = b.finish("t").unwrap();
    assert_eq!((asset.cameras[0].joint, asset.lights[0].joint), (0, 1));
    assert_eq!(asset.skeleton.names(), ["head", "lamp"]);
}
