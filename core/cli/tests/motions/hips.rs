//! The hips in retargeted clips move as smoothly as those of the source, and feet that stand stay on the floor, for every sample character.
//! `cargo test --workspace --test motions hips -- --nocapture` prints the table.

use crate::common;
use crate::retargeting::{Character, characters, foot_clearance, model_space_pose};
use choreo_motion::retarget::{Retarget, RetargetOptions};
use choreo_motion::{Clip, HumanoidJoints, Time};

/// Characters to which clips are retargeted.
const TARGET_CHARACTERS: [&str; 20] = [
    "choreo:mannequin",
    "gltf/Knight.glb",
    "gltf/CesiumMan.glb",
    "gltf/RobotExpressive.glb",
    "fbx/pab/arnaud.fbx",
    "fbx/pab/run.fbx",
    "fbx/pab/walk.fbx",
    "fbx/pab/locomotions.fbx",
    "bvh/walk01.bvh",
    "bvh/mocopi-mobile-arm-raise-turn.bvh",
    "vrm/cool_loops.vrm",
    "vrm/Godette_vrm_v4.vrm",
    "vrm/debug_robot.vrm",
    "vrm/mtoon_default.vrm",
    "vrm/smoke_spring.vrm",
    "vrm/springbone_collider_sphere_x0p02_r0p1.vrm",
    "vrm/VRMC_materials_mtoon_UV_Animation_Test.vrm",
    "vrm/VRMC_vrm_expressions_isBinary_Overrides.vrm",
    "dae/pab/walk.dae",
    "dae/walk.dae",
];

/// Clips with and without phases in which no foot touches the floor.
const CLIPS: [(&str, &str); 13] = [
    ("choreo:mannequin", "Run"),
    ("choreo:mannequin", "Walk"),
    ("choreo:mannequin", "Dance_Groove"),
    ("gltf/Knight.glb", "Running_A"),
    ("gltf/Knight.glb", "Running_B"),
    ("gltf/Knight.glb", "Jump_Full_Short"),
    ("gltf/Knight.glb", "Walking_A"),
    ("gltf/CesiumMan.glb", "0"),
    ("fbx/pab/run.fbx", "run"),
    ("fbx/pab/locomotions.fbx", "jog"),
    ("fbx/pab/locomotions.fbx", "run"),
    ("fbx/pab/walk.fbx", "walk"),
    ("bvh/walk01.bvh", "0"),
];

const RATE: f64 = 240.0;
/// Samples per frame of 1/60 s.
const FRAME: usize = 4;
/// An ankle is as high as in a stance if the difference is below this share of the leg length of the source.
const FLAT: f64 = 0.01;

/// All errors are in millimetres for a leg of one metre. The lift is the height of the hips minus the scaled height of the source's hips.
#[derive(Default)]
struct HipErrors {
    /// The largest change of the lift in a frame.
    step: f64,
    /// The largest second difference of the lift between frames, and its time.
    jolt: f64,
    at_secs: f64,
    /// The largest second differences of the height of the hips, and of the scaled height of the source's hips.
    jolts: [f64; 2],
    /// The range of the lift.
    range: f64,
    /// The largest height error of the lowest foot while a sole of the source is on the floor.
    standing: f64,
    /// How much farther the lowest foot is below the floor than that of the source.
    sinks: f64,
    /// Whether both characters stand on their feet in the rest pose; otherwise the two numbers above are meaningless.
    stands: bool,
}

/// The largest second difference at a distance of one frame, and its index.
fn largest_jolt(heights: &[f64]) -> (f64, usize) {
    let all = heights.windows(2 * FRAME + 1).enumerate();
    let jolt = |(i, all): (usize, &[f64])| ((all[0] - 2.0 * all[FRAME] + all[2 * FRAME]).abs(), i + FRAME);
    all.map(jolt).fold((0.0, 0), |most, next| if next.0 > most.0 { next } else { most })
}

fn measure_hips(from: &Character, clip: &Clip, to: &Character) -> Option<HipErrors> {
    let (source, target) = (&from.asset.skeleton, &to.asset.skeleton);
    let retarget = Retarget::new(source, target, RetargetOptions::default());
    if !retarget.is_humanoid() {
        return None;
    }
    let (on, report) = retarget.clip(clip);
    let humans = [source, target].map(|s| HumanoidJoints::of(s));
    let rests = [source, target].map(|s| model_space_pose(s, None, Time::ZERO));
    let hips = [0, 1].map(|i| humans[i].joint("hips").unwrap() as usize);
    let leg = |i: usize| {
        let place = |n: &str| rests[i][humans[i].joint(n).unwrap() as usize].translation;
        (place("left leg") - place("left upleg")).length() + (place("left foot") - place("left leg")).length()
    };
    let [own_leg, leg] = [leg(0), leg(1)];
    let toes = ["left toebase", "right toebase"].iter().all(|n| {
        let [own, theirs] = [0, 1].map(|i| humans[i].joint(n));
        own.is_some() && theirs.is_some_and(|toe| retarget.map().source(toe) == own)
    });
    let mut errors =
        HipErrors { stands: report.rests_standing && report.target_stands, ..HipErrors::default() };
    let (mut own, mut theirs, mut feet) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=(clip.duration.as_secs() * RATE) as i64 {
        let time = Time::from_secs(i as f64 / RATE);
        let [a, b] = [model_space_pose(source, Some(clip), time), model_space_pose(target, Some(&on), time)];
        own.push(a[hips[0]].translation.y * retarget.scale() / leg * 1e3);
        theirs.push(b[hips[1]].translation.y / leg * 1e3);
        let ankle = foot_clearance(&humans[0], &rests[0], &a, false) / own_leg;
        let wanted = foot_clearance(&humans[0], &rests[0], &a, toes) * retarget.scale() / leg * 1e3;
        feet.push((ankle, wanted, foot_clearance(&humans[1], &rests[1], &b, toes) / leg * 1e3));
    }
    let lowest = feet.iter().map(|a| a.0).fold(f64::MAX, f64::min).max(0.0);
    let flat = |(ankle, wanted, is): &(f64, f64, f64)| (ankle - lowest < FLAT).then_some(is - wanted);
    let mut off: Vec<f64> = feet.iter().filter_map(flat).collect();
    off.sort_by(f64::total_cmp);
    // Other joints than these may be the lowest ones of a foot.
    let always = off.get(off.len() / 2).copied().unwrap_or(0.0);
    errors.standing = off.iter().map(|off| (off - always).abs()).fold(0.0, f64::max);
    let below = |(_, wanted, is): &(f64, f64, f64)| wanted.min(0.0) - (is - always);
    errors.sinks = feet.iter().map(below).fold(0.0, f64::max);
    let raised: Vec<f64> = theirs.iter().zip(&own).map(|(a, b)| a - b).collect();
    errors.step = raised.windows(FRAME + 1).map(|all| (all[FRAME] - all[0]).abs()).fold(0.0, f64::max);
    let (jolt, at) = largest_jolt(&raised);
    (errors.jolt, errors.at_secs) = (jolt, at as f64 / RATE);
    errors.jolts = [largest_jolt(&theirs).0, largest_jolt(&own).0];
    let (low, high) = raised.iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
    errors.range = high - low;
    Some(errors)
}

#[test]
fn hips_of_retargeted_clips_do_not_jolt() {
    let Some(folder) = common::sample_assets_folder() else { return };
    let bodies = characters(&folder, &TARGET_CHARACTERS.map(|name| (name, "")));
    let sources = characters(&folder, &CLIPS);
    println!(
        "| clip and body | hips, mm a frame | change of it | at | hips' own | the source's | range | sole | sinks |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    let mut pairs = 0;
    for from in &sources {
        let clip = from.clip.as_ref().unwrap_or_else(|| panic!("{} has no such clip", from.asset.name));
        // The clips of the Knight stretch and shorten its legs by up to a fifth; other characters have legs of constant length.
        let stretches = from.asset.name.contains("Knight");
        for to in &bodies {
            let Some(errors) = measure_hips(from, clip, to) else { continue };
            let names = format!("{} of {} on {}", clip.name, from.asset.name, to.asset.name);
            let [own, source] = errors.jolts;
            println!(
                "| {names} | {:.1} | {:.1} | {:.3} s | {own:.1} | {source:.1} | {:.1} | {:.2} | {:.2} |{}",
                errors.step,
                errors.jolt,
                errors.at_secs,
                errors.range,
                errors.standing,
                errors.sinks,
                if errors.stands { "" } else { " (does not rest standing)" }
            );
            // With a lift that is not smooth, the largest second difference is 195 mm (62 mm for legs of constant length), and the mean 37 mm.
            assert!(errors.jolt < if stretches { 15.0 } else { 12.0 }, "{names}: {} mm", errors.jolt);
            if errors.stands {
                assert!(own < 1.2 * source + 2.0, "{names}: {own} mm, the source {source} mm");
                assert!(
                    errors.standing < if stretches { 26.0 } else { 7.5 },
                    "{names}: {} mm",
                    errors.standing
                );
                assert!(errors.sinks < 10.0, "{names}: {} mm", errors.sinks);
            }
            pairs += 1;
        }
    }
    assert!(pairs >= 260, "{pairs}");
}
