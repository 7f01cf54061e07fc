//! Hip height of retargeted clips: raising and lowering the hips so that feet stay on the floor.

use crate::{BUDGET_SECS, scenes};
use choreo_bench::plots::{Choice, Row, quantity};
use choreo_bench::reference::{ErrorStats, model_from_joint, pose, rest};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::retarget::{Retarget, RetargetOptions};
use choreo_motion::{Clip, HumanoidJoints, LocalToModel, Pose, Sample, Skeleton, Time, Transform};
use glam::{Affine3A, DAffine3};
use std::hint::black_box;

const CLIPS: [&str; 4] = ["Walk", "Run", "Jump", "Dance_Groove"];
/// Times per second at which errors are measured, and at which the required height is sampled.
const ERROR_SAMPLES_PER_SEC: f64 = 240.0;
const HEIGHT_SAMPLES_PER_SEC: f64 = 120.0;
/// Number of error samples in 1/60 s.
const SAMPLES_PER_FRAME: usize = 4;
/// Height of an ankle above its rest height, as a fraction of the leg, up to which its sole is planted.
const PLANTED_HEIGHT: f64 = 0.01;
/// Lengths of the other character's shins and feet, as factors of the source's.
const SHIN_SCALE: f32 = 0.9;
const FOOT_SCALE: f32 = 0.6;
const DEFAULT_METHOD: &str = "smoothing spline over the clip, 120 Hz (default)";

/// The mannequin with other shins and feet; its hips are lowered accordingly.
fn target_skeleton(source: &Skeleton) -> Result<Skeleton, String> {
    let human = HumanoidJoints::of(source);
    let joint = |name: &str| human.joint(name).ok_or(format!("the mannequin has no {name}"));
    let mut locals: Vec<Transform> = source.rest().to_vec();
    for side in ["left", "right"] {
        locals[joint(&format!("{side} foot"))? as usize].translation *= SHIN_SCALE;
        locals[joint(&format!("{side} toebase"))? as usize].translation *= FOOT_SCALE;
    }
    let made = |locals: Vec<Transform>| {
        Skeleton::new(source.names().to_vec(), source.parents().to_vec(), locals).map_err(|e| e.to_string())
    };
    let toe = joint("left toebase")? as usize;
    let height = |skeleton: &Skeleton| model_from_joint(skeleton, &rest(skeleton))[toe].translation.y;
    let sinks = height(source) - height(&made(locals.clone())?);
    locals[joint("hips")? as usize].translation.y += sinks as f32;
    made(locals)
}

/// A skeleton, and the rest heights of its feet.
struct Feet<'a> {
    skeleton: &'a Skeleton,
    hips: usize,
    leg: f64,
    /// Ankle joints, and then ankle and toe joints, each with its height in the rest pose.
    ankles: Vec<(usize, f64)>,
    all: Vec<(usize, f64)>,
}

impl Feet<'_> {
    fn of(skeleton: &Skeleton) -> Result<Feet<'_>, String> {
        let human = HumanoidJoints::of(skeleton);
        let model = model_from_joint(skeleton, &rest(skeleton));
        let joint = |name: &str| Ok(human.joint(name).ok_or(format!("no {name}"))? as usize);
        let place = |name: &str| joint(name).map(|j: usize| model[j].translation);
        let [hip, knee, ankle] = ["left upleg", "left leg", "left foot"].map(place);
        let (hip, knee, ankle) = (hip?, knee?, ankle?);
        let of = |part: &str| ["left", "right"].map(|side| joint(&format!("{side} {part}")));
        let heights = |joints: [Result<usize, String>; 2]| -> Result<Vec<(usize, f64)>, String> {
            joints.into_iter().map(|j| j.map(|j| (j, model[j].translation.y))).collect()
        };
        let (ankles, toes) = (heights(of("foot"))?, heights(of("toebase"))?);
        let all = ankles.iter().chain(&toes).copied().collect();
        let leg = (hip - knee).length() + (knee - ankle).length();
        Ok(Feet { skeleton, hips: joint("hips")?, leg, ankles, all })
    }

    /// Lowest height of these joints above their rest heights.
    fn lowest_above_rest(joints: &[(usize, f64)], height: impl Fn(usize) -> f64) -> f64 {
        joints.iter().map(|(joint, standing)| height(*joint) - standing).fold(f64::MAX, f64::min)
    }
}

/// Heights of the feet in a pose of a clip, evaluated in f32 as for a frame.
struct FootHeights<'a> {
    feet: &'a Feet<'a>,
    rest: Pose,
    pose: Pose,
    matrices: Vec<Affine3A>,
}

impl FootHeights<'_> {
    fn of<'a>(feet: &'a Feet<'a>) -> FootHeights<'a> {
        let matrices = vec![Affine3A::IDENTITY; feet.skeleton.len()];
        let rest = Pose::rest(feet.skeleton);
        FootHeights { feet, pose: rest.clone(), rest, matrices }
    }

    /// Lowest height of a foot joint above its rest height.
    fn lowest_foot_height(&mut self, clip: &Clip, time: Time) -> f64 {
        let skeleton = self.feet.skeleton;
        self.pose.copy_from(&self.rest);
        Sample { clip, time, pose: &mut self.pose }.run();
        LocalToModel { skeleton, pose: &self.pose, model_from_joint: &mut self.matrices }.run();
        Feet::lowest_above_rest(&self.feet.all, |joint| f64::from(self.matrices[joint].translation.y))
    }
}

/// Height in metres by which the hips must be raised for the feet, sampled at 120 Hz, and averaged over `mean` samples on both sides.
fn hip_raises([own, theirs]: [&Feet; 2], scale: f64, [clip, on]: [&Clip; 2], mean: usize) -> Vec<f64> {
    let (mut source, mut target) = (FootHeights::of(own), FootHeights::of(theirs));
    let count = (clip.duration.as_secs() * HEIGHT_SAMPLES_PER_SEC).ceil() as usize;
    let mut at = |i: usize| {
        let time = Time::from_secs(i as f64 / HEIGHT_SAMPLES_PER_SEC).min(clip.duration);
        source.lowest_foot_height(clip, time) * scale - target.lowest_foot_height(on, time)
    };
    let all: Vec<f64> = (0..=count).map(&mut at).collect();
    let mean_at = |i: usize| {
        let near = &all[i.saturating_sub(mean)..(i + mean + 1).min(all.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..all.len()).map(mean_at).collect()
}

/// Linear interpolation of the raised heights at a time.
fn height_at(raised: &[f64], secs: f64) -> f64 {
    let place = secs * HEIGHT_SAMPLES_PER_SEC;
    let i = (place as usize).min(raised.len() - 1);
    let next = (i + 1).min(raised.len() - 1);
    raised[i] + (raised[next] - raised[i]) * (place - i as f64)
}

/// Adds the errors of a clip in millimetres: of the change of the hips' step, and of the height of planted soles.
fn add_errors(
    [steps, soles]: &mut [ErrorStats; 2],
    ([own, theirs], scale): ([&Feet; 2], f64),
    [clip, on]: [&Clip; 2],
    raised: &[f64],
) {
    let (mut beyond, mut feet) = (Vec::new(), Vec::new());
    for i in 0..=(clip.duration.as_secs() * ERROR_SAMPLES_PER_SEC) as usize {
        let secs = i as f64 / ERROR_SAMPLES_PER_SEC;
        let time = Time::from_secs(secs);
        let model = |of: &Feet, clip: &Clip| -> Vec<DAffine3> {
            model_from_joint(of.skeleton, &pose(clip, of.skeleton, time))
        };
        let (source, target) = (model(own, clip), model(theirs, on));
        let more = if raised.is_empty() { 0.0 } else { height_at(raised, secs) };
        beyond.push(target[theirs.hips].translation.y + more - scale * source[own.hips].translation.y);
        let ankle = Feet::lowest_above_rest(&own.ankles, |j| source[j].translation.y) / own.leg;
        let wanted = Feet::lowest_above_rest(&own.all, |j| source[j].translation.y) * scale;
        feet.push((ankle, Feet::lowest_above_rest(&theirs.all, |j| target[j].translation.y) + more - wanted));
    }
    for all in beyond.windows(2 * SAMPLES_PER_FRAME + 1) {
        steps.add((all[0] - 2.0 * all[SAMPLES_PER_FRAME] + all[2 * SAMPLES_PER_FRAME]).abs() * 1e3);
    }
    let lowest = feet.iter().map(|foot| foot.0).fold(f64::MAX, f64::min).max(0.0);
    feet.iter()
        .filter(|foot| foot.0 - lowest < PLANTED_HEIGHT)
        .for_each(|foot| _ = soles.add(foot.1.abs() * 1e3));
}

pub(crate) fn compare_hip_methods() -> Result<Choice, String> {
    let asset = scenes::mannequin()?;
    let source = &*asset.skeleton;
    let body = target_skeleton(source)?;
    let feet = [Feet::of(source)?, Feet::of(&body)?];
    let feet = feet.each_ref();
    let retarget =
        |floor: bool| Retarget::new(source, &body, RetargetOptions { floor, ..RetargetOptions::default() });
    let (free, kept) = (retarget(false), retarget(true));
    let scale = free.scale();
    let clips: Vec<&Clip> =
        asset.clips.iter().filter(|c| CLIPS.contains(&c.name.as_str())).map(|c| &**c).collect();
    let mut choice = Choice::new("hips", "How high are the hips of a retargeted clip?");
    choice.error_unit = "mm";
    choice.reference = format!(
        "in f64 at 240 Hz: where a sole of the source is on the ground the lowest foot is as high as it, \
         and the hips change speed like the source's (by the change of their step of 1/60 s); {} on a \
         character with shins of {SHIN_SCALE} and feet of {FOOT_SCALE} times the length",
        CLIPS.join(", ")
    );
    choice.per = format!("clip, mean of {}", clips.len());
    // Method, whether the clip already includes the height, and number of required heights averaged on each side.
    let methods = [
        ("as the source's, by the scale of the legs", false, None),
        ("as the lowest foot asks at each time, 120 Hz", false, Some(0)),
        ("the mean of that over 0.1 s", false, Some(6)),
        (DEFAULT_METHOD, true, None),
    ];
    for (name, smooth, mean) in methods {
        let mut errors = [ErrorStats::default(); 2];
        for clip in &clips {
            let on = if smooth { kept.clip(clip).0 } else { free.clip(clip).0 };
            let raised = mean.map_or(Vec::new(), |mean| hip_raises(feet, scale, [clip, &on], mean));
            add_errors(&mut errors, (feet, scale), [clip, &on], &raised);
        }
        let [steps, soles] = errors;
        let note = format!(
            "steps of the hips {} mm off at worst, standing soles {} mm",
            quantity(steps.worst),
            quantity(soles.worst)
        );
        let row = Row::new(name).error(steps.worst.max(soles.worst), steps.mean().max(soles.mean()));
        choice.rows.push(row.note(note));
    }
    let mut cases: Vec<Case> = Vec::new();
    for (_, smooth, mean) in methods {
        let (clips, retarget) = (&clips, if smooth { &kept } else { &free });
        cases.push(Case::new(clips.len(), move || {
            for clip in clips {
                let on = retarget.clip(clip).0;
                black_box(mean.map(|mean| hip_raises(feet, scale, [clip, &on], mean)));
            }
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        DEFAULT_METHOD,
        "the smallest error of both, computed once for each clip when the scene is \
                           loaded; other characters jolt by up to 62 mm without it (decision 91)",
    );
    Ok(choice)
}
