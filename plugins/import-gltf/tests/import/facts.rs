//! The content of each sample file, as its publisher counts it.

use crate::common;
use choreo_asset::{AlphaMode, Asset, LightKind, Projection, Shading, Topology};

/// Vertices, triangles, primitives, nodes, skin joints, images in use.
type Counts = [usize; 6];

/// Clip name, seconds.
type Duration = (&'static str, f64);

fn counts(asset: &Asset) -> Counts {
    let primitives = || asset.meshes.iter().flat_map(|m| &m.primitives);
    [
        primitives().map(|p| p.positions.len()).sum(),
        primitives().map(|p| p.indices.len() / 3).sum(),
        primitives().count(),
        asset.skeleton.len(),
        asset.skins.iter().map(|s| s.joints.len()).sum(),
        asset.images.len(),
    ]
}

/// The publisher's counts differ for some files: SpecularTest, UnlitTest and Godette share vertices between
/// primitives; Cameras has no normals, and flat ones need two more vertices; RobotExpressive has two
/// skins; one image of Godette is used by no supported texture; one node
/// of debug_robot is outside its scene.
const FILES: &[(&str, Counts, &[Duration])] = &[
    ("gltf/AlphaBlendModeTest.glb", [137, 61, 9, 9, 0, 4], &[]),
    ("gltf/AnimatedMorphCube.glb", [24, 12, 1, 1, 0, 0], &[("Square", 4.2)]),
    ("gltf/AnimatedTriangle.gltf", [3, 1, 1, 1, 0, 0], &[("animation 0", 1.0)]),
    ("gltf/BoxAnimated.glb", [320, 254, 2, 4, 0, 0], &[("animation 0", 3.708)]),
    ("gltf/BoxTextured.glb", [24, 12, 1, 2, 0, 1], &[]),
    ("gltf/BoxVertexColors.glb", [24, 12, 1, 1, 0, 0], &[]),
    ("gltf/Cameras.gltf", [6, 2, 1, 3, 0, 0], &[]),
    ("gltf/CesiumMan.glb", [3273, 4672, 1, 22, 19, 1], &[("animation 0", 2.0)]),
    ("gltf/EmissiveStrengthTest.glb", [188, 90, 6, 6, 0, 1], &[]),
    ("gltf/Fox.glb", [1728, 576, 1, 26, 24, 1], &[("Survey", 3.417), ("Walk", 0.708), ("Run", 1.158)]),
    (
        "gltf/InterpolationTest.glb",
        [220, 110, 10, 12, 0, 1],
        &[("Step Scale", 1.667), ("Linear Scale", 1.667), ("CubicSpline Scale", 1.667)],
    ),
    ("gltf/Knight.glb", [7024, 6952, 15, 57, 41, 1], &[("1H_Melee_Attack_Chop", 1.067)]),
    ("gltf/NormalTangentTest.glb", [3983, 7774, 1, 2, 0, 3], &[]),
    ("gltf/OrientationTest.glb", [1048, 524, 13, 13, 0, 0], &[]),
    ("gltf/RiggedSimple.glb", [160, 188, 1, 5, 2, 0], &[("animation 0", 2.083)]),
    ("gltf/RobotExpressive.glb", [7214, 3237, 19, 74, 86, 0], &[("Dance", 3.333), ("Death", 0.958)]),
    ("gltf/SimpleMorph.gltf", [3, 1, 1, 1, 0, 0], &[("animation 0", 4.0)]),
    ("gltf/SimpleSkin.gltf", [10, 8, 1, 3, 2, 0], &[("animation 0", 5.5)]),
    ("gltf/SimpleSparseAccessor.gltf", [14, 12, 1, 1, 0, 0], &[]),
    ("gltf/SpecularTest.glb", [23831, 44828, 24, 25, 0, 4], &[]),
    ("gltf/Suzanne/Suzanne.gltf", [11808, 3936, 1, 1, 0, 2], &[]),
    ("gltf/TextureCoordinateTest.glb", [20, 10, 5, 5, 0, 1], &[]),
    ("gltf/TextureSettingsTest.glb", [144, 72, 10, 11, 0, 3], &[]),
    ("gltf/TextureTransformMultiTest.glb", [2302, 3956, 29, 29, 0, 4], &[]),
    ("gltf/UnlitTest.glb", [192, 88, 2, 2, 0, 0], &[]),
    ("gltf/VertexColorTest.glb", [72, 36, 2, 2, 0, 2], &[]),
    ("gltf/geometry-camera-light.glb", [28, 14, 2, 6, 0, 0], &[]),
    ("gltf/lightCameraAnimations.gltf", [24, 12, 1, 5, 0, 0], &[("Animation", 3.75)]),
    ("gltf/spotLightTest.gltf", [24, 12, 1, 3, 0, 0], &[]),
    ("same-model-3-formats/barrel_large_decorated.gltf.glb", [1570, 1047, 1, 1, 0, 1], &[]),
    ("same-model-3-formats/chest_gold.glb", [2322, 1568, 2, 2, 0, 1], &[]),
    ("vrm/Godette_vrm_v4.vrm", [8067, 3439, 4, 71, 68, 4], &[]),
    ("vrm/cool_loops.vrm", [1898, 2764, 1, 67, 65, 1], &[]),
    ("vrm/debug_robot.vrm", [72, 36, 3, 76, 0, 3], &[]),
    ("vrm/smoke_spring.vrm", [1285, 2400, 2, 25, 4, 0], &[]),
    // Its bones, as it has no mesh.
    ("vrm/test.vrma", [1200, 400, 1, 53, 53, 0], &[("animation 0", 3.0)]),
];

#[test]
fn element_counts_and_clip_durations_equal_the_published_ones() {
    let Some(folder) = common::assets(FILES.len()) else { return };
    for (name, expected, clips) in FILES {
        let asset = common::import_path(&folder.join(name)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(counts(&asset), *expected, "{name}");
        assert!(asset.clips.len() >= clips.len(), "{name}");
        for (clip, (clip_name, secs)) in asset.clips.iter().zip(*clips) {
            assert_eq!(clip.name, *clip_name, "{name}");
            assert!((clip.duration.as_secs() - secs).abs() < 6e-4, "{name} {clip_name}");
        }
        check_consistency(name, &asset);
    }
}

#[test]
fn number_of_clips() {
    let Some(folder) = common::assets(3) else { return };
    for (name, clips) in [("Knight.glb", 76), ("RobotExpressive.glb", 14), ("InterpolationTest.glb", 9)] {
        assert_eq!(common::import_path(&folder.join("gltf").join(name)).unwrap().clips.len(), clips);
    }
}

/// Checks the promises of `Asset`'s comments about every file.
fn check_consistency(name: &str, asset: &Asset) {
    for mesh in &asset.meshes {
        for p in &mesh.primitives {
            let n = p.positions.len();
            assert!(p.indices.iter().all(|i| (*i as usize) < n), "{name}");
            let lens = [p.normals.len(), p.tangents.len(), p.uvs[0].len(), p.uvs[1].len(), p.colors.len()];
            assert!(lens.iter().all(|l| *l == 0 || *l == n), "{name} {lens:?}");
            assert!(p.topology != Topology::Triangles || p.normals.len() == n, "{name}");
            assert!(p.normals.iter().all(|v| (v.length() - 1.0).abs() < 1e-5), "{name}");
            assert!(
                p.tangents.iter().all(|t| (t.truncate().length() - 1.0).abs() < 1e-5 && t.w.abs() == 1.0),
                "{name}"
            );
            let normal_map = p.material.is_some_and(|m| {
                let material = &asset.materials[m as usize];
                let of_coat = material.layers.as_ref().is_some_and(|l| l.clearcoat_normal_texture.is_some());
                material.normal_texture.is_some() || of_coat
            });
            assert_eq!(!p.tangents.is_empty(), normal_map, "{name}");
            assert_eq!(p.joint_indices.len(), n * p.influences, "{name}");
            assert_eq!(p.joint_weights.len(), n * p.influences, "{name}");
            for w in p.joint_weights.chunks_exact(p.influences.max(1)) {
                assert!((w.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{name}");
            }
            assert_eq!(p.morphs.len(), mesh.morph_targets, "{name}");
        }
        assert_eq!(mesh.morph_names.len(), mesh.morph_targets, "{name}");
    }
    for i in &asset.instances {
        assert_eq!(i.weights.len(), asset.meshes[i.mesh as usize].morph_targets, "{name}");
    }
    for image in &asset.images {
        assert_eq!(image.rgba.len(), image.width as usize * image.height as usize * 4, "{name}");
    }
}

#[test]
fn sample_cameras_and_lights_have_known_values() {
    let Some(folder) = common::assets(4) else { return };
    let import = |n: &str| common::import_path(&folder.join("gltf").join(n)).unwrap();
    let cameras = import("Cameras.gltf").cameras;
    assert_eq!(cameras.len(), 2);
    assert_eq!(cameras[0].projection, Projection::Perspective { yfov: 0.7, near: 0.01, far: Some(100.0) });
    assert_eq!(cameras[1].projection, Projection::Orthographic { height: 2.0, near: 0.01, far: 100.0 });

    let spot = import("spotLightTest.gltf");
    assert!(spot.lights.iter().any(|l| matches!(l.light.kind, LightKind::Spot { inner, outer }
        if inner < outer && outer <= std::f32::consts::FRAC_PI_2)));
    assert_eq!(import("geometry-camera-light.glb").lights.len(), 2);
    assert!(!import("lightCameraAnimations.gltf").lights.is_empty());
}

#[test]
fn sample_materials_have_known_values() {
    let Some(folder) = common::assets(5) else { return };
    let import = |n: &str| common::import_path(&folder.join("gltf").join(n)).unwrap();
    assert!(import("UnlitTest.glb").materials.iter().all(|m| m.shading == Shading::Unlit));

    let modes: Vec<AlphaMode> =
        import("AlphaBlendModeTest.glb").materials.iter().map(|m| m.alpha_mode).collect();
    assert!(modes.contains(&AlphaMode::Blend));
    assert!(modes.contains(&AlphaMode::Mask(0.5)) && modes.contains(&AlphaMode::Mask(0.25)));

    // Cubes with factor 0.9 and strengths up to 16.
    let brightest = import("EmissiveStrengthTest.glb")
        .materials
        .iter()
        .map(|m| m.emissive.max_element())
        .fold(0.0, f32::max);
    assert_eq!(brightest, 0.9 * 16.0);

    let transforms = import("TextureTransformMultiTest.glb").materials;
    let moved = transforms.iter().filter_map(|m| m.base_color_texture.as_ref());
    assert!(moved.clone().any(|t| t.uv_transform != glam::Affine2::IDENTITY));
    assert!(moved.clone().any(|t| t.uv_set == 1));
}

/// TextureTransformMultiTest shows beside each transformed quad one whose uvs have the transform in them
/// (a little off, by 0.006). The rotation's direction is a known trap: the specification's own listing had it wrong.
#[test]
fn texture_transforms_rotate_in_the_right_direction() {
    let Some(folder) = common::assets(1) else { return };
    let asset = common::import_path(&folder.join("gltf/TextureTransformMultiTest.glb")).unwrap();
    for (moved, sample) in [(0, 2), (1, 2), (5, 7), (6, 7), (17, 19), (18, 19)] {
        let (a, b) = (&asset.meshes[moved].primitives[0], &asset.meshes[sample].primitives[0]);
        let material = &asset.materials[a.material.unwrap() as usize];
        let texture = material.emissive_texture.as_ref().or(material.base_color_texture.as_ref()).unwrap();
        assert_eq!(a.positions, b.positions);
        let mut worst = (0.0f32, 0.0f32);
        for (uv, truth) in a.uvs[usize::from(texture.uv_set)].iter().zip(&b.uvs[0]) {
            let there = (texture.uv_transform.transform_point2(*uv) - *truth).abs().max_element();
            let back = texture.uv_transform.inverse().transform_point2(*uv);
            worst = (worst.0.max(there), worst.1.max((back - *truth).abs().max_element()));
        }
        assert!(worst.0 < 0.01, "mesh {moved}: {worst:?}");
        assert!(worst.1 > 0.1, "the opposite way must be seen");
    }
}
