//! The commands `info`, `explain`, `check`, `pose` and `plugins` on valid input.

use crate::common::*;
use serde_json::Value;

fn json_output(folder: &std::path::Path, args: &[&str]) -> Value {
    let run = choreo(folder, args);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

#[test]
fn pose_prints_joints_in_world_space() {
    let dir = folder_with_triangle();
    let value = json_output(dir.path(), &["pose", "tri.gltf", "--at", "0.25", "--json"]);
    let joints = value["actors"][0]["joints"].as_array().unwrap();
    let joint = |name: &str| joints.iter().find(|j| j["name"] == name).unwrap();
    let slider = joint("Slider");
    let parent = slider["parent"].as_u64().unwrap() as usize;
    assert_eq!(joints[parent]["name"], "Root");
    let matrix: Vec<f64> =
        slider["world_from_joint"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    // The clip moves from x = 0 to 2 in a second; the root stands half a metre up.
    let expected = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0.5, 0.5, 0., 1.];
    assert!(matrix.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{matrix:?}");
}

#[test]
fn pose_writes_meshes_in_the_file_s_vertex_order() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["pose", "tri.gltf", "--at", "1", "--mesh", "o.obj", "--clip", "Slide"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(part_files(dir.path()), Vec::<String>::new());
    let obj = String::from_utf8(read_file(dir.path(), "o.obj")).unwrap();
    let vertices: Vec<Vec<f64>> = obj
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| l.split(' ').map(|n| n.parse().unwrap()).collect())
        .collect();
    let expected = [[3.0, 0.5, 0.0], [2.0, 1.5, 0.0], [1.0, 0.5, 0.0]];
    assert_eq!(vertices.len(), 3);
    for (v, e) in vertices.iter().zip(expected) {
        assert!(v.iter().zip(e).all(|(a, b)| (a - b).abs() < 1e-6), "{vertices:?}");
    }
    assert!(obj.lines().any(|l| l == "f 1//1 2//2 3//3"), "{obj}");
}

#[test]
fn info_counts_the_contents_of_a_file() {
    let dir = folder_with_triangle();
    let value = json_output(dir.path(), &["info", "tri.gltf", "--json", "--joints"]);
    assert_eq!(
        (&value["vertices"], &value["triangles"], &value["joints"]),
        (&3.into(), &1.into(), &2.into())
    );
    assert_eq!(value["clips"][0]["name"], "Slide");
    assert_eq!(value["clips"][0]["seconds"], 1.0);
    assert_eq!(value["extents"], serde_json::json!([[-1.0, 0.5, 0.0], [1.0, 1.5, 0.0]]));
    let run = choreo(dir.path(), &["info", "tri.gltf", "--joints"]);
    assert!(run.out.contains("\n  Root\n    Slider\n"), "{}", run.out);
}

#[test]
fn explain_lists_what_the_plan_leaves_out() {
    let dir = folder_with_triangle();
    let value = json_output(dir.path(), &["explain", "tri.gltf", "--json"]);
    assert_eq!(value["frame"]["draws"], 1);
    let left: Vec<&str> =
        value["left_out"].as_array().unwrap().iter().map(|l| l["what"].as_str().unwrap()).collect();
    assert!(left.contains(&"skinning") && left.contains(&"morph targets"), "{left:?}");
    let run = choreo(dir.path(), &["explain", "tri.gltf"]);
    let out: Vec<String> =
        run.out.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    assert!(out.contains(&"skinning no mesh has a skin".to_string()), "{}", run.out);
    // Three positions of 12 bytes and normals of 8, three 16-bit indices; requested by the one actor there is.
    let mesh = value["in"].as_array().unwrap().iter().find(|p| p["kind"] == "mesh").unwrap();
    assert_eq!(
        (mesh["bytes"].as_u64(), mesh["asked_by"]["actors"][0]["name"].as_str()),
        (Some(66), Some("model")),
        "{mesh}"
    );
    assert!(
        out.iter().any(|l| l.starts_with("mesh \"Tri\" 0: 3 vertices of 20 bytes, 3 indices 66.0 B model")),
        "{}",
        run.out
    );
}

#[test]
fn explain_states_the_number_of_motion_blur_sub_frames_and_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let script = |turn: f64| {
        format!(
            "stage(#{{ size: [64, 64], length: 1.0 }});\n\
             let box = cast(\"box\", shape(\"box\", #{{ size: 1.0 }}));\n\
             box.key(\"rotation\", [[0.0, [0.0, 0.0, 0.0]], [1.0, [0.0, {turn:.1}, 0.0]]]);\n\
             effect(\"motion_blur\");\n\
             camera(\"front\").at(0.0, 0.0, 4.0).look_at([0.0, 0.0, 0.0]);\n"
        )
    };
    for (turn, expected) in [
        (0.0, "blur       1 sub-frame: nothing visible moves while the shutter is open"),
        (400.0, "blur       2 sub-frames: nothing moves by more than 1."),
        (20000.0, "blur       16 sub-frames: something moves by "),
    ] {
        std::fs::write(dir.path().join("s.rhai"), script(turn)).unwrap();
        let run = choreo(dir.path(), &["explain", "s.rhai", "--at", "0.5"]);
        assert!(run.out.contains(expected), "{turn}: {}", run.out);
    }
}

/// The draws and memory of a pass are listed with the name of the pass. A pass that is not requested costs nothing.
#[test]
fn explain_states_the_cost_of_each_pass() {
    let dir = tempfile::tempdir().unwrap();
    let script = "stage(#{ size: [64, 36], length: 1.0, samples: 4 });\ncast(\"box\", shape(\"box\"));\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let costs = |passes: &[&str]| -> Vec<(String, String, u64)> {
        let value = json_output(dir.path(), &[&["explain", "s.rhai", "--json"], passes].concat());
        let parts = value["in"].as_array().unwrap();
        let asked = |p: &serde_json::Value| p["asked_by"]["other"].as_str().unwrap_or_default().to_string();
        let row = |p: &serde_json::Value| {
            (asked(p), p["what"].as_str().unwrap().to_string(), p["bytes"].as_u64().unwrap_or(0))
        };
        parts.iter().map(row).filter(|(asked, ..)| asked.contains("pass")).collect()
    };
    assert_eq!(costs(&[]), []);
    let all = costs(&["--passes", "color,depth,normal,motion,albedo,id"]);
    // Bytes of a pixel: floats, and two kinds of ids with their shares for each of four samples.
    for (pass, bytes) in
        [("color", 16), ("depth", 4), ("normal", 12), ("motion", 8), ("albedo", 16), ("id", 2 * 8 * 4)]
    {
        let own = all.iter().filter(|(by, ..)| *by == format!("the pass {pass}"));
        assert_eq!(own.map(|(.., bytes)| bytes).sum::<u64>(), bytes * 64 * 36, "{pass}: {all:?}");
    }
    let draws = |text: &str| all.iter().any(|(_, what, _)| what.contains(text));
    assert!(draws("base colors without light: 1 draw, 4 samples per pixel"), "{all:?}");
    assert!(draws("actors and materials: 1 draw, 4 times, 1 sample per pixel each"), "{all:?}");
    assert!(draws("depth, normals, motion vectors and actors for passes: 1 draw"), "{all:?}");
    let one = costs(&["--passes", "depth"]);
    assert!(one.iter().all(|(by, ..)| by == "the pass depth" || by == "the passes of the frame"), "{one:?}");
}

/// The shadow map has no materials: what the box alone requests does not list the materials of the figure, which come first in the
/// scene. The tables fit the width of the terminal.
#[test]
fn explain_names_only_the_materials_that_an_actor_uses() {
    let dir = folder_with_triangle();
    let script = "sun(#{ shadow: true });\nlet m = load(\"choreo:mannequin\");\ncast(\"figure\", m);\n\
        cast(\"box\", shape(\"box\")).at(1, 0, 0);\ncamera(\"c\").at(0, 1, 5).look_at([0, 1, 0]);";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let value = json_output(dir.path(), &["explain", "s.rhai", "--json"]);
    let of_box = |part: &&serde_json::Value| {
        let actors = part["asked_by"]["actors"].as_array().unwrap();
        actors.len() == 1 && actors[0]["name"] == "box"
    };
    let parts: Vec<_> = value["in"].as_array().unwrap().iter().filter(of_box).collect();
    let shadowed = |part: &&&serde_json::Value| part["what"].as_str().unwrap().contains("SHADOW_PASS");
    assert!(parts.iter().any(|part| shadowed(&part)), "{parts:?}");
    for part in parts {
        let materials = part["asked_by"]["materials"].as_array().unwrap();
        assert!(materials.iter().all(|name| name == "shape"), "{part}");
    }
    for columns in ["80", "120"] {
        let run =
            run_result(command(dir.path(), &["explain", "s.rhai"]).env("COLUMNS", columns).output().unwrap());
        let table: Vec<&str> = run.out.lines().skip_while(|line| !line.contains("requested by")).collect();
        assert!(
            table.len() > 20 && table.iter().all(|line| line.chars().count() <= columns.parse().unwrap())
        );
    }
    let mut piped = command(dir.path(), &["explain", "s.rhai"]);
    let run = run_result(piped.env_remove("COLUMNS").output().unwrap());
    assert!(run.out.lines().any(|line| line.chars().count() > 120), "{}", run.out);
}

#[test]
fn explain_states_the_script_line_that_requests_a_feature() {
    let dir = tempfile::tempdir().unwrap();
    let script = "stage(#{ length: 1.0 });\nlet m = load(\"choreo:mannequin\");\ncast(\"ada\", m).play(m.clip(\"Walk\"));\n\
                  cast(\"box\", shape(\"box\")).at(1.0, 0.0, 0.0);\neffect(\"vignette\");\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let value = json_output(dir.path(), &["explain", "s.rhai", "--json"]);
    let part = |kind: &str, what: &str| {
        let parts = value["in"].as_array().unwrap();
        parts
            .iter()
            .find(|p| p["kind"] == kind && p["what"].as_str().unwrap().contains(what))
            .unwrap()
            .clone()
    };
    let skin = part("feature", "SKIN");
    assert_eq!(
        skin["asked_by"]["actors"],
        serde_json::json!([{ "name": "ada", "file": "s.rhai", "line": 3, "column": 1 }])
    );
    assert_eq!(part("pass", "vignette")["asked_by"]["effects"][0], "vignette");
    let run = choreo(dir.path(), &["explain", "s.rhai", "--plot", "in.svg"]);
    assert!(run.out.contains("ada (line 3)") && run.out.contains("effect vignette (line 5)"), "{}", run.out);
    assert!(std::fs::read_to_string(dir.path().join("in.svg")).unwrap().starts_with("<svg "));
    assert_eq!(choreo(dir.path(), &["explain", "s.rhai", "--plot", "s.rhai"]).code, 2);
    assert_eq!(std::fs::read_to_string(dir.path().join("s.rhai")).unwrap(), script);
}

#[test]
fn measure_reports_every_numerical_choice_with_its_reason() {
    let dir = tempfile::tempdir().unwrap();
    let script = "stage(#{ size: [64, 48], length: 2.0 });\nlet m = load(\"choreo:mannequin\");\n\
                  cast(\"ada\", m).play(m.clip(\"Walk\")).until(1.0).then(m.clip(\"Run\"), #{ fade: 0.4 });\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let value =
        json_output(dir.path(), &["measure", "s.rhai", "--device", "cpu", "--json", "--plot", "m.svg"]);
    let choices = value["choices"].as_array().unwrap();
    let named: Vec<&str> = choices.iter().map(|c| c["choice"].as_str().unwrap()).collect();
    assert_eq!(named, ["bake", "crossfade", "skinning", "normals", "weights", "renderer", "video"]);
    for choice in choices {
        assert!(choice["chosen"].is_string() && !choice["why"].as_str().unwrap().is_empty(), "{choice}");
        for row in choice["rows"].as_array().unwrap() {
            assert!(
                row["worst"].is_number() && (row["nanos"].is_number() || row["bytes"].is_number()),
                "{row}"
            );
        }
    }
    // Keys as authored are exact to f32; a baked clip is not; slerp is nearer to the truth than nlerp, and the corrected
    // nlerp, which blends use, in between.
    let worst = |choice: usize, row: usize| choices[choice]["rows"][row]["worst"].as_f64().unwrap();
    assert!(worst(0, 0) < 0.01 && worst(0, 1) > worst(0, 0), "{}", choices[0]);
    assert!(worst(1, 2) < worst(1, 1) && worst(1, 1) < worst(1, 0), "{}", choices[1]);
    // Dual quaternions are near the mean motion of the joints; the skinning that runs is not compared with itself.
    assert!(worst(2, 0) > 10.0 * worst(2, 1) && worst(2, 1) < 1.0, "{}", choices[2]);
    let left_out: Vec<&str> =
        value["left_out"].as_array().unwrap().iter().map(|l| l["what"].as_str().unwrap()).collect();
    assert_eq!(left_out, ["springs", "ik", "mips", "sky", "shadows", "motion_blur", "tones"]);
    assert!(std::fs::read_to_string(dir.path().join("m.svg")).unwrap().matches("<svg ").count() >= 6);
    let run = choreo(dir.path(), &["measure", "s.rhai", "--only", "bakes"]);
    assert_eq!(run.code, 2);
    assert!(run.err.contains("did you mean \"bake\"?"), "{}", run.err);
}

#[test]
fn measure_compares_springs_ik_sky_maps_and_tone_curves() {
    let dir = tempfile::tempdir().unwrap();
    let flag = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/models/flag.gltf");
    std::fs::copy(flag, dir.path().join("flag.gltf")).unwrap();
    let script = r##"
        stage(#{ size: [64, 48], length: 1.0, view: "agx" });
        sky("studio");
        let flag = load("flag.gltf");
        let moved = [[0.0, [0, 0, 0]], [0.3, [0.5, 0.2, 0]], [0.6, [0, 0, 0.5]]];
        cast("cloth", flag).key("position", moved).spring("Cloth1..", #{ frequency: 3.0, damping: 0.2 });
        cast("arm", flag).at(2, 0, 0).reach("Cloth9", [1.9, 1.4, 0.3], #{ root: "Cloth1" }).fade(0.0);
    "##;
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let mut arguments = vec!["measure", "s.rhai", "--device", "cpu", "--json"];
    arguments.extend(["springs", "ik", "sky", "tones"].iter().flat_map(|key| ["--only", key]));
    let value = json_output(dir.path(), &arguments);
    let choices = value["choices"].as_array().unwrap();
    let named: Vec<&str> = choices.iter().map(|c| c["choice"].as_str().unwrap()).collect();
    assert_eq!(named, ["springs", "ik", "sky_maps", "sky_diffuse", "agx"]);
    let error = |choice: usize, way: &str, which: &str| {
        let rows = choices[choice]["rows"].as_array().unwrap();
        let row = rows.iter().find(|row| row["way"] == way).unwrap_or_else(|| panic!("{way}: {rows:?}"));
        row[which].as_f64().unwrap()
    };
    // Springs converge with shorter steps, chains with more iterations, maps with more samples; the sigmoid itself is exact.
    let springs = [30, 60, 120, 240].map(|rate| error(0, &format!("{rate} steps a second"), "worst"));
    assert!(springs.is_sorted_by(|a, b| a > b) && springs[3] > 0.0, "{springs:?} mm");
    let chain = |way: &str| error(1, way, "worst");
    assert!(chain("CCD, 4 iterations") > 1.0 && chain("damped least squares, 64 iterations") < 0.1);
    let sky = |way: &str| error(2, way, "mean");
    let coarse = sky("64 texels a side, 4 roughnesses, 16 samples");
    assert!(coarse > 2.0 * sky("256 texels a side, 8 roughnesses, 256 samples"), "{coarse}");
    let tone = |way: &str| error(4, way, "worst");
    assert!(tone("exact sigmoid in f64 via pow") < 1e-3 && tone("polynomial of degree 6 (Wrensch)") > 0.1);
}

#[test]
fn measure_compares_shadows_and_sub_frames() {
    let dir = tempfile::tempdir().unwrap();
    let script = r##"
        stage(#{ size: [96, 64], length: 1.0 });
        let m = load("choreo:mannequin");
        cast("ada", m).play(m.clip("Dance_Spin"));
        cast("floor", shape("plane", #{ size: 6.0 }));
        camera("c").at(1.5, 1.5, 4.0).look_at([0.0, 0.8, 0.0]);
        sun(#{ direction: [-1.0, -1.2, -0.6], shadow: true });
        effect("motion_blur", #{ samples: 8 });
    "##;
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let arguments = [
        "measure",
        "s.rhai",
        "--device",
        "cpu",
        "--json",
        "--at",
        "0.6",
        "--only",
        "shadows",
        "--only",
        "motion_blur",
    ];
    let value = json_output(dir.path(), &arguments);
    let choices = value["choices"].as_array().unwrap();
    let named: Vec<&str> = choices.iter().map(|c| c["choice"].as_str().unwrap()).collect();
    assert_eq!(named, ["shadows", "motion_blur"]);
    let error = |choice: usize, way: &str| {
        let rows = choices[choice]["rows"].as_array().unwrap();
        let row = rows.iter().find(|row| row["way"] == way).unwrap_or_else(|| panic!("{way}: {rows:?}"));
        assert!(row["nanos"].as_f64().unwrap() > 0.0, "{row}");
        row["mean"].as_f64().unwrap()
    };
    let shadows = [64, 256].map(|size| error(0, &format!("{size} texels a side")));
    assert!(shadows[0] > 1.02 * shadows[1] && shadows[1] > 0.0, "{shadows:?}");
    let blur = ["1 sub-frame", "4 sub-frames", "16 sub-frames", "64 sub-frames"].map(|way| error(1, way));
    assert!(blur.windows(2).all(|pair| pair[0] > 1.5 * pair[1]), "{blur:?}");
    assert_eq!(
        [&choices[0]["chosen"], &choices[1]["chosen"]],
        ["2048 texels a side", "as many as moving pixels need, at most 8"]
    );
}

#[test]
fn walk_to_conflicts_with_other_positions_and_rotations() {
    let dir = tempfile::tempdir().unwrap();
    let script = "let m = load(\"choreo:mannequin\");\nlet a = cast(\"a\", m).at(0, 0, 1);\na.play(m.clip(\"Idle\"));\n\
                  a.walk_to([2, 0, 0]);\na.face([0, 0, 5]);\na.turn(90);\na.at(1, 0, 0);\n\
                  a.key(\"rotation\", [[0.0, 0.0], [1.0, 90.0]]);\na.key(\"tint\", [[0.0, \"red\"]]);\n\
                  a.look_at([0, 1, 5], #{ from: 1.0, until: 2.0, fade: 0.1 });\n";
    std::fs::write(dir.path().join("s.rhai"), script).unwrap();
    let run = choreo(dir.path(), &["check", "s.rhai"]);
    for (line, call) in [(5, "face"), (6, "turn"), (7, "at"), (8, "key")] {
        let error =
            format!("s.rhai:{line}:3: {call}: walk_to sets position and rotation of the actor already");
        assert!(run.err.contains(&error) || run.out.contains(&error), "{call}: {}{}", run.out, run.err);
    }
    assert!(!run.out.contains("s.rhai:9") && !run.err.contains("s.rhai:1"), "{}{}", run.out, run.err);
}

#[test]
fn plugins_and_help_list_all_plugins_and_exit_codes() {
    let dir = folder_with_triangle();
    let value = json_output(dir.path(), &["plugins", "--json"]);
    let names = |kind: &str| -> Vec<String> {
        value[kind].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap().to_string()).collect()
    };
    let known = choreo::registry();
    assert_eq!(
        names("exporters"),
        known.exporters().iter().map(|p| p.manifest().name.to_string()).collect::<Vec<_>>()
    );
    assert!(names("importers").contains(&"gltf".into()));
    let help = choreo(dir.path(), &["--help"]);
    assert_eq!(help.code, 0);
    for code in ["0    done", "1    ", "2    ", "3    ", "4    ", "130  ", "141  "] {
        assert!(help.out.contains(code), "{}", help.out);
    }
}

#[test]
fn a_script_is_checked_posed_and_rendered() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let script = "stage(#{ size: [96, 54], fps: 10, length: 1.0 });\n\
                  let tri = load(\"tri.gltf\");\n\
                  let a = cast(\"a\", tri).at(1.0, 0.0, 0.0);\n\
                  a.play(tri.clip(\"Slide\"));\n";
    std::fs::write(d.join("s.rhai"), script).unwrap();
    let run = choreo(d, &["check", "s.rhai"]);
    assert_eq!((run.code, run.out.as_str()), (0, "s.rhai: good, 10 frames, no warnings\n"), "{}", run.err);
    let value = json_output(d, &["pose", "s.rhai", "--at", "0.5", "--json"]);
    assert_eq!(value["actors"][0]["name"], "a");
    assert_eq!(value["actors"][0]["world_from_model"][12], 1.0);
    let run = choreo(d, &["render", "s.rhai", "-o", "f/%d.png", "--device", "cpu", "--quiet"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!(file_names(&d.join("f")).len(), 10);
}

#[test]
fn plugins_for_a_file_lists_the_claim_of_each_importer() {
    let dir = folder_with_triangle();
    std::fs::write(dir.path().join("what.dat"), "?").unwrap();
    let run = choreo(dir.path(), &["plugins", "--for", "tri.gltf"]);
    assert!(
        run.out.starts_with("tri.gltf: read by gltf\n  gltf         by content, 95 of 100\n"),
        "{}",
        run.out
    );
    assert!(run.out.contains("  mannequin    not mine\n"), "{}", run.out);
    let run = choreo(dir.path(), &["plugins", "--for", "what.dat"]);
    assert!(run.out.starts_with("what.dat: no importer knows this kind of file\n"), "{}", run.out);
    let value = json_output(dir.path(), &["plugins", "--for", "tri.gltf", "--json"]);
    assert_eq!(value["read_by"], "gltf");
    assert_eq!(
        value["claims"][0],
        serde_json::json!({ "importer": "gltf", "claim": "content", "score": 95 })
    );
}

#[test]
fn import_options_of_model_files_come_from_the_manifest() {
    let dir = folder_with_triangle();
    for command in [&["info"][..], &["check"], &["pose"]] {
        let with = |more: &[&str]| choreo(dir.path(), &[command, &["tri.gltf"], more].concat());
        assert_eq!(with(&["--import", "scene=0", "--importer", "gltf"]).code, 0);
        let run = with(&["--import", "scene=-7"]);
        assert_eq!(run.code, 1);
        assert!(
            run.err.contains("importer gltf: option scene must be a number from -1 to 65535, got \"-7\""),
            "{}",
            run.err
        );
        let run = with(&["--import", "scen=1"]);
        assert!(
            run.err.contains("importer gltf has no option \"scen\"; did you mean \"scene\"?"),
            "{}",
            run.err
        );
        let run = with(&["--importer", "gtlf"]);
        assert!(
            run.err.contains("tri.gltf: unknown importer \"gtlf\"; did you mean \"gltf\"?"),
            "{}",
            run.err
        );
    }
}

/// A character of 17 joints as BVH with two frames. `names` are the names of the joints from the hips down, depth first.
fn body_bvh(names: [&str; 17]) -> String {
    let places = [
        (0, "0 90 0"),
        (1, "0 20 0"),
        (2, "0 40 0"),
        (2, "20 30 0"),
        (3, "30 0 0"),
        (4, "25 0 0"),
        (2, "-20 30 0"),
        (3, "-30 0 0"),
        (4, "-25 0 0"),
        (1, "10 0 0"),
        (2, "0 -42 0"),
        (3, "0 -40 0"),
        (4, "0 -6 15"),
        (1, "-10 0 0"),
        (2, "0 -42 0"),
        (3, "0 -40 0"),
        (4, "0 -6 15"),
    ];
    let mut text = String::from("HIERARCHY\n");
    for (i, (name, (depth, place))) in names.iter().zip(places).enumerate() {
        let kind = if i == 0 { "ROOT" } else { "JOINT" };
        text += &format!("{kind} {name}\n{{\nOFFSET {place}\n");
        text += match i {
            0 => "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n",
            _ => "CHANNELS 3 Zrotation Xrotation Yrotation\n",
        };
        let next = places.get(i + 1).map_or(0, |(depth, _)| *depth);
        if next <= depth {
            text += "End Site\n{\nOFFSET 0 3 0\n}\n";
        }
        text += &"}\n".repeat((depth + 1usize).saturating_sub(next));
    }
    let frame = |turn: &str| format!("0 90 0{}\n", format!(" {turn} 0 0").repeat(17));
    format!("{text}MOTION\nFrames: 2\nFrame Time: 0.5\n{}{}", frame("0"), frame("10"))
}

/// A clip of 17 joints on two characters: on the first, names and structure identify only the hips and legs; on the second, they identify
/// nothing. Scripts that play the clip, scripts that retarget it and `info --on` give the same message.
#[test]
fn body_parts_that_are_not_retargeted_are_named_by_every_command() {
    let mixamo = [
        "Hips",
        "Spine",
        "Head",
        "LeftArm",
        "LeftForeArm",
        "LeftHand",
        "RightArm",
        "RightForeArm",
        "RightHand",
        "LeftUpLeg",
        "LeftLeg",
        "LeftFoot",
        "LeftToeBase",
        "RightUpLeg",
        "RightLeg",
        "RightFoot",
        "RightToeBase",
    ];
    let legs = [
        "core", "s1", "s2", "a1", "a2", "a3", "a4", "a5", "a6", "limbA.L", "limbB.L", "limbC.L", "limbD.L",
        "limbA.R", "limbB.R", "limbC.R", "limbD.R",
    ];
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    write("walk.bvh", body_bvh(mixamo));
    write("legs.bvh", body_bvh(legs));
    write(
        "nothing.bvh",
        body_bvh(std::array::from_fn(|i| {
            [
                "t1", "t2", "t3", "t4", "t5", "t6", "t7", "t8", "t9", "t10", "t11", "t12", "t13", "t14",
                "t15", "t16", "t17",
            ][i]
        })),
    );
    let scripts = |body: &str| {
        let scene = format!(
            "let body = load(\"{body}.bvh\");\nlet walk = load(\"walk.bvh\").clip(0);\nlet a = cast(\"a\", body);\n"
        );
        write("plays.rhai", format!("{scene}a.play(walk);\nstage(#{{ length: 0.5 }});\n"));
        write("retargets.rhai", format!("{scene}a.play(walk.retarget(body));\nstage(#{{ length: 0.5 }});\n"));
        write(
            "fits.rhai",
            format!("{scene}a.play(walk.retarget(body, #{{ floor: false }}));\nstage(#{{ length: 0.5 }});\n"),
        );
    };
    scripts("legs");
    let parts = "9 of 17 animated joints have a partner; these body parts stay at rest: spine, head, left arm, right arm";
    for script in ["plays.rhai", "retargets.rhai", "fits.rhai"] {
        let run = choreo(dir.path(), &["check", script]);
        let output = format!("{}{}", run.out, run.err);
        let warning = format!("clip \"walk\" of \"walk.bvh\" on \"legs.bvh\": {parts}");
        assert_eq!((run.code, output.matches(&warning).count()), (0, 1), "{script}: {output}");
        assert!(output.contains("name their partners: clip.retarget(asset, #{ joints:"), "{output}");
    }
    let run = choreo(dir.path(), &["info", "walk.bvh", "--on", "legs.bvh"]);
    assert!(run.code == 0 && run.out.contains(&format!("\n{parts}\n")), "{}{}", run.out, run.err);
    scripts("nothing");
    let nothing = "clip \"walk\" of \"walk.bvh\" on \"nothing.bvh\": no joint matches, neither by name nor by body part";
    for command in [
        &["check", "plays.rhai"][..],
        &["check", "retargets.rhai"],
        &["check", "fits.rhai"],
        &["info", "walk.bvh", "--on", "nothing.bvh"],
    ] {
        let run = choreo(dir.path(), command);
        assert!(run.code == 1 && run.err.contains(nothing), "{command:?}: {}{}", run.out, run.err);
    }
}

/// A name with ESC, a carriage return, a line feed with a forged error message, a C1 control character, and characters that change the
/// direction of text.
const HOSTILE_NAME: &str = "e\u{1b}[31mv\r\nerror: il\u{9b}2J\u{202e}\u{2066}";

/// The triangle, with `HOSTILE_NAME` in the name of each part.
fn hostile_model() -> String {
    let evil = serde_json::to_string(HOSTILE_NAME).unwrap();
    let evil = evil.trim_matches('"');
    let mut text = triangle(1.0);
    for name in ["Root", "Slider", "Tri", "Slide"] {
        text = text.replace(&format!("\"name\": \"{name}\""), &format!("\"name\": \"{name}{evil}\""));
    }
    let material = format!(r#""materials": [{{ "name": "Mat{evil}", "alphaMode": "BLEND" }}],"#);
    text.replace("\"indices\": 3 }", "\"indices\": 3, \"material\": 0 }")
        .replace("\"accessors\":", &format!("{material}\n  \"accessors\":"))
}

/// No command prints control characters from names in a file, so that they can neither control the terminal nor begin a new line.
/// JSON output has the names unchanged.
#[test]
fn control_characters_in_names_do_not_reach_the_terminal() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    std::fs::write(d.join("evil.gltf"), hostile_model()).unwrap();
    let script = format!(
        "let m = load(\"evil.gltf\");\nlet a = cast({0}, m).play(m.clip(0));\nprint({0});\na.joint({0});\n",
        serde_json::to_string(&format!("anna{HOSTILE_NAME}")).unwrap().replace("\\u001b", "\\x1b")
    );
    std::fs::write(d.join("evil.rhai"), &script).unwrap();
    let section = "test(\"s\\x1b[2J\\nerror: x\", || { expect(1).equals(2); });";
    std::fs::write(d.join("evil_test.rhai"), section).unwrap();
    let controls_terminal = |c: char| {
        (c.is_control() && c != '\n') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let mut commands_with_names = 0;
    for args in [
        &["info", "evil.gltf", "--joints"][..],
        &["info", "evil.gltf", "--on", "evil.gltf"],
        &["info", "evil.gltf", "--compress", "0.001"],
        &["pose", "evil.gltf"],
        &["explain", "evil.gltf"],
        &["check", "evil.gltf", "--notes"],
        &["check", "evil.rhai", "--notes"],
        &["check", "evil.gltf", "--clip", "none"],
        &["render", "evil.gltf", "-o", "x.png", "--size", "32x18", "--device", "cpu"],
        &["render", "evil.gltf", "-o", "y.png", "--clip", "none", "--device", "cpu"],
        &["measure", "evil.gltf", "--only", "crossfade"],
        &["plugins", "--for", "evil.gltf"],
        &["test", "evil_test.rhai"],
        &["test", "evil_test.rhai", "--list"],
    ] {
        let run = choreo(d, args);
        let text = format!("{}{}", run.out, run.err);
        assert_eq!(text.chars().find(|c| controls_terminal(*c)), None, "{args:?}: {}", text.escape_debug());
        assert!(!text.lines().any(|line| line.starts_with("error: ")), "{args:?}: {text}");
        commands_with_names += usize::from(text.contains("\u{fffd}"));
        if let ["info" | "pose" | "explain" | "check", ..] = args {
            let run = choreo(d, &[args, &["--json"]].concat());
            assert_eq!(
                run.out.chars().find(|c| controls_terminal(*c)),
                None,
                "{args:?}: {}",
                run.out.escape_debug()
            );
            let value: Value = serde_json::from_str(&run.out).unwrap();
            let json = value.to_string();
            assert!(!json.contains('\u{fffd}'), "{args:?}: {json}");
        }
    }
    assert!(commands_with_names >= 9, "only {commands_with_names} commands print the names");
    let value = json_output(d, &["pose", "evil.gltf", "--json"]);
    assert_eq!(value["actors"][0]["joints"][0]["name"], format!("Root{HOSTILE_NAME}"));
}

#[test]
fn a_matrix_is_one_line_of_json() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["pose", "tri.gltf", "--at", "0", "--json"]);
    let matrices = run.out.lines().filter(|line| line.contains("world_from_joint"));
    assert!(matrices.clone().count() > 0);
    matrices.for_each(|line| {
        assert_eq!(line.matches(',').count() - usize::from(line.ends_with(',')), 15, "{line}")
    });
}

/// The hips and legs of a character that faces −z, in centimetres, as BVH.
fn legs_facing_minus_z_bvh() -> String {
    let leg = |side: &str, x: i32| {
        let joint = |name: &str, offset: &str, below: &str| {
            format!(
                "JOINT {side}{name} {{ OFFSET {offset} CHANNELS 3 Zrotation Xrotation Yrotation {below} }}\n"
            )
        };
        let toes = joint("ToeBase", "0 -8 -12", "End Site { OFFSET 0 0 -5 }");
        let shin = joint("Leg", "0 -45 -2", &joint("Foot", "0 -45 2", &toes));
        joint("UpLeg", &format!("{x} 0 0"), &shin)
    };
    let channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";
    let frame = format!("0 98 0{}", " 0".repeat(27));
    let legs = [leg("Left", -10), leg("Right", 10)].concat();
    format!(
        "HIERARCHY\nROOT Hips {{ OFFSET 0 0 0 {channels}\n{legs}}}\nMOTION\nFrames: 1\nFrame Time: 0.04\n{frame}\n"
    )
}

/// The recipe of a hand-over states the axes of the built-in character's hands.
#[test]
fn info_states_the_axes_of_hands() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["info", "choreo:mannequin"]);
    let line = run.out.lines().find(|line| line.starts_with("hands "));
    let expected = "hands      mixamorig:LeftHand fingers +y, palm +z, thumb -x; mixamorig:RightHand fingers +y, palm +z, thumb +x";
    assert_eq!(line, Some(expected), "{}", run.out);
    let recipe = include_str!("../../../../scripts/guide/src/recipes/hand_over.md");
    assert!(recipe.contains(
        "hands of the built-in character and of Mixamo y runs along the fingers\n  and z out of the palm"
    ));
    let hands =
        json_output(dir.path(), &["info", "choreo:mannequin", "--json"])["character"]["hands"].clone();
    assert_eq!(hands.as_array().unwrap().len(), 2, "{hands}");
    // VRM 0.x: joints have the axes of the model, in which the arms are stretched out.
    let Some(assets) = sample_assets_folder() else { return };
    let model = assets.join("vrm/cool_loops.vrm");
    let run = choreo(dir.path(), &["info", model.to_str().unwrap()]);
    let line = run.out.lines().find(|line| line.starts_with("hands "));
    let expected = "hands      mixamorig:LeftHand fingers +x, palm -y, thumb +z; mixamorig:RightHand fingers -x, palm -y, thumb +z";
    assert_eq!(line, Some(expected), "{}", run.out);
}

#[test]
fn a_character_that_faces_minus_z_is_detected_and_walks_forwards() {
    let dir = folder_with_triangle();
    std::fs::write(dir.path().join("legs.bvh"), legs_facing_minus_z_bvh()).unwrap();
    let run = choreo(dir.path(), &["info", "legs.bvh"]);
    assert!(run.out.contains("\nfacing     -z (feet, knees, left and right)\n"), "{}{}", run.out, run.err);
    let facing = json_output(dir.path(), &["info", "legs.bvh", "--json"])["facing"].clone();
    assert_eq!((&facing["front"], &facing["doubtful"]), (&"-z".into(), &false.into()));
    // How far the toes are in front of the heel, in the direction of travel, in metres.
    let ahead = |options: &str| {
        let script = format!(
            "cast(\"a\", load(\"legs.bvh\", #{{ scale: 0.01{options} }})).path([[0, 0, 0], [4, 0, 0]], #{{ speed: 1.0 }});\nstage(#{{ length: 2.0 }});\n"
        );
        std::fs::write(dir.path().join("walks.rhai"), script).unwrap();
        let value = json_output(dir.path(), &["pose", "walks.rhai", "--at", "1", "--json"]);
        let joints = value["actors"][0]["joints"].as_array().unwrap().clone();
        let x = |name: &str| {
            let joint = joints.iter().find(|j| j["name"] == name).unwrap();
            joint["world_from_joint"][12].as_f64().unwrap()
        };
        x("LeftToeBase") - x("LeftFoot")
    };
    let (found, stated) = (ahead(""), ahead(", facing: \"+z\""));
    assert!((found - 0.12).abs() < 1e-3, "{found}");
    // The front that the script gives takes precedence: with +z the character walks backwards.
    assert!((stated + 0.12).abs() < 1e-3, "{stated}");
}
