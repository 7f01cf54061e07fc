//! One of everything, from the project's own sample `data/flag.fbx` (inches, +Z up), against closed forms.

use crate::common;
use choreo_asset::{AlphaMode, Asset, LightKind, Primitive, Projection, Shading};
use choreo_importer_kit_testing::{Companions, asset_rules, import, warnings};
use choreo_motion::{Interpolation, Path, PropertyTarget, Time};
use choreo_plugin::ImportScope;
use glam::{DVec3, Vec3};
use import_fbx::FbxImporter;
use std::f32::consts::PI;

const INCH: f64 = 0.0254;

fn stripes() -> Vec<u8> {
    let mut png = Vec::new();
    let picture = image::RgbaImage::from_pixel(2, 1, image::Rgba([9, 8, 7, 255]));
    picture.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    png
}

fn import_flag(needs: ImportScope) -> (Asset, Companions) {
    let files = Companions::of(vec![("stripes.png", stripes())]);
    let asset = import(&FbxImporter, &common::source("flag.fbx", common::own()), &files, needs).unwrap();
    (asset, files)
}

fn all() -> Asset {
    let asset = import_flag(ImportScope::ALL).0;
    asset_rules::check("flag.fbx", &asset);
    asset
}

/// Inches, +Z up, to metres, +Y up.
fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, z, -y) * INCH
}

fn joint(asset: &Asset, name: &str) -> u32 {
    asset.skeleton.names().iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name}")) as u32
}

/// A joint's place in the model, at rest or at a time of the clip.
fn place(asset: &Asset, name: &str, secs: Option<f64>) -> DVec3 {
    let clip = secs.map(|s| (&*asset.clips[0], s));
    let (model, _) = common::pose(asset, clip);
    Vec3::from(model[joint(asset, name) as usize].translation).as_dvec3()
}

#[track_caller]
fn assert_near(a: DVec3, b: DVec3) {
    assert!(a.distance(b) < 1e-6, "{a} is not {b}");
}

fn primitive<'a>(asset: &'a Asset, material: &str) -> &'a Primitive {
    let named = |p: &&Primitive| p.material.is_some_and(|m| asset.materials[m as usize].name == material);
    asset.meshes.iter().find(|m| m.name == "flag").unwrap().primitives.iter().find(named).unwrap()
}

#[test]
fn units_and_axes_are_converted_and_reported() {
    let asset = all();
    assert_eq!(asset.origin.format, "FBX 7.4 text");
    assert_eq!(asset.origin.writer, "choreo, by hand");
    assert_eq!(asset.origin.up, "+Z");
    assert!((asset.origin.metres_per_unit.unwrap() - INCH).abs() < 1e-12);
    assert_near(place(&asset, "pole", None), at(0.0, 0.0, 10.0));
    assert_near(place(&asset, "bone7", None), at(70.0, 0.0, 10.0));
}

/// Translation · pivot · pre-rotation · rotation · pivot⁻¹.
#[test]
fn pivots_and_pre_rotation_are_applied() {
    assert_near(place(&all(), "hand", None), at(11.0, 2.0, 13.0));
}

/// A parent's scale moves the child's origin, but does not scale it.
#[test]
fn uninherited_scale_moves_but_does_not_scale_children() {
    let asset = all();
    assert_near(place(&asset, "free", None), at(2.0, 3.0, 4.0));
    assert_near(place(&asset, "tip", None), at(2.0, 3.0, 9.0));
}

#[test]
fn a_concave_face_is_cut_into_triangles_inside_it() {
    let asset = all();
    let p = primitive(&asset, "glass");
    assert_eq!(p.indices.len(), 4 * 3);
    let mut area = 0.0;
    for t in p.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| p.positions[i as usize].as_dvec3() / INCH);
        area += (b - a).cross(c - a).length() / 2.0;
        let middle = (a + b + c) / 3.0;
        // The hexagon lies in the xz plane of the mesh's own axes; the geometric translation lifts it.
        let (x, z) = (middle.x, middle.z + 40.0 - 5.0);
        assert!(x < 10.0 || z < 10.0, "{middle}");
    }
    assert!((area - 500.0).abs() < 1e-3, "{area}");
}

#[test]
fn geometric_translation_moves_the_mesh_alone() {
    let asset = all();
    let vertices = common::posed_vertices(&asset, None);
    let has = |p: DVec3| vertices.iter().any(|v| v.distance(p) < 1e-6);
    assert!(has(at(0.0, 0.0, 5.0)) && has(at(100.0, 0.0, 25.0)));
    assert!(!has(at(0.0, 0.0, 0.0)));
    assert_near(place(&asset, "flag", None), DVec3::ZERO);
}

#[test]
fn ten_influences_become_eight() {
    let asset = all();
    let p = primitive(&asset, "cloth");
    assert_eq!(p.influences, 8);
    let many = p.joint_weights.chunks_exact(8).find(|w| w[7] > 0.0).unwrap();
    let expected: Vec<f32> = (0..8).map(|b| (0.19 - 0.02 * b as f32) / 0.96).collect();
    assert!(many.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{many:?} {expected:?}");
    let told = warnings(&asset);
    let wanted = "1 of 28 points have more than 8 influences, up to 10; the 8 largest are kept and stretched to 1, at worst 4.00 % of the weight is lost";
    assert!(told.iter().any(|w| w.ends_with(wanted)), "{told:#?}");
    assert!(
        told.iter().any(|w| w.ends_with("6 of 28 points have no influence; they follow the mesh's node")),
        "{told:#?}"
    );
}

#[test]
fn in_between_shapes_become_separate_morph_targets() {
    let asset = all();
    let mesh = asset.meshes.iter().find(|m| m.name == "flag").unwrap();
    assert_eq!(mesh.morph_names, ["bulge (50 %)", "bulge"]);
    let flag = asset.instances.iter().position(|i| i.joint == joint(&asset, "flag")).unwrap();
    // The channel runs from 0 to 100 percent in two seconds; halfway the first shape is whole.
    for (secs, first, second) in
        [(0.0, 0.0, 0.0), (0.5, 0.5, 0.0), (1.0, 1.0, 0.0), (1.5, 0.5, 0.5), (2.0, 0.0, 1.0)]
    {
        let (_, weights) = common::pose(&asset, Some((&asset.clips[0], secs)));
        let expected = [first, second];
        assert!(
            weights[flag].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6),
            "{secs}: {:?}",
            weights[flag]
        );
    }
    let moved = mesh.primitives[0].morphs[0].positions.iter().filter(|o| **o != Vec3::ZERO).count();
    assert_eq!(moved, 2);
    // The hexagon is not moved: it holds no offsets.
    assert!(primitive(&asset, "glass").morphs.iter().all(|m| m.positions.is_empty()));
}

#[test]
fn empty_stacks_are_left_out_with_a_note() {
    let asset = all();
    let names: Vec<&str> = asset.clips.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["wave"]);
    assert_eq!(asset.clips[0].duration.as_secs(), 2.0);
    assert!(warnings(&asset).iter().any(|w| w == "animstack \"Take 001\": moves nothing and is left out"));
}

#[test]
fn stepped_curves_keep_their_steps() {
    let asset = all();
    let wide = joint(&asset, "wide");
    let of = |path| asset.clips[0].curves().iter().find(|c| c.joint == wide && c.path == path).unwrap();
    let curve = of(Path::Translation);
    assert_eq!(curve.interpolation, Interpolation::Step);
    let times: Vec<f64> = curve.times.iter().map(|t| t.as_secs()).collect();
    assert_eq!(times, [0.0, 0.5, 1.0, 1.5]);
    let x: Vec<f64> = curve.values.chunks(3).map(|v| (f64::from(v[0]) / INCH).round()).collect();
    assert_eq!(x, [0.0, 5.0, -5.0, 7.0]);
}

#[test]
fn curves_that_repeat_beyond_their_keys() {
    let asset = all();
    for (secs, z) in [(0.25, 14.0), (0.5, 10.0), (1.25, 14.0), (1.5, 10.0)] {
        assert_near(place(&asset, "pole", Some(secs)), at(0.0, 0.0, z));
    }
    assert!(
        warnings(&asset)
            .iter()
            .any(|w| w.contains("\"pole\": repeats beyond its keys, and is sampled 24 times a second"))
    );
}

#[test]
fn keys_outside_the_stack_are_cut() {
    let asset = all();
    assert_near(place(&asset, "eye", Some(0.0)), at(0.0, -200.0, 50.0));
    assert_near(place(&asset, "eye", Some(1.0)), at(10.0, -200.0, 50.0));
    assert_near(place(&asset, "eye", Some(2.0)), at(20.0, -200.0, 50.0));
    assert_near(place(&asset, "eye", Some(9.0)), at(20.0, -200.0, 50.0));
}

#[test]
fn one_mesh_with_two_materials_and_a_hidden_one() {
    let asset = all();
    let material = |node: &str| {
        let joint = joint(&asset, node);
        let instance = asset.instances.iter().find(|i| i.joint == joint)?;
        let mesh = &asset.meshes[instance.mesh as usize];
        assert_eq!(mesh.primitives[0].indices.len(), 36);
        Some(asset.materials[mesh.primitives[0].material? as usize].name.clone())
    };
    assert_eq!(material("left").unwrap(), "cloth");
    assert_eq!(material("right").unwrap(), "glass");
    assert_eq!(material("spare"), None);
    assert!(warnings(&asset).iter().any(|w| w.starts_with("node \"spare\": its mesh is hidden in the file")));
}

#[test]
fn fbx_materials_are_imported() {
    let asset = all();
    let named = |name: &str| asset.materials.iter().find(|m| m.name == name).unwrap();
    let cloth = named("cloth");
    assert_eq!(cloth.shading, Shading::BlinnPhong);
    // A texture replaces the color.
    assert_eq!(cloth.base_color.to_array(), [1.0, 1.0, 1.0, 1.0]);
    assert_eq!(cloth.shininess, 64.0);
    assert!((cloth.specular_color.x - 0.5 * 8.0 / 72.0).abs() < 1e-6);
    let glass = named("glass");
    assert!((glass.base_color.w - 0.25).abs() < 1e-6);
    assert_eq!((glass.alpha_mode, glass.specular_color), (AlphaMode::Blend, Vec3::ZERO));
}

#[test]
fn textures_are_found_beside_the_file_or_embedded_or_reported_missing() {
    let (asset, _) = import_flag(ImportScope::ALL);
    let names: Vec<&str> = asset.images.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["stripes.png", "glow.png"]);
    assert_eq!((asset.images[0].width, asset.images[0].rgba[..4].to_vec()), (2, vec![9, 8, 7, 255]));
    assert_eq!(
        (asset.images[1].width, asset.images[1].rgba[..8].to_vec()),
        (2, vec![255, 255, 255, 255, 255, 0, 0, 255])
    );
    let told = warnings(&asset);
    let wanted = "texture \"lost\": \"lost.png\" is not beside the file or in its textures/, images/, maps/; give its folder with --search";
    assert!(told.iter().any(|w| w == wanted), "{told:#?}");
    let emissive = asset.materials.iter().find_map(|m| m.emissive_texture.as_ref()).unwrap();
    assert_eq!(emissive.uv_set, 1);
    let p = primitive(&asset, "glass");
    // v points up in the file, down here; the second set is twice the first.
    for (a, b) in p.uvs[0].iter().zip(&p.uvs[1]) {
        assert!((b.x - 2.0 * a.x).abs() < 1e-5 && ((1.0 - b.y) - 2.0 * (1.0 - a.y)).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn colors_of_vertices_are_srgb() {
    let asset = all();
    let color = primitive(&asset, "cloth").colors[0];
    assert!((color.truncate() - Vec3::new(1.0, 0.214041, 0.050876)).length() < 1e-5, "{color}");
}

#[test]
fn missing_normals_are_computed() {
    let asset = all();
    let p = primitive(&asset, "cloth");
    // The flag is flat: every normal is the plane's, −Y in the file.
    assert!(p.normals.iter().all(|n| n.y.abs() > 0.999), "{:?}", p.normals);
}

#[test]
fn lights_and_cameras_are_imported() {
    let asset = all();
    let lamp = &asset.lights[0];
    let LightKind::Spot { inner, outer } = lamp.light.kind else { panic!("{:?}", lamp.light.kind) };
    assert!((inner - PI / 12.0).abs() < 1e-6 && (outer - PI / 6.0).abs() < 1e-6);
    assert!(
        (lamp.light.intensity - PI * 100.0 * (INCH * INCH) as f32).abs() < 1e-5,
        "{}",
        lamp.light.intensity
    );
    let (model, _) = common::pose(&asset, None);
    let looks = |joint: u32| model[joint as usize].transform_vector3(Vec3::NEG_Z);
    // FBX's lights shine along −Y, its cameras look along +X.
    assert!((looks(lamp.joint) - Vec3::Z).length() < 1e-5, "{}", looks(lamp.joint));
    let eye = &asset.cameras[0];
    assert!((looks(eye.joint) - Vec3::X).length() < 1e-5, "{}", looks(eye.joint));
    let Projection::Perspective { yfov, near, far } = eye.projection else { panic!() };
    assert!((yfov.to_degrees() - 40.0).abs() < 1e-3, "{}", yfov.to_degrees());
    assert!((near - 0.0254).abs() < 1e-6 && (far.unwrap() - 25.4).abs() < 1e-4);
    // The intensity goes from zero to its value at rest in a second.
    let mut at = [0.0];
    assert!(asset.clips[0].sample_property(
        PropertyTarget::LightIntensity(0),
        Time::from_secs(0.25),
        &mut at
    ));
    assert!((at[0] / lamp.light.intensity - 0.25).abs() < 1e-6, "{at:?}");
    assert!(!warnings(&asset).iter().any(|w| w.contains("animates")), "{:?}", warnings(&asset));
}

#[test]
fn parts_outside_the_import_scope_are_not_read() {
    let (whole, files) = import_flag(ImportScope::ALL);
    assert!(files.reads() > 0);
    let (clips, files) = import_flag(ImportScope {
        geometry: false,
        clips: true,
        textures: false,
        pixels: false,
        image_files: false,
    });
    assert_eq!(
        (clips.meshes.len(), clips.instances.len(), clips.skins.len(), clips.images.len()),
        (0, 0, 0, 0)
    );
    assert_eq!(files.reads(), 0);
    assert_eq!(clips.skeleton, whole.skeleton);
    assert_eq!(clips.clips[0].curves(), whole.clips[0].curves());
    let (still, _) = import_flag(ImportScope {
        geometry: true,
        clips: false,
        textures: false,
        pixels: false,
        image_files: false,
    });
    assert_eq!((still.clips.len(), still.images.len()), (0, 0));
    assert_eq!(still.meshes[0].primitives[0].positions, whole.meshes[0].primitives[0].positions);
}

#[test]
fn clips_outside_the_import_scope_keep_only_their_names() {
    let all = all();
    let import = |played| {
        let files = Companions::playing(played);
        import(&FbxImporter, &common::source("flag.fbx", common::own()), &files, ImportScope::ALL).unwrap()
    };
    // "Take 001" moves nothing and is left out, but that is known only once it is decoded.
    let names = |asset: &Asset| asset.clips.iter().map(|clip| clip.name.clone()).collect::<Vec<_>>();
    let [none, one] = [import("none of them"), import("wave")];
    assert_eq!((names(&none), names(&one)), (vec!["Take 001".into(), "wave".into()], names(&none)));
    assert!(none.clips.iter().all(|clip| clip.curves().is_empty() && clip.properties().len() == 0));
    assert_eq!(one.clips[1].curves(), all.clips[0].curves());
    assert!(!all.clips[0].curves().is_empty() && one.clips[0].curves().is_empty());
}
