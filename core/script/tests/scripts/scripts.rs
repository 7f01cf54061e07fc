//! Scripts and the stages that they leave.

use crate::common::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_stage::*;
use glam::{DQuat, DVec3, Vec3};

/// DESIGN.md's example in the terms of the test importer.
const EXAMPLE: &str = r#"
stage(#{ size: [1280, 720], fps: 30, length: 8.0 });

let hero  = load("hero.toy");
let moves = load("moves.toy");
let anna  = cast("anna", hero).at(-1.0, 0.0, 0.0);
let boris = cast("boris", hero).at(1.0, 0.0, 0.0).face(anna);

anna.play(hero.clip("Walk")).until(3.0)
    .then(hero.clip("Run"), #{ fade: 0.4, speed: 1.1 }).until(6.0)
    .then(hero.clip("Wave"), #{ fade: 0.3 });
anna.play(moves.clip("Wave")).from(2.5).on("Spine..").fade(0.3);
boris.play(hero.clip("Wave")).loop();
boris.look_at(anna.joint("Head")).from(1.0);

camera("wide").at(0.0, 1.6, 6.0).look_at(anna);
camera("close").follow(anna.joint("Head"), [0.0, 0.0, 1.2]).cut(4.0);
sun(#{ direction: [-1.0, -2.0, -1.0] });
effect("glow").set("strength", 0.2);
on_frame(|t| boris.turn(10.0 * sin(t)));
"#;

fn secs(t: f64) -> Time {
    Time::from_secs(t)
}

#[test]
fn the_example_makes_the_described_stage() {
    let script = run_or_panic(EXAMPLE);
    let s = &script.stage;
    assert_eq!((s.settings.size, s.settings.length), ([1280, 720], secs(8.0)));
    assert_eq!(s.actors.len(), 2);
    assert!(std::sync::Arc::ptr_eq(&s.actors[0].asset, &s.actors[1].asset));
    let base = &s.actors[0].layers[0].cues;
    let times: Vec<_> = base.iter().map(|c| (c.start, c.end, c.fade_in)).collect();
    assert_eq!(
        times,
        [
            (secs(0.0), Some(secs(3.0)), secs(0.0)),
            (secs(3.0), Some(secs(6.0)), secs(0.4)),
            (secs(6.0), None, secs(0.3))
        ]
    );
    assert!((base[1].speed, base[2].repeat) == (1.1, Repeat::Loop));
    let layer = &s.actors[0].layers[1];
    assert_eq!(layer.mask.as_ref().unwrap().as_slice(), [0.0, 1.0, 1.0, 1.0, 1.0]);
    let wave = &layer.cues[0];
    assert_eq!((wave.start, wave.end, wave.repeat), (secs(2.5), Some(secs(4.5)), Repeat::Once));
    assert_eq!((wave.fade_in, wave.fade_out), (secs(0.3), secs(0.3)));
    assert_eq!(s.actors[1].face, Some(0));
    assert_eq!(s.actors[1].look_at[0].target, Target::Joint { actor: 0, joint: 2 });
    assert_eq!(s.cuts, [Cut::new(secs(4.0), 1)]);
    assert_eq!(s.effects[0].parameters, [("strength".to_string(), 0.2)]);
    assert!(script.warnings.is_empty(), "{}", show(&script.warnings));
    let shot = s.at(secs(3.2)).unwrap();
    assert_eq!(shot.actors.len(), 2);
}

#[test]
fn the_same_script_gives_the_same_stage() {
    let (a, b) = (run_or_panic(EXAMPLE), run_or_panic(EXAMPLE));
    assert_eq!(a.stage.content_hash(), b.stage.content_hash());
    assert_eq!(a.script_hash, b.script_hash);
    // And another one another.
    for (from, to) in [("until(6.0)", "until(6.1)"), ("10.0 * sin", "11.0 * sin"), ("0.2", "0.3")] {
        let c = run_or_panic(&EXAMPLE.replace(from, to));
        assert_ne!(a.stage.content_hash(), c.stage.content_hash(), "{from} to {to}");
    }
}

#[test]
fn callbacks_depend_on_time_only() {
    let script = run_or_panic(
        r#"
        let a = cast("a", load("hero.toy"));
        let n = 0;
        let lamp = sun();
        on_frame(|t| { n += 1; a.at(n, t, 0); lamp.intensity(t * 2); a.joint("Head").turn(n); });
    "#,
    );
    let run = |t: f64| {
        let mut edits = FrameEdits::default();
        script.stage.frame_callbacks[0].run(secs(t), &mut edits).unwrap();
        (edits.actors, edits.lights)
    };
    let first = run(1.5);
    run(0.25);
    assert_eq!(run(1.5), first, "a captured variable must not carry over from frame to frame");
    assert_eq!(first.0[0], (0, ActorEdit::MoveTo(DVec3::new(1.0, 1.5, 0.0))));
    assert_eq!(first.1, [(0, LightEdit::Intensity(3.0))]);
    // Many threads run it at once.
    std::thread::scope(|s| {
        for _ in 0..4 {
            s.spawn(|| (0..50).for_each(|_| assert_eq!(run(1.5), first)));
        }
    });
}

#[test]
fn actor_transforms_reach_the_stage() {
    let s = run_or_panic(
        r##"let h = load("hero.toy");
           let a = cast("a", h).at(1, 2, 3).turn(90).scale(2).tint("#ff0000").hide();
           let b = cast("b", h).at([4, 0, 0]).face([4, 0, -5]).morph("smile", 0.5).attach(a.joint("LeftHand"));
           let c = cast("c", h).move_by(0, 1, 0).rotate(90, 0, 90);"##,
    )
    .stage;
    let a = &s.actors[0];
    assert!((a.transform.rotation * DVec3::Z).abs_diff_eq(DVec3::X, 1e-12));
    assert_eq!((a.transform.scale, a.visible, a.tint.x, a.tint.y), (DVec3::splat(2.0), false, 1.0, 0.0));
    let b = &s.actors[1];
    assert!((b.transform.rotation * DVec3::Z).abs_diff_eq(DVec3::NEG_Z, 1e-12));
    assert_eq!(b.parents, [Parenting::always(Attachment { actor: 0, joint: Some(3) })]);
    assert_eq!(b.morphs, [(0, 0, 0.5)]);
    // About x first: y goes to z and stays; z goes to -y, and that about z to x.
    let c = s.actors[2].transform.rotation;
    assert!((c * DVec3::Y).abs_diff_eq(DVec3::Z, 1e-12) && (c * DVec3::Z).abs_diff_eq(DVec3::X, 1e-12));
}

#[test]
fn lights_and_backgrounds() {
    let s = run_or_panic(
        r##"stage(#{ background: #{ top: "#000", bottom: [1, 1, 1] }, ambient: 0.5, samples: 4 });
            sun(#{ direction: [0, -2, 0], kelvin: 6500 });
            spot(#{ position: [0, 3, 0], look_at: [0, 0, 0], outer: 20 }).key("intensity", [[0, 0], [1, 50]], "smooth");
            point(#{ color: "orange", range: 5 });
            ambient(#{ up: "white", down: "black" }, 2);"##,
    )
    .stage;
    assert_eq!(s.settings.background, Background::Gradient { top: Vec3::ZERO, bottom: Vec3::ONE });
    assert_eq!((s.settings.ambient_up, s.settings.ambient_down), (Vec3::splat(2.0), Vec3::ZERO));
    assert_eq!(s.lights[0].direction, Vec3::NEG_Y);
    assert!(s.lights[1].direction.abs_diff_eq(Vec3::NEG_Y, 1e-6));
    assert_eq!(s.lights.len(), 3);
    assert!(s.at(secs(0.5)).unwrap().lights.iter().any(|l| (l.light.intensity - 25.0).abs() < 1e-3));
}

#[test]
fn parameters_take_values_of_their_type() {
    let text = r#"
        let n = param("count", 3, "how many");
        let size = param("size", 1.5);
        let name = param("name", "anna");
        let at = param("at", [1, 2, 3]);
        let on = param("on", true);
        for i in 0..n { cast(name + i, load("hero.toy")).at(at).scale(size).move_by(i, 0, 0); }
        print(`${on}`);
    "#;
    let set = |pairs: &[(&str, &str)]| choreo_script::ScriptOptions {
        set_parameters: pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect(),
        ..Default::default()
    };
    let s = assets().run_text(text, &set(&[])).unwrap();
    assert_eq!(s.stage.actors.len(), 3);
    assert_eq!(s.parameters[0].about, "how many");
    let pairs = [("count", "2"), ("size", "2"), ("name", "eva"), ("at", "0,5,0"), ("on", "false")];
    let s = assets().run_text(text, &set(&pairs)).unwrap();
    assert_eq!(s.stage.actors.len(), 2);
    assert_eq!(s.stage.actors[0].name, "eva0");
    assert_eq!(s.stage.actors[0].transform.translation, DVec3::new(0.0, 5.0, 0.0));
    assert_eq!((s.parameters[3].value.as_str(), s.printed[0].as_str()), ("0,5,0", "false"));
    let error = |pairs| show(&assets().run_text(text, &set(pairs)).unwrap_err());
    assert_eq!(
        error(&[("count", "2.5")]).lines().next().unwrap(),
        "t.rhai:2:17: param: --set count=2.5 is not a whole number"
    );
    assert_eq!(
        error(&[("cuont", "2")]),
        "--set: this script has no parameter \"cuont\"; did you mean \"count\"?\n    hint: parameters: count, size, name, at, on"
    );
}

#[test]
fn modules_come_from_the_folder_of_the_script() {
    let folder = Folder::new(&[
        ("hero.toy", ""),
        (
            "main.rhai",
            r#"import "lib/steps" as steps;
               const SPEED = 2.0;
               let h = load("hero.toy");
               let a = steps::walker("a", h);
               on_frame(|t| a.turn(steps::swing(t)));
               steps::spin(a);"#,
        ),
        (
            "lib/steps.rhai",
            r#"import "more" as more;
               fn walker(name, asset) { let a = cast(name, asset); a.play(asset.clip("Walk")); a }
               fn swing(t) { more::twice(t) * sin(PI / 2) }
               fn spin(a) { on_frame(|t| a.turn(more_turn(t))); }
               fn more_turn(t) { t }"#,
        ),
        ("lib/more.rhai", "fn twice(x) { 2 * x }"),
    ]);
    let s = folder.run("main.rhai").unwrap_or_else(|e| panic!("{}", show(&e)));
    assert_eq!(s.files_used.len(), 4);
    let mut edits = FrameEdits::default();
    for callback in &s.stage.frame_callbacks {
        callback.run(secs(45.0), &mut edits).unwrap();
    }
    let turn = |degrees: f64| (0, ActorEdit::Turn(DQuat::from_rotation_y(degrees.to_radians())));
    assert_eq!(edits.actors, [turn(90.0), turn(45.0)]);
}

#[test]
fn equal_files_are_read_once_and_files_of_the_asset_are_used() {
    let folder = Folder::new(&[("hero.toy", "beside skin.png"), ("skin.png", "x")]);
    let s = folder
        .run_text(
            r#"let a = cast("a", load("hero.toy")).at(0,0,0); let b = cast("b", load("./hero.toy")).at(1,0,0);
               let c = cast("c", load("hero.toy", #{ height: 2 })).at(2,0,0);
               let d = cast("d", load("choreo:toy", #{ color: "teal" })).at(3,0,0);"#,
            &Default::default(),
        )
        .unwrap_or_else(|e| panic!("{}", show(&e)));
    let same =
        |i: usize, j: usize| std::sync::Arc::ptr_eq(&s.stage.actors[i].asset, &s.stage.actors[j].asset);
    assert!(same(0, 1) && !same(0, 2) && !same(0, 3));
    assert_eq!(s.files_used.len(), 2);
}

#[test]
fn cameras_of_files_and_shapes() {
    let s = run_or_panic(
        r#"let h = load("hero.toy"); let a = cast("a", h).at(1, 0, 0);
           a.camera("eye").cut(1); h.camera().cut(2);
           camera("top").at(0, 5, 0).rotate(-90, 0, 0).ortho(4).far(20).cut(0);
           cast("floor", shape("plane", #{ size: 4, color: "tan", checker: "brown" })).at(0, 0, 0);
           cast("ball", shape("sphere", #{ size: [1, 2, 1], shininess: 40, specular: "white" })).at(0, 0, 2);"#,
    )
    .stage;
    assert_eq!(s.cameras.len(), 2);
    assert_eq!(s.cameras[0].rig, Rig::File { actor: 0, camera: 0 });
    assert_eq!(s.cameras[1].projection, Projection::Orthographic { height: 4.0, near: 0.05, far: 20.0 });
    assert_eq!(s.actors[1].asset.images.len(), 1);
    let shiny = &s.actors[2].asset.materials[0];
    assert_eq!((shiny.shading, shiny.shininess), (choreo_asset::Shading::BlinnPhong, 40.0));
    assert_eq!(shiny.specular_color, glam::Vec3::ONE);
}

#[test]
fn parameters_of_effects_are_keyed_and_set_by_callbacks() {
    let script = run_or_panic(
        r#"
        stage(#{ length: 4.0 });
        let line = effect("line", #{ width: 1.0 });
        line.key("width", [[1.0, 1.0], [3.0, 5.0]]);
        line.key("color", [[0.0, [0.0, 0.0, 0.0]], [2.0, [1.0, 1.0, 1.0]]]);
        on_frame(|t| if t > 3.5 { line.set("width", 7.0); });
    "#,
    );
    let at = |t: f64, name: &str| {
        let shot = script.stage.at(secs(t)).unwrap();
        let found = shot.effects[0].parameters.iter().find(|(n, _)| n == name);
        found.unwrap_or_else(|| panic!("{name} at {t}")).1
    };
    for (t, width) in [(0.0, 1.0), (1.0, 1.0), (1.5, 2.0), (3.0, 5.0), (3.5, 5.0), (3.75, 7.0)] {
        assert_eq!(at(t, "width"), width, "{t} s");
    }
    // Colors are mixed in linear light.
    assert_eq!((at(1.0, "color_r"), at(1.0, "color_b")), (0.5, 0.5));
    assert!(script.stage.check().is_empty());
}

/// Vectors and the samples of curves are interpolated; whole numbers and texts change at their keyframe.
#[test]
fn parameters_of_every_type_are_keyed() {
    let script = run_or_panic(
        r#"
        stage(#{ length: 4.0 });
        let line = effect("line", #{ drift: [0.5, 0.0], fall: [[0.0, 0.0], [0.5, 1.0]], color_r: 0.25 });
        line.key("drift", [[0.0, [0.0, -1.0]], [2.0, [1.0, 0.0]]]);
        line.key("fall", [[0.0, [[0.0, 0.0]]], [2.0, [[0.0, 0.0], [1.0, 1.0]]]]);
        line.key("count", [[0.0, 1], [2.0, 5]]);
        line.key("cap", [[0.0, "round"], [2.0, "square"]]);
        line.key("color_g", [[0.0, 0.0], [2.0, 1.0]]);
    "#,
    );
    let used = &script.stage.effects[0];
    let given = |name: &str| used.parameters.iter().find(|(n, _)| n == name).map(|(_, value)| *value);
    // A straight line from 0 to 1 at x = 0.5, level behind it: 3/15 is 0.4 of the way.
    assert_eq!((given("fall_3"), given("fall_15"), given("drift_x")), (Some(0.4), Some(1.0), Some(0.5)));
    assert_eq!(given("color_r"), Some(0.25));
    let at = |t: f64, name: &str| {
        let parameters = used.parameters_at(secs(t));
        parameters.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name} at {t}")).1
    };
    for (name, half, end) in [
        ("drift_x", 0.5, 1.0),
        ("drift_y", -0.5, 0.0),
        ("fall_15", 0.5, 1.0),
        ("color_g", 0.5, 1.0),
        ("count", 1.0, 5.0),
        ("cap", 0.0, 1.0),
    ] {
        assert_eq!((at(1.0, name), at(2.0, name)), (half, end), "{name}");
    }
}

#[test]
fn an_effect_can_belong_to_a_camera() {
    let script = run_or_panic(
        r#"
        stage(#{ length: 4.0 });
        cast("a", load("hero.toy"));
        camera("wide").at(0.0, 1.0, 5.0);
        let close = camera("close").at(0.0, 1.0, 2.0).cut(1.0);
        camera("last").at(0.0, 1.0, 3.0).cut(2.0);
        effect("glow").on(close);
    "#,
    );
    let on = |t: f64| script.stage.at(secs(t)).unwrap().effects.len();
    assert_eq!([on(0.5), on(1.0), on(1.9), on(2.0)], [0, 1, 1, 0]);
}

#[test]
fn parts_are_hidden_by_the_names_of_nodes_and_meshes() {
    let script = run_or_panic(
        r#"
        let hero = load("hero.toy");
        cast("a", hero).hide_parts("bod*");
        cast("b", hero);
        cast("c", hero).hide_parts(["hips"]);
        "#,
    );
    let drawn = |actor: usize| {
        let asset = &script.stage.actors[actor].asset;
        asset.meshes[asset.instances[0].mesh as usize].primitives.len()
    };
    assert_eq!([drawn(0), drawn(1), drawn(2)], [0, 1, 0]);
    let [a, b, c] = [0, 1, 2].map(|actor: usize| &script.stage.actors[actor].asset);
    assert!(std::sync::Arc::ptr_eq(a, c), "what hides the same is one asset");
    assert_eq!(a.instances[0].weights, b.instances[0].weights);
    assert!(a.rest_bounds().is_empty() && !b.rest_bounds().is_empty());
    for (names, expected) in [("\"Hip\"", "unknown part \"Hip\""), ("[]", "must not be empty")] {
        let text = format!("cast(\"a\", load(\"hero.toy\")).hide_parts({names});");
        let errors = show(&run(&text).unwrap_err());
        assert!(errors.contains(expected), "{errors}");
    }
}

#[test]
fn a_focal_length_is_a_field_of_view() {
    let script = run_or_panic(
        r#"
        cast("a", load("hero.toy"));
        camera("wide").focal_length(24.0);
        camera("same").fov(to_degrees(2.0 * atan(12.0 / 24.0)));
        camera("tele").ortho(2.0).focal_length(100);
        "#,
    );
    let yfov = |camera: usize| match script.stage.cameras[camera].projection {
        Projection::Perspective { yfov, .. } => yfov.to_degrees(),
        projection => panic!("{projection:?}"),
    };
    // Full-frame film is 24 mm high.
    assert!((yfov(0) - 53.13).abs() < 0.01 && yfov(0) == yfov(1), "{} {}", yfov(0), yfov(1));
    assert!((yfov(2) - 13.69).abs() < 0.01, "{}", yfov(2));
    assert!(show(&run("camera(\"c\").focal_length(0.1);").unwrap_err()).contains("0.2"));
}

/// A callback shakes as a shake of the script does that is there all the time, by as much as it states for the frame.
#[test]
fn callbacks_shake_cameras() {
    let camera_at = |secs: f64, shake: &str| {
        let text = format!(
            "cast(\"a\", load(\"hero.toy\")); let c = camera(\"c\").at(0, 1, 5).look_at([0, 1, 0]); {shake}"
        );
        run_or_panic(&text).stage.at(Time::from_secs(secs)).unwrap().camera
    };
    for secs in [0.0, 0.37, 1.9] {
        let degrees = 1.0 + 4.0 * secs;
        let all =
            format!("c.shake(#{{ amplitude: {degrees:?}, move: 0.2, frequency: 3.0, seed: 7, fade: 0 }});");
        let in_frames =
            "on_frame(|t| c.shake(#{ amplitude: 1.0 + 4.0 * t, move: 0.2, frequency: 3.0, seed: 7 }));";
        let expected = camera_at(secs, &all);
        assert_eq!(camera_at(secs, in_frames), expected, "at {secs} s");
        assert_ne!(camera_at(secs, ""), expected);
    }
    let errors = show(&run("let c = camera(\"c\"); on_frame(|t| c.shake(#{ fade: 1.0 }));").unwrap_err());
    assert!(errors.contains("fade"), "{errors}");
}

/// A callback moves a camera as a rig of the script does, and sets its lens and planes for the frame; a zoom in millimetres is one.
#[test]
fn callbacks_use_every_rig_lens_and_plane() {
    let camera_at = |secs: f64, rest: &str| {
        let text = format!(
            "stage(#{{ length: 2 }}); let a = cast(\"a\", load(\"hero.toy\")).key(\"position\", [[0, [0, 0, 0]], [2, [3, 0, 1]]]);
             let c = camera(\"c\"); {rest}"
        );
        run_or_panic(&text).stage.at(Time::from_secs(secs)).unwrap().camera
    };
    let cases = [
        ("c.follow(a, [0, 1, 4]);", "c.at(9, 9, 9); on_frame(|t| c.follow(a, [0, 1, 4]));"),
        (
            "c.orbit(a, #{ distance: 3, azimuth: 30, elevation: 5, speed: 40 });",
            "c.at(9, 9, 9); on_frame(|t| c.orbit(a, #{ distance: 3, azimuth: 30 + 40 * t, elevation: 5 }));",
        ),
        ("c.orbit(a, #{ speed: 0 });", "c.follow(a, [0, 1, 4]); on_frame(|t| c.orbit(a));"),
        (
            "c.frame(#{ azimuth: -60, elevation: 40 });",
            "on_frame(|t| c.frame(#{ azimuth: -60, elevation: 40 }));",
        ),
        ("c.frame();", "c.at(0, 1, 2).look_at(a); on_frame(|t| c.frame());"),
        ("c.follow(a, [0, 1, 4]);", "c.frame(); on_frame(|t| c.at(9, 9, 9).follow(a, [0, 1, 4]));"),
        (
            "c.orbit(a, #{ speed: 0 }).near(0.7).far(50);",
            "c.orbit(a, #{ speed: 0 }); on_frame(|t| c.near(0.7).far(50));",
        ),
        (
            "c.at(0, 1, 5).fov(30).near(0.2).far(9);",
            "c.at(0, 1, 5); on_frame(|t| c.near(0.2).far(9).fov(30));",
        ),
        (
            "c.at(0, 1, 5).ortho(3).near(0.2).far(9);",
            "c.at(0, 1, 5); on_frame(|t| c.near(0.2).far(9).ortho(3));",
        ),
        (
            "c.at(0, 1, 5).key(\"focal_length\", [[0, 24], [2, 200]]);",
            "c.at(0, 1, 5); on_frame(|t| c.focal_length(24 + 88 * t));",
        ),
        (
            "c.orbit(a, #{ speed: 0 }).key(\"fov\", [[0, 90]]).key(\"focal_length\", [[0, 24], [2, 200]]);",
            "c.orbit(a, #{ speed: 0 }); on_frame(|t| c.focal_length(24 + 88 * t));",
        ),
        ("c.key(\"focal_length\", [[0, 50]]);", "c.focal_length(50);"),
    ];
    for (built, in_frames) in cases {
        for secs in [0.0, 0.37, 1.5] {
            let (expected, got) = (camera_at(secs, built), camera_at(secs, in_frames));
            let [e, g] = [expected, got].map(|camera| camera.world_from_view);
            assert!(e.abs_diff_eq(g, 1e-9), "{in_frames} at {secs} s: {g}, not {e}");
            let [e, g] = [expected, got].map(|camera| match camera.projection {
                Projection::Perspective { yfov, near, far } => [yfov, near, far.unwrap_or(0.0), 0.0],
                Projection::Orthographic { height, near, far } => [height, near, far, 1.0],
            });
            let off = e.iter().zip(g).map(|(e, g)| (e - g).abs()).fold(0.0, f32::max);
            assert!(off < 1e-6, "{in_frames} at {secs} s: {g:?}, not {e:?}");
        }
    }
}

/// A lens and planes that a script sets count for cameras of files, which see 0.7 rad, and for framing cameras.
#[test]
fn lens_and_planes_of_the_script_override_file_and_framing_cameras() {
    for (set, yfov, near, far) in [
        ("", 0.7, None, None),
        (".fov(20).near(0.5).far(33)", 20f32.to_radians(), Some(0.5), Some(33.0)),
        (".focal_length(50)", 0.471_5, None, None),
        (".key(\"focal_length\", [[0, 50]])", 0.471_5, None, None),
    ] {
        let text = format!("let h = load(\"hero.toy\"); cast(\"a\", h).camera(\"eye\"){set};");
        let Projection::Perspective { yfov: y, near: n, far: f } =
            run_or_panic(&text).stage.at(Time::ZERO).unwrap().camera.projection
        else {
            panic!()
        };
        assert!((y - yfov).abs() < 1e-3, "{set}: {y}");
        assert!(
            near.is_none_or(|near| near == n) && far.is_none_or(|far| Some(far) == f),
            "{set}: {n} {f:?}"
        );
    }
    let framed = run_or_panic("cast(\"a\", load(\"hero.toy\")); camera(\"c\").frame().near(0.5).far(70);");
    let Projection::Perspective { near, far, .. } = framed.stage.at(Time::ZERO).unwrap().camera.projection
    else {
        panic!()
    };
    assert_eq!((near, far), (0.5, Some(70.0)));
    for (rest, expected) in [
        ("on_frame(|t| c.orbit(a, #{ speed: 3 }));", "speed"),
        (
            "c.ortho(2).key(\"focal_length\", [[0, 50]]);",
            "has no perspective, so its focal length cannot be keyed",
        ),
        ("c.key(\"focal_length\", [[0, 0.1]]);", "0.2"),
    ] {
        let text = format!("let a = cast(\"a\", load(\"hero.toy\")); let c = camera(\"c\"); {rest}");
        let errors = show(&run(&text).unwrap_err());
        assert!(errors.contains(expected), "{errors}");
    }
    let crossed = run_or_panic(
        "cast(\"a\", load(\"hero.toy\")); let c = camera(\"c\"); on_frame(|t| c.near(3).far(2));",
    );
    let error = crossed.stage.at(Time::ZERO).unwrap_err().to_string();
    assert_eq!(error, "camera \"c\" at 0 s: far must be more than near, got 2 and 3 from on_frame");
}

#[test]
fn emitted_light_is_brighter_than_white() {
    let script = run_or_panic(
        r#"
        cast("a", shape("box", #{ emissive: "white", emissive_strength: 8 }));
        cast("b", shape("box", #{ emissive: [0.5, 0.0, 0.0] }));
        "#,
    );
    let emissive = |actor: usize| script.stage.actors[actor].asset.materials[0].emissive;
    assert_eq!(emissive(0), Vec3::splat(8.0));
    assert!((emissive(1).x - 0.214).abs() < 1e-3);
    let errors = show(&run(r#"shape("box", #{ emissive_strength: 2 });"#).unwrap_err());
    assert!(errors.contains("emissive_strength needs emissive"), "{errors}");
}

/// Rhai takes a minus behind its keywords for a sign; `until` is a name here.
#[test]
fn a_minus_behind_a_method_named_like_a_keyword_subtracts() {
    let script = run_or_panic(
        r#"let line = #{ until: 3.0, from: 1.0 };
        stage(#{ length: line.until - 0.5 + (line.until - line.from) * 2.0 + line.until });"#,
    );
    assert_eq!(script.stage.settings.length, secs(3.0 - 0.5 + 4.0 + 3.0));
}
