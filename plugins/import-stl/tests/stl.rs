//! Imports of STL files, good and bad.

use choreo_asset::Asset;
use choreo_importer_kit_testing::{
    Companions, asset_rules, assets, assimp, damage, error_text, import, import_bytes, import_path, options,
    source, warnings,
};
use choreo_plugin::{Claim, ImportError, ImportScope, Importer, OptionValue};
use glam::{Vec3, Vec4};
use import_stl::StlImporter;

const TWO: &str = include_str!("data/two_solids.stl");

/// A tetrahedron with an attribute word for each of its four triangles.
fn binary(header: &[u8], attributes: [u16; 4]) -> Vec<u8> {
    let points = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut out = header.to_vec();
    out.resize(80, 0);
    out.extend(4u32.to_le_bytes());
    for (triangle, attribute) in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].iter().zip(attributes) {
        out.extend([0u8; 12]);
        triangle.iter().flat_map(|i: &usize| points[*i]).for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(attribute.to_le_bytes());
    }
    out
}

fn read(bytes: impl Into<Vec<u8>>) -> Result<Asset, ImportError> {
    import_bytes(&StlImporter, "part.stl", bytes)
}

fn with(bytes: impl Into<Vec<u8>>, given: &[(&str, OptionValue)]) -> Asset {
    let options = options(&StlImporter, given);
    StlImporter.import(&source("part.stl", bytes), &Companions::none(), ImportScope::ALL, &options).unwrap()
}

#[test]
fn solids_become_nodes_z_up_and_flat() {
    let asset = read(TWO).unwrap();
    asset_rules::check("two", &asset);
    assert_eq!(asset.skeleton.names(), ["part", "roof", "solid 1"]);
    assert_eq!(asset.skeleton.parents(), [None, Some(0), Some(0)]);
    let roof = &asset.meshes[0].primitives[0];
    assert_eq!(roof.positions[2], Vec3::new(4.0, 4.0, -3.0));
    assert_eq!(roof.indices, [0, 1, 2, 3, 4, 5]);
    // (0, −0.8, 0.6) in the file's axes.
    assert!(
        roof.normals.iter().all(|n| (*n - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6),
        "{:?}",
        roof.normals
    );
    assert_eq!(
        warnings(&asset),
        [
            "solid: the format has no unit; taken as 1 m by its extent of 6 (option scale: metres a unit)",
            "solid \"solid 1\": 1 of 1 facets with a normal against the order of their vertices; the order is used",
        ]
    );
    let y = with(TWO, &[("up", OptionValue::Text("y".into())), ("scale", OptionValue::Number(0.5))]);
    assert_eq!(y.meshes[0].primitives[0].positions[2], Vec3::new(2.0, 1.5, 2.0));
    assert_eq!((y.origin.metres_per_unit, y.origin.up.as_str()), (Some(0.5), "+Y"));
}

#[test]
fn binary_files_that_begin_with_solid_are_detected() {
    let bytes = binary(b"solid exported by something", [0; 4]);
    let asset = read(bytes.clone()).unwrap();
    assert_eq!(asset.origin.format, "binary STL");
    assert_eq!(
        (asset.skeleton.names()[0].as_str(), asset.meshes[0].primitives[0].positions.len()),
        ("solid exported by something", 12)
    );
    assert_eq!(StlImporter.claim(&source("x", bytes)), Claim::Content(70));
    assert_eq!(StlImporter.claim(&source("x", TWO)), Claim::Content(60));
    assert_eq!(StlImporter.claim(&source("x.stl", "junk")), Claim::Extension);
    assert_eq!(StlImporter.claim(&source("x.obj", "v 0 0 0")), Claim::NotMine);
}

#[test]
fn facet_colors_of_viscam_and_magics_are_read() {
    // Red, green, none, white: five bits a channel.
    let viscam = read(binary(b"", [0xFC00, 0x83E0, 0, 0xFFFF])).unwrap();
    let colors =
        |a: &Asset| -> Vec<Vec4> { a.meshes[0].primitives[0].colors.iter().step_by(3).copied().collect() };
    let rgb = |r: f32, g: f32, b: f32| Vec4::new(r, g, b, 1.0);
    assert_eq!(colors(&viscam), [rgb(1.0, 0.0, 0.0), rgb(0.0, 1.0, 0.0), Vec4::ONE, Vec4::ONE]);
    assert!(warnings(&viscam)[0].starts_with("byte 80: 3 facets with a color"), "{:?}", warnings(&viscam));
    let magics = read(binary(b"COLOR=\xFF\x00\xFF\xFF,MATERIAL=", [0x001F, 0x03E0, 0x8000, 0x7C00])).unwrap();
    assert_eq!(
        colors(&magics),
        [rgb(1.0, 0.0, 0.0), rgb(0.0, 1.0, 0.0), rgb(1.0, 0.0, 1.0), rgb(0.0, 0.0, 1.0)]
    );
    assert!(colors(&read(binary(b"", [0; 4])).unwrap()).is_empty());
}

#[test]
fn the_smoothing_option_joins_normals() {
    let smooth = with(binary(b"", [0; 4]), &[("smooth", OptionValue::Number(180.0))]);
    let p = &smooth.meshes[0].primitives[0];
    let at = |v: Vec3| -> Vec<Vec3> {
        (0..p.positions.len()).filter(|i| p.positions[*i] == v).map(|i| p.normals[i]).collect()
    };
    // The three right-angled faces meet at the origin.
    let corner = Vec3::splat(-1.0) / 3f32.sqrt() * Vec3::new(1.0, 1.0, -1.0);
    assert!(at(Vec3::ZERO).iter().all(|n| (*n - corner).length() < 1e-6), "{:?}", at(Vec3::ZERO));
}

#[test]
fn errors_name_the_place() {
    let ascii = |from: &str, to: &str| error_text(read(TWO.replacen(from, to, 1)));
    for (from, to, text) in [
        ("4 3 4", "4 three 4", "line 6: \"three\" is not a finite number"),
        ("4 3 4", "4 1e39 4", "line 6: \"1e39\" is not a finite number"),
        ("4 3 4", "4 3", "line 6: there should be three numbers"),
        ("      vertex 4 3 4\n", "", "line 7: the facet of line 2 has 2 vertices, not 3"),
        ("  endfacet\n", "", "line 8: a facet within the facet of line 2"),
        ("solid roof\n", "solid roof\nendsolid\n", "line 3: a facet outside of a solid"),
        ("outer loop", "inner loop", "line 3: \"inner\" is not an STL keyword"),
        ("  facet normal 0 -0.8 0.6\n", "", "line 3: a vertex outside of a facet"),
        ("  facet normal 0 -0.8 0.6\n", "  endfacet\n", "line 2: endfacet without a facet"),
    ] {
        assert_eq!(ascii(from, to), format!("part.stl: {text}"));
    }
    assert_eq!(
        error_text(read(&TWO[..TWO.find("      vertex 4 3 4").unwrap()])),
        "part.stl: line 5: the file ends within the facet of line 2"
    );
    let mut bytes = binary(b"", [0; 4]);
    assert_eq!(
        error_text(read(&bytes[..200])),
        "part.stl: byte 80: 4 triangles are announced, but the file has room for 2"
    );
    assert_eq!(
        error_text(read("short")),
        "part.stl: byte 0: the file has 5 bytes; a binary STL has at least 84"
    );
    bytes[84 + 50 + 24..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(
        error_text(read(bytes)),
        "part.stl: byte 158: vertex 1 of triangle 1 is [NaN, 0, 0]; only finite numbers are allowed"
    );
    let huge = StlImporter.import(
        &source("part.stl", TWO.replace("4 3 4", "3e38 3 4")),
        &Companions::none(),
        ImportScope::ALL,
        &options(&StlImporter, &[("scale", OptionValue::Number(1e6))]),
    );
    assert!(error_text(huge).starts_with("part.stl: solid \"roof\": is too big"));
}

#[test]
fn ignored_content_is_a_warning() {
    let mut bytes = binary(b"", [0; 4]);
    bytes.extend([1, 2, 3]);
    assert_eq!(
        warnings(&read(bytes).unwrap())[0],
        "byte 284: 3 bytes follow the 4 announced triangles; they are left out"
    );
    let open = TWO.trim_end().strip_suffix("ENDSOLID").unwrap();
    assert!(warnings(&read(open).unwrap())[0].contains("has no endsolid"));
    let quad = TWO.replacen("vertex 4 0 0\n", "vertex 4 0 0\n      vertex 4 1.5 2\n", 1);
    let asset = read(quad).unwrap();
    assert_eq!(asset.meshes[0].primitives[0].indices.len(), 9);
    assert!(warnings(&asset)[0].starts_with("line 2: the facet has 4 vertices"), "{:?}", warnings(&asset));
    let flat = TWO.replacen("vertex 4 3 4", "vertex 2 0 0", 1);
    assert!(warnings(&read(flat).unwrap()).contains(&"solid \"roof\": 1 facet without area".to_string()));
}

#[test]
fn parts_outside_the_import_scope_are_not_created() {
    let needs =
        ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };
    for bytes in [TWO.as_bytes().to_vec(), binary(b"", [0; 4])] {
        let asset = import(&StlImporter, &source("part.stl", bytes), &Companions::none(), needs).unwrap();
        assert_eq!((asset.meshes.len(), asset.materials.len(), asset.instances.len()), (0, 0, 0));
        assert!(!asset.skeleton.is_empty());
    }
}

/// The spider of the samples: ASCII and binary hold the same triangles, as many as assimp counts.
#[test]
fn the_spider() {
    let Some(folder) = assets(3) else { return };
    let read = |n: &str| import_path(&StlImporter, &folder.join("stl").join(n)).unwrap();
    let (ascii, binary) = (read("Spider_ascii.stl"), read("Spider_binary.stl"));
    let (a, b) = (&ascii.meshes[0].primitives[0], &binary.meshes[0].primitives[0]);
    assert_eq!((a.indices.len(), b.indices.len()), (1368 * 3, 1368 * 3));
    // The ASCII file has six digits.
    assert!(a.positions.iter().zip(&b.positions).all(|(a, b)| (*a - *b).abs().max_element() < 1e-5));
    assert_eq!(
        read("triangle_with_two_solids.stl").skeleton.names()[1..],
        ["testTriangle_1", "testTriangle_2"]
    );
    for name in ["Spider_ascii.stl", "Spider_binary.stl", "triangle_with_two_solids.stl"] {
        let asset = read(name);
        asset_rules::check(name, &asset);
        let Some(info) = assimp::info(&folder.join("stl").join(name)) else {
            println!("SKIP 1: assimp is not installed (assimp-utils)");
            continue;
        };
        let info = info.unwrap();
        let triangles: usize =
            asset.meshes.iter().flat_map(|m| &m.primitives).map(|p| p.indices.len() / 3).sum();
        assert_eq!(triangles, info.faces, "{name}");
        let bounds = asset.rest_bounds();
        let scale = asset.origin.metres_per_unit.unwrap() as f32;
        // assimp keeps z up.
        let (min, max) = (Vec3::from(info.min) * scale, Vec3::from(info.max) * scale);
        assert!((bounds.min - Vec3::new(min.x, min.z, -max.y)).abs().max_element() < 1e-4 * scale, "{name}");
        assert!((bounds.max - Vec3::new(max.x, max.z, -min.y)).abs().max_element() < 1e-4 * scale, "{name}");
    }
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    damage::run_cases(&StlImporter, || {
        let mut cases = vec![
            ("two.stl", TWO.as_bytes().to_vec(), 1000),
            ("tetra.stl", binary(b"solid", [0xFC00, 0x83E0, 0, 0xFFFF]), 1000),
        ];
        if let Some(folder) = assets(2) {
            for name in ["Spider_ascii.stl", "Spider_binary.stl"] {
                cases.push((name, std::fs::read(folder.join("stl").join(name)).unwrap(), damage::flips()));
            }
        }
        cases
    });
}
