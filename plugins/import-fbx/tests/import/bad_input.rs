//! Files cut off and with single bits turned over; limits. `CHOREO_FLIPS=1000` is the long run.

use crate::common;
use choreo_importer_kit_testing::{damage, error_text, import_bytes, own_process};
use choreo_plugin::{Claim, Importer};
use import_fbx::FbxImporter;

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    if own_process::ran_in_own_process() {
        return;
    }
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

/// A text file with these objects and connections.
fn text_file(objects: &str, connections: &str) -> Vec<u8> {
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension:  {{\n\tFBXVersion: 7400\n}}\nObjects:  {{\n{objects}}}\n\
         Connections:  {{\n{connections}}}\n"
    )
    .into_bytes()
}

/// An element of a binary file at a place in it; `properties` are encoded and counted.
fn element(name: &str, at: usize, properties: (u32, &[u8]), children: &dyn Fn(usize) -> Vec<u8>) -> Vec<u8> {
    let body = at + 13 + name.len();
    let mut inner = children(body + properties.1.len());
    if !inner.is_empty() {
        inner.extend([0; 13]);
    }
    let end = (body + properties.1.len() + inner.len()) as u32;
    let mut out = end.to_le_bytes().to_vec();
    out.extend(properties.0.to_le_bytes());
    out.extend((properties.1.len() as u32).to_le_bytes());
    out.push(name.len() as u8);
    out.extend(name.as_bytes());
    out.extend(properties.1);
    out.extend(inner);
    out
}

#[test]
fn errors_name_the_exceeded_limit() {
    let text = |bytes: Vec<u8>| error_text(import_bytes(&FbxImporter, "x.fbx", bytes));
    // A chain of nodes.
    let chain = |nodes: usize| {
        let model = |i| format!("\tModel: {}, \"Model::n{i}\", \"Null\" {{\n\t}}\n", i + 1);
        let below = |i| format!("\tC: \"OO\",{},{i}\n", i + 1);
        text_file(&(0..nodes).map(model).collect::<String>(), &(0..nodes).map(below).collect::<String>())
    };
    let short = import_bytes(&FbxImporter, "x.fbx", chain(100)).unwrap_or_else(|e| panic!("{e}"));
    assert!(short.skeleton.len() >= 100, "{}", short.skeleton.len());
    let deep = text(chain(5000));
    assert!(deep.contains("has nodes more than 4096 deep, which is the limit"), "{deep}");
    // Elements within elements.
    let nested = text(text_file(&("a: {\n".repeat(100_000) + &"}\n".repeat(100_000)), ""));
    assert!(nested.starts_with("x.fbx: byte "), "{nested}");
    // An array of four thousand million numbers, in a few bytes; and of fewer than none.
    for count in [500_000_000u32, u32::MAX] {
        let mut numbers = vec![b'd'];
        numbers.extend(count.to_le_bytes());
        numbers.extend(1u32.to_le_bytes());
        numbers.extend(12u32.to_le_bytes());
        numbers.extend([0x78, 0x9c, 0x03, 0, 0, 0, 0, 1, 0, 0, 0, 0]);
        let id: Vec<u8> =
            [&b"L\x07\0\0\0\0\0\0\0S\x0b\0\0\0g\0\x01Geometry"[..], b"S\x04\0\0\0Mesh"].concat();
        let mut file = b"Kaydara FBX Binary  \0\x1a\0".to_vec();
        file.extend(7400u32.to_le_bytes());
        let objects = element("Objects", file.len(), (0, &[]), &|at| {
            element("Geometry", at, (3, &id), &|at| element("Vertices", at, (1, &numbers), &|_| Vec::new()))
        });
        file.extend(objects);
        file.extend([0; 13]);
        let said = text(file);
        let limit = "needs more than 32 MiB, which is the limit for a file of 187 bytes (8 times its size and 32 MiB)";
        assert!(said.starts_with("x.fbx: byte ") && said.contains(limit), "{count}: {said}");
    }
}
