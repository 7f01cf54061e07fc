//! Files cut off and with single bits turned over; limits. `CHOREO_FLIPS=1000` is the long run.

mod common;

use choreo_import_testing::{damage, error_text, import_bytes};
use choreo_plugin::{Claim, Importer};
use import_fbx::FbxImporter;

#[test]
fn truncated_and_flipped() {
    let flips = damage::flips();
    damage::run(&FbxImporter, "flag.fbx", &common::own(), flips);
    let Some(folder) = common::assets(23) else { return };
    for path in common::all_files(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy();
        // The everyday run stays within seconds: large files get their share.
        let share = if bytes.len() > 200_000 { flips.div_ceil(10) } else { flips };
        let share = if flips > 100 { flips } else { share };
        damage::run(&FbxImporter, &name, &bytes, share);
    }
}

#[test]
fn errors_name_file_place_and_reason() {
    let text = |bytes: &[u8]| error_text(import_bytes(&FbxImporter, "x.fbx", bytes));
    assert_eq!(text(b""), "x.fbx: byte 0: the file is empty");
    assert!(text(b"hello").starts_with("x.fbx: "), "{}", text(b"hello"));
    let own = common::own();
    let cut = text(&own[..own.len() / 2]);
    assert!(cut.starts_with("x.fbx: byte "), "{cut}");
}

#[test]
fn other_formats_are_not_claimed() {
    let claim = |name: &str, bytes: &[u8]| FbxImporter.claim(&common::source(name, bytes.to_vec()));
    assert_eq!(claim("a.dat", b"Kaydara FBX Binary  \0\x1a\0"), Claim::Content(100));
    assert_eq!(claim("a.dat", &common::own()), Claim::Content(95));
    assert_eq!(claim("a.fbx", b"glTF"), Claim::Extension);
    assert_eq!(claim("a.glb", b"glTF"), Claim::NotMine);
}
