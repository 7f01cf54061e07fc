//! Imports of USD files, good and damaged.

use choreo_asset::{AlphaMode, Asset, LightKind, Projection};
use choreo_importer_kit_testing::{
    Companions, asset_rules, damage, error_text, import, import_bytes, source, warnings,
};
use choreo_motion::{Curve, Interpolation, Path, Skeleton, Time, Transform};
use choreo_plugin::{AssetBuilder, Claim, ExportedScene, ImportScope, Importer, MemoryFiles, SceneExporter};
use choreo_stage::{Cue, Stage};
use glam::{DVec3, Quat, Vec3};
use import_usd::UsdImporter;
use std::sync::Arc;

/// In centimetres with +Z up: a cube of two variants, referred to from a layer beside it, with opinions over it.
const SCENE: &str = r#"#usda 1.0
( "by hand"
  defaultPrim = "world"
  metersPerUnit = 0.01
  upAxis = "Z"
  startTimeCode = 1
  timeCodesPerSecond = 25
  subLayers = [ @./weak.usda@ ] )
def Xform "world" (
    variants = { string size = "large" }
    prepend variantSets = "size"
)
{
    variantSet "size" = {
        "large" { def Xform "flag" { double3 xformOp:translate = (0, 0, 500)
            uniform token[] xformOpOrder = ["xformOp:translate"] } }
        "small" { def Xform "flag" { double3 xformOp:translate = (0, 0, 1) } }
    }
    over "cube" ( prepend references = @parts/cube.usda@</box> )
    {
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 26: (100, 0, 0), }
        float xformOp:rotateZ = 90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]
        over "looks" { over "red" { over "surface" { color3f inputs:diffuseColor = (0, 1, 0) } } }
    }
    def Camera "eye" { float focalLength = 24
        float verticalAperture = 24
        float2 clippingRange = (10, 100000) }
    def SphereLight "lamp" { float inputs:intensity = 400
        bool inputs:normalize = 1 }
    def Xform "twice" ( references = </world/cube> ) {}
}
"#;

const WEAK: &str = r#"#usda 1.0
over "world" { double3 xformOp:translate = (1, 2, 3)
    def DistantLight "sun" { float inputs:intensity = 3 } }
"#;

const CUBE: &str = r#"#usda 1.0
def Xform "box" {
    def Mesh "faces" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        rel material:binding = </box/looks/red>
        point3f[] points = [(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0), (0, 0, 70)]
        int[] faceVertexCounts = [4, 3, 3]
        int[] faceVertexIndices = [3, 2, 1, 0, 0, 1, 4, 1, 2, 4]
        normal3f[] normals = [(0, 0, -1), (0, -1, 0), (1, 0, 0)] ( interpolation = "uniform" )
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1)] ( interpolation = "faceVarying" )
        int[] primvars:st:indices = [0, 1, 2, 2, 0, 1, 2, 0, 1, 2]
        uniform token subdivisionScheme = "none"
    }
    def Scope "looks" {
        def Material "red" {
            token outputs:surface.connect = </box/looks/red/surface.outputs:surface>
            def Shader "surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (1, 0, 0)
                float inputs:roughness = 0.25
                float inputs:opacity = 0.5
                token outputs:surface
            }
        }
    }
}
"#;

fn companions() -> Companions {
    Companions::of(vec![
        ("weak.usda", WEAK.as_bytes().to_vec()),
        ("parts/cube.usda", CUBE.as_bytes().to_vec()),
    ])
}

fn read(text: &str) -> Asset {
    let asset = import(&UsdImporter, &source("scene.usda", text), &companions(), ImportScope::ALL).unwrap();
    asset_rules::check("scene", &asset);
    asset
}

fn joint(asset: &Asset, name: &str) -> usize {
    asset.skeleton.names().iter().position(|known| known == name).unwrap_or_else(|| panic!("no {name}"))
}

/// World positions of joints at rest, by closed form of the chain.
fn place(skeleton: &Skeleton, joint: usize, point: DVec3) -> DVec3 {
    let mut point = point;
    let mut at = Some(joint as u32);
    while let Some(joint) = at {
        let Transform { translation, rotation, scale } = skeleton.rest()[joint as usize];
        point = translation.as_dvec3() + rotation.as_dquat() * (scale.as_dvec3() * point);
        at = skeleton.parents()[joint as usize];
    }
    point
}

#[test]
fn layers_references_and_variants_are_composed() {
    let asset = read(SCENE);
    assert_eq!(warnings(&asset), [""; 0]);
    // The variant that is selected; up is +Y, in metres. The weaker layer's translation has no order.
    let flag = place(&asset.skeleton, joint(&asset, "flag"), DVec3::ZERO);
    assert!(flag.distance(DVec3::Y * 5.0) < 1e-6, "{flag}");
    let mesh = &asset.meshes[0].primitives[0];
    assert_eq!((mesh.indices.len(), mesh.positions.len()), (12, 10));
    // The first vertex of the first face is point 3, turned by 90° about the file's z.
    let corner = place(&asset.skeleton, asset.instances[0].joint as usize, mesh.positions[0].as_dvec3());
    assert!(corner.distance(DVec3::new(-0.5, 0.0, 0.5)) < 1e-6, "{corner}");
    assert_eq!(mesh.uvs[0][0].to_array(), [0.0, 1.0]);
    assert_eq!(mesh.normals[0], Vec3::NEG_Z);
    let material = &asset.materials[0];
    assert_eq!(material.base_color.to_array(), [0.0, 1.0, 0.0, 0.5]);
    assert_eq!((material.roughness, material.metallic, material.alpha_mode), (0.25, 0.0, AlphaMode::Blend));
    // A reference within the scene is a second one.
    assert_eq!(asset.instances.len(), 2);
    let kinds: Vec<(&str, LightKind, f32)> =
        asset.lights.iter().map(|l| (l.name.as_str(), l.light.kind, l.light.intensity)).collect();
    assert_eq!(kinds, [("lamp", LightKind::Point, 100.0), ("sun", LightKind::Directional, 3.0)]);
    let Projection::Perspective { yfov, near, .. } = asset.cameras[0].projection else {
        panic!("perspective")
    };
    assert!((yfov - 2.0 * 0.5f32.atan()).abs() < 1e-6 && (near - 0.1).abs() < 1e-6, "{yfov} {near}");
    let clip = &asset.clips[0];
    assert_eq!((clip.name.as_str(), clip.duration), ("scene", Time::from_secs(1.0)));
    let moved = clip.curves().iter().find(|c| c.path == Path::Translation && c.times.len() == 2).unwrap();
    assert_eq!(moved.values[3], 100.0);
    assert_eq!((asset.origin.up.as_str(), asset.origin.metres_per_unit), ("+Z", Some(0.01)));
    let small = read(&SCENE.replace("size = \"large\"", "size = \"small\""));
    let flag = place(&small.skeleton, joint(&small, "flag"), DVec3::ZERO);
    assert!(flag.length() < 1e-6, "the other variant has no order: {flag}");
}

#[test]
fn missing_files_are_warnings_and_reference_cycles_are_errors() {
    let alone =
        import(&UsdImporter, &source("scene.usda", SCENE), &Companions::none(), ImportScope::ALL).unwrap();
    let text = warnings(&alone).join("\n");
    assert!(text.contains("the layer is left out") && text.contains("the reference is left out"), "{text}");
    let circle = "#usda 1.0\ndef \"a\" ( references = </a> ) {}";
    let error = error_text(import_bytes(&UsdImporter, "c.usda", circle));
    assert!(error.contains("check for references in a cycle"), "{error}");
    // Doubled again and again.
    let mut bomb = String::from("#usda 1.0\ndef \"a0\" { def \"x\" {} def \"y\" {} }\n");
    for n in 1..40 {
        let m = n - 1;
        bomb += &format!(
            "def \"a{n}\" {{ def \"l\" ( references = </a{m}> ) {{}} def \"r\" ( references = </a{m}> ) {{}} }}\n"
        );
    }
    let error = error_text(import_bytes(&UsdImporter, "b.usda", bomb));
    assert!(error.contains("too many references to be read"), "{error}");
    let deep = format!("#usda 1.0\ndef \"a\" {{ int x = {}", "[".repeat(100_000));
    assert!(error_text(import_bytes(&UsdImporter, "d.usda", deep)).contains("nested parts"));
    let error =
        error_text(import_bytes(&UsdImporter, "e.usda", "#usda 1.0\ndef Mesh \"m\" {\n  int[] x = [1, oh\n"));
    assert!(error.contains("line 4") || error.contains("line 3"), "{error}");
}

#[test]
fn files_are_claimed_by_content() {
    assert_eq!(UsdImporter.claim(&source("x", "#usda 1.0")), Claim::Content(100));
    assert_eq!(UsdImporter.claim(&source("x", "PXR-USDC")), Claim::Content(100));
    assert_eq!(UsdImporter.claim(&source("x.usdz", "PK\x03\x04")), Claim::Content(70));
    assert_eq!(UsdImporter.claim(&source("x.zip", "PK\x03\x04")), Claim::NotMine);
    assert_eq!(UsdImporter.claim(&source("x.usd", "junk")), Claim::Extension);
}

/// An arm that turns, with a mesh on its hand, in all three kinds of files.
fn exported(extension: &str) -> Vec<u8> {
    let mut builder = AssetBuilder::default();
    let shoulder = builder.joint("shoulder", None, Transform::IDENTITY).unwrap();
    let at = Transform { translation: Vec3::X, ..Transform::IDENTITY };
    builder.joint("hand", Some(shoulder), at).unwrap();
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].iter().flat_map(|p| p.to_array()).collect();
    let indices = vec![0, 2, 1, 0, 1, 3, 0, 3, 2];
    builder.mesh(choreo_plugin::MeshData { positions, indices, ..Default::default() }).unwrap();
    let asset = Arc::new(builder.finish("arm").unwrap());
    let joints = asset.skeleton.len();
    let hand = asset.skeleton.find("hand").unwrap() as u32;
    let curve = Curve {
        joint: hand,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: [0.0, 0.5, 1.0].map(Time::from_secs).into(),
        values: [0.0, 1.0, -0.4].into_iter().flat_map(|a| Quat::from_rotation_z(a).to_array()).collect(),
    };
    let clip = choreo_motion::Clip::new("turn".into(), joints, vec![curve]).unwrap();
    let mut stage = Stage::default();
    let actor = stage.cast("arm", asset);
    stage.play(actor, Cue::new(Arc::new(clip)));
    stage.settings.length = Time::from_secs(1.0);
    let mut scene = ExportedScene::new("arm.rhai", Arc::new(stage));
    scene.extension = extension.into();
    let mut files = MemoryFiles::default();
    export_usd::UsdExporter.export(&scene, &mut files).unwrap();
    files.main
}

#[test]
fn usda_usdc_and_usdz_give_the_same_scene() {
    let [text, binary, package] = ["usda", "usdc", "usdz"].map(|extension| {
        let asset = import_bytes(&UsdImporter, &format!("arm.{extension}"), exported(extension)).unwrap();
        asset_rules::check(extension, &asset);
        assert_eq!(warnings(&asset), [""; 0], "{extension}");
        // The mean of the default light from above and below.
        assert!((asset.ambient - glam::Vec3::splat(0.35)).length() < 1e-6, "{}", asset.ambient);
        asset
    });
    for other in [&binary, &package] {
        assert_eq!(text.skeleton, other.skeleton);
        assert_eq!(text.clips[0].curves(), other.clips[0].curves());
        assert_eq!(text.meshes[0].primitives, other.meshes[0].primitives);
        assert_eq!(text.materials, other.materials);
    }
    assert!(text.clips[0].curves().iter().any(|curve| curve.times.len() > 2));
}

#[test]
fn an_image_of_a_dome_is_named() {
    let text = "#usda 1.0\ndef DomeLight \"sky\" {\n asset inputs:texture:file = @./env.exr@\n}\n";
    let asset = import_bytes(&UsdImporter, "a.usda", text).unwrap();
    let said = "/sky: is a DomeLight with an image, which is left out; sky(\"env.exr\") in a script shows it";
    assert_eq!(warnings(&asset), [said]);
    assert_eq!(asset.ambient, glam::Vec3::ZERO);
}

/// The image is beside the layer that states it, and its bytes are cut: only an image that is found has a damaged header.
#[test]
fn texture_files_stated_by_time_samples_are_relative_to_their_layer() {
    let texture = r#"def Shader "image" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file.timeSamples = { 1: @red.png@, }
                float3 outputs:rgb
            }
            def Shader "surface" {"#;
    let color = "color3f inputs:diffuseColor.connect = </box/looks/red/image.outputs:rgb>";
    let cube = CUBE.replace("def Shader \"surface\" {", texture);
    let cube = cube.replace("color3f inputs:diffuseColor = (1, 0, 0)", color);
    let companions = Companions::of(vec![
        ("parts/cube.usda", cube.into_bytes()),
        ("parts/red.png", b"\x89PNG\r\n\x1a\n".to_vec()),
    ]);
    let text = "#usda 1.0\ndef Xform \"world\" ( references = @parts/cube.usda@</box> ) {}\n";
    let asset = import(&UsdImporter, &source("scene.usda", text), &companions, ImportScope::ALL).unwrap();
    let notes = warnings(&asset);
    assert!(notes.iter().any(|note| note.contains("has a damaged header")), "{notes:?}");
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    damage::run_cases(&UsdImporter, || {
        vec![
            ("scene.usda", SCENE.as_bytes().to_vec(), 1000),
            ("cube.usda", CUBE.as_bytes().to_vec(), 1000),
            ("arm.usda", exported("usda"), 1000),
            ("arm.usdc", exported("usdc"), 4000),
            ("arm.usdz", exported("usdz"), 2000),
        ]
    });
}
