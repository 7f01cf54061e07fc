//! Hints in messages and short statistics: the length of models without clips, frames beyond the end, meshes in `info`, and reused frames
//! and work of the processor in `explain`.

use crate::common;
use crate::common::{choreo, folder_with_triangle};

/// The triangle without its clip.
fn write_model_without_clips(d: &std::path::Path) {
    let text = common::triangle(1.0);
    let (before, rest) = text.split_once("\"animations\"").unwrap();
    let (_, after) = rest.split_once("}] }],").unwrap();
    std::fs::write(d.join("still.gltf"), format!("{before}{after}")).unwrap();
}

#[test]
fn messages_state_the_length_and_frame_range_of_models() {
    let dir = folder_with_triangle();
    let d = dir.path();
    write_model_without_clips(d);
    let small = ["--size", "16x16", "--samples", "1", "--device", "cpu"];
    let run = choreo(d, &[&["render", "still.gltf", "-o", "a.y4m", "--length", "0.5"][..], &small].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.err.contains("still.gltf: no clips: the same frame for 0.5 s\n"), "{}", run.err);
    assert!(!run.err.contains("one frame"), "{}", run.err);
    let run = choreo(d, &[&["render", "tri.gltf", "-o", "b.y4m", "--frames", "0..120"][..], &small].concat());
    assert_eq!(run.code, 2);
    assert!(run.err.contains("0..30; --length SECS makes it longer and repeats the clip"), "{}", run.err);
}

/// If the rest pose of a clip is a stride, the warning names its rule and states how to allow it.
#[test]
fn a_retargeting_warning_can_be_allowed() {
    let Some(assets) = common::sample_assets_folder() else { return };
    let dir = folder_with_triangle();
    let d = dir.path();
    for file in ["vrm/cool_loops.vrm", "fbx/pab/locomotions.fbx"] {
        let name = std::path::Path::new(file).file_name().unwrap();
        std::fs::copy(assets.join(file), d.join(name)).unwrap();
    }
    let script = |comment: &str| {
        let text = format!(
            "let f = load(\"locomotions.fbx\");\nlet a = cast(\"a\", load(\"cool_loops.vrm\"));\n{comment}a.play(f.clip(\"walk\"));\n"
        );
        std::fs::write(d.join("a.rhai"), text).unwrap();
        choreo(d, &["check", "a.rhai", "--strict"])
    };
    let run = script("");
    assert!(run.code == 1 && run.err.contains(" [retarget_rest]\n"), "{}", run.err);
    let how = "if it is intended, write // allow: retarget_rest in the line above";
    assert!(run.err.contains(how), "{}", run.err);
    let run = script("// allow: retarget_rest\n");
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{}", run.out);
}

/// The robot has a bone "Body"; the other file has a mesh with the same name in addition to its bones.
#[test]
fn a_mesh_with_the_name_of_a_bone_is_not_mapped_to_it() {
    let Some(assets) = common::sample_assets_folder() else { return };
    let dir = folder_with_triangle();
    let file = |name: &str| assets.join(name).to_string_lossy().into_owned();
    let (robot, godette) = (file("gltf/RobotExpressive.glb"), file("vrm/Godette_vrm_v4.vrm"));
    let run = choreo(dir.path(), &["info", &robot, "--on", &godette]);
    assert!(run.out.contains("\npelvis_Armature ← Hips (by body)"), "{}{}", run.out, run.err);
    assert!(!run.out.contains("Body ←"), "{}", run.out);
}

#[test]
fn info_names_meshes_and_the_nodes_that_show_them() {
    let dir = folder_with_triangle();
    let run = choreo(dir.path(), &["info", "tri.gltf"]);
    assert!(run.out.contains("\n  mesh     Tri on Slider\n"), "{}", run.out);
}

#[test]
fn explain_and_render_count_the_same_reused_frames() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let script = r##"stage(#{ size: [16, 16], fps: 8, length: 1.0 });
cast("b", shape("box")).key("position", [[0.0, [0, 0, 0]], [0.5, [0, 0, 0]], [1.0, [1, 0, 0]]]);
camera("c").at(0, 1, 6).look_at([0, 0, 0]);
text("a", #{ size: 0.5 }).from(0.25);
"##;
    std::fs::write(d.join("a.rhai"), script).unwrap();
    let explained = choreo(d, &["explain", "a.rhai", "--json", "--at", "0.125"]);
    let explained: serde_json::Value = serde_json::from_str(&explained.out).unwrap();
    let counts = &explained["cpu"]["reuses"];
    assert_eq!(counts["looked_at"], 8);
    assert_eq!(explained["cpu"]["reuse"], "frame");
    let rendered =
        choreo(d, &["render", "a.rhai", "-o", "a.y4m", "--json", "--samples", "1", "--device", "cpu"]);
    let rendered: serde_json::Value = serde_json::from_str(&rendered.out).unwrap();
    for word in ["frames", "drawn", "reused", "repeated", "recomposed"] {
        assert_eq!(counts[word], rendered[word], "{word}");
    }
    // 1 frame drawn, 1 repeated, 1 with the title, 2 repeated, 3 drawn.
    assert_eq!(counts["drawn"], 4, "{counts}");
    let text = choreo(d, &["explain", "a.rhai"]).out;
    assert!(text.contains("\nstage      1 actor from 1 asset, 8 frames\n"), "{text}");
    assert!(
        text.contains("frames     4 of 8 frames are drawn, 3 repeat the one before, 1 reuse only its scene"),
        "{text}"
    );
}

/// No work is counted for an actor outside the view, and at most one sub-frame for a frame without motion.
#[test]
fn explain_counts_poses_constraints_spring_bones_and_sub_frames() {
    let dir = folder_with_triangle();
    let d = dir.path();
    let counts = |other_x: f64, at: &str| {
        let script = format!(
            r##"stage(#{{ size: [32, 32], fps: 4, length: 1.0 }});
let m = load("choreo:mannequin");
for x in [0.0, {other_x:?}] {{
    let who = cast("at " + x, m).at(x, 0.0, 0.0);
    who.aim("Head", [x, 1.5, 3.0]);
    who.spring("LeftHand..");
}}
let box = cast("box", shape("box", #{{ size: 0.3 }}));
box.key("position", [[0.0, [0.0, 1.0, 1.0]], [0.5, [0.0, 1.0, 1.0]], [1.0, [1.0, 1.0, 1.0]]]);
camera("c").at(0, 1, 6).look_at([0, 1, 0]).fov(53.13);
effect("motion_blur", #{{ samples: 16, shutter: 180.0 }});
"##
        );
        std::fs::write(d.join("costs.rhai"), script).unwrap();
        let run = choreo(d, &["explain", "costs.rhai", "--json", "--at", at]);
        let value: serde_json::Value =
            serde_json::from_str(&run.out).unwrap_or_else(|_| panic!("{}", run.err));
        let words = ["poses", "constraints", "spring_bones", "sub_frames"];
        let counts = words.map(|word| value["cpu"][word].as_u64().unwrap());
        let text = choreo(d, &["explain", "costs.rhai", "--at", at]).out;
        let [poses, constraints, bones, frames] = counts;
        let s = |count: u64| if count == 1 { "" } else { "s" };
        let line = format!(
            "{poses} pose{}, {constraints} constraint{}, {bones} spring bone{}, {frames} sub-frame{}",
            s(poses),
            s(constraints),
            s(bones),
            s(frames)
        );
        assert!(text.contains(&line), "{line}: {text}");
        counts
    };
    // The visible one of the two characters, and the box; a hand has 16 joints.
    assert_eq!(counts(500.0, "0.25"), [2, 1, 16, 1]);
    // The box moves 0.25 m in an eighth of a second, 4.85 m in front of the camera, where half of the 32 pixels cover 2.425 m.
    assert_eq!(counts(1.0, "0.75"), [3, 2, 32, (0.25 * 16.0 / 2.425_f64).ceil() as u64]);
}
