//! `choreo format`: what it changes, what it refuses, and that the scenes of scripts do not change.

use crate::common::{choreo, command, file_names, run_result, scripts_in};
use choreo_script::ScriptOptions;
use choreo_script::format::formatted;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

#[test]
fn only_unformatted_scripts_are_rewritten() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    for hidden in [".git", "target", "scenes"] {
        std::fs::create_dir(folder.path().join(hidden)).unwrap();
        write(&format!("{hidden}/a.rhai"), "f( 1 )");
    }
    write("good.rhai", "let a = 1; // kept\n");
    write("bad.rhai", "let a=[1,\n2];\n\n\n\nf(a)");
    write("broken.rhai", "let a = 1;\nf((2);\n");
    write("notes.txt", "f( 1 )");

    let run = choreo(folder.path(), &["format", "--check"]);
    assert_eq!((run.code, run.out.as_str()), (1, ""), "{}", run.err);
    for line in [
        "bad.rhai: is not formatted\n",
        "scenes/a.rhai: is not formatted\n",
        "broken.rhai:2:2: not formatted: \"(\" is never closed\n    f((2);\n     ^\n",
        "hint: choreo format bad.rhai scenes/a.rhai\n",
    ] {
        assert!(run.err.contains(line), "{line}: {}", run.err);
    }
    assert!(!run.err.contains("good") && !run.err.contains("target"), "{}", run.err);
    assert_eq!(read("bad.rhai"), "let a=[1,\n2];\n\n\n\nf(a)");

    let run = choreo(folder.path(), &["format"]);
    assert_eq!((run.code, run.out.as_str()), (1, "formatted bad.rhai\nformatted scenes/a.rhai\n"));
    assert_eq!(read("bad.rhai"), "let a = [1,\n    2];\n\nf(a)\n");
    assert_eq!(read("scenes/a.rhai"), "f(1)\n");
    for untouched in ["target/a.rhai", ".git/a.rhai", "notes.txt"] {
        assert_eq!(read(untouched), "f( 1 )", "{untouched}");
    }
    assert_eq!(read("broken.rhai"), "let a = 1;\nf((2);\n");
    let run = choreo(folder.path(), &["format", "--check", "good.rhai", "scenes"]);
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    let run = choreo(folder.path(), &["format", "no.rhai"]);
    assert_eq!((run.code, run.err.as_str()), (1, "no.rhai: no such file or folder\n"));
    assert!(file_names(folder.path()).iter().all(|name| !name.contains(".part")));
}

#[test]
fn standard_input_is_formatted() {
    let folder = tempfile::tempdir().unwrap();
    let through = |args: &[&str], text: &str| {
        let mut command = command(folder.path(), args);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
        run_result(child.wait_with_output().unwrap())
    };
    let run = through(&["format", "-"], "f( `a\u{1b} ` )");
    assert_eq!((run.code, run.out.as_str()), (0, "f(`a\u{1b} `)\n"));
    assert_eq!(through(&["format", "--check", "-"], "f(1)\n").code, 0);
    assert_eq!(through(&["format", "--check", "-"], "f( 1)\n").code, 1);
    let run = through(&["format", "-"], "f(1");
    assert_eq!((run.code, run.out.as_str()), (1, ""));
    assert!(run.err.starts_with("standard input:1:2: not formatted: \"(\" is never closed"), "{}", run.err);
}

/// The text with the same tokens in a bad layout: without indentation, and with additional spaces and blank lines.
fn badly_formatted(text: &str) -> String {
    let line = |line: &str| match line.contains(['"', '`', '/']) {
        true => line.trim().to_string(),
        false => line.trim().replace(", ", "  ,").replace(" = ", "="),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n\n\n")
}

#[test]
fn formatted_lessons_make_the_same_scenes() {
    let registry = choreo::app().registry;
    let options =
        ScriptOptions { requested_parts: choreo_plugin::ImportScope::NO_PIXELS, ..ScriptOptions::default() };
    let mut compared = 0;
    for path in scripts_in(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")) {
        let text = badly_formatted(&std::fs::read_to_string(&path).unwrap());
        let scene = |text: &str| {
            let run =
                choreo_script::run_text("scene.rhai", text, path.parent().unwrap(), &registry, &options);
            // The hash of a callback depends on its position in the script.
            run.map(|mut script| {
                (script.stage.frame_callbacks.drain(..).count(), script.stage.content_hash())
            })
        };
        // Of a lesson that needs its own plugin file only the tokens are compared.
        let Ok(expected) = scene(&text) else { continue };
        let new = formatted(&text).unwrap();
        assert_ne!(new, text, "{}", path.display());
        assert_eq!(scene(&new).ok(), Some(expected), "{}", path.display());
        compared += 1;
    }
    assert!(compared >= 35, "{compared}");
}
