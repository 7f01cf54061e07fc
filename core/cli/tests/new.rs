//! `choreo new`: what it writes works, and it overwrites nothing.

mod common;

use common::*;
use std::path::Path;
use std::process::Command;

#[test]
fn single_files_work_as_they_are() {
    let dir = folder();
    let run = choreo(dir.path(), &["new", "importer", "my_format", "--single"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(names(dir.path()), ["my_format.importer.rhai", "sample.my_format", "tri.gltf"]);
    let run = choreo(dir.path(), &["info", "sample.my_format", "--import", "scale=2"]);
    assert!(run.code == 0 && run.out.contains("4.000 × 3.000 × 0.000 m"), "{}{}", run.out, run.err);
    let run = choreo(dir.path(), &["new", "effect", "old_photo", "--single"]);
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::write(dir.path().join("s.rhai"), "effect(\"old_photo\", #{ amount: 0.5 });\n").unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert_eq!(run.code, 0, "{}", run.err);
    for hook in ["pixel", "picture", "surface", "vertex", "lighting", "shell", "overlay"] {
        let run = choreo(dir.path(), &["new", "effect", &format!("of_{hook}"), "--single", "--hook", hook]);
        assert_eq!(run.code, 0, "{}", run.err);
        let script = format!(
            "cast(\"a\", shape(\"box\"));\nsun();\nambient(\"grey\");\ncamera(\"c\").frame();\neffect(\"of_{hook}\");\n"
        );
        std::fs::write(dir.path().join("s.rhai"), script).unwrap();
        let run = choreo(dir.path(), &["render", "s.rhai", "--size", "32x18", "--at", "0", "-o", "a.png"]);
        assert_eq!(run.code, 0, "{hook}: {}", run.err);
        std::fs::remove_file(dir.path().join("a.png")).unwrap();
    }
    let run = choreo(dir.path(), &["new", "importer", "c", "--single", "--hook", "vertex"]);
    assert!(run.code != 0 && run.err.contains("--hook is of effects"), "{}", run.err);
    // A folder that is not there yet is made.
    let run = choreo(dir.path(), &["new", "effect", "b", "--single", "--into", "looks/mine"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(dir.path().join("looks/mine/b.wgsl").is_file());
}

/// One crate of each kind, built where no registry is asked, and its own tests. What they are built from is kept between runs.
#[test]
fn crates_build_and_pass_their_tests() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let dir = folder();
    for (kind, made) in [("importer", "import-my-format"), ("effect", "effect-my-format")] {
        let run = choreo(dir.path(), &["new", kind, "my_format", "--sources", sources.to_str().unwrap()]);
        assert_eq!(run.code, 0, "{}", run.err);
        let made = dir.path().join(made);
        // The versions that are here already.
        std::fs::copy(sources.join("Cargo.lock"), made.join("Cargo.lock")).unwrap();
        let output = Command::new(env!("CARGO"))
            .args(["test", "--offline", "--quiet"])
            .current_dir(&made)
            .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-crates"))
            .env_remove("RUSTFLAGS")
            .output()
            .unwrap();
        let text =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{kind}: {text}");
        // Not an empty run: both have tests, and none of the words of the example is left.
        assert!(
            text.contains("test result: ok. 2 passed") || text.contains("test result: ok. 3 passed"),
            "{kind}: {text}"
        );
        let source = std::fs::read_to_string(made.join("src/lib.rs")).unwrap();
        assert!(!source.to_lowercase().contains("example"), "{source}");
        let readme = std::fs::read_to_string(made.join("README.md")).unwrap();
        assert!(!format!("{source}{readme}").contains(" to copy"), "{readme}");
    }
}

#[test]
fn nothing_is_overwritten_and_names_are_checked() {
    let dir = folder();
    std::fs::write(dir.path().join("a.wgsl"), "mine").unwrap();
    let run = choreo(dir.path(), &["new", "effect", "a", "--single"]);
    assert_eq!((run.code, run.err.trim()), (3, "a.wgsl: it exists already; nothing was written"));
    assert_eq!(read(dir.path(), "a.wgsl"), b"mine");
    for name in ["A", "1a", "a b", "../a", "a_", ""] {
        let run = choreo(dir.path(), &["new", "importer", name, "--single"]);
        assert_eq!(run.code, 2, "{name}: {}", run.err);
    }
    let run = choreo(dir.path(), &["new", "importer", "a"]);
    assert!(run.code == 2 && run.err.contains("--sources DIR"), "{}", run.err);
    let run = choreo(dir.path(), &["new", "importer", "a", "--sources", "."]);
    assert!(run.code == 2 && run.err.contains("choreo's sources are not there"), "{}", run.err);
}

/// In a folder of a workspace the crate is a member of it: a second root would be an error of Cargo.
#[test]
fn a_crate_in_a_workspace_is_a_member_of_it() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let dir = folder();
    std::fs::write(dir.path().join("Cargo.toml"), "[workspace]\nresolver = \"3\"\nmembers = [\"mine/*\"]\n")
        .unwrap();
    let arguments =
        ["new", "importer", "my_format", "--into", "mine", "--sources", sources.to_str().unwrap()];
    std::fs::create_dir(dir.path().join("mine")).unwrap();
    let run = choreo(dir.path(), &arguments);
    assert!(run.code == 0 && run.out.contains("it belongs to the workspace of"), "{}{}", run.out, run.err);
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(dir.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("import-my-format"), "{text}{}", String::from_utf8_lossy(&output.stderr));
}
