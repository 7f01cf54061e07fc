//! Fades from walk to run in step: planted feet do not slide, for characters with two and with four feet. Detected contacts of third-party
//! files are compared with contacts found by eye. `cargo test -p choreo --test motions in_step -- --nocapture` prints the tables.

use crate::common;
use choreo_motion::Time;
use choreo_motion::contacts::{Contacts, Foot, find_feet};
use choreo_plugin::Registry;
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::{ConstraintKind, Evaluator, Leg, Stage, find_legs};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;

fn stage(folder: &Path, text: &str) -> Stage {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_fbx::FbxImporter);
    registry.add_importer(import_mannequin::Mannequin);
    let options = ScriptOptions { search_paths: vec![folder.to_path_buf()], ..ScriptOptions::default() };
    let script =
        run_text("in_step.rhai", text, folder, &registry, &options).unwrap_or_else(|e| panic!("{e:?}"));
    assert!(script.warnings.is_empty(), "{:?}", script.warnings);
    script.stage
}

/// File, scale, clip to fade from, clip to fade to, and length of the fade in seconds.
const PAIRS: [(&str, f64, &str, &str, f64); 10] = [
    ("choreo:mannequin", 1.0, "Walk", "Run", 0.5),
    ("choreo:mannequin", 1.0, "Run", "Walk", 0.5),
    ("gltf/Knight.glb", 1.0, "Walking_A", "Running_A", 0.6),
    ("gltf/Knight.glb", 1.0, "Running_A", "Walking_A", 0.6),
    ("gltf/Knight.glb", 1.0, "Walking_B", "Running_B", 0.6),
    ("fbx/pab/locomotions.fbx", 1.0, "walk", "jog", 0.6),
    ("fbx/pab/locomotions.fbx", 1.0, "walk", "run", 0.6),
    ("fbx/pab/locomotions.fbx", 1.0, "run", "walk", 0.6),
    // The fox of the file is 100 m long, and is scaled to natural size.
    ("gltf/Fox.glb", 0.01, "Walk", "Run", 0.6),
    ("gltf/Fox.glb", 0.01, "Run", "Walk", 0.6),
];

/// A foot counts as planted after this number of samples, at 240 per second.
const MIN_PLANTED_SAMPLES: u32 = 12;

struct StepErrors {
    /// The largest movement of a planted foot, in metres in world space, and the number of stances.
    moved: f64,
    stands: usize,
    /// The largest movement of a foot between two samples.
    step: f64,
}

/// `planted` states whether a leg should be planted at a time.
fn measure_steps(
    stage: &Stage,
    legs: &[Leg],
    from: f64,
    to: f64,
    planted: &dyn Fn(usize, Time) -> bool,
) -> StepErrors {
    let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
    let mut errors = StepErrors { moved: 0.0, stands: 0, step: 0.0 };
    // Of each planted foot: where it was planted, how many samples ago, and how far it has moved since.
    let mut begun: Vec<Option<(DVec3, u32, f64)>> = vec![None; legs.len()];
    let mut before: Vec<Option<DVec3>> = vec![None; legs.len()];
    let count = ((to - from) * 240.0) as i64;
    for i in 0..=count {
        let time = Time::from_secs(from + i as f64 / 240.0);
        let snapshot = evaluator.at(time).unwrap();
        let state = &snapshot.actors[0];
        for (index, leg) in legs.iter().enumerate() {
            let m = state.model_from_joint[leg.toe.unwrap_or(leg.foot) as usize];
            let now = state.world_from_model.transform_point3(glam::Vec3::from(m.translation).as_dvec3());
            errors.step = errors.step.max(before[index].map_or(0.0, |b| (now - b).length()));
            before[index] = Some(now);
            if !planted(index, time) {
                begun[index] = None;
                continue;
            }
            let (first, samples, moved) = begun[index].get_or_insert((now, 0, 0.0));
            *samples += 1;
            *moved = moved.max((now - *first).length());
            // A contact of less than a twentieth of a second is not a stance.
            if *samples > MIN_PLANTED_SAMPLES {
                errors.stands += usize::from(*samples == MIN_PLANTED_SAMPLES + 1);
                errors.moved = errors.moved.max(*moved);
            }
        }
    }
    errors
}

#[test]
fn planted_feet_do_not_slide_in_a_fade_from_walk_to_run() {
    let Some(folder) = common::sample_assets_folder() else { return };
    println!(
        "| file | from | to | at, s | planted feet | move, mm | without planting, mm | fastest foot, m/s | without, m/s |"
    );
    println!("| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let mut worst_without = 0.0f64;
    for (file, scale, from, to, fade) in PAIRS {
        for start in [1.4, 1.55, 1.7, 1.85] {
            let text = format!(
                "stage(#{{ fps: 60, length: 4 }});
                 let a = load(\"{file}\");
                 let anna = cast(\"anna\", a).at(0, 0, 0).scale({scale});
                 anna.root_motion();
                 anna.play(a.clip(\"{from}\")).until({start}).then(a.clip(\"{to}\"), #{{ fade: {fade}, in_step: true }});"
            );
            let stage = stage(&folder, &text);
            let mut without = stage.clone();
            without.actors[0].constraints.retain(|g| !matches!(g.kind, ConstraintKind::FootLock(_)));
            assert_ne!(
                stage.actors[0].constraints, without.actors[0].constraints,
                "{file}: nothing is planted"
            );
            let actor = &stage.actors[0];
            let skeleton = &actor.asset.skeleton;
            let legs = find_legs(skeleton);
            let feet = find_feet(skeleton);
            assert_eq!(
                (legs.len(), feet.len()),
                if file.contains("Fox") { (4, 4) } else { (2, 2) },
                "{file}"
            );
            let balls: Vec<Foot> =
                legs.iter().map(|l| Foot { joints: vec![l.toe.unwrap_or(l.foot)] }).collect();
            let contacts: Vec<Contacts> = actor.layers[0]
                .cues
                .iter()
                .map(|cue| Contacts::find(skeleton, &cue.clip, cue.trim, &balls).unwrap())
                .collect();
            // A foot should be planted when the clip with the larger weight plants it.
            let planted = |leg: usize, time: Time| {
                let active_clips = actor.active_clips(time);
                let Some(most) = active_clips.iter().rev().find(|h| h.weight >= 0.5) else { return false };
                let round = actor.layers[0].cues[most.cue].trim.1;
                let at = most.clip_time;
                let stands = &contacts[most.cue].intervals[leg];
                // Without a sixtieth of a second at each end: contacts are sampled at this rate.
                let edge = Time::from_secs(1.0 / 60.0);
                let within = |t: Time| stands.iter().any(|s| s.from + edge <= t && t <= s.to - edge);
                within(at) || within(at + round)
            };
            let (begin, end) = (start, start + fade);
            let (own, plain) = (
                measure_steps(&stage, &legs, begin, end, &planted),
                measure_steps(&without, &legs, begin, end, &planted),
            );
            println!(
                "| {file} | {from} | {to} | {start} | {} | {:.2} | {:.1} | {:.2} | {:.2} |",
                own.stands,
                own.moved * 1e3,
                plain.moved * 1e3,
                own.step * 240.0,
                plain.step * 240.0
            );
            assert!(own.stands > 0, "{file}: no foot is planted from {start} s on");
            // The paws of the fox take a step if a contact lasts longer than the leg can reach; `core/script/tests/footsteps/footsteps.rs`
            // tests this.
            assert!(
                own.moved < 1e-4 || file.contains("Fox"),
                "{file}, {from} to {to} at {start} s: a planted foot moves {} m",
                own.moved
            );
            // Nothing pops: a foot that is held longer than in the clips has to catch up, and takes several frames for it.
            assert!(
                own.step < 1.6 * plain.step,
                "{file}, {from} to {to} at {start} s: {} m in a step",
                own.step
            );
            worst_without = worst_without.max(plain.moved);
        }
    }
    assert!(worst_without > 0.03, "the same without planting must fail: {worst_without}");
}

/// Contacts found by eye in the frames of the clips, in seconds: when heel or ball stops moving down or forward, and when the ball rises.
const CONTACTS_SEEN: [(&str, &str, &str, f64, f64); 7] = [
    ("gltf/Knight.glb", "Walking_A", "foot.l", 0.02, 0.48),
    ("gltf/Knight.glb", "Walking_A", "foot.r", 0.55, 1.01),
    ("gltf/Knight.glb", "Running_A", "foot.l", 0.12, 0.19),
    ("gltf/Knight.glb", "Running_A", "foot.r", 0.52, 0.59),
    ("fbx/pab/locomotions.fbx", "run", "RightFoot", 0.27, 0.44),
    ("fbx/pab/locomotions.fbx", "run", "LeftFoot", 0.60, 0.78),
    ("fbx/pab/locomotions.fbx", "walk", "RightFoot", 0.28, 1.04),
];

#[test]
fn detected_contacts_match_the_contacts_seen_in_the_clips() {
    let Some(folder) = common::sample_assets_folder() else { return };
    println!("| file | clip | foot | found, s | seen, s |");
    println!("| --- | --- | --- | --- | --- |");
    for (file, clip, foot, from, to) in CONTACTS_SEEN {
        let stage = stage(
            &folder,
            &format!(
                "let a = load(\"{file}\"); let b = cast(\"b\", a).at(0, 0, 0); b.play(a.clip(\"{clip}\"));"
            ),
        );
        let asset = &stage.actors[0].asset;
        let feet = find_feet(&asset.skeleton);
        let own = feet
            .iter()
            .position(|f| f.joints.iter().any(|j| asset.skeleton.names()[*j as usize] == foot))
            .unwrap_or_else(|| panic!("{file}: no foot {foot}"));
        let clip_of = asset.clips.iter().find(|c| c.name == clip).unwrap();
        let all = Contacts::find(&asset.skeleton, clip_of, (Time::ZERO, clip_of.duration), &feet).unwrap();
        let stands: Vec<(f64, f64)> =
            all.intervals[own].iter().map(|s| (s.from.as_secs(), s.to.as_secs())).collect();
        println!("| {file} | {clip} | {foot} | {stands:.3?} | {from}–{to} |");
        let near = |(a, b): &(f64, f64)| (a - from).abs() < 0.08 && (b - to).abs() < 0.08;
        assert!(
            stands.len() == 1 && stands.iter().all(near),
            "{file}, {clip}, {foot}: {stands:?}, seen {from}–{to}"
        );
    }
}
