//! `choreo help`: terms of the field, of scripts and of commands.

use crate::common::*;
use choreo_script::ScriptOptions;

fn help(term: &[&str]) -> Run {
    let dir = folder_with_triangle();
    choreo(dir.path(), &[&["help"], term].concat())
}

#[test]
fn help_for_a_term_shows_calls_an_example_and_a_page() {
    let run = help(&["foot", "sliding"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let expected = [
        "foot sliding\n  Actor.plant_feet(options?)\n      Locks feet that touch the ground in place",
        "\n      core/script/API.md, \"Constraints, inverse kinematics (IK) and spring bones\"\n",
        "\nExample: anna.plant_feet();\n",
    ];
    for part in expected {
        assert!(run.out.contains(part), "{part}\n{}", run.out);
    }
    assert_eq!(help(&["foot sliding"]).out, run.out);
    assert!(help(&["IK"]).out.contains("\n  Actor.reach(joint, target, options?)\n"));
}

#[test]
fn help_for_a_command_equals_its_help_option() {
    let run = help(&["headless"]);
    assert!(run.out.contains("\n  choreo render --frames\n      Which frames: "), "{}", run.out);
    let (with_help, with_flag) =
        (help(&["render"]), choreo(folder_with_triangle().path(), &["render", "--help"]));
    assert_eq!((with_help.code, &with_help.out), (0, &with_flag.out));
    assert_eq!(help(&[]).out, choreo(folder_with_triangle().path(), &["--help"]).out);
}

#[test]
fn help_describes_calls_and_searches_descriptions() {
    let run = help(&["Camera.fov"]);
    assert!(run.out.contains("Sets the vertical field of view in degrees"), "{}", run.out);
    let run = help(&["plant_feet"]);
    assert!(run.out.contains("      Options: feet (an array of joint names"), "{}", run.out);
    assert!(help(&["choreo.toml"]).out.contains("default options of commands"));
    assert!(help(&["counter-clockwise"]).out.contains("\n  Actor.turn(degrees)\n"));
}

#[test]
fn help_finds_commands_rules_and_pages_of_the_guide() {
    for (term, parts) in [
        ("new project", &["  choreo new project\n      A folder for videos", "choreo new --help"][..]),
        ("choreo check", &["  choreo check\n", "check --help"]),
        ("render --frames", &["  choreo render --frames\n      Which frames"]),
        ("language server", &["  choreo lsp\n", "core/language_server/README.md, \"Language server\""]),
        ("vs code", &["  choreo lsp\n"]),
        ("allow", &["  Rules of choreo check, and // allow:\n", "core/cli/README.md"]),
        ("reach_too_far", &["  reach_too_far\n      a hand never gets to its target"]),
        ("hand over", &["  A hand-over\n", "scripts/guide/src/recipes/hand_over.md"]),
        ("retargeting", &["scripts/guide/src/concepts/retargeting.md"]),
        ("troubleshooting", &["scripts/guide/src/troubleshooting.md"]),
        ("pass", &["  Passes with textures of their own\n", "core/wgsl_effect/README.md"]),
        ("plugins in other programs", &["plugins/COMPARISON.md"]),
        ("wasm plugin", &["core/wasm_plugin/README.md"]),
    ] {
        let run = help(&[term]);
        assert_eq!(run.code, 0, "{term}: {}", run.err);
        for part in parts {
            assert!(run.out.contains(part), "{term}: {part}\n{}", run.out);
        }
        assert_eq!(
            help(&term.split(' ').filter(|_| !term.starts_with("render")).collect::<Vec<_>>()).code,
            0
        );
    }
    let page = help(&["--page", "recipes/dialogue.md"]);
    assert!(
        page.code == 0 && page.out.contains("cast(\"ada\"") && !page.out.contains("#include"),
        "{}",
        page.out
    );
}

/// The table of rules in the documentation has every rule that occurs in the expected output of `checked`.
#[test]
fn the_readme_lists_every_rule_of_check() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/checked");
    let mut rules = std::collections::BTreeSet::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let text = std::fs::read_to_string(&entry).unwrap_or_default();
        if entry.extension().is_some_and(|e| e == "txt") {
            let named = text
                .lines()
                .filter_map(|line| line.strip_suffix(']')?.rsplit_once(" ["))
                .map(|(_, rule)| rule);
            rules.extend(named.map(str::to_string));
        }
    }
    let readme = include_str!("../../README.md");
    let missing: Vec<&String> =
        rules.iter().filter(|rule| !readme.contains(&format!("| `{rule}` |"))).collect();
    assert!(missing.is_empty() && rules.len() > 25, "{missing:?} of {rules:?}");
}

#[test]
fn help_describes_effects_shader_functions_and_pages() {
    for (name, about, parameter) in [
        ("wireframe", "edges of triangles", "color"),
        ("vignette", "darkens", "strength"),
        ("film grain", "grain of photographic film", "colored"),
    ] {
        let run = help(&[name]);
        let effect = name.replace(' ', "_");
        let first = run.out.lines().nth(1).unwrap();
        assert_eq!(first, format!("  effect(\"{effect}\")"), "{}", run.out);
        let page = format!("\n      plugins/effects/{effect}/README.md\n");
        for part in [about, &format!("\n      {parameter} "), &page] {
            assert!(run.out.contains(part), "{part}: {}", run.out);
        }
    }
    let depth = help(&["depth_at"]);
    assert!(
        depth.out.contains("  depth_at(at: vec2<i32>) -> f32\n      metres before the camera"),
        "{}",
        depth.out
    );
    assert!(
        help(&["inputs of effects"])
            .out
            .contains("core/wgsl_effect/README.md, \"Inputs of effects on images\"")
    );
    let import = help(&["fbx", "import"]);
    assert!(
        import.out.contains("\n  load(file") && import.out.contains("plugins/import-fbx/README.md"),
        "{}",
        import.out
    );
    let page = help(&["--page", "core/script/API.md, \"Conventions\""]);
    assert!(page.code == 0 && page.out.starts_with("# What a script can call"), "{}", page.err);
    let none = help(&["--page", "core/script/APY.md"]);
    assert!(none.code == 2 && none.err.contains("did you mean \"core/script/API.md\"?"), "{}", none.err);
    let plugin = choreo(folder_with_triangle().path(), &["plugins", "film_grain"]);
    let parts = [
        "effects\n  film_grain ",
        "different in each frame",
        "strength ",
        "plugins/effects/film_grain/README.md",
    ];
    assert!(
        plugin.code == 0 && parts.iter().all(|part| plugin.out.contains(part)),
        "{}{}",
        plugin.out,
        plugin.err
    );
    assert!(!plugin.out.contains("vignette"), "{}", plugin.out);
    let none = choreo(folder_with_triangle().path(), &["plugins", "film_gain"]);
    assert!(
        none.code != 0 && none.err.contains("there is no plugin \"film_gain\"; did you mean \"film_grain\"?"),
        "{}",
        none.err
    );
}

#[test]
fn an_unknown_term_ends_with_exit_code_2_and_a_suggestion() {
    let run = help(&["foot slidng"]);
    assert_eq!(run.code, 2);
    assert!(
        run.err.contains("there is no entry \"foot slidng\"; did you mean \"foot sliding\""),
        "{}",
        run.err
    );
    let run = help(&["quaggaflux", "--json"]);
    assert_eq!(run.code, 2);
    assert!(run.out.contains("\"usage\""), "{}", run.out);
}

#[test]
fn every_script_example_of_help_runs() {
    let prelude = include_str!("../../../../scripts/guide/frame.rhai");
    let registry = choreo::registry();
    let (dir, mut failures, mut ran) = (tempfile::tempdir().unwrap(), Vec::new(), 0);
    std::fs::write(dir.path().join("steps.rhai"), "fn step() {}").unwrap();
    std::fs::write(dir.path().join("edit.otio"), include_str!("../../../../scripts/guide/edit.otio"))
        .unwrap();
    for example in choreo_script::help::examples().filter(|e| !e.starts_with("choreo ")) {
        let first = ["import", "stage("].iter().any(|start| example.starts_with(start));
        let script = if first { example.to_string() } else { format!("{prelude}\n{example}") };
        let file = dir.path().join("example.rhai");
        std::fs::write(&file, &script).unwrap();
        if let Err(errors) = choreo_script::run_file(&file, &registry, &ScriptOptions::default()) {
            let texts: Vec<String> = errors.iter().map(ToString::to_string).collect();
            failures.push(format!("{example}\n{}", texts.join("\n")));
        }
        ran += 1;
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(ran > 60, "{ran}");
}
