//! Outputs are written completely or not at all: full disks, folders that disappear, files that must not be written, links, and two
//! simultaneous renders.
#![cfg(unix)]

mod common;

use common::*;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};

const SMALL_RENDER: &[&str] = &["--device", "cpu", "--size", "160x90", "--samples", "1", "--quiet"];

fn render<'a>(input: &'a str, output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", input, "-o", output], SMALL_RENDER, more].concat()
}

/// A folder with a model whose clip takes ten minutes.
fn long_folder() -> tempfile::TempDir {
    let folder = folder_with_triangle();
    std::fs::write(folder.path().join("long.gltf"), triangle(600.0)).unwrap();
    folder
}

/// Limits the size of files to this number of blocks of 512 bytes; further writes fail as on a full disk.
fn with_file_limit(folder: &Path, blocks: usize, args: &[&str]) -> Run {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.current_dir(folder).args(["-c", &script, "sh", env!("CARGO_BIN_EXE_choreo")]).args(args);
    run_result(command.stdin(Stdio::null()).output().unwrap())
}

/// An existing file is not changed, finished frames are kept, and the render can be resumed.
#[test]
fn a_full_disk_keeps_the_old_file_and_finished_frames() {
    for (output, blocks) in [("o.y4m", 300), ("o.gif", 20), ("o.mp4", 60)] {
        let dir = folder_with_triangle();
        let d = dir.path();
        std::fs::write(d.join(output), "old").unwrap();
        let frames = &["--frames", "0..24"];
        let run = with_file_limit(d, blocks, &render("tri.gltf", output, frames));
        assert_eq!(run.code, 3, "{output}: {}", run.err);
        assert!(run.err.contains(&format!("{output}: cannot write: File too large")), "{}", run.err);
        assert_eq!(read_file(d, output), b"old");
        assert!(d.join(format!("{output}.part")).is_dir(), "{output}: the finished frames are kept");
        let loud: Vec<&str> = render("tri.gltf", output, &["--resume", "--frames", "0..24"])
            .into_iter()
            .filter(|a| *a != "--quiet")
            .collect();
        let run = choreo(d, &loud);
        assert!(run.code == 0 && run.err.contains("of them finished before"), "{}", run.err);
        let resumed = read_file(d, output);
        let whole = format!("whole{}", &output[1..]);
        assert_eq!(choreo(d, &render("tri.gltf", &whole, frames)).code, 0);
        assert!(resumed == read_file(d, &whole), "{output}");
        assert_eq!(part_files(d), Vec::<String>::new());
    }
}

#[test]
fn an_image_that_does_not_fit_keeps_the_old_file() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("o.png"), "old").unwrap();
    for output in ["o.png", "f/%d.png"] {
        let run = with_file_limit(d, 0, &render("tri.gltf", output, &["--frames", "3"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert!(run.err.contains(".png: cannot write: File too large"), "{}", run.err);
    }
    assert_eq!(read_file(d, "o.png"), b"old");
    assert_eq!(file_names(d), ["o.png", "tri.gltf"]);
}

/// Uses a separate file system, if the test is allowed to mount one.
#[test]
fn a_write_that_fills_the_disk_reports_a_full_disk() {
    let dir = folder_with_triangle();
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
    let kept = (read_file(d, "small/o.y4m"), d.join("small/o.y4m.part").exists());
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
        let run = run_result(child.wait_with_output().unwrap());
        assert_eq!(run.code, 3, "{}", run.err);
        let line = run.err.lines().last().unwrap_or_default();
        assert_eq!(line, format!("{output}: cannot write: no such file or folder"));
    }
}

#[test]
fn read_only_files_and_folders_are_not_written() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for output in ["o.mp4", "o.png", "o.gif", "o.y4m"] {
        std::fs::write(d.join(output), "old").unwrap();
        std::fs::set_permissions(d.join(output), PermissionsExt::from_mode(0o444)).unwrap();
        let run = choreo(d, &render("tri.gltf", output, &["--frames", "0"]));
        assert_eq!(run.code, 3, "{}", run.err);
        assert_eq!(run.err, format!("{output}: cannot write: the file there is read-only\n"));
        assert_eq!(read_file(d, output), b"old");
        // There is something else under the name of the part.
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

/// A scene with an image, a module, a plugin and a test in the folder `scene`, and beside it a file and a folder that must not change.
fn scene_with_guarded_files() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("scene");
    std::fs::create_dir_all(scene.join("suite")).unwrap();
    std::fs::create_dir(dir.path().join("far")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("bashrc", "alias ls='ls -l'\n");
    write("scene/tri.gltf", &triangle(1.0));
    write(
        "scene/suite/box.rhai",
        "test(\"seen\", || { cast(\"b\", shape(\"box\")); camera(\"c\").frame(); expect_image(\"box\", #{ at: 0.0, size: [32, 18] }); });\n",
    );
    dir
}

/// Tests a symbolic link under every name that a command writes to. Each case has the link, whether its target is a folder, and the
/// command.
#[test]
fn symbolic_links_at_outputs_are_refused_and_named() {
    let render = |output: &'static str| {
        vec!["render", "tri.gltf", "-o", output, "--frames", "0..2", "--device", "cpu", "--size", "32x18"]
    };
    let video = |output: &'static str, file: &str| (format!("{output}.part/{file}"), false, render(output));
    let stages = vec!["render", "tri.gltf", "--stages", "-o", "s", "--size", "32x18"];
    let test = |option: &'static str| vec!["test", "suite", "--accept", option];
    let mut cases: Vec<(String, bool, Vec<&str>)> = ["body", "journal", "frames", "result"]
        .into_iter()
        .flat_map(|file| [video("o.y4m", file), video("o.mp4", file), video("o.gif", file)])
        .collect();
    cases.extend([
        ("o.y4m".into(), false, render("o.y4m")),
        ("o.mp4.part".into(), true, render("o.mp4")),
        ("o.mp4.part".into(), false, render("o.mp4")),
        ("o.png".into(), false, render("o.png")),
        ("o.png.part".into(), false, render("o.png")),
        ("f/0000.png".into(), false, render("f/%04d.png")),
        ("f/0001.png.part".into(), false, render("f/%04d.png")),
        ("f/%04d.png.0-1.part".into(), false, render("f/%04d.png")),
        ("f/%04d.png.1-5.part".into(), false, render("f/%04d.png")),
        ("s/1_model.png".into(), false, stages.clone()),
        ("s/6_shade.png.part".into(), false, stages),
        ("p.svg".into(), false, vec!["check", "tri.gltf", "--plot", "p.svg"]),
        ("p.svg".into(), false, vec!["explain", "tri.gltf", "--plot", "p.svg"]),
        ("p.svg".into(), false, vec!["measure", "tri.gltf", "--only", "bake", "--plot", "p.svg"]),
        ("m.obj".into(), false, vec!["pose", "tri.gltf", "--mesh", "m.obj"]),
        ("m.obj.part".into(), false, vec!["pose", "tri.gltf", "--mesh", "m.obj"]),
        ("new/it.wgsl".into(), false, vec!["new", "effect", "it", "--single", "--into", "new"]),
        ("new/sample.it".into(), false, vec!["new", "importer", "it", "--single", "--into", "new"]),
        (
            "new/effect-it".into(),
            true,
            vec![
                "new",
                "effect",
                "it",
                "--into",
                "new",
                "--sources",
                concat!(env!("CARGO_MANIFEST_DIR"), "/../.."),
            ],
        ),
        ("report.html".into(), false, test("--html=report.html")),
        ("report.xml".into(), false, test("--junit=report.xml")),
        ("suite/pictures".into(), true, test("--quiet")),
        ("suite/pictures/box".into(), true, test("--quiet")),
        ("suite/pictures/box/box.png".into(), false, test("--quiet")),
        ("target/choreo-test".into(), true, test("--quiet")),
        ("target/choreo-test/pictures".into(), true, test("--quiet")),
    ]);
    for (link, is_folder, args) in &cases {
        let dir = scene_with_guarded_files();
        let d = dir.path().join("scene");
        let target = dir.path().join(if *is_folder { "far" } else { "bashrc" });
        std::fs::create_dir_all(d.join(link).parent().unwrap()).unwrap();
        symlink(&target, d.join(link)).unwrap();
        let run = choreo(&d, args);
        let (output, all) = (run.err.clone() + &run.out, format!("{link} {args:?}: {}{}", run.err, run.out));
        // A section whose image cannot be accepted fails.
        let expected = if link.starts_with("suite/") { 1 } else { 3 };
        assert_eq!(run.code, expected, "{all}");
        let words = format!("cannot write: {link} is a symbolic link to {}; remove it", target.display());
        assert!(output.contains(&words), "{all}");
        assert!(std::fs::symlink_metadata(d.join(link)).unwrap().is_symlink(), "{all}");
        assert_eq!(read_file(dir.path(), "bashrc"), b"alias ls='ls -l'\n", "{all}");
        assert_eq!(file_names(&dir.path().join("far")), Vec::<String>::new(), "{all}");
    }
}

/// A render is not resumed if its files are symbolic links or have additional hard links.
#[test]
fn part_files_that_are_links_are_not_resumed() {
    for file in ["body", "journal", "frames"] {
        for is_hard in [false, true] {
            let dir = scene_with_guarded_files();
            let d = dir.path().join("scene");
            let run = with_file_limit(&d, 60, &render("tri.gltf", "o.mp4", &["--frames", "0..24"]));
            assert!(run.code == 3 && d.join("o.mp4.part").is_dir(), "{}", run.err);
            let (place, second) = (d.join("o.mp4.part").join(file), dir.path().join("far/second"));
            std::fs::rename(&place, &second).unwrap();
            match is_hard {
                true => std::fs::hard_link(&second, &place).unwrap(),
                false => symlink(&second, &place).unwrap(),
            }
            let before = std::fs::read(&second).unwrap();
            let run = choreo(&d, &render("tri.gltf", "o.mp4", &["--resume", "--frames", "0..24"]));
            let what = if is_hard { "a hard link" } else { "a symbolic link" };
            let words = format!("o.mp4: cannot write: o.mp4.part/{file} is {what} to ");
            assert!(run.code == 3 && run.err.contains(&words), "{file}: {}", run.err);
            assert!(std::fs::read(&second).unwrap() == before, "{file} was written");
        }
    }
}

/// If the part of a killed render is a hard link, it is replaced, so that the file under its other name is not changed.
#[test]
fn a_hard_link_in_the_place_of_a_part_is_replaced() {
    for (part, output) in
        [("o.png.part", "o.png"), ("o.y4m.part/body", "o.y4m"), ("o.y4m.part/journal", "o.y4m")]
    {
        let dir = scene_with_guarded_files();
        let d = dir.path().join("scene");
        std::fs::create_dir_all(d.join(part).parent().unwrap()).unwrap();
        std::fs::hard_link(dir.path().join("bashrc"), d.join(part)).unwrap();
        let run = choreo(&d, &render("tri.gltf", output, &["--frames", "0"]));
        assert_eq!(run.code, 0, "{part}: {}", run.err);
        assert_eq!(read_file(dir.path(), "bashrc"), b"alias ls='ls -l'\n", "{part}");
        assert!(read_file(&d, output).len() > 100 && part_files(&d).is_empty());
    }
}

/// Links that the system provides for streams are not refused. This does not use `/dev/stdout`, because a fault would replace it for the
/// whole machine if root runs the tests; a unit test of choreo-files examines it without writing.
#[test]
fn streams_of_the_program_can_be_written() {
    let dir = scene_with_guarded_files();
    let d = dir.path().join("scene");
    for place in ["/proc/self/fd/1", "/dev/fd/1"] {
        let run = choreo(&d, &["test", "suite", "--accept", "--quiet", &format!("--html={place}")]);
        assert!(run.code == 0 && run.out.contains("</html>"), "{place}: {}{}", run.out, run.err);
    }
}

/// A pipe as an output gets the bytes of the file. If the pipe has no reader, this is an error.
#[test]
fn pipes_are_written_only_if_they_have_a_reader() {
    let dir = scene_with_guarded_files();
    let d = &dir.path().join("scene");
    let cases: [(&str, Vec<&str>); 5] = [
        ("o.y4m", render("tri.gltf", "o.y4m", &["--frames", "0..3"])),
        ("o.mp4", render("tri.gltf", "o.mp4", &["--frames", "0..3"])),
        ("o.png", render("tri.gltf", "o.png", &["--frames", "0"])),
        ("p.svg", vec!["check", "tri.gltf", "--plot", "p.svg"]),
        ("m.obj", vec!["pose", "tri.gltf", "--mesh", "m.obj"]),
    ];
    for (name, args) in cases {
        assert_eq!(choreo(d, &args).code, 0);
        let expected = read_file(d, name);
        std::fs::remove_file(d.join(name)).unwrap();
        assert!(Command::new("mkfifo").arg(d.join(name)).status().unwrap().success());
        // `timeout` ends a command that blocks, with exit code 124.
        let mut command = Command::new("timeout");
        command.args(["60", env!("CARGO_BIN_EXE_choreo")]).args(&args).current_dir(d).stdin(Stdio::null());
        let run = run_result(command.output().unwrap());
        let words = format!("{name}: cannot write: nobody reads from this pipe; start its reader first\n");
        assert!(run.code == 3 && run.err.ends_with(&words), "{name}: {} {}", run.code, run.err);
        let reader =
            Command::new("timeout").args(["60", "cat", name]).current_dir(d).stdout(Stdio::piped()).spawn();
        let run = choreo(d, &args);
        assert_eq!(run.code, 0, "{name}: {}", run.err);
        let read = reader.unwrap().wait_with_output().unwrap();
        assert!(read.status.success() && read.stdout == expected, "{name}: {} bytes", read.stdout.len());
        assert_eq!(part_files(d), Vec::<String>::new());
    }
}

/// Tests a folder beside the script that is a link to another folder. Links in a path that the user gives are followed.
#[test]
fn a_linked_folder_beside_the_script_is_not_written_through() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, far) = (dir.path().join("scene"), dir.path().join("far"));
    std::fs::create_dir_all(scene.join("inner")).unwrap();
    std::fs::create_dir_all(&far).unwrap();
    std::fs::copy(folder_with_triangle().path().join("tri.gltf"), scene.join("tri.gltf")).unwrap();
    std::os::unix::fs::symlink("../far", scene.join("frames")).unwrap();
    std::os::unix::fs::symlink("inner", scene.join("within")).unwrap();
    for output in ["frames/%04d.png", "frames/new/o.y4m", "./frames/o.mp4", "inner/../frames/o.png"] {
        let run = choreo(&scene, &render("tri.gltf", output, &["--frames", "0"]));
        let words = "frames is a symbolic link that leads out of the scene's folder; remove it, or name the folder it leads to\n";
        assert!(run.code == 3 && run.err.ends_with(words), "{output}: {} {}", run.code, run.err);
        assert_eq!(std::fs::read_dir(&far).unwrap().count(), 0, "{output}");
    }
    for output in ["within/o.png", "../scene/inner/p.png", "../far/o.png"] {
        let run = choreo(&scene, &render("tri.gltf", output, &["--frames", "0"]));
        assert_eq!(run.code, 0, "{output}: {}", run.err);
    }
}

/// Tests each kind of input file of a scene, each kind of output, and each way to name the file.
#[test]
fn an_output_in_the_place_of_an_input_is_refused() {
    let dir = scene_with_guarded_files();
    let d = &dir.path().join("scene");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::create_dir_all(d.join(name).parent().unwrap()).unwrap();
        std::fs::write(d.join(name), bytes).unwrap();
    };
    assert_eq!(choreo(d, &render("tri.gltf", "t.png", &["--frames", "0"])).code, 0);
    let picture = read_file(d, "t.png");
    for name in ["n/2.png", "s/3_clip.png"] {
        write(name, &picture);
    }
    write("mod.rhai", b"fn one() { 1.0 }");
    assert_eq!(choreo(d, &["new", "effect", "mine", "--single"]).code, 0);
    assert_eq!(choreo(d, &["pose", "tri.gltf", "--mesh", "model.obj"]).code, 0);
    write(
        "s.rhai",
        b"import \"mod\" as m;\nstage(#{ fps: 4, length: m::one() });\ncast(\"t\", load(param(\"model\", \"tri.gltf\")));\n\
          cast(\"p\", shape(\"plane\", #{ image: image(\"t.png\") }));\ncast(\"q\", shape(\"plane\", #{ image: image(\"n/2.png\") }));\n\
          cast(\"r\", shape(\"plane\", #{ image: image(\"s/3_clip.png\") }));\ncamera(\"c\").at(0.0, 1.0, 4.0);\neffect(\"mine\");\n",
    );
    for (input, second) in [
        ("s.rhai", "script.svg"),
        ("mod.rhai", "module.svg"),
        ("tri.gltf", "model.png"),
        ("mine.wgsl", "plugin.gif"),
        ("t.png", "texture.mp4"),
        ("model.obj", "set.y4m"),
        ("suite/box.rhai", "test.html"),
    ] {
        std::fs::hard_link(d.join(input), d.join(second)).unwrap();
    }
    let draw = |output: &'static str, more: &[&'static str]| render("s.rhai", output, more);
    let cases: Vec<(&str, &str, Vec<&str>)> = vec![
        ("t.png", "t.png", draw("t.png", &["--at", "0"])),
        ("./t.png", "t.png", draw("./t.png", &["--at", "0"])),
        ("n/2.png", "n/2.png", draw("n/%d.png", &[])),
        ("s/3_clip.png", "s/3_clip.png", draw("s", &["--stages"])),
        ("model.png", "tri.gltf", draw("model.png", &["--at", "0"])),
        ("plugin.gif", "mine.wgsl", draw("plugin.gif", &[])),
        ("texture.mp4", "t.png", draw("texture.mp4", &["--resume"])),
        ("set.y4m", "model.obj", draw("set.y4m", &["--set", "model=model.obj"])),
        ("script.svg", "s.rhai", vec!["check", "s.rhai", "--plot", "script.svg"]),
        ("module.svg", "mod.rhai", vec!["explain", "s.rhai", "--plot", "module.svg"]),
        ("module.svg", "mod.rhai", vec!["measure", "s.rhai", "--only", "bake", "--plot", "module.svg"]),
        ("model.obj", "model.obj", vec!["pose", "model.obj", "--mesh", "model.obj"]),
        ("test.html", "suite/box.rhai", vec!["test", "suite", "--html", "test.html"]),
        ("suite/box.rhai", "suite/box.rhai", vec!["test", "suite", "--junit", "suite/box.rhai"]),
    ];
    for (output, input, args) in cases {
        let before = read_file(d, input);
        let run = choreo(d, &args);
        let words =
            format!("{output}: cannot write: it is the input {input}; give the output another name\n");
        assert!(run.code == 3 && run.err.ends_with(&words), "{args:?}: {} {}", run.code, run.err);
        assert!(read_file(d, input) == before && read_file(d, output) == before, "{args:?}: written");
    }
    assert_eq!(file_names(&d.join("n")), ["2.png"]);
    // This includes the name of the part.
    std::fs::rename(d.join("t.png"), d.join("x.png.part")).unwrap();
    let script = std::fs::read_to_string(d.join("s.rhai")).unwrap().replace("\"t.png\"", "\"x.png.part\"");
    write("s.rhai", script.as_bytes());
    let run = choreo(d, &draw("x.png", &["--at", "0"]));
    let words = "x.png: cannot write: x.png.part is the input x.png.part; give the output another name\n";
    assert!(run.code == 3 && run.err.ends_with(words), "{}", run.err);
    // Outputs with other names are written.
    assert_eq!(choreo(d, &draw("y.png", &["--at", "0"])).code, 0);
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
        // The first render continues, and after it was killed it does not block another one.
        assert!(begun());
        let killed = Command::new("kill").args(["-KILL", &first.id().to_string()]).status().unwrap();
        assert!(killed.success());
        run_result(first.wait_with_output().unwrap());
        let run = choreo(d, &render("long.gltf", output, &["--frames", overlap]));
        assert_eq!(run.code, 0, "{}", run.err);
        let left = if output.contains('/') { part_files(&d.join("f")) } else { part_files(d) };
        // A part of the image that the first render was writing may remain, with its number.
        assert!(left.iter().all(|n| n.ends_with(".png.part")), "{left:?}");
    }
}

/// Two processes at the same time each render half of the frames of a video.
#[test]
fn two_processes_can_share_numbered_images() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let start = |frames: &'static str| {
        command(d, &render("tri.gltf", "f/%03d.png", &["--frames", frames]))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    };
    for child in [start("0..15"), start("15..30")] {
        let run = run_result(child.wait_with_output().unwrap());
        assert_eq!(run.code, 0, "{}", run.err);
    }
    assert_eq!(file_names(&d.join("f")).len(), 30);
    assert_eq!(choreo(d, &render("tri.gltf", "w/%03d.png", &[])).code, 0);
    for name in file_names(&d.join("w")) {
        assert!(read_file(&d.join("f"), &name) == read_file(&d.join("w"), &name), "{name}");
    }
}

#[test]
fn an_image_that_another_process_writes_is_not_overwritten() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let held = std::fs::File::create(d.join("o.png.part")).unwrap();
    held.lock().unwrap();
    let run = choreo(d, &render("tri.gltf", "o.png", &["--frames", "0"]));
    assert_eq!((run.code, run.err.contains("another choreo is rendering to it")), (3, true), "{}", run.err);
    drop(held);
    assert_eq!(choreo(d, &render("tri.gltf", "o.png", &["--frames", "0"])).code, 0);
    assert_eq!(file_names(d), ["o.png", "tri.gltf"]);
}
