//! A prop in a hand keeps its size in metres, on characters of all formats among the sample files; the baton of lesson 3 changes hands.

use crate::common::stage_of_samples;
use choreo_motion::{HumanoidJoints, Time};
use choreo_stage::Evaluator;
use glam::{DAffine3, DVec3, Vec3};
use std::path::Path;
use std::sync::Arc;

const CHARACTERS: [&str; 9] = [
    "gltf/Knight.glb",
    "gltf/CesiumMan.glb",
    "gltf/RobotExpressive.glb",
    "fbx/pab/run.fbx",
    "fbx/pab/arnaud.fbx",
    "vrm/cool_loops.vrm",
    "vrm/Godette_vrm_v4.vrm",
    "bvh/walk01.bvh",
    "bvh/mocopi-mobile-arm-raise-turn.bvh",
];

/// A box in the right hand, 10 cm from the joint: the worst error of its edges, and of its distance from the hand, in metres.
fn errors(folder: &Path, file: &str, scale: f64, how: &str) -> [f64; 2] {
    let look = "let asset = load(\"FILE\"); cast(\"anna\", asset);".replace("FILE", file);
    let skeleton = stage_of_samples(folder, &look).actors[0].asset.skeleton.clone();
    let hand =
        HumanoidJoints::of(&skeleton).joint("right hand").unwrap_or_else(|| panic!("{file}: no right hand"));
    let name = &skeleton.names()[hand as usize];
    let text = format!(
        "let hero = load(\"{file}\");
         let anna = cast(\"anna\", hero).at(1.0, 0.0, 2.0).turn(30).scale({scale});
         if hero.clips().len() > 0 {{ anna.play(hero.clip(0)); }} else {{ anna.play(load(\"choreo:mannequin\").clip(\"Walk\")); }}
         let prop = cast(\"prop\", shape(\"box\", #{{ size: 0.2 }}));
         prop.attach(anna.joint(\"{name}\"), #{{ {how} }}).at(0.06, 0.08, 0.0);"
    );
    let stage = stage_of_samples(folder, &text);
    let mut worst = [0.0f64; 2];
    for i in 0..8 {
        let snapshot = stage.at(Time::from_secs(f64::from(i) * 0.11)).unwrap();
        let [anna, prop] = [&snapshot.actors[0], &snapshot.actors[1]];
        let DAffine3 { matrix3: edges, translation: at } = prop.world_from_model;
        let hand = Vec3::from(anna.model_from_joint[hand as usize].translation).as_dvec3();
        let hand = anna.world_from_model.transform_point3(hand);
        let edge = |v: DVec3| (0.2 * v.length() - 0.2).abs();
        worst[0] = worst[0].max(edge(edges.x_axis)).max(edge(edges.y_axis)).max(edge(edges.z_axis));
        worst[1] = worst[1].max(((at - hand).length() - 0.1).abs());
    }
    worst
}

#[test]
fn a_prop_in_a_hand_keeps_its_size_whatever_the_format() {
    let Some(folder) = choreo_importer_kit_testing::assets(9) else { return };
    println!("| file | scale | edges, mm | distance, mm | inherited: edges, mm |");
    println!("| --- | ---: | ---: | ---: | ---: |");
    for file in CHARACTERS {
        let mut seen = 0.0f64;
        for scale in [1.0, 0.01, 100.0] {
            let [edges, distance] = errors(&folder, file, scale, "");
            let [inherited, _] = errors(&folder, file, scale, "scale: \"inherit\"");
            println!(
                "| {file} | {scale} | {:.4} | {:.4} | {:.1} |",
                edges * 1e3,
                distance * 1e3,
                inherited * 1e3
            );
            assert!(edges < 1e-6 && distance < 1e-6, "{file} at scale {scale}: {edges} m, {distance} m");
            seen = seen.max(inherited);
        }
        assert!(seen > 0.1, "{file}: the comparison must see a scale that is handed down");
    }
}

/// Metres that an end of the baton goes within two ticks where it changes hands, and within the tenths of a second before and after.
fn handover(lesson: &str) -> [f64; 3] {
    let stage = stage_of_samples(Path::new("."), lesson);
    let baton = stage.actors.iter().position(|actor| actor.name == "Left baton").unwrap();
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let mut end = |time: Time| {
        let state = &evaluator.at(time).unwrap().actors[baton];
        state.world_from_model.transform_point3(DVec3::Y * 0.5)
    };
    let change = Time::from_secs(2.0);
    let given = end(change - Time(1));
    let tenth = Time::from_secs(0.1);
    [change + Time(1), change - tenth, change + tenth].map(|time| end(time).distance(given))
}

#[test]
fn the_baton_of_lesson_3_goes_from_one_moving_hand_to_another_without_a_jump() {
    let lesson = include_str!("../../../../scripts/03_props.rhai");
    let [jump, before, after] = handover(lesson);
    println!("jump {:.6} mm; a tenth of a second before {before:.3} m, after {after:.3} m", jump * 1e3);
    assert!(jump < 1e-6, "{jump} m");
    assert!(before > 0.01 && after > 0.01, "both hands move: {before} m, {after} m");
    // Put into its own place in the new hand it jumps.
    let moved = lesson.replace("#{ from: 2.0 }", "#{ from: 2.0, keep: false }");
    assert_ne!(moved, lesson);
    assert!(handover(&moved)[0] > 0.05);
}
