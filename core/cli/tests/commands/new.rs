//! `choreo new`: the files that it writes work, and it overwrites nothing.

use crate::common::*;
use choreo_importer_kit_testing::external_crates;
use std::path::Path;

#[test]
fn new_single_file_plugins_work_unchanged() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["new", "importer", "my_format", "--single"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(file_names(dir.path()), ["my_format.importer.rhai", "sample.my_format", "tri.gltf"]);
    let run = choreo(dir.path(), &["info", "sample.my_format", "--import", "scale=2"]);
    assert!(run.code == 0 && run.out.contains("4.000 × 3.000 × 0.000 m"), "{}{}", run.out, run.err);
    let run = choreo(dir.path(), &["new", "effect", "old_photo", "--single"]);
    assert_eq!(run.code, 0, "{}", run.err);
    std::fs::write(dir.path().join("s.rhai"), "effect(\"old_photo\", #{ amount: 0.5 });\n").unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    assert_eq!(run.code, 0, "{}", run.err);
    for hook in HOOKS.into_iter().chain(["pixel"]) {
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
    let run = choreo(dir.path(), &["new", "exporter", "my_lines", "--single"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let script = "stage(#{ fps: 4, length: 0.75 });\ncast(\"a\", shape(\"box\")).at(1.0, 0.0, 2.5);\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let run = choreo(dir.path(), &["export", "s.rhai", "-o", "s.my_lines", "--export", "step=2"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let lines = String::from_utf8(read_file(dir.path(), "s.my_lines")).unwrap();
    let lines: Vec<&str> = lines.lines().collect();
    let of = |secs: &str| lines.iter().filter(|l| l.starts_with(secs) && l.ends_with(",1.0,0.0,2.5")).count();
    assert_eq!((lines[0], of("0.0,a,"), of("0.5,a,")), ("seconds,actor,joint,x,y,z", 1, 1), "{lines:?}");
    assert_eq!(lines.len(), 3);
    let run = choreo(dir.path(), &["new", "importer", "c", "--single", "--hook", "vertex"]);
    assert!(run.code != 0 && run.err.contains("--hook is for effects"), "{}", run.err);
    // A folder that does not exist is created.
    let run = choreo(dir.path(), &["new", "effect", "b", "--single", "--into", "looks/mine"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(dir.path().join("looks/mine/b.wgsl").is_file());
}

const OUTPUTS: &str = env!("CARGO_TARGET_TMPDIR");

/// The output of a cargo command in a folder.
fn run_cargo(folder: &Path, arguments: &[&str]) -> String {
    let output = external_crates::cargo(OUTPUTS, folder).args(arguments).arg("--offline").output().unwrap();
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat();
    assert!(output.status.success(), "{text}");
    text
}

const HOOKS: [&str; 7] = ["image", "surface", "vertex", "lighting", "outline", "overlay", "shutter"];

/// A crate of each kind, and an effect for each hook, as members of one workspace; their own tests pass.
#[test]
fn new_plugin_crates_build_and_pass_their_tests() {
    let (dir, sources) = (external_crates::folder(OUTPUTS, "new"), external_crates::sources());
    std::fs::write(dir.join("Cargo.toml"), "[workspace]\nresolver = \"3\"\nmembers = [\"mine/*\"]\n")
        .unwrap();
    std::fs::create_dir(dir.join("mine")).unwrap();
    let new = |kind: &str, name: &str, hook: &[&str]| {
        let arguments = ["new", kind, name, "--into", "mine", "--sources", sources.to_str().unwrap()];
        let run = choreo(&dir, &[&arguments, hook].concat());
        assert!(
            run.code == 0 && run.out.contains("it belongs to the workspace of"),
            "{}{}",
            run.out,
            run.err
        );
    };
    for (kind, made, copied) in [
        ("importer", "import-my-format", "example"),
        ("effect", "effect-my-format", "example"),
        ("exporter", "export-my-format", "csv"),
    ] {
        new(kind, "my_format", &[]);
        // No name of the crate that served as the template is left.
        let made = dir.join("mine").join(made);
        let text = |name: &str| std::fs::read_to_string(made.join(name)).unwrap();
        let (source, readme) = (text("src/lib.rs"), text("README.md"));
        assert!(!source.to_lowercase().contains(copied), "{source}");
        assert!(!format!("{source}{readme}").contains(" to copy"), "{readme}");
    }
    HOOKS.iter().for_each(|hook| new("effect", &format!("of_{hook}"), &["--hook", hook]));
    let text = run_cargo(&dir, &["test", "--workspace", "--no-fail-fast"]);
    let passed = |tests: usize| text.matches(&format!("test result: ok. {tests} passed")).count();
    // The importer has three tests; the exporter and the eight effects have two each.
    assert_eq!((passed(3), passed(2)), (1, 9), "{text}");
    for test in
        ["a_crest_is_as_high_as_the_parameter", "a_pulse_makes_it_twice_as_wide", "half_a_turn_is_half"]
    {
        assert!(text.contains(test), "{text}");
    }
}

/// Outside a workspace the new crate is a workspace itself.
#[test]
fn a_new_crate_outside_a_workspace_builds() {
    let (dir, sources) = (folder_with_triangle(), external_crates::sources());
    let run = choreo(dir.path(), &["new", "exporter", "alone", "--sources", sources.to_str().unwrap()]);
    assert_eq!(run.code, 0, "{}", run.err);
    let text = run_cargo(&dir.path().join("export-alone"), &["check", "--tests"]);
    assert!(text.contains("Checking export-alone"), "{text}");
}

#[test]
fn new_overwrites_nothing_and_checks_names() {
    let dir = folder_with_triangle();
    std::fs::write(dir.path().join("a.wgsl"), "mine").unwrap();
    let run = choreo(dir.path(), &["new", "effect", "a", "--single"]);
    assert_eq!((run.code, run.err.trim()), (3, "a.wgsl: it exists already; nothing was written"));
    assert_eq!(read_file(dir.path(), "a.wgsl"), b"mine");
    for name in ["A", "1a", "a b", "../a", "a_", ""] {
        let run = choreo(dir.path(), &["new", "importer", name, "--single"]);
        assert_eq!(run.code, 2, "{name}: {}", run.err);
    }
    let run = choreo(dir.path(), &["new", "importer", "a"]);
    assert!(run.code == 2 && run.err.contains("--sources DIR"), "{}", run.err);
    let run = choreo(dir.path(), &["new", "importer", "a", "--sources", "."]);
    assert!(run.code == 2 && run.err.contains("choreo's sources are not there"), "{}", run.err);
}

/// A new project passes `check` and `test` and renders unchanged; its test fails if the scene is changed so that an expectation is false.
#[test]
fn a_new_project_is_checked_tested_and_rendered_unchanged() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["new", "project", "my-film"]);
    assert!(run.code == 0 && run.out.contains("choreo view my-film.rhai"), "{}{}", run.out, run.err);
    let project = dir.path().join("my-film");
    for file in [
        ".gitignore",
        ".nvim.lua",
        ".vscode/settings.json",
        ".vscode/tasks.json",
        "README.md",
        "assets/README.md",
        "choreo.toml",
    ] {
        assert!(!read_file(&project, file).is_empty(), "{file}");
    }
    let run = choreo(&project, &["check", "my-film.rhai"]);
    assert!(run.code == 0 && !run.err.contains("warning"), "{}{}", run.out, run.err);
    let run = choreo(&project, &["test"]);
    // The sections of the test file, and the script itself.
    assert!(run.code == 0 && run.out.contains("3 passed, 0 failed, 0 skipped"), "{}{}", run.out, run.err);
    let frame = ["render", "my-film.rhai", "--at", "1.5", "--size", "320x180", "-o", "frame.png"];
    let run = choreo(&project, &[&frame[..], &["--device", "cpu"]].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    let image = image::load_from_memory(&read_file(&project, "frame.png")).unwrap().to_rgb8();
    // The number of pixels in which one channel exceeds another by more than the threshold.
    let more = |a: usize, b: usize, by: u8| image.pixels().filter(|p| p[a] > p[b].saturating_add(by)).count();
    let (coral, teal) = (more(0, 2, 40), more(1, 0, 30));
    assert!(coral > 300 && teal > 300, "{coral} and {teal} pixels");

    let script = project.join("my-film.rhai");
    let text = std::fs::read_to_string(&script).unwrap();
    std::fs::write(&script, text.replace("clip(\"Bow\")", "clip(\"Idle\")")).unwrap();
    let run = choreo(&project, &["test"]);
    assert!(run.code == 1 && run.out.contains("bob bows"), "{}{}", run.out, run.err);
}

/// The files for other programs are valid, and agree with the documentation of this repository.
#[test]
fn settings_of_a_project_are_well_formed() {
    let dir = folder_with_triangle();
    assert_eq!(choreo(dir.path(), &["new", "project", "film"]).code, 0);
    let project = dir.path().join("film");
    let text = |file: &str| std::fs::read_to_string(project.join(file)).unwrap();
    for file in [".vscode/settings.json", ".vscode/tasks.json"] {
        serde_json::from_str::<serde_json::Value>(&text(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    }
    let workflow = text(".github/workflows/test.yml");
    assert!(workflow.contains(concat!("--tag v", env!("CARGO_PKG_VERSION"), " choreo")), "{workflow}");
    assert!(workflow.contains("choreo test"), "{workflow}");
    let page =
        std::fs::read_to_string(external_crates::sources().join("core/language_server/README.md")).unwrap();
    let (_, settings) =
        text(".nvim.lua").split_once('\n').map(|(a, b)| (a.to_string(), b.to_string())).unwrap();
    assert!(page.contains(&settings), "{settings}");
}

#[test]
fn a_new_project_overwrites_nothing_and_its_name_is_checked() {
    let dir = folder_with_triangle();
    std::fs::create_dir(dir.path().join("there")).unwrap();
    let run = choreo(dir.path(), &["new", "project", "there"]);
    assert_eq!((run.code, run.err.trim()), (3, "there: it exists already; nothing was written"));
    assert!(file_names(&dir.path().join("there")).is_empty());
    for name in ["", "1a", "a b", "../a", "a/b", "a.b", "-a", "Nul", "é"] {
        let run = choreo(dir.path(), &["new", "project", "--", name]);
        assert!(run.code == 2 && run.err.contains("as my-film"), "{name}: {}", run.err);
    }
    let run = choreo(dir.path(), &["new", "project", "a", "--single"]);
    assert!(run.code == 2 && run.err.contains("are for plugins"), "{}", run.err);
    let run = choreo(dir.path(), &["new", "project", "My_Film", "--into", "films/mine"]);
    assert!(run.code == 0 && dir.path().join("films/mine/My_Film/My_Film.rhai").is_file(), "{}", run.err);
}
