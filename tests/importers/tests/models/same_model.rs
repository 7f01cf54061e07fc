//! One model in several formats: the same triangles, extents and places of points, the same joints at the same times.

use choreo_asset::Asset;
use choreo_importer_kit_testing::{assets, pose};
use glam::{Affine3A, DVec3, Vec3};
use importers::{USD, as_usd, from_usd, import_whole};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

fn vertices(asset: &Asset) -> Vec<DVec3> {
    let model = pose::at(asset, None, 0.0);
    let all = (0..asset.instances.len()).flat_map(|i| pose::vertices(asset, i, &model)).flatten();
    all.map(Vec3::as_dvec3).collect()
}

fn triangles(asset: &Asset) -> usize {
    let meshes = asset.instances.iter().map(|i| &asset.meshes[i.mesh as usize]);
    meshes.flat_map(|m| &m.primitives).map(|p| p.indices.len() / 3).sum()
}

fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.iter().fold(none, |(a, b), p| (a.min(*p), b.max(*p)))
}

/// Symmetric Hausdorff distance of two point clouds relative to the largest side of their box, after
/// both are centered and scaled to one size, because formats without units are read in different units.
fn hausdorff_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    let unit = |points: &[DVec3]| -> Vec<DVec3> {
        let (min, max) = bounds(points);
        points.iter().map(|p| (*p - (min + max) * 0.5) / (max - min).max_element()).collect()
    };
    let (a, b) = (unit(a), unit(b));
    one_way(&a, &b).max(one_way(&b, &a))
}

/// Largest distance from one set of points to the other, found with cells a hundredth wide.
fn one_way(from: &[DVec3], to: &[DVec3]) -> f64 {
    let cell = |p: DVec3| (p * 100.0).floor().as_ivec3().to_array();
    let mut cells: BTreeMap<[i32; 3], Vec<DVec3>> = BTreeMap::new();
    to.iter().for_each(|p| cells.entry(cell(*p)).or_default().push(*p));
    let nearest = |p: &DVec3| {
        let [x, y, z] = cell(*p);
        let mut best = f64::INFINITY;
        for i in 0..27 {
            let near = cells.get(&[x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
            best = near.into_iter().flatten().map(|q| q.distance(*p)).fold(best, f64::min);
        }
        best
    };
    from.iter().map(nearest).fold(0.0, f64::max)
}

/// The first against each other one: the same triangles, and points within `limit` of the size.
fn compare(folder: &Path, names: &[&str], limit: f64) {
    let first = import_whole(&folder.join(names[0]));
    let points = vertices(&first);
    for name in &names[1..] {
        let other = import_whole(&folder.join(name));
        let mut others = vertices(&other);
        if name.ends_with(".stl") {
            // Whoever made the spider's STL swapped y and z, which mirrors it.
            others.iter_mut().for_each(|p| p.z = -p.z);
        }
        let off = hausdorff_distance(&points, &others);
        println!(
            "{} and {name}: {} triangles, points off by {off:.1e} of the size",
            names[0],
            triangles(&first)
        );
        assert_eq!(triangles(&first), triangles(&other), "{name}");
        assert!(off < limit, "{name}: {off}");
        // A planted fault: one vertex a thousandth of the size away.
        let mut wrong = others.clone();
        let (min, max) = bounds(&others);
        let place = wrong.len() / 2;
        wrong[place] += DVec3::splat(1e-3 * (max - min).max_element());
        wrong.iter_mut().filter(|p| **p == others[place]).for_each(|p| *p = DVec3::ZERO);
        assert!(hausdorff_distance(&points, &wrong) > limit, "{name}: a moved vertex is not seen");
    }
}

#[test]
fn a_spider_in_three_formats() {
    let Some(folder) = assets(3) else { return };
    compare(
        &folder,
        &["obj/spider.obj", "stl/Spider_ascii.stl", "stl/Spider_binary.stl", "fbx/spider.fbx"],
        2e-5,
    );
}

#[test]
fn props_in_three_formats() {
    let Some(folder) = assets(3).map(|f| f.join("same-model-3-formats")) else { return };
    compare(
        &folder,
        &["barrel_large_decorated.obj", "barrel_large_decorated.fbx", "barrel_large_decorated.gltf.glb"],
        1e-5,
    );
    compare(&folder, &["chest_gold.fbx", "chest_gold.glb"], 1e-5);
}

/// A model of glTF as USD, in all three kinds of files.
#[test]
fn a_chest_in_the_formats_of_usd() {
    let Some(folder) = assets(1) else { return };
    let first = Arc::new(import_whole(&folder.join("same-model-3-formats/chest_gold.glb")));
    let points = vertices(&first);
    for extension in USD {
        let other = from_usd(as_usd(&first, extension), extension);
        let off = hausdorff_distance(&points, &vertices(&other));
        println!(
            "chest_gold.glb as {extension}: {} triangles, points off by {off:.1e} of the size",
            triangles(&other)
        );
        assert_eq!(triangles(&first), triangles(&other), "{extension}");
        assert!(off < 1e-6, "{extension}: {off}");
        assert_eq!(first.images.len(), other.images.len(), "{extension}");
        let mut wrong = vertices(&other);
        wrong.iter_mut().for_each(|p| p.x *= 1.001);
        assert!(one_way(&points, &wrong) > 1e-6, "{extension}: a wider chest is not seen");
    }
}

/// Joints by name in metres, at a time.
fn joints(asset: &Asset, secs: f64) -> BTreeMap<String, Affine3A> {
    let clip = (!asset.clips.is_empty()).then_some(0);
    let model = pose::at(asset, clip, secs);
    asset.skeleton.names().iter().cloned().zip(model).collect()
}

/// ProAnimationBank's walk, as FBX and as COLLADA: all joints that both name, at the same times. The COLLADA goes on for longer,
/// and has no rotations that the FBX holds by names of its own.
#[test]
fn a_walk_in_two_formats() {
    let Some(folder) = assets(2) else { return };
    let (fbx, dae) =
        (import_whole(&folder.join("fbx/pab/walk.fbx")), import_whole(&folder.join("dae/pab/walk.dae")));
    let length = fbx.clips[0].duration.as_secs();
    assert!(dae.clips[0].duration.as_secs() >= length);
    let worst = |late: f64| {
        let (mut worst, mut place, mut count) = (0.0f32, String::new(), 0);
        // The FBX is sampled between its keys as well, the COLLADA has its own at every frame: whole frames, 30 a second.
        for frame in 0..=(length * 30.0) as u32 {
            let secs = f64::from(frame) / 30.0;
            let (a, b) = (joints(&fbx, secs), joints(&dae, secs + late));
            for (name, a) in &a {
                // Aims and targets of cameras are no part of the skeleton.
                let Some(b) = b.get(name).filter(|_| !name.starts_with("Camera")) else { continue };
                count += 1;
                let off = a.translation.distance(b.translation);
                if off > worst {
                    (worst, place) = (off, format!("{name} at {secs:.3} s"));
                }
            }
        }
        println!("{count} joints, the worst {worst:.1e} m apart: {place}");
        (worst, count)
    };
    let (off, count) = worst(0.0);
    assert!(count > 60 * 40 && off < 2e-5, "{off} m, {count}");
    // A planted fault: a tenth of a frame late.
    assert!(worst(0.1 / 30.0).0 > 1e-3);
}

/// A node that moves a metre along x from 0.5 s to 1.5 s of the file's time, in each format. `stated`: the file says that its clip
/// starts at 0.5 s.
fn moving(format: &str, stated: bool) -> Vec<u8> {
    const SECOND: i64 = 46_186_158_000;
    let (begin, end) = (SECOND / 2, SECOND / 2 + SECOND);
    let stack = match stated {
        true => format!(
            "P: \"LocalStart\", \"KTime\", \"Time\", \"\", {begin}\nP: \"LocalStop\", \"KTime\", \"Time\", \"\", {end}\n"
        ),
        false => String::new(),
    };
    let clip = match stated {
        true => {
            "<library_animation_clips><animation_clip name=\"a\" start=\"0.5\" end=\"1.5\"><instance_animation url=\"#a\"/></animation_clip></library_animation_clips>"
        }
        false => "",
    };
    let text = match format {
        "fbx" => format!(
            "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXVersion: 7400\n}}\nGlobalSettings: {{\nProperties70: {{\n\
             P: \"UnitScaleFactor\", \"double\", \"Number\", \"\", 100\n}}\n}}\nObjects: {{\nModel: 1, \"Model::n\", \"LimbNode\" {{\n}}\n\
             AnimationStack: 40, \"AnimStack::a\", \"\" {{\nProperties70: {{\n{stack}}}\n}}\nAnimationLayer: 41, \"AnimLayer::b\", \"\" {{\n}}\n\
             AnimationCurveNode: 42, \"AnimCurveNode::T\", \"\" {{\n}}\nAnimationCurve: 43, \"AnimCurve::\", \"\" {{\n\
             KeyTime: *2 {{\na: {begin},{end}\n}}\nKeyValueFloat: *2 {{\na: 0,1\n}}\nKeyAttrFlags: *1 {{\na: 4\n}}\n\
             KeyAttrDataFloat: *4 {{\na: 0,0,0,0\n}}\nKeyAttrRefCount: *1 {{\na: 2\n}}\n}}\n}}\nConnections: {{\nC: \"OO\",1,0\n\
             C: \"OO\",41,40\nC: \"OO\",42,41\nC: \"OP\",42,1, \"Lcl Translation\"\nC: \"OP\",43,42, \"d|X\"\n}}\n"
        ),
        "dae" => format!(
            "<COLLADA version=\"1.4.1\"><library_animations><animation id=\"a\"><source id=\"i\"><float_array id=\"ia\" count=\"2\">0.5 1.5</float_array></source>\
             <source id=\"o\"><float_array id=\"oa\" count=\"2\">0 1</float_array></source><sampler id=\"s\"><input semantic=\"INPUT\" source=\"#i\"/>\
             <input semantic=\"OUTPUT\" source=\"#o\"/></sampler><channel source=\"#s\" target=\"n/t.X\"/></animation></library_animations>{clip}\
             <library_visual_scenes><visual_scene id=\"v\"><node id=\"n\" name=\"n\"><translate sid=\"t\">0 0 0</translate></node></visual_scene></library_visual_scenes>\
             <scene><instance_visual_scene url=\"#v\"/></scene></COLLADA>"
        ),
        "bvh" => "HIERARCHY\nROOT n\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n\
                  MOTION\nFrames: 2\nFrame Time: 1\n0 0 0\n1 0 0\n"
            .to_string(),
        "usda" => "#usda 1.0\n(\n defaultPrim = \"n\"\n metersPerUnit = 1\n upAxis = \"Y\"\n startTimeCode = 12\n timeCodesPerSecond = 24\n)\n\
                   def Xform \"n\" {\n double3 xformOp:translate.timeSamples = { 12: (0, 0, 0), 36: (1, 0, 0) }\n \
                   uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}\n"
            .to_string(),
        other => panic!("{other}"),
    };
    text.into_bytes()
}

/// Time 0 of a clip is where the file says that the clip starts, else its first key: so the same motion starts at the same time
/// in every format. glTF says it for all files: at 0 s (glTF 2.0 §3.11), which `import-gltf` tests.
#[test]
fn the_same_motion_starts_at_the_same_time() {
    for (format, stated) in
        [("fbx", true), ("fbx", false), ("dae", true), ("dae", false), ("bvh", false), ("usda", true)]
    {
        let name = format!("a.{format}");
        let importer = importers::importer(Path::new(&name)).unwrap();
        let asset = choreo_importer_kit_testing::import_bytes(importer, &name, moving(format, stated));
        let asset = asset.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(asset.clips.len(), 1, "{format}");
        assert!((asset.clips[0].duration.as_secs() - 1.0).abs() < 1e-6, "{format} {stated}");
        let size = if format == "bvh" { asset.origin.metres_per_unit.unwrap_or(1.0) } else { 1.0 };
        for secs in [0.0, 0.25, 0.5, 1.0] {
            let x = f64::from(joints(&asset, secs)["n"].translation.x) / size;
            assert!((x - secs).abs() < 1e-5, "{format}, stated {stated}: {x} at {secs} s");
        }
    }
}
