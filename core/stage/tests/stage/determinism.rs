//! A snapshot is a function of the time: any order, any thread, used or fresh memory.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::*;
use std::sync::Arc;

/// A stage with clips, layers, look-ats, parents, keys, cameras and cuts.
fn scene() -> Stage {
    let f = figure();
    let mut stage = Stage::default();
    stage.settings.length = secs(6.0);
    let [anna, boris] = ["anna", "boris"].map(|name| stage.cast(name, f.clone()));
    let sword = stage.cast("sword", stick());
    stage.actors[boris].transform = Placement::at(2.0, 0.0, 0.0);
    stage.actors[boris].face = Some(anna);
    stage.actors[sword].parents = vec![Parenting::always(Attachment { actor: anna, joint: Some(HAND) })];
    stage.actors[boris].look_at.push(LookAt::new(HEAD, Target::Joint { actor: anna, joint: HAND }));
    for (i, start) in [0.0, 1.0, 1.7, 4.0].into_iter().enumerate() {
        let cue = Cue { start: secs(start), fade_in: secs(0.9), speed: 1.1, ..Cue::new(f.clips[i].clone()) };
        stage.play(anna, cue.clone());
        stage.play(boris, Cue { start: cue.start + secs(0.3), ease: Ease::Smooth, ..cue });
    }
    let mut over = Layer { mask: Some(Arc::new(vec![0.0, 0.2, 1.0, 1.0, 0.5])), ..Layer::default() };
    over.add(Cue {
        start: secs(2.0),
        end: Some(secs(3.0)),
        fade_in: secs(0.2),
        ..Cue::new(f.clips[RAISE].clone())
    });
    stage.actors[boris].layers.push(over);
    stage.play(sword, Cue::new(stick().clips[0].clone()));
    stage.actors[sword].channels.push(Channel {
        property: Property::Visible,
        interpolation: Interpolation::Step,
        times: vec![secs(0.0), secs(3.0), secs(3.5)],
        values: vec![1.0, 0.0, 1.0],
    });
    stage.shoot(Camera::new("wide", Rig::Frame { azimuth: 0.1, elevation: 0.2 }));
    let target = Target::Actor(sword);
    stage.shoot(Camera::new(
        "o",
        Rig::Orbit { target, distance: 3.0, elevation: 0.1, azimuth: 0.0, speed: 1.0 },
    ));
    stage.cuts = vec![Cut::new(secs(2.5), 1), Cut::new(secs(5.0), 0)];
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

fn times() -> Vec<Time> {
    (0..90).map(|i| secs(i as f64 / 15.0)).collect()
}

#[test]
fn snapshots_are_bit_identical_in_any_frame_order_on_any_thread() {
    let stage = Arc::new(scene());
    let fresh: Vec<ContentHash> = times().iter().map(|t| stage.at(*t).unwrap().content_hash()).collect();
    assert!(fresh.windows(2).all(|w| w[0] != w[1]), "frames differ, or the hash sees nothing");
    // Backwards and in leaps, with used memory.
    let mut evaluator = Evaluator::new(stage.clone());
    let mut snapshot = Snapshot::default();
    let backwards = (0..fresh.len()).rev();
    for i in backwards.chain((0..fresh.len()).map(|i| i * 37 % fresh.len())) {
        evaluator.at_into(times()[i], &mut snapshot).unwrap();
        assert_eq!(snapshot.content_hash(), fresh[i], "frame {i}");
    }
    // Several threads share the results of framing.
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (mut evaluator, fresh) = (evaluator.clone(), &fresh);
            scope.spawn(move || {
                for i in (thread..fresh.len()).step_by(4) {
                    assert_eq!(evaluator.at(times()[i]).unwrap().content_hash(), fresh[i]);
                }
            });
        }
    });
}

#[test]
fn evaluator_overwrites_a_snapshot_of_another_stage() {
    let mut snapshot = Snapshot::default();
    Evaluator::new(Arc::new(scene())).at_into(secs(1.0), &mut snapshot).unwrap();
    let mut small = Stage::default();
    small.cast("stick", stick());
    let expected = small.at(secs(1.0)).unwrap().content_hash();
    Evaluator::new(Arc::new(small)).at_into(secs(1.0), &mut snapshot).unwrap();
    assert_eq!(snapshot.content_hash(), expected);
}

#[test]
fn content_hash_of_a_snapshot_changes_with_one_bit() {
    let stage = scene();
    let mut snapshot = stage.at(secs(1.0)).unwrap();
    let before = snapshot.content_hash();
    let m = &mut snapshot.actors[1].model_from_joint[2];
    m.translation.x = f32::from_bits(m.translation.x.to_bits() ^ 1);
    assert_ne!(snapshot.content_hash(), before);
}

/// A crowd is posed by as many threads as there are.
#[test]
fn snapshots_are_bit_identical_for_any_number_of_threads() {
    let f = figure();
    let mut stage = Stage::default();
    for i in 0..120 {
        let actor = stage.cast(&format!("{i}"), f.clone());
        stage.actors[actor].transform = Placement::at(f64::from(i), 0.0, 0.0);
        let clip = f.clips[i as usize % f.clips.len()].clone();
        stage.play(actor, Cue { speed: 1.0 + f64::from(i) * 0.01, ..Cue::new(clip) });
        // Some are not seen, and not posed.
        stage.actors[actor].visible = i % 7 != 3;
    }
    let stage = Arc::new(stage);
    let hashes = |threads: usize| -> Vec<ContentHash> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut evaluator = Evaluator::new(stage.clone());
            let mut snapshot = Snapshot::default();
            let mut at = |t: f64| {
                evaluator.at_into(secs(t), &mut snapshot).unwrap();
                assert!(evaluator.poses() > 100);
                snapshot.content_hash()
            };
            [0.1, 2.3, 0.7].map(&mut at).to_vec()
        })
    };
    let one = hashes(1);
    assert!(one[0] != one[1], "the hash must see poses");
    for threads in [2, 3, 16] {
        assert_eq!(hashes(threads), one, "{threads} threads");
    }
}
