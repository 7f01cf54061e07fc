//! Messages of the viewer and of the command line: `check` and the viewer report the same.

use choreo_session::{SceneSource, Session};
use choreo_viewer::app::Viewer;
use choreo_viewer::commands::check;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Messages of the viewer about a script, formatted as `check` prints them.
fn viewer_messages(script: &Path) -> String {
    let source = SceneSource::new(script);
    let mut session = Session::new(source.clone(), &choreo::registry(), false).unwrap();
    let mut viewer = Viewer::new("a.rhai");
    let version = session.build(BTreeSet::new());
    let scene = version.scene.clone();
    viewer.take_version(version);
    if let Some(scene) = scene {
        let messages = check::check_scene(&scene, &source, &|| true).unwrap();
        viewer.take_messages(scene.number, &messages);
        // Messages about another version arrive late and are ignored.
        viewer.take_messages(scene.number + 1, &[choreo_session::Problem::warning("late")]);
    }
    // Continuation lines are indented, as on a terminal.
    let shown = |problem: &choreo_session::Problem| {
        let text = problem.to_string().replace('\n', "\n    ").replace("\n        ", "\n    ");
        text.replace(&format!("{}/", script.parent().unwrap().display()), "")
    };
    viewer.problems.iter().map(|problem| shown(problem) + "\n").collect()
}

#[test]
fn check_and_the_viewer_report_the_same_messages() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cli/tests/checked").canonicalize().unwrap();
    let files = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let scripts: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|e| e == "rhai")).collect();
    assert!(scripts.len() >= 25, "the corpus has gone: {}", scripts.len());
    let mut faults = Vec::new();
    for script in scripts {
        let expected = fs::read_to_string(script.with_extension("txt")).unwrap();
        // The last lines are the summary and the exit code.
        let is_message = |line: &&str| !line.starts_with("exit code ") && !line.contains(".rhai: good, ");
        // A callback fails where the bounds of the whole scene are computed, before the other frames are checked.
        let expected = expected.replace("(at 3 s and in 29 more frames)", "(at 3 s)");
        let expected: String = expected.lines().filter(is_message).map(|line| format!("{line}\n")).collect();
        let got = viewer_messages(&script);
        if got != expected {
            faults.push(format!("{}\nexpected:\n{expected}\ngot:\n{got}", script.display()));
        }
    }
    assert!(faults.is_empty(), "{} scripts:\n{}", faults.len(), faults.join("\n"));
}

/// A canceled check ends without a message.
#[test]
fn checking_stops_when_the_scene_is_replaced() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cli/tests/checked");
    let source = SceneSource::new(folder.join("gap.rhai"));
    let scene =
        Session::new(source.clone(), &choreo::registry(), false).unwrap().build(BTreeSet::new()).scene;
    let scene = scene.unwrap();
    assert!(check::check_scene(&scene, &source, &|| true).is_some_and(|messages| !messages.is_empty()));
    assert!(check::check_scene(&scene, &source, &|| false).is_none());
}
