//! Retargeting: error of a retargeted clip against the motion of the source.

use crate::{BUDGET_SECS, Random, Section, hips, scenes};
use choreo_bench::plots::{Choice, Row, quantity};
use choreo_bench::reference::{ErrorStats, angle_between, model_from_joint, pose, rest};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::retarget::bind::bind_by_name;
use choreo_motion::retarget::{Retarget, RetargetOptions};
use choreo_motion::{Clip, Curve, Interpolation, Path, Skeleton, Time, Transform};
use glam::{DAffine3, DQuat};

/// Largest error of sampled rotations in radians.
const TOLERANCES: [f64; 5] = [1.0, 1e-2, 1e-3, 1e-4, 1e-5];
const DEFAULT_TOLERANCE: f64 = 1e-3;
/// Joint that the other character lacks; the joint below it takes over its rotation.
const MISSING_JOINT: &str = "mixamorig:Spine1";
const CLIPS: [&str; 2] = ["Walk", "Dance_Groove"];
const TIME_COUNT: u32 = 211;

/// Another skeleton with the same joint positions at rest, other joint axes, and one joint fewer.
struct TargetSkeleton {
    skeleton: Skeleton,
    /// Joint of the source that each joint follows, and the rotation of its axes in the space of that joint.
    follows: Vec<(usize, DQuat)>,
}

fn target_without_spine1(source: &Skeleton) -> Result<TargetSkeleton, String> {
    let gone = source.find(MISSING_JOINT).ok_or(format!("the mannequin has no joint {MISSING_JOINT}"))?;
    let at_rest = model_from_joint(source, &rest(source));
    let mut random = Random(77);
    let follows: Vec<(usize, DQuat)> =
        (0..source.len()).filter(|j| *j != gone).map(|j| (j, random.rotation())).collect();
    let place = |(joint, axes): &(usize, DQuat)| {
        DAffine3::from_rotation_translation(
            DQuat::from_affine3(&at_rest[*joint]) * *axes,
            at_rest[*joint].translation,
        )
    };
    let number = |joint: usize| follows.iter().position(|(j, _)| *j == joint);
    let (mut names, mut parents, mut locals) = (Vec::new(), Vec::new(), Vec::new());
    for follow in &follows {
        let parent = match source.parents()[follow.0] {
            Some(parent) if parent as usize == gone => source.parents()[gone],
            parent => parent,
        };
        let parent = parent.and_then(|parent| number(parent as usize));
        let local = parent.map_or(DAffine3::IDENTITY, |p| place(&follows[p])).inverse() * place(follow);
        names.push(source.names()[follow.0].clone());
        parents.push(parent.map(|p| p as u32));
        locals.push(Transform {
            translation: local.translation.as_vec3(),
            rotation: DQuat::from_affine3(&local).as_quat(),
            ..Transform::default()
        });
    }
    let skeleton = Skeleton::new(names, parents, locals).map_err(|e| e.to_string())?;
    Ok(TargetSkeleton { skeleton, follows })
}

/// Angles in degrees between joints and the joints that they follow, and the place of the worst.
fn joint_angle_errors(
    source: &Skeleton,
    clip: &Clip,
    body: &TargetSkeleton,
    found: &Clip,
) -> (ErrorStats, String) {
    let (mut error, mut place) = (ErrorStats::default(), String::new());
    for i in 0..TIME_COUNT {
        let time = Time::from_secs(clip.duration.as_secs() * (f64::from(i) + 0.37) / f64::from(TIME_COUNT));
        let truth = model_from_joint(source, &pose(clip, source, time));
        let model = model_from_joint(&body.skeleton, &pose(found, &body.skeleton, time));
        for (joint, (follows, axes)) in body.follows.iter().enumerate() {
            let exact = DQuat::from_affine3(&truth[*follows]) * *axes;
            let degrees = angle_between(DQuat::from_affine3(&model[joint]), exact).to_degrees();
            if error.add(degrees) {
                place = format!("{}, {} at {:.2} s", body.skeleton.names()[joint], clip.name, time.as_secs());
            }
        }
    }
    (error, place)
}

/// Clip with keyframes like those set by hand: each joint rotates by up to 35° from rest, every 0.3 to 0.6 s, at its own times.
fn hand_keyed_clip(skeleton: &Skeleton) -> Result<Clip, String> {
    let mut random = Random(5);
    let curve = |joint: usize| {
        let apart = 0.3 + 0.05 * (joint % 7) as f64;
        let times: Vec<Time> = (0..12).map(|key| Time::from_secs(apart * f64::from(key))).collect();
        let values = times.iter().flat_map(|_| {
            let turn = DQuat::from_axis_angle(random.direction(), random.unit() * 35f64.to_radians());
            (skeleton.rest()[joint].rotation.as_dquat() * turn).as_quat().to_array()
        });
        let values = values.collect();
        Curve {
            joint: joint as u32,
            path: Path::Rotation,
            interpolation: Interpolation::Linear,
            times: times.into(),
            values,
        }
    };
    let curves: Vec<Curve> = (0..skeleton.len()).map(curve).collect();
    Clip::new("keys by hand".into(), skeleton.len(), curves).map_err(|e| e.to_string())
}

fn tolerance_name(radians: f64) -> String {
    format!("within {}°", quantity(radians.to_degrees()))
}

pub(crate) fn section() -> Result<Section, String> {
    let asset = scenes::mannequin()?;
    let source = &*asset.skeleton;
    let body = target_without_spine1(source)?;
    let hand = hand_keyed_clip(source)?;
    let clips: Vec<&Clip> = asset
        .clips
        .iter()
        .filter(|c| CLIPS.contains(&c.name.as_str()))
        .map(|c| &**c)
        .chain([&hand])
        .collect();
    let retargets: Vec<Retarget> = TOLERANCES
        .iter()
        .map(|tolerance_rad| {
            let options = RetargetOptions { tolerance_rad: *tolerance_rad, ..RetargetOptions::default() };
            Retarget::new(source, &body.skeleton, options)
        })
        .collect();
    let mut choice =
        Choice::new("retargeting", "How close are sampled keys of a retargeted clip to the motion?");
    choice.error_unit = "°";
    choice.reference = format!(
        "rotations of the source joints in model space, in f64 at {TIME_COUNT} times of {} and of keys by hand; \
         the target character has the same rest positions, random axes and no {MISSING_JOINT}",
        CLIPS.join(", ")
    );
    choice.per = format!("clip, mean of {}", clips.len());
    let mut add = |name: String, of: &dyn Fn(&Clip) -> Clip| {
        let (mut mean, mut worst, mut place, mut bytes, mut secs) = (0.0, -1.0f64, String::new(), 0, 0.0);
        for clip in &clips {
            let found = of(clip);
            let (error, at) = joint_angle_errors(source, clip, &body, &found);
            if error.worst > worst {
                (worst, place) = (error.worst, at);
            }
            mean += error.mean() / clips.len() as f64;
            let size = |curve: &Curve| 8 * curve.times.len() + 4 * curve.values.len();
            bytes += found.curves().iter().map(size).sum::<usize>();
            secs += clip.duration.as_secs();
        }
        let size = bytes as f64 / secs;
        choice.rows.push(Row::new(name).error(worst, mean).at(place).bytes(size).note("size: of a second"));
    };
    add("curves as they are, by name".into(), &|clip| bind_by_name(clip, source, &body.skeleton).0);
    for (retarget, radians) in retargets.iter().zip(TOLERANCES) {
        add(tolerance_name(radians), &|clip| retarget.clip(clip).0);
    }
    let (clips, skeleton) = (&clips, &body.skeleton);
    let mut cases = vec![Case::new(clips.len(), move || {
        clips.iter().for_each(|clip| drop(std::hint::black_box(bind_by_name(clip, source, skeleton))));
    })];
    cases.extend(retargets.iter().map(|retarget| {
        Case::new(clips.len(), move || {
            clips.iter().for_each(|clip| drop(std::hint::black_box(retarget.clip(clip))))
        })
    }));
    let nanos = interleaved(Clock::Thread, 2.0 * BUDGET_SECS, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        &tolerance_name(DEFAULT_TOLERANCE),
        "an invisible 1 mm at a distance of 1 m, for few more keys than the source has",
    );
    Ok(Section {
        title: "Retargeting",
        text: "A joint rotates in model space like its source joint. Where its parent follows the parent of \
               the source joint, keys are converted one by one, exactly, whatever the axes. Where the \
               numbers of joints differ, several curves become one, which is sampled at their keys and \
               between them until it is within the tolerance. Feet of another length require a hip height \
               that jumps where a heel rises over its toes. A smoothing spline follows that height where \
               soles are on the ground (decision 91); the spline itself takes less than a hundredth of its \
               row's time, and measuring the feet in every pose, in f64, nearly all the rest."
            .into(),
        choices: vec![choice, hips::compare_hip_methods()?],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
