//! Buffers and images beside the file, inside it and under odd names.

use crate::common;
use crate::common::sample::sample;
use choreo_asset::Asset;
use choreo_plugin::{Files, ImportOptions, ImportScope, Importer};
use import_gltf::GltfImporter;
use serde_json::json;
use std::sync::{Arc, Mutex};

/// Files by name, and the names that were requested.
#[derive(Default)]
struct MemoryFolder {
    files: Vec<(&'static str, Vec<u8>)>,
    asked: Mutex<Vec<String>>,
}

impl Files for MemoryFolder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        self.asked.lock().unwrap().push(relative.to_string());
        let found = self.files.iter().find(|(name, _)| *name == relative);
        found.map(|(_, bytes)| Arc::new(bytes.clone())).ok_or(format!("\"{relative}\": file not found"))
    }
}

fn import(text: Vec<u8>, folder: &MemoryFolder) -> Result<Asset, choreo_plugin::ImportError> {
    let source = common::source("model.gltf", text);
    GltfImporter::new().import(&source, folder, ImportScope::ALL, &ImportOptions::default())
}

fn with_uri(uri: &str) -> Vec<u8> {
    let (mut json, _) = sample();
    json["buffers"][0]["uri"] = json!(uri);
    serde_json::to_vec(&json).unwrap()
}

fn base64(bytes: &[u8]) -> String {
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let n = chunk.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - chunk.len()));
        for i in 0..=chunk.len() {
            out.push(char::from(letters[(n >> (18 - 6 * i)) as usize & 63]));
        }
        out.push_str(&"=".repeat(3 - chunk.len()));
    }
    out
}

fn is_the_sample(asset: &Asset) {
    assert_eq!(asset.warnings, []);
    assert_eq!(
        (asset.clips.len(), asset.skins.len(), asset.meshes[0].primitives[0].positions.len()),
        (1, 1, 3)
    );
}

#[test]
fn uris_are_resolved_beside_the_file() {
    for (uri, name) in [
        ("data.bin", "data.bin"),
        ("./sub/data.bin", "./sub/data.bin"),
        ("my%20data%2Bmore.bin", "my data+more.bin"),
        ("%e6%a8%a1%E5%9E%8B.bin", "模型.bin"),
        ("模型 (1).bin", "模型 (1).bin"),
        ("100%.bin", "100%.bin"),
        ("dots..and,commas;.bin", "dots..and,commas;.bin"),
        ("data.txt", "data.txt"),
        // Not encoded at all, though it looks it.
        ("a%20b.bin", "a%20b.bin"),
    ] {
        let folder = MemoryFolder { files: vec![(name, sample().1)], ..MemoryFolder::default() };
        is_the_sample(&import(with_uri(uri), &folder).unwrap_or_else(|e| panic!("{uri}: {e}")));
    }
    // The decoded name comes first, and the message names it.
    let folder = MemoryFolder {
        files: vec![("a b.bin", sample().1), ("a%20b.bin", vec![0; 4])],
        ..MemoryFolder::default()
    };
    is_the_sample(&import(with_uri("a%20b.bin"), &folder).unwrap());
    assert_eq!(*folder.asked.lock().unwrap(), ["a b.bin"], "read once");
    let text = common::error_text(import(with_uri("a%20b.bin"), &MemoryFolder::default()));
    assert!(text.ends_with("(buffers[0]): \"a b.bin\": file not found"), "{text}");
}

#[test]
fn data_uris_are_decoded() {
    let (_, bin) = sample();
    let text = base64(&bin);
    let lines: String =
        text.as_bytes().chunks(64).map(|l| format!("{}\r\n", String::from_utf8_lossy(l))).collect();
    for uri in [
        format!("data:application/octet-stream;base64,{text}"),
        format!("data:application/gltf-buffer;base64,{text}"),
        format!("data:text/plain;charset=utf-8;base64,{text}"),
        format!("DATA:;Base64,{text}"),
        format!("data:;base64,{}", text.trim_end_matches('=')),
        format!("data:;base64,\n{lines}"),
        format!("data:;base64,{}", text.replace('+', "%2B").replace('/', "%2F").replace('=', "%3D")),
        format!("data:;base64,{}", text.replace('+', "-").replace('/', "_")),
        format!("data:,{}", bin.iter().map(|b| format!("%{b:02x}")).collect::<String>()),
    ] {
        let folder = MemoryFolder::default();
        is_the_sample(&import(with_uri(&uri), &folder).unwrap_or_else(|e| panic!("{}: {e}", &uri[..40])));
        assert!(folder.asked.lock().unwrap().is_empty(), "no file is read");
    }
}

#[test]
fn a_byte_order_mark_and_buffers_without_a_uri() {
    let folder = MemoryFolder { files: vec![("data.bin", sample().1)], ..MemoryFolder::default() };
    let marked = [&b"\xEF\xBB\xBF"[..], &with_uri("data.bin")].concat();
    is_the_sample(&import(marked, &folder).unwrap());
    let text = common::error_text(import(serde_json::to_vec(&sample().0).unwrap(), &MemoryFolder::default()));
    assert!(text.ends_with("(buffers[0]): has neither a uri nor a binary chunk of a GLB"), "{text}");
    // One that nothing uses is not missed.
    let (mut json, bin) = sample();
    json["buffers"].as_array_mut().unwrap().push(json!({"byteLength": 1 << 20}));
    is_the_sample(&common::import_bytes("spare.glb", common::glb_of(&json, &bin)).unwrap());
}
