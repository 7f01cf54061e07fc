//! Damaged and hostile files.

use choreo_importer_kit_testing::{asset_rules, assets, damage, error_text, import_bytes, warnings};
use import_collada::ColladaImporter;

const ARM: &str = include_str!("../data/arm.dae");

#[test]
fn errors_name_element_and_line() {
    let with = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        error_text(import_bytes(&ColladaImporter, "bad.dae", ARM.replacen(from, to, 1)))
    };
    let mesh = "library_geometries/geometry \"strip\"/mesh";
    for (from, to, text) in [
        ("0 0 0 100 0 0 200", "0 zero 0 100 0 0 200", format!("{mesh}/source \"strip-pos\"/float_array \"strip-pos-array\" (line 48): value 1 is \"zero\", not a finite number")),
        ("0 0 0 100 0 0 200", "0 1e39 0 100 0 0 200", format!("{mesh}/source \"strip-pos\"/float_array \"strip-pos-array\" (line 48): value 1 is \"1e39\", not a finite number")),
        ("count=\"6\" stride=\"3\"", "count=\"4000000000\" stride=\"3\"", format!("{mesh}/source \"strip-pos\"/technique_common/accessor (line 49): announces 4000000000 elements of 3 values, but the array has room for 6")),
        ("count=\"6\" stride=\"3\"", "count=\"-6\" stride=\"3\"", format!("{mesh}/source \"strip-pos\"/technique_common/accessor (line 49): count=\"-6\" is not a whole number")),
        ("<p>0 0 1", "<p>0 0 99", format!("{mesh}/polylist (line 62): refers to element 99 of a source that has 6")),
        ("<p>0 0 1", "<p>0 0 -1", format!("{mesh}/polylist/p (line 67): value 2 is -1; an index starts at 0")),
        ("<p>0 0 1", "<p>0 1", format!("{mesh}/polylist/p (line 67): has 15 indices, which is no multiple of the 2 that a vertex needs")),
        ("<vcount>4 4", "<vcount>4 5", format!("{mesh}/polylist (line 62): vcount asks for 9 vertices, but p has 8")),
        ("offset=\"1\" set=\"3\"", "offset=\"1000000\" set=\"3\"", format!("{mesh}/polylist/input (line 65): offset=\"1000000\" is not a number from 0 to 255")),
        ("source=\"#strip-uv\" offset", "source=\"#nothing\" offset", format!("{mesh}/polylist/input (line 64): source=\"#nothing\" refers to nothing in this file")),
        ("<v>0 0  0 1", "<v>9 0  0 1", "library_controllers/controller \"arm-skin\"/skin/vertex_weights (line 92): refers to joint 9 of 2 and weight 0 of 3".to_string()),
        ("<vcount>1 2", "<vcount>900 2", "library_controllers/controller \"arm-skin\"/skin/vertex_weights (line 92): vcount asks for 907 pairs of joint and weight, but v has 8".to_string()),
        ("0 0.5 1.5", "0 0.5 1e9", "library_animations/animation \"bend\"/sampler \"bend-sampler\" (line 119): a key is at 1000000000 s; the limit is 10000000 s".to_string()),
        ("0 0.5 1.5", "0 0.5", "library_animations/animation \"bend\"/source \"bend-in\"/technique_common/accessor (line 105): announces 3 elements of 1 values, but the array has room for 2".to_string()),
        ("0 -300 100<", "0 -300<", "library_visual_scenes/visual_scene \"scene\"/node \"eye\"/translate \"place\" (line 146): has 2 numbers, but needs 3".to_string()),
        ("</COLLADA>", "", "line 155: expected 'COLLADA' tag, not found".to_string()),
    ] {
        let got = with(from, to);
        if text.starts_with("line 155") {
            assert!(got.starts_with("bad.dae: line "), "{got}");
        } else {
            assert_eq!(got, format!("bad.dae: {text}"));
        }
    }
    let other = error_text(import_bytes(&ColladaImporter, "bad.dae", "<svg/>"));
    assert_eq!(other, "bad.dae: line 1: the root element is svg, not COLLADA");
    assert!(
        error_text(import_bytes(&ColladaImporter, "bad.dae", "")).starts_with("bad.dae: line 1, column 1: ")
    );
}

#[test]
fn xml_entities_are_errors() {
    let mut laughs = "<?xml version=\"1.0\"?>\n<!DOCTYPE COLLADA [<!ENTITY a0 \"ha\">".to_string();
    (1..30).for_each(|i| laughs += &format!("<!ENTITY a{i} \"&a{};&a{};\">", i - 1, i - 1));
    laughs += "]>\n<COLLADA>&a29;</COLLADA>";
    let error = import_bytes(&ColladaImporter, "laughs.dae", laughs).unwrap_err();
    assert_eq!(
        error.to_string(),
        "laughs.dae: line 2, column 1: has a document type definition, which is not allowed"
    );
    let outside = "<!DOCTYPE COLLADA [<!ENTITY x SYSTEM \"file:///etc/passwd\">]><COLLADA>&x;</COLLADA>";
    assert!(
        error_text(import_bytes(&ColladaImporter, "x.dae", outside)).contains("document type definition")
    );
}

#[test]
fn deep_wide_and_circular_files() {
    let scene = |inside: &str| {
        format!(
            "<COLLADA><library_visual_scenes><visual_scene id=\"s\">{inside}</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>"
        )
    };
    let deep = scene(&("<node>".repeat(20_000) + &"</node>".repeat(20_000)));
    let result = import_bytes(&ColladaImporter, "deep.dae", deep);
    match result {
        Ok(asset) => assert_eq!(asset.skeleton.len(), 20_000),
        Err(e) => assert!(e.place.starts_with("line "), "{e}"),
    }
    let circle = scene("<node id=\"a\"><instance_node url=\"#a\"/></node>");
    assert_eq!(
        error_text(import_bytes(&ColladaImporter, "circle.dae", circle)),
        "circle.dae: library_visual_scenes/visual_scene \"s\"/node \"a\" (line 1): the scene has more than 65536 nodes, which is the limit; an instance_node may contain itself"
    );
    // Each node instances the next one twice: 2^40 of them.
    let doubled: String = (0..40)
        .map(|i| {
            format!(
                "<node id=\"n{i}\"><instance_node url=\"#n{}\"/><instance_node url=\"#n{}\"/></node>",
                i + 1,
                i + 1
            )
        })
        .collect();
    let text =
        error_text(import_bytes(&ColladaImporter, "bomb.dae", scene(&(doubled + "<node id=\"n40\"/>"))));
    assert!(text.contains("more than 65536 nodes"), "{text}");
    let controllers = ARM.replace("<skin source=\"#strip\">", "<skin source=\"#arm-skin\">");
    let text = error_text(import_bytes(&ColladaImporter, "self.dae", controllers));
    assert!(text.contains("or to itself"), "{text}");
}

#[test]
fn unusual_files_are_imported_with_warnings() {
    let read = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        let asset = import_bytes(&ColladaImporter, "odd.dae", ARM.replacen(from, to, 1))
            .unwrap_or_else(|e| panic!("{e}"));
        asset_rules::check("odd.dae", &asset);
        warnings(&asset)
    };
    let has =
        |said: Vec<String>, text: &str| assert!(said.iter().any(|w| w.contains(text)), "{text}: {said:?}");
    has(
        read("upper lower<", "upper gone<"),
        "1 of 2 joints are not in the scene (gone); the vertices that they move stay still",
    );
    has(
        read("1 0.75 0.25<", "0 0.75 0.25<"),
        "4 vertices have weights that sum to 0; their first joint gets weight 1",
    );
    has(read("<v>0 0  0 1", "<v>-1 0  0 1"), "1 influences of the bind shape itself (joint -1) are left out");
    has(read("0 0.5 1.5<", "0 0.5 0.5<"), "1 of 3 keys are not after the one before");
    has(
        read("symbol=\"SKIN\"", "symbol=\"COAT\""),
        "material \"SKIN\" of the mesh is not bound; gray is used",
    );
    has(
        read("<scene><instance_visual_scene url=\"#scene\"/></scene>", ""),
        "does not say which scene it shows",
    );
    has(
        read("art/skin%201.png", "../../../../etc/passwd"),
        "\"passwd\" is not beside the file or in its textures/, images/, maps/, and folders above it are not read; give its folder with --search",
    );
    has(read("<up_axis>Z_UP", "<up_axis>UP"), "\"UP\" is not an axis");
    has(
        read(
            "<polylist material=\"SKIN\" count=\"2\">",
            "<polylist material=\"SKIN\" count=\"2\"><!-- odd -->",
        ),
        "without normals",
    );
    has(
        read("1 0 0 100 0 1 0 0 0 0 1 0 0 0 0 1</matrix>", "1 0.5 0 100 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"),
        "sheared",
    );
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    damage::run_cases(&ColladaImporter, || {
        let mut cases = vec![("arm.dae", ARM.as_bytes().to_vec(), 1000)];
        if let Some(folder) = assets(4) {
            let flips = damage::flips();
            for (name, flips) in [
                ("cylinder_animated_from_3ds_max.dae", flips),
                ("library_animation_clips.dae", flips),
                ("pab/walk.dae", flips / 4),
                ("walk.dae", flips / 10),
            ] {
                cases.push((name, std::fs::read(folder.join("dae").join(name)).unwrap(), flips));
            }
        }
        cases
    });
}
