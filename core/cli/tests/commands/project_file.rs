//! `choreo.toml`: folders and default options, their limits, and messages about mistakes in it.

use crate::common::{Run, choreo, folder};
use std::path::Path;

const SCRIPT: &str = r#"let t = load("tri.gltf"); cast("t", t); stage(#{ length: 0.2, fps: 10 });"#;

/// A project with a script in `scenes` and a model in `assets`.
fn project() -> tempfile::TempDir {
    let dir = folder();
    let d = dir.path();
    for name in [".git", "scenes", "assets"] {
        std::fs::create_dir(d.join(name)).unwrap();
    }
    std::fs::rename(d.join("tri.gltf"), d.join("assets/tri.gltf")).unwrap();
    std::fs::write(d.join("scenes/a.rhai"), SCRIPT).unwrap();
    dir
}

fn write(d: &Path, text: &str) {
    std::fs::write(d.join("choreo.toml"), text).unwrap();
}

fn size(d: &Path, more: &[&str]) -> serde_json::Value {
    let run = choreo(d, &[&["render", "scenes/a.rhai", "-o", "a.png", "--at", "0", "--json"], more].concat());
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    serde_json::from_str::<serde_json::Value>(&run.out).unwrap()["size"].clone()
}

#[test]
fn folders_and_defaults_come_from_it_and_the_command_line_wins() {
    let dir = project();
    let d = dir.path();
    // Without the folder the model is not found.
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.code == 1 && run.err.contains("tri.gltf"), "{}", run.err);
    write(d, "search = [\"assets\"]\n[render]\nsize = \"48x32\"\nsamples = 1\ndevice = \"cpu\"\n");
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 0);
    assert_eq!(size(d, &[]), serde_json::json!([48, 32]));
    assert_eq!(size(d, &["--size", "20x10"]), serde_json::json!([20, 10]));
    // A typed option wins over one that excludes it, too: --timings and --watch exclude each other.
    write(d, "search = [\"assets\"]\n[render]\ntimings = true\n");
    let run = choreo(d, &["render", "scenes/a.rhai", "-o", "missing/a.xyz", "--watch"]);
    assert!(!run.err.contains("cannot be used with"), "{}", run.err);
    let run = choreo(d, &["check", "scenes/a.rhai", "--no-project-file"]);
    assert!(run.code == 1 && run.err.contains("tri.gltf"), "{}", run.err);
    // The nearest file counts alone.
    std::fs::write(d.join("scenes/choreo.toml"), "[render]\nsize = \"8x8\"\n").unwrap();
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 1);
}

#[test]
fn the_nearest_file_upward_marks_the_project_with_and_without_a_repository() {
    let dir = project();
    let d = dir.path();
    let deep = d.join("scenes/more");
    std::fs::create_dir(&deep).unwrap();
    std::fs::write(deep.join("b.rhai"), SCRIPT).unwrap();
    write(d, "search = [\"assets\"]\n[check]\nstrict = true\n");
    for _ in 0..2 {
        assert_eq!(choreo(d, &["check", "scenes/more/b.rhai"]).code, 0);
        assert_eq!(choreo(&deep, &["check", "b.rhai"]).code, 0);
        let (_, dir) = (std::fs::remove_dir(d.join(".git")), d.join("scenes"));
        // A folder as an argument counts from itself upwards.
        assert_eq!(choreo(&dir, &["check", "../scenes/more/b.rhai"]).code, 0);
    }
    // strict counts in the folder below, too.
    std::fs::write(deep.join("b.rhai"), format!("{SCRIPT} camera(\"a\"); camera(\"never\");")).unwrap();
    let run = choreo(&deep, &["check", "b.rhai"]);
    assert!(run.code == 1 && run.err.contains("--strict"), "{}{}", run.out, run.err);
    // A repository inside the project is a project of its own.
    std::fs::create_dir(deep.join(".git")).unwrap();
    assert_eq!(choreo(&deep, &["check", "b.rhai"]).code, 1);
    assert!(choreo(&deep, &["check", "b.rhai"]).err.contains("tri.gltf"));
}

/// A file in a folder that others may write to must not reach into the folders of everybody.
#[cfg(unix)]
#[test]
fn outside_repositories_a_file_of_another_owner_does_not_count() {
    let dir = project();
    let d = dir.path();
    std::fs::remove_dir(d.join(".git")).unwrap();
    write(d, "search = [\"assets\"]\n");
    if std::os::unix::fs::chown(d.join("choreo.toml"), Some(12345), None).is_err() {
        eprintln!("only root may give files to others");
        return;
    }
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 1);
    std::fs::create_dir(d.join(".git")).unwrap();
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 0);
}

/// A single-file importer in a folder that only `choreo.toml` names.
#[test]
fn plugins_of_its_folders_are_found() {
    let dir = project();
    let d = dir.path();
    let lesson = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/08_plugins");
    std::fs::create_dir(d.join("tools")).unwrap();
    for (from, to) in [
        ("plugins/heights.importer.rhai", "tools/heights.importer.rhai"),
        ("valley.heights", "assets/valley.heights"),
    ] {
        std::fs::copy(lesson.join(from), d.join(to)).unwrap();
    }
    std::fs::write(d.join("scenes/v.rhai"), r#"cast("v", load("valley.heights"));"#).unwrap();
    write(d, "search = [\"assets\"]\n");
    let run = choreo(d, &["check", "scenes/v.rhai"]);
    assert!(run.code == 1 && run.err.contains("valley.heights"), "{}", run.err);
    write(d, "search = [\"assets\"]\nplugins = [\"tools\"]\n");
    let run = choreo(d, &["check", "scenes/v.rhai"]);
    assert_eq!(run.code, 0, "{}", run.err);
    write(d, "plugins = [\"tols\"]\n");
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("choreo.toml:1:12: plugins: there is no folder \"tols\""), "{}", run.err);
}

/// A test reads in its project, whatever folder the command is started in, and takes the project's options.
#[test]
fn tests_of_a_project_run_from_every_folder() {
    let dir = project();
    let d = dir.path();
    std::fs::remove_dir(d.join(".git")).unwrap();
    std::fs::create_dir(d.join("tests")).unwrap();
    let test = "test(\"stands\", || { let s = scene(\"../scenes/a.rhai\"); expect(s.actor(\"t\")).near([0, 0, 0], 0.1); });";
    std::fs::write(d.join("tests/a.rhai"), test).unwrap();
    write(d, "search = [\"assets\"]\n");
    let outside = tempfile::tempdir().unwrap();
    let (tests, file) = (d.join("tests"), d.join("tests/a.rhai"));
    let name = |path: &Path| path.to_string_lossy().into_owned();
    for (from, given) in [
        (d, "tests".to_string()),
        (&tests, "a.rhai".into()),
        (&tests, ".".into()),
        (&d.join("assets"), "../tests".into()),
        (outside.path(), name(&tests)),
        (outside.path(), name(&file)),
    ] {
        let run = choreo(from, &["test", &given]);
        assert_eq!(run.code, 0, "{given} from {}: {}{}", from.display(), run.out, run.err);
    }
    assert_eq!(choreo(&tests, &["test"]).code, 0);
    assert_ne!(choreo(&tests, &["test", "a.rhai", "--no-project-file"]).code, 0);
}

#[test]
fn what_is_wrong_with_it_is_told_with_its_place() {
    let dir = project();
    let d = dir.path();
    let message = |text: &str| -> String {
        write(d, text);
        let Run { code, err, .. } = choreo(d, &["check", "scenes/a.rhai"]);
        assert_eq!(code, 1, "{text}: {err}");
        err.split_once("choreo.toml:").map(|(_, rest)| rest.to_string()).unwrap_or(err)
    };
    assert_eq!(
        message("serach = [\"assets\"]\n"),
        "1:1: unknown key \"serach\"; did you mean \"search\"?\n    hint: known: search, plugins, render, farm, join, pack, export, check, info, explain, \
         measure, test\n"
    );
    assert!(
        message("[render]\nsiez = \"8x8\"\n")
            .starts_with("2:1: unknown option of render \"siez\"; did you mean \"size\"?")
    );
    assert_eq!(message("[render]\n\noutput = \"a.mp4\"\n"), "3:1: --output cannot have a default; give it on the command line\n");
    assert_eq!(message("[check]\nlimit = [\"frames=1\"]\n"), "2:1: --limit cannot have a default; give it on the command line\n");
    assert_eq!(message("search = \"assets\"\n"), "1:10: search must be an array of folders, [\"assets\"]\n");
    assert_eq!(message("search = [\"assets\", \"asets\"]\n"), "1:21: search: there is no folder \"asets\"\n");
    assert!(
        message("search = [\"..\"]\n")
            .starts_with("1:11: search: \"..\" leads out of the folder of choreo.toml\n")
    );
    assert_eq!(message("[check]\nstrict = 1\n"), "2:10: strict must be true or false\n");
    assert_eq!(message("[render]\nsamples = 3\n"), "2:11: --samples 3: 1 (fast) or 4 (smooth edges)\n");
    assert_eq!(message("[render]\nsize = [8, 8]\n"), "2:8: size must be a text or a number, WxH\n");
    assert_eq!(message("render = 3\n"), "1:10: render must be a table of options: [render]\n");
    assert_eq!(message("search = [\n"), "1:11: unclosed array, expected `]`\n");
}

#[cfg(unix)]
#[test]
fn links_lead_nowhere() {
    let dir = project();
    let d = dir.path();
    let other = folder();
    std::os::unix::fs::symlink(other.path(), d.join("elsewhere")).unwrap();
    write(d, "search = [\"elsewhere\"]\n");
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("leads out of the folder"), "{}", run.err);
    std::fs::remove_file(d.join("choreo.toml")).unwrap();
    std::fs::write(other.path().join("choreo.toml"), "").unwrap();
    std::os::unix::fs::symlink(other.path().join("choreo.toml"), d.join("choreo.toml")).unwrap();
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("symbolic link"), "{}", run.err);
}
