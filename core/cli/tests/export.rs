//! `choreo export`: a scene for another program, by the built-in exporter and by one in a file.

mod common;

use common::*;
use std::path::Path;

/// The triangle slides from x = 0 to x = 2 in one second, half a metre above the ground.
const SCRIPT: &str = "let t = load(\"tri.gltf\");\ncast(\"t\", t).play(t.clip(\"Slide\"));\n\
    stage(#{ length: 1.0, fps: 4 });\n";

fn project() -> tempfile::TempDir {
    let dir = folder();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    dir
}

fn text(folder: &Path, name: &str) -> String {
    String::from_utf8(read(folder, name)).unwrap()
}

#[test]
fn joints_are_where_the_keys_put_them_at_each_frame() {
    let dir = project();
    let d = dir.path();
    let run = choreo(d, &["export", "a.rhai", "-o", "a.csv", "--json"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let made: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((&made["frames"], &made["exporter"]), (&4.into(), &"csv".into()), "{made}");
    assert_eq!(made["files"], serde_json::json!(["a.csv"]));
    assert_eq!(made["provenance"]["Software"], format!("choreo {}", env!("CARGO_PKG_VERSION")));
    let lines = text(d, "a.csv");
    let expected = "seconds,actor,joint,x,y,z\n\
        0.000000,t,Root,0.000000,0.500000,0.000000\n0.000000,t,Slider,0.000000,0.500000,0.000000\n\
        0.250000,t,Root,0.000000,0.500000,0.000000\n0.250000,t,Slider,0.500000,0.500000,0.000000\n\
        0.500000,t,Root,0.000000,0.500000,0.000000\n0.500000,t,Slider,1.000000,0.500000,0.000000\n\
        0.750000,t,Root,0.000000,0.500000,0.000000\n0.750000,t,Slider,1.500000,0.500000,0.000000\n";
    assert_eq!(lines, expected);
    // Some frames, another rate, an option.
    let some = ["export", "a.rhai", "-o", "b.csv", "--frames", "3", "--fps", "8", "--export", "digits=2"];
    let run = choreo(d, &some);
    assert!(run.code == 0 && run.err.contains("1 frames in"), "{}", run.err);
    assert!(text(d, "b.csv").ends_with("0.375000,t,Slider,0.75,0.50,0.00\n"), "{}", text(d, "b.csv"));
    // A model needs no script.
    let run = choreo(d, &["export", "tri.gltf", "-o", "m.csv", "--quiet"]);
    assert!(run.code == 0 && text(d, "m.csv").contains("Slider"), "{}", run.err);
}

#[test]
fn images_and_scenes_name_each_others_command() {
    let dir = project();
    let d = dir.path();
    let run = choreo(d, &["export", "a.rhai", "-o", "a.png"]);
    assert!(run.code == 2 && run.err.contains("images and videos are made by choreo render"), "{}", run.err);
    let run = choreo(d, &["render", "a.rhai", "-o", "a.csv"]);
    assert!(run.code == 2 && run.err.contains("by choreo export"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "a.xyz"]);
    assert!(run.code == 2 && run.err.contains("known: .csv"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "a.csv", "--export", "digits=99"]);
    assert!(run.code == 2 && run.err.contains("digits must be a number from 0 to 15"), "{}", run.err);
    assert_eq!(names(d), ["a.rhai", "tri.gltf"]);
}

#[test]
fn an_exporter_in_a_file_writes_all_its_files_or_none() {
    let dir = project();
    let d = dir.path();
    let write = |body: &str| {
        let text = format!(
            "fn manifest() {{ #{{ name: \"two\", extensions: \"two\" }} }}\nfn save(scene) {{\n{body}\n}}\n"
        );
        std::fs::write(d.join("two.exporter.rhai"), text).unwrap();
    };
    let export = || choreo(d, &["export", "a.rhai", "-o", "out.two"]);
    write("write(scene.times.len.to_string()); write_to(\"_b.txt\", \"beside\"); note(\"no colors\");");
    let run = export();
    assert!(run.code == 0 && run.err.contains("note: no colors"), "{}", run.err);
    assert_eq!((text(d, "out.two"), text(d, "out_b.txt")), ("4".into(), "beside".into()));
    assert!(choreo(d, &["plugins"]).out.contains("two"));
    std::fs::remove_file(d.join("out.two")).unwrap();
    std::fs::remove_file(d.join("out_b.txt")).unwrap();
    for (body, message) in [
        ("write(\"a\"); write_to(\"_b.txt\", \"b\"); throw \"enough\";", "two.exporter.rhai:3:"),
        ("write_to(\"a.rhai\", \"gone\");", "is no ending of a file beside it"),
        ("write_to(\"_../../a\", \"gone\");", "is no ending of a file beside it"),
        ("write_to(\".two\", \"gone\");", "is no ending of a file beside it"),
    ] {
        write(body);
        let run = export();
        assert!(run.code == 3 && run.err.contains(message), "{body}: {}", run.err);
        assert_eq!(names(d), ["a.rhai", "tri.gltf", "two.exporter.rhai"], "{body}");
    }
    assert_eq!(text(d, "a.rhai"), SCRIPT);
    // Limits hold for it, too.
    write("loop { write(\"0123456789\"); }");
    let run = choreo(d, &["export", "a.rhai", "-o", "out.two", "--limit", "output=1000"]);
    assert!(run.code == 3 && run.err.contains("the output is too large"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "out.csv", "--limit", "frames=3"]);
    assert!(run.code == 1 && run.err.contains("too many frames"), "{}", run.err);
    // A faulty one is named where its extension is asked for.
    write("write(");
    let run = export();
    assert!(
        run.code == 2 && run.err.contains("no plugin: ./two.exporter.rhai:4:1: Syntax error"),
        "{}",
        run.err
    );
    let run = choreo(d, &["plugins"]);
    assert!(run.code == 1 && run.err.contains("two.exporter.rhai:"), "{}", run.err);
}

#[test]
fn an_input_is_not_replaced() {
    let dir = project();
    let d = dir.path();
    std::fs::rename(d.join("tri.gltf"), d.join("tri.csv")).unwrap();
    let run = choreo(d, &["export", "tri.csv", "--importer", "gltf", "-o", "tri.csv"]);
    assert!(run.code == 3 && run.err.contains("is the input"), "{}", run.err);
    assert_eq!(text(d, "tri.csv"), triangle(1.0));
}
