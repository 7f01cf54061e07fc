//! `choreo farm --status`: the state of each chunk, determined from the files of the workers, also if a worker was stopped or killed.
#![cfg(unix)]

use crate::common::*;
use std::path::Path;

/// 60 frames.
const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 30, length: 2.0 });
let color = param("color", "#c04020");
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: color }))
    .key("position", [[0.0, [-1.5, 0, 0]], [2.0, [1.5, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

fn start_worker(folder: &Path, frames: &str, more: &[&str]) -> Process {
    let args = [
        "render",
        "film.choreo",
        "-o",
        "film.mp4",
        "--device=cpu",
        "--frames",
        frames,
        "--segment",
        "segments",
    ];
    let args = [&args[..], &["--resume", "--quiet"], more].concat();
    Process::spawn(&mut command(&folder.join("job"), &args))
}

fn status(folder: &Path) -> serde_json::Value {
    let run = choreo(folder, &["farm", "--status", "job", "--json"]);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

/// The state and the number of finished frames of each chunk.
fn chunk_states(status: &serde_json::Value) -> Vec<(String, u64)> {
    let chunk = |chunk: &serde_json::Value| {
        (chunk["state"].as_str().unwrap().into(), chunk["done"].as_u64().unwrap())
    };
    status["chunks"].as_array().unwrap().iter().map(chunk).collect()
}

#[test]
fn chunks_are_done_running_failed_stopped_or_waiting() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("s.rhai"), SCRIPT).unwrap();
    let farm =
        ["farm", "s.rhai", "-o", "film.mp4", "--for", "slurm", "--to", "job", "--chunk", "12", "--quiet"];
    assert_eq!(choreo(d, &farm).code, 0);
    let all_wait = status(d);
    assert_eq!((all_wait["frames"].as_u64(), all_wait["done"].as_u64()), (Some(60), Some(0)));
    assert_eq!(all_wait["counts"], serde_json::json!({ "waiting": 5 }));
    assert_eq!(start_worker(d, "0-11", &[]).wait().code, 0);
    assert_eq!(start_worker(d, "48-59", &["--set", "color=nonsense"]).wait().code, 1);
    let large = ["--size", "3840x2160"];
    // One worker continues to run, and one is killed.
    let running = start_worker(d, "24-35", &large);
    let killed = start_worker(d, "36-47", &large);
    for (chunk, worker) in [(2, &running), (3, &killed)] {
        wait_for("finished frames", || chunk_states(&status(d))[chunk].1 > 0);
        worker.signal("-STOP");
    }
    drop(killed);
    let now = status(d);
    let states: Vec<String> = chunk_states(&now).into_iter().map(|(state, _)| state).collect();
    assert_eq!(states, ["done", "waiting", "running", "stopped", "failed"]);
    assert!(chunk_states(&now)[3].1 > 0, "{now}");
    assert_eq!(now["films"], serde_json::json!([{ "output": "film.mp4", "frames": 60, "joined": false }]));
    let message = now["chunks"][4]["message"].as_str().unwrap();
    assert!(
        message.contains("film.rhai:2") || message.contains("s.rhai:2") || message.contains("nonsense"),
        "{message}"
    );
    let text = choreo(d, &["farm", "--status", "job", "--sheet", "sheet.png"]);
    assert_eq!(text.code, 0, "{}", text.err);
    let lines: Vec<&str> = text.out.lines().collect();
    assert_eq!(lines[0], "5 chunks: 1 done, 1 running, 1 failed, 1 stopped, 1 waiting");
    assert!(lines[1].contains(" of 60 frames"), "{}", lines[1]);
    assert!(
        lines.iter().any(|line| line.starts_with("frames 48-59: failed on ") && line.contains("nonsense")),
        "{}",
        text.out
    );
    assert!(lines.iter().any(|line| line.starts_with("frames 36-47: stopped on ")), "{}", text.out);
    assert!(image::open(d.join("sheet.png")).unwrap().width() > 192);
    // A worker that receives SIGTERM stops regularly.
    running.signal("-TERM");
    running.signal("-CONT");
    assert_eq!(running.wait().code, 130);
    assert_eq!(chunk_states(&status(d))[2].0, "stopped");
}

/// The sheet has the first frame of each chunk. Frames that are smaller than a thumbnail are not scaled.
#[test]
fn the_contact_sheet_shows_first_frames() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("s.rhai"), SCRIPT).unwrap();
    let farm =
        ["farm", "s.rhai", "-o", "film.mp4", "--for", "slurm", "--to", "job", "--chunk", "20", "--quiet"];
    assert_eq!(choreo(d, &[&farm[..], &["--size", "160x90"]].concat()).code, 0);
    for frames in ["0-19", "40-59"] {
        assert_eq!(start_worker(d, frames, &["--size", "160x90"]).wait().code, 0);
    }
    assert_eq!(choreo(d, &["farm", "--status", "job", "--sheet", "sheet.png"]).code, 0);
    let frames = ["--frames", "0,40", "-o", "f/%02d.png", "--device", "cpu", "--size", "160x90", "--quiet"];
    assert_eq!(choreo(d, &[&["render", "s.rhai"][..], &frames].concat()).code, 0);
    let open = |name: &str| image::open(d.join(name)).unwrap().to_rgba8();
    let sheet = open("sheet.png");
    assert_eq!([sheet.width(), sheet.height()], [2 * 164 + 4, 2 * 94 + 4]);
    // Below the text at the top left.
    for (name, [left, top]) in [("f/00.png", [4, 4]), ("f/40.png", [4, 98])] {
        let frame = open(name);
        for (x, y) in (20..90).flat_map(|y| (0..160).map(move |x| (x, y))) {
            assert_eq!(sheet.get_pixel(left + x, top + y), frame.get_pixel(x, y), "{name} at {x}, {y}");
        }
    }
    assert_eq!(sheet.get_pixel(168 + 80, 4 + 60).0, [0, 0, 0, 255], "a chunk that waits is black");
    assert!(open("f/00.png") != open("f/40.png"));
}

#[test]
fn a_folder_without_a_job_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let run = choreo(d, &["farm", "--status", "none"]);
    assert_eq!(run.code, 1);
    assert!(run.err.starts_with("none/job.json: cannot read: no such file"), "{}", run.err);
    std::fs::create_dir(d.join("none")).unwrap();
    for text in [
        "{",
        "{}",
        r#"{"job": 1, "films": [{"output": "../a.mp4", "segments": "", "options": [], "frames": 1, "chunks": []}]}"#,
    ] {
        std::fs::write(d.join("none/job.json"), text).unwrap();
        let run = choreo(d, &["farm", "--status", "none"]);
        assert!(
            run.code == 1 && run.err.contains("it is not a job that choreo farm has written"),
            "{}",
            run.err
        );
    }
    for args in [&["farm", "--status", "none", "--to", "x"][..], &["farm", "s.rhai"], &["farm"]] {
        assert_eq!(choreo(d, args).code, 2, "{args:?}");
    }
}
