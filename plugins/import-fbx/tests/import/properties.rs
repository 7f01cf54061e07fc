//! Clips that change lights and cameras, and geometric transforms, from files written here, against closed forms.

use crate::common;
use choreo_asset::{Asset, Projection};
use choreo_importer_kit_testing::{Companions, asset_rules, import, warnings};
use choreo_motion::{Clip, Interpolation, PropertyTarget, Time};
use choreo_plugin::ImportScope;
use glam::{DQuat, DVec3};
use import_fbx::FbxImporter;
use std::f64::consts::PI;

const SECOND: i64 = 46_186_158_000;

fn asset(objects: &str, links: &str) -> Asset {
    let text = format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXVersion: 7400\n}}\nGlobalSettings: {{\nProperties70: {{\n\
         P: \"UnitScaleFactor\", \"double\", \"Number\", \"\", 100\n}}\n}}\nObjects: {{\n{objects}}}\nConnections: {{\n{links}}}\n"
    );
    let asset = import(
        &FbxImporter,
        &common::source("a.fbx", text.into_bytes()),
        &Companions::none(),
        ImportScope::ALL,
    );
    let asset = asset.unwrap_or_else(|e| panic!("{e}"));
    asset_rules::check("a.fbx", &asset);
    asset
}

fn node(id: u32, kind: &str, properties: &str) -> String {
    format!("Model: {id}, \"Model::n{id}\", \"{kind}\" {{\nProperties70: {{\n{properties}}}\n}}\n")
}

fn attribute(id: u32, kind: &str, properties: &str) -> String {
    format!(
        "NodeAttribute: {id}, \"NodeAttribute::a{id}\", \"{kind}\" {{\nProperties70: {{\n{properties}}}\n}}\n"
    )
}

/// Straight lines from key to key, a second apart.
fn curve(id: u32, values: &[f64]) -> String {
    let times: Vec<String> = (0..values.len() as i64).map(|k| (k * SECOND).to_string()).collect();
    let text: Vec<String> = values.iter().map(f64::to_string).collect();
    let n = values.len();
    format!(
        "AnimationCurve: {id}, \"AnimCurve::\", \"\" {{\nDefault: 0\nKeyVer: 4008\nKeyTime: *{n} {{\na: {}\n}}\nKeyValueFloat: *{n} {{\na: {}\n}}\n\
         KeyAttrFlags: *1 {{\na: 24836\n}}\nKeyAttrDataFloat: *4 {{\na: 0,0,218434821,0\n}}\nKeyAttrRefCount: *1 {{\na: {n}\n}}\n}}\n",
        times.join(","),
        text.join(",")
    )
}

/// A curve node of a property in a layer, with its curves by axis.
fn driven(id: u32, layer: u32, (of, property): (u32, &str), curves: &[(u32, &str)]) -> (String, String) {
    let object = format!(
        "AnimationCurveNode: {id}, \"AnimCurveNode::{property}\", \"\" {{\nProperties70: {{\n}}\n}}\n"
    );
    let mut links = format!("C: \"OO\",{id},{layer}\nC: \"OP\",{id},{of}, \"{property}\"\n");
    for (curve, axis) in curves {
        links += &format!("C: \"OP\",{curve},{id}, \"d|{axis}\"\n");
    }
    (object, links)
}

fn stack() -> (String, String) {
    let text = format!(
        "AnimationStack: 500, \"AnimStack::change\", \"\" {{\nProperties70: {{\nP: \"LocalStart\", \"KTime\", \"Time\", \"\", 0\nP: \"LocalStop\", \"KTime\", \"Time\", \"\", {}\n}}\n}}\n\
         AnimationLayer: 501, \"AnimLayer::base\", \"\" {{\n}}\n",
        2 * SECOND
    );
    (text, "C: \"OO\",501,500\n".into())
}

fn at(clip: &Clip, target: PropertyTarget, secs: f64) -> [f32; 3] {
    let mut out = [f32::NAN; 3];
    assert!(clip.sample_property(target, Time::from_secs(secs), &mut out), "{target:?}");
    out
}

fn keys(clip: &Clip, target: PropertyTarget) -> (Interpolation, usize) {
    let found = clip.properties().find(|p| p.0 == target).unwrap().1;
    (found.interpolation, found.times.len())
}

/// A camera whose property goes 30 → 60 → 20 in two seconds, straight.
fn zooming_camera(camera: &str, property: &str) -> Asset {
    let (mut objects, mut links) = stack();
    objects += &node(1, "Camera", "");
    objects += &attribute(2, "Camera", camera);
    objects += &curve(3, &[30.0, 60.0, 20.0]);
    let (object, link) = driven(4, 501, (2, property), &[(3, property)]);
    objects += &object;
    links += &format!("C: \"OO\",1,0\nC: \"OO\",2,1\n{link}");
    asset(&objects, &links)
}

fn straight(secs: f64) -> f64 {
    if secs < 1.0 { 30.0 + 30.0 * secs } else { 60.0 - 40.0 * (secs - 1.0) }
}

/// The worst distance in degrees from the formula, at times between keys; `delay_secs` is a planted fault.
fn largest_error(asset: &Asset, formula: impl Fn(f64) -> f64, delay_secs: f64) -> f64 {
    let times = (0..97).map(|k| 2.0 * (f64::from(k) + 0.37) / 97.0);
    let clip = &asset.clips[0];
    let off = |t: f64| f64::from(at(clip, PropertyTarget::CameraYfov(0), t)[0]) - formula(t + delay_secs);
    times.map(|t| off(t).abs().to_degrees()).fold(0.0, f64::max)
}

#[test]
fn a_vertical_angle_keeps_its_curve() {
    let asset = zooming_camera(
        "P: \"ApertureMode\", \"enum\", \"\", \"\", 2\nP: \"FieldOfView\", \"FieldOfView\", \"\", \"A\", 45\n",
        "FieldOfView",
    );
    let formula = |t: f64| straight(t) * PI / 180.0;
    assert!(largest_error(&asset, formula, 0.0) < 1e-5, "{}", largest_error(&asset, formula, 0.0));
    assert!(largest_error(&asset, formula, 0.01) > 0.1);
    assert_eq!(keys(&asset.clips[0], PropertyTarget::CameraYfov(0)), (Interpolation::Linear, 3));
    let Projection::Perspective { yfov, .. } = asset.cameras[0].projection else { panic!() };
    assert_eq!(yfov, (45.0 * (PI / 180.0)) as f32);
}

/// 24 mm of film: tan(½ yfov) = 12 mm ÷ focal length.
#[test]
fn a_focal_length_curve_becomes_an_accurate_vertical_angle() {
    let camera = "P: \"ApertureMode\", \"enum\", \"\", \"\", 3\nP: \"FilmWidth\", \"Number\", \"\", \"\", 1.4173228346456692\n\
                  P: \"FilmHeight\", \"Number\", \"\", \"\", 0.9448818897637795\nP: \"FocalLength\", \"Number\", \"\", \"A\", 35\n";
    let asset = zooming_camera(camera, "FocalLength");
    let formula = |t: f64| 2.0 * (12.0 / straight(t)).atan();
    let off = largest_error(&asset, formula, 0.0);
    assert!(off < 0.05, "{off}°");
    assert!(largest_error(&asset, formula, 0.02) > 0.2);
    let (interpolation, count) = keys(&asset.clips[0], PropertyTarget::CameraYfov(0));
    assert!(interpolation == Interpolation::CubicSpline && count < 20, "{count}");
    let Projection::Perspective { yfov, .. } = asset.cameras[0].projection else { panic!() };
    assert!((f64::from(yfov) - 2.0 * (12.0f64 / 35.0).atan()).abs() < 1e-6);
}

#[test]
fn a_horizontal_angle_is_converted_by_the_aspect_ratio() {
    let camera = "P: \"ApertureMode\", \"enum\", \"\", \"\", 1\nP: \"AspectWidth\", \"double\", \"Number\", \"\", 200\n\
                  P: \"AspectHeight\", \"double\", \"Number\", \"\", 100\nP: \"FieldOfView\", \"FieldOfView\", \"\", \"A\", 90\n";
    let asset = zooming_camera(camera, "FieldOfView");
    let off = largest_error(&asset, |t| 2.0 * (0.5 * (straight(t) * PI / 360.0).tan()).atan(), 0.0);
    assert!(off < 0.05, "{off}°");
    let Projection::Perspective { yfov, .. } = asset.cameras[0].projection else { panic!() };
    assert!((yfov - 2.0 * 0.5f32.atan()).abs() < 1e-6);
}

#[test]
fn an_animated_orthographic_zoom_changes_the_height() {
    let asset = zooming_camera(
        "P: \"CameraProjectionType\", \"enum\", \"\", \"\", 1\nP: \"OrthoZoom\", \"double\", \"Number\", \"\", 15\n",
        "OrthoZoom",
    );
    let Projection::Orthographic { height, .. } = asset.cameras[0].projection else { panic!() };
    let twice = at(&asset.clips[0], PropertyTarget::CameraHeight(0), 0.0)[0];
    assert!((twice / height - 2.0).abs() < 1e-5, "{twice} {height}");
}

/// Numbers that this kind of camera does not look at: no curve, and no warning that one is lost.
#[test]
fn curves_that_the_camera_does_not_use_are_left_out() {
    let asset = zooming_camera(
        "P: \"ApertureMode\", \"enum\", \"\", \"\", 2\nP: \"FieldOfView\", \"FieldOfView\", \"\", \"A\", 45\n",
        "FocalLength",
    );
    assert!(asset.clips.is_empty());
    assert_eq!(warnings(&asset), ["animstack \"change\": moves nothing and is left out"]);
}

fn lamp(extra: impl Fn(&mut String, &mut String)) -> Asset {
    let (mut objects, mut links) = stack();
    objects += &node(1, "Light", "");
    objects += &attribute(
        2,
        "Light",
        "P: \"LightType\", \"enum\", \"\", \"\", 2\nP: \"DecayType\", \"enum\", \"\", \"\", 2\nP: \"Intensity\", \"Number\", \"\", \"A\", 200\n\
         P: \"Color\", \"Color\", \"\", \"A\", 1, 1, 1\nP: \"InnerAngle\", \"Number\", \"\", \"A\", 20\nP: \"OuterAngle\", \"Number\", \"\", \"A\", 40\n",
    );
    links += "C: \"OO\",1,0\nC: \"OO\",2,1\n";
    extra(&mut objects, &mut links);
    asset(&objects, &links)
}

#[test]
fn color_intensity_and_cone_of_a_light() {
    let asset = lamp(|objects, links| {
        for (id, values) in [(10, [1.0, 0.0, 0.5]), (11, [0.25, 0.25, 0.25]), (12, [0.0, 1.0, 0.0])] {
            *objects += &curve(id, &values);
        }
        *objects += &curve(13, &[0.0, 100.0, 300.0]);
        *objects += &curve(14, &[40.0, 80.0, 120.0]);
        for (id, property, curves) in [
            (20, "Color", &[(10, "X"), (11, "Y"), (12, "Z")][..]),
            (21, "Intensity", &[(13, "Intensity")]),
            (22, "OuterAngle", &[(14, "OuterAngle")]),
        ] {
            let (object, link) = driven(id, 501, (2, property), curves);
            *objects += &object;
            *links += &link;
        }
    });
    assert!(warnings(&asset).is_empty(), "{:?}", warnings(&asset));
    let clip = &asset.clips[0];
    for (secs, color, percent, degrees) in [
        (0.0, [1.0, 0.25, 0.0], 0.0, 40.0),
        (0.5, [0.5, 0.25, 0.5], 50.0, 60.0),
        (1.75, [0.375, 0.25, 0.25], 250.0, 110.0),
    ] {
        let got = at(clip, PropertyTarget::LightColor(0), secs);
        assert!(got.iter().zip(color).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6), "{secs}: {got:?}");
        // Candela at one metre a unit, as at rest.
        let intensity = at(clip, PropertyTarget::LightIntensity(0), secs)[0];
        let wanted = asset.lights[0].light.intensity * percent / 200.0;
        assert!((intensity - wanted).abs() < 1e-5, "{secs}: {intensity} {wanted}");
        let outer = f64::from(at(clip, PropertyTarget::SpotOuter(0), secs)[0]);
        assert!((outer - degrees * PI / 360.0).abs() < 1e-6, "{secs}: {outer}");
    }
    assert_eq!(clip.curves().len(), 0);
    assert_eq!(clip.duration, Time::from_secs(2.0));
}

/// A second layer adds to the first: sampled, and the same lines.
#[test]
fn animation_layers_are_blended() {
    let asset = lamp(|objects, links| {
        *objects += "AnimationLayer: 502, \"AnimLayer::more\", \"\" {\nProperties70: {\nP: \"Weight\", \"Number\", \"\", \"A\", 50\n}\n}\n";
        *links += "C: \"OO\",502,500\n";
        *objects += &curve(13, &[0.0, 100.0, 300.0]);
        *objects += &curve(14, &[100.0, 100.0, 100.0]);
        for (id, layer, curve) in [(21, 501, 13), (22, 502, 14)] {
            let (object, link) = driven(id, layer, (2, "Intensity"), &[(curve, "Intensity")]);
            *objects += &object;
            *links += &link;
        }
    });
    let unit = asset.lights[0].light.intensity / 200.0;
    for (secs, percent) in [(0.0, 50.0), (0.5, 100.0), (1.5, 250.0)] {
        let got = at(&asset.clips[0], PropertyTarget::LightIntensity(0), secs)[0] / unit;
        assert!((got - percent).abs() < 0.5, "{secs}: {got} %");
    }
}

/// A curve that holds the value at rest is no change.
#[test]
fn constant_light_curves_add_no_properties() {
    let asset = lamp(|objects, links| {
        *objects += &curve(13, &[200.0, 200.0]);
        let (object, link) = driven(21, 501, (2, "Intensity"), &[(13, "Intensity")]);
        *objects += &object;
        *links += &link;
    });
    assert!(asset.clips.is_empty());
}

fn mesh(id: u32) -> String {
    format!(
        "Geometry: {id}, \"Geometry::g\", \"Mesh\" {{\nVertices: *9 {{\na: 1,0,0,0,2,0,0,0,3\n}}\nPolygonVertexIndex: *3 {{\na: 0,1,-3\n}}\n}}\n"
    )
}

/// Scaled, turned about X, Y and Z, moved; the node's own place comes after.
#[test]
fn geometric_transforms_are_baked_into_the_mesh() {
    let properties = "P: \"GeometricTranslation\", \"Vector3D\", \"Vector\", \"\", 4, 5, 6\nP: \"GeometricRotation\", \"Vector3D\", \"Vector\", \"\", 30, -50, 110\n\
                      P: \"GeometricScaling\", \"Vector3D\", \"Vector\", \"\", 2, 1, -0.5\nP: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\", 10, 0, 0\n";
    let child = "P: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\", 0, 1, 0\n";
    let objects = node(1, "Mesh", properties) + &mesh(2) + &node(3, "Null", child);
    let asset = asset(&objects, "C: \"OO\",1,0\nC: \"OO\",2,1\nC: \"OO\",3,1\n");
    assert_eq!(asset.skeleton.names(), ["n1", "n3"], "no joint for it");
    let turn = DQuat::from_rotation_z(110f64.to_radians())
        * DQuat::from_rotation_y(-50f64.to_radians())
        * DQuat::from_rotation_x(30f64.to_radians());
    let place = |p: DVec3| turn * (p * DVec3::new(2.0, 1.0, -0.5)) + DVec3::new(14.0, 5.0, 6.0);
    let wanted = [DVec3::X, DVec3::Y * 2.0, DVec3::Z * 3.0].map(place);
    let got = common::posed_vertices(&asset, None);
    for (got, wanted) in got.iter().zip(wanted) {
        assert!(got.distance(wanted) < 1e-5, "{got} {wanted}");
    }
    // A mirror turns the face round, so that its side shows where its normal is.
    let p = &asset.meshes[0].primitives[0];
    let [a, b, c] = [0, 1, 2].map(|k| p.positions[p.indices[k] as usize]);
    assert!((b - a).cross(c - a).dot(p.normals[0]) > 0.0);
    assert!(
        (p.normals[0].as_dvec3() - (turn * DVec3::new(0.5, 0.5, -2.0 / 3.0)).normalize()).length() < 1e-6,
        "{}",
        p.normals[0]
    );
    // The node and its children have another transform.
    let (model, _) = common::pose(&asset, None);
    assert_eq!(model[1].translation.to_array(), [10.0, 1.0, 0.0]);
}

/// A mesh in two places with two geometric transforms cannot have them in its vertices: each instance gets a joint.
#[test]
fn a_shared_mesh_has_its_geometric_transforms_in_joints() {
    let at = |x: f64| format!("P: \"GeometricRotation\", \"Vector3D\", \"Vector\", \"\", 0, 0, {x}\n");
    let objects = node(1, "Mesh", &at(90.0)) + &node(3, "Mesh", &at(-90.0)) + &mesh(2);
    let asset = asset(&objects, "C: \"OO\",1,0\nC: \"OO\",3,0\nC: \"OO\",2,1\nC: \"OO\",2,3\n");
    assert_eq!(asset.skeleton.names(), ["n1", "n1 (geometry)", "n3", "n3 (geometry)"]);
    assert_eq!((asset.meshes.len(), asset.instances.len()), (1, 2));
    let vertices = common::posed_vertices(&asset, None);
    for (k, wanted) in [(0, DVec3::Y), (3, DVec3::NEG_Y)] {
        assert!(vertices[k].distance(wanted) < 1e-6, "{}", vertices[k]);
    }
}

/// Versions 3 to 5 keep a node's visibility in a channel, of the node itself or of a take: 1 is visible, as is no channel at all.
#[test]
fn visibility_before_version_6() {
    let channel = |value: u8| format!("Channel: \"Visibility\" {{\nDefault: {value}\n}}\n");
    let file = |version: u32, of_node: &str, of_take: &str| {
        format!(
            "; FBX {}.0.0 project file\nFBXHeaderExtension: {{\nFBXHeaderVersion: 1003\nFBXVersion: {version}\n}}\n\
             Model: \"Model::Box01\" {{\nVersion: 194\n{of_node}GeometryVersion: 123\nVertices: 0,0,0,1,0,0,0,1,0\n\
             MaterialAssignation: \"AllSame\"\nMaterials: 0\nPolygonVertexIndex: 0,1,-3\n}}\n\
             Takes: {{\nCurrent: \"a\"\nTake: \"a\" {{\nLocalTime: 0,{SECOND}\nModel: \"Model::Box01\" {{\nVersion: 1.1\n{of_take}}}\n}}\n}}\n",
            version / 1000
        )
    };
    for version in [3000, 5000, 5800] {
        for (of_node, of_take, shown) in [
            (String::new(), String::new(), 1),
            (channel(1), String::new(), 1),
            (String::new(), channel(1), 1),
            (channel(0), String::new(), 0),
            (String::new(), channel(0), 0),
        ] {
            let text = file(version, &of_node, &of_take);
            let source = common::source("old.fbx", text.clone().into_bytes());
            let asset = import(&FbxImporter, &source, &Companions::none(), ImportScope::ALL).unwrap();
            assert_eq!(asset.instances.len(), shown, "{text}\n{:?}", warnings(&asset));
            let hidden = warnings(&asset).iter().any(|w| w.contains("its mesh is hidden in the file"));
            assert_eq!(hidden, shown == 0);
        }
    }
}
