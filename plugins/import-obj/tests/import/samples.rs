//! Sample files: counts and extents, compared with those of assimp.

use choreo_asset::Asset;
use choreo_importer_kit_testing::{asset_rules, assets, assimp, import_path, warnings};
use glam::Vec3;
use import_obj::ObjImporter;

/// assimp joins fewer equal face vertices than we do and loses 28 faces of the spider (which has 1368, as its STL): its counts are
/// only printed, its extents are compared.
#[test]
fn counts_and_extents_equal_those_of_assimp() {
    // File, nodes, primitives, vertices, triangles, images.
    let files = [
        ("obj/box.obj", [1, 1, 24, 12, 0]),
        ("obj/concave_polygon.obj", [1, 1, 64, 64, 0]),
        ("obj/cube_usemtl.obj", [1, 3, 28, 12, 0]),
        ("obj/cube_with_vertexcolors.obj", [1, 1, 24, 12, 0]),
        ("obj/spider.obj", [20, 19, 974, 1368, 4]),
        ("same-model-3-formats/barrel_large_decorated.obj", [1, 1, 1379, 1047, 1]),
        ("same-model-3-formats/chest_gold.obj", [1, 1, 1508, 1106, 1]),
    ];
    let Some(folder) = assets(files.len()) else { return };
    let mut wrong = Vec::new();
    for (name, expected) in files {
        let path = folder.join(name);
        let asset = import_path(&ObjImporter, &path).unwrap();
        asset_rules::check(name, &asset);
        let all = || asset.meshes.iter().flat_map(|m| &m.primitives);
        let triangles: usize = all().map(|p| p.indices.len() / 3).sum();
        let vertices = all().map(|p| p.positions.len()).sum();
        let facts = [asset.skeleton.len(), all().count(), vertices, triangles, asset.images.len()];
        println!("{name}: {facts:?} {:?}", warnings(&asset));
        if facts != expected {
            wrong.push((name, facts));
        }
        match assimp::info(&path) {
            None => println!("SKIP 1: assimp is not installed (assimp-utils)"),
            Some(info) => {
                let info = info.unwrap();
                let bounds = asset.rest_bounds();
                assert!((bounds.min - Vec3::from(info.min)).abs().max_element() < 1e-4, "{name}");
                assert!((bounds.max - Vec3::from(info.max)).abs().max_element() < 1e-4, "{name}");
                println!("{name}: assimp {} faces, {} vertices", info.faces, info.vertices);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// The concave polygon: its triangles cover its area once.
#[test]
fn a_concave_polygon_is_triangulated_without_overlap() {
    let Some(folder) = assets(1) else { return };
    let asset = import_path(&ObjImporter, &folder.join("obj/concave_polygon.obj")).unwrap();
    let p = &asset.meshes[0].primitives[0];
    let areas: Vec<f64> = p
        .indices
        .chunks(3)
        .map(|t| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| p.positions[i as usize].as_dvec3());
            (b - a).cross(c - a).x / 2.0
        })
        .collect();
    let text = std::fs::read_to_string(folder.join("obj/concave_polygon.obj")).unwrap();
    let numbers = |l: &str| l.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect::<Vec<f64>>();
    let points: Vec<Vec<f64>> = text.lines().filter(|l| l.starts_with("v ")).map(numbers).collect();
    let face = text.lines().find(|l| l.starts_with("f ")).unwrap();
    let index = |w: &str| w.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
    let vertices: Vec<usize> = face.split_whitespace().skip(1).map(index).collect();
    let n = vertices.len();
    let shoelace: f64 = (0..n)
        .map(|i| {
            let (a, b) = (&points[vertices[i]], &points[vertices[(i + 1) % n]]);
            (a[1] * b[2] - a[2] * b[1]) / 2.0
        })
        .sum();
    let sum: f64 = areas.iter().sum();
    assert!((sum - shoelace).abs() < 1e-6 * shoelace.abs(), "{sum} {shoelace}");
    assert!(areas.iter().all(|a| a * shoelace.signum() >= -1e-9), "{areas:?}");
}

fn size(asset: &Asset) -> Vec3 {
    let bounds = asset.rest_bounds();
    bounds.max - bounds.min
}

fn triangles(asset: &Asset) -> usize {
    asset.meshes.iter().flat_map(|m| &m.primitives).map(|p| p.indices.len() / 3).sum()
}

/// The barrel as OBJ and as glTF: one size, one number of triangles, the same texture coordinates at every face vertex. (The chests
/// are two models: the OBJ has the body alone.)
#[test]
fn the_barrel_is_equal_in_two_formats() {
    let Some(folder) = assets(1).map(|f| f.join("same-model-3-formats")) else { return };
    let obj = import_path(&ObjImporter, &folder.join("barrel_large_decorated.obj")).unwrap();
    let gltf =
        import_path(&import_gltf::GltfImporter, &folder.join("barrel_large_decorated.gltf.glb")).unwrap();
    let (a, b) = (obj.rest_bounds(), gltf.rest_bounds());
    assert!(
        (a.min - b.min).abs().max_element() < 2e-6 && (a.max - b.max).abs().max_element() < 2e-6,
        "{a:?} {b:?}"
    );
    assert_eq!(triangles(&obj), triangles(&gltf));
    // Every vertex is among the other's, with its texture coordinate; not so with v turned over.
    let (a, b) = (&obj.meshes[0].primitives[0], &gltf.meshes[0].primitives[0]);
    let apart = |turn: bool| {
        let lost = |i: &usize| {
            let (v, mut t) = (a.positions[*i], a.uvs[0][*i]);
            t.y = if turn { 1.0 - t.y } else { t.y };
            let near = |k: usize| {
                (b.positions[k] - v).abs().max_element() < 1e-3
                    && (b.uvs[0][k] - t).abs().max_element() < 1e-3
            };
            !(0..b.positions.len()).any(near)
        };
        (0..a.positions.len()).filter(lost).count()
    };
    assert_eq!(apart(false), 0);
    assert!(apart(true) > a.positions.len() / 2);
}

/// The spider as OBJ (+Y up) and as STL (+Z up, centered, smaller): as many triangles, one shape.
#[test]
fn the_spider_is_equal_in_two_formats() {
    let Some(folder) = assets(1) else { return };
    let obj = import_path(&ObjImporter, &folder.join("obj/spider.obj")).unwrap();
    let stl = import_path(&import_stl::StlImporter, &folder.join("stl/Spider_binary.stl")).unwrap();
    assert_eq!(triangles(&obj), triangles(&stl));
    let ratio = size(&obj) / size(&stl);
    assert!((ratio - ratio.x).abs().max_element() < ratio.x * 1e-4, "{ratio}");
}
