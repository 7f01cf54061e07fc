//! Faults of a farm: full disks, files that become visible late, clocks that differ, several workers for one chunk, and workers that are
//! stopped or killed. No finished frame is lost, and the film has the same bytes as from one machine.
#![cfg(unix)]

use crate::common::*;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

/// 60 frames, all different.
const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 2.0 });
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: "#c04020" }))
    .key("position", [[0.0, [-1.5, 0, 0]], [2.0, [1.5, 0, 0]]]);
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

const RENDER: [&str; 9] =
    ["render", "s.rhai", "-o", "film.mp4", "--device", "cpu", "--export", "keyframes=0.8", "--quiet"];

fn scene() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("s.rhai"), SCRIPT).unwrap();
    dir
}

/// The film rendered on one machine.
fn render_on_one_machine(folder: &Path) -> Vec<u8> {
    assert_eq!(choreo(folder, &RENDER).code, 0);
    let bytes = read_file(folder, "film.mp4");
    std::fs::remove_file(folder.join("film.mp4")).unwrap();
    bytes
}

fn worker_args<'a>(frames: &'a str, into: &'a str) -> Vec<&'a str> {
    [&RENDER[..], &["--frames", frames, "--segment", into, "--resume", "--json"]].concat()
}

/// The number of frames that a worker has drawn.
fn drawn_frames(worker: Process) -> u64 {
    let run = worker.wait();
    assert_eq!(run.code, 0, "{}", run.err);
    drawn_in_summary(&run.out)
}

fn start_worker(folder: &Path, frames: &str) -> Process {
    Process::spawn(&mut command(folder, &worker_args(frames, "segments")))
}

fn drawn_in_summary(summary: &str) -> u64 {
    serde_json::from_str::<serde_json::Value>(summary).unwrap()["drawn"].as_u64().unwrap()
}

fn join_segments(folder: &Path, more: &[&str]) -> Vec<u8> {
    let run = choreo(folder, &[&["join", "segments", "-o", "film.mp4", "--quiet"][..], more].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    read_file(folder, "film.mp4")
}

/// Waits until a segment in progress has finished frames: its journal has more than the header.
fn wait_for_frames(folder: &Path, segment: &str) {
    wait_for_other_frames(folder, segment, &[]);
}

/// The number of complete records in a journal. Its header is a line; each record is a length, a CRC-32 and the bytes.
fn finished_frames(journal: &Path) -> usize {
    let bytes = std::fs::read(journal).unwrap_or_default();
    let line = bytes.iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |end| end + 1);
    let (mut rest, mut records) = (&bytes[line..], 0usize);
    while let Some((length, after)) = rest.split_first_chunk::<4>()
        && let Some(next) = after.get(4 + u32::from_le_bytes(*length) as usize..)
    {
        (rest, records) = (next, records + 1);
    }
    records.saturating_sub(1)
}

/// Waits until a part folder other than these has several frames more than they hold, and returns its name.
fn wait_for_other_frames(folder: &Path, segment: &str, known: &[&str]) -> String {
    let segments = folder.join("segments");
    let start = format!("{segment}.segment.");
    let part = || {
        let names = if segments.is_dir() { part_files(&segments) } else { Vec::new() };
        names.into_iter().find(|name| name.starts_with(&start) && !known.contains(&name.as_str()))
    };
    let frames = |part: &str| finished_frames(&segments.join(part).join("journal"));
    let before = known.iter().map(|part| frames(part)).max().unwrap_or(0);
    wait_for("frames", || part().is_some_and(|part| frames(&part) >= before + 3));
    part().unwrap()
}

fn report_of_segment(folder: &Path, segment: &str) -> serde_json::Value {
    let report = read_file(&folder.join("segments"), &format!("{segment}.report"));
    let line = report.split(|byte| *byte == b'\n').next().unwrap();
    serde_json::from_slice(&line[65..]).unwrap()
}

/// SIGTERM, which engines send before they reclaim a machine: the current frame is finished, finished frames are kept, and the next
/// worker renders the rest.
#[test]
fn a_terminated_worker_keeps_its_frames() {
    let dir = scene();
    let d = dir.path();
    let film = render_on_one_machine(d);
    let first = start_worker(d, "0-59");
    wait_for_frames(d, "0000000-0000059");
    first.signal("-TERM");
    let run = first.wait();
    assert_eq!(run.code, 130, "{}", run.err);
    assert!(!d.join("segments/0000000-0000059.segment").exists());
    let state = report_of_segment(d, "0000000-0000059");
    let done = state["done"].as_u64().unwrap();
    assert!(state["state"] == "stopped" && done > 0 && done < 60, "{state}");
    let rest = drawn_frames(start_worker(d, "0-59"));
    assert_eq!(done + rest, 60);
    assert!(join_segments(d, &[]) == film);
    assert_eq!(file_names(&d.join("segments")), ["0000000-0000059.report", "0000000-0000059.segment"]);
}

/// Workers are killed with SIGKILL, and the clocks of the machines differ by decades, so that file times are meaningless.
#[test]
fn a_killed_worker_is_continued_regardless_of_file_times() {
    let dir = scene();
    let d = dir.path();
    let film = render_on_one_machine(d);
    let year = Duration::from_secs(365 * 86_400);
    let times = [SystemTime::UNIX_EPOCH + year, SystemTime::now() + 70 * year];
    assert_eq!(drawn_frames(start_worker(d, "0-23")), 24);
    let first = start_worker(d, "24-59");
    wait_for_frames(d, "0000024-0000059");
    drop(first);
    let mut next = times.into_iter().cycle();
    for path in files_below(&d.join("segments")) {
        std::fs::File::options().write(true).open(path).unwrap().set_modified(next.next().unwrap()).unwrap();
    }
    let status = || choreo(d, &["join", "segments", "-o", "film.mp4"]);
    assert!(status().err.contains("of 60 frames these are missing: 24..=59"));
    let rest = drawn_frames(start_worker(d, "24-59"));
    assert!(rest > 0 && rest < 36, "{rest}");
    assert_eq!(drawn_frames(start_worker(d, "0-23")), 0);
    for path in files_below(&d.join("segments")) {
        std::fs::File::options().write(true).open(path).unwrap().set_modified(next.next().unwrap()).unwrap();
    }
    assert!(join_segments(d, &[]) == film);
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// Three workers for one chunk; the one that draws is killed. One of the others continues with its frames, and the last one finds the
/// segment complete.
#[test]
fn several_workers_of_one_chunk_render_it_once() {
    let dir = scene();
    let d = dir.path();
    let film = render_on_one_machine(d);
    let first = start_worker(d, "0-59");
    wait_for_frames(d, "0000000-0000059");
    // The stopped worker holds the lock of the segment, and no longer draws.
    first.signal("-STOP");
    let others = [start_worker(d, "0-59"), start_worker(d, "0-59")];
    // The other workers have started, and wait.
    std::thread::sleep(Duration::from_millis(300));
    drop(first);
    let mut counts = others.map(drawn_frames);
    counts.sort_unstable();
    assert!(counts[0] == 0 && counts[1] > 0 && counts[1] < 60, "{counts:?}");
    assert!(join_segments(d, &[]) == film);
}

/// A library for `LD_PRELOAD` that simulates file systems without working locks: those on which `flock` fails, and those whose locks do
/// not apply across machines. `None` if it cannot be built.
fn flock_library(folder: &Path) -> Option<PathBuf> {
    let source = r#"#include <errno.h>
#include <stdlib.h>
int flock(int file, int operation) {
    int errors[] = {0, ENOLCK, ENOSYS, EOPNOTSUPP};
    errno = errors[atoi(getenv("FLOCK_ERROR"))];
    return errno ? -1 : 0;
}
"#;
    std::fs::write(folder.join("flock.c"), source).unwrap();
    let library = folder.join("flock.so");
    let mut compiler = Command::new("cc");
    let built = compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(folder.join("flock.c")).status();
    let is_used = cfg!(all(target_os = "linux", target_env = "gnu"));
    (is_used && built.is_ok_and(|status| status.success())).then_some(library)
}

/// Workers of one chunk draw at the same time, each in its own folder, if locks fail or if two machines can hold the same lock. The slower
/// worker finds the segment complete. The next worker copies the frames of a killed one.
#[test]
fn file_systems_without_locks_lose_nothing() {
    let dir = scene();
    let d = dir.path();
    let film = render_on_one_machine(d);
    let Some(library) = flock_library(d) else {
        println!("SKIP 1: no library can be built that refuses locks");
        return;
    };
    const NAMED: &[&str] = &["--uts", "--map-root-user", "sh", "-c", "hostname \"$0\" && exec \"$@\""];
    let may_be_named = Command::new("unshare").args(NAMED).args(["ann", "true"]).status();
    let may_be_named = may_be_named.is_ok_and(|status| status.success());
    // NFS without a lock manager, Lustre without flock, a FUSE file system without locks.
    for error in ["1", "2", "3"] {
        lose_nothing_without_locks(d, &film, |_| {
            let mut worker = command(d, &worker_args("0-59", "segments"));
            worker.env("LD_PRELOAD", &library).env("FLOCK_ERROR", error);
            worker
        });
    }
    if !may_be_named {
        println!("SKIP 1: machines cannot have other names here");
        return;
    }
    // NFS with local locks, most FUSE file systems: each machine has the lock.
    lose_nothing_without_locks(d, &film, |machine| {
        let choreo = command(d, &worker_args("0-59", "segments"));
        let mut worker = Command::new("unshare");
        worker.args(NAMED).arg(machine).arg(choreo.get_program()).args(choreo.get_args());
        worker.current_dir(d).env("CHOREO_PLUGINS", "").stdin(Stdio::null());
        worker.env("LD_PRELOAD", &library).env("FLOCK_ERROR", "0");
        worker
    });
}

/// `worker` starts a worker for the whole film on a machine with this name.
fn lose_nothing_without_locks(d: &Path, film: &[u8], worker: impl Fn(&str) -> Command) {
    const SEGMENT: &str = "0000000-0000059";
    let segments = d.join("segments");
    // A worker is killed; the next one continues with its frames.
    let first = Process::spawn(&mut worker("ann"));
    let part = wait_for_other_frames(d, SEGMENT, &[]);
    drop(first);
    let kept = std::fs::read(segments.join(&part).join("journal")).unwrap();
    // Two workers at once: one is stopped during its work until the other has finished.
    let slow = Process::spawn(&mut worker("ben"));
    let own = wait_for_other_frames(d, SEGMENT, &[&part]);
    slow.signal("-STOP");
    let journal = std::fs::read(segments.join(&own).join("journal")).unwrap();
    assert!(journal.starts_with(&kept) && journal.len() > kept.len());
    let fast = drawn_frames(Process::spawn(&mut worker("cleo")));
    assert!(fast > 0 && fast < 60, "{fast}");
    assert_eq!(file_names(&segments), [format!("{SEGMENT}.report"), format!("{SEGMENT}.segment")]);
    slow.signal("-CONT");
    let run = slow.wait();
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(drawn_in_summary(&run.out), 0, "{}", run.out);
    assert!(join_segments(d, &[]) == film);
    assert_eq!(drawn_frames(Process::spawn(&mut worker("dora"))), 0);
    assert_eq!(file_names(&segments), [format!("{SEGMENT}.report"), format!("{SEGMENT}.segment")]);
    std::fs::remove_dir_all(&segments).unwrap();
}

/// If segments become visible late and in pieces, the join waits as long as `--wait` states, and then names what is missing.
#[test]
fn join_waits_for_segments_that_appear_late() {
    let dir = scene();
    let d = dir.path();
    let film = render_on_one_machine(d);
    for frames in ["0-23", "24-47", "48-59"] {
        drawn_frames(start_worker(d, frames));
    }
    let late: Vec<(PathBuf, Vec<u8>)> = ["0000024-0000047.segment", "0000048-0000059.segment"]
        .map(|name| d.join("segments").join(name))
        .map(|path| (path.clone(), std::fs::read(path).unwrap()))
        .into();
    late.iter().for_each(|(path, _)| std::fs::remove_file(path).unwrap());
    let run = choreo(d, &["join", "segments", "-o", "film.mp4", "--wait", "1"]);
    assert!(run.code == 1 && run.err.contains("these are missing: 24..=59"), "{}", run.err);
    assert!(!d.join("film.mp4").exists());
    let join = ["join", "segments", "-o", "film.mp4", "--wait", "300"];
    let join = Process::spawn(&mut command(d, &join));
    let pause = || std::thread::sleep(Duration::from_millis(700));
    pause();
    std::fs::write(&late[0].0, &late[0].1[..late[0].1.len() / 2]).unwrap();
    pause();
    std::fs::write(&late[1].0, &late[1].1).unwrap();
    pause();
    std::fs::write(&late[0].0, &late[0].1).unwrap();
    let run = join.wait();
    assert!(run.code == 0 && !run.err.contains("warning"), "{}", run.err);
    assert!(read_file(d, "film.mp4") == film);
}

/// If the disk fills up, the exit code is 3 and there is no segment. When there is room again, the render continues with the frames that
/// were written.
#[test]
fn a_full_disk_loses_no_finished_frame() {
    let dir = scene();
    let d = dir.path();
    let unshare = |script: &str, args: &[&str]| {
        let mut command = Command::new("unshare");
        command
            .args(["--mount", "--map-root-user", "sh", "-c", script, env!("CARGO_BIN_EXE_choreo")])
            .args(args);
        command.current_dir(d).env("CHOREO_PLUGINS", "").stdin(Stdio::null()).output()
    };
    if !unshare("mount -t tmpfs -o size=100k none /mnt", &[]).is_ok_and(|run| run.status.success()) {
        println!("SKIP 1: no file system of its own may be mounted here");
        return;
    }
    let film = render_on_one_machine(d);
    std::fs::create_dir_all(d.join("segments")).unwrap();
    std::fs::create_dir_all(d.join("small")).unwrap();
    let script = r#"mount -t tmpfs -o size=150k none small || exit 99
"$0" "$@"; echo "code $?" >&2
ls small >&2
mount -o remount,size=100m small || exit 99
"$0" "$@" || exit 98
cp small/*.segment segments/
"#;
    let run = run_result(unshare(script, &worker_args("0-59", "small")).unwrap());
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(run.err.contains("cannot write: the disk is full"), "{}", run.err);
    assert!(run.err.contains("\ncode 3\n"), "{}", run.err);
    assert!(!run.err.contains("\n0000000-0000059.segment\n"), "{}", run.err);
    let last = run.out.rfind("\n{").map_or(0, |at| at + 1);
    let rest = drawn_in_summary(&run.out[last..]);
    assert!(rest > 0 && rest < 60, "{rest} {}", run.err);
    assert!(join_segments(d, &[]) == film);
}
