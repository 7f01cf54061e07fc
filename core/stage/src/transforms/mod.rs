//! World transforms of actors and joints, and positions of targets.

pub(crate) mod order;
pub(crate) mod parents;

use crate::snapshot::ActorState;
use crate::stage::Stage;
use crate::stage::actor::Attachment;
use crate::stage::actor::Target;
use choreo_asset::widen;
use choreo_motion::Front;
use glam::{DAffine3, DQuat, DVec3};

/// Rotation about a frame's +Y that turns a front towards a world direction; identity if the direction is vertical or zero.
pub(crate) fn rotation_to_face(world_from_frame: &DAffine3, world_way: DVec3, front: Front) -> DQuat {
    let way = world_from_frame.matrix3.inverse() * world_way;
    let yaw = libm::atan2(way.x, way.z);
    if (way.x == 0.0 && way.z == 0.0) || !yaw.is_finite() {
        return DQuat::IDENTITY;
    }
    DQuat::from_rotation_y(yaw - front.yaw_rad())
}

/// World transform of an actor or of one of its joints. A joint that is not posed counts as at rest.
pub(crate) fn world_from_attachment(stage: &Stage, actors: &[ActorState], at: &Attachment) -> DAffine3 {
    let Some(state) = actors.get(at.actor) else { return DAffine3::IDENTITY };
    match at.joint {
        None => state.world_from_model,
        Some(joint) => state.world_from_model * model_from_joint(stage, actors, at.actor, joint),
    }
}

fn model_from_joint(stage: &Stage, actors: &[ActorState], actor: usize, joint: u32) -> DAffine3 {
    let posed = &actors[actor].model_from_joint;
    let all = if posed.is_empty() { stage.actors[actor].asset.rest_model_from_joint() } else { posed };
    all.get(joint as usize).map_or(DAffine3::IDENTITY, widen)
}

/// Position of a target; `None` for actors and joints that do not exist and for positions that are not finite.
pub(crate) fn target_position(stage: &Stage, actors: &[ActorState], target: &Target) -> Option<DVec3> {
    let at = match *target {
        Target::Point(point) => point,
        Target::Actor(actor) => {
            let middle = stage.actors.get(actor)?.asset.rest_bounds().center();
            actors.get(actor)?.world_from_model.transform_point3(middle.as_dvec3())
        }
        Target::Joint { actor, joint } => {
            stage.actors.get(actor)?;
            world_from_attachment(stage, actors, &Attachment { actor, joint: Some(joint) }).translation
        }
    };
    at.is_finite().then_some(at)
}
