//! `choreo lsp`: inlay hints, semantic tokens, formatting, code lenses and commands.

use crate::common;
use crate::editor;

use editor::{Editor, uri};
use serde_json::{Value, json};
use std::path::Path;

/// A folder with a model of one clip, "Slide", of 2 seconds.
fn project_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("models")).unwrap();
    std::fs::write(folder.path().join("models/tri.gltf"), common::triangle(2.0)).unwrap();
    folder
}

/// A saved script.
fn script(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.canonicalize().unwrap().join(name);
    std::fs::write(&path, text).unwrap();
    uri(&path)
}

/// Byte of a position of the protocol.
fn byte_of_position(text: &str, place: &Value) -> usize {
    let number = |name: &str| place[name].as_u64().unwrap() as usize;
    let start: usize = text.split_inclusive('\n').take(number("line")).map(str::len).sum();
    let mut column = 0;
    for (at, c) in text[start..].char_indices() {
        if column >= number("character") {
            return start + at;
        }
        column += c.len_utf16();
    }
    text.len()
}

/// A text with edits applied.
fn with_edits_applied(text: &str, edits: &Value) -> String {
    let mut new = text.to_string();
    for edit in edits.as_array().unwrap().iter().rev() {
        let range =
            byte_of_position(text, &edit["range"]["start"])..byte_of_position(text, &edit["range"]["end"]);
        new.replace_range(range, edit["newText"].as_str().unwrap());
    }
    new
}

/// Hints of lines, each as the text before it and its label.
fn hints(editor: &mut Editor, uri: &str, text: &str, lines: std::ops::Range<usize>) -> Vec<(String, String)> {
    let at = |line: usize| json!({ "line": line, "character": 0 });
    let range = json!({ "start": at(lines.start), "end": at(lines.end) });
    let p = json!({ "textDocument": { "uri": uri }, "range": range });
    let found = editor.request("textDocument/inlayHint", p).unwrap();
    let shown = |hint: &Value| {
        assert_eq!(hint["paddingLeft"], true);
        let before = &text[..byte_of_position(text, &hint["position"])];
        let start = before.len().saturating_sub(12);
        let start = (start..).find(|at| before.is_char_boundary(*at)).unwrap();
        (before[start..].to_string(), hint["label"].as_str().unwrap().to_string())
    };
    let mut found: Vec<(String, String)> = found.as_array().unwrap().iter().map(shown).collect();
    found.sort();
    found
}

fn sorted_pairs(list: &[(&str, &str)]) -> Vec<(String, String)> {
    let mut list: Vec<(String, String)> = list.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    list.sort();
    list
}

const CUES: &str = "stage(#{ length: 8 });\nlet tri = load(\"models/tri.gltf\"); let s = tri.clip(\"Slide\");\n\
    let hero = cast(\"hero\", tri);\nhero.play(s).until(2.5)\n    .then(s, #{ fade: 0.5 }).once();\n\
    hero.play(s, #{ until: 2.0 }).from(1.0).on(\"Root..\");\nhero.joint(\"Root\").key(\"position\", [[0, [0, 0, 0]]]);\n\
    fn walk(who, clip) { who.play(clip).until(3.0) }\nfor i in 0..5 { walk(cast(`a${i}`, tri), s).from(i * 0.1); }\n";

#[test]
fn hints_show_resolved_times_and_lengths_that_the_text_does_not_state() {
    let folder = project_folder();
    let uri = script(folder.path(), "scene.rhai", CUES);
    let refresh = json!({ "workspace": { "inlayHint": { "refreshSupport": true } } });
    let mut editor = Editor::initialize(Editor::uninitialized(folder.path()), folder.path(), refresh);
    editor.open(&uri, CUES);
    assert!(editor.wait_for_diagnostics(&uri).iter().all(|found| found["severity"] != 1));
    editor.wait_for_message(|m| m["method"] == "workspace/inlayHint/refresh");
    let all = [
        ("clip(\"Slide\"", "2.00 s"),
        (").until(2.5)", "0.00–2.50 s"),
        (" 0.5 }).once()", "2.50–4.50 s"),
        ("p).until(3.0)", "0.00–3.00 s, 0.10–3.00 s, 0.20–3.00 s and 2 more"),
    ];
    let all = all.map(|(before, label)| (&before[before.len() - 12..], label));
    assert_eq!(hints(&mut editor, &uri, CUES, 0..9), sorted_pairs(&all));
    assert_eq!(hints(&mut editor, &uri, CUES, 1..3), sorted_pairs(&all[..1]));

    // After a new line above and an error, the times of the last valid run are shown at the current lines of the cues.
    let text = format!("// ä𝄞\n{CUES}let = ;\n");
    editor.replace_text(&uri, &text);
    assert_eq!(editor.wait_for_diagnostics(&uri).len(), 1);
    assert_eq!(hints(&mut editor, &uri, &text, 0..11), sorted_pairs(&all));
    // A call whose line was edited has no hint.
    let text = CUES.replace("until(2.5)", "until(2.6) (");
    editor.replace_text(&uri, &text);
    assert_eq!(editor.wait_for_diagnostics(&uri).len(), 1);
    assert_eq!(hints(&mut editor, &uri, &text, 0..9), sorted_pairs(&[all[0], all[2], all[3]]));

    let off = json!({ "choreo": { "inlayHints": { "cueTimes": false } } });
    editor.notify("workspace/didChangeConfiguration", json!({ "settings": off }));
    assert_eq!(hints(&mut editor, &uri, &text, 0..9), sorted_pairs(&all[..1]));
    let off = json!({ "choreo": { "inlayHints": { "clipLengths": false } } });
    editor.notify("workspace/didChangeConfiguration", json!({ "settings": off }));
    assert_eq!(hints(&mut editor, &uri, &text, 0..9), sorted_pairs(&[]));
}

/// Semantic tokens as text, type and modifiers.
fn decode_tokens(legend: &Value, text: &str, tokens: &Value) -> Vec<(String, String)> {
    let data: Vec<u64> = tokens["data"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    let (mut line, mut column) = (0, 0);
    let decode = |token: &[u64]| {
        line += token[0];
        column = if token[0] > 0 { token[1] } else { column + token[1] };
        let start = byte_of_position(text, &json!({ "line": line, "character": column }));
        let end = byte_of_position(text, &json!({ "line": line, "character": column + token[2] }));
        let mut kind = legend["tokenTypes"][token[3] as usize].as_str().unwrap().to_string();
        for bit in (0..2).filter(|bit| token[4] & (1 << bit) != 0) {
            kind += &format!("+{}", legend["tokenModifiers"][bit].as_str().unwrap());
        }
        (text[start..end].to_string(), kind)
    };
    data.chunks(5).map(decode).collect()
}

#[test]
fn semantic_tokens_have_the_kinds_of_words_and_strings() {
    let folder = project_folder();
    let mut editor = Editor::uninitialized(folder.path());
    let given = editor.request("initialize", json!({ "capabilities": {} })).unwrap();
    let provider = &given["capabilities"]["semanticTokensProvider"];
    assert_eq!((&provider["full"], &provider["range"]), (&json!(true), &json!(true)));
    let text = "/* ä𝄞\n b */ import \"steps\" as m; // c\n  let tri = load(\"models/tri.gltf\", #{ facing: \"-z\" });\n\
        let hero = cast(\"hero\", tri);\nlet slide = tri.clip(\"Slide\");\n\
        hero.play(slide, #{ fade: f(3), repeat: \"loop\" }).on(\"Root..\");\n\
        fn go(who, far) { who.at(cm(-2), far, PI); m::f(`x\n ${far} y`) }\nif true { hero.visible }\nsun(#{ color: \"red\" });\n";
    let uri = script(folder.path(), "scene.rhai", "");
    editor.open(&uri, text);
    let tokens = editor.request_about_document("textDocument/semanticTokens/full", &uri);
    let found = decode_tokens(&provider["legend"], text, &tokens);
    let expected = [
        ("/* ä𝄞", "comment"),
        (" b */", "comment"),
        ("import", "keyword"),
        ("\"steps\"", "namespace"),
        ("as", "keyword"),
        ("m", "namespace+declaration"),
        ("// c", "comment"),
        ("let", "keyword"),
        ("tri", "variable+declaration"),
        ("load", "function+defaultLibrary"),
        ("\"models/tri.gltf\"", "namespace"),
        ("facing", "property"),
        ("\"-z\"", "enumMember"),
        ("let", "keyword"),
        ("hero", "class+declaration"),
        ("cast", "function+defaultLibrary"),
        ("\"hero\"", "class"),
        ("tri", "variable"),
        ("let", "keyword"),
        ("slide", "event+declaration"),
        ("tri", "variable"),
        ("clip", "method+defaultLibrary"),
        ("\"Slide\"", "event"),
        ("hero", "class"),
        ("play", "method+defaultLibrary"),
        ("slide", "event"),
        ("fade", "property"),
        ("f", "number+defaultLibrary"),
        ("3", "number"),
        ("repeat", "property"),
        ("\"loop\"", "enumMember"),
        ("on", "method+defaultLibrary"),
        ("\"Root..\"", "enumMember"),
        ("fn", "keyword"),
        ("go", "function+declaration"),
        ("who", "parameter+declaration"),
        ("far", "parameter+declaration"),
        ("who", "parameter"),
        ("at", "method+defaultLibrary"),
        ("cm", "number+defaultLibrary"),
        ("-2", "number"),
        ("far", "parameter"),
        ("PI", "variable+defaultLibrary"),
        ("m", "namespace"),
        ("f", "function"),
        ("`x", "string"),
        (" $", "string"),
        ("far", "parameter"),
        (" y`", "string"),
        ("if", "keyword"),
        ("true", "keyword"),
        ("hero", "class"),
        ("visible", "property"),
        ("sun", "function+defaultLibrary"),
        ("color", "property"),
        ("\"red\"", "string"),
    ];
    let expected = expected.map(|(text, kind)| (text.to_string(), kind.to_string()));
    assert_eq!(found, expected);

    // A request for some lines gives the same tokens.
    let at = |line: usize| json!({ "line": line, "character": 0 });
    let p = json!({ "textDocument": { "uri": uri }, "range": { "start": at(3), "end": at(5) } });
    let tokens = editor.request("textDocument/semanticTokens/range", p).unwrap();
    assert_eq!(decode_tokens(&provider["legend"], text, &tokens), expected[13..23]);

    // A text of a megabyte.
    editor.replace_text(&uri, &"let a = load(\"x\"); a.clip(\"b\"); // c\n".repeat(20_000));
    let tokens = editor.request_about_document("textDocument/semanticTokens/full", &uri);
    assert_eq!(tokens["data"].as_array().unwrap().len(), 20_000 * 8 * 5);
}

#[test]
fn documents_and_lines_are_formatted() {
    let folder = project_folder();
    let uri = script(folder.path(), "scene.rhai", "");
    let mut editor = Editor::start(folder.path());
    let text = "let e=\"é𝄞\"  ; // a\n\n\n\nf( 1,2 )\n .g( 3 );\nif x{\ny()\n}";
    editor.open(&uri, text);
    let options = json!({ "tabSize": 2, "insertSpaces": true });
    let p = json!({ "textDocument": { "uri": uri }, "options": options });
    let edits = editor.request("textDocument/formatting", p.clone()).unwrap();
    let expected = "let e = \"é𝄞\"; // a\n\nf(1, 2)\n    .g(3);\nif x {\n    y()\n}\n";
    assert_eq!(with_edits_applied(text, &edits), expected);

    let at = |line: usize, character: usize| json!({ "line": line, "character": character });
    for (from, to, expected) in [
        ((5, 0), (5, 3), text.replace("\n .g( 3 )", "\n    .g(3)")),
        ((5, 0), (6, 0), text.replace("\n .g( 3 )", "\n    .g(3)")),
        ((6, 2), (7, 1), text.replace("if x{\ny()", "if x {\n    y()")),
        ((0, 0), (0, 0), text.replace("e=\"é𝄞\"  ; //", "e = \"é𝄞\"; //")),
    ] {
        let mut p = p.clone();
        p["range"] = json!({ "start": at(from.0, from.1), "end": at(to.0, to.1) });
        let edits = editor.request("textDocument/rangeFormatting", p).unwrap();
        assert_eq!(with_edits_applied(text, &edits), expected);
    }
    editor.replace_text(&uri, expected);
    assert_eq!(editor.request("textDocument/formatting", p.clone()).unwrap(), json!([]));
    editor.replace_text(&uri, "f( (1 );");
    assert_eq!(editor.request("textDocument/formatting", p).unwrap(), Value::Null);
}

const SCENE: &str = "stage(#{ size: [32, 18], length: 4 });\nlet box = cast(\"box\", shape(\"box\"));\n\
    camera(\"a\").at(0, 1, 4);\ncamera(\"b\").at(0, 2, 9).cut(2.5);\n// end\n";

fn progress() -> Value {
    json!({ "window": { "workDoneProgress": true } })
}

#[test]
fn the_frame_at_a_line_is_drawn_with_progress() {
    let folder = project_folder();
    let uri = script(folder.path(), "scene.rhai", SCENE);
    let mut editor = Editor::initialize(Editor::uninitialized(folder.path()), folder.path(), progress());
    editor.open(&uri, SCENE);
    editor.wait_for_diagnostics(&uri);
    let lenses = editor.request_about_document("textDocument/codeLens", &uri);
    let shown: Vec<(u64, &str)> = lenses
        .as_array()
        .unwrap()
        .iter()
        .map(|lens| {
            (lens["range"]["start"]["line"].as_u64().unwrap(), lens["command"]["title"].as_str().unwrap())
        })
        .collect();
    let expected = [
        (0, "Render frame"),
        (0, "Open viewer"),
        (3, "Render frame at 2.50 s"),
        (3, "Open viewer at 2.50 s"),
    ];
    assert_eq!(shown, expected);

    // The command of the lens at the cut, and one for the last line.
    let of_lens = lenses[2]["command"].clone();
    for (name, argument) in [
        (of_lens["command"].as_str().unwrap(), of_lens["arguments"][0].clone()),
        ("choreo.renderFrame", json!({ "uri": uri, "line": 4 })),
    ] {
        let drawn = editor.execute(name, argument).unwrap();
        assert_eq!(drawn["time"], 2.5);
        let path = drawn["path"].as_str().unwrap();
        let image = image::open(path).unwrap();
        assert_eq!((image.width(), image.height()), (32, 18));
        let created = editor.wait_for_message(|m| m["method"] == "window/workDoneProgress/create");
        let token = created["params"]["token"].clone();
        for kind in ["begin", "end"] {
            let progress = editor
                .wait_for_message(|m| m["method"] == "$/progress" && m["params"]["value"]["kind"] == kind);
            assert_eq!(progress["params"]["token"], token);
        }
        let message = editor.wait_for_message(|m| m["method"] == "window/showMessage");
        assert_eq!(message["params"]["message"], format!("The frame at 2.50 s: {path}"));
    }
    let silent = json!({ "uri": uri, "line": 0, "silent": true });
    let drawn = editor.execute("choreo.renderFrame", silent).unwrap();
    assert_eq!(drawn["time"], 0.0);
    let folder_of_frames = Path::new(drawn["path"].as_str().unwrap()).parent().unwrap().to_path_buf();

    // A script that cannot be drawn is answered with the reason.
    let failed =
        |editor: &mut Editor, argument: Value| editor.execute("choreo.renderFrame", argument).unwrap_err();
    assert_eq!(failed(&mut editor, json!({ "uri": "untitled:1" })).0, -32602);
    assert_eq!(editor.execute("choreo.noSuch", json!({ "uri": uri })).unwrap_err().0, -32602);
    editor.replace_text(&uri, "cats(1);\n");
    assert_eq!(failed(&mut editor, json!({ "uri": uri })), (-32803, "save scene.rhai first".to_string()));
    std::fs::write(folder.path().join("scene.rhai"), "cats(1);\n").unwrap();
    let (code, why) = failed(&mut editor, json!({ "uri": uri }));
    assert_eq!(code, -32803);
    assert!(why.contains("scene.rhai:1:1: unknown function \"cats\""), "{why}");
    assert_eq!(editor.shut_down(), 0);
    assert!(!folder_of_frames.exists(), "the frames are removed when the server ends");
}

#[test]
fn a_running_command_can_be_cancelled_while_the_server_answers() {
    let folder = project_folder();
    // Rendering this frame takes minutes.
    let slow = "stage(#{ size: [4000, 4000], length: 4 });\ncast(\"ball\", shape(\"sphere\"));\ncamera(\"a\").at(0, 0, 2);\n\
        effect(\"motion_blur\", #{ samples: 32 });\n";
    let uri = script(folder.path(), "slow.rhai", slow);
    let mut editor = Editor::initialize(Editor::uninitialized(folder.path()), folder.path(), progress());
    let p = json!({ "command": "choreo.renderFrame", "arguments": [{ "uri": uri }] });
    let by_request = editor.send_request("workspace/executeCommand", p.clone());
    editor.wait_for_message(|m| m["params"]["value"]["kind"] == "begin");
    assert_eq!(editor.request("no/such", json!({})), Err(-32601));
    editor.notify("$/cancelRequest", json!({ "id": by_request }));
    assert_eq!(editor.response(by_request), Err(-32800));
    let by_progress = editor.send_request("workspace/executeCommand", p.clone());
    let begun = editor.wait_for_message(|m| m["params"]["value"]["kind"] == "begin");
    editor.notify("window/workDoneProgress/cancel", json!({ "token": begun["params"]["token"] }));
    assert_eq!(editor.response(by_progress), Err(-32800));
    // The end of the session ends running commands.
    editor.send_request("workspace/executeCommand", p);
    assert_eq!(editor.shut_down(), 0);
}

#[test]
fn code_lenses_run_single_tests() {
    let folder = project_folder();
    let text = "test(\"it holds\", || { expect(1).equals(1); });\n\
        test(\"it fails\", || { expect(1).equals(2); });\nfor i in 0..2 { test(`number ${i}`, || { expect(i).equals(i); }); }\n";
    let uri = script(folder.path(), "sums.rhai", text);
    let mut editor = Editor::start(folder.path());
    editor.open(&uri, text);
    let lenses = editor.request_about_document("textDocument/codeLens", &uri);
    let titles: Vec<&str> =
        lenses.as_array().unwrap().iter().map(|lens| lens["command"]["title"].as_str().unwrap()).collect();
    assert_eq!(titles, ["Run test", "Run test", "Run the tests of this file"]);
    let mut run = |index: usize| {
        let argument = lenses[index]["command"]["arguments"][0].clone();
        let report = editor.execute("choreo.runTest", argument).unwrap();
        let message = editor.wait_for_message(|m| m["method"] == "window/showMessage");
        let status =
            |s: &Value| format!("{}: {}", s["section"].as_str().unwrap(), s["status"].as_str().unwrap());
        let sections: Vec<String> = report["sections"].as_array().unwrap().iter().map(status).collect();
        (sections, message["params"]["message"].as_str().unwrap().to_string())
    };
    assert_eq!(run(0), (vec!["it holds: passed".to_string()], "1 passed".to_string()));
    assert_eq!(run(1), (vec!["it fails: failed".to_string()], "0 passed, 1 failed: it fails".to_string()));
    let (sections, message) = run(2);
    assert_eq!((sections.len(), message.as_str()), (4, "3 passed, 1 failed: it fails"));
}

/// A script in place of the viewer stores its arguments.
#[cfg(unix)]
#[test]
fn the_viewer_is_opened_at_the_time_of_a_line() {
    use std::os::unix::fs::PermissionsExt;
    let folder = project_folder();
    let uri = script(folder.path(), "scene.rhai", SCENE);
    let programs = tempfile::tempdir().unwrap();
    let choreo = programs.path().join("choreo");
    std::fs::copy(env!("CARGO_BIN_EXE_choreo"), &choreo).unwrap();
    let mut editor =
        Editor::initialize(Editor::with_program(&choreo, folder.path()), folder.path(), json!({}));
    editor.open(&uri, SCENE);
    editor.wait_for_diagnostics(&uri);
    let (code, why) = editor.execute("choreo.openViewer", json!({ "uri": uri })).unwrap_err();
    assert!(code == -32803 && why.contains("the viewer is not beside choreo"), "{why}");

    let viewer = programs.path().join("choreo-view");
    std::fs::write(&viewer, "#!/bin/sh\necho \"$@\" > \"$0.called\"\n").unwrap();
    std::fs::set_permissions(&viewer, std::fs::Permissions::from_mode(0o755)).unwrap();
    editor.execute("choreo.openViewer", json!({ "uri": uri, "line": 3 })).unwrap();
    let called = std::fs::read_to_string(programs.path().join("choreo-view.called")).unwrap();
    assert!(called.ends_with("scene.rhai --at 2.5\n"), "{called}");
}
