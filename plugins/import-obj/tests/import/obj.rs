//! Imports of OBJ and MTL files.

use choreo_asset::{AlphaMode, Asset, Shading, Topology, Wrap};
use choreo_importer_kit_testing::{Companions, asset_rules, import, options, source, warnings};
use choreo_plugin::{Claim, ImportScope, Importer, OptionValue};
use glam::{Vec2, Vec3, Vec4};
use import_obj::ObjImporter;

const ROOM: &str = include_str!("../data/room.obj");
const ROOM_MTL: &str = include_str!("../data/room.mtl");

/// A BMP of one color, 2 × 2.
fn png_of_color(rgb: [u8; 3]) -> Vec<u8> {
    let mut out = b"BM".to_vec();
    let row = [rgb[2], rgb[1], rgb[0], rgb[2], rgb[1], rgb[0], 0, 0];
    out.extend(70u32.to_le_bytes());
    out.extend([0; 4]);
    for word in [54u32, 40, 2, 2, 1 | 24 << 16, 0, 16, 2835, 2835, 0, 0] {
        out.extend(word.to_le_bytes());
    }
    out.extend(row.repeat(2));
    out
}

fn companions() -> Companions {
    Companions::of(vec![
        ("room.mtl", ROOM_MTL.into()),
        ("wall paper.png", png_of_color([255, 0, 0])),
        ("bumps.png", png_of_color([128, 128, 255])),
    ])
}

fn room() -> Asset {
    import(&ObjImporter, &source("room.obj", ROOM), &companions(), ImportScope::ALL).unwrap()
}

fn read(text: &str) -> Asset {
    let asset = import(&ObjImporter, &source("x.obj", text), &Companions::none(), ImportScope::ALL).unwrap();
    asset_rules::check("x.obj", &asset);
    asset
}

#[test]
fn groups_are_nodes_and_materials_primitives() {
    let asset = room();
    asset_rules::check("room.obj", &asset);
    assert_eq!(asset.skeleton.names(), ["room", "left", "right", "ceiling"]);
    let nodes: Vec<(u32, usize)> =
        asset.instances.iter().map(|i| (i.joint, asset.meshes[i.mesh as usize].primitives.len())).collect();
    assert_eq!(nodes, [(1, 2), (2, 1), (3, 3)]);
    let wall = &asset.meshes[0].primitives[0];
    assert_eq!((wall.positions.len(), wall.indices.as_slice()), (4, &[0, 1, 2, 0, 2, 3][..]));
    // v runs from the top here.
    assert_eq!(wall.uvs[0][1], Vec2::new(1.0, 1.0));
    assert_eq!(wall.normals, [Vec3::Z; 4]);
    // Counted from the end, the same triangle as 1 2 3.
    let metal = &asset.meshes[0].primitives[1];
    assert_eq!(metal.positions, [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 2.0, 0.0)]);
    assert!(!metal.tangents.is_empty(), "its material has a normal map");
    // The ceiling is dented: (1, 0.5) lies above the line from (0, 0) to (2, 0).
    let ceiling = &asset.meshes[2].primitives;
    let kinds: Vec<Topology> = ceiling.iter().map(|p| p.topology).collect();
    assert_eq!(kinds, [Topology::Triangles, Topology::Lines, Topology::Points]);
    let dented = &ceiling[0];
    let area: f32 = dented
        .indices
        .chunks(3)
        .map(|t| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| dented.positions[i as usize]);
            let z = (b - a).cross(c - a).z / 2.0;
            assert!(z > 0.0, "turned over");
            z
        })
        .sum();
    assert_eq!(area, 3.5);
    assert_eq!((ceiling[1].indices.len(), ceiling[2].indices.len()), (4, 2));
}

#[test]
fn materials_and_texture_options_are_imported() {
    let asset = room();
    let by_name = |name: &str| asset.materials.iter().find(|m| m.name == name).unwrap();
    let wall = by_name("wall");
    assert_eq!(wall.shading, Shading::BlinnPhong);
    // sRGB to linear, and 0.5 (linear 0.214) at the peak of a highlight normalized by (92 + 8) / 8.
    assert!((wall.base_color - Vec4::new(0.214_041, 0.050_876, 1.0, 1.0)).length() < 1e-5);
    assert!((wall.specular_color.x - 0.214_041 * 0.08).abs() < 1e-6);
    assert_eq!(wall.shininess, 92.0);
    let map = wall.base_color_texture.as_ref().unwrap();
    assert_eq!(asset.images[map.image as usize].name, "wall paper.png");
    assert_eq!(asset.images[map.image as usize].rgba[..4], [255, 0, 0, 255]);
    assert_eq!((map.sampler.wrap_u, map.sampler.wrap_v), (Wrap::ClampToEdge, Wrap::ClampToEdge));
    // v of the file 0.5 is looked up at 0.5 · 3 + 0.5 from the bottom.
    let at = map.uv_transform.transform_point2(Vec2::new(0.5, 1.0 - 0.5));
    assert!((at - Vec2::new(1.25, 1.0 - 2.0)).length() < 1e-6, "{at}");

    let glass = by_name("glass");
    assert_eq!(
        (glass.base_color.w, glass.alpha_mode, glass.specular_color),
        (0.25, AlphaMode::Blend, Vec3::ZERO)
    );
    let metal = by_name("metal");
    assert_eq!((metal.shading, metal.metallic, metal.roughness), (Shading::MetallicRoughness, 1.0, 0.25));
    assert!((metal.emissive.y - 0.214_041).abs() < 1e-5 && metal.normal_scale == 0.5);
    assert!(metal.normal_texture.is_some());
    // A bump map that holds directions.
    let rough = by_name("rough");
    assert_eq!((rough.normal_texture.is_some(), rough.normal_scale), (true, 2.0));
    assert_eq!(
        warnings(&asset),
        [
            "room.mtl: not used: aniso",
            "room.mtl line 17: map_d \"mask.png\" is not the file of map_Kd; only its alpha channel can be used, so it is left out",
            "f: 1 face without normals; edges of up to 30° are smooth (option smooth)",
            "material \"rough\": the bump map \"bumps.png\" looks like a normal map and is used as one",
        ]
    );
}

#[test]
fn colors_of_blender_and_of_options_are_linear() {
    let text = ROOM.replace("made by hand", "Blender 3.6");
    let asset = import(&ObjImporter, &source("room.obj", text), &companions(), ImportScope::ALL).unwrap();
    assert_eq!(asset.materials[0].base_color, Vec4::new(0.5, 0.25, 1.0, 1.0));
    let linear = options(&ObjImporter, &[("colors", OptionValue::Text("linear".into()))]);
    let asset =
        ObjImporter.import(&source("room.obj", ROOM), &companions(), ImportScope::ALL, &linear).unwrap();
    assert_eq!(asset.materials[0].base_color, Vec4::new(0.5, 0.25, 1.0, 1.0));
}

#[test]
fn parts_outside_the_import_scope_are_not_read() {
    let read = |needs: ImportScope| {
        let files = companions();
        let asset = import(&ObjImporter, &source("room.obj", ROOM), &files, needs).unwrap();
        (asset.meshes.len(), asset.images.len(), files.reads())
    };
    assert_eq!(read(ImportScope::ALL), (3, 2, 3));
    assert_eq!(
        read(ImportScope { geometry: true, clips: true, textures: false, pixels: false, image_files: false }),
        (3, 0, 1)
    );
    assert_eq!(
        read(ImportScope {
            geometry: false,
            clips: true,
            textures: false,
            pixels: false,
            image_files: false
        }),
        (0, 0, 1)
    );
}

#[test]
fn vertex_colors_are_imported() {
    let asset = read("v 0 0 0 1 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nf 1 2 3\n");
    let p = &asset.meshes[0].primitives[0];
    assert_eq!((p.colors[0], p.colors[2]), (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::ONE));
    assert!((p.colors[1].x - 0.214_041).abs() < 1e-5);
    assert_eq!(asset.materials[0].base_color, Vec4::ONE);
    let weights = read("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n");
    assert!(weights.meshes[0].primitives[0].colors.is_empty(), "w is no color");
}

/// Cases that `tobj` alone would fill from the vertex before, scale, refuse or leave out.
#[test]
fn vertices_have_the_attributes_of_the_file() {
    let triangle = "v 0 0 0\nv 1 0 0 2\nv 0 1 0\nvt 0.25\nvt 0.5 0.5\nvn 0 0 1\n";
    // A face vertex without texture coordinate beside others that have one; one number is u alone; a fourth coordinate scales nothing.
    let asset = read(&format!("{triangle}f 1/1 2 3/2 # a comment\n"));
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(p.uvs[0], [Vec2::new(0.25, 1.0), Vec2::new(0.0, 1.0), Vec2::splat(0.5)]);
    // A face vertex without normal: the face's are made.
    let asset = read(&format!("{triangle}f 1//1 2 3//1\nf 1//1 3//1 2//1\n"));
    let primitives = &asset.meshes[0].primitives;
    assert_eq!((primitives.len(), primitives[0].normals[1]), (2, Vec3::Z));
    assert_eq!(
        warnings(&asset)[0],
        "f: 1 face without normals; edges of up to 30° are smooth (option smooth)"
    );
    // Faces before their vertices, a group between; equal face vertices are one vertex, whatever refers to them.
    let asset = read("f 1 2 3\ng a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf -3 -1 -2\nf 2 4 3\n");
    let sizes: Vec<_> = asset
        .meshes
        .iter()
        .map(|m| (m.primitives[0].positions.len(), m.primitives[0].indices.len()))
        .collect();
    assert_eq!(sizes, [(3, 3), (3, 6)]);
    // A color on some vertices alone, with and without alpha.
    let asset = read("v 0 0 0 0 1 0 1\nv 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n");
    let colors = &asset.meshes[0].primitives[0].colors;
    assert_eq!(colors.iter().map(|c| c.truncate()).collect::<Vec<_>>(), [Vec3::Y, Vec3::ONE, Vec3::X]);
    // An element that is left out refers to nothing.
    assert_eq!(warnings(&read(&format!("{triangle}f 1 2 3\nf 9/9 9\n"))).len(), 2);
}

/// Two faces at a right angle along an edge, and a third that goes on flat from the second.
const FOLD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 1 -1\nv 1 1 -1\nv 1 1 -2\nv 0 1 -2\n";

#[test]
fn missing_normals_by_angle_and_by_smoothing_group() {
    let folded = |faces: &str| read(&format!("{FOLD}{faces}"));
    let normals = |a: &Asset, at: Vec3| -> Vec<Vec3> {
        let p = &a.meshes[0].primitives[0];
        (0..p.positions.len()).filter(|i| p.positions[*i] == at).map(|i| p.normals[i]).collect()
    };
    let edge = Vec3::new(0.0, 1.0, 0.0);
    let by_angle = folded("f 1 2 3 4\nf 4 3 6 5\nf 5 6 7 8\n");
    let mut sharp = normals(&by_angle, edge);
    sharp.sort_by(|a, b| a.y.total_cmp(&b.y));
    assert_eq!(sharp, [Vec3::Z, Vec3::Y]);
    assert_eq!(by_angle.meshes[0].primitives[0].positions.len(), 10);
    let groups = folded("s 1\nf 1 2 3 4\nf 4 3 6 5\ns off\nf 5 6 7 8\n");
    assert!(normals(&groups, edge).iter().all(|n| n.y > 0.4 && n.z > 0.4), "{:?}", normals(&groups, edge));
    assert_eq!(normals(&groups, Vec3::new(0.0, 1.0, -2.0)), [Vec3::Y]);
    assert_eq!(warnings(&groups), ["f: 3 faces without normals; they are made from the smoothing groups"]);
}

#[test]
fn missing_libraries_and_materials_are_warnings() {
    let text = "mtllib a b.mtl\nusemtl gold\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\nvp 1 2\nfoo\nfoo\n";
    let said = warnings(&read(text));
    assert_eq!(
        said[..5],
        [
            "line 7: 1 face with fewer than three vertices (or lines with fewer than two) left out",
            "line 9: \"foo\": is not known; 2 such lines are left out",
            "line 8: \"vp\": free-form curves and surfaces are not supported; it is left out",
            "line 1: material library \"a\" is not beside the file or in its textures/, images/, maps/; give its folder with --search",
            "line 1: material library \"b.mtl\" is not beside the file or in its textures/, images/, maps/; give its folder with --search",
        ]
    );
    assert!(said[5].starts_with("line 2: material \"gold\" is in none"));
    // No mtllib, but a library of the same name beside it.
    let files = Companions::of(vec![("x.mtl", b"newmtl gold\nKd 1 1 0\n".to_vec())]);
    let text = "usemtl gold\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let asset = import(&ObjImporter, &source("x.obj", text), &files, ImportScope::ALL).unwrap();
    assert_eq!(asset.materials[0].base_color, Vec4::new(1.0, 1.0, 0.0, 1.0));
    assert!(warnings(&asset)[0].starts_with("mtllib: the file names no material library"));
}

#[test]
fn options_set_units_and_axes() {
    let given = [("scale", OptionValue::Number(0.01)), ("up", OptionValue::Text("z".into()))];
    let options = options(&ObjImporter, &given);
    let text = "v 100 200 300\nv 200 200 300\nv 100 200 400\nf 1 2 3\n";
    let asset =
        ObjImporter.import(&source("x.obj", text), &Companions::none(), ImportScope::ALL, &options).unwrap();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.positions[0], Vec3::new(1.0, 3.0, -2.0));
    // −Y of the file, towards the viewer.
    assert!((p.normals[0] - Vec3::Z).length() < 1e-6, "{}", p.normals[0]);
}

#[test]
fn files_are_claimed_by_content() {
    let claim = |name: &str, text: &str| ObjImporter.claim(&source(name, text));
    assert_eq!(claim("x", ROOM), Claim::Content(40));
    assert_eq!(claim("x.obj", "what"), Claim::Extension);
    for other in
        ["HIERARCHY\nROOT a", "solid x\nfacet normal 0 0 1", "{\"asset\":{}}", "v is a letter", "", "ply\n"]
    {
        assert_eq!(claim("x.txt", other), Claim::NotMine, "{other}");
    }
}

/// A triangle of each of a library's materials.
fn with_library(mtl: &str) -> Asset {
    let names = mtl.lines().filter_map(|line| line.strip_prefix("newmtl "));
    let faces: String = names.map(|name| format!("usemtl {name}\nf 1/1/1 2/1/1 3/1/1\n")).collect();
    let text = format!("mtllib x.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n{faces}");
    let files = Companions::of(vec![
        ("x.mtl", mtl.into()),
        ("a.png", png_of_color([9, 9, 9])),
        ("b.png", png_of_color([5; 3])),
    ]);
    import(&ObjImporter, &source("x.obj", text), &files, ImportScope::ALL).unwrap()
}

#[test]
fn reflections_by_model_map_and_panorama() {
    let asset = with_library(
        "newmtl none\nKs 0.5 0.5 0.5\nillum 2\n\
         newmtl mirror\nKs 1 0.5 0\nNs 500\nillum 3\n\
         newmtl map\nKs 0.5 0.5 0.5\nrefl -s 2 2 a.png\n\
         newmtl ball\nKs 1 1 1\nrefl -type sphere -clamp on b.png\n\
         newmtl metal\nPm 1\nrefl a.png\n\
         newmtl box\nrefl -type cube_top a.png\nmap_refl -type cube_left b.png\n\
         newmtl odd\nrefl -type plane a.png\n",
    );
    let of = |name: &str| asset.materials.iter().find(|m| m.name == name).unwrap().reflection.as_deref();
    for name in ["none", "metal", "box", "odd"] {
        assert_eq!(of(name), None, "{name}");
    }
    let mirror = of("mirror").unwrap();
    assert!((mirror.color - Vec3::new(1.0, 0.214_041, 0.0)).length() < 1e-5, "{}", mirror.color);
    assert!(mirror.texture.is_none() && mirror.environment.is_none());
    let map = of("map").unwrap();
    assert_eq!((map.color, map.environment.is_none()), (Vec3::ONE, true));
    assert_eq!(map.texture.as_ref().unwrap().uv_transform.matrix2.x_axis.x, 2.0);
    let ball = of("ball").unwrap();
    assert_eq!((ball.color, ball.texture.is_none()), (Vec3::ONE, true));
    let around = ball.environment.as_ref().unwrap();
    assert_eq!((around.sampler.wrap_u, around.sampler.wrap_v), (Wrap::Repeat, Wrap::ClampToEdge));
    assert_eq!(
        warnings(&asset),
        [
            "x.mtl line 18: \"refl\": -type cube_top is a side of a cube map; only a panorama, -type sphere, can be used for reflections; it is left out",
            "x.mtl line 21: \"refl\": -type plane is neither sphere nor a side of a cube map; it is left out",
            "x.mtl line 14: \"metal\" has Pr or Pm, which set its reflections; its refl is left out",
        ]
    );
}
