//! The lesson "first dance", rebuilt from an empty stage by mouse; the keyboard only enters numbers, names and texts. The scene is compared with
//! that of the lesson: joints, cameras, lights and background over ten seconds. Screenshots are saved in the folder CHOREO_SHOTS, if it is set.

use crate::place::Place;
use crate::place::mouse::Mouse;
use choreo_motion::Time;
use choreo_stage::Stage;
use choreo_viewer::library::templates::TEMPLATES;
use choreo_viewer::state::selection::Selected;
use egui::vec2;
use glam::DVec3;
use std::sync::Arc;

const LESSON: &str = include_str!("../../../../scripts/01_first_dance.rhai");

fn seek(mouse: &mut Mouse, secs: &str) {
    mouse.type_into("time of the playhead", secs);
}

fn point(mouse: &mut Mouse, names: [&str; 3], to: [&str; 3]) {
    for (name, to) in names.into_iter().zip(to) {
        mouse.type_into(name, to);
    }
}

/// Sets the colors, walk and clips of one dancer, who is on stage.
fn dancer(mouse: &mut Mouse, name: &str, [x, from, to]: [&str; 3], colors: &[(&str, &str)]) {
    mouse.click(name);
    for (field, color) in colors {
        mouse.type_into(&format!("asset {field} hex"), color);
    }
    seek(mouse, "0");
    mouse.type_into("x", x);
    mouse.type_into("z", from);
    mouse.click("key of position");
    seek(mouse, "2");
    mouse.type_into("z", to);
    mouse.click(&format!("Idle on {name}"));
    mouse.click("clip: Idle");
    mouse.click("Walk");
    mouse.type_into("until field", "2");
    for (clip, at, fade) in [("Dance_Groove", "2", "0.5"), ("Dance_Spin", "6", "0.4"), ("Bow", "8.4", "0.4")]
    {
        seek(mouse, at);
        mouse.click(name);
        mouse.click(&format!("play {clip}"));
        mouse.click(&format!("{clip} on {name}"));
        mouse.type_into("fade field", fade);
        match clip {
            "Dance_Groove" => mouse.type_into("trim start", "2"),
            "Dance_Spin" => mouse.type_into("speed field", "1.1"),
            _ => {}
        }
    }
}

fn stage_and_light(mouse: &mut Mouse) {
    mouse.type_into("stage length", "10.5");
    mouse.type_into("background above hex", "#232a4d");
    mouse.type_into("background below hex", "dc9f8a");
    mouse.type_into("ambient above hex", "#5a6a9a");
    mouse.type_into("ambient below hex", "#5a3f3a");
    mouse.type_into("ambient strength", "0.8");
    mouse.click("sun 1");
    point(mouse, ["light x", "light y", "light z"], ["-0.6", "-1", "-0.9"]);
    mouse.type_into("light intensity", "3");
    mouse.type_into("light kelvin", "4300");
    for (at, color, intensity) in
        [(["3", "3.5", "-4"], "#7fa8ff", "90"), (["-3.5", "2.5", "-3.5"], "#ff8fb0", "70")]
    {
        mouse.menu(&["Add", "Light", "Spot"]);
        point(mouse, ["light x", "light y", "light z"], at);
        mouse.type_into("light color hex", color);
        mouse.type_into("light intensity", intensity);
        mouse.type_into("light outer", "40");
        mouse.click("shadow field");
    }
    mouse.menu(&["Add", "Effect", "vignette"]);
    mouse.click("floor");
    mouse.menu(&["Edit", "Delete"]);
    mouse.menu(&["Add", "Shape", "cylinder"]);
    point(mouse, ["size x", "size y", "size z"], ["7.5", "0.1", "7.5"]);
    mouse.type_into("asset color hex", "#4a4f6e");
    point(mouse, ["x", "y", "z"], ["0", "-0.1", "0"]);
}

fn cameras(mouse: &mut Mouse) {
    let (at, looks) = (
        ["camera at x", "camera at y", "camera at z"],
        ["camera look_at x", "camera look_at y", "camera look_at z"],
    );
    mouse.click("view");
    seek(mouse, "0");
    mouse.type_into("field of view", "26");
    point(mouse, looks, ["0", "0.95", "0"]);
    point(mouse, at, ["1.2", "1.2", "7.6"]);
    mouse.click("key of position");
    seek(mouse, "2.4");
    point(mouse, at, ["0.4", "1.4", "6.2"]);
    mouse.click("ada");
    mouse.menu(&["Add", "Camera", "Camera following ada"]);
    mouse.type_into("field of view", "34");
    mouse.click("joint: whole actor");
    mouse.click("Spine2");
    point(mouse, ["camera offset x", "camera offset y", "camera offset z"], ["0.9", "0.1", "2.6"]);
    seek(mouse, "4");
    mouse.menu(&["Add", "Camera", "Around the middle"]);
    mouse.type_into("field of view", "34");
    for (name, to) in [("distance", "5.8"), ("elevation", "8"), ("azimuth", "-165"), ("speed", "30")] {
        mouse.type_into(&format!("camera {name}"), to);
    }
    seek(mouse, "7");
    mouse.menu(&["Add", "Camera", "From this view"]);
    mouse.type_into("field of view", "26");
    point(mouse, at, ["0", "0.7", "6.4"]);
    point(mouse, looks, ["0", "0.92", "0"]);
}

#[test]
fn the_first_dance_is_rebuilt_from_an_empty_stage() {
    let empty = TEMPLATES.iter().find(|template| template.name == "Empty stage").unwrap();
    let mut mouse = Mouse::new(Place::new(empty.text), vec2(1600.0, 1000.0));
    stage_and_light(&mut mouse);
    mouse.picture("dance_1_stage");
    for _ in 0..3 {
        mouse.menu(&["Add", "Character"]);
    }
    dancer(&mut mouse, "ada", ["0", "-1.8", "0.6"], &[("color", "#f2694b")]);
    dancer(&mut mouse, "bob", ["-1.55", "-2.7", "-0.3"], &[("color", "#1d9a94")]);
    mouse.click("bob");
    mouse.type_into("scale x", "-1");
    dancer(&mut mouse, "cleo", ["1.55", "-2.7", "-0.3"], &[("color", "#e9e2d3"), ("accent", "#7d5bc4")]);
    mouse.picture("dance_2_clips");
    seek(&mut mouse, "0.3");
    mouse.click("ada");
    mouse.click("play Wave");
    mouse.click("Wave on ada");
    mouse.type_into("speed field", "1.2");
    mouse.type_into("on field", "RightShoulder..");
    // The clip is now in another layer and still selected; a further click changes nothing.
    let wave = Some(Selected::Cue { actor: "ada".into(), layer: 1, cue: 0 });
    assert_eq!(mouse.desk.state().viewer.selection, wave);
    mouse.click("Wave on ada");
    assert_eq!(mouse.desk.state().viewer.selection, wave);
    cameras(&mut mouse);
    mouse.picture("dance_3_cameras");
    let text = mouse.desk.state().text();
    println!("{text}");
    assert!(mouse.desk.state().viewer.problems.is_empty(), "{:?}", mouse.desk.state().viewer.problems);
    let [rebuilt, lesson] = [stage_of(mouse.desk.state()), stage_of(&Place::new(LESSON))];
    for tenths in 0..100 {
        compare(&rebuilt, &lesson, Time::from_secs(f64::from(tenths) / 10.0));
    }
    for secs in ["1", "3", "5", "8"] {
        seek(&mut mouse, secs);
        mouse.picture(&format!("dance_4_at_{secs}"));
    }
}

fn stage_of(place: &Place) -> Arc<Stage> {
    place.viewer.scene.as_ref().unwrap().stage.clone()
}

/// Compares joints and cameras to a micrometre, colors to one step of 8 bits.
fn compare(rebuilt: &Stage, lesson: &Stage, at: Time) {
    let [ours, theirs] = [rebuilt.at(at).unwrap(), lesson.at(at).unwrap()];
    let secs = at.as_secs();
    for name in ["ada", "bob", "cleo"] {
        let index = |stage: &Stage| stage.actors.iter().position(|actor| actor.name == name).unwrap();
        let (own, other) = (&ours.actors[index(rebuilt)], &theirs.actors[index(lesson)]);
        for (joint, (a, b)) in own.model_from_joint.iter().zip(&other.model_from_joint).enumerate() {
            let place = |world: &glam::DAffine3, model: &glam::Affine3A| -> DVec3 {
                world.transform_point3(model.translation.as_dvec3())
            };
            let apart = place(&own.world_from_model, a).distance(place(&other.world_from_model, b));
            assert!(apart < 1e-6, "{name} at {secs} s: joint {joint} is {apart} m away");
        }
    }
    let camera = ours.camera.world_from_view.translation.distance(theirs.camera.world_from_view.translation);
    assert!(camera < 1e-6, "camera at {secs} s: {camera} m away");
    assert_eq!(ours.camera.projection, theirs.camera.projection, "{secs} s");
    assert_eq!(ours.lights.len(), theirs.lights.len());
    for (own, other) in ours.lights.iter().zip(&theirs.lights) {
        assert!(
            own.position.distance(other.position) < 1e-6 && own.direction.dot(other.direction) > 1.0 - 1e-6
        );
        assert_eq!(own.light.intensity, other.light.intensity);
        assert!((own.light.color - other.light.color).abs().max_element() < 1e-3, "{own:?} {other:?}");
    }
    assert_eq!(ours.background, theirs.background);
    assert!((ours.ambient_up - theirs.ambient_up).abs().max_element() < 1e-3);
    assert!((ours.ambient_down - theirs.ambient_down).abs().max_element() < 1e-3);
    assert_eq!(ours.effects.len(), theirs.effects.len());
}
