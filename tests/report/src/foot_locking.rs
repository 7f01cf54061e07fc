//! Foot locking: sliding of planted feet.

use crate::images::stage;
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, time};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::Time;
use choreo_stage::{Evaluator, Snapshot, Stage, find_legs};
use glam::{DVec3, Vec3};
use std::sync::Arc;
use std::time::Instant;

const SAMPLES_PER_SEC: f64 = 240.0;
/// Height in metres above the ground below which a foot touches it, and speed in metres per second below which it has come down.
const MAX_CONTACT_HEIGHT: f64 = 0.01;
const MAX_CONTACT_SPEED: f64 = 0.3;
/// Seconds of continuous walking (from, to), and seconds evaluated after a stop.
const WALK_SECS: (f64, f64) = (0.5, 4.0);
const STANDING_SECS: f64 = 2.5;
/// Times of stops in seconds, at different phases of the step.
const STOP_SECS: [f64; 4] = [2.0, 2.17, 2.41, 2.63];
const METHODS: [(&str, &str); 3] = [
    ("as the clips have it", "anna.plant_feet(#{ weight: 0 });"),
    ("by default: steps in a stop", ""),
    ("plant_feet", "anna.plant_feet();"),
];

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let script = |planted: &str, cues: &str, actors: usize| {
        let text = format!(
            "stage(#{{ fps: 60, length: 6 }});
             let m = load(\"choreo:mannequin\");
             camera(\"c\").at(0, 2, 9).look_at([0, 1, 0]);
             for i in 0..{actors} {{
                 let anna = cast(\"anna\" + i, m).at(i * 0.7, 0, 0);
                 anna.root_motion(); {planted}
                 anna.play(m.clip(\"Walk\")){cues};
             }}"
        );
        stage(&text, &registry)
    };
    let stop = |at: f64| format!(".until({at}).then(m.clip(\"Idle\"), #{{ fade: 0.5 }})");
    let questions = [
        ("feet_of_a_walk", "How far do the feet of a walk slide? (the mannequin, root motion)"),
        ("feet_of_a_stop", "How far do feet slide where a walk fades into a stand?"),
    ];
    let looks =
        [vec![(String::new(), WALK_SECS)], STOP_SECS.map(|at| (stop(at), (at, at + STANDING_SECS))).into()];
    let mut choices = Vec::new();
    for ((key, question), looks) in questions.into_iter().zip(looks) {
        let mut choice = Choice::new(key, question);
        choice.error_unit = "mm";
        choice.reference = "a foot on the ground does not move; its toe joint at 240 Hz".into();
        choice.per = "frame, clips and constraints".into();
        let mut stages = Vec::new();
        for (name, planted) in METHODS {
            let (mut worst, mut place) = (0.0, String::new());
            for (cues, span) in &looks {
                let stage = script(planted, cues, 1)?;
                let (metres, at) = largest_slide(&stage, *span)?;
                if metres >= worst {
                    (worst, place) = (metres, format!("{at:.2} s"));
                }
                stages.push(stage);
            }
            choice.rows.push(Row::new(name).error(worst * 1e3, f64::NAN).at(place));
        }
        let stages: Vec<_> = stages.into_iter().step_by(looks.len()).collect();
        let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases(&stages, looks[0].1));
        choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
        choices.push(choice);
    }
    let columns =
        [("100 characters, a frame in the stop", "way"), (">first frame", "ns"), (">each further", "ns")];
    let mut table = Table::new("Cost of planning: once, in the first frame that needs it", &columns);
    for (name, planted) in METHODS {
        let stage = script(planted, &stop(2.17), 100)?;
        let (mut first, mut further) = (Vec::new(), Vec::new());
        for _ in 0..5 {
            let (mut evaluator, mut snapshot) = (Evaluator::new(stage.clone()), Snapshot::default());
            for i in 0..5 {
                let begun = Instant::now();
                let at = Time::from_secs(2.4 + f64::from(i) * 0.01);
                evaluator.at_into(at, &mut snapshot).map_err(|e| e.to_string())?;
                let took = begun.elapsed().as_secs_f64() * 1e9;
                if i == 0 { first.push(took) } else { further.push(took) }
            }
        }
        table.rows.push(vec![Cell::text(name), time(Nanos::of(first)), time(Nanos::of(further))]);
    }
    Ok(Section {
        title: "Feet on the ground",
        text: "In clips feet slide while they are on the ground, and a fade averages a walking foot with a \
               standing one. Foot locking finds the contacts once, at 60 Hz, and moves each foot back to \
               its contact; fades between walking and standing become steps."
            .into(),
        choices,
        tables: vec![table],
        off_front: Vec::new(),
    })
}

fn cases(stages: &[Arc<Stage>], (from, to): (f64, f64)) -> Vec<Case<'static>> {
    let case = |stage: &Arc<Stage>| {
        let (mut evaluator, mut snapshot) = (Evaluator::new(stage.clone()), Snapshot::default());
        let mut frame = 0;
        Case::new(1, move || {
            frame = (frame + 1) % 60;
            let time = Time::from_secs(from + (to - from) * f64::from(frame) / 60.0);
            let done = evaluator.at_into(time, &mut snapshot);
            std::hint::black_box((done.is_ok(), &snapshot));
        })
    };
    stages.iter().map(case).collect()
}

/// Largest sliding distance of a foot in metres, and its time in seconds. A contact begins when the foot is low and slow, and ends when it
/// rises above its lowest height since then.
fn largest_slide(stage: &Arc<Stage>, (from, to): (f64, f64)) -> Result<(f64, f64), String> {
    let legs = find_legs(&stage.actors[0].asset.skeleton);
    let mut evaluator = Evaluator::new(stage.clone());
    let mut feet: Vec<Vec<DVec3>> = vec![Vec::new(); legs.len()];
    for i in 0..=((to - from) * SAMPLES_PER_SEC) as i64 {
        let snapshot =
            evaluator.at(Time::from_secs(from + i as f64 / SAMPLES_PER_SEC)).map_err(|e| e.to_string())?;
        let state = &snapshot.actors[0];
        for (leg, places) in legs.iter().zip(&mut feet) {
            let joint = &state.model_from_joint[leg.toe.unwrap_or(leg.foot) as usize];
            let place = Vec3::from(joint.translation).as_dvec3();
            places.push(state.world_from_model.transform_point3(place));
        }
    }
    let (mut worst, mut at) = (0.0, 0.0);
    for places in &feet {
        let ground = places.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        // Position at which the foot was planted, and its lowest height since then.
        let mut stands: Option<(DVec3, f64)> = None;
        for (i, pair) in places.windows(2).enumerate() {
            let now = pair[1];
            let slow = (now - pair[0]).with_y(0.0).length() * SAMPLES_PER_SEC < MAX_CONTACT_SPEED;
            stands = match stands {
                Some((first, lowest)) if now.y - lowest < MAX_CONTACT_HEIGHT => {
                    let difference = (now - first).with_y(0.0).length();
                    if difference > worst {
                        (worst, at) = (difference, from + (i + 1) as f64 / SAMPLES_PER_SEC);
                    }
                    Some((first, lowest.min(now.y)))
                }
                None if now.y - ground < MAX_CONTACT_HEIGHT && slow => Some((now, now.y)),
                _ => None,
            };
        }
    }
    Ok((worst, at))
}
