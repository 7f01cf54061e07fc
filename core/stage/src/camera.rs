//! The active camera, its transform and its projection.

use crate::camera_moves::{apply_moves, limit_near_plane, look_rotation};
use crate::properties;
use crate::snapshot::{ActorState, CameraState};
use crate::stage::actor::{Actor, Attachment, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::channel::Property;
use crate::stage::channel::{keyed_value, vec3};
use crate::stage::edits::{CameraEdit, FrameEdits, edits_for_index};
use crate::stage::fade::elapsed_fraction;
use crate::stage::{Stage, StageError};
use crate::transforms::{target_position, world_from_attachment};
use choreo_asset::Projection;
use choreo_motion::{PropertyTarget, Time};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Azimuth and elevation, in radians, of the view of a stage without a camera: from the front, slightly from the right and above.
const DEFAULT_VIEW: (f64, f64) = (0.45, 0.18);

/// Index of the active camera: the target of the last cut so far, else the first camera. `None` if there is no camera.
pub(crate) fn active_camera_at(stage: &Stage, time: Time) -> Option<usize> {
    let cuts_so_far = stage.cuts.partition_point(|cut| cut.at <= time);
    active_camera_after(stage, cuts_so_far)
}

/// Index of the active camera after this number of cuts.
fn active_camera_after(stage: &Stage, cuts: usize) -> Option<usize> {
    let cut = stage.cuts[..cuts].last().map(|cut| cut.camera);
    cut.or((!stage.cameras.is_empty()).then_some(0)).filter(|c| *c < stage.cameras.len())
}

/// During a dissolve: the camera before the last cut, and its share of the image, 0..=1.
pub(crate) fn dissolving_at(stage: &Stage, time: Time) -> Option<(usize, f32)> {
    let cuts_so_far = stage.cuts.partition_point(|cut| cut.at <= time);
    let cut = stage.cuts[..cuts_so_far].last().filter(|cut| time < cut.at + cut.dissolve)?;
    let before = active_camera_after(stage, cuts_so_far - 1).filter(|before| *before != cut.camera)?;
    Some((before, 1.0 - elapsed_fraction(time - cut.at, cut.dissolve)))
}

/// Evaluates a camera at a time; without a camera, the stage is framed. `frame`: fits everything visible into the image.
pub(crate) fn evaluate_camera(
    stage: &Stage,
    frame: impl Fn(Option<usize>, f64, f64, Projection) -> Result<CameraState, StageError>,
    edits: &FrameEdits,
    time: Time,
    index: Option<usize>,
    actors: &[ActorState],
) -> Result<CameraState, StageError> {
    let Some((index, camera)) = index.and_then(|i| Some((i, stage.cameras.get(i)?))) else {
        let (azimuth, elevation) = DEFAULT_VIEW;
        return frame(None, azimuth, elevation, Projection::default());
    };
    if let Some(state) = state_without_poses(stage, edits, time, Some(index), actors) {
        return check_edited_planes(camera, edits, time, state);
    }
    let projection = keyed_projection(camera, time);
    let moved_to = edited_position(edits, index);
    let state = |position: DVec3, rotation: DQuat, projection: Projection| CameraState {
        camera: Some(index),
        world_from_view: DAffine3::from_rotation_translation(rotation, position),
        projection,
    };
    let of_rig = match edits.rig_of(index, camera) {
        Rig::Fixed { .. } | Rig::Follow { .. } | Rig::Orbit { .. } => CameraState::default(),
        Rig::File { actor, camera } => {
            let of_file = stage.actors.get(*actor).and_then(|a| a.asset.cameras.get(*camera as usize));
            let Some(of_file) = of_file else {
                return Err(StageError::Invalid {
                    place: format!("camera \"{}\"", stage.cameras[index].name),
                    what: format!("actor {actor} has no camera {camera} in its file"),
                });
            };
            let at = Attachment { actor: *actor, joint: Some(of_file.joint) };
            let world_from_camera = world_from_attachment(stage, actors, &at);
            let position = moved_to.unwrap_or(world_from_camera.translation);
            let scale = libm::cbrt(actors[*actor].world_from_model.matrix3.determinant().abs()) as f32;
            let keys_fov = stage.cameras[index].channels.iter().any(|c| c.property.is_lens());
            let projection = match (of_file.projection, projection) {
                // A script may animate the field of view of a file's camera.
                (Projection::Perspective { near, far, .. }, Projection::Perspective { yfov, .. })
                    if keys_fov =>
                {
                    Projection::Perspective { yfov, near, far }
                }
                (of_file, _) => animated_projection(&stage.actors[*actor], *camera, of_file, time),
            };
            let mut projection = scaled_projection(projection, scale);
            if stage.cameras[index].lens_is_set && !keys_fov {
                projection = with_lens(projection, stage.cameras[index].projection);
            }
            apply_script_planes(&stage.cameras[index], &mut projection);
            state(position, rotation_of(&world_from_camera.matrix3), projection)
        }
        Rig::Frame { azimuth, elevation } => {
            let mut framed = frame(Some(index), *azimuth, *elevation, projection)?;
            apply_script_planes(camera, &mut framed.projection);
            if let Some(position) = moved_to {
                framed.world_from_view.translation = position;
            }
            framed
        }
    };
    check_edited_planes(camera, edits, time, apply_moves(stage, edits, time, index, actors, of_rig))
}

/// The clipping planes of one projection with the lens of another.
fn with_lens(planes: Projection, lens: Projection) -> Projection {
    let (near, far) = match planes {
        Projection::Perspective { near, far, .. } => (near, far),
        Projection::Orthographic { near, far, .. } => (near, Some(far)),
    };
    match lens {
        Projection::Perspective { yfov, .. } => Projection::Perspective { yfov, near, far },
        Projection::Orthographic { height, far: usual, .. } => {
            Projection::Orthographic { height, near, far: far.unwrap_or(usual) }
        }
    }
}

/// Replaces the clipping planes of a framing camera or a file's camera by the planes that the script sets.
fn apply_script_planes(camera: &Camera, projection: &mut Projection) {
    let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) = projection;
    if camera.near_is_set {
        *near = camera.near();
    }
    if let Projection::Perspective { far, .. } = projection {
        *far = camera.far().or(*far);
    }
}

/// Returns an error if callbacks set a far plane that is not beyond the near plane.
fn check_edited_planes(
    camera: &Camera,
    edits: &FrameEdits,
    time: Time,
    state: CameraState,
) -> Result<CameraState, StageError> {
    let sets_plane =
        |(_, edit): &(usize, CameraEdit)| matches!(edit, CameraEdit::Near(_) | CameraEdit::Far(_));
    let (near, far) = match state.projection {
        Projection::Perspective { near, far, .. } => (near, far),
        Projection::Orthographic { near, far, .. } => (near, Some(far)),
    };
    match far.filter(|far| *far <= near && edits.cameras.iter().any(sets_plane)) {
        Some(far) => Err(StageError::Invalid {
            place: format!("camera \"{}\" at {} s", camera.name, time.as_secs()),
            what: format!("far must be more than near, got {far} and {near} from on_frame"),
        }),
        None => Ok(state),
    }
}

/// Position that callbacks set for a camera; `None` if they set none, or set a rig afterwards.
fn edited_position(edits: &FrameEdits, index: usize) -> Option<DVec3> {
    edits_for_index(&edits.cameras, index).rev().find_map(|edit| match edit {
        CameraEdit::MoveTo(position) => Some(Some(*position)),
        CameraEdit::Rig(_) => Some(None),
        _ => None,
    })?
}

/// State of a camera that depends only on the position of its target. `None` for the rigs `File` and `Frame`, and without a camera.
pub(crate) fn state_without_poses(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    index: Option<usize>,
    actors: &[ActorState],
) -> Option<CameraState> {
    let (index, camera) = index.and_then(|i| Some((i, stage.cameras.get(i)?)))?;
    let projection = keyed_projection(camera, time);
    let moved_to = edited_position(edits, index);
    // Keys belong to the camera's own rig.
    let keys = if edits.rig(index).is_some() { &[][..] } else { &camera.channels };
    let keyed_position = keyed_value(keys, Property::Translation, time).map(vec3);
    let target = |target: &Target| target_position(stage, actors, target).unwrap_or(DVec3::ZERO);
    let state = |position: DVec3, rotation: DQuat, projection: Projection| CameraState {
        camera: Some(index),
        world_from_view: DAffine3::from_rotation_translation(rotation, position),
        projection,
    };
    let looking = |position: DVec3, at: DVec3, fallback: DQuat| {
        let rotation = look_rotation(at - position).unwrap_or(fallback);
        state(position, rotation, limit_near_plane(camera, projection, (at - position).length()))
    };
    let of_rig = match edits.rig_of(index, camera) {
        Rig::Fixed { position, rotation, look_at } => {
            let position = moved_to.or(keyed_position).unwrap_or(*position);
            let keyed_rotation = keyed_value(keys, Property::Rotation, time).map(DQuat::from_array);
            let rotation = keyed_rotation.unwrap_or(*rotation).normalize();
            match look_at {
                Some(look_at) => looking(position, target(look_at), rotation),
                None => state(position, rotation, projection),
            }
        }
        Rig::Follow { target: followed, offset } => {
            let at = target(followed);
            let position = moved_to.unwrap_or(at + keyed_position.unwrap_or(*offset));
            looking(position, at, DQuat::IDENTITY)
        }
        Rig::Orbit { target: center, distance, elevation, azimuth, speed } => {
            let at = target(center);
            let rotation = orbit_rotation(azimuth + speed * time.as_secs(), *elevation);
            match moved_to {
                Some(position) => looking(position, at, rotation),
                None => state(
                    at + rotation * DVec3::new(0.0, 0.0, *distance),
                    rotation,
                    limit_near_plane(camera, projection, *distance),
                ),
            }
        }
        Rig::File { .. } | Rig::Frame { .. } => return None,
    };
    Some(apply_moves(stage, edits, time, index, actors, of_rig))
}

/// Rotation of an affine map without scale and shear: the −Z axis keeps its direction, and +Y is made orthogonal to it. Finite for any map.
pub(crate) fn rotation_of(matrix: &DMat3) -> DQuat {
    let back = matrix.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let up = matrix.y_axis;
    let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
    // The columns form a proper rotation even if the map mirrors, because a camera cannot be mirrored.
    DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)).normalize()
}

/// Projection of a file's camera as animated by the actor's clips. Splines overshoot, so the result is clamped to values that have a
/// projection matrix.
fn animated_projection(actor: &Actor, number: u32, projection: Projection, time: Time) -> Projection {
    match projection {
        Projection::Perspective { yfov, near, far } => {
            let animated = properties::property_at(actor, PropertyTarget::CameraYfov(number), [yfov], time);
            let yfov = animated.map_or(yfov, |[yfov]| yfov.clamp(1e-3, 3.1));
            Projection::Perspective { yfov, near, far }
        }
        Projection::Orthographic { height, near, far } => {
            let animated =
                properties::property_at(actor, PropertyTarget::CameraHeight(number), [height], time);
            let height = animated.map_or(height, |[height]| height.max(1e-6));
            Projection::Orthographic { height, near, far }
        }
    }
}

/// Scales the distances of a file's camera by the actor's scale (glTF ignores only the scale of nodes).
fn scaled_projection(projection: Projection, scale: f32) -> Projection {
    if !(scale.is_finite() && scale > 0.0) {
        return projection;
    }
    match projection {
        Projection::Perspective { yfov, near, far } => {
            Projection::Perspective { yfov, near: near * scale, far: far.map(|far| far * scale) }
        }
        Projection::Orthographic { height, near, far } => {
            Projection::Orthographic { height: height * scale, near: near * scale, far: far * scale }
        }
    }
}

fn keyed_projection(camera: &Camera, time: Time) -> Projection {
    let lens = camera.channels.iter().rev().filter(|c| c.property.is_lens());
    let yfov = lens.filter_map(|c| Some((c.property, c.at(time)?[0]))).next();
    match (camera.projection, yfov) {
        (Projection::Perspective { near, far, .. }, Some((property, value))) => {
            let yfov = if property == Property::FocalLength { Camera::yfov(value.max(0.0)) } else { value };
            // Splines overshoot, and a field of view of zero, or of π and more, has no projection matrix.
            Projection::Perspective { yfov: (yfov as f32).clamp(1e-3, 3.1), near, far }
        }
        (projection, _) => projection,
    }
}

/// Rotation of an orbiting camera, angles in radians. The image's up is defined everywhere: at elevation π/2 it points away from the side
/// of the azimuth (−Z at azimuth 0).
pub(crate) fn orbit_rotation(azimuth: f64, elevation: f64) -> DQuat {
    DQuat::from_rotation_y(azimuth) * DQuat::from_rotation_x(-elevation)
}
