//! Outputs appear whole or not at all: full disks, folders that vanish, files that must not be written, links, and two renders at once.
#![cfg(unix)]

mod common;

use common::*;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SMALL: &[&str] = &["--device", "cpu", "--size", "160x90", "--samples", "1", "--quiet"];

fn render<'a>(input: &'a str, output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", input, "-o", output], SMALL, more].concat()
}

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let start = Instant::now();
    while !there() {
        assert!(start.elapsed() < Duration::from_secs(600), "no {what} after ten minutes");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// A folder with a model whose clip takes ten minutes.
fn long_folder() -> tempfile::TempDir {
    let folder = folder();
    std::fs::write(folder.path().join("long.gltf"), triangle(600.0)).unwrap();
    folder
}

/// Files may have so many blocks of 512 bytes; further writing fails as on a full disk.
fn with_file_limit(folder: &Path, blocks: usize, args: &[&str]) -> Run {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.current_dir(folder).args(["-c", &script, "sh", env!("CARGO_BIN_EXE_choreo")]).args(args);
    finished(command.stdin(Stdio::null()).output().unwrap())
}

/// What was there before stays, what was finished is kept and gone on with.
#[test]
fn a_disk_that_fills_up_loses_nothing() {
    for (output, blocks) in [("o.y4m", 300), ("o.gif", 20), ("o.mp4", 60)] {
        let dir = folder();
        let d = dir.path();
        std::fs::write(d.join(output), "old").unwrap();
        let frames = &["--frames", "0..24"];
        let run = with_file_limit(d, blocks, &render("tri.gltf", output, frames));
        assert_eq!(run.code, 3, "{output}: {}", run.err);
        assert!(run.err.contains(&format!("{output}: cannot write: File too large")), "{}", run.err);
        assert_eq!(read(d, output), b"old");
        assert!(d.join(format!("{output}.part")).is_dir(), "{output}: the finished frames are kept");
        let loud: Vec<&str> = render("tri.gltf", output, &["--resume", "--frames", "0..24"])
            .into_iter()
            .filter(|a| *a != "--quiet")
            .collect();
        let run = choreo(d, &loud);
        assert!(run.code == 0 && run.err.contains("of them there before"), "{}", run.err);
        let resumed = read(d, output);
        let whole = format!("whole{}", &output[1..]);
        assert_eq!(choreo(d, &render("tri.gltf", &whole, frames)).code, 0);
        assert!(resumed == read(d, &whole), "{output}");
        assert_eq!(parts(d), Vec::<String>::new());
    }
}

#[test]
fn a_picture_that_does_not_fit_leaves_the_old_one() {
    let dir = folder();
    let d = dir.path();
    std::fs::write(d.join("o.png"), "old").unwrap();
    for output in ["o.png", "f/%d.png"] {
        let run = with_file_limit(d, 0, &render("tri.gltf", output, &["--frames", "3"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.contains(".png: cannot write: File too large"), "{}", run.err);
    }
    assert_eq!(read(d, "o.png"), b"old");
    assert_eq!(names(d), ["o.png", "tri.gltf"]);
}

/// A file system of its own, where the test may make one.
#[test]
fn a_small_disk_is_named_full() {
    let dir = folder();
    let d = dir.path();
    std::fs::create_dir(d.join("small")).unwrap();
    let mut mount = Command::new("mount");
    mount.args(["-t", "tmpfs", "-o", "size=300k", "tmpfs"]).arg(d.join("small")).stderr(Stdio::null());
    let mounted = mount.status().is_ok_and(|s| s.success());
    if !mounted {
        println!("SKIP 1: a file system cannot be mounted here");
        return;
    }
    std::fs::write(d.join("small/o.y4m"), "old").unwrap();
    let run = choreo(d, &render("tri.gltf", "small/o.y4m", &[]));
    let kept = (read(d, "small/o.y4m"), d.join("small/o.y4m.part").exists());
    let pictures = choreo(d, &render("tri.gltf", "small/f/%d.png", &[]));
    let unmounted = Command::new("umount").arg(d.join("small")).status();
    assert!(unmounted.is_ok_and(|s| s.success()));
    assert_eq!(run.code, 3, "{}", run.err);
    assert!(run.err.contains("small/o.y4m: cannot write: the disk is full"), "{}", run.err);
    assert_eq!(kept, (b"old".to_vec(), true));
    assert_eq!(pictures.code, 3, "{}", pictures.err);
}

#[test]
fn a_video_whose_folder_vanishes_ends_at_once() {
    for output in ["v/o.mp4", "v/o.y4m", "v/o.gif"] {
        let dir = long_folder();
        let d = dir.path();
        std::fs::create_dir(d.join("v")).unwrap();
        let child = command(d, &render("long.gltf", output, &[])).stderr(Stdio::piped()).spawn().unwrap();
        wait_for("journal", || {
            std::fs::metadata(d.join(format!("{output}.part/journal"))).is_ok_and(|m| m.len() > 600)
        });
        std::fs::rename(d.join("v"), d.join("gone")).unwrap();
        let run = finished(child.wait_with_output().unwrap());
        assert_eq!(run.code, 3, "{}", run.err);
        let line = run.err.lines().last().unwrap_or_default();
        assert_eq!(line, format!("{output}: cannot write: no such file or folder"));
    }
}

#[test]
fn what_must_not_be_written_is_not() {
    let dir = folder();
    let d = dir.path();
    for output in ["o.mp4", "o.png", "o.gif", "o.y4m"] {
        std::fs::write(d.join(output), "old").unwrap();
        std::fs::set_permissions(d.join(output), PermissionsExt::from_mode(0o444)).unwrap();
        let run = choreo(d, &render("tri.gltf", output, &["--frames", "0"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert_eq!(run.err, format!("{output}: cannot write: the file there is read-only\n"));
        assert_eq!(read(d, output), b"old");
        // In the way of the part.
        let blocked = format!("b{output}");
        match output {
            "o.png" => std::fs::create_dir(d.join("bo.png.part")).unwrap(),
            _ => std::fs::write(d.join(format!("{blocked}.part")), "mine").unwrap(),
        }
        let run = choreo(d, &render("tri.gltf", &blocked, &["--frames", "0"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.starts_with(&format!("{blocked}: cannot write: ")), "{}", run.err);
        assert!(!d.join(&blocked).exists() && d.join(format!("{blocked}.part")).exists());
    }
    std::fs::create_dir(d.join("shut")).unwrap();
    std::fs::set_permissions(d.join("shut"), PermissionsExt::from_mode(0o555)).unwrap();
    if std::fs::write(d.join("shut/probe"), "").is_ok() {
        println!("SKIP 2: this user may write into read-only folders");
        return;
    }
    for output in ["shut/o.mp4", "shut/%d.png"] {
        let run = choreo(d, &render("tri.gltf", output, &["--frames", "0..2"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.contains("permission denied"), "{}", run.err);
    }
}

#[test]
fn links_stay_and_what_they_name_is_replaced() {
    let dir = folder();
    let d = dir.path();
    std::fs::create_dir(d.join("far")).unwrap();
    for format in ["mp4", "png"] {
        let link = |name: &str| format!("{name}.{format}");
        std::fs::write(d.join("far").join(link("there")), "old").unwrap();
        for name in ["there", "new"] {
            symlink(Path::new("far").join(link(name)), d.join(link(name))).unwrap();
            let run = choreo(d, &render("tri.gltf", &link(name), &["--frames", "0"]));
            assert_eq!(run.code, 0, "{}", run.err);
            assert!(std::fs::symlink_metadata(d.join(link(name))).unwrap().is_symlink());
            assert!(read(d, &format!("far/{}", link(name))).len() > 100);
        }
        symlink(link("loop"), d.join(link("loop"))).unwrap();
        let run = choreo(d, &render("tri.gltf", &link("loop"), &["--frames", "0"]));
        // A circle names nothing; it is replaced as any name, or refused by the system.
        assert!([0, 3].contains(&run.code), "{}", run.err);
    }
    assert_eq!(parts(d), Vec::<String>::new());
    assert_eq!(parts(&d.join("far")), Vec::<String>::new());
}

#[test]
fn the_second_of_two_renders_to_one_output_is_refused() {
    for (output, overlap) in [("o.mp4", "0..3"), ("o.y4m", "0..3"), ("f/%05d.png", "5..9")] {
        let dir = long_folder();
        let d = dir.path();
        let first = command(d, &render("long.gltf", output, &[])).stderr(Stdio::piped()).spawn().unwrap();
        let begun = || match output.split_once('/') {
            Some((inner, _)) => d.join(inner).join("00000.png").exists(),
            None => std::fs::metadata(d.join(format!("{output}.part/journal"))).is_ok_and(|m| m.len() > 600),
        };
        wait_for("first frame", begun);
        for more in [&["--frames", overlap][..], &["--frames", overlap, "--resume"]] {
            let run = choreo(d, &render("long.gltf", output, more));
            assert_eq!(run.code, 3, "{}", run.err);
            let expected = format!(
                "{output}: cannot write: another choreo is rendering to it; wait until it is done, or give -o another name\n"
            );
            assert_eq!(run.err, expected);
        }
        // The first goes on undisturbed, and once it is dead it is in nobody's way.
        assert!(begun());
        let killed = Command::new("kill").args(["-KILL", &first.id().to_string()]).status().unwrap();
        assert!(killed.success());
        finished(first.wait_with_output().unwrap());
        let run = choreo(d, &render("long.gltf", output, &["--frames", overlap]));
        assert_eq!(run.code, 0, "{}", run.err);
        let left = if output.contains('/') { parts(&d.join("f")) } else { parts(d) };
        // A picture that the first was writing may still lie there, under its number.
        assert!(left.iter().all(|n| n.ends_with(".png.part")), "{left:?}");
    }
}

/// The halves of a video by two processes at once.
#[test]
fn numbered_pictures_can_be_shared_out() {
    let dir = folder();
    let d = dir.path();
    let start = |frames: &'static str| {
        command(d, &render("tri.gltf", "f/%03d.png", &["--frames", frames]))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    };
    for child in [start("0..15"), start("15..30")] {
        let run = finished(child.wait_with_output().unwrap());
        assert_eq!(run.code, 0, "{}", run.err);
    }
    assert_eq!(names(&d.join("f")).len(), 30);
    assert_eq!(choreo(d, &render("tri.gltf", "w/%03d.png", &[])).code, 0);
    for name in names(&d.join("w")) {
        assert!(read(&d.join("f"), &name) == read(&d.join("w"), &name), "{name}");
    }
}

#[test]
fn a_picture_that_somebody_writes_is_left_to_him() {
    let dir = folder();
    let d = dir.path();
    let held = std::fs::File::create(d.join("o.png.part")).unwrap();
    held.lock().unwrap();
    let run = choreo(d, &render("tri.gltf", "o.png", &["--frames", "0"]));
    assert_eq!((run.code, run.err.contains("another choreo is rendering to it")), (3, true), "{}", run.err);
    drop(held);
    assert_eq!(choreo(d, &render("tri.gltf", "o.png", &["--frames", "0"])).code, 0);
    assert_eq!(names(d), ["o.png", "tri.gltf"]);
}
