//! Importers in Rhai on files made here: the imported assets, and the error messages.

use choreo_asset::{Asset, Projection};
use choreo_motion::Time;
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, OptionValue, Source};
use choreo_rhai_importer::RhaiImporter;
use glam::{Quat, Vec2, Vec3};
use std::sync::Arc;

/// Magic, count, then rows of position, normal and uv, then u32 indices.
const TABLE_IMPORTER: &str = r#"
fn manifest() {
    #{
        name: "tri", about: "a table of vertices", extensions: "tri", magic: "TRI1",
        options: #{
            scale: #{ value: 1.0, min: 0.001, max: 1000.0, about: "metres a unit" },
            up: #{ value: "y", one_of: ["y", "z"], about: "upward axis" },
        },
    }
}

fn load(file) {
    let b = file.bytes;
    let vertices = b.u32(4);
    let row = 32;
    let positions = b.f32s(8, vertices, #{ width: 3, stride: row }) * file.options.scale;
    if file.options.up == "z" {
        // x y z becomes x z -y.
        positions = positions.columns(3, [0, 2, 1]) * numbers([1, 1, -1]).rows(3, numbers(zeros(vertices)));
    }
    let end = 8 + vertices * row;
    mesh(#{
        name: "table",
        positions: positions,
        normals: b.f32s(20, vertices, #{ width: 3, stride: row }),
        uvs: b.f32s(32, vertices, #{ width: 2, stride: row }),
        indices: b.u32s(end, (b.len - end) / 4),
        material: material(#{ color: [1.0, 0.5, 0.25] }),
    });
}

fn zeros(count) {
    let all = [];
    for i in 0..count { all.push(0); }
    all
}
"#;

fn table_bytes() -> Vec<u8> {
    let mut bytes = b"TRI1\x03\0\0\0".to_vec();
    for (x, y) in [(0.0f32, 0.0f32), (1.0, 0.0), (0.0, 2.0)] {
        for v in [x, y, 3.0, 0.0, 0.0, 1.0, x, y] {
            bytes.extend(v.to_le_bytes());
        }
    }
    bytes.extend([0u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

struct NamesFile;

impl Files for NamesFile {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        match relative {
            "names.txt" => Ok(Arc::new(b"hip\nknee\n".to_vec())),
            other => Err(format!("cannot read \"{other}\": no such file")),
        }
    }
}

fn importer(text: &str) -> RhaiImporter {
    RhaiImporter::from_text("my.importer.rhai", text).unwrap_or_else(|e| panic!("{e}"))
}

fn source(name: &str, bytes: &[u8]) -> Source {
    Source { name: name.into(), bytes: Arc::new(bytes.to_vec()) }
}

fn import(text: &str, bytes: &[u8]) -> Result<Asset, ImportError> {
    let importer = importer(text);
    let options = importer.manifest().complete(&ImportOptions::default()).unwrap();
    importer.import(&source("a.dat", bytes), &NamesFile, ImportScope::ALL, &options)
}

/// Imports the bytes 1 to 8 with an importer whose `load` runs this code.
fn import_with_body(code: &str) -> Result<Asset, ImportError> {
    import(
        &format!("fn manifest() {{ #{{ name: \"x\" }} }}\nfn load(file) {{\n{code}\n}}"),
        &[1, 2, 3, 4, 5, 6, 7, 8],
    )
}

/// The import error of this code, without the source line and the caret below it.
fn import_error(code: &str) -> String {
    first_line(import_with_body(code).err().unwrap_or_else(|| panic!("no error: {code}")))
}

fn first_line(error: impl std::fmt::Display) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}

#[test]
fn binary_mesh_is_imported_with_all_attributes() {
    let asset = import(TABLE_IMPORTER, &table_bytes()).unwrap();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.positions, [Vec3::new(0., 0., 3.), Vec3::new(1., 0., 3.), Vec3::new(0., 2., 3.)]);
    assert_eq!(p.normals, [Vec3::Z; 3]);
    assert_eq!(p.uvs[0], [Vec2::ZERO, Vec2::X, Vec2::Y * 2.0]);
    assert_eq!(p.indices, [0, 1, 2]);
    assert_eq!(asset.materials[0].base_color.to_array(), [1.0, 0.5, 0.25, 1.0]);
}

#[test]
fn colors_are_linear_numbers_or_css_names() {
    let of = |color: &str| {
        let code = format!(
            "material(#{{ color: {color}, emissive: {color} }}); light(#{{ kind: \"sun\", color: {color} }});"
        );
        let asset = import_with_body(&code).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(asset.materials[0].emissive, asset.materials[0].base_color.truncate());
        assert_eq!(asset.lights[0].light.color, asset.materials[0].emissive);
        asset.materials[0].base_color.to_array()
    };
    assert_eq!(of("[0.25, 0.5, 1.0]"), [0.25, 0.5, 1.0, 1.0]);
    assert_eq!(of("\"rebeccapurple\""), of("\"#663399\""));
    assert_eq!(of("\"#ff000000\""), [1.0, 0.0, 0.0, 0.0]);
    for (color, message) in [
        ("\"rde\"", "material: color: unknown color \"rde\"; did you mean \"red\"?"),
        ("[1, 2]", "material: color must be 3 or 4 numbers, got 2"),
    ] {
        let text = import_error(&format!("material(#{{ color: {color} }});"));
        assert!(text.ends_with(message), "{text}");
    }
}

#[test]
fn options_of_the_manifest_are_checked_and_passed_to_load() {
    let importer = importer(TABLE_IMPORTER);
    let m = importer.manifest();
    assert_eq!(
        (m.name.as_str(), m.extensions[0].as_str(), m.magic[0].as_slice()),
        ("tri", "tri", &b"TRI1"[..])
    );
    let given = |name: &str, v| m.complete(&ImportOptions([(name.to_string(), v)].into()));
    let wrong = given("scale", OptionValue::Number(0.0)).unwrap_err();
    assert_eq!(wrong.message, "tri: option scale must be a number from 0.001 to 1000, got 0");
    let mut options = given("scale", OptionValue::Number(0.5)).unwrap();
    options.0.insert("up".into(), OptionValue::Text("z".into()));
    let asset =
        importer.import(&source("a.tri", &table_bytes()), &NamesFile, ImportScope::ALL, &options).unwrap();
    assert_eq!(asset.meshes[0].primitives[0].positions[2], Vec3::new(0.0, 1.5, -1.0));
}

#[test]
fn claim_uses_magic_extension_or_the_claim_function() {
    let tri = importer(TABLE_IMPORTER);
    assert_eq!(tri.claim(&source("x", b"TRI1....")), Claim::Content(90));
    assert_eq!(tri.claim(&source("x.TRI", b"")), Claim::Extension);
    assert_eq!(tri.claim(&source("x.obj", b"v 0 0 0")), Claim::NotMine);
    let own = importer(
        "fn manifest() { #{ name: \"x\", extensions: \"x\" } } fn load(file) {}
         fn claim(file) { if file.bytes.u16(0) == 0x0201 { 70 } else { false } }",
    );
    assert_eq!(own.claim(&source("a", &[1, 2])), Claim::Content(70));
    assert_eq!(own.claim(&source("a.x", &[1, 3])), Claim::NotMine);
    // Too short for what `claim` reads: the name may still be right.
    assert_eq!(own.claim(&source("a.x", &[1])), Claim::Extension);
    assert_eq!(own.claim(&source("a", &[1])), Claim::NotMine);
    let endless = importer("fn manifest() { #{ name: \"x\" } } fn load(f) {} fn claim(f) { loop {} }");
    assert_eq!(endless.claim(&source("a", &[])), Claim::NotMine);
}

#[test]
fn joints_clips_warnings_and_read_files_are_imported() {
    let asset = import_with_body(
        r#"
        let names = read("names.txt").lines();
        let hip = joint(names[0], -1, #{ translation: [0, 1, 0] });
        let knee = joint(names[1], hip, #{ rotation: [0, 0, 0, 1] });
        clip("bend", [#{ joint: knee, path: "rotation", times: [0, 0.5], values: [[0, 0, 0, 1], [1, 0, 0, 0]] }]);
        mesh(#{ positions: [0,0,0, 1,0,0, 0,1,0], joints: [0, 1, 1], weights: [1, 1, 1], joint: hip });
        warn("line 3", "guessed");
        "#,
    )
    .unwrap();
    assert_eq!(asset.skeleton.names(), ["hip", "knee"]);
    assert_eq!(asset.skins[0].joints, [0, 1]);
    assert_eq!(asset.clips[0].duration.as_secs(), 0.5);
    assert_eq!(asset.warnings[0].place, "line 3");
    let rest = asset.skeleton.rest();
    assert_eq!((rest[0].translation, rest[1].rotation), (Vec3::Y, Quat::IDENTITY));
}

#[test]
fn numbers_are_read_in_both_byte_orders_and_all_widths() {
    import_with_body(
        r#"
        let b = file.bytes;
        let same = |a, b| if a != b { throw `${a} is not ${b}`; };
        same.call(b.u8(1), 2);          same.call(b.u16(0), 0x0201);     same.call(b.big().u16(0), 0x0102);
        same.call(b.u32(4), 0x08070605); same.call(b.big().u32(4), 0x05060708);
        same.call(b.part(2, 4).u8(0), 3); same.call(b.part(2, 4).len, 4);
        same.call(b.u8s(0, 4).array(), [1.0, 2.0, 3.0, 4.0]);
        same.call(b.u8s(0, 2, #{ stride: 3 }).array(), [1.0, 4.0]);
        same.call(b.u8s(0, 2, #{ width: 2, stride: 4 }).array(), [1.0, 2.0, 5.0, 6.0]);
        same.call(b.u8s(4, 1, #{ normalized: true })[0], 5.0 / 255.0);
        same.call(b.u8s(0, 8).columns(2, [1]).array(), [2.0, 4.0, 6.0, 8.0]);
        same.call(b.u8s(0, 4).rows(2, numbers([1, 0])).array(), [3.0, 4.0, 1.0, 2.0]);
        same.call((b.u8s(0, 2) * 2 + 1).array(), [3.0, 5.0]);
        same.call(numbers("1 2/3,-4e1").array(), [1.0, 2.0, 3.0, -40.0]);
        same.call(" a  b ".words(), ["a", "b"]);
        same.call(b.find("\x04\x05"), 3); same.call(b.find("zz"), -1);
        same.call(b.len, 8);
        "#,
    )
    .unwrap();
    let json = import(
        "fn manifest() { #{ name: \"j\" } }\nfn load(file) { let v = file.bytes.json(); if v.a[1].b != 2 { throw `${v}` } }",
        br#"{"a": [1.5, {"b": 2}]}"#,
    );
    json.unwrap();
}

#[test]
fn errors_state_the_script_line_and_the_byte_of_the_file() {
    let cases = [
        ("file.bytes.f32s(4, 2)", "f32s: needs the bytes 4..12, the file has 8"),
        ("file.bytes.part(4, 4).u16(3)", "u16: needs the bytes 7..9, this part is 4..8"),
        ("file.bytes.u8(-1)", "u8: needs the bytes -1..0, the file has 8"),
        (
            "file.bytes.u8s(0, 9223372036854775807, #{ stride: 1000 })",
            "u8s: cannot read 9223372036854775807 rows of 1000 bytes",
        ),
        (
            "file.bytes.u8s(0, 1, #{ strid: 1 })",
            "u8s: unknown option \"strid\"; did you mean \"stride\"?; options: width, stride, normalized",
        ),
        (
            "file.bytes.f32s(0, 1, #{ normalized: true })",
            "f32s: normalized must be true or false; true needs an integer type of at most 32 bits",
        ),
        ("jont(\"a\")", "unknown function jont; did you mean \"joint\"?"),
        (
            "mesh(#{ position: [] })",
            "mesh: unknown field \"position\"; did you mean \"positions\"?; known fields: name, joint, positions, indices, normals, uvs, colors, joints, weights, inverse_bind, material, parts, morphs",
        ),
        (
            "mesh(#{ positions: [0,0,0], indices: [0, 0, 1] })",
            "mesh \"mesh 0\": indices[2] is 1, but the number of vertices is 1",
        ),
        (
            "mesh(#{ positions: [0,0,0], indices: [0.5, 0, 1] })",
            "mesh: indices[0] is 0.5, must be a whole number from 0",
        ),
        ("mesh(#{ positions: \"a\" })", "mesh: positions must be numbers, or an array of numbers, got text"),
        (
            "image(#{ width: 1, height: 1, pixels: [0, 255, 256, 255] })",
            "image: pixels[2] is 256, must be from 0 to 255",
        ),
        ("read(\"../x\")", "cannot read \"../x\": no such file"),
        ("loop { }", "more than 50000000 steps, which is the limit: is there an endless loop?"),
        (
            "let a = [1]; loop { a += a; }",
            "an array or map of more than 1000000 elements, which is the limit; numbers(…) and f32s(…) hold more",
        ),
        ("let a = \"ab\"; loop { a += a; }", "a text of more than 67108864 bytes, which is the limit"),
        ("parse_int(\"fg\", 16)", "parse_int: \"fg\" is no whole number in this radix"),
        ("parse_int(\"1\", 1)", "parse_int: \"1\" is no whole number in this radix"),
        ("if parse_int(\"-ff\", 16) != -255 { throw \"no\" } throw \"yes\"", "yes"),
        ("parse_int(\"1.5\")", "parse_int: \"1.5\" is no whole number"),
        ("parse_float(\"one\")", "parse_float: \"one\" is no number"),
        ("if parse_int(\" 7 \") + parse_float(\"0.5\") != 7.5 { throw \"no\" } throw \"yes\"", "yes"),
        ("let a = \"a\" - 1;", "cannot compute text - int"),
        (
            "let a = 6; if a & 4 != 0 { }",
            "cannot compute int & bool; comparisons bind closer than &: put parentheses around a & b",
        ),
        ("throw \"not today\"", "not today"),
    ];
    for (code, message) in cases {
        assert_eq!(
            import_error(code).split_once(": ").unwrap().1.split_once(": ").unwrap().1,
            message,
            "{code}"
        );
    }
    let deep = "fn manifest() { #{ name: \"my\" } }\nfn down(n) { down(n + 1) }\nfn load(file) { down(0) }";
    let deep = first_line(import(deep, b"").err().unwrap_or_else(|| panic!("no error")));
    let calls = "more than 48 nested calls, which is the limit: does a function call itself without end?";
    assert!(deep.ends_with(calls), "{deep}");
    assert!(
        import_error("let a = 1;\n   file.bytes.u8(9)").starts_with("a.dat: my.importer.rhai:4:15: u8: ")
    );
}

#[test]
fn errors_show_the_source_line_and_a_suggestion() {
    let error = import_with_body("  let b = file.bytes;\n\tlet n = b.starts_wth(2); // é").unwrap_err();
    let shown = "unknown function starts_wth; did you mean \"starts_with\"?\n    let n = b.starts_wth(2); // é\n              ^";
    assert_eq!((error.what.as_str(), error.place.as_str()), (shown, "my.importer.rhai:4:12"));
    let cases = [
        ("file.byte.len", "unknown property byte; did you mean \"bytes\"?"),
        ("file.options.scal", "unknown property scal"),
        ("file.bytes.length", "unknown property length; did you mean \"len\"?"),
        ("let vertices = 3; vertice + 1", "unknown variable vertice; did you mean \"vertices\"?"),
        ("let x = joint;", "unknown variable joint; joint is a function: write joint(…)"),
        ("fiel.bytes", "unknown variable fiel; did you mean \"file\"?"),
        ("zzz + 1", "unknown variable zzz"),
        ("let w = \"a b\".wrods();", "unknown function wrods; did you mean \"words\"?"),
        ("let a = [1]; a.filtre(|x| x > 0);", "unknown function filtre; did you mean \"filter\"?"),
        ("helpr(1)", "unknown function helpr; did you mean \"helper\"?"),
        ("file.bytes.u8(\"0\")", "wrong arguments: there is no u8(Bytes, text); there is u8(Bytes, int)"),
        (
            "let n = file.bytes.u8s(0, 2); file.bytes.u8(n[0])",
            "wrong arguments: there is no u8(Bytes, float); there is u8(Bytes, int); x.to_int() makes a whole number of a float",
        ),
        ("helper(1, 2)", "wrong arguments: there is no helper(int, int)"),
    ];
    for (code, message) in cases {
        let text = format!(
            "fn manifest() {{ #{{ name: \"x\" }} }}\nfn helper(a) {{ a }}\nfn load(file) {{\n{code}\n}}"
        );
        assert_eq!(first_line(import(&text, &[1; 8]).unwrap_err().what), message, "{code}");
    }
    let text =
        "fn manifest() { #{ name: \"x\" } }\nfn load(file) { let seen = 1; inner() }\nfn inner() { seen }";
    let error = first_line(import(text, b"").unwrap_err().what);
    assert_eq!(error, "unknown variable seen: a function sees its parameters only; pass it as one");
}

#[test]
fn clip_for_a_missing_joint_is_an_error() {
    let text = import_error("clip(\"c\", [#{ joint: 3, path: \"scale\", times: [0], values: [1, 1, 1] }])");
    assert!(text.starts_with("a.dat: my.importer.rhai: clip \"c\": "), "{text}");
}

#[test]
fn memory_beyond_the_budget_is_an_error_and_freed_memory_is_returned() {
    let text =
        import_error("let n = numbers([0]); loop { n = file.bytes.u8s(0, 8).rows(1, numbers(many())) }");
    assert!(text.contains("unknown function many"), "{text}");
    let text = import_error(
        "let a = []; a.pad(100000, 0); let rows = numbers(a); let n = numbers([0]); let all = [];
         loop { all.push(n.rows(1, rows)); }",
    );
    assert!(
        text.ends_with(
            "too much memory: all arrays together may take 64 MB, 64 MB plus 16 times the file's size"
        ),
        "{text}"
    );
    // What is dropped is given back: 160 MB one after the other.
    let dropped = "let a = []; a.pad(100000, 0); let rows = numbers(a); let n = numbers([0]);
         for i in 0..200 { n = n.rows(1, rows); n = numbers([0]); }";
    import_with_body(dropped).unwrap_or_else(|e| panic!("{e}"));
    // As are the numbers of each line of a text: each took 32 KiB once.
    let lines = "let all = numbers(); for i in 0..5000 { all.append(numbers(\"0 1 2\")); } if all.len != 15000 { throw all.len }";
    import_with_body(lines).unwrap_or_else(|e| panic!("{e}"));
    let text = import_error("let a = []; a.pad(2000000, 0)");
    assert!(text.contains("more than 1000000 elements, which is the limit"), "{text}");
    assert!(import_error("fn_deep(1)").contains("unknown function"));
}

#[test]
fn geometry_outside_the_import_scope_is_not_decoded() {
    let importer = importer(TABLE_IMPORTER);
    let options = importer.manifest().complete(&ImportOptions::default()).unwrap();
    let clips =
        ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };
    let asset = importer.import(&source("a.tri", &table_bytes()), &NamesFile, clips, &options).unwrap();
    assert!(asset.meshes.is_empty());
}

#[test]
fn invalid_importers_report_line_and_reason() {
    let cases = [
        ("fn manifest() { #{ name: \"x\" } }", "1:1: an importer needs fn load(file)"),
        ("fn load(f) {}", "1:1: an importer needs fn manifest()"),
        (
            "\nfn manifest() { #{ nam: 1 } } fn load(f) {}",
            "2:1: manifest: unknown field \"nam\"; did you mean \"name\"?; known fields: name, version, about, extensions, magic, options",
        ),
        (
            "fn manifest() { #{ name: \"a b\" } } fn load(f) {}",
            "1:1: manifest: name \"a b\" must be letters, digits, - and _, at most 60",
        ),
        (
            "fn manifest() { #{ name: \"a\", options: #{ s: #{ value: 2, max: 1 } } } } fn load(f) {}",
            "1:1: manifest: option s: the value 2 is not within -1000000000 to 1",
        ),
        (
            "fn manifest() { let a = 0; loop { a += 1; } } fn load(f) {}",
            "1:1: more than 10000 steps, which is the limit: is there an endless loop?",
        ),
        ("fn manifest() { 3 } fn load(f) {}", "1:1: manifest() must return an object map #{ name: …, … }"),
        (
            "/* /* in */ in */ fn manifest() { #{ name: \"a /* b\" } }\nfn load(f) {} /* fn claim(f) { 1 } /* */",
            "2:15: this comment is never closed: nothing after it is read",
        ),
    ];
    for (text, message) in cases {
        let error = first_line(RhaiImporter::from_text("my.importer.rhai", text).err().unwrap());
        assert_eq!(error, format!("my.importer.rhai:{message}"), "{text}");
    }
    let error = RhaiImporter::from_text("my.importer.rhai", "fn load(f) {\n  let = 3;\n}").err().unwrap();
    assert_eq!((error.line, error.column), (2, 7), "{error}");
}

#[test]
fn scripts_cannot_use_eval_import_or_timestamp() {
    for code in ["eval(\"1\")", "import \"x\" as x;", "timestamp()"] {
        let text = format!("fn manifest() {{ #{{ name: \"x\" }} }} fn load(f) {{ {code} }}");
        let refused = match RhaiImporter::from_text("m.importer.rhai", &text) {
            Err(_) => true,
            Ok(i) => {
                i.import(&source("a", &[]), &NamesFile, ImportScope::ALL, &ImportOptions::default()).is_err()
            }
        };
        assert!(refused, "{code}");
    }
}

#[test]
fn lines_are_iterated_and_polygons_are_triangulated() {
    let file = b"\xef\xbb\xbf# head\r\n0 0 0\r\n1 0 0\n\n1 1 0\n# between\n0 1 0\n4 0 1 2 3\n3 0 1 2";
    let code = "let lines = file.bytes.lines();
        if lines.len != 9 || lines[1] != \"0 0 0\" { throw `${lines.len} ${lines[1]}` }
        let data = lines.without(\"#\");
        let count = 0;
        for line in data { count += 1; }
        if count != 6 { throw count }
        let points = data.part(0, 4).numbers();
        let polygons = numbers();
        for line in data.part(4, 2) { polygons.append(numbers(line)); }
        mesh(#{ positions: points, indices: polygons.fans() });";
    let text = format!("fn manifest() {{ #{{ name: \"x\" }} }}\nfn load(file) {{\n{code}\n}}");
    let asset = import(&text, file).unwrap_or_else(|e| panic!("{e}"));
    let primitive = &asset.meshes[0].primitives[0];
    assert_eq!(primitive.positions.len(), 4);
    assert_eq!(primitive.indices.to_vec(), [0, 1, 2, 0, 2, 3, 0, 1, 2]);
    let wrong = import_error("numbers([3, 0, 1]).fans()");
    assert!(wrong.contains("fans: number 0 is 3, must be the number of vertices that follow"), "{wrong}");
}

#[test]
fn script_arrays_apply_to_each_row_of_numbers() {
    let turned = import_with_body(
        "mesh(#{ positions: numbers([1, 2, 3, 4, 5, 6, 7, 8, 9]).columns(3, [0, 2, 1]) * [1, 1, -1] + [0.5, 0, 0] });",
    )
    .unwrap();
    let positions = turned.meshes[0].primitives[0].positions.iter().map(|p| p.to_array());
    assert_eq!(positions.collect::<Vec<_>>(), [[1.5, 3.0, -2.0], [4.5, 6.0, -5.0], [7.5, 9.0, -8.0]]);
    assert!(import_error("numbers([1, 2, 3]) * [1, 2]").contains("*: 3 numbers do not fill whole rows of 2"));
    assert!(import_error("numbers([1, 2, 3]) + []").contains("+: an array of numbers is needed"));
    assert!(import_error("numbers([1]) + [\"a\"]").contains("+: an array of numbers is needed"));
}

#[test]
fn interleaved_joins_columns_into_rows() {
    let asset = import_with_body(
        "let s = numbers([0.0, 0.5, 1.0]);
        mesh(#{ positions: interleaved([s * 4, [5, 6, 7], s - 1]), uvs: interleaved([s, s * s]), material: -1, joint: -1 });",
    )
    .unwrap();
    let primitive = &asset.meshes[0].primitives[0];
    let positions: Vec<[f32; 3]> = primitive.positions.iter().map(|p| p.to_array()).collect();
    assert_eq!(positions, [[0.0, 5.0, -1.0], [2.0, 6.0, -0.5], [4.0, 7.0, 0.0]]);
    let uvs: Vec<[f32; 2]> = primitive.uvs[0].iter().map(|uv| uv.to_array()).collect();
    assert_eq!((uvs, primitive.material), (vec![[0.0, 0.0], [0.5, 0.25], [1.0, 1.0]], None));
    assert!(import_error("interleaved([])").contains("interleaved: an array of columns is needed"));
    assert!(import_error("interleaved([[1], 2])").contains("interleaved: an array of columns is needed"));
    assert!(
        import_error("interleaved([[1, 2], [3]])")
            .contains("interleaved: column 1 has 1 numbers, the first one 2")
    );
    assert!(
        import_error("interleaved([numbers(), [3]])").contains("column 1 has 1 numbers, the first one 0")
    );
    // 16 MB of numbers, and 64 MB of them side by side.
    let many = "let s = numbers([1]); for i in 0..21 { s.append(s); } interleaved([s, s, s, s])";
    assert!(import_error(many).contains("too much memory"), "{}", import_error(many));
}

#[test]
fn morph_targets_parts_normal_maps_cameras_and_lights_are_imported() {
    let asset = import_with_body(
        r#"
        let bumps = image(1, 1, [128, 128, 255]);
        let bumpy = material(#{ name: "bumpy", normal_image: bumps, normal_scale: 0.5 });
        let plain = material(#{ name: "plain" });
        let head = joint("head", -1, #{ translation: [0, 2, 0] });
        mesh(#{
            joint: head,
            positions: [0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0],
            uvs: [0, 1, 1, 1, 0, 0, 1, 0],
            parts: [#{ indices: [0, 1, 2], material: bumpy }, #{ indices: [2, 1, 3], material: plain }],
            morphs: [#{ name: "smile", positions: [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 2] }],
        });
        camera(#{ name: "eye", joint: head, fov: 90 });
        camera(#{ name: "plan", height: 4 });
        light(#{ name: "lamp", joint: head, kind: "spot", intensity: 20, inner: 10, outer: 30, range: 5 });
        clip("talk", [#{ joint: head, path: "weights", times: [0, 1], values: [0, 1] }]);
        "#,
    )
    .unwrap();
    let [first, second] = &asset.meshes[0].primitives[..] else { panic!("{:?}", asset.meshes) };
    assert_eq!((asset.materials[0].normal_scale, first.tangents.len(), second.tangents.len()), (0.5, 3, 0));
    assert_eq!((second.indices.as_slice(), second.material), ([0, 1, 2].as_slice(), Some(1)));
    assert_eq!(second.morphs[0].positions[2], Vec3::Z * 2.0);
    assert_eq!(asset.meshes[0].morph_names, ["smile"]);
    let [eye, plan] = &asset.cameras[..] else { panic!("{:?}", asset.cameras) };
    let quarter = std::f32::consts::FRAC_PI_2;
    assert_eq!(eye.projection, Projection::Perspective { yfov: quarter, near: 0.05, far: None });
    assert_eq!(plan.projection, Projection::Orthographic { height: 4.0, near: 0.05, far: 1000.0 });
    let lamp = &asset.lights[0].light;
    assert_eq!((lamp.intensity, lamp.range), (20.0, Some(5.0)));
    assert_eq!(lamp.kind.cone(), Some([10f32.to_radians(), 30f32.to_radians()]));
    // Halfway through the clip the target has half its weight.
    let mut weights = [0.0];
    assert!(asset.clips[0].sample_weights(0, Time::from_secs(0.5), &mut weights));
    assert_eq!(weights, [0.5]);
    for (code, message) in [
        ("camera(#{ fov: 180 });", "camera: fov must be above 0 and below 180, got 180"),
        ("camera(#{ fov: 40, height: 2 });", "camera: give fov for a perspective camera or height"),
        ("light(#{ kind: \"lamp\" });", "light: kind must be"),
        ("light(#{ kind: \"spot\", inner: 40, outer: 20 });", "must be 0 ≤ inner < outer"),
        ("mesh(#{ positions: [0, 0, 0], parts: [3] });", "mesh: parts[0] must be an object map, got 3"),
    ] {
        let error = import_with_body(code).unwrap_err().what;
        assert!(error.contains(message), "{code}: {error}");
    }
}

/// Against glam's own rotations in f64.
#[test]
fn quaternion_functions_equal_glam_in_radians() {
    use glam::{DQuat, DVec3, EulerRot};
    let values = |code: &str| -> Vec<f64> {
        let asset = import_with_body(&format!(
            "for v in {code} {{ warn(\"\", `${{v}}`); }} points(#{{ positions: [0, 0, 0] }});"
        ));
        asset.unwrap().warnings.iter().filter_map(|w| w.text.parse().ok()).collect()
    };
    let near = |code: &str, expected: &[f64]| {
        let got = values(code);
        assert_eq!(got.len(), expected.len(), "{code}: {got:?}");
        let far = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(far < 1e-14, "{code}: {got:?}, not {expected:?}");
    };
    let (x, y, z) = (0.3, -0.7, 1.9);
    let axis = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.2);
    near("quaternion([2, 4, -4], 2.2)", &axis.to_array());
    // Fixed axes, x first: Z · Y · X. glam names them from the left.
    let xyz = DQuat::from_euler(EulerRot::ZYX, z, y, x);
    near("quaternions(\"xyz\", [0.3, -0.7, 1.9])", &xyz.to_array());
    let zxy = DQuat::from_euler(EulerRot::YXZ, y, x, z);
    near("quaternions(\"zxy\", numbers([0.3, -0.7, 1.9]))", &zxy.to_array());
    let both = [xyz.to_array(), DQuat::IDENTITY.to_array()].concat();
    near("quaternions(\"xyz\", [0.3, -0.7, 1.9, 0, 0, 0])", &both);
    let (a, b) = ("quaternion([2, 4, -4], 2.2)", "quaternions(\"xyz\", [0.3, -0.7, 1.9])");
    near(&format!("product({a}, {b})"), &(axis * xyz).to_array());
    near(&format!("inverse({a})"), &axis.inverse().to_array());
    let turned = [axis * DVec3::X, axis * DVec3::new(1.0, 2.0, 3.0)].map(|v| v.to_array()).concat();
    near(&format!("turned({a}, [1, 0, 0, 1, 2, 3])"), &turned);
    near("turned(quaternion([0, 0, 1], radians(90)), [1, 0, 0])", &[0.0, 1.0, 0.0]);
    assert!(import_error("quaternion([0, 0, 0], 1.0);").contains("the axis needs a length"));
    assert!(
        import_error("quaternions(\"xxy\", [0, 0, 0]);")
            .contains("the letters x, y and z, as \"xyz\", got \"xxy\"")
    );
    assert!(
        import_error("quaternions(\"xyz\", [0, 0]);").contains("3 numbers, or rows of 3 numbers, are needed")
    );
    assert!(
        import_error("product([0, 0, 0, 1, 0, 0, 0, 1], numbers([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]));")
            .contains("one list has 2 rows, the other 3")
    );
    // A text that is not found has the place -1.
    near("[file.bytes.find(\"\\x05\"), file.bytes.find(\"q\", 2)]", &[4.0, -1.0]);
}
