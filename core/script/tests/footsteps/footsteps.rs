//! From walk to stand and back: feet step and do not slide, on every character among the sample files with clips of its own or of another.
//! `cargo test --workspace --test footsteps -- --nocapture` prints the tables.

use crate::common::stage_of_samples;
use choreo_motion::{HumanoidJoints, Time};
use choreo_stage::{ConstraintKind, Evaluator, Leg, Stage, find_legs};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// File and size of a character; files and names of its walk and of its stand.
type Character = (&'static str, f64, [&'static str; 2], [&'static str; 2]);
const CHARACTERS: [Character; 22] = [
    ("choreo:mannequin", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("gltf/Knight.glb", 1.0, ["gltf/Knight.glb", "Walking_A"], ["gltf/Knight.glb", "Idle"]),
    ("gltf/CesiumMan.glb", 1.0, ["gltf/CesiumMan.glb", "0"], ["choreo:mannequin", "Idle"]),
    ("gltf/Fox.glb", 0.01, ["gltf/Fox.glb", "Walk"], ["gltf/Fox.glb", "Survey"]),
    (
        "gltf/RobotExpressive.glb",
        0.4,
        ["gltf/RobotExpressive.glb", "Walking"],
        ["gltf/RobotExpressive.glb", "Idle"],
    ),
    ("fbx/pab/arnaud.fbx", 1.0, ["fbx/pab/locomotions.fbx", "walk"], ["choreo:mannequin", "Idle"]),
    ("vrm/cool_loops.vrm", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("vrm/Godette_vrm_v4.vrm", 1.0, ["gltf/Knight.glb", "Walking_A"], ["choreo:mannequin", "Idle"]),
    ("vrm/debug_robot.vrm", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("vrm/mtoon_default.vrm", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("vrm/smoke_spring.vrm", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    (
        "vrm/springbone_collider_sphere_x0p02_r0p1.vrm",
        1.0,
        ["choreo:mannequin", "Walk"],
        ["choreo:mannequin", "Idle"],
    ),
    (
        "vrm/VRMC_materials_mtoon_UV_Animation_Test.vrm",
        1.0,
        ["choreo:mannequin", "Walk"],
        ["choreo:mannequin", "Idle"],
    ),
    (
        "vrm/VRMC_vrm_expressions_isBinary_Overrides.vrm",
        1.0,
        ["choreo:mannequin", "Walk"],
        ["choreo:mannequin", "Idle"],
    ),
    ("bvh/walk01.bvh", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("bvh/mocopi-mobile-arm-raise-turn.bvh", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("fbx/pab/walk.fbx", 1.0, ["fbx/pab/walk.fbx", "walk"], ["choreo:mannequin", "Idle"]),
    ("fbx/pab/run.fbx", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("fbx/pab/locomotions.fbx", 1.0, ["fbx/pab/locomotions.fbx", "walk"], ["choreo:mannequin", "Idle"]),
    ("dae/pab/skeleton.dae", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("dae/pab/walk.dae", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
    ("dae/walk.dae", 1.0, ["choreo:mannequin", "Walk"], ["choreo:mannequin", "Idle"]),
];

/// Metres above the ground below which a foot touches it.
const GROUND_CONTACT_HEIGHT: f64 = 0.01;
/// Metres per second below which a foot in the air has landed.
const LANDED_SPEED: f64 = 0.3;
const SAMPLES_PER_SECOND: f64 = 240.0;
/// Metres from its last contact within which a landing foot continues that contact.
const SAME_PLACE_DISTANCE: f64 = 0.002;
/// Metres that a landing foot may rise in a 240th of a second.
const MAX_RISE_ON_LANDING: f64 = 1e-4;
/// Distance from its contact, in leg lengths, at which a foot has taken a step.
const STEP_DISTANCE_IN_LEGS: f64 = 0.06;
/// Height, in leg lengths, that a foot must reach in a step.
const MIN_LIFT_IN_LEGS: f64 = 0.025;
/// Share of the hips' height by which the heights of hips and lower foot may vary on a slope; the hips of RobotExpressive vary by a third.
const MAX_HEIGHT_CHANGE_ON_SLOPE: f64 = 0.4;
/// Metres that a foot may slide during one contact.
const MAX_SLIDE: f64 = 0.02;
/// Metres per second above which a foot pops from one sample to the next.
const POP_SPEED: f64 = 12.0;

/// Time of the last sample in seconds, long after each stop.
const LAST_SAMPLE_SECONDS: f64 = 16.0;

/// Height of the mannequin's hips in metres where its run is lowest.
const LOWEST_HIPS: f64 = 0.887;

#[derive(Clone, Copy, Debug, Default)]
struct FootSlide {
    /// Largest distance that a foot slid during a contact, in metres.
    metres: f64,
    at_secs: f64,
    /// Largest distance that a foot moved from one sample to the next, in metres.
    step: f64,
    /// Number of contacts.
    stands: usize,
}

fn sample_toe_positions(stage: &Stage, legs: &[Leg], from: f64, to: f64) -> Vec<Vec<DVec3>> {
    let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
    let mut feet = vec![Vec::new(); legs.len()];
    for i in 0..=((to - from) * SAMPLES_PER_SECOND) as i64 {
        let snapshot = evaluator.at(Time::from_secs(from + i as f64 / SAMPLES_PER_SECOND)).unwrap();
        let state = &snapshot.actors[0];
        for (leg, places) in legs.iter().zip(&mut feet) {
            let m = state.model_from_joint[leg.toe.unwrap_or(leg.foot) as usize];
            places.push(state.world_from_model.transform_point3(glam::Vec3::from(m.translation).as_dvec3()));
        }
    }
    feet
}

/// Measures how far feet slide during contacts. A contact begins when a foot is low and slow, and ends when it is above its lowest place since then.
/// A foot that rises and lands in the same place continues its contact. `ground` has the height on which each foot stands.
fn measure_foot_slide(feet: &[Vec<DVec3>], ground: &[f64], from: f64) -> FootSlide {
    let mut found = FootSlide::default();
    for (places, ground) in feet.iter().zip(ground) {
        // Position at the beginning of the contact, and the lowest height since.
        let mut stands: Option<(DVec3, f64)> = None;
        let mut stood: Option<(DVec3, f64)> = None;
        for i in 1..places.len() {
            let (before, now) = (places[i - 1], places[i]);
            found.step = found.step.max((now - before).length());
            let slow = (now - before).with_y(0.0).length() * SAMPLES_PER_SECOND < LANDED_SPEED;
            match &mut stands {
                Some((first, lowest)) if now.y - *lowest < GROUND_CONTACT_HEIGHT => {
                    *lowest = lowest.min(now.y);
                    let off = (now - *first).with_y(0.0).length();
                    if off > found.metres {
                        (found.metres, found.at_secs) = (off, from + i as f64 / SAMPLES_PER_SECOND);
                    }
                }
                // A foot that rises where it stood has not come down again.
                None if now.y - ground < GROUND_CONTACT_HEIGHT
                    && slow
                    && now.y <= before.y + MAX_RISE_ON_LANDING =>
                {
                    let still =
                        |(first, _): &(DVec3, f64)| (now - *first).with_y(0.0).length() < SAME_PLACE_DISTANCE;
                    stands = stood.filter(still).or(Some((now, now.y)));
                    found.stands += 1;
                }
                Some(_) => stood = stands.take(),
                None => {}
            }
        }
    }
    found
}

fn without_foot_locks(stage: &Stage) -> Stage {
    let mut stage = stage.clone();
    stage.actors[0].constraints.retain(|g| !matches!(g.kind, ConstraintKind::FootLock(_)));
    stage
}

fn script(character: &Character, rest: &str) -> String {
    let (file, scale, walk, idle) = character;
    let clip = |[file, name]: &[&str; 2]| {
        let name = name.parse::<u32>().map_or(format!("\"{name}\""), |n| n.to_string());
        format!("load(\"{file}\").clip({name})")
    };
    format!(
        "stage(#{{ fps: 60, length: 18 }});
         let anna = cast(\"anna\", load(\"{file}\")).at(0, 0, 0).scale({scale});
         let walk = {}; let idle = {};
         {rest}",
        clip(walk),
        clip(idle)
    )
}

/// Each shared file that has legs is among the characters.
#[test]
fn all_shared_characters_with_legs_walk_here() {
    let Some(folder) = choreo_importer_kit_testing::assets(1) else { return };
    let formats = ["glb", "gltf", "vrm", "fbx", "bvh", "dae"];
    let mut found = Vec::new();
    for path in files_below(&folder) {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
        if formats.contains(&extension.as_str()) {
            let stage = stage_of_samples(&folder, &format!("cast(\"a\", load(\"{name}\"));"));
            found.extend((!find_legs(&stage.actors[0].asset.skeleton).is_empty()).then_some(name));
        }
    }
    let known = |name: &str| CHARACTERS.iter().any(|c| c.0 == name);
    let missing: Vec<&String> = found.iter().filter(|name| !known(name)).collect();
    println!("with legs: {found:?}");
    assert!(missing.is_empty(), "{missing:?} has legs and is not watched");
    assert!(found.len() > 10, "{found:?}");
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files_below(&path));
        } else {
            all.push(path);
        }
    }
    all.sort();
    all
}

#[test]
fn a_stop_takes_a_last_step() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    println!("| file | how | at, s | slide, mm | without steps, mm | fastest foot, m/s | without, m/s |");
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: |");
    let mut least_without = f64::INFINITY;
    let mut faults = Vec::new();
    for character in &CHARACTERS {
        let mut most_without = 0.0f64;
        for (how, planted) in
            [("fade: 0.5", ""), ("inertial: 0.4", ""), ("fade: 0.3", "anna.plant_feet();"), ("fade: 1.2", "")]
        {
            for at in [2.0, 2.17, 2.41, 2.63] {
                let text = script(
                    character,
                    &format!(
                        "anna.root_motion(); {planted} anna.play(walk).until({at}).then(idle, #{{ {how} }});"
                    ),
                );
                let stage = stage_of_samples(&folder, &text);
                let legs = find_legs(&stage.actors[0].asset.skeleton);
                // Heights of the feet long after the stop.
                let ground: Vec<f64> =
                    sample_toe_positions(&stage, &legs, 6.0, 6.0).iter().map(|b| b[0].y).collect();
                let watch = |stage: &Stage| {
                    measure_foot_slide(
                        &sample_toe_positions(stage, &legs, at, LAST_SAMPLE_SECONDS),
                        &ground,
                        at,
                    )
                };
                let (with_locks, without_locks) = (watch(&stage), watch(&without_foot_locks(&stage)));
                println!(
                    "| {} | {how} {planted} | {at} | {:.1} at {:.2} s | {:.1} | {:.2} | {:.2} |",
                    character.0,
                    with_locks.metres * 1e3,
                    with_locks.at_secs,
                    without_locks.metres * 1e3,
                    with_locks.step * SAMPLES_PER_SECOND,
                    without_locks.step * SAMPLES_PER_SECOND
                );
                if with_locks.metres >= MAX_SLIDE {
                    faults.push(format!("{}, {how} {planted} at {at} s: {with_locks:?}", character.0));
                }
                most_without = most_without.max(without_locks.metres);
            }
        }
        least_without = least_without.min(most_without);
    }
    assert!(faults.is_empty(), "{faults:#?}");
    // Without steps every character slides.
    assert!(least_without > 2.0 * MAX_SLIDE, "{least_without} m");
}

/// `plant_feet(#{ weight: 0 })` plans no steps in a fade.
#[test]
fn steps_can_be_turned_off() {
    let fade = "anna.play(walk).until(2.0).then(idle, #{ fade: 0.5 });";
    let of = |planted: &str| {
        let text = script(&CHARACTERS[0], &format!("anna.root_motion(); {planted} {fade}"));
        let stage = stage_of_samples(Path::new("."), &text);
        let legs = find_legs(&stage.actors[0].asset.skeleton);
        (
            sample_toe_positions(&stage, &legs, 2.0, 3.0),
            sample_toe_positions(&without_foot_locks(&stage), &legs, 2.0, 3.0),
        )
    };
    let (off, without_locks) = of("anna.plant_feet(#{ weight: 0 });");
    assert_eq!(off, without_locks);
    let (on, without_locks) = of("");
    assert_ne!(on, without_locks, "it can fail");
}

/// World position and front of the actor at a time.
fn position_and_front(stage: &Stage, time: f64) -> (DVec3, DVec3) {
    let snapshot = Evaluator::new(Arc::new(stage.clone())).at(Time::from_secs(time)).unwrap();
    let world = snapshot.actors[0].world_from_model;
    let front = stage.actors[0].asset.front().direction();
    (world.translation, (world.matrix3 * front).with_y(0.0).normalize())
}

#[test]
fn walks_to_points_arrive_in_time_and_do_not_slide() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    let mut faults = Vec::new();
    println!("| file | arrives, mm | slide, mm | without steps, mm | stands | fastest foot, m/s |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: |");
    for character in &CHARACTERS {
        let text = script(
            character,
            "anna.at(1, 0, -1).turn(40);
             anna.play(idle);
             let there = anna.walk_to([3, 0, 1.5], #{ clip: walk, from: 0.5 });
             anna.walk_to([0.5, 0, 0.5], #{ clip: walk, from: there.end() + 1.0, arrive: there.end() + 5.0 });
             print(there.end());",
        );
        let stage = stage_of_samples(&folder, &text);
        // Idle, walk, idle, walk, idle.
        let arrived = stage.actors[0].layers[0].cues[1].end.unwrap().as_secs();
        let (points, starts) =
            ([DVec3::new(3.0, 0.0, 1.5), DVec3::new(0.5, 0.0, 0.5)], [DVec3::new(1.0, 0.0, -1.0)]);
        let ways = [points[0] - starts[0], points[1] - points[0]];
        let mut off: f64 = 0.0;
        for (i, end) in [arrived, arrived + 5.0].into_iter().enumerate() {
            // At the arrival, and ever after until it goes on.
            for later in [0.0, 0.5, 1.0] {
                off = off.max((position_and_front(&stage, end + later).0 - points[i]).length());
            }
            // On the way straight ahead, facing along it.
            let (at, front) = position_and_front(&stage, end - 1.2);
            let way = ways[i].normalize();
            let beside = (points[i] - at).reject_from(way).length();
            assert!(front.dot(way) > 0.9999 && beside < 1e-3, "{}: {front} {way} {beside}", character.0);
        }
        assert!(off < 0.01, "{}: {off} m off", character.0);
        let legs = find_legs(&stage.actors[0].asset.skeleton);
        let feet = sample_toe_positions(&stage, &legs, 0.3, LAST_SAMPLE_SECONDS);
        let ground = foot_ground_heights(&feet);
        let with_locks = measure_foot_slide(&feet, &ground, 0.3);
        let without_locks = measure_foot_slide(
            &sample_toe_positions(&without_foot_locks(&stage), &legs, 0.3, LAST_SAMPLE_SECONDS),
            &ground,
            0.3,
        );
        println!(
            "| {} | {:.3} | {:.1} at {:.2} s | {:.1} | {} | {:.2} |",
            character.0,
            off * 1e3,
            with_locks.metres * 1e3,
            with_locks.at_secs,
            without_locks.metres * 1e3,
            with_locks.stands,
            with_locks.step * SAMPLES_PER_SECOND
        );
        // No foot slides or pops.
        if with_locks.metres >= MAX_SLIDE
            || without_locks.metres < 5.0 * MAX_SLIDE
            || with_locks.step * SAMPLES_PER_SECOND >= POP_SPEED
        {
            faults.push(format!("{}: {with_locks:?}, {without_locks:?}", character.0));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn a_turn_on_arrival_faces_its_target_and_does_not_slide() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    let mut faults = Vec::new();
    println!("| file | off the target, degrees | slide, mm | fastest foot, m/s |");
    println!("| --- | ---: | ---: | ---: |");
    for character in &CHARACTERS {
        let text = script(
            character,
            "anna.at(1, 0, -1).turn(40);
             anna.play(idle);
             anna.walk_to([3, 0, 1.5], #{ clip: walk, from: 0.5, face: [-2, 0, 1] });",
        );
        let stage = stage_of_samples(&folder, &text);
        let arrived = stage.actors[0].layers[0].cues[1].end.unwrap().as_secs();
        let (at, front) = position_and_front(&stage, arrived + 1.5);
        let sight = (DVec3::new(-2.0, 0.0, 1.0) - at).with_y(0.0).normalize();
        let off = front.angle_between(sight).to_degrees();
        let legs = find_legs(&stage.actors[0].asset.skeleton);
        let feet = sample_toe_positions(&stage, &legs, 0.3, LAST_SAMPLE_SECONDS);
        let with_locks = measure_foot_slide(&feet, &foot_ground_heights(&feet), 0.3);
        println!(
            "| {} | {off:.4} | {:.1} at {:.2} s | {:.2} |",
            character.0,
            with_locks.metres * 1e3,
            with_locks.at_secs,
            with_locks.step * SAMPLES_PER_SECOND
        );
        if off > 0.01 || with_locks.metres >= MAX_SLIDE || with_locks.step * SAMPLES_PER_SECOND >= POP_SPEED {
            faults.push(format!("{}: {off}, {with_locks:?}", character.0));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// A stand in which a layer lifts a foot is not held.
#[test]
fn a_layer_lifts_a_foot_in_a_stand() {
    let lifted = |keys: &str| {
        let calls = format!(
            "anna.play(idle); anna.walk_to([0, 0, 3], #{{ clip: walk, from: 0.5 }});
             anna.walk_to([0, 0, 6], #{{ clip: walk, from: 14.0 }}); {keys}"
        );
        let stage = stage_of_samples(Path::new("."), &script(&CHARACTERS[0], &calls));
        let legs = find_legs(&stage.actors[0].asset.skeleton);
        let feet = sample_toe_positions(&stage, &legs, 9.0, 11.0);
        feet.iter().flatten().map(|place| place.y).fold(0.0, f64::max)
    };
    let kick = "anna.joint(\"LeftUpLeg\").key(\"rotation\", [[9.5, [0, 0, 0]], [10.0, [-60, 0, 0]], [10.5, [0, 0, 0]]]);";
    let (still, kicks) = (lifted(""), lifted(kick));
    assert!(still < 0.1 && kicks > 0.3, "{still} m, {kicks} m");
}

/// Largest height of a foot's first step, in leg lengths; `None` if the foot has not moved by a time.
fn first_lift(places: &[DVec3], leg: f64, by_secs: f64) -> Option<f64> {
    let start = places[0];
    let left = |p: &DVec3| (*p - start).with_y(0.0).length() > STEP_DISTANCE_IN_LEGS * leg;
    let gone = places.iter().position(left).filter(|i| *i as f64 / SAMPLES_PER_SECOND < by_secs)?;
    let slow = |pair: &[DVec3]| (pair[1] - pair[0]).with_y(0.0).length() * SAMPLES_PER_SECOND < LANDED_SPEED;
    let stands = places[gone..].windows(2).position(slow).map_or(places.len(), |i| gone + i);
    Some(places[..stands].iter().map(|p| p.y - start.y).fold(0.0, f64::max) / leg)
}

/// The first step lifts the foot even if a walk begins soon after the stage does.
#[test]
fn the_first_step_of_a_walk_leaves_the_ground() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    println!("| file | lift of each foot, legs |");
    println!("| --- | --- |");
    let mut faults = Vec::new();
    for character in &CHARACTERS {
        let text = script(character, "anna.play(idle); anna.walk_to([0, 0, 3], #{ clip: walk, from: 0.3 });");
        let stage = stage_of_samples(&folder, &text);
        let legs = find_legs(&stage.actors[0].asset.skeleton);
        let cue = &stage.actors[0].layers[0].cues[1];
        let walks = (cue.start + cue.fade_in).as_secs();
        let leg = leg_length(&stage, &legs[0]);
        let feet = sample_toe_positions(&stage, &legs, 0.0, walks + 1.0);
        let lifts: Vec<Option<f64>> =
            feet.iter().map(|places| first_lift(places, leg, walks - 0.1)).collect();
        println!("| {} | {lifts:.3?} |", character.0);
        if lifts.iter().flatten().any(|lift| *lift < MIN_LIFT_IN_LEGS) || lifts.iter().all(Option::is_none) {
            faults.push(format!("{}: {lifts:.3?}", character.0));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    // A foot that moves half a metre at a height of 15 mm is detected.
    let dragged: Vec<DVec3> = (0..240)
        .map(|i| {
            DVec3::new(0.0, if i > 60 { 0.015 } else { 0.0 }, (0.02 * f64::from(i - 60)).clamp(0.0, 0.5))
        })
        .collect();
    assert!(first_lift(&dragged, 0.85, 0.8).unwrap() < MIN_LIFT_IN_LEGS);
}

/// Length of a leg at time 0, in metres.
fn leg_length(stage: &Stage, leg: &Leg) -> f64 {
    let snapshot = Evaluator::new(Arc::new(stage.clone())).at(Time::ZERO).unwrap().clone();
    let state = &snapshot.actors[0];
    let place = |joint: u32| {
        let m = state.model_from_joint[joint as usize];
        state.world_from_model.transform_point3(glam::Vec3::from(m.translation).as_dvec3())
    };
    let [hip, knee, foot] = [leg.hip, leg.knee, leg.foot].map(place);
    (knee - hip).length() + (foot - knee).length()
}

/// Rise of the slope, in metres per metre.
const SLOPE: f64 = 0.2;

/// Heights above the ground of the hips and of the lower foot, at times of a walk up a slope.
fn heights_above_slope(folder: &Path, character: &Character) -> Vec<[f64; 2]> {
    let calls = format!(
        "let hill = cast(\"hill\", shape(\"box\", #{{ size: [80, 1, 8] }})).rotate(0, 0, {});
         anna.at(-8, 0, 0).face([1000, 0, 0]);
         anna.root_motion(); anna.plant_feet(#{{ ground: hill }}); anna.play(walk);",
        SLOPE.atan().to_degrees()
    );
    let stage = stage_of_samples(folder, &script(character, &calls));
    let skeleton = &stage.actors[0].asset.skeleton;
    let legs = find_legs(skeleton);
    let hips = HumanoidJoints::of(skeleton).joint("hips").unwrap_or(legs[0].hip) as usize;
    let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
    // The box stands on the plane y = 0 before it is turned about its middle there.
    let ground = |x: f64| (1.0 + SLOPE * SLOPE).sqrt() + SLOPE * x;
    let mut heights = Vec::new();
    for i in 0..=16 {
        let snapshot = evaluator.at(Time::from_secs(f64::from(i) * 0.5)).unwrap();
        let state = &snapshot.actors[0];
        let above = |joint: usize| {
            let m = state.model_from_joint[joint];
            let p = state.world_from_model.transform_point3(glam::Vec3::from(m.translation).as_dvec3());
            p.y - ground(p.x)
        };
        let foot = |leg: &Leg| above(leg.toe.unwrap_or(leg.foot) as usize);
        heights.push([above(hips), legs.iter().map(foot).fold(f64::INFINITY, f64::min)]);
    }
    heights
}

/// Hips and feet of all characters follow the ground; the hips of those whose legs hang on the spine once stayed behind.
#[test]
fn bodies_stay_above_a_slope() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    println!("| file | hips above the ground, m | lower foot, m |");
    println!("| --- | ---: | ---: |");
    let mut faults = Vec::new();
    for character in &CHARACTERS {
        let heights = heights_above_slope(&folder, character);
        let range = |which: usize| {
            let of = heights.iter().map(|h| h[which]);
            (of.clone().fold(f64::INFINITY, f64::min), of.fold(f64::NEG_INFINITY, f64::max))
        };
        let (hips, feet) = (range(0), range(1));
        println!("| {} | {:.3}–{:.3} | {:.3}–{:.3} |", character.0, hips.0, hips.1, feet.0, feet.1);
        if hips.1 - hips.0 > MAX_HEIGHT_CHANGE_ON_SLOPE * hips.1
            || feet.0 < -MAX_HEIGHT_CHANGE_ON_SLOPE * hips.1
            || feet.1 > MAX_HEIGHT_CHANGE_ON_SLOPE * hips.1
        {
            faults.push(format!("{}: {hips:?}, {feet:?}", character.0));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Shortest duration, in seconds, of the first evaluation at a time by a new evaluator.
fn shortest_first_frame_seconds(stage: &Arc<Stage>, time: f64) -> f64 {
    let one = || {
        let mut evaluator = Evaluator::new(stage.clone());
        let begun = std::time::Instant::now();
        evaluator.at(Time::from_secs(time)).unwrap();
        begun.elapsed().as_secs_f64()
    };
    (0..7).map(|_| one()).fold(f64::INFINITY, f64::min)
}

/// The first frame that needs steps plans them; earlier frames cost as much as without steps.
#[test]
fn only_frames_in_a_stop_plan_its_steps() {
    let of = |planted: &str| {
        let text = format!(
            "stage(#{{ fps: 60, length: 12 }});
             let m = load(\"choreo:mannequin\");
             camera(\"c\").at(0, 2, 20).look_at([0, 1, 0]);
             for i in 0..40 {{
                 let anna = cast(\"anna\" + i, m).at(i * 0.7, 0, 0);
                 anna.root_motion(); {planted}
                 anna.play(m.clip(\"Walk\")).until(6.17).then(m.clip(\"Idle\"), #{{ fade: 0.5 }});
             }}"
        );
        Arc::new(stage_of_samples(Path::new("."), &text))
    };
    let (steps, none) = (of(""), of("anna.plant_feet(#{ weight: 0 });"));
    let ratio =
        |time: f64| shortest_first_frame_seconds(&steps, time) / shortest_first_frame_seconds(&none, time);
    let (before, within) = (ratio(1.0), ratio(6.4));
    println!("first frame, times that without steps: {before:.2} before the stop, {within:.2} within");
    // Planning takes some hundred times as long as a frame.
    assert!(before < 20.0, "{before}");
    assert!(within > 20.0, "{within}: the measure sees planning");
}

/// Name and script calls of each way to walk.
const WALKS: [(&str, &str); 4] = [
    ("root motion", "anna.root_motion(); anna.play(walk);"),
    ("root motion, planted", "anna.root_motion(); anna.plant_feet(); anna.play(walk);"),
    ("path", "anna.play(walk); anna.path([[0, 0, 0], [4, 0, 1], [9, 0, 1]]);"),
    ("path, planted", "anna.plant_feet(); anna.play(walk); anna.path([[0, 0, 0], [4, 0, 1], [9, 0, 1]]);"),
];

/// Lowest height of each foot among the samples where it is slow.
fn foot_ground_heights(feet: &[Vec<DVec3>]) -> Vec<f64> {
    let slow = |pair: &&[DVec3]| (pair[1] - pair[0]).with_y(0.0).length() * SAMPLES_PER_SECOND < LANDED_SPEED;
    let lowest = |places: &Vec<DVec3>| {
        places.windows(2).filter(slow).map(|pair| pair[1].y).fold(f64::INFINITY, f64::min)
    };
    feet.iter().map(lowest).collect()
}

#[test]
fn feet_of_a_walk_do_not_slide() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    println!(
        "| file | how | slide, mm | without foot locking, mm | stands | fastest foot, m/s | without, m/s |"
    );
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: |");
    let mut faults = Vec::new();
    for character in &CHARACTERS {
        for (how, calls) in WALKS {
            let stage = stage_of_samples(&folder, &script(character, calls));
            let legs = find_legs(&stage.actors[0].asset.skeleton);
            let bare = without_foot_locks(&stage);
            let alone = sample_toe_positions(&bare, &legs, 0.0, 4.0);
            let locked = sample_toe_positions(&stage, &legs, 0.0, 4.0);
            let without_locks = measure_foot_slide(&alone, &foot_ground_heights(&alone), 0.0);
            let with_locks = measure_foot_slide(&locked, &foot_ground_heights(&locked), 0.0);
            let planted = calls.contains("plant_feet");
            println!(
                "| {} | {how} | {:.1} at {:.2} s | {:.1} | {} | {:.2} | {:.2} |",
                character.0,
                with_locks.metres * 1e3,
                with_locks.at_secs,
                without_locks.metres * 1e3,
                with_locks.stands,
                with_locks.step * SAMPLES_PER_SECOND,
                without_locks.step * SAMPLES_PER_SECOND
            );
            // A foot without contacts would not slide either.
            assert!(
                with_locks.stands > 2 && without_locks.metres > 0.005,
                "{}, {how}: {with_locks:?}, {without_locks:?}",
                character.0
            );
            if planted && with_locks.metres >= MAX_SLIDE {
                faults.push(format!("{}, {how}: {with_locks:?}", character.0));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// File and name of the walk of some characters, and of their run; the others run as the mannequin does.
const RUNS: [([&str; 2], [&str; 2]); 4] = [
    (["gltf/Knight.glb", "Walking_A"], ["gltf/Knight.glb", "Running_A"]),
    (["gltf/Fox.glb", "Walk"], ["gltf/Fox.glb", "Run"]),
    (["gltf/RobotExpressive.glb", "Walking"], ["gltf/RobotExpressive.glb", "Running"]),
    (["fbx/pab/locomotions.fbx", "walk"], ["fbx/pab/locomotions.fbx", "run"]),
];

/// Duration of the fade between gaits in seconds.
const GAIT_FADE_SECONDS: f64 = 0.6;
/// Largest ratio of foot speeds with and without foot locking; a foot that is held longer than in the clips has to catch up.
const MAX_SPEED_RATIO: f64 = 1.6;

/// While one gait fades into another, a foot stays in its place or is lifted.
#[test]
fn feet_do_not_slide_while_a_walk_becomes_a_run() {
    let Some(folder) = choreo_importer_kit_testing::assets(8) else { return };
    println!("| file | how | at, s | slide, mm | without, mm | stands | fastest foot, m/s | without, m/s |");
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let (mut faults, mut worst_without) = (Vec::new(), 0.0f64);
    for character in &CHARACTERS {
        let own_run = RUNS.iter().find(|(walk, _)| *walk == character.2);
        let [file, name] = own_run.map_or(["choreo:mannequin", "Run"], |(_, run)| *run);
        for (from, to) in [("walk", "run"), ("run", "walk")] {
            for at in (0..12).map(|i| 1.4 + 0.05 * f64::from(i)) {
                let calls = format!(
                    "let run = load(\"{file}\").clip(\"{name}\"); anna.root_motion();
                     anna.play({from}).until({at}).then({to}, #{{ fade: {GAIT_FADE_SECONDS}, in_step: true }});"
                );
                let stage = stage_of_samples(&folder, &script(character, &calls));
                let legs = find_legs(&stage.actors[0].asset.skeleton);
                let ground = foot_ground_heights(&sample_toe_positions(
                    &stage,
                    &legs,
                    at - GAIT_FADE_SECONDS,
                    at + 2.0 * GAIT_FADE_SECONDS,
                ));
                let watch = |stage: &Stage| {
                    measure_foot_slide(
                        &sample_toe_positions(stage, &legs, at, at + GAIT_FADE_SECONDS),
                        &ground,
                        at,
                    )
                };
                let (with_locks, without_locks) = (watch(&stage), watch(&without_foot_locks(&stage)));
                println!(
                    "| {} | {from} to {to} | {at:.2} | {:.1} at {:.2} s | {:.1} | {} | {:.2} | {:.2} |",
                    character.0,
                    with_locks.metres * 1e3,
                    with_locks.at_secs,
                    without_locks.metres * 1e3,
                    with_locks.stands,
                    with_locks.step * SAMPLES_PER_SECOND,
                    without_locks.step * SAMPLES_PER_SECOND
                );
                worst_without = worst_without.max(without_locks.metres);
                if with_locks.metres >= MAX_SLIDE || with_locks.step >= MAX_SPEED_RATIO * without_locks.step {
                    faults.push(format!("{}, {from} to {to} at {at:.2} s: {with_locks:?}", character.0));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(worst_without > 8.0 * MAX_SLIDE, "without foot locking it must fail: {worst_without} m");
}

/// The character goes on at a switch from a run to a stand, so that the legs need not bend for feet that are left behind.
#[test]
fn hips_do_not_drop_where_a_run_stops() {
    let text = include_str!("../../../../scripts/37_steps.rhai");
    let stage = stage_of_samples(Path::new("."), text);
    let bob = stage.actors.iter().position(|actor| actor.name == "bob").unwrap();
    let hips = stage.actors[bob].asset.skeleton.find("mixamorig:Hips").unwrap();
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let mut lowest = |from: f64, to: f64| {
        let height = |i: i64| {
            let snapshot = evaluator.at(Time::from_secs(from + i as f64 / 120.0)).unwrap();
            f64::from(snapshot.actors[bob].model_from_joint[hips].translation.y)
        };
        (0..=((to - from) * 120.0) as i64).map(height).fold(f64::INFINITY, f64::min)
    };
    let (before, after) = (lowest(3.6, 4.2), lowest(4.2, 6.0));
    println!("hips: {before:.4} m at the lowest in the run, {after:.4} m from the switch on");
    assert!(after > LOWEST_HIPS, "{after} m, {before} m in the run");
}

/// A foot that is dragged and one that jumps exceed the bounds of the tests above.
#[test]
fn the_bounds_see_a_dragged_foot_and_a_pop() {
    let text = script(&CHARACTERS[0], WALKS[1].1);
    let stage = stage_of_samples(Path::new("."), &text);
    let legs = find_legs(&stage.actors[0].asset.skeleton);
    let feet = sample_toe_positions(&stage, &legs, 0.0, 4.0);
    let with_locks = measure_foot_slide(&feet, &foot_ground_heights(&feet), 0.0);
    assert!(
        with_locks.metres < MAX_SLIDE && with_locks.step * SAMPLES_PER_SECOND < POP_SPEED,
        "{with_locks:?}"
    );
    // 5 cm/s, over contacts of more than half a second.
    let dragged = |places: &Vec<DVec3>| {
        let moved = |(i, p): (usize, &DVec3)| *p + DVec3::X * (0.05 * i as f64 / SAMPLES_PER_SECOND);
        places.iter().enumerate().map(moved).collect()
    };
    let faulty: Vec<Vec<DVec3>> = feet.iter().map(dragged).collect();
    let seen = measure_foot_slide(&faulty, &foot_ground_heights(&faulty), 0.0);
    assert!(seen.metres > MAX_SLIDE, "{seen:?}");
    let mut faulty = feet;
    faulty[0][500] += DVec3::Z * 0.06;
    let seen = measure_foot_slide(&faulty, &foot_ground_heights(&faulty), 0.0);
    assert!(seen.step * SAMPLES_PER_SECOND > POP_SPEED, "{seen:?}");
}
