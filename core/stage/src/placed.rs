//! Transforms of actors and the camera at a time, without poses: for estimates of what images will show.

use crate::actors::{ActorScratch, evaluate_actors};
use crate::camera;
use crate::camera::orbit_rotation;
use crate::framing::fit_camera;
use crate::snapshot::{ActorState, CameraState, Snapshot};
use crate::stage::{Stage, StageError};
use choreo_asset::{DAabb, Projection};
use choreo_motion::Time;
use glam::{DAffine3, DQuat};

impl Stage {
    /// Evaluates the stage at some times without poses: actors have a transform and a visibility, and no joint matrices. Actors attached to
    /// joints are placed as if these were at rest, and a framing camera frames rest poses.
    pub fn evaluate_placements(&self, times: &[Time]) -> Result<Vec<Snapshot>, StageError> {
        let mut scratch = ActorScratch::for_actors(Vec::new());
        times.iter().map(|time| snapshot_without_poses(self, &mut scratch, *time)).collect()
    }
}

fn snapshot_without_poses(
    stage: &Stage,
    scratch: &mut ActorScratch,
    time: Time,
) -> Result<Snapshot, StageError> {
    let mut out = Snapshot { time, ..Snapshot::default() };
    let index = camera::active_camera_at(stage, time);
    scratch.view_cameras = [index, None];
    evaluate_actors(stage, scratch, time, None, &mut out)?;
    let frame = |camera, azimuth, elevation, projection| {
        let rotation = orbit_rotation(azimuth, elevation);
        Ok(CameraState { camera, ..frame_rest_bounds(stage, &out.actors, rotation, projection) })
    };
    out.camera = camera::evaluate_camera(stage, frame, &scratch.edits, time, index, &out.actors)?;
    Ok(out)
}

/// A camera that fits the rest bounds of all visible actors into the image.
fn frame_rest_bounds(
    stage: &Stage,
    actors: &[ActorState],
    rotation: DQuat,
    projection: Projection,
) -> CameraState {
    let axes_from_world = DAffine3::from_quat(rotation.inverse());
    let mut all = DAabb::EMPTY;
    for (actor, state) in stage.actors.iter().zip(actors).filter(|(_, state)| state.visible) {
        let bounds = actor.asset.spread(&actor.asset.rest_bounds());
        all.add_box(&(axes_from_world * state.world_from_model), &bounds);
    }
    if all.is_empty() {
        return CameraState { projection, ..CameraState::default() };
    }
    let [width, height] = stage.settings.size.map(|n| f64::from(n.max(1)));
    let (position, projection) = fit_camera(&[all], width / height, projection);
    let world_from_view = DAffine3::from_rotation_translation(rotation, rotation * position);
    CameraState { camera: None, world_from_view, projection }
}
