//! One small file with a skin, two uv sets, a texture, a camera and lights; and changes of it.

use choreo_asset::{AlphaMode, Asset, LightKind, Projection, Shading, Wrap};
use choreo_importer_kit_testing::{
    Companions, asset_rules, error_text, import, import_bytes, pose, source, warnings,
};
use choreo_motion::{Interpolation, Path};
use choreo_plugin::{Claim, ImportScope, Importer};
use glam::{Vec2, Vec3};
use import_collada::ColladaImporter;

const ARM: &str = include_str!("../data/arm.dae");

/// A BMP of one white pixel.
fn test_png() -> Vec<u8> {
    let mut out = b"BM".to_vec();
    out.extend(58u32.to_le_bytes());
    out.extend([0; 4]);
    for word in [54u32, 40, 1, 1, 1 | 24 << 16, 0, 4, 2835, 2835, 0, 0] {
        out.extend(word.to_le_bytes());
    }
    out.extend([255, 255, 255, 0]);
    out
}

fn companions() -> Companions {
    Companions::of(vec![("art/skin 1.png", test_png())])
}

fn read(text: &str) -> Asset {
    let asset = import(&ColladaImporter, &source("arm.dae", text), &companions(), ImportScope::ALL);
    let asset = asset.unwrap_or_else(|e| panic!("{e}"));
    asset_rules::check("arm.dae", &asset);
    asset
}

fn with(changes: &[(&str, &str)]) -> Asset {
    read(&changed(changes))
}

fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(ARM.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

#[test]
fn nodes_are_converted_to_metres_and_y_up() {
    let asset = read(ARM);
    assert_eq!(asset.skeleton.names(), ["Upper", "Lower", "Arm", "eye"]);
    assert_eq!(asset.skeleton.parents(), [None, Some(0), None, None]);
    let rest = pose::at(&asset, None, 0.0);
    // (0, −300, 100) cm with z up.
    assert!((Vec3::from(rest[3].translation) - Vec3::new(0.0, 1.0, 3.0)).length() < 1e-6);
    assert_eq!(asset.origin.format, "COLLADA 1.4.1");
    assert_eq!(
        (asset.origin.metres_per_unit, asset.origin.up.as_str(), asset.origin.writer.as_str()),
        (Some(0.01), "+Z", "by hand")
    );
    let said = ["library_geometries: 1 part without normals; edges of up to 30° are smooth (option smooth)"];
    assert_eq!(warnings(&asset), said);
    let x = with(&[("Z_UP", "X_UP")]);
    let at = pose::at(&x, None, 0.0)[3].translation;
    // x up: (0, −300, 100) → y goes left, so −300 is 3 m to the right.
    assert!((Vec3::from(at) - Vec3::new(3.0, 0.0, 1.0)).length() < 1e-6, "{at}");
}

#[test]
fn skins_move_their_vertices() {
    let asset = read(ARM);
    let p = &asset.meshes[0].primitives[0];
    assert_eq!((p.positions.len(), p.indices.len(), p.influences), (8, 12, 4));
    let rest = pose::vertices(&asset, 0, &pose::at(&asset, None, 0.0));
    // The bind shape moves all by 10 cm.
    assert!((rest[0][0] - Vec3::new(0.1, 0.0, 0.0)).length() < 1e-6, "{:?}", rest[0]);
    assert!(rest[0].iter().any(|v| (*v - Vec3::new(2.1, 0.5, 0.0)).length() < 1e-6), "{:?}", rest[0]);
    // The forearm points along the file's y at 0.5 s, away from the viewer.
    let bent = pose::vertices(&asset, 0, &pose::at(&asset, Some(0), 0.5));
    assert!(bent[0].iter().any(|v| (*v - Vec3::new(1.0, 0.5, -1.1)).length() < 1e-6), "{:?}", bent[0]);
    // Weight 0.75 on the upper arm: (1.1, 0, 0) stays for three quarters, (1, 0, −0.1) for one.
    let mixed = Vec3::new(1.1, 0.0, 0.0) * 0.75 + Vec3::new(1.0, 0.0, -0.1) * 0.25;
    assert!(bent[0].iter().any(|v| (*v - mixed).length() < 1e-6), "{:?}", bent[0]);
}

#[test]
fn uv_sets_materials_and_textures_are_imported() {
    let asset = read(ARM);
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.uvs[0][2], Vec2::new(0.5, 0.0));
    assert_eq!(p.uvs[1][0], Vec2::new(3.0, -3.0));
    let skin = &asset.materials[0];
    assert_eq!((skin.name.as_str(), skin.shading), ("Skin", Shading::BlinnPhong));
    assert_eq!((skin.alpha_mode, skin.base_color.w), (AlphaMode::Blend, 0.75));
    assert!((skin.specular_color.x - 0.08).abs() < 1e-6, "a highlight of 1 at its peak");
    let texture = skin.base_color_texture.as_ref().unwrap();
    assert_eq!(
        (texture.uv_set, texture.sampler.wrap_u, texture.sampler.wrap_v),
        (1, Wrap::ClampToEdge, Wrap::Repeat)
    );
    assert_eq!(asset.images[0].name, "skin 1.png");
    // Twisted transparency: many exporters write 0 for opaque.
    let opaque = with(&[
        (" opaque=\"RGB_ZERO\"", ""),
        ("0.25 0.25 0.25 1<", "1 1 1 1<"),
        ("<float>1</float>", "<float>0</float>"),
    ]);
    assert_eq!(opaque.materials[0].alpha_mode, AlphaMode::Opaque);
    assert!(warnings(&opaque)[0].contains("opaque is used"), "{:?}", warnings(&opaque));
    // The file is not there: a warning, and no texture.
    let alone = import_bytes(&ColladaImporter, "arm.dae", ARM).unwrap();
    assert!(alone.materials[0].base_color_texture.is_none());
    assert_eq!(
        warnings(&alone)[0],
        "library_images/image \"skin-png\" (line 9): \"skin 1.png\" is not beside the file or in its textures/, images/, maps/; give its folder with --search; the texture is left out"
    );
}

#[test]
fn reflection_is_reflective_times_reflectivity() {
    let of = |reflective: &str| {
        let lines = format!("<shininess><float>92</float></shininess>{reflective}");
        let asset = with(&[("<shininess><float>92</float></shininess>", &lines)]);
        asset.materials[0].reflection.clone()
    };
    let (half, white) = ("<reflectivity><float>0.5</float></reflectivity>", "<color>1 1 1 1</color>");
    let share = |r: &str| of(r).map(|r| (r.color, r.texture.is_some()));
    let colored = format!("<reflective><color>1 0.5 0 1</color></reflective>{half}");
    assert!((share(&colored).unwrap().0 - Vec3::new(0.5, 0.107_021, 0.0)).length() < 1e-5);
    let map =
        format!("<reflective><texture texture=\"skin-sampler\" texcoord=\"DETAIL\"/></reflective>{half}");
    assert_eq!(share(&map), Some((Vec3::splat(0.5), true)));
    // Exporters write this for a surface without reflection.
    let black = format!("<reflective><color>0 0 0 1</color></reflective>{half}");
    for nothing in ["", half, &black, &format!("<reflective>{white}</reflective>")] {
        assert_eq!(of(nothing), None, "{nothing}");
    }
}

#[test]
fn cameras_and_lights_are_imported() {
    let asset = read(ARM);
    let Projection::Perspective { yfov, near, far } = asset.cameras[0].projection else { panic!() };
    // tan(45°) / 2.
    assert!((yfov - 2.0 * 0.5f32.atan()).abs() < 1e-6 && near == 0.1 && far == Some(50.0));
    assert_eq!(asset.lights[0].light.kind, LightKind::Directional);
    let sun = &asset.lights[0].light;
    assert!((sun.color * sun.intensity - Vec3::new(2.0, 1.0, 0.0) * std::f32::consts::PI).length() < 1e-5);
    // 1 / (0.0001 d²) in centimetres is 1 / d² in metres.
    assert!((asset.lights[1].light.intensity - std::f32::consts::PI).abs() < 1e-5);
}

#[test]
fn parts_outside_the_import_scope_are_not_read() {
    let read = |needs: ImportScope| {
        let files = companions();
        let asset = import(&ColladaImporter, &source("arm.dae", ARM), &files, needs).unwrap();
        (asset.meshes.len(), asset.skins.len(), asset.clips.len(), asset.images.len(), files.reads())
    };
    assert_eq!(read(ImportScope::ALL), (1, 1, 1, 1, 1));
    assert_eq!(
        read(ImportScope {
            geometry: false,
            clips: true,
            textures: false,
            pixels: false,
            image_files: false
        }),
        (0, 0, 1, 0, 0)
    );
    assert_eq!(
        read(ImportScope {
            geometry: true,
            clips: false,
            textures: false,
            pixels: false,
            image_files: false
        }),
        (1, 1, 0, 0, 0)
    );
    // Positions that are no numbers are not even looked at.
    let broken = ARM.replace("0 0 0 100 0 0 200", "zero 0 0 100 0 0 200");
    let clips =
        ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };
    assert!(import(&ColladaImporter, &source("arm.dae", broken), &companions(), clips).is_ok());
}

#[test]
fn matrix_keys_are_kept() {
    let asset = read(ARM);
    let clip = &asset.clips[0];
    assert_eq!((clip.name.as_str(), clip.duration.as_secs()), ("arm", 1.5));
    let rotation = clip.curves().iter().find(|c| c.path == Path::Rotation).unwrap();
    assert_eq!((rotation.times.len(), rotation.interpolation), (3, Interpolation::Linear));
    let step = with(&[("LINEAR LINEAR LINEAR", "STEP STEP STEP")]);
    assert_eq!(step.clips[0].curves()[0].interpolation, Interpolation::Step);
    let held = pose::at(&step, Some(0), 1.49)[1];
    assert!(held.matrix3.x_axis.y.abs() < 1e-6 && held.matrix3.x_axis.x.abs() < 1e-6, "{held}");
}

#[test]
fn animation_clips_cut_their_range() {
    let clips = "<library_animation_clips><animation_clip name=\"late\" start=\"0.25\" end=\"1\">\
                 <instance_animation url=\"#bend\"/></animation_clip></library_animation_clips><library_visual_scenes>";
    let asset = with(&[("<library_visual_scenes>", clips)]);
    assert_eq!(asset.clips.len(), 1, "no clip of the rest, as nothing is left");
    assert_eq!((asset.clips[0].name.as_str(), asset.clips[0].duration.as_secs()), ("late", 0.75));
    let whole = read(ARM);
    for (at, of_whole) in [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)] {
        let (a, b) = (pose::at(&asset, Some(0), at)[1], pose::at(&whole, Some(0), of_whole)[1]);
        assert!(a.abs_diff_eq(b, 1e-6), "{at}: {a} {b}");
    }
}

#[test]
fn morph_targets_and_weights_are_imported() {
    let target = ARM.split("<geometry id=\"strip\"").nth(1).unwrap().split("</geometry>").next().unwrap();
    let target = format!("<geometry id=\"raised\"{target}</geometry></library_geometries>")
        .replace("strip-", "raised-")
        .replace("0 0 0 100 0 0 200 0 0 0 0 50", "0 0 0 100 0 40 200 0 0 0 0 50")
        .replace("name=\"Strip\"", "name=\"Raised\"");
    let morph = "<library_controllers><controller id=\"face\"><morph source=\"#strip\" method=\"NORMALIZED\">\
        <source id=\"face-targets\"><IDREF_array count=\"1\">raised</IDREF_array></source>\
        <source id=\"face-weights\"><float_array count=\"1\">0.25</float_array></source>\
        <targets><input semantic=\"MORPH_TARGET\" source=\"#face-targets\"/><input semantic=\"MORPH_WEIGHT\" source=\"#face-weights\"/></targets>\
        </morph></controller>";
    let drive = "<source id=\"w-in\"><float_array count=\"2\">0 1</float_array></source>\
        <source id=\"w-out\"><float_array count=\"2\">0 1</float_array></source>\
        <sampler id=\"w\"><input semantic=\"INPUT\" source=\"#w-in\"/><input semantic=\"OUTPUT\" source=\"#w-out\"/></sampler>\
        <channel source=\"#w\" target=\"face-weights(0)\"/></animation>";
    let asset_driven_by = |drive: &str| {
        with(&[
            ("</library_geometries>", &target),
            ("<library_controllers>", morph),
            ("<skin source=\"#strip\">", "<skin source=\"#face\">"),
            ("</animation>", drive),
        ])
    };
    let asset = asset_driven_by(drive);
    let mesh = &asset.meshes[0];
    assert_eq!((mesh.morph_targets, mesh.morph_names.as_slice()), (1, &["Raised".to_string()][..]));
    let moved: Vec<Vec3> =
        mesh.primitives[0].morphs[0].positions.iter().copied().filter(|v| *v != Vec3::ZERO).collect();
    assert!(
        moved.iter().all(|v| (*v - Vec3::new(0.0, 0.0, 0.4)).length() < 1e-6) && moved.len() == 2,
        "{moved:?}"
    );
    assert_eq!(asset.instances[0].weights, [0.25]);
    let mut weights = [0.0];
    assert!(asset.clips[0].sample_weights(2, choreo_motion::Time::from_secs(0.5), &mut weights));
    assert_eq!(weights, [0.5]);
    // STEP holds the value until the next key.
    let steps = "<source id=\"w-how\"><Name_array count=\"2\">STEP STEP</Name_array></source>\
        <sampler id=\"w\"><input semantic=\"INTERPOLATION\" source=\"#w-how\"/>";
    let asset = asset_driven_by(&drive.replace("<sampler id=\"w\">", steps));
    for (secs, weight) in [(0.5, 0.0), (0.999, 0.0), (1.0, 1.0)] {
        assert!(asset.clips[0].sample_weights(2, choreo_motion::Time::from_secs(secs), &mut weights));
        assert_eq!(weights, [weight], "{secs} s");
    }
}

#[test]
fn strips_fans_polygons_and_lines_are_imported() {
    let polylist =
        &ARM[ARM.find("<polylist").unwrap()..ARM.find("</polylist>").unwrap() + "</polylist>".len()];
    let inputs = "<input semantic=\"VERTEX\" source=\"#strip-vertices\" offset=\"0\"/>";
    let shape = |text: String| {
        let asset = with(&[(polylist, &text)]);
        let p = &asset.meshes[0].primitives[0];
        let at = |i: &u32| p.positions[*i as usize];
        (p.indices.iter().map(at).collect::<Vec<Vec3>>(), p.topology)
    };
    let (strip, _) = shape(format!("<tristrips count=\"1\">{inputs}<p>0 1 3 4</p></tristrips>"));
    let normal = |t: &[Vec3]| (t[1] - t[0]).cross(t[2] - t[0]);
    assert!(strip.chunks(3).all(|t| normal(t).dot(normal(&strip[..3])) > 0.0) && strip.len() == 6);
    let (fan, _) = shape(format!("<trifans count=\"1\">{inputs}<p>0 1 2 5 3</p></trifans>"));
    assert_eq!(fan.len(), 9);
    let (polygons, _) = shape(format!(
        "<polygons count=\"2\">{inputs}<p>0 1 4 3</p><ph><p>1 2 5 4</p><h>1 2 5</h></ph></polygons>"
    ));
    assert_eq!(polygons.len(), 12);
    let (lines, topology) = shape(format!("<linestrips count=\"1\">{inputs}<p>0 1 2</p></linestrips>"));
    assert_eq!((lines.len(), topology), (4, choreo_asset::Topology::Lines));
}

#[test]
fn instanced_nodes_share_their_meshes() {
    let scene = "<library_nodes><node id=\"part\"><instance_geometry url=\"#strip\"/></node></library_nodes><library_visual_scenes>";
    let two = "<node id=\"a\"><instance_node url=\"#part\"/></node><node id=\"b\"><translate>0 0 7</translate><instance_node url=\"#part\"/></node><node id=\"arm\"";
    let asset = with(&[("<library_visual_scenes>", scene), ("<node id=\"arm\"", two)]);
    assert_eq!(asset.skeleton.names(), ["Upper", "Lower", "a", "part", "b", "part", "Arm", "eye"]);
    assert_eq!(
        asset.instances.iter().map(|i| (i.joint, i.mesh)).collect::<Vec<_>>(),
        [(3, 0), (5, 0), (6, 1)]
    );
}

#[test]
fn utf8_and_utf16_files_are_decoded() {
    let plain = read(ARM);
    let utf16 = |bytes: fn(u16) -> [u8; 2], mark: bool| -> Vec<u8> {
        let text = ARM.replace("encoding=\"utf-8\"", "encoding=\"utf-16\"").replace("Upper", "Öber");
        let mark = if mark { "\u{feff}" } else { "" };
        format!("{mark}{text}").encode_utf16().flat_map(bytes).collect()
    };
    let latin: Vec<u8> = ARM
        .replace("encoding=\"utf-8\"", "encoding=\"ISO-8859-1\"")
        .replace("Upper", "Öber")
        .chars()
        .map(|c| u8::try_from(u32::from(c)).unwrap())
        .collect();
    let cases = [
        utf16(u16::to_le_bytes, true),
        utf16(u16::to_be_bytes, true),
        utf16(u16::to_le_bytes, false),
        format!("\u{feff}{}", ARM.replace("Upper", "Öber")).into_bytes(),
        latin,
    ];
    for (index, bytes) in cases.into_iter().enumerate() {
        assert_eq!(ColladaImporter.claim(&source("x", bytes.clone())), Claim::Content(95), "{index}");
        let asset = import_bytes(&ColladaImporter, "x.dae", bytes).unwrap_or_else(|e| panic!("{index}: {e}"));
        assert_eq!(asset.skeleton.names()[0], "Öber", "{index}");
        assert_eq!(asset.clips[0].curves(), plain.clips[0].curves(), "{index}");
    }
    let text = error_text(import_bytes(
        &ColladaImporter,
        "x.dae",
        b"<?xml version=\"1.0\"?>\n<COLLADA>\xff</COLLADA>".to_vec(),
    ));
    assert_eq!(text, "x.dae: byte 31: 0xff is not UTF-8");
}

#[test]
fn a_skeleton_without_a_mesh_gets_visible_bones() {
    let asset = with(&[("<instance_controller url=\"#arm-skin\">", "<instance_controller url=\"#gone\">")]);
    assert_eq!((asset.meshes[0].name.as_str(), asset.skins.len()), ("bones", 1));
    assert!(warnings(&asset)[0].contains("url=\"#gone\" refers to nothing in this file; it is left out"));
}

/// The target of an instance may be missing, or of the wrong type: such an instance is skipped, and the other elements are read.
#[test]
fn instances_with_a_missing_or_wrong_target_are_left_out() {
    let nothing = "refers to nothing in this file";
    let eye = "library_visual_scenes/visual_scene \"scene\"/node \"eye\"";
    for (from, to, told, counts) in [
        (
            "instance_camera url=\"#cam\"",
            "instance_camera url=\"#x\"",
            format!("{eye}/instance_camera (line 148): url=\"#x\" {nothing}; it is left out"),
            (1, 0, 2, 1),
        ),
        (
            "instance_camera url=\"#cam\"",
            "instance_camera url=\"#sun\"",
            format!("{eye}/instance_camera (line 148): refers to a light, not a camera; it is left out"),
            (1, 0, 2, 1),
        ),
        (
            "instance_light url=\"#sun\"",
            "instance_light",
            format!("{eye}/instance_light (line 149): has no url; it is left out"),
            (1, 1, 1, 1),
        ),
        (
            "instance_light url=\"#lamp\"",
            "instance_light url=\"other.dae#lamp\"",
            format!("{eye}/instance_light (line 150): url=\"other.dae#lamp\" {nothing}; it is left out"),
            (1, 1, 1, 1),
        ),
        (
            "<instance_camera",
            "<instance_geometry url=\"#x\"/><instance_node url=\"#y\"/><instance_controller url=\"#strip\"/><instance_camera",
            format!(
                "{eye}/instance_controller (line 148): refers to a geometry, not a controller; it is left out"
            ),
            (1, 1, 2, 1),
        ),
        (
            "target=\"#skin\"",
            "target=\"#x\"",
            format!("instance_material (line 139): target=\"#x\" {nothing}; gray is used"),
            (1, 1, 2, 1),
        ),
        (
            "url=\"#skin-fx\"",
            "url=\"#x\"",
            format!(
                "library_materials/material \"skin\"/instance_effect (line 30): url=\"#x\" {nothing}; white is used"
            ),
            (1, 1, 2, 1),
        ),
        (
            "<instance_visual_scene url=\"#scene\"/>",
            "<instance_visual_scene url=\"#x\"/>",
            format!("scene/instance_visual_scene (line 154): url=\"#x\" {nothing}; the first scene is used"),
            (1, 1, 2, 1),
        ),
        (
            "<library_visual_scenes>",
            "<library_animation_clips><animation_clip name=\"c\"><instance_animation url=\"#x\"/></animation_clip></library_animation_clips><library_visual_scenes>",
            format!(
                "library_animation_clips/animation_clip/instance_animation (line 127): url=\"#x\" {nothing}; it is left out"
            ),
            (1, 1, 2, 1),
        ),
    ] {
        let asset = with(&[(from, to)]);
        let said = warnings(&asset);
        assert!(said.iter().any(|w| w.ends_with(&told)), "{told}\n{said:#?}");
        let found = (asset.instances.len(), asset.cameras.len(), asset.lights.len(), asset.clips.len());
        assert_eq!(found, counts, "{to}");
    }
}

/// Some programs write decimal commas if the user's language has them.
#[test]
fn units_that_are_not_numbers_are_warnings() {
    let size = |asset: &Asset| (asset.rest_bounds().max - asset.rest_bounds().min).max_element();
    let plain = read(ARM);
    let comma = with(&[("meter=\"0.01\"", "meter=\"0,01\"")]);
    assert_eq!((size(&comma), comma.origin.metres_per_unit), (size(&plain), Some(0.01)));
    assert!(
        warnings(&comma)
            .contains(&"asset/unit (line 5): meter=\"0,01\" has a decimal comma; 0.01 is used".into())
    );
    for wrong in ["0", "centimetre", "-1", "1e9", ""] {
        let asset = with(&[("meter=\"0.01\"", &format!("meter=\"{wrong}\""))]);
        assert_eq!(asset.origin.metres_per_unit, Some(1.0));
        let told = format!(
            "asset/unit (line 5): meter=\"{wrong}\" is not a number from 0.000001 to 1000000; 1 is used"
        );
        assert!(warnings(&asset).contains(&told), "{:?}", warnings(&asset));
    }
}

/// Time 0 of a clip is its first key where the file does not say where it starts.
#[test]
fn clips_begin_at_their_first_key() {
    let whole = read(ARM);
    for (times, late) in [("0.25 0.75 1.75", 0.25), ("-2 -1.5 -0.5", -2.0), ("1000 1000.5 1001.5", 1000.0)] {
        let asset = with(&[("0 0.5 1.5", times)]);
        assert_eq!(asset.clips[0].duration.as_secs(), 1.5, "{late}");
        for at in [0.0, 0.25, 0.5, 1.0, 1.5] {
            let (a, b) = (pose::at(&asset, Some(0), at)[1], pose::at(&whole, Some(0), at)[1]);
            assert!(a.abs_diff_eq(b, 1e-6), "{at} s of {late}: {a} {b}");
        }
    }
    // An animation_clip states its start; the default is 0.
    let clips = "<library_animation_clips><animation_clip name=\"all\"><instance_animation url=\"#bend\"/></animation_clip></library_animation_clips><library_visual_scenes>";
    let asset = with(&[("0 0.5 1.5", "0.25 0.75 1.75"), ("<library_visual_scenes>", clips)]);
    assert_eq!(asset.clips[0].duration.as_secs(), 1.75);
}
