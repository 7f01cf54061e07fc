//! Error of the exported curves, as a player of the file evaluates them, against the scene.

use crate::bake::tracks::seconds;
use crate::bake::{Baked, rig};
use crate::parallel::in_parallel;
use choreo_plugin::asset::widen;
use choreo_plugin::motion::{Clip, Path, Pose, Sample, Skeleton, Time, Transform};
use choreo_plugin::stage::{Actor, Snapshot, StageError};
use choreo_plugin::{ExportDeviation, ExportedScene};

/// Largest number of joints that are compared, summed over all times: large scenes are compared at fewer times.
const MAX_COMPARED_JOINTS: usize = 400_000;

/// Changes of times and numbers by a file format.
pub struct FileRounding {
    /// Key times as the file holds them, from the start of the export.
    pub times: fn(&[Time], Time) -> Vec<Time>,
    /// Number of a curve as the file holds it.
    pub number: fn(Path, f32) -> f32,
}

/// Key times in seconds as f32, numbers as they are.
pub const SINGLE_SECONDS: FileRounding = FileRounding {
    times: |times, start| {
        seconds(times, start).into_iter().map(|secs| Time::from_secs(secs.into())).collect()
    },
    number: |_, number| number,
};

/// The largest distance of a joint in the file from the scene. Times are spread evenly, between the frames; hidden actors are left out.
///
/// # Errors
/// The stage cannot be evaluated at a time.
pub fn largest_deviation(
    scene: &ExportedScene,
    baked: &Baked<'_>,
    file: &FileRounding,
) -> Result<ExportDeviation, StageError> {
    let stage = &scene.stage;
    let joints: usize = stage.actors.iter().map(|a| a.asset.skeleton.len() + 1).sum();
    let count = (MAX_COMPARED_JOINTS / joints.max(1)).clamp(12, 97) as i64;
    let length = (baked.end - baked.start).0 as f64;
    // An offset by the golden section avoids frames and round times.
    let share = |i: i64| (i as f64 + 0.381_966) / count as f64;
    let times: Vec<Time> = (0..count).map(|i| baked.start + Time((length * share(i)) as i64)).collect();
    let evaluator = scene.evaluator();
    let snapshots = in_parallel(&times, |time| evaluator.clone().at(*time));
    let snapshots = snapshots.into_iter().collect::<Result<Vec<Snapshot>, StageError>>()?;
    let at = || times.iter().copied().zip(&snapshots);
    let seen: Vec<usize> = (0..stage.actors.len()).filter(|index| !baked.motions[*index].hidden).collect();
    let of_actors =
        in_parallel(&seen, |index| largest_deviation_of_actor((scene, baked, *index), file, at()));
    let worst = of_actors.into_iter().reduce(|a, b| if b.metres > a.metres { b } else { a });
    Ok(worst.unwrap_or_default())
}

/// The largest distance of a joint of one actor.
fn largest_deviation_of_actor<'s>(
    (scene, baked, index): (&ExportedScene, &Baked<'_>, usize),
    file: &FileRounding,
    snapshots: impl Iterator<Item = (Time, &'s Snapshot)>,
) -> ExportDeviation {
    let actor = &scene.stage.actors[index];
    let mut worst = ExportDeviation::default();
    let Some((skeleton, clip)) = rig_in_file(baked, (actor, index), file) else { return worst };
    let mut pose = Pose::rest(&skeleton);
    for (time, snapshot) in snapshots {
        let state = &snapshot.actors[index];
        if !state.visible || state.model_from_joint.len() + 1 != skeleton.len() {
            continue;
        }
        skeleton.rest().iter().enumerate().for_each(|(joint, rest)| pose.set(joint, *rest));
        Sample { clip: &clip, time: time - baked.start, pose: &mut pose }.run();
        let places = rig::world_from_joints(&skeleton, pose.iter());
        for (joint, place) in places.iter().enumerate() {
            let truth = match joint.checked_sub(1) {
                None => state.world_from_model,
                Some(joint) => state.world_from_model * widen(&state.model_from_joint[joint]),
            };
            let metres = (place.translation - truth.translation).length();
            if metres > worst.metres {
                let joint = skeleton.names()[joint].clone();
                worst = ExportDeviation { metres, actor: actor.name.clone(), joint, time };
            }
        }
    }
    worst
}

/// The rig as a player of the file has it.
fn rig_in_file(
    baked: &Baked<'_>,
    (actor, index): (&Actor, usize),
    file: &FileRounding,
) -> Option<(Skeleton, Clip)> {
    let mut still = baked.still_rig(actor, index);
    let tracks = baked.motions[index].sets.iter().flat_map(|set| &baked.sets[*set].tracks);
    for track in tracks.filter(|track| track.joint > 0) {
        // Formats that store whole transforms of moving joints also store, and round, their scale.
        let scale = &mut still[track.joint as usize].scale;
        *scale = scale.to_array().map(|v| (file.number)(Path::Scale, v)).into();
    }
    let rig = rig::skeleton(actor, Transform::IDENTITY)?;
    let skeleton = Skeleton::new(rig.names().to_vec(), rig.parents().to_vec(), still).ok()?;
    let mut curves = Vec::new();
    for set in baked.motions[index].sets.iter().map(|set| &baked.sets[*set]) {
        set.add_curves(|times| (file.times)(times, baked.start), file.number, &mut curves);
    }
    let clip = Clip::new(String::new(), skeleton.len(), curves).ok()?;
    Some((skeleton, clip))
}
