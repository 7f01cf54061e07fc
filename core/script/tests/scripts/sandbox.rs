//! The sandbox: what a script can reach and use up, beyond the cases of `wrong/`.

use crate::common::*;
use choreo_script::{Limits, ScriptOptions};

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let outside = Folder::new(&[("secret.toy", ""), ("secret.rhai", "fn a() {}")]);
    let inside = assets();
    std::os::unix::fs::symlink(outside.file("secret.toy"), inside.file("link.toy")).unwrap();
    std::os::unix::fs::symlink(outside.path(), inside.file("door")).unwrap();
    std::os::unix::fs::symlink(inside.file("hero.toy"), inside.file("good.toy")).unwrap();
    let error = |text: &str| inside.run_text(text, &ScriptOptions::default()).unwrap_err()[0].message.clone();
    let refused = "it is a link that leads out of the folders this script may read";
    assert_eq!(error(r#"load("link.toy");"#), format!("cannot read \"link.toy\": {refused}"));
    assert_eq!(error(r#"load("door/secret.toy");"#), format!("cannot read \"door/secret.toy\": {refused}"));
    assert_eq!(
        error(r#"import "door/secret" as s;"#),
        format!("cannot read \"door/secret.rhai\": {refused}")
    );
    // Names behind the door are not reported either.
    assert!(!error(r#"load("door/secre.toy");"#).contains("secret"));
    assert!(inside.run_text(r#"load("good.toy");"#, &ScriptOptions::default()).is_ok());
    // If the folder is given, the link is accepted; modules still come from the script's own folder only.
    let options = ScriptOptions { search_paths: vec![outside.path().into()], ..ScriptOptions::default() };
    assert!(inside.run_text(r#"load("link.toy"); load("secret.toy");"#, &options).is_ok());
    assert!(inside.run_text(r#"import "secret" as s;"#, &options).is_err());
}

#[cfg(unix)]
#[test]
fn a_pipe_in_place_of_a_file_does_not_hang() {
    let folder = assets();
    let made = std::process::Command::new("mkfifo").arg(folder.file("pipe.toy")).status();
    if !made.is_ok_and(|s| s.success()) {
        println!("SKIP 1: no mkfifo here");
        return;
    }
    let errors = folder.run_text(r#"load("pipe.toy");"#, &ScriptOptions::default()).unwrap_err();
    assert_eq!(errors[0].message, "cannot read \"pipe.toy\": it is not a regular file");
}

#[test]
fn limits_are_set_by_name() {
    let mut limits = Limits::default();
    limits.set("operations=5").unwrap();
    limits.set("seconds=0.5").unwrap();
    assert_eq!((limits.operations, limits.seconds), (5, 0.5));
    let unknown = limits.set("oparations=5").unwrap_err().to_string();
    let start = "unknown limit \"oparations\"; did you mean \"operations\"?; known limits: operations, frame_operations,";
    assert!(unknown.starts_with(start) && unknown.ends_with("pixels, output"), "{unknown}");
    assert_eq!(
        limits.set("things=0").unwrap_err().to_string(),
        "limit things takes a whole number above 0, not \"0\""
    );
    assert_eq!(
        limits.set("call_levels=65").unwrap_err().to_string(),
        "limit call_levels can be raised to 64 at most"
    );
    assert_eq!(
        limits.set("things").unwrap_err().to_string(),
        "a limit is written NAME=NUMBER, not \"things\""
    );
}

/// Each limit that a name sets is in `--help` and in the reference, with the default that counts.
#[test]
fn every_limit_is_in_the_table() {
    let table = Limits::table();
    let reference = choreo_script::reference();
    let row = |name: &str| table.lines().find(|l| l.trim_start().starts_with(&format!("{name} "))).unwrap();
    for (name, default, about) in Limits::ALL {
        assert!(*default > 0.0 && row(name).contains(&default.to_string()) && row(name).ends_with(about));
        assert!(reference.contains(&format!("- `{name}` = {} — ", Limits::shown(*default, about))), "{name}");
        Limits::default().set(&format!("{name}=7")).unwrap();
        // The default in the table is the one in effect.
        let mut set = Limits::default();
        set.set(&format!("{name}={default}")).unwrap();
        assert_eq!(set, Limits::default(), "{name}");
    }
    assert!(row("memory").contains(" 4 GiB = 4294967296  bytes"), "{}", row("memory"));
    assert!(row("output").contains(" 64 GiB = 68719476736  bytes"), "{}", row("output"));
    assert!(row("seconds").contains("  20  seconds"), "{}", row("seconds"));
}

#[test]
fn the_clock_stops_what_the_steps_do_not() {
    let limits = Limits { seconds: 0.05, operations: u64::MAX, ..Limits::default() };
    let options = ScriptOptions { limits, ..ScriptOptions::default() };
    let errors = assets().run_text("let n = 0; while true { n += 1; }", &options).unwrap_err();
    assert_eq!(errors[0].message, "the script takes too long; does a loop never end?");
}

/// The parser takes quadratic time for many variables: the clock stops it, too.
#[test]
fn the_clock_stops_the_reading_of_a_script() {
    let text: String = (0..100_000).map(|i| format!("let x{i} = 1;\n")).collect();
    let limits = Limits { seconds: 0.05, variables: 1_000_000, ..Limits::default() };
    let errors = assets().run_text(&text, &ScriptOptions { limits, ..ScriptOptions::default() }).unwrap_err();
    assert_eq!(errors[0].message, "the script takes too long to read; split it into functions and modules");
    assert!(errors[0].line > 1);
}

/// Each was one step of the interpreter, in which no clock was read, for minutes.
#[test]
fn a_call_of_very_many_arguments_is_refused_where_it_stands() {
    let started = std::time::Instant::now();
    let many = |n: usize| vec!["1"; n].join(",");
    for call in ["max(#)", "f(#)", "g.call(#)", "[1].push(#)", "g(#)"] {
        let text = format!("fn f(a) {{ a }}\nlet g = |a| a;\nlet x = {};", call.replace('#', &many(300_000)));
        let errors = assets().run_text(&text, &ScriptOptions::default()).unwrap_err();
        let column = 9 + call.find('(').unwrap();
        assert_eq!(errors[0].message, "this call has too many arguments: 64 at most", "{call}");
        assert_eq!((errors[0].line, errors[0].hint.as_deref()), (3, Some("give it an array")), "{call}");
        assert!(errors[0].column <= column, "{call}: {}", errors[0].column);
    }
    let errors = assets().run_text(&format!("foo({});", many(64)), &ScriptOptions::default()).unwrap_err();
    assert_eq!(errors[0].message, "unknown function \"foo\"");
    assert!(started.elapsed().as_secs() < 60, "{:?}", started.elapsed());
}

/// `f.curry(f)` is refused because its size doubles with each repetition.
#[test]
fn curry_is_refused() {
    for text in ["let f = |a| a;\nf.curry(1);", "let f = |a| a;\ncurry(f, 1);"] {
        let errors = assets().run_text(text, &ScriptOptions::default()).unwrap_err();
        let wanted =
            "\"curry\" cannot be used in a script: a closure, || f(x), captures the variables that it uses";
        assert_eq!((errors[0].message.as_str(), errors[0].line), (wanted, 2), "{text}");
    }
    // Closures that capture values still work.
    assets()
        .run_text("let n = 2; let f = |a| a * n; if f.call(3) != 6 { throw }", &ScriptOptions::default())
        .unwrap();
}

#[test]
fn too_large_files_are_refused() {
    let folder = Folder::new(&[("big.toy", &"x".repeat(2000))]);
    let limits = Limits { file: 1000, ..Limits::default() };
    let options = ScriptOptions { limits, ..ScriptOptions::default() };
    let errors = folder.run_text(r#"load("big.toy");"#, &options).unwrap_err();
    assert_eq!(errors[0].message, "cannot read \"big.toy\": it is too large");
}

#[test]
fn binary_missing_and_folder_scripts_are_refused() {
    let folder = Folder::new(&[("binary.rhai", "")]);
    std::fs::write(folder.file("binary.rhai"), b"let x = 1;\n\xff\xfe").unwrap();
    let message = |name: &str| {
        folder.run(name).unwrap_err()[0].to_string().replace(&folder.path().display().to_string(), "FOLDER")
    };
    assert_eq!(message("binary.rhai"), "\"binary.rhai\" is not a text file: line 2 is not UTF-8");
    assert_eq!(
        message("none.rhai"),
        "cannot read script \"FOLDER/none.rhai\": No such file or directory (os error 2)"
    );
    std::fs::create_dir(folder.file("dir.rhai")).unwrap();
    assert_eq!(message("dir.rhai"), "cannot read script \"FOLDER/dir.rhai\": it is not a file");
}

fn warning_texts(script: &choreo_script::Script) -> Vec<String> {
    script.warnings.iter().map(|w| format!("{}: {}", w.line, w.message)).collect()
}

/// A plane is taken for the ground, on which actors stand.
#[test]
fn an_actor_may_share_the_origin_with_a_plane() {
    let script = run_or_panic(r#"cast("a", load("hero.toy")); cast("ground", shape("plane"));"#);
    assert_eq!(warning_texts(&script), [""; 0]);
    let script = run_or_panic(
        r#"cast("a", load("hero.toy")); cast("ground", shape("plane")); cast("c", shape("box"));"#,
    );
    assert_eq!(
        warning_texts(&script),
        ["1: 2 actors stand in the same place, the origin: a, c; place them with .at(x, y, z)"]
    );
}

#[test]
fn a_trimmed_clip_that_restarts_during_a_fade_is_reported() {
    // Walk takes 1 s, so its second half of 0.5 s starts over every 0.5 s.
    let script = |how: &str, until: f64, fade: f64| {
        run_or_panic(&format!(
            "let h = load(\"hero.toy\");\nlet a = cast(\"a\", h);\n\
             a.play(h.clip(\"Walk\"), #{{ trim: [0.5, 1.0] }}){how}.until({until})\
             .then(h.clip(\"Run\"), #{{ fade: {fade} }});"
        ))
    };
    let restart_warning = "3: this part of clip \"Walk\" takes 0.5 s and starts over at 1 s, while \"Run\" fades in over it; \
                add .once() to hold its last pose, or .loop() if it is intended";
    assert_eq!(warning_texts(&script("", 1.0, 0.25)), [restart_warning]);
    assert_eq!(warning_texts(&script("", 0.875, 0.25)), [restart_warning]);
    for (how, until, fade) in
        [("", 0.75, 0.25), ("", 1.125, 0.25), (".loop()", 1.0, 0.25), ("", 1.0, 0.0), (".once()", 0.5, 0.25)]
    {
        assert_eq!(warning_texts(&script(how, until, fade)), [""; 0], "{how} {until} {fade}");
    }
}

#[test]
fn every_run_warns_about_probable_mistakes() {
    let script = run_or_panic(
        r#"stage(#{ length: 4 });
           let h = load("hero.toy");
           let a = cast("a", h);
           let b = cast("b", h);
           a.play(h.clip("Walk")).once().until(3);
           a.play(h.clip("Run")).from(5);
           b.play(h.clip("Walk"));
           b.play(h.clip("Run"), #{ fade: 2, until: 1 });
           let d = cast("d", h).at(1, 0, 0);
           d.play(h.clip("Walk"));
           d.play(h.clip("Run"));
           camera("c").at(0, 1, 5).cut(9);"#,
    );
    assert_eq!(
        warning_texts(&script),
        [
            "5: clip \"Walk\" is played once and takes 1 s, but its cue lasts 3 s: the last pose is held",
            "6: clip \"Run\" starts at 5 s, after the end of the stage, 4 s",
            "8: clip \"Run\" fades in over 2 s, but its cue lasts 1 s: it never reaches full weight",
            "10: clip \"Walk\" is never seen: \"Run\" starts at the same time, 0 s; use .from, or .on(\"Spine..\") for a layer",
            "4: 2 actors stand in the same place, the origin: a, b; place them with .at(x, y, z)",
            "12: this cut at 9 s comes after the end of the stage, 4 s",
        ]
    );
}

#[test]
fn the_deepest_calls_of_a_callback_fit_the_stack_of_a_small_thread() {
    // Every level nests expressions as deeply as the parser allows.
    let nested = format!("{}down(t){}", "(1 + ".repeat(14), ")".repeat(14));
    let text = format!(
        "fn down(t) {{ if true {{ if true {{ [1].map(|x| {nested})[0] }} }} }}\non_frame(|t| if t > 0.5 {{ down(t) }});"
    );
    let limits = Limits { call_levels: 1000, ..Limits::default() };
    let options = ScriptOptions { limits, ..ScriptOptions::default() };
    let script = assets().run_text(&text, &options).unwrap();
    let callback = script.stage.frame_callbacks[0].clone();
    let run =
        move || callback.run(choreo_motion::Time::from_secs(1.0), &mut choreo_stage::FrameEdits::default());
    // Rust gives a thread 2 MiB where nothing else is said.
    let error =
        std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap().unwrap_err();
    assert!(error.to_string().contains("functions call each other too deeply"), "{error}");
}
