//! `choreo export` with a built-in exporter and with an exporter in a plugin file.

use crate::common::*;
use std::path::Path;

/// The triangle slides from x = 0 to x = 2 in one second, half a metre above the ground.
const SCRIPT: &str = "let t = load(\"tri.gltf\");\ncast(\"t\", t).play(t.clip(\"Slide\"));\n\
    stage(#{ length: 1.0, fps: 4 });\n";

fn project() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    std::fs::write(dir.path().join("a.rhai"), SCRIPT).unwrap();
    dir
}

fn text(folder: &Path, name: &str) -> String {
    String::from_utf8(read_file(folder, name)).unwrap()
}

#[test]
fn csv_export_has_the_keyed_joint_positions() {
    let dir = project();
    let d = dir.path();
    let run = choreo(d, &["export", "a.rhai", "-o", "a.csv", "--json"]);
    assert_eq!(run.code, 0, "{}", run.err);
    let summary: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!((&summary["frames"], &summary["exporter"]), (&4.into(), &"csv".into()), "{summary}");
    assert_eq!(summary["files"], serde_json::json!(["a.csv"]));
    assert_eq!(summary["provenance"]["Software"], format!("choreo {}", env!("CARGO_PKG_VERSION")));
    let lines = text(d, "a.csv");
    let expected = "seconds,actor,joint,x,y,z\n\
        0.000000,t,Root,0.000000,0.500000,0.000000\n0.000000,t,Slider,0.000000,0.500000,0.000000\n\
        0.250000,t,Root,0.000000,0.500000,0.000000\n0.250000,t,Slider,0.500000,0.500000,0.000000\n\
        0.500000,t,Root,0.000000,0.500000,0.000000\n0.500000,t,Slider,1.000000,0.500000,0.000000\n\
        0.750000,t,Root,0.000000,0.500000,0.000000\n0.750000,t,Slider,1.500000,0.500000,0.000000\n";
    assert_eq!(lines, expected);
    // A range of frames, another frame rate, and an option.
    let some = ["export", "a.rhai", "-o", "b.csv", "--frames", "3", "--fps", "8", "--export", "digits=2"];
    let run = choreo(d, &some);
    assert!(run.code == 0 && run.err.contains("1 frame in"), "{}", run.err);
    assert!(text(d, "b.csv").ends_with("0.375000,t,Slider,0.75,0.50,0.00\n"), "{}", text(d, "b.csv"));
    // A model can be exported without a script.
    let run = choreo(d, &["export", "tri.gltf", "-o", "m.csv", "--quiet"]);
    assert!(run.code == 0 && text(d, "m.csv").contains("Slider"), "{}", run.err);
}

#[test]
fn render_and_export_suggest_each_other_for_wrong_formats() {
    let dir = project();
    let d = dir.path();
    let run = choreo(d, &["export", "a.rhai", "-o", "a.png"]);
    assert!(run.code == 2 && run.err.contains("use choreo render to write images and videos"), "{}", run.err);
    let run = choreo(d, &["render", "a.rhai", "-o", "a.csv"]);
    assert!(run.code == 2 && run.err.contains("use choreo export"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "a.xyz"]);
    assert!(run.code == 2 && run.err.contains("known: .csv"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "a.fbx"]);
    assert!(
        run.code == 2 && run.err.contains("a.fbx: .fbx is read, not written; known: .csv"),
        "{}",
        run.err
    );
    let run = choreo(d, &["export", "a.rhai", "-o", "a.csv", "--export", "digits=99"]);
    assert!(run.code == 2 && run.err.contains("digits must be a number from 0 to 15"), "{}", run.err);
    assert_eq!(file_names(d), ["a.rhai", "tri.gltf"]);
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
        ("write_to(\"a.rhai\", \"gone\");", "is not a valid ending for an additional file"),
        ("write_to(\"_../../a\", \"gone\");", "is not a valid ending for an additional file"),
        ("write_to(\".two\", \"gone\");", "is not a valid ending for an additional file"),
    ] {
        write(body);
        let run = export();
        assert!(run.code == 3 && run.err.contains(message), "{body}: {}", run.err);
        assert_eq!(file_names(d), ["a.rhai", "tri.gltf", "two.exporter.rhai"], "{body}");
    }
    assert_eq!(text(d, "a.rhai"), SCRIPT);
    // The limits of scripts also apply to it.
    write("loop { write(\"0123456789\"); }");
    let run = choreo(d, &["export", "a.rhai", "-o", "out.two", "--limit", "output=1000"]);
    assert!(run.code == 3 && run.err.contains("the output is too large"), "{}", run.err);
    let run = choreo(d, &["export", "a.rhai", "-o", "out.csv", "--limit", "frames=3"]);
    assert!(run.code == 1 && run.err.contains("too many frames"), "{}", run.err);
    // If its extension is requested, the message names a faulty exporter.
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
fn export_does_not_overwrite_its_input() {
    let dir = project();
    let d = dir.path();
    std::fs::rename(d.join("tri.gltf"), d.join("tri.csv")).unwrap();
    let run = choreo(d, &["export", "tri.csv", "--importer", "gltf", "-o", "tri.csv"]);
    assert!(run.code == 3 && run.err.contains("is the input"), "{}", run.err);
    assert_eq!(text(d, "tri.csv"), triangle(1.0));
}

/// A scene with two cameras, a dissolve, a title and a marker.
const TALK: &str = "stage(#{ length: 3.0, fps: 25, size: [64, 36] });\n\
    let figure = load(\"choreo:mannequin\");\nlet ada = cast(\"ada\", figure).at(0.5, 0.0, -1.0).turn(30.0);\n\
    ada.play(figure.clip(\"Walk\")).until(1.5).then(figure.clip(\"Wave\"), #{ fade: 0.4 });\n\
    let wide = camera(\"wide\").at(0.0, 1.0, 6.0);\nlet close = camera(\"close\").at(0.0, 1.5, 2.0);\n\
    text(\"Hello\").from(0.5).until(1.5);\nmarker(\"beat\", 2.0);\n";
const CUTS: &str = "close.cut(1.0, #{ dissolve: 0.4 });\nwide.cut(2.2);\n";

fn export_text(folder: &Path, script: &str, output: &str) -> String {
    let run = choreo(folder, &["export", script, "-o", output]);
    assert_eq!(run.code, 0, "{}", run.err);
    text(folder, output)
}

#[test]
fn an_edited_otio_file_changes_the_cuts() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("a.rhai"), format!("{TALK}{CUTS}")).unwrap();
    let edl = export_text(d, "a.rhai", "a.edl");
    assert!(edl.contains("D    010 00:00:01:00 00:00:02:05"), "{edl}");
    let otio = export_text(d, "a.rhai", "a.otio");
    std::fs::write(d.join("b.rhai"), format!("{TALK}cuts(\"a.otio\");\n")).unwrap();
    assert_eq!(export_text(d, "b.rhai", "b.edl").replace("b.", "a."), edl);
    // Simulates an editor that makes the first shot five frames longer.
    let longer = otio.replacen("\"value\": 25.0", "\"value\": 30.0", 1);
    assert_ne!(longer, otio);
    std::fs::write(d.join("a.otio"), longer).unwrap();
    assert!(export_text(d, "b.rhai", "b.edl").contains("D    010 00:00:01:05 00:00:02:10"));
    // A camera that the script does not have, and a file that is not a timeline.
    std::fs::write(d.join("a.otio"), otio.replace("\"close\"", "\"clos\"")).unwrap();
    let run = choreo(d, &["export", "b.rhai", "-o", "b.edl"]);
    assert!(
        run.code != 0 && run.err.contains("unknown camera \"clos\" in \"a.otio\"; did you mean \"close\"?")
    );
    std::fs::write(d.join("a.otio"), "[1, 2").unwrap();
    let run = choreo(d, &["export", "b.rhai", "-o", "b.edl"]);
    assert!(run.err.contains("cuts: \"a.otio\" is not an OpenTimelineIO file"), "{}", run.err);
}

/// The independent reader of the format: the Python package opentimelineio.
#[test]
fn opentimelineio_reads_the_timeline() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("a.rhai"), format!("{TALK}{CUTS}")).unwrap();
    export_text(d, "a.rhai", "a.otio");
    let Some(python) = python_with("opentimelineio", "OpenTimelineIO==0.18.1") else { return };
    let code = "import opentimelineio as otio\nt = otio.adapters.read_from_file('a.otio')\n\
        assert t.duration() == otio.opentime.RationalTime(75, 25), t.duration()\n\
        for track in t.tracks:\n    for item in track:\n        if isinstance(item, otio.schema.Transition):\n            \
        print(track.name, 'transition', int(item.out_offset.value))\n        else:\n            \
        r = item.trimmed_range_in_parent()\n            \
        print(track.name, item.name, int(r.start_time.value), int(r.duration.value))\n\
        print([(m.name, m.marked_range.start_time.value) for m in t.tracks.markers])\n";
    let run = std::process::Command::new(python).args(["-c", code]).current_dir(d).output().unwrap();
    let printed = String::from_utf8_lossy(&run.stdout).into_owned();
    let expected = "shots wide 0 25\nshots transition 10\nshots close 25 30\nshots wide 55 20\n\
        titles  0 13\ntitles Hello 13 25\nada Walk 0 38\nada transition 10\nada Wave 38 37\n[('beat', 50.0)]\n";
    assert_eq!(printed, expected, "{}", String::from_utf8_lossy(&run.stderr));
}

#[test]
fn an_exported_bvh_file_reproduces_the_motion() {
    let dir = folder_with_triangle();
    let d = dir.path();
    std::fs::write(d.join("a.rhai"), TALK).unwrap();
    export_text(d, "a.rhai", "a.bvh");
    let again = "stage(#{ length: 3.0, fps: 25 });\nlet b = load(\"a.bvh\", #{ scale: 0.01 });\n\
        cast(\"ada\", b).play(b.clip(\"a\"), #{ repeat: \"once\" });\n";
    std::fs::write(d.join("b.rhai"), again).unwrap();
    let positions = |script: &str, output: &str| -> Vec<(String, [f64; 3])> {
        let text = export_text(d, script, output);
        let line = |line: &str| {
            let (rest, z) = line.rsplit_once(',').unwrap();
            let (rest, y) = rest.rsplit_once(',').unwrap();
            let (key, x) = rest.rsplit_once(',').unwrap();
            (key.to_string(), [x, y, z].map(|number| number.parse().unwrap()))
        };
        text.lines().skip(1).map(line).collect()
    };
    let truth = positions("a.rhai", "a.csv");
    let read: std::collections::BTreeMap<_, _> = positions("b.rhai", "b.csv").into_iter().collect();
    let off = |(key, a): &(String, [f64; 3])| {
        let b = read.get(key).unwrap_or_else(|| panic!("{key}"));
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let worst = truth.iter().map(off).fold(0.0, f64::max);
    println!("{} positions, at most {worst:.1e} m off", truth.len());
    assert!(truth.len() > 75 * 15 && worst < 4e-6, "{worst}");
}

/// Python code with OpenTimelineIO stands in for an editor: files that it reads and writes have the same cuts, except those that it moves.
#[test]
fn cuts_survive_a_round_trip_through_opentimelineio() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let Some(python) = python_with("opentimelineio", "OpenTimelineIO==0.18.1") else { return };
    std::fs::write(d.join("a.rhai"), format!("{TALK}{CUTS}")).unwrap();
    std::fs::write(d.join("b.rhai"), format!("{TALK}cuts(\"edit.otio\");\n")).unwrap();
    let edl = export_text(d, "a.rhai", "a.edl");
    export_text(d, "a.rhai", "a.otio");
    let edited = |frames: u32| {
        let code = format!(
            "import opentimelineio as otio\nt = otio.adapters.read_from_file('a.otio')\n\
             wide = t.video_tracks()[0][0]\nkept = wide.source_range\n\
             longer = kept.duration + otio.opentime.RationalTime({frames}, 25)\n\
             wide.source_range = otio.opentime.TimeRange(kept.start_time, longer)\n\
             otio.adapters.write_to_file(t, 'edit.otio')\n"
        );
        let run = std::process::Command::new(&python).args(["-c", &code]).current_dir(d).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        export_text(d, "b.rhai", "b.edl").replace("b.", "a.")
    };
    assert_eq!(edited(0), edl);
    let later = edited(5);
    assert!(later.contains("D    010 00:00:01:05 00:00:02:10"), "{later}");
}

/// Joints in Blender's BVH importer, whose first frame is 1, are where `choreo export` to CSV has them, at every frame.
#[test]
fn bvh_joints_imported_by_blender_match_the_scene() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let Some(python) = blender() else { return };
    std::fs::write(d.join("a.rhai"), TALK).unwrap();
    export_text(d, "a.rhai", "a.bvh");
    let truth = export_text(d, "a.rhai", "a.csv");
    let code = "import bpy, json\nbpy.ops.wm.read_factory_settings(use_empty=True)\nscene = bpy.context.scene\n\
        bpy.ops.import_anim.bvh(filepath='a.bvh', global_scale=0.01, rotate_mode='QUATERNION')\n\
        rig = next(o for o in scene.objects if o.type == 'ARMATURE')\nout = {bone.name: [] for bone in rig.pose.bones}\n\
        for frame in range(75):\n    scene.frame_set(frame + 1)\n    for bone in rig.pose.bones:\n        \
        x, y, z = rig.matrix_world @ bone.head\n        out[bone.name].append([x, z, -y])\n\
        print('RESULT ' + json.dumps(out))\n";
    let run = std::process::Command::new(python).args(["-c", code]).current_dir(d).output().unwrap();
    let printed = String::from_utf8_lossy(&run.stdout);
    let result = printed.lines().find_map(|line| line.strip_prefix("RESULT "));
    let result = result.unwrap_or_else(|| panic!("{printed}{}", String::from_utf8_lossy(&run.stderr)));
    let bones: serde_json::Value = serde_json::from_str(result).unwrap();
    let worst = |delay: usize| {
        let (mut worst, mut count) = (0.0f64, 0);
        for line in truth.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |cell: &str| cell.parse::<f64>().unwrap();
            let frame = (number(cells[0]) * 25.0).round() as usize + delay;
            // End sites are not bones.
            let Some(found) = bones[cells[2]][frame].as_array() else { continue };
            let apart = found.iter().zip(&cells[3..]).map(|(a, b)| (a.as_f64().unwrap() - number(b)).powi(2));
            (worst, count) = (worst.max(apart.sum::<f64>().sqrt()), count + 1);
        }
        (worst, count)
    };
    let (metres, count) = worst(0);
    println!("Blender: {count} places, {metres:.1e} m");
    assert!(count > 75 * 15 && metres < 1e-5, "{count} places, {metres:e} m");
    assert!(worst(1).0 > 1e-2, "a frame late is not found");
}
