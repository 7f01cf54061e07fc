//! Transitions between clips.

use crate::images::stage;
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_stage::{Evaluator, Snapshot, Stage};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Time in seconds at which the second clip begins, and end of the evaluated span.
const SECOND_CLIP_SECS: f64 = 1.3;
const END_SECS: f64 = 2.1;
/// Samples per second from which accelerations are computed.
const SAMPLES_PER_SEC: f64 = 240.0;
const OPTIONS: [(&str, &str); 6] = [
    ("at once", ""),
    ("crossfade of 0.2 s", ", #{ fade: 0.2 }"),
    ("crossfade of 0.4 s", ", #{ fade: 0.4 }"),
    ("inertialization of 0.2 s", ", #{ inertial: 0.2 }"),
    ("inertialization of 0.4 s", ", #{ inertial: 0.4 }"),
    ("crossfade of 0.4 s in step", ", #{ fade: 0.4, in_step: true }"),
];

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let script = |first: &str, then: &str| {
        let text = format!(
            "stage(#{{ fps: 60, length: 4 }});
             let m = load(\"choreo:mannequin\");
             cast(\"anna\", m).play(m.clip(\"{first}\")){then};"
        );
        stage(&text, &registry)
    };
    // Acceleration of the two clips without a transition.
    let own = worst_acceleration(&script("Walk", "")?)?.0.max(worst_acceleration(&script("Run", "")?)?.0);
    let mut choice =
        Choice::new("transitions", "How does one clip blend into another? (the mannequin, from Walk to Run)");
    choice.error_unit = "m/s²";
    choice.reference = format!(
        "the largest acceleration of any joint that the clips have by themselves, {own:.0} m/s², from \
         positions 1/240 s apart in f64; the error is the acceleration beyond it"
    );
    choice.per = "frame in the transition".into();
    let mut stages = Vec::new();
    for (name, options) in OPTIONS {
        let stage = script("Walk", &format!(".until({SECOND_CLIP_SECS}).then(m.clip(\"Run\"){options})"))?;
        let (worst, at) = worst_acceleration(&stage)?;
        choice.rows.push(Row::new(name).error((worst - own).max(0.0), f64::NAN).at(at));
        stages.push(stage);
    }
    let mut cases: Vec<Case> = Vec::new();
    for stage in &stages {
        let (mut evaluator, mut snapshot) = (Evaluator::new(stage.clone()), Snapshot::default());
        let mut frame = 0;
        cases.push(Case::new(1, move || {
            frame = (frame + 1) % 20;
            let time = Time::from_secs(SECOND_CLIP_SECS + 0.005 + f64::from(frame) * 0.009);
            let done = evaluator.at_into(time, &mut snapshot);
            std::hint::black_box((done.is_ok(), &snapshot));
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    Ok(Section {
        title: "Transitions",
        text: "A crossfade samples both clips in each of its frames. Inertialization samples the new one \
               only, and adds the decaying difference between both at the switch, including its velocity: \
               nothing jumps, even in a short transition. The offset of each joint is a closed form in f64, \
               which costs more than sampling a second clip. Two gaits are faded with matched phases, so \
               that a foot is not blended with the opposite one."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

/// Largest acceleration of a joint in model space around the transition, and its place.
fn worst_acceleration(stage: &Arc<Stage>) -> Result<(f64, String), String> {
    let mut evaluator = Evaluator::new(stage.clone());
    let mut looks: Vec<Vec<DVec3>> = Vec::new();
    for i in 0..=((END_SECS - SECOND_CLIP_SECS + 0.1) * SAMPLES_PER_SEC) as i64 {
        let time = Time::from_secs(SECOND_CLIP_SECS - 0.1 + i as f64 / SAMPLES_PER_SEC);
        let snapshot = evaluator.at(time).map_err(|e| e.to_string())?;
        let joints = snapshot.actors[0].model_from_joint.iter();
        looks.push(joints.map(|m| Vec3::from(m.translation).as_dvec3()).collect());
    }
    let (mut worst, mut at) = (0.0, String::new());
    for (i, three) in looks.windows(3).enumerate() {
        for (joint, name) in stage.actors[0].asset.skeleton.names().iter().enumerate() {
            let difference = (three[0][joint] - 2.0 * three[1][joint] + three[2][joint]).length()
                * SAMPLES_PER_SEC
                * SAMPLES_PER_SEC;
            if difference > worst {
                (worst, at) = (
                    difference,
                    format!("{name}, {:.2} s", SECOND_CLIP_SECS - 0.1 + (i + 1) as f64 / SAMPLES_PER_SEC),
                );
            }
        }
    }
    Ok((worst, at))
}
