//! `choreo test` as a user runs it: good runs, and every kind of fault planted to see that it is found.

mod common;

use common::*;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Three sections, two with an image.
const SUITE: &str = r##"
fn set(x) {
    cast("box", shape("box", #{ size: [1, 1, 1], color: "coral" })).at(x, 0.5, 0.0).turn(30.0);
    camera("c").at(1.0, 1.6, 4.0).look_at([0.0, 0.6, 0.0]);
    sun(#{ direction: [-1.0, -2.0, -1.0] });
}

test("the box is seen", || {
    set(0.0);
    expect_image("box", #{ at: 0.0, size: [96, 54] });
});

test("the box is seen aside", #{ tags: ["aside"] }, || {
    set(0.7);
    expect_image("aside", #{ at: 0.0, size: [96, 54] });
});

test("numbers are numbers", || { expect(1 + 1).equals(2); });
"##;

/// A folder with `suite/box.rhai`, and a folder `target` for the files of the runner.
fn suite() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("suite")).unwrap();
    std::fs::create_dir_all(dir.path().join("target")).unwrap();
    write(dir.path(), "suite/box.rhai", SUITE);
    dir
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

fn run_tests(folder: &Path, args: &[&str]) -> Run {
    choreo(folder, &[&["test"], args].concat())
}

fn json_report(folder: &Path, args: &[&str]) -> (i32, Value) {
    let run = run_tests(folder, &[args, &["--json"]].concat());
    let value = serde_json::from_str(&run.out).unwrap_or_else(|e| panic!("{e}: {}\n{}", run.out, run.err));
    (run.code, value)
}

fn suite_with_accepted_images() -> tempfile::TempDir {
    let dir = suite();
    let run = run_tests(dir.path(), &["suite", "--accept"]);
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(run.out.contains("3 passed, 0 failed, 0 skipped, 2 images accepted"), "{}", run.out);
    assert!(run.out.contains("accepted suite/pictures/box/box.png\n"), "{}", run.out);
    dir
}

/// Paints a block into a PNG without touching its texts.
fn change_pixel_block(path: &Path) {
    use choreo_test_runner::golden_image;
    let (mut stored, _) = golden_image::read(path).unwrap();
    for y in 20..24 {
        for x in 40..44 {
            stored.frame.rgba[((y * 96 + x) * 4) as usize] ^= 0x80;
        }
    }
    let bytes = golden_image::encode_accepted(&stored.frame, &stored.device, "t").unwrap();
    std::fs::write(path, &bytes).unwrap();
}

/// Images go to the cache of the user if there is no build folder or if it is a link. They do not go to a shared temporary folder, in
/// which another user could prepare names.
#[cfg(unix)]
#[test]
fn without_a_build_folder_the_cache_of_the_user_is_used() {
    use std::os::unix::fs::symlink;
    let dir = suite();
    let d = dir.path();
    std::fs::remove_dir(d.join("target")).unwrap();
    for name in ["shared", "cache", "far"] {
        std::fs::create_dir(d.join(name)).unwrap();
    }
    let cache = d.join("cache");
    let failing = || {
        let mut command = command(d, &["test", "suite"]);
        command.env("TMPDIR", d.join("shared")).env("XDG_CACHE_HOME", &cache);
        let run = run_result(command.output().unwrap());
        assert_eq!(run.code, 1, "{}{}", run.out, run.err);
        let seen = run.out.lines().find_map(|line| line.trim().strip_prefix("see "));
        let seen = Path::new(seen.unwrap_or_else(|| panic!("{}", run.out)).trim()).to_path_buf();
        assert!(seen.starts_with(cache.join("choreo/test/pictures")) && seen.exists(), "{}", run.out);
        assert_eq!(file_names(&d.join("shared")), Vec::<String>::new());
    };
    failing();
    symlink(d.join("far"), d.join("target")).unwrap();
    failing();
    assert_eq!(file_names(&d.join("far")), Vec::<String>::new());
}

#[test]
fn images_are_accepted_then_compared_and_a_changed_block_fails() {
    let dir = suite();
    let d = dir.path();
    let run = run_tests(d, &["suite"]);
    assert_eq!(run.code, 1);
    assert!(run.out.contains("FAILED suite/box.rhai > the box is seen\n"), "{}", run.out);
    assert!(run.out.contains("which does not exist yet"), "{}", run.out);
    assert!(run.err.contains("2 sections failed"), "{}", run.err);

    assert_eq!(run_tests(d, &["suite", "--accept=box"]).code, 1, "the other is still missing");
    assert_eq!(file_names(&d.join("suite/pictures/box")), ["box.png"]);
    assert_eq!(run_tests(d, &["suite", "--accept"]).code, 0);
    let run = run_tests(d, &["suite"]);
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(
        run.out.starts_with("ok     suite/box.rhai  3 sections\n3 passed, 0 failed, 0 skipped; "),
        "{}",
        run.out
    );
    assert_eq!(run_tests(d, &["suite", "--quiet"]).out, "");

    change_pixel_block(&d.join("suite/pictures/box/box.png"));
    let run = run_tests(d, &["suite", "--quiet"]);
    assert_eq!(run.code, 1);
    for part in [
        "FAILED suite/box.rhai > the box is seen\n  suite/box.rhai:10:5: image \"box\" at 0 s\n",
        "within 4x4 at (40, 20)",
        "see       target/choreo-test/pictures/suite_box/box.difference.png\n",
        "  alone:  choreo test suite/box.rhai --filter 'the box is seen'\n",
        "  accept: choreo test suite/box.rhai --accept=box\n",
        "2 passed, 1 failed, 0 skipped; ",
    ] {
        assert!(run.out.contains(part), "{part}\n{}", run.out);
    }
    for kind in ["expected", "got", "difference"] {
        assert!(
            read_file(d, &format!("target/choreo-test/pictures/suite_box/box.{kind}.png"))
                .starts_with(b"\x89PNG")
        );
    }
    // The commands in the message work.
    assert_eq!(run_tests(d, &["suite/box.rhai", "--filter", "the box is seen aside"]).code, 0);
    assert_eq!(run_tests(d, &["suite/box.rhai", "--accept=box"]).code, 0);
    assert_eq!(run_tests(d, &["suite"]).code, 0);
    let run = run_tests(d, &["suite", "--accept=asid"]);
    assert_eq!(run.code, 2);
    assert!(
        run.err.contains("no section that ran has an image of this name; did you mean \"aside\"?"),
        "{}",
        run.err
    );
}

#[test]
fn images_of_another_device_are_compared_only_with_any_device() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    let path = d.join("suite/pictures/box/box.png");
    let (stored, _) = choreo_test_runner::golden_image::read(&path).unwrap();
    let other = "vulkan:llvmpipe (LLVM 14.0.0, 256 bits)/22.1";
    let bytes = choreo_test_runner::golden_image::encode_accepted(&stored.frame, other, "t").unwrap();
    std::fs::write(&path, bytes).unwrap();
    let run = run_tests(d, &["suite"]);
    assert_eq!(run.code, 1);
    assert!(run.out.contains(&format!("box.png, accepted on {other}\n")), "{}", run.out);
    assert!(run.out.contains("--any-device"), "{}", run.out);
    assert_eq!(run_tests(d, &["suite", "--any-device"]).code, 0);
    // The results of a run depend on its options.
    assert_eq!(run_tests(d, &["suite", "--changed"]).code, 1);
}

#[test]
fn damaged_missing_and_differently_sized_images_fail() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    let path = d.join("suite/pictures/box/box.png");
    let good = std::fs::read(&path).unwrap();
    std::fs::write(&path, &good[..good.len() - 40]).unwrap();
    let run = run_tests(d, &["suite"]);
    assert!(run.code == 1 && run.out.contains("the stored image is damaged"), "{}", run.out);
    std::fs::remove_file(&path).unwrap();
    let run = run_tests(d, &["suite"]);
    assert!(run.code == 1 && run.out.contains("no image has been accepted"), "{}", run.out);
    std::fs::write(&path, good).unwrap();
    write(
        d,
        "suite/box.rhai",
        &SUITE.replace("\"box\", #{ at: 0.0, size: [96, 54]", "\"box\", #{ at: 0.0, size: [54, 96]"),
    );
    let run = run_tests(d, &["suite"]);
    assert!(run.code == 1 && run.out.contains("box.png, 96x54 pixels"), "{}", run.out);
}

/// Scripts that must fail, with a text that their run must print.
const FAULTS: &[(&str, &str)] = &[
    ("test(\"a\", || { cast(\"b\", shape(\"box\")); });", "this section asserts nothing, so it cannot fail"),
    ("test(\"a\", || { expect(1).equals(2); });", "FAILED suite/t.rhai > a"),
    ("test(\"a\", || { expect(1).equals(1); nonsense(); });", "ERROR suite/t.rhai > a"),
    ("test(\"a\", || { expect(1).equals(1); //~ error: something\n });", "something"),
    ("test(\"a\", #{ skip: \"not here\" }, || { expect(1).equals(1); });", "skipped 1: not here"),
    ("test(\"a\", #{ fails: \"bug 7\" }, || { expect(1).equals(1); });", "the bug is fixed"),
    ("test(\"a\", || { loop { } });", "raise it with --limit operations=NUMBER"),
    (
        "test(\"a\", || { let s = \"x\"; for i in 0..60 { s += s; } expect(s).equals(\"\"); });",
        "raise it with --limit",
    ),
    (
        "test(\"a\", || { expect(1).equals(1); expect_image(\"p\", #{ at: 0.0, size: [20000, 20000] }); });",
        "expect_image",
    ),
    ("let x = 1;\nlet y = ;\n", "ERROR suite/t.rhai"),
    ("cast(\"a\", load(\"nowhere.glb\"));\n", "ERROR suite/t.rhai"),
    (
        "test(\"a\", || { cast(\"b\", shape(\"box\")); expect_image(\"same\"); });\n\
         test(\"b\", || { cast(\"b\", shape(\"box\")); expect_image(\"same\"); });",
        "suite/t.rhai > a has an image of this name too",
    ),
];

#[test]
fn every_planted_fault_fails_with_its_reason() {
    let dir = suite();
    let d = dir.path();
    for (script, says) in FAULTS {
        write(d, "suite/t.rhai", script);
        let run = run_tests(d, &["suite/t.rhai"]);
        assert_eq!(run.code, 1, "{script}\n{}{}", run.out, run.err);
        assert!(run.out.contains(says), "{script}: {says}\n{}{}", run.out, run.err);
    }
    // A run in which all sections are skipped or none is found does not succeed.
    write(d, "suite/t.rhai", FAULTS[4].0);
    let run = run_tests(d, &["suite/t.rhai"]);
    assert!(run.err.contains("the only section was skipped, so nothing was tested"), "{}", run.err);
    let run = run_tests(d, &["target"]);
    assert_eq!((run.code, run.err.trim_end()), (1, "target: no scripts (.rhai) in this folder"));
    assert_eq!(run_tests(d, &["nowhere"]).code, 1);
}

#[test]
fn known_bugs_expected_errors_and_plain_scripts_pass() {
    let dir = suite();
    let d = dir.path();
    write(
        d,
        "suite/t.rhai",
        "test(\"a\", #{ fails: \"bug 7\" }, || { expect(1).equals(2); });\n\
         test(\"b\", || { nonsense(); //~ error: nonsense\n });",
    );
    write(d, "suite/plain.rhai", "stage(#{ length: 0.5 });\ncast(\"a\", shape(\"box\"));\n");
    let (code, value) = json_report(d, &["suite/t.rhai", "suite/plain.rhai"]);
    assert_eq!((code, &value["passed"], &value["failed"]), (0, &3.into(), &0.into()), "{value:#}");
    assert_eq!(value["sections"][0]["checks"][0]["title"], "known to fail: bug 7");
    // An image of a known bug is not accepted.
    write(
        d,
        "suite/bug.rhai",
        "test(\"a\", #{ fails: \"bug 8\" }, || { cast(\"b\", shape(\"box\")); expect_image(\"p\"); });",
    );
    assert_eq!(run_tests(d, &["suite/bug.rhai", "--accept"]).code, 0);
    assert!(!d.join("suite/pictures").exists());
    let titles: Vec<&str> = value["sections"][2]["checks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["title"].as_str().unwrap())
        .collect();
    assert!(titles.contains(&"can be drawn, at 0.25 s"), "{titles:?}");
}

/// Tests use the scenes of their project, and nothing beyond it.
#[test]
fn tests_read_below_the_folder_that_they_are_started_in() {
    let dir = suite();
    let d = dir.path();
    std::fs::create_dir(d.join("scenes")).unwrap();
    write(d, "scenes/s.rhai", "cast(\"a\", shape(\"box\"));");
    write(
        d,
        "suite/t.rhai",
        "test(\"a\", || { expect(scene(\"../scenes/s.rhai\").actor(\"a\")).near([0, 0, 0]); });",
    );
    let run = run_tests(d, &["suite/t.rhai"]);
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    let run = run_tests(&d.join("suite"), &["t.rhai"]);
    assert!(
        run.code == 1 && run.out.contains("it leads out of the folders this script may read"),
        "{}",
        run.out
    );
}

#[test]
fn sections_are_listed_filtered_and_sharded() {
    let dir = suite();
    let d = dir.path();
    let all = "suite/box.rhai:8  the box is seen\nsuite/box.rhai:13  the box is seen aside  #aside\n\
               suite/box.rhai:18  numbers are numbers\n";
    assert_eq!(run_tests(d, &["--list", "suite"]).out, all);
    assert_eq!(run_tests(d, &["--list"]).out, all, "without a path all below the folder");
    let count = |args: &[&str]| run_tests(d, &[&["suite", "--list"], args].concat()).out.lines().count();
    assert_eq!(count(&["--filter", "BOX is"]), 2);
    assert_eq!(count(&["--filter", "box.rhai > numbers"]), 1);
    assert_eq!(count(&["--filter", "aside", "--filter", "numbers"]), 2);
    assert_eq!(count(&["suite/box.rhai"]), 3, "no file twice");
    let mut dealt: Vec<String> = Vec::new();
    for part in ["1/2", "2/2"] {
        let out = run_tests(d, &["suite", "--list", "--shard", part]).out;
        dealt.extend(out.lines().map(str::to_string));
    }
    dealt.sort();
    let mut expected: Vec<&str> = all.lines().collect();
    expected.sort();
    assert_eq!(dealt, expected);
    for (args, says) in [
        (
            &["--filter", "numbrs are numbers"][..],
            "none of the 3 sections matches; did you mean \"numbers are numbers\"?",
        ),
        (&["--shard", "0/2"], "write I/N with I from 1 to N"),
        (&["--shard", "4/9"], "there are only 3 sections"),
        (&["--jobs", "0"], "--jobs"),
        (&["--device", "auto"], "write cpu or vulkan"),
        (&["suite/box.txt"], "no such file"),
    ] {
        let run = run_tests(d, &[&["suite"], args].concat());
        assert!(run.code != 0 && run.err.contains(says), "{args:?}: {}", run.err);
    }
    let (_, value) = json_report(d, &["suite", "--list"]);
    assert_eq!(value["sections"][1]["tags"], serde_json::json!(["aside"]));
}

#[test]
fn files_outside_the_folder_are_tested_and_named_as_given() {
    let (here, there) = (tempfile::tempdir().unwrap(), suite());
    let path = there.path().join("suite/box.rhai");
    let run = run_tests(here.path(), &[path.to_str().unwrap(), "--accept"]);
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
    assert!(there.path().join("suite/pictures/box/aside.png").is_file());
    write(there.path(), "suite/bad.rhai", "test(\"bad\", || { expect(1).equals(2); });");
    let run = run_tests(there.path(), &[]);
    assert!(run.out.contains("\n  suite/bad.rhai:1:") && !run.out.contains("./"), "{}", run.out);
}

#[test]
fn the_order_of_the_output_does_not_depend_on_the_number_of_jobs() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    let many: String = (0..40)
        .map(|i| {
            format!(
                "test(\"n{i}\", || {{ expect({i} % 7).equals({}); }});\n",
                if i == 13 { 0 } else { i % 7 }
            )
        })
        .collect();
    write(d, "suite/a.rhai", &many);
    let lines = |jobs: &str| -> Vec<String> {
        let run = run_tests(d, &["suite", "--jobs", jobs]);
        assert_eq!(run.code, 1);
        run.out
            .lines()
            .filter(|l| !l.contains(" checks in ") && !l.contains(" check in "))
            .map(str::to_string)
            .collect()
    };
    let one = lines("1");
    assert_eq!(one[0], "FAILED suite/a.rhai > n13");
    assert_eq!(one, lines("4"));
}

#[test]
fn only_sections_that_depend_on_a_change_run_again() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    let reused = |args: &[&str]| -> (i32, Vec<bool>) {
        let (code, value) = json_report(d, &[&["suite", "--changed"], args].concat());
        let flags = value["sections"].as_array().unwrap().iter().map(|s| s["reused"] == true).collect();
        (code, flags)
    };
    assert_eq!(run_tests(d, &["suite"]).code, 0);
    assert_eq!(reused(&[]), (0, vec![true; 3]));
    let run = run_tests(d, &["suite", "--changed"]);
    assert!(run.out.contains("3 passed (reused 3), 0 failed"), "{}", run.out);
    // One section's line; a shared line; an image.
    write(d, "suite/box.rhai", &SUITE.replace("1 + 1", "3 - 1"));
    assert_eq!(reused(&[]), (0, vec![true, true, false]));
    write(d, "suite/box.rhai", &SUITE.replace("size: [1, 1, 1]", "size: [1, 1, 1.0]"));
    assert_eq!(reused(&[]), (0, vec![false; 3]));
    change_pixel_block(&d.join("suite/pictures/box/box.png"));
    assert_eq!(reused(&[]), (1, vec![false, true, true]));
    assert_eq!(reused(&[]), (1, vec![false, true, true]), "a failed section runs again");
    assert_eq!(reused(&["--accept"]), (0, vec![false, true, true]));
    assert_eq!(reused(&[]), (0, vec![false, true, true]), "an accepted image is compared once more");
    assert_eq!(reused(&[]), (0, vec![true; 3]));
    assert_eq!(reused(&["--limit", "operations=1000000"]), (0, vec![false; 3]));
    // Everything runs without the option.
    let (_, value) = json_report(d, &["suite"]);
    assert_eq!(value["reused"], 0);
    // Damaged entries are ignored.
    let results = d.join("target/choreo-test/results");
    for name in file_names(&results) {
        std::fs::write(results.join(name), b"{").unwrap();
    }
    assert_eq!(reused(&[]), (0, vec![false; 3]));
}

#[test]
fn json_junit_and_html_reports_agree() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    change_pixel_block(&d.join("suite/pictures/box/box.png"));
    write(d, "suite/pictures/box/old.png", "left over");
    let (code, value) = json_report(d, &["suite", "--junit", "r.xml", "--html", "r.html"]);
    assert_eq!((code, &value["failed"], &value["passed"]), (1, &1.into(), &2.into()));
    assert_eq!(value["unused_pictures"], serde_json::json!(["suite/pictures/box/old.png"]));
    let measures = &value["sections"][0]["checks"][0]["picture"]["measures"];
    assert_eq!(measures["region"], serde_json::json!([40, 20, 4, 4]));
    let xml = String::from_utf8(read_file(d, "r.xml")).unwrap();
    assert!(
        xml.contains("<testsuites name=\"choreo test\" tests=\"3\" failures=\"1\" errors=\"0\""),
        "{xml}"
    );
    let html = String::from_utf8(read_file(d, "r.html")).unwrap();
    assert_eq!(html.matches("src=\"data:image/png").count(), 6);
    assert_eq!(part_files(d), Vec::<String>::new());
    for option in ["--junit", "--html"] {
        let run = run_tests(d, &["suite", option, "nowhere/r"]);
        assert_eq!(run.code, 3);
        assert!(run.err.contains("the folder nowhere does not exist"), "{}", run.err);
    }
}

#[test]
fn watch_runs_sections_again_when_their_file_is_saved() {
    let dir = suite_with_accepted_images();
    let d = dir.path();
    let mut child = command(d, &["test", "suite", "--watch", "--changed", "--html", "suite/r.html"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    // If the watch never wakes, it is ended after 15 minutes, so that `until` fails instead of hanging.
    let child = Arc::new(Mutex::new(child));
    let late = Arc::clone(&child);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(900));
        let _ = late.lock().unwrap().kill();
    });
    let mut until = |what: &str| -> String {
        lines.find(|line| line.contains(what)).unwrap_or_else(|| panic!("it ended without \"{what}\""))
    };
    until("watching ");
    write(d, "suite/box.rhai", &SUITE.replace("equals(2)", "equals(3)"));
    // The report that the command writes into the watched folder does not count as a change.
    assert_eq!(until("changed: "), "changed: suite/box.rhai");
    until("FAILED suite/box.rhai > numbers are numbers");
    until("watching ");
    // Editors save beside the file, then rename over it.
    write(d, "suite/box.rhai~", SUITE);
    std::fs::rename(d.join("suite/box.rhai~"), d.join("suite/box.rhai")).unwrap();
    until("changed: ");
    assert!(until(" passed").starts_with("3 passed (reused "));
    until("watching ");
    // A new test in a new folder.
    std::fs::create_dir(d.join("suite/new")).unwrap();
    write(d, "suite/new/t.rhai", "test(\"a\", || { expect(1).equals(1); });\n");
    until("ok     suite/new/t.rhai  1 section");
    let mut child = child.lock().unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
}

/// A script that is found in a folder is refused if it is a link out of the folder; a script that the user names is read.
#[test]
fn scripts_that_are_links_out_of_the_folder_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::create_dir(d.join("t")).unwrap();
    write(d, "secret", "secret words of somebody else");
    write(d, "t/a.rhai", "test(\"a\", || { expect(1).equals(1); });");
    std::os::unix::fs::symlink("a.rhai", d.join("t/b.rhai")).unwrap();
    assert_eq!(run_tests(d, &["t"]).code, 0);
    std::os::unix::fs::symlink("../secret", d.join("t/c.rhai")).unwrap();
    let run = run_tests(d, &["t"]);
    let expected = "t/c.rhai: it is a symbolic link that leads out of t; remove it, or name the file itself";
    assert!(run.code == 1 && run.err.contains(expected), "{} {}", run.code, run.err);
    assert!(!format!("{}{}", run.out, run.err).contains("words"), "{}", run.out);
    assert!(run_tests(d, &["t/c.rhai"]).out.contains("words"));
}

/// The time limit is checked in the script, in evaluated frames and between images; other sections continue.
#[test]
fn a_section_that_takes_too_long_fails_and_the_others_go_on() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    write(
        d,
        "slow.rhai",
        r#"
test("endless", || { let n = 0; while true { n += 1; } });
test("many looks", || {
    let a = cast("a", shape("box", #{ size: [1, 1, 1] }));
    on_frame(|t| { let n = 0; while n < 50000 { n += 1; } a.at(n, 0.0, 0.0); });
    stage(#{ length: 100.0 });
    expect(a).near([0.0, 0.0, 0.0], 1e9);
});
test("many images", || {
    cast("a", shape("box", #{ size: [1, 1, 1] }));
    camera("c").at(1.0, 1.6, 4.0).look_at([0.0, 0.6, 0.0]);
    for i in 0..2000 { expect_image(`p${i}`, #{ at: 0.0, size: [640, 360] }); }
});
test("quick", || { expect(1).equals(1); });
"#,
    );
    let started = std::time::Instant::now();
    let (code, report) = json_report(
        d,
        &[
            "slow.rhai",
            "--timeout",
            "1.5",
            "--limit",
            "frame_operations=1000000",
            // A fast machine must not reach the limit of steps first.
            "--limit",
            "operations=1000000000000",
        ],
    );
    assert_eq!(code, 1);
    assert!(started.elapsed() < Duration::from_secs(120));
    let all = report["sections"].as_array().unwrap();
    assert_eq!(all.len(), 4, "{report}");
    for section in all {
        let text = section.to_string();
        match section["section"].as_str().or(section["name"].as_str()).unwrap_or_default() {
            name if name.contains("quick") => assert!(text.contains("passed"), "{text}"),
            _ => assert!(text.contains("this section takes longer than 1.5 s"), "{text}"),
        }
    }
    let run = run_tests(
        d,
        &["slow.rhai", "--timeout", "0.5", "--filter", "endless", "--limit", "operations=1000000000000"],
    );
    assert!(run.out.contains("ERROR slow.rhai > endless\n  slow.rhai:2:"), "{}", run.out);
    assert!(
        run.out.contains("hint: make it shorter, or raise the time with --timeout SECONDS"),
        "{}",
        run.out
    );
}
