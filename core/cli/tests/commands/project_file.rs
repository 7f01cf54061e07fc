//! `choreo.toml`: folders and default options, their limits, and error messages.

use crate::common::{Run, choreo, folder_with_triangle};
use std::path::Path;

const SCRIPT: &str = r#"let t = load("tri.gltf"); cast("t", t); stage(#{ length: 0.2, fps: 10 });"#;

/// A project with a script in `scenes` and a model in `assets`.
fn project() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    let d = dir.path();
    for name in [".git", "scenes", "assets"] {
        std::fs::create_dir(d.join(name)).unwrap();
    }
    std::fs::rename(d.join("tri.gltf"), d.join("assets/tri.gltf")).unwrap();
    std::fs::write(d.join("scenes/a.rhai"), SCRIPT).unwrap();
    dir
}

fn write_project_file(d: &Path, text: &str) {
    std::fs::write(d.join("choreo.toml"), text).unwrap();
}

fn rendered_size(d: &Path, more: &[&str]) -> serde_json::Value {
    let run = choreo(d, &[&["render", "scenes/a.rhai", "-o", "a.png", "--at", "0", "--json"], more].concat());
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    serde_json::from_str::<serde_json::Value>(&run.out).unwrap()["size"].clone()
}

#[test]
fn the_project_file_sets_folders_and_defaults_and_the_command_line_overrides_them() {
    let dir = project();
    let d = dir.path();
    // Without the folder in `search` the model is not found.
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.code == 1 && run.err.contains("tri.gltf"), "{}", run.err);
    write_project_file(
        d,
        "search = [\"assets\"]\n[render]\nsize = \"48x32\"\nsamples = 1\ndevice = \"cpu\"\n",
    );
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 0);
    assert_eq!(rendered_size(d, &[]), serde_json::json!([48, 32]));
    assert_eq!(rendered_size(d, &["--size", "20x10"]), serde_json::json!([20, 10]));
    // An option of the command line also overrides an option of the file that excludes it: --timings and --watch exclude each other.
    write_project_file(d, "search = [\"assets\"]\n[render]\ntimings = true\n");
    let run = choreo(d, &["render", "scenes/a.rhai", "-o", "missing/a.xyz", "--watch"]);
    assert!(!run.err.contains("cannot be used with"), "{}", run.err);
    let run = choreo(d, &["check", "scenes/a.rhai", "--no-project-file"]);
    assert!(run.code == 1 && run.err.contains("tri.gltf"), "{}", run.err);
    // Only the nearest file applies.
    std::fs::write(d.join("scenes/choreo.toml"), "[render]\nsize = \"8x8\"\n").unwrap();
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 1);
}

#[test]
fn the_nearest_project_file_in_a_parent_folder_is_used() {
    let dir = project();
    let d = dir.path();
    let deep = d.join("scenes/more");
    std::fs::create_dir(&deep).unwrap();
    std::fs::write(deep.join("b.rhai"), SCRIPT).unwrap();
    write_project_file(d, "search = [\"assets\"]\n[check]\nstrict = true\n");
    for _ in 0..2 {
        assert_eq!(choreo(d, &["check", "scenes/more/b.rhai"]).code, 0);
        assert_eq!(choreo(&deep, &["check", "b.rhai"]).code, 0);
        let (_, dir) = (std::fs::remove_dir(d.join(".git")), d.join("scenes"));
        // For an argument that is a folder, the search for `choreo.toml` begins in this folder.
        assert_eq!(choreo(&dir, &["check", "../scenes/more/b.rhai"]).code, 0);
    }
    // `strict` also applies in folders below.
    std::fs::write(deep.join("b.rhai"), format!("{SCRIPT} camera(\"a\"); camera(\"never\");")).unwrap();
    let run = choreo(&deep, &["check", "b.rhai"]);
    assert!(run.code == 1 && run.err.contains("--strict"), "{}{}", run.out, run.err);
    // A repository inside the project is a separate project.
    std::fs::create_dir(deep.join(".git")).unwrap();
    assert_eq!(choreo(&deep, &["check", "b.rhai"]).code, 1);
    assert!(choreo(&deep, &["check", "b.rhai"]).err.contains("tri.gltf"));
}

/// A `choreo.toml` of another user, in a folder that everyone may write to, is ignored.
#[cfg(unix)]
#[test]
fn a_project_file_of_another_owner_is_ignored_outside_a_repository() {
    let dir = project();
    let d = dir.path();
    std::fs::remove_dir(d.join(".git")).unwrap();
    write_project_file(d, "search = [\"assets\"]\n");
    if std::os::unix::fs::chown(d.join("choreo.toml"), Some(12345), None).is_err() {
        eprintln!("only root may change the owner of a file");
        return;
    }
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 1);
    std::fs::create_dir(d.join(".git")).unwrap();
    assert_eq!(choreo(d, &["check", "scenes/a.rhai"]).code, 0);
}

/// A single-file importer is found in a folder that only `choreo.toml` names.
#[test]
fn plugins_in_folders_of_the_project_file_are_found() {
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
    write_project_file(d, "search = [\"assets\"]\n");
    let run = choreo(d, &["check", "scenes/v.rhai"]);
    assert!(run.code == 1 && run.err.contains("valley.heights"), "{}", run.err);
    write_project_file(d, "search = [\"assets\"]\nplugins = [\"tools\"]\n");
    let run = choreo(d, &["check", "scenes/v.rhai"]);
    assert_eq!(run.code, 0, "{}", run.err);
    write_project_file(d, "plugins = [\"tols\"]\n");
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("choreo.toml:1:12: plugins: there is no folder \"tols\""), "{}", run.err);
}

/// A test reads the files and takes the options of its project, whatever the current folder is.
#[test]
fn tests_of_a_project_run_from_every_folder() {
    let dir = project();
    let d = dir.path();
    std::fs::remove_dir(d.join(".git")).unwrap();
    std::fs::create_dir(d.join("tests")).unwrap();
    let test = "test(\"stands\", || { let s = scene(\"../scenes/a.rhai\"); expect(s.actor(\"t\")).near([0, 0, 0], 0.1); });";
    std::fs::write(d.join("tests/a.rhai"), test).unwrap();
    write_project_file(d, "search = [\"assets\"]\n");
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
fn errors_of_the_project_file_state_line_and_column() {
    let dir = project();
    let d = dir.path();
    let message = |text: &str| -> String {
        write_project_file(d, text);
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
    assert_eq!(
        message("[render]\n\noutput = \"a.mp4\"\n"),
        "3:1: --output cannot have a default; give it on the command line\n"
    );
    assert_eq!(
        message("[check]\nlimit = [\"frames=1\"]\n"),
        "2:1: --limit cannot have a default; give it on the command line\n"
    );
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
fn symbolic_links_out_of_the_project_are_refused() {
    let dir = project();
    let d = dir.path();
    let other = folder_with_triangle();
    std::os::unix::fs::symlink(other.path(), d.join("elsewhere")).unwrap();
    write_project_file(d, "search = [\"elsewhere\"]\n");
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("leads out of the folder"), "{}", run.err);
    std::fs::remove_file(d.join("choreo.toml")).unwrap();
    std::fs::write(other.path().join("choreo.toml"), "").unwrap();
    std::os::unix::fs::symlink(other.path().join("choreo.toml"), d.join("choreo.toml")).unwrap();
    let run = choreo(d, &["check", "scenes/a.rhai"]);
    assert!(run.err.contains("symbolic link"), "{}", run.err);
}
