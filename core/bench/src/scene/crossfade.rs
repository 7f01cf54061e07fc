//! The choice of the method that blends two poses while one clip fades into the next.

use super::{Limits, MeasuredScene, SceneChoices, choose_row};
use crate::blend::{add_errors, exact};
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::timing::{Case, Clock, interleaved};
use choreo_motion::{BlendOnto, LocalToModel, Pose, RotationBlend, Sample, Skeleton, Time};
use choreo_stage::Cue;
use glam::Affine3A;
use std::sync::Arc;

const MAX_FADES: usize = 16;
const WEIGHTS: [f32; 5] = [0.1, 0.25, 0.4, 0.7, 0.9];
const LIMITS: Limits = Limits { rounding: 0.01, visible: 1.0, visible_text: "1 mm" };
/// Methods; each blends eight joints at once.
const METHODS: [(&str, RotationBlend); 3] = [
    ("nlerp", RotationBlend::Nlerp),
    (NOW, RotationBlend::CorrectedNlerp),
    ("slerp, power series", RotationBlend::Slerp),
];
/// The method that the program uses.
pub const NOW: &str = "nlerp, corrected";

/// Two poses that are blended somewhere in the scene.
pub struct Fade {
    pub from: Pose,
    pub to: Pose,
    pub skeleton: Arc<Skeleton>,
    /// Place of the fade in words: `anna, Walk → Run at 2.25 s`.
    pub place: String,
}

pub fn choices(scene: &MeasuredScene) -> SceneChoices {
    let fades = fades(scene);
    if fades.is_empty() {
        return SceneChoices::None("no clip fades into another".into());
    }
    SceneChoices::Choices(vec![crossfade(&fades, scene.budget_secs)])
}

/// Poses in the middle of every fade of a base layer.
fn fades(scene: &MeasuredScene) -> Vec<Fade> {
    let mut fades = Vec::new();
    for actor in &scene.stage.actors {
        let Some(layer) = actor.layers.first().filter(|l| l.mask.is_none()) else { continue };
        for pair in layer.cues.windows(2).filter(|p| p[1].fade_in > Time::ZERO) {
            if fades.len() == MAX_FADES {
                return fades;
            }
            let at = pair[1].start + Time(pair[1].fade_in.0 / 2);
            let skeleton = actor.asset.skeleton.clone();
            let pose = |cue: &Cue| {
                let time = cue.playback().clip_time_at(cue.played_ticks(at));
                let mut pose = Pose::rest(&skeleton);
                Sample { clip: &cue.clip, time, pose: &mut pose }.run();
                pose
            };
            let place = format!(
                "{}, \"{}\" → \"{}\" at {:.2} s",
                actor.name,
                pair[0].clip.name,
                pair[1].clip.name,
                at.as_secs()
            );
            fades.push(Fade { from: pose(&pair[0]), to: pose(&pair[1]), skeleton: skeleton.clone(), place });
        }
    }
    fades
}

/// Compares the methods on these pairs of poses.
pub fn crossfade(fades: &[Fade], budget_secs: f64) -> Choice {
    let mut choice = Choice::new("crossfade", "How are rotations blended in a crossfade?");
    choice.error_unit = "mm";
    choice.reference =
        "joints in model space against f64 slerp of the same two poses, at five weights".into();
    let joints = fades.iter().map(|f| f.skeleton.len()).sum::<usize>() / fades.len().max(1);
    choice.per = format!("blend of {joints} joints");
    let names = METHODS.map(|method| method.0);
    let blend = |method: usize, fade: &Fade, weight: f32, out: &mut Pose| {
        out.copy_from(&fade.from);
        BlendOnto { pose: out, to: &fade.to, weight, mask: None }.run_as(METHODS[method].1);
    };
    let mut errors = vec![ErrorStats::default(); names.len()];
    let mut places = vec![String::new(); names.len()];
    for fade in fades {
        let mut out = Pose::rest(&fade.skeleton);
        let mut matrices = vec![Affine3A::IDENTITY; fade.skeleton.len()];
        for weight in WEIGHTS {
            let truth = exact(&fade.skeleton, &fade.from, &fade.to, f64::from(weight));
            for method in 0..names.len() {
                blend(method, fade, weight, &mut out);
                LocalToModel { skeleton: &fade.skeleton, pose: &out, model_from_joint: &mut matrices }.run();
                if let Some(joint) = add_errors(&mut errors[method], &matrices, &truth) {
                    places[method] =
                        format!("{}, {}, weight {weight}", fade.skeleton.names()[joint], fade.place);
                }
            }
        }
    }
    let mut outs: Vec<Pose> = names.iter().map(|_| Pose::rest(&fades[0].skeleton)).collect();
    let mut cases: Vec<Case> = outs
        .iter_mut()
        .enumerate()
        .map(|(method, out)| {
            Case::new(WEIGHTS.len(), move || {
                for weight in WEIGHTS {
                    blend(method, &fades[0], weight, out);
                    std::hint::black_box(&out);
                }
            })
        })
        .collect();
    let nanos = interleaved(Clock::Thread, budget_secs, &mut cases);
    drop(cases);
    for (((name, error), place), nanos) in names.iter().zip(&errors).zip(places).zip(nanos) {
        let row = Row::new(*name).error(error.worst, error.mean()).at(place).nanos(nanos);
        choice.rows.push(if *name == NOW { row.note("the method that blends use") } else { row });
    }
    choose_row(&mut choice, &LIMITS);
    choice
}
