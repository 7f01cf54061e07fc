//! Damaged and hostile files.

use choreo_importer_kit_testing::{
    Companions, asset_rules, assets, damage, error_text, import, import_bytes, source, warnings,
};
use choreo_plugin::ImportScope;
use import_obj::ObjImporter;

const ROOM: &str = include_str!("../data/room.obj");

#[test]
fn errors_name_the_line() {
    let with = |from: &str, to: &str| {
        assert!(ROOM.contains(from), "{from}");
        error_text(import_bytes(&ObjImporter, "bad.obj", ROOM.replacen(from, to, 1)))
    };
    for (from, to, text) in [
        ("v 2 2 0", "v 2 two 0", "line 5: \"two\" is not a finite number"),
        ("v 2 2 0", "v 2 2", "line 5: has 2 numbers, but needs 3"),
        ("v 2 2 0", "v 2 2 nan", "line 5: \"nan\" is not a finite number"),
        ("v 2 2 0", "v 2 2 1e39", "line 5: \"1e39\" is not a finite number"),
        ("vn 0 0 1", "vn 0 0", "line 12: has 2 numbers, but needs 3"),
        ("f 1/1/1 2", "f 0/1/1 2", "line 16: refers to vertex 0; they are counted from 1"),
        ("f 1/1/1 2", "f 9/1/1 2", "line 16: refers to vertex 9, but the file has 5"),
        ("f 1/1/1 2", "f 1/9/1 2", "line 16: refers to texture coordinate 9, but the file has 4"),
        ("f 1/1/1 2", "f 1/1/9 2", "line 16: refers to normal 9, but the file has 1"),
        ("f -5/", "f -6/", "line 18: refers to vertex -6, counted from the end, but the number so far is 5"),
        (
            "f 1/1/1 2",
            "f 1/-5/1 2",
            "line 16: refers to texture coordinate -5, counted from the end, but the number so far is 4",
        ),
        (
            "f 1/1/1 2",
            "f 1/1/-9223372036854775808 2",
            "line 16: \"1/1/-9223372036854775808\" is not a vertex of a face: it should be v, v/t, v//n or v/t/n",
        ),
        ("f 1/1/1 2", "f 1/0/1 2", "line 16: refers to texture coordinate 0; they are counted from 1"),
        (
            "f 1/1/1 2",
            "f 1/1/1/1 2",
            "line 16: \"1/1/1/1\" is not a vertex of a face: it should be v, v/t, v//n or v/t/n",
        ),
        (
            "f 1/1/1 2",
            "f one 2",
            "line 16: \"one\" is not a vertex of a face: it should be v, v/t, v//n or v/t/n",
        ),
        ("f 1/1/1 2", "f 99999999999 2", "line 16: refers to vertex 99999999999, which is beyond the limit"),
        ("f 1/1/1 2", "f 4294967296 2", "line 16: refers to vertex 4294967296, which is beyond the limit"),
    ] {
        assert_eq!(with(from, to), format!("bad.obj: {text}"));
    }
    for nothing in ["", "just words\n"] {
        let text = error_text(import_bytes(&ObjImporter, "bad.obj", nothing));
        assert_eq!(text, "bad.obj: line 1: the file has no OBJ data");
    }
    let groups: String = (0..70_000).map(|i| format!("g {i}\np -1\n")).collect();
    let groups = format!("v 0 0 0\n{groups}");
    let text = error_text(import_bytes(&ObjImporter, "bad.obj", groups));
    assert_eq!(text, "bad.obj: line 131075: more than 65536 groups, which is the limit");
}

/// Texture paths reach only what the caller hands over; broken images and libraries are warnings.
#[test]
fn missing_or_broken_companion_files_are_warnings() {
    let text = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    let import = |mtl: &str| {
        let files = Companions::of(vec![("a.mtl", mtl.into()), ("cut.png", b"\x89PNG\r\n\x1a\n".to_vec())]);
        let asset = import(&ObjImporter, &source("x.obj", text), &files, ImportScope::ALL).unwrap();
        asset_rules::check("x.obj", &asset);
        warnings(&asset)
    };
    assert_eq!(
        import("newmtl a\nmap_Kd ../../etc/passwd\n")[0],
        "a.mtl line 1: \"passwd\" is not beside the file or in its textures/, images/, maps/, and folders above it are not read; give its folder with --search; the texture is left out"
    );
    let cut = import("newmtl a\nmap_Kd cut.png\n");
    assert!(cut[0].starts_with("a.mtl line 1: \"cut.png\" has a damaged header"), "{cut:?}");
    assert!(import("newmtl a\nmap_Kd a.mtl\n")[0].starts_with("a.mtl line 1: \"a.mtl\" is not a PNG"));
    assert_eq!(
        import("Kd 1 1 1\nnewmtl a\nKd 1 x 1\nmap_Kd -s\nNs 1e99\n")[..4],
        [
            "a.mtl line 1: \"Kd\" stands before the first newmtl; it is left out",
            "a.mtl line 3: \"Kd\": \"x\" is not a finite number; it is left out",
            "a.mtl line 4: \"map_Kd\": -s needs a number; it is left out",
            "a.mtl line 5: \"Ns\": \"1e99\" is not a finite number; it is left out",
        ]
    );
}

/// One vertex with as many texture coordinates as there are faces; one face with all vertices.
#[test]
fn adversarial_files_are_parsed_in_linear_time() {
    let n = 100_000;
    let mut many: String = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".into();
    (0..n).for_each(|i| many.push_str(&format!("vt {i} 0\n")));
    (1..=n).for_each(|i| many.push_str(&format!("f 1/{i} 2/{i} 3/{i}\n")));
    let asset = import_bytes(&ObjImporter, "many.obj", many).unwrap();
    assert_eq!(asset.meshes[0].primitives[0].indices.len(), n * 3);

    let mut comb: String = (0..n).map(|i| format!("v {i} {} 0\n", i % 2)).collect();
    comb.push_str(&format!("v {} 1e6 0\nf", n / 2));
    (1..=n + 1).for_each(|i| comb.push_str(&format!(" {i}")));
    let asset = import_bytes(&ObjImporter, "comb.obj", comb).unwrap();
    assert_eq!(asset.meshes[0].primitives[0].indices.len(), (n - 1) * 3);
    assert!(warnings(&asset).iter().any(|w| w.contains("too many vertices")), "{:?}", warnings(&asset));
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    damage::run_cases(&ObjImporter, || {
        let mut cases = vec![("room.obj", ROOM.as_bytes().to_vec(), 1000)];
        if let Some(folder) = assets(2) {
            for name in ["obj/spider.obj", "same-model-3-formats/chest_gold.obj"] {
                cases.push((name, std::fs::read(folder.join(name)).unwrap(), damage::flips()));
            }
        }
        cases
    });
}
