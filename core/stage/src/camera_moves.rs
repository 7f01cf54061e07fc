//! Camera looks, callback edits and shakes, applied on top of the rig; and the rotation of a camera that looks along a direction.

use crate::noise::noise;
use crate::snapshot::{ActorState, CameraState};
use crate::stage::Stage;
use crate::stage::actor::Target;
use crate::stage::camera::Camera;
use crate::stage::camera_moves::{CameraLook, CameraShake};
use crate::stage::edits::{CameraEdit, FrameEdits, edits_for_index};
use crate::stage::fade::{apply_ease, elapsed_fraction, fades_at};
use crate::transforms::target_position;
use choreo_asset::Projection;
use choreo_motion::{Ease, Time};
use glam::{DMat3, DQuat, DVec3};

/// Default far plane of an orthographic camera, metres.
const ORTHOGRAPHIC_FAR: f32 = 10_000.0;

/// Largest near plane of a camera with a target, as a share of the distance to the target, unless the script sets the near plane: the
/// target must not be clipped, however small the scene. Reversed-Z float depth makes small near planes cheap.
const MAX_NEAR_SHARE: f64 = 0.01;

impl CameraLook {
    /// Blend weight of the look over the looks before it, 0..=1.
    fn weight_at(&self, time: Time) -> f64 {
        f64::from(apply_ease(Ease::Smooth, elapsed_fraction(time - self.start, self.blend)))
    }
}

impl CameraShake {
    /// Strength of the shake at a time, fades included, 0..=1.
    fn strength(&self, time: Time) -> f64 {
        let fades = fades_at(time, self.start, self.end, self.fade);
        fades.map_or(0.0, |[fade_in, fade_out]| f64::from(fade_in) * f64::from(fade_out))
    }

    /// Rotation about the camera's own axes, and offset to the right and up in metres. `strength`: that of the shake, 0..=1.
    fn offset_at(&self, time: Time, strength: f64) -> (DQuat, DVec3) {
        // The noise takes a new value at every integer, so one oscillation spans two.
        let x = time.as_secs() * 2.0 * self.frequency;
        let part = |number: u64, size: f64| strength * size * noise(u64::from(self.seed) * 8 + number, x);
        let rotation = DQuat::from_rotation_y(part(0, self.angle))
            * DQuat::from_rotation_x(part(1, self.angle))
            * DQuat::from_rotation_z(part(2, 0.5 * self.angle));
        (rotation, DVec3::new(part(3, self.shift), part(4, self.shift), 0.0))
    }
}

/// Looks of a camera that affect a time, with their blend weights, the newest last.
pub(crate) fn active_looks(camera: &Camera, time: Time) -> impl Iterator<Item = (&CameraLook, f64)> {
    let started = camera.looks.partition_point(|look| look.start <= time);
    let started = &camera.looks[..started];
    let first = started.iter().rposition(|look| look.weight_at(time) >= 1.0).unwrap_or(0);
    started[first..].iter().map(move |look| (look, look.weight_at(time)))
}

/// Targets at which looks and callbacks aim a camera at a time.
pub(crate) fn aim_targets<'a>(
    camera: &'a Camera,
    index: usize,
    edits: &'a FrameEdits,
    time: Time,
) -> impl Iterator<Item = Target> + 'a {
    let edited = edits_for_index(&edits.cameras, index).filter_map(|edit| match edit {
        CameraEdit::LookAt(target) => Some(*target),
        _ => None,
    });
    active_looks(camera, time).filter_map(|(look, _)| look.target).chain(edited)
}

/// Applies looks, callback edits and shakes to the state that a camera's rig gives.
pub(crate) fn apply_moves(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    index: usize,
    actors: &[ActorState],
    state: CameraState,
) -> CameraState {
    let camera = &stage.cameras[index];
    let own = || edits_for_index(&edits.cameras, index);
    if camera.looks.is_empty() && camera.shakes.is_empty() && own().next().is_none() {
        return state;
    }
    let position = state.world_from_view.translation;
    let of_rig = DQuat::from_mat3(&state.world_from_view.matrix3);
    let (mut rotation, mut projection) = (of_rig, state.projection);
    let look = |target: &Target, projection: &mut Projection| {
        let way = target_position(stage, actors, target)? - position;
        *projection = limit_near_plane(camera, *projection, way.length());
        look_rotation(way)
    };
    for (active, share) in active_looks(camera, time) {
        let to = match &active.target {
            Some(target) => look(target, &mut projection).unwrap_or(rotation),
            None => of_rig,
        };
        rotation = if share >= 1.0 { to } else { slerp_level(rotation, to, share) };
    }
    for edit in own() {
        match edit {
            CameraEdit::MoveTo(_) | CameraEdit::Rig(_) | CameraEdit::Shake(_) => {}
            CameraEdit::Near(_) | CameraEdit::Far(_) => {}
            CameraEdit::LookAt(target) => rotation = look(target, &mut projection).unwrap_or(rotation),
            CameraEdit::Turn(turn) => rotation = (*turn * rotation).normalize(),
            CameraEdit::FieldOfView(yfov) => {
                let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) =
                    projection;
                let far = camera.far().filter(|_| matches!(projection, Projection::Perspective { .. }));
                projection = Projection::Perspective { yfov: *yfov, near, far };
            }
            CameraEdit::Height(height) => {
                let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) =
                    projection;
                let far = camera.far().unwrap_or(ORTHOGRAPHIC_FAR);
                projection = Projection::Orthographic { height: *height, near, far };
            }
        }
    }
    let mut moved = state;
    moved.projection = with_edited_planes(projection, own());
    moved.world_from_view.translation = position;
    let shaken = own().filter_map(|edit| match edit {
        CameraEdit::Shake(shake) => Some(shake.offset_at(time, 1.0)),
        _ => None,
    });
    let shakes = camera.shakes.iter().map(|shake| shake.offset_at(time, shake.strength(time)));
    for (turn, shift) in shakes.chain(shaken) {
        moved.world_from_view.translation += rotation * shift;
        rotation *= turn;
    }
    moved.world_from_view.matrix3 = DMat3::from_quat(rotation.normalize());
    moved
}

/// A projection with the clipping planes that callbacks set.
fn with_edited_planes<'a>(
    mut projection: Projection,
    edits: impl Iterator<Item = &'a CameraEdit>,
) -> Projection {
    for edit in edits {
        match (edit, &mut projection) {
            (
                CameraEdit::Near(given),
                Projection::Perspective { near, .. } | Projection::Orthographic { near, .. },
            ) => *near = *given,
            (CameraEdit::Far(given), Projection::Perspective { far, .. }) => *far = Some(*given),
            (CameraEdit::Far(given), Projection::Orthographic { far, .. }) => *far = *given,
            _ => {}
        }
    }
    projection
}

/// Spherical linear interpolation (slerp) of two rotations. If the horizon is level in both, it stays level in between.
fn slerp_level(a: DQuat, b: DQuat, share: f64) -> DQuat {
    let between = choreo_motion::slerp(a, b, share);
    let level = |q: DQuat| (q * DVec3::X).y.abs() < 1e-9 && (q * DVec3::Y).y > 0.0;
    let leveled = (level(a) && level(b)).then(|| look_rotation(between * DVec3::NEG_Z)).flatten();
    leveled.unwrap_or(between)
}

/// Limits the near plane of a perspective projection so that a target at `distance` metres is not clipped. A near plane that the script
/// sets stays.
pub(crate) fn limit_near_plane(camera: &Camera, projection: Projection, distance: f64) -> Projection {
    match projection {
        Projection::Perspective { yfov, near, far } if distance > 0.0 && !camera.near_is_set => {
            let near = near.min((distance * MAX_NEAR_SHARE) as f32).max(f32::MIN_POSITIVE);
            Projection::Perspective { yfov, near, far }
        }
        projection => projection,
    }
}

/// Rotation of a camera that looks along a direction, with +Y up. Looking straight down, the image's up is −Z; looking straight up, it is
/// +Z, as for a camera in front of a character that tilts. `None` for a zero or non-finite direction.
pub(crate) fn look_rotation(way: DVec3) -> Option<DQuat> {
    let back = -way.try_normalize()?;
    let right = DVec3::Y.cross(back);
    let right = if right.length() < 1e-9 { DVec3::X } else { right.normalize() };
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back));
    rotation.is_finite().then(|| rotation.normalize())
}
