//! Renders, exports and tests that are started from the panels write the same files as the command line.

use crate::place::Place;
use choreo_viewer::commands::queue::{Job, JobState};
use choreo_viewer::commands::test_report::Status;
use choreo_viewer::commands::{Commands, OutputKind, RUN_COMMAND_FLAG};
use choreo_viewer::panels::Panels;
use choreo_viewer::state::render_form::{Range, Size};
use choreo_viewer::state::settings::Settings;
use egui::vec2;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 0.4 });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Walk"));
"#;

fn opened(script: &str, front: &str) -> Harness<'static, Place> {
    let mut place = Place::new(script);
    let folder = place.folder.path().to_path_buf();
    place.viewer.commands = Commands {
        program: vec![env!("CARGO_BIN_EXE_choreo-view").into(), RUN_COMMAND_FLAG.into()],
        input: folder.join("a.rhai"),
        formats: Commands::formats_of(&choreo::registry()),
        ..Commands::default()
    };
    let beside = if front == "Render" { ["Render", "Tests"] } else { ["Tests", "Render"] };
    let layout = serde_json::json!({
        "right": 0.4, "first": { "tabs": ["Viewport"] }, "second": { "tabs": beside, "active": 0 },
    });
    place.panels = Panels::new(&Settings { layout: Some(layout), ..Settings::default() });
    place.harness(vec2(1500.0, 1100.0))
}

/// Waits for a process while the panels are drawn.
fn until<T>(
    harness: &mut Harness<'static, Place>,
    what: &str,
    is: impl Fn(&mut Harness<'static, Place>) -> Option<T>,
) -> T {
    let end = Instant::now() + Duration::from_secs(300);
    loop {
        harness.step();
        if let Some(found) = is(harness) {
            return found;
        }
        assert!(Instant::now() < end, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn ended(harness: &mut Harness<'static, Place>, index: usize) -> Job {
    until(harness, "the end of a job", |harness| {
        let job = harness.state().viewer.renders.jobs().get(index)?.clone();
        (!matches!(job.state, JobState::Waiting | JobState::Running { .. })).then_some(job)
    })
}

fn choose_format(harness: &mut Harness<'static, Place>, kind: OutputKind, extension: &str) {
    let viewer = &mut harness.state_mut().viewer;
    let found = viewer.commands.formats.iter().position(|f| f.kind == kind && f.extension == extension);
    viewer.render_form.format = found.unwrap();
    harness.run_steps(2);
}

/// Bytes of the file that the command line writes for the same scene.
fn rendered(script: &Path, output: &Path, words: &[&str]) -> Vec<u8> {
    let args =
        ["choreo", words[0]].into_iter().map(Into::into).chain([script.into(), "-o".into(), output.into()]);
    let code = choreo::run(args.chain(words[1..].iter().map(Into::into)), &choreo::app());
    assert_eq!(format!("{code:?}"), format!("{:?}", std::process::ExitCode::SUCCESS));
    fs::read(output).unwrap()
}

#[test]
fn queued_renders_and_exports_write_the_same_files_as_the_command_line() {
    let mut harness = opened(SCRIPT, "Render");
    let folder = harness.state().folder.path().to_path_buf();
    // A video at half the size, followed by an export of the scene.
    choose_format(&mut harness, OutputKind::Film, "gif");
    harness.state_mut().viewer.render_form.size = Size::Scaled(1, 2);
    harness.run_steps(2);
    click_add(&mut harness, "Render");
    choose_format(&mut harness, OutputKind::Scene, "glb");
    click_add(&mut harness, "Export");
    assert_eq!(harness.state().viewer.renders.jobs().len(), 2);
    for index in 0..2 {
        let job = ended(&mut harness, index);
        assert!(
            matches!(&job.state, JobState::Finished(text) if text.starts_with("10 frames in ")),
            "{job:?}"
        );
    }
    assert_eq!(harness.get_all_by_label_contains("10 frames in ").count(), 2);
    let script = folder.join("a.rhai");
    let film = rendered(&script, &folder.join("b.gif"), &["render", "--size", "32x18", "--quiet"]);
    assert!(fs::read(folder.join("a.gif")).unwrap() == film, "another film than render makes");
    let scene = rendered(&script, &folder.join("b.glb"), &["export", "--quiet"]);
    assert_eq!(fs::read(folder.join("a.glb")).unwrap().len(), scene.len());
    // One frame, given by its number.
    choose_format(&mut harness, OutputKind::Images, "png");
    harness.state_mut().viewer.render_form.range = Range::Playhead;
    harness.state_mut().viewer.playhead.step(3);
    harness.run_steps(2);
    click_add(&mut harness, "Render");
    ended(&mut harness, 2);
    let image =
        rendered(&script, &folder.join("b.png"), &["render", "--frames", "3", "--size", "32x18", "--quiet"]);
    assert!(fs::read(folder.join("a_3.png")).unwrap() == image, "another image than render makes");
}

/// Clicks the button below the form; its tab has the same name.
fn click_add(harness: &mut Harness<'static, Place>, name: &str) {
    let lowest = |harness: &Harness<'static, Place>| {
        let all = harness.get_all_by_label(name).map(|node| node.rect());
        all.max_by(|a, b| a.top().total_cmp(&b.top())).unwrap().center()
    };
    let at = lowest(harness);
    harness.hover_at(at);
    harness.run_steps(3);
    for pressed in [true, false] {
        harness.event(egui::Event::PointerButton {
            pos: at,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: Default::default(),
        });
    }
    harness.run_steps(3);
}

#[test]
fn canceling_a_render_removes_its_output_and_starts_the_next_job() {
    let long = SCRIPT.replace("length: 0.4", "length: 100.0").replace("[64, 36]", "[640, 360]");
    let mut harness = opened(&long, "Render");
    let folder = harness.state().folder.path().to_path_buf();
    choose_format(&mut harness, OutputKind::Film, "gif");
    click_add(&mut harness, "Render");
    harness.state_mut().viewer.render_form.output = folder.join("one.png").to_str().unwrap().into();
    harness.state_mut().viewer.render_form.range = Range::Playhead;
    harness.run_steps(2);
    click_add(&mut harness, "Render");
    until(&mut harness, "progress", |harness| {
        let jobs = harness.state().viewer.renders.jobs();
        matches!(jobs[0].state, JobState::Running { done: 2.., frames: 2500 }).then_some(())
    });
    assert!(harness.get_all_by_label_contains("of 2500 frames").next().is_some());
    assert_eq!(harness.state().viewer.renders.jobs()[1].state, JobState::Waiting);
    harness.get_all_by_label("Cancel").next().unwrap().click();
    harness.step();
    assert_eq!(ended(&mut harness, 0).state, JobState::Canceled);
    let done = ended(&mut harness, 1);
    assert!(matches!(done.state, JobState::Finished(_)), "{done:?}");
    let names = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    assert_eq!(names, ["a.rhai", "one.png"]);
    // A finished job is removed from the list.
    harness.get_all_by_label("Remove").next().unwrap().click();
    harness.run_steps(2);
    assert_eq!(harness.state().viewer.renders.jobs().len(), 1);
}

#[test]
fn a_second_job_for_a_file_being_written_is_rejected() {
    let long = SCRIPT.replace("length: 0.4", "length: 100.0").replace("[64, 36]", "[640, 360]");
    let mut harness = opened(&long, "Render");
    let folder = harness.state().folder.path().to_path_buf();
    choose_format(&mut harness, OutputKind::Film, "gif");
    click_add(&mut harness, "Render");
    until(&mut harness, "what is said of the file", |harness| {
        harness.query_by_label("a.gif is being written by a running render").map(drop)
    });
    click_add(&mut harness, "Render");
    assert_eq!(harness.state().viewer.renders.jobs().len(), 1);
    // Another file name is offered.
    harness.get_by_label("Write a_2.gif").click();
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("is being written").is_none());
    click_add(&mut harness, "Render");
    let outputs = |harness: &Harness<'static, Place>| -> Vec<_> {
        harness.state().viewer.renders.jobs().into_iter().map(|job| job.output).collect()
    };
    assert_eq!(outputs(&harness), [folder.join("a.gif"), folder.join("a_2.gif")]);
    harness.get_by_label("a_2.gif will be written by a waiting render");
    harness.state_mut().viewer.render_form.output.clear();
    harness.run_steps(2);
    harness.get_by_label("Write a_3.gif");
    // Exports and numbered images are checked, too.
    choose_format(&mut harness, OutputKind::Scene, "glb");
    click_add(&mut harness, "Export");
    harness.get_by_label("a.glb will be written by a waiting export");
    harness.get_by_label("Write a_2.glb");
    choose_format(&mut harness, OutputKind::Images, "png");
    click_add(&mut harness, "Render");
    harness.get_by_label("a_frames/%04d.png will be written by a waiting render");
    harness.get_by_label("Write a_frames_2/%04d.png").click();
    harness.run_steps(3);
    assert_eq!(Path::new(&harness.state().viewer.render_form.output), folder.join("a_frames_2/%04d.png"));
    // A file that no waiting job will write is free again.
    let jobs = harness.state().viewer.renders.jobs();
    jobs.iter().rev().for_each(|job| harness.state().viewer.renders.cancel(job.number));
    assert_eq!(ended(&mut harness, 0).state, JobState::Canceled);
    choose_format(&mut harness, OutputKind::Film, "gif");
    harness.state_mut().viewer.render_form.output.clear();
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("a.gif is").is_none());
}

#[test]
fn a_failed_render_reports_its_error() {
    let mut harness = opened(SCRIPT, "Render");
    harness.state().write("stage(#{ length: 1.0 }); nonsense();\n");
    choose_format(&mut harness, OutputKind::Film, "gif");
    click_add(&mut harness, "Render");
    let job = ended(&mut harness, 0);
    let JobState::Failed(why) = &job.state else { panic!("{job:?}") };
    assert!(why.starts_with("line 1: ") && why.contains("nonsense"), "{why}");
    harness.get_by_label(why);
}

const TESTS: &str = r##"let ball = shape("sphere", #{ color: "orange" });

test("twice two", || {
    expect(["two", "four"]).contains("four");
});

test("a wrong sum", || {
    expect(["two", "four"]).contains("five");
    expect(cast("high", ball).at(0, 2, 0)).at(0).y().below(1.0);
});

test("an image", || {
    cast("ball", ball);
    expect_image("ball", #{ at: 0.0, size: [48, 32] });
});
"##;

#[test]
fn the_test_panel_runs_sections_and_accepts_new_images() {
    let mut harness = opened(SCRIPT, "Tests");
    let folder = harness.state().folder.path().to_path_buf();
    let tests = folder.join("t.rhai");
    fs::write(&tests, TESTS).unwrap();
    harness.state_mut().viewer.test_path = tests.to_str().unwrap().into();
    run_all(&mut harness, 1);
    assert_eq!(
        states(&harness),
        ["passed", "failed", "failed"],
        "{:?}",
        harness.state().viewer.tests.failure()
    );
    harness.get_by_label("2 failed, 1 passed");
    assert!(harness.get_all_by_label_contains("five").next().is_some());
    assert!(harness.get_all_by_label_contains("got: ").next().is_some());
    harness.get_by_label("off by: 1 m");
    // A new image is accepted, after which only its section runs again.
    assert!(golden(&folder).is_none());
    accept(&mut harness, 2);
    assert!(golden(&folder).is_some());
    harness.get_by_label("1 failed, 2 passed");
    // Another color: expected image, actual image and difference are shown side by side.
    fs::write(&tests, TESTS.replace("orange", "teal")).unwrap();
    run_all(&mut harness, 3);
    harness.get_by_label("2 failed, 1 passed");
    for name in ["expected image", "actual image", "difference image"] {
        let size = harness.get_by_label(name).rect().size();
        assert!((size.x / size.y - 1.5).abs() < 0.05, "{name}: {size:?}");
    }
    let before = fs::read(golden(&folder).unwrap()).unwrap();
    accept(&mut harness, 4);
    assert_ne!(fs::read(golden(&folder).unwrap()).unwrap(), before);
    let sections = harness.state().viewer.tests.sections();
    let states: Vec<(&str, Status)> = sections.iter().map(|s| (s.name.as_str(), s.status)).collect();
    assert_eq!(
        states,
        [("twice two", Status::Passed), ("a wrong sum", Status::Failed), ("an image", Status::Passed)]
    );
    // An error in the script is reported, too.
    fs::write(&tests, "test(").unwrap();
    run_all(&mut harness, 5);
    let failed = harness.state().viewer.tests.sections();
    assert!(
        failed.iter().any(|s| s.status == Status::Error) || harness.state().viewer.tests.failure().is_some()
    );
}

fn states(harness: &Harness<'static, Place>) -> Vec<String> {
    let sections = harness.state().viewer.tests.sections();
    sections.iter().map(|s| format!("{:?}", s.status).to_lowercase()).collect()
}

fn run_all(harness: &mut Harness<'static, Place>, runs: u64) {
    harness.run();
    harness.get_by_label("Run tests").click();
    until(harness, "results", |harness| (harness.state().viewer.tests.runs() == runs).then_some(()));
    harness.run();
}

fn accept(harness: &mut Harness<'static, Place>, runs: u64) {
    harness.get_by_label("Accept").click();
    until(harness, "results", |harness| (harness.state().viewer.tests.runs() == runs).then_some(()));
    harness.run();
}

/// Path of the golden image in a folder next to the script.
fn golden(folder: &Path) -> Option<std::path::PathBuf> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).find_map(|path| match path.is_dir() {
        true => golden(&path),
        false => path.extension().is_some_and(|e| e == "png").then_some(path),
    })
}
