//! `choreo check` on scripts that are valid but probably not intended: `checked/NAME.rhai`, with the exact expected output in
//! `checked/NAME.txt`. `CHOREO_ACCEPT=1 cargo test --workspace --test commands check` updates the expected output; read it before you commit.

use crate::common::*;
use std::path::Path;

#[test]
fn check_prints_the_expected_findings_of_every_script() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/checked");
    let accept = std::env::var_os("CHOREO_ACCEPT").is_some();
    let scripts = scripts_in(&corpus);
    assert!(scripts.len() >= 25, "the corpus has gone: {}", scripts.len());
    let mut failures = Vec::new();
    for path in scripts {
        let name = path.file_name().unwrap().to_str().unwrap();
        let run = choreo(&corpus, &["check", "--notes", name]);
        let got = format!("{}{}exit code {}\n", run.err, run.out, run.code);
        let expected_at = path.with_extension("txt");
        if accept {
            std::fs::write(&expected_at, &got).unwrap();
            continue;
        }
        let expected = std::fs::read_to_string(&expected_at).unwrap_or_default();
        if got != expected {
            failures.push(format!("{name}\nexpected:\n{expected}\ngot:\n{got}"));
        }
    }
    assert!(failures.is_empty(), "{} scripts:\n{}", failures.len(), failures.join("\n"));
}

/// No example script of the repository has a finding, so that the rules give no false alarms.
#[test]
fn the_example_scripts_have_no_warnings() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let scripts = scripts_in(&root.join("scripts"));
    assert!(scripts.len() >= 7);
    for path in scripts {
        // A limit on wall-clock time, which a script reaches earlier on a busy machine.
        let long_time_limits =
            ["--limit", "seconds=900", "--limit", "frame_seconds=900", "--limit", "check_seconds=900"];
        let args = [&["check", "--strict", path.to_str().unwrap()][..], &long_time_limits].concat();
        let run = choreo(&root, &args);
        assert_eq!((run.code, run.err.as_str()), (0, ""), "{}: {}", path.display(), run.out);
    }
}

#[test]
fn the_benchmark_scripts_have_no_warnings() {
    let Some(assets) = sample_assets_folder() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for path in scripts_in(&root.join("tests/bench")) {
        let search = assets.join("gltf");
        let args = ["check", "--strict", path.to_str().unwrap(), "--search", search.to_str().unwrap()];
        let run = choreo(&root, &args);
        assert_eq!((run.code, run.err.as_str()), (0, ""), "{}: {}", path.display(), run.out);
    }
}

#[test]
fn strict_fails_on_warnings_and_json_contains_rules() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/checked");
    let run = choreo(&corpus, &["check", "--strict", "frozen_at_end.rhai"]);
    assert_eq!(run.code, 1);
    assert!(run.err.ends_with("frozen_at_end.rhai: 1 warning, and --strict allows none\n"), "{}", run.err);
    let run = choreo(&corpus, &["check", "--strict", "cut_off.rhai"]);
    assert_eq!(
        (run.code, run.out.as_str()),
        (0, "cut_off.rhai: good, 120 frames, no warnings, 1 note (--notes shows it)\n")
    );
    let run = choreo(&corpus, &["check", "--json", "frozen_at_end.rhai"]);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    let found = &value["findings"][0];
    assert_eq!((found["rule"].as_str(), found["line"].as_u64()), (Some("frozen_at_end"), Some(5)), "{value}");
    assert_eq!(found["severity"].as_str(), Some("warning"));
}
