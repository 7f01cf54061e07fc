//! Messages about invalid input: exact texts, exit codes, and no file left behind.

mod common;

use common::*;
use std::path::Path;

/// Exit code and first line on standard error of a command that must fail without creating a file.
fn failed_run(folder: &Path, args: &[&str]) -> (i32, String) {
    let before = file_names(folder);
    let run = choreo(folder, args);
    assert_eq!(file_names(folder), before, "{args:?} left something behind");
    assert_eq!(run.out, "", "{args:?}");
    (run.code, run.err.lines().next().unwrap_or_default().to_string())
}

#[test]
fn missing_and_unreadable_inputs_are_errors_that_name_the_file() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::create_dir(d.join("models")).unwrap();
    std::fs::write(d.join("models/Fox.glb"), "x").unwrap();
    std::fs::write(d.join("noise.glb"), (0..999u32).map(|i| ((i * i) >> 3) as u8).collect::<Vec<_>>())
        .unwrap();
    std::fs::write(d.join("notes.txt"), "hello").unwrap();
    std::fs::write(d.join("empty.gltf"), "").unwrap();
    for (input, expected) in [
        ("trj.gltf", "trj.gltf: no such file; did you mean \"tri.gltf\"?"),
        ("trj.rhai", "trj.rhai: no such file"),
        ("no/such.glb", "no/such.glb: no such file; the folder no does not exist"),
        ("models", "models: cannot read: it is a folder, not a file; it holds Fox.glb"),
        ("notes.txt", "notes.txt: no importer knows this kind of file"),
    ] {
        for command in ["render", "check", "info", "explain", "pose"] {
            let mut args = vec![command, input];
            if command == "render" {
                args.extend(["-o", "out.mp4"]);
            }
            assert_eq!(failed_run(d, &args), (1, expected.to_string()), "{command}");
        }
    }
    for input in ["noise.glb", "models/Fox.glb", "empty.gltf"] {
        let (code, line) = failed_run(d, &["info", input]);
        assert_eq!(code, 1);
        assert!(line.starts_with(&format!("{input}: ")), "{line}");
    }
}

/// Models that are cut or have a flipped bit, at many places, give an error or a result, but no panic and no hang.
#[test]
fn truncated_and_bit_flipped_models_never_panic() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let whole = triangle(1.0).into_bytes();
    for (i, cut) in (0..whole.len()).step_by(97).enumerate() {
        std::fs::write(d.join("cut.gltf"), &whole[..cut]).unwrap();
        let run = choreo(d, &["pose", "cut.gltf", "--at", "0.5"]);
        assert_eq!(run.code, 1, "cut at {cut} was accepted");
        let mut damaged = whole.clone();
        damaged[cut] ^= 1 << (i % 7);
        std::fs::write(d.join("bent.gltf"), &damaged).unwrap();
        let run = choreo(d, &["pose", "bent.gltf", "--at", "0.5"]);
        assert!([0, 1].contains(&run.code), "{}", run.err);
    }
}

#[test]
fn an_unknown_clip_is_an_error_with_the_closest_name() {
    let dir = folder_with_triangle();
    let (code, line) = failed_run(dir.path(), &["render", "tri.gltf", "--clip", "Slde", "-o", "o.mp4"]);
    assert_eq!((code, line.as_str()), (1, "tri.gltf: unknown clip \"Slde\"; did you mean \"Slide\"?"));
}

#[test]
fn invalid_options_are_errors_that_state_the_allowed_values() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::create_dir(d.join("frames")).unwrap();
    std::fs::write(d.join("s.rhai"), "stage(#{ length: 1.0 });").unwrap();
    let registry = choreo::registry();
    let known = registry.exporters().iter().flat_map(|e| e.manifest().extensions.iter());
    let known = known.map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ");
    assert!(known.starts_with(".png, .mp4, .m4v, "), "{known}");
    let unknown = format!("-o o.mp5: the file extension selects the format; known: {known}");
    for (args, expected) in [
        (&["render", "tri.gltf", "-o", "o.mp5"][..], unknown.as_str()),
        (
            &["render", "tri.gltf", "-o", "frames"],
            "frames is a folder; for numbered images type -o frames/%04d.png",
        ),
        (
            &["render", "tri.gltf", "-o", "frames/"],
            "-o \"frames/\" names no file; write out.mp4, out.png or frames/%04d.png",
        ),
        (
            &["render", "tri.gltf", "-o", "%04d.mp4"],
            "-o %04d.mp4: one mp4 file holds all frames, so its name needs no number",
        ),
        (
            &["render", "tri.gltf", "-o", "%s.png"],
            "-o %s.png: frame numbers are written %04d, once, in the file name",
        ),
        (
            &["render", "tri.gltf", "-o", "%d%d.png"],
            "-o %d%d.png: frame numbers are written %04d, once, in the file name",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--frames", "0..31"],
            "--frames 0..31: the scene has 30 frames, 0..30; --length SECS makes it longer and repeats the \
             clip",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--size", "big"],
            "--size big: write WIDTHxHEIGHT, each from 1 to 16384 pixels, as 1280x720",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--fps", "0"],
            "--fps 0: write frames per second from 0.001 to 1000 with up to 6 decimal places, as 30, 29.97 or 30000/1001",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--samples", "2"],
            "--samples 2: 1 (fast) or 4 (smooth edges)",
        ),
        (
            &["render", "tri.gltf", "-o", "o.png", "--at", "soon"],
            "--at soon: write seconds from -360000 to 360000, as 1.5",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--jobs", "0"],
            "--jobs 0: a number of threads from 1 to 1024",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--set", "x=1"],
            "--set x=1 is for scripts; tri.gltf is a model",
        ),
        (&["render", "s.rhai", "-o", "o.mp4", "--set", "x"], "--set x: write NAME=VALUE"),
        (
            &["render", "s.rhai", "-o", "o.mp4", "--clip", "Walk"],
            "--clip is for model files; in a script, actor.play(…) chooses the clip",
        ),
        (
            &["render", "s.rhai", "-o", "o.png"],
            "o.png holds one image and the scene has 30 frames; type --at 0 for one of them, or -o o/%04d.png for all",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--export", "quality=900"],
            "--export quality=900: mp4: option quality must be a number from 0 to 100, got \"900\"",
        ),
        (
            &["render", "tri.gltf", "-o", "o.mp4", "--export", "qality=9"],
            "--export qality=9: mp4 has no option \"qality\"; did you mean \"quality\"?",
        ),
    ] {
        assert_eq!(failed_run(d, args), (2, expected.to_string()), "{args:?}");
    }
    // A mistake that would overwrite the script or the model.
    for mesh in ["tri.gltf", "s.rhai", "x.stl", "x"] {
        let expected = format!("--mesh {mesh}: write a name that ends in .obj");
        assert_eq!(failed_run(d, &["pose", "tri.gltf", "--mesh", mesh]), (2, expected));
    }
    assert_eq!(read_file(d, "tri.gltf"), triangle(1.0).into_bytes());
    // These errors are found by clap itself.
    for args in [
        &["render", "tri.gltf"][..],
        &["paint"],
        &["render", "tri.gltf", "-o", "o.mp4", "--device", "abacus"],
    ] {
        assert_eq!(choreo(d, args).code, 2, "{args:?}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_errors_with_the_reason() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for (output, expected) in [
        ("no/o.mp4", "no/o.mp4: cannot write: the folder no does not exist; create it: mkdir -p no"),
        ("tri.gltf/o.mp4", "tri.gltf/o.mp4: cannot write: a part of the path is a file, not a folder"),
        ("tri.gltf/%04d.png", "tri.gltf: cannot create the folder: it already exists and is not a folder"),
    ] {
        let (code, line) = failed_run(d, &["render", "tri.gltf", "-o", output, "--device", "cpu", "--quiet"]);
        assert_eq!((code, line.as_str()), (3, expected));
    }
    let missing = "the folder no/such does not exist; create it: mkdir -p no/such";
    for args in [
        &["export", "tri.gltf", "-o", "no/such/o.glb"][..],
        &["check", "tri.gltf", "--plot", "no/such/o.svg"],
    ] {
        let (code, line) = failed_run(d, args);
        assert_eq!((code, line), (3, format!("{}: cannot write: {missing}", args[3])));
    }
    let long = format!("{}.mp4", "x".repeat(300));
    let (code, line) = failed_run(d, &["render", "tri.gltf", "-o", &long, "--device", "cpu", "--quiet"]);
    assert_eq!(code, 3);
    assert!(line.ends_with("cannot write: the name is too long or not allowed"), "{line}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported() {
    let dir = folder_with_triangle();
    let d = dir.path();
    for format in ["y4m", "mp4", "gif"] {
        let name = format!("full.{format}");
        // The device itself: a link to it is refused.
        let made = std::process::Command::new("mknod").arg(d.join(&name)).args(["c", "1", "7"]).output();
        if !made.is_ok_and(|made| made.status.success()) {
            println!("SKIP 3: this user may not make devices");
            return;
        }
        let small = ["--device", "cpu", "--size", "320x180", "--samples", "1", "--quiet"];
        let args: Vec<&str> = ["render", "tri.gltf", "-o", &name].into_iter().chain(small).collect();
        let (code, line) = failed_run(d, &args);
        assert_eq!((code, line), (3, format!("{name}: cannot write: the disk is full")));
    }
}

#[test]
fn script_errors_state_line_and_column() {
    let dir = tempfile::tempdir().unwrap();
    let d = &dir.path().join("inside");
    std::fs::create_dir(d).unwrap();
    std::fs::write(d.join("tri.gltf"), triangle(1.0)).unwrap();
    std::fs::write(dir.path().join("outside.txt"), "secret").unwrap();
    for (text, expected) in [
        ("let a = laod(\"tri.gltf\");", "s.rhai:1:9: unknown function \"laod\"; did you mean \"load\"?"),
        ("let x = 1;\nlet y = ;", "s.rhai:2:9: unexpected ';'"),
        ("loop { }", "s.rhai:1:6: the script takes too many steps; does a loop never end?"),
        (
            "fn f() { f() }\nf();",
            "s.rhai:2:1: functions call each other too deeply; does one call itself without end?",
        ),
        ("let s = \"x\";\nloop { s += s; }", "s.rhai:2:13: this text grows too long"),
        (
            "let a = load(\"../outside.txt\");",
            "s.rhai:1:14: cannot read \"../outside.txt\": it leads out of the folders this script may read",
        ),
        (
            "let a = load(\"/etc/passwd\");",
            "s.rhai:1:14: cannot read \"/etc/passwd\": it is an absolute path",
        ),
        ("import \"/etc/x\" as y;", "s.rhai:1:8: cannot read \"/etc/x.rhai\": it is an absolute path"),
        (
            "let a = load(\"tri.gltf\");\nlet b = cast(\"b\", a);\nb.play(a.clip(\"Slid\"));",
            "s.rhai:3:15: unknown clip \"Slid\" in \"tri.gltf\"; did you mean \"Slide\"?",
        ),
        (
            "let a = load(\"tri.gltf\");\nlet b = cast(\"b\", a);\nlet j = b.joint(\"Rot\");",
            "s.rhai:3:17: unknown joint \"Rot\" in skeleton \"tri.gltf\"; did you mean \"Root\"?",
        ),
    ] {
        std::fs::write(d.join("s.rhai"), text).unwrap();
        for args in
            [&["check", "s.rhai"][..], &["render", "s.rhai", "-o", "o.mp4", "--device", "cpu", "--quiet"]]
        {
            assert_eq!(failed_run(d, args), (1, expected.to_string()), "{text}");
        }
    }
}

/// A callback that fails in a late frame: `check` and `render` report its place and time, also as JSON, and no output is left.
#[test]
fn errors_of_callbacks_in_late_frames_are_found() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let text = "stage(#{ length: 4, fps: 30 });\nlet b = cast(\"b\", shape(\"box\"));\n\
                camera(\"c\").at(0, 1, 5);\non_frame(|t| { if t >= 3.3 { throw \"boom\"; } b.at(t, 0, 0); });";
    std::fs::write(d.join("s.rhai"), text).unwrap();
    let (code, line) = failed_run(d, &["check", "s.rhai"]);
    assert_eq!((code, line.as_str()), (1, "s.rhai:4:30: boom (at 3.3 s and in 20 more frames)"));
    let run = choreo(d, &["check", "s.rhai", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(
        (value["errors"][0]["line"].as_u64(), value["errors"][0]["column"].as_u64()),
        (Some(4), Some(30))
    );
    for output in ["o.mp4", "o.y4m", "o.gif", "f/%03d.png"] {
        let small = ["--device", "cpu", "--size", "64x64", "--quiet"];
        let args: Vec<&str> = ["render", "s.rhai", "-o", output].into_iter().chain(small).collect();
        let run = choreo(d, &args);
        assert_eq!(run.code, 1, "{}", run.err);
        assert!(run.err.starts_with("s.rhai:4:30: boom\n"), "{}", run.err);
        assert!(run.err.trim_end().ends_with("    at 3.3 s"), "{}", run.err);
        let whole = if output.starts_with("f/") { vec!["f", "s.rhai"] } else { vec!["s.rhai"] };
        assert!(
            part_files(d).is_empty() && file_names(d).iter().all(|n| whole.contains(&n.as_str())),
            "{:?}",
            file_names(d)
        );
    }
    // Numbered images of the frames before the error are kept, and these frames can be rendered alone.
    assert!(file_names(&d.join("f")).iter().all(|n| n.as_str() < "099.png" && n.ends_with(".png")));
    let args = ["render", "s.rhai", "-o", "o.mp4", "--frames", "0..99", "--device", "cpu", "--size", "64x64"];
    assert_eq!(choreo(d, &args).code, 0);
}

#[test]
fn a_warning_is_printed_once() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("s.rhai"), "cast(\"a\", shape(\"box\"));\ncast(\"b\", shape(\"box\"));").unwrap();
    let run = choreo(d, &["check", "s.rhai", "--json"]);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(value["warnings"].as_array().map(Vec::len), Some(1), "{value}");
    assert_eq!(choreo(d, &["check", "s.rhai"]).out, "s.rhai: good, 120 frames, 1 warning\n");
}

#[test]
fn scripts_that_are_not_utf8_too_large_or_too_deep_are_errors() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("latin.rhai"), b"stage(#{});\nlet x = \"\xff\";\n").unwrap();
    std::fs::write(d.join("big.rhai"), vec![b' '; 100_000_000]).unwrap();
    std::fs::write(d.join("deep.rhai"), format!("let x = {}1{};", "(".repeat(100_000), ")".repeat(100_000)))
        .unwrap();
    for (name, expected) in [
        ("latin.rhai", "\"latin.rhai\" is not a text file: line 2 is not UTF-8"),
        ("big.rhai", "\"big.rhai\" has 100000000 bytes; a script may have at most 4194304"),
        ("deep.rhai", "deep.rhai:1:40: this expression is nested too deeply"),
    ] {
        assert_eq!(failed_run(d, &["check", name]), (1, expected.to_string()));
    }
}

#[test]
fn several_script_errors_are_reported_together() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("s.rhai"), "let a = load(\"no.glb\");\nlet b = load(\"tr.gltf\");").unwrap();
    let run = choreo(d, &["check", "s.rhai", "--json"]);
    assert_eq!(run.code, 1);
    let value: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    let errors = value["errors"].as_array().unwrap();
    let at =
        |i: usize| (errors[i]["file"].as_str(), errors[i]["line"].as_u64(), errors[i]["column"].as_u64());
    assert_eq!(errors.len(), 2, "{value}");
    assert_eq!((at(0), at(1)), ((Some("s.rhai"), Some(1), Some(14)), (Some("s.rhai"), Some(2), Some(14))));
    assert!(errors[1]["message"].as_str().unwrap().contains("did you mean \"tri.gltf\"?"));
}

/// Errors of the command line are printed as JSON, too, wherever `--json` stands.
#[test]
fn command_line_errors_are_printed_as_json() {
    let dir = folder_with_triangle();
    for (args, kind, message) in [
        (&["check", "tri.gltf", "--jsn", "--json"][..], "usage", "unexpected argument '--jsn' found"),
        (&["--json", "check", "tri.gltf"], "usage", "unexpected argument '--json' found"),
        (&["render", "--json", "tri.gltf"], "usage", "the following required arguments were not provided"),
        (&["chek", "--json"], "usage", "unrecognized subcommand 'chek'"),
        (&["render", "tri.gltf", "-o", "x.png", "--device", "gpu", "--json"], "usage", "invalid value 'gpu'"),
        (&["render", "tri.gltf", "-o", "x.png", "--size", "big", "--json"], "usage", "--size big"),
        (&["test", "--timeout", "0", "--json"], "usage", "--timeout 0: write seconds above 0, as 60 or 0.5"),
        (&["pose", "trj.gltf", "--json"], "input", "trj.gltf: no such file; did you mean \"tri.gltf\"?"),
    ] {
        let run = choreo(dir.path(), args);
        let value: serde_json::Value = serde_json::from_str(&run.out)
            .unwrap_or_else(|e| panic!("{args:?}: {e}: {}{}", run.out, run.err));
        let code = if kind == "usage" { 2 } else { 1 };
        assert_eq!((run.code, &value["exit_code"], &value["kind"]), (code, &code.into(), &kind.into()));
        let printed = value["errors"][0]["message"].as_str().unwrap();
        assert!(printed.starts_with(message) && !printed.contains("Usage:"), "{args:?}: {printed}");
        assert!(run.err.contains(message), "{args:?}: {}", run.err);
    }
    // If the video goes to standard output, the JSON goes to standard error.
    let run = choreo(dir.path(), &["render", "tri.gltf", "-o", "-", "--frmes", "1", "--json"]);
    assert_eq!((run.code, run.out.as_str()), (2, ""));
    assert!(run.err.contains(r#"{"errors":[{"message":"unexpected argument '--frmes' found"#), "{}", run.err);
    let run = choreo(dir.path(), &["render", "trj.gltf", "-o", "-", "--json"]);
    assert!(run.out.is_empty() && run.err.contains(r#""kind":"input""#), "{}", run.err);
    // After "--", --json is the name of a file; help is printed as text.
    assert_eq!(choreo(dir.path(), &["check", "--", "tri.gltf", "--json"]).out, "");
    assert!(choreo(dir.path(), &["check", "--json", "--help"]).out.starts_with("Check a scene"));
}

#[test]
fn help_lists_limits_and_exit_codes() {
    let dir = folder_with_triangle();
    let help = choreo(dir.path(), &["render", "--help"]).out;
    let row = |name: &str| help.lines().find(|l| l.trim_start().starts_with(name)).unwrap_or_default();
    assert!(row("memory ").contains(" 4 GiB = 4294967296  bytes of memory"), "{}", row("memory "));
    assert!(
        row("output ").contains(" 64 GiB = 68719476736  bytes that a render writes"),
        "{}",
        row("output ")
    );
    for code in ["  5    the system gives it too little memory", "  6    choreo itself failed"] {
        assert!(help.contains(code), "{help}");
    }
    let help = choreo(dir.path(), &["test", "--help"]).out;
    assert!(help.contains("--timeout <SECONDS>") && help.contains("[default: 300]"), "{help}");
}

/// Runs the program with at most `most` threads; `None` if this machine cannot limit them.
#[cfg(target_os = "linux")]
fn run_with_thread_limit(folder: &Path, most: u32, args: &[&str]) -> Option<Run> {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::process::Command;
    let limit = format!("--nproc={most}:{most}");
    let owner = std::fs::metadata(folder).unwrap().uid();
    let mut command = match owner {
        // The limit does not apply to root. Threads are counted per user, so a user without other processes is chosen.
        0 => {
            let user = (100_000 + std::process::id() % 1_000_000).to_string();
            let mode = std::fs::Permissions::from_mode(0o777);
            std::fs::set_permissions(folder, mode).unwrap();
            let program = folder.join("choreo");
            if !program.exists() {
                std::fs::copy(env!("CARGO_BIN_EXE_choreo"), &program).unwrap();
            }
            let mut command = Command::new("setpriv");
            command.args(["--reuid", &user, "--regid", &user, "--clear-groups", "prlimit", &limit]);
            command.arg(program);
            command
        }
        // This user already has other threads, so a limit above 1 would count them too.
        _ if most > 1 => return None,
        _ => {
            let mut command = Command::new("prlimit");
            command.args([&limit, env!("CARGO_BIN_EXE_choreo")]);
            command
        }
    };
    command.current_dir(folder).args(args).stdin(std::process::Stdio::null());
    Some(run_result(command.output().ok()?))
}

#[cfg(target_os = "linux")]
#[test]
fn too_few_threads_end_with_exit_code_5() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(
        d.join("s.rhai"),
        "let m = load(\"tri.gltf\");\ncast(\"a\", m).play(m.clip(\"Slide\"));\n",
    )
    .unwrap();
    let section = |i: i32| format!("test(\"a{i}\", || {{ expect(1).equals(1); }});\n");
    std::fs::write(d.join("t.rhai"), (0..40).map(section).collect::<String>()).unwrap();
    let commands = [
        // A Vulkan driver that finds too few threads would wait for them for ever.
        &["render", "s.rhai", "-o", "y.png", "--at", "0", "--size", "64x36"][..],
        &["render", "s.rhai", "-o", "x.mp4", "--size", "64x36", "--device", "cpu"],
        &["render", "s.rhai", "-o", "f/%04d.png", "--frames", "0..2", "--size", "64x36", "--device", "cpu"],
        &["check", "s.rhai"],
        &["pose", "tri.gltf"],
        &["explain", "tri.gltf"],
        &["info", "tri.gltf"],
        &["test", "t.rhai"],
    ];
    let mut enough = 0;
    for most in (1..=14).chain([40]) {
        for args in commands {
            let Some(run) = run_with_thread_limit(d, most, args) else {
                println!(
                    "SKIP 1: {most} threads cannot be set apart from those of the user's other programs"
                );
                continue;
            };
            match run.code {
                0 => enough += 1,
                code => {
                    assert_eq!(code, 5, "{most} threads, {args:?}: {}", run.err);
                    assert!(run.err.starts_with("too few threads: "), "{}", run.err);
                    assert!(most < 12, "{most} threads are not enough for {args:?}: {}", run.err);
                }
            }
            if most == 1 {
                assert_eq!(run.code, 5);
            }
        }
    }
    assert!(enough == 0 || enough >= 4 * commands.len(), "{enough} runs had enough threads");
}

/// The exit code is the same for any allocation or thread that fails first.
#[cfg(target_os = "linux")]
#[test]
fn too_little_memory_ends_with_an_exit_code() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(
        d.join("s.rhai"),
        "let m = load(\"tri.gltf\");\ncast(\"a\", m).play(m.clip(\"Slide\"));\n",
    )
    .unwrap();
    let mut codes = Vec::new();
    for kib in [
        40_000, 60_000, 90_000, 130_000, 180_000, 240_000, 300_000, 360_000, 450_000, 600_000, 1_000_000,
        4_000_000,
    ] {
        for args in [
            &["render", "s.rhai", "-o", "x.mp4", "--size", "1280x720", "--device", "cpu"][..],
            // These commands must not load a Vulkan driver, which would end the program by a signal.
            &["render", "s.rhai", "-o", "x.png", "--at", "0", "--size", "64x36"],
            &["explain", "s.rhai"],
        ] {
            let shell = format!("ulimit -v {kib}; ulimit -c 0; exec \"$@\"");
            let mut command = std::process::Command::new("sh");
            command.args(["-c", &shell, "sh", env!("CARGO_BIN_EXE_choreo")]).args(args);
            let run = run_result(command.current_dir(d).env_remove("RUST_BACKTRACE").output().unwrap());
            match (kib, run.code) {
                // With less memory the loader or the kernel ends the program, because it cannot be mapped.
                (..90_000, 127 | -1) => continue,
                (4_000_000, code) => assert_eq!(code, 0, "{}", run.err),
                (_, 5) => {
                    // The C library prints the last one if the first allocation of a thread fails.
                    let beginnings = ["too few threads: ", "memory allocation of ", "Fatal glibc error: "];
                    assert!(beginnings.iter().any(|text| run.err.contains(text)), "{kib}: {}", run.err);
                }
                // The library of the encoder reports only that it failed.
                (..300_000, 3) => assert!(run.err.contains("H.264 encoder: "), "{kib}: {}", run.err),
                (_, code) => assert_eq!(code, 0, "{kib} KiB, {args:?}: {}", run.err),
            }
            codes.push(run.code);
        }
    }
    assert!(codes.iter().filter(|code| **code == 5).count() >= 4, "{codes:?}");
}

/// `info` stops at the memory limit, as `check` does.
#[test]
fn info_and_check_obey_the_memory_limit() {
    let dir = folder_with_triangle();
    let mut stl = vec![0u8; 80];
    let triangles = 400_000u32;
    stl.extend(triangles.to_le_bytes());
    for i in 0..triangles {
        let at = i as f32;
        let numbers = [0.0, 0.0, 1.0, at, 0.0, 0.0, at + 1.0, 0.0, 0.0, at, 1.0, 0.0f32];
        stl.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        stl.extend([0, 0]);
    }
    std::fs::write(dir.path().join("large.stl"), stl).unwrap();
    for command in ["check", "info"] {
        let (code, first) = failed_run(dir.path(), &[command, "large.stl", "--limit", "memory=20000000"]);
        assert_eq!(code, 1, "{command}: {first}");
        assert!(first.contains("the program would need more memory than it may use"), "{command}: {first}");
    }
    assert_eq!(choreo(dir.path(), &["info", "large.stl"]).code, 0);
}
