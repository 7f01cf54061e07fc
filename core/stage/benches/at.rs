//! Benchmark of `Evaluator::at_into` (`cargo bench -p choreo-stage`): median time per frame on one thread.

#[path = "../tests/support/mod.rs"]
mod support;
use choreo_asset::*;
use choreo_motion::{Path, Time, Transform};
use choreo_stage::*;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use support::*;

/// An asset with a chain of 67 joints and two clips that rotate every joint, with 30 keys per second for 2 s.
fn puppet() -> Arc<Asset> {
    const JOINTS: u32 = 67;
    let joints: Vec<(String, Option<u32>, Transform)> =
        (0..JOINTS).map(|j| (format!("j{j}"), j.checked_sub(1), at(0.0, 0.03, 0.0))).collect();
    let skeleton = skeleton(&joints.iter().map(|j| (j.0.as_str(), j.1, j.2)).collect::<Vec<_>>());
    let turning = |phase: f32| {
        let curves = (0..JOINTS).map(|joint| {
            let key = |k: usize| {
                let angle = 0.2 * libm::sinf(k as f32 * 0.2 + phase + joint as f32);
                (k as f64 / 30.0, glam::Quat::from_rotation_x(angle).to_array())
            };
            let keys: Vec<(f64, [f32; 4])> = (0..=60).map(key).collect();
            curve(joint, Path::Rotation, &keys.iter().map(|(t, q)| (*t, &q[..])).collect::<Vec<_>>())
        });
        clip("turning", JOINTS as usize, curves.collect())
    };
    Arc::new(Asset { skeleton, clips: vec![turning(0.0), turning(1.0)], ..Asset::default() })
}

fn stage(actors: usize, fade: bool) -> Stage {
    let asset = puppet();
    let mut stage = Stage::default();
    let target = Target::Actor(0);
    stage.shoot(Camera::new(
        "c",
        Rig::Orbit { target, distance: 9.0, elevation: 0.2, azimuth: 0.0, speed: 0.1 },
    ));
    for i in 0..actors {
        let actor = stage.cast("puppet", asset.clone());
        stage.actors[actor].transform = Placement::at(i as f64, 0.0, 0.0);
        stage.play(actor, Cue::new(asset.clips[0].clone()));
        if fade {
            let cue = Cue { start: secs(-1.0), fade_in: secs(1e6), ..Cue::new(asset.clips[1].clone()) };
            stage.actors[actor].layers[0].cues[0].start = secs(-2.0);
            stage.play(actor, cue);
        }
    }
    stage
}

fn main() {
    // `cargo test --benches` passes arguments that request a trial run only.
    let runs = if std::env::args().any(|a| a == "--bench") { 200 } else { 1 };
    println!("{:<44}{:>14}{:>16}", "case", "µs a frame", "ns a character");
    for (actors, fade) in [(1, false), (1, true), (25, true), (1000, true)] {
        let mut evaluator = Evaluator::new(Arc::new(stage(actors, fade)));
        let mut snapshot = Snapshot::default();
        let mut times: Vec<f64> = (0..runs)
            .map(|i| {
                let begin = Instant::now();
                evaluator
                    .at_into(Time::from_secs(f64::from(i) * 0.37), &mut snapshot)
                    .expect("a sound stage");
                black_box(&snapshot);
                begin.elapsed().as_secs_f64()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let median = times[times.len() / 2];
        let what = if fade { "crossfade of two clips" } else { "one clip" };
        let case = format!("{actors} characters, 67 joints, {what}");
        println!("{case:<44}{:>14.2}{:>16.0}", median * 1e6, median * 1e9 / actors as f64);
    }
}
