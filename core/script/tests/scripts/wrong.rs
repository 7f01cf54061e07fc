//! Wrong and hostile scripts, each with the exact text of its messages: `wrong/NAME.rhai` and `wrong/NAME.txt`.
//! `CHOREO_ACCEPT=1 cargo test --workspace --test scripts wrong` writes the texts anew; read them before you commit them.

use crate::common::*;
use choreo_script::{Limits, ScriptOptions};
use std::path::Path;

/// Small limits, so that reaching one is quick.
fn options() -> ScriptOptions {
    let limits = Limits { operations: 300_000, frame_operations: 50_000, ..Limits::default() };
    ScriptOptions { limits, ..ScriptOptions::default() }
}

#[test]
fn every_wrong_script_is_answered_with_its_message() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wrong");
    let folder = Folder::new(&[
        ("hero.toy", ""),
        ("alien.toy", "other_"),
        ("broken.toy", "broken"),
        ("textured.toy", "beside ../secret.png"),
        ("models/knight.toy", ""),
        ("notes.txt", "nothing"),
        ("steps.rhai", "fn step() { }"),
        ("circle_a.rhai", "import \"circle_b\" as b;"),
        ("circle_b.rhai", "import \"circle_a\" as a;"),
        ("bad_module.rhai", "fn step() {\n    let x = (1;\n}"),
        ("bad_function.rhai", "fn step() {\n    cast(\"a\", 3);\n    no_such(1);\n}"),
    ]);
    let accept = std::env::var_os("CHOREO_ACCEPT").is_some();
    let mut names: Vec<_> = std::fs::read_dir(&corpus)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "rhai"))
        .collect();
    names.sort();
    assert!(names.len() >= 100, "the corpus has gone: {}", names.len());
    let mut failures = Vec::new();
    for path in names {
        let text = std::fs::read_to_string(&path).unwrap();
        let got = match folder.run_text(&text, &options()) {
            Ok(_) => "no error\n".to_string(),
            Err(errors) => show(&errors) + "\n",
        };
        let got = got.replace(&folder.path().display().to_string(), "FOLDER");
        let expected_at = path.with_extension("txt");
        if accept {
            std::fs::write(&expected_at, &got).unwrap();
            continue;
        }
        let expected = std::fs::read_to_string(&expected_at).unwrap_or_default();
        if got != expected || got.starts_with("no error") {
            failures.push(format!("{}\nexpected:\n{expected}\ngot:\n{got}", path.display()));
        }
    }
    assert!(failures.is_empty(), "{} scripts:\n{}", failures.len(), failures.join("\n"));
}
