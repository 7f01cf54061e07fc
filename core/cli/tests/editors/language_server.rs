//! Tests of `choreo lsp` through the protocol, as an editor uses it.

use crate::common;
use crate::editor;

use crate::common::sample_assets_folder;
use editor::{Editor, uri};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// A folder with a model of one clip, "Slide", and a module.
fn project_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("models")).unwrap();
    std::fs::write(folder.path().join("models/tri.gltf"), common::triangle(2.0)).unwrap();
    std::fs::write(
        folder.path().join("steps.rhai"),
        "fn stepper(name) {\n    cast(name, shape(\"box\"))\n}\n",
    )
    .unwrap();
    folder
}

/// A saved script, because modules are searched relative to its file.
fn script(folder: &Path, text: &str) -> String {
    let path = folder.canonicalize().unwrap().join("scene.rhai");
    std::fs::write(&path, text).unwrap();
    uri(&path)
}

const HEAD: &str = "let tri = load(\"models/tri.gltf\");\nlet hero = cast(\"hero\", tri);\n";

fn messages(list: &[Value]) -> Vec<String> {
    list.iter().map(|d| d["message"].as_str().unwrap().to_string()).collect()
}

#[test]
fn diagnostics_of_unsaved_text_are_those_of_check() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let text = format!("/* 𝄞 */ {HEAD}hero.play(tri.clip(\"Slid\"));\nlet unused = 3;\n");
    editor.open(&uri, &text);
    let found = editor.wait_for_diagnostics(&uri);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        messages(&found)[0]
            .starts_with("unknown clip \"Slid\" in \"models/tri.gltf\"; did you mean \"Slide\"?"),
        "{found:?}"
    );
    let range = json!({ "start": { "line": 2, "character": 19 }, "end": { "line": 2, "character": 25 } });
    assert_eq!((&found[0]["range"], &found[0]["severity"]), (&range, &json!(1)));

    // After one letter is corrected, the only finding is a warning, whose code is the name of the rule.
    editor.change(&uri, 2, json!([{ "range": { "start": { "line": 2, "character": 24 }, "end": { "line": 2, "character": 24 } }, "text": "e" }]));
    let fits = |m: &Value| m["method"] == "textDocument/publishDiagnostics" && m["params"]["version"] == 2;
    let found = editor.wait_for_message(fits)["params"]["diagnostics"].as_array().unwrap().clone();
    let rules: Vec<&str> = found.iter().filter_map(|d| d["code"].as_str()).collect();
    assert_eq!(rules, ["unused_variable"], "{found:?}");
    assert_eq!((&found[0]["severity"], &found[0]["tags"]), (&json!(3), &json!([1])));
    assert_eq!(editor.shut_down(), 0);
}

/// The diagnostics are the findings that `choreo check` prints, for every script of the tests of this command.
#[test]
fn diagnostics_equal_the_findings_of_the_check_command() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/checked").canonicalize().unwrap();
    let mut editor = Editor::start(&folder);
    let (mut scripts, mut all) = (0, 0);
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "rhai") {
            continue;
        }
        let name = path.file_name().unwrap().to_str().unwrap();
        let printed = common::choreo(&folder, &["check", "--notes", "--json", name]);
        let printed: Value = serde_json::from_str(&printed.out).unwrap();
        let empty = Vec::new();
        let list = printed["findings"].as_array().or(printed["errors"].as_array()).unwrap_or(&empty);
        let mut expected: Vec<String> = list
            .iter()
            .map(|f| (f, f["message"].as_str().unwrap(), f["hint"].as_str().map(|h| format!("\nhint: {h}"))))
            .map(|(f, message, hint)| {
                let line = f["line"].as_u64().unwrap_or(0).saturating_sub(1);
                format!("{line} [{}] {message}{}", f["rule"].as_str().unwrap_or(""), hint.unwrap_or_default())
            })
            .collect();
        let uri = uri(&path);
        editor.open(&uri, &std::fs::read_to_string(&path).unwrap());
        let found = editor.wait_for_diagnostics(&uri);
        let mut found: Vec<String> = found
            .iter()
            .map(|d| {
                let rule = d["code"].as_str().unwrap_or("");
                format!("{} [{rule}] {}", d["range"]["start"]["line"], d["message"].as_str().unwrap())
            })
            .collect();
        expected.sort();
        found.sort();
        assert_eq!(found, expected, "{name}");
        (scripts, all) = (scripts + 1, all + found.len());
    }
    assert!(scripts >= 25 && all >= 40, "{scripts} scripts, {all} findings");
}

#[test]
fn errors_of_an_unsaved_module_are_reported_in_the_module() {
    let folder = project_folder();
    let main = script(folder.path(), "");
    let module = uri(&folder.path().canonicalize().unwrap().join("steps.rhai"));
    let mut editor = Editor::start(folder.path());
    editor.open(&main, "import \"steps\" as steps;\nsteps::stepper(\"ada\").at(0, 0, 0);\n");
    assert_eq!(messages(&editor.wait_for_diagnostics(&main)), [""; 0]);
    editor.open(&module, "fn stepper(name) {\n    cast(name, shape(\"bxo\"))\n}\n");
    let fits = |m: &Value| m["params"]["uri"] == module.as_str() && m["params"]["diagnostics"][0].is_object();
    let message = editor.wait_for_message(fits);
    let found = &message["params"]["diagnostics"][0];
    assert!(found["message"].as_str().unwrap().contains("did you mean \"box\"?"), "{found}");
    assert_eq!(found["range"]["start"], json!({ "line": 1, "character": 21 }));
    let related = &found["relatedInformation"][0];
    assert_eq!((&related["location"]["uri"], &related["message"]), (&json!(main), &json!("imported here")));
    editor.replace_text(&module, "fn stepper(name) {\n    cast(name, shape(\"box\"))\n}\n");
    editor.wait_for_message(|m| {
        m["params"]["uri"] == module.as_str() && m["params"]["diagnostics"] == json!([])
    });
}

/// Applies the first edit of an action to a text.
fn with_edits_applied(text: &str, action: &Value, uri: &str) -> String {
    let mut edits = action["edit"]["changes"][uri].as_array().unwrap().clone();
    edits.sort_by_key(|e| {
        std::cmp::Reverse((e["range"]["start"]["line"].as_u64(), e["range"]["start"]["character"].as_u64()))
    });
    let mut lines: Vec<String> = text.split('\n').map(str::to_string).collect();
    for edit in edits {
        let (start, end) = (&edit["range"]["start"], &edit["range"]["end"]);
        assert_eq!(start["line"], end["line"]);
        let line = &mut lines[start["line"].as_u64().unwrap() as usize];
        let units: Vec<u16> = line.encode_utf16().collect();
        let at = |p: &Value| p["character"].as_u64().unwrap() as usize;
        let text = |units: &[u16]| String::from_utf16(units).unwrap();
        *line =
            text(&units[..at(start)]) + edit["newText"].as_str().unwrap() + text(&units[at(end)..]).as_str();
    }
    lines.join("\n")
}

#[test]
fn code_actions_resolve_their_diagnostics() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    editor.open(&uri, "");
    let cases = [
        (format!("{HEAD}/* ö𝄞 */ hero.plya(tri.clip(\"Slide\"));\n"), "Change to \"play\"", "hero.play(tri"),
        (format!("{HEAD}hero.play(tri.clip(\"Slidee\"));\n"), "Change to \"Slide\"", ".clip(\"Slide\"))"),
        (
            format!("{HEAD}    let unused = 3;\n"),
            "Allow unused_variable here",
            "\n    // allow: unused_variable\n    let",
        ),
        (
            format!("{HEAD}steps::stepper(\"b\").at(1, 0, 0);\n"),
            "Import \"steps\"",
            "import \"steps\" as steps;\nlet tri",
        ),
        (format!("{HEAD}stepper(\"b\").at(1, 0, 0);\n"), "Import \"steps\"", "\nsteps::stepper(\"b\")"),
    ];
    for (text, title, expected) in cases {
        editor.replace_text(&uri, &text);
        let found = editor.wait_for_diagnostics(&uri);
        assert!(!found.is_empty(), "{title}");
        let range = found[0]["range"].clone();
        let p =
            json!({ "textDocument": { "uri": uri }, "range": range, "context": { "diagnostics": found } });
        let actions = editor.request("textDocument/codeAction", p).unwrap();
        let actions = actions.as_array().unwrap();
        let action = actions
            .iter()
            .find(|a| a["title"] == title)
            .unwrap_or_else(|| panic!("{title}: {found:?} {actions:?}"));
        let changed = with_edits_applied(&text, action, &uri);
        assert!(changed.contains(expected), "{title}:\n{changed}");
        editor.replace_text(&uri, &changed);
        let left: Vec<Value> = editor
            .wait_for_diagnostics(&uri)
            .into_iter()
            .filter(|d| d["message"] == found[0]["message"])
            .collect();
        assert!(left.is_empty(), "{title}: {left:?}");
    }
}

#[test]
fn completion_offers_methods_options_values_and_files() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let mut has = |text: &str, wanted: &[&str], unwanted: &[&str]| {
        let labels = editor.completion_labels(&uri, text);
        for label in wanted {
            assert!(labels.iter().any(|l| l == label), "{text}: {label} is not in {labels:?}");
        }
        for label in unwanted {
            assert!(!labels.iter().any(|l| l == label), "{text}: {label} is in {labels:?}");
        }
    };
    has("let a = load(\"¦\");", &["models/tri.gltf", "choreo:mannequin"], &["steps.rhai"]);
    has("let a = load(\"mod¦", &["models/tri.gltf"], &[]);
    has("import \"¦\" as s;", &["steps"], &["models/tri.gltf"]);
    has("import \"steps\" as s;\ns::¦", &["stepper"], &["cast"]);
    has(&format!("{HEAD}hero.¦"), &["play", "look_at", "joint"], &["cut", "cast", "clip"]);
    has(&format!("{HEAD}hero.pl¦"), &["play", "plant_feet"], &["cut"]);
    has(&format!("{HEAD}hero.play(tri.clip(\"¦\"));"), &["Slide"], &["hero"]);
    has(&format!("{HEAD}hero.play(¦);"), &["tri.clip(\"Slide\")", "load"], &[]);
    has(&format!("{HEAD}hero.joint(\"¦"), &["Root", "Slider"], &["Slide"]);
    has(&format!("{HEAD}hero.play(tri.clip(\"Slide\")).on(\"¦\")"), &["Root", "Root.."], &["Slider.."]);
    has(
        &format!("{HEAD}hero.play(tri.clip(\"Slide\"), #{{ fade: 0.2, ¦ }});"),
        &["repeat", "until", "in_step"],
        &["fade", "cast"],
    );
    has(
        &format!("{HEAD}hero.play(tri.clip(\"Slide\"), #{{ repeat: ¦ }});"),
        &["\"loop\"", "\"ping_pong\""],
        &[],
    );
    has(&format!("{HEAD}hero.play(tri.clip(\"Slide\"), #{{ repeat: \"¦\" }});"), &["once", "ping_pong"], &[]);
    has("stage(#{ background: #{ ¦ } });", &["top", "bottom"], &["fps"]);
    has("effect(\"¦\");", &["bloom", "vignette"], &[]);
    has("effect(\"bloom\", #{ ¦ });", &["strength", "threshold"], &["fps"]);
    has("let b = effect(\"bloom\");\nb.set(\"¦\", 1);", &["strength"], &["fps"]);
    has("load(\"choreo:mannequin\", #{ ¦ });", &["color", "facing"], &[]);
    has("shape(\"box\", #{ color: \"¦\" });", &["coral", "teal"], &["box"]);
    has("let hero = camera(\"w\");\nfor c in [hero] { c.¦ }", &["cut", "orbit"], &["play"]);
    has("// hero.¦", &[], &["play", "cast"]);
    has(&format!("{HEAD}text(`über ${{hero.¦}} im Bild`);"), &["play", "look_at"], &["cut", "cast"]);
    has(&format!("{HEAD}text(`${{he¦}}`);"), &["hero", "tri"], &["play"]);
    has(&format!("{HEAD}text(`hero.¦`);"), &[], &["play", "hero"]);
    has("let x = 1;\n¦", &["character", "x", "camera"], &["play"]);
}

/// Completions list the files that `choreo export` has written after those that a script is likely to load.
#[test]
fn completion_offers_exports_last() {
    let folder = project_folder();
    script(folder.path(), "cast(\"t\", load(\"models/tri.gltf\"));");
    for output in ["a.gltf", "a.glb", "a.usda"] {
        let run = common::choreo(folder.path(), &["export", "scene.rhai", "-o", output]);
        assert_eq!(run.code, 0, "{}", run.err);
    }
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let offered = editor.completion_items(&uri, "let a = load(\"¦\");");
    let rank = |name: &str| {
        let item = offered.iter().find(|item| item["label"] == name);
        item.unwrap_or_else(|| panic!("{name}"))["sortText"].as_str().unwrap().to_string()
    };
    for own in ["a.gltf", "a.glb", "a.usda"] {
        assert!(rank(own) > rank("models/tri.gltf") && rank(own) > rank("choreo:mannequin"), "{own}");
    }
}

#[test]
fn completion_of_a_large_character_reads_its_file() {
    let Some(assets) = sample_assets_folder() else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(assets.join("gltf/RobotExpressive.glb"), folder.path().join("robot.glb")).unwrap();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let head = "let robot = load(\"robot.glb\");\nlet r = cast(\"r\", robot);\n";
    let clips = editor.completion_labels(&uri, &format!("{head}r.play(robot.clip(\"¦\"));"));
    assert!(clips.contains(&"Walking".to_string()) && clips.contains(&"Dance".to_string()), "{clips:?}");
    let morphs = editor.completion_labels(&uri, &format!("{head}r.morph(\"¦\", 1);"));
    assert!(morphs.contains(&"Angry".to_string()), "{morphs:?}");
    let keyed = editor.completion_labels(&uri, &format!("{head}r.key(\"morph\", \"¦\", [[0, 1]]);"));
    assert_eq!(morphs, keyed);
    let joints = editor.completion_labels(&uri, &format!("{head}r.play(robot.clip(\"Wave\")).on(\"¦\");"));
    assert!(
        joints.iter().any(|j| j.ends_with("..")) && joints.iter().any(|j| j.starts_with('*')),
        "{joints:?}"
    );
    let about = editor.hover_text(&uri, &format!("{head}r.play(robot.clip(\"Walk¦ing\"));"));
    // The length comes from the file: the clip has 0.958 s.
    assert!(about.contains("0.96 s") && about.contains("29 frames at 30 fps"), "{about}");
}

/// Joints are offered with the short names that the guide uses, also for a file that does not state its format.
#[test]
fn short_names_of_joints_are_known() {
    let Some(assets) = sample_assets_folder() else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(assets.join("vrm/Godette_vrm_v4.vrm"), folder.path().join("godette.vrm")).unwrap();
    std::fs::copy(assets.join("gltf/Knight.glb"), folder.path().join("knight.glb")).unwrap();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let head = "let g = load(\"godette.vrm\");\nlet a = cast(\"a\", g);\n";
    // The file is read in the background.
    editor.completion_labels(&uri, &format!("{head}a.joint(\"¦\");"));
    let about = editor.hover_text(&uri, &format!("{head}a.joint(\"Left¦Hand\");"));
    assert!(about.contains("**LeftHand** — `hand.l_Armature`, joint of `godette.vrm`"), "{about}");
    let about = editor.hover_text(&uri, "load(\"kni¦ght.glb\");");
    assert!(about.starts_with("**knight.glb**") && !about.contains("—"), "{about}");
    let joints = editor.completion_labels(&uri, &format!("{head}a.joint(\"Right¦\");"));
    for name in ["RightHand", "Head", "hand.r_Armature"] {
        assert!(joints.iter().any(|joint| joint == name), "{name} is not in {joints:?}");
    }
    for (slip, meant) in
        [("LeftHnd", "LeftHand"), ("Haed", "Head"), ("hnad.l", "hand.l"), ("RigthFoot", "RightFoot")]
    {
        editor.replace_text(&uri, &format!("{head}a.joint(\"{slip}\");"));
        let found = messages(&editor.wait_for_diagnostics(&uri)).join("\n");
        assert!(found.contains(&format!("did you mean \"{meant}\"?")), "{slip}: {found}");
    }
}

/// Clients filter by the label: each joint is offered with a name that begins as in the guide, and scripts accept this name.
#[test]
fn joints_are_offered_by_their_short_names() {
    let folder = project_folder();
    let joints = ["mixamorig:Hips", "mixamorig:Spine", "mixamorig:HeadTop_End", "Armature|Tail", "own"];
    let nodes: Vec<Value> = (0..joints.len())
        .map(|i| match i + 1 < joints.len() {
            true => json!({ "name": joints[i], "children": [i + 1], "translation": [0, 1, 0] }),
            false => json!({ "name": joints[i] }),
        })
        .collect();
    let model =
        json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": nodes });
    std::fs::write(folder.path().join("models/mixamo.gltf"), model.to_string()).unwrap();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let head = "let m = load(\"models/mixamo.gltf\");\nlet a = cast(\"a\", m);\n";
    let labels = editor.completion_labels(&uri, &format!("{head}a.joint(\"¦\");"));
    let of_file = joints.iter().map(|name| name.to_string());
    let short = ["Hips", "Spine", "HeadTop_End", "Tail"].map(String::from);
    for name in of_file.chain(short.clone()) {
        assert_eq!(labels.iter().filter(|label| **label == name).count(), 1, "{name}: {labels:?}");
    }
    let patterns = editor.completion_labels(&uri, &format!("{head}a.spring(\"¦\");"));
    assert!(patterns.contains(&"Spine..".to_string()), "{patterns:?}");
    for name in short {
        editor.replace_text(&uri, &format!("{head}a.joint(\"{name}\");"));
        let found = messages(&editor.wait_for_diagnostics(&uri)).join("\n");
        assert!(!found.contains("joint"), "{name}: {found}");
    }
}

/// Completions in the rows of the guide's dialogue, and of the actors of a scene in its test.
#[test]
fn completion_knows_values_in_maps_and_actors_of_scenes() {
    let folder = project_folder();
    let root = folder.path().canonicalize().unwrap();
    std::fs::create_dir_all(root.join("shots/tests")).unwrap();
    std::fs::create_dir_all(root.join("shots/models")).unwrap();
    std::fs::copy(root.join("models/tri.gltf"), root.join("shots/models/tri.gltf")).unwrap();
    let scene = format!("{HEAD}let cam = camera(\"wide\");\n");
    std::fs::write(root.join("shots/scene.rhai"), scene).unwrap();
    let main = script(folder.path(), "");
    let test = uri(&root.join("shots/tests/film.rhai"));
    let mut editor = Editor::start(folder.path());
    let rows = format!("{HEAD}let lines = [#{{ who: hero, from: 0.5 }}, #{{ who: hero, until: 2.8 }}];\n");
    let film = "test(\"a\", || {\n    let film = scene(\"../scene.rhai\");\n";
    let mut has = |uri: &str, text: String, wanted: &[&str], unwanted: &[&str]| {
        let labels = editor.completion_labels(uri, &text);
        for label in wanted {
            assert!(labels.iter().any(|l| l == label), "{text}: {label} is not in {labels:?}");
        }
        for label in unwanted {
            assert!(!labels.iter().any(|l| l == label), "{text}: {label} is in {labels:?}");
        }
    };
    has(&main, format!("{rows}for line in lines {{ line.¦ }}"), &["who", "from", "until"], &["play"]);
    has(&main, format!("{rows}for line in lines {{ line.who.¦ }}"), &["play", "look_at"], &["cut", "who"]);
    has(
        &main,
        format!("{rows}for line in lines {{ line.who.key(\"¦\", []); }}"),
        &["position", "morph"],
        &["cone"],
    );
    has(&main, format!("{rows}for line in lines {{ line.who.joint(\"¦\"); }}"), &["Root", "Slider"], &[]);
    has(&main, format!("{HEAD}let q = #{{ who: hero }};\nq.who.¦"), &["play"], &["cut"]);
    has(&test, format!("{film}    film.actor(\"¦\")"), &["hero"], &["wide"]);
    has(&test, format!("{film}    film.camera(\"¦\")"), &["wide"], &["hero"]);
    has(&test, format!("{film}    film.actor(\"hero\").¦"), &["joint", "play"], &["cut"]);
    has(&test, format!("{film}    film.actor(\"hero\").joint(\"¦\")"), &["Root", "Slider"], &[]);
    // Nothing outside the open folder is offered.
    has(
        &test,
        "test(\"a\", || {\n    let film = scene(\"../../../scene.rhai\");\n    film.actor(\"¦\")".into(),
        &[],
        &["hero"],
    );
    let text = format!("{rows}for line in lines {{ line.w¦ho.hide(); }}");
    let about = editor.hover_text(&main, &text);
    assert!(about.starts_with("**who**: Actor \"hero\" of models/tri.gltf"), "{about}");
}

/// The sections of a test beside a scene are run while they are typed, without warnings that nothing is on stage.
#[test]
fn sections_of_tests_have_diagnostics() {
    let folder = project_folder();
    let root = folder.path().canonicalize().unwrap();
    std::fs::create_dir(root.join("tests")).unwrap();
    std::fs::write(root.join("scene.rhai"), HEAD).unwrap();
    let text = |name: &str| {
        format!(
            "test(\"stands\", || {{\n    let film = scene(\"../scene.rhai\");\n    expect(film.actor(\"{name}\")).y().above(-9.0);\n}});\n"
        )
    };
    let path = root.join("tests/film.rhai");
    std::fs::write(&path, text("hreo")).unwrap();
    let uri = uri(&path);
    let mut editor = Editor::start(&root);
    editor.open(&uri, &text("hreo"));
    let found = editor.wait_for_diagnostics(&uri);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(messages(&found)[0].contains("did you mean \"hero\"?"), "{found:?}");
    assert_eq!(found[0]["range"]["start"]["line"], 2);
    editor.replace_text(&uri, &text("hero"));
    assert_eq!(messages(&editor.wait_for_diagnostics(&uri)), [""; 0]);
    // An error of the scene is reported in the file of the scene.
    std::fs::write(root.join("scene.rhai"), format!("{HEAD}hero.plya();")).unwrap();
    editor.replace_text(&uri, &(text("hero") + "// again"));
    let scene = self::uri(&root.join("scene.rhai"));
    let message = editor.wait_for_message(move |m: &Value| {
        m["params"]["uri"] == scene.as_str() && m["params"]["diagnostics"][0].is_object()
    });
    assert!(message["params"]["diagnostics"][0]["message"].as_str().unwrap().contains("plya"), "{message}");
}

/// A new test that was never saved is checked like a saved one.
#[test]
fn sections_of_new_files_have_diagnostics() {
    let folder = project_folder();
    let root = folder.path().canonicalize().unwrap();
    std::fs::create_dir(root.join("tests")).unwrap();
    std::fs::write(root.join("scene.rhai"), HEAD).unwrap();
    let of_film = |call: &str| {
        let scene = "let film = scene(\"scene.rhai\");";
        format!("test(\"stands\", || {{\n    {scene}\n    {call};\n}});\n")
    };
    let beside = uri(&root.join("new.rhai"));
    let in_tests = uri(&root.join("tests/new.rhai"));
    let of_code = format!("untitled:{}", root.join("tests/code.rhai").display());
    let mut editor = Editor::start(&root);
    for uri in [&beside, &in_tests, &of_code, &"untitled:Untitled-1".to_string()] {
        editor.open(uri, "");
        for (call, line, expected) in [
            ("expect(film.actor(\"hreo\")).y().above(-9.0)", 2, "did you mean \"hero\"?"),
            ("expect(film.actor(\"hero\")).sped().above(0.0)", 2, "Expect has no method \"sped\""),
            ("expect_image(\"a\", #{ sz: [8, 8] })", 2, "unknown option \"sz\""),
        ] {
            editor.replace_text(uri, &of_film(call));
            let found = editor.wait_for_diagnostics(uri);
            let is_it = |d: &&Value| d["message"].as_str().unwrap().contains(expected);
            let diagnostic = found.iter().find(is_it).unwrap_or_else(|| panic!("{uri} {call}: {found:?}"));
            assert_eq!(diagnostic["range"]["start"]["line"], line, "{uri} {call}: {found:?}");
        }
        editor.replace_text(uri, &of_film("expect(film.actor(\"hero\")).y().above(-9.0)"));
        assert_eq!(messages(&editor.wait_for_diagnostics(uri)), [""; 0], "{uri}");
        // A test that sets up its own stage and only compares an image.
        editor.replace_text(uri, "test(\"looks\", || {\n    expect_image(\"a\", #{ sz: [8, 8] });\n});\n");
        let found = messages(&editor.wait_for_diagnostics(uri));
        assert!(found.len() == 1 && found[0].contains("unknown option \"sz\""), "{uri}: {found:?}");
    }
    assert!(!root.join("new.rhai").exists() && !root.join("untitled.rhai").exists());
}

#[test]
fn hover_and_signature_help_describe_calls_options_and_files() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let mut says = |text: &str, parts: &[&str]| {
        let about = editor.hover_text(&uri, text);
        for part in parts {
            assert!(about.contains(part), "{text}: {about}");
        }
    };
    says(
        &format!("{HEAD}hero.pl¦ay(tri.clip(\"Slide\"));"),
        &["Actor.play(clip, options?) → Cue", "Plays a clip"],
    );
    says(
        &format!("{HEAD}hero.play(tri.clip(\"Sl¦ide\"));"),
        &["2.00 s, 60 frames at 30 fps", "travels 1.00 m/s"],
    );
    says("let tri = load(\"models/tri¦.gltf\");", &["1 triangle", "2 joints", "`Slide` 2.00 s"]);
    says(&format!("{HEAD}he¦ro.hide();"), &["Actor \"hero\" of models/tri.gltf", "1 triangle"]);
    says(&format!("{HEAD}hero.joint(\"Sli¦der\");"), &["child of `Root`", "0 joints below it"]);
    says("stage(#{ fp¦s: 24 });", &["option of `stage`", "0.001 to 1000, default 30"]);
    says("effect(\"blo¦om\");", &["threshold", "default"]);
    says("sun(#{ color: \"co¦ral\" });", &["#ff7f50"]);
    says("load(\"models/none¦.gltf\");", &["no such file"]);
    says("import \"ste¦ps\" as s;", &["stepper(name)"]);
    let help = editor.request_at_mark("textDocument/signatureHelp", &uri, &format!("{HEAD}hero.at(1, ¦)"));
    assert_eq!(help["signatures"][0]["label"], "Actor.at(x, y, z)");
    assert_eq!(help["activeParameter"], 1);
    let label = help["signatures"][0]["parameters"][1]["label"].clone();
    assert_eq!(label, json!([12, 13]));
    let help = editor.request_at_mark("textDocument/signatureHelp", &uri, "fn f(a, b) { a }\nf(1, ¦");
    assert_eq!((&help["signatures"][0]["label"], &help["activeParameter"]), (&json!("f(a, b)"), &json!(1)));
}

#[test]
fn colors_are_found_and_picked() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    editor.open(
        &uri,
        "/* 𝄞 */ sun(#{ color: \"coral\" });\nlet c = \"#0080ff\"; cast(\"red\", shape(\"box\"));\n",
    );
    let colors =
        editor.request("textDocument/documentColor", json!({ "textDocument": { "uri": uri } })).unwrap();
    let colors = colors.as_array().unwrap();
    assert_eq!(colors.len(), 2, "{colors:?}");
    assert_eq!(colors[0]["range"]["start"], json!({ "line": 0, "character": 23 }));
    assert_eq!((&colors[1]["color"]["red"], &colors[1]["color"]["blue"]), (&json!(0.0), &json!(1.0)));
    let p =
        json!({ "textDocument": { "uri": uri }, "range": colors[0]["range"], "color": colors[0]["color"] });
    let labels = editor.request("textDocument/colorPresentation", p).unwrap();
    assert_eq!(labels, json!([{ "label": "\"#ff7f50\"" }, { "label": "\"coral\"" }]));
}

#[test]
fn the_server_survives_invalid_and_cancelled_requests() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::uninitialized(folder.path());
    let too_early = editor.request("textDocument/hover", json!({}));
    assert_eq!(too_early, Err(-32002));
    editor.write(b"nonsense\r\nContent-Length: 3\r\n\r\n{a}");
    editor.wait_for_message(|m| m["error"]["code"] == -32700);
    editor.request("initialize", json!({ "capabilities": {} })).unwrap();
    assert_eq!(editor.request("no/such", json!({})), Err(-32601));
    let closed =
        json!({ "textDocument": { "uri": "file:///etc/passwd" }, "position": { "line": 0, "character": 0 } });
    assert_eq!(editor.request("textDocument/hover", closed), Err(-32602));
    editor.notify("textDocument/didChange", json!({ "textDocument": 7, "contentChanges": "x" }));
    editor.send(&json!([1, 2]));
    editor.send(&json!({ "id": 99 }));
    editor.wait_for_message(|m| m["id"] == 99 && m["error"]["code"] == -32600);

    // Positions outside the text, a broken script, CRLF, and a text of a megabyte.
    editor.open(&uri, "let a = \"ä𝄞\";\r\nlet b = (((#{ [\r\n");
    for (line, character) in [(0, 11), (0, 12), (1, 99), (77, 0)] {
        let p =
            json!({ "textDocument": { "uri": uri }, "position": { "line": line, "character": character } });
        for method in ["textDocument/completion", "textDocument/hover", "textDocument/signatureHelp"] {
            assert!(editor.request(method, p.clone()).is_ok());
        }
    }
    assert_eq!(editor.wait_for_diagnostics(&uri).len(), 1);
    editor.replace_text(&uri, &"let a = [1, 2, \"x\"];\r\n".repeat(40_000));
    let p = json!({ "textDocument": { "uri": uri }, "position": { "line": 39_999, "character": 4 } });
    assert!(editor.request("textDocument/completion", p).is_ok());

    // Requests that are cancelled before they are processed are refused.
    editor.replace_text(&uri, "let a = 1;");
    let p = json!({ "textDocument": { "uri": uri }, "position": { "line": 0, "character": 4 } });
    let mut bytes = Vec::new();
    let add = |bytes: &mut Vec<u8>, message: Value| {
        let body = message.to_string();
        bytes.extend(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    };
    for id in 1000..1200 {
        add(&mut bytes, json!({ "id": id, "method": "textDocument/completion", "params": p }));
    }
    add(&mut bytes, json!({ "method": "$/cancelRequest", "params": { "id": 1199 } }));
    editor.write(&bytes);
    assert_eq!(editor.response(1199), Err(-32800));
    assert!(editor.response(1000).is_ok());
    assert_eq!(editor.shut_down(), 0);

    // The client closes the pipe.
    let editor = Editor::start(folder.path());
    assert_ne!(editor.wait_for_exit(), 0);
}

/// A file outside the folders is neither read nor listed, whatever path the script contains.
#[test]
fn nothing_outside_the_folders_is_read() {
    let outer = tempfile::tempdir().unwrap();
    std::fs::write(outer.path().join("secret.gltf"), common::triangle(7.0)).unwrap();
    std::fs::write(outer.path().join("secret.rhai"), "fn hidden() { 1 }").unwrap();
    let inner = outer.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let uri = script(&inner, "");
    let mut editor = Editor::start(&inner);
    for path in ["../secret.gltf", "/etc/hostname"] {
        let about = editor.hover_text(&uri, &format!("load(\"¦{path}\");"));
        assert!(about.contains("cannot read") && !about.contains("triangle"), "{about}");
    }
    let clips = editor.completion_labels(&uri, "let a = load(\"../secret.gltf\");\na.clip(\"¦\");");
    assert!(!clips.contains(&"Slide".to_string()), "{clips:?}");
    assert!(editor.completion_labels(&uri, "import \"../secret\" as s;\ns::¦").is_empty());
    assert!(!editor.completion_labels(&uri, "load(\"../¦\");").iter().any(|l| l.contains("secret")));
}

/// Measures the time from a change to its diagnostics, for a hundred changes of a script of 500 lines.
#[test]
fn time_from_an_edit_to_its_diagnostics_is_printed() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut text = format!("stage(#{{ length: 20 }});\n{HEAD}camera(\"wide\");\n");
    text += "hero.play(tri.clip(\"Slide\")).until(1.0);\n";
    for i in 0..495 {
        text += &match i % 5 {
            0 => format!("cast(\"box {i}\", shape(\"box\", #{{ size: 0.2 }})).at({i}, 0, {});\n", i % 7),
            1 => format!("let x{i} = {i} * 2 + 1;\n"),
            2 => format!("hero.key(\"position\", [[{i}, [x{}, 0, 0]]]);\n", i - 1),
            3 => format!("// A line of comment, number {i}.\n"),
            _ => format!("point(#{{ position: [{i}, 3, 0], intensity: 0.0 }});\n"),
        };
    }
    let mut editor = Editor::start(folder.path());
    editor.open(&uri, &text);
    let lines = text.lines().count();
    editor.wait_for_diagnostics(&uri);
    let mut times: Vec<f64> = Vec::new();
    for version in 2..102 {
        let at = json!({ "line": lines, "character": version - 2 });
        let begun = Instant::now();
        editor.change(&uri, version, json!([{ "range": { "start": at, "end": at }, "text": "/" }]));
        editor.wait_for_message(|m| {
            m["method"] == "textDocument/publishDiagnostics" && m["params"]["version"] == version
        });
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{lines} lines, 100 edits: median {:.1} ms, 90 % below {:.1} ms, all below {:.1} ms",
        times[50], times[90], times[99]
    );
    assert_eq!(times.len(), 100);
}

/// The text of a range within one line.
fn text_in_range(text: &str, range: &Value) -> String {
    let line = text.split('\n').nth(range["start"]["line"].as_u64().unwrap() as usize).unwrap();
    let units: Vec<u16> = line.encode_utf16().collect();
    let at = |end: &str| range[end]["character"].as_u64().unwrap() as usize;
    String::from_utf16(&units[at("start")..at("end")]).unwrap()
}

#[test]
fn names_are_found_and_renamed_only_in_their_scope() {
    let folder = project_folder();
    let root = folder.path().canonicalize().unwrap();
    let main = script(folder.path(), "");
    let module = uri(&root.join("steps.rhai"));
    let mut editor = Editor::start(folder.path());
    let marked = "/* 𝄞 */ let size = 2; let other = #{ size: size };\n\
                  fn f(size) { size + 1 }\n{ let size = 3; f(size); }\nprint(si¦ze + other.size);\n";
    let text = marked.replace('¦', "");
    let place = editor.request_at_mark("textDocument/definition", &main, marked);
    assert_eq!(place["range"]["start"], json!({ "line": 0, "character": 13 }));
    let position = editor.open_marked_text(&main, marked);
    let p = json!({ "textDocument": { "uri": main }, "position": position, "context": { "includeDeclaration": true } });
    let found = editor.request("textDocument/references", p).unwrap();
    let lines: Vec<(u64, u64)> = found
        .as_array()
        .unwrap()
        .iter()
        .map(|f| {
            assert_eq!(text_in_range(&text, &f["range"]), "size");
            (
                f["range"]["start"]["line"].as_u64().unwrap(),
                f["range"]["start"]["character"].as_u64().unwrap(),
            )
        })
        .collect();
    // The declaration, the value in the map, and the last line; neither keys, members, parameters nor the inner variable.
    assert_eq!(lines, [(0, 13), (0, 44), (3, 6)]);
    let rename = |position: &Value, name: &str| json!({ "textDocument": { "uri": main }, "position": position, "newName": name });
    let edits = editor.request("textDocument/rename", rename(&position, "width")).unwrap();
    assert_eq!(edits["changes"][&main].as_array().unwrap().len(), 3);
    for refused in ["let", "2a", "a b", "other", "print"] {
        assert_eq!(
            editor.request("textDocument/rename", rename(&position, refused)),
            Err(-32803),
            "{refused}"
        );
    }
    // Variables in the code inside a string are renamed, also if the rename starts there; the other letters of the string are not changed.
    for marked in [
        "let kai¦ = [1];\nprint(`kai ${kai[0]} ${#{ kai: kai.len() }.kai} ${`${kai}`}`);\n",
        "let kai = [1];\nprint(`kai ${k¦ai[0]} ${#{ kai: kai.len() }.kai} ${`${kai}`}`);\n",
    ] {
        let position = editor.open_marked_text(&main, marked);
        let edits = editor.request("textDocument/rename", rename(&position, "mia")).unwrap();
        let renamed = with_edits_applied(&marked.replace('¦', ""), &json!({ "edit": edits }), &main);
        let expected = "let mia = [1];\nprint(`kai ${mia[0]} ${#{ kai: mia.len() }.kai} ${`${mia}`}`);\n";
        assert_eq!(renamed, expected);
        let range = editor.request_at_mark("textDocument/prepareRename", &main, marked)["range"].clone();
        assert_eq!(text_in_range(expected, &range).replace("mia", "kai"), "kai");
    }
    for text in [
        "let a¦ = 1;\nprint(`${b}`);\n",
        "let a¦ = 1;\nprint(`${[1].map(|a| a)}`);\n",
        "fn a¦() { 1 }\nprint(`${x.a()}`);\n",
    ] {
        let position = editor.open_marked_text(&main, text);
        assert_eq!(editor.request("textDocument/rename", rename(&position, "b")), Err(-32803), "{text}");
    }

    // A function of a module, in both files.
    let text = "import \"steps\" as s;\ns::step¦per(\"a\");\nlet stepper = 1;\n";
    let place = editor.request_at_mark("textDocument/definition", &main, text);
    assert_eq!(
        (&place["uri"], &place["range"]["start"]),
        (&json!(module), &json!({ "line": 0, "character": 3 }))
    );
    let position = editor.open_marked_text(&main, text);
    let edits = editor.request("textDocument/rename", rename(&position, "walker")).unwrap();
    let count = |uri: &String| edits["changes"][uri].as_array().map_or(0, Vec::len);
    assert_eq!((count(&module), count(&main)), (1, 1), "{edits}");
    let place = editor.request_at_mark("textDocument/definition", &main, "import \"ste¦ps\" as s;\n");
    assert_eq!(place["uri"], json!(module));
}

#[test]
fn symbols_and_folding_ranges_show_the_structure() {
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    let text = "// one\n// two\nlet hero = cast(\"hero\", shape(\"box\"));\nfn f(a, b) {\n    let c = 1;\n    c\n}\n\
                test(\"it stands\", || {\n    hero.hide();\n    hero.show();\n});\n";
    editor.open(&uri, text);
    let p = json!({ "textDocument": { "uri": uri } });
    let symbols = editor.request("textDocument/documentSymbol", p.clone()).unwrap();
    let names: Vec<&str> = symbols.as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["hero", "f", "it stands"]);
    assert_eq!(symbols[1]["children"][0]["name"], "c");
    assert_eq!(
        (&symbols[1]["detail"], &symbols[0]["children"][0]["name"]),
        (&json!("(a, b)"), &json!("hero"))
    );
    let folds = editor.request("textDocument/foldingRange", p).unwrap();
    let mut lines: Vec<(u64, u64)> = folds
        .as_array()
        .unwrap()
        .iter()
        .map(|f| (f["startLine"].as_u64().unwrap(), f["endLine"].as_u64().unwrap()))
        .collect();
    lines.sort_unstable();
    lines.dedup();
    assert_eq!(lines, [(0, 1), (3, 5), (7, 9)]);
}

/// The options that are offered are those that the calls accept: the error for an unknown option lists them. (The lists of `shape` and
/// `mesh` are shortened in the message.)
#[test]
fn offered_options_equal_the_options_that_calls_accept() {
    let calls = "stage(OPT)|lines(OPT)|panel(OPT)|text(\"a\", OPT)|letterbox(2.0, OPT)|sun(OPT)|\
        point(OPT)|spot(OPT)|sky(\"studio\", OPT)|fade_in(1, OPT)|h.play(a.clip(\"Walk\"), OPT)|h.look_at([0,0,0], OPT)|\
        h.reach(\"LeftHand\", [0,0,0], OPT)|h.plant_feet(OPT)|h.root_motion(OPT)|h.path([[0,0,0],[1,0,0]], OPT)|\
        h.detach(OPT)|h.surfaces(OPT)|h.springs(OPT)|h.spring(\"Head\", OPT)|h.walk_to([1,0,1], OPT)|h.joint(\"Head\").limit(OPT)|\
        h.play(a.clip(\"Walk\")).on(\"Spine..\", OPT)|camera(\"c\").orbit([0,0,0], OPT)|camera(\"c\").look_at([0,0,0], OPT)|\
        camera(\"c\").shake(OPT)|perform(h, |w| { w.hide(); }, OPT)|a.clip(\"Walk\").retarget(a, OPT)|a.clip(\"Walk\").reduce(0.01, OPT)";
    // These are documented within the description of another option.
    let nested = ["sharpness"];
    let folder = project_folder();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    editor.open(&uri, "");
    let mut compared = 0;
    for call in calls.split('|').collect::<Vec<_>>().join("|").replace("|w|", "¶w¶").split('|') {
        let call = call.replace('¶', "|");
        let head = "let a = load(\"choreo:mannequin\");\nlet h = cast(\"h\", a);\nlet b = cast(\"b\", a);\n";
        editor.replace_text(&uri, &format!("{head}{};\n", call.replace("OPT", "#{ no_such_option: 1 }")));
        let found = messages(&editor.wait_for_diagnostics(&uri));
        let list = found.iter().find_map(|m| Some(m.split_once("options: ")?.1.to_string()));
        let list = list.unwrap_or_else(|| panic!("{call}: {found:?}"));
        let is_cut = list.contains(" more");
        let list = list.split(" and ").next().unwrap().to_string()
            + ", "
            + list.split(" and ").nth(1).filter(|_| !is_cut).unwrap_or("");
        let mut accepted: Vec<&str> =
            list.split(", ").filter(|name| !name.is_empty() && !nested.contains(name)).collect();
        let offered = editor.completion_labels(&uri, &format!("{head}{};\n", call.replace("OPT", "#{ ¦ }")));
        let mut offered: Vec<&str> = offered.iter().map(String::as_str).collect();
        offered.retain(|name| !is_cut || accepted.contains(name));
        accepted.sort_unstable();
        offered.sort_unstable();
        assert_eq!(offered, accepted, "{call}");
        compared += accepted.len();
    }
    assert!(compared > 100, "{compared}");
}

/// Calls with the placeholder `OPT` for each entry that takes options. At least one of the calls must accept each option that is offered.
const CALLS: &str = "\
    stage: stage(OPT)
    load: load(\"models/tri.gltf\", OPT)
    load: load(\"choreo:mannequin\", OPT)
    shape: shape(\"box\", OPT)
    shape: shape(\"sphere\", OPT)
    shape: shape(\"torus\", OPT)
    shape: shape(\"capsule\", OPT)
    shape: shape(\"cylinder\", OPT)
    shape: shape(\"plane\", OPT)
    mesh: mesh(OPT)
    lines: lines(OPT)
    points: points(OPT)
    image: image(2, 2, [], OPT)
    image: image(\"a.png\", OPT)
    image: image(OPT)
    Asset.texture: s.texture(s.materials()[0], \"color\", image(1, 1, [[0, 0, 0]]), OPT)
    Asset.repeat: shape(\"box\").repeat([OPT])
    sun: sun(OPT)
    point: point(OPT)
    spot: spot(OPT)
    ambient: ambient(OPT)
    sky: sky(\"studio\", OPT)
    text: text(\"a\", OPT)
    title: title(\"a\", OPT)
    picture: picture(image(1, 1, [[0, 0, 0]]), OPT)
    panel: panel(OPT)
    letterbox: letterbox(2.0, OPT)
    Layer2d.outline: text(\"a\").outline(OPT)
    Layer2d.panel: text(\"a\").panel(OPT)
    fade_in: fade_in(1, OPT)
    fade_out: fade_out(1, OPT)
    effect: effect(\"bloom\", OPT)
    Effect.on: effect(\"bloom\").on(h, OPT)
    perform: perform(h, |w| { w.hide(); }, OPT)
    Actor.attach: h.attach(b, OPT)
    Actor.detach: h.detach(OPT)
    Actor.shadow: h.shadow(OPT)
    Actor.surfaces: h.surfaces(OPT)
    Actor.play: h.play(walk, OPT)
    Actor.look_at: h.look_at([0, 0, 0], OPT)
    Actor.reach: h.reach(\"LeftHand\", [0, 0, 0], OPT)
    Actor.aim: h.aim(\"LeftHand\", [0, 0, 0], OPT)
    Actor.plant_feet: h.plant_feet(OPT)
    Actor.mirror: h.mirror(OPT)
    Actor.spring: h.spring(\"Head\", OPT)
    Actor.springs: h.springs(OPT)
    Actor.collider: h.collider(\"Head\", OPT)
    Actor.root_motion: h.root_motion(OPT)
    Actor.in_place: h.in_place(OPT)
    Actor.path: h.path([[0, 0, 0], [1, 0, 0]], OPT)
    Actor.walk_to: h.walk_to([1, 0, 1], OPT)
    Joint.limit: h.joint(\"Head\").limit(OPT)
    Cue.then: h.play(walk).then(walk, OPT)
    Cue.on: h.play(walk).on(\"Spine1..\", OPT)
    Cue.root_motion: h.play(walk).root_motion(OPT)
    Cue.in_place: h.play(walk).in_place(OPT)
    Clip.retarget: walk.retarget(a, OPT)
    Clip.mapping: walk.mapping(a, OPT)
    Clip.offset: walk.offset(\"Head\", OPT)
    Clip.reduce: walk.reduce(0.01, OPT)
    Camera.look_at: c.look_at([0, 0, 0], OPT)
    Camera.shake: c.shake(OPT)
    Camera.orbit: c.orbit([0, 0, 0], OPT)
    Camera.frame: c.frame(OPT)
    Camera.cut: c.cut(1, OPT)
    test: test(\"a\", OPT, || { expect(h).y().above(0.0); })
    scene: TEST scene(\"other.rhai\", OPT)
    plan: TEST plan(OPT)
    expect_image: TEST expect_image(\"a\", OPT)
    expect_picture: TEST expect_picture(\"a\", OPT)
    Expect.on_floor: TEST expect(h.joint(\"LeftFoot\")).on_floor(OPT)
    Expect.in_frame: TEST expect(h).in_frame(OPT)
    Expect.slide: TEST expect(h.joint(\"LeftFoot\")).slide(OPT)";

/// Whether each option is accepted: no call may report it as unknown. The last one is unknown to every call.
fn refused_options(editor: &mut Editor, uri: &str, call: &str, options: &[String]) -> Vec<String> {
    const HEAD: &str = "let a = load(\"choreo:mannequin\"); let walk = a.clip(\"Walk\"); let c = camera(\"c\"); \
        let h = cast(\"h\", a); let b = cast(\"b\", a); let s = shape(\"box\");\n";
    let line = |name: &String| {
        let call = call.replace("OPT", &format!("#{{ {name}: 1 }}"));
        match call.strip_prefix("TEST ") {
            Some(call) => format!("test(\"{name}\", || {{ {call}; }});\n"),
            None => format!("{call};\n"),
        }
    };
    // A second call of `stage` is refused whatever its options are, and a script stops after several failed statements.
    let at_once = if call.starts_with("stage") { 1 } else { 12 };
    const REFUSALS: [&str; 4] =
        ["unknown option \"", "has no option", "unknown parameter \"", ".no_such_option is unknown"];
    let mut refused = Vec::new();
    for options in options.chunks(at_once) {
        let lines: String = options.iter().map(line).collect();
        editor.replace_text(uri, &format!("{HEAD}{lines}"));
        for found in editor.wait_for_diagnostics(uri) {
            let message = found["message"].as_str().unwrap();
            let line = found["range"]["start"]["line"].as_u64().unwrap() as usize;
            if REFUSALS.iter().any(|refusal| message.contains(refusal)) {
                refused.push(options[line - 1].clone());
            }
        }
    }
    refused
}

/// Every option that is offered is accepted, for all functions of the API.
#[test]
fn every_offered_option_is_accepted() {
    let folder = project_folder();
    let root = folder.path().canonicalize().unwrap();
    std::fs::write(root.join("other.rhai"), HEAD).unwrap();
    let uri = script(folder.path(), "");
    let mut editor = Editor::start(folder.path());
    editor.open(&uri, "");
    let calls = || CALLS.lines().map(|line| line.trim().split_once(": ").unwrap());
    let (mut invented, mut blind, mut offered) = (Vec::new(), Vec::new(), 0);
    for entry in choreo_script::describe::entries() {
        let mut options: Vec<String> = entry.options().into_iter().map(|option| option.name).collect();
        let own: Vec<&str> =
            calls().filter(|(name, _)| *name == entry.full_name()).map(|(_, call)| call).collect();
        assert!(
            options.is_empty() || !own.is_empty(),
            "{} is tried with no call: {options:?}",
            entry.full_name()
        );
        offered += options.len();
        for call in own {
            options.push("no_such_option".to_string());
            let refused = refused_options(&mut editor, &uri, call, &options);
            if !refused.contains(&"no_such_option".to_string()) {
                blind.push(format!("{call}: {:?}", messages(&editor.wait_for_diagnostics(&uri))));
            }
            options.retain(|option| refused.contains(option) && option != "no_such_option");
        }
        invented.extend(options.iter().map(|option| format!("{}: {option}", entry.full_name())));
    }
    assert!(blind.is_empty(), "calls that do not look at their options: {blind:#?}\n{invented:?}");
    assert!(invented.is_empty(), "offered, but not accepted: {invented:?}");
    assert!(offered > 300, "{offered}");
}

/// Runs Neovim without a window on a script beside these files, until the session in Lua has written what Neovim shows to a file.
/// `None` if Neovim is not installed.
fn neovim_session(text: &str, files: &[(&str, &str)], args: &[&str]) -> Option<String> {
    if std::process::Command::new("nvim").arg("--version").output().is_err() {
        println!("SKIP 1: nvim is not installed (Debian package neovim)");
        return None;
    }
    let folder = project_folder();
    std::fs::write(folder.path().join("scene.rhai"), text).unwrap();
    files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
    let program = Path::new(env!("CARGO_BIN_EXE_choreo"));
    let others = std::env::var("PATH").unwrap_or_default();
    let run = std::process::Command::new("nvim")
        .args(["--headless", "-n", "-c", "luafile session.lua"])
        .args(args)
        .env("CHOREO", program)
        .env("PATH", format!("{}:{others}", program.parent().unwrap().display()))
        .env("CHOREO_PLUGINS", "")
        .current_dir(folder.path())
        .output()
        .unwrap();
    let shown = std::fs::read_to_string(folder.path().join("shown.txt"));
    Some(shown.unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&run.stderr))))
}

#[track_caller]
fn has_lines(shown: &str, beginnings: &[&str]) {
    for expected in beginnings {
        assert!(shown.lines().any(|line| line.starts_with(expected)), "{expected}:\n{shown}");
    }
}

/// Uses the client of Neovim: a Lua script prints what it receives.
#[test]
fn neovim_shows_diagnostics_completion_and_hover() {
    let text = format!("/* ä𝄞 */ {HEAD}hero.play(tri.clip(\"Slid\"));\n");
    let files = [("session.lua", include_str!("../common/session.lua"))];
    let Some(shown) = neovim_session(&text, &files, &["--clean"]) else { return };
    let expected = [
        "diagnostic 3:20 unknown clip \"Slid\" in \"models/tri.gltf\"; did you mean \"Slide\"?",
        "item Slide 2.00 s, 60 frames at 30 fps",
        "hover Actor.play(clip, options?) → Cue",
    ];
    has_lines(&shown, &expected);
}

/// The settings that the README gives for Neovim, as `init.lua`.
#[test]
fn neovim_works_with_the_documented_settings() {
    let page = include_str!("../../../language_server/README.md");
    let settings = page.split_once("**Neovim**").and_then(|(_, rest)| rest.split_once("```lua\n"));
    let (settings, _) = settings.and_then(|(_, rest)| rest.split_once("```")).expect("settings on the page");
    let text = format!("{HEAD}hero.play(  tri.clip(\"Slid\"));\n");
    let files = [("init.lua", settings), ("session.lua", include_str!("../common/settings.lua"))];
    let Some(shown) = neovim_session(&text, &files, &["-u", "init.lua", "-i", "NONE"]) else { return };
    let expected = [
        "diagnostic 3:22 unknown clip \"Slid\"",
        "item Slide",
        "0 diagnostics",
        "line hero.play(tri.clip(\"Slide\"));",
        "omnifunc v:lua.vim.lsp.omnifunc",
    ];
    has_lines(&shown, &expected);
}
