//! Damaged, hostile and odd files.

use choreo_importer_kit_testing::{
    Companions, asset_rules, assets, damage, error_text, import_bytes, options, source, warnings,
};
use choreo_plugin::{Claim, ImportScope, Importer, OptionValue};
use glam::Vec3;
use import_bvh::BvhImporter;

const ARM: &str = include_str!("../data/arm.bvh");
const ORDERS: &str = include_str!("../data/orders.bvh");

fn error_with(from: &str, to: &str) -> String {
    assert!(ARM.contains(from), "{from}");
    error_text(import_bytes(&BvhImporter, "bad.bvh", ARM.replacen(from, to, 1)))
}

#[test]
fn errors_name_the_line() {
    for (from, to, text) in [
        ("HIERARCHY", "HIERARCH", "line 1: starts with \"HIERARCH\", not with HIERARCHY"),
        (
            "OFFSET 0 1.4 0",
            "OFFSET 0 1,4 0",
            "line 4: \"1,4\" is not a number; OFFSET must have three numbers",
        ),
        (
            "OFFSET 0 1.4 0",
            "OFFSET 0 nan 0",
            "line 4: \"nan\" is not a number; OFFSET must have three numbers",
        ),
        (
            "OFFSET 0 1.4 0",
            "OFFSET 0 1e200 0",
            "HIERARCHY: rest transform of joint 0 (\"Shoulder\") is not finite",
        ),
        ("Zrotation", "Wrotation", "line 5: unknown channel \"Wrotation\""),
        ("CHANNELS 3", "CHANNELS -3", "line 5: \"-3\" channels; a joint has 0 to 6"),
        ("CHANNELS 3", "CHANNELS 4000000000", "line 5: \"4000000000\" channels; a joint has 0 to 6"),
        ("JOINT", "JIONT", "line 6: \"JIONT\" stands where OFFSET, CHANNELS, JOINT, End Site or } should be"),
        ("JOINT Elbow\n\t{", "JOINT Elbow\n\t", "line 8: \"OFFSET\" stands where { should be"),
        ("MOTION", "MOTOIN", "line 16: \"MOTOIN\" stands where ROOT or MOTION should be"),
        ("Frames: 2", "Frames: 99999999999", "line 17: 99999999999 frames; the limit is 10000000"),
        ("Frames: 2", "Frames: -1", "line 17: \"-1\" is not a number of frames"),
        ("Frames: 2", "Frames: many", "line 17: \"many\" is not a number of frames"),
        ("Frames: 2", "Farmes: 2", "line 17: \"Farmes: 2\" stands where \"Frames: …\" should be"),
        ("Frame Time: 0.5", "Frame Time: -0.5", "line 18: \"-0.5\" is not a frame time in seconds"),
        (
            "Frame Time: 0.5",
            "Frame Time: 1e-9",
            "line 18: a frame time of 0.000000001 s; at least 0.000001 is allowed",
        ),
        ("Frame Time: 0.5", "Frame Time: 1e8", "line 18: 2 frames of 1e8 s; the limit is 10000000 s"),
        ("0 0 0  0 0 0\n", "0 0 0\n", "line 19: the frame has 3 numbers; the joints have 6 channels"),
        ("0 0 0  0 0 0\n", "0 0 0  x 0 0\n", "line 19: number 4 of the frame is \"x\""),
    ] {
        assert_eq!(error_with(from, to), format!("bad.bvh: {text}"));
    }
    assert_eq!(
        error_text(import_bytes(&BvhImporter, "bad.bvh", "HIERARCHY\nROOT a\n{\n")),
        "bad.bvh: line 4: the file ends where OFFSET, CHANNELS, JOINT, End Site or } should be"
    );
    assert_eq!(
        error_text(import_bytes(&BvhImporter, "bad.bvh", "HIERARCHY\nMOTION\n")),
        "bad.bvh: line 2: HIERARCHY has no ROOT"
    );
    assert_eq!(
        error_text(import_bytes(&BvhImporter, "bad.bvh", "")),
        "bad.bvh: line 1: the file ends where HIERARCHY should be"
    );
}

#[test]
fn guessed_and_ignored_content_is_a_warning() {
    let said = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        let asset = import_bytes(&BvhImporter, "odd.bvh", ARM.replacen(from, to, 1)).unwrap();
        asset_rules::check("odd.bvh", &asset);
        let guess = |w: &String| w.starts_with("HIERARCHY: the format has no unit");
        warnings(&asset).into_iter().filter(|w| !guess(w)).collect::<Vec<_>>()
    };
    assert_eq!(
        said("Frames: 2", "Frames: 5"),
        ["line 17: 5 frames are announced, but only 2 are there; those are used"]
    );
    assert_eq!(
        said("Frames: 2", "Frames: 1"),
        ["MOTION: 1 more lines than frames were announced; they are left out"]
    );
    assert_eq!(said("Frames: 2", "Frames: 0").len(), 2);
    assert_eq!(
        said("0 0 0  90 0 0", "0 0 0  90"),
        [
            "line 20: the frame has 4 numbers; the joints have 6 channels; this last frame is left out",
            "line 17: 2 frames are announced, but only 1 are there; those are used"
        ]
    );
    assert_eq!(
        said("0 0 0  0 0 0", "0 0 0  0 0 0 7 8"),
        ["line 19: the frame has more numbers than the joints' 6 channels; the surplus is left out"]
    );
    assert_eq!(
        said("Frame Time: 0.5", "Frame Time: 0"),
        ["line 18: the frame time is 0; 30 frames a second are used"]
    );
    assert_eq!(said("ROOT Shoulder", "ROOT"), ["line 4: a joint has no name; it is called \"joint 0\""]);
    let head = &ARM[..ARM.find("MOTION").unwrap()];
    let asset = import_bytes(&BvhImporter, "head.bvh", head).unwrap();
    assert_eq!(warnings(&asset)[1], "line 16: the file has no MOTION; it is a skeleton without a clip");
    assert!(asset.clips.is_empty() && !asset.meshes.is_empty());
}

/// CR LF, CR, a byte order mark, other letter case: the same asset.
#[test]
fn line_ends_and_letter_case_do_not_matter() {
    let read = |text: String| {
        let asset = import_bytes(&BvhImporter, "x.bvh", text).unwrap();
        (asset.skeleton.clone(), asset.clips[0].curves().to_vec())
    };
    let unix = ORDERS.replace('\r', "");
    let expected = read(unix.clone());
    assert!(expected == read(ORDERS.to_string()), "CR LF");
    assert!(expected == read(unix.replace('\n', "\r")), "CR");
    assert!(expected == read(format!("\u{feff}{unix}")), "byte order mark");
    let lower =
        unix.replace("rotation", "ROTATION").replace("End Site", "End site").replace("Frames:", "frames :");
    assert!(expected == read(lower), "letter case");
}

#[test]
fn options_are_followed() {
    let import = |given: &[(&str, OptionValue)]| {
        let source = source("arm.bvh", ARM);
        BvhImporter
            .import(&source, &Companions::none(), ImportScope::ALL, &options(&BvhImporter, given))
            .unwrap()
    };
    let half = import(&[("scale", OptionValue::Number(0.5))]);
    assert_eq!(half.skeleton.rest()[0].translation, Vec3::new(0.0, 0.7, 0.0));
    assert!(half.warnings.is_empty());
    assert!(import(&[("bones", OptionValue::Bool(false))]).meshes.is_empty());
    // The file's +Z is up: its y axis then points away from the viewer.
    let z = import(&[("up", OptionValue::Text("z".into()))]);
    assert!((z.skeleton.rest()[0].translation - Vec3::new(0.0, 0.0, -1.4)).length() < 1e-6);
    assert_eq!(z.origin.up, "+Z");
    let elbow_end = choreo_importer_kit_testing::pose::at(&z, Some(0), 0.5)[2].translation;
    // The elbow turned by 90° about the file's z: the forearm points along its y.
    assert!((Vec3::from(elbow_end) - Vec3::new(0.3, 0.0, -1.65)).length() < 1e-6, "{elbow_end}");
}

#[test]
fn parts_outside_the_import_scope_are_not_created() {
    let import = |needs: ImportScope| {
        choreo_importer_kit_testing::import(&BvhImporter, &source("arm.bvh", ARM), &Companions::none(), needs)
            .unwrap()
    };
    let clips = import(ImportScope {
        geometry: false,
        clips: true,
        textures: false,
        pixels: false,
        image_files: false,
    });
    assert_eq!(
        (clips.meshes.len(), clips.skins.len(), clips.materials.len(), clips.clips.len()),
        (0, 0, 0, 1)
    );
    let geometry = import(ImportScope {
        geometry: true,
        clips: false,
        textures: true,
        pixels: true,
        image_files: false,
    });
    assert_eq!((geometry.meshes.len(), geometry.clips.len()), (1, 0));
    // Frames are not even looked at.
    let broken = ARM.replace("0 0 0  90 0 0", "no numbers");
    let needs =
        ImportScope { geometry: true, clips: false, textures: false, pixels: false, image_files: false };
    assert!(
        choreo_importer_kit_testing::import(
            &BvhImporter,
            &source("x.bvh", broken),
            &Companions::none(),
            needs
        )
        .is_ok()
    );
}

#[test]
fn files_are_claimed_by_content() {
    let claim = |name: &str, bytes: &str| BvhImporter.claim(&source(name, bytes));
    assert_eq!(claim("x", ARM), Claim::Content(90));
    assert_eq!(claim("x.txt", "\u{feff} \n hierarchy\n"), Claim::Content(90));
    assert_eq!(claim("x.BVH", "what"), Claim::Extension);
    assert_eq!(claim("x.obj", "v 0 0 0"), Claim::NotMine);
}

#[test]
fn deep_and_wide_hierarchies_are_limited() {
    let deep = |n: usize| {
        let joint = "JOINT a\n{\nOFFSET 0 1 0\n";
        format!("HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{}{}", joint.repeat(n), "}\n".repeat(n + 1))
    };
    let asset = import_bytes(&BvhImporter, "deep.bvh", deep(10_000)).unwrap();
    assert_eq!(asset.skeleton.len(), 10_001);
    assert_eq!(
        error_text(import_bytes(&BvhImporter, "deep.bvh", deep(20_000))),
        "deep.bvh: line 49152: more than 16384 joints, which is the limit"
    );
    let braces = format!("HIERARCHY\nROOT a\n{}", "{".repeat(1_000_000));
    assert!(error_text(import_bytes(&BvhImporter, "braces.bvh", braces)).contains("stands where OFFSET"));
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    damage::run_cases(&BvhImporter, || {
        let mut cases = vec![
            ("arm.bvh", ARM.as_bytes().to_vec(), 1000),
            ("orders.bvh", ORDERS.as_bytes().to_vec(), 1000),
        ];
        if let Some(folder) = assets(2) {
            for name in ["walk01.bvh", "mocopi-mobile-arm-raise-turn.bvh"] {
                let flips = if name == "walk01.bvh" { damage::flips() } else { damage::flips() / 10 };
                cases.push((name, std::fs::read(folder.join("bvh").join(name)).unwrap(), flips));
            }
        }
        cases
    });
}
