//! Interrupted renders: finished frames are kept, incomplete files are removed, and existing files are not changed.
#![cfg(unix)]

use crate::common::*;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A folder with a model whose clip takes an hour.
fn long_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("long.gltf"), triangle(3600.0)).unwrap();
    folder
}

fn start(folder: &Path, output: &str, more: &[&str]) -> Child {
    let args = ["render", "long.gltf", "-o", output, "--device", "cpu", "--size", "160x90", "--samples", "1"];
    command(folder, &[&args, more].concat()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// Whether the journal of a video has finished frames after its header, which describes the render.
fn has_frames(folder: &Path, output: &str) -> bool {
    std::fs::metadata(folder.join(format!("{output}.part/journal"))).is_ok_and(|m| m.len() > 1200)
}

#[test]
fn signals_leave_finished_frames_and_the_old_file() {
    for (name, more) in [("-INT", &[][..]), ("-TERM", &[]), ("-HUP", &["--watch"]), ("-INT", &["--discard"])]
    {
        let dir = long_folder();
        let d = dir.path();
        std::fs::write(d.join("o.mp4"), "old").unwrap();
        let child = start(d, "o.mp4", more);
        wait_for("finished frame", || has_frames(d, "o.mp4"));
        signal(&child, name);
        let run = run_result(child.wait_with_output().unwrap());
        assert_eq!(run.code, 130, "{}", run.err);
        assert_eq!(run.err.lines().last(), Some("interrupted"));
        assert_eq!(read_file(d, "o.mp4"), b"old");
        let discarded = more.contains(&"--discard");
        assert_eq!(part_files(d).is_empty(), discarded, "{name} {more:?}");
        let kept = "frames are kept in o.mp4.part; to resume the render: ";
        let command = run.err.lines().find_map(|line| line.split_once(kept).map(|(_, command)| command));
        assert_eq!(command.is_none(), discarded, "{}", run.err);
        assert!(
            command
                .is_none_or(|c| c.contains(" render --resume long.gltf -o o.mp4") && !c.contains("--watch"))
        );
    }
}

#[test]
fn images_finished_before_an_interrupt_are_complete() {
    let dir = long_folder();
    let d = dir.path();
    let child = start(d, "f/%05d.png", &[]);
    wait_for("fifth image", || d.join("f/00005.png").exists());
    signal(&child, "-INT");
    let run = run_result(child.wait_with_output().unwrap());
    assert_eq!(run.code, 130, "{}", run.err);
    let frame_files = file_names(&d.join("f"));
    assert!(frame_files.len() > 5 && frame_files.iter().all(|n| n.ends_with(".png")), "{frame_files:?}");
    for name in frame_files {
        // The last chunk of a PNG: length 0, "IEND", and the checksum.
        assert!(read_file(&d.join("f"), &name).ends_with(b"\0\0\0\0IEND\xaeB`\x82"), "{name} is cut");
    }
}

#[test]
fn a_closed_pipe_ends_the_render_quietly() {
    let dir = long_folder();
    let mut child = start(dir.path(), "-", &[]);
    let mut pipe = child.stdout.take().unwrap();
    pipe.read_exact(&mut [0; 1000]).unwrap();
    drop(pipe);
    let run = run_result(child.wait_with_output().unwrap());
    assert_eq!(run.code, 141, "{}", run.err);
    assert!(!run.err.contains("rror") && !run.err.contains("write"), "{}", run.err);
}

/// SIGKILL leaves temporary files, but no incomplete file has the final name, and the next render succeeds.
#[test]
fn a_killed_render_leaves_the_old_file() {
    let dir = long_folder();
    let d = dir.path();
    std::fs::write(d.join("o.y4m"), "old").unwrap();
    let child = start(d, "o.y4m", &[]);
    wait_for("part file", || !part_files(d).is_empty());
    std::thread::sleep(Duration::from_millis(100));
    signal(&child, "-KILL");
    let run = run_result(child.wait_with_output().unwrap());
    assert_eq!(run.code, -1, "{}", run.err);
    assert_eq!(read_file(d, "o.y4m"), b"old");
    let args =
        ["render", "long.gltf", "-o", "o.y4m", "--frames", "0..3", "--size", "32x32", "--device", "cpu"];
    assert_eq!(choreo(d, &args).code, 0);
    assert!(read_file(d, "o.y4m").starts_with(b"YUV4MPEG2"));
}

#[test]
fn a_folder_that_vanishes_is_named() {
    let dir = long_folder();
    let d = dir.path();
    std::fs::create_dir(d.join("f")).unwrap();
    let child = start(d, "f/%05d.png", &[]);
    wait_for("picture", || d.join("f/00001.png").exists());
    // The folder is moved away at once, because during a removal file by file new files could be added.
    std::fs::rename(d.join("f"), d.join("gone")).unwrap();
    let run = run_result(child.wait_with_output().unwrap());
    assert_eq!(run.code, 3, "{}", run.err);
    let line = run.err.lines().last().unwrap_or_default();
    assert!(line.starts_with("f/") && line.ends_with(".png: cannot write: no such file or folder"), "{line}");
}

/// The viewer is a separate process, which nothing else would end.
#[test]
fn a_signal_ends_the_viewer_too() {
    let dir = long_folder();
    let d = dir.path();
    // A substitute for the viewer that only prints its process id, beside a copy of the program.
    std::fs::copy(env!("CARGO_BIN_EXE_choreo"), d.join("choreo")).unwrap();
    std::fs::write(
        d.join("choreo-view"),
        "#!/bin/sh\necho $$ > new\nmv new pid\nexec sleep 1000 >/dev/null 2>&1\n",
    )
    .unwrap();
    std::fs::set_permissions(d.join("choreo-view"), PermissionsExt::from_mode(0o755)).unwrap();
    let mut command = Command::new(d.join("choreo"));
    command.args(["view", "long.gltf"]).current_dir(d).env_remove("CARGO");
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("viewer", || d.join("pid").exists());
    signal(&child, "-TERM");
    let run = run_result(child.wait_with_output().unwrap());
    assert_eq!((run.code, run.err.lines().last()), (130, Some("interrupted")), "{}", run.err);
    let viewer = std::fs::read_to_string(d.join("pid")).unwrap();
    let exists = Command::new("kill").args(["-0", viewer.trim()]).stderr(Stdio::null()).status().unwrap();
    assert!(!exists.success(), "the viewer is still there");
}
