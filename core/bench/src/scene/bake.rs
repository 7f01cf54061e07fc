//! The choice between clips as authored, resampled to an even rate, or compressed.

use super::{Limits, MeasuredScene, SceneChoices, choose_row};
use crate::plots::{Choice, Row};
use crate::reference::{self, ErrorStats};
use crate::timing::{Case, Clock, interleaved};
use choreo_motion::{Clip, FrameRate, LocalToModel, Path, Pose, Sample, Skeleton, Time};
use glam::{Affine3A, Vec3};
use std::sync::Arc;

/// Largest numbers of measured clips, and of times in each.
const MAX_CLIPS: usize = 12;
const MAX_TIMES: usize = 240;
const RATES: [u32; 3] = [30, 60, 120];
/// A tenth of a millimetre at a joint is a small part of a pixel in any shot of a whole character. A micrometre is the rounding of f32.
const LIMITS: Limits = Limits { rounding: 0.001, visible: 0.1, visible_text: "0.1 mm" };

/// A clip with the skeleton that it is played on.
pub type Played = (Arc<Clip>, Arc<Skeleton>);

/// Every different clip that some actor plays, in the order of the stage.
pub fn played(scene: &MeasuredScene) -> Vec<Played> {
    let mut found: Vec<Played> = Vec::new();
    for actor in &scene.stage.actors {
        for cue in actor.layers.iter().flat_map(|l| &l.cues) {
            if !found.iter().any(|(clip, _)| Arc::ptr_eq(clip, &cue.clip)) {
                found.push((cue.clip.clone(), actor.asset.skeleton.clone()));
            }
        }
    }
    found
}

pub fn choices(scene: &MeasuredScene) -> SceneChoices {
    let mut clips = played(scene);
    clips.retain(|(clip, _)| {
        clip.curves().iter().any(|c| c.times.len() > 1 && !matches!(c.path, Path::Weights(_)))
    });
    if clips.is_empty() {
        return SceneChoices::None("no actor plays a clip with moving joints".into());
    }
    clips.truncate(MAX_CLIPS);
    SceneChoices::Choices(vec![bake(&clips, scene.budget_secs)])
}

/// Compares the methods on these clips, each of which is sampled equally often.
pub fn bake(clips: &[Played], budget_secs: f64) -> Choice {
    let mut choice =
        Choice::new("bake", "Are clips sampled as authored, baked to an even rate, or compressed?");
    choice.error_unit = "mm";
    choice.reference =
        "joints in model space against f64 slerp and splines on the source's keys, at keys, between them and between frames".into();
    let joints: usize = clips.iter().map(|c| c.1.len()).sum::<usize>() / clips.len().max(1);
    let plural = if clips.len() == 1 { "" } else { "s" };
    choice.per = format!("sample of {joints} joints at a random time, over {} clip{plural}", clips.len());
    let mut methods: Vec<(String, Vec<Played>)> = vec![("as authored".into(), clips.to_vec())];
    for rate in RATES {
        let baked: Result<Vec<Played>, _> = clips
            .iter()
            .map(|(clip, skeleton)| {
                let (baked, _) = clip.baked(FrameRate { num: rate, den: 1 })?;
                Ok((Arc::new(baked), skeleton.clone()))
            })
            .collect::<Result<_, choreo_motion::BakeError>>();
        // A clip of hours can be too long to be baked at this rate.
        if let Ok(baked) = baked {
            methods.push((format!("baked at {rate} Hz"), baked));
        }
    }
    for mm in [0.1, 1.0] {
        let small: Result<Vec<Played>, _> = clips
            .iter()
            .map(|(clip, skeleton)| Ok((Arc::new(clip.compressed(skeleton, mm * 1e-3)?.0), skeleton.clone())))
            .collect::<Result<_, choreo_motion::CompressError>>();
        if let Some(small) = small.ok().filter(|clips| clips.iter().any(|(clip, _)| clip.is_compressed())) {
            methods.push((format!("compressed, {mm} mm"), small));
        }
    }
    let mut errors = vec![ErrorStats::default(); methods.len()];
    let mut places = vec![String::new(); methods.len()];
    for (index, (source, skeleton)) in clips.iter().enumerate() {
        for time in times(source) {
            let exact = reference::model_from_joint(skeleton, &reference::pose(source, skeleton, time));
            for (method, (_, clips)) in methods.iter().enumerate() {
                let got = sampled(&clips[index].0, skeleton, time);
                for (joint, (got, exact)) in got.iter().zip(&exact).enumerate() {
                    let error = (Vec3::from(got.translation).as_dvec3() - exact.translation).length() * 1e3;
                    if errors[method].add(error) {
                        let name = skeleton.names().get(joint).map_or("", String::as_str);
                        places[method] = format!("{name}, \"{}\" at {:.3} s", source.name, time.as_secs());
                    }
                }
            }
        }
    }
    let mut cases: Vec<Case> = methods.iter().map(|(_, clips)| timed(clips)).collect();
    let nanos = interleaved(Clock::Thread, budget_secs, &mut cases);
    drop(cases);
    for (((name, clips), error), (place, nanos)) in
        methods.iter().zip(&errors).zip(places.into_iter().zip(nanos))
    {
        let bytes: usize = clips.iter().map(|(clip, _)| clip.stored_bytes()).sum();
        let row = Row::new(name.clone())
            .error(error.worst, error.mean())
            .at(place)
            .nanos(nanos)
            .bytes(bytes as f64);
        choice.rows.push(if name == "as authored" { row.note("the method in use now") } else { row });
    }
    choose_row(&mut choice, &LIMITS);
    choice
}

/// Keys, the middles between them, and times at no frame: errors are largest between keys.
fn times(clip: &Clip) -> Vec<Time> {
    let mut keys: Vec<Time> = clip.curves().iter().flat_map(|c| c.times.iter().copied()).collect();
    keys.sort_unstable();
    keys.dedup();
    let middles: Vec<Time> = keys.windows(2).map(|p| Time(p[0].0 + (p[1].0 - p[0].0) / 2)).collect();
    // Times at irregular places, which fall on no frame rate.
    let odd = (0..60).map(|i| clip.duration.scaled((f64::from(i) * 0.618_034) % 1.0));
    let mut all: Vec<Time> = keys.into_iter().chain(middles).chain(odd).collect();
    all.sort_unstable();
    all.dedup();
    let step = all.len().div_ceil(MAX_TIMES).max(1);
    all.into_iter().step_by(step).collect()
}

pub fn sampled(clip: &Clip, skeleton: &Skeleton, time: Time) -> Vec<Affine3A> {
    let mut pose = Pose::rest(skeleton);
    Sample { clip, time, pose: &mut pose }.run();
    let mut out = vec![Affine3A::IDENTITY; skeleton.len()];
    LocalToModel { skeleton, pose: &pose, model_from_joint: &mut out }.run();
    out
}

/// Times 32 samples of each clip, spread over its length.
fn timed(clips: &[Played]) -> Case<'_> {
    const TIMES: usize = 32;
    let mut poses: Vec<Pose> = clips.iter().map(|(_, skeleton)| Pose::rest(skeleton)).collect();
    Case::new(TIMES * clips.len(), move || {
        for ((clip, _), pose) in clips.iter().zip(&mut poses) {
            for i in 0..TIMES {
                // A permutation of the 32 times, so that no time is near the one before.
                let time = Time(clip.duration.0 / TIMES as i64 * ((i * 13 + 5) % TIMES) as i64);
                Sample { clip, time, pose }.run();
            }
            std::hint::black_box(&pose);
        }
    })
}
