//! After the first frames an evaluation allocates nothing: counted by the allocator.

#[path = "../../motion/tests/support/counting.rs"]
mod counting;
mod support;

use choreo_motion::Time;
use choreo_stage::*;
use counting::allocations;
use glam::{DVec3, Vec3};
use std::sync::Arc;
use support::*;

/// Two characters that play several clips, one of them on several layers.
fn stage_with_clips() -> Stage {
    let f = figure();
    let mut stage = Stage::default();
    stage.settings.length = secs(4.0);
    let [anna, boris] = ["anna", "boris"].map(|name| stage.cast(name, f.clone()));
    stage.actors[boris].transform = Placement::at(2.0, 0.0, 0.0);
    stage.actors[boris].face = Some(anna);
    for (i, start) in [0.0, 1.0, 2.5].into_iter().enumerate() {
        let cue = Cue { start: secs(start), fade_in: secs(0.9), speed: 1.1, ..Cue::new(f.clips[i].clone()) };
        stage.play(anna, cue.clone());
        stage.play(boris, Cue { start: cue.start + secs(0.3), ease: Ease::Smooth, ..cue });
    }
    let mut over = Layer { mask: Some(Arc::new(vec![0.0, 0.2, 1.0, 1.0, 0.5])), ..Layer::default() };
    over.add(Cue { start: secs(1.0), fade_in: secs(0.2), ..Cue::new(f.clips[RAISE].clone()) });
    let mut nod = Layer { rank: 1, ..Layer::default() };
    nod.add(Cue { start: secs(0.5), ..Cue::new(f.clips[NOD].clone()) });
    stage.actors[boris].layers.extend([over, nod]);
    stage.shoot(Camera::new("wide", Rig::Frame { azimuth: 0.1, elevation: 0.2 }));
    stage
}

fn stage_with_constraints() -> Stage {
    let mut stage = stage_with_clips();
    stage.actors[1].look_at.push(LookAt::new(HEAD, Target::Joint { actor: 0, joint: HAND }));
    let reach = ReachConstraint {
        joints: vec![CHEST, ARM, HAND],
        target: Target::Joint { actor: 1, joint: HEAD },
        offset: None,
        pole: None,
        hint: DVec3::NEG_Z,
        soft: 0.0,
        keep_rotation: false,
    };
    stage.actors[0]
        .constraints
        .push(Constraint { fade: secs(0.5), ..Constraint::new(ConstraintKind::Reach(reach)) });
    stage
}

fn stage_with_springs() -> Stage {
    let mut stage = stage_with_constraints();
    let rig = spring_rig([HEAD, ARM], Vec3::Y * 0.2);
    stage.actors[1].springs = Some(Arc::new(ActorSprings { rig, ..ActorSprings::default() }));
    stage
}

/// Allocations of each frame of four seconds but the first, played twice.
fn allocations_by_frame(stage: Stage) -> [Vec<usize>; 2] {
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    let rate = choreo_motion::FrameRate { num: 30, den: 1 };
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let mut snapshot = Snapshot::default();
    evaluator.at_into(Time::ZERO, &mut snapshot).unwrap();
    [(); 2].map(|()| {
        let frame = |frame| allocations(|| evaluator.at_into(rate.time_of(frame), &mut snapshot).unwrap());
        (1..120).map(frame).collect()
    })
}

fn frames_with_allocations(counts: &[usize]) -> usize {
    counts.iter().filter(|c| **c > 0).count()
}

/// A frame in which a layer or a constraint is first at work makes their buffers; no other frame allocates.
#[test]
fn clips_layers_and_constraints_allocate_only_in_their_first_frame() {
    for (name, stage, begin) in [("clips", stage_with_clips(), 2), ("goals", stage_with_constraints(), 3)] {
        let [first, second] = allocations_by_frame(stage);
        assert!(
            frames_with_allocations(&first) <= begin && first.iter().sum::<usize>() <= 8,
            "{name}: {first:?}"
        );
        assert_eq!(frames_with_allocations(&second), 0, "{name}: {second:?}");
    }
}

/// One state in 16 steps is kept on the way, for seeks, in bounded memory; what is kept already is not kept again.
#[test]
fn springs_allocate_only_their_seek_checkpoints() {
    let [first, second] = allocations_by_frame(stage_with_springs());
    assert!(
        frames_with_allocations(&first) <= 3 + 120 * 2 / 16 && frames_with_allocations(&first) > 10,
        "{first:?}"
    );
    assert_eq!(frames_with_allocations(&second), 0, "{second:?}");
}
