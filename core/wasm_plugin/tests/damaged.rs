//! Damaged or hostile plugins, written in WebAssembly's text format: each gives an error that states the cause, in bounded time
//! and memory.

use choreo_plugin::transfer::to_bytes;
use choreo_plugin::{
    Claim, ExportedScene, Files, ImportOptions, ImportScope, Importer, Manifest, MemoryFiles, Registry,
    SceneExporter, Source,
};
use choreo_wasm_plugin::{Limits, WasmExporter, WasmImporter};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// WebAssembly constant for a result of `length` bytes at the address `place`.
fn result(place: usize, length: usize) -> String {
    format!("(i64.const {})", (place as u64) << 32 | length as u64)
}

/// A plugin with the manifest of `odd 1.0.0` at address 4096, room for arguments at 8192, and additional functions.
fn plugin(more: &str) -> Vec<u8> {
    let manifest = to_bytes(&Manifest::new("odd", "1.0.0", "fails").extensions(["odd"]));
    let data: String = manifest.iter().map(|byte| format!("\\{byte:02x}")).collect();
    let with = |name: &str, default: &str| match more.contains(&format!("(export \"{name}\")")) {
        true => String::new(),
        false => default.to_string(),
    };
    let text = format!(
        "(module {more} {} {} {} {} (data (i32.const 4096) \"{data}\"))",
        with("memory", "(memory (export \"memory\") 2)"),
        with("choreo_abi", "(func (export \"choreo_abi\") (result i32) i32.const 2)"),
        with(
            "choreo_argument",
            "(func (export \"choreo_argument\") (param i32) (result i32) i32.const 8192)"
        ),
        with(
            "choreo_manifest",
            &format!("(func (export \"choreo_manifest\") (result i64) {})", result(4096, manifest.len()))
        ),
    );
    wat::parse_str(text).unwrap_or_else(|e| panic!("{e}"))
}

/// A plugin whose import function has this body.
fn plugin_with_import(body: &str) -> Vec<u8> {
    plugin(&format!("(func (export \"choreo_import\") (result i64) {body})"))
}

struct CompanionFiles;

impl Files for CompanionFiles {
    fn read(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
        match name {
            "side" => Ok(Arc::new(vec![7; 9])),
            _ => Err(format!("no file {name}")),
        }
    }
}

fn compile_error(bytes: &[u8]) -> String {
    WasmImporter::from_bytes(bytes).err().map(|e| e.to_string()).unwrap_or_default()
}

/// The error of an import with little time and memory, after the name of the plugin.
fn import_error(bytes: &[u8]) -> String {
    let limits = Limits { memory: 4 << 20, time: Duration::from_millis(300) };
    let importer = WasmImporter::from_bytes(bytes).unwrap_or_else(|e| panic!("{e}")).with_limits(limits);
    let mut registry = Registry::default();
    registry.add_importer(importer);
    let source = Source { name: "a.odd".into(), bytes: Arc::new(vec![1, 2, 3]) };
    let start = Instant::now();
    let result = registry.import(&source, &CompanionFiles, ImportScope::ALL, &ImportOptions::default(), None);
    assert!(start.elapsed() < Duration::from_secs(20));
    let error = result.expect_err("an error").to_string();
    let plain = error.strip_prefix("a.odd: the plugin odd 1.0.0 has failed: ");
    plain.unwrap_or_else(|| panic!("{error}")).to_string()
}

#[test]
fn a_valid_plugin_returns_its_manifest() {
    let importer = WasmImporter::from_bytes(&plugin("")).unwrap();
    assert_eq!((importer.manifest().name.as_str(), importer.manifest().version.as_str()), ("odd", "1.0.0"));
    let source = Source { name: "a.odd".into(), bytes: Arc::default() };
    assert_eq!(importer.claim(&source), Claim::Extension);
}

#[test]
fn invalid_modules_are_refused() {
    assert!(compile_error(b"").starts_with("it is not a WebAssembly plugin: "), "{}", compile_error(b""));
    assert!(compile_error(b"\x7fELF and more").starts_with("it is not a WebAssembly plugin: "));
    let mut cut = plugin("");
    cut.truncate(cut.len() / 2);
    assert!(compile_error(&cut).starts_with("it is not a WebAssembly plugin: "));
    let empty = wat::parse_str("(module)").unwrap();
    assert_eq!(
        compile_error(&empty),
        "it exports no function choreo_abi with the signature that choreo calls"
    );
    let abi =
        |number: u32| plugin(&format!("(func (export \"choreo_abi\") (result i32) i32.const {number})"));
    assert_eq!(
        compile_error(&abi(0)),
        "it was built for version 0 of the plugin interface, choreo has version 2; build it again with this choreo"
    );
    assert_eq!(
        compile_error(&abi(3)),
        "it was built for version 3 of the plugin interface, choreo has version 2; update choreo"
    );
    let typed = plugin("(func (export \"choreo_manifest\") (param i64) (result i64) i64.const 0)");
    assert_eq!(
        compile_error(&typed),
        "it exports no function choreo_manifest with the signature that choreo calls"
    );
    let short = plugin("(func (export \"choreo_manifest\") (result i64) i64.const 3)");
    assert_eq!(compile_error(&short), format!("{UNREADABLE_RESULT}byte 0: 8 bytes are needed, 3 are left"));
    let unknown = plugin("(import \"env\" \"system\" (func (param i32)))");
    assert!(compile_error(&unknown).contains("unknown import: `env::system`"), "{}", compile_error(&unknown));
    let start = plugin("(func $s (loop br 0)) (start $s)");
    assert_eq!(compile_error(&start), "it takes more than 2 s, which is the limit");
    let large = plugin("(memory (export \"memory\") 60000)");
    assert!(compile_error(&large).contains("memory"), "{}", compile_error(&large));
}

const UNREADABLE_RESULT: &str = "its result cannot be read: ";

/// A manifest whose magic bytes are lists in the plugin's memory: `odd 1.0.0` without extensions.
fn magic_of_plugin(lists: &[(u64, u64)]) -> String {
    let start = to_bytes(&Manifest::new("odd", "1.0.0", ""));
    // The manifest ends with the number of magic byte lists and the number of options.
    let mut bytes = start[..start.len() - 16].to_vec();
    bytes.extend((lists.len() as u64).to_le_bytes());
    for (count, place) in lists {
        bytes.extend((1u64 << 63 | count).to_le_bytes().iter().chain(&place.to_le_bytes()));
    }
    bytes.extend(0u64.to_le_bytes());
    let data: String = bytes.iter().map(|byte| format!("\\{byte:02x}")).collect();
    let returned = result(0, bytes.len());
    let manifest = format!(
        "(func (export \"choreo_manifest\") (result i64) {returned}) (data (i32.const 0) \"{data}\")
        (memory (export \"memory\") 2)"
    );
    match WasmImporter::from_bytes(&plugin(&manifest)) {
        Ok(importer) => format!("{:?}", importer.manifest().magic),
        Err(error) => error.to_string(),
    }
}

#[test]
fn lists_by_address_are_limited_to_the_memory_of_the_plugin() {
    assert_eq!(magic_of_plugin(&[(3, 0), (0, 1 << 17)]), "[[3, 0, 0], []]");
    let outside = |count: u64, place: u64| magic_of_plugin(&[(count, place)]);
    assert!(outside(1, 1 << 17).ends_with(": a list of 1 bytes at 131072, outside of its memory"));
    assert!(outside(2, u64::MAX).contains("outside of its memory"));
    assert!(outside((1 << 63) - 1, 8).contains("outside of its memory"));
    // All lists together have at most the 128 KiB of the memory, even if they refer to the same address.
    assert!(magic_of_plugin(&[(1 << 16, 0), (1 << 16, 0)]).starts_with("[["));
    let third = magic_of_plugin(&[(1 << 16, 0), (1 << 16, 0), (1, 0)]);
    assert!(third.ends_with("its lists have more bytes than its memory"), "{third}");
}

#[test]
fn failed_imports_report_their_cause() {
    assert!(import_error(&plugin_with_import("unreachable")).starts_with("it was stopped: "));
    assert_eq!(
        import_error(&plugin_with_import("(loop br 0) i64.const 0")),
        "it takes more than 0.3 s, which is the limit"
    );
    assert_eq!(
        import_error(&plugin(
            "(func $f (export \"choreo_import\") (result i64) call $f i64.const 1 i64.add)"
        )),
        "its calls are nested too deeply; does a function call itself without end?"
    );
    // The plugin allocates until an allocation fails, and then traps.
    let bomb = "(loop (br_if 0 (i32.ne (memory.grow (i32.const 1)) (i32.const -1)))) unreachable";
    let bombed = import_error(&plugin_with_import(bomb));
    assert!(bombed.contains("its memory may be 4 MiB at most"), "{bombed}");
    let outside = import_error(&plugin_with_import("i32.const 0x7fffffff i32.load drop i64.const 0"));
    assert!(outside.contains("out of bounds memory access"), "{outside}");
    assert_eq!(
        import_error(&plugin("")),
        "it exports no function choreo_import with the signature that choreo calls"
    );
}

#[test]
fn invalid_results_are_refused() {
    let outside = import_error(&plugin_with_import(&result(4096, 0x7fff_ffff)));
    assert_eq!(outside, "its result, 2147483647 bytes at 4096, lies outside of its memory");
    let empty = import_error(&plugin_with_import(&result(131_072, 0)));
    assert_eq!(empty, format!("{UNREADABLE_RESULT}byte 0: 1 bytes are needed, 0 are left"));
    // The first byte of the argument, the length 5 of the file name "a.odd", is no variant of a reply.
    let argument = import_error(&plugin_with_import(&result(8192, 30)));
    assert_eq!(argument, format!("{UNREADABLE_RESULT}byte 1: ImportReply has no variant 5"));
    let far = "(func (export \"choreo_argument\") (param i32) (result i32)
        (select (i32.const 0x7ffffff0) (i32.const 8192) (local.get 0)))
        (func (export \"choreo_import\") (result i64) i64.const 0)";
    assert_eq!(import_error(&plugin(far)), "its argument at 2147483632 lies outside of its memory");
    // An asset that claims 2^60 names: no memory is reserved for them.
    let many = "(i32.store8 (i32.const 4096) (i32.const 0)) (i64.store (i32.const 4097) (i64.const 0))
        (i64.store (i32.const 4105) (i64.const 0x1000000000000000)) ";
    let many = import_error(&plugin_with_import(&(many.to_string() + &result(4096, 17))));
    assert_eq!(many, format!("{UNREADABLE_RESULT}byte 17: 8 bytes are needed, 0 are left"));
}

#[test]
fn host_functions_check_their_arguments() {
    let import = "(import \"choreo\" \"read\" (func $read (param i32 i32) (result i64)))
        (import \"choreo\" \"take\" (func $take (param i32)))
        (import \"choreo\" \"write\" (func $write (param i32 i32 i32)))
        (import \"choreo\" \"numbers\" (func $numbers (param i32 i32 i32 i32 i32 i32) (result i32)))
        (import \"choreo\" \"snapshot\" (func $snapshot (param i64) (result i32)))";
    let calling = |body: &str| {
        import_error(&plugin(&format!("{import} (func (export \"choreo_import\") (result i64) {body})")))
    };
    let read = |place: &str, length: &str| {
        calling(&format!("(drop (call $read (i32.const {place}) (i32.const {length}))) i64.const 0"))
    };
    assert_eq!(read("0x7fffffff", "4"), "bytes outside of the plugin's memory");
    assert_eq!(read("-1", "16"), "bytes outside of the plugin's memory");
    assert_eq!(read("0", "-1"), "a text of 4294967295 bytes, 65536 are allowed");
    let side =
        "(i32.store (i32.const 0) (i32.const 0x65646973)) (drop (call $read (i32.const 0) (i32.const 4)))";
    assert_eq!(
        calling(&format!("{side} (call $take (i32.const 131070)) i64.const 0")),
        "a place outside of the plugin's memory"
    );
    // The bytes of the file arrive: nine bytes of value 7, which is no variant of a reply.
    let arrived = format!("(call $take (i32.const 4096)) {}", result(4096, 9));
    let unreadable = |variant: u8| format!("{UNREADABLE_RESULT}byte 1: ImportReply has no variant {variant}");
    assert_eq!(calling(&format!("{side} {arrived}")), unreadable(7));
    // The bytes of the imported file, 1, 2, 3, are ready before the first read; the plugin copies them over its argument.
    assert_eq!(calling(&format!("(call $take (i32.const 4095)) {}", result(4097, 9))), unreadable(3));
    // For a missing file, the bytes of the error text arrive: "no file " begins with 110.
    let none =
        "(i32.store (i32.const 0) (i32.const 0x65646970)) (drop (call $read (i32.const 0) (i32.const 4)))";
    assert_eq!(calling(&format!("{none} {arrived}")), unreadable(110));
    // Numbers of the text "12 7" at address 0: each value takes eight bytes, and a request for more numbers is limited.
    let numbers = |length: &str, values: &str, ends: &str, reply: String| {
        let text = "(i32.store (i32.const 0) (i32.const 0x37203231))";
        let lists = format!("(i32.const {values}) (i32.const {ends}) (i32.const -1)");
        let call = format!("(call $numbers (i32.const 3) (i32.const 0) (i32.const {length}) {lists})");
        calling(&format!("{text} (drop {call}) {reply}"))
    };
    assert_eq!(numbers("4", "4096", "64", result(4096, 9)), unreadable(12));
    assert_eq!(numbers("4", "4096", "64", result(4104, 9)), unreadable(7));
    assert_eq!(numbers("4", "4096", "64", result(68, 9)), unreadable(4));
    assert_eq!(numbers("-1", "4096", "64", result(0, 9)), "bytes outside of the plugin's memory");
    for (values, ends) in [("131060", "64"), ("4096", "131068")] {
        assert_eq!(numbers("4", values, ends, result(0, 9)), "a place outside of the plugin's memory");
    }
    // Importers can neither request snapshots nor write files.
    let write = "(call $write (i32.const 0) (i32.const 0) (i32.const 8)) i64.const 9";
    assert_eq!(calling(write), "an importer writes no files");
    let pose = "(drop (call $snapshot (i64.const 0))) i64.const 9";
    assert_eq!(calling(pose), "there is no scene to ask for poses");
}

/// Files of an export of an empty scene, or the error without the plugin's name.
fn exported(body: &str) -> Result<MemoryFiles, String> {
    let import = "(import \"choreo\" \"beside\" (func $beside (param i32 i32) (result i32)))
        (import \"choreo\" \"write\" (func $write (param i32 i32 i32)))";
    let text = format!("{import} (func (export \"choreo_export\") (result i64) {body})");
    let exporter = WasmExporter::from_bytes(&plugin(&text)).unwrap_or_else(|e| panic!("{e}"));
    let mut files = MemoryFiles::default();
    let scene = ExportedScene::new("a.rhai", Arc::default());
    let notes = exporter.export(&scene, &mut files).map_err(|e| e.to_string());
    let plain = |e: String| e.strip_prefix("the plugin odd 1.0.0 has failed: ").unwrap_or(&e).to_string();
    notes.map(|_| files).map_err(plain)
}

#[test]
fn exports_write_only_to_open_files() {
    // A reply without notes is nine zero bytes, which are at address 0. The written text is the name in the manifest, at 4104.
    let written = "(call $write (i32.const 0) (i32.const 4104) (i32.const 3))
        (call $write (call $beside (i32.const 4104) (i32.const 1)) (i32.const 4105) (i32.const 2)) i64.const 9";
    let files = exported(written).unwrap();
    assert_eq!((files.main.as_slice(), files.beside["o"].as_slice()), (&b"odd"[..], &b"dd"[..]));
    let unknown = "(call $write (i32.const 1) (i32.const 0) (i32.const 8)) i64.const 9";
    assert_eq!(exported(unknown).unwrap_err(), "there is no file 1");
    let outside = "(call $write (i32.const 0) (i32.const 131070) (i32.const 8)) i64.const 9";
    assert_eq!(exported(outside).unwrap_err(), "bytes outside of the plugin's memory");
    let odd = format!("{UNREADABLE_RESULT}byte 1: ExportReply has no variant 3");
    assert_eq!(exported(&result(4096, 20)).unwrap_err(), odd);
}
