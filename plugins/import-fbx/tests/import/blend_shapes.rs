//! Blend shapes below 0 and past 100 percent, at rest and in clips, from files written here. The independent truth is the
//! vertices that ufbx evaluates by its own code (`ufbx_evaluate_scene`, `ufbx_get_blend_vertex_offset`), and closed forms.

use choreo_asset::Asset;
use choreo_importer_kit_testing::{Companions, asset_rules, import};
use choreo_plugin::ImportScope;
use glam::DVec3;
use import_fbx::FbxImporter;
use std::fmt::Write;

const SECOND: i64 = 46_186_158_000;
/// Percent of the channel at 0, 1, 2 … seconds, straight between: through every shape and past the outermost, both ways.
const PERCENT: [f64; 5] = [0.0, -150.0, 150.0, -30.0, 75.0];

/// One triangle, in metres and +Y up, with a channel. `shapes`: full weight in percent, and what the shape adds to the first
/// vertex. `rest`: the channel's weight in percent without a clip.
fn file(shapes: &[(f64, [f64; 3])], rest: f64, animated: bool) -> Vec<u8> {
    let mut objects = String::from(
        "Model: 10, \"Model::body\", \"Mesh\" {\n}\nGeometry: 11, \"Geometry::body\", \"Mesh\" {\nVertices: *9 {\na: 0,0,0,1,0,0,0,1,0\n}\n\
         PolygonVertexIndex: *3 {\na: 0,1,-3\n}\n}\nDeformer: 20, \"Deformer::face\", \"BlendShape\" {\n}\n",
    );
    let full: Vec<String> = shapes.iter().map(|s| s.0.to_string()).collect();
    let _ = write!(
        objects,
        "Deformer: 21, \"SubDeformer::smile\", \"BlendShapeChannel\" {{\nDeformPercent: {rest}\nFullWeights: *{} {{\na: {}\n}}\n\
         Properties70: {{\nP: \"DeformPercent\", \"Number\", \"\", \"A\", {rest}\n}}\n}}\n",
        full.len(),
        full.join(",")
    );
    let mut links = String::from("C: \"OO\",10,0\nC: \"OO\",11,10\nC: \"OO\",20,11\nC: \"OO\",21,20\n");
    for (number, (_, [x, y, z])) in shapes.iter().enumerate() {
        let id = 30 + number;
        let _ = write!(
            objects,
            "Geometry: {id}, \"Geometry::shape{number}\", \"Shape\" {{\nIndexes: *1 {{\na: 0\n}}\nVertices: *3 {{\na: {x},{y},{z}\n}}\n}}\n"
        );
        let _ = writeln!(links, "C: \"OO\",{id},21");
    }
    if animated {
        let n = PERCENT.len();
        let times: Vec<String> = (0..n as i64).map(|k| (k * SECOND).to_string()).collect();
        let values: Vec<String> = PERCENT.iter().map(f64::to_string).collect();
        let _ = write!(
            objects,
            "AnimationStack: 40, \"AnimStack::talk\", \"\" {{\n}}\nAnimationLayer: 41, \"AnimLayer::base\", \"\" {{\n}}\n\
             AnimationCurveNode: 42, \"AnimCurveNode::DeformPercent\", \"\" {{\n}}\n\
             AnimationCurve: 43, \"AnimCurve::\", \"\" {{\nKeyTime: *{n} {{\na: {}\n}}\nKeyValueFloat: *{n} {{\na: {}\n}}\n\
             KeyAttrFlags: *1 {{\na: 4\n}}\nKeyAttrDataFloat: *4 {{\na: 0,0,0,0\n}}\nKeyAttrRefCount: *1 {{\na: {n}\n}}\n}}\n",
            times.join(","),
            values.join(",")
        );
        links += "C: \"OO\",41,40\nC: \"OO\",42,41\nC: \"OP\",42,21, \"DeformPercent\"\nC: \"OP\",43,42, \"d|DeformPercent\"\n";
    }
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXVersion: 7400\n}}\nGlobalSettings: {{\nProperties70: {{\n\
         P: \"UnitScaleFactor\", \"double\", \"Number\", \"\", 100\n}}\n}}\nObjects: {{\n{objects}}}\nConnections: {{\n{links}}}\n"
    )
    .into_bytes()
}

fn read(bytes: &[u8]) -> Asset {
    let source = crate::common::source("a.fbx", bytes.to_vec());
    let asset = import(&FbxImporter, &source, &Companions::none(), ImportScope::ALL)
        .unwrap_or_else(|e| panic!("{e}"));
    asset_rules::check("a.fbx", &asset);
    asset
}

/// Position of the first vertex by this importer and by ufbx, at a time of the clip or at rest.
fn choreo_and_ufbx_vertices(bytes: &[u8], asset: &Asset, secs: Option<f64>) -> (DVec3, DVec3) {
    let ours = crate::common::posed_vertices(asset, secs.map(|s| (&*asset.clips[0], s)))[0];
    let scene = ufbx::load_memory(bytes, ufbx::LoadOpts::default()).unwrap();
    let at = match secs {
        None => scene.evaluate(&scene.anim, 0.0, ufbx::EvaluateOpts::default()).unwrap(),
        Some(secs) => {
            let stack = &scene.anim_stacks.as_ref()[0];
            scene.evaluate(&stack.anim, secs, ufbx::EvaluateOpts::default()).unwrap()
        }
    };
    let offset = ufbx::get_blend_vertex_offset(&at.blend_deformers.as_ref()[0], 0);
    (ours, DVec3::new(offset.x, offset.y, offset.z))
}

const CHANNELS: [&[(f64, [f64; 3])]; 6] = [
    &[(100.0, [1.0, 0.0, 0.0])],
    &[(50.0, [0.0, 1.0, 0.0]), (100.0, [1.0, 0.0, 0.0])],
    &[(25.0, [0.0, 0.0, 1.0]), (50.0, [0.0, 1.0, 0.0]), (100.0, [1.0, 0.0, 0.0])],
    &[(-100.0, [0.0, -1.0, 0.0]), (100.0, [1.0, 0.0, 0.0])],
    &[
        (-100.0, [0.0, -1.0, 0.0]),
        (-40.0, [0.0, 0.0, -1.0]),
        (60.0, [0.0, 1.0, 0.0]),
        (100.0, [1.0, 0.0, 0.0]),
    ],
    &[(-100.0, [0.0, -1.0, 0.0]), (-50.0, [1.0, 0.0, 0.0])],
];

#[test]
fn weights_below_zero_at_rest() {
    for shapes in CHANNELS {
        for percent in [-150.0, -100.0, -50.0, -30.0, -10.0, 10.0, 30.0, 75.0, 150.0] {
            let bytes = file(shapes, percent, false);
            let (ours, theirs) = choreo_and_ufbx_vertices(&bytes, &read(&bytes), None);
            assert!(ours.distance(theirs) < 1e-6, "{shapes:?} at {percent} %: {ours}, ufbx has {theirs}");
            assert!(theirs.length() > 0.05, "the shapes move the vertex");
        }
    }
    // Closed forms: all of the shape the other way; the first shape in between, twice.
    let at = |shapes, percent| read(&file(shapes, percent, false));
    let rest = |asset: &Asset| asset.instances[0].weights.clone();
    assert_eq!(rest(&at(CHANNELS[0], -100.0)), [-1.0]);
    assert_eq!(rest(&at(CHANNELS[1], -100.0)), [-2.0, 0.0]);
    assert_eq!(rest(&at(CHANNELS[5], 25.0)), [0.0, -0.5]);
}

#[test]
fn weights_below_zero_in_clips() {
    for shapes in CHANNELS {
        let bytes = file(shapes, 0.0, true);
        let asset = read(&bytes);
        assert_eq!(asset.clips[0].duration.as_secs(), 4.0);
        let mut lowest = 0.0f64;
        for step in 0..=160 {
            let secs = f64::from(step) / 40.0;
            let (ours, theirs) = choreo_and_ufbx_vertices(&bytes, &asset, Some(secs));
            // Times of the keys that are added are whole ticks, of 1.4 ns.
            assert!(ours.distance(theirs) < 1e-5, "{shapes:?} at {secs} s: {ours}, ufbx has {theirs}");
            lowest = lowest.min(theirs.min_element());
        }
        assert!(lowest < -0.9, "{shapes:?} go below 0: {lowest}");
    }
}
