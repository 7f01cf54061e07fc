use super::arrays::normals;
use super::*;
use glam::Vec3;

fn triangle() -> MeshData {
    MeshData { positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..MeshData::default() }
}

fn refused(data: MeshData) -> String {
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
fn what_does_not_fit_is_named_with_its_place() {
    let t = triangle;
    let cases = [
        (MeshData { positions: vec![0.0; 4], ..t() }, "positions must have 3 numbers for each vertex, has 4"),
        (MeshData { positions: vec![], ..t() }, "positions must have 3 numbers for each vertex, has 0"),
        (MeshData { positions: vec![f32::NAN; 9], ..t() }, "positions[0] is NaN, must be finite"),
        (MeshData { indices: vec![0, 1], ..t() }, "indices must be three for each triangle, got 2"),
        (MeshData { indices: vec![0, 1, 3], ..t() }, "indices[2] is 3, but there are 3 vertices"),
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
        (MeshData { joint: Some(4), ..t() }, "joint 4 does not exist, there are 1"),
        (MeshData { material: Some(0), ..t() }, "material 0 does not exist, there are 0"),
        (
            MeshData { weights: vec![1.0; 3], ..t() },
            "joints and weights must have 1 to 8 numbers for each of the 3 vertices, have 0 and 3",
        ),
        (
            MeshData { weights: vec![1.0; 3], joints: vec![0, 0, 7], ..t() },
            "joints[2] is 7, but there are 2 joints",
        ),
        (
            MeshData { weights: vec![1.0, -1.0, 1.0], joints: vec![0; 3], ..t() },
            "weights[1] is -1, must not be negative",
        ),
    ];
    for (data, expected) in cases {
        assert_eq!(refused(data), format!("mesh \"m\": {expected}"));
    }
}

#[test]
fn a_skinned_mesh_lies_at_rest_as_it_was_given() {
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
    assert_eq!(asset.warnings[0].text, "1 vertices without a weight follow their first joint");
    // joint-from-mesh undoes the joint's rest.
    assert_eq!(asset.skins[0].inverse_bind[1].transform_point3(Vec3::Y), Vec3::ZERO);
}

#[test]
fn images_of_grey_rgb_and_rgba() {
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
